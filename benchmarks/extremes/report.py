# SPDX-License-Identifier: MIT
"""The table and the figure of the study, made of its results."""

from __future__ import annotations

import math
from pathlib import Path
from typing import Any

import matplotlib as mpl
import matplotlib.pyplot as plt
from rows import Row

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
        "Written by `make extremes`; do not edit. Each value is a simulation of its own; its",
        "error is the difference from an independent result; the allowed error is derived in",
        "[benchmarks/extremes](../benchmarks/extremes): the tolerance of Newton's method, the",
        "order of the scheme, and round-off times its amplification.",
        "",
        f"Of {sum(counts.values())} runs {counts['works']} work, {counts['stops']} stop with a "
        f"message that names what is wrong, {counts['WRONG']} are wrong "
        f"in silence, {counts['HANG']} hang.",
        "",
        "![Errors over what was varied](pictures/extremes.png)",
        "",
        "*Dots: error, bars: what is allowed, crosses: stopped with a message.*",
        "",
        "| what | varied | works: error, of allowed; iterations per step | stops |",
        "|---|---|---|---|",
    ]
    lines += [_line(row, one) for row, one in results]
    lines += ["", "## Each value", ""]
    for row, one in results:
        lines += [f"### {row.name}", "", f"Varied: {row.varied}. Compared with: {row.against}.", ""]
        lines += [
            "| value | error | allowed | iterations per step | verdict |",
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
    """Small multiples: error over what was varied, for all rows of numbers."""
    drawn = [(row, one) for row, one in results if isinstance(row.values[0], int | float)]
    mpl.use("Agg")
    columns = 6
    rows = math.ceil(len(drawn) / columns)
    figure, axes = plt.subplots(
        rows, columns, figsize=(16, 2.0 * rows), sharey=True, layout="constrained"
    )
    for ax in axes.flat[len(drawn) :]:
        ax.axis("off")
    for ax, (row, one) in zip(axes.flat, drawn, strict=False):
        ticks = range(len(one))
        for i, r in zip(ticks, one, strict=True):
            if r["verdict"] == "works":
                error, allowed = (max(r[name], SMALLEST) for name in ("error", "allowed"))
                ax.plot([i, i], [SMALLEST, min(allowed, 1.0)], color="0.85", lw=5, zorder=1)
                ax.plot(i, error, "o", color="C0", ms=4, zorder=2)
            else:
                right = r["verdict"] == "stops"
                ax.plot(i, 1e-1, "x", color="C1" if right else "C3", ms=5, zorder=2)
        ax.set_yscale("log")
        ax.set_ylim(SMALLEST / 3, 3.0)
        ax.set_title(row.name, fontsize=8)
        shown = [i for i in ticks if i in (0, len(one) // 2, len(one) - 1)]
        ax.set_xticks(shown, [_text(one[i]["value"]) for i in shown], fontsize=7)
        ax.tick_params(axis="y", labelsize=7)
        ax.spines[["top", "right"]].set_visible(False)
    figure.supylabel("error", fontsize=9)
    figure.savefig(path, dpi=110)
    plt.close(figure)
