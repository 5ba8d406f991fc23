# SPDX-License-Identifier: MIT
"""Laws of connectors over a step: one row ``α e + β λ = γ`` each, linear around an iterate.

e is the relative motion at the end of the step and λ the force that resists its growth.  A law is
a class: ``row`` states the equation, ``z`` has the internal variables, ``stored`` the energies.
"""

from __future__ import annotations

import math
from abc import ABC, abstractmethod
from collections.abc import Callable, Mapping
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
from ufl_beam.model.connectors import Connector, law_of
from ufl_beam.model.fibres import Layout
from ufl_beam.model.functions import value_at
from ufl_beam.model.material_law import State
from ufl_beam.model.material_laws import Hardening
from ufl_beam.reference.cells import Ledger
from ufl_beam.reference.points import MaterialPoints, Search, derivative

CREEP = 1e-12
"""Part of the size of the scene, or rad, by which what sticks creeps in a step under its limit.

Only where several places that stick hold the same motion: so they share the force.
"""

EARLY, WEAK = 0.01, 1e-9
"""Motion, in rad or sizes of the scene, that counts as much as the limit in deciding whether a
rigid-plastic connector slips in an iterate; least factor of motions, in EI over that size."""

Row = tuple[float, float, float]
"""α, β, γ."""

Motions = Any
"""A relative motion, or an array of the components of a bushing; m or rad."""


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


class LawInStep(ABC):
    """Law of a connector in a step; its work is entered in ``entry`` of the ledger, if it has one.

    Attributes:
        saved_as: Name of the internal variables, that of the package's class.
        z: Internal variables of the accepted state; "dissipated" is what yielding, slip and laws of
            users have lost since the beginning, J.
        stored: Energies in the accepted state, by entry of the ledger; J.
        opening: What opens beyond a limit, if the law does; see ``Solver._equilibrium``.
        slope: Factor that rows about the force were divided by.
    """

    part, entry, sign, saved_as = "lost", "", 1.0, ""
    slope = 1.0

    def __init__(self, link: Connector, setting: Setting) -> None:
        self.link, self.setting, self.e0, self.dt = link, setting, 0.0, 1.0
        self.law: Any = link.law
        self.length = 1.0 if link.turns else setting.size  # of a motion that is large
        self.z: dict[str, float] = {}
        self.stored: dict[str, float] = {}
        self.opening: MaterialPoints | _Slipping | _Holding | None = None
        if self.entry:
            getattr(setting.ledger, self.part)[self.entry] += 0.0

    def begin(self, e0: float, step: Step) -> None:
        """Begin a step at the motion ``e0``; what iterates have tried is forgotten."""
        self.e0, self.dt = e0, step.dt

    @abstractmethod
    def row(self, e1: float, λ: float) -> Row:
        """α, β, γ around an iterate."""

    def change(self, e1: float, work: float) -> float:
        """Energy that is stored, dissipated or given away in a step; J.

        Raises:
            StepFailed: A law that must dissipate gives energy.
        """
        return work

    def accept(self, e1: float, work: float) -> None:
        """Take the end of the step; the connector has taken ``work`` in it."""
        if self.entry:
            getattr(self.setting.ledger, self.part)[self.entry] += self.sign * work

    def start(self, e: float) -> float:
        """Begin at a motion that no step has led to; return the force that the law has there."""
        return 0.0

    def motion(self, e: float) -> float:
        """Motion as solutions show it."""
        return e

    def state(self) -> Array:
        """Return the internal variables as a row."""
        return np.array([*self.z.values()])

    def restore(self, row: Array) -> None:
        """Take over internal variables."""
        self.z = dict(zip(self.z, map(float, row), strict=True))


def around(force: Callable[[float], float], e: float, ε: float) -> Row:
    """Row of a law whose force is a function of the motion, by central differences."""
    D = (force(e + ε) - force(e - ε)) / (2 * ε)
    return -D, 1.0, force(e) - D * e


def small_way(e0: float, e1: float, length: float) -> float:
    """Third root of round-off, as a part of the step: it suits central differences."""
    return 6e-6 * max(abs(e1 - e0), 1e-3 * max(abs(e1), 1e-3 * length))


# -- what is held, driven, pushed, damped --------------------------------------------------------


