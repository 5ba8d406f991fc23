# SPDX-License-Identifier: MIT
"""Prediction of the end of a step, from which Newton's method starts; see docs/steps.md."""

from __future__ import annotations

import math

import numpy as np

from ufl_beam.arrays import Array
from ufl_beam.compiled.c_library import doubles, ffi, fill, struct
from ufl_beam.discretization.partition import Share
from ufl_beam.discretization.state_io import Memory


class Prediction:
    """Goes on as the last steps did: at their velocity and, ``in_motion``, with their acceleration.

    After steps of equal length, a part of the last second difference of the configuration is added:
    that which the one before was like.  It is 1 in smooth motion, and 0 where second differences
    change their sign from step to step, or where steps do not resolve the motion.

    Args:
        weights: Of residuals, see :class:`StepEquation`.

    Attributes:
        c: ``prediction`` of loops.h; C writes to it when a step is accepted.
    """

    def __init__(self, share: Share, q: Array, weights: Array, *, in_motion: bool) -> None:
        self._share, self._in_motion = share, in_motion
        self.c = struct("prediction", size=share.size, dt=math.inf)
        self._q_before = q.copy()
        fill(self.c, q_before=self._q_before)
        if in_motion:
            self._second = np.zeros(share.size)
            size = {"scene": share.grid.scene.size, "unknowns": share.grid.size}
            fill(self.c, second=self._second, weight=weights, **size)

    @property
    def q_before(self) -> Array:
        """Configuration at the beginning of the last step; a copy."""
        return np.frombuffer(ffi.buffer(self.c.q_before, 8 * self._share.size)).copy()

    @property
    def last_dt(self) -> float:
        """Length of the last step, infinite before the first; s."""
        return float(self.c.dt)

    def forget(self) -> None:
        """Let the next step start from where it begins: it does not go on as the last one did."""
        self.c.dt = math.inf

    def remember(self, memory: Memory) -> None:
        """State it in numbers of the grid; see state_io.py."""
        self.c.dt = memory.number("last dt", self.c.dt)
        q_before = memory.at_dofs("q before", self.q_before)
        ffi.memmove(self.c.q_before, doubles(q_before), q_before.nbytes)
        if self._in_motion:
            self.c.equal = int(memory.number("equal steps", self.c.equal))
            self.c.repeated = memory.number("part that repeats itself", self.c.repeated)
            self.c.now = memory.number("square of the second difference", self.c.now)
            self._second[:] = memory.at_dofs("second difference", self._second)
