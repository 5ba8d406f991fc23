# SPDX-License-Identifier: MIT
"""Base of the statements of connectors: laws of relative motions, whose forces are unknowns.

The force of a connector resists the growth of its motion.  A law is an equation between the force
and the motion in a step.
"""

from __future__ import annotations

import math
from abc import abstractmethod
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any, NamedTuple

import numpy as np
import ufl
from ufl.core.expr import Expr

from ufl_beam.arrays import Array, Index
from ufl_beam.blocks.block import Block, BlockSetting, Elements
from ufl_beam.blocks.nodes_in_space import (
    UNKNOWNS,
    new_state,
    quaternion_names,
    turn_in_step,
    unknowns,
    vector,
)
from ufl_beam.blocks.statement import Equations, Inputs, Statement
from ufl_beam.compiled.c_library import doubles, fill, lib, loop
from ufl_beam.compiled.simd_kernels import BATCH, in_batches
from ufl_beam.discretization.state_io import NOWHERE, Archive
from ufl_beam.mechanics.kinematics import COMPONENTS
from ufl_beam.mechanics.relative_motions import MOTIONS, Geometry, Pair
from ufl_beam.mechanics.spatial_kinematics import Turn
from ufl_beam.mechanics.spatial_motions import (
    SPATIAL_MOTIONS,
    TURNING,
    GeometryInSpace,
    NodeInStep,
    whole_turns,
)
from ufl_beam.mechanics.time_scheme import Scheme
from ufl_beam.model.connector_law import ConnectorLaw
from ufl_beam.model.connector_laws import Controller
from ufl_beam.model.connectors import Connector
from ufl_beam.terms.derivatives import Each, Neighbours
from ufl_beam.terms.term import Callbacks, Phases

WITHOUT_PLACES = "turning", "guided"
"""Motions that depend on no :class:`Geometry`."""

PLACES = [f"{vector} {c}" for vector in Geometry._fields for c in "xy"]
"""Names of the components of a :class:`Geometry`."""

PLACES_IN_SPACE = [f"{vector} {c}" for vector in GeometryInSpace._fields[:-1] for c in "xyz"]
"""Names of the components of the vectors of a :class:`GeometryInSpace`."""

RECORDED = {
    "motion": lib.RECORDED_STATE, "work": lib.RECORDED_WORK, "rate": lib.RECORDED_STEP,
}  # fmt: skip
"""Numbers of each motion that solutions record; fields of :class:`Connection`."""


class Step(NamedTuple):
    """Motions and forces of a connector in a step, one for each law."""

    e0: Sequence[Expr]  # before the step
    e1: Sequence[Expr]  # at its end
    λ: Sequence[Expr]
    work: Sequence[Expr]  # in the step
    rate: Sequence[Expr]  # rates of the motions before the step, of statements with rates


class Data(NamedTuple):
    """Data of a law of a connector besides its equations.

    Attributes:
        numbers: Names of the parameters of the law.
        variables: Initial values of the state besides forces, by name.
        recorded: Fields of :class:`Connection` besides :data:`RECORDED`, with their kinds.
        opens: True if connectors are held in the search for the one that opens first.
        name: Name in files; by default the name of the statement.
    """

    numbers: Sequence[str] = ()
    variables: Mapping[str, float] = {}
    recorded: Mapping[str, int] = {}
    opens: bool = False
    name: str = ""

    @classmethod
    def of(
        cls, law: ConnectorLaw, more: Sequence[str], recorded: Mapping[str, int], *,
        opens: bool = False,
    ) -> Data:  # fmt: skip
        """Return the data of a law of a user, with more numbers before its parameters."""
        numbers = [*more, *(f"number {name}" for name in law.parameters())]
        variables = {f"state {name}": value for name, value in law.variables.items()}
        return cls(
            numbers, variables, recorded, opens, f"{type(law).__qualname__}{[*law.variables]}"
        )


