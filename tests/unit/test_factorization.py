# SPDX-License-Identifier: MIT
"""Factors of indefinite matrices: signs of eigenvalues, solutions, what is singular."""

import numpy as np
import pytest
from scipy.sparse import csr_array

from ufl_beam.solvers.factorization import Factorization


def saddle(seed, motions=12, forces=5):
    """A stiffness that is indefinite, or zero in places, and held by constraints."""
    random = np.random.default_rng(seed)
    K = random.normal(size=(motions, motions))
    K = K + K.T
    K[:3] = K[:, :3] = 0.0  # what constraints alone hold
    G = random.normal(size=(motions, forces))
    return np.block([[K, G], [G.T, np.zeros((forces, forces))]])


@pytest.mark.parametrize("seed", range(3))
@pytest.mark.parametrize("unit", [1.0, 1e-9, 1e12])
def test_negative_eigenvalues_and_solutions_in_any_units(seed, unit):
    """Of LAPACK's eigenvalues; rows and columns of forces, and of some motions, in other units."""
    # One refinement leaves residuals of round-off: 1e-13 of sums of 17 terms of size one.
    A, scale = saddle(seed), np.ones(17)
    scale[-5:], scale[::3] = unit, 1e-3 * unit
    factors = Factorization(csr_array(scale[:, None] * A * scale))
    assert factors.symmetric
    assert factors.negative == int(np.sum(np.linalg.eigvalsh(A) < 0))
    b = np.random.default_rng(9).normal(size=len(A))
    x = scale * factors.solve(scale * b)
    assert np.abs(A @ x - b).max() <= 1e-13 * (np.abs(A) @ np.abs(x)).max()


@pytest.mark.parametrize("seed", range(6))
def test_sign_of_the_determinant(seed):
    """Of a matrix that is not symmetric, and of the same with two rows exchanged."""
    A = np.random.default_rng(seed).normal(size=(9, 9))
    for matrix in (A, A[[1, 0, *range(2, 9)]]):
        factors = Factorization(csr_array(matrix))
        assert not factors.symmetric
        assert factors.negative == int(np.linalg.det(matrix) < 0)


def test_what_has_no_inverse():
    singular, infinite = saddle(0), saddle(1)
    singular[4] = singular[:, 4] = 0.0
    infinite[2, 2] = np.nan
    for matrix in (singular, infinite):
        with pytest.raises(np.linalg.LinAlgError):
            Factorization(csr_array(matrix))
