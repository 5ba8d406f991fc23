# SPDX-License-Identifier: MIT
"""Vertices, nodes and cells of the beams of a scene, and where its places are among them."""

from __future__ import annotations

import struct
from bisect import bisect_left
from collections.abc import Mapping, Sequence
from functools import cached_property
from zlib import crc32

import numpy as np

from ufl_beam.arrays import Array, Index
from ufl_beam.errors import SceneError, require_kind, shorten
from ufl_beam.model.bodies import Member, Place
from ufl_beam.model.material_laws import AnySoftening
from ufl_beam.model.mesh_options import Mesh


class BeamMesh:
    """Base of :class:`Grid`: vertices and cells of all beams.

    ``attached`` are the parameters of the places of each beam that must be vertices.  Cells of a
    higher degree have nodes between their vertices, too.

    Attributes:
        points: Nodes of all beams: the vertices, beam after beam, those inside of cells, and the
            second vertex of each plastic hinge; shape (num_nodes, 2); m.
        cells: Vertices of the cells; shape (num_cells, 2).
        nodes_of_cells: Both vertices of the cells and the nodes between; (num_cells, degree + 1).
        beam_of_cell: Number of the beam of each cell; shape (num_cells,).
        first_vertices: First vertex of each beam, and the number of all; (num_beams + 1,).
    """

    def __init__(
        self,
        beams: Sequence[Member],
        attached: Mapping[Member, Sequence[float]],
        hinges: Sequence[Place],
        mesh: Mesh,
        size: float,
    ) -> None:
        self.beams, self.mesh = beams, mesh
        self._parameters = [np.array(self.mesh.vertices(b, attached[b])) for b in beams]
        counts = np.array([len(p) for p in self._parameters], dtype=np.int64)
        self.first_vertices = np.concatenate([[0], np.cumsum(counts)])
        vertices = np.array(
            [b.curve(s) for b, p in zip(beams, self._parameters, strict=True) for s in p],
            dtype=np.float64,
        ).reshape(-1, 2)
        last = np.zeros(len(vertices), dtype=bool)
        last[self.first_vertices[1:] - 1] = True
        begin = np.flatnonzero(~last)
        self.cells = np.column_stack([begin, begin + 1])
        self.beam_of_cell = np.repeat(np.arange(len(beams)), counts - 1)
        inner, begins, ends = self.mesh.nodes[1:-1], vertices[self.cells[:, 0]], vertices[begin + 1]
        between = begins[:, None] + inner[:, None] * (ends - begins)[:, None]
        self.points = np.concatenate([vertices, between.reshape(-1, 2)])
        numbers = len(vertices) + np.arange(between[..., 0].size).reshape(between.shape[:2])
        self._require_length(size)
        self._add_hinges(hinges)
        self.nodes_of_cells = np.hstack([self.cells, numbers])

    def parameters(self, beam: Member) -> Array:
        """Parameters of the vertices of a beam."""
        return self._parameters[self._index(beam)]

    @cached_property
    def _number_of_beam(self) -> dict[Member, int]:
        return {beam: i for i, beam in enumerate(self.beams)}

    def _index(self, beam: Member) -> int:
        """Number of a beam of the scene."""
        if not isinstance(beam, Member):
            raise SceneError(f"beam = {shorten(beam)} is not a Beam")
        if beam not in self._number_of_beam:
            raise SceneError(f"{beam.name} is not in the scene")
        return self._number_of_beam[beam]

    def place(self, vertex: int) -> Place:
        """Place of a vertex."""
        number = int(np.searchsorted(self.first_vertices, vertex, side="right")) - 1
        beam: Member = self.beams[number]
        return beam.at(float(self._parameters[number][vertex - self.first_vertices[number]]))

    def vertices_of(self, beam: Member) -> Index:
        """Vertices of a beam from start to end."""
        i = self._index(beam)
        return np.arange(self.first_vertices[i], self.first_vertices[i + 1])

    def _nodes_of(self, beam: Member) -> Index:
        """Nodes of a beam, both sides of its hinges included."""
        return np.union1d(self.nodes_of_cells[self.cells_of(beam)], self.vertices_of(beam))

    def _add_hinges(self, places: Sequence[Place]) -> None:
        """Give each plastic hinge a second vertex, which the cell beyond it begins or ends with."""
        at = np.array([self.vertex(place) for place in places], dtype=np.int64)
        numbers = range(len(self.points), len(self.points) + len(at))
        beyond = [Place(place.beam, place.s, beyond=True) for place in places]
        self._beyond = dict(zip(beyond, numbers, strict=True))
        self.points = np.concatenate([self.points, self.points[at]])
        self.cells_at_hinges = np.array([self.cell(place) for place in places], dtype=np.int64)
        for place, number, cell in zip(places, numbers, self.cells_at_hinges, strict=True):
            at_end = place.s == 1.0
            cell_beyond = cell if at_end or place.s == 0.0 else cell + 1
            self.cells[cell_beyond, int(at_end)] = number
        self.vertices_at_hinges = at

    @property
    def pieces(self) -> Index:
        """Neighbouring nodes, one pair after the other along each cell; (degree num_cells, 2)."""
        start, end, *between = self.nodes_of_cells.T
        along = np.column_stack([start, *between, end])
        return np.stack([along[:, :-1], along[:, 1:]], axis=2).reshape(-1, 2)

    def nodes_along(self, beam: Member) -> Index:
        """Vertices of a beam and nodes between them, from start to end."""
        vertices, inner = self.vertices_of(beam), self.nodes_of_cells[self.cells_of(beam), 2:]
        return np.append(np.column_stack([vertices[:-1], inner]), vertices[-1])

    def cells_of(self, beam: Member) -> Index:
        """Cells of a beam from start to end."""
        i = self._index(beam)
        return np.arange(self.first_vertices[i] - i, self.first_vertices[i + 1] - i - 1)

    def weights(self, place: Place) -> tuple[Index, Array]:
        """Nodes of the cell at a place, vertices first, and their weights there; (degree + 1,)."""
        cell, part = self._cell_and_part(place)
        first, *between, last = self.mesh.weights(part)
        nodes = self.nodes_of_cells[cell].copy()
        if part in (0.0, 1.0):  # the side of a hinge that is attached to, not that of the cell
            nodes[int(part)] = self.vertex(place)
        return nodes, np.array([first, last, *between])

    def _cell_and_part(self, place: Place) -> tuple[int, float]:
        """The cell at a place, and the part of it that lies before the place."""
        require_kind(place, Place, "place")
        if place.beam not in self._number_of_beam:
            raise SceneError(f"{place}: {place.beam.name} is not in the scene")
        i = self._number_of_beam[place.beam]
        s = self._parameters[i]
        left = min(max(bisect_left(s, place.s) - 1, 0), len(s) - 2)
        part = (place.s - s[left]) / (s[left + 1] - s[left])
        return int(self.first_vertices[i]) - i + left, float(part)

    def vertex(self, place: Place) -> int:
        """The vertex at a place that something is attached to."""
        if place.beyond:
            return self._beyond[place]
        cell, part = self._cell_and_part(place)
        return cell + self._index(place.beam) + round(part)

    def cell(self, place: Place) -> int:
        """The cell at a place; at a vertex the one before it, at the start the first one."""
        return self._cell_and_part(place)[0]

    def lengths(self, cells: Index) -> Array:
        """Lengths of some cells; (len(cells),); m."""
        ends = self.points[self.cells[cells]]
        return np.asarray(np.linalg.norm(ends[:, 1] - ends[:, 0], axis=1))

    def middle(self, cell: int) -> Place:
        """The place in the middle of a cell."""
        number = int(self.beam_of_cell[cell])
        s, i = self._parameters[number], cell - int(self.first_vertices[number] - number)
        beam: Member = self.beams[number]
        return beam.at((s[i] + s[i + 1]) / 2)

    def hinges(self, beam: Member) -> list[AnySoftening | None]:
        """Law of the hinge that may open in the middle of each cell of a beam."""
        return [beam.section.hinge] * len(self.cells_of(beam))

    def keys(self, cells: Index) -> list[tuple[int, int]]:
        """A number for the ends of the beam, and the number in the beam, of some cells."""
        beams = self.beam_of_cell[cells]
        of_beam = [crc32(struct.pack("4d", *beam.a, *beam.b)) for beam in self.beams]
        first = (self.first_vertices - np.arange(len(self.first_vertices)))[beams]
        return [(of_beam[b], int(c)) for b, c in zip(beams, cells - first, strict=True)]

    def _require_length(self, size: float) -> None:
        ends = self.points[self.cells]
        lengths = np.linalg.norm(ends[:, 1] - ends[:, 0], axis=1)
        for cell in np.flatnonzero(lengths <= 1e-12 * size)[:1]:
            beam = self.beams[self.beam_of_cell[cell]]
            x, y = ends[cell, 0]
            raise SceneError(f"{beam.name}: zero length of a cell at ({x:g}, {y:g})")
