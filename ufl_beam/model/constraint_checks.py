# SPDX-License-Identifier: MIT
"""Checks of constraints and masses by rank analysis; checks of prestress and time schemes."""

from __future__ import annotations

import math
from collections import defaultdict
from collections.abc import Callable, Iterable, Iterator, Sequence
from typing import Protocol

import numpy as np
from scipy.sparse import csr_array
from scipy.sparse.linalg import eigsh

from ufl_beam.arrays import Array
from ufl_beam.errors import ModelError, warn
from ufl_beam.model.bodies import GROUND, AttachmentPoint, Body, Member, Node, NodeDof, node
from ufl_beam.model.connector_law import ConnectorLaw, ForceLaw
from ufl_beam.model.connector_laws import (
    HOLDING,
    RESISTING,
    RIGID,
    Controller,
    Coulomb,
    Damper,
    PrescribedForce,
    RigidPlastic,
    Spring,
    Stop,
    has_friction,
    resists,
)
from ufl_beam.model.connectors import Connector
from ufl_beam.model.functions import Point
from ufl_beam.model.loads import MovingLoad, RotatingFrame
from ufl_beam.model.material_law import initial_state
from ufl_beam.model.scene import Scene
from ufl_beam.model.supports import Support
from ufl_beam.model.works import Effect, VirtualWork

INSTEAD = "Add supports or joints, or run dynamics (EnergyMomentum)"
"""Advice if statics has no unique answer."""

IF_SINGULAR = (
    ". If a linkage repeats constraints in this position only, such as at a dead centre, where "
    "links are in line, then begin in another position"
)
"""Advice if constraints repeat each other in the undeformed scene, and parts can move there."""

LAST_DIGITS = 1e-12
"""Strain, rotation, or displacement by size of the scene, whose stress counts as round-off."""

DENSE = 90  # largest number of unknowns for which the null space comes from a dense decomposition


def require_inertia(scene: Scene) -> None:
    """Raise :class:`ModelError` if a beam or body can move with neither inertia nor resistance.

    Rigid motions without inertia need stiffness, damping or constraints.  Otherwise the equations
    of motion are singular.
    """
    inertias = [(s.rhoA, s.rhoA, s.rhoA or s.rhoI) for s in (beam.section for beam in scene.beams)]
    inertias += [(body.mass, body.mass, body.inertia) for body in scene.bodies]
    loose = np.flatnonzero(np.array(inertias) == 0.0)  # columns of the matrix of _constraints
    if not loose.size:
        return
    masses = [
        (mass.place, component)
        for mass in scene.masses
        for component, inertia in enumerate((mass.mass, mass.mass, mass.inertia))
        if inertia
    ]

    def determines(connector: Connector) -> bool:
        if isinstance(connector.law, Stop):
            return connector.law.low == 0.0 or connector.law.high == 0.0
        return isinstance(connector.law, (*RESISTING, ConnectorLaw, Damper, Coulomb))

    rows = _constraints(scene, determines, masses)
    free = _null_space(rows[:, loose])
    if free.shape[1] == 0:
        return
    mode = np.zeros(rows.shape[1])
    mode[loose] = free[:, 0]
    moving = "; ".join(_moving(scene, mode)[:4])
    raise ModelError(
        f"dynamics needs mass or resistance for every motion: {moving}, without mass (rhoA or "
        "mass = 0) or inertia, and nothing determines this motion. Give the part mass (a section "
        "rho or rhoA) and inertia, hold it by a support, or join it"
    )


def _fixed(scene: Scene) -> set[NodeDof]:
    """Return the degrees of freedom of the ground and of supports with unrotated axes."""
    same = scene.representatives
    by_supports = {same[node(s.place), c] for s in scene.supports if not s.angle for c in s.held}
    return {same[GROUND, component] for component in range(3)} | by_supports


