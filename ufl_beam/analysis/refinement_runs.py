# SPDX-License-Identifier: MIT
"""Runs of one scene with finer and finer dials: which, how they are timed, what they give."""

from __future__ import annotations

import math
import statistics
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, fields, replace
from typing import Any, NamedTuple

from mpi4py import MPI

import numpy as np
import numpy.typing as npt

from ufl_beam.analysis.parameter_study import study
from ufl_beam.arrays import Array
from ufl_beam.errors import ConvergenceError, SceneError, TradeoffError
from ufl_beam.mechanics.time_schemes import Scheme
from ufl_beam.model.mesh_options import Mesh
from ufl_beam.model.scene import Scene
from ufl_beam.parallel import alone
from ufl_beam.simulation.run import simulate
from ufl_beam.simulation.solution import Solution
from ufl_beam.simulation.step_control import Adaptive
from ufl_beam.solvers.newton_options import Newton

Quantity = Callable[[Solution], npt.ArrayLike]

SHORT = 0.1
"""Runs below are done three times, and the median counts, unless others are asked for; s."""


@dataclass(frozen=True)
class Dials:
    """Setting of a run, the arguments of :func:`simulate`.

    Attributes:
        scheme: The time scheme.
        dt: Step; s; or adaptive steps.
        mesh: The cells.
        newton: How exactly equilibria are found.
    """

    scheme: Scheme
    dt: float | Adaptive
    mesh: Mesh
    newton: Newton

    def finer(self, refine: int, level: float, t: tuple[float, float]) -> Dials:
        """Each cell in ``refine`` parts, steps about ``2**level`` times as many.

        The error of an adaptive step is of third order, so that their number goes with the cube
        root of the tolerance.
        """
        if refine == 1 and level == 0:
            return self  # as it was given, to be checked as such
        dt = self.dt
        if isinstance(dt, Adaptive):
            finer: float | Adaptive = replace(dt, tolerance=dt.tolerance / 8**level)
        else:
            number = max(1, math.ceil((t[1] - t[0]) / dt * (1 - 1e-9)))
            finer = (t[1] - t[0]) / round(number * 2**level)
        return replace(self, dt=finer, mesh=replace(self.mesh, refine=self.mesh.refine * refine))

    def __str__(self) -> str:
        return ", ".join(map(_spelled, (self.scheme, self.dt, self.mesh, self.newton)))


class Rung(NamedTuple):
    """A place on the ladder: which scheme and kind of steps and cells, and how fine.

    Attributes:
        family: Number of the dials that it begins with.
        refine: Parts of each cell.
        level: Steps are about ``2**level`` times as many.
        newton: Number of the tolerances.
    """

    family: int
    refine: int
    level: float
    newton: int = 0


@dataclass(frozen=True, eq=False)
class Run:
    """Result of a run, and its cost.

    Attributes:
        rung: Where on the ladder.
        dials: With which dials.
        values: The quantities.
        seconds: Wall time, building the scene included, compiling not; s; the median of three
            if it is short.
        steps: Steps that were taken.
        cells: Number of cells.
        iterations: Newton iterations per step.
        spent: Wall time of all repetitions; s.
    """

    rung: Rung
    dials: Dials
    values: dict[str, Array]
    seconds: float
    steps: float
    cells: float
    iterations: float
    spent: float


