# SPDX-License-Identifier: MIT
"""Supports: what is held or moved in a given way at a place."""

from __future__ import annotations

import math
from dataclasses import dataclass

from ufl_beam.errors import (
    SceneError,
    require_number,
    require_vector,
)
from ufl_beam.model.beams import Point
from ufl_beam.model.bodies import (
    Anchor,
    require_node,
)
from ufl_beam.model.connector_laws import Bearing
from ufl_beam.model.loads import (
    Constant,
    TimeFunction,
    require_time_function,
)

COMPONENTS = ("u", "v", "psi")


@dataclass(frozen=True, eq=False)
class Support(Bearing):
    """Components of motion of a place that are given; made by :func:`Clamped` and its siblings.

    Attributes:
        kind: Name for messages.
        place: Where.
        held: Component -> its value in time (m, m, rad), in axes turned by ``angle``.
        angle: Direction of the first axis; rad.
    """

    kind: str
    place: Anchor
    held: dict[int, TimeFunction]
    angle: float = 0.0

    def __post_init__(self) -> None:
        require_node(self.place, self.kind)
        if not self.held:
            raise SceneError(f"{self} holds nothing; give at least one of u, v, psi")
        for component, value in self.held.items():
            require_time_function(value, f"{self}, {COMPONENTS[component]}")

    @property
    def moving(self) -> dict[int, TimeFunction]:
        """The held components that may move."""
        return {c: f for c, f in self.held.items() if f is not still}

    def __str__(self) -> str:
        return f"{self.kind} at {self.place}"


def still(t: float) -> float:
    """The time function of a component that is held fast: 0."""
    return 0.0


def Clamped(place: Anchor) -> Support:
    """Holds displacement and rotation."""
    return Support("Clamped", place, {0: still, 1: still, 2: still})


def Pinned(place: Anchor) -> Support:
    """Holds the displacement; the place turns freely."""
    return Support("Pinned", place, {0: still, 1: still})


def Roller(place: Anchor, *, along: Point = (1.0, 0.0)) -> Support:
    """Holds the displacement across the direction ``along``; the place rolls and turns freely."""
    x, y = require_vector(along, f"Roller at {place}: along")
    if x == y == 0.0:
        raise SceneError(f"Roller at {place}: along = (0, 0) is no direction")
    if y == 0.0:
        return Support("Roller", place, {1: still})
    if x == 0.0:
        return Support("Roller", place, {0: still})
    return Support("Roller", place, {1: still}, math.atan2(y, x))


def Prescribed(
    place: Anchor,
    *,
    u: float | TimeFunction | None = None,
    v: float | TimeFunction | None = None,
    psi: float | TimeFunction | None = None,
) -> Support:
    """Moves the named components as given: numbers, or functions of time; m, m, rad.

    A number is reached at once in dynamics, and in proportion to the time in statics only if it is
    given as a function such as ``lambda t: 0.1 * t``.
    """
    held = {
        component: value if callable(value) else _constant(value, place, component)
        for component, value in enumerate((u, v, psi))
        if value is not None
    }
    return Support("Prescribed", place, held)


def _constant(value: float, place: Anchor, component: int) -> TimeFunction:
    require_number(value, f"Prescribed at {place}: {COMPONENTS[component]}")
    return still if value == 0 else Constant(float(value))
