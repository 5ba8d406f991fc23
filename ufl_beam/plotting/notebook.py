# SPDX-License-Identifier: MIT
"""HTML of models and results in notebooks: tables, and pictures drawn when a cell shows them."""

from __future__ import annotations

from base64 import b64encode
from collections.abc import Callable, Sequence
from html import escape

from ufl_beam.analysis.parameter_study import Study
from ufl_beam.display import Tabular, html_page
from ufl_beam.plotting.style import Figure, png
from ufl_beam.terms.energy_ledger import Energy

ROWS = 12  # largest number of cases of a study in a table


@html_page.register
def energy_page(energy: Energy) -> str:
    """Write an energy ledger as HTML: its final values and its balance."""
    rows = [(kind, name, f"{value:.6g}") for kind, name, value in energy.entries()]
    return table(("energy", "", "at the end (J)"), rows) + lines(energy.balance()) if rows else ""


@html_page.register
def study_page(results: Study) -> str:
    """Write a study as HTML: its first cases with scalar results, and remarks on all cases."""
    title, *failed = str(results).splitlines()
    scalars = {name: x for name, x in results.results.items() if x.ndim == 1}
    arrays = [f"{name}: {x.shape}" for name, x in results.results.items() if x.ndim > 1]
    names = list(dict.fromkeys(name for case in results.cases for name in case))
    rows = [
        (*(str(case.get(name, "")) for name in names), *(f"{x[i]:.6g}" for x in scalars.values()))
        for i, case in enumerate(results.cases[:ROWS])
    ]
    more = f"and {len(results) - ROWS} more cases" if len(results) > ROWS else ""
    return lines(title) + table((*names, *scalars), rows) + lines(more, *arrays, *failed)


@html_page.register
def tabular_page(shown: Tabular) -> str:
    """Write a result in columns as a table in HTML."""
    head, *rows = shown.texts()
    return table(head, rows)


def lines(*texts: str) -> str:
    """Return texts as lines of HTML, without empty texts."""
    shown = "<br>".join(escape(text).replace("\n", "<br>") for text in texts if text)
    return f"<p>{shown}</p>" if shown else ""


def table(head: Sequence[str], rows: Sequence[Sequence[str]]) -> str:
    """Return a header and rows of texts as a table in HTML."""
    cells = [
        "".join(f"<{tag}>{escape(text)}</{tag}>" for text in row)
        for tag, row in (("th", head), *(("td", row) for row in rows))
    ]
    return f"<table>{''.join(f'<tr>{row}</tr>' for row in cells)}</table>"


def image(name: str, draw: Callable[[], Figure]) -> str:
    """Return a picture as HTML, or the reason why it cannot be drawn."""
    try:
        data, look = png(draw())
    except Exception as error:
        return lines(f"no picture: {type(error).__name__}: {error}")
    source = f'src="data:image/png;base64,{b64encode(data).decode()}"'
    style = f'width="{look["width"]}" style="max-width: 100%; height: auto"'
    return f'<img alt="{name}" {source} {style}>'
