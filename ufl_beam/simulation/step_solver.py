# SPDX-License-Identifier: MIT
"""Solution of one step, whether it can be trusted, and the cutting of steps that fail.

In statics, where forces act over the step, a step that turns a node far does not end in
equilibrium.  So loads that act at once are applied in parts that turn nodes little, and the rest of
the first step has nothing left to do but to follow them.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from functools import partial
from typing import NamedTuple, NoReturn, Protocol

import numpy as np

from ufl_beam.arrays import Array
from ufl_beam.collective_errors import Agreement
from ufl_beam.compiled.csr import as_slice
from ufl_beam.errors import StepFailed
from ufl_beam.mechanics.time_schemes import Scheme, Step, has_inertia
from ufl_beam.model.loads import RotatingFrame
from ufl_beam.model.scene import Scene
from ufl_beam.simulation.branch_check import StaticPath
from ufl_beam.simulation.prediction import Prediction
from ufl_beam.simulation.step_equation import StepEquation
from ufl_beam.solvers.equation import Border
from ufl_beam.solvers.newton import Solver
from ufl_beam.solvers.newton_options import Newton
from ufl_beam.terms.beams import Inertia
from ufl_beam.terms.links import Links
from ufl_beam.terms.openings import Openings
from ufl_beam.terms.supports import Supports

LARGEST_TURN = 0.75 * math.pi
"""A step that turns a node further is cut; the algorithmic strains end at π."""

LEAST_AT_REST, LEAST_IN_MOTION = 2, 1
"""Least iterations in statics and in dynamics, unless a residual is far below its tolerance.

A column that nearly buckles magnifies a load that is hardly larger than the tolerance.  In motion
its inertia holds it meanwhile.
"""

MOST_PARTS = 2**12
"""Largest number of parts that a step is cut into."""

FIRST = 1 / 16
"""Part of the first step after which accelerations are taken for those at the beginning.

Shorter ones are nearer to it, but magnify the velocities of supports that do not begin with theirs.
"""

APPLYING = 1 / 8
"""Part of the first step in which loads that are there from the start are applied."""

APPLYING_TURN = 0.02
"""Largest turn of a node meanwhile in a part; rad.

