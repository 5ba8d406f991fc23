# SPDX-License-Identifier: MIT
"""Curves of beam axes as records, so that a scene can be compared and saved by its numbers."""

from __future__ import annotations

import math
from dataclasses import dataclass

Point = tuple[float, float]


@dataclass(frozen=True)
class Straight:
    """Straight line.

    Attributes:
        a, b: Its ends; m.
    """

    a: Point
    b: Point

    def __call__(self, s: float) -> Point:
        """The point at part ``s`` of the length; exact at both ends."""
        return between(self.a, self.b, s)


@dataclass(frozen=True)
class Arc:
    """Circular arc.

    Attributes:
        center: m.
        radius: m.
        first, last: Angles of its ends, counter-clockwise from x; rad.
    """

    center: Point
    radius: float
    first: float
    last: float

    def __call__(self, s: float) -> Point:
        """The point at part ``s`` of the length."""
        angle = self.first + s * (self.last - self.first)
        x, y = self.center
        return x + self.radius * math.cos(angle), y + self.radius * math.sin(angle)


@dataclass(frozen=True)
class Polyline:
    """Straight pieces through points.

    Attributes:
        points: m.
        at: Part of the length at each point, from 0 to 1.
    """

    points: tuple[Point, ...]
    at: tuple[float, ...]

    def __call__(self, s: float) -> Point:
        """The point at part ``s`` of the length."""
        last = len(self.at) - 2
        i = next((k for k, limit in enumerate(self.at[1:-1]) if s <= limit), last)
        part = (s - self.at[i]) / (self.at[i + 1] - self.at[i])
        return between(self.points[i], self.points[i + 1], part)


def between(p: Point, q: Point, s: float) -> Point:
    """The point at part ``s`` of the way from ``p`` to ``q``; exact at both ends."""
    return p[0] * (1 - s) + q[0] * s, p[1] * (1 - s) + q[1] * s
