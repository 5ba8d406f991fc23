# SPDX-License-Identifier: MIT
"""Extremes that C takes in after each step."""

from __future__ import annotations

from typing import Any

import numpy as np

from ufl_beam.arrays import Array
from ufl_beam.compiled.c_library import doubles, lib, struct
from ufl_beam.compiled.simd_kernels import in_batches
from ufl_beam.discretization.function_spaces import CompiledFields, Fields
from ufl_beam.output.forces_along_cells import ForcesAlongCells, along_cells
from ufl_beam.terms.cell_forces import CellForces

EXTENT = ("low", "high", "time_low", "time_high")
"""Fields of ``extent`` of loops.h."""


class Watch:
    """Extremes of section forces at parts of cells, and of motions, of a scene on one process.

    Attributes:
        c: ``watch`` of loops.h.
        seen: Number of steps up to the state that was taken in last.
    """

    def __init__(
        self, fields: Fields, cell_forces: CellForces, along: ForcesAlongCells, parts: Array
    ) -> None:
        element, grid, size = fields.element, fields.share.grid, fields.share.size
        fields = CompiledFields(fields.share)
        stated = along_cells(fields.element, tuple(map(float, parts)), bool(grid.scene.works))
        self._kernel = fields.hot_kernel(stated.form, fields.element.q1)
        self._kernel.put(stated.turns, along.turns)
        self._kernel.put(stated.numbers, np.zeros(stated.first))
        _, self._lanes, spare = self._kernel.keep_entries()
        self._cells, self._points, self._forces = len(along.turns), len(parts), cell_forces
        self._extents = [
            dict(zip(EXTENT, np.zeros((4, n)), strict=True)) for n in (spare.size, size)
        ]
        cell_forces.keep_latest()
        self.c = struct(
            "watch", forces=cell_forces.c, along=self._kernel.cells, between=along.between,
            at_numbers=self._kernel.position(stated.numbers), q=np.zeros(size),
            numbers=np.zeros(lib.CELL_NUMBERS * self._cells), first=stated.first,
            in_order=cell_forces.in_order(self._lanes),
        )  # fmt: skip
        for c, extent in zip((self.c.of_forces, self.c.of_motion), self._extents, strict=True):
            c.size = len(extent["low"])
            for name, values in extent.items():
                setattr(c, name, doubles(values))
        self.seen = -1

    def take(self, parts: int, t: float, q: Array, before: Array) -> None:
        """Take in the state after so many steps, if C has not."""
        if parts == self.seen:
            return
        numbers = self._forces(q, before)
        given, self._forces.c.given = self._forces.c.given, doubles(numbers)
        if self.seen < 0:
            for extent in self._extents:
                extent["low"].fill(np.inf)
                extent["high"].fill(-np.inf)
        lib.watch_step(self.c, 0, t, doubles(before), doubles(q))
        self._forces.c.given = given
        self.seen = parts

    def begin(self, parts: int, extents: Any) -> None:
        """Go on from extremes of forces and motions, as :meth:`extents` returns them."""
        for to, of in zip(self._extents, extents, strict=True):
            for name, values in zip(EXTENT, of, strict=True):
                batches = in_batches(values, self._lanes) if values.ndim == 3 else values
                to[name][:] = batches.ravel()
        self.seen = parts

    def extents(self) -> list[list[Array]]:
        """Low, high and their times: of forces, (num_cells, points, 3), and of motions, (size,)."""
        forces, motion = ([of[name] for name in EXTENT] for of in self._extents)
        shape = -1, 3 * self._points, self._lanes
        in_cells = [
            x.reshape(shape).transpose(0, 2, 1).reshape(-1, self._points, 3)[: self._cells].copy()
            for x in forces
        ]
        return [in_cells, [x.copy() for x in motion]]
