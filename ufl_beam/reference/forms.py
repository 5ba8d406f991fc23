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
from ufl_beam.model.loads import Gravity, LineLoad, Load
from ufl_beam.reference.frame import Frame


class Fields:
    """Functions of a time step, and its forms; laws hold at t_n+θ.

    Cells have one Gauss point: with more, shear would lock, and the variations of the time schemes
    would not be exact.  The value in cell c of a function with one point in each cell is number c.
    """

    def __init__(self, frame: Frame, scheme: Scheme) -> None:
        self.mesh, self.cells = frame.mesh, frame.cells
        self.numbering = numbering = frame.numbering
        # Configuration (u_x, u_y, ψ) at both ends of the step, and its rate; P1
        self.q0, self.q1, self.v = (fem.Function(frame.V) for _ in range(3))
        # Jump of the rotation in the middle of each cell, at both ends; DG0; rad
        self.jump0, self.jump1 = self.cellwise(()), self.cellwise(())
        # Plastic strains e - C⁻¹ r of the return map, so that r is the derivative of W for every
        # law, and derivatives of r = (N, V, M) by the strains at the end; quadrature elements
        self.plastic, self.moduli = self.at_points((3,)), self.at_points((3, 3))
        self.stiffness = self.cellwise((3,))  # C = (EA, GA, EI); DG0
        self.inertia = self.cellwise((2,))  # (A_ρ, J_ρ)
        self.h = numbering.lengths(frame.cells)
        sections = [numbering.scene.beams[i].section for i in numbering.beam_of_cell[frame.cells]]
        C = np.array([(s.EA, s.GA, s.EI) for s in sections])
        self.stiffness.x.array[:] = C.ravel()
        self.inertia.x.array[:] = np.ravel([(s.rhoA, s.rhoI) for s in sections])
        self.moduli.x.array.reshape(-1, 9)[:, ::4] = scheme.theta * C
        self._make_forms(scheme)

    def _make_forms(self, scheme: Scheme) -> None:
        """Derive all forms from the functional, with strains and variations of the scheme.

        ``force`` is the virtual work of r = ∂W/∂e, P(34).  For :class:`Static` it is the derivative
        of the potential by q1; other schemes take strains at t_n+θ, and variations of their own.
        """
        V, axis, dx, θ = self.q0.function_space, Axis(self.mesh), self.dx(1), scheme.theta
        dx_of_mass = self.dx(1, "GLL") if self.numbering.mesh.lumped else self.dx(2)

        def W(e: Expr) -> Expr:
            return functional.elastic_energy(e - self.plastic, self.stiffness)  # equation (35)

        e0 = enhanced_strain(self.q0, self.jump0, axis)
        e1 = enhanced_strain(self.q1, self.jump1, axis)
        e = ufl.variable((1 - θ) * e0 + θ * e1)  # equations (83), (89)
        r = ufl.diff(W(e), e)  # equation (29)

        def variation(w: Expr) -> Expr:
            return scheme.virtual_strain(self.q0, self.q1, w, axis)  # equation (21)

        def force(w: Expr) -> ufl.Form:
            return virtual_work(r, variation(w)) * dx

        def mass(w: Expr, a: Expr) -> ufl.Form:
            kinetic = functional.kinetic_energy(self.v, self.inertia) * dx_of_mass  # equation (18)
            return ufl.derivative(ufl.derivative(kinetic, self.v, w), self.v, a)  # equation (67)

        def stiffness_at_rest(w: Expr, v: Expr) -> ufl.Form:
            rest = fem.Function(V)
            e_w, e_v = virtual_strain(rest, w, axis), virtual_strain(rest, v, axis)
            return virtual_work(functional.resultants(e_v, self.stiffness), e_w) * dx

        # By the return map plastic strains and jumps are functions of q1, so moduli replace θ C.
        w, dq = ufl.TestFunction(V), ufl.TrialFunction(V)
        dr = ufl.dot(self.moduli, ufl.derivative(strain(self.q1, axis), self.q1, dq))
        geometric = virtual_work(r, ufl.derivative(variation(w), self.q1, dq))
        self.force = compile_form(force(w))
        self.tangent = compile_form((virtual_work(dr, variation(w)) + geometric) * dx)
        self.mass = compile_form(mass(w, dq))
        self.stiffness_at_rest = compile_form(stiffness_at_rest(w, dq))
        self.strains, self.resultants = map(self._evaluation, (strain(self.q1, axis), r))

    def dx(self, degree: int, rule: str = "default") -> ufl.Measure:
        """Return the measure with Gauss points for a degree, or with "GLL" with points at nodes.

        With degree 1, there is one Gauss point in each cell.
        """
        chosen = {"quadrature_degree": degree, "quadrature_rule": rule}
        return ufl.Measure("dx", self.mesh, metadata=chosen)

    def cellwise(self, shape: Sequence[int]) -> fem.Function:
        """Create a function that is constant in each cell."""
        return fem.Function(fem.functionspace(self.mesh, ("DG", 0, tuple(shape))))

    def at_points(self, shape: Sequence[int], degree: int = 1) -> fem.Function:
        """Create a function at the points of ``dx(degree)``."""
        element = basix.ufl.quadrature_element("interval", value_shape=tuple(shape), degree=degree)
        return fem.Function(fem.functionspace(self.mesh, element))

    def work_of(self, load: Load) -> fem.Form:
        """Return the virtual work of a load along beams for a factor of one."""
        density = self.at_points((3,), degree=9)
        values, numbering = density.x.array.reshape(len(self.cells), -1, 3), self.numbering
        if isinstance(load, LineLoad):
            s, i = numbering.parameters(load.beam), self.cells - numbering.cells_of(load.beam)[0]
            i = i[on := (i >= 0) & (i < len(s) - 1)]
            points = basix.make_quadrature(basix.CellType.interval, 9)[0].ravel()
            factors = load.factors((s[i, None] + np.diff(s)[i, None] * points).ravel())
            values[on] = factors.reshape(len(i), points.size, 1) * (*load.force, load.moment)
        elif isinstance(load, Gravity):
            values[:, :, :2] = self.inertia.x.array[::2, None, None] * load.acceleration
        w = ufl.TestFunction(self.q1.function_space)
        return compile_form(ufl.dot(density, w) * self.dx(9))

    def _evaluation(self, value: Expr) -> Callable[[], Array]:
        """Return a function that evaluates an expression in the middle of cells; (cells, 3)."""
        expression = compile_expression(value, np.array([[0.5]]))
        cells = np.arange(len(self.h), dtype=np.int32)
        return lambda: expression.eval(self.mesh, cells).reshape(-1, 3)
