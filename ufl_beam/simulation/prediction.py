# SPDX-License-Identifier: MIT
"""Prediction of the end of a step, from which Newton's method starts; see docs/steps.md."""

from __future__ import annotations

import math

import numpy as np

from ufl_beam.arrays import Array
from ufl_beam.compiled.c_library import doubles, fill, lib, struct
from ufl_beam.discretization.partition import Share
from ufl_beam.discretization.state_io import Memory


class Prediction:
    """Goes on as the last steps did: at their velocity and, ``in_motion``, with their acceleration.

    After steps of equal length, a part of the last second difference of the configuration is added:
    that which the one before was like.  It is 1 in smooth motion, and 0 where second differences
    change their sign from step to step, or where steps do not resolve the motion.

    Args:
        weights: Of residuals, see :class:`Equation`.

    Attributes:
        c: ``prediction`` of loops.h.
        q_before: Configuration at the beginning of the last step.
    """

    def __init__(self, share: Share, q: Array, weights: Array, *, in_motion: bool) -> None:
        self._share, self._in_motion = share, in_motion
        self.c = struct("prediction", size=share.size, dt=math.inf)
        self.began_at(q)
        if in_motion:
            self._second = np.zeros(share.size)
            size = {"scene": share.grid.scene.size, "unknowns": share.grid.size}
            fill(self.c, second=self._second, weight=weights, **size)

    def began_at(self, q: Array) -> None:
        """Take ``q`` for the configuration at the beginning of the last step."""
        self.q_before = q
        fill(self.c, q_before=q)

    @property
    def last_dt(self) -> float:
        """Length of the last step, infinite before the first; s."""
        return float(self.c.dt)

    def like_last(self, dt: float) -> bool:
        """Return whether a step is as long as the last one in motion."""
        return self._in_motion and bool(lib.as_last(self.c, dt))

    def guess(self, q: Array, dt: float) -> Array:
        """Predict the end of a step from ``q``."""
        out: Array = np.empty(len(q))
        lib.predict(self.c, dt, doubles(q), doubles(out))
        return out

    def accept(self, q: Array, q1: Array, dt: float) -> None:
        """Take over a step from ``q`` to ``q1``; then all processes :meth:`agree`."""
        lib.enter_step(self.c, dt, doubles(q), doubles(q1))
        self.began_at(q)

    def forget(self) -> None:
        """Let the next step start from where it begins: it does not go on as the last one did."""
        self.c.dt = math.inf

    def agree(self) -> None:
        """Compare the last second differences over all processes."""
        if self._in_motion:
            c, total = self.c, self._share.total
            c.both, c.now, c.step = map(total, (c.both, c.now, c.step))
            lib.compare_differences(self.c)

    def remember(self, memory: Memory) -> None:
        """State it in numbers of the grid; see state_io.py."""
        self.c.dt = memory.number("last dt", self.c.dt)
        self.began_at(memory.at_dofs("q before", self.q_before))
        if self._in_motion:
            self.c.equal = int(memory.number("equal steps", self.c.equal))
            self.c.repeated = memory.number("part that repeats itself", self.c.repeated)
            self.c.now = memory.number("square of the second difference", self.c.now)
            self._second[:] = memory.at_dofs("second difference", self._second)
