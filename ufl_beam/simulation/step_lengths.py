# SPDX-License-Identifier: MIT
"""Equal steps, which steps.c divides if they fail, and adaptive steps, divided here."""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from contextlib import suppress
from dataclasses import dataclass, replace
from itertools import pairwise
from typing import Annotated

import numpy as np

from ufl_beam.arrays import Array
from ufl_beam.discretization.cells_in_space import rotations_between
from ufl_beam.discretization.state_io import Archive, State
from ufl_beam.errors import ArgumentError, ConvergenceError, StepFailed, require_numbers
from ufl_beam.mechanics.time_scheme import nodal_step, order_of, stages_of
from ufl_beam.model.loads import MovingLoad
from ufl_beam.model.records import Positive, PositiveOrNone, Record
from ufl_beam.output.output_files import add_prefix, remove_prefix
from ufl_beam.quadrature import gauss_rule
from ufl_beam.simulation.simulation import Simulation
from ufl_beam.simulation.stepper import Trial

GROWTH = 1.5  # largest ratio of the length of a step to the length of the previous step
LASTS = 10  # mean steps over which a wrong velocity is a wrong displacement at a switch
OUTSTANDING = 4  # error of velocities, divided by the last one, from which a step has a switch
LOCATED = 1e-9  # least length of a step that is divided at a switch, as a fraction of the run
HALVES = 8  # tolerance divided by that of half steps, whose errors are of third order
REMAINING = 1.5  # error of steps by their difference to half steps: 4/3 at order 2, 2 at order 1
MOST = 2**14  # largest number of steps of one call of C, which returns earlier if steps take long

Rule = tuple[Array, Array]
"""Fractions of a step at which a function is sampled, and weights of the samples; both (n,)."""

MIDPOINT_ERROR: Rule = np.array([0.01, 0.5, 0.99]), np.array([1.0, -2.0, 1.0]) / 6
"""Error of the midpoint rule: its difference to Simpson's rule.  The ends of a step are left out,
because functions may jump there."""


def composition_error(stages: Sequence[float]) -> Rule:
    """Return the difference of Gauss's rule of order 6 to the midpoint rule of all stages."""
    (points, weights), lengths = gauss_rule(3), np.array(stages)
    middles = np.cumsum(lengths) - lengths / 2
    return np.append(points, middles), np.append(weights, -lengths)


def step_count(time: float, dt: float) -> int:
    """Return the least number of equal steps not longer than ``dt``, up to round-off."""
    return max(1, math.ceil(time / dt * (1 - 1e-9)))


class Steps:
    """Base of the steps of a run from its beginning to its end."""

    _STATE: tuple[str, ...] = ("steps", "error")

    def __init__(self, simulation: Simulation, t1: float) -> None:
        self._simulation, self._t0, self._t1 = simulation, simulation.t, t1
        self.steps, self.error = 0, 0.0

    @property
    def finished(self) -> bool:
        """True if the end of the run is reached."""
        return self._simulation.t == self._t1

    @property
    def progress(self) -> float:
        """Fraction of the duration of the run that has passed."""
        return (self._simulation.t - self._t0) / (self._t1 - self._t0)

    def state(self) -> State:
        """Return the data that determine the next step, and the number of steps; (n,) each."""
        return {name: np.array(getattr(self, name), dtype=float, ndmin=1) for name in self._STATE}

    def restore(self, state: State) -> None:
        """Restore the data of :meth:`state`."""
        for name in self._STATE:
            kind, values = type(getattr(self, name)), [*map(float, state[name])]
            setattr(self, name, values if kind is list else kind(values[0]))


class EqualSteps(Steps):
    """Steps of equal length, a little shorter than ``dt`` if the run is no multiple of ``dt``."""

    _STATE = ("steps",)

    def __init__(self, simulation: Simulation, t1: float, dt: float) -> None:
        super().__init__(simulation, t1)
        self._all, self.error = step_count(t1 - simulation.t, dt), math.nan

    def advance(self, most: int = 1, *, keep: bool = False) -> None:
        """Take up to ``most`` steps, in substeps if they fail; ``keep`` stores their states."""
        steps = np.arange(self.steps, min(self.steps + min(most, MOST), self._all)) + 1
        ends = self._t0 + (self._t1 - self._t0) * steps / self._all
        ends[steps == self._all] = self._t1  # exactly, for a run that goes on at this time
        self.steps += self._simulation.steps_to(ends, keep=keep)