Row = list[tuple[Node, Sequence[float]]]
"""Linear constraint: nodes with their factors of (u, v, size ψ); size of the scene in m."""


def require_independent(scene: Scene) -> None:
    """Raise :class:`ModelError` if constraints repeat or contradict each other.

    Such constraints have linearly dependent gradients in the undeformed scene, with respect to the
    free degrees of freedom.  Rigid-plastic connectors count as constraints.
    """
    rows, combinations = _dependences(scene)
    if combinations.shape[1] == 0:
        return
    dependent = [rows[i] for i in np.flatnonzero(np.abs(combinations).max(axis=1) > 1e-6)]
    joints = {holder: joint for joint in scene.joints for holder in joint.holders}
    owners: list[object] = [joints.get(owner, owner) for owner, _ in dependent]
    owners += _supports_and_joints_at(scene, [row for _, row in dependent])
    names = [
        f"{owner} with {type(owner.law).__name__}" if isinstance(owner, Connector) else str(owner)
        for owner in {id(owner): owner for owner in owners}.values()
    ]
    rigid = any(isinstance(getattr(owner, "law", None), RigidPlastic) for owner in owners)
    moves = _null_space(_constraints(scene, lambda x: isinstance(x.law, HOLDING))).shape[1] > 0
    raise ModelError(
        "constraints repeat or contradict each other: "
        f"{combinations.shape[1]} of the constraints of {'; '.join(names)} can be left out. "
        "Remove one, or make it elastic: "
        + (
            "a RigidPlastic connector holds its motion until it yields, and a "
            "Spring(stiffness, law=...) yields, too; replace two in parallel by one with the "
            "sum of the limits"
            if rigid
            else "a Spring, or a Beam instead of a rigid part"
        )
        + moves * IF_SINGULAR
    )


def _supports_and_joints_at(scene: Scene, rows: Iterable[Row]) -> Iterator[object]:
    """Iterate over supports and joints that act on degrees of freedom of constraints ``rows``."""
    same = scene.representatives
    supports = {same[node(s.place), c]: s for s in scene.supports for c in s.held if not s.angle}
    for row in rows:
        ends = [same[moved, c] for moved, factors in row for c in range(3) if factors[c]]
        yield from (supports[dof] for dof in ends if dof in supports)
        twice = {dof for dof in ends if ends.count(dof) > 1}
        for joint in scene.joints:
            if any(same[dof] in twice for c in joint.shared for dof in joint.equal(c)):
                yield joint


def friction_repeats(scene: Scene) -> bool:
    """Return whether sticking friction makes constraints linearly dependent."""
    friction = any(has_friction(connector.law) for connector in scene.all_connectors)
    return friction and _dependences(scene, friction=True)[1].shape[1] > 0


def _dependences(scene: Scene, friction: bool = False) -> tuple[list[tuple[object, Row]], Array]:
    """Find linearly dependent constraints of connectors and of supports in rotated axes.

    With ``friction``, sticking friction is a constraint, too.  The function returns candidates,
    which are constraints with their owners, and a matrix.  Each column has the factors of a linear
    combination of candidates that vanishes at all free degrees of freedom.  A constraint that alone
    acts on a degree of freedom is independent.  Such constraints are removed one by one.
    """

    def holds(connector: Connector) -> bool:
        return isinstance(connector.law, (*HOLDING, RigidPlastic)) or (
            friction and has_friction(connector.law)
        )

    if not any(map(holds, scene.all_connectors)):
        return [], np.zeros((0, 0))
    turned = (support for support in scene.supports if support.angle)
    rows, fixed = [*_rows(scene, holds, turned)], _fixed(scene)
    combined = [_gradient(scene, row, fixed) for _, row in rows]
    rows_at: dict[NodeDof, set[int]] = defaultdict(set)
    for number, gradient in enumerate(combined):
        for dof in gradient:
            rows_at[dof].add(number)
    left = set(range(len(rows)))
    alone = [dof for dof, indices in rows_at.items() if len(indices) == 1]
    while alone:
        for number in rows_at[alone.pop()] & left:
            left.discard(number)
            for dof in combined[number]:
                rows_at[dof].discard(number)
                if len(rows_at[dof]) == 1:
                    alone.append(dof)
    if not left:
        return [], np.zeros((0, 0))
    indices = sorted(left)
    columns: dict[NodeDof, int] = {}
    terms = [
        (columns.setdefault(dof, len(columns)), column, factor)
        for column, number in enumerate(indices)
        for dof, factor in combined[number].items()
    ]
    gradients = _matrix(terms, (max(len(columns), 1), len(indices)))
    return [rows[number] for number in indices], _null_space(gradients)


