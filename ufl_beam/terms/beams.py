# SPDX-License-Identifier: MIT
"""Elastic beams and inertia."""

from __future__ import annotations

import math
from collections.abc import Sequence
from functools import cached_property, partial
from typing import Any, NamedTuple

import numpy as np
import ufl

from ufl_beam.arrays import Array, on_demand
from ufl_beam.compiled.c_library import Loop, ffi, lib, loop
from ufl_beam.compiled.csr import Csr, StepProduct
from ufl_beam.discretization.compiled_forms import stated
from ufl_beam.discretization.function_spaces import Element, Fields, mass_kernel, mass_matrix
from ufl_beam.discretization.state_io import Memory
from ufl_beam.mechanics.functional import elastic_energy, virtual_work
from ufl_beam.mechanics.kinematics import strain
from ufl_beam.mechanics.time_schemes import DynamicScheme, Scheme, Step, has_inertia
from ufl_beam.terms.energy_ledger import Ledger
from ufl_beam.terms.forms_and_matrices import OfForms, OfMatrix
from ufl_beam.terms.in_cells import InCells
from ufl_beam.terms.phases import Callbacks, Phases, entering
from ufl_beam.terms.rates_in_c import RatesInC
from ufl_beam.terms.static_tangents import StaticTangent
from ufl_beam.terms.tangent_derivatives import Cells

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


class ElasticBeams(OfForms, Cells):
    """Resultants of elastic cells working on the virtual strains, P(12)."""

    kind, _entry = "beams", "numerical"

    def __init__(self, fields: Fields, scheme: Scheme, A: Csr, ledger: Ledger) -> None:
        forms = elastic_forms(fields.element, scheme)
        self._static = None if has_inertia(scheme) else StaticTangent(fields, scheme, A)
        tangent = None if self._static is None else self._static.kernel
        self.predicted = None if self._static is None else self._static.predicted
        super().__init__(forms.work, forms.losses, fields, A, ledger, tangent)
        self._fields, self._work_form, self._held = fields, forms.work, 0.0
        self._stored = fields.hot_kernel(forms.stored, self._q1)
        self._stored.share(self._force)
        if tangent is not None:
            self._of_step.append(tangent)

    def begin(self, step: Step) -> None:
        """Remember the configuration at the beginning."""
        super().begin(step)
        if self._static is not None:
            self._static.begin(step)

    def in_cells(self) -> Sequence[InCells]:
        """The forces of the resultants, which both configurations of a step determine."""
        return [InCells(lambda: self._force, lib.STRESS, self._order, q0=self._q0)]

    def loops(self) -> tuple[Loop, Loop | None]:
        """C loops over the cells, of force and tangent."""
        force, tangent = super().loops()
        return force, self._static.loop() if self._static else tangent

    def phases(self, callbacks: Callbacks) -> Phases:
        """Loops over the cells."""
        begin, accept = self._loops_of_step()
        if self._static is not None:
            begin.append(self._static.beginning())
        state = entering(self._stored, self._ledger.state.pointer("stored"))
        c: Any = state[1]

        def enter(q: Array) -> None:
            c.held = self._held

        def leave(q: Array) -> None:
            self._held = c.held

        return Phases(begin, accept, [state], loop("change_of_form", c), enter, leave)

    def add_tangent(self, q1: Array) -> None:
        """Add the stiffness, material and geometric."""
        if self._static is None:
            super().add_tangent(q1)
        else:
            self._static.add(q1)

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
    v: Array = on_demand()

    def __init__(
        self, fields: Fields, scheme: DynamicScheme, A: Csr, ledger: Ledger, v: Array
    ) -> None:
        rotations = scheme.half_tangents(fields.share.rotations())
        self._times = StepProduct(mass_matrix(fields), rotations, A, fields.share.scratch)
        self._fields, self.ledger = fields, ledger
        if scheme.slips:
            ledger.lost["numerical"] += 0.0
        self.scheme = scheme
        self.v = self.v_before = v
        self.more: tuple[Array, ...] = ()
        self._dt = self.last_dt = math.inf

    def in_cells(self) -> Sequence[InCells]:
        """The mass of the beams times the accelerations of the step."""
        form = partial(mass_kernel, self._fields)
        return [InCells(form, lib.DENSITY, self._fields.order, self._times.rate)]

    @property
    def M(self) -> Csr:
        """The mass matrix; a new one."""
        return self._times.matrix()

    def phases(self, callbacks: Callbacks) -> Phases | None:  # type: ignore[override]
        """Loops over the matrix and the velocities."""
        rates = self.in_c
        if rates is None:
            return None
        lost = self.ledger.lost.pointer("numerical") if self.scheme.slips else ffi.NULL
        kinetic = self.ledger.state.pointer("kinetic")
        of = rates.times(self._times, kept=kinetic, lost=lost)
        begin, accept, state = (
            [loop(name, of)] for name in ("begin_inertia", "accept_inertia", "add_kinetic_energy")
        )
        return Phases(begin, accept, state, None, rates.enter, rates.leave)

    @cached_property
    def in_c(self) -> RatesInC | None:
        """The velocities in C; none if the scheme makes something else of them than multiples."""
        return RatesInC.of(self)

    def begin(self, step: Step) -> None:
        """Prepare what stays constant in the step."""
        self._dt = step.dt
        self._times.begin(step.q0, *self.scheme.inertia(step.dt, self))

    def carry_on(self, memory: Memory, known: int) -> None:
        """State what the scheme keeps besides the velocities, as much as is ``known`` of it."""
        more = self.more or (self.v,) * known
        self.more = tuple(map(memory.at_dofs, self.scheme.kept[:known], more))

    def pass_on_step(self, memory: Memory) -> None:
        """State the velocities before the last step, and its length, at each degree of freedom."""
        self.v_before = memory.at_dofs(BEFORE, self.v_before)
        lengths = memory.at_dofs("last step", np.full(len(self.v), self.last_dt))
        self.last_dt = float(lengths[0]) if len(lengths) else self.last_dt

    def velocities(self, s: Array) -> Array:
        """Velocities at the end of a step ``s`` of the nodes."""
        return self.scheme.rates(self._dt, s, self)[0]

    def last_step(self, dt: float) -> None:
        """Take note of the length of the latest step; s."""
        self._dt = dt

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
            self.ledger.lost["numerical"] += float(lost)
        self.v_before, self.v, self.more, self.last_dt = self.v, v, tuple(more), self._dt

    def add_state(self, q: Array) -> None:
        """Add the kinetic energy to the ledger."""
        self.ledger.state["kinetic"] += self._times.A.square(self.v) / 2

    def remember(self, memory: Memory, q: Array) -> None:
        """Save or restore velocities and the last step."""
        self.v = memory.at_dofs("velocity", self.v)
        self.v_before = memory.at_dofs(BEFORE, self.v_before)
        self.last_dt = memory.number("step of velocity", self.last_dt)
        self.carry_on(memory, int(memory.number("further rates", len(self.more))))
