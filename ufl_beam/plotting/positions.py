# SPDX-License-Identifier: MIT
"""Positions of objects and labels in pictures, and plane geometry with arrays (..., 2)."""

from __future__ import annotations

import math
from collections import defaultdict
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any, NamedTuple

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
    """Join lines with NaN between them, as one line for Matplotlib; (n, 2)."""
    gap = np.full((1, 2), np.nan)
    pieces: list[Array] = [piece for line in lines for piece in (line, gap)]
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
    ) -> None:
        require_number(magnify, "magnify", positive=True)
        self.magnify, self.unit, self.outside = magnify, unit, outside or unit
        self._solution = subject if isinstance(subject, States) else None
        self.scene = subject.scene if isinstance(subject, States) else subject
        self._shown = shown
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
        return cls(subject, magnify, unit, shown, max(unit, 0.7 * SYMBOL * scale) if few else unit)

    @property
    def undeformed(self) -> DeformedShape:
        """Shape of the undeformed scene."""
        nodes = np.empty((0, 2)) if self._solution is None else self._solution.numbering.points
        return DeformedShape(self, lambda place: np.zeros(3), nodes)

    def shape(self, n: int) -> DeformedShape:
        """Return the shape at the n-th recorded time of the solution, or raise ArgumentError."""
        assert self._solution is not None
        require_kind(n, (int, np.integer), "plot: n")
        numbering, n = self._solution.numbering, self._solution.index(n)
        state = self._solution.subset(n, n + 1)
        nodes = numbering.points + self.magnify * state.q[0, numbering.dofs[:, :2]]
        return DeformedShape(self, lambda place: state.displacement(place)[0], nodes)

    def points(self, origin: AttachmentPoint | None = None) -> Array:
        """Return points of the undeformed and all shown shapes; (n, 2); m.

        The points are nodes of beams, attachment points on the ground, and outlines of bodies.  If
        ``origin`` is given, they are relative to this place at the same time.
        """
        ground = np.reshape([point.point for point in self.spots[GROUND]], (-1, 2))
        shapes = []
        for shape in (self.undeformed, *map(self.shape, self._shown)):
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
        solution, shown = self._solution, list(self._shown)
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
        for point in () if self._solution is None else self._solution.position(holder.b):
            parameters.append(curve.nearest(point, parameters[-1], size))
        used = [0.0, *(parameters[1:][n] for n in self._shown)]
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
    motion: Callable[[AttachmentPoint], Array]  # (u, v, ψ) of a place, not magnified; m, m, rad
    nodes: Array  # of all beams of a solution; (num_nodes, 2); m

    def at(self, place: AttachmentPoint) -> Array:
        """Return the coordinates of a place; (2,); m."""
        return np.asarray(place.point + self.canvas.magnify * self.motion(place)[:2])

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


# -- labels beside lines and other labels ------------------------------------------------------

GAPS = (4.0, 12.0, 24.0, 40.0, 60.0)  # candidate distances of a label from its target; points
CLEARANCE = 2.0  # clearance around a label; points
ROUNDS = 6  # most iterations of the placement

LINE_COST, LABEL_COST, OUTSIDE_COST, DISTANCE_COST, RANK_COST = 8.0, 40.0, 100.0, 0.6, 0.4
"""Costs of a candidate position, per point of lines under the label; square point under other
labels; point outside the frame; point of distance from the target; index in the candidates."""

CROSSING_COST = 25.0  # per diagonal of a label that the leader crosses; a line costs a tenth of it
LEADER = 10.0  # least distance of a label from its target at which it has a leader line; points


class Candidate(NamedTuple):
    """Candidate position of a label: its target point, and the direction from there to the label.

    Lengths are in points, or in m if a drawing converts them.
    """

    at: Array  # (2,)
    direction: Array  # unit vector; (2,)
    gap: float = 0.0  # least distance of the label


class Label(NamedTuple):
    """Text of a label, and its candidate positions, the best first."""

    text: str
    color: str
    rank: int  # labels of lower ranks are placed first
    spots: tuple[Candidate, ...]


class Placed(NamedTuple):
    """Label with its position; lengths in points."""

    label: Label
    center: Array  # of its box; (2,)
    half: Array  # half the width and height of its box; (2,)
    target: Array  # point that the label belongs to; (2,)
    overlap: float  # fraction of its box under other labels

    @property
    def leader(self) -> Array:
        """Line from the target to the box, (2, 2); no points, (0, 2), if the box is close."""
        edge = np.clip(self.target, self.center - self.half, self.center + self.half)
        ends = np.array([self.target, edge])
        return ends if np.linalg.norm(edge - self.target) >= LEADER else ends[:0]


