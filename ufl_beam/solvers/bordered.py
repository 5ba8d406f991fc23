# SPDX-License-Identifier: MIT
"""Newton's method for an equation bordered by one more unknown and one more equation."""

from __future__ import annotations

from petsc4py import PETSc

from ufl_beam.compiled.c_library import lib
from ufl_beam.solvers.equation import Border, SnesCallbacks


class BorderedNewton:
    """SNES of the bordered equation, with full steps, and the preconditioner of its tangent.

    By elimination of the border: one factorisation and two solutions, as the tangent alone is
    banded.  Where that is nearly singular, the next iteration makes up for the lost digits.
    """

    def __init__(
        self, snes: PETSc.SNES, callbacks: SnesCallbacks, factors: PETSc.PC, border: Border
    ) -> None:
        self.snes, self.border, self._callbacks, self._factors = snes, border, callbacks, factors
        self._vectors, self._held = callbacks.vectors, callbacks.equation.held
        self._rate, self._y, self._z = (self._vectors.new() for _ in range(3))
        snes.setFunction(self._function, snes.getFunction()[0])
        snes.setJacobian(self._jacobian, snes.getJacobian()[0])
        snes.setConvergenceTest(self._test)
        ksp = PETSc.KSP().create(snes.comm)
        ksp.setType("preonly")
        ksp.getPC().setType("python")
        ksp.getPC().setPythonContext(self)
        snes.setKSP(ksp)

    def _function(self, snes: PETSc.SNES, x: PETSc.Vec, f: PETSc.Vec) -> None:
        self._vectors.update_ghosts(x)
        with self._callbacks.noted():
            self.border.arrive(self._vectors.view(x))
        self._callbacks.function(snes, x, f)

    def _jacobian(self, snes: PETSc.SNES, x: PETSc.Vec, J: PETSc.Mat, P: PETSc.Mat) -> None:
        self._vectors.update_ghosts(x)
        rate = self._vectors.view(self._rate, writable=True)
        rate.fill(0.0)
        with self._callbacks.noted():
            self.border.tangent(self._vectors.view(x), rate)
            self._callbacks.hold_idle()
        P.stateIncrease()
        self._vectors.add_ghosts(self._rate)
        rate[self._held] = 0.0
        self._rate.stateIncrease()

    def setUp(self, pc: PETSc.PC) -> None:
        """Factor; PETSc asks for it where the matrix has changed."""
        self._factors.setOperators(*pc.getOperators())
        self._factors.setUp()

    def apply(self, pc: PETSc.PC, b: PETSc.Vec, y: PETSc.Vec) -> None:
        """Solve the bordered system for a right-hand side."""
        self._factors.apply(b, y)
        self._factors.apply(self._rate, self._z)
        pc.setFailedReason(failed := self._factors.getFailedReason())
        if failed:
            return
        y.copy(self._y)
        self._vectors.update_ghosts(self._y)
        self._vectors.update_ghosts(self._z)
        corrected = self._vectors.view(self._y, writable=True)
        with self._callbacks.noted():
            self.border.correct(corrected, self._vectors.view(self._z))
        owned = y.array_w
        owned[:] = corrected[: len(owned)]

    def _test(self, snes: PETSc.SNES, iteration: int, norms: tuple[float, ...]) -> int:
        reason = self._callbacks.test(snes, iteration, norms)
        return int(lib.ITERATING) if reason > 0 and not self.border.met() else reason
