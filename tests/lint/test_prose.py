# SPDX-License-Identifier: MIT
"""Docstrings, links between pages, public names on the pages, and lines of licence."""

import ast
import re
from pathlib import Path
from types import ModuleType

import pytest
from helpers import ALL, NAMESPACES

import ufl_beam as ub

ROOT = Path(__file__).parents[2]
PAGES = [
    path
    for folder in (".", "docs", "demos", "benchmarks")
    for path in sorted((ROOT / folder).glob("*.md"))
]

FILES = {"portal.py", "mast.py", "arm.py", "axis.h"}.union(
    path.name
    for folder in ("ufl_beam", "tests", "demos", "benchmarks")
    for path in (ROOT / folder).rglob("*.*")
)
"""Names of the files of the repository, scripts of its pages, and an attribute."""


TEXTS = [path.read_text("utf-8") for path in sorted((ROOT / "ufl_beam").rglob("*.py"))]
TREES = [ast.parse(text) for text in TEXTS]


def docstrings(tree):
    """(name, docstring) of all public classes, functions and methods."""
    for node in ast.iter_child_nodes(tree):
        if isinstance(node, ast.ClassDef | ast.FunctionDef) and node.name[0] != "_":
            yield node.name, ast.get_docstring(node) or ""
            if isinstance(node, ast.ClassDef):
                yield from docstrings(node)


def test_docstrings_have_words_and_begin_with_a_noun_or_a_verb():
    found = [pair for tree in TREES for pair in docstrings(tree)]
    assert len(found) > 500
    assert [pair for pair in found if len(pair[1].split()) <= 3] == []
    begin = re.compile(r'^\s*"""(What|Whether|How)\b', re.MULTILINE)
    assert sum(len(begin.findall(text)) for text in TEXTS) <= 10


def test_docstrings_refer_to_names_of_the_package():
    """Targets of roles such as ``:meth:`` are identifiers: a renaming leaves no old reference."""
    identifiers = {
        getattr(node, field)
        for tree in TREES
        for node in ast.walk(tree)
        for field in ("name", "id", "arg", "attr")
        if isinstance(getattr(node, field, None), str)
    }
    roles = re.compile(r":(?:attr|meth|func|class):`~?([\w.]+)`")
    targets = {target.rpartition(".")[2] for text in TEXTS for target in roles.findall(text)}
    assert len(targets) > 100
    assert targets - identifiers == set()


@pytest.mark.parametrize("page", PAGES, ids=lambda page: str(page.relative_to(ROOT)))
def test_links_files_and_names_on_the_pages_exist(page):
    """Targets of links, files in code font, and names of the package."""
    text = page.read_text(encoding="utf-8")
    targets = re.findall(r"\]\(([^)#\s]+)[^)]*\)", text)
    assert [x for x in targets if x[:4] != "http" and not (page.parent / x).exists()] == []
    assert {*re.findall(r"`(?:[\w/]+/)?(\w+\.(?:py|c|h))`", text)} <= FILES
    names = re.findall(r"\b(ub(?:\.extend|\.distributions)?|st)\.(\w+)", text)
    if page.name != "CHANGELOG.md":  # has former names
        assert [pair for pair in names if not hasattr(NAMESPACES[pair[0]], pair[1])] == []


def test_public_names_are_documented():
    """Each name of the package is in the README or on a page of docs/."""
    pages = [page for page in PAGES if page.name == "README.md" or page.parent.name == "docs"]
    words = {word for page in pages for word in re.findall(r"\w+", page.read_text("utf-8"))}
    assert [name for name in ALL if name not in words] == []


def test_public_names_belong_to_the_package():
    assert len(ub.__all__) <= 100
    every = [name for module in NAMESPACES.values() for name in module.__all__]
    assert len(set(every)) == len(every)
    for name in every:
        thing = ALL[name]
        module = thing.__name__ if isinstance(thing, ModuleType) else thing.__module__
        assert module.startswith("ufl_beam."), name


def test_the_readme_is_read_in_a_minute():
    """Up to the features: at most 300 words beside code and addresses of links."""
    text, features, _ = (ROOT / "README.md").read_text("utf-8").partition("\n## Features\n")
    assert features
    text = re.sub(r"^```.*?^```", "", text, flags=re.MULTILINE | re.DOTALL)
    text = re.sub(r"\]\([^)]*\)", "", text)
    assert len(text.split()) <= 300


def test_sources_state_their_licence():
    """In the first line; demos, whose first cell is text, in that of their first cell of code."""
    licence, folders = "SPDX-License-Identifier: MIT", ("ufl_beam", "tests", "demos", "benchmarks")
    for path in (path for folder in folders for path in (ROOT / folder).rglob("*")):
        if path.suffix not in {".py", ".c", ".h"} or "output" in path.parts:
            continue
        text = path.read_text(encoding="utf-8")
        if text.startswith("# %% [markdown]"):
            text = text.partition("\n# %%\n")[2]
        first = text.partition("\n")[0]
        assert first in (f"# {licence}", f"/* {licence} */"), path
