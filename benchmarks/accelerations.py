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
        "Newton's method with full steps is in C, as a SNES of the type \"shell\". Without it, "
        "PETSc's `newtonls` calls the same residual and tangent in C, and Python calls the "
        "factorization.",
        by.SHIPPED, by.PETSC,
        (
            "compiled/c/newton.c:factor_tangent", "compiled/c/newton.c:solve_tangent",
            "compiled/c/newton.c:find_change", "compiled/c/newton.c:newton",
            "compiled/c/newton.c:snes_newton", "solvers/multifrontal.py:Multifrontal.drive",
            "solvers/beam_elimination.py:CondensedSolver.drive",
            "solvers/substructuring.py:Klu.drive",
        ),
    ),
    "SIMD kernels": Acceleration(
        "FFCx's kernels are compiled a second time with SIMD vectors and compute four or eight "
        "cells at once; they also compute laws of fibres with powers, exponentials or "
        "logarithms for several fibres at once. Without it, FFCx's own kernels compute one cell or "
        "fibre at a time.",
        by.SHIPPED, by.SCALAR,
        (
            "compiled/simd_kernels.py", "compiled/c/assembly_simd.c", "compiled/c/assembly_simd.h",
            "compiled/c/points_simd.c", "compiled/c/check_simd.c",
            "discretization/compiled_forms.py~several|BATCH|batch_size",
        ),
    ),
    "elimination along beams": Acceleration(
        "The interior vertices of beams are eliminated first, in blocks of three unknowns, in "
        "space of six. Dense "
        "fronts factor the remaining matrix; KLU factors it if more than 24 unknowns remain and "
        "forces of connectors are among them. Without it, the same solver factors the whole "
        "tangent. On several processes, each process eliminates its own unknowns, or in scenes "
        "with forces of connectors only the unknowns along its beams. Each process then factors "
        "the remaining matrix.",
        by.SHIPPED, by.WHOLE,
        (
            "compiled/c/beam_elimination.c", "solvers/beam_elimination.py:_interior_vertices",
            "solvers/beam_elimination.py:_runs", "solvers/beam_elimination.py:_plan",
            "solvers/beam_elimination.py:Elimination",
        ),
    ),
    "dense fronts": Acceleration(
        "The unknowns that remain after the elimination along beams, mostly of joints, are "
        "eliminated in small dense matrices (fronts), with partial sums in registers. Without it, "
        "KLU, called by PETSc, factors the remaining matrix. Both variants use KLU if more than 24 "
        "unknowns remain and forces of connectors are among them. The gain grows with the number "
        "of joints: see docs/ranks.md.",
        by.SHIPPED, by.LEFT,
        ("compiled/c/multifrontal.c", "solvers/multifrontal.py"),
    ),
    "guess with the acceleration": Acceleration(
        "The initial guess extrapolates with the velocity of the last step and adds a fraction of "
        "the last second difference of the configuration. Without it, the guess only extrapolates "
        "with the velocity of the last step.",
        by.SHIPPED, by.VELOCITY,
        (
            "compiled/c/steps.c:enter_step", "compiled/c/steps.c:compare_differences",
            "compiled/c/steps.c~p->both|compare_differences",
        ),
        (ELASTIC, LARGE, SWING, HINGED, JOINTED),
    ),
    "tangent kept in the last iterations": Acceleration(
        "One or two iterations reuse the previous tangent if the residual is expected to fall far "
        "below the tolerance in them. Without it, every iteration assembles and factors a tangent. "
        "In space, where tangents are longer, steps take [1.2 to 1.4](space.md#cost) times as long "
        "without it.",
        by.SHIPPED, by.TANGENTS,
        ("compiled/c/newton.c~e->near|\\bkept\\b|\\bclose\\b|CLOSE|MARGIN|\\bfactor\\b",),
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
