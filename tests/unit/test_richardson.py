# SPDX-License-Identifier: MIT
"""Orders, limits, errors, costs and fronts of manufactured runs, whose answers are known."""

import math
from dataclasses import astuple, replace

import numpy as np
import pytest

from ufl_beam.analysis.richardson import (
    SURE,
    UNSURE,
    Convergence,
    Cost,
    Cross,
    pareto,
    size,
)

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
    assert seen.trusted == (order in (1.0, 2.0))
    safety = SURE if seen.trusted else UNSURE
    assert np.abs(three(order, finest=finest)[2] + seen.rest - 7.0).max() < 1e-12
    for level in (finest - 2, finest - 0.5, finest):
        true = -(2.0 ** (-order * level)) * SHAPE
        assert np.allclose(seen.lack(level), true, rtol=1e-9)
        # Of coarser levels the changes to the finest are known.
        doubt = (safety - 1) * 2.0 * 2.0 ** (-order * finest)
        assert seen.at(level) == pytest.approx(size(true) + doubt, rel=1e-9)
    # Levels finer than all: by the order that was seen, or by that in theory if it is not whole
    used = order if seen.trusted else 2.0
    finer = safety * 2.0 * 2.0 ** (-order * finest - used)
    assert seen.at(finest + 1) == pytest.approx(finer, rel=1e-9)


def test_two_levels_have_the_order_of_the_method():
    first, second = three(4.0)[:2]
    seen = Convergence.of((first, second), 1, 4.0, 1e-12)
    assert seen.seen
    assert math.isnan(seen.order)
    assert not seen.trusted
    assert np.abs(second + seen.rest - 7.0).max() < 1e-12
    assert seen.doubt == pytest.approx((UNSURE - 1) * size(seen.rest))
    assert "in theory" in str(seen)


def test_what_is_faster_than_the_method_is_not_believed():
    """From order 4 of a method of order 2 an error follows that is too large."""
    seen = Convergence.of(three(4.0), 2, 2.0, 1e-12)
    assert seen.order == pytest.approx(4.0)
    assert seen.used == 2.0
    assert seen.at(2) > 2.0 * 2.0**-8
    # A change that happens to be nothing leaves what the one before it would have become.
    passing = Convergence.of((np.array(1.0), np.array(0.0), np.array(0.0)), 2, 2.0, 1e-12)
    assert passing.at(2) == pytest.approx(UNSURE * 1.0 / 4 / 3)


def test_to_and_fro_is_not_trusted():
    seen = Convergence.of((np.array(1.0), np.array(0.0), np.array(0.25)), 2, 2.0, 1e-12)
    assert seen.seen
    assert not seen.aligned
    assert not seen.trusted
    assert seen.at(2) == pytest.approx(UNSURE * 0.25 / 3)
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


def cross(base, *, whole=True, **law):
    values = {level: manufactured(level, **law) for level in Cross.levels(base, whole=whole)}
    return Cross.of(values, base, (2.0, 2.0), 1e-12)


@pytest.mark.parametrize("base", [(0, 0), (2, 1)])
@pytest.mark.parametrize("mixed", [0.0, 0.05, -0.05])
def test_both_dials_together(base, mixed):
    one = cross(base, mixed=mixed)
    assert one.seen
    # Round-off of differences of numbers of size 20
    assert np.abs(one.limit - 7.0).max() < 1e-12
    for level in ((base[0] + 1, base[1] + 2), (base[0] + 0.5, base[1] + 1.7)):
        true = 7.0 - manufactured(level, mixed=mixed)
        assert np.allclose(one.lack(*level), true, rtol=1e-9)
        # Both have a whole order; the bound adds what may cancel.
        assert one.error(*level) <= 2 * SURE * size(true) + 2 * abs(mixed)


def test_half_a_cross_has_the_limit_of_theory():
    one = cross((1, 2), whole=False, steps=(0.1, 2.0))
    assert one.seen
    assert np.abs(one.limit - 7.0).max() < 1e-12


def test_a_finer_run_sharpens_a_limit():
    """Both dials are of the same order, so that the part of the error that is left is known."""
    law = {"cells": (0.3, 1.0), "steps": (0.1, 1.0)}
    one = cross((0, 0), **law)
    coarse, fine = (2.5, 3.0), (3.5, 4.0)
    values = [manufactured(level, **law) for level in (coarse, fine)]
    off = replace(one, limit=one.limit + 1.0)
    sharp = off.sharpened(*values, coarse, fine)
    assert np.abs(sharp.limit - 7.0).max() < 1e-12
    # The prediction of the change was right.
    assert sharp.uncertainty == pytest.approx((SURE - 1) * size(values[1] - 7.0))
    # A change that was not predicted is in doubt as a whole.
    noise = 0.01 * SHAPE
    doubtful = off.sharpened(values[0], values[1] + noise, coarse, fine)
    assert doubtful.uncertainty >= size(noise)


@pytest.mark.parametrize("order", [1.0, 1.5, 2.0])
def test_a_finer_run_bounds_the_limit_of_an_order_that_is_not_known(order):
    """Two levels of steps, which do not show that their order may be half of that in theory."""
    law = {"cells": (0.0, 2.0), "steps": (0.1, order)}
    one = cross((0, 0), whole=False, **law)
    for first, finer in [(0.0, 0.5), (0.0, 1.0), (0.0, 2.0), (0.5, 1.5), (1.0, 1.5), (1.0, 2.0)]:
        coarse, fine = (0.0, first), (0.0, finer)
        sharp = one.sharpened(*(manufactured(at, **law) for at in (coarse, fine)), coarse, fine)
        assert np.abs(sharp.limit - 7.0).max() <= sharp.uncertainty


def test_a_finer_run_does_not_sharpen_what_is_negligible():
    """Changes below the floor have no order: no part of them is known to be left."""
    law = {"cells": (0.0, 2.0), "steps": (1e-14, 2.0)}
    one = cross((0, 0), **law)
    assert one.cells.used == one.steps.used == 0 and one.error(0, 0) > 0
    for fine in ((0.0, 1.0), (1.0, 1.0)):
        values = [manufactured(at, **law) for at in ((0.0, 0.0), fine)]
        assert one.sharpened(*values, (0.0, 0.0), fine) is one
    still = cross((0, 0), cells=(0.0, 2.0), steps=(0.0, 2.0))  # and no error at all
    assert still.error(0, 0) == 0
    assert still.sharpened(values[0], values[0], (0.0, 0.0), (1.0, 1.0)) is still


def test_dials_that_depend_on_each_other_are_not_seen():
    one = cross((0, 0), mixed=-0.25)
    assert one.cells.seen
    assert one.steps.seen
    assert not one.seen
    assert "together" in str(one)
    assert cross((3, 3), mixed=-0.25).seen  # where the product is small


def test_the_cost_of_a_run_is_recognised():
    law = Cost(0.05, 1e-4, 2e-5, 1e-6)
    steps, cells = (x.ravel() for x in np.meshgrid([10.0, 100, 1000], [4.0, 32, 256]))
    stepping = law.stepping(steps, cells)
    building = law.seconds(steps, cells) - stepping
    found = Cost.of(steps, cells, building, stepping)
    # Of least squares in double precision, conditioned by 1e5
    assert astuple(found) == pytest.approx(astuple(law), rel=1e-8)
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
