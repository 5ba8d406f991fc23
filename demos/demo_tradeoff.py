# %% [markdown]
# # Speed and accuracy: cells, step and scheme
#
# The arm of a pick-and-place machine rotates its payload through 90 degrees within 0.6 s.  How far
# does the arm bend, and where is the payload in the end?  `ub.tradeoff` runs this scene with
# several settings.  It finds the fastest setting for a required accuracy, or the most accurate
# setting for a given wall time.
#
# This demo shows
#
# * errors of chosen quantities,
# * comparison of settings: schemes, and cells with two and three nodes,
# * the cost of the search, and the error for a quantity that does not converge.

# %%
# SPDX-License-Identifier: MIT
import math
from pathlib import Path

import numpy as np

import ufl_beam as ub

output = Path("output")
output.mkdir(exist_ok=True)

# %% [markdown]
# ## Scene
#
# The arm is an aluminium tube with a payload at its end, in the horizontal plane.  The acceleration
# of the hub is zero at the beginning and at the end.  The coarsest mesh has two cells.

# %%
L, payload = 1.5, 2.0  # m, kg
duration, end = 0.6, 0.8  # s
tube = ub.Section.tube(d=0.025, t=0.0015, E=70e9, nu=0.33, rho=2700.0)  # m, Pa, -, kg/m^3


def hub(t):
    """Return the rotation of the hub; rad."""
    s = min(t / duration, 1.0)
    return math.pi / 2 * (s - math.sin(2 * math.pi * s) / (2 * math.pi))


arm = ub.Beam((0, 0), (L, 0), tube, cells=2, name="arm")
scene = ub.Scene(
    [arm],
    supports=[ub.PrescribedDisplacement(arm.start, u=0, v=0, psi=hub)],
    masses=[ub.PointMass(arm.end, payload)],
)

# %% [markdown]
# ## Quantities
#
# The quantities are the position of the payload at the end, and the lag of the arm behind the hub
# at sixteen instants.  The shape of an array must not depend on the steps, so a history is
# interpolated at fixed instants.

# %%
instants = np.linspace(0.05, end, 16)  # s


def place(solution):
    """Return the position of the payload at the end; m."""
    return solution.position(arm.end)[-1]


def lag(solution):
    """Return the rotation of the payload relative to the hub; rad."""
    behind = solution.displacement(arm.end)[:, 2] - solution.displacement(arm.start)[:, 2]
    return np.interp(instants, solution.times, behind)


quantities = {"place": place, "lag": lag}

# %% [markdown]
# ## A tolerance
#
# The tolerances are a millimetre and two thousandths of a radian.  The search compares two schemes,
# by default cells with two and three nodes, and in the end a larger tolerance of Newton's method.

# %%
accurate = ub.tradeoff(
    scene,
    quantities,
    scheme=[ub.EnergyMomentum(), ub.GeneralizedAlpha()],
    t=(0.0, end),
    dt=0.02,
    newton=[ub.Newton(), ub.Newton(rtol=1e-6)],
    tolerance={"place": 1e-3, "lag": 2e-3},  # m, rad
)
ub.print_once(accurate)

# %% [markdown]
# ## A budget
#
# Which accuracy is possible in twice the time of this run, with the same scheme and degree of
# cells?

# %%
winner = accurate.recommended
fast = ub.tradeoff(
    scene,
    quantities,
    scheme=winner["scheme"],
    t=(0.0, end),
    dt=0.02,
    mesh=ub.Mesh(degree=winner["mesh"].degree),
    budget=2 * accurate.best.seconds,
)
ub.print_once("\n" + str(fast))

# %% [markdown]
# ## Pictures

# %%
ub.plot(accurate).savefig(output / "tradeoff_tolerance.png")
ub.plot(fast).savefig(output / "tradeoff_budget.png")

# %% [markdown]
# ## Verification
#
# The recommended arguments are passed to `simulate` unchanged.  Against a reference with much finer
# steps and cells than all runs, the errors are below the tolerances, and the error of the
# extrapolated limit is within its estimate.

# %%
best = ub.simulate(scene, **winner, progress=False)
fine = ub.simulate(
    scene,
    ub.EnergyMomentum(),
    t=(0.0, end),
    dt=2e-4,
    mesh=ub.Mesh(refine=8, degree=2),
    progress=False,
)
for name, tolerance in (("place", 1e-3), ("lag", 2e-3)):
    exact = quantities[name](fine)
    error = np.abs(quantities[name](best) - exact).max()
    apart = np.abs(accurate.limit[name] - exact).max()
    ub.print_once(
        f"{name}: error {error:.1e} of {tolerance:.1e}, limit {apart:.1e} from the reference"
    )
    assert error < tolerance
    assert apart < accurate.uncertainty[name] + 0.1 * tolerance
ub.print_once(
    f"the steps of all runs took {accurate.effort:.0f} times as long as the recommended run"
)

# %% [markdown]
# `tradeoff` raises an error if a quantity does not converge, here the number of steps.

# %%
try:
    ub.tradeoff(
        scene, {"steps": len}, scheme=ub.EnergyMomentum(), t=(0.0, end), dt=0.04, tolerance=0.01
    )
except ub.errors.TradeoffError as error:
    ub.print_once("\nrefused:", error)
else:
    raise AssertionError("the number of steps has no limit")

# %% [markdown]
# ## Try this
#
# * `scheme=ub.Newmark()`, or `dt=[0.04, ub.Adaptive(1e-3)]`: are these settings faster?
# * A hub that stops within 20 ms: which of the two quantities becomes expensive?
# * `mpirun -n 3`: two runs at a time.
