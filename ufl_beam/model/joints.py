# SPDX-License-Identifier: MIT
"""Joints, by shared degrees of freedom or by connectors that hold relative motions."""

from __future__ import annotations

import math
from abc import ABC
from collections.abc import Iterable, Sequence
from dataclasses import KW_ONLY, dataclass
from functools import partial
from typing import Annotated, Any, ClassVar

import numpy as np

from ufl_beam.display import bracketed
from ufl_beam.errors import ModelError, shorten
from ufl_beam.model.bodies import (
    AttachmentPoint,
    BodyPoint,
    NodeDof,
    Place,
    PlaceField,
    ground,
    moves_with_node,
    node,
    require_place,
)
from ufl_beam.model.checks import require_function, require_vector
from ufl_beam.model.connector_laws import RIGID, Bearing, Guide
from ufl_beam.model.connectors import (
    Component,
    Connector,
    across,
    axes_of,
    require_apart,
    require_one_dimension,
    unit_axis,
)
from ufl_beam.model.functions import Curve, Point, guide_curve
from ufl_beam.model.records import Instance, Record, Switch, Text

PERPENDICULAR = 1e-9
"""Largest cosine of the angle of two axes that are perpendicular."""


class Joint(Bearing, Record, ABC):
    """Joint by shared unknowns or constraint forces; base of :class:`Rigid` and other joints.

    Attributes:
        places: The joined places.
        shared: Components that all places share as one unknown: 0, 1 displacement, 2 rotation.
            Points of a body other than its centre do not share displacements, because the node of
            the body has another displacement.
        holders: Connectors that hold the other motions that the joint prevents.
        meets: True if the places must coincide in the undeformed scene.
        advice: Text appended to the error if the places do not coincide.
        is_rod: True if files show a line from place to place.
        in_plane: Joint to use in the plane instead, of joints for scenes in space.

    Example:
        >>> mast = ub.Beam((2, 0), (2, 3), section, name="mast")
        >>> corner = ub.Rigid(beam.end, mast.start, multipliers=True)
        >>> frame = ub.Scene(
        ...     [beam, mast], joints=[corner], supports=scene.supports, loads=[ub.Gravity()]
        ... )
        >>> run = ub.simulate(frame, ub.Static(), t=(0, 1), dt=1.0)
        >>> print(run.joint(corner).force[-1, 1].round())  # weight of the mast; N
        4621.0
    """

    places: tuple[AttachmentPoint, ...]
    shared: tuple[int, ...] = ()
    holders: tuple[Connector, ...] = ()
    meets: bool = False
    advice: str = "RigidLink and Link join places that are apart"
    is_rod: ClassVar[bool] = False
    in_plane: ClassVar[str] = ""

    __repr__ = bracketed

    def attached_to(self) -> Iterable[AttachmentPoint]:
        """See the base class."""
        return self.places

    def __post_init__(self) -> None:
        places = (x for x in vars(self).values() if isinstance(x, Place | BodyPoint))
        vars(self).setdefault("places", tuple(places))
        self._require_dimension()
        super().__post_init__()

    def _require_dimension(self) -> None:
        """Raise :class:`ModelError` unless all places are in the plane, or in space."""
        places = [x for x in self.places if isinstance(x, Place | BodyPoint)]
        require_one_dimension(self, places)
        if self.in_plane and any(len(x.point) == 2 for x in places):
            raise ModelError(
                f"{type(self).__name__}: the joint is for scenes in space; use {self.in_plane} in "
                "the plane"
            )

    def __str__(self) -> str:
        return f"{type(self).__name__}({', '.join(map(str, self.places))})"

    def equal(self, component: int) -> list[NodeDof]:
        """Return equal degrees of freedom of nodes; displacements only of places that are nodes."""
        places = [place for place in self.places if component == 2 or moves_with_node(place)]
        return [(node(place), component) for place in places]

    def _hold(
        self, motion: str, axis: Any, corner: Point | None = None, other: Any = ()
    ) -> Connector:
        """Return a connector that holds a relative motion of the first two places."""
        a, b = self.places[:2]
        return Component(type(self).__name__, motion, a, b, RIGID, axis, corner, other=other)


