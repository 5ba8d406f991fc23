# SPDX-License-Identifier: MIT
"""Path following: static equilibria with an unknown load factor, and critical points."""

from __future__ import annotations

import math
import time
from collections.abc import Callable, Sequence
from contextlib import suppress
from typing import cast

from mpi4py import MPI

import numpy as np
import scipy  # its subpackages are loaded when they are used

from ufl_beam.analysis.critical_points import Branch, Candidate, CriticalPoint, Stiffness
from ufl_beam.analysis.path_controls import Control, Crossing, PathCorrector
from ufl_beam.arrays import Array
from ufl_beam.display import FACTOR
from ufl_beam.errors import (
    ArgumentError,
    StepFailed,
    each_warning_once,
    require_count,
    require_function,
    require_kind,
    require_switch,
)
from ufl_beam.mechanics.time_schemes import Static
from ufl_beam.model.beams import Mesh
from ufl_beam.model.connector_law import ConnectorLaw, require_limit
from ufl_beam.model.connector_laws import Controller, has_friction
from ufl_beam.model.scene import Scene
from ufl_beam.output.output_files import Content, add_prefix, remove_prefix, require_arrays
from ufl_beam.output.recorder import Recorder, checked_recorders
from ufl_beam.parallel import communicator, progress_bar
from ufl_beam.simulation.initial_state import StateOf, chosen_state
from ufl_beam.simulation.run import running, take_steps
from ufl_beam.simulation.simulation import Simulation
from ufl_beam.simulation.solution import NAMED, Solution
from ufl_beam.simulation.stepper import Trial
from ufl_beam.solvers.newton_options import Newton

MOST_POINTS = 5  # most critical points that the summary of a path names

ADVICE = (
    "Try a shorter step or another control: ArcLength goes through limit points of loads and of "
    "displacements, with a larger factor also through contacts that close while the load falls, "
    "DissipationControl through softening that snaps back"
)

SMALLEST_FRACTION = 2.0**-12  # smallest fraction of a step
TARGET_ITERATIONS = 12  # more iterations in a step shorten the next step, fewer lengthen it
MOST_FAILURES = 4  # number of failed steps that ends the search for a critical point
LOCATION_TOLERANCE = 1e-7  # accuracy of the location of critical points, as a fraction of a step
BRACKET = 1e-2  # largest fraction of a step in which motions along a mode are interpolated
SEPARABLE = 1.5e-5  # critical points closer than this fraction of a step may count as one point
MOST_CROSSING_STEPS = 8  # most steps that refine the location of a bifurcation point
SOFT = 0.1  # an eigenvalue below this fraction of its size at the ends of a step is small
NO_WORK = 1e-6  # fraction of Stiffness.most_work below which the work of a load counts as zero
MOST_LOCATION_STEPS = 60  # most steps to locate a critical point
LEAST_COSINE = 0.5  # least cosine of the angle between a step and its predictor
LARGEST_LENGTH_RATIO = 10.0  # largest ratio of the lengths of a step and its predictor
UNCHECKED_FRACTION = 2.0**-6  # steps of at most this fraction may turn sharply, as at a kink
SAME_POINT_FRACTION = 1e-3  # closer critical points, as a fraction of a step, are one point
# Largest distance between the states before and at a critical point, as a fraction of the step to
# the critical point.  A longer distance is a leap to another branch.
LARGEST_GAP = 0.1
SINGULAR_RATIO = 1e-3  # below this fraction of its size at the ends of a step, a number is zero


