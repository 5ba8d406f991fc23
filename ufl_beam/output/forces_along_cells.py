# SPDX-License-Identifier: MIT
"""Section forces along cells, by equilibrium of each cell in the equation of a step.

At both ends of a cell they are its forces on the nodes there: of stresses, inertia, damping, loads
and works, see :mod:`ufl_beam.terms.cell_forces`.  So they are in equilibrium with supports, joints
and what else acts at nodes, to the residual of the step.  Between the ends they change by what acts
along the cell: its resultant, its couple, and how it is distributed, as far as that is known.
"""

from __future__ import annotations

from functools import cache
from typing import Any

import numpy as np

from ufl_beam.arrays import Array, Complex, Index
from ufl_beam.compiled.c_library import lib

MIDDLE: Array = np.full(1, 0.5)
"""The middle of a cell, as a part of it."""

Cells = Index | slice


class ForcesAlongCells:
    """(N, V, M) in points of the cells of a grid.

    Args:
        grid: Cells and numbering.
        between: Part of a step at whose configuration its forces are in equilibrium.

    Attributes:
        angles: Of the undeformed axis at both ends of the cells; (num_cells, 2); rad.
    """

    def __init__(self, grid: Any, between: float) -> None:
        mesh, nodes = grid.mesh, grid.nodes_of_cells
        start, end, *inner = range(nodes.shape[1])
        self._mesh, self.between, self._along = mesh, between, [start, *inner, end]
        self._works = bool(grid.scene.works)
        places = grid.points[nodes[:, self._along]]
        self._places: Complex = places[..., 0] + 1j * places[..., 1]
        angles = np.asarray(np.angle(self._places[:, -1] - self._places[:, 0]), np.float64)
        self.angles = angles[:, None] + _turns(grid, angles)

    def __call__(
        self,
        cells: Cells,
        parts: Array,
        numbers: Array,
        q: Array,
        before: Array | None,
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
        forces = numbers[[lib.START_X, lib.END_X]] + 1j * numbers[[lib.START_Y, lib.END_Y]]
        moments = numbers[[lib.START_M, lib.END_M]]
        all_of_it, couple = -forces.sum(axis=0), -numbers[lib.COUPLE]
        skew = -6 * (numbers[lib.SKEW_X] + 1j * numbers[lib.SKEW_Y])
        points, weights, slopes = gauss_rule(self._mesh)
        ways = x @ slopes.T  # derivatives of the place by the part, in points of the rule

        def force(at: Array) -> Complex:
            """Section force, as a vector of the plane; (num_cells, len(at))."""
            linear = -forces[0][:, None] - np.multiply.outer(all_of_it, at)
            return np.asarray(linear + np.multiply.outer(skew, at * (1 - at)))

        # What moments at both ends say besides: couples, or how works are distributed across.
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
        angles = self.angles[cells] @ np.array([1 - parts, parts])
        angles += q[:, 2] @ self._mesh.weights(parts).T
        F = force(parts) * np.exp(-1j * angles)
        return np.stack([F.real, F.imag, M], axis=2)


@cache
def gauss_rule(mesh: Any) -> tuple[Array, Array, Array]:
    """Points of Gauss's rule on a cell, their weights, and slopes there; exact for all here."""
    points, weights = np.polynomial.legendre.leggauss(3)
    return (1 + points) / 2, weights / 2, mesh.slopes((1 + points) / 2)


def _turns(grid: Any, angles: Array) -> Array:
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