class _AtPoint(Joint):
    """Joint at one point by shared unknowns or, with ``multipliers``, by connectors.

    Points of bodies other than the centre are always joined by connectors.
    """

    meets = True
    joined: tuple[int, ...] = (0, 1)
    """Components of motion that are equal at all places."""

    multipliers: bool

    def __init__(self, *places: AttachmentPoint, multipliers: bool = False) -> None:
        vars(self).update(places=places, multipliers=multipliers)
        self.__post_init__()

    def directions(self) -> list[tuple[Any, ...]]:
        """Return motions that hold directions of the first place and of each other one."""
        return []

    def __post_init__(self) -> None:
        super().__post_init__()
        kind = type(self).__name__
        if len(self.places) < 2:
            raise ModelError(f"{kind}: a joint needs at least two places")
        for i, place in enumerate(self.places):
            require_place(place, f"{kind}: places[{i}]")
        shared = () if self.multipliers else self.joined
        moving = [place for place in self.places if self.multipliers or not moves_with_node(place)]
        base = next((place for place in self.places if place not in moving), self.places[0])
        axes = axes_of(self.places[0].point)
        motions: list[tuple[Any, ...]] = [("parting", axis) for axis in axes]
        if self.multipliers and 2 in self.joined:
            pairs = zip(axes, [*axes[1:], axes[0]], strict=True)
            in_space: list[tuple[Any, ...]] = [("aligning", axis, other) for axis, other in pairs]
            motions += in_space if len(axes) == 3 else [("turning", axes[0])]
        held = [(base, x, some) for x in moving if x != base for some in motions]
        held += [(self.places[0], x, some) for x in self.places[1:] for some in self.directions()]
        holders = tuple(
            Component(kind, motion, a, b, RIGID, axis, other=tuple(*other))
            for a, b, (motion, axis, *other) in held
        )
        vars(self).update(shared=shared, holders=holders)


@dataclass(frozen=True, eq=False, repr=False, init=False)
class Rigid(_AtPoint):
    """Rigid joint at one point: all ``places`` share displacement and rotation.

    Args:
        places: Two or more places at one point.
        multipliers: True for separate unknowns that constraint forces make equal.  Solutions and
            controllers can read these forces.  By default the places share unknowns.

    Example:
        >>> column = ub.Beam((2, 0), (2, -3), section, name="column")
        >>> frame = ub.Scene(
        ...     [beam, column], joints=[ub.Rigid(beam.end, column.start)], supports=scene.supports
        ... )
    """

    places: tuple[AttachmentPoint, ...]
    multipliers: Switch
    joined = (0, 1, 2)


@dataclass(frozen=True, eq=False, repr=False, init=False)
class Revolute(_AtPoint):
    """Revolute joint: all ``places`` share the displacement, and each turns freely.

    The arguments are the same as for :class:`Rigid`, and in space the ``axis`` about which the
    places turn, a direction in the undeformed scene.  Friction by the force of the joint needs
    ``multipliers=True``, see :class:`Coulomb`.

    Raises:
        ModelError: In space, without an axis; a ball joint is :class:`Spherical`.

    Example:
        >>> rod = ub.Beam((2, 0), (4, 0), section, name="rod")
        >>> chain = ub.Scene(
        ...     [beam, rod], joints=[ub.Revolute(beam.end, rod.start)], supports=scene.supports
        ... )
    """

    places: tuple[AttachmentPoint, ...]
    multipliers: Switch
    axis: Any = None

    def __init__(
        self, *places: AttachmentPoint, multipliers: bool = False,
        axis: Sequence[float] | None = None,
    ) -> None:  # fmt: skip
        vars(self).update(places=places, multipliers=multipliers, axis=axis)
        self.__post_init__()

    def __post_init__(self) -> None:
        in_space = any(len(getattr(x, "point", ())) == 3 for x in self.places)
        if in_space != (self.axis is not None):
            raise ModelError(
                f"{self}: in space give axis=(x, y, z), about which the places turn, or use "
                "Spherical; in the plane there is no axis"
            )
        if self.axis is not None:
            a, b = self.places[:2]
            vars(self).update(axis=unit_axis(a, b, self.axis, "Revolute"))
        super().__post_init__()

    def directions(self) -> list[tuple[Any, ...]]:
        """See the base class: the axis stays normal to two directions of the first place."""
        normals = across(self.axis) if self.axis is not None else ()
        return [("aligning", normal, self.axis) for normal in normals]


