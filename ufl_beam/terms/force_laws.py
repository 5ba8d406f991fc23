# SPDX-License-Identifier: MIT
"""Force laws by functions of a user, with a history, and with any slope."""

from __future__ import annotations

import math
from typing import Any, NamedTuple

import numpy as np
import scipy  # its parts are loaded when they are used

from ufl_beam.arrays import Array
from ufl_beam.compiled.c_library import fill, lib, struct
from ufl_beam.errors import NoNumber, SceneError, require_returned, shorten
from ufl_beam.model.connectors import Connector
from ufl_beam.model.force_laws import ForceLaw
from ufl_beam.terms.connector_responses import Response, respond
from ufl_beam.terms.phases import Callbacks

MISSED = 0.5
"""Part of what the iterate before has missed of a law, from which on a step went too far."""

DIGITS = 1e-8
"""Part of a force from which on a difference of forces has as many digits as a slope needs."""

DIFFERENCE = 6e-6
"""Part of a motion over which central differences err least: the third root of the round-off."""


class Iterate(NamedTuple):
    """Motion and force of a connector in an iterate, and the law there."""

    e: float  # motion; m or rad
    λ: float  # force; N or N m
    missed: float  # force of the law at the motion less λ
    at: float  # motion around which the law was taken as linear


class Asked:
    """The functions of a law, of one connector in one step."""

    def __init__(self, link: Connector, law: ForceLaw, size: float, load_weight: float) -> None:
        self._link, self._law, self._asked = link, law.force, law.asked
        self._small, self._weight = 1e-3 * size, load_weight
        self._stored, self._asked_by_stored = law.stored, law.asked_by_stored
        self._e0, self._dt, self._known = 0.0, 1.0, dict[str, Any]()
        self._last: Iterate | None = None
        self.state: Array = np.array(law.state)

    def begin(self, e0: float, t: float, dt: float) -> None:
        """Begin a step at the motion ``e0``; the law acts at the time ``t``."""
        self._e0, self._dt = e0, dt
        state = self.state.copy()
        state.flags.writeable = False  # iterates begin with the same one
        self._known = {"t": t, "dt": dt, "state": state}
        self._last = None

    def again(self) -> None:
        """Forget the iterates of the step."""
        self._last = None

    # -- the functions -------------------------------------------------------------------------

    def force(self, e1: float) -> float:
        """The force if the step ends at the motion ``e1``."""
        return self._respond(e1)[0]

    def after(self, e1: float) -> Array:
        """The internal variables if the step ends at the motion ``e1``."""
        return self._respond(e1)[1]

    def _respond(self, e1: float) -> tuple[float, Array]:
        motion = (1.0 - self._weight) * self._e0 + self._weight * e1
        rate, state = (e1 - self._e0) / self._dt, self.state
        if not self._asked:
            value = self._law(motion, rate)
        else:
            value = self._law(motion, rate, **{name: self._known[name] for name in self._asked})
            if state.size:
                value, state = self._pair(value)
        if isinstance(value, float) and math.isfinite(value) and not self.state.size:
            return value, state
        at = f"motion = {motion:.6g}, rate = {rate:.6g}, t = {self._known['t']:.9g} s"
        force = require_returned(value, f"{self._link}: the function", at)
        for number in (force, *map(float, state)):
            if not math.isfinite(number):  # a shorter step may not come there
                raise NoNumber(f"{self._link}: the function returned {number} at {at}")
        return force, state

    def _pair(self, returned: Any) -> tuple[Any, Array]:
        try:
            force, state = returned
            state = np.array(state, dtype=np.float64).reshape(self.state.shape)
        except (TypeError, ValueError):
            raise SceneError(
                f"{self._link}: the function returned {shorten(returned)}; it must return the "
                f"force and the state, a list of {self.state.size} numbers"
            ) from None
        return force, state

    @property
    def stores(self) -> bool:
        """True if the law states an energy."""
        return self._stored is not None

    def stored(self, motion: float) -> float:
        """The energy that can be had back; J."""
        if self._stored is None:
            return 0.0
        value = self._stored(motion, **dict.fromkeys(self._asked_by_stored, self.state.copy()))
        t = f", t = {self._known['t']:.9g} s" if self._known else ""
        at = f"motion = {motion:.6g}{t}"
        return require_returned(value, f"{self._link}: the energy", at, finite=True)

    # -- the law around an iterate -------------------------------------------------------------

    def line(self, e: float, λ: float) -> tuple[float, float]:
        """Slope and intercept of the law around an iterate."""
        force, last = self.force(e), self._last
        missed, at = force - λ, e
        if last is not None and abs(missed) > MISSED * abs(last.missed) and e != last.e:
            at = self._meeting(e, λ, last)
            force = force if at == e else self.force(at)
        slope = self._slope(at, force)
        self._last = Iterate(e, λ, missed, at)
        return slope, force - slope * at

    def _meeting(self, e: float, λ: float, last: Iterate) -> float:
        """Motion around which the law is taken after a step that went too far.

        Where a law has an infinite slope, Newton's method goes from one side to the other for ever.
        Forces and motions of the two latest iterates tell how the rest of the scene yields: the law
        is taken where it meets this line, if that is between ``e`` and the place before.
        """
        yielding = max(0.0, (last.λ - λ) / (e - last.e))

        def excess(x: float) -> float:
            return self.force(x) - λ + yielding * (x - e)

        here, there = excess(e), excess(last.at)
        if not (here < 0.0 < there or there < 0.0 < here):
            return e
        return float(scipy.optimize.brentq(excess, e, last.at, xtol=1e-300, maxiter=2000))

    def _slope(self, e: float, force: float) -> float:
        """Derivative of the force at ``e``, by central differences.

        Over a part of the step or of the scene; beside zero, where the slope may be infinite, over
        a part of the motion, or of that in the iterate before, if that leaves digits.
        """
        ε = DIFFERENCE * max(abs(e - self._e0), 1e-3 * max(abs(e), self._small))
        near = DIFFERENCE * max(abs(e), 0.0 if self._last is None else abs(self._last.at))
        if 0.0 < near < ε:
            change = self.force(e + near) - self.force(e - near)
            if abs(change) > DIGITS * abs(force):
                return change / (2 * near)
        return (self.force(e + ε) - self.force(e - ε)) / (2 * ε)

    def bend(self, e: float) -> float:
        """Second derivative of the force, by a fourth-order difference.

        Over a thousandth of the scene, or of a radian, it leaves 1e-10 of round-off, and less of
        the sixth derivative of a law that bends over a thirtieth of the scene or more.
        """
        ε, weights = self._small, (-1.0, 16.0, -30.0, 16.0, -1.0)
        forces = [w * self.force(e + k * ε) for k, w in zip(range(-2, 3), weights, strict=True)]
        return -sum(forces) / (12 * ε**2)


