# SPDX-License-Identifier: MIT
"""Runs of settings: their time, and their error against a reference."""

from __future__ import annotations

import statistics
from dataclasses import asdict
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import numpy as np
from cases import Case
from dials import Setting, base, numbering, one_by_one, reference

import ufl_beam as ub

SHORT = 0.5
"""Runs below are repeated, and the median counts; s."""


class Bench:
    """The runs of one scene.

    Args:
        case: The scene.
        quick: Few and coarse settings.
    """

    def __init__(self, case: Case, quick: bool) -> None:
        self.case, self.quick = case, quick
        self.scene, self.place = case.make()
        self._compiled: set[tuple] = set()
        self._results: dict[Setting, dict[str, Any]] = {}

    def results(self) -> dict[str, Any]:
        """All of the case, as JSON has it."""
        fine, less = (self._values(self._simulate(s)) for s in reference(self.case, self.quick))
        self._exact = fine
        here = self.run(base(self.case, self.quick), times=3)
        dials = []
        for name, setting in one_by_one(self.case, self.quick):
            dials.append({"dial": name, **self.run(setting, times=3)})
            if "values" in dials[-1] and "values" in here:
                dials[-1]["changes"] = self._distance(dials[-1]["values"], here["values"])
        times = 1 if self.quick else 3
        runs = [self.run(setting, times) for setting in numbering(self.case, self.quick)]
        return {
            "name": self.case.name,
            "kind": self.case.kind,
            "says": self.case.says,
            "cells": [beam.cells for beam in self.scene.beams],
            "steps": self.case.steps,
            # Of second order in both: a third of the difference, and as much again in doubt
            "reference": 2 / 3 * self._distance(fine, less),
            "base": here,
            "dials": dials,
            "runs": runs,
        }

    def run(self, setting: Setting, times: int) -> dict[str, Any]:
        """Time, of so many runs if they are short, and error; or why there are none."""
        if setting not in self._results:
            self._results[setting] = self._run(setting, times)
        return self._results[setting]

    def _run(self, setting: Setting, times: int) -> dict[str, Any]:
        try:
            form = (setting.scheme, setting.degree, setting.lumped, setting.solver)
            if form not in self._compiled:
                self._simulate(setting)
                self._compiled.add(form)
            solution = self._simulate(setting)
        except Exception as error:  # whatever it is, it belongs into the table
            words = str(error).splitlines() or [""]
            return {**asdict(setting), "failed": f"{type(error).__name__}: {words[0]}"}
        seconds = [solution.seconds]
        if seconds[0] < SHORT:
            seconds += [self._simulate(setting).seconds for _ in range(times - 1)]
        values = self._values(solution)
        return {
            **asdict(setting),
            "seconds": statistics.median(seconds),
            "taken": solution.substeps,
            "cells": len(solution.numbering.cells),
            "iterations": solution.iterations / solution.substeps,
            "imbalance": float(solution.energy.worst),
            "values": values.tolist(),
            "error": self._distance(values, self._exact),
        }

    def _simulate(self, setting: Setting) -> ub.Solution:
        with TemporaryDirectory() as folder:
            table = ub.History(Path(folder) / "history.csv", [self.place])
            record = [table] if setting.history else []
            arguments = setting.arguments(self.case)
            return ub.simulate(self.scene, progress=False, record=record, **arguments)

    def _values(self, solution: ub.Solution) -> np.ndarray:
        """Positions of the place at the instants; (INSTANTS, 2); m."""
        at = np.abs(solution.times[:, None] - self.case.instants).argmin(axis=0)
        apart = np.abs(solution.times[at] - self.case.instants).max()
        assert apart < 1e-6 * self.case.end, f"{self.case.name}: {apart:g} s beside an instant"
        return solution.position(self.place)[at]

    def _distance(self, a: Any, b: Any) -> float:
        """Largest distance of positions, as a part of the size of the scene."""
        return float(np.abs(np.asarray(a) - np.asarray(b)).max() / self.scene.size)