@dataclass(frozen=True, eq=False, repr=False, init=False)
class Spherical(_AtPoint):
    """Ball joint in space: all ``places`` share the displacement, and each rotates freely.

    The arguments are the same as for :class:`Rigid`.

    Example:
        >>> tube = ub.Section.tube(d=0.1, t=0.005, E=210e9, nu=0.3, rho=7850.0)
        >>> arm = ub.Beam((0, 0, 0), (1, 0, 0), tube, name="arm")
        >>> hung = ub.Scene(
        ...     [arm], joints=[ub.Spherical(ub.ground(0, 0, 0), arm.start)],
        ...     loads=[ub.Gravity((0, 0, -9.81))],
        ... )  # fmt: skip
    """

    places: tuple[AttachmentPoint, ...]
    multipliers: Switch
    in_plane = "Revolute"


@dataclass(frozen=True, eq=False, repr=False, init=False)
class Universal(_AtPoint):
    """Universal joint in space: a cross whose arms are pinned to ``a`` and to ``b``.

    Both places share the displacement.  They do not turn relative to each other about the normal of
    both ``axes``.

    Args:
        a: Place in which the first axis is fixed.
        b: Place in which the second axis is fixed.
        axes: Two perpendicular directions in the undeformed scene, along the arms of the cross.
        multipliers: As in :class:`Rigid`.

    Raises:
        ModelError: In the plane, or for axes that are not perpendicular.

    Example:
        >>> tube = ub.Section.tube(d=0.1, t=0.005, E=210e9, nu=0.3, rho=7850.0)
        >>> drive = ub.Beam((0, 0, 0), (1, 0, 0), tube, name="drive")
        >>> driven = ub.Beam((1, 0, 0), (2, 0.5, 0), tube, name="driven")
        >>> print(ub.Universal(drive.end, driven.start, axes=((0, 1, 0), (0, 0, 1))))
        Universal(drive.end (1, 0, 0), driven.start (1, 0, 0))
    """

    places: tuple[AttachmentPoint, ...]
    multipliers: Switch
    axes: Any
    in_plane = "Revolute"

    def __init__(
        self, a: AttachmentPoint, b: AttachmentPoint, *, axes: Sequence[Sequence[float]],
        multipliers: bool = False,
    ) -> None:  # fmt: skip
        vars(self).update(places=(a, b), multipliers=multipliers, axes=axes)
        self.__post_init__()

    def __post_init__(self) -> None:
        a, b = self.places
        require_place(a, "Universal: a")
        require_place(b, "Universal: b")
        self._require_dimension()
        try:
            given = np.array(self.axes, dtype=np.float64)
        except (TypeError, ValueError):
            given = np.zeros(0)
        if given.shape != (2, 3) or not np.isfinite(given).all() or not given.any(axis=1).all():
            raise ModelError(
                f"{self}: axes = {shorten(self.axes)} must be two directions (x, y, z)"
            )
        first, second = (unit_axis(a, b, axis, "Universal") for axis in self.axes)
        if abs(np.dot(first, second)) > PERPENDICULAR:
            raise ModelError(f"{self}: axes = {self.axes} must be perpendicular to each other")
        vars(self).update(axes=(first, second))
        super().__post_init__()

    def directions(self) -> list[tuple[Any, ...]]:
        """See the base class: the axes stay perpendicular."""
        return [("aligning", *self.axes)]


