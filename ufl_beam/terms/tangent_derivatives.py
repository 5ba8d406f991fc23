# SPDX-License-Identifier: MIT
"""Derivative of a tangent along a direction, and works of both: what buckling needs."""

from __future__ import annotations

from collections.abc import Callable
from functools import cached_property

import ufl

from ufl_beam.arrays import Array
from ufl_beam.compiled.csr import Csr
from ufl_beam.discretization.compiled_forms import Kernel
from ufl_beam.dolfinx_compat import fem

Compile = Callable[[ufl.Form], Kernel]


class TangentChange:
    """Derivative of a tangent by the configuration, along a direction; derived by UFL.

    Args:
        tangent: Bilinear form of the tangent.
        q1: The configuration that it depends on.
        kernel: Compiles a form; ``q1`` is the configuration that changes.
        A: Matrix that takes the derivative.
        more: Form to be added, made from the direction.
    """

    def __init__(
        self,
        tangent: ufl.Form,
        q1: fem.Function,
        kernel: Compile,
        A: Csr,
        more: Callable[[fem.Function], ufl.Form] | None = None,
    ) -> None:
        self._u, self._A = fem.Function(q1.function_space), A
        change = ufl.derivative(tangent, q1, self._u)
        self._kernel = kernel(change if more is None else change + more(self._u))
        self._kernel.place(A)

    def put(self, function: fem.Function, values: Array) -> None:
        """Give a coefficient values in the cells; the derivative may not depend on it."""
        if self._kernel.uses(function):
            self._kernel.put(function, values)

    def add(self, q1: Array, u: Array) -> None:
        """Add the derivative at ``q1`` along ``u`` to the matrix."""
        self._kernel.set(self._u, u)
        self._kernel.add(q1, self._A.data)


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
        self._work, self._q1, self._compile, self._A = work, q1, kernel, A
        self._x, self._y, self._u = (fem.Function(q1.function_space) for _ in range(3))
        self._values: dict[fem.Function, Array] = {}

    @cached_property
    def _matrix(self) -> TangentChange:
        dq = ufl.TrialFunction(self._q1.function_space)
        tangent = ufl.derivative(self._work, self._q1, dq)
        return TangentChange(tangent, self._q1, self._compile, self._A)

    @property
    def _action(self) -> ufl.Form:
        return ufl.action(ufl.derivative(self._work, self._q1, self._x), self._y)

    @cached_property
    def _of_tangent(self) -> Kernel:
        return self._compile(self._action)

    @cached_property
    def _of_change(self) -> Kernel:
        return self._compile(ufl.derivative(self._action, self._q1, self._u))

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
        self._of_change.set(self._u, u)
        return self._value(self._of_change, q1, x, y)

    def _value(self, kernel: Kernel, q1: Array, x: Array, y: Array) -> float:
        for function, values in self._values.items():
            if kernel.uses(function):
                kernel.put(function, values)
        kernel.set(self._x, x)
        kernel.set(self._y, y)
        return kernel.value(q1)
