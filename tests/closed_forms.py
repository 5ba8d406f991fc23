# SPDX-License-Identifier: MIT
"""Answers in closed form that several tests compare with."""

import numpy as np
from scipy.optimize import brentq
from scipy.special import ellipe, ellipeinc, ellipk, ellipkinc

import ufl_beam as ub


def elastica(a):
    """(u, v, ψ) of the tip of a cantilever under the transverse dead load a, by elliptic integrals.

    Of unit length and stiffness, without axial and shear strains.  K. E. Bisshopp and D. C.
    Drucker, Quart. Appl. Math. 3 (1945) 272-275.
    """

    def modulus(θ):
        m = (1 + np.sin(θ)) / 2
        return m, np.arcsin(1 / np.sqrt(2 * m))

    def excess(θ):
        m, φ = modulus(θ)
        return ellipk(m) - ellipkinc(φ, m) - np.sqrt(a)

    θ = brentq(excess, 1e-9, np.pi / 2 - 1e-9, xtol=1e-15)
    m, φ = modulus(θ)
    v = 1 - 2 / np.sqrt(a) * (ellipe(m) - ellipeinc(φ, m))
    return np.array([np.sqrt(2 * np.sin(θ) / a) - 1, v, θ])


def buckled_column(α):
    """(P/P_cr, x/L, y/L) of the end of a column clamped at its foot, whose end turned by α.

    S. P. Timoshenko and J. M. Gere, Theory of Elastic Stability, 2nd ed. 1961, section 2.7.
    """
    m = np.sin(α / 2) ** 2
    K, E = ellipk(m), ellipe(m)
    return (2 * K / np.pi) ** 2, 2 * E / K - 1, 2 * np.sqrt(m) / K


def softened(law, opening):
    """Moment of `ub.Softening` or `ub.LinearSoftening` after an opening one way."""
    slope = law.limit / law.fracture_energy
    if isinstance(law, ub.LinearSoftening):
        return law.limit * np.maximum(1 - slope * opening / 2, 0.0)
    return law.limit * np.exp(-slope * opening)
