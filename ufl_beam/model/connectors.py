# SPDX-License-Identifier: MIT
"""Connectors: relative motions of two places, with laws of force; plastic hinges."""

from __future__ import annotations

import math
import sys
from abc import ABC
from collections import defaultdict
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import KW_ONLY, dataclass
from functools import cached_property
from operator import add
from typing import Annotated, Any

import numpy as np

from ufl_beam.display import bracketed
from ufl_beam.errors import ModelError
from ufl_beam.model.bodies import (
    AttachmentPoint,
    Node,
    NodeDof,
    Place,
    PlaceField,
    arm,
    merged,
    node,
)
from ufl_beam.model.checks import require_kind, require_point
from ufl_beam.model.connector_law import ConnectorLaw, require_connector_law
from ufl_beam.model.connector_laws import RIGID, HingeLaw, Law, RigidPlastic, Spring
from ufl_beam.model.functions import Point, TimeFunction
from ufl_beam.model.records import Record, Text, Vector


def _require_law(law: Any, what: str) -> None:
    require_kind(law, Law.__args__, what)
    if isinstance(law, ConnectorLaw) and not isinstance(law, Record):
        require_connector_law(law, what)


LawField = Annotated[Law, _require_law]
"""Type of a field with the law of a connector."""

Factors = tuple[float, ...]
"""Derivatives of a relative motion with respect to (u, v, ψ) of a node."""


class Connector(Record, ABC):
    """Relative motion of two places with a force law; base of :class:`Turn` and others.

    The motion is zero in the undeformed scene.  The force of a connector resists growth of the
    motion: it is positive in a spring that is stretched, and negative in a motor that drives.

    Attributes:
        motion: Name of the relative motion in ``relative_motions.MOTIONS``, or "guided".
        a, b: The places.
        law: Law of the force.
        axis: Unit vector, for motions along an axis.
        other: In space, a unit vector that is fixed in ``b``, for the motion "aligning"; zero for
            others.
        corner: Point that moves with the node of ``a`` and replaces place a in the motion, or None.
        name: Name in results and messages, by default made of the class and the places.
        component: Index of the motion in the law of a :class:`Bushing`, otherwise 0.
        components: Connectors of the components of a :class:`Bushing`, otherwise empty.

    Example:
        >>> spring = ub.Slide(ub.ground(2, 0), beam.end, ub.Spring(1e6), axis=(0, 1))
        >>> propped = ub.Scene(
        ...     [beam], supports=scene.supports, loads=scene.loads, connectors=[spring]
        ... )
        >>> run = ub.simulate(propped, ub.Static(), t=(0, 1), dt=1.0)
        >>> history = run.connector(spring)
        >>> np.allclose(history.force, 1e6 * history.motion)
        True
    """

    motion: str
    a: PlaceField
    b: PlaceField
    law: LawField
    axis: Point = (1.0, 0.0)
    other: tuple[float, ...] = ()
    corner: Point | None = None
    name: str = ""
    component: int = 0
    components: tuple[Connector, ...] = ()

    __repr__ = bracketed

    def __post_init__(self) -> None:
        super().__post_init__()
        require_one_dimension(self, (self.a, self.b))
        components = self.law.components if isinstance(self.law, ConnectorLaw) else 1
        if components > 1 and self.kind != "Bushing":
            raise ModelError(
                f"{self}: {type(self.law).__name__} acts on {components} components of a relative "
                "motion; use Bushing(a, b, law)"
            )

    def __str__(self) -> str:
        return self.name or self._label()

    def _label(self) -> str:
        return f"{self.kind}({self.a}, {self.b})"

    def attached_to(self) -> Iterable[AttachmentPoint]:
        """See the base class."""
        return self.a, self.b

    def functions_of_time(self) -> Iterable[TimeFunction]:
        """See the base class."""
        return self.law.functions_of_time() if isinstance(self.law, Record) else ()

    @property
    def kind(self) -> str:
        """Name of the kind of connector in messages."""
        return type(self).__name__

    @property
    def arms(self) -> tuple[Point, Point]:
        """Vectors from both nodes to the points of the connector; m."""
        return arm(self.a, self.corner), arm(self.b)

    @property
    def apart(self) -> Point:
        """Vector from ``corner`` or place a to place b in the undeformed scene; m."""
        pairs = zip(self.corner or self.a.point, self.b.point, strict=True)
        return tuple(b - a for a, b in pairs)  # type: ignore[return-value]

    @property
    def is_rotation(self) -> bool:
        """True if the motion is a rotation, in rad and N m instead of m and N."""
        return self.motion in ("turning", "aligning")

    @property
    def stretches(self) -> bool:
        """True if the motion is a change of the distance between the points."""
        return self.motion == "stretching"

    @property
    def follows_a(self) -> bool:
        """True if the axis turns with the node of ``a``, which then bears a moment."""
        return self.motion == "sliding"

    def rigidly(self) -> tuple[Factors, Factors]:
        """Return the derivatives of the motion by (u, v, ψ) of both nodes, undeformed.

        In space they are derivatives by the displacement and the rotation about x, y and z.
        """
        in_plane = len(self.apart) == 2
        apart, arm_a, arm_b, n = ([*x, 0.0][:3] for x in (self.apart, *self.arms, self.axis))
        if self.stretches:
            n = [x / math.hypot(*apart) for x in apart]
        if self.follows_a:  # the axis turns about a
            arm_a = [*map(add, arm_a, apart)]
        a, b = (*n, *_cross(arm_a, n)), (*n, *_cross(arm_b, n))
        if self.is_rotation:
            axis = n if self.motion == "turning" else _cross(self.other, n)
            a = b = (0.0, 0.0, 0.0, *((0.0, 0.0, 1.0) if in_plane else axis))
        unknowns = (0, 1, 5) if in_plane else range(6)
        return tuple(-a[i] for i in unknowns), tuple(b[i] for i in unknowns)


