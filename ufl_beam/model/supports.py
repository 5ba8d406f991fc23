# SPDX-License-Identifier: MIT
"""Supports: fixed or prescribed components of the motion of a place."""

from __future__ import annotations

import math
from abc import ABC, abstractmethod
from collections.abc import Iterable
from dataclasses import KW_ONLY, dataclass
from functools import cached_property
from typing import Annotated, ClassVar

from ufl_beam.display import bracketed
from ufl_beam.errors import ModelError
from ufl_beam.model.bodies import NodeField
from ufl_beam.model.checks import require_number, require_vector
from ufl_beam.model.connector_laws import Bearing
from ufl_beam.model.functions import Constant, TimeFunction, require_time_function, still
from ufl_beam.model.records import Record

COMPONENTS = ("u", "v", "psi")

Motion = float | TimeFunction


def require_direction(direction: object, what: str) -> tuple[float, float]:
    """Return ``direction`` as a vector that is not zero, or raise."""
    x, y = require_vector(direction, what)
    if x == y == 0.0:
        raise ModelError(f"{what} = (0, 0) is no direction")
    return x, y


Direction = Annotated[tuple[float, float], require_direction]


@dataclass(frozen=True, eq=False, repr=False)
class Support(Bearing, Record, ABC):
    """Fixed or prescribed motion of a place; base of :class:`Clamped` and other supports.

    Attributes:
        place: Supported place: on a beam, or the centre of a body.
        held: Functions of time of the prescribed components: 0 and 1 are displacements in axes
            turned by ``angle`` (m), 2 is the rotation (rad).
        angle: Angle from the x axis to the axis of component 0; rad.

    Example:
        >>> foot = ub.Clamped(beam.start)
        >>> held = ub.Scene([beam], supports=[foot], loads=scene.loads)
        >>> run = ub.simulate(held, ub.Static(), t=(0, 1), dt=0.5)
        >>> print(run.reaction(foot)[-1, 1].round())  # N
        100000.0
    """

    place: NodeField
    angle: ClassVar[float] = 0.0

    __repr__ = bracketed

    def functions_of_time(self) -> Iterable[TimeFunction]:
        """See the base class."""
        return self.held.values()

    @property
    @abstractmethod
    def held(self) -> dict[int, TimeFunction]:
        """Functions of time of the prescribed components."""

    def __post_init__(self) -> None:
        super().__post_init__()
        if not self.held:
            raise ModelError(f"{self} holds nothing; give at least one of u, v, psi")
        for component, value in self.held.items():
            require_time_function(value, f"{self}, {COMPONENTS[component]}")

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

    held: ClassVar = {0: still, 1: still, 2: still}


class Pinned(Support):
    """Pinned support: holds the displacement; the place turns freely.

    Example:
        >>> support = ub.Pinned(beam.start)
        >>> sorted(support.held)  # both components of the displacement
        [0, 1]
    """

    held: ClassVar = {0: still, 1: still}


@dataclass(frozen=True, eq=False, repr=False)
class Roller(Support):
    """Roller support: holds the displacement across ``along``; the place rolls and turns freely.

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

    @property
    def held(self) -> dict[int, TimeFunction]:
        """Displacement across ``along``, fixed at zero."""
        return {0 if self.along[0] == 0.0 else 1: still}

    @property
    def angle(self) -> float:  # type: ignore[override]
        """Direction in which the place rolls, or 0 if it rolls along x or y; rad."""
        return math.atan2(self.along[1], self.along[0]) if all(self.along) else 0.0


@dataclass(frozen=True, eq=False, repr=False)
class PrescribedDisplacement(Support):
    """Prescribed motion of a place by numbers or functions of time, such as a settlement.

    A number is the value from the first step on, also in statics.  For a motion that grows in time
    give a function such as ``lambda t: 0.1 * t``.  Components without a value are free.  The work
    of moving supports is the entry "supports" of ``energy.supplied``.

    Args:
        place: Supported place: on a beam, or the centre of a body.
        u: Displacement along x, or in the direction ``along``; m.
        v: Displacement along y, or to the left of the direction ``along``; m.
        psi: Rotation; rad.
        along: Direction of ``u``, for a support at an angle.

    Raises:
        ModelError: No component is prescribed, or ``along`` is zero.

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

    @property
    def angle(self) -> float:  # type: ignore[override]
        """Direction of ``u``; rad."""
        return math.atan2(self.along[1], self.along[0])

    @cached_property
    def held(self) -> dict[int, TimeFunction]:
        """Functions of time of the prescribed components."""
        components: dict[int, TimeFunction] = {}
        for component, value in enumerate((self.u, self.v, self.psi)):
            if callable(value):
                components[component] = value
            elif value is not None:
                number = require_number(value, f"{self}: {COMPONENTS[component]}")
                components[component] = Constant(number)
        return components
