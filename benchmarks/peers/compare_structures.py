# SPDX-License-Identifier: MIT
"""Structures of civil engineering beside OpenSees, in one run: largest differences and times.

Run by ``make bench-structures``.  Every run is a process of its own with one thread; both programs
run in turn.  Histories are compared at equal times, differences in per cent of the largest value.
"""

import json
import runpy
import statistics
from pathlib import Path
from typing import NamedTuple

import numpy as np
from install import installed
from report import table

HERE = Path(__file__).parent
RESULTS = HERE.parent / "results" / "bench_structures.jsonl"
PAGE = HERE.parents[1] / "docs" / "peers.md"
BEGIN, END = "<!-- written by `make bench-structures` -->\n", "<!-- end of structures -->\n"
ROUNDS = 5


class Run(NamedTuple):
    program: str
    problem: str
    settings: dict


class Case(NamedTuple):
    """A structure in both programs; ``asked``: largest difference that is accepted, in per cent."""

    title: str
    problem: str
    ours: dict
    theirs: dict
    asked: float | None
    rounds: int = ROUNDS


def hinges():
    """Yield hinges without and with deterioration, over small and large rotations."""
    none, some = 0.0, 1.0  # Λ, rad
    for law in ("IMKBilin", "IMKPeakOriented", "IMKPinching"):
        for largest in (0.025, 0.06):
            for words, lost in (
                ("", (none, none, none, none)),
                (", strength, softening, unloading", (some, some, none, some)),
                (", all four modes", (some, some, some, some)),
            ):
                if law == "IMKBilin" and lost[2]:
                    continue
                same = (law != "IMKBilin" or largest < 0.03) and not lost[2]
                settings = {"kind": law, "largest": largest, "lost": lost}
                title = f"{law} to {largest:g} rad{words}"
                yield Case(title, "hinge", settings, settings, 0.5 if same else None, 1)


def cases():
    """Yield all comparisons."""
    for kind, words in (("concrete", "reinforced concrete"), ("steel", "steel")):
        yield Case(f"section of {words}", "section", {"kind": kind}, {"kind": kind}, 0.5)
    for cells in (6, 12, 24):
        title = f"column, {cells} elements"
        theirs = {"cells": cells, "kind": "forceBeamColumn"}
        yield Case(title, "column", {"cells": cells, "degree": 2}, theirs, 0.5, 3)
    theirs = {"cells": 12, "kind": "dispBeamColumn"}
    title = "column, 12 elements, dispBeamColumn"
    yield Case(title, "column", {"cells": 12, "degree": 2}, theirs, None, 1)
    yield from hinges()
    same = {"scale": 4.0, "dt": 0.005}
    for ours, theirs in ((1, 1), (2, 4)):
        title = f"frame, cells a member: {ours} (OpenSees {theirs})"
        yield Case(title, "frame", {**same, "cells": ours}, {**same, "cells": theirs}, 2.0)


def compared(case, run, peers):
    """Return the record of a case."""
    names = "ufl_beam", "opensees"
    runs = {name: [] for name in names}
    for _ in range(case.rounds):
        for name, settings in zip(names, (case.ours, case.theirs), strict=True):
            one = Run(f"{name}_structures", case.problem, settings)
            runs[name].append(run(one, peers))
    kept = {"title": case.title, "asked": case.asked}
    for name in names:
        first = runs[name][0]
        kept[name] = {
            key: first[key] for key in ("version", "failed", "ledger", "repeated") if key in first
        }
        for clock in ("wall", "cpu"):
            kept[name][clock] = [r[clock] for r in runs[name] if clock in r]
    values = [next(iter(runs[name][0].get("values", {"": []}).values())) for name in names]
    n = min(map(len, values))
    if n:
        a, b = (np.array(x[:n]) for x in values)
        kept["steps"], kept["all"] = n, max(map(len, values))
        kept["peak"] = float(abs(b).max())
        kept["difference"] = float(100 * abs(a - b).max() / kept["peak"])
    return kept


def times(result):
    """Return wall and processor time, why a program stopped, and how many steps it repeated."""
    words = [result["failed"]] if "failed" in result else []
    if result["wall"]:
        wall, cpu = (statistics.median(result[clock]) for clock in ("wall", "cpu"))
        words.insert(0, f"{wall:.3g}, {cpu:.3g}")
    if result.get("repeated"):
        words.append(f"{result['repeated']} steps repeated")
    return "; ".join(words)


def row(kept):
    """Return a line of the table."""
    asked, difference = kept["asked"], kept.get("difference")
    shown = "" if difference is None else f"{difference:.3f} %"
    if kept.get("steps") != kept.get("all"):
        shown += f" (first {kept['steps']} of {kept['all']} states)"
    met = (
        ""
        if asked is None
        else "yes"
        if difference is not None and difference <= asked
        else "**no**"
    )
    return [
        kept["title"], shown, f"{asked:g} %" if asked else "", met if asked else "",
        *(times(kept[name]) for name in ("ufl_beam", "opensees")),
    ]  # fmt: skip


def save(records, of_machine):
    """Write the records and the table in the page."""
    with RESULTS.open("w") as file:
        file.writelines(json.dumps(record | of_machine) + "\n" for record in records)
    clocks = "wall time, processor time (s)"
    head = (
        "structure", "largest difference", "asked", "met", f"ufl_beam: {clocks}",
        f"OpenSees: {clocks}",
    )  # fmt: skip
    lines = table(head, [row(record) for record in records])
    versions = sorted({r[name]["version"] for r in records for name in ("ufl_beam", "opensees")})
    about = (
        f"Commit {of_machine['commit']}, {of_machine['processor']}, one thread; "
        f"{', '.join(versions)}; medians of up to {ROUNDS} rounds."
    )
    ledger = max(r["ufl_beam"].get("ledger", 0.0) for r in records)
    closed = f"Largest imbalance of the ledger of the frame: {ledger:.1e} of the energy."
    page = PAGE.read_text()
    before, after = page.split(BEGIN)[0], page.split(END)[1]
    text = "\n".join([about, closed, "", *lines, ""])
    PAGE.write_text(before + BEGIN + "\n" + text + "\n" + END + after)


def main():
    """Compare all structures, print and keep the results."""
    shared = runpy.run_path(str(HERE / "__main__.py"))  # its functions
    peers, records = installed(), []
    for case in cases():
        records.append(compared(case, shared["run"], peers))
        print(" | ".join(row(records[-1])), flush=True)
    save(records, shared["machine"]())


if __name__ == "__main__":
    main()
