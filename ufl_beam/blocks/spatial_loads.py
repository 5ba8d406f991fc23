# SPDX-License-Identifier: MIT
"""Statements of loads in space that depend on rotations: moments, follower loads, pressures."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import ufl

from ufl_beam.blocks.block import Block, BlockSetting, Elements, InTime, Made
from ufl_beam.blocks.cells import StatementOnCell
from ufl_beam.blocks.nodes_in_space import (
    FIRST,
    StatementInSpace,
    change,
    matrix_of,
    new_state,
    turn_in_step,
    unknowns,
    vector,
)
from ufl_beam.blocks.statement import Equations, Inputs
from ufl_beam.compiled.c_library import fill
from ufl_beam.discretization.cells_in_space import cell_axes, rotary_inertia
from ufl_beam.discretization.function_spaces import Fields
from ufl_beam.mechanics.spatial_kinematics import (
    add,
    between,
    cross,
    matrix,
    scale,
    subtract,
    times,
    transposed_times,
)
from ufl_beam.mechanics.time_scheme import Scheme, acts_at_end, has_inertia
from ufl_beam.model.functions import steady
from ufl_beam.model.loads import RotatingFrame
from ufl_beam.quadrature import gauss_rule

NO_FORCE = [ufl.as_ufl(0.0)] * 3
RATE = "rate x", "rate y", "rate z"


@dataclass(frozen=True)
class LoadOnNode(StatementInSpace):
    """Force and moment at a node.

    They turn with the node, or the moment has a constant direction and is not conservative; dead
    forces are no statement.

    Attributes:
        follows: Whether they turn with the node.
    """

    follows: bool
    nodes = 1
    of_step = ("factor",)

    @property
    def numbers(self) -> list[str]:
        """Force of a load that follows, and moment, in the undeformed scene."""
        return [f"{x}{i}" for x in "FM"[not self.follows :] for i in range(3)]

    def equations(self, at: Inputs) -> Equations:
        """See the base class."""
        turn = turn_in_step(at, 0, self.scheme)
        *F, M = (
            scale(at["factor"], tuple(at[f"{x}{i}"] for i in range(3)))
            for x in "FM"[not self.follows :]
        )
        forces: Sequence[Any] = NO_FORCE
        if self.follows:
            frame = matrix(between(at.stage, turn.q0, turn.q1, self.scheme.load_weight))
            M, F = times(frame, M), [times(frame, F[0])]
            forces = scale(-1.0, F[0])
        return Equations([*forces, *scale(-1.0, turn.on_node(M))], new_state([turn]))


@dataclass(frozen=True)
class PressureInSpace(StatementInSpace):
    """Forces along a cell, normal and tangential to the deformed axis, per deformed length."""

    nodes = 2
    of_step = ("factor",)

    @property
    def numbers(self) -> list[str]:
        """Forces along the axes of the section for a factor of 1, length, axes, and shares."""
        axes = [f"R{i}{j}" for i in range(3) for j in range(3)]
        return ["p2", "p3", "p1", "h", *axes, *(f"share{g}" for g in range(4))]

    def equations(self, at: Inputs) -> Equations:
        """See the base class; the derivative of the axis has the length of its part of the cell."""
        w, axes = self.scheme.load_weight, matrix_of(at, "R")
        turns = [turn_in_step(at, k, self.scheme) for k in (0, 1)]
        u = [add(vector(at, "q0", "xyz", k), scale(w, change(at, "xyz", k))) for k in (0, 1)]
        first, last = (between(at.stage, turn.q0, turn.q1, w) for turn in turns)
        frame = matrix(between(at.stage, first, last))
        second, third = (times(frame, axes[i]) for i in (1, 2))
        along = add(scale(at["h"], transposed_times(axes, FIRST)), subtract(u[1], u[0]))
        directions = along, cross(third, along), cross(along, second)
        p1, p2, p3 = (scale(at[f"p{i + 1}"], x) for i, x in enumerate(directions))
        force = tuple(map(at.stage, scale(at["factor"], add(add(p1, p2), p3))))
        points = [*zip(*gauss_rule(4), strict=True)]
        of_node = [
            sum(float(x * (1 - s, s)[k]) * at[f"share{g}"] for g, (s, x) in enumerate(points))
            for k in (0, 1)
        ]
        forces = [-of_node[k] * x for x in force for k in (0, 1)]
        return Equations([*forces, *NO_FORCE, *NO_FORCE], new_state(turns))


@dataclass(frozen=True)
class ForceOfRotatingFrame(StatementOnCell):
    """Centrifugal and Coriolis force on the mass of a cell, or of a node (degree 0).

    Attributes:
        scheme: Time scheme.
    """

    scheme: Scheme
    of_step = "growth", "dt"  # growth: part of the centrifugal force, from 0 to 1 in substeps

    @property
    def unknowns(self) -> list[str]:
        """Displacements of all nodes, component by component."""
        return unknowns(self.nodes)[: 3 * self.nodes]

    @property
    def numbers(self) -> list[str]:
        """Mass (kg), angular velocity of the frame (rad/s), positions from its centre (m)."""
        return ["mass", *RATE, *(f"{c}{k}" for c in "XYZ" for k in range(self.nodes))]

    def equations(self, at: Inputs) -> Equations:
        """See the base class; velocities are means over the step."""
        rate, on_nodes = tuple(at[x] for x in RATE), list[Any]()
        for k in range(self.nodes):
            moved = change(at, "xyz", k)
            place = add(vector(at, "q0", "xyz", k), scale(self.scheme.load_weight, moved))
            place = add(tuple(at[f"{c}{k}"] for c in "XYZ"), place)
            force = scale(at["growth"], cross(rate, cross(rate, place)))
            if has_inertia(self.scheme):
                force = add(force, scale(2 / at["dt"], cross(rate, moved)))
            on_nodes.append(tuple(map(at.stage, scale(at["mass"], force))))
        if self.nodes == 2:  # as the consistent matrix of inertia
            a, b = on_nodes
            on_nodes = [scale(1 / 6, add(scale(2.0, x), y)) for x, y in ((a, b), (b, a))]
        return Equations([x for some in zip(*on_nodes, strict=True) for x in some])


@dataclass(frozen=True)
class MomentOfRotatingFrame(StatementInSpace):
    """Centrifugal and gyroscopic moment on the rotary inertia of a node in a rotating frame.

    With the inertia J and the angular velocities ω of the node and b of the frame, in axes of the
    node, the energy -b·J b is stored, and the moment ω × (2 J - tr J) b has no power.
    """

    nodes = 1
    of_step = "growth", "dt"

    @property
    def numbers(self) -> list[str]:
        """Inertia (kg m²), and angular velocity of the frame (rad/s)."""
        return [*(f"J{i}{j}" for i in range(3) for j in range(3)), *RATE]

    def equations(self, at: Inputs) -> Equations:
        """See the base class; the mean of the frames in the step makes the increment exact."""
        turn, w = turn_in_step(at, 0, self.scheme), self.scheme.load_weight
        frames = matrix(turn.q0), matrix(turn.q1)
        frame = [
            tuple(map(at.stage, add(scale(1.0 - w, x), scale(w, y))))
            for x, y in zip(*frames, strict=True)
        ]
        J, rate = matrix_of(at, "J"), tuple(at[x] for x in RATE)
        b = tuple(map(at.stage, transposed_times(frame, rate)))
        Jb = tuple(map(at.stage, times(J, b)))
        moment = scale(at["growth"], cross(rate, times(frame, Jb)))
        if has_inertia(self.scheme):
            H = subtract(scale(2.0, Jb), scale(J[0][0] + J[1][1] + J[2][2], b))
            moment = add(moment, times(frame, scale(1 / at["dt"], cross(turn.m, H))))
        return Equations([*NO_FORCE, *turn.on_node(moment)], new_state([turn]))


class LoadsInSpace(Block):
    """Loads at nodes, whose rotations are states."""

    remembers = True

    def __init__(self, statement: StatementInSpace, *others: Any, **more: Any) -> None:
        super().__init__(statement, *others, **more)
        fill(self._c, turns=acts_at_end(statement.scheme))


def moments_of_rotating_frame(frame: RotatingFrame, setting: BlockSetting) -> Iterator[Made]:
    """Yield the statement of rotary inertia at nodes of cells, half of each cell, and of bodies."""
    subdomain, (mine, bodies, nodes) = setting.subdomain, setting.subdomain.moving_bodies()
    fields = Fields(subdomain)
    lengths, axes = cell_axes(fields)
    J = np.repeat(rotary_inertia(fields, axes) * lengths[:, None, None] / 2, 2, axis=0)
    J = np.concatenate([J, np.reshape([x.tensor for x in bodies], (-1, 3, 3))])
    at_cells = fields.cell_dofs.reshape(-1, 6, 2).transpose(0, 2, 1)
    at_nodes = np.concatenate([at_cells.reshape(-1, 6), nodes])
    of_cells = np.add.outer(2 * subdomain.cells, range(2)).ravel()
    indices = np.append(of_cells, 2 * len(subdomain.numbering.cells) + mine)
    some = np.flatnonzero(J.any(axis=(1, 2)))
    rates = np.tile(frame.rate, (len(some), 1)).T
    if subdomain.largest(float(len(some))):  # on any process
        yield MomentOfRotatingFrame(setting.scheme), Elements(
            "rotation of inertia", indices[some], at_nodes[some],
            [*J[some].reshape(-1, 9).T, *rates], [InTime(steady, frame)], {"growth": 0},
        )  # fmt: skip
