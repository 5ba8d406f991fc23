# SPDX-License-Identifier: MIT
"""Functions of the unknowns of cells of beams: interpolation in UFL, compilation, and evaluation.

Functions are compiled once for all scenes.  C evaluates them on several cells at once.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from functools import cache
from typing import Any

import numpy as np
import numpy.typing as npt
import ufl
from ufl.core.expr import Expr

from ufl_beam.arrays import Array
from ufl_beam.caches import cached_forms
from ufl_beam.compiled.csr import Csr
from ufl_beam.compiled.keys import key_of
from ufl_beam.compiled.simd_kernels import BATCH, in_batches
from ufl_beam.discretization.cells_in_space import mass_matrix_in_space
from ufl_beam.discretization.compiled_forms import (
    InsertedForces,
    Pointwise,
    Stated,
    compiled_functions,
    components,
    inserted_cells,
    places_in,
)
from ufl_beam.discretization.function_spaces import Fields, point_masses
from ufl_beam.mechanics.functional import kinetic_energy, resultants, virtual_work
from ufl_beam.mechanics.kinematics import (
    COMPONENTS,
    Axis,
    perpendicular,
    split,
    strain,
    virtual_strain,
)
from ufl_beam.model.beams import Mesh
from ufl_beam.quadrature import gauss_rule

STIFFNESS = "EA", "GA", "EI"
"""Names of the stiffnesses of a cell; N, N, N m²."""

AXIS = "length", "1 / length", "tangent x", "tangent y"
"""Names of the numbers of a straight cell that determine strains; m, 1/m, 1, 1."""

At = Mapping[str, Expr]
"""Inputs of a function of cells by name."""


def axes(fields: Fields) -> Array:
    """Return :data:`AXIS` of the cells; (4, num_cells)."""
    start, end = fields.coordinates().transpose(1, 2, 0)
    h = np.hypot(*(end - start))
    return np.array([h, 1 / h, *(end - start) / h])


class Cell:
    """Interpolation of nodal vectors along a cell; with degree 0, a single node.

    Attributes:
        virtual: Virtual motion (x, y, rotation) of each node.
        place: Position of each node of the undeformed cell; m.  None without these inputs.
        axis: The inputs :data:`AXIS`; none without them.
    """

    def __init__(self, degree: int, at: At) -> None:
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
        if not lumped:
            return self.points(self.degree + 1)
        mesh = Mesh(degree=self.degree)
        return [*zip(mesh.nodes, mesh.fractions, strict=True)]

    def forces(self, work: Any) -> list[Expr]:
        """Return the nodal forces whose work on the virtual motion is ``work``."""
        return [ufl.diff(work, v[i]) for i in range(len(COMPONENTS)) for v in self._virtual]


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


# -- evaluation on all cells -----------------------------------------------------------------------


class CellFunction:
    """Function of the motions of the nodes of a cell, and of numbers.

    Args:
        degree: Degree of the cell.
        numbers: Names of the numbers.
        outputs: Function that returns the values in UFL; its arguments are the cell, the inputs,
            and the motion of each node.
        key: What determines the values besides the other arguments.
    """

    def __init__(
        self, degree: int, numbers: Sequence[str],
        outputs: Callable[[Cell, At, list[Expr]], Sequence[Expr]], *key: Any,
    ) -> None:  # fmt: skip
        self._degree, self._numbers, self._outputs = degree, (*numbers,), outputs
        self._key = outputs.__qualname__, degree, self._numbers, *key

    @cache  # noqa: B019 - functions are kept in a cache of their own
    def _compiled(self, *, tangent: bool) -> Any:
        def state() -> Stated:
            nodes = range(self._degree + 1)
            names = [f"{c}{k}" for c in COMPONENTS for k in nodes]
            compiler = Pointwise([*names, *self._numbers])
            at = {name: ufl.variable(x) for name, x in compiler.at.items()}
            motions = [ufl.as_vector([at[f"{c}{k}"] for c in COMPONENTS]) for k in nodes]
            values = components(ufl.as_vector(self._outputs(Cell(self._degree, at), at, motions)))
            if tangent:
                slopes = [ufl.diff(x, at[name]) for x in values for name in names]
                values = components(ufl.as_vector(slopes))
            return Stated(compiler, [values], inserted=1, unknowns=len(names))

        return compiled_functions(key_of(self._key, tangent), state)[0][0]

    def forces(self, fields: Fields, *numbers: Array) -> InsertedForces:
        """Return the forces on the nodes of cells with ``numbers``; (num_cells,) each."""
        w = in_batches(np.column_stack(numbers), BATCH)
        return InsertedForces(inserted_cells(self._compiled(tangent=False), w, fields.cell_dofs))

    def values(self, fields: Fields, *numbers: Array) -> Callable[[Array], Array]:
        """Return a function of the unknowns: the values in the cells; (num_cells, values)."""
        function, n = self._compiled(tangent=False), len(fields.order)
        rows = np.arange(n * function.outputs, dtype=np.int32).reshape(n, function.outputs)
        w, row = (in_batches(x, BATCH) for x in (np.column_stack(numbers), rows))
        cells = InsertedForces(inserted_cells(function, w, fields.cell_dofs, row=row))

        def at(q: Array) -> Array:
            cells.add(q, out := np.zeros(rows.shape))
            return out

        return at

    def matrix(self, fields: Fields, *numbers: Array) -> Csr:
        """Return the derivatives of the forces at the undeformed configuration, as a new matrix."""
        matrix, dofs = fields.matrix(), fields.cell_dofs
        w, places = in_batches(np.column_stack(numbers), BATCH), places_in(matrix, dofs, BATCH)
        cells = inserted_cells(self._compiled(tangent=True), w, dofs, **places)
        InsertedForces(cells).add(np.zeros(fields.subdomain.size), matrix.data)
        return matrix


def sections(cell: Cell) -> list[tuple[AxisOfCell, Expr]]:
    """Return the axis at the Gauss points of a cell, and the length of each point; m."""
    mesh = Mesh(degree=cell.degree)
    pairs = zip(mesh.points, mesh.point_weights, strict=True)
    at_points = [(AxisOfCell(cell, float(s)), float(weight)) for s, weight in pairs]
    return [(axis, weight * axis.h) for axis, weight in at_points]


@cached_forms
def _strains(degree: int) -> CellFunction:
    def at_points(cell: Cell, at: At, q: list[Expr]) -> list[Expr]:
        strains = (strain(axis.field(q), axis) for axis, _ in sections(cell))
        return [e[i] for e in strains for i in range(3)]

    return CellFunction(degree, AXIS, at_points)


def strains_of(fields: Fields) -> Callable[[Array], Array]:
    """Return a function of a configuration: the strains (Σ, Γ, K) of cells; 1, 1, 1/m.

    They are at the Gauss points of the cells; (num_cells, 3 p).
    """
    return _strains(fields.degree).values(fields, *axes(fields))


# -- inertia ---------------------------------------------------------------------------------------


@cached_forms
def _momentum(degree: int, lumped: bool) -> CellFunction:
    def forces(cell: Cell, at: At, v: list[Expr]) -> list[Expr]:
        ρ, mesh = (at["rhoA"], at["rhoI"]), Mesh(degree=degree)
        if lumped:
            pairs = [(mesh.fractions[k], x) for k, x in zip(mesh.order, v, strict=True)]
        else:
            pairs = [(a, cell.value(s, v)) for s, a in cell.points(degree + 1)]
        energy = sum(float(a) * at["length"] * kinetic_energy(x, ρ) for a, x in pairs)
        return [ufl.diff(energy, at[f"{c}{k}"]) for c in COMPONENTS for k in range(len(v))]  # P(67)

    return CellFunction(degree, ("length", "rhoA", "rhoI"), forces, lumped)


def _of_mass(fields: Fields) -> tuple[CellFunction, list[Array]]:
    mesh = fields.subdomain.numbering.mesh
    start, end = fields.coordinates().transpose(1, 2, 0)
    numbers = [np.hypot(*(end - start)), *fields.section_values("rhoA", "rhoI").T]
    return _momentum(mesh.degree, mesh.lumped), numbers


def mass_forces(fields: Fields) -> InsertedForces:
    """Return the product of the mass matrix of the beams and a vector, as forces on cells."""
    function, numbers = _of_mass(fields)
    return function.forces(fields, *numbers)


def mass_matrix(fields: Fields) -> Csr:
    """Assemble the mass matrix of the beams, the point masses and the bodies."""
    if fields.subdomain.numbering.scene.in_space:
        return mass_matrix_in_space(fields)
    subdomain, (function, numbers) = fields.subdomain, _of_mass(fields)
    M, masses = function.matrix(fields, *numbers), point_masses(subdomain.numbering.scene)
    nodes = [subdomain.numbering.node(place) for place, *_ in masses]
    dofs = np.array(nodes, dtype=np.int32).ravel()
    mine = subdomain.owns(dofs)
    local_dofs = subdomain.local(dofs[mine])
    values = np.array([(mass, mass, inertia) for _, mass, inertia in masses]).ravel()[mine]
    np.add.at(M.data, M.positions(local_dofs, local_dofs), values)  # a node may have several
    return M


# -- stiffness -------------------------------------------------------------------------------------


@cached_forms
def _stiffness(degree: int) -> CellFunction:
    def forces(cell: Cell, at: At, q: list[Expr]) -> list[Expr]:
        C, work = ufl.as_vector([at[name] for name in STIFFNESS]), 0.0
        for axis, length in sections(cell):
            rest = axis.field([ufl.zero(3)] * len(q))
            e, w_e = (virtual_strain(rest, axis.field(x), axis) for x in (q, cell.virtual))
            work += length * virtual_work(resultants(e, C), w_e)
        return cell.forces(work)

    return CellFunction(degree, (*AXIS, *STIFFNESS), forces)


def stiffness_forces(fields: Fields) -> InsertedForces:
    """Return the product of the stiffness of the undeformed beams and a vector, on cells."""
    numbers = *axes(fields), *fields.section_values(*STIFFNESS).T
    return _stiffness(fields.degree).forces(fields, *numbers)


def stiffness_matrix(fields: Fields) -> Csr:
    """Assemble the stiffness of the undeformed beams."""
    numbers = *axes(fields), *fields.section_values(*STIFFNESS).T
    return _stiffness(fields.degree).matrix(fields, *numbers)


@cached_forms
def _stress(degree: int, *, linear: bool) -> CellFunction:
    """Return the forces of the resultants b + D e, linearized about a motion if ``linear``."""
    law = [f"b{k}" for k in range(3 * degree)] + [f"D{k}" for k in range(9 * degree)]
    about = [f"about {c}{k}" for c in COMPONENTS for k in range(degree + 1)] * linear

    def forces(cell: Cell, at: At, q: list[Expr]) -> list[Expr]:
        along, work = ufl.variable(ufl.as_ufl(0.0)), 0.0
        if linear:
            nodes = range(degree + 1)
            base = [ufl.as_vector([at[f"about {c}{k}"] for c in COMPONENTS]) for k in nodes]
            q = [x + along * change for x, change in zip(base, q, strict=True)]
        for g, (axis, length) in enumerate(sections(cell)):
            b = ufl.as_vector([at[f"b{3 * g + i}"] for i in range(3)])
            D = ufl.as_matrix([[at[f"D{9 * g + 3 * i + j}"] for j in range(3)] for i in range(3)])
            field = axis.field(q)
            w_e = virtual_strain(field, axis.field(cell.virtual), axis)
            work += length * virtual_work(b + ufl.dot(D, strain(field, axis)), w_e)
        return [ufl.diff(x, along) if linear else x for x in cell.forces(work)]

    return CellFunction(degree, (*AXIS, *law, *about), forces, linear)


def stress_forces(
    fields: Fields, section_law: tuple[Array, Array], about: Array | None = None
) -> InsertedForces:
    """Return the forces of the resultants b + D e of strains e on cells.

    Args:
        fields: Cells.
        section_law: b, (num_cells, 3 p), and D, (num_cells, 9 p), at p Gauss points.
        about: Configuration about which the forces are linearized, without their constant part.
    """
    numbers = [*axes(fields), *(column for values in section_law for column in values.T)]
    if about is not None:
        numbers += [*about[fields.cell_dofs].T]
    return _stress(fields.degree, linear=about is not None).forces(fields, *numbers)
