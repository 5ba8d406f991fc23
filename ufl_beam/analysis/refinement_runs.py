# SPDX-License-Identifier: MIT
"""Runs of one scene with finer and finer dials, each done once and timed."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from fractions import Fraction
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

MOST_DIVISOR = 8  # cells of a beam are not taken in smaller parts than one by so many
FASTER = 0.9  # part of the time of a run below which another one is not faster by chance
MUCH_SLOWER = 1.5  # options of Newton's method that took so much longer are not tried again
WRONG = "SceneError: "  # how failures of runs begin that finer dials do not help


@dataclass(eq=False)
class RefinementRuns:
    """Runs of a trade-off, see :func:`tradeoff`."""

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
    others: dict[tuple[Refinement, int], Run] = field(default_factory=dict, init=False)
    newton: int = field(default=0, init=False)  # number of the options of ``runs`` from now on
    failed: dict[Refinement, str] = field(default_factory=dict, init=False)  # why runs failed
    spent: float = field(default=0.0, init=False)  # wall time of all runs, and of compiling; s
    _shapes: dict[str, tuple[int, ...]] = field(default_factory=dict, init=False)

    def begin(self, family: int) -> None:
        """Compile by a single step, and do the coarsest run on every process."""
        first = Refinement(family, Fraction(1), 0.0)
        dt = self.families[family].dt
        until = min(self.t[1], self.t[0] + dt) if isinstance(dt, float | int) else self.t[1]
        with alone():
            try:
                self._simulate(first, self.newton, until)
                self.runs[first] = self._taken(first, self.newton, self._member(*first))
                self.bar.update(1)
            except ConvergenceError as error:
                self.failed[first] = f"{type(error).__name__}: {error}"  # finer steps may do

    def allowed(self, refinements: Sequence[Refinement]) -> bool:
        """Return whether there is time for runs."""
        return self.spent + sum(map(self._longest, refinements)) <= self.most

    def run(self, refinements: Sequence[Refinement]) -> None:
        """Run what is missing, several at a time where there are processes."""
        missing = [r for r in refinements if r not in self.runs and r not in self.failed]
        if not missing:
            return
        if not self.allowed(missing):
            needed = sum(map(self._longest, missing))
            raise TradeoffError(
                f"the next {len(missing)} runs would take about {needed:.3g} s after "
                f"{self.spent:.3g} s of runs, more than most = {self.most:g} s; the finest is "
                f"{self.dials(missing[-1])}",
                self.all,
            )
        done, failed = self._done(missing, self.newton)
        self.runs |= done
        self.failed |= failed

    def run_with(self, one: Refinement, newton: int) -> Run | None:
        """Do a run with some options of Newton's method; None if it fails or there is no time."""
        run = self.runs.get(one)  # perhaps done before other options were chosen
        if run is not None and run.dials.newton == self.newtons[newton]:
            return run
        if (one, newton) not in self.others and self.allowed([one]):
            done, _ = self._done([one], newton)
            self.others |= {(done_one, newton): run for done_one, run in done.items()}
        return self.others.get((one, newton))

    def may_be_faster(self, newton: int) -> bool:
        """Return whether options were not much slower where they were tried last."""
        tried = [
            run.stepping / self.runs[one].stepping
            for (one, number), run in self.others.items()
            if number == newton
        ]
        return not tried or tried[-1] < MUCH_SLOWER

    def _done(
        self, missing: Sequence[Refinement], newton: int
    ) -> tuple[dict[Refinement, Run], dict[Refinement, str]]:
        """Return runs, and the reasons why others failed."""
        last = str(self.dials(missing[-1], newton))
        self.bar.set_postfix_str(f"{len(missing)} more up to {last}")
        cases = [one._asdict() | {"refine": str(one.refine), "newton": newton} for one in missing]
        try:
            done = study(self._member, cases, progress=False, comm=self.comm)
        except RuntimeError as error:  # all of them failed
            text = str(error)
            if WRONG in text:
                raise SceneError(text.partition(WRONG)[2]) from None
            return {}, dict.fromkeys(missing, text)
        finally:
            self.bar.set_postfix_str("", refresh=False)
            self.bar.update(len(missing))
        runs: dict[Refinement, Run] = {}
        for k, one in enumerate(missing):
            if k not in done.failed:
                found = {name: done[name][k] for name in done.results}
                runs[one] = self._taken(one, newton, found)
            elif done.failed[k].startswith(WRONG):
                raise SceneError(done.failed[k].removeprefix(WRONG))
        return runs, {missing[k]: text for k, text in done.failed.items()}

    def dials(self, refinement: Refinement, newton: int = 0) -> Dials:
        """Return the dials of a refinement, with options of Newton's method."""
        family, refine, level = refinement
        finer = self.families[family].finer(refine, level, self.t)
        return replace(finer, newton=self.newtons[newton])

    @property
    def all(self) -> tuple[Run, ...]:
        """Runs with all options of Newton's method."""
        return *self.runs.values(), *self.others.values()

    def of(self, family: int) -> list[Run]:
        """Return the runs of a family, each refinement with one of the options."""
        return [run for one, run in self.runs.items() if one.family == family]

    def divisor(self, family: int) -> int:
        """Return the parts of a cell that make a whole number of cells between all places."""
        mesh, scene = self.families[family].mesh, self.scene
        for q in range(MOST_DIVISOR, 1, -1):
            finer = replace(mesh, refine=mesh.refine * Fraction(q + 1, q))
            try:
                for beam in scene.beams:
                    finer.vertices(beam, scene.attached[beam])
            except SceneError:
                continue
            return q
        return 1

    def _longest(self, refinement: Refinement) -> float:
        """Wall time at most, by the nearest run; s; 0 if there is none."""
        _, refine, level = refinement
        times = (
            run.seconds
            * 2 ** max(0.0, level - run.refinement.level)
            * max(1.0, float(refine / run.refinement.refine))
            for run in self.of(refinement.family)
        )
        return min(times, default=0.0)

    def _simulate(self, refinement: Refinement, newton: int, until: float) -> Solution:
        dials, t = self.dials(refinement, newton), (self.t[0], until)
        return self.simulate(self.scene, t=t, progress=False, **dials.arguments)

    def _quantities_of(self, solution: Solution) -> Iterator[tuple[str, Array]]:
        for name, quantity in self.quantities.items():
            value = np.asarray(quantity(solution), dtype=float)
            if not np.isfinite(value).all():
                raise SceneError(f"tradeoff: quantity {name!r} is not finite")
            before = self._shapes.get(name, value.shape)
            if before != value.shape:
                raise SceneError(
                    f"tradeoff: quantity {name!r} has shape {before} in a run and {value.shape} "
                    "in another with other steps or cells; give a number, or an array at times "
                    "and places of your own (np.interp)"
                )
            yield name, value

    def _member(
        self, family: int, refine: str | Fraction, level: float, newton: int = 0
    ) -> dict[str, Any]:
        """Compute one run, as a member of a study."""
        one = Refinement(family, Fraction(refine), level)
        solution = self._simulate(one, newton, self.t[1])
        values = {f"quantity {n}": v for n, (_, v) in enumerate(self._quantities_of(solution))}
        return values | {
            "seconds": solution.seconds,
            "building": solution.building,
            "steps": solution.parts,
            "cells": len(solution.grid.cells),
            "iterations": solution.iterations / solution.parts,
        }

    def _taken(self, one: Refinement, newton: int, found: Mapping[str, Any]) -> Run:
        """Return a run, as the first process has measured it."""
        found = self.comm.bcast(found)
        values = {
            name: np.asarray(found[f"quantity {n}"]) for n, name in enumerate(self.quantities)
        }
        self._shapes |= {name: value.shape for name, value in values.items()}
        measured = ("seconds", "building", "steps", "cells", "iterations")
        took = {name: float(found[name]) for name in measured}
        self.spent += took["seconds"]
        return Run(one, self.dials(one, newton), values, **took)
