# SPDX-License-Identifier: MIT
"""Steps of path following, and location of the critical points that they pass."""

from __future__ import annotations

from collections.abc import Callable
from typing import NamedTuple

import numpy as np

from ufl_beam.analysis.critical_points import Branch, CriticalPoint, Direction, Stiffness
from ufl_beam.analysis.path_corrector import Control, PathCorrector, Plane
from ufl_beam.errors import StepFailed
from ufl_beam.simulation.simulation import Simulation
from ufl_beam.simulation.step_solver import Trial

SMALLEST_STEP_PART = 2.0**-12  # a step is cut down to this part of it
TARGET_ITERATIONS = 12  # steps of more are followed by shorter ones, of fewer by longer ones
MOST_FAILURES = 4  # of steps, before a critical point is sought from another state
LOCATION_TOLERANCE = 1e-7  # critical points are located to this part of a step
MOST_LOCATION_STEPS = 60  # steps in which a critical point is sought
LEAST_COSINE = 0.5  # cosine of the angle by which a step may leave the direction of its predictor
LARGEST_LENGTH_RATIO = 10.0  # ratio by which a step may be longer than its predictor
UNCHECKED_PART = 2.0**-6  # shorter parts of a step may leave it: a law may have a kink
SAME_POINT_PART = 1e-3  # within this part of a step a critical point is the one just reached
LEAP_PART = 0.1  # part of a step by which states before and at a critical point never differ
SINGULAR_RATIO = 1e-3  # what is below this part of its size at the ends of a step vanishes


class Candidate(NamedTuple):
    """End of a step that may be accepted, with the stiffness and the direction of the path."""

    trial: Trial
    stiffness: Stiffness
    way: Direction

    @property
    def end(self) -> Direction:
        """State and load factor."""
        return Direction(self.trial.q1, self.trial.step.t1)

    def passed(self, before: Candidate) -> bool:
        """Return whether an eigenvalue passed zero, or the load factor turned, since ``before``."""
        turned = (self.way.t < 0) != (before.way.t < 0)
        return turned or self.stiffness.passed(before.stiffness)


