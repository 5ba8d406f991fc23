# %% [markdown]
# # Lee's frame: through limit points of the load and of the displacement
#
# Two members of 120 cm, pinned at both far ends, carry a load near their corner.  The load grows to
# a limit, falls to zero, becomes negative, and grows again; along this path the loaded point
# reverses its direction twice.  Only arc-length control follows the whole path.
#
# This demo shows
#
# * `ub.follow`, which solves for the load factor together with the displacements,
# * critical points, reported with their modes,
# * a prescribed displacement instead of the load, with limit points where this point reverses.
#
# Data: S. L. Lee, F. S. Manuel, E. C. Rossow, "Large deflections and stability of elastic frames",
# 1968; A = 6 cm², I = 2 cm⁴, E = 7.2e6 N/cm², ν = 0.3, shear stiffness G A.

# %%
# SPDX-License-Identifier: MIT
from pathlib import Path

import numpy as np

import ufl_beam as ub

output = Path("output")
output.mkdir(exist_ok=True)

A, I, E, nu = 6e-4, 2e-8, 72e9, 0.3  # m², m⁴, Pa
section = ub.Section(EA=E * A, GA=E * A / (2 * (1 + nu)), EI=E * I)
L = 1.2  # m


def frame(cells, moved=False):
    """Return the loaded point, its support and the frame; the factor is in kN or m."""
    column = ub.Beam((0, 0), (0, L), section, cells=cells, name="column")
    girder = ub.Beam((0, L), (L, L), section, cells=cells, name="girder")
    place = girder.at(0.2)
    load = ub.PointLoad(place, force=(0, -1e3), amplitude=lambda t: t)  # N
    push = ub.PrescribedDisplacement(place, v=lambda t: -t)  # m
    pins = [ub.Pinned(column.start), ub.Pinned(girder.end)]
    scene = ub.Scene(
        [column, girder],
        joints=[ub.Rigid(column.end, girder.start)],
        supports=[*pins, push] if moved else pins,
        loads=[] if moved else [load],
    )
    return place, push, scene


# %% [markdown]
# ## The path
#
# The arc length of a step combines three increments: the root mean squares of all displacements,
# divided by the size of the frame, and of all rotations, and the load factor divided by `factor`,
# here 10 kN.

# %%
place, _, scene = frame(60)
path = ub.follow(
    scene,
    ub.ArcLength(0.05, factor=10),
    until=lambda now: now.t > 15 and len(now.solution.critical) == 2,
    steps=400,
    record=ub.VTKHDF(output / "lee_frame.hdf"),
)
ub.print_once("Lee's frame\n" + str(path))
u, v, _ = 100 * path.displacement(place).T  # cm
P = path.factor  # kN

ub.print_once("\n            P (kN)   v (cm)   u (cm)")
for point in path.critical:
    ub.print_once(f"{point.kind:10s} {P[point.n]:7.4f}  {-v[point.n]:7.3f}  {u[point.n]:7.3f}")

# %% [markdown]
# Where the loaded point reverses, its path with a prescribed displacement has limit points.

# %%
_, push, moved = frame(60, moved=True)
turning = ub.follow(moved, ub.ArcLength(0.03), until=lambda now: len(now.solution.critical) == 2)
turns = [point.n for point in turning.critical]
P_turns = -turning.reaction(push)[turns, 1] / 1e3  # kN
v_turns = 100 * turning.factor[turns]  # cm
for P_turn, v_turn in zip(P_turns, v_turns, strict=True):
    ub.print_once(f"v turns    {P_turn:7.4f}  {v_turn:7.3f}")

# %% [markdown]
# ## Pictures

# %%
BLUE, ORANGE, GREY, INK = "#0072b2", "#d55e00", "#aaaaaa", "#333333"
with ub.picture((8, 6)) as loads:
    axes = loads.subplots()
    axes.axhline(0, color=GREY, lw=0.8)
    axes.plot(-v, P, color=BLUE, label="v, down")
    axes.plot(u, P, color=ORANGE, label="u, to the right")
    limits = [point.n for point in path.critical]
    for moves in (-v, u):
        axes.plot(moves[limits], P[limits], "o", color=INK, ms=7)
    axes.plot(v_turns, P_turns, "s", color=INK, mfc="white", ms=7)
    below = (-v[limits][1] - 2, P[limits][1] - 1.6)
    axes.annotate(
        f"limit {P[limits][0]:.2f} kN", (-v[limits][0], P[limits][0]), (2, 9), fontsize=12,
        textcoords="offset points",
    )  # fmt: skip
    axes.annotate(f"minimum −{-P[limits][1]:.2f} kN", below, ha="right", fontsize=12)
    axes.annotate("v turns", (v_turns[0], P_turns[0]), (8, -3), textcoords="offset points")
    axes.annotate("v turns", (v_turns[1], P_turns[1]), (-8, -4), textcoords="offset points",
                  ha="right")  # fmt: skip
    axes.set_xlabel("displacement of the loaded point (cm)")
    axes.set_ylabel("load (kN)")
    axes.set_ylim(-12, 21)
    axes.legend(loc="lower left", bbox_to_anchor=(0, 0.12))
loads.savefig(output / "lee_frame_loads.png")

with ub.picture((8, 6)) as shapes:
    axes = shapes.subplots()
    axes.set_aspect("equal")
    axes.axis("off")
    load_n = [0, *limits, len(P) - 1]
    colors = [GREY, BLUE, ORANGE, INK]
    names = ["unloaded", "limit", "minimum", f"end, {P[-1]:.1f} kN"]
    for n, color, name in zip(load_n, colors, names, strict=True):
        for beam, label in zip(scene.beams, (name, None), strict=True):
            x, y = path.shape(beam, n).T
            axes.plot(100 * x, 100 * y, color=color, lw=2.6, label=label)
        axes.plot(*(100 * path.position(place)[n]), "o", color=color, ms=7)
    axes.plot([0, 100 * L], [0, 100 * L], "^", color=INK, ms=11, zorder=0)
    axes.legend(loc="lower right")
shapes.savefig(output / "lee_frame_shapes.png")
ub.print_once("\npictures:", *sorted(map(str, output.glob("lee_frame*.png"))), sep="\n  ")

# %% [markdown]
# ## Verification
#
# The limit loads of a converged solution are 18.5466 and -9.3961 kN, and v has extreme values of
# 61.013 and 50.737 cm.  Results with sixty cells per member differ by the mesh error, which is of
# second order.

# %%
assert np.allclose(P[limits], (18.5466, -9.3961), rtol=2e-3)
assert np.allclose(v_turns, (61.013, 50.737), rtol=2e-3)
assert [point.kind for point in path.critical] == ["limit", "limit"]

# %% [markdown]
# ## Try this
#
# * `ub.DisplacementControl(place, "v", -0.01)` instead of the arc length: how far does it get?
# * 30 and 120 cells: the limit load with Richardson's extrapolation has six digits.
