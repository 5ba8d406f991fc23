# SPDX-License-Identifier: MIT
"""Positions of the objects in pictures, in a solution or before any run, and sizes of symbols."""

from __future__ import annotations

import math
from abc import ABC, abstractmethod
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from ufl_beam.arrays import Array
from ufl_beam.model.bodies import GROUND, Anchor, Body, Spot
from ufl_beam.model.connector_laws import Guide
from ufl_beam.model.connectors import Connector
from ufl_beam.model.curves import Curve, nearest, parameter_step, tangent
from ufl_beam.model.scene import Scene
from ufl_beam.output.joint_histories import motion_of, turned
from ufl_beam.output.scene_lines import spots_of
from ufl_beam.simulation.solution import Solution

Range = tuple[float, float]  # of a slider along its rail from its place, m; or guide parameter


class Setting(ABC):
    """Scene that is drawn, and the size of its symbols."""

    scene: Scene
    unit: float  # half the size of a symbol of a support; m
    magnify: float  # factor on the displacements

    @cached_property
    def travels(self) -> dict[Connector, Range]:
        """Ranges of all that slides or is guided, since it was made, by its holder."""
        joints = [j for j in self.scene.joints if j.look in ("Prismatic", "Guided")]
        return {holder: self._travel(holder) for holder in (j.holders[0] for j in joints)}

    @abstractmethod
    def _travel(self, holder: Connector) -> Range:
        """Range of what a connector holds on its rail or guide curve."""

    @property
    def undeformed(self) -> Pose:
        """Pose in which everything was made."""
        return Pose(self, lambda anchor: np.zeros(3))

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
        alike: dict[tuple[bool, frozenset[object]], list[Connector | None]] = {}
        for joint in self.scene.joints:
            if joint.look in ("Prismatic", "RigidLink", "Link"):
                alike[False, frozenset(joint.places)] = [None]  # which keeps the middle
        for c in self.scene.connectors:
            ends: tuple[object, ...] = (c.b.point,) if c.turns else (c.a, c.b)
            alike.setdefault((c.turns, frozenset(ends)), []).append(c)
        offsets = {}
        for (turns, _), group in alike.items():
            for k, connector in enumerate(group):
                if connector is None:
                    continue
                if turns:
                    offsets[connector] = 1.15 * k
                elif group[0] is None:
                    offsets[connector] = 1.6 * ((k + 1) // 2) * (-1.0) ** k
                else:
                    offsets[connector] = 1.6 * (k - (len(group) - 1) / 2)
        return offsets


class Model(Setting):
    """Scene before any run."""

    def __init__(self, scene: Scene, unit: float) -> None:
        self.scene, self.unit, self.magnify = scene, unit, 1.0

    def _travel(self, holder: Connector) -> Range:
        """Rail as long as the slider, or some of the guide curve."""
        if isinstance(holder.law, Guide):
            more, size = 3.0 * self.unit, self.scene.size
            return _used(holder.law.curve, np.empty((0, 2)), (), more, size)
        start = float(np.dot(_along(holder), holder.apart))
        return start, start


class Stage(Setting):
    """Solution, of which rails must do for the kept times ``shown``; all by default."""

    def __init__(
        self, solution: Solution, magnify: float, unit: float, shown: Sequence[int] | None = None
    ) -> None:
        self.scene, self._solution = solution.scene, solution
        self.magnify, self.unit = magnify, unit
        self._shown = range(len(solution.times)) if shown is None else shown

    def pose(self, n: int) -> Pose:
        """Return the pose at the n-th kept time."""
        grid, q = self._solution.grid, self._solution.q[n]
        return Pose(self, lambda anchor: np.asarray(motion_of(grid, anchor, [q])[0]))

    def _travel(self, holder: Connector) -> Range:
        points = self._solution.position(holder.b)
        if isinstance(holder.law, Guide):
            more, size = 3.0 * self.unit, self.scene.size
            return _used(holder.law.curve, points, self._shown, more, size)
        along = _along(holder)
        ahead = turned(along, self._solution.displacement(holder.a)[:, 2])
        way = np.sum((points - self._solution.position(holder.a)) * ahead, axis=1)
        start = float(np.dot(along, holder.apart))
        way = start + self.magnify * (way[list(self._shown)] - start)
        return min(start, float(way.min())), max(start, float(way.max()))


@dataclass(frozen=True, eq=False)
class Pose:
    """Scene at one time, as it is drawn."""

    stage: Setting  # what is shown
    motion: Callable[[Anchor], Array]  # (u, v, ψ) of an anchor, not magnified; (3,); m, m, rad

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
        """Return points of all bodies, and of all that is attached to the ground; (n, 2); m."""
        ground = [spot.point for spot in self.stage.spots[GROUND]]
        bodies = [self.of_body(body, outline) for body, outline in self.stage.outlines.items()]
        return np.concatenate([np.reshape(ground, (-1, 2)), *bodies])

    def of_body(self, body: Body, points: Array) -> Array:
        """Move points of a body of the undeformed scene with it; (n, 2); m."""
        u, v, ψ = self.motion(body.middle)
        arms = points - body.center
        moved = turned(arms, np.full(len(arms), ψ)) - arms + (u, v)
        return np.asarray(points + self.stage.magnify * moved)


def _along(holder: Connector) -> tuple[float, float]:
    """Direction of a rail, whose holder holds across it."""
    return holder.axis[1], -holder.axis[0]


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
    angle = np.linspace(0.0, 2 * math.pi, 48, endpoint=False)
    circle = r * np.column_stack([np.cos(angle), np.sin(angle)])
    cloud = np.concatenate([np.add(point, circle) for point in points])
    corners = cloud[ConvexHull(cloud).vertices]
    return np.vstack([corners, corners[:1]])
