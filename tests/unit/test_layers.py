# SPDX-License-Identifier: MIT
"""The package as text: who imports what, equations stated once, one version, documented names."""

import ast
import io
import re
import sys
import tokenize
from collections import Counter
from functools import cache
from pathlib import Path

import pytest

import ufl_beam as ub

ROOT = Path(__file__).parents[2]
PACKAGE = ROOT / "ufl_beam"
FILES = {
    ".".join(path.relative_to(PACKAGE).with_suffix("").parts): path
    for path in sorted(PACKAGE.rglob("*.py"))
    if path.name != "__init__.py"
}
"""Files of the modules of the package, by names such as ``model.beams``."""

ROOMS = [
    *("", "model", "compiled", "mechanics", "discretization", "terms", "solvers"),
    *("output", "reference", "simulation", "analysis", "plotting"),
]
"""Subpackages from the ground up; a module imports from its own room and from those before it.

The first one is the ground: modules that stand beside the rooms.
"""

FLOORS = 18
"""Longest chain of imports at most."""

MACHINERY = {"basix", "cffi", "dolfinx", "ffcx", "mpi4py", "petsc4py", "ufl"}

PETSC = {"compiled", "solvers", "reference", "dolfinx_compat"}
"""Where PETSc is used; `dolfinx_compat` explains what is not installed."""


def room(module):
    """The room of a module, empty for those on the ground."""
    return module.rpartition(".")[0]


@cache
def imports(module):
    """Names that a module imports anywhere, also for type checkers."""
    found = set()
    for node in ast.walk(ast.parse(FILES[module].read_text(encoding="utf-8"))):
        if isinstance(node, ast.Import):
            found.update(alias.name for alias in node.names)
        elif isinstance(node, ast.ImportFrom):
            assert node.level == 0, f"{module}: relative import"
            inside = node.module.removeprefix("ufl_beam").removeprefix(".") in {*ROOMS}
            if node.module.split(".")[0] == "ufl_beam" and inside:
                found.update(f"{node.module}.{alias.name}" for alias in node.names)
            else:
                found.add(node.module)
    return found


def siblings(module):
    """Modules of the package that a module imports."""
    return {n.removeprefix("ufl_beam.") for n in imports(module) if n.startswith("ufl_beam.")}


@cache
def floor(module):
    """Length of the longest chain of imports that ends with the module."""
    return 1 + max((floor(one) for one in siblings(module)), default=0)


def outside(module):
    """Top-level packages that a module imports."""
    return {name.split(".")[0] for name in imports(module)} - {"ufl_beam"}


@cache
def reach(module):
    """The module, and all modules of the package that come with it."""
    found, todo = set(), {module}
    while todo:
        found |= todo
        todo = set().union(*(siblings(m) for m in todo)) - found
    return found


# -- imports -----------------------------------------------------------------------------------


def test_the_text_is_read():
    # So that the tests below are about something
    assert {"mechanics.kinematics", "model.scene", "simulation.simulation"} <= {*FILES}
    assert "dolfinx" in outside("dolfinx_compat")
    assert "model.beams" in siblings("model.scene")
    assert {room(module) for module in FILES} == {*ROOMS}


@pytest.mark.parametrize("module", FILES)
def test_imports_point_down(module):
    """From room to room, with no exemption for imports of type checkers."""
    known = siblings(module)
    assert known <= {*FILES}
    above = ROOMS[ROOMS.index(room(module)) + 1 :]
    assert [other for other in known if room(other) in above] == []


def test_imports_have_no_cycles():
    for module in FILES:
        assert module not in set().union(*(reach(m) for m in siblings(module))), module


def test_floors():
    """Print the import graph from the ground up, `pytest -s`; and limit its height."""
    height = max(map(floor, FILES))
    for level in range(1, height + 1):
        print(f"\nfloor {level}")
        for module in (m for m in FILES if floor(m) == level):
            print(f"  {module}: {', '.join(sorted(siblings(module))) or '-'}")
    assert len(ROOMS) - 1 <= 11
    assert height <= FLOORS


@pytest.mark.parametrize("module", [m for m in FILES if m != "dolfinx_compat"])
def test_only_dolfinx_compat_imports_dolfinx(module):
    assert "dolfinx" not in outside(module)


@pytest.mark.parametrize("module", [m for m in FILES if m != "dolfinx_compat"])
def test_only_dolfinx_compat_asks_for_versions(module):
    names = {
        node.id
        for node in ast.walk(ast.parse(FILES[module].read_text(encoding="utf-8")))
        if isinstance(node, ast.Name)
    }
    assert "VERSION" not in names


@pytest.mark.parametrize("module", [m for m in FILES if room(m) == "reference"])
def test_the_reference_solver_is_apart(module):
    """It shares statements with runs, and neither terms nor solvers."""
    assert not {room(one) for one in siblings(module)} & {"terms", "solvers", "compiled"}


