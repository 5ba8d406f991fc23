# SPDX-License-Identifier: MIT
"""Elastic beams and inertia."""

from __future__ import annotations

from collections.abc import Sequence
from functools import partial
from typing import NamedTuple

import numpy as np
import ufl

from ufl_beam.arrays import Array
from ufl_beam.compiled.c_library import ffi, lib, loop, struct
from ufl_beam.compiled.csr import Csr, StepProduct
from ufl_beam.discretization.compiled_forms import stated
from ufl_beam.discretization.function_spaces import Element, Fields, mass_kernel, mass_matrix
from ufl_beam.discretization.state_io import Memory
from ufl_beam.dolfinx_compat import fem
from ufl_beam.mechanics.functional import elastic_energy, virtual_work
from ufl_beam.mechanics.kinematics import strain
from ufl_beam.mechanics.time_schemes import DynamicScheme, Scheme, has_inertia, with_half_tangents
from ufl_beam.terms.base import InCells, Term
from ufl_beam.terms.cells import Cells, OfForms, PredictedStrains
from ufl_beam.terms.energy_ledger import Ledger
from ufl_beam.terms.phases import Callbacks, Phases, entering
from ufl_beam.terms.rates_in_c import RatesInC

BEFORE = "velocity before"
"""Name of the velocities at the beginning of the last step, in what is saved."""


class ElasticForms(NamedTuple):
    """Forms of elastic beams: virtual work, stored energy, and what a scheme loses of it."""

    work: ufl.Form
    stored: ufl.Form
    losses: list[ufl.Form]


@stated
def elastic_forms(of: Element, scheme: Scheme) -> ElasticForms:
    """Forms of a step of a time scheme."""
    q0, q1, w, C, dx = of.q0, of.q1, of.w, of.stiffness, of.dx(1)
    e0, e1 = strain(q0, of.axis), strain(q1, of.axis)
    r = scheme.resultants(C, e0, e1, of.constant)
    w_e = scheme.virtual_strain(q0, q1, w, of.axis)
    stored = elastic_energy(e1, C) * dx
    lost = 2 * of.constant(scheme.alpha) * elastic_energy(e1 - e0, C) * dx  # P(90)
    return ElasticForms(virtual_work(r, w_e) * dx, stored, [lost] if scheme.alpha else [])


@stated
def _static_tangent(of: Element, scheme: Scheme) -> tuple[ufl.Form, fem.Function]:
    """Tangent of elastic cells with given strains in its forces; these strains."""
    q0, q1, C = of.q0, of.q1, of.stiffness
    e0, e1, e = strain(q0, of.axis), strain(q1, of.axis), of.at_points(3)
    w_e = scheme.virtual_strain(q0, q1, of.w, of.axis)
    acting = partial(scheme.resultants, C, e0, constant=of.constant)
    change = ufl.TrialFunction(of.space)
    geometric = virtual_work(acting(e), ufl.derivative(w_e, q1, change))
    material = virtual_work(ufl.derivative(acting(e1), q1, change), w_e)
    return (geometric + material) * of.dx(1), e


class ElasticBeams(OfForms, Cells):
    """Resultants of elastic cells working on the virtual strains, P(12).

    In statics the tangent has the forces of the :class:`PredictedStrains`.
    """

    kind, _entry = "beams", "numerical"

    def __init__(self, fields: Fields, scheme: Scheme, A: Csr, ledger: Ledger) -> None:
        forms, q1, tangent = elastic_forms(fields.element, scheme), fields.element.q1, None
        if not has_inertia(scheme):
            form, e = _static_tangent(fields.element, scheme)
            tangent, self.predicted = fields.hot_kernel(form, q1), PredictedStrains(fields)
            tangent.place(A)
            self._static = struct(
                "static_tangent", predicted=self.predicted.c, tangent=tangent.cells,
                at_e=tangent.position(e),
            )  # fmt: skip
        super().__init__(forms.work, forms.losses, fields, A, ledger, tangent)
        self._work_form, self._stored = forms.work, fields.hot_kernel(forms.stored, q1)
        self._stored.share(self._force)
        if tangent is not None:
            self._of_step.append(tangent)
            self._loops = self._loops[0], loop("add_static_tangent", self._static)

    def in_cells(self) -> Sequence[InCells]:
        """The forces of the resultants, which both configurations of a step determine."""
        return [InCells(lambda: self._force, lib.STRESS, self._fields.order, q0=self._q0)]

    def phases(self, callbacks: Callbacks) -> Phases:
        """Loops over the cells."""
        begin, accept, *_ = super().phases(callbacks)
        if self.predicted is not None:
            begin = [*begin, loop("begin_static_tangent", self._static)]
        state = entering(self._stored, self._ledger.state.pointer("stored"))
        return Phases(begin, accept, [state], loop("change_of_form", state[1]))


