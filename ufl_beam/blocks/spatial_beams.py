# SPDX-License-Identifier: MIT
"""Statements of beams in space: elastic cells with the rotation of their mass, dead moments."""

from __future__ import annotations

from abc import abstractmethod
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import ufl
from ufl.core.expr import Expr

from ufl_beam.arrays import Array, Index
from ufl_beam.blocks.beams import BeamCells, InelasticCells, alike
from ufl_beam.blocks.block import Block, BlockSetting, Elements, InTime
from ufl_beam.blocks.damping import viscous_cells
from ufl_beam.blocks.nodes_in_space import (
    change,
    new_state,
    quaternion,
    quaternion_names,
    unknowns,
    vector,
)
from ufl_beam.blocks.statement import Equations, Inputs, Statement
from ufl_beam.compiled.c_library import lib
from ufl_beam.compiled.simd_kernels import BATCH
from ufl_beam.discretization.cells_in_space import (
    STIFFNESS_IN_SPACE,
    cell_axes,
    of_vertices,
    rotary_inertia,
)
from ufl_beam.discretization.dof_numbering import DofNumbering
from ufl_beam.discretization.function_spaces import Fields
from ufl_beam.discretization.state_io import Archive
from ufl_beam.mechanics.spatial_kinematics import (
    Middle,
    Turn,
    Vector,
    add,
    cross,
    dot,
    forces_over_step,
    scale,
    subtract,
    times,
    transposed_times,
)
from ufl_beam.mechanics.time_scheme import Scheme, acts_at_end, has_inertia
from ufl_beam.model.fibres import SectionPoints
from ufl_beam.model.imposed_strains import ImposedStrain
from ufl_beam.model.loads import KelvinVoigt, PointLoad


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


