# SPDX-License-Identifier: MIT
"""Statements of beams and bodies in space: cells, and the rotation of masses."""

from __future__ import annotations

from abc import abstractmethod
from collections.abc import Sequence
from dataclasses import dataclass
from functools import reduce
from typing import Any

import numpy as np
import ufl
from ufl.core.expr import Expr

from ufl_beam.arrays import Array, Index
from ufl_beam.blocks.beams import BeamCells, InelasticCells, alike
from ufl_beam.blocks.block import Block, BlockSetting, Elements
from ufl_beam.blocks.damping import viscous_cells
from ufl_beam.blocks.nodes_in_space import (
    FIRST,
    StatementInSpace,
    change,
    matrix_of,
    new_state,
    places_of_turns,
    turn_in_step,
    vector,
)
from ufl_beam.blocks.statement import Equations, Inputs
from ufl_beam.compiled.c_library import lib
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
from ufl_beam.model.loads import KelvinVoigt


@dataclass(frozen=True)
class InertiaInSpace(StatementInSpace):
    """Statement on nodes in space with inertia in dynamics."""

    @property
    def rates(self) -> int:
        """Number of rates: velocities and, if the scheme needs them, those before the last step."""
        return 1 + self.scheme.uses_last_step if has_inertia(self.scheme) else 0

    @property
    def of_step(self) -> Sequence[str]:
        """Length of the step, and coefficients of its rates."""
        return ["dt", *(f"rates 0 {j}" for j in range(1 + self.rates))] if self.rates else []

    def spin(self, at: Inputs, k: int) -> Vector:
        """Return the angular velocity of a node after the step."""
        known = [change(at, "abc", k)]
        known += [vector(at, f"rate{j + 1}", "abc", k) for j in range(self.rates)]
        parts = [scale(at[f"rates 0 {j}"], x) for j, x in enumerate(known)]
        return reduce(add, parts)


