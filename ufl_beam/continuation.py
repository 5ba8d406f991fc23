"""Static paths: equilibria one after the other, the load factor among the unknowns."""

from __future__ import annotations

import math
import time
from collections.abc import Callable, Sequence
from functools import cached_property
from typing import NamedTuple

from mpi4py import MPI

import numpy as np

from ufl_beam.compat import Array
from ufl_beam.connectors import Actuator, Controller, Motor
from ufl_beam.controls import Constraint, Control, Given
from ufl_beam.critical import Branch, CriticalPoint, Direction, Stiffness, metric
from ufl_beam.errors import SceneError, require_count, require_kind, require_sequence
from ufl_beam.loads import TimeFunction
from ufl_beam.processes import ours
from ufl_beam.record import Recorder, on_first
from ufl_beam.scene import Scene
from ufl_beam.schemes import Static, Step
from ufl_beam.simulation import Simulation, Trial
from ufl_beam.solution import Solution
from ufl_beam.solve import Newton, StepFailed

ADVICE = (
    "Try a shorter step or another control: ArcLength goes through limit points of loads and of "
    "displacements, Dissipation through softening that snaps back"
)

SMALLEST_PART = 2.0**-12
"""A step is cut down to this part of it."""

WANTED = 12
"""Steps of more Newton iterations are followed by shorter ones, of fewer by longer ones."""

PATIENCE = 4
"""Steps that fail before the search for a critical point goes on from another state."""

LOCATED = 1e-7
"""Critical points are located to this part of a step."""

TRIALS = 60
"""Steps in which a critical point is sought."""

FARTHEST = 30
"""Times a way is doubled until something dissipates on it."""

ALIGNED = 0.5
"""Cosine of the angle by which a step may leave the direction in which it is sought."""

FAR = 10.0
"""Times by which it may be longer."""

SHORT = 2.0**-6
"""Part of a step at which it may, for a law may have a kink."""

BEGUN = 1e-6
"""Part of a step that tells what dissipates when it begins."""

AGAIN = 1e-3
"""Part of a step within which a critical point is the one that the path has just reached."""

MET = 1e-9
"""Part of a step by which its end may miss what the control demands."""


class Path(Solution):
    """A path of equilibria: a solution whose times are load factors.

    Attributes:
        critical: Limit and bifurcation points, in the order in which they were passed.
    """

    critical: Sequence[CriticalPoint] = ()

    @property
    def factor(self) -> Array:
        """Load factors, the time of the time functions; (n+1,)."""
        return self.times


class Candidate(NamedTuple):
    """The end of a step that may be accepted.

    Attributes:
        trial: The step.
        stiffness: The stiffness at its end.
        way: Direction of the path there.
    """

    trial: Trial
    stiffness: Stiffness
    way: Direction

    def signs(self) -> tuple[int, bool]:
        """What changes at critical points: negative pivots, and whether the load factor falls."""
        return self.stiffness.negative, self.way.t < 0


