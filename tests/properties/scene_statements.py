# SPDX-License-Identifier: MIT
"""Statements of one scene that must give one motion: other axes, units, directions, orders.

All numbers of a scene go through a :class:`Statement` when it is written as Python source.
"""

import math
from dataclasses import dataclass

import numpy as np

EPS = 2.0**-52

DIMENSIONS = {
    # powers of mass, length and time
    "1": (0, 0, 0), "m": (0, 1, 0), "s": (0, 0, 1), "1/s": (0, 0, -1), "m/s": (0, 1, -1),
    "m/s2": (0, 1, -2), "m2": (0, 2, 0), "kg": (1, 0, 0), "kg/m": (1, -1, 0), "kg m": (1, 1, 0),
    "kg m2": (1, 2, 0), "kg/m3": (1, -3, 0), "N": (1, 1, -2), "N/m": (1, 0, -2), "J": (1, 2, -2),
    "N m": (1, 2, -2), "N m2": (1, 3, -2), "Pa": (1, -1, -2), "Pa s": (1, -1, -1),
    "N s": (1, 1, -1), "N m2 s": (1, 3, -1), "N s/m": (1, 0, -1), "N m s": (1, 2, -1),
    "1/m": (0, -1, 0), "N/m3": (1, -2, -2), "1/m2": (0, -2, 0),
}  # fmt: skip


PARTS = (
    "beams", "bodies", "joints", "supports", "connectors", "loads", "masses", "damping", "initial",
)  # fmt: skip
"""Lists of the parts of scenes."""


def scene_call(parts):
    """Lines of source that make a scene from texts of its parts by name."""
    lines = ["scene = ub.Scene("]
    for name, records in parts.items():
        if records:
            lines += [f"    {name}=[", *(f"        {record}," for record in records), "    ],"]
    return [*lines, ")"]


def made(source):
    """The names that a script defines."""
    names = {}
    exec(source, names)
    return names


@dataclass(frozen=True)
class Statement:
    """How a scene is stated.

    Attributes:
        name: For messages.
        angle: The scene is turned by so much about `center`; rad.
        center: Point of the first statement; m.
        shift: Then it is moved by this; m.
        units: What a kilogram, a metre and a second are in the units of the statement.
        backwards: Seed that chooses the beams whose start and end are exchanged; none without.
        shuffled: Seed of the order of lists, and of both ends of what has no direction.
        digits: Seed of the signs of the changes of the last digits of all numbers.
    """

    name: str = "as given"
    angle: float = 0.0
    center: tuple[float, float] = (0.0, 0.0)
    shift: tuple[float, float] = (0.0, 0.0)
    units: tuple[float, float, float] = (1.0, 1.0, 1.0)
    backwards: int | None = None
    shuffled: int | None = None
    digits: int | None = None

    def unit(self, dimension):
        """What the unit of SI is in those of the statement."""
        return math.prod(u**p for u, p in zip(self.units, DIMENSIONS[dimension], strict=True))

    def turned(self, x, y):
        """A vector in the axes of the statement."""
        cos, sin = math.cos(self.angle), math.sin(self.angle)
        return cos * x - sin * y, sin * x + cos * y

    def point(self, x, y):
        """A point in the axes of the statement; m."""
        (cx, cy), (dx, dy) = self.center, self.shift
        tx, ty = self.turned(x - cx, y - cy)
        return cx + tx + dx, cy + ty + dy

    def motion(self, displacement, of_vectors="m", of_rotations="1"):
        """Displacement and rotation (n, 3) of a solution, in SI and the axes of the first one."""
        u, v, ψ = np.asarray(displacement).T
        cos, sin = math.cos(self.angle), math.sin(self.angle)
        back = np.column_stack([cos * u + sin * v, cos * v - sin * u, ψ])
        return back / [self.unit(x) for x in (of_vectors, of_vectors, of_rotations)]


AS_GIVEN = Statement()


def changed_statements(seed):
    """The five statements that a scene is compared in: an angle and a direction are drawn."""
    random = np.random.default_rng(10_000 + seed)
    center = tuple(float(x) for x in random.uniform(-2, 2, 2))
    way = float(random.uniform(-math.pi, math.pi))
    return [
        Statement("rotated", angle=float(random.uniform(-math.pi, math.pi)), center=center),
        Statement("reversed", backwards=seed),
        Statement("translated", shift=(1e3 * math.cos(way), 1e3 * math.sin(way))),
        Statement("in mm, t and ms", units=(1e-3, 1e3, 1e3)),
        Statement("reordered", shuffled=seed),
    ]


class MotionGeometry:
    """Writes numbers in the units and axes of a statement, digits of places perhaps as they are."""

    def __init__(self, statement, change=4, places_stay=False):
        self.statement, self._places_stay = statement, places_stay
        self._signs = None if statement.digits is None else np.random.default_rng(statement.digits)
        self._change = change

    def _text(self, x, place=False):
        if self._signs is not None and not (place and self._places_stay):
            x *= 1 + self._change * EPS * self._signs.choice([-1, 1])
        return "math.inf" if math.isinf(x) else repr(float(x))

    def number(self, x, dimension="1"):
        """A number of a dimension, given in SI."""
        return self._text(x * self.statement.unit(dimension), place=dimension == "m")

    def point(self, xy):
        """A point, given in m."""
        x, y = self.statement.point(*xy)
        metre = self.statement.unit("m")
        return f"({self._text(x * metre, place=True)}, {self._text(y * metre, place=True)})"

    def vector(self, xy, dimension="1"):
        """A vector of a dimension, given in SI."""
        x, y = self.statement.turned(*xy)
        unit = self.statement.unit(dimension)
        return f"({self._text(x * unit)}, {self._text(y * unit)})"

    def direction(self, angle):
        """An angle from the first axis; rad."""
        return self._text(angle + self.statement.angle, place=True)
