# SPDX-License-Identifier: MIT
"""Derivatives of functions of arrays by complex steps, and small systems at many points."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence

import numpy as np

from ufl_beam.arrays import Array
from ufl_beam.model.law_functions import Values

IMAGINARY = 1e-200
"""Step into the imaginary: its square disturbs no digit of the value."""

EPS = float(np.finfo(float).eps)


def derivative(f: Callable[[Values], Values], x: Array) -> tuple[Array, Array]:
    """Value and derivative of a function of arrays, entry by entry."""
    y = f(x + 1j * IMAGINARY)
    return np.real(y).copy(), np.imag(y) / IMAGINARY


def jacobian(
    f: Callable[[Mapping[str, Values]], Array], at: Mapping[str, Values], by: Sequence[str]
) -> tuple[Array, Array]:
    """Values of functions of points, and derivatives by some numbers; (n, ...), (n, k, ...)."""

    def column(name: str) -> tuple[Array, Array]:
        return derivative(lambda x: f({**at, name: x}), at[name])

    columns = [column(name) for name in by]
    return columns[0][0], np.stack([slope for _, slope in columns], axis=1)


def solved(A: Array, b: Array) -> Array:
    """Solve A x = b at many points; (n, n, ...), (n, k, ...); NaN where A is singular."""
    A, b = (np.moveaxis(x, (0, 1), (-2, -1)) for x in (A, b))
    with np.errstate(invalid="ignore"):
        A = np.where((np.linalg.det(A) == 0)[..., None, None], np.nan, A)
    return np.asarray(np.moveaxis(np.linalg.solve(A, b), (-2, -1), (0, 1)))


def part_of(residuals: Array, sizes: Array) -> Array:
    """Largest part that the residuals of a law are of their sizes; infinite if it is no number."""
    part = np.where(residuals == 0, 0.0, np.abs(residuals) / sizes)
    return np.asarray(np.nan_to_num(part, nan=np.inf, posinf=np.inf).max(axis=0))
