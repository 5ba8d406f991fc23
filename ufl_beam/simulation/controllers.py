# SPDX-License-Identifier: MIT
"""Forces of controllers and friction limits, which are evaluated at the start of steps.

The module also detects forces of controllers and force laws that alternately rise and fall.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from typing import Any

import numpy as np

from ufl_beam.compiled.c_library import doubles, ffi, integers, struct
from ufl_beam.discretization.partition import Subdomain
from ufl_beam.discretization.state_io import Archive
from ufl_beam.model.connector_laws import Controller, Coulomb, ForceLaw, Running
from ufl_beam.model.connectors import Connector

SAMPLE_TOLERANCE = 1e-9
"""Largest difference of two times that counts as round-off, as a fraction of the sample time."""


class Controllers:
    """Forces of controllers and friction limits in a step; equal on all processes.

    Attributes:
        at: Index of each connector in ``values`` and ``fresh``.
        values: Forces and friction limits, which C reads; (n,); N or N m.
        sampled: Sample time by index, for controllers with a sample time; s.
        fresh: 1 for connectors that were evaluated since C last cleared this flag; (n,).
        needs_evaluation: True if any force or limit is evaluated at the start of steps.
    """

    def __init__(self, subdomain: Subdomain) -> None:
        connectors = subdomain.numbering.scene.all_connectors
        active = [x for x in connectors if isinstance(x.law, Controller | Coulomb)]
        self.at: dict[Connector, int] = {connector: i for i, connector in enumerate(active)}
        self.values, self.fresh = np.zeros(len(active)), np.zeros(len(active), dtype=np.int32)
        self.sampled: dict[int, float] = {}
        self._changing: list[tuple[int, Connector]] = []
        for i, connector in enumerate(active):
            if isinstance(connector.law, Coulomb) and not connector.law.joint:
                self.values[i] = connector.law.force
                continue
            self._changing.append((i, connector))
            if isinstance(connector.law, Controller) and connector.law.sample:
                self.sampled[i] = connector.law.sample
        self.needs_evaluation = bool(self._changing)
        self._indices = np.array([i for i, x in enumerate(connectors) if x in self.at], dtype=int)
        # Time of the first sample (s) and number of the latest sample; NaN before the first sample
        self._samples = np.full((len(active), 2), math.nan)

    def place(self, connector: Connector) -> Any:
        """Return the address of the force or limit of a connector."""
        return doubles(self.values) + self.at[connector]

    def evaluate(self, now: Running) -> None:
        """Evaluate forces and limits that are due at ``now.t``; all processes call it together."""
        for i, connector in self._changing:
            sample = self._due(i, now.t)
            if sample[1] != self._samples[i, 1]:  # always true without a sample time: NaN
                self.values[i] = connector.law.evaluate(now, connector)  # type: ignore[union-attr]
                self.fresh[i] = 1
                self._samples[i] = sample

    def _due(self, i: int, t: float) -> tuple[float, float]:
        """Return the time of the first sample (s) and the number of the latest sample at ``t``.

        Both are NaN without a sample time.
        """
        if i not in self.sampled:
            return math.nan, math.nan
        first, sample = float(self._samples[i, 0]), self.sampled[i]
        first = t if math.isnan(first) else first
        return first, math.floor((t - first + _rounding(sample, t, first)) / sample)

    def next_sample(self, t: float, end: float) -> float:
        """Return the time of the next sample after ``t``, or ``end`` if the end comes first; s."""
        stop = end
        for i, sample in self.sampled.items():
            first, number = self._due(i, t)
            at = first + (number + 1) * sample
            if t < at < stop - _rounding(sample, at, stop):
                stop = at
        return stop

    def save_or_restore(self, archive: Archive, t: float) -> None:
        """Save or restore forces, limits and samples at the time ``t``.

        Sampling begins anew if the state was saved at another time.
        """
        if not len(self.values):
            return
        values = np.column_stack([self.values, self._samples, np.full(len(self.values), t)])
        rows = archive.rows("asked", self._indices, values, known=True)
        changing = [i for i, _ in self._changing]  # the scene has the other limits
        self.values[changing] = rows[changing, 0]
        if np.all(rows[:, 3] == t):
            self._samples[:] = rows[:, 1:3]


def _rounding(sample: float, *times: float) -> float:
    """Return the largest difference of ``times`` that counts as round-off; s."""
    return SAMPLE_TOLERANCE * sample + 4 * math.ulp(max(map(abs, times)))


# -- forces that alternate -------------------------------------------------------------------------

ALTERNATIONS = 20
"""Number of successive changes of a force, alternately up and down, that causes a warning.

