# SPDX-License-Identifier: MIT
"""Null vectors of singular tangents: motions that no force resists."""

from __future__ import annotations

from typing import Any

import numpy as np
from scipy.sparse import coo_array, csc_array, csr_array, eye_array
from scipy.sparse.linalg import splu

from ufl_beam.arrays import Array, Index
from ufl_beam.solvers.factorization import scaled

DENSE = 300  # number of unknowns up to which null vectors come from a singular value decomposition

SINGULAR = 1e-12
"""Largest singular value that counts as zero, of a matrix whose entries are scaled to about 1."""


def free_tangent(equation: Any) -> tuple[csc_array, Index]:
    """Return the latest tangent of the degrees of freedom that no support holds, and their numbers.

    All processes call it together.  The numbers are those in the scene.
    """
    subdomain, A, dofs = equation.subdomain, equation.A, equation.subdomain.dofs
    local = dofs[A.rows()], dofs[A.indices], A.data, dofs[equation.supports.dofs]
    gathered = [local] if subdomain.alone else subdomain.comm.allgather(local)
    rows, columns, data, fixed = (np.concatenate(x) for x in zip(*gathered, strict=True))
    n = subdomain.numbering.size
    free = np.setdiff1d(np.arange(n), fixed)
    return csc_array(coo_array((data, (rows, columns)), shape=(n, n)).tocsc()[:, free][free]), free


def soft_motions(equation: Any) -> tuple[csc_array, Index, Array, Array] | None:
    """Find the motions that the latest tangent of a step equation resists least.

    All processes call it together.

    Returns:
        The results of :func:`free_tangent` and :func:`null_vectors`; None if the tangent is empty
        or not finite.
    """
    K, free = free_tangent(equation)
    if not K.data.any() or not np.isfinite(K.data).all():
        return None
    try:
        return K, free, *null_vectors(K)
    except (np.linalg.LinAlgError, RuntimeError):
        return None


def null_vectors(K: csc_array) -> tuple[Array, Array]:
    """Compute null vectors of a matrix, or the vector of its least singular value if it has none.

    Returns:
        Singular values after rows and columns are scaled to size 1, the least last; and the vectors
        in columns, in the units of the unknowns.  For large matrices there is only one vector.
    """
    n, (A, factors) = K.shape[0], scaled(csr_array(K))
    if n <= DENSE:
        _, sizes, vectors = np.linalg.svd(A.toarray())
        number = max(1, int(np.count_nonzero(sizes <= SINGULAR)))
        return sizes[-number:], factors[:, None] * vectors[-number:].T
    # A shift far below the entries makes the matrix regular.
    shifted = splu(csc_array(A + SINGULAR * eye_array(n)))
    y: Array = np.random.default_rng(0).normal(size=n)
    for _ in range(20):
        y = shifted.solve(shifted.solve(y / np.linalg.norm(y), trans="T"))
    y /= np.linalg.norm(y)
    return np.array([np.linalg.norm(A @ y)]), (factors * y)[:, None]
