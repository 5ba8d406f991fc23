# SPDX-License-Identifier: MIT
"""Laws of connectors over a step: one row ``α e + β λ = γ`` each, linear around an iterate.

e is the relative motion at the end of the step and λ the force that resists its growth.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
import scipy  # its parts are loaded when they are used

from ufl_beam.arrays import Array
from ufl_beam.errors import NoNumber, SceneError, require_returned
from ufl_beam.mechanics.slips import Slip, numbers, slip
from ufl_beam.mechanics.time_schemes import Scheme, Step, way_to_rest
from ufl_beam.model.bodies import Place
from ufl_beam.model.connector_law import ConnectorLaw
from ufl_beam.model.connector_laws import (
    HELD,
    Actuator,
    Controller,
    Coulomb,
    Damper,
    ForceLaw,
    Motor,
    RigidPlastic,
    Spring,
)
from ufl_beam.model.connectors import Connector
from ufl_beam.model.fibres import Layout
from ufl_beam.model.material_law import State
from ufl_beam.model.material_laws import Hardening
from ufl_beam.model.plastic_hinges import law_of
from ufl_beam.model.time_functions import value_at
from ufl_beam.reference.cells import Ledger
from ufl_beam.reference.points import CLOSED, FLOWING, RELEASED, MaterialPoints, Search, derivative

CREEP = 1e-12
"""Part of the size of the scene, or rad, by which what sticks creeps in a step under its limit.

