# %% [markdown]
# # Monte Carlo: a frame with random strength
#
# A portal frame is struck so that its columns yield, and a residual drift remains.  The drift
# depends on the yield stresses, which vary along the columns.  Usually one simulation with the mean
# yield stress is made.  This demo adds 48 simulations with random yield stresses.  They show the
# scatter of the drift, and that frames with scattered yield stresses **dissipate more**, in the
# mean and in nearly every sample.
#
# This demo shows
#
# * `ub.study`, which calls a function for many cases: one after the other, or several at a time
#   under `mpirun`, with the same results to the last bit,
# * random yield stresses of fibres, `ElastoPlastic(yield_limit=TruncatedNormal(..., seed=))`,
# * one file for all members, from which an interrupted study continues,
# * the 95 % confidence interval of the mean over the number of members.

# %%
# SPDX-License-Identifier: MIT
from pathlib import Path

import numpy as np
from scipy import stats

import ufl_beam as ub
import ufl_beam.structures as st

output = Path("output")
output.mkdir(exist_ok=True)

# %% [markdown]
# ## Scene
#
# The frame has columns of 4 m, clamped at the feet, a girder of 6 m, and 2 t on each corner; its
# period is 0.23 s.  The columns have ten layers of fibres.  Each fibre of each cell has its own
# random yield stress, with a mean of 300 MPa and a deviation of 60 MPa: much for steel, usual for
# timber or masonry.  The girder stays elastic.  A triangular force pulse of 40 ms acts at a corner.
#
# The scheme conserves energy exactly, so energy is lost only in fibres.

# %%
steel = {"E": 210e9, "nu": 0.3, "rho": 7850.0}  # Pa, -, kg/m^3
mean, deviation = 300e6, 60e6  # Pa
blow = ub.Table([0, 0.02, 0.04], [0, 1, 0])  # s, factor
end, dt = 1.2, 4e-3  # s


def portal(strength):
    """Return the frame, and the corner that is struck."""
    law = ub.ElastoPlastic(strength, kinematic=steel["E"] / 100)
    fibres = ub.Fibres(law, number=10)
    column = ub.Section.rectangle(b=0.10, h=0.20, **steel, fibres=fibres)  # m
    girder = ub.Section.rectangle(b=0.10, h=0.30, **steel)
    left = ub.Beam((0, 0), (0, 4), column, cells=8, name="left")  # m
    roof = ub.Beam((0, 4), (6, 4), girder, cells=4, name="roof")
    right = ub.Beam((6, 4), (6, 0), column, cells=8, name="right")
    scene = ub.Scene(
        beams=[left, roof, right],
        joints=[ub.Rigid(left.end, roof.start), ub.Rigid(roof.end, right.start)],
        supports=[ub.Clamped(left.start), ub.Clamped(right.end)],
        masses=[ub.PointMass(roof.start, 2000.0), ub.PointMass(roof.end, 2000.0)],  # kg
        loads=[ub.PointLoad(left.end, force=(800e3, 0), amplitude=blow)],  # N
    )
    return scene, left.end


# %% [markdown]
# ## A member
#
# The results of a member are named numbers and arrays, which a function of the seed returns.  In
# the end the frame sways elastically; the drift is the mean displacement over the last periods.


# %%
def struck(seed, record=()):
    """Simulate one frame; without a seed all fibres have the mean strength."""
    random = ub.distributions.TruncatedNormal(mean, deviation, seed=seed or 0)
    scene, corner = portal(mean if seed is None else random)
    solution = ub.simulate(scene, ub.EnergyMomentum(), t=(0.0, end), dt=dt, record=record)
    t, u = solution.times, solution.displacement(corner)[:, 0]
    highest, _ = st.peaks(t, u, prominence=0.2)
    last = (t > highest[-4]) & (t <= highest[-1])
    return {
        "displacement": u,  # m
        "largest displacement": u.max(),
        "residual drift": u[last].mean(),
        "dissipated energy": solution.energy.lost["plastic"][-1],  # J
        "ledger": solution.energy.worst,
        "substeps": solution.substeps,
    }


seeds = range(1, 49)
cases = [{"seed": None}, *({"seed": seed} for seed in seeds)]
study = ub.study(struck, cases, path=output / "monte_carlo.study", anew=True)
ub.print_once(f"{len(study)} members, {len(study.failed)} failed\n")

# %% [markdown]
# ## Statistics
#
# Student's interval of a mean is mean ± t s/√n with the standard deviation s.  It holds for
# independent members, and for any distribution if n is large.


# %%
def mean_95(x):
    """Return numbers n = 2, 3, ..., means of the first n values and half their 95 % intervals."""
    n = np.arange(2, len(x) + 1)
    means = np.array([x[:k].mean() for k in n])
    errors = np.array([x[:k].std(ddof=1) for k in n]) / np.sqrt(n)
    return n, means, stats.t.ppf(0.975, n - 1) * errors


units = {
    "largest displacement": (1e3, "mm"),
    "residual drift": (1e3, "mm"),
    "dissipated energy": (1e-3, "kJ"),
}
ub.print_once("                          mean strength      random strengths")
ub.print_once(
    "                                             mean ± 95 %      5 % to 95 % of members"
)
for name, (scale, unit) in units.items():
    alone, members = scale * study[name][0], scale * study[name][1:]
    members = members[np.isfinite(members)]  # a failed member is NaN
    _, means, halves = mean_95(members)
    low, high = np.percentile(members, (5, 95))
    ub.print_once(
        f"{name:21s} ({unit}) {alone:13.2f}  {means[-1]:13.2f} ± {halves[-1]:.2f}"
        f"  {low:14.2f} to {high:.2f}"
    )
