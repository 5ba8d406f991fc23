# SPDX-License-Identifier: MIT
"""Vertices, cells and the numbering of degrees of freedom of a scene.

Every process stores the numbering of the whole scene, a few numbers per cell, but evaluates forms
on its own cells only.  So joints and supports need no communication, and files do not depend on the
number of processes.
"""

from __future__ import annotations

from bisect import bisect_left
from collections.abc import Sequence
from functools import cache, cached_property
from typing import Any, TypeAlias
from zlib import crc32

import numpy as np

from ufl_beam.arrays import Array, Index
from ufl_beam.display import at_point, counted
from ufl_beam.errors import ModelError, shorten
from ufl_beam.model.beams import DEFAULT_MESH, Mesh
from ufl_beam.model.bodies import (
    GROUND,
    AttachmentPoint,
    Body,
    BodyPoint,
    Member,
    Node,
    Place,
    node,
)
from ufl_beam.model.checks import require_kind
from ufl_beam.model.connectors import Connector, place_of
from ufl_beam.model.fibres import SectionPoints, stream_keys
from ufl_beam.model.functions import points_along
from ufl_beam.model.scene import Scene, not_in
from ufl_beam.model.supports import COMPONENTS
from ufl_beam.model.works import Effect

IN_SPACE = "u", "v", "w", "rotation about x", "rotation about y", "rotation about z"
"""Names of the degrees of freedom of a node in space; its axes turn with it."""


