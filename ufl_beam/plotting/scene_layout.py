# SPDX-License-Identifier: MIT
"""Positions of what pictures show, in a solution or before any run, and sizes of symbols."""

from __future__ import annotations

import math
from abc import ABC, abstractmethod
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from ufl_beam.arrays import Array
from ufl_beam.model.beams import Curve
from ufl_beam.model.bodies import GROUND, Anchor, Body, Spot
from ufl_beam.model.connector_laws import Guide
from ufl_beam.model.connectors import Connector
from ufl_beam.model.plane_curves import nearest, parameter_step, tangent
from ufl_beam.model.scene import Scene
from ufl_beam.output.joint_histories import motion_of, turned
from ufl_beam.output.line_data import spots_of
from ufl_beam.simulation.solution import Solution


class Setting(ABC):
    """Scene that is drawn, and the size of its symbols.

    Attributes:
        unit: Half the size of a symbol of a support; m.
        magnify: Factor on the displacements.
    """

    unit: float
    magnify: float

    @property
    @abstractmethod
    def scene(self) -> Scene:
        """The scene."""

    @property
    @abstractmethod
    def travels(self) -> Mapping[Connector, tuple[float, float]]:
        """From where to where each guided and sliding thing moved since it was made.

        Along the rail from its place, m; or the parameter of the guide curve.
        """

    @property
    def undeformed(self) -> Pose:
        """Where everything was made."""
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
    def lanes(self) -> dict[Connector, float]:
        """Offsets of connectors that share their line, or their pin, with others."""
        alike: dict[tuple[bool, frozenset[object]], list[Connector | None]] = {}
        for joint in self.scene.joints:
            if joint.kind in ("Prismatic", "RigidLink", "Link"):
                alike[False, frozenset(joint.places)] = [None]
        for c in self.scene.connectors:
            ends: tuple[object, ...] = (c.b.point,) if c.turns else (c.a, c.b)
            alike.setdefault((c.turns, frozenset(ends)), []).append(c)
        lanes = {}
        for (turns, _), group in alike.items():
            for k, connector in enumerate(group):
                if connector is not None:
                    lanes[connector] = _lane(k, len(group), group[0] is None, turns)
        return lanes


@dataclass(frozen=True, eq=False)
class Model(Setting):
    """A scene before any run.

    Attributes:
        made: The scene.
        unit: Half the size of a symbol of a support; m.
        magnify: Without effect, as nothing has moved.
    """

    made: Scene
    unit: float
    magnify: float = 1.0

    @property
    def scene(self) -> Scene:
        """The scene."""
        return self.made

    @cached_property
    def travels(self) -> dict[Connector, tuple[float, float]]:
        """Rails as long as the slider, and some of the guide curves."""
        return {holder: self._start(holder) for holder in _sliding(self.scene)}

    def _start(self, holder: Connector) -> tuple[float, float]:
        if isinstance(holder.law, Guide):
            more, size = 3.0 * self.unit, self.made.size
            return _used(holder.law.curve, np.empty((0, 2)), (), more, size)
        start = float(np.dot(_along(holder), holder.apart))
        return start, start


@dataclass(frozen=True, eq=False)
class Stage(Setting):
    """A solution, and how large its symbols are.

    Attributes:
        solution: What is shown.
        magnify: Factor on the displacements.
        unit: Half the size of a symbol of a support; m.
        shown: Numbers of the kept times that are shown, for which rails must do; all by default.
    """

    solution: Solution
    magnify: float
    unit: float
    shown: Sequence[int] | None = None

    @property
    def scene(self) -> Scene:
        """The scene of the solution."""
        return self.solution.scene

    def pose(self, n: int) -> Pose:
        """The n-th kept time."""
        grid, q = self.solution.grid, self.solution.q[n]
        return Pose(self, lambda anchor: np.asarray(motion_of(grid, anchor, [q])[0]))

    @cached_property
    def travels(self) -> dict[Connector, tuple[float, float]]:
        """See :attr:`Setting.travels`."""
        return {holder: _travel(self, holder) for holder in _sliding(self.scene)}


