# %% [markdown]
# # Calibration: a hinge from a pushover and a free decay
#
# A column stands on a base connection that is elastic up to a limit moment and then softens.  Three
# numbers describe the connection: its **stiffness**, its **limit moment** and its **fracture
# energy**.  Two tests measure the column: a pushover until the connection has lost most of its
# moment, and a free decay of small amplitude.  This demo fits the three numbers to both tests, with
# confidence intervals, and states which test identifies which number.
#
# This demo shows
#
# * `st.Measurement`, measured values with the run that computes them,
# * `st.calibrate`, weighted least squares from several starts, and its `Calibration`,
# * intervals from each test alone, correlations, and a warning if one test is not enough.

# %%
# SPDX-License-Identifier: MIT
import warnings
from pathlib import Path

import numpy as np

import ufl_beam as ub
import ufl_beam.structures as st

output = Path("output")
output.mkdir(exist_ok=True)

# %% [markdown]
# ## Scene
#
# A function makes the scene from the numbers to be found.  A further argument selects the test:
#
# * In the pushover a support moves the end of the column.  In statics t is a parameter, here the
#   displacement in m, so the force is a history over the displacement.
# * In the free decay a rope pulls with 8 kN, growing for 0.2 s, and is cut.  The moment stays at
#   half the limit or below.

# %%
section = ub.Section(EA=2.1e9, GA=6.7e8, EI=9e6, rhoA=78.5, rhoI=0.065)  # N, N, N m², kg/m, kg m
rope = ub.Table([0.0, 0.2, 0.2001], [0, 1, 0])  # s, factor


def column(limit, energy, stiffness, test):
    """A column of 3 m with 400 kg at its end; N m, J, N m/rad."""
    beam = ub.Beam((0, 0), (0, 3), section, cells=6, name="column")  # m
    base = ub.ground(0, 0)
    law = ub.Spring(stiffness, softening=ub.Softening(limit, energy))
    if test == "pushover":
        action = {"supports": [ub.PrescribedDisplacement(beam.end, u=lambda t: t)]}
    else:
        action = {"loads": [ub.PointLoad(beam.end, force=(8e3, 0), amplitude=rope)]}
    return ub.Scene(
        beams=[beam],
        joints=[ub.Revolute(base, beam.start)],
        connectors=[ub.Turn(base, beam.start, law)],
        masses=[ub.PointMass(beam.end, 400.0)],
        **action,
    )


def force(run):
    """Force that moves the end; N."""
    return run.reaction(run.scene.supports[0])[:, 0]


def sway(run):
    """Displacement of the end; m."""
    return run.displacement(run.scene["column"].end)[:, 0]


# %% [markdown]
# ## Measurements
#
# The data are computed with known numbers and 2 % of noise, so that the result can be checked.  The
# standard deviation of the noise is not given to the fit, which estimates it from the residuals.

# %%
truth = {"limit": 60e3, "energy": 6e3, "stiffness": 3e6}
tests = {
    "pushover": {
        "quantity": force,
        "scheme": ub.Static(),
        "t": (0, 0.6),  # m
        "dt": 5e-3,
        "labels": ("displacement (m)", "force (N)"),
    },
    "free decay": {
        "quantity": sway,
        "scheme": ub.EnergyMomentum(),
        "t": (0, 0.5),  # s
        "dt": 4e-3,
        "labels": ("time (s)", "displacement (m)"),
    },
}
random = np.random.default_rng(1)
measured = {}
for name, test in tests.items():
    scene = column(**truth, test=name)
    run = ub.simulate(scene, test["scheme"], t=test["t"], dt=test["dt"])
    values = test["quantity"](run)[2::2]
    noise = 0.02 * np.abs(values).max() * random.normal(size=len(values))
    measured[name] = st.Measurement(
        run.times[2::2], values + noise, name=name, arguments={"test": name}, **test
    )

# %% [markdown]
# ## One test alone
#
# The pushover determines all three numbers, but the stiffness from a few values before the peak
# only.  The free decay knows nothing of limit and fracture energy, since the connection stays
# elastic: such a parameter is refused before the search.

