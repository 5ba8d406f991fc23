"""Index arithmetic on matrices whose arrays DOLFINx fills and PETSc solves with."""

from __future__ import annotations

from petsc4py import PETSc

import numpy as np

from ufl_beam.compat import Array, la
from ufl_beam.grid import Index
from ufl_beam.loops import doubles, integers, lib


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
        self.indices = matrix.indices.astype(np.int32, copy=False)
        self.indptr = matrix.indptr.astype(np.int32)

    @property
    def size(self) -> int:
        """Number of rows."""
        return len(self.indptr) - 1

    def rows(self) -> Index:
        """Row of each entry."""
        return np.repeat(np.arange(self.size), np.diff(self.indptr))

    def positions(self, rows: Index, columns: Index) -> Index:
        """Where :attr:`data` holds the entries (rows[k], columns[k]); they must exist."""
        keys = self.rows() * self.size + self.indices
        wanted = rows.astype(np.int64) * self.size + columns
        found = np.searchsorted(keys, wanted)
        if not np.array_equal(keys[found], wanted):
            raise ValueError("the matrix has no such entry")
        return found.astype(np.int32)

    def petsc(self) -> PETSc.Mat:
        """PETSc matrix on this process with the same arrays: no copy, before or after."""
        indptr = self.indptr.astype(PETSc.IntType, copy=False)
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
        self._arrays = (A.size, integers(A.indptr), integers(A.indices), doubles(A.data))

    def add(self, x: Array, y: Array) -> None:
        """Add the product to ``y``."""
        lib.add_product(*self._arrays, doubles(x), doubles(y))

    def add_combined(self, factor: float, x: Array, less: Array, y: Array) -> None:
        """Add the product with ``factor * x - less`` to ``y``."""
        lib.add_inertia(*self._arrays, factor, doubles(x), doubles(less), doubles(y))

    def __call__(self, x: Array) -> Array:
        """The product; a new array."""
        y = np.zeros_like(x)
        self.add(x, y)
        return y