class Path(Solution):
    """Equilibrium path: a solution whose times are load factors.

    Attributes:
        critical: Limit and bifurcation points, in the order of the path.

    Example:
        >>> path = ub.follow(scene, ub.LoadControl(0.5), steps=4)
        >>> print(path.factor, path.critical)
        [0.  0.5 1.  1.5 2. ] []
    """

    critical: Sequence[CriticalPoint] = ()
    parameter = FACTOR

    @property
    def factor(self) -> Array:
        """Load factors, which are the arguments of time functions; (n+1,)."""
        return self.times

    def summary(self) -> list[str]:
        """Return lines on the model, the path, embedded hinges, and the first critical points."""
        first = ", ".join(map(str, self.critical[:MOST_POINTS]))
        rest = len(self.critical) - MOST_POINTS
        points = f"{first} and {rest} more" if rest > 0 else first
        return [*super().summary(), *filter(None, [points])]

    def _content(self) -> Content:
        content = super()._content()
        content["critical"] = [
            {"kind": c.kind, "factor": c.factor, "n": c.n} for c in self.critical
        ]
        for k, point in enumerate(self.critical):
            content[f"critical/{k}/mode"] = point.mode
            content |= add_prefix(f"critical/{k}/state/", point.state._arrays())
        return content

    def _set_content(self, content: Content) -> None:
        super()._set_content(content)
        critical = []
        for k, entry in enumerate(content["critical"]):
            state = Solution(self.scene, self.numbering)
            inside = remove_prefix(f"critical/{k}/", content)
            require_arrays(inside, {"mode": (self.numbering.size,)})
            state._set_content(
                {**{n: content[n] for n in NAMED}, **remove_prefix("state/", inside)}
            )
            kind, factor = str(entry["kind"]), float(entry["factor"])
            n = range(len(self))[entry["n"]]
            critical.append(CriticalPoint(kind, factor, n, state, inside["mode"]))
        self.critical = critical

    @property
    def progress(self) -> Array:
        """Arc length: sum of the steps, each a root mean square of displacements; (n+1,); m."""
        nodes = np.unique(np.vstack([self.numbering.dofs, self.numbering.dofs_of_bodies])[:, :2])
        steps = np.sqrt(2 * np.mean(np.diff(self.q[:, nodes], axis=0) ** 2, axis=1))
        return np.concatenate([[0.0], np.cumsum(steps)])


