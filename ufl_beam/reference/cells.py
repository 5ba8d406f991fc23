# SPDX-License-Identifier: MIT
"""Meshes of cells for DOLFINx, and what all forces in the equation of a step have in common."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Any, NamedTuple

import numpy as np
import scipy  # its parts are loaded when they are used
import ufl
from scipy.sparse import csr_array

from ufl_beam.arrays import Array, Index
from ufl_beam.discretization.dof_numbering import Grid
from ufl_beam.discretization.function_spaces import Element
from ufl_beam.dolfinx_compat import compile_form, fem, jit_directory, line_mesh
from ufl_beam.dolfinx_compat import mesh as meshes
from ufl_beam.mechanics.kinematics import strain
from ufl_beam.mechanics.time_schemes import Step


@dataclass
class Ledger:
    """Energies in the scene, and those supplied and lost since the beginning, by entry; J."""

    state: dict[str, float] = field(default_factory=lambda: defaultdict(float))
    supplied: dict[str, float] = field(default_factory=lambda: defaultdict(float))
    lost: dict[str, float] = field(default_factory=lambda: defaultdict(float))

    def copy(self) -> tuple[dict[str, float], ...]:
        """Return the three parts as they are now."""
        return dict(self.state), dict(self.supplied), dict(self.lost)


class OnNodes(NamedTuple):
    """Forces of a part of the equation on the nodes of some cells."""

    kind: str  # "stress"; "work" of a user; "density", which acts along all of the cell
    cells: Index  # numbers of the cells in the scene
    forces: Array  # (num_cells, 3, nodes of a cell); N, N, N m


class Force:
    """Virtual work in the equation of a step; a method that a force does not define does nothing.

    Attributes:
        inner: Whether it acts between parts of the scene: cells and connectors.
        size: Number of degrees of freedom of the scene.
    """

    inner = False
    size: int

    def begin(self, step: Step) -> None:
        """Take note of the step that is to be solved."""

    def residual(self, q1: Array) -> Array:
        """Virtual work if the step ends at ``q1``; (size,)."""
        return np.zeros(self.size)

    def tangent(self, q1: Array) -> csr_array:
        """Derivative of the residual; (size, size)."""
        return csr_array((self.size, self.size))

    def accept(self, q1: Array, s: Array) -> None:
        """Take the end of the step as the new state, and enter works and losses.

        ``s`` is the step of the nodes that forces work on.
        """

    def enter_state(self, q: Array) -> None:
        """Enter the energy that is held in the accepted state."""

    def change(self, q1: Array) -> float:
        """Energy that is stored and dissipated in the step to ``q1``, of inner forces; J."""
        return 0.0

    def require_dissipation(self, q1: Array) -> None:
        """Raise :class:`StepFailed` if a law gives energy in the step."""

    def on_nodes(self) -> Sequence[OnNodes]:
        """Forces on the nodes of cells in the step that was just accepted."""
        return ()

    def equilibrium(self, t: float, q: Array, v: Array | None) -> Array:
        """Loads at the time ``t``; the state is taken as one that is in equilibrium with them."""
        return np.zeros(self.size)

    def internal(self) -> dict[str, Array]:
        """Internal variables, by the names of :attr:`Solution.internal`."""
        return {}

    def take(self, internal: dict[str, Array], q: Array, *, goes_on: bool) -> None:
        """Take over internal variables; ``goes_on`` says that scene and time are the same."""


class Form:
    """Form on the cells of a mesh, assembled by DOLFINx for the degrees of freedom of a scene.

    Args:
        form: It has one quadrature rule: FFCx 0.9 to 0.11 is silently wrong otherwise.
        at: Number in the scene of each degree of freedom of the mesh.
        size: Number of degrees of freedom of the scene.
    """

    def __init__(self, form: ufl.Form, at: Index, size: int) -> None:
        self.compiled, self._at, self._size = compile_form(form, jit_directory()), at, size
        ones, rows = np.ones(len(at)), np.arange(len(at))
        self._joins = csr_array((ones, (rows, at)), shape=(len(at), size))
        self._matrix: Any = None if self.compiled.rank < 2 else fem.create_matrix(self.compiled)

    def entries(self) -> Array:
        """Vector of a linear form, by the degrees of freedom of its own space."""
        return np.array(fem.assemble_vector(self.compiled).array)

    def vector(self) -> Array:
        """Vector of a linear form; cells that share a node add up."""
        vector: Array = np.zeros(self._size)
        np.add.at(vector, self._at, self.entries())
        return vector

    def matrix(self) -> csr_array:
        """Matrix of a bilinear form."""
        self._matrix.set_value(0.0)
        K = csr_array(fem.assemble_matrix(self._matrix, self.compiled).to_scipy())
        return csr_array(self._joins.T @ K @ self._joins)

    def value(self) -> float:
        """Value of a form without arguments."""
        return float(fem.assemble_scalar(self.compiled))


def dofs_of_cells(space: fem.FunctionSpace) -> Index:
    """Degrees of freedom of the cells of a space; (num_cells, dofs of a cell)."""
    blocks, size = space.dofmap.list, space.dofmap.bs
    return np.asarray(blocks[:, :, None] * size + np.arange(size)).reshape(len(blocks), -1)


def separate_cells(points: Array) -> tuple[meshes.Mesh, Index]:
    """Mesh of cells without common vertices, (num_cells, 2, 2) in m; which cell became which."""
    n = len(points)
    mesh = line_mesh(points.reshape(-1, 2), np.arange(2 * n).reshape(n, 2))
    return mesh, np.asarray(mesh.topology.original_cell_index)


def lumps(grid: Grid) -> list[tuple[Index, float, float]]:
    """Degrees of freedom, mass and inertia of point masses and rigid bodies; (3,), kg, kg m²."""
    masses = [(grid.node(one.place), one.mass, one.inertia) for one in grid.scene.masses]
    return masses + [(grid.node(one.middle), one.mass, one.inertia) for one in grid.scene.bodies]


class Cells:
    """Cells of beams, each with nodes of its own; joints and neighbours share numbers of the scene.

    Attributes:
        numbers: Of the cells in the scene, in the order of the mesh.
        element: Functions that forms are written in.
        at: Number in the scene of each degree of freedom of the mesh.
    """

    def __init__(self, grid: Grid, numbers: Index) -> None:
        mesh, order = separate_cells(grid.points[grid.cells[numbers]])
        self.numbers = numbers[order]
        self.size, self._grid = grid.size, grid
        self.element = of = Element(grid.mesh, mesh)
        self.dofs = dofs_of_cells(of.space)
        of_scene = grid.dofs[grid.nodes_of_cells[self.numbers]]  # (num_cells, nodes, 3)
        self.at: Index = np.empty(self.dofs.size, dtype=np.int64)
        self.at[self.dofs] = of_scene.transpose(0, 2, 1).reshape(self.dofs.shape)
        sections = [grid.scene.beams[i].section for i in grid.beam_of_cell[self.numbers]]
        self.put(of.stiffness, np.array([(s.EA, s.GA, s.EI) for s in sections]))
        self.put(of.inertia, np.array([(s.rhoA, s.rhoI) for s in sections]))

    @property
    def lengths(self) -> Array:
        """Lengths of the cells; m."""
        return self._grid.lengths(self.numbers)

    def form(self, form: ufl.Form) -> Form:
        """Compile a form on the cells."""
        return Form(form, self.at, self.size)

    def set(self, function: fem.Function, q: Array) -> None:
        """Give a function the configuration, or other vector, of the scene."""
        function.x.array[:] = q[self.at]

    def put(self, function: fem.Function, values: Array) -> None:
        """Give a function values in the cells, or in their quadrature points."""
        dofs = dofs_of_cells(function.function_space)
        function.x.array[dofs] = values.reshape(dofs.shape)

    def on_nodes(self, kind: str, form: Form) -> OnNodes:
        """Forces of a linear form on the nodes of the cells."""
        forces = form.entries()[self.dofs].reshape(len(self.numbers), 3, -1)
        return OnNodes(kind, self.numbers, forces)


class Strains:
    """Strains (Σ, Γ, K) in the quadrature points of cells."""

    def __init__(self, cells: Cells) -> None:
        of = cells.element
        self._cells, space = cells, of.at_points(3).function_space
        z = ufl.TestFunction(space)
        weighted = ufl.dot(strain(of.q1, of.axis), z) / of.axis.h * of.dx(1)
        self._form, self._dofs = (
            Form(weighted, np.zeros(0, dtype=np.int64), 0),
            dofs_of_cells(space),
        )
        self._weights = np.repeat(cells._grid.mesh.point_weights, 3)

    def __call__(self, q: Array) -> Array:
        """Strains at ``q``; (num_cells, points, 3); 1, 1, 1/m."""
        self._cells.set(self._cells.element.q1, q)
        strains = self._form.entries()[self._dofs] / self._weights
        return np.asarray(strains.reshape(len(strains), -1, 3))


def coupled(size: int, rows: Index, columns: Index, values: Array) -> csr_array:
    """Matrix of the scene from entries; those at one place add up."""
    entries = scipy.sparse.coo_array(
        (np.ravel(values), (np.ravel(rows), np.ravel(columns))), (size, size)
    )
    return csr_array(entries)
