# SPDX-License-Identifier: MIT
"""Section forces along cells, by equilibrium of each cell with its nodal forces and loads."""

from __future__ import annotations

from collections.abc import Callable
from functools import singledispatch
from typing import NamedTuple

import numpy as np

from ufl_beam.arrays import Array, Complex, Snapshot
from ufl_beam.discretization.dof_numbering import Grid
from ufl_beam.model.loads import Gravity, LineLoad, Load, RotatingFrame
from ufl_beam.model.time_functions import value_at
from ufl_beam.one_line import one_line

GAUSS: Array = (1 + np.polynomial.legendre.leggauss(3)[0]) / 2
WEIGHTS: Array = np.polynomial.legendre.leggauss(3)[1] / 2
"""Points from 0 to 1 and their weights, exact for all polynomials here."""


class Diagram(NamedTuple):
    """Section forces along a beam; at a vertex the values before and after it.

    Attributes:
        s: Parameter of the beam, from 0 at its start to 1; (num_cells points,).
        N: Axial force, positive in tension; N.
        V: Shear force, along the normal to the left of the direction of the beam; N.
        M: Bending moment, positive with tension to the right of that direction; N m.

    Example:
        >>> diagram = solution.diagram(beam, points=2)  # at both ends of the four cells
        >>> print(diagram.s[:4], diagram.M[:4].round(-3))
        [0.   0.25 0.25 0.5 ] [-200000. -150000. -150000. -100000.]
    """

    s: Array
    N: Array
    V: Array
    M: Array

    def __repr__(self) -> str:
        return one_line(self)


class ForcesAlongCells:
    """(N, V, M) along all cells, in the state that was asked for last."""

    def __init__(self, grid: Grid, in_points: Callable[[Snapshot], Array]) -> None:
        self._grid, self._in_points = grid, in_points
        self._of: Snapshot | None = None
        self._found: Array = np.empty((0, 0, 3))

    def __call__(self, state: Snapshot, points: int) -> Array:
        """Section forces in equally spaced points; (num_cells, points, 3); N, N, N m."""
        if self._of is not state or self._found.shape[1] != points:
            parts = np.arange(points) / (points - 1)
            self._of = state
            self._found = forces_along_cells(self._grid, state, self._in_points(state), parts)
        return self._found


def forces_along_cells(grid: Grid, state: Snapshot, forces: Array, parts: Array) -> Array:
    """Compute (N, V, M) at parts of all cells from those in the Gauss points.

    The nodal forces of a cell are the section forces at its ends, but for the share of its loads.
    From there N and V change by the loads, and M by N and V with the lever arms of the deformed
    axis.  Loads follow from the scene in statics, and from equilibrium of the nodes within cells.

    Args:
        grid: Cells and numbering.
        state: Configuration and time.
        forces: (N, V, M) in the Gauss points; (num_cells, degree, 3); N, N, N m.
        parts: From 0 at the start of a cell to 1 at its end; (points,).
    """
    mesh, ends = grid.mesh, grid.points[grid.cells]
    start, end, *between = grid.nodes_of_cells.T
    nodes = np.column_stack([start, *between, end])
    # Vectors of the plane are complex numbers.
    x = (grid.points[nodes] + state.q[grid.dofs[nodes, :2]]) @ (1, 1j)
    ψ, chord = state.q[grid.dofs[nodes, 2]], (ends[:, 1] - ends[:, 0]) @ (1, 1j)

    def tangent(at: Array) -> Complex:
        """Direction of the axial force."""
        return np.asarray(np.exp(1j * (np.angle(chord)[:, None] + ψ @ mesh.weights(at).T)))

    def by_lever_arms(at: Array, F: Complex) -> Array:
        """Derivative of the moment by the part, as far as it comes of forces; N m."""
        return np.asarray(-np.imag(np.conj(x @ mesh.slopes(at).T) * F))

    at, weights = (1 + np.polynomial.legendre.leggauss(mesh.degree)[0]) / 2, mesh.point_weights
    φ, dφ = mesh.weights(at), mesh.slopes(at)
    F = (forces[:, :, 0] + 1j * forces[:, :, 1]) * tangent(at)
    nodal = (weights[:, None] * dφ).T @ np.stack([F, forces[:, :, 2]], axis=2)
    nodal[:, :, 1] += (weights * by_lever_arms(at, F)) @ φ

    # Loads are linear along a cell, by their values at its ends.
    shares = (WEIGHTS[:, None] * mesh.weights(GAUSS)).T @ np.column_stack([1 - GAUSS, GAUSS])
    load = np.abs(chord)[:, None, None] * _loads(grid, state)
    load = load + np.linalg.pinv(shares[1:-1]) @ (nodal - shares @ load)[:, 1:-1]
    at_start = (shares @ load - nodal)[:, :1]

    def resultants(at: Array) -> Complex:
        """Force, and moment without that of forces; (num_cells, len(at), 2)."""
        return np.asarray(at_start - np.column_stack([at - at**2 / 2, at**2 / 2]) @ load)

    F, M = np.moveaxis(resultants(parts), 2, 0)
    before = (parts[:, None] * GAUSS).ravel()
    change = by_lever_arms(before, resultants(before)[:, :, 0])
    moments = M.real + parts * (change.reshape(*F.shape, len(GAUSS)) @ WEIGHTS)
    F = F * np.conj(tangent(parts) * np.exp(1j * _turns(grid, np.angle(chord), parts)))
    return np.stack([F.real, F.imag, moments], axis=2)


def _turns(grid: Grid, angles: Array, parts: Array) -> Array:
    """Angles to the smooth axis of a curved beam from its straight cells; (num_cells, points); rad.

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
    return np.asarray(np.nan_to_num(np.column_stack(both)) @ np.array([1.0 - parts, parts]))


def _loads(grid: Grid, state: Snapshot) -> Complex:
    """Force and moment per length at both ends of the cells; (num_cells, 2, 2); N/m, N m/m.

    The initial state of a static run bears none.  In dynamics loads and inertia act on the nodes.
    """
    total = np.zeros((len(grid.cells), 2, 2), dtype=np.complex128)
    if state.v is None and (state.q.any() or state.reactions.any()):
        for load in grid.scene.loads:
            _add(load, value_at(load.time, state.t, load), grid, state.q, total)
    return total


@singledispatch
def _add(load: Load, factor: float, grid: Grid, q: Array, total: Complex) -> None:
    """Add a load along beams to those of :func:`_loads`; other loads act on vertices."""


@_add.register
def _(load: LineLoad, factor: float, grid: Grid, q: Array, total: Complex) -> None:
    f_x, f_y = load.force
    total[grid.cells_of(load.beam)] += factor * np.array([f_x + 1j * f_y, load.moment])


@_add.register
def _(load: Gravity, factor: float, grid: Grid, q: Array, total: Complex) -> None:
    total[:, :, 0] += factor * _mass_per_length(grid)[:, None] * complex(*load.acceleration)


@_add.register
def _(load: RotatingFrame, factor: float, grid: Grid, q: Array, total: Complex) -> None:
    away = (grid.points[grid.cells] + q[grid.dofs[grid.cells, :2]] - load.about) @ (1, 1j)
    total[:, :, 0] += load.rate**2 * _mass_per_length(grid)[:, None] * away


def _mass_per_length(grid: Grid) -> Array:
    return np.array([beam.section.rhoA for beam in grid.scene.beams])[grid.beam_of_cell]
