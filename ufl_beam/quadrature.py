# SPDX-License-Identifier: MIT
"""Gauss-Legendre rule."""

from __future__ import annotations

from functools import cache

import numpy as np

from ufl_beam.arrays import Array


@cache
def gauss_rule(number: int) -> tuple[Array, Array]:
    """Return points from 0 to 1 and weights with the sum 1; exact up to degree 2 number - 1."""
    points, weights = np.polynomial.legendre.leggauss(number)
    rule = (1 + points) / 2, weights / 2
    for values in rule:
        values.setflags(write=False)
    return rule
