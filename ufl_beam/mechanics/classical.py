# SPDX-License-Identifier: MIT
"""Schemes whose forces act at the end of the step: statics, Newmark, generalised-α."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from ufl.core.expr import Expr

from ufl_beam.arrays import Array, Index
from ufl_beam.errors import SceneError, require_number
from ufl_beam.mechanics import functional, kinematics
from ufl_beam.mechanics.kinematics import Axis
from ufl_beam.mechanics.time_schemes import Constant, Rates, Step, require_between
from ufl_beam.model.law_functions import Values
from ufl_beam.model.softening_laws import SofteningLaw


class PlainStep:
    """Base of schemes whose forces work on the increments of displacements and rotations."""

    def virtual_turn(self, turn_a: Expr, turn_b: Expr, w: Expr) -> Expr:
        """The virtual rotation itself."""
        return w

    def nodal_step(self, q0: Array, q1: Array, rotations: Index) -> tuple[Array, float]:
        """The increments themselves, and the largest turn."""
        s: Array = q1 - q0
        return s, float(np.abs(s[rotations]).max(initial=0.0))

    def half_tangents(self, rotations: Index) -> Index:
        """No rotations: their steps are the increments."""
        return rotations[:0]


class InParts:
    """Base of static schemes, in which time is the load parameter."""

    dynamic = False
    advice = (
        "Try a smaller dt; beyond a limit load, and where softening snaps back (limit**2/energy of "
        "a hinge, half of it if softening is linear, above the stiffness that drives it), there is "
        "no equilibrium nearby: follow the path with ub.follow(scene, ub.ArcLength(...)) or "
        "ub.DissipationControl(...), prescribe a displacement in the place of the load, or run "
        "dynamics"
    )
    theta: float

    def step(self, t0: float, t1: float, end: float, q0: Array) -> Step:
        """Loads act where the resultants are, on the straight way to those at the end of the step.

        Parts of a step go in proportion; so loads and motions that are there at once can be reached
        in parts as well as those that grow.
        """
        fraction = (t1 - t0) / (end - t0)
        return Step(t0, t1, q0, load_time=end, motion_time=end, fraction=fraction, at=self.theta)

    def way_to_rest(self, dt: float) -> float:
        """No way to rest: everything is at rest."""
        return 0.0


class _AtEnd(PlainStep):
    """Base of schemes whose forces, strains and their variations are those at the end of the step.

    Their works are counted by the trapezoidal rule.
    """

    load_weight = 1.0
    theta = 1.0
    alpha = 0.0

    def mean(self, f: Callable[[Expr], Expr], q0: Expr, q1: Expr) -> Expr:
        """The one at the end of the step."""
        return f(q1)

    def resistance(self, softening: SofteningLaw, opening: Array, growth: Values) -> Values:
        return softening.traction(opening + growth)

    def virtual_strain(self, q0: Expr, q1: Expr, w: Expr, axis: Axis) -> Expr:
        return kinematics.virtual_strain(q1, w, axis)

    def resultants(self, C: Expr, e0: Expr, e1: Expr, constant: Constant) -> Expr:
        return functional.resultants(e1, C)

    def average(self, before: Expr, now: Expr) -> Expr:
        return now

    def secant(self, force: Callable[[Array], Array], e0: Array, e1: Array) -> tuple[Array, Array]:
        f = force(e1)
        return f, np.where(f != 0, 1.0, 0.0)

    def nodal_step(self, q0: Array, q1: Array, rotations: Index) -> tuple[Array, float]:
        """The increments themselves; a step may turn a node as far as it likes."""
        return q1 - q0, 0.0

    def acting(self, before: Array, now: Array) -> Array:
        """The mean of both ends: the trapezoidal rule, exact where forces grow in proportion."""
        return (before + now) / 2


@dataclass(frozen=True)
class Static(InParts, _AtEnd):
    """Static equilibrium at the end of each step; time is the load parameter.

    What is viscous acts at the mean rates of the step, in real time: dampers, :class:`KelvinVoigt`,
    viscosity of materials, works with ``v``.  There is no inertia.

    The ledger counts works by the trapezoidal rule, so its imbalance is of second order in the step
    and a measure of it.  A step is cut if its forces do not account for the stored and dissipated
    energy up to a twentieth, since it may have jumped to another branch of equilibria.

    Example:
        >>> run = ub.simulate(scene, ub.Static(), t=(0, 1), dt=0.1)
        >>> print(run.reaction(scene.supports[0])[-1, 1:].round(-2))  # N, N m
        [100000. 200000.]
    """

    slack = 0.05


class Weights(NamedTuple):
    """Weights of Newmark's formulas and of the mean accelerations of generalised-α.

    With a an acceleration that follows u and v, and ü that of the forces,

        u1 = u0 + dt v0 + dt² ((1/2 - β) a0 + β a1),     v1 = v0 + dt ((1 - γ) a0 + γ a1),
        (1 - α_m) a1 + α_m a0 = (1 - α_f) ü1 + α_f ü0.
    """

    α_m: float
    α_f: float
    γ: float
    β: float


CONSTANT = Weights(0.0, 0.0, 1.0, 1 / 2)
"""The acceleration of a step is that of its end; none at the beginning is needed."""

AVERAGE = Weights(0.0, 0.0, 1 / 2, 1 / 4)
"""The acceleration of a step is the mean of both ends."""


class _Accelerated(_AtEnd):
    """Base of Newmark's scheme and its relatives."""

    dynamic = True
    slack = math.inf
    slips = False
    has_mean_velocity = False
    weights: Weights
    kept: tuple[str, ...]

    def step(self, t0: float, t1: float, end: float, q0: Array) -> Step:
        """Loads and motions are those of the end."""
        return Step(t0, t1, q0, load_time=t1, motion_time=t1, fraction=1.0)

    def way_to_rest(self, dt: float) -> float:
        """Unknown: friction needs a mean velocity, and scenes with it are refused."""
        return 0.0

    @property
    def rings(self) -> bool:
        """Accelerations of a motion that is given follow from Newmark's formulas alone.

        Of what these make of an error only γ > 1/2 takes anything.
        """
        _, _, γ, β = self.weights
        return not 2 * β > γ > 0.5

    def _beginning(self, dt: float, rates: Rates) -> tuple[Weights, Array | float, Array | float]:
        """The weights of the step; a and ü at its beginning.

        a leads by (α_m - α_f) dt; until it is known by how much, steps do without.
        """
        if not rates.more:
            return CONSTANT, 0.0, 0.0
        acceleration, *lead = rates.more
        if len(rates.more) < len(self.kept):
            return AVERAGE, acceleration, acceleration
        return self.weights, acceleration + dt * lead[0] if lead else acceleration, acceleration

    def inertia(self, dt: float, rates: Rates) -> tuple[float, float, Array]:
        """Mass times the acceleration at the end."""
        (α_m, α_f, _, β), a, acceleration = self._beginning(dt, rates)
        factor = (1 - α_m) / ((1 - α_f) * β * dt**2)
        v = factor * (dt * rates.v + dt**2 * (0.5 - β) * a)
        v -= (α_m * a - α_f * acceleration) / (1 - α_f)
        return factor, 1.0, v

    def velocity(self, dt: float, rates: Rates) -> tuple[float, float, Array]:
        """Velocity at the end of the step."""
        (_, _, γ, β), a, _ = self._beginning(dt, rates)
        return γ / (β * dt), 1.0, (γ / β - 1) * rates.v + (γ / (2 * β) - 1) * dt * a

    def _end(self, dt: float, s: Array, rates: Rates) -> tuple[Array, Array, Array]:
        """v, a and ü at the end."""
        (α_m, α_f, γ, β), a0, acceleration = self._beginning(dt, rates)
        a: Array = (s - dt * rates.v - dt**2 * (0.5 - β) * a0) * (1 / (β * dt**2))
        v: Array = rates.v + dt * ((1 - γ) * a0 + γ * a)
        forced: Array = ((1 - α_m) * a + α_m * a0 - α_f * acceleration) * (1 / (1 - α_f))
        return v, a, forced

    def rates(self, dt: float, s: Array, rates: Rates) -> tuple[Array, ...]:
        """Velocities, accelerations, and what a differs from them by, over the time."""
        v, a, acceleration = self._end(dt, s, rates)
        if not rates.more or len(self.kept) == 1:
            return v, acceleration
        if len(rates.more) == len(self.kept):
            return v, acceleration, 1 / dt * (a - acceleration)
        lead = (self.weights.α_m - self.weights.α_f) / dt
        return v, acceleration, lead * (acceleration - rates.more[0])

    def slip(self, dt: float, change: Array, rates: Rates) -> Array:
        """Zero: no such difference of velocities is known."""
        return np.zeros_like(change)

    def error_weights(self) -> tuple[float, float]:
        """Return the error of Taylor's series; a runs ahead of the forces by α_m - α_f steps."""
        α_m, α_f, γ, β = self.weights
        ahead = α_m - α_f
        return 0.0, abs(β + ahead / 2 - 1 / 6) + abs(γ + ahead - 1 / 2)


