# SPDX-License-Identifier: MIT
"""Newton's method with a line search, for steps in which full corrections lead nowhere."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

from petsc4py import PETSc

from ufl_beam.compiled.c_library import lib

EVALUATIONS = 4
"""Residuals that one search may cost."""

PART = 0.5
"""Part of the work of the residual at the beginning that a search must come down to."""

LONGEST, SHORTEST = 1.0, 1e-12
"""Limits of a step, as parts of the full one."""


@dataclass
class SearchingNewton:
    """Newton's method with steps to where the residual does no work on them, for points that flow.

    Forces that grow in an S, as in a point that yields one way or the other, send full steps from
    one branch to the other and back for ever.  Work is the only product of residuals and steps that
    adds forces and moments, and it is the same in all units.  Forces of connectors are unknowns of
    their own, so the line search of PETSc would add products of forces; here the law of a
    connector, in the place of its force, does work on the change of its motion. It answers like the
    SNES whose function and Jacobian it uses.  ``test`` gives the reason to stop after an iteration,
    ``near`` says to keep the tangent, and ``work(step)`` makes a function that gives the work (J)
    of the latest residual on a step from the iterate of the tangent.
    """

    snes: PETSc.SNES
    ksp: PETSc.KSP
    x: PETSc.Vec
    f: PETSc.Vec
    y: PETSc.Vec
    w: PETSc.Vec
    matrix: PETSc.Mat
    test: Callable[[int], int]
    near: Callable[[], bool]
    work: Callable[[PETSc.Vec], Callable[[], float]]
    most: int
    _reason: int = 0
    _iterations: int = 0

    def getConvergedReason(self) -> int:
        """Why the last solution ended; as of PETSc."""
        return self._reason

    def getIterationNumber(self) -> int:
        """Iterations of the last solution."""
        return self._iterations

    def solve(self, b: None, x: PETSc.Vec) -> None:
        """Find the root of the residual from ``x``, which takes it."""
        self._iterations = 0
        self._reason = self._solve()

    def _solve(self) -> int:
        self.snes.computeFunction(self.x, self.f)
        while not (reason := self.test(self._iterations)):
            if self._iterations == self.most:
                return int(lib.TOO_MANY)
            if not self.near():
                self.snes.computeJacobian(self.x, self.matrix)
                self.ksp.setOperators(self.matrix)
            self.ksp.solve(self.f, self.y)
            if self.ksp.getConvergedReason() < 0:
                return int(lib.SINGULAR)
            self._search(self.work(self.y))
            self._iterations += 1
        return reason

    def _search(self, work: Callable[[], float]) -> None:
        """Go the part of the full step at which the residual does no work, found by secants."""
        before, part_before, part = work(), 0.0, 1.0
        first, evaluations = before, 0
        while True:
            self.w.waxpy(-part, self.y, self.x)
            self.snes.computeFunction(self.w, self.f)
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
        self.w.copy(self.x)
