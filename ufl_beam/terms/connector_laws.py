# SPDX-License-Identifier: MIT
"""Laws of connectors that hold, drive, push, damp, rub and stop."""

from __future__ import annotations

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
    Motor,
    Stop,
)
from ufl_beam.model.connectors import Connector
from ufl_beam.model.time_functions import value_at
from ufl_beam.terms.connector_responses import Response, Rows, Setting, Working, respond

CREEP = 1e-12
"""Part of the size of the scene, or rad, by which what sticks creeps in a step under its limit.

Only where several places that stick hold the same motion: so they share the force.
"""


class _Held(Working):
    """Constraint of a joint: the motion is zero, and there is no work."""

    steady = True

    def rows(self, e1: Array, λ: Array) -> Rows:
        """The motion is held."""
        return 1.0, 0.0, 0.0


class _Driven(Working):
    """Motors: the motion is given."""

    steady = True
    _group, _entry, _sign = "supplied", "motors", -1.0

    def _prepare(self) -> None:
        self._motors: list[Any] = list(self._links)

    def _note(self, step: Step) -> None:
        t = step.motion_time
        wanted = np.array([value_at(link.law.motion, t, link) for link in self._motors])
        self._target = self._e0 + step.fraction * (wanted - self._e0)

    def rows(self, e1: Array, λ: Array) -> Rows:
        """The motion is given."""
        return 1.0, 0.0, self._target


@respond.register
def _(law: Motor, links: Sequence[Connector], setting: Setting) -> Response:
    return (_Held if law is HELD else _Driven)(law, links, setting)


@respond.register(Actuator)
class _Pushed(Working):
    """Actuators: the force is given."""

    steady = True
    _group, _entry, _sign = "supplied", "loads", -1.0

    def _prepare(self) -> None:
        self._force: Array = np.zeros(len(self._links))
        self._reached: Array = self._force

    def _note(self, step: Step) -> None:
        wanted = -np.array([self._wanted(link, step) for link in self._links])
        self._end = self._reached + step.fraction * (wanted - self._reached)
        self._force = self._reached + step.at * (self._end - self._reached)

    def accept(self, e1: Array, work: float) -> None:
        """Enter the work."""
        super().accept(e1, work)
        self._reached = self._end

    def state(self) -> Array:
        """The forces at the end of the last step."""
        return self._reached[:, None]

    def restore(self, rows: Array) -> None:
        """Go on from these forces."""
        self._reached = rows[:, 0].copy()

    def _wanted(self, link: Any, step: Step) -> float:
        return value_at(link.law.force, step.load_time, link)

    def rows(self, e1: Array, λ: Array) -> Rows:
        """The force is given."""
        return 0.0, 1.0, self._force


@respond.register(Controller)
class _Controlled(_Pushed):
    """Controllers: the force is what they said at the beginning of the step."""

    _entry = "controllers"

    def _wanted(self, link: Any, step: Step) -> float:
        return self._setting.asked[link]


@respond.register(Damper)
class _Damped(Working):
    """Dampers."""

    _entry = "damping"

    def _prepare(self) -> None:
        self._viscosity = self._numbers("viscosity")

    def rows(self, e1: Array, λ: Array) -> Rows:
        """The force is viscosity times the mean rate."""
        factor = self._viscosity / self._dt
        return -factor, 1.0, -factor * self._e0


@respond.register(Coulomb)
class _Rubbing(Working):
    """Dry friction: each connector sticks (0), or slips one way or the other (-1, 1)."""

    _entry = "friction"

    def _prepare(self) -> None:
        self._slip: Array = np.zeros(len(self._links))
        self._accepted: Array = self._slip
        lengths = np.where([c.turns for c in self._links], 1.0, self._setting.size)
        self._tiny = 1e-14 * lengths
        self._softness = (CREEP if self._setting.friction_repeats else 0.0) * lengths

    def state(self) -> Array:
        """Which way each slips."""
        return self._accepted[:, None]

    def restore(self, rows: Array) -> None:
        """Take over :meth:`state`."""
        self._slip = self._accepted = rows[:, 0].copy()

    def _note(self, step: Step) -> None:
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

    def accept(self, e1: Array, work: float) -> None:
        """Enter the work, and take which way each slips."""
        super().accept(e1, work)
        self._accepted = self._slip

    def rows(self, e1: Array, λ: Array) -> Rows:
        """Stick while the force is below the limit; slip until the sliding velocity reverses."""
        step = e1 - self._e0
        stuck = self._slip == 0
        back = ~stuck & (self._slip * step < -self._tiny)
        over = stuck & (np.abs(λ) > self._limit * (1 + 1e-12))
        # Coming to rest must not give energy; if it did, the place is held at once in this step.
        self._against |= stuck & (λ * self._way < 0)
        self._slip = np.where(back, 0.0, np.where(over, np.sign(λ), self._slip))
        sticks = (self._slip == 0) & (self._limit > 0)
        rest = self._e0 + np.where(self._against, 0.0, self._way)
        return (
            np.where(sticks, 1.0, 0.0),
            np.where(sticks, -self._creep, 1.0),
            np.where(sticks, rest, self._slip * self._limit),
        )


@respond.register(Stop)
class _Stopped(Working):
    """Contact outside an interval: elastic, so that what it takes it gives back."""

    def _prepare(self) -> None:
        self._low, self._high = self._numbers("low"), self._numbers("high")
        self._stiffness = self._numbers("stiffness")

    def _beyond(self, e: Array) -> Array:
        return np.asarray(np.maximum(e - self._high, 0.0) + np.minimum(e - self._low, 0.0))

    def _energy(self, e: Array) -> float:
        return float(self._stiffness @ self._beyond(e) ** 2) / 2

    def rows(self, e1: Array, λ: Array) -> Rows:
        """The force that makes the work of the step what the contact stores."""
        force, slope = self._setting.scheme.secant(self._beyond, self._e0, e1)
        force, slope = self._stiffness * force, self._stiffness * slope
        return -slope, 1.0, force - slope * e1

    def add_state(self, e: Array) -> None:
        """Stored energy."""
        self._setting.ledger.state["stored"] += self._energy(e)

    def change(self, e1: Array, work: float) -> float:
        """Energy stored in the step; J."""
        return self._energy(e1) - self._energy(self._e0)
