# SPDX-License-Identifier: MIT
"""Strokes and labels of the picture of a model, at a scale that is still to be found."""

from __future__ import annotations

import math
from collections import Counter, defaultdict
from collections.abc import Iterable, Iterator, Sequence

import numpy as np

from ufl_beam.arrays import Array
from ufl_beam.model.bodies import Anchor, Body, Member, Place
from ufl_beam.model.loads import FollowerLoad, LineLoad, PointLoad
from ufl_beam.model.scene import Scene
from ufl_beam.plotting.geometry import (
    directions,
    left_of,
    lengths_along,
    points_along,
    unit_vectors,
)
from ufl_beam.plotting.labels import Label, Spot
from ufl_beam.plotting.style import Stroke

LOADS, MOTIONS, CAPTIONS, NAMES = range(4)  # ranks of labels: those of loads are placed first
MOST_LABELS = 80  # number beyond which names and captions are left out

SYMBOL, SHORT_BEAM, SMALLEST = 12.0, 45.0, 0.3
"""Half the size of a symbol of a support where beams are not short; length of a beam below which it
shrinks, in proportion; points.  It shrinks at most to this part."""

Spots = tuple[Spot, ...]


class Subject:
    """Scene, with all that its pictures at any scale have in common; lengths in m."""

    def __init__(self, scene: Scene) -> None:
        self.scene, attached = scene, scene.attached
        self.axes: dict[Member, Array] = {  # vertices; (n, 2)
            beam: np.array([beam.curve(s) for s in beam.vertices(attached[beam])], float)
            for beam in scene.beams
        }
        self.cells = sum(len(axis) - 1 for axis in self.axes.values())
        self.names = _numbered(scene.beams) | _numbered(scene.bodies)
        lengths = [math.dist(axis[0], axis[-1]) for axis in self.axes.values()]
        self.typical = float(np.median(lengths)) if lengths else math.inf
        forces = [x.force for x in scene.loads if isinstance(x, PointLoad | FollowerLoad)]
        lines = [x.force for x in scene.loads if isinstance(x, LineLoad)]
        speeds = [
            velocity.at(*at)[:2]
            for velocity in scene.initial
            for part in velocity.beams
            for at in self.points_of(part)
        ]
        self.force, self.line_load, self.speed = (  # the largest ones; N, N/m, m/s
            max((math.hypot(*x) for x in found), default=0.0) or 1.0
            for found in (forces, lines, speeds)
        )
        ends = [(x[0], x[1], x[-1], x[-2]) for x in self.axes.values()]
        self._ends: Array = np.reshape(ends, (-1, 2, 2))

    def ways(self, anchor: Anchor) -> Array:
        """Return the directions in which beams leave a place; (n, 2)."""
        near = np.abs(self._ends[:, 0] - anchor.point).max(axis=1) < 1e-7 * self.scene.size
        pairs = [*self._ends[near]]
        if isinstance(anchor, Place) and 0.0 < anchor.s < 1.0:
            axis = self.axes[anchor.beam]
            k = int(np.argmin(np.linalg.norm(axis - anchor.point, axis=1)))
            pairs += [axis[[k, j]] for j in (k - 1, k + 1) if 0 <= j < len(axis)]
        start, end = np.reshape(pairs, (-1, 2, 2)).swapaxes(0, 1)
        return unit_vectors(end - start)

    def points_of(self, part: Member | Body) -> Array:
        """Return the points at which velocities are shown: ends and middle of a beam; (n, 2)."""
        if isinstance(part, Body):
            return np.array([part.center])
        return at_parts(self.axes[part], [0.0, 0.5, 1.0])


class Sheet:
    """Strokes of a picture by groups, and its labels; lengths in m."""

    def __init__(self, subject: Subject, scale: float) -> None:
        self.subject, self.scale = subject, scale  # the scale is the length of a point
        scene, typical = subject.scene, subject.typical / scale
        self.unit = SYMBOL * scale * min(max(typical / SHORT_BEAM, SMALLEST), 1.0)
        few = len(scene.supports) + len(scene.loads) <= MOST_LABELS / 2
        self.outside = max(self.unit, 0.7 * SYMBOL * scale) if few else self.unit
        """Unit of what stands around the beams: supports, loads and motions."""
        self.strokes: defaultdict[str, list[Stroke]] = defaultdict(list)
        self.labels: list[Label] = []
        self._stacks: defaultdict[object, float] = defaultdict(float)

    def add(self, group: str, strokes: Iterable[Stroke]) -> None:
        """Add strokes to a group."""
        self.strokes[group] += strokes

    def write(self, text: str, color: str, rank: int, spots: Spots) -> None:
        """Add a label with the places where it may stand."""
        self.labels.append(Label(text, color, rank, spots))

    def everything(self) -> Iterator[Stroke]:
        """Iterate over the strokes of all groups."""
        for group in self.strokes.values():
            yield from group

    def height(self, key: object) -> float:
        """Return the height of the symbols that stand at a place in a direction."""
        return self._stacks[key]

    def stack(self, key: object, height: float) -> float:
        """Put a symbol onto those at a place; return the height at which it begins."""
        self._stacks[key] += height
        return self._stacks[key] - height

    def around(self, at: Array, radius: float) -> Spots:
        """List spots of a label on all sides of a symbol."""
        ways = directions(np.radians([0, 180, 90, 270, 45, 135, 315, 225]))
        return tuple(Spot(at, way, radius / self.scale) for way in ways)

    def along(self, axis: Array, distance: float) -> Spots:
        """List spots of a label on both sides of a beam, at least a distance away."""
        gap = distance / self.scale
        return tuple(Spot(at, s * left, gap) for at, left in normals(axis) for s in (1.0, -1.0))


def at_parts(axis: Array, parts: Sequence[float] | Array) -> Array:
    """Points of a line at parts of its length; (n, 2)."""
    return points_along(axis, np.multiply(parts, lengths_along(axis)[-1]))


def normals(axis: Array) -> list[tuple[Array, Array]]:
    """Points along a line and the unit vector to its left there, from the middle outwards."""
    parts = np.array([0.5, 0.4, 0.6, 0.3, 0.7, 0.2, 0.8, 0.1, 0.9])
    way = at_parts(axis, parts + 0.01) - at_parts(axis, parts - 0.01)
    return list(zip(at_parts(axis, parts), left_of(unit_vectors(way)), strict=True))


def _numbered(parts: Sequence[Member | Body]) -> dict[Member | Body, str]:
    """Names of beams or bodies; equal ones with their number in the scene."""
    known = Counter(part.name for part in parts)
    return {
        part: f"{part.name} {k}" if known[part.name] > 1 else part.name
        for k, part in enumerate(parts)
    }
