"""What is modelled: frozen records, and their validity as a whole before any mesh exists."""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass
from functools import cached_property

from ufl_beam.beams import Beam, Place, Point
from ufl_beam.errors import (
    SceneError,
    require_kind,
    require_number,
    require_sequence,
    require_vector,
)
from ufl_beam.loads import (
    FollowerLoad,
    Gravity,
    LineLoad,
    Load,
    PointLoad,
    TimeFunction,
    require_time_function,
)
from ufl_beam.viscous import Damping, KelvinVoigt, Rayleigh

COMPONENTS = ("u", "v", "psi")
Slot = tuple[Place, int]


# -- joints ------------------------------------------------------------------------------------


@dataclass(frozen=True, eq=False)
class Joint:
    """Places that share components of motion; made by :func:`Rigid` and :func:`Revolute`.

    Attributes:
        kind: Name for messages.
        places: The places, at the same point of the undeformed scene.
        shared: Components that are equal: 0, 1 displacement, 2 rotation.
    """

    kind: str
    places: tuple[Place, ...]
    shared: tuple[int, ...]

    def __post_init__(self) -> None:
        if len(self.places) < 2:
            raise SceneError(f"{self.kind}: a joint needs at least two places")
        for place in self.places:
            _require_place(place, self.kind)

    def __str__(self) -> str:
        return f"{self.kind}({', '.join(map(str, self.places))})"


def Rigid(*places: Place) -> Joint:
    """Rigid joint: displacement and rotation are shared by all ``places``."""
    return Joint("Rigid", places, (0, 1, 2))


def Revolute(*places: Place) -> Joint:
    """Revolute joint: displacement is shared by all ``places``, each turns freely."""
    return Joint("Revolute", places, (0, 1))


# -- supports ----------------------------------------------------------------------------------


@dataclass(frozen=True, eq=False)
class Support:
    """Components of motion of a place that are given; made by :func:`Clamped` and its siblings.

    Attributes:
        kind: Name for messages.
        place: Where.
        held: Component -> its value in time (m, m, rad), in axes turned by ``angle``.
        angle: Direction of the first axis; rad.
    """

    kind: str
    place: Place
    held: dict[int, TimeFunction]
    angle: float = 0.0

    def __post_init__(self) -> None:
        _require_place(self.place, self.kind)
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


def Clamped(place: Place) -> Support:
    """Holds displacement and rotation."""
    return Support("Clamped", place, {0: still, 1: still, 2: still})


def Pinned(place: Place) -> Support:
    """Holds the displacement; the place turns freely."""
    return Support("Pinned", place, {0: still, 1: still})


def Roller(place: Place, *, along: Point = (1.0, 0.0)) -> Support:
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
    place: Place,
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


def _constant(value: float, place: Place, component: int) -> TimeFunction:
    require_number(value, f"Prescribed at {place}: {COMPONENTS[component]}")
    return still if value == 0 else lambda t: float(value)


# -- masses and initial motion -----------------------------------------------------------------


@dataclass(frozen=True, eq=False)
class PointMass:
    """Mass, and rotary inertia, fixed to a place.

    Args:
        place: Where.
        mass: kg.
        inertia: About the place; kg m².
    """

    place: Place
    mass: float
    inertia: float = 0.0

    def __post_init__(self) -> None:
        _require_place(self.place, "PointMass")
        require_number(self.mass, f"PointMass at {self.place}: mass", at_least=0.0)
        require_number(self.inertia, f"PointMass at {self.place}: inertia", at_least=0.0)


@dataclass(frozen=True, eq=False)
class Velocity:
    """Initial motion of beams as a rigid body.

    Args:
        beams: The beams that move so.
        linear: Velocity of the point ``about``; m/s.
        angular: Angular velocity; rad/s.
        about: Point of the undeformed scene; m.
    """

    beams: tuple[Beam, ...]
    linear: tuple[float, float] = (0.0, 0.0)
    angular: float = 0.0
    about: Point = (0.0, 0.0)

    def __post_init__(self) -> None:
        object.__setattr__(self, "beams", require_sequence(self.beams, "Velocity: beams"))
        for i, beam in enumerate(self.beams):
            require_kind(beam, Beam, f"Velocity: beams[{i}]")
        require_vector(self.linear, "Velocity: linear")
        require_number(self.angular, "Velocity: angular")
        require_vector(self.about, "Velocity: about")

    def at(self, x: float, y: float) -> tuple[float, float, float]:
        """(du/dt, dv/dt, dψ/dt) of the point (x, y); m/s, m/s, rad/s."""
        return (
            self.linear[0] - self.angular * (y - self.about[1]),
            self.linear[1] + self.angular * (x - self.about[0]),
            self.angular,
        )


# -- the scene ---------------------------------------------------------------------------------


