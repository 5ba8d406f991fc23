# %% [markdown]
# # Tumbling beam: energy and angular momentum in space at any step size
#
# A force and a moment act at one end of a soft free beam for 5 s.  Then the beam tumbles through
# space with large bending and twisting, and its energy, momentum and angular momentum must not
# change.
#
# This demo shows
#
# * a scene in space: points with three coordinates, a section with torsion and two bending axes,
# * exact conservation by `EnergyMomentum()`, also at steps in which nodes turn by 40 degrees,
# * second order of accuracy in the step, measured,
# * numerical dissipation by `alpha`, which conserves momentum and angular momentum.
#
# The problem is the spatial "flying spaghetti" of J.  C.  Simo and L.  Vu-Quoc (1988).

# %%
# SPDX-License-Identifier: MIT
from pathlib import Path

import numpy as np

import ufl_beam as ub

output = Path("output")
output.mkdir(exist_ok=True)

section = ub.Section(
    EA=1e4, GA=1e4, GA3=1e4, EI=500.0, EI2=500.0, GJ=500.0, rhoA=1.0, rhoI=10.0, rhoI2=10.0,
    depth=0.5,
)  # fmt: skip
ramps = ub.Table([0, 2.5, 5], [0, 200, 0])  # the factor of the loads rises and falls linearly


def smooth(t):
    """Return a factor with the same impulse that starts and ends smoothly."""
    return 200 * np.sin(np.pi * t / 5) ** 2 if t < 5 else 0.0


def fly(dt, scheme, end=25.0, push=ramps, cells=10, **options):
    """Simulate the beam from (6, 0, 0) to (0, 8, 0) m, which is pushed at its lower end."""
    beam = ub.Beam((6, 0, 0), (0, 8, 0), section, cells=cells, name="beam")
    load = ub.PointLoad(beam.start, force=(0.1, 0, 0), moment=(0, -0.5, -1), amplitude=push)
    scene = ub.Scene([beam], loads=[load])
    tight = ub.Newton(rtol=1e-13)
    return ub.simulate(scene, scheme, t=(0.0, end), dt=dt, newton=tight, progress=False, **options)


# %% [markdown]
# ## Conservation
#
# The table shows relative changes after the loads have ended.


# %%
def drifts(run):
    """Return the relative changes of energy and of angular momentum after the loads have ended."""
    free = run.times >= 5 - 1e-9
    energy, momentum = run.energy.total[free], run.momentum()[free, 3:]
    change = np.linalg.norm(momentum - momentum[0], axis=1).max()
    return np.ptp(energy) / energy[0], change / np.linalg.norm(momentum[0])


flights = {dt: fly(dt, ub.EnergyMomentum()) for dt in (0.02, 0.1, 0.2)}
ub.print_once("dt (s)  steps  energy at 5 s (J)  drift of energy  drift of angular momentum")
for dt, run in flights.items():
    energy, momentum = drifts(run)
    at_5 = run.energy.total[np.argmin(np.abs(run.times - 5))]
    ub.print_once(f"{dt:6g}  {run.substeps:5d}  {at_5:17.6f}  {energy:15.1e}  {momentum:25.1e}")
    assert max(energy, momentum) < 1e-10
ub.print_once()
ub.print_once("dt = 0.02 s\n" + str(flights[0.02]))

# A separate program, in NumPy with other formulas, has this energy with the same cells and step.
assert abs(flights[0.02].energy.total[-1] - 723.36647059) < 1e-7

# %% [markdown]
# ## Dissipation
#
# `alpha` dissipates the energy of vibrations and conserves the angular momentum exactly.

# %%
decaying = fly(0.1, ub.EnergyMomentum(alpha=0.1))
energy, momentum = drifts(decaying)
ub.print_once(
    f"\nalpha = 0.1, dt = 0.1 s: energy falls by {energy:.1%}, angular momentum by {momentum:.0e}"
)
assert momentum < 1e-10 < energy

# %% [markdown]
# ## Accuracy
#
# The error of an end at 5 s, beside a run with a step of 1/320 s on the same mesh, falls with the
# square of the step.

# %%
steps = np.array([1 / 10, 1 / 20, 1 / 40])
fine, *runs = (fly(dt, ub.EnergyMomentum(), 5.0, smooth) for dt in (1 / 320, *steps))


def end_of(run):
    """Return the position of the pushed end at 5 s; m."""
    return run.position(run.scene.beams[0].start)[-1]


errors = np.array([np.linalg.norm(end_of(run) - end_of(fine)) for run in runs])
orders = np.log2(errors[:-1] / errors[1:])
ub.print_once("\ndt (s)     error (m)  order")
for dt, error, order in zip(steps, errors, ["", *(f"{o:.2f}" for o in orders)], strict=True):
    ub.print_once(f"{dt:<9g}  {error:.2e}   {order}")
assert np.all(np.abs(orders - 2) < 0.15)

# %% [markdown]
# ## Pictures
#
# The camera follows the beam.  Colours show the magnitude of the bending moment.

# %%
flight = fly(0.05, ub.EnergyMomentum(), 12.0, record=ub.VTKHDF(output / "tumbling_beam.hdf"))
(beam,) = flight.scene.beams
camera = ub.Camera(follow=beam.at(0.5), width=16.0)
ub.render(flight, output / "tumbling_beam.png", quantity="M", camera=camera)
ub.animate(flight, output / "tumbling_beam.gif", seconds=6, quantity="M", camera=camera)
ub.plot(flight, "shapes", count=13).savefig(output / "tumbling_beam_shapes.png")
ub.plot(flight, "energy").savefig(output / "tumbling_beam_energy.png")
ub.print_once("\npictures and data:", *sorted(str(p) for p in output.glob("tumbling*")), sep="\n  ")

# %% [markdown]
# ## Try this
#
# * `EI2=50.0`: the beam bends more easily about axis 2, and tumbles otherwise,
# * `dt=0.4`: steps are divided where a node would turn too far; the energy is still constant.
