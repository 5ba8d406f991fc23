# SPDX-License-Identifier: MIT
"""Positions of the objects in pictures, and geometry in the plane; arrays end with (x, y)."""

from __future__ import annotations

import math
from collections import defaultdict
from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np

from ufl_beam.arrays import Array
from ufl_beam.errors import SceneError, require_number
from ufl_beam.model.bodies import GROUND, Anchor, Body, Spot
from ufl_beam.model.connector_laws import Guide
from ufl_beam.model.connectors import Connector
from ufl_beam.model.functions import nearest, parameter_step, tangent
from ufl_beam.model.scene import Scene, spots_of
from ufl_beam.output.states import States

SYMBOL, SHORT_BEAM, SMALLEST = 12.0, 45.0, 0.3
"""Half the size of a symbol of a support where beams are not short; length of a beam below which it
shrinks, in proportion; points.  It shrinks at most to this part."""

FEW = 40  # supports and loads whose symbols need not shrink as much as others do

Range = tuple[float, float]  # of a slider along its rail from its place, m; or guide parameter


# -- geometry ----------------------------------------------------------------------------------


def directions(angles: Any) -> Array:
    """Unit vectors at angles from the axis x; (..., 2); angles in rad."""
    return np.stack([np.cos(angles), np.sin(angles)], axis=-1)


def unit_vectors(vectors: Array) -> Array:
    """Vectors divided by their lengths; (..., 2)."""
    return np.asarray(vectors / np.linalg.norm(vectors, axis=-1, keepdims=True))


def left_of(vectors: Array) -> Array:
    """Vectors turned to their left by a right angle; (..., 2)."""
    return vectors[..., ::-1] * (-1.0, 1.0)


def in_frame(points: Any, at: Any, ahead: Array) -> Array:
    """Points from coordinates along a vector and to its left, in its length; (n, 2)."""
    return np.asarray(at + np.array(points) @ np.array([ahead, left_of(ahead)]))


def lengths_along(line: Array) -> Array:
    """Lengths of a line from its start to each of its points; (n,)."""
    return np.append(0.0, np.cumsum(np.linalg.norm(np.diff(line, axis=0), axis=1)))


def points_along(line: Array, lengths: Array) -> Array:
    """Points of a line at lengths from its start; (n, 2)."""
    return np.column_stack([np.interp(lengths, lengths_along(line), x) for x in line.T])


def segments(line: Array) -> Array:
    """Pieces of a line between its points, as (x, y, x, y) of both ends; (n - 1, 4)."""
    return np.hstack([line[:-1], line[1:]])


def joined(lines: Iterable[Array]) -> Array:
    """Lines one after the other, with NaN between them: one line to Matplotlib; (n, 2)."""
    gap = np.full((1, 2), np.nan)
    chains: list[Array] = [chain for line in lines for chain in (line, gap)]
    return np.concatenate(chains[:-1] or [np.empty((0, 2))])


def evenly(progress: Array, count: int) -> list[int]:
    """Choose numbers of so many kept states, evenly spaced in time or along a path."""
    spaced = np.linspace(progress[0], progress[-1], count)
    return [int(np.argmin(np.abs(progress - x))) for x in spaced]


# -- scenes ------------------------------------------------------------------------------------


