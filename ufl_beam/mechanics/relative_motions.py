# SPDX-License-Identifier: MIT
"""Relative motions of two frames, and their variation over a step, in UFL.

A frame is a configuration (u_x, u_y, ψ).  Each motion has a function of the frames at both ends of
a step and of virtual motions of the frames.  The function returns the motion at the end, which is
zero in the undeformed scene, and the variation of the motion.  In schemes derived from
:class:`EnergyMomentumBase` the variation for the nodal step (Δu, 2 tan(Δψ/2)) is the increment of
the motion.  So constraint forces do no work, and springs store the work done on them.  Variations
vanish for rigid virtual motions of both frames; the variation of :func:`parting` vanishes only if
the points coincide.
"""

from __future__ import annotations

from typing import NamedTuple

import ufl
from ufl.core.expr import Expr

from ufl_beam.mechanics.kinematics import frame, perpendicular, split
from ufl_beam.mechanics.time_scheme import Scheme


class Geometry(NamedTuple):
    """Vectors (2,) that a relative motion depends on besides the frames; m."""

    arm_a: Expr  # from the node of frame a to point a, undeformed
    arm_b: Expr  # from the node of frame b to point b, undeformed
    apart: Expr  # from point a to point b in the undeformed scene
    axis: Expr  # dimensionless unit vector


class Pair(NamedTuple):
    """Two frames, or two virtual motions of them; (3,) each."""

    a: Expr
    b: Expr


def _turned(x: Expr, ψ: Expr) -> Expr:
    """Return Λ(ψ) x."""
    return x + by_turning(x, ψ)


def by_turning(x: Expr, ψ: Expr) -> Expr:
    """Return (Λ(ψ) - 1) x, to the relative precision of ``ψ``."""
    cos_1, sin = frame(ψ)
    return cos_1 * x + sin * perpendicular(x)


def _moved(q: Pair, n: Geometry) -> Expr:
    """Return the displacement of point b relative to point a."""
    (u_a, ψ_a), (u_b, ψ_b) = split(q.a), split(q.b)
    return u_b - u_a + by_turning(n.arm_b, ψ_b) - by_turning(n.arm_a, ψ_a)


def _between(q: Pair, n: Geometry) -> Expr:
    """Return the vector from point a to point b."""
    return n.apart + _moved(q, n)


def virtual_displacement(q0: Expr, q1: Expr, w: Expr, arm: Expr, scheme: Scheme) -> Expr:
    """Return the variation of the displacement of a point with an arm from the node of a frame."""
    w_u, w_ψ = split(w)
    return w_u + w_ψ * perpendicular(scheme.average(_turned(arm, q0[2]), _turned(arm, q1[2])))


def _virtually_between(q0: Pair, q1: Pair, w: Pair, n: Geometry, scheme: Scheme) -> Expr:
    """Return the variation of :func:`_between`."""
    of_b = virtual_displacement(q0.b, q1.b, w.b, n.arm_b, scheme)
    return of_b - virtual_displacement(q0.a, q1.a, w.a, n.arm_a, scheme)


def _length(d: Expr) -> Expr:
    return ufl.sqrt(ufl.dot(d, d))


def turning(q0: Pair, q1: Pair, w: Pair, n: Geometry, scheme: Scheme) -> tuple[Expr, Expr]:
    """Return the rotation of b relative to a, and its variation; rad."""
    rotation_a, rotation_b = (now[2] - before[2] for before, now in zip(q0, q1, strict=True))
    return q1.b[2] - q1.a[2], scheme.virtual_rotation(rotation_a, rotation_b, w.b[2] - w.a[2])


def stretching(q0: Pair, q1: Pair, w: Pair, n: Geometry, scheme: Scheme) -> tuple[Expr, Expr]:
    """Return the growth of the distance between the points, and its variation; m."""
    # (d·d - d0·d0) / (|d| + |d0|) with d = d0 + moved; a difference of lengths would lose digits.
    moved, before, now = _moved(q1, n), _between(q0, n), _between(q1, n)
    value = ufl.dot(n.apart + n.apart + moved, moved) / (_length(now) + _length(n.apart))
    along = scheme.average(before, now) / scheme.average(_length(before), _length(now))
    return value, ufl.dot(along, _virtually_between(q0, q1, w, n, scheme))


def parting(q0: Pair, q1: Pair, w: Pair, n: Geometry, scheme: Scheme) -> tuple[Expr, Expr]:
    """Return the displacement of b relative to a along a fixed axis, and its variation; m."""
    virtual = _virtually_between(q0, q1, w, n, scheme)
    return ufl.dot(n.axis, _moved(q1, n)), ufl.dot(n.axis, virtual)


def sliding(q0: Pair, q1: Pair, w: Pair, n: Geometry, scheme: Scheme) -> tuple[Expr, Expr]:
    """Return the displacement of b from a along an axis that turns with a, and its variation; m."""
    change = by_turning(n.axis, q1.a[2])
    value = ufl.dot(change, _between(q1, n)) + ufl.dot(n.axis, _moved(q1, n))
    axis = scheme.average(_turned(n.axis, q0.a[2]), _turned(n.axis, q1.a[2]))
    between = scheme.average(_between(q0, n), _between(q1, n))
    virtual = _virtually_between(q0, q1, w, n, scheme)
    return value, ufl.dot(axis, virtual) + w.a[2] * ufl.dot(perpendicular(axis), between)


MOTIONS = {motion.__name__: motion for motion in (turning, stretching, parting, sliding)}
"""Relative motions by name."""
