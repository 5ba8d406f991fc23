# SPDX-License-Identifier: MIT
"""Incremental dynamic analysis: spectra, single runs, continued files; fragility by hand.

The motions are realizations of the process of Kanai and Tajimi with an envelope in time.
"""

import os
import signal
import subprocess
import sys
from dataclasses import replace
from pathlib import Path

from mpi4py import MPI

import numpy as np
import pytest
from helpers import raises
from scenes import clamped
from scipy.optimize import minimize
from scipy.signal import lsim
from scipy.stats import binom, lognorm, norm

import ufl_beam as ub
import ufl_beam.structures as st

SECTION = ub.Section.rectangle(b=0.1, h=0.2, E=210e9, nu=0.3)
H, MASS = 3.0, 5e3  # m, kg
COLUMN = ub.Beam((0, 0), (0, H), SECTION, cells=1, name="column")
WEAK = ub.Beam(
    (0, 0), (0, H), SECTION, cells=1, name="weak",
    hinges={0.0: ub.Softening(limit=6e4, fracture_energy=2e4)},  # N m, J
)  # fmt: skip


def motion(seed, dt=0.02, duration=10.0):
    """White noise through the filter of Kanai and Tajimi, 15 rad/s and 0.6; m/s²."""
    t = np.arange(round(duration / dt) + 1) * dt
    noise = np.random.default_rng(seed).standard_normal(len(t))
    a = lsim(([18.0, 225.0], [1.0, 18.0, 225.0]), noise, t)[1]
    envelope = np.minimum(1.0, (t / 2.0) ** 2) * np.exp(-np.maximum(0.0, t - 6.0) / 2.0)
    return st.GroundMotion(dt, a * envelope, f"seed {seed}")


def shaken(column, record, *loads):
    """A column with a mass at its end, in the axes of the ground."""
    ground = ub.Gravity((-1, 0), amplitude=record.acceleration)
    return clamped(column, masses=[ub.PointMass(column.end, MASS)], loads=[*loads, ground])


def drift(run):
    """Drift of the weak column at each time."""
    return run.displacement(WEAK.end)[:, 0] / H


def analysis(motions, intensities, build=None, measure=drift, limit=0.1, **options):
    """Analysis of the weak column, without a bar."""
    build = build or (lambda record: shaken(WEAK, record, ub.Gravity()))
    return st.incremental_dynamic_analysis(
        build, motions, intensities, measure, limit=limit, **options
    )


def test_elastic_demands_are_the_displacement_spectrum():
    """[closed] S_a = ω² S_d: the demand over the spectral acceleration is 1/ω² for all motions.

    The period is longer by (ω dt)²/12 = 2.6e-4; the spectrum changes up to ten times as fast.
    """
    omega = ub.modes(shaken(COLUMN, motion(0)), 1).omega[0]
    motions, damping = [motion(seed) for seed in range(3)], [ub.Rayleigh(mass=2 * 0.05 * omega)]

    def spectral(record):
        return st.response_spectrum(record, [2 * np.pi / omega], 0.05).pseudo_acceleration[0]

    def build(record):
        return replace(shaken(COLUMN, record), damping=damping)

    def sway(run):
        return run.displacement(COLUMN.end)[:, 0]

    small, options = [1e-3, 3e-3], {"dt": 0.056 / omega, "intensity": spectral}  # m/s²
    found = analysis(motions, small, build, sway, 1.0, **options)
    np.testing.assert_allclose(found.demand, np.tile(small, (3, 1)) / omega**2, rtol=2.6e-3)
    assert not found.collapsed.any()
    assert found.labels == ("sway", "spectral")


