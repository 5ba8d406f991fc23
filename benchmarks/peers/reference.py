# SPDX-License-Identifier: MIT
"""Converged answers: ``python3 reference.py`` (through ./env) computes them anew; half an hour.

Each is a run of ufl_beam on its finest mesh with its finest step.  Runs of half and a quarter as
many cells, with two and four times the step, tell whether the order of two is seen; where it is,
the answer is extrapolated (Richardson).  It is not where loads jump or have kinks.  No other
program has a part in it.  ``reference.json`` keeps the answers, how far they are from the finest
run or, if that is kept, the next coarser one from it, and the ratio of successive changes.
"""

import json
import sys

import in_ufl_beam
import numpy as np
from problems import REFERENCE

FINEST = {  # cells, dt (s), what else
    "P2": (2048, 5e-4, {}),
    "P3": (512, 1.25e-4, {"end": 1.2}),
    "P4": (384, 2.5e-4, {}),
    "P5": (1024, 2.5e-5, {}),
    "P6": (512, 1.5625e-3, {}),
}


def compute(problem):
    cells, dt, more = FINEST[problem]
    runs = [
        {
            name: np.array(value)
            for name, value in in_ufl_beam.RUNS[problem](
                cells=cells // 2**level, dt=dt * 2**level, **more
            )["values"].items()
        }
        for level in (2, 1, 0)
    ]
    entry = {"cells": cells, "dt": dt, "values": {}, "change": {}, "ratio": {}}
    for name in runs[-1]:
        coarse, middle, fine = (run[name] for run in runs)
        change, before = (float(np.sqrt(np.mean(d**2))) for d in (fine - middle, middle - coarse))
        smooth = 3.5 < before / change < 5.0
        answer = fine + (fine - middle) / 3 if smooth else fine
        entry["values"][name] = np.round(answer, 9).tolist()
        entry["change"][name] = change / 3 if smooth else change
        entry["ratio"][name] = before / change
    return entry


def main(*problems):
    for problem in problems or FINEST:
        entry = compute(problem)
        print(problem, {k: v for k, v in entry.items() if k != "values"}, flush=True)
        kept = json.loads(REFERENCE.read_text()) if REFERENCE.exists() else {}
        kept[problem] = entry
        lines = (f"{json.dumps(name)}: {json.dumps(kept[name])}" for name in sorted(kept))
        REFERENCE.write_text("{\n" + ",\n".join(lines) + "\n}\n")


if __name__ == "__main__":
    main(*sys.argv[1:])
