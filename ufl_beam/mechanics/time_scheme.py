# SPDX-License-Identifier: MIT
"""Time schemes: the equation of a step between two states of the scene.

A scheme states in UFL how strains vary and which resultants act in a step.  It also states how
velocities follow from displacements, and when loads act.  Material laws and the solver use schemes
only through the protocols in this module.  The schemes are in time_schemes.py.
"""

from __future__ import annotations

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
"""Function that makes a number a constant of the form, so that a new value needs no compilation."""


@in_one_line
class Step(NamedTuple):
    """Time step of a scheme: its ends, and the times of loads and prescribed motions.

    Example:
        >>> step = ub.extend.Step.create(ub.EnergyMomentum(), 0.0, 0.1, 0.1, np.zeros(3))
        >>> step.load_time, step.motion_time, step.dt  # s
        (0.05, 0.1, 0.1)
    """

    t0: float  # beginning; s
    t1: float  # end; s
    q0: Array  # configuration at the beginning, local degrees of freedom
    load_time: float  # time at which loads are taken; s
    motion_time: float  # time at which prescribed motions are taken; s
    fraction: float  # applied fraction of the remaining increment of loads and motions; 1: all
    at: float = 1.0  # fraction of the applied increment of loads that acts in the step equation
    q_before: Array | None = None  # configuration at the beginning of the last step, if ratio > 0
    ratio: float = 0.0  # length divided by the length of the last step; 0 if there is none

    @classmethod
    def create(cls, scheme: Scheme, t0: float, t1: float, end: float, q0: Array) -> Step:
        """Return the step from ``t0`` to ``t1``; if ``t1 < end``, a substep of the step to ``end``.

        In statics a substep applies its fraction of the increment of loads and motions up to
        ``end``.  Sudden loads, too, can thus be applied in substeps.
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
    """Protocol of time schemes, with or without inertia.

    Any hashable object with these attributes and methods is a scheme; the error of a run lists
    missing names.  A base class to begin with is :class:`EnergyMomentumBase`; docs/extending.md has
    an example.

    Example:
        >>> class Mine:
        ...     dynamic, theta = False, 1.0
        >>> ub.simulate(scene, Mine(), t=(0, 1), dt=0.1)
        Traceback (most recent call last):
        ufl_beam.errors.ArgumentError: scheme: Mine is not a time scheme: it lacks advice, ...
    """

    @property
    def dynamic(self) -> bool:
        """Whether the scheme has inertia."""

    @property
    def advice(self) -> str:
        """Advice in the error if a step finds no equilibrium."""

    @property
    def load_weight(self) -> float:
        """When loads act, as a fraction of the step; in statics, how much of them."""

    @property
    def weight_of_before(self) -> float:
        """Weight of the forces before the step in its work, see :func:`acting`."""

    @property
    def half_tangents(self) -> bool:
        """Whether forces work on 2 tan(Δψ/2) of a rotation, else on Δψ.

        With Δψ, a step that turns a rigid part by more than 0.5 rad is subdivided.
        """

    @property
    def limits_rotation(self) -> bool:
        """Whether a step that turns a node by more than 0.75 π is subdivided.

        Otherwise, in motion, a step is subdivided if this rotation differs by more than 0.75 π from
        the rotation with the velocity before the step.
        """

    @property
    def theta(self) -> float:
        """Fraction of the step at which inelastic material satisfies its laws."""

    @property
    def slack(self) -> float:
        """Relative error of the work of forces above which a static step is subdivided."""

    @property
    def alpha(self) -> float:
        """Numerical loss divided by twice the energy of the change of strain."""

    @property
    def lost_fraction(self) -> float:
        """Numerical loss divided by the energy of a second difference of strain."""

    def resistance(self, softening: SofteningLaw, opening: Array, growth: Values) -> Values:
        """Return the traction of a discontinuity with an ``opening`` and its growth in the step."""

    def virtual_strain(self, q0: Expr, q1: Expr, w: Expr, axis: Axis) -> Expr:
        """Return the variation of the strains that the resultants work on; shape (3,)."""

    def resultants(self, C: Expr, e0: Expr, e1: Expr, constant: Constant) -> Expr:
        """Return (N, V, M) in the step equation, from stiffness and strains at both ends."""

    def average(self, before: Expr, now: Expr) -> Expr:
        """Return the vector or length in the variations of relative motions.

        It is the mean of both ends if forces act over the step, ``now`` if they act at its end.
        """

    def mean(self, f: Callable[[Expr], Expr], q0: Expr, q1: Expr) -> Expr:
        """Return the value of a function of the configuration in the step equation."""

    def virtual_rotation(self, rotation_a: Expr, rotation_b: Expr, w: Expr) -> Expr:
        """Return the variation of the rotation of b relative to a, which rotate in the step.

        ``w`` is the difference of the virtual nodal rotations of b and a.
        """


CHANGE, V, V_BEFORE, FURTHER = range(4)
"""Positions of the rates in C, in the order of a row of :class:`Coefficients`."""


class Coefficients(NamedTuple):
    """Coefficients of a scheme with inertia in a step.

    The numbers of a row multiply the step of the nodes, see :func:`nodal_step`, the velocities at
    the beginning of the step, the velocities before the last step, and the known rates of
    :attr:`DynamicScheme.further_rates`, in this order.

    Attributes:
        inertia: Row of the acceleration in the equation of the step.
        velocity: Row of the velocity in the equation of the step.
        rates: Row of the velocities after the step, then a row of each of the ``further_rates``.
        velocity_defect: Row of the defect Δu/Δt - (v0 + v1)/2, P(88).  The defect times the change
            of momentum is the numerical loss.  Its first number multiplies v1 - v0 instead of the
            step of the nodes.  None means no loss.

    Example:
        >>> print(ub.EnergyMomentum().coefficients(dt=0.1, last_dt=0.1, known=0).rates)
        ((20.0, -1.0, 0.0),)
    """

    inertia: Sequence[float]
    velocity: Sequence[float]
    rates: Sequence[Sequence[float]]
    velocity_defect: Sequence[float] | None = None


class DynamicScheme(Scheme, Protocol):
    """Protocol of time schemes with inertia, whose ``dynamic`` is true.

    A base class to begin with is :class:`MidpointDynamics`; docs/extending.md has an example.

    Example:
        >>> from dataclasses import dataclass
        >>> @dataclass(frozen=True)
        ... class Mine(ub.extend.EnergyMomentumBase, ub.extend.MidpointDynamics):
        ...     alpha = 0.0
        >>> ub.simulate(scene, Mine(), t=(0, 1), dt=0.1)
        Traceback (most recent call last):
        ufl_beam.errors.ArgumentError: scheme: Mine is not a time scheme: it lacks coefficients, ...
    """

    @property
    def further_rates(self) -> tuple[str, ...]:
        """Names of rates besides velocities, such as accelerations."""

    @property
    def has_mean_velocity(self) -> bool:
        """Whether friction and RotatingFrame can use the step's mean velocity."""

    @property
    def uses_last_step(self) -> bool:
        """Whether a step depends on length and velocities of the last step."""

    @property
    def accelerations_oscillate(self) -> bool:
        """Whether accelerations of prescribed motions oscillate for ever."""

    def coefficients(self, dt: float, last_dt: float, known: int) -> Coefficients:
        """Return the coefficients of a step of length ``dt``.

        Args:
            dt: Length of the step; s.
            last_dt: Length of the step before; infinite if there was none; s.
            known: Number of rates of :attr:`further_rates` that are known at the beginning.  After
                the step, ``len(rates) - 1`` of these rates are known.
        """

    def error_weights(self) -> tuple[float, float]:
        """Return (c2, c3) of the error c2 a dt² + c3 da/dt dt³ of a step with acceleration a."""


