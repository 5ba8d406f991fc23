# SPDX-License-Identifier: MIT
"""Reduced systems, their sum over processes, and their factorization by KLU.

Substructuring: each process eliminates chains and, in scenes without forces of connectors, all
other unknowns that only this process has.  The Schur complements of the processes are summed; each
process factors the sum.

Each reduced system (``Multifrontal``, ``Summed``, ``Klu``) is built on another system with more
unknowns; the first, ``Elimination``, is built on the full matrix.  A reduced system has

* ``dofs``: degrees of freedom that remain, in numbers of the scene;
* ``factor(b)``: reduces the matrix and a right-hand side at the degrees of freedom that this
  process owns; returns whether all results are finite;
* ``reduce(b)``: reduces another right-hand side by the same factors;
* ``left``, ``f``: matrix and right-hand side of the reduced system, which the caller solves;
* ``expand(small, x)``: computes the solution at the degrees of freedom that this process owns from
  the solution of the reduced system.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from mpi4py import MPI
from petsc4py import PETSc

import numpy as np

from ufl_beam.arrays import Array
from ufl_beam.compiled.c_library import doubles, fill, lib, opaque
from ufl_beam.compiled.csr import Csr


class Summed:
    """Sum of the reduced systems of all processes, which each process stores as a whole."""

    def __init__(self, inner: Any, comm: MPI.Intracomm) -> None:
        self._inner, self._comm = inner, comm
        self.dofs = np.unique(np.concatenate(comm.allgather(inner.dofs)))
        size = len(self.dofs)
        self._number = np.searchsorted(self.dofs, inner.dofs)
        A = inner.left
        mine = self._number[A.rows()].astype(np.int64) * size + self._number[A.indices]
        keys = np.unique(np.concatenate(comm.allgather(mine)))
        self._place = np.searchsorted(keys, mine)
        # Entries, right-hand side, and number of processes that have failed.
        self._sums = np.zeros(len(keys) + size + 1)
        data, self.f, self._failed = np.split(self._sums, [len(keys), len(keys) + size])
        indptr = np.searchsorted(keys, np.arange(size + 1) * size)
        self.left = Csr(data, keys % size if size else keys, indptr)

    def factor(self, b: Array) -> bool:
        """Reduce and sum on all processes; return whether all results are finite."""
        good = self._inner.factor(b)
        self._sums[:] = 0.0
        self.left.data[self._place] = self._inner.left.data
        self.f[self._number] = self._inner.f
        self._failed[:] = not good
        self._comm.Allreduce(MPI.IN_PLACE, self._sums)
        return self._failed == 0.0 and bool(lib.all_finite(len(self._sums), doubles(self._sums)))

    def reduce(self, b: Array) -> None:
        """Reduce another right-hand side by the same factors."""
        self._inner.reduce(b)
        self.f.fill(0.0)
        self.f[self._number] = self._inner.f
        self._comm.Allreduce(MPI.IN_PLACE, self.f)

    def expand(self, small: Array, x: Array) -> None:
        """Compute the solution ``x`` from the solution ``small`` of the reduced system."""
        self._inner.expand(small[self._number], x)


# -- KLU, the sparse LU factorization of SuiteSparse, called by PETSc ------------------------------

GOOD = int(PETSc.PC.FailedReason.NOERROR)
BAD_PIVOT = int(PETSc.PC.FailedReason.FACTOR_NUMERIC_ZEROPIVOT)


def succeeds(function: Callable[..., None], *arguments: Any) -> bool:
    """Call a function; return False if KLU finds a singular matrix; KLU can be used again then."""
    try:
        function(*arguments)
    except PETSc.Error as error:
        if error.ierr != lib.OF_LIBRARY:
            raise
        return False
    return True


class Klu:
    """Factorization of an entire system by KLU, with all row exchanges that it needs."""

    def __init__(self, inner: Any) -> None:
        self._inner, self._matrix = inner, inner.left.petsc()
        self.dofs = inner.dofs[:0]
        self.left, self.f = Csr(np.empty(0), self.dofs, np.zeros(1)), np.empty(0)
        self._factors = PETSc.PC().create(PETSc.COMM_SELF)
        self._factors.setOperators(self._matrix)
        self._factors.setType("lu")
        self._factors.setFactorSolverType("klu")
        self._rhs = PETSc.Vec().createWithArray(inner.f, comm=PETSc.COMM_SELF)
        self._solution = self._rhs.duplicate()

    def drive(self, c: Any) -> None:
        """Let Newton's method in C use these factors; ``c`` is its ``equation`` of loops.h."""
        objects = self._factors, self._matrix, self._rhs, self._solution
        c.factors, c.left, c.left_f, c.left_x = map(opaque, objects)
        fill(c, found=doubles(self._solution.array_r))

    def factor(self, b: Array) -> bool:
        """Factor the matrix and solve; return whether both succeed."""
        good: bool = self._inner.factor(b)
        self._matrix.stateIncrease()
        return good and succeeds(self._solve) and int(self._factors.getFailedReason()) == GOOD

    def reduce(self, b: Array) -> None:
        """Solve for another right-hand side; raise PETSc.Error if KLU finds a singular matrix."""
        self._inner.reduce(b)
        self._solve()

    def _solve(self) -> None:
        self._rhs.stateIncrease()
        self._factors.apply(self._rhs, self._solution)

    def expand(self, small: Array, x: Array) -> None:
        """Compute the solution ``x``; ``small`` is empty, as the reduced system has no unknowns."""
        self._inner.expand(self._solution.array_r, x)
