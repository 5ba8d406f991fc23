# %% [markdown]
# # Vibrating frame: a hinge that softens is a damper
#
# A portal frame is struck at its top left corner and swings freely.  It is elastic except for one
# softening hinge at the top right corner, which opens when the bending moment reaches its limit.
# Neither the elastic material nor the scheme dissipates energy, so only the hinge damps the frame.
#
# This demo shows
#
# * a softening plastic hinge at a point, `Beam(..., hinges={1.0: Softening(limit, energy)})`, and
#   embedded in a cell, `Section(..., hinge=Softening(limit, energy))`,
# * logarithmic decrement and damping ratio from a history, `peaks` and `fit_decay`,
# * the ledger: the energy loss of the vibration equals the dissipation of the hinge to round-off,
# * the limited meaning of a "damping ratio" if a plastic hinge causes the damping,
# * the critical fracture energy, with which the hinge takes all energy of the frame.
#
# It follows section 4.4 of the paper and its Table 2, in which the fracture energy G_f of the hinge
# grows from a first value to ten times this value: the larger G_f, the smaller the damping.

# %%
# SPDX-License-Identifier: MIT
from itertools import pairwise
from pathlib import Path

import numpy as np

import ufl_beam as ub
import ufl_beam.structures as st

output = Path("output")
output.mkdir(exist_ok=True)

# %% [markdown]
# ## Scene
#
# The paper states the section, A = 10 cm², I = 1 cm⁴, E = 1 GPa, the step of 1 ms and the duration
# of 15 s.  Frame, mass and impulse are in a drawing without numbers, and moments of 3 kN m cannot
# belong to EI = 10 N m², because they would bend a beam to a radius of 3 mm.  So these are
# **assumptions**:
#
# * a square frame of 1 m with clamped feet, of a material with the density of water,
# * the limit M_u = 315 N cm, where the paper prints 315 kN cm,
# * G_f = 150 N cm, and a triangular impulse of 0.3 s whose elastic response just exceeds M_u: both
#   are chosen to match approximately the first decrement of Table 2,
# * a hinge at the corner, rigid before it opens: "linear elasticity with softening response".  So
#   the printed K = 500 MPa and M_y = 300 kN cm have no effect; a variant below uses them.

# %%
E, A, I = 1e9, 10e-4, 1e-8  # Pa, m^2, m^4: the paper's
h = np.sqrt(12 * I / A)  # the rectangle with this A and I, 91 mm by 11 mm
section = ub.Section.rectangle(b=A / h, h=h, E=E, nu=0.3, rho=1000.0)  # kg/m^3

limit, fracture = 3.15, 1.5  # N m, J
M_y, K = 3.0, 500e6  # N m, Pa: of the variant
impulse = ub.Table([0, 0.15, 0.3], [0, 1, 0])  # s
peak = 13.8  # N


def frame(factor, cells=8, at=1.0):
    """Return the frame, its corner, and the place of its hinge.

    Args:
        factor: Fracture energy of the hinge over ``fracture``; with zero there is no hinge.
        cells: Number of cells of each beam, without those next to the corner.
        at: Place of the hinge along the girder; m.
    """
    hinges = {at: ub.Softening(limit, factor * fracture)} if factor else {}
    left = ub.Beam((0, 0), (0, 1), section, cells=cells, name="left")  # m
    girder = ub.Beam(
        (0, 1), (1, 1), section, cells=cells, corners=(0.95,), hinges=hinges, name="girder"
    )
    right = ub.Beam((1, 1), (1, 0), section, cells=cells, name="right")
    return scene(left, girder, right), girder.end, girder.at(at)


def scene(left, *girder_and_right):
    """Return the scene of beams from foot to foot, joined rigidly and struck at the left corner."""
    beams = [left, *girder_and_right]
    return ub.Scene(
        beams=beams,
        joints=[ub.Rigid(a.end, b.start) for a, b in pairwise(beams)],
        supports=[ub.Clamped(left.start), ub.Clamped(beams[-1].end)],
        loads=[ub.PointLoad(left.end, force=(peak, 0), amplitude=impulse)],
    )


