# SPDX-License-Identifier: MIT
"""Histories of joints and connectors: relative motions, forces, works."""

from __future__ import annotations

from typing import Any, NamedTuple, TypeAlias

import numpy as np

from ufl_beam.arrays import Array
from ufl_beam.discretization.dof_numbering import Grid
from ufl_beam.display import one_line
from ufl_beam.errors import SceneError
from ufl_beam.model.bodies import GROUND, Anchor, Spot, arm, node
from ufl_beam.model.connector_laws import Guide
from ufl_beam.model.connectors import Connector
from ufl_beam.model.curves import nearest, parameter_step, tangent
from ufl_beam.model.joints import Joint
from ufl_beam.model.scene import Scene

Vectors: TypeAlias = Any
"""Configurations or velocities at some times, an array or a ``Column``; (n, size)."""


class JointHistory(NamedTuple):
    """History of a joint, b being its second place and a its first.

    Attributes:
        motion: Displacement of b relative to a, in axes that turn with a, and rotation of b
            relative to a; zero in the undeformed scene; (n+1, 3); m, m, rad.
        force: That the joint exerts on b, in the plane; (n+1, 2); N.
        in_a, in_b: The same in axes that turn with a and with b; (n+1, 2); N.
        moment: That it exerts on b, about the place b; (n+1,); N m.  Not a number where the places
            share their rotation, so that nobody knows it.
    """

    motion: Array
    force: Array
    in_a: Array
    in_b: Array
    moment: Array

    def __repr__(self) -> str:
        return one_line(self)


def links_of(scene: Scene, of: Connector | Joint) -> list[int]:
    """Numbers of the links of a connector, or of those that hold a joint of the scene."""
    if isinstance(of, Connector):
        links = of.components or (of,)
        if links[0] not in scene.links:
            raise SceneError(f"{of} is not in the scene")
        return [scene.links.index(link) for link in links]
    if of not in scene.joints:
        raise SceneError(f"{of} is not in the scene")
    if not of.holders:
        raise SceneError(
            f"{of} shares unknowns, so that its force is not known; make it with measured=True"
        )
    return [scene.links.index(holder) for holder in of.holders]


def turned(x: tuple[float, float] | Array, angle: Array) -> Array:
    """A vector, or one for each angle, turned by angles; (n, 2)."""
    a, b = np.asarray(x, dtype=np.float64).T
    cos, sin = np.cos(angle), np.sin(angle)
    return np.column_stack([cos * a - sin * b, sin * a + cos * b])


def motion_of(grid: Grid, place: Anchor, states: Vectors) -> Array:
    """Displacement and rotation of a place in configurations of the grid; (n, 3); m, m, rad."""
    motion = _of_node(grid, place, states)
    if isinstance(place, Spot):
        motion[:, :2] += turned(arm(place), motion[:, 2]) - arm(place)
    return motion


def velocity_of(grid: Grid, place: Anchor, states: Vectors, velocities: Vectors) -> Array:
    """Velocity of a place; (n, 3); m/s, m/s, rad/s."""
    motion = _of_node(grid, place, velocities)
    if isinstance(place, Spot):
        x, y = turned(arm(place), _of_node(grid, place, states)[:, 2]).T
        motion[:, :2] += motion[:, 2:] * np.column_stack([-y, x])
    return motion


def _of_node(grid: Grid, place: Anchor, states: Vectors) -> Array:
    """Values at what a place moves with; interpolated in cells; (n, 3)."""
    if isinstance(place, Spot):
        if node(place) is GROUND:
            return np.zeros((len(states), 3))
        dofs = grid.node(place)
        return np.ascontiguousarray(states[:, dofs])
    nodes, weights = grid.weights(place)
    dofs = grid.dofs[nodes]
    return np.asarray(weights @ np.ascontiguousarray(states[:, dofs]))


def position_of(grid: Grid, place: Anchor, states: Vectors) -> Array:
    """Coordinates of a place in configurations of the grid; (n, 2); m."""
    if isinstance(place, Spot):
        return np.asarray(place.point + motion_of(grid, place, states)[:, :2])
    nodes, weights = grid.weights(place)
    return np.asarray(weights @ grid.points[nodes] + motion_of(grid, place, states)[:, :2])


def of_joint(grid: Grid, joint: Joint, states: Vectors, forces: Array) -> JointHistory:
    """History of a joint, from configurations and the forces of all links; (n+1, num_links)."""
    a, b, *_ = joint.places
    turns = [motion_of(grid, place, states)[:, 2] for place in (a, b)]
    between = position_of(grid, b, states) - position_of(grid, a, states)
    apart = np.subtract(b.point, a.point)
    motion = np.column_stack([turned(between, -turns[0]) - apart, turns[1] - turns[0]])
    force, moment = np.zeros((len(states), 2)), np.zeros(len(states))
    numbers = links_of(grid.scene, joint)
    if not any({holder.a, holder.b} == {a, b} for holder in joint.holders):
        raise SceneError(
            f"{joint}: {a} and {b} share unknowns, so that the force between them is not known; "
            "make it with measured=True"
        )
    if 2 in joint.shared:
        moment[:] = np.nan
    for number, holder in zip(numbers, joint.holders, strict=True):
        if {holder.a, holder.b} != {a, b}:
            continue
        λ = forces[:, number] if holder.b == b else -forces[:, number]
        if holder.turns:
            moment -= λ
        else:
            force -= λ[:, None] * _direction(grid, holder, states, turns[0])
    return JointHistory(motion, force, turned(force, -turns[0]), turned(force, -turns[1]), moment)


def _direction(grid: Grid, holder: Connector, states: Vectors, turn: Array) -> Array:
    """Unit vectors in the plane along which a motion grows; (n+1, 2)."""
    if holder.stretches:
        between = position_of(grid, holder.b, states) - position_of(grid, holder.a, states)
        return np.asarray(between / np.linalg.norm(between, axis=1)[:, None])
    if isinstance(holder.law, Guide):
        curve, s, size, normals = holder.law.curve, 0.0, grid.scene.size, []
        for point in position_of(grid, holder.b, states):
            step = parameter_step(curve, s, size)
            s = nearest(curve, point, s, step, size)
            x, y = tangent(curve, s, step)
            normals.append((-y, x))
        return np.asarray(normals / np.linalg.norm(normals, axis=1)[:, None])
    return turned(holder.axis, turn if holder.follows_a else np.zeros_like(turn))
