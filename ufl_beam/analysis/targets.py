# SPDX-License-Identifier: MIT
"""Targets of a trade-off, a tolerance or a time, and the setting that serves them best."""

from __future__ import annotations

import math
from collections.abc import Collection, Mapping
from dataclasses import dataclass, replace
from fractions import Fraction
from typing import NamedTuple, cast

import numpy as np
import numpy.typing as npt

from ufl_beam.analysis.richardson import UNSURE, Cost, Cross, size
from ufl_beam.arrays import Array
from ufl_beam.errors import SceneError, require_number

EXTRAPOLATED_LEVELS = 8  # levels beyond those that were run which a choice may ask for
CHOICES_PER_LEVEL = 24  # largest number of choices from one level of a dial to the next
BUDGET_AIM, BUDGET_SLACK = 0.9, 0.2  # part that is aimed at; part that a run may fall short by
LARGEST_ERROR = 0.3  # settings of larger errors, as parts of a quantity, are not recommended
NEARLY_BEST = 2.0  # if nothing serves, the cheapest up to so many times the least error is next
NEGLIGIBLE = 0.1  # changes up to this part of a tolerance need not converge
WORST_USED = 0.3  # part of a tolerance that errors of a recommended setting use up, if they can
LEAST_USED = 0.45  # the same of predicted errors, which may be wrong by a third
CHECKED = 1.5  # times as many cells and steps show how far a run is from the limit, or
IRREGULAR = 2.0  # so many times where changes do not fall with a whole order
ROUNDED = 1e-6  # by which a number of steps may be above a whole number
MOST_TRIED = 2000  # settings whose errors are looked at with their signs
MOST_USED = 0.85  # the largest predicted errors that are aimed at, for the same reason
CANCELLED = 1.3  # times the cost of a setting whose errors may cancel that another one may cost
CHANCE = 2.0  # the same for one that is, or is predicted to be, much more accurate than it must be


class Choice(NamedTuple):
    """Setting of a run with its predicted time and error."""

    refine: Fraction  # parts of each cell
    level: float  # steps are about 2**level times as many
    seconds: float  # wall time
    ratio: float  # largest error with half of its doubt, as a part of what is allowed
    likely: float  # the largest error itself


Fineness = tuple[Fraction, float]  # parts of each cell, and level of the steps


class Choices(NamedTuple):
    """All settings that may be chosen, as tables over cells and steps."""

    refine: list[Fraction]  # the rows
    level: list[float]  # the columns
    seconds: Array
    ratio: Array


