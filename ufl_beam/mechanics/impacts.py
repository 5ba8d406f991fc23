# SPDX-License-Identifier: MIT
"""Plastic impacts: velocities that a new constraint, or a jump of a prescribed rate, contradicts.

Velocities change by the least kinetic energy that satisfies the constraints.  The impulse of a
constraint does the work of the rate after the impact; the kinetic energy of the change of the
velocities is lost (theorem of Carnot).
"""

from __future__ import annotations

import math
from bisect import bisect_right

import numpy as np

from ufl_beam.arrays import Array
from ufl_beam.model.connector_laws import RIGID, PrescribedMotion
from ufl_beam.model.functions import WEIGHTS, Constant, Table, TimeFunction
from ufl_beam.model.scene import Scene

PARTS = 8
"""Number of parts of a step in which a function is sampled to find a kink."""

UNEVEN = 16.0
"""Ratio of the largest second difference to the third smallest one that shows a kink."""

ROUND_OFF, STEP_ERROR = 1e-6, 1e-3
"""Largest velocities along a constraint that do not contradict it: relative to all velocities, and
within a run relative to the rate of the constraint."""

Excess = tuple[Array, float]
"""Momentum and kinetic energy (J) before an impact in addition to those of the velocities: of parts
with different velocities that begin to share an unknown."""


def motion_of(law: object) -> TimeFunction | None:
    """Return the motion that the law of a motor prescribes; None for other laws."""
    return law.motion if isinstance(law, PrescribedMotion) and law is not RIGID else None


def motions_of(scene: Scene) -> list[TimeFunction]:
    """Return the motions that the supports and motors of a scene prescribe."""
    motions = [motion_of(connector.law) for connector in scene.all_connectors]
    motions += [motion for support in scene.supports for motion in support.moving.values()]
    return [motion for motion in motions if motion is not None]


def rate_after(f: TimeFunction | None, t: float, longest: float) -> tuple[float, float]:
    """Return the right derivative of ``f`` at ``t``, and the largest mean rate soon after ``t``.

    One-sided differences of fourth order with shorter and shorter steps are compared; those that
    differ least are the result.  The steps are powers of two, so that times are exact.
    """
    rates, largest = [0.0], 0.0
    first = 2.0 ** math.floor(math.log2(min(longest, 2.0**-8)))
    for h in (first / 4**k for k in range(10) if f is not None and first / 4**k > 16 * math.ulp(t)):
        try:
            values = [float(f(t + i * h)) for i in range(5)]  # type: ignore[misc]
        except Exception:  # a function of a user may end soon after t
            continue
        if all(map(math.isfinite, values)):
            rates.append(float(WEIGHTS[0] @ values) / h)
            largest = max(largest, *(abs(x - values[0]) / h for x in values))
    changes = np.abs(np.diff(rates[1:]))
    return rates[2 + int(np.argmin(changes))] if len(changes) else rates[-1], largest


def next_kink(f: TimeFunction | None, t: float) -> float:
    """Return the first time after ``t`` at which the rate of ``f`` may jump; -inf if unknown."""
    if isinstance(f, Table):
        return next(iter(f.times[bisect_right(f.times, t) :]), math.inf)
    return math.inf if f is None or isinstance(f, Constant) else -math.inf


def may_jump(f: TimeFunction | None, t0: float, t1: float) -> bool:
    """Return whether the rate of ``f`` may jump between ``t0``, excluded, and ``t1``, included."""
    h = (t1 - t0) / PARTS
    if f is None or (kink := next_kink(f, t0 + 1e-8 * h)) != -math.inf:
        return f is not None and kink <= t1 + 1e-8 * h
    try:
        values = [float(f(t0 + i * h)) for i in range(PARTS)] + [float(f(t1)), float(f(t1 + h))]
    except Exception:  # a function of a user may end soon after t1
        return False
    second = sorted(np.abs(np.diff(values, 2)).tolist())
    return bool(second[-1] > UNEVEN * second[2] + 16 * math.ulp(max(map(abs, values))))
