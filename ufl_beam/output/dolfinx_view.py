# SPDX-License-Identifier: MIT
"""State of a simulation as functions and forms of DOLFINx, for users' forms and for files."""

from __future__ import annotations

from functools import cached_property
from typing import Any, NamedTuple

import numpy as np
import ufl
from ufl.core.expr import Expr

from ufl_beam.arrays import Array, Index
from ufl_beam.blocks.beams import section_law
from ufl_beam.discretization.function_spaces import (
    STIFFNESS,
    DolfinxFields,
    beam_forms,
    dofs_of_cells,
    integrated,
)
from ufl_beam.dolfinx_compat import fem
from ufl_beam.dolfinx_compat import mesh as meshes
from ufl_beam.errors import ArgumentError
from ufl_beam.mechanics.time_scheme import has_inertia
from ufl_beam.output.internal_variables import in_cells


class BeamForms(NamedTuple):
    """Forms of the resultants and the inertia of the beams, without joints, loads and supports.

    Attributes:
        q0, q1: Configurations at the beginning and at the end of a step.
        work: Linear form: virtual work of the resultants in the step from q0 to q1, P(12).
        tangent: Bilinear form: derivative of ``work`` with respect to q1.
        mass: Bilinear form: mass of the beams, without point masses and bodies, P(67).
    """

    q0: fem.Function
    q1: fem.Function
    work: ufl.Form
    tangent: ufl.Form
    mass: ufl.Form


def put_in_cells(function: fem.Function, values: Array) -> fem.Function:
    """Set a function to values at the degrees of freedom of each cell, (num_cells, ...)."""
    dofs = dofs_of_cells(function.function_space)
    function.x.array[dofs] = values.reshape(dofs.shape)
    return function