@dataclass(frozen=True)
class Adaptive(Record):
    """Adaptive time steps with a limited error of each step, for the argument ``dt``.

    The error of a step is estimated from its acceleration, from the change of the acceleration
    since the last step, and from the midpoint rule for loads and prescribed motions.  At fourth
    order it is estimated from velocities at both ends of the step and between stages.  As in other
    integrators, the tolerance applies to one step; the sum over a run is
    :attr:`Solution.time_error`.  Errors of the spatial discretization are not included.

    In scenes that may slide, touch, yield or break, a second simulation runs ahead in half steps,
    and locates these switches by short steps.  There :attr:`Solution.time_error` is an estimate of
    the largest error of a position or rotation during the run, from the difference of both; the run
    takes about three times as long.

    Steps end at the times of every :class:`Table` in the scene, at the times in an attribute
    ``kinks`` of other functions of time, where a :class:`MovingLoad` comes to its beams or leaves
    them, at ``stops``, and at samples of controllers.

    Args:
        tolerance: Largest error of a step.  Errors of positions are divided by the size of the
            scene, errors of rotations are in rad, and errors of the impulse of a load are divided
            by its largest value so far times the duration of the run.
        first: First step to be tried; s.  By default a hundredth of the run.
        longest: Longest step; s.
        shortest: Shortest step; s.  If a shorter step is needed, the run ends with an error.  By
            default 1e-12 of the run; never less than 16 units of the last digit of a time.
        stops: Further times at which steps end; s.  A time is left out if it differs from
            another one by less than 1e-9 of the run, or than the shortest step.

    Raises:
        ArgumentError: A number is out of range.

    Example:
        >>> steps = ub.Adaptive(tolerance=1e-4, stops=[0.5])
        >>> run = ub.simulate(scene, ub.EnergyMomentum(), t=(0, 1), dt=steps)
        >>> 0.5 in run.times, bool(run.time_error < 0.01)
        (True, True)
    """

    _refused = ArgumentError

    tolerance: Positive
    first: PositiveOrNone = None
    longest: PositiveOrNone = None
    shortest: PositiveOrNone = None
    stops: Annotated[Sequence[float], require_numbers] = ()


