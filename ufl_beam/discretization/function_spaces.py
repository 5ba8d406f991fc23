# SPDX-License-Identifier: MIT
"""The finite element spaces of a share of the grid, and the functions that forms are written in."""

from __future__ import annotations

from functools import cached_property

import basix.ufl
import numpy as np
import ufl

from ufl_beam.arrays import Array, Index
from ufl_beam.compiled.csr import Csr, coupling
from ufl_beam.compiled.simd_kernels import LANES, in_batches
from ufl_beam.discretization.compiled_forms import Kernel, vectorise
from ufl_beam.discretization.dof_numbering import Share
from ufl_beam.dolfinx_compat import cell_coordinates, fem, line_mesh, space_with_dofs
from ufl_beam.mechanics.kinematics import Axis


class Fields:
    """Mesh and function spaces of the cells of one process, or of some of them.

    Args:
        share: The cells and degrees of freedom of this process.
        part: Positions in ``share.cells`` of the cells that are meant; all by default.

    Attributes:
        share: The cells and degrees of freedom of this process.
        axis: Undeformed axis, in UFL.
        space: Configurations (u_x, u_y, ψ), with the degrees of freedom that joints share.
        cell_dofs: Local degrees of freedom in the order of the cells of the mesh;
            (num_cells, 3 (degree + 1)).
        order: Position in ``share.cells`` of each cell of the mesh.
    """

    def __init__(self, share: Share, part: Index | None = None) -> None:
        self.share = share
        grid = share.grid
        if part is None:
            part = np.arange(len(share.cells))
        vertices, cells = np.unique(grid.cells[share.cells[part]], return_inverse=True)
        self.mesh = line_mesh(grid.points[vertices], cells.reshape(-1, 2))
        self.order: Index = part[np.asarray(self.mesh.topology.original_cell_index)]
        self._coordinates = cell_coordinates(self.mesh)
        self._require_direction(grid.points[grid.cells[share.cells[self.order]]])
        self.cell_dofs = share.cell_dofs[self.order]
        self._matrix: Csr | None = None
        self._degree = grid.mesh.degree
        X = self._along() if self._degree > 1 else 0.5
        self.axis = Axis(self.mesh, grid.mesh.nodes, X)
        line = basix.ufl.element("Lagrange", "interval", self._degree)
        self.space = space_with_dofs(
            self.mesh, basix.ufl.mixed_element([line, line, line]), self.cell_dofs, share.size
        )

    def kernel(self, form: ufl.Form, unknown: fem.Function) -> Kernel:
        """A form on the cells, compiled; ``unknown`` is the configuration that changes."""
        return Kernel(form, unknown, self.cell_dofs, self._coordinates)

    def hot_kernel(self, form: ufl.Form, unknown: fem.Function) -> Kernel:
        """The same for what steps ask again and again: several cells at once."""
        kernel = self.kernel(form, unknown)
        vectorise([kernel], self._coordinates_in_lanes)
        return kernel

    def force_and_tangent(self, work: ufl.Form, q1: fem.Function, A: Csr) -> tuple[Kernel, Kernel]:
        """A virtual work, and its derivative by ``q1`` that adds to ``A``."""
        derivative = ufl.derivative(work, q1, ufl.TrialFunction(self.space))
        force, tangent = self.kernel(work, q1), self.kernel(derivative, q1)
        vectorise([force, tangent], self._coordinates_in_lanes)
        tangent.share(force)
        tangent.place(A)
        return force, tangent

    @cached_property
    def _coordinates_in_lanes(self) -> Array:
        return in_batches(self._coordinates, LANES)

    def matrix(self) -> Csr:
        """A new matrix on the degrees of freedom of this process."""
        if self._matrix is None:
            share = self.share
            couples = (share.cell_dofs, share.link_dofs, share.body_dofs)
            self._matrix = Csr(coupling(share.size, *couples))
            return self._matrix
        return self._matrix.zeros_like()

    def _require_direction(self, ends: Array) -> None:
        """The mesh must keep the order of the vertices of a cell, which orients the beam."""
        if not np.array_equal(self._coordinates[:, :, :2], ends):
            raise RuntimeError("this version of DOLFINx turns cells around; please report it")

    def dx(self, degree: int) -> ufl.Measure:
        """Integration over the cells; one degree per form, see compiled_forms.py.

        Args:
            degree: Of the rule on cells of degree 1; each degree that they have more adds two.
        """
        rule = {"quadrature_degree": self._rule(degree)}
        return ufl.Measure("dx", domain=self.mesh, metadata=rule)

    def dx_of_mass(self) -> ufl.Measure:
        """Integration of inertia: exact, or with the nodes as points, which lumps it."""
        if not self.share.grid.mesh.lumped:
            return self.dx(2)
        rule = {"quadrature_rule": "GLL", "quadrature_degree": self._rule(1)}
        return ufl.Measure("dx", domain=self.mesh, metadata=rule)

    def _rule(self, degree: int) -> int:
        return degree + 2 * (self._degree - 1)

    def _along(self) -> fem.Function:
        """From 0 to 1 along each cell."""
        function = fem.Function(fem.functionspace(self.mesh, ("DG", 1)))
        function.x.array[:] = np.tile([0.0, 1.0], len(self.order))
        return function

    def configuration(self) -> fem.Function:
        """A new configuration (u_x, u_y, ψ)."""
        return fem.Function(self.space)

    def stiffness(self) -> fem.Function:
        """(EA, GA, EI) of the cells; N, N, N m²."""
        return self._of_sections("EA", "GA", "EI")

    def inertia(self) -> fem.Function:
        """(rhoA, rhoI) of the cells; kg/m, kg m."""
        return self._of_sections("rhoA", "rhoI")

    def _of_sections(self, *names: str) -> fem.Function:
        grid = self.share.grid
        of_beam = np.array([[getattr(b.section, n) for n in names] for b in grid.scene.beams])
        element = basix.ufl.element("DG", "interval", 0, shape=(len(names),))
        function = fem.Function(fem.functionspace(self.mesh, element))
        cells = self.share.cells[self.order]
        function.x.array[:] = of_beam[grid.beam_of_cell[cells]].ravel()
        return function

    def at_points(self, *shape: int) -> fem.Function:
        """A new function with values of a shape in the points of ``dx(1)``."""
        rule = self._rule(1)
        element = basix.ufl.quadrature_element("interval", value_shape=shape, degree=rule)
        return fem.Function(fem.functionspace(self.mesh, element))

    def constant(self, value: float) -> fem.Constant:
        """A number that forms are not compiled for anew."""
        return fem.Constant(self.mesh, value)