class DofNumbering:
    """Vertices, cells and degrees of freedom of a scene.

    Cells of a degree above 1 also have nodes between their vertices.  A node has three degrees of
    freedom (u, v, ψ); nodes of a joint share degrees of freedom.  The numbers of degrees of freedom
    follow the beams, then bodies and joints, and last the forces of connectors.  Elimination in
    this order causes fill-in only where joints and connectors couple beams.

    Attributes:
        points: Coordinates of nodes: vertices, beam after beam; then nodes inside cells; then the
            second vertex of each plastic hinge; shape (num_nodes, 2); m.
        cells: Vertices of the cells; shape (num_cells, 2).
        nodes_of_cells: Both vertices of each cell, then the nodes between them; shape
            (num_cells, degree + 1).
        beam_of_cell: Index of the beam of each cell; shape (num_cells,).
        first_vertices: First vertex of each beam; last, the number of vertices; (num_beams + 1,).
        dofs: Degrees of freedom of each node; shape (num_nodes, 3).
        dofs_of_bodies: Degrees of freedom of ``scene.rigid_bodies``; shape (num_bodies, 3).
        multipliers: Numbers of the forces of connectors (Lagrange multipliers); (num_connectors,).
        displacements, width: Numbers of displacements and of degrees of freedom of a node: 2 and 3
            in the plane, 3 and 6 in space.
        size: Number of degrees of freedom, including the forces of connectors.
        cells_at_hinges: Cell at each plastic hinge of zero length; shape (num_hinges,).
        vertices_at_hinges: First vertex at each of these hinges; shape (num_hinges,).
        beyond: Second vertex of each of these hinges, by the place beyond the hinge.
    """

    def __init__(self, scene: Scene, mesh: Mesh | None = None) -> None:
        mesh = DEFAULT_MESH if mesh is None else mesh
        require_kind(mesh, Mesh, "mesh")
        self.scene, self.mesh, beams = scene, mesh, scene.beams
        if scene.in_space and (mesh.degree, mesh.lumped) != (1, False):
            raise ModelError(
                f"{mesh!r}: cells of beams in space have degree 1 and a consistent mass; give "
                "more of them"
            )
        self.displacements, self.width = (3, 6) if scene.in_space else (2, 3)
        self._beam_indices: dict[Member, int] = {beam: i for i, beam in enumerate(beams)}
        self._parameters: list[Array] = []
        by_kind: dict[object, Array] = {}  # beams with equal cells share parameters
        for beam, attached in scene.attached.items():
            kind = beam.cells, beam.corners, frozenset(attached) - {0.0, 1.0}
            if kind not in by_kind:
                by_kind[kind] = np.array(mesh.vertices(beam, attached))
            self._parameters.append(by_kind[kind])
        counts = np.array([len(p) for p in self._parameters], dtype=np.int64)
        self.first_vertices = np.concatenate([[0], np.cumsum(counts)])
        self._first_cells = self.first_vertices - np.arange(len(beams) + 1)
        curves = [beam.curve for beam in beams]
        vertices = points_along(curves, self._parameters, 3 if scene.in_space else 2)
        begins = np.ones(len(vertices), dtype=bool)
        begins[self.first_vertices[1:] - 1] = False
        begin = np.flatnonzero(begins)
        self.beam_of_cell = np.repeat(np.arange(len(beams), dtype=np.int32), counts - 1)
        inner, starts, ends = mesh.nodes[1:-1], vertices[begin], vertices[begin + 1]
        between = starts[:, None] + inner[:, None] * (ends - starts)[:, None]
        self.points = np.concatenate([vertices, between.reshape(-1, vertices.shape[1])])
        self.nodes_of_cells: Index = np.empty((len(begin), mesh.degree + 1), dtype=np.int32)
        self.nodes_of_cells[:, 0], self.nodes_of_cells[:, 1] = begin, begin + 1
        inside = np.arange(len(vertices), len(self.points))
        self.nodes_of_cells[:, 2:] = inside.reshape(between.shape[:2])
        self.cells = self.nodes_of_cells[:, :2]
        for cell in np.flatnonzero(self.lengths(np.arange(len(begin))) <= 1e-12 * scene.size)[:1]:
            name, at = beams[self.beam_of_cell[cell]].name, self.points[self.cells[cell, 0]]
            raise ModelError(f"{name}: zero length of a cell at {at_point(at)}")
        self._add_hinges(scene.hinges)
        self._number()

    def __str__(self) -> str:
        scene = self.scene
        return counted(
            (len(scene.beams), "beam", "beams"), (len(self.cells), "cell", "cells"),
            (len(scene.bodies), "body", "bodies"),
            (len(scene.all_connectors), "connector", "connectors"),
            (self.size, "degree of freedom", "degrees of freedom"),
        )  # fmt: skip

    def __repr__(self) -> str:
        return f"<DofNumbering: {self}>"

    def _add_hinges(self, hinges: Sequence[Connector]) -> None:
        """Create the second vertex of each plastic hinge, an end of the cell beyond the hinge."""
        places = [place_of(hinge) for hinge in hinges]
        at = np.array([self.vertex(place) for place in places], dtype=np.int64)
        vertices = range(len(self.points), len(self.points) + len(at))
        beyond = [h.a if h.b is place else h.b for h, place in zip(hinges, places, strict=True)]
        self.beyond = dict(zip(beyond, vertices, strict=True))
        self.points = np.concatenate([self.points, self.points[at]])
        self.cells_at_hinges = np.array([self.cell(place) for place in places], dtype=np.int64)
        for place, number, cell in zip(places, vertices, self.cells_at_hinges, strict=True):
            at_end = place.s == 1.0
            cell_beyond = cell if at_end or place.s == 0.0 else cell + 1
            self.cells[cell_beyond, int(at_end)] = number
        self.vertices_at_hinges = at

    def _number(self) -> None:
        nodes, rigid_bodies = len(self.points), self.scene.rigid_bodies
        row = {body: nodes + i for i, body in enumerate(rigid_bodies)}

        @cache
        def at(carrier: Node) -> int:
            return row[carrier] if isinstance(carrier, Body) else self.vertex(carrier)

        width = self.width
        slots = np.arange(width * (nodes + len(rigid_bodies)))
        shared = slots >= width * nodes
        pairs = [
            (width * at(first) + k, width * at(second) + k)
            for (first, c), (second, _) in self.scene.representatives.items()
            for k in self.scene.components(c)
        ]
        ones, others = np.reshape(np.array(pairs, dtype=np.int64), (-1, 2)).T
        slots[ones] = others
        shared[others] = True
        independent = slots == np.arange(len(slots))
        inner = self.nodes_of_cells[:, 2:]
        position = np.arange(nodes + len(rigid_bodies), dtype=np.float64)
        position[list(self.beyond.values())] = self.vertices_at_hinges
        position[inner] = position[self.cells[:, :1]] + self.mesh.nodes[1:-1]
        ordered = (width * np.argsort(position)[:, None] + np.arange(width)).ravel()
        groups = independent & ~shared, independent & shared
        order = np.concatenate([ordered[group[ordered]] for group in groups])
        number = np.empty(len(slots), dtype=np.int32)
        number[order] = np.arange(len(order))
        dofs = number[slots].reshape(-1, width)
        self.dofs, self.dofs_of_bodies = dofs[:nodes], dofs[nodes:]
        # Forces of connectors are last: their diagonal entries may be zero before the motions of
        # the connected nodes are eliminated.
        self.multipliers: Index = len(order) + np.arange(len(self.scene.all_connectors))
        self.size = len(order) + len(self.multipliers)

    def agrees(self, numbering: DofNumbering) -> bool:
        """Return whether ``numbering`` has the same beams, points and degrees of freedom."""
        same = self.scene.beams == numbering.scene.beams
        arrays = (self.points, numbering.points), (self.dofs, numbering.dofs)
        return same and all(np.array_equal(*pair) for pair in arrays)

    def checksum(self) -> int:
        """Compute a checksum of the points and the degrees of freedom."""
        integers = np.r_[self.dofs.ravel(), self.dofs_of_bodies.ravel(), self.multipliers]
        return crc32(integers.astype("<i8").tobytes(), crc32(self.points.astype("<f8").tobytes()))

    # -- beams, vertices, cells ------------------------------------------------------------------

    def _index(self, beam: Member) -> int:
        number = self._beam_indices.get(beam)
        if number is not None:
            return number
        if not isinstance(beam, Member):
            raise ModelError(f"beam = {shorten(beam)} is not a Beam")
        raise ModelError(not_in(self.scene, beam))

    def parameters(self, beam: Member) -> Array:
        """Return the parameters s of the vertices of a beam, from 0 (start) to 1 (end)."""
        return self._parameters[self._index(beam)]

    def gauss_parameters(self, beam: Member) -> Array:
        """Return the parameters s of the points of :attr:`Mesh.gauss` in the cells of a beam.

        The shape is (num_cells, 4).
        """
        s = self.parameters(beam)
        return np.asarray(s[:-1, None] + np.outer(np.diff(s), self.mesh.gauss[0]))

    def vertices_of(self, beam: Member) -> Index:
        """Return the vertices of a beam from start to end."""
        i = self._index(beam)
        return np.arange(self.first_vertices[i], self.first_vertices[i + 1])

    def cells_of(self, beam: Member) -> Index:
        """Return the cells of a beam from start to end."""
        i = self._index(beam)
        return np.arange(self._first_cells[i], self._first_cells[i + 1])

    def nodes_along(self, beam: Member) -> Index:
        """Return the vertices of a beam and the nodes between them, from start to end."""
        vertices, inner = self.vertices_of(beam), self.nodes_of_cells[self.cells_of(beam), 2:]
        return np.append(np.column_stack([vertices[:-1], inner]), vertices[-1])

    @property
    def nodes_along_cells(self) -> Index:
        """Nodes of each cell from its start to its end; (num_cells, degree + 1)."""
        start, end, *between = self.nodes_of_cells.T
        return np.column_stack([start, *between, end])

    @property
    def pieces(self) -> Index:
        """Pairs of neighbouring nodes along each cell; (num_cells * degree, 2)."""
        along = self.nodes_along_cells
        return np.stack([along[:, :-1], along[:, 1:]], axis=2).reshape(-1, 2)

    @cached_property
    def sections(self) -> tuple[list[Any], Index]:
        """Different sections of the beams, and the index of the section of each beam."""
        indices: dict[int, int] = {}
        numbers = (indices.setdefault(id(b.section), len(indices)) for b in self.scene.beams)
        beam_sections = np.array([*numbers], dtype=np.int32)
        firsts = np.unique(beam_sections, return_index=True)[1]
        return [self.scene.beams[i].section for i in firsts], beam_sections

    @cached_property
    def inelastic(self) -> list[tuple[SectionPoints, Index]]:
        """Material points of cells that can yield or break, with the cells that have these points.

        Cells whose laws are of several classes occur once for each class.

        Raises:
            ModelError: A cell is too long for a law.
        """
        groups = dict[SectionPoints, list[int]]()
        sections, beam_sections = self.sections
        for number, section in enumerate(sections):
            points = section.section_points(section.hinge, self.scene.in_space)
            if not all(class_points.elastic for class_points in points):
                for class_points in points:
                    groups.setdefault(class_points, []).append(number)
        cell_sections = beam_sections[self.beam_of_cell]
        with_cells = [
            (section_points, np.flatnonzero(np.isin(cell_sections, group)))
            for section_points, group in groups.items()
        ]
        for section_points, cells in with_cells:
            lengths = self.lengths(cells)
            if fault := section_points.fault(float(lengths.max(initial=0.0))):
                raise ModelError(f"{self.describe_cell(int(cells[lengths.argmax()]))}: {fault}")
        return with_cells

    @cached_property
    def inelastic_cells(self) -> Index:
        """Cells that can yield or break, ascending; (m,)."""
        groups = [cells for _, cells in self.inelastic]
        return np.asarray(np.unique(np.concatenate([np.zeros(0, dtype=np.int64), *groups])))

    def section_lengths(self, cells: Index) -> Array:
        """Compute lengths of cells times weights of integration points; (len(cells) * degree,)."""
        return np.asarray(np.outer(self.lengths(cells), self.mesh.point_weights).ravel())

    def lengths(self, cells: Index) -> Array:
        """Compute lengths of cells; (len(cells),); m."""
        start, end = self.cells[cells].T
        x, y, *z = (self.points[end] - self.points[start]).T
        return np.asarray(np.sqrt(sum((c * c for c in z), x * x + y * y)))

    @cached_property
    def axis_angles(self) -> Array:
        """Directions of the smooth undeformed axis at both ends of cells; (num_cells, 2); rad."""
        x, y = (self.points[self.cells[:, 1]] - self.points[self.cells[:, 0]]).T
        chords = np.asarray(np.arctan2(y, x))
        # The axis bisects the angle between two cells at a vertex, except at corners of the beam.
        half = np.angle(np.exp(1j * np.diff(chords))) / 2
        half[np.diff(self.beam_of_cell) != 0] = np.nan
        for beam in self.scene.beams:
            if beam.corners:
                at_corners = np.isin(self.parameters(beam)[1:-1], beam.corners)
                half[self.cells_of(beam)[:-1][at_corners]] = np.nan
        # With one smooth neighbour the axis of a cell is circular; without a neighbour, straight.
        first, last = np.append(np.nan, -half), np.append(half, np.nan)
        both = np.where(np.isnan(first), -last, first), np.where(np.isnan(last), -first, last)
        return np.asarray(chords[:, None] + np.nan_to_num(np.column_stack(both)))

    def keys(self, cells: Index) -> list[tuple[int, ...]]:
        """Return for each integration point the key of its random values, see :func:`stream_keys`.

        It consists of a checksum of the ends of the beam, the number of the point in the beam, and,
        for the further beams between the same ends, their number.
        """
        beams, p = self.beam_of_cell[cells], self.mesh.degree
        keys = stream_keys(beam.ends for beam in self.scene.beams)
        in_beam = p * (cells - self._first_cells[beams])
        return [
            (keys[b][0], int(c) + i, *keys[b][1:] * bool(keys[b][1]))
            for b, c in zip(beams, in_beam, strict=True)
            for i in range(p)
        ]

    # -- places ----------------------------------------------------------------------------------

    def cell_and_fraction(self, place: Place) -> tuple[int, float]:
        """Return the cell at a place, and the position of the place in the cell, from 0 to 1."""
        require_kind(place, Place, "place")
        if place.beam not in self._beam_indices:
            raise ModelError(f"{place}: {not_in(self.scene, place.beam)}")
        i = self._beam_indices[place.beam]
        s = self._parameters[i]
        left = min(max(bisect_left(s, place.s) - 1, 0), len(s) - 2)
        fraction = (place.s - s[left]) / (s[left + 1] - s[left])
        return int(self._first_cells[i]) + left, float(fraction)

    def cell(self, place: Place) -> int:
        """Return the cell at a place; at a vertex, the cell before it; at s = 0, the first cell."""
        return self.cell_and_fraction(place)[0]

    def vertex(self, place: Place) -> int:
        """Return the vertex at a place; beyond a plastic hinge, its second vertex."""
        if place.beyond:
            return self.beyond[place]
        i = self._index(place.beam)
        if place.s == 0.0:
            return int(self.first_vertices[i])
        if place.s == 1.0:
            return int(self.first_vertices[i + 1]) - 1
        cell, fraction = self.cell_and_fraction(place)
        return cell + i + round(fraction)

    def weights(self, place: Place) -> tuple[Index, Array]:
        """Return the nodes of the cell at a place, and shape functions there; (degree + 1,)."""
        cell, fraction = self.cell_and_fraction(place)
        first, *between, last = self.mesh.weights(fraction)
        nodes = self.nodes_of_cells[cell].copy()
        if fraction in (0.0, 1.0):  # a hinge has another vertex, which the cell may have
            nodes[int(fraction)] = self.vertex(place)
        return nodes, np.array([first, last, *between])

    def place(self, vertex: int) -> Place:
        """Return the place of a vertex."""
        number = int(np.searchsorted(self.first_vertices, vertex, side="right")) - 1
        beam: Member = self.scene.beams[number]
        return beam.at(float(self._parameters[number][vertex - self.first_vertices[number]]))

    def middle(self, cell: int) -> Place:
        """Return the place in the middle of a cell."""
        number = int(self.beam_of_cell[cell])
        s, i = self._parameters[number], cell - int(self._first_cells[number])
        beam: Member = self.scene.beams[number]
        return beam.at((s[i] + s[i + 1]) / 2)

    def place_of(self, number: int) -> Place:
        """Return the middle of a cell, or the place of a hinge, whose numbers follow the cells."""
        if number < len(self.cells):
            return self.middle(number)
        return place_of(self.scene.hinges[number - len(self.cells)])

    def hinge_at(self, place: Place) -> Connector | None:
        """Return the plastic hinge of zero length at a place, or None."""
        return next((h for h in self.scene.hinges if place in (h.a, h.b)), None)

    # -- degrees of freedom ----------------------------------------------------------------------

    def nodes_of(self, member: Member | Body) -> tuple[Array, Index]:
        """Return points (m) and degrees of freedom of nodes of a beam or body; (n, 2), (n, 3)."""
        if isinstance(member, Body):
            return np.array([member.center]), self.node(member.middle)[None]
        nodes = self._beam_nodes(member)
        return self.points[nodes], self.dofs[nodes]

    def _beam_nodes(self, beam: Member) -> Index:
        return np.union1d(self.nodes_of_cells[self.cells_of(beam)], self.vertices_of(beam))

    def node(self, point: AttachmentPoint) -> Index:
        """Return the degrees of freedom of the vertex or body to which a place belongs; (3,)."""
        carrier = node(point)
        if not isinstance(carrier, Body):
            return np.asarray(self.dofs[self.vertex(carrier)])
        if carrier not in self.scene.rigid_bodies:
            raise ModelError(f"{point}: {not_in(self.scene, carrier)}")
        return np.asarray(self.dofs_of_bodies[self.scene.rigid_bodies.index(carrier)])

    @cached_property
    def rotations(self) -> Index:
        """Rotational degrees of freedom, each once, ascending."""
        first = self.displacements
        return np.asarray(np.unique(np.r_[self.dofs, self.dofs_of_bodies][:, first:]))

    @property
    def scales(self) -> Array:
        """Factors that make motions dimensionless; (size,).

        The factor is 1/(size of the scene) for displacements, 1 for rotations, 0 for forces.
        """
        scales = np.full(self.size, 1 / self.scene.size)
        scales[self.rotations] = 1.0
        scales[self.multipliers] = 0.0
        return scales

    @cached_property
    def dofs_of_connectors(self) -> Index:
        """Degrees of freedom of each connector; (num_connectors, 7).

        The order is u of both nodes, v of both nodes, ψ of both nodes, and the force.
        """
        connectors = self.scene.all_connectors
        shape = -1, 2, self.width
        nodes = np.array([(self.node(c.a), self.node(c.b)) for c in connectors]).reshape(shape)
        both = nodes.transpose(0, 2, 1).reshape(-1, 2 * self.width)
        return np.column_stack([both, self.multipliers]).astype(np.int64)

    @cached_property
    def dofs_of_effects(self) -> dict[int, Index]:
        """Degrees of freedom of each effect at places, by its index in the works of the scene.

        The order is u of all nodes, v of all nodes, ψ of all nodes; (3 * places,).
        """
        effects = {i: x for i, x in enumerate(self.scene.works) if isinstance(x, Effect)}
        return {
            i: np.array([self.node(place) for place in effect.places]).T.ravel()
            for i, effect in effects.items() if effect.places
        }  # fmt: skip

    @property
    def names(self) -> tuple[str, ...]:
        """Names of the degrees of freedom of a node in messages."""
        return IN_SPACE if self.width == 6 else COMPONENTS

    def describe(self, dof: int) -> str:
        """Describe a degree of freedom by its component and beam or body, or by its connector."""
        if dof in self.multipliers:
            return f"force of {self.scene.all_connectors[dof - self.multipliers[0]]}"
        if dof not in self.dofs:
            body, component = np.argwhere(self.dofs_of_bodies == dof)[0]
            return f"{self.names[component]} of {self.scene.rigid_bodies[body].name}"
        node, component = np.argwhere(self.dofs == dof)[0]
        beam = next(b for b in self.scene.beams if node in self._beam_nodes(b))
        return f"{self.names[component]} of {beam.name} at {at_point(self.points[node])}"

    def describe_cell(self, number: int) -> str:
        """Describe a cell by its beam and its middle."""
        middle = self.points[self.cells[number]].mean(axis=0)
        return f"{self.scene.beams[self.beam_of_cell[number]].name} at {at_point(middle)}"

    def worst(self, sizes: Array) -> dict[str, float]:
        """Return the largest of ``sizes`` in each beam, body and connector, in descending order.

        Keys describe the degrees of freedom.  Zeros are left out.
        """
        beam_dofs = [self.nodes_of(beam)[1] for beam in self.scene.beams]
        groups = [*beam_dofs, *self.dofs_of_bodies, *self.multipliers.reshape(-1, 1)]
        worst = sorted({int(g.flat[np.argmax(sizes[g])]) for g in groups}, key=lambda d: -sizes[d])
        return {self.describe(dof): float(sizes[dof]) for dof in worst if sizes[dof]}


# -- motions of places -----------------------------------------------------------------------------

Vectors: TypeAlias = Any
"""Configurations or velocities at n times: an array, or ``Column`` of state_rows.py; (n, size)."""


def turned(x: tuple[float, float] | Array, angle: Array) -> Array:
    """Rotate one vector, or one vector for each angle, by angles (rad); (n, 2)."""
    a, b = np.asarray(x, dtype=np.float64).T
    cos, sin = np.cos(angle), np.sin(angle)
    return np.column_stack([cos * a - sin * b, sin * a + cos * b])


def values_at(numbering: DofNumbering, place: AttachmentPoint, states: Vectors) -> Array:
    """Return values at the centre of a body, or interpolated at a place of a beam; (n, 3)."""
    if isinstance(place, BodyPoint):
        if node(place) is GROUND:
            return np.zeros((len(states), numbering.width))
        dofs = numbering.node(place)
        return np.ascontiguousarray(states[:, dofs])
    nodes, weights = numbering.weights(place)
    dofs = numbering.dofs[nodes]
    return np.asarray(weights @ np.ascontiguousarray(states[:, dofs]))
