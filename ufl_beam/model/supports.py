# SPDX-License-Identifier: MIT
"""Supports: fixed or prescribed components of the motion of a place."""

from __future__ import annotations

import math
from abc import ABC, abstractmethod
from collections.abc import Iterable, Sequence
from dataclasses import KW_ONLY, dataclass
from functools import cached_property
from typing import Annotated, Any, ClassVar

import numpy as np

from ufl_beam.arrays import Array
from ufl_beam.display import bracketed
from ufl_beam.errors import ModelError, require_point
from ufl_beam.model.bodies import NodeField
from ufl_beam.model.checks import require_number
from ufl_beam.model.connector_laws import Bearing
from ufl_beam.model.connectors import across
from ufl_beam.model.functions import Constant, TimeFunction, require_time_function, still
from ufl_beam.model.records import Record

COMPONENTS = ("u", "v", "psi")

Motion = float | TimeFunction


def require_direction(direction: object, what: str) -> tuple[float, ...]:
    """Return ``direction`` as a vector that is not zero, or raise."""
    vector = require_point(direction, what)
    if not any(vector):
        raise ModelError(f"{what} = ({', '.join(f'{x:g}' for x in vector)}) is no direction")
    return vector


Direction = Annotated[Any, require_direction]


def successive(rows: Array, first: int = 0) -> list[tuple[int, int, float]]:
    """Return rotations, one after another, of components from ``first`` on into axes in space.

    The axes are the rows of a matrix.  A rotation has two components, and the angle from the axis
    of one to the axis of the other; rad.
    """
    found = list[tuple[int, int, float]]()
    for i, j in ((0, 1), (0, 2), (1, 2)):
        angle = math.atan2(rows[i, j], rows[i, i])
        found.append((first + i, first + j, angle))
        turn = np.eye(3)
        turn[[i, j], [i, j]], turn[[i, j], [j, i]] = (
            math.cos(angle),
            math.sin(angle) * np.array([-1, 1]),
        )
        rows = rows @ turn
    return [x for x in found if x[2]]


@dataclass(frozen=True, eq=False, repr=False)
class Support(Bearing, Record, ABC):
    """Fixed or prescribed motion of a place; base of :class:`Clamped` and other supports.

    Attributes:
        place: Supported place: on a beam, or the centre of a body.
        held: Functions of time of the prescribed components: 0 and 1 are displacements in axes
            turned by ``angle`` (m), 2 is the rotation (rad).  In space, 0 to 2 are displacements,
            and 3 to 5 rotations, in axes turned by ``turns``.
        angle: Angle from the x axis to the axis of component 0, in the plane; rad.

    Example:
        >>> foot = ub.Clamped(beam.start)
        >>> held = ub.Scene([beam], supports=[foot], loads=scene.loads)
        >>> run = ub.simulate(held, ub.Static(), t=(0, 1), dt=0.5)
        >>> print(run.reaction(foot)[-1, 1].round())  # N
        100000.0
    """

    place: NodeField
    angle: ClassVar[float] = 0.0
    axis: ClassVar[Any] = None  # in space, of rotations, if those across it are held

    __repr__ = bracketed

    @cached_property
    def displacements(self) -> int:
        """Number of components of the displacement, 2 or in space 3."""
        return len(self.place.point)

    @property
    def turns(self) -> Sequence[tuple[int, int, float]]:
        """Rotations of components, one after another, into the axes of the support.

        Each has two components, and the angle (rad) between the axes of the first.
        """
        return [(0, 1, self.angle)] if self.angle else []

    @property
    def axes(self) -> Array:
        """Directions of the components as rows, by components along the axes of the scene."""
        rows: Array = np.eye(3 * self.displacements - 3)
        for i, j, angle in self.turns:
            cos, sin = math.cos(angle), math.sin(angle)
            rows[[i, j]] = [[cos, sin], [-sin, cos]] @ rows[[i, j]]
        return rows

    def functions_of_time(self) -> Iterable[TimeFunction]:
        """See the base class."""
        return self.held.values()

    @property
    @abstractmethod
    def held(self) -> dict[int, TimeFunction]:
        """Functions of time of the prescribed components."""

    def __post_init__(self) -> None:
        super().__post_init__()
        self._require_directions()
        if not self.held:
            names = "u, v, psi" if self.displacements == 2 else "u, v, w, axis"
            raise ModelError(f"{self} holds nothing; give at least one of {names}")
        for component, value in self.moving.items():
            require_time_function(value, f"{self}, {self.names[component]}")

    def _require_directions(self) -> None:
        """Raise :class:`ModelError` unless vectors have the components of the place."""

    @property
    def names(self) -> Sequence[str]:
        """Names of the components in messages."""
        across = ("rotation across the axis",) * 2
        return COMPONENTS if self.displacements == 2 else ("u", "v", "w", *across, "psi")

    @property
    def bears_moment(self) -> bool:
        """True if a rotation is held."""
        return max(self.held) >= self.displacements

    @property
    def moving(self) -> dict[int, TimeFunction]:
        """Functions in ``held`` except the components that are fixed at zero."""
        return {c: f for c, f in self.held.items() if f != still}

    def __str__(self) -> str:
        return f"{type(self).__name__} at {self.place}"


