# SPDX-License-Identifier: MIT
"""Corrector of path following, and the base class of the controls that it follows."""

from __future__ import annotations

import math
from abc import ABC, abstractmethod
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Protocol

import numpy as np

from ufl_beam.analysis.critical_points import Direction, Stiffness, metric
from ufl_beam.arrays import Array
from ufl_beam.errors import StepFailed
from ufl_beam.mechanics.time_schemes import Step
from ufl_beam.model.scene import Scene
from ufl_beam.simulation.simulation import Simulation
from ufl_beam.simulation.step_solver import Trial
from ufl_beam.terms.base import Term

MOST_DOUBLINGS = 30  # doublings of a step until something dissipates in it
ONSET_PART = 1e-6  # part of the dissipated energy of a step at which its onset is looked at
MOST_BISECTIONS = 40  # of the step in which the onset of dissipation is sought
CONTROL_TOLERANCE = 1e-9  # part of a step by which its end may miss the equation of the control


class Constraint(Protocol):
    """Equation of a step besides equilibrium; dimensionless."""

    def residual(self, q: Array, t: float) -> float:
        """Residual in a state."""

    def derivative(self, q: Array, way: Direction) -> float:
        """Derivative of the residual along a direction."""


@dataclass(frozen=True)
class GivenLoadFactor:
    """Constraint that the load factor is t."""

    t: float

    def residual(self, q: Array, t: float) -> float:
        """Residual of the equation: missing change of the load factor."""
        return t - self.t

    def derivative(self, q: Array, way: Direction) -> float:
        """Derivative of the load factor along a direction."""
        return way.t


