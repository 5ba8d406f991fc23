# SPDX-License-Identifier: MIT
"""Curves in the plane, such as axes of beams, and functions of time."""

from __future__ import annotations

import math
from abc import ABC, abstractmethod
from bisect import bisect_left
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import cached_property, singledispatch
from itertools import accumulate, combinations, pairwise
from operator import ge
from types import FunctionType
from typing import Annotated, Any

import numpy as np
import scipy  # loads its submodules at their first use

from ufl_beam.arrays import Array
from ufl_beam.display import compact_repr
from ufl_beam.errors import ModelError, NoNumber, closed, shorten
from ufl_beam.model import checks

Point = tuple[float, float]

Curve = Callable[[float], Sequence[float]]

REACH = 1e-3
"""Step of finite differences for tangents: fraction of the scene's size, or of a beam's length.
Tangents have a relative error of some 1e-12, mostly round-off, if radii are not much smaller."""

MOST_ITERATIONS = 50
"""Largest number of iterations in :meth:`GuideCurve.nearest`."""

WEIGHTS = np.array(
    [[-25, 48, -36, 16, -3], [-3, -10, 18, -6, 1], [1, -8, 0, 8, -1],
     [-1, 6, -18, 10, 3], [3, -16, 36, -48, 25]]
) / 12  # fmt: skip
"""Row k: weights of the values at five equidistant points in the derivative at point k."""


# -- beam axes: dataclasses, so that scenes can be compared and saved --------------------------


@closed("any function of s will do")
@dataclass(frozen=True)
class Straight:
    """Straight line between two ends; m."""

    a: Point
    b: Point

    def __call__(self, s: float) -> Point:
        """Return the point at the fraction ``s`` of the length; exact at both ends."""
        return between(self.a, self.b, s)


@dataclass(frozen=True)
class Arc:
    """Circular arc (m) between two angles (rad), counter-clockwise from the x axis."""

    center: Point
    radius: float
    first: float
    last: float

    def __call__(self, s: float) -> Point:
        """Return the point at the fraction ``s`` of the length."""
        angle = self.first + s * (self.last - self.first)
        x, y = self.center
        return x + self.radius * math.cos(angle), y + self.radius * math.sin(angle)


@dataclass(frozen=True)
class Polyline:
    """Straight lines from point to point; m."""

    points: tuple[Point, ...]
    at: tuple[float, ...]  # fraction of the length at each point, from 0 to 1

    def __call__(self, s: float) -> Point:
        """Return the point at the fraction ``s`` of the length."""
        i = bisect_left(self.at, s, 1, len(self.at) - 1) - 1
        fraction = (s - self.at[i]) / (self.at[i + 1] - self.at[i])
        return between(self.points[i], self.points[i + 1], fraction)


class GuideCurve(ABC):
    """Curve of a guide; its equations in UFL are in mechanics/guide_curves.py."""

    @abstractmethod
    def at(self, s: float) -> Array:
        """Return the point at a parameter, and its first two derivatives; (3, 2)."""

    def nearest(self, point: Array, s: float, size: float) -> float:
        """Return the parameter of the nearest point; NaN without convergence.

        The search begins at ``s``; ``size`` is the size of the scene; m.
        """
        last_digits = 4 * np.spacing(size + math.hypot(*point))
        for _ in range(MOST_ITERATIONS):
            on, slope, bend = self.at(s)
            gap, square = point - on, float(slope @ slope)
            change = float(gap @ slope) / max(square - float(gap @ bend), square / 2)
            s, moved = s + change, abs(change) * math.sqrt(square)
            if not moved > last_digits:  # also if it is not a number
                return s
        return s if moved <= 1e-9 * size else math.nan


@singledispatch
def guide_curve(curve: Any, what: str) -> GuideCurve:
    """Return the curve of a guide, or raise :class:`ModelError`.

    The model does not import UFL; mechanics/guide_curves.py registers a class for functions.
    """
    raise NotImplementedError(what)


