# SPDX-License-Identifier: MIT
"""All time schemes; their protocol is in time_scheme.py.

Forces act at the end of the step (:class:`Static`, :class:`Newmark`, :class:`GeneralizedAlpha`), or
over the step (the energy-momentum schemes, and the paper's printed form of one).
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
import ufl
from ufl.core.expr import Expr

from ufl_beam.arrays import Array
from ufl_beam.errors import ArgumentError, require_count, require_number
from ufl_beam.mechanics import functional, kinematics
from ufl_beam.mechanics.kinematics import Axis
from ufl_beam.mechanics.time_scheme import Coefficients, Constant
from ufl_beam.model.law_functions import Values
from ufl_beam.model.softening_laws import SofteningLaw
from ufl_beam.quadrature import gauss_rule

# -- forces at the end of the step -------------------------------------------------------------


class PlainStep:
    """Base of schemes whose forces work on the increments of displacements and rotations."""

    half_tangents = False

    def virtual_rotation(self, rotation_a: Expr, rotation_b: Expr, w: Expr) -> Expr:
        """Return ``w``, the virtual relative rotation."""
        return w


STATIC_ADVICE = (
    "Try a smaller dt; constant loads act in the first step, give them amplitude=ub.ramp(...). "
    "There is no equilibrium nearby beyond a limit load, or where softening snaps back: "
    "limit**2/energy of a hinge, half of this if softening is linear, exceeds the stiffness that "
    "drives the hinge. Then follow the path with ub.follow(scene, ub.ArcLength(...)) or "
    "ub.DissipationControl(...), prescribe a displacement instead of the load, or run dynamics"
)
"""Advice if a static step, in which time is the load factor, finds no equilibrium."""


class _ForcesAtEnd(PlainStep):
    """Base of schemes whose forces, strains and variations are taken at the end of the step.

    The ledger computes works by the trapezoidal rule.
    """

    load_weight = 1.0
    weight_of_before = 0.5  # trapezoidal rule, exact for forces that are linear in the motion
    limits_rotation = False  # strains are valid for all rotations of a step
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
class Static(_ForcesAtEnd):
    """Static equilibrium at the end of each step; time is the load parameter.

    Dampers, :class:`KelvinVoigt`, viscosity of materials, and works with ``v`` use the mean rates
    of the step in real time.  There is no inertia.

    The ledger computes works by the trapezoidal rule.  Its imbalance is of second order in the step
    and measures the error.  A step is divided if the work of the forces differs from the stored and
    dissipated energy by more than 5 % of the sum of both, because the step may have jumped to
    another branch of equilibria.  It is also divided if it turns a rigid part by more than 0.5 rad,
    because linkages have several assemblies without energy.

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


class _Accelerated(_ForcesAtEnd):
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
    multipliers it is stable if ``rho_inf < 1`` and steps are at most 1.5 times as long as the steps
    before.  If the step length changes, the auxiliary acceleration is adjusted to keep the order.

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


# -- forces over the step -----------------------------------------------------------------------

GAUSS_POINTS = 4
"""Number of points of Gauss's rule on the line from the beginning to the end of a step.

The rule is exact for polynomials up to degree 7.
"""


class _ForcesOverStep:
    """Base of schemes whose forces act over the step."""

    weight_of_before = 0.0  # the forces in the equation of the step do the work of the step
    limits_rotation = True
    alpha: float
    lost_fraction = 0.0

    @property
    def theta(self) -> float:
        """Fraction of the step at which the resultants of P(89) are taken."""
        return 0.5 + self.alpha

    def resistance(self, softening: SofteningLaw, opening: Array, growth: Values) -> Values:
        """Return the mean traction, whose work in the step is the dissipation of the opening."""
        return softening.mean_traction(opening, growth)

    def resultants(self, C: Expr, e0: Expr, e1: Expr, constant: Constant) -> Expr:
        """Return the mean of the resultants at both ends, plus ``alpha`` times their change."""
        mean = functional.resultants((e0 + e1) / 2, C)  # P(83)
        if self.alpha == 0:
            return mean
        return mean + constant(self.alpha) * functional.resultants(e1 - e0, C)  # P(89)

    def average(self, before: Expr, now: Expr) -> Expr:
        """Return the mean of both ends, for which the product rule holds in increments."""
        return (before + now) / 2

    def mean(self, f: Callable[[Expr], Expr], q0: Expr, q1: Expr) -> Expr:
        """Return the mean of ``f`` on the straight line from q0 to q1, exact up to degree 7."""
        points, weights = gauss_rule(GAUSS_POINTS)
        values = (f(q0 + float(x) * (q1 - q0)) for x in points)
        return sum((float(w) * f for w, f in zip(weights, values, strict=True)), 0)