class PathCorrector:
    """Corrector of path following: equilibrium augmented by the equation of the control.

    A change ``factor`` of the load factor counts as much as a unit of displacement.
    """

    def __init__(self, simulation: Simulation, factor: float) -> None:
        self.simulation, self.factor = simulation, factor
        self.share = simulation.share
        self.weights = metric(self.share)
        self.t = simulation.t
        self.dissipates = False
        self._driven: list[Term] = [*simulation.loads, *simulation.couplings]
        self.direction: Direction = Direction(np.zeros(self.share.size), 0.0)
        self.sought = self.direction

    # -- measures ------------------------------------------------------------------------------

    def product(self, a: Direction, b: Direction, factor: float) -> float:
        """Return the inner product of two directions; dimensionless."""
        return self.share.total(float((self.weights * a.q) @ b.q)) + a.t * b.t / factor**2

    def length(self, way: Direction, factor: float) -> float:
        """Return the length of a direction, however small; dimensionless."""
        along = abs(way.t) / factor
        largest = max(self.share.largest(float(np.abs(way.q).max(initial=0.0))), along)
        if largest == 0.0 or not math.isfinite(largest):
            return largest
        # Squares of what is below 1e-154 would be nothing.
        unit = way / largest
        return largest * math.sqrt(self.product(unit, unit, factor))

    def size(self, way: Direction) -> float:
        """Return the length of a direction's part in the configuration; dimensionless."""
        return self.length(Direction(way.q, 0.0), 1.0)

    def dissipation(self, q: Array) -> float:
        """Return the energy that beams and springs dissipate in the step to ``q``; J."""
        in_cells = sum(one.dissipation(q) for one in self.simulation.inelastic)
        here = sum((one.dissipation(q) for one in self.simulation.couplings), in_cells)
        return self.share.total(here)

    def predict_dissipation(self, energy: float) -> Direction:
        """Predict a step that dissipates so much energy (J); :class:`StepFailed` if none does.

        Where nothing dissipated before, the direction changes as soon as something does.
        """
        way = self.direction
        self.begin()
        gone = Direction(np.zeros(self.share.size), 0.0)
        if not self.dissipates:
            gone = self._until(ONSET_PART * energy, gone, way)
            way = self._beyond(gone)
        return self._until(energy, gone, way)

    def kink(self, length: float) -> tuple[Direction, Direction] | None:
        """Find the state in which dissipation begins within a length; the direction beyond it."""
        way, q = self.direction, self.simulation.q
        self.begin()
        if self.dissipates or not self.dissipation(q + length * way.q) > 0:
            return None
        low, high = 0.0, length
        for _ in range(MOST_BISECTIONS):
            middle = (low + high) / 2
            begun = self.dissipation(q + middle * way.q) > 0
            low, high = (low, middle) if begun else (middle, high)
        gone = high * way
        return gone, self._beyond(gone)

    def _beyond(self, gone: Direction) -> Direction:
        """Direction of the path where something has just begun to dissipate."""
        self.t, q = self.simulation.t + gone.t, self.simulation.q + gone.q
        way = self.direction_of(self.stiffness_at(q))
        return -way if self.dissipation_side(q, way) < 0 else way

    def _until(self, energy: float, gone: Direction, way: Direction) -> Direction:
        """Return the step so far, and as much more along a direction as dissipates so much (J)."""

        def dissipated(length: float) -> float:
            return self.dissipation(self.simulation.q + gone.q + length * way.q)

        low, high = 0.0, 1e-6 / self.length(way, self.factor)
        for _ in range(MOST_DOUBLINGS):
            if dissipated(high) >= energy:
                break
            low, high = high, 2 * high
        else:
            raise StepFailed("nothing dissipates in the direction of the path")
        for _ in range(12):
            middle = (low + high) / 2
            low, high = (middle, high) if dissipated(middle) < energy else (low, middle)
        return gone + high * way

    def dissipation_side(self, q: Array, way: Direction) -> float:
        """Positive where more dissipates in a direction from ``q``, negative where against it."""
        now, size = self.dissipation(q), self.size(way)
        flows = self.share.total(float(any(one.flows() for one in self.simulation.couplings)))
        for doubled in range(MOST_DOUBLINGS if (now > 0 or flows) and size > 0 else 0):
            δ = 1e-9 * 2**doubled / size
            more = self.dissipation(q + δ * way.q) - self.dissipation(q - δ * way.q)
            if abs(more) > now:
                return more
        return 0.0

    # -- the border ----------------------------------------------------------------------------

    def step_at(self, t: float) -> Step:
        """Return an infinitely slow step to a load factor: rates and viscous forces vanish."""
        return Step(-math.inf, t, self.simulation.q, load_time=t, motion_time=t, fraction=1.0)

    @staticmethod
    def _give(step: Step, terms: Sequence[Term]) -> None:
        for term in terms:
            term.begin(step)

    def _moved(self, t: float) -> Array:
        """Return the prescribed motions at the degrees of freedom of supports; zero elsewhere."""
        x = np.zeros(self.share.size)
        self.simulation.supports.move(x, x, self.step_at(t))
        return x

    def arrive(self, x: Array) -> None:
        """Bring the loads to the load factor of an iterate."""
        self._x = x.copy()
        self._give(self.step_at(self.t), self._driven)

    def tangent(self, x: Array, r: Array) -> None:
        """Fill the matrix, and the derivative by the load factor, exact for linear functions."""
        simulation = self.simulation
        q = simulation.supports.in_plane(x)
        ε = 1e-6 * max(1.0, abs(self.t))
        for sign in (1, -1):
            self._give(self.step_at(self.t + sign * ε), self._driven)
            part = np.zeros(self.share.size)
            for term in self._driven:
                term.add_residual(q, part)
            r += sign / (2 * ε) * part
        self._give(self.step_at(self.t), self._driven)
        for term in self._driven:
            term.add_residual(q, np.zeros(self.share.size))
        simulation.supports.enter(r)
        rates = (self._moved(self.t + ε) - self._moved(self.t - ε)) / (2 * ε)
        self._rates = np.asarray(rates, dtype=np.float64)
        self._A = simulation.equation.tangent_at(x, self._rates, r)

    def correct(self, y: Array, z: Array) -> None:
        """Correct an iterate by the linearised equation of the control."""
        supports, moving = self.simulation.supports, self.simulation.supports.moving
        if len(moving):
            z = z - self._rates
        q = supports.in_plane(self._x)
        residual = self._constraint.residual(q, self.t)
        by_y = self._constraint.derivative(q, Direction(supports.in_plane(y), 0.0))
        by_z = self._constraint.derivative(q, Direction(supports.in_plane(z), -1.0))
        change = (residual - by_y) / by_z if by_z else math.nan
        y += change * z
        self.t += change
        y[moving] = self._x[moving] - self._moved(self.t)[moving]

    def met(self) -> bool:
        """Return whether the equation of the control is fulfilled."""
        q = self.simulation.supports.in_plane(self._x)
        return abs(self._constraint.residual(q, self.t)) <= CONTROL_TOLERANCE

    # -- a step --------------------------------------------------------------------------------

    def attempt(
        self, way: Direction, length: float, constraint: Constraint, *, hold: bool = True
    ) -> Trial:
        """Solve for an equilibrium under a constraint, beginning so far along a direction.

        Closed openings that do not flow are held closed if they can be, see openings.py, unless
        ``hold`` is false, as in a direction in which they open.
        """
        simulation = self.simulation
        self._constraint = constraint
        self.sought = length * way
        self.t = simulation.t + self.sought.t
        step, guess = self.step_at(self.t), simulation.q + self.sought.q
        simulation.supports.enter(guess)
        simulation.together(simulation.supports.move, guess, guess, step)
        trial = simulation.attempt_along(step, guess, self, hold=hold)
        return trial._replace(step=self.step_at(self.t))

    def begin(self) -> None:
        """Let all terms begin a step at the present state and load factor."""
        simulation = self.simulation
        simulation.together(self._give, self.step_at(simulation.t), simulation.terms)

    def stiffness_at(self, q: Array) -> Stiffness:
        """Return the tangent stiffness at a state."""
        supports = self.simulation.supports
        x = supports.in_axes(q)
        # The first tangent of a step is that of the forces before it, and may not yet be taken.
        together = self.simulation.together
        together(self.tangent, x, np.zeros(self.share.size))
        rate = np.zeros(self.share.size)
        together(self.tangent, x, rate)
        return Stiffness(self.share, self._A, supports.dofs, rate)

    def direction_of(self, stiffness: Stiffness) -> Direction:
        """Return the direction of the path in which the load factor grows."""
        q = stiffness.flow[self.share.dofs] + self._rates
        self.simulation.supports.leave(q)
        way = Direction(q, 1.0)
        size = self.length(way, self.factor)
        if not math.isfinite(size) or not self.size(way) > 0:
            raise StepFailed(
                "nothing moves with the load factor here; let a load or a motion go on to change, "
                "as with time=lambda t: t"
            )
        return way / size


class Control(ABC):
    """Base class of path controls, which set the lengths of steps."""

    @property
    @abstractmethod
    def factor(self) -> float:
        """Change of the load factor that counts as much as a unit of displacement."""

    def require(self, scene: Scene) -> None:  # noqa: B027 - most controls fit all scenes
        """Raise :class:`SceneError` if the control does not fit the scene."""

    @abstractmethod
    def begins_along(self, corrector: PathCorrector, way: Direction) -> float:
        """Positive if ``way`` is the direction in which a path begins."""

    @abstractmethod
    def continues_along(self, corrector: PathCorrector, gone: Direction, way: Direction) -> float:
        """Positive if a path that came by ``gone`` in the step goes on along ``way``."""

    @abstractmethod
    def solve_step(self, corrector: PathCorrector, part: float) -> Trial:
        """Solve for the end of a step, or of a part of it; :class:`StepFailed` if there is none."""
