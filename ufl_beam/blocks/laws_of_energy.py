# SPDX-License-Identifier: MIT
"""Statements of connector laws of energy and resistance."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any

import numpy as np
import ufl

from ufl_beam.arrays import Array
from ufl_beam.blocks.block import BlockSetting
from ufl_beam.blocks.connectors import ConnectorBlock, Data, OnConnector, Step
from ufl_beam.blocks.statement import Equations, Inputs
from ufl_beam.compiled.c_library import fill, lib
from ufl_beam.mechanics.connector_equations import law_step
from ufl_beam.model.connector_law import ConnectorLaw
from ufl_beam.model.material_law import State, traced

SMALL_MOTION = 1e-6
"""Motion for the elastic stiffness of a law; rad, or fraction of the size of the scene."""


@dataclass(frozen=True)
class OfEnergy(OnConnector):
    """Law with an energy, a resistance, or both.

    Attributes:
        prototype: The law, with other parameters.
        elastic: Whether the laws lose no energy.
        constant: Whether internal variables are constant.
    """

    prototype: ConnectorLaw
    elastic: bool
    constant: bool = False
    of_step = ("dt",)

    @property
    def integrates(self) -> bool:
        """True if works are computed on the path of a step, for which the forces are exact."""
        return self.prototype.rate_independent and bool(self.scheme.weight_of_before)

    @property
    def frozen(self) -> OfEnergy:
        """See the base class."""
        return replace(self, constant=bool(self.prototype.variables))

    @cached_property
    def data(self) -> Data:
        """See the base class."""
        recorded = {} if self.elastic else {"dissipated": lib.RECORDED_TOTAL}
        return Data.of(self.prototype, ["path"] * self.integrates, recorded)

    def values(self, connector: Any, setting: BlockSetting) -> tuple[Sequence[float], Any]:
        """See the base class."""
        return [*[0.0] * self.integrates, *connector.law.parameters().values()], None

    def law(self, at: Inputs, step: Step) -> Equations:
        """See the base class; work that is not stored is lost."""
        law, components = self.prototype, range(self.laws)
        names = [*(f"state {x}" for x in law.variables), *(f"number {x}" for x in law.parameters())]
        given = {name: at[name] for name in names} | {
            "dt": at["dt"], "theta": ufl.as_ufl(self.scheme.theta),
        }  # fmt: skip

        def after(motions: Sequence[Any]) -> Any:
            pairs = zip(("before", "motion"), (step.e0, motions), strict=True)
            motion = {f"{name} {i}": e[i] for name, e in pairs for i in components}
            return law_step(law, given | motion, self.scheme, frozen=self.constant)

        with traced(law):
            end = after(step.e1)
            old = State({name: at[f"state {name}"] for name in law.variables})
            numbers = {name: at[f"number {name}"] for name in law.parameters()}
            before = law.with_parameters(numbers).energy(law.as_argument(step.e0), old)
            power, work = None, sum(step.work, 0)
            if self.integrates:
                changes = [now - e0 for e0, now in zip(step.e0, step.e1, strict=True)]
                moved = [e0 + at["path"] * x for e0, x in zip(step.e0, changes, strict=True)]
                forces, work = after(moved).forces, at["path"]
                power = sum((f * x for f, x in zip(forces, changes, strict=True)), 0)
        lost = {} if self.elastic else {law.entry: work - (end.stored - before) - end.numerical}
        of_scheme = self.scheme.weight_of_before == 0.0 and self.scheme.load_weight > 0.5
        numerical = {"numerical": end.numerical} if of_scheme else {}
        variables = [*vars(old).values()] if self.constant else end.variables
        none = ufl.as_ufl(0.0)
        dissipated = {f"dissipated {k}": none for k in components if lost}
        if lost:  # the first component has the loss
            dissipated["dissipated 0"] = lost[law.entry]
        return Equations(
            [λ - f for λ, f in zip(step.λ, end.forces, strict=True)],
            {f"state {n}": x for n, x in zip(law.variables, variables, strict=True)},
            {"stored": end.stored}, lost | numerical, power=power, recorded=dissipated,
            before={"stored": ufl.as_ufl(before)} if law.variables else {},
        )  # fmt: skip


class LawBlock(ConnectorBlock):
    """Connectors with laws of one class; each law has its own parameters."""

    def __init__(self, statement: OfEnergy, *arguments: Any) -> None:
        super().__init__(statement, *arguments)
        self._law, self._shown = statement.prototype, len(statement.recorded)
        self._stiffness: Array = np.zeros(len(self.connectors))
        if self._law.variables:
            self._stiffness = self._elastic_stiffness()
            fill(self._c, stiffness=self._stiffness)

    def _laws(self) -> tuple[ConnectorLaw, State]:
        """Return the law with arrays of parameters, and the variables of the accepted state."""
        law, n = self._law, len(self.connectors) // self.statement.laws
        of_elements: list[Any] = [c.law for c in self.connectors[:: self.statement.laws]]
        laws = [x.parameters() for x in of_elements]
        parameters = {name: np.array([x[name] for x in laws]) for name in law.parameters()}
        variables = {name: self.state[f"state {name}"].ravel()[:n] for name in law.variables}
        return law.with_parameters(parameters), State(variables)

    def _elastic_stiffness(self) -> Array:
        """Return the derivatives of elastic forces by their motions at rest; (num_connectors,)."""
        (law, variables), k = self._laws(), self.statement.laws
        size = self._subdomain.numbering.scene.size
        lengths = np.where([c.is_rotation for c in self.connectors], 1.0, size)
        moved = SMALL_MOTION * lengths.reshape(-1, k).T
        rest = [*np.zeros(moved.shape)]
        forces, slopes = law.elastic_forces(rest, variables), np.empty_like(moved)
        for i, δ in enumerate(moved):
            motions = [*rest[:i], rest[i] + δ, *rest[i + 1 :]]
            slopes[i] = np.abs(law.elastic_forces(motions, variables)[i] - forces[i]) / δ
        return slopes.T.ravel()

    def put_forces(self, q: Array) -> None:
        """See the base class."""
        (law, variables), k = self._laws(), self.statement.laws
        motions = self.motion(q).reshape(-1, k).T
        q[self.forces_at] = np.column_stack(law.elastic_forces([*motions], variables)).ravel()
        self.commit(q)

    def remaining(self) -> Array:
        """See the base class."""
        k, whole = self.statement.laws, np.ones(len(self.connectors))
        slopes = -np.einsum("ijj->ij", self.law_slopes[:, 2:].reshape(-1, k, k)).ravel()
        stiff = self._stiffness > 0
        return np.asarray(np.divide(slopes, self._stiffness, out=whole, where=stiff))

    def dissipation(self, q1: Array) -> float:
        """See the base class; only of rate-independent laws.  Round-off is no loss.

        The work is computed by the trapezoidal rule, which is smooth in ``q1``.
        """
        k, n = self.statement.laws, len(self.statement.unknowns)
        if not self._law.rate_independent or not self.statement.data.recorded:
            return 0.0
        before = self._w[:, n : 2 * n].transpose(0, 2, 1).reshape(-1, n)
        q0 = q1.copy()
        q0[self._elements.dofs] = before[: len(self._elements.dofs)]

        def ends(q: Array) -> tuple[Array, Array, Array]:
            """Return forces, motions and stored energies of the elements at ``q``."""
            residuals = np.zeros(len(q))
            self.add_residual(q, residuals)
            forces, motions = (q - residuals)[self.forces_at], self.motion(q)
            stored = self.outputs(self._kernels.end)[:, len(self.statement.state) + self._shown]
            return forces.reshape(-1, k), motions.reshape(-1, k), stored

        (f0, e0, stored0), (f1, e1, stored1) = map(ends, (q0, q1))
        mean, change = (f0 + f1) / 2, e1 - e0
        lost = (mean * change).sum(axis=1) - (stored1 - stored0)
        size = (np.abs(mean) * np.abs(change)).sum(axis=1)
        return float(lost[lost > 1e-12 * size].sum())