class AdaptiveSteps(Steps):
    """Steps whose error is estimated and limited."""

    _STATE: tuple[str, ...] = ("steps", "error", "_dt", "_fresh", "_largest")

    def __init__(self, simulation: Simulation, t1: float, control: Adaptive) -> None:
        super().__init__(simulation, t1)
        t0 = simulation.t
        self._tolerance = control.tolerance
        self._longest = control.longest or t1 - t0
        last_digit = math.ulp(max(abs(t0), abs(t1)))
        self._shortest = max(control.shortest or 1e-12 * (t1 - t0), 16 * last_digit)
        self._dt = min(control.first or (t1 - t0) / 100, self._longest)
        functions = (function for _, function in simulation.scene.time_functions())
        self._functions = list(dict.fromkeys(functions))
        self._largest = [0.0] * len(self._functions)
        kinks = {float(t) for f in self._functions for t in getattr(f, "kinks", ())}
        for load in simulation.scene.loads:
            if isinstance(load, MovingLoad):
                with suppress(ArgumentError):  # the run names the time
                    kinks.update(load.arrivals(t0, t1))
        # Of times closer than this, only the first is used: they may differ by round-off alone.
        same = max(1e-9 * (t1 - t0), self._shortest)
        inside = sorted(t for t in (*kinks, *control.stops) if t0 + same < t < t1 - same)
        apart = [t for before, t in pairwise([t0, *inside]) if t - before > same]
        self._stops = [*apart, t1]
        self._fresh = True
        subdomain = simulation.subdomain
        self._rotations, self._translations = subdomain.rotations, subdomain.translations()
        self._axes = 3 if simulation.scene.in_space else 1  # of a rotation
        M = simulation.inertia.M
        masses = np.bincount(M.rows(), weights=np.abs(M.data), minlength=subdomain.size)
        self._massless = np.flatnonzero(masses == 0.0)
        self._order, stages = order_of(simulation.scheme), stages_of(simulation.scheme)
        self._rule = composition_error(stages) if len(stages) > 1 else MIDPOINT_ERROR

    def advance(self, most: int = 1, *, keep: bool = False) -> None:
        """Take one step whose error is below the tolerance; ``keep`` stores its end."""
        simulation = self._simulation
        while True:
            t = simulation.t  # earlier if the previous step is taken again
            stop = next(stop for stop in self._stops if stop > t)
            stop = simulation.controllers.next_sample(t, stop)
            try:
                trial, error = self._solve_and_estimate_error(stop)
                dt = trial.step.t1 - t
                change = 0.9 * (self._tolerance / max(error, 1e-300)) ** (1 / (1 + self._order))
                if error <= self._tolerance:
                    if (shorter := self._shorter(trial)) == 0.0:
                        break
                    self._dt = shorter
                    continue
                self._dt = dt * max(change, 0.1)
                simulation.take_back()
                failure = StepFailed(
                    f"the error {error:.1e} of the step is above the tolerance "
                    f"{self._tolerance:.1e}; if a load or a motion jumps, name the time in `stops`"
                )
            except StepFailed as reason:
                failure, self._dt = reason, self._dt / 4
            if self._dt < self._shortest:
                simulation.give_up(failure, t + self._dt)
        self._accept(trial)
        self.error += error
        self.steps += 1
        self._dt = min(dt * min(change, GROWTH), self._longest)
        # The acceleration may jump at a stop, so the next step does not use its change.
        self._fresh = simulation.t == stop
        if keep:
            simulation.keep()

    def _shorter(self, trial: Trial) -> float:
        """Return a shorter length if a step with a small error is refused, else 0; s."""
        return 0.0

    def _accept(self, trial: Trial) -> None:
        self._simulation.accept(trial)

    def _solve_and_estimate_error(self, stop: float) -> tuple[Trial, float]:
        """Solve the next step and estimate its error, as defined by :class:`Adaptive`."""
        simulation, inertia = self._simulation, self._simulation.inertia
        left = stop - simulation.t
        # Two equal steps to a stop, because a longer step could leave a tiny one
        dt = left if self._dt >= left else min(self._dt, left / 2)
        if self._order == 4:
            return self._compare_velocities(stop if dt == left else simulation.t + dt)
        if self._fresh:
            # Without an earlier step, accelerations in half of the step and in the whole step are
            # compared.
            whole = simulation.attempt(simulation.t + dt)
            before, between = (inertia.after(whole.s, whole.step.dt)[0] - inertia.v) / dt, -dt / 4
            dt /= 2
        else:
            before = (inertia.v - inertia.v_before) / simulation.prediction.c.dt
            between = (dt + simulation.prediction.c.dt) / 2
        trial = simulation.attempt(stop if dt == left else simulation.t + dt)
        dt = trial.step.dt
        a = (inertia.after(trial.s, dt)[0] - inertia.v) / dt
        jerk = (a - before) / between
        c2, c3 = inertia.scheme.error_weights()
        error = c2 * dt**2 * a + c3 * dt**3 * jerk
        turned = self._rotations
        if self._axes == 1:
            error[turned] += (trial.q1 - simulation.q - trial.s)[turned]
        else:
            error[turned] += _error_of_vectors(trial.s[turned], dt**2 * a[turned])
        return trial, self._largest_error(error, simulation.t, dt)

    def _compare_velocities(self, t1: float) -> tuple[Trial, float]:
        """Solve the next step, of fourth order, to ``t1`` and estimate its error.

        The motion in the step is compared with an integral of velocities, by a rule that is exact
        for polynomials of degree 3.  Its points are both ends of the step, and the ends of the
        first stage and of the stage before the last, where errors of second order cancel.
        """
        simulation = self._simulation
        inertia, t, q, v = simulation.inertia, simulation.t, simulation.q, simulation.inertia.v
        dt, first = t1 - t, stages_of(simulation.scheme)[0]
        trial = simulation.attempt(t1)
        q_early = simulation.stage_end(0)
        angles = simulation.subdomain.plane_rotations
        early = 2 / (first * dt) * nodal_step(simulation.scheme, q, q_early, angles) - v
        late, last = inertia.v, inertia.after(trial.s, trial.step.dt)[0]
        inside = 1 / 12 / (1 / 4 - (1 / 2 - first) ** 2)
        ends = 1 / 2 - inside
        error = trial.q1 - q - dt * (ends * (v + last) + inside * (early + late))
        if self._axes == 3:
            between = map(simulation.stage_end, range(len(stages_of(simulation.scheme)) - 2))
            for a, b in pairwise([q, *between, simulation.q, trial.q1]):
                error[self._rotations] += _error_of_vectors((b - a)[self._rotations])
        return trial, self._largest_error(error, t, dt)

    def _largest_error(self, error: Array, t: float, dt: float) -> float:
        """Return the largest of the errors of motions, and of loads in the step from ``t`` on."""
        load_error = self._simulation.together(self._load_error, t, dt)
        return max(self._free_size(error), self._simulation.subdomain.largest(load_error))

    def _free_size(self, motion: Array) -> float:
        """Return the size of a motion apart from supports; sets parts without inertia to zero."""
        supports = self._simulation.supports
        supports.into_axes(motion)
        motion[supports.dofs] = 0.0
        # Motions without inertia follow the other motions, and jump with a load.
        motion[self._massless] = 0.0
        supports.into_plane(motion)
        return self.size_of(motion)

    def size_of(self, motion: Array) -> float:
        """Return the largest displacement, in sizes of the scene, or rotation; rad."""
        moves = np.hypot.reduce(motion[self._translations]).max(initial=0.0)
        rotations = np.abs(motion[self._rotations].reshape(-1, self._axes).T)
        rotations = np.hypot.reduce(rotations)
        largest = float(max(moves / self._simulation.scene.size, rotations.max(initial=0.0)))
        return self._simulation.subdomain.largest(largest)

    def _load_error(self, t: float, dt: float) -> float:
        """Return the largest error of the scheme's rule for the integral of a load over the step.

        Each error is divided by the largest value of the load so far times the duration of the run.
        """
        at, weights = self._rule
        error = 0.0
        for i, function in enumerate(self._functions):
            values = np.array([float(function(t + fraction * dt)) for fraction in at])
            self._largest[i] = max(self._largest[i], float(np.abs(values).max()))
            error = max(error, abs(float(weights @ values)) / (self._largest[i] or 1.0))
        return error * dt / (self._t1 - self._t0)


