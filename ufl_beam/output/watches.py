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
from ufl_beam.discretization.partition import Share
from ufl_beam.dolfinx_compat import fem
from ufl_beam.mechanics.kinematics import split
from ufl_beam.model.mesh_options import Mesh
from ufl_beam.output.forces_along_cells import ForcesAlongCells, gauss_rule
from ufl_beam.terms.cell_forces import CellForces

EXTENT = ("low", "high", "time_low", "time_high")
"""Fields of ``extent`` of loops.h."""


class AlongCells(NamedTuple):
    """Form of the section forces in points of cells, and what it depends on besides motions.

    Attributes:
        numbers: Forces of the cells, the first ones of ``cell_number`` of loops.h.
        turns: Angles from the cells to the axis at their ends.
        first: How many numbers: at both ends of cells, what is between them does not matter.
    """

    form: ufl.Form
    numbers: fem.Function
    turns: fem.Function
    first: int


@stated
def along_cells(of: Element, parts: tuple[float, ...], works: bool) -> AlongCells:
    """State what :class:`ForcesAlongCells` computes, in a configuration q1; entries (N, V, M)."""
    axis, h = of.axis, of.axis.h
    between = set(parts) > {0.0, 1.0}
    first = lib.CELL_NUMBERS if between else lib.COUPLE
    numbers, turns, values = (of.in_cells(n) for n in (first, 2, 3 * len(parts)))
    points, weights, _ = gauss_rule(element_mesh(of))

    def vector(x: int, y: int) -> tuple[Expr, Expr]:
        """Two of the numbers as a vector in the axes of the cell."""
        a = ufl.as_vector([numbers[x], numbers[y]])
        return ufl.dot(a, axis.t0), ufl.dot(a, axis.n0)

    def times(a: Any, x: tuple[Expr, Expr]) -> tuple[Expr, Expr]:
        return a * x[0], a * x[1]

    def plus(x: tuple[Expr, Expr], y: tuple[Expr, Expr]) -> tuple[Expr, Expr]:
        return x[0] + y[0], x[1] + y[1]

    def cross(x: tuple[Expr, Expr], y: tuple[Expr, Expr]) -> Expr:
        return x[0] * y[1] - x[1] * y[0]

    start, end = vector(lib.START_X, lib.START_Y), vector(lib.END_X, lib.END_Y)
    at_start, at_end = numbers[lib.START_M], numbers[lib.END_M]
    all_of_it, couple, skew = times(-1.0, plus(start, end)), 0.0, (0.0, 0.0)
    if between:
        couple, skew = -numbers[lib.COUPLE], times(-6.0, vector(lib.SKEW_X, lib.SKEW_Y))
    u, _ = split(of.q1)
    nodes = [axis.at_nodes(x) for x in (ufl.dot(u, axis.t0), ufl.dot(u, axis.n0), of.q1[2])]

    def way(part: float) -> tuple[Expr, Expr]:
        """Derivative of the place by the part."""
        slopes = [float(x) for x in element_mesh(of).slopes(part)]
        x, y = (sum(a * b for a, b in zip(slopes, of_nodes, strict=True)) for of_nodes in nodes[:2])
        return h + x, y

    def force(part: float, skew: tuple[Expr, Expr]) -> tuple[Expr, Expr]:
        linear = plus(times(-1.0, start), times(-part, all_of_it))
        return plus(linear, times(part * (1 - part), skew))

    pairs = [(float(a), float(b)) for a, b in zip(points, weights, strict=True)]
    missed = at_start + at_end + couple + sum(b * cross(way(a), force(a, skew)) for a, b in pairs)
    if works:
        x, y = (sum(6 * b * a * (1 - a) * way(a)[i] for a, b in pairs) for i in (0, 1))
        skew = plus(skew, times(6 * missed / (x**2 + y**2), (y, -x)))
    else:
        couple = couple - missed
    found = []
    for part in parts:
        M, (x, y) = at_end, end
        if part < 1:
            levers = sum(b * cross(way(a * part), force(a * part, skew)) for a, b in pairs)
            M, (x, y) = -at_start - part * (levers + couple), force(part, skew)
        weight = [float(x) for x in element_mesh(of).weights(part)]
        turn = (1 - part) * turns[0] + part * turns[1]
        ψ = sum(a * b for a, b in zip(weight, nodes[2], strict=True)) + turn
        c, s = ufl.cos(ψ), ufl.sin(ψ)
        found += [c * x + s * y, c * y - s * x, M]
    z = ufl.TestFunction(values.function_space)
    return AlongCells(ufl.dot(ufl.as_vector(found), z) / h * of.dx(1), numbers, turns, first)


def element_mesh(of: Element) -> Mesh:
    """The mesh of one cell of an element."""
    return Mesh(degree=of.degree)


class Watch:
    """Extremes of section forces at parts of cells, and of motions, of a scene on one process.

    Attributes:
        c: ``watch`` of loops.h.
        seen: Number of steps up to the state that was taken in last.
    """

    def __init__(
        self, share: Share, cell_forces: CellForces, along: ForcesAlongCells, parts: Array
    ) -> None:
        fields, size = Fields(share), share.size
        works = bool(share.grid.scene.works)
        of = along_cells(fields.element, tuple(map(float, parts)), works)
        self._kernel = fields.hot_kernel(of.form, fields.element.q1)
        self._kernel.put(of.turns, along.turns)
        self._kernel.put(of.numbers, np.zeros(of.first))
        _, self._lanes, spare = self._kernel.keep_entries()
        self._cells, self._points, self._forces = len(along.turns), len(parts), cell_forces
        sizes = spare.size, size
        self._extents = [dict(zip(EXTENT, np.zeros((4, n)), strict=True)) for n in sizes]
        cell_forces.keep_latest()
        self.c = struct(
            "watch", forces=cell_forces.c, along=self._kernel.cells, between=along.between,
            at_numbers=self._kernel.position(of.numbers), q=np.zeros(size),
            numbers=np.zeros(lib.CELL_NUMBERS * self._cells), first=of.first,
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
