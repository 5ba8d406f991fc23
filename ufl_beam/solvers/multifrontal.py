# SPDX-License-Identifier: MIT
"""Multifrontal elimination of the system that remains after the elimination of chains."""

from __future__ import annotations

from typing import Any

import numpy as np
import numpy.typing as npt
from scipy.sparse import csr_array

from ufl_beam.arrays import Array, Index
from ufl_beam.caches import cached_by_structure
from ufl_beam.compiled.c_library import doubles, ffi, fill, integers, lib, struct
from ufl_beam.compiled.csr import Csr

ONE_FRONT = int(lib.ONE_FRONT)
"""Largest number of unknowns of a system that is one dense front."""


class Multifrontal:
    """Multifrontal elimination of the unknowns of a system, except those that stay.

    The ordering of :data:`ORDERINGS` with the fewest operations is used.  Each front exchanges rows
    among its pivots only, see multifrontal.c.  In a system of up to :data:`ONE_FRONT` unknowns, all
    eliminated unknowns are pivots of one front.  The fronts of a larger system have few pivots, so
    its matrix must not have structural zeros on the diagonal.

    Args:
        inner: The system, see substructuring.py.
        stays: True for unknowns that stay; (size,).

    Attributes:
        c: ``fronts`` of loops.h.
    """

    def __init__(self, inner: Any, stays: npt.NDArray[np.bool_]) -> None:
        self._inner, A = inner, inner.left
        self.dofs = inner.dofs[stays]
        *structure, at, space = _structure(A.indptr, A.indices, stays)
        arrays = dict(zip(STRUCTURE, structure, strict=True))
        n, eliminated = len(self.dofs), A.size - len(self.dofs)
        schur, x = np.zeros(n * n), np.zeros(A.size)
        self.left = Csr(schur, np.tile(np.arange(n), n), n * np.arange(n + 1))
        self.f = x[eliminated:]
        front_size, pivots_size, stack_size = space
        self.c = struct(
            "fronts",
            size=A.size, fronts=len(arrays["parent"]), at=ffi.from_buffer("int64_t[]", at),
            values=np.empty(at[-1]), schur=schur, stack=np.empty(stack_size), x=x,
            space=np.empty(front_size), unit=np.empty(pivots_size),
            swap=np.zeros(eliminated, np.int32), **arrays,
        )  # fmt: skip

    def drive(self, c: Any) -> None:
        """Let Newton's method in C use these fronts; ``c`` is its ``equation`` of loops.h."""
        fill(c, fronts=self.c, found=np.zeros(self.c.size))

    def factor(self, b: Array) -> bool:
        """Reduce matrix and right-hand side; return whether all factors are finite."""
        good: bool = self._inner.factor(b)
        good &= bool(lib.factor_fronts(self.c, doubles(self._inner.left.data)))
        lib.reduce_fronts(self.c, doubles(self._inner.f))
        return good

    def reduce(self, b: Array) -> None:
        """Reduce another right-hand side by the same factors."""
        self._inner.reduce(b)
        lib.reduce_fronts(self.c, doubles(self._inner.f))

    def expand(self, small: Array, x: Array) -> None:
        """Compute the solution ``x`` from the solution ``small`` of the reduced system."""
        self.f[:] = small
        solution = np.empty(self.c.size)
        lib.expand_fronts(self.c, doubles(solution))
        self._inner.expand(solution, x)


ORDERINGS = ("amd", "nd")
"""Orderings of PETSc: approximate minimum degree, which ignores the unknowns that stay, and nested
dissection, which suits systems with many such unknowns."""

STRUCTURE = (
    "unknown", "first", "begin", "rest", "parent", "up", "order", "before", "children", "entries",
    "entry", "place",
)  # fmt: skip
"""Arrays of ``fronts`` of loops.h that follow from the structure of a matrix."""


