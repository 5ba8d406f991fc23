# SPDX-License-Identifier: MIT
"""Cells of beams in space: axes, rotary inertia, mass matrix; quaternions of nodes in results."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import product
from typing import Any, NamedTuple

import numpy as np
from scipy.spatial.transform import Rotation

from ufl_beam.arrays import Array, Index
from ufl_beam.compiled.csr import Csr
from ufl_beam.discretization.dof_numbering import DofNumbering, Vectors, turned, values_at
from ufl_beam.discretization.function_spaces import STIFFNESS, Fields
from ufl_beam.mechanics.spatial_kinematics import FLIPPED
from ufl_beam.model.bodies import AttachmentPoint, BodyPoint, arm

TURNS = "turns"
"""Column of a state with the quaternions of the nodes; the first number is the real part minus 1,
so that all numbers begin with zero."""


STIFFNESS_IN_SPACE = STIFFNESS[3]
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
    for a, b in product((0, 1), repeat=2):
        entries = (lengths / (3 if a == b else 6))[:, None, None] * blocks
        dofs = fields.cell_dofs[:, a::2, None], fields.cell_dofs[:, None, b::2]
        rows, columns = (x.ravel() for x in np.broadcast_arrays(*dofs))
        np.add.at(A.data, A.positions(rows, columns), entries.ravel())
    for body, own in zip(*fields.subdomain.moving_bodies()[1:], strict=True):
        inertia = np.zeros((6, 6))
        inertia[range(3), range(3)], inertia[3:, 3:] = body.mass, body.tensor
        np.add.at(A.data, A.positions(np.repeat(own, 6), np.tile(own, 6)), inertia.ravel())
    subdomain = fields.subdomain
    for point in subdomain.numbering.scene.masses:
        along = subdomain.numbering.node(point.place)[:3]
        mine = subdomain.local(along[subdomain.owns(along)])
        np.add.at(A.data, A.positions(mine, mine), point.mass)
    return A


class CellsOfState(NamedTuple):
    """Cells in a state.

    Attributes:
        slopes: Derivatives of the position along the axes of cells; (n, 3).
        first: Rotations of the first nodes.
        between: Rotation vectors from node to node, in axes of the nodes; (n, 3); rad.
        lengths: Undeformed lengths; (n,); m.
        axes: Undeformed axes of cells as columns; (n, 3, 3).
    """

    slopes: Array
    first: Rotation
    between: Array
    lengths: Array
    axes: Array

    @classmethod
    def of(
        cls, numbering: DofNumbering, undeformed: tuple[Array, Array], q: Array, turns: Array
    ) -> CellsOfState:
        """Return the cells in the configuration ``q``, from their :func:`cell_axes`.

        ``turns`` are quaternions; (nodes, 4).
        """
        lengths, axes = undeformed
        a, b = numbering.cells.T
        at = numbering.points + q[numbering.dofs[: len(numbering.points), :3]]
        first = _rotations(turns[a])
        slopes = (at[b] - at[a]) / lengths[:, None]
        return cls(slopes, first, rotations_between(turns[a], turns[b]), lengths, axes)

    def frames(self, fraction: float) -> Rotation:
        """Return the rotations of the cross-sections at a fraction of the cells."""
        return self.first * Rotation.from_rotvec(fraction * self.between)

    def in_section(self, fraction: float, *vectors: Array) -> Array:
        """Return vectors (n, 3) in the axes 1, 2, 3 of the sections, side by side."""
        back = self.frames(fraction).inv()
        turned = [np.einsum("nik,ni->nk", self.axes, back.apply(x)) for x in vectors]
        return np.asarray(np.hstack(turned))

    def strains(self) -> Array:
        """Return the strains along, and curvatures about, axes 1, 2, 3; (n, 6); 1, 1/m."""
        curvatures = self.frames(0.5).apply(self.between / self.lengths[:, None])
        return np.asarray(self.in_section(0.5, self.slopes, curvatures) - np.eye(6)[0])

    def forces_on_axis(self, p: Sequence[float]) -> Array:
        """Return forces per deformed length times this length; (n, 3); N.

        They are along the axis, and normal to it in the directions of the axes 2 and 3.
        """
        middle = self.frames(0.5)
        second, third = (middle.apply(self.axes[:, :, i]) for i in (1, 2))
        normal = p[1] * np.cross(third, self.slopes) + p[2] * np.cross(self.slopes, second)
        return np.asarray(self.lengths[:, None] * (p[0] * self.slopes + normal))

    def section_forces(
        self, fractions: Array, resultants: Array, along: Array, *, in_scene: bool = False
    ) -> Array:
        """Return forces along, and moments about, axes 1, 2, 3 at fractions; (n, points, 6).

        At the ends they are the forces between cells and nodes, and in between they are in
        equilibrium with them.

        Args:
            fractions: Fractions from 0 at the start to 1 at the end; (points,).
            resultants: Products of stiffnesses and :meth:`strains`; (n, 6); N, N m.
            along: Forces of loads along the cells on their nodes; (n, 2, 3); N.
            in_scene: Take the axes x, y, z instead of the axes of the sections.
        """
        middle = self.frames(0.5)
        force, moment = (
            middle.apply(np.einsum("nik,nk->ni", self.axes, x)) for x in np.hsplit(resultants, 2)
        )
        # Both nodes turn the middle; the rotation vector does work on the rotation between them
        angle = np.linalg.norm(self.between, axis=1)[:, None]
        n = middle.apply(self.between / np.where(angle > 0.0, angle, 1.0))
        lever = self.lengths[:, None] * np.cross(self.slopes, force)
        twist = np.sum(n * moment, axis=1)[:, None] * n
        moment = twist + (moment - twist) / np.sinc(angle / 2 / np.pi)
        moment = moment - np.tan(angle / 4) / 2 * np.cross(n, lever)
        sides = force + along[:, 0], force - along[:, 1]
        levers = [self.lengths[:, None] * np.cross(self.slopes, x) for x in sides]
        found = []
        for s in fractions:
            local = (1 - s) * sides[0] + s * sides[1]
            bubble = moment + (0.5 - s) * lever
            # Loads between the nodes: the integral of their levers, and linear to both ends
            change = (levers[1] - levers[0]) * (s - s**2) / 2
            both = local, bubble + change
            found.append(np.hstack(both) if in_scene else self.in_section(s, *both))
        return np.stack(found, axis=1)


def momentum(numbering: DofNumbering, q: Array, p: Array, turns: Array | None = None) -> Array:
    """Return momentum and angular momentum about the origin of products p of mass and rates.

    The shapes of ``q`` and ``p`` are (size,), in space of ``turns`` (nodes, 4), and of the result
    (3,), in space (6,).
    """
    d, dofs = numbering.displacements, np.vstack([numbering.dofs, numbering.dofs_of_bodies])
    centres = np.reshape([body.center for body in numbering.scene.bodies], (-1, d))
    ground = np.zeros((len(dofs) - len(numbering.points) - len(centres), d))
    points = np.vstack([numbering.points, centres, ground])
    _, linear = np.unique(dofs[:, 0], return_index=True)
    _, angular = np.unique(dofs[:, d], return_index=True)
    at, forces = points[linear] + q[dofs[linear, :d]], p[dofs[linear, :d]]
    spins = p[dofs[angular, d:]]
    if turns is None:
        moment = np.sum(at[:, :1] * forces[:, 1:] - at[:, 1:] * forces[:, :1], axis=0)
    else:
        moment, spins = np.cross(at, forces).sum(axis=0), _rotations(turns[angular]).apply(spins)
    return np.append(forces.sum(axis=0), moment + spins.sum(axis=0))


def turns_at(numbering: DofNumbering, place: AttachmentPoint, turns: Vectors) -> Rotation:
    """Return the rotations of the frame at a place; the column ``turns`` is (n, nodes, 4)."""
    if isinstance(place, BodyPoint):
        bodies = numbering.scene.rigid_bodies
        if place.body not in bodies:  # the ground, to which nothing is joined
            return Rotation.identity(len(turns[:, 0]))
        return _rotations(turns[:, len(numbering.points) + bodies.index(place.body)])
    nodes, weights = numbering.weights(place)
    a, b = (turns[:, node] for node in nodes)
    return _rotations(a) * Rotation.from_rotvec(weights[1] * rotations_between(a, b))


def rotations_between(before: Array, now: Array) -> Array:
    """Return rotation vectors from some quaternions of nodes to others, up to 2 π; (n, 3); rad.

    The sign of a quaternion tells rotations beyond π from those in the other direction.
    """
    (a, p), (b, q) = ((1 + x[:, :1], x[:, 1:]) for x in (before, now))
    v, real = a * q - b * p - np.cross(p, q), a * b + np.sum(p * q, axis=1, keepdims=True)
    sine = np.linalg.norm(v, axis=1, keepdims=True)
    return np.asarray(v * 2 * np.arctan2(sine, real) / np.where(sine > 0, sine, 1.0))


def lost_numbers(numbering: DofNumbering, change: Array, before: Array, now: Array) -> Array:
    """Return the whole numbers that unknowns of rotations lost after a step of dynamics; (size,).

    The ``change`` of the stored unknowns lacks them; ``before`` and ``now`` are :data:`TURNS`.
    """
    dofs = np.vstack([numbering.dofs, numbering.dofs_of_bodies])[: len(now), 3:]
    half, lost = rotations_between(before, now) / 2, np.zeros_like(change)
    angle = np.linalg.norm(half, axis=1, keepdims=True)
    cayley = 2 * half * np.tan(angle) / np.where(angle > 0, angle, 1.0)
    lost[dofs] = np.rint(cayley - change[dofs])
    return lost


def velocity_at(
    numbering: DofNumbering, place: AttachmentPoint, velocities: Vectors, states: Vectors
) -> Array:
    """Return the velocities of a place in ``states``; (n, 3); m/s, m/s, rad/s.

    In space ``states`` are :data:`TURNS`.  Angular velocities are about axes of the node; (n, 6).
    """
    motion = values_at(numbering, place, velocities)
    if numbering.displacements == 3:
        frames = turns_at(numbering, place, states).as_matrix()
        motion[:, :3] += (frames @ np.cross(motion[:, 3:], arm(place))[:, :, None])[:, :, 0]
    elif isinstance(place, BodyPoint):
        x, y = turned(arm(place), values_at(numbering, place, states)[:, 2]).T
        motion[:, :2] += motion[:, 2:] * np.column_stack([-y, x])
    return motion


def turned_further(
    numbering: DofNumbering, turns: Array, change: Array, *, at_end: bool = False
) -> Array:
    """Return :data:`TURNS` after changes of the unknowns in a step; (nodes, 4).

    They are Cayley vectors, or conformal rotation vectors if the step is solved ``at_end``.
    """
    dofs = np.vstack([numbering.dofs, numbering.dofs_of_bodies])[: len(turns), 3:]
    m = change[dofs] - at_end * FLIPPED * np.rint(change[dofs] / FLIPPED)
    real = 1 - at_end * np.sum(m * m, axis=1) / 16
    quaternions = (_rotations(turns) * Rotation.from_quat(np.column_stack([m / 2, real]))).as_quat()
    return np.asarray(np.roll(quaternions, 1, axis=1) - np.eye(4)[0])


def by_rotation(numbering: DofNumbering, turns: Array) -> Array:
    """Return the quaternions of :data:`TURNS` at the first rotations of nodes; (size, 4)."""
    found: Array = np.zeros((numbering.size, 4))
    found[np.vstack([numbering.dofs, numbering.dofs_of_bodies])[: len(turns), 3]] = turns
    return found


def rotation_vectors(turns: Array) -> Array:
    """Return rotation vectors, of angles up to π; (n, 3); rad."""
    return np.asarray(_rotations(turns).as_rotvec())


def rotated(vectors: Any, rotations: Array) -> Array:
    """Rotate vectors by angles (n, 1), or in space by rotation vectors (n, 3); rad."""
    if rotations.shape[1] == 1:
        return turned(vectors, rotations[:, 0])
    return np.asarray(Rotation.from_rotvec(rotations).apply(vectors))


def rotation_from(a: Array, b: Array) -> Array:
    """Return rotations ``b`` relative to ``a``, as in :func:`rotated`; in axes that turn with a."""
    if a.shape[1] == 1:
        return np.asarray(b - a)
    back, now = (Rotation.from_rotvec(x) for x in (-a, b))
    return np.asarray((back * now).as_rotvec())


def _rotations(turns: Array) -> Rotation:
    return Rotation.from_quat(np.roll(turns + np.eye(4)[0], -1, axis=1))


def of_vertices(numbering: DofNumbering, cells: Index) -> tuple[Index, Index, Index]:
    """Return vertices, their first cells, and whether they are first or second; (n,) each.

    Vertices whose first cell is not among the ``cells`` are left out, so each is on one process.
    """
    vertices, first = np.unique(numbering.cells.ravel(), return_index=True)
    some = np.isin(first // 2, cells)
    return vertices[some], first[some] // 2, first[some] % 2
