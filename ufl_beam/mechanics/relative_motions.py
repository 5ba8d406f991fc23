# SPDX-License-Identifier: MIT
"""Relative motions of two frames, and their variation over a time step, in UFL.

A frame is a configuration (u_x, u_y, ψ).  Each motion is stated once, as a value, which is zero in
the undeformed scene, and as a variation.  With the step of the nodes (Δu, 2 tan(Δψ/2)) in the place
of the virtual motions, the variation is the increment of the value: so what a joint holds does no
work, and what a spring is given it stores.  All variations vanish for rigid motions of both frames.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import NamedTuple

import ufl
from ufl.core.expr import Expr

from ufl_beam.mechanics.kinematics import frame, split, turn
from ufl_beam.mechanics.time_schemes import Scheme


class Numbers(NamedTuple):
    """Vectors (2,) that a relative motion depends on besides the frames; m."""

    arm_a: Expr  # from the node to the point a
    arm_b: Expr  # from the node to the point b
    apart: Expr  # from point a to point b in the undeformed scene
    axis: Expr  # unit vector


class Pair(NamedTuple):
    """Two frames, or two virtual motions of them; (3,) each."""

    a: Expr
    b: Expr


def _turned(x: Expr, ψ: Expr) -> Expr:
    """Λ(ψ) x."""
    return x + _by_turning(x, ψ)


def _by_turning(x: Expr, ψ: Expr) -> Expr:
    """(Λ(ψ) - 1) x, to the relative precision of ``ψ``."""
    cos_1, sin = frame(ψ)
    return cos_1 * x + sin * turn(x)


def _moved(q: Pair, n: Numbers) -> Expr:
    """Displacement of point b less that of point a."""
    (u_a, ψ_a), (u_b, ψ_b) = split(q.a), split(q.b)
    return u_b - u_a + _by_turning(n.arm_b, ψ_b) - _by_turning(n.arm_a, ψ_a)


def _between(q: Pair, n: Numbers) -> Expr:
    """Vector from point a to point b."""
    return n.apart + _moved(q, n)


def _virtually_between(q0: Pair, q1: Pair, w: Pair, n: Numbers, scheme: Scheme) -> Expr:
    """Variation of :func:`_between`."""

    def of_point(x0: Expr, x1: Expr, w: Expr, arm: Expr) -> Expr:
        w_u, w_ψ = split(w)
        return w_u + w_ψ * turn(scheme.average(_turned(arm, x0[2]), _turned(arm, x1[2])))

    return of_point(q0.b, q1.b, w.b, n.arm_b) - of_point(q0.a, q1.a, w.a, n.arm_a)


class Motion(NamedTuple):
    """A relative motion, m or rad; its variation is from the pairs at both ends of a step."""

    value: Callable[[Pair, Numbers], Expr]
    variation: Callable[[Pair, Pair, Pair, Numbers, Scheme], Expr]


def _turning(q: Pair, n: Numbers) -> Expr:
    return q.b[2] - q.a[2]


def _virtual_turning(q0: Pair, q1: Pair, w: Pair, n: Numbers, scheme: Scheme) -> Expr:
    turn_a, turn_b = (now[2] - before[2] for before, now in zip(q0, q1, strict=True))
    return scheme.virtual_turn(turn_a, turn_b, w.b[2] - w.a[2])


def _length(d: Expr) -> Expr:
    return ufl.sqrt(ufl.dot(d, d))


def _stretching(q: Pair, n: Numbers) -> Expr:
    # (d·d - d0·d0) / (|d| + |d0|) with d = d0 + moved; a difference of lengths would lose digits.
    moved = _moved(q, n)
    return ufl.dot(n.apart + n.apart + moved, moved) / (_length(_between(q, n)) + _length(n.apart))


def _virtual_stretching(q0: Pair, q1: Pair, w: Pair, n: Numbers, scheme: Scheme) -> Expr:
    before, now = _between(q0, n), _between(q1, n)
    along = scheme.average(before, now) / scheme.average(_length(before), _length(now))
    return ufl.dot(along, _virtually_between(q0, q1, w, n, scheme))


def _parting(q: Pair, n: Numbers) -> Expr:
    return ufl.dot(n.axis, _moved(q, n))


def _virtual_parting(q0: Pair, q1: Pair, w: Pair, n: Numbers, scheme: Scheme) -> Expr:
    return ufl.dot(n.axis, _virtually_between(q0, q1, w, n, scheme))


def _sliding(q: Pair, n: Numbers) -> Expr:
    by_turning = _by_turning(n.axis, q.a[2])
    return ufl.dot(by_turning, _between(q, n)) + ufl.dot(n.axis, _moved(q, n))


def _virtual_sliding(q0: Pair, q1: Pair, w: Pair, n: Numbers, scheme: Scheme) -> Expr:
    axis = scheme.average(_turned(n.axis, q0.a[2]), _turned(n.axis, q1.a[2]))
    between = scheme.average(_between(q0, n), _between(q1, n))
    virtual = _virtually_between(q0, q1, w, n, scheme)
    return ufl.dot(axis, virtual) + w.a[2] * ufl.dot(turn(axis), between)


MOTIONS = {
    "turning": Motion(_turning, _virtual_turning),
    "stretching": Motion(_stretching, _virtual_stretching),
    "parting": Motion(_parting, _virtual_parting),
    "sliding": Motion(_sliding, _virtual_sliding),
}
"""Rotation of b relative to a; distance of the points; their way along an axis of the plane; and
along an axis that turns with a."""
