# SPDX-License-Identifier: MIT
"""Derivative of a tangent along a direction, and works of both: what buckling needs."""

from __future__ import annotations

from functools import cached_property
from typing import NamedTuple

import ufl

from ufl_beam.arrays import Array
from ufl_beam.compiled.c_library import Loop
from ufl_beam.compiled.csr import Csr
from ufl_beam.discretization.compiled_forms import Kernel, stated
from ufl_beam.discretization.function_spaces import Fields
from ufl_beam.dolfinx_compat import fem
from ufl_beam.terms.base import InternalForces
from ufl_beam.terms.static_tangents import PredictedStrains


class _Forms(NamedTuple):
    """Works of a tangent and of its derivative along u for the motion x on y; that derivative."""

    tangent: ufl.Form
    change: ufl.Form
    matrix: ufl.Form
    x: fem.Function
    y: fem.Function
    u: fem.Function


@stated
def _forms(work: ufl.Form, q1: fem.Function) -> _Forms:
    x, y, u = (fem.Function(q1.function_space) for _ in range(3))
    tangent = ufl.derivative(work, q1, ufl.TrialFunction(q1.function_space))
    action = ufl.action(ufl.derivative(work, q1, x), y)
    change = ufl.derivative(action, q1, u)
    return _Forms(action, change, ufl.derivative(tangent, q1, u), x, y, u)


class Cells(InternalForces):
    """Forces in cells whose tangent is known by its works on two motions, too.

    Works are summed over cells from the strains of the motions.  The entries of a matrix have the
    round-off of axial and shear stiffness, in which the bending of slender cells would be lost.
    """

    _work_form: ufl.Form
    _q1: fem.Function
    _fields: Fields
    _A: Csr
    predicted: PredictedStrains | None = None
    """In statics, the strains whose forces tangents have."""

    def demand(self) -> Loop | None:
        """Return the C function of :meth:`missed` with its data, if it is ever more than zero."""
        return None

    def _coefficients(self, q1: Array) -> dict[fem.Function, Array]:
        """Values in the cells, at ``q1``, of what the virtual work depends on besides."""
        return {}

    @cached_property
    def _derivatives(self) -> tuple[_Forms, dict[str, Kernel]]:
        return _forms(self._work_form, self._q1), {}

    def _at(self, q1: Array, name: str, **motions: Array) -> Kernel:
        """The kernel of one of the :class:`_Forms`, compiled when it is first asked for."""
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
