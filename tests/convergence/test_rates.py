# SPDX-License-Identifier: MIT
"""Orders in space and time of two motions, each compared with itself, for all pairs of runs.

The load on the flying beam is sin⁴: a jump sends waves that no mesh resolves.  The fourth-order
term changes the order by a quarter with each refinement: 0.1 in the first pair, 0.01 in the third.
"""

import math

import numpy as np
import pytest
from convergence.study import self_convergence
from scenes import flying_beam, spin_up

import ufl_beam as ub


def end_state(scene, dt, end, order=2):
    """(displacement, velocity) of both ends and the middle of the first beam; each (3, 3)."""
    tight = ub.Newton(rtol=1e-13)
    solution = ub.simulate(
        scene, ub.EnergyMomentum(order=order), t=(0, end), dt=dt, newton=tight, every=10**9
    )
    beam = scene.beams[0]
    places = (beam.start, beam.at(0.5), beam.end)
    moved = np.array([solution.displacement(place)[-1] for place in places])
    moving = np.array([solution.velocity(place)[-1] for place in places])
    return moved, moving


def fly(cells, dt, power=4, order=2):
    def pulse(t):
        return math.sin(math.pi * t / 2.5) ** power if t < 2.5 else 0.0

    return end_state(flying_beam(cells=cells, time=pulse), dt, 2.4, order)


def spin(cells, dt, order=2):
    return end_state(spin_up(cells=cells), dt, 5.0, order)


def assert_second_order(runs):
    for answer in zip(*runs, strict=True):  # displacements, then velocities
        measured = self_convergence(answer)
        np.testing.assert_allclose(measured, 2, rtol=0, atol=0.1)
        assert abs(measured[-1] - 2) < 0.01


@pytest.mark.parametrize("motion", [fly, spin])
def test_second_order_in_time(motion):
    assert_second_order([motion(8, 0.05 / 2**k) for k in range(5)])


def test_fourth_order_in_time():
    """Velocities have the order once steps turn the fastest vibration by 1.4 rad, in 0.005 s."""
    runs = [fly(8, 0.02 / 2**k, power=8, order=4) for k in range(4)]
    moved, moving = map(self_convergence, zip(*runs, strict=True))
    np.testing.assert_allclose(moved, 4, rtol=0, atol=0.1)
    assert abs(moving[-1] - 4) < 0.1


@pytest.mark.filterwarnings("ignore:the energy ledger is open:ufl_beam.ModelWarning")
def test_resonance_of_a_step_of_fourth_order():
    """[estimate] With 400 steps a vibration of 760 rad/s, ω dt = 9.5, resonates with the stages."""
    exact, near, far = (spin(8, 5.0 / steps, order=4)[0] for steps in (1000, 400, 500))
    assert np.abs(far - exact).max() < 1e-8 < 1e-6 < np.abs(near - exact).max() < 1e-4


@pytest.mark.parametrize(("motion", "cells", "dt"), [(fly, 16, 0.0125), (spin, 8, 0.05)])
def test_second_order_in_space(motion, cells, dt):
    assert_second_order([motion(cells * 2**k, dt) for k in range(5)])
