# SPDX-License-Identifier: MIT
"""Cells of beams in space: axes, rotary inertia, mass matrix; quaternions of nodes in results."""

from __future__ import annotations

import numpy as np
from scipy.spatial.transform import Rotation

from ufl_beam.arrays import Array, Index
from ufl_beam.compiled.csr import Csr
from ufl_beam.discretization.dof_numbering import DofNumbering, Vectors, values_at
from ufl_beam.discretization.function_spaces import Fields
from ufl_beam.model.bodies import AttachmentPoint, BodyPoint, arm

TURNS = "turns"
"""Column of a state with the quaternions of the nodes; the first number is the real part minus 1,
so that all numbers begin with zero."""


STIFFNESS_IN_SPACE = "EA", "GA", "GA3", "GJ", "EI2", "EI"
"""Stiffnesses for the strains along the axes 1, 2, 3 of a section, and curvatures about them."""


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


def rotary_inertia(fields: Fields, axes: Array) -> Array:
    """Return the tensors of rotary inertia per length of cells; (n, 3, 3); kg m."""
    third, second = np.nan_to_num(fields.section_values("rhoI", "rhoI2").astype(float)).T
    moments = np.stack([second + third, second, third], axis=1)
    return np.asarray(np.einsum("nik,nk,njk->nij", axes, moments, axes))


def mass_matrix_in_space(fields: Fields) -> Csr:
    """Assemble the consistent mass matrix; rotations are about axes of the nodes."""
    A, n, (lengths, axes) = fields.matrix(), len(fields.order), cell_axes(fields)
    blocks = np.zeros((n, 6, 6))
    blocks[:, range(3), range(3)] = fields.section_values("rhoA")
    blocks[:, 3:, 3:] = rotary_inertia(fields, axes)
    shares = np.array([[2.0, 1.0], [1.0, 2.0]]) / 6
    cells = np.einsum("n,ab,nij->niajb", lengths, shares, blocks).reshape(n, 12, 12)
    dofs = fields.cell_dofs
    rows, columns = (np.broadcast_to(x, cells.shape) for x in (dofs[:, :, None], dofs[:, None, :]))
    np.add.at(A.data, A.positions(rows.ravel(), columns.ravel()), cells.ravel())
    for body in fields.subdomain.numbering.scene.bodies:
        own = fields.subdomain.local(fields.subdomain.numbering.node(body.middle))
        inertia = np.zeros((6, 6))
        inertia[range(3), range(3)], inertia[3:, 3:] = body.mass, body.tensor
        np.add.at(A.data, A.positions(np.repeat(own, 6), np.tile(own, 6)), inertia.ravel())
    return A


def strains_in_space(fields: Fields, q: Array, turns: Array) -> Array:
    """Return the strains along, and curvatures about, axes 1, 2, 3 of cells; (n, 6); 1, 1/m."""
    numbering, (lengths, axes) = fields.subdomain.numbering, cell_axes(fields)
    a, b = numbering.cells.T
    at = numbering.points + q[numbering.dofs[: len(numbering.points), :3]]
    first, second = _rotations(turns[a]), _rotations(turns[b])
    between = (first.inv() * second).as_rotvec()
    middle = first * Rotation.from_rotvec(between / 2)
    slope = middle.inv().apply((at[b] - at[a]) / lengths[:, None])
    both = (np.einsum("nik,ni->nk", axes, x) for x in (slope, between / lengths[:, None]))
    return np.asarray(np.hstack([*both]) - np.eye(6)[0])


def momentum_in_space(numbering: DofNumbering, q: Array, p: Array, turns: Array) -> Array:
    """Return momentum and angular momentum about the origin of products p of mass and rates; (6,).

    The shapes of ``q`` and ``p`` are (size,), of ``turns`` (nodes, 4).
    """
    dofs = np.vstack([numbering.dofs, numbering.dofs_of_bodies])
    centres = np.reshape([body.center for body in numbering.scene.bodies], (-1, 3))
    ground = np.zeros((len(dofs) - len(numbering.points) - len(centres), 3))
    points = np.vstack([numbering.points, centres, ground])
    _, linear = np.unique(dofs[:, 0], return_index=True)
    _, angular = np.unique(dofs[:, 3], return_index=True)
    at, forces = points[linear] + q[dofs[linear, :3]], p[dofs[linear, :3]]
    spins = _rotations(turns[angular]).apply(p[dofs[angular, 3:]])
    return np.append(forces.sum(axis=0), np.cross(at, forces).sum(axis=0) + spins.sum(axis=0))


def turns_at(numbering: DofNumbering, place: AttachmentPoint, turns: Vectors) -> Rotation:
    """Return the rotations of the frame at a place; the column ``turns`` is (n, nodes, 4)."""
    if isinstance(place, BodyPoint):
        body = numbering.scene.rigid_bodies.index(place.body)
        return _rotations(turns[:, len(numbering.points) + body])
    nodes, weights = numbering.weights(place)
    a, b = (_rotations(turns[:, node]) for node in nodes)
    return a * Rotation.from_rotvec(weights[1] * (a.inv() * b).as_rotvec())


def velocity_in_space(
    numbering: DofNumbering, place: AttachmentPoint, velocities: Vectors, turns: Vectors
) -> Array:
    """Return velocities of a place, and angular velocities about axes of its node; (n, 6)."""
    motion = values_at(numbering, place, velocities)
    frames = turns_at(numbering, place, turns).as_matrix()
    motion[:, :3] += np.einsum("nij,nj->ni", frames, np.cross(motion[:, 3:], arm(place)))
    return motion


def turned_further(numbering: DofNumbering, turns: Array, change: Array) -> Array:
    """Return :data:`TURNS` after changes of the unknowns, which are Cayley vectors; (nodes, 4)."""
    dofs = np.vstack([numbering.dofs, numbering.dofs_of_bodies])[: len(turns), 3:]
    steps = Rotation.from_quat(np.pad(change[dofs] / 2, ((0, 0), (0, 1)), constant_values=1.0))
    quaternions = (_rotations(turns) * steps).as_quat()
    return np.asarray(np.roll(quaternions, 1, axis=1) - np.eye(4)[0])


def by_rotation(numbering: DofNumbering, turns: Array) -> Array:
    """Return the quaternions of :data:`TURNS` at the first rotations of nodes; (size, 4)."""
    found: Array = np.zeros((numbering.size, 4))
    found[np.vstack([numbering.dofs, numbering.dofs_of_bodies])[: len(turns), 3]] = turns
    return found


def rotation_vectors(turns: Array) -> Array:
    """Return rotation vectors, of angles up to π; (n, 3); rad."""
    return np.asarray(_rotations(turns).as_rotvec())


def _rotations(turns: Array) -> Rotation:
    return Rotation.from_quat(np.roll(turns + np.eye(4)[0], -1, axis=1))


def of_vertices(numbering: DofNumbering) -> Index:
    """Return a cell of each vertex, and whether the vertex is its first or second; (n, 2)."""
    flat, found = numbering.cells.ravel(), np.zeros((len(numbering.points), 2), dtype=np.int64)
    vertices, first = np.unique(flat, return_index=True)
    found[vertices] = np.column_stack([first // 2, first % 2])
    return found