class Clamped(Support):
    """Clamped support: holds displacement and rotation.

    Example:
        >>> support = ub.Clamped(beam.start)
        >>> sorted(support.held)  # 0, 1: displacement, 2: rotation
        [0, 1, 2]
    """

    @cached_property
    def held(self) -> dict[int, TimeFunction]:
        """All components, fixed at zero."""
        return dict.fromkeys(range(3 * self.displacements - 3), still)


class Pinned(Support):
    """Pinned support: holds the displacement; the place turns freely.

    Example:
        >>> support = ub.Pinned(beam.start)
        >>> sorted(support.held)  # both components of the displacement
        [0, 1]
    """

    @cached_property
    def held(self) -> dict[int, TimeFunction]:
        """The displacement, fixed at zero."""
        return dict.fromkeys(range(self.displacements), still)


@dataclass(frozen=True, eq=False, repr=False)
class Roller(Support):
    """Roller support: holds the displacement across ``along``; the place rolls and turns freely.

    In space ``along`` has three components, by default (1, 0, 0).

    Example:
        >>> roller = ub.Roller(beam.end, along=(1, 1))
        >>> simple = ub.Scene(
        ...     [beam], supports=[ub.Pinned(beam.start), roller], loads=[ub.Gravity()]
        ... )
        >>> run = ub.simulate(simple, ub.Static(), t=(0, 1), dt=1.0)
        >>> force = run.reaction(roller)[-1]
        >>> bool(abs(force[0] + force[1]) < 1e-6)  # across the direction
        True
    """

    _: KW_ONLY
    along: Direction = (1.0, 0.0)

    def _require_directions(self) -> None:
        _require_components(self, "along", Roller.along)

    @cached_property
    def held(self) -> dict[int, TimeFunction]:
        """Displacement across ``along``, fixed at zero."""
        free = np.flatnonzero(self.along)
        return {
            c: still for c in range(self.displacements) if c != (free[0] if len(free) == 1 else 0)
        }

    @property
    def angle(self) -> float:  # type: ignore[override]
        """Direction in which the place rolls, or 0 if it rolls along x or y; rad."""
        turned = self.displacements == 2 and all(self.along)
        return math.atan2(self.along[1], self.along[0]) if turned else 0.0

    @property
    def turns(self) -> Sequence[tuple[int, int, float]]:
        """See the base class."""
        if self.displacements == 2 or np.count_nonzero(self.along) == 1:
            return super().turns
        along = np.array(self.along) / math.hypot(*self.along)
        return successive(np.array([along, *across(tuple(along))]))