def swing(frame, end=6.5, record=()):
    """Simulate the free vibration; every fifth step is recorded, 120 per period."""
    scene, *places = frame
    scheme = ub.EnergyMomentum()  # conserves energy exactly: only the hinge dissipates
    solution = ub.simulate(
        scene, scheme, t=(0.0, end), dt=1e-3, every=5, record=record, progress=False
    )
    assert solution.energy.worst < 1e-9
    return solution, *places


# %% [markdown]
# ## Runs
#
# The first run has no hinge and finds the moment that the impulse would cause.  The other runs have
# the fracture energies of Table 2.  Decrements are taken from the first eight periods, for which
# 6.5 s are enough; two runs continue to the paper's 15 s.

# %%
elastic, corner, _ = swing(frame(0), 2.0)
moment_ratio = np.abs(elastic.section_forces_at(corner)[:, 2]).max() / limit
ub.print_once(f"without a hinge the moment at the corner reaches {moment_ratio:.3f} M_u\n")

factors = (1, 1.2, 1.4, 1.6, 1.8, 2, 2.2, 10)
files = ub.VTKHDF(output / "vibrating_frame.hdf", every=100)
runs = {
    factor: swing(frame(factor), 15.0 if factor in (1, 10) else 6.5, files if factor == 1 else ())
    for factor in factors
}
for factor in (1, 10):
    ub.print_once(f"G_f × {factor}\n{runs[factor][0]}\n")

# %% [markdown]
# ## Decrement and damping ratio
#
# The amplitude of a swing is half the difference between a maximum of u and the next minimum, so
# the shift of the middle by the open hinge does not matter.  The corner sinks whenever the frame
# sways to either side, by v ≈ −0.6 u²/H.  The minima of v occur twice in a period and are
# proportional to the square of u.  Half the time and twice the logarithm compensate, so **both
# displacements have the same decrement**, as in the paper's table.  The minima of two successive
# sways, left and right, are averaged.

# %%
PERIODS = 8


def decays(run):
    """Return the decay of the corner's horizontal and vertical displacement after the impulse."""
    solution, corner, _ = run
    free = solution.times > impulse.times[-1]
    t, (u, v, _) = solution.times[free], solution.displacement(corner)[free].T
    (times, highest), (_, lowest) = (st.peaks(t, x, prominence=0.2) for x in (u, -u))
    n = min(PERIODS + 1, len(highest), len(lowest))
    horizontal = st.fit_decay(times[:n], (highest[:n] + lowest[:n]) / 2)
    times, sinking = st.peaks(t, -v, prominence=0.1)
    n = min(2 * PERIODS + 1, len(sinking) - 1)
    vertical = st.fit_decay(times[:n], (sinking[:n] + sinking[1 : n + 1]) / 2)
    return horizontal, vertical


decay = {factor: decays(run) for factor, run in runs.items()}
lost = {
    factor: np.interp(6.5, s.times, s.energy.lost["hinges"]) / s.energy.supplied["loads"][-1]
    for factor, (s, *_) in runs.items()
}

printed = {  # Table 2 of the paper
    "horizontal": (
        (0.077, 0.062, 0.038, 0.025, 0.017, 0.013, 0.006, 0.003),
        (0.012, 0.010, 0.006, 0.004, 0.003, 0.002, 0.001, 0.001),
    ),
    "vertical": (
        (0.076, 0.061, 0.038, 0.025, 0.017, 0.013, 0.006, 0.003),
        (0.012, 0.010, 0.006, 0.004, 0.003, 0.002, 0.001, 0.000),
    ),
}


def row(name, values, digits):
    """Print a line of the table."""
    ub.print_once(f"{name:38s}" + "".join(f"{value:>8.{digits}f}" for value in values))


meshes = (16, 32, 64)
finer = {cells: {f: decays(swing(frame(f, cells))) for f in factors} for cells in meshes}

ub.print_once(f"{'fracture energy G_f':38s}" + "".join(f"{f'{f:g}x':>8s}" for f in factors))
for direction, (name, (δ_paper, ζ_paper)) in enumerate(printed.items()):
    δ, ζ = ([getattr(decay[f][direction], x) for f in factors] for x in ("decrement", "ratio"))
    ub.print_once(f"{name} displacement")
    row("  logarithmic decrement δ, 8 cells", δ, 4)
    for cells in meshes:
        row(f"    {cells} cells", [finer[cells][f][direction].decrement for f in factors], 4)
    row("    printed in the paper, other frame", δ_paper, 3)
    row("  damping ratio ζ, 8 cells", ζ, 4)
    row("    printed in the paper, other frame", ζ_paper, 3)
