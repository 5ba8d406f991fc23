# SPDX-License-Identifier: MIT
"""Warnings about scenes that can be computed but probably contain a mistake."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping
from itertools import chain, pairwise

import numpy as np
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components
from scipy.spatial import KDTree

from ufl_beam.arrays import Array, Index
from ufl_beam.caches import cached_by_structure
from ufl_beam.discretization.dof_numbering import DofNumbering, turned
from ufl_beam.errors import ArgumentError, warn
from ufl_beam.model import plausibility
from ufl_beam.model.bodies import GROUND, BodyPoint, Place, moves_with_node
from ufl_beam.model.connector_laws import RIGID, Clearance, PrescribedMotion
from ufl_beam.model.connectors import place_of
from ufl_beam.model.functions import Table, value_at
from ufl_beam.model.joints import Release
from ufl_beam.model.loads import Gravity, MovingLoad
from ufl_beam.model.scene import Scene
from ufl_beam.model.supports import Support

TOUCHING = 1e-3
"""Largest gap between vertices that touch, as a fraction of the length of the shorter beam; a tenth
of this between an end and a cell.  Also the gap between a load and the end of its route."""

JUMP = 1e-6
"""Largest initial jump without a warning: an angle in rad, or a fraction of the scene's size."""

MISSED = 0.1  # largest fraction of a table that steps miss without a warning
FAR_OUT = 10.0  # largest distance from the centre of a body without a warning, in radii of gyration


def warn_of_masses(scene: Scene) -> None:
    """Warn of sections without rho and rhoA if other beams have mass or nothing has mass."""
    light = [beam.name for beam in scene.beams if beam.section.massless_by_default]
    if not light:
        return
    names = ", ".join(dict.fromkeys(light[:20]))
    others = "but other beams of the scene have mass. Give rho or rhoA; rhoA=0.0 if they have none"
    if not any(beam.section.rhoA for beam in scene.beams):
        if any(body.mass for body in scene.bodies) or any(m.mass for m in scene.masses):
            return
        others = (
            "and nothing else in the scene has mass, so that dynamics has no inertia. Give rho or "
            "rhoA, or use Static()"
        )
    warn(f"{names}: without mass, because neither rho nor rhoA of the section is given, {others}")


def warn_of_warping(scene: Scene) -> None:
    """Warn of open sections in space, whose resistance to warping is not modelled."""
    beams = scene.beams if scene.in_space else ()
    warping = [b.name for b in beams if b.section.shape is not None and b.section.shape.is_open]
    if warping:
        warn(
            f"{', '.join(dict.fromkeys(warping[:20]))}: open sections, whose resistance to warping "
            "is not modelled, so that torsion by GJ alone is too soft near restrained ends. Take "
            "closed sections if torsion matters, else filter this warning"
        )


def warn_of_rates(scene: Scene) -> None:
    """Warn of virtual works that depend on velocities, such as drag, in a static run."""
    for work in scene.works:
        if "v" in work.used_arguments:
            warn(
                f"{work} takes v, which is (q1 - q0)/dt also in a static run: this work carries "
                "part of the loads, as a damper does. Leave it out of the scene of a preload; if "
                "slow motion in time is meant, filter this warning"
            )


def warn_of_loads(scene: Scene, t: tuple[float, float], ends: Array) -> None:
    """Warn of moving loads that are missed or have no weight, and of large gaps.

    ``ends`` has the beginning and the ends of equal steps (s); it is empty for adaptive steps.
    """
    heavy = any(isinstance(load, Gravity) for load in scene.loads)
    for connector in scene.connectors:
        if isinstance(connector.law, Clearance):
            gap = connector.law.gap / scene.size
            plausibility.check(str(connector), "gap over the size of the scene", gap)
    for load in scene.loads:
        if not isinstance(load, MovingLoad):
            continue
        try:
            places, at_ends = map(load.places, (np.linspace(*t, 41, dtype=float), ends))
        except ArgumentError:  # the run names the time
            continue
        part = at_ends / load.length
        side = (part > 1.0 - TOUCHING) * 1 - (part < TOUCHING)
        crossings = np.flatnonzero(side[1:] * side[:-1] < 0)
        if (places < 0.0).all() or (places > load.length).all():
            warn(
                f"{load}: its position is from {places.min():.3g} to {places.max():.3g} m in the "
                f"run, and never on its route of {load.length:.3g} m, so that it does not act"
            )
        elif len(crossings):
            first, last = ends[crossings[0] :][:2]
            warn(
                f"{load}: it crosses its route of {load.length:.3g} m between t = {first:.4g} and "
                f"{last:.4g} s, in one step, so that it acts in the whole step or not at all. Give "
                "a shorter dt, or in dynamics dt=Adaptive(...)"
            )
        if heavy and load.mass and load.force == (0.0, 0.0):
            warn(
                f"{load}: its mass has no weight, because Gravity does not act on it; give "
                "force=(0, -9.81 mass)"
            )


