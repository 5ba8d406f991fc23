"""Index arithmetic on matrices whose arrays DOLFINx fills and PETSc solves with."""

from __future__ import annotations

import numpy as np
from petsc4py import PETSc

from ufl_beam.compat import Array, la
from ufl_beam.grid import Index


class Csr:
    """The arrays of a DOLFINx matrix, looked up once.

    Attributes:
        matrix: The matrix, for assembly.
        data: Its entries, row after row.
        indices: Column of each entry.
        indptr: First entry of each row, and the number of entries.
    """

    def __init__(self, matrix: la.MatrixCSR) -> None:
        self.matrix = matrix
        self.data: Array = matrix.data
        self.indices: Index = matrix.indices
        self.indptr: Index = matrix.indptr

    @property
    def size(self) -> int:
        """Number of rows."""
        return len(self.indptr) - 1

    def rows(self) -> Index:
        """Row of each entry."""
        return np.repeat(np.arange(self.size), np.diff(self.indptr))

    def positions(self, rows: Index, columns: Index) -> Index:
        """Where :attr:`data` holds the entries (rows[k], columns[k]); they must exist."""
        found = []
        for row, column in zip(rows, columns, strict=True):
            begin, end = self.indptr[row], self.indptr[row + 1]
            (at,) = np.flatnonzero(self.indices[begin:end] == column)
            found.append(begin + at)
        return np.array(found, dtype=np.int64)

    def petsc(self) -> PETSc.Mat:
        """PETSc matrix on this process with the same arrays: no copy, before or after."""
        indptr = self.indptr.astype(PETSc.IntType)
        indices = self.indices.astype(PETSc.IntType, copy=False)
        matrix = PETSc.Mat().createAIJWithArrays(
            self.size, (indptr, indices, self.data), comm=PETSc.COMM_SELF
        )
        matrix.assemble()
        return matrix


def as_slice(index: Index) -> Index | slice:
    """The slice that selects the same as ``index``, if there is one: slices copy nothing."""
    if len(index) < 2:
        return index
    steps = np.unique(np.diff(index))
    if len(steps) > 1 or steps[0] <= 0:
        return index
    return slice(int(index[0]), int(index[-1]) + 1, int(steps[0]))


class Product:
    """``x -> A x`` on this process, without allocating."""

    def __init__(self, A: Csr) -> None:
        self._matrix = A.petsc()
        self._x, self._y = np.zeros(A.size), np.zeros(A.size)
        self._vectors = [
            PETSc.Vec().createWithArray(a, comm=PETSc.COMM_SELF) for a in (self._x, self._y)
        ]
        self._mult = self._matrix.mult

    def __call__(self, x: Array) -> Array:
        """The product; overwritten by the next call."""
        self._x[:] = x
        self._mult(*self._vectors)
        return self._y
