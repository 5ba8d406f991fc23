# %% [markdown]
# # Emergency stop: a hinge that opens and saves the arm
#
# A slender arm of a pick-and-place machine turns with its payload at 4 rad/s when the brake of its
# hub closes within 20 ms.  The moment at the hub would bend the arm permanently.  A predetermined
# breaking joint at the hub prevents this: it opens and dissipates exactly its fracture energy.
# From then on it is a revolute joint, about which the arm swings.
#
# This demo shows
#
# * a hinge that softens, P(49)-P(53), at a chosen place of a moving beam,
# * the transition from a rigid joint to a revolute joint without a change of the model,
# * the ledger: the energy that the drive supplies, and its distribution.
#
# The data of the machine are realistic assumptions: an aluminium tube 50 x 2 mm of 1.5 m and a
# payload of 2 kg, in the horizontal plane, so that gravity does no work.

# %%
# SPDX-License-Identifier: MIT
import math
from pathlib import Path

import numpy as np

import ufl_beam as ub

output = Path("output")
output.mkdir(exist_ok=True)

# %% [markdown]
# ## Scene
#
# The rotation of the hub is prescribed: it reaches its speed within 0.3 s and keeps it until the
# brake closes at 0.5 s.  The breaking joint is at the hub.  It opens at M_u = 300 N m, twice the
# moment of the drive, and its fracture energy G_f = 20 J is half of the kinetic energy.

# %%
L, payload = 1.5, 2.0  # m, kg
tube = ub.Section.tube(d=0.050, t=0.002, E=70e9, nu=0.33, rho=2700.0)  # m, Pa, -, kg/m^3
M_yield = 250e6 * tube.EI / 70e9 / 0.025  # N m: 250 MPa in the outermost fibre
M_u, G_f = 300.0, 20.0  # N m, J

speed = 4.0  # rad/s
t_up, t_brake, braking = 0.3, 0.5, 0.02  # s


def hub(t):
    """Rotation of the hub; rad."""
    up = min(t, t_up)
    turned = speed * (up / 2 - t_up / (2 * math.pi) * math.sin(math.pi * up / t_up))
    stop = min(max(t - t_brake, 0.0), braking)
    at_speed = max(min(t, t_brake) - t_up, 0.0)
    return turned + speed * (at_speed + stop - stop**2 / (2 * braking))


def run(hinges, record=()):
    """Return the arm and its motion for 1.3 s."""
    arm = ub.Beam((0, 0), (L, 0), tube, cells=20, hinges=hinges, name="arm")
    drive = ub.PrescribedDisplacement(arm.start, u=0, v=0, psi=hub)
    scene = ub.Scene([arm], supports=[drive], masses=[ub.PointMass(arm.end, payload)])
    scheme = ub.EnergyMomentum(alpha=0.02)
    return arm, ub.simulate(scene, scheme, t=(0.0, 1.3), dt=1e-3, record=record, progress=False)


# %% [markdown]
# ## Two runs
#
# The arm is simulated with and without the breaking joint.  The brake excites vibrations far above
# the lowest natural frequencies of the arm.  `alpha` damps them; the ledger lists this loss as
# "numerical".

# %%
breaking = {0.0: ub.Softening(M_u, G_f)}
arm, saved = run(breaking, record=ub.VTKHDF(output / "emergency_stop.hdf", every=10))
rigid_arm, bent = run({})

t = saved.times
at_hinge = saved.material_at(arm.start)
M, jump, dissipated = at_hinge.forces[:, 2], at_hinge.jump, at_hinge.hinge
M_without = bent.section_forces_at(rigid_arm.start)[:, 2]
opens = int(np.argmax(jump != 0.0))
complete = int(np.argmax(dissipated > (1 - 1e-9) * G_f))
half = int(np.argmax(dissipated > G_f / 2))
free = t >= t[complete]

ub.print_once("with the breaking joint\n" + str(saved))
ub.print_once("\nwithout\n" + str(bent))
ub.print_once(
    f"\nmoment at the hub: {np.abs(M[t < t_brake]).max():.0f} N m to get up to speed; in the stop "
    f"{np.abs(M_without).max():.0f} N m without\nthe joint (the tube yields at {M_yield:.0f} N m) "
    f"and {np.abs(M).max():.0f} N m with it"
    f"\nthe joint opens at {t[opens]:.3f} s, has lost half of G_f at {t[half]:.3f} s and all but "
    f"1e-9 of it at {t[complete]:.3f} s, at {jump[complete]:.2f} rad"
    f"\ndissipated: {dissipated[-1]:.9f} J of {G_f:g} J; moment afterwards at most "
    f"{np.abs(M[free]).max():.1e} N m"
)

# %% [markdown]
# ## Pictures
#
# The pictures show the arm every 50 ms, the moment at the hub, the jump of rotation in the joint,
# and the distribution of the energy.

# %%
from matplotlib import colormaps
from matplotlib.cm import ScalarMappable
from matplotlib.colors import ListedColormap, Normalize

ink, grey, blue, sky, orange, red = "#222222", "0.6", "#0072B2", "#56B4E9", "#E69F00", "#D55E00"
colors = ListedColormap(colormaps["viridis"](np.linspace(0.0, 0.88, 256)))
of_time = Normalize(0.0, t[-1])