class DolfinxView:
    """Mesh, functions and forms of a simulation as objects of DOLFINx: ``simulation.dolfinx``.

    A function is created at its first access.  Each access returns the same object, updated to the
    accepted state.  Functions are copies, so a change of their values does not affect the run.  If
    several processes share a scene, each process has a mesh of its own cells, and all processes
    must access a property together.  The communicator of the mesh has one process, so sums over
    ``view.mesh.comm`` are incomplete; :meth:`total` integrates over the whole scene.

    Each beam has its own vertices, also at joints.  So a function on the mesh may jump at a joint.
    :attr:`dofs` maps degrees of freedom of :attr:`function_space` to entries of ``simulation.q``.

    In space, functions have six components: the displacement and the rotation vector, or strains
    and forces along the axes 1, 2, 3 of the sections, then about them.  There are no :attr:`forms`.

    Example:
        >>> from dolfinx import fem
        >>> simulation = ub.Simulation(scene, ub.EnergyMomentum())
        >>> simulation.step_to(0.5)
        >>> view = simulation.dolfinx
        >>> C, e = view.stiffness, view.strains  # (EA, GA, EI), (Σ, Γ, K)
        >>> energy = sum(C[i] * e[i] ** 2 / 2 for i in range(3)) * view.dx
        >>> stored = view.total(energy)
        >>> bool(np.isclose(stored, simulation.entries()[0]["stored"], rtol=1e-12))
        True
    """

    def __init__(self, view: Any) -> None:  # a `StateView`, which this module must not import
        self._view = view
        self._fields = DolfinxFields(view.subdomain)
        self._functions: dict[str, fem.Function] = {}

    def __repr__(self) -> str:
        return f"<DolfinxView of {self._view!r}>"

    # -- mesh and spaces -------------------------------------------------------------------------

    @property
    def mesh(self) -> meshes.Mesh:
        """Undeformed plane mesh of the cells of this process; m."""
        return self._fields.mesh

    @cached_property
    def cells(self) -> Index:
        """Index of each mesh cell in the scene and in arrays of section forces; (num_cells,).

        Example:
            >>> simulation.section_forces()[view.cells].shape
            (4, 3)
        """
        return np.asarray(self._view.subdomain.cells[self._fields.order])

    @cached_property
    def cell_tags(self) -> meshes.MeshTags:
        """Index in ``scene.beams`` of the beam of each cell.

        Example:
            >>> import ufl
            >>> dx = ufl.Measure("dx", domain=view.mesh, subdomain_data=view.cell_tags)
            >>> print(round(view.total(fem.Constant(view.mesh, 1.0) * dx(0)), 9))
            2.0
        """
        beams = self._view.subdomain.numbering.beam_of_cell[self.cells]
        tags = np.arange(len(beams), dtype=np.int32)
        return meshes.meshtags(self.mesh, 1, tags, beams.astype(np.int32))

    @property
    def function_space(self) -> fem.FunctionSpace:
        """Space of (u_x, u_y, ψ): continuous Lagrange elements of the degree of the cells."""
        return self._fields.element.space

    @cached_property
    def dofs(self) -> Index:
        """Index in ``simulation.q`` of each degree of freedom of :attr:`function_space`; (size,).

        Example:
            >>> import ufl
            >>> w = ufl.TestFunction(view.function_space)
            >>> weight = fem.assemble_vector(fem.form(w[1] * view.dx))  # of a load of 1 N/m
            >>> r = np.zeros(len(simulation.q))
            >>> np.add.at(r, view.dofs, weight.array)
            >>> print(round(r.sum(), 9))
            2.0
            >>> bool((view.configuration.x.array == simulation.q[view.dofs]).all())
            True
        """
        local = dofs_of_cells(self.function_space)
        scene_dofs = np.empty(local.max(initial=-1) + 1, dtype=np.int32)
        scene_dofs[local] = self._fields.cell_dofs
        return scene_dofs

    @property
    def dx(self) -> ufl.Measure:
        """Measure of the cells with the quadrature of the resultants: one point at degree 1."""
        return self._fields.element.dx(1)

    def total(self, integral: ufl.Form | Expr) -> float:
        """Integrate over the beams of the scene; all processes call the method together.

        Args:
            integral: Form over cells without test or trial functions, or a scalar expression.  UFL
                estimates the quadrature degree for an expression.

        Raises:
            ArgumentError: ``integral`` has another type or mesh, or integrates over facets.

        Example:
            >>> length = view.total(1.0 * view.dx)
            >>> _, u_y, _ = ufl.split(view.configuration)
            >>> print(round(length, 9), bool(view.total(u_y) < 0))
            2.0 True
        """
        return float(self._view.subdomain.total(integrated(integral, self.mesh)))

    # -- functions -------------------------------------------------------------------------------

    @property
    def stiffness(self) -> fem.Function:
        """Elastic stiffnesses (EA, GA, EI) of the sections, constant in each cell; N, N, N m².

        Example:
            >>> bool(view.stiffness.x.array[2] == section.EI)
            True
        """
        names = STIFFNESS[self.mesh.geometry.dim]
        return self._function("stiffness", self._fields.section_values(*names))

    @property
    def configuration(self) -> fem.Function:
        """Configuration (u_x, u_y, ψ) of the accepted state; m, m, rad.

        Example:
            >>> ψ = view.configuration.sub(2).collapse()
            >>> bool(np.isclose(ψ.x.array.min(), simulation.displacement(beam.end)[2]))
            True
        """
        values = self._view.q[self._fields.cell_dofs]
        if self._view.scene.in_space:
            nodes = self._view.subdomain.numbering.cells[self.cells]
            motions = self._view.now.motion_of_nodes(0)[nodes]
            values = motions.transpose(0, 2, 1).reshape(values.shape)
        return self._function("configuration", values)

    @property
    def velocity(self) -> fem.Function:
        """Velocity (du_x/dt, du_y/dt, dψ/dt) of the accepted state; m/s, m/s, rad/s.

        Raises:
            ArgumentError: The scheme is static.
        """
        if not has_inertia(self._view.scheme):
            raise ArgumentError("dolfinx.velocity: a static scheme has no velocities; run dynamics")
        return self._function("velocity", self._view.velocities()[0][self._fields.cell_dofs])

    @property
    def strains(self) -> fem.Function:
        """Strains (Σ, Γ, K) of the configuration as means over the cells; 1, 1, 1/m.

        K includes the :attr:`jump` of a hinge, divided by the length of its cell.
        """
        return self._function("strains", self._view.now.mean_strains(0)[self.cells])

    @property
    def forces(self) -> fem.Function:
        """Section forces (N, V, M) in the middle of the cells in the last step; N, N, N m.

        Example:
            >>> M = view.forces.x.array.reshape(-1, 3)[:, 2]
            >>> bool(np.allclose(M, simulation.section_forces()[view.cells, 2]))
            True
        """
        return self._function("forces", self._view.section_forces()[self.cells])

    @property
    def jump(self) -> fem.Function:
        """Jump α of the rotation in the hinge of each cell, constant in the cell; rad.

        A plastic hinge of zero length belongs to the cell before it, at the start of a beam to the
        first cell.  If a cell has several jumps, the value is the jump of the largest magnitude.

        Raises:
            ArgumentError: No beam of the scene has a hinge.

        Example:
            >>> opening = ub.Simulation(hinged, ub.Static())
            >>> opening.step_to(1.0)
            >>> print(opening.dolfinx.jump.x.array.round(3)[:3])
            [-0.024  0.     0.   ]
        """
        scene = self._view.scene
        if not scene.hinges and all(beam.section.hinge is None for beam in scene.beams):
            raise ArgumentError(
                "dolfinx.jump: no beam of the scene has a hinge; give a beam "
                "hinges={0.5: Softening(...)}, or a section hinge=Softening(...)"
            )
        return self._function("jump", self._view.damage()[0][self.cells])

    @property
    def variables(self) -> dict[str, fem.Function]:
        """Internal variables of the laws by name, constant in each cell; empty without such laws.

        A cell with several points has the value of largest magnitude.
        """
        values = in_cells(self._view.subdomain.numbering, self._view.internal())
        return {name: self._function(f"state.{name}", x[self.cells]) for name, x in values.items()}

    def _function(self, name: str, values: Array) -> fem.Function:
        """Return the function with this name after setting its ``values`` in each cell."""
        if name not in self._functions:
            element = self._fields.element
            space = element.stiffness.function_space
            if name in ("configuration", "velocity"):
                space = element.space
            elif values.ndim == 1:
                space = fem.functionspace(self.mesh, ("DG", 0))
            self._functions[name] = fem.Function(space, name=name)
        return put_in_cells(self._functions[name], values)

    # -- forms -----------------------------------------------------------------------------------

    @property
    def forms(self) -> BeamForms:
        """Forms of the beams in the time scheme; q0 and q1 are both the accepted configuration.

        Cells that may yield or break have the resultants of the accepted state, and the consistent
        tangent of a step as long as the last step.

        Example:
            >>> forms = view.forms
            >>> r = fem.assemble_vector(fem.form(forms.work)).array  # internal forces
            >>> K = fem.assemble_matrix(fem.form(forms.tangent)).to_scipy()
            >>> M = fem.assemble_matrix(fem.form(forms.mass)).to_scipy()
            >>> v = view.velocity.x.array
            >>> bool(np.isclose(v @ M @ v / 2, simulation.entries()[0]["kinetic"], rtol=1e-12))
            True
        """
        self._view.scene.require_plane("dolfinx.forms")
        forms = self._forms
        for function in (forms.q0, forms.q1):
            put_in_cells(function, self._view.q[self._fields.cell_dofs])
        numbering = self._view.subdomain.numbering
        imposed = np.zeros((len(numbering.cells), numbering.mesh.degree, 6))
        for beams in self._view.beams:
            cells, strains = beams.imposed_strains()
            imposed[cells] = np.tile(strains, 2)
        tables = imposed, *section_law(self._view.inelastic, numbering)
        for function, table in zip(self._at_points, tables, strict=True):
            put_in_cells(function, table[self.cells])
        return forms

    @cached_property
    def _forms(self) -> BeamForms:
        """Forms, which are built once.

        The elastic stiffness is zero in cells with material points; b and D are zero in all others.
        """
        element = self._fields.element
        work, tangent, mass, self._at_points = beam_forms(element, self._view.scheme)
        if self._view.inelastic:
            cells = np.concatenate([beams.sections()[0] for beams in self._view.inelastic])
            dofs = dofs_of_cells(element.stiffness.function_space)
            element.stiffness.x.array[dofs[np.isin(self.cells, cells)]] = 0.0
        return BeamForms(element.q0, element.q1, work, tangent, mass)
