# SPDX-License-Identifier: MIT
"""Imports of the package: subpackages import downwards, and few modules import DOLFINx or PETSc."""

import ast
import sys
from functools import cache
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]
PACKAGE = ROOT / "ufl_beam"
FILES = {
    ".".join(path.relative_to(PACKAGE).with_suffix("").parts): path
    for path in sorted(PACKAGE.rglob("*.py"))
    if path.name != "__init__.py"
}
"""Files of the modules of the package, by names such as ``model.beams``."""

SUBPACKAGES = [
    *("", "model", "compiled", "mechanics", "discretization", "terms", "blocks"),
    *("solvers", "output", "reference", "simulation", "analysis", "plotting"),
]
"""From the lowest to the highest; the first one is the package itself.

A module imports from its own subpackage and from those before it.
"""

MOST_DEPTH = 22
"""Longest chain of imports at most."""

FINITE_ELEMENTS = {"basix", "cffi", "dolfinx", "ffcx", "mpi4py", "petsc4py", "ufl"}

PETSC = {"compiled", "solvers", "reference", "dolfinx_compat"}
"""Where PETSc is used; `dolfinx_compat` explains what is not installed."""


def subpackage(module):
    """Subpackage of a module; empty for modules of the package itself."""
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
            inside = node.module.removeprefix("ufl_beam").removeprefix(".") in {*SUBPACKAGES}
            if node.module.split(".")[0] == "ufl_beam" and inside:
                found.update(f"{node.module}.{alias.name}" for alias in node.names)
            else:
                found.add(node.module)
    return found


def imported(module):
    """Modules of the package that a module imports."""
    return {n.removeprefix("ufl_beam.") for n in imports(module) if n.startswith("ufl_beam.")}


@cache
def depth(module):
    """Length of the longest chain of imports that ends with the module."""
    return 1 + max((depth(one) for one in imported(module)), default=0)


def outside(module):
    """Top-level packages that a module imports."""
    return {name.split(".")[0] for name in imports(module)} - {"ufl_beam"}


@cache
def reach(module):
    """The module, and all modules of the package that come with it."""
    found, todo = set(), {module}
    while todo:
        found |= todo
        todo = set().union(*(imported(m) for m in todo)) - found
    return found


def test_modules_and_their_imports_are_found():
    assert {"mechanics.kinematics", "model.scene", "simulation.simulation"} <= {*FILES}
    assert "dolfinx" in outside("dolfinx_compat")
    assert "model.beams" in imported("model.scene")
    assert {subpackage(module) for module in FILES} == {*SUBPACKAGES}


@pytest.mark.parametrize("module", FILES)
def test_modules_import_no_higher_subpackage(module):
    """From subpackage to subpackage, with no exemption for imports of type checkers."""
    known = imported(module)
    assert known <= {*FILES}
    above = SUBPACKAGES[SUBPACKAGES.index(subpackage(module)) + 1 :]
    assert [other for other in known if subpackage(other) in above] == []


def test_imports_have_no_cycles():
    for module in FILES:
        assert module not in set().union(*(reach(m) for m in imported(module))), module


def test_chains_of_imports_are_short():
    assert max(map(depth, FILES)) <= MOST_DEPTH


@pytest.mark.parametrize("module", [m for m in FILES if m != "dolfinx_compat"])
def test_only_dolfinx_compat_and_the_reference_solver_import_dolfinx(module):
    assert "dolfinx" not in outside(module) or subpackage(module) == "reference"


@pytest.mark.parametrize("module", [m for m in FILES if m != "dolfinx_compat"])
def test_only_dolfinx_compat_asks_for_versions(module):
    names = {
        node.id
        for node in ast.walk(ast.parse(FILES[module].read_text(encoding="utf-8")))
        if isinstance(node, ast.Name)
    }
    assert "VERSION" not in names


@pytest.mark.parametrize("module", [m for m in FILES if subpackage(m) == "reference"])
def test_the_reference_solver_imports_neither_terms_nor_solvers(module):
    assert not {subpackage(one) for one in imported(module)} & {"terms", "solvers", "compiled"}


def test_only_runs_import_the_reference_solver():
    users = {m for m in FILES if any(subpackage(one) == "reference" for one in imported(m))}
    assert {m for m in users if subpackage(m) != "reference"} == {"simulation.reference_run"}


def test_kinematics_imports_ufl_only():
    assert outside("mechanics.kinematics") - sys.stdlib_module_names == {"ufl"}
    assert imported("mechanics.kinematics") == set()


@pytest.mark.parametrize("module", [m for m in FILES if subpackage(m) == "model"])
def test_the_model_imports_no_finite_elements(module):
    """Directly, or through other modules of the package."""
    for one in reach(module):
        assert not outside(one) & FINITE_ELEMENTS, one


def test_few_subpackages_import_petsc():
    for module in FILES:
        assert "petsc4py" not in outside(module) or {module, subpackage(module)} & PETSC, module


@pytest.mark.parametrize("module", [m for m in FILES if subpackage(m) != "plotting"])
def test_only_plotting_imports_matplotlib_and_pyvista(module):
    assert not outside(module) & {"matplotlib", "pyvista", "PIL"}
