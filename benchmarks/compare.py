# SPDX-License-Identifier: MIT
"""Benchmarks of two commits side by side: ratios of times that were measured in turn.

Run on an idle machine::

    make bench-compare with=COMMIT only="bench_step bench_inelastic"

Both commits are checked out in a temporary directory.  Each round runs a benchmark in one and then
in the other, in the next round the other way round.  A ratio is taken within a round, and the table
has the median over the rounds.  A line after it names the cases that one commit lacks, and those
that are slower: by more than 5 % in the median, and in each round.  No record is written.
"""

import argparse
import json
import statistics
import subprocess
import tempfile
from contextlib import ExitStack
from pathlib import Path

HERE = Path(__file__).resolve().parents[1]
TITLES = "case", "scene", "cells", "processes", "variant"
"""Fields of a record that say what was measured."""

TIMES = "us_per", "ms_per", "us_median", "scene_ms", "building_ms"
"""Beginnings of the names of times in a record."""


def times(records):
    """Times of the records of a benchmark: {(title, name): number}."""
    found = {}
    for record in records:
        title = ", ".join(f"{record[name]}" for name in TITLES if name in record)
        for name, value in record.items():
            if name.startswith(TIMES):
                found[title, name] = value
    return found


SLOWER = 1.05
"""Median ratio above which a case is slower, if all its ratios are above one."""


def table(rounds):
    """Markdown table of pairs of :func:`times`, a pair for each round, and a line of conclusions.

    A case that one of the commits lacks in any round is missing.
    """
    lines = ["| case | time | other | this | this / other | range |", "|---|---|--:|--:|--:|--:|"]
    cases = dict.fromkeys(case for pair in rounds for times in pair for case in times)
    missing, slower = [], []
    for case in cases:
        title, name = case
        if not all(case in times for pair in rounds for times in pair):
            missing.append(f"{title}, {name}")
            continue
        pairs = [(other[case], this[case]) for other, this in rounds]
        other, this = (statistics.median(one) for one in zip(*pairs, strict=True))
        ratios = [this / other for other, this in pairs]
        ratio = statistics.median(ratios)
        if ratio > SLOWER and min(ratios) > 1.0:
            slower.append(f"{title}, {name}")
        lines.append(
            f"| {title} | {name} | {other:.4g} | {this:.4g} | {ratio:.2f} "
            f"| {min(ratios):.2f} to {max(ratios):.2f} |"
        )
    ends = (
        f"{len(found)} {of}{''.join(f'; {case}' for case in found)}"
        for found, of in ((missing, "missing"), (slower, f"slower by more than {SLOWER - 1:.0%}"))
    )
    return "\n".join([*lines, "", f"{len(cases)} cases: {', '.join(ends)}"])


def check_out(repository, commit, place):
    """Check a commit out at a place; what it was is the return value."""
    git = ["git", "-C", str(repository)]
    subprocess.run([*git, "worktree", "add", "-q", "--detach", str(place), commit], check=True)
    said = subprocess.run(
        ["git", "-C", str(place), "log", "-1", "--format=%h %s"],
        check=True, capture_output=True, text=True,
    )  # fmt: skip
    return said.stdout.strip()


def run(place, benchmark, arguments):
    """Times of one run of a benchmark in a checked out commit."""
    results = place / "benchmarks" / "results" / f"{benchmark}.jsonl"
    results.unlink(missing_ok=True)
    script = f"benchmarks/{benchmark}.py"
    command = ["./env", "python3", script, *arguments]
    subprocess.run(command, cwd=place, check=True, stdout=subprocess.DEVNULL)
    return times(map(json.loads, results.read_text().splitlines()))


def compare(repository, other, this, benchmarks, rounds, arguments=()):
    """Run benchmarks of two commits in turn; yield lines of markdown."""
    with ExitStack() as stack:
        folder = Path(stack.enter_context(tempfile.TemporaryDirectory()))
        places = folder / "other", folder / "this"
        for place, commit in zip(places, (other, this), strict=True):
            remove = ["git", "-C", str(repository), "worktree", "remove", "--force", str(place)]
            stack.callback(subprocess.run, remove, check=False)
            yield f"{place.name}: {check_out(repository, commit, place)}"
        for benchmark in benchmarks:
            measured = []
            for turn in range(rounds):
                order = places if turn % 2 == 0 else places[::-1]
                found = {place: run(place, benchmark, arguments) for place in order}
                measured.append(tuple(found[place] for place in places))
            yield f"\n{benchmark}, medians of {rounds} rounds\n\n{table(measured)}"


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("other", help="commit to compare with")
    parser.add_argument("--this", default="HEAD", help="commit that is compared")
    default = ["bench_step", "bench_inelastic", "bench_nothing"]
    parser.add_argument("--only", nargs="*", default=default, help="names of benchmarks")
    parser.add_argument("--rounds", type=int, default=7)
    options, arguments = parser.parse_known_args()
    parts = options.other, options.this, options.only or default, options.rounds, arguments
    for line in compare(HERE, *parts):
        print(line, flush=True)


if __name__ == "__main__":
    main()
