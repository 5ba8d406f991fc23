# SPDX-License-Identifier: MIT
"""Steps without Python: what a scene needs for them, and how the state is handed over and back."""

from __future__ import annotations

from collections.abc import Sequence
from functools import cache, partial
from typing import Any, NamedTuple, Protocol

import numpy as np

from ufl_beam.arrays import Array, Index, Later, Snapshots
from ufl_beam.compiled.c_library import Loop, doubles, ffi, fill, give_back_memory, lib
from ufl_beam.errors import StepFailed
from ufl_beam.mechanics.tangents import Tangents
from ufl_beam.mechanics.time_schemes import Scheme
from ufl_beam.output.watches import Watch
from ufl_beam.simulation.branch_check import StaticPath
from ufl_beam.simulation.kept_rows import KeptRows
from ufl_beam.simulation.prediction import Prediction
from ufl_beam.simulation.step_equation import StepEquation
from ufl_beam.solvers.equation import note_exception
from ufl_beam.solvers.newton import Solver
from ufl_beam.terms.beams import Inertia
from ufl_beam.terms.cell_forces import CellForces
from ufl_beam.terms.dead_loads import DeadLoads
from ufl_beam.terms.energy_ledger import Ledger
from ufl_beam.terms.follower_loads import FollowerLoads
from ufl_beam.terms.inelastic_beams import InelasticBeams
from ufl_beam.terms.links import Links
from ufl_beam.terms.openings import Openings
from ufl_beam.terms.phases import Phases, TimeFunctions
from ufl_beam.terms.rates_in_c import V

ROOM = 2**20
"""Numbers that C keeps of steps before Python takes them."""

LONGEST = 0.05
"""Time after which C returns, so that a run can be interrupted and shows its progress; s."""

MOST_LEFT = 32
"""Largest number of steps that are left to Python after steps that C cannot take.

Where Newton's method needs a line search, in step after step, C would try each of them in vain.
"""

LAST_DIGITS = 1e-14
"""Difference of two numbers from the same formula, relative, that is nothing but round-off."""


class Keeping(Protocol):
    """Solution that states are appended to."""

    def keep(self, states: Snapshots, parts: int, iterations: int) -> None:
        """Append states of a run, up to the last of which so many were done."""


class Stepping(Protocol):
    """The state that steps lead from and to; see :class:`Simulation`."""

    t: float
    q: Array
    prediction: Prediction
    parts: int
    left: list[int]  # steps that Python still takes, and how many it was to when C failed last

    @property
    def solution(self) -> Keeping:
        """States that were kept."""