@dataclass(frozen=True)
class Prediction:
    """Prediction of the errors and times of runs from those of their family."""

    crosses: Mapping[str, Cross]  # convergence of each quantity
    cost: Cost
    steps: float  # at level 0
    cells: float  # of the scene as it is
    units: Mapping[str, float]  # that errors are measured in, by quantity
    divisor: int  # all cells of a beam make a whole number in parts of one by so many
    coarsest: Fraction  # parts of each cell with as many nodes as the cells that were given
    whole_steps: bool  # whether steps are those of level 0, divided by whole numbers
    larger: float = 1.0  # factor by which errors of runs were larger than predicted

    @property
    def finest(self) -> tuple[int, int]:
        """Finest levels of cells and steps that were run."""
        cross = next(iter(self.crosses.values()))
        return cross.cells.finest, cross.steps.finest

    @property
    def trusted(self) -> bool:
        """True if all orders are those of theory, or nearly so."""
        return all(cross.cells.trusted and cross.steps.trusted for cross in self.crosses.values())

    @property
    def seen(self) -> bool:
        """True if three levels of each dial show how changes fall, or they are negligible."""
        dials = [dial for cross in self.crosses.values() for dial in (cross.cells, cross.steps)]
        return all(dial.used == 0 or not math.isnan(dial.order) for dial in dials)

    @property
    def unsure(self) -> float:
        """Largest uncertainty of a limit, in its unit."""
        return max(cross.uncertainty / self.units[n] for n, cross in self.crosses.items())

    def with_limits(self, known: Prediction) -> Prediction:
        """Return it with limits that other runs show."""
        crosses = {
            name: replace(
                cross, limit=known.crosses[name].limit, uncertainty=known.crosses[name].uncertainty
            )
            for name, cross in self.crosses.items()
        }
        return replace(self, crosses=crosses)

    def within_reach(self, choice: Choice) -> Fineness:
        """Return a choice, or what is nearest to it where orders can be relied on."""
        i, j = (level + 1 for level in self.finest)
        if self.trusted:
            return choice.refine, choice.level
        return min(choice.refine, Fraction(2**i)), min(choice.level, float(j))

    def choice(self, refine: Fraction, level: float) -> Choice:
        """Predict the time and the largest error, in its unit."""
        i, each = math.log2(refine), self.crosses.items()
        bound = max(cross.error(i, level) / self.units[name] for name, cross in each)
        likely = max(size(cross.lack(i, level)) / self.units[name] for name, cross in each)
        seconds = self.seconds(float(refine), 2**level)
        return Choice(refine, level, seconds, self.larger * bound, self.larger * likely)

    def seconds(self, refine: float, parts: float) -> float:
        """Predict the wall time; s."""
        return self.cost.seconds(self.steps * parts, self.cells * refine)

    def stepping(self, refine: float, parts: float) -> float:
        """Predict the wall time of the steps alone; s."""
        return self.cost.stepping(self.steps * parts, self.cells * refine)

    def bottleneck(self, choice: Choice) -> tuple[int, int]:
        """Refine by a level what has the larger part of the error, if that is not negligible."""
        i = math.log2(choice.refine)
        errors = {n: c.error(i, choice.level) / self.units[n] for n, c in self.crosses.items()}
        worst = self.crosses[max(errors, key=errors.__getitem__)]
        if worst.cells.at(i) > worst.steps.at(choice.level):
            return int(worst.cells.used > 0), 0
        return 0, int(worst.steps.used > 0)

    def finer(self, refine: Fraction, level: float, *, cells: bool, steps: bool) -> Fineness:
        """Return cells or steps, or both, that show how far a run is from the limit."""
        more = IRREGULAR if self.seen and not self.trusted else CHECKED
        if cells:
            refine = Fraction(math.ceil(more * refine * self.divisor), self.divisor)
        if steps:
            parts = more * 2**level
            level = math.log2(math.ceil(parts - ROUNDED) if self.whole_steps else parts)
        return refine, level

    def largest(self, differences: Mapping[str, Array]) -> float:
        """Return the largest of differences of the quantities, in its unit."""
        return max(size(d) / self.units[name] for name, d in differences.items())

    def choices(self) -> Choices:
        """List all settings that may be chosen."""
        i, j = (level + EXTRAPOLATED_LEVELS for level in self.finest)
        least = math.ceil(self.coarsest * self.divisor)
        refine = [Fraction(k, self.divisor) for k in _spread(least, self.divisor * 2**i)]
        parts = _spread(1, 2**j)  # whole: where the steps as given end, all others end as well
        if not self.whole_steps:
            parts = list(2 ** np.arange(0.0, j + 1e-9, 1 / CHOICES_PER_LEVEL))
        level = [math.log2(part) for part in parts]
        along = np.array([math.log2(r) for r in refine])
        each = [(cross, self.larger / self.units[n]) for n, cross in self.crosses.items()]
        ratio = np.max([
            scale * np.add.outer(
                [*map(cross.cells.half_sure, along)], [*map(cross.steps.half_sure, level)]
            )
            for cross, scale in each
        ], axis=0)  # fmt: skip
        cells = self.cells * np.array([float(r) for r in refine])[:, None]
        return Choices(refine, level, self.cost.seconds(self.steps * np.array(parts), cells), ratio)

    def cheapest(self, choices: Choices, allowed: npt.NDArray[np.bool_]) -> Choice:
        """Choose the cheapest of some, or one that is hardly dearer if its errors may cancel.

        What cancels is chance: such a run is more accurate than it must be.
        """
        order = np.argsort(np.where(allowed, choices.seconds, np.inf), axis=None, kind="stable")
        rows, columns = np.unravel_index(order[: min(MOST_TRIED, allowed.sum())], allowed.shape)
        accurate = None
        for row, column in zip(rows, columns, strict=True):
            one = self.choice(choices.refine[row], choices.level[column])
            if one.likely > MOST_USED:
                continue
            accurate = accurate or one
            most = CHANCE if accurate.likely < WORST_USED else CANCELLED
            if one.seconds > most * accurate.seconds:
                break
            if one.likely >= LEAST_USED:
                return one
        return accurate or self.choice(choices.refine[rows[0]], choices.level[columns[0]])


def _spread(first: int, last: int) -> list[int]:
    """Return whole numbers, all the small ones, and fewer of the large ones."""
    levels = math.log2(last / first)
    spread = first * 2 ** np.linspace(0.0, levels, 1 + round(levels * CHOICES_PER_LEVEL))
    return [int(one) for one in np.unique(np.round(spread))]


