# SPDX-License-Identifier: MIT
"""Search of a trade-off: from coarse runs to the setting that serves, at a limited cost."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import replace
from fractions import Fraction

import numpy as np

from ufl_beam.analysis.found_setting import Found
from ufl_beam.analysis.refinement_runs import RefinementRuns
from ufl_beam.analysis.richardson import UNSURE, Cost, Cross, Level, size
from ufl_beam.analysis.targets import BUDGET_AIM, CANCELLED, Choice, Prediction, Target
from ufl_beam.analysis.tradeoff_result import Refinement
from ufl_beam.arrays import Array
from ufl_beam.errors import SceneError, TradeoffError

MOST_DOUBTS, MOST_TRIALS = 4, 3  # refinements without self-convergence; settings tried
MOST_EFFORT = 10.0  # steps of all runs take at most so many times those of the recommended one
PILOT_EFFORT = 4.0  # the same of the runs before the first choice is tried and checked
DOUBTFUL = 0.5  # part of that effort on the way to a choice by orders that are not trusted
SEEN = 2.0  # times that effort where the first choice has shown that orders must be seen
LIMIT_SHARE = 0.2  # part of a tolerance up to which a limit may be uncertain
LEAST_PART = 0.1  # part of the error below which a dial is not refined to check it
LEAST_LARGER = 0.1  # errors of one run may be smaller than predicted by chance
LEAST_ROOM = 0.3  # part of a tolerance below which the next choice is not, however unsure limits
GIVEN_UP = 2.0  # times the cost of another kind of settings, or its error, that is too much
RECEDING = 1.5  # a choice that grows by this factor shows that orders are not those of theory
MOST_LEVELS = 2  # levels by which a dial is refined at once: the estimates of coarse runs err
REACH = 3  # levels from a base to the finest choice by its runs, which is extrapolated by one
ROUNDING = 1e-9  # part of a quantity up to which changes are of rounding or Newton's method
STEP_ORDER = 2.0  # order of the schemes, at most; that of cells is twice their degree


class RefinementSearch:
    """Search with one scheme and kind of steps; its families differ in their cells."""

    def __init__(self, runs: RefinementRuns, families: Sequence[int], target: Target) -> None:
        self.family = families[0]
        self.notes: list[str] = []
        self._runs, self._families, self._target = runs, families, target
        self._predictions: dict[int, Prediction] = {}  # of the families, by their first runs
        self._base: Level = (0, 0)  # of the last runs

    def find(self, others: Sequence[Found]) -> Found:
        """Find the setting; TradeoffError if none serves, or ``others`` are better."""
        prediction = limits = self._approach(others)
        checked = False
        for trial in range(MOST_TRIALS):
            choice = self._target.choose(prediction)
            if not self._target.serves(choice):
                if trial > 0:
                    break
                raise TradeoffError(
                    f"no setting serves; the nearest takes {choice.seconds:.3g} s and has errors "
                    f"of {choice.ratio:.2g} {self._target.measure}; steps and cells as they are "
                    "given are the coarsest, and the last digits of a quantity are not known"
                )
            known = Refinement(self.family, *prediction.within_reach(choice))
            has = self._has(choice, limits)
            if self._coarsest(choice, limits):
                break
            if checked and (has or known in self._runs.runs or not self._worth(known, limits)):
                break
            if checked:
                found = self._try(known, limits)
            else:
                new = not has and known not in self._runs.runs
                found = self._best(limits) if has else self._try(known, limits)
                found, self.family, checked = self._checked(found, new), found.family, True
                more = None if found.clear(self._target) else self._seen(found)
                if more is not None:
                    prediction, limits, checked = more, more, False
                    continue
            limits, expected = found.prediction, found.expected
            larger = found.ratio / expected.likely if expected.likely > 0 else 1.0
            room = max(1 - found.unsure / self._target.bounds[1], LEAST_ROOM)
            larger = max(larger, LEAST_LARGER) / room
            slower = found.run.seconds / expected.seconds
            prediction = replace(limits, larger=larger, cost=limits.cost.slower(slower))
        return self._best(limits)

    def _seen(self, found: Found) -> Prediction | None:
        """Return what more runs around the base show, where only two levels are known.

        They are done at any effort if the limit is not known to a tolerance.
        """
        known, base = found.prediction, self._base
        wanted = [self._at(found.family, one) for one in Cross.levels(base, whole=True)]
        lost = known.unsure > self._target.bounds[1]
        much = not (lost or self._affords(known, found.choice, base, whole=True, part=SEEN))
        if known.seen or much or not self._runs.allowed(wanted):
            return None
        prediction, doubt, _ = self._predict(found.family, base, whole=True)
        return None if doubt else prediction

    def _best(self, limits: Prediction) -> Found:
        """Return the best of all runs, by the limits that are known now."""
        found = [
            Found(run, prediction.with_limits(limits))
            for family, prediction in (self._predictions | {self.family: limits}).items()
            for run in self._runs.of(family)
        ]
        return min(found, key=lambda one: one.rank(self._target))

    def _coarsest(self, choice: Choice, limits: Prediction) -> bool:
        """Return whether the settings as they were given, the coarsest, are clearly good enough."""
        best = self._best(limits)
        as_given = choice.level == 0 and choice.refine == best.run.refinement.refine <= 1
        return as_given and UNSURE * (best.ratio + best.unsure) <= self._target.bounds[1]

    def _has(self, choice: Choice, limits: Prediction) -> bool:
        """Return whether a run is what was asked for, and hardly worse than a choice."""
        best, target = self._best(limits), self._target
        near = target.objective(best.expected) <= CANCELLED * target.objective(choice)
        return near and best.accepted(target)

    def _worth(self, one: Refinement, limits: Prediction) -> bool:
        """Return whether another setting may be tried: if no run serves, or at little effort."""
        if not self._runs.allowed([one]):
            return False
        more = limits.stepping(float(one.refine), 2**one.level)
        little = self._stepping(limits) + more <= MOST_EFFORT * more
        return little or not self._best(limits).serves(self._target)

    def _approach(self, others: Sequence[Found]) -> Prediction:
        """Run finer and finer settings until they predict the one that serves."""
        target, doubts = self._target, list[str]()
        first = base = self._begin(doubts)
        given = self._predictions[self.family]
        if self._coarsest(target.choose(given), given):
            return given
        whole, before = False, math.inf
        while True:
            prediction, doubt, moved = self._predict(self.family, base, whole=whole)
            if prediction is None:
                base = self._doubt(doubts, doubt, moved)
                continue
            if base == first:
                known = [prediction, *self._predictions.values()]
                prediction = prediction.with_limits(min(known, key=lambda one: one.unsure))
            choice = target.choose(prediction)
            # On the way to what is doubtful less is spent: the choice may become cheaper.
            part = DOUBTFUL if whole and not prediction.trusted else 1.0
            if doubt and self._affords(prediction, choice, moved, whole=whole, part=part):
                base = self._doubt(doubts, doubt, moved)
                continue
            aim = target.objective(choice)
            if any(aim > GIVEN_UP * target.objective(one.choice) for one in others):
                raise TradeoffError("given up, others are better")
            if not doubt and (self._coarsest(choice, prediction) or self._has(choice, prediction)):
                return prediction
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

    def _checked(self, found: Found, new: bool) -> Found:
        """Sharpen the limits by a finer run, if they are not known well.

        They are if the prediction of a new run was right, or if orders were seen.
        """
        allowed = self._target.bounds[1]
        prediction, (family, refine, level) = found.prediction, found.run.refinement
        crosses, units = prediction.crosses, prediction.units
        right = new and abs(found.ratio - found.expected.likely) <= LIMIT_SHARE * allowed
        if found.unsure <= LIMIT_SHARE * allowed and (right or prediction.seen):
            return found
        i = math.log2(refine)
        parts = [
            max(getattr(cross, dial).at(at) / units[name] for name, cross in crosses.items())
            for dial, at in (("cells", i), ("steps", level))
        ]
        cells, steps = (part > LEAST_PART * sum(parts) for part in parts)
        finer = Refinement(family, *prediction.finer(refine, level, cells=cells, steps=steps))
        if self._runs.allowed([finer]):
            self._runs.run([finer])
        if finer not in self._runs.runs:
            return found
        fine, finer_at = self._runs.runs[finer].values, (math.log2(finer.refine), finer.level)
        better = {
            name: cross.sharpened(found.run.values[name], fine[name], (i, level), finer_at)
            for name, cross in crosses.items()
        }
        sharper = replace(prediction, crosses=better)
        return replace(found, prediction=min(prediction, sharper, key=lambda one: one.unsure))

    def _begin(self, doubts: list[str]) -> Level:
        """Choose the family by coarse runs; return their base."""
        base, first = (0, 0), self._families[0]
        while True:
            prediction, doubt, moved = self._predict(first, base, whole=False)
            if prediction is not None:
                break
            base = self._doubt(doubts, doubt, moved)
        self._predictions[first] = prediction
        for family in self._families[1:]:
            compared = self._compared(family, base, prediction)
            if compared is not None:
                self._predictions[family] = compared.with_limits(prediction)
        aims = {
            family: self._target.objective(self._target.choose(one))
            for family, one in self._predictions.items()
        }
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
        self, family: int, base: Level, *, whole: bool
    ) -> tuple[Prediction | None, str, Level]:
        """Return what the runs around a base predict, doubts, and the next base if there are."""
        (i, j), self._base = base, base
        runs, levels = self._runs, Cross.levels(base, whole=whole)
        wanted = [self._at(family, level) for level in levels]
        runs.run(wanted[:1])  # tells how long the others take
        runs.run(wanted)
        failed = [f"\n  {runs.dials(r)}: {runs.failed[r]}" for r in wanted if r in runs.failed]
        if failed:
            return None, "".join(failed), (i, j + 1)
        at = {level: runs.runs[one].values for level, one in zip(levels, wanted, strict=True)}
        prediction = self._prediction(family, base, at)
        crosses = prediction.crosses
        doubts = [f"\n  {name}{cross}" for name, cross in crosses.items() if not cross.seen]
        if not doubts:
            return prediction, "", base
        cells = any(not (one.cells.seen and one.separate) for one in crosses.values())
        steps = any(not (one.steps.seen and one.separate) for one in crosses.values())
        where = f"\n  from {runs.dials(wanted[0])} on:"
        return prediction, where + "".join(doubts), (i + cells, j + steps)

    def _compared(self, family: int, base: Level, known: Prediction) -> Prediction | None:
        """Return what one run predicts with the limits of another family, None if it failed.

        The error of its cells is the distance from the limit of the other one, and falls with the
        order in theory; the changes with the steps are those of the other one.
        """
        (i, j), one = base, self._at(family, base)
        self._runs.run([one])
        if one not in self._runs.runs:
            return None
        first, run = self._runs.runs[self._at(self.family, base)], self._runs.runs[one]
        left = 2.0 ** (-2 * run.dials.mesh.degree)
        at: dict[Level, dict[str, Array]] = {base: run.values, (i + 1, j): {}, (i, j + 1): {}}
        for name, cross in known.crosses.items():
            limit = first.values[name] + cross.cells.lack(i)
            at[i + 1, j][name] = limit + left * (run.values[name] - limit)
            at[i, j + 1][name] = run.values[name] + cross.steps.lack(j) - cross.steps.lack(j + 1)
        return self._prediction(family, base, at)

    def _prediction(
        self, family: int, base: Level, at: Mapping[Level, Mapping[str, Array]]
    ) -> Prediction:
        """Return a prediction by values around a base and the cost of all runs of its family."""
        first = self._runs.runs[self._at(family, base)]
        *_, finest = at.values()
        units = self._target.units({name: size(value) for name, value in finest.items()})
        orders = (2.0 * first.dials.mesh.degree, STEP_ORDER)
        crosses = {}
        for name, unit in units.items():
            if unit == 0:
                raise SceneError(
                    f"tradeoff: quantity {name!r} is zero, so that no part of it can be a "
                    "tolerance; give tolerances by name, in units of the quantities"
                )
            values = {level: run[name] for level, run in at.items()}
            floor = max(self._target.negligible * unit, ROUNDING * size(finest[name]))
            crosses[name] = Cross.of(values, base, orders, floor)
        rows = [(r.steps, r.cells, r.building, r.stepping) for r in self._runs.of(family)]
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