class CompiledSteps:
    """Steps of a scene in C; see march.c.

    From the first step until :meth:`hand_back` the state is that of C.  What there is to see of it
    is in Python after each call: time, configuration, velocities, reactions and ledger.

    Attributes:
        ahead: Whether steps have been taken since the state was handed over or back.
    """

    def __init__(
        self, equation: StepEquation, solver: Solver, ledger: Ledger, inertia: Inertia | None,
        path: StaticPath | None, openings: Openings | None, largest_turn: float,
        phases: list[Phases], times: TimeFunctions, whole: tuple[float, float, float],
        turns: tuple[bool, bool], applies_loads: bool, support_dofs: Index, cell_forces: CellForces,
        begun: bool,
    ) -> None:  # fmt: skip
        self._equation, self._solver, self._inertia, self._path = equation, solver, inertia, path
        self._phases, self._times, self.ahead = phases, times, False
        self._applies_loads, self._begun = applies_loads, begun
        share = equation.share
        self._space, rotations = np.zeros((2, share.size)), share.rotations()
        limited, half_tangents = (rotations[: len(rotations) * has] for has in turns)
        self._bytes, self._end = 8 * share.size, np.zeros(1)
        kinds = DeadLoads, FollowerLoads
        loads = {type(x): x.steps_in_c for x in equation.terms if isinstance(x, kinds)}
        dead, following = (loads.get(kind, ffi.NULL) for kind in kinds)
        multipliers = share.multipliers().astype(np.int32)
        load_weight, motion_weight, at = whole
        self.c = fill(
            ffi.new("march *"),
            equation=equation.c, snes=solver.in_petsc(), size=share.size, x=solver.unknowns,
            s=equation.c.change, load_weight=load_weight, motion_weight=motion_weight, at=at,
            largest_turn=largest_turn, rotations=len(limited), rotation=limited,
            half_tangents=len(half_tangents), half_tangent=half_tangents,
            multipliers=len(multipliers), multiplier=multipliers,
            loads=dead, follower_loads=following,
            supports=equation.supports.in_c(times),
            states=len(ledger.state), state=ledger.state.numbers, cell_forces=cell_forces.c,
        )  # fmt: skip
        over = [
            doubles(one.over) + i
            for one in phases if one.over is not None for i in range(len(one.over))
        ]  # fmt: skip
        if openings is not None:
            self._handle = ffi.new_handle(OpeningsOfStep(equation, openings))
            fill(
                self.c, search=openings.flags, places=len(over), over=ffi.new("double *[]", over),
                open=lib.open_in_python, close=lib.close_in_python, openings=self._handle,
            )  # fmt: skip
        if inertia is not None and inertia.in_c is not None:
            fill(self.c, rates=inertia.in_c.c)
        admits = [one.admits for one in phases if one.admits is not None]
        if admits:
            fill(self.c, admissions=len(admits), admission=ffi.new("admission_call[]", admits))
        if path is not None:
            changes = [one.change for one in phases if one.change is not None]
            fill(self.c, path=path.in_c(changes))
        self._alive: list[Any] = []
        self._watches: Sequence[Watch] = ()
        for name in ("begin", "accept", "add_state"):
            self._list(getattr(self.c, name), [x for one in phases for x in getattr(one, name)])
        inelastic = [one for one in equation.terms if isinstance(one, InelasticBeams)]
        links = [one for one in equation.terms if isinstance(one, Links)]
        scene = share.grid.scene
        more = len(scene.links), cell_forces.kept
        self._of_rows = ledger, equation.supports, support_dofs, inelastic, links, *more
        self._rows: KeptRows | None = None
        self._last: tuple[int, Array] = -1, self._end  # step whose end was kept last; state there

    def _kept(self, q: Array) -> KeptRows:
        """Rows of numbers, one for each step that C keeps."""
        if self._rows is None:
            self._rows = rows = KeptRows(self.c, *self._of_rows, q)
            fill(self.c, kinds=len(rows.kinds), width=rows.width, kept=rows.kinds)
        return self._rows

    def _list(self, place: Any, loops: Sequence[Loop]) -> None:
        calls = ffi.new("phase_call[]", list(loops))
        self._alive += [calls, loops]
        place.number, place.call = len(loops), calls

    def take(self, state: Stepping, ends: Array, *, keep: bool = False) -> int:
        """Take steps to these times, up to the first that fails, for :data:`LONGEST` at most.

        Returns:
            How many were taken; Python takes the next one if there were none.  With ``keep`` the
            state after each of them is in the solution.

        Raises:
            BaseException: What a time function of a user has raised; the steps before are taken.
        """
        if not (self._solver.in_c and (self.ahead or self._begins(state))):
            return 0
        still, last = state.left
        if still:
            state.left = [still - 1, last]
            return 0
        c, steps = self.c, len(ends)
        rows: Array = np.zeros((1, 0))
        if keep:
            kept = self._rows or self._kept(state.q)
            steps = min(steps, 1 + ROOM // kept.width)
            rows = np.zeros((steps + 1, kept.width))  # the first one is of the state before
            rows[0, kept.q] = state.q
        if not self.ahead:
            self._hand_over(state)
        taken = int(lib.take_steps(c, steps, doubles(ends), LONGEST, keep, doubles(rows[1:])))
        if taken:
            state.t = c.t
            state.parts += taken
            for one in self._watches:
                one.seen = state.parts
            self._lend(state)
            self._solver.iterations += c.iterations
            c.iterations = 0
            if keep:
                if taken < steps:
                    rows = rows[: taken + 1].copy()  # so that the rest does not stay
                before = rows[:-1, kept.q] if self._begun else None
                states = kept.states(ends[:taken].copy(), rows[1:], before)
                state.solution.keep(states, state.parts, self._solver.iterations)
        state.left = [0, 0]
        if c.failed:
            number = 1 if taken else min(2 * last, MOST_LEFT) or 1
            state.left = [number - (taken == 0), number]
        if taken < steps:
            self.hand_back(state)
            self._raise()
        return taken

    def watch(self, watches: Sequence[Watch]) -> None:
        """Let these take in the state after each step."""
        self._watches = watches
        of_c = ffi.new("watch *[]", [one.c for one in watches])
        fill(self.c, watches=len(watches), watch=of_c)

    def q_before(self) -> Array:
        """The configuration at the beginning of the last step, a new array."""
        return self._copy(self.c.prediction.q_before)

    def now(self, state: Stepping) -> Later:
        """The state that C has."""
        kept = self._rows or self._kept(state.q)
        # NumPy asks for large pages from 4 MiB on, and the first touch of these takes longer here.
        row, before = np.frombuffer(bytearray(8 * kept.width))[None], None
        lib.keep_state(self.c, doubles(row))
        if self._begun:
            number, before = self._last
            if number != state.parts - 1:
                before = self.q_before()[None]
            self._last = state.parts, row[:, kept.q]
        t = np.array([self.c.t])
        return Later(t, partial(kept.states, t, row, before))

    def _begins(self, state: Stepping) -> bool:
        """Return whether the next step is like those that follow."""
        if self._inertia is not None:
            return len(self._inertia.more) == len(self._inertia.scheme.kept)
        return not (self._applies_loads and state.parts == 0)

    def _on_demand(self, values: Any) -> Any:
        return partial(self._copy, values)

    def _copy(self, values: Any) -> Array:
        return np.frombuffer(ffi.buffer(values, self._bytes)).copy()

    def _hand_over(self, state: Stepping) -> None:
        c, (q, before) = self.c, self._space
        q[:], before[:] = state.q, state.prediction.q_before
        state.prediction.began_at(before)  # no second array of what C has
        fill(c, q=q, prediction=state.prediction.c, t=state.t, iterations=0)
        if self._path is not None:
            ffi.memmove(c.path.force, doubles(self._path.force), self._bytes)
        for one in self._phases:
            one.enter(state.q)
        self._lend(state)
        give_back_memory(len(q))
        self.ahead = True

    def _lend(self, state: Stepping) -> None:
        """Let Python copy the state when it asks for it; C leaves it alone until the next one."""
        state.q = self._on_demand(self.c.q)
        if self._inertia is not None:
            self._inertia.v = self._on_demand(self.c.rates.rate[V])

    def hand_back(self, state: Stepping) -> None:
        """Let all of Python know the state, so that it may take a step."""
        if self.ahead:
            self.ahead, self._last = False, (-1, self._end)
            state.prediction.began_at(self._copy(state.prediction.c.q_before))
            if self._path is not None:
                self._path.force = self._copy(self.c.path.force)
            for one in self._phases:
                one.leave(state.q)

    def _raise(self) -> None:
        """Raise what a function of a user has raised; Python tries a failed step once more."""
        error, self._times.error = self._times.error or self._equation.error, None
        self._equation.error = None
        if error is not None and not isinstance(error, StepFailed):
            raise error


def compiled_steps(
    scheme: Scheme, equation: StepEquation, solver: Solver, ledger: Ledger,
    inertia: Inertia | None, path: StaticPath | None, openings: Openings | None,
    largest_turn: float, applies_loads: bool, support_dofs: Index, cell_forces: CellForces,
    begun: bool,
) -> CompiledSteps | None:  # fmt: skip
    """Make the steps of a scene in C, if all that takes part in them has loops there."""
    known: Any = scheme
    whole, turns = _whole_steps(known), _nodal_step(known)
    if not (solver.in_c and whole and turns):
        return None
    times, phases = TimeFunctions(), list[Phases]()
    for term in equation.terms:
        of_term = term.phases(times)
        if of_term is None:
            return None
        phases.append(of_term)
    return CompiledSteps(
        equation, solver, ledger, inertia, path, openings, largest_turn, phases, times, whole,
        turns, applies_loads, support_dofs, cell_forces, begun,
    )  # fmt: skip


class OpeningsOfStep(NamedTuple):
    """Search for what opens, and the equation of the step, as callbacks of C have them."""

    equation: StepEquation
    openings: Openings


@ffi.def_extern(error=0, onerror=note_exception)  # type: ignore[misc, untyped-decorator, unused-ignore]
def open_in_python(handle: Any, times: int) -> int:
    """Callback of C, declared in c_library.py."""
    equation, openings = ffi.from_handle(handle)
    opens = openings.open(times)
    equation.restart(Tangents.PREDICTED)
    return int(opens)


@ffi.def_extern(onerror=note_exception)  # type: ignore[misc, untyped-decorator, unused-ignore]
def close_in_python(handle: Any) -> None:
    """Callback of C, declared in c_library.py."""
    ffi.from_handle(handle).openings.close()


@cache
def _whole_steps(scheme: Any) -> tuple[float, float, float] | None:
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


@cache
def _nodal_step(scheme: Any) -> tuple[bool, bool] | None:
    """Flags: turns of a step are limited, and are 2 tan(Δψ/2) in it; None if that is not known."""
    if not hasattr(scheme, "half_tangents"):
        return None
    q0, q1, rotations = np.zeros(3), np.array([0.3, -0.7, 0.5]), np.array([1, 2], dtype=np.int32)
    tangents = len(scheme.half_tangents(rotations)) > 0
    s, turn = scheme.nodal_step(q0, q1, rotations)
    turned = 2 * np.tan(q1[1:] / 2) if tangents else q1[1:]
    if not np.allclose(s, [0.3, *turned], rtol=LAST_DIGITS, atol=0.0) or turn not in (0.0, 0.7):
        return None
    return turn > 0, tangents
