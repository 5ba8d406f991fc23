# SPDX-License-Identifier: MIT
"""Tables of docs/ranks.md: measurements on one and two processes, and the cost model."""

from pathlib import Path

from records import machine
from scaling_model import borders, extrapolated, fitted

from ufl_beam.discretization.dof_numbering import DofNumbering

PAGE = Path(__file__).parents[1] / "docs" / "ranks.md"
BEGIN, END = "<!-- tables -->", "<!-- end of tables -->"
RANKS, CELLS, SAMPLE = (1, 2, 8, 64), 10_000_000, 40_000


def row(*cells):
    """A row of a table."""
    return "| " + " | ".join(map(str, cells)) + " |"


def measured(cases):
    """Rows of both measurements of a lattice."""
    one, two = cases
    gain = one["ms_per_iteration"] / two["ms_per_iteration"]
    for case, faster in ((one, "1"), (two, f"{gain:.2f}")):
        yield row(
            case["bays"], case["processes"], f"{case['ms_per_iteration']:.0f}", faster,
            f"{case['ms_per_kept_state']:.0f}", f"{case['build_s']:.1f}",
            f"{max(case['memory_mb']):.0f}",
            case["cells_here"], case["joints_here"], f"{case.get('flops', 0) / 1e6:.0f}",
            case.get("border", 0), f"{case['messages_per_iteration']:.0f}",
            f"{case['bytes_per_iteration'] / 1e3:.0f}",
        )  # fmt: skip


def modelled(cases, half, lattice):
    """Rows of the model for many cells, and many processes."""
    model, bays = fitted(cases[0], half, cases[1]), cases[0]["bays"]
    square = bays > 50
    growth = 1.5 if square else 1.0
    width = round((SAMPLE / 20) ** 0.5) if square else bays
    numbering = DofNumbering(lattice(SAMPLE, width))
    for ranks in RANKS:
        border, part = borders(numbering, ranks)
        longer = (CELLS / SAMPLE) ** 0.5 if square else 1
        border, part = border * longer, part * longer
        seconds, memory = extrapolated(CELLS, ranks, model, border, part, growth)
        total = sum(seconds.values())
        yield row(
            "square" if square else f"{bays} bays", ranks, f"{border:.0f}",
            *(f"{t:.3g}" for t in seconds.values()), f"{total:.3g}", f"{memory / 1e9:.1f}",
        )  # fmt: skip


def write_page(rows, lattice):
    """Write the tables into the page."""
    first = ("bays", "processes", "ms per iteration", "gain", "ms per recorded state",
             "s to build", "MB", "cells", "unknowns of joints", "Mflop for joints", "border",
             "messages", "kB")  # fmt: skip
    then = ("lattice", "processes", "border", "cells", "joints", "borders", "messages", "total",
            "GB a process")  # fmt: skip
    of = machine()
    lines = [
        f"Measured at {of['commit']} on {of['processor']}, DOLFINx {of['dolfinx']}.", "",
        row(*first), row(*["---"] * len(first)),
        *(x for cases, _ in rows for x in measured(cases)), "",
        f"Extrapolated to {CELLS:.0e} cells, with times in s of one iteration:", "",
        row(*then), row(*["---"] * len(then)),
        *(x for cases, half in rows for x in modelled(cases, half, lattice)),
    ]  # fmt: skip
    text = PAGE.read_text()
    head, tail = text.split(BEGIN)[0], text.split(END)[1]
    PAGE.write_text("\n".join([head + BEGIN, "", *lines, "", END + tail]))
