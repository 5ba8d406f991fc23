# SPDX-License-Identifier: MIT
"""From a scene to vertices, cells and the numbering of degrees of freedom.

Every process holds the numbering of the whole scene, a few integers a cell, and meshes only its
own cells; so neither joints nor supports need communication, and files are written as if by one
process.
"""

from __future__ import annotations

import math
from functools import cache, cached_property
from zlib import crc32

from mpi4py import MPI

import numpy as np
import numpy.typing as npt

from ufl_beam.arrays import Array, Index
from ufl_beam.discretization.beam_mesh import BeamMesh
from ufl_beam.errors import SceneError, require_kind
from ufl_beam.model.bodies import Anchor, Body, Member, Node, Place, Spot, node
from ufl_beam.model.connectors import Connector
from ufl_beam.model.mesh_options import Mesh
from ufl_beam.model.plastic_hinges import place_of
from ufl_beam.model.scene import Scene
from ufl_beam.model.supports import COMPONENTS


class Grid(BeamMesh):
    """Vertices, cells and degrees of freedom of a scene.

    A node has three degrees of freedom (u, v, ψ); those that joints share are one.  They are
    numbered along the beams, the shared ones last: eliminating them in this order fills in nothing
    but the coupling of the joints.

    Args:
        scene: What is modelled.
        mesh: How finely; with the cells of its beams by default.

    Attributes:
        dofs: Degrees of freedom of each node; shape (num_nodes, 3).
        dofs_of_bodies: Degrees of freedom of each of the scene's movers; shape (num_movers, 3).
        multipliers: Degrees of freedom that are the forces of connectors; shape (num_links,).
        size: Number of degrees of freedom.
    """

    def __init__(self, scene: Scene, mesh: Mesh | None = None) -> None:
        mesh = Mesh() if mesh is None else mesh
        require_kind(mesh, Mesh, "mesh")
        self.scene = scene
        places = [place_of(hinge) for hinge in scene.hinges]
        super().__init__(scene.beams, scene.attached, places, mesh, scene.size)
        self._number()

    def agrees(self, other: Grid) -> bool:
        """Return whether the degrees of freedom are those of another grid."""
        return (
            self.scene.beams == other.scene.beams
            and np.array_equal(self.points, other.points)
            and np.array_equal(self.dofs, other.dofs)
        )

    def checksum(self) -> int:
        """A number that tells points and numberings apart."""
        numbers = np.concatenate([self.dofs.ravel(), self.dofs_of_bodies.ravel(), self.multipliers])
        return crc32(numbers.astype("<i8").tobytes(), crc32(self.points.astype("<f8").tobytes()))

    def nodes_of(self, one: Member | Body) -> tuple[Array, Index]:
        """Points and degrees of freedom of the nodes of a beam or body; (n, 2), (n, 3); m."""
        if isinstance(one, Body):
            return np.array([one.center]), self.node(one.middle).reshape(1, 3)
        nodes = self._nodes_of(one)
        return self.points[nodes], self.dofs[nodes]

    def node(self, anchor: Anchor) -> Index:
        """Degrees of freedom of what an anchor that has a vertex, or a body, moves with; (3,).

        Raises:
            SceneError: Its beam or body is not in the scene.
        """
        of = node(anchor)
        if not isinstance(of, Body):
            return np.asarray(self.dofs[self.vertex(of)])
        if of not in self.scene.movers:
            raise SceneError(f"{anchor}: {of.name} is not in the scene")
        return np.asarray(self.dofs_of_bodies[self.scene.movers.index(of)])

    @cached_property
    def dofs_of_links(self) -> Index:
        """Of each connector: both u, both v, both ψ of its nodes, and its force; (num_links, 7)."""
        links = self.scene.links
        nodes = np.array([(self.node(c.a), self.node(c.b)) for c in links]).reshape(-1, 2, 3)
        both = nodes.transpose(0, 2, 1).reshape(-1, 6)
        return np.column_stack([both, self.multipliers]).astype(np.int64)

    def place_of(self, number: int) -> Place:
        """The middle of a cell or, numbered after the cells, the place of a plastic hinge."""
        if number < len(self.cells):
            return self.middle(number)
        return place_of(self.scene.hinges[number - len(self.cells)])

    def hinge_at(self, place: Place) -> Connector | None:
        """The plastic hinge of zero length at a place, if there is one."""
        return next((h for h in self.scene.hinges if place in (h.a, h.b)), None)

    def describe(self, dof: int) -> str:
        """A degree of freedom in words: its component, beam and point."""
        if dof in self.multipliers:
            return f"what holds {self.scene.links[dof - self.multipliers[0]]}"
        if dof not in self.dofs:
            body, component = np.argwhere(self.dofs_of_bodies == dof)[0]
            return f"{COMPONENTS[component]} of {self.scene.movers[body].name}"
        node, component = np.argwhere(self.dofs == dof)[0]
        x, y = self.points[node]
        beam = next(b for b in self.scene.beams if node in self._nodes_of(b))
        return f"{COMPONENTS[component]} of {beam.name} at ({x:g}, {y:g})"

    def worst(self, sizes: Array) -> dict[str, float]:
        """The degree of freedom of each beam, body and connector with the largest size, in words.

        Args:
            sizes: One for each degree of freedom; those that are zero are left out.
        """
        dofs_of_beams = [self.nodes_of(beam)[1] for beam in self.scene.beams]
        groups = [*dofs_of_beams, *self.dofs_of_bodies, *self.multipliers.reshape(-1, 1)]
        worst = sorted({int(g.flat[np.argmax(sizes[g])]) for g in groups}, key=lambda d: -sizes[d])
        return {self.describe(dof): float(sizes[dof]) for dof in worst if sizes[dof]}

    def _number(self) -> None:
        nodes, movers = len(self.points), self.scene.movers
        row = {body: nodes + i for i, body in enumerate(movers)}

        @cache
        def at(of: Node) -> int:
            return row[of] if isinstance(of, Body) else self.vertex(of)

        slots = np.arange(3 * (nodes + len(movers)))
        shared = slots >= 3 * nodes
        for (one, component), (other, _) in self.scene.representatives.items():
            same = 3 * at(other) + component
            slots[3 * at(one) + component] = same
            shared[same] = True
        kept = slots == np.arange(len(slots))
        inner = self.nodes_of_cells[:, 2:]
        position = np.arange(nodes + len(movers), dtype=np.float64)
        position[list(self._beyond.values())] = self.vertices_at_hinges
        position[inner] = position[self.cells[:, :1]] + self.mesh.nodes[1:-1]
        ordered = (3 * np.argsort(position)[:, None] + np.arange(3)).ravel()
        order = np.concatenate([ordered[(kept & of)[ordered]] for of in (~shared, shared)])
        number = np.empty(len(slots), dtype=np.int64)
        number[order] = np.arange(len(order))
        dofs = number[slots].reshape(-1, 3)
        self.dofs, self.dofs_of_bodies = dofs[:nodes], dofs[nodes:]
        # Forces come last: eliminating what they act on first leaves no zero on the diagonal.
        self.multipliers = len(order) + np.arange(len(self.scene.links))
        self.size = len(order) + len(self.multipliers)


