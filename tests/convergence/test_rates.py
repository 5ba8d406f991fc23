# SPDX-License-Identifier: MIT
"""Orders in space and time, asserted for all consecutive pairs of runs.

Dynamics, each compared with itself: the flying beam under a load that comes and goes as sin⁴ (a
jump, or sin², whose second derivative jumps, sends waves that no mesh resolves and hides the
order), at 2.4 s; and the spin-up, which is driven by a prescribed rotation, at 5 s.  An order may
differ from 2 by what the fourth-order term of the error still makes: a quarter with each
refinement, so 0.1 in the coarsest pair leaves less than 0.01 in the third.
"""

import math

import numpy as np
import pytest
from convergence.study import orders, romberg, self_convergence
from scenes import cantilever, flying_beam, spin_up

import ufl_beam as ub


def pulse(t):
    return math.sin(math.pi * t / 2.5) ** 4 if t < 2.5 else 0.0


def smoother_pulse(t):
    return math.sin(math.pi * t / 2.5) ** 8 if t < 2.5 else 0.0


def end_state(scene, dt, *, end, alpha=0.0, beta=0.0, order=2):
    """(displacement, velocity) of both ends and the middle of the first beam; each (3, 3)."""
    tight = ub.Newton(rtol=1e-13)
    solution = ub.simulate(
        scene, ub.EnergyMomentum(alpha, beta, order), t=(0, end), dt=dt, newton=tight, every=10**9
    )
    beam = scene.beams[0]
    places = (beam.start, beam.at(0.5), beam.end)
    moved = np.array([solution.displacement(place)[-1] for place in places])
    moving = np.array([solution.velocity(place)[-1] for place in places])
    return moved, moving


def fly(cells, dt, **losses):
    return end_state(flying_beam(cells=cells, time=pulse), dt, end=2.4, **losses)


def spin(cells, dt):
    return end_state(spin_up(cells=cells), dt, end=5.0)


def assert_second_order(runs):
    for answer in zip(*runs, strict=True):  # displacements, then velocities
        measured = self_convergence(answer)
        np.testing.assert_allclose(measured, 2, rtol=0, atol=0.1)
        assert abs(measured[-1] - 2) < 0.01


@pytest.mark.parametrize(("motion", "dt"), [(fly, 0.05), (spin, 0.05)])
def test_second_order_in_time(motion, dt):
    """Conserving midpoint rule, 8 cells."""
    assert_second_order([motion(8, dt / 2**k) for k in range(5)])


def test_fourth_order_in_time():
    """The composition, 8 cells.

    Steps of 0.005 s turn the fastest vibration, of some 280 rad/s, by 1.4 rad.  Positions have the
    order with longer steps, too; velocities, in which that vibration counts more, do not.
    """
    scene = flying_beam(cells=8, time=smoother_pulse)
    runs = [end_state(scene, 0.02 / 2**k, end=2.4, order=4) for k in range(4)]
    moved, moving = map(self_convergence, zip(*runs, strict=True))
    np.testing.assert_allclose(moved, 4, rtol=0, atol=0.1)
    assert abs(moving[-1] - 4) < 0.1


@pytest.mark.filterwarnings("ignore:the energy ledger is open:ufl_beam.ModelWarning")
def test_resonance_of_a_step_of_fourth_order():
    """[estimate] Errors of the spin-up with 100 and 400 steps, and far from resonance with 500.

    A vibration that a step turns by 2π, with ω dt = 9.5, resonates with the pattern of its stages:
    with 400 steps it is one of 760 rad/s, in a range of 5 % of the step.
    """
    exact, near, far = (
        end_state(spin_up(cells=8), 5.0 / steps, end=5.0, order=4)[0] for steps in (3200, 400, 500)
    )
    assert np.abs(far - exact).max() < 1e-8 < 1e-6 < np.abs(near - exact).max() < 1e-4


@pytest.mark.parametrize(("motion", "cells", "dt"), [(fly, 16, 0.0125), (spin, 8, 0.05)])
def test_second_order_in_space(motion, cells, dt):
    """Two-node cells with one point."""
    assert_second_order([motion(cells * 2**k, dt) for k in range(5)])


@pytest.mark.parametrize(("alpha", "beta"), [(0.5, 0.0), (0.0, 0.5)])
def test_dissipation_is_of_first_order(alpha, beta):
    """What α and β add to the resultants and velocities is proportional to Δt."""
    runs = [fly(8, 0.0125 / 2**k, alpha=alpha, beta=beta)[0] for k in range(5)]
    measured = self_convergence(runs)
    assert abs(measured[-1] - 1) < 0.05


@pytest.mark.parametrize("load", [ub.PointLoad, ub.FollowerLoad])
def test_second_order_of_statics(load):
    """Elastica of a strongly bent cantilever: errors against the limit of the finest runs."""

    def bent(cells):
        scene = cantilever(cells=cells, force=(0, 5.0), load=load)
        solution = ub.simulate(scene, ub.Static(), t=(0, 1), dt=0.1)
        return solution.displacement(scene.beams[0].end)[-1]

    runs = [bent(8 * 2**k) for k in range(6)]
    limit = romberg(*runs[-3:])
    errors = np.abs(np.array(runs[:-1]) - limit)
    for component in range(3):
        measured = orders(errors[:, component])
        np.testing.assert_allclose(measured, 2, rtol=0, atol=0.1)
        assert abs(measured[-1] - 2) < 0.01