row("energy lost in 6.5 s, part of the work", [lost[f] for f in factors], 4)
ub.print_once("\ndecrement of each of the first periods, horizontal displacement")
for f in (1, 1.4, 10):
    ub.print_once(f"  {f:3g}x  " + "".join(f"{d:8.3f}" for d in decay[f][0].decrements))

# %% [markdown]
# ## What the numbers mean
#
# The trend agrees with the paper: the damping ratio falls with every step of G_f and nearly
# vanishes at ten times the energy.  Each opening dissipates energy, which reduces the moment of the
# next swing, but it also reduces the limit of the hinge.  With a large G_f the limit hardly
# changes, the moments fall below the limit, and from then on the frame is elastic.  With a small
# G_f the limit falls as fast as the moments, and the hinge opens again and again.
#
# So this damping **ends**.  A decrement is a mean over the counted periods, not a property of the
# frame.  It also depends on how far the impulse exceeds the limit: if the impulse is weaker by a
# tenth, the vibration is not damped at all.  A difference of one per cent in the peak moment
# determines how long the hinge continues to open, so even the mesh has an influence: 16 cells in
# each beam reduce the peak moment by a hundredth, and the first decrement by a fifth.
#
# **The agreement with the printed 0.077 holds for 8 cells only, in both directions**, because G_f
# and the impulse were chosen with 8 cells.  The columns of 1.2 and more were not fitted: on all
# meshes they fall with G_f as the printed ones do, but not at the same rate.  The numbers hold for
# one frame, the trend is robust.  It reverses if G_f is so small that the hinge opens completely.
#
# ## The critical fracture energy
#
# According to the paper, the fracture energy that stops the vibration is related to the energy in
# the frame.  A hinge cannot dissipate more than G_f.  If G_f is less than the energy W of the
# impulse, the hinge opens completely, and W - G_f remains as the vibration of a frame with a
# revolute joint.  If G_f is larger, the hinge keeps a resistance that the moments no longer reach,
# and the elastic frame vibrates on.  Between both, at G_f = W, nearly nothing remains.

# %%
W = runs[1][0].energy.supplied["loads"][-1]  # J
energies = np.array([0.4, 0.6, 0.7, 0.8, 0.85, 0.88, 0.9, 0.95, 1.0, 1.2, 1.5])  # J
ends = [swing(frame(G_f / fracture), 15.0)[0].energy for G_f in energies]
remains = np.array([energy.total[-1] for energy in ends])
taken = np.array([energy.lost["hinges"][-1] for energy in ends]) / energies
ub.print_once(f"\nenergy of the frame after 15 s, of {1e3 * W:.1f} mJ")
ub.print_once("  G_f (J)   remains (mJ)   W - G_f (mJ)   dissipated / G_f")
for G_f, left, part in zip(energies, remains, taken, strict=True):
    ub.print_once(f"  {G_f:7.2f} {1e3 * left:14.2f} {1e3 * max(W - G_f, 0):14.2f} {part:18.6f}")

# %% [markdown]
# ## The hinge embedded in a cell
#
# In the paper the hinge is a jump of the rotation in the middle of a cell.  The last 4 cm of the
# girder are now such a cell.  Its hinge is 2 cm from the corner, where the moment is smaller by a
# twenty-fifth, so it is compared with a hinge of zero length at the same place.  The variant adds
# the printed hardening to this cell: its bulk yields at M_y = 300 N cm and hardens with K I until
# the moment reaches M_u.


# %%
def embedded(bending=None, length=0.04):
    """Return the frame with an embedded hinge in the last cell of the girder."""
    law = ub.Softening(limit, fracture)
    weak_section = ub.Section.rectangle(
        b=A / h, h=h, E=E, nu=0.3, rho=1000.0, bending=bending, hinge=law
    )
    left = ub.Beam((0, 0), (0, 1), section, cells=8, name="left")
    girder = ub.Beam((0, 1), (1 - length, 1), section, cells=8, name="girder")
    weak = ub.Beam(
        (1 - length, 1), (1, 1), weak_section, cells=1, hinges={0.0: None, 1.0: None}, name="weak"
    )
    right = ub.Beam((1, 1), (1, 0), section, cells=8, name="right")
    return scene(left, girder, weak, right), weak.end, weak.at(0.5)


