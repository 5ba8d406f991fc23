# SPDX-License-Identifier: MIT
"""Substructuring: Schur complements of the unknowns at the border of the parts of processes.

Each process factors what the elimination along chains leaves in its own part.  Only the Schur
complement of the unknowns that several processes have is summed over them, and factored by each.
"""

from __future__ import annotations

from typing import Protocol

from mpi4py import MPI

import numpy as np

from ufl_beam.arrays import Array, Index
from ufl_beam.compiled.c_library import doubles, lib
from ufl_beam.compiled.csr import Csr


class Condensed(Protocol):
    """A linear system of which some unknowns are eliminated.

    The call is :meth:`factor`, for other right-hand sides :meth:`reduce`, then the solution of the
    system that is left by the caller, and :meth:`expand`.

    Attributes:
        numbers: Unknowns that are left, in numbers of the grid, ascending.
        left: Matrix of what is left, of :meth:`factor`.
        f: Right-hand side of what is left.
    """

    numbers: Index
    left: Csr
    f: Array

    def factor(self, b: Array) -> bool:
        """Eliminate from the matrix and a right-hand side; whether all of the matrix is finite.

        ``b`` is at the degrees of freedom owned here.
        """

    def reduce(self, b: Array) -> None:
        """Eliminate from another right-hand side."""

    def expand(self, small: Array, x: Array) -> None:
        """The solution at the degrees of freedom owned here, after that of what is left."""


class Summed:
    """Condensed systems of several processes, summed over them; all of them have the sum."""

    def __init__(self, inner: Condensed, comm: MPI.Intracomm) -> None:
        self._inner, self._comm = inner, comm
        self.numbers = np.unique(np.concatenate(comm.allgather(inner.numbers)))
        size = len(self.numbers)
        self._number = np.searchsorted(self.numbers, inner.numbers)
        A = inner.left
        mine = self._number[A.rows()].astype(np.int64) * size + self._number[A.indices]
        keys = np.unique(np.concatenate(comm.allgather(mine)))
        self._place = np.searchsorted(keys, mine)
        # Entries, right-hand side, and how many processes have failed.
        self._sums = np.zeros(len(keys) + size + 1)
        entries, self.f, self._failed = np.split(self._sums, [len(keys), len(keys) + size])
        indptr = np.searchsorted(keys, np.arange(size + 1) * size)
        self.left = Csr(entries, keys % size if size else keys, indptr)

    def factor(self, b: Array) -> bool:
        """Eliminate on all processes; whether all of it is finite on each of them."""
        good = self._inner.factor(b)
        self._sums[:] = 0.0
        self.left.data[self._place] = self._inner.left.data
        self.f[self._number] = self._inner.f
        self._failed[:] = not good
        self._comm.Allreduce(MPI.IN_PLACE, self._sums)
        return self._failed == 0.0 and bool(lib.all_finite(len(self._sums), doubles(self._sums)))

    def reduce(self, b: Array) -> None:
        """Eliminate from another right-hand side; ``b`` at the degrees of freedom owned here."""
        self._inner.reduce(b)
        self.f[:] = 0.0
        self.f[self._number] = self._inner.f
        self._comm.Allreduce(MPI.IN_PLACE, self.f)

    def expand(self, small: Array, x: Array) -> None:
        """The solution at the degrees of freedom owned here, after that of what is left."""
        self._inner.expand(small[self._number], x)
