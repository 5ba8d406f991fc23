# SPDX-License-Identifier: MIT
"""Relative motions of two nodes in space, and their variation over a step, in UFL.

They correspond to :mod:`ufl_beam.mechanics.relative_motions`: each function returns the motion at
the end of the step, zero in the undeformed scene, and its variation.  A vector that is fixed in a
node changes in a step by s x its mean, with the Cayley vector s of the node.  All motions but
:func:`turning_in_space` and the length are bilinear in such vectors and in positions, so that
variations by means of both ends are exact increments.
"""

from __future__ import annotations

from copy import copy
from math import pi
from typing import Any, NamedTuple

import ufl
from ufl.core.expr import Expr

from ufl_beam.mechanics.spatial_kinematics import (
    Middle,
    Turn,
    Vector,
    add,
    conjugate,
    cross,
    dot,
    forces_over_step,
    product,
    scale,
    subtract,
    times,
    turned,
)
from ufl_beam.mechanics.time_scheme import Scheme, acts_at_end


class GeometryInSpace(NamedTuple):
    """Vectors (3,) that a relative motion depends on besides the nodes; m."""

    arm_a: Vector  # from node a to point a, undeformed
    arm_b: Vector  # from node b to point b, undeformed
    apart: Vector  # from point a to point b in the undeformed scene
    axis: Vector  # dimensionless unit vector
    other: Vector  # unit vector that is fixed in b
    whole: Any = 0.0  # whole turns about the axis before the step


class NodeInStep:
    """A node in a step.

    Attributes:
        u0, u1: Displacements before and after the step.
        turn: Rotation.
        w_u, w_θ: Virtual displacement and rotation.
    """

    def __init__(
        self, u0: Vector, u1: Vector, turn: Turn, w_u: Vector, w_m: Vector, scheme: Scheme
    ) -> None:
        self.u0, self.u1, self.turn, self.w_u = u0, u1, turn, w_u
        self._scheme, self._turned = scheme, (turned(turn.q0), turned(turn.q1))
        self.w_θ = turn.virtual_rotation(w_m)

    def changes(self, x: Vector) -> tuple[Vector, Vector]:
        """Return the change of a vector that is fixed in the node, before and after the step.

        Small rotations do not lose the digits that a difference of vectors would lose.
        """
        before, after = (times(rows, x) for rows in self._turned)
        return before, after

    def ends(self, x: Vector) -> tuple[Vector, Vector]:
        """Return a vector that is fixed in the node, before and after the step."""
        before, after = (add(x, change) for change in self.changes(x))
        return before, after

    def variation(self, arm: Vector) -> Vector:
        """Return the virtual displacement of a point of the node."""
        return add(self.w_u, cross(self.w_θ, average(self._scheme, *self.ends(arm))))


def average(scheme: Scheme, before: Vector, now: Vector) -> Vector:
    """Return the vector in the variations of a scheme."""
    return tuple(scheme.average(x, y) for x, y in zip(before, now, strict=True))


def _moved(a: NodeInStep, b: NodeInStep, n: GeometryInSpace) -> tuple[Vector, Vector]:
    """Return the displacements of point b relative to point a, before and after the step."""
    arms = zip(a.changes(n.arm_a), b.changes(n.arm_b), (a.u0, a.u1), (b.u0, b.u1), strict=True)
    before, now = (add(subtract(u_b, u_a), subtract(y, x)) for x, y, u_a, u_b in arms)
    return before, now


def _varied(a: NodeInStep, b: NodeInStep, n: GeometryInSpace) -> Vector:
    return subtract(b.variation(n.arm_b), a.variation(n.arm_a))


def parting_in_space(
    a: NodeInStep, b: NodeInStep, n: GeometryInSpace, scheme: Scheme
) -> tuple[Expr, Expr, Expr]:
    """Return the displacement of b relative to a along a fixed axis; m."""
    before, now = (dot(n.axis, d) for d in _moved(a, b, n))
    return before, now, dot(n.axis, _varied(a, b, n))


def stretching_in_space(
    a: NodeInStep, b: NodeInStep, n: GeometryInSpace, scheme: Scheme
) -> tuple[Expr, Expr, Expr]:
    """Return the growth of the distance between the points; m."""
    moved, length = _moved(a, b, n), ufl.sqrt(dot(n.apart, n.apart))
    ends = [add(n.apart, d) for d in moved]
    lengths = [ufl.sqrt(dot(d, d)) for d in ends]
    # (d·d - d0·d0) / (|d| + |d0|); a difference of lengths would lose digits
    before, now = (
        dot(add(d, n.apart), u) / (size + length)
        for d, u, size in zip(ends, moved, lengths, strict=True)
    )
    along = dot(average(scheme, *ends), _varied(a, b, n))
    return before, now, along / scheme.average(lengths[0], lengths[1])


