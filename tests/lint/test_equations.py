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
    assert [n for n, count in Counter(n for n, _ in TAGS).items() if count > 1] == []


def numbers(text):
    """Numbers of a list such as 27, 28 or 14-17; letters of parts of figures do not count."""
    for part in re.sub("[*a-z]", "", text).split(","):
        first, _, last = part.partition("-")
        yield from range(int(first), int(last or first) + 1)


PAGE = (ROOT / "docs" / "paper.md").read_text(encoding="utf-8")
EQUATIONS = re.findall(
    r"^\| ([*\d, -]+) \| .+ \| `([\w/.]+)`: `([\w.]+)` \| `(\w+\.py)`: `(\w+)` \|$",
    PAGE,
    flags=re.MULTILINE,
)
"""Rows of equations on the page: numbers, file and name, file and name of the test."""


def lines_of(path, name):
    """Lines of a definition in Python, or the head of a function in C."""
    if path.suffix == ".c":
        text = path.read_text(encoding="utf-8")
        return re.search(rf"^\w.*\b{name}\(.*\)\n{{", text, re.MULTILINE)
    tree = ast.parse(path.read_text(encoding="utf-8"))
    for part in name.split("."):
        tree = next(one for one in ast.walk(tree) if getattr(one, "name", None) == part)
    return range(tree.lineno, tree.end_lineno + 1)


def test_each_equation_of_the_paper_has_a_row():
    assert [n for row in EQUATIONS for n in numbers(row[0])] == list(range(1, 96))


def test_the_page_lists_each_equation_with_its_place():
    """From equation to code and back: bold rows are those of lines with a mark."""
    marks = {n: (path, line) for path in FILES for n, _, line in tags(path)}
    assert {int(row[0].strip("*")) for row in EQUATIONS if "*" in row[0]} == set(marks)
    for text, file, name, *_ in EQUATIONS:
        lines = lines_of(PACKAGE / file, name)
        assert lines, f"{file} has no {name}"
        if "*" in text:
            path, line = marks[int(text.strip("*"))]
            assert path == PACKAGE / file, f"P({text}) is in {path}"
            assert line in lines, f"P({text}) is in line {line}"


def test_tests_on_the_page_exist():
    named = re.findall(r"`(test_\w+\.py)`: `(test_\w+)`", PAGE)
    assert len(named) > len(EQUATIONS)
    for file, name in named:
        (path,) = (ROOT / "tests").rglob(file)
        assert f"\ndef {name}(" in path.read_text(encoding="utf-8"), f"{file}: {name}"


def test_each_figure_has_a_picture_or_a_reason():
    """Pictures are written by the demo of their row; sections and tables have a row, too."""
    table = PAGE.partition("## Figures")[2]
    rows = re.findall(r"^\| (\d.*?) \| .+? \| (.*?) ?\| (.+) \|$", table, re.MULTILINE)
    assert {n for row in rows for n in numbers(row[0])} == set(range(1, 17))
    for _, demo, shown in rows:
        pictures = re.findall(r"`(\w+)\.png`", shown)
        assert bool(pictures) == bool(demo)
        for picture in pictures:
            name = demo.strip("`").removesuffix(".py")
            text = (ROOT / "demos" / f"{name}.py").read_text(encoding="utf-8")
            part = picture.removeprefix(name.removeprefix("demo_") + "_")
            assert picture in text or f'"{part}"' in text, picture
    for row in (*(rf"4.{n}\b.* \| `demo_\w+\.py` \|" for n in range(1, 6)), "Table 1", "Table 2"):
        assert re.search(rf"^\| {row}", PAGE, re.MULTILINE), row


def test_deviations_from_print_are_explained():
    errata = (ROOT / "docs" / "errata.md").read_text(encoding="utf-8")
    deviating = [n for n, deviates in TAGS if deviates]
    assert deviating
    assert [n for n in deviating if f"({n})" not in errata] == []
