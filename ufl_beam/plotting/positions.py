# SPDX-License-Identifier: MIT
"""Positions of objects and labels in pictures, and geometry with arrays (..., 2 or 3)."""

from __future__ import annotations

import math
from collections import defaultdict
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
from scipy.spatial.transform import Rotation

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

FROM_A_SIDE = np.array([-0.55, 0.75, -0.4])
"""View direction for scenes in space."""

UP_IN_SPACE = np.array([0.0, 0.0, 1.0])
"""Direction that is upwards in pictures of scenes in space."""


def picture_axes(towards: Array, upwards: Array) -> Array:
    """Return the directions to the right and upwards in a picture with a view direction; (2, 3)."""
    right = np.cross(towards, upwards)
    right /= np.linalg.norm(right)
    return np.array([right, np.cross(right, towards) / np.linalg.norm(towards)])


PICTURE = {2: np.eye(2), 3: picture_axes(FROM_A_SIDE, UP_IN_SPACE)}
"""Directions to the right and upwards in pictures, by the number of coordinates; symbols are drawn
along them."""

Range = tuple[float, float]  # of positions along a rail, m, or of parameters of a guide curve


# -- geometry ----------------------------------------------------------------------------------


def directions(angles: Any) -> Array:
    """Return unit vectors at angles from the axis x; (..., 2); angles in rad."""
    return np.stack([np.cos(angles), np.sin(angles)], axis=-1)


def unit_vectors(vectors: Array) -> Array:
    """Divide vectors by their lengths."""
    return np.asarray(vectors / np.linalg.norm(vectors, axis=-1, keepdims=True))


def normal(vectors: Array) -> Array:
    """Rotate vectors to their left by a right angle, in space within the picture."""
    axes = PICTURE[vectors.shape[-1]]
    return np.asarray((vectors @ axes.T)[..., ::-1] * (-1.0, 1.0) @ axes)


def in_frame(points: Any, at: Any, ahead: Array) -> Array:
    """Return points from coordinates about ``at``, along ``ahead`` and to its left."""
    return np.asarray(at + np.array(points) @ np.array([ahead, normal(ahead)]))


def lengths_along(line: Array) -> Array:
    """Compute lengths of a line from its start to each of its points; (n,)."""
    return np.append(0.0, np.cumsum(np.linalg.norm(np.diff(line, axis=0), axis=1)))


