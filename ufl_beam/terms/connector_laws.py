# SPDX-License-Identifier: MIT
"""Laws of connectors that hold, drive, push, damp and rub."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from ufl_beam.arrays import Array
from ufl_beam.compiled.c_library import doubles, ffi, fill, struct
from ufl_beam.model.connector_laws import HELD, Actuator, Controller, Coulomb, Damper, Guide, Motor
from ufl_beam.model.connectors import Connector
from ufl_beam.terms.connector_responses import Response, Setting, respond
from ufl_beam.terms.phases import Callbacks

CREEP = 1e-12
"""Part of the size of the scene, or rad, by which what sticks creeps in a step under its limit.

Only where several places that stick hold the same motion: so they share the force.
"""


class _Held(Response):
    """Constraints of joints and guides: the motion is zero, and there is no work."""


class _Driven(Response):
    """Motors: the motion is given."""

    _part, _entry, _sign = "supplied", "motors", -1.0

    def in_steps(self, callbacks: Callbacks) -> dict[str, Any]:
        motors = zip(self._laws, self._links, strict=True)
        wanted = callbacks.of_time([(law.motion, link) for law, link in motors])
        return {"wanted_motion": wanted, **super().in_steps(callbacks)}


@respond.register(Motor)
@respond.register(Guide)
def _(law: Motor | Guide, links: Sequence[Connector], setting: Setting) -> Response:
    return (_Held if law is HELD or isinstance(law, Guide) else _Driven)(law, links, setting)


class _Given(Response):
    """Base of laws that give the force."""

    _part, _sign = "supplied", -1.0

    def _prepare(self, law: Any) -> None:
        self._end, self._reached = np.zeros((2, len(self._links)))  # of this step, of the last one

    def _wanted(self, callbacks: Callbacks) -> Any:
        """Return ``time_function`` of loops.h of the forces."""
        actuators = zip(self._laws, self._links, strict=True)
        return callbacks.of_time([(law.force, link) for law, link in actuators])

    def in_steps(self, callbacks: Callbacks) -> dict[str, Any]:
        ends = {"end": self._end, "reached": self._reached}
        return {"wanted_force": self._wanted(callbacks), **ends, **super().in_steps(callbacks)}

    def state(self) -> Array:
        """The forces at the end of the last step."""
        return self._reached[:, None]

    def restore(self, rows: Array) -> None:
        self._reached[:] = rows[:, 0]


@respond.register(Actuator)
class _Pushed(_Given):
    """Actuators: the force is a function of time."""

    _entry = "loads"


@respond.register(Controller)
class _Controlled(_Given):
    """Controllers: the force is the one that they returned when the step began."""

    _entry = "controllers"

    def _wanted(self, callbacks: Callbacks) -> Any:
        self._always = np.zeros(1)
        wanted = ffi.new("time_function[]", len(self._links))
        for place, link in zip(wanted, self._links, strict=True):
            place.points, place.t, place.y = 1, doubles(self._always), self._setting.asked(link)
        return wanted


@respond.register(Damper)
class _Damped(Response):
    """Dampers: the force is viscosity times the mean rate."""

    _entry = "damping"

    def in_steps(self, callbacks: Callbacks) -> dict[str, Any]:
        return {"viscosity": self._numbers("viscosity"), **super().in_steps(callbacks)}


class Rubbing(Response):
    """Connectors that stick (0), or slip one way or the other (-1, 1)."""

    def _rub(self, limits: list[Any], **of_laws: Any) -> None:
        """Make the struct of C; ``limits`` are addresses of the limits of the forces."""
        n, setting = len(self._links), self._setting
        self._slip, self._accepted, way, creep = np.zeros((4, n))
        self._sticks, against = np.zeros((2, n), dtype=np.int32)
        softness = CREEP if setting.friction_repeats else 0.0
        self._friction = struct(
            "friction", number=n, limit=ffi.new("double *[]", limits), slip=self._slip,
            accepted=self._accepted, way=way, creep=creep, softness=softness * self._lengths(),
            tiny=1e-14 * self._lengths(), sticks=self._sticks, against=against,
            switched=setting.search.switched, force=np.zeros(n), rows=np.zeros((n, 3)), **of_laws,
        )  # fmt: skip
        if self.opens:
            search, free = setting.search.flags, np.zeros(n, dtype=np.int32)
            fill(self._friction, search=search, free=free, excess=np.zeros(n))
        if setting.rates is not None:
            fill(self._friction, rates=setting.rates.c)
        self.in_c = {**self.in_c, "friction": self._friction}

    def know(self, couplings: Any) -> None:
        """Take the rates of the motions."""
        rate, v = couplings.rate_of_motion, couplings.velocities
        fill(self._friction, rate=rate.cells, at_v=rate.position(v))

    def about_force(self, rows: Array) -> Array:
        """Zero for what sticks."""
        return np.where(self._sticks != 0, 0.0, 1.0)

    def state(self) -> Array:
        """Which way each slips, and what else the law remembers."""
        return np.column_stack([self._accepted, super().state()])

    def restore(self, rows: Array) -> None:
        """Take over a :meth:`state`."""
        self._slip[:] = self._accepted[:] = rows[:, 0]
        super().restore(rows[:, 1:])


@respond.register(Coulomb)
class _DryFriction(Rubbing):
    """Dry friction, whose limits controllers may set."""

    _entry, name_in_files = "friction", "_Rubbing"

    def _prepare(self, law: Any) -> None:
        self._rub([self._setting.asked(link) for link in self._links])
