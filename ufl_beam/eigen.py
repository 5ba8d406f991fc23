"""Eigenvalues of sparse pencils by SLEPc, those nearest to zero first."""

from __future__ import annotations

from typing import Any

from petsc4py import PETSc

import numpy as np
import numpy.typing as npt
from scipy.sparse import csr_array

from ufl_beam.compat import Array

Complex = npt.NDArray[np.complex128]

TOLERANCE = 1e-12
"""Residual of an eigenpair, as a part of its eigenvalue."""

SHIFT = 1e-13
"""Shift as a part of the squared frequencies of single nodes; smaller ones are lost in round-off."""

MORE = 8
"""Vectors of a Krylov space beyond twice the number that is sought."""

ROUND_OFF = 64 * float(np.finfo(np.float64).eps)
"""Part of the largest entry of a matrix that its round-off may reach."""

ZERO = ROUND_OFF / 8
"""Part of the sum of sizes in a quadratic form below which it is round-off: a sixtieth was met."""


def _slepc() -> Any:
    try:
        from slepc4py import SLEPc
    except ImportError as error:  # pragma: no cover - depends on the machine
        raise ImportError(
            "modes and buckling need slepc4py; install the package slepc4py of conda-forge, or "
            "python3-slepc4py-real of Debian, see docs/installation.md"
        ) from error
    return SLEPc


def _petsc(A: csr_array) -> PETSc.Mat:
    A = A.tocsr()
    A.sort_indices()
    arrays = (A.indptr.astype(PETSc.IntType), A.indices.astype(PETSc.IntType), A.data)
    matrix = PETSc.Mat().createAIJ(A.shape, csr=arrays, comm=PETSc.COMM_SELF)
    matrix.assemble()
    return matrix


def _factor(st: Any) -> None:
    """Factor by KLU: what constraints leave has zeros on the diagonal."""
    ksp = st.getKSP()
    ksp.setType("preonly")
    ksp.getPC().setType("lu")
    ksp.getPC().setFactorSolverType("klu")


def _space(n: int, most: int, size: int) -> int:
    """Dimension of the Krylov space."""
    return min(max(n + 1, min(2 * n + 2 * MORE, most)), size)


def _begin(solver: Any, size: int) -> None:
    """The same first vector on every process and in every run."""
    start = PETSc.Vec().createWithArray(
        np.random.default_rng(0).uniform(0.5, 1.0, size), comm=PETSc.COMM_SELF
    )
    solver.setInitialSpace([start])


def _pairs(solver: Any, size: int) -> tuple[Complex, Complex]:
    """Eigenvalues and vectors, in columns, that were found."""
    real, imaginary = (PETSc.Vec().createSeq(size, comm=PETSc.COMM_SELF) for _ in range(2))
    values, vectors = [], []
    for k in range(solver.getConverged()):
        values.append(solver.getEigenpair(k, real, imaginary))
        vectors.append(real.array_r + 1j * imaginary.array_r)
    return np.array(values, dtype=complex), np.array(vectors, dtype=complex).reshape(-1, size).T


def linear(
    A: csr_array, B: csr_array, n: int, *, most: int, shift: float = 0.0, definite: bool
) -> tuple[Array, Array]:
    """The n eigenvalues of ``A x = λ B x`` nearest to ``shift``; values (n,), vectors (size, n).

    Args:
        A: Symmetric.
        B: Symmetric; with no negative eigenvalue if ``definite``.
        n: How many.
        most: How many there are.
        shift: Where ``A - shift B`` is regular.
        definite: See ``B``.
    """
    slepc, size = _slepc(), A.shape[0]
    solver = slepc.EPS().create(PETSc.COMM_SELF)
    solver.setOperators(_petsc(A), _petsc(B))
    kind = slepc.EPS.ProblemType
    solver.setProblemType(kind.GHEP if definite else kind.GNHEP)
    solver.setDimensions(n, _space(n, most, size))
    solver.setTolerances(TOLERANCE, 500)
    solver.setWhichEigenpairs(slepc.EPS.Which.TARGET_MAGNITUDE)
    solver.setTarget(shift)
    st = solver.getST()
    st.setType("sinvert")
    st.setShift(shift)
    _factor(st)
    _begin(solver, size)
    solver.solve()
    values, vectors = _pairs(solver, size)
    solver.destroy()
    return values.real, vectors.real


def quadratic(
    K: csr_array, C: csr_array, M: csr_array, n: int, *, most: int, shift: float
) -> tuple[Complex, Complex]:
    """The n exponents s of ``(K + s C + s² M) x = 0`` nearest to ``shift``, conjugates counted."""
    slepc, size = _slepc(), K.shape[0]
    solver = slepc.PEP().create(PETSc.COMM_SELF)
    solver.setOperators([_petsc(A) for A in (K, C, M)])
    solver.setType("toar")
    solver.setScale(slepc.PEP.Scale.SCALAR)
    solver.setDimensions(n, _space(n, most, 2 * size))
    solver.setTolerances(TOLERANCE, 500)
    solver.setWhichEigenpairs(slepc.PEP.Which.TARGET_MAGNITUDE)
    solver.setTarget(shift)
    st = solver.getST()
    st.setType("sinvert")
    st.setShift(shift)
    st.setTransform(True)
    _factor(st)
    _begin(solver, size)
    solver.solve()
    found = _pairs(solver, size)
    solver.destroy()
    return found
