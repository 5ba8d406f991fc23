# SPDX-License-Identifier: MIT
"""From coarse to fine until it is known which setting serves: the search of a trade-off."""

from __future__ import annotations

import math
from collections.abc import Sequence
from statistics import geometric_mean

import numpy as np

from ufl_beam.analysis.refinement_runs import Ladder, Rung
from ufl_beam.analysis.richardson import Cost, Cross, Level, size
from ufl_beam.analysis.targets import Choice, Found, Goal, Outlook
from ufl_beam.errors import SceneError, TradeoffError

PATIENCE = 4
"""Places on the ladder at which self-convergence may not be seen."""

TRIES = 6
"""Settings that are tried."""

CAREFUL = 2.0
"""Of settings that are tried, runs below are done three times; s."""

LAST_DIGITS = 1e-9
"""Changes up to this part of a quantity are rounding, or the tolerance of Newton's method."""

STEP_ORDER = 2.0
"""Order of the schemes, at most; that of cells is twice their degree."""


class Climb:
    """The search in one family of dials.

    Args:
        ladder: The runs.
        family: Number of the family.
        goal: What is asked.
    """

    def __init__(self, ladder: Ladder, family: int, goal: Goal) -> None:
        self._ladder, self._family, self._goal = ladder, family, goal
        # What runs of settings took, over the cost that was fitted: machines are noisy
        self._slower: list[float] = []

    def find(self, others: Sequence[Found]) -> Found | None:
        """The setting; none if ``others`` are better.

        Raises:
            TradeoffError: Self-convergence is not seen, or no setting serves.
        """
        base: Level = (0, 0)
        doubts: list[str] = []
        tried: list[Found] = []
        while True:
            outlook, doubt, moved = self._look(base)
            if outlook is None:
                doubts.append(doubt)
                if len(doubts) == PATIENCE:
                    raise self._refusal("self-convergence is not seen" + "".join(doubts))
                base = moved
                continue
            choice = self._goal.choose(outlook)
            if any(self._goal.hopeless(choice, one.choice) for one in others):
                return None
            i, j = outlook.finest
            more = (
                max(0, math.ceil(math.log2(choice.refine) - i)),
                max(0, math.ceil(choice.level - j)),
            )
            if choice.further and more == (0, 0):
                more = outlook.bottleneck(choice)
            if more != (0, 0):
                base = base[0] + more[0], base[1] + more[1]
                continue
            if not choice.serves:
                raise self._refusal(
                    f"no setting serves; the nearest takes {choice.seconds:.3g} s and has errors "
                    f"of {choice.ratio:.2g} {self._goal.measure}; steps and cells as they are "
                    "given are the coarsest, and the last digits of a quantity are not known"
                )
            found = self._attempt(choice, outlook)
            again = any(one.run is found.run for one in tried)
            tried.append(found)
            if self._goal.accepts(found):
                return found
            if again or len(tried) == TRIES:
                return min(self._all(outlook), key=self._goal.rank)
            self._slower.append(found.run.seconds * self._mean / choice.seconds)
            if found.ratio > choice.ratio:
                more = outlook.bottleneck(choice)
                base = base[0] + more[0], base[1] + more[1]

    def _look(self, base: Level) -> tuple[Outlook | None, str, Level]:
        """Return the findings of the runs around a base, or the reason why there are none."""
        i, j = base
        ladder, levels = self._ladder, Cross.levels(base)
        rungs = [Rung(self._family, 2 ** level[0], level[1]) for level in levels]
        ladder.climb(rungs[:1])  # tells how long the others take
        ladder.climb(rungs)
        failed = [f"\n  {ladder.dials(r)}: {ladder.failed[r]}" for r in rungs if r in ladder.failed]
        if failed:
            return None, "".join(failed), (i, j + 1)
        runs = {level: ladder.runs[rung] for level, rung in zip(levels, rungs, strict=True)}
        finest = runs[i, j + 2]
        units = self._goal.units({name: size(value) for name, value in finest.values.items()})
        orders = (2.0 * finest.dials.mesh.degree, STEP_ORDER)
        crosses = {}
        for name, unit in units.items():
            if unit == 0:
                raise SceneError(
                    f"tradeoff: quantity {name!r} is zero, so that no part of it can be a "
                    "tolerance; give tolerances by name, in units of the quantities"
                )
            values = {level: run.values[name] for level, run in runs.items()}
            floor = max(self._goal.negligible * unit, LAST_DIGITS * size(finest.values[name]))
            crosses[name] = Cross.of(values, base, orders, floor)
        doubts = [f"\n  {name}{cross}" for name, cross in crosses.items() if not cross.seen]
        if doubts:
            unseen = [cross for cross in crosses.values() if not cross.seen]
            cells = any(not (cross.cells.seen and cross.separate) for cross in unseen)
            steps = any(not (cross.steps.seen and cross.separate) for cross in unseen)
            where = f"\n  from {ladder.dials(rungs[0])} on:"
            return None, where + "".join(doubts), (i + cells, j + steps)
        done = [run for run in ladder.of(self._family) if run.rung.newton == 0]
        columns = zip(*((run.steps, run.cells, run.seconds) for run in done), strict=True)
        cost = Cost.of(*map(np.array, columns)).slower(self._mean)
        cells_now = runs[base].cells / rungs[0].refine
        return Outlook(crosses, cost, finest.steps / 2 ** (j + 2), cells_now, units), "", base

    def _attempt(self, choice: Choice, outlook: Outlook) -> Found:
        """Run a choice and compare it with the limits."""
        rung = Rung(self._family, choice.refine, choice.level)
        self._ladder.climb([rung], short=CAREFUL)
        if rung in self._ladder.failed:
            raise self._refusal(f"the chosen setting failed: {self._ladder.failed[rung]}")
        return Found(self._ladder.runs[rung], choice, outlook)

    def _all(self, outlook: Outlook) -> list[Found]:
        """All runs of the family as if they had been chosen."""
        found = []
        for run in self._ladder.of(self._family):
            refine, level = run.rung.refine, run.rung.level
            ratio = outlook.ratio(refine, level)
            found.append(
                Found(run, Choice(refine, level, run.seconds, ratio, True, False), outlook)
            )
        return found

    @property
    def _mean(self) -> float:
        return geometric_mean(self._slower or [1.0])

    def _refusal(self, message: str) -> TradeoffError:
        return TradeoffError(message, tuple(self._ladder.of(self._family)))
