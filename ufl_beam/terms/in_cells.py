# SPDX-License-Identifier: MIT
"""Forces on the nodes of cells in the equation of a step, and in the accepted state.

At a node, the forces of all cells, and of all that acts there, add up to the residual.  So what they
are at both ends of a cell are its section forces there, in equilibrium with supports and joints.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np
import ufl

from ufl_beam.arrays import Array, Index
from ufl_beam.compiled.c_library import doubles, ffi, fill, integers, lib
from ufl_beam.discretization.compiled_forms import CellForm, stated
from ufl_beam.discretization.function_spaces import Element, mass_form
from ufl_beam.discretization.partition import Share
from ufl_beam.discretization.state_io import Memory


class InCells(NamedTuple):
    """Forces on the nodes of cells.

    Attributes:
        form: Its entries are the forces; those of the latest evaluation count.
        kind: ``force_kind`` of loops.h.
        order: Positions in ``share.cells`` of its cells.
        vector: If the form is linear: place of the address of the vector that it is evaluated at.
        factor: Factor of the forces.
    """

    form: CellForm
    kind: int
    order: Index
    vector: Any = None
    factor: float = 1.0


@stated
def mass_times(of: Element) -> ufl.Form:
    """Mass of the beams times a vector, the unknown q1."""
    return ufl.action(mass_form(of), of.q1)


class CellForces:
    """Forces of the cells of a process in the equation of the accepted step.

    Attributes:
        c: ``cell_forces`` of loops.h.
    """

    def __init__(self, share: Share, parts: Sequence[InCells], loads: Any = ffi.NULL) -> None:
        self._share, self._linear = share, list[tuple[InCells, Any]]()
        self._alive: list[Any] = [parts]
        self._forces = ffi.new("force_in_cells[]", len(parts))
        vectors: dict[Any, Any] = {}  # places of them, and of those of the accepted step
        for c, one in zip(self._forces, parts, strict=True):
            each, lanes, other = one.form.keep_entries()
            c.kind, c.factor, c.number, c.lanes = one.kind, one.factor, len(one.order), lanes
            if not np.array_equal(one.order, np.arange(len(share.cells))):
                order = one.order.astype(np.int32)
                c.cell = integers(order)
                self._alive.append(order)
            if one.vector is None:
                c.latest, c.entries = each, ffi.addressof(c, "accepted")
            else:
                other = np.zeros(share.size)
                if one.vector not in vectors:
                    c.latest, vectors[one.vector] = one.vector, ffi.addressof(c, "accepted")
                c.vector, c.entries, c.form = vectors[one.vector], each, one.form.cells
                if c.form == ffi.NULL:
                    self._linear.append((one, c))
            c.accepted = doubles(other)
            self._alive.append((each, other))
        nodes = share.grid.mesh.nodes
        self.c = fill(
            ffi.new("cell_forces *"), cells=len(share.cells), nodes=len(nodes), forces=len(parts),
            force=self._forces, loads=loads, from_middle=nodes[[0, -1, *range(1, len(nodes) - 1)]] - 0.5,
        )  # fmt: skip

    def accept(self) -> None:
        """Take the forces of the latest residual as those of the accepted step."""
        lib.accept_cell_forces(self.c)

    def begin(self, numbers: Array | None) -> None:
        """Begin with given numbers, else with the stresses of the latest residual and no more."""
        if numbers is not None:
            fill(self.c, given=numbers)
            return
        for c in self._forces:
            if c.kind == lib.STRESS and c.latest:
                c.accepted, c.latest[0] = c.latest[0], c.accepted

    def __call__(self) -> Array:
        """Compute ``cell_number`` of loops.h for the cells of this process; (9, num_cells)."""
        size = self._share.size
        for one, c in self._linear:
            vector = np.frombuffer(ffi.buffer(c.vector[0], 8 * size))
            one.form.add(vector, np.zeros(size))
        out: Array = np.empty((lib.CELL_NUMBERS, self.c.cells))
        lib.find_cell_forces(self.c, doubles(out))
        return out

    def remember(self, memory: Memory) -> None:
        """Save or restore what is known of the accepted step."""
        numbers = memory.rows("forces of cells", self._share.cells, self().T)
        fill(self.c, given=np.ascontiguousarray(numbers.T))
