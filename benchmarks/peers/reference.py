"""Converged answers: ``python3 reference.py`` (through ./env) computes them anew; half an hour.

Each is a run of ufl_beam on its finest mesh with its finest step, extrapolated with the run of
half as many cells and twice the step (Richardson: both errors are of second order).  A third run,
coarser again, tells whether the order is seen.  No other program has a part in it.  What is kept in
``reference.json`` is the extrapolated answer, and how far it is from the finest run.
"""

import json
import sys
from pathlib import Path

import numpy as np

FILE = Path(__file__).with_name("reference.json")
FINEST = {  # cells, dt (s), what else
    "P2": (2048, 5e-4, {}),
    "P3": (512, 1.25e-4, {"end": 1.2}),
    "P4": (384, 2.5e-4, {}),
    "P5": (1024, 2.5e-5, {}),
}


def known(problem):
    """What is kept of a problem: arrays by name, or nothing before it was computed."""
    kept = json.loads(FILE.read_text()) if FILE.exists() else {}
    values = kept.get(problem, {}).get("values", {})
    return {name: np.array(value) for name, value in values.items()}


def compute(problem):
    import in_ufl_beam

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
    entry = {"cells": cells, "dt": dt, "values": {}, "from_finest": {}, "ratio": {}}
    for name in runs[-1]:
        coarse, middle, fine = (run[name] for run in runs)
        change, before = (float(np.sqrt(np.mean(d**2))) for d in (fine - middle, middle - coarse))
        entry["values"][name] = np.round(fine + (fine - middle) / 3, 9).tolist()
        entry["from_finest"][name] = change / 3
        entry["ratio"][name] = before / change if change else None
    return entry


def main(*problems):
    for problem in problems or FINEST:
        entry = compute(problem)
        print(problem, {k: v for k, v in entry.items() if k != "values"}, flush=True)
        kept = json.loads(FILE.read_text()) if FILE.exists() else {}
        kept[problem] = entry
        lines = (f"{json.dumps(name)}: {json.dumps(kept[name])}" for name in sorted(kept))
        FILE.write_text("{\n" + ",\n".join(lines) + "\n}\n")


if __name__ == "__main__":
    main(*sys.argv[1:])
