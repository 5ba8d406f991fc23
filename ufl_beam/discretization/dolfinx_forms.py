# SPDX-License-Identifier: MIT
"""Cell forms that DOLFINx assembles, for the reference path."""

from __future__ import annotations

from functools import cached_property
from typing import Any

import numpy as np
import ufl
from ufl.core.expr import Expr

from ufl_beam.arrays import Array, Index
from ufl_beam.compiled.c_library import doubles, ffi
from ufl_beam.compiled.csr import Csr
from ufl_beam.compiled.jit import compiled_form
from ufl_beam.discretization.function_spaces import Element, Fields, derivative
from ufl_beam.discretization.partition import Share
from ufl_beam.dolfinx_compat import cell_coordinates, fem, line_mesh
from ufl_beam.dolfinx_compat import mesh as meshes
from ufl_beam.errors import SceneError, shorten


def dofs_of_cells(space: fem.FunctionSpace) -> Index:
    """Degrees of freedom of the cells of a space; (num_cells, dofs of a cell)."""
    blocks, size = space.dofmap.list, space.dofmap.bs
    return np.asarray(blocks[:, :, None] * size + np.arange(size)).reshape(len(blocks), -1)


def integrated(integral: ufl.Form | Expr, mesh: meshes.Mesh) -> float:
    """Integrate a form without arguments, or a scalar expression, over the cells of a mesh.

    Raises:
        SceneError: It is neither, or it is of another mesh.
    """
    if isinstance(integral, Expr) and not integral.ufl_shape:
        integral = integral * ufl.dx(domain=mesh)
    if not isinstance(integral, ufl.Form) or integral.arguments():
        raise SceneError(
            f"dolfinx.total: {shorten(integral)} must be a form of UFL without test functions, "
            "such as expression * view.dx, or a scalar expression"
        )
    if any(one.integral_type() != "cell" for one in integral.integrals()):
        raise SceneError(
            "dolfinx.total: the form has integrals over facets, and the mesh of each process has "
            "facets of its own where it ends; integrate over cells, with dx"
        )
    if any(domain != mesh.ufl_domain() for domain in integral.ufl_domains()):
        raise SceneError("dolfinx.total: the form is of another mesh; state it on view.mesh")
    # One by one, as each compiled form has one quadrature rule.
    forms = (compiled_form(ufl.Form([one]))[0] for one in integral.integrals())
    return float(sum(fem.assemble_scalar(form) for form in forms))


class DolfinxForm:
    """A form assembled by DOLFINx on the mesh that it is stated on; what :class:`Kernel` does.

    Beams that joints connect share unknowns of the scene, but no vertices of the mesh: values go
    between both through the degrees of freedom of the cells.

    Args:
        form: Cell integrals with one quadrature rule.
        unknown: The configuration that most calls change; it need not appear in the form.
        cell_dofs: Its degrees of freedom in the scene; shape (num_cells, k).
        order: Row of ``cell_dofs``, and of all values given and returned, of each cell of the mesh.
    """

    cells = ffi.NULL

    def __init__(
        self, form: ufl.Form, unknown: fem.Function, cell_dofs: Index, order: Index
    ) -> None:
        self._form, _ = compiled_form(form)
        self._coefficients, self._unknown, self._order = form.coefficients(), unknown, order
        self._spaces = [argument.ufl_function_space() for argument in form.arguments()]
        space = unknown.function_space
        self._at = np.empty(len(unknown.x.array), dtype=np.int32)
        self._at[dofs_of_cells(space)] = cell_dofs[order]
        self._each: Any = None
        self._rows: Index = self._at
        if len(self._spaces) == 1 and self._spaces[0] != space:
            dofs = dofs_of_cells(self._spaces[0])
            self._rows = np.empty(dofs.size, dtype=np.int32)
            self._rows[dofs] = np.arange(dofs.size).reshape(dofs.shape)[order]

    def uses(self, function: fem.Function) -> bool:
        """Return whether a function appears in the form."""
        return function in self._coefficients

    def set(self, function: fem.Function, q: Array) -> None:
        """Give ``function`` the degrees of freedom ``q`` of the scene, if it is in the form."""
        if self.uses(function):
            function.x.array[:] = q[self._at]

    def put(self, function: fem.Function, values: Array) -> None:
        """Give ``function`` other values in the cells; shape (num_cells, dofs per cell)."""
        dofs = dofs_of_cells(function.function_space)
        function.x.array[dofs] = np.broadcast_to(values, dofs.shape)[self._order]

    def share(self, other: object) -> bool:
        """DOLFINx packs the values of each form anew."""
        return False

    def place(self, A: Csr) -> None:
        """Let a bilinear form on the degrees of freedom of the cells add to ``A``."""
        self._A = A

    @cached_property
    def _entries(self) -> Index:
        """Where in the entries of the scene's matrix those of DOLFINx belong."""
        matrix = fem.assemble_matrix(self._form)
        rows = np.repeat(np.arange(len(self._at)), np.diff(matrix.indptr))
        return self._A.positions(self._at[rows], self._at[matrix.indices])

    def add(self, q: Array, b: Array) -> None:
        """Add the form at the unknown ``q`` to a vector, or to the entries of the matrix."""
        self.set(self._unknown, q)
        if len(self._spaces) == 1:
            vector = fem.assemble_vector(self._form).array
            np.add.at(b.reshape(-1), self._rows, vector)
            if self._each is not None and self._each[0]:
                entries = vector[dofs_of_cells(self._spaces[0])]
                ffi.memmove(self._each[0], doubles(entries), entries.nbytes)
        else:
            np.add.at(b, self._entries, fem.assemble_matrix(self._form).data)

    def keep_entries(self) -> tuple[Any, int, Array]:
        """See :meth:`CellForm.keep_entries`; no two cells of the mesh share a vertex."""
        each, other = np.zeros((2, *dofs_of_cells(self._spaces[0]).shape))
        self._kept, self._each = each, ffi.new("double *[1]", [doubles(each)])
        return self._each, 1, other

    def value(self, q: Array) -> float:
        """Return the value of the functional at the unknown ``q``."""
        self.set(self._unknown, q)
        return float(fem.assemble_scalar(self._form))


