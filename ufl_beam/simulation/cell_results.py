# SPDX-License-Identifier: MIT
"""Section forces, strains and material of cells at the kept times, and momenta."""

from __future__ import annotations

from collections.abc import Callable
from functools import cached_property
from typing import NamedTuple

from mpi4py import MPI

import numpy as np

from ufl_beam.arrays import Array, Index
from ufl_beam.compiled.csr import Product
from ufl_beam.discretization.dof_numbering import Grid
from ufl_beam.discretization.function_spaces import (
    CompiledFields,
    Fields,
    SectionForces,
    Strains,
    mass_matrix,
)
from ufl_beam.discretization.partition import Share
from ufl_beam.errors import SceneError
from ufl_beam.model.bodies import Place
from ufl_beam.simulation.kept_states import KeptStates


class Material(NamedTuple):
    """State of the material of all cells at one time.

    Attributes:
        forces: (N, V, M); (num_cells, 3); N, N, N m.
        jump: Rotation of the hinges; (num_cells,); rad.
        plastic: Energy dissipated by plastic strains; (num_cells,); J.
        hinge: Energy dissipated by hinges, or by the cracks of fibres; (num_cells,); J.
    """

    forces: Array
    jump: Array
    plastic: Array
    hinge: Array


class CellResults:
    """Results that follow from the kept states; those of the n-th kept time, in all cells."""

    def __init__(self, grid: Grid, kept: KeptStates) -> None:
        self._grid, self._kept = grid, kept

    @cached_property
    def _fields(self) -> Fields:
        """The whole scene on this process: what is computed afterwards needs no communication."""
        return CompiledFields(Share(self._grid, MPI.COMM_SELF))

    @cached_property
    def _section_forces(self) -> SectionForces:
        return SectionForces(self._fields)

    @cached_property
    def _strains(self) -> Strains:
        return Strains(self._fields)

    def forces(self, n: int) -> Array:
        """(N, V, M), kept where history decides, else computed from the motion; (num_cells, 3)."""
        forces = np.empty((len(self._grid.cells), 3))
        self._section_forces.write(self._kept[n].q, forces)
        for cells, rows in self._kept[n].material:
            forces[cells] = rows[:, :3]
        return forces

    def strains(self, n: int) -> Array:
        """(Σ, Γ, K); (num_cells, 3); 1, 1, 1/m."""
        strains = np.empty((len(self._grid.cells), 3))
        strains[self._fields.order] = self._strains.mean(self._kept[n].q)
        return strains

    def material(self, n: int, cells: Index | int) -> Material:
        """State of the material of some cells."""
        if not self._kept[n].material and not self._grid.scene.hinges:
            raise SceneError("material: nothing in the scene yields or breaks; it is elastic")
        everything = np.zeros((len(self._grid.cells), 6))
        everything[:, :3] = self.forces(n)
        for inelastic, rows in self._kept[n].material:
            everything[inelastic, 3:] = rows[:, 3:]
        chosen = everything[cells].T
        return Material(chosen[:3].T, *chosen[3:])

    def at(self, place: Place, of: Callable[[int], Array]) -> Array:
        """Results of the cell at a place at all kept times; (n+1, 3)."""
        cell = self._grid.cell(place)
        return np.array([of(n)[cell] for n in range(len(self._kept))])

    def material_at(self, place: Place) -> Material:
        """State of the material in the cell at a place; arrays begin with (n+1,)."""
        cell = self._grid.cell(place)
        kept = [self.material(n, cell) for n in range(len(self._kept))]
        return Material(*map(np.array, zip(*kept, strict=True)))

    def momentum(self) -> Array:
        """(p_x, p_y, L) at all kept times, L about the origin; (n+1, 3); N s, N s, N m s."""
        if not self._kept.v:
            raise SceneError("momentum: the run was static; there is none")
        times, grid = Product(mass_matrix(self._fields)), self._grid
        dofs = np.vstack([grid.dofs, grid.dofs_of_bodies])
        centers = np.array([body.center for body in grid.scene.rigid_bodies]).reshape(-1, 2)
        _, first = np.unique(dofs[:, 0], return_index=True)
        u, v, ψ = dofs[first, 0], dofs[first, 1], np.unique(dofs[:, 2])
        X, Y = np.vstack([grid.points, centers])[first].T

        def of(q: Array, velocity: Array) -> tuple[float, float, float]:
            p = times(velocity)
            turning = (X + q[u]) * p[v] - (Y + q[v]) * p[u]
            return p[u].sum(), p[v].sum(), turning.sum() + p[ψ].sum()

        return np.array([of(q, v) for q, v in zip(self._kept.q, self._kept.v, strict=True)])
