# SPDX-License-Identifier: MIT
"""Prediction of the end of a step: exact for the motions that it knows, careful with others."""

from itertools import pairwise

import numpy as np
import pytest
from scenes import clamped

import ufl_beam as ub
from ufl_beam.compiled.c_library import doubles, ffi, lib
from ufl_beam.simulation.stepper import Prediction


def prediction_of(scheme):
    """One of a single beam, and the number of its degrees of freedom."""
    beam = ub.Beam((0, 0), (2, 0), ub.Section(EA=1, GA=1, EI=1, rhoA=1, rhoI=1), cells=2)
    scene = clamped(beam)
    simulation = ub.Simulation(scene, scheme)
    simulation.close()
    return simulation.prediction, simulation.subdomain.size


SMALL = 1e-3
"""Of the size of the scene, so that steps do not go far in it."""


def follow(prediction: Prediction, motion, times):
    """Accept the configurations at these times but the last, and predict that."""
    for t0, t1 in pairwise(times[:-1]):
        q = motion(t0)
        lib.enter_step(prediction.c, t1 - t0, doubles(q), doubles(motion(t1)))
        lib.compare_differences(prediction.c)
        ffi.memmove(prediction.c.q_before, doubles(q), q.nbytes)
    return guess(prediction, motion(times[-2]), times[-1] - times[-2])


def guess(prediction, q, dt):
    """Predict the end of a step from ``q``."""
    out = np.empty(len(q))
    lib.predict(prediction.c, dt, doubles(q), doubles(out))
    return out


@pytest.mark.parametrize("scheme", [ub.Static(), ub.EnergyMomentum()])
def test_uniform_motion_is_predicted_exactly(scheme):
    """[closed] Exact over any steps; round-off of the times is below 1e-12 of them."""
    prediction, size = prediction_of(scheme)
    v = np.arange(1.0, size + 1)
    found = follow(prediction, lambda t: v * t, [0, 1, 2, 3, 3.5, 5])
    assert found == pytest.approx(5 * v, rel=1e-12)


def test_constant_acceleration_is_predicted_exactly():
    """[closed] Exact over equal steps; a longer one is at the velocity of the last."""
    prediction, size = prediction_of(ub.EnergyMomentum())
    a = SMALL * np.arange(1.0, size + 1)
    times = 0.1 * np.arange(6)
    found = follow(prediction, lambda t: a * t**2 / 2, times)
    assert found == pytest.approx(a * times[-1] ** 2 / 2, rel=1e-12)
    longer = guess(prediction, a * times[-2] ** 2 / 2, 0.2)
    assert longer == pytest.approx(a * (0.4**2 / 2 + 0.35 * 0.2), rel=1e-12)


def test_second_difference_needs_three_equal_steps():
    """[closed] Two second differences over equal steps are compared."""
    prediction, size = prediction_of(ub.EnergyMomentum())
    a = np.full(size, SMALL)
    found = follow(prediction, lambda t: a * t**2 / 2, [0, 0.5, 0.6, 0.7, 0.8])
    assert found == pytest.approx(a * (0.7**2 / 2 + 0.065), rel=1e-12)


@pytest.mark.parametrize("part", [0.01, 0.2])
def test_part_of_a_second_difference(part):
    """That part of the last second difference is added which the one before was."""
    prediction, size = prediction_of(ub.EnergyMomentum())
    steps = SMALL * np.array([10, 10 + part, 11 + part])
    places = np.cumsum([0, *steps])
    found = follow(prediction, lambda t: np.full(size, places[round(t)]), np.arange(5))
    expected = places[3] + steps[2] + part * SMALL
    assert found == pytest.approx(np.full(size, expected), rel=1e-12)


@pytest.mark.parametrize(
    "places",
    [
        SMALL * np.array([0, 10, 19, 29, 38]),  # second differences change their sign
        SMALL * np.array([0, 1, 3, 6, 10]) ** 2,  # they are as large as steps
        np.array([0, 1.0, 2.1, 3.3, 4.6]),  # steps go further than the scene
    ],
)
def test_motion_that_steps_do_not_resolve(places):
    """[closed] It is taken to go on at the velocity of the last step."""
    prediction, size = prediction_of(ub.EnergyMomentum())
    found = follow(prediction, lambda t: np.full(size, places[round(t)]), np.arange(6))
    assert found == pytest.approx(np.full(size, 2 * places[4] - places[3]), rel=1e-12)


def test_in_statics_the_last_increment_is_repeated():
    """Load steps have no inertia: the last one is repeated, and no second difference is kept."""
    prediction, size = prediction_of(ub.Static())
    a = np.ones(size)
    found = follow(prediction, lambda t: a * t**2, np.arange(6.0))
    assert found == pytest.approx(a * (4**2 + 7), rel=1e-12)


def test_steps_by_attempts():
    """They predict the same, and take the same iterations, as steps at once."""
    section = ub.Section(EA=1e6, GA=1e6, EI=10, rhoA=1, rhoI=1e-4)
    found = []
    for at_once in (True, False):
        beam = ub.Beam((0, 0), (1, 0), section, cells=8)
        loads = [ub.Gravity((0, -10))]
        scene = ub.Scene([beam], supports=[ub.Pinned(beam.start)], loads=loads)
        simulation = ub.Simulation(scene, ub.EnergyMomentum())
        for n in range(1, 41):
            if at_once:
                simulation.step_to(n * 0.002)
            else:
                simulation.accept(simulation.attempt(n * 0.002))
        found.append((simulation.iterations, simulation.prediction.c.repeated, simulation.q[-1]))
        simulation.close()
    assert found[0] == found[1]