class Walk:
    """What goes along a path; the border of the equilibrium is the equation of its control.

    Args:
        simulation: In statics, where the path begins.
        control: What decides about steps.

    Attributes:
        share: The degrees of freedom of this process.
        weights: See :func:`~ufl_beam.critical.metric`.
        t: The load factor of the latest iterate.
        direction: That of the path at the accepted state.
        dissipates: Whether the last step did.
        critical: The critical points so far.
    """

    def __init__(self, simulation: Simulation, control: Control) -> None:
        self.simulation, self._control = simulation, control
        self.share = simulation.share
        self.weights = metric(self.share)
        self.t = simulation.t
        self.dissipates = False
        self.critical: list[CriticalPoint] = []
        self._driven = [*simulation.loads, *simulation.couplings]
        self._part = 1.0
        self._before: Candidate | None = None
        self._landed = False

    @cached_property
    def _all_weights(self) -> Array:
        return self.share.gather(self.weights)

    # -- measures ------------------------------------------------------------------------------

    def product(self, a: Direction, b: Direction, factor: float) -> float:
        """Of two directions; without dimension."""
        return self.share.total(float((self.weights * a.q) @ b.q)) + a.t * b.t / factor**2

    def length(self, way: Direction, factor: float) -> float:
        """Of a direction; without dimension."""
        return math.sqrt(self.product(way, way, factor))

    def dissipation(self, q: Array) -> float:
        """What beams dissipate in the step to ``q``; J."""
        return self.share.total(sum(one.dissipation(q) for one in self.simulation.inelastic))

    def aim(self, reach: float) -> Direction:
        """A way along which so much is dissipated, if nothing gives way; ``reach`` in J.

        Where nothing dissipated before, the direction changes as soon as something does.

        Raises:
            StepFailed: Nothing dissipates.
        """
        simulation, way = self.simulation, self.direction
        self._begin(self._step(simulation.t), simulation.terms)
        gone = Direction(np.zeros(self.share.size), 0.0)
        if not self.dissipates:
            gone = self._until(BEGUN * reach, gone, way)
            self.t = simulation.t + gone.t
            way = self._flow(self._look(simulation.q + gone.q))
            if self._side(simulation.q + gone.q, way) < 0:
                way = Direction(-way.q, -way.t)
        return self._until(reach, gone, way)

    def _until(self, reach: float, gone: Direction, way: Direction) -> Direction:
        """What has gone and as much more along a way as dissipates ``reach``."""

        def dissipated(length: float) -> float:
            return self.dissipation(self.simulation.q + gone.q + length * way.q)

        low, high = 0.0, 1e-6 / self.length(way, self._control.factor)
        for _ in range(FARTHEST):
            if dissipated(high) >= reach:
                break
            low, high = high, 2 * high
        else:
            raise StepFailed("nothing dissipates in the direction of the path")
        for _ in range(12):
            middle = (low + high) / 2
            low, high = (middle, high) if dissipated(middle) < reach else (low, middle)
        return Direction(gone.q + high * way.q, gone.t + high * way.t)

    def _side(self, q: Array, way: Direction) -> float:
        """Positive where more dissipates along a way from ``q``, negative where against it."""
        now, size = self.dissipation(q), self.length(Direction(way.q, 0.0), 1.0)
        for doubled in range(FARTHEST if now > 0 and size > 0 else 0):
            δ = 1e-9 * 2**doubled / size
            more = self.dissipation(q + δ * way.q) - self.dissipation(q - δ * way.q)
            if abs(more) > now:
                return more
        return 0.0

    # -- the border ----------------------------------------------------------------------------

    def _step(self, t: float) -> Step:
        """A path is infinitely slow: rates and what they do vanish."""
        return Step(-math.inf, t, self.simulation.q, load_time=t, motion_time=t, toward=1.0)

    @staticmethod
    def _begin(step: Step, terms: Sequence[object]) -> None:
        for term in terms:
            term.begin(step)  # type: ignore[attr-defined]

    def _moved(self, t: float) -> Array:
        """What supports prescribe, at their degrees of freedom; zero elsewhere."""
        x = np.zeros(self.share.size)
        self.simulation.supports.move(x, x, self._step(t))
        return x

    def arrive(self, x: Array) -> None:
        """Bring the loads to the load factor of an iterate."""
        self._x = x.copy()
        self._begin(self._step(self.t), self._driven)

    def tangent(self, x: Array, r: Array) -> None:
        """Fill the matrix; the derivative by the load factor, of linear functions exactly."""
        simulation = self.simulation
        q = simulation.supports.in_plane(x)
        ε = 1e-6 * max(1.0, abs(self.t))
        for sign in (1, -1):
            self._begin(self._step(self.t + sign * ε), self._driven)
            part = np.zeros(self.share.size)
            for term in self._driven:
                term.add_residual(q, part)
            r += sign / (2 * ε) * part
        self._begin(self._step(self.t), self._driven)
        for term in self._driven:
            term.add_residual(q, np.zeros(self.share.size))
        simulation.supports.enter(r)
        self._rates = (self._moved(self.t + ε) - self._moved(self.t - ε)) / (2 * ε)
        self._A = simulation.tangent_at(x, self._rates, r)

    def correct(self, y: Array, z: Array) -> None:
        """By the equation of the control, linearised."""
        supports, moving = self.simulation.supports, self.simulation.supports.moving
        if len(moving):
            z = z - self._rates
        q = supports.in_plane(self._x)
        miss = self._constraint.miss(q, self.t)
        by_y = self._constraint.slope(q, Direction(supports.in_plane(y), 0.0))
        by_z = self._constraint.slope(q, Direction(supports.in_plane(z), -1.0))
        change = (miss - by_y) / by_z if by_z else math.nan
        y += change * z
        self.t += change
        y[moving] = self._x[moving] - self._moved(self.t)[moving]

    def met(self) -> bool:
        """Whether the control has what it demands."""
        q = self.simulation.supports.in_plane(self._x)
        return abs(self._constraint.miss(q, self.t)) <= MET

    # -- a step --------------------------------------------------------------------------------

    def attempt(self, way: Direction, length: float, constraint: Constraint) -> Trial:
        """Solve, beginning so far along a way.

        Raises:
            StepFailed: There is no equilibrium.
        """
        simulation = self.simulation
        self._constraint = constraint
        self._sought = Direction(length * way.q, length * way.t)
        self.t = simulation.t + length * way.t
        step, guess = self._step(self.t), simulation.q + length * way.q
        simulation.supports.enter(guess)
        simulation.supports.move(guess, guess, step)
        trial = simulation.attempt_along(step, guess, self)
        return trial._replace(step=self._step(self.t))

    def _look(self, q: Array) -> Stiffness:
        """The stiffness at a state."""
        supports = self.simulation.supports
        x = supports.in_axes(q)
        # The first tangent of a step is that of the forces before it, and may not yet be taken.
        self.tangent(x, np.zeros(self.share.size))
        rate = np.zeros(self.share.size)
        self.tangent(x, rate)
        return Stiffness(self.share, self._A, supports.dofs, rate)

    def _flow(self, stiffness: Stiffness) -> Direction:
        """Direction of the path of growing load factor."""
        q = stiffness.flow[self.share.dofs] + self._rates
        self.simulation.supports.leave(q)
        way = Direction(q, 1.0)
        size = self.length(way, self._control.factor)
        if not math.isfinite(size) or not self.length(Direction(q, 0.0), 1.0) > 0:
            raise StepFailed(
                "nothing moves with the load factor here; let a load or a motion go on to change, "
                "as with time=lambda t: t"
            )
        return Direction(q / size, 1.0 / size)

    def _seek(self, part: float) -> Candidate:
        simulation = self.simulation
        trial = self._control.seek(self, part)
        self.t = trial.step.t1
        stiffness = self._look(trial.q1)
        way = self._flow(stiffness)
        gone = Direction(trial.q1 - simulation.q, trial.step.t1 - simulation.t)
        if part > SHORT:
            self._require_near(gone)
        side = self._side(trial.q1, way)
        if (side or self.product(gone, way, self._control.factor)) < 0:
            way = Direction(-way.q, -way.t)
        return Candidate(trial, stiffness, way)

    def _require_near(self, gone: Direction) -> None:
        """Raise if a step has left the direction in which it was sought."""
        factor = self._control.factor
        size, sought = (self.length(way, factor) for way in (gone, self._sought))
        aligned = self.product(gone, self._sought, factor) >= ALIGNED * size * sought
        if not aligned or size > FAR * sought:
            raise StepFailed("the path turns too sharply, or the step leaps to another branch")

    def begin(self, branch: Branch | None, *, fresh: bool) -> None:
        """Find the direction in which the path begins; if it is fresh, its first equilibrium too.

        Raises:
            ConvergenceError: There is none.
        """
        simulation = self.simulation
        if branch is not None:
            self.direction = Direction(branch.mode[self.share.dofs], 0.0)
            return
        try:
            if fresh:
                still = Direction(np.zeros(self.share.size), 0.0)
                simulation.accept(self.attempt(still, 0.0, Given(self.t)))
            self._begin(self._step(self.t), simulation.terms)
            way = self._flow(self._look(simulation.q))
        except StepFailed as failure:
            simulation.give_up(failure, self._tried(), ADVICE)
        sign = 1.0 if self._control.ahead(self, way) > 0 else -1.0
        self.direction = Direction(sign * way.q, sign * way.t)

    def _tried(self) -> float:
        """The load factor of the latest attempt."""
        return self.t if math.isfinite(self.t) else self.simulation.t

    def advance(self) -> None:
        """One step; where it fails, a shorter one; where it passes a critical point, up to there.

        Raises:
            ConvergenceError: Even the smallest part failed.
        """
        simulation = self.simulation
        while True:
            iterations = simulation.iterations
            try:
                found = self._seek(self._part)
                break
            except StepFailed as failure:
                self._part /= 2
                if self._part < SMALLEST_PART:
                    simulation.give_up(failure, self._tried(), ADVICE)
        count = simulation.iterations - iterations
        part, self._part = self._part, min(1.0, self._part * min(2.0, WANTED / max(count, 1)))
        if self._before is None or found.signs() == self._before.signs():
            self._landed = False
            self._take(found)
            return
        found, reached = self._locate(self._before, found, part)
        if self._landed and reached < AGAIN * part:
            # The signs of one critical point need not change in the same last digit.
            self._landed = False
            self._take(self._seek(part))
            return
        self._landed = found.signs() != self._before.signs()
        if self._landed and not self.dissipates and self.dissipation(found.trial.q1) > 0:
            self._turn_at_kink(found, reached - 2 * LOCATED * part, part)
            return
        before = self.direction
        self._take(found)
        if self._landed:
            self._note(found, before, len(simulation.solution.times))

    def _turn_at_kink(self, after: Candidate, last: float, part: float) -> None:
        """Go to the last state in which nothing dissipates; what begins there turns the path."""
        simulation, before = self.simulation, self.direction
        if last > 0:
            self._take(self._seek(last))
        self._note(after, before, len(simulation.solution.times) - (last <= 0))
        if last <= 0:
            self._take(self._seek(part))
        self._before = after

    def _take(self, found: Candidate) -> None:
        self.dissipates = self.dissipation(found.trial.q1) > 0.0
        self.simulation.accept(found.trial)
        self.direction, self._before = found.way, found

    # -- critical points -----------------------------------------------------------------------

    def _locate(self, before: Candidate, after: Candidate, part: float) -> tuple[Candidate, float]:
        """The first state whose signs have changed, and the part of the step that leads there.

        By false position with halved weights (Illinois).  Where a step in between fails, the
        last state before, for shorter steps from there.
        """
        measure = self._measure(after)
        low, high, here, there = 0.0, part, measure(before), -measure(after)
        last = failed = 0
        for _ in range(TRIALS):
            if high - low <= LOCATED * part:
                break
            middle = (low * there - high * here) / (there - here)
            margin = min(0.01 * (high - low), LOCATED * part)
            middle = min(max(middle, low + margin), high - margin)
            try:
                found = self._seek(middle)
            except StepFailed:
                failed += 1
                if failed < PATIENCE:
                    there *= 4
                    continue
                if low > 0:
                    self._part = (high - low) / 2
                    return self._seek(low), low
                break
            side = 1 if found.signs() == before.signs() else -1
            if side > 0:
                low, here = middle, measure(found)
                there /= 2 if last == side else 1
            else:
                high, there = middle, -measure(found)
                here /= 2 if last == side else 1
            last = side
        return self._seek(high), high

    def _measure(self, after: Candidate) -> Callable[[Candidate], float]:
        """Size of what vanishes at the critical point before ``after``."""
        if after.way.t * self.direction.t < 0:
            return lambda found: abs(found.way.t)
        return lambda found: abs(self._softest(found)[0])

    def _softest(self, found: Candidate) -> tuple[float, Array]:
        return found.stiffness.softest(self._all_weights)

    def _note(self, found: Candidate, before: Direction, n: int) -> None:
        """Remember the state as a critical point, the n-th of the path; ``found`` is beyond it."""
        simulation, way = self.simulation, found.way
        limit = way.t * before.t < 0
        if limit:
            # At a limit point the path goes along the mode.
            mode = way.q / self.length(Direction(way.q, 0.0), 1.0)
        else:
            mode = self._softest(found)[1][self.share.dofs]
            simulation.supports.leave(mode)
            # What the path goes along the mode is lost in a singular stiffness.
            strayed = Direction(way.q - before.q, 0.0)
            along = self.product(strayed, Direction(mode, 0.0), 1.0)
            self.direction = Direction(way.q - along * mode, way.t)
        kind = "limit" if limit else "bifurcation"
        state = simulation.snapshot()
        mode = self.share.gather(mode)
        self.critical.append(CriticalPoint(kind, simulation.t, n, state, mode))