class DolfinxFields(Fields):
    """Cells whose forms are stated on their own mesh, and assembled by DOLFINx.

    Attributes:
        mesh: Mesh of the cells, which DOLFINx puts in an order of its own.
    """

    def __init__(self, share: Share, part: Index | None = None) -> None:
        grid, cells = share.grid, share.cells if part is None else share.cells[part]
        vertices, numbers = self._vertices(grid.cells[cells])
        self.mesh = line_mesh(grid.points[vertices], numbers.reshape(-1, 2))
        order: Index = np.asarray(self.mesh.topology.original_cell_index)
        # The order of the vertices of a cell orients the beam.
        expected = grid.points[grid.cells[cells[order]]]
        if not np.array_equal(cell_coordinates(self.mesh)[:, :, :2], expected):
            raise RuntimeError("this version of DOLFINx turns cells around; please report it")
        super().__init__(share, order if part is None else part[order])

    def _vertices(self, cells: Index) -> tuple[Index, Index]:
        """Vertices of the mesh, and the numbers in them of those of the cells."""
        vertices, numbers = np.unique(cells, return_inverse=True)
        return vertices, numbers

    def _element(self) -> Element:
        element = Element(self.share.grid.mesh, self.mesh)
        self.element = element
        for function in (element.stiffness, element.inertia):
            dofs = dofs_of_cells(function.function_space)
            function.x.array[dofs] = self.of_sections(function)
        return element

    def kernel(self, form: ufl.Form, unknown: fem.Function) -> DolfinxForm:
        """A form on the cells, assembled by DOLFINx."""
        return DolfinxForm(form, unknown, self.cell_dofs, np.arange(len(self.cell_dofs)))

    def hot_kernel(self, form: ufl.Form, unknown: fem.Function) -> DolfinxForm:
        """The same: nothing is faster."""
        return self.kernel(form, unknown)

    def force_and_tangent(
        self, work: ufl.Form, q1: fem.Function, A: Csr
    ) -> tuple[DolfinxForm, DolfinxForm]:
        """A virtual work, and its derivative by ``q1`` that adds to ``A``."""
        force, tangent = self.kernel(work, q1), self.kernel(derivative(work, q1), q1)
        tangent.place(A)
        return force, tangent


class SeparateCells(DolfinxFields):
    """Such cells with vertices of their own, so that vectors have the entries of each cell."""

    def _vertices(self, cells: Index) -> tuple[Index, Index]:
        return cells.ravel(), np.arange(cells.size)
