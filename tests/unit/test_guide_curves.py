# SPDX-License-Identifier: MIT
"""Points on guide curves: what C asks of a curve, how often, and what a curve may answer."""

import math

import numpy as np
import pytest

import ufl_beam as ub
from ufl_beam.terms.guides import Guides

SECTION = ub.Section(EA=1e4, GA=1e4, EI=10.0, rhoA=1.0, rhoI=0.01)


def scene(curve):
    beam = ub.Beam((0, 0), (1, 0), SECTION, cells=2, name="girder")
    return ub.Scene(
        [beam],
        joints=[ub.Guided(beam.end, curve)],
        supports=[ub.Roller(beam.start, along=(1, 0))],
        loads=[ub.Gravity(), ub.PointLoad(beam.end, (5.0, 0.0), amplitude=lambda t: min(t, 0.1))],
    )


def wave(s):
    return 1.0 + s, 0.2 * math.sin(3 * s)


def run(guided):
    return ub.simulate(guided, ub.EnergyMomentum(), t=(0, 0.4), dt=0.01)


def stepped(curve, steps=40, scheme=None):
    simulation = ub.Simulation(scene(curve), scheme or ub.EnergyMomentum())
    for k in range(1, steps + 1):
        simulation.step_to(0.01 * k)
    return simulation


@pytest.mark.parametrize("kind", [list, np.array, lambda p: tuple(map(np.float64, p))])
def test_a_curve_returns_any_two_numbers(kind):
    np.testing.assert_array_equal(
        stepped(lambda s: kind(wave(s)), 5).q, stepped(wave, 5).q
    )  # fmt: skip


def test_a_place_stays_on_its_curve():
    guided = scene(wave)
    solution = run(guided)
    u, v, _ = solution.displacement(guided.beams[0].end).T
    assert np.abs(v - [wave(s)[1] for s in u]).max() < 1e-12
    assert np.abs(u).max() > 0.1
    assert solution.energy.worst < 1e-11


def test_few_points_are_asked_for():
    """Five for each iterate, and some more where a step begins and goes far."""

    def counted(s):
        counts.append(s)
        return wave(s)

    counts = []
    simulation = ub.Simulation(scene(counted), ub.EnergyMomentum())
    simulation.step_to(0.01)
    counts.clear()
    before, steps = simulation.iterations, 30
    for k in range(2, steps + 2):
        simulation.step_to(0.01 * k)
    assert len(counts) <= 5 * (simulation.iterations - before + 3 * steps)


@pytest.mark.parametrize("answer", [None, (1.0,), (1.0, 2.0, 3.0), ("x", 0.0), 1.0])
def test_a_curve_that_ceases_to_return_points(answer):
    curve = Failing(lambda: answer)
    simulation = stepped(curve, 2)
    curve.fails = True
    with pytest.raises((TypeError, ValueError)):
        simulation.step_to(0.03)
    curve.fails = False
    simulation.step_to(0.03)
    np.testing.assert_array_equal(simulation.q, stepped(wave, 3).q)


@pytest.mark.serial  # one process has the guide
def test_what_a_curve_raises_outside_of_steps():
    curve = Failing(lambda: 1 / 0)
    simulation = stepped(curve, 2)
    (guides,) = (one for one in simulation.equation.terms if isinstance(one, Guides))
    distances, q = guides.motion(simulation.q), simulation.q
    assert np.abs(distances).max() < 1e-14
    nearby, r = q + 1e-3, np.zeros(len(q))
    curve.fails = True
    for ask in (guides.motion, guides.add_tangent, lambda q: guides.add_residual(q, r)):
        with pytest.raises(ZeroDivisionError):
            ask(nearby)
    curve.fails = False
    simulation.step_to(0.03)  # nothing of it is left
    np.testing.assert_array_equal(simulation.q, stepped(wave, 3).q)


class Failing:
    """The wave, until it fails."""

    def __init__(self, fail):
        self.fail, self.fails = fail, False

    def __call__(self, s):
        return self.fail() if self.fails else wave(s)
