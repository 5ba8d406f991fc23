# SPDX-License-Identifier: MIT
"""Elements of statements that are cells of beams: interpolation and virtual work in UFL."""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt
import ufl
from ufl.core.expr import Expr

from ufl_beam.arrays import Array, Index
from ufl_beam.blocks.statement import COMPONENTS, Inputs, Statement
from ufl_beam.discretization.function_spaces import Fields
from ufl_beam.discretization.partition import Subdomain
from ufl_beam.mechanics.kinematics import Axis, perpendicular, split
from ufl_beam.model.beams import Mesh
from ufl_beam.quadrature import gauss_rule

STIFFNESS = "EA", "GA", "EI"
"""Names of the stiffnesses of a cell; N, N, N m²."""


AXIS = "length", "1 / length", "tangent x", "tangent y"
"""Names of the numbers of a straight cell that determine strains; m, 1/m, 1, 1."""


def axes(fields: Fields) -> Array:
    """Return :data:`AXIS` of the cells; (4, num_cells)."""
    start, end = fields.coordinates().transpose(1, 2, 0)
    h = np.hypot(*(end - start))
    return np.array([h, 1 / h, *(end - start) / h])


def places(degree: int) -> list[str]:
    """Return the names of the positions of the nodes of a cell: X of all nodes, then Y; m."""
    return [f"{c}{k}" for c in "XY" for k in range(degree + 1)]


def positions(subdomain: Subdomain, cells: Index) -> Array:
    """Return the positions of the nodes of local cells, as :func:`places`; (2 * nodes, n); m."""
    numbering = subdomain.numbering
    at = numbering.points[numbering.nodes_of_cells[subdomain.cells[cells]]]
    return np.asarray(at.transpose(2, 1, 0).reshape(2 * at.shape[1], len(cells)))


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


class Cell:
    """Interpolation of nodal vectors along a cell; with degree 0, a single node.

    Attributes:
        virtual: Virtual motion (x, y, rotation) of each node.
        place: Position of each node of the undeformed cell; m.  None without these inputs.
        axis: The inputs :data:`AXIS`; none without them.
    """

    def __init__(self, degree: int, at: Inputs) -> None:
        self.degree, self._order = degree, Mesh(degree=degree).order if degree else [0]
        self._virtual = [[ufl.variable(ufl.as_ufl(0.0)) for _ in COMPONENTS] for _ in self._order]
        self.virtual = [ufl.as_vector(v) for v in self._virtual]
        nodes = range(degree + 1)
        self.place = [ufl.as_vector([at[f"X{k}"], at[f"Y{k}"]]) for k in nodes if "X0" in at]
        self.axis = [at[name] for name in AXIS if name in at]

    def moved(self, motions: Sequence[Expr]) -> list[Expr]:
        """Return the positions of the nodes after motions (x, y, rotation); m."""
        return [X + split(q)[0] for X, q in zip(self.place, motions, strict=True)]

    def value(self, s: float, nodal: Sequence[Expr]) -> Expr:
        """Return the interpolation at a fraction ``s`` of the cell."""
        return self._sum(Mesh(degree=self.degree).weights(s) if self.degree else [1.0], nodal)

    def slope(self, s: float, nodal: Sequence[Expr]) -> Expr:
        """Return the derivative of the interpolation by the fraction ``s``."""
        return self._sum(Mesh(degree=self.degree).slopes(s), nodal)

    def _sum(self, weights: npt.ArrayLike, nodal: Sequence[Expr]) -> Expr:
        ordered = np.asarray(weights)[self._order]
        terms = [float(a) * x for a, x in zip(ordered, nodal, strict=True)]
        return sum(terms[1:], terms[0])

    def points(self, number: int) -> list[tuple[float, float]]:
        """Return Gauss points and weights as fractions of the cell."""
        return [*zip(*gauss_rule(number), strict=True)]

    def points_of_mass(self, *, lumped: bool) -> list[tuple[float, float]]:
        """Return points and weights of inertia: exact, or at the nodes if it is lumped."""
        if self.degree == 0:
            return [(0.0, 1.0)]
        mesh = Mesh(degree=self.degree)
        return (
            [*zip(mesh.nodes, mesh.fractions, strict=True)]
            if lumped
            else self.points(mesh.degree + 1)
        )

    def forces(self, work: Any) -> list[Expr]:
        """Return the nodal forces whose work on the virtual motion is ``work``."""
        return [ufl.diff(work, v[i]) for i in range(len(COMPONENTS)) for v in self._virtual]

    @property
    def no_forces(self) -> list[Expr]:
        """Nodal forces of zero."""
        return [ufl.as_ufl(0.0)] * (len(COMPONENTS) * len(self._order))


POINT = "s", "weight"
"""Names of a quadrature point as a fraction of the cell, and of its weight."""


def at_points(cells: Index, number: int) -> tuple[Index, Index, list[Array]]:
    """Return elements for the Gauss points of cells: cell and point of each, and :data:`POINT`."""
    s, weight = (np.tile(x, len(cells)) for x in gauss_rule(number))
    return np.repeat(cells, number), np.tile(np.arange(number), len(cells)), [s, weight]


class AxisOfCell(Axis):
    """Undeformed axis of a cell at the fraction ``s``, for fields that are interpolated by it."""

    def __init__(self, cell: Cell, s: float | Expr) -> None:
        mesh = Mesh(degree=cell.degree)
        self.nodes, self.X = [float(a) for a in mesh.nodes], ufl.variable(ufl.as_ufl(s))
        nodes = [self.nodes[k] for k in mesh.order]
        self._weights = [math.prod((self.X - b) / (a - b) for b in nodes if b != a) for a in nodes]
        if cell.axis:
            self.h, self._per_h, *tangent = cell.axis
            self.t0 = ufl.as_vector(tangent)
        else:
            start, end = cell.place[:2]
            self.h = ufl.sqrt(ufl.dot(end - start, end - start))
            self.t0, self._per_h = (end - start) / self.h, 1 / self.h
            self.x = start + self.X * (end - start)
        self.n0 = perpendicular(self.t0)

    def field(self, nodal: Sequence[Expr]) -> Expr:
        """Return the interpolation of nodal vectors, without slope for equal ones."""
        (_, first), *pairs = zip(self._weights, nodal, strict=True)
        n = range(len(COMPONENTS))
        return ufl.as_vector([sum((a * (x[i] - first[i]) for a, x in pairs), first[i]) for i in n])

    def d(self, f: Expr) -> Expr:
        """See the base class."""
        if f.ufl_shape:
            return ufl.as_vector([self.d(f[i]) for i in range(f.ufl_shape[0])])
        return ufl.diff(f, self.X) * self._per_h


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
