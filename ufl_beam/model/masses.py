# SPDX-License-Identifier: MIT
"""Point masses and initial velocities."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Annotated

from ufl_beam.errors import SceneError, require_sequence, require_vector, shorten
from ufl_beam.model.bodies import Anchor, Body, Member, require_node
from ufl_beam.model.curves import Point
from ufl_beam.model.records import NotNegative, Number, Record, Vector


@dataclass(frozen=True, eq=False)
class PointMass(Record):
    """Point mass, with rotary inertia, fixed to a place.

    Args:
        place: Where.
        mass: kg.
        inertia: About the place; kg m².

    Example:
        >>> heavy = ub.Scene([beam], [], scene.supports, masses=[ub.PointMass(beam.end, 300.0)])
        >>> bool(ub.modes(heavy, 1).omega < ub.modes(scene, 1).omega)
        True
    """

    place: Anchor
    mass: NotNegative
    inertia: NotNegative = 0.0

    def __post_init__(self) -> None:
        require_node(self.place, "PointMass")
        super().__post_init__()

    def _label(self) -> str:
        return f"PointMass at {self.place}"


@dataclass(frozen=True, eq=False)
class Velocity(Record):
    """Initial velocity of beams and bodies that move as one rigid body.

    Args:
        beams: The beams and bodies that move so.
        linear: Velocity of the point ``about``; m/s.
        angular: Angular velocity; rad/s.
        about: Point of the undeformed scene, by default the origin; m.

    Example:
        >>> spin = ub.Velocity((beam,), linear=(1.0, 0.0), angular=2.0)
        >>> spin.at(0.0, 3.0)  # of the point (0, 3); m/s, m/s, rad/s
        (-5.0, 0.0, 2.0)
    """

    beams: tuple[Member | Body, ...]
    linear: Vector = (0.0, 0.0)
    angular: Number = 0.0
    about: Annotated[Point | None, require_vector] = None

    def __post_init__(self) -> None:
        object.__setattr__(self, "beams", require_sequence(self.beams, "Velocity: beams"))
        for i, beam in enumerate(self.beams):
            if not isinstance(beam, Member | Body):
                raise SceneError(f"Velocity: beams[{i}] = {shorten(beam)} is not a Beam or Body")
        super().__post_init__()

    def at(self, x: float, y: float) -> tuple[float, float, float]:
        """(du/dt, dv/dt, dψ/dt) of the point (x, y); m/s, m/s, rad/s."""
        about_x, about_y = self.about or (0.0, 0.0)
        return (
            self.linear[0] - self.angular * (y - about_y),
            self.linear[1] + self.angular * (x - about_x),
            self.angular,
        )
