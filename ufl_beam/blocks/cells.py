# SPDX-License-Identifier: MIT
"""Elements of statements that are cells of beams: interpolation and virtual work in UFL."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass

import numpy as np
import ufl
from ufl.core.expr import Expr

from ufl_beam.arrays import Array, Index
from ufl_beam.blocks.statement import Inputs, Statement
from ufl_beam.discretization.cell_functions import AxisOfCell, Cell
from ufl_beam.discretization.partition import Subdomain
from ufl_beam.mechanics.kinematics import COMPONENTS
from ufl_beam.model.beams import Mesh
from ufl_beam.quadrature import gauss_rule


def places(degree: int) -> list[str]:
    """Return the names of the positions of the nodes of a cell: X of all nodes, then Y; m."""
    return [f"{c}{k}" for c in "XY" for k in range(degree + 1)]


def positions(subdomain: Subdomain, cells: Index) -> Array:
    """Return positions of the nodes of local cells, as :func:`places`; (2 or 3 * nodes, n); m."""
    numbering = subdomain.numbering
    at = numbering.points[numbering.nodes_of_cells[subdomain.cells[cells]]]
    return np.asarray(at.transpose(2, 1, 0).reshape(at.shape[1] * at.shape[2], len(cells)))


@dataclass(frozen=True)
class StatementOnCell(Statement):
    """Statement whose elements are cells, or single nodes with the degree 0.

    Attributes:
        degree: Degree of the cell.
    """

    degree: int

    @property
    def nodes(self) -> int:
        """Number of nodes of a cell."""
        return self.degree + 1


POINT = "s", "weight"
"""Names of a quadrature point as a fraction of the cell, and of its weight."""


def at_points(cells: Index, number: int) -> tuple[Index, Index, list[Array]]:
    """Return elements for the Gauss points of cells: cell and point of each, and :data:`POINT`."""
    s, weight = (np.tile(x, len(cells)) for x in gauss_rule(number))
    return np.repeat(cells, number), np.tile(np.arange(number), len(cells)), [s, weight]


class PointOfCell:
    """Point of a cell at the fraction ``s``.

    In cells of degree 1, values and slopes of motions at the point are intermediate numbers.  There
    are fewer of them than of motions of the nodes, so tangents have fewer products.

    Attributes:
        axis: Undeformed axis of the cell.
        virtual: Virtual motion as a field.
    """

    def __init__(self, cell: Cell, s: float) -> None:
        self.axis, self._cell, self._linear = AxisOfCell(cell, s), cell, cell.degree == 1
        mesh = Mesh(degree=cell.degree)
        self._weights = [np.asarray(x(s))[mesh.order] for x in (mesh.weights, mesh.slopes)]
        self._away = self.axis.X - s
        self._virtual = [[ufl.variable(ufl.as_ufl(0.0)) for _ in COMPONENTS] for _ in range(2)]
        both = self._virtual
        self.virtual = self._field(*both) if self._linear else self.axis.field(cell.virtual)

    def _field(self, values: Sequence[Expr], slopes: Sequence[Expr]) -> Expr:
        return ufl.as_vector([x + self._away * d for x, d in zip(values, slopes, strict=True)])

    def field(self, at: Inputs, nodal: Sequence[Expr]) -> Expr:
        """Return the field that interpolates nodal motions."""
        if not self._linear:
            return self.axis.field(nodal)
        sums = (
            [sum((float(a) * x[i] for a, x in zip(weights, nodal, strict=True)), 0) for i in n]
            for weights, n in zip(self._weights, [range(len(COMPONENTS))] * 2, strict=True)
        )
        return self._field(*([at.stage(x) for x in some] for some in sums))

    def forces(self, at: Inputs, work: Expr) -> list[Expr]:
        """Return the nodal forces whose work on the virtual motion is ``work``."""
        if not self._linear:
            return self._cell.forces(work)
        values, slopes = ([at.stage(ufl.diff(work, w)) for w in some] for some in self._virtual)
        return [
            float(a) * x + float(b) * y
            for x, y in zip(values, slopes, strict=True)
            for a, b in zip(*self._weights, strict=True)
        ]


def added(forces: Iterable[Sequence[Expr]]) -> list[Expr]:
    """Return the sums of nodal forces."""
    return [sum(some[1:], some[0]) for some in zip(*forces, strict=True)]