@dataclass(frozen=True)
class CellInSpace(StatementInSpace):
    """Cell of two nodes; in dynamics with the moments of its rotating inertia.

    The inertia of the scene is a constant matrix in velocities in axes of the nodes.  The momentum
    of a node turns with it, which adds a moment without power.
    """

    nodes = 2
    inserts = True
    functions = 0

    @property
    def rates(self) -> int:
        """Number of rates, which are velocities in dynamics."""
        return int(has_inertia(self.scheme))

    @property
    def modes(self) -> Sequence[str]:
        """In statics the same as of :class:`~ufl_beam.blocks.beams.BeamCell`."""
        at_rest = [*(f"about {x}" for x in self.unknowns), "moved", "reached"]
        return [] if has_inertia(self.scheme) else at_rest

    @property
    def numbers(self) -> list[str]:
        """Length and axes of the cell, rotary inertia."""
        inertia = [f"J{i}{j}" for i in range(3) for j in range(3)] * self.rates
        return ["h", *(f"R{i}{j}" for i in range(3) for j in range(3)), *inertia]

    @property
    def of_step(self) -> Sequence[str]:
        """Length of the step, and coefficients of its rates."""
        return ["dt", "rates 0 0", "rates 0 1"] if has_inertia(self.scheme) else []

    @abstractmethod
    def response(
        self, at: Inputs, e0: Vector, e1: Vector, predicted: Vector
    ) -> tuple[list[Expr], dict[str, Any]]:
        """Return the resultants of strains as intermediate numbers, and further equations.

        The strains are those before the step, at its end and, in statics, predicted ones.
        """

    def equations(self, at: Inputs) -> Equations:
        """See the base class."""
        h, axes, at_end = at["h"], _matrix(at, "R"), acts_at_end(self.scheme)
        q0 = [quaternion(at, k) for k in (0, 1)]
        turns = [Turn(at.stage, change(at, "abc", k), q0[k]) for k in (0, 1)]
        u = [[vector(at, group, "xyz", k) for k in (0, 1)] for group in ("q0", "q1")]
        slopes = [tuple(map(at.stage, scale(1 / h, subtract(b, a)))) for a, b in u]
        old, now = Middle(at.stage, *q0), Middle(at.stage, *(turn.q1 for turn in turns))
        e0, e1 = (
            tuple(map(at.stage, _strains(middle, slope, axes, h)))
            for middle, slope in zip((old, now), slopes, strict=True)
        )
        predicted = self._predicted(at, q0, u[0], axes) if "moved" in self.modes else ()
        r, more = self.response(at, e0, e1, predicted)
        pair, tangents = turns, [add(transposed_times(axes, FIRST), slope) for slope in slopes]
        if at_end:
            old, tangents, pair = now, [tangents[1]] * 2, [turn.at_end for turn in turns]
        both = tuple(r[:3]), tuple(r[3:])
        resultants = [tuple(map(at.stage, transposed_times(axes, x))) for x in both]
        N, *moments = forces_over_step(at.stage, pair, (old, now), tangents, h, resultants)
        on_nodes = [x.on_node(M, at_end=at_end) for x, M in zip(turns, moments, strict=True)]
        if self.rates:
            turning = self._turning(at, [turn.m for turn in turns])
            on_nodes = [add(x, y) for x, y in zip(on_nodes, turning, strict=True)]
        forces = [x for i in range(3) for x in (-N[i], N[i])]
        forces += [x for both in zip(*on_nodes, strict=True) for x in both]
        return Equations(forces, new_state(turns), **more)

    def _predicted(
        self, at: Inputs, q0: Sequence[Vector], u0: Sequence[Vector], axes: Any
    ) -> Vector:
        """Return the strains that the latest tangent predicts."""
        along, turns, u = ufl.variable(ufl.as_ufl(0.0)), list[Turn](), list[Vector]()
        for k in (0, 1):
            last, further = (
                subtract(vector(at, group, "xyzabc", k), vector(at, before, "xyzabc", k))
                for group, before in (("about", "q0"), ("q1", "about"))
            )
            moved = add(last, scale(along, further))
            u.append(add(u0[k], moved[:3]))
            turns.append(Turn(_same, moved[3:], q0[k]))
        slope = scale(1 / at["h"], subtract(u[1], u[0]))
        e = _strains(Middle(_same, *(turn.q1 for turn in turns)), slope, axes, at["h"])
        return tuple(x + at["moved"] * ufl.diff(x, along) for x in e)

    def _turning(self, at: Inputs, own: Sequence[Vector]) -> list[Vector]:
        """Return the moments by which the momenta of the nodes turn."""
        J, momenta = _matrix(at, "J"), list[Vector]()
        for k, m in enumerate(own):
            before = vector(at, "rate1", "abc", k)
            ω = add(scale(at["rates 0 0"], m), scale(at["rates 0 1"], before))
            momenta.append(times(J, ω))
        found = list[Vector]()
        for k, m in enumerate(own):
            sums = add(scale(2.0, momenta[k]), momenta[1 - k])
            P = tuple(map(at.stage, scale(at["h"] / 6, sums)))
            found.append(turned_momentum(m, P, at["dt"]))
        return found


@dataclass(frozen=True)
class ElasticCellInSpace(CellInSpace):
    """Cell whose resultants are linear in its strains."""

    @property
    def numbers(self) -> list[str]:
        """Stiffnesses, "alpha", and those of the base class."""
        return [*STIFFNESS_IN_SPACE, *["alpha"] * bool(self.scheme.alpha), *super().numbers]

    def response(
        self, at: Inputs, e0: Vector, e1: Vector, predicted: Vector
    ) -> tuple[list[Expr], dict[str, Any]]:
        """See the base class."""
        C, h = [at[name] for name in STIFFNESS_IN_SPACE], at["h"]
        own, others = self._resultants(at, C, e0, e1), [None] * 6
        if predicted:
            others = self._resultants(at, C, e0, predicted)
        r = [at.stage(x, in_tangent=y) for x, y in zip(own, others, strict=True)]
        stored = h / 2 * sum(C[i] * e1[i] ** 2 for i in range(6))
        growth = sum(C[i] * (e1[i] - e0[i]) ** 2 for i in range(6))
        lost = {"numerical": at["alpha"] * h * growth} if self.scheme.alpha else {}
        return r, {"stored": {"stored": stored}, "lost": lost}

    def _resultants(self, at: Inputs, C: Sequence[Expr], e0: Vector, e1: Vector) -> list[Expr]:
        found = list[Expr]()
        for some in (slice(0, 3), slice(3, 6)):
            c, before, now = (ufl.as_vector(x[some]) for x in (C, e0, e1))
            r = self.scheme.resultants(c, before, now, lambda _: at["alpha"])
            found += [r[k] for k in range(3)]
        return found