class _Known(LawInStep):
    """Law whose row is known as the step begins: of what is held, driven, pushed or damped."""

    KINDS = {  # noqa: RUF012
        Motor: ("supplied", "motors", -1.0, "_Driven"),
        Actuator: ("supplied", "loads", -1.0, "_Pushed"),
        Controller: ("supplied", "controllers", -1.0, "_Controlled"),
        Damper: ("lost", "damping", 1.0, "_Damped"),
    }

    def __init__(self, link: Connector, setting: Setting) -> None:
        held = "lost", "", 1.0, "_Held"  # by a joint: no motion, no work
        kind = held if link.law is HELD else self.KINDS[type(link.law)]
        self.part, self.entry, self.sign, self.saved_as = kind
        super().__init__(link, setting)
        self._gives_force = isinstance(link.law, Actuator | Controller)
        self.z = {"reached": 0.0} if self._gives_force else {}

    def begin(self, e0: float, step: Step) -> None:
        super().begin(e0, step)
        law, link = self.law, self.link
        if law is HELD:
            self._row = 1.0, 0.0, 0.0
        elif isinstance(law, Motor):
            wanted = value_at(law.motion, step.motion_time, link)
            self._row = 1.0, 0.0, e0 + step.fraction * (wanted - e0)
        elif isinstance(law, Damper):
            factor = law.viscosity / step.dt
            self._row = -factor, 1.0, -factor * e0
        else:  # a controller is asked as the step begins
            asked, reached = self.setting.asked.get(link), self.z["reached"]
            wanted = value_at(law.force, step.load_time, link) if asked is None else asked
            growth = step.fraction * (-wanted - reached)
            self._row, self._end = (0.0, 1.0, reached + step.at * growth), reached + growth

    def row(self, e1: float, λ: float) -> Row:
        return self._row

    def accept(self, e1: float, work: float) -> None:
        super().accept(e1, work)
        if self._gives_force:
            self.z["reached"] = self._end


# -- energies, resistances and springs -----------------------------------------------------------