def _gradient(scene: Scene, row: Row, fixed: set[NodeDof]) -> dict[NodeDof, float]:
    """Return the factors of a constraint at the degrees of freedom that are not ``fixed``."""
    sums: dict[NodeDof, float] = defaultdict(float)
    for carrier, factors in row:
        for component, factor in enumerate(factors):
            sums[scene.representatives[carrier, component]] += factor
    # Factors at both ends that act on the same degree of freedom cancel to round-off.
    return {dof: x for dof, x in sums.items() if abs(x) > 1e-12 and dof not in fixed}


def require_no_mechanism(scene: Scene) -> str:
    """Raise :class:`ModelError` if the scene is a mechanism without loads.

    Loads may stabilize a mechanism, as weight stabilizes a pendulum.  Only the tangent stiffness in
    equilibrium shows this.  So for a mechanism with loads the function returns a description of the
    free motions, otherwise an empty text.  A motion without strain moves each beam as a rigid body.
    Such a motion exists if the constraints on rigid motions have a null space.
    """
    free = _null_space(_constraints(scene))
    if free.shape[1] == 0:
        return ""
    description = describe_motions(scene, free)
    if not scene.loads:
        raise ModelError(description + INSTEAD)
    return description


def describe_motions(scene: Scene, modes: Array) -> str:
    """Describe independent rigid motions (u, v, size ψ) of beams and bodies, one in each column."""
    number, moving = modes.shape[1], _moving(scene, modes[:, 0])
    more = f"; and {len(moving) - 4} more" if len(moving) > 4 else ""
    ways = "way" if number == 1 else "independent ways"
    return (
        f"the scene is free to move in {number} {ways}, so statics has no unique answer"
        f"{', for example' * (number > 1)}: {'; '.join(moving[:4])}{more}. "
    )


def _center(member: Member | Body) -> Point:
    """Return the reference point: centre of a body, or midpoint between the ends of a beam."""
    if isinstance(member, Body):
        return member.center
    (xa, ya), (xb, yb) = member.start.point, member.end.point
    return (xa + xb) / 2, (ya + yb) / 2


def _rows(
    scene: Scene, acts: Callable[[Connector], bool], supports: Iterable[Support]
) -> Iterator[tuple[object, Row]]:
    """Iterate over (owner, constraint) for connectors that ``acts`` selects, and ``supports``."""
    for connector in filter(acts, scene.all_connectors):
        scale = 1.0 if connector.is_rotation else 1 / scene.size
        ends = zip((connector.a, connector.b), connector.rigidly(), strict=True)
        yield connector, [(node(end), (x, y, z * scale)) for end, (x, y, z) in ends]
    for support in supports:
        cos, sin = math.cos(support.angle), math.sin(support.angle)
        turned = (cos, sin, 0.0), (-sin, cos, 0.0), (0.0, 0.0, 1.0)
        for component in support.held:
            yield support, [(node(support.place), turned[component])]


