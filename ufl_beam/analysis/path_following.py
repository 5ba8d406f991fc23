# SPDX-License-Identifier: MIT
"""Static paths: equilibria one after the other, the load factor among the unknowns."""

from __future__ import annotations

import time
from collections.abc import Callable, Sequence
from typing import Any, NamedTuple, cast

from mpi4py import MPI

import numpy as np

from ufl_beam.analysis.critical_points import Branch, CriticalPoint, Direction, Stiffness
from ufl_beam.analysis.path_controls import Control, Given
from ufl_beam.analysis.path_corrector import Walk
from ufl_beam.arrays import Array
from ufl_beam.discretization.state_io import State
from ufl_beam.errors import SceneError, StepFailed, require_count, require_function, require_kind
from ufl_beam.mechanics.classical import Static
from ufl_beam.model.connector_laws import Actuator, Controller, Motor
from ufl_beam.model.mesh_options import Mesh
from ufl_beam.model.scene import Scene
from ufl_beam.model.time_functions import TimeFunction
from ufl_beam.output.archive import below
from ufl_beam.output.output_files import take
from ufl_beam.output.recorders import Recorder, close_all, recorders_of
from ufl_beam.parallel import communicator
from ufl_beam.parameter import FACTOR
from ufl_beam.simulation.run import partial_results
from ufl_beam.simulation.simulation import Simulation
from ufl_beam.simulation.solution import Solution
from ufl_beam.simulation.solution_files import arrays_of
from ufl_beam.simulation.solution_files import take as take_solution
from ufl_beam.simulation.step_cutting import Trial
from ufl_beam.solvers.newton_options import Newton

