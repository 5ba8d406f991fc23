# SPDX-License-Identifier: MIT
"""Supports: components of motion of a place that are held or prescribed."""

from __future__ import annotations

import math
from dataclasses import dataclass

from ufl_beam.display import bracketed
from ufl_beam.errors import SceneError, require_number, require_vector
from ufl_beam.model.bodies import Anchor, require_node
from ufl_beam.model.connector_laws import Bearing
from ufl_beam.model.functions import Constant, Point, TimeFunction, require_time_function

COMPONENTS = ("u", "v", "psi")

Motion = float | TimeFunction


@dataclass(frozen=True, eq=False)
class Support(Bearing):
    """Held or prescribed motion of a place; made by :func:`Clamped` and its siblings.

    Attributes:
        kind: Name for messages.
        place: Where.
        held: Component -> its value in time (m, m, rad), in axes turned by ``angle``.
        angle: Direction of the first axis; rad.

    Example:
        >>> foot = ub.Clamped(beam.start)
        >>> held = ub.Scene([beam], supports=[foot], loads=scene.loads)
        >>> run = ub.simulate(held, ub.Static(), t=(0, 1), dt=0.5)
        >>> print(run.reaction(foot)[-1, 1].round())  # N
        100000.0
    """

    kind: str
    place: Anchor
    held: dict[int, TimeFunction]
    angle: float = 0.0

    __repr__ = bracketed

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
    """Clamped support: holds displacement and rotation.

    Example:
        >>> support = ub.Clamped(beam.start)
        >>> sorted(support.held)  # 0, 1: displacement, 2: rotation
        [0, 1, 2]
    """
    return Support("Clamped", place, {0: still, 1: still, 2: still})


def Pinned(place: Anchor) -> Support:
    """Pinned support: holds the displacement; the place turns freely.

    Example:
        >>> support = ub.Pinned(beam.start)
        >>> sorted(support.held)  # both components of the displacement
        [0, 1]
    """
    return Support("Pinned", place, {0: still, 1: still})


def Roller(place: Anchor, *, along: Point = (1.0, 0.0)) -> Support:
    """Roller support: holds the displacement across ``along``; the place rolls and turns freely.

    Example:
        >>> roller = ub.Roller(beam.end, along=(1, 1))
        >>> simple = ub.Scene([beam], [], [ub.Pinned(beam.start), roller], [ub.Gravity()])
        >>> run = ub.simulate(simple, ub.Static(), t=(0, 1), dt=1.0)
        >>> force = run.reaction(roller)[-1]
        >>> bool(abs(force[0] + force[1]) < 1e-6)  # across the direction
        True
    """
    x, y = require_vector(along, f"Roller at {place}: along")
    if x == y == 0.0:
        raise SceneError(f"Roller at {place}: along = (0, 0) is no direction")
    if x == 0.0 or y == 0.0:
        return Support("Roller", place, {1 if y == 0.0 else 0: still})
    return Support("Roller", place, {1: still}, math.atan2(y, x))


def Prescribed(
    place: Anchor, *, u: Motion | None = None, v: Motion | None = None, psi: Motion | None = None
) -> Support:
    """Prescribed motion of a place by numbers or functions of time; m, m, rad.

    A number is reached at once in dynamics, and in proportion to the time in statics only if it is
    given as a function such as ``lambda t: 0.1 * t``.

    Example:
        >>> turned = ub.Prescribed(beam.start, u=0.0, v=0.0, psi=lambda t: np.pi / 2 * t)
        >>> run = ub.simulate(ub.Scene([beam], supports=[turned]), ub.Static(), t=(0, 1), dt=0.25)
        >>> np.allclose(run.position(beam.end)[-1], (0, 2))
        True
    """
    held: dict[int, TimeFunction] = {}
    for component, value in enumerate((u, v, psi)):
        if callable(value):
            held[component] = value
        elif value is not None:
            number = require_number(value, f"Prescribed at {place}: {COMPONENTS[component]}")
            held[component] = Constant(number) if number else still
    return Support("Prescribed", place, held)