Changes are counted from step to step, or from sample to sample."""

SUSPICIOUS = 5  # number of such changes up to the failure of a run that the error reports
LEAST_CHANGE = 0.5  # least size of a counted change, as a fraction of the largest force so far

LEAST_MOTION = 1e-9
"""Least motion of a connector in the step of a counted change; in sizes of the scene, or rad."""

CONTROLLED = (
    "the force changes the motion too much before the controller is evaluated again. A force of "
    "kd times a rate, constant for a time dt, needs kd dt < 2 J. J is the inertia (for a "
    "displacement, the mass) that the force moves within dt. A point of a beam without a body has "
    "hardly any inertia. Add the inertia of the drive there by PointMass or Body, use smaller "
    "gains, or write the force as a ForceLaw, which has no delay; see docs/howto_machine.md"
)
"""Reason and remedies in the warning of a controller."""

TOO_FAST = (
    "the force drives a motion that is too fast for the steps. Use smaller steps, or a scheme that "
    "damps such motions, as EnergyMomentum(alpha=0.05, beta=0.05) does"
)
"""Reason and remedies in the warning of a force law."""


class ForceWatch:
    """Check for forces of controllers and force laws that alternately rise and fall.

    Attributes:
        c: ``force_watch`` of loops.h; None if no connector has such a law.
    """

    c: Any = None

    def __init__(
        self, connector_terms: Sequence[Any], controllers: Controllers, size: float
    ) -> None:
        kinds = Controller, ForceLaw
        watched = [
            (connector, term, k)
            for term in connector_terms for k, connector in enumerate(term.connectors)
            if isinstance(connector.law, kinds)
        ]  # fmt: skip
        self._connectors, n = [connector for connector, *_ in watched], len(watched)
        if not n:
            return
        places = [controllers.at.get(x) for x in self._connectors]
        values, fresh = (
            [ffi.NULL if place is None else start + place for place in places]
            for start in (doubles(controllers.values), integers(controllers.fresh))
        )
        self._told, none = np.full(n, math.nan), np.zeros((3, n))
        self.c = struct(
            "force_watch", number=n, most=ALTERNATIONS, large=LEAST_CHANGE, moved=LEAST_MOTION,
            dof=np.array([group.forces_at[k] for _, group, k in watched], dtype=np.int32),
            value=ffi.new("double *[]", values), fresh=ffi.new("int32_t *[]", fresh),
            rate=ffi.new("double *[]", [
                ffi.cast("double *", group.rate[k:].ctypes.data) for _, group, k in watched
            ]),
            length=np.array([1.0 if c.is_rotation else size for c in self._connectors]),
            force=none[0], change=none[1], largest=none[2], told=self._told,
            count=np.zeros(n, dtype=np.int32),
        )  # fmt: skip
        self._alive = connector_terms, controllers

    def told(self) -> Iterator[str]:
        """Yield warnings for all reported connectors, if C has reported one since the last call."""
        if self.c is None or not self.c.tells:
            return
        self.c.tells = 0
        for connector, t in zip(self._connectors, map(float, self._told), strict=True):
            if not math.isnan(t):
                yield self._report(connector, ALTERNATIONS, t)

    def suspects(self, t: float) -> Iterator[str]:
        """Yield reports on connectors whose forces rise and fall in turn when a run fails at t."""
        if self.c is None:
            return
        for k, connector in enumerate(self._connectors):
            if self.c.count[k] >= SUSPICIOUS:
                yield self._report(connector, self.c.count[k], t)

    def _report(self, connector: Connector, number: int, t: float) -> str:
        times, why = "steps", TOO_FAST
        if isinstance(connector.law, Controller):
            times, why = "samples" if connector.law.sample else "steps", CONTROLLED
        return (
            f"{connector}: the force rose and fell in turn in the last {number} {times} "
            f"before t = {t:.6g} s: {why}"
        )
