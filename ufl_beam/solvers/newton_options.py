# SPDX-License-Identifier: MIT
"""Options of Newton's method."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any

from ufl_beam.display import one_line
from ufl_beam.errors import (
    SceneError,
    require_count,
    require_kind,
    require_number,
    require_switch,
    require_text,
)

PREFIX = "ub_"
"""Prefix of the PETSc options of the solver, as in ``-ub_snes_monitor``."""


@dataclass(frozen=True)
class Newton:
    """Options of Newton's method: tolerance, number of iterations, PETSc options.

    Args:
        rtol: Tolerance of the residual, as a part of the forces in the scene.
        max_iterations: Iterations before a step is cut.
        modified: Keep the tangent, also from step to step, while residuals decrease fast enough.
            This saves more with more cells; final residuals are closer to ``rtol``.  In statics,
            and with a checkpoint, each step begins with a new one.
        petsc: PETSc options without their prefix, such as ``{"snes_monitor": None}``; in
            ``PETSC_OPTIONS`` they have the prefix ``ub_``.  With any option PETSc's Newton method
            is used, otherwise an equivalent one in C, which is faster for few cells.  A
            ``snes_linesearch_type`` replaces the line search after full steps.  A run raises
            :class:`SceneError` for options that PETSc has no use for.
        reference: Let the reference solver compute the run: the equations of the paper with forms
            of DOLFINx, a return map in NumPy and PETSc's SNES, to compare with, or to read.  It is
            ten to a thousand times slower; :func:`simulate` takes it with equal steps, on one
            process.  See docs/theory.md.

    Example:
        >>> newton = ub.Newton(rtol=1e-12, petsc={"snes_linesearch_type": "bt"})
        >>> run = ub.simulate(scene, ub.Static(), t=(0, 1), dt=0.5, newton=newton)
    """

    rtol: float = 1e-10
    max_iterations: int = 30
    modified: bool = False
    petsc: dict[str, Any] = field(default_factory=dict)
    reference: bool = False

    __repr__ = one_line

    def __post_init__(self) -> None:
        require_number(self.rtol, "Newton: rtol", positive=True)
        require_count(self.max_iterations, "Newton: max_iterations")
        object.__setattr__(self, "max_iterations", int(self.max_iterations))
        require_switch(self.modified, "Newton: modified")
        require_kind(self.petsc, dict, "Newton: petsc")
        require_switch(self.reference, "Newton: reference")
        for option in self.petsc:
            require_text(option, "Newton: petsc, an option")


def require_plain(newton: Newton | None, what: str) -> None:
    """Raise :class:`SceneError` naming ``what`` the reference solver does not compute."""
    if newton is not None and newton.reference:
        raise SceneError(
            f"Newton: reference=True does not go with {what}: the reference solver computes equal "
            "steps of simulate, on one process and without files; leave it out"
        )
