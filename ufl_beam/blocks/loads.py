# SPDX-License-Identifier: MIT
"""Statements of loads that depend on the configuration."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import ufl

from ufl_beam.blocks.block import Block, BlockSetting, Elements, InTime, Made
from ufl_beam.blocks.cells import StatementOnCell, places, positions
from ufl_beam.blocks.moving_loads import moving_loads
from ufl_beam.blocks.nodes_in_space import StatementInSpace
from ufl_beam.blocks.spatial_loads import (
    ForceOfRotatingFrame,
    LoadOnNode,
    LoadsInSpace,
    PressureInSpace,
    moments_of_rotating_frame,
)
from ufl_beam.blocks.statement import Equations, Inputs, Statement
from ufl_beam.discretization.cell_functions import Cell
from ufl_beam.discretization.cells_in_space import cell_axes
from ufl_beam.discretization.function_spaces import Fields, point_masses
from ufl_beam.mechanics.kinematics import perpendicular, split
from ufl_beam.mechanics.time_scheme import has_inertia
from ufl_beam.model.functions import steady
from ufl_beam.model.loads import FollowerLoad, MovingLoad, PointLoad, Pressure, RotatingFrame
from ufl_beam.terms.dead_loads import loaded_cells


@dataclass(frozen=True)
class FollowerForce(Statement):
    """Force and moment that turn with the cross-section on which they act.

    Attributes:
        load_weight: Fraction of the step at which loads act.
    """

    load_weight: float
    nodes = 1
    numbers = "along", "across", "moment"
    of_step = ("factor",)

    def equations(self, at: Inputs) -> Equations:
        """See the base class; "along" and "across" are the force in the undeformed scene."""
        ((_, _, turn),) = at.between(self.load_weight)
        c, s, factor = ufl.cos(turn), ufl.sin(turn), at["factor"]
        x = factor * (c * at["along"] - s * at["across"])
        y = factor * (s * at["along"] + c * at["across"])
        return Equations([-x, -y, -factor * at["moment"]])


@dataclass(frozen=True)
class PressureOnCell(StatementOnCell):
    """Forces along a cell, normal and tangential to the deformed axis, per deformed length.

    Attributes:
        load_weight: Fraction of the step at which loads act.
    """

    load_weight: float
    of_step = ("factor",)

    @property
    def numbers(self) -> list[str]:
        """Forces for a factor of 1, positions of the nodes, and shares at four Gauss points."""
        return ["normal", "tangential", *places(self.degree), *(f"share{g}" for g in range(4))]

    def equations(self, at: Inputs) -> Equations:
        """See the base class; the derivative of the axis has the length of its part of the cell."""
        cell, work = Cell(self.degree, at), 0.0
        moved = cell.moved(at.between(self.load_weight))
        for g, (s, weight) in enumerate(cell.points(4)):
            along = cell.slope(s, moved)
            force = at["tangential"] * along + at["normal"] * perpendicular(along)
            w, _ = split(cell.value(s, cell.virtual))
            work += weight * at["factor"] * at[f"share{g}"] * ufl.dot(force, w)
        return Equations(cell.forces(-work))


@dataclass(frozen=True)
class ForceOfRotation(StatementOnCell):
    """Centrifugal and Coriolis force on the mass of a cell, or of a node (degree 0).

    The centrifugal force has a potential, and the Coriolis force does no work.  Rotary inertia
    causes no further moments, because a constant rate of the frame adds a constant to the angular
    velocity of a cross-section.

    Attributes:
        load_weight: Fraction of the step at which loads act.
        lumped: Whether the mass is lumped at the nodes.
        in_motion: Whether there is a Coriolis force.
    """

    load_weight: float
    lumped: bool
    in_motion: bool
    of_step = "growth", "dt"  # growth: part of the centrifugal force, from 0 to 1 in substeps

    @property
    def numbers(self) -> list[str]:
        """Mass of the cell (kg), rate of the frame (rad/s), positions from its centre (m)."""
        return ["mass", "rate", *places(self.degree)]

    def equations(self, at: Inputs) -> Equations:
        """See the base class; velocities are means over the step."""
        cell, work, rate = Cell(self.degree, at), 0.0, at["rate"]
        moved = cell.moved(at.between(self.load_weight))
        change = [q1 - q0 for q0, q1 in zip(at.motions("q0"), at.motions("q1"), strict=True)]
        for s, weight in cell.points_of_mass(lumped=self.lumped):
            force = at["growth"] * rate**2 * cell.value(s, moved)
            if self.in_motion:
                v, _ = split(cell.value(s, change) / at["dt"])
                force -= 2.0 * rate * perpendicular(v)
            w, _ = split(cell.value(s, cell.virtual))
            work += weight * at["mass"] * ufl.dot(force, w)
        return Equations(cell.forces(-work))


def load_blocks(setting: BlockSetting) -> list[Block]:
    """Return the blocks of the loads of a scene; every process has them."""
    scene, blocks = setting.scene, list[Block]()
    made: Any
    for kind, made in (
        (PointLoad, _at_nodes), (FollowerLoad, _at_nodes), (Pressure, _pressures),
        (RotatingFrame, _rotations), (MovingLoad, moving_loads),
    ):  # fmt: skip
        some: list[Any] = [load for load in scene.loads if isinstance(load, kind)]
        if kind is PointLoad:  # forces and, in the plane, moments are no statement
            some = [load for load in some if scene.in_space and np.any(load.moment)]
        for statement, elements in made(some, setting) if some else ():
            of = LoadsInSpace if isinstance(statement, StatementInSpace) else Block
            blocks.append(of(statement, elements, setting, supplies="loads"))
    return blocks


def _at_nodes(loads: Sequence[PointLoad | FollowerLoad], setting: BlockSetting) -> Iterator[Made]:
    subdomain, scheme, follows = setting.subdomain, setting.scheme, not loads[0].dead
    mine = np.array([i for i, x in enumerate(loads) if subdomain.computes(x.place)], dtype=int)
    nodes = [subdomain.local(subdomain.numbering.node(loads[i].place)) for i in mine]
    d = 3 if setting.scene.in_space else 2
    rows = [(*(*x.force, 0.0)[:d], *np.broadcast_to(x.moment, 2 * d - 3)) for x in loads]
    forces = np.array(rows, float)[mine, 0 if follows else d :]
    in_time = [InTime(load.amplitude, load) for load in loads]
    yield (
        LoadOnNode(scheme, follows) if d == 3 else FollowerForce(scheme.load_weight),
        Elements(
            "follower loads" if follows else "dead moments", mine, np.array(nodes, int), forces.T,
            in_time, {"factor": mine},
        ),
    )  # fmt: skip


def _pressures(loads: Sequence[Pressure], setting: BlockSetting) -> Iterator[Made]:
    subdomain, numbering = setting.subdomain, setting.subdomain.numbering
    pairs = [loaded_cells(load, subdomain) for load in loads]
    cells, shares = map(np.concatenate, zip(*pairs, strict=True))
    of_load = np.repeat(np.arange(len(loads)), [len(cells) for cells, _ in pairs])
    indices = subdomain.cells[cells] + len(numbering.cells) * of_load
    in_time = [InTime(load.amplitude, load) for load in loads]
    statement: Statement
    if in_space := setting.scene.in_space:
        lengths, axes = cell_axes(Fields(subdomain, cells))
        at = [lengths, *axes.transpose(2, 1, 0).reshape(9, -1)]
        statement = PressureInSpace(setting.scheme)
    else:
        at = [*positions(subdomain, cells)]
        statement = PressureOnCell(numbering.mesh.degree, setting.scheme.load_weight)
    normals = (np.broadcast_to(x.normal, 1 + in_space) for x in loads)
    forces = np.array([[*p, x.tangential] for p, x in zip(normals, loads, strict=True)])[of_load]
    yield statement, Elements(
        "pressures", indices, subdomain.cell_dofs[cells], [*forces.T, *at, *shares.T], in_time,
        {"factor": of_load}, None if in_space else cells,
    )  # fmt: skip


def _rotations(frames: Sequence[RotatingFrame], setting: BlockSetting) -> Iterator[Made]:
    (frame,), subdomain, scheme = frames, setting.subdomain, setting.scheme  # one at most
    numbering, scene, mesh = subdomain.numbering, setting.scene, subdomain.numbering.mesh
    d = 3 if (in_space := scene.in_space) else 2
    rates, about = np.atleast_1d(frame.rate), np.array((*frame.about, 0.0)[:d])
    cells, in_time = np.arange(len(subdomain.cells)), [InTime(steady, frame)]

    def force(degree: int) -> Statement:
        if in_space:
            return ForceOfRotatingFrame(degree, scheme)
        return ForceOfRotation(degree, scheme.load_weight, mesh.lumped, has_inertia(scheme))

    rhoA = np.array([beam.section.rhoA for beam in scene.beams])
    masses = rhoA[numbering.beam_of_cell[subdomain.cells]] * numbering.lengths(subdomain.cells)
    from_centre = positions(subdomain, cells) - np.repeat(about, mesh.degree + 1)[:, None]
    yield force(mesh.degree), Elements(
        "rotation of cells", subdomain.cells, subdomain.cell_dofs[:, : 3 * (mesh.degree + 1)],
        [masses, *np.tile(rates, (len(cells), 1)).T, *from_centre], in_time, {"growth": 0},
        None if in_space else cells,
    )  # fmt: skip
    if all_masses := point_masses(scene):
        mine = [
            (subdomain.local(numbering.node(at))[:3], mass, *rates, *(np.array(at.point) - about))
            for at, mass, _ in all_masses if subdomain.computes(at)
        ]  # fmt: skip
        none = [np.zeros(0)] * (2 + len(rates) + d)
        nodes, *numbers = map(np.array, zip(*mine, strict=True)) if mine else none
        yield force(0), Elements(
            "rotation of masses", np.arange(len(mine)), nodes, numbers, in_time, {"growth": 0},
        )  # fmt: skip
    if in_space:
        yield from moments_of_rotating_frame(frame, setting)