def _constraints(
    scene: Scene,
    acts: Callable[[Connector], bool] = lambda connector: resists(connector.law),
    also: Iterable[tuple[AttachmentPoint, int]] = (),
) -> Array | csr_array:
    """Assemble the matrix of constraints on rigid motions (u, v, size ψ) of beams and bodies.

    The n rows are for joints, supports, connectors that ``acts`` selects and degrees of freedom in
    ``also``, and for beams and places with works, because a work may hold them.  The shape is
    (n, 3 times the number of beams and bodies).
    """
    unit = (1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, 0.0, 1.0)
    rows: list[Row] = [
        [(first, [-x for x in unit[component]]), (second, unit[component])]
        for (first, component), *others in scene.shared_by_joints
        for second, _ in others
    ]
    rows += (row for _, row in _rows(scene, acts, scene.supports))
    worked = [x for work in scene.works for x in work.places]
    worked += [beam.start for work in scene.works for beam in work.on(scene.beams)]
    also = (*also, *((place, component) for place in worked for component in range(3)))
    rows += ([(node(place), unit[component])] for place, component in also)
    moving: dict[object, int] = {
        member: i for i, member in enumerate((*scene.beams, *scene.bodies))
    }
    terms: list[tuple[int, int, float]] = []
    for i, row in enumerate(rows):
        for moved, factors in row:
            if moved is not GROUND:
                member, (px, py) = (
                    (moved, moved.center) if isinstance(moved, Body) else (moved.beam, moved.point)
                )
                cx, cy = _center(member)
                x, y = (px - cx) / scene.size, (py - cy) / scene.size
                u, v, ψ = factors
                gradient = u, v, ψ + v * x - u * y
                terms += ((i, 3 * moving[member] + k, factor) for k, factor in enumerate(gradient))
    return _matrix(terms, (max(len(rows), 1), 3 * len(moving)))


def _matrix(terms: Sequence[tuple[int, int, float]], shape: tuple[int, int]) -> Array | csr_array:
    """Build a matrix from (row, column, value) of its entries; duplicates are added.

    The matrix is sparse if it has more than :data:`DENSE` columns.
    """
    rows, columns, values = np.array(terms).reshape(-1, 3).T
    places = rows.astype(int), columns.astype(int)
    if shape[1] > DENSE:
        return csr_array((values, places), shape=shape)
    matrix = np.zeros(shape)
    np.add.at(matrix, places, values)
    return matrix


def _null_space(constraints: Array | csr_array) -> Array:
    """Return a basis of the null space, in columns; above :data:`DENSE` unknowns at most 6."""
    unknowns = constraints.shape[1]
    if unknowns <= DENSE:
        dense = constraints.toarray() if isinstance(constraints, csr_array) else constraints
        _, sizes, rows = np.linalg.svd(dense, full_matrices=True)
        rank = int(np.sum(sizes > 1e-10 * max(1.0, sizes.max(initial=0.0))))
        return np.asarray(rows[rank:].T)
    gram = csr_array(constraints.T @ constraints).tocsc()
    values, vectors = eigsh(gram, k=6, sigma=-1e-9, which="LM", v0=np.ones(unknowns))
    return np.asarray(vectors[:, values < 1e-13 * abs(gram).max()])


def _moving(scene: Scene, mode: Array) -> list[str]:
    """Describe the rigid motion of each beam and body that moves in a mode."""
    moving: list[tuple[str, Member | Body]] = [(f"beam {i}", b) for i, b in enumerate(scene.beams)]
    moving += [(f"body {i}", body) for i, body in enumerate(scene.bodies)]
    texts = []
    motions = (mode / np.abs(mode).max()).reshape(-1, 3)
    for (kind, member), (u, v, ψ) in zip(moving, motions, strict=True):
        if abs(ψ) >= 1e-6:
            cx, cy = _center(member)
            center = (cx - v / ψ * scene.size, cy + u / ψ * scene.size)
            x, y = (scene.size * round(c / scene.size, 9) + 0.0 for c in center)
            texts.append(f"{member.name} ({kind}) can turn about ({x:.4g}, {y:.4g})")
        elif max(abs(u), abs(v)) > 1e-6:
            texts.append(f"{member.name} ({kind}) can shift along ({u:.3g}, {v:.3g})")
    return texts


