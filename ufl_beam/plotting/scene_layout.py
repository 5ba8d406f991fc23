# SPDX-License-Identifier: MIT
"""Positions of the objects in pictures, in a solution or before any run, and sizes of symbols."""

from __future__ import annotations

import math
from collections import defaultdict
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from ufl_beam.arrays import Array
from ufl_beam.errors import SceneError, require_number
from ufl_beam.model.bodies import GROUND, Anchor, Body, Spot
from ufl_beam.model.connector_laws import Guide
from ufl_beam.model.connectors import Connector
from ufl_beam.model.curves import Curve, nearest, parameter_step, tangent
from ufl_beam.model.scene import Scene, spots_of
from ufl_beam.output.joint_histories import motion_of, turned
from ufl_beam.plotting.geometry import directions
from ufl_beam.simulation.solution import Solution

Range = tuple[float, float]  # of a slider along its rail from its place, m; or guide parameter


class Stage:
    """Scene before any run or in a solution, as pictures show it, and the size of its symbols.

    Displacements are drawn ``magnify`` times as large as they are.  Of a solution, the kept times
    ``shown`` are in the picture, by default all; rails are long enough for them.
    """

    def __init__(
        self,
        subject: Scene | Solution,
        magnify: float,
        unit: float,  # half the size of a symbol of a support; m
        shown: Sequence[int] | None = None,
    ) -> None:
        require_number(magnify, "magnify", positive=True)
        self.magnify, self.unit = magnify, unit
        self._solution = subject if isinstance(subject, Solution) else None
        self.scene = subject.scene if isinstance(subject, Solution) else subject
        kept = 0 if self._solution is None else len(self._solution.times)
        self._shown = range(kept) if shown is None else shown

    @property
    def undeformed(self) -> Pose:
        """Pose in which everything was made."""
        nodes = np.empty((0, 2)) if self._solution is None else self._solution.grid.points
        return Pose(self, lambda anchor: np.zeros(3), nodes)

    def pose(self, n: int) -> Pose:
        """Return the pose at the n-th kept time of the solution, or raise SceneError."""
        assert self._solution is not None
        grid, kept = self._solution.grid, len(self._solution.times)
        if not -kept <= n < kept:
            raise SceneError(f"n = {n}: the solution kept {kept} times; give {-kept} to {kept - 1}")
        q = self._solution.q[n]
        nodes = grid.points + self.magnify * q[grid.dofs[:, :2]]
        return Pose(self, lambda anchor: motion_of(grid, anchor, q[None])[0], nodes)

    def poses(self) -> Iterator[Pose]:
        """Iterate over the undeformed pose and all that are shown."""
        yield self.undeformed
        yield from map(self.pose, self._shown)

    def points(self) -> Array:
        """Return all points of all poses; (n, 2); m."""
        return np.concatenate([pose.points() for pose in self.poses()])

    @cached_property
    def travels(self) -> dict[Connector, Range]:
        """Ranges of all that slides or is guided, since it was made, by its holder."""
        joints = [j for j in self.scene.joints if j.look in ("Prismatic", "Guided")]
        return {holder: self._travel(holder) for holder in (j.holders[0] for j in joints)}

    def _travel(self, holder: Connector) -> Range:
        """Range of what a connector holds on its rail or guide curve."""
        solution = self._solution
        if isinstance(holder.law, Guide):
            points = np.empty((0, 2)) if solution is None else solution.position(holder.b)
            return _used(holder.law.curve, points, self._shown, 3.0 * self.unit, self.scene.size)
        along = holder.axis[1], -holder.axis[0]  # it holds across the rail
        start = float(np.dot(along, holder.apart))
        if solution is None:
            return start, start
        ahead = turned(along, solution.displacement(holder.a)[:, 2])
        apart = solution.position(holder.b) - solution.position(holder.a)
        way = np.sum(apart * ahead, axis=1)[list(self._shown)]
        reached = start + self.magnify * (np.append(way, start) - start)
        return float(reached.min()), float(reached.max())

    @cached_property
    def spots(self) -> dict[Body, list[Spot]]:
        """Points of bodies and of the ground that something is attached to."""
        return spots_of(self.scene)

    @cached_property
    def outlines(self) -> dict[Body, Array]:
        """Around the centre and the points of each body, in the undeformed scene; (n, 2); m."""
        return {
            body: _around([body.center, *(s.point for s in self.spots[body])], self.unit)
            for body in self.scene.bodies
        }

    @cached_property
    def offsets(self) -> dict[Connector, float]:
        """Offsets of connectors that share their line, or their pin, with others; in units."""
        rods = [j for j in self.scene.joints if j.look in ("Prismatic", "RigidLink", "Link")]
        middles = {frozenset(joint.places) for joint in rods}  # they keep the middle
        groups: defaultdict[tuple[bool, frozenset[object]], list[Connector]] = defaultdict(list)
        for c in self.scene.connectors:
            groups[c.turns, frozenset((c.b.point,) if c.turns else (c.a, c.b))].append(c)
        offsets: dict[Connector, float] = {}
        for (turns, ends), group in groups.items():
            for k, connector in enumerate(group):
                if turns:
                    offsets[connector] = 1.15 * k
                elif ends in middles:
                    offsets[connector] = 1.6 * (k // 2 + 1) * (-1.0) ** (k + 1)
                else:
                    offsets[connector] = 1.6 * (k - (len(group) - 1) / 2)
        return offsets


@dataclass(frozen=True, eq=False)
class Pose:
    """Scene at one time, as it is drawn."""

    stage: Stage
    motion: Callable[[Anchor], Array]  # (u, v, ψ) of an anchor, not magnified; (3,); m, m, rad
    nodes: Array  # of all beams of a solution; (num_nodes, 2); m

    def at(self, anchor: Anchor) -> Array:
        """Return the coordinates of an anchor; (2,); m."""
        return np.asarray(anchor.point + self.stage.magnify * self.motion(anchor)[:2])

    def turn(self, anchor: Anchor) -> float:
        """Return the rotation of an anchor; rad."""
        return float(self.motion(anchor)[2])

    def turned(self, x: tuple[float, float], anchor: Anchor) -> Array:
        """Turn a vector with an anchor; (2,)."""
        return np.asarray(turned(x, np.array([self.turn(anchor)]))[0])

    def points(self) -> Array:
        """Return nodes of beams, outlines of bodies, and points of the ground; (n, 2); m."""
        ground = np.reshape([spot.point for spot in self.stage.spots[GROUND]], (-1, 2))
        bodies = [self.of_body(body, outline) for body, outline in self.stage.outlines.items()]
        return np.concatenate([self.nodes, ground, *bodies])

    def of_body(self, body: Body, points: Array) -> Array:
        """Move points of a body of the undeformed scene with it; (n, 2); m."""
        u, v, ψ = self.motion(body.middle)
        arms = points - body.center
        moved = turned(arms, np.full(len(arms), ψ)) - arms + (u, v)
        return np.asarray(points + self.stage.magnify * moved)


def _used(curve: Curve, points: Array, shown: Sequence[int], more: float, size: float) -> Range:
    """Parameters between which a guide curve was used, and a length more if it goes on."""
    found = [0.0]
    for point in points:
        step = parameter_step(curve, found[-1], size)
        found.append(nearest(curve, point, found[-1], step, size))
    used = [0.0, *(found[1:][n] for n in shown)]

    def beyond(s: float, sign: float) -> float:
        there = s + sign * more / math.hypot(*tangent(curve, s, parameter_step(curve, s, size)))
        try:
            goes_on = bool(np.isfinite(curve(there)).all())
        except (ValueError, ArithmeticError):
            goes_on = False
        return there if goes_on else s

    return beyond(float(np.nanmin(used)), -1.0), beyond(float(np.nanmax(used)), 1.0)


def _around(points: list[tuple[float, float]], unit: float) -> Array:
    """Convex outline at a distance around points, closed; around one point a disc; (n, 2); m."""
    from scipy.spatial import ConvexHull

    r = (0.75 if len(set(points)) > 1 else 1.3) * unit
    circle = r * directions(np.linspace(0.0, 2 * math.pi, 48, endpoint=False))
    cloud = np.concatenate([np.add(point, circle) for point in points])
    corners = cloud[ConvexHull(cloud).vertices]
    return np.vstack([corners, corners[:1]])
