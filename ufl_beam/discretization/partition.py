# SPDX-License-Identifier: MIT
"""Partition of a scene into subdomains: cells and degrees of freedom of each process."""

from __future__ import annotations

import math
from functools import cached_property
from typing import Any

from mpi4py import MPI

import numpy as np
import numpy.typing as npt

from ufl_beam.arrays import Array, Index
from ufl_beam.model.bodies import AttachmentPoint, Body, BodyPoint


def bisect(points: Array, number: int) -> Index:
    """Divide points into ``number`` subdomains of equal size; return the subdomain of each point.

    Recursive coordinate bisection cuts the longer side of the bounding box, so that a subdomain has
    few neighbours.
    """
    subdomains = np.zeros(len(points), dtype=np.int32)
    to_divide = [(np.arange(len(points)), 0, number)]
    while to_divide:
        these, first, number = to_divide.pop()
        subdomains[these] = first
        if number > 1 and len(these):
            longer = np.ptp(points[these], axis=0).argmax()
            half, sorted_ = number // 2, np.argsort(points[these, longer], kind="stable")
            before, after = np.split(these[sorted_], [len(these) * half // number])
            to_divide += [(before, first, half), (after, first + half, number - half)]
    return subdomains


class Subdomain:
    """Subdomain of a scene that one process computes: its cells, and their degrees of freedom.

    Degrees of freedom that this process owns have the first local numbers.  Ghosts, which other
    processes own, follow.  Both groups are in the order of the numbering.  Global numbers, used by
    PETSc, are contiguous on each process.

    Attributes:
        numbering: The :class:`DofNumbering`.
        alone: True if there is only one process, which needs no MPI calls.
        cells: Numbers of the cells of this process, ascending.
        dofs: Number in the :class:`DofNumbering` of each local degree of freedom.
        size: Number of local degrees of freedom, including ghosts.
        num_owned: Number of degrees of freedom that this process owns.
        ghosts: Global numbers of the ghosts.
        cell_dofs: Local degrees of freedom of each cell: u of all its nodes, then all v, then all
            ψ; shape (len(cells), 3 (degree + 1)).
        connectors: Numbers of the connectors of this process.
        bodies: Indices of the bodies of this process in ``scene.rigid_bodies``.
        body_dofs: Their local degrees of freedom; shape (len(bodies), 3).
        connector_dofs: Local degrees of freedom of ``connectors``: u of both nodes, then v, then ψ,
            then the force; shape (len(connectors), 7).
        effect_dofs: Local degrees of freedom of the effects at places on this process, by their
            indices in the works of the scene.
        rotations: Local numbers of the rotations on this process, ascending; int32.
        multipliers: Local numbers of the forces of connectors on this process; int32.
    """

    def __init__(self, numbering: Any, comm: MPI.Intracomm) -> None:
        self.numbering = numbering
        self.comm, self.alone = comm, comm.size == 1
        cell_ranks = bisect(numbering.points[numbering.cells].mean(axis=1), comm.size)
        owner = np.full(numbering.size, comm.size, dtype=np.int32)
        for rank in reversed(range(comm.size)):  # the first process that has a dof owns it
            owner[numbering.dofs[numbering.nodes_of_cells[cell_ranks == rank]]] = rank
        self.cells = np.flatnonzero(cell_ranks == comm.rank).astype(np.int32)
        cell_dofs = numbering.dofs[numbering.nodes_of_cells[self.cells]].transpose(0, 2, 1)
        cell_dofs = cell_dofs.reshape(-1, numbering.width * (numbering.mesh.degree + 1))
        hinge_dofs = numbering.dofs[numbering.vertices_at_hinges]
        hinge_cells = numbering.cells_at_hinges
        np.minimum.at(owner, hinge_dofs, cell_ranks[hinge_cells][:, None])
        connector_dofs = numbering.dofs_of_connectors
        connector_ranks = owner[connector_dofs].min(axis=1, initial=comm.size) % comm.size
        np.minimum.at(owner, connector_dofs, connector_ranks[:, None])
        of_effects = dict[int, Index]()
        for i, dofs in numbering.dofs_of_effects.items():
            rank = owner[dofs].min() % comm.size
            np.minimum.at(owner, dofs, rank)
            if rank == comm.rank:
                of_effects[i] = dofs
        # A process has all degrees of freedom of a body, also if joints share some of them.
        body_dofs = numbering.dofs_of_bodies
        body_ranks = owner[body_dofs].min(axis=1, initial=comm.size) % comm.size
        np.minimum.at(owner, body_dofs, body_ranks[:, None])
        owner[owner == comm.size] = 0  # of nothing, see state_transfer.py
        self.bodies = np.flatnonzero(body_ranks == comm.rank)
        self.connectors = np.flatnonzero(connector_ranks == comm.rank)
        order = np.argsort(owner, kind="stable")
        number = np.empty(numbering.size, dtype=np.int32)  # global numbers
        number[order] = np.arange(numbering.size, dtype=np.int32)

        own = owner == comm.rank
        ghost = np.zeros(numbering.size, dtype=bool)
        ghost[cell_dofs] = True
        ghost[hinge_dofs[cell_ranks[hinge_cells] == comm.rank]] = True
        own_bodies = body_dofs[self.bodies]
        for dofs in (connector_dofs[self.connectors], own_bodies, *of_effects.values()):
            ghost[dofs] = True
        ghost &= ~own
        self.dofs = np.concatenate([np.flatnonzero(x).astype(np.int32) for x in (own, ghost)])
        self.size, self.num_owned = len(self.dofs), int(own.sum())
        self.ghosts: Index = number[self.dofs[self.num_owned :]]
        self._local: Index = np.full(numbering.size, -1, dtype=np.int32)
        self._local[self.dofs] = np.arange(len(self.dofs))
        self.cell_dofs = self._local[cell_dofs]
        self.connector_dofs = self._local[connector_dofs[self.connectors]]
        self.effect_dofs = {i: self._local[dofs] for i, dofs in of_effects.items()}
        self.body_dofs = self._local[own_bodies]
        self._all_owned: Index = order
        if self.alone:  # local numbers and numbers of the scene are equal
            self._local = self._all_owned = self.dofs
        self.rotations = np.sort(self.local(numbering.rotations)).astype(np.int32)
        self.multipliers = self.local(numbering.multipliers).astype(np.int32)
        self._gathered: Array = np.empty(0 if self.alone else numbering.size)  # for gather()
        self._num_owned_by = np.bincount(owner, minlength=comm.size).tolist()

    @cached_property
    def scratch(self) -> Array:
        """Scratch space of C for each degree of freedom, with no meaning between calls."""
        return np.empty(self.size)

    def computes(self, point: AttachmentPoint) -> bool:
        """Return whether this process has the cell at a place, or the body of a point.

        This process then has all degrees of freedom of the place, but may not own all of them.
        """
        if isinstance(point, BodyPoint):
            return self.numbering.scene.rigid_bodies.index(point.body) in self.bodies
        place = np.searchsorted(self.cells, cell := self.numbering.cell(point))
        return bool(np.any(self.cells[place : place + 1] == cell))

    def moving_bodies(self) -> tuple[Index, list[Body], Index]:
        """Return indices of the bodies of this process besides the ground, bodies, and dofs."""
        moving = self.numbering.scene.bodies
        mine = self.bodies[self.bodies < len(moving)]
        return mine, [moving[i] for i in mine], self.body_dofs[: len(mine)]

    @property
    def plane_rotations(self) -> Index:
        """Rotations in the plane; none in space, where unknowns are Cayley vectors."""
        return self.rotations[: 0 if self.numbering.scene.in_space else None]

    def translations(self) -> Index:
        """Return the local numbers of the displacements of all nodes and bodies, (2 or 3, n)."""
        numbering, d = self.numbering, self.numbering.displacements
        rows = np.unique(np.r_[numbering.dofs[:, :d], numbering.dofs_of_bodies[:, :d]], axis=0)
        indices = self._local[rows]
        return np.asarray(indices[(indices >= 0).all(axis=1)].T)

    def lengths(self) -> Array:
        """Return the change of each local degree of freedom by a strain of 1; m, rad; 0 for forces.

        Displacements change by the length of a cell, or at bodies by the size of the scene.
        """
        lengths = np.full(self.size, self.numbering.scene.size)
        moving = self.numbering.displacements * (self.numbering.mesh.degree + 1)
        displacements = self.cell_dofs[:, :moving]
        lengths[displacements] = self.numbering.lengths(self.cells)[:, None]
        lengths[self.rotations] = 1.0
        lengths[self.multipliers] = 0.0
        return lengths

    def weights(self) -> Array:
        """Return factors that make forces and moments comparable, see ``StepEquation``."""
        weights = np.ones(self.size)
        weights[self.rotations] = 1 / self.numbering.scene.size
        weights[self.multipliers] = 0.0
        weights[self.num_owned :] = 0.0
        return weights

    def local(self, dofs: Index) -> Index:
        """Return the local numbers of the ``dofs`` of the scene that this process has."""
        indices = self._local[dofs]
        return np.asarray(indices[indices >= 0])

    def owns(self, dofs: Index) -> npt.NDArray[np.bool_]:
        """Return whether this process owns each of the ``dofs`` of the scene."""
        indices = self._local[dofs]
        return np.asarray((indices >= 0) & (indices < self.num_owned))

    def gather(self, values: Array, out: Array | None = None) -> Array:
        """Gather values of all degrees of freedom, in the order of the numbering, on every process.

        A single process returns ``values`` themselves, not a copy, because states of later steps
        are new arrays.
        """
        if self.alone:
            return values
        result = np.empty(self.numbering.size) if out is None else out
        gathered = self._gathered
        owned = np.ascontiguousarray(values[: self.num_owned])
        self.comm.Allgatherv(owned, [gathered, self._num_owned_by])
        result[self._all_owned] = gathered
        return result

    def added(self, values: Array) -> Array:
        """Return the sums over the processes of values at the local degrees of freedom."""
        if self.alone:
            return values
        sums = np.zeros(self.numbering.size)
        sums[self.dofs] = values
        self.comm.Allreduce(MPI.IN_PLACE, sums)
        return np.asarray(sums[self.dofs])

    def total(self, value: float) -> float:
        """Return the sum of ``value`` over the processes."""
        return value if self.alone else float(self.comm.allreduce(value))

    def largest(self, value: float) -> float:
        """Return the largest value over the processes; infinite if any value is NaN.

        MPI does not define the maximum with NaN, and different results on different processes
        would lead to different decisions.
        """
        if self.alone:
            return value
        return float(self.comm.allreduce(math.inf if math.isnan(value) else value, op=MPI.MAX))