ADVICE = (
    "Try a shorter step or another control: ArcLength goes through limit points of loads and of "
    "displacements, DissipationControl through softening that snaps back"
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

ALIGNED = 0.5
"""Cosine of the angle by which a step may leave the direction in which it is sought."""

FAR = 10.0
"""Times by which it may be longer."""

SHORT = 2.0**-6
"""Part of a step at which it may, for a law may have a kink."""

AGAIN = 1e-3
"""Part of a step within which a critical point is the one that the path has just reached."""

SOFT = 1e-3
"""Part of its size at the ends of a step below which what vanishes at a critical point is zero."""


class Path(Solution):
    """Equilibrium path: a solution whose times are load factors.

    Attributes:
        critical: Limit and bifurcation points, in the order in which they were passed.

    Example:
        >>> path = ub.follow(scene, ub.LoadControl(0.5), steps=4)
        >>> print(path.factor, path.critical)
        [0.  0.5 1.  1.5 2. ] []
    """

    critical: Sequence[CriticalPoint] = ()
    parameter = FACTOR

    @property
    def factor(self) -> Array:
        """Load factors, the time of the time functions; (n+1,)."""
        return self.times

    def _content(self) -> tuple[dict[str, Any], State]:
        text, arrays = super()._content()
        text["critical"] = [{"kind": c.kind, "factor": c.factor, "n": c.n} for c in self.critical]
        for k, point in enumerate(self.critical):
            arrays[f"critical/{k}/mode"] = point.mode
            for name, values in arrays_of(point.state).items():
                arrays[f"critical/{k}/state/{name}"] = values
        return text, arrays

    def _take(self, text: dict[str, Any], arrays: State) -> None:
        super()._take(text, arrays)
        critical = []
        for k, one in enumerate(text["critical"]):
            state, prefix = Solution(self.scene, self.grid), f"critical/{k}/state/"
            take_solution(state, text, below(prefix, arrays))
            critical.append(CriticalPoint(**one, state=state, mode=arrays[f"critical/{k}/mode"]))
        self.critical = critical

    @property
    def progress(self) -> Array:
        """Arc length of the path in the displacements of nodes, root mean square; (n+1,); m."""
        nodes = np.unique(np.vstack([self.grid.dofs, self.grid.dofs_of_bodies])[:, :2])
        steps = np.sqrt(2 * np.mean(np.diff(self.q[:, nodes], axis=0) ** 2, axis=1))
        return np.concatenate([[0.0], np.cumsum(steps)])


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

    def passed(self, before: Candidate) -> bool:
        """Return whether a critical point lies between ``before`` and this state.

        An eigenvalue of the stiffness has passed zero there, or the load factor has turned.
        """
        turned = (self.way.t < 0) != (before.way.t < 0)
        return turned or self.stiffness.passed(before.stiffness)


class Route:
    """The steps of a walk: how long they are, and the critical points that they pass.

    Args:
        simulation: In statics, where the path begins.
        control: What decides about steps.

    Attributes:
        critical: The critical points so far.
    """

    def __init__(self, simulation: Simulation, control: Control) -> None:
        self._walk, self._control = Walk(simulation, control.factor), control
        self.critical: list[CriticalPoint] = []
        self._weights = simulation.share.gather(self._walk.weights)
        self._part = 1.0
        self._before: Candidate | None = None
        self._landed = False

    def begin(self, branch: Branch | None, *, fresh: bool) -> None:
        """Find the direction in which the path begins; if it is fresh, its first equilibrium too.

        Raises:
            ConvergenceError: There is none.
        """
        walk, simulation = self._walk, self._walk.simulation
        if branch is not None:
            walk.direction = Direction(branch.mode[walk.share.dofs], 0.0)
            return
        try:
            if fresh:
                still = Direction(np.zeros(walk.share.size), 0.0)
                simulation.accept(walk.attempt(still, 0.0, Given(walk.t)))
            walk.begin()
            way = walk.flow(walk.look(simulation.q))
        except StepFailed as failure:
            simulation.give_up(failure, self._tried(), ADVICE)
        sign = 1.0 if self._control.ahead(walk, way) > 0 else -1.0
        walk.direction = Direction(sign * way.q, sign * way.t)

    def _tried(self) -> float:
        """The load factor at which the latest attempt began."""
        return self._walk.simulation.t + self._walk.sought.t

    def advance(self) -> None:
        """One step; where it fails, a shorter one; where it passes a critical point, up to there.

        Raises:
            ConvergenceError: Even the smallest part failed.
        """
        simulation = self._walk.simulation
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
        try:
            self._accept(found, part)
        except StepFailed as failure:
            simulation.give_up(failure, self._tried(), ADVICE)

    def _accept(self, found: Candidate, part: float) -> None:
        """Go to the end of a step, or to a critical point before it."""
        walk, before = self._walk, self._before
        if before is None or not found.passed(before):
            self._landed = False
            self._take(found)
            return
        after = found
        found, reached = self._locate(before, after, part)
        if self._landed and reached < AGAIN * part:
            # The signs of one critical point need not change in the same last digit.
            self._landed = False
            self._take(self._seek(part))
            return
        self._landed = found.passed(before)
        limit = self._turns(found, before, after)
        if self._landed and not walk.dissipates and walk.dissipation(found.trial.q1) > 0:
            self._pass_kink(found, reached - 2 * LOCATED * part, part, limit)
            return
        # What yields or opens may change signs without an eigenvalue of zero.
        λ, *ends = (abs(self._softest(one)[0]) for one in (found, before, after))
        soft = limit or λ < SOFT * max(ends)
        way = walk.direction
        self._take(found)
        if self._landed and soft:
            self._note(found, way, len(walk.simulation.solution.times), limit)

    def _pass_kink(self, after: Candidate, last: float, part: float, limit: bool) -> None:
        """Go to the last state in which nothing dissipates, if the load factor turns there."""
        walk, before = self._walk, self._walk.direction
        if limit:
            if last > 0:
                self._take(self._seek(last))
            self._note(after, before, len(walk.simulation.solution.times) - (last <= 0), limit)
        if not limit or last <= 0:
            self._take(self._seek(part))
            return
        self._before = after

    def _take(self, found: Candidate) -> None:
        walk = self._walk
        walk.dissipates = walk.dissipation(found.trial.q1) > 0.0
        walk.simulation.accept(found.trial)
        walk.direction, self._before = found.way, found

    def _seek(self, part: float) -> Candidate:
        walk, simulation = self._walk, self._walk.simulation
        trial = self._control.seek(walk, part)
        walk.t = trial.step.t1
        stiffness = walk.look(trial.q1)
        way = walk.flow(stiffness)
        gone = Direction(trial.q1 - simulation.q, trial.step.t1 - simulation.t)
        if part > SHORT:
            self._require_near(gone)
        if self._control.onward(walk, gone, way) < 0:
            way = Direction(-way.q, -way.t)
        return Candidate(trial, stiffness, way)

    def _require_near(self, gone: Direction) -> None:
        """Raise if a step has left the direction in which it was sought."""
        walk, factor = self._walk, self._walk.factor
        size, sought = (walk.length(way, factor) for way in (gone, walk.sought))
        aligned = walk.product(gone, walk.sought, factor) >= ALIGNED * size * sought
        if not aligned or size > FAR * sought:
            raise StepFailed("the path turns too sharply, or the step leaps to another branch")

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
            side = -1 if found.passed(before) else 1
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
        if after.way.t * self._walk.direction.t < 0:
            return self._slope
        return lambda found: abs(self._softest(found)[0])

    def _slope(self, found: Candidate) -> float:
        """Change of the load factor along the path over that of the configuration.

        As K q' = f t', a slope of zero means that the direction of the path is a critical one, and
        that the load f does work on it.  At a bifurcation it does none on the critical direction.
        """
        return abs(found.way.t) / self._walk.size(found.way)

    def _turns(self, found: Candidate, before: Candidate, after: Candidate) -> bool:
        """Return whether the load factor turns in a state that was located between two others.

        Either it has turned there, as at a kink, or its slope vanishes.  The load factor and the
        eigenvalue need not change their signs in the same last digit.
        """
        if found.way.t * self._walk.direction.t < 0:
            return True
        slope, *ends = (self._slope(one) for one in (found, before, after))
        return slope < SOFT * max(ends)

    def _softest(self, found: Candidate) -> tuple[float, Array]:
        return found.stiffness.softest(self._weights)

    def _note(self, found: Candidate, before: Direction, n: int, limit: bool) -> None:
        """Remember the state as a critical point, the n-th of the path; ``found`` is beyond it."""
        walk, simulation, way = self._walk, self._walk.simulation, found.way
        if limit:
            # At a limit point the path goes along the mode.
            mode = np.asarray(way.q / walk.size(way), dtype=np.float64)
        else:
            mode = np.asarray(self._softest(found)[1][walk.share.dofs], dtype=np.float64)
            simulation.supports.leave(mode)
            # What the path goes along the mode is lost in a singular stiffness.
            strayed = Direction(way.q - before.q, 0.0)
            along = walk.product(strayed, Direction(mode, 0.0), 1.0)
            walk.direction = Direction(way.q - along * mode, way.t)
        kind = "limit" if limit else "bifurcation"
        state = simulation.snapshot()
        mode = walk.share.gather(mode)
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
    mesh: Mesh | None = None,
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
        control: :class:`ArcLength`, :class:`LoadControl`, :class:`DisplacementControl` or
            :class:`DissipationControl`.
        until: The path ends after the first step for which this is true, as in
            ``until=lambda now: now.displacement(tip)[1] < -0.5``; ``now.t`` is the load factor.
        steps: The path ends after so many.
        start: Branch of a :class:`CriticalPoint`, or a solution whose last state is the beginning.
        record: Files to write on the way.
        newton: Tolerances and PETSc options; line searches and Krylov methods are not used.
        mesh: How finely it is discretised; as ``start``, or with the cells of the beams.
        comm: Processes that share the scene.

    Raises:
        SceneError: The call or the scene is wrong; nothing was computed.
        ConvergenceError: A step failed; it carries the path so far.

    Example:
        >>> path = ub.follow(scene, ub.LoadControl(0.5), until=lambda now: now.t >= 2)
        >>> print(path.factor)
        [0.  0.5 1.  1.5 2. ]
    """
    comm = communicator(comm, "follow: comm")
    if until is not None:
        require_function(until, "follow: until", "the Simulation")
    require_kind(scene, Scene, "scene")
    if not isinstance(control, Control) or isinstance(control, type):
        raise SceneError(
            f"follow: control = {control!r} must be ArcLength(...), LoadControl(...), "
            "DisplacementControl(...) or DissipationControl(...)"
        )
    control.require(scene)
    require_count(steps, "follow: steps")
    if start is not None:
        require_kind(start, (Solution, Branch), "follow: start")
    recorders, outputs = recorders_of(record, comm, "follow")
    branch, state = (start, start.state) if isinstance(start, Branch) else (None, start)
    t0 = 0.0 if state is None else float(state.times[-1])
    _require_driven(scene, t0)
    began = time.perf_counter()
    simulation = Simulation(
        scene, Static(), t0=t0, start=state, newton=newton, mesh=mesh, comm=comm, kind=Path
    )
    path = cast(Path, simulation.solution)
    route = Route(simulation, control)
    path.critical = route.critical
    release = take(outputs)

    def after_step() -> bool:
        if recorders:
            simulation.settle()  # before anything is written
        simulation.keep()
        for recorder in recorders:
            recorder.write(simulation)
        return until is not None and bool(until(simulation))

    try:
        with partial_results(simulation):
            route.begin(branch, fresh=state is None)
            for recorder in recorders:
                simulation.together(recorder.open, simulation)
            simulation.keep()
            for _ in range(steps):
                route.advance()
                if simulation.share.largest(simulation.together(after_step)):
                    break
            simulation.end()
    finally:
        release()
        path.seconds = time.perf_counter() - began
        simulation.close()
        close_all(recorders)
    if comm.rank == 0:
        path.opened.warn(simulation.scheme, path.times)
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