class PathStepper:
    """Stepper of a path: it sets lengths of steps and locates critical points."""

    def __init__(self, simulation: Simulation, control: Control) -> None:
        self._simulation, self._control = simulation, control
        self._corrector = PathCorrector(simulation, control.factor)
        self.critical: list[CriticalPoint] = []
        self._weights = simulation.share.gather(self._corrector.weights)
        self._part = 1.0
        self._before: Candidate | None = None
        self._landed = False

    def begin(self, branch: Branch | None, *, fresh: bool) -> None:
        """Find the direction in which the path begins; if fresh, its first equilibrium too."""
        corrector, simulation = self._corrector, self._simulation
        if branch is not None:
            corrector.direction = Direction(branch.mode[corrector.share.dofs], 0.0)
            return
        if fresh:
            none = np.zeros(corrector.share.size)
            still, factor = Direction(none, 0.0), Direction(none, 1.0)
            # The load factor is given: it ends where it is, 1 beyond one that is smaller by 1.
            given = Plane(corrector, factor, 1.0, corrector.start + -factor)
            simulation.accept(corrector.attempt(still, given))
        corrector.begin()
        way = corrector.direction_of(corrector.stiffness_at(simulation.q))
        corrector.direction = way if self._control.sense(corrector, way, None) > 0 else -way

    @property
    def tried(self) -> float:
        """Load factor at which the latest attempt began."""
        return self._simulation.t + self._corrector.sought.t

    def advance(self) -> None:
        """Take a step, a shorter one where it fails, only up to a critical point in it.

        Raises:
            StepFailed: Even the shortest one fails.
        """
        while True:
            iterations = self._simulation.iterations
            try:
                found = self._seek(self._part)
                break
            except StepFailed:
                self._part /= 2
                if self._part < SMALLEST_STEP_PART:
                    raise
        count, part = self._simulation.iterations - iterations, self._part
        self._part = min(1.0, part * min(2.0, TARGET_ITERATIONS / max(count, 1)))
        self._accept(found, part)

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
        # The load factor has turned in the state that was found, as at a kink, or its slope
        # vanishes.  It and the eigenvalue need not change their signs in the same last digit.
        limit = self._turned(found) or _vanishes(self._slope, found, before, after)
        if self._landed and not corrector.dissipates and corrector.dissipation(found.trial.q1) > 0:
            self._pass_kink(found, reached - 2 * LOCATION_TOLERANCE * part, part, limit)
            return
        # What yields or opens may change signs without an eigenvalue of zero.
        soft = limit or _vanishes(self._softness, found, before, after)
        way = corrector.direction
        self._take(found)
        if self._landed and soft:
            self._note(found, way, len(self._simulation.solution), limit)

    def _pass_kink(self, after: Candidate, last: float, part: float, limit: bool) -> None:
        """Go to the last state in which nothing dissipates, if the load factor turns there."""
        before, n = self._corrector.direction, len(self._simulation.solution)
        if limit and last > 0:
            self._take(self._seek(last))
            self._note(after, before, n, limit)
            self._before = after
            return
        if limit:
            self._note(after, before, n - 1, limit)
        self._take(self._seek(part))

    def _take(self, found: Candidate) -> None:
        corrector = self._corrector
        corrector.dissipates = corrector.dissipation(found.trial.q1) > 0.0
        self._simulation.accept(found.trial)
        corrector.direction, self._before = found.way, found

    def _seek(self, part: float) -> Candidate:
        corrector, simulation = self._corrector, self._simulation
        trial = self._control.solve_step(corrector, part)
        corrector.t = trial.step.t1
        stiffness = corrector.stiffness_at(trial.q1)
        way = corrector.direction_of(stiffness)
        gone = Direction(trial.q1 - simulation.q, trial.step.t1 - simulation.t)
        if part > UNCHECKED_PART:
            self._require_near(gone)
        if self._control.sense(corrector, way, gone) < 0:
            way = -way
        return Candidate(trial, stiffness, way)

    def _require_near(self, gone: Direction) -> None:
        """Raise if a step has left the direction in which it was sought."""
        corrector = self._corrector
        size, sought = (corrector.length(way) for way in (gone, corrector.sought))
        aligned = corrector.product(gone, corrector.sought) >= LEAST_COSINE * size * sought
        if not aligned or size > LARGEST_LENGTH_RATIO * sought:
            raise StepFailed("the path turns too sharply, or the step leaps to another branch")

    def _locate(self, before: Candidate, after: Candidate, part: float) -> tuple[Candidate, float]:
        """The first state whose signs have changed, and the part of the step that leads there.

        By false position with halved weights (Illinois).  Where a step in between fails, or the
        signs change in a leap to another branch, the last state before, for shorter steps from
        there.
        """
        measure = self._slope if self._turned(after) else self._softness
        below = self._corrector.start
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
                low, here, below = middle, measure(found), found.end
                there /= 2 if last == side else 1
            else:
                high, there = middle, -measure(found)
                here /= 2 if last == side else 1
            last = side
        found, start = self._seek(high), self._corrector.start
        leap, whole = (self._corrector.length(found.end + -one) for one in (below, start))
        if low > 0 and leap > LEAP_PART * whole:
            self._part = (part - low) / 2
            return self._seek(low), low
        return found, high

    def _turned(self, found: Candidate) -> bool:
        """Return whether the load factor goes the other way than before the step."""
        return found.way.t * self._corrector.direction.t < 0

    def _softness(self, found: Candidate) -> float:
        """Size of the eigenvalue nearest to zero; N m."""
        return abs(found.stiffness.softest(self._weights)[0])

    def _slope(self, found: Candidate) -> float:
        """Change of the load factor along the path over that of the configuration.

        As K q' = f t', a slope of zero means that the direction of the path is a critical one, and
        that the load f does work on it.  At a bifurcation it does none on the critical direction.
        """
        return abs(found.way.t) / self._corrector.size(found.way)

    def _note(self, found: Candidate, before: Direction, n: int, limit: bool) -> None:
        """Remember the state as a critical point, the n-th of the path; ``found`` is beyond it."""
        corrector, simulation, way = self._corrector, self._simulation, found.way
        if limit:
            # At a limit point the path goes along the mode.
            mode = np.asarray(way.q / corrector.size(way), dtype=np.float64)
        else:
            critical = found.stiffness.softest(self._weights)[1]
            mode = np.asarray(critical[corrector.share.dofs], dtype=np.float64)
            simulation.supports.leave(mode)
            # What the path goes along the mode is lost in a singular stiffness.
            strayed = Direction(way.q - before.q, 0.0)
            along = corrector.product(strayed, Direction(mode, 0.0))
            corrector.direction = Direction(way.q - along * mode, way.t)
        kind = "limit" if limit else "bifurcation"
        state = simulation.snapshot()
        mode = corrector.share.gather(mode)
        self.critical.append(CriticalPoint(kind, simulation.t, n, state, mode))


def _vanishes(
    measure: Callable[[Candidate], float], found: Candidate, before: Candidate, after: Candidate
) -> bool:
    """Return whether a measure is nearly zero in a state that was located between two others."""
    size, *ends = map(measure, (found, before, after))
    return size < SINGULAR_RATIO * max(ends)
