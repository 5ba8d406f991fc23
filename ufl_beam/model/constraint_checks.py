# SPDX-License-Identifier: MIT
"""Checks of constraints and masses by rank analysis; checks of prestress and of smooth motions."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Callable, Iterable, Iterator, Sequence

import numpy as np
from scipy.sparse import csc_array, csr_array, eye_array
from scipy.sparse.linalg import splu

from ufl_beam.arrays import Array
from ufl_beam.errors import ModelError, warn
from ufl_beam.model.bodies import GROUND, AttachmentPoint, Body, Member, Node, base_of, node
from ufl_beam.model.connector_law import ConnectorLaw, ForceLaw
from ufl_beam.model.connector_laws import (
    DRIVING,
    HOLDING,
    RIGID,
    Controller,
    Coulomb,
    Damper,
    RigidPlastic,
    Spring,
    Stop,
    has_friction,
    resists,
)
from ufl_beam.model.connectors import Connector
from ufl_beam.model.functions import Point
from ufl_beam.model.loads import MovingLoad
from ufl_beam.model.material_law import initial_state
from ufl_beam.model.scene import Scene, Unknown
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
MOST = 6  # largest number of null vectors that are found for more unknowns
ROUNDS = 8  # number of inverse iterations for them
SHIFT, ZERO = 1e-14, 1e-13  # shift, and largest eigenvalue of a null vector, as fractions


def require_inertia(scene: Scene) -> None:
    """Raise :class:`ModelError` if a beam or body can move with neither inertia nor resistance."""
    d, rotations = (3, 3) if scene.in_space else (2, 1)
    own = [(beam.section.rhoA, beam.section.rhoA or beam.section.rhoI) for beam in scene.beams]
    own += [(body.mass, float(np.any(body.tensor))) for body in scene.bodies]
    inertias = [x for mass, inertia in own for x in [mass] * d + [inertia] * rotations]
    if all(inertias):
        return
    masses = [
        (mass.place, component)
        for mass in scene.masses
        for component, inertia in enumerate((*[mass.mass] * d, mass.inertia))
        if inertia
    ]

    def determines(connector: Connector) -> bool:
        if isinstance(connector.law, Stop):
            return connector.law.low == 0.0 or connector.law.high == 0.0
        return not isinstance(connector.law, DRIVING)

    rows = _constraints(scene, determines, masses)
    # Inertia determines a motion as a constraint does.
    rows += ([(column, 1.0)] for column, inertia in enumerate(inertias) if inertia)
    free = _null_space(rows, len(inertias))
    if free.shape[1] == 0:
        return
    moving = "; ".join(_moving(scene, free[:, 0])[:4])
    raise ModelError(
        f"dynamics needs mass or resistance for every motion: {moving}, without mass (rhoA or "
        "mass = 0) or inertia, and nothing determines this motion. Give the part mass (a section "
        "rho or rhoA) and inertia, hold it by a support, or join it"
    )


def _supports(scene: Scene) -> dict[Unknown, Support]:
    """Return the supports with unrotated axes by the unknowns that they hold."""
    return {
        scene.unknown(node(s.place), c): s for s in scene.supports if not s.turns for c in s.held
    }


def _fixed(scene: Scene) -> set[Unknown]:
    """Return the unknowns of the ground and of supports with unrotated axes."""
    components = range(6 if scene.in_space else 3)
    return {scene.unknown(GROUND, c) for c in components} | _supports(scene).keys()


Row = list[tuple[Node, Sequence[float]]]
"""Linear constraint: nodes with their factors of (u, v, size ψ); size of the scene in m."""

Entries = list[tuple[int, float]]
"""Row of a matrix: (column, value) of its entries; duplicates are added."""


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
    moves = _free_motions(scene, lambda x: isinstance(x.law, HOLDING)).shape[1] > 0
    raise ModelError(
        "constraints repeat or contradict each other: "
        f"{_number(combinations)} of the constraints of {'; '.join(names)} can be left out. "
        "Remove one, "
        + "let a joint hold less, as Spherical, Cylindrical or Universal in place of Revolute, "
        * scene.in_space
        + "or make it elastic: "
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
    supports = _supports(scene)
    for row in rows:
        ends = [scene.unknown(moved, c) for moved, x in row for c, y in enumerate(x) if y]
        yield from (supports[dof] for dof in ends if dof in supports)
        twice = {dof for dof in ends if ends.count(dof) > 1}
        for joint in scene.joints if twice else ():
            shared = (
                scene.unknown(moved, k)
                for c in joint.shared
                for moved, _ in joint.equal(c)
                for k in scene.components(c)
            )
            if not twice.isdisjoint(shared):
                yield joint


def friction_repeats(scene: Scene) -> bool:
    """Return whether sticking friction makes constraints linearly dependent."""
    friction = any(has_friction(connector.law) for connector in scene.all_connectors)
    return friction and _dependences(scene, friction=True)[1].shape[1] > 0


def _dependences(scene: Scene, friction: bool = False) -> tuple[list[tuple[object, Row]], Array]:
    """Find linearly dependent constraints of connectors and of supports in rotated axes.

    With ``friction``, sticking friction is a constraint, too.  The results are constraints
    with their owners, and a matrix, whose columns have factors of combinations of constraints that
    vanish.
    """

    def holds(connector: Connector) -> bool:
        return isinstance(connector.law, (*HOLDING, RigidPlastic)) or (
            friction and has_friction(connector.law)
        )

    if not any(map(holds, scene.all_connectors)):
        return [], np.zeros((0, 0))
    turned = (support for support in scene.supports if support.turns)
    rows, fixed = [*_rows(scene, holds, turned)], _fixed(scene)
    combined = [_gradient(scene, row, fixed) for _, row in rows]
    columns: dict[Unknown, Entries] = defaultdict(list)
    for number, gradient in enumerate(combined):
        for dof, factor in gradient.items():
            columns[dof].append((number, factor))
    alone = {entries[0][0] for entries in columns.values() if len(entries) == 1}
    if len(alone) == len(rows):  # each constraint has a degree of freedom of its own
        return [], np.zeros((0, 0))
    return rows, _null_space([*columns.values()], len(rows))


def _gradient(scene: Scene, row: Row, fixed: set[Unknown]) -> dict[Unknown, float]:
    """Return the factors of a constraint at the unknowns that are not ``fixed``."""
    sums: dict[Unknown, float] = defaultdict(float)
    for carrier, factors in row:
        for component, factor in enumerate(factors):
            if factor:
                sums[scene.unknown(carrier, component)] += factor
    # Factors at both ends that act on the same degree of freedom cancel to round-off.
    return {dof: x for dof, x in sums.items() if abs(x) > 1e-12 and dof not in fixed}


def require_no_mechanism(scene: Scene) -> str:
    """Raise :class:`ModelError` if the scene is a mechanism without loads.

    Loads may stabilize a mechanism, as weight stabilizes a pendulum, which only the tangent in
    equilibrium shows.  So with loads the function describes the free motions, if there are any.
    A motion without strain moves each beam as a rigid body.
    """
    free = _free_motions(scene, lambda connector: resists(connector.law))
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
        f"the scene is free to move in {_number(modes)} {ways}, so statics has no unique answer"
        f"{', for example' * (number > 1)}: {'; '.join(moving[:4])}{more}. "
    )


def _rows(
    scene: Scene, acts: Callable[[Connector], bool], supports: Iterable[Support]
) -> Iterator[tuple[object, Row]]:
    """Iterate over (owner, constraint) for connectors that ``acts`` selects, and ``supports``."""
    d = 3 if scene.in_space else 2  # number of displacements
    for connector in filter(acts, scene.all_connectors):
        scale = 1.0 if connector.is_rotation else 1 / scene.size
        ends = zip((connector.a, connector.b), connector.rigidly(), strict=True)
        yield connector, [(node(end), (*x[:d], *(y * scale for y in x[d:]))) for end, x in ends]
    for support in supports:
        for component in support.held:
            yield support, [(node(support.place), support.axes[component].tolist())]


def _units(scene: Scene, component: int) -> list[Sequence[float]]:
    """Return the factors of (u, v, size ψ) of the motions that a component stands for."""
    number = 6 if scene.in_space else 3
    return [tuple(float(i == k) for i in range(number)) for k in scene.components(component)]


def _free_motions(scene: Scene, acts: Callable[[Connector], bool]) -> Array:
    """Return a basis of the rigid motions that :func:`_constraints` allow, in columns."""
    return _null_space(_constraints(scene, acts), (6 if scene.in_space else 3) * len(scene.parts))


def _constraints(
    scene: Scene,
    acts: Callable[[Connector], bool],
    also: Iterable[tuple[AttachmentPoint, int]] = (),
) -> list[Entries]:
    """Return the constraints on rigid motions of beams and bodies.

    Rigid motions are (u, v, size ψ), in space (u, v, w, size times rotation vector).  Constraints
    are of joints, supports, connectors that ``acts`` selects and degrees of freedom in ``also``,
    and of beams and places with works, because a work may hold them.
    """
    rows: list[Row] = [
        [(first, [-x for x in unit]), (second, unit)]
        for (first, component), *others in scene.shared_by_joints
        for second, _ in others
        for unit in _units(scene, component)
    ]
    rows += (row for _, row in _rows(scene, acts, scene.supports))
    worked = [x for work in scene.works for x in work.places]
    worked += [beam.start for work in scene.works for beam in work.on(scene.beams)]
    also = (*also, *((place, component) for place in worked for component in range(3)))
    rows += ([(node(place), unit)] for place, c in also for unit in _units(scene, c))
    number = 6 if scene.in_space else 3
    bases: dict[Member | Body, tuple[int, Point]] = {
        part: (number * i, base_of(part).point) for i, part in enumerate(scene.parts)
    }

    def entries(moved: Node, factors: Sequence[float]) -> Entries:
        if moved is GROUND:
            return []
        point = moved.center if isinstance(moved, Body) else moved.point
        first, base = bases[moved if isinstance(moved, Body) else moved.beam]
        arm = [(p - c) / scene.size for p, c in zip(point, base, strict=True)]
        if number == 6:
            turning = np.add(factors[3:], np.cross(arm, factors[:3])).tolist()
            return [*enumerate([*factors[:3], *turning], first)]
        (x, y), (u, v, ψ) = arm, factors
        return [(first, u), (first + 1, v), (first + 2, ψ + v * x - u * y)]

    return [[entry for end in row for entry in entries(*end)] for row in rows]


def _number(vectors: Array) -> str:
    """Return the number of null vectors, which are columns, for a message."""
    unknowns, number = vectors.shape
    return f"at least {number}" if number == MOST and unknowns > DENSE else str(number)


def _null_space(rows: Sequence[Entries], unknowns: int) -> Array:
    """Return a basis of the null space of a matrix, in columns; at most :data:`MOST` if large."""
    if unknowns <= DENSE:
        dense = np.zeros((len(rows), unknowns))
        for line, row in zip(dense, rows, strict=True):
            for column, value in row:
                line[column] += value
        _, sizes, vectors = np.linalg.svd(dense, full_matrices=True)
        rank = int(np.sum(sizes > 1e-10 * max(1.0, sizes.max(initial=0.0))))
        return np.asarray(vectors[rank:].T)
    columns, values = np.array([entry for row in rows for entry in row]).reshape(-1, 2).T
    ends = np.cumsum([0, *map(len, rows)])
    matrix = csr_array((values, columns.astype(int), ends), shape=(len(rows), unknowns))
    # Inverse iteration with a shift that makes the matrix regular
    gram = csc_array(matrix.T @ matrix)
    size = max(1.0, gram.diagonal().max())
    shifted = csc_array(gram + SHIFT * size * eye_array(unknowns))
    factors = splu(shifted, "MMD_AT_PLUS_A", diag_pivot_thresh=0.0, options={"SymmetricMode": True})
    X = np.random.default_rng(0).normal(size=(unknowns, MOST))
    for _ in range(ROUNDS):
        X, _ = np.linalg.qr(factors.solve(X))
    values, vectors = np.linalg.eigh(X.T @ (gram @ X))
    return np.asarray(X @ vectors[:, values < ZERO * size])


def _moving(scene: Scene, mode: Array) -> list[str]:
    """Describe the rigid motion of each beam and body that moves in a mode."""
    kinds = [f"beam {i}" for i in range(len(scene.beams))]
    kinds += [f"body {i}" for i in range(len(scene.bodies))]
    texts = []
    first = np.round(np.abs(mode) / np.abs(mode).max(), 9).argmax()
    motions = (mode / mode[first]).reshape(len(kinds), -1)  # signs do not depend on round-off
    for kind, part, motion in zip(kinds, scene.parts, motions, strict=True):
        d = len(motion) // 2 + len(motion) % 2  # number of displacements
        u, ψ = motion[:d], motion[d:]
        turns, base = np.linalg.norm(ψ), base_of(part).point
        if turns >= 1e-6:
            away = np.cross(ψ, u) if d == 3 else np.array([-u[1], u[0]]) * ψ
            at = np.array(base) + scene.size * away / turns**2
            center = scene.size * np.round(at / scene.size, 9) + 0.0
            axis = np.round(ψ / turns, 9) + 0.0
            about = f"the axis {_listed(axis)} through " if d == 3 else ""
            texts.append(f"{part.name} ({kind}) can turn about {about}{_listed(center, 4)}")
        elif np.abs(u).max() > 1e-6:
            texts.append(f"{part.name} ({kind}) can shift along {_listed(np.round(u, 9) + 0.0)}")
    return texts


def _listed(vector: Array, digits: int = 3) -> str:
    return f"({', '.join(f'{x:.{digits}g}' for x in vector)})"


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
        scales = np.ones(6 if scene.in_space else 3)
        scales[len(scales) // 2 + len(scales) % 2 :] /= scene.size  # of curvatures
        for points in beam.section.section_points(None, scene.in_space):
            strains = LAST_DIGITS * np.abs(points.strains) @ scales
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

    Motors are left out, because a state for their start may hold them.  The gradient of such a
    motion is a combination of constraints between the same places, or vanishes.
    """
    if not scene.connectors:
        return
    fixed = _fixed(scene) - {
        scene.unknown(node(s.place), c) for s in scene.supports for c in s.moving
    }
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
            if free or isinstance(part.law, (*HOLDING, RigidPlastic, *DRIVING)):
                break
            names += [str(j) for (_, j), x in zip(held, shares, strict=True) if abs(x) > 1e-9]
            names += map(str, () if own.any() else _supports_and_joints_at(scene, [rows[part]]))
        else:
            warn(
                f"{owner}: its motion is held at zero by {'; '.join(dict.fromkeys(names))}, so "
                "that it bears nothing and has no effect. Leave the motion free, with Revolute "
                "instead of Rigid or Pinned instead of Clamped, or leave out the connector"
            )


def parts_that_switch(scene: Scene) -> Iterator[tuple[str, str]]:
    """Yield names of parts of a scene that may slide, touch, yield or break, with a reason."""
    for beam in scene.beams:
        if beam.section.section_points(beam.section.hinge, scene.in_space):
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
