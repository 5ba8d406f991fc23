# SPDX-License-Identifier: MIT
"""Equations of a law of a connector over a step, in UFL.

The law holds at t_n+θ: its variables there are those after a backward-Euler step of the length
θ dt, and grow on in proportion to the end of the step.  Its elastic force acts where loads do.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import NamedTuple

import ufl
from ufl.core.expr import Expr

from ufl_beam.mechanics.time_schemes import Scheme
from ufl_beam.model.connector_law import ConnectorLaw
from ufl_beam.model.material_law import State

SMOOTH = 1e-7
"""Difference of Gauss's rule with four points and Simpson's rule, as a part of the forces, up to
which the former has all digits.

Errors are of the eighth and the fourth order in the step h, with the factors 1 / 1778112000 and
1 / 2880: where that of Simpson's rule is 1e-7, that of Gauss's is (3e-4)² / 2e9, below round-off.
"""


class LawStep(NamedTuple):
    """A law over a step; J, forces in N or N m."""

    force: Expr  # that acts in the step
    stored: Expr  # at the end
    numerical: Expr  # lost by the scheme in the step
    variables: tuple[Expr, ...]  # at the end


def law_step(
    law: ConnectorLaw, at: Mapping[str, Expr], scheme: Scheme, *, frozen: bool = False
) -> LawStep:
    """State a step; ``frozen`` variables stay as they are.

    Numbers are by name: motions at the end of the step and before it, dt and theta, the
    variables before it as "state ...", and the numbers of the law as "number ...".
    """
    law = law.of({name: at[f"number {name}"] for name in law.numbers()})
    e0, e1, dt, θ, part = (
        *(at[n] for n in ("before", "motion", "dt", "theta")),
        scheme.load_weight,
    )
    e, rate = (1 - θ) * e0 + θ * e1, (e1 - e0) / dt
    names = () if frozen else tuple(law.variables)
    old = State({name: at[f"state {name}"] for name in law.variables})
    changes = law.increments(e, rate, old, θ * dt) if names else {}

    def after(part: Expr | float) -> State:
        """Variables after a part of the step."""
        return State(vars(old) | {n: getattr(old, n) + part / θ * changes[n] for n in names})

    resistance = ufl.as_ufl(law.resistance(e, rate, after(θ), dt))
    force = _elastic_force(law, e0, e1, after(part), scheme) + resistance
    end = {n: ufl.variable(ufl.as_ufl(z)) for n, z in vars(after(1.0)).items()}
    moved = ufl.variable(e1)
    stored = ufl.as_ufl(law.energy(moved, State(end)))
    numerical = ufl.as_ufl(0.0)
    if part > 0.5 and scheme.average(0.0, 1.0) != 1.0:  # works are exact increments of energy
        # What backward Euler loses: of second order, and positive of convex energies.
        growth = ufl.diff(stored, moved) * (e1 - e0)
        growth += sum(ufl.diff(stored, z) * (z - getattr(old, n)) for n, z in end.items())
        numerical = (2 * part - 1) * (law.energy(e0, old) - stored + growth)
    return LawStep(force, stored, numerical, tuple(end.values()))


def _elastic_force(law: ConnectorLaw, e0: Expr, e1: Expr, state: State, scheme: Scheme) -> Expr:
    """Force of the energy where loads act: over the step, at its end, or a mean of both.

    Over the step the force does the work of the change of the energy, that is their quotient.  In a
    small step the quotient has few digits, and the mean of the force by Gauss's rule has all.  So
    it is the latter where the force is smooth over the step, and the former at kinks and in large
    steps.
    """

    def force(e: Expr) -> Expr:
        at = ufl.variable(e)
        return ufl.diff(ufl.as_ufl(law.energy(at, state)), at)

    part = scheme.load_weight
    if part == 1.0:
        return force(e1)
    mean, way = scheme.mean(force, e0, e1), e1 - e0
    growth = ufl.as_ufl(law.energy(e1, state)) - law.energy(e0, state)
    before, middle, end = map(force, (e0, (e0 + e1) / 2, e1))
    missed = abs(mean - (before + 4 * middle + end) / 6)
    smooth = ufl.le(missed, SMOOTH * (abs(before) + abs(end)))
    mean = ufl.conditional(smooth, mean, growth / way)
    return mean if part == 0.5 else mean + (2 * part - 1) * (end - mean)
