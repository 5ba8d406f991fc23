# SPDX-License-Identifier: MIT
"""Cost of a beam in space beside a beam in the plane: steps, memory, and the first result.

Run on an idle machine, one thread::

    ./env python3 benchmarks/bench_space.py

The tumbling beam and the flying beam of ``benchmarks/peers`` run in turn, each in a process of its
own.  The first result is the time of a whole process with a beam of ten cells, with an empty cache
of compiled code and with a full one.  Prints the tables of ``docs/space.md`` and writes one JSON
line for each row to ``benchmarks/results/bench_space.jsonl``.
"""

import argparse
import json
import os
import statistics
import subprocess
import sys
import tempfile
import time
from pathlib import Path
from typing import NamedTuple

from records import keep, machine

HERE = Path(__file__).parent
PLANE, SPACE = "P2", "P6"
STEPS = {8: 1000, 64: 1000, 512: 500, 4096: 60}
MANY = 100_000
FIRST = """
import ufl_beam as ub
section = ub.Section(EA=1e4, GA=1e4, EI=500.0, rhoA=1.0, rhoI=10.0{section})
beam = ub.Beam({start}, {end}, section, cells=10)
load = ub.PointLoad(beam.start, force={force}, moment={moment}, amplitude=lambda t: 40.0 * t)
scene = ub.Scene([beam], loads=[load])
run = ub.simulate(scene, ub.EnergyMomentum(), t=(0, 1), dt=0.01, progress=False)
print(run.position(beam.end)[-1])
"""
IN_PLANE = {"section": "", "start": (6, 0), "end": (0, 8), "force": (0.1, 0), "moment": -1.0}
IN_SPACE = {
    "section": ", GA3=1e4, EI2=500.0, GJ=500.0, rhoI2=10.0", "start": (6, 0, 0), "end": (0, 8, 0),
    "force": (0.1, 0, 0), "moment": (0, -0.5, -1),
}  # fmt: skip


class Run(NamedTuple):
    step: float  # µs of wall time
    iterations: float  # of a step
    memory: float  # of the scene, bytes of a cell


def run(problem, cells, steps):
    settings = json.dumps({"cells": cells, "dt": 0.01, "steps": steps})
    command = [sys.executable, str(HERE / "peers" / "one.py"), "ufl_beam", problem, settings]
    done = subprocess.run(command, capture_output=True, text=True, check=True)
    told = json.loads(next(x for x in done.stdout.splitlines() if x.startswith("{")))
    memory = (told["memory"] - told["memory_before"]) * 2**20
    return Run(1e6 * told["wall"] / steps, told["newton"] / steps, memory / cells)


def first(scene, cache):
    """Wall time of a process that computes 100 steps; s."""
    command, begin = [sys.executable, "-c", FIRST.format(**scene)], time.perf_counter()
    env = os.environ | {"XDG_CACHE_HOME": cache}
    subprocess.run(command, capture_output=True, env=env, check=True)
    return time.perf_counter() - begin


def in_turn(rounds, cells, steps, quantity):
    """Medians in the plane and in space, median of the ratios of the rounds, and the last runs."""
    runs = [[run(problem, cells, steps) for problem in (PLANE, SPACE)] for _ in range(rounds)]
    pairs = [[getattr(one, quantity) for one in pair] for pair in runs]
    ratio = statistics.median(b / a for a, b in pairs)
    return *(statistics.median(column) for column in zip(*pairs, strict=True)), ratio, runs[-1]


def show(line, plane, space, ratio, limit, met):
    keep("bench_space", {"case": line, "plane": plane, "space": space, "ratio": ratio})
    row = line, f"{plane:.3g}", f"{space:.3g}", f"{ratio:.2f}", limit, "yes" if met else "**no**"
    print(f"| {' | '.join(row)} |", flush=True)


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--rounds", type=int, default=5)
    parser.add_argument("--cells", nargs="*", type=int, default=[*STEPS, MANY])
    options = parser.parse_args()
    where = machine()
    print(f"Commit {where['commit']}, {where['processor']}, one thread, DOLFINx {where['dolfinx']}")
    print("\n| | plane | space | ratio | limit | met |\n|---|---|---|---|---|---|")
    for n in (n for n in options.cells if n in STEPS):
        a, b, ratio, last = in_turn(options.rounds, n, STEPS[n], "step")
        its = " and ".join(f"{one.iterations:.2f}" for one in last)
        line = f"step, {n} cells (µs); {its} iterations"
        show(line, a, b, ratio, "ratio 3.5", ratio <= 3.5)
    if MANY in options.cells:
        a, b, ratio, _ = in_turn(2, MANY, 3, "memory")
        show(f"memory of a cell, {MANY} cells (bytes)", a, b, ratio, "ratio 3", ratio <= 3)
    empty, full = [], []
    for scene in (IN_PLANE, IN_SPACE):
        with tempfile.TemporaryDirectory() as cache:
            empty.append(first(scene, cache))
            full.append(statistics.median(first(scene, cache) for _ in range(options.rounds)))
    for line, (a, b), limit in (
        ("first result, empty cache (s)", empty, 30),
        ("first result, full cache (s)", full, 3),
    ):
        show(line, a, b, b / a, f"{limit} s", b <= limit)


if __name__ == "__main__":
    main()
