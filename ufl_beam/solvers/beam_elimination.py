# SPDX-License-Identifier: MIT
"""Static condensation of chains of cells to their ends, without communication between processes.

A beam of many cells is a chain of vertices that couple to their two neighbours only.  Each process
eliminates such vertices by blocks.  A small matrix remains for joints, ends, vertices at the border
between processes, and other unknowns that couple to more than two neighbours.
"""

from __future__ import annotations

from typing import Any

from petsc4py import PETSc

import numpy as np
import numpy.typing as npt

from ufl_beam.arrays import Array, Index
from ufl_beam.caches import cached_by_structure
from ufl_beam.compiled.c_library import doubles, ffi, fill, lib
from ufl_beam.compiled.csr import Csr
from ufl_beam.discretization.partition import Subdomain
from ufl_beam.solvers.multifrontal import ONE_FRONT, Multifrontal
from ufl_beam.solvers.substructuring import BAD_PIVOT, GOOD, Klu, Summed, succeeds


def _interior_vertices(
    cell_dofs: Index, A: Csr, alone: npt.NDArray[np.bool_], unknowns: int
) -> tuple[Any, ...]:
    """Find the vertices of the cells of one process that couple only to their two neighbours.

    The pattern of the matrix determines them, so any kind of coupling is taken into account.
    ``alone`` marks local degrees of freedom that no other process has.

    Returns:
        Degrees of freedom of the vertices, chain after chain; (num_vertices, n).  A vertex has n
        unknowns: three in the plane, six in space.
        Index of the first vertex of each chain, and last the number of vertices.
        Degrees of freedom of the left and the right end of each chain; (num_chains, 2 n).
        True for a chain with a left end, to which elimination couples all its vertices.  Other
        chains begin at a vertex with one neighbour; both their ends are the right end.
        Positions in the rows of each vertex at which the columns of the previous vertex, the vertex
        itself and the next vertex begin; (num_vertices, 3).
    """
    n = unknowns
    nodes = cell_dofs.shape[1] // n
    start, end = cell_dofs[:, 0::nodes], cell_dofs[:, 1::nodes]
    # Vertex k is between the cells k and k + 1.
    around = np.hstack([start[:-1], end[:-1], end[1:]])
    inside = (end[:-1] == start[1:]).all(axis=1) & (np.diff(np.sort(around)) > 0).all(axis=1)
    row_counts, column_counts = np.diff(A.indptr), np.bincount(A.indices, minlength=A.size)
    counts = np.where(alone & (row_counts == column_counts), row_counts, 0)

    def has(number: int, dofs: Index) -> npt.NDArray[np.bool_]:
        """Find vertices with successive dofs and ``number`` entries per row and column."""
        successive = (np.diff(dofs, axis=1) == 1).all(axis=1)
        return np.asarray((counts[dofs] == number).all(axis=1) & successive)

    inside &= has(3 * n, end[:-1])  # columns of the vertex and of its neighbours
    is_first = np.zeros(len(inside), dtype=bool)
    is_first[np.unique(end[:-1, 0], return_index=True)[1]] = True
    inside &= is_first
    # If beams lie side by side, the end of a chain may be an interior vertex of another chain.
    middle = np.zeros(A.size, dtype=bool)
    middle[end[:-1][inside]] = True
    chain, first, last = _runs(inside)
    ends = np.hstack([start[:-1][first], end[1:][last]])
    inside[inside] = ~middle[ends].any(axis=1)[chain]

    # A chain between two free ends is divided at its middle, and eliminated from both ends.
    _, first, last = _runs(inside)
    both_free = has(2 * n, start[:-1][first]) & has(2 * n, end[1:][last])
    both_free &= last - first > 1
    inside[(first + last)[both_free] // 2] = False

    chain, first, last = _runs(inside)
    left, middle_, right = start[:-1][first], end[:-1][inside], end[1:][last]
    before, after = start[:-1][inside], end[1:][inside]
    # A vertex with 2 n entries per row is a free end: its only neighbour is in the chain.
    free_left, free_right = has(2 * n, left), has(2 * n, right)
    backward = free_right & ~free_left
    free = free_left | free_right
    long = last - first + 1
    chain_begin = np.append(0, np.cumsum(long + free))
    begin = chain_begin[:-1]
    position = np.arange(len(chain)) - np.append(0, np.cumsum(long))[chain]
    position = np.where(backward[chain], long[chain] - 1 - position, position)
    place = begin[chain] + free[chain] + position
    around = np.empty((chain_begin[-1], 3, n), dtype=np.int32)
    around[place, 1] = middle_
    around[place, 0] = np.where(backward[chain, None], after, before)
    around[place, 2] = np.where(backward[chain, None], before, after)
    around[begin[free], 0] = A.size + np.arange(n)
    around[begin[free], 1] = np.where(backward[:, None], right, left)[free]
    around[begin[free], 2] = around[begin[free] + 1, 1]
    right = np.where(backward[:, None], left, right)
    ends = np.hstack([np.where(free[:, None], right, left), right])
    at = np.zeros(around.shape[:2], dtype=np.uint8)
    for column in around.reshape(-1, 3 * n).T:
        at += around[:, :, 0] > column[:, None]
    return around[:, 1], chain_begin, ends, ~free, at


def _runs(mask: npt.NDArray[np.bool_]) -> tuple[Index, Index, Index]:
    """Return the number of the run of each true value, and first and last position of each run."""
    edges = np.diff(np.concatenate([[0], mask.astype(np.int8), [0]]))
    first, last = np.flatnonzero(edges == 1), np.flatnonzero(edges == -1) - 1
    return np.repeat(np.arange(len(first)), last - first + 1), first, last


INDICES = (
    "first", "spike", "dof", "begin", "with_ends", "entry", "place", "places", "kept", "number",
    "ends",
)  # fmt: skip
"""Arrays of ``chains`` of loops.h that follow from the structure of a matrix."""


@cached_by_structure
def _plan(
    cell_dofs: Index,
    indptr: Index,
    indices: Index,
    alone: Index,
    dofs: Index,
    num_owned: int,
    unknowns: int,
) -> tuple[Index, ...]:
    """Find the vertices that can be eliminated, and the positions of entries in the reduced matrix.

    Returns:
        Degrees of freedom that remain, in the order of the scene's numbering; the last result of
        :func:`_interior_vertices`; ``indptr`` and ``indices`` of the reduced matrix; the arrays of
        :data:`INDICES`.
    """
    A = Csr(np.empty(0), indices, indptr)
    vertices, chain_begin, chain_ends, spikes, at = _interior_vertices(
        cell_dofs, A, alone, unknowns
    )
    stays = np.ones(A.size, dtype=bool)
    stays[vertices] = False
    remaining = np.flatnonzero(stays)
    remaining = remaining[np.argsort(dofs[remaining])]
    number = np.full(A.size, -1, dtype=np.int32)
    number[remaining] = np.arange(len(remaining))
    ends, owned = number[chain_ends], remaining[remaining < num_owned]
    first, last = (vertices[k] for k in (chain_begin[:-1], chain_begin[1:] - 1))
    next_to = np.stack([np.where(spikes[:, None], first, last), last], axis=1)
    end_dofs = chain_ends.reshape(-1, 2, unknowns)
    rows = np.stack([end_dofs, next_to], axis=1)[..., None]
    columns = np.stack([next_to, end_dofs], axis=1)[..., None, :]
    with_ends = A.positions(*map(np.ravel, np.broadcast_arrays(rows, columns)))
    # The reduced matrix has entries that stay, and blocks between the ends of each chain.
    rows, size = remaining, len(remaining)
    entry = A.entries_of(rows)
    row, column = np.repeat(number[rows], np.diff(A.indptr)[rows]), number[A.indices[entry]]
    entry, row, column = entry[column >= 0], row[column >= 0], column[column >= 0]
    key = row.astype(np.int64) * size + column
    block = ends.astype(np.int64).reshape(-1, 2, unknowns)
    block_keys = (block[:, :, None, :, None] * size + block[:, None, :, None, :]).ravel()
    keys = np.unique(np.concatenate([key, block_keys]))
    place, places = (np.searchsorted(keys, x) for x in (key, block_keys))
    structure = np.searchsorted(keys, np.arange(size + 1) * size), keys % max(size, 1)
    arrays = (
        chain_begin, spikes, vertices[:, 0], A.indptr[vertices[:, 0]], with_ends,
        entry, place, places, owned, number[owned], ends,
    )  # fmt: skip
    return remaining, at, *structure, *(np.ascontiguousarray(x, np.int32) for x in arrays)


class Elimination:
    """Elimination of the chains of a matrix, which leaves a small reduced matrix.

    See substructuring.py.  The entries of ``A`` must not change between :meth:`factor` and the last
    :meth:`expand` after it.  On one process, C uses :attr:`c` directly, see newton.c.

    Attributes:
        shared: True for remaining unknowns that other processes have, too.
        c: ``chains`` of loops.h.
    """

    def __init__(self, subdomain: Subdomain, A: Csr, unknowns: int = 3) -> None:
        ghosts = np.concatenate(subdomain.comm.allgather(subdomain.dofs[subdomain.num_owned :]))
        alone = ~np.isin(subdomain.dofs, ghosts)
        pattern = subdomain.cell_dofs, A.indptr, A.indices, alone, subdomain.dofs
        remaining, at, indptr, columns, *arrays = _plan(*pattern, subdomain.num_owned, unknowns)
        self.dofs, self.shared = subdomain.dofs[remaining], ~alone[remaining]
        self.left = Csr(np.zeros(len(columns)), columns, indptr)
        self.f: Array = np.zeros(len(remaining))
        indices = dict(zip(INDICES, arrays, strict=True))
        vertices, number = len(indices["dof"]), len(indices["spike"])
        self.c = fill(
            ffi.new("chains *"),
            count=number, unknowns=unknowns, left=len(columns), stay=len(indices["entry"]),
            rows=len(indices["kept"]), left_size=len(remaining), left_data=self.left.data,
            left_f=self.f, data=A.data, swaps=ffi.new("uint8_t[]", unknowns * vertices),
            pivots=np.empty(unknowns**2 * vertices),
            to_next=np.empty(unknowns**2 * vertices),
            f=np.empty(subdomain.size), at=ffi.from_buffer("uint8_t[]", at), **indices,
        )  # fmt: skip

    def factor(self, b: Array) -> bool:
        """Eliminate the chains; return whether the reduced matrix is finite."""
        lib.eliminate(self.c, doubles(b))
        return bool(lib.all_finite(len(self.left.data), doubles(self.left.data)))

    def reduce(self, b: Array) -> None:
        """Reduce another right-hand side by the same factors."""
        lib.reduce(self.c, doubles(b))

    def expand(self, small: Array, x: Array) -> None:
        """Compute the solution ``x`` from the solution ``small`` of the reduced system."""
        lib.expand(self.c, doubles(small), doubles(x))


class CondensedSolver:
    """Direct solver: condensation along the beams, then factorization of the rest.

    If processes share a scene, each process also eliminates all other unknowns that no other
    process has, except in scenes with forces of connectors.  The remaining system is small.  Each
    process factors its sum over all processes, so that no process sends a solution.
    """

    def __init__(self, subdomain: Subdomain, A: Csr) -> None:
        self._elimination = Elimination(
            subdomain, A, 6 if subdomain.numbering.scene.in_space else 3
        )
        self._is_new = self._good = False
        # If only connectors hold a beam, elimination may leave zeros or round-off on the diagonal.
        # Several fronts then exchange too few rows; KLU exchanges enough.
        few_exchanges = not len(subdomain.numbering.multipliers)
        rest: Any = self._elimination
        if not subdomain.alone:
            if few_exchanges:
                rest = Multifrontal(rest, self._elimination.shared)
            rest = Summed(rest, subdomain.comm)
        none = np.zeros(len(rest.dofs), dtype=bool)
        fronts = few_exchanges or len(none) <= ONE_FRONT
        self._solved = Multifrontal(rest, none) if fronts else Klu(rest)
        self.factor = self._solved.factor
        if fronts:
            del self._elimination.left.indices  # fronts need positions only

    def drive(self, c: Any) -> None:
        """Let Newton's method in C use this solver; ``c`` is its ``equation`` of loops.h."""
        c.elimination, self._elimination.c.f = self._elimination.c, c.change
        self._solved.drive(c)

    def setUp(self, pc: PETSc.PC) -> None:
        """Factor with the next right-hand side; PETSc calls this if the matrix has changed."""
        self._is_new = True
        pc.setFailedReason(GOOD)

    def apply(self, pc: PETSc.PC, b: PETSc.Vec, x: PETSc.Vec) -> None:
        """Solve; ``x`` is zero after a failure, because an error would break objects of PETSc."""
        reduced, self._is_new = self._is_new, False
        if reduced:
            self._good = self.factor(b.array_r)
        if not (self._good and self.solve(b.array_r, x.array_w, reduced=reduced)):
            x.array_w[:] = 0.0
            pc.setFailedReason(BAD_PIVOT)

    def solve(self, b: Array, x: Array, *, reduced: bool) -> bool:
        """Solve for ``x``; return whether the solution succeeds.

        If ``reduced``, :meth:`factor` has already reduced the right-hand side.
        """
        good = reduced or succeeds(self._solved.reduce, b)
        if good:
            self._solved.expand(self._solved.f, x)
        return good
