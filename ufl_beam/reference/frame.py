# SPDX-License-Identifier: MIT
"""The beams of a scene as one distributed interval mesh, with joints and supports as q = C x."""

from __future__ import annotations

from mpi4py import MPI
from petsc4py import PETSc

import numpy as np
from scipy.sparse import csr_array, eye_array
from scipy.sparse.csgraph import connected_components

from ufl_beam.arrays import Array, Index
from ufl_beam.discretization.dof_numbering import DofNumbering
from ufl_beam.discretization.partition import bisect
from ufl_beam.dolfinx_compat import fem, line_mesh
from ufl_beam.model.bodies import GROUND
from ufl_beam.model.functions import TimeFunction, still


class Frame:
    """Mesh of all beams, with a vertex for each part at a hinge or revolute joint.

    Rigid joints are shared vertices.  The parts at a revolute joint have the same numbers of
    displacements in ``dofs``, so C has equal rows.  The coordinates y of the scene are its
    configuration q, but at inclined supports they are the displacements along the axes of the
    support: q = E y, both in the order of :class:`DofNumbering`.  The unknowns x are the
    coordinates in the order of the processes that own them, and C are the rows of E at the degrees
    of freedom of the mesh.

    Args:
        numbering: Numbering of the scene, with cells of degree 1.
        comm: Processes that share the mesh.
    """

    def __init__(self, numbering: DofNumbering, comm: MPI.Intracomm) -> None:
        self.numbering = n = numbering
        dofs, one, same = np.unique(n.dofs, axis=0, return_index=True, return_inverse=True)
        cells = same.ravel()[n.cells]
        ranks = self._ranks(cells, comm)
        self.mesh = line_mesh(n.points[one], cells.astype(np.int64), comm, ranks)
        self.cells: Index = np.asarray(self.mesh.topology.original_cell_index)  # in the scene
        self.V = fem.functionspace(self.mesh, ("Lagrange", 1, (3,)))
        nodes = self.V.dofmap.index_map
        vertex = np.empty(nodes.size_local + nodes.num_ghosts, dtype=np.int64)
        vertex[self.V.dofmap.list] = cells[self.cells]
        self.dofs: Index = dofs[vertex].ravel()  # in the scene, of the local ones of V
        self.held, self.motions, self.E = self._supports()

        rows, owner = self.E[self.dofs[: 3 * nodes.size_local]], np.full(n.size, comm.size)
        owner[rows.indices] = comm.rank
        comm.Allreduce(MPI.IN_PLACE, owner, MPI.MIN)
        owner[owner == comm.size] = 0  # bodies, forces of connectors, ends of beams at hinges
        self.order: Index = np.argsort(owner, kind="stable")  # coordinates of all unknowns
        self.mine = np.flatnonzero(owner == comm.rank)  # unknowns of this process
        self.columns, self.rows = self.E[:, self.order], self.E[:, self.mine].T.tocsr()
        C = rows[:, self.order].sorted_indices()
        csr = *(x.astype(PETSc.IntType) for x in (C.indptr, C.indices)), C.data
        sizes = (C.shape[0], None), (len(self.mine), n.size)
        self.C = PETSc.Mat().createAIJ(sizes, csr=csr, comm=comm)
        self.fixed = np.flatnonzero(np.isin(self.mine, self.held))  # prescribed local unknowns

    def _supports(self) -> tuple[Index, list[TimeFunction], csr_array]:
        """Return prescribed coordinates, their functions of time, and the matrix E."""
        numbering, scene = self.numbering, self.numbering.scene
        inclined, held = any(s.angle for s in scene.supports), dict[int, TimeFunction]()
        E = eye_array(numbering.size, format="lil" if inclined else "csr")  # lil is slow
        if GROUND in scene.rigid_bodies:
            held = dict.fromkeys(map(int, numbering.node(GROUND.middle)), still)
        for support in scene.supports:
            y, c, s = numbering.node(support.place), np.cos(support.angle), np.sin(support.angle)
            if support.angle:
                E[np.ix_(y[:2], y[:2])] = [[c, -s], [s, c]]
            held |= {int(y[k]): motion for k, motion in support.held.items()}
        return np.array([*held], dtype=np.int64), [*held.values()], csr_array(E)

    def _ranks(self, cells: Index, comm: MPI.Intracomm) -> Index:
        """Return the process of each cell; all cells at a vertex of more than two are on one.

        In DOLFINx 0.9, processes with several cells at a vertex do not know that others have it.
        """
        many = np.bincount(cells.ravel())[cells] > 2
        pairs = many.nonzero()[0], cells[many]
        at = csr_array((many[many], pairs), (len(cells), cells.max() + 1))
        groups = connected_components(at @ at.T)[1]
        first = np.unique(groups, return_index=True)[1]
        middles = self.numbering.points[self.numbering.cells].mean(axis=1)
        return np.asarray(bisect(middles, comm.size)[first[groups]])

    def coordinates(self, x: PETSc.Vec) -> Array:
        """Return the coordinates of the scene, on all processes, from the unknowns."""
        y: Array = np.empty(self.numbering.size)
        y[self.order] = np.concatenate(self.mesh.comm.allgather(x.array_r))
        return y
