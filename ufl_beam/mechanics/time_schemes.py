# SPDX-License-Identifier: MIT
"""Time schemes: how two states of the scene become the equation of a step.

A scheme says, in UFL, which strains vary and which resultants act during a step, how velocities
follow from displacements, and at what time loads act.  Neither the laws of the material nor the
solver know which scheme runs.  This is what a scheme must say; the schemes whose forces act over
the step are in energy_momentum.py, those whose forces act at its end in classical.py.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from typing import Any, NamedTuple, Protocol, TypeGuard

import numpy as np
from ufl.core.expr import Expr

from ufl_beam.arrays import Array, Index
from ufl_beam.display import in_one_line
from ufl_beam.mechanics.kinematics import Axis
from ufl_beam.model.law_functions import Values
from ufl_beam.model.softening_laws import SofteningLaw

Constant = Callable[[float], Expr]
"""Makes a number of the scheme a constant of the form, so that changing it compiles nothing."""


@in_one_line
class Step(NamedTuple):
    """A step in time, as a scheme has it: its ends, and where loads and motions are taken.

    Example:
        >>> step = ub.Step.of(ub.EnergyMomentum(), 0.0, 0.1, 0.1, np.zeros(3))
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

    @classmethod
    def of(cls, scheme: Scheme, t0: float, t1: float, end: float, q0: Array) -> Step:
        """Return the step of a scheme from ``t0`` to ``t1``, a part of one that goes on to ``end``.

        In statics parts go in proportion to the loads and motions at the end of the whole step, so
        that those which are there at once can be reached in parts as well as those that grow.
        """
        w = scheme.load_weight
        if scheme.dynamic:
            return cls(t0, t1, q0, (1 - w) * t0 + w * t1, t1, fraction=1.0)
        return cls(t0, t1, q0, end, end, fraction=(t1 - t0) / (end - t0), at=w)

    @property
    def dt(self) -> float:
        """Length of the step; s."""
        return self.t1 - self.t0


class Scheme(Protocol):
    """Protocol of time schemes, static ones and those with inertia.

    Any hashable object with these attributes and methods is a scheme; a run names what it lacks.
    A base class to begin with is :class:`EnergyMomentumBase`; docs/extending.md has an example.

    Example:
        >>> class Mine:
        ...     dynamic, theta = False, 1.0
        >>> ub.simulate(scene, Mine(), t=(0, 1), dt=0.1)
        Traceback (most recent call last):
        ufl_beam.errors.ArgumentError: scheme: Mine is not a time scheme: it lacks advice, ...
    """

    dynamic: bool  # True if the scene has inertia
    advice: str  # where a step finds no equilibrium
    load_weight: float  # part of the step at which loads act; in statics on the straight way there
    weight_of_before: float  # of the forces before a step among those that do its work
    half_tangents: bool  # True if forces work on 2 tan(Δψ/2) of a rotation, else on Δψ
    limits_turn: bool  # True if a step that turns a node by more than 0.75 π is cut
    theta: float  # part of the step at which laws of inelastic material are stated
    slack: float  # part of what a step stores and dissipates that its forces may not account for
    alpha: float  # part of twice the energy of a change of strain that is lost numerically

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


CHANGE, V, V_BEFORE, MORE = range(4)
"""Places of the rates in C: the step or a change of velocities, velocities, ..."""


class Coefficients(NamedTuple):
    """Numbers of a step of a scheme with inertia.

    In a row the first number multiplies the step of the nodes (Δu, 2 tan(Δψ/2)), the next ones the
    velocities at its beginning, the velocities before the last step, and what is kept besides.

    Attributes:
        inertia: Of the acceleration that the mass is multiplied with in the equation of the step.
        velocity: Of the velocity in the equation of the step.
        rates: Of the velocities after the step, and of what is kept besides; as many rows.
        slip: Of Δu/Δt less the mean of both end velocities, P(88), whose work on the change of
            momentum is lost; its first number multiplies the change of velocities.  None: no loss.

    Example:
        >>> print(ub.EnergyMomentum().coefficients(dt=0.1, last_dt=0.1, known=0).rates)
        ((20.0, -1.0, 0.0),)
    """

    inertia: Sequence[float]
    velocity: Sequence[float]
    rates: Sequence[Sequence[float]]
    slip: Sequence[float] | None = None


