# SPDX-License-Identifier: MIT
"""Kinematics of spatial beams: frames of nodes, strains of cells, and their exact increments.

Vectors and quaternions (real part first) are tuples of scalars in UFL.  A node has a unit
quaternion q, which is 1 in the undeformed scene.  In a step it turns to q (1, m/2)/|.|, with the
Cayley vector m = 2 tan(θ/2) n in axes of the node.  The rotations in a step are exact: directors
are linear in them, so that energy and momenta are conserved.  If the equation of a step holds at
its end, m is the conformal rotation vector 4 tan(θ/4) n instead, which turns by any angle.

The frame of a cell is the middle between the frames of its two nodes.  The strains are Λᵀ φ' - t,
with the frame Λ and the slope φ' of the axis, and the rotation vector between the nodes over the
length of the cell.  They depend on the configuration only, see M. A. Crisfield and G. Jelenić,
Proceedings of the Royal Society A 455 (1999).  The virtual strains over a step follow from the
rotations of the nodes such that their increments are exact: then the work of the resultants is
the change of energy.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from math import factorial
from types import SimpleNamespace
from typing import Any

import ufl
from ufl.core.expr import Expr

Vector = tuple[Any, ...]

SERIES = [4.0**k * factorial(k) ** 2 / factorial(2 * k + 1) for k in range(10)]
"""Coefficients of φ/sin φ in powers of sin²(φ/2)."""


def add(a: Vector, b: Vector) -> Vector:
    """Return the sum of two vectors."""
    return tuple(x + y for x, y in zip(a, b, strict=True))


def subtract(a: Vector, b: Vector) -> Vector:
    """Return the difference of two vectors."""
    return tuple(x - y for x, y in zip(a, b, strict=True))


def scale(k: Any, a: Vector) -> Vector:
    """Return the product of a number and a vector."""
    return tuple(k * x for x in a)


def mean(a: Vector, b: Vector) -> Vector:
    """Return the mean of two vectors."""
    return scale(0.5, add(a, b))


def dot(a: Vector, b: Vector) -> Any:
    """Return the scalar product of two vectors."""
    return sum((x * y for x, y in zip(a[1:], b[1:], strict=True)), a[0] * b[0])


def cross(a: Vector, b: Vector) -> Vector:
    """Return the vector product of two vectors."""
    return (a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0])


def product(p: Vector, q: Vector) -> Vector:
    """Return the product of two quaternions."""
    vector = add(add(scale(p[0], q[1:]), scale(q[0], p[1:])), cross(p[1:], q[1:]))
    return (p[0] * q[0] - dot(p[1:], q[1:]), *vector)


def conjugate(q: Vector) -> Vector:
    """Return the conjugate of a quaternion."""
    return (q[0], -q[1], -q[2], -q[3])


def turned(q: Vector) -> tuple[Vector, Vector, Vector]:
    """Return the rows of the rotation matrix of a unit quaternion, minus the unit matrix."""
    r, x, y, z = q
    return (
        (-2 * (y * y + z * z), 2 * (x * y - r * z), 2 * (x * z + r * y)),
        (2 * (x * y + r * z), -2 * (x * x + z * z), 2 * (y * z - r * x)),
        (2 * (x * z - r * y), 2 * (y * z + r * x), -2 * (x * x + y * y)),
    )


def _plus_one(rows: Sequence[Vector]) -> tuple[Vector, ...]:
    return tuple(
        tuple(x + 1 if i == j else x for j, x in enumerate(row)) for i, row in enumerate(rows)
    )


def matrix(q: Vector) -> tuple[Vector, ...]:
    """Return the rows of the rotation matrix of a unit quaternion."""
    return _plus_one(turned(q))


def times(R: Sequence[Vector], a: Vector) -> Vector:
    """Return the product of a matrix and a vector."""
    return tuple(dot(row, a) for row in R)


def transposed_times(R: Sequence[Vector], a: Vector) -> Vector:
    """Return the product of a transposed matrix and a vector."""
    return tuple(sum(R[i][j] * a[i] for i in range(3)) for j in range(3))


def between(stage: Callable[[Any], Any], q0: Vector, q1: Vector, fraction: float = 0.5) -> Vector:
    """Return a rotation between two unit quaternions; the angle of the middle is exact."""
    q = add(scale(1.0 - fraction, q0), scale(fraction, q1))
    return scale(stage(1 / ufl.sqrt(dot(q, q))), q)


FLIPPED = 32
"""Added to a conformal rotation vector where the quaternion has the other sign, see newton.c."""


def beyond(x: Any, limit: float) -> Any:
    """Return 1 for numbers above the limit, -1 for numbers below -limit, else 0."""
    some = [ufl.conditional(ufl.gt(way * x, limit), 1.0, 0.0) for way in (1, -1)]
    return some[0] - some[1]


class Turn:
    """Rotation of a node in a step.

    Attributes:
        m: Cayley vector in axes of the node, or conformal rotation vector ``at_end`` of the step.
        q0, q1: Quaternions before and after the step.
        c: Cosine of half the angle, not ``at_end``.
        s: Cayley vector in axes of the scene.
        frame: Rotation matrix before the step, by which virtual rotations turn.
    """

    def __init__(
        self, stage: Callable[[Any], Any], m: Vector, q0: Vector, *, at_end: bool = False
    ) -> None:
        self.m, self.q0, self.frame = m, q0, matrix(q0)
        if at_end:
            flips = beyond(m[0], FLIPPED / 2)
            p = scale(0.25, (m[0] - FLIPPED * flips, *m[1:]))
            c = stage((1 - 2 * abs(flips)) / (1 + dot(p, p)))
            q1 = product(q0, (c * (1 - dot(p, p)), *scale(2 * c, p)))
            self.q1 = tuple(map(stage, q1))
        else:
            v = scale(0.5, m)
            self.c = stage(1 / ufl.sqrt(1 + dot(v, v)))
            self.q1 = tuple(stage(self.c * x) for x in product(q0, (ufl.as_ufl(1.0), *v)))
        self.s = tuple(map(stage, times(self.frame, m)))

    @property
    def normal(self) -> Vector:
        """The quaternion after the step without round-off of its length."""
        return scale(1.5 - 0.5 * dot(self.q1, self.q1), self.q1)

    @property
    def at_end(self) -> Any:
        """The node at the end of the step, as a step without rotation."""
        none = ufl.as_ufl(0.0)
        return SimpleNamespace(q0=self.q1, q1=self.q1, c=ufl.as_ufl(1.0), s=(none, none, none))

    def virtual_rotation(self, w: Vector) -> Vector:
        """Return the virtual rotation in axes of the scene, from one in axes of the node before."""
        return times(self.frame, w)

    def on_node(self, moment: Vector) -> Vector:
        """Return a moment in axes of the node before the step."""
        return transposed_times(self.frame, moment)


class Middle:
    """Frame and rotation vector of a cell at one end of a step.

    Attributes:
        r: Relative rotation of the nodes as a quaternion, in axes of either.
        turned, frame: Rotation matrix of the middle minus the unit matrix, and the matrix.
        κ, λ, y: Cosines of a quarter and an eighth of the angle Θ between the nodes; sin²(Θ/16).
        g: Θ / sin(Θ/2).
    """

    def __init__(self, stage: Callable[[Any], Any], q1: Vector, q2: Vector) -> None:
        self.q1, self.q2 = q1, q2
        self.r = tuple(map(stage, product(conjugate(q1), q2)))
        self.κ = stage(ufl.sqrt((1 + self.r[0]) / 2))
        self.λ = stage(ufl.sqrt((1 + self.κ) / 2))
        self.y = stage((1 - self.λ) / 2)
        half = tuple(map(stage, scale(1 / (2 * self.κ), add(q1, q2))))
        self.turned = tuple(tuple(map(stage, row)) for row in turned(half))
        self.frame = _plus_one(self.turned)
        series = SERIES[-1]
        for c in reversed(SERIES[:-1]):
            series = series * self.y + c
        self.g = stage(2 * series / (self.κ * self.λ))

    @property
    def rotation_vector(self) -> Vector:
        """Rotation vector between the nodes: curvature times the length of the cell."""
        return scale(self.g, self.r[1:])


def _divided(y0: Expr, y1: Expr) -> tuple[Any, Any, Any]:
    """Return the series at both arguments, and its divided difference, without division."""
    a, b, slope = SERIES[-1], SERIES[-1], 0.0
    for c in reversed(SERIES[:-1]):
        slope = slope * y1 + a
        a, b = a * y0 + c, b * y1 + c
    return a, b, slope


def below_a_turn(turns: Sequence[Turn]) -> Expr:
    """Return 1, or NaN in a step through 360° between two nodes, where rotation vectors leap.

    The sum of the quaternions is zero there, and has the opposite direction afterwards.
    """
    before, after = (add(*(getattr(x, q) for x in turns)) for q in ("q0", "q1"))
    return ufl.sqrt(ufl.conditional(ufl.lt(dot(before, after), 0.0), -1.0, 1.0))


def forces_over_step(
    stage: Callable[[Any], Any], turns: Sequence[Turn], ends: tuple[Middle, Middle],
    tangents: Sequence[Vector], length: Expr, resultants: Sequence[Sequence[Any]],
) -> tuple[Vector, Vector, Vector]:  # fmt: skip
    """Return what resultants exert over a step: force on φ', and moments on both nodes.

    Args:
        stage: Function that makes an expression an intermediate number.
        turns: Rotations of both nodes.
        ends: The cell before and after the step.
        tangents: Slopes φ' before and after the step.
        length: Length of the cell.
        resultants: Forces and moments in axes of the cell.
    """

    def stages(x: Vector) -> Vector:
        return tuple(map(stage, x))

    (A, B), (old, now), (n, m), h = turns, ends, map(tuple, resultants), length
    N = stages(mean(times(old.frame, n), times(now.frame, n)))
    μ = stages(cross(N, mean(*tangents)))
    s, d = stages(mean(A.s, B.s)), stages(scale(0.5, subtract(B.s, A.s)))
    γ1, γ2 = stages((A.c / (1 + A.c), B.c / (1 + B.c)))
    σ = stage(1 / (A.c + B.c))
    G, γγ, cc = stages((γ1 + γ2, γ1 * γ2, A.c * B.c))
    k = stage(cc * cc * σ)
    k_ = stage(k / ((1 + A.c) * (1 + B.c)))
    # Means of the quaternions over the step
    q1, q2 = stages(mean(A.q0, A.q1)), stages(mean(B.q0, B.q1))
    y = stages(product(q2, conjugate(q1)))
    over = stage(below_a_turn(turns) / dot(add(A.q0, B.q0), add(A.q1, B.q1)))
    # Factors of the virtual rotation in the virtual rotation vector
    P0, P1, Q = _divided(old.y, now.y)
    o0, o1 = 1 / (old.κ * old.λ), stage(1 / (now.κ * now.λ))
    dκ = stage(1 / (2 * (old.κ + now.κ)))
    dλ = stage(dκ / (2 * (old.λ + now.λ)))
    dp = (old.λ + now.λ) / 2 * dκ + (old.κ + now.κ) / 2 * dλ
    α = stage(-(o0 + o1) / 2 * Q * dλ - (P0 + P1) * dp * (o0 * o1))
    g = stage(P0 * o0 + P1 * o1)
    p = stages((α * dot(m, mean(old.r[1:], now.r[1:])), *scale(g, m)))
    between = stages(product(product(q1, p), conjugate(q2))[1:])
    oμ = stages(scale(2 * h * over, μ))
    ζ = stages(add(between, cross(y[1:], oμ)))
    sd, sμ, sζ = stages((dot(s, d), dot(s, oμ), dot(s, ζ)))
    X = stage((k / 2 + y[0] * k_) * sd)
    Y, Z, q = stages((γγ / 2 * sμ, k_ * sζ, (cc * σ) ** 2 * sd))
    last = stages(subtract(scale(y[0], subtract(d, scale(q, s))), cross(y[1:], s)))
    a = subtract(scale(G, ζ), scale(Z, s))
    a = stages(scale(0.5, subtract(subtract(a, scale(X, oμ)), scale(Y, last))))
    hμ = stages(scale(h / 2, μ))
    return N, subtract(hμ, a), add(hμ, a)
