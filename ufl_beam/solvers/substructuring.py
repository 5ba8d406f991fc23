# SPDX-License-Identifier: MIT
"""Sum of the reduced systems of the processes that share a scene.

Each process eliminates chains.  Their Schur complements are summed over the processes, and each
process factors the sum.

A reduced system (``Summed``) is built on another system with more unknowns; the first,
``Elimination``, is built on the full matrix.  A reduced system has

* ``dofs``: degrees of freedom that remain, in numbers of the scene;
* ``factor(b)``: reduces the matrix and a right-hand side at the degrees of freedom that this
  process owns; returns whether all results are finite;
* ``reduce(b)``: reduces another right-hand side by the same factors;
* ``left``, ``f``: matrix and right-hand side of the reduced system, which lu_factors.py solves;
* ``expand(small, x)``: computes the solution at the degrees of freedom that this process owns from
  the solution of the reduced system.
"""

from __future__ import annotations

from typing import Any

from mpi4py import MPI

import numpy as np

from ufl_beam.arrays import Array
from ufl_beam.compiled.c_library import doubles, lib
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
