# SPDX-License-Identifier: MIT
"""Factorization of the whole tangent by PETSc, for the reference path."""

from __future__ import annotations

from typing import Any

from petsc4py import PETSc

import numpy as np

from ufl_beam.compiled.csr import Csr
from ufl_beam.discretization.partition import Share
from ufl_beam.solvers.klu import BAD_PIVOT, GOOD, succeeds


class DirectSolver:
    """LU factors of the tangent: by KLU on one process, by MUMPS on several.

    Each process has entries of its cells; PETSc adds those of several processes.
    """

    def __init__(self, share: Share, A: Csr) -> None:
        self._share, self._entries, self._good = share, A.data, False
        numbers = share.numbers().astype(PETSc.IntType)
        self._places = A.indptr.astype(PETSc.IntType), numbers[A.indices]
        self._rows = numbers
        size = (share.num_owned, share.grid.size)
        self._matrix = PETSc.Mat().create(comm=share.comm)
        self._matrix.setSizes((size, size))
        self._matrix.setType("aij")
        self._matrix.setUp()
        self._factors = PETSc.PC().create(share.comm)
        self._factors.setOperators(self._matrix)
        self._factors.setType("lu")
        self._factors.setFactorSolverType("klu" if share.alone else "mumps")

    def drive(self, c: Any) -> None:
        """Leave Newton's method to PETSc."""

    def setUp(self, pc: PETSc.PC) -> None:
        """Factor; PETSc asks for it where the matrix has changed."""
        self._matrix.zeroEntries()
        values = (*self._places, self._entries)
        self._matrix.setValuesIJV(*values, PETSc.InsertMode.ADD_VALUES, rowmap=self._rows)
        self._matrix.assemble()
        finite = self._share.largest(float(not np.isfinite(self._entries).all())) == 0.0
        self._good = finite and succeeds(self._factors.setUp)
        self._good = self._good and int(self._factors.getFailedReason()) == GOOD
        pc.setFailedReason(GOOD if self._good else BAD_PIVOT)

    def apply(self, pc: PETSc.PC, b: PETSc.Vec, x: PETSc.Vec) -> None:
        """Solve; zero after a failure."""
        self._good = self._good and succeeds(self._factors.apply, b, x)
        if not self._good:
            x.array_w[:] = 0.0
            pc.setFailedReason(BAD_PIVOT)
