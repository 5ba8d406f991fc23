# SPDX-License-Identifier: MIT
"""What may act between two places: relative motions, and the laws that they follow."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import KW_ONLY, dataclass, field
from numbers import Real
from typing import TYPE_CHECKING, NamedTuple

from ufl_beam.beams import Curve, Place, Point, point_of
from ufl_beam.bodies import Anchor, arm, carries, ground, require_anchor
from ufl_beam.errors import (
    SceneError,
    require_function,
    require_kind,
    require_number,
    require_returned,
    require_switch,
    require_text,
    require_vector,
)
from ufl_beam.laws import Hardening, HingeLaw, Softening, require_hinge_law
from ufl_beam.loads import TimeFunction, require_time_function

if TYPE_CHECKING:
    from ufl_beam.simulation import Simulation

# -- laws --------------------------------------------------------------------------------------


@dataclass(frozen=True)
class Motor:
    """The motion is given; the force that it takes is found.

    Args:
        motion: In time; m or rad.  Zero, which joints use, holds it.
    """

    motion: TimeFunction

    def __post_init__(self) -> None:
        require_time_function(self.motion, "Motor")


@dataclass(frozen=True)
class Actuator:
    """The force is given; a positive one makes the motion grow.

    Args:
        force: In time; N or N m.
    """

    force: TimeFunction

    def __post_init__(self) -> None:
        require_time_function(self.force, "Actuator")


@dataclass(frozen=True)
class Controller:
    """The force is what a function says at the beginning of each step, and constant during it.

    Args:
        force: ``force(simulation)``; N or N m; a positive one makes the motion grow.  It may ask
            the simulation for its time, motions, velocities and the forces of joints.
    """

    force: Callable[[Simulation], float]

    def __post_init__(self) -> None:
        require_function(self.force, "Controller: force", "the simulation")

    def ask(self, simulation: Simulation, link: Connector) -> float:
        """Evaluate the force of ``link`` in the next step; all processes call it together."""
        at = f"t = {simulation.t:.9g} s"
        return require_returned(self.force(simulation), f"{link}: the controller", at)


@dataclass(frozen=True)
class Spring:
    """A spring, which may yield and break.

    Args:
        stiffness: N/m or N m/rad.
        law: How it yields; limit in N or N m, moduli as the stiffness.
        softening: How it breaks; energy in J.

    Raises:
        SceneError: A stiffness that is not positive.
    """

    stiffness: float
    law: Hardening | None = None
    softening: Softening | None = None

    def __post_init__(self) -> None:
        require_number(self.stiffness, "Spring: stiffness", positive=True)
        if self.law is not None:
            require_kind(self.law, Hardening, "Spring: law")
        if self.softening is not None:
            require_kind(self.softening, Softening, "Spring: softening")


@dataclass(frozen=True)
class Damper:
    """A force in proportion to the rate of the motion.

    Args:
        viscosity: N s/m or N m s/rad.
    """

    viscosity: float

    def __post_init__(self) -> None:
        require_number(self.viscosity, "Damper: viscosity", positive=True)


@dataclass(frozen=True)
class Stop:
    """Contact where the motion leaves an interval; free inside.

    Args:
        low, high: Ends of the interval; m or rad.
        stiffness: Of the contact; N/m or N m/rad.

    Raises:
        SceneError: An interval that does not contain the undeformed scene, or no stiffness.
    """

    stiffness: float
    _: KW_ONLY
    low: float = -math.inf
    high: float = math.inf

    def __post_init__(self) -> None:
        require_number(self.stiffness, "Stop: stiffness", positive=True)
        for name, end in (("low", self.low), ("high", self.high)):
            if not isinstance(end, Real) or abs(end) != math.inf:
                require_number(end, f"Stop: {name}")
        if not self.low <= 0.0 <= self.high or (math.isinf(self.low) and math.isinf(self.high)):
            raise SceneError(
                f"Stop: the interval from low = {self.low:g} to high = {self.high:g} must contain "
                "0, the undeformed scene, and have at least one end"
            )


@dataclass(frozen=True)
class Function:
    """A force that a function of the motion and its rate gives, as a spring or damper would.

    Args:
        force: ``force(motion, rate)``; arrays or numbers; N or N m; a positive one resists growth.
            It is asked for the middle of the step.  What it takes is the entry "functions" of the
            ledger, because nobody knows what it stores.
    """

    force: Callable[[float, float], float]

    def __post_init__(self) -> None:
        require_function(self.force, "Function: force", "(motion, rate)")


class Bearing:
    """Base of joints and supports: their force may press on places that rub."""


@dataclass(frozen=True)
class Coulomb:
    """Dry friction: no motion up to a limit, and the limit against the motion beyond it.

    The limit is ``force`` and ``coefficient`` times the force of a joint at the end of the step
    before.  There is no stiffness of sticking: the motion stops exactly, with its velocity.

    Args:
        force: Limit whatever the joint bears; N or N m.
        coefficient: Coefficient of friction; for rotations times the radius of the pin; 1 or m.
        joint: The joint or support whose force presses.  Joints must be ``measured``, or hold
            their places with forces anyway, as :func:`Prismatic` and :func:`Link` do.

    Raises:
        SceneError: No limit, or a coefficient without a joint.
    """

    force: float = 0.0
    _: KW_ONLY
    coefficient: float = 0.0
    joint: Bearing | None = None

    def __post_init__(self) -> None:
        require_number(self.force, "Coulomb: force", at_least=0.0)
        require_number(self.coefficient, "Coulomb: coefficient", at_least=0.0)
        if self.force == self.coefficient == 0.0:
            raise SceneError("Coulomb: force and coefficient are both zero; leave it out")
        if (self.coefficient > 0) != (self.joint is not None):
            raise SceneError("Coulomb: give coefficient and joint together")
        if self.joint is not None:
            require_kind(self.joint, Bearing, "Coulomb: joint")

    def ask(self, simulation: Simulation, link: Connector) -> float:
        """Return the limit of the next step; all processes call it together."""
        if self.joint is None:
            return self.force
        return self.force + self.coefficient * simulation.press(self.joint)  # type: ignore[arg-type]


@dataclass(frozen=True)
class RigidPlastic:
    """No motion up to the limit of a law, which the motion follows beyond it.

    There is no elastic stiffness: below the limit the motion is held exactly.  Plastic hinges of
    beams, ``Beam(hinges={s: law})``, are rotations with this law.

    Args:
        law: :class:`Softening` or :class:`Hardening`; limit in N m or N, moduli in N m/rad or N/m,
            fracture energy in J.

    Raises:
        SceneError: A law of another kind, or one that relaxes an elastic stress.
    """

    law: HingeLaw

    def __post_init__(self) -> None:
        require_hinge_law(self.law, "RigidPlastic: law")


@dataclass(frozen=True)
class Guide:
    """The point stays on a curve of the plane, free along it; see :func:`Guided`.

    Args:
        curve: ``s -> (x, y)``, smooth, for all s that the motion may reach; m.
    """

    curve: Curve

    def __post_init__(self) -> None:
        require_function(self.curve, "Guide: curve", "s that returns (x, y)")


Law = (
    Guide
    | Motor
    | Actuator
    | Controller
    | Spring
    | Damper
    | Stop
    | Function
    | Coulomb
    | RigidPlastic
)


def _still(t: float) -> float:
    return 0.0


HELD = Motor(_still)
"""The law of what a joint holds."""


# -- relative motions --------------------------------------------------------------------------


class Rigidly(NamedTuple):
    """How a relative motion grows with the motions (u, v, ψ) of both nodes in the undeformed scene.

    Attributes:
        a, b: Factors; (3,) each.
    """

    a: tuple[float, float, float]
    b: tuple[float, float, float]


@dataclass(frozen=True, eq=False)
class Connector:
    """A relative motion of two anchors that follows a law; made by :func:`Turn` and its siblings.

    The motion is zero in the undeformed scene.  The force of a connector resists its growth: it is
    positive in a spring that is stretched, and negative in a motor that drives.

    Attributes:
        kind: Name for messages.
        motion: Which relative motion; a name of ``relative.MOTIONS``.
        a, b: The anchors.
        law: What it follows.
        axis: Unit vector, for motions along one.
        corner: The point of frame a that is meant, if it is not that of the anchor.
    """

    kind: str
    motion: str
    a: Anchor
    b: Anchor
    law: Law
    axis: Point = (1.0, 0.0)
    corner: Point | None = None

    def __post_init__(self) -> None:
        for anchor in (self.a, self.b):
            require_anchor(anchor, self.kind)
        require_kind(self.law, Law.__args__, f"{self}: law")

    def __str__(self) -> str:
        return f"{self.kind}({self.a}, {self.b})"

    @property
    def holds(self) -> bool:
        """Whether the law may demand a motion, whatever force that takes."""
        return isinstance(self.law, Motor | Coulomb | Guide | RigidPlastic)

    @property
    def arms(self) -> tuple[Point, Point]:
        """From both nodes to the points that are meant; m."""
        return arm(self.a, self.corner), arm(self.b)

    @property
    def apart(self) -> Point:
        """From the point of a to the point of b in the undeformed scene; m."""
        (ax, ay), (bx, by) = self.corner or self.a.point, self.b.point
        return bx - ax, by - ay

    @property
    def turns(self) -> bool:
        """Whether the motion is a rotation: rad and N m in the place of m and N."""
        return self.motion == "turning"

    def rigidly(self) -> Rigidly:
        """How the motion grows with those of the nodes, in the undeformed scene."""
        if self.turns:
            return Rigidly((0.0, 0.0, -1.0), (0.0, 0.0, 1.0))
        (dx, dy), length = self.apart, math.hypot(*self.apart)
        x, y = (dx / length, dy / length) if self.motion == "stretching" else self.axis
        (ax, ay), (bx, by) = self.arms
        turned_with_a = x * dy - y * dx if self.motion == "sliding" else 0.0
        # d/dψ of axis(ψ)·d is (W axis)·d = -y dx + x dy
        return Rigidly((-x, -y, x * ay - y * ax + turned_with_a), (x, y, y * bx - x * by))


def Turn(a: Anchor, b: Anchor, law: Law) -> Connector:
    """Rotation of ``b`` relative to ``a``: rotational springs, dampers, motors; rad, N m."""
    return Connector("Turn", "turning", a, b, law)


def Stretch(a: Anchor, b: Anchor, law: Law) -> Connector:
    """Growth of the distance of ``a`` and ``b``: springs, dampers, rods that push; m, N.

    Raises:
        SceneError: Both are at the same point, so that there is no direction.
    """
    connector = Connector("Stretch", "stretching", a, b, law)
    _require_apart(connector)
    return connector


def Slide(a: Anchor, b: Anchor, law: Law, *, axis: Point | None = None) -> Connector:
    """Way of ``b`` along an axis that turns with ``a``; m, N.

    Args:
        a: Whose axis it is; it may be on the ground.
        b: What moves along it.
        law: What acts along the axis.
        axis: Direction in the undeformed scene; from ``a`` to ``b`` by default.

    Raises:
        SceneError: An axis of zero length.
    """
    return Connector("Slide", "sliding", a, b, law, _axis(a, b, axis, "Slide"))


def _axis(a: Anchor, b: Anchor, axis: Point | None, kind: str) -> Point:
    for anchor in (a, b):
        require_anchor(anchor, kind)
    (ax, ay), (bx, by) = a.point, b.point
    x, y = (bx - ax, by - ay) if axis is None else require_vector(axis, f"{kind}: axis")
    length = math.hypot(x, y)
    if length == 0.0:
        raise SceneError(
            f"{kind}({a}, {b}): the axis has zero length; give axis = (x, y), a direction in the "
            "undeformed scene"
        )
    return x / length, y / length


def _require_apart(connector: Connector) -> None:
    if math.hypot(*connector.apart) == 0.0:
        raise SceneError(
            f"{connector}: zero length, both ends are at the same point; join them with Revolute, "
            "or use Slide with an axis"
        )


# -- joints ------------------------------------------------------------------------------------


@dataclass(frozen=True, eq=False)
class Joint(Bearing):
    """Anchors that share components of motion, or are held by connectors; see :func:`Rigid`.

    Attributes:
        kind: Name for messages.
        places: The anchors.
        shared: Components that are equal: 0, 1 displacement, 2 rotation.  Those of rotation are one
            unknown; so are displacements of anchors that their nodes carry.
        holders: What is held besides, by connectors.
        meets: Whether the anchors are at one point of the undeformed scene.
        advice: For anchors that should meet and do not.
    """

    kind: str
    places: tuple[Anchor, ...]
    shared: tuple[int, ...]
    holders: tuple[Connector, ...] = field(default=(), repr=False)
    meets: bool = False
    advice: str = "RigidLink and Link join places that are apart"

    def __post_init__(self) -> None:
        if len(self.places) < 2:
            raise SceneError(f"{self.kind}: a joint needs at least two places")
        for place in self.places:
            require_anchor(place, self.kind)

    def __str__(self) -> str:
        return f"{self.kind}({', '.join(map(str, self.places))})"

    @property
    def sameness(self) -> object:
        """Key that joints share if they hold the same motions of the same places."""
        held = [(link.motion, link.axis, id(link.law)) for link in self.holders]
        return self.kind, frozenset(self.places), tuple(held)

    @property
    def carriers(self) -> tuple[Anchor, ...]:
        """The anchors whose displacement is that of their node."""
        return tuple(place for place in self.places if carries(place))


def _joined(
    kind: str, places: tuple[Anchor, ...], shared: tuple[int, ...], measured: bool = False
) -> Joint:
    """A joint at one point: what is measured, and what nodes do not carry, connectors hold."""
    for place in places:
        require_anchor(place, kind)
    require_switch(measured, f"{kind}: measured")
    carriers = [place for place in places if carries(place) and not measured]
    first = (carriers or list(places))[:1]
    others = [place for place in places if place not in (*carriers, *first)]
    motions = [("parting", (1.0, 0.0)), ("parting", (0.0, 1.0))]
    if measured and 2 in shared:
        motions.append(("turning", (1.0, 0.0)))
    holders = tuple(
        Connector(kind, motion, base, other, HELD, axis)
        for base in first
        for other in others
        for motion, axis in motions
    )
    return Joint(kind, places, () if measured else shared, holders, meets=True)


def Rigid(*places: Anchor, measured: bool = False) -> Joint:
    """Rigid joint at one point: displacement and rotation are shared by all ``places``.

    Args:
        places: What is joined.
        measured: Keep separate unknowns and hold them with forces, which solutions and
            controllers can ask for, in the place of sharing the unknowns, which costs nothing.
    """
    return _joined("Rigid", places, (0, 1, 2), measured)


def Revolute(*places: Anchor, measured: bool = False) -> Joint:
    """Revolute joint: displacement is shared by all ``places``, each turns freely.

    Args:
        places: What is joined.
        measured: As in :func:`Rigid`; friction needs it.
    """
    return _joined("Revolute", places, (0, 1), measured)


def Prismatic(
    rail: Anchor, slider: Anchor, *, axis: Point | None = None, turning: bool = False
) -> Joint:
    """Prismatic joint: ``slider`` moves along an axis that turns with ``rail``.

    Args:
        rail: Where the axis is; it may be on the ground.
        slider: What slides.
        axis: Direction in the undeformed scene; from rail to slider by default.
        turning: Whether the slider may turn on the rail, like a pin in a slot.

    Raises:
        SceneError: An axis of zero length.
    """
    require_switch(turning, "Prismatic: turning")
    x, y = _axis(rail, slider, axis, "Prismatic")
    across = Connector("Prismatic", "sliding", rail, slider, HELD, (-y, x))
    return Joint("Prismatic", (rail, slider), () if turning else (2,), (across,))


def RigidLink(a: Anchor, b: Anchor) -> Joint:
    """Massless rigid link: ``b`` moves as if it were a point of the cross-section or body of ``a``.

    Raises:
        SceneError: Both are at the same point.
    """
    for anchor in (a, b):
        require_anchor(anchor, "RigidLink")
    if a.point == b.point:
        raise SceneError(f"RigidLink({a}, {b}): zero length; join them with Rigid")
    holders = tuple(
        Connector("RigidLink", "parting", a, b, HELD, axis, corner=b.point)
        for axis in ((1.0, 0.0), (0.0, 1.0))
    )
    return Joint("RigidLink", (a, b), (2,), holders)


def Link(a: Anchor, b: Anchor) -> Joint:
    """Massless rigid rod with a revolute joint at both ends: the distance stays.

    Raises:
        SceneError: Zero length.
    """
    rod = Connector("Link", "stretching", a, b, HELD)
    _require_apart(rod)
    return Joint("Link", (a, b), (), (rod,))


def Guided(place: Anchor, curve: Curve) -> Joint:
    """A point stays on a guide curve of the ground, free along it and free to turn.

    Args:
        place: What is guided; of bodies the centre, other points by a :func:`Revolute` to a beam.
        curve: ``s -> (x, y)`` for all s that the motion may reach; ``curve(0)`` is at the place; m.

    Raises:
        SceneError: The curve stands still at s = 0.  A scene raises it where ``curve(0)`` is not at
            the place.
    """
    require_anchor(place, "Guided")
    if not carries(place):
        raise SceneError(f"Guided({place}): it must be the centre of the body")
    law = Guide(curve)
    x, y = point_of(curve, 0.0, f"Guided({place}): curve")
    (x0, y0), (x1, y1) = (point_of(curve, s, f"Guided({place}): curve") for s in (-1e-6, 1e-6))
    length = math.hypot(x1 - x0, y1 - y0)
    if length == 0.0:
        raise SceneError(f"Guided({place}): the curve stands still at s = 0")
    base, across = ground(x, y), ((y0 - y1) / length, (x1 - x0) / length)
    holder = Connector("Guided", "guided", base, place, law, across)
    advice = "curve(0) must be at the place"
    return Joint("Guided", (base, place), (), (holder,), meets=True, advice=advice)


def Release(a: Place, b: Anchor, *, free: str, measured: bool = False) -> Joint:
    """Joint at one point that transmits all but some resultants of the beam of ``a``.

    Args:
        a: The place on a beam whose axis says what is axial.
        b: What it is joined to there.
        free: What is not transmitted: letters of "NVM".
        measured: As in :func:`Rigid`.

    Raises:
        SceneError: Other letters, or none.
    """
    require_kind(a, Place, "Release: a")
    require_anchor(b, "Release: b")
    require_text(free, f"Release({a}, {b}): free")
    require_switch(measured, f"Release({a}, {b}): measured")
    if not free or set(free) - set("NVM"):
        raise SceneError(f"Release({a}, {b}): free = {free!r} must be letters of 'NVM'")
    shared = () if "M" in free else (2,)
    if not set(free) & set("NV"):
        return _joined("Release", (a, b), (0, 1, *shared), measured)
    x, y = a.direction
    held = [axis for name, axis in (("N", (x, y)), ("V", (-y, x))) if name not in free]
    holders = [Connector("Release", "sliding", a, b, HELD, axis) for axis in held]
    if shared and measured:
        holders.append(Connector("Release", "turning", a, b, HELD))
        shared = ()
    return Joint("Release", (a, b), shared, tuple(holders), meets=True)
