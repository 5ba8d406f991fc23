# SPDX-License-Identifier: MIT
"""Imports and calls of the package: both go downwards; few modules import DOLFINx or PETSc."""

import ast
import re
import sys
from functools import cache
from graphlib import TopologicalSorter
from pathlib import Path

import pytest

import ufl_beam as ub

ROOT = Path(__file__).parents[2]
PACKAGE = ROOT / "ufl_beam"
FILES = {
    ".".join(path.relative_to(PACKAGE).with_suffix("").parts): path
    for path in sorted(PACKAGE.rglob("*.py"))
    if path.name not in ("__init__.py", "extend.py")
}
"""Files of the modules of the package, by names such as ``model.beams``."""

SUBPACKAGES = [
    *("", "model", "compiled", "mechanics", "discretization", "terms", "blocks"),
    *("solvers", "output", "reference", "simulation", "analysis", "plotting", "structures"),
]
"""From the lowest to the highest; a module imports from its own and from those before it."""

C_FILES = {
    "compiled": "assembly csr",
    "terms": "dead_loads inertia_and_damping material_laws embedded_hinges material_points"
    " cell_forces",
    "blocks": "blocks inelastic_cells energy_changes",
    "solvers": "beam_elimination multifrontal newton",
    "output": "state_rows",
    "simulation": "steps derivatives adjoint block_derivatives point_derivatives",
    "structures": "oscillators",
}
"""C files in ``compiled/c`` by the subpackage that they belong to."""

STEPS = {
    *("take_steps", "step_or_subdivide", "attempt_step", "accept_step"),
    *("solve_begun_step", "repeat_steps", "take_back"),
}
"""C functions by which Python enters a step."""

C_FUNCTION = re.compile(
    r"^[a-z][\w *]*?(\w+)\([^;{}]*\)\s*\{(?:([^\n]*)\}$|\n(.*?)^\})", re.M | re.S
)
"""Definition of a function in C: its name, and its body in the same line or in several."""

MOST_DEPTH = 24
"""Longest chain of imports at most."""

FINITE_ELEMENTS = {"basix", "cffi", "dolfinx", "ffcx", "mpi4py", "petsc4py", "ufl"}

DRAWING = "plotting.", "structures.pictures"

PETSC = {"compiled", "solvers", "reference", "dolfinx_compat"}
"""Where PETSc is used; `dolfinx_compat` explains what is not installed."""


def subpackage(module):
    """Subpackage of a module; empty for modules of the package itself."""
    return module.rpartition(".")[0]


def above(one, other):
    """Whether the other subpackage is higher."""
    return SUBPACKAGES.index(other) > SUBPACKAGES.index(one)


@cache
def nodes(module):
    return list(ast.walk(ast.parse(FILES[module].read_text(encoding="utf-8"))))


@cache
def imports(module):
    """Names that a module imports anywhere, also for type checkers."""
    found = set()
    for node in nodes(module):
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
    return {module}.union(*map(reach, imported(module)))


@cache
def c_functions():
    """Subpackage of each C function, and names that it calls, apart from calls of addresses."""
    found = {}
    for name, files in C_FILES.items():
        for file in files.split():
            text = (PACKAGE / "compiled" / "c" / f"{file}.c").read_text(encoding="utf-8")
            text = re.sub(r"/\*.*?\*/", "", text, flags=re.S)
            for function, line, lines in C_FUNCTION.findall(text):
                calls = set(re.findall(r"(?<![\w.>])(\w+)\(", line or lines))
                found[function] = name, calls
    return {name: (of, calls & {*found}) for name, (of, calls) in found.items()}


@cache
def used_in_c(module):
    """C functions that a module calls or passes to C by name, with repetitions."""
    called = re.compile(r"\blib\.(\w+)|\bloop\(\s*\"(\w+)\"")
    names = called.findall(FILES[module].read_text(encoding="utf-8"))
    return [name for pair in names for name in pair if name in c_functions()]


@cache
def ways(function):
    """Subpackages on each chain of calls that begins with a C function."""
    of, calls = c_functions()[function]
    return {(of,)} | {
        way if way[0] == of else (of, *way) for x in calls - {function} for way in ways(x)
    }


def test_modules_and_their_imports_are_found():
    assert {"mechanics.kinematics", "model.scene", "simulation.simulation"} <= {*FILES}
    assert "dolfinx" in outside("dolfinx_compat")
    assert "model.beams" in imported("model.scene")
    assert {subpackage(module) for module in FILES} == {*SUBPACKAGES}


