# SPDX-License-Identifier: MIT
"""Forms on cells, assembled by DOLFINx, and the base class of all forces in a step.

Each cell has nodes of its own.  Connected cells share degrees of freedom of the scene:
q = C q_scene with a Boolean matrix C.  Residuals of the scene are Cᵀ r, tangents Cᵀ K C.
"""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Mapping
from dataclasses import dataclass, field
from functools import cached_property
from typing import Any, TypeVar

import numpy as np
import ufl
from scipy.sparse import csr_array
from ufl.algorithms import expand_derivatives

from ufl_beam.arrays import Array, Index
from ufl_beam.discretization.dof_numbering import DofNumbering
from ufl_beam.discretization.function_spaces import Element
from ufl_beam.dolfinx_compat import compile_form, fem, jit_directory, line_mesh
from ufl_beam.dolfinx_compat import mesh as meshes
from ufl_beam.mechanics.kinematics import strain
from ufl_beam.mechanics.time_scheme import Scheme, Step
from ufl_beam.model.connectors import Connector

T = TypeVar("T", bound=Array | None)

Response = tuple[Array, Array]
"""Forces, and their derivatives with respect to the configuration."""

Entry = tuple[ufl.Form, str]
"""Form of an energy, and its entry in the ledger."""


@dataclass
class Ledger:
    """Energies in the scene, and energies supplied and lost since the beginning, by entry; J."""

    state: dict[str, float] = field(default_factory=dict)
    supplied: dict[str, float] = field(default_factory=lambda: defaultdict(float))
    lost: dict[str, float] = field(default_factory=lambda: defaultdict(float))


@dataclass
class Search:
    """Flags of the search for an equilibrium without unnecessary opening and slip.

    Attributes:
        hold: True while points and connectors that did not flow in the last step stay closed.
            Friction by laws of users then sticks or slides as in that step.
        over: True if ``hold`` has prevented a point or connector from opening or slipping.
    """

    hold: bool = False
    over: bool = False


@dataclass
class Setting:
    """Objects that all forces and connector laws of a scene use."""

    numbering: DofNumbering
    scheme: Scheme
    requested_forces: Mapping[Connector, float]  # forces of controllers; limits of friction
    rates: Mapping[Connector, float]  # rates of motions with friction, at the beginning of a step
    friction_repeats: bool  # True if sticking may be a redundant constraint
    ledger: Ledger = field(default_factory=Ledger)
    search: Search = field(default_factory=Search)

    def loses(self, *names: str) -> None:
        """Create entries of the ledger for losses."""
        for name in names:
            self.ledger.lost[name] += 0.0


@dataclass
class Archive:
    """Internal variables, by the names of :attr:`Solution.internal`.

    Each force has a method ``save_or_restore`` that both saves and restores its variables.

    Attributes:
        restored: Variables to restore; other variables do not change.
        saved: Saved variables, as lists of arrays.
    """

    restored: Mapping[str, Array]
    saved: dict[str, list[Array]] = field(default_factory=lambda: defaultdict(list))

    def vector(self, name: str, values: T) -> Array | T:
        """Save ``values`` unless they are None; return the restored values, or else ``values``."""
        if values is not None:
            self.saved[name].append(values)
        return self.restored.get(name, values)

    def rows(self, name: str, indices: Index, rows: Array) -> Array:
        """Save rows with the numbers of their cells or connectors; return the restored rows."""
        name, result = f"{name}, {rows.shape[1]}", rows.copy()
        self.saved[name].append(np.column_stack([indices, rows]))
        if name in self.restored:
            table = self.restored[name]
            _, targets, sources = np.intersect1d(indices, table[:, 0], return_indices=True)
            result[targets] = table[sources, 1:]
        return result


class Force:
    """Base of forces in the equation of a step; by default methods do nothing or return zero.

    Attributes:
        size: Number of degrees of freedom of the scene.
        stored: Energies stored in the accepted state, by entry of the ledger; J.
        on_nodes: Forces of the nodes on the cells in the accepted step, see :func:`end_forces`.
    """

    size: int
    stored: Mapping[str, float] = {}
    on_nodes: Array | float = 0.0

    def response(self, step: Step, q1: Array) -> Response:
        """Return nodal forces in a step to ``q1``, and their derivative; (size,), (size, size)."""
        return np.zeros(self.size), np.zeros((self.size, self.size))

    def change(self, step: Step, q1: Array) -> float:
        """Return the energy that inner forces store and dissipate in the step to ``q1``; J.

        Raises:
            StepFailed: A law that must dissipate generates energy.
        """
        return 0.0

    def accept(self, step: Step, q1: Array, s: Array) -> None:
        """Accept the end of the step, and enter works and losses in the ledger.

        ``q1`` is the configuration of the latest response, and ``s`` the nodal step on which the
        forces do work.
        """

    def start(self, q: Array) -> None:
        """Compute data of the accepted state at the configuration ``q``."""

    def save_or_restore(self, archive: Archive) -> None:
        """Save or restore internal variables."""


