# SPDX-License-Identifier: MIT
"""Section forces along cells, by equilibrium of each cell in the equation of a step.

At both ends of a cell they are its forces on the nodes there: of stresses, inertia, damping, loads and
works, see :mod:`ufl_beam.terms.cell_forces`.  So they are in equilibrium with supports, joints and what
else acts at nodes, to the residual of the step.  Between the ends they change by what acts along the
cell, as far as it is known: its resultant, its couple, and how it is distributed.
"""

from __future__ import annotations

from functools import cache
from typing import Any, NamedTuple

import numpy as np
import ufl
from ufl.core.expr import Expr

from ufl_beam.arrays import Array, Complex, Index
from ufl_beam.compiled.c_library import lib
from ufl_beam.discretization.compiled_forms import stated
from ufl_beam.discretization.dof_numbering import Grid
from ufl_beam.discretization.function_spaces import Element
from ufl_beam.dolfinx_compat import fem
from ufl_beam.mechanics.kinematics import split
from ufl_beam.model.mesh_options import Mesh

MIDDLE: Array = np.array([0.5])
"""The middle of a cell, as a part of it."""

Cells = Index | slice


class ForcesAlongCells:
    """(N, V, M) in points of the cells of a grid.

    Args:
        grid: Cells and numbering.
        between: Part of a step at whose configuration its forces are in equilibrium.
    """

    def __init__(self, grid: Grid, between: float) -> None:
        mesh, nodes = grid.mesh, grid.nodes_of_cells
        start, end, *inner = range(nodes.shape[1])
        self._mesh, self.between, self._along = mesh, between, [start, *inner, end]
        self._works = bool(grid.scene.works)
        self._places: Complex = grid.points[nodes[:, self._along]] @ (1, 1j)
        self._angles: Array = np.angle(self._places[:, -1] - self._places[:, 0])
        self.turns = _turns(grid, self._angles)

    def __call__(
        self, cells: Cells, parts: Array, numbers: Array, q: Array, before: Array | None
    ) -> Array:
        """Compute them at parts of cells, from 0 at the start to 1 at the end; N, N, N m.

        Args:
            cells: Numbers of the cells, or of one cell at many times.
            parts: Parts; (points,).
            numbers: Forces of the cells, ``cell_number`` of loops.h; (9, num_cells).
            q: Their configurations (u, v, ψ) in the nodes; (num_cells, 3, degree + 1).
            before: Those at the beginning of the step; none if they do not matter.

        Returns:
            (N, V, M); (num_cells, points, 3).
        """
        if before is not None:
            q = (1 - self.between) * before + self.between * q
        q = q[:, :, self._along]
        x = self._places[cells] + q[:, 0] + 1j * q[:, 1]
        forces, moments = (
            numbers[[lib.START_X, lib.END_X]] + 1j * numbers[[lib.START_Y, lib.END_Y]],
            numbers[[lib.START_M, lib.END_M]],
        )
        all_of_it, couple = -forces.sum(axis=0), -numbers[lib.COUPLE]
        skew = -6 * (numbers[lib.SKEW_X] + 1j * numbers[lib.SKEW_Y])
        points, weights, slopes = _rule(self._mesh)
        ways = x @ slopes.T  # derivatives of the place by the part, in points of the rule

        def force(at: Array) -> Complex:
            """Section force, as a vector of the plane; (num_cells, len(at))."""
            linear = -forces[0][:, None] - np.multiply.outer(all_of_it, at)
            return np.asarray(linear + np.multiply.outer(skew, at * (1 - at)))

        # What the moments at both ends say besides: couples, or how works are distributed across.
        missed = moments.sum(axis=0) + couple + np.imag(ways.conj() * force(points)) @ weights
        if self._works:
            way = 6 * (ways * (points * (1 - points))) @ weights
            skew -= 6j * way * missed / np.abs(way) ** 2
        else:
            couple -= missed
        before_point = np.multiply.outer(parts, points).ravel()
        lever = (x @ self._mesh.slopes(before_point).T).conj() * force(before_point)
        lever = parts * (np.imag(lever).reshape(len(x), len(parts), len(points)) @ weights)
        M = -moments[0][:, None] - lever - np.multiply.outer(couple, parts)
        turns = self.turns[cells] @ np.array([1 - parts, parts])
        angles = self._angles[cells, None] + turns + q[:, 2] @ self._mesh.weights(parts).T
        F = force(parts) * np.exp(-1j * angles)
        return np.stack([F.real, F.imag, M], axis=2)


class AlongCells(NamedTuple):
    """Form of the section forces in points of cells, with what it depends on besides configurations.

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
    points, weights, _ = _rule(element_mesh(of))

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


@cache
def _rule(mesh: Any) -> tuple[Array, Array, Array]:
    """Points of Gauss's rule on a cell, their weights, and slopes there; exact for all integrals."""
    points, weights = np.polynomial.legendre.leggauss(3)
    return (1 + points) / 2, weights / 2, mesh.slopes((1 + points) / 2)


def _turns(grid: Grid, angles: Array) -> Array:
    """Angles to the smooth axis of a curved beam from both ends of its cells; (num_cells, 2); rad.

    Vertices halve the angle between two cells, but at corners of the beam; it is linear in a cell.
    """
    half = np.angle(np.exp(1j * np.diff(angles))) / 2
    half[np.diff(grid.beam_of_cell) != 0] = np.nan
    for beam in grid.scene.beams:
        if beam.corners:
            at_corners = np.isin(grid.parameters(beam)[1:-1], beam.corners)
            half[grid.cells_of(beam)[:-1][at_corners]] = np.nan
    start, end = np.append(np.nan, -half), np.append(half, np.nan)
    # As a circle where there is no neighbour
    both = np.where(np.isnan(start), -end, start), np.where(np.isnan(end), -start, end)
    return np.nan_to_num(np.column_stack(both))
