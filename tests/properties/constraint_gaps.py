# SPDX-License-Identifier: MIT
"""What joints, motors, guides and supports of a solution promise, checked from positions alone."""

import math

import numpy as np
from scipy.optimize import minimize_scalar

from ufl_beam.model.bodies import Body
from ufl_beam.model.connector_laws import Guide, PrescribedMotion
from ufl_beam.model.functions import still
from ufl_beam.model.joints import Joint


def largest_gap(solution, size):
    """Largest distance from a promise over the size of the scene or in rad; whose promise it is."""
    gaps = [(0.0, "nobody")]
    for one in (*solution.scene.joints, *solution.scene.supports, *solution.scene.connectors):
        for moved, turned in _misses(solution, one):
            gap = max(np.abs(moved).max() / size, np.abs(turned).max())
            gaps.append((float(gap), str(one)))
    for body in solution.scene.bodies:
        gaps.append((_strain(solution, body, size), body.name))
    return max(gaps)


def _misses(solution, one):
    """Lengths and angles that should be zero at all times."""
    kind, zero = type(one).__name__, np.zeros(1)
    if hasattr(one, "held"):
        yield from _of_support(solution, one)
    elif isinstance(getattr(one, "law", None), PrescribedMotion):
        wanted = np.array([one.law.motion(t) for t in solution.times])
        miss = _relative(solution, one.motion, one.a, one.b, one.axis) - wanted
        yield (zero, miss) if one.is_rotation else (miss, zero)
    elif kind in ("Rigid", "Revolute"):
        a, *others = one.places
        for b in others:
            yield _apart(solution, a, b), _turn(solution, a, b) * (kind == "Rigid")
    elif kind == "Link":
        yield _relative(solution, "stretching", *one.places, None), zero
    elif kind == "RigidLink":
        a, b = one.places
        ways = [_relative(solution, "sliding", a, b, axis) for axis in ((1, 0), (0, 1))]
        yield np.hypot(*ways), _turn(solution, a, b)
    elif kind in ("Prismatic", "Release"):
        a, b = one.places
        for holder in one.holders:
            motion = holder.motion if holder.motion != "parting" else "sliding"
            yield _relative(solution, motion, a, b, holder.axis), zero
        if kind == "Release" and not one.holders:
            yield _apart(solution, a, b) * (0 in one.shared), zero
        yield zero, _turn(solution, a, b) * (2 in one.shared)
    elif kind == "Guided":
        yield _from_curve(solution, one.holders[0]), zero
    else:
        assert not isinstance(one, Joint), f"the gap of a {kind} is not written"


def _of_support(solution, support):
    moved = solution.displacement(support.place)
    cos, sin = math.cos(support.angle), math.sin(support.angle)
    u, v, ψ = moved.T
    in_axes = [cos * u + sin * v, cos * v - sin * u, ψ]
    for component, value in support.held.items():
        miss = in_axes[component]
        if support.moving and value != still:  # at the start nothing has moved yet
            miss = miss[1:] - [value(t) for t in solution.times[1:]]
        yield (np.zeros(1), miss) if component == 2 else (miss, np.zeros(1))


def _between(solution, a, b):
    """Growth of the difference of two displacements and rotations."""
    return solution.displacement(b) - solution.displacement(a)


def _turn(solution, a, b):
    return _between(solution, a, b)[:, 2]


def _apart(solution, a, b):
    return np.hypot(*_between(solution, a, b)[:, :2].T)


def _relative(solution, motion, a, b, axis):
    """A relative motion, from displacements; those of far points have digits of their own size."""
    start = np.subtract(b.point, a.point)
    between = start + _between(solution, a, b)[:, :2]
    if motion == "turning":
        return _turn(solution, a, b)
    if motion == "stretching":
        return np.hypot(*between.T) - np.hypot(*start)
    turn = solution.displacement(a)[:, 2]
    (x, y), cos, sin = axis, np.cos(turn), np.sin(turn)
    along = np.column_stack([cos * x - sin * y, sin * x + cos * y])
    return np.sum(along * between, axis=1) - np.dot(axis, start)


def _from_curve(solution, holder):
    """Distance of a place from its guide curve, sought on all sides of the last nearest point."""
    assert isinstance(holder.law, Guide)
    law, s, found = holder.law, 0.0, []

    def curve(parameter):
        return law.curve.at(parameter)[0]

    speed = np.hypot(*np.subtract(curve(1e-3), curve(-1e-3))) / 2e-3
    for x, y in solution.position(holder.b):
        way = (math.dist(curve(s), (x, y)) + solution.scene.size * 1e-2) / speed
        best = minimize_scalar(
            lambda p, x=x, y=y: (curve(p)[0] - x) ** 2 + (curve(p)[1] - y) ** 2,
            bounds=(s - 2 * way, s + 2 * way), method="bounded", options={"xatol": 1e-12 * way},
        )  # fmt: skip
        s = float(best.x)
        found.append(_distance(curve, s, (x, y), way))
    return np.array(found)


def _distance(curve, s, point, way):
    """Distance from the line through a curve near s; Brent's method finds s to half its digits."""
    ε = 1e-5 * way
    (ax, ay), (bx, by), (cx, cy) = curve(s - ε), curve(s + ε), curve(s)
    tx, ty = (bx - ax), (by - ay)
    return abs(tx * (point[1] - cy) - ty * (point[0] - cx)) / math.hypot(tx, ty)


def _strain(solution, body: Body, size):
    """Change of the distance of two points of a body, which is to be rigid."""
    (x, y), far = body.center, size / 3
    a, b = solution.position(body.at(x + far, y)), solution.position(body.at(x, y + far))
    return float(np.abs(np.hypot(*(a - b).T) - math.hypot(far, far)).max() / size)