kinds = {
    "at the corner": runs[1],
    "at a point, 2 cm from it": swing(frame(1, at=0.98)),
    "embedded, 2 cm from it": swing(embedded()),
    "embedded, K and M_y": swing(embedded(ub.ElastoPlastic(M_y, isotropic=K * I))),
}
ub.print_once("\nhinge, G_f × 1                 δ     lost in 6.5 s by hinge, by bulk (mJ)")
for name, run in kinds.items():
    lost_by = [
        1e3
        * np.interp(6.5, run[0].times, run[0].energy.lost.get(entry, np.zeros_like(run[0].times)))
        for entry in ("hinges", "plastic")
    ]
    ub.print_once(
        f"  {name:26s} {decays(run)[0].decrement:.4f} {lost_by[0]:22.1f} {lost_by[1]:9.1f}"
    )

# %% [markdown]
# ## Pictures

# %%
shades = {1: "#0072B2", 1.4: "#D55E00", 10: "#A0A0A0"}

with ub.picture((9, 5.6)) as histories:
    axes = histories.subplots(2, 1, sharex=True)
    for f in (10, 1):
        solution, corner, _ = runs[f]
        for ax, x in zip(axes, solution.displacement(corner).T, strict=False):
            label = f"fracture energy {100 * f * fracture:g} N cm"
            ax.plot(solution.times, 100 * x, color=shades[f], lw=1.5, label=label)
    axes[0].set_ylabel("horizontal (cm)")
    axes[1].set_ylabel("vertical (cm)")
    axes[1].set_xlabel("time (s)")
    axes[0].set_xlim(0, 15)
    histories.align_ylabels()
    histories.legend(*axes[0].get_legend_handles_labels(), loc="outside upper center", ncols=2)

with ub.picture((9, 5.6)) as losses:
    upper, lower = losses.subplots(2, 1, sharex=True)
    for f in factors:
        energy, t = runs[f][0].energy, runs[f][0].times
        pale = 0.0 if f == 10 else 0.75 * (f - 1) / 1.2
        color = shades[10] if f == 10 else (pale, 0.45 + 0.4 * pale, 0.7 + 0.2 * pale)
        for ax, joules in ((upper, energy.total), (lower, energy.lost["hinges"])):
            ax.plot(t[t <= 6.5], 1e3 * joules[t <= 6.5], lw=1.8, color=color)
        if f in (1, 1.2, 1.4, 10):
            ends = (
                1e3 * np.array([energy.total, energy.lost["hinges"]])[:, np.flatnonzero(t <= 6.5)]
            )
            for ax, end in zip((upper, lower), ends[:, -1], strict=True):
                ax.annotate(f" {f:g}×", (6.5, end), color=color, va="center")
    upper.set_ylabel("total energy (mJ)")
    lower.set_ylabel("dissipated by\nthe hinge (mJ)")
    lower.set_xlabel("time (s)")
    lower.set_xlim(0, 6.5)
    losses.align_ylabels()
    upper.set_title(f"fracture energy 1× to 2.2× and 10× of {100 * fracture:g} N cm", loc="left")

