# SPDX-License-Identifier: MIT
"""Steps of a scene in time, with the search for hinges that open."""

from __future__ import annotations

import math

import numpy as np

from ufl_beam.arrays import Array, State
from ufl_beam.errors import StepFailed
from ufl_beam.mechanics.time_scheme import Step, has_inertia
from ufl_beam.model.functions import still, value_at
from ufl_beam.reference.connectors import Hinge
from ufl_beam.reference.points import Points
from ufl_beam.reference.step_problem import StepProblem

EXCESS_DECAY, EXCESS_TOLERANCE = 0.7, 1e-9
"""Fraction of the largest excess above which points open; its power n in the n-th round.  Largest
difference of excesses that count as equal."""

MOST_ROUNDS, MOST_RETURNS = 40, 3
"""Largest number of rounds, and of those in which hinges turn back."""


class Solver(StepProblem):
    """State of a scene, and its steps.

    Attributes:
        last_dt: Length of the last step, from which the guess of the next one is extrapolated; s.
    """

    last_dt = math.inf

    def start(self, t: float, q: Array, v: Array, internal: State, *, fresh: bool) -> None:
        """Begin with a configuration, velocities, and the internal variables of a run.

        The loads of a ``fresh`` run begin at zero, others at their values at the time ``t``.
        """
        frame, fields = self.frame, self.fields
        self.q, self.q1, self.y = q, q, frame.E.T @ q
        self.y_before, rates = self.y, frame.E.T @ v
        rates[frame.held[[f == still for f in frame.motions]]] = 0.0  # at fixed supports
        self.v = frame.E @ rates
        fields.q0.x.array[:] = fields.q1.x.array[:] = q[frame.dofs]
        strains = fields.strains()
        for points in self.points:
            points.start(strains, internal)
        for group in self.connectors:
            group.start(q, internal)
        self.reached = self._factors(t) * (not fresh)

    def _factors(self, t: float) -> Array:
        """Return the factors of the loads at a time."""
        return np.array([value_at(load.amplitude, t, load) for load in self.scene.loads])

    def solve_step(self, step: Step) -> Array:
        """Return the configuration at the end of a step; (size,).

        If possible, no point opens that does not flow.

        Raises:
            StepFailed: No equilibrium is found.
        """
        frame = self.frame
        if has_inertia(self.scheme):
            self.coefficients = self.scheme.coefficients(step.dt, self.last_dt, 0)
        y = self.y + step.dt / self.last_dt * (self.y - self.y_before)
        ends = np.array([value_at(f, step.motion_time, "support") for f in frame.motions])
        y[frame.held] = self.y[frame.held] + step.fraction * (ends - self.y[frame.held])
        self.growths = step.fraction * (self._factors(step.load_time) - self.reached)
        self.load = (self.reached + step.at * self.growths) @ self.of_loads
        for group in self.connectors:
            group.begin(step)
        for hold in (True, False):
            for part in self.parts:
                part.begin(step.dt, hold=hold)
            try:
                self._find_equilibrium(y[frame.mine])
                break
            except StepFailed:
                if not hold or not any(isinstance(part, Points) for part in self.opening):
                    raise  # a second search of hinges of zero length would repeat the first
        return np.asarray(self.q1)

    def _find_equilibrium(self, guess: Array) -> None:
        """Find an equilibrium in which nothing opens without need: largest excesses open first."""
        hinges, returns = [part for part in self.opening if isinstance(part, Hinge)], 0
        for k in range(MOST_ROUNDS):
            self.solve(guess)
            back = sum(hinge.turns_back() for hinge in hinges)
            excess = max((float(np.max(p.excess, initial=0.0)) for p in self.opening), default=0.0)
            (excess,) = map(float, self.largest(excess))
            if not back and excess == 0.0:
                return
            if (returns := returns + bool(back)) > MOST_RETURNS:
                break
            for part in self.opening:
                part.release(EXCESS_DECAY**k * excess - EXCESS_TOLERANCE)
            guess = self.x.array.copy()
        raise StepFailed("hinges open and close again and again, or one after the other")

    def accept(self) -> None:
        """Accept the end of a step."""
        if self.dynamic:
            of_step, of_v, *_ = self.coefficients.rates[0]
            self.v = of_step * self.s + of_v * self.v  # equation (87)
        for part in self.parts:
            part.accept()
        for group in self.connectors:
            group.accept(self.q1)
        self.reached = self.reached + self.growths
        self.y_before, self.y, self.q = self.y, self.y1, self.q1
        self.fields.q0.x.array[:] = self.fields.q1.x.array
