# SPDX-License-Identifier: MIT
"""ufl_beam beside Exudyn, OpenSees and a C loop, in one run: time, memory and error.

Run by ``make bench-peers``, on an idle machine.  Every run is a process of its own with one thread;
what is timed is the time loop.  Cases that are compared run in turn, again and again.
"""

import argparse
import json
import os
import statistics
import subprocess
import sys
from itertools import groupby
from pathlib import Path

import cases
import report
from install import installed
from problems import PROBLEMS

HERE = Path(__file__).parent
RESULTS = HERE.parent / "results" / "bench_peers.jsonl"
LIMIT = 600  # s for one run
ALONE = dict.fromkeys(
    ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS", "NUMBA_NUM_THREADS"), "1"
)


def machine():
    """Commit, versions and machine, asked in a process of its own: this one stays small."""
    code = "import json, records; print(json.dumps(records.machine()))"
    command = [sys.executable, "-c", code]
    done = subprocess.run(command, cwd=HERE.parent, capture_output=True, text=True, check=True)
    return json.loads(done.stdout)


def run(case, peers):
    """One run: what the program says, or why it has not come to an end."""
    path = os.pathsep.join(filter(None, (os.environ.get("PYTHONPATH"), str(peers))))
    command = [sys.executable, str(HERE / "one.py"), case.program, case.problem]
    try:
        done = subprocess.run(
            [*command, json.dumps(case.settings)], capture_output=True, text=True, timeout=LIMIT,
            env=os.environ | ALONE | {"PYTHONPATH": path}, check=False,
        )  # fmt: skip
    except subprocess.TimeoutExpired:
        return {"failed": f"not ended after {LIMIT} s"}
    lines = [line for line in done.stdout.splitlines() if line.startswith("{")]
    if not lines:
        return {"failed": (done.stderr.strip().splitlines() or ["ended without a word"])[-1]}
    return json.loads(lines[-1])


def record(case, runs):
    """What is kept of the runs of a case: times in the order of the rounds, medians of memory."""
    first = runs[0]
    kept = {"program": case.program, "problem": case.problem, "label": case.label}
    kept |= {"settings": case.settings, "part": case.part}
    for name in ("version", "steps", "newton", "jacobians", "failed"):
        if name in first:
            kept[name] = first[name]
    if all("wall" in r for r in runs) and "failed" not in kept:
        for clock in ("wall", "cpu"):
            kept[clock] = [r[clock] for r in runs]
        for name in ("memory", "memory_before"):
            kept[name] = statistics.median(r[name] for r in runs)
    if "values" in first and "failed" not in first and "steps" not in case.settings:
        arguments = {k: v for k, v in case.settings.items() if k == "turns"}
        kept["measures"] = PROBLEMS[case.problem].measures(first["values"], **arguments)
    return kept


def show(kept):
    settings = kept["settings"]
    name = f"{kept['program']} {kept['label']}"
    line = f"{kept['problem']} {settings['cells']:6d} {settings.get('dt', '')!s:>6} {name:30s}"
    if "wall" in kept:
        for clock in ("wall", "cpu"):
            line += f" {1e6 * statistics.median(kept[clock]) / kept['steps']:10.1f}"
        line += f" {kept['newton'] / kept['steps']:6.2f} it" if "newton" in kept else " " * 10
        line += f" {kept['memory']:6.0f} MB"
    for what, value in kept.get("measures", {}).items():
        line += f"  {what} {value:.4g}"
    print(line + f"  {kept.get('failed', '')}", flush=True)


def measure(chosen, rounds, peers):
    """Records of groups of cases that run in turn; rounds: of short groups, of long ones."""
    for _, group in groupby(chosen, key=lambda case: case.group):
        group = list(group)
        runs = {i: [] for i in range(len(group))}
        for _ in range(rounds[any(case.long for case in group)]):
            for i, case in enumerate(group):
                runs[i].append(run(case, peers))
        for i, case in enumerate(group):
            kept = record(case, runs[i])
            show(kept)
            yield kept


def updated(old, new):
    """Records of which new ones take the place of old ones of the same group."""
    order = {}
    for case in (*cases.tables(), *cases.ladders()):
        order.setdefault(case.group, len(order))
    groups = [(cases.group_of(one["part"], one["problem"], one["settings"]), one) for one in new]
    measured = {group for group, _ in groups}
    for one in old:
        group = cases.group_of(one["part"], one["problem"], one["settings"])
        if group in order and group not in measured:
            groups.append((group, one))
    return [one for _, one in sorted(groups, key=lambda pair: order[pair[0]])]


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--quick", action="store_true", help="small cases, few rounds: 5 minutes")
    parser.add_argument("--only", nargs="*", metavar="P", help="problems, such as P2 P4")
    parser.add_argument("--cells", nargs="*", type=int)
    parser.add_argument("--dt", nargs="*", type=float, help="steps (s)")
    parser.add_argument("--programs", nargs="*", help="ufl_beam exudyn opensees c")
    parser.add_argument("--part", choices=("tables", "figure"))
    parser.add_argument(
        "--repeat", type=int, help="rounds; 5, of long cases 3, in the figure 2 and 1"
    )
    parser.add_argument(
        "--update", action="store_true",
        help="let what is measured take the place of what was; for whole groups of programs",
    )  # fmt: skip
    options = parser.parse_args()

    def wanted(case):
        asked = (
            (options.only, case.problem),
            (options.cells, case.settings["cells"]),
            (options.dt, case.settings.get("dt")),
            (options.programs, case.program),
            (options.part, case.part),
        )
        return all(not values or value in values for values, value in asked) and not (
            options.quick and case.long
        )

    parts = ((cases.tables(), (5, 3), 2), (cases.ladders(), (2, 1), 1))
    peers, where, records = installed(), machine(), []
    print(where)
    print(f"{'problem, cells, step (s), program':56s} {'µs/step':>10} {'cpu':>10}  iterations/step")
    some = (options.only, options.cells, options.dt, options.programs, options.part)
    RESULTS.parent.mkdir(exist_ok=True)
    old = RESULTS.read_text().splitlines() if options.update else []
    with open(os.devnull if any(some) else RESULTS, "w") as file:
        for part, rounds, quick in parts:
            if alike := options.repeat or (options.quick and quick):
                rounds = alike, alike
            for kept in measure([case for case in part if wanted(case)], rounds, peers):
                records.append(kept | where)
                file.write(json.dumps(records[-1]) + "\n")
                file.flush()
    if options.update:
        records = updated(map(json.loads, old), records)
        RESULTS.write_text("".join(json.dumps(one) + "\n" for one in records))
        report.save(records)
    elif any(some):
        print("\n".join(report.of_claims(records)))
    else:
        report.save(records)


if __name__ == "__main__":
    sys.exit(main())