def _cross(a: Sequence[float], b: Sequence[float]) -> tuple[float, ...]:
    (x, y, z), (u, v, w) = a, b
    return y * w - z * v, z * u - x * w, x * v - y * u


@dataclass(frozen=True, eq=False, repr=False)
class _OfScene(Connector):
    """Base of the connectors of ``Scene(connectors=)``."""

    a: PlaceField
    b: PlaceField
    law: LawField
    _: KW_ONLY
    name: Text = ""


@dataclass(frozen=True, eq=False, repr=False, kw_only=True)
class Turn(_OfScene):
    """Connector of the rotation of ``b`` relative to ``a``: springs, dampers, motors; rad, N m.

    In space, the motion is the component of the rotation vector along an ``axis`` that is fixed in
    both places.  It may be any number of turns about the axis of a joint, such as a
    :class:`Revolute`.  A rotation about other axes must stay below 360 degrees.

    Example:
        >>> soft = ub.Turn(ub.ground(0, 0), beam.start, ub.Spring(1e7))  # N m/rad
        >>> swaying = ub.Scene([beam], supports=[ub.Pinned(beam.start)], connectors=[soft])
        >>> bool(ub.modes(swaying, 1).omega < ub.modes(scene, 1).omega)
        True
    """

    axis: Any = (1.0, 0.0)
    motion = "turning"

    def __post_init__(self) -> None:
        super().__post_init__()
        in_space = len(self.a.point) == 3
        if self.axis is None or in_space == np.array_equal(self.axis, Turn.axis):
            raise ModelError(f"{self}: in space give axis=(x, y, z); in the plane there is none")
        if in_space:
            object.__setattr__(self, "axis", unit_axis(self.a, self.b, self.axis, "Turn"))