def _error_of_vectors(steps: Array, accelerations: Array | None = None) -> Array:
    """Return errors of rotations by Cayley vectors m, instead of mean angular velocities; (3 n,).

    They are the difference of both vectors and, with angular accelerations a times dt², a × m / 12,
    because the axis of the rotation changes in the step.
    """
    m = steps.reshape(-1, 3)
    half = np.linalg.norm(m, axis=1, keepdims=True) / 2
    errors = (np.arctan(half) / np.where(half > 0, half, 1.0) - (half > 0)) * m
    if accelerations is not None:
        errors += np.cross(accelerations.reshape(-1, 3), m) / 12
    return np.asarray(errors.ravel())


# -- switches --------------------------------------------------------------------------------------


class Pilot(Simulation):
    """Second simulation of a scene that switches; it runs ahead of the run, in half steps."""

    def warn(self, warnings: Iterable[str], *, local: bool = False) -> None:
        """Issue no warnings, because the run issues them."""


class PilotSteps(AdaptiveSteps):
    """Adaptive steps that locate switches, such as the beginning of sliding, contact or yielding.

    A step contains a switch if the acceleration changes as it did not in the step before.  The
    change times the length of the step is an error of velocities.  The step is shortened until this
    error, times :data:`LASTS` mean steps, is below the tolerance.  A switch in the second half of a
    step is seen in the next step only.  So if the change remains however short the next step is,
    the step before it is taken again, in shorter steps.

    Attributes:
        taken: Time, configuration and, in space, rotations at the ends of steps, and whether a
            later step cannot change them.
        saved: State before the last step.
    """

    _STATE = (*AdaptiveSteps._STATE, "_before_dt", "_last_error")

    def __init__(self, pilot: Pilot, t1: float, control: Adaptive) -> None:
        super().__init__(pilot, t1, control)
        self.taken = list[tuple[float, Array, Array | None, bool]]()
        self.saved: State = {}
        # Acceleration before the last step, and the length of its step, 0 if there is none
        self._before: Array = np.zeros(pilot.subdomain.size)
        self._before_dt = self._last_error = self._error = 0.0

    def _shorter(self, trial: Trial) -> float:
        """Return a shorter length if the step or the previous one contains a switch, else 0; s.

        In the second case the state returns to the beginning of the previous step.
        """
        simulation, inertia, dt = self._simulation, self._simulation.inertia, trial.step.dt
        self._error = 0.0
        if self._fresh or not self.steps:  # at stops the acceleration may jump
            return 0.0
        last = float(simulation.prediction.c.dt)
        a = (inertia.v - inertia.v_before) / last
        change = (inertia.after(trial.s, dt)[0] - inertia.v) / dt - a
        new = self._free_size(change)
        if self._before_dt:
            slope = (a - self._before) / (last + self._before_dt)
            new = min(new, self._free_size(change - slope * (last + dt)))
        new *= LASTS / 12 * (simulation.t - self._t0) / self.steps
        self._error = new * max(dt, last)
        limit = max(self._tolerance, OUTSTANDING * self._last_error)
        least = 4 * LOCATED * (self._t1 - self._t0)
        if new * dt > limit and dt > least:
            return dt / 4
        if new * last > limit and last > least and (self.saved or dt > last / 3):
            if dt <= last / 3:
                self.take_again()
                self._first_dt = last / 4
            return last / 4
        return 0.0

    def advance(self, most: int = 1, *, keep: bool = False) -> None:
        """Take one step, or take the previous step again and this one; see the base class."""
        self._first_dt = self._dt
        super().advance(most, keep=keep)
        simulation = self._simulation
        turns = simulation.now.turns(0) if self._axes == 3 else None
        self.taken.append((simulation.t, simulation.q, turns, self._fresh))

    def _accept(self, trial: Trial) -> None:
        """Save the state, and accept the step."""
        archive, inertia = Archive(self._simulation.subdomain), self._simulation.inertia
        dt, self._dt = self._dt, self._first_dt  # so that a step is taken again to the last bit
        self._save_or_restore(archive)
        self.saved, self._dt = archive.state(), dt
        last = float(self._simulation.prediction.c.dt)
        self._before[:] = (inertia.v - inertia.v_before) / last
        self._before_dt = 0.0 if self._fresh else last
        self._last_error = self._error
        super()._accept(trial)

    def take_again(self) -> None:
        """Return to the state before the last step."""
        self._save_or_restore(Archive(self._simulation.subdomain, self.saved))
        self._simulation.time_loop.next_jump = -math.inf  # of rates, to be found again
        self.saved = {}
        del self.taken[-1:]

    def _save_or_restore(self, archive: Archive) -> None:
        self._simulation.save_or_restore(archive)
        self._before = archive.at_dofs("acceleration before", self._before)
        now = {name: (np.arange(len(x)), x[:, None]) for name, x in self.state().items()}
        self.restore({name: archive.rows(name, *now[name], known=True)[:, 0] for name in now})


