# SPDX-License-Identifier: MIT
"""The cells of a scene as a mesh of DOLFINx, and integrals of a user on it."""

from __future__ import annotations

import numpy as np
import ufl
from ufl.core.expr import Expr

from ufl_beam.arrays import Index
from ufl_beam.compiled.jit import compiled_form
from ufl_beam.discretization.function_spaces import Element, Fields
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


class DolfinxFields(Fields):
    """Cells whose element is stated on their own mesh, for DOLFINx to assemble.

    Attributes:
        mesh: Mesh of the cells, which DOLFINx puts in an order of its own.
    """

    def __init__(self, share: Share, part: Index | None = None) -> None:
        grid, cells = share.grid, share.cells if part is None else share.cells[part]
        vertices, numbers = np.unique(grid.cells[cells], return_inverse=True)
        self.mesh = line_mesh(grid.points[vertices], numbers.reshape(-1, 2))
        order: Index = np.asarray(self.mesh.topology.original_cell_index)
        # The order of the vertices of a cell orients the beam.
        expected = grid.points[grid.cells[cells[order]]]
        if not np.array_equal(cell_coordinates(self.mesh)[:, :, :2], expected):
            raise RuntimeError("this version of DOLFINx turns cells around; please report it")
        super().__init__(share, order if part is None else part[order])
        self.element = element = Element(grid.mesh, self.mesh)
        for function in (element.stiffness, element.inertia):
            dofs = dofs_of_cells(function.function_space)
            function.x.array[dofs] = self.of_sections(function)
