# SPDX-License-Identifier: MIT
"""Rigid bodies, the ground, attachment points, point masses, initial velocities."""

from __future__ import annotations

import math
from abc import ABC
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import KW_ONLY, dataclass
from functools import partial
from itertools import pairwise
from typing import Annotated, Any, ClassVar

import numpy as np

from ufl_beam.display import at_point, bracketed
from ufl_beam.errors import ModelError, shorten
from ufl_beam.model import checks
from ufl_beam.model.functions import Curve, Point, tangent_within
from ufl_beam.model.records import NotNegative, Record, Text, VectorOfScene, require_moment

TOGETHER = 1e-9  # largest distance at which two places of a beam coincide, as a fraction of a cell


class Member(ABC):
    """Base of :class:`Beam`: the attributes of a beam, and the places on its axis."""

    called: ClassVar[str] = "Beam"  # name of the class in messages
    name: str
    curve: Curve
    cells: int
    corners: tuple[float, ...]
    hinges: Mapping[float, Any]
    section: Any

    def at(self, s: float) -> Place:
        """Return the place at the parameter ``s`` of the axis, 0 at the start and 1 at the end.

        On straight beams, arcs and polylines ``s`` is the fraction of the length from the start.
        """
        return Place(self, s)

    @property
    def start(self) -> Place:
        """Place at the start, ``s = 0``."""
        return Place(self, 0.0)

    @property
    def end(self) -> Place:
        """Place at the end, ``s = 1``."""
        return Place(self, 1.0)

    def vertices(self, attached: Sequence[float]) -> list[float]:
        """Return the parameters of all vertices: ends of equal cells, corners, ``attached`` places.

        A place within :data:`TOGETHER` of another vertex adds no vertex.
        """
        regular = [i / self.cells for i in range(self.cells + 1)]
        if not {*self.corners, *attached} - {0.0, 1.0}:
            return regular
        coordinates = [0.0]
        for s in sorted({*regular, *self.corners, *attached})[1:]:
            if (s - coordinates[-1]) * self.cells > TOGETHER:
                coordinates.append(s)
        coordinates[-1] = 1.0
        return coordinates


Beams = Annotated[Sequence[Member] | None, partial(checks.require_all, kind=Member)]
"""Type of a field with beams; None stands for all beams of the scene."""


@dataclass(frozen=True, slots=True)
class Place:
    """A point of a beam; made by ``beam.start``, ``beam.end`` and ``beam.at(s)``.

    Attributes:
        beam: The beam, compared by identity.
        s: Parameter of the axis, from 0 to 1.
        beyond: True for the cross-section on the far side of the plastic hinge at ``s``; joints,
            supports and loads are attached to the near side.

    Example:
        >>> middle = beam.at(0.5)
        >>> print(middle.point, middle.direction)
        (1.0, 0.0) (1.0, 0.0)
        >>> print((1e3 * solution.displacement(middle)[-1, 1:]).round(1))  # mm, mrad
        [ -5.9 -10.7]
    """

    beam: Member
    s: float
    beyond: bool = False

    __repr__ = bracketed

    def __post_init__(self) -> None:
        if not isinstance(self.beam, Member):
            raise ModelError(f"Place: {shorten(self.beam)} is not a Beam")
        checks.require_number(self.s, f"{self.beam.name}.at(s): s")
        if not 0.0 <= self.s <= 1.0:
            raise ModelError(f"{self.beam.name}.at({self.s:g}): s must lie between 0 and 1")
        checks.require_switch(self.beyond, f"{self.beam.name}.at({self.s:g}): beyond")

    @property
    def point(self) -> Point:
        """Coordinates in the undeformed scene; m."""
        return tuple(map(float, self.beam.curve(self.s)))  # type: ignore[return-value]

    @property
    def direction(self) -> Point:
        """Unit tangent of the undeformed axis; at a corner the mean direction of both sides."""
        edges = sorted({0.0, *self.beam.corners, 1.0})
        sides = [
            tangent_within(self.beam.curve, self.s, low, high)
            for low, high in pairwise(edges)
            if low <= self.s <= high
        ]
        first, *others = (side / math.hypot(*side) for side in sides)
        whole = sum(others, first)
        return tuple(map(float, whole / math.hypot(*whole)))  # type: ignore[return-value]

    def __str__(self) -> str:
        ends = {0.0: "start", 1.0: "end"}
        name = f"{self.beam.name}.{ends.get(self.s, f'at({self.s:g})')} {at_point(self.point)}"
        return f"{name} beyond the hinge" if self.beyond else name


