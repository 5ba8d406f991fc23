"""From a scene to vertices, cells and the numbering of degrees of freedom.

Every process holds the numbering of the whole scene, a few integers a cell, and meshes only its
own cells; so neither joints nor supports need communication, and files are written as if by one
process.
"""

from __future__ import annotations

import struct
from functools import cached_property
from typing import Any
from zlib import crc32

from mpi4py import MPI

import numpy as np
import numpy.typing as npt

from ufl_beam.beams import Beam, Place
from ufl_beam.compat import Array
from ufl_beam.errors import SceneError, require_kind
from ufl_beam.laws import Softening
from ufl_beam.scene import COMPONENTS, Scene

Index = npt.NDArray[Any]
"""Array of integers."""


class Grid:
    """Vertices, cells and degrees of freedom of a scene.

    A vertex has three degrees of freedom (u, v, ψ); those that joints share are one.  They are
    numbered along the beams, the shared ones last: eliminating them in this order fills in nothing
    but the coupling of the joints.

    Attributes:
        points: Vertices of all beams, beam after beam; shape (num_vertices, 2); m.
        cells: Vertices of the cells; shape (num_cells, 2).
        beam_of_cell: Number of the beam of each cell; shape (num_cells,).
        dofs: Degrees of freedom of each vertex; shape (num_vertices, 3).
        size: Number of degrees of freedom.
        num_shared: How many of them joints share.
    """

    def __init__(self, scene: Scene) -> None:
        self.scene = scene
        self._parameters = [np.array(b.vertices(scene.attached[b])) for b in scene.beams]
        counts = np.array([len(p) for p in self._parameters])
        self._first = np.concatenate([[0], np.cumsum(counts)])
        self.points = np.array(
            [b.curve(s) for b, p in zip(scene.beams, self._parameters, strict=True) for s in p],
            dtype=np.float64,
        ).reshape(-1, 2)
        last = np.zeros(len(self.points), dtype=bool)
        last[self._first[1:] - 1] = True
        begin = np.flatnonzero(~last)
        self.cells = np.column_stack([begin, begin + 1])
        self.beam_of_cell = np.repeat(np.arange(len(scene.beams)), counts - 1)
        self._require_length()
        self.dofs, self.size, self.num_shared = self._number()

    @cached_property
    def _number_of_beam(self) -> dict[Beam, int]:
        return {beam: i for i, beam in enumerate(self.scene.beams)}

    def _index(self, beam: Beam, asked: str = "") -> int:
        """Number of a beam of the scene; ``asked`` says in messages what it is wanted for."""
        require_kind(beam, Beam, "beam")
        if beam not in self._number_of_beam:
            raise SceneError(f"{asked}{beam.name} is not in the scene")
        return self._number_of_beam[beam]

    def vertices_of(self, beam: Beam) -> Index:
        """Vertices of a beam from start to end."""
        i = self._index(beam)
        return np.arange(self._first[i], self._first[i + 1])

    def cells_of(self, beam: Beam) -> Index:
        """Cells of a beam from start to end."""
        i = self._index(beam)
        return np.arange(self._first[i] - i, self._first[i + 1] - i - 1)

    def weights(self, place: Place) -> tuple[Index, Array]:
        """Vertices around a place and their weights of linear interpolation; both (2,).

        Raises:
            SceneError: The beam of the place is not in the scene.
        """
        require_kind(place, Place, "place")
        i = self._index(place.beam, f"{place}: ")
        s = self._parameters[i]
        left = int(np.clip(np.searchsorted(s, place.s) - 1, 0, len(s) - 2))
        part = (place.s - s[left]) / (s[left + 1] - s[left])
        return self._first[i] + np.array([left, left + 1]), np.array([1 - part, part])

    def vertex(self, place: Place) -> int:
        """The vertex at a place that something is attached to."""
        vertices, weights = self.weights(place)
        return int(vertices[np.argmax(weights)])

    def cell(self, place: Place) -> int:
        """The cell at a place; at a vertex the one before it, at the start the first one."""
        (first, _), _ = self.weights(place)
        return int(first) - self._index(place.beam)

    def hinges(self, beam: Beam) -> list[Softening | None]:
        """Law of the hinge in each cell of a beam."""
        cells = self.cells_of(beam)
        laws = [beam.section.hinge] * len(cells)
        at = {s: self.cell(beam.at(s)) - cells[0] for s in beam.hinges}
        if len(set(at.values())) < len(at):
            raise SceneError(
                f"{beam.name}: two of the hinges at s = {', '.join(f'{s:g}' for s in at)} are in "
                "one cell; take more cells, or one hinge"
            )
        for s, law in beam.hinges.items():
            laws[at[s]] = law
        return laws

    def keys(self, cells: Index) -> list[tuple[int, int]]:
        """A number for the ends of the beam, and the number in the beam, of some cells."""
        beams = self.beam_of_cell[cells]
        of_beam = [crc32(struct.pack("4d", *beam.a, *beam.b)) for beam in self.scene.beams]
        first = (self._first - np.arange(len(self._first)))[beams]
        return [(of_beam[b], int(c)) for b, c in zip(beams, cells - first, strict=True)]

    def describe(self, dof: int) -> str:
        """A degree of freedom in words: its component, beam and point."""
        vertex, component = np.argwhere(self.dofs == dof)[0]
        beam = int(np.searchsorted(self._first, vertex, side="right")) - 1
        x, y = self.points[vertex]
        return f"{COMPONENTS[component]} of {self.scene.beams[beam].name} at ({x:g}, {y:g})"

    def _require_length(self) -> None:
        ends = self.points[self.cells]
        lengths = np.linalg.norm(ends[:, 1] - ends[:, 0], axis=1)
        for cell in np.flatnonzero(lengths <= 1e-12 * self.scene.size)[:1]:
            beam = self.scene.beams[self.beam_of_cell[cell]]
            x, y = ends[cell, 0]
            raise SceneError(f"{beam.name}: zero length of a cell at ({x:g}, {y:g})")

    def _number(self) -> tuple[Index, int, int]:
        slots = np.arange(3 * len(self.points))
        shared = np.zeros(len(slots), dtype=bool)
        for (place, component), (other, _) in self.scene.representatives().items():
            same = 3 * self.vertex(other) + component
            slots[3 * self.vertex(place) + component] = same
            shared[same] = True
        kept = slots == np.arange(len(slots))
        order = np.concatenate([np.flatnonzero(kept & ~shared), np.flatnonzero(kept & shared)])
        number = np.empty(len(slots), dtype=np.int64)
        number[order] = np.arange(len(order))
        return number[slots].reshape(-1, 3), len(order), int(np.sum(kept & shared))