def place(
    labels: Sequence[Label], halves: Sequence[Array], lines: Array, frame: Array | None = None
) -> list[Placed]:
    """Place labels where they cover the least; iterate until their positions no longer change.

    Lengths are in points.  ``halves`` are half the widths and heights of the labels.  Labels should
    not cover the segments ``lines``, (n, 4), and not leave the corners of ``frame``, (4,).
    """
    order = sorted(range(len(labels)), key=lambda k: labels[k].rank)
    placed: dict[int, Placed] = {}
    for _ in range(ROUNDS):
        before = [box.center for box in placed.values()]
        for k in order:
            others = [box for j, box in placed.items() if j != k]
            placed[k] = _best(labels[k], np.asarray(halves[k], dtype=float), lines, others, frame)
        if np.array_equal([box.center for box in placed.values()], before):
            break
    return [placed[k] for k in order]


def _best(
    label: Label, half: Array, lines: Array, others: list[Placed], frame: Array | None
) -> Placed:
    """Place a label at the candidate position and distance, of GAPS, with the least cost."""
    boxes: Array = np.reshape([(*x.center - x.half, *x.center + x.half) for x in others], (-1, 4))
    lines = np.vstack([lines, *(x.leader.reshape(-1, 4) for x in others)])
    number = np.arange(len(label.spots))
    gaps, choices = np.repeat(GAPS, len(number)), np.tile(number, len(GAPS))
    ways = np.array([place.direction for place in label.spots])[choices]
    spots = np.array([place.at + place.gap * place.direction for place in label.spots])[choices]
    # The box is beyond the line that is perpendicular to the direction at the target.
    centers = spots + ways * (gaps + np.abs(ways) @ half)[:, None]
    low, high = centers - half - CLEARANCE, centers + half + CLEARANCE
    # Segments near the candidate boxes.
    first, last = np.minimum(lines[:, :2], lines[:, 2:]), np.maximum(lines[:, :2], lines[:, 2:])
    close = lines[((first <= high.max(axis=0)) & (last >= low.min(axis=0))).all(axis=1)]
    sides = np.minimum(high[:, None], boxes[:, 2:]) - np.maximum(low[:, None], boxes[:, :2])
    covered = np.prod(np.maximum(sides, 0.0), axis=2).sum(axis=1)  # area under other labels
    cost = DISTANCE_COST * gaps + RANK_COST * choices
    cost += LINE_COST * lengths_inside(low, high, close) + LABEL_COST * covered
    if frame is not None:
        beyond = np.maximum(frame[:2] - low, 0.0) + np.maximum(high - frame[2:], 0.0)
        cost += OUTSIDE_COST * beyond.sum(axis=1)
    # Skip candidates with a leader that cost more than the best one without a leader.
    ends = np.hstack([spots, np.clip(spots, centers - half, centers + half)])
    leads = np.linalg.norm(ends[:, 2:] - ends[:, :2], axis=1) >= LEADER
    some = np.flatnonzero(leads & (cost < cost[~leads].min(initial=np.inf)))
    diagonals = np.concatenate([boxes, boxes[:, [0, 3, 2, 1]]])
    crossed = crossings(ends[some], diagonals) + 0.1 * crossings(ends[some], close)
    cost[some] += CROSSING_COST * crossed
    best = int(np.argmin(cost))
    overlap = float(covered[best] / np.prod(high[best] - low[best]))
    return Placed(label, centers[best], half, spots[best], overlap)


def crossings(first: Array, second: Array) -> Array:
    """Count the segments ``second``, (n, 4), that each segment of ``first`` crosses."""
    ends = first[:, None, :2], first[:, None, 2:], second[None, :, :2], second[None, :, 2:]
    a, b, c, d = np.broadcast_arrays(*ends)
    # Signs of the areas of triangles p, q, r.
    p, q, r = np.stack([a, a, c, c]), np.stack([b, b, d, d]), np.stack([c, d, a, b])
    (x, y), (u, v) = np.moveaxis(q - p, -1, 0), np.moveaxis(r - p, -1, 0)
    sign = np.sign(x * v - y * u)
    apart = (sign[0] * sign[1] < 0) & (sign[2] * sign[3] < 0)
    return np.asarray(apart.sum(axis=1))


def lengths_inside(low: Array, high: Array, lines: Array) -> Array:
    """Sum the lengths of segments, (n, 4), inside boxes with corners ``low`` and ``high``."""
    first, step = lines[None, :, :2], (lines[:, 2:] - lines[:, :2])[None]
    lengths = np.linalg.norm(step[0], axis=1)
    # In a direction perpendicular to it, a segment is either entirely inside or outside.
    step = np.where(step == 0.0, 1e-99, step)
    ends = (low[:, None] - first) / step, (high[:, None] - first) / step
    enter, end = np.minimum(*ends).max(axis=2), np.maximum(*ends).min(axis=2)
    return np.asarray(np.maximum(np.minimum(end, 1.0) - np.maximum(enter, 0.0), 0.0) @ lengths)
