# SPDX-License-Identifier: MIT
"""Terms whose forces are a form on cells, or a constant matrix times the step of the nodes."""

from __future__ import annotations

from collections.abc import Sequence

import ufl

from ufl_beam.compiled.c_library import Loop, lib, loop
from ufl_beam.compiled.csr import Csr, StepProduct
from ufl_beam.discretization.compiled_forms import Kernel
from ufl_beam.discretization.function_spaces import Fields
from ufl_beam.terms.base import Term
from ufl_beam.terms.energy_ledger import Ledger
from ufl_beam.terms.in_cells import InCells
from ufl_beam.terms.phases import Callbacks, Phases, beginning, entering


class OfForms(Term):
    """Forces of a virtual work on cells, and forms of the energy that they lose in a step."""

    _entry: str  # of the losses in the ledger

    def __init__(
        self, work: ufl.Form, losses: Sequence[ufl.Form], fields: Fields, A: Csr, ledger: Ledger,
        tangent: Kernel | None = None,
    ) -> None:  # fmt: skip
        self._q0, self._q1 = fields.element.q0, fields.element.q1
        self._order = fields.order
        if tangent is None:
            self._force, self._tangent = fields.force_and_tangent(work, self._q1, A)
        else:
            self._force, self._tangent = fields.hot_kernel(work, self._q1), tangent
        self._losses = [fields.hot_kernel(form, self._q1) for form in losses]
        alone = [loss for loss in self._losses if not loss.share(self._force)]
        self._of_step = [self._force, *alone]
        self._A, self._ledger = A, ledger
        if losses:
            ledger.lost[self._entry] += 0.0

    def phases(self, callbacks: Callbacks) -> Phases:
        """Loops over the cells."""
        return Phases(*self._loops_of_step())

    def _loops_of_step(self) -> tuple[list[Loop], list[Loop]]:
        """Loops at the beginning of a step and at its acceptance."""
        lost = self._ledger.lost
        accept = [entering(loss, lost.pointer(self._entry)) for loss in self._losses]
        return beginning(self._of_step, self._q0), accept

    def loops(self) -> tuple[Loop, Loop | None]:
        """C loops over the cells, of force and tangent."""
        return loop("add_cells", self._force.cells), loop("add_cells", self._tangent.cells)

    def in_cells(self) -> Sequence[InCells]:
        """The forces of the form."""
        return [InCells(lambda: self._force, lib.STRESS, self._order)]


class OfMatrix(Term):
    """Forces of a constant matrix times the step of the nodes."""

    _times: StepProduct

    def loops(self) -> tuple[Loop, Loop | None]:
        """The product, and its derivative."""
        return self._times.loops()
