# SPDX-License-Identifier: MIT
"""Targets of a trade-off, a tolerance or a time, and the setting that serves them best."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from typing import NamedTuple, Protocol

import numpy as np

from ufl_beam.analysis.refinement_runs import Run
from ufl_beam.analysis.richardson import Cost, Cross, size
from ufl_beam.arrays import Array

FINE = 16
"""Choices of steps from one level to the next."""

AHEAD = 2
"""Levels beyond those that were run which a choice may ask for."""

FILL = 0.9
"""Part of a budget that is aimed at."""

SLACK = 0.2
"""Part of a budget by which a run may miss it."""

ROUGH = 0.3
"""Errors of this part of a quantity are none to recommend."""

NEARLY = 2.0
"""Where nothing is accurate enough, the cheapest with so many times the least error is next."""

NEGLIGIBLE = 0.1
"""Changes up to this part of a tolerance need not converge."""


class Choice(NamedTuple):
    """A setting and what is expected of it.

    Attributes:
        refine: Parts of each cell.
        level: Steps are about ``2**level`` times as many.
        seconds: Wall time; s.
        ratio: Largest error, as a part of what is allowed, or of the quantity.
        serves: Whether it does what is asked.
        further: If not, whether one may that is finer than those that were run.
    """

    refine: int
    level: float
    seconds: float
    ratio: float
    serves: bool
    further: bool


@dataclass(frozen=True)
class Outlook:
    """Prediction of runs from those of their family.

    Attributes:
        crosses: How each quantity converges.
        cost: Wall time.
        steps: At level 0.
        cells: Of the scene as it is.
        units: What errors are measured in, by quantity.
    """

    crosses: Mapping[str, Cross]
    cost: Cost
    steps: float
    cells: float
    units: Mapping[str, float]

    @property
    def finest(self) -> tuple[int, int]:
        """Finest levels of cells and steps that were run."""
        cross = next(iter(self.crosses.values()))
        return cross.cells.finest, cross.steps.finest

    def ratio(self, refine: int, level: float) -> float:
        """Largest error, in its unit."""
        i = math.log2(refine)
        return max(cross.error(i, level) / self.units[name] for name, cross in self.crosses.items())

    def bottleneck(self, choice: Choice) -> tuple[int, int]:
        """A level more of the dial, cells or steps, that has the larger part of the error.

        None if that is negligible already.
        """
        i = math.log2(choice.refine)
        errors = {n: c.error(i, choice.level) / self.units[n] for n, c in self.crosses.items()}
        worst = self.crosses[max(errors, key=errors.__getitem__)]
        if worst.cells.at(i) > worst.steps.at(choice.level):
            return int(worst.cells.used > 0), 0
        return 0, int(worst.steps.used > 0)

    def largest(self, differences: Mapping[str, Array]) -> float:
        """Largest of differences of the quantities, in its unit."""
        return max(size(d) / self.units[name] for name, d in differences.items())

    def seconds(self, refine: int, level: float) -> float:
        """Predicted wall time of a run; s."""
        return self.cost.seconds(self.steps * 2**level, self.cells * refine)

    def settings(self) -> tuple[list[tuple[int, float]], Array, Array]:
        """All that may be chosen, with wall times and ratios."""
        i, j = self.finest
        levels = np.arange(0, FINE * (j + AHEAD) + 1) / FINE
        all_ = [(r, float(x)) for r in range(1, 2 ** (i + AHEAD) + 1) for x in levels]
        seconds = np.array([self.seconds(*one) for one in all_])
        return all_, seconds, np.array([self.ratio(*one) for one in all_])


@dataclass(frozen=True)
class Found:
    """A setting that was run.

    Attributes:
        run: With it.
        choice: What was expected of it.
        outlook: What that came from.
    """

    run: Run
    choice: Choice
    outlook: Outlook

    @property
    def limits(self) -> dict[str, Array]:
        """Limits of the quantities."""
        return {name: cross.limit for name, cross in self.outlook.crosses.items()}

    @property
    def ratio(self) -> float:
        """Largest distance from a limit, in its unit."""
        lacks = {name: self.run.values[name] - limit for name, limit in self.limits.items()}
        return self.outlook.largest(lacks)


class Goal(Protocol):
    """A tolerance or a budget."""

    negligible: float
    """Part of the unit of a quantity up to which changes need not converge."""

    measure: str
    """Return the sizes that errors are parts of."""

    @property
    def bounds(self) -> tuple[float, float]:
        """Wall time and ratio that are asked for; s; infinite where none is."""

    def units(self, scales: Mapping[str, float]) -> dict[str, float]:
        """Return the units of errors by quantity, from the sizes of the quantities."""

    def choose(self, outlook: Outlook) -> Choice:
        """The setting that serves best."""

    def hopeless(self, choice: Choice, best: Choice) -> bool:
        """Return whether a choice cannot be better than another one."""

    def accepts(self, found: Found) -> bool:
        """Return whether a run does what is asked."""

    def rank(self, found: Found) -> tuple[bool, float]:
        """The least is the best."""


@dataclass(frozen=True)
class Tolerance:
    """The cheapest setting whose errors are below tolerances.

    Args:
        absolute: By quantity, in its unit; others have ``relative``.
        relative: Part of the largest magnitude of a quantity.
    """

    absolute: Mapping[str, float]
    relative: float
    negligible = NEGLIGIBLE
    measure = "tolerances"

    @property
    def bounds(self) -> tuple[float, float]:
        """Largest wall time (s) and largest error over tolerance."""
        return math.inf, 1.0

    def __str__(self) -> str:
        if not self.absolute:
            return f"errors of {self.relative:g} of each quantity"
        return "errors of " + ", ".join(f"{value:g} of {n}" for n, value in self.absolute.items())

    def units(self, scales: Mapping[str, float]) -> dict[str, float]:
        """Tolerance of each quantity, in its unit."""
        return {n: self.absolute.get(n, self.relative * scale) for n, scale in scales.items()}

    def choose(self, outlook: Outlook) -> Choice:
        """The cheapest that is accurate enough, or else nearly as accurate as any."""
        settings, seconds, ratios = outlook.settings()
        good = ratios <= max(1.0, NEARLY * ratios.min())
        k = int(np.argmin(np.where(good, seconds, np.inf)))
        serves = bool(ratios[k] <= 1.0)
        return Choice(*settings[k], float(seconds[k]), float(ratios[k]), serves, not serves)

    def hopeless(self, choice: Choice, best: Choice) -> bool:
        """Return whether it would take much longer."""
        return choice.seconds > 2 * best.seconds

    def accepts(self, found: Found) -> bool:
        """Return whether it is accurate enough."""
        return found.ratio <= 1.0

    def rank(self, found: Found) -> tuple[bool, float]:
        """By time where accurate enough, else by error."""
        good = self.accepts(found)
        return not good, found.run.seconds if good else found.ratio


@dataclass(frozen=True)
class Budget:
    """The most accurate setting that takes no longer; errors are parts of the quantities.

    Args:
        seconds: Wall time of a run; s.
    """

    seconds: float
    negligible = 0.0
    measure = "largest values"

    @property
    def bounds(self) -> tuple[float, float]:
        """Largest wall time (s) and largest error over tolerance."""
        return self.seconds, math.inf

    def __str__(self) -> str:
        return f"runs of {self.seconds:g} s"

    def units(self, scales: Mapping[str, float]) -> dict[str, float]:
        """The sizes of the quantities."""
        return dict(scales)

    def choose(self, outlook: Outlook) -> Choice:
        """The most accurate that is fast enough, or the fastest."""
        settings, seconds, ratios = outlook.settings()
        fast = seconds <= FILL * self.seconds
        k = int(np.argmin(np.where(fast, ratios, np.inf) if fast.any() else seconds))
        good = bool(ratios[k] <= ROUGH)
        numbers = float(seconds[k]), float(ratios[k])
        return Choice(*settings[k], *numbers, bool(fast[k]) and good, bool(fast[k]) and not good)

    def hopeless(self, choice: Choice, best: Choice) -> bool:
        """Return whether it would be much less accurate."""
        return choice.ratio > 2 * best.ratio

    def accepts(self, found: Found) -> bool:
        """Return whether it takes that time, and not much less."""
        return (1 - SLACK) * self.seconds <= found.run.seconds <= self.seconds

    def rank(self, found: Found) -> tuple[bool, float]:
        """By the expected error where fast enough, for a single one may be small by chance."""
        good = found.run.seconds <= self.seconds
        return not good, found.choice.ratio if good else found.run.seconds
