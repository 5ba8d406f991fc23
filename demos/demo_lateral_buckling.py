# %% [markdown]
# # Lateral buckling of a narrow beam, and a hinge that comes first
#
# A flat steel bar on edge carries a load at its end.  Far below the strength of the bar it tips
# over: it bends sideways and twists at once.  Planar models do not know this limit.
#
# This demo shows
#
# * the buckling load of `buckling`, beside the closed form of Timoshenko and Gere,
# * the path after buckling, with a small lateral load as an imperfection,
# * a plastic hinge at the clamp that yields before, or after, the bar buckles,
# * the limit of the model: an open section without warping, and how far it would be off.

# %%
# SPDX-License-Identifier: MIT
from pathlib import Path

import numpy as np

import ufl_beam as ub

output = Path("output")
output.mkdir(exist_ok=True)

length, height, width = 1.0, 0.050, 0.005  # m
bar = ub.Section.rectangle(b=width, h=height, E=210e9, nu=0.3, rho=7850.0)
closed = 4.012599 * np.sqrt(bar.EI2 * bar.GJ) / length**2  # N


def cantilever(cells=16, lateral=0.0, **more):
    """Return the bar along x under the closed form of the buckling load, downwards at its end."""
    beam = ub.Beam((0, 0, 0), (length, 0, 0), bar, cells=cells, name="bar", **more)
    load = ub.PointLoad(beam.end, force=(0, lateral * closed, -closed), amplitude=lambda t: t)
    return ub.Scene([beam], supports=[ub.Clamped(beam.start)], loads=[load])


# %% [markdown]
# ## Buckling load
#
# The closed form neglects that the bar bends downwards before it buckles, which is a part of
# EI2/EI + GJ/EI of the load.

# %%
factors = {cells: abs(ub.buckling(cantilever(cells), 1).factors[0]) for cells in (8, 16, 32)}
limit = factors[32] + (factors[32] - factors[16]) / 3
neglected = (bar.EI2 + bar.GJ) / bar.EI
ub.print_once(f"closed form {closed:.1f} N")
for cells, factor in factors.items():
    ub.print_once(f"{cells:3d} cells: {factor:.5f} of the closed form")
ub.print_once(f"extrapolated: {limit:.5f}; (EI2 + GJ)/EI = {neglected:.3f}")
assert 1.0 < limit < 1.0 + neglected

# %% [markdown]
# ## After buckling, with and without a hinge
#
# A lateral load of a thousandth makes the bar choose a side.  The load still rises after buckling,
# because the twisted bar bends about its strong axis, too.  A hinge at the clamp about the strong
# axis has 0.8 or 1.03 times the moment of the buckling load.  When it opens, the load falls; the
# bar that had buckled straightens sideways while it turns down about the hinge.


# %%
def path_of(strength=None):
    """Return the path of the bar with a hinge of a strength, as a part of the buckling moment."""
    more, control = {}, ub.ArcLength(0.02)
    if strength is not None:
        moment = strength * closed * length  # N m
        law = ub.Softening(limit=moment, fracture_energy=0.5 * moment)  # J
        more["hinges"] = {0.0: law}
        control = ub.DissipationControl(0.005 * moment, control)
    scene = cantilever(lateral=1e-3, **more)
    end = scene.beams[0].end
    first = ub.follow(scene, ub.LoadControl(0.1), steps=7, progress=False)
    return scene, ub.follow(
        scene, control, steps=150, start=first, progress=False,
        until=lambda now: np.abs(now.displacement(end)[:3]).max() > 0.3,
        record=[ub.VTKHDF(output / "lateral_buckling.hdf")] * (strength is None),
    )  # fmt: skip


paths = {strength: path_of(strength) for strength in (None, 1.03, 0.8)}
ub.print_once("\nhinge    largest factor  lateral displacement there (m)")
for strength, (scene, path) in paths.items():
    n = int(np.argmax(path.times))
    moved = path.displacement(scene.beams[0].end)[n, 1]
    ub.print_once(f"{strength or 'none'!s:7}  {path.times[n]:14.4f}  {moved:30.4f}")
    assert strength is None or strength - 1e-3 < path.times[n] < 1.1

# %% [markdown]
# ## Open sections
#
# Beams in space have no warping.  An I section resists torsion mostly by warping of its flanges, so
# its buckling load would be too small.  The closed form of uniform bending between forks has the
# factor √(1 + π² E I_w/(GJ L²)), with the warping constant I_w = I_z (h - t_f)²/4.

# %%
h, b, tw, tf, J = 0.200, 0.100, 0.0056, 0.0085, 6.98e-8  # m, m⁴: IPE 200, EN 10365
I_w = 2 * tf * b**3 / 12 * (h - tf) ** 2 / 4  # m⁶
ub.print_once(
    "\nIPE 200, length (m)    buckling moment without warping, as a part of the right one"
)
for span in (2.0, 4.0, 8.0):
    part = 1 / np.sqrt(1 + np.pi**2 * 2.6 * I_w / (J * span**2))  # E/G = 2.6
    ub.print_once(f"{span:19.0f}    {part:.2f}")

# %% [markdown]
# ## Pictures

# %%
scene, path = paths[None]
camera = ub.Camera(direction=(-0.75, 0.5, -0.35))
ub.render(path, output / "lateral_buckling.png", quantity="T", camera=camera)
with ub.picture((9, 4.5)) as figure:
    both = figure.subplots(1, 2, sharey=True)
    for strength, (scene, path) in paths.items():
        label = "no hinge" if strength is None else f"hinge of {strength:g} of the moment"
        moved = path.displacement(scene.beams[0].end)
        for ax, displacement in zip(both, (moved[:, 1], -moved[:, 2]), strict=True):
            ax.plot(displacement, path.times, label=label)
    for ax, name in zip(both, ("lateral", "downward"), strict=True):
        ax.axhline(1.0, color="0.7", lw=1)
        ax.set_xlabel(f"{name} displacement of the end (m)")
    both[0].set_ylabel("load over the closed form")
    both[0].legend(frameon=False, loc="lower right")
figure.savefig(output / "lateral_buckling_paths.png")
ub.print_once("\npictures and data:", *sorted(str(p) for p in output.glob("lateral*")), sep="\n  ")

# %% [markdown]
# ## Try this
#
# * `height=0.02`: EI2/EI is larger, and so is the load beside the closed form,
# * an imperfection of 1e-2: the bar moves sideways long before it buckles.