class EnergyMomentumBase(_ForcesOverStep):
    """Base of schemes whose works over a step are exact increments of energy.

    A scheme defines ``alpha``, the dissipation by its resultants, P(89).

    Example:
        >>> schemes = ub.EnergyMomentum, ub.EnergyMomentumStatic
        >>> [issubclass(scheme, ub.extend.EnergyMomentumBase) for scheme in schemes]
        [True, True]
    """

    exact_ledger = True
    half_tangents = True  # makes works exact increments; see docs/errata.md

    def virtual_strain(self, q0: Expr, q1: Expr, w: Expr, axis: Axis) -> Expr:
        """Return the variation that maps the nodal step to the increment of the strains."""
        return kinematics.virtual_strain_over_step(q0, q1, w, axis)

    def virtual_rotation(self, rotation_a: Expr, rotation_b: Expr, w: Expr) -> Expr:
        """Return ``rotation_b - rotation_a`` if w is 2 tan(rotation_b/2) - 2 tan(rotation_a/2)."""
        tan_a, tan_b = (ufl.sin(x / 2) / ufl.cos(x / 2) for x in (rotation_a, rotation_b))
        return kinematics.over_tan((rotation_b - rotation_a) / 2) / (1 + tan_a * tan_b) * w


@dataclass(frozen=True)
class EnergyMomentumStatic(EnergyMomentumBase):
    """Static equilibrium with an exact ledger: works are exact increments of energy.

    :class:`Static` has equilibrium at the ends of steps and computes works by the trapezoidal rule.
    This scheme uses the step equation of :class:`EnergyMomentum`.  Inelastic material satisfies its
    laws at the fraction ``theta`` of the step.  Under loads that grow, the solution is of first
    order in the step with ``theta=1`` and of second order with ``theta=1/2``.  Cyclic loads reduce
    the order with ``theta=1/2``; docs/schemes.md has measured errors.
    Loads that act from the start are applied in the first step, in substeps with small rotations of
    nodes.  At a jump to another branch of equilibria the run continues, and the released energy is
    in the entry "numerical"; :class:`Static` stops there.  Viscous forces act in real time, as in
    :class:`Static`.

    Args:
        theta: Fraction of the step at which resultants and loads are in equilibrium.  With 1/2 the
            scheme dissipates no elastic energy, but the states at the ends may oscillate about
            equilibrium.  With 1 they tend to equilibrium, and the loss is the entry "numerical" of
            the ledger.  If nodes rotate by Δψ in a step, a moment that should be uniform along a
            beam has the relative error (Δψ/2)².

    Raises:
        ArgumentError: ``theta`` is outside [1/2, 1].

    Example:
        >>> run = ub.simulate(scene, ub.EnergyMomentumStatic(), t=(0, 1), dt=0.1)
        >>> bool(run.energy.worst < 1e-9)
        True
    """

    theta: float = 1.0

    dynamic = False
    advice = STATIC_ADVICE
    slack = math.inf

    def __post_init__(self) -> None:
        require_number(self.theta, "EnergyMomentumStatic: theta", at_least=0.5, at_most=1.0)

    @property
    def alpha(self) -> float:  # type: ignore[override]
        """Dissipation by the resultants."""
        return self.theta - 0.5

    @property
    def load_weight(self) -> float:
        """Fraction of the step at which loads act, in equilibrium with the resultants."""
        return self.theta


class MidpointDynamics:
    """Base of dynamic schemes whose loads act in the middle of the step.

    A scheme defines ``coefficients`` and ``error_weights``, see :class:`DynamicScheme`.

    Example:
        >>> schemes = ub.EnergyMomentumDecaying, ub.Newmark
        >>> [issubclass(scheme, ub.extend.MidpointDynamics) for scheme in schemes]
        [True, False]
    """

    dynamic = True
    slack = math.inf
    load_weight = 0.5
    has_mean_velocity = True
    uses_last_step = False
    accelerations_oscillate = False
    further_rates: tuple[str, ...] = ()
    advice = (
        "Try a smaller dt, loads and motions without jumps, or more dissipation at high "
        "frequencies, such as EnergyMomentum(alpha=0.05, beta=0.05) or EnergyMomentumDecaying()"
    )


