# SPDX-License-Identifier: MIT
"""The Hu-Washizu functional of beams with plastic hinges, and their kinetic energy, in UFL.

The fields on a mesh of straight two-node cells, as in the paper, are

* q = (u, ψ), the configuration, continuous and linear in a cell (P1);
* α, the jump of the rotation in a hinge in the middle of each cell, constant in a cell (DG0);
* r = (N, V, M), the resultants, constant in a cell, which P(33) eliminates from the functional;
* plastic strains and hardening variables, at the quadrature points.

Energies are densities along the undeformed axis, J/m; a function W maps the strains (Σ, Γ, K) of
the bulk to its free energy at given internal variables, P(35).  With :class:`Static`, weak forms
are derivatives of these functionals.  Other schemes replace the strains and variations in these
derivatives by their own, see :mod:`ufl_beam.mechanics.time_scheme`.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import ufl
from ufl.core.expr import Expr

from ufl_beam.mechanics.kinematics import Axis, split, strain

Energy = Callable[[Expr], Expr]
"""Free energy of the bulk per length, J/m, as a function of its strains, (3,)."""


def hu_washizu(W: Energy, q: Expr, D: Expr, r: Expr, axis: Axis) -> Expr:
    """Return the three-field functional, J/m; r enforces that the strains D equal strain(q)."""
    return W(D) + ufl.dot(r, strain(q, axis) - D)  # P(26)


def strain_by_jump(jump: Any, length: Any) -> Any:
    """Return the strain that a jump causes in the bulk of a cell, for UFL expressions and arrays.

    A jump α of the rotation adds α (H - N) to the rotation, with Heaviside's function H and a
    linear function N, P(69).  This curvature is the derivative of -α N; the derivative of α H acts
    in the hinge only.  The opening of a crack (m) unloads a fibre in the same way.
    """
    return -jump / length  # P(71)!


def incompatible(α: Expr, axis: Axis) -> Expr:
    """Return the strains (Σ, Γ, K) that a jump α of the rotation causes in the bulk."""
    return ufl.as_vector([0, 0, strain_by_jump(α, axis.h)])


def enhanced_strain(q: Expr, α: Expr, axis: Axis) -> Expr:
    """Return strains (Σ, Γ, K) of the bulk by the configuration and the jump; 1, 1, 1/m."""
    return strain(q, axis) + incompatible(α, axis)  # P(30)


def modified_functional(W: Energy, q: Expr, D: Expr, r: Expr, axis: Axis) -> Expr:
    """Return the functional, J/m, with strains D in addition to the strains of q."""
    return W(strain(q, axis) + D) - ufl.dot(r, D)  # P(31)


def potential(W: Energy, q: Expr, α: Expr, hinge: Expr, axis: Axis) -> Expr:
    """Return the potential as a function of configuration q and jumps α, P(49).

    ``hinge`` is the energy of each hinge (J).  Stress resultants are constant in a cell, so they do
    no work on the strains that a jump adds, P(33).  The derivative by q is the equilibrium of the
    beam, and the derivative by α is the equilibrium between the cell and its hinge, P(34).
    """
    return W(enhanced_strain(q, α, axis)) + hinge / axis.h


def elastic_energy(e: Expr, C: Expr) -> Expr:
    """Return the energy, J/m, of elastic strains e; stiffness C = (EA, GA, EI) in N, N, N m²."""
    return sum(C[i] * e[i] ** 2 for i in range(3)) / 2  # P(9)


def resultants(e: Expr, C: Expr) -> Expr:
    """Return (N, V, M) of elastic strains, the derivative of their energy; N, N, N m."""
    e = ufl.variable(e)
    return ufl.diff(elastic_energy(e, C), e)  # P(7)


def virtual_work(r: Expr, w_e: Expr) -> Expr:
    """Return the work of the resultants on virtual strains (w_Σ, w_Γ, w_K); J/m."""
    return ufl.dot(r, w_e)  # P(12)


def kinetic_energy(v: Expr, ρ: Expr) -> Expr:
    """Return the kinetic energy, J/m, of v = (du/dt, dψ/dt); ρ = (A_ρ, J_ρ) in kg/m, kg m."""
    v_u, ω = split(v)
    return (ρ[0] * ufl.dot(v_u, v_u) + ρ[1] * ω**2) / 2  # P(18)