class JudgedSteps(Steps):
    """Adaptive steps of a scene that switches; each consists of two steps of a pilot.

    Their error is estimated from the difference of both runs.

    Attributes:
        error: Largest estimated error of positions and rotations so far.
    """

    def __init__(self, simulation: Simulation, pilot: Pilot, t1: float, control: Adaptive) -> None:
        super().__init__(simulation, t1)
        self._ahead = PilotSteps(pilot, t1, replace(control, tolerance=control.tolerance / HALVES))

    def advance(self, most: int = 1, *, keep: bool = False) -> None:
        """Take one step, or the last half of one; ``keep`` stores its end."""
        ahead, simulation = self._ahead, self._simulation
        while True:
            new = ahead.taken = [step for step in ahead.taken if step[0] > simulation.t]
            if len(new) > 2 or any(final for *_, final in new[:2]):
                break
            try:
                ahead.advance()
            except ConvergenceError:
                if not new:
                    raise
                break
        t, q, turns, _ = new[len(new) > 1 and not new[0][-1]]
        while simulation.t < t:
            simulation.steps_to(np.array([t]), keep=keep)
        self.steps += 1
        apart = simulation.q - q
        if turns is not None:
            dofs = np.vstack([simulation.numbering.dofs, simulation.numbering.dofs_of_bodies])
            apart = simulation.subdomain.gather(apart)
            apart[dofs[:, 3:]] = rotations_between(turns, simulation.now.turns(0))
            apart = apart[simulation.subdomain.dofs]
        self.error = max(self.error, REMAINING * ahead.size_of(apart))

    def state(self) -> State:
        """Return steps, error, and the state of the pilot before its last step."""
        return super().state() | add_prefix("pilot/", self._ahead.saved)

    def restore(self, state: State) -> None:
        """Restore :meth:`state`; the last step of the pilot is taken again."""
        super().restore(state)
        self._ahead.saved = remove_prefix("pilot/", state)
        self._ahead.take_again()
        self._ahead.advance()
