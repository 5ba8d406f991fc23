# SPDX-License-Identifier: MIT
"""Strains of the Reissner beam and their algorithmic variation over a time step, in UFL.

Functions without state map configurations ``(u_x, u_y, ψ)`` to strains ``(Σ, Γ, K)`` on the mesh of
their arguments.  Symbols are as in the paper, see docs/notation.md; P(n) is its equation n.
"""

import math
from collections.abc import Iterable, Sequence
from itertools import accumulate, pairwise

import ufl
from ufl.core.expr import Expr

COMPONENTS = "x", "y", "rotation"
"""Components of the motion of a node: displacements (m) and rotation (rad)."""


class Axis:
    """Undeformed axis of the beams on a mesh of straight cells.

    Attributes:
        nodes: Positions of the nodes of configurations in a cell, from 0 to 1; ascending.
        X: Point of evaluation as a fraction of the length of the cell, 0 to 1; default: the middle.
        t0: Unit tangent of the cell, from its first to its last vertex; shape (2,).
        n0: Unit normal, ``t0`` turned by +90°; shape (2,).
        h: Length of the cell; m.
        x: Position of the point of evaluation in the plane; shape (2,); m.
    """

    def __init__(self, mesh: ufl.Mesh, nodes: Iterable[float] = (0.0, 1.0), X: Expr = 0.5) -> None:
        self.nodes, self.X = [float(a) for a in nodes], X
        J, self.x = ufl.Jacobian(mesh), ufl.SpatialCoordinate(mesh)
        self.h = ufl.sqrt(J[0, 0] ** 2 + J[1, 0] ** 2)
        self.t0 = ufl.as_vector([J[0, 0] / self.h, J[1, 0] / self.h])
        self.n0 = ufl.as_vector([-self.t0[1], self.t0[0]])

    def d(self, f: Expr) -> Expr:
        """Return the derivative along the axis, ``f' = grad(f)·t0``."""
        return ufl.dot(ufl.grad(f), self.t0)

    def at_nodes(self, f: Expr) -> list[Expr]:
        """Return nodal values of a scalar polynomial, by Taylor's series about the point ``X``."""
        terms = [f]
        for _ in self.nodes[1:]:
            terms.append(self.h * self.d(terms[-1]))
        return [
            sum(((a - self.X) ** k / math.factorial(k) * t for k, t in enumerate(terms)), 0)
            for a in self.nodes
        ]

    def interpolate(self, values: Sequence[Expr]) -> tuple[Expr, Expr]:
        """Return value and axial derivative of the Lagrange interpolation at ``X``."""
        X = ufl.variable(self.X)
        f = 0
        for a, value in zip(self.nodes, values, strict=True):
            weight = math.prod((X - b) / (a - b) for b in self.nodes if b != a)
            f += weight * value
        return f, ufl.diff(f, X) / self.h


def frame(ψ: Expr) -> tuple[Expr, Expr]:
    """Return (cos ψ - 1, sin ψ), both to the relative precision of ``ψ``, however small.

    The difference cos ψ - 1 itself would lose all digits of a small rotation.
    """
    half_sin, half_cos = ufl.sin(ψ / 2), ufl.cos(ψ / 2)
    return -2 * half_sin**2, 2 * half_sin * half_cos


def _pull_back(a: Expr, ψ: Expr, axis: Axis) -> tuple[Expr, Expr]:
    """Return Λᵀ a: components of the plane vector ``a`` in the frame (t0, n0) turned by ``ψ``."""
    along, across = ufl.dot(a, axis.t0), ufl.dot(a, axis.n0)
    cos_1, sin = frame(ψ)
    return along + cos_1 * along + sin * across, across + cos_1 * across - sin * along


def perpendicular(a: Expr) -> Expr:
    """Return W a, the plane vector ``a`` turned by +90°."""
    return ufl.as_vector([-a[1], a[0]])


def split(q: Expr) -> tuple[Expr, Expr]:
    """Return displacement (2,) and rotation of a configuration (3,)."""
    return ufl.as_vector([q[0], q[1]]), q[2]


def strain(q: Expr, axis: Axis) -> Expr:
    """Return Reissner's axial and shear strain and curvature (Σ, Γ, K), P(6), P(10); 1, 1, 1/m.

    The configuration ``q`` is (u_x, u_y, ψ), m and rad; the axis may have any initial direction.
    """
    u, ψ = split(q)
    Σ, Γ = _pull_back(axis.d(u), ψ, axis)
    cos_1, sin = frame(ψ)
    # Λᵀ t0 - e1 = (cos ψ - 1, -sin ψ), without differences that lose digits of small strains.
    return ufl.as_vector([Σ + cos_1, Γ - sin, axis.d(ψ)])  # P(6)


def virtual_strain(q: Expr, w: Expr, axis: Axis) -> Expr:
    """Return the variation of :func:`strain` at ``q`` along (w_u, w_ψ): P(21) times Λᵀ."""
    (u, ψ), (w_u, w_ψ) = split(q), split(w)
    w_Σ, w_Γ = _pull_back(axis.d(w_u) - perpendicular(axis.t0 + axis.d(u)) * w_ψ, ψ, axis)  # P(21)
    return ufl.as_vector([w_Σ, w_Γ, axis.d(w_ψ)])


