# SPDX-License-Identifier: MIT
"""Force laws by functions of a user, with a history, and with any slope."""

from __future__ import annotations

from typing import Any

import numpy as np
from scipy.optimize import brentq

from ufl_beam.arrays import Array
from ufl_beam.errors import SceneError, require_returned, shorten
from ufl_beam.mechanics.time_schemes import Step
from ufl_beam.model.connectors import Connector
from ufl_beam.model.force_laws import ForceLaw
from ufl_beam.terms.connector_responses import Rows, Working, respond

MISSED = 0.5
"""Part of what the iterate before has missed of a law, from which on a step went too far."""

DIGITS = 1e-8
"""Part of a force from which on a difference of forces has as many digits as a slope needs."""


@respond.register(ForceLaw)
class Asked(Working):
    """Forces that functions give; all have as many internal variables."""

    _entry = "functions"

    def _prepare(self) -> None:
        self._small = 1e-3 * np.where([c.turns for c in self._links], 1.0, self._setting.size)
        self._functions = [_Function(*pair) for pair in zip(self._links, self._laws, strict=True)]
        self._state: Array = np.array([law.state for law in self._laws]).reshape(
            len(self._laws), -1 if self._laws else 0
        )
        self._stored = 0.0
        self._missed: Array = np.zeros(len(self._laws))
        self.again()

    def _note(self, step: Step) -> None:
        whole = step.fraction * step.at == 1.0  # a path has no beginning in time
        way = 0.0 if whole else step.fraction * step.at * (step.load_time - step.t0)
        self._e0 = self._e0.copy()  # which the connectors change before the step is accepted
        self._known = {"t": step.load_time if whole else step.t0 + way, "dt": step.dt}
        self.again()

    def again(self) -> None:
        """Forget the iterates of the step."""
        self._last: tuple[Array, Array, Array] | None = None

    # -- forces --------------------------------------------------------------------------------

    def _force(self, i: int, e1: float) -> float:
        """The force of a connector if the step ends at the motion ``e1``."""
        return self._functions[i](*self._arguments(i, e1), self._known, self._state[i])[0]

    def _arguments(self, i: int, e1: float) -> tuple[float, float]:
        e0, part = self._e0[i], self._setting.scheme.load_weight
        return (1.0 - part) * e0 + part * e1, (e1 - e0) / self._dt

    def _forces(self, e1: Array) -> Array:
        return np.array([self._force(i, e) for i, e in enumerate(e1)])

    def rows(self, e1: Array, λ: Array) -> Rows:
        """The force around the iterate; its derivative by central differences."""
        force, places = self._forces(e1), e1 if self._last is None else self._last[2]
        at = self._crossed(e1, λ, force)
        if (at != e1).any():
            force = self._forces(at)
        slope = self._slopes(at, force, places)
        return -slope, 1.0, force - slope * at

    def _slopes(self, e: Array, force: Array, places: Array) -> Array:
        """Derivatives of the forces, by central differences.

        Over a part of the step or of the scene; beside zero, where the slope may be infinite, over
        a part of the motion, or of that in the iterate before, if that leaves digits.
        """
        ε = 6e-6 * np.maximum(np.abs(e - self._e0), 1e-3 * np.maximum(np.abs(e), self._small))
        slopes: Array = (self._forces(e + ε) - self._forces(e - ε)) / (2 * ε)
        far = np.maximum(np.abs(e), np.abs(places))
        for i in np.flatnonzero((ε > 6e-6 * far) & (far > 0.0)):
            near = 6e-6 * far[i]
            change = self._force(i, e[i] + near) - self._force(i, e[i] - near)
            if abs(change) > DIGITS * abs(force[i]):
                slopes[i] = change / (2 * near)
        return slopes

    def _crossed(self, e1: Array, λ: Array, force: Array) -> Array:
        """Motions around which laws are linear: those of the iterate, but where it went too far.

        Where a law has an infinite slope, Newton's method goes from one side to the other for ever.
        Forces and motions of the two latest iterates tell how the rest of the scene yields: there
        the law is taken where it meets this line, between this iterate and the place before.
        """
        at = e1.copy()
        if self._last is not None:
            before, λ_before, place = self._last
            missed, missed_before = np.abs(force - λ), np.abs(self._missed)
            for i in np.flatnonzero(missed > MISSED * missed_before):
                way = e1[i] - before[i]
                if way != 0.0:
                    yielding = max(0.0, -(λ[i] - λ_before[i]) / way)
                    at[i] = self._meeting(i, float(e1[i]), float(λ[i]), yielding, float(place[i]))
        self._missed = force - λ
        self._last = e1.copy(), λ.copy(), at
        return at

    def _meeting(self, i: int, e: float, λ: float, yielding: float, place: float) -> float:
        """Motion between ``e`` and ``place`` at which the force lies on a falling line."""

        def excess(x: float) -> float:
            return self._force(i, x) - λ + yielding * (x - e)

        ends = excess(e), excess(place)
        if np.sign(ends[0]) * np.sign(ends[1]) >= 0:
            return e
        return float(brentq(excess, e, place, xtol=1e-300, maxiter=2000))

    def bends(self, e1: Array) -> Array:
        """Second derivative of a force function, by a fourth-order difference.

        Over a thousandth of the scene, or of a radian, it leaves 1e-10 of round-off, and less of
        the sixth derivative of a law that bends over a thirtieth of the scene or more.
        """
        ε = self._small
        weights = np.array([-1.0, 16.0, -30.0, 16.0, -1.0])
        forces = np.array([self._forces(e1 + k * ε) for k in range(-2, 3)])
        return np.asarray(-(weights @ forces) / (12 * ε**2))

    # -- history and energy --------------------------------------------------------------------

    def accept(self, e1: Array, work: float) -> None:
        """Enter what is not stored of the work, and take the internal variables."""
        if self._state.size:
            after = [
                one(*self._arguments(i, e1[i]), self._known, self._state[i])[1]
                for i, one in enumerate(self._functions)
            ]
            self._state = np.array(after)
        stored = self._energy(e1)
        super().accept(e1, work - (stored - self._stored))
        self._stored = stored

    def _energy(self, e: Array) -> float:
        energies = [one.stored(e[i], self._state[i]) for i, one in enumerate(self._functions)]
        return sum(energies, 0.0)

    def add_state(self, e: Array) -> None:
        """Enter the stored energy."""
        self._stored = self._energy(e)
        self._setting.ledger.state["stored"] += self._stored

    def state(self) -> Array:
        """Internal variables of the accepted state."""
        return self._state

    def restore(self, rows: Array) -> None:
        """Take over the internal variables of a :meth:`state`."""
        self._state = rows.copy()


