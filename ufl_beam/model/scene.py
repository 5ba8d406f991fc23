# SPDX-License-Identifier: MIT
"""Scenes: models of beams, bodies, joints, supports and loads, and checks of whole models."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Sequence
from dataclasses import KW_ONLY, dataclass
from functools import cached_property, partial
from typing import Annotated, Any

import numpy as np

from ufl_beam.caches import no_garbage_collection
from ufl_beam.display import Rich, counted
from ufl_beam.errors import ArgumentError, ModelError, clip
from ufl_beam.model import connectors, joints, supports
from ufl_beam.model.beams import Beam
from ufl_beam.model.bodies import (
    GROUND,
    AttachmentPoint,
    Body,
    BodyPoint,
    Member,
    Node,
    NodeDof,
    Place,
    PointMass,
    Representatives,
    Velocity,
    merged,
    node,
)
from ufl_beam.model.checks import require_all
from ufl_beam.model.connector_laws import Bearing, Coulomb, RigidPlastic
from ufl_beam.model.connectors import Component, Connector, plastic_hinges
from ufl_beam.model.fibres import stream_keys
from ufl_beam.model.functions import TimeFunction, enclosing_diameter, points_along
from ufl_beam.model.imposed_strains import ImposedStrain
from ufl_beam.model.joints import Joint
from ufl_beam.model.loads import (
    LOADS,
    Damping,
    KelvinVoigt,
    Load,
    LoadAtPlace,
    MovingLoad,
    PointLoad,
    RotatingFrame,
)
from ufl_beam.model.records import Record
from ufl_beam.model.supports import Support
from ufl_beam.model.works import Effect, Potential, VirtualWork, Work

Unknown = tuple[NodeDof, int]
"""Degrees of freedom that are equal, by one of them, with the component of its node."""


def _all(*kinds: type) -> Callable[..., tuple[Any, ...]]:
    """Return a check that a field is a list of objects of these classes."""
    return partial(require_all, kind=kinds)


@dataclass(frozen=True, eq=False)
class Scene(Record, Rich):
    """Model: beams and bodies with joints, supports, loads, masses and connectors.

    Args:
        beams: The beams.
        joints: :class:`Rigid`, :class:`Revolute`, :class:`Prismatic`, :class:`RigidLink`,
            :class:`Link`, :class:`Guided`, :class:`Release`; in space also :class:`Spherical`,
            :class:`Universal`, :class:`Cylindrical`.
        supports: :class:`Clamped`, :class:`Pinned`, :class:`Roller`,
            :class:`PrescribedDisplacement`.
        loads: :class:`PointLoad`, :class:`FollowerLoad`, :class:`LineLoad`, :class:`Pressure`,
            :class:`MovingLoad`, :class:`ImposedStrain`, :class:`Gravity`,
            :class:`RotatingFrame`.
        masses: :class:`PointMass`.
        initial: :class:`Velocity`; by default the scene is at rest.
        damping: :class:`Rayleigh`, :class:`KelvinVoigt`, in addition to dissipation of materials.
        bodies: :class:`Body`.
        connectors: :class:`Turn`, :class:`Stretch`, :class:`Slide`, :class:`Bushing`: springs,
            dampers, stops, friction, motors.
        works: :class:`VirtualWork`, :class:`Potential`, :class:`Effect`: effects in UFL.

    Raises:
        ModelError: The objects do not fit together; the message names them.

    Example:
        >>> frame = ub.Scene([beam], supports=[ub.Clamped(beam.start)], loads=[ub.Gravity()])
        >>> figure = ub.plot(frame)  # check it by eye before the run
    """

    beams: Annotated[Sequence[Beam], _all(Beam)] = ()
    _: KW_ONLY
    joints: Annotated[Sequence[Joint], _all(Joint)] = ()
    supports: Annotated[Sequence[Support], _all(Support)] = ()
    loads: Annotated[Sequence[Load], _all(*LOADS, ImposedStrain)] = ()
    masses: Annotated[Sequence[PointMass], _all(PointMass)] = ()
    initial: Annotated[Sequence[Velocity], _all(Velocity)] = ()
    damping: Annotated[Sequence[Damping], _all(*Damping.__args__)] = ()
    bodies: Annotated[Sequence[Body], _all(Body)] = ()
    connectors: Annotated[Sequence[Connector], _all(Connector)] = ()
    works: Annotated[Sequence[Work | Effect], _all(VirtualWork, Potential, Effect)] = ()

    @no_garbage_collection()
    def __post_init__(self) -> None:
        super().__post_init__()
        if not self.beams and not self.bodies:
            raise ModelError("Scene: no beams and no bodies")
        self._require_one_dimension()
        if GROUND in self.bodies:
            raise ModelError("Scene: the ground is in every scene; leave it out of bodies")
        for work in self.works if not self.beams else ():
            if not isinstance(work, Effect):
                raise ModelError(f"{work}: there is no beam that it could act on")
        self._require_once()
        known = {GROUND, *self.parts}
        for owner, place in self.attachments():
            member = place.beam if isinstance(place, Place) else place.body
            if member not in known:
                field = "beams" if isinstance(member, Beam) else "bodies"
                named = owner if isinstance(owner, Connector) else owner._label()
                raise ModelError(f"{named}: {member.name} is not in the scene; add it to {field}")
        for joint in self.joints:
            for i, place in enumerate(joint.places[1:], start=1):
                if place in joint.places[:i]:
                    raise ModelError(f"{joint}: the same place twice")
                gap = math.dist(joint.places[0].point, place.point)
                if joint.meets and gap > 1e-9 * self.size:
                    raise ModelError(
                        f"{type(joint).__name__}: joint ends lie {gap:.6g} m apart: "
                        f"{joint.places[0]} and {place}; {joint.advice}"
                    )
        for connector in self.all_connectors:
            if node(connector.a) == node(connector.b):
                raise ModelError(f"{connector}: both ends are at the same body or cross-section")
            if isinstance(connector.law, Coulomb) and connector.law.joint is not None:
                self._require_normal_force(connector, connector.law.joint)
        self._require_single_supports()

    def __getitem__(self, name: str) -> Beam | Body:
        """Return the beam or body called ``name``, as in ``scene["left"].end``.

        Raises:
            ModelError: No beam or body, or more than one, has this name.
        """
        matches = [x for x in self.parts if x.name == name]
        if len(matches) != 1:
            names = ", ".join(dict.fromkeys(str(x.name) for x in self.parts))
            raise ModelError(
                f"Scene: {len(matches) or 'no'} beams and bodies are called {name!r}; "
                f"the names are {names}; scene.beams[i] and scene.bodies[i] are found by index"
            )
        return matches[0]

    def __str__(self) -> str:
        return counted(
            (len(self.beams), "beam", "beams"), (len(self.bodies), "body", "bodies"),
            (len(self.joints), "joint", "joints"), (len(self.supports), "support", "supports"),
            (len(self.connectors), "connector", "connectors"),
            (len(self.masses), "mass", "masses"), (len(self.loads), "load", "loads"),
            (len(self.works), "work", "works"),
        )  # fmt: skip

    def _label(self) -> str:
        return "Scene"

    def __repr__(self) -> str:
        return f"<Scene: {self}>"

    @cached_property
    def in_space(self) -> bool:
        """True if points of the scene have three coordinates."""
        return 3 in self._dimensions

    @property
    def _dimensions(self) -> list[int]:
        """Numbers of coordinates of the points of the parts."""
        return [*(len(b.ends[0]) for b in self.beams), *(len(b.center) for b in self.bodies)]

    def _require_one_dimension(self) -> None:
        """Raise unless all vectors have two components, or three in a scene of known kinds."""
        d, of = (3, "in space") if self.in_space else (2, "in the plane")
        for part, own in zip(self.parts, self._dimensions, strict=True):
            if own == d:
                continue
            raise ModelError(
                f"{part.name}: its points have two coordinates, but other parts are in space; give "
                "all points three coordinates"
            )
        sizes = dict.fromkeys(("force", "acceleration", "linear", "about"), d)
        sizes |= dict.fromkeys(("moment", "angular", "rate"), 2 * d - 3) | {"normal": d - 1}
        records: list[Record] = [*self.loads, *self.initial]
        for record in records:
            for name, vector in vars(record).items():
                wanted, size = sizes.get(name), len(vector) if isinstance(vector, tuple) else 1
                if wanted not in (None, size) and vector is not None and np.any(vector):
                    raise ModelError(
                        f"{record._label()}: {name} = {vector} must have {wanted} components, "
                        f"because the scene is {of}"
                    )
        if d == 3:
            require_space(self)

    def components(self, component: int) -> tuple[int, ...]:
        """Return the unknowns of a node for a component u, v or ψ: 0, 1 or 2.

        In space the first component stands for all displacements, and the last for all rotations.
        """
        return {0: (0, 1, 2), 1: (), 2: (3, 4, 5)}[component] if self.in_space else (component,)

    def unknown(self, moved: Node, component: int) -> Unknown:
        """Return a representative of equal unknowns of nodes; components as in supports."""
        group = 2 * (component // 3) if self.in_space else component
        return self.representatives[moved, group], component

    def require_plane(self, what: str) -> None:
        """Raise :class:`ModelError` if points of the scene have three coordinates."""
        if self.in_space:
            raise ModelError(f"{what}: only for scenes in the plane, so far; this one is in space")

    @property
    def parts(self) -> list[Beam | Body]:
        """The beams, then the bodies."""
        return [*self.beams, *self.bodies]

    @cached_property
    def size(self) -> float:
        """Diameter of the smallest circle around the undeformed scene; m.

        The size does not depend on the directions of x and y.  If all points coincide, the size is
        the largest radius of gyration of a body, or 1.
        """
        beams = {(b.cells, b.corners): b for b in self.beams}  # equal beams share an array
        vertices = {kind: np.array(b.vertices(())) for kind, b in beams.items()}
        curves = [beam.curve for beam in self.beams]
        d = 3 if self.in_space else 2
        on_beams = points_along(curves, [vertices[b.cells, b.corners] for b in self.beams], d)
        others = [body.center for body in self.bodies]
        others += [place.point for _, place in self.attachments() if isinstance(place, BodyPoint)]
        points = np.concatenate([on_beams, np.reshape(others, (-1, d))])
        heavy = (b for b in self.bodies if b.mass > 0)
        gyration = [math.sqrt(np.linalg.eigvalsh(b.tensor).max() / b.mass) for b in heavy]
        return enclosing_diameter(points) or max(gyration, default=0.0) or 1.0

    @cached_property
    def all_connectors(self) -> tuple[Connector, ...]:
        """Connectors of joints, of ``connectors`` and of off-centre loads, and plastic hinges."""
        connectors = [holder for joint in self.joints for holder in joint.holders]
        connectors += [c for x in self.connectors for c in x.components or (x,)]
        connectors += [push for x in self.loads if isinstance(x, PointLoad) for push in x.pushes]
        laws = {place: law for beam in self.beams for place, law in beam.hinge_laws.items()}
        d = 3 if self.in_space else 2
        bearing: list[tuple[AttachmentPoint, Any]] = [
            (x.place, None if 5 in x.held else x.axis) for x in self.supports if x.bears_moment
        ]
        bearing += [(mass.place, None) for mass in self.masses if mass.inertia]
        for connector in connectors if laws else ():
            (by_a, by_b), is_revolute = connector.rigidly(), connector.kind == "Revolute"
            free = connector.other if is_revolute and connector.is_rotation else None
            bearing += [(connector.a, free)] * bool(any(by_a[d:]) or connector.follows_a)
            bearing += [(connector.b, free)] * any(by_b[d:])
        loaded = [load.place for load in self.moments]
        rigid = [joint.equal(2) for joint in self.joints if 2 in joint.shared]
        return (*connectors, *plastic_hinges(laws, rigid, bearing, loaded))

    @cached_property
    def hinges(self) -> tuple[Connector, ...]:
        """Plastic hinges of zero length, by ``Beam(hinges=)`` and ``Section(hinge=)``."""
        return tuple(
            connector
            for connector in self.all_connectors
            if isinstance(connector, Component) and isinstance(connector.law, RigidPlastic)
        )

    @property
    def moments(self) -> list[LoadAtPlace]:
        """Loads with a moment at a place."""
        return [x for x in self.loads if isinstance(x, LoadAtPlace) and np.any(x.moment)]

    @cached_property
    def rigid_bodies(self) -> tuple[Body, ...]:
        """Bodies, and the ground if anything is attached to the ground."""
        attached = [place for _, place in self.attachments()]
        attached += [connector.a for connector in self.all_connectors]
        return (*self.bodies, *((GROUND,) if any(node(p) is GROUND for p in attached) else ()))

    @cached_property
    def stream_keys(self) -> dict[Connector, tuple[int, int]]:
        """Keys of random values of connectors, by the points that the connectors join."""
        connectors = self.all_connectors
        keys = stream_keys((c.corner or c.a.point, c.b.point) for c in connectors)
        return dict(zip(connectors, keys, strict=True))

    def time_functions(self) -> Iterator[tuple[Record, TimeFunction]]:
        """Iterate over (record, function of time) for loads, supports, connectors and works."""
        for record in (*self.loads, *self.supports, *self.all_connectors, *self.works):
            yield from ((record, function) for function in record.functions_of_time())

    def attachments(self) -> Iterator[tuple[Record, AttachmentPoint]]:
        """Iterate over (record, place) for all places of records in the scene."""
        bound = *self.joints, *self.connectors, *self.supports, *self.masses, *self.loads
        for record in (*bound, *self.initial, *self.damping, *self.works):
            yield from ((record, place) for place in record.attached_to())

    @cached_property
    def attached(self) -> dict[Member, list[float]]:
        """Parameters s of places that must be vertices, by beam."""
        places: dict[Member, list[float]] = {beam: list(beam.hinges) for beam in self.beams}
        for _, place in self.attachments():
            if isinstance(place, Place):
                places[place.beam].append(place.s)
        return places

    def _require_once(self) -> None:
        """Raise if objects are repeated, works share a name, or rotating frames do not fit."""
        for member, twice in (*_again("beams", self.beams), *_again("bodies", self.bodies)):
            raise ModelError(f"Scene: {member.name} is in the scene {twice}")
        for field in ("joints", "connectors", "loads", "masses", "initial", "damping", "works"):
            for record, twice in _again(field, getattr(self, field)):
                raise ModelError(
                    f"Scene: {clip(str(record))} occurs {twice}; remove one, or create two records"
                )
        for joint, twice in _again(
            "joints", self.joints,
            key=lambda joint: (
                type(joint), frozenset(joint.places),
                *((holder.motion, holder.axis, id(holder.law)) for holder in joint.holders),
            ),
        ):  # fmt: skip
            raise ModelError(f"Scene: {joint} occurs {twice}; remove one")
        named = [work for work in self.works if isinstance(work, Work)]
        for work, twice in _again("works", named, key=lambda work: work.name):
            raise ModelError(
                f"Scene: {work.name!r}, the name of a work and of its entry in the energy ledger, "
                f"occurs {twice}; rename one work"
            )
        in_time = {work.in_time: work for work in self.works if isinstance(work, Potential)}
        for work in named:
            if work.name in in_time:
                raise ModelError(
                    f"Scene: {work} has the name of another entry of the energy ledger, for energy "
                    f"that {in_time[work.name]} gains by changes in time; rename one work"
                )
        frames = [load for load in self.loads if isinstance(load, RotatingFrame)]
        if len(frames) > 1:
            raise ModelError(
                f"Scene: {len(frames)} rotating frames, {frames[0]} and {frames[1]}: a scene is in "
                "one frame, and the forces of two cannot be added, because centrifugal forces are "
                "quadratic in the rate; give one RotatingFrame with the total rate"
            )
        heavy = [load for load in self.loads if isinstance(load, MovingLoad) and load.mass]
        if frames and heavy:
            raise ModelError(
                f"Scene: {heavy[0]} has a mass, on which the forces of {frames[0]} do not act; "
                "leave out the frame, and prescribe its rotation as a motion of the supports"
            )

    def _require_normal_force(self, connector: Connector, bearing: Bearing) -> None:
        """Raise unless the force of the bearing is computed, so that it can cause friction."""
        if bearing not in (*self.joints, *self.supports):
            why = "is not in the scene; add it to joints or supports"
        elif isinstance(bearing, Support) and min(bearing.held) >= bearing.displacements:
            why = "holds no displacement and bears no force; name another support or joint"
        elif isinstance(bearing, Joint) and len(bearing.places) > 2:
            why = "has more than two places, so that it has no single force; make a joint of two"
        elif isinstance(bearing, Joint) and all(holder.is_rotation for holder in bearing.holders):
            why = "shares unknowns, so that its force is not known; make it with multipliers=True"
        else:
            return
        raise ModelError(f"{connector}: {bearing}, whose force is to cause its friction, {why}")

    @property
    def shared_by_joints(self) -> list[list[NodeDof]]:
        """Groups of degrees of freedom that joints make equal."""
        equal = (joint.equal(component) for joint in self.joints for component in joint.shared)
        return [group for group in equal if group]  # none of two points away from centres

    @cached_property
    def representatives(self) -> Representatives:
        """Representatives of the degrees of freedom that joints and hinges make equal."""
        hinges = (
            [(node(connector.a), c), (node(connector.b), c)]
            for connector in self.hinges
            for c in (0, 1)
        )
        return merged([*self.shared_by_joints, *hinges])

    def _require_single_supports(self) -> None:
        components = range(6 if self.in_space else 3)
        holders: dict[Unknown, Any] = {self.unknown(GROUND, c): "the ground" for c in components}
        for support in self.supports:
            # A support with rotated axes involves all components that it rotates.
            involved = {*support.held, *(c for *pair, _ in support.turns for c in pair)}
            for component in sorted(involved):
                held = self.unknown(node(support.place), component)
                if held in holders:
                    raise ModelError(
                        f"supports in conflict: {holders[held]} and {support} both hold "
                        f"{support.names[component]}; remove one"
                    )
                holders[held] = support


IN_SPACE = (
    *(Beam, Body, *joints.IN_SPACE, *connectors.IN_SPACE, *supports.SUPPORTS, *LOADS),
    *(PointMass, Velocity, KelvinVoigt),
)
"""Classes of the objects of scenes in space."""


def require_space(scene: Scene) -> None:
    """Raise :class:`ModelError` unless all objects of a scene have a counterpart in space."""
    records: list[Any] = [*scene.joints, *scene.supports, *scene.loads, *scene.masses]
    records += [*scene.initial, *scene.damping, *scene.bodies, *scene.connectors, *scene.works]
    for record in records:
        if not isinstance(record, IN_SPACE):
            raise ModelError(
                f"{record._label()}: {type(record).__name__} is for scenes in the plane; scenes in "
                f"space have {', '.join(x.__name__ for x in IN_SPACE)}"
            )
        if isinstance(record, MovingLoad) and record.mass:
            raise ModelError(f"{record}: masses that move along beams are for scenes in the plane")
        if isinstance(record, PointMass) and record.inertia:
            raise ModelError(
                f"{record._label()}: in space only a Body has rotary inertia; join a Body by Rigid"
            )
    for beam in scene.beams:
        section = beam.section
        names = "GA3", "EI2", "GJ", *(("rhoI2",) if section.rhoI else ())
        if missing := [x for x in names if getattr(section, x) is None]:
            raise ModelError(
                f"{beam.name}: its section has no {', '.join(missing)} of beams in space; give "
                "Section(GA3=, EI2=, GJ=, rhoI2=), Section.of_shape(shear_factor3=, torsion=), or "
                "a shape with these numbers, such as Section.rectangle or structures.steel"
            )
        if section.shape and not section.shape.is_point_symmetric and not section.centroid_only:
            raise ModelError(
                f"{beam.name}: the shear centre of its section is not the centroid, and scenes in "
                "space do not model this offset; make the section with centroid_only=True to "
                "ignore it, or take a section whose shear centre is its centroid"
            )
        if section.interaction:
            raise ModelError(
                f"{beam.name}: interaction of N and M is for scenes in the plane; beams in space "
                "may have fibres, or laws axial, shear, shear3, twisting, bending2, bending, hinge"
            )
        if section.fibres and section.fibres.z is None:
            raise ModelError(
                f"{beam.name}: the fibres of its section have no z for bending about axis 2; use "
                "Section.of_fibres(y, A, z=, torsion=)"
            )


def not_in(scene: Scene, member: Member | Body) -> str:
    """Return the message that a beam or body is not in the scene."""
    hint = ""
    if any(member.name == x.name for x in scene.parts):
        hint = (
            ", which has another object of this name, as after imperfect or a second call of the "
            f"model; use scene[{member.name!r}] of this scene"
        )
    return f"{member.name} is not in the scene{hint}"


def index_of(records: Sequence[Any], record: Any, what: str = "") -> int:
    """Return the index of a record in a list of a scene; ``what`` begins the message of the error.

    Raises:
        ArgumentError: The record is not in the list.
    """
    if record not in records:
        raise ArgumentError(f"{what}{record} is not in the scene")
    return records.index(record)


def attachment_points(scene: Scene) -> dict[Body, list[BodyPoint]]:
    """Return the different attachment points of each body and of the ground."""
    points: dict[Body, dict[BodyPoint, None]] = {body: {} for body in (*scene.bodies, GROUND)}
    for record in (*scene.joints, *scene.connectors, *scene.loads):
        for place in record.attached_to():
            if isinstance(place, BodyPoint):
                points[place.body][place] = None
    return {body: list(spots) for body, spots in points.items()}


def _again(
    field: str, records: Sequence[Any], key: Callable[[Any], object] = id
) -> Iterator[tuple[Any, str]]:
    """Iterate over (repeated object, text for a message) of a list."""
    first: dict[object, int] = {}
    for i, record in enumerate(records):
        if (j := first.setdefault(key(record), i)) != i:
            yield record, f"twice, as {field}[{j}] and {field}[{i}]"
