# SPDX-License-Identifier: MIT
"""First-order equations of small motions with constraints: of all motions, or of some modes."""

from __future__ import annotations

from collections.abc import Callable
from itertools import pairwise
from typing import NamedTuple

import numpy as np
from scipy.linalg import lstsq, qr, solve, svd
from scipy.sparse import block_array, csc_array, csr_array, diags_array
from scipy.sparse.linalg import splu

from ufl_beam.arrays import Array, Index
from ufl_beam.errors import ArgumentError
from ufl_beam.solvers.eigensolvers import ROUND_OFF

FOLLOWS = 1e-4  # change of a motion by the forces of its own rate, as a fraction, that is left out
SINGULAR = 1e-12  # eigenvalue or pivot that is zero, as a fraction of the largest one
ABSENT = 1e-9  # coefficient that is round-off, as a fraction of the sum of its terms


class Motion(NamedTuple):
    """Motions as linear functions of states and inputs; one column each.

    The states are a, the part of b that a damper resists, a', u and u'.  The inputs are forces f,
    and u''.
    """

    states: int  # number of states, which are the first columns
    rates: Array  # of the states
    y: Array
    u: Array
    read: Array  # matrix that returns a and the damped part of b for y - P u
    P: Array


def _coordinates(M: csr_array, J: csr_array, h: Array, sizes: Array) -> tuple[Array, ...]:
    """Solve constraints ``J y = h u`` for dependent motions: y = N (V1 a + V0 b) + P u.

    The coordinates a have mass, and b have none.  They are independent motions themselves, unless
    combinations of them have no mass.  The result is N, P, V1, V0 and the matrix that returns
    (a, b) for y - P u.
    """
    n, (m, nu) = J.shape[1], h.shape
    N, P, independent = np.eye(n), np.zeros((n, nu)), np.arange(n)
    if m:
        scaled = J.toarray() * sizes
        lengths = np.linalg.norm(scaled, axis=1)[:, None]
        Q, R, order = qr(scaled / lengths, mode="economic", pivoting=True)
        rank = int(np.sum(np.abs(R.diagonal()) > SINGULAR * abs(R[0, 0])))
        dependent, independent = order[:rank], np.sort(order[rank:])
        R2 = R[:rank, rank:][:, np.argsort(order[rank:])]
        N = N[:, independent]
        N[dependent] = sizes[dependent, None] * -solve(R[:rank, :rank], R2) / sizes[independent]
        P[dependent] = sizes[dependent, None] * solve(R[:rank, :rank], (Q.T @ (h / lengths))[:rank])
    reduced = N.T @ (M @ N)
    terms = np.sum(np.abs(N) * (abs(M) @ np.abs(N)), axis=0)
    massive = reduced.diagonal() > ROUND_OFF * terms
    identity = np.eye(len(independent))
    V1, V0 = identity[:, massive], identity[:, ~massive] * sizes[independent[~massive]]
    scale = 1 / np.sqrt(reduced.diagonal()[massive])
    values, vectors = np.linalg.eigh(reduced[np.ix_(massive, massive)] * np.outer(scale, scale))
    if values.min(initial=1.0) < SINGULAR:
        heavy = values >= SINGULAR
        turned = V1 @ (scale[:, None] * vectors)
        V1, V0 = turned[:, heavy], np.hstack([V0, turned[:, ~heavy]])
    pick = np.zeros((len(independent), n))
    pick[np.arange(len(independent)), independent] = 1.0
    return N, P, V1, V0, np.linalg.solve(np.hstack([V1, V0]), pick)