class _OnRail(Joint):
    """Joint whose ``slider`` moves along an axis that turns with the place ``rail``."""

    rail: AttachmentPoint
    slider: AttachmentPoint
    axis: Any
    turning: bool = True  # True if the slider turns on the rail

    def __post_init__(self) -> None:
        super().__post_init__()
        axis = unit_axis(self.rail, self.slider, self.axis, type(self).__name__)
        vars(self).update(axis=axis, shared=() if self.turning else (2,))
        normals: Any = across(axis) if len(axis) == 3 else ((-axis[1], axis[0]),)
        holders = [self._hold("sliding", normal) for normal in normals]
        if self.turning and len(axis) == 3:  # the slider turns about the axis only
            holders += [self._hold("aligning", normal, other=axis) for normal in normals]
        vars(self).update(holders=tuple(holders))


@dataclass(frozen=True, eq=False, repr=False)
class Prismatic(_OnRail):
    """Prismatic joint: ``slider`` moves along an axis that turns with the place ``rail``.

    Args:
        rail: Place with which the axis turns; it may be on the ground.
        slider: Place that slides.
        axis: Direction in the undeformed scene; from rail to slider by default.
        turning: True if the slider may turn on the rail, like a pin in a slot; in space about the
            axis, as in a cylindrical joint.

    Raises:
        ModelError: An axis of zero length.

    Example:
        >>> slider = ub.Body((2, 0), mass=10.0, inertia=1.0, name="slider")
        >>> joint = ub.Prismatic(beam.end, slider.middle, axis=(0, 1))
        >>> print(joint)
        Prismatic(beam.end (2, 0), slider (2, 0))
    """

    rail: PlaceField
    slider: PlaceField
    _: KW_ONLY
    axis: Point | None = None
    turning: Switch = False


@dataclass(frozen=True, eq=False, repr=False)
class Cylindrical(_OnRail):
    """Cylindrical joint in space: ``slider`` moves along an axis of ``rail``, and turns about it.

    Args:
        rail: Place with which the axis turns; it may be on the ground.
        slider: Place that slides and turns.
        axis: Direction in the undeformed scene; from rail to slider by default.

    Raises:
        ModelError: An axis of zero length, or places in the plane.

    Example:
        >>> collar = ub.Body((0, 0, 1), mass=2.0, inertia=(0.1, 0.1, 0.1), name="collar")
        >>> print(ub.Cylindrical(ub.ground(0, 0, 0), collar.middle))
        Cylindrical(ground (0, 0, 0), collar (0, 0, 1))
    """

    rail: PlaceField
    slider: PlaceField
    _: KW_ONLY
    axis: Point | None = None
    in_plane = "Prismatic(turning=True)"


@dataclass(frozen=True, eq=False, repr=False)
class RigidLink(Joint):
    """Massless rigid link: ``b`` moves as if fixed to the cross-section or body of ``a``.

    Raises:
        ModelError: Both places are at the same point.

    Example:
        >>> flange = ub.Beam((0, 0.5), (2, 0.5), section, name="flange")
        >>> built = ub.Scene(
        ...     [beam, flange], joints=[ub.RigidLink(beam.end, flange.end)], supports=scene.supports
        ... )
    """

    a: PlaceField
    b: PlaceField
    is_rod: ClassVar = True
    shared = (2,)

    def __post_init__(self) -> None:
        super().__post_init__()
        corner = self.b.point
        if self.a.point == corner:
            raise ModelError(f"{self}: zero length; join the places with Rigid")
        holders = tuple(self._hold("parting", axis, corner) for axis in axes_of(corner))
        vars(self).update(holders=holders)


@dataclass(frozen=True, eq=False, repr=False)
class Link(Joint):
    """Massless rigid rod with a revolute joint at each end.

    Raises:
        ModelError: Both places are at the same point.

    Example:
        >>> hanger = ub.Link(ub.ground(2, 3), beam.end)
        >>> hung = ub.Scene(
        ...     [beam], joints=[hanger], supports=[ub.Pinned(beam.start)], loads=[ub.Gravity()]
        ... )
        >>> run = ub.simulate(hung, ub.Static(), t=(0, 1), dt=1.0)
        >>> print(run.joint(hanger).force[-1, 1].round())  # half of the weight; N
        1540.0
    """

    a: PlaceField
    b: PlaceField
    is_rod: ClassVar = True

    def __post_init__(self) -> None:
        super().__post_init__()
        rod = self._hold("stretching", (1.0, 0.0, 0.0)[: len(self.a.point)])
        require_apart(rod)
        vars(self).update(holders=(rod,))


