# SPDX-License-Identifier: MIT
"""Rainflow counting of stress cycles, S-N curves and damage."""

from __future__ import annotations

import math
from collections import defaultdict
from collections.abc import Callable
from dataclasses import dataclass
from itertools import pairwise

import numpy as np
import numpy.typing as npt

from ufl_beam.arrays import Array
from ufl_beam.display import one_line
from ufl_beam.errors import SceneError, is_infinite, require_function, require_number, require_row


@dataclass(frozen=True)
class Goodman:
    """Goodman's line: equivalent range S / (1 − mean / ultimate) about a tensile mean stress.

    The straight line of the Haigh diagram; with the yield stress it is Soderberg's.  Compression
    has no effect.  At a mean stress of ``ultimate`` the life is zero.

    Args:
        ultimate: Ultimate stress; Pa.

    Example:
        >>> curve = ub.SNCurve(range=71e6, mean=ub.Goodman(ultimate=500e6))
        >>> print(curve.endurance(71e6, mean=0.0), curve.endurance(71e6, mean=250e6))
        2000000.0 250000.0
    """

    ultimate: float

    def __post_init__(self) -> None:
        require_number(self.ultimate, "Goodman: ultimate", positive=True)

    def __call__(self, range: Array, mean: Array) -> Array:
        """Equivalent ranges of cycles; Pa."""
        return _over(range, 1 - np.maximum(mean, 0.0) / self.ultimate)


@dataclass(frozen=True)
class Gerber:
    """Gerber's parabola: equivalent range S / (1 − (mean / ultimate)²) about a mean stress.

    Args:
        ultimate: Ultimate stress; Pa.

    Example:
        >>> welded, machined = ub.SNCurve(range=71e6), ub.SNCurve(range=71e6, mean=ub.Gerber(500e6))
        >>> bool(machined.endurance(100e6, mean=200e6) < welded.endurance(100e6, mean=200e6))
        True
    """

    ultimate: float

    def __post_init__(self) -> None:
        require_number(self.ultimate, "Gerber: ultimate", positive=True)

    def __call__(self, range: Array, mean: Array) -> Array:
        """Equivalent ranges of cycles; Pa."""
        return _over(range, 1 - (np.maximum(mean, 0.0) / self.ultimate) ** 2)


def _over(range: Array, part: Array) -> Array:
    """Ranges over the part of the strength that the mean stress leaves; infinite where none."""
    equivalent: Array = np.divide(range, part, out=np.full_like(range, np.inf), where=part > 0)
    return equivalent


def any_mean(range: Array, mean: Array) -> Array:
    """Return the range itself, as in welds with residual stress: the mean does not count."""
    return range


@dataclass(frozen=True, kw_only=True)
class SNCurve:
    """S-N curve: cycles to failure over the stress range, by Basquin's law.

    Args:
        range: Stress range that leads to failure after ``cycles``; Pa.
        cycles: Number of cycles to failure at ``range``.
        slope: m of N = cycles (range / S)^m.
        knee: Number of cycles from which on the slope is another.
        slope_beyond: The other slope, above ``knee`` cycles.
        limit: Ranges with more cycles to failure than this do no damage.
        mean: Equivalent range of ranges about mean stresses, such as :class:`Goodman`.

    Raises:
        SceneError: A number is not positive, or ``limit`` is less than ``knee``.

    Example:
        >>> curve = ub.SNCurve.eurocode(71e6)
        >>> print(curve.endurance([142e6, 71e6, 10e6]))  # cycles to failure
        [ 250000. 2000000.      inf]
    """

    range: float
    cycles: float = 2e6
    slope: float = 3.0
    knee: float = math.inf
    slope_beyond: float = 5.0
    limit: float = math.inf
    mean: Callable[[Array, Array], Array] = any_mean

    __repr__ = one_line

    def __post_init__(self) -> None:
        for name in ("range", "cycles", "slope", "slope_beyond"):
            require_number(getattr(self, name), f"SNCurve: {name}", positive=True)
        for name in ("knee", "limit"):
            if not is_infinite(getattr(self, name)):
                require_number(getattr(self, name), f"SNCurve: {name}", positive=True)
        if self.limit < self.knee < math.inf:
            raise SceneError(
                f"SNCurve: limit = {self.limit:g} cycles lies before the knee, {self.knee:g}"
            )
        require_function(self.mean, "SNCurve: mean", "(range, mean)")

    @classmethod
    def eurocode(cls, category: float) -> SNCurve:
        """Make a curve of EN 1993-1-9: slope 3 to 5e6 cycles, 5 to 1e8, no damage beyond.

        Args:
            category: Detail category, the range that is borne for 2e6 cycles; Pa: 71e6.
        """
        require_number(category, "SNCurve.eurocode: category", positive=True)
        return cls(range=category, cycles=2e6, slope=3.0, knee=5e6, slope_beyond=5.0, limit=1e8)

    def endurance(self, range: npt.ArrayLike, mean: npt.ArrayLike = 0.0) -> Array:
        """Compute cycles to failure of ranges about means, both Pa; infinite below the limit."""
        ranges, means = np.broadcast_arrays(*(np.asarray(x, dtype=float) for x in (range, mean)))
        with np.errstate(divide="ignore"):
            first = self.cycles * (self.range / self.mean(ranges, means)) ** self.slope
        if math.isfinite(self.knee):
            second = self.knee * (first / self.knee) ** (self.slope_beyond / self.slope)
            first = np.where(first > self.knee, second, first)
        # A category is a rounded number: its limit holds to round-off.
        return np.where(first > self.limit * (1 + 1e-12), np.inf, first)


