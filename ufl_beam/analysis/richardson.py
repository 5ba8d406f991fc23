# SPDX-License-Identifier: MIT
"""Richardson extrapolation of runs on two or three levels: order, limit and uncertainty.

Level k of a dial is 2**k times as fine as level 0.  The uncertainty is that of Roache's grid
convergence index (J. Fluids Eng. 116 (1994) 405).
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
import numpy.typing as npt
import scipy  # its parts are loaded when they are used

from ufl_beam.arrays import Array
from ufl_beam.display import one_line

# Roache's safety factors on the error of the finest level: if the observed order is that of a
# theory, and if it is not, or not known since there are two levels only
TRUSTED, DOUBTED = 1.25, 3.0
# Half of the lowest order that a scheme can have: at this one, the changes to come are together
# 2.4 times the last one, and no limit follows from it.
LEAST_ORDER = 0.5


def size(values: Array) -> float:
    """Return the largest magnitude of an array; 0 if it is empty."""
    return float(np.abs(values).max(initial=0.0))


@dataclass(frozen=True, eq=False)
class Convergence:
    """Convergence of a quantity with one dial, from two or three successive levels."""

    coarsest: int  # the coarsest level
    changes: tuple[float, ...]  # sizes of the changes from level to level; unit of the quantity
    method: float  # order in theory
    order: float  # observed; NaN from two levels, where that in theory is taken
    used: float  # order for predictions, at most that in theory
    trusted: bool  # whether the changes are those of a whole order, up to that in theory
    lacks: Array  # what each level and the limit lack of the limit, with sign; (levels + 1, ...)
    doubt: float  # by how much the limit may be wrong; unit of the quantity

    __repr__ = one_line

    @classmethod
    def of(cls, values: Sequence[Array], coarsest: int, method: float) -> Convergence:
        """Judge values on two or three levels."""
        changes = np.diff(np.stack(values), axis=0)
        sizes = tuple(map(size, changes))
        first, last = sizes[0], sizes[-1]
        order, trusted, most = math.nan, False, last
        if len(values) > 2:
            order = math.log2(first / last) if min(sizes) > 0 else math.copysign(9, first - last)
            # A factor of 1.25 covers a change that is wrong by a quarter.
            trusted = first > 0 and any(
                size(changes[1] * 2**k - changes[0]) <= (TRUSTED - 1) * first
                for k in range(1, round(method) + 1)
            )
            # What fell faster than the method can explain may have passed through zero.
            most = max(last, first / 2**method)
        used = method if math.isnan(order) else min(max(order, LEAST_ORDER), method)
        rest, doubt = changes[-1] * 0.0, DOUBTED * max(sizes)  # irregular: as large on all levels
        if not order < LEAST_ORDER:
            rest = changes[-1] / (2**used - 1)
            doubt = (TRUSTED if trusted else DOUBTED) * most / (2**used - 1) - size(rest)
        lacks = np.stack([*(values[-1] + rest - value for value in values), 0.0 * rest])
        return cls(coarsest, sizes, method, order, used, trusted, lacks, doubt)

    @property
    def seen(self) -> bool:
        """True if changes fall, or a third level is missing."""
        return not self.order < LEAST_ORDER

    @property
    def finest(self) -> int:
        """The finest of the levels that were run."""
        return self.coarsest + len(self.changes)

    def lack(self, level: npt.ArrayLike) -> Array:
        """Predict what levels, not necessarily whole, lack of the limit; (*level.shape, ...).

        It is linear in the power of the fineness between the levels that were run, and the limit.
        """
        levels = np.append(np.arange(len(self.changes), -1.0, -1.0), 0.0)
        s = np.append(0.0, 2.0 ** (-self.used * levels[:-1]))
        of_power = scipy.interpolate.make_interp_spline(s, self.lacks[::-1], k=1)
        return np.asarray(of_power(2.0 ** (-self.used * (np.asarray(level) - self.coarsest))))

    def unsure(self, level: float) -> float:
        """Bound the error of the limit that follows from a run on a level; unit of the quantity.

        It falls beyond the finest level; irregular changes are as large on all levels.
        """
        finer = max(0.0, level - self.finest) if self.seen else 0.0
        return float(self.doubt * 2 ** (-self.used * finer))

    def __str__(self) -> str:
        changes = ", then ".join(f"{change:.1e}" for change in self.changes)
        if math.isnan(self.order):
            return f"changes by {changes}: order {self.method:g} in theory"
        return f"changes by {changes}: order {self.order:.2f}"


@dataclass(frozen=True, eq=False)
class Cross:
    """Self-convergence of a quantity with cells and with steps."""

    cells: Convergence  # with the cells
    steps: Convergence  # with the steps
    limit: Array  # extrapolated value
    uncertainty: float  # of the limit; unit of the quantity

    __repr__ = one_line

    @classmethod
    def of(cls, value: Array, cells: Convergence, steps: Convergence) -> Cross:
        """Extrapolate from the coarsest run: both errors add up."""
        limit = np.asarray(value + cells.lacks[0] + steps.lacks[0])
        return cls(cells, steps, limit, cells.doubt + steps.doubt)

    def lack(self, i: float, j: float) -> Array:
        """Predict what a run with some levels lacks of the limit; unit of the quantity."""
        return self.cells.lack(i) + self.steps.lack(j)

    def confirmed(self, value: Array, i: float, j: float) -> Cross:
        """Return it with the limit that follows from a run in which both dials are finer.

        The limit moves by what errors of cells and steps depend on each other.  An error in
        proportion to the product of both, as a part c of it for cells that are left and a part s
        for steps, moves it by a part (1 - c) (1 - s), and leaves the rest in doubt.
        """
        limit = np.asarray(value + self.lack(i, j))
        c, s = (
            2.0 ** (-dial.used * (level - dial.coarsest))
            for dial, level in ((self.cells, i), (self.steps, j))
        )
        moved = size(limit - self.limit)
        doubt = self.cells.unsure(i) + self.steps.unsure(j) + moved / ((1 - c) * (1 - s)) - moved
        return replace(self, limit=limit, uncertainty=doubt)

    def __str__(self) -> str:
        return f"\n    cells: {self.cells}\n    steps: {self.steps}"


def fit_cost(steps: Array, cells: Array, seconds: Array) -> Array:
    """Fit wall times (s) of runs by ``a + b cells + steps (c + d cells)``; none is negative."""
    columns = np.stack([np.ones_like(steps), cells, steps, steps * cells], axis=1)
    return np.asarray(scipy.optimize.nnls(columns / seconds[:, None], np.ones_like(seconds))[0])


def pareto(seconds: Array, errors: Array) -> list[int]:
    """Find the runs that no other one beats in time and error, the fastest first."""
    front: list[int] = []
    for k in np.lexsort((errors, seconds)):
        if not front or errors[k] < errors[front[-1]]:
            front.append(int(k))
    return front