drift = 1e3 * study["residual drift"][1:]
drift = drift[np.isfinite(drift)]
usual = 1e3 * study["residual drift"][0]
more = np.mean(study["dissipated energy"][1:] > study["dissipated energy"][0])
ub.print_once(f"\n{100 * more:.0f} % of the members dissipate more than the frame of mean strength")
ub.print_once(f"the first five drift by {', '.join(f'{x:.1f}' for x in drift[:5])} mm")

# %% [markdown]
# ## What the numbers mean
#
# The **drift** is a small difference of large numbers: the yielding of the columns to one side
# minus the yielding back.  The scatter makes the drift uncertain by a quarter downwards and a third
# upwards.  The drift of the frame of mean strength is within the 95 % interval of the mean.  The
# first five members would suggest the contrary, because all of them drift further than this frame.
#
# The **dissipated energy** is a sum in which nothing cancels.  Weak fibres yield to and fro in all
# swings, even in late swings, in which the frame of mean strength is elastic; the dissipation of
# strong fibres cannot fall below zero.  So the scatter increases the mean dissipation by a tenth,
# and nearly each member dissipates more than the frame of mean strength.
#
# ## One member, for ParaView
#
# The member with the largest drift is simulated again and written to a file.  The result is the
# same to the last bit.

# %%
worst = int(np.nanargmax(study["residual drift"]))
again = struck(**study.cases[worst], record=ub.VTKHDF(output / "monte_carlo.hdf", every=2))
ub.print_once(
    f"the most: {1e3 * again['residual drift']:.2f} mm with seed {study.cases[worst]['seed']}"
)

# %% [markdown]
# ## Pictures

# %%
BLUE, RED, GREY = "#0072B2", "#D55E00", "#909090"

with ub.picture((9, 4.5)) as histories:
    over_time = histories.subplots()
    t = np.linspace(0, end, len(study["displacement"][0]))
    u = 1e3 * study["displacement"]
    for row in u[1:]:
        over_time.plot(t, row, color=RED, lw=0.7, alpha=0.22)
    over_time.plot(t, u[0], color=BLUE, lw=2.0)
    over_time.axhline(usual, color=BLUE, lw=1.0, ls="--")
    over_time.set_xlim(0, end)
    over_time.set_xlabel("time (s)")
    over_time.set_ylabel("sway of the corner (mm)")
    over_time.set_title(
        f"a blow to one frame of mean strength (blue) and to {len(drift)} of random strength (red)",
        loc="left",
    )

with ub.picture((9, 4.5)) as statistics:
    spread, convergence = statistics.subplots(1, 2)
    bins = np.arange(np.floor(drift.min()), drift.max() + 1.5, 1.5)
    spread.axvspan(*np.percentile(drift, (5, 95)), color=RED, alpha=0.1, lw=0)
    spread.hist(drift, bins, color=RED, alpha=0.5, edgecolor="white")
    spread.axvline(usual, color=BLUE, lw=2.0)
    spread.set_xlabel("residual drift (mm)")
    spread.set_xticks(bins[::2])
    spread.set_ylabel("members")
    spread.set_title("how far they drift, 5 % to 95 %", loc="left")

    for name, color in {"dissipated energy": RED, "residual drift": GREY}.items():
        n, means, halves = mean_95(study[name][1:] / study[name][0])
        convergence.fill_between(n, means - halves, means + halves, color=color, alpha=0.25, lw=0)
        convergence.plot(n, means, color=color, lw=2.0, label=name)
    convergence.axhline(1.0, color=BLUE, lw=2.0)
    convergence.set_xlim(2, n[-1])
    convergence.set_ylim(0.9, 1.5)
    convergence.set_xlabel("number of members")
    convergence.set_ylabel("part of that of mean strength")
    convergence.set_title("their means and 95 %", loc="left")
    convergence.legend()

histories.savefig(output / "monte_carlo_histories.png")
statistics.savefig(output / "monte_carlo_statistics.png")
names = sorted(str(path) for path in output.glob("monte_carlo*"))
ub.print_once("\npictures and data:", *names, sep="\n  ")

# %% [markdown]
# ## Verification
#
# The ledger of every member closes and no step was subdivided, so the scatter is not numerical.
# From ten members on, the interval of the mean energy excludes the frame of mean strength; the
# final interval of the mean drift includes it.  The width of intervals is in proportion to 1/√n:
# half the width needs four times the members.  The member that was simulated again equals the
# member of the study.

# %%
assert not study.failed
assert study["ledger"].max() < 1e-9
assert (study["substeps"] == round(end / dt)).all()
ratio = {name: mean_95(study[name][1:] / study[name][0]) for name in units}
n, means, halves = ratio["dissipated energy"]
assert (means - halves > 1)[n >= 10].all()
assert more > 0.9
n, means, halves = ratio["residual drift"]
assert halves[-1] < 0.1
assert abs(means[-1] - 1) < halves[-1]
low, high = np.percentile(drift, (5, 95))
assert high - low > 0.4 * drift.mean()
assert all((np.asarray(again[name]) == study[name][worst]).all() for name in again)
ub.print_once("drift uncertain, dissipated energy larger than in the frame of mean strength")

# %% [markdown]
# ## Try this
#
# * `mpirun -n 3 python3 demo_monte_carlo.py`: three members at a time,
# * without `anew=True`: interrupt the study and restart it, or change 49 to 97; only missing
#   members are computed,
# * `ub.Fibres(law, number=40)`: do frames with more fibres differ less from each other?
# * `ub.distributions.Lognormal` instead of `ub.distributions.TruncatedNormal`,
# * a blow of 400 kN, under which the frame of mean strength stays elastic.