class Stage:
    """Scene before any run or in a solution, as pictures show it, and the size of its symbols.

    Displacements are drawn ``magnify`` times as large as they are.  Of a solution, the kept times
    ``shown`` are in the picture, by default all; rails are long enough for them.
    """

    def __init__(
        self,
        subject: Scene | States,
        magnify: float,
        unit: float,  # half the size of a symbol; m
        shown: Sequence[int] | None = None,
        outside: float = 0.0,  # of what stands around the beams: supports, loads and motions; m
    ) -> None:
        require_number(magnify, "magnify", positive=True)
        self.magnify, self.unit, self.outside = magnify, unit, outside or unit
        self._solution = subject if isinstance(subject, States) else None
        self.scene = subject.scene if isinstance(subject, States) else subject
        kept = 0 if self._solution is None else len(self._solution.times)
        self._shown = range(kept) if shown is None else shown

    @classmethod
    def at_scale(
        cls,
        subject: Scene | States,
        magnify: float,
        scale: float,
        shown: Sequence[int] | None = None,
    ) -> Stage:
        """Make a stage for a picture in the plane at a scale, the length of a point (m)."""
        scene = subject.scene if isinstance(subject, States) else subject
        lengths = [math.dist(beam.start.point, beam.end.point) for beam in scene.beams]
        typical = float(np.median(lengths)) / scale if lengths else math.inf
        unit = SYMBOL * scale * min(max(typical / SHORT_BEAM, SMALLEST), 1.0)
        few = len(scene.supports) + len(scene.loads) <= FEW
        return cls(subject, magnify, unit, shown, max(unit, 0.7 * SYMBOL * scale) if few else unit)

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
        state = self._solution.part(n % kept, n % kept + 1)
        nodes = grid.points + self.magnify * state.q[0, grid.dofs[:, :2]]
        return Pose(self, lambda anchor: state.displacement(anchor)[0], nodes)

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
        holders = [holder for joint in self.scene.joints for holder in joint.holders]
        return {
            holder: self._along_guide(holder, holder.law)
            if isinstance(holder.law, Guide)
            else self._along_rail(holder)
            for holder in holders
            if holder.motion in ("sliding", "guided")
        }

    def _along_rail(self, holder: Connector) -> Range:
        """Positions along the axis of a rail, across which the connector holds."""
        x, y = holder.axis
        start, solution = float(np.dot((y, -x), holder.apart)), self._solution
        if solution is None:
            return start, start
        ahead = directions(math.atan2(-x, y) + solution.displacement(holder.a)[:, 2])
        apart = solution.position(holder.b) - solution.position(holder.a)
        way = np.sum(apart * ahead, axis=1)[list(self._shown)]
        reached = start + self.magnify * (np.append(way, start) - start)
        return float(reached.min()), float(reached.max())

    def _along_guide(self, holder: Connector, law: Guide) -> Range:
        """Parameters between which a guide curve is used, and three units more if it goes on."""
        curve, size, found = law.curve, self.scene.size, [0.0]
        for point in () if self._solution is None else self._solution.position(holder.b):
            step = parameter_step(curve, found[-1], size)
            found.append(nearest(curve, point, found[-1], step, size))
        used = [0.0, *(found[1:][n] for n in self._shown)]

        def beyond(s: float, more: float) -> float:
            there = s + more / math.hypot(*tangent(curve, s, parameter_step(curve, s, size)))
            try:
                goes_on = bool(np.isfinite(curve(there)).all())
            except (ValueError, ArithmeticError):
                goes_on = False
            return there if goes_on else s

        more = 3.0 * self.unit
        return beyond(float(np.nanmin(used)), -more), beyond(float(np.nanmax(used)), more)

    @cached_property
    def spots(self) -> dict[Body, list[Spot]]:
        """Points of bodies and of the ground that something is attached to."""
        return spots_of(self.scene)

    @cached_property
    def outlines(self) -> dict[Body, Array]:
        """Convex, around centre and points of each body, closed; a disc around one; (n, 2); m."""
        from scipy.spatial import ConvexHull

        found, circle = {}, self.unit * directions(np.arange(48) * math.pi / 24)
        for body in self.scene.bodies:
            points = {body.center, *(spot.point for spot in self.spots[body])}
            radius = 0.75 if len(points) > 1 else 1.3
            cloud = np.concatenate([np.add(point, radius * circle) for point in points])
            corners = ConvexHull(cloud).vertices
            found[body] = cloud[[*corners, corners[0]]]
        return found

    @cached_property
    def offsets(self) -> dict[Connector, float]:
        """Offsets of connectors that share their line, or their pin, with others; in units."""
        # Rails and rods keep the middle.
        middles = {frozenset(joint.places) for joint in self.scene.joints if not joint.meets}
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
        return in_frame(x, 0.0, directions(self.turn(anchor)))

    def points(self) -> Array:
        """Return nodes of beams, outlines of bodies, and points of the ground; (n, 2); m."""
        ground = np.reshape([spot.point for spot in self.stage.spots[GROUND]], (-1, 2))
        bodies = [self.of_body(body, outline) for body, outline in self.stage.outlines.items()]
        return np.concatenate([self.nodes, ground, *bodies])

    def of_body(self, body: Body, points: Array) -> Array:
        """Move points of a body of the undeformed scene with it; (n, 2); m."""
        u, v, ψ = self.motion(body.middle)
        arms = points - body.center
        moved = in_frame(arms, (u, v), directions(ψ)) - arms
        return np.asarray(points + self.stage.magnify * moved)