@dataclass(frozen=True)
class OnConnector(Statement):
    """Laws of the relative motions of two nodes.

    Attributes:
        motions: Names in :data:`MOTIONS`, one for each law.
        scheme: Scheme of the virtual motions.
    """

    motions: tuple[str, ...]
    scheme: Scheme
    nodes = 2

    @property
    def in_space(self) -> bool:
        """True for motions of :data:`SPATIAL_MOTIONS`."""
        return self.motions[0] in SPATIAL_MOTIONS

    @cached_property
    def unknowns(self) -> list[str]:
        """See the base class."""
        forces = [f"force{k}" for k in range(self.laws)]
        return [*unknowns(2), *forces] if self.in_space else super().unknowns

    @property
    def laws(self) -> int:
        """See the base class."""
        return len(self.motions)

    @cached_property
    def data(self) -> Data:
        """Data of the law."""
        return Data()

    def values(self, connector: Any, setting: BlockSetting) -> tuple[Sequence[float], Any]:
        """Return the parameters of a connector, and its number "wanted" in time, if there is one.

        By default the parameters are zero.
        """
        return [0.0] * len(self.data.numbers), None

    @cached_property
    def numbers(self) -> list[str]:
        """Parameters of the law; geometry of each motion, if it depends on places."""
        moving = (k for k, motion in enumerate(self.motions) if motion not in WITHOUT_PLACES)
        places = PLACES_IN_SPACE if self.in_space else PLACES
        return [*self.data.numbers, *(f"{name} {k}" for k in moving for name in places)]

    @cached_property
    def state(self) -> list[str]:
        """Forces at the end of the last step, if they are in the work of a step; variables.

        In space whole turns, and the quaternions of both nodes follow.
        """
        before = bool(self.scheme.weight_of_before)
        turns = [f"whole turns {k}" for k, x in enumerate(self.motions) if x == TURNING]
        turns += [x for k in range(2 * self.in_space) for x in quaternion_names(k)]
        return [*(f"force {k}" for k in range(before * self.laws)), *self.data.variables, *turns]

    @cached_property
    def recorded(self) -> dict[str, int]:
        """See the base class."""
        kinds = RECORDED | {**self.data.recorded}
        return {f"{x} {k}": kind for k in range(self.laws) for x, kind in kinds.items()}

    @abstractmethod
    def law(self, at: Inputs, step: Step) -> Equations:
        """Return an equation for each motion, a residual of motions or of forces, as ``forces``.

        The other functions are the energies, and the state and recorded numbers besides those that
        all connectors have.
        """

    def equations(self, at: Inputs) -> Equations:
        """See the base class."""
        components = UNKNOWNS if self.in_space else COMPONENTS
        virtual = [[ufl.variable(ufl.as_ufl(0.0)) for _ in components] for _ in range(self.nodes)]
        relative = self._in_space if self.in_space else self._in_plane
        found, turned = relative(at, virtual)
        e0, e1, rates, variations = (list[Expr]() for _ in range(4))
        for before, now, variation, *rate in found:
            e0.append(at.stage(before))
            nodal = self.unknowns[: -self.laws] if self.rates and not rate else ()
            slopes = (ufl.diff(before, at[f"q0 {x}"]) * at[f"rate1 {x}"] for x in nodal)
            rates.append(at.stage(sum(slopes, *rate or [ufl.as_ufl(0.0)])))
            e1.append(at.stage(now))
            variations.append(variation)
        λ = [at[f"q1 force{k}"] for k in range(self.laws)]
        a, pairs = self.scheme.weight_of_before, [*zip(e0, e1, strict=True)]
        mean = [a * at[f"force {k}"] + (1 - a) * x if a else x for k, x in enumerate(λ)]
        works = [force * (now - before) for force, (before, now) in zip(mean, pairs, strict=True)]
        law = self.law(at, Step(e0, e1, λ, works, rates))
        work = sum((x * de for x, de in zip(λ, variations, strict=True)), 0)
        forces = [ufl.diff(work, v[i]) for i in range(len(components)) for v in virtual]
        recorded = dict[str, Expr]()
        for k, ((before, now), work) in enumerate(zip(pairs, works, strict=True)):
            values = now, work, (now - before) / at["dt"]
            recorded |= {f"{x} {k}": value for x, value in zip(RECORDED, values, strict=True)}
        state = {f"force {k}": x for k, x in enumerate(λ)} | {**law.state} | turned
        return law._replace(
            forces=[*forces, *law.forces], state=state, motions=e1,
            recorded=recorded | {**law.recorded},
        )  # fmt: skip

    def _in_plane(self, at: Inputs, virtual: Any) -> tuple[list[tuple[Expr, ...]], dict[str, Expr]]:
        """Return each motion before and after the step and its variation; no further state."""
        w, found = Pair(*map(ufl.as_vector, virtual)), []
        q0, q1 = (Pair(*at.motions(group)) for group in ("q0", "q1"))
        for k, motion in enumerate(self.motions):
            none, names = dict.fromkeys(PLACES, 0.0), [f"{name} {k}" for name in PLACES]
            given = none.values() if motion in WITHOUT_PLACES else [at[name] for name in names]
            geometry = Geometry(*map(ufl.as_vector, np.reshape([*given], (-1, 2)).tolist()))
            before, _ = MOTIONS[motion](q0, q0, w, geometry, self.scheme)
            found.append((before, *MOTIONS[motion](q0, q1, w, geometry, self.scheme)))
        return found, {}

    def _in_space(self, at: Inputs, virtual: Any) -> tuple[list[tuple[Expr, ...]], dict[str, Expr]]:
        """Return the same of motions in space; the state is whole turns, and quaternions of nodes.

        If the statement has rates, each motion also has its rate before the step, which is its
        variation by the velocities in a step of zero.
        """
        turns = [turn_in_step(at, k, self.scheme) for k in (0, 1)]
        u = ([vector(at, group, "xyz", k) for k in (0, 1)] for group in ("q0", "q1"))
        a, b = [
            NodeInStep(before, now, turn, tuple(w[:3]), tuple(w[3:]), self.scheme)
            for before, now, turn, w in zip(*u, turns, virtual, strict=True)
        ]
        at_rest = [
            NodeInStep(
                x.u0, x.u0, Turn(_same, (ufl.as_ufl(0.0),) * 3, x.turn.q0),
                vector(at, "rate1", "xyz", k), vector(at, "rate1", "abc", k), self.scheme,
            )
            for k, x in enumerate((a, b) if self.rates else ())
        ]  # fmt: skip
        found, state = list[tuple[Expr, ...]](), new_state(turns)
        for k, motion in enumerate(self.motions):
            given = np.reshape([at[f"{name} {k}"] for name in PLACES_IN_SPACE], (-1, 3))
            geometry = GeometryInSpace(*map(tuple, given.tolist()))
            if motion == TURNING:
                geometry = geometry._replace(whole=at[f"whole turns {k}"])
                state[f"whole turns {k}"] = whole_turns(a, b, geometry)
            moved = [*SPATIAL_MOTIONS[motion](a, b, geometry, self.scheme)]
            if at_rest:
                begun = at_rest[0], at_rest[1], geometry, self.scheme
                moved.append(SPATIAL_MOTIONS[motion](*begun)[2])
            found.append(tuple(moved))
        return found, state


