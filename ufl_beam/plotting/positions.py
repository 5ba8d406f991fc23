# SPDX-License-Identifier: MIT
"""Positions of objects and labels in pictures, and plane geometry with arrays (..., 2)."""

from __future__ import annotations

import math
from collections import defaultdict
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np

from ufl_beam.arrays import Array
from ufl_beam.errors import require_kind, require_number
from ufl_beam.model.bodies import GROUND, AttachmentPoint, Body
from ufl_beam.model.connector_laws import Guide
from ufl_beam.model.connectors import Connector
from ufl_beam.model.scene import Scene, attachment_points
from ufl_beam.output.states import States

SYMBOL, SHORT_BEAM, SMALLEST = 12.0, 45.0, 0.3
"""Half the size of a symbol; points.  Median length of beams, below which symbols shrink in
proportion; points.  Smallest fraction to which they shrink."""

FEW = 40  # number of supports and loads up to which their symbols shrink less than others

Range = tuple[float, float]  # of positions along a rail, m, or of parameters of a guide curve


# -- geometry ----------------------------------------------------------------------------------


def directions(angles: Any) -> Array:
    """Return unit vectors at angles from the axis x; (..., 2); angles in rad."""
    return np.stack([np.cos(angles), np.sin(angles)], axis=-1)


def unit_vectors(vectors: Array) -> Array:
    """Divide vectors by their lengths; (..., 2)."""
    return np.asarray(vectors / np.linalg.norm(vectors, axis=-1, keepdims=True))


def normal(vectors: Array) -> Array:
    """Rotate vectors to their left by a right angle; (..., 2)."""
    return vectors[..., ::-1] * (-1.0, 1.0)


def in_frame(points: Any, at: Any, ahead: Array) -> Array:
    """Return points from coordinates about ``at``, along ``ahead`` and to its left; (n, 2)."""
    return np.asarray(at + np.array(points) @ np.array([ahead, normal(ahead)]))


def lengths_along(line: Array) -> Array:
    """Compute lengths of a line from its start to each of its points; (n,)."""
    return np.append(0.0, np.cumsum(np.linalg.norm(np.diff(line, axis=0), axis=1)))


def points_along(line: Array, fractions: Any) -> Array:
    """Return points of a line at fractions of its length; (n, 2)."""
    lengths = lengths_along(line)
    at = np.multiply(fractions, lengths[-1])
    return np.column_stack([np.interp(at, lengths, x) for x in line.T])


def segments(line: Array) -> Array:
    """Return segments of a line between its points, (x, y, x, y) of both ends; (n - 1, 4)."""
    return np.hstack([line[:-1], line[1:]])


def joined(lines: Iterable[Array]) -> Array:
    """Join lines with NaN between them, as one line for Matplotlib; (n, 2 or 3)."""
    pieces: list[Array] = [x for line in lines for x in (line, np.nan * np.ones_like(line[:1]))]
    return np.concatenate(pieces[:-1] or [np.empty((0, 2))])


def evenly(progress: Array, count: int) -> list[int]:
    """Return indices of ``count`` recorded states, evenly spaced in time or along a path."""
    spaced = np.linspace(progress[0], progress[-1], count)
    return [int(np.argmin(np.abs(progress - x))) for x in spaced]


# -- scenes ------------------------------------------------------------------------------------


