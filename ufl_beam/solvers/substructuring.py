# SPDX-License-Identifier: MIT
"""Substructuring: Schur complements of the unknowns at the border of the parts of processes.

Each process factors what the elimination along chains leaves in its own part.  Only the Schur
complement of the unknowns that several processes have is summed over them, and factored by each.
"""

from __future__ import annotations

from typing import Protocol

from mpi4py import MPI

import numpy as np
import numpy.typing as npt
from scipy.sparse import csr_array

from ufl_beam.arrays import Array, Index
from ufl_beam.compiled.c_library import doubles, ffi, fill, integers, lib
from ufl_beam.compiled.csr import Csr


class Condensed(Protocol):
    """A linear system of which some unknowns are eliminated.

    The call is :meth:`factor`, and for each right-hand side :meth:`reduce`, the solution of the
    system that is left by the caller, and :meth:`expand`.

    Attributes:
        numbers: Unknowns that are left, in numbers of the grid, ascending.
        left: Matrix of what is left, of :meth:`factor`.
        f: Right-hand side of what is left, of :meth:`reduce`.
    """

    numbers: Index
    left: Csr
    f: Array

    def factor(self) -> bool:
        """Eliminate; whether all of it is finite."""

    def reduce(self, b: Array) -> None:
        """Fill :attr:`f`; ``b`` at the degrees of freedom owned here."""

    def expand(self, small: Array, x: Array) -> None:
        """The solution at the degrees of freedom owned here, after that of what is left."""


class Substructure:
    """Multifrontal elimination of all but the unknowns that other processes have too.

    The order is that of approximate minimum degree.  Each front exchanges rows among its pivots
    only, so the matrix must not have structural zeros on the diagonal; see fronts.c.

    Args:
        inner: What is left of the part of this process.
        stays: Which of its unknowns stay.
    """

    def __init__(self, inner: Condensed, stays: npt.NDArray[np.bool_]) -> None:
        self._inner, A = inner, inner.left
        self._order = np.concatenate([_minimum_degree(A, ~stays), np.flatnonzero(stays)])
        self.numbers = inner.numbers[stays]
        size, self._eliminated = A.size, A.size - len(self.numbers)
        number = np.empty(size, dtype=np.int32)
        number[self._order] = np.arange(size)
        first, begin, rest = _fronts(A, self._order, self._eliminated)
        pivots, others = (np.diff(x).astype(np.int64) for x in (first, begin))
        n, fronts = len(self.numbers), len(pivots)
        front_of = np.repeat(np.arange(fronts, dtype=np.int32), np.append(pivots[:-1], n))
        rows, columns = number[A.rows()], number[A.indices]
        of_entry = front_of[np.minimum(rows, columns)]
        entry = np.argsort(of_entry, kind="stable").astype(np.int32)
        place, up = np.empty(len(entry), np.int32), np.empty(len(rest), np.int32)
        parent, order, before, children = np.zeros((4, fronts), dtype=np.int32)
        schur = np.zeros(n * n)
        self._c = fill(
            ffi.new("fronts *"),
            fronts=fronts, first=first, begin=begin, rest=rest, parent=parent, up=up,
            order=order, before=before, children=children, entry=entry, place=place,
            entries=np.searchsorted(of_entry[entry], np.arange(fronts + 1)).astype(np.int32),
            at=_wide(np.append(0, np.cumsum(pivots * (pivots + 2 * others)))),
            values=np.empty(int(np.sum(pivots * (pivots + 2 * others)))), schur=schur,
            space=np.empty(int((pivots + others)[:-1].max(initial=0)) ** 2),
            swap=np.zeros(self._eliminated, np.int32),
        )  # fmt: skip
        of_fronts = map(integers, (rows[entry], columns[entry], front_of, place, parent, up))
        lib.place_in_fronts(self._c, len(entry), *of_fronts)
        stack = lib.order_fronts(self._c, *map(integers, (order, before, children)))
        fill(self._c, stack=np.empty(stack))
        self.left = Csr(schur, np.tile(np.arange(n), n), n * np.arange(n + 1))
        self._x = np.zeros(size)
        self.f = self._x[self._eliminated :]

    def factor(self) -> bool:
        """Eliminate; whether all of it is finite."""
        good = self._inner.factor()
        return bool(lib.factor_fronts(self._c, doubles(self._inner.left.data))) and good

    def reduce(self, b: Array) -> None:
        """Fill :attr:`f`; ``b`` at the degrees of freedom owned here."""
        self._inner.reduce(b)
        self._x[:] = self._inner.f[self._order]
        lib.reduce_fronts(self._c, doubles(self._x))

    def expand(self, small: Array, x: Array) -> None:
        """The solution at the degrees of freedom owned here, after that of what is left."""
        self.f[:] = small
        lib.expand_fronts(self._c, doubles(self._x))
        of_inner = np.empty(len(self._x))
        of_inner[self._order] = self._x
        self._inner.expand(of_inner, x)


