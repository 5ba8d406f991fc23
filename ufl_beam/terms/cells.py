# SPDX-License-Identifier: MIT
"""Common parts of terms with forces in cells.

Forms of a step; strains that an iteration of a static step predicts; and works of the tangent and
of its derivative, which buckling needs.
"""

from __future__ import annotations

from collections.abc import Sequence
from functools import cached_property
from typing import NamedTuple

import numpy as np
import ufl

from ufl_beam.arrays import Array
from ufl_beam.compiled.c_library import Loop, lib, loop, struct
from ufl_beam.compiled.csr import Csr
from ufl_beam.discretization.compiled_forms import Kernel, stated
from ufl_beam.discretization.function_spaces import Element, Fields
from ufl_beam.dolfinx_compat import fem
from ufl_beam.mechanics.kinematics import strain
from ufl_beam.terms.base import InCells, InternalForces, Term
from ufl_beam.terms.energy_ledger import Ledger
from ufl_beam.terms.phases import Callbacks, Phases, beginning, entering


class OfForms(Term):
    """Forces of a virtual work on cells, and forms of the energy that they lose in a step."""

    _entry: str  # of the losses in the ledger

    def __init__(
        self, work: ufl.Form, losses: Sequence[ufl.Form], fields: Fields, A: Csr, ledger: Ledger,
        tangent: Kernel | None = None,
    ) -> None:  # fmt: skip
        self._q0, self._q1 = fields.element.q0, fields.element.q1
        self._fields, self._A, self._ledger = fields, A, ledger
        if tangent is None:
            self._force, tangent = fields.force_and_tangent(work, self._q1, A)
        else:
            self._force = fields.hot_kernel(work, self._q1)
        self._loops = loop("add_cells", self._force.cells), loop("add_cells", tangent.cells)
        self._losses = [fields.hot_kernel(form, self._q1) for form in losses]
        alone = [loss for loss in self._losses if not loss.share(self._force)]
        self._of_step = [self._force, *alone]
        if losses:
            ledger.lost[self._entry] += 0.0

    def phases(self, callbacks: Callbacks) -> Phases:
        """Loops over the cells at the beginning of a step and at its acceptance."""
        lost = self._ledger.lost
        accept = [entering(loss, lost.pointer(self._entry)) for loss in self._losses]
        return Phases(beginning(self._of_step, self._q0), accept)

    def in_cells(self) -> Sequence[InCells]:
        """The forces of the form."""
        return [InCells(lambda: self._force, lib.STRESS, self._fields.order)]


# -- static steps ----------------------------------------------------------------------------------


@stated
def _linear_strains(of: Element) -> tuple[ufl.Form, fem.Function]:
    """Strains at the points, linear in a displacement about a configuration; that one."""
    about = of.configuration()
    e_about = strain(about, of.axis)
    return of.sampled(e_about + ufl.derivative(e_about, about, of.q1)), about


class PredictedStrains:
    """Strains that an iteration of a static step predicts, by linear kinematics.

    Displacements that solve a linear equation strain slender beams along their axes by nothing but
    the error of the linearisation, and forces from that send the next iteration astray.  The
    equation was about forces as well, which strains that are linear in the displacements predict
    without that error: they belong into the tangent, while the residual remains that of the
    displacements.  That is Newton's method for displacements and forces as independent unknowns, as
    the functional has them, with the forces eliminated; it converges in few iterations, whatever
    the slenderness.  The first guess of a step strains beams in the same way, so cells that yield
    extrapolate strains of states.

    Magisano, Leonetti and Garcea, Computer Methods in Applied Mechanics and Engineering 313 (2017).

    Attributes:
        c: ``predicted_strains`` of loops.h, with the state of the iteration.
        beginning: The phase that begins a step.
    """

    def __init__(self, fields: Fields) -> None:
        form, about = _linear_strains(fields.element)
        self._form = fields.hot_kernel(form, fields.element.q1)
        weights = fields.share.grid.mesh.point_weights.repeat(3)
        last, change = np.zeros((2, fields.share.size))
        self.c = struct(
            "predicted_strains", size=len(change), of_cell=len(weights), weight=weights,
            about=last, change=change, e=np.zeros((len(fields.order), len(weights))),
            strains=self._form.cells, at_about=self._form.position(about),
        )  # fmt: skip
        self.beginning = loop("begin_predicted_strains", self.c)


# -- works of tangents -----------------------------------------------------------------------------


class _Works(NamedTuple):
    """Works of a tangent and of its derivative along u for the motion x on y; that derivative."""

    tangent: ufl.Form
    change: ufl.Form
    matrix: ufl.Form
    x: fem.Function
    y: fem.Function
    u: fem.Function


@stated
def _works(work: ufl.Form, q1: fem.Function) -> _Works:
    x, y, u = (fem.Function(q1.function_space) for _ in range(3))
    tangent = ufl.derivative(work, q1, ufl.TrialFunction(q1.function_space))
    action = ufl.action(ufl.derivative(work, q1, x), y)
    change = ufl.derivative(action, q1, u)
    return _Works(action, change, ufl.derivative(tangent, q1, u), x, y, u)


class Cells(InternalForces):
    """Forces in cells whose tangent is known by its works on two motions, too.

    Works are summed over cells from the strains of the motions.  The entries of a matrix have the
    round-off of axial and shear stiffness, in which the bending of slender cells would be lost.
    """

    _work_form: ufl.Form
    _q1: fem.Function
    _fields: Fields
    predicted: PredictedStrains | None = None
    """In statics, the strains whose forces tangents have."""

    def demand(self) -> Loop | None:
        """C function of how far a law is missed, with its data; None if that is always zero."""
        return None

    def _coefficients(self, q1: Array) -> dict[fem.Function, Array]:
        """Values in the cells, at ``q1``, of what the virtual work depends on besides."""
        return {}

    @cached_property
    def _derivatives(self) -> tuple[_Works, dict[str, Kernel]]:
        return _works(self._work_form, self._q1), {}

    def _at(self, q1: Array, name: str, **motions: Array) -> Kernel:
        """The kernel of one of the :class:`_Works`, compiled when it is first asked for."""
        forms, kernels = self._derivatives
        if name not in kernels:
            kernels[name] = self._fields.kernel(getattr(forms, name), self._q1)
            if name == "matrix":
                kernels[name].place(self._A)
        kernel = kernels[name]
        for function, values in self._coefficients(q1).items():
            if kernel.uses(function):
                kernel.put(function, values)
        for motion, values in motions.items():
            kernel.set(getattr(forms, motion), values)
        return kernel

    def add_tangent_change(self, q1: Array, u: Array) -> None:
        """Add the derivative of the tangent at ``q1`` along ``u``."""
        self._at(q1, "matrix", u=u).add(q1, self._A.data)

    def tangent_work(self, q1: Array, x: Array, y: Array) -> float:
        """Return the work of the tangent for the motion x on y; J."""
        return self._at(q1, "tangent", x=x, y=y).value(q1)

    def work_of_change(self, q1: Array, u: Array, x: Array, y: Array) -> float:
        """Return the work of the derivative of the tangent along u, for x on y; J."""
        return self._at(q1, "change", u=u, x=x, y=y).value(q1)
