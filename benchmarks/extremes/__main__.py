# SPDX-License-Identifier: MIT
"""Results at extreme parameters.

Run by ``make extremes``.  Each row is a process of its own, two at a time, so that a hang is caught
and a crash is seen.  Writes ``docs/extremes.md`` and its figure; fails if anything is wrong.
"""

import json
import os
import queue
import subprocess
import sys
import threading
import time
from concurrent.futures import ThreadPoolExecutor

import elastic  # noqa: F401  # enters its rows
import inelastic  # noqa: F401
import messages  # noqa: F401
from report import save
from rows import ROWS, Row, run


def results_of(row: Row) -> list[dict]:
    """Run a row in a process; a value that does not end in time is a hang."""
    command = [sys.executable, os.path.dirname(__file__), "--row", row.name]
    process = subprocess.Popen(
        command, stdin=subprocess.DEVNULL, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True
    )
    lines: queue.Queue[str | None] = queue.Queue()

    def read() -> None:
        for line in process.stdout:
            lines.put(line)
        lines.put(None)

    errors: list[str] = []
    threading.Thread(target=read, daemon=True).start()
    threading.Thread(target=lambda: errors.append(process.stderr.read()), daemon=True).start()
    results, word = [], "ends without a word"
    while len(results) < len(row.values):
        try:
            line = lines.get(timeout=row.seconds)
        except queue.Empty:
            word = None
            break
        if line is None:
            break
        results.append(json.loads(line))
    process.kill()
    process.wait()
    for value in row.values[len(results) :]:
        left = {"value": value, "seconds": row.seconds}
        if word is None:
            left |= {"verdict": "HANG", "message": f"not ended after {row.seconds:g} s"}
        else:
            left |= {"verdict": "WRONG", "message": (errors or [word])[0][-300:] or word}
        results.append(left)
    return results


def main() -> int:
    """Run all rows, or those whose names contain an argument; the exit code."""
    if sys.argv[1:2] == ["--row"]:
        run(sys.argv[2])
        return 0
    words = sys.argv[1:]
    rows = [row for row in ROWS.values() if not words or any(w in row.name for w in words)]
    begin = time.perf_counter()
    longest_first = sorted(rows, key=lambda row: -row.seconds)
    results: dict[str, list[dict]] = {}

    def work(row: Row) -> None:
        results[row.name] = one = results_of(row)
        wrong = [r for r in one if r["verdict"] not in ("works", "stops")]
        seconds = sum(r["seconds"] for r in one)
        print(f"{row.name:45s} {len(one):3d} values {seconds:6.1f} s", flush=True)
        for r in one if words else wrong:
            print("    ", {k: v for k, v in r.items() if v != ""}, flush=True)

    with ThreadPoolExecutor(2) as pool:
        list(pool.map(work, longest_first))
    if not words:
        save([(row, results[row.name]) for row in rows])
    bad = sum(r["verdict"] in ("WRONG", "HANG") for one in results.values() for r in one)
    seconds = time.perf_counter() - begin
    print(f"{sum(map(len, results.values()))} runs in {seconds:.0f} s, {bad} wrong or hanging")
    return 1 if bad else 0


if __name__ == "__main__":
    sys.exit(main())