def first_order(
    M: csr_array, C: csr_array, K: csr_array, F: csr_array, moved: tuple[Array, Array, Array],
    J: csr_array, h: Array, sizes: Array, name_of: Callable[[Array], str],
) -> tuple[Motion, Array]:  # fmt: skip
    """Solve ``M y'' + C y' + K y = F f + B0 u + B1 u' + B2 u''`` for the rates of states.

    The results are the motions, and the sums of all forces on them, which constraints bear.  Rates
    of the part of b on which neither mass nor damping acts do not enter.

    Args:
        M: Mass of the motions y.
        C: Their damping and gyroscopic forces.
        K: Their stiffness.
        F: Forces of unit inputs.
        moved: B0, B1, B2.
        J: Constraints ``J y = h u``.
        h: Their motions.
        sizes: Numbers that make motions dimensionless.
        name_of: Function that names the largest of the motions y, for an error.

    Raises:
        ArgumentError: Neither mass, damper nor stiffness determines a motion.
    """
    N, P, V1, V0, read = _coordinates(M, J, h, sizes)
    Mr, Cr, Kr = (N.T @ (A @ N) for A in (M, C, K))
    by_motions = [N.T @ (B - A @ P) for B, A in zip(moved, (K, C, M), strict=True)]
    # Bases of the motions without mass, with damping (W1) and without it (W0), and of their forces
    light = V0.T @ Cr @ V0
    identity = np.eye(len(light))
    U, viscosity, W = svd(light) if light.any() else (identity, np.zeros(len(light)), identity)
    r = int(np.sum(viscosity > SINGULAR * viscosity.max(initial=0.0)))
    U1, U0, W1, W0 = U[:, :r], U[:, r:], W[:r].T, W[r:].T
    if np.abs(Cr @ V0 @ W0).max(initial=0.0) > ABSENT * np.abs(Cr @ V0).max(initial=0.0):
        raise ArgumentError(
            "state_space: rates of motions without mass cause forces on other motions only; use "
            "descriptor() or frequency_response(omega)"
        )
    na, nu, nf = V1.shape[1], P.shape[1], F.shape[1]
    at = np.cumsum([0, na, r, na, nu, nu, nf, nu])
    a, damped, da, u, du, f, ddu = (np.eye(at[-1])[i:j] for i, j in pairwise(at))
    external = N.T @ (F @ f) + by_motions[0] @ u + by_motions[1] @ du + by_motions[2] @ ddu
    on_light = V0.T @ external
    # Round-off of forces on motions without mass would be an effect of rates of inputs.
    terms = np.abs(V0).T @ (np.abs(N).T @ (abs(F) @ f))
    on_light[(np.abs(on_light) <= ABSENT * terms) & (terms > 0.0)] = 0.0
    z = V1 @ a + V0 @ (W1 @ damped)
    stiffness = U0.T @ V0.T @ Kr @ V0 @ W0
    if stiffness.size:
        if np.linalg.cond(stiffness) > 1 / SINGULAR:
            free = N @ (V0 @ (W0 @ svd(stiffness)[2][-1]))
            raise ArgumentError(
                f"state_space: neither mass, damper nor stiffness determines {name_of(free)}"
            )
        z = z + V0 @ (W0 @ solve(stiffness, U0.T @ (on_light - V0.T @ (Kr @ z + Cr @ (V1 @ da)))))
    rate = (U1.T @ (on_light - V0.T @ (Kr @ z + Cr @ (V1 @ da)))) / viscosity[:r, None]
    dz = V1 @ da + V0 @ (W1 @ rate)
    dda = solve(V1.T @ Mr @ V1, V1.T @ (external - Kr @ z - Cr @ dz), assume_a="pos")
    y, velocity, acceleration = N @ z + P @ u, N @ dz + P @ du, N @ (V1 @ dda) + P @ ddu
    missed = F @ f - K @ y - (C @ velocity + M @ acceleration)
    for B, x in zip(moved, (u, du, ddu), strict=True):
        missed += B @ x
    rates, read = np.vstack([da, rate, dda, du, ddu]), np.vstack([read[:na], W1.T @ read[na:]])
    return Motion(int(at[5]), rates, y, u, read, P), missed


def constraint_forces(G: Array, forces: Array, sizes: Array) -> Array:
    """Return the least-squares solution λ of ``G λ = forces`` for dimensionless motions."""
    if not G.size:
        return np.zeros((G.shape[1], forces.shape[1]))
    scaled = sizes[:, None] * G
    lengths = np.linalg.norm(scaled, axis=0)
    λ = lstsq(scaled / lengths, sizes[:, None] * forces, lapack_driver="gelsy")[0]
    return np.asarray(λ / lengths[:, None])


def jumps(rows: csr_array, X: Array, terms: Array, states: int) -> Index:
    """Return (row, input) where an input enters ``rows @ X``, whose rate then needs its rate.

    ``terms`` are sums of magnitudes of the terms of X.
    """
    through = np.abs(rows @ X)[:, states:]
    sizes = (abs(rows) @ terms)[:, states:]
    return np.argwhere((through > ABSENT * sizes) & (through > 0.0))


# -- modal reduction -------------------------------------------------------------------------------


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
