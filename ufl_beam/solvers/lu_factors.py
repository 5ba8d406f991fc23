# SPDX-License-Identifier: MIT
"""Factors of a reduced system, see substructuring.py, by KLU of SuiteSparse."""

from __future__ import annotations

import warnings
from functools import cache
from typing import Any

from mpi4py import MPI
from petsc4py import PETSc

import numpy as np
import numpy.typing as npt

from ufl_beam.arrays import Array
from ufl_beam.compiled import c_library
from ufl_beam.compiled.c_library import doubles, ffi, fill, integers, lib
from ufl_beam.errors import ArgumentError

LARGEST_INDEX = int(np.iinfo(np.int32).max)
"""Largest number of entries of the factors."""

GOOD = int(PETSc.PC.FailedReason.NOERROR)
OF_LIBRARY = 76
"""Error of PETSc, PETSC_ERR_LIB, if KLU finds a singular matrix."""

BAD_PIVOT = int(PETSc.PC.FailedReason.FACTOR_NUMERIC_ZEROPIVOT)


def lu_factors(inner: Any, forces: npt.NDArray[np.bool_]) -> Klu | FactorsOfPetsc:
    """Return the factors of a reduced system; by PETSc, with a warning, if KLU is missing."""
    if c_library.KLU_HEADER is not None and c_library.HAS_KLU:
        return Klu(inner, forces)
    _warn_of_missing_klu()
    return FactorsOfPetsc(inner)


@cache
def _warn_of_missing_klu() -> None:
    if MPI.COMM_WORLD.rank == 0:
        what = "PETSc was built without KLU" if c_library.KLU_HEADER else "klu.h is missing"
        warnings.warn(
            f"{what}: steps of frames are slower, as PETSc factors their tangents. Install "
            "libsuitesparse-dev (Debian) or suitesparse (conda), and a PETSc that uses it",
            RuntimeWarning,
            stacklevel=2,
        )


class Klu:
    """LU factors by KLU, which Newton's method in C calls directly, see lu_factors.c.

    Args:
        inner: The reduced system; the pattern of its matrix has the diagonal.
        forces: True for unknowns that are forces of connectors; (size,).

    Attributes:
        c: ``lu_factors`` of loops.h.
    """

    def __init__(self, inner: Any, forces: npt.NDArray[np.bool_]) -> None:
        self._inner, A = inner, inner.left
        self.c = fill(
            ffi.gc(ffi.new("lu_factors *"), lib.free_factors),
            size=A.size, begin=A.indptr, index=A.indices, data=A.data,
            refines=int(forces.any()), space=np.zeros(2 * A.size),
        )  # fmt: skip
        order = np.zeros(A.size, dtype=np.int32)
        found = lib.find_order(self.c, integers(order))
        if forces.any():
            # The elimination of their motions fills the zeros on the diagonal at forces.
            place = np.empty(A.size)
            place[order] = np.arange(A.size)
            place[forces] = np.maximum.reduceat(place[A.indices], A.indptr[:-1])[forces] + 0.5
            order = np.argsort(place, kind="stable").astype(np.int32)
        if not found or lib.analyze(self.c, integers(order)) > LARGEST_INDEX:
            raise ArgumentError(
                f"factors of the tangent at the {A.size} unknowns of joints have more entries than "
                "memory holds, or than indices of 32 bits can number. Take fewer beams"
            )

    def factor(self, b: Array) -> bool:
        """Factor the matrix and solve; return whether the matrix is regular."""
        good = self._inner.factor(b) and bool(lib.factorize(self.c))
        if good:
            lib.solve_factored(self.c, doubles(self._inner.f))
        return good

    def reduce(self, b: Array) -> bool:
        """Solve for another right-hand side by the same factors; return whether this succeeds."""
        self._inner.reduce(b)
        lib.solve_factored(self.c, doubles(self._inner.f))
        return True

    def expand(self, x: Array) -> None:
        """Compute the solution ``x`` of the whole system."""
        self._inner.expand(self._inner.f, x)


class FactorsOfPetsc:
    """LU factors by PETSc, which calls KLU, or MUMPS if it has no KLU."""

    def __init__(self, inner: Any) -> None:
        self._inner, self._matrix = inner, inner.left.petsc()
        self._rhs = PETSc.Vec().createWithArray(inner.f, comm=PETSc.COMM_SELF)
        self._solution = self._rhs.duplicate()
        self._begin()

    def _begin(self) -> None:
        self._factors = PETSc.PC().create(PETSc.COMM_SELF)
        self._factors.setOperators(self._matrix)
        self._factors.setType("lu")
        self._factors.setFactorSolverType("klu" if c_library.HAS_KLU else "mumps")

    def factor(self, b: Array) -> bool:
        """Factor the matrix and solve; return whether the matrix is regular."""
        good: bool = self._inner.factor(b)
        self._matrix.stateIncrease()
        if good and self._solves() and self._factors.getFailedReason() == GOOD:
            return True
        self._begin()  # MUMPS does not factor again after a failure
        return False

    def reduce(self, b: Array) -> bool:
        """Solve for another right-hand side by the same factors; return whether this succeeds."""
        self._inner.reduce(b)
        return self._solves()

    def _solves(self) -> bool:
        """Solve; return False if KLU finds a singular matrix."""
        self._rhs.stateIncrease()
        try:
            self._factors.apply(self._rhs, self._solution)
        except PETSc.Error as error:
            if error.ierr != OF_LIBRARY:
                raise
            return False
        return True

    def expand(self, x: Array) -> None:
        """Compute the solution ``x`` of the whole system."""
        self._inner.expand(self._solution.array_r, x)
