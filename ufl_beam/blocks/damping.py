# SPDX-License-Identifier: MIT
"""Statements of resultants from changes of strain in a step: viscosity, and numerical damping."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
import ufl
from ufl.core.expr import Expr

from ufl_beam.arrays import Array
from ufl_beam.blocks.block import Block, BlockSetting, Elements
from ufl_beam.blocks.cells import AXIS, STIFFNESS, AxisOfCell, Cell, StatementOnCell, axes
from ufl_beam.blocks.statement import Equations, Inputs
from ufl_beam.compiled.c_library import lib
from ufl_beam.discretization.function_spaces import Fields
from ufl_beam.mechanics.functional import resultants, virtual_work
from ufl_beam.mechanics.kinematics import strain
from ufl_beam.mechanics.time_scheme import Scheme
from ufl_beam.model.beams import Mesh
from ufl_beam.model.loads import KelvinVoigt


@dataclass(frozen=True)
class _Damping(StatementOnCell):
    """Resultants ``factor C (Δe - before)``; Δe is the change of the strains in the step.

    Attributes:
        scheme: Scheme of the virtual strains.
    """

    scheme: Scheme

    @property
    def numbers(self) -> tuple[str, ...]:
        """Stiffnesses, and the axis."""
        return *STIFFNESS, *AXIS

    def damped(
        self, at: Inputs, factor: Expr, before: Mapping[int, Expr], entry: str
    ) -> tuple[Equations, list[Expr]]:
        """Return the forces, with the loss ``entry``, and Δe at each Gauss point.

        ``before`` are vectors of strains by Gauss point; others are zero.
        """
        cell, mesh, changes, work, lost = Cell(self.degree, at), Mesh(degree=self.degree), [], 0, 0
        C = ufl.as_vector([at[name] for name in STIFFNESS])
        for g, (s, weight) in enumerate(zip(mesh.points, mesh.point_weights, strict=True)):
            axis = AxisOfCell(cell, float(s))
            q0, q1, w = map(axis.field, (at.motions("q0"), at.motions("q1"), cell.virtual))
            changes.append(change := strain(q1, axis) - strain(q0, axis))
            r = factor * resultants(change - before.get(g, ufl.zero(3)), C)
            w_e = self.scheme.virtual_strain(q0, q1, w, axis)
            work += float(weight) * axis.h * virtual_work(r, w_e)
            lost += float(weight) * axis.h * virtual_work(r, change)
        return Equations(cell.forces(work), lost={entry: lost}), changes


@dataclass(frozen=True)
class Viscosity(_Damping):
    """Resultants in proportion to strain rates, P(89) with the factor retardation time / dt."""

    of_step = ("dt",)

    @property
    def numbers(self) -> tuple[str, ...]:
        """Retardation time (s), and the numbers of the base class."""
        return "time", *super().numbers

    def equations(self, at: Inputs) -> Equations:
        """See the base class."""
        return self.damped(at, at["time"] / at["dt"], {}, "damping")[0]


@dataclass(frozen=True)
class SecondDifferences(_Damping):
    """Resultants c C (Δe - r Δe'), see :class:`EnergyMomentumDecaying`.

    Δe' is the change of strain in the last step, r the ratio of the step lengths, at most 1.
    """

    of_step = ("dt",)

    @property
    def state(self) -> tuple[str, ...]:
        """Changes of strain in the last step, point after point, and its length (s)."""
        return *(f"change {k}{g}" for g in range(self.degree) for k in "ΣΓK"), "last dt"

    def equations(self, at: Inputs) -> Equations:
        """See the base class."""
        ratio = at["dt"] / at["last dt"]
        ratio = ufl.conditional(ufl.lt(ratio, 1.0), ratio, 1.0)
        before = {
            g: ratio * ufl.as_vector([at[f"change {k}{g}"] for k in "ΣΓK"])
            for g in range(self.degree)
        }
        fraction = ufl.as_ufl(self.scheme.lost_fraction)
        made, changes = self.damped(at, fraction, before, "numerical")
        values = [*(change[k] for change in changes for k in range(3)), at["dt"]]
        return made._replace(state=dict(zip(self.state, values, strict=True)))


def viscosity(damping: KelvinVoigt, fields: Fields, setting: BlockSetting) -> Block:
    """Return the block of a viscosity."""
    setting.ledger.lost["damping"] += 0.0
    subdomain, numbering = fields.subdomain, fields.subdomain.numbering
    beams = numbering.scene.beams if damping.beams is None else damping.beams
    pairs = (zip(numbering.cells_of(beam), numbering.hinges(beam), strict=True) for beam in beams)
    cells = [cell for beam_cells in pairs for cell, hinge in beam_cells if hinge is None]
    some = Fields(subdomain, np.flatnonzero(np.isin(subdomain.cells, cells)))
    times = np.full(len(some.order), damping.retardation_time)
    elements = _on_cells("viscosity", [times], some)
    return Block(
        Viscosity(numbering.mesh.degree, setting.scheme), elements, setting, kind="damping"
    )


def second_differences(fields: Fields, setting: BlockSetting) -> Block:
    """Return the block of the numerical damping of elastic cells."""
    statement = SecondDifferences(fields.element.degree, setting.scheme)
    block = Block(statement, _on_cells("changes of strains", [], fields), setting, kind="beams")
    block.state["last dt"][:] = math.inf
    return block


def _on_cells(name: str, numbers: list[Array], fields: Fields) -> Elements:
    subdomain, stiffness = fields.subdomain, fields.section_values(fields.element.stiffness)
    return Elements(
        name, subdomain.cells[fields.order], fields.cell_dofs,
        [*numbers, *stiffness.T, *axes(fields)], cells=fields.order,
        force_kind=lib.STRESS,
    )  # fmt: skip
