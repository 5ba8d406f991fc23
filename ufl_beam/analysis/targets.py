# SPDX-License-Identifier: MIT
"""Targets of a trade-off, a tolerance or a time, and the setting that serves them best."""

from __future__ import annotations

import math
from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass
from itertools import product
from typing import NamedTuple, cast

from ufl_beam.analysis.richardson import Cost, Cross, size
from ufl_beam.arrays import Array
from ufl_beam.errors import SceneError, require_number

STEPS_PER_LEVEL = 16  # choices of steps from one level of refinement to the next
EXTRAPOLATED_LEVELS = 2  # levels beyond those that were run which a choice may ask for
BUDGET_AIM, BUDGET_SLACK = 0.9, 0.2  # part that is aimed at; part that a run may fall short by
LARGEST_ERROR = 0.3  # settings of larger errors, as parts of a quantity, are not recommended
NEARLY_BEST = 2.0  # if nothing serves, the cheapest up to so many times the least error is next
NEGLIGIBLE = 0.1  # changes up to this part of a tolerance need not converge


class Choice(NamedTuple):
    """Setting of a run with its predicted time and error."""

    refine: int  # parts of each cell
    level: float  # steps are about 2**level times as many
    seconds: float  # wall time
    ratio: float  # largest error, as a part of what is allowed, or of the quantity


@dataclass(frozen=True)
class Prediction:
    """Prediction of the errors and times of runs from those of their family."""

    crosses: Mapping[str, Cross]  # convergence of each quantity
    cost: Cost
    steps: float  # at level 0
    cells: float  # of the scene as it is
    units: Mapping[str, float]  # that errors are measured in, by quantity

    @property
    def finest(self) -> tuple[int, int]:
        """Finest levels of cells and steps that were run."""
        cross = next(iter(self.crosses.values()))
        return cross.cells.finest, cross.steps.finest

    def ratio(self, refine: int, level: float) -> float:
        """Predict the largest error, in its unit."""
        i = math.log2(refine)
        return max(cross.error(i, level) / self.units[name] for name, cross in self.crosses.items())

    def bottleneck(self, choice: Choice) -> tuple[int, int]:
        """Refine by a level what has the larger part of the error, if that is not negligible."""
        i = math.log2(choice.refine)
        errors = {n: c.error(i, choice.level) / self.units[n] for n, c in self.crosses.items()}
        worst = self.crosses[max(errors, key=errors.__getitem__)]
        if worst.cells.at(i) > worst.steps.at(choice.level):
            return int(worst.cells.used > 0), 0
        return 0, int(worst.steps.used > 0)

    def largest(self, differences: Mapping[str, Array]) -> float:
        """Return the largest of differences of the quantities, in its unit."""
        return max(size(d) / self.units[name] for name, d in differences.items())

    def choices(self) -> list[Choice]:
        """List all settings that may be chosen."""
        i, j = self.finest
        refinements = range(1, 2 ** (i + EXTRAPOLATED_LEVELS) + 1)
        levels = range(STEPS_PER_LEVEL * (j + EXTRAPOLATED_LEVELS) + 1)
        choices = []
        for refine, k in product(refinements, levels):
            level = k / STEPS_PER_LEVEL
            seconds = self.cost.seconds(self.steps * 2**level, self.cells * refine)
            choices.append(Choice(refine, level, seconds, self.ratio(refine, level)))
        return choices


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

    def choose(self, choices: Sequence[Choice]) -> Choice:
        """Choose the cheapest that is accurate enough, or else nearly as accurate as any."""
        most = max(1.0, NEARLY_BEST * min(one.ratio for one in choices))
        return min((one for one in choices if one.ratio <= most), key=self.objective)

    def serves(self, choice: Choice) -> bool:
        """Return whether a choice is accurate enough."""
        return choice.ratio <= 1.0

    def objective(self, choice: Choice) -> float:
        """Return what is to be small: the wall time; s."""
        return choice.seconds

    def accepts(self, seconds: float, ratio: float) -> bool:
        """Return whether it is accurate enough."""
        return ratio <= 1.0

    def rank(self, seconds: float, ratio: float, expected: float) -> tuple[bool, float]:
        """Rank by time where accurate enough, else by error."""
        return (False, seconds) if ratio <= 1.0 else (True, ratio)


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

    def choose(self, choices: Sequence[Choice]) -> Choice:
        """Choose the most accurate that is fast enough, or the fastest."""
        fast = (one for one in choices if one.seconds <= BUDGET_AIM * self.seconds)
        fastest = min(choices, key=lambda one: one.seconds)
        return min(fast, key=self.objective, default=fastest)

    def serves(self, choice: Choice) -> bool:
        """Return whether a choice is fast enough, and accurate enough to be recommended."""
        return choice.seconds <= BUDGET_AIM * self.seconds and choice.ratio <= LARGEST_ERROR

    def objective(self, choice: Choice) -> float:
        """Return what is to be small: the error."""
        return choice.ratio

    def accepts(self, seconds: float, ratio: float) -> bool:
        """Return whether it takes that time, and not much less."""
        return (1 - BUDGET_SLACK) * self.seconds <= seconds <= self.seconds

    def rank(self, seconds: float, ratio: float, expected: float) -> tuple[bool, float]:
        """Rank by the expected error where fast enough, as a single one may be small by chance."""
        return (False, expected) if seconds <= self.seconds else (True, seconds)


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