class Ladder:
    """All runs of a trade-off, each done once.

    Args:
        scene: What is simulated.
        quantities: What is asked of each run.
        t: Beginning and end; s.
        families: Coarsest dials to begin with.
        newtons: Tolerances of Newton's method; runs have the first unless they say so.
        most: Wall time that all runs together may take; s.
        comm: Processes that share the runs.

    Attributes:
        runs: What is done.
        failed: Why runs failed.
        spent: Wall time of all runs, and of compiling; s.
    """

    def __init__(
        self,
        scene: Scene,
        quantities: Mapping[str, Quantity],
        *,
        t: tuple[float, float],
        families: Sequence[Dials],
        newtons: Sequence[Newton],
        most: float,
        comm: MPI.Intracomm,
    ) -> None:
        self.scene, self.quantities, self.t = scene, dict(quantities), t
        self.families, self.newtons = families, newtons
        self._most, self._comm = most, comm
        self.runs: dict[Rung, Run] = {}
        self.failed: dict[Rung, str] = {}
        self.spent = 0.0
        self._shapes: dict[str, tuple[int, ...]] = {}

    def begin(self, family: int) -> None:
        """Compile and see that quantities can be compared, on every process.

        Raises:
            SceneError: The scene, its dials or a quantity are wrong.
        """
        seconds = 0.0
        with alone():
            for level in (0.0, 1.0):
                try:
                    solution = self._simulate(Rung(family, 1, level))
                except ConvergenceError:
                    continue  # finer steps may do
                seconds += solution.seconds
                for name, value in self._ask(solution):
                    before = self._shapes.setdefault(name, value.shape)
                    if before != value.shape:
                        raise SceneError(
                            f"tradeoff: quantity {name!r} has shape {before} in a run and "
                            f"{value.shape} in another with other steps or cells; give a number, "
                            "or an array at times and places of your own (np.interp)"
                        )
        self.spent += float(self._comm.bcast(seconds))

    def climb(self, rungs: Sequence[Rung], *, short: float = SHORT) -> None:
        """Run what is missing, several at a time where there are processes.

        Args:
            rungs: Where on the ladder.
            short: Runs below are done three times; s.

        Raises:
            TradeoffError: It would take more time than all runs may.
        """
        missing = [r for r in rungs if r not in self.runs and r not in self.failed]
        if not missing:
            return
        needed = sum(self._expected(rung) for rung in missing)
        if self.spent + needed > self._most:
            raise TradeoffError(
                f"the next {len(missing)} runs would take about {needed:.3g} s after "
                f"{self.spent:.3g} s of runs, more than most = {self._most:g} s; the finest is "
                f"{self.dials(missing[-1])}",
                tuple(self.runs.values()),
            )
        cases = [rung._asdict() | {"short": short} for rung in missing]
        try:
            done = study(self._member, cases, progress=False, comm=self._comm)
        except RuntimeError as error:  # all of them failed
            self.failed |= dict.fromkeys(missing, str(error))
            return
        names = list(self.quantities)
        for k, rung in enumerate(missing):
            if k in done.failed:
                self.failed[rung] = done.failed[k]
                continue
            values = {name: done[f"quantity {n}"][k] for n, name in enumerate(names)}
            took = {
                name: float(done[name][k])
                for name in ("seconds", "steps", "cells", "iterations", "spent")
            }
            self.runs[rung] = Run(rung, self.dials(rung), values, **took)
            self.spent += took["spent"]

    def dials(self, rung: Rung) -> Dials:
        """The dials of a rung."""
        finer = self.families[rung.family].finer(rung.refine, rung.level, self.t)
        return replace(finer, newton=self.newtons[rung.newton])

    def of(self, family: int) -> list[Run]:
        """The runs of a family."""
        return [run for rung, run in self.runs.items() if rung.family == family]

    def _expected(self, rung: Rung) -> float:
        """Wall time at most, by the nearest run; s; 0 if there is none."""
        return min(
            (
                run.spent
                * 2 ** max(0.0, rung.level - run.rung.level)
                * max(1.0, rung.refine / run.rung.refine)
                for run in self.of(rung.family)
            ),
            default=0.0,
        )

    def _simulate(self, rung: Rung) -> Solution:
        dials = self.dials(rung)
        return simulate(self.scene, t=self.t, progress=False, **keywords(dials))

    def _ask(self, solution: Solution) -> Iterator[tuple[str, Array]]:
        for name, quantity in self.quantities.items():
            value = np.asarray(quantity(solution), dtype=float)
            if not np.isfinite(value).all():
                raise SceneError(f"tradeoff: quantity {name!r} is not finite")
            yield name, value

    def _member(self, short: float, **case: Any) -> dict[str, Any]:
        """One run of a study."""
        rung = Rung(**case)
        solution = self._simulate(rung)
        seconds = [solution.seconds]
        if solution.seconds < short:
            seconds += [self._simulate(rung).seconds for _ in range(2)]
        values = {f"quantity {n}": v for n, (_, v) in enumerate(self._ask(solution))}
        return values | {
            "seconds": statistics.median(seconds),
            "spent": sum(seconds),
            "steps": solution.parts,
            "cells": len(solution.grid.cells),
            "iterations": solution.iterations / solution.parts,
        }


def keywords(dials: Dials) -> dict[str, Any]:
    """Dials as arguments of :func:`simulate`."""
    return {name: getattr(dials, name) for name in ("scheme", "dt", "mesh", "newton")}


def _spelled(value: Any) -> str:
    """A number, or what of a record is not as by default."""
    if isinstance(value, float | int):
        return f"dt={value:.4g}"
    values = {field.name: getattr(value, field.name) for field in fields(value)}
    defaults = {field.name: field.default for field in fields(value)}
    shown = (
        f"{name}={one:.4g}" if isinstance(one, float) else f"{name}={one}"
        for name, one in values.items()
        if one and one != defaults[name]
    )  # fmt: skip
    return f"{type(value).__name__}({', '.join(shown)})"
