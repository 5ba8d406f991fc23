# SPDX-License-Identifier: MIT
"""The beams of a scene as one distributed interval mesh; joints and supports as q = C x + g(t)."""

from __future__ import annotations

from mpi4py import MPI
from petsc4py import PETSc

import numpy as np
from scipy.sparse import coo_array, csr_array, eye_array
from scipy.sparse.csgraph import connected_components

from ufl_beam.arrays import Array, Index
from ufl_beam.discretization.dof_numbering import DofNumbering
from ufl_beam.discretization.partition import bisect
from ufl_beam.dolfinx_compat import fem, line_mesh
from ufl_beam.model.bodies import GROUND
from ufl_beam.model.functions import TimeFunction, still


class Frame:
    """Mesh of all beams, with a vertex for each part at a hinge or revolute joint.

    Rigid joints are shared vertices.  Revolute joints make displacements equal, and supports
    prescribe displacements along their axes and rotations.  So coordinates y of the scene determine
    its configuration q = E y, both in the order of :class:`DofNumbering`.  The coordinates that no
    support prescribes are the unknowns x, distributed over the processes; C has the rows of E of
    the mesh and the columns of the unknowns.

    Args:
        numbering: Numbering of the scene, with cells of degree 1.
        comm: Processes that share the mesh.

    Attributes:
        mesh: Plane interval mesh.
        cells: Number in the scene of each cell of this process.
        V: Space of configurations (u_x, u_y, ψ), P1.
        dofs: Number in the scene of each local degree of freedom of V.
        E: Matrix of q = E y; (size, size).
        C: PETSc matrix from the unknowns to the degrees of freedom of V.
        order: Coordinate of each unknown.
        mine: Coordinates of the unknowns of this process.
        columns: Columns of E of all unknowns.
        rows: Rows of E transposed of the unknowns of this process.
        held: Prescribed coordinates.
        motions: Function of time of each of them.
    """

    def __init__(self, numbering: DofNumbering, comm: MPI.Intracomm) -> None:
        self.numbering = n = numbering
        dofs, one, same = np.unique(n.dofs, axis=0, return_index=True, return_inverse=True)
        cells, points = same.ravel()[n.cells], n.points[one]
        ranks = self._ranks(cells, comm)
        self.mesh = line_mesh(points, cells.astype(np.int64), comm, ranks)
        self.cells: Index = np.asarray(self.mesh.topology.original_cell_index)
        self.V = fem.functionspace(self.mesh, ("Lagrange", 1, (3,)))
        nodes = self.V.dofmap.index_map
        vertex = np.empty(nodes.size_local + nodes.num_ghosts, dtype=np.int64)
        vertex[self.V.dofmap.list] = cells[self.cells]
        self.dofs: Index = dofs[vertex].ravel()
        self.held, self.motions, self.E = self._coordinates()

        owned = 3 * nodes.size_local
        rows, owner = self.E[self.dofs], np.full(n.size, comm.size)
        owner[rows[:owned].indices] = comm.rank
        comm.Allreduce(MPI.IN_PLACE, owner, MPI.MIN)
        owner[owner == comm.size] = 0  # bodies, forces of connectors, ends of beams at hinges
        owner[self.held] = comm.size
        self.order: Index = np.argsort(owner, kind="stable")[: np.count_nonzero(owner < comm.size)]
        self.mine = np.flatnonzero(owner == comm.rank)
        self.columns, self.rows = self.E[:, self.order], self.E[:, self.mine].T.tocsr()
        self._known = rows[:, self.held]
        C = rows[:owned][:, self.order].sorted_indices()
        csr = *(x.astype(PETSc.IntType) for x in (C.indptr, C.indices)), C.data
        sizes = (owned, None), (len(self.mine), len(self.order))
        self.C = PETSc.Mat().createAIJ(sizes, csr=csr, comm=comm)

    def _coordinates(self) -> tuple[Index, list[TimeFunction], csr_array]:
        """Return prescribed coordinates and their functions of time, and the matrix E."""
        numbering, scene, entries = self.numbering, self.numbering.scene, [(0, 0, 0.0)]
        held = dict[int, TimeFunction]()
        if GROUND in scene.rigid_bodies:
            held = dict.fromkeys(map(int, numbering.node(GROUND.middle)), still)
        for support in scene.supports:
            (i, j, _), angle = (y := numbering.node(support.place)), support.angle
            c, s = np.cos(angle), np.sin(angle)
            if angle:
                entries += [(i, i, c - 1), (i, j, -s), (j, i, s), (j, j, c - 1)]
            held |= {int(y[k]): motion for k, motion in support.held.items()}
        i, j, values = np.transpose(entries)
        more = coo_array((values, (i.astype(int), j.astype(int))), (numbering.size,) * 2)
        E = csr_array(eye_array(numbering.size, format="csr") + more.tocsr())
        return np.array([*held], dtype=np.int64), [*held.values()], E

    def _ranks(self, cells: Index, comm: MPI.Intracomm) -> Index:
        """Return the process of each cell; all cells at a vertex of more than two are on one.

        In DOLFINx 0.9, processes with several cells at a vertex do not know that others have it.
        """
        many = np.bincount(cells.ravel())[cells] > 2
        pairs = many.nonzero()[0], cells[many]
        at = csr_array((many[many], pairs), (len(cells), cells.max() + 1))
        groups = connected_components(at @ at.T)[1]
        _, first, group = np.unique(groups, return_index=True, return_inverse=True)
        middles = self.numbering.points[self.numbering.cells].mean(axis=1)
        return np.asarray(bisect(middles, comm.size)[first[group]])

    def g(self, motions: Array) -> Array:
        """Return the part of q that supports prescribe, at the local degrees of freedom of V."""
        return np.asarray(self._known @ motions)

    def coordinates(self, x: PETSc.Vec, motions: Array) -> Array:
        """Return all coordinates y on all processes, from unknowns and prescribed motions."""
        y: Array = np.zeros(self.numbering.size)
        y[self.order] = np.concatenate(self.mesh.comm.allgather(x.array_r))
        y[self.held] = motions
        return y
