# SPDX-License-Identifier: MIT
"""Orders, limits, errors, costs and fronts of manufactured runs, whose answers are known."""

import numpy as np
import pytest

from ufl_beam.analysis.richardson import (
    DOUBTED,
    TRUSTED,
    Convergence,
    SelfConvergence,
    pareto,
    size,
)

SHAPE = np.array([1.0, -2.0, 0.5])
"""Of the error of an array; its largest entry is 2."""


def three(order, *, first=0):
    """Values of limit 7 on three levels, `2**(-order * level)` from it."""
    return tuple(7.0 + 2.0 ** (-order * k) * SHAPE for k in range(first, first + 3))


@pytest.mark.parametrize(("order", "first"), [(0.6, 0), (1.0, 3), (1.5, 3), (2.0, 0)])
def test_a_power_is_recognised(order, first):
    seen = Convergence.estimate(three(order, first=first), first, 2.0)
    assert seen.seen
    assert seen.order == pytest.approx(order, abs=1e-9)
    # Whole orders are trusted, others get the larger factor.
    assert seen.trusted == (order in (1.0, 2.0))
    levels = first + np.array([0, 1.3, 2.0, 4.5])
    exact = np.outer(-(2.0 ** (-order * levels)), SHAPE)
    assert np.allclose(seen.remaining_error(levels), exact, rtol=1e-9)
    rest = 2.0 * 2.0 ** (-order * (first + 2))
    safety = TRUSTED if seen.trusted else DOUBTED
    assert seen.error_bound == pytest.approx((safety - 1) * rest)
    assert seen.bound_at(first) == seen.error_bound
    assert seen.bound_at(first + 3) == pytest.approx(seen.error_bound / 2**order)


def scalars(*values):
    return Convergence.estimate(tuple(map(np.array, values)), 0, 2.0)


def test_what_is_faster_than_the_method_is_not_believed():
    """From order 4 of a method of order 2 an error follows that is too large."""
    seen = Convergence.estimate(three(4.0), 0, 2.0)
    assert seen.order == pytest.approx(4.0)
    assert seen.used == 2.0
    assert size(seen.remaining_error(2)) + seen.error_bound > 2.0 * 2.0**-8
    # A change that happens to be nothing leaves what the one before it would have become.
    assert scalars(1.0, 0.0, 0.0).error_bound == pytest.approx(DOUBTED * 1.0 / 4 / 3)
    still = scalars(1.0, 1.0, 1.0)
    assert (still.seen, still.error_bound, still.remaining_error(0)) == (True, 0, 0)
    # To and fro is not trusted.
    seen = scalars(1.0, 0.0, 0.25)
    assert (seen.seen, seen.trusted) == (True, False)
    assert size(seen.remaining_error(2)) + seen.error_bound == pytest.approx(DOUBTED * 0.25 / 3)


@pytest.mark.parametrize("changes", [(1.0, 1.0), (1.0, 0.8), (1.0, 3.0), (0.0, 1.0)])
def test_what_does_not_fall_is_not_seen(changes):
    """What is irregular on three levels may be as large on all of them."""
    seen = scalars(*np.cumsum([0.0, *changes]))
    assert not seen.seen
    assert seen.error_bound == seen.bound_at(9) == DOUBTED * max(changes)
    assert seen.remaining_error(5) == 0


def cross(i, j, mixed=0.0):
    """7 and errors of cells and of steps, and of both together; the cross and its law."""

    def value(i, j):
        h, dt = 2.0 ** -(2.0 * i), 2.0**-j
        return 7.0 + (0.3 * h + 0.1 * dt + mixed * h * dt) * SHAPE

    along_cells = Convergence.estimate([value(i + k, j) for k in range(3)], i, 2.0)
    along_steps = Convergence.estimate([value(i, j + k) for k in range(3)], j, 2.0)
    return SelfConvergence.extrapolate(value(i, j), along_cells, along_steps), value


@pytest.mark.parametrize("base", [(0, 0), (2, 1)])
def test_errors_of_both_dials_add_up(base):
    one, value = cross(*base)
    assert np.abs(one.limit - 7.0).max() < 1e-12
    for i, j in ((base[0] + 1, base[1] + 2), (base[0] + 0.5, base[1] + 3.7)):
        left = one.cells.remaining_error(i) + one.steps.remaining_error(j)
        assert np.allclose(left, 7.0 - value(i, j), rtol=1e-9)
    # A finer run that was predicted leaves less doubt.
    finer = base[0] + 3, base[1] + 3
    assert one.confirmed(value(*finer), *finer).uncertainty < one.uncertainty


@pytest.mark.parametrize("mixed", [0.05, -0.25])
@pytest.mark.parametrize("finer", [(1, 1), (1.5, 1.3), (3, 3)])
def test_a_finer_run_shows_errors_that_depend_on_each_other(mixed, finer):
    one, value = cross(0, 0, mixed)
    confirmed = one.confirmed(value(*finer), *finer)
    assert size(confirmed.limit - 7.0) < size(one.limit - 7.0)
    assert size(confirmed.limit - 7.0) <= confirmed.uncertainty


def test_the_front_is_what_nothing_beats():
    """Every run is on the front, or one of the front is as good in both."""
    seconds, errors = np.random.default_rng(0).random((2, 60)).round(2)  # with ties
    front = pareto(seconds, errors)
    assert (np.diff(seconds[front]) > 0).all()
    assert (np.diff(errors[front]) < 0).all()
    for s, e in zip(seconds, errors, strict=True):
        assert ((seconds[front] <= s) & (errors[front] <= e)).any()
