# SPDX-License-Identifier: MIT
"""Curves of guides in UFL: points, derivatives, and nearest points."""

from __future__ import annotations

import math
from collections.abc import Callable
from functools import lru_cache
from typing import Any

import basix.ufl
import numpy as np
import ufl
from ufl.algorithms import expand_derivatives
from ufl.classes import ComplexValue, FloatValue, Power
from ufl.core.expr import Expr
from ufl.corealg.traversal import unique_post_traversal
from ufl.domain import extract_domains
from ufl.utils.stacks import StackDict

from ufl_beam.arrays import Array
from ufl_beam.errors import ModelError, calling, shorten
from ufl_beam.model.functions import GuideCurve, guide_curve

_MESH = ufl.Mesh(basix.ufl.element("Lagrange", "interval", 1, shape=(1,)))


class _Symbol(ufl.Constant):  # type: ignore[misc]
    """Symbol of which UFL does not seek a value, for minutes, where a curve takes its ``float``."""

    def evaluate(self, x: Any, mapping: Any, component: Any, index_values: Any) -> float:
        """Return the value in ``mapping``, or raise KeyError."""
        value: float = mapping[self]
        return value


_S = _Symbol(_MESH)

S = ufl.variable(_S)
"""Parameter of a curve."""

IN_UFL = (
    ". Curves are functions of s in UFL: write for example ufl.cos(s) instead of math.cos(s), and "
    "ufl.conditional instead of if; ub.Spline(points) is a curve through points"
)
"""Advice in the errors of curves that are no expressions of UFL."""


_numbers = list[Expr]()


def number(i: int) -> Expr:
    """Return the symbol of the i-th number of a curve."""
    while len(_numbers) <= i:
        _numbers.append(ufl.Constant(_MESH))
    return _numbers[i]


@lru_cache(maxsize=128)
def expansion(structure: tuple[Expr, Expr], order: int) -> list[tuple[Expr, Expr]]:
    """Return a curve and its derivatives by s up to an order, as functions of :data:`S`."""
    found = [structure]
    for _ in range(order):
        x, y = (expand_derivatives(ufl.diff(component, S)) for component in found[-1])
        found.append((x, y))
    return found


class CurveInUFL(GuideCurve):
    """Curve of a user's function, which is called once.

    Attributes:
        structure: Coordinates as expressions of :data:`S` and of numbers, see :func:`number`.
        numbers: The numbers; curves that differ in them have the same structure.
    """

    def __init__(self, curve: Callable[[Any], Any], what: str) -> None:
        with calling(f"{what}: it cannot be called with a symbol of UFL", IN_UFL):
            returned = curve(S)
        try:
            x, y = returned
            nodes = [*unique_post_traversal(both := ufl.as_vector([x, y]))]
            whole = both.ufl_shape == (2,) and not both.ufl_free_indices
            whole &= {*extract_domains(both)} <= {_MESH}
            whole &= not any(isinstance(node, ComplexValue) for node in nodes)
        except Exception:
            whole = False
        if not whole:
            raise ModelError(f"{what} returned {shorten(returned)}, no point (x, y){IN_UFL}")
        x, y = both
        exponents = [node.ufl_operands[1] for node in nodes if isinstance(node, Power)]
        values = [x for x in nodes if isinstance(x, FloatValue) and x not in exponents]
        symbols = {value: number(i) for i, value in enumerate(values)}
        self.numbers = [*map(float, values)]
        self.structure = ufl.replace(x, symbols), ufl.replace(y, symbols)
        self._expansion = expansion((x, y), 2)

    def at(self, s: float) -> Array:
        """See the base class; NaN where the curve is undefined."""
        known, indices = {_S: s}, StackDict()
        try:
            rows = [[x.evaluate((), known, (), indices) for x in row] for row in self._expansion]
            return np.array(rows, dtype=np.float64)
        except (ValueError, ArithmeticError):
            return np.full((3, 2), math.nan)


guide_curve.register(object, CurveInUFL)
guide_curve.register(GuideCurve, lambda curve, what: curve)


def structure_of(curve: GuideCurve) -> tuple[tuple[Expr, Expr], int, bool]:
    """Return the structure of a curve, how many numbers it has, and whether they depend on s."""
    if isinstance(curve, CurveInUFL):
        return curve.structure, len(curve.numbers), False
    u = S - number(0)  # in a row of the table of a spline
    x, y = (sum(number(i + k) * u**k for k in range(4)) for i in (1, 5))
    return (x, y), 9, True