def has_inertia(scheme: Scheme) -> TypeGuard[DynamicScheme]:
    """Return whether a scheme has inertia."""
    return scheme.dynamic


def acts_at_end(scheme: Scheme) -> bool:
    """Return whether the equation of a step holds at its end, else between both ends."""
    return bool(scheme.average(0.0, 1.0) == 1.0)


def stages_of(scheme: Scheme) -> tuple[float, ...]:
    """Return the lengths of the stages of a step, as fractions of the step; their sum is 1.

    A scheme with several stages has them in an attribute ``stages``; some may go backward.
    """
    return getattr(scheme, "stages", (1.0,))


def order_of(scheme: Scheme) -> int:
    """Return the largest order of the errors of a scheme: 4 for a composition of stages, else 2."""
    return 4 if len(stages_of(scheme)) > 1 else 2


def acting(scheme: Scheme, before: Array, now: Array) -> Array:
    """Return the forces that do the work of a step: a mean of forces ``before`` and ``now``."""
    w = scheme.weight_of_before
    return w * before + (1 - w) * now if w else now


def with_half_tangents(scheme: Scheme, rotations: Index) -> Index:
    """Return the rotations whose nodal step is 2 tan(Δψ/2): all or none."""
    return rotations if scheme.half_tangents else rotations[:0]


def nodal_step(scheme: Scheme, q0: Array, q1: Array, rotations: Index) -> Array:
    """Return the nodal step that forces work on: (Δu, 2 tan(Δψ/2)), or (Δu, Δψ)."""
    s, turned = q1 - q0, with_half_tangents(scheme, rotations)
    s[turned] = 2 * np.tan(s[turned] / 2)
    return np.asarray(s)


def combined(row: Sequence[float], s: Array, rates: Any) -> Array:
    """Return the sum of a row of :class:`Coefficients` for the nodal step ``s``.

    ``rates`` has the velocities ``v`` at the beginning of the step, ``v_before`` at the beginning
    of the last step, and as ``more`` the known rates of :attr:`DynamicScheme.further_rates`.
    """
    known: tuple[Array, ...] = (s, rates.v, rates.v_before, *rates.more)
    return sum(c * x for c, x in zip(row, known, strict=True) if c) + np.zeros(len(s))
