# %% [markdown]
# # Bricard's mechanism: six hinges that move although they should not
#
# Five rods and the ground form a loop along edges of a cube, with six hinges, each normal to both
# of its rods.  Five rods have 30 degrees of freedom, and six hinges hold 30: the loop should be
# rigid.  It moves, because one of the 30 conditions follows from the others.
#
# This demo shows
#
# * rigid bodies in space with revolute joints and one universal joint, which leaves out the
#   condition that follows from the others,
# * energy that stays constant for 20 s, and convergence to an independent solution,
# * the same loop with elastic rods, in which all six joints are revolute.
#
# The rods are those of the benchmark A04 of the IFToMM library of multibody problems.

# %%
# SPDX-License-Identifier: MIT
from itertools import pairwise
from pathlib import Path

import numpy as np

import ufl_beam as ub

output = Path("output")
output.mkdir(exist_ok=True)

corners = np.array([(0, 0, 0), (1, 0, 0), (1, -1, 0), (1, -1, 1), (0, -1, 1), (0, 0, 1.0)])  # m
axes = [(0, 1, 0), (0, 0, 1), (1, 0, 0), (0, 1, 0), (0, 0, 1), (1, 0, 0)]
side = 0.1  # m, of the square sections; rods have 1 kg
g = 9.81  # m/s², along -y
weight = ub.Gravity((0, -g, 0))


def tensor(along):
    """Return the tensor of inertia of a rod of 1 m along a unit vector; (3, 3); kg m²."""
    own = np.outer(along, along)
    return (np.eye(3) - own) / 12 + side**2 / 12 * (np.eye(3) + own)


# %% [markdown]
# ## Rigid rods
#
# A universal joint keeps its two axes perpendicular.  With the axis of the last hinge and one
# normal of it, it holds the last rod as a hinge would: the other normal is held by the loop.


# %%
def rigid_loop():
    """Return the loop of rigid rods."""
    rods = [
        ub.Body(tuple((a + b) / 2), mass=1.0, inertia=tensor(b - a), name=f"rod {k + 1}")
        for k, (a, b) in enumerate(pairwise(corners))
    ]
    joints = []
    for k, (corner, axis) in enumerate(zip(corners, axes, strict=True)):
        before = ub.ground(*corner) if k == 0 else rods[k - 1].at(*corner)
        after = ub.ground(*corner) if k == 5 else rods[k].at(*corner)
        if k < 5:
            joints.append(ub.Revolute(before, after, axis=axis))
        else:
            joints.append(ub.Universal(before, after, axes=((0, 1, 0), axis)))
    return ub.Scene(bodies=rods, joints=joints, loads=[weight])


def corner(run):
    """Return the positions of the fourth corner of a rigid loop; (n+1, 3); m."""
    return run.position(run.scene.bodies[2].at(*corners[3]))


loop = rigid_loop()
long = ub.simulate(loop, ub.EnergyMomentum(), t=(0, 20), dt=0.01, progress=False)
ub.print_once(long)
assert long.energy.worst < 1e-8

# The equations of motion with multipliers, by an integrator with tolerances of 1e-10, have these
# positions of the fourth corner at 0.5, 1, 1.5 and 2 s; m.
exact = np.array([
    (0.9682837, -1.2246252, 0.7501466), (0.5105015, -1.6491676, 0.1401231),
    (-0.5177295, -1.6465384, 0.1444556), (-0.9693403, -1.2212469, 0.7542780),
])  # fmt: skip
ub.print_once("\ndt (s)     error of the corner (m)  order")
errors, steps = [], (0.02, 0.01, 0.005)
for dt in steps:
    run = ub.simulate(loop, ub.EnergyMomentum(), t=(0, 2), dt=dt, progress=False)
    at = np.rint(np.array([0.5, 1, 1.5, 2]) / dt).astype(int)
    errors.append(np.abs(corner(run)[at] - exact).max())
    order = f"{np.log2(errors[-2] / errors[-1]):.2f}" if len(errors) > 1 else ""
    ub.print_once(f"{dt:<9g}  {errors[-1]:.2e}                 {order}")
assert 1.9 < np.log2(errors[-2] / errors[-1]) < 2.1

# %% [markdown]
# ## Elastic rods
#
# Steel rods of the same mass give way by micrometres.  So no condition follows from the others, and
# all six joints can be revolute.  Their forces are the forces of real hinges without play.

# %%
E, nu, area, I = 210e9, 0.3, side**2, side**4 / 12
steel = ub.Section(
    EA=E * area, GA=5 / 6 * E / 2.6 * area, GA3=5 / 6 * E / 2.6 * area, EI=E * I, EI2=E * I,
    GJ=E / 2.6 * 0.1406 * side**4, rhoA=1.0, rhoI=side**2 / 12, rhoI2=side**2 / 12, depth=side,
)  # fmt: skip


def elastic_loop(section, cells=4):
    """Return the loop of elastic rods."""
    rods = [
        ub.Beam(tuple(a), tuple(b), section, cells=cells, up=axis, name=f"rod {k + 1}")
        for k, (a, b, axis) in enumerate(zip(corners[:-1], corners[1:], axes[:-1], strict=True))
    ]
    ends = [ub.ground(*corners[0]), *(place for rod in rods for place in (rod.start, rod.end))]
    ends.append(ub.ground(*corners[5]))
    joints = [
        ub.Revolute(*ends[2 * k : 2 * k + 2], axis=axis, multipliers=True)
        for k, axis in enumerate(axes)
    ]
    return ub.Scene(rods, joints=joints, loads=[weight])


elastic = ub.simulate(
    elastic_loop(steel), ub.EnergyMomentum(alpha=0.1), t=(0, 2), dt=0.005, progress=False,
    record=ub.VTKHDF(output / "bricard.hdf"),
)  # fmt: skip
ub.print_once(elastic)
third = elastic.scene.beams[2]
apart = np.abs(elastic.position(third.end) - corner(run)).max()
ub.print_once(f"\nelastic and rigid loops are apart by at most {apart:.1e} m")
assert apart < 5e-3

# %% [markdown]
# ## Pictures

# %%
camera = ub.Camera(direction=(-0.5, -0.35, -0.8), width=4.0)
ub.render(elastic, output / "bricard.png", n=160, quantity="M", camera=camera)
ub.animate(elastic, output / "bricard.gif", seconds=5, quantity="M", camera=camera)
with ub.picture((7, 4)) as figure:
    ax = figure.subplots()
    for k, name in enumerate("xyz"):
        ax.plot(long.times, corner(long)[:, k], label=name)
    ax.set_xlabel("t (s)")
    ax.set_ylabel("position of the fourth corner (m)")
    ax.legend(frameon=False)
figure.savefig(output / "bricard_corner.png")
ub.print_once("\npictures and data:", *sorted(str(p) for p in output.glob("bricard*")), sep="\n  ")

# %% [markdown]
# ## Try this
#
# * `Revolute` in place of `Universal` in the rigid loop: the error names the condition that follows
#   from the others,
# * rods of rubber, `E = 1e7`: the loop gives way visibly.