def require_inertia_of_body(value: Any, what: str) -> Any:
    """Return the inertia of a body: a number, or moments or a tensor in space."""
    if np.ndim(value) == 0:
        return checks.require_number(value, what, at_least=0.0)
    given = checks.require_array(value, what)
    tensor = np.diag(given) if given.shape == (3,) else given
    if tensor.shape != (3, 3) or not np.allclose(tensor, tensor.T, rtol=1e-12):
        raise ModelError(f"{what} must be three moments, or a symmetric 3 x 3 matrix")
    a, b, c = np.linalg.eigvalsh(tensor)
    if a < -1e-12 * c or c > (a + b) * (1 + 1e-9):
        raise ModelError(
            f"{what} has the principal moments {a:.6g}, {b:.6g}, {c:.6g} kg m²; no body has them: "
            "none is negative, and the largest is at most the sum of the others"
        )
    rows: Any = tensor.tolist()
    return tuple(map(tuple, rows)) if given.ndim == 2 else tuple(map(float, given))


@dataclass(frozen=True, eq=False)
class Body(Record):
    """Rigid body; joints, connectors and point loads may act at any of its points.

    Args:
        center: Centre of mass in the undeformed scene; m.
        mass: Mass; kg.
        inertia: Moment of inertia about the centre of mass; in space the moments about axes along
            x, y and z of the undeformed scene, or a symmetric 3 x 3 matrix; kg m².
        name: Name in messages and pictures.

    Raises:
        ModelError: Coordinates that are not finite, or a negative mass or inertia.

    Example:
        >>> rotor = ub.Body((2, 0), mass=50.0, inertia=4.0, name="rotor")
        >>> joint = ub.Revolute(beam.end, rotor.at(2, 0))
        >>> print(joint)
        Revolute(beam.end (2, 0), rotor (2, 0))
    """

    center: VectorOfScene
    _: KW_ONLY
    mass: NotNegative = 0.0
    inertia: Annotated[Any, require_inertia_of_body] = 0.0
    name: Text = "body"

    def __post_init__(self) -> None:
        super().__post_init__()
        if np.ndim(self.inertia) and len(self.center) == 2:
            raise ModelError(f"{self.name}: inertia in the plane is a number")

    @property
    def tensor(self) -> tuple[tuple[float, ...], ...]:
        """Tensor of inertia in space; kg m²."""
        given = np.asarray(self.inertia, dtype=float)
        rows: Any = given if given.ndim == 2 else given * np.eye(3)
        return tuple(tuple(map(float, row)) for row in rows)

    def _label(self) -> str:
        return self.name

    def at(self, x: float, y: float, *z: float) -> BodyPoint:
        """Return the point of the body that is at (x, y) in the undeformed scene; m.

        In space it has a third coordinate.
        """
        return BodyPoint(self, (x, y, *z))  # type: ignore[arg-type]

    @property
    def middle(self) -> BodyPoint:
        """The centre of mass."""
        return BodyPoint(self, self.center)


@dataclass(frozen=True)
class BodyPoint:
    """A point of a rigid body; made by ``body.at(x, y)``, ``body.middle`` and :func:`ground`.

    Attributes:
        body: The body, compared by identity.
        point: Coordinates in the undeformed scene; m.

    Example:
        >>> wheel = ub.Body((0, 0), mass=10.0, inertia=0.5, name="wheel")
        >>> rim = wheel.at(0.3, 0.0)
        >>> print(rim)
        wheel (0.3, 0)
    """

    body: Body
    point: Point

    __repr__ = bracketed

    def __post_init__(self) -> None:
        checks.require_kind(self.body, Body, "BodyPoint: body")
        point = checks.require_point(self.point, f"{self.body.name}.at(x, y)")
        if self.body is not GROUND and len(point) != len(self.body.center):
            raise ModelError(
                f"{self.body.name}.at{point}: the centre has {len(self.body.center)} coordinates; "
                "give as many"
            )
        object.__setattr__(self, "point", point)

    def __str__(self) -> str:
        return f"{self.body.name} {at_point(self.point)}"


GROUND = Body((0.0, 0.0), name="ground")
"""The body that does not move."""


def ground(x: float, y: float, *z: float) -> BodyPoint:
    """Return the point (x, y), in space (x, y, z), of the ground; m.

    Example:
        >>> pivot = ub.Revolute(ub.ground(0, 0), beam.start)
        >>> pendulum = ub.Scene([beam], joints=[pivot], loads=[ub.Gravity()])
    """
    return BodyPoint(GROUND, (x, y, *z))  # type: ignore[arg-type]


AttachmentPoint = Place | BodyPoint
"""Attachment point of a joint, support, load, mass or connector."""

Node = Place | Body
"""Place of a beam, or a body; each has a displacement and a rotation."""

NodeDof = tuple[Node, int]
"""Degree of freedom of a node: components 0 and 1 are the displacement, 2 is the rotation."""


class Representatives(dict[NodeDof, NodeDof]):
    """Representatives of groups of equal degrees of freedom; others represent themselves."""

    def __missing__(self, dof: NodeDof) -> NodeDof:
        return dof