# -- the call ----------------------------------------------------------------------------------


def follow(
    scene: Scene,
    control: Control,
    *,
    until: Callable[[Simulation], bool] | None = None,
    steps: int = 200,
    start: Solution | Branch | None = None,
    record: Sequence[Recorder] | Recorder = (),
    newton: Newton | None = None,
    comm: MPI.Intracomm | None = None,
) -> Path:
    """Follow a path of static equilibria through limit points and snap-backs.

    The time of loads and motions is the load factor; it is found with the displacements.  A path
    begins at 0, where the loads that are there at once are borne, in the direction of the control;
    it goes on in the direction in which it arrives.  It is infinitely slow: what is viscous, or has
    mass, does nothing.

    Where the load factor turns, or where another branch begins, the path has a state.

    Args:
        scene: What is modelled; some load or motion must vary in time, ``time=lambda t: t``.
        control: :class:`ArcLength`, :class:`Load`, :class:`Displacement` or :class:`Dissipation`.
        until: The path ends after the first step for which this is true, as in
            ``until=lambda now: now.displacement(tip)[1] < -0.5``; ``now.t`` is the load factor.
        steps: The path ends after so many.
        start: Branch of a :class:`CriticalPoint`, or a solution whose last state is the beginning.
        record: Files to write on the way.
        newton: Tolerances and PETSc options; line searches and Krylov methods are not used.
        comm: Processes that share the scene.

    Raises:
        SceneError: The call or the scene is wrong; nothing was computed.
        ConvergenceError: A step failed; it carries the path so far.
    """
    comm = ours() if comm is None else comm
    require_kind(scene, Scene, "scene")
    if not isinstance(control, Control) or isinstance(control, type):
        raise SceneError(
            f"follow: control = {control!r} must be ArcLength(...), Load(...), Displacement(...) "
            "or Dissipation(...)"
        )
    control.require(scene)
    require_count(steps, "follow: steps")
    if start is not None:
        require_kind(start, (Solution, Branch), "follow: start")
    recorders = (record,) if isinstance(record, Recorder) else require_sequence(record, "record")
    for i, recorder in enumerate(recorders):
        require_kind(recorder, Recorder, f"follow: record[{i}]")
        on_first(comm, recorder.require_writable)
    branch = start if isinstance(start, Branch) else None
    state = branch.state if branch is not None else start
    t0 = 0.0 if state is None else float(state.times[-1])
    _require_driven(scene, t0)
    began = time.perf_counter()
    simulation = Simulation(scene, Static(), t0=t0, start=state, newton=newton, comm=comm)
    simulation.solution = path = Path(scene, simulation.grid)
    walk = Walk(simulation, control)
    path.critical = walk.critical
    try:
        walk.begin(branch, fresh=state is None)
        for recorder in recorders:
            recorder.open(simulation)
        path.keep(simulation)
        for _ in range(steps):
            walk.advance()
            path.keep(simulation)
            for recorder in recorders:
                recorder.write(simulation)
            if until is not None and until(simulation):
                break
        simulation.end()
    except BaseException as error:
        error.__dict__["solution"] = path
        raise
    finally:
        for recorder in recorders:
            recorder.close()
        simulation.close()
        path.seconds = time.perf_counter() - began
    return path


def _require_driven(scene: Scene, t0: float) -> None:
    """Raise unless something depends on the load factor, and nothing on the history of time."""
    for link in scene.links:
        if isinstance(link.law, Controller):
            raise SceneError(f"{link}: a controller acts in time, and a path has none")
    functions: list[TimeFunction] = [load.time for load in scene.loads]
    functions += [motion for support in scene.supports for motion in support.moving.values()]
    for link in scene.links:
        functions += [link.law.motion] if isinstance(link.law, Motor) else []
        functions += [link.law.force] if isinstance(link.law, Actuator) else []
    if not any(f(t0 + Δ) != f(t0) for f in functions for Δ in (1e-3, 1.0, -1e-3, -1.0)):
        raise SceneError(
            "follow: no load and no motion depends on time, which is the load factor here; give "
            "the one that is to grow time=lambda t: t"
        )
