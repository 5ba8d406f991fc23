# SPDX-License-Identifier: MIT
"""Solution of the equation of a step: Newton's method, factorization, eigenvalues."""