@dataclass(frozen=True, eq=False, repr=False, kw_only=True)
class Stretch(_OfScene):
    """Connector of the distance between ``a`` and ``b``: springs, dampers, actuators; m, N.

    Raises:
        ModelError: Both places are at the same point, so that the distance has no direction.

    Example:
        >>> rod = ub.Stretch(ub.ground(2, 1), beam.end, ub.Spring(1e6))
        >>> stayed = ub.Scene([beam], supports=scene.supports, connectors=[rod])
    """

    motion = "stretching"

    def __post_init__(self) -> None:
        super().__post_init__()
        require_apart(self)


@dataclass(frozen=True, eq=False, repr=False, kw_only=True)
class Slide(_OfScene):
    """Connector of the displacement of ``b`` along an axis that turns with ``a``; m, N.

    Args:
        a: Place with which the axis turns; it may be on the ground.
        b: Place that moves along the axis.
        law: Law of the force along the axis.
        axis: Direction in the undeformed scene; from ``a`` to ``b`` by default.
        name: Name in results and messages.

    Raises:
        ModelError: An axis of zero length.

    Example:
        >>> spring = ub.Slide(ub.ground(2, 0), beam.end, ub.Spring(1e6), axis=(0, 1))
        >>> propped = ub.Scene([beam], supports=scene.supports, connectors=[spring])
    """

    axis: Point = None  # type: ignore[assignment]  # replaced by a unit vector
    motion = "sliding"

    def __post_init__(self) -> None:
        super().__post_init__()
        object.__setattr__(self, "axis", unit_axis(self.a, self.b, self.axis, "Slide"))


@dataclass(frozen=True, eq=False, repr=False)
class Bushing(_OfScene):
    """Connector of two or three components of the motion of ``b`` relative to ``a``.

    The first component is the displacement along an axis that turns with ``a``, the second the
    displacement along the normal, 90 degrees counter-clockwise from the axis.  The third, if any,
    is the rotation.  Units are m, m and rad, of forces N, N and N m.  All components are zero in
    the undeformed scene.  Motions and forces in a solution have one column for each component.

    Args:
        a: Place with which the axis turns; it may be on the ground.
        b: Place that moves; it may be at the point of ``a``.
        law: A :class:`ConnectorLaw` with two or three components, such as :class:`Clearance`.
        axis: Direction of the first component in the undeformed scene.
        name: Name in results and messages.

    Raises:
        ModelError: A law of one component, or an axis of zero length.

    Example:
        >>> hole = ub.Clearance(stiffness=1e9, gap=1e-3)  # N/m; m
        >>> pin = ub.Bushing(ub.ground(2, 0), beam.end, hole)
        >>> hung = ub.Scene([beam], supports=scene.supports, loads=scene.loads, connectors=[pin])
        >>> run = ub.simulate(hung, ub.Static(), t=(0, 1), dt=0.1)
        >>> print(np.hypot(*run.connector(pin).motion[-1]).round(3))  # m, to the edge of the hole
        0.001
    """

    law: Annotated[ConnectorLaw, _require_law]
    _: KW_ONLY
    axis: Vector = (1.0, 0.0)
    motion = "sliding"

    def __post_init__(self) -> None:
        super().__post_init__()
        if len(self.a.point) == 3:
            raise ModelError(
                f"{self}: bushings, and so clearances, are for scenes in the plane; in space join "
                "the places by Slide or Turn with an axis, one for each component"
            )
        object.__setattr__(self, "axis", unit_axis(self.a, self.b, self.axis, "Bushing"))
        require_kind(self.law, ConnectorLaw, f"{self}: law")
        if self.law.components == 1:
            raise ModelError(
                f"{self}: {type(self.law).__name__} acts on one component of a relative motion; "
                "use Turn, Stretch or Slide, or give the law components = 2 or 3"
            )

    @cached_property
    def components(self) -> tuple[Connector, ...]:  # type: ignore[override]
        """Connectors of the two or three components."""
        x, y = self.axis
        motions = (("sliding", (x, y)), ("sliding", (-y, x)), ("turning", (x, y)))
        return tuple(
            Component(
                "Bushing", motion, self.a, self.b, self.law, along, component=i, name=self.name
            )
            for i, (motion, along) in enumerate(motions[: self.law.components])
        )