class Share:
    """The part of a grid that one process computes: its cells, and their degrees of freedom.

    Local numbers: first the degrees of freedom that this process owns, then the ghosts; each in the
    order of the grid.  Global numbers, those of PETSc, are contiguous on each process.

    Attributes:
        cells: Numbers of the cells of this process; contiguous.
        dofs: Degrees of freedom, in numbers of the grid, by local number.
        num_owned: How many of them this process owns.
        ghosts: Global numbers of the others.
        cell_dofs: Local degrees of freedom of the cells: all u, all v, all ψ of their nodes;
            shape (len(cells), 3 (degree + 1)).
        links: Numbers of the connectors of this process.
        body_dofs: Local degrees of freedom of the bodies that are here; (num, 3).
        link_dofs: Local degrees of freedom of the connectors: those of a cell, and their force;
            shape (len(links), 7).
    """

    def __init__(self, grid: Grid, comm: MPI.Intracomm) -> None:
        self.grid = grid
        self.comm = comm
        num_cells = len(grid.cells)
        limits = np.arange(comm.size + 1) * num_cells // comm.size
        self.cells = np.arange(limits[comm.rank], limits[comm.rank + 1])

        of_cell = grid.dofs[grid.nodes_of_cells].transpose(0, 2, 1)
        of_cell = of_cell.reshape(num_cells, 3 * (grid.mesh.degree + 1))
        owner = np.full(grid.size, comm.size)
        rank_of_cell = np.searchsorted(limits, np.arange(num_cells), side="right") - 1
        np.minimum.at(owner, of_cell, rank_of_cell[:, None])
        of_hinge, cell_of_hinge = grid.dofs[grid.vertices_at_hinges], grid.cells_at_hinges
        np.minimum.at(owner, of_hinge, rank_of_cell[cell_of_hinge][:, None])
        of_link = grid.dofs_of_links
        rank_of_link = owner[of_link].min(axis=1, initial=comm.size) % comm.size
        np.minimum.at(owner, of_link, rank_of_link[:, None])
        owner[owner == comm.size] = 0  # bodies that nothing is attached to
        self.links = np.flatnonzero(rank_of_link == comm.rank)
        order = np.argsort(owner, kind="stable")
        self._global = np.empty(grid.size, dtype=np.int64)
        self._global[order] = np.arange(grid.size)

        own = np.flatnonzero(owner == comm.rank)
        at_hinges = of_hinge[rank_of_cell[cell_of_hinge] == comm.rank].ravel()
        of_links = of_link[self.links].ravel()
        touched = np.unique(np.r_[own, of_cell[self.cells].ravel(), at_hinges, of_links])
        mine = owner[touched] == comm.rank
        self.dofs = np.concatenate([touched[mine], touched[~mine]])
        self.num_owned = int(mine.sum())
        self.ghosts = self._global[self.dofs[self.num_owned :]].astype(np.int32)
        self._local = np.full(grid.size, -1, dtype=np.int32)
        self._local[self.dofs] = np.arange(len(self.dofs))
        self.cell_dofs = self._local[of_cell[self.cells]]
        self.link_dofs = self._local[of_link[self.links]]
        of_body = self._local[grid.dofs_of_bodies]
        self.body_dofs = of_body[(of_body >= 0).all(axis=1)]
        self._all_owned = order
        self._num_owned_by = np.bincount(owner, minlength=comm.size).tolist()

    @property
    def size(self) -> int:
        """Number of local degrees of freedom, ghosts included."""
        return len(self.dofs)

    @property
    def num_global(self) -> int:
        """Number of degrees of freedom of all processes."""
        return self.grid.size

    def at(self, anchor: Anchor) -> Index:
        """Degrees of freedom (numbers of the grid) of what an anchor moves with; shape (3,)."""
        return self.grid.node(anchor)

    def computes(self, anchor: Anchor) -> bool:
        """Return whether this process has the (first) cell at a place, or owns a body.

        It then has all degrees of freedom of the place, even if others own some of them.
        """
        if isinstance(anchor, Spot):
            return bool(self.owns(self.at(anchor)).all())
        return bool(self.cells[0] <= self.grid.cell(anchor) <= self.cells[-1])

    def rotations(self) -> Index:
        """Local numbers of all rotations; int32."""
        grid = self.grid
        turning = np.r_[grid.dofs[:, 2], grid.dofs_of_bodies[:, 2]]
        return np.unique(self.local(turning)).astype(np.int32)

    def translations(self) -> tuple[Index, Index]:
        """Local numbers of both components of all displacements."""
        grid = self.grid
        pairs = np.unique(np.r_[grid.dofs[:, :2], grid.dofs_of_bodies[:, :2]], axis=0)
        found = self._local[pairs]
        x, y = found[(found >= 0).all(axis=1)].T
        return x, y

    def multipliers(self) -> Index:
        """Local numbers of the forces of connectors."""
        return self.local(self.grid.multipliers)

    def cell_lengths(self) -> Array:
        """Lengths of the cells; m."""
        return self.grid.lengths(self.cells)

    def lengths(self) -> Array:
        """Change of each local degree of freedom by a strain of one: a cell's length, or a radian.

        Bodies are as large as the scene; forces of connectors have no length.
        """
        lengths = np.full(self.size, self.grid.scene.size)
        displacements = self.cell_dofs[:, : 2 * (self.grid.mesh.degree + 1)]
        lengths[displacements] = self.cell_lengths()[:, None]
        lengths[self.rotations()] = 1.0
        lengths[self.multipliers()] = 0.0
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
        parts, result = np.empty((2, self.grid.size))
        owned = np.ascontiguousarray(values[: self.num_owned])
        self.comm.Allgatherv(owned, [parts, self._num_owned_by])
        result[self._all_owned] = parts
        return result

    def added(self, values: Array) -> Array:
        """Sums over the processes of values at the local degrees of freedom."""
        if self.comm.size == 1:
            return values
        sums = np.zeros(self.grid.size)
        sums[self.dofs] = values
        self.comm.Allreduce(MPI.IN_PLACE, sums)
        return np.asarray(sums[self.dofs])

    def gather_cells(self, values: Array) -> Array:
        """Values of all cells, in the order of the grid, on every process."""
        if self.comm.size == 1:
            return values.copy()
        return np.concatenate(self.comm.allgather(values))

    def total(self, value: float) -> float:
        """Sum over the processes."""
        return value if self.comm.size == 1 else float(self.comm.allreduce(value))

    def largest(self, value: float) -> float:
        """Largest over the processes; infinite where one has no number.

        MPI does not say what the largest of numbers is with one that is none, and processes that
        learn different ones part.
        """
        if self.comm.size == 1:
            return value
        return float(self.comm.allreduce(math.inf if math.isnan(value) else value, op=MPI.MAX))
