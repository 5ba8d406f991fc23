# SPDX-License-Identifier: MIT
"""Functions in Python that SNES calls: residual, tangent, convergence test."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import Any

from petsc4py import PETSc

import numpy as np

from ufl_beam.arrays import Array, Index
from ufl_beam.solvers.equation import Equation
from ufl_beam.solvers.vectors import Vectors


class SnesCallbacks:
    """Residual and tangent of an equation in vectors of PETSc.

    ``idle`` are entries of the tangent and stiffnesses that hold idle motions, if there are any.
    """

    def __init__(self, equation: Equation, vectors: Vectors, stop: Callable[[int], int]) -> None:
        self._equation, self._vectors, self._stop = equation, vectors, stop
        self.idle: tuple[Index, Array] | None = None

    @contextmanager
    def noted(self) -> Iterator[None]:
        """Note exceptions instead of raising them through PETSc: processes must stop together."""
        try:
            yield
        except BaseException as error:
            self._equation.note(error)

    def function(self, snes: PETSc.SNES, x: PETSc.Vec, f: PETSc.Vec) -> None:
        """Compute the residual ``f`` at ``x``."""
        self._vectors.update_ghosts(x)
        r = self._vectors.view(f, writable=True)
        with self.noted():
            self._equation.residual(self._vectors.view(x), r)
        if self._equation.error is not None:
            # It may have failed on this process alone; by the sum all give up together.
            r.fill(np.nan)
        self._vectors.add_ghosts(f)
        f.stateIncrease()
        self._equation.complete(r)

    def jacobian(self, snes: PETSc.SNES, x: PETSc.Vec, J: PETSc.Mat, P: PETSc.Mat) -> None:
        """Compute the tangent at ``x``, unless the last one is near enough."""
        if self._equation.c.near:
            return
        self._vectors.update_ghosts(x)
        with self.noted():
            self._equation.tangent(self._vectors.view(x))
            if self.idle is not None:
                entries, stiffnesses = self.idle
                self._equation.A.data[entries] += stiffnesses
        P.stateIncrease()

    def test(self, snes: Any, iteration: int, norms: Any) -> int:
        """Return why to stop after an iteration, or zero."""
        return self._stop(iteration)