@dataclass(frozen=True)
class InelasticCellInSpace(CellInSpace):
    """Cell with material points, see :class:`~ufl_beam.blocks.beams.InelasticCell`."""

    @property
    def modes(self) -> list[str]:
        """Resultants and their derivatives; in statics also predicted resultants."""
        names = {"predicted": 0 if self.rates else 6, "r": 6, "D": 36}
        return [*super().modes, *(f"{x} {k}" for x, n in names.items() for k in range(n))]

    def response(
        self, at: Inputs, e0: Vector, e1: Vector, predicted: Vector
    ) -> tuple[list[Expr], dict[str, Any]]:
        """See the base class."""
        r = [
            at.stage(
                at[f"r {k}"], sum(at[f"D {6 * k + l}"] * e1[l] for l in range(6)),
                in_tangent=at.get(f"predicted {k}"),
            )
            for k in range(6)
        ]  # fmt: skip
        return r, {"strains": e1, "predicted": predicted}


@dataclass(frozen=True)
class ViscousCellInSpace(CellInSpace):
    """Cell whose resultants are in proportion to strain rates, besides those of other laws."""

    rates = 0
    modes = ()
    of_step = ("dt",)

    @property
    def numbers(self) -> list[str]:
        """Retardation time (s), stiffnesses, and those of the base class."""
        return ["time", *STIFFNESS_IN_SPACE, *super().numbers]

    def response(
        self, at: Inputs, e0: Vector, e1: Vector, predicted: Vector
    ) -> tuple[list[Expr], dict[str, Any]]:
        """See the base class."""
        growth, factor = subtract(e1, e0), at["time"] / at["dt"]
        own = zip(STIFFNESS_IN_SPACE, growth, strict=True)
        r = tuple(at.stage(factor * at[name] * x) for name, x in own)
        return [*r], {"lost": {"damping": at["h"] * dot(r, growth)}}


def _same(x: Expr) -> Expr:
    return x


FIRST = 1.0, 0.0, 0.0
"""Axis 1 of a cell, in its axes."""


def _matrix(at: Inputs, name: str) -> tuple[Vector, ...]:
    """Return a matrix among the numbers; the rows of R are the axes of the cell."""
    return tuple(tuple(at[f"{name}{i}{j}"] for j in range(3)) for i in range(3))


def _strains(middle: Middle, slope: Vector, axes: Any, h: Expr) -> Vector:
    """Return the strains along, and curvatures about, the axes 1, 2, 3 of a cell.

    ``slope`` is the derivative of the displacement.  A cell at rest has strains of exactly zero.
    """
    moved = transposed_times(middle.frame, slope)
    turned = transposed_times(middle.turned, transposed_times(axes, FIRST))
    curvature = scale(1 / h, middle.rotation_vector)
    return (*times(axes, add(moved, turned)), *times(axes, curvature))