Over a part a moment is in error by a quarter of the square: some 1e-4 of it.
"""

SHORT_PART = 512
"""Parts shorter by this factor may turn nodes further: shorter ones would turn them as far."""


class Trial(NamedTuple):
    """A step that was solved but not yet accepted, and the configuration ``q1`` at its end.

    Forces work on ``s``, see :meth:`Scheme.nodal_step`; in dynamics the mean velocity times ``dt``.
    """

    step: Step
    q1: Array
    s: Array


class Present(Protocol):
    """State of a scene that a step begins with."""

    t: float
    q: Array
    prediction: Prediction
    inertia: Inertia
    supports: Supports
    couplings: list[Links]

    def ask(self) -> None:
        """Ask controllers and friction for their forces and limits in the next step."""


class StepSolver:
    """Solves steps of a scene; whoever accepts them keeps its state."""

    def __init__(
        self,
        scheme: Scheme,
        equation: StepEquation,
        openings: Openings | None,
        branch: StaticPath | None,
        newton: Newton,
        together: Agreement,
    ) -> None:
        self._scheme, self._equation, self._openings = scheme, equation, openings
        self._branch, self._together, share = branch, together, equation.share
        least = LEAST_IN_MOTION if has_inertia(scheme) else LEAST_AT_REST
        self.newton = Solver(share, equation, newton, least, together)
        self._rotations, self._multipliers = share.rotations(), as_slice(share.multipliers())
        self._judged = [one for one in equation.inner if one.must_dissipate]
        self._judges = share.largest(float(len(self._judged))) > 0.0  # on some process
        self._coupled, self._dynamic = len(share.grid.multipliers) > 0, has_inertia(scheme)

    def attempt(self, now: Present, t1: float, end: float) -> Trial:
        """Solve the step to ``t1``, which is a part of one to ``end``; see Simulation.attempt."""
        if self._dynamic and not now.inertia.ready:
            t = now.t + FIRST * (t1 - now.t)
            first = self._attempt(now, self._scheme.step(now.t, t, t1, now.q))
            now.inertia.prepare(first.s)
            now.supports.take()
            for coupling in now.couplings:
                coupling.take(first.q1)
        return self._attempt(now, self._scheme.step(now.t, t1, end, now.q))

    def attempt_loads(self, now: Present, t1: float, begin: float, end: float) -> Trial:
        """Solve a part of the application of the loads of the time ``begin``, up to ``end``."""
        step = self._scheme.step(now.t, t1, end, now.q)
        trial = self._attempt(now, step._replace(load_time=begin, motion_time=begin))
        change, share = trial.q1 - now.q, self._equation.share
        turn = share.largest(np.abs(change)[self._rotations].max(initial=0.0))
        if turn > APPLYING_TURN and SHORT_PART * trial.step.dt > end - begin:
            raise StepFailed("a node turns too far while the loads at the beginning are applied")
        return trial

    def attempt_along(
        self, now: Present, step: Step, guess: Array, border: Border, *, hold: bool
    ) -> Trial:
        """Solve a step, whose times are those of the guess, together with the load factor.

        With ``hold`` what does not flow stays closed if it can, see openings.py.
        """
        self._together(self._begin, now, step)
        t = border.t
        solve = partial(self.newton.solve_along, loads=self._equation.load_forces(), border=border)

        def again() -> None:
            self._equation.begin(step)
            border.t = t

        if self._openings is None or not hold:
            return self._trial(step, solve(guess))
        return self._trial(step, self._openings.solve(guess, solve, again))

    def _begin(self, now: Present, step: Step) -> None:
        now.ask()
        self._equation.begin(step)

    def _predict(self, now: Present, step: Step) -> Array:
        """Begin a step; return a guess of its end, in the axes of the supports."""
        self._begin(now, step)
        guess = now.prediction.guess(now.q, step.dt)
        now.supports.enter(guess)
        now.supports.move(guess, now.supports.in_axes(now.q), step)
        return guess

    def _attempt(self, now: Present, step: Step) -> Trial:
        """Solve a step from a guess; the tangent of the last step does if that was like it."""
        past = now.prediction
        step = step._replace(q_before=past.q_before, ratio=step.dt / past.last_dt)
        guess, like_last = self._together(self._predict, now, step), past.like_last(step.dt)
        loads = self._equation.load_forces()
        solve = partial(self.newton.solve, loads=loads, like_last=like_last)
        if self._openings is None:
            q1 = solve(guess)
        else:
            q1 = self._openings.solve(guess, solve, partial(self._equation.begin, step))
        return self._trial(step, q1)

    def _require_dissipation(self, q1: Array) -> None:
        """Raise :class:`StepFailed` if a law of this process gives energy."""
        for one in self._judged:
            one.require_dissipation(q1)

    def _trial(self, step: Step, q1: Array) -> Trial:
        """Return the result ``q1`` of a step, in the axes of the supports, if it can be trusted."""
        self._equation.supports.leave(q1)
        s, turn = self._scheme.nodal_step(step.q0, q1, self._rotations)
        if self._coupled:
            s[self._multipliers] = 0.0
        turn = self._equation.share.largest(turn)
        if not turn <= LARGEST_TURN:
            raise StepFailed(
                f"a node turns by {turn:.3g} rad in the step, and |Δψ| must stay below π; reduce dt"
            )
        if self._judges:
            self._together(self._require_dissipation, q1)
        if self._branch is not None:
            self._branch.require(q1, s, self._equation.force, self.newton.convergence.least_work(s))
        return Trial(step, q1, s)


def go_in_parts(
    t0: float,
    t1: float,
    attempt: Callable[[float], Trial],
    accept: Callable[[Trial], None],
    give_up: Callable[[StepFailed, float], NoReturn],
) -> None:
    """Go from ``t0`` to ``t1`` at once or, where :class:`StepFailed` is raised, in parts.

    ``give_up`` ends the run, because even the smallest part, to a time, has failed.
    """
    done, part = 0, MOST_PARTS
    while done < MOST_PARTS:
        last = done + part == MOST_PARTS
        end = t1 if last else t0 + (t1 - t0) * (done + part) / MOST_PARTS
        try:
            accept(attempt(end))
        except StepFailed as failure:
            if part == 1:
                give_up(failure, end)
            part //= 2
            continue
        done += part
        # A part grows again where the larger one would begin anyway.
        if done % (2 * part) == 0 and part < MOST_PARTS:
            part *= 2


def begins_loaded(scene: Scene, scheme: Scheme, t: float) -> bool:
    """Return whether loads that act at ``t`` are to be applied before the first step."""
    over_step = scheme.average(0.0, 1.0) != 1.0
    if has_inertia(scheme) or not over_step:
        return False
    frames = any(isinstance(load, RotatingFrame) for load in scene.loads)
    return frames or bool(scene.works) or any(f(t) != 0 for _, f in scene.time_functions())
