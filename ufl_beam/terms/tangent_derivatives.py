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
from ufl_beam.dolfinx_compat import fem

Compile = Callable[[ufl.Form], Kernel]


class TangentChange:
    """Derivative of a tangent by the configuration, along a direction.

    Args:
        change: Bilinear form of the derivative.
        u: The direction.
        kernel: Compiles a form.
        A: Matrix that takes the derivative.
    """

    def __init__(self, change: ufl.Form, u: fem.Function, kernel: Compile, A: Csr) -> None:
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


class CellTangent:
    """Tangent of the beams: its derivative as a matrix, and the works of both on two motions.

    Works are summed over cells from the strains of the motions.  The entries of a matrix have the
    round-off of axial and shear stiffness, in which the bending of slender cells would be lost.

    Args:
        work: Virtual work.
        q1: The configuration that it depends on.
        kernel: Compiles a form; ``q1`` is the configuration that changes.
        A: Matrix that takes the derivative.
    """

    def __init__(self, work: ufl.Form, q1: fem.Function, kernel: Compile, A: Csr) -> None:
        self._forms, self._compile, self._A = _works(work, q1), kernel, A
        self._values: dict[fem.Function, Array] = {}

    @cached_property
    def _matrix(self) -> TangentChange:
        return TangentChange(self._forms.matrix, self._forms.u, self._compile, self._A)

    @cached_property
    def _of_tangent(self) -> Kernel:
        return self._compile(self._forms.tangent)

    @cached_property
    def _of_change(self) -> Kernel:
        return self._compile(self._forms.change)

    def put(self, function: fem.Function, values: Array) -> None:
        """Give a coefficient values in the cells."""
        self._values[function] = values

    def add_change(self, q1: Array, u: Array) -> None:
        """Add the derivative at ``q1`` along ``u`` to the matrix."""
        for function, values in self._values.items():
            self._matrix.put(function, values)
        self._matrix.add(q1, u)

    def work(self, q1: Array, x: Array, y: Array) -> float:
        """Work of the tangent at ``q1`` for the motion x on y; J."""
        return self._value(self._of_tangent, q1, x, y)

    def work_of_change(self, q1: Array, u: Array, x: Array, y: Array) -> float:
        """Work of the derivative of the tangent at ``q1`` along u, for the motion x on y; J."""
        self._of_change.set(self._forms.u, u)
        return self._value(self._of_change, q1, x, y)

    def _value(self, kernel: Kernel, q1: Array, x: Array, y: Array) -> float:
        for function, values in self._values.items():
            if kernel.uses(function):
                kernel.put(function, values)
        kernel.set(self._forms.x, x)
        kernel.set(self._forms.y, y)
        return kernel.value(q1)
