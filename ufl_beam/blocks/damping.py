# SPDX-License-Identifier: MIT
"""Viscous and numerical damping of beams: resultants from changes of strain in a step."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import ufl
from ufl.core.expr import Expr

from ufl_beam.arrays import Array
from ufl_beam.blocks.block import Block, BlockSetting, Elements
from ufl_beam.blocks.cells import PointOfCell, StatementOnCell, added
from ufl_beam.blocks.statement import Equations, Inputs
from ufl_beam.compiled.c_library import lib
from ufl_beam.compiled.simd_kernels import BATCH, in_batches
from ufl_beam.discretization.cell_functions import AXIS, STIFFNESS, AxisOfCell, Cell, axes
from ufl_beam.discretization.function_spaces import Fields
from ufl_beam.mechanics.functional import resultants, virtual_work
from ufl_beam.mechanics.kinematics import strain, virtual_strain
from ufl_beam.mechanics.time_scheme import Scheme
from ufl_beam.model.beams import Mesh
from ufl_beam.model.loads import KelvinVoigt, Rayleigh
from ufl_beam.terms.derivatives import Neighbours
from ufl_beam.terms.term import Callbacks, Phases


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


@dataclass(frozen=True)
class TangentDamping(StatementOnCell):
    """Rayleigh damping by tangents of sections at the beginning of a step, P(92).

    The resultants are ``time D e``, with the rates e of the strains about the configuration before
    the step.  D is positive semidefinite, so damping dissipates energy.

    Attributes:
        scheme: Scheme of the velocity in the step.
        elastic: Whether D are the constant stiffnesses.
    """

    scheme: Any
    elastic: bool

    @property
    def numbers(self) -> list[str]:
        """Derivatives D of (N, V, M) by the strains, a1 (s), the axis."""
        return [*(STIFFNESS if self.elastic else self.given), "time", *AXIS]

    @property
    def given(self) -> list[str]:
        """D, unless it is constant: material points set it after each step."""
        return [] if self.elastic else [f"D {k}" for k in range(9 * self.degree)]

    @property
    def rates(self) -> int:
        """Velocity, velocity before the last step, and further rates of the scheme."""
        return 2 + len(self.scheme.further_rates)

    @property
    def of_step(self) -> list[str]:
        """Length of the step, and coefficients of the velocity."""
        return ["dt", *(f"velocity {j}" for j in range(self.rates + 1))]

    def equations(self, at: Inputs) -> Equations:
        """See the base class."""
        cell, mesh, forces, lost = Cell(self.degree, at), Mesh(degree=self.degree), [], 0
        q0 = at.motions("q0")
        steps = [q1 - q for q, q1 in zip(q0, at.motions("q1"), strict=True)]
        if self.scheme.half_tangents:
            tangents = [at.stage(2 * ufl.tan(x[2] / 2)) for x in steps]
            pairs = zip(steps, tangents, strict=True)
            steps = [ufl.as_vector([x[0], x[1], tangent]) for x, tangent in pairs]
        motions = steps, *(at.motions(f"rate{j + 1}") for j in range(self.rates))
        velocity = [
            sum((at[f"velocity {j}"] * x for j, x in enumerate(some)), ufl.zero(3))
            for some in zip(*motions, strict=True)
        ]
        for g, (s, weight) in enumerate(zip(mesh.points, mesh.point_weights, strict=True)):
            point = PointOfCell(cell, float(s))
            about, *fields = (point.field(at, x) for x in (q0, velocity, steps))
            e, e_step, w_e = (
                virtual_strain(about, w, point.axis) for w in (*fields, point.virtual)
            )
            if self.elastic:
                D = ufl.diag(ufl.as_vector([at[name] for name in STIFFNESS]))
            else:
                rows = (self.given[9 * g + 3 * k : 9 * g + 3 * k + 3] for k in range(3))
                D = ufl.as_matrix([[at[name] for name in row] for row in rows])
            factor = float(weight) * point.axis.h * at["time"]
            forces.append(point.forces(at, factor * virtual_work(ufl.dot(D, e), w_e)))
            lost += factor * virtual_work(ufl.dot(D, e_step), e_step) / at["dt"]
        return Equations(added(forces), lost={"damping": lost})


class DampedCells(Block):
    """Cells with tangent damping and material points.

    Attributes:
        points: The points.
    """

    def __init__(self, damping: Rayleigh, cells: Any, setting: BlockSetting) -> None:
        statement = TangentDamping(cells.statement.degree, setting.scheme, elastic=False)
        numbers = [*[math.nan] * len(statement.given), damping.stiffness]
        elements = _on_cells(f"damping of {cells.name}", numbers, cells.fields)
        super().__init__(statement, elements, setting, kind="damping")
        self.points = cells.points
        self.points.keep_tangents(self, damped=self._c, in_damped=statement.degree)

    @property
    def tangents(self) -> Array:
        """Tangents D of material points; (cells, 9 degree)."""
        return self.by_element(self._numbers)[:, : len(self.statement.given)]

    def set_tangents(self, values: Array) -> None:
        """Set :attr:`tangents` of all cells."""
        self._numbers[:, : values.shape[1]] = in_batches(values, BATCH)

    def phases(self, callbacks: Callbacks) -> Phases:
        """See the base class; the points accept a step before they set new tangents."""
        return super().phases(callbacks)._replace(accept=[])

    def complete_derivatives(self, c: Any, neighbours: Neighbours, by_number: Array) -> None:
        """See the base class."""
        self.points.complete_derivatives(c, neighbours)


def tangent_damping(
    damping: Rayleigh, elastic: Fields, inelastic: Sequence[Any], setting: BlockSetting
) -> Iterator[Block]:
    """Yield the blocks of a damping by tangents, of elastic cells and of cells with points."""
    if len(elastic.order):
        statement = TangentDamping(elastic.degree, setting.scheme, elastic=True)
        elements = _on_cells("tangent damping", [*_stiffness(elastic), damping.stiffness], elastic)
        yield Block(statement, elements, setting, kind="damping")
    yield from (DampedCells(damping, cells, setting) for cells in inelastic)


def viscous_cells(damping: KelvinVoigt, fields: Fields) -> Fields:
    """Return the cells of a viscosity."""
    subdomain, numbering = fields.subdomain, fields.subdomain.numbering
    beams = numbering.scene.beams if damping.beams is None else damping.beams
    without = [numbering.cells_of(beam) for beam in beams if beam.section.hinge is None]
    cells = np.concatenate([np.zeros(0, int), *without])
    return Fields(subdomain, np.flatnonzero(np.isin(subdomain.cells, cells)))


def viscosity(damping: KelvinVoigt, fields: Fields, setting: BlockSetting) -> Block:
    """Return the block of a viscosity."""
    setting.ledger.lost["damping"] += 0.0
    some = viscous_cells(damping, fields)
    elements = _on_cells("viscosity", [damping.retardation_time, *_stiffness(some)], some)
    return Block(Viscosity(some.degree, setting.scheme), elements, setting, kind="damping")


def second_differences(fields: Fields, setting: BlockSetting) -> Block:
    """Return the block of the numerical damping of elastic cells."""
    statement = SecondDifferences(fields.degree, setting.scheme)
    elements = _on_cells("changes of strains", _stiffness(fields), fields)
    block = Block(statement, elements, setting, kind="beams")
    block.state["last dt"][:] = math.inf
    return block


def _stiffness(fields: Fields) -> list[Array]:
    return [*fields.section_values(*STIFFNESS).T]


def _on_cells(name: str, numbers: Sequence[Array | float], fields: Fields) -> Elements:
    """Return cells with some numbers and the axis."""
    n = len(fields.order)
    own = [np.broadcast_to(x, n) for x in numbers]
    return Elements(
        name, fields.subdomain.cells[fields.order], fields.cell_dofs, [*own, *axes(fields)],
        cells=fields.order, force_kind=lib.STRESS,
    )  # fmt: skip
