# SPDX-License-Identifier: MIT
"""Laws of connectors over a step: one row ``α e + β λ = γ`` for each of them.

e is the relative motion at the end of the step and λ the force that resists its growth.  What is
held has a row about e, all other laws have one about λ, linear in e around the latest iterate.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from functools import singledispatch
from typing import Any, NamedTuple, Protocol

import numpy as np

from ufl_beam.arrays import Array
from ufl_beam.errors import require_returned
from ufl_beam.mechanics.time_schemes import Scheme, Step
from ufl_beam.model.connector_laws import (
    HELD,
    Actuator,
    Controller,
    Coulomb,
    Damper,
    ForceLaw,
    Motor,
    Spring,
    Stop,
)
from ufl_beam.model.connectors import Connector
from ufl_beam.model.fibres import Layout
from ufl_beam.model.material_laws import Hardening
from ufl_beam.model.time_functions import value_at
from ufl_beam.terms.energy_ledger import Ledger
from ufl_beam.terms.material_points import INPUTS, Course, Points, expect_entries
from ufl_beam.terms.openings import Openable

CREEP = 1e-12
"""Part of the size of the scene, or rad, by which what sticks creeps in a step under its limit.

Only where several places that stick hold the same motion: so they share the force.
"""

Rows = tuple[Any, Any, Any]
"""α, β, γ of some connectors: arrays or numbers."""


class Setting(NamedTuple):
    """Arguments that all responses are made with.

    Attributes:
        asked: Forces of controllers, and limits of friction, in the present step; N or N m.
        rates: Rates of relative motions with friction as the step begins; m/s or rad/s.
        size: Size of the scene; m.
        scheme: Says what acts in a step.
        ledger: Takes energies and works.
        friction_repeats: Whether places that stick may hold what is held already.
        course: Flags that all points of the scene share.
    """

    asked: Mapping[Connector, float]
    rates: Mapping[Connector, float]
    size: float
    scheme: Scheme
    ledger: Ledger
    friction_repeats: bool
    course: Course


class Response(Protocol):
    """Some connectors whose laws are of one kind; motions and forces are arrays of them."""

    steady: bool
    """True if the rows stay the same during a step."""

    in_c: dict[str, Any]
    """Data of laws that C evaluates, by their names in ``couplings`` of loops.h."""

    @property
    def openable(self) -> Openable | None:
        """Those that open beyond a limit, if there are."""

    def motion(self, e: Array) -> Array:
        """Motions of the accepted state as solutions show them; ``e`` are those of the nodes."""

    def begin(self, e0: Array, step: Step) -> None:
        """Begin a step at the motions ``e0``."""

    def again(self) -> None:
        """Begin the step again: forget what its iterates have tried."""

    def rows(self, e1: Array, λ: Array) -> Rows:
        """α, β, γ around an iterate."""

    def accept(self, e1: Array, work: float) -> None:
        """Take the end of the step as the new state; ``work`` is what the connectors have taken."""

    def add_state(self, e: Array) -> None:
        """Enter what is stored."""

    def change(self, e1: Array, work: float) -> float:
        """Energy that the step stores, dissipates or gives away; J."""

    def dissipation(self, e1: Array, λ: Array) -> float:
        """Energy dissipated plastically in a step to the motions ``e1``; J."""

    def flows(self) -> bool:
        """Return whether one slips plastically in the latest iterate."""

    @property
    def dissipated(self) -> Array:
        """Energy that each connector has dissipated plastically; (num_links,); J."""

    def about_force(self, rows: Array) -> Array:
        """Factor by which rows about the force are divided, zero for rows about the motion.

        Args:
            rows: The latest ones that Python has put; (num_links, 3).

        Returns:
            Shape (num_links,).
        """

    def remaining(self) -> Array:
        """Part of the elastic stiffness that is left in the latest iterate; (num_links,)."""

    def bends(self, e1: Array) -> Array:
        """Derivative of α by the motion, internal variables kept; (num_links,)."""

    def state(self) -> Array:
        """Return the internal variables; (num_links, k)."""

    def restore(self, rows: Array) -> None:
        """Restore the variables that :meth:`state` returned."""

    def start(self, e: Array) -> None:
        """Begin at motions that no step has led to."""

    def freeze(self) -> None:
        """From now on nothing yields or breaks further."""


@singledispatch
def respond(law: Any, links: Sequence[Connector], setting: Setting) -> Response:
    """The response of connectors whose laws are of the kind of ``law``."""
    raise TypeError(f"{law!r} is no law of a connector")


class _Working:
    """Base of responses that store nothing: the work of their forces is entered."""

    steady = False
    in_c: dict[str, Any] = {}  # noqa: RUF012
    openable: Openable | None = None
    _group = "lost"
    _entry = ""
    _sign = 1.0

    def __init__(self, law: Any, links: Sequence[Connector], setting: Setting) -> None:
        self._laws: list[Any] = [link.law for link in links]
        self._links, self._setting = links, setting
        self._entries = getattr(setting.ledger, self._group)
        if self._entry:
            self._entries[self._entry] += 0.0
        self._e0: Array = np.zeros(len(links))
        self._prepare()

    def _prepare(self) -> None:
        """Prepare the response; called once."""

    def begin(self, e0: Array, step: Step) -> None:
        """Begin a step at the motions ``e0``."""
        self._e0, self._dt = e0, step.dt
        self._note(step)

    def _note(self, step: Step) -> None:
        """Prepare a step."""

    def motion(self, e: Array) -> Array:
        """Those of the nodes."""
        return e

    def again(self) -> None:
        """Nothing depends on iterates."""

    def accept(self, e1: Array, work: float) -> None:
        """Enter the work."""
        if self._entry:
            self._entries[self._entry] += self._sign * work

    def add_state(self, e: Array) -> None:
        """Nothing is stored."""

    def change(self, e1: Array, work: float) -> float:
        """The work."""
        return work

    def dissipation(self, e1: Array, λ: Array) -> float:
        """None by plastic flow."""
        return 0.0

    def flows(self) -> bool:
        """None does."""
        return False

    @property
    def dissipated(self) -> Array:
        """None by plastic flow."""
        return np.zeros(len(self._links))

    def about_force(self, rows: Array) -> Array:
        """Factors of one, but for those that are held in the iterate."""
        about_motion = np.array([link.holds for link in self._links]) & (rows[:, 1] != 1.0)
        return np.where(about_motion, 0.0, 1.0)

    def remaining(self) -> Array:
        """All of it: nothing yields."""
        return np.ones(len(self._links))

    def bends(self, e1: Array) -> Array:
        """The law is linear."""
        return np.zeros(len(self._links))

    def state(self) -> Array:
        """Nothing is remembered."""
        return np.zeros((len(self._links), 0))

    def restore(self, rows: Array) -> None:
        """Nothing was remembered."""

    def start(self, e: Array) -> None:
        """Nothing depends on them."""

    def freeze(self) -> None:
        """Nothing yields."""

    def _numbers(self, name: str) -> Array:
        return np.array([getattr(law, name) for law in self._laws], dtype=np.float64)


class _Held(_Working):
    """Constraint of a joint: the motion is zero, and there is no work."""

    steady = True

    def rows(self, e1: Array, λ: Array) -> Rows:
        """The motion is held."""
        return 1.0, 0.0, 0.0


class _Driven(_Working):
    """Motors: the motion is given."""

    steady = True
    _group, _entry, _sign = "supplied", "motors", -1.0

    def _prepare(self) -> None:
        self._motors: list[Any] = list(self._links)

    def _note(self, step: Step) -> None:
        t = step.motion_time
        wanted = np.array([value_at(link.law.motion, t, link) for link in self._motors])
        self._target = self._e0 + step.toward * (wanted - self._e0)

    def rows(self, e1: Array, λ: Array) -> Rows:
        """The motion is given."""
        return 1.0, 0.0, self._target


@respond.register
def _(law: Motor, links: Sequence[Connector], setting: Setting) -> Response:
    return (_Held if law is HELD else _Driven)(law, links, setting)


@respond.register(Actuator)
class _Pushed(_Working):
    """Actuators: the force is given."""

    steady = True
    _group, _entry, _sign = "supplied", "loads", -1.0

    def _prepare(self) -> None:
        self._force: Array = np.zeros(len(self._links))
        self._reached: Array = self._force

    def _note(self, step: Step) -> None:
        wanted = -np.array([self._wanted(link, step) for link in self._links])
        self._end = self._reached + step.toward * (wanted - self._reached)
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
class _Damped(_Working):
    """Dampers."""

    _entry = "damping"

    def _prepare(self) -> None:
        self._viscosity = self._numbers("viscosity")

    def rows(self, e1: Array, λ: Array) -> Rows:
        """The force is viscosity times the mean rate."""
        factor = self._viscosity / self._dt
        return -factor, 1.0, -factor * self._e0


@respond.register(ForceLaw)
class _Asked(_Working):
    """Forces that a function of motion and rate gives."""

    _entry = "functions"

    def _prepare(self) -> None:
        self._small = 1e-3 * np.where([c.turns for c in self._links], 1.0, self._setting.size)

    def _forces(self, e1: Array) -> Array:
        middle: Array = self._setting.scheme.average(self._e0, e1)
        rate = (e1 - self._e0) / self._dt
        each = zip(self._links, self._laws, middle, rate, strict=True)
        return np.array([_given(link, law.force, m, r) for link, law, m, r in each])

    def rows(self, e1: Array, λ: Array) -> Rows:
        """The force around the iterate; its derivative by central differences."""
        force = self._forces(e1)
        ε = 6e-6 * np.maximum(np.abs(e1 - self._e0), 1e-3 * np.maximum(np.abs(e1), self._small))
        slope: Array = (self._forces(e1 + ε) - self._forces(e1 - ε)) / (2 * ε)
        return -slope, 1.0, force - slope * e1

    def bends(self, e1: Array) -> Array:
        """Of the slope of a function that only Python knows: the difference of fourth order.

        Over a thousandth of the scene, or of a radian, it leaves 1e-10 of round-off, and less of
        the sixth derivative of a law that bends over a thirtieth of the scene or more.
        """
        ε = self._small
        weights = np.array([-1.0, 16.0, -30.0, 16.0, -1.0])
        forces = np.array([self._forces(e1 + k * ε) for k in range(-2, 3)])
        return np.asarray(-(weights @ forces) / (12 * ε**2))


def _given(link: Connector, force: Any, motion: Any, rate: Any) -> float:
    """Evaluate the force of a :class:`ForceLaw`; its owner is named if it is no number."""
    value = force(motion, rate)
    if isinstance(value, float):
        return value
    at = f"motion = {motion:.6g}, rate = {rate:.6g}"
    return require_returned(value, f"{link}: the function", at)


@respond.register(Coulomb)
class _Rubbing(_Working):
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
class _Stopped(_Working):
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


@respond.register(Spring)
class _Sprung:
    """Springs of one law: material points whose strain is the motion."""

    steady = False

    def __init__(self, law: Spring, links: Sequence[Connector], setting: Setting) -> None:
        layout = Layout(
            strains=np.array([[1.0, 0.0, 0.0]]),
            weights=np.ones(1),
            stiffness=np.array([law.stiffness]),
            laws=((law.law or Hardening(limit=np.inf), 1),),
            rest=np.zeros(3),
            softening=law.softening,
            breaking=slice(0, None),
        )
        number = len(links)
        keys = [(0, i) for i in range(number)]
        storage = np.zeros((number, 1, len(INPUTS)))
        self.points = Points(layout, keys, np.ones(number), setting.scheme, storage, setting.course)
        self._ledger = setting.ledger
        expect_entries(layout, setting.scheme, setting.ledger)
        self._strains = np.zeros((number, 3))
        self.in_c = {"points": self.points.points}
        self.openable = self.points if self.points.softens else None

    def motion(self, e: Array) -> Array:
        """Those of the nodes."""
        return e

    def _at(self, e: Array) -> Array:
        self._strains[:, 0] = e
        return self._strains

    def begin(self, e0: Array, step: Step) -> None:
        """Begin a step."""
        self.points.begin(step.dt)

    def rows(self, e1: Array, λ: Array) -> Rows:
        """The force around the iterate."""
        r, D = self.points.respond(self._at(e1))
        return -D[:, 0], 1.0, r[:, 0] - D[:, 0] * e1

    def again(self) -> None:
        """Points answer each iterate anew."""

    def about_force(self, rows: Array) -> Array:
        """Factors of one."""
        return np.ones(len(self._strains))

    def accept(self, e1: Array, work: float) -> None:
        """Commit the internal variables."""
        self.points.respond(self._at(e1))
        self.points.accept()
        self.points.enter_losses(self._ledger)

    def add_state(self, e: Array) -> None:
        """Stored energy."""
        self.points.enter_stored(self._ledger)

    def change(self, e1: Array, work: float) -> float:
        """Energy stored and dissipated in the step; J."""
        self.points.respond(self._at(e1))
        return self.points.change()

    def dissipation(self, e1: Array, λ: Array) -> float:
        """Energy dissipated in the step; J."""
        self.points.respond(self._at(e1))
        return self.points.dissipation()

    def flows(self) -> bool:
        """Their motions tell."""
        return False

    @property
    def dissipated(self) -> Array:
        """Energy that each spring has dissipated; (num_links,); J."""
        return np.asarray(self.points.kept[:, 4:].sum(axis=1))

    def remaining(self) -> Array:
        """Part of the elastic stiffness that is left in the latest iterate; (num_links,)."""
        return self.points.remaining(np.eye(1, 3).repeat(len(self._strains), axis=0))

    def bends(self, e1: Array) -> Array:
        """Nothing bends until something yields."""
        return np.zeros(len(e1))

    def state(self) -> Array:
        """Internal variables."""
        return self.points.state()

    def restore(self, rows: Array) -> None:
        """Take over :meth:`state`."""
        self.points.restore(np.arange(len(rows)), rows)

    def start(self, e: Array) -> None:
        """Begin at motions that no step has led to."""
        self.points.start(self._at(e))
        self.points.refresh(self._at(e))

    def freeze(self) -> None:
        """From now on nothing yields or breaks further."""
        self.points.freeze()
