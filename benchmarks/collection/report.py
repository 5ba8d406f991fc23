# SPDX-License-Identifier: MIT
"""The page of the collection, from its results."""

from pathlib import Path

from records import machine

PAGE = Path(__file__).parents[2] / "docs" / "collection.md"

ISSUES = "https://github.com/OpenSees/OpenSees/issues"


def outcome(row: dict) -> str:
    """Describe the outcome of a model."""
    if row["verdict"] == "end":
        return "end"
    if row["verdict"] == "stops":
        return f"stops at {row['end']:.4g}"
    return f"**{row['verdict']}** at {row['end']:.4g}" if row["end"] else f"**{row['verdict']}**"


def confirmation(row: dict) -> str:
    """Describe the comparison of a model."""
    if "limit" in row:
        return f"limit analysis {row['limit']:.4g}; quarter of the step {row['difference']:.0e}"
    if "peak" in row:
        return f"{row['difference']:.0e} of the peak, {row['history']:.0e} of the history"
    return f"quarter of the step stops {row['difference']:.0e} apart" if "difference" in row else ""


def numbers(values: list[float]) -> str:
    """Write relative differences."""
    return ", ".join(f"{value:.0e}" for value in values) or "—"


def in_opensees(row: dict) -> list[str]:
    """Describe outcome, difference and time in OpenSees, each way it ran."""
    found = row["opensees"]
    runs = found["runs"]
    ends = [
        "end" if r["end"] is None else f"fails at {r['end']:.4g}".replace("fails at nan", "600 s")
        for r in runs
    ]
    halved = [f"{r['halved']}" for r in runs]
    apart = [numbers(r["apart"]) for r in runs]
    elastic = [numbers(found["elastic"])]
    seconds = [f"{r['seconds']:.1f}" for r in runs]
    return [" / ".join(column) for column in (ends, halved, elastic, apart, seconds)]


def cause(message: str) -> str:
    """Return the cause in a message: the text between time and numbers of iterations."""
    return message.split(" s: ", 1)[-1].split("; Newton's")[0].split("; residual")[0]


def save(rows: list[dict]) -> None:
    """Write docs/collection.md."""
    here = machine()
    count = {v: sum(r["verdict"] == v for r in rows) for v in ("end", "stops", "FAILS", "WRONG")}
    stopped_there = [r["name"] for r in rows if "fails" in in_opensees(r)[0]]
    lines = [
        "# Models that are hard to converge",
        "",
        "Written by `make collection`; do not edit. The models are of the kinds that users of "
        "other programs report as failures to converge: issues",
        f"of OpenSees ([688]({ISSUES}/688), [1445]({ISSUES}/1445), [1533]({ISSUES}/1533), "
        f"[1625]({ISSUES}/1625), [1666]({ISSUES}/1666), [1669]({ISSUES}/1669)), and others.",
        "The hinge of issue 688, and the materials and the section of issue 1625, have the numbers "
        "of the threads; the other models are of the same kinds.",
        "Models and steps: [benchmarks/collection](../benchmarks/collection).",
        "",
        f"Commit {here['commit']}, Python {here['python']}, DOLFINx {here['dolfinx']}, "
        f"{here['processor']}, one thread.",
        "",
        f"Of {len(rows)} models {count['end']} reach the end, {count['stops']} stop at a limit "
        f"load with a message that names hinges or cells of the mechanism, {count['FAILS']} fail, "
        f"{count['WRONG']} disagree with their confirmation. OpenSees, with the fallbacks below, "
        f"stops before the end in {len(stopped_there)} of them: {', '.join(stopped_there)}.",
        "",
        "Each model runs twice, with its step and with a quarter of it; *cut steps* are the steps "
        "that were divided into substeps in both runs. A model that",
        "reaches the end is compared with the second run: the largest value, and the largest "
        "difference of the histories, relative to the largest value.",
        "A load at which a model stops is compared with an independent limit analysis: linear "
        "programming on the displaced geometry, a closed form,",
        "or an integration of the column. Times are of the first run and include building.",
        "",
        "The remaining columns belong to OpenSees 3.8 in the same run, with the same cells, "
        "layers, laws, masses and steps, see",
        "[to_opensees.py](../benchmarks/collection/to_opensees.py). Two values with a slash "
        "between them come from two runs:",
        "",
        "* a prescribed motion runs as an imposed motion / under displacement control,",
        "* a loaded model with hinges of zero length has springs of 1000 EI/L / 100 EI/L in their "
        "place,",
        "* a path runs under displacement control / under OpenSees' arc length.",
        "",
        "OpenSees tries Newton's method, line search, Krylov-Newton and the initial stiffness in "
        "each step, with 50 iterations each, and halves the step up to six times (*halved*). "
        "*Elastic* is the difference between both programs under a thousandth of the loads and "
        "motions. *Apart* has two numbers, the difference of the largest values, if both programs "
        "reach the end, and the largest difference of the histories over their common steps. "
        "Where this package stops at a limit load, OpenSees should fail; if it reaches the end, it "
        "jumps to another equilibrium. Springs of Ibarra, Medina and Krawinkler differ for the "
        "reasons in [peers.md](peers.md). Contact differs because its damping does.",
        "",
        "| model | kind | outcome | cut steps | confirmed by | s | OpenSees | halved | elastic "
        "| apart | s |",
        "|---|---|---|--:|---|--:|---|--:|--:|--:|--:|",
    ]
    lines += [
        f"| {r['name']} | {r['kind']} | {outcome(r)} | {r['cut']}, {r['cut_fine']} | "
        f"{confirmation(r)} | {r['seconds']:.1f} | {' | '.join(in_opensees(r))} |"
        for r in rows
    ]
    lines += [
        "",
        "## Why they are hard",
        "",
        "| model | reason | compared |",
        "|---|---|---|",
    ]
    lines += [f"| {r['name']} | {r['source']} | {r['quantity']} |" for r in rows]
    stopped = [r for r in rows if r["message"]]
    if stopped:
        lines += ["", "## Messages", "", "| model | cause in the message |", "|---|---|"]
        lines += [f"| {r['name']} | {cause(r['message'])} |" for r in stopped]
    if any(r["failure"] for r in rows):
        lines += ["", "## Failures of this package", ""]
        lines += [f"* {r['name']}: {r['failure']}" for r in rows if r["failure"]]
    PAGE.write_text("\n".join(lines) + "\n")
