# %% [markdown]
# # First steps in a notebook
#
# A portal frame is pushed at its left corner. This notebook draws the model, finds its frequencies,
# runs it in time, shows section forces and energies, lets the feet of the columns soften, and finds
# out how many cells and steps are needed.
#
# It is a script in percent format. Jupyter with Jupytext and VS Code open it as a notebook;
# `jupytext --to ipynb first_steps.py` makes a file of it. Units are SI.

# %%
# SPDX-License-Identifier: MIT
import numpy as np

import ufl_beam as ub

# %% [markdown]
# ## The model
#
# A beam has two ends, a section and a number of cells. Joints, supports and loads are attached to
# places of beams such as `left.end`. A scene at the end of a notebook cell is drawn: short strokes
# across the beams are the ends of their cells.

# %%
section = ub.Section.rectangle(b=0.10, h=0.20, E=210e9, nu=0.3, rho=7850.0)  # m, Pa, kg/m³


def portal(foot=None):
    """The frame; the feet of both columns may have plastic hinges."""
    hinges = {} if foot is None else {0.0: foot}
    left = ub.Beam((0, 0), (0, 4), section, cells=6, name="left", hinges=hinges)
    roof = ub.Beam((0, 4), (6, 4), section, cells=9, name="roof")
    right = ub.Beam((6, 0), (6, 4), section, cells=6, name="right", hinges=hinges)
    push = ub.Table([0, 0.1, 0.3, 0.4], [0, 1, 1, 0])  # s, factor
    return ub.Scene(
        [left, roof, right],
        joints=[ub.Rigid(left.end, roof.start), ub.Rigid(roof.end, right.end)],
        supports=[ub.Clamped(left.start), ub.Clamped(right.start)],
        loads=[ub.PointLoad(left.end, force=(120e3, 0), amplitude=push)],  # N
    )


scene = portal()
scene

# %% [markdown]
# ## Frequencies
#
# The first mode is the sway of the frame. Its period tells how long a run and how short a step
# should be.

# %%
modes = ub.modes(scene, 3)
modes

# %% [markdown]
# ## A run
#
# `EnergyMomentum()` conserves energy at any step. The result has the motion of all places and the
# forces in all cells at each step. Its picture has the shapes on the way; the ledger accounts for
# each joule.

# %%
period = 1 / modes.frequencies[0]  # s
solution = ub.simulate(scene, ub.EnergyMomentum(), t=(0, 1), dt=period / 40)
solution

# %% [markdown]
# Arrays have a row for each time. A place gives displacement and rotation, a support its reaction.

# %%
left, roof, right = scene.beams
drift = solution.displacement(left.end)[:, 0]  # m
largest = int(np.argmax(drift))
print(f"largest drift {1e3 * drift[largest]:.1f} mm at t = {solution.times[largest]:.3f} s")

# %%
ub.plot(solution, "M", n=largest, magnify=5)

# %%
ub.plot(solution, "history", [left.end, left.at(0.5)], component="u")

# %%
ub.plot(solution, "energy")

# %% [markdown]
# The whole motion as an animation, coloured by the bending moment:

# %%
ub.animate(solution, "first_steps.gif", fps=10, seconds=3, size=(640, 360), magnify=5)

# %% [markdown]
# ## Feet that soften
#
# A plastic hinge of zero length is rigid until its moment reaches the limit. Then it softens and
# dissipates its fracture energy, an entry of the ledger. Both hinges spend it here: the feet end as
# joints, and the frame swings more slowly.

# %%
softening = ub.Softening(limit=150e3, fracture_energy=5e3)  # N m, J
weak = portal(softening)
damaged = ub.simulate(weak, ub.EnergyMomentum(), t=(0, 1), dt=period / 40)
damaged

# %%
ub.plot(damaged, "hinge", weak["left"].start)

# %% [markdown]
# ## How fine is fine enough?
#
# `tradeoff` runs the scene with finer cells and steps, extrapolates, and recommends the cheapest
# setting for an accuracy: here the drift of the elastic frame at ten times, to 1 mm.

# %%
instants = np.linspace(0.1, 1, 10)  # s


def drifts(run):
    """Drift at fixed times, whatever the steps; m."""
    return np.interp(instants, run.times, run.displacement(left.end)[:, 0])


tradeoff = ub.tradeoff(
    scene,
    {"drift": drifts},
    scheme=ub.EnergyMomentum(),
    t=(0, 1),
    dt=period / 20,
    tolerance={"drift": 1e-3},  # m
)
tradeoff

# %% [markdown]
# The recommended setting is a set of arguments for `simulate`:

# %%
ub.simulate(scene, **tradeoff.recommended)
