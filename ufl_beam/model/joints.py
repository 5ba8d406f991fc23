# SPDX-License-Identifier: MIT
"""Joints: components of motion that places share, or that connectors hold."""

from __future__ import annotations

import math
from dataclasses import dataclass, field

from ufl_beam.display import bracketed
from ufl_beam.errors import SceneError, require_kind, require_switch, require_text
from ufl_beam.model.bodies import Anchor, NodeDof, Place, carries, ground, node, require_anchors
from ufl_beam.model.connector_laws import HELD, Bearing, Guide
from ufl_beam.model.connectors import Connector, require_apart, unit_axis
from ufl_beam.model.functions import Curve, Point, point_of


@dataclass(frozen=True, eq=False)
class Joint(Bearing):
    """Joint by shared unknowns or by constraint forces; made by :func:`Rigid` and its siblings.

    Attributes:
        kind: Name for messages.
        places: The anchors.
        shared: Components that are equal: 0, 1 displacement, 2 rotation.  Those of rotation are one
            unknown; so are displacements of anchors that their nodes carry.
        holders: Connectors that hold the other components.
        meets: Whether the anchors are at one point of the undeformed scene.
        advice: For anchors that should meet and do not.
        look: Kind of joint whose picture it has; its own by default.

    Example:
        >>> mast = ub.Beam((2, 0), (2, 3), section, name="mast")
        >>> corner = ub.Rigid(beam.end, mast.start, measured=True)
        >>> frame = ub.Scene([beam, mast], [corner], scene.supports, [ub.Gravity()])
        >>> run = ub.simulate(frame, ub.Static(), t=(0, 1), dt=1.0)
        >>> print(run.joint(corner).force[-1, 1].round())  # weight of the mast; N
        4621.0
    """

    kind: str
    places: tuple[Anchor, ...]
    shared: tuple[int, ...]
    holders: tuple[Connector, ...] = field(default=(), repr=False)
    meets: bool = False
    advice: str = "RigidLink and Link join places that are apart"
    look: str = ""

    __repr__ = bracketed

    def __post_init__(self) -> None:
        if len(self.places) < 2:
            raise SceneError(f"{self.kind}: a joint needs at least two places")
        require_anchors(self.kind, *self.places)
        object.__setattr__(self, "look", self.look or self.kind)

    def __str__(self) -> str:
        return f"{self.kind}({', '.join(map(str, self.places))})"

    def equal(self, component: int) -> list[NodeDof]:
        """Components of motion that are equal; of displacements those that the nodes carry."""
        alike = [place for place in self.places if component == 2 or carries(place)]
        return [(node(place), component) for place in alike]