class CellsInSpace(BeamCells):
    """Elastic cells of beams in space."""

    def __init__(self, fields: Fields, setting: BlockSetting) -> None:
        scheme, n = setting.scheme, len(fields.order)
        numbers = [*fields.section_values(*STIFFNESS_IN_SPACE).T]
        numbers += [np.full(n, scheme.alpha)] * bool(scheme.alpha)
        numbers += _geometry(fields, scheme)
        statement: Any = ElasticCellInSpace(alike(scheme))
        super().__init__(statement, "cells in space", fields, setting, [], numbers)
        self.in_cells = []

    def turns(self, numbering: DofNumbering) -> tuple[Index, Index]:
        """Return the places in the states of the quaternions of vertices, and the vertices."""
        cells = self._elements.indices
        cell, second = of_vertices(numbering, cells).T
        own, vertices = np.searchsorted(cells, cell), np.unique(numbering.cells[cells])
        row = own // BATCH * len(self.statement.state) + 4 * second
        return (row[:, None] + np.arange(4)) * BATCH + own[:, None] % BATCH, vertices

    @property
    def states(self) -> Array:
        """States of all cells, in batches."""
        return self._states

    def save_or_restore(self, archive: Archive, q: Array) -> None:
        """See the base class: quaternions."""
        Block.save_or_restore(self, archive, q)


class InelasticCellsInSpace(InelasticCells):
    """Cells of beams in space with material points."""

    states = CellsInSpace.states

    def __init__(self, fields: Fields, section_points: SectionPoints, *others: Any) -> None:
        super().__init__(fields, section_points, *others)
        self.in_cells, self._known, self._first = [], False, section_points.number == 0

    def turns(self, numbering: DofNumbering) -> tuple[Index, Index]:
        """See :class:`CellsInSpace`; only the first points of cells give the quaternions."""
        at, vertices = CellsInSpace.turns(self, numbering)  # type: ignore[arg-type]
        return at[: len(at) * self._first], vertices[: len(at) * self._first]

    def start(self, q: Array) -> None:
        """See the base class; strains of a restored state keep their last bits."""
        if not self._known:
            super().start(q)

    def save_or_restore(self, archive: Archive, q: Array) -> None:
        """See the base class."""
        super().save_or_restore(archive, q)
        self._known = archive.restores

    @staticmethod
    def stated(
        fields: Fields, scheme: Scheme, strains: Sequence[ImposedStrain], number: int
    ) -> tuple[Any, list[Array]]:
        """See the base class; the first points of a cell are with its rotary inertia."""
        return InelasticCellInSpace(alike(scheme)), _geometry(fields, scheme, float(number == 0))


def viscosity_in_space(damping: KelvinVoigt, fields: Fields, setting: BlockSetting) -> Block:
    """Return the block of a viscosity, which has its own copies of quaternions."""
    some = viscous_cells(damping, fields)
    stiffness = some.section_values(*STIFFNESS_IN_SPACE).T
    numbers = [np.full(len(some.order), damping.retardation_time), *stiffness]
    elements = Elements(
        "viscosity", some.subdomain.cells[some.order], some.cell_dofs,
        [*numbers, *_geometry(some)], cells=some.order, force_kind=lib.STRESS,
    )  # fmt: skip
    block = Block(ViscousCellInSpace(setting.scheme), elements, setting, kind="damping")
    block.in_cells = []
    return block


def _geometry(fields: Fields, scheme: Scheme | None = None, inertia: float = 1.0) -> list[Array]:
    """Return lengths, axes and, in dynamics, rotary inertia times a factor of cells."""
    lengths, axes = cell_axes(fields)
    numbers = [lengths, *axes.transpose(2, 1, 0).reshape(9, -1)]
    if scheme is not None and has_inertia(scheme):
        numbers += [*inertia * rotary_inertia(fields, axes).reshape(-1, 9).T]
    return numbers


