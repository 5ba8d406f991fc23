# SPDX-License-Identifier: MIT
"""Search of a trade-off: from coarse runs to the setting that serves, at a limited cost."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from fractions import Fraction

import numpy as np

from ufl_beam.analysis.refinement_runs import RefinementRuns
from ufl_beam.analysis.richardson import Cost, Cross, Level, size
from ufl_beam.analysis.targets import BUDGET_AIM, Choice, Prediction, Target
from ufl_beam.analysis.tradeoff_result import Refinement, Run
from ufl_beam.errors import SceneError, TradeoffError

MOST_DOUBTS, MOST_TRIALS = 4, 3  # refinements without self-convergence; settings tried
MOST_EFFORT = 10.0  # steps of all runs take at most so many times those of the recommended one
PILOT_EFFORT = 5.0  # the same of the runs before the first choice is tried
DOUBTFUL = 0.5  # part of that effort on the way to a choice by orders that are not trusted
LIMIT_SHARE = 0.2  # part of a tolerance up to which a limit may be uncertain
LEAST_PART = 0.1  # part of the error below which a dial is not refined to check it
LEAST_LARGER = 0.1  # errors of one run may be smaller than predicted by chance
LAST_RUNS = 2.0  # the choice itself, and once more with other options of Newton's method
GIVEN_UP = 2.0  # times the cost of another kind of settings, or its error, that is too much
RECEDING = 1.5  # a choice that grows by this factor shows that orders are not those of theory
MOST_LEVELS = 2  # levels by which a dial is refined at once: the estimates of coarse runs err
REACH = 3  # levels from a base to the finest choice by its runs, which is extrapolated by one
ROUNDING = 1e-9  # part of a quantity up to which changes are of rounding or Newton's method
STEP_ORDER = 2.0  # order of the schemes, at most; that of cells is twice their degree


@dataclass(frozen=True)
class Found:
    """Setting that was run, and what the runs of its family predict."""

    run: Run
    prediction: Prediction

    @property
    def choice(self) -> Choice:
        """The setting with its wall time and the predicted error."""
        _, refine, level, _ = self.run.refinement
        return self.prediction.choice(refine, level)._replace(seconds=self.run.seconds)

    @property
    def ratio(self) -> float:
        """Largest distance from a limit, in its unit."""
        return self.ratio_of(self.run)

    def ratio_of(self, run: Run) -> float:
        """Return the largest distance of a run from a limit, in its unit."""
        crosses = self.prediction.crosses
        return self.prediction.largest({n: run.values[n] - c.limit for n, c in crosses.items()})

    def rank(self, target: Target) -> tuple[bool, float]:
        """The least is the best."""
        return target.rank(self.run.seconds, self.ratio, self.choice.ratio)


class RefinementSearch:
    """Search with one scheme and kind of steps; its families differ in their cells."""

    def __init__(self, runs: RefinementRuns, families: Sequence[int], target: Target) -> None:
        self.family = families[0]
        self.notes: list[str] = []
        self._runs, self._families, self._target = runs, families, target

    def find(self, others: Sequence[Found]) -> Found:
        """Find the setting; TradeoffError if none serves, or ``others`` are better."""
        prediction = self._approach(others)
        tried: list[Found] = []
        while True:
            choice = self._target.choose(prediction)
            serves = self._target.serves(choice)
            if tried and not serves:
                break
            if not serves:
                raise TradeoffError(
                    f"no setting serves; the nearest takes {choice.seconds:.3g} s and has errors "
                    f"of {choice.ratio:.2g} {self._target.measure}; steps and cells as they are "
                    "given are the coarsest, and the last digits of a quantity are not known"
                )
            known = Refinement(self.family, *prediction.within_reach(choice))
            if known in (one.run.refinement for one in tried):
                break
            if tried and not self._runs.allowed([known]):
                break
            found = self._try(known, prediction)
            if not tried:
                found = self._checked(found)
            tried = [Found(one.run, found.prediction) for one in tried] + [found]
            last = found.run.stepping
            spent = self._stepping(prediction) + LAST_RUNS * last > MOST_EFFORT * last
            if self._target.accepts(found.run.seconds, found.ratio):
                return found
            if spent or len(tried) == MOST_TRIALS:
                break
            slower = found.run.seconds / prediction.seconds(*_parts(choice))
            larger = found.ratio / found.choice.likely if found.choice.likely > 0 else 1.0
            prediction = replace(
                found.prediction, larger=max(larger, LEAST_LARGER) * found.prediction.larger,
                cost=prediction.cost.slower(slower),
            )  # fmt: skip
        return min(tried, key=lambda one: one.rank(self._target))

    def _approach(self, others: Sequence[Found]) -> Prediction:
        """Run finer and finer settings until they predict the one that serves."""
        target, doubts = self._target, list[str]()
        base, whole, before = self._begin(doubts), False, math.inf
        while True:
            prediction, doubt, moved = self._predict(self.family, base, whole=whole)
            if prediction is None:
                base = self._doubt(doubts, doubt, moved)
                continue
            choice = target.choose(prediction)
            # On the way to what is doubtful less is spent: the choice may become cheaper.
            part = DOUBTFUL if whole and not prediction.trusted else 1.0
            if doubt and self._affords(prediction, choice, moved, whole=whole, part=part):
                base = self._doubt(doubts, doubt, moved)
                continue
            aim = target.objective(choice)
            if any(aim > GIVEN_UP * target.objective(one.choice) for one in others):
                raise TradeoffError("given up, others are better")
            most = 1 if whole and not prediction.trusted else MOST_LEVELS
            goal, serves = self._home(base, choice, most), target.serves(choice)
            if not serves and goal == base and choice.seconds <= BUDGET_AIM * target.bounds[0]:
                more = prediction.bottleneck(choice)
                goal = base[0] + more[0], base[1] + more[1]
            recedes, before = choice.seconds > RECEDING * before, choice.seconds
            if recedes and not whole:
                whole = True  # changes do not fall as in theory
            elif goal != base and self._affords(prediction, choice, goal, whole=whole, part=part):
                base = goal
            elif serves and not whole and self._affords(prediction, choice, base, whole=True):
                whole = True
            else:
                if doubt and not serves:
                    raise TradeoffError("self-convergence is not seen" + "".join([*doubts, doubt]))
                if doubt:
                    self.notes.append(f"the order of convergence is not seen:{doubt}")
                return prediction

    def _checked(self, found: Found) -> Found:
        """Sharpen the limits, if they are not known well, by a run that is twice as fine."""
        allowed = self._target.bounds[1]
        prediction, (family, refine, level, _) = found.prediction, found.run.refinement
        crosses, units = prediction.crosses, prediction.units
        unsure = max(cross.uncertainty / units[name] for name, cross in crosses.items())
        if unsure <= LIMIT_SHARE * allowed:
            return found
        i = math.log2(refine)
        parts = [
            max(getattr(cross, dial).at(at) / units[name] for name, cross in crosses.items())
            for dial, at in (("cells", i), ("steps", level))
        ]
        cells, steps = (part > LEAST_PART * sum(parts) for part in parts)
        finer = Refinement(family, refine * (1 + cells), level + steps)
        if self._runs.allowed([finer]):
            self._runs.run([finer])
        if finer not in self._runs.runs:
            return found
        fine = self._runs.runs[finer].values
        better = {
            name: cross.sharpened(
                found.run.values[name], fine[name], (i, level), (i + cells, level + steps)
            )
            for name, cross in crosses.items()
        }
        return Found(found.run, replace(prediction, crosses=better))

    def _begin(self, doubts: list[str]) -> Level:
        """Choose the family by coarse runs; return their base."""
        base, first = (0, 0), self._families[0]
        while True:
            prediction, doubt, moved = self._predict(first, base, whole=False)
            if prediction is not None:
                break
            base = self._doubt(doubts, doubt, moved)
        aims = {}
        for family in self._families:
            prediction, _, _ = self._predict(family, base, whole=False, steps_of=first)
            if prediction is not None:
                aims[family] = self._target.objective(self._target.choose(prediction))
        self.family = min(aims, key=aims.__getitem__)
        return base

    def _doubt(self, doubts: list[str], doubt: str, moved: Level) -> Level:
        """Note a doubt and return the base that follows; raise if there are too many."""
        doubts.append(doubt)
        if len(doubts) == MOST_DOUBTS:
            raise TradeoffError("self-convergence is not seen" + "".join(doubts))
        return moved

    def _home(self, base: Level, choice: Choice, most: int) -> Level:
        """Return the base from which three levels reach the choice, or one on the way there."""
        wanted = math.log2(choice.refine), choice.level
        i, j = (
            min(max(old, math.ceil(level - 1e-9) - REACH), old + most)
            for old, level in zip(base, wanted, strict=True)
        )
        return i, j

    def _try(self, one: Refinement, prediction: Prediction) -> Found:
        """Run a choice."""
        self._runs.run([one])
        if one in self._runs.failed:
            raise TradeoffError(f"the chosen setting failed: {self._runs.failed[one]}")
        return Found(self._runs.runs[one], prediction)

    def _stepping(self, prediction: Prediction) -> float:
        """Wall time of all steps so far, but for the noise that a fit smooths; s."""
        return sum(
            prediction.stepping(float(run.refinement.refine), 2**run.refinement.level)
            for family in self._families
            for run in self._runs.of(family)
        )

    def _affords(
        self, prediction: Prediction, choice: Choice, base: Level, *, whole: bool, part: float = 1.0
    ) -> bool:
        """Return whether the runs around a base may be done on the way to a choice."""
        more = sum(
            prediction.stepping(2 ** one[0], 2 ** one[1])
            for one in Cross.levels(base, whole=whole)
            if self._at(self.family, one) not in self._runs.runs
        )
        last = prediction.stepping(*_parts(choice))
        return self._stepping(prediction) + more <= part * PILOT_EFFORT * last

    @staticmethod
    def _at(family: int, level: Level) -> Refinement:
        return Refinement(family, Fraction(2) ** level[0], float(level[1]))

    def _predict(
        self, family: int, base: Level, *, whole: bool, steps_of: int | None = None
    ) -> tuple[Prediction | None, str, Level]:
        """Return what the runs around a base predict, doubts, and the next base if there are.

        The changes with the steps may be those of another family.
        """
        i, j = base
        runs, levels = self._runs, Cross.levels(base, whole=whole)
        wanted = [self._at(family, level) for level in levels]
        if steps_of is not None and steps_of != family:
            wanted[2] = self._at(steps_of, levels[2])
        runs.run(wanted[:1])  # tells how long the others take
        runs.run(wanted)
        failed = [f"\n  {runs.dials(r)}: {runs.failed[r]}" for r in wanted if r in runs.failed]
        if failed:
            return None, "".join(failed), (i, j + 1)
        at = {level: runs.runs[one] for level, one in zip(levels, wanted, strict=True)}
        finest = at[levels[-1]] if whole else at[levels[1]]
        units = self._target.units({name: size(value) for name, value in finest.values.items()})
        orders = (2.0 * finest.dials.mesh.degree, STEP_ORDER)
        crosses = {}
        for name, unit in units.items():
            if unit == 0:
                raise SceneError(
                    f"tradeoff: quantity {name!r} is zero, so that no part of it can be a "
                    "tolerance; give tolerances by name, in units of the quantities"
                )
            values = {level: run.values[name] for level, run in at.items()}
            if steps_of is not None:
                other = runs.runs[self._at(steps_of, base)].values[name]
                values[i, j + 1] = values[base] + values[i, j + 1] - other
            floor = max(self._target.negligible * unit, ROUNDING * size(finest.values[name]))
            crosses[name] = Cross.of(values, base, orders, floor)
        prediction = self._prediction(family, at[base], crosses, units)
        doubts = [f"\n  {name}{cross}" for name, cross in crosses.items() if not cross.seen]
        if not doubts:
            return prediction, "", base
        cells = any(not (one.cells.seen and one.separate) for one in crosses.values())
        steps = any(not (one.steps.seen and one.separate) for one in crosses.values())
        where = f"\n  from {runs.dials(wanted[0])} on:"
        return prediction, where + "".join(doubts), (i + cells, j + steps)

    def _prediction(
        self, family: int, first: Run, crosses: dict[str, Cross], units: dict[str, float]
    ) -> Prediction:
        """Return a prediction by the run of a base and the cost of all runs of its family."""
        done = [run for run in self._runs.of(family) if run.refinement.newton == 0]
        rows = [(run.steps, run.cells, run.building, run.stepping) for run in done]
        cost = Cost.of(*np.array(rows).T)
        steps, cells = first.steps / 2**first.refinement.level, first.cells
        return Prediction(
            crosses, cost, steps, cells / float(first.refinement.refine), units,
            divisor=self._runs.divisor(family), coarsest=Fraction(1, first.dials.mesh.degree),
            whole_steps=isinstance(first.dials.dt, float | int),
        )  # fmt: skip


def _parts(choice: Choice) -> tuple[float, float]:
    """Return the parts of cells and steps."""
    return float(choice.refine), 2**choice.level
