# SPDX-License-Identifier: MIT
"""Functions that laws of materials are written with, for arrays and for UFL expressions."""

from __future__ import annotations

from functools import singledispatch
from typing import Any

import numpy as np

Values = Any
"""Array of real or complex numbers, or a UFL expression."""


@singledispatch
def where(condition: Values, yes: Values, no: Values) -> Values:
    """``yes`` where the condition holds, else ``no``; both are evaluated everywhere."""
    return np.where(condition, yes, no)


@singledispatch
def below(x: Values, limit: float) -> Values:
    """Return whether x is less than the limit."""
    return x < limit


@singledispatch
def exp(x: Values) -> Values:
    """Exponential function of numbers or arrays."""
    return np.exp(x)


def sign(x: Values) -> Values:
    """1 or -1; 1 at zero."""
    return where(below(x, 0.0), -1.0, 1.0)


def positive(x: Values) -> Values:
    """Macaulay's bracket <x>: x where it is positive, else zero."""
    return where(below(-x, 0.0), x, 0.0)
