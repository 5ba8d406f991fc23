# SPDX-License-Identifier: MIT
"""Snapshot: the state of a simulation as solutions keep it."""

from __future__ import annotations

from typing import NamedTuple

from ufl_beam.arrays import Array, Index


class Snapshot(NamedTuple):
    """State of a scene at one time, the same on every process.

    Attributes:
        t: Time, or the load factor of a path; s.
        q: Configuration, all degrees of freedom in the order of the grid.
        v: Velocities, as ``q``; None in statics.
        reactions: Forces of the supports on the scene; (num_supports, 3); N, N, N m.
        entries: The ledger: state, supplied, lost; J.
        material: Groups of cells that can yield or break, and rows for their material.
        connections: Columns of ``Connection`` for all links; (num_links, 5).
        parts: Steps so far, parts of cut steps counted each.
        iterations: Newton iterations so far.
    """

    t: float
    q: Array
    v: Array | None
    reactions: Array
    entries: tuple[dict[str, float], ...]
    material: list[tuple[Index, Array]]
    connections: Array
    parts: int = 0
    iterations: int = 0