def require_no_prestress(scene: Scene, what: str, instead: str) -> None:
    """Raise :class:`ModelError` if a law has a stress at zero strain, such as by an eigenstrain.

    The undeformed scene, from which the analysis starts, is then not in equilibrium.
    """
    wrong: list[tuple[object, object, str]] = []
    for connector in scene.all_connectors:
        law, moved = connector.law, LAST_DIGITS * (1.0 if connector.is_rotation else scene.size)
        if isinstance(law, ConnectorLaw):
            rest, i = [np.zeros(1)] * law.components, connector.component
            ends = (rest, [*rest[:i], rest[i] + moved, *rest[i + 1 :]])
            state = initial_state(law)
            at_rest, strained = (law.elastic_forces(e, state)[i][0] for e in ends)
            if abs(at_rest) > abs(strained - at_rest):
                wrong.append((connector, law, "a force at no motion"))
        elif isinstance(law, Spring):
            if law.bulk.stressed((np.float64(law.stiffness),), (moved,)):
                wrong.append((connector, law.law or law, "a stress at no strain"))
    for beam in scene.beams:
        for points in beam.section.section_points(None):
            strains = LAST_DIGITS * np.abs(points.strains) @ [1.0, 1.0, 1.0 / scene.size]
            by_point = np.stack([points.stiffness, strains], axis=1)
            by_point = by_point.reshape(len(points.weights), -1, 2)
            first = np.cumsum([0, *(n for _, n in points.laws)])
            for (bulk, _), k in zip(points.laws, first[:-1], strict=True):
                if bulk.stressed(*map(tuple, by_point[k].T)):
                    wrong.append((beam.name, bulk, "a stress at no strain"))
    if wrong:
        owner, stressed, force = wrong[0]
        raise ModelError(
            f"{what}: {type(stressed).__name__} of {owner} bears {force}, so that the undeformed "
            f"scene is not in equilibrium; {instead}"
        )


def warn_of_held_motions(scene: Scene) -> None:
    """Warn of springs, dampers and hinges whose motion joints or supports hold at zero.

    Motors are left out, because a state for their start may hold them.
    The gradient of such a motion is a combination of constraints of joints between the same places,
    or vanishes at all free degrees of freedom.
    """
    if not scene.connectors:
        return
    moving = [(node(s.place), c) for s in scene.supports for c in s.moving]
    fixed = _fixed(scene) - {scene.representatives[dof] for dof in moving}
    rows, between = dict[object, Row](_rows(scene, lambda _: True, ())), defaultdict(list)
    for joint in scene.joints:
        for holder in joint.holders:
            if holder.law is RIGID:
                between[frozenset(end for end, _ in rows[holder])].append((holder, joint))
    for owner in scene.connectors:
        names = list[str]()
        for part in owner.components or (owner,):
            held = between[frozenset(end for end, _ in rows[part])]
            gradients = [_gradient(scene, rows[x], fixed) for x in (*(x for x, _ in held), part)]
            dofs = [*dict.fromkeys(dof for x in gradients for dof in x)]
            *others, own = np.array([[x.get(dof, 0.0) for dof in dofs] for x in gradients])
            G = np.reshape(others, (len(held), len(dofs))).T
            shares = np.linalg.lstsq(G, own, rcond=None)[0]
            free = np.abs(own - G @ shares).max(initial=0.0) > 1e-9
            if free or isinstance(part.law, (*HOLDING, RigidPlastic, Controller, PrescribedForce)):
                break
            names += [str(j) for (_, j), x in zip(held, shares, strict=True) if abs(x) > 1e-9]
            names += map(str, () if own.any() else _supports_and_joints_at(scene, [rows[part]]))
        else:
            warn(
                f"{owner}: its motion is held at zero by {'; '.join(dict.fromkeys(names))}, so "
                "that it bears nothing and has no effect. Leave the motion free, with Revolute "
                "instead of Rigid or Pinned instead of Clamped, or leave out the connector"
            )