def merged(groups: Iterable[Sequence[NodeDof]]) -> Representatives:
    """Return a representative for each set of degrees of freedom that ``groups`` make equal."""
    found = Representatives()

    def root(dof: NodeDof) -> NodeDof:
        while (above := found[dof]) is not dof:
            dof = above
        return dof

    for first, *others in groups:
        base = root(first)
        for x in others:
            if (other := root(x)) != base:
                found[other] = base
    return Representatives((dof, root(above)) for dof, above in found.items())


def node(place: AttachmentPoint) -> Node:
    """Return the node of an attachment point: the place itself on a beam, otherwise the body."""
    return place.body if isinstance(place, BodyPoint) else place


def base_of(member: Member | Body) -> AttachmentPoint:
    """Return the place to which rigid motions refer: start of a beam, or centre of a body."""
    return member.middle if isinstance(member, Body) else member.start


def arm(place: AttachmentPoint, point: Point | None = None) -> Point:
    """Return the vector from the node of a place to a point, by default the place itself; m.

    The vector is zero for points of the ground, which do not move.
    """
    if node(place) is GROUND or (point is None and isinstance(place, Place)):
        return (0.0,) * len(place.point)  # type: ignore[return-value]
    at = point or place.point
    of_node = place.body.center if isinstance(place, BodyPoint) else place.point
    return tuple(x - n for x, n in zip(at, of_node, strict=True))


def moves_with_node(place: AttachmentPoint) -> bool:
    """Return whether a place always has the displacement of its node."""
    return not any(arm(place))


def require_place(place: Any, what: str) -> None:
    """Raise :class:`ModelError` unless ``place`` is an attachment point."""
    if not isinstance(place, Place | BodyPoint):
        raise ModelError(
            f"{what} = {shorten(place)} is not a place; use beam.start, .end or .at(s), "
            "body.at(x, y) or ground(x, y)"
        )


def require_node(place: Any, what: str) -> None:
    """Raise :class:`ModelError` unless a place is on a beam or the centre of a moving body."""
    require_place(place, what)
    if isinstance(place, BodyPoint) and place.body is GROUND:
        raise ModelError(f"{what} = {place} does not move")
    if not moves_with_node(place):
        raise ModelError(
            f"{what} = {place} is not the centre of the body; hold other points by joints to "
            "ground(x, y), and give masses to the body itself"
        )


PlaceField = Annotated[AttachmentPoint, require_place]
"""Type of a field with an attachment point."""

NodeField = Annotated[AttachmentPoint, require_node]
"""Type of a field with a place on a beam, or with the centre of a moving body."""


# -- point masses, initial velocities -----------------------------------------------------------


@dataclass(frozen=True, eq=False)
class PointMass(Record):
    """Point mass, with rotary inertia, fixed to a place.

    Args:
        place: Place to which the mass is fixed: on a beam, or the centre of a body.
        mass: Mass; kg.
        inertia: Rotary inertia about the place, in the plane; kg m².

    Example:
        >>> heavy = ub.Scene(
        ...     [beam], supports=scene.supports, masses=[ub.PointMass(beam.end, 300.0)]
        ... )
        >>> bool(ub.modes(heavy, 1).omega < ub.modes(scene, 1).omega)
        True
    """

    place: NodeField
    mass: NotNegative
    inertia: NotNegative = 0.0

    def _label(self) -> str:
        return f"PointMass at {self.place}"


@dataclass(frozen=True, eq=False)
class Velocity(Record):
    """Initial velocity of beams and bodies that move as one rigid body.

    Args:
        beams: The beams and bodies with this velocity.
        linear: Velocity of the point ``about``; m/s.
        angular: Angular velocity, in space a vector; rad/s.
        about: Point of the undeformed scene, by default the origin; m.

    Example:
        >>> spin = ub.Velocity((beam,), linear=(1.0, 0.0), angular=2.0)
        >>> spin.at(0.0, 3.0)  # of the point (0, 3); m/s, m/s, rad/s
        (-5.0, 0.0, 2.0)
    """

    beams: Annotated[tuple[Member | Body, ...], partial(checks.require_all, kind=(Member, Body))]
    linear: VectorOfScene = (0.0, 0.0)
    angular: Annotated[Any, require_moment] = 0.0
    about: Annotated[Any, checks.require_point] = None

    def attached_to(self) -> Iterable[AttachmentPoint]:
        """See the base class."""
        return map(base_of, self.beams)

    def at(self, x: float, y: float, *z: float) -> tuple[float, ...]:
        """Return (du/dt, dv/dt, dψ/dt) of the point (x, y); m/s, m/s, rad/s; in space six rates."""
        if z:
            arm = np.subtract((x, y, *z), (*(self.about or ()), 0.0, 0.0, 0.0)[:3])
            spin = np.broadcast_to(self.angular, 3)  # it may be the default of the plane
            return *((*self.linear, 0.0)[:3] + np.cross(spin, arm)), *spin
        about_x, about_y = self.about or (0.0, 0.0)
        return (
            self.linear[0] - self.angular * (y - about_y),
            self.linear[1] + self.angular * (x - about_x),
            self.angular,
        )
