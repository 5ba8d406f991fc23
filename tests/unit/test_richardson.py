# SPDX-License-Identifier: MIT
"""Orders, limits, errors, costs and fronts of manufactured runs, whose answers are known."""

import math

import numpy as np
import pytest

from ufl_beam.analysis.richardson import SURE, UNSURE, Convergence, Cost, Cross, pareto

SHAPE = np.array([1.0, -2.0, 0.5])
"""Of the error of an array; its largest entry is 2."""


def three(order, *, finest=2, error=1.0, shape=SHAPE):
    """Values of limit 7 on levels up to the finest, `error * 2**(-order * level)` from it."""
    levels = range(finest - 2, finest + 1)
    return tuple(7.0 + error * 2.0 ** (-order * k) * shape for k in levels)


@pytest.mark.parametrize("order", [0.6, 1.0, 1.5, 2.0])
@pytest.mark.parametrize("finest", [2, 5])
def test_a_power_is_recognised(order, finest):
    seen = Convergence.of(three(order, finest=finest), finest, 2.0, 1e-12)
    assert seen.seen
    assert seen.aligned
    assert seen.order == pytest.approx(order, abs=1e-9)
    # Whole orders are trusted, others get the larger factor.
    assert seen.safety == (SURE if order in (1.0, 2.0) else UNSURE)
    assert np.abs(three(order, finest=finest)[2] + seen.rest - 7.0).max() < 1e-12
    for level in (finest - 2, finest - 0.5, finest):
        true = 2.0 * 2.0 ** (-order * level)
        assert seen.at(level) == pytest.approx(seen.safety * true, rel=1e-9)


def test_what_is_faster_than_the_method_is_not_believed():
    """From order 4 of a method of order 2 an error follows that is too large."""
    seen = Convergence.of(three(4.0), 2, 2.0, 1e-12)
    assert seen.order == pytest.approx(4.0)
    assert seen.used == 2.0
    assert seen.at(2) > 2.0 * 2.0**-8
    # A change that happens to be nothing leaves what the one before it would have become.
    passing = Convergence.of((np.array(1.0), np.array(0.0), np.array(0.0)), 2, 2.0, 1e-12)
    assert passing.error == pytest.approx(1.0 / 4 / 3)


def test_to_and_fro_is_not_extrapolated():
    seen = Convergence.of((np.array(1.0), np.array(0.0), np.array(0.25)), 2, 2.0, 1e-12)
    assert seen.seen
    assert not seen.aligned
    assert seen.rest == 0.0
    assert seen.safety == UNSURE
    assert "to and fro" in str(seen)


def test_errors_of_coarser_levels_grow_with_the_order_of_the_method():
    seen = Convergence.of(three(1.0, finest=4), 4, 2.0, 1e-12)
    assert seen.at(1) == pytest.approx(4 * seen.at(2))
    still = Convergence.of(three(1.0, finest=4), 4, 2.0, 1.0)
    assert still.used == 0
    assert still.seen
    assert still.at(2) == still.at(4)
    assert still.at(1) == pytest.approx(4 * still.at(2))
    assert "negligible" in str(still)


@pytest.mark.parametrize("changes", [(1.0, 1.0), (1.0, 0.8), (1.0, 3.0), (0.0, 1.0)])
def test_what_does_not_fall_is_not_seen(changes):
    values = np.cumsum([0.0, *changes])
    assert not Convergence.of(tuple(map(np.array, values)), 2, 2.0, 1e-12).seen


def manufactured(level, cells=(0.3, 2.0), steps=(0.1, 1.0), mixed=0.0):
    """7 and errors of cells and of steps, and of both together."""
    i, j = level
    h, dt = 2.0 ** -(cells[1] * i), 2.0 ** -(steps[1] * j)
    return 7.0 + (cells[0] * h + steps[0] * dt + mixed * h * dt) * SHAPE


def cross(base, **law):
    values = {level: manufactured(level, **law) for level in Cross.levels(base)}
    return Cross.of(values, base, (2.0, 2.0), 1e-12)


@pytest.mark.parametrize("base", [(0, 0), (2, 1)])
@pytest.mark.parametrize("mixed", [0.0, 0.05, -0.05])
def test_both_dials_together(base, mixed):
    one = cross(base, mixed=mixed)
    assert one.seen
    # Round-off of differences of numbers of size 20
    assert np.abs(one.limit - 7.0).max() < 1e-12
    for level in ((base[0] + 1, base[1] + 2), (base[0] + 0.5, base[1] + 1.7)):
        true = np.abs(manufactured(level, mixed=mixed) - 7.0).max()
        # Both have a whole order; the bound adds what may cancel.
        assert true <= one.error(*level) <= 2 * SURE * true + 2 * abs(mixed)


def test_dials_that_depend_on_each_other_are_not_seen():
    one = cross((0, 0), mixed=-0.25)
    assert one.cells.seen
    assert one.steps.seen
    assert not one.seen
    assert "together" in str(one)
    assert cross((3, 3), mixed=-0.25).seen  # where the product is small


def test_the_cost_of_a_run_is_recognised():
    law = Cost(0.05, 2e-5, 1e-6)
    steps, cells = (x.ravel() for x in np.meshgrid([10.0, 100, 1000], [4.0, 32, 256]))
    seconds = np.array([law.seconds(n, c) for n, c in zip(steps, cells, strict=True)])
    found = Cost.of(steps, cells, seconds)
    # Of least squares in double precision, conditioned by 1e5
    assert (found.begin, found.step, found.cell) == pytest.approx(
        (law.begin, law.step, law.cell), rel=1e-8
    )
    assert found.slower(3).seconds(50, 10) == pytest.approx(3 * law.seconds(50, 10), rel=1e-8)


def test_the_front_is_what_nothing_beats():
    rng = np.random.default_rng(0)
    seconds, errors = rng.random((2, 60)).round(2)  # with ties
    front = pareto(seconds, errors)
    for k in range(60):
        beaten = (seconds <= seconds[k]) & (errors <= errors[k])
        beaten &= (seconds < seconds[k]) | (errors < errors[k])
        if k in front:
            assert not beaten.any()
        else:
            same = [m for m in front if (seconds[m], errors[m]) == (seconds[k], errors[k])]
            assert beaten.any() or same
    assert list(seconds[front]) == sorted(seconds[front])
    assert math.isclose(errors[front[-1]], errors.min())