class Rated(Protocol):
    """Properties of a time scheme that :func:`require_rates` reads."""

    @property
    def has_mean_velocity(self) -> bool:
        """Whether a step has a mean velocity, see :class:`DynamicScheme`."""

    @property
    def accelerations_oscillate(self) -> bool:
        """Whether prescribed accelerations oscillate, see :class:`DynamicScheme`."""


def require_rates(scene: Scene, scheme: Rated) -> None:
    """Raise :class:`ModelError` if a scheme lacks a mean velocity or damping that a scene needs."""
    name = type(scheme).__name__
    for owner, what in [
        *((c, c.law) for c in scene.all_connectors),
        *((x, x) for x in scene.loads),
    ]:
        if (isinstance(what, RotatingFrame) or has_friction(what)) and not scheme.has_mean_velocity:
            raise ModelError(
                f"{name}: {owner} needs the mean velocity of a step, and this scheme takes all "
                "forces at the end of the step; use EnergyMomentum() or EnergyMomentumDecaying()"
            )
    if not scheme.accelerations_oscillate:
        return
    prescribed = [str(c) for c in scene.all_connectors if isinstance(c.law, HOLDING)]
    prescribed += [f"the support of {s.place}" for s in scene.supports if s.moving]
    if prescribed:
        raise ModelError(
            f"{name}: {prescribed[0]} prescribes a motion, whose accelerations oscillate for ever "
            "without numerical damping; use GeneralizedAlpha(0.8), or EnergyMomentum()"
        )


def parts_that_switch(scene: Scene) -> Iterator[tuple[str, str]]:
    """Yield names of parts of a scene that may slide, touch, yield or break, with a reason."""
    for beam in scene.beams:
        if beam.section.section_points(beam.section.hinge):
            yield beam.name, "may yield or break"
    for connector in scene.all_connectors:
        law, name = connector.law, f"{type(connector.law).__name__} of {connector}"
        yields = isinstance(law, Spring) and (law.law or law.softening)
        if isinstance(law, Coulomb):
            yield name, "dissipates"
        elif yields or isinstance(law, RigidPlastic):
            yield name, "may yield or break"
        elif isinstance(law, ConnectorLaw):
            yield name, "may dissipate, and may have kinks"


def require_smooth(scene: Scene, scheme: object) -> None:
    """Raise :class:`ModelError` if a part of a scene dissipates or has kinks.

    A scheme whose stages go backward in time needs motions that are the same in both directions of
    time, and smooth in a step.
    """
    wrong = [(type(x).__name__, "dissipates") for x in scene.damping]
    wrong += parts_that_switch(scene)
    for connector in scene.all_connectors:
        law, name = connector.law, f"{type(connector.law).__name__} of {connector}"
        if isinstance(law, Damper):
            wrong.append((name, "dissipates"))
        elif isinstance(law, ForceLaw | Controller):
            wrong.append((name, "may dissipate, and may have kinks"))
    for load in scene.loads:
        if isinstance(load, MovingLoad):
            wrong.append((str(load), "has a kink in time where it passes from a cell to the next"))
    for work in scene.works:
        if isinstance(work, Effect):
            wrong.append((str(work), "may dissipate, and may have kinks"))
        elif isinstance(work, VirtualWork) and not {"q0", "q1", "v", "dt"}.isdisjoint(
            work.used_arguments
        ):
            wrong.append((str(work), "depends on the direction of time by q0, q1, v or dt"))
    if wrong:
        owner, fault = wrong[0]
        raise ModelError(
            f"{type(scheme).__name__} of fourth order: {owner} {fault}, and a stage of each step "
            "goes backward in time; use EnergyMomentum() of second order, or leave the part out"
        )
