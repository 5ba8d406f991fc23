# SPDX-License-Identifier: MIT
"""Resultants in proportion to second differences of strains: what a decaying scheme adds."""

from __future__ import annotations

import math
from functools import singledispatch

import numpy as np
import ufl

from ufl_beam.arrays import Array
from ufl_beam.compiled.csr import Csr
from ufl_beam.discretization.compiled_forms import stated
from ufl_beam.discretization.function_spaces import Element, Fields, Strains
from ufl_beam.discretization.state_io import Memory
from ufl_beam.dolfinx_compat import fem
from ufl_beam.mechanics.decaying_midpoint import DecayingMidpoint
from ufl_beam.mechanics.kinematics import strain
from ufl_beam.mechanics.time_schemes import Step
from ufl_beam.terms.base import OfForms, Term
from ufl_beam.terms.energy_ledger import Ledger


@singledispatch
def numerical_forces(scheme: object, fields: Fields, A: Csr, ledger: Ledger) -> list[Term]:
    """Forces of elastic cells that only the scheme asks for; for most schemes none."""
    return []


@stated
def _forms(of: Element, scheme: DecayingMidpoint) -> tuple[ufl.Form, ufl.Form, fem.Function]:
    """Virtual work, the energy lost, and the changes of the strains in the step before."""
    q0, q1, C, dx = of.q0, of.q1, of.stiffness, of.dx(1)
    before, part = of.at_points(3), of.constant(scheme.part)
    change = strain(q1, of.axis) - strain(q0, of.axis)
    r = ufl.as_vector([part * C[i] * (change[i] - before[i]) for i in range(3)])
    work = ufl.dot(r, scheme.virtual_strain(q0, q1, of.w, of.axis)) * dx
    return work, ufl.dot(r, change) * dx, before


class SecondDifferences(OfForms):
    """Resultants c C (Δe - r Δe'), see :class:`DecayingMidpoint`."""

    kind = "beams"

    def __init__(self, scheme: DecayingMidpoint, fields: Fields, A: Csr, ledger: Ledger) -> None:
        work, lost, self._before = _forms(fields.element, scheme)
        self._q0, q1 = fields.element.q0, fields.element.q1
        self._force, self._tangent = fields.force_and_tangent(work, q1, A)
        self._lost = fields.hot_kernel(lost, q1)
        self._strains = Strains(fields)
        self._cells = fields.share.cells[fields.order]
        self._q: Array = np.empty(0)
        self._e: Array = np.zeros(self._strains.shape)
        self._change: Array = np.zeros(self._strains.shape)
        self._dt = self._last_dt = math.inf
        self._A, self._ledger = A, ledger
        ledger.lost["numerical"] += 0.0

    def begin(self, step: Step) -> None:
        """Remember the configuration at the beginning, and the changes in the step before."""
        if step.q0 is not self._q:
            self._q, self._e = step.q0, self._strains(step.q0)
        self._dt = step.dt
        for kernel in (self._force, self._lost):
            kernel.set(self._q0, step.q0)
            kernel.put(self._before, min(1.0, step.dt / self._last_dt) * self._change)

    def accept(self, q1: Array, s: Array) -> None:
        """Enter the energy that was lost, and keep the changes of the strains."""
        self._ledger.lost["numerical"] += self._lost.value(q1)
        e1 = self._strains(q1)
        self._change, self._q, self._e, self._last_dt = e1 - self._e, q1, e1, self._dt

    def remember(self, memory: Memory, q: Array) -> None:
        """The changes of the strains in the last step, and its length."""
        self._change = memory.rows("changes of strains", self._cells, self._change)
        self._last_dt = memory.number("step of strains", self._last_dt)
        self._q, self._e = q, self._strains(q)


@numerical_forces.register
def _(scheme: DecayingMidpoint, fields: Fields, A: Csr, ledger: Ledger) -> list[Term]:
    return [SecondDifferences(scheme, fields, A, ledger)]
