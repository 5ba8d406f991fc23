# SPDX-License-Identifier: MIT
"""Kinds of tangents of static steps."""

from __future__ import annotations

from enum import Enum, auto


class Tangents(Enum):
    """Whose forces tangents of static steps have; see static_tangents.py."""

    PREDICTED = auto()  # first those before the step, then those that the last iteration predicted
    FIRST = auto()  # first those before the step, then those at the iterate
    EXACT = auto()  # those at the iterate: in the direction of such a step the residual falls
