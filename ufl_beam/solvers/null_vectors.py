# SPDX-License-Identifier: MIT
"""Null vectors of singular tangents."""

from __future__ import annotations

import numpy as np
from scipy.sparse import coo_array, csc_array, diags_array, eye_array
from scipy.sparse.linalg import splu

from ufl_beam.arrays import Array, Index
from ufl_beam.compiled.csr import Csr
from ufl_beam.discretization.partition import Share

DENSE = 300
"""Up to this number of unknowns the null vector comes from a singular value decomposition."""

SINGULAR = 1e-12
"""Singular values of an equilibrated matrix up to this part of its entries count as zero."""

ROUNDS = 40
"""Largest number of times that rows and columns are scaled."""


def free_matrix(share: Share, A: Csr, held: Index) -> tuple[csc_array, Index]:
    """Assemble the tangent at what supports leave free, and its dofs in numbers of the grid.

    All processes call it together, each with its part ``A``, and local numbers of what is ``held``.
    """
    here = (share.dofs[A.rows()], share.dofs[A.indices], A.data, share.dofs[held])
    parts = share.comm.allgather(here) if not share.alone else [here]
    rows, columns, data, of_all = (np.concatenate(x) for x in zip(*parts, strict=True))
    n = share.grid.size
    free = np.setdiff1d(np.arange(n), of_all)
    K = coo_array((data, (rows, columns)), shape=(n, n)).tocsc()
    return csc_array(K[:, free][free]), free


def null_vector(K: csc_array) -> tuple[float, Array]:
    """Compute the vector that an equilibrated matrix makes least of, and how much; see below."""
    sizes, vectors = null_vectors(K)
    return float(sizes[-1]), vectors[:, -1]


def null_vectors(K: csc_array) -> tuple[Array, Array]:
    """Compute vectors that a matrix, its rows and columns scaled to size one, makes nothing of.

    The result is how much it makes of them, without dimension, the least last; and the vectors in
    columns, in the units of the unknowns.  One at least; of large matrices one only.
    """
    scaled, factors = _equilibrated(K)
    n = scaled.shape[0]
    if n <= DENSE:
        _, sizes, vectors = np.linalg.svd(scaled.toarray())
        number = max(1, int(np.count_nonzero(sizes <= SINGULAR)))
        return sizes[-number:], factors[:, None] * vectors[-number:].T
    # A shift far below the entries makes the factors those of a regular matrix.
    shifted = splu(csc_array(scaled + SINGULAR * eye_array(n)))
    y: Array = np.random.default_rng(0).normal(size=n)
    for _ in range(20):
        y = shifted.solve(shifted.solve(y / np.linalg.norm(y), trans="T"))
    y /= np.linalg.norm(y)
    return np.array([np.linalg.norm(scaled @ y)]), (factors * y)[:, None]


def _equilibrated(K: csc_array) -> tuple[csc_array, Array]:
    """Scale rows and columns so that their largest entries are about one; factors of columns."""
    n = K.shape[0]
    columns = np.ones(n)
    for _ in range(ROUNDS):
        sizes = abs(K)
        by_row, by_column = (np.asarray(sizes.max(axis=k).todense()).ravel() for k in (1, 0))
        both = np.concatenate([by_row, by_column])
        if np.all((both == 0) | ((both > 0.5) & (both < 2))):
            break
        r, c = (1 / np.sqrt(np.where(x > 0, x, 1.0)) for x in (by_row, by_column))
        K = csc_array(diags_array(r) @ K @ diags_array(c))
        columns *= c
    return K, columns
