# SPDX-License-Identifier: MIT
"""Steps of path following, and location of the critical points that they pass."""

from __future__ import annotations

from collections.abc import Callable
from typing import NamedTuple

import numpy as np

from ufl_beam.analysis.critical_points import Branch, CriticalPoint, Direction, Stiffness
from ufl_beam.analysis.path_corrector import Control, GivenLoadFactor, PathCorrector
from ufl_beam.errors import StepFailed
from ufl_beam.simulation.simulation import Simulation
from ufl_beam.simulation.step_solver import Trial

ADVICE = (
    "Try a shorter step or another control: ArcLength goes through limit points of loads and of "
    "displacements, DissipationControl through softening that snaps back"
)

SMALLEST_STEP_PART = 2.0**-12  # a step is cut down to this part of it
TARGET_ITERATIONS = 12  # steps of more are followed by shorter ones, of fewer by longer ones
MOST_FAILURES = 4  # of steps, before a critical point is sought from another state
LOCATION_TOLERANCE = 1e-7  # critical points are located to this part of a step
MOST_LOCATION_STEPS = 60  # steps in which a critical point is sought
LEAST_COSINE = 0.5  # cosine of the angle by which a step may leave the direction of its predictor
LARGEST_LENGTH_RATIO = 10.0  # ratio by which a step may be longer than its predictor
UNCHECKED_PART = 2.0**-6  # part of a step up to which that is not asked: a law may have a kink
SAME_POINT_PART = 1e-3  # within this part of a step a critical point is the one just reached
SINGULAR_RATIO = 1e-3  # part of its size at the ends of a step below which what vanishes is zero


class Candidate(NamedTuple):
    """End of a step that may be accepted, with the stiffness and the path's direction there."""

    trial: Trial
    stiffness: Stiffness
    way: Direction

    def passed(self, before: Candidate) -> bool:
        """Return whether an eigenvalue passed zero, or the load factor turned, since ``before``."""
        turned = (self.way.t < 0) != (before.way.t < 0)
        return turned or self.stiffness.passed(before.stiffness)