class _Stated(LawInStep):
    """Law that states an energy and a resistance, such as a stop."""

    def __init__(self, link: Connector, setting: Setting) -> None:
        super().__init__(link, setting)
        law, scheme, ledger = self.law, setting.scheme, setting.ledger
        self.saved_as = f"{type(law).__qualname__}{[*law.variables]}"
        self.z = {**{name: float(x) for name, x in law.variables.items()}, "held": 0.0}
        self.z["dissipated"] = 0.0
        self._loses, self._part, self._θ = not law.elastic, scheme.load_weight, scheme.theta
        self._delayed = scheme.weight_of_before == 0 and self._part > 0.5
        if self._loses:
            ledger.lost[law.entry] += 0.0
        if self._delayed:
            ledger.lost["numerical"] += 0.0

    def _after(self, e1: Motions, part: float) -> State:
        """Variables after a part of the step to ``e1``; they grow in proportion."""
        z = {name: np.array([self.z[name]]) for name in self.law.variables}
        if part and z:
            e, rate = self._at_law(e1)
            changes = self.law.increments(e, rate, State(z), self._θ * self.dt)
            z = {name: x + part / self._θ * changes[name] for name, x in z.items()}
        return State(z)

    def _at_law(self, e1: Motions) -> tuple[Any, Any]:
        """Motions and rates at the time of the law, as its methods get them."""
        e0, e1 = np.atleast_1d(self.e0), np.atleast_1d(e1)
        return tuple(
            self.law.given([np.array([x]) for x in values])
            for values in ((1 - self._θ) * e0 + self._θ * e1, (e1 - e0) / self.dt)
        )

    def _energy(self, e: Motions, z: State) -> float:
        motion = self.law.given([np.array([x]) for x in np.atleast_1d(e)])
        return float(np.sum(self.law.energy(motion, z)))

    def _elastic(self, e: Array, z: State) -> Array:
        """Derivatives of the energy by the motions; (k,)."""
        forces = self.law.elastic_forces([np.array([x]) for x in e], z)
        return np.array([float(np.sum(force)) for force in forces])

    def _by_variable(self, e: Motions, z: State, name: str) -> float:
        """Derivative of the energy by a variable, by a complex step."""
        moved = State({n: x + 1e-30j if n == name else x for n, x in vars(z).items()})
        motion = self.law.given([np.array([x]) for x in np.atleast_1d(e)])
        return float(np.sum(np.imag(self.law.energy(motion, moved)))) / 1e-30

    def _forces(self, e1: Array) -> Array:
        """Forces of a step to ``e1``: of the energy where loads act, and the resistance; (k,)."""
        e0, z = np.atleast_1d(self.e0), self._after(e1, self._part)
        resistance = self.law.resistance(*self._at_law(e1), self._after(e1, self._θ), self.dt)
        elastic = end = self._elastic(e1, z)
        if self._part != 1.0:
            # By Gauss's rule; where the forces are not smooth, from the change of the energy.
            way, mean = e1 - e0, self.setting.scheme.mean(lambda e: self._elastic(e, z), e0, e1)
            first, middle = (self._elastic(e, z) for e in (e0, (e0 + e1) / 2))
            errors = (mean - (first + 4 * middle + end) / 6) * way
            if np.abs(errors).sum() > 1e-7 * ((np.abs(first) + np.abs(end)) @ np.abs(way)):
                missing = self._energy(e1, z) - self._energy(e0, z) - mean @ way
                groups = (slice(2), slice(2, None))  # displacements, rotation
                shares = np.array([errors[group].sum() ** 2 for group in groups])
                for group, share in zip(groups, shares / shares.sum(), strict=True):
                    if way[group].any():
                        mean[group] += missing * share * way[group] / (way[group] @ way[group])
            elastic = mean + (2 * self._part - 1) * (end - mean)
        return elastic + [float(np.sum(force)) for force in self.law.each(resistance)]

    def row(self, e1: Motions, λ: Motions) -> Any:
        """The law around an iterate, a row for each component; (k, k + 2)."""
        e0, e1 = np.atleast_1d(self.e0), np.atleast_1d(e1)
        lengths, slopes = [self.length] if len(e1) == 1 else [self.length, self.length, 1.0], []
        with np.errstate(all="ignore"):
            for i, ε in enumerate(map(small_way, e0, e1, lengths)):
                moved = ε * np.eye(len(e1))[i]
                slopes.append((self._forces(e1 + moved) - self._forces(e1 - moved)) / (2 * ε))
            D, force = np.transpose(slopes), self._forces(e1)
        return np.column_stack([-D, np.ones(len(e1)), force - D @ e1])

    def change(self, e1: Motions, work: float) -> float:
        if self._loses:
            return work
        return self._energy(e1, self._after(e1, 0.0)) - self.z["held"]

    def accept(self, e1: Motions, work: float) -> None:
        """Take the variables; what is neither stored nor lost by the scheme is lost."""
        old, new, ledger = self._after(e1, 0.0), self._after(e1, 1.0), self.setting.ledger
        held, numerical = self._energy(e1, new), 0.0
        if self._delayed:
            e0, e = np.atleast_1d(self.e0), np.atleast_1d(e1)
            growth = float(self._elastic(e, new) @ (e - e0))
            for name, z in vars(new).items():
                growth += self._by_variable(e1, new, name) * float((z - getattr(old, name))[0])
            numerical = (2 * self._part - 1) * (self._energy(self.e0, old) - held + growth)
            ledger.lost["numerical"] += numerical
        if self._loses:
            lost = work - (held - self.z["held"]) - numerical
            ledger.lost[self.law.entry] += lost
            self.z["dissipated"] += lost
        self.z |= {name: float(x[0]) for name, x in vars(new).items()} | {"held": held}
        self.stored = {"stored": held}

    def start(self, e: Motions) -> Any:
        z = self._after(e, 0.0)
        self.z["held"] = self._energy(e, z)
        self.stored = {"stored": self.z["held"]}
        return self._elastic(np.atleast_1d(e), z)


class _Sprung(LawInStep):
    """Spring: a material point whose strain is the motion."""

    saved_as = "_Sprung"

    def __init__(self, link: Connector, setting: Setting) -> None:
        super().__init__(link, setting)
        law, softening = self.law.law or Hardening(limit=np.inf), self.law.softening
        layout = Layout(
            strains=np.eye(1, 3), weights=np.ones(1), stiffness=np.array([self.law.stiffness]),
            laws=((law, 1),), rest=np.zeros(3), breaking=slice(None),
            softening=softening if softening is not None and softening.opens else None,
        )  # fmt: skip
        of = setting.scheme, setting.search, setting.ledger
        self._points = MaterialPoints(layout, [(0, 0)], np.ones(1), *of)
        self.stored = self._points.stored
        self.opening = self._points if self._points.softens else None

    def begin(self, e0: float, step: Step) -> None:
        self._points.begin(step.dt)

    def row(self, e1: float, λ: float) -> Row:
        self._points.respond(np.array([[e1, 0.0, 0.0]]))
        f, D = float(self._points.r[0, 0]), float(self._points.D[0, 0, 0])
        return -D, 1.0, f - D * e1

    def change(self, e1: float, work: float) -> float:
        self._points.require_dissipation([str(self.link)])
        return self._points.change()

    def accept(self, e1: float, work: float) -> None:
        self._points.accept()
        self.start(e1)

    def start(self, e: float) -> float:
        self._points.start(np.array([[e, 0.0, 0.0]]))
        self.stored = self._points.stored
        self.z["dissipated"] = float(self._points.kept[0, 4:].sum())
        return float(self._points.kept[0, 0])

    def state(self) -> Array:
        return np.asarray(self._points.state()[0])

    def restore(self, row: Array) -> None:
        self._points.restore(row[None])