@respond.register(ForceLaw)
class AskedLaws(Response):
    """Forces that functions give; all laws have as many internal variables."""

    _entry = "functions"

    def _prepare(self, law: Any) -> None:
        numbers = zip(self._links, self._laws, self._lengths(), strict=True)
        self._each = [Asked(*each, self._setting.scheme.load_weight) for each in numbers]
        n = len(self._links)
        self._held, self._force, self._rows = np.zeros(1), np.zeros(n), np.zeros((n, 3))
        self._rows[:, 1] = 1.0
        self._c = struct("asked_laws", force=self._force, rows=self._rows, held=self._held)
        self.in_c = {"asked": self._c}
        self._setting.ledger.state["stored"] += 0.0

    def in_steps(self, callbacks: Callbacks) -> dict[str, Any]:
        """The functions, which C calls."""
        handle = callbacks.handle
        fill(
            self._c, begin=lib.begin_in_python, find_rows=lib.run_in_python, again=lib.run_in_python
        )
        self._c.begin_self, self._c.rows_self = handle(self._begin), handle(self._find_rows)
        self._c.again_self = handle(self._again)
        return {
            **super().in_steps(callbacks),
            "stored": self._setting.ledger.state.pointer("stored"),
        }

    def know(self, couplings: Any) -> None:
        """Take the arrays of motions in the accepted state and in the iterate."""
        self._e0, self._e1 = couplings.motions

    def _begin(self, t: float, dt: float) -> None:
        for one, e0 in zip(self._each, self._e0.tolist(), strict=True):
            one.begin(e0, t, dt)

    def _again(self) -> None:
        for one in self._each:
            one.again()

    def _find_rows(self) -> None:
        """Put the laws around the iterate into the rows of C."""
        self._rows[:, 2] = math.nan  # where a law has no value
        motions = zip(self._each, self._e1.tolist(), self._force.tolist(), strict=True)
        for row, (one, e1, λ) in zip(self._rows, motions, strict=True):
            slope, intercept = one.line(e1, λ)
            row[0], row[2] = -slope, intercept

    def bends(self, e1: Array) -> Array:
        """Derivatives of the slopes."""
        return np.array([one.bend(e1[i]) for i, one in enumerate(self._each)])

    @property
    def asks_at_ends(self) -> bool:
        """True if something is to do when a step is accepted."""
        return any(one.state.size or one.stores for one in self._each)

    def take(self, e1: Array) -> None:
        """Take the internal variables after a step to the motions, and enter what is stored."""
        states = [one.after(float(x)) for one, x in zip(self._each, e1, strict=True)]
        before = float(self._held[0])
        for one, state in zip(self._each, states, strict=True):
            one.state = state
        self.start(e1)
        self._entries[self._entry] -= float(self._held[0]) - before

    def start(self, e: Array) -> None:
        """Find the energy that is stored at these motions."""
        self._held[0] = sum([one.stored(float(x)) for one, x in zip(self._each, e, strict=True)])

    def state(self) -> Array:
        """Internal variables of the accepted state."""
        return np.array([one.state for one in self._each])

    def restore(self, rows: Array) -> None:
        """Take over the internal variables of a :meth:`state`, at the accepted motions."""
        for i, one in enumerate(self._each):
            one.state = rows[i].copy()
        self.start(self._e0)
