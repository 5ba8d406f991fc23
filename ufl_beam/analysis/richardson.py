# SPDX-License-Identifier: MIT
"""Richardson extrapolation of runs on three levels: order, limit and uncertainty.

Level k of a dial is 2**k times as fine as level 0.  Richardson's extrapolation, with the safety
factors of Roache's grid convergence index (J. Fluids Eng. 116 (1994) 405).
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
import scipy  # its parts are loaded when they are used

from ufl_beam.arrays import Array
from ufl_beam.one_line import one_line

Level = tuple[int, int]  # of the cells and of the steps
LEAST_ORDER = 0.5  # differences that fall more slowly than with this power show no convergence
ORDER_TOLERANCE = 0.25  # an order so near to a whole one, up to that of the method, is trusted
SURE, UNSURE = 1.25, 3.0  # safety factors on errors by a trusted order, and on others
LEAST_COSINE = 0.5  # between successive changes; those that turn more are not extrapolated
MOST_MIXED = 0.5  # part of the errors of two dials that may depend on both


def size(values: Array) -> float:
    """Return the largest magnitude of an array; 0 if it is empty."""
    return float(np.abs(values).max(initial=0.0))


@dataclass(frozen=True)
class Convergence:
    """Convergence of a quantity with one dial, from three levels."""

    finest: int  # the finest of the three levels
    differences: tuple[float, float]  # sizes of the changes from level to level
    order: float  # observed
    aligned: bool  # whether both changes are of one direction; if not, nothing is extrapolated
    used: float  # order for predictions, at most that of the method; 0: no changes
    method: float  # order of the method; with it errors grow towards levels coarser than the three
    error: float  # of the finest level; where changes are negligible, of every level
    rest: Array  # what the finest level lacks of the limit, with its sign
    safety: float  # factor by which ``error`` may be wrong

    __repr__ = one_line

    @classmethod
    def of(
        cls, values: tuple[Array, Array, Array], finest: int, method: float, floor: float
    ) -> Convergence:
        """Judge values on three levels; ``method`` is the order in theory, ``floor`` negligible."""
        first, second = values[1] - values[0], values[2] - values[1]
        a, b = size(first), size(second)
        if max(a, b) <= floor:
            nothing = np.asarray(0 * second)
            return cls(finest, (a, b), 0.0, False, 0.0, method, max(a, b), nothing, UNSURE)
        order = math.log2(a / b) if min(a, b) > 0 else math.copysign(math.inf, a - b)
        lengths = np.linalg.norm(first) * np.linalg.norm(second)
        aligned = bool(np.vdot(first, second) >= LEAST_COSINE * lengths)
        used = min(max(order, LEAST_ORDER), method)
        # What fell faster than the method can explain may have passed through zero.
        error = max(b, a / 2**method) / (2**used - 1)
        whole = any(abs(order - k) <= ORDER_TOLERANCE for k in range(1, round(method) + 1))
        safety = SURE if aligned and whole else UNSURE
        rest = np.asarray(aligned * second / (2**used - 1))
        return cls(finest, (a, b), order, aligned, used, method, error, rest, safety)

    @property
    def seen(self) -> bool:
        """True if changes fall, or are negligible."""
        return self.used == 0 or self.order >= LEAST_ORDER

    def at(self, level: float) -> float:
        """Predict the error at a level, not necessarily whole, with its safety factor."""
        coarser = max(0.0, self.finest - 2 - level)
        growth = self.used * (self.finest - level - coarser) + self.method * coarser
        return self.safety * self.error * 2**growth

    def __str__(self) -> str:
        a, b = self.differences
        if self.used == 0:
            return f"changes by {max(a, b):.1e} at most: negligible"
        turns = "" if self.aligned else ", to and fro"
        return f"changes by {a:.1e}, then {b:.1e}: order {self.order:.2f}{turns}"


@dataclass(frozen=True)
class Cross:
    """Self-convergence of a quantity with cells and with steps, one by one and together."""

    cells: Convergence  # with the cells
    steps: Convergence  # with the steps
    limit: Array  # extrapolated value
    mixed: float  # what refining both changes that refining each does not, extrapolated

    __repr__ = one_line

    @staticmethod
    def levels(base: Level) -> list[Level]:
        """Return the levels of the runs that it takes, the cheap ones first."""
        i, j = base
        return [(i, j), (i + 1, j), (i, j + 1), (i + 1, j + 1), (i + 2, j), (i, j + 2)]

    @classmethod
    def of(
        cls, values: Mapping[Level, Array], base: Level, methods: tuple[float, float], floor: float
    ) -> Cross:
        """Judge the values at :meth:`levels`; ``methods`` are the orders in theory."""
        i, j = base
        q = values[base]
        cells = Convergence.of((q, values[i + 1, j], values[i + 2, j]), i + 2, methods[0], floor)
        steps = Convergence.of((q, values[i, j + 1], values[i, j + 2]), j + 2, methods[1], floor)
        mixed = values[i + 1, j + 1] - values[i + 1, j] - values[i, j + 1] + q
        parts = [1 - 2**-dial.used for dial in (cells, steps)]
        mixed = np.asarray(mixed / math.prod(parts) if all(parts) else 0 * q)
        limit = values[i + 2, j] + cells.rest + values[i, j + 2] + steps.rest - q + mixed
        return cls(cells, steps, limit, size(mixed))

    @property
    def separate(self) -> bool:
        """True if the errors of both dials add up."""
        i, j = self.cells.finest - 2, self.steps.finest - 2
        return self.mixed <= MOST_MIXED * (self.cells.at(i) + self.steps.at(j))

    @property
    def seen(self) -> bool:
        """True if self-convergence is seen."""
        return self.cells.seen and self.steps.seen and self.separate

    def error(self, i: float, j: float) -> float:
        """Bound the error at levels that need not be whole; unit of the quantity."""
        fallen = self.cells.used * (i - self.cells.finest + 2)
        fallen += self.steps.used * (j - self.steps.finest + 2)
        return self.cells.at(i) + self.steps.at(j) + self.mixed * 2**-fallen

    @property
    def uncertainty(self) -> float:
        """Uncertainty of the limit; unit of the quantity."""
        return self.error(self.cells.finest, self.steps.finest) + self.mixed / 4

    def __str__(self) -> str:
        together = "" if self.separate else f"\n    together: {self.mixed:.1e} more than one by one"
        return f"\n    cells: {self.cells}\n    steps: {self.steps}{together}"


@dataclass(frozen=True)
class Cost:
    """Wall time of a run: ``begin + steps (step + cell cells)``; s."""

    begin: float
    step: float
    cell: float

    @classmethod
    def of(cls, steps: Array, cells: Array, seconds: Array) -> Cost:
        """Fit to runs, relative differences by least squares; no coefficient is negative."""
        rows = np.stack([np.ones_like(steps), steps, steps * cells], axis=1)
        return cls(*scipy.optimize.nnls(rows / seconds[:, None], np.ones_like(seconds))[0].tolist())

    def slower(self, factor: float) -> Cost:
        """Return the cost on a machine that is so many times as slow."""
        return Cost(factor * self.begin, factor * self.step, factor * self.cell)

    def seconds(self, steps: float, cells: float) -> float:
        """Predict the wall time of a run; s."""
        return self.begin + steps * (self.step + self.cell * cells)


def pareto(seconds: Array, errors: Array) -> list[int]:
    """Find the runs that no other one beats in time and error, the fastest first."""
    front: list[int] = []
    for k in np.lexsort((errors, seconds)):
        if not front or errors[k] < errors[front[-1]]:
            front.append(int(k))
    return front
