# SPDX-License-Identifier: MIT
"""Schemes whose forces act at the end of the step: statics, Newmark, generalized-α."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from ufl.core.expr import Expr

from ufl_beam.arrays import Array
from ufl_beam.errors import ArgumentError, require_number
from ufl_beam.mechanics import functional, kinematics
from ufl_beam.mechanics.kinematics import Axis
from ufl_beam.mechanics.time_scheme import Coefficients, Constant
from ufl_beam.model.law_functions import Values
from ufl_beam.model.softening_laws import SofteningLaw


class PlainStep:
    """Base of schemes whose forces work on the increments of displacements and rotations."""

    half_tangents = False

    def virtual_rotation(self, rotation_a: Expr, rotation_b: Expr, w: Expr) -> Expr:
        """Return ``w``, the virtual relative rotation."""
        return w


STATIC_ADVICE = (
    "Try a smaller dt. There is no equilibrium nearby beyond a limit load, or where softening "
    "snaps back: limit**2/energy of a hinge, half of this if softening is linear, exceeds the "
    "stiffness that drives the hinge. Then follow the path with ub.follow(scene, "
    "ub.ArcLength(...)) or ub.DissipationControl(...), prescribe a displacement instead of the "
    "load, or run dynamics"
)
"""Advice if a static step, in which time is the load factor, finds no equilibrium."""


class _AtEnd(PlainStep):
    """Base of schemes whose forces, strains and variations are taken at the end of the step.

    The ledger computes works by the trapezoidal rule.
    """

    load_weight = 1.0
    weight_of_before = 0.5  # trapezoidal rule, exact for forces that are linear in the motion
    limits_rotation = False  # rotations of nodes in a step have no limit
    theta = 1.0
    alpha = lost_fraction = 0.0

    def mean(self, f: Callable[[Expr], Expr], q0: Expr, q1: Expr) -> Expr:
        """Return the value at the end of the step."""
        return f(q1)

    def resistance(self, softening: SofteningLaw, opening: Array, growth: Values) -> Values:
        return softening.traction(opening + growth)

    def virtual_strain(self, q0: Expr, q1: Expr, w: Expr, axis: Axis) -> Expr:
        return kinematics.virtual_strain(q1, w, axis)

    def resultants(self, C: Expr, e0: Expr, e1: Expr, constant: Constant) -> Expr:
        return functional.resultants(e1, C)

    def average(self, before: Expr, now: Expr) -> Expr:
        return now


@dataclass(frozen=True)
class Static(_AtEnd):
    """Static equilibrium at the end of each step; time is the load parameter.

    Dampers, :class:`KelvinVoigt`, viscosity of materials, and works with ``v`` use the mean rates
    of the step in real time.  There is no inertia.

    The ledger computes works by the trapezoidal rule.  Its imbalance is of second order in the step
    and measures the error.  A step is divided if the work of the forces differs from the stored and
    dissipated energy by more than 5 % of the sum of both, because the step may have jumped to
    another branch of equilibria.

    Example:
        >>> run = ub.simulate(scene, ub.Static(), t=(0, 1), dt=0.1)
        >>> print(run.reaction(scene.supports[0])[-1, 1:].round(-2))  # N, N m
        [100000. 200000.]
    """

    dynamic = False
    advice = STATIC_ADVICE
    slack = 0.05


class Weights(NamedTuple):
    """Weights of Newmark's formulas and of the mean accelerations of generalized-α.

    With the acceleration a, from which u and v follow, and the acceleration ü by the forces,

        u1 = u0 + dt v0 + dt² ((1/2 - β) a0 + β a1),     v1 = v0 + dt ((1 - γ) a0 + γ a1),
        (1 - α_m) a1 + α_m a0 = (1 - α_f) ü1 + α_f ü0.
    """

    α_m: float
    α_f: float
    γ: float
    β: float


CONSTANT = Weights(0.0, 0.0, 1.0, 1 / 2)
"""Weights without the acceleration at the beginning of the step, for use while it is unknown."""

AVERAGE = Weights(0.0, 0.0, 1 / 2, 1 / 4)
"""Weights with the mean of the accelerations at both ends of the step."""


class _Accelerated(_AtEnd):
    """Base of :class:`Newmark` and :class:`GeneralizedAlpha`."""

    dynamic = True
    slack = math.inf
    has_mean_velocity = False
    uses_last_step = False
    weights: Weights
    further_rates: tuple[str, ...]

    @property
    def accelerations_oscillate(self) -> bool:
        """True if the accelerations of a prescribed motion oscillate for ever.

        They follow from Newmark's formulas alone, which damp errors only if 2 β > γ > 1/2.
        """
        _, _, γ, β = self.weights
        return not 2 * β > γ > 0.5

    def coefficients(self, dt: float, last_dt: float, known: int) -> Coefficients:
        """Return the coefficients of Newmark's formulas, and of the accelerations ü by the forces.

        The acceleration a is ü at a time that is later by (α_m - α_f) dt; the lead is (a - ü)/dt.
        A step uses ü and the lead at its beginning only if they are known.
        """
        s, v, _, *more = np.eye(3 + known)
        forced = a0 = more[0] if known else 0 * s
        α_m, α_f, γ, β = CONSTANT
        if 0 < known < len(self.further_rates):
            α_m, α_f, γ, β = AVERAGE
        elif known:
            α_m, α_f, γ, β = self.weights
            a0 = forced + sum(dt * lead for lead in more[1:])
        a = (s - dt * v - dt**2 * (0.5 - β) * a0) / (β * dt**2)
        v1 = v + dt * ((1 - γ) * a0 + γ * a)
        forced1 = ((1 - α_m) * a + α_m * a0 - α_f * forced) / (1 - α_f)
        lead = (a - forced1) / dt
        if known < len(self.further_rates):
            lead = (self.weights.α_m - self.weights.α_f) / dt * (forced1 - forced)
        further = (forced1, lead) if known and len(self.further_rates) > 1 else (forced1,)
        return Coefficients(inertia=forced1, velocity=v1, rates=(v1, *further))

    def error_weights(self) -> tuple[float, float]:
        """Return error weights by Taylor's series; a leads the forces by α_m - α_f steps."""
        α_m, α_f, γ, β = self.weights
        ahead = α_m - α_f
        return 0.0, abs(β + ahead / 2 - 1 / 6) + abs(γ + ahead - 1 / 2)