class Share:
    """The part of a grid that one process computes: its cells, and their degrees of freedom.

    Local numbers: first the degrees of freedom that this process owns, then the ghosts; each in the
    order of the grid.  Global numbers, those of PETSc, are contiguous on each process.

    Attributes:
        cells: Numbers of the cells of this process; contiguous.
        dofs: Degrees of freedom, in numbers of the grid, by local number.
        num_owned: How many of them this process owns.
        ghosts: Global numbers of the others.
        cell_dofs: Local degrees of freedom of the cells: both u, both v, both ψ;
            shape (len(cells), 6).
    """

    def __init__(self, grid: Grid, comm: MPI.Intracomm) -> None:
        self.grid = grid
        self.comm = comm
        num_cells = len(grid.cells)
        limits = np.arange(comm.size + 1) * num_cells // comm.size
        self.cells = np.arange(limits[comm.rank], limits[comm.rank + 1])

        of_cell = grid.dofs[grid.cells].transpose(0, 2, 1).reshape(num_cells, 6)
        owner = np.full(grid.size, comm.size)
        rank_of_cell = np.searchsorted(limits, np.arange(num_cells), side="right") - 1
        np.minimum.at(owner, of_cell, rank_of_cell[:, None])
        order = np.argsort(owner, kind="stable")
        self._global = np.empty(grid.size, dtype=np.int64)
        self._global[order] = np.arange(grid.size)

        touched = np.unique(of_cell[self.cells])
        mine = owner[touched] == comm.rank
        self.dofs = np.concatenate([touched[mine], touched[~mine]])
        self.num_owned = int(mine.sum())
        self.ghosts = self._global[self.dofs[self.num_owned :]].astype(np.int32)
        self._local = np.full(grid.size, -1)
        self._local[self.dofs] = np.arange(len(self.dofs))
        self.cell_dofs = self._local[of_cell[self.cells]]
        self._all_owned = order

    @property
    def size(self) -> int:
        """Number of local degrees of freedom, ghosts included."""
        return len(self.dofs)

    def at(self, place: Place) -> Index:
        """Degrees of freedom (numbers of the grid) of a place with a vertex; shape (3,)."""
        return np.asarray(self.grid.dofs[self.grid.vertex(place)])

    def computes(self, place: Place) -> bool:
        """Whether this process has the cell at a place, of two cells the first.

        It then has all degrees of freedom of the place, even if others own some of them.
        """
        vertex = self.grid.vertex(place)
        cell = int(np.argmax((self.grid.cells == vertex).any(axis=1)))
        return bool(self.cells[0] <= cell <= self.cells[-1])

    def rotations(self) -> Index:
        """Local numbers of all rotations; int32."""
        rotations = np.unique(self.local(self.grid.dofs[:, 2]))
        return rotations.astype(np.int32)

    def cell_lengths(self) -> Array:
        """Lengths of the cells; m."""
        ends = self.grid.points[self.grid.cells[self.cells]]
        return np.asarray(np.linalg.norm(ends[:, 1] - ends[:, 0], axis=1))

    def lengths(self) -> Array:
        """What a strain of one is to each local degree of freedom: a cell's length, or a radian."""
        lengths = np.ones(self.size)
        lengths[self.cell_dofs[:, :4]] = self.cell_lengths()[:, None]
        return lengths

    def local(self, dofs: Index) -> Index:
        """Local numbers of those ``dofs`` (numbers of the grid) that this process has."""
        found = self._local[dofs]
        return np.asarray(found[found >= 0])

    def owns(self, dofs: Index) -> npt.NDArray[np.bool_]:
        """Which of ``dofs`` (numbers of the grid) this process owns."""
        found = self._local[dofs]
        return np.asarray((found >= 0) & (found < self.num_owned))

    def gather(self, values: Array) -> Array:
        """Values of all degrees of freedom, in the order of the grid, on every process.

        One process alone gets ``values`` back: states are new arrays in each step.
        """
        if self.comm.size == 1:
            return values
        parts = np.concatenate(self.comm.allgather(values[: self.num_owned]))
        result = np.empty(self.grid.size)
        result[self._all_owned] = parts
        return result

    def gather_cells(self, values: Array) -> Array:
        """Values of all cells, in the order of the grid, on every process."""
        if self.comm.size == 1:
            return values.copy()
        return np.concatenate(self.comm.allgather(values))

    def total(self, value: float) -> float:
        """Sum over the processes."""
        return value if self.comm.size == 1 else float(self.comm.allreduce(value))
