# SPDX-License-Identifier: MIT
"""Time schemes: how two states of the scene become the equation of a step.

A scheme says, in UFL, which strains vary and which resultants act during a step, how velocities
follow from displacements, and at what time loads act.  Neither the laws of the material nor the
solver know which scheme runs.  This is what a scheme must say; the schemes whose forces act over
the step are in energy_momentum.py, those whose forces act at its end in classical.py.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import NamedTuple, Protocol, TypeGuard

from ufl.core.expr import Expr

from ufl_beam.arrays import Array, Index
from ufl_beam.errors import SceneError, require_number
from ufl_beam.mechanics.kinematics import Axis
from ufl_beam.model.law_functions import Values
from ufl_beam.model.softening_laws import SofteningLaw
from ufl_beam.one_line import one_line

Constant = Callable[[float], Expr]
"""Makes a number of the scheme a constant of the form, so that changing it compiles nothing."""


class Step(NamedTuple):
    """A step in time, as a scheme has it: its ends, and where loads and motions are taken.

    Example:
        >>> step = ub.Midpoint().step(0.0, 0.1, 0.1, np.zeros(3))
        >>> step.load_time, step.motion_time, step.dt  # s
        (0.05, 0.1, 0.1)
    """

    t0: float  # beginning; s
    t1: float  # end; s
    q0: Array  # configuration at the beginning, local degrees of freedom
    load_time: float  # at which loads are taken; s
    motion_time: float  # at which prescribed motions are taken; s
    fraction: float  # part of the way to these loads and motions that the step goes; 1: all of it
    at: float = 1.0  # part of the way between loads at both ends, in the equation; 1: at the end
    q_before: Array | None = None  # configuration at the beginning of the last step, if ratio > 0
    ratio: float = 0.0  # of the length to that of the last step; 0 if none led to the beginning

    def __repr__(self) -> str:
        return one_line(self)

    @property
    def dt(self) -> float:
        """Length of the step; s."""
        return self.t1 - self.t0


class Scheme(Protocol):
    """Protocol of time schemes, static ones and those with inertia.

    Any hashable object with these attributes and methods is a scheme; a run names what it lacks.
    A base class to begin with is :class:`ExactStep`; docs/extending.md has an example.

    Example:
        >>> class Mine:
        ...     dynamic, theta = False, 1.0
        >>> ub.simulate(scene, Mine(), t=(0, 1), dt=0.1)
        Traceback (most recent call last):
        ufl_beam.errors.SceneError: scheme: Mine is not a time scheme: it lacks advice, ...
    """

    dynamic: bool  # True if the scene has inertia
    advice: str  # where a step finds no equilibrium
    load_weight: float  # part of the step at whose rotation follower loads act
    theta: float  # part of the step at which laws of inelastic material are stated
    slack: float  # part of what a step stores and dissipates that its forces may not account for
    alpha: float  # part of twice the energy of a change of strain that is lost numerically

    def step(self, t0: float, t1: float, end: float, q0: Array) -> Step:
        """The step from ``t0`` to ``t1``, perhaps a part of one that goes on to ``end``."""

    def resistance(self, softening: SofteningLaw, opening: Array, growth: Values) -> Values:
        """Traction of a discontinuity whose opening grows in the step."""

    def virtual_strain(self, q0: Expr, q1: Expr, w: Expr, axis: Axis) -> Expr:
        """Variation of the strains that the resultants work on; shape (3,)."""

    def resultants(self, C: Expr, e0: Expr, e1: Expr, constant: Constant) -> Expr:
        """(N, V, M) that act during the step, from stiffness and strains at both ends."""

    def average(self, before: Expr, now: Expr) -> Expr:
        """Average of a vector or a distance between frames, as variations take it."""

    def mean(self, f: Callable[[Expr], Expr], q0: Expr, q1: Expr) -> Expr:
        """Value of a function of the configuration in the step, whose integral has a meaning."""

    def virtual_turn(self, turn_a: Expr, turn_b: Expr, w: Expr) -> Expr:
        """Variation of a relative rotation whose virtual motion is ``w``."""

    def secant(self, force: Callable[[Array], Array], e0: Array, e1: Array) -> tuple[Array, Array]:
        """Force of a step from e0 to e1, and its derivative, where ``force`` has slopes 0 and 1."""

    def way_to_rest(self, dt: float) -> float:
        """Way of a step at the end of which there is no velocity, over that at its beginning; s."""

    def nodal_step(self, q0: Array, q1: Array, rotations: Index) -> tuple[Array, float]:
        """Return the conjugates of forces and moments, and the largest turn of a node; rad.

        ``rotations`` are the degrees of freedom that are rotations, as int32.
        """

    def acting(self, before: Array, now: Array) -> Array:
        """Forces that do the work of a step, from those in its equation and in the one before."""


class Rates(Protocol):
    """Velocities, and accelerations if a scheme has them, at the beginning of a step."""

    v: Array  # velocities; m/s, rad/s
    v_before: Array  # those at the beginning of the step before
    more: tuple[Array, ...]  # kept besides, as many as are known of :attr:`DynamicScheme.kept`
    last_dt: float  # length of the step before; infinite if there was none; s


class DynamicScheme(Scheme, Protocol):
    """Protocol of time schemes with inertia, whose ``dynamic`` is true.

    A base class to begin with is :class:`Midway`; docs/extending.md has an example.

    Example:
        >>> from dataclasses import dataclass
        >>> @dataclass(frozen=True)
        ... class Mine(ub.ExactStep, ub.Midway):
        ...     alpha = 0.0
        >>> ub.simulate(scene, Mine(), t=(0, 1), dt=0.1)
        Traceback (most recent call last):
        ufl_beam.errors.SceneError: scheme: Mine is not a time scheme: it lacks way_to_rest, ...
    """

    kept: tuple[str, ...]  # names of the rates kept besides velocities, such as accelerations
    slips: bool  # True if it loses energy by :meth:`slip`
    has_mean_velocity: bool  # in the equation of a step; friction and rotating frames need it
    rings: bool  # True if the accelerations of a motion that is given oscillate for ever

    def half_tangents(self, rotations: Index) -> Index:
        """Rotations whose nodal step is 2 tan(Δψ/2); for the others it is Δψ."""

    def inertia(self, dt: float, rates: Rates) -> tuple[float, float, Array]:
        """(factor, back, v) of the force of inertia M (factor s - back v), s being the step."""

    def velocity(self, dt: float, rates: Rates) -> tuple[float, float, Array]:
        """(factor, back, v) of the velocity factor s - back v in the equation of the step."""

    def rates(self, dt: float, s: Array, rates: Rates) -> tuple[Array, ...]:
        """Velocities after the step ``s`` of the nodes, then what is kept besides."""

    def slip(self, dt: float, change: Array, rates: Rates) -> Array:
        """Return Δu/Δt less the mean of both end velocities, from their ``change``, P(88)."""

    def error_weights(self) -> tuple[float, float]:
        """(c2, c3) of the error c2 a dt² + c3 da/dt dt³ of a step of acceleration a."""


def has_inertia(scheme: Scheme) -> TypeGuard[DynamicScheme]:
    """Return whether the scheme is a dynamic one."""
    return scheme.dynamic


def require_between(what: str, value: float, low: float, high: float) -> None:
    """Raise :class:`SceneError` if a number of a scheme lies outside its range."""
    if require_number(value, what, at_least=low) > high:
        raise SceneError(f"{what} = {value:g} must lie between {low:g} and {high:g}")
