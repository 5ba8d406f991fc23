# SPDX-License-Identifier: MIT
"""Functions of a user in a scene that was saved: their values at some points, and no more."""

from __future__ import annotations

from bisect import bisect_left
from collections.abc import Callable, Iterable
from dataclasses import dataclass
from typing import Any, NoReturn

from ufl_beam.errors import SceneError
from ufl_beam.model.curves import Point

SAMPLES = 1000
"""Intervals in which a curve is sampled."""


@dataclass(frozen=True)
class SavedFunction:
    """A function of time that is known at some times.

    Attributes:
        name: That of the function.
        times: Ascending; s.
        values: One for each time.
    """

    name: str
    times: tuple[float, ...]
    values: tuple[float, ...]

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
        """The value at one of the times.

        Raises:
            SceneError: The function is not known at this time.
        """
        n = bisect_left(self.times, t)
        if n == len(self.times) or self.times[n] != t:
            raise SceneError(
                f"the function {self.name} is not known at t = {t:g}: a file of a solution has "
                "the values of functions at its times only; build the scene with the function"
            )
        return self.values[n]


@dataclass(frozen=True)
class SavedCurve:
    """A curve that is known at some parameters, cubic between them and straight beyond.

    Attributes:
        name: That of the function.
        s: Ascending parameters, at least two.
        points: One for each; m.
    """

    name: str
    s: tuple[float, ...]
    points: tuple[Point, ...]

    @classmethod
    def of(
        cls, curve: Callable[[float], Any], first: float, last: float, more: Iterable[float] = ()
    ) -> SavedCurve:
        """Sample a curve between two parameters, and at more of them; where it fails, not."""
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
        inside = 0 < n < len(self.s)
        first = min(max(n - (2 if inside else 1), 0), max(len(self.s) - (4 if inside else 2), 0))
        near = range(first, min(first + (4 if inside else 2), len(self.s)))
        x = y = 0.0
        for i in near:
            weight = 1.0
            for j in near:
                if j != i:
                    weight *= (s - self.s[j]) / (self.s[i] - self.s[j])
            x, y = x + weight * self.points[i][0], y + weight * self.points[i][1]
        return x, y


@dataclass(frozen=True)
class LostFunction:
    """A function that cannot be saved, such as a controller.

    Attributes:
        name: That of the function.
    """

    name: str

    def __call__(self, *arguments: object) -> NoReturn:
        """Say that it is not there.

        Raises:
            SceneError: Always.
        """
        raise SceneError(
            f"the function {self.name} is not in the file of the solution, which has results and "
            "numbers; build the scene with the function to simulate it"
        )


def name_of(function: Any) -> str:
    """The name of a function, or of the class of what can be called."""
    return str(getattr(function, "__qualname__", type(function).__qualname__))