def sliding_in_space(
    a: NodeInStep, b: NodeInStep, n: GeometryInSpace, scheme: Scheme
) -> tuple[Expr, Expr, Expr]:
    """Return the displacement of b from a along an axis that is fixed in a; m."""
    moved, changes = _moved(a, b, n), a.changes(n.axis)
    ends = [add(n.apart, d) for d in moved]
    before, now = (
        dot(n.axis, d) + dot(change, end)
        for d, change, end in zip(moved, changes, ends, strict=True)
    )
    axis, between = average(scheme, *a.ends(n.axis)), average(scheme, *ends)
    return before, now, dot(axis, _varied(a, b, n)) + dot(a.w_θ, cross(axis, between))


def aligning_in_space(
    a: NodeInStep, b: NodeInStep, n: GeometryInSpace, scheme: Scheme
) -> tuple[Expr, Expr, Expr]:
    """Return the change of the product of an axis that is fixed in a and another fixed in b."""
    others = b.ends(n.other)
    before, now = (
        dot(change, other) + dot(n.axis, of_other)
        for change, other, of_other in zip(
            a.changes(n.axis), others, b.changes(n.other), strict=True
        )
    )
    torque = cross(average(scheme, *a.ends(n.axis)), average(scheme, *others))
    return before, now, dot(subtract(a.w_θ, b.w_θ), torque)


def turning_in_space(
    a: NodeInStep, b: NodeInStep, n: GeometryInSpace, scheme: Scheme
) -> tuple[Expr, Expr, Expr]:
    """Return the component along an axis, fixed in a and b, of the rotation vector of b; rad.

    Whole turns are added.  The motion is infinite if the rest passes 360 degrees in the step, where
    the rotation vector is reversed.
    """
    turns, zero = (a.turn, _less_whole_turns(b, n)), (0.0, 0.0, 0.0)
    old, now = (Middle(_same, *(getattr(x, q) for x in turns)) for q in ("q0", "q1"))
    before, after = (
        dot(n.axis, middle.rotation_vector) + 2 * pi * n.whole for middle in (old, now)
    )
    valid = ufl.conditional(ufl.lt(dot(old.r[1:], now.r[1:]), 0.0), 0.0, 1.0)
    after /= ufl.conditional(ufl.lt(old.r[0] + now.r[0], 0.0), valid, 1.0)
    some = turns
    if acts_at_end(scheme):
        old, some = now, (turns[0].at_end, turns[1].at_end)
    _, of_a, of_b = forces_over_step(_same, some, (old, now), (zero, zero), 1.0, (zero, n.axis))
    return before, after, dot(of_a, a.w_θ) + dot(of_b, b.w_θ)


def _less_whole_turns(b: NodeInStep, n: GeometryInSpace) -> Any:
    """Return the rotation of b; its quaternions have the other sign after each whole turn."""
    turn, sign = copy(b.turn), ufl.cos(pi * n.whole)
    turn.q0, turn.q1 = scale(sign, turn.q0), scale(sign, turn.q1)
    return turn


ON_AXIS = 2e-12
"""Largest square of the sine of the angle between the axes of a rotation that may turn wholly."""


def whole_turns(a: NodeInStep, b: NodeInStep, n: GeometryInSpace) -> Expr:
    """Return the whole turns about the axis after the step; the rest is at most 180 degrees.

    They do not change if b turns about another axis.
    """
    r = product(conjugate(a.turn.q1), _less_whole_turns(b, n).q1)
    along, size = dot(n.axis, r[1:]), dot(r[1:], r[1:])
    way = ufl.conditional(ufl.gt(along, 0.0), 1.0, -1.0)
    on_axis = ufl.conditional(ufl.gt(along * along, (1 - ON_AXIS) * size), way, 0.0)
    return n.whole + ufl.conditional(ufl.lt(r[0], 0.0), on_axis, 0.0)


def _same(x: Expr) -> Expr:
    return x


SPATIAL_MOTIONS = {
    motion.__name__.removesuffix("_in_space") + " in space": motion
    for motion in (
        parting_in_space, stretching_in_space, sliding_in_space, aligning_in_space,
        turning_in_space,
    )
}  # fmt: skip
"""Relative motions in space by name."""

TURNING = "turning in space"
"""Motion that counts whole turns."""
