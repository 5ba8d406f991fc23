# SPDX-License-Identifier: MIT
"""Functions of single points, stated in UFL and compiled to C."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import basix.ufl
import numpy as np
import ufl
from ufl.core.expr import Expr

from ufl_beam.compiled.jit import compiled_form
from ufl_beam.discretization.compiled_forms import tabulator
from ufl_beam.dolfinx_compat import fem, line_mesh


class Pointwise:
    """Compiler of functions from the numbers of a point to other numbers.

    A form on a cell of unit length with one quadrature point is such a function.

    Args:
        inputs: Names of the numbers that functions depend on, in the order of their storage.

    Attributes:
        at: UFL symbols of the inputs, by name.
    """

    def __init__(self, inputs: Sequence[str]) -> None:
        self._cell = line_mesh(np.array([[0.0, 0.0], [1.0, 0.0]]), np.array([[0, 1]]))
        self._alive: list[fem.Form] = []
        x = fem.Function(self._values(len(inputs)))
        self.at: dict[str, Expr] = {name: x[i] for i, name in enumerate(inputs)}

    def compile(self, *outputs: Expr) -> Any:
        """Compile a function to C; the C lives as long as this object."""
        z = ufl.TestFunction(self._values(len(outputs)))
        dx = ufl.Measure("dx", domain=self._cell, metadata={"quadrature_degree": 1})
        form, _ = compiled_form(ufl.dot(ufl.as_vector(outputs), z) * dx)
        self._alive.append(form)
        return tabulator(form)

    def _values(self, n: int) -> fem.FunctionSpace:
        element = basix.ufl.quadrature_element("interval", value_shape=(n,), degree=1)
        return fem.functionspace(self._cell, element)
