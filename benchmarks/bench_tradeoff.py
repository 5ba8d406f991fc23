# SPDX-License-Identifier: MIT
"""Errors and cost of what ``tradeoff`` recommends, against fine references, on six scenes.

Run on an idle machine, one core::

    ./env python3 benchmarks/bench_tradeoff.py

The scenes are those of the study and of the other benchmarks, with their coarsest cells and steps.
Each is asked for errors of 1e-2, 1e-3 and 1e-4 of its largest displacement.  The error is that of
the recommended run against a reference with much finer cells and steps.  Prints a table and writes
one JSON line per question to ``benchmarks/results/bench_tradeoff.jsonl``.

The effort is that of all runs over that of the recommended one: of the time of the steps, which is
noise where they take milliseconds, and of their work, iterations times cells.
"""

import argparse
import sys
import time
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from records import keep

import ufl_beam as ub

sys.path.append(str(Path(__file__).parent / "study"))
sys.path.append(str(Path(__file__).parents[1] / "tests"))

import scenes
from cases import CASES, Case

STEP_CELLS = 8  # a step of a chain costs as much as so many cells, and those that it has
STUDY = {case.name: case for case in CASES}


@dataclass(frozen=True)
class Question:
    """A case, and how fine its reference is: parts of its cells and steps."""

    case: Case
    refine: int
    parts: int
    degree: int = 3

    @property
    def scheme(self):
        return ub.EnergyMomentum() if self.case.dynamic else ub.Static()

    def ask(self):
        """The scene, its quantity and the arguments of a run."""
        case = self.case
        scene, place = case.make()

        def path(solution):
            """Displacements of the place at ten instants; m."""
            moved = solution.displacement(place)[:, :2]
            return np.stack([np.interp(case.instants, solution.times, x) for x in moved.T])

        run = {"scheme": self.scheme, "t": (0.0, case.end), "dt": case.end / case.steps}
        return scene, path, run

    def reference(self):
        """The path with fine cells and steps; m."""
        scene, path, run = self.ask()
        mesh = ub.Mesh(refine=self.refine, degree=self.degree)
        run |= {"dt": run["dt"] / self.parts, "mesh": mesh, "every": max(1, self.parts // 8)}
        return path(ub.simulate(scene, **run))


def elastic_frame():
    scene = scenes.struck_portal()
    return scene, scene.beams[0].end


def yielding_frame():
    """A hinge at the foot that is struck, which flows at 50 kN m and hardens."""
    scene = scenes.struck_portal(hinges={0.0: ub.ElastoPlastic(yield_limit=50e3, isotropic=2e5)})
    return scene, scene.beams[0].end


def frame_case(name, make, *, elastic):
    return Case(name, "smooth", "", make, 0.1, 50, elastic=elastic)


QUESTIONS = (
    Question(frame_case("elastic frame", elastic_frame, elastic=True), 8, 512),
    Question(STUDY["flying beam"], 8, 128),
    Question(frame_case("frame with a hinge", yielding_frame, elastic=False), 8, 512),
    Question(STUDY["swing"], 8, 128),
    Question(STUDY["bent cantilever"], 16, 1),
    Question(STUDY["breaking arm"], 64, 64),
)


def work(run):
    """Iterations of all steps, times cells, those of a higher degree as many as their nodes."""
    return run.steps * run.iterations * (STEP_CELLS + run.cells * run.setting.mesh.degree)


def answer(question, reference, tolerance):
    """What is recommended for a tolerance, how far it errs, and what the search took."""
    scene, path, run = question.ask()
    begin = time.perf_counter()
    found = ub.tradeoff(scene, {"path": path}, tolerance=tolerance, **run)
    wall = time.perf_counter() - begin
    best = found.best
    error = np.abs(best.values["path"] - reference).max() / np.abs(reference).max()
    uncertain = found.uncertainty["path"] / found.units["path"]
    return found, {
        "case": question.case.name, "asked": tolerance, "error": error, "ratio": error / tolerance,
        "estimated": found.ratio(best), "runs": len(found.runs), "spent_s": found.spent,
        "best_s": best.seconds, "effort": found.effort, "wall_s": wall,
        "work": sum(map(work, found.runs)) / work(best), "uncertain": uncertain,
        "steps": best.steps, "cells": best.cells, "setting": str(best.setting),
        "notes": list(found.notes),
    }  # fmt: skip


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--only", default="", help="cases whose names contain this")
    parser.add_argument("--say", action="store_true", help="print each trade-off")
    options = parser.parse_args()
    head = f"{'':20s} {'asked':>6} {'error/asked':>11} {'estimate':>8} {'uncertain':>9}"
    print(f"{head} {'effort':>6} {'work':>6} {'runs':>4}")
    for question in QUESTIONS:
        if options.only not in question.case.name:
            continue
        reference = question.reference()
        for tolerance in (1e-2, 1e-3, 1e-4):
            try:
                found, one = answer(question, reference, tolerance)
            except ub.errors.TradeoffError as error:
                print(f"{question.case.name:20s} {tolerance:6.0e} refused: {error}")
                continue
            if options.say:
                print(found)
            keep("bench_tradeoff", one)
            print(
                f"{one['case']:20s} {tolerance:6.0e} {one['ratio']:11.2f} {one['estimated']:8.2f} "
                f"{one['uncertain']:9.2f} {one['effort']:6.1f} {one['work']:6.1f} "
                f"{one['runs']:4d}  {one['setting']}",
                flush=True,
            )


if __name__ == "__main__":
    main()
