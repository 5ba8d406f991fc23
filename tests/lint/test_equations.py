# SPDX-License-Identifier: MIT
"""Equations of the paper: each is stated once, and listed on the pages."""

import ast
import io
import re
import tokenize
from collections import Counter
from pathlib import Path

ROOT = Path(__file__).parents[2]
PACKAGE = ROOT / "ufl_beam"
FILES = sorted(PACKAGE.rglob("*.py"))


def tags(path):
    """(n, deviates, line) of all trailing comments `# P(n)` or `# P(n)!`."""
    tokens = tokenize.generate_tokens(io.StringIO(path.read_text(encoding="utf-8")).readline)
    for token in tokens:
        if token.type == tokenize.COMMENT:
            for n, mark in re.findall(r"\bP\((\d+)\)(!?)", token.string):
                yield int(n), mark == "!", token.start[0]


TAGS = [(n, deviates) for path in FILES for n, deviates, _ in tags(path)]


def test_each_equation_is_stated_once():
    assert len(TAGS) > 10
    assert {n: count for n, count in Counter(n for n, _ in TAGS).items() if count > 1} == {}


def test_theory_lists_each_equation_with_its_place():
    """From equation to code and back: rows `| n | ... | `file`: `name` |` of docs/theory.md."""
    theory = (ROOT / "docs" / "theory.md").read_text(encoding="utf-8")
    rows = re.findall(r"^\| (\d+) \| .* \| `(.+?)`: `(.+?)` \|$", theory, flags=re.MULTILINE)
    listed = {}
    for n, file, name in rows:
        tree = ast.parse((PACKAGE / file).read_text(encoding="utf-8"))
        for part in name.split("."):
            definitions = (one for one in ast.walk(tree) if getattr(one, "name", None) == part)
            tree = next(definitions)
        listed[int(n)] = file, range(tree.lineno, tree.end_lineno + 1)
    assert len(listed) == len(rows)
    cached_forms = {n: (path, line) for path in FILES for n, _, line in tags(path)}
    assert sorted(listed) == sorted(cached_forms)
    for n, (file, lines) in listed.items():
        path, line = cached_forms[n]
        assert path == PACKAGE / file, f"P({n}) is in {path}"
        assert line in lines, f"P({n}) is in line {line}"


def test_deviations_from_print_are_explained():
    errata = (ROOT / "docs" / "errata.md").read_text(encoding="utf-8")
    deviating = [n for n, deviates in TAGS if deviates]
    assert deviating
    for n in deviating:
        assert f"({n})" in errata, f"P({n})! has no entry in docs/errata.md"
