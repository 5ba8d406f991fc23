# SPDX-License-Identifier: MIT
"""Modal reduction by the mode-acceleration method: motions that are left out respond statically."""

from __future__ import annotations

from itertools import pairwise
from typing import NamedTuple

import numpy as np
from scipy.sparse import block_array, csc_array, csr_array, diags_array
from scipy.sparse.linalg import SuperLU, splu

from ufl_beam.analysis.state_space import Motion
from ufl_beam.arrays import Array, Index
from ufl_beam.errors import ArgumentError
from ufl_beam.solvers.eigensolvers import ROUND_OFF

FOLLOWS = 1e-4  # change of a motion by the forces of its own rate, as a fraction, that is left out


class Equations(NamedTuple):
    """Equations ``M x'' + C x' + K x = F f + B0 u + B1 u' + B2 u''`` with rows of constraints.

    ``free`` are the rows of motions; the other unknowns are the forces of constraints.
    """

    M: csr_array
    C: csr_array
    K: csr_array
    F: csr_array
    moved: tuple[csr_array, csr_array, csr_array]
    free: Index


class Reduction:
    """Motions ``x = Φ q + v b + P u + r`` with modes Φ, lags v of dampers, and a static rest r.

    With M-orthonormal Φ and static P, the equations of q, b and r are, without forces of r',

        K r + M Φ q'' + C v b' = F f + (B1 - C P) u' + (B2 - M P) u'' - C Φ q' - K (Φ q + v b),
        Φᵀ M r = 0,  vᵀ C r = 0.

    The mode-acceleration method, in which r is the response of the residual flexibility to loads in
    equilibrium with the inertia of the modes, rigid ones included: R. H. MacNeal, Computers &
    Structures 1 (1971); S. Rubin, AIAA Journal 13 (1975); R. R. Craig and A. J. Kurdila,
    Fundamentals of Structural Dynamics (2006).

    Attributes:
        motion: Motions as functions of states and inputs; ``y`` without r.
        rest: r and the forces of constraints, at all unknowns, as functions of the same.
        num_lags: Number of lags.

    Args:
        equations: Equations of small motions.
        x: Modes, in columns; with mass 1.
        squares: Squared frequencies of the modes, if they are eigenvectors of K; rad²/s².
        others: Motions without stiffness among the modes that are left out.
        omega: Frequencies at which to compare lags with modes; rad/s.
        lengths: Size of the scene for displacements, 1 for rotations, of the free rows.
    """

    def __init__(
        self, equations: Equations, x: Array, squares: Array | None, others: Array, omega: Array,
        lengths: Array,
    ) -> None:  # fmt: skip
        M, C, K, F, (B0, B1, B2), y = equations
        n, nu, nf, modes = x.shape[1], B0.shape[1], F.shape[1], np.hstack([x, others])
        size, exact = len(x), squares is not None
        own = np.zeros(n) if squares is None else squares
        factors, unit = _bordered(K, M @ modes)
        forces = np.zeros(x.shape) if exact else K @ x  # of modes, in equilibrium with inertia
        # K⁻¹ M Φ without motions that have no stiffness
        found = factors.solve(_over(forces, modes.shape[1]))
        stiffness = np.diag(own) + (unit * found[size:])[:n]
        by_modes = (x - found[:size]) @ np.linalg.pinv(stiffness, 0.0 if exact else ROUND_OFF)
        P = np.zeros((size, nu))
        for _ in range(2):  # the second time reduces round-off
            found = factors.solve(_over(B0 - K @ P, modes.shape[1]))
            P = P + found[:size] + by_modes @ (unit * found[size:])[:n]
        viscous = (C + C.T) / 2
        damping = equations._replace(C=viscous)
        if not exact:  # only lags of motions without mass: springs hold the others
            heavy = np.where(M.diagonal() > 0.0, abs(K).max() / ROUND_OFF, 0.0)
            damping = damping._replace(K=K + diags_array(heavy))
        v = lags(damping, modes, x, omega, P, lengths)
        self.num_lags = r = v.shape[1]
        damped = viscous @ v
        if r:
            factors, unit = _bordered(K, np.hstack([M @ modes, damped]))
        at = np.cumsum([0, n, r, n, nu, nu, nf, nu])
        q, b, dq, u, du, f, ddu = (np.eye(at[-1])[i:j] for i, j in pairwise(at))
        loads = F @ f - forces @ q - (K @ v) @ b
        by_rates = (B1 - C @ P) @ du + (B2 - M @ P) @ ddu - (C @ x) @ dq
        loads[y] += by_rates[y]
        found = factors.solve(_over(loads, modes.shape[1] + r))
        self.rest, rates = found[:size], unit * found[size:]
        constraints = np.setdiff1d(np.arange(size), y)
        self.rest[constraints] += (x @ q + P @ u)[constraints]
        # Rates of lags with mass are left out, like r'.
        light = np.where(M.diagonal()[:, None] == 0.0, v, 0.0)
        self.rest += (v - light) @ b
        ddq, db = rates[:n] - own[:, None] * q, rates[modes.shape[1] :]
        rates = np.vstack([dq, db, ddq, du, ddu])
        toward = (M @ x)[y].T
        beside = np.linalg.solve(v.T @ damped, damped.T)[:, y] if r else np.zeros((0, len(y)))
        read = np.vstack([toward, beside - (beside @ x[y]) @ toward])
        self.motion = Motion(
            int(at[5]), rates, (x @ q + light @ b + P @ u)[y], (x @ dq + light @ db + P @ du)[y],
            (x @ ddq + P @ ddu)[y], u, du, ddu, f, read, P[y],
        )  # fmt: skip