class PathStepper:
    """Stepper of a path: it sets lengths of steps and locates critical points."""

    def __init__(self, simulation: Simulation, control: Control) -> None:
        self._corrector, self._control = PathCorrector(simulation, control.factor), control
        self.critical: list[CriticalPoint] = []
        self._weights = simulation.share.gather(self._corrector.weights)
        self._part = 1.0
        self._before: Candidate | None = None
        self._landed = False

    def begin(self, branch: Branch | None, *, fresh: bool) -> None:
        """Find the direction in which the path begins; if fresh, its first equilibrium too."""
        corrector, simulation = self._corrector, self._corrector.simulation
        if branch is not None:
            corrector.direction = Direction(branch.mode[corrector.share.dofs], 0.0)
            return
        try:
            if fresh:
                still = Direction(np.zeros(corrector.share.size), 0.0)
                simulation.accept(corrector.attempt(still, 0.0, GivenLoadFactor(corrector.t)))
            corrector.begin()
            way = corrector.direction_of(corrector.stiffness_at(simulation.q))
        except StepFailed as failure:
            simulation.give_up(failure, self._tried(), ADVICE)
        corrector.direction = way if self._control.begins_along(corrector, way) > 0 else -way

    def _tried(self) -> float:
        """The load factor at which the latest attempt began."""
        return self._corrector.simulation.t + self._corrector.sought.t

    def advance(self) -> None:
        """Take a step, a shorter one where it fails, only up to a critical point in it."""
        simulation = self._corrector.simulation
        while True:
            iterations = simulation.iterations
            try:
                found = self._seek(self._part)
                break
            except StepFailed as failure:
                self._part /= 2
                if self._part < SMALLEST_STEP_PART:
                    simulation.give_up(failure, self._tried(), ADVICE)
        count = simulation.iterations - iterations
        part, longer = self._part, min(2.0, TARGET_ITERATIONS / max(count, 1))
        self._part = min(1.0, part * longer)
        try:
            self._accept(found, part)
        except StepFailed as failure:
            simulation.give_up(failure, self._tried(), ADVICE)

    def _accept(self, found: Candidate, part: float) -> None:
        """Go to the end of a step, or to a critical point before it."""
        corrector, before = self._corrector, self._before
        if before is None or not found.passed(before):
            self._landed = False
            self._take(found)
            return
        after = found
        found, reached = self._locate(before, after, part)
        if self._landed and reached < SAME_POINT_PART * part:
            # The signs of one critical point need not change in the same last digit.
            self._landed = False
            self._take(self._seek(part))
            return
        self._landed = found.passed(before)
        limit = self._turns(found, before, after)
        if self._landed and not corrector.dissipates and corrector.dissipation(found.trial.q1) > 0:
            self._pass_kink(found, reached - 2 * LOCATION_TOLERANCE * part, part, limit)
            return
        # What yields or opens may change signs without an eigenvalue of zero.
        λ, *ends = (abs(one.stiffness.softest(self._weights)[0]) for one in (found, before, after))
        soft = limit or λ < SINGULAR_RATIO * max(ends)
        way = corrector.direction
        self._take(found)
        if self._landed and soft:
            self._note(found, way, len(corrector.simulation.solution.times), limit)

    def _pass_kink(self, after: Candidate, last: float, part: float, limit: bool) -> None:
        """Go to the last state in which nothing dissipates, if the load factor turns there."""
        corrector, before = self._corrector, self._corrector.direction
        if limit:
            if last > 0:
                self._take(self._seek(last))
            self._note(after, before, len(corrector.simulation.solution.times) - (last <= 0), limit)
        if not limit or last <= 0:
            self._take(self._seek(part))
            return
        self._before = after

    def _take(self, found: Candidate) -> None:
        corrector = self._corrector
        corrector.dissipates = corrector.dissipation(found.trial.q1) > 0.0
        corrector.simulation.accept(found.trial)
        corrector.direction, self._before = found.way, found

    def _seek(self, part: float) -> Candidate:
        corrector, simulation = self._corrector, self._corrector.simulation
        trial = self._control.solve_step(corrector, part)
        corrector.t = trial.step.t1
        stiffness = corrector.stiffness_at(trial.q1)
        way = corrector.direction_of(stiffness)
        gone = Direction(trial.q1 - simulation.q, trial.step.t1 - simulation.t)
        if part > UNCHECKED_PART:
            self._require_near(gone)
        if self._control.continues_along(corrector, gone, way) < 0:
            way = -way
        return Candidate(trial, stiffness, way)

    def _require_near(self, gone: Direction) -> None:
        """Raise if a step has left the direction in which it was sought."""
        corrector, factor = self._corrector, self._corrector.factor
        size, sought = (corrector.length(way, factor) for way in (gone, corrector.sought))
        aligned = corrector.product(gone, corrector.sought, factor) >= LEAST_COSINE * size * sought
        if not aligned or size > LARGEST_LENGTH_RATIO * sought:
            raise StepFailed("the path turns too sharply, or the step leaps to another branch")

    def _locate(self, before: Candidate, after: Candidate, part: float) -> tuple[Candidate, float]:
        """The first state whose signs have changed, and the part of the step that leads there.

        By false position with halved weights (Illinois).  Where a step in between fails, the
        last state before, for shorter steps from there.
        """
        measure = self._measure(after)
        low, high, here, there = 0.0, part, measure(before), -measure(after)
        last = failed = 0
        for _ in range(MOST_LOCATION_STEPS):
            if high - low <= LOCATION_TOLERANCE * part:
                break
            middle = (low * there - high * here) / (there - here)
            margin = min(0.01 * (high - low), LOCATION_TOLERANCE * part)
            middle = min(max(middle, low + margin), high - margin)
            try:
                found = self._seek(middle)
            except StepFailed:
                failed += 1
                if failed < MOST_FAILURES:
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
        if after.way.t * self._corrector.direction.t < 0:
            return self._slope
        return lambda found: abs(found.stiffness.softest(self._weights)[0])

    def _slope(self, found: Candidate) -> float:
        """Change of the load factor along the path over that of the configuration.

        As K q' = f t', a slope of zero means that the direction of the path is a critical one, and
        that the load f does work on it.  At a bifurcation it does none on the critical direction.
        """
        return abs(found.way.t) / self._corrector.size(found.way)

    def _turns(self, found: Candidate, before: Candidate, after: Candidate) -> bool:
        """Return whether the load factor turns in a state that was located between two others.

        Either it has turned there, as at a kink, or its slope vanishes.  The load factor and the
        eigenvalue need not change their signs in the same last digit.
        """
        if found.way.t * self._corrector.direction.t < 0:
            return True
        slope, *ends = (self._slope(one) for one in (found, before, after))
        return slope < SINGULAR_RATIO * max(ends)

    def _note(self, found: Candidate, before: Direction, n: int, limit: bool) -> None:
        """Remember the state as a critical point, the n-th of the path; ``found`` is beyond it."""
        corrector, simulation, way = self._corrector, self._corrector.simulation, found.way
        if limit:
            # At a limit point the path goes along the mode.
            mode = np.asarray(way.q / corrector.size(way), dtype=np.float64)
        else:
            critical = found.stiffness.softest(self._weights)[1]
            mode = np.asarray(critical[corrector.share.dofs], dtype=np.float64)
            simulation.supports.leave(mode)
            # What the path goes along the mode is lost in a singular stiffness.
            strayed = Direction(way.q - before.q, 0.0)
            along = corrector.product(strayed, Direction(mode, 0.0), 1.0)
            corrector.direction = Direction(way.q - along * mode, way.t)
        kind = "limit" if limit else "bifurcation"
        state = simulation.snapshot()
        mode = corrector.share.gather(mode)
        self.critical.append(CriticalPoint(kind, simulation.t, n, state, mode))
