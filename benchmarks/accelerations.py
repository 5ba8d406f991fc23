# SPDX-License-Identifier: MIT
"""The accelerations of a step: what each does, where it is, and what it is compared with."""

import ast
import re
from pathlib import Path
from typing import NamedTuple

import switches as by

import ufl_beam as ub

PACKAGE = Path(ub.__file__).parent
ELASTIC, LARGE, SWING, HINGED, JOINTED = "elastic", "large", "swing", "hinged", "jointed"


class Acceleration(NamedTuple):
    """An acceleration.

    Attributes:
        text: What it does.
        with_, without: Names of the variants to compare.
        code: Where it is: a file, a ``file:name`` in it, or the lines ``file~pattern``.
        scenes: Where it is measured.
    """

    text: str
    with_: str
    without: str
    code: tuple[str, ...]
    scenes: tuple[str, ...] = (ELASTIC, HINGED, JOINTED)


ACCELERATIONS = {
    "Newton's method in C": Acceleration(
        "Newton's method with full steps as a SNES of the type \"shell\". Without it, PETSc's "
        "`newtonls` calls the same residual and tangent in C, and the factorization by Python.",
        by.SHIPPED, by.PETSC,
        (
            "compiled/c/newton.c:factor_tangent", "compiled/c/newton.c:solve_tangent",
            "compiled/c/newton.c:find_change", "compiled/c/newton.c:newton",
            "compiled/c/newton.c:snes_newton", "solvers/multifrontal.py:Multifrontal.drive",
            "solvers/static_condensation.py:CondensedSolver.drive",
            "solvers/substructuring.py:Klu.drive",
        ),
    ),
    "SIMD kernels": Acceleration(
        "Kernels of FFCx compiled a second time with vectors instead of numbers, for the "
        "processor of the machine: four or eight cells at once. Without it, cells are computed one "
        "by one by FFCx's own kernels.",
        by.SHIPPED, by.SCALAR,
        (
            "compiled/simd_kernels.py", "compiled/c/lanes.c", "compiled/c/lanes.h",
            "discretization/compiled_forms.py~several|LANES|lanes",
            "discretization/function_spaces.py:Fields._coordinates_in_lanes",
        ),
    ),
    "elimination along beams": Acceleration(
        "Eliminates the vertices between the ends of beams in blocks of three; dense fronts factor "
        "the remaining matrix. Without it, such fronts with the ordering \"amd\" factor the whole "
        "tangent, called from the same Newton's method in C. Several processes share all of this "
        "but what is at their borders.",
        by.SHIPPED, by.WHOLE,
        (
            "compiled/c/elimination.c", "solvers/static_condensation.py:_interior_vertices",
            "solvers/static_condensation.py:_runs", "solvers/static_condensation.py:_plan",
            "solvers/static_condensation.py:_what_is_left",
            "solvers/static_condensation.py:Elimination",
        ),
    ),
    "dense fronts": Acceleration(
        "Eliminate what the elimination along beams leaves, in dense matrices whose products stay "
        "in registers. Without it, KLU does so, called by PETSc. The more joints a scene has, the "
        "more of them are worth: see docs/ranks.md.",
        by.SHIPPED, by.LEFT,
        ("compiled/c/fronts.c", "solvers/multifrontal.py"),
    ),
    "guess with the acceleration": Acceleration(
        "Adds to the guess of a step that part of the last second difference of the configuration "
        "which repeats itself. Without it, a step begins at the velocity of the last one.",
        by.SHIPPED, by.VELOCITY,
        (
            "compiled/c/march.c:enter_step", "compiled/c/march.c:compare_differences",
            "compiled/c/march.c~p->both|compare_differences",
        ),
        (ELASTIC, LARGE, SWING, HINGED, JOINTED),
    ),
    "tangent kept in the last iteration": Acceleration(
        "Keeps the tangent of the previous iterate if the residual then decreases far below the "
        "tolerance, at most once in a row. Without it, every iteration assembles and factors a "
        "tangent.",
        by.SHIPPED, by.TANGENTS,
        ("compiled/c/newton.c~e->near|\\bkept\\b|\\bclose\\b|CLOSE",),
        (ELASTIC, LARGE, HINGED, JOINTED),
    ),
}  # fmt: skip
"""Accelerations by name."""


def variants(scene):
    """Names of the variants that the accelerations measured in a scene compare; shipped first."""
    here = [one for one in ACCELERATIONS.values() if scene in one.scenes]
    return list(dict.fromkeys([by.SHIPPED, *(x for one in here for x in (one.with_, one.without))]))


# -- lines of code -------------------------------------------------------------------------------


def lines_of(place):
    """Numbers of the lines of code, a set of (file, line); blank ones and comments count."""
    file, _, name = place.partition(":")
    file, _, pattern = file.partition("~")
    text = (PACKAGE / file).read_text(encoding="utf-8").splitlines()
    if pattern:
        found = [i for i, line in enumerate(text, 1) if re.search(pattern, line)]
    elif not name:
        found = range(1, len(text) + 1)
    elif file.endswith(".c"):
        found = lines_of_function(text, name)
    else:
        found = lines_of_definition(text, name.split("."))
    if not found:
        raise ValueError(f"{place} is not in the package")
    return {(file, i) for i in found}


def lines_of_function(text, name):
    """Lines of a function of C."""
    starts = [i for i, line in enumerate(text, 1) if re.match(rf"[a-z].*\b{name}\(", line)]
    if not starts:
        return []
    end = next(i for i, line in enumerate(text, 1) if i > starts[0] and line == "}")
    return range(starts[0], end + 1)


def lines_of_definition(text, names):
    """Lines of a class, function or method of Python."""
    node = ast.parse("\n".join(text))
    for name in names:
        node = next((x for x in node.body if getattr(x, "name", "") == name), None)
        if node is None:
            return []
    return range(node.lineno, node.end_lineno + 1)


def count(code):
    """Number of lines of code at these places."""
    return len(set().union(*map(lines_of, code)))


def files(code):
    """Names of the files, in order."""
    return list(dict.fromkeys(re.split("[:~]", place)[0] for place in code))
