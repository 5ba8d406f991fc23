# SPDX-License-Identifier: MIT
"""Whether the setting that ``tradeoff`` recommends for a budget takes as long as was asked.

Run on an idle machine, one thread::

    ./env python3 benchmarks/bench_budget.py

For each dynamic scene of the study: the best within a second, then that setting again and again.
Prints a table and writes one JSON line per scene to ``benchmarks/results/bench_budget.jsonl``.
"""

import argparse
import statistics
import sys
from pathlib import Path

from records import keep

import ufl_beam as ub

sys.path.append(str(Path(__file__).parent / "study"))

from cases import CASES


def measure(case, budget, repeat):
    """What was asked, what it took in the trade-off, and again; s."""
    scene, place = case.make()
    found = ub.tradeoff(
        scene,
        {case.name: lambda solution: solution.position(place)[-1]},
        scheme=ub.EnergyMomentum(),
        t=(0.0, case.end),
        dt=case.end / case.steps,
        budget=budget,
    )
    again = [ub.simulate(scene, **found.recommended, progress=False).seconds for _ in range(repeat)]
    return {
        "case": case.name, "kind": case.kind, "asked_s": budget, "measured_s": found.best.seconds,
        "again_s": again, "ratio": statistics.median(again) / budget, "spent_s": found.spent,
    }  # fmt: skip


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--budget", type=float, default=1.0, help="seconds")
    parser.add_argument("--repeat", type=int, default=5, help="runs of what is recommended")
    options = parser.parse_args()
    print(f"{'':24s} {'asked':>6} {'measured':>9} {'again':>6} {'ratio':>6} {'spent':>6}   s")
    for case in (case for case in CASES if case.dynamic):
        one = measure(case, options.budget, options.repeat)
        keep("bench_budget", one)
        print(
            f"{case.name:24s} {one['asked_s']:6.2f} {one['measured_s']:9.2f} "
            f"{statistics.median(one['again_s']):6.2f} {one['ratio']:6.2f} "
            f"{one['spent_s']:6.1f}",
            flush=True,
        )


if __name__ == "__main__":
    main()
