# SPDX-License-Identifier: MIT
"""Statement of rigid-plastic connectors, such as plastic hinges of zero length."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
import ufl
from ufl.core.expr import Expr

from ufl_beam.arrays import Array, Index
from ufl_beam.blocks.block import BlockSetting
from ufl_beam.blocks.connectors import ConnectorBlock, Data, OnConnector, Step
from ufl_beam.blocks.material_points import EXHAUSTED, FREED_STIFFNESS
from ufl_beam.blocks.nodes_in_space import places_of_turns, quaternion_names
from ufl_beam.blocks.statement import Equations, Inputs
from ufl_beam.compiled.c_library import lib
from ufl_beam.compiled.simd_kernels import BATCH, in_batches
from ufl_beam.discretization.dof_numbering import DofNumbering
from ufl_beam.mechanics.connector_equations import (
    RigidPlasticStep,
    parameters,
    rigid_plastic_step,
)
from ufl_beam.model.bodies import Place
from ufl_beam.model.connectors import Connector, law_of, place_of
from ufl_beam.model.material_law import traced
from ufl_beam.model.material_laws import ElastoPlastic
from ufl_beam.model.softening_laws import SofteningLaw

REFERENCE_MOTION = 0.01
"""Motion m for which r m is the limit force, in rad or as a fraction of scene size.

