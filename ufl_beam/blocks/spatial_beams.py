# SPDX-License-Identifier: MIT
"""Statements of beams in space: elastic cells with the rotation of their mass, dead moments.

A node has six unknowns: its displacement, and numbers whose change in a step is the Cayley vector
of its rotation in axes of the node, see :mod:`ufl_beam.mechanics.spatial_kinematics`.  So rates of
these numbers are angular velocities in axes of the node, the mass matrix is constant, and C needs
no rotations.  Quaternions of nodes are states of the elements.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from types import SimpleNamespace
from typing import Any

import numpy as np
import ufl
from ufl.core.expr import Expr

from ufl_beam.arrays import Array, Index
from ufl_beam.blocks.block import Block, BlockSetting, Elements, InTime
from ufl_beam.blocks.beams import alike
from ufl_beam.blocks.statement import Equations, Inputs, Statement
from ufl_beam.compiled.c_library import loop
from ufl_beam.compiled.simd_kernels import BATCH
from ufl_beam.discretization.cells_in_space import cell_axes, quaternions, rotary_inertia
from ufl_beam.discretization.function_spaces import Fields
from ufl_beam.mechanics.spatial_kinematics import (
    Middle,
    Turn,
    Vector,
    add,
    cross,
    dot,
    forces_over_step,
    matrix,
    product,
    scale,
    subtract,
    times,
    transposed_times,
)
from ufl_beam.mechanics.time_scheme import Scheme, acts_at_end, has_inertia
from ufl_beam.model.loads import PointLoad
from ufl_beam.terms.term import Callbacks, Phases

UNKNOWNS = "x", "y", "z", "a", "b", "c"
"""Displacements along the axes of the scene, then rotations about axes of the node."""

QUATERNION = "turn 0", "turn 1", "turn 2", "turn 3"
"""Quaternion of a node; the first number is its real part minus 1, so that all begin with zero."""

STIFFNESS = "EA", "GA", "GA3", "GJ", "EI2", "EI"
"""Stiffnesses for the strains along the axes 1, 2, 3 of a section, and the rotations about them."""


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
        return [f"{c}{k}" for c in UNKNOWNS for k in range(self.nodes)]

    @property
    def state(self) -> list[str]:
        """Quaternions of the nodes."""
        return [f"{c} of {k}" for k in range(self.nodes) for c in QUATERNION]

    def vector(self, at: Inputs, group: str, names: str, k: int) -> Vector:
        """Return three numbers of a node."""
        return tuple(at[f"{group} {c}{k}"] for c in names)

    def quaternion(self, at: Inputs, k: int) -> Vector:
        """Return the quaternion of a node before the step."""
        real, *vector = (at[f"{c} of {k}"] for c in QUATERNION)
        return (1.0 + real, *vector)

    def change(self, at: Inputs, names: str, k: int) -> Vector:
        """Return the change of three unknowns in the step."""
        return subtract(self.vector(at, "q1", names, k), self.vector(at, "q0", names, k))

    def new_state(self, turns: Sequence[Turn], to_node: Vector | None = None) -> dict[str, Expr]:
        """Return the quaternions after the step; ``to_node`` turns axes of elements into those."""
        found = dict[str, Expr]()
        for k, turn in enumerate(turns):
            q = turn.normal if to_node is None else product(turn.normal, to_node)
            found |= {f"{c} of {k}": x for c, x in zip(QUATERNION, (q[0] - 1.0, *q[1:]), strict=True)}
        return found


@dataclass(frozen=True)
class ElasticCellInSpace(StatementInSpace):
    """Elastic cell of two nodes; in dynamics with the moments of its rotating inertia.

    The inertia of the scene is a constant matrix in velocities in axes of the nodes.  The momentum
    of a node turns with it, which adds a moment without power.
    """

    nodes = 2

    @property
    def rates(self) -> int:
        """Velocities in dynamics."""
        return int(has_inertia(self.scheme))

    @property
    def numbers(self) -> list[str]:
        """Stiffnesses, "alpha", length, slope and axes of the cell, rotary inertia."""
        inertia = [f"J{i}" for i in (1, 2, 3)] * has_inertia(self.scheme)
        return [
            *STIFFNESS, *["alpha"] * bool(self.scheme.alpha), "h", "t0", "t1", "t2",
            *(f"R{i}" for i in range(4)), *inertia,
        ]  # fmt: skip

    @property
    def of_step(self) -> list[str]:
        """Length of the step, and coefficients of its rates."""
        return ["dt", "rates 0 0", "rates 0 1"] if has_inertia(self.scheme) else []

    def equations(self, at: Inputs) -> Equations:
        """See the base class."""
        h, axes = at["h"], tuple(at[f"R{i}"] for i in range(4))
        into, t = matrix(axes), tuple(at[f"t{i}"] for i in range(3))
        q0 = [product(self.quaternion(at, k), axes) for k in (0, 1)]
        own = [transposed_times(into, self.change(at, "abc", k)) for k in (0, 1)]
        turns = [Turn(at.stage, tuple(map(at.stage, m)), q) for m, q in zip(own, q0, strict=True)]
        u = [[self.vector(at, group, "xyz", k) for k in (0, 1)] for group in ("q0", "q1")]
        slopes = [
            tuple(map(at.stage, add(t, scale(1 / h, subtract(b, a))))) for a, b in u
        ]
        old, now = Middle(at.stage, *q0), Middle(at.stage, *(turn.q1 for turn in turns))
        e0, e1 = (self._strains(at, *pair, h) for pair in zip((old, now), slopes, strict=True))
        C = ufl.as_vector([at[name] for name in STIFFNESS])
        resultants = list[Expr]()
        for i in (0, 3):
            c, some = ufl.as_vector([C[i + k] for k in range(3)]), (e0[i : i + 3], e1[i : i + 3])
            r = self.scheme.resultants(c, *map(ufl.as_vector, some), lambda _: at["alpha"])
            resultants += [at.stage(r[k]) for k in range(3)]
        pair: Any = turns
        if acts_at_end(self.scheme):
            old, slopes = now, [slopes[1]] * 2
            pair = [SimpleNamespace(q0=x.q1, q1=x.q1, c=1.0, s=(0.0,) * 3) for x in turns]
        N, *moments = forces_over_step(
            at.stage, pair, (old, now), slopes, h, (resultants[:3], resultants[3:])
        )
        on_nodes = [turn.on_node(x) for turn, x in zip(turns, moments, strict=True)]
        if self.rates:
            on_nodes = [add(x, y) for x, y in zip(on_nodes, self._turning(at, own), strict=True)]
        on_nodes = [times(into, x) for x in on_nodes]
        forces = [x for i in range(3) for x in (-N[i], N[i])]
        forces += [x for pair in zip(*on_nodes, strict=True) for x in pair]
        stored = h / 2 * sum(C[i] * e1[i] ** 2 for i in range(6))
        change = sum(C[i] * (e1[i] - e0[i]) ** 2 for i in range(6))
        lost = {"numerical": at["alpha"] * h * change} if self.scheme.alpha else {}
        back = (axes[0], *(-x for x in axes[1:]))
        return Equations(forces, self.new_state(turns, back), {"stored": stored}, lost)

    def _strains(self, at: Inputs, middle: Middle, slope: Vector, h: Expr) -> Vector:
        stretch, *shear = transposed_times(middle.frame, slope)
        curvature = scale(1 / h, middle.rotation_vector)
        return tuple(map(at.stage, (stretch - 1.0, *shear, *curvature)))

    def _turning(self, at: Inputs, own: Sequence[Vector]) -> list[Vector]:
        """Return the moments by which the momenta of the nodes turn, in axes of the cell."""
        into, J = matrix(tuple(at[f"R{i}"] for i in range(4))), [at[f"J{i}"] for i in (1, 2, 3)]
        momenta = list[Vector]()
        for k, m in enumerate(own):
            before = transposed_times(into, self.vector(at, "rate1", "abc", k))
            ω = add(scale(at["rates 0 0"], m), scale(at["rates 0 1"], before))
            momenta.append(tuple(j * x for j, x in zip(J, ω, strict=True)))
        found = list[Vector]()
        for k, m in enumerate(own):
            sums = add(scale(2.0, momenta[k]), momenta[1 - k])
            P = tuple(map(at.stage, scale(at["h"] / 6, sums)))
            c2 = at.stage(1 / (1 + dot(m, m) / 4) / at["dt"])
            first = cross(m, P)
            found.append(scale(c2, add(first, scale(0.5, cross(m, first)))))
        return found


class CellsInSpace(Block):
    """Elastic cells of beams in space."""

    def __init__(self, fields: Fields, setting: BlockSetting) -> None:
        scheme, n = setting.scheme, len(fields.order)
        numbers = [*fields.section_values(*STIFFNESS).T]
        numbers += [np.full(n, scheme.alpha)] * bool(scheme.alpha)
        lengths, axes = cell_axes(fields)
        numbers += [lengths, *axes[:, :, 0].T, *quaternions(axes).T]
        if has_inertia(scheme):
            numbers += [*rotary_inertia(fields).T]
        cells = fields.subdomain.cells[fields.order]
        elements = Elements("cells in space", cells, fields.cell_dofs, numbers)
        super().__init__(
            ElasticCellInSpace(alike(scheme)), elements, setting, kind="connectors"
        )
        self.kind = "beams"

    def turns(self, of_vertices: Index) -> Index:
        """Return the places in the states of the quaternions of vertices; (num_vertices, 4)."""
        cell, second = of_vertices.T[:, :, None]
        own = np.searchsorted(self._elements.indices, cell)
        row = own // BATCH * len(self.statement.state) + 4 * second + np.arange(4)
        return np.asarray(row * BATCH + own % BATCH)

    @property
    def states(self) -> Array:
        """States of all cells, in batches."""
        return self._states

    def phases(self, callbacks: Callbacks) -> Phases:
        """See the base class."""
        return super().phases(callbacks)._replace(change=loop("change_of_block", self._c))


@dataclass(frozen=True)
class DeadMoment(StatementInSpace):
    """Moment at a node with a constant direction; it is not conservative."""

    nodes = 1
    numbers = "m0", "m1", "m2"
    of_step = ("factor",)

    def equations(self, at: Inputs) -> Equations:
        """See the base class."""
        turn = Turn(at.stage, self.change(at, "abc", 0), self.quaternion(at, 0))
        M = scale(at["factor"], tuple(at[f"m{i}"] for i in range(3)))
        forces = [ufl.as_ufl(0.0)] * 3 + [-x for x in turn.on_node(M)]
        return Equations(forces, self.new_state([turn]))


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
    return [Block(DeadMoment(setting.scheme), elements, setting, supplies="loads")]
