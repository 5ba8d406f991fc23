# %% [markdown]
# # Roll-up: a cantilever bent to a circle and beyond
#
# A moment at the free end bends a straight cantilever to an arc of constant curvature κ = M/EI, and
# M = 2π EI/L closes the circle.  This problem has large rotations and a closed-form solution, so it
# is the usual first test of geometrically exact beams.
#
# This demo shows
#
# * statics with time as the load parameter,
# * rotations of any size, here two full turns,
# * the mesh error, measured and compared with its closed form.
#
# Data: aluminium cantilever, L = 1 m, 2 cm².

# %%
# SPDX-License-Identifier: MIT
from pathlib import Path

import numpy as np

import ufl_beam as ub

output = Path("output")
output.mkdir(exist_ok=True)

E, A, I, L = 73e9, 2e-4, 0.1667e-8, 1.0  # Pa, m^2, m^4, m
section = ub.Section(EA=E * A, GA=5 / 6 * E * A / 2.6, EI=E * I)
turns = 2.0


def roll_up(cells, steps=16):
    """Simulate the cantilever under a moment that grows to two full circles."""
    beam = ub.Beam((0, 0), (L, 0), section, cells=cells, name="cantilever")
    moment = ub.PointLoad(
        beam.end, moment=turns * 2 * np.pi * section.EI / L, amplitude=ub.ramp(1.0)
    )
    scene = ub.Scene([beam], supports=[ub.Clamped(beam.start)], loads=[moment])
    return beam, ub.simulate(scene, ub.Static(), t=(0.0, 1.0), dt=1 / steps, progress=False)


# %% [markdown]
# ## Two circles
#
# The tip moves on the curve x = sin(ML/EI) EI/M, y = (1 - cos(ML/EI)) EI/M.

# %%
beam, solution = roll_up(cells=32)
ub.print_once("cantilever rolled up twice\n" + str(solution))

ψ = solution.displacement(beam.end)[:, 2]
assert np.allclose(ψ, solution.times * turns * 2 * np.pi, atol=1e-9)

# %% [markdown]
# ## The error of the mesh
#
# A cell of length h, whose rotation changes by κh between its ends, is a chord of length h.  The
# exact arc of length h has a chord of h sin(κh/2)/(κh/2).  Therefore the radius of the polygon is
# too large by the factor (κh/2)/sin(κh/2), an error of second order.  Moment and curvature are
# exact.  The error is measured at half a circle, where the exact tip is at (0, 2/κ).

# %%
meshes = np.array([4, 8, 16, 32, 64, 128])
errors = []
for cells in meshes:
    b, s = roll_up(cells)
    quarter = int(np.argmin(np.abs(s.times - 0.25)))  # M = π EI/L, half a circle
    tip = s.position(b.end)[quarter]
    errors.append(np.hypot(*(tip - (0.0, 2 * L / np.pi))))
errors = np.array(errors)
half_angle = np.pi / (2 * meshes)
exact_errors = 2 * L / np.pi * (half_angle / np.sin(half_angle) - 1)
orders = np.log2(errors[:-1] / errors[1:])
ub.print_once("\ncells  tip error (m)  order")
for cells, error, order in zip(meshes, errors, ["", *(f"{o:.3f}" for o in orders)], strict=True):
    ub.print_once(f"{cells:5d}  {error:.6e}   {order}")

# %% [markdown]
# ## Pictures

# %%
shapes = ub.plot(solution, "shapes", count=9)
shapes.savefig(output / "roll_up_shapes.png")

with ub.picture((7, 4.5)) as figure:
    ax = figure.subplots()
    ax.loglog(meshes, exact_errors, color="0.7", lw=4, label="polygon, closed form")
    ax.loglog(meshes, errors, "o", color="C0", label="computed")
    ax.set_xlabel("cells")
    ax.set_ylabel("error of the tip after half a circle (m)")
    ax.legend(frameon=False)
figure.savefig(output / "roll_up_error.png")
ub.print_once("\npictures:", *sorted(str(p) for p in output.glob("roll_up*")), sep="\n  ")

# %% [markdown]
# ## Verification
#
# The computed error equals the closed form of the polygon to solver tolerance: the element has only
# this geometric error, and no locking in shear or extension.

# %%
assert np.allclose(errors, exact_errors, rtol=1e-5)
assert np.all(np.abs(orders[1:] - 2) < 0.02)

# %% [markdown]
# ## Try this
#
# * a transverse force instead of the moment: compare the result with the elastica,
# * `steps=2`: how large can a static step be before it is subdivided?