class _Function:
    """The functions of a law, with a connector that messages name."""

    def __init__(self, link: Connector, law: ForceLaw) -> None:
        self._link, self._force, self._asked = link, law.force, law.asked
        self._size, self._stored, self._asked_by_stored = (
            len(law.state),
            law.stored,
            law.asked_by_stored,
        )

    def __call__(
        self, motion: float, rate: float, clock: dict[str, float], state: Array
    ) -> tuple[float, Array]:
        """Return the force, and the internal variables after the step."""
        if not self._asked:
            value, after = self._force(motion, rate), state
        else:
            known: dict[str, Any] = {**clock, "state": state.copy()}
            value = self._force(motion, rate, **{name: known[name] for name in self._asked})
            after = state
            if self._size:
                value, after = self._pair(value)
        if isinstance(value, float):
            return value, after
        at = f"motion = {motion:.6g}, rate = {rate:.6g}"
        return require_returned(value, f"{self._link}: the function", at), after

    def _pair(self, returned: Any) -> tuple[Any, Array]:
        try:
            force, after = returned
            after = np.array(after, dtype=np.float64).reshape(self._size)
        except (TypeError, ValueError):
            raise SceneError(
                f"{self._link}: the function returned {shorten(returned)}; it must return the "
                f"force and the state, a list of {self._size} numbers"
            ) from None
        return force, after

    def stored(self, motion: float, state: Array) -> float:
        """The energy that can be had back; J."""
        if self._stored is None:
            return 0.0
        by_name = {name: state.copy() for name in self._asked_by_stored}
        value = self._stored(motion, **by_name)
        return require_returned(value, f"{self._link}: the energy", f"motion = {motion:.6g}")