@dataclass(frozen=True, eq=False, repr=False)
class PrescribedDisplacement(Support):
    """Prescribed motion of a place by numbers or functions of time, such as a settlement.

    A number is the value from the first step on, also in statics.  For a motion that grows in time
    give a function such as ``lambda t: 0.1 * t``.  Components without a value are free.  The work
    of moving supports is the entry "supports" of ``energy.supplied``.

    In space a support with an ``axis`` is a hinge: rotations across the axis are zero, and the
    rotation about it is free, or ``psi``.  It may turn any number of times, in each step by less
    than 135 degrees.

    Args:
        place: Supported place: on a beam, or the centre of a body.
        u: Displacement along x, or in the direction ``along``; m.
        v: Displacement along y, or to the left of the direction ``along``; m.
        psi: Rotation, in space about ``axis``; rad.
        along: Direction of ``u``, for a support at an angle.
        w: In space, displacement along z, or along the part of ``up`` across ``along``; m.
        up: In space, vector that is upwards for a support at an angle: ``v`` is to the left of
            ``along``, seen from its tip.
        axis: In space, axis of the rotation, fixed in space and in the place.

    Raises:
        ModelError: No component is prescribed; ``along`` or ``axis`` is zero; in space, ``up`` is
            along ``along``, or there is a ``psi`` without axis.

    Example:
        >>> turned = ub.PrescribedDisplacement(
        ...     beam.start, u=0.0, v=0.0, psi=lambda t: np.pi / 2 * t
        ... )
        >>> run = ub.simulate(ub.Scene([beam], supports=[turned]), ub.Static(), t=(0, 1), dt=0.25)
        >>> np.allclose(run.position(beam.end)[-1], (0, 2))
        True
    """

    _: KW_ONLY
    u: Motion | None = None
    v: Motion | None = None
    psi: Motion | None = None
    along: Direction = (1.0, 0.0)
    w: Motion | None = None
    up: Annotated[Any, require_direction] = None
    axis: Annotated[Any, require_direction] = None  # type: ignore[misc]

    def _require_directions(self) -> None:
        _require_components(self, "along", PrescribedDisplacement.along)
        if self.displacements == 2:
            for name in ("w", "up", "axis"):
                if getattr(self, name) is not None:
                    raise ModelError(f"{self}: {name} is for scenes in space")
        else:
            object.__setattr__(self, "up", (0.0, 0.0, 1.0) if self.up is None else self.up)
            for name in ("up", "axis"):
                _require_components(self, name, None)
            if self.psi is not None and self.axis is None:
                raise ModelError(f"{self}: give the axis=(x, y, z) of the rotation psi")
            size = math.hypot(*self.up) * math.hypot(*self.along)
            if np.linalg.norm(np.cross(self.up, self.along)) <= 1e-9 * size:
                raise ModelError(f"{self}: up is along the direction of u; give a vector across it")

    @property
    def angle(self) -> float:  # type: ignore[override]
        """Direction of ``u`` in the plane; rad."""
        return math.atan2(self.along[1], self.along[0]) if self.displacements == 2 else 0.0

    @property
    def turns(self) -> Sequence[tuple[int, int, float]]:
        """See the base class; the rotation is about the last axis."""
        if self.displacements == 2:
            return super().turns
        along = np.array(self.along) / math.hypot(*self.along)
        left = np.cross(self.up, along)
        left /= math.hypot(*left)
        found = successive(np.array([along, left, np.cross(along, left)]))
        if self.axis is not None:
            axis = np.array(self.axis) / math.hypot(*self.axis)
            found += successive(np.array([*across(tuple(axis)), axis]), 3)
        return found

    @cached_property
    def held(self) -> dict[int, TimeFunction]:
        """Functions of time of the prescribed components."""
        components: dict[int, TimeFunction] = {}
        across = (None if self.axis is None else 0.0,) * 2
        in_space = self.displacements == 3
        values = self.u, self.v, *((self.w, *across) if in_space else ()), self.psi
        for component, value in enumerate(values):
            if callable(value):
                components[component] = value
            elif value is not None:
                number = require_number(value, f"{self}: {self.names[component]}")
                components[component] = Constant(number)
        return components


def _require_components(support: Any, name: str, default: object) -> None:
    """Raise :class:`ModelError` unless a direction has the components of the scene.

    The default of the plane becomes the x axis in space.
    """
    given, d = getattr(support, name), support.displacements
    if given is default and d == 3 and default is not None:
        given = (1.0, 0.0, 0.0)
        object.__setattr__(support, name, given)
    if given is not None and np.size(given) != d:
        raise ModelError(f"{support}: {name} = {given} must have {d} components, as the place")


SUPPORTS = Clamped, Pinned, Roller, PrescribedDisplacement
"""All classes of supports."""
