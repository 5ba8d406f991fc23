# SPDX-License-Identifier: MIT
"""Direct solver as a PETSc preconditioner: condensation along beams."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from petsc4py import PETSc

from ufl_beam.compiled.c_library import doubles, ffi, lib
from ufl_beam.compiled.csr import Csr
from ufl_beam.discretization.partition import Share
from ufl_beam.solvers.static_condensation import Elimination

GOOD = int(PETSc.PC.FailedReason.NOERROR)
BAD_PIVOT = int(PETSc.PC.FailedReason.FACTOR_NUMERIC_ZEROPIVOT)


class ChainsFirst:
    """Direct solver: condensation along the beams, then factorization by ``package`` of the rest.

    Every process factors what is left, which is small, instead of waiting for another.
    """

    def __init__(self, share: Share, A: Csr, package: str) -> None:
        self._elimination = left = Elimination(share, A)
        self._good = False
        arrays = (left.indptr.astype(PETSc.IntType), left.indices.astype(PETSc.IntType), left.data)
        self._matrix = PETSc.Mat().createAIJWithArrays(left.size, arrays, comm=PETSc.COMM_SELF)
        self._matrix.assemble()
        self._factors = PETSc.PC().create(PETSc.COMM_SELF)
        self._factors.setOperators(self._matrix)
        self._factors.setType("lu")
        self._factors.setFactorSolverType(package)
        self._factors.setFactorPivot(0.0)  # PETSc takes 2e-14 for zero, whatever the units
        if package == "petsc":
            # Of narrow and wide lattices it fills in least: 0.55 and 0.9 of the time of "nd".
            self._factors.setFactorOrdering("amd")
        self._rhs = PETSc.Vec().createWithArray(left.f, comm=PETSc.COMM_SELF)
        self._solution = self._rhs.duplicate()
        self._found = doubles(self._solution.array_r)

    def drive(self, c: Any) -> None:
        """Let Newton's method in C do the same; ``c`` is its ``equation`` of loops.h."""
        c.chains, c.found = self._elimination.c, self._found
        c.factors, c.left, c.left_f, c.left_x = (
            ffi.cast("void *", one.handle)
            for one in (self._factors, self._matrix, self._rhs, self._solution)
        )

    def setUp(self, pc: PETSc.PC) -> None:
        """Factor; PETSc asks for it where the matrix has changed."""
        self._matrix.stateIncrease()
        self._good = self._elimination.factor() and self._succeeds(self._factors.setUp)
        self._good = self._good and int(self._factors.getFailedReason()) == GOOD
        pc.setFailedReason(GOOD if self._good else BAD_PIVOT)

    def _succeeds(self, function: Callable[..., None], *vectors: PETSc.Vec) -> bool:
        """Return False if KLU finds that the matrix is singular; its next factorisation works."""
        try:
            function(*vectors)
        except PETSc.Error as error:
            if error.ierr != lib.OF_LIBRARY:
                raise
            return False
        return True

    def apply(self, pc: PETSc.PC, b: PETSc.Vec, x: PETSc.Vec) -> None:
        """Solve; zero after a failure, where an error would leave objects of PETSc half done."""
        if self._good:
            self._elimination.reduce(b.array_r)
            self._rhs.stateIncrease()
            self._good = self._succeeds(self._factors.apply, self._rhs, self._solution)
        if self._good:
            self._elimination.expand(self._solution.array_r, x.array_w)
        else:
            x.array_w[:] = 0.0
            pc.setFailedReason(BAD_PIVOT)
