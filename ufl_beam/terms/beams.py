# SPDX-License-Identifier: MIT
"""Elastic beams and inertia."""

from __future__ import annotations

import math
from typing import NamedTuple

import ufl

from ufl_beam.arrays import Array
from ufl_beam.compiled.c_library import Loop, doubles, lib, loop, struct
from ufl_beam.compiled.csr import Csr, StepProduct
from ufl_beam.discretization.compiled_forms import stated
from ufl_beam.discretization.function_spaces import Element, Fields, mass_matrix
from ufl_beam.discretization.state_io import Memory
from ufl_beam.mechanics.kinematics import strain
from ufl_beam.mechanics.time_schemes import DynamicScheme, Scheme, Step, has_inertia, scaled
from ufl_beam.terms.energy_ledger import Ledger
from ufl_beam.terms.forms_and_matrices import OfForms, OfMatrix
from ufl_beam.terms.tangent_derivatives import Cells


class _ElasticForms(NamedTuple):
    """Forms of elastic beams: virtual work, stored energy, and what a scheme loses of it.

    ``first`` is the tangent of the first iteration of a static step.
    """

    work: ufl.Form
    stored: ufl.Form
    losses: list[ufl.Form]
    first: ufl.Form | None


@stated
def _elastic_forms(of: Element, scheme: Scheme) -> _ElasticForms:
    q0, q1, w, C, dx = of.q0, of.q1, of.w, of.stiffness, of.dx(1)
    e0, e1 = strain(q0, of.axis), strain(q1, of.axis)
    r = scheme.resultants(C, e0, e1, of.constant)
    w_e = scheme.virtual_strain(q0, q1, w, of.axis)
    stored = sum(C[i] * e1[i] ** 2 / 2 for i in range(3)) * dx  # P(9)
    lost = of.constant(scheme.alpha) * ufl.dot(scaled(C, e1 - e0), e1 - e0) * dx  # P(90)
    losses, first = [lost] if scheme.alpha else [], None
    if not has_inertia(scheme):
        dq = ufl.TrialFunction(of.space)
        geometric = ufl.dot(scaled(C, e0), ufl.derivative(w_e, q1, dq))
        material = ufl.dot(ufl.derivative(r, q1, dq), w_e)
        first = (geometric + material) * dx
    return _ElasticForms(ufl.dot(r, w_e) * dx, stored, losses, first)  # P(12)


class ElasticBeams(OfForms, Cells):
    """Resultants of elastic cells working on the virtual strains, P(12)."""

    kind, _entry = "beams", "numerical"

    def __init__(self, fields: Fields, scheme: Scheme, A: Csr, ledger: Ledger) -> None:
        forms = _elastic_forms(fields.element, scheme)
        super().__init__(forms.work, forms.losses, fields, A, ledger)
        self._fields, self._work_form = fields, forms.work
        self._stored = fields.hot_kernel(forms.stored, self._q1)
        self._tangents = struct("first_cells", then=self._tangent.cells)
        self._static = forms.first is not None
        if forms.first is not None:
            self._first = fields.kernel(forms.first, self._q1)
            self._first.place(A)
            self._tangents.first = self._first.cells
            self._of_step.append(self._first)

    def begin(self, step: Step) -> None:
        """Remember the configuration at the beginning."""
        for kernel in self._of_step:
            kernel.set(self._q0, step.q0)
        self._tangents.begins = self._static

    def loops(self) -> tuple[Loop, Loop | None]:
        """C loops over the cells, of force and tangent."""
        return loop("add_cells", self._force.cells), loop("add_first_cells", self._tangents)

    def add_tangent(self, q1: Array) -> None:
        """Add the stiffness, material and geometric.

        Extrapolated displacements strain slender beams by nothing but error; forces from that would
        send the first iteration of a static step astray, so it takes those before the step.
        """
        lib.add_first_cells(self._tangents, doubles(q1), doubles(self._A.data))

    def accept(self, q1: Array, s: Array) -> None:
        """Enter the energy that the scheme lost."""
        self._tangents.begins = 0
        if self._losses:
            super().accept(q1, s)

    def add_state(self, q: Array) -> None:
        """Add the stored energy to the ledger."""
        self._held = self._stored.value(q)
        self._ledger.state["stored"] += self._held

    def change(self, q1: Array) -> float:
        """Energy that cells of this process store in the step to ``q1``; J."""
        return self._stored.value(q1) - self._held


class Inertia(OfMatrix):
    """Inertia of beams and point masses: a constant matrix, P(18); satisfies :class:`Rates`."""

    kind = "inertia"

    def __init__(
        self, fields: Fields, scheme: DynamicScheme, A: Csr, ledger: Ledger, v: Array
    ) -> None:
        rotations = scheme.half_tangents(fields.share.rotations())
        self._times = StepProduct(mass_matrix(fields), rotations, A)
        self._ledger = ledger
        if scheme.slips:
            ledger.lost["numerical"] += 0.0
        self.scheme = scheme
        self.v = self.v_before = v
        self.more: tuple[Array, ...] = ()
        self._dt = self.last_dt = math.inf

    @property
    def M(self) -> Csr:
        """The mass matrix; a new one."""
        return self._times.matrix()

    def begin(self, step: Step) -> None:
        """Prepare what stays constant in the step."""
        self._dt = step.dt
        self._times.begin(step.q0, *self.scheme.inertia(step.dt, self))

    def carry_on(self, memory: Memory, known: int) -> None:
        """State what the scheme keeps besides the velocities, as much as is ``known`` of it."""
        more = self.more or (self.v,) * known
        self.more = tuple(map(memory.at_dofs, self.scheme.kept[:known], more))

    def velocities(self, s: Array) -> Array:
        """Velocities at the end of a step ``s`` of the nodes."""
        return self.scheme.rates(self._dt, s, self)[0]

    @property
    def ready(self) -> bool:
        """True if a step can begin: of what the scheme keeps something is known."""
        return not self.scheme.kept or bool(self.more)

    def prepare(self, s: Array) -> None:
        """Take from a trial step ``s`` what the scheme keeps besides the velocities."""
        _, *more = self.scheme.rates(self._dt, s, self)
        self.more = tuple(more)

    def accept(self, q1: Array, s: Array) -> None:
        """New velocities, and what the scheme lost."""
        v, *more = self.scheme.rates(self._dt, s, self)
        if self.scheme.slips:
            change = v - self.v
            momentum = self._times.A(change)
            lost = self.scheme.slip(self._dt, change, self) @ momentum
            self._ledger.lost["numerical"] += float(lost)
        self.v_before, self.v, self.more, self.last_dt = self.v, v, tuple(more), self._dt

    def add_state(self, q: Array) -> None:
        """Add the kinetic energy to the ledger."""
        self._ledger.state["kinetic"] += self._times.A.square(self.v) / 2  # P(18)

    def remember(self, memory: Memory, q: Array) -> None:
        """Save or restore velocities and the last step."""
        self.v = memory.at_dofs("velocity", self.v)
        self.v_before = memory.at_dofs("velocity before", self.v_before)
        self.last_dt = memory.number("step of velocity", self.last_dt)
        self.carry_on(memory, int(memory.number("further rates", len(self.more))))
