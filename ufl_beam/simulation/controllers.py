# SPDX-License-Identifier: MIT
"""Evaluation of controllers and friction limits as a step begins, at steps or at sample times."""

from __future__ import annotations

import math
from collections.abc import Callable

import numpy as np

from ufl_beam.discretization.partition import Share
from ufl_beam.discretization.state_io import Memory
from ufl_beam.model.connector_laws import Controller, Coulomb, Running
from ufl_beam.model.connectors import Connector

SAME = 1e-9
"""Part of a sample time by which the end of a step may miss it."""


class Controllers:
    """Forces of controllers and limits of friction in a step; the same on all processes.

    Attributes:
        values: The forces and limits; N or N m.
        fresh: Controllers that were evaluated since this was emptied.
    """

    def __init__(self, share: Share) -> None:
        links = share.grid.scene.links
        asked = [link for link in links if isinstance(link.law, Controller | Coulomb)]
        self.values: dict[Connector, float] = dict.fromkeys(asked, 0.0)
        self.fresh: set[Connector] = set()
        self._sampled = [link for link in asked if _sample(link)]
        self._each_step = [link for link in asked if not _sample(link)]
        self._numbers = np.array([i for i, x in enumerate(links) if x in self.values], dtype=int)
        # Of each that has a sample time: time of the first sample (s), number of the last one.
        self._samples = np.full((len(self._sampled), 2), math.nan)

    def ask(self, now: Running) -> None:
        """Evaluate what is due at the time ``now.t``; all processes call it together."""
        values = {link: link.law.ask(now, link) for link in self._each_step}
        self.values.update(values)
        self.fresh.update(values)
        for i, link in enumerate(self._sampled):
            first, number = self._due(i, now.t)
            if number != self._samples[i, 1]:
                self.values[link] = link.law.ask(now, link)
                self.fresh.add(link)
                self._samples[i] = first, number

    def _due(self, i: int, t: float) -> tuple[float, int]:
        """Time of the first sample, and the number of the one that holds from ``t`` on."""
        first = t if math.isnan(self._samples[i, 0]) else float(self._samples[i, 0])
        sample = _sample(self._sampled[i])
        return first, math.floor((t - first + _rounding(sample, t, first)) / sample)

    @property
    def stops(self) -> Callable[[float, float], float] | None:
        """:meth:`next_sample`; None if no controller has a sample time."""
        return self.next_sample if self._sampled else None

    def next_sample(self, t: float, end: float) -> float:
        """Return the next sample time after ``t``, or ``end`` if that comes first; s."""
        stop = end
        for i, link in enumerate(self._sampled):
            first, number = self._due(i, t)
            sample = _sample(link)
            at = first + (number + 1) * sample
            if t < at < stop - _rounding(sample, at, stop):
                stop = at
        return stop

    def remember(self, memory: Memory, t: float) -> None:
        """Pass on the forces and limits in the state at ``t``, and the samples.

        Where a run begins at another time, sampling begins anew.
        """
        if not self.values:
            return
        held = np.full((len(self.values), 4), math.nan)
        held[:, 0], held[:, 3] = [*self.values.values()], t
        sampled = [i for i, link in enumerate(self.values) if _sample(link)]
        held[sampled, 1:3] = self._samples
        rows = memory.known_rows("asked", self._numbers, held)
        self.values.update(zip(self.values, map(float, rows[:, 0]), strict=True))
        if np.all(rows[:, 3] == t):
            self._samples[:] = rows[sampled, 1:3]


def _sample(link: Connector) -> float:
    """Sample time of a connector; 0 if it has none; s."""
    return (isinstance(link.law, Controller) and link.law.sample) or 0.0


def _rounding(sample: float, *times: float) -> float:
    """Difference of times that is due to their last digits; s."""
    return SAME * sample + 4 * math.ulp(max(map(abs, times)))
