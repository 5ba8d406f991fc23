# SPDX-License-Identifier: MIT
"""Newton's method with a line search, for steps in which full corrections lead nowhere."""

from __future__ import annotations

from functools import partial

from petsc4py import PETSc

from ufl_beam.compiled.c_library import lib
from ufl_beam.solvers.convergence import Convergence
from ufl_beam.solvers.equation import Equation
from ufl_beam.solvers.vectors import Vectors

EVALUATIONS = 4
"""Residuals that one search may cost."""

PART = 0.5
"""Part of the work of the residual at the beginning that a search must come down to."""

LONGEST, SHORTEST = 1.0, 1e-12
"""Limits of a step, as parts of the full one."""


class SearchingNewton:
    """Newton's method with steps to where the residual does no work on them, for points that flow.

    Forces that grow in an S, as in a point that yields one way or the other, send full steps from
    one branch to the other and back for ever.  Work is the only product of residuals and steps that
    adds forces and moments, and it is the same in all units.  Forces of connectors are unknowns of
    their own, so the line search of PETSc would add products of forces; here the law of a
    connector, in the place of its force, does work on the change of its motion.  It answers like
    the SNES whose function, Jacobian and linear solver it uses.
    """

    def __init__(
        self, snes: PETSc.SNES, vectors: Vectors, equation: Equation, convergence: Convergence
    ) -> None:
        self._snes, self._ksp, self._vectors = snes, snes.getKSP(), vectors
        self._equation, self._convergence = equation, convergence
        self._f, self._matrix = snes.getFunction()[0], snes.getJacobian()[0]
        self._y, self._trial = vectors.new(), vectors.new()
        self._reason = self._iterations = 0

    def getConvergedReason(self) -> int:
        """Why the last solution ended; as of PETSc."""
        return self._reason

    def getIterationNumber(self) -> int:
        """Iterations of the last solution."""
        return self._iterations

    def solve(self, b: None, x: PETSc.Vec) -> None:
        """Find the root of the residual from ``x``, which takes it."""
        self._iterations = 0
        self._reason = self._solve(x)

    def _solve(self, x: PETSc.Vec) -> int:
        c = self._equation.c
        self._snes.computeFunction(x, self._f)
        while not (reason := self._test()):
            if self._iterations == c.most:
                return int(lib.TOO_MANY)
            if not c.near:
                self._snes.computeJacobian(x, self._matrix)
                self._ksp.setOperators(self._matrix)
            self._ksp.solve(self._f, self._y)
            if self._ksp.getConvergedReason() < 0:
                return int(lib.SINGULAR)
            self._search(x)
            self._iterations += 1
        return reason

    def _test(self) -> int:
        """Show the monitors of the SNES an iterate; return why to stop there, or zero."""
        self._snes.monitor(self._iterations, self._f.norm())
        return self._convergence.test(self._iterations)

    def _search(self, x: PETSc.Vec) -> None:
        """Go the part of the full step at which the residual does no work, found by secants."""
        for vector in (x, self._y):
            self._vectors.update_ghosts(vector)
        step = self._equation.working(*map(self._vectors.view, (x, self._y)))
        work = partial(self._convergence.work, step)
        before, part_before, part = work(), 0.0, 1.0
        first, evaluations = before, 0
        while True:
            self._trial.waxpy(-part, self._y, x)
            self._snes.computeFunction(self._trial, self._f)
            now = work()
            evaluations += 1
            if evaluations == EVALUATIONS or not abs(now) > PART * abs(first):
                break
            slope = (now - before) / (part - part_before)
            if slope == 0.0:
                break
            next_part = part - now / slope
            if next_part < SHORTEST:
                next_part = part + now / slope
            if not SHORTEST <= next_part <= LONGEST:
                break
            before, part_before, part = now, part, next_part
        self._trial.copy(x)
