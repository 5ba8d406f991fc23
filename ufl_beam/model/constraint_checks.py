# SPDX-License-Identifier: MIT
"""Rank analysis: what may move without strain, and what is held twice."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Sequence
from typing import Protocol

import numpy as np
from scipy.sparse import csr_array
from scipy.sparse.linalg import eigsh

from ufl_beam.arrays import Array
from ufl_beam.errors import SceneError
from ufl_beam.model.bodies import GROUND, Anchor, Body, Member, Node, node
from ufl_beam.model.connector_laws import (
    Coulomb,
    Damper,
    Guide,
    Motor,
    RigidPlastic,
    Spring,
    Stop,
)
from ufl_beam.model.connectors import Connector
from ufl_beam.model.curves import Point
from ufl_beam.model.force_laws import ForceLaw
from ufl_beam.model.loads import RotatingFrame
from ufl_beam.model.plastic_hinges import NodeDof, shared_by_joints
from ufl_beam.model.scene import Scene
from ufl_beam.model.time_functions import value_at

DENSE = 90
"""Up to this number of unknowns the null space comes from a dense decomposition."""


def require_masses(scene: Scene) -> None:
    """Raise :class:`SceneError` if a body that may move has no mass, unless a beam carries it."""
    same, moved = scene.representatives, _fixed(scene)
    for alike in shared_by_joints(scene.joints):
        moved |= {same.get(dof, dof) for dof in alike if not isinstance(dof[0], Body)}
    for body in scene.bodies:
        for name, components in (("mass", (0, 1)), ("inertia", (2,))):
            dofs = [(body, component) for component in components]
            free = any(same.get(dof, dof) not in moved for dof in dofs)
            if free and getattr(body, name) == 0.0:
                raise SceneError(
                    f"{body.name}: {name} = 0, but dynamics needs it to be positive; use RigidLink "
                    "or Link for what has no mass"
                )


def require_inertia(scene: Scene) -> None:
    """Raise :class:`SceneError` if a part of the scene has no mass and nothing determines it.

    Its rigid motions must be held, by stiffness, damping or constraints, or have inertia: else the
    equations of motion are singular.
    """
    loose = _without_inertia(scene)
    if not loose:
        return
    masses = [
        (one.place, component)
        for one in scene.masses
        for component, inertia in enumerate((one.mass, one.mass, one.inertia))
        if inertia
    ]
    rows = _constraints(scene, _determines, [*masses, *_under_works(scene)])
    free = _null_space(csr_array(rows[:, loose]))
    if free.shape[1] == 0:
        return
    mode = np.zeros(rows.shape[1])
    mode[loose] = free[:, 0] / np.abs(free[:, 0]).max()
    parts = "; ".join(_moving(scene, mode)[:4])
    raise SceneError(
        f"dynamics needs mass or something that holds: {parts}, without mass (rhoA or mass = "
        "0), and nothing determines this motion. Give it mass (a section rho or rhoA), or hold or "
        "join it"
    )


def _without_inertia(scene: Scene) -> list[int]:
    """Numbers of the rigid motions (u, v, size ψ) of parts that have no inertia of their own."""
    beams = [(one.section.rhoA, one.section.rhoA or one.section.rhoI) for one in scene.beams]
    bodies = [(one.mass, one.inertia) for one in scene.bodies]
    loose: list[int] = []
    for i, (mass, inertia) in enumerate((*beams, *bodies)):
        loose += [3 * i, 3 * i + 1] * bool(mass == 0.0) + [3 * i + 2] * bool(inertia == 0.0)
    return loose


def _under_works(scene: Scene) -> list[tuple[Anchor, int]]:
    """Components of motion of the beams on which works of the user act: they may hold them."""
    beams = (beam for work in scene.works for beam in work.on(scene.beams))
    return [(beam.start, component) for beam in beams for component in range(3)]


def _determines(link: Connector) -> bool:
    """Return true if a connector determines its motion where nothing has mass."""
    if isinstance(link.law, Stop):
        return link.law.low == 0.0 or link.law.high == 0.0
    return isinstance(link.law, (*RESISTING, Damper, Coulomb))


def no_number(scene: Scene, times: Iterable[float]) -> str:
    """Name the owner of a time function that is not finite at one of the times; else empty."""
    for t in times:
        for owner, function in scene.time_functions():
            if not math.isfinite(value := value_at(function, t, owner)):
                return f"{owner}: the time function is {value} at t = {t:.9g} s"
    return ""


def _fixed(scene: Scene) -> set[NodeDof]:
    """Return the components of motion that the ground and supports give."""
    same = scene.representatives
    fixed: set[NodeDof] = {(GROUND, component) for component in range(3)}
    fixed |= {(node(s.place), c) for s in scene.supports if not s.angle for c in s.held}
    return {same.get(dof, dof) for dof in fixed}


HOLDING = (Motor, Guide)
"""Laws of connectors that give the motion."""

Demand = tuple[str, list[tuple[NodeDof, float]]]
"""Who demands, and the factors of what moves in it; rotations times the size of the scene."""


def require_independent(scene: Scene) -> None:
    """Raise :class:`SceneError` if constraints repeat or contradict each other.

    They do if their gradients in the undeformed scene, by what moves freely, are dependent.
    """
    if not any(isinstance(link.law, HOLDING) for link in scene.links):
        return
    demands = _demands(scene, HOLDING)
    within = _dependences(demands)
    if within.shape[1] == 0:
        return
    dependent = np.flatnonzero(np.abs(within).max(axis=1) > 1e-6)
    names = list(dict.fromkeys(demands[i][0] for i in dependent))
    raise SceneError(
        f"constraints repeat or contradict each other: {within.shape[1]} of those of "
        f"{'; '.join(names)} can be left out. Remove one, or make it elastic: a Spring, or a Beam "
        "in the place of a rigid part"
    )


def friction_repeats(scene: Scene) -> bool:
    """Return whether places that stick hold what is held already, by joints or by each other."""
    if not any(isinstance(link.law, Coulomb) for link in scene.links):
        return False
    return _dependences(_demands(scene, (*HOLDING, Coulomb))).shape[1] > 0


def _dependences(demands: list[Demand]) -> Array:
    """Combinations of demands that demand nothing; (num_demands, k)."""
    columns = {dof: i for i, dof in enumerate({s: 0 for _, f in demands for s, _ in f})}
    entries = [
        (columns[dof], row, factor)
        for row, (_, factors) in enumerate(demands)
        for dof, factor in factors
    ]
    return _null_space(_sparse(entries, (max(len(columns), 1), len(demands))))


def _demands(scene: Scene, laws: tuple[type, ...]) -> list[Demand]:
    """Return the constraints that connectors of some laws and supports in turned axes make."""
    same, fixed = scene.representatives, _fixed(scene)

    def free(factors: Iterable[tuple[Node, int, float]]) -> list[tuple[NodeDof, float]]:
        dofs = (((of, c), factor) for of, c, factor in factors if factor)
        known = ((same.get(dof, dof), factor) for dof, factor in dofs)
        return [(dof, factor) for dof, factor in known if dof not in fixed]

    demands: list[Demand] = []
    for link in scene.links:
        if isinstance(link.law, laws):
            unit = (1.0, 1.0, 1.0 if link.turns else 1 / scene.size)
            pairs = zip((link.a, link.b), link.rigidly(), strict=True)
            factors = [(node(at), c, f[c] * unit[c]) for at, f in pairs for c in range(3)]
            owner = next((joint for joint in scene.joints if link in joint.holders), link)
            demands.append((str(owner), free(factors)))
    for support in scene.supports:
        if support.angle:
            of, cos, sin = node(support.place), math.cos(support.angle), math.sin(support.angle)
            rows = {0: (cos, sin), 1: (-sin, cos)}
            for c in support.held.keys() & rows.keys():
                demands.append((str(support), free((of, k, rows[c][k]) for k in range(2))))
    return demands


def require_no_mechanism(scene: Scene) -> None:
    """Raise :class:`SceneError` if a part of the scene is free to move in statics.

    An elastic beam resists every motion but the three rigid ones, so a motion without strain moves
    each beam as a rigid body; it exists if joints and supports leave those motions a null space.
    """
    free = _null_space(_constraints(scene, also=_under_works(scene)))
    if free.shape[1] == 0:
        return
    moving = _moving(scene, free[:, 0] / np.abs(free[:, 0]).max())
    more = f"; and {len(moving) - 4} more" if len(moving) > 4 else ""
    ways = "way" if free.shape[1] == 1 else "independent ways"
    raise SceneError(
        f"the scene is free to move in {free.shape[1]} {ways}, so statics has no unique answer: "
        f"{'; '.join(moving[:4])}{more}. Add supports or joints, or run dynamics (Midpoint)"
    )


def _center(part: Member | Body) -> Point:
    """Point about which the rigid motion of a beam or body is described."""
    if isinstance(part, Body):
        return part.center
    (xa, ya), (xb, yb) = part.a, part.b
    return (xa + xb) / 2, (ya + yb) / 2


RESISTING = (Motor, Guide, Spring, ForceLaw, RigidPlastic)
"""Laws of connectors that resist every motion; others bear nothing, or what they are told."""


def _constraints(
    scene: Scene,
    acts: Callable[[Connector], bool] = lambda link: isinstance(link.law, RESISTING),
    also: Iterable[tuple[Anchor, int]] = (),
) -> csr_array:
    """Rows that joints, supports and connectors make of (u, v, size ψ) of all parts.

    A connector makes a row if it ``acts``, and so do the components of motion that are there
    ``also``.  The shape is (constraints, 3 parts).
    """
    number = {part: i for i, part in enumerate(_parts(scene))}
    entries: list[tuple[int, int, float]] = []
    row = 0

    def add(of: Node, factors: Sequence[float] | Array) -> None:
        """Factors of (u, v, size ψ) of a node, in the present row."""
        if of is GROUND:
            return
        part = of if isinstance(of, Body) else of.beam
        (cx, cy), (px, py) = _center(part), of.center if isinstance(of, Body) else of.point
        x, y = (px - cx) / scene.size, (py - cy) / scene.size
        motion = np.array([[1.0, 0.0, -y], [0.0, 1.0, x], [0.0, 0.0, 1.0]])
        demand = np.asarray(factors) @ motion
        entries.extend((row, 3 * number[part] + k, float(demand[k])) for k in range(3))

    for (first, component), *others in shared_by_joints(scene.joints):
        for other, _ in others:
            add(first, -np.eye(3)[component])
            add(other, np.eye(3)[component])
            row += 1
    for link in scene.links:
        if acts(link):
            unit = np.array([1.0, 1.0, 1.0 if link.turns else 1 / scene.size])
            for anchor, factors in zip((link.a, link.b), link.rigidly(), strict=True):
                add(node(anchor), factors * unit)
            row += 1
    for support in scene.supports:
        cos, sin = math.cos(support.angle), math.sin(support.angle)
        turned = np.array([[cos, sin, 0], [-sin, cos, 0], [0, 0, 1]])
        for component in support.held:
            add(node(support.place), turned[component])
            row += 1
    for place, component in also:
        add(node(place), np.eye(3)[component])
        row += 1
    return _sparse(entries, (max(row, 1), 3 * len(number)))


def _sparse(entries: list[tuple[int, int, float]], shape: tuple[int, int]) -> csr_array:
    """Matrix of entries (row, column, value); those at one place are added."""
    rows, columns, values = np.array(entries).reshape(-1, 3).T
    return csr_array((values, (rows.astype(int), columns.astype(int))), shape=shape)


def _parts(scene: Scene) -> list[Member | Body]:
    return [*scene.beams, *scene.bodies]


def _null_space(constraints: csr_array) -> Array:
    """Orthonormal basis, in columns, of what ``constraints @ x = 0`` leaves free."""
    unknowns = constraints.shape[1]
    if unknowns <= DENSE:
        _, sizes, rows = np.linalg.svd(constraints.toarray(), full_matrices=True)
        rank = int(np.sum(sizes > 1e-10 * max(1.0, sizes.max(initial=0.0))))
        return np.asarray(rows[rank:].T)
    gram = (constraints.T @ constraints).tocsc()
    values, vectors = eigsh(gram, k=6, sigma=-1e-9, which="LM", v0=np.ones(unknowns))
    return np.asarray(vectors[:, values < 1e-13 * abs(gram).max()])


def _moving(scene: Scene, mode: Array) -> list[str]:
    """Describe the motions of the parts that move in a mode."""
    motions = enumerate(mode.reshape(-1, 3))
    return [_describe(scene, i, motion) for i, motion in motions if np.abs(motion).max() > 1e-6]


def _describe(scene: Scene, number: int, mode: Array) -> str:
    part, bodies = _parts(scene)[number], number - len(scene.beams)
    name = f"{part.name} ({f'body {bodies}' if isinstance(part, Body) else f'beam {number}'})"
    u, v, ψ = mode
    if abs(ψ) < 1e-6:
        return f"{name} can shift along ({u:.3g}, {v:.3g})"
    cx, cy = _center(part)
    x, y = (
        scene.size * round(c / scene.size, 9)
        for c in (cx - v / ψ * scene.size, cy + u / ψ * scene.size)
    )
    return f"{name} can turn about ({x:.4g}, {y:.4g})"


class Rated(Protocol):
    """A time scheme, as far as scenes may ask too much of its rates."""

    has_mean_velocity: bool
    rings: bool


def require_rates(scene: Scene, scheme: Rated) -> None:
    """Raise :class:`SceneError` if a time scheme has not the rates that a scene needs."""
    name = type(scheme).__name__
    for owner, what in [*((c, c.law) for c in scene.links), *((x, x) for x in scene.loads)]:
        if isinstance(what, Coulomb | RotatingFrame) and not scheme.has_mean_velocity:
            raise SceneError(
                f"{name}: {owner} needs the mean velocity of a step, and forces act at its end "
                "here; use Midpoint() or DecayingMidpoint()"
            )
    given = [str(c) for c in scene.links if isinstance(c.law, Motor | Guide)]
    given += [f"the support of {s.place}" for s in scene.supports if s.moving]
    if given and scheme.rings:
        raise SceneError(
            f"{name}: {given[0]} prescribes a motion, whose accelerations ring for ever "
            "without numerical damping; use GeneralizedAlpha(0.8), or Midpoint()"
        )
