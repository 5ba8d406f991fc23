# SPDX-License-Identifier: MIT
"""Steps without Python: what a scene needs for them, and how the state is handed over and back."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, Protocol

import numpy as np

from ufl_beam.arrays import Array, Index
from ufl_beam.compiled.c_library import Loop, doubles, ffi, fill, integers, lib
from ufl_beam.errors import StepFailed
from ufl_beam.mechanics.time_schemes import Scheme
from ufl_beam.simulation.step_equation import StepEquation
from ufl_beam.solvers.newton import Solver
from ufl_beam.terms.beams import Inertia
from ufl_beam.terms.loads import DeadLoads
from ufl_beam.terms.openings import SearchFlags
from ufl_beam.terms.phases import Phases, TimeFunctions
from ufl_beam.terms.rates_in_c import V

LAST_DIGITS = 1e-14
"""Difference of two numbers from the same formula, relative, that is nothing but round-off."""


class Stepping(Protocol):
    """The state that steps lead from and to; see :class:`Simulation`."""

    t: float
    q: Array
    q_before: Array
    last_dt: float
    parts: int


class CompiledSteps:
    """Steps of a scene in C; see march.c.

    From the first step until :meth:`hand_back` the state is that of C.  What there is to see of it
    is in Python after each call: time, configuration, velocities, reactions and ledger.

    Attributes:
        ahead: Whether steps have been taken since the state was handed over or back.
    """

    def __init__(
        self, equation: StepEquation, solver: Solver, inertia: Inertia, search: SearchFlags | None,
        largest_turn: float, phases: list[Phases], times: TimeFunctions,
        whole: tuple[float, float, float], turns: tuple[Index, Index],
    ) -> None:  # fmt: skip
        self._equation, self._solver, self._inertia = equation, solver, inertia
        self._phases, self._times, self.ahead = phases, times, False
        share, state = equation.share, inertia.ledger.state
        self._space, (rotations, half_tangents) = np.zeros((3, share.size)), turns
        self._bytes, self._end = 8 * share.size, np.zeros(1)
        loads = [term.steps_in_c for term in equation.terms if isinstance(term, DeadLoads)]
        multipliers = share.multipliers().astype(np.int32)
        load_weight, motion_weight, at = whole
        self.c = fill(
            ffi.new("march *"),
            equation=equation.c, snes=solver.in_petsc(), size=share.size, x=solver.unknowns,
            s=self._space[2], load_weight=load_weight, motion_weight=motion_weight, at=at,
            largest_turn=largest_turn, rotations=len(rotations), rotation=rotations,
            half_tangents=len(half_tangents), half_tangent=half_tangents,
            multipliers=len(multipliers), multiplier=multipliers,
            rates=inertia.in_c.c, loads=loads[0] if loads else ffi.NULL,
            supports=equation.supports.in_c(times),
            search=ffi.NULL if search is None else integers(search.flags),
            states=len(state), state=state.numbers,
        )  # fmt: skip
        self._alive: list[Any] = []
        for name in ("begin", "accept", "add_state"):
            self._list(getattr(self.c, name), [x for one in phases for x in getattr(one, name)])

    def _list(self, place: Any, loops: Sequence[Loop]) -> None:
        calls = ffi.new("phase_call[]", list(loops))
        self._alive += [calls, loops]
        place.number, place.call = len(loops), calls

    def take(self, state: Stepping, ends: Array) -> int:
        """Take steps to these times, up to the first that fails; return how many were taken.

        Raises:
            BaseException: What a time function of a user has raised; the steps before are taken.
        """
        c = self.c
        if not self.ahead:
            self._hand_over(state)
        taken = int(lib.take_steps(c, len(ends), doubles(ends)))
        if taken:
            state.t, state.last_dt, state.parts = c.t, c.last_dt, state.parts + taken
            state.q, self._inertia.v = self._copy(c.q), self._copy(c.rates.rate[V])
            self._solver.iterations += c.iterations
            c.iterations = 0
        if taken < len(ends):
            self.hand_back(state)
            self._raise()
        return taken

    def _copy(self, values: Any) -> Array:
        return np.frombuffer(ffi.buffer(values, self._bytes)).copy()

    def _hand_over(self, state: Stepping) -> None:
        c, (q, before, _) = self.c, self._space
        q[:], before[:] = state.q, state.q_before
        c.q, c.q_before = doubles(q), doubles(before)
        c.t, c.last_dt, c.iterations = state.t, state.last_dt, 0
        for one in self._phases:
            one.enter(state.q)
        self.ahead = True

    def hand_back(self, state: Stepping) -> None:
        """Let all of Python know the state, so that it may take a step."""
        if self.ahead:
            self.ahead = False
            state.q_before = self._copy(self.c.q_before)
            for one in self._phases:
                one.leave(state.q)

    def _raise(self) -> None:
        """Raise what a function of a user has raised; a failed step is tried once more in Python."""
        error, self._times.error = self._times.error or self._equation.error, None
        self._equation.error = None
        if error is not None and not isinstance(error, StepFailed):
            raise error


def compiled_steps(
    scheme: Scheme, equation: StepEquation, solver: Solver, inertia: Inertia,
    search: SearchFlags | None, largest_turn: float,
) -> CompiledSteps | None:  # fmt: skip
    """Make the steps of a scene in C, if all that takes part in them has loops there."""
    rotations = equation.share.rotations()
    whole, turns = _whole_steps(scheme), _half_tangents(scheme, rotations)
    if not (solver.in_c and whole and turns):
        return None
    times, phases = TimeFunctions(), list[Phases]()
    for term in equation.terms:
        of_term = term.phases(times)
        if of_term is None:
            return None
        phases.append(of_term)
    return CompiledSteps(
        equation, solver, inertia, search, largest_turn, phases, times, whole, turns
    )


def _whole_steps(scheme: Scheme) -> tuple[float, float, float] | None:
    """Parts of a step at which loads and motions are taken, and its ``at``, if always the same."""
    q = np.zeros(0)
    unit = scheme.step(0.0, 1.0, 1.0, q)
    weights = unit.load_time, unit.motion_time
    for t0, t1 in ((0.0, 1.0), (2.0, 2.25), (-1e3, 7.0)):
        step = scheme.step(t0, t1, t1, q)
        for w, t in zip(weights, (step.load_time, step.motion_time), strict=True):
            if abs((1 - w) * t0 + w * t1 - t) > LAST_DIGITS * max(abs(t0), abs(t1)):
                return None
        if (step.fraction, step.at) != (1.0, unit.at):
            return None
    return *weights, unit.at


def _half_tangents(scheme: Any, rotations: Index) -> tuple[Index, Index] | None:
    """Rotations that a step may not turn far, and those whose nodal step is 2 tan(Δψ/2)."""
    if not hasattr(scheme, "half_tangents"):
        return None
    turned: Index = scheme.half_tangents(rotations)
    q0, q1 = np.random.default_rng(0).uniform(-0.7, 0.7, (2, int(rotations.max(initial=-1)) + 1))
    s, turn = scheme.nodal_step(q0, q1, rotations)
    expected = q1 - q0
    largest = float(np.abs(expected[rotations]).max(initial=0.0))
    expected[turned] = 2 * np.tan(expected[turned] / 2)
    if not np.allclose(s, expected, rtol=LAST_DIGITS, atol=0) or turn not in (0.0, largest):
        return None
    return rotations if turn else rotations[:0], turned
