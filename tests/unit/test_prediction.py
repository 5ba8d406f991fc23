# SPDX-License-Identifier: MIT
"""Prediction of the end of a step: exact for the motions that it knows, careful with others."""

from itertools import pairwise

import numpy as np
import pytest
from scenes import clamped

import ufl_beam as ub
from ufl_beam.compiled.c_library import doubles, ffi, lib

SMALL = 1e-3
"""Of the size of the scene, so that steps do not go far in it."""

UNRESOLVED = {
    "second differences change their sign": SMALL * np.array([0, 10, 19, 29, 38]),
    "they are as large as steps": SMALL * np.array([0, 1, 3, 6, 10]) ** 2,
    "steps go further than the scene": np.array([0, 1.0, 2.1, 3.3, 4.6]),
}


def predicted(scheme, times, places, dt=None):
    """Accept a motion that is the same of all degrees of freedom, and predict the next step."""
    beam = ub.Beam((0, 0), (2, 0), ub.Section(EA=1, GA=1, EI=1, rhoA=1, rhoI=1), cells=2)
    simulation = ub.Simulation(clamped(beam), scheme)
    simulation.close()
    prediction, size = simulation.prediction, simulation.subdomain.size
    states = [np.full(size, float(place)) for place in places]
    for (t0, q0), (t1, q1) in pairwise(zip(times, states, strict=False)):
        lib.enter_step(prediction.c, t1 - t0, doubles(q0), doubles(q1))
        lib.compare_differences(prediction.c)
        ffi.memmove(prediction.c.q_before, doubles(q0), q0.nbytes)
    dt, out = dt or times[len(states)] - times[len(states) - 1], np.empty(size)
    lib.predict(prediction.c, dt, doubles(states[-1]), doubles(out))
    assert np.ptp(out) == 0.0
    return out[0]


DYNAMIC, STATIC = ub.EnergyMomentum(), ub.Static()
EVEN = 0.1 * np.arange(6)


@pytest.mark.parametrize(
    ("scheme", "times", "places", "dt", "expected"),
    [
        # Uniform motion over any steps
        (STATIC, [0, 1, 2, 3, 3.5, 5], [0, 1, 2, 3, 3.5], None, 5),
        (DYNAMIC, [0, 1, 2, 3, 3.5, 5], [0, 1, 2, 3, 3.5], None, 5),
        # Constant acceleration over equal steps; a longer one is at the velocity of the last
        (DYNAMIC, EVEN, SMALL * EVEN[:5] ** 2 / 2, None, SMALL * 0.5**2 / 2),
        (DYNAMIC, EVEN, SMALL * EVEN[:5] ** 2 / 2, 0.2, SMALL * (0.4**2 / 2 + 0.35 * 0.2)),
        # Two second differences over equal steps are compared
        (
            DYNAMIC,
            [0, 0.5, 0.6, 0.7, 0.8],
            SMALL * np.array([0, 0.5, 0.6, 0.7]) ** 2 / 2,
            None,
            SMALL * (0.7**2 / 2 + 0.065),
        ),
        # That part of the last second difference is added which the one before was
        *(
            (DYNAMIC, range(5), SMALL * np.cumsum([0, 10, 10 + part, 11 + part]), None,
             SMALL * (42 + 4 * part))
            for part in (0.01, 0.2)
        ),
        # Motions that steps do not resolve go on at the velocity of the last step
        *((DYNAMIC, range(6), x, None, 2 * x[4] - x[3]) for x in UNRESOLVED.values()),
        # In statics the last increment is repeated, and no second difference is kept
        (STATIC, range(6), np.arange(5.0) ** 2, None, 4**2 + 7),
    ],
)  # fmt: skip
def test_prediction(scheme, times, places, dt, expected):
    """[closed] Round-off of the times is below 1e-12 of them."""
    assert predicted(scheme, times, places, dt) == pytest.approx(expected, rel=1e-12)


def test_steps_by_attempts():
    """They predict the same, and take the same iterations, as steps at once."""
    section = ub.Section(EA=1e6, GA=1e6, EI=10, rhoA=1, rhoI=1e-4)
    beam = ub.Beam((0, 0), (1, 0), section, cells=8)
    scene = ub.Scene([beam], supports=[ub.Pinned(beam.start)], loads=[ub.Gravity((0, -10))])
    found = []
    for at_once in (True, False):
        simulation = ub.Simulation(scene, ub.EnergyMomentum())
        for n in range(1, 41):
            if at_once:
                simulation.step_to(n * 0.002)
            else:
                simulation.accept(simulation.attempt(n * 0.002))
        found.append((simulation.iterations, simulation.prediction.c.repeated, simulation.q[-1]))
        simulation.close()
    assert found[0] == found[1]
