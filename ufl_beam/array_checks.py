# SPDX-License-Identifier: MIT
"""Checks of arrays of numbers that users give."""

from __future__ import annotations

from typing import Any

import numpy as np
import numpy.typing as npt

from ufl_beam.arrays import Array
from ufl_beam.errors import SceneError, shorten


def require_array(values: Any, what: str) -> Array:
    """Return ``values`` as an array of finite numbers, or raise :class:`SceneError`."""
    try:
        array = np.asarray(values)
        if array.dtype.kind not in "buifO" or (array.dtype.kind == "O" and _has_no_number(array)):
            raise TypeError
        array = array.astype(float)
    except (TypeError, ValueError, OverflowError):
        raise SceneError(f"{what} = {shorten(values)} must be numbers") from None
    for i in np.argwhere(~np.isfinite(array)):
        at = ", ".join(map(str, i))
        raise SceneError(f"{what}{f'[{at}]' if at else ''} = {array[tuple(i)]} is not finite")
    return array


def _has_no_number(array: npt.NDArray[Any]) -> bool:
    return any(value is None or isinstance(value, str | bytes) for value in array.flat)


def require_row(values: Any, what: str) -> Array:
    """Return ``values`` as one row of finite numbers, or raise :class:`SceneError`."""
    row = require_array(values, what)
    if row.ndim != 1:
        raise SceneError(f"{what} has shape {row.shape}; give one row of numbers")
    return row