@dataclass(frozen=True)
class Newmark(_Accelerated):
    """Newmark's scheme, by default with average acceleration; for comparison with other programs.

    ``gamma = 1/2`` is of second order and damps nothing: in large motion its energy is not bounded,
    and it may diverge where :class:`Midpoint` does not.  ``gamma > 1/2`` damps at first order;
    :class:`GeneralizedAlpha` does so at second order.

    The ledger counts works by the trapezoidal rule.  It does not close, and its imbalance, of
    second order in the step, is a measure of the error.  Accelerations at the beginning are those
    of a trial step of a sixteenth of the first one.  Laws that depend on rates, but for
    :class:`Rayleigh`, take the mean rate of the step, and yielding is stated at its end: both are
    of first order.

    Args:
        gamma: γ; from 1/2.
        beta: β; from γ/2, without which the scheme is unstable at large steps.

    Raises:
        SceneError: A number is out of range.  A run raises it if the scene has joints held by
            multipliers, motors or moving supports while nothing is damped; dry friction, or a
            rotating frame.

    Example:
        >>> run = ub.simulate(scene, ub.Newmark(), t=(0, 1), dt=0.05)
        >>> np.allclose(run.position(beam.end)[-1], solution.position(beam.end)[-1], atol=1e-3)
        True
    """

    gamma: float = 0.5
    beta: float = 0.25

    kept = ("acceleration",)
    advice = "Try a smaller dt, or GeneralizedAlpha(0.8), or Midpoint(), which conserves energy"

    def __post_init__(self) -> None:
        require_number(self.gamma, "Newmark: gamma", at_least=0.5)
        require_number(self.beta, "Newmark: beta")
        if 2 * self.beta < self.gamma:
            raise SceneError(
                f"Newmark: beta = {self.beta:g} must be at least gamma/2 = {self.gamma / 2:g}; "
                "below that the scheme is unstable at large steps"
            )

    @property
    def weights(self) -> Weights:  # type: ignore[override]
        """Without a relation between accelerations."""
        return Weights(0.0, 0.0, self.gamma, self.beta)