# -- DOLFINx -------------------------------------------------------------------------------------


class Form:
    """Form on the cells of a mesh, assembled by DOLFINx for the degrees of freedom of a scene.

    Args:
        form: Form with one quadrature rule; FFCx 0.9 to 0.11 compiles forms with several rules
            wrongly, without an error.
        at: Index in the scene of each degree of freedom of the mesh.
        size: Number of degrees of freedom of the scene.
    """

    def __init__(self, form: ufl.Form, at: Index, size: int) -> None:
        self._form = compile_form(form, jit_directory())
        self._joins = csr_array((np.ones(len(at)), (np.arange(len(at)), at)), (len(at), size))
        self._matrix: Any = None if self._form.rank < 2 else fem.create_matrix(self._form)

    def assembled(self) -> Any:
        """Return the value of a form without arguments, or the assembled form.

        A form with one argument becomes a vector on the space of the argument.  A form with two
        arguments becomes a matrix of the scene.
        """
        if self._form.rank == 0:
            return float(fem.assemble_scalar(self._form))
        if self._form.rank == 1:
            return np.array(fem.assemble_vector(self._form).array)
        self._matrix.set_value(0.0)
        K = fem.assemble_matrix(self._matrix, self._form).to_dense()
        return np.asarray(self._joins.T @ K @ self._joins)

    def joined(self, values: Array) -> Array:
        """Add up ``values`` of :meth:`assembled` at degrees of freedom of the scene; (size,)."""
        return np.asarray(self._joins.T @ values)


def cell_dofs(space: fem.FunctionSpace) -> Index:
    """Return the degrees of freedom of the cells of a space; (num_cells, dofs of a cell)."""
    blocks, size = space.dofmap.list, space.dofmap.bs
    dofs = np.asarray(blocks[:, :, None] * size + np.arange(size))
    return dofs.reshape(len(blocks), blocks.shape[1] * size)


def put(function: fem.Function, values: Array) -> None:
    """Set values of a function in the cells of its mesh, or at their quadrature points."""
    dofs = cell_dofs(function.function_space)
    function.x.array[dofs] = values.reshape(dofs.shape)


def separate_cells(points: Array) -> tuple[meshes.Mesh, Index]:
    """Make a mesh of unconnected cells; return it and the index of each in ``points`` (n, 2, 2)."""
    n = len(points)
    mesh = line_mesh(points.reshape(-1, 2), np.arange(2 * n).reshape(n, 2))
    return mesh, np.asarray(mesh.topology.original_cell_index)


