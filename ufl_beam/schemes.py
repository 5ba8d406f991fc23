"""Time schemes: how two states of the scene become the equation of a step.

A scheme says, in UFL, which strains vary and which resultants act during a step, how velocities
follow from displacements, and at what time loads act.  Neither the laws of the material nor the
solver know which scheme runs; a new one (Newmark, generalised-α, ...) is one more class here.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from typing import Protocol, TypeGuard, runtime_checkable

import numpy as np
import ufl
from ufl.core.expr import Expr

from ufl_beam import kinematics
from ufl_beam.compat import Array
from ufl_beam.errors import SceneError, require_number
from ufl_beam.grid import Index
from ufl_beam.kinematics import Axis
from ufl_beam.laws import Softening, Values
from ufl_beam.loops import doubles, integers, lib

Constant = Callable[[float], Expr]
"""Makes a number of the scheme a constant of the form, so that changing it compiles nothing."""


@dataclass(frozen=True)
class Step:
    """A step in time.

    Attributes:
        t0: Beginning; s.
        t1: End; s.
        q0: Configuration at the beginning, local degrees of freedom.
        load_time: Time at which loads are taken; s.
        motion_time: Time at which prescribed motions are taken; s.
        toward: How far the step goes from the loads and motions before it to these; 1: there.
    """

    t0: float
    t1: float
    q0: Array
    load_time: float
    motion_time: float
    toward: float

    @property
    def dt(self) -> float:
        """Length of the step; s."""
        return self.t1 - self.t0


@runtime_checkable
class Scheme(Protocol):
    """What a time scheme must say."""

    dynamic: bool
    """Whether the scene has inertia."""

    advice: str
    """What to try where a step finds no equilibrium."""

    load_weight: float
    """Follower loads turn with the rotation at this part of the step."""

    theta: float
    """Laws of inelastic material are stated at this part of the step."""

    slack: float
    """A step is cut if its forces do not account for this part of what it stores and dissipates."""

    loss: float
    """Part of twice the energy of a change of strain that is lost numerically."""

    def step(self, t0: float, t1: float, end: float, q0: Array) -> Step:
        """The step from ``t0`` to ``t1``, perhaps a part of one that goes on to ``end``."""

    def resistance(self, softening: Softening, opening: Array, growth: Values) -> Values:
        """Traction of a discontinuity whose opening grows in the step."""

    def virtual_strain(self, q0: Expr, q1: Expr, w: Expr, axis: Axis) -> Expr:
        """Variation of the strains that the resultants work on; shape (3,)."""

    def resultants(self, C: Expr, e0: Expr, e1: Expr, constant: Constant) -> Expr:
        """(N, V, M) that act during the step, from stiffness and strains at both ends."""

    def losses(self, C: Expr, e0: Expr, e1: Expr, constant: Constant) -> tuple[Expr, ...]:
        """Energies per length that the resultants lose numerically in the step; often none."""

    def average(self, before: Expr, now: Expr) -> Expr:
        """Of a vector or a distance between frames: the one that variations are taken with."""

    def virtual_turn(self, turn_a: Expr, turn_b: Expr, w: Expr) -> Expr:
        """Variation of a relative rotation whose virtual motion is ``w``."""

    def secant(self, force: Callable[[Array], Array], e0: Array, e1: Array) -> tuple[Array, Array]:
        """Force of a step from e0 to e1, and its derivative, where ``force`` has slopes 0 and 1."""

    def way_to_rest(self, dt: float) -> float:
        """Way of a step at the end of which there is no velocity, over that at its beginning; s."""

    def nodal_step(self, q0: Array, q1: Array, rotations: Index) -> tuple[Array, float]:
        """What forces and moments work on in a step; and the largest turn of a node; rad.

        ``rotations`` are the degrees of freedom that are rotations, as int32.
        """

    def acting(self, before: Array, now: Array) -> Array:
        """Forces that do the work of a step, from those in its equation and in the one before."""


class DynamicScheme(Scheme, Protocol):
    """What a scheme with inertia must say besides; its step of the nodes is (Δu, 2 tan(Δψ/2))."""

    beta: float
    """Part of the mass times the squared change of velocity that is lost numerically."""

    def velocity_weights(self, dt: float) -> tuple[float, float]:
        """(a, b) of the velocities v1 = a s - b v0 after the step s of the nodes."""

    def error_weights(self) -> tuple[float, float]:
        """(c2, c3) of the error c2 a dt² + c3 da/dt dt³ of a step of acceleration a."""


def has_inertia(scheme: Scheme) -> TypeGuard[DynamicScheme]:
    """Whether the scheme is a dynamic one."""
    return scheme.dynamic


@dataclass(frozen=True)
class Static:
    """Equilibrium at the end of each step; no inertia, time is the load parameter.

    The ledger counts works by the trapezoidal rule, so its imbalance is of second order in the
    step and a measure of it.  A step is cut whose forces leave a twentieth of what it stores and
    dissipates unexplained, for it may have leapt to another branch of equilibria.
    """

    dynamic = False
    advice = (
        "Try a smaller dt; beyond a limit load, and where softening snaps back (limit**2/energy of "
        "a hinge, half of it if softening is linear, above the stiffness that drives it), there is "
        "no equilibrium nearby: follow the path with ub.follow(scene, ub.ArcLength(...)) or "
        "ub.Dissipation(...), prescribe a displacement in the place of the load, or run dynamics"
    )
    load_weight = 1.0
    theta = 1.0
    loss = 0.0
    slack = 0.05

    def step(self, t0: float, t1: float, end: float, q0: Array) -> Step:
        """Parts of a step go in proportion to the loads and motions of its end.

        So loads that are there at once can be reached in parts as well as those that grow.
        """
        return Step(t0, t1, q0, load_time=end, motion_time=end, toward=(t1 - t0) / (end - t0))

    def resistance(self, softening: Softening, opening: Array, growth: Values) -> Values:
        """The traction at the end of the step."""
        return softening.traction(opening + growth)

    def virtual_strain(self, q0: Expr, q1: Expr, w: Expr, axis: Axis) -> Expr:
        """The variation at the end of the step."""
        return kinematics.virtual_strain(q1, w, axis)

    def resultants(self, C: Expr, e0: Expr, e1: Expr, constant: Constant) -> Expr:
        """C e at the end of the step; the components are uncoupled."""
        return _scaled(C, e1)

    def losses(self, C: Expr, e0: Expr, e1: Expr, constant: Constant) -> tuple[Expr, ...]:
        """None."""
        return ()

    def average(self, before: Expr, now: Expr) -> Expr:
        """The one at the end of the step."""
        return now

    def virtual_turn(self, turn_a: Expr, turn_b: Expr, w: Expr) -> Expr:
        """The virtual rotation itself."""
        return w

    def secant(self, force: Callable[[Array], Array], e0: Array, e1: Array) -> tuple[Array, Array]:
        """The force at the end of the step."""
        f = force(e1)
        return f, np.where(f != 0, 1.0, 0.0)

    def way_to_rest(self, dt: float) -> float:
        """None: everything is at rest."""
        return 0.0

    def nodal_step(self, q0: Array, q1: Array, rotations: Index) -> tuple[Array, float]:
        """The increments themselves; a step may turn a node as far as it likes."""
        return q1 - q0, 0.0

    def acting(self, before: Array, now: Array) -> Array:
        """The mean of both ends: the trapezoidal rule, exact where forces grow in proportion."""
        return (before + now) / 2


class _ExactStep:
    """What steps have in common whose works are exact increments of energy."""

    alpha: float

    @property
    def theta(self) -> float:
        """The resultants of P(89) are those at this part of the step."""
        return 0.5 + self.alpha

    @property
    def loss(self) -> float:
        """What ``alpha`` takes."""
        return self.alpha

    def resistance(self, softening: Softening, opening: Array, growth: Values) -> Values:
        """The mean traction, so that the work of the step is what the opening dissipates."""
        return softening.mean_traction(opening, growth)

    def virtual_strain(self, q0: Expr, q1: Expr, w: Expr, axis: Axis) -> Expr:
        """The variation that turns the step into the increment of the strains."""
        return kinematics.virtual_strain_over_step(q0, q1, w, axis)

    def resultants(self, C: Expr, e0: Expr, e1: Expr, constant: Constant) -> Expr:
        """The mean of both ends, and more of the end the more energy is to go."""
        mean = _scaled(C, (e0 + e1) / 2)  # P(83)
        if self.alpha == 0:
            return mean
        return mean + constant(self.alpha) * _scaled(C, e1 - e0)  # P(89)

    def losses(self, C: Expr, e0: Expr, e1: Expr, constant: Constant) -> tuple[Expr, ...]:
        """What ``alpha`` takes."""
        if self.alpha == 0:
            return ()
        return (constant(self.alpha) * ufl.dot(_scaled(C, e1 - e0), e1 - e0),)  # P(90)

    def average(self, before: Expr, now: Expr) -> Expr:
        """The mean of both ends, of which increments are products."""
        return (before + now) / 2

    def virtual_turn(self, turn_a: Expr, turn_b: Expr, w: Expr) -> Expr:
        """The increment of the rotation, if ``w`` is 2 tan(turn_b/2) - 2 tan(turn_a/2)."""
        tan_a, tan_b = (ufl.sin(x / 2) / ufl.cos(x / 2) for x in (turn_a, turn_b))
        return kinematics.over_tan((turn_b - turn_a) / 2) / (1 + tan_a * tan_b) * w

    def secant(self, force: Callable[[Array], Array], e0: Array, e1: Array) -> tuple[Array, Array]:
        """The mean force over the way, so that its work is what f²/2 grows by."""
        f0, f1, way = force(e0), force(e1), e1 - e0
        ends = (f0 != 0) + 0.0, (f1 != 0) + 0.0
        moves = way != 0
        part = np.divide(f1 - f0, way, out=(ends[0] + ends[1]) / 2, where=moves)
        f = (f0 + f1) / 2 * part
        return f, np.divide(f1 - f, way, out=ends[1] / 2, where=moves)

    def nodal_step(self, q0: Array, q1: Array, rotations: Index) -> tuple[Array, float]:
        """(Δu, 2 tan(Δψ/2)): with it works are exact increments; see docs/errata.md."""
        s = np.empty(len(q1))
        turn: float = lib.step_of_nodes(
            len(s), len(rotations), integers(rotations), doubles(s), doubles(q0), doubles(q1)
        )
        return s, turn

    def acting(self, before: Array, now: Array) -> Array:
        """The forces in the equation of the step."""
        return now


@dataclass(frozen=True)
class ExactStatic(_ExactStep):
    """Equilibrium without inertia, with an exact ledger: works are exact increments of energy.

    :class:`Static` finds equilibrium at the ends of the steps and counts works by the trapezoidal
    rule; here the equation of the step is that of :class:`Midpoint`.  Inelastic material follows
    its laws over the step, not only at its end.  A leap to another branch of equilibria does not
    stop it, but what that sets free is in the entry "numerical"; :class:`Static` stops.

    Args:
        theta: Part of the step at which resultants and loads are in equilibrium.  1/2 loses
            nothing, but leaves the states at the ends free to oscillate about equilibrium; 1
            brings them there, and what that costs is the entry "numerical" of the ledger.
            Uniform moments differ along a beam by (Δψ/2)² of a step.

    Raises:
        SceneError: A number outside [1/2, 1].
    """

    theta: float = 1.0

    dynamic = False
    slack = math.inf
    advice = Static.advice

    def __post_init__(self) -> None:
        _require_between("ExactStatic: theta", self.theta, 0.5, 1.0)

    @property
    def alpha(self) -> float:  # type: ignore[override]
        """Dissipation by the resultants."""
        return self.theta - 0.5

    @property
    def load_weight(self) -> float:
        """Follower loads turn with the rotation where the resultants are in equilibrium."""
        return self.theta

    def way_to_rest(self, dt: float) -> float:
        """None: everything is at rest."""
        return 0.0

    def step(self, t0: float, t1: float, end: float, q0: Array) -> Step:
        """Loads act where the resultants are, motions arrive at the end."""
        return Step(t0, t1, q0, t0 + self.theta * (t1 - t0), motion_time=t1, toward=1.0)


@dataclass(frozen=True)
class Midpoint(_ExactStep):
    """Midpoint rule that conserves energy and momentum exactly, or loses energy as it is told.

    ``alpha = beta = 0`` conserves energy, linear and angular momentum to solver tolerance at any
    step size.  Positive values take energy out of the high frequencies, never in: ``alpha`` through
    the resultants, which keeps the momenta exact; ``beta`` through the velocities, which gives
    up angular momentum.  What they take is the entry "numerical" of the ledger.

    Laws of inelastic material are stated in the middle of the step, which is of second order;
    ``alpha = 1/2`` states them at its end: backward Euler, of first order.  In the middle of the
    step stresses lie on the yield surface, and an open hinge bears nothing; at the ends they
    alternate about that by the order of a step, which a small ``alpha`` damps.

    Args:
        alpha: Dissipation by the resultants, from 0 to 1/2.
        beta: Dissipation by the velocities, from 0 to 1/2.

    Raises:
        SceneError: A number outside [0, 1/2].

    Equations:
        P(77)-P(91); P(82) corrected, see docs/errata.md.
    """

    alpha: float = 0.0
    beta: float = 0.0

    dynamic = True
    slack = math.inf
    load_weight = 0.5
    advice = (
        "Try a smaller dt, loads and motions without jumps, or more energy taken out of high "
        "frequencies, such as Midpoint(alpha=0.05, beta=0.05)"
    )

    def __post_init__(self) -> None:
        for name in ("alpha", "beta"):
            _require_between(f"Midpoint: {name}", getattr(self, name), 0.0, 0.5)

    def step(self, t0: float, t1: float, end: float, q0: Array) -> Step:
        """Loads act in the middle of the step, motions arrive at its end."""
        return Step(t0, t1, q0, load_time=(t0 + t1) / 2, motion_time=t1, toward=1.0)

    def way_to_rest(self, dt: float) -> float:
        """From v1 = a s - b v0 = 0."""
        a, b = self.velocity_weights(dt)
        return b / a

    def velocity_weights(self, dt: float) -> tuple[float, float]:
        """(a, b) of the velocities v1 = a s - b v0 after the step s of the nodes."""
        keep = 0.5 + self.beta
        return 1 / (dt * keep), (0.5 - self.beta) / keep  # P(87)

    def error_weights(self) -> tuple[float, float]:
        """The trapezoidal rule's, and what both kinds of dissipation delay."""
        return self.beta, 1 / 12 + self.alpha


def _scaled(C: Expr, e: Expr) -> Expr:
    """Component by component product; shape (3,)."""
    return ufl.as_vector([C[i] * e[i] for i in range(3)])


def _require_between(what: str, value: float, low: float, high: float) -> None:
    require_number(value, what, at_least=low)
    if value > high:
        raise SceneError(f"{what} = {value:g} must lie between {low:g} and {high:g}")