The factor r decides whether a connector slips in an iterate; solutions do not depend on it.
"""

LEAST_SLOPE = 1e-9
"""Least r, as a multiple of EI of the beam divided by the size of the scene."""

FAR = 1e307  # instead of an infinite limit


def _slope(connector: Connector, size: float) -> float:
    """Return r, the factor of the motion in the equation of a connector, see :class:`Hinged`.

    r exceeds the steepest slope of softening, so that an open hinge stays open.  For weak hinges r
    is large enough that the motion, not the round-off of the force, decides the direction of slip.
    """
    law = law_of(connector)
    if not 0.0 < law.limit < np.inf:
        return 1.0
    steepest, _ = law.steepest
    early = law.limit / (REFERENCE_MOTION * (1.0 if connector.is_rotation else size))
    least = (
        LEAST_SLOPE * connector.a.beam.section.EI / size if isinstance(connector.a, Place) else 0.0
    )
    return float(max(early, least)) + (2 * steepest if steepest < np.inf else 0.0)


def prototype_of(law: SofteningLaw | ElastoPlastic) -> SofteningLaw | ElastoPlastic:
    """Return a law of the same kind with other parameters."""
    return ElastoPlastic(1.0) if isinstance(law, ElastoPlastic) else law.kind()


@dataclass(frozen=True)
class Hinged(OnConnector):
    """Held until the force reaches a limit; then the law gives the force of the slip in the step.

    With the motion m, the resistance R after it, and any r > 0, the equation for the force f is

        r m = 0 where abs(f + r m) <= R, else f = R or -R:

    its residual is continuous in f and m, as Newton's method requires.  The laws are these
    equations divided by r.  So the laws of held connectors are motions, and their tangent is
    symmetric.  While connectors are held in the search, their excess is abs(force) / limit - 1.

    Between connectors that all soften, a node without inertia has a negative stiffness, and
    Newton's method moves it against the unbalanced force, toward an unstable equilibrium.  With the
    sign of softening changed ("stiffened") it moves with the unbalanced force, as a node with
    little inertia does.

    Attributes:
        prototype: Law with other parameters.
    """

    prototype: SofteningLaw | ElastoPlastic
    of_step = ("dt",)
    modes = ("direction",)  # of slip, or 0

    @cached_property
    def data(self) -> Data:
        """See the base class."""
        state = "slipped", "start", "limit", "back force", "last direction"
        recorded = {"dissipated": lib.RECORDED_TOTAL, "nodal": lib.RECORDED_STATE}
        numbers = ["r", "strength", *parameters(self.prototype)]
        return Data(numbers, dict.fromkeys(state, 0.0), recorded, opens=True)

    def values(self, connector: Any, setting: BlockSetting) -> tuple[Sequence[float], Any]:
        """See the base class."""
        law = law_of(connector)
        return [_slope(connector, setting.scene.size), 1.0, *parameters(law).values()], None

    def law(self, at: Inputs, step: Step) -> Equations:
        """See the base class."""
        (e1,), (λ,), r, start = step.e1, step.λ, at["r"], at["start"]
        motion, limit = e1 - start, at["limit"] * (1 + 1e-12)

        def stepped(slip: Any, way: Any) -> RigidPlasticStep:
            names = ("slipped", "start", "dt", *parameters(self.prototype))
            θ = ufl.as_ufl(self.scheme.theta)
            values = {name: at[name] for name in names} | {"slip": slip, "direction": way, "θ": θ}
            with traced(self.prototype):
                return rigid_plastic_step(self.prototype, values, self.scheme)

        def positive(x: Any) -> Expr:
            return ufl.conditional(ufl.gt(x, 0.0), x, 0.0)

        # The direction of slip in an iterate
        tested = λ - at["back force"] + r * motion
        sign, free = (ufl.conditional(ufl.lt(x, 0.0), -1.0, 1.0) for x in (tested, motion))
        over, moves = ufl.gt(abs(tested), limit), ufl.gt(sign * motion, 0.0)
        resistance = stepped(positive(sign * motion), sign).force
        slips = ufl.gt(sign * (λ + r * motion - resistance), 0.0)
        opens = ufl.conditional(
            moves, ufl.conditional(slips, 1.0, 0.0), ufl.conditional(over, 1.0, 0.0)
        )
        rested = ufl.And(ufl.gt(at["held"], 0.0), ufl.eq(at["last direction"], 0.0))
        exhausted = ufl.eq(at["limit"], 0.0)
        found = ufl.conditional(rested, 0.0, sign * opens)
        safe = ufl.conditional(exhausted, 1.0, at["limit"])
        grown = ufl.conditional(over, abs(tested) / safe - 1.0, 0.0)
        excess = ufl.conditional(exhausted, 0.0, ufl.conditional(rested, grown, 0.0))
        opened = ufl.conditional(exhausted, 0.0, abs(found))
        # The law; beyond the clamp of the slip it keeps its slope
        way = at["direction"]
        slip = at.stage(positive(way * motion), way * motion)
        now = stepped(slip, way)
        force = at["strength"] * now.force
        slope = at.stage(abs(ufl.diff(force, slip)), 0.0)
        stiffened = ufl.conditional(ufl.gt(at["stiffened"], 0.0), slope * e1, force)
        held = ufl.eq(way, 0.0)
        given = at.stage(*(ufl.conditional(held, 0.0, x) for x in (force, stiffened)))
        residual = ufl.conditional(held, motion, (given - λ) / r)
        counts = ufl.lt(at["limit"], FAR)
        dissipated, lost, stored = (
            ufl.conditional(counts, x, 0.0) for x in (now.dissipated, now.lost, now.stored)
        )
        hardens, loss = isinstance(self.prototype, ElastoPlastic), 2 * self.scheme.alpha
        numerical = {"numerical": loss * lost} if hardens and loss else {}
        stuck, slides = abs(λ - at["back force"]) - at["limit"], slip
        # The sum of the slips is recorded: motions of nodes have the round-off of constraints
        return Equations(
            [residual], {
                "slipped": at["slipped"] + slip, "start": start + way * slip,
                "limit": ufl.conditional(counts, now.limit, at["limit"]),
                "back force": ufl.conditional(counts, now.back_force, at["back force"]),
                "last direction": ufl.conditional(ufl.gt(slip, 0.0), way, 0.0),
            },
            stored={"hardening": stored} if hardens else {},
            lost={"hinges": dissipated} | numerical,
            modes={"direction": ufl.conditional(exhausted, free, found)},
            excess=excess, opened=opened, holds=[ufl.conditional(held, 1.0, 0.0)],
            margins=[ufl.conditional(held, stuck, slides)],
            recorded={
                "dissipated 0": dissipated, "nodal 0": e1, "motion 0": start + way * slip,
            },
        )  # fmt: skip


class HingeBlock(ConnectorBlock):
    """Rigid-plastic connectors with laws of one kind."""

    def __init__(self, statement: Hinged, *arguments: Any) -> None:
        super().__init__(statement, *arguments)
        names = "number yield_limit", "number limit"
        (at,) = (statement.numbers.index(x) for x in names if x in statement.numbers)
        self._initial_limit = self._numbers[:, at].copy()
        hardens = isinstance(statement.prototype, ElastoPlastic)
        self._frozen_strength = 1.0 if hardens else FREED_STIFFNESS
        self.state["limit"][:] = self._initial_limit

    @property
    def flow_direction(self) -> Array:
        """Direction of plastic slip in the latest iterate, 1 or -1; 0 without slip."""
        return self._of_connectors(self._w[:, -1])

    def _of_connectors(self, values: Array) -> Array:
        return np.ravel(values)[: len(self.connectors)]

    def motion(self, q: Array) -> Array:
        """See the base class; the recorded motion is the sum of the slips."""
        return self._in_step(q, "nodal")

    def start(self, q: Array) -> None:
        """See the base class: take the motions of the nodes as the accepted motions."""
        self.state["start"][:] = in_batches(self.motion_at_begin(q)[:, None], BATCH)[:, 0]
        super().start(q)

    def turns(self, numbering: DofNumbering) -> tuple[Index, Index]:
        """Return the places in the states of quaternions of vertices in no cell, in space."""
        names, pairs = self.statement.state, list[tuple[int, int, int]]()
        for hinge in {*numbering.scene.hinges} & {*self.connectors}:
            vertex = numbering.vertex(place := place_of(hinge))
            if vertex not in numbering.cells:
                turn = names.index(quaternion_names(int(hinge.b is place))[0])
                pairs.append((self.connectors.index(hinge), turn, vertex))
        own, first, vertices = np.reshape(pairs, (-1, 3)).astype(np.int64).T
        return places_of_turns(self, own, first), vertices

    def remaining(self) -> Array:
        """See the base class."""
        return np.where(self.flow_direction == 0, 1.0, 0.0)

    def dissipation(self, q1: Array) -> float:
        """Return the energy dissipated in a step to ``q1``; J.

        For a held connector with a force above its limit, the excess times 1 m or 1 rad is added.
        """
        limit, back = (self._of_connectors(self.state[x]) for x in ("limit", "back force"))
        excess = np.abs(q1[self.forces_at] - back) - limit * (1 + 1e-12)
        held = self.flow_direction == 0
        return float(self._in_step(q1, "dissipated").sum() + excess[held & (excess > 0)].sum())

    def freeze(self) -> None:
        """Hold connectors from now on; connectors with exhausted limits move freely."""
        spent = self.state["limit"] <= EXHAUSTED * self._initial_limit
        self.state["limit"][:] = np.where(spent, 0.0, FAR)
        self.input("strength")[:] = self._frozen_strength
        super().freeze()