@dataclass(frozen=True)
class GeneralizedAlpha(_Accelerated):
    """Generalised-α scheme of second order with damping of high frequencies.

    With the weights of Chung and Hulbert (1993), in the form of Arnold and Brüls (2007): forces and
    constraints are satisfied at the ends of the steps, and an auxiliary acceleration carries the
    weights.  For linear scenes both are the same; this one is stable with joints held by
    multipliers if ``rho_inf < 1``.  Where the step changes, the auxiliary acceleration is adjusted,
    so that the order remains.

    Ledger, initial accelerations and rate-dependent laws are as in :class:`Newmark`.  In large
    motion the energy may grow; with :class:`DecayingMidpoint` it cannot.

    Args:
        rho_inf: Spectral radius at infinite frequency, from 0 (gone in a step) to 1 (undamped).

    Raises:
        SceneError: A number outside [0, 1].  A run raises it for what :class:`Newmark` lists.

    Example:
        >>> run = ub.simulate(scene, ub.GeneralizedAlpha(rho_inf=0.8), t=(0, 1), dt=0.05)
        >>> np.allclose(run.position(beam.end)[-1], solution.position(beam.end)[-1], atol=1e-3)
        True
    """

    rho_inf: float = 0.8

    kept = ("acceleration", "lead of acceleration")
    advice = "Try a smaller dt, a smaller rho_inf, or DecayingMidpoint(), whose energy is bounded"

    def __post_init__(self) -> None:
        require_between("GeneralizedAlpha: rho_inf", self.rho_inf, 0.0, 1.0)

    @property
    def weights(self) -> Weights:  # type: ignore[override]
        """Weights of Chung and Hulbert."""
        α_m = (2 * self.rho_inf - 1) / (self.rho_inf + 1)
        α_f = self.rho_inf / (self.rho_inf + 1)
        return Weights(α_m, α_f, 0.5 - α_m + α_f, (1 - α_m + α_f) ** 2 / 4)