@dataclass(frozen=True)
class Tolerance:
    """Target of the cheapest setting whose errors are below tolerances."""

    absolute: Mapping[str, float]  # by quantity, in its unit; others have ``relative``
    relative: float  # part of the largest magnitude of a quantity
    negligible = NEGLIGIBLE  # changes up to this part of a unit need not converge
    measure = "tolerances"  # words for the sizes that errors are parts of
    bounds = math.inf, 1.0  # wall time (s) and ratio that are asked for

    def __str__(self) -> str:
        if not self.absolute:
            return f"errors of {self.relative:g} of each quantity"
        return "errors of " + ", ".join(f"{value:g} of {n}" for n, value in self.absolute.items())

    def units(self, scales: Mapping[str, float]) -> dict[str, float]:
        """Return the tolerance of each quantity, in its unit."""
        return {n: self.absolute.get(n, self.relative * scale) for n, scale in scales.items()}

    def choose(self, prediction: Prediction) -> Choice:
        """Choose the cheapest that is accurate enough, or else nearly as accurate as any."""
        choices = prediction.choices()
        most = max(1.0, NEARLY_BEST * float(choices.ratio.min()))
        return prediction.cheapest(choices, choices.ratio <= most)

    def serves(self, choice: Choice) -> bool:
        """Return whether a choice is accurate enough."""
        return choice.ratio <= 1.0

    def objective(self, choice: Choice) -> float:
        """Return what is to be small: the wall time; s."""
        return choice.seconds

    def accepts(self, seconds: float, ratio: float, unsure: float) -> bool:
        """Return whether it is accurate enough, and not much more."""
        return ratio >= WORST_USED and ratio + unsure <= 1.0

    def rank(
        self, seconds: float, ratio: float, unsure: float, expected: Choice
    ) -> tuple[bool, float]:
        """Rank by predicted time where accurate enough, else by errors, measured and predicted.

        What is accurate by chance, since errors of cells and steps cancel, does not count, or
        little: others are as accurate in what was not asked.
        """
        if ratio + unsure > 1.0 or expected.ratio > UNSURE:
            return True, ratio + expected.ratio
        return False, expected.seconds * (1.0 if ratio >= WORST_USED else CHANCE)


@dataclass(frozen=True)
class Budget:
    """Target of the most accurate setting that takes no longer; errors are parts of quantities."""

    seconds: float  # wall time of a run
    negligible = 0.0
    measure = "largest values"

    @property
    def bounds(self) -> tuple[float, float]:
        """Largest wall time (s) and largest error over tolerance."""
        return self.seconds, math.inf

    def __str__(self) -> str:
        return f"runs of {self.seconds:g} s"

    def units(self, scales: Mapping[str, float]) -> dict[str, float]:
        """Return the sizes of the quantities."""
        return dict(scales)

    def choose(self, prediction: Prediction) -> Choice:
        """Choose the most accurate that is fast enough, or the fastest."""
        refine, level, seconds, ratio = prediction.choices()
        fast = seconds <= BUDGET_AIM * self.seconds
        best = np.where(fast, ratio, np.inf).argmin() if fast.any() else seconds.argmin()
        row, column = np.unravel_index(best, ratio.shape)
        return prediction.choice(refine[row], level[column])

    def serves(self, choice: Choice) -> bool:
        """Return whether a choice is fast enough, and accurate enough to be recommended."""
        return choice.seconds <= BUDGET_AIM * self.seconds and choice.ratio <= LARGEST_ERROR

    def objective(self, choice: Choice) -> float:
        """Return what is to be small: the error."""
        return choice.ratio

    def accepts(self, seconds: float, ratio: float, unsure: float) -> bool:
        """Return whether it takes that time, and not much less."""
        return (1 - BUDGET_SLACK) * self.seconds <= seconds <= self.seconds

    def rank(
        self, seconds: float, ratio: float, unsure: float, expected: Choice
    ) -> tuple[bool, float]:
        """Rank by the expected error where fast enough, as a single one may be small by chance."""
        return (False, expected.ratio) if seconds <= self.seconds else (True, seconds)


Target = Tolerance | Budget


def target_of(
    quantities: Collection[str], tolerance: float | Mapping[str, float] | None, budget: float | None
) -> Target:
    """Return the target of a call for some quantities, checked."""
    if (tolerance is None) == (budget is None):
        raise SceneError("tradeoff: give either a tolerance or a budget")
    if budget is not None:
        require_number(budget, "tradeoff: budget", positive=True)
        return Budget(budget)
    if not isinstance(tolerance, Mapping):
        require_number(cast("float", tolerance), "tradeoff: tolerance", positive=True)
        return Tolerance({}, cast("float", tolerance))
    if set(tolerance) != set(quantities):
        raise SceneError(
            f"tradeoff: tolerance is of {', '.join(tolerance)}, quantities are "
            f"{', '.join(quantities)}; name the same"
        )
    for name, value in tolerance.items():
        require_number(value, f"tradeoff: tolerance of {name}", positive=True)
    return Tolerance(tolerance, 0.0)