SERIES = math.nextafter(1e-4, 1.0)
"""Square of an angle up to which a series has a remainder below 1e-18.

Both branches of a comparison with this number are equal: it is no switch for derivatives.
"""


def _sinc(x: Expr) -> Expr:
    """Return sin x / x, smooth at zero."""
    x2 = x**2
    series = 1 - x2 / 6 * (1 - x2 / 20 * (1 - x2 / 42))
    small = ufl.lt(x2, SERIES)
    return ufl.conditional(small, series, ufl.sin(x) / ufl.conditional(small, 1.0, x))


def over_tan(x: Expr) -> Expr:
    """Return x / tan x, smooth at zero."""
    return ufl.cos(x) / _sinc(x)


def virtual_strain_over_step(q0: Expr, q1: Expr, w: Expr, axis: Axis) -> Expr:
    """Return the algorithmic variation of the strain over a step, exact for energy and momentum.

    With ``w = (Δu, 2 tan(Δψ/2))`` at the nodes it is ``strain(q1) - strain(q0)`` to round-off, so
    the work of the algorithmic resultants is the increment of stored energy.  It vanishes if ``w``
    is a rigid rotation about any point, so angular momentum is conserved.  P(82) as printed has
    only the second property; its error is O(Δψ²), see docs/errata.md for the corrected form.

    Valid for ``|Δψ| < π``, on two-node cells with a one-point rule, on other cells with any rule.
    """
    (u0, ψ0), (u1, ψ1), (w_u, w_ψ) = split(q0), split(q1), split(w)
    rotation_over_step = _two_node_rotation if len(axis.nodes) == 2 else _nodal_rotation
    w_rotation, w_K = rotation_over_step(ψ0, ψ1, w_ψ, axis)
    φ_m = axis.t0 + axis.d((u0 + u1) / 2)
    a = axis.d(w_u) - perpendicular(φ_m) * w_rotation
    # The mean of both frames is cos δ times the frame of the mean rotation.
    along, across = ufl.dot(a, axis.t0), ufl.dot(a, axis.n0)
    (cos_0, sin_0), (cos_1, sin_1) = frame(ψ0), frame(ψ1)
    cos_m, sin_m = 1 + (cos_0 + cos_1) / 2, (sin_0 + sin_1) / 2
    w_Σ, w_Γ = cos_m * along + sin_m * across, cos_m * across - sin_m * along
    return ufl.as_vector([w_Σ, w_Γ, w_K])  # P(82)!


def _two_node_rotation(ψ0: Expr, ψ1: Expr, w: Expr, axis: Axis) -> tuple[Expr, Expr]:
    """Return :func:`_nodal_rotation` in the middle of a cell with two nodes: a shorter formula."""
    # The halves of the increments of rotation at the two nodes are δ - e and δ + e.
    e = axis.h / 4 * axis.d(ψ1 - ψ0)
    sinc_e, cos_e = _sinc(e), ufl.cos(e)
    tan_e = e * sinc_e / cos_e
    # The frames give all functions of 2 δ = ψ1 - ψ0.
    (cos_0, sin_0), (cos_1, sin_1) = ((1 + c, s) for c, s in map(frame, (ψ0, ψ1)))
    cos_δ_2 = (1 + cos_0 * cos_1 + sin_0 * sin_1) / 2
    tan_δ = (sin_1 * cos_0 - cos_1 * sin_0) / (2 * cos_δ_2)
    shift = -tan_δ * tan_e / 2
    stretch = (cos_δ_2 - (1 - cos_δ_2) * tan_e**2) * cos_e / sinc_e
    return w + shift * axis.h * axis.d(w), stretch * axis.d(w)


def _nodal_rotation(ψ0: Expr, ψ1: Expr, w: Expr, axis: Axis) -> tuple[Expr, Expr]:
    """Return virtual rotation and curvature at a point, see docs/errata.md.

    If w is 2 tan δ at the nodes, they are 2 tan δ and 2 δ'; if w is uniform, they are w and zero.
    """
    δ = (ψ1 - ψ0) / 2  # half of the increment of rotation
    nodes, virtual = axis.at_nodes(δ), axis.at_nodes(w)
    # Convert differences of 2 tan δ between neighbours to differences of 2 δ.
    steps = [
        ufl.cos(a) * ufl.cos(b) / _sinc(b - a) * (w_b - w_a)
        for (a, b), (w_a, w_b) in zip(pairwise(nodes), pairwise(virtual), strict=True)
    ]
    y, w_K = axis.interpolate([0, *accumulate(steps)])
    ends = ((nodes[0], virtual[0], y), (nodes[-1], virtual[-1], y - sum(steps, 0)))
    rotations = [w_a + y_a * _sinc(δ - a) / (ufl.cos(a) * ufl.cos(δ)) for a, w_a, y_a in ends]
    return sum(rotations, 0) / 2, w_K
