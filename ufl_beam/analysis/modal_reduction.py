# SPDX-License-Identifier: MIT
"""Modal reduction by the mode-acceleration method: motions that are left out respond statically."""

from __future__ import annotations

from collections.abc import Callable
from itertools import pairwise

import numpy as np
from scipy.sparse import block_array, csc_array, csr_array, diags_array
from scipy.sparse.linalg import splu

from ufl_beam.analysis.state_space import Motion
from ufl_beam.arrays import Array, Index
from ufl_beam.errors import ArgumentError
from ufl_beam.solvers.eigensolvers import ROUND_OFF

FOLLOWS = 1e-4  # change of a motion by the forces of its own rate, as a fraction, that is left out


def reduced_motion(
    M: csr_array, C: csr_array, K: csr_array, F: csr_array,
    moved: tuple[csr_array, csr_array, csr_array], y: Index, x: Array, squares: Array | None,
    others: Array, omega: Array, lengths: Array,
) -> tuple[Motion, Array]:  # fmt: skip
    """Return motions ``Φ q + v b + P u + r`` with modes Φ, lags v of dampers, and a static rest r.

    With M-orthonormal Φ and static P, the equations of q, b and r are, without forces of r',

        K r + M Φ q'' + C v b' = F f + (B1 - C P) u' + (B2 - M P) u'' - C Φ q' - K (Φ q + v b),
        Φᵀ M r = 0,  vᵀ C r = 0.

    The mode-acceleration method, in which r is the response of the residual flexibility to loads in
    equilibrium with the inertia of the modes, rigid ones included: S. Rubin, AIAA Journal 13
    (1975); R. R. Craig and A. J. Kurdila, Fundamentals of Structural Dynamics (2006).

    The results are functions of states and inputs: the motions, whose ``y`` lacks r; and r with the
    forces of constraints, at all unknowns.

    Args:
        M: Mass in ``M x'' + C x' + K x = F f + B0 u + B1 u' + B2 u''`` with rows of constraints.
        C: Damping.
        K: Stiffness.
        F: Forces of unit inputs.
        moved: B0, B1, B2.
        y: Rows of motions; the other unknowns are the forces of constraints.
        x: Modes, in columns; with mass 1.
        squares: Squared frequencies of the modes, if they are eigenvectors of K; rad²/s².
        others: Motions without stiffness among the modes that are left out.
        omega: Frequencies at which to compare lags with modes; rad/s.
        lengths: Size of the scene for displacements, 1 for rotations, of the free rows.
    """
    (B0, B1, B2), n = moved, x.shape[1]
    nu, nf, W = B0.shape[1], F.shape[1], M @ np.hstack([x, others])
    size, exact = len(x), squares is not None
    own, solve = np.zeros(n) if squares is None else squares, _bordered(K, W)
    forces = np.zeros(x.shape) if exact else K @ x  # of modes, in equilibrium with inertia
    # K⁻¹ M Φ without motions that have no stiffness
    flexible, z = solve(forces)
    stiffness = np.diag(own) + z[:n]
    by_modes = (x - flexible) @ np.linalg.pinv(stiffness, 0.0 if exact else ROUND_OFF)
    P = np.zeros((size, nu))
    for _ in range(2):  # the second time reduces round-off
        change, z = solve(B0 - K @ P)
        P = P + change + by_modes @ z[:n]
    # Of inexact modes only motions without mass lag behind: springs hold the others.
    held = np.where((M.diagonal() > 0.0) & (not exact), abs(K).max() / ROUND_OFF, 0.0)
    damping = (C + C.T) / 2
    v = lags(damping, K + diags_array(held), B1, y, W, np.hstack([x, P]), omega, lengths)
    r, damped = v.shape[1], damping @ v
    solve = _bordered(K, np.hstack([W, damped]))
    at = np.cumsum([0, n, r, n, nu, nu, nf, nu])
    q, b, dq, u, du, f, ddu = (np.eye(at[-1])[i:j] for i, j in pairwise(at))
    loads = F @ f - forces @ q - (K @ v) @ b
    by_rates = (B1 - C @ P) @ du + (B2 - M @ P) @ ddu - (C @ x) @ dq
    loads[y] += by_rates[y]
    rest, z = solve(loads)
    constraints = np.isin(np.arange(size), y, invert=True)[:, None]
    # Rates of lags with mass are left out, like r'.
    light = np.where(M.diagonal()[:, None] == 0.0, v, 0.0)
    rest = rest + constraints * (x @ q + P @ u) + (v - light) @ b
    ddq, db = z[:n] - own[:, None] * q, z[W.shape[1] :]
    toward = (M @ x)[y].T
    beside = np.linalg.solve(v.T @ damped, damped.T)[:, y]
    read = np.vstack([toward, beside - (beside @ x[y]) @ toward])
    rates = np.vstack([dq, db, ddq, du, ddu])
    return Motion(int(at[5]), rates, (x @ q + light @ b + P @ u)[y], u, read, P[y]), rest


def _bordered(K: csr_array, W: Array) -> Callable[[Array], tuple[Array, Array]]:
    """Return a function that solves ``K x + W z = loads``, ``Wᵀ x = 0`` for x and z."""
    c = abs(K).max() / np.abs(W).max(axis=0)
    border = csr_array(W * c)
    try:
        factors = splu(csc_array(block_array([[K, border], [border.T, None]])))
    except RuntimeError:
        raise ArgumentError(
            "reduced: neither mass nor stiffness determines some motion; use the full model, whose "
            "state_space() names it if no damper determines it either"
        ) from None

    def solve(loads: Array) -> tuple[Array, Array]:
        found = factors.solve(np.pad(loads, ((0, len(c)), (0, 0))))
        return found[: len(W)], c[:, None] * found[len(W) :]

    return solve


def lags(
    C: csr_array, K: csr_array, B1: csr_array, y: Index, W: Array, x: Array, omega: Array,
    lengths: Array,
) -> Array:  # fmt: skip
    """Return motions besides x, the modes and P, that dampers make lag behind; (size, number).

    The rest r follows the forces of dampers on x as in statics, without forces of its own rate.
    Where these change it, as in a damper in series with a spring, or beside a strong damper, it
    needs a state of first order.  The result is a basis of such motions.
    """
    by_rates = np.pad(B1.toarray(), ((0, 0), (len(omega), 0)))  # of prescribed motions
    forces, terms = C @ x - by_rates, abs(C) @ np.abs(x) + np.abs(by_rates)
    forces[np.setdiff1d(np.arange(len(x)), y)] = 0.0
    forces[np.abs(forces) <= 1e6 * ROUND_OFF * terms] = 0.0
    if not forces.any():
        return np.zeros((len(x), 0))
    solve = _bordered(K + omega.min() * C, W)
    rates = np.append(omega, np.full(B1.shape[1], omega.max()))
    for _ in range(2):  # change of r by the forces of its rate
        rest = solve(forces)[0] * rates
        forces = C @ rest
    rest, x = rest[y] / lengths[:, None], x[y] / lengths[:, None]
    U, values, _ = np.linalg.svd(rest / np.abs(x).max(axis=0), full_matrices=False)
    v = np.zeros((len(forces), int(np.sum(values > FOLLOWS))))
    v[y] = U[:, : v.shape[1]] * lengths[:, None]
    return v
