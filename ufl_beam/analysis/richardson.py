# SPDX-License-Identifier: MIT
"""Richardson extrapolation of runs on two or three levels: order, limit and uncertainty.

On level k the number of cells or steps is 2**k times the number on level 0.  The uncertainty is
Roache's grid convergence index (J. Fluids Eng. 116 (1994) 405).
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
import numpy.typing as npt
import scipy  # imports its modules when they are used

from ufl_beam.arrays import Array
from ufl_beam.display import compact_repr

# Roache's safety factors on the error of the finest level: TRUSTED if the changes fit an integer
# order up to the order in theory; DOUBTED otherwise, or if there are only two levels.
TRUSTED, DOUBTED = 1.25, 3.0
# Half of the lowest order of a scheme.  At this order the sum of the changes on all finer levels is
# 2.4 times the last change, which is too large for an extrapolation.
LEAST_ORDER = 0.5


def size(values: Array) -> float:
    """Return the largest magnitude of an array; 0 if it is empty."""
    return float(np.abs(values).max(initial=0.0))


@dataclass(frozen=True, eq=False)
class Convergence:
    """Convergence of a quantity with refined cells or steps, from two or three levels."""

    coarsest: int  # number of the coarsest level
    changes: tuple[float, ...]  # sizes of the changes from level to level; unit of the quantity
    method: float  # order in theory
    order: float  # observed order; NaN if there are only two levels
    used: float  # order for predictions: ``order`` limited to [LEAST_ORDER, method], or ``method``
    trusted: bool  # whether the changes fit an integer order, at most the order in theory
    remaining_errors: (
        Array  # limit minus value on each level, then zero for the limit; (levels + 1, ...)
    )
    error_bound: float  # bound of the error of the limit; unit of the quantity

    __repr__ = compact_repr

    @classmethod
    def estimate(cls, values: Sequence[Array], coarsest: int, method: float) -> Convergence:
        """Estimate the convergence of values on two or three levels, the coarsest first."""
        changes = np.diff(np.stack(values), axis=0)
        sizes = tuple(map(size, changes))
        first, last = sizes[0], sizes[-1]
        order, trusted, most = math.nan, False, last
        if len(values) > 2:
            order = math.log2(first / last) if min(sizes) > 0 else math.copysign(9, first - last)
            # A safety factor of 1.25 allows changes to deviate from an integer order by a quarter.
            trusted = first > 0 and any(
                size(changes[1] * 2**k - changes[0]) <= (TRUSTED - 1) * first
                for k in range(1, round(method) + 1)
            )
            # A change that fell faster than the order in theory may be near a change of sign.
            most = max(last, first / 2**method)
        used = method if math.isnan(order) else min(max(order, LEAST_ORDER), method)
        rest, bound = changes[-1] * 0.0, DOUBTED * max(sizes)  # if changes are irregular
        if not order < LEAST_ORDER:
            rest = changes[-1] / (2**used - 1)
            bound = (TRUSTED if trusted else DOUBTED) * most / (2**used - 1) - size(rest)
        remaining_errors = np.stack([*(values[-1] + rest - value for value in values), 0.0 * rest])
        return cls(coarsest, sizes, method, order, used, trusted, remaining_errors, bound)

    @property
    def seen(self) -> bool:
        """True if the observed order is at least LEAST_ORDER, or unknown."""
        return not self.order < LEAST_ORDER

    @property
    def finest(self) -> int:
        """Number of the finest level of the runs."""
        return self.coarsest + len(self.changes)

    def remaining_error(self, level: npt.ArrayLike) -> Array:
        """Predict the limit minus the value on whole or fractional levels; (*level.shape, ...).

        The result is linear, between levels, in the size of cells or steps to the power ``used``.
        """
        s = np.append(0.0, self.fraction(np.arange(self.finest, self.coarsest - 1.0, -1.0)))
        spline = scipy.interpolate.make_interp_spline(s, self.remaining_errors[::-1], k=1)
        return np.asarray(spline(self.fraction(level)))

    def fraction(self, level: npt.ArrayLike) -> Array:
        """Predict the error on a level as a fraction of the error on the coarsest level."""
        return np.asarray(2.0 ** (-self.used * (np.asarray(level) - self.coarsest)))

    def bound_at(self, level: float) -> float:
        """Bound the error of the limit extrapolated from a run on a level; unit of the quantity.

        Beyond the finest level the bound falls, except for irregular changes, which are assumed
        equal on all levels.
        """
        finer = max(0.0, level - self.finest) if self.seen else 0.0
        return float(self.error_bound * 2 ** (-self.used * finer))

    def __str__(self) -> str:
        changes = ", then ".join(f"{change:.1e}" for change in self.changes)
        if math.isnan(self.order):
            return f"changes by {changes}: order {self.method:g} in theory"
        return f"changes by {changes}: order {self.order:.2f}"


@dataclass(frozen=True, eq=False)
class SelfConvergence:
    """Self-convergence of a quantity with refined cells and with refined steps."""

    cells: Convergence  # with refined cells
    steps: Convergence  # with refined steps
    limit: Array  # extrapolated value
    uncertainty: float  # uncertainty of the limit; unit of the quantity

    __repr__ = compact_repr

    @classmethod
    def extrapolate(cls, value: Array, cells: Convergence, steps: Convergence) -> SelfConvergence:
        """Extrapolate from the coarsest run, with the sum of the errors of cells and steps."""
        limit = np.asarray(value + cells.remaining_errors[0] + steps.remaining_errors[0])
        return cls(cells, steps, limit, cells.error_bound + steps.error_bound)

    def confirmed(self, value: Array, i: float, j: float) -> SelfConvergence:
        """Return a copy with the limit extrapolated from a run with finer cells and finer steps.

        The limit changes because the error has a term proportional to the product of the errors of
        cells and steps.  Let the finer run have the fractions c and s of these errors.  Then the
        limit changes by the fraction (1 - c) (1 - s) of the term, and the rest of the term is
        uncertain.
        """
        limit = np.asarray(value + self.cells.remaining_error(i) + self.steps.remaining_error(j))
        moved = size(limit - self.limit)
        part = (1 - self.cells.fraction(i)) * (1 - self.steps.fraction(j))
        bound = self.cells.bound_at(i) + self.steps.bound_at(j) + moved / float(part) - moved
        return replace(self, limit=limit, uncertainty=bound)

    def __str__(self) -> str:
        return f"\n    cells: {self.cells}\n    steps: {self.steps}"


def fit_cost(steps: Array, cells: Array, seconds: Array) -> Array:
    """Fit ``a + b cells + steps (c + d cells)`` to wall times (s); coefficients are ≥ 0; (4,)."""
    columns = np.stack([np.ones_like(steps), cells, steps, steps * cells], axis=1)
    return np.asarray(scipy.optimize.nnls(columns / seconds[:, None], np.ones_like(seconds))[0])


def pareto(seconds: Array, errors: Array) -> list[int]:
    """Find indices of runs that no other run beats in time and error, the fastest run first."""
    order = np.lexsort((errors, seconds))
    least = np.minimum.accumulate(errors[order])
    better = np.append(True, least[1:] < least[:-1])
    return [int(k) for k in order[better]]
