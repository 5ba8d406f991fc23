# SPDX-License-Identifier: MIT
"""Saved values of a user's functions, at the points that a saved solution needs."""

from __future__ import annotations

import math
from bisect import bisect_left
from collections.abc import Callable, Iterable
from dataclasses import dataclass
from typing import Any, NoReturn

from ufl_beam.errors import SceneError
from ufl_beam.model.curves import Point

SAMPLES = 1000  # intervals in which a curve is sampled


@dataclass(frozen=True)
class SavedFunction:
    """Function of time that is known at some times."""

    name: str  # that of the function
    times: tuple[float, ...]  # ascending; s
    values: tuple[float, ...]  # one for each time

    @classmethod
    def of(cls, function: Callable[[float], float], times: Iterable[float]) -> SavedFunction:
        """Sample a function, at 0 as well; where it fails it is not known."""
        known = {}
        for t in sorted({0.0, *times}):
            try:
                known[t] = float(function(t))
            except Exception:
                continue
        return cls(name_of(function), tuple(known), tuple(known.values()))

    def __call__(self, t: float) -> float:
        """The value at one of the times, or :class:`SceneError` at others."""
        n = bisect_left(self.times, t)
        if n == len(self.times) or self.times[n] != t:
            raise SceneError(
                f"the function {self.name} is not known at t = {t:g}: a file of a solution has "
                "the values of functions at its times only; build the scene with the function"
            )
        return self.values[n]


@dataclass(frozen=True)
class SavedCurve:
    """Curve through saved points, cubic between them and straight beyond."""

    name: str  # that of the function
    s: tuple[float, ...]  # ascending parameters, at least two
    points: tuple[Point, ...]  # one for each; m

    @classmethod
    def of(
        cls, curve: Callable[[float], Any], first: float, last: float, more: Iterable[float] = ()
    ) -> SavedCurve:
        """Sample a curve between two parameters, and at more of them; gaps where it fails."""
        even = (first + (last - first) * k / SAMPLES for k in range(SAMPLES + 1))
        known = {}
        for s in sorted({*even, *more}):
            try:
                x, y = curve(s)
                known[s] = float(x), float(y)
            except Exception:
                continue
        return cls(name_of(curve), tuple(known), tuple(known.values()))

    def __call__(self, s: float) -> Point:
        """The point at a parameter; exact where it was sampled."""
        n = bisect_left(self.s, s)
        if n < len(self.s) and self.s[n] == s:
            return self.points[n]
        count = 4 if 0 < n < len(self.s) else 2
        first = max(min(n - count // 2, len(self.s) - count), 0)
        x = y = 0.0
        near = range(first, min(first + count, len(self.s)))
        for i in near:
            weight = math.prod((s - self.s[j]) / (self.s[i] - self.s[j]) for j in near if j != i)
            x, y = x + weight * self.points[i][0], y + weight * self.points[i][1]
        return x, y


@dataclass(frozen=True)
class LostFunction:
    """Placeholder of a function that cannot be saved, such as a controller."""

    name: str  # that of the function

    def __call__(self, *arguments: object) -> NoReturn:
        """Raise :class:`SceneError`, as the function is not there."""
        raise SceneError(
            f"the function {self.name} is not in the file of the solution, which has results and "
            "numbers; build the scene with the function to simulate it"
        )


def name_of(function: Any) -> str:
    """Return the name of a function, or of the class of a callable object."""
    return str(getattr(function, "__qualname__", type(function).__qualname__))