@dataclass(frozen=True)
class Spline(GuideCurve):
    """Cubic spline through points, a curve for :class:`Guided` or :meth:`Beam.along`.

    It is smooth, with continuous curvature.  Beyond its ends the first and last cubic continue.

    Args:
        points: Two or more points (x, y); m.
        s: Increasing parameter of each point, by default the sum of the distances from the first
            point.

    Raises:
        ModelError: Fewer than two points, another number of parameters, or parameters that do not
            increase.

    Example:
        >>> rail = ub.Spline([(2, 0), (2.5, 0.1), (3, 0.4), (3.5, 0.9)])
        >>> guided = ub.Guided(beam.end, rail)
    """

    points: Sequence[Point]
    s: Sequence[float] = None  # type: ignore[assignment]  # replaced by sums of distances

    __repr__ = compact_repr

    def __post_init__(self) -> None:
        points = checks.require_sequence(self.points, "Spline: points")
        points = tuple(
            checks.require_vector(p, f"Spline: points[{i}]") for i, p in enumerate(points)
        )
        steps = (math.dist(p, q) for p, q in pairwise(points))
        given = [*accumulate(steps, initial=0.0)] if self.s is None else self.s
        s = checks.require_numbers(given, "Spline: s")
        if len(points) < 2 or len(s) != len(points):
            raise ModelError(
                f"Spline: {len(points)} points, {len(s)} parameters s; give at least two points, "
                "and as many parameters"
            )
        if any(map(ge, s, s[1:])):
            raise ModelError("Spline: s must increase, so points that follow must be apart")
        object.__setattr__(self, "points", points)
        object.__setattr__(self, "s", s)

    @cached_property
    def _cubics(self) -> Any:
        return scipy.interpolate.CubicSpline(self.s, self.points)

    @property
    def table(self) -> Array:
        """Begin of each segment, and coefficients of powers of s from it in x, y; (n, 9)."""
        powers = self._cubics.c[::-1].transpose(1, 2, 0).reshape(-1, 8)
        return np.column_stack([self.s[:-1], powers])

    def at(self, s: float) -> Array:
        """See the base class."""
        return np.array([self._cubics(s, order) for order in range(3)])

    def __call__(self, s: float) -> Point:
        """Return the point at a parameter, m; exact at given parameters."""
        if s in self.s:
            return self.points[self.s.index(s)]
        x, y = self._cubics(s).tolist()
        return x, y


def between(p: Point, q: Point, s: float) -> Point:
    """Return the point at the fraction ``s`` of the line from ``p`` to ``q``; exact at the ends."""
    return tuple(a * (1 - s) + b * s for a, b in zip(p, q, strict=True))  # type: ignore[return-value]


def curve_point(curve: Curve, s: float, what: str) -> Point:
    """Evaluate a user's curve at ``s``, or raise :class:`ModelError`; m."""
    checks.require_function(curve, what, "s that returns (x, y)")
    try:
        point = curve(s)
    except Exception as error:
        raise ModelError(f"{what}({s:g}) fails: {shorten(error)}") from error
    return checks.require_point(point, f"{what}({s:g})")  # type: ignore[return-value]


def points_along(
    curves: Sequence[Curve], parameters: Sequence[Sequence[float] | Array], d: int = 2
) -> Array:
    """Return the points of each curve at its own parameters, curve by curve; (n, d); m."""
    ends = [(*c.a, *c.b) if isinstance(c, Straight) else (0.0,) * (2 * d) for c in curves]
    counts = [len(s) for s in parameters]
    s = np.concatenate([np.empty(0), *parameters])
    segments = np.repeat(np.reshape(ends, (-1, 2 * d)), counts, axis=0)
    points: Array = segments[:, :d] * (1 - s)[:, None] + segments[:, d:] * s[:, None]
    first = np.append(0, np.cumsum(counts, dtype=np.int64))
    for i, curve in enumerate(curves):
        if not isinstance(curve, Straight):
            points[first[i] : first[i + 1]] = [curve(x) for x in parameters[i]]
    return points


# -- tangents ------------------------------------------------------------------------------------


def tangent_within(curve: Curve, s: float, low: float, high: float) -> Array:
    """Return the derivative at ``s``, from points between ``low`` and ``high``; (2,); m."""
    step = min(REACH, (high - low) / 8)
    left, right = int((s - low) / step), int((high - s) / step)
    before = left if left < 2 else max(2, 4 - right)
    points = np.array([curve(s + step * (k - before)) for k in range(5)], dtype=np.float64)
    return np.asarray(WEIGHTS[before] @ points / step)


def enclosing_diameter(points: Array) -> float:
    """Return the diameter of the smallest circle or sphere around points, (n, 2 or 3); m.

    The diameter does not depend on the coordinate axes.  The circle goes through two or three
    points, the sphere through up to four.  The farthest point outside is included next, until no
    point is outside.
    """

    def lengths(x: Array) -> Array:
        return np.asarray(np.hypot(*x.T) if x.shape[1] == 2 else np.linalg.norm(x, axis=1))

    points = points - points.mean(axis=0)
    distances = lengths(points)
    slack, chosen = 1e-12 * float(distances.max()), [int(np.argmax(distances))]
    center, radius = points[chosen[0]], 0.0
    while True:
        distances = lengths(points - center)
        outside = int(np.argmax(distances))
        if distances[outside] <= radius + slack:
            return 2 * radius
        few, circles = [*chosen, outside], []
        for through in (x for n in range(2, points.shape[1] + 2) for x in combinations(few, n)):
            first, *others = points[list(through)]
            ways = np.array(others) - first
            # The centre is equidistant from all points, in least squares if they are collinear.
            middle = first + ways[0] / 2
            if len(ways) > 1:
                middle = first + np.linalg.lstsq(2 * ways, (ways**2).sum(axis=1), rcond=None)[0]
            reach = float(lengths(points[few] - middle).max())
            circles.append((reach, list(through), middle))
        larger, chosen, center = min(circles, key=lambda circle: circle[0])
        if larger <= radius:  # only round-off is left
            return 2 * radius
        radius = larger