@dataclass(frozen=True, eq=False)
class Scene:
    """Beams and what joins, holds, loads and moves them.

    Args:
        beams: The beams.
        joints: Made by :func:`Rigid` and :func:`Revolute`.
        supports: Made by :func:`Clamped`, :func:`Pinned`, :func:`Roller`, :func:`Prescribed`.
        loads: :class:`PointLoad`, :class:`FollowerLoad`, :class:`LineLoad`, :class:`Gravity`.
        masses: :class:`PointMass`.
        initial: :class:`Velocity`; at rest without.
        damping: :class:`Rayleigh`, :class:`KelvinVoigt`; besides what materials dissipate.

    Raises:
        SceneError: The parts do not fit together; the message names them.
    """

    beams: Sequence[Beam]
    joints: Sequence[Joint] = ()
    supports: Sequence[Support] = ()
    loads: Sequence[Load] = ()
    masses: Sequence[PointMass] = ()
    initial: Sequence[Velocity] = ()
    damping: Sequence[Damping] = ()

    def __post_init__(self) -> None:
        for part in ("beams", "joints", "supports", "loads", "masses", "initial", "damping"):
            records = require_sequence(getattr(self, part), f"Scene: {part}")
            object.__setattr__(self, part, records)
        if not self.beams:
            raise SceneError("Scene: no beams")
        known: dict[Beam, int] = {}
        for i, beam in enumerate(self.beams):
            require_kind(beam, Beam, f"Scene: beams[{i}]")
            first = known.setdefault(beam, i)
            if first != i:
                raise SceneError(
                    f"Scene: {beam.name} is in the scene twice, as beams {first} and {i}"
                )
        _require_kinds(self)
        for owner, place in self._attachments():
            if place.beam not in known:
                raise SceneError(f"{owner}: {place.beam.name} is not in the scene; add it to beams")
        for joint in self.joints:
            self._require_together(joint)
        self._require_single_supports()

    @cached_property
    def size(self) -> float:
        """Diagonal of the box around the undeformed scene; m."""
        points = [b.curve(s) for b in self.beams for s in b.vertices(())]
        xs, ys = zip(*points, strict=True)
        return math.hypot(max(xs) - min(xs), max(ys) - min(ys))

    def _attachments(self) -> Iterator[tuple[object, Place]]:
        """Everything with a place, and its place."""
        for joint in self.joints:
            for place in joint.places:
                yield joint, place
        for support in self.supports:
            yield support, support.place
        for mass in self.masses:
            yield "PointMass", mass.place
        for load in self.loads:
            if isinstance(load, PointLoad | FollowerLoad):
                yield type(load).__name__, load.place
            elif isinstance(load, LineLoad):
                yield "LineLoad", load.beam.start
        for velocity in self.initial:
            for beam in velocity.beams:
                yield "Velocity", beam.start
        for damping in self.damping:
            if isinstance(damping, KelvinVoigt):
                for beam in damping.beams or ():
                    yield "KelvinVoigt", beam.start

    @cached_property
    def attached(self) -> dict[Beam, list[float]]:
        """Parameters of the places of each beam that must be vertices."""
        found: dict[Beam, list[float]] = {beam: [] for beam in self.beams}
        for _, place in self._attachments():
            found[place.beam].append(place.s)
        return found

    def _require_together(self, joint: Joint) -> None:
        here, *others = joint.places
        for other in others:
            if other in joint.places[: joint.places.index(other)] or other == here:
                raise SceneError(f"{joint}: the same place twice")
            gap = math.dist(here.point, other.point)
            if gap > 1e-9 * self.size:
                raise SceneError(
                    f"{joint.kind}: joint ends lie {gap:.6g} m apart: {here} and {other}"
                )

    def representatives(self) -> dict[Slot, Slot]:
        """Which component of a place stands for it, for all components that joints share."""
        parent: dict[Slot, Slot] = {}

        def root(slot: Slot) -> Slot:
            while slot in parent:
                slot = parent[slot]
            return slot

        for joint in self.joints:
            for component in joint.shared:
                first = root((joint.places[0], component))
                for place in joint.places[1:]:
                    other = root((place, component))
                    if other != first:
                        parent[other] = first
        return {slot: root(slot) for slot in parent}

    def _require_single_supports(self) -> None:
        same = self.representatives()
        holders: dict[Slot, Support] = {}
        for support in self.supports:
            # A support in turned axes takes both displacements of its place.
            components = {*support.held, *((0, 1) if support.angle else ())}
            for component in sorted(components):
                slot = (support.place, component)
                slot = same.get(slot, slot)
                if slot in holders:
                    raise SceneError(
                        f"supports in conflict: {holders[slot]} and {support} both hold "
                        f"{COMPONENTS[component]}; remove one"
                    )
                holders[slot] = support


def _require_place(place: object, owner: str) -> None:
    if not isinstance(place, Place):
        raise SceneError(f"{owner}: {place!r} is not a place; use beam.start, .end or .at(s)")


def _require_kinds(scene: Scene) -> None:
    kinds: tuple[tuple[str, Iterable[object], tuple[type, ...]], ...] = (
        ("joints", scene.joints, (Joint,)),
        ("supports", scene.supports, (Support,)),
        ("loads", scene.loads, (PointLoad, FollowerLoad, LineLoad, Gravity)),
        ("masses", scene.masses, (PointMass,)),
        ("initial", scene.initial, (Velocity,)),
        ("damping", scene.damping, (Rayleigh, KelvinVoigt)),
    )
    for name, records, kind in kinds:
        for i, record in enumerate(records):
            require_kind(record, kind, f"Scene: {name}[{i}]")