@dataclass(frozen=True)
class Newmark(_Accelerated):
    """Newmark's scheme, by default with average acceleration; for comparison with other programs.

    With ``gamma = 1/2`` the scheme is of second order without damping.  In large motion its energy
    is not bounded, and the scheme may diverge where :class:`EnergyMomentum` does not.  With
    ``gamma > 1/2`` it damps, but is of first order; :class:`GeneralizedAlpha` is of second order.

    The ledger computes works by the trapezoidal rule.  Its imbalance is of second order in the step
    and measures the error.  Initial accelerations come from a trial step of a sixteenth of the
    first step.  Laws that depend on rates, except :class:`Rayleigh`, use the mean rate of the step,
    and yield conditions hold at its end; both approximations are of first order.

    Args:
        gamma: γ; from 1/2.
        beta: β; from γ/2, below which the scheme is unstable at large steps.

    Raises:
        ArgumentError: ``gamma`` or ``beta`` is out of range.
        ModelError: A run with dry friction or a rotating frame; unless 2 beta > gamma > 1/2, also
            with joints held by multipliers, guides, motors or moving supports.

    Example:
        >>> run = ub.simulate(scene, ub.Newmark(), t=(0, 1), dt=0.05)
        >>> np.allclose(run.position(beam.end)[-1], solution.position(beam.end)[-1], atol=1e-3)
        True
    """

    gamma: float = 0.5
    beta: float = 0.25

    further_rates = ("acceleration",)
    advice = (
        "Try a smaller dt, or GeneralizedAlpha(0.8), or EnergyMomentum(), which conserves energy"
    )

    def __post_init__(self) -> None:
        require_number(self.gamma, "Newmark: gamma", at_least=0.5)
        require_number(self.beta, "Newmark: beta")
        if 2 * self.beta < self.gamma:
            raise ArgumentError(
                f"Newmark: beta = {self.beta:g} must be at least gamma/2 = {self.gamma / 2:g}; "
                "below that the scheme is unstable at large steps"
            )

    @property
    def weights(self) -> Weights:  # type: ignore[override]
        """Weights of Newmark's formulas, where a is ü."""
        return Weights(0.0, 0.0, self.gamma, self.beta)


@dataclass(frozen=True)
class GeneralizedAlpha(_Accelerated):
    """Generalized-α scheme of second order with damping of high frequencies.

    The weights are by Chung and Hulbert (1993), the form is by Arnold and Brüls (2007): equilibrium
    and constraints are satisfied at the ends of the steps, and the weights average an auxiliary
    acceleration.  For linear scenes this form agrees with the original form.  With joints held by
    multipliers it is stable if ``rho_inf < 1``.  If the step length changes, the auxiliary
    acceleration is adjusted to keep the order.

    The ledger, initial accelerations and rate-dependent laws are as in :class:`Newmark`.  In large
    motion the energy may grow; with :class:`EnergyMomentumDecaying` it cannot.

    Args:
        rho_inf: Spectral radius at infinite frequency, from 0 (damped out in a step) to 1
            (undamped).

    Raises:
        ArgumentError: ``rho_inf`` is outside [0, 1].
        ModelError: As in :class:`Newmark`; for joints and motions only if ``rho_inf=1``.

    Example:
        >>> run = ub.simulate(scene, ub.GeneralizedAlpha(rho_inf=0.8), t=(0, 1), dt=0.05)
        >>> np.allclose(run.position(beam.end)[-1], solution.position(beam.end)[-1], atol=1e-3)
        True
    """

    rho_inf: float = 0.8

    further_rates = ("acceleration", "lead of acceleration")
    advice = (
        "Try a smaller dt, a smaller rho_inf, or EnergyMomentumDecaying(), whose energy is bounded"
    )

    def __post_init__(self) -> None:
        require_number(self.rho_inf, "GeneralizedAlpha: rho_inf", at_least=0.0, at_most=1.0)

    @property
    def weights(self) -> Weights:  # type: ignore[override]
        """Weights of Chung and Hulbert."""
        α_m = (2 * self.rho_inf - 1) / (self.rho_inf + 1)
        α_f = self.rho_inf / (self.rho_inf + 1)
        return Weights(α_m, α_f, 0.5 - α_m + α_f, (1 - α_m + α_f) ** 2 / 4)
