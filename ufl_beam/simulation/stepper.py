# SPDX-License-Identifier: MIT
"""Steps of a scene, which march.c takes: solved, judged, accepted, and cut where they fail.

In statics, where forces act over the step, a step that turns a node far does not end in
equilibrium.  So loads that act at once are applied in parts that turn nodes little, and the rest of
the first step has nothing left to do but to follow them.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from typing import Any, NamedTuple

from petsc4py import PETSc

import numpy as np

from ufl_beam.arrays import Array
from ufl_beam.compiled.c_library import Loop, doubles, ffi, fill, give_back_memory, lib, struct
from ufl_beam.discretization.partition import Share
from ufl_beam.discretization.state_io import Memory
from ufl_beam.errors import StepFailed
from ufl_beam.mechanics.time_schemes import Scheme, Step, has_inertia, with_half_tangents
from ufl_beam.model.loads import RotatingFrame
from ufl_beam.model.scene import Scene
from ufl_beam.parallel import Agreement
from ufl_beam.simulation.step_equation import StaticPath, StepEquation
from ufl_beam.solvers.newton import Solver
from ufl_beam.solvers.newton_options import Newton
from ufl_beam.terms.cell_forces import CellForces
from ufl_beam.terms.connectors import Links
from ufl_beam.terms.energy_ledger import Ledger
from ufl_beam.terms.inertia_and_damping import Inertia

# -- prediction ------------------------------------------------------------------------------------


class Prediction:
    """Goes on as the last steps did: at their velocity and, ``in_motion``, with their acceleration.

    After steps of equal length, a part of the last second difference of the configuration is added:
    that which the one before was like.  It is 1 in smooth motion, and 0 where second differences
    change their sign from step to step, or where steps do not resolve the motion.

    Args:
        weights: Of residuals, see :class:`StepEquation`.

    Attributes:
        c: ``prediction`` of loops.h; C writes to it when a step is accepted.
    """

    def __init__(self, share: Share, q: Array, weights: Array, *, in_motion: bool) -> None:
        self._share, self._in_motion = share, in_motion
        self.c = struct("prediction", size=share.size, dt=math.inf)
        self._q_before = q.copy()
        fill(self.c, q_before=self._q_before)
        if in_motion:
            self._second = np.zeros(share.size)
            size = {"scene": share.grid.scene.size, "unknowns": share.grid.size}
            fill(self.c, second=self._second, weight=weights, **size)

    @property
    def q_before(self) -> Array:
        """Configuration at the beginning of the last step; a copy."""
        return np.frombuffer(ffi.buffer(self.c.q_before, 8 * self._share.size)).copy()

    @property
    def last_dt(self) -> float:
        """Length of the last step, infinite before the first; s."""
        return float(self.c.dt)

    def remember(self, memory: Memory) -> None:
        """State it in numbers of the grid; see state_io.py."""
        self.c.dt = memory.number("last dt", self.c.dt)
        q_before = memory.at_dofs("q before", self.q_before)
        ffi.memmove(self.c.q_before, doubles(q_before), q_before.nbytes)
        if self._in_motion:
            self.c.equal = int(memory.number("equal steps", self.c.equal))
            self.c.repeated = memory.number("part that repeats itself", self.c.repeated)
            self.c.now = memory.number("square of the second difference", self.c.now)
            self._second[:] = memory.at_dofs("second difference", self._second)


# -- check of static steps -------------------------------------------------------------------------

LARGEST_TURN = 0.75 * math.pi
"""A step that turns a node further is cut; the algorithmic strains end at π."""

LEAST_AT_REST, LEAST_IN_MOTION = 2, 1
"""Least iterations in statics and in dynamics, unless a residual is far below its tolerance.

A column that nearly buckles magnifies a load that is hardly larger than the tolerance.  In motion
its inertia holds it meanwhile.
"""

APPLYING = 1 / 8
"""Part of the first step in which loads that are there from the start are applied."""

APPLYING_TURN = 0.02
"""Largest turn of a node meanwhile in a part; rad.