def test_members_are_runs_of_the_scaled_motion():
    """To the last bit; a collapse ends the run at one of 10 comparisons with the limit."""
    record = motion(1)
    found = analysis([record], [2.0, 4.0, 12.0], limit=0.05)
    for k, peak in enumerate((2.0, 4.0)):
        scene = shaken(WEAK, record.scaled(peak=peak), ub.Gravity())
        steps = {"t": (0, record.duration), "dt": record.dt, "comm": MPI.COMM_SELF}
        run = ub.simulate(scene, ub.EnergyMomentum(), **steps)
        assert found.demand[0, k] == np.abs(drift(run)).max()
    assert found.labels == ("drift", "peak acceleration (m/s²)")
    assert found.outcome.tolist() == [[0, 0, 1]]
    assert found.demand[0, 2] > 0.05
    assert found.end[0, :2].tolist() == [record.duration] * 2
    assert found.end[0, 2] < record.duration
    comparisons = 10 * found.end[0, 2] / record.duration
    assert abs(comparisons - round(comparisons)) < 1e-9  # 500 steps


def test_a_step_without_equilibrium_is_a_collapse():
    found = analysis([motion(1)], [8.0], newton=ub.Newton(max_iterations=1))
    assert found.outcome == 2
    assert found.collapsed.all()
    assert "without equilibrium below the limit: 1" in str(found)
    assert np.isinf(found.fractiles()).all()


def test_an_analysis_goes_on(shared_path):
    """Also with further motions and intensities; a motion that changed is computed again."""
    built = []

    def build(record):
        built.append(record)
        return shaken(WEAK, record, ub.Gravity())

    def runs(motions, intensities):
        built.clear()
        found = analysis(motions, intensities, build, path=shared_path / "ida.h5")
        return found, MPI.COMM_WORLD.allreduce(len(built) - 1)  # one is built for a check

    one, other = motion(1), motion(2)
    first, number = runs([one], [1.0, 2.0])
    assert number == 2
    again, number = runs([one], [1.0, 2.0])
    assert number == 0
    assert (again.demand == first.demand).all()
    more, number = runs([one, other], [1.0, 2.0, 3.0])
    assert number == 4
    assert (more.demand[:1, :2] == first.demand).all()
    changed = st.GroundMotion(one.dt, (*one.values[:-1], 0.5), one.name)
    assert runs([changed], [1.0, 2.0])[1] == 2


def test_fractiles_are_demands_of_motions():
    """[closed] The least demand that 16, 50 or 84 % of five motions do not exceed."""
    found = analysis([motion(seed) for seed in range(5)], [6.0], limit=0.05)
    demand = np.sort(np.where(found.collapsed, np.inf, found.demand)[:, 0])
    assert (found.fractiles()[:, 0] == demand[[0, 2, 4]]).all()
    assert (found.fractiles([20.0, 21.0, 100.0])[:, 0] == demand[[0, 1, 4]]).all()


# -- fragility ------------------------------------------------------------------------------------


def test_a_fragility_through_two_fractions():
    """[closed] Two parameters meet two fractions: the normal quantiles are linear in ln(x)."""
    fit = st.Fragility.fit([2.0, 5.0], [3, 16], [20, 20])
    assert fit([2.0, 5.0]) == pytest.approx([0.15, 0.8], rel=1e-8)
    low, high = norm.ppf([0.15, 0.8])
    beta = np.log(2.5) / (high - low)
    assert fit.dispersion == pytest.approx(beta, rel=1e-8)
    assert fit.median == pytest.approx(2.0 * np.exp(-low * beta), rel=1e-8)


def test_a_fragility_has_the_largest_likelihood():
    """[calc] By the binomial and lognormal distributions of SciPy; Baker 2015, equation 11."""
    im, z, n = np.arange(1.0, 9.0), np.array([0, 1, 3, 8, 11, 14, 19, 19]), np.full(8, 20)

    def loss(x):
        return -binom.logpmf(z, n, lognorm(s=x[1], scale=x[0]).cdf(im)).sum()

    fit = st.Fragility.fit(im, z, n)
    exact = {"xatol": 1e-7, "fatol": 1e-12}
    by_scipy = minimize(loss, (4.0, 0.5), method="Nelder-Mead", options=exact)
    assert (fit.median, fit.dispersion) == pytest.approx(by_scipy.x, rel=1e-6)
    assert fit(fit.median) == 0.5