Only where several places that stick hold the same motion: so they share the force.
"""

EARLY, WEAK = 0.01, 1e-9
"""Motion, in rad or sizes of the scene, that counts as much as the limit in deciding whether a
rigid-plastic connector slips in an iterate; least factor of motions, in EI over that size."""

Row = tuple[float, float, float]
"""α, β, γ."""


@dataclass
class Setting:
    """Arguments that all laws are made with."""

    size: float  # of the scene; m
    scheme: Scheme
    ledger: Ledger
    search: Search
    asked: Mapping[Connector, float]  # forces of controllers, limits of friction
    rates: Mapping[Connector, float]  # of motions with friction as the step begins
    friction_repeats: bool  # whether places that stick may hold what is held already


class LawInStep:
    """Law of a connector in a step; by default its work is entered in ``entry`` of the ledger."""

    part, entry, sign, saved_as = "lost", "", 1.0, ""
    softens = False  # whether it opens beyond a limit
    slope = 1.0  # factor that rows about the force were divided by
    dissipated = 0.0  # by yielding and slip since the beginning; J

    def __init__(self, link: Connector, setting: Setting) -> None:
        self.link, self.setting, self.e0, self.dt = link, setting, 0.0, 1.0
        self.law: Any = link.law
        self.length = 1.0 if link.turns else setting.size  # of a motion that is large
        if self.entry:
            getattr(setting.ledger, self.part)[self.entry] += 0.0

    def begin(self, e0: float, step: Step) -> None:
        """Begin a step at the motion ``e0``."""
        self.e0, self.dt = e0, step.dt

    def again(self) -> None:
        """Forget what the iterates of a step have tried."""

    def row(self, e1: float, λ: float) -> Row:
        """α, β, γ around an iterate."""
        raise NotImplementedError

    def accept(self, e1: float, work: float) -> None:
        """Take the end of the step; the connector has taken ``work`` in it."""
        if self.entry:
            getattr(self.setting.ledger, self.part)[self.entry] += self.sign * work

    def start(self, e: float) -> None:
        """Begin at a motion that no step has led to."""

    def enter_state(self, e: float) -> None:
        """Enter what is stored."""

    def change(self, e1: float, work: float) -> float:
        """Energy that is stored, dissipated or given away in a step; J."""
        return work

    def require_dissipation(self, e1: float) -> None:
        """Raise :class:`StepFailed` if the law gives energy."""

    def motion(self, e: float) -> float:
        """Motion as solutions show it."""
        return e

    def borne(self) -> float | None:
        """Force in the state that :meth:`start` began at, if the law says it."""
        return None

    def state(self) -> Array:
        """Return the internal variables."""
        return np.zeros(0)

    def restore(self, state: Array) -> None:
        """Take over internal variables."""

    # -- see openings, in solver.py --------------------------------------------------------------

    excess: Any = 0.0  # ``|force| / limit - 1`` if it is held closed and bears too much, else 0

    def release(self, least: float) -> None:
        """Let it open if its excess is so large."""

    def close(self) -> None:
        """Take the release back."""


# -- what is held, driven, pushed, damped --------------------------------------------------------


class _Held(LawInStep):
    """Constraint of a joint: no motion, no work."""

    saved_as = "_Held"

    def row(self, e1: float, λ: float) -> Row:
        return 1.0, 0.0, 0.0


class _Driven(LawInStep):
    """Motor: the motion is given."""

    part, entry, sign, saved_as = "supplied", "motors", -1.0, "_Driven"

    def begin(self, e0: float, step: Step) -> None:
        super().begin(e0, step)
        wanted = value_at(self.law.motion, step.motion_time, self.link)
        self._target = e0 + step.fraction * (wanted - e0)

    def row(self, e1: float, λ: float) -> Row:
        return 1.0, 0.0, self._target


class _Pushed(LawInStep):
    """Actuator: the force is a function of time."""

    part, entry, sign, saved_as = "supplied", "loads", -1.0, "_Pushed"
    _force = _end = _reached = 0.0

    def _wanted(self, step: Step) -> float:
        return value_at(self.law.force, step.load_time, self.link)

    def begin(self, e0: float, step: Step) -> None:
        super().begin(e0, step)
        self._end = self._reached + step.fraction * (-self._wanted(step) - self._reached)
        self._force = self._reached + step.at * (self._end - self._reached)

    def row(self, e1: float, λ: float) -> Row:
        return 0.0, 1.0, self._force

    def accept(self, e1: float, work: float) -> None:
        super().accept(e1, work)
        self._reached = self._end

    def state(self) -> Array:
        return np.array([self._reached])

    def restore(self, state: Array) -> None:
        self._reached = float(state[0])


class _Controlled(_Pushed):
    """Controller: the force is what it said at the beginning of the step."""

    entry, saved_as = "controllers", "_Controlled"

    def _wanted(self, step: Step) -> float:
        return self.setting.asked[self.link]


class _Damped(LawInStep):
    """Damper: viscosity times the mean rate of the step."""

    entry, saved_as = "damping", "_Damped"

    def row(self, e1: float, λ: float) -> Row:
        factor = self.law.viscosity / self.dt
        return -factor, 1.0, -factor * self.e0


class _Stated(LawInStep):
    """Law that states an energy and a resistance, such as a stop."""

    def __init__(self, link: Connector, setting: Setting) -> None:
        super().__init__(link, setting)
        law, scheme, ledger = self.law, setting.scheme, setting.ledger
        self.saved_as = f"{type(law).__qualname__}{[*law.variables]}"
        self._z: State = law.initially()
        self._held, self._loses, self._part = 0.0, not law.elastic, scheme.load_weight
        self._delayed = scheme.weight_of_before == 0 and self._part > 0.5
        ledger.state["stored"] += 0.0
        if self._loses:
            ledger.lost[law.entry] += 0.0
        if self._delayed:
            ledger.lost["numerical"] += 0.0

    def _at_law(self, e1: float) -> tuple[Array, Array, dict[str, Array]]:
        """Motion and rate at the time of the law, and changes of the variables until then."""
        θ = self.setting.scheme.theta
        e, rate = np.array([[(1 - θ) * self.e0 + θ * e1], [(e1 - self.e0) / self.dt]])
        changes = self.law.increments(e, rate, self._z, θ * self.dt) if self.law.variables else {}
        return e, rate, dict(changes)

    def _after(self, changes: Mapping[str, Array], part: float) -> State:
        """Variables after a part of the step."""
        before, of_θ = vars(self._z), part / self.setting.scheme.theta
        return State({name: z + of_θ * changes[name] for name, z in before.items()})

    def _energy(self, e: float, z: State) -> float:
        return float(np.sum(self.law.energy(np.array([e]), z)))

    def _elastic(self, e: float, z: State) -> float:
        """Derivative of the energy by the motion."""
        energy = self.law.energy(np.array([e + 1e-30j]), z)
        return float(np.sum(np.imag(energy))) / 1e-30

    def _force(self, e1: float) -> float:
        """Force of a step to ``e1``: of the energy where loads act, and the resistance."""
        e, rate, changes = self._at_law(e1)
        resistance = self.law.resistance(e, rate, self._after(changes, self._theta), self.dt)
        z, way = self._after(changes, self._part), e1 - self.e0
        elastic = end = self._elastic(e1, z)
        if self._part != 1.0:
            # By Gauss's rule; where the force is not smooth, from the change of the energy.
            mean = self.setting.scheme.mean(lambda e: self._elastic(e, z), self.e0, e1)
            first, middle = (self._elastic(e, z) for e in (self.e0, (self.e0 + e1) / 2))
            if abs(mean - (first + 4 * middle + end) / 6) > 1e-7 * (abs(first) + abs(end)):
                mean = (self._energy(e1, z) - self._energy(self.e0, z)) / way
            elastic = mean + (2 * self._part - 1) * (end - mean)
        return elastic + float(np.sum(resistance))

    @property
    def _theta(self) -> float:
        return self.setting.scheme.theta

    def row(self, e1: float, λ: float) -> Row:
        """The law around an iterate, its slope by central differences."""
        with np.errstate(all="ignore"):
            force = self._force(e1)
            ε = 6e-6 * max(abs(e1 - self.e0), 1e-3 * max(abs(e1), 1e-3 * self.length))
            D = (self._force(e1 + ε) - self._force(e1 - ε)) / (2 * ε)
        return -D, 1.0, force - D * e1

    def accept(self, e1: float, work: float) -> None:
        """Take the variables; what is neither stored nor lost by the scheme is lost."""
        _, _, changes = self._at_law(e1)
        old, new, ledger = self._z, self._after(changes, 1.0), self.setting.ledger
        held, numerical = self._energy(e1, new), 0.0
        if self._delayed:
            growth = self._elastic(e1, new) * (e1 - self.e0)
            for name, z in vars(new).items():
                moved = State({**vars(new), name: z + 1e-30j})
                by_z = float(np.sum(np.imag(self.law.energy(np.array([e1]), moved)))) / 1e-30
                growth += by_z * float((z - getattr(old, name))[0])
            numerical = (2 * self._part - 1) * (self._energy(self.e0, old) - held + growth)
            ledger.lost["numerical"] += numerical
        if self._loses:
            lost = work - (held - self._held) - numerical
            ledger.lost[self.law.entry] += lost
            self.dissipated += lost
        self._held, self._z = held, new

    def start(self, e: float) -> None:
        self.e0, self._held = e, self._energy(e, self._z)

    def enter_state(self, e: float) -> None:
        self.setting.ledger.state["stored"] += self._held

    def change(self, e1: float, work: float) -> float:
        if self._loses:
            return work
        return self._energy(e1, self._z) - self._held

    def borne(self) -> float | None:
        return self._elastic(self.e0, self._z)

    def state(self) -> Array:
        return np.array(
            [*(float(z[0]) for z in vars(self._z).values()), self._held, self.dissipated]
        )

    def restore(self, state: Array) -> None:
        *variables, self._held, self.dissipated = map(float, state)
        self._z = State({n: np.array([z]) for n, z in zip(vars(self._z), variables, strict=True)})


class _Sprung(LawInStep):
    """Spring: a material point whose strain is the motion."""

    saved_as = "_Sprung"

    def __init__(self, link: Connector, setting: Setting) -> None:
        super().__init__(link, setting)
        spring = self.law
        softening = spring.softening
        layout = Layout(
            strains=np.eye(1, 3), weights=np.ones(1), stiffness=np.array([spring.stiffness]),
            laws=((spring.law or Hardening(limit=np.inf), 1),), rest=np.zeros(3),
            softening=softening if softening is not None and softening.opens else None,
            breaking=slice(None),
        )  # fmt: skip
        of = setting.scheme, setting.search, setting.ledger
        self.points = MaterialPoints(layout, [(0, 0)], np.ones(1), *of)
        self.softens = self.points.softens

    def begin(self, e0: float, step: Step) -> None:
        super().begin(e0, step)
        self.points.begin(step.dt)

    def row(self, e1: float, λ: float) -> Row:
        self.points.respond(np.array([[e1, 0.0, 0.0]]))
        f, D = float(self.points.r[0, 0]), float(self.points.D[0, 0, 0])
        return -D, 1.0, f - D * e1

    def accept(self, e1: float, work: float) -> None:
        self.points.accept()
        self.dissipated = float(self.points.kept[0, 4:].sum())

    def start(self, e: float) -> None:
        self.points.start(np.array([[e, 0.0, 0.0]]))
        self.points.refresh()
        self.dissipated = float(self.points.kept[0, 4:].sum())

    def enter_state(self, e: float) -> None:
        self.points.enter_stored()

    def change(self, e1: float, work: float) -> float:
        return self.points.change()

    def require_dissipation(self, e1: float) -> None:
        self.points.require_dissipation([str(self.link)])

    def borne(self) -> float | None:
        return float(self.points.kept[0, 0])

    def state(self) -> Array:
        return np.asarray(self.points.state()[0])

    def restore(self, state: Array) -> None:
        self.points.restore([0], state[None])

    @property
    def excess(self) -> Any:
        return self.points.excess

    def release(self, least: float) -> None:
        self.points.release(least)

    def close(self) -> None:
        self.points.close()


# -- friction and plastic hinges -----------------------------------------------------------------


class _Rubbing(LawInStep):
    """Dry friction: it sticks, or slips one way or the other (-1, 1)."""

    entry, saved_as = "friction", "_Rubbing"
    _slip = _accepted = 0.0

    def begin(self, e0: float, step: Step) -> None:
        super().begin(e0, step)
        self._limit = self.setting.asked[self.link]
        softness = CREEP * self.length * self.setting.friction_repeats
        self._creep = softness / self._limit if self._limit > 0 else 0.0
        # With this way the velocity at the end is zero; with none, that before would come back.
        self._way = way_to_rest(self.setting.scheme, step.dt) * self.setting.rates[self.link]
        self.again()

    def again(self) -> None:
        self._slip, self._against, self._guessed = self._accepted, False, True

    def row(self, e1: float, λ: float) -> Row:
        """Stick while the force is below the limit; slip until the sliding velocity reverses."""
        moved = e1 - self.e0
        stuck = self._slip == 0
        # Coming to rest must not give energy; if it did, the place is held at once in this step.
        # The force of the guess does not decide this: it belongs to another motion.
        if not self._guessed and stuck and λ * self._way < 0:
            self._against = True
        self._guessed = False
        if not self._against and self._slip * self._way > 0:
            moved -= self._way  # rest at the end, rather than a reversed velocity
        if not stuck and self._slip * moved < -1e-14 * self.length:
            self._slip = 0.0
        elif stuck and abs(λ) > self._limit * (1 + 1e-12):
            self._slip = math.copysign(1.0, λ)
        if self._slip == 0 and self._limit > 0:
            return 1.0, -self._creep, self.e0 + (0.0 if self._against else self._way)
        return 0.0, 1.0, self._slip * self._limit

    def accept(self, e1: float, work: float) -> None:
        super().accept(e1, work)
        self._accepted = self._slip

    def state(self) -> Array:
        return np.array([self._accepted])

    def restore(self, state: Array) -> None:
        self._slip = self._accepted = float(state[0])


class _Slipping(LawInStep):
    """Rigid-plastic connector, such as a plastic hinge: held up to a limit, then a law of slip.

    With R the resistance after the motion m, and any r > 0, the equation for the force λ is

        r m = 0 where |λ + r m| <= R, else λ = R or -R:

    its residual is continuous in λ and m, as Newton's method wants.
    """

    saved_as = "CompiledSlips"
    softens = True

    def __init__(self, link: Connector, setting: Setting) -> None:
        super().__init__(link, setting)
        law, scheme, ledger = law_of(link), setting.scheme, setting.ledger
        self._law = law
        self.at: dict[str, Any] = {name: float(x) for name, x in numbers(law).items()}
        self.at |= {"slipped": 0.0, "start": 0.0, "θ": scheme.theta, "dt": 1.0}
        self._limit, self._back_force, self._stored = float(law.limit), 0.0, 0.0
        self._way = self._way_before = 0  # of the slip in the iterate, and in the last step
        self._flows, self.excess = CLOSED, 0.0
        self._hardens, self.slope = isinstance(law, Hardening), _slope(link, setting.size)
        ledger.lost["hinges"] += 0.0
        if self._hardens:
            ledger.state["hardening"] += 0.0
        self._loss = 2 * scheme.alpha if self._hardens else 0.0
        if self._loss:
            ledger.lost["numerical"] += 0.0

    def begin(self, e0: float, step: Step) -> None:
        super().begin(e0, step)
        self.at["dt"] = step.dt
        self.again()

    def again(self) -> None:
        self._way = self._way_before

    def _slip(self, grown: Any, way: int) -> Slip:
        at = {**self.at, "slip": grown, "direction": way}
        return slip(self._law, at, self.setting.scheme)

    def _force(self, motion: float, way: int) -> tuple[float, float]:
        """Force of a slip, and its derivative by the motion."""
        grown = np.array([max(way * motion, 0.0)])
        force, slope = derivative(lambda a: self._slip(a, way).force, grown)
        return float(force[0]), way * float(slope[0])

    def row(self, e1: float, λ: float) -> Row:
        """α, β, γ around an iterate, whose direction of slip is found first."""
        motion, r = e1 - self.at["start"], self.slope
        self._way = self._direction(motion, λ)
        if self._way == 0:
            return 1.0, 0.0, self.at["start"]
        force, slope = self._force(motion, self._way)
        return slope / r, -1 / r, (slope * e1 - force) / r

    def _direction(self, motion: float, λ: float) -> int:
        """Direction in which the connector slips in an iterate, or 0 if it is held."""
        limit = self._limit * (1 + 1e-12)
        tested = λ - self._back_force + self.slope * motion
        self.excess, way = 0.0, -1 if tested < 0 else 1
        if limit == 0:
            return -1 if motion < 0 else 1
        if self.setting.search.hold and self._flows == CLOSED:
            if abs(tested) > limit:
                self.excess = abs(tested) / self._limit - 1
                self.setting.search.over = True
            return 0
        if way * motion <= 0:
            return way if abs(tested) > limit else 0
        force, _ = self._force(motion, way)
        return way if way * (λ + self.slope * motion - force) > 0 else 0

    def accept(self, e1: float, work: float) -> None:
        """Take the slip of the step as the new state."""
        grown, ledger = max(self._way * (e1 - self.at["start"]), 0.0), self.setting.ledger
        if math.isfinite(self._limit):
            end = self._slip(grown, self._way)
            self.dissipated += float(end.dissipated)
            ledger.lost["hinges"] += float(end.dissipated)
            if self._loss:
                ledger.lost["numerical"] += self._loss * float(end.lost)
            self._stored = float(end.stored)
            self._limit, self._back_force = float(end.limit), float(end.back_force)
        self._flows = FLOWING if grown > 0 else CLOSED
        self.at["slipped"] += grown
        self.at["start"] += self._way * grown
        self._way_before = self._way * int(grown > 0)

    def start(self, e: float) -> None:
        self.at["start"] = e

    def enter_state(self, e: float) -> None:
        if self._hardens:
            self.setting.ledger.state["hardening"] += self._stored

    def motion(self, e: float) -> float:
        """Motion without the round-off of what is held."""
        return float(self.at["start"])

    def state(self) -> Array:
        of = self._limit, self._back_force, self.dissipated, self._way_before, self._stored
        return np.array([self.at["slipped"], self.at["start"], *of])

    def restore(self, state: Array) -> None:
        self.at["slipped"], self.at["start"], self._limit, self._back_force = map(float, state[:4])
        self.dissipated, self._way_before, self._stored = float(state[4]), int(state[5]), state[6]
        self._flows = FLOWING if self._way_before else CLOSED

    def release(self, least: float) -> None:
        if self.excess > 0 and self.excess >= least:
            self._flows = RELEASED

    def close(self) -> None:
        self._flows = FLOWING if self._way_before else CLOSED


def _slope(link: Connector, size: float) -> float:
    """Factor r of motions beside forces in the equation of a rigid-plastic connector.

    It is above the steepest softening, so that an open branch is found open; and so large that
    motions, not the round-off of forces, say in which direction a weak hinge slips.
    """
    law = law_of(link)
    if not 0.0 < law.limit < np.inf:
        return 1.0
    steepest, _ = law.steepest
    early = law.limit / (EARLY * (1.0 if link.turns else size))
    least = WEAK * link.a.beam.section.EI / size if isinstance(link.a, Place) else 0.0
    return float(max(early, least) + (2 * steepest if steepest < np.inf else 0.0))


# -- functions of users --------------------------------------------------------------------------


class _Asked(LawInStep):
    """Force law of a user: a function of motion and rate, of time and its own history."""

    entry, saved_as = "functions", "AskedLaws"
    _held = 0.0

    def __init__(self, link: Connector, setting: Setting) -> None:
        super().__init__(link, setting)
        self._weight = setting.scheme.load_weight
        self._variables: Array = np.array(self.law.state)
        self._last: tuple[float, float, float, float] | None = None
        self._known: dict[str, Any] = {}

    def begin(self, e0: float, step: Step) -> None:
        super().begin(e0, step)
        part = step.fraction * step.at
        t = step.load_time if part == 1.0 else step.t0 + part * (step.load_time - step.t0)
        state = self._variables.copy()
        state.flags.writeable = False  # iterates begin with the same one
        self._known = {"t": t, "dt": step.dt, "state": state}
        self.again()

    def again(self) -> None:
        self._last = None

    def _respond(self, e1: float) -> tuple[float, Array]:
        """Force, and internal variables after a step to the motion ``e1``."""
        motion, rate = (1 - self._weight) * self.e0 + self._weight * e1, (e1 - self.e0) / self.dt
        known = {name: self._known[name] for name in self.law.asked}
        value, after = self.law.force(motion, rate, **known), self._variables
        at = f"motion = {motion:.6g}, rate = {rate:.6g}, t = {self._known['t']:.9g} s"
        if after.size:
            try:
                value, after = value
                after = np.array(after, dtype=np.float64).reshape(self._variables.shape)
            except (TypeError, ValueError):
                raise SceneError(
                    f"{self.link}: the function must return the force and the state, a list of "
                    f"{self._variables.size} numbers"
                ) from None
        force = require_returned(value, f"{self.link}: the function", at)
        for number in (force, *map(float, after)):
            if not math.isfinite(number):  # a shorter step may not come there
                raise NoNumber(f"{self.link}: the function returned {number} at {at}")
        return force, after

    def _at(self, e1: float) -> float:
        return self._respond(e1)[0]

    def row(self, e1: float, λ: float) -> Row:
        """The law around an iterate.

        Where it has an infinite slope, Newton's method goes from one side to the other for ever.
        The two latest iterates tell how the rest of the scene yields: the law is taken where it
        meets this line, if that is between ``e1`` and the place before.
        """
        force, last, at = self._at(e1), self._last, e1
        missed = force - λ
        if last is not None and abs(missed) > abs(last[2]) / 2 and e1 != last[0]:
            yielding = max(0.0, (last[1] - λ) / (e1 - last[0]))

            def excess(x: float) -> float:
                return self._at(x) - λ + yielding * (x - e1)

            if excess(e1) * excess(last[3]) < 0:
                at = float(scipy.optimize.brentq(excess, e1, last[3], xtol=1e-300, maxiter=2000))
                force = self._at(at)
        slope = self._slope(at, force)
        self._last = e1, λ, missed, at
        return -slope, 1.0, force - slope * at

    def _slope(self, e: float, force: float) -> float:
        """Derivative of the force by central differences, over the third root of round-off."""
        ε = 6e-6 * max(abs(e - self.e0), 1e-3 * max(abs(e), 1e-3 * self.length))
        near = 6e-6 * max(abs(e), 0.0 if self._last is None else abs(self._last[3]))
        if 0.0 < near < ε:  # beside zero, where the slope may be infinite
            change = self._at(e + near) - self._at(e - near)
            if abs(change) > 1e-8 * abs(force):
                return change / (2 * near)
        return (self._at(e + ε) - self._at(e - ε)) / (2 * ε)

    def _energy(self, e: float) -> float:
        """Energy that can be had back; J."""
        if self.law.stored is None:
            return 0.0
        value = self.law.stored(
            e, **dict.fromkeys(self.law.asked_by_stored, self._variables.copy())
        )
        return require_returned(value, f"{self.link}: the energy", f"motion = {e:.6g}", finite=True)

    def accept(self, e1: float, work: float) -> None:
        """Enter what is not stored of the work, and take the internal variables."""
        before, (_, self._variables) = self._held, self._respond(e1)
        self._held = self._energy(e1)
        super().accept(e1, work - (self._held - before))

    def enter_state(self, e: float) -> None:
        self._held = self._energy(e)
        self.setting.ledger.state["stored"] += self._held

    def state(self) -> Array:
        return self._variables

    def restore(self, state: Array) -> None:
        self._variables = state.copy()


LAWS: dict[type, type[LawInStep]] = {
    Motor: _Driven, Actuator: _Pushed, Controller: _Controlled, Damper: _Damped,
    Spring: _Sprung, Coulomb: _Rubbing, RigidPlastic: _Slipping, ForceLaw: _Asked,
}  # fmt: skip


def law_in_step(link: Connector, setting: Setting) -> LawInStep:
    """Law of a connector in a step."""
    if isinstance(link.law, ConnectorLaw):
        return _Stated(link, setting)
    return (_Held if link.law is HELD else LAWS[type(link.law)])(link, setting)