def strobe(axes, solution, beam):
    """Draw shapes every 50 ms, coloured by time, and the path of the payload."""
    for n in range(0, len(t), 50):
        x, y = solution.shape(beam, n).T
        axes.plot(x, y, color=colors(of_time(t[n])), lw=2.0, zorder=3)
        axes.plot(x[-1], y[-1], "o", ms=9, color=colors(of_time(t[n])), zorder=4)
    axes.plot(*solution.position(beam.end).T, color=grey, lw=1.0, zorder=1)
    axes.plot(0, 0, "s", ms=10, color=ink, zorder=5)
    stop = hub(t_brake + braking)
    axes.plot(*np.outer((np.cos(stop), np.sin(stop)), (0.0, 1.8)), "--", color=grey, zorder=2)
    axes.text(0.32, 1.7, "the hub stops", color="0.4", fontsize=11)
    axes.set(aspect="equal", xlim=(-1.75, 1.75), ylim=(-0.8, 1.9), xlabel="x (m)", ylabel="y (m)")


def balance(axes, energy):
    """Draw stacked energies, whose sum is the energy supplied by the drive."""
    shares = {
        "kinetic": (blue, "kinetic"), "stored": (sky, "stored"), "hinges": (orange, "lost: joint"),
        "numerical": (grey, "lost: scheme"),
    }  # fmt: skip
    entries = {**energy.state, **energy.lost}
    areas = [entries.get(name, np.zeros_like(t)) for name in shares]
    axes.stackplot(
        t, *areas, colors=[color for color, _ in shares.values()], alpha=0.85, lw=0,
        labels=[name for _, name in shares.values()],
    )  # fmt: skip
    axes.plot(t, energy["supports"], color=ink, label="supplied by the drive")
    axes.set(ylabel="energy (J)", ylim=(0, 50))


pictures = {
    "emergency_stop": (saved, arm, "with the joint: the arm swings on"),
    "emergency_stop_bent": (bent, rigid_arm, "without the joint: the hub bends the arm"),
}
for name, (solution, beam, title) in pictures.items():
    with ub.picture((9, 6.6)) as figure:
        axes = figure.subplots()
        strobe(axes, solution, beam)
        axes.set_title(title, loc="left")
        figure.colorbar(ScalarMappable(of_time, colors), ax=axes, label="time (s)", shrink=0.85)
    figure.savefig(output / f"{name}.png")

with ub.picture((9, 6.5)) as figure:
    moments, jumps = figure.subplots(2, 1, sharex=True)
    moments.plot(t, M_without, color=grey, label="without")
    moments.plot(t, M, color=red, label="with the joint")
    for level, name in ((M_yield, "yield of the tube"), (M_u, "$M_u$ of the joint")):
        moments.axhline(level, color="0.3", ls=":", lw=1.2)
        moments.text(0.005, level + 50, name, fontsize=11, color="0.3")
    moments.set(ylabel="hub moment (N m)", ylim=(-1100, 1300))
    moments.legend(loc="lower left")
    jumps.plot(t, jump, color=blue, label="jump (rad)")
    jumps.plot(t, dissipated / G_f, color=orange, label="dissipated / $G_f$")
    jumps.axhline(1.0, color="0.3", ls=":", lw=1.2)
    jumps.set_ylabel("the joint")
    jumps.legend(loc="upper left")
    jumps.set(xlabel="time (s)", xlim=(0, t[-1]))
    figure.align_ylabels()
figure.savefig(output / "emergency_stop_moments.png")

with ub.picture((9, 6.5)) as figure:
    without, protected = figure.subplots(2, 1, sharex=True)
    balance(without, bent.energy)
    balance(protected, saved.energy)
    without.set_title("without the joint", loc="left")
    protected.set_title("with the joint", loc="left")
    protected.set(xlabel="time (s)", xlim=(0, t[-1]))
    handles, labels = protected.get_legend_handles_labels()
    figure.legend(handles, labels, loc="outside lower center", ncols=3)
figure.savefig(output / "emergency_stop_energy.png")
ub.plot(saved, "hinge", arm.start).savefig(output / "emergency_stop_hinge.png")
ub.print_once(
    "\npictures and data:", *sorted(str(p) for p in output.glob("emergency*")), sep="\n  "
)

# %% [markdown]
# ## Verification
#
# The hinge dissipates exactly its fracture energy, and the ledger closes.  Afterwards the hinge is
# a revolute joint without moment and dissipation, and the arm swings freely with constant angular
# momentum about the hub.

# %%
for solution in (saved, bent):
    assert solution.energy.worst < 1e-9
    assert solution.iterations <= 5 * solution.substeps
    for values in solution.energy.lost.values():
        assert np.diff(values).min() >= 0.0
assert np.abs(M[t < t_brake]).max() < M_u / 2
assert np.abs(M_without).max() > M_yield
assert np.abs(M).max() < 1.01 * M_u
assert abs(dissipated[-1] / G_f - 1) < 1e-9
assert dissipated[-1] - dissipated[complete] < 1e-9 * G_f
assert np.abs(M[free]).max() < 1e-8 * M_u
momentum = saved.momentum()[free, 2]
ub.print_once(
    f"\nangular momentum afterwards: {momentum.mean():.3f} N m s, within {np.ptp(momentum):.0e}"
)
assert np.ptp(momentum) < 1e-2 * momentum.mean()

# %% [markdown]
# ## Try this
#
# * `LinearSoftening(M_u, G_f)`: the joint is completely open at 2 G_f/M_u = 0.13 rad,
# * `G_f = 60.0`: more than the energy of the arm; where does it stop?
# * `tube` with `bending=ub.ElastoPlastic(M_yield, isotropic=...)`: how far does the arm bend
#   without the joint?
