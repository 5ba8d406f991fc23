# SPDX-License-Identifier: MIT
"""Result of a trade-off: its runs, the recommended setting, and how far to trust it."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from ufl_beam.analysis.refinement_runs import Run, keywords
from ufl_beam.analysis.richardson import Cross, pareto, size
from ufl_beam.analysis.targets import Goal
from ufl_beam.arrays import Array


@dataclass(frozen=True, eq=False)
class Tradeoff:
    """Result of :func:`tradeoff`: runs, errors and the recommended setting.

    Attributes:
        runs: All that was run.
        best: The run with the recommended setting.
        t: Beginning and end; s.
        crosses: How each quantity converges with the recommended kind of dials.
        units: The tolerances, in the unit of each quantity; with a budget, the sizes of the
            quantities.
        goal: What was asked.
        families: The kinds of dials, in words.
        notes: What else should be known.
        spent: Wall time of all runs, repetitions and compiling included; s.

    Example:
        >>> tip = {"tip": lambda run: run.position(beam.end)[-1]}
        >>> found = ub.tradeoff(scene, tip, scheme=ub.Static(), t=(0, 1), dt=0.5, tolerance=0.01)
        >>> found.ratio(found.best) <= 1  # largest error over the tolerance
        True
    """

    runs: tuple[Run, ...]
    best: Run
    t: tuple[float, float]
    crosses: Mapping[str, Cross]
    units: dict[str, float]
    goal: Goal
    families: tuple[str, ...]
    notes: tuple[str, ...]
    spent: float

    @property
    def recommended(self) -> dict[str, Any]:
        """Arguments for ``ub.simulate(scene, **recommended)``: scheme, t, dt, mesh, newton."""
        return {"t": self.t, **keywords(self.best.dials)}

    @property
    def limit(self) -> dict[str, Array]:
        """Extrapolated limits of the quantities."""
        return {name: cross.limit for name, cross in self.crosses.items()}

    @property
    def uncertainty(self) -> dict[str, float]:
        """Of the limits; unit of each quantity."""
        return {name: cross.uncertainty for name, cross in self.crosses.items()}

    def errors(self, run: Run) -> dict[str, float]:
        """Distance of a run from the limits, by quantity; its unit."""
        return {name: size(run.values[name] - limit) for name, limit in self.limit.items()}

    def ratio(self, run: Run) -> float:
        """The largest of the errors over tolerance, or over the size of the quantity."""
        return max(error / self.units[name] for name, error in self.errors(run).items())

    @property
    def front(self) -> list[Run]:
        """The runs that no other one beats in time and in accuracy, the fastest first."""
        seconds = np.array([run.seconds for run in self.runs])
        ratios = np.array([self.ratio(run) for run in self.runs])
        return [self.runs[k] for k in pareto(seconds, ratios)]

    def __str__(self) -> str:
        names = list(self.limit)
        front = self.front
        rows = [["", "seconds", "steps", "cells", "iterations", *names, "dials"]]
        for run in sorted({*front, self.best}, key=lambda run: run.seconds):
            mark = "=>" if run is self.best else ""
            errors = self.errors(run)
            rows.append([
                mark, f"{run.seconds:.3g}", f"{run.steps:.0f}", f"{run.cells:.0f}",
                f"{run.iterations:.2f}", *(f"{errors[name]:.2g}" for name in names),
                str(run.dials),
            ])  # fmt: skip
        widths = [max(map(len, column)) for column in zip(*rows, strict=True)]
        lines = [
            "  ".join([*(c.rjust(w) for c, w in zip(row[:-1], widths, strict=False)), row[-1]])
            for row in rows
        ]
        lines.append(f"and {len(self.runs) - len(lines) + 1} runs that others beat in both")
        for name, cross in self.crosses.items():
            value = np.array2string(cross.limit, precision=9, threshold=6, edgeitems=2)
            lines.append(f"{name}: limit {value} ± {cross.uncertainty:.1g}{cross}")
        lines.append(
            f"{len(self.runs)} runs took {self.spent:.3g} s, "
            f"{self.spent / self.best.seconds:.2g} times the recommended one"
        )
        return "\n".join([
            f"trade-off for {self.goal}; errors are distances from the extrapolated limit", *lines,
            *self.notes, f"recommended: {self.best.dials}: {self.best.seconds:.3g} s",
        ])  # fmt: skip