@each_warning_once()
def follow(
    scene: Scene,
    control: Control,
    *,
    until: Callable[[Simulation], bool] | None = None,
    steps: int = 200,
    start: StateOf | Branch | None = None,
    record: Sequence[Recorder] | Recorder = (),
    newton: Newton | None = None,
    mesh: Mesh | None = None,
    progress: bool = True,
    comm: MPI.Intracomm | None = None,
) -> Path:
    """Follow a path of static equilibria through limit points and snap-backs.

    The load factor replaces the time of loads and motions; it is an unknown like the displacements.
    Without ``start``, a path begins at the equilibrium with the load factor 0.  The control sets
    the sense of the path.  Viscosity and masses have no effect.

    Limit points of the load factor and bifurcation points become states of the path.

    Args:
        scene: Model; a load or motion must depend on time, as with ``amplitude=lambda t: t``.
        control: :class:`ArcLength`, :class:`LoadControl`, :class:`DisplacementControl` or
            :class:`DissipationControl`.
        until: Function that ends the path after the first step for which it is true, as in
            ``until=lambda now: now.displacement(tip)[1] < -0.5``; ``now.t`` is the load factor.
        steps: Largest number of steps.
        start: Branch of a :class:`CriticalPoint`, or a solution that the path continues, also
            ``(solution, n)`` from its n-th stored state.
        record: Recorders of files or results, as in :func:`simulate`.
        newton: Tolerances and PETSc options; line searches and Krylov methods are not used.
        mesh: Discretization; by default the mesh of ``start``, or the cells of the beams.
        progress: Show a progress bar in a terminal or notebook.
        comm: Processes that share the scene, as in :func:`simulate`.

    Raises:
        ArgumentError: The call or the scene is wrong; nothing was computed.
        ConvergenceError: The shortest step failed; ``solution`` of the error has the path so far.

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
        raise ArgumentError(
            f"follow: control = {control!r} must be ArcLength(...), LoadControl(...), "
            "DisplacementControl(...) or DissipationControl(...)"
        )
    control.require(scene)
    require_count(steps, "follow: steps")
    require_switch(progress, "follow: progress")
    if start is not None:
        require_kind(start, (Solution, Branch, tuple), "follow: start")
    recorders, outputs = checked_recorders(record, comm, "follow")
    branch = start if isinstance(start, Branch) else None
    state = start.state if isinstance(start, Branch) else chosen_state(start, "follow: start")
    t0 = 0.0 if state is None else float(state.times[-1])
    _require_load_factor(scene, t0)
    began = time.perf_counter()
    simulation = Simulation(
        scene, Static(), t0=t0, start=state, newton=newton, mesh=mesh, comm=comm, kind=Path
    )
    path = cast(Path, simulation.solution)
    stepper = PathStepper(simulation, control, steps)
    path.critical = stepper.critical
    with running(simulation, recorders, outputs, began):
        try:
            stepper.begin(branch, fresh=state is None)
            bar = progress_bar(progress, comm, total=steps, unit="step")
            take_steps(simulation, stepper, recorders, bar, until=until)
        except StepFailed as failure:
            end = simulation.t + float(stepper.corrector.predicted_step[-1])
            simulation.give_up(failure, end, ADVICE)
    return path


def _require_load_factor(scene: Scene, t0: float) -> None:
    """Raise if no load or motion depends on the load factor, or a law needs physical time."""
    for connector in scene.all_connectors:
        if isinstance(connector.law, Controller):
            raise ArgumentError(f"{connector}: a controller acts in time, and a path has none")
        if has_friction(connector.law):
            raise ArgumentError(
                f"{connector}: dry friction sticks or slides in time steps, and a path has none; "
                "use simulate(scene, Static(), ...), or a Spring that yields"
            )
        if isinstance(connector.law, ConnectorLaw):
            require_limit(connector.law, str(connector))
    for work in scene.works:
        if work.takes_rates:
            rate = "velocity v" if "v" in work.used_arguments else "step length dt"
            raise ArgumentError(
                f"{work}: it depends on the {rate}, and a path has no time; leave "
                f"{rate.split()[-1]} out, or use simulate(scene, Static(), ...)"
            )
    times = (t0 + 1e-3, t0 + 1.0, t0 - 1e-3, t0 - 1.0)
    changes = any("t" in work.used_arguments for work in scene.works)
    if not changes and not any(f(t) != f(t0) for _, f in scene.time_functions() for t in times):
        raise ArgumentError(
            "follow: no load and no motion depends on time, which is the load factor here; give "
            "the load or motion that grows amplitude=lambda t: t"
        )


class PathStepper:
    """Stepper of a path, which adapts lengths of steps and locates critical points."""

    def __init__(self, simulation: Simulation, control: Control, most: int) -> None:
        self._simulation, self._control = simulation, control
        self._most, self.error = most, math.nan
        self.steps = self.progress = 0
        self.finished = False
        self.corrector = PathCorrector(simulation, control.factor)
        self.critical: list[CriticalPoint] = []
        self._fraction = 1.0
        self._before: Candidate | None = None
        self._at_point = False

    def begin(self, branch: Branch | None, *, fresh: bool) -> None:
        """Find the initial direction of the path; if ``fresh``, first find an equilibrium."""
        corrector, simulation = self.corrector, self._simulation
        if branch is not None:
            corrector.direction = np.append(branch.mode[corrector.subdomain.dofs], 0.0)
            return
        if fresh:
            factor = corrector.factor_gradient  # the load factor is prescribed
            simulation.accept(corrector.attempt(0.0 * factor, factor, 1.0))
        corrector.begin()
        stiffness, direction = corrector.direction_at(simulation.q, simulation.t)
        sense = self._control.sense(corrector, direction, None)
        corrector.direction = direction if sense > 0 else -direction
        step = corrector.step_at(simulation.t)
        initial = Trial(step, simulation.q, np.zeros(corrector.subdomain.size))
        # The path may continue a run that ended at a critical point.
        self._before = self._candidate(initial, stiffness, corrector.direction)
        self._at_point = not fresh

    def advance(self, most: int = 1, *, keep: bool = False) -> None:
        """Take a step to its end or to the first critical point in it; shorten steps that fail.

        The end is stored in the solution if ``keep``.  Raise :class:`StepFailed` if even the
        shortest step fails.
        """
        self._fraction = max(self._fraction, 16 * SMALLEST_FRACTION)
        while True:
            iterations = self._simulation.iterations
            self._fraction = self._control.shortened(self.corrector, self._fraction)
            try:
                candidate = self._seek(self._fraction)
                break
            except StepFailed:
                self._fraction /= 2
                if self._fraction < SMALLEST_FRACTION:
                    raise
        count, fraction = self._simulation.iterations - iterations, self._fraction
        self._fraction = min(1.0, fraction * min(2.0, TARGET_ITERATIONS / max(count, 1)))
        self._accept(candidate, fraction)
        self.steps = self.progress = self.steps + 1
        at_end = self._control.shortened(self.corrector, 1.0) == 0.0
        self.finished = at_end or self.steps == self._most
        if keep:
            self._simulation.keep()

    def _accept(self, candidate: Candidate, fraction: float) -> None:
        """Go to the end of a step, or to a critical point before it."""
        corrector, before = self.corrector, self._before
        if before is None or not candidate.passed(before):
            self._at_point = False
            self._go_to(candidate)
            return
        after = candidate
        candidate, reached = self._locate(before, after, fraction)
        if self._at_point and reached < SAME_POINT_FRACTION * fraction:
            # Round-off may separate the sign changes of eigenvalue and load factor at one point.
            self._at_point = False
            self._go_to(self._seek(fraction))
            return
        if candidate.mode is not None:
            # The candidate has the signs after the point, so that the point is not found again.
            direction, self._at_point = corrector.direction, False
            self._go_to(candidate)
            self._store(candidate, direction, len(self._simulation.solution), limit=False)
            return
        self._at_point = candidate.passed(before)
        # At a limit point the load factor has turned, as at a kink, or the slope vanishes.  Both
        # are tested, because round-off may separate the sign changes of slope and eigenvalue.
        soft = _vanishes("softness", candidate, before, after)
        limit = self._turned(candidate) or _vanishes("slope", candidate, before, after)
        limit = limit and not (soft and _no_work(candidate, before, after))
        elastic_before = self._at_point and not corrector.dissipates
        if elastic_before and corrector.dissipation(candidate.trial.q1) > 0:
            self._pass_kink(candidate, reached - 2 * LOCATION_TOLERANCE * fraction, fraction, limit)
            return
        # An eigenvalue may change its sign without passing zero where yielding or opening begins.
        direction = corrector.direction
        self._go_to(candidate)
        if self._at_point and (soft or limit):
            self._store(candidate, direction, len(self._simulation.solution), limit)

    def _pass_kink(self, after: Candidate, last: float, fraction: float, limit: bool) -> None:
        """Go to the onset of dissipation if the load factor turns there (``limit``), else beyond.

        The onset is at the fraction ``last`` of the step, or at the present state if ``last`` is
        not positive.
        """
        before, n = self.corrector.direction, len(self._simulation.solution)
        if limit and last > 0:
            self._go_to(self._seek(last))
            self._store(after, before, n, limit)
            self._before = after
            return
        if limit:
            self._store(after, before, n - 1, limit)
        self._go_to(self._seek(fraction))

    def _go_to(self, candidate: Candidate) -> None:
        corrector = self.corrector
        q = candidate.trial.q1
        corrector.dissipates = corrector.dissipation(q) > 0.0
        side = 0.0 if corrector.dissipates else corrector.dissipation_side(q, candidate.direction)
        corrector.onset = side > 0.0
        self._simulation.accept(candidate.trial)
        corrector.direction = corrector.carried(candidate.direction, candidate.trial)
        self._before = candidate

    def _candidate(
        self, trial: Trial, stiffness: Stiffness, direction: Array, mode: Array | None = None
    ) -> Candidate:
        slope = abs(direction[-1]) / self.corrector.size(direction[:-1])
        return Candidate(trial, stiffness, direction, slope, mode)

    def _seek(self, fraction: float) -> Candidate:
        """Solve for a fraction of a step; StepFailed if the end is far from the prediction."""
        corrector = self.corrector
        trial = self._control.solve_step(corrector, fraction)
        stiffness, direction = corrector.direction_at(trial.q1, trial.step.t1)
        step = np.append(trial.q1, trial.step.t1) - corrector.start
        size, predicted_step = (corrector.length(x) for x in (step, corrector.predicted_step))
        aligned = corrector.along(corrector.weights * step, corrector.predicted_step)
        turns = aligned < LEAST_COSINE * size * predicted_step
        leaps = size > LARGEST_LENGTH_RATIO * predicted_step
        if fraction > UNCHECKED_FRACTION and (turns or leaps):
            raise StepFailed("the path turns too sharply, or the step leaps to another branch")
        if self._control.sense(corrector, direction, step) < 0:
            direction = -direction
        return self._candidate(trial, stiffness, direction)

    def _locate(
        self, before: Candidate, after: Candidate, fraction: float
    ) -> tuple[Candidate, float]:
        """Return the first state with changed signs, and its fraction of the step.

        False position with halved weights (Illinois) locates this state.  A bifurcation point is
        located between two states, see :meth:`_bifurcation_point`, which are far enough from the
        point that round-off along the mode is small.  If intermediate steps fail, or the signs
        change by a leap to another branch, return the last state before; shorter steps follow.
        """
        low, high, first, last = 0.0, fraction, before, after
        weight_low, weight_high, bracket = 1.0, 1.0, BRACKET
        side = failed = 0
        for _ in range(MOST_LOCATION_STEPS):
            if high - low <= LOCATION_TOLERANCE * fraction:
                break
            turned = self._turned(last)
            if not turned and high - low <= bracket * fraction and _soft(last, before, after):
                several = abs(last.stiffness.negative - before.stiffness.negative) > 1
                if not several or bracket <= SEPARABLE:
                    with suppress(StepFailed):
                        return self._bifurcation_point(
                            (low, high), (first, last), (before, after), fraction
                        )
                bracket /= 10
            sizes = [x.slope if turned else x.softness for x in (first, last)]
            value_low, value_high = weight_low * sizes[0], -weight_high * sizes[1]
            middle = (low * value_high - high * value_low) / (value_high - value_low)
            if not turned and high - low > bracket * fraction:
                # Go beyond the estimate, so that the critical point is between two close states.
                middle += 0.4 * bracket * fraction * (1 if value_low < -value_high else -1)
            margin = min(0.01 * (high - low), LOCATION_TOLERANCE * fraction)
            middle = min(max(middle, low + margin), high - margin)
            try:
                candidate = self._seek(middle)
            except StepFailed:
                failed += 1
                weight_high *= 4
                if failed == MOST_FAILURES:
                    break
                continue
            if candidate.passed(before):
                weight_low *= 0.5 if side < 0 else 1.0
                high, last, weight_high, side = middle, candidate, 1.0, -1
            else:
                weight_high *= 0.5 if side > 0 else 1.0
                low, first, weight_low, side = middle, candidate, 1.0, 1
        leap, whole = (
            self.corrector.length(last.end - x) for x in (first.end, self.corrector.start)
        )
        if low > 0 and (failed == MOST_FAILURES or leap > LARGEST_GAP * whole):
            self._fraction = ((high if failed == MOST_FAILURES else fraction) - low) / 2
            return self._seek(low), low
        return self._seek(high), high

    def _bifurcation_point(
        self,
        fractions: tuple[float, float],
        pair: tuple[Candidate, Candidate],
        ends: tuple[Candidate, Candidate],
        fraction: float,
    ) -> tuple[Candidate, float]:
        """Return the bifurcation point between two nearby states, and its fraction of the step.

        Close to the point, round-off and residuals of the solver would move the state along the
        mode, perhaps to the other branch.  So a cubic between the two states gives the motion along
        the mode and the direction of the path.  The stiffness is from the second state.

        Raises:
            StepFailed: The point is no bifurcation point, or was not found.
        """
        corrector, to_plane = self.corrector, self._simulation.supports.into_plane
        (first, last), (before, after) = pair, ends
        whole, stiffness = last.end - first.end, last.stiffness
        if not whole[-1] * first.direction[-1] * last.direction[-1]:
            raise StepFailed("the load factor turns here")
        speeds = [whole[-1] / state.direction[-1] * state.direction for state in pair]
        path = scipy.interpolate.CubicHermiteSpline([0.0, 1.0], [first.end, last.end], speeds)
        (x0, λ0), (x, λ) = ((float(k), state.stiffness.softest[0]) for k, state in enumerate(pair))
        for _ in range(MOST_CROSSING_STEPS):
            x0, x = x, (x0 * λ - x * λ0) / (λ - λ0) if λ != λ0 else math.nan
            if not 0.0 <= x <= 1.0:
                break
            end, direction = path(x), path(x, 1)  # the load factor is linear in x
            mode = np.array(stiffness.softest[1][corrector.subdomain.dofs])
            to_plane(seen := mode.copy())
            weights = corrector.weights[:-1]
            speed = corrector.along(weights * seen, direction[:-1]) / direction[-1]
            corrector.crossing = Crossing(end - corrector.start, weights * mode, speed)
            reached = (1 - x) * fractions[0] + x * fractions[1]
            try:
                candidate = self._seek(reached)
            finally:
                corrector.crossing = None
            stiffness = candidate.stiffness
            λ0, λ = λ, stiffness.softest[0]
            converged = abs(x - x0) * (fractions[1] - fractions[0]) <= LOCATION_TOLERANCE * fraction
            if not converged and abs(λ) < abs(λ0) / 2:
                continue
            # An eigenvalue that no longer falls is round-off.
            if not _soft(candidate, first, last) or not _no_work(candidate, before, after):
                break
            sign = 1.0 if direction[-1] * first.direction[-1] > 0 else -1.0
            direction = sign / corrector.length(direction) * direction
            to_plane(mode := np.array(stiffness.softest[1][corrector.subdomain.dofs]))
            return self._candidate(candidate.trial, last.stiffness, direction, mode), reached
        raise StepFailed("no bifurcation point was found")

    def _turned(self, candidate: Candidate) -> bool:
        """Return whether the load factor has reversed its direction since the step began."""
        return bool(candidate.direction[-1] * self.corrector.direction[-1] < 0)

    def _store(self, candidate: Candidate, before: Array, n: int, limit: bool) -> None:
        """Store state n of the path as a critical point; ``candidate`` is at or beyond it."""
        corrector, simulation, direction = self.corrector, self._simulation, candidate.direction
        if limit:
            # At a limit point the path is tangent to the mode.
            mode = np.asarray(direction[:-1] / corrector.size(direction[:-1]))
        elif candidate.mode is not None:
            mode = candidate.mode
        else:
            mode = np.array(candidate.stiffness.softest[1][corrector.subdomain.dofs])
            simulation.supports.into_plane(mode)
            # A singular stiffness gives no accurate component along the mode; it stays as before.
            along = corrector.along(corrector.weights[:-1] * mode, (direction - before)[:-1])
            turned = direction - along * np.append(mode, 0.0)
            corrector.direction = corrector.carried(turned, candidate.trial)
        kind = "limit" if limit else "bifurcation"
        state = simulation.snapshot()
        mode = corrector.subdomain.gather(corrector.carried(mode, candidate.trial))
        self.critical.append(CriticalPoint(kind, simulation.t, n, state, mode))


def _vanishes(what: str, candidate: Candidate, before: Candidate, after: Candidate) -> bool:
    """Return whether the attribute ``what`` is nearly zero, relative to states on both sides."""
    size, *ends = (getattr(x, what) for x in (candidate, before, after))
    return bool(size < SINGULAR_RATIO * max(ends))


def _no_work(candidate: Candidate, before: Candidate, after: Candidate) -> bool:
    """Return whether the load does no work on the critical mode, apart from round-off."""
    least = NO_WORK * candidate.stiffness.most_work
    return candidate.work < least or _vanishes("work", candidate, before, after)


def _soft(candidate: Candidate, before: Candidate, after: Candidate) -> bool:
    """Return whether an eigenvalue is small, relative to its values at the ends of a step."""
    return candidate.softness < SOFT * max(before.softness, after.softness)
