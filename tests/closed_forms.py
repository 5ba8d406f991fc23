# SPDX-License-Identifier: MIT
"""Answers in closed form that several tests compare with."""

import numpy as np
from scipy.optimize import brentq
from scipy.special import ellipe, ellipeinc, ellipk, ellipkinc


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
