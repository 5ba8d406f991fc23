# SPDX-License-Identifier: MIT
"""Sparse matrices in compressed rows, which loops in C fill and PETSc factors."""

from __future__ import annotations

from collections.abc import Callable
from copy import copy
from functools import cached_property

from petsc4py import PETSc

import numpy as np
from scipy.sparse import csr_array

from ufl_beam.arrays import Array, Index
from ufl_beam.caches import cached_by_structure
from ufl_beam.compiled.c_library import doubles, ffi, integers, lib, struct


class Csr:
    """Sparse matrix in compressed rows, with indices of 32 bits for C; SciPy may use 64 bits.

    ``again`` recomputes the column indices after :meth:`free` has freed them.
    """

    def __init__(
        self, data: Array, indices: Index, indptr: Index,
        again: Callable[[], Index] | None = None,
    ) -> None:  # fmt: skip
        self.data, self._again = data, again
        self.indices = indices.astype(np.int32, copy=False)
        self.indptr = indptr.astype(np.int32, copy=False)

    @cached_property
    def indices(self) -> Index:
        """Column of each entry."""
        assert self._again is not None
        return self._again()

    def free(self) -> None:
        """Free the memory of :attr:`indices` until they are needed, unless PETSc shares them."""
        if self._again is not None:
            vars(self).pop("indices", None)

    def zeros_like(self) -> Csr:
        """Return a zero matrix that shares the sparsity pattern."""
        matrix = copy(self)
        matrix.data = np.zeros(len(self.data))  # np.zeros_like would write to the memory at once
        return matrix

    @property
    def size(self) -> int:
        """Number of rows of the matrix."""
        return len(self.indptr) - 1

    def sparse(self) -> csr_array:
        """Return the matrix as an array of SciPy, which shares the data."""
        return csr_array((self.data, self.indices, self.indptr), shape=(self.size, self.size))

    def narrow(self) -> bool:
        """Return whether each row has at most 256 entries, so that a byte can number them."""
        return bool(np.diff(self.indptr).max(initial=0) <= 256)

    def rows(self) -> Index:
        """Return the row of each entry."""
        return np.repeat(np.arange(self.size, dtype=np.int32), np.diff(self.indptr))

    def entries_of(self, rows: Index) -> Index:
        """Return the indices in :attr:`data` of the entries of ``rows``, row by row."""
        first, number = self.indptr[rows].astype(np.int64), np.diff(self.indptr)[rows]
        before = np.cumsum(number) - number
        return np.asarray(np.repeat(first - before, number) + np.arange(number.sum()))

    def positions(self, rows: Index, columns: Index) -> Index:
        """Return the indices in :attr:`data` of entries (rows[k], columns[k]), which must exist."""
        positions = np.empty(len(rows), dtype=np.int32)
        structure = (self.size, integers(self.indptr), integers(self.indices))
        pairs = [np.ascontiguousarray(x, dtype=np.int32) for x in (rows, columns)]
        if not lib.find_entries(*structure, len(positions), *map(integers, (*pairs, positions))):
            raise ValueError("the matrix has no such entry")
        return positions

    def blocks(self, dofs: Index, batch_size: int) -> Index:
        """Find the entries of all pairs of ``dofs`` (int32) of each cell; the entries must exist.

        The result has the shape (num_batches, pairs, batch_size), see :func:`in_batches`.  If the
        matrix is :meth:`narrow`, the results are positions in the row (uint8), else in
        :attr:`data` (int32).
        """
        cells, cell_size = dofs.shape
        narrow = self.narrow()
        shape = (-(-cells // batch_size), cell_size**2, batch_size)
        positions = np.empty(shape, dtype=np.uint8 if narrow else np.int32)
        place = ffi.NULL if narrow else integers(positions)
        column = ffi.from_buffer("uint8_t[]", positions) if narrow else ffi.NULL
        structure = self.size, integers(self.indptr), integers(self.indices)
        sizes = cells, cell_size, batch_size
        if not lib.find_blocks(*structure, *sizes, integers(dofs), place, column):
            raise ValueError("the matrix has no such entry")
        return positions

    def petsc(self) -> PETSc.Mat:
        """Return a PETSc matrix on this process, which shares the arrays and keeps them alive."""
        indptr, indices = (x.astype(PETSc.IntType, copy=False) for x in (self.indptr, self.indices))
        self._again = None
        arrays = (indptr, indices, self.data)
        matrix = PETSc.Mat().createAIJWithArrays(self.size, arrays, comm=PETSc.COMM_SELF)
        matrix.assemble()
        return matrix


def zero_matrix(size: int, *coupled: Index) -> Csr:
    """Return a zero matrix whose pattern has the diagonal and all pairs in rows of ``coupled``."""
    indices, indptr = _pattern(size, *coupled)
    return Csr(np.zeros(len(indices)), indices, indptr, lambda: _pattern(size, *coupled)[0])


@cached_by_structure
def _pattern(size: int, *coupled: Index) -> tuple[Index, Index]:
    """Return ``indices`` and ``indptr`` of :func:`zero_matrix`."""
    none = np.empty(0, dtype=np.int32)
    lengths = np.concatenate([none, *(np.full(len(x), x.shape[1], np.int32) for x in coupled)])
    dofs = np.concatenate([none, *(rows.ravel() for rows in coupled)]).astype(np.int32, copy=False)
    first = np.append(0, np.cumsum(lengths)).astype(np.int32)
    begin, seen, indptr = np.empty((3, size + 1), dtype=np.int32)
    space = map(integers, (first, dofs, begin, np.empty_like(dofs), seen, indptr))
    arguments = size, len(lengths), *space
    number = lib.find_pattern(*arguments, ffi.NULL)
    if number < 0:
        raise ValueError("the matrix has more entries than indices of 32 bits can number")
    indices = np.empty(number, dtype=np.int32)
    lib.find_pattern(*arguments, integers(indices))
    return indices, indptr.copy()


@cached_by_structure
def _runs(nonzero: Index, indptr: Index, indices: Index, period: int) -> tuple[Index, ...]:
    """Find runs of rows, see :class:`Product`, of a matrix with the entries ``nonzero``.

    Returns:
        The first row of each run, and last the number of rows; the first row of each strip; the
        number of rows, and of entries in each row, of each strip; the distances of the strips from
        the diagonal.
    """
    size, begin = len(indptr) - 1, np.searchsorted(nonzero, indptr).astype(np.int32)
    width = np.diff(begin)
    away = indices[nonzero] - np.repeat(np.arange(size, dtype=np.int32), width)
    alike = np.zeros(size, dtype=bool)
    for number in np.unique(width):
        rows = np.flatnonzero(width == number).astype(np.int32)
        distances = away[begin[rows, None] + np.arange(number, dtype=np.int32)]
        before = np.searchsorted(rows, rows - period)
        same = (rows[before] == rows - period) & (distances[before] == distances).all(axis=1)
        alike[rows[same]] = True
    starts = np.flatnonzero(~alike)
    if period > 1:
        later = [-period]
        for row in map(int, starts):
            if row >= later[-1] + period:
                later.append(row)
        starts = np.array(later[1:], dtype=np.int64)
    first = np.append(starts, size).astype(np.int32)
    head = (first[:-1, None] + np.arange(period, dtype=np.int32)).ravel()
    rows = np.maximum(0, (np.repeat(first[1:], period) - head + period - 1) // period)
    heads = np.zeros(size, dtype=bool)
    heads[head[rows > 0]] = True
    widths = np.where(rows > 0, width[np.minimum(head, size - 1)], 0)
    return first, head, rows, widths, away[np.repeat(heads, width)]


@cached_by_structure
def _places(
    head: Index, rows: Index, widths: Index, away: Index, period: int, indptr: Index, indices: Index
) -> tuple[Index, ...]:
    """Find the entries of :func:`_runs` in a matrix; see :meth:`Product.places`."""
    each = np.repeat(rows, widths)
    before = np.cumsum(each) - each
    row = period * (np.arange(each.sum(), dtype=np.int32) - np.repeat(before, each))
    row += np.repeat(np.repeat(head, widths), each)
    places = Csr(np.empty(0), indices, indptr).positions(row, row + np.repeat(away, each))
    return places, places - indptr[row]


class Product:
    """Operator ``x -> A x`` on this process, which leaves out the stored zeros of ``A``.

    Rows whose entries have the same distances from the diagonal form a strip, which stores the
    distances once.  Most rows along beams are in long strips: each row is like the one before, or
    in space like the row of the same component at the vertex before.  A run is a range of rows
    with one strip, or in space six.
    """

    def __init__(self, A: Csr) -> None:
        nonzero = np.flatnonzero(A.data).astype(np.int32)
        structure = nonzero, A.indptr, A.indices
        period, runs = 1, _runs(*structure, 1)
        if len(runs[1]) > max(16, A.size // 8):
            tried = [(1, runs), (6, _runs(*structure, 6))]
            period, runs = min(tried, key=lambda x: len(x[1][1]))
        first, *self._strips = runs
        _, rows, widths, away = self._strips
        self._period = period
        self.data = A.data[self.places(A)[0]]
        self.c = struct(
            "constant_matrix", runs=len(first) - 1, period=period, first=first, away=away,
            begin=np.append(0, np.cumsum(widths)).astype(np.int32), data=self.data,
            at=np.append(0, np.cumsum(rows * widths)).astype(np.int32),
        )  # fmt: skip

    def places(self, A: Csr) -> tuple[Index, ...]:
        """Return the index in ``A.data``, and the index in the row of ``A``, of each entry.

        The entries have the order of :attr:`data`.  ``A`` must have these entries.
        """
        return _places(*self._strips, self._period, A.indptr, A.indices)

    def __call__(self, x: Array) -> Array:
        """Return the product in a new array."""
        y = np.zeros(len(x))
        lib.add_product(self.c, doubles(x), doubles(y))
        return y