def points_along(line: Array, fractions: Any) -> Array:
    """Return points of a line at fractions of its length; (n, 2 or 3)."""
    lengths = lengths_along(line)
    at = np.multiply(fractions, lengths[-1])
    return np.column_stack([np.interp(at, lengths, x) for x in line.T])


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
    solution that the picture shows; rails are long enough for these times.  Half the size of a
    symbol is ``unit`` (m), or follows from the length ``scale`` (m) of a typographic point.

    Attributes:
        outside: Half the size of symbols of supports, loads and motions; m.
    """

    def __init__(
        self,
        subject: Scene | States,
        magnify: float,
        shown: Sequence[int] = (),
        *,
        unit: float = 0.0,
        scale: float = 0.0,
    ) -> None:
        require_number(magnify, "magnify", positive=True)
        self.magnify, self.shown, self.scale = magnify, shown, scale
        self.solution = subject if isinstance(subject, States) else None
        self.scene = scene = subject.scene if isinstance(subject, States) else subject
        self.spots = attachment_points(scene)  # attachment points of bodies and of the ground
        self.unit = self.outside = unit
        if scale:
            lengths = [math.dist(beam.start.point, beam.end.point) for beam in scene.beams]
            typical = float(np.median(lengths)) / scale if lengths else math.inf
            self.unit = SYMBOL * scale * min(max(typical / SHORT_BEAM, SMALLEST), 1.0)
            few = len(scene.supports) + len(scene.loads) <= FEW
            self.outside = max(self.unit, few * 0.7 * SYMBOL * scale)

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
        return DeformedShape(self, lambda place: state.displacement(place)[0], nodes, n)

    def points(self, origin: AttachmentPoint | None = None) -> Array:
        """Return points of the undeformed and all shown shapes; (n, 2 or 3); m.

        The points are nodes of beams, attachment points, and outlines of bodies.  If ``origin`` is
        given, they are relative to this place at the same time.
        """
        spots = [x for body in (GROUND, *self.scene.bodies) for x in self.spots[body]]
        shapes = []
        for shape in (self.undeformed, *map(self.shape, self.shown)):
            bodies = [shape.body_points(body, outline) for body, outline in self.outlines.items()]
            places = [shape.at(x)[None] for x in spots]
            points = np.concatenate([shape.nodes, *places, *bodies])
            shapes.append(points if origin is None else points - shape.at(origin))
        return np.concatenate(shapes)

    @cached_property
    def travels(self) -> dict[Connector, Range]:
        """Ranges of sliders and guided points at the shown times and in the undeformed state.

        The keys are the connectors that hold the points on rails, with positions (m), and on guide
        curves, with parameters of the curve, which are extended by three units.
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
        """Closed convex outline of each body around its centre and attachment points; (n, 2); m.

        In space it is a circle in the picture around the centre; (n, 3).
        """
        from scipy.spatial import ConvexHull

        outlines, circle = {}, self.unit * directions(np.arange(48) * math.pi / 24)
        for body in self.scene.bodies:
            if self.scene.in_space:
                outlines[body] = body.center + 0.6 * np.vstack([circle, circle[:1]]) @ PICTURE[3]
                continue
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
    index: int | None = None  # of the state; None for the undeformed scene

    def at(self, place: AttachmentPoint) -> Array:
        """Return the coordinates of a place; (2,) or (3,); m."""
        moved = self.motion(place)[: len(place.point)]
        return np.asarray(place.point + self.canvas.magnify * moved)

    def rotation(self, place: AttachmentPoint) -> float:
        """Return the rotation of a place in the plane, in space 0, as symbols face the viewer."""
        return 0.0 if len(place.point) == 3 else float(self.motion(place)[2])

    def turned(self, x: Any, place: AttachmentPoint) -> Array:
        """Rotate a vector with a place; (2,) or (3,)."""
        if len(place.point) == 3:
            return np.asarray(Rotation.from_rotvec(self.motion(place)[3:]).apply(x))
        return in_frame(x, 0.0, directions(self.rotation(place)))

    def axis_points(self, fractions: Array) -> Array:
        """Return points of beams at fractions of cells; (num_cells, fractions, 2 or 3); m."""
        assert self.canvas.solution is not None
        numbering = self.canvas.solution.numbering
        points = numbering.mesh.weights(fractions) @ self.nodes[numbering.nodes_along_cells]
        return np.asarray(points)

    def section_axes(self, fractions: Array) -> Array:
        """Return axes 1, 2, 3 of sections as columns; (num_cells, fractions, 3, 3).

        In the plane, axis 2 is to the left of the drawn line.  At corners between cells of a beam
        it bisects the angle; near a corner it leans towards the bisector.
        """
        assert self.canvas.solution is not None
        solution, numbering = self.canvas.solution, self.canvas.solution.numbering
        if not self.canvas.scene.in_space:
            slopes = numbering.mesh.slopes(fractions)
            ahead = unit_vectors(slopes @ self.nodes[numbering.nodes_along_cells])
            lean = np.zeros((len(ahead), 2, 2))
            k = np.flatnonzero(np.diff(numbering.beam_of_cell) == 0)
            half = unit_vectors(ahead[k, -1] + ahead[k + 1, 0])
            lean[k, 1], lean[k + 1, 0] = half - ahead[k, -1], half - ahead[k + 1, 0]
            ahead = unit_vectors(ahead + np.column_stack([1.0 - fractions, fractions]) @ lean)
            axes = np.tile(np.eye(3), (*ahead.shape[:2], 1, 1))
            axes[..., :2, :2] = np.stack([ahead, normal(ahead)], axis=-1)
            return axes
        _, axes = solution.cells.axes
        if self.index is None:
            return np.repeat(axes[:, None], len(fractions), axis=1)
        cells = solution.cells_in_space(self.index)
        return np.stack([cells.frames(s).as_matrix() @ axes for s in fractions], axis=1)

    def body_points(self, body: Body, points: Array) -> Array:
        """Move points of an undeformed body with the body, in space without turning them; m."""
        if self.canvas.scene.in_space:
            return np.asarray(points - body.center + self.at(body.middle))
        u, v, ψ = self.motion(body.middle)
        arms = points - body.center
        moved = in_frame(arms, (u, v), directions(ψ)) - arms
        return np.asarray(points + self.canvas.magnify * moved)