@dataclass(frozen=True, eq=False)
class Cycles:
    """Cycles of a stress history, sorted by range, the smallest first.

    Attributes:
        range: Their ranges; (n,); Pa.
        mean: Their mean stresses; (n,); Pa.
        count: How many there were, halves included; (n,).

    Example:
        >>> cycles = ub.rainflow([0, 100e6, -50e6, 80e6, 0])  # Pa
        >>> print(cycles.range / 1e6, cycles.count)
        [ 80. 100. 130. 150.] [0.5 0.5 0.5 0.5]
        >>> print(f"{cycles.damage(ub.SNCurve.eurocode(71e6)):.2e}")
        4.95e-06
    """

    range: Array
    mean: Array
    count: Array

    __repr__ = one_line

    def damage(self, curve: SNCurve) -> float:
        """Compute Miner's sum: the part of the life that these cycles take, 1 at failure."""
        with np.errstate(divide="ignore"):  # what breaks at once
            return float(np.sum(self.count / curve.endurance(self.range, self.mean)))

    def equivalent(self, curve: SNCurve) -> float:
        """Compute the constant range that does the same damage in as many cycles; Pa.

        By the first slope alone, as damage equivalent ranges are given.
        """
        m, ranges = curve.slope, curve.mean(self.range, self.mean)
        total = self.count.sum()
        return float((self.count @ ranges**m / total) ** (1 / m)) if total > 0 else 0.0


def rainflow(series: npt.ArrayLike) -> Cycles:
    """Count the rainflow cycles of a series by ASTM E1049-85.

    Args:
        series: Stresses, or whatever goes to and fro; (n,).

    Raises:
        SceneError: It is not one row of finite numbers.

    Example:
        >>> cycles = ub.rainflow([0, 3, 1, 2, 0])
        >>> print(cycles.range, cycles.mean, cycles.count)
        [1. 3.] [1.5 1.5] [1. 1.]
    """
    counter = RainflowCounter(1.0)
    counter.count(require_row(series, "rainflow: series"))
    return counter.cycles()


class RainflowCounter:
    """Rainflow counter of a series that comes in pieces, in constant memory.

    Values are rounded to multiples of ``resolution`` (Pa), so that cycles fall into classes, and no
    more turning points wait than there are classes.
    """

    def __init__(self, resolution: float) -> None:
        require_number(resolution, "RainflowCounter: resolution", positive=True)
        self._resolution = resolution
        self._counts: defaultdict[tuple[float, float], float] = defaultdict(float)  # by both ends
        self._waiting: list[float] = []  # turning points between which ranges become smaller

    def add(self, series: Array) -> None:
        """Count the next piece; (n,)."""
        self.count(np.rint(series / self._resolution))

    def count(self, values: Array) -> None:
        """Count the next values, multiples of the resolution, by the method of ASTM E1049."""
        points = self._waiting
        for value in map(float, values):
            if points and value == points[-1]:
                continue
            if len(points) > 1 and (value > points[-1]) == (points[-1] > points[-2]):
                points.pop()  # no turning point: the series goes on beyond it
            points.append(value)
            while len(points) > 2 and abs(value - points[-2]) >= abs(points[-2] - points[-3]):
                if len(points) == 3:  # from the beginning of the series
                    self._counts[_ends(*points[:2])] += 0.5
                    del points[0]
                else:
                    self._counts[_ends(*points[-3:-1])] += 1.0
                    del points[-3:-1]

    def cycles(self) -> Cycles:
        """Return all cycles so far; between the points that wait there are half cycles."""
        counts = self._counts.copy()
        for a, b in pairwise(self._waiting):
            counts[_ends(a, b)] += 0.5
        low, high = np.array(list(counts), dtype=float).reshape(-1, 2).T
        order, unit = np.lexsort((low, high - low)), self._resolution
        count = np.array(list(counts.values()), dtype=float)
        return Cycles(unit * (high - low)[order], unit / 2 * (low + high)[order], count[order])

    def state(self) -> tuple[Array, Array]:
        """Return ends and numbers of cycles, (n, 3), and waiting turning points, in classes."""
        counted = [(*ends, count) for ends, count in self._counts.items()]
        return np.array(counted, dtype=float).reshape(-1, 3), np.array(self._waiting, dtype=float)

    def resume(self, counted: Array, waiting: Array) -> None:
        """Go on after a :meth:`state`."""
        self._counts.clear()
        for low, high, count in (map(float, row) for row in counted):
            self._counts[low, high] = count
        self._waiting = []
        self.count(waiting)


def _ends(a: float, b: float) -> tuple[float, float]:
    return min(a, b), max(a, b)
