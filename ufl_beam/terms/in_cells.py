# SPDX-License-Identifier: MIT
"""Forces on the nodes of cells, as terms state them; see cell_forces.py."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, NamedTuple

from ufl_beam.arrays import Index


class InCells(NamedTuple):
    """Forces on the nodes of cells.

    Attributes:
        form: Makes the form whose entries are the forces; those of its latest evaluation count.
        kind: ``force_kind`` of loops.h.
        order: Positions in ``share.cells`` of its cells.
        vector: If the form is linear, and nothing else evaluates it: place of the address of the
            vector that it is evaluated at.
        factor: Factor of the forces.
        q0: If the form depends on the configurations at both ends of the step alone: the first.
    """

    form: Callable[[], Any]
    kind: int
    order: Index
    vector: Any = None
    factor: float = 1.0
    q0: Any = None