def _wide(array: Index) -> object:
    """Pointer to a contiguous array of int64; it keeps the array alive."""
    return ffi.from_buffer("int64_t[]", array)


def _pattern(A: Csr) -> csr_array:
    ones = np.ones(len(A.indices), np.bool_)
    return csr_array((ones, A.indices, A.indptr), shape=(A.size, A.size))


def _minimum_degree(A: Csr, of: npt.NDArray[np.bool_]) -> Index:
    """Return some unknowns in the order of approximate minimum degree."""
    these = np.flatnonzero(of)
    if not len(these):
        return these
    part = _pattern(A)[these][:, these].astype(np.float64)
    _, order = Csr(part.data, part.indices, part.indptr).petsc().getOrdering("amd")
    return np.asarray(these[order.indices])


def _fronts(A: Csr, order: Index, eliminated: int) -> tuple[Index, Index, Index]:
    """Return ``first``, ``begin`` and ``rest`` of the fronts, see loops.h."""
    pattern = csr_array(_pattern(A)[order][:, order])
    first, begin = np.empty((2, eliminated + 2), dtype=np.int32)
    room, space = 2 * len(A.indices) + 2 * A.size, np.empty(3 * A.size, dtype=np.int32)
    while True:
        rest = np.empty(room, dtype=np.int32)
        arrays = (first, begin, rest, space[: A.size], space[A.size :])
        structure = (pattern.indptr.astype(np.int32), pattern.indices.astype(np.int32))
        fronts = lib.find_fronts(
            A.size, eliminated, *map(integers, structure), room, *map(integers, arrays)
        )
        if fronts >= 0:
            break
        room *= 2
    first, begin = (x[: fronts + 1].copy() for x in (first, begin))
    return first, begin, rest[: begin[-1]].copy()


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
        # One more number says how many processes have failed.
        self._sums = np.zeros(len(keys) + 1)
        indptr = np.searchsorted(keys, np.arange(size + 1) * size)
        self.left = Csr(self._sums[:-1], keys % size if size else keys, indptr)
        self.f: Array = np.zeros(size)

    def factor(self) -> bool:
        """Eliminate on all processes; whether all of it is finite on each of them."""
        good = self._inner.factor()
        self._sums[:] = 0.0
        self._sums[self._place] = self._inner.left.data
        self._sums[-1] = not good
        self._comm.Allreduce(MPI.IN_PLACE, self._sums)
        return self._sums[-1] == 0.0 and bool(lib.all_finite(len(self._sums), doubles(self._sums)))

    def reduce(self, b: Array) -> None:
        """Fill :attr:`f`; ``b`` at the degrees of freedom owned here."""
        self._inner.reduce(b)
        self.f[:] = 0.0
        self.f[self._number] = self._inner.f
        self._comm.Allreduce(MPI.IN_PLACE, self.f)

    def expand(self, small: Array, x: Array) -> None:
        """The solution at the degrees of freedom owned here, after that of what is left."""
        self._inner.expand(small[self._number], x)