@pytest.mark.parametrize(
    ("counts", "words"),
    [
        ([0, 0, 0], "no motion exceeds the limit up to the intensity 3"),
        ([9, 9, 9], "all motions exceed the limit from the intensity 1 on"),
        ([0, 4, 9], "no motion exceeds the limit below the intensity 2, and all do above 2"),
        ([5, 4, 3], "does not grow with the intensity"),
        ([0, 4, 10], "exceeded must be from 0 to number"),
    ],
)
def test_counts_without_a_fit_are_refused(counts, words):
    with raises(words):
        st.Fragility.fit([1.0, 2.0, 3.0], counts, [9, 9, 9])


def test_a_limit_below_collapse():
    motions = [motion(seed) for seed in range(5)]
    found = analysis(motions, [3.5, 4.0, 4.5], limit=0.05)
    assert (found.fragility(0.0099).exceeded == (found.demand > 0.0099).sum(axis=0)).all()
    with raises("fractiles: percent must be between 0 and 100"):
        found.fractiles([50.0, 101.0])
    with raises("fragility: limit = 0.1 is above the limit of collapse, 0.05"):
        found.fragility(0.1)


# -- mistakes and kills ---------------------------------------------------------------------------


SQUARE = motion(1).peak ** 2


@pytest.mark.parametrize(
    ("options", "words"),
    [
        ({"motions": [motion(1), motion(1)]}, "motions: the same motion occurs twice"),
        ({"scheme": ub.Static()}, "scheme = Static() is static"),
        ({"intensity": lambda record: 0.0}, "intensity of seed 1 = 0 must be positive"),
        (
            {"intensity": lambda record: record.peak**2},
            f"intensity of seed 1 = {SQUARE:g}, and {4 * SQUARE:g} if the motion is doubled; give",
        ),
        (
            {"intensity": lambda record: 3.0},
            "if the motion is doubled; give an intensity that is proportional",
        ),
        ({"measure": lambda run: None}, "measure returned None, not finite numbers"),
        ({"measure": lambda run: "far"}, "measure returned 'far', not finite numbers"),
    ],
)
def test_mistakes_are_named(options, words):
    with raises(words):
        analysis(**{"motions": [motion(1)], "intensities": [1.0], **options})


def test_a_build_that_ignores_its_motion_is_warned_of():
    with pytest.warns(ub.ModelWarning, match="does build use its argument"):
        analysis([motion(1)], [1.0, 2.0], build=lambda _: shaken(WEAK, motion(1)))


def main(path):
    """Analyse 20 motions at 4 intensities."""
    found = analysis([motion(seed) for seed in range(20)], [4.0, 6.0, 8.0, 10.0], path=path)
    ub.print_once(found.demand.tobytes().hex(), found.fragility())


@pytest.mark.slow
@pytest.mark.serial
def test_twenty_motions_on_one_and_two_processes_after_a_kill(tmp_path):
    """The results agree to the last bit, and after the kill only missing runs are computed."""
    command = [sys.executable, __file__]
    environment = {**os.environ, "PYTHONPATH": os.pathsep.join(sys.path)}

    def start(number, path):
        mpi = ["mpirun", "--allow-run-as-root", "--oversubscribe", "-n", str(number)]
        return subprocess.Popen(
            [*(mpi if number > 1 else []), *command, str(path)], env=environment,
            stdout=subprocess.PIPE, text=True, start_new_session=True,
        )  # fmt: skip

    whole = start(1, tmp_path / "whole.h5").communicate()[0]
    killed = start(2, tmp_path / "killed.h5")
    while not (tmp_path / "killed.h5").exists() or len(_done(tmp_path / "killed.h5")) < 5:
        assert killed.poll() is None
    os.killpg(killed.pid, signal.SIGKILL)  # with the processes of mpirun
    killed.communicate()
    before = _done(tmp_path / "killed.h5")
    assert len(before) < 80
    assert start(2, tmp_path / "killed.h5").communicate()[0] == whole
    after = _done(tmp_path / "killed.h5")
    assert len(after) == 80
    assert before.items() <= after.items()  # with their wall times: not computed again


def _done(path):
    """Wall times of the members in a file, by their cases."""
    found = ub.Study.load(path)
    return {tuple(case.values()): s for case, s in zip(found.cases, found.seconds, strict=True)}


if __name__ == "__main__":
    main(Path(sys.argv[1]))