Over a part a moment is in error by a quarter of the square: some 1e-4 of it.
"""

SHORT_PART = 512
"""Parts shorter by this factor may turn nodes further: shorter ones would turn them as far."""

MOST_PARTS: int = lib.MOST_PARTS
"""Largest number of parts that a step is cut into."""

LONGEST = 0.05
"""Time after which C returns, so that a run can be interrupted and shows its progress; s."""


class Trial(NamedTuple):
    """A step that was solved but not yet accepted, and the configuration ``q1`` at its end.

    Forces work on ``s``, see :meth:`Scheme.nodal_step`; in dynamics the mean velocity times ``dt``.
    """

    step: Step
    q1: Array
    s: Array


class Extras(NamedTuple):
    """Functions of Python that take part in the steps of some scenes, or None."""

    ask: Callable[[], None] | None  # controllers and friction, when a step begins
    stop: Callable[[float, float], float] | None  # the next sample of a controller after a time
    require: Callable[[Array], None] | None  # that an accepted state is held; raises if not
    note: Callable[[float, Array], None] | None  # (t1, q1) of an accepted step
    forces: Any  # `force_watch` of loops.h


class Stepper:
    """Steps of a scene in C; see march.c.

    The state is that of C.  What there is to see of it is in Python after each call: time,
    configuration, velocities, reactions and ledger.  The ``state`` of methods is the
    :class:`Simulation`, which is above this module.
    """

    def __init__(
        self, scheme: Scheme, equation: StepEquation, newton: Newton, ledger: Ledger,
        inertia: Inertia | None, path: StaticPath | None, cell_forces: CellForces,
        together: Agreement, extras: Extras,
    ) -> None:  # fmt: skip
        self._equation, self._inertia, self._path = equation, inertia, path
        self._together, self._extras, self._callbacks = together, extras, equation.callbacks
        share, phases = equation.share, equation.phases
        again = [one.again for one in phases if one.again is not None]
        fill(equation.c, agains=len(again), again=ffi.new("again_call[]", again))
        least = LEAST_IN_MOTION if inertia is not None else LEAST_AT_REST
        self.solver = solver = Solver(share, equation, newton, least)
        rotations = share.rotations
        half_tangents, in_motion = with_half_tangents(scheme, rotations), has_inertia(scheme)
        self._bytes = 8 * share.size
        loads = [one.vector for one in equation.loads]
        multipliers = share.multipliers.astype(np.int32)
        opens = [one.opens for one in phases if one.opens is not None]
        places = ffi.new("openable[]", opens)
        admits = [one.admits for one in phases if one.admits is not None]
        s = np.zeros(share.size) if equation.supports.turned else solver.change
        self.c = fill(
            ffi.new("march *"),
            equation=equation.c, size=share.size, q=np.zeros(share.size), x=solver.unknowns, s=s,
            guess=np.zeros(share.size), in_parts=not in_motion,
            load_weight=scheme.load_weight, at=1.0 if in_motion else scheme.load_weight,
            limits_turn=scheme.limits_turn,
            largest_turn=LARGEST_TURN, rotations=len(rotations), rotation=rotations,
            half_tangents=len(half_tangents), half_tangent=half_tangents,
            multipliers=len(multipliers), multiplier=multipliers,
            loads=len(loads), load=ffi.new("vector *[]", loads),
            supports=equation.supports.in_c(self._callbacks),
            states=len(ledger.state), state=ledger.state.numbers, cell_forces=cell_forces.c,
            opens=int(share.largest(float(bool(opens)))), places=len(opens), place=places,
            admissions=len(admits), admission=ffi.new("admission_call[]", admits),
            judges=int(share.largest(float(bool(admits)))),
            applying_turn=APPLYING_TURN, short_part=SHORT_PART,
        )  # fmt: skip
        if self.c.opens:
            fill(self.c, found=np.zeros(share.size))
        if equation.supports.turned:
            fill(self.c, x=np.zeros(share.size))
        if inertia is not None:
            handle = self._callbacks.handle(self._prepare)
            fill(self.c, rates=inertia.rates.c, prepare=lib.run_in_python)
            self.c.handle = handle  # what `fill` keeps must not keep this object
        if extras.forces is not None:
            fill(self.c, forces=extras.forces)
        if path is not None:
            changes = [one.change for one in phases if one.change is not None]
            fill(self.c, path=path.in_c(changes))
        self._alive: list[Any] = [opens]
        self._watches: Sequence[Any] = ()
        self._state: Any = None  # while C takes steps
        self._add_extras({
            name: [x for one in phases for x in getattr(one, name)]
            for name in ("begin", "accept", "add_state")
        })  # fmt: skip
        self._links = [one for one in equation.terms if isinstance(one, Links)]

    def _add_extras(self, loops: dict[str, list[Loop]]) -> None:
        """Let functions of Python take part in the phases of a step."""
        extras, callbacks = self._extras, self._callbacks
        if extras.stop is not None:
            stop = callbacks.handle(lambda t: extras.stop(self.c.t, t))
            self.c.stop, self.c.stops = lib.time_in_python, stop
        # What may raise comes first, before other loops of C have accepted anything.
        asking = lib.phase_in_python, ffi.addressof(lib, "accept_guides")
        mine = [one for one in loops["accept"] if one[0] in asking]
        if extras.require is not None:
            require = extras.require
            mine.insert(0, callbacks.phase(lambda step, q1, s: require(self._copy(q1))))
        loops["accept"] = mine + [one for one in loops["accept"] if one[0] not in asking]
        if extras.ask is not None:
            loops["begin"].insert(0, callbacks.phase(self._ask))
        if extras.note is not None:
            note = extras.note
            took = callbacks.phase(lambda step, q1, s: note(step.t1, self._copy(q1)))
            loops["add_state"].append(took)
        for name, calls in loops.items():
            place, in_c = getattr(self.c, name), ffi.new("phase_call[]", calls)
            self._alive += [in_c, calls]
            place.number, place.call = len(calls), in_c

    # -- steps -----------------------------------------------------------------------------------

    def take(self, state: Any, ends: Array, *, keep: bool = False) -> int:
        """Take steps to these times, for :data:`LONGEST` at most; those that fail in parts.

        Returns:
            How many were taken.  With ``keep`` the state after each of them is in the solution.

        Raises:
            StepFailed: Even the smallest part failed; the state is that before it.
            BaseException: What a function of a user has raised; the steps before are taken.
        """
        c, steps, room, rows = self.c, len(ends), 0, ffi.NULL
        if keep:
            of_states = state.room(steps)
            room, rows = len(of_states), doubles(of_states)
            steps = max(room, 1)
        with self._in_c(state):
            taken: int = lib.take_steps(c, steps, doubles(ends), LONGEST, room > 0, rows)
        if keep and taken:
            state.grow(taken if room else 0, c.parts_of_last)
        if c.failure:
            self._fail()
        return taken

    def apply_loads(self, state: Any, end: float) -> None:
        """Apply the loads that act at the present time, in parts, up to the time ``end``."""
        fill(self.c, applies=1, begin_of_run=self.c.t, applied_by=end)
        with self._in_c(state):
            reached = lib.go_to_time(self.c, end)
        self.c.applies = 0
        if not reached:
            self._fail()

    def attempt(self, state: Any, t1: float, end: float) -> Trial:
        """Solve the step to ``t1``, which is a part of one to ``end``."""
        with self._in_c(state):
            solved = lib.attempt_step(self.c, t1, end)
        return self._trial(solved)

    def attempt_along(
        self, state: Any, step: Step, guess: Array, border: Any, *, hold: bool
    ) -> Trial:
        """Solve a step, whose times are those of the guess, together with the load factor.

        With ``hold`` what does not flow stays closed if it can, see material_points.py.  The guess
        is in the axes of supports.
        """
        c = self.c
        self.solver.follow(border)
        with self._in_c(state):
            of_step = c.step
            of_step.t0, of_step.t1, of_step.dt = step.t0, step.t1, step.dt
            of_step.load_time, of_step.motion_time = step.load_time, step.motion_time
            of_step.fraction = of_step.at = 1.0
            of_step.ratio, of_step.q0, of_step.q_before = 0.0, c.q, c.prediction.q_before
            ffi.memmove(c.guess, doubles(guess), self._bytes)
            solved = lib.solve_begun_step(c, hold)
        self.solver.follow(None)
        return self._trial(solved)

    def accept(self, state: Any, trial: Trial) -> None:
        """Go where the latest attempt went."""
        self.c.step.t1 = trial.step.t1
        with self._in_c(state):
            accepted = lib.accept_step(self.c)
        if not accepted:
            self._fail()

    def _trial(self, solved: int) -> Trial:
        if not solved:
            self._fail()
        c = self.c
        q0, q1, s, q_before = map(self._copy, (c.q, c.x, c.s, c.step.q_before))
        of = c.step
        numbers = of.load_time, of.motion_time, of.fraction, of.at
        return Trial(Step(of.t0, of.t1, q0, *numbers, q_before, of.ratio), q1, s)

    def _fail(self) -> None:
        """Raise why the latest step failed; all processes call it together."""
        c, error, self._callbacks.error = self.c, self._callbacks.error, None
        failure, c.failure = c.failure, lib.SUCCEEDS
        if failure == lib.RAISED:
            self._together.settle(error)
        if failure == lib.NO_EQUILIBRIUM:
            if number := self._equation.c.error:
                error = PETSc.Error(number)
            self._together.settle(error)
            raise self.solver.failure()
        if failure == lib.TURNS_TOO_FAR:
            raise StepFailed(
                f"a node turns by {c.turn:.3g} rad in the step, and |Δψ| must stay below π; "
                "reduce dt"
            )
        if failure == lib.APPLIED_TOO_FAST:
            raise StepFailed("a node turns too far while the loads at the beginning are applied")
        if failure == lib.GIVES_ENERGY:
            self._together(self._require_dissipation)
        if self._path is not None:
            raise self._path.failure(failure == lib.LEAVES_MECHANISM)
        raise StepFailed("the step cannot be trusted")

    def _require_dissipation(self) -> None:
        q1 = self._copy(self.c.x)
        for one in self._equation.inner:
            if one.must_dissipate:
                one.require_dissipation(q1)

    # -- callbacks -------------------------------------------------------------------------------

    def _ask(self, *_: Any) -> None:
        """Let controllers and friction ask the scene, which has the state of C."""
        if self._state is not None and self._extras.ask is not None:
            self._state.moved(self.c.t)
            self._together(self._extras.ask)

    def _prepare(self) -> None:
        """Take from a trial step what the scheme keeps besides the velocities."""
        if self._inertia is not None:
            c = self.c
            self._inertia.prepare(self._copy(c.s), c.step.dt)
            self._equation.supports.take()
            q1 = self._copy(c.x)
            for one in self._links:
                one.take(q1)

    # -- the state -------------------------------------------------------------------------------

    @contextmanager
    def _in_c(self, state: Any) -> Iterator[None]:
        """Context in which C takes steps from a state; then Python sees the one that follows."""
        self._state = state
        self.c.parts, self.c.failure, self._callbacks.error = 0, lib.SUCCEEDS, None
        try:
            yield
        except SystemError as error:
            # Python's preconditioner under PETSc: its exception is still set when C returns.
            raise error.__cause__ or error from None
        finally:
            self._state = None
            state.moved(self.c.t)
            state.parts += self.c.parts
            for one in self._watches:
                one.seen = state.parts

    def watch(self, watches: Sequence[Any]) -> None:
        """Let these take in the state after each step."""
        self._watches = watches
        of_c = ffi.new("watch *[]", [one.c for one in watches])
        fill(self.c, watches=len(watches), watch=of_c)

    @property
    def q(self) -> Array:
        """Accepted local configuration; a copy."""
        return self._copy(self.c.q)

    def _copy(self, values: Any) -> Array:
        return np.frombuffer(ffi.buffer(values, self._bytes)).copy()

    def begin_at(self, state: Any, t: float, q: Array) -> None:
        """Go on from a state that no step has led to."""
        ffi.memmove(self.c.q, doubles(q), self._bytes)
        fill(self.c, prediction=state.prediction.c)
        self.c.t = t
        give_back_memory(len(q))


def begins_loaded(scene: Scene, scheme: Scheme, t: float) -> bool:
    """Return whether loads that act at ``t`` are to be applied before the first step."""
    over_step = scheme.average(0.0, 1.0) != 1.0
    if has_inertia(scheme) or not over_step:
        return False
    frames = any(isinstance(load, RotatingFrame) for load in scene.loads)
    return frames or bool(scene.works) or any(f(t) != 0 for _, f in scene.time_functions())