@dataclass(frozen=True)
class CellInSpace(InertiaInSpace):
    """Cell of two nodes; in dynamics with the moments of its rotating inertia.

    The inertia of the scene is a constant matrix in velocities in axes of the nodes.  The momentum
    of a node turns with it, which adds a moment without power.
    """

    nodes = 2
    inserts = True
    functions = 0
    degree = 1

    @property
    def modes(self) -> Sequence[str]:
        """In statics as of :class:`~ufl_beam.blocks.beams.BeamCell`, and predicted motions."""
        about, to = ([f"{x} {y}" for y in self.unknowns] for x in ("about", "to"))
        return [] if has_inertia(self.scheme) else [*about, "moved", "reached", *to]

    @property
    def numbers(self) -> list[str]:
        """Length and axes of the cell, rotary inertia."""
        inertia = [f"J{i}{j}" for i in range(3) for j in range(3)] * bool(self.rates)
        return ["h", *(f"R{i}{j}" for i in range(3) for j in range(3)), *inertia]

    @abstractmethod
    def response(
        self, at: Inputs, e0: Vector, e1: Vector, predicted: Vector
    ) -> tuple[list[Expr], dict[str, Any]]:
        """Return the resultants of strains as intermediate numbers, and further equations.

        The strains are those before the step, at its end and, in statics, predicted ones.
        """

    def equations(self, at: Inputs) -> Equations:
        """See the base class."""
        h, axes, at_end = at["h"], matrix_of(at, "R"), acts_at_end(self.scheme)
        turns = [turn_in_step(at, k, self.scheme) for k in (0, 1)]
        q0 = [turn.q0 for turn in turns]
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
        on_nodes = [x.on_node(M) for x, M in zip(turns, moments, strict=True)]
        if self.rates:
            turning = self._turning(at, [turn.m for turn in turns])
            on_nodes = [add(x, y) for x, y in zip(on_nodes, turning, strict=True)]
        forces = [x for i in range(3) for x in (-N[i], N[i])]
        forces += [x for both in zip(*on_nodes, strict=True) for x in both]
        state = new_state(turns) | more.pop("state", {})
        return Equations(forces, state, **more)

    def _predicted(
        self, at: Inputs, q0: Sequence[Vector], u0: Sequence[Vector], axes: Any
    ) -> Vector:
        """Return the strains that the latest tangent predicts."""
        along, turns, u = ufl.variable(ufl.as_ufl(0.0)), list[Turn](), list[Vector]()
        for k in (0, 1):
            last, further = (
                subtract(vector(at, group, "xyzabc", k), vector(at, before, "xyzabc", k))
                for group, before in (("about", "q0"), ("to", "about"))
            )
            moved = add(last, scale(along, further))
            u.append(add(u0[k], moved[:3]))
            turns.append(Turn(_same, moved[3:], q0[k], at_end=acts_at_end(self.scheme)))
        slope = scale(1 / at["h"], subtract(u[1], u[0]))
        e = _strains(Middle(_same, *(turn.q1 for turn in turns)), slope, axes, at["h"])
        return tuple(x + at["moved"] * ufl.diff(x, along) for x in e)

    def _turning(self, at: Inputs, own: Sequence[Vector]) -> list[Vector]:
        """Return the moments by which the momenta of the nodes turn."""
        momenta, found = (
            [times(matrix_of(at, "J"), self.spin(at, k)) for k in (0, 1)],
            list[Vector](),
        )
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

    @property
    def state(self) -> list[str]:
        """Quaternions of the nodes; changes of strains in the last step, and its length (s)."""
        return [*super().state, *LAST_CHANGES * bool(self.scheme.lost_fraction)]

    def response(
        self, at: Inputs, e0: Vector, e1: Vector, predicted: Vector
    ) -> tuple[list[Expr], dict[str, Any]]:
        """See the base class."""
        C, h = [at[name] for name in STIFFNESS_IN_SPACE], at["h"]
        own, others = self._resultants(at, C, e0, e1), [None] * 6
        if predicted:
            others = self._resultants(at, C, e0, predicted)
        growth, state, lost = subtract(e1, e0), dict[str, Expr](), dict[str, Expr]()
        if self.scheme.alpha:
            work = sum(C[i] * growth[i] ** 2 for i in range(6))
            lost["numerical"] = at["alpha"] * h * work
        if self.scheme.lost_fraction:  # see SecondDifferences of damping.py
            *before, last_dt = (at[name] for name in LAST_CHANGES)
            ratio = ufl.conditional(ufl.lt(at["dt"], last_dt), at["dt"] / last_dt, 1.0)
            triples = zip(C, growth, before, strict=True)
            f = ufl.as_ufl(self.scheme.lost_fraction)
            damping = [f * c * (x - ratio * y) for c, x, y in triples]
            own = [x + y for x, y in zip(own, damping, strict=True)]
            lost["numerical"] = h * sum(x * y for x, y in zip(damping, growth, strict=True))
            state |= zip(LAST_CHANGES, [*growth, at["dt"]], strict=True)
        r = [at.stage(x, in_tangent=y) for x, y in zip(own, others, strict=True)]
        stored = h / 2 * sum(C[i] * e1[i] ** 2 for i in range(6))
        return r, {"state": state, "stored": {"stored": stored}, "lost": lost}

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
    def numbers(self) -> list[str]:
        """Shifts, and those of the base class."""
        return [*(f"shift {k}" for k in range(6)), *super().numbers]

    @property
    def modes(self) -> list[str]:
        """Resultants and their derivatives; in statics also predicted resultants."""
        names = {"predicted": 0 if self.rates else 6, "r": 6, "D": 36}
        return [*super().modes, *(f"{x} {k}" for x, n in names.items() for k in range(n))]

    def response(
        self, at: Inputs, e0: Vector, e1: Vector, predicted: Vector
    ) -> tuple[list[Expr], dict[str, Any]]:
        """See the base class."""
        r = list[Expr]()
        for k in range(6):
            linear = at[f"shift {k}"] + sum(at[f"D {6 * k + l}"] * e1[l] for l in range(6))
            r.append(at.stage(at[f"r {k}"], linear, in_tangent=at.get(f"predicted {k}")))
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


