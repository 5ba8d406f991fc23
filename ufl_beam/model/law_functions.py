# SPDX-License-Identifier: MIT
"""Functions of arrays and UFL expressions, for laws of materials, softening and connectors.

Arrays may be complex, because some derivatives are computed by complex steps: use
:func:`absolute` instead of ``abs``.  Besides these functions, laws use the
operators ``+ - * /`` and ``**``.

Example:
    >>> f = ub.extend.law_functions
    >>> print(f.positive(np.array([-1.0, 2.0])), f.absolute(np.array([-1.0, 2.0])))
    [0. 2.] [1. 2.]
"""

from __future__ import annotations

from functools import singledispatch
from typing import Any

import numpy as np

Values = Any
"""Array of real or complex numbers, or a UFL expression."""


@singledispatch
def where(condition: Values, yes: Values, no: Values) -> Values:
    """Return ``yes`` where the condition is true, else ``no``; both are evaluated everywhere."""
    return np.where(condition, yes, no)


@singledispatch
def below(x: Values, limit: float) -> Values:
    """Return the condition x < limit."""
    return x < limit


@singledispatch
def exp(x: Values) -> Values:
    """Return the exponential of x."""
    return np.exp(x)


def sign(x: Values) -> Values:
    """Return the sign of x, 1 or -1; at zero 1."""
    return where(below(x, 0.0), -1.0, 1.0)


def positive(x: Values) -> Values:
    """Return the Macaulay bracket <x>: x where it is positive, else zero."""
    return where(below(-x, 0.0), x, 0.0)


def absolute(x: Values) -> Values:
    """Return the absolute value of x; its slope at zero is 1."""
    return where(below(x, 0.0), -x, x)


def larger(x: Values, y: Values) -> Values:
    """Return the larger of x and y; x where they are equal."""
    return where(below(x - y, 0.0), y, x)


def smaller(x: Values, y: Values) -> Values:
    """Return the smaller of x and y; x where they are equal."""
    return where(below(y - x, 0.0), y, x)


@singledispatch
def sqrt(x: Values) -> Values:
    """Return the square root of numbers that are not negative."""
    return np.sqrt(x)


@singledispatch
def log(x: Values) -> Values:
    """Return the natural logarithm of positive numbers."""
    return np.log(x)


@singledispatch
def tanh(x: Values) -> Values:
    """Return the hyperbolic tangent of x."""
    return np.tanh(x)