@dataclass(frozen=True, eq=False, repr=False)
class Guided(Joint):
    """Joint that keeps a place on a fixed curve, along which it moves and turns freely.

    Args:
        place: Guided place: on a beam, or the centre of a body.  Another point of a body can be
            joined to a guided beam by a :class:`Revolute`.
        curve: ``s -> (x, y)`` in UFL, smooth, for all s that the place may reach, or a
            :class:`Spline`.  The point at s = 0 is at the place; m.

    Raises:
        ModelError: The curve is no function in UFL, or has no direction at s = 0, or the place is
            another point of a body.  A scene raises this error if the curve is not at the place at
            s = 0.

    Example:
        >>> rail = ub.Guided(beam.end, lambda s: (2 + s, 0.5 * s**2))
        >>> guided = ub.Scene(
        ...     [beam], joints=[rail], supports=[ub.Roller(beam.start)], loads=[ub.Gravity()]
        ... )
    """

    place: PlaceField
    curve: Annotated[Curve, partial(require_function, arguments="s that returns (x, y)")]
    meets = True
    advice = "curve(0) must be at the place"

    def __post_init__(self) -> None:
        super().__post_init__()
        if not moves_with_node(self.place):
            raise ModelError(f"Guided({self.place}): the place must be the centre of the body")
        name = f"Guided({self.place}): curve"
        law = Guide(guide_curve(self.curve, name))
        (x, y), slope, _ = law.curve.at(0.0)
        start = ground(*require_vector((float(x), float(y)), f"{name}(0)"))
        length = math.hypot(*slope)
        if not 0.0 < length < math.inf:
            raise ModelError(f"Guided({self.place}): the curve has no direction at s = 0")
        across = -float(slope[1]) / length, float(slope[0]) / length
        holder = Component("Guided", "guided", start, self.place, law, across)
        vars(self).update(places=(start, self.place), holders=(holder,))


@dataclass(frozen=True, eq=False, repr=False)
class Release(_AtPoint):
    """Joint at one point that does not transmit some of the resultants of the beam of ``a``.

    Args:
        a: Place on a beam, whose axis defines the axial direction.
        b: Place to which ``a`` is joined.
        free: Resultants that are not transmitted: one or more of the letters "N", "V", "M".
        multipliers: As in :class:`Rigid`.

    Raises:
        ModelError: ``free`` is empty or has other letters.

    Example:
        >>> girder = ub.Beam((2, 0), (4, 0), section, name="girder")
        >>> joint = ub.Release(beam.end, girder.start, free="V")  # a shear joint
        >>> print(joint)
        Release(beam.end (2, 0), girder.start (2, 0))
    """

    a: Instance[Place]
    b: PlaceField
    _: KW_ONLY
    free: Text
    multipliers: Switch = False

    def __post_init__(self) -> None:
        super().__post_init__()
        if not self.free or set(self.free) - set("NVM"):
            raise ModelError(f"{self}: free = {self.free!r} must be letters of 'NVM'")
        if 0 in self.joined:
            return
        x, y, *_ = self.a.direction
        axes = {"N": (x, y), "V": (-y, x)}
        holders = [
            self._hold("sliding", axis) for name, axis in axes.items() if name not in self.free
        ]
        if self.multipliers and 2 in self.joined:
            holders.append(self._hold("turning", (1.0, 0.0)))
        vars(self).update(holders=tuple(holders))

    @property
    def joined(self) -> tuple[int, ...]:  # type: ignore[override]
        """Components of motion that are equal at both places."""
        displacement = () if set(self.free) & set("NV") else (0, 1)
        return displacement if "M" in self.free else (*displacement, 2)


IN_SPACE = Rigid, Revolute, Spherical, Universal, Prismatic, Cylindrical, RigidLink, Link
"""Joints for scenes in space."""