# %%
start = {
    "limit": (40e3, 30e3, 120e3),  # start, bounds; N m
    "energy": (10e3, 3e3, 12e3),  # J
    "stiffness": (5e6, 1.5e6, 6e6),  # N m/rad
}
pushover = st.calibrate(column, start, [measured["pushover"]], progress=False)
ub.print_once(pushover, "\n")
try:
    st.calibrate(column, start, [measured["free decay"]], progress=False)
except ub.ArgumentError as error:
    refused = str(error)
    ub.print_once(refused, "\n")

# %% [markdown]
# A fit of two stiffnesses to the free decay, of the column and of the connection, is another case.
# The frequency depends on their sum as springs in series, and the fit warns that it cannot
# distinguish them.


# %%
def elastic(EI, stiffness):
    """The free decay by two stiffnesses; N m², N m/rad."""
    beam = ub.Beam((0, 0), (0, 3), ub.Section(EA=2.1e9, GA=6.7e8, EI=EI, rhoA=78.5, rhoI=0.065),
                   cells=6, name="column")  # fmt: skip
    base = ub.ground(0, 0)
    return ub.Scene(
        beams=[beam],
        joints=[ub.Revolute(base, beam.start)],
        connectors=[ub.Turn(base, beam.start, ub.Spring(stiffness))],
        masses=[ub.PointMass(beam.end, 400.0)],
        loads=[ub.PointLoad(beam.end, force=(8e3, 0), amplitude=rope)],
    )


decay = st.Measurement(
    measured["free decay"].times, measured["free decay"].values, name="decay", **tests["free decay"]
)
with warnings.catch_warnings():
    warnings.simplefilter("ignore", ub.ModelWarning)  # it is printed below
    both = st.calibrate(elastic, {"EI": 8e6, "stiffness": 4e6}, [decay], progress=False)
ub.print_once(*both.warnings, "", sep="\n")

# %% [markdown]
# ## Both tests
#
# The search begins at the start given and at seven random starts within the bounds.  Under `mpirun`
# several processes share the starts.

# %%
fit = st.calibrate(column, start, [*measured.values()], starts=8)
ub.print_once(fit, "\n")
for parameter, name in fit.identified_by.items():
    ub.print_once(f"{parameter} is identified by the {name}")

# %% [markdown]
# The columns "± by" are half widths of the 95 % intervals that one test alone would give.  The free
# decay determines the stiffness many times better than the pushover: the period is an average over
# all its values.  With longer records the interval becomes narrower still, but the search gets
# other minima, at which measured and computed swings differ by a whole period.
#
# ## Pictures

# %%
ub.plot(fit).savefig(output / "calibration.png")
ub.print_once("\npicture:", output / "calibration.png")

# %% [markdown]
# ## Verification
#
# The true numbers are within their intervals, and all starts end at the same minimum.  The
# estimated deviations of the noise are right within 30 %, three times their own deviation 1/√(2 m)
# of m = 60 values.

# %%
for parameter, (low, high) in fit.intervals.items():
    assert low < truth[parameter] < high
assert fit.same_minimum == 8
assert fit.identified_by == {"limit": "pushover", "energy": "pushover", "stiffness": "free decay"}
assert "limit has no effect" in refused
assert any("EI and stiffness" in warning for warning in both.warnings)
for name, sigma in zip(measured, fit.sigma, strict=True):
    size = np.abs(tests[name]["quantity"](fit.solutions[list(measured).index(name)])).max()
    assert abs(sigma[0] / (0.02 * size) - 1) < 0.3
assert fit.half_widths[2] < 0.25 * pushover.half_widths[2]
ub.print_once("the pushover identifies limit and energy, the free decay the stiffness")

# %% [markdown]
# ## Try this
#
# * `mpirun -n 2 python3 demo_calibration.py`: two starts at a time,
# * a free decay of 2 s with the same bounds: other minima appear in the list of starts,
# * a rope of 25 kN: the connection opens in the dynamic test, which alone then determines all three
#   numbers, within 6 %; a remark says that computed values jump,
# * `sigma=` of the true noise in `st.Measurement`, instead of an estimate.
