# %% [markdown]
# # Pushover of a frame: hinges that soften to joints
#
# A steel frame of two storeys is pushed sideways until all its plastic hinges have lost their
# moment.  Six hinges open, the push reaches its largest value, and the hinges soften.  In the end
# they are revolute joints, and a negative push holds the mechanism.
#
# This demo shows
#
# * softening hinges at chosen places, with their rotations and dissipations,
# * displacement control, which continues beyond the limit load and beyond a load of zero,
# * the pushover curve beside the closed form of a mechanism with rigid members.
#
# Data: columns HEB 200, girders IPE 300 of steel, with a plastic moment of 148 kN m and a fracture
# energy of 30 kJ in all hinges; 10 kN/m on both girders.

# %%
# SPDX-License-Identifier: MIT
from pathlib import Path

import numpy as np

import ufl_beam as ub
import ufl_beam.structures as st

output = Path("output")
output.mkdir(exist_ok=True)

# %% [markdown]
# ## Scene
#
# A hinge of `hinges={s: law}` is rigid below its limit.  With `LinearSoftening` its moment falls
# linearly with the rotation, and is zero from 2 G_f/M_u = 0.41 rad on.  The load factor is the push
# in kN; a third of it acts at the floor, two thirds at the roof.

# %%
steel = {"E": 210e9, "nu": 0.3, "rho": 7850.0}  # Pa, -, kg/m³
heb200 = st.i_shape(h=0.20, b=0.20, tw=0.009, tf=0.015, **steel)  # m
ipe300 = st.i_shape(h=0.30, b=0.15, tw=0.0071, tf=0.0107, **steel)
hinge = ub.LinearSoftening(limit=148e3, fracture_energy=30e3)  # N m, J

left = ub.Beam((0, 0), (0, 8), heb200, hinges={0: hinge}, name="left column")  # m
right = ub.Beam((6, 0), (6, 8), heb200, hinges={0: hinge}, name="right column")
floor = ub.Beam((0, 4), (6, 4), ipe300, hinges={0: hinge, 1: hinge}, name="floor")
roof = ub.Beam((0, 8), (6, 8), ipe300, hinges={0: hinge, 1: hinge}, name="roof")
corners = [
    ub.Rigid(left.at(0.5), floor.start),
    ub.Rigid(right.at(0.5), floor.end),
    ub.Rigid(left.end, roof.start),
    ub.Rigid(right.end, roof.end),
]
feet = [ub.Clamped(left.start), ub.Clamped(right.start)]
weight = [ub.LineLoad(girder, force=(0, -10e3)) for girder in (floor, roof)]  # N/m
push = [
    ub.PointLoad(left.at(0.5), force=(1e3 / 3, 0), amplitude=lambda t: t),  # N
    ub.PointLoad(left.end, force=(2e3 / 3, 0), amplitude=lambda t: t),
]
beams = [left, right, floor, roof]
frame = ub.Scene(beams, joints=corners, supports=feet, loads=weight + push)

# %% [markdown]
# ## Path
#
# The roof moves by 2 cm per step.  `Events` lists when each hinge opens, and when it has lost its
# moment.

# %%
events = ub.Events()
control = ub.DisplacementControl(left.end, "u", 0.02)  # m
path = ub.follow(frame, control, steps=180, record=events)
ub.print_once(path)
for event in events.found:
    ub.print_once(event)

# %% [markdown]
# ## Closed form
#
# If rigid columns rotate by θ, the floor and the roof move by h sin θ and 2h sin θ to the side, and
# by h (1 - cos θ) and 2h (1 - cos θ) down.  All hinges rotate by θ.  The virtual work of the push
# P, of the weight W of each girder, and of six moments M(θ) gives
#
# 5/3 P h cos θ + 3 W h sin θ = 6 M(θ),   M(θ) = M_u max(0, 1 - θ M_u/(2 G_f)).

# %%
h, W, M_u, G_f = 4.0, 60e3, hinge.limit, hinge.fracture_energy  # m, N, N m, J


def push_of_mechanism(sway):
    """Return the push (kN) of the mechanism with rigid members at a sway of the roof (m)."""
    θ = np.arcsin(sway / (2 * h))
    M = M_u * np.maximum(0, 1 - θ * M_u / (2 * G_f))
    return (6 * M - 3 * W * h * np.sin(θ)) / (5 / 3 * h * np.cos(θ)) / 1e3


sway = path.displacement(left.end)[:, 0]  # m
P = path.factor  # kN
places = [left.start, right.start, floor.start, floor.end, roof.start, roof.end]
states = [path.material_at(place) for place in places]
(limit,) = path.critical
states_shown = [limit.n, int(np.argmin(np.abs(sway - 1.6))), len(sway) - 1]
ub.print_once("\n    sway    push  mechanism  rotations of the hinges")
for letter, n in zip("ABC", states_shown, strict=True):
    turns = "".join(f"{abs(np.degrees(state.jump[n])):6.1f}°" for state in states)
    mechanism = push_of_mechanism(sway[n])
    ub.print_once(f"{letter}  {sway[n]:4.2f} m {P[n]:7.2f} {mechanism:7.2f} kN{turns}")
