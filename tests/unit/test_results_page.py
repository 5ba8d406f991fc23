# SPDX-License-Identifier: MIT
"""The entries of the energy ledger on docs/results.md are those of the code."""

import re
from pathlib import Path

from pages import DOCS

from ufl_beam.model.connector_law import CONTRIBUTIONS

PACKAGE = Path(__file__).parents[2] / "ufl_beam"
WRITTEN = re.compile(
    r'\b(?:state|supplied|lost)"?(?:\[|\.pointer\(|, )"(\w+)"'  # ledger.lost["..."], (lost, "...")
    r'|\b_?entry\b[^=\n]* = "(\w+)"'  # of a class
    r'|\b(?:stored|supplied|lost) ?= ?{"(\w+)"|Pushed\([^"\n]*"(\w+)"'  # of a statement
)
WRITERS = (
    "terms/*.py", "blocks/*.py", "reference/*.py", "model/connector_law*.py",
    "simulation/step_equation.py", "simulation/impacts.py",
)  # fmt: skip


def test_the_page_of_results_lists_all_entries_of_the_ledger():
    page = (DOCS / "results.md").read_text(encoding="utf-8")
    rows = re.findall(r"^\| `(\w+)` \| (?:state|supplied|lost) \|", page, re.MULTILINE)
    text = "\n".join(
        file.read_text("utf-8") for name in WRITERS for file in sorted(PACKAGE.glob(name))
    )
    written = {name for pair in WRITTEN.findall(text) for name in pair if name}
    assert len(rows) == len(set(rows))
    assert set(rows) == set(CONTRIBUTIONS)
    assert set(rows) <= written
    other_uses = {"beams", "lost", "new", "supplied", "v"}  # of the words in the pattern
    other_uses |= {
        "dt",
        "e",
        "energy",
        "equations",
        "limit",
        "slipped",
        "start",
    }  # states of statements
    assert written - set(rows) <= other_uses
