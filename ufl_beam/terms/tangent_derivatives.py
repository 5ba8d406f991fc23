# SPDX-License-Identifier: MIT
"""Derivative of a tangent along a direction, and works of both: what buckling needs."""

from __future__ import annotations

from collections.abc import Callable
from functools import cached_property
from typing import NamedTuple

import ufl

from ufl_beam.arrays import Array
from ufl_beam.compiled.csr import Csr
from ufl_beam.discretization.compiled_forms import Kernel, stated
from ufl_beam.discretization.function_spaces import Fields
from ufl_beam.dolfinx_compat import fem
from ufl_beam.terms.base import Beams


class TangentChange:
    """Derivative of a tangent along a direction u, from its bilinear form."""

    def __init__(
        self, change: ufl.Form, u: fem.Function, kernel: Callable[[ufl.Form], Kernel], A: Csr
    ) -> None:
        self._u, self._A, self._kernel = u, A, kernel(change)
        self._kernel.place(A)

    def put(self, function: fem.Function, values: Array) -> None:
        """Give a coefficient values in the cells; the derivative may not depend on it."""
        if self._kernel.uses(function):
            self._kernel.put(function, values)

    def add(self, q1: Array, u: Array) -> None:
        """Add the derivative at ``q1`` along ``u`` to the matrix."""
        self._kernel.set(self._u, u)
        self._kernel.add(q1, self._A.data)


class _Works(NamedTuple):
    """Works of a tangent and of its derivative along u, for the motion x on y."""

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


class Cells(Beams):
    """Beams whose tangent is known by its works on two motions, too.

    Works are summed over cells from the strains of the motions.  The entries of a matrix have the
    round-off of axial and shear stiffness, in which the bending of slender cells would be lost.
    """

    _work_form: ufl.Form
    _q1: fem.Function
    _fields: Fields
    _A: Csr

    def _coefficients(self, q1: Array) -> dict[fem.Function, Array]:
        """Values in the cells, at ``q1``, of what the virtual work depends on besides."""
        return {}

    def _kernel(self, form: ufl.Form) -> Kernel:
        return self._fields.kernel(form, self._q1)

    @cached_property
    def _works(self) -> _Works:
        return _works(self._work_form, self._q1)

    @cached_property
    def _matrix(self) -> TangentChange:
        return TangentChange(self._works.matrix, self._works.u, self._kernel, self._A)

    @cached_property
    def _of_tangent(self) -> Kernel:
        return self._kernel(self._works.tangent)

    @cached_property
    def _of_change(self) -> Kernel:
        return self._kernel(self._works.change)

    def add_tangent_change(self, q1: Array, u: Array) -> None:
        """Add the derivative of the tangent at ``q1`` along ``u``."""
        for function, values in self._coefficients(q1).items():
            self._matrix.put(function, values)
        self._matrix.add(q1, u)

    def tangent_work(self, q1: Array, x: Array, y: Array) -> float:
        """Return the work of the tangent for the motion x on y; J."""
        return self._value(self._of_tangent, q1, x, y)

    def work_of_change(self, q1: Array, u: Array, x: Array, y: Array) -> float:
        """Return the work of the derivative of the tangent along u, for x on y; J."""
        self._of_change.set(self._works.u, u)
        return self._value(self._of_change, q1, x, y)

    def _value(self, kernel: Kernel, q1: Array, x: Array, y: Array) -> float:
        for function, values in self._coefficients(q1).items():
            if kernel.uses(function):
                kernel.put(function, values)
        kernel.set(self._works.x, x)
        kernel.set(self._works.y, y)
        return kernel.value(q1)