def _joined(
    kind: str, places: tuple[Anchor, ...], shared: tuple[int, ...], measured: bool = False
) -> Joint:
    """A joint at one point: what is measured, and what nodes do not carry, connectors hold."""
    require_anchors(kind, *places)
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
        places: Places to be joined, at one point.
        measured: Keep separate unknowns and hold them with forces, which solutions and
            controllers can ask for, in the place of sharing the unknowns, which costs nothing.

    Example:
        >>> column = ub.Beam((2, 0), (2, -3), section, name="column")
        >>> frame = ub.Scene([beam, column], [ub.Rigid(beam.end, column.start)], scene.supports)
    """
    return _joined("Rigid", places, (0, 1, 2), measured)


def Revolute(*places: Anchor, measured: bool = False) -> Joint:
    """Revolute joint: displacement is shared by all ``places``, each turns freely.

    Args are those of :func:`Rigid`; friction needs ``measured``.

    Example:
        >>> rod = ub.Beam((2, 0), (4, 0), section, name="rod")
        >>> chain = ub.Scene([beam, rod], [ub.Revolute(beam.end, rod.start)], scene.supports)
    """
    return _joined("Revolute", places, (0, 1), measured)


def Prismatic(
    rail: Anchor, slider: Anchor, *, axis: Point | None = None, turning: bool = False
) -> Joint:
    """Prismatic joint: ``slider`` moves along an axis that turns with ``rail``.

    Args:
        rail: Where the axis is; it may be on the ground.
        slider: Place that slides.
        axis: Direction in the undeformed scene; from rail to slider by default.
        turning: Whether the slider may turn on the rail, like a pin in a slot.

    Raises:
        SceneError: An axis of zero length.

    Example:
        >>> slider = ub.Body((2, 0), mass=10.0, inertia=1.0, name="slider")
        >>> joint = ub.Prismatic(beam.end, slider.middle, axis=(0, 1))
        >>> print(joint)
        Prismatic(beam.end (2, 0), slider (2, 0))
    """
    require_switch(turning, "Prismatic: turning")
    x, y = unit_axis(rail, slider, axis, "Prismatic")
    across = Connector("Prismatic", "sliding", rail, slider, HELD, (-y, x))
    return Joint("Prismatic", (rail, slider), () if turning else (2,), (across,))


def RigidLink(a: Anchor, b: Anchor) -> Joint:
    """Massless rigid link: ``b`` moves as if it were a point of the cross-section or body of ``a``.

    Raises:
        SceneError: Both are at the same point.

    Example:
        >>> flange = ub.Beam((0, 0.5), (2, 0.5), section, name="flange")
        >>> built = ub.Scene([beam, flange], [ub.RigidLink(beam.end, flange.end)], scene.supports)
    """
    require_anchors("RigidLink", a, b)
    if a.point == b.point:
        raise SceneError(f"RigidLink({a}, {b}): zero length; join them with Rigid")
    holders = tuple(
        Connector("RigidLink", "parting", a, b, HELD, axis, corner=b.point)
        for axis in ((1.0, 0.0), (0.0, 1.0))
    )
    return Joint("RigidLink", (a, b), (2,), holders)


def Link(a: Anchor, b: Anchor) -> Joint:
    """Massless rigid rod with a revolute joint at both ends: keeps the distance.

    Raises:
        SceneError: Zero length.

    Example:
        >>> hanger = ub.Link(ub.ground(2, 3), beam.end)
        >>> hung = ub.Scene([beam], [hanger], [ub.Pinned(beam.start)], [ub.Gravity()])
        >>> run = ub.simulate(hung, ub.Static(), t=(0, 1), dt=1.0)
        >>> print(run.joint(hanger).force[-1, 1].round())  # half of the weight; N
        1540.0
    """
    rod = Connector("Link", "stretching", a, b, HELD)
    require_apart(rod)
    return Joint("Link", (a, b), (), (rod,))


def Guided(place: Anchor, curve: Curve) -> Joint:
    """Joint that keeps a point on a guide curve of the ground, free along it and free to turn.

    Args:
        place: Guided place; of bodies the centre, other points by a :func:`Revolute` to a beam.
        curve: ``s -> (x, y)`` for all s that the motion may reach; ``curve(0)`` is at the place; m.

    Raises:
        SceneError: The curve stands still at s = 0.  A scene raises it where ``curve(0)`` is not at
            the place.

    Example:
        >>> rail = ub.Guided(beam.end, lambda s: (2 + s, 0.5 * s**2))
        >>> guided = ub.Scene([beam], [rail], [ub.Roller(beam.start)], [ub.Gravity()])
    """
    require_anchors("Guided", place)
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
    """Joint at one point that releases some of the resultants of the beam of ``a``.

    Args:
        a: Place on a beam, whose axis defines the axial direction.
        b: Place to which it is joined.
        free: Resultants that are not transmitted: letters of "NVM".
        measured: As in :func:`Rigid`.

    Raises:
        SceneError: Other letters, or none.

    Example:
        >>> girder = ub.Beam((2, 0), (4, 0), section, name="girder")
        >>> joint = ub.Release(beam.end, girder.start, free="V")  # a shear joint
        >>> print(joint)
        Release(beam.end (2, 0), girder.start (2, 0))
    """
    require_kind(a, Place, "Release: a")
    require_anchors("Release: b", b)
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