def warn_of_tables(scene: Scene, ends: Array) -> None:
    """Warn of tables whose values change within steps of dynamics with the given ends; s.

    Loads are taken in the middle of a step, so that the impulse of a short pulse may be lost.
    Motions are taken at the ends of steps, which may leave out the extremes.
    """
    for owner, function in scene.time_functions():
        if not isinstance(function, Table):
            continue
        times, values = (np.array(x, dtype=float) for x in (function.times, function.values))
        of_impulse = function is getattr(owner, "amplitude", None)
        if of_impulse:
            if np.diff(times).min(initial=math.inf) > 0.999 * (ends[1] - ends[0]):
                continue  # a step has two of the times at most
            areas = np.append(0.0, np.cumsum(np.diff(times) * (values[1:] + values[:-1]) / 2))
            k = np.maximum(np.searchsorted(times, ends, "right") - 1, 0)
            at_ends = np.interp(ends, times, values)
            exact = np.diff(areas[k] + (ends - times[k]) * (values[k] + at_ends) / 2)
            middles = np.interp((ends[1:] + ends[:-1]) / 2, times, values)
            missed, whole = np.abs(exact - np.diff(ends) * middles).sum(), np.abs(exact).sum()
        else:
            taken = np.interp(ends, times, values)
            every = np.append(taken, values[(times > ends[0]) & (times < ends[-1])])
            whole = np.ptp(every)
            missed = max(every.max() - taken.max(), taken.min() - every.min())
        if missed > MISSED * whole:
            error = f"{missed / max(whole, 1e-9 * missed):.0%}"
            warn(
                f"{owner}: its Table changes within steps of {ends[1] - ends[0]:.4g} s, so that "
                + (f"impulses are wrong by {error}" if of_impulse else f"{error} of it are missed")
                + ". Give a dt that divides the intervals between its times, or dt=Adaptive(...), "
                "whose steps end there"
            )


def warn_of_free_hinges(scene: Scene) -> None:
    """Warn of a beam's hinges that are left out because only a moment load is beyond them."""
    moments = scene.moments
    hinge_places = {place_of(hinge) for hinge in scene.hinges} if moments else set()
    for load in moments:
        place = load.place
        if not isinstance(place, Place) or place in hinge_places:
            continue
        law = place.beam.hinges.get(place.s)
        if law is not None and law.opens:
            warn(
                f"{place.beam.name}: the hinge at s = {place.s:g} has nothing beyond it but "
                f"{load}, so that the load acts on the member, and the hinge is left out"
            )


def warn_of_touching(numbering: DofNumbering) -> None:
    """Warn of ends of beams that touch another beam without a connection."""
    if not numbering.scene.beams or not (touching := _touching(numbering)):
        return
    (*vertices, gap), *others = touching
    end, touched = map(numbering.place, vertices)
    more = f"; so do {len(others)} more pairs of places" if others else ""
    beside = math.dist(end.point, touched.point) > 2 * gap + TOUCHING * numbering.scene.size
    at = f"{touched.beam.name} beside {touched}" if beside else touched
    warn(
        f"{end} and {at} touch ({gap:.3g} m apart), but no joint or connector joins them, "
        f"so that they move independently{more}. Join them with Rigid or Revolute if they are "
        "connected"
    )


def _touching(numbering: DofNumbering) -> list[tuple[int, int, float]]:
    """Return pairs of an end and the nearest vertex of a beam that it touches, and the gaps; m.

    Ends that are connected with a vertex of the beam that they touch are left out.
    """
    first = numbering.first_vertices
    end, touched, gap = _contacts(numbering.points[: first[-1]], first)
    if not len(end):
        return []
    beams = np.repeat(np.arange(len(first) - 1), np.diff(first))
    group = _groups(numbering)[: first[-1]]
    joined = group[end] == group[touched]
    keys = end * len(first) + beams[touched]
    loose = np.flatnonzero(~joined & ~np.isin(keys, keys[joined]))
    order = loose[np.lexsort((gap[loose], keys[loose]))]
    nearest = order[np.unique(keys[order], return_index=True)[1]]
    rows = zip(*(x[nearest].tolist() for x in (end, touched, gap)), strict=True)
    # Two ends that touch each other count as one pair.
    pairs = dict[frozenset[int], tuple[int, int, float]]()
    for row in rows:
        pairs.setdefault(frozenset(row[:2]), row)
    return [*pairs.values()]


