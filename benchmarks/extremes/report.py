# SPDX-License-Identifier: MIT
"""The table and the figure of the study, made of its results."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
from rows import Row

import ufl_beam as ub
from ufl_beam.plotting.style import INK, scale

DOCS = Path(__file__).parents[2] / "docs"
SMALLEST = 1e-17
"""Errors below are drawn there."""

Results = list[tuple[Row, list[dict[str, Any]]]]


def save(results: Results) -> None:
    """Write ``docs/extremes.md`` and its figure."""
    picture = DOCS / "pictures" / "extremes.png"
    _draw(results, picture)
    counts = {
        verdict: sum(r["verdict"] == verdict for _, one in results for r in one)
        for verdict in ("works", "stops", "WRONG", "HANG")
    }
    lines = [
        "# Results at extreme parameters",
        "",
        "Written by `make extremes`; do not edit. Each value is one simulation. Its error is the",
        "difference from an independent result. The allowed error follows from the tolerance of",
        "Newton's method, the order of the scheme and amplified round-off; its derivation is in",
        "[benchmarks/extremes](../benchmarks/extremes).",
        "",
        f"Of {sum(counts.values())} runs {counts['works']} work, {counts['stops']} stop with a "
        f"message that names the cause, {counts['WRONG']} return a wrong result or a message "
        f"without the cause, {counts['HANG']} do not end.",
        "",
        "![Errors relative to the allowed error](pictures/extremes.png)",
        "",
        "*Dots: error relative to the allowed error; crosses: runs that stop with a message.*",
        "",
        "| case | parameter | works: largest error, allowed error; iterations a step | stops |",
        "|---|---|---|---|",
    ]
    lines += [_line(row, one) for row, one in results]
    lines += ["", "## Each value", ""]
    for row, one in results:
        lines += [f"### {row.name}", ""]
        lines += [f"Parameter: {row.varied}. Compared with: {row.against}.", ""]
        lines += [
            "| value | error | allowed error | iterations a step | verdict |",
            "|---|---|---|---|---|",
        ]
        lines += [_detail(r) for r in one] + [""]
    (DOCS / "extremes.md").write_text("\n".join(lines).rstrip() + "\n")


def _text(value: Any) -> str:
    if isinstance(value, list | tuple):
        return ", ".join(map(_text, value))
    return f"{value:g}" if isinstance(value, int | float) else str(value)


def _line(row: Row, one: list[dict[str, Any]]) -> str:
    """One line of the table."""
    works = [r for r in one if r["verdict"] == "works"]
    others = [r for r in one if r["verdict"] != "works"]
    numeric = not isinstance(row.values[0], str | tuple)
    span = f"{_text(row.values[0])} to {_text(row.values[-1])}" if numeric else f"{len(one)} cases"
    said = "—"
    if works:
        worst = max(works, key=lambda r: r["error"])
        most = max(r["iterations"] for r in works)
        at = _text(worst["value"])
        said = f"{worst['error']:.1e} of {worst['allowed']:.1e} at {at}; ≤ {most:.1f}"
    stops = f"{len(others)}: {_cut(others[0]['message'], 60)}" if others else "—"
    return f"| {row.name} | {row.varied}: {span} | {said} | {stops} |"


def _detail(r: dict[str, Any]) -> str:
    if r["verdict"] == "works":
        note = f" ({r['note']})" if r["note"] else ""
        numbers = f"{r['error']:.1e} | {r['allowed']:.1e} | {r['iterations']:.1f}"
        return f"| {_text(r['value'])} | {numbers} | works{note} |"
    return f"| {_text(r['value'])} | | | | {r['verdict']}: {_cut(r['message'], 240)} |"


def _cut(message: str, length: int) -> str:
    message = message.replace("|", "\\|").replace("\n", " ")
    return message if len(message) <= length else message[: length - 1].rsplit(" ", 1)[0] + " …"


def _draw(results: Results, path: Path) -> None:
    """Errors over what is allowed, a line for each row of numbers and a dot for each value."""
    drawn = [(row, one) for row, one in results if isinstance(row.values[0], int | float)]
    ends = [(row.name, *(_text(one[k]["value"]) for k in (0, -1))) for row, one in drawn]
    names = [f"{name}: {first} to {last}" for name, first, last in ends]
    with ub.picture((11.0, 1.6 + 0.29 * len(drawn))) as figure:
        axes = figure.subplots()
        along = scale("viridis", 0.0, 0.92, 0.0, 1.0)
        for number, (_, one) in enumerate(drawn):
            stopped = 0
            for part, r in zip(np.linspace(0.0, 1.0, len(one)), one, strict=True):
                look = {"color": along.to_rgba(part), "clip_on": False}
                if r["verdict"] == "works":
                    error = max(r["error"], SMALLEST) / min(r["allowed"], 1.0)
                    axes.plot(error, number, "o", ms=6, alpha=0.85, **look)
                else:
                    axes.plot(
                        1.02 + 0.014 * stopped, number, "x", ms=6, mew=1.8, **look,
                        transform=axes.get_yaxis_transform(),
                    )  # fmt: skip
                    stopped += 1
        axes.axvline(1.0, color=INK, lw=1.4, zorder=0)
        axes.set(xscale="log", xlabel="error / allowed error")
        axes.set_yticks(range(len(drawn)), names, fontsize=10)
        axes.grid(axis="y", color="0.92")
        axes.set_axisbelow(True)
        axes.set_ylim(len(drawn) - 0.5, -0.5)
        axes.set_title("dots: computed; crosses: stopped with a message", loc="left", fontsize=12)
        bar = figure.colorbar(along, ax=axes, orientation="horizontal", shrink=0.5, aspect=40)
        bar.set_ticks([0.0, 1.0], labels=["first value", "last value"])
        bar.outline.set_visible(False)
    figure.savefig(path, dpi=110)
