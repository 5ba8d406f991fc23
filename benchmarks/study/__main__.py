# SPDX-License-Identifier: MIT
"""The work-precision study: schemes, steps and cells over scenes, and each dial by itself.

Run by ``make study``, on an idle machine, one thread; ``--quick`` for two minutes of coarse
settings; names of scenes for some of them.  One run after the other, so that none disturbs another.
Writes ``benchmarks/results/study.json``, and from it ``docs/study.md`` with its figures; a quick or
partial study writes to ``output/study`` instead.
"""

import argparse
import json
import sys
import time
from pathlib import Path

sys.path.append(str(Path(__file__).parents[1]))

from cases import CASES
from measure import Bench
from records import in_lines, machine
from report import save

ROOT = Path(__file__).parents[2]


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("names", nargs="*", help="parts of the names of scenes; all by default")
    parser.add_argument("--quick", action="store_true", help="few and coarse settings")
    parser.add_argument("--report", action="store_true", help="from results that are there")
    options = parser.parse_args()
    whole = not (options.quick or options.names)
    results = (
        ROOT / "benchmarks" / "results" if whole else ROOT / "output" / "study"
    ) / "study.json"
    docs = ROOT / "docs" if whole else results.parent
    results.parent.mkdir(parents=True, exist_ok=True)
    if not options.report:
        chosen = [c for c in CASES if not options.names or any(n in c.name for n in options.names)]
        measured, failed, begin = [], {}, time.perf_counter()
        for case in chosen:
            since = time.perf_counter()
            try:
                measured.append(Bench(case, options.quick).results())
            except Exception as error:  # the other scenes are still worth it
                failed[case.name] = f"{type(error).__name__}: {error}"
                print(f"{case.name:25s} {failed[case.name]}", flush=True)
                continue
            took = time.perf_counter() - since
            print(f"{case.name:25s} {len(measured[-1]['runs']):4d} runs {took:6.1f} s", flush=True)
        took = time.perf_counter() - begin
        study = {"quick": options.quick, "seconds": took, "failed": failed, **machine()}
        results.write_text(in_lines({**study, "cases": measured}) + "\n")
    save(json.loads(results.read_text()), docs)
    print(f"written: {results}, {docs / 'study.md'}")
    return 0


if __name__ == "__main__":
    sys.exit(main())
