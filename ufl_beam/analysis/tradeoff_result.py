# SPDX-License-Identifier: MIT
"""Runs of a trade-off, their target, and its result."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from fractions import Fraction
from typing import Any, NamedTuple

import numpy as np

from ufl_beam.analysis.richardson import SelfConvergence, pareto, size
from ufl_beam.arrays import Array
from ufl_beam.display import Rich, aligned, bracketed, compact_repr
from ufl_beam.mechanics.time_scheme import Scheme
from ufl_beam.model.beams import Mesh
from ufl_beam.solvers.newton_options import Newton


@dataclass(frozen=True)
class Setting:
    """Setting of a run: arguments of :func:`simulate`."""

    scheme: Scheme  # the time scheme
    dt: Any  # length of steps (s), or :class:`Adaptive`
    mesh: Mesh  # the discretization
    newton: Newton  # options of Newton's method

    def __str__(self) -> str:
        step = f"dt={self.dt:.4g}" if isinstance(self.dt, float | int) else compact_repr(self.dt)
        scheme, mesh, newton = map(compact_repr, (self.scheme, self.mesh, self.newton))
        return ", ".join([scheme, step, mesh, newton])

    __repr__ = bracketed


class Refinement(NamedTuple):
    """Family of a setting (scheme, coarsest steps and mesh), and refinement of steps and cells."""

    family: int  # index of the family
    refine: Fraction  # factor on the number of cells
    level: float  # the number of steps is multiplied by about 2**level
    newton: int = 0  # index of the options of Newton's method


@dataclass(frozen=True, eq=False)
class Run:
    """Result of a run, and its cost."""

    refinement: Refinement  # family and refinement
    setting: Setting  # setting
    values: dict[str, Array]  # the quantities
    seconds: float  # wall time without compiling; s
    building: float  # wall time before the first step; s
    steps: float  # number of substeps
    cells: float  # number of cells
    iterations: float  # Newton iterations per substep

    @property
    def stepping(self) -> float:
        """Wall time of the steps alone; s."""
        return self.seconds - self.building

    def __str__(self) -> str:
        return f"{self.setting}: {self.seconds:.3g} s"

    __repr__ = bracketed


@dataclass(frozen=True)
class Target:
    """Target of a trade-off: absolute or relative tolerances, or the wall time of a run."""

    absolute: Mapping[str, float]  # tolerance of each quantity, in its unit; or empty
    relative: float  # tolerance as a fraction of the largest magnitude; 1 with a budget
    budget: float  # wall time (s); infinite if tolerances are given

    @property
    def measure(self) -> str:
        """Name of the values by which errors are divided."""
        return "tolerances" if math.isinf(self.budget) else "largest values"

    def __str__(self) -> str:
        if math.isfinite(self.budget):
            return f"runs of {self.budget:g} s"
        if not self.absolute:
            return f"errors of {self.relative:g} of each quantity"
        return "errors of " + ", ".join(f"{value:g} of {n}" for n, value in self.absolute.items())


@dataclass(frozen=True, eq=False)
class Tradeoff(Rich):
    """Result of :func:`tradeoff`: runs, errors and the recommended setting.

    Attributes:
        runs: All runs.
        best: The run with the recommended setting.
        t: Beginning and end; s.
        convergence: Convergence of each quantity in the family of the recommended setting.
        units: The tolerances, in the unit of each quantity; with a budget, the largest magnitudes
            of the quantities.
        target: The tolerances or the budget.
        families: Coarsest settings, as texts; each run refines one of these settings.
        notes: Further remarks on the result.
        spent: Wall time of all runs; s.

    Example:
        >>> tip = {"tip": lambda run: run.position(beam.end)[-1]}
        >>> found = ub.tradeoff(scene, tip, scheme=ub.Static(), t=(0, 1), dt=0.5, tolerance=0.01)
        >>> found.ratio(found.best) <= 1  # largest error divided by the tolerance
        True
    """

    runs: tuple[Run, ...]
    best: Run
    t: tuple[float, float]
    convergence: Mapping[str, SelfConvergence]
    units: dict[str, float]
    target: Target
    families: tuple[str, ...]
    notes: tuple[str, ...]
    spent: float

    @property
    def recommended(self) -> dict[str, Any]:
        """Arguments for ``ub.simulate(scene, **recommended)``: scheme, t, dt, mesh, newton."""
        return {"t": self.t, **vars(self.best.setting)}

    @property
    def limit(self) -> dict[str, Array]:
        """Extrapolated limits of the quantities, by name."""
        return {name: convergence.limit for name, convergence in self.convergence.items()}

    @property
    def uncertainty(self) -> dict[str, float]:
        """Uncertainty of the limits, by quantity; unit of each quantity."""
        return {name: convergence.uncertainty for name, convergence in self.convergence.items()}

    def errors(self, run: Run) -> dict[str, float]:
        """Return the distance of a run from the limit of each quantity, in its unit."""
        return {name: size(run.values[name] - limit) for name, limit in self.limit.items()}

    def ratio(self, run: Run) -> float:
        """Return the largest of the errors divided by ``units``."""
        return max(error / self.units[name] for name, error in self.errors(run).items())

    @property
    def effort(self) -> float:
        """Wall time of the steps of all runs, divided by the same time of the recommended run."""
        return sum(run.stepping for run in self.runs) / self.best.stepping

    @property
    def front(self) -> list[Run]:
        """Runs that no other run beats in both time and accuracy, the fastest first."""
        seconds = np.array([run.seconds for run in self.runs])
        ratios = np.array([self.ratio(run) for run in self.runs])
        return [self.runs[k] for k in pareto(seconds, ratios)]

    def title(self) -> str:
        """Return the target in words."""
        return f"trade-off for {self.target}; errors are distances from the extrapolated limit"

    def table(self) -> list[list[str]]:
        """Return a header, and cost, errors and setting of each run of ``front`` and ``best``."""
        rows = [["", "seconds", "steps", "cells", "iterations", *self.limit, "setting"]]
        shown = dict.fromkeys([*self.front, self.best])
        for run in sorted(shown, key=lambda run: run.seconds):
            rows.append([
                "=>" if run is self.best else "", f"{run.seconds:.3g}", f"{run.steps:.0f}",
                f"{run.cells:.0f}", f"{run.iterations:.2f}",
                *(f"{error:.2g}" for error in self.errors(run).values()), str(run.setting),
            ])  # fmt: skip
        return rows

    def remarks(self) -> list[str]:
        """Return lines on convergence, cost and the recommended setting."""
        shown = {*self.front, self.best}
        lines = [f"and {len(self.runs) - len(shown)} runs that others beat in both time and error"]
        for name, convergence in self.convergence.items():
            value = np.array2string(convergence.limit, precision=9, threshold=6, edgeitems=2)
            lines.append(f"{name}: limit {value} ± {convergence.uncertainty:.1g}{convergence}")
        lines.append(
            f"{len(self.runs)} runs took {self.spent:.3g} s, "
            f"{self.spent / self.best.seconds:.2g} times the recommended one; their steps "
            f"{self.effort:.2g} times"
        )
        return [*lines, *self.notes, f"recommended: {self.best}"]

    def __str__(self) -> str:
        rows = self.table()
        lines = aligned(rows, left=len(rows[0]) - 1)
        return "\n".join([self.title(), *lines, *self.remarks()])

    def __repr__(self) -> str:
        return f"<Tradeoff: {len(self.runs)} runs; recommended {self.best}>"