@cached_by_structure
def _structure(
    indptr: Index, indices: Index, stays: npt.NDArray[np.bool_]
) -> tuple[npt.NDArray[np.integer], ...]:
    """Find the fronts of a matrix.

    Returns:
        The arrays of :data:`STRUCTURE`; the position at which the factors of each front begin,
        int64; the sizes of the space for a front, of the space for its pivots, and of the stack.
    """
    A = Csr(np.empty(0), indices, indptr)
    n = np.count_nonzero(stays)
    pattern = csr_array((np.ones(len(indices)), indices, indptr), shape=(A.size, A.size))
    candidates = [_fronts(pattern, stays, kind) for kind in ORDERINGS[: 1 + (A.size > ONE_FRONT)]]
    unknown, first, begin, rest = min(candidates, key=lambda c: _operations(*c[1:3]))
    number = np.empty(A.size, dtype=np.int32)
    number[unknown] = np.arange(A.size)
    pivots, others = (np.diff(x).astype(np.int64) for x in (first, begin))
    fronts = len(pivots)
    front = np.repeat(np.arange(fronts, dtype=np.int32), np.append(pivots[:-1], n))
    rows, columns = number[A.rows()], number[A.indices]
    entry_front = front[np.minimum(rows, columns)]
    entry = np.argsort(entry_front, kind="stable").astype(np.int32)
    entry_begin = np.searchsorted(entry_front[entry], np.arange(fronts + 1)).astype(np.int32)
    place, up = np.empty(len(entry), np.int32), np.empty(len(rest), np.int32)
    parent, order, before, children = np.zeros((4, fronts), dtype=np.int32)
    c = struct("fronts", fronts=fronts, first=first, begin=begin, rest=rest, parent=parent, up=up)
    arrays = rows[entry], columns[entry], front, place, parent, up
    lib.place_in_fronts(c, len(entry), *map(integers, arrays))
    stack = lib.order_fronts(c, *map(integers, (order, before, children)))
    at = np.append(0, np.cumsum(pivots * (pivots + 2 * others)))
    # Products read a few numbers beyond the end of a front.
    largest = [x[:-1].max(initial=0) for x in (pivots + others, pivots)]
    space = np.array([largest[0] ** 2 + 2 * lib.WIDE, largest[1], stack])
    return (
        unknown, first, begin, rest, parent, up, order, before, children, entry_begin, entry, place,
        at, space,
    )  # fmt: skip


def _operations(first: Index, begin: Index) -> float:
    """Return the number of multiplications in all fronts; for the arguments see loops.h."""
    pivots, others = (np.diff(x).astype(np.float64) for x in (first, begin))
    return float(np.sum(pivots * (pivots**2 / 3 + pivots * others + others**2)))


def _fronts(A: csr_array, stays: npt.NDArray[np.bool_], kind: str) -> tuple[Index, ...]:
    """Find the fronts if the unknowns are eliminated in an order of PETSc.

    Returns:
        All unknowns in this order, with the unknowns that stay at the end; ``first``, ``begin`` and
        ``rest`` of the fronts, see loops.h.
    """
    size = A.shape[0]
    these: Index = np.arange(size) if kind == "nd" else np.flatnonzero(~stays)
    if len(these):
        block = A[these][:, these]
        _, positions = Csr(block.data, block.indices, block.indptr).petsc().getOrdering(kind)
        these = these[positions.indices]
    these = these[~stays[these]]
    eliminated = len(these)
    order = np.concatenate([these, np.flatnonzero(stays)]).astype(np.int32)
    pattern = csr_array(A[order][:, order])
    first, begin = np.empty((2, eliminated + 2), dtype=np.int32)
    capacity, space = 2 * A.nnz + 2 * size, np.empty(3 * size, dtype=np.int32)
    structure = [integers(x.astype(np.int32)) for x in (pattern.indptr, pattern.indices)]
    while True:
        rest = np.empty(capacity, dtype=np.int32)
        arrays = map(integers, (first, begin, rest, space[:size], space[size:]))
        fronts = lib.find_fronts(size, eliminated, *structure, capacity, *arrays)
        if fronts >= 0:
            break
        capacity *= 2
    first, begin = (x[: fronts + 1].copy() for x in (first, begin))
    return order, first, begin, rest[: begin[-1]].copy()