class DynamicScheme(Scheme, Protocol):
    """Protocol of time schemes with inertia, whose ``dynamic`` is true.

    A base class to begin with is :class:`MidpointLoads`; docs/extending.md has an example.

    Example:
        >>> from dataclasses import dataclass
        >>> @dataclass(frozen=True)
        ... class Mine(ub.EnergyMomentumBase, ub.MidpointLoads):
        ...     alpha = 0.0
        >>> ub.simulate(scene, Mine(), t=(0, 1), dt=0.1)
        Traceback (most recent call last):
        ufl_beam.errors.ArgumentError: scheme: Mine is not a time scheme: it lacks coefficients, ...
    """

    kept: tuple[str, ...]  # names of the rates kept besides velocities, such as accelerations
    has_mean_velocity: bool  # in the equation of a step; friction and rotating frames need it
    looks_back: bool  # True if a step depends on the length of that before and its velocities
    rings: bool  # True if the accelerations of a motion that is given oscillate for ever

    def coefficients(self, dt: float, last_dt: float, known: int) -> Coefficients:
        """Return the numbers of a step of the length ``dt``.

        Args:
            dt: Length of the step; s.
            last_dt: Length of the step before; infinite if there was none; s.
            known: How many of :attr:`kept` are known at the beginning.  After the step, one is
                known for each row of rates behind the first.
        """

    def error_weights(self) -> tuple[float, float]:
        """(c2, c3) of the error c2 a dt² + c3 da/dt dt³ of a step of acceleration a."""


def has_inertia(scheme: Scheme) -> TypeGuard[DynamicScheme]:
    """Return whether the scheme is a dynamic one."""
    return scheme.dynamic


def acting(scheme: Scheme, before: Array, now: Array) -> Array:
    """Forces that do the work of a step, from those in its equation and in the one before."""
    w = scheme.weight_of_before
    return w * before + (1 - w) * now if w else now


def with_half_tangents(scheme: Scheme, rotations: Index) -> Index:
    """Rotations whose nodal step is 2 tan(Δψ/2): all or none."""
    return rotations if scheme.half_tangents else rotations[:0]


def nodal_step(scheme: Scheme, q0: Array, q1: Array, rotations: Index) -> Array:
    """Step of the nodes that forces work on: (Δu, 2 tan(Δψ/2)), or (Δu, Δψ)."""
    s, turned = q1 - q0, with_half_tangents(scheme, rotations)
    s[turned] = 2 * np.tan(s[turned] / 2)
    return np.asarray(s)


def way_to_rest(scheme: Scheme, dt: float) -> float:
    """Way of a step at the end of which there is no velocity, over that at its beginning; s.

    It is that of a step with none before it; zero where nothing is known of it.
    """
    if not has_inertia(scheme) or not scheme.has_mean_velocity:
        return 0.0
    of_step, of_velocity, *_ = scheme.coefficients(dt, math.inf, 0).rates[0]
    return -of_velocity / of_step


def combined(row: Sequence[float], s: Array, rates: Any) -> Array:
    """Sum of a row of :class:`Coefficients` for the step ``s`` of the nodes.

    ``rates`` are those at the beginning of the step: ``v``, ``v_before`` and ``more``, as many as
    are known of :attr:`DynamicScheme.kept`.
    """
    known: tuple[Array, ...] = (s, rates.v, rates.v_before, *rates.more)
    return sum(c * x for c, x in zip(row, known, strict=True) if c) + np.zeros(len(s))
