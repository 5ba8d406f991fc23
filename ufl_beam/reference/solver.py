# SPDX-License-Identifier: MIT
"""Solver of a scene in time: the equation of a step, PETSc's SNES, and the state between steps."""

from __future__ import annotations

import math
import sys
from collections import defaultdict
from collections.abc import Callable
from functools import partial
from typing import Any

from petsc4py import PETSc

import numpy as np
from scipy.sparse import csr_array

from ufl_beam.arrays import Array, State
from ufl_beam.discretization.dof_numbering import Grid
from ufl_beam.errors import StepFailed
from ufl_beam.mechanics.time_schemes import Scheme, Step, acting, has_inertia, nodal_step
from ufl_beam.model.connector_laws import Controller, Coulomb
from ufl_beam.model.connectors import Connector
from ufl_beam.model.constraint_checks import friction_repeats
from ufl_beam.model.loads import RotatingFrame
from ufl_beam.output.state_rows import BEFORE, FORCES, LEDGER
from ufl_beam.reference.beams import (
    CellForce,
    ElasticBeams,
    Inertia,
    YieldingBeams,
    damping_forces,
    inelastic_cells,
)
from ufl_beam.reference.cells import Force, Ledger
from ufl_beam.reference.connector_laws import LawInStep, Setting
from ufl_beam.reference.connectors import Connectors, connectors_of
from ufl_beam.reference.loads import loads_of
from ufl_beam.reference.points import MaterialPoints, Search
from ufl_beam.reference.state import Now
from ufl_beam.reference.supports import Supports

LARGEST_TURN = 0.75 * math.pi
"""A step that turns a node further is cut; the algorithmic strains end at π."""

MOST_PARTS = 2**12
"""Largest number of parts that a step is cut into."""

SURE = 1e-4
"""Part of the tolerance that first iterates have to meet."""

PATIENCE = 8
"""Iterations in a row without half the least residual, after which Newton's method gives up."""

FIRST = 1 / 16
"""Part of the first step after which accelerations are taken for those at the beginning."""

APPLYING, APPLYING_TURN, SHORT_PART = 1 / 8, 0.02, 512
"""Part of the first step in which loads that are there from the start are applied; largest turn of
a node meanwhile in a part (rad); parts shorter by this factor may turn nodes further."""

FALL, TIE = 0.7, 1e-9
"""What is held opens from the largest excess over its limit on, then from this part of it on;
difference of two excesses that means nothing."""

FAR, KINK = 1e3, 1e-6
"""Largest motion in a static step that is no mechanism, in sizes of the scene or rad; work that a
kink of a law may leave unexplained, as a part of the energy that went through."""


