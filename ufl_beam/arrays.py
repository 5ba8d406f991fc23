# SPDX-License-Identifier: MIT
"""Types of arrays."""

from __future__ import annotations

from typing import Any, TypeAlias

import numpy as np
import numpy.typing as npt

Array: TypeAlias = npt.NDArray[np.float64]
"""Real numbers."""

Complex: TypeAlias = npt.NDArray[np.complex128]
"""Complex numbers."""

Index: TypeAlias = npt.NDArray[Any]
"""Integers, such as indices of cells or of degrees of freedom."""

State: TypeAlias = dict[str, Array]
"""State of an object as arrays by name."""