@dataclass(frozen=True)
class DeadMoment(StatementInSpace):
    """Moment at a node with a constant direction; it is not conservative."""

    nodes = 1
    numbers = "m0", "m1", "m2"
    of_step = ("factor",)

    def equations(self, at: Inputs) -> Equations:
        """See the base class."""
        turn = Turn(at.stage, change(at, "abc", 0), quaternion(at, 0))
        M = scale(at["factor"], tuple(at[f"m{i}"] for i in range(3)))
        forces = [ufl.as_ufl(0.0)] * 3 + [
            -x for x in turn.on_node(M, at_end=acts_at_end(self.scheme))
        ]
        return Equations(forces, new_state([turn]))


def turned_momentum(m: Vector, P: Vector, dt: Expr) -> Vector:
    """Return the moment by which a momentum P in axes of a node turns in a step."""
    first = cross(m, P)
    return scale(1 / (1 + dot(m, m) / 4) / dt, add(first, scale(0.5, cross(m, first))))


@dataclass(frozen=True)
class TurningBody(StatementInSpace):
    """Moment of the turning momentum of a body, besides its inertia; it has no power."""

    nodes = 1
    numbers = tuple(f"J{i}{j}" for i in range(3) for j in range(3))

    @property
    def rates(self) -> int:
        """Number of rates, which are velocities in dynamics."""
        return int(has_inertia(self.scheme))

    @property
    def of_step(self) -> list[str]:
        """Length of the step, and coefficients of its rates."""
        return ["dt", "rates 0 0", "rates 0 1"] if self.rates else []

    def equations(self, at: Inputs) -> Equations:
        """See the base class."""
        m = change(at, "abc", 0)
        none = [m[0] - m[0]] * 3  # UFL would drop forces that are all zero
        state = new_state([Turn(at.stage, m, quaternion(at, 0))])
        if not self.rates:
            return Equations([*none, *none], state)
        before = vector(at, "rate1", "abc", 0)
        ω = add(scale(at["rates 0 0"], m), scale(at["rates 0 1"], before))
        P = tuple(sum(at[f"J{i}{j}"] * ω[j] for j in range(3)) for i in range(3))
        return Equations([*none, *turned_momentum(m, P, at["dt"])], state)


class BodiesInSpace(Block):
    """Bodies, whose rotations are states."""

    def turns(self, numbering: DofNumbering) -> tuple[Index, Index]:
        """Return the places in the states of the quaternions of bodies, and their nodes."""
        own = np.arange(len(self._elements.indices))
        row = own[:, None] // BATCH * 4 + np.arange(4)
        return row * BATCH + own[:, None] % BATCH, len(numbering.points) + own

    @property
    def states(self) -> Array:
        """States of all bodies, in batches."""
        return self._states


def bodies_in_space(setting: BlockSetting) -> list[BodiesInSpace]:
    """Return the block of the moving bodies, if there are any."""
    subdomain, bodies = setting.subdomain, setting.scene.bodies
    if not bodies:
        return []
    nodes = np.array([subdomain.local(subdomain.numbering.node(x.middle)) for x in bodies])
    numbers = np.array([np.ravel(body.tensor) for body in bodies]).T
    elements = Elements("bodies in space", np.arange(len(bodies)), nodes, [*numbers])
    statement = TurningBody(setting.scheme)
    return [BodiesInSpace(statement, elements, setting, kind="inertia")]


class DeadMoments(Block):
    """Moments at nodes, whose rotations are states."""

    remembers = True


def dead_moments(setting: BlockSetting) -> list[Block]:
    """Return the block of moments at places, if there are any."""
    subdomain = setting.subdomain
    loads = [x for x in setting.scene.loads if isinstance(x, PointLoad) and np.any(x.moment)]
    if not loads:
        return []
    nodes = np.array([subdomain.local(subdomain.numbering.node(load.place)) for load in loads])
    moments, mine = np.array([load.moment for load in loads], float), np.arange(len(loads))
    in_time = [InTime(load.amplitude, load) for load in loads]
    elements = Elements("dead moments", mine, nodes, [*moments.T], in_time, {"factor": mine})
    return [DeadMoments(DeadMoment(setting.scheme), elements, setting, supplies="loads")]
