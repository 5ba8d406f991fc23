# SPDX-License-Identifier: MIT
"""Statement of dry friction."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import ufl
from ufl.core.expr import Expr

from ufl_beam.blocks.block import BlockSetting, InTime
from ufl_beam.blocks.connectors import Data, OnConnector, Step
from ufl_beam.blocks.statement import Equations, Inputs
from ufl_beam.compiled.c_library import lib
from ufl_beam.mechanics.connector_equations import law_step
from ufl_beam.mechanics.time_scheme import has_inertia
from ufl_beam.model.connector_law import ConnectorLaw
from ufl_beam.model.material_law import State, traced
from ufl_beam.terms.derivatives import FAR

CREEP = 1e-12
"""Motion of a sticking connector in a step with its limit force; rad, or fraction of scene size.

Sticking connectors creep only if several of them may constrain the same motion.  The creep then
determines how they share the force.
"""

ROUND_OFF = 1e-14
"""Motion that is nothing but round-off; rad, or fraction of scene size."""


@dataclass(frozen=True)
class Rubbing(OnConnector):
    """Dry friction: sticks while its force is below the limit, or slips against the sliding force.

    A connector slips until the sliding velocity reverses, in the middle of the step or at its end.
    In a long step, both slip with a reversed velocity and rest can be solutions; rest is taken if
    it gives no energy.  A sticking connector moves in the step so that its velocity is zero at the
    end.  Without this motion, the previous velocity would come back.

    If the sliding force can be below the limit, both sticking and sliding can be solutions.  In the
    search each connector then stays on the branch of the last step until an equilibrium is found;
    the excess measures the violation of that branch.

    Attributes:
        prototype: Law of limit and sliding force, with other parameters; None for a force that
            does not depend on the motion.
    """

    prototype: ConnectorLaw | None
    modes = "slip", "against"
    """Direction of slip, or 0; whether coming to rest would give energy."""

    @property
    def rates(self) -> int:
        """See the base class: velocities decide where a motion comes to rest."""
        return int(has_inertia(self.scheme))

    @property
    def of_step(self) -> list[str]:
        """See the base class."""
        of_rest = [f"rates 0 {j}" for j in range(3)] if self.rates else []
        return ["dt", *of_rest, *["wanted"] * (self.prototype is None)]

    @cached_property
    def data(self) -> Data:
        """See the base class."""
        more, last = ["tiny", "softness"], {"last slip": 0.0}
        if self.prototype is None:
            return Data(more, last, name="Coulomb")
        dissipated = {"dissipated": lib.RECORDED_TOTAL}
        data = Data.of(self.prototype, more, dissipated, opens=True)
        return data._replace(variables=last | {**data.variables})

    def values(self, connector: Any, setting: BlockSetting) -> tuple[Sequence[float], Any]:
        """See the base class; C takes limits that depend on other forces from an array."""
        size = 1.0 if connector.is_rotation else setting.scene.size
        numbers = [ROUND_OFF * size, CREEP * size * setting.friction_repeats]
        if self.prototype is None:
            return numbers, InTime(setting.requested_forces(connector), connector, "whole")
        return [*numbers, *connector.law.parameters().values()], None

    def _forces(self, at: Inputs, step: Step) -> tuple[Expr, Expr, dict[str, Expr]]:
        """Return the limit, the sliding force, and the variables after the step."""
        law = self.prototype
        if law is None:
            return at["wanted"], at["wanted"], {}
        names = [*(f"state {x}" for x in law.variables), *(f"number {x}" for x in law.parameters())]
        given = {name: at[name] for name in names} | {
            "dt": at["dt"], "theta": ufl.as_ufl(self.scheme.theta),
            "before 0": step.e0[0], "motion 0": step.e1[0],
        }  # fmt: skip
        with traced(law):
            end = law_step(law, given, self.scheme)
            old = State({name: at[f"state {name}"] for name in law.variables})
            numbers = {name: at[f"number {name}"] for name in law.parameters()}
            limit = ufl.as_ufl(law.with_parameters(numbers).limit(old))
        after = {f"state {n}": x for n, x in zip(law.variables, end.variables, strict=True)}
        return _if(ufl.gt(limit, 0.0), limit, 0.0), end.forces[0], after

    def law(self, at: Inputs, step: Step) -> Equations:
        """See the base class."""
        (e0,), (e1,), (λ,), (work,) = step.e0, step.e1, step.λ, step.work
        limit, sliding, after = self._forces(at, step)
        to_rest: Any = 0.0
        if self.rates:
            to_rest = -(at["rates 0 1"] + at["rates 0 2"]) / at["rates 0 0"] * step.rate[0]
        slip, against, moved = at["slip"], at["against"], e1 - e0
        fresh, stuck = ufl.gt(at["fresh"], 0.0), ufl.eq(slip, 0.0)
        goes_on = ufl.eq(against, 0.0)
        slows = ufl.And(goes_on, ufl.gt(slip * to_rest, 0.0))
        beyond = slip * _if(slows, moved - to_rest, moved)
        back = ufl.And(ufl.Not(stuck), ufl.lt(beyond, -at["tiny"]))
        # The force of the initial guess belongs to another motion
        gives = ufl.And(ufl.And(ufl.Not(fresh), goes_on), ufl.And(stuck, ufl.lt(λ * to_rest, 0.0)))
        over = ufl.And(stuck, ufl.gt(abs(λ), limit * (1 + 1e-12)))
        held = ufl.gt(at["held"], 0.0)
        grown = abs(λ) / _if(ufl.gt(limit, 0.0), limit, 1.0) - 1.0
        over_limit = _if(ufl.gt(limit, 0.0), grown, FAR)
        excess = _if(ufl.Or(back, gives), FAR, _if(over, over_limit, 0.0))
        next_slip = _if(back, 0.0, _if(over, _if(ufl.lt(λ, 0.0), -1.0, 1.0), slip))
        sticks = ufl.And(stuck, ufl.gt(limit, 0.0))
        creep = at["softness"] / _if(ufl.gt(limit, 0.0), limit, 1.0)
        rest = e1 - creep * λ - e0 - _if(ufl.gt(against, 0.0), 0.0, to_rest)
        lost = {"friction" if self.prototype is None else self.prototype.entry: work}
        return Equations(
            [_if(sticks, rest, λ - slip * sliding)], {"last slip": slip, **after}, lost=lost,
            modes={
                "slip": _if(held, slip, next_slip),
                "against": _if(held, against, _if(gives, 1.0, against)),
            },
            excess=_if(held, excess, 0.0), holds=[_if(sticks, 1.0, 0.0)],
            margins=[_if(sticks, abs(λ) - limit, slip * moved)],
            recorded={} if self.prototype is None else {"dissipated 0": work},
        )  # fmt: skip


def _if(condition: Any, yes: Any, no: Any) -> Expr:
    return ufl.conditional(condition, yes, no)