class Cells:
    """Cells of beams, each with its own nodes.

    Attributes:
        cell_indices: Numbers of the cells in the scene, in the order of the mesh.
        lengths: Lengths of the cells; m.
        element: Finite element, and functions in the forms.
        weights: Weights of the Gauss points of a cell, with the sum 1.
        at: Index in the scene of each degree of freedom of the mesh.
    """

    def __init__(self, numbering: DofNumbering, indices: Index) -> None:
        mesh, order = separate_cells(numbering.points[numbering.cells[indices]])
        self.cell_indices, self.size, self._numbering = indices[order], numbering.size, numbering
        self.lengths, self.element = (
            numbering.lengths(self.cell_indices),
            Element(numbering.mesh, mesh),
        )
        element, self.weights = self.element, np.asarray(numbering.mesh.point_weights)
        self._dofs = cell_dofs(element.space)
        scene_dofs = numbering.dofs[
            numbering.nodes_of_cells[self.cell_indices]
        ]  # (num_cells, nodes, 3)
        self.at: Index = np.empty(self._dofs.size, dtype=np.int64)
        self.at[self._dofs] = scene_dofs.transpose(0, 2, 1).reshape(self._dofs.shape)
        sections = [
            numbering.scene.beams[i].section for i in numbering.beam_of_cell[self.cell_indices]
        ]
        put(element.stiffness, np.array([(s.EA, s.GA, s.EI) for s in sections]))
        put(element.inertia, np.array([(s.rhoA, s.rhoI) for s in sections]))

    def form(self, form: ufl.Form) -> Form:
        """Compile a form on the cells."""
        return Form(form, self.at, self.size)

    def set(self, function: fem.Function, q: Array) -> None:
        """Set a function to the configuration, or another vector, of the scene."""
        function.x.array[:] = q[self.at]

    @cached_property
    def _strains(self) -> tuple[Form, Index]:
        """Form of the strains, and the indices of the strains of each cell in its values."""
        element = self.element
        form = self.form(element.sampled(strain(element.q1, element.axis)))
        return form, cell_dofs(element.at_points(3).function_space)

    def strains(self, q: Array) -> Array:
        """Return strains (Σ, Γ, K) at quadrature points; (num_cells, points, 3); 1, 1, 1/m."""
        self.set(self.element.q1, q)
        form, dofs = self._strains
        weighted = form.assembled()[dofs]
        strains = weighted.reshape(len(self.cell_indices), -1, 3) / self.weights.reshape(-1, 1)
        return np.asarray(strains)

    def on_nodes(self, kind: str, values: Array) -> Array:
        """Return :func:`end_forces` of a vector on the space of the element."""
        forces = values[self._dofs].reshape(len(self.cell_indices), 3, self._dofs.shape[1] // 3)
        return end_forces(self._numbering, kind, self.cell_indices, forces)


def end_forces(numbering: DofNumbering, kind: str, cells: Index, forces: Array) -> Array:
    """Return forces of the nodes on all cells, and moments of loads on the cells; (9, num_cells).

    The first six rows are (X, Y, M) at the start and at the end of a cell.  The next row is the
    couple of a load along the cell, zero for "stress".  The last two rows, for "density" only, are
    the first moments of X and Y about the middle of the cell, divided by its length.

    Args:
        numbering: Numbering of the scene.
        kind: "stress" for resultants, "work" for works of a user, "density" for loads and inertia
            along the whole cell.
        cells: Numbers of cells.
        forces: Forces on the nodes; (len(cells), 3, nodes of a cell); N, N, N m.
    """
    table = np.zeros((9, len(numbering.cells)))
    first, *between, last = numbering.mesh.nodes - 0.5
    table[:3, cells], table[3:6, cells] = forces[:, :, 0].T, forces[:, :, 1].T
    if kind != "stress":
        table[6, cells] = forces[:, 2].sum(axis=1)
    if kind == "density":
        table[7:, cells] = (forces[:, :2] @ np.array([first, last, *between])).T
    return table


class CellForce(Force):
    """Virtual work on cells: a form that is linear in ``element.w``, and its derivative by UFL.

    Args:
        cells: Cells on which the work is done.
        work: Form of the virtual work.
        setting: Setting; its ledger has the entries of energies.
        around: Form from which UFL derives the tangent; by default ``work``.
        stored: Form of the energy stored at the end of the step, and its entry.
        lost: Form of the energy lost in the step, and its entry.
        kind: See :func:`end_forces`.
    """

    def __init__(
        self, cells: Cells, work: ufl.Form, setting: Setting, *, around: ufl.Form | None = None,
        stored: Entry | None = None, lost: Entry | None = None, kind: str = "stress",
    ) -> None:  # fmt: skip
        element = cells.element
        self.cells, self.size, self.element, self.ledger = (
            cells,
            cells.size,
            element,
            setting.ledger,
        )
        self.work, self._kind, trial = cells.form(work), kind, ufl.TrialFunction(element.space)
        derivative = expand_derivatives(ufl.derivative(around or work, element.q1, trial))
        self._derivative = None if derivative.empty() else cells.form(derivative)
        self._stored = {stored[1]: cells.form(stored[0])} if stored else {}
        self._lost = {lost[1]: cells.form(lost[0])} if lost else {}
        setting.loses(*self._lost)

    def response(self, step: Step, q1: Array) -> Response:
        """Return nodal forces in a step to ``q1``, and their derivative."""
        self.cells.set(self.element.q0, step.q0)
        self.cells.set(self.element.q1, q1)
        forces = self.work.assembled()
        self.on_nodes = self.cells.on_nodes(self._kind, forces)
        none = np.zeros((self.size, self.size))
        K = none if self._derivative is None else self._derivative.assembled()
        return self.work.joined(forces), K

    def energy(self, q: Array) -> float:
        """Return the energy stored at a configuration; J."""
        self.cells.set(self.element.q1, q)
        return sum(float(form.assembled()) for form in self._stored.values())

    def accept(self, step: Step, q1: Array, s: Array) -> None:
        """Enter the losses in the ledger, and compute the energy at the end."""
        self.cells.set(self.element.q1, q1)
        for name, form in self._lost.items():
            self.ledger.lost[name] += form.assembled()
        self.start(q1)

    def start(self, q: Array) -> None:
        """Compute the energy of a configuration."""
        self.stored = {name: self.energy(q) for name in self._stored}


# -- scenes --------------------------------------------------------------------------------------


def point_masses(numbering: DofNumbering) -> list[tuple[Index, float, float]]:
    """Return (degrees of freedom, mass, inertia) of point masses and bodies; (3,), kg, kg m²."""
    masses = [
        (numbering.node(mass.place), mass.mass, mass.inertia) for mass in numbering.scene.masses
    ]
    bodies = [
        (numbering.node(body.middle), body.mass, body.inertia) for body in numbering.scene.bodies
    ]
    return masses + bodies


def coupled(size: int, rows: Index, columns: Index, values: Array) -> Array:
    """Return the matrix of the scene with given entries; duplicates are added."""
    K = np.zeros((size, size))
    np.add.at(K, (np.ravel(rows), np.ravel(columns)), np.ravel(values))
    return K
