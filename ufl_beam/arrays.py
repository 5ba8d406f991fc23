# SPDX-License-Identifier: MIT
"""Types of arrays, and the state of a scene as solutions keep it."""

from __future__ import annotations

from typing import Any, NamedTuple, TypeAlias

import numpy as np
import numpy.typing as npt

Array: TypeAlias = npt.NDArray[np.float64]
"""Real numbers."""

Complex: TypeAlias = npt.NDArray[np.complex128]
"""Complex numbers."""

Index: TypeAlias = npt.NDArray[Any]
"""Integers that number something."""

State: TypeAlias = dict[str, Array]
"""Arrays of a state, by name."""


class Snapshot(NamedTuple):
    """State of a scene at one time, the same on every process."""

    t: float  # time, s; or the load factor of a path
    q: Array  # configuration, all degrees of freedom in the order of the grid
    v: Array | None  # velocities, as q; None in statics
    reactions: Array  # forces of the supports on the scene; (num_supports, 3); N, N, N m
    entries: tuple[dict[str, float], ...]  # the ledger: state, supplied, lost; J
    material: Array  # numbers of the cells that can yield or break, and their material; (m, 7)
    connections: Array  # columns of ``Connection`` for all links; (num_links, 5)
    parts: int = 0  # steps so far, parts of cut steps counted each
    iterations: int = 0  # Newton iterations so far
