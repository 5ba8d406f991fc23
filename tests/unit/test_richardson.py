# SPDX-License-Identifier: MIT
"""Orders, limits, errors, costs and fronts of manufactured runs, whose answers are known."""

import math

import numpy as np
import pytest

from ufl_beam.analysis.richardson import (
    DOUBTED,
    TRUSTED,
    Convergence,
    SelfConvergence,
    fit_cost,
    pareto,
    size,
)

SHAPE = np.array([1.0, -2.0, 0.5])
"""Of the error of an array; its largest entry is 2."""


def three(order, *, first=0, shape=SHAPE):
    """Values of limit 7 on three levels, `2**(-order * level)` from it."""
    return tuple(7.0 + 2.0 ** (-order * k) * shape for k in range(first, first + 3))


@pytest.mark.parametrize("order", [0.6, 1.0, 1.5, 2.0])
@pytest.mark.parametrize("first", [0, 3])
def test_a_power_is_recognised(order, first):
    seen = Convergence.estimate(three(order, first=first), first, 2.0)
    assert seen.seen
    assert seen.order == pytest.approx(order, abs=1e-9)
    # Whole orders are trusted, others get the larger factor.
    assert seen.trusted == (order in (1.0, 2.0))
    for level in (first, first + 1.3, first + 2, first + 4.5):
        assert np.allclose(
            seen.remaining_error(level), -(2.0 ** (-order * level)) * SHAPE, rtol=1e-9
        )
    levels = np.array([first, first + 2.0])
    assert np.allclose(seen.remaining_error(levels), np.outer(-(2.0 ** (-order * levels)), SHAPE))
    rest = 2.0 * 2.0 ** (-order * (first + 2))
    safety = TRUSTED if seen.trusted else DOUBTED
    assert seen.error_bound == pytest.approx((safety - 1) * rest)
    assert seen.bound_at(first) == seen.error_bound
    assert seen.bound_at(first + 3) == pytest.approx(seen.error_bound / 2**order)


def test_two_levels_have_the_order_of_the_method():
    first, second, _ = three(4.0)
    seen = Convergence.estimate((first, second), 0, 4.0)
    assert seen.seen
    assert math.isnan(seen.order)
    assert not seen.trusted
    assert np.abs(second + seen.remaining_error(1) - 7.0).max() < 1e-12
    assert seen.error_bound == pytest.approx((DOUBTED - 1) * size(second - 7.0))
    assert "in theory" in str(seen)


def test_what_is_faster_than_the_method_is_not_believed():
    """From order 4 of a method of order 2 an error follows that is too large."""
    seen = Convergence.estimate(three(4.0), 0, 2.0)
    assert seen.order == pytest.approx(4.0)
    assert seen.used == 2.0
    assert size(seen.remaining_error(2)) + seen.error_bound > 2.0 * 2.0**-8
    # A change that happens to be nothing leaves what the one before it would have become.
    passing = Convergence.estimate((np.array(1.0), np.array(0.0), np.array(0.0)), 0, 2.0)
    assert passing.error_bound == pytest.approx(DOUBTED * 1.0 / 4 / 3)


def test_to_and_fro_is_not_trusted():
    seen = Convergence.estimate((np.array(1.0), np.array(0.0), np.array(0.25)), 0, 2.0)
    assert seen.seen
    assert not seen.trusted
    assert size(seen.remaining_error(2)) + seen.error_bound == pytest.approx(DOUBTED * 0.25 / 3)


@pytest.mark.parametrize("changes", [(1.0, 1.0), (1.0, 0.8), (1.0, 3.0), (0.0, 1.0)])
def test_what_does_not_fall_is_not_seen(changes):
    """What is irregular on three levels may be as large on all of them."""
    values = tuple(map(np.array, np.cumsum([0.0, *changes])))
    seen = Convergence.estimate(values, 0, 2.0)
    assert not seen.seen
    assert seen.error_bound == seen.bound_at(9) == DOUBTED * max(changes)
    assert seen.remaining_error(5) == 0


def test_what_does_not_change_has_no_error():
    still = Convergence.estimate((np.array(1.0),) * 3, 0, 2.0)
    assert still.seen
    assert (still.error_bound, still.remaining_error(0)) == (0, 0)


def cross(base, *, cells=(0.3, 2.0), steps=(0.1, 1.0), mixed=0.0):
    """7 and errors of cells and of steps, and of both together; the cross and its law."""

    def value(i, j):
        h, dt = 2.0 ** -(cells[1] * i), 2.0 ** -(steps[1] * j)
        return 7.0 + (cells[0] * h + steps[0] * dt + mixed * h * dt) * SHAPE

    i, j = base
    along_cells = Convergence.estimate([value(i + k, j) for k in range(3)], i, 2.0)
    along_steps = Convergence.estimate([value(i, j + k) for k in range(3)], j, 2.0)
    return SelfConvergence.extrapolate(value(i, j), along_cells, along_steps), value


@pytest.mark.parametrize("base", [(0, 0), (2, 1)])
def test_errors_of_both_dials_add_up(base):
    one, value = cross(base)
    assert np.abs(one.limit - 7.0).max() < 1e-12
    for i, j in ((base[0] + 1, base[1] + 2), (base[0] + 0.5, base[1] + 3.7)):
        assert np.allclose(
            one.cells.remaining_error(i) + one.steps.remaining_error(j),
            7.0 - value(i, j),
            rtol=1e-9,
        )


@pytest.mark.parametrize("mixed", [0.05, -0.05, -0.25])
@pytest.mark.parametrize("finer", [(1, 1), (1.5, 1.3), (2, 2), (3, 3)])
def test_a_finer_run_shows_errors_that_depend_on_each_other(mixed, finer):
    one, value = cross((0, 0), mixed=mixed)
    confirmed = one.confirmed(value(*finer), *finer)
    assert size(confirmed.limit - 7.0) < size(one.limit - 7.0)
    assert size(confirmed.limit - 7.0) <= confirmed.uncertainty


def test_a_finer_run_that_was_predicted_leaves_less_doubt():
    one, value = cross((0, 0))
    assert one.confirmed(value(3, 3), 3, 3).uncertainty < one.uncertainty


def test_the_cost_of_a_run_is_recognised():
    law = (0.05, 1e-4, 2e-5, 1e-6)
    steps, cells = (x.ravel() for x in np.meshgrid([10.0, 100, 1000], [4.0, 32, 256]))
    seconds = law[0] + law[1] * cells + steps * (law[2] + law[3] * cells)
    # Of least squares in double precision, conditioned by 1e5
    assert fit_cost(steps, cells, seconds) == pytest.approx(law, rel=1e-8)


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
