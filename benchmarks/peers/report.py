# SPDX-License-Identifier: MIT
"""Tables and the figure, made of the records of one run: ``python3 report.py`` writes them anew."""

import json
import statistics
from itertools import groupby
from pathlib import Path

from claims import claims, front, unit

import ufl_beam as ub
from ufl_beam.plotting.style import BLUE, INK, RED

ROOT = Path(__file__).parents[2]
RESULTS = ROOT / "benchmarks" / "results" / "bench_peers.jsonl"
PAGE = ROOT / "docs" / "peers.md"
PICTURE = PAGE.parent / "pictures" / "peers.png"
BEGIN, END = "<!-- written by `make bench-peers` -->\n", "<!-- end -->\n"
NAMES = {
    "P1": "Roll-up", "P2": "Flying beam", "P3": "Swing", "P4": "Portal", "P5": "Cantilever",
    "P6": "Tumbling beam",
}  # fmt: skip
PROGRAMS = {"ufl_beam": "ufl_beam", "exudyn": "Exudyn", "opensees": "OpenSees", "c": "C loop"}
COLOURS = {"ufl_beam": RED, "exudyn": BLUE, "opensees": INK}
STYLES = ("o-", "s--", "^:", "v-.", "D-", "P--")


def read():
    return [json.loads(line) for line in RESULTS.read_text().splitlines()]


def table(head, rows):
    return ["| " + " | ".join(head) + " |", "|" + "---|" * len(head)] + [
        "| " + " | ".join(row) + " |" for row in rows
    ]


def words_of(claim):
    return claim.line, claim.ours, claim.peer, claim.ratio, "yes" if claim.met else "**no**"


def of_claims(records):
    head = ("line", "ufl_beam", "the other", "ratio", "met")
    return table(head, [words_of(claim) for claim in claims(records) if claim.met is not None])


def row(record):
    """One line of a table of times."""
    said = [PROGRAMS[record["program"]], record["label"]]
    measures = record.get("measures", {})
    if "wall" not in record:
        return [*said, record.get("failed", "?")[:90], "", "", "", ""]
    per = f"{record['newton'] / record['steps']:.2f}" if "newton" in record else ""
    only = f" (first {record['steps']} steps)" if "steps" in record["settings"] else ""
    error = f"{measures['error']:.2e}" if "error" in measures else ""
    scatter = max(record["wall"]) / min(record["wall"])
    return [
        *said, f"{unit(record, 'steps'):.4g}{only}", per, f"{record['memory']:.0f}", error,
        f"{scatter:.2f}",
    ]  # fmt: skip


def of_times(records):
    head = ("program", "setting", "µs per step", "iterations", "MB", "error (m)", "max/min time")
    lines = []

    def scene(r):
        s = r["settings"]
        told = [f"{s['cells']} cells"]
        told += [f"Δt = {s['dt']:g} s"] if "dt" in s else []
        told += [f"{s['turns']:g} turns, 8 load steps"] if "turns" in s else []
        return f"{NAMES[r['problem']]}, " + ", ".join(told)

    shown = [r for r in records if r["part"] == "tables"]
    for title, some in groupby(shown, key=scene):
        lines += ["", f"### {title}", "", *table(head, [row(r) for r in some])]
    return lines


def of_machine(records):
    """A line for each processor: its problems, commits and versions."""
    lines = []
    for processor in dict.fromkeys(r["processor"] for r in records):
        some = [r for r in records if r["processor"] == processor]
        problems = dict.fromkeys(NAMES[r["problem"]] for r in some)
        commits = dict.fromkeys(r["commit"] for r in some)
        versions = sorted({r["version"] for r in some if r.get("version", "C") != "C"})
        rounds = max((len(r["wall"]) for r in some if "wall" in r), default=0)
        lines += [
            f"* {', '.join(problems)}: commit {', '.join(commits)}, {processor}, one thread; "
            f"{', '.join(versions)}; medians of up to {rounds} rounds."
        ]
    return lines


def save(records):
    """Write the generated part of the page, and the figure; print what was claimed."""
    draw(records)
    generated = [*of_machine(records), "", *of_claims(records), *of_times(records), ""]
    page = PAGE.read_text()
    before, after = page.split(BEGIN)[0], page.split(END)[1]
    PAGE.write_text(before + BEGIN + "\n" + "\n".join(generated) + "\n" + END + after)
    print("\n".join(of_claims(records)))


def draw(records):
    """Error over wall time: runs as faint dots, the best of each setting as a line."""
    drawn = [r for r in records if r["part"] == "figure" and "error" in r.get("measures", {})]
    problems = sorted({r["problem"] for r in drawn})
    if not problems:
        return
    # A setting has the same style in all panels.
    settings = {
        name: sorted({r["label"] for r in drawn if r["program"] == name}) for name in COLOURS
    }
    with ub.picture((10.0, 4.3 * len(problems))) as figure:
        panels = figure.subplots(len(problems), 1, squeeze=False).flat
    for ax, problem in zip(panels, problems, strict=True):
        here = [r for r in drawn if r["problem"] == problem]
        curves = sorted({(r["program"], r["label"]) for r in here}, reverse=True)
        for program, label in curves:
            some = [r for r in here if (r["program"], r["label"]) == (program, label)]
            style, colour = STYLES[settings[program].index(label)], COLOURS[program]
            dots = [(statistics.median(r["wall"]), r["measures"]["error"]) for r in some]
            ax.loglog(*zip(*dots, strict=True), style[0], color=colour, ms=4, alpha=0.3)
            name = f"{PROGRAMS[program]}, {label}"
            ax.loglog(*zip(*front(some), strict=True), style, color=colour, ms=6, label=name)
        ax.set_title(NAMES[problem], loc="left")
        ax.set(xlabel="time of the loop (s)", ylabel="error (m)")
        ax.grid(which="major", color="0.9")
        ax.legend(loc="center left", bbox_to_anchor=(1.0, 0.5), frameon=False)
    figure.savefig(PICTURE)


if __name__ == "__main__":
    save(read())