def test_nothing_but_a_run_knows_the_reference_solver():
    users = {m for m in FILES if any(room(one) == "reference" for one in siblings(m))}
    assert {m for m in users if room(m) != "reference"} == {"simulation.run"}


def test_kinematics_imports_ufl_alone():
    assert outside("mechanics.kinematics") - sys.stdlib_module_names == {"ufl"}
    assert siblings("mechanics.kinematics") == set()


@pytest.mark.parametrize("module", [m for m in FILES if room(m) == "model"])
def test_the_model_needs_no_machinery(module):
    """Directly, or through other modules of the package."""
    for one in reach(module):
        assert not outside(one) & MACHINERY, one


def test_only_what_compiles_and_solves_imports_petsc():
    for module in FILES:
        assert "petsc4py" not in outside(module) or {module, room(module)} & PETSC, module


@pytest.mark.parametrize("module", [m for m in FILES if room(m) != "plotting"])
def test_pictures_are_at_the_end(module):
    assert not outside(module) & {"matplotlib", "pyvista", "PIL"}


# -- equations ---------------------------------------------------------------------------------


def tags(path):
    """(n, deviates, line) of all trailing comments `# P(n)` or `# P(n)!`."""
    tokens = tokenize.generate_tokens(io.StringIO(path.read_text(encoding="utf-8")).readline)
    for token in tokens:
        if token.type == tokenize.COMMENT:
            for n, mark in re.findall(r"\bP\((\d+)\)(!?)", token.string):
                yield int(n), mark == "!", token.start[0]


TAGS = [(n, deviates) for path in FILES.values() for n, deviates, _ in tags(path)]


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
    stated = {n: (path, line) for path in FILES.values() for n, _, line in tags(path)}
    assert sorted(listed) == sorted(stated)
    for n, (file, lines) in listed.items():
        path, line = stated[n]
        assert path == PACKAGE / file, f"P({n}) is in {path}"
        assert line in lines, f"P({n}) is in line {line}"


def test_deviations_from_print_are_explained():
    errata = (ROOT / "docs" / "errata.md").read_text(encoding="utf-8")
    deviating = [n for n, deviates in TAGS if deviates]
    assert deviating
    for n in deviating:
        assert f"({n})" in errata, f"P({n})! has no entry in docs/errata.md"


# -- names and versions ------------------------------------------------------------------------


def version_in(name, pattern):
    found = re.findall(pattern, (ROOT / name).read_text(encoding="utf-8"), flags=re.MULTILINE)
    assert len(found) == 1, f"{name}: {found}"
    return found[0]


def test_one_version():
    assert version_in("pyproject.toml", r'^version = "([^"]+)"') == version_in(
        "CITATION.cff", r'^version: "?([^"\s]+)"?$'
    )


def test_public_names():
    names = ub.__all__
    constants = [n for n in names if n.isupper()]
    classes = [n for n in names if n[0].isupper() and n not in constants]
    others = [n for n in names if n[0].islower()]
    assert names == sorted(constants) + sorted(classes) + sorted(others)  # the order of ruff
    assert len(set(names)) == len(names)
    for name in names:
        thing = getattr(ub, name)
        assert (thing.__doc__ or "").strip(), f"{name} has no docstring"
        module = thing.__name__ if name == "law_functions" else thing.__module__
        assert module.startswith("ufl_beam."), name


@pytest.mark.parametrize("module", FILES)
def test_what_is_public_has_a_docstring(module):
    tree = ast.parse(FILES[module].read_text(encoding="utf-8"))
    assert ast.get_docstring(tree), module
    missing = []

    def visit(node, owner):
        for child in ast.iter_child_nodes(node):
            if isinstance(child, ast.ClassDef | ast.FunctionDef) and child.name[0] != "_":
                if not ast.get_docstring(child):
                    missing.append(f"{owner}.{child.name}")
                if isinstance(child, ast.ClassDef):
                    visit(child, f"{owner}.{child.name}")

    visit(tree, module)
    assert missing == []


SOURCES = [
    path
    for folder in ("ufl_beam", "tests", "demos", "benchmarks")
    for path in sorted((ROOT / folder).rglob("*"))
    if path.suffix in {".py", ".c", ".h"} and "output" not in path.parts
]


def test_sources_state_their_licence():
    """In the first line; demos, whose first cell is text, in that of their first cell of code."""
    licence = "SPDX-License-Identifier: MIT"
    for path in SOURCES:
        text = path.read_text(encoding="utf-8")
        if text.startswith("# %% [markdown]"):
            text = text.partition("\n# %%\n")[2]
        first = text.partition("\n")[0]
        assert first in (f"# {licence}", f"/* {licence} */"), path