# -- functions of time --------------------------------------------------------------------------


TimeFunction = Callable[[float], float]


@dataclass(frozen=True)
class Constant:
    """Constant function of time."""

    value: float

    def __call__(self, t: float) -> float:
        """Return the value, at any time."""
        return self.value


steady = Constant(1.0)
"""Time function of a steady load."""

still = Constant(0.0)
"""Time function of a fixed component of motion."""


def same_function(a: Any, b: Any) -> bool:
    """Return whether two functions are known to have the same values.

    So do constants, and functions that were defined twice by the same line with the same numbers.
    """
    if isinstance(a, Constant) and isinstance(b, Constant):
        return a.value == b.value
    if a is b or not isinstance(a, FunctionType) or not isinstance(b, FunctionType):
        return a is b
    if a.__code__ is not b.__code__ or a.__defaults__ != b.__defaults__:
        return False
    values = zip(*([x.cell_contents for x in f.__closure__ or ()] for f in (a, b)), strict=True)
    return all(x is y or (isinstance(x, int | float) and x == y) for x, y in values)


def ramp(duration: float) -> TimeFunction:
    """Return a time function that grows from 0 at t = 0 to 1 at ``duration`` (s) and stays at 1.

    Example:
        >>> growth = ub.ramp(2.0)
        >>> growth(0.5), growth(2.0), growth(9.0)
        (0.25, 1.0, 1.0)
    """
    checks.require_number(duration, "ramp: duration", positive=True)
    return Table((0.0, duration), (0.0, 1.0))


@closed("any function of t will do")
@dataclass(frozen=True)
class Table:
    """Time function with given values, linear between their times and constant outside.

    Args:
        times: Increasing times; s.
        values: Value at each of the times.

    Raises:
        ModelError: The lengths differ or are zero, or times do not increase.

    Example:
        >>> pulse = ub.Table([0, 0.1, 0.2], [0, 5, 0])
        >>> print(pulse(0.05), pulse(0.1), pulse(1.0))
        2.5 5.0 0.0
    """

    times: Sequence[float]
    values: Sequence[float]

    __repr__ = compact_repr

    def __post_init__(self) -> None:
        for name in ("times", "values"):
            checked = checks.require_numbers(getattr(self, name), f"Table: {name}")
            object.__setattr__(self, name, checked)
        if len(self.times) != len(self.values) or len(self.times) < 1:
            raise ModelError(
                f"Table: {len(self.times)} times and {len(self.values)} values; "
                "give the same number of each"
            )
        falls = [*map(ge, self.times, self.times[1:])]
        if any(falls):
            i = falls.index(True)
            before, after = self.times[i : i + 2]
            raise ModelError(
                f"Table: times must increase, but times[{i}] = {before:g} is followed by {after:g}"
            )

    @property
    def kinks(self) -> Sequence[float]:
        """Times at which the slope may jump; adaptive steps end there; s."""
        return self.times

    def __call__(self, t: float) -> float:
        """Return the value at time ``t``."""
        return float(np.interp(t, self.times, self.values))


def require_time_function(function: TimeFunction, what: str) -> None:
    """Raise :class:`ModelError` unless ``function`` returns a number at t = 0."""
    if not callable(function):
        raise ModelError(
            f"{what} = {shorten(function)} must be a function of t, such as ub.Table, or "
            "motion.acceleration of a GroundMotion"
        )
    try:
        value_at(function, 0.0, what)
    except ModelError:
        raise
    except Exception as error:
        raise ModelError(f"{what}: the time function fails at t = 0: {shorten(error)}") from error


Timed = Annotated[TimeFunction, require_time_function]
"""Type of a field with a time function."""


def value_at(function: TimeFunction, t: float, owner: object) -> float:
    """Evaluate a user's time function.

    Raises:
        NoNumber: The value is not finite.
        ModelError: The value is not a number.
    """
    value = function(t)
    if not isinstance(value, float):  # np.float64 is a float
        value = checks.require_returned(value, f"{owner}: the time function", f"t = {t:.9g} s")
    if not math.isfinite(value):
        raise NoNumber(f"{owner}: the time function is {value} at t = {t:.9g} s")
    return float(value)