class _Velocities(MidpointDynamics):
    """Base of schemes with the velocities of P(87) and their dissipation ``beta``."""

    alpha: float
    beta: float

    def coefficients(self, dt: float, last_dt: float, known: int) -> Coefficients:
        """Return the coefficients of v1 = a s - b v0 for the nodal step s, and of (v1 - v0)/dt."""
        keep = 0.5 + self.beta
        a, b = 1 / (dt * keep), (0.5 - self.beta) / keep  # P(87)
        return Coefficients(
            inertia=(a / dt, -(1 + b) / dt, 0.0),  # P(78)
            velocity=(1 / dt, 0.0, 0.0),
            rates=((a, -b, 0.0),),
            velocity_defect=(self.beta, 0.0, 0.0)
            if self.beta
            else None,  # P(88), with the loss D_K
        )

    def error_weights(self) -> tuple[float, float]:
        """Return the error of the trapezoidal rule, plus the errors of both dissipations."""
        return self.beta, 1 / 12 + self.alpha


_FIFTH = 1 / (4 - 4 ** (1 / 3))

SUZUKI = (_FIFTH, _FIFTH, 1 - 4 * _FIFTH, _FIFTH, _FIFTH)
"""Lengths of the stages of Suzuki's composition of order 4, as fractions of the step.

Their sum is 1, and the sum of their cubes is 0, so that the errors of third order cancel.
"""


@dataclass(frozen=True)
class EnergyMomentum(EnergyMomentumBase, _Velocities):
    """Midpoint rule that conserves energy and momentum exactly, with dissipation on request.

    ``alpha = beta = 0`` conserves energy, linear and angular momentum to solver tolerance at any
    step size.  Positive values dissipate energy of high frequencies: ``alpha`` by the resultants,
    with exact momenta; ``beta`` by the velocities, without conservation of angular momentum.  The
    loss is the entry "numerical" of the ledger.

    Inelastic material satisfies its laws in the middle of the step, which is of second order.  With
    ``alpha = 1/2`` it satisfies them at the end, as in backward Euler, which is of first order.  In
    the middle, stresses lie on the yield surface, and a fully open hinge bears no moment.  At the
    ends stress and moment alternate about these values, with deviations proportional to the step; a
    small ``alpha`` damps these.  The elastic energy of material that breaks completely is lost at
    once, as "numerical".

    With ``order=4`` a step consists of five steps of second order, one of which goes backward
    (Suzuki 1990).  Energy, linear and angular momentum stay exact.  Loads and motions must be
    smooth within a step.  Section forces and reactions are means over the last stage, at 0.207 dt
    before the end of the step, and of second order; so are velocities along constraints.  Forces of
    joints with multipliers and reactions of moving supports are of first order.

    Args:
        alpha: Dissipation by the resultants, from 0 to 1/2.
        beta: Dissipation by the velocities, from 0 to 1/2.
        order: Order of the errors in the step, 2 or 4.

    Raises:
        ArgumentError: ``alpha`` or ``beta`` is outside [0, 1/2], ``order`` is neither 2 nor 4, or
            ``order=4`` is given together with dissipation.
        ModelError: A run with ``order=4`` whose scene dissipates or has kinks.

    Equations:
        P(77)-P(91); P(82) corrected, see docs/errata.md.

    Example:
        >>> run = ub.simulate(scene, ub.EnergyMomentum(), t=(0, 1), dt=0.05)
        >>> lossy = ub.simulate(scene, ub.EnergyMomentum(alpha=0.05, beta=0.05), t=(0, 1), dt=0.05)
        >>> bool(run.energy.worst < 1e-9), bool(lossy.energy.lost["numerical"][-1] > 0)
        (True, True)
        >>> fourth = ub.simulate(scene, ub.EnergyMomentum(order=4), t=(0, 1), dt=0.25)
        >>> bool(fourth.energy.worst < 1e-9)
        True
    """

    alpha: float = 0.0
    beta: float = 0.0
    order: int = 2

    def __post_init__(self) -> None:
        for name in ("alpha", "beta"):
            require_number(
                getattr(self, name), f"EnergyMomentum: {name}", at_least=0.0, at_most=0.5
            )
        if require_count(self.order, "EnergyMomentum: order", at_least=2) not in (2, 4):
            raise ArgumentError(f"EnergyMomentum: order = {self.order:g} must be 2 or 4")
        if self.order == 4 and (self.alpha or self.beta):
            name = "alpha" if self.alpha else "beta"
            raise ArgumentError(
                f"EnergyMomentum: {name} = {getattr(self, name):g} dissipates, and with order=4 a "
                f"stage of each step goes backward; give {name}=0 or order=2"
            )

    @property
    def stages(self) -> tuple[float, ...]:
        """Lengths of the stages of a step, as fractions of the step."""
        return SUZUKI if self.order == 4 else (1.0,)