def _same(x: Expr) -> Expr:
    return x


def geometry_of(c: Connector) -> list[float]:
    """Return the numbers of a :class:`Geometry`, or of a :class:`GeometryInSpace`."""
    d = len(c.apart)
    found = [*c.arms[0], *c.arms[1], *c.apart, *(*c.axis, 0.0)[:d]]
    return [*found, *(c.other or [0.0] * 3)] if d == 3 else found


class ConnectorBlock(Block):
    """Connectors with the same statement.

    Args:
        statement: Law.
        setting: Equation of a step.
        all_connectors: Index of each connector with the statement in the scene.

    Attributes:
        statement: Law.
        indices: Indices of the connectors of this process in :attr:`Scene.all_connectors`.
        connectors: The connectors; each component of a :class:`Bushing` counts as a connector.
        law: Law of the first connector in the scene.
        forces_at: Local degrees of freedom of the forces; (num_connectors,).
        rate: Mean rate of the motions in the last step; (num_connectors,); m/s or rad/s.
        fields: Pairs of a field of :class:`Connection` and an array of the accepted state, which
            later steps change, (num_connectors,).
    """

    def __init__(
        self, statement: OnConnector, setting: BlockSetting, all_connectors: Index
    ) -> None:
        subdomain, scene = setting.subdomain, setting.scene
        self.statement: OnConnector
        k, self._of_kind = statement.laws, all_connectors
        has_statement = np.zeros(len(scene.all_connectors), dtype=bool)
        has_statement[all_connectors] = True
        mine = np.flatnonzero(has_statement[subdomain.connectors])
        self.indices: Index = subdomain.connectors[mine]
        self.connectors: list[Connector] = [scene.all_connectors[i] for i in self.indices]
        dofs = subdomain.connector_dofs[mine].astype(np.int32)
        self.forces_at: Index = dofs[:, -1]
        moving = [j for j, x in enumerate(statement.motions) if x not in WITHOUT_PLACES]
        of_kind = [scene.all_connectors[i] for i in all_connectors]
        values = [statement.values(c, setting) for c in of_kind]
        positions = np.searchsorted(all_connectors, self.indices)
        numbers = [
            [*values[positions[i]][0], *(
                x for c in (self.connectors[i + j] for j in moving)
                for x in geometry_of(c)
            )]
            for i in range(0, len(mine), k)
        ]  # fmt: skip
        self.law: Any = of_kind[0].law
        in_time = [x for _, x in values if x is not None]
        elements = Elements(
            statement.data.name or type(statement).__name__, self.indices[::k],
            np.column_stack([dofs[::k, :-1], self.forces_at.reshape(-1, k)]),
            np.reshape(numbers, (len(numbers), len(statement.numbers))).T, in_time,
            {"wanted": positions} if in_time else {},
        )  # fmt: skip
        super().__init__(statement, elements, setting, kind="connectors")
        for name, value in statement.data.variables.items():
            self.state[name][:] = value
        rotates = [scene.all_connectors[i].is_rotation for i in all_connectors[:k]]
        fill(self._c, length=np.where(rotates, 1.0, scene.size))
        self.law_residual, self._inputs = loop("missed_by_block", self._c), dict[str, Array]()
        if statement.modes:
            self._excess, self._free = np.zeros(len(mine)), np.zeros(len(mine), dtype=np.int32)
            fill(
                self._c, search=setting.search, switched=setting.switched,
                opens=statement.data.opens, excess=self._excess, free=self._free,
            )  # fmt: skip
        self._fields = [*RECORDED, *statement.data.recorded]
        rows = self.recorded.reshape(len(mine), len(self._fields))
        self.fields = [
            (name, x) for name, x in zip(self._fields, rows.T, strict=True) if name != "nodal"
        ]
        self.rate = dict(self.fields)["rate"]

    @property
    def effect(self) -> str:
        """See the base class."""
        return type(self.law).__name__

    def describe(self, place: int) -> str:
        """Return the name of a connector."""
        return str(self.connectors[place])

    def derivatives(self, neighbours: Neighbours) -> list[Each] | None:
        """See the base class; controllers, and limits by other forces, have no derivatives."""
        laws = (c.law for c in self.connectors)
        given = any(isinstance(x, Controller) or getattr(x, "joint", None) for x in laws)
        return None if given else super().derivatives(neighbours)

    def phases(self, callbacks: Callbacks) -> Phases:
        """See the base class."""
        self.callbacks, made = callbacks, super().phases(callbacks)
        if not self.statement.modes:
            return made
        opens = self._c if self.statement.data.opens else None
        return made._replace(opens=opens, again=loop("begin_block_again", self._c))

    @property
    def flow_direction(self) -> Array:
        """Direction of plastic slip in the latest iterate, 1 or -1; 0 without slip."""
        return np.zeros(len(self.indices))

    @property
    def sticks(self) -> Array | None:
        """Numbers that are not zero where a law holds its motion; None for laws without modes."""
        return self.law_slopes[:, 0] if self.statement.modes else None

    def input(self, name: str) -> Array:
        """Return a view of an input of the elements, in batches."""
        if name not in self._inputs:
            self._inputs[name] = self._w[:, self.statement.inputs.index(name)]
        return self._inputs[name]

    def motion(self, q: Array) -> Array:
        """Return the relative motions at ``q``; (num_connectors,); m or rad."""
        return self._in_step(q, "motion")

    def motion_at_begin(self, q: Array) -> Array:
        """Return the relative motions in a state, where the next step begins; (num_connectors,).

        In space, a rotation is the state of a node and its change in a step.
        """
        self._begin(q, float(self._t[0]), dt=math.inf, fraction=0.0)
        return self.motion(q)

    def _in_step(self, q: Array, field: str) -> Array:
        """Return a recorded number of a step to ``q``, which is not accepted; (num_connectors,)."""
        lib.end_step_of_block(self._c, doubles(q), lib.COMPUTE)
        first, fields = len(self.statement.state), self._fields
        rows = self.outputs(self._kernels.end)[:, first : first + self.recorded.shape[1]]
        return rows.reshape(-1, len(fields))[:, fields.index(field)]

    def put_motions(self, q: Array, v: Array, works: Array) -> None:
        """Replace forces that laws determine by -1/β times their motions in a step ``v``.

        β is the derivative of the law by its force.
        """
        self.add_residual(q, np.zeros(len(q)))
        holds, β, *_ = self.law_slopes.T
        if (about_force := holds == 0.0).any():
            rates = self._along(self._kernels.motion_rates, q, [v]).ravel()
            works[self.forces_at[about_force]] = -rates[about_force] / β[about_force]

    @property
    def law_slopes(self) -> Array:
        """Each law in the latest residual: whether it holds; derivatives by force and motions.

        The shape is (num_connectors, 2 + laws).
        """
        k, motions = self.statement.laws, len(self.statement.unknowns)
        each = self._each[1][:, motions:].reshape(-1, k, k + 2, BATCH)
        rows = each.transpose(0, 3, 1, 2).reshape(-1, k + 2)
        return np.array(rows[: len(self.connectors)])

    def slopes(self, q: Array) -> Array:
        """Return the derivatives of each law by the motions at ``q``; (num_connectors, laws)."""
        self.add_residual(q, np.zeros(len(q)))
        return self.law_slopes[:, 2:]

    def commit(self, q: Array) -> None:
        """Set the forces before the next step to the forces in ``q``."""
        if self.statement.scheme.weight_of_before:
            k = self.statement.laws
            self._states[:, :k] = in_batches(q[self.forces_at].reshape(-1, k), BATCH)

    def save_or_restore(self, archive: Archive, q: Array) -> None:
        """Save or restore recorded numbers, states, and functions of time at the last step."""
        name, recorded = self._elements.name, self.recorded.reshape(-1, len(self._fields))
        if self._elements.in_time:
            mine = np.searchsorted(self._of_kind, self.indices)
            times = self._times[2, mine, None]
            self._times[2, mine] = archive.rows(f"functions of {name}", self.indices, times)[:, 0]
        k = self.statement.laws if self.statement.scheme.weight_of_before else 0
        self.keep_states(archive, k)
        forces = np.zeros(len(self.indices)) if q is NOWHERE else q[self.forces_at]
        if k:
            forces = self._states[:, :k].transpose(0, 2, 1).ravel()[: len(forces)]
        forces = archive.rows(f"forces of {name}", self.indices, forces[:, None])
        self._states[:, :k] = in_batches(forces.reshape(-1, k), BATCH) if k else 0.0
        if archive.has(f"recorded of {name}, {len(self._fields)}") and q is not NOWHERE:
            self.resume(q)
        recorded[:] = archive.rows(f"recorded of {name}", self.indices, recorded)

    def resume(self, q: Array) -> None:
        """Compute the energies of a restored state."""
        Block.start(self, q)

    def put_forces(self, q: Array) -> None:
        """Write the elastic forces of the initial configuration into its unknowns ``q``."""

    def remaining(self) -> Array:
        """Return the remaining fraction of elastic stiffness in the iterate; (num_connectors,)."""
        return np.ones(len(self.indices))

    def dissipation(self, q1: Array) -> float:
        """Return the plastic dissipation of these connectors in the step to ``q1``; J."""
        return 0.0
