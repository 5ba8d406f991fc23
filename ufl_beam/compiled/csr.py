# SPDX-License-Identifier: MIT
"""Sparse matrices by rows, filled by loops in C and solved with by PETSc."""

from __future__ import annotations

from copy import copy

from petsc4py import PETSc

import numpy as np
from scipy.sparse import csr_array

from ufl_beam.arrays import Array, Index
from ufl_beam.compiled.c_library import Loop, doubles, ffi, fill, integers, lib, loop
from ufl_beam.structure_cache import of_structure


class Csr:
    """Compressed sparse rows with indices of 32 bits, as C needs them; SciPy chooses others."""

    def __init__(self, data: Array, indices: Index, indptr: Index) -> None:
        self.data = data
        self.indices = indices.astype(np.int32, copy=False)
        self.indptr = indptr.astype(np.int32, copy=False)

    def zeros_like(self) -> Csr:
        """Return a matrix of the same sparsity pattern, which is stored once."""
        other = copy(self)
        other.data = np.zeros_like(self.data)
        return other

    @property
    def size(self) -> int:
        """Number of rows of the matrix."""
        return len(self.indptr) - 1

    def rows(self) -> Index:
        """Return the row of each entry."""
        return np.repeat(np.arange(self.size, dtype=np.int32), np.diff(self.indptr))

    def positions(self, rows: Index, columns: Index) -> Index:
        """Find the entries (rows[k], columns[k]) in :attr:`data`; they must exist."""
        found = np.empty(len(rows), dtype=np.int32)
        structure = (self.size, integers(self.indptr), integers(self.indices))
        pairs = [np.ascontiguousarray(x, dtype=np.int32) for x in (rows, columns)]
        if not lib.find_entries(*structure, len(found), *map(integers, (*pairs, found))):
            raise ValueError("the matrix has no such entry")
        return found

    def petsc(self) -> PETSc.Mat:
        """Return a PETSc matrix on this process that shares the arrays."""
        indptr, indices = (x.astype(PETSc.IntType, copy=False) for x in (self.indptr, self.indices))
        arrays = (indptr, indices, self.data)
        matrix = PETSc.Mat().createAIJWithArrays(self.size, arrays, comm=PETSc.COMM_SELF)
        matrix.assemble()
        return matrix


def coupling(size: int, *coupled: Index) -> Csr:
    """Return a matrix of zeros whose pattern has the diagonal and all pairs of coupled dofs."""
    indices, indptr = _pattern(size, *coupled)
    return Csr(np.zeros(len(indices)), indices, indptr)


@of_structure
def _pattern(size: int, *coupled: Index) -> tuple[Index, Index]:
    """Column indices and first entries of the rows of :func:`coupling`."""
    groups = [np.arange(size, dtype=np.int32)[:, None], *coupled]
    lengths = np.concatenate([np.full(len(rows), rows.shape[1]) for rows in groups])
    columns = np.concatenate([rows.ravel() for rows in groups]).astype(np.int32)
    ends = np.append(0, np.cumsum(lengths))
    parts = csr_array((np.ones(len(columns), np.bool_), columns, ends), shape=(len(lengths), size))
    matrix = parts.T.tocsr() @ parts
    matrix.sort_indices()
    return matrix.indices.astype(np.int32), matrix.indptr.astype(np.int32)


def as_slice(index: Index) -> Index | slice:
    """Return the slice that selects the same as ``index``, if there is one: slices copy nothing."""
    if len(index) < 2:
        return index
    steps = np.unique(np.diff(index))
    if len(steps) > 1 or steps[0] <= 0:
        return index
    return slice(int(index[0]), int(index[-1]) + 1, int(steps[0]))


class Product:
    """Operator ``x -> A x`` on this process, without the zeros that ``A`` stores."""

    def __init__(self, A: Csr) -> None:
        self.entries = np.flatnonzero(A.data).astype(np.int32)
        indptr = np.searchsorted(self.entries, A.indptr).astype(np.int32)
        self.data, columns = A.data[self.entries], A.indices[self.entries]
        self.arrays = (A.size, integers(indptr), integers(columns), doubles(self.data))

    def __call__(self, x: Array) -> Array:
        """Return the product, a new array."""
        y = np.zeros(len(x))
        lib.add_product(*self.arrays, doubles(x), doubles(y))
        return y

    def square(self, x: Array) -> float:
        """Return ``x A x``."""
        square: float = lib.quadratic_form(*self.arrays, doubles(x))
        return square


class StepProduct:
    """Forces ``A (factor s - back v)``, s being (Δu, 2 tan(Δψ/2)), and their derivative.

    ``A`` is constant; the derivative is added to ``tangent``, of the same structure.
    """

    def __init__(self, A: Csr, rotations: Index, tangent: Csr) -> None:
        self.A, self._tangent = Product(A), tangent
        size, indptr, indices, data = self.A.arrays
        self.c = fill(
            ffi.new("step_product *"),
            size=size, indptr=indptr, indices=indices, data=data, entry=self.A.entries,
            rotations=len(rotations), rotation=rotations, space=np.empty(size),
            turn=np.full(len(rotations), np.nan), half=np.empty(len(rotations)),
        )  # fmt: skip

    def matrix(self) -> Csr:
        """Return the matrix, a new one."""
        A = self._tangent.zeros_like()
        A.data[self.A.entries] = self.A.data
        return A

    def begin(self, q0: Array, factor: float, back: float, v: Array) -> None:
        """Prepare what stays constant in the step that begins at ``q0``."""
        c = self.c
        c.factor, c.back = factor, back
        self._states = c.v, c.q0 = doubles(v), doubles(q0)

    def loops(self) -> tuple[Loop, Loop]:
        """Return the loops of :meth:`add_force` and :meth:`add_tangent`."""
        return loop("add_step_force", self.c), loop("add_step_tangent", self.c)

    def add_force(self, q1: Array, r: Array) -> None:
        """Add the forces at ``q1``."""
        lib.add_step_force(self.c, doubles(q1), doubles(r))

    def add_tangent(self, q1: Array) -> None:
        """Add their derivative at ``q1``."""
        lib.add_step_tangent(self.c, doubles(q1), doubles(self._tangent.data))
