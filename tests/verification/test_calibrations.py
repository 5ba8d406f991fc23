# SPDX-License-Identifier: MIT
"""Calibration of a softening hinge with a noisy pushover and a noisy free decay.

The data are computed with known parameters, and have errors of 2 % of their largest magnitude.
"""

import numpy as np
import pytest
from scenes import clamped

import ufl_beam as ub
import ufl_beam.structures as st

SECTION = ub.Section(EA=2.1e9, GA=6.7e8, EI=9e6, rhoA=78.5, rhoI=0.065)
TRUTH = {"limit": 60e3, "energy": 6e3, "stiffness": 3e6}  # N m, J, N m/rad
BOUNDS = {"limit": (40e3, 30e3, 120e3), "energy": (10e3, 3e3, 12e3), "stiffness": (5e6, 1.5e6, 6e6)}
NOISE = 0.02


def column(limit, energy, stiffness, pushed):
    """A column of 3 m with 400 kg at its end, on a hinge that softens."""
    beam = ub.Beam((0, 0), (0, 3), SECTION, cells=6, name="column")
    foot = ub.ground(0, 0)
    spring = ub.Spring(stiffness, softening=ub.Softening(limit, energy))
    if pushed:  # t is the displacement
        test = {"supports": [ub.PrescribedDisplacement(beam.end, u=lambda t: t)]}
    else:  # pulled by 8 kN, which stays below the limit, and released after 0.2 s
        pull = ub.Table([0.0, 0.2, 0.2001], [0, 1, 0])
        test = {"loads": [ub.PointLoad(beam.end, force=(8e3, 0), amplitude=pull)]}
    pin, turn = ub.Revolute(foot, beam.start), ub.Turn(foot, beam.start, spring)
    mass = ub.PointMass(beam.end, 400.0)
    return ub.Scene([beam], joints=[pin], connectors=[turn], masses=[mass], **test)


def force(run):
    return run.reaction(run.scene.supports[0])[:, 0]


def sway(run):
    return run.displacement(run.scene["column"].end)[:, 0]


RUNS = {
    "pushover": {"quantity": force, "scheme": ub.Static(), "t": (0, 0.6), "dt": 5e-3},
    "free decay": {"quantity": sway, "scheme": ub.EnergyMomentum(), "t": (0, 0.5), "dt": 4e-3},
}


@pytest.fixture(scope="module")
def exact():
    """Times and computed values of both tests with the true parameters."""
    found = {}
    for name, run in RUNS.items():
        scene = column(**TRUTH, pushed=name == "pushover")
        solution = ub.simulate(scene, run["scheme"], t=run["t"], dt=run["dt"])
        times = np.linspace(*run["t"], 61)[1:]
        any_sigma = st.Measurement(times, 0 * times, **run)
        found[name] = times, any_sigma.computed(solution)
    return found


def measured(exact, seed, given=True):
    """Noisy data of both tests, with known or unknown standard deviation."""
    rng, several = np.random.default_rng(seed), []
    for name, (times, values) in exact.items():
        sigma = NOISE * np.abs(values).max()
        noisy = values + sigma * rng.normal(size=len(values))
        options = {"arguments": {"pushed": name == "pushover"}, "name": name, **RUNS[name]}
        several.append(st.Measurement(times, noisy, sigma=sigma if given else None, **options))
    return several


def test_each_test_identifies_its_parameters(exact):
    """The hinge stays closed in the free decay, which knows the stiffness only, but best."""
    fit = st.calibrate(column, BOUNDS, measured(exact, 0))
    assert fit.identified_by == {
        "limit": "pushover", "energy": "pushover", "stiffness": "free decay"
    }  # fmt: skip
    assert np.isinf(fit.half_widths_alone[1, :2]).all()
    assert fit.half_widths_alone[1, 2] < 0.2 * fit.half_widths_alone[0, 2]
    # The truth is within three standard deviations, 3/1.96 half widths, in 99.7 % of all seeds.
    for (name, p), half in zip(fit.parameters.items(), fit.half_widths, strict=True):
        assert abs(p - TRUTH[name]) < 1.6 * half
    # 120 squared residuals and 3 parameters: mean 117, standard deviation sqrt(2 * 117) = 15.
    assert abs(2 * fit.cost - 117) < 3 * 15
    # no warning is issued


@pytest.mark.slow
def test_random_starts_end_at_the_same_minimum(exact):
    """Bounds are factors of 2 to 4 apart; within them the free decay has no other minimum."""
    fit = st.calibrate(column, BOUNDS, measured(exact, 0), starts=20)
    least = np.nanmin(fit.end_costs)
    assert (np.abs(fit.end_costs - least) <= 1e-8 * least).sum() >= 18


@pytest.mark.slow
@pytest.mark.filterwarnings("ignore:.*ended where computed values jump")
@pytest.mark.parametrize("given", [True, False])
def test_intervals_cover_the_truth_in_95_of_100_data_sets(exact, given):
    """The number is binomial with mean 95 and standard deviation 2.2."""
    covered = np.zeros(3)
    for seed in range(100):
        fit = st.calibrate(column, TRUTH, measured(exact, seed, given))
        ends = np.array([*fit.intervals.values()]).T
        true = np.array([*TRUTH.values()])
        covered += (ends[0] <= true) & (true <= ends[1])
    assert ((covered >= 90) & (covered <= 99)).all()


@pytest.mark.slow
def test_random_starts_with_a_hinge_in_a_beam_end_at_the_same_minimum():
    """Limit, fracture energy and EI from the motion after a pulse, with starts within 50 %."""

    def pulse(t):
        return float(np.sin(np.pi * t / 0.2)) if t < 0.2 else 0.0

    def cantilever(limit, energy, EI):
        section = ub.Section(EA=2.1e9, GA=6.7e8, EI=EI, rhoA=78.5, rhoI=0.065)
        hinge = {0.0: ub.Softening(limit, energy)}
        beam = ub.Beam((0, 0), (0, 3), section, cells=12, name="column", hinges=hinge)
        load = ub.PointLoad(beam.end, force=(32e3, 0), amplitude=pulse)
        mass = ub.PointMass(beam.end, 400.0)
        return clamped(beam, masses=[mass], loads=[load])

    run = {"scheme": ub.EnergyMomentum(alpha=0.02), "t": (0, 0.6), "dt": 2e-3}
    true = {"limit": 60e3, "energy": 6e3, "EI": 9e6}
    solution = ub.simulate(cantilever(**true), **run)
    noise = np.random.default_rng(0).normal(size=len(solution))
    values = sway(solution) + 0.01 * np.abs(sway(solution)).max() * noise
    bounds = {name: (1.2 * p, 0.5 * p, 1.5 * p) for name, p in true.items()}
    data = [st.Measurement(solution.times, values, sway, **run)]
    fit = st.calibrate(cantilever, bounds, data, starts=20)
    least = np.nanmin(fit.end_costs)
    assert (np.abs(fit.end_costs - least) <= 1e-8 * least).sum() >= 18
    for name, (low, high) in fit.intervals.items():
        assert low < true[name] < high  # as in 95 % of all seeds
