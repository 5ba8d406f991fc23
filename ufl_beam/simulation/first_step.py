# SPDX-License-Identifier: MIT
"""First step of a run: loads that act at once, and accelerations at the beginning.

In statics, where forces act over the step, a step that turns a node far does not end in
equilibrium.  So these loads are applied in parts that turn nodes little, and the rest of the first
step has nothing left to do but to follow them.
"""

from __future__ import annotations

import numpy as np

from ufl_beam.arrays import Array
from ufl_beam.discretization.partition import Share
from ufl_beam.errors import StepFailed
from ufl_beam.mechanics.time_schemes import Scheme, has_inertia
from ufl_beam.model.loads import RotatingFrame
from ufl_beam.model.scene import Scene

FIRST = 1 / 16
"""Part of the first step after which accelerations are taken for those at the beginning.

Shorter ones are nearer to it, but magnify the velocities of supports that do not begin with theirs.
"""

APPLYING = 1 / 8
"""Part of the first step in which loads that are there from the start are applied."""

APPLYING_TURN = 0.02
"""Largest turn of a node meanwhile in a part; rad.

Over a part a moment is in error by a quarter of the square: some 1e-4 of it.
"""

SHORT_PART = 512
"""So many times shorter parts may turn nodes further: their oscillations do not become smaller."""


def begins_loaded(scene: Scene, scheme: Scheme, t: float) -> bool:
    """Return whether loads that act at ``t`` are to be applied before the first step."""
    over_step = scheme.average(0.0, 1.0) != 1.0
    if has_inertia(scheme) or not over_step:
        return False
    frames = any(isinstance(load, RotatingFrame) for load in scene.loads)
    return frames or any(f(t) != 0 for _, f in scene.time_functions())


def require_small_turn(share: Share, change: Array, dt: float, whole: float) -> None:
    """Raise :class:`StepFailed` if a node turns far in a part of the application.

    Args:
        share: The degrees of freedom of this process.
        change: That of the configuration in the part.
        dt: Length of the part, of which shorter ones may help; s.
        whole: Length of the whole application; s.
    """
    turn = share.largest(np.abs(change)[share.rotations()].max(initial=0.0))
    if turn > APPLYING_TURN and SHORT_PART * dt > whole:
        raise StepFailed("a node turns too far while the loads at the beginning are applied")