@cached_by_structure
def _contacts(points: Array, first: Index) -> tuple[Index, Index, Array]:
    """Return ends of beams, the nearest vertices of cells that they touch, and the gaps (m).

    The vertices of beam i are ``points[first[i] : first[i + 1]]``.  All arrays are (n,).
    """
    beams = np.repeat(np.arange(len(first) - 1), np.diff(first))
    ends = np.column_stack([first[:-1], first[1:] - 1]).ravel()
    start = np.flatnonzero(np.diff(beams) == 0)  # of each cell
    way = points[start + 1] - points[start]
    sizes = np.linalg.norm(way, axis=1)
    reach = TOUCHING * np.bincount(beams[start], weights=sizes, minlength=len(first) - 1)[beams]
    tree, middles = KDTree(points[ends]), points[start] + way / 2
    near = tree.query_ball_point(middles, sizes / 2 + reach[start], return_sorted=False)
    counts = np.array([len(indices) for indices in near])
    cell = np.repeat(np.arange(len(start)), counts)
    end = ends[np.fromiter(chain.from_iterable(near), dtype=np.int64, count=len(cell))]
    way, beyond = way[cell], points[end] - points[start[cell]]
    s = np.clip(np.sum(way * beyond, axis=1) / sizes[cell] ** 2, 0.0, 1.0)
    gap = np.linalg.norm(beyond - s[:, None] * way, axis=1)
    touched = start[cell] + (s > 0.5)
    # Within one beam, only contact of both ends counts.
    apart = (beams[end] != beams[touched]) | (np.isin(touched, ends) & (end < touched))
    # Between vertices, members may pass more closely.
    part = np.where((s > 0.0) & (s < 1.0), 0.1, 1.0)
    touching = apart & (gap <= part * np.minimum(reach[end], reach[touched]))
    return end[touching], touched[touching], gap[touching]


def _groups(numbering: DofNumbering) -> Index:
    """Return the group number of each node of the beams; connected nodes are in one group.

    Nodes are connected if they share the degree of freedom u, or have a :class:`Release` or a
    connector between them.  Supports of u and v connect nodes to the ground.
    """
    connectors = numbering.dofs_of_connectors[:, :2]
    fixed = [s.place for s in numbering.scene.supports if {0, 1} <= s.held.keys()]
    has_ground = GROUND in numbering.scene.rigid_bodies
    ground = int(numbering.node(GROUND.middle)[0]) if has_ground else numbering.size
    others = [(numbering.node(place)[0], ground) for place in fixed]
    for joint in numbering.scene.joints:
        if isinstance(joint, Release):
            others += pairwise(numbering.node(place)[0] for place in joint.places)
    pairs = np.concatenate([connectors, np.array(others, dtype=np.int64).reshape(-1, 2)])
    (group,) = _connected(numbering.size + 1, pairs)
    return np.asarray(group[numbering.dofs[:, 0]])


@cached_by_structure
def _connected(size: int, pairs: Index) -> tuple[Index]:
    """Return the group number of each of ``size`` degrees of freedom, given connected pairs."""
    rows, columns = pairs.T
    graph = coo_array((np.ones(len(rows), dtype=np.int8), (rows, columns)), shape=(size, size))
    return (connected_components(graph, directed=False)[1],)


