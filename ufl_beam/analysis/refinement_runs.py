# SPDX-License-Identifier: MIT
"""Runs of one scene with finer and finer dials, each done once and timed."""

from __future__ import annotations

import statistics
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Any

from mpi4py import MPI

import numpy as np
import numpy.typing as npt

from ufl_beam.analysis.parameter_study import study
from ufl_beam.analysis.tradeoff_result import Dials, Refinement, Run
from ufl_beam.arrays import Array
from ufl_beam.errors import ConvergenceError, SceneError, TradeoffError
from ufl_beam.model.scene import Scene
from ufl_beam.parallel import alone
from ufl_beam.simulation.solution import Solution
from ufl_beam.solvers.newton_options import Newton

Quantity = Callable[[Solution], npt.ArrayLike]

SHORT_RUN = 0.1  # runs below are done three times, and the median counts; s


@dataclass(eq=False)
class RefinementRuns:
    """Runs of a trade-off, see :func:`tradeoff`; they have the first of ``newtons`` by default."""

    scene: Scene
    quantities: Mapping[str, Quantity]
    simulate: Callable[..., Solution]
    families: Sequence[Dials]  # coarsest dials to begin with
    newtons: Sequence[Newton]
    t: tuple[float, float]
    most: float  # wall time that all runs together may take; s
    comm: MPI.Intracomm
    bar: Any  # progress bar
    runs: dict[Refinement, Run] = field(default_factory=dict, init=False)
    failed: dict[Refinement, str] = field(default_factory=dict, init=False)  # why runs failed
    spent: float = field(default=0.0, init=False)  # wall time of all runs, and of compiling; s
    _shapes: dict[str, tuple[int, ...]] = field(default_factory=dict, init=False)

    def begin(self, family: int) -> None:
        """Compile, and require quantities of one shape in all runs, on every process."""
        seconds = 0.0
        with alone():
            for level in (0.0, 1.0):
                try:
                    solution = self._simulate(Refinement(family, 1, level))
                except ConvergenceError:
                    continue  # finer steps may do
                seconds += solution.seconds
                for name, value in self._quantities_of(solution):
                    before = self._shapes.setdefault(name, value.shape)
                    if before != value.shape:
                        raise SceneError(
                            f"tradeoff: quantity {name!r} has shape {before} in a run and "
                            f"{value.shape} in another with other steps or cells; give a number, "
                            "or an array at times and places of your own (np.interp)"
                        )
        self.spent += float(self.comm.bcast(seconds))

    def run(self, refinements: Sequence[Refinement], *, short: float = SHORT_RUN) -> None:
        """Run what is missing, several at a time where there are processes.

        Runs that take less than ``short`` seconds are done three times; all may take ``most`` (s).
        """
        missing = [r for r in refinements if r not in self.runs and r not in self.failed]
        if not missing:
            return
        needed = sum(map(self._longest, missing))
        if self.spent + needed > self.most:
            raise TradeoffError(
                f"the next {len(missing)} runs would take about {needed:.3g} s after "
                f"{self.spent:.3g} s of runs, more than most = {self.most:g} s; the finest is "
                f"{self.dials(missing[-1])}",
                tuple(self.runs.values()),
            )
        self.bar.set_postfix_str(f"{len(missing)} more up to {self.dials(missing[-1])}")
        cases = [one._asdict() | {"short": short} for one in missing]
        try:
            done = study(self._member, cases, progress=False, comm=self.comm)
        except RuntimeError as error:  # all of them failed
            self.failed |= dict.fromkeys(missing, str(error))
            return
        finally:
            self.bar.set_postfix_str("", refresh=False)
            self.bar.update(len(missing))
        for k, one in enumerate(missing):
            if k in done.failed:
                self.failed[one] = done.failed[k]
                continue
            values = {name: done[f"quantity {n}"][k] for n, name in enumerate(self.quantities)}
            measured = ("seconds", "steps", "cells", "iterations", "spent")
            took = {name: float(done[name][k]) for name in measured}
            self.runs[one] = Run(one, self.dials(one), values, **took)
            self.spent += took["spent"]

    def dials(self, refinement: Refinement) -> Dials:
        """Return the dials of a refinement."""
        family, refine, level, newton = refinement
        finer = self.families[family].finer(refine, level, self.t)
        return replace(finer, newton=self.newtons[newton])

    def of(self, family: int) -> list[Run]:
        """Return the runs of a family."""
        return [run for one, run in self.runs.items() if one.family == family]

    def _longest(self, refinement: Refinement) -> float:
        """Wall time at most, by the nearest run; s; 0 if there is none."""
        _, refine, level, _ = refinement
        times = (
            run.spent
            * 2 ** max(0.0, level - run.refinement.level)
            * max(1.0, refine / run.refinement.refine)
            for run in self.of(refinement.family)
        )
        return min(times, default=0.0)

    def _simulate(self, refinement: Refinement) -> Solution:
        dials = self.dials(refinement)
        return self.simulate(self.scene, t=self.t, progress=False, **dials.arguments)

    def _quantities_of(self, solution: Solution) -> Iterator[tuple[str, Array]]:
        for name, quantity in self.quantities.items():
            value = np.asarray(quantity(solution), dtype=float)
            if not np.isfinite(value).all():
                raise SceneError(f"tradeoff: quantity {name!r} is not finite")
            yield name, value

    def _member(self, short: float, **case: Any) -> dict[str, Any]:
        """Compute one run, as a member of a study."""
        refinement = Refinement(**case)
        solution = self._simulate(refinement)
        seconds = [solution.seconds]
        if solution.seconds < short:
            seconds += [self._simulate(refinement).seconds for _ in range(2)]
        values = {f"quantity {n}": v for n, (_, v) in enumerate(self._quantities_of(solution))}
        return values | {
            "seconds": statistics.median(seconds),
            "spent": sum(seconds),
            "steps": solution.parts,
            "cells": len(solution.grid.cells),
            "iterations": solution.iterations / solution.parts,
        }
