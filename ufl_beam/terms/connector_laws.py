# SPDX-License-Identifier: MIT
"""Laws of connectors that hold, drive, push, damp and rub."""

from __future__ import annotations

from abc import abstractmethod
from collections.abc import Sequence
from typing import Any

import numpy as np

from ufl_beam.arrays import Array
from ufl_beam.mechanics.time_schemes import Step
from ufl_beam.model.connector_laws import (
    HELD,
    Actuator,
    Controller,
    Coulomb,
    Damper,
    Guide,
    Motor,
)
from ufl_beam.model.connectors import Connector
from ufl_beam.model.time_functions import value_at
from ufl_beam.terms.connector_responses import Response, Rows, Setting, respond
from ufl_beam.terms.phases import Callbacks

CREEP = 1e-12
"""Part of the size of the scene, or rad, by which what sticks creeps in a step under its limit.

Only where several places that stick hold the same motion: so they share the force.
"""


class _Held(Response):
    """Constraints of joints and guides: the motion is zero, and there is no work."""

    steady = True

    def in_steps(self, callbacks: Callbacks) -> dict[str, Any] | None:
        return {}

    def rows(self, e1: Array, λ: Array) -> Rows:
        return 1.0, 0.0, 0.0


class _Driven(Response):
    """Motors: the motion is given."""

    steady = True
    _part, _entry, _sign = "supplied", "motors", -1.0

    def in_steps(self, callbacks: Callbacks) -> dict[str, Any] | None:
        motors = zip(self._laws, self._links, strict=True)
        wanted = callbacks.of_time([(law.motion, link) for law, link in motors])
        return {"wanted_motion": wanted, **self._entry_in_steps()}

    def begin(self, e0: Array, step: Step) -> None:
        super().begin(e0, step)
        t, motors = step.motion_time, zip(self._laws, self._links, strict=True)
        wanted = np.array([value_at(law.motion, t, link) for law, link in motors])
        self._target = e0 + step.fraction * (wanted - e0)

    def rows(self, e1: Array, λ: Array) -> Rows:
        return 1.0, 0.0, self._target


@respond.register(Motor)
@respond.register(Guide)
def _(law: Motor | Guide, links: Sequence[Connector], setting: Setting) -> Response:
    return (_Held if law is HELD or isinstance(law, Guide) else _Driven)(law, links, setting)


class _Given(Response):
    """Base of laws that give the force."""

    steady = True
    _part, _sign = "supplied", -1.0

    def _prepare(self, law: Any) -> None:
        # Acting, at the end of the step, and at that of the last one.
        self._force, self._end, self._reached = np.zeros((3, len(self._links)))

    @abstractmethod
    def _wanted(self, law: Any, link: Connector, step: Step) -> float:
        """The force at the end of all parts of a step."""

    def begin(self, e0: Array, step: Step) -> None:
        super().begin(e0, step)
        wanted = -np.array([self._wanted(link.law, link, step) for link in self._links])
        self._end[:] = self._reached + step.fraction * (wanted - self._reached)
        self._force[:] = self._reached + step.at * (self._end - self._reached)

    def rows(self, e1: Array, λ: Array) -> Rows:
        return 0.0, 1.0, self._force

    def accept(self, e1: Array, work: float) -> None:
        super().accept(e1, work)
        self._reached[:] = self._end

    def state(self) -> Array:
        """The forces at the end of the last step."""
        return self._reached[:, None]

    def restore(self, rows: Array) -> None:
        self._reached[:] = rows[:, 0]


@respond.register(Actuator)
class _Pushed(_Given):
    """Actuators: the force is a function of time."""

    _entry = "loads"

    def in_steps(self, callbacks: Callbacks) -> dict[str, Any] | None:
        actuators = zip(self._laws, self._links, strict=True)
        wanted = callbacks.of_time([(law.force, link) for law, link in actuators])
        ends = {"end": self._end, "reached": self._reached}
        return {"wanted_force": wanted, **ends, **self._entry_in_steps()}

    def _wanted(self, law: Any, link: Connector, step: Step) -> float:
        return value_at(law.force, step.load_time, link)


@respond.register(Controller)
class _Controlled(_Given):
    """Controllers: the force is what they said at the beginning of the step."""

    _entry = "controllers"

    def _wanted(self, law: Any, link: Connector, step: Step) -> float:
        return self._setting.asked[link]


@respond.register(Damper)
class _Damped(Response):
    """Dampers: the force is viscosity times the mean rate."""

    steady = True
    _entry = "damping"

    def in_steps(self, callbacks: Callbacks) -> dict[str, Any] | None:
        return {"viscosity": self._numbers("viscosity"), **self._entry_in_steps()}

    def rows(self, e1: Array, λ: Array) -> Rows:
        factor = self._numbers("viscosity") / self._dt
        return -factor, 1.0, -factor * self._e0


@respond.register(Coulomb)
class _Rubbing(Response):
    """Dry friction: each connector sticks (0), or slips one way or the other (-1, 1)."""

    _entry = "friction"

    def _prepare(self, law: Any) -> None:
        self._slip: Array = np.zeros(len(self._links))
        self._accepted: Array = self._slip
        self._sticks = np.zeros(len(self._links), dtype=bool)
        self._tiny = 1e-14 * self._lengths()
        self._softness = (CREEP if self._setting.friction_repeats else 0.0) * self._lengths()

    def state(self) -> Array:
        """Which way each slips."""
        return self._accepted[:, None]

    def restore(self, rows: Array) -> None:
        self._slip = self._accepted = rows[:, 0].copy()

    def begin(self, e0: Array, step: Step) -> None:
        super().begin(e0, step)
        setting = self._setting
        self._limit = limit = np.array([setting.asked[link] for link in self._links])
        self._creep = self._softness / np.where(limit > 0, limit, np.inf)
        # With this way the velocity at the end is zero; with none, that before would come back.
        rates = np.array([setting.rates[link] for link in self._links])
        self._way = setting.scheme.way_to_rest(step.dt) * rates
        self.again()

    def again(self) -> None:
        """Slip as before the step; an attempt that failed tells nothing."""
        self._slip = self._accepted
        self._against = np.zeros(len(self._links), dtype=bool)
        self._guessed = True

    def accept(self, e1: Array, work: float) -> None:
        super().accept(e1, work)
        self._accepted = self._slip

    def rows(self, e1: Array, λ: Array) -> Rows:
        """Stick while the force is below the limit; slip until the sliding velocity reverses."""
        step = e1 - self._e0
        stuck = self._slip == 0
        back = ~stuck & (self._slip * step < -self._tiny)
        over = stuck & (np.abs(λ) > self._limit * (1 + 1e-12))
        # Coming to rest must not give energy; if it did, the place is held at once in this step.
        # The force of the guess does not decide this: it belongs to another motion.
        if not self._guessed:
            self._against |= stuck & (λ * self._way < 0)
        self._guessed = False
        self._slip = np.where(back, 0.0, np.where(over, np.sign(λ), self._slip))
        sticks = (self._slip == 0) & (self._limit > 0)
        if (sticks != self._sticks).any():
            self._sticks, self._setting.search.switched[0] = sticks, 1
        rest = self._e0 + np.where(self._against, 0.0, self._way)
        return (
            np.where(sticks, 1.0, 0.0),
            np.where(sticks, -self._creep, 1.0),
            np.where(sticks, rest, self._slip * self._limit),
        )
