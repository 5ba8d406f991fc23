# SPDX-License-Identifier: MIT
"""Options of Newton's method, and a check that PETSc uses all PETSc options among them."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from difflib import get_close_matches
from functools import partial
from typing import Annotated, Any

from mpi4py import MPI
from petsc4py import PETSc

from ufl_beam.compiled.c_library import ffi, petsc
from ufl_beam.display import compact_repr
from ufl_beam.errors import ArgumentError, require_count, require_kind, require_switch, require_text
from ufl_beam.model.records import Positive, Record
from ufl_beam.parallel import Agreement

PREFIX = "ub_"
"""Prefix of the PETSc options of the solver, as in ``-ub_snes_monitor``."""


@dataclass(frozen=True)
class Newton(Record):
    """Options of Newton's method: tolerance, number of iterations, PETSc options, solver.

    Args:
        rtol: Tolerance of the residual, relative to the forces in the scene.  With 1e-12 or less,
            steps of dynamics also keep digits that are lost in large displacements.
        max_iterations: Largest number of iterations of a step; a step that needs more is divided.
        petsc: PETSc options without their prefix, such as ``{"snes_monitor": None}``; in
            ``PETSC_OPTIONS`` they have the prefix ``ub_``.  With any option, PETSc's Newton method
            replaces an equivalent method in C, which is faster for few cells.  With
            ``snes_linesearch_type``, that line search is also used when full steps stall.
            A run raises :class:`ArgumentError` for options that PETSc does not use.
        reference: True if the reference solver computes the run: plain DOLFINx forms on one mesh,
            a return map in NumPy and PETSc's SNES, ten to a hundred times slower.
            :func:`simulate` accepts it for equal steps and for the scenes that docs/theory.md
            names.

    Example:
        >>> newton = ub.Newton(rtol=1e-12, petsc={"snes_linesearch_type": "bt"})
        >>> run = ub.simulate(scene, ub.Static(), t=(0, 1), dt=0.5, newton=newton)
    """

    _refused = ArgumentError

    rtol: Positive = 1e-10
    max_iterations: Annotated[int, require_count] = 30
    petsc: Annotated[dict[str, Any], partial(require_kind, kind=dict)] = field(default_factory=dict)
    reference: Annotated[bool, require_switch] = False

    __repr__ = compact_repr

    def __post_init__(self) -> None:
        super().__post_init__()
        for option in self.petsc:
            require_text(option, "Newton: petsc, an option")


def require_plain(newton: Newton | None, what: str) -> None:
    """Raise :class:`ArgumentError` if ``newton`` has the reference solver, which lacks ``what``."""
    if newton is not None and newton.reference:
        raise ArgumentError(
            f"Newton: reference=True cannot be combined with {what}: the reference solver computes "
            "equal steps of simulate, without checkpoints; leave it out"
        )


# -- options of PETSc ------------------------------------------------------------------------------

WHILE_SOLVING = (
    "snes_convergence_estimate", "snes_test_jacobian", "snes_test_jacobian_view", "snes_view",
    "snes_view_pre", "snes_view_solution",
)  # fmt: skip
"""Options that PETSc reads only when it solves; they must be in ``PETSC_OPTIONS``."""

USUAL = (
    *WHILE_SOLVING, "ksp_atol", "ksp_converged_reason", "ksp_error_if_not_converged",
    "ksp_gmres_restart", "ksp_max_it", "ksp_monitor", "ksp_monitor_true_residual", "ksp_rtol",
    "ksp_type", "ksp_view", "pc_factor_mat_ordering_type", "pc_factor_mat_solver_type",
    "pc_factor_shift_type", "pc_type", "snes_atol", "snes_converged_reason",
    "snes_divergence_tolerance", "snes_error_if_not_converged", "snes_force_iteration",
    "snes_lag_jacobian", "snes_lag_preconditioner", "snes_linesearch_damping",
    "snes_linesearch_max_it", "snes_linesearch_minlambda", "snes_linesearch_monitor",
    "snes_linesearch_order", "snes_linesearch_type", "snes_max_funcs", "snes_max_it",
    "snes_monitor", "snes_monitor_residual", "snes_monitor_short", "snes_monitor_solution",
    "snes_rtol", "snes_stol", "snes_type",
)  # fmt: skip
"""Options that are suggested for a misspelt option, because PETSc has no list of its options."""


def database() -> dict[str, Any]:
    """Return the options of the solver in PETSc's database, without their prefix."""
    return dict(PETSc.Options(PREFIX).getAll())


def apply_options(snes: PETSc.SNES, chosen: Mapping[str, Any]) -> list[str]:
    """Apply options to a SNES, its KSP and its PC; return the options that none of them has read.

    PETSc's database is restored afterwards, because other solvers have the same prefix.
    """
    options, before, unused = PETSc.Options(PREFIX), database(), list[str]()
    try:
        for name in before:
            del options[name]  # the option may be marked as used
        for name, value in chosen.items():
            options[name] = value
        snes.setFromOptions()
        # PETSc may have replaced deprecated options by their new names.
        for name in chosen.keys() & database().keys():
            used = ffi.new("char[8]")  # space for a C bool of any size
            option = ffi.new("char[]", (PREFIX + name).encode())
            petsc("PetscOptionsUsed", ffi.NULL, option, used)
            if not any(bytes(ffi.buffer(used))):
                unused.append(name)
    finally:
        for name in {**chosen, **database()}:
            del options[name]
        for name, value in before.items():
            options[name] = value
    for name in before.keys() - {*unused}:
        options.hasName(name)  # otherwise PETSc would report it as unused when it finalizes
    return unused


def checked_newton(newton: Newton | None, comm: MPI.Intracomm) -> Newton:
    """Check and return the options of Newton's method, or the defaults; all processes call it."""
    newton = Newton() if newton is None else newton
    require_kind(newton, Newton, "newton")
    Agreement(comm)(_require_known, newton)
    return newton


def _require_known(newton: Newton) -> None:
    """Raise if PETSc would not use an option or refuses its value; called before any solution."""
    chosen = {**database(), **newton.petsc}
    if not chosen:
        return
    snes, ksp = PETSc.SNES().create(MPI.COMM_SELF), PETSc.KSP().create(MPI.COMM_SELF)
    try:
        for x in (snes, ksp):
            x.setOptionsPrefix(PREFIX)
        snes.setType("newtonls")
        ksp.setType("preonly")
        ksp.getPC().setType("python")
        snes.setKSP(ksp)
        unused = apply_options(snes, chosen)
    except PETSc.Error as error:
        spelt = (f"-{PREFIX}{k}" + ("" if v is None else f" {v}") for k, v in chosen.items())
        raise ArgumentError(f"PETSc refuses the options {' '.join(spelt)}: {error}") from None
    finally:
        snes.destroy()
        ksp.destroy()
    for name in unused:
        in_database = name not in newton.petsc
        if in_database and name in WHILE_SOLVING:
            continue
        where = "PETSC_OPTIONS" if in_database else "Newton: petsc"
        matches = [PREFIX + match for match in get_close_matches(name, USUAL, n=3)]
        hint = f"; did you mean {' or '.join(matches)}?" if matches else "; leave it out"
        if name in WHILE_SOLVING:
            hint = "; such options must be in PETSC_OPTIONS"
        raise ArgumentError(f"{where}: PETSc does not use the option {PREFIX}{name}{hint}")
