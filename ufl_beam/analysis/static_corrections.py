# SPDX-License-Identifier: MIT
"""Corrections of modal reduction: static contributions of the modes that are left out."""

from __future__ import annotations

from collections.abc import Callable
from typing import NamedTuple

import numpy as np
from scipy.sparse import block_array, csc_array, csr_array, eye_array, hstack
from scipy.sparse.linalg import splu

from ufl_beam.arrays import Array, Complex, Index
from ufl_beam.errors import ArgumentError
from ufl_beam.solvers.eigensolvers import ROUND_OFF

SOFTNESS = 1e-10  # of constraints, as a fraction of the largest stiffness
FOLLOWS = 1e-3  # change of a motion without mass by a damper, as a fraction, that is left out


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


class Corrections(NamedTuple):
    """Static outputs that a reduced model lacks, for its inputs and rates.

    Attributes:
        inputs: For unit forces, then for unit accelerations u''; (num_outputs, num_inputs).
        rates: For unit rates of the coordinates; (num_outputs, number of coordinates).
        prescribed: For unit rates u'; (num_outputs, number of u).
    """

    inputs: Array
    rates: Array
    prescribed: Array


def motions_of_dampers(
    equations: Equations, x: Array, omega: Array, P: Array, lengths: Array
) -> Array:
    """Return motions without mass in which dampers change the modes x, or P; (size, number).

    In a mode, a part without mass follows the others as in statics.  A damper on such a part, as
    one in series with a spring, makes it lag behind.  The result is a basis of these lags.

    Args:
        equations: Equations of small motions.
        x: Modes, in columns.
        omega: Frequencies at which to compare lags with modes; rad/s.
        P: Static motions for unit u.
        lengths: Size of the scene for displacements, 1 for rotations, of the free rows.
    """
    M, C, K, _, (_, B1, _), y = equations
    light = y[M.diagonal()[y] == 0.0]
    size, none = len(x), np.zeros((len(x), 0))
    if not C[light].nnz:
        return none
    sizes = lengths[M.diagonal()[y] == 0.0]
    forces = np.hstack([C[light] @ x, C[light] @ P - B1[light].toarray()])
    terms = np.hstack([abs(C[light]) @ np.abs(x), abs(C[light]) @ np.abs(P) + abs(B1[light])])
    forces[np.abs(forces) <= 1e6 * ROUND_OFF * terms] = 0.0
    if not forces.any():
        return none
    constraints = np.setdiff1d(np.arange(size), y)
    J = K[constraints][:, light]
    J = J[np.flatnonzero(abs(J).sum(axis=1))]
    stiffness = K[light][:, light] + C[light][:, light] * omega.min()
    # Constraints may be redundant among these motions; a small flexibility of theirs is harmless.
    soft = eye_array(J.shape[0]) * (-SOFTNESS * abs(K).max())
    system = csc_array(block_array([[stiffness, J.T], [J, soft]]) if J.shape[0] else stiffness)
    rest = np.vstack([forces, np.zeros((J.shape[0], forces.shape[1]))])
    try:
        lags = splu(system).solve(rest)[: len(light)] / sizes[:, None]
    except RuntimeError:
        raise ArgumentError(
            "reduced: neither mass, damper nor stiffness determines some motion; state_space() "
            "names it"
        ) from None
    lags *= np.append(omega, np.full(P.shape[1], omega.max()))
    both = np.hstack([x, P])[y] / lengths[:, None]
    U, values, _ = np.linalg.svd(lags / np.abs(both).max(axis=0), full_matrices=False)
    chosen = U[:, values > FOLLOWS]
    v = np.zeros((size, chosen.shape[1]))
    v[light] = chosen * sizes[:, None]
    return v


def corrections(
    equations: Equations, basis: Array, P: Array, stiffness: Array,
    outputs: Callable[[Complex, complex], Complex], s: float,
) -> Corrections:  # fmt: skip
    """Return the static outputs that motions ``basis q + P u`` lack, by differences at slow inputs.

    The rates of q and u exert forces of dampers, to which motions outside the basis respond, too.
    The missing outputs are R0 + O(s) for forces, and R1/s + R0 + O(s) for accelerations u''.  At
    s = iω the real part of R0 + O(s) is R0 + O(ω²); two frequencies eliminate the term ω².

    Args:
        equations: Equations of small motions.
        basis: Modes and other motions, in columns, with forces of constraints.
        P: Static motions for unit u.
        stiffness: Stiffness of the basis.
        outputs: Function of unknowns in columns and of s that returns outputs for ``exp(s t)``.
        s: Frequency ω; rad/s.
    """
    M, C, K, F, (_, B1, B2), y = equations
    constraints = np.setdiff1d(np.arange(len(basis)), y)
    N, nf, nq = basis[y], F.shape[1], basis.shape[1]
    by_rates = np.zeros(basis.shape)
    by_rates[y] = -(C[y][:, y] @ N)
    forces = hstack([F, csr_array(by_rates)]).toarray()
    missing, q = list[Complex](), list[Complex]()
    for z in (1j * s, 2j * s):
        A = csr_array(K + z * C + z**2 * M)
        # Apart from P u, because K P = B0 without round-off
        moved = (B1 - C @ P) / z + (B2 - M @ P)
        moved[constraints] = 0.0
        loads = np.hstack([forces, moved]).astype(complex)
        dynamic = stiffness + z * (N.T @ (C[y][:, y] @ N)) + z**2 * (N.T @ (M[y][:, y] @ N))
        q.append(np.linalg.solve(dynamic, N.T @ loads[y]))
        missing.append(outputs(splu(csc_array(A)).solve(loads) - basis @ q[-1], z))
    by_forces = _limit(*missing)[:, : nf + nq]
    for_rates = by_forces[:, nf:]
    # The rates of q, which u' causes, have their own correction.
    by_motions = [
        (Y - z * (for_rates @ x))[:, nf + nq :]
        for Y, x, z in zip(missing, q, (1j * s, 2j * s), strict=True)
    ]
    inputs = np.hstack([by_forces[:, :nf], _limit(*by_motions)])
    rising = _limit(1j * s * by_motions[0], 2j * s * by_motions[1])
    return Corrections(inputs, for_rates, rising)


def _limit(at_s: Complex, at_2s: Complex) -> Array:
    """Return the real part at s = 0, from values at s and 2 s, if it is even in s."""
    return np.asarray((4 * at_s - at_2s).real / 3)