# -- friction and plastic hinges -----------------------------------------------------------------


class _Rubbing(LawInStep):
    """Dry friction: it sticks, or slips one way or the other (-1, 1)."""

    entry, saved_as = "friction", "_Rubbing"

    def __init__(self, link: Connector, setting: Setting) -> None:
        super().__init__(link, setting)
        self.z = {"slip": 0.0}

    def begin(self, e0: float, step: Step) -> None:
        super().begin(e0, step)
        self._limit = self._limit_now()
        softness = CREEP * self.length * self.setting.friction_repeats
        self._creep = softness / self._limit if self._limit > 0 else 0.0
        # With this way the velocity at the end is zero; with none, that before would come back.
        self._way = way_to_rest(self.setting.scheme, step.dt) * self.setting.rates[self.link]
        self._slip, self._against, self._guessed = self.z["slip"], False, True

    def _limit_now(self) -> float:
        return self.setting.asked[self.link]

    def row(self, e1: float, λ: float) -> Row:
        """Stick while the force is below the limit; slip until the sliding velocity reverses."""
        moved = e1 - self.e0
        stuck = self._slip == 0
        if not self._against and self._slip * self._way > 0:
            moved -= self._way  # rest at the end, rather than a reversed velocity
        back = not stuck and self._slip * moved < -1e-14 * self.length
        # Coming to rest must not give energy; if it did, the place is held at once in this step.
        # The force of the guess does not decide this: it belongs to another motion.
        gives = not self._guessed and not self._against and stuck and λ * self._way < 0
        over = stuck and abs(λ) > self._limit * (1 + 1e-12)
        self._guessed = False
        if self._may_change(back or gives, over, λ):
            self._against |= gives
            if back:
                self._slip = 0.0
            elif over:
                self._slip = math.copysign(1.0, λ)
        if self._slip == 0 and self._limit > 0:
            return 1.0, -self._creep, self.e0 + (0.0 if self._against else self._way)
        return self._sliding(e1)

    def _may_change(self, turns: bool, over: bool, λ: float) -> bool:
        return True

    def _sliding(self, e1: float) -> Row:
        return 0.0, 1.0, self._slip * self._limit

    def accept(self, e1: float, work: float) -> None:
        super().accept(e1, work)
        self.z["slip"] = self._slip


class _Holding(_Rubbing):
    """Law of a user that holds the motion up to a limit, and slides beyond it.

    Its sliding force may be below the limit, so that to stick and to slide can both be solutions.
    It goes on as in the last step until an equilibrium is found that does not admit this.

    Attributes:
        excess: Infinite if it slides back or its coming to rest gives energy; ``|force| / limit -
            1`` if it is held and bears too much; else 0.
    """

    def __init__(self, link: Connector, setting: Setting) -> None:
        self.entry = link.law.entry  # type: ignore[union-attr]
        super().__init__(link, setting)
        law, self.opening = self.law, self
        self._free, self.excess = False, 0.0
        self.saved_as, self._θ = f"{type(law).__qualname__}{[*law.variables]}", setting.scheme.theta
        self.z |= {name: float(x) for name, x in law.variables.items()}
        self.z |= {"held": 0.0, "dissipated": 0.0}
        self.stored = {"stored": 0.0}

    def _may_change(self, turns: bool, over: bool, λ: float) -> bool:
        self.excess = 0.0
        if self._free or not self.setting.search.hold:
            return True
        if turns or over:
            self.excess = math.inf if turns or not self._limit else abs(λ) / self._limit - 1
            self.setting.search.over = True
        return False

    def release(self, least: float) -> None:
        """Let it change in the iterates from now on if its excess is so large."""
        self._free |= self.excess > 0 and self.excess >= least

    def close(self) -> None:
        """Take the release back."""
        self._free = False

    def _state(self) -> State:
        return State({name: np.array([self.z[name]]) for name in self.law.variables})

    def _limit_now(self) -> float:
        return max(float(np.sum(self.law.limit(self._state()))), 0.0)

    def _after(self, e1: float, part: float) -> tuple[Array, Array, State]:
        """Motion and rate at the time of the law, and variables after a part of the step."""
        e, rate = np.array([(1 - self._θ) * self.e0 + self._θ * e1]), np.array([e1 - self.e0])
        rate, old = rate / self.dt, self._state()
        if not vars(old):
            return e, rate, old
        changes = self.law.increments(e, rate, old, self._θ * self.dt)
        z = {name: x + part / self._θ * changes[name] for name, x in vars(old).items()}
        return e, rate, State(z)

    def _sliding(self, e1: float) -> Row:
        def force(e: float) -> float:
            return self._slip * float(np.sum(self.law.sliding(*self._after(e, self._θ), self.dt)))

        return around(force, e1, small_way(self.e0, e1, self.length))

    def accept(self, e1: float, work: float) -> None:
        *_, new = self._after(e1, 1.0)
        super().accept(e1, work)
        self.z |= {name: float(x[0]) for name, x in vars(new).items()}
        self.z["dissipated"] += work