@dataclass(frozen=True)
class EnergyMomentumDecaying(EnergyMomentumBase, MidpointDynamics):
    """Midpoint rule of second order that dissipates the energy of high frequencies.

    :class:`EnergyMomentum` dissipates by terms of first order: the changes of strains and
    velocities in a step.  Here the terms are second differences of both.  If ω dt is small, a mode
    of circular frequency ω loses the fraction c (ω dt)⁴ of its energy in a step, with
    c = rho_inf (1 - rho_inf) / (2 (1 + rho_inf)²).  The amplitude of a mode with a large ω dt is
    multiplied by ``rho_inf`` in each step.  The equations of the step are

        resultants  C ((e0 + e1)/2 + c (Δe - r Δe')),     Δu/dt = (v0 + v1)/2 + c (Δv - r Δv'),

    where Δe' and Δv' are the changes in the previous step of length dt', and r = dt/dt', at most 1.
    They are of first order in a step that is longer than the previous one, so :class:`Adaptive`
    refuses the scheme; isolated steps that are divided keep the second order.

    Without loads the energy, plus c times the energy of strains Δe and velocities Δv, never grows,
    whatever the lengths of the steps are, because
    Δe (Δe - r Δe') = (Δe² - r² Δe'² + (Δe - r Δe')²)/2.  The total loss is the entry "numerical" of
    the ledger and never negative; a single step may return a fraction of the loss of previous
    steps.  Linear momentum is conserved exactly, angular momentum to second order.
    Connectors and the resultants of cells that may yield or break are not damped, so that open
    hinges turn freely.

    Args:
        rho_inf: Spectral radius at infinite frequency, from 1/3 to 1 (no loss).

    Raises:
        ArgumentError: ``rho_inf`` is outside [1/3, 1].

    Example:
        >>> run = ub.simulate(scene, ub.EnergyMomentumDecaying(rho_inf=0.5), t=(0, 1), dt=0.05)
        >>> bool(run.energy.lost["numerical"][-1] > 0), bool(run.energy.worst < 1e-9)
        (True, True)
    """

    rho_inf: float = 0.5

    alpha = 0.0
    uses_last_step = True

    def __post_init__(self) -> None:
        require_number(self.rho_inf, "EnergyMomentumDecaying: rho_inf", at_least=1 / 3, at_most=1.0)

    @property
    def lost_fraction(self) -> float:  # type: ignore[override]
        """Fraction c of the energy of second differences of strains and velocities that is lost."""
        # In a step a mode of infinite frequency is multiplied by the root of larger magnitude,
        # λ = -rho_inf, of (λ + 1)/2 + c (λ - 1)²/λ = 0.
        return self.rho_inf * (1 - self.rho_inf) / (2 * (1 + self.rho_inf) ** 2)

    def coefficients(self, dt: float, last_dt: float, known: int) -> Coefficients:
        """Return the coefficients of a step, with c times second differences of velocities."""
        c, keep = self.lost_fraction, 0.5 + self.lost_fraction
        cr = c * min(1.0, dt / last_dt)
        return Coefficients(
            inertia=(1 / (dt**2 * keep), (cr - 1) / (dt * keep), -cr / (dt * keep)),
            velocity=(1 / dt, 0.0, 0.0),
            rates=((1 / (dt * keep), (c + cr - 0.5) / keep, -cr / keep),),
            velocity_defect=(c, -cr, cr),
        )

    def error_weights(self) -> tuple[float, float]:
        """Return the error of the trapezoidal rule, plus the error of the second differences."""
        return 0.0, 1 / 12 + self.lost_fraction


@dataclass(frozen=True)
class EnergyMomentumPrinted(_ForcesOverStep, _Velocities, PlainStep):
    """The midpoint rule as the paper prints it, for comparison; :class:`EnergyMomentum` is better.

    The variation of the strains is taken in the middle of the step and differs from their
    increment, so energy drifts with the square of the rotation in a step.  Linear and angular
    momentum are conserved.  The ledger contains the works of the step, and its imbalance is this
    drift.  Joints with multipliers do work of the size of the drift.

    Equations:
        P(77)-P(84), with the sign of P(79) corrected; see docs/errata.md.

    Example:
        >>> free = ub.Scene([beam], initial=[ub.Velocity((beam,), angular=10.0)])
        >>> printed = ub.simulate(free, ub.EnergyMomentumPrinted(), t=(0, 1), dt=0.04)
        >>> exact = ub.simulate(free, ub.EnergyMomentum(), t=(0, 1), dt=0.04)
        >>> bool(printed.energy.worst > 1e-7), bool(exact.energy.worst < 1e-9)
        (True, True)
    """

    alpha = beta = 0.0

    def virtual_strain(self, q0: Expr, q1: Expr, w: Expr, axis: Axis) -> Expr:
        """Return the variation in the middle of the step."""
        return kinematics.virtual_strain((q0 + q1) / 2, w, axis)
