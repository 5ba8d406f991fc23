# SPDX-License-Identifier: MIT
"""Direct factorization of a square sparse matrix, and the number of its negative eigenvalues."""

from __future__ import annotations

from petsc4py import PETSc

import numpy as np
from scipy.sparse import csr_array

from ufl_beam.arrays import Array
from ufl_beam.compiled.csr import Csr

SCALINGS = 6
"""Number of scaling passes; each one reduces the range of magnitudes to its square root."""

SYMMETRIC = 64 * float(np.finfo(np.float64).eps)
"""Largest difference between a scaled matrix that counts as symmetric and its transpose."""


def scaled(A: csr_array) -> tuple[csr_array, Array]:
    """Return a matrix with rows and columns scaled to largest entries of about one, and factors.

    Ruiz's iteration; the factors, (size,), are powers of two, so that nothing is rounded.
    """
    rows, sizes = np.repeat(np.arange(A.shape[0]), np.diff(A.indptr)), np.abs(A.data)
    scale = np.ones(A.shape[0])
    for _ in range(SCALINGS):
        now, largest = sizes * scale[rows] * scale[A.indices], np.zeros_like(scale)
        np.maximum.at(largest, rows, now)
        np.maximum.at(largest, A.indices, now)
        scale /= np.sqrt(np.where(largest > 0, largest, 1.0))
    scale = np.exp2(np.round(np.log2(scale)))
    values = A.data * (scale[rows] * scale[A.indices])
    return csr_array((values, A.indices, A.indptr), shape=A.shape), scale


class Factorization:
    """L D Lᵀ factors of a symmetric matrix, or L U factors of an unsymmetric one, by MUMPS.

    Rows and columns are scaled so that the largest entry of each is about one.  So the result does
    not depend on units.  MUMPS exchanges rows and columns, so the diagonal may contain zeros.

    Attributes:
        symmetric: True if the matrix is symmetric up to round-off.
        negative: Number of negative eigenvalues of a symmetric matrix; else 1 if the determinant
            is negative, and 0 if it is positive.

    Raises:
        LinAlgError: The matrix is singular or has entries that are not finite.
    """

    def __init__(self, A: csr_array) -> None:
        if not np.isfinite(A.data).all():
            raise np.linalg.LinAlgError("the matrix has no inverse")
        S, self._scale = scaled(A)
        self.symmetric = bool(abs(S - S.T).max() <= SYMMETRIC)
        self._S = csr_array((S + S.T) / 2) if self.symmetric else S
        self._pc = pc = PETSc.PC().create(PETSc.COMM_SELF)
        matrix = Csr(self._S.data, self._S.indices, self._S.indptr).petsc()
        matrix.setOption(PETSc.Mat.Option.SYMMETRIC, self.symmetric)
        pc.setOperators(matrix)
        pc.setType("cholesky" if self.symmetric else "lu")
        pc.setFactorSolverType("mumps")
        pc.setFactorSetUpSolverType()
        factors = pc.getFactorMatrix()
        factors.setMumpsIcntl(33, 0 if self.symmetric else 1)  # whether to find the determinant
        pc.setUp()
        if pc.getFailedReason():
            raise np.linalg.LinAlgError("the matrix has no inverse")
        # INFOG(12) is the number of negative pivots, RINFOG(12) the mantissa of the determinant.
        pivots, mantissa = factors.getMumpsInfog(12), factors.getMumpsRinfog(12)
        self.negative = int(pivots if self.symmetric else mantissa < 0)

    def solve(self, b: Array) -> Array:
        """Solve for one right-hand side, with one step of iterative refinement."""
        rhs = self._scale * b
        x, more = np.zeros((2, len(b)))
        for _ in range(2):
            both = rhs - self._S @ x, more
            self._pc.apply(*(PETSc.Vec().createWithArray(v, comm=PETSc.COMM_SELF) for v in both))
            x += more
        return np.asarray(self._scale * x)