@dataclass(frozen=True, eq=False, repr=False)
class Component(Connector):
    """One relative motion of a joint, a plastic hinge, a bushing or an off-centre point load."""

    owner: str
    motion: str
    a: AttachmentPoint
    b: AttachmentPoint
    law: Law
    axis: Point = (1.0, 0.0)
    corner: Point | None = None
    component: int = 0
    name: str = ""
    other: tuple[float, ...] = ()

    @property
    def kind(self) -> str:
        """Class of the joint, bushing or load in messages, such as "Revolute", or "Hinge"."""
        return self.owner


IN_SPACE = Turn, Stretch, Slide
"""Connectors for scenes in space."""

UNIT_TOLERANCE = 4 * sys.float_info.epsilon
"""Largest round-off error of the length of a unit vector."""


def require_one_dimension(owner: object, places: Iterable[AttachmentPoint]) -> None:
    """Raise :class:`ModelError` if some places are in the plane, and others in space."""
    if len({len(place.point) for place in places}) > 1:
        raise ModelError(
            f"{owner}: some places have two coordinates, and others three; give all points of a "
            "scene in space three coordinates"
        )


def unit_axis(a: AttachmentPoint, b: AttachmentPoint, axis: Point | None, kind: str) -> Point:
    """Return the unit vector along ``axis``, by default along the line from ``a`` to ``b``."""
    require_one_dimension(f"{kind}({a}, {b})", (a, b))
    along = tuple(y - x for x, y in zip(a.point, b.point, strict=True))
    given: Any = along if axis is None else require_point(axis, f"{kind}: axis")
    if len(given) != len(along):
        raise ModelError(
            f"{kind}({a}, {b}): axis = {given} must have {len(along)} components, as the points"
        )
    length = math.hypot(*given)
    if length == 0.0:
        raise ModelError(
            f"{kind}({a}, {b}): the axis has zero length; give axis = (x, y), a direction in the "
            "undeformed scene"
        )
    if abs(length - 1.0) <= UNIT_TOLERANCE:  # axes from files must not change
        return tuple(given)
    return tuple(x / length for x in given)


def axes_of(point: Sequence[float]) -> list[tuple[float, ...]]:
    """Return the unit vectors along the axes of the plane, or of space."""
    return [tuple(float(i == k) for i in range(len(point))) for k in range(len(point))]


def across(axis: Sequence[float]) -> tuple[tuple[float, ...], tuple[float, ...]]:
    """Return two unit vectors in space that are normal to a unit vector, and to each other."""
    n = np.array(axis)
    p = np.cross(n, np.eye(3)[np.argmin(np.abs(n))])
    p /= np.linalg.norm(p)
    return tuple(p.tolist()), tuple(np.cross(n, p).tolist())


def require_apart(connector: Connector) -> None:
    """Raise :class:`ModelError` if both ends of a connector are at the same point."""
    if math.hypot(*connector.apart) == 0.0:
        raise ModelError(
            f"{connector}: zero length, both ends are at the same point; join them with Revolute, "
            "use Slide with an axis, or Bushing(a, b, Clearance(...)) for a pin in a round hole"
        )


# -- plastic hinges of zero length --------------------------------------------------------------