@pytest.mark.parametrize("module", FILES)
def test_modules_import_no_higher_subpackage(module):
    """From subpackage to subpackage, with no exemption for imports of type checkers; also in C."""
    known, of = imported(module), subpackage(module)
    assert known <= {*FILES}
    assert [other for other in known if above(of, subpackage(other))] == []
    assert [x for x in used_in_c(module) if above(of, c_functions()[x][0])] == []


@pytest.mark.parametrize("module", FILES)
def test_packages_beside_this_one_have_their_places(module):
    found, of = outside(module), subpackage(module)
    if module != "dolfinx_compat":
        assert "dolfinx" not in found or of == "reference"
        assert "VERSION" not in {getattr(node, "id", "") for node in nodes(module)}
    assert "petsc4py" not in found or {module, of} & PETSC
    assert not found & {"matplotlib", "pyvista", "PIL"} or module.startswith(DRAWING)
    if of == "model":  # also through other modules of the package
        assert [x for x in reach(module) if outside(x) & FINITE_ELEMENTS] == []


def test_c_files_belong_to_subpackages_and_call_no_higher_ones():
    (sources,) = (
        ast.literal_eval(node.value)
        for node in nodes("compiled.c_library")
        if isinstance(node, ast.Assign) and ast.unparse(node.targets[0]) == "SOURCES"
    )
    assert sorted(" ".join(C_FILES.values()).split()) == sorted(sources)
    assert {*STEPS, "newton", "add_block", "update_ghosts"} <= {*c_functions()}
    for function, (of, calls) in c_functions().items():
        assert [x for x in calls if above(of, c_functions()[x][0])] == [], function


def test_a_step_enters_each_subpackage_once():
    """From one place of Python, calls of C enter each subpackage once; see `loop` for addresses."""
    entries = [(x, subpackage(m)) for m in FILES for x in used_in_c(m) if x in STEPS]
    assert sorted(entries) == [(x, "simulation") for x in sorted(STEPS)]
    chains = ways("take_steps")
    assert ("simulation", "solvers", "compiled") in chains
    by_address = {x for m in FILES if subpackage(m) in ("terms", "blocks") for x in used_in_c(m)}
    below = {way for x in by_address for way in ways(x)}
    assert {("blocks", "terms"), ("terms", "compiled")} <= below
    assert {of for way in below for of in way} == {"compiled", "terms", "blocks"}
    assert [way for way in chains | below if len(way) > len({*way})] == []


def test_imports_have_no_cycles_and_short_chains():
    TopologicalSorter({module: imported(module) for module in FILES}).prepare()
    assert max(map(depth, FILES)) <= MOST_DEPTH


def test_the_reference_solver_stands_alone():
    """It imports neither terms nor solvers, and only runs import it."""
    inside = {m for m in FILES if subpackage(m) == "reference"}
    for module in inside:
        assert not {subpackage(one) for one in imported(module)} & {"terms", "solvers", "compiled"}
    assert {m for m in {*FILES} - inside if imported(m) & inside} == {"simulation.reference_run"}


def test_kinematics_imports_ufl_only():
    assert outside("mechanics.kinematics") - sys.stdlib_module_names == {"ufl"}
    assert imported("mechanics.kinematics") == set()


SEAMS = {
    "analysis.constant_loads", "analysis.linearization", "analysis.modes", "analysis.derivatives",
    "analysis.parameter_study", "blocks.material_points", "compiled.c_library",
    "discretization.dof_numbering", "discretization.function_spaces", "mechanics.time_scheme",
    "output.hinge_histories", "output.recorder", "output.section_forces", "output.states",
    "simulation.initial_state", "simulation.run",
}  # fmt: skip
"""Modules beside the model of which structures use names that are not public; pictures use more."""


def test_structures_use_public_names_and_few_others():
    public = {*ub.__all__, *ub.RESULTS, *ub.extend.__all__, *ub.distributions.__all__}
    used = {
        node.module.removeprefix("ufl_beam.")
        for file in FILES
        if subpackage(file) == "structures" and file != "structures.pictures"
        for node in nodes(file)
        if isinstance(node, ast.ImportFrom) and node.module.startswith("ufl_beam.")
        if {alias.name for alias in node.names} - public
    }
    inside = {module for module in used if subpackage(module) in ("", "model", "structures")}
    assert used - inside == SEAMS
