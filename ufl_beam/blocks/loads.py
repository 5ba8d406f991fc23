# SPDX-License-Identifier: MIT
"""Statements of loads that depend on the configuration."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import ufl

from ufl_beam.blocks.block import Block
from ufl_beam.blocks.cells import Cell, places, positions
from ufl_beam.blocks.statement import Equations, Inputs, Statement
from ufl_beam.compiled.csr import Csr
from ufl_beam.discretization.function_spaces import point_masses
from ufl_beam.discretization.partition import Subdomain
from ufl_beam.mechanics.kinematics import perpendicular, split
from ufl_beam.mechanics.time_scheme import Scheme, has_inertia
from ufl_beam.model.functions import steady
from ufl_beam.model.loads import FollowerLoad, Pressure, RotatingFrame
from ufl_beam.terms.energy_ledger import Ledger
from ufl_beam.terms.load_forces import loaded_cells


@dataclass(frozen=True)
class FollowerForce(Statement):
    """Force and moment that turn with the cross-section on which they act.

    Attributes:
        at: Fraction of the step at which loads act.
    """

    at: float
    nodes = 1
    numbers = "along", "across", "moment"
    of_step = ("factor",)

    def equations(self, at: Inputs) -> Equations:
        """See the base class; "along" and "across" are the force in the undeformed scene."""
        ((_, _, turn),) = at.between(self.at)
        c, s, factor = ufl.cos(turn), ufl.sin(turn), at["factor"]
        x = factor * (c * at["along"] - s * at["across"])
        y = factor * (s * at["along"] + c * at["across"])
        return Equations([-x, -y, -factor * at["moment"]])


@dataclass(frozen=True)
class PressureOnCell(Statement):
    """Forces along a cell, normal and tangential to the deformed axis, per deformed length.

    Attributes:
        at: Fraction of the step at which loads act.
        degree: Degree of the cell.
    """

    at: float
    degree: int
    of_step = ("factor",)

    @property
    def nodes(self) -> int:
        """Number of nodes of a cell."""
        return self.degree + 1

    @property
    def numbers(self) -> list[str]:
        """Forces for a factor of 1, positions of the nodes, and shares at four Gauss points."""
        return ["normal", "tangential", *places(self.degree), *(f"share{g}" for g in range(4))]

    def equations(self, at: Inputs) -> Equations:
        """See the base class; the derivative of the axis has the length of its part of the cell."""
        cell, work = Cell(self.degree, at), 0.0
        moved = [X + split(q)[0] for X, q in zip(cell.place, at.between(self.at), strict=True)]
        for g, (s, weight) in enumerate(cell.points(4)):
            along = cell.slope(s, moved)
            force = at["tangential"] * along + at["normal"] * perpendicular(along)
            w, _ = split(cell.value(s, cell.virtual))
            work += weight * at["factor"] * at[f"share{g}"] * ufl.dot(force, w)
        return Equations(cell.forces(-work))


@dataclass(frozen=True)
class ForceOfRotation(Statement):
    """Centrifugal and Coriolis force on the mass of a cell, or of a node (degree 0).

    The centrifugal force has a potential, and the Coriolis force does no work.  Rotary inertia
    causes no further moments, because a constant rate of the frame adds a constant to the angular
    velocity of a cross-section.

    Attributes:
        at: Fraction of the step at which loads act.
        degree, lumped: Degree and mass of the cell, see :class:`Mesh`.
        in_motion: Whether there is a Coriolis force.
    """

    at: float
    degree: int
    lumped: bool
    in_motion: bool
    of_step = "growth", "dt"

    @property
    def nodes(self) -> int:
        """Number of nodes of a cell."""
        return self.degree + 1

    @property
    def numbers(self) -> list[str]:
        """Mass of the cell (kg), rate of the frame (rad/s), positions from its centre (m)."""
        return ["mass", "rate", *places(self.degree)]

    def equations(self, at: Inputs) -> Equations:
        """See the base class; velocities are means over the step."""
        cell, work, rate = Cell(self.degree, at), 0.0, at["rate"]
        moved = [X + split(q)[0] for X, q in zip(cell.place, at.between(self.at), strict=True)]
        change = [q1 - q0 for q0, q1 in zip(at.motions("q0"), at.motions("q1"), strict=True)]
        for s, weight in cell.points_of_mass(lumped=self.lumped):
            force = at["growth"] * rate**2 * cell.value(s, moved)
            if self.in_motion:
                v, _ = split(cell.value(s, change) / at["dt"])
                force -= 2.0 * rate * perpendicular(v)
            w, _ = split(cell.value(s, cell.virtual))
            work += weight * at["mass"] * ufl.dot(force, w)
        return Equations(cell.forces(-work))


def load_blocks(subdomain: Subdomain, scheme: Scheme, A: Csr, ledger: Ledger) -> list[Block]:
    """Return the blocks of the loads of a scene."""
    loads, setting = subdomain.numbering.scene.loads, (subdomain, scheme, ledger, A)
    blocks = list[Block]()
    for kind, make in (
        (FollowerLoad, _followers), (Pressure, _pressures), (RotatingFrame, _rotations)
    ):  # fmt: skip
        some = [load for load in loads if isinstance(load, kind)]
        blocks += make(some, *setting) if some else []
    return blocks


def _followers(
    loads: Sequence[FollowerLoad], subdomain: Subdomain, scheme: Scheme, ledger: Ledger, A: Csr
) -> list[Block]:
    mine = np.array([i for i, x in enumerate(loads) if subdomain.computes(x.place)], dtype=int)
    nodes = [subdomain.local(subdomain.numbering.node(loads[i].place)) for i in mine]
    forces = np.array([[*loads[i].force, loads[i].moment] for i in mine]).reshape(-1, 3)
    statement = FollowerForce(scheme.load_weight)
    return [Block(
        statement, "follower loads", mine, np.array(nodes), [*forces.T],
        subdomain, scheme, ledger, A, functions=[(load.amplitude, load) for load in loads],
        of_step={"factor": mine}, supplies="loads",
    )]  # fmt: skip


def _pressures(
    loads: Sequence[Pressure], subdomain: Subdomain, scheme: Scheme, ledger: Ledger, A: Csr
) -> list[Block]:
    pairs = [loaded_cells(load, subdomain) for load in loads]
    cells = np.concatenate([cells for cells, _ in pairs])
    of_load = np.repeat(np.arange(len(loads)), [len(cells) for cells, _ in pairs])
    forces = np.array([[load.normal, load.tangential] for load in loads])[of_load]
    shares = np.concatenate([shares for _, shares in pairs])
    return [Block(
        PressureOnCell(scheme.load_weight, subdomain.numbering.mesh.degree), "pressures",
        subdomain.cells[cells] + len(subdomain.numbering.cells) * of_load,
        subdomain.cell_dofs[cells], [*forces.T, *positions(subdomain, cells), *shares.T],
        subdomain, scheme, ledger, A, functions=[(load.amplitude, load) for load in loads],
        of_step={"factor": of_load}, supplies="loads", cells=cells,
    )]  # fmt: skip


def _rotations(
    frames: Sequence[RotatingFrame], subdomain: Subdomain, scheme: Scheme, ledger: Ledger, A: Csr
) -> list[Block]:
    (frame,), numbering = frames, subdomain.numbering  # a scene has one at most
    mesh, cells, about = numbering.mesh, np.arange(len(subdomain.cells)), np.array(frame.about)
    rhoA = np.array([beam.section.rhoA for beam in numbering.scene.beams])
    masses = rhoA[numbering.beam_of_cell[subdomain.cells]] * numbering.lengths(subdomain.cells)
    on_cells = positions(subdomain, cells) - np.repeat(about, mesh.degree + 1)[:, None]
    points = [
        (subdomain.local(numbering.node(at)), mass, frame.rate, *(np.array(at.point) - about))
        for at, mass, _ in point_masses(numbering.scene) if subdomain.computes(at)
    ]  # fmt: skip
    nodes, *numbers = zip(*points, strict=True) if points else ([],) * 5
    elements = [
        ("cells", mesh.degree, subdomain.cells, subdomain.cell_dofs,
         [masses, np.full(len(cells), frame.rate), *on_cells], cells),
        ("masses", 0, np.arange(len(points)), np.array(nodes), numbers, None),
    ]  # fmt: skip
    setting = subdomain, scheme, ledger, A
    return [
        Block(
            ForceOfRotation(scheme.load_weight, degree, mesh.lumped, has_inertia(scheme)),
            f"rotation of {kind}", indices, dofs, of_element, *setting,
            functions=[(steady, frame)], of_step={"growth": np.zeros(len(indices))},
            supplies="loads", cells=cells_of_block,
        )
        for kind, degree, indices, dofs, of_element, cells_of_block in elements
        if kind == "cells" or point_masses(numbering.scene)
    ]  # fmt: skip