with ub.picture((9, 8.5)) as hinge:
    (loops, ratios), (critical, places) = hinge.subplots(2, 2)
    for f in (1, 1.4, 10):
        solution, corner, _ = runs[f]
        material = solution.material_at(corner)
        M, jump = material.forces[:, 2], 1e3 * material.jump
        loops.plot(jump, M, color=shades[f], lw=1.2, label=f"{f:g}×")
    loops.set_xlabel("rotation of the hinge (mrad)")
    loops.set_ylabel("moment (N m)")
    loops.set_ylim(-1.1 * limit, 1.45 * limit)
    loops.legend(loc="upper center", ncols=3)
    ζ = [100 * decay[f][0].ratio for f in factors]
    ζ_paper = 100 * np.array(printed["horizontal"][1])
    ratios.plot(factors, ζ_paper, "s", color=shades[10], label="Table 2, another frame")
    ratios.plot(factors, ζ, "o-", color=shades[1], label="8 cells")
    ζ_fine = [100 * finer[64][f][0].ratio for f in factors]
    ratios.plot(factors, ζ_fine, "o--", color=shades[1.4], label="64 cells")
    ratios.set_xscale("log")
    ratios.set_xticks((1, 1.4, 2, 10), ("1×", "1.4×", "2×", "10×"))
    ratios.minorticks_off()
    ratios.set_ylim(0, None)
    ratios.set_xlabel(f"fracture energy, 1× is {100 * fracture:g} N cm")
    ratios.set_ylabel("damping ratio (%)")
    ratios.legend()
    critical.axvline(W, color="0.3", ls=":", lw=1.2)
    critical.text(W + 0.02, 700, "W")
    critical.plot(
        energies, 1e3 * np.maximum(W - energies, 0), color=shades[10], lw=6, label="W - $G_f$"
    )
    critical.plot(energies, 1e3 * remains, "o-", color=shades[1], label="remains after 15 s")
    critical.set_xlabel("fracture energy (J)")
    critical.set_ylabel("energy of the frame (mJ)")
    critical.set_ylim(0, 800)
    critical.legend()
    for name, color in (
        ("at a point, 2 cm from it", shades[10]),
        ("embedded, 2 cm from it", shades[1]),
    ):
        solution, _, place = kinds[name]
        style = {"lw": 4, "alpha": 0.6} if color == shades[10] else {"lw": 1.2}
        jump = 1e3 * solution.material_at(place).jump
        places.plot(solution.times, jump, color=color, label=name.split(",")[0], **style)
    places.set_xlabel("time (s)")
    places.set_ylabel("rotation of the hinge (mrad)")
    places.legend()

pictures = {"histories": histories, "energy": losses, "hinge": hinge}
for name, figure in pictures.items():
    figure.savefig(output / f"vibrating_frame_{name}.png")
shapes = ub.plot(runs[1][0], "shapes", times=np.arange(0.3, 2.1, 0.31))
shapes.savefig(output / "vibrating_frame_shapes.png")
names = sorted(str(path) for path in output.glob("vibrating_frame*"))
ub.print_once("\npictures and data:", *names, sep="\n  ")

# %% [markdown]
# ## Verification
#
# The results confirm the trend of Table 2: each larger fracture energy causes less damping, and the
# largest nearly none.  Both directions have equal decrements.  The ledger shows that only the hinge
# dissipates energy.

# %%
horizontal, vertical = (np.array([decay[f][d].ratio for f in factors]) for d in (0, 1))
assert np.all(np.diff(horizontal) < 0)
assert np.all(np.diff(vertical) < 0)
assert horizontal[-1] < 0.1 * horizontal[0]
assert np.allclose(vertical, horizontal, rtol=0.2)
for mesh in finer.values():
    for direction in (0, 1):
        assert np.all(np.diff([mesh[f][direction].ratio for f in (1, 1.4, 10)]) < 0)
for solution, *_ in runs.values():
    assert set(solution.energy.lost) == {"hinges"}
opened = energies <= 0.8
assert np.allclose(taken[opened], 1, rtol=1e-6)
# The work of the impulse changes by less than 1 mJ, because the hinge opens earlier
assert np.allclose(remains[opened], W - energies[opened], rtol=0, atol=1e-3)
assert abs(energies[remains.argmin()] / W - 1) < 0.02
point, cell = (decays(kinds[f"{kind}, 2 cm from it"])[0] for kind in ("at a point", "embedded"))
assert abs(cell.decrement / point.decrement - 1) < 0.02
ub.print_once("trend of Table 2 reproduced")

# %% [markdown]
# ## Try this
#
# * `fracture = 0.3`: the hinge opens completely in the first swing; how large is the damping then?
# * `peak = 12.0`: the hinge never opens and dissipates nothing; the decrements of the peaks are
#   below 0.002, because modes exchange energy,
# * `ub.LinearSoftening` instead of `ub.Softening`: the resistance vanishes completely.
