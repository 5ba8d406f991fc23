# %% [markdown]
# # Flying beam: energy and momentum at any step size
#
# A force and a moment act at one end of a soft beam for 2.5 s.  Then the beam flies freely with
# large bending, and its energy, linear and angular momentum must not change.
#
# This demo shows
#
# * exact conservation of all three by `EnergyMomentum()`, at small and at extremely large steps,
# * second order of accuracy in the step, measured,
# * the effect of `alpha` and `beta` on energy and momentum.
#
# The problem is the planar "flying spaghetti" of J.  C.  Simo and L.  Vu-Quoc (1986).

# %%
# SPDX-License-Identifier: MIT
from pathlib import Path

import numpy as np

import ufl_beam as ub

output = Path("output")
output.mkdir(exist_ok=True)

section = ub.Section(EA=1e4, GA=1e4, EI=100.0, rhoA=1.0, rhoI=10.0, depth=0.35)  # SI


def jump(t):
    """Return the factor of the loads, which start and end suddenly at t = 0 and t = 2.5 s."""
    return float(t < 2.5)


def fly(dt, scheme, push=jump, end=10.0, record=()):
    """Simulate the beam from (6, 0) to (0, 8) m; loads act at its lower end until t = 2.5 s."""
    beam = ub.Beam((6, 0), (0, 8), section, cells=16, name="beam")
    load = ub.PointLoad(beam.start, force=(8, 0), moment=-80, amplitude=push)  # N, N m
    scene = ub.Scene([beam], loads=[load])
    tight = ub.Newton(rtol=1e-13)
    solution = ub.simulate(
        scene, scheme, t=(0.0, end), dt=dt, newton=tight, record=record, progress=False
    )
    return beam, solution


# %% [markdown]
# ## Conservation
#
# The table shows relative changes after the loads have ended.

# %%
steps = (0.01, 0.1, 0.2)
flights = {dt: fly(dt, ub.EnergyMomentum()) for dt in steps}


def drifts(solution):
    """Return relative changes of energy and angular momentum after the loads have ended."""
    free = solution.times > 2.5 + 1e-9
    changes = []
    for values in (solution.energy.total, solution.momentum()[:, 2]):
        after = values[free]
        changes.append(np.ptp(after) / abs(after[-1]))
    return changes


ub.print_once("dt (s)  steps  drift of energy  drift of angular momentum")
for dt, (_, solution) in flights.items():
    energy, momentum = drifts(solution)
    ub.print_once(f"{dt:6g}  {solution.substeps:5d}  {energy:15.1e}  {momentum:25.1e}")
    assert energy < 1e-10
    assert momentum < 1e-10
ub.print_once()
ub.print_once("dt = 0.01 s\n" + str(flights[0.01][1]))

# %% [markdown]
# ## Dissipation
#
# `alpha` dissipates stored energy and conserves both momenta exactly; `beta` dissipates kinetic
# energy, and changes the angular momentum.

# %%
with_alpha = fly(0.1, ub.EnergyMomentum(alpha=0.1))[1]
with_beta = fly(0.1, ub.EnergyMomentum(beta=0.1))[1]
for name, solution in (("alpha", with_alpha), ("beta", with_beta)):
    energy, momentum = drifts(solution)
    ub.print_once(
        f"{name} = 0.1, dt = 0.1 s: energy changes by {energy:.1e}, momentum by {momentum:.1e}"
    )
assert drifts(with_alpha)[1] < 1e-10 < drifts(with_beta)[1]

# %% [markdown]
# ## Accuracy
#
# Conservation does not imply accuracy.  The error of an end at t = 5 s, against a run with a step
# of 1/640 s on the same mesh, decreases with the square of the step.  This holds for loads that
# start and end smoothly; a jump excites all frequencies of the mesh, also frequencies that no step
# resolves.


# %%
def pulse(t):
    """Return a factor with the same impulse that starts and ends smoothly."""
    return 2 * np.sin(np.pi * t / 2.5) ** 2 if t < 2.5 else 0.0


steps = np.array([1 / 10, 1 / 20, 1 / 40, 1 / 80])
fine_beam, fine = fly(1 / 640, ub.EnergyMomentum(), push=pulse, end=5.0)
reference = fine.position(fine_beam.end)[-1]
ends = [fly(dt, ub.EnergyMomentum(), push=pulse, end=5.0) for dt in steps]
errors = np.array([np.hypot(*(s.position(beam.end)[-1] - reference)) for beam, s in ends])
orders = np.log2(errors[:-1] / errors[1:])
ub.print_once("\ndt (s)     error (m)  order")
for dt, error, order in zip(steps, errors, ["", *(f"{o:.2f}" for o in orders)], strict=True):
    ub.print_once(f"{dt:<9g}  {error:.2e}   {order}")
assert np.all(np.abs(orders[1:] - 2) < 0.15)

# %% [markdown]
# ## Pictures

# %%
beam, flight = fly(0.05, ub.EnergyMomentum(), record=ub.VTKHDF(output / "flying_beam.hdf"))
ub.plot(flight, "shapes", count=17).savefig(output / "flying_beam_shapes.png")
ub.plot(flight, "energy").savefig(output / "flying_beam_energy.png")

with ub.picture((7, 4.5)) as figure:
    ax = figure.subplots()
    second_order = errors[-1] * (steps / steps[-1]) ** 2
    ax.loglog(steps, second_order, color="0.7", lw=4, label="second order")
    ax.loglog(steps, errors, "o", color="C0", label="free end at 5 s")
    ax.set_xlabel("step (s)")
    ax.set_ylabel("error (m)")
    ax.legend(frameon=False)
figure.savefig(output / "flying_beam_order.png")
ub.animate(flight, output / "flying_beam.gif", seconds=5, quantity="M")
ub.print_once("\npictures and data:", *sorted(str(p) for p in output.glob("flying*")), sep="\n  ")

# %% [markdown]
# ## Try this
#
# * `dt=0.5`: a step is subdivided if a node would rotate too far, and energy is still conserved,
# * `rhoI=0.0` in the section: the beam has no rotary inertia.