def warn_of_far_points(scene: Scene) -> None:
    """Warn of points of bodies that are far from the centre of their body and from other points.

    A point is far if it is not a point of another beam or body, and its distance from the centre is
    more than :data:`FAR_OUT` radii of gyration.  For a body without mass or inertia, the distance
    from the box around the centre, beams and other bodies is more than the diagonal of this box.
    Coordinates relative to the centre, given to ``body.at`` by mistake, may be such points;
    ``body.at(x, y)`` takes coordinates of the undeformed scene.
    """
    attached = (place for _, place in scene.attachments() if isinstance(place, BodyPoint))
    spots = dict.fromkeys(s for s in attached if s.body is not GROUND and not moves_with_node(s))
    if not spots:
        return
    others = list(_points(scene))
    tree = KDTree([point for point, _ in others])
    for place in spots:
        neighbours = tree.query_ball_point(place.point, 1e-9 * scene.size)
        if any(others[i][1] is not place.body for i in neighbours):
            continue
        body = place.body
        out = math.dist(place.point, body.center)
        if body.mass and np.any(body.tensor):
            far = out > FAR_OUT * math.sqrt(np.linalg.eigvalsh(body.tensor).max() / body.mass)
        else:
            box = np.array([*(point for point, owner in others if owner is not body), body.center])
            far = _outside(np.array(place.point), box) > math.hypot(*np.ptp(box, axis=0)) > 0.0
        if far:
            moved = (f"{c:g} + {x:g}" for c, x in zip(body.center, place.point, strict=True))
            warn(
                f"{place} is {out:.4g} m away from the centre of {body.name}, and nothing else "
                f"is there. body.at({', '.join('xyz'[: len(place.point)])}) takes coordinates of "
                f"the undeformed scene; a point relative to the centre is at({', '.join(moved)})"
            )


def _points(scene: Scene) -> Iterator[tuple[tuple[float, float], object]]:
    """Yield points of a scene, and the beam or body to which each belongs."""
    for beam in scene.beams:
        for s in (0.0, *beam.corners, *(i / beam.cells for i in range(1, beam.cells + 1))):
            yield beam.at(s).point, beam
    for body in scene.bodies:
        yield body.center, body
    for _, place in scene.attachments():
        yield place.point, place.body if isinstance(place, BodyPoint) else place.beam


def warn_of_origin(scene: Scene) -> None:
    """Warn of an angular velocity without ``about`` if the scene is far from the origin.

    The scene is far if the distance of the origin from the box around the scene is larger than the
    diagonal of the box around the rotating beams and bodies.
    """
    points = np.array([point for point, _ in _points(scene)])
    away = _outside(np.zeros(points.shape[1]), points)
    for velocity in scene.initial:
        if not np.any(velocity.angular) or velocity.about is not None:
            continue
        moved = set(velocity.beams)
        ends = np.array([p for p, owner in _points(scene) if owner in moved])
        if away > (np.linalg.norm(np.ptp(ends, axis=0)) if len(ends) else 0.0):
            names = ", ".join(beam.name for beam in velocity.beams[:3])
            spin = ", ".join(f"{x:g}" for x in np.ravel(velocity.angular))
            warn(
                f"Velocity of {names}: angular = {spin} rad/s without about= turns about the "
                f"origin, which is {away:.4g} m away from the scene. Give about= a point, "
                "also if the origin is meant"
            )


def _outside(point: Array, points: Array) -> float:
    """Compute the distance of a point from the box around ``points``; m."""
    low, high = points.min(axis=0), points.max(axis=0)
    beyond = np.maximum(low - point, 0.0) + np.maximum(point - high, 0.0)
    return float(np.linalg.norm(beyond))


def warn_of_jumps(
    numbering: DofNumbering, t: float, q: Array, motions: Array, angles: Mapping[Support, float]
) -> None:
    """Warn of prescribed motions in dynamics that differ from the state ``q`` at the time ``t``.

    ``motions`` are the relative motions of the connectors in this state; (num_connectors,).
    ``angles`` are rotations of supports about axes in space.
    """
    starts = list[tuple[str, float, float, bool]]()
    for s in numbering.scene.supports:
        x = q[numbering.node(s.place)]
        for i, j, angle in s.turns:
            x[[i, j]] = turned(x[[i, j]], np.full(1, -angle))[0]
        for k, f in s.moving.items():
            value = angles.get(s, x[k]) if k == 5 else x[k]
            starts.append((f"{s}: {s.names[k]}", value, value_at(f, t, s), k >= s.displacements))
    for c, motion in zip(numbering.scene.all_connectors, motions, strict=True):
        if isinstance(c.law, PrescribedMotion) and c.law is not RIGID:
            target = value_at(c.law.motion, t, c)
            starts.append((f"{c}: its motion", motion, target, c.is_rotation))
    for name, value, target, is_rotation in starts:
        if abs(target - value) > JUMP * (1.0 if is_rotation else numbering.scene.size):
            unit = "rad" if is_rotation else "m"
            warn(
                f"{name} jumps from {value:.6g} to {target:.6g} {unit} at the start, "
                f"t = {t:g} s, which in dynamics is an impact. Let it grow in time, by ub.Table or "
                "lambda t: ..., or begin with start= from a static run"
            )