def plastic_hinges(
    may_have: Mapping[Place, HingeLaw],  # laws of all possible hinges of beams
    rigid: Iterable[Sequence[NodeDof]],  # groups of rotations that joints make equal
    bearing: Iterable[tuple[AttachmentPoint, Any]],  # where supports, connectors or masses bear
    # moments, with the axis about which they bear none, or None
    loaded: Iterable[AttachmentPoint],  # places of loads with a moment
) -> tuple[Connector, ...]:
    """Return plastic hinges of zero length as connectors, whose motions are jumps of rotation.

    Possible hinges are ``Beam(hinges=)``, and ``Section(hinge=)`` at both ends of a beam.  A hinge
    at an end is left out if the end bears no moment, or only the moment of a load.  Nothing outside
    of such a hinge could bear this moment, so the load acts on the beam.  If a joint connects two
    beams and no other part at it bears a moment, both beams bear the same moment.  Then the hinge
    of the stronger beam is left out if the moment of the weaker hinge never exceeds its limit.

    In space a hinge is about axis 3 of the section, and connectors before the hinges hold the other
    rotations.  It is left out at an end without a moment about this axis, but not for a weaker one,
    whose axis may be another one.
    """
    laws = {place: law for place, law in may_have.items() if law.opens}
    if not laws:
        return ()
    same = merged(rigid)
    members: dict[NodeDof, list[Node]] = {}
    for dof in {*same, *same.values()}:
        members.setdefault(same[dof], []).append(dof[0])

    acted, borne = {same[node(place), 2] for place in loaded}, defaultdict[NodeDof, list[Any]](list)
    for at, free in bearing:
        borne[same[node(at), 2]].append(free)

    def stays(place: Place, axis: Point) -> bool:
        if 0.0 < place.s < 1.0:
            return True
        dof = same[place, 2]
        others = [x for x in members.get(dof, ()) if x != place]
        between = len(others) > 0 and (dof in acted or not _never_opens(place, others, laws))
        return between or any(
            free is None or np.hypot.reduce(np.cross(free, axis)) > 1e-12 * math.hypot(*free)
            for free in borne[dof]
        )

    hinges, holders = list[Connector](), list[Connector]()
    for place, law in laws.items():
        axis = Component.axis if len(place.point) == 2 else place.beam.third_axis(place.s)
        if stays(place, axis):
            beyond = Place(place.beam, place.s, beyond=True)
            before, after = (beyond, place) if place.s == 1.0 else (place, beyond)
            hinges.append(Component("Hinge", "turning", before, after, RigidPlastic(law), axis))
            normals: Sequence[Point] = across(axis) if len(axis) == 3 else ()
            holders += [
                Component("Hinge", "aligning", before, after, RIGID, normal, other=axis)
                for normal in normals
            ]
    return (*holders, *hinges)


def can_yield(connector: Connector) -> bool:
    """Return whether the law of a rotation, alone or in a :class:`Bushing`, may yield or break."""
    law = connector.law
    if not (connector.components or (connector,))[-1].is_rotation:
        return False
    if isinstance(law, Spring):
        return law.law is not None or law.softening is not None
    if isinstance(law, ConnectorLaw):
        return bool(law.variables) and law.entry not in ("damping", "friction", "contact")
    return isinstance(law, RigidPlastic)


def law_of(connector: Connector) -> HingeLaw:
    """Return the law of a plastic hinge or of another rigid-plastic connector."""
    assert isinstance(connector.law, RigidPlastic)
    return connector.law.law


def place_of(hinge: Connector) -> Place:
    """Return the place of a plastic hinge, on the side to which joints and loads are attached."""
    assert isinstance(hinge.a, Place)
    assert isinstance(hinge.b, Place)
    return hinge.b if hinge.a.beyond else hinge.a


def _never_opens(place: Place, others: Sequence[Node], laws: Mapping[Place, HingeLaw]) -> bool:
    """Return whether a hinge never opens, because the only other beam at the joint yields first.

    Of two bounded laws with the same limit, the first in ``laws`` counts as the weaker one.
    """
    if len(others) > 1 or not isinstance(others[0], Place) or others[0] not in laws:
        return False
    if len(place.point) == 3:
        return False
    own, next_law, order = laws[place], laws[others[0]], list(laws)
    if own.limit == next_law.limit and own.bounded and next_law.bounded:
        return order.index(others[0]) < order.index(place)
    return next_law.bounded and next_law.limit <= own.limit
