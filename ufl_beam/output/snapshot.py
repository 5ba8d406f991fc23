# SPDX-License-Identifier: MIT
"""Snapshot: the state of a simulation as solutions keep it."""

from __future__ import annotations

from typing import NamedTuple

from ufl_beam.arrays import Array


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
