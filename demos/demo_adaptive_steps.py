# %% [markdown]
# # Adaptive steps
#
# The four-beam swing moves slowly for 0.64 s, then its links snap taut within microseconds.  Equal
# steps that resolve the snap are far too short for the rest of the motion.
# `dt=ub.Adaptive(tolerance)` chooses each step by an estimate of its error.
#
# This demo shows
#
# * the number of adaptive and of equal steps for the same error,
# * steps that end at the kinks of the load table,
# * the list of events, here impacts of the beam on a stop,
# * the meaning of the tolerance.

# %%
# SPDX-License-Identifier: MIT
from pathlib import Path

import numpy as np

import ufl_beam as ub

output = Path("output")
output.mkdir(exist_ok=True)

# %% [markdown]
# ## Scene
#
# The scene is the swing of `demo_four_beam_swing.py`, up to the moment when the links are taut.

# %%
E, nu, rho = 73e9, 0.3, 2700.0  # Pa, -, kg/m^3
flexible = ub.Section.rectangle(b=5e-3, h=1e-3, E=E, nu=nu, rho=rho)  # m
rigid = ub.Section(
    EA=1e4 * flexible.EA, GA=1e4 * flexible.GA, EI=1e4 * flexible.EI, rhoA=0.0, depth=3e-3
)

beam = ub.Beam((0, -0.36), (0.72, -0.36), flexible, cells=4, name="beam")  # m
left = ub.Beam((0, 0), (0, -0.36), rigid, cells=1, name="left link")
right = ub.Beam((1.08, 0), (0.72, -0.36), rigid, cells=1, name="right link")
middle = beam.at(0.5)
push = ub.Table([0, 0.128, 0.256], [0, 2, 0])  # s, N


def swing(connectors=()):
    """Return the swing, with further connectors."""
    return ub.Scene(
        beams=[beam, left, right],
        joints=[ub.Revolute(left.end, beam.start), ub.Revolute(right.end, beam.end)],
        supports=[ub.Pinned(left.start), ub.Pinned(right.start)],
        masses=[ub.PointMass(middle, 0.5)],  # kg
        loads=[ub.PointLoad(middle, force=(1, 0), amplitude=push)],
        connectors=connectors,
    )


# %% [markdown]
# ## Errors and steps
#
# The error is the largest distance of three points at 0.64 s from a run with a smaller tolerance.

# %%
END = 0.64  # s


def places(solution):
    """Return displacements of both ends and the middle of the beam at the end of a run; m."""
    return np.array([solution.displacement(p)[-1, :2] for p in (beam.start, middle, beam.end)])


def run(dt):
    """Simulate the swing until it is taut."""
    return ub.simulate(swing(), ub.EnergyMomentum(), t=(0.0, END), dt=dt)


tolerances = [1e-4, 1e-5, 1e-6, 1e-7]
adaptive = [run(ub.Adaptive(tolerance)) for tolerance in tolerances]
equal = [run(dt) for dt in (4e-3, 2e-3, 1e-3, 5e-4, 2.5e-4)]
exact = places(run(ub.Adaptive(1e-8)))


def error(solution):
    """Return the largest distance from the reference; m."""
    return float(np.linalg.norm(places(solution) - exact, axis=1).max())


ub.print_once("tolerance     steps   shortest s    longest s      error m   sum of estimates m")
for tolerance, one in zip(tolerances, adaptive, strict=True):
    dt = np.diff(one.times)
    sum_of_estimates = one.time_error * one.scene.size
    numbers = f"{dt.min():12.2e} {dt.max():12.2e} {error(one):12.2e} {sum_of_estimates:20.2e}"
    ub.print_once(f"{tolerance:9.0e} {one.substeps:9d} {numbers}")
for one in equal:
    dt = END / one.substeps
    ub.print_once(f"    equal {one.substeps:9d} {dt:12.2e} {dt:12.2e} {error(one):12.2e}")

chosen = adaptive[2]
assert error(chosen) < min(error(one) for one in equal if one.substeps < 5 * chosen.substeps)
assert error(chosen) < chosen.time_error * chosen.scene.size
for kink in push.times[1:]:
    assert kink in chosen.times

# %% [markdown]
# For the same error, a tenth of the number of equal steps suffices.  The sum of the estimated
# errors is larger than the error at the end, because errors decay in this motion.
#
# ## Impact on a stop
#
# A stop is 0.12 m to the right of the middle.  `Events` lists the impacts; there the steps are
# short.

# %%
stop = ub.Slide(ub.ground(0.36, -0.36), middle, ub.Stop(1e5, high=0.12), axis=(1, 0))
events = ub.Events()
hitting = ub.simulate(
    swing([stop]), ub.EnergyMomentum(), t=(0.0, 0.6), dt=ub.Adaptive(1e-6), record=events
)
ub.print_once("\na stop at 0.12 m\n" + "\n".join(map(str, events.found[:8])))
ub.print_once(hitting)
assert events.found[0].what == "touches"
assert hitting.energy.worst < 1e-9

# %% [markdown]
# ## Pictures

# %%
with ub.picture((9, 4.8)) as steps:
    axes = steps.subplots()
    for one, label in ((chosen, "links that snap at 0.64 s"), (hitting, "a stop at 0.12 m")):
        axes.semilogy(one.times[1:], np.diff(one.times), ".-", ms=3, lw=0.8, label=label)
    for event in events.found:
        axes.axvline(event.time, color="0.8", lw=0.5, zorder=0)
    for kink in push.times[1:]:
        axes.axvline(kink, color="0.2", lw=0.8, ls="--", zorder=0)
    axes.set(xlabel="time (s)", ylabel="step (s)")
    axes.set_title("dashed: kinks of the load; grey: impacts", loc="left")
    axes.legend(loc="lower left")
steps.savefig(output / "adaptive_steps_lengths.png")

with ub.picture((8, 4.8)) as errors:
    axes = errors.subplots()
    for runs, style, label in ((equal, "s--", "equal steps"), (adaptive, "o-", "adaptive steps")):
        axes.loglog([x.substeps for x in runs], [error(x) for x in runs], style, label=label)
    axes.set(xlabel="steps", ylabel="error of position at 0.64 s (m)")
    axes.legend()
errors.savefig(output / "adaptive_steps_errors.png")

# %% [markdown]
# ## Try this
#
# * `EnergyMomentum(0.05, 0.05)`: numerical dissipation counts as an error, so steps are shorter.
# * A pulse without a table, `amplitude=lambda t: 2.0 * (0.1 < t < 0.2)`: steps are repeated at the
#   jumps; `ub.Adaptive(1e-6, stops=[0.1, 0.2])` avoids this.
