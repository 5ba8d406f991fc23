# SPDX-License-Identifier: MIT
"""Steps that were solved, and the cutting of those that fail into parts."""

from __future__ import annotations

from collections.abc import Callable
from typing import NamedTuple, NoReturn

from ufl_beam.arrays import Array
from ufl_beam.errors import StepFailed
from ufl_beam.mechanics.time_schemes import Step

MOST_PARTS = 2**12
"""Largest number of parts that a step is cut into."""


class Trial(NamedTuple):
    """A step that was solved but not yet accepted.

    Attributes:
        step: Its times.
        q1: Configuration at its end, local degrees of freedom.
        s: What forces work on, see :meth:`Scheme.nodal_step`; in dynamics the mean velocity of the
            step times its length.
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
    """Go from ``t0`` to ``t1`` at once or, where that fails, in parts.

    Args:
        t0: Beginning; s.
        t1: End; s.
        attempt: Solves a step to a time, or raises :class:`StepFailed`.
        accept: Goes there.
        give_up: Ends the run, because even the smallest part, to a time, has failed.
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
