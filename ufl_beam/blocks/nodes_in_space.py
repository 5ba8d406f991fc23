# SPDX-License-Identifier: MIT
"""Unknowns and states of nodes in space.

A node has six unknowns: its displacement, and numbers whose change in a step is the vector m of
its rotation in axes of the node, see :mod:`ufl_beam.mechanics.spatial_kinematics`.  So rates of
these numbers are angular velocities in axes of the node, the mass matrix is constant, and C needs
no rotations.  Quaternions of nodes are states of the elements.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from ufl.core.expr import Expr

from ufl_beam.arrays import Array, Index
from ufl_beam.blocks.statement import Inputs, Statement
from ufl_beam.compiled.simd_kernels import BATCH, in_batches
from ufl_beam.mechanics.spatial_kinematics import Turn, Vector, product, subtract
from ufl_beam.mechanics.time_scheme import Scheme, acts_at_end

UNKNOWNS = "xyzabc"
"""Displacements along the axes of the scene, then rotations about axes of the node."""


def unknowns(nodes: int) -> list[str]:
    """Return the names of the unknowns of nodes, component by component."""
    return [f"{c}{k}" for c in UNKNOWNS for k in range(nodes)]


def quaternion_names(k: int) -> list[str]:
    """Return the names of the quaternion of a node among the states of an element.

    The first number is the real part minus 1, so that all numbers begin with zero.
    """
    return [f"turn {i} of {k}" for i in range(4)]


def quaternion(at: Inputs, k: int) -> Vector:
    """Return the quaternion of a node before the step."""
    real, *others = (at[name] for name in quaternion_names(k))
    return (1.0 + real, *others)


def put_turns(block: Any, turns: Array) -> None:
    """Set the quaternions of the nodes of elements from those at rotations; (size, 4)."""
    state = getattr(block, "state", {})
    for k in range(block.statement.nodes if quaternion_names(0)[0] in state else 0):
        names = block.statement.unknowns
        dofs = np.reshape(block._elements.dofs, (-1, len(names)))[:, names.index(f"a{k}")]
        values = in_batches(turns[dofs], BATCH)
        for i, name in enumerate(quaternion_names(k)):
            state[name][:] = values[:, i]


def places_of_turns(block: Any, own: Index, first: Index | int = 0) -> Index:
    """Return the places of the quaternions of elements ``own`` in the states of a block; (n, 4).

    ``first`` are the indices of their first numbers among the states of an element.
    """
    row = own // BATCH * len(block.statement.state) + first
    return np.asarray((row[:, None] + np.arange(4)) * BATCH + own[:, None] % BATCH)


def vector(at: Inputs, group: str, names: str, k: int) -> Vector:
    """Return some unknowns of a node in a group of inputs, such as "q1"."""
    return tuple(at[f"{group} {c}{k}"] for c in names)


def change(at: Inputs, names: str, k: int) -> Vector:
    """Return the change of some unknowns of a node in the step."""
    return subtract(vector(at, "q1", names, k), vector(at, "q0", names, k))


def turn_in_step(at: Inputs, k: int, scheme: Scheme) -> Turn:
    """Return the rotation of a node in the step."""
    m, q0 = change(at, "abc", k), quaternion(at, k)
    return Turn(at.stage, m, q0, at_end=acts_at_end(scheme))


def new_state(turns: Sequence[Turn], to_node: Vector | None = None) -> dict[str, Expr]:
    """Return the quaternions after the step.

    ``to_node`` is a quaternion that turns the axes of an element into the axes of its nodes.
    """
    found = dict[str, Expr]()
    for k, turn in enumerate(turns):
        q = turn.normal if to_node is None else product(turn.normal, to_node)
        found |= zip(quaternion_names(k), (q[0] - 1.0, *q[1:]), strict=True)
    return found


@dataclass(frozen=True)
class StatementInSpace(Statement):
    """Statement on nodes in space.

    Attributes:
        scheme: Time scheme.
    """

    scheme: Scheme

    @property
    def unknowns(self) -> list[str]:
        """Names of the unknowns of all nodes, component by component."""
        return unknowns(self.nodes)

    @property
    def state(self) -> list[str]:
        """Quaternions of the nodes."""
        return [x for k in range(self.nodes) for x in quaternion_names(k)]


FIRST = 1.0, 0.0, 0.0
"""Axis 1 of a cell, in its axes."""


def matrix_of(at: Inputs, name: str) -> tuple[Vector, ...]:
    """Return a matrix among the numbers; the rows of R are the axes of the cell."""
    return tuple(tuple(at[f"{name}{i}{j}"] for j in range(3)) for i in range(3))