class Solver:
    """State of a scene, and the step to the next.

    Args:
        grid: Numbering of the degrees of freedom.
        scheme: Time scheme.
        t: Time of the initial state; s.
        q: Initial configuration; (size,).
        v: Initial velocities; (size,).
        rtol: Tolerance of the residual, as a part of the forces in the scene.
        max_iterations: Iterations before a step is cut.
        petsc: Options of SNES, without a prefix.

    Attributes:
        given: Forces of the cells in the initial state, if those of another run are known.
    """

    def __init__(
        self, grid: Grid, scheme: Scheme, t: float, q: Array, v: Array, *, rtol: float,
        max_iterations: int, petsc: dict[str, Any],
    ) -> None:  # fmt: skip
        scene, self.grid, self.scheme = grid.scene, grid, scheme
        self.t, self.q, self.q_before, self.last_dt = t, q, q, math.inf
        self.ledger, self.search = Ledger(), Search()
        self.parts = self.iterations = 0
        self.weights: Array = np.ones(grid.size)  # which make forces and moments comparable
        self.weights[grid.rotations] = 1 / scene.size
        self.weights[grid.multipliers] = 0.0
        self.supports = Supports(grid, scheme, self.ledger)
        self._make_forces(v)
        self._rtol, self._max_iterations, self._petsc = rtol, max_iterations, petsc
        self._last, self._best, self._slow = math.inf, math.inf, 0
        self._x, self._K = self.q, csr_array((grid.size, grid.size))
        self._make_snes()
        self._error: Exception | None = None
        self.given: Array | None = None
        self._inner: Array = np.zeros(grid.size)  # inner forces in the latest residual
        self._inner_before: Array = self._inner

    def _make_forces(self, v: Array) -> None:
        """Read the scene into forces."""
        grid, scheme, ledger = self.grid, self.scheme, self.ledger
        scene, rest = grid.scene, np.arange(len(grid.cells))
        self.yielding: list[YieldingBeams] = []
        for layout, cells in inelastic_cells(grid).items():
            self.yielding.append(YieldingBeams(grid, cells, layout, scheme, self.search, ledger))
            rest = np.setdiff1d(rest, cells)
        self.beams: list[CellForce] = [*self.yielding]
        if len(rest):
            self.beams.append(ElasticBeams(grid, rest, scheme, ledger))
        asked = [link for link in scene.links if isinstance(link.law, Controller | Coulomb)]
        self.asked: dict[Connector, float] = dict.fromkeys(asked, 0.0)
        self.samples: dict[Connector, tuple[float, int]] = {}
        self.rates = dict(self.asked)
        setting = Setting(
            scene.size, scheme, ledger, self.search, self.asked, self.rates, friction_repeats(scene)
        )
        self.connectors = connectors_of(grid, setting)
        self.inertia = None
        if has_inertia(scheme):
            self.inertia = Inertia(grid, scheme, self.supports.stop(v), ledger)
        mass = None if self.inertia is None else self.inertia.mass
        self.loads = loads_of(grid, scheme, mass, ledger, self.t)
        others = damping_forces(grid, scheme, self.inertia, ledger)
        self.inner: list[Force] = [*self.beams, *self.connectors]
        inertia = [] if self.inertia is None else [self.inertia]
        self.forces: list[Force] = [*self.inner, *self.loads, *inertia, *others]
        if scene.beams:
            ledger.state["stored"] += 0.0
        laws = (law for c in self.connectors if isinstance(c, Connectors) for law in c.laws)
        points = (beams.points for beams in self.yielding)
        everything: list[LawInStep | MaterialPoints] = [*laws, *points]
        self._open = [one for one in everything if one.softens]

    # -- the initial state -----------------------------------------------------------------------

    def start(self, internal: dict[str, Array] | None, *, same: bool) -> None:
        """Begin with the internal variables of another run, if there are any.

        ``same`` says that scene and time are those at its end: no force has jumped.
        """
        fresh, internal = internal is None, internal or {}
        v = None if self.inertia is None else self.inertia.v
        loads: Array = np.zeros(self.grid.size)
        if not fresh or (has_inertia(self.scheme) and self.scheme.kept):
            for load in self.loads:
                loads = loads + load.equilibrium(self.t, self.q, v)
        self._take_asked(internal)
        for force in self.forces:
            force.take(internal, self.q, goes_on=same)
            force.enter_state(self.q)
        if fresh:
            self.q = self.q.copy()
            for one in self.connectors:
                if isinstance(one, Connectors):
                    one.put_forces(self.q)
        self._continues = not fresh
        # Forces of beams at rest: in a step so short that nothing viscous flows.
        short = Step.of(self.scheme, 0.0, sys.float_info.min, sys.float_info.min, self.q)
        for beam in self.beams:
            beam.begin(short)
            self._inner_before = self._inner_before + beam.residual(self.q)
            beam.note()
        self.on_nodes = [one for beam in self.beams for one in beam.on_nodes()]
        if "reactions" in internal:
            self.supports.reactions = self.supports.before = internal["reactions"]
        if self.inertia is None:
            step = Step.of(self.scheme, self.t, self.t + 1.0, self.t + 1.0, self.q)
            step = step._replace(load_time=self.t, motion_time=self.t)
            for one in self.connectors:
                one.begin(step)
                self._inner_before = self._inner_before + one.residual(self.q)
            if not (same and "reactions" in internal):
                self.supports.note(self.supports.axes @ (self._inner_before - loads))
                self.supports.before = self.supports.reactions

    def internal(self) -> dict[str, Array]:
        """Internal variables, forces and rates that another run may begin with."""
        state: dict[str, Array] = {"reactions": self.supports.before}
        tables = defaultdict(list)
        for force in self.forces:
            for name, values in force.internal().items():
                if values.ndim == 1:
                    state[name] = values
                else:
                    tables[name].append(values)
        tables["asked, 4"] = [self._asked_rows()] if self.asked else []
        for name, parts in tables.items():
            if parts:
                table = np.concatenate(parts)
                state[name] = table[np.argsort(table[:, 0])]
        return state

    # -- controllers and friction ----------------------------------------------------------------

    def ask(self) -> None:
        """Ask controllers for forces and friction for limits; note the rates of what may slip."""
        now = Now(self)
        for link in self.asked:
            if (sample := _sample(link)) == 0.0:
                self.asked[link] = link.law.ask(now, link)  # type: ignore[union-attr]
                continue
            first, number = self.samples.get(link, (self.t, -1))
            due = math.floor((self.t - first + _rounding(sample, self.t, first)) / sample)
            if due != number:
                self.asked[link] = link.law.ask(now, link)  # type: ignore[union-attr]
                self.samples[link] = first, due
        if self.inertia is not None:
            for one in self.connectors:
                if isinstance(one, Connectors) and any(link in self.rates for link in one.links):
                    rates = one.rates(self.q, self.inertia.v)
                    self.rates.update(zip(one.links, map(float, rates), strict=True))

    def _next_sample(self, end: float) -> float:
        """Return the next sample time of a controller, or ``end`` if that comes first; s."""
        stop = end
        for link in self.asked:
            if sample := _sample(link):
                first, _ = self.samples.get(link, (self.t, -1))
                number = math.floor((self.t - first + _rounding(sample, self.t, first)) / sample)
                at = first + (number + 1) * sample
                if self.t < at < stop - _rounding(sample, at, stop):
                    stop = at
        return stop

    def _asked_rows(self) -> Array:
        links = self.grid.scene.links
        nothing = math.nan, math.nan
        return np.array([
            (links.index(link), value, *self.samples.get(link, nothing), self.t)
            for link, value in self.asked.items()
        ])  # fmt: skip

    def _take_asked(self, internal: dict[str, Array]) -> None:
        table = internal.get("asked, 4", np.zeros((0, 5)))
        for number, value, first, sample, t in table:
            link = self.grid.scene.links[int(number)]
            if link in self.asked:
                self.asked[link] = float(value)
                if math.isfinite(first) and t == self.t:
                    self.samples[link] = float(first), int(sample)

    # -- the equation of a step ------------------------------------------------------------------

    def begin(self, step: Step) -> None:
        """Let all forces begin a step."""
        for force in self.forces:
            force.begin(step)

    def residual(self, x: Array) -> Array:
        """Residual at ``x``; both are in the axes of the supports."""
        q1 = self.supports.axes.T @ x
        self._inner = sum((force.residual(q1) for force in self.inner), np.zeros(len(x)))
        others = (force.residual(q1) for force in self.forces if not force.inner)
        r = np.asarray(self.supports.axes @ sum(others, self._inner))
        self.supports.note(r)
        return r

    def tangent(self, x: Array) -> csr_array:
        """Derivative of the residual at ``x``."""
        axes, q1 = self.supports.axes, self.supports.axes.T @ x
        K = csr_array((len(x), len(x)))
        for force in self.forces:
            K = K + force.tangent(q1)
        return csr_array(axes @ K @ axes.T)

    def _norm(self, forces: Array) -> float:
        """Norm of forces, and moments over the size of the scene; N."""
        return float(np.linalg.norm(self.weights * forces))

    def _round_off(self, x: Array) -> Array:
        """Residual that the last digits of motions make; N, N m."""
        motions = np.abs(x) * (self.weights > 0)
        return np.asarray(np.abs(self._K) @ np.spacing(motions))

    # -- PETSc -----------------------------------------------------------------------------------

    def _make_snes(self) -> None:
        """Make the SNES of a step, whose unknowns are the free degrees of freedom."""
        petsc, n = self._petsc, len(self.supports.free)
        self._vector, f = (PETSc.Vec().createSeq(n) for _ in range(2))
        self._matrix = PETSc.Mat().createAIJ((n, n), comm=PETSc.COMM_SELF)
        self._matrix.setOption(PETSc.Mat.Option.NEW_NONZERO_ALLOCATION_ERR, False)
        self._matrix.setUp()
        self.snes = snes = PETSc.SNES().create(PETSc.COMM_SELF)
        snes.setOptionsPrefix("ub_")
        snes.setFunction(self._function, f)
        snes.setJacobian(self._jacobian, self._matrix)
        snes.setConvergenceTest(self._converged)
        snes.setTolerances(max_it=self._max_iterations)
        snes.setType("newtonls")
        snes.ksp.setType("preonly")
        snes.ksp.pc.setType("lu")
        snes.ksp.pc.setFactorSolverType("mumps")
        options = PETSc.Options("ub_")
        for name, value in petsc.items():
            options[name] = value
        snes.setFromOptions()
        for name in petsc:
            options.delValue(name)
        self._searches = ("basic", "bt") if "snes_linesearch_type" not in petsc else ("",)

    def _all(self, vector: PETSc.Vec) -> Array:
        """All degrees of freedom, from those that are free."""
        x = self._x.copy()
        x[self.supports.free] = vector.array_r
        return x

    def _function(self, snes: PETSc.SNES, vector: PETSc.Vec, f: PETSc.Vec) -> None:
        """Residual of the free degrees of freedom; NaN, at which SNES stops, after an error."""
        try:
            self._r = self.residual(self._all(vector))
        except Exception as error:  # of a function of the user
            self._error = error
        if self._error is not None:
            self._r = np.full(self.grid.size, np.nan)
        f.array_w[:] = self._r[self.supports.free]

    def _jacobian(self, snes: PETSc.SNES, vector: PETSc.Vec, A: PETSc.Mat, P: PETSc.Mat) -> None:
        """Derivative of the residual by the free degrees of freedom."""
        try:
            self._K = self.tangent(self._all(vector))
        except Exception as error:
            self._error = error
        K = csr_array(self._K[self.supports.free][:, self.supports.free])
        if not np.isfinite(K.data).all():
            self._error = self._error or StepFailed("the tangent has entries that are no numbers")
            K.data[:] = 0.0
        P.zeroEntries()
        P.setValuesCSR(*(x.astype(PETSc.IntType) for x in (K.indptr, K.indices)), K.data)
        P.assemble()

    def _converged(self, snes: PETSc.SNES, iteration: int, norms: Any) -> Any:
        """Stop where the residual is a small part of the forces, or as small as digits allow."""
        reasons, x = PETSc.SNES.ConvergedReason, self._all(snes.getSolution())
        r = self._r.copy()
        r[self.supports.held] = 0.0
        size = self._norm(r)
        if not math.isfinite(size):
            return reasons.DIVERGED_FNORM_NAN
        scale = self._norm(self._inner) + sum(self._norm(load.force) for load in self.loads)
        moved = min(
            float(np.max(np.abs(x) * (self.weights > 0), initial=0.0)), self.grid.scene.size
        )
        q1 = self.supports.axes.T @ x
        missed = max((c.missed(q1, r, scale, moved) for c in self.connectors), default=0.0)
        # A small load beside large ones is lost in a guess that just meets the tolerance.
        least = 1 if self.inertia is not None else 2
        enough = self._rtol * scale * (SURE if iteration < least else 1.0)
        if size <= enough and missed <= self._rtol:
            return reasons.CONVERGED_FNORM_ABS
        digits = 8 * self._norm(self._round_off(x)) if iteration > 1 else 0.0
        # Newton's method no longer halves what the last digits make.
        stays = size <= digits and size > self._last / 2
        if iteration > 1 and stays and missed <= max(self._rtol, 1e-10):
            return reasons.CONVERGED_FNORM_ABS
        self._last, self._slow = size, self._slow + 1
        if size <= self._best / 2:
            self._best, self._slow = size, 0
        return reasons.DIVERGED_DTOL if self._slow > PATIENCE else reasons.CONVERGED_ITERATING

    def _newton(self, guess: Array) -> Array:
        """Find the equilibrium from a guess, by SNES; both are in the axes of the supports."""
        for search in self._searches:  # full steps; if they fail, a line search
            if search:
                PETSc.Options("ub_")["snes_linesearch_type"] = search
                self.snes.setFromOptions()
                PETSc.Options("ub_").delValue("snes_linesearch_type")
            self._x, self._error = guess, None
            self._last, self._best, self._slow = math.inf, math.inf, 0
            self._vector.array_w[:] = guess[self.supports.free]
            reason = self._iterate()
            if self._error is not None and not isinstance(self._error, StepFailed):
                raise self._error
            if reason > 0:
                return self._all(self._vector)
            for one in self.connectors:
                one.again()
        raise self._error or self._failure(reason)

    def _iterate(self) -> int:
        """Let SNES iterate; return why it has stopped."""
        try:
            self.snes.solve(None, self._vector)
        except PETSc.Error as error:  # also where a callback is interrupted
            cause: BaseException = error
            while cause.__cause__ is not None:
                cause = cause.__cause__
            if not isinstance(cause, PETSc.Error):
                raise cause from None
            self._make_snes()  # MUMPS has stopped it where it found no pivot
            return int(PETSc.SNES.ConvergedReason.DIVERGED_LINEAR_SOLVE)
        self.iterations += self.snes.getIterationNumber()
        return int(self.snes.getConvergedReason())

    def _failure(self, reason: int) -> StepFailed:
        names = {v: k for k, v in vars(PETSc.SNES.ConvergedReason).items() if isinstance(v, int)}
        r = np.abs(self._r) * self.weights
        r[self.supports.held] = 0.0
        failure = StepFailed(
            f"Newton's method did not converge ({names.get(reason, reason)}); residual "
            f"{np.linalg.norm(r):.3e} N"
        )
        failure.residuals = self.grid.worst(np.nan_to_num(r))
        failure.reason = str(names.get(reason, reason))
        return failure

    # -- openings --------------------------------------------------------------------------------

    def _equilibrium(self, guess: Array, step: Step) -> Array:
        """Find the equilibrium of a step in which no more opens than must.

        What does not flow at the beginning stays closed if there is an equilibrium in which it
        bears at most its limit.  Of several that bear too much, the one with the largest excess
        opens first.
        """
        if not self._open:
            return self._newton(guess)
        self.search.hold, self.search.over = True, False
        try:
            x, times = self._newton(guess), 0
            while excess := self._largest_excess():
                for one in self._open:
                    one.release(FALL**times * excess - TIE)
                x, times = self._newton(x), times + 1
            return x
        except StepFailed:
            if not self.search.over:
                raise  # nothing would open
        finally:
            self.search.hold = False
            for one in self._open:
                one.close()
        self.begin(step)
        return self._newton(guess)

    def _largest_excess(self) -> float:
        return max(float(np.max(one.excess)) for one in self._open)

    # -- a step ----------------------------------------------------------------------------------

    def step_to(self, t1: float) -> None:
        """Go to the time ``t1``, in one step or, where that fails, in parts.

        Raises:
            StepFailed: Even the smallest part failed; the state is that of the last one before.
        """
        if self.parts == 0 and not self._continues and self._begins_loaded():
            begin = self.t
            end = begin + APPLYING * (t1 - begin)
            self._in_parts(end, partial(self._apply_loads, begin=begin, end=end))
            self.last_dt = math.inf  # the next guess does not go on as loads were applied
        while self.t != t1:
            end = self._next_sample(t1)
            self._in_parts(end, partial(self._attempt, end=end))

    def _in_parts(self, t1: float, attempt: Callable[[float], None]) -> None:
        """Go to ``t1`` at once, or in parts: halves, halves of these, and so on."""
        t0, done, part = self.t, 0, MOST_PARTS
        while done < MOST_PARTS:
            last = done + part == MOST_PARTS
            try:
                attempt(t1 if last else t0 + (t1 - t0) * (done + part) / MOST_PARTS)
            except StepFailed:
                if part == 1:
                    raise
                part //= 2
                continue
            done += part
            if done % (2 * part) == 0 and part < MOST_PARTS:
                part *= 2  # where the larger one would begin anyway

    def _begins_loaded(self) -> bool:
        """Whether loads that act at the beginning are applied before the first step."""
        if has_inertia(self.scheme) or self.scheme.average(0.0, 1.0) == 1.0:
            return False
        scene = self.grid.scene
        frames = any(isinstance(load, RotatingFrame) for load in scene.loads)
        at_once = any(f(self.t) != 0 for _, f in scene.time_functions())
        return frames or bool(scene.works) or at_once

    def _attempt(self, t1: float, end: float) -> None:
        """Take the step to ``t1``, a part of one to ``end``, if there is an equilibrium."""
        inertia = self.inertia
        if inertia is not None and inertia.scheme.kept and not inertia.more:
            # Accelerations at the beginning are those of a short trial step.
            t = self.t + FIRST * (t1 - self.t)
            q1, s = self._solve(Step.of(self.scheme, self.t, t, t1, self.q))
            inertia.more = inertia.after(s)[1:]
            self.supports.before = self.supports.reactions
            for one in self.connectors:
                one.take_forces(q1)
        step = Step.of(self.scheme, self.t, t1, end, self.q)
        self._accept(step, *self._solve(step))

    def _apply_loads(self, t1: float, begin: float, end: float) -> None:
        """Apply a part of the loads of the time ``begin``, in a part that turns nodes little."""
        step = Step.of(self.scheme, self.t, t1, end, self.q)
        step = step._replace(load_time=begin, motion_time=begin)
        q1, s = self._solve(step)
        turn = float(np.abs(q1 - self.q)[self.grid.rotations].max(initial=0.0))
        if turn > APPLYING_TURN and SHORT_PART * step.dt > end - begin:
            raise StepFailed("a node turns too far while the loads at the beginning are applied")
        self._accept(step, q1, s)

    def _solve(self, step: Step) -> tuple[Array, Array]:
        """Configuration at the end of a step, and the step of the nodes that forces work on."""
        q0, axes = self.q, self.supports.axes
        self.ask()
        self.begin(step)
        guess = axes @ (q0 + step.dt / self.last_dt * (q0 - self.q_before))
        self.supports.move(guess, axes @ q0, step)
        q1 = np.asarray(axes.T @ self._equilibrium(guess, step))
        turn = float(np.abs(q1 - q0)[self.grid.rotations].max(initial=0.0))
        s = nodal_step(self.scheme, q0, q1, self.grid.rotations)
        s[self.grid.multipliers] = 0.0
        if self.scheme.limits_turn and not turn <= LARGEST_TURN:
            raise StepFailed(
                f"a node turns by {turn:.3g} rad in the step, and |Δψ| must stay below π; reduce dt"
            )
        for force in self.inner:
            force.require_dissipation(q1)
        if self.inertia is None:
            self._require_path(q1, s)
        return q1, s

    def _require_path(self, q1: Array, s: Array) -> None:
        """Raise :class:`StepFailed` if a static step has leapt to another branch of equilibria.

        Along the path the internal forces account for what the step stores and dissipates.
        """
        moves = np.abs(s) / self.grid.scene.size
        moves[self.grid.rotations] *= self.grid.scene.size
        if not moves.max(initial=0.0) <= FAR:
            raise StepFailed("what yields and what has opened leave a mechanism")
        if math.isinf(self.scheme.slack):
            return
        work = float(acting(self.scheme, self._inner_before, self._inner) @ s)
        in_beams = sum(beam.change(q1) for beam in self.beams)
        change = in_beams + sum(one.change(q1) for one in self.connectors)
        size = abs(work) + abs(in_beams) + sum(one.effort(q1) for one in self.connectors)
        entries = (abs(x) for part in self.ledger.copy() for x in part.values())
        slack = self.scheme.slack * size + KINK * sum(entries) + sys.float_info.min
        slack += float(self._round_off(self.supports.axes @ q1) @ np.abs(s))
        if abs(work - change) > slack:
            raise StepFailed(
                f"the step stores and dissipates {change:.3e} J, but the forces along it do "
                f"{work:.3e} J of work: it leaps to another branch of equilibria"
            )

    def _accept(self, step: Step, q1: Array, s: Array) -> None:
        """Take the end of a step as the new state, and enter works and losses."""
        self._inner_before = self._inner
        for force in self.forces:
            force.accept(q1, s)
        self.supports.accept(s)
        self.on_nodes = [one for force in self.forces for one in force.on_nodes()]
        self.q_before, self.last_dt = self.q, step.dt
        self.q, self.t, self.parts = q1, step.t1, self.parts + 1
        for name in self.ledger.state:
            self.ledger.state[name] = 0.0
        for force in self.forces:
            force.enter_state(q1)

    # -- what is kept ----------------------------------------------------------------------------

    def connections(self) -> Array:
        """Columns of ``Connection`` for all links; (num_links, 5)."""
        table = np.zeros((len(self.grid.scene.links), 5))
        for one in self.connectors:
            table[one.numbers] = one.kept(self.q)
        return table

    def snapshot(self) -> State:
        """The state now, by the names of the columns of solutions."""
        reactions = self.supports.forces()
        if self.parts == 0 and self.inertia is not None:
            reactions = np.full_like(reactions, np.nan)  # nobody knows them
        material = [one.material() for one in self.yielding]
        rows = np.concatenate([np.zeros((0, 7)), *material])
        state = {"t": np.array(self.t), "q": self.q, "reactions": reactions}
        if self.inertia is not None:
            state["v"] = self.inertia.v
        for part, entries in zip(LEDGER, self.ledger.copy(), strict=True):
            state |= {f"{part}: {name}": np.array(value) for name, value in entries.items()}
        state |= {
            "connectors": self.connections(), "material": rows[np.argsort(rows[:, 0]), 1:],
            FORCES: self._numbers_of_cells(),
        }  # fmt: skip
        over_step = float(self.scheme.average(0.0, 1.0)) < 1
        return {**state, BEFORE: self.q_before} if over_step else state

    def _numbers_of_cells(self) -> Array:
        """Forces at both ends of the cells, and how they are distributed; (9, num_cells).

        (X, Y, M) at the start and at the end; the couple of what acts along a cell; first moments
        of its forces about the middle, over the length.
        """
        if self.given is not None and self.parts == 0:
            return self.given
        numbers = np.zeros((9, len(self.grid.cells)))
        first, *between, last = self.grid.mesh.nodes - 0.5
        away = np.array([first, last, *between])
        for kind, cells, forces in self.on_nodes:
            numbers[:3, cells] += forces[:, :, 0].T
            numbers[3:6, cells] += forces[:, :, 1].T
            if kind != "stress":
                numbers[6, cells] += forces[:, 2].sum(axis=1)
            if kind == "density":
                numbers[7:, cells] += (forces[:, :2] @ away).T
        return numbers


def _sample(link: Connector) -> float:
    """Sample time of a connector; 0 if it has none; s."""
    return (isinstance(link.law, Controller) and link.law.sample) or 0.0


def _rounding(sample: float, *times: float) -> float:
    """Difference of times that is due to their last digits; s."""
    return 1e-9 * sample + 4 * math.ulp(max(map(abs, times)))
