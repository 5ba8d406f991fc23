# SPDX-License-Identifier: MIT
"""Eigenvalues of matrix pencils nearest to a shift, by SLEPc or, for small pencils, by LAPACK."""

from __future__ import annotations

from typing import Any

from petsc4py import PETSc

import numpy as np
from scipy.sparse import block_array, csr_array, eye_array

from ufl_beam.arrays import Array, Complex
from ufl_beam.compiled.csr import Csr

TOLERANCE = 1e-12  # tolerance of the residual of an eigenpair, relative to its eigenvalue

SHIFT = 1e-13
"""Shift relative to the least squared frequency of a dof alone; round-off hides smaller shifts."""

EXTRA = 8  # number of additional eigenvalues, so that none of several close eigenvalues is missed
DENSE = 200  # number of unknowns up to which LAPACK finds all eigenvalues with their multiplicities

ROUND_OFF = 64 * float(np.finfo(np.float64).eps)
"""Bound on the round-off of a matrix, relative to its largest entry."""

ZERO = ROUND_OFF / 8
"""Value of a quadratic form up to which it is round-off, as a fraction of the sum of magnitudes of
its terms.  The largest observed round-off is a sixtieth of this value."""


def _slepc() -> Any:
    try:
        from slepc4py import SLEPc
    except ImportError as error:  # pragma: no cover - depends on the machine
        raise ImportError(
            "modes and buckling need slepc4py; install the package slepc4py of conda-forge, or "
            "python3-slepc4py-real of Debian"
        ) from error
    return SLEPc


def _petsc(A: csr_array) -> PETSc.Mat:
    A = A.tocsr()
    A.sort_indices()
    return Csr(A.data, A.indices, A.indptr).petsc()


def linear(
    A: csr_array, B: csr_array, n: int, *, most: int, shift: float = 0.0, definite: bool
) -> tuple[Complex, Complex]:
    """Compute the n eigenvalues of ``A x = λ B x`` nearest to ``shift``, with eigenvectors.

    A and B are symmetric, and ``A - shift B`` is regular.  With ``definite``, B has no negative
    eigenvalue.  The pencil has ``most`` finite eigenvalues.  The results, (n,) and (size, n), may
    contain up to :data:`EXTRA` additional eigenvalues.
    """
    size, n = A.shape[0], min(n + EXTRA, most)
    if size <= DENSE:
        θ, x = (_inverse_definite if definite else _inverse)((A - shift * B).toarray(), B.toarray())
        return (1 / θ[:n] + shift).astype(complex), x[:, :n].astype(complex)
    slepc = _slepc()
    solver = slepc.EPS().create(PETSc.COMM_SELF)
    solver.setOperators(_petsc(A), _petsc(B))
    kind = slepc.EPS.ProblemType
    solver.setProblemType(kind.GHEP if definite else kind.GNHEP)
    solver.setWhichEigenpairs(slepc.EPS.Which.TARGET_MAGNITUDE)
    return _solved(solver, size, n, shift)


def quadratic_near_zero(
    K: csr_array, C: csr_array, M: csr_array, n: int
) -> tuple[Complex, Complex]:
    """Compute the n λ of ``(K + λ C + λ² M) x = 0`` nearest to zero, with vectors x; K is regular.

    For the shapes of the results see :func:`linear`.
    """
    size = K.shape[0]
    first = linear(K, -C, 1, most=size, definite=False)[0].real
    unit = np.abs(first).min() if len(first) else 1.0
    identity, none = eye_array(size), csr_array((size, size))
    A = csr_array(block_array([[K, none], [none, identity]]))
    B = csr_array(block_array([[-unit * C, -(unit**2) * M], [identity, none]]))
    values, x = linear(A, B, n, most=2 * size, definite=False)
    finite = np.abs(values) < 1e9 * np.abs(values).min(initial=np.inf)
    return unit * values[finite], x[:size, finite]