class Canvas:
    """Scene or solution with the magnification and the size of symbols of a picture.

    Displacements are multiplied by ``magnify``.  ``shown`` are indices of the recorded times of a
    solution that the picture shows; rails are long enough for these times.
    """

    def __init__(
        self,
        subject: Scene | States,
        magnify: float,
        unit: float,  # half the size of a symbol; m
        shown: Sequence[int] = (),
        outside: float = 0.0,  # half the size of symbols of supports, loads, motions; m
        scale: float = 0.0,  # length of a typographic point; m
    ) -> None:
        require_number(magnify, "magnify", positive=True)
        self.magnify, self.unit, self.outside, self.scale = magnify, unit, outside or unit, scale
        self.solution = subject if isinstance(subject, States) else None
        self.scene = subject.scene if isinstance(subject, States) else subject
        self.shown = shown
        self.spots = attachment_points(self.scene)  # attachment points of bodies and of the ground

    @classmethod
    def at_scale(
        cls, subject: Scene | States, magnify: float, scale: float, shown: Sequence[int] = ()
    ) -> Canvas:
        """Make a canvas for a plane picture, in which a typographic point is ``scale`` (m) long."""
        scene = subject.scene if isinstance(subject, States) else subject
        lengths = [math.dist(beam.start.point, beam.end.point) for beam in scene.beams]
        typical = float(np.median(lengths)) / scale if lengths else math.inf
        unit = SYMBOL * scale * min(max(typical / SHORT_BEAM, SMALLEST), 1.0)
        few = len(scene.supports) + len(scene.loads) <= FEW
        outside = max(unit, 0.7 * SYMBOL * scale) if few else unit
        return cls(subject, magnify, unit, shown, outside, scale)

    @property
    def undeformed(self) -> DeformedShape:
        """Shape of the undeformed scene."""
        if self.solution is not None:
            nodes = self.solution.numbering.points
        else:
            vertices = ([b.curve(s) for s in b.vertices(())] for b in self.scene.beams)
            nodes = np.concatenate([np.empty((0, 3 if self.scene.in_space else 2)), *vertices])
        return DeformedShape(self, lambda place: np.zeros(6 if self.scene.in_space else 3), nodes)

    def shape(self, n: int) -> DeformedShape:
        """Return the shape at the n-th recorded time of the solution, or raise ArgumentError."""
        assert self.solution is not None
        require_kind(n, (int, np.integer), "plot: n")
        numbering, n = self.solution.numbering, self.solution.index(n)
        state = self.solution.subset(n, n + 1)
        moved = state.q[0, numbering.dofs[:, : numbering.displacements]]
        nodes = numbering.points + self.magnify * moved
        return DeformedShape(self, lambda place: state.displacement(place)[0], nodes)

    def points(self, origin: AttachmentPoint | None = None) -> Array:
        """Return points of the undeformed and all shown shapes; (n, 2); m.

        The points are nodes of beams, attachment points on the ground, and outlines of bodies.  If
        ``origin`` is given, they are relative to this place at the same time.
        """
        ground = np.reshape([point.point for point in self.spots[GROUND]], (-1, 2))
        shapes = []
        for shape in (self.undeformed, *map(self.shape, self.shown)):
            bodies = [shape.body_points(body, outline) for body, outline in self.outlines.items()]
            points = np.concatenate([shape.nodes, ground, *bodies])
            shapes.append(points if origin is None else points - shape.at(origin))
        return np.concatenate(shapes)

    @cached_property
    def travels(self) -> dict[Connector, Range]:
        """Ranges of sliders and guided points at the shown times and in the undeformed state.

        The keys are the connectors that constrain motions across rails and guide curves.  A range
        on a rail is in positions, m.  A range on a guide curve is in parameters, extended by three
        units at ends where the curve goes on.
        """
        ranges: dict[Connector, Range] = {}
        solution, shown = self.solution, list(self.shown)
        for holder in (holder for joint in self.scene.joints for holder in joint.holders):
            if isinstance(holder.law, Guide):
                ranges[holder] = self._along_guide(holder, holder.law)
            elif holder.motion == "sliding":
                x, y = holder.axis
                reached = np.array([start := float(np.dot((y, -x), holder.apart))])
                if solution is not None:
                    turned = math.atan2(-x, y) + solution.displacement(holder.a)[shown, 2]
                    apart = solution.position(holder.b) - solution.position(holder.a)
                    sliding = np.sum(apart[shown] * directions(turned), axis=1)
                    reached = start + self.magnify * (np.append(sliding, start) - start)
                ranges[holder] = float(reached.min()), float(reached.max())
        return ranges

    def _along_guide(self, holder: Connector, law: Guide) -> Range:
        """Return the used parameters of a guide curve, with extensions where the curve goes on."""
        curve, size, parameters = law.curve, self.scene.size, [0.0]
        for point in () if self.solution is None else self.solution.position(holder.b):
            parameters.append(curve.nearest(point, parameters[-1], size))
        used = [0.0, *(parameters[1:][n] for n in self.shown)]
        ends = []
        for s, more in ((np.nanmin(used), -3.0), (np.nanmax(used), 3.0)):
            beyond = float(s + more * self.unit / math.hypot(*curve.at(float(s))[1]))
            ends.append(beyond if np.isfinite(curve.at(beyond)[0]).all() else float(s))
        return ends[0], ends[1]

    @cached_property
    def outlines(self) -> dict[Body, Array]:
        """Closed convex outline of each body around its centre and attachment points; (n, 2); m."""
        from scipy.spatial import ConvexHull

        outlines, circle = {}, self.unit * directions(np.arange(48) * math.pi / 24)
        for body in self.scene.bodies:
            points = {body.center, *(x.point for x in self.spots[body])}
            radius = 0.75 if len(points) > 1 else 1.3
            cloud = np.concatenate([np.add(point, radius * circle) for point in points])
            corners = ConvexHull(cloud).vertices
            outlines[body] = cloud[[*corners, corners[0]]]
        return outlines

    @cached_property
    def offsets(self) -> dict[Connector, float]:
        """Offsets of connectors from the line between places, or from the first at a pin; units."""
        # A rail or rod between the same places stays on the line.
        middles = {frozenset(joint.places) for joint in self.scene.joints if not joint.meets}
        groups: defaultdict[tuple[bool, frozenset[object]], list[Connector]] = defaultdict(list)
        for c in self.scene.connectors:
            where: tuple[object, ...] = (c.b.point,) if c.is_rotation else (c.a, c.b)
            groups[c.is_rotation, frozenset(where)].append(c)
        offsets: dict[Connector, float] = {}
        for (rotated, ends), group in groups.items():
            for k, connector in enumerate(group):
                if rotated:
                    offsets[connector] = 1.15 * k
                elif ends in middles:
                    offsets[connector] = 1.6 * (k // 2 + 1) * (-1.0) ** (k + 1)
                else:
                    offsets[connector] = 1.6 * (k - (len(group) - 1) / 2)
        return offsets


@dataclass(frozen=True, eq=False)
class DeformedShape:
    """Drawn positions of a scene at one time."""

    canvas: Canvas
    motion: Callable[[AttachmentPoint], Array]  # displacement of a place, not magnified; m, rad
    nodes: Array  # of all beams of a solution; (num_nodes, 2 or 3); m

    def at(self, place: AttachmentPoint) -> Array:
        """Return the coordinates of a place; (2,) or (3,); m."""
        moved = self.motion(place)[: len(place.point)]
        return np.asarray(place.point + self.canvas.magnify * moved)

    def rotation(self, place: AttachmentPoint) -> float:
        """Return the rotation of a place; rad."""
        return float(self.motion(place)[2])

    def turned(self, x: tuple[float, float], place: AttachmentPoint) -> Array:
        """Rotate a vector with a place; (2,)."""
        return in_frame(x, 0.0, directions(self.rotation(place)))

    def body_points(self, body: Body, points: Array) -> Array:
        """Move points of an undeformed body with the body; (n, 2); m."""
        u, v, ψ = self.motion(body.middle)
        arms = points - body.center
        moved = in_frame(arms, (u, v), directions(ψ)) - arms
        return np.asarray(points + self.canvas.magnify * moved)