class _Slipping(LawInStep):
    """Rigid-plastic connector, such as a plastic hinge: held up to a limit, then a law of slip.

    With R the resistance after the motion m, and any r > 0, the equation for the force λ is

        r m = 0 where |λ + r m| <= R, else λ = R or -R:

    its residual is continuous in λ and m, as Newton's method wants.

    Attributes:
        excess: ``|force| / limit - 1`` if it is held closed and bears too much, else 0.
    """

    saved_as = "CompiledSlips"

    def __init__(self, link: Connector, setting: Setting) -> None:
        super().__init__(link, setting)
        law, self.opening, self.slope = law_of(link), self, _slope(link, setting.size)
        self._law, self._numbers = law, {name: float(x) for name, x in numbers(law).items()}
        self.z = {"slipped": 0.0, "start": 0.0, "limit": float(law.limit), "back force": 0.0}
        self.z |= {"dissipated": 0.0, "way": 0.0, "stored": 0.0}
        self._released, self.excess, self._hardens = False, 0.0, isinstance(law, Hardening)
        setting.ledger.lost["hinges"] += 0.0
        self._loss = 2 * setting.scheme.alpha if self._hardens else 0.0
        if self._loss:
            setting.ledger.lost["numerical"] += 0.0

    def begin(self, e0: float, step: Step) -> None:
        super().begin(e0, step)
        self._way = int(self.z["way"])  # of the slip in the iterate; at first that of the last step

    def _slip(self, grown: Any, way: int) -> Slip:
        at = {**self._numbers, **self.z, "θ": self.setting.scheme.theta, "dt": self.dt}
        return slip(self._law, {**at, "slip": grown, "direction": way}, self.setting.scheme)

    def _force(self, motion: float, way: int) -> tuple[float, float]:
        """Force of a slip, and its derivative by the motion."""
        grown = np.array([max(way * motion, 0.0)])
        force, slope = derivative(lambda a: self._slip(a, way).force, grown)
        return float(force[0]), way * float(slope[0])

    def row(self, e1: float, λ: float) -> Row:
        """α, β, γ around an iterate, whose direction of slip is found first."""
        motion, r = e1 - self.z["start"], self.slope
        self._way = self._direction(motion, λ)
        if self._way == 0:
            return 1.0, 0.0, self.z["start"]
        force, slope = self._force(motion, self._way)
        return slope / r, -1 / r, (slope * e1 - force) / r

    def _direction(self, motion: float, λ: float) -> int:
        """Direction in which the connector slips in an iterate, or 0 if it is held."""
        limit, search = self.z["limit"], self.setting.search
        tested = λ - self.z["back force"] + self.slope * motion
        over, way = abs(tested) > limit * (1 + 1e-12), -1 if tested < 0 else 1
        self.excess = 0.0
        if limit == 0:
            return -1 if motion < 0 else 1
        if search.hold and not self.z["way"] and not self._released:
            if over:
                self.excess, search.over = abs(tested) / limit - 1, True
            return 0
        if way * motion <= 0:
            return way * over
        force, _ = self._force(motion, way)
        return way if way * (λ + self.slope * motion - force) > 0 else 0

    def release(self, least: float) -> None:
        """Let it open from now on if its excess is so large."""
        self._released |= self.excess > 0 and self.excess >= least

    def close(self) -> None:
        """Take the release back."""
        self._released = False

    def accept(self, e1: float, work: float) -> None:
        """Take the slip of the step as the new state."""
        grown, ledger = max(self._way * (e1 - self.z["start"]), 0.0), self.setting.ledger
        if math.isfinite(self.z["limit"]):
            end = self._slip(grown, self._way)
            ledger.lost["hinges"] += float(end.dissipated)
            if self._loss:
                ledger.lost["numerical"] += self._loss * float(end.lost)
            self.z["dissipated"] += float(end.dissipated)
            self.z |= {"limit": float(end.limit), "back force": float(end.back_force)}
            self.z["stored"] = float(end.stored)
        self.z["slipped"] += grown
        self.z["way"] = float(self._way * (grown > 0))
        self.start(self.z["start"] + self._way * grown)

    def start(self, e: float) -> float:
        self.z["start"] = e
        if self._hardens:
            self.stored = {"hardening": self.z["stored"]}
        return 0.0

    def motion(self, e: float) -> float:
        """Motion without the round-off of what is held."""
        return self.z["start"]


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

    def __init__(self, link: Connector, setting: Setting) -> None:
        super().__init__(link, setting)
        self.z = {str(i): float(x) for i, x in enumerate(self.law.state)}
        self.stored = {"stored": 0.0}

    def begin(self, e0: float, step: Step) -> None:
        super().begin(e0, step)
        part = step.fraction * step.at
        t = step.load_time if part == 1.0 else step.t0 + part * (step.load_time - step.t0)
        state = self.state()
        state.flags.writeable = False  # iterates begin with the same one
        self._known = {"t": t, "dt": step.dt, "state": state}
        self._last: tuple[float, float, float, float] | None = None  # e, λ, residual, place of law

    def _respond(self, e1: float) -> tuple[float, Array]:
        """Force, and internal variables after a step to the motion ``e1``."""
        w = self.setting.scheme.load_weight
        motion, rate = (1 - w) * self.e0 + w * e1, (e1 - self.e0) / self.dt
        known = {name: self._known[name] for name in self.law.asked}
        value, after = self.law.force(motion, rate, **known), self.state()
        at = f"motion = {motion:.6g}, rate = {rate:.6g}, t = {self._known['t']:.9g} s"
        if self.z:
            try:
                value, after = value
                after = np.array(after, dtype=np.float64).reshape(len(self.z))
            except (TypeError, ValueError):
                raise SceneError(
                    f"{self.link}: the function must return the force and the state, a list of "
                    f"{len(self.z)} numbers"
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
        ε = small_way(self.e0, at, self.length)
        near = 6e-6 * max(abs(at), 0.0 if last is None else abs(last[3]))
        if 0.0 < near < ε:  # beside zero, where the slope may be infinite
            steep = abs(self._at(at + near) - self._at(at - near)) > 1e-8 * abs(self._at(at))
            ε = near if steep else ε
        self._last = e1, λ, missed, at
        return around(self._at, at, ε)

    def accept(self, e1: float, work: float) -> None:
        """Enter what is not stored of the work, and take the internal variables."""
        before, (_, after) = self.stored["stored"], self._respond(e1)
        self.restore(after)
        self.start(e1)
        super().accept(e1, work - (self.stored["stored"] - before))

    def start(self, e: float) -> float:
        """Take the energy that can be had back; J."""
        if self.law.stored is not None:
            value = self.law.stored(e, **dict.fromkeys(self.law.asked_by_stored, self.state()))
            of, at = f"{self.link}: the energy", f"motion = {e:.6g}"
            self.stored = {"stored": require_returned(value, of, at, finite=True)}
        return 0.0


LAWS: dict[type, type[LawInStep]] = {
    **dict.fromkeys(_Known.KINDS, _Known), ConnectorLaw: _Stated, Spring: _Sprung,
    Coulomb: _Rubbing, RigidPlastic: _Slipping, ForceLaw: _Asked,
}  # fmt: skip
"""Law in a step by the class of a record, or by its base."""


def law_in_step(link: Connector, setting: Setting) -> LawInStep:
    """Law of a connector in a step."""
    if isinstance(link.law, ConnectorLaw) and link.law.holds:
        return _Holding(link, setting)
    return next(LAWS[kind] for kind in type(link.law).__mro__ if kind in LAWS)(link, setting)
