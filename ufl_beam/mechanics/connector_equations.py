# SPDX-License-Identifier: MIT
"""Equations of connector laws over a step: laws of energy and resistance, and rigid-plastic laws.

A law of energy and resistance holds at t_n+θ.  A backward-Euler step of length θ dt gives the
changes of its variables up to t_n+θ; divided by θ, they are the changes in the whole step.  The
elastic force acts at the time of the loads.  The force of a rigid-plastic law is a function of the
slip in the step; the same Python function serves UFL expressions and numbers.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from functools import cache, partial
from typing import Any, NamedTuple

import numpy as np
import ufl
from ufl.core.expr import Expr

from ufl_beam.mechanics.time_scheme import Scheme
from ufl_beam.model.connector_law import ConnectorLaw
from ufl_beam.model.law_functions import Values
from ufl_beam.model.material_law import State
from ufl_beam.model.material_laws import ElastoPlastic
from ufl_beam.model.softening_laws import SofteningLaw

# -- energy and resistance -------------------------------------------------------------------------

SMOOTH = 1e-7
"""Relative difference of works by Gauss's and Simpson's rules up to which Gauss's is used alone.

Gauss's rule has four points.  The errors are of the eighth and the fourth order in the step, with
the factors 1 / 1778112000 and 1 / 2880.  If Simpson's rule has the error 1e-7, the error of
Gauss's rule is about (3e-4)² / 2e9, below round-off.
"""


class LawStep(NamedTuple):
    """Equations of a law over a step; J, forces in N or N m."""

    forces: tuple[Expr, ...]  # one for each component; or sliding force of a law with a limit
    stored: Expr  # at the end
    numerical: Expr  # lost by the scheme in the step
    variables: tuple[Expr, ...]  # at the end


def law_step(
    law: ConnectorLaw, at: Mapping[str, Expr], scheme: Scheme, *, frozen: bool = False
) -> LawStep:
    """Return the equations of a law in a step; if ``frozen``, its variables are constant.

    The names in ``at`` are "motion 0" and so on for the motions at the end of the step, "before 0"
    for the motions before it, "dt" and "theta", "state ..." for the variables before the step, and
    "number ..." for the parameters of the law.
    """
    law = law.with_parameters({name: at[f"number {name}"] for name in law.parameters()})
    dt, θ, load_weight = at["dt"], at["theta"], scheme.load_weight
    e0, e1 = ([at[f"{n} {i}"] for i in range(law.components)] for n in ("before", "motion"))
    pairs = list(zip(e0, e1, strict=True))
    e = law.as_argument([(1 - θ) * x0 + θ * x1 for x0, x1 in pairs])
    rate = law.as_argument([(x1 - x0) / dt for x0, x1 in pairs])
    names = () if frozen else tuple(law.variables)
    old = State({name: at[f"state {name}"] for name in law.variables})
    changes = law.increments(e, rate, old, θ * dt) if names and not law.rate_independent else {}

    @cache  # equal expressions must be the same objects, or UFL takes very long to compare them
    def after(fraction: Expr | float) -> State:
        """Return the variables after a fraction of the step."""
        grown = {n: fraction / θ * changes[n] for n in changes}
        if names and law.rate_independent:
            moved = law.as_argument([(1 - fraction) * x0 + fraction * x1 for x0, x1 in pairs])
            grown = dict(law.increments(moved, rate, old, fraction * dt))
        return State(vars(old) | {n: getattr(old, n) + grown[n] for n in names})

    end = {n: ufl.variable(ufl.as_ufl(z)) for n, z in vars(after(1.0)).items()}
    zero = ufl.as_ufl(0.0)
    if law.holds:  # a law with a limit has only a sliding force; return its magnitude
        sliding = ufl.as_ufl(law.sliding(e, rate, after(θ), dt))
        return LawStep((sliding,), zero, zero, tuple(end.values()))
    resists = type(law).resistance is not ConnectorLaw.resistance
    resistances = law.each(law.resistance(e, rate, after(θ if resists else 1.0), dt))
    elastic = _elastic_forces(law, e0, e1, after(load_weight), scheme)
    forces = tuple(f + ufl.as_ufl(r) for f, r in zip(elastic, resistances, strict=True))
    moved = [ufl.variable(x1) for x1 in e1]
    stored = ufl.as_ufl(law.energy(law.as_argument(moved), State(end)))
    numerical = zero
    if load_weight > 0.5 and scheme.average(0.0, 1.0) != 1.0:
        # The scheme computes works exactly.  Forces that act after the middle of the step lose
        # energy as in backward Euler; the loss is of second order, positive for convex energies.
        each = zip(moved, pairs, strict=True)
        growth = sum(ufl.diff(stored, m) * (x1 - x0) for m, (x0, x1) in each)
        growth += sum(ufl.diff(stored, z) * (z - getattr(old, n)) for n, z in end.items())
        numerical = (2 * load_weight - 1) * (law.energy(law.as_argument(e0), old) - stored + growth)
    return LawStep(forces, stored, numerical, tuple(end.values()))


def _elastic_forces(
    law: ConnectorLaw, e0: Sequence[Expr], e1: Sequence[Expr], state: State, scheme: Scheme
) -> list[Expr]:
    """Return the elastic forces at the time of the loads: over the step, at its end, or between.

    The work of forces over the step equals the change of the energy.  For forces that are smooth
    over the step, means by Gauss's rule satisfy this to round-off.  At kinks and in large steps a
    force along the increment does the missing work.  Forces and moment share this work in
    proportion to the squares of the errors of their works.  A single force is then the growth of
    the energy divided by the increment of the motion; this quotient has few digits in small steps.
    """

    def energy(e: Sequence[Expr]) -> Expr:
        return ufl.as_ufl(law.energy(law.as_argument(e), state))

    def force(e: Expr, i: int) -> Expr:
        at = [ufl.variable(e[j]) for j in components]
        return ufl.diff(energy(at), at[i])

    load_weight, components = scheme.load_weight, range(len(e0))
    x0, x1 = ufl.as_vector(e0), ufl.as_vector(e1)
    ends = [force(x1, i) for i in components]
    if load_weight == 1.0:
        return ends
    Δe = [x1[i] - x0[i] for i in components]
    means = [scheme.mean(partial(force, i=i), x0, x1) for i in components]
    size, errors = 0, []
    for i, (mean, end, d) in enumerate(zip(means, ends, Δe, strict=True)):
        before = force(x0, i)
        errors.append(mean - (before + 4 * force((x0 + x1) / 2, i) + end) / 6)
        size += (abs(before) + abs(end)) * abs(d)
    works = [error * d for error, d in zip(errors, Δe, strict=True)]
    smooth = ufl.le(sum(map(abs, works)), SMOOTH * size)
    growth = energy(e1) - energy(e0)
    if len(Δe) == 1:
        exact = [growth / Δe[0]]
    else:
        missing = growth - sum(mean * d for mean, d in zip(means, Δe, strict=True))
        groups = [range(2), *([range(2, 3)] if len(Δe) == 3 else [])]  # displacements, rotation
        weights = [sum(works[i] for i in group) ** 2 for group in groups]
        exact = []
        for weight, group in zip(weights, groups, strict=True):
            square = sum(Δe[i] ** 2 for i in group)
            square = ufl.conditional(ufl.gt(square, 0.0), square, 1.0)
            factor = missing * weight / (sum(weights) * square)
            exact += [means[i] + factor * Δe[i] for i in group]
    over_step = [ufl.conditional(smooth, *both) for both in zip(means, exact, strict=True)]
    return [x + (2 * load_weight - 1) * (end - x) for x, end in zip(over_step, ends, strict=True)]


# -- rigid-plastic laws ----------------------------------------------------------------------------


class RigidPlasticStep(NamedTuple):
    """Response of a rigid-plastic law over a step; J, forces in N or N m."""

    force: Values  # in the step, in the direction of the motion
    dissipated: Values  # in the step
    lost: Values  # numerically by backward Euler, divided by ``2 alpha`` of the scheme
    stored: Values  # at the end
    limit: Values  # largest abs(force - back_force) that holds the motion after the step
    back_force: Values  # centre of the limits after the step


def parameters(law: SofteningLaw | ElastoPlastic) -> dict[str, Any]:
    """Return the parameters of a law by their names in :func:`rigid_plastic_step`."""
    values = law.parameters() if isinstance(law, SofteningLaw) else law.parameters(np.ones(()))
    return {f"number {name}": value for name, value in values.items()}


def rigid_plastic_step(
    law: SofteningLaw | ElastoPlastic, at: Mapping[str, Values], scheme: Scheme
) -> RigidPlasticStep:
    """Return the response of a law, whose parameters come from ``at``, not from ``law``.

    ``at`` maps names to values: "slip" in the step and its "direction" (1 or -1); at the beginning
    of the step, accumulated slip "slipped" and motion "start"; "θ" and "dt"; parameters of the law,
    see :func:`parameters`.
    """
    a, ξ, s, none = at["slip"], at["slipped"], at["direction"], 0 * at["slip"]
    values = {n.removeprefix("number "): x for n, x in at.items() if n.startswith("number ")}
    if isinstance(law, SofteningLaw):
        law = law.with_parameters(values)
        force = s * scheme.resistance(law, ξ, a)
        return RigidPlasticStep(
            force, a * law.mean_traction(ξ, a), none, none, law.traction(ξ + a), none
        )
    e, θ, dt = (at[name] for name in ("start", "θ", "dt"))
    change = State({"plastic": a, "accumulated": a})
    limit, H, B = (values[name] for name in ("yield_limit", "isotropic", "kinematic"))
    bulk = law.with_parameters(np.inf, values)
    resistance = limit + H * (ξ + θ * a) + values["viscosity"] * a / dt
    return RigidPlasticStep(
        s * resistance + B * (e + θ * s * a),
        bulk.dissipation(s * a, change, change, dt),
        bulk.hardening_energy(change),
        bulk.hardening_energy(State({"plastic": e + s * a, "accumulated": ξ + a})),
        limit + H * (ξ + a),
        B * (e + s * a),
    )
