# %% [markdown]
# # A brittle hinge: softening that snaps back
#
# A cantilever breaks at its clamp.  The more brittle the hinge and the more slender the beam, the
# larger is the ratio of the energy stored in the beam to the fracture energy when the hinge opens.
# If M_u²/G_f exceeds 3EI/L, load *and* displacement must decrease together, so neither can be
# prescribed.  Only the dissipated energy always grows.
#
# This demo shows
#
# * dissipation control, which distinguishes softening from elastic unloading,
# * the arc length, which controls the path while no energy is dissipated,
# * a closed form for the whole path,
# * the energy that a test under displacement control would release in its jump.
#
# Data: EI = 1 MN m², L = 2 m, M_u = 10 kN m; fracture energies from ductile to brittle.

# %%
# SPDX-License-Identifier: MIT
from pathlib import Path

import numpy as np
from scipy.integrate import trapezoid

import ufl_beam as ub

output = Path("output")
output.mkdir(exist_ok=True)

EI, L, M_u = 1e6, 2.0, 10e3  # N m², m, N m
stiff = 1e5 * EI / L**2  # N: shear and extension are negligible
section = ub.Section(EA=stiff, GA=stiff, EI=EI)
steepness = {0.3: "#009e73", 1.0: "#0072b2", 2.0: "#d55e00", 6.0: "#333333"}  # M_u²/G_f over 3EI/L


def broken(ratio, cells=16):
    """Return the path of the cantilever, with the tip load as a multiple of M_u/L."""
    energy = M_u**2 / (ratio * 3 * EI / L)  # J
    beam = ub.Beam(
        (0, 0), (L, 0), section, cells=cells,
        hinges={0.0: ub.Softening(limit=M_u, fracture_energy=energy)},
    )  # fmt: skip
    load = ub.PointLoad(beam.end, force=(0, M_u / L), amplitude=lambda t: t)
    scene = ub.Scene([beam], supports=[ub.Clamped(beam.start)], loads=[load])
    path = ub.follow(
        scene,
        ub.DissipationControl(energy / 40, ub.ArcLength(0.1)),
        until=lambda now: now.ledger.lost["hinges"] > 0.97 * energy,
        record=ub.VTKHDF(output / f"hinge_snapback_{ratio:g}.hdf"),
    )
    return beam, energy, path


# %% [markdown]
# ## The closed form
#
# With the jump α, the moment is M = M_u exp(-M_u α/G_f), the load F = M/L, and the displacement δ =
# F L³/3EI + α L.  The dissipated energy is G_f (1 - M/M_u), so it falls linearly with the moment M.

# %%
paths = {ratio: broken(ratio) for ratio in steepness}
ub.print_once(
    "M_u²/G_f   G_f     peak     states  dissipated  worst difference from the closed form"
)
ub.print_once(" / 3EI/L   (J)     F (kN)                                F        δ")
worst = []
for ratio, (beam, energy, path) in paths.items():
    α = path.material_at(beam.start).jump
    δ = path.displacement(beam.end)[:, 1]
    F = path.factor * M_u / L
    opens = α > 0
    F_closed = M_u * np.exp(-M_u * α / energy) / L
    δ_closed = F * L**3 / (3 * EI) + α * L
    errors = (
        np.abs(F - F_closed)[opens].max() / F.max(),
        np.abs(δ - δ_closed).max() / δ.max(),
    )
    worst.append(errors)
    lost = path.energy.lost["hinges"][-1] / energy
    ub.print_once(
        f"{ratio:8.1f} {energy:6.1f} {F[path.critical[0].n] / 1e3:10.4f} {len(F):9d} {lost:11.4f}"
        f"       {errors[0]:.1e}  {errors[1]:.1e}"
    )

# %% [markdown]
# ## What displacement control would jump over
#
# Displacement control follows the path to the largest load; then the load drops at constant
# displacement.  The area between the drop and the path is released energy.

# %%
beam, energy, path = paths[2.0]
δ, F = path.displacement(beam.end)[:, 1], path.factor * M_u / L
peak = int(np.argmax(F))
inside = np.flatnonzero(δ[peak:] < δ[peak]) + peak
back = np.append(inside, inside[-1] + 1)
jumped = trapezoid(δ[peak] - δ[back], -F[back])
held = F[peak] * δ[peak] / 2
ub.print_once(
    f"\n{energy:.2f} J of fracture energy: a drop of the load at constant displacement sets free"
)
ub.print_once(f"{jumped:.2f} J of the {held:.2f} J that the beam holds at the peak")

# %% [markdown]
# ## Pictures

# %%
with ub.picture((9, 5.5)) as displacements, ub.picture((8, 5)) as dissipation:
    left, right = displacements.subplots(), dissipation.subplots()
    for ratio, (beam, energy, path) in paths.items():
        color = steepness[ratio]
        δ, F = path.displacement(beam.end)[:, 1], path.factor * M_u / L
        α = np.linspace(0, 6 * energy / M_u, 400)
        closed = M_u * np.exp(-M_u * α / energy) / L
        left.plot(1e3 * (closed * L**3 / (3 * EI) + α * L), closed / 1e3, color="0.8", lw=5)
        label = rf"$M_u^2/G_f = {ratio:g} \cdot 3EI/L$"
        left.plot(1e3 * δ, F / 1e3, ".-", color=color, lw=1.2, ms=5, label=label)
        lost = path.energy.lost["hinges"]
        right.plot(lost / energy, F / 1e3, ".-", color=color, lw=1.2, ms=5)
    δ, F = paths[2.0][2].displacement(paths[2.0][0].end)[:, 1], paths[2.0][2].factor * M_u / L
    left.fill_betweenx(
        F[back] / 1e3, 1e3 * δ[back], 1e3 * δ[peak], color=steepness[2.0], alpha=0.2, lw=0
    )
    left.set_xlim(0, 60)
    left.set_ylim(0, 5.6)
    left.set_xlabel("displacement of the tip (mm)")
    left.set_ylabel("load (kN)")
    left.legend(loc="upper right")
    right.set_xlabel("dissipated part of the fracture energy")
    right.set_ylabel("load (kN)")
    right.set_ylim(0, 5.6)
displacements.savefig(output / "hinge_snapback_displacement.png")
dissipation.savefig(output / "hinge_snapback_dissipation.png")
ub.print_once("\npictures:", *sorted(map(str, output.glob("hinge_snap*.png"))), sep="\n  ")

# %% [markdown]
# ## Verification
#
# The remaining error of the displacement is due to the mesh, 1/(4·16²) of its elastic part.  The
# error of the load, 1e-4, is due to finite rotations.  The peak is a state of each path and a limit
# point.

# %%
assert np.max(worst) < 2e-3
assert all(path.critical[0].kind == "limit" for _, _, path in paths.values())
assert np.isclose(np.max(F), M_u / L, rtol=1e-3)

# %% [markdown]
# ## Try this
#
# * `ub.ArcLength(0.001)` alone: where does it end, and with which message?
# * ratio 0.3 with a second clamp at `beam.end`, and hinge and load at `beam.at(0.5)`: the load
#   rises on while the hinge opens, because the halves of the beam become stretched.