def quadratic(
    K: csr_array, C: csr_array, M: csr_array, n: int, *, most: int, shift: float
) -> tuple[Complex, Complex]:
    """Compute the n exponents s of ``(K + s C + s² M) x = 0`` nearest to ``shift``, with vectors x.

    Conjugate exponents count as two.  For the shapes of the results see :func:`linear`.
    """
    size, n = K.shape[0], min(n + EXTRA, most)
    if size <= DENSE:
        # Linearization in the time unit 1/shift, with velocities v: s x = v, s M v = -K x - C v.
        identity, none = eye_array(size), csr_array((size, size))
        A = block_array([[none, identity], [-K, -shift * C]])
        B = block_array([[identity, none], [none, shift**2 * M]])
        θ, x = _inverse((A - B).toarray(), B.toarray())
        return shift * (1 / θ[:n] + 1), x[:size, :n]
    slepc = _slepc()
    solver = slepc.PEP().create(PETSc.COMM_SELF)
    solver.setOperators([_petsc(A) for A in (K, C, M)])
    solver.setType("toar")
    solver.setScale(slepc.PEP.Scale.SCALAR)
    solver.setWhichEigenpairs(slepc.PEP.Which.TARGET_MAGNITUDE)
    solver.getST().setTransform(True)
    return _solved(solver, size, n, shift)


def small(A: Array, B: Array) -> tuple[Complex, Complex]:
    """Compute all finite eigenvalues of a small symmetric ``A x = λ B x``, with eigenvectors.

    The unknowns may have any units.  The results have the shapes (n,) and (size, n).
    """
    sizes = np.sqrt(np.abs(A.diagonal()) + np.abs(B.diagonal()))
    scale = 1 / np.where(sizes > 0, sizes, 1.0)
    across = np.outer(scale, scale)
    θ, x = _inverse(A * across, B * across)
    return 1 / θ, scale[:, None] * x


def _inverse(A: Array, B: Array) -> tuple[Complex, Complex]:
    """Compute the nonzero eigenvalues of A⁻¹ B, the largest first, and their eigenvectors."""
    θ, x = np.linalg.eig(np.linalg.solve(A, B))
    order = np.argsort(-np.abs(θ), kind="stable")
    order = order[np.abs(θ[order]) > 0]
    return θ[order].astype(complex), x[:, order].astype(complex)


def _inverse_definite(A: Array, B: Array) -> tuple[Array, Array]:
    """Compute the results of :func:`_inverse` from the symmetric matrix Fᵀ A⁻¹ F with B = F Fᵀ."""
    scale = np.sqrt(B.diagonal())
    nonzero = np.flatnonzero(scale)
    F = np.zeros((len(A), len(nonzero)))
    unit = B[np.ix_(nonzero, nonzero)] / np.outer(scale[nonzero], scale[nonzero])
    F[nonzero] = scale[nonzero, None] * np.linalg.cholesky(unit)
    flexible = np.linalg.solve(A, F)
    S = F.T @ flexible
    θ, y = np.linalg.eigh((S + S.T) / 2)
    order = np.argsort(-np.abs(θ), kind="stable")
    order = order[np.abs(θ[order]) > 0]
    return θ[order], flexible @ (y[:, order] / θ[order])


def _solved(solver: Any, size: int, n: int, shift: float) -> tuple[Complex, Complex]:
    """Compute the eigenvalues nearest to a shift, and their eigenvectors, by SLEPc."""
    solver.setDimensions(n)
    solver.setTolerances(TOLERANCE, 500)
    solver.setTarget(shift)
    st = solver.getST()
    st.setType("sinvert")
    st.setShift(shift)
    ksp = st.getKSP()
    ksp.setType("preonly")
    ksp.getPC().setType("lu")
    # KLU exchanges rows, because constraints leave zeros on the diagonal.
    ksp.getPC().setFactorSolverType("klu")
    # A fixed first vector gives the same results on every process and in every run.
    first = np.random.default_rng(0).uniform(0.5, 1.0, size)
    solver.setInitialSpace([PETSc.Vec().createWithArray(first, comm=PETSc.COMM_SELF)])
    solver.solve()
    real, imaginary = (PETSc.Vec().createSeq(size, comm=PETSc.COMM_SELF) for _ in range(2))
    values, vectors = [], []
    for k in range(solver.getConverged()):
        values.append(solver.getEigenpair(k, real, imaginary))
        vectors.append(real.array_r + 1j * imaginary.array_r)
    solver.destroy()
    return np.array(values, dtype=complex), np.array(vectors, dtype=complex).reshape(-1, size).T
