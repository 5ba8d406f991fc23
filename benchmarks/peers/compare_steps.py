# SPDX-License-Identifier: MIT
"""Error of the time steps beside Exudyn and OpenSees, in one run: the flying beam of 8 cells.

Run by ``make bench-steps``.  The push rises until 1.25 s and falls until 2.5 s, at ends of steps.
Every program is compared with its own limit for short steps on this mesh, extrapolated from its two
shortest steps, so that errors of meshes and elements do not count.  Every run is a process of its
own with one thread; all programs run in turn.  Times are of the processor, so that other programs
on the machine disturb them little.
"""

import json
import math
import runpy
import statistics
from itertools import pairwise
from pathlib import Path
from typing import NamedTuple

import numpy as np
from install import installed
from report import table

HERE = Path(__file__).parent
RESULTS = HERE.parent / "results" / "bench_steps.jsonl"
PAGE = HERE.parents[1] / "docs" / "peers.md"
BEGIN, END = "<!-- written by `make bench-steps` -->\n", "<!-- end of steps -->\n"
ROUNDS = 5
STEPS = 50, 100, 200, 400, 800, 1600, 3200, 6400, 12800
TARGETS = 1e-2, 1e-3, 1e-4, 1e-5  # m
CELLS, END_TIME = 8, 10.0  # -, s


class Run(NamedTuple):
    program: str
    problem: str
    settings: dict


class Method(NamedTuple):
    """A scheme of a program; runs with numbers of steps from ``first`` to ``last``.

    ``limit``: the numbers of steps from which the limit is extrapolated, and the order.
    """

    program: str
    title: str
    settings: dict
    first: int
    last: int
    limit: tuple[int, int, int]
    stages: int = 1


METHODS = (
    Method(
        "ufl_beam", "ufl_beam, `EnergyMomentum(order=4)`", {"order": 4}, 50, 3200,
        (12800, 25600, 4), 5,
    ),
    Method("ufl_beam", "ufl_beam, `EnergyMomentum()`", {}, 200, 12800, (51200, 102400, 2)),
    Method(
        "ufl_beam", "ufl_beam, `EnergyMomentumPrinted()`", {"scheme": "EnergyMomentumPrinted"},
        200, 12800, (51200, 102400, 2),
    ),
    Method(
        "exudyn", "Exudyn, trapezoidal rule, full Newton, dense",
        {"newton": "full", "solver": "dense"}, 200, 12800, (51200, 102400, 2),
    ),
    Method(
        "exudyn", "Exudyn, trapezoidal rule, modified Newton, dense",
        {"newton": "modified", "solver": "dense"}, 200, 12800, (51200, 102400, 2),
    ),
    Method("opensees", "OpenSees, Newmark", {}, 200, 6400, (12800, 25600, 2)),
)  # fmt: skip


def settings_of(method, steps):
    return {"cells": CELLS, "dt": END_TIME / steps, "pulse": "triangle", **method.settings}


def ends(result):
    """Positions of both ends; (4,); m."""
    return np.ravel(result["values"]["ends"])


def measured(run, peers):
    """Return the records of all methods, with times and errors for each number of steps."""
    records = []
    for method in METHODS:
        coarse, fine, order = method.limit
        a, b = (
            run(Run(method.program, "P2", settings_of(method, n)), peers) for n in (coarse, fine)
        )
        kept = {"title": method.title, "stages": method.stages, "runs": []}
        kept |= {"failed": (a | b)["failed"]} if "failed" in a | b else {"version": b["version"]}
        if "failed" not in kept:
            kept["limit"] = (ends(b) + (ends(b) - ends(a)) / (2**order - 1)).tolist()
            kept["uncertainty"] = float(np.abs(ends(b) - ends(a)).max() / (2**order - 1))
        records.append(kept)
        print(method.title, kept.get("uncertainty", kept.get("failed")), flush=True)
    for steps in STEPS:
        some = [
            (m, kept)
            for m, kept in zip(METHODS, records, strict=True)
            if "limit" in kept and m.first <= steps <= m.last
        ]
        for _, kept in some:
            kept["runs"].append({"steps": steps, "cpu": [], "error": math.nan})
        for _ in range(ROUNDS):
            for method, kept in some:
                result = run(Run(method.program, "P2", settings_of(method, steps)), peers)
                if "failed" not in result:
                    one = kept["runs"][-1]
                    one["cpu"].append(result["cpu"])
                    one["error"] = float(np.abs(ends(result) - kept["limit"]).max())
        for method, kept in some:
            print(f"{steps:6d} {method.title:50s} {kept['runs'][-1]}", flush=True)
    return records


def time_to(kept, target):
    """Return the time to an error, between runs by powers of the time; s, NaN beyond the runs."""
    points = [
        (statistics.median(one["cpu"]), one["error"])
        for one in kept["runs"]
        if one["cpu"] and one["error"] > 0
    ]
    for (t0, e0), (t1, e1) in pairwise(points):
        if e0 >= target > e1:
            return t0 * (t1 / t0) ** (math.log(e0 / target) / math.log(e0 / e1))
    return math.nan


def save(records, of_machine):
    """Write the records and both tables in the page."""
    with RESULTS.open("w") as file:
        file.writelines(json.dumps(record | of_machine) + "\n" for record in records)
    wide = ("scheme", *(f"{n} steps" for n in STEPS))
    errors = []
    for kept in records:
        by_steps = {one["steps"]: one for one in kept["runs"]}
        cells = [kept["title"]]
        for n in STEPS:
            one = by_steps.get(n)
            said = ""
            if one and one["cpu"]:
                said = f"{one['error']:.1e} ({1e3 * statistics.median(one['cpu']):.3g})"
            cells.append(said)
        errors.append(cells if "limit" in kept else [kept["title"], kept["failed"][:60]])
    head = ("scheme", *(f"{target:g} m" for target in TARGETS))
    times = []
    for kept in records:
        to = [time_to(kept, target) for target in TARGETS]
        times.append([kept["title"], *("" if math.isnan(t) else f"{1e3 * t:.3g}" for t in to)])
    versions = sorted({r["version"] for r in records if "version" in r})
    about = (
        f"Commit {of_machine['commit']}, {of_machine['processor']}, one thread; "
        f"{', '.join(versions)}; medians of {ROUNDS} rounds."
    )
    page = PAGE.read_text()
    before, after = page.split(BEGIN)[0], page.split(END)[1]
    errors_and = (
        "Error of the end positions (m), and in brackets the processor time of the loop (ms):"
    )
    times_to = "Processor time of the loop (ms) to an error:"
    lines = [about, "", errors_and, "", *table(wide, errors), "", times_to, "", *table(head, times)]
    text = "\n".join([*lines, ""])
    PAGE.write_text(before + BEGIN + "\n" + text + "\n" + END + after)


def main():
    """Measure all methods, print and keep the results."""
    shared = runpy.run_path(str(HERE / "__main__.py"))  # its functions
    save(measured(shared["run"], installed()), shared["machine"]())


if __name__ == "__main__":
    main()
