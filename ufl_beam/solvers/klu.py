# SPDX-License-Identifier: MIT
"""KLU, the sparse LU factorization of SuiteSparse, called by PETSc."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from petsc4py import PETSc

import numpy as np

from ufl_beam.arrays import Array
from ufl_beam.compiled.c_library import doubles, fill, lib, opaque
from ufl_beam.compiled.csr import Csr
from ufl_beam.solvers.substructuring import Condensed

GOOD = int(PETSc.PC.FailedReason.NOERROR)
BAD_PIVOT = int(PETSc.PC.FailedReason.FACTOR_NUMERIC_ZEROPIVOT)


def succeeds(function: Callable[..., None], *arguments: Any) -> bool:
    """Return False if KLU finds that the matrix is singular; its next factorisation works."""
    try:
        function(*arguments)
    except PETSc.Error as error:
        if error.ierr != lib.OF_LIBRARY:
            raise
        return False
    return True


class Klu:
    """Factorization of all of a system, which exchanges rows wherever that is needed.

    Satisfies :class:`Condensed`; nothing is left.
    """

    def __init__(self, inner: Condensed) -> None:
        self._inner, self._matrix = inner, inner.left.petsc()
        self.numbers = inner.numbers[:0]
        self.left, self.f = Csr(np.empty(0), self.numbers, np.zeros(1)), np.empty(0)
        self._factors = PETSc.PC().create(PETSc.COMM_SELF)
        self._factors.setOperators(self._matrix)
        self._factors.setType("lu")
        self._factors.setFactorSolverType("klu")
        self._rhs = PETSc.Vec().createWithArray(inner.f, comm=PETSc.COMM_SELF)
        self._solution = self._rhs.duplicate()

    def drive(self, c: Any) -> None:
        """Let Newton's method in C do the same; ``c`` is its ``equation`` of loops.h."""
        of_petsc = self._factors, self._matrix, self._rhs, self._solution
        c.factors, c.left, c.left_f, c.left_x = map(opaque, of_petsc)
        fill(c, found=doubles(self._solution.array_r))

    def factor(self, b: Array) -> bool:
        """Eliminate from matrix and right-hand side; whether that succeeds."""
        good = self._inner.factor(b)
        self._matrix.stateIncrease()
        good = good and succeeds(self._factors.setUp)
        good = good and int(self._factors.getFailedReason()) == GOOD
        return good and succeeds(self._solve)

    def reduce(self, b: Array) -> None:
        """Eliminate from another right-hand side; ``b`` at the degrees of freedom owned here.

        Raises:
            PETSc.Error: The matrix is singular after all.
        """
        self._inner.reduce(b)
        self._solve()

    def _solve(self) -> None:
        self._rhs.stateIncrease()
        self._factors.apply(self._rhs, self._solution)

    def expand(self, small: Array, x: Array) -> None:
        """The solution at the degrees of freedom owned here."""
        self._inner.expand(self._solution.array_r, x)
