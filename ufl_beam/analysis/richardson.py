# SPDX-License-Identifier: MIT
"""Richardson extrapolation of runs on two or three levels: order, limit and uncertainty.

Level k of a dial is 2**k times as fine as level 0.  Richardson's extrapolation, with the safety
factors of Roache's grid convergence index (J. Fluids Eng. 116 (1994) 405).
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import TypeVar

import numpy as np
import scipy  # its parts are loaded when they are used

from ufl_beam.arrays import Array
from ufl_beam.display import one_line

Numbers = TypeVar("Numbers", float, Array)
Level = tuple[int, int]  # of the cells and of the steps
Fineness = tuple[float, float]  # the same, not necessarily whole
FASTEST = 1 / 16  # part of an error that finer cells and steps leave at least
SLOWEST = 0.5  # part of the order of the method with which errors fall at least, if it is not seen
LEAST_ORDER = 0.5  # differences that fall more slowly than with this power show no convergence
ORDER_TOLERANCE = 0.25  # an order so near to a whole one, up to that of the method, is trusted
SURE, UNSURE = 1.25, 2.0  # safety factors on errors by a trusted order, and on others
LEAST_COSINE = 0.5  # between successive changes; those that turn more are of no trusted order
MOST_MIXED = 0.5  # part of the errors of two dials that may depend on both


def size(values: Array) -> float:
    """Return the largest magnitude of an array; 0 if it is empty."""
    return float(np.abs(values).max(initial=0.0))


@dataclass(frozen=True)
class Convergence:
    """Convergence of a quantity with one dial, from two or three levels."""

    finest: int  # the finest of the levels
    differences: tuple[float, ...]  # sizes of the changes from level to level
    order: float  # observed; NaN from two levels, where that of the method is taken
    aligned: bool  # whether the changes are of one direction
    trusted: bool  # whether they fall with a whole order; else finer levels are of that in theory
    used: float  # order for predictions, at most that of the method; 0: no changes
    method: float  # order of the method; with it errors grow towards levels coarser than all
    rest: Array  # what the finest level lacks of the limit, with its sign
    doubt: float  # by how much ``rest`` may be wrong; its unit

    __repr__ = one_line

    @classmethod
    def of(cls, values: Sequence[Array], finest: int, method: float, floor: float) -> Convergence:
        """Judge values on two or three levels.

        ``method`` is the order in theory, changes up to ``floor`` are negligible.
        """
        changes = np.diff(np.stack(values), axis=0)
        sizes = tuple(map(size, changes))
        last = np.asarray(changes[-1])
        if max(sizes) <= floor:
            doubt = UNSURE * max(sizes)
            return cls(finest, sizes, math.nan, False, True, 0.0, method, 0 * last, doubt)
        if len(sizes) == 1:
            rest = last / (2**method - 1)
            doubt = (UNSURE - 1) * size(rest)
            return cls(finest, sizes, math.nan, True, False, method, method, rest, doubt)
        a, b = sizes
        order = math.log2(a / b) if min(a, b) > 0 else math.copysign(math.inf, a - b)
        lengths = math.prod(np.linalg.norm(change) for change in changes)
        aligned = bool(np.vdot(*changes) >= LEAST_COSINE * lengths)
        used = min(max(order, LEAST_ORDER), method)
        rest = last / (2**used - 1)
        # What fell faster than the method can explain may have passed through zero.
        most = max(b, a / 2**method) / (2**used - 1)
        whole = any(abs(order - k) <= ORDER_TOLERANCE for k in range(1, round(method) + 1))
        trusted = aligned and whole
        doubt = (SURE if trusted else UNSURE) * most - size(rest)
        return cls(finest, sizes, order, aligned, trusted, used, method, rest, doubt)

    def confirmed(self) -> Convergence:
        """Return it with the doubts of a trusted order."""
        return replace(self, doubt=min(self.doubt, (SURE - 1) * size(self.rest)))

    @property
    def coarsest(self) -> int:
        """The coarsest of the levels."""
        return self.finest - len(self.differences)

    def slowest(self, levels: float) -> float:
        """Return the part of an error that so many finer levels leave at most.

        Where orders are not trusted, errors may fall with half of the order of the method.
        """
        order = self.used if self.trusted else SLOWEST * self.method
        return float(2 ** -(order * levels))

    @property
    def unsettled(self) -> float:
        """Uncertainty of the limit; unit of the quantity."""
        if not (self.used > 0 and math.isnan(self.order)):
            return self.doubt
        slow = self.slowest(1.0)
        return self.differences[0] * slow / (1 - slow) - size(self.rest)

    @property
    def seen(self) -> bool:
        """True if changes fall or are negligible, or a third level is missing."""
        return not self.order < LEAST_ORDER

    def growth(self, level: float) -> float:
        """Predict the error at a level, not necessarily whole, over that of the finest."""
        inside = self._seen(level)
        fallen = self.used * (self.finest - inside) + self.method * (inside - min(inside, level))
        finer = self.used if self.trusted else self.method
        return float(2 ** (fallen - finer * (max(inside, level) - inside)))

    def lack(self, level: float) -> Array:
        """Predict what a level lacks of the limit, with its sign; unit of the quantity."""
        return self.rest * self.growth(level)

    def unsure(self, level: float) -> float:
        """Bound the error of :meth:`lack`: changes that were seen are known."""
        return self.doubt * (self.growth(level) / self.growth(self._seen(level)))

    def _seen(self, level: float) -> float:
        return min(max(level, self.coarsest), self.finest)

    def at(self, level: float) -> float:
        """Bound the error at a level; unit of the quantity."""
        return size(self.lack(level)) + self.unsure(level)

    def half_sure(self, level: float) -> float:
        """Predict the error at a level with half of the doubt; unit of the quantity."""
        return size(self.lack(level)) + self.unsure(level) / 2

    def __str__(self) -> str:
        if self.used == 0:
            return f"changes by {max(self.differences):.1e} at most: negligible"
        changes = ", then ".join(f"{change:.1e}" for change in self.differences)
        if math.isnan(self.order):
            return f"changes by {changes}: order {self.method:g} in theory"
        turns = "" if self.aligned else ", to and fro"
        return f"changes by {changes}: order {self.order:.2f}{turns}"


@dataclass(frozen=True)
class Cross:
    """Self-convergence of a quantity with cells and with steps, one by one and together."""

    cells: Convergence  # with the cells
    steps: Convergence  # with the steps
    limit: Array  # extrapolated value
    mixed: Array  # what refining both changes that refining each does not, extrapolated
    uncertainty: float  # of the limit; unit of the quantity

    __repr__ = one_line

    @staticmethod
    def levels(base: Level, *, whole: bool) -> list[Level]:
        """Return the levels of the runs that it takes, the cheap ones first.

        Two levels of each dial, or, for the ``whole`` cross, three and one of both together.
        """
        i, j = base
        first = [(i, j), (i + 1, j), (i, j + 1)]
        return [*first, (i + 1, j + 1), (i + 2, j), (i, j + 2)] if whole else first

    @classmethod
    def of(
        cls, values: Mapping[Level, Array], base: Level, methods: tuple[float, float], floor: float
    ) -> Cross:
        """Judge the values at :meth:`levels`; ``methods`` are the orders in theory."""
        i, j = base
        q = values[base]
        more = range(1, 3 if len(values) > 3 else 2)
        along = [q, *(values[i + k, j] for k in more)], [q, *(values[i, j + k] for k in more)]
        cells = Convergence.of(along[0], i + more[-1], methods[0], floor)
        steps = Convergence.of(along[1], j + more[-1], methods[1], floor)
        mixed = np.zeros_like(q)
        parts = [1 - 2**-dial.used for dial in (cells, steps)]
        if (i + 1, j + 1) in values and all(parts):
            mixed = values[i + 1, j + 1] - values[i + 1, j] - values[i, j + 1] + q
            mixed = np.asarray(mixed / math.prod(parts))
        limit = along[0][-1] + cells.rest + along[1][-1] + steps.rest - q + mixed
        unsure = (size(mixed) + size(cells.rest) + size(steps.rest)) / 4
        unsure += cells.unsettled + steps.unsettled
        return cls(cells, steps, np.asarray(limit), mixed, unsure)

    @property
    def separate(self) -> bool:
        """True if the errors of both dials add up."""
        i, j = self.cells.coarsest, self.steps.coarsest
        return size(self.mixed) <= MOST_MIXED * (self.cells.at(i) + self.steps.at(j))

    @property
    def seen(self) -> bool:
        """True if self-convergence is seen."""
        return self.cells.seen and self.steps.seen and self.separate

    def lack(self, i: float, j: float) -> Array:
        """Predict what levels lack of the limit, with its sign; unit of the quantity."""
        fallen = 2 ** -(self.cells.used * (i - self.cells.coarsest))
        also = 2 ** -(self.steps.used * (j - self.steps.coarsest))
        both = self.mixed * (fallen + also - fallen * also)
        return np.asarray(self.cells.lack(i) + self.steps.lack(j) + both)

    def error(self, i: float, j: float) -> float:
        """Predict the error, with half of the doubt, at levels that need not be whole."""
        return self.cells.half_sure(i) + self.steps.half_sure(j)

    def sharpened(self, value: Array, finer: Array, at: Fineness, finer_at: Fineness) -> Cross:
        """Return it with the limit of two runs of which one is finer.

        The finer run lacks of the limit what was predicted, and a part of what the prediction of
        the change was wrong by.  A change that was predicted beyond all levels confirms orders;
        what it was wrong by may be irregular, as much at all levels, and is in doubt as a whole.
        """
        dials = (self.cells, at[0], finer_at[0]), (self.steps, at[1], finer_at[1])
        before = sum(dial.at(a) for dial, a, _ in dials)
        after = sum(dial.at(b) for dial, _, b in dials)
        slow = sum(dial.at(a) * dial.slowest(b - a) for dial, a, b in dials) / (before or 1.0)
        if not (before > 0 and slow < 1):
            return self  # what is left is negligible and has no order: nothing falls
        left = min(max(after / before, FASTEST), slow)
        change = finer - value
        off = change - (self.lack(*at) - self.lack(*finer_at))
        rest = self.lack(*finer_at) + off * left / (1 - left)
        most = slow / (1 - slow)  # part of a change that is to come, at most
        doubt = max(0.0, most * size(change) - size(rest))
        if all(b == a or a >= dial.finest for dial, a, b in dials):
            doubt = min(doubt, most * size(off))
        doubt += (SURE - 1) * sum(size(dial.lack(b)) for dial, _, b in dials) + size(off)
        cells, steps = self.cells.confirmed(), self.steps.confirmed()
        return Cross(cells, steps, np.asarray(finer + rest), self.mixed, uncertainty=doubt)

    def __str__(self) -> str:
        more = f"\n    together: {size(self.mixed):.1e} more than one by one"
        return f"\n    cells: {self.cells}\n    steps: {self.steps}{'' if self.separate else more}"


@dataclass(frozen=True)
class Cost:
    """Wall time of a run: that of building the scene, and that of its steps; s."""

    begin: float
    begin_cell: float  # of building, for each cell
    step: float
    cell: float  # of a step, for each cell

    @classmethod
    def of(cls, steps: Array, cells: Array, building: Array, stepping: Array) -> Cost:
        """Fit to runs, relative differences by least squares; no coefficient is negative."""
        ones = np.ones_like(steps)
        begin = _fit(np.stack([ones, cells], axis=1), building)
        return cls(*begin, *_fit(np.stack([steps, steps * cells], axis=1), stepping))

    def slower(self, factor: float) -> Cost:
        """Return the cost on a machine that is so many times as slow."""
        times = (self.begin, self.begin_cell, self.step, self.cell)
        return Cost(*(factor * time for time in times))

    def stepping(self, steps: Numbers, cells: Numbers) -> Numbers:
        """Predict the wall time of the steps of runs; s."""
        return steps * (self.step + self.cell * cells)

    def seconds(self, steps: Numbers, cells: Numbers) -> Numbers:
        """Predict the wall time of runs; s."""
        return self.begin + self.begin_cell * cells + self.stepping(steps, cells)


def _fit(rows: Array, seconds: Array) -> list[float]:
    """Return the coefficients, none negative, that fit wall times best, as parts of them."""
    least = np.maximum(seconds, np.finfo(float).tiny)
    found = scipy.optimize.nnls(rows / least[:, None], np.ones_like(seconds))[0].tolist()
    return [float(one) for one in found]


def pareto(seconds: Array, errors: Array) -> list[int]:
    """Find the runs that no other one beats in time and error, the fastest first."""
    front: list[int] = []
    for k in np.lexsort((errors, seconds)):
        if not front or errors[k] < errors[front[-1]]:
            front.append(int(k))
    return front
