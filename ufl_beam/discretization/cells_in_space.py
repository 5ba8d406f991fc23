# SPDX-License-Identifier: MIT
"""Cells of beams in space: axes, rotary inertia, mass matrix; quaternions of nodes in results."""

from __future__ import annotations

import numpy as np
from scipy.spatial.transform import Rotation

from ufl_beam.arrays import Array, Index
from ufl_beam.compiled.csr import Csr
from ufl_beam.discretization.dof_numbering import DofNumbering, Vectors
from ufl_beam.discretization.function_spaces import Fields
from ufl_beam.model.bodies import Place

TURNS = "turns"
"""Column of a state with the quaternions of the nodes; the first number is the real part minus 1,
so that all numbers begin with zero."""


def cell_axes(fields: Fields) -> tuple[Array, Array]:
    """Return the lengths of cells, and their axes as columns; (n,), m; (n, 3, 3)."""
    numbering = fields.subdomain.numbering
    start, end = fields.coordinates().transpose(1, 0, 2)
    lengths = np.linalg.norm(end - start, axis=1)
    first = (end - start) / lengths[:, None]
    beams = numbering.beam_of_cell[fields.subdomain.cells[fields.order]]
    up = np.reshape([beam.up for beam in numbering.scene.beams], (-1, 3))[beams]
    second = up - np.sum(up * first, axis=1)[:, None] * first
    second /= np.linalg.norm(second, axis=1)[:, None]
    return lengths, np.stack([first, second, np.cross(first, second)], axis=2)


def quaternions(axes: Array) -> Array:
    """Return the unit quaternions, real part first, of rotation matrices; (n, 4)."""
    return np.roll(Rotation.from_matrix(axes).as_quat(), 1, axis=1)


def rotary_inertia(fields: Fields) -> Array:
    """Return the rotary inertia per length about the axes 1, 2, 3 of cells; (n, 3); kg m."""
    third, second = np.nan_to_num(fields.section_values("rhoI", "rhoI2").astype(float)).T
    return np.stack([second + third, second, third], axis=1)


def mass_matrix_in_space(fields: Fields) -> Csr:
    """Assemble the consistent mass matrix; rotations are about axes of the nodes."""
    A, n, (lengths, axes) = fields.matrix(), len(fields.order), cell_axes(fields)
    blocks = np.zeros((n, 6, 6))
    blocks[:, range(3), range(3)] = fields.section_values("rhoA")
    blocks[:, 3:, 3:] = np.einsum("nik,nk,njk->nij", axes, rotary_inertia(fields), axes)
    shares = np.array([[2.0, 1.0], [1.0, 2.0]]) / 6
    cells = np.einsum("n,ab,nij->niajb", lengths, shares, blocks).reshape(n, 12, 12)
    dofs = fields.cell_dofs
    rows, columns = (np.broadcast_to(x, cells.shape) for x in (dofs[:, :, None], dofs[:, None, :]))
    np.add.at(A.data, A.positions(rows.ravel(), columns.ravel()), cells.ravel())
    return A


def turns_at(numbering: DofNumbering, place: Place, turns: Vectors) -> Rotation:
    """Return the rotations of the frame at a place; the column ``turns`` is (n, num_nodes, 4)."""
    nodes, weights = numbering.weights(place)
    a, b = (_rotations(turns[:, node]) for node in nodes)
    return a * Rotation.from_rotvec(weights[1] * (a.inv() * b).as_rotvec())


def _rotations(turns: Array) -> Rotation:
    return Rotation.from_quat(np.roll(turns + np.eye(4)[0], -1, axis=1))


def of_vertices(numbering: DofNumbering) -> Index:
    """Return a cell of each vertex, and whether the vertex is its first or second; (n, 2)."""
    flat, found = numbering.cells.ravel(), np.zeros((len(numbering.points), 2), dtype=np.int64)
    vertices, first = np.unique(flat, return_index=True)
    found[vertices] = np.column_stack([first // 2, first % 2])
    return found
