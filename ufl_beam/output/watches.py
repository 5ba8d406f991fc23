# SPDX-License-Identifier: MIT
"""Extremes that C takes in after each step."""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
import ufl
from ufl.core.expr import Expr

from ufl_beam.arrays import Array
from ufl_beam.compiled.c_library import doubles, lib, struct
from ufl_beam.compiled.simd_kernels import in_batches
from ufl_beam.discretization.compiled_forms import stated
from ufl_beam.discretization.function_spaces import Element, Fields
from ufl_beam.dolfinx_compat import fem
from ufl_beam.model.mesh_options import Mesh
from ufl_beam.output.forces_along_cells import ForcesAlongCells, in_section, section_force
from ufl_beam.terms.cell_forces import CellForces

EXTENT = ("low", "high", "time_low", "time_high")
"""Fields of ``extent`` of loops.h."""


class AlongCells(NamedTuple):
    """Form of the section forces in points of cells, and what it depends on.

    At both ends of cells, displacements and what is between the ends do not matter.

    Attributes:
        motions: The last degrees of freedom of a cell: all, or rotations.
        numbers: Forces of the cells, the first ones of ``cell_number`` of loops.h.
        angles: :attr:`ForcesAlongCells.angles`.
        first: How many numbers.
        moves: How many degrees of freedom.
    """

    form: ufl.Form
    motions: fem.Function
    numbers: fem.Function
    angles: fem.Function
    first: int
    moves: int


@stated
def along_cells(of: Element, parts: tuple[float, ...], works: bool) -> AlongCells:
    """State :func:`section_force` as a form; its entries are (N, V, M)."""
    mesh, h, between = Mesh(degree=of.degree), of.axis.h, set(parts) > {0.0, 1.0}
    n = len(mesh.nodes)
    first, moves = (lib.CELL_NUMBERS, 3 * n) if between else (lib.COUPLE, n)
    # All are constant in cells: to interpolate in a cell would take longer than the rest.
    motions, numbers, angles, values = map(of.in_cells, (moves, first, 2, 3 * len(parts)))
    order = [0, *range(2, n), 1]  # of the nodes along a cell
    *displacements, rotations = ([motions[k + i] for i in order] for k in range(0, moves, n))

    def weighted(weights: Array, values: list[Expr]) -> Expr:
        return sum(float(a) * x for a, x in zip(weights, values, strict=True))

    def way(part: float) -> tuple[Any, Any]:
        x, y = h * of.axis.t0[0], h * of.axis.t0[1]
        if not between:
            return x, y
        u, v = (weighted(mesh.slopes(part), nodes) for nodes in displacements)
        return x + u, y + v

    known = [numbers[k] for k in range(first)] + [0.0] * (lib.CELL_NUMBERS - first)
    at, at_end = section_force(known, way, works=works), known[lib.END_X : lib.END_M + 1]
    found = list[Expr]()
    for part in parts:
        turn = weighted(mesh.weights(part), rotations)
        angle = (1 - part) * angles[0] + part * angles[1] + turn
        plane = at(part) if part < 1 else tuple(at_end)
        found += in_section(plane, ufl.cos(angle), ufl.sin(angle))
    form = ufl.dot(ufl.as_vector(found), ufl.TestFunction(values.function_space)) / h * of.dx(1)
    return AlongCells(form, motions, numbers, angles, first, moves)


class Watch:
    """Extremes of section forces at parts of cells, and of motions, of a scene on one process.

    Attributes:
        c: ``watch`` of loops.h.
        seen: Number of steps up to the state that was taken in last.
    """

    def __init__(
        self, fields: Fields, cell_forces: CellForces, along: ForcesAlongCells, between: float,
        parts: Array,
    ) -> None:  # fmt: skip
        size, works = fields.share.size, bool(fields.share.grid.scene.works)
        of = along_cells(fields.element, tuple(map(float, parts)), works)
        self._kernel = fields.hot_kernel(of.form, of.motions, fields.cell_dofs[:, -of.moves :])
        _, self._lanes, spare = self._kernel.keep_entries()
        self._cells, self._points, self._forces = len(along.angles), len(parts), cell_forces
        sizes = spare.size, size
        self._extents = [dict(zip(EXTENT, np.zeros((4, n)), strict=True)) for n in sizes]
        cell_forces.keep_latest()
        self.c = struct(
            "watch", forces=cell_forces.c, along=self._kernel.cells, between=between,
            angles=in_batches(along.angles, self._lanes), q=np.zeros(size), first=of.first,
            at_angles=self._kernel.position(of.angles),
            at_numbers=self._kernel.position(of.numbers),
            numbers=np.zeros(lib.CELL_NUMBERS * self._cells),
            some=np.zeros(lib.SOME * self._kernel.cells.width),
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