@dataclass(frozen=True, eq=False)
class Pose:
    """A scene at one time, as it is drawn.

    Attributes:
        stage: What is shown.
        motion: Displacement and rotation of an anchor, not magnified; (3,); m, m, rad.
    """

    stage: Setting
    motion: Callable[[Anchor], Array]

    def at(self, anchor: Anchor) -> Array:
        """Coordinates of an anchor; (2,); m."""
        return np.asarray(anchor.point + self.stage.magnify * self.motion(anchor)[:2])

    def turn(self, anchor: Anchor) -> float:
        """Rotation of an anchor; rad."""
        return float(self.motion(anchor)[2])

    def turned(self, x: tuple[float, float], anchor: Anchor) -> Array:
        """A vector that turns with an anchor; (2,)."""
        return np.asarray(turned(x, np.array([self.turn(anchor)]))[0])

    def points(self) -> Array:
        """Of all bodies, and of what is attached to the ground; (n, 2); m."""
        ground = [spot.point for spot in self.stage.spots[GROUND]]
        bodies = [self.of_body(body, outline) for body, outline in self.stage.outlines.items()]
        return np.concatenate([np.reshape(ground, (-1, 2)), *bodies])

    def of_body(self, body: Body, points: Array) -> Array:
        """Points of a body of the undeformed scene, moved with it; (n, 2); m."""
        u, v, ψ = self.motion(body.middle)
        arms = points - body.center
        moved = turned(arms, np.full(len(arms), ψ)) - arms + (u, v)
        return np.asarray(points + self.stage.magnify * moved)


# -- geometry -----------------------------------------------------------------------------------


def _lane(k: int, count: int, joint: bool, turns: bool) -> float:
    """Return the offset of the k-th of some connectors; in units."""
    if turns:
        return 1.15 * k
    if joint:  # it keeps the middle
        return 1.6 * ((k + 1) // 2) * (-1.0) ** k
    return 1.6 * (k - (count - 1) / 2)


def _sliding(scene: Scene) -> list[Connector]:
    """Connectors that hold what slides on a rail or a guide curve."""
    return [j.holders[0] for j in scene.joints if j.kind in ("Prismatic", "Guided")]


def _along(holder: Connector) -> tuple[float, float]:
    """Direction of a rail, whose holder holds across it."""
    return holder.axis[1], -holder.axis[0]


def _travel(stage: Stage, holder: Connector) -> tuple[float, float]:
    """See :attr:`Setting.travels`."""
    solution = stage.solution
    shown = range(len(solution.times)) if stage.shown is None else stage.shown
    points = solution.position(holder.b)
    if isinstance(holder.law, Guide):
        size = stage.scene.size
        return _used(holder.law.curve, points, shown, 3.0 * stage.unit, size)
    along = _along(holder)
    ahead = turned(along, solution.displacement(holder.a)[:, 2])
    way = np.sum((points - solution.position(holder.a)) * ahead, axis=1)[list(shown)]
    start = float(np.dot(along, holder.apart))
    way = start + stage.magnify * (way - start)
    return min(start, float(way.min())), max(start, float(way.max()))


def _used(
    curve: Curve, points: Array, shown: Sequence[int], more: float, size: float
) -> tuple[float, float]:
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
    r = (0.75 if len(set(points)) > 1 else 1.3) * unit
    angle = np.linspace(0.0, 2 * math.pi, 48, endpoint=False)
    circle = r * np.column_stack([np.cos(angle), np.sin(angle)])
    return _hull(np.concatenate([np.add(point, circle) for point in points]))


def _hull(points: Array) -> Array:
    """Convex hull, counter-clockwise and closed; (n, 2)."""
    from scipy.spatial import ConvexHull

    corners = points[ConvexHull(points).vertices]
    return np.vstack([corners, corners[:1]])
