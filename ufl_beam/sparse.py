"""Index arithmetic on matrices whose arrays DOLFINx fills and PETSc solves with."""

from __future__ import annotations

import numpy as np
from petsc4py import PETSc

from ufl_beam.compat import Array, la
from ufl_beam.grid import Index


def rows_of_entries(A: la.MatrixCSR) -> Index:
    """Row of each entry of ``A.data``."""
    return np.repeat(np.arange(len(A.indptr) - 1), np.diff(A.indptr))


def positions(A: la.MatrixCSR, rows: Index, columns: Index) -> Index:
    """Where ``A.data`` holds the entries (rows[k], columns[k]); they must exist."""
    found = []
    for row, column in zip(rows, columns, strict=True):
        begin, end = A.indptr[row], A.indptr[row + 1]
        (at,) = np.flatnonzero(A.indices[begin:end] == column)
        found.append(begin + at)
    return np.array(found, dtype=np.int64)


def as_slice(index: Index) -> Index | slice:
    """The slice that selects the same as ``index``, if there is one: slices copy nothing."""
    if len(index) < 2:
        return index
    steps = np.unique(np.diff(index))
    if len(steps) > 1 or steps[0] <= 0:
        return index
    return slice(int(index[0]), int(index[-1]) + 1, int(steps[0]))


def petsc_matrix(A: la.MatrixCSR) -> PETSc.Mat:
    """PETSc matrix on this process with the arrays of ``A``: no copy, before or after."""
    size = len(A.indptr) - 1
    indptr = A.indptr.astype(PETSc.IntType)
    indices = A.indices.astype(PETSc.IntType, copy=False)
    matrix = PETSc.Mat().createAIJWithArrays(size, (indptr, indices, A.data), comm=PETSc.COMM_SELF)
    matrix.assemble()
    return matrix


class Product:
    """``x -> A x`` on this process, without allocating."""

    def __init__(self, A: la.MatrixCSR) -> None:
        size = len(A.indptr) - 1
        self._matrix = petsc_matrix(A)
        self._x, self._y = np.zeros(size), np.zeros(size)
        self._vectors = [
            PETSc.Vec().createWithArray(a, comm=PETSc.COMM_SELF) for a in (self._x, self._y)
        ]

    def __call__(self, x: Array) -> Array:
        """The product; overwritten by the next call."""
        self._x[:] = x
        for vector in self._vectors:
            vector.stateIncrease()
        self._matrix.mult(*self._vectors)
        return self._y
