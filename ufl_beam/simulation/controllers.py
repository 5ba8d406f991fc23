# SPDX-License-Identifier: MIT
"""Forces of controllers and limits of friction: evaluated as steps begin, and watched."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from typing import Any

import numpy as np

from ufl_beam.compiled.c_library import doubles, ffi, integers, struct
from ufl_beam.discretization.partition import Share
from ufl_beam.discretization.state_io import Memory
from ufl_beam.model.connector_laws import (
    Controller,
    Coulomb,
    ForceLaw,
    Running,
)
from ufl_beam.model.connectors import Connector
from ufl_beam.terms.connectors import Links

SAME = 1e-9
"""Part of a sample time by which the end of a step may miss it."""


class Controllers:
    """Forces of controllers and limits of friction in a step; the same on all processes.

    Attributes:
        numbers: The forces and limits, where C finds them; N or N m.
        sampled: Connectors whose controllers have a sample time.
        fresh: Whether controllers were evaluated since these flags were cleared; as ``numbers``.
    """

    def __init__(self, share: Share) -> None:
        links = share.grid.scene.links
        asked = [link for link in links if isinstance(link.law, Controller | Coulomb)]
        self._at = {link: i for i, link in enumerate(asked)}
        constant = [link for link in asked if isinstance(link.law, Coulomb) and not link.law.joint]
        self.numbers, self.fresh = np.zeros(len(asked)), np.zeros(len(asked), dtype=np.int32)
        for link in constant:
            self.numbers[self._at[link]] = link.law.force
        self.sampled = [link for link in asked if _sample(link)]
        self._each_step = [x for x in asked if not _sample(x) and x not in constant]
        self._numbers = np.array([i for i, x in enumerate(links) if x in self._at], dtype=int)
        # Of each that has a sample time: time of the first sample (s), number of the last one.
        self._samples = np.full((len(self.sampled), 2), math.nan)

    @property
    def values(self) -> dict[Connector, float]:
        """The forces and limits by connector."""
        return dict(zip(self._at, self.numbers.tolist(), strict=True))

    @property
    def asks(self) -> bool:
        """True if anything is to be evaluated when steps begin."""
        return bool(self._each_step or self.sampled)

    def place(self, link: Connector) -> Any:
        """Address of the number of a connector."""
        return doubles(self.numbers) + self._at[link]

    def fresh_place(self, link: Connector) -> Any:
        """Address of the flag of a connector in :attr:`fresh`."""
        return integers(self.fresh) + self._at[link]

    def ask(self, now: Running) -> None:
        """Evaluate what is due at the time ``now.t``; all processes call it together."""
        for link in self._each_step:
            self._ask(link, now)
        for i, link in enumerate(self.sampled):
            first, number = self._due(i, now.t)
            if number != self._samples[i, 1]:
                self._ask(link, now)
                self._samples[i] = first, number

    def _ask(self, link: Connector, now: Running) -> None:
        at, law = self._at[link], link.law
        self.numbers[at] = law.ask(now, link)  # type: ignore[union-attr]
        self.fresh[at] = 1

    def _due(self, i: int, t: float) -> tuple[float, int]:
        """Time of the first sample, and the number of the one that holds from ``t`` on."""
        first = t if math.isnan(self._samples[i, 0]) else float(self._samples[i, 0])
        sample = _sample(self.sampled[i])
        return first, math.floor((t - first + _rounding(sample, t, first)) / sample)

    def next_sample(self, t: float, end: float) -> float:
        """Return the next sample time after ``t``, or ``end`` if that comes first; s."""
        stop = end
        for i, link in enumerate(self.sampled):
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
        if not len(self.numbers):
            return
        held = np.full((len(self.numbers), 4), math.nan)
        held[:, 0], held[:, 3] = self.numbers, t
        sampled = [self._at[link] for link in self.sampled]
        held[sampled, 1:3] = self._samples
        rows = memory.rows("asked", self._numbers, held, known=True)
        self.numbers[:] = rows[:, 0]
        if np.all(rows[:, 3] == t):
            self._samples[:] = rows[sampled, 1:3]


def _sample(link: Connector) -> float:
    """Sample time of a connector; 0 if it has none; s."""
    return (isinstance(link.law, Controller) and link.law.sample) or 0.0


def _rounding(sample: float, *times: float) -> float:
    """Difference of times that is due to their last digits; s."""
    return SAME * sample + 4 * math.ulp(max(map(abs, times)))


# -- forces that alternate -------------------------------------------------------------------------

ALTERNATIONS = 20
"""Number of successive changes of direction of a force that is a fault."""

LARGE = 0.5
"""Least change of such a force, as a part of the largest force so far."""

MOVED = 1e-9
"""Least motion of such a step, as a part of the size of the scene, or rad."""


class ForceWatch:
    """Watches forces of controllers and force laws for a change of direction at every step.

    Attributes:
        c: ``force_watch`` of loops.h; None if there are no such laws.
    """

    c: Any = None

    def __init__(self, couplings: Sequence[Links], controllers: Controllers, size: float) -> None:
        kinds = Controller, ForceLaw
        found = [
            (link, one, k) for one in couplings for k, link in enumerate(one.links)
            if isinstance(link.law, kinds)
        ]  # fmt: skip
        self._links, n = [link for link, *_ in found], len(found)
        if not n:
            return
        controlled = [isinstance(link.law, Controller) for link in self._links]
        values, fresh = (
            [place(x) if of else ffi.NULL for x, of in zip(self._links, controlled, strict=True)]
            for place in (controllers.place, controllers.fresh_place)
        )
        self._told, none = np.full(n, math.nan), np.zeros((3, n))
        self.c = struct(
            "force_watch", number=n, most=ALTERNATIONS, large=LARGE, moved=MOVED,
            dof=np.array([one.forces_at[k] for _, one, k in found], dtype=np.int32),
            value=ffi.new("double *[]", values), fresh=ffi.new("int32_t *[]", fresh),
            rate=ffi.new("double *[]", [doubles(one.rate) + k for _, one, k in found]),
            length=np.array([1.0 if link.turns else size for link in self._links]),
            force=none[0], change=none[1], largest=none[2], told=self._told,
            count=np.zeros(n, dtype=np.int32),
        )  # fmt: skip
        self._alive = couplings, controllers

    def told(self) -> Iterator[str]:
        """Yield warnings that have not been told, one a connector."""
        if self.c is not None and self.c.tells:
            self.c.tells = 0
            for link, t in zip(self._links, map(float, self._told), strict=True):
                if not math.isnan(t):
                    yield _alternates(link, t)


def _alternates(link: Connector, t: float) -> str:
    """Describe a force that changes its direction at every step until ``t``."""
    sampled = isinstance(link.law, Controller) and link.law.sample
    said = (
        f"{link}: the force changed its direction at each of the {ALTERNATIONS} "
        f"{'samples' if sampled else 'steps'} before t = {t:.6g} s"
    )
    if not isinstance(link.law, Controller):
        return (
            f"{said}: it drives a motion that is too fast for the steps. Use smaller ones, or a "
            "scheme that damps such motions, as Midpoint(alpha=0.05, beta=0.05) does"
        )
    return (
        f"{said}: the controller answers the motion that it has caused by the time it is asked "
        "again. A force of kd times a rate that is held for a time dt needs kd dt < 2 J; J is the "
        "inertia (along a line the mass) that it moves within dt, and a beam without a body has "
        "hardly any there, whatever the step. Give the place the inertia of its drive, as "
        "PointMass or Body, take smaller gains, or state the force as a ForceLaw, which has no "
        "delay; see docs/howto_machine.md"
    )