class Inertia(Term):
    """Inertia of beams and point masses: a constant matrix, P(18).

    Attributes:
        rates: Velocities, and what else the scheme keeps.
    """

    kind = "inertia"

    def __init__(
        self, fields: Fields, scheme: DynamicScheme, A: Csr, ledger: Ledger, rates: RatesInC
    ) -> None:
        rotations = with_half_tangents(scheme, fields.share.rotations())
        self._times = StepProduct(mass_matrix(fields), rotations, A, fields.share.scratch)
        self._loops = self._times.loops
        self._fields, self._ledger, self._A, self.scheme = fields, ledger, A, scheme
        self.rates = rates
        if rates.slips:
            ledger.lost["numerical"] += 0.0

    def in_cells(self) -> Sequence[InCells]:
        """The mass of the beams times the accelerations of the step."""
        form = partial(mass_kernel, self._fields)
        return [InCells(form, lib.DENSITY, self._fields.order, self._times.rate)]

    @property
    def M(self) -> Csr:
        """The mass matrix; a new one."""
        return self._times.matrix()

    @property
    def v(self) -> Array:
        """Velocities in the accepted state; a copy."""
        return self.rates.v

    def phases(self, callbacks: Callbacks) -> Phases:
        """Loops over the matrix and the velocities."""
        lost = self._ledger.lost.pointer("numerical") if self.rates.slips else ffi.NULL
        kinetic = self._ledger.state.pointer("kinetic")
        of = self.rates.times(self._times, kept=kinetic, lost=lost)
        begin, accept = loop("begin_inertia", of), loop("accept_inertia", of)
        return Phases([begin], [accept], [loop("add_kinetic_energy", of)])

    def carry_on(self, memory: Memory, known: int) -> None:
        """State what the scheme keeps besides the velocities, as much as is ``known`` of it."""
        rates = self.rates
        more = rates.more or (rates.v,) * known
        rates.keep(*map(memory.at_dofs, self.scheme.kept[:known], more))

    def pass_on_step(self, memory: Memory) -> None:
        """State the velocities before the last step, and its length, at each degree of freedom."""
        rates = self.rates
        v_before = memory.at_dofs(BEFORE, rates.v_before)
        lengths = memory.at_dofs("last step", np.full(rates.c.size, rates.last_dt))
        rates.take(rates.v, v_before, float(lengths[0]) if len(lengths) else rates.last_dt)

    def velocities(self, s: Array, dt: float) -> Array:
        """Velocities at the end of a step ``s`` of the nodes, of the length ``dt`` (s)."""
        return self.rates.after(s, dt)[0]

    def prepare(self, s: Array, dt: float) -> None:
        """Take from a trial step ``s`` what the scheme keeps besides the velocities."""
        _, *more = self.rates.after(s, dt)
        self.rates.keep(*more)

    def remember(self, memory: Memory, q: Array) -> None:
        """Save or restore velocities and the last step."""
        rates = self.rates
        v = memory.at_dofs("velocity", rates.v)
        v_before = memory.at_dofs(BEFORE, rates.v_before)
        rates.take(v, v_before, memory.number("step of velocity", rates.last_dt))
        self.carry_on(memory, int(memory.number("further rates", len(rates.more))))