lost = np.array([state.hinge[-1] for state in states])  # J
ub.print_once(f"dissipated: {lost.sum() / 1e3:.3f} kJ in {len(lost)} hinges")

# %% [markdown]
# ## Pictures
#
# Left: the frame in three states, to scale.  The colour of a hinge shows its moment, the number its
# rotation.  Arrows show the push.  Right: the pushover curve.

# %%
from matplotlib import colormaps
from matplotlib.colors import ListedColormap

INK, BLUE, ORANGE, GREY = "#222222", "#0072B2", "#D55E00", "#999999"
moments = ListedColormap(colormaps["Oranges"](np.linspace(0.0, 0.75, 256)))
circle = {"marker": "o", "ls": "", "ms": 12, "mec": ORANGE, "mew": 1.8, "zorder": 4}
offsets = [(13, -1), (13, -1), (13, -19), (-13, -19), (13, -19), (-13, -19)]  # of texts; points
columns = [0.0, 9.2, 18.0]  # places of the three states; m
titles = ["A: {} kN, largest", "B: {} kN, softening", "C: {} kN, joints"]


def draw_state(axes, n, x0):
    """Draw the frame, the moments and rotations of its hinges, and the push."""
    aside = np.array([x0, 0.0])
    for beam in frame.beams:
        axes.plot(*(path.shape(beam, 0)[[0, -1]] + aside).T, color="#DDDDDD", lw=2, zorder=1)
        axes.plot(*(path.shape(beam, n) + aside).T, color=INK, lw=3.5, zorder=2)
    for foot in (x0, x0 + 6):
        axes.plot([foot - 0.6, foot + 0.6], [-0.3, -0.3], color=INK, lw=3)
    for place, state, offset in zip(places, states, offsets, strict=True):
        at = path.position(place)[n] + aside
        axes.plot(*at, mfc=moments(abs(state.forces[n, 2]) / M_u), **circle)
        side = "left" if offset[0] > 0 else "right"
        turn = f"{abs(np.degrees(state.jump[n])):.0f}°"
        axes.annotate(turn, at, offset, textcoords="offset points", ha=side)
    for place, fraction in ((left.at(0.5), 1 / 3), (left.end, 2 / 3)):
        near = path.position(place)[n] + aside - (0.45, 0)
        far = near - (fraction * abs(P[n]) / 40 + 0.5, 0)
        head, tail = (near, far) if P[n] > 0 else (far, near)
        style = {"arrowstyle": "-|>,head_width=0.3,head_length=0.5", "shrinkA": 0, "shrinkB": 0}
        axes.annotate("", head, tail, arrowprops={"color": BLUE, "lw": 2.5, **style})


with ub.picture((11.5, 4.2)) as figure:
    shapes, curve = figure.subplots(1, 2, width_ratios=(2.3, 1))
    shapes.set_aspect("equal")
    shapes.axis("off")
    for title, n, x0 in zip(titles, states_shown, columns, strict=True):
        draw_state(shapes, n, x0)
        shapes.text(
            x0 + 3, -1.7, title.format(f"{P[n]:.0f}".replace("-", "−")), ha="center", fontsize=14
        )
    for fraction, text in (
        (1.0, "plastic moment"),
        (0.5, "half of it"),
        (0.0, "no moment: a joint"),
    ):
        shapes.plot([], [], mfc=moments(fraction), label=text, **circle)
    shapes.legend(loc="lower left", bbox_to_anchor=(0.03, 0.96), ncols=3, handletextpad=0.1)
    curve.axhline(0, color=GREY, lw=0.8)
    curve.plot(sway, push_of_mechanism(sway), "--", color=GREY, label="plastic theory")
    curve.plot(sway, P, color=BLUE, lw=3, label="computed")
    for letter, n in zip("ABC", states_shown, strict=True):
        curve.plot(sway[n], P[n], "o", ms=10, color=INK, zorder=3)
        curve.annotate(letter, (sway[n], P[n]), (8, 8), textcoords="offset points", fontsize=15)
    curve.set(xlabel="sway of the roof (m)", ylabel="push (kN)", xlim=(0, 4.1), ylim=(-65, 150))
    curve.legend(loc="upper right")
figure.savefig(output / "pushover.png")
ub.print_once("\npicture:", output / "pushover.png")

# %% [markdown]
# ## Verification
#
# The largest push is below the limit load 6 M_u/(5/3 h) of plastic theory.  Each hinge dissipates
# its fracture energy, and its moment is zero from then on.  The last state differs from the
# mechanism only by elastic deflections.

# %%
assert [event.what for event in events.found] == ["opens"] * 6 + ["is free"] * 6
assert limit.kind == "limit"
assert limit.factor < push_of_mechanism(0.0)
assert np.allclose(lost, G_f, rtol=1e-9)
assert all(abs(state.forces[-1, 2]) < 1e-9 * M_u for state in states)
free = P[-1] / push_of_mechanism(sway[-1])
ub.print_once(f"push of the frame over the push of the mechanism: {free:.4f}")
assert abs(free - 1) < 5e-3

# %% [markdown]
# ## Try this
#
# * 30 kN/m on the girders, `W = 180e3`: by how much does the weight reduce the largest push?
# * `ub.Softening` instead of `ub.LinearSoftening`: the moment falls exponentially.