def _over(loads: Array, count: int) -> Array:
    """Return right-hand sides with zeros below."""
    return np.vstack([loads, np.zeros((count, loads.shape[1]))])


def _bordered(K: csr_array, W: Array) -> tuple[SuperLU, Array]:
    """Return factors of ``[[K, W c], [c Wᵀ, 0]]`` with scales c, and c as a column."""
    c = abs(K).max() / np.abs(W).max(axis=0)
    border = csr_array(W * c)
    try:
        return splu(csc_array(block_array([[K, border], [border.T, None]]))), c[:, None]
    except RuntimeError:
        raise ArgumentError(
            "reduced: neither mass nor stiffness determines some motion; use the full model, whose "
            "state_space() names it if no damper determines it either"
        ) from None


def lags(
    equations: Equations, modes: Array, x: Array, omega: Array, P: Array, lengths: Array
) -> Array:
    """Return motions besides the modes x, and P, that dampers make lag behind; (size, number).

    The rest r follows the forces of dampers on x and P as in statics, without forces of its own
    rate.  Where these change it, as in a damper in series with a spring, or beside a strong damper,
    it needs a state of first order.  The result is a basis of such motions.
    """
    M, C, K, _, (_, B1, _), y = equations
    both = np.hstack([x, P])
    forces, terms = C @ both, abs(C) @ np.abs(both)
    forces[:, x.shape[1] :] -= B1
    terms[:, x.shape[1] :] += abs(B1)
    forces[np.setdiff1d(np.arange(len(x)), y)] = 0.0
    forces[np.abs(forces) <= 1e6 * ROUND_OFF * terms] = 0.0
    if not forces.any():
        return np.zeros((len(x), 0))
    factors, _ = _bordered(K + omega.min() * C, M @ modes)
    rates = np.append(omega, np.full(P.shape[1], omega.max()))
    for _ in range(2):  # change of r by the forces of its rate
        rest = factors.solve(_over(forces, modes.shape[1]))[: len(x)] * rates
        forces = C @ rest
    sizes = lengths[:, None]
    largest = np.abs(both[y] / sizes).max(axis=0)
    U, values, _ = np.linalg.svd(rest[y] / sizes / largest, full_matrices=False)
    v = np.zeros((len(x), int(np.sum(values > FOLLOWS))))
    v[y] = U[:, values > FOLLOWS] * sizes
    return v