LAST_CHANGES = *(f"change {k}" for k in range(6)), "last dt"
"""States of :class:`~ufl_beam.EnergyMomentumDecaying`: changes of strains, length of the step."""


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
        self.forget_last_step()

    def turns(self, numbering: DofNumbering) -> tuple[Index, Index]:
        """Return the places in the states of the quaternions of vertices, and the vertices."""
        cells = self._elements.indices
        vertices, cell, second = of_vertices(numbering, cells)
        return places_of_turns(self, np.searchsorted(cells, cell), 4 * second), vertices

    def save_or_restore(self, archive: Archive, q: Array) -> None:
        """See the base class: quaternions."""
        Block.save_or_restore(self, archive, q)

    def forget_last_step(self) -> None:
        """Let the next step not depend on changes of strains in the last one."""
        if "last dt" in self.state:
            self.state["last dt"][:] = np.inf

    def keep_states(self, archive: Archive, first: int = 0, last: int | None = None) -> None:
        """See the base class; quaternions, which all schemes have, are a table of their own."""
        quaternions = 4 * self.statement.nodes
        super().keep_states(archive, 0, quaternions)
        if not archive.restores or archive.has(f"{self._elements.name}, {len(LAST_CHANGES)}"):
            super().keep_states(archive, quaternions)


class InelasticCellsInSpace(InelasticCells):
    """Cells of beams in space with material points."""

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
        shifts = np.zeros((6, len(fields.order)))
        geometry = _geometry(fields, scheme, float(number == 0))
        return InelasticCellInSpace(alike(scheme)), [*shifts, *geometry]


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


def turned_momentum(m: Vector, P: Vector, dt: Expr) -> Vector:
    """Return the moment by which a momentum P in axes of a node turns in a step."""
    first = cross(m, P)
    return scale(1 / (1 + dot(m, m) / 4) / dt, add(first, scale(0.5, cross(m, first))))


@dataclass(frozen=True)
class TurningBody(InertiaInSpace):
    """Moment of the turning momentum of a body, besides its inertia; it has no power."""

    nodes = 1
    numbers = tuple(f"J{i}{j}" for i in range(3) for j in range(3))

    def equations(self, at: Inputs) -> Equations:
        """See the base class."""
        m = change(at, "abc", 0)
        none = [m[0] - m[0]] * 3  # UFL would drop forces that are all zero
        state = new_state([turn_in_step(at, 0, self.scheme)])
        if not self.rates:
            return Equations([*none, *none], state)
        P = times(matrix_of(at, "J"), self.spin(at, 0))
        return Equations([*none, *turned_momentum(m, P, at["dt"])], state)


class BodiesInSpace(Block):
    """Bodies, whose rotations are states."""

    def turns(self, numbering: DofNumbering) -> tuple[Index, Index]:
        """Return the places in the states of the quaternions of bodies, and their nodes."""
        bodies = self._elements.indices
        return places_of_turns(self, np.arange(len(bodies))), len(numbering.points) + bodies


def bodies_in_space(setting: BlockSetting) -> list[BodiesInSpace]:
    """Return the block of the moving bodies, if there are any."""
    mine, bodies, dofs = setting.subdomain.moving_bodies()
    if not bodies:
        return []
    numbers = np.array([np.ravel(body.tensor) for body in bodies]).T
    elements = Elements("bodies in space", mine, dofs, numbers)
    statement = TurningBody(setting.scheme)
    return [BodiesInSpace(statement, elements, setting, kind="inertia")]
