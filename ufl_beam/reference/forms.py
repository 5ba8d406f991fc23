# SPDX-License-Identifier: MIT
"""The functional of beams with hinges and its derivatives, as functions and forms of DOLFINx."""

from __future__ import annotations

from collections.abc import Callable, Sequence

import basix.ufl
import numpy as np
import ufl
from ufl.core.expr import Expr

from ufl_beam.arrays import Array
from ufl_beam.dolfinx_compat import compile_expression, compile_form, fem
from ufl_beam.mechanics import functional
from ufl_beam.mechanics.functional import enhanced_strain, virtual_work
from ufl_beam.mechanics.kinematics import Axis, strain, virtual_strain
from ufl_beam.mechanics.time_scheme import Scheme
from ufl_beam.reference.frame import Frame


class Fields:
    """Functions of a time step, and its forms; laws hold at t_n+θ.

    Attributes:
        cells: Number in the scene of each cell of this process.
        q0: Configuration (u_x, u_y, ψ) at the beginning of the step; P1.
        q1: Configuration at its end.
        v: Velocity, or another vector of rates.
        jump0: Jumps α of the rotation in the middle of cells at the beginning; DG0; rad.
        jump1: Jumps at the end.
        plastic: Plastic strains at t_n+θ; quadrature element.  They are **e** - C⁻¹ **r** of the
            return map, so that **r** is the derivative of W for every law.
        D: Derivatives of (N, V, M) at t_n+θ by the strains at the end; quadrature element.
        stiffness: Stiffness C = (EA, GA, EI) of cells; DG0.
        elastic: The same, but zero in cells with material points.
        inertia: Inertia (A_ρ, J_ρ) of cells; DG0.
        h: Lengths of cells.
        force: Virtual work of the resultants, P(34), a linear form.
        tangent: Its derivative by q1, P(64) to P(66), P(76).
        mass: Inertia of the beams, P(67).
        at_rest: Stiffness of the undeformed beams.
        elastic_energy: Energy of the elastic cells at the end of the step, P(49).
        lost: Numerical loss of elastic cells in the step, divided by ``2 alpha`` of the scheme.
        on_cells: ``force``, and products of ``mass`` and ``at_rest`` with ``v``, as forces of the
            nodes on each cell.
        strains: Function that returns (Σ, Γ, K) of q1; (cells, 3).
        resultants: Function that returns (N, V, M) at t_n+θ; (cells, 3).
    """

    def __init__(self, frame: Frame, scheme: Scheme) -> None:
        self.mesh, self.cells, V, numbering = frame.mesh, frame.cells, frame.V, frame.numbering
        self.q0, self.q1, self.v = (fem.Function(V) for _ in range(3))
        self.jump0, self.jump1 = self.cellwise(()), self.cellwise(())
        self.stiffness, self.elastic = self.cellwise((3,)), self.cellwise((3,))
        self.inertia, self.plastic = self.cellwise((2,)), self.at_points((3,))
        self.D, self.h = self.at_points((3, 3)), numbering.lengths(frame.cells)
        beams = numbering.beam_of_cell[frame.cells]
        sections = [numbering.scene.beams[beam].section for beam in beams]
        C = np.array([(s.EA, s.GA, s.EI) for s in sections])
        self.stiffness.x.array[:] = C.ravel()
        self.inertia.x.array[:] = np.ravel([(s.rhoA, s.rhoI) for s in sections])
        self.D.x.array.reshape(-1, 9)[:, ::4] = scheme.theta * C
        inelastic = np.isin(frame.cells, numbering.inelastic_cells)
        self.elastic.x.array[:] = np.where(inelastic[:, None], 0.0, C).ravel()
        self._state_equilibrium(scheme)

    def _state_equilibrium(self, scheme: Scheme) -> None:
        """Derive all forms from the functional, with strains and variations of the scheme.

        In statics ``force`` is the derivative of the potential of all cells by q1.  Other schemes
        replace the strains in it by those at t_n+θ, and the variation by their own.
        """
        V, axis, dx, θ = self.q0.function_space, Axis(self.mesh), self.dx(1), scheme.theta

        def W(e: Expr) -> Expr:
            return functional.elastic_energy(e - self.plastic, self.stiffness)  # equation (35)

        def W_elastic(e: Expr) -> Expr:
            return functional.elastic_energy(e, self.elastic)

        e0 = enhanced_strain(self.q0, self.jump0, axis)  # equation (30)
        e1 = enhanced_strain(self.q1, self.jump1, axis)
        e = ufl.variable((1 - θ) * e0 + θ * e1)  # equations (83), (89)
        r = ufl.diff(W(e), e)  # equation (29)

        def variation(w: Expr) -> Expr:
            return scheme.virtual_strain(self.q0, self.q1, w, axis)  # equation (21)

        def force(w: Expr) -> ufl.Form:
            return virtual_work(r, variation(w)) * dx

        def mass(w: Expr, a: Expr) -> ufl.Form:
            kinetic = functional.kinetic_energy(self.v, self.inertia) * self.dx(2)  # equation (18)
            return ufl.derivative(ufl.derivative(kinetic, self.v, w), self.v, a)

        def at_rest(w: Expr, v: Expr) -> ufl.Form:
            D_v, D_w = (virtual_strain(fem.Function(V), x, axis) for x in (v, w))
            return virtual_work(functional.resultants(D_v, self.stiffness), D_w) * dx

        # By the return map plastic strains and jumps are functions of q1; so D replaces θ C.
        w, dq = ufl.TestFunction(V), ufl.TrialFunction(V)
        dr = ufl.dot(self.D, ufl.derivative(strain(self.q1, axis), self.q1, dq))
        geometric = virtual_work(r, ufl.derivative(variation(w), self.q1, dq))
        self.force = compile_form(force(w))
        self.tangent = compile_form((virtual_work(dr, variation(w)) + geometric) * dx)
        self.mass, self.at_rest = compile_form(mass(w, dq)), compile_form(at_rest(w, dq))
        end = functional.potential(W_elastic, self.q1, self.jump1, ufl.as_ufl(0.0), axis)
        self.elastic_energy, self.lost = (
            compile_form(end * dx),
            compile_form(W_elastic(e1 - e0) * dx),
        )
        # Test functions that are not continuous give the forces on each cell.
        self.apart = fem.functionspace(self.mesh, ("DG", 1, (3,)))
        w = ufl.TestFunction(self.apart)
        self.on_cells = [*map(compile_form, (force(w), mass(w, self.v), at_rest(w, self.v)))]
        self.strains, self.resultants = map(self._evaluation, (strain(self.q1, axis), r))

    def dx(self, degree: int) -> ufl.Measure:
        """Return the measure with Gauss points for a degree; with degree 1, one in each cell."""
        return ufl.Measure("dx", self.mesh, metadata={"quadrature_degree": degree})

    def cellwise(self, shape: Sequence[int]) -> fem.Function:
        """Create a function that is constant in each cell."""
        return fem.Function(fem.functionspace(self.mesh, ("DG", 0, tuple(shape))))

    def at_points(self, shape: Sequence[int], degree: int = 1) -> fem.Function:
        """Create a function at the points of ``dx(degree)``."""
        element = basix.ufl.quadrature_element("interval", value_shape=tuple(shape), degree=degree)
        return fem.Function(fem.functionspace(self.mesh, element))

    def load(self, density: fem.Function) -> tuple[fem.Form, fem.Form]:
        """Return the work of forces along beams, as a form on V and as forces on each cell."""
        spaces = self.q0.function_space, self.apart
        forms = (ufl.dot(density, ufl.TestFunction(space)) * self.dx(9) for space in spaces)
        one, other = map(compile_form, forms)
        return one, other

    def forces_on_cells(self, form: fem.Form) -> Array:
        """Return the forces of both nodes on each cell; (cells, 2, 3)."""
        assembled = fem.assemble_vector(form).array.reshape(-1, 3)
        return np.asarray(assembled[self.apart.dofmap.list])

    def _evaluation(self, value: Expr) -> Callable[[], Array]:
        expression, cells = compile_expression(value, np.array([[0.5]])), np.arange(len(self.h))
        return lambda: expression.eval(self.mesh, cells.astype(np.int32)).reshape(-1, 3)
