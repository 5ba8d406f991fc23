# SPDX-License-Identifier: MIT
"""Steps that were solved, the cutting of those that fail, and what the first one of a run needs.

In statics, where forces act over the step, a step that turns a node far does not end in
equilibrium.  So loads that act at once are applied in parts that turn nodes little, and the rest of
the first step has nothing left to do but to follow them.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import NamedTuple, NoReturn

import numpy as np

from ufl_beam.arrays import Array
from ufl_beam.discretization.partition import Share
from ufl_beam.errors import StepFailed
from ufl_beam.mechanics.time_schemes import Scheme, Step, has_inertia
from ufl_beam.model.loads import RotatingFrame
from ufl_beam.model.scene import Scene

MOST_PARTS = 2**12
"""Largest number of parts that a step is cut into."""


class Trial(NamedTuple):
    """A step that was solved but not yet accepted, and the configuration ``q1`` at its end.

    Forces work on ``s``, see :meth:`Scheme.nodal_step`; in dynamics the mean velocity times ``dt``.
    """

    step: Step
    q1: Array
    s: Array


def go_in_parts(
    t0: float,
    t1: float,
    attempt: Callable[[float], Trial],
    accept: Callable[[Trial], None],
    give_up: Callable[[StepFailed, float], NoReturn],
) -> None:
    """Go from ``t0`` to ``t1`` at once or, where :class:`StepFailed` is raised, in parts.

    ``give_up`` ends the run, because even the smallest part, to a time, has failed.
    """
    done, part = 0, MOST_PARTS
    while done < MOST_PARTS:
        last = done + part == MOST_PARTS
        end = t1 if last else t0 + (t1 - t0) * (done + part) / MOST_PARTS
        try:
            accept(attempt(end))
        except StepFailed as failure:
            if part == 1:
                give_up(failure, end)
            part //= 2
            continue
        done += part
        # A part grows again where the larger one would begin anyway.
        if done % (2 * part) == 0 and part < MOST_PARTS:
            part *= 2


# -- the first step of a run --------------------------------------------------------------------

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
    return frames or bool(scene.works) or any(f(t) != 0 for _, f in scene.time_functions())


def require_small_turn(share: Share, change: Array, dt: float, whole: float) -> None:
    """Raise if a node turns far in a part, ``dt`` long, of the application of loads, ``whole``."""
    turn = share.largest(np.abs(change)[share.rotations()].max(initial=0.0))
    if turn > APPLYING_TURN and SHORT_PART * dt > whole:
        raise StepFailed("a node turns too far while the loads at the beginning are applied")
