# SPDX-License-Identifier: MIT
"""Laws of connectors over a step: equations ``α e + β λ = γ``, linearized at an iterate.

e is the relative motion at the end of the step and λ the force that resists its growth.  A law is a
class: ``row`` returns (α, β, γ), ``z`` has the internal variables, ``stored`` the energies.  The
variable ``name`` of a user's law is ``z["state name"]``.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any

import numpy as np
import scipy  # its subpackages are loaded when they are used

from old_reference.cell_forms import Setting
from old_reference.return_map import MaterialPoints, derivative
from ufl_beam.arrays import Array
from ufl_beam.errors import ModelError, NoNumber
from ufl_beam.mechanics.connector_equations import RigidPlasticStep, parameters, rigid_plastic_step
from ufl_beam.mechanics.time_scheme import Step, increment_to_rest
from ufl_beam.model.bodies import Place
from ufl_beam.model.checks import require_returned
from ufl_beam.model.connector_law import ConnectorLaw
from ufl_beam.model.connector_laws import (
    RIGID,
    Controller,
    Coulomb,
    Damper,
    ForceLaw,
    PrescribedForce,
    PrescribedMotion,
    RigidPlastic,
    Spring,
)
from ufl_beam.model.connectors import Connector, law_of
from ufl_beam.model.fibres import SectionPoints
from ufl_beam.model.functions import value_at
from ufl_beam.model.material_law import State
from ufl_beam.model.material_laws import ElastoPlastic

CREEP = 1e-12
"""Creep in a step of a sticking connector at its limit; divided by the size of the scene, or rad.

It is used only if several sticking connectors constrain the same motion.  It then determines the
force of each of these connectors.
"""

REFERENCE_MOTION = 0.01
"""Motion with the same weight as a force at its limit; rad, or divided by the size of the scene.

Weighted force and motion decide whether a rigid-plastic connector slips in an iterate.
"""

LEAST_SLOPE = 1e-9
"""Least factor r of :class:`_Slipping`, as a multiple of EI of the beam / size of the scene."""

Row = tuple[float, float, float] | Array
"""(α, β, γ); an array (k, k + 2) for the k components of a bushing."""

Motions = Any
"""A relative motion, or an array of the components of a bushing; m or rad."""


class LawInStep:
    """Law of a connector in a step; its work is added to ``entry`` of the ledger, if not empty.

    Attributes:
        saved_as: Name of the internal variables in saved states, as in ``ufl_beam.terms``.
        z: Internal variables of the accepted state.  "dissipated" is the energy lost since the
            beginning by yielding, slip and laws of users; J.  "start" is the motion of a
            rigid-plastic connector without round-off.
        stored: Energies in the accepted state, by entry of the ledger; J.
        opens: Object that opens or slips beyond a limit, or None; see ``Solver._equilibrium``.
        slope: Number by which equations that state the force are divided.
        stiffness: Elastic stiffness of the components of laws with internal variables, else zero.
    """

    account, entry, sign, saved_as = "lost", "", 1.0, ""
    slope = 1.0
    stiffness: Any = 0.0
    _row: Row

    def __init__(self, connector: Connector, setting: Setting) -> None:
        self.connector, self.setting, self.e0, self.dt = connector, setting, 0.0, 1.0
        self.law: Any = connector.law
        self.length = (
            1.0 if connector.is_rotation else setting.numbering.scene.size
        )  # scale of motions
        self.z: dict[str, float] = {}
        self.stored: dict[str, float] = {}
        self.opens: Any = None
        if isinstance(self.law, ConnectorLaw):
            names = self.law.variables
            self.saved_as, self.entry = f"{type(self.law).__qualname__}{[*names]}", self.law.entry
            self.z = {f"state {name}": float(x) for name, x in names.items()}
            self.z |= {"held": 0.0, "dissipated": 0.0}
            if self.law.elastic:
                self.entry = ""
        if self.entry:
            getattr(setting.ledger, self.account)[self.entry] += 0.0

    def begin(self, e0: Motions, step: Step) -> None:
        """Begin a step at the motion ``e0``, and reset data of iterates."""
        self.e0, self.dt = e0, step.dt

    def row(self, e1: Motions, λ: Motions) -> Row:
        """Return (α, β, γ) at an iterate; by default as computed by ``begin``."""
        return self._row

    def change(self, e1: Motions, work: float) -> float:
        """Return the energy that is stored, dissipated or transferred in a step; J.

        Raises:
            StepFailed: A law that must dissipate generates energy.
        """
        return work

    def accept(self, e1: Motions, work: float) -> None:
        """Accept the end of the step, in which the connector has received ``work``; J."""
        if self.entry:
            getattr(self.setting.ledger, self.account)[self.entry] += self.sign * work

    def start(self, e: Motions) -> Any:
        """Compute the accepted state at a motion; return the force of the law there; N or N m."""
        return 0.0

    def state(self, values: Array | None = None) -> Array:
        """Return the internal variables, (n,); if given, ``values`` replace them first."""
        if values is not None:
            self.z = dict(zip(self.z, map(float, values), strict=True))
        return np.array([*self.z.values()])

    def after(self, e1: Motions, fraction: float) -> tuple[Any, Any, State]:
        """Return motions and rates at t_n+θ, and variables after a fraction of the step.

        They have the form of arguments of the law.  Variables grow in proportion to ``fraction``.
        """
        θ, e0, e1 = self.setting.scheme.theta, np.atleast_1d(self.e0), np.atleast_1d(e1)
        both = (1 - θ) * e0 + θ * e1, (e1 - e0) / self.dt
        e, rate = (self.law.as_argument([*values[:, None]]) for values in both)
        z = {name: np.array([self.z[f"state {name}"]]) for name in self.law.variables}
        if fraction and z and self.law.rate_independent:
            moved = self.law.as_argument([*((1 - fraction) * e0 + fraction * e1)[:, None]])
            changes = self.law.increments(moved, rate, State(z), fraction * self.dt)
            z = {name: x + changes[name] for name, x in z.items()}
        elif fraction and z:
            changes = self.law.increments(e, rate, State(z), θ * self.dt)
            z = {name: x + fraction / θ * changes[name] for name, x in z.items()}
        return e, rate, State(z)


def around(forces: Callable[[Array], Any], e: Motions, increments: Motions) -> Array:
    """Linearize forces that are functions of motions by central differences; (k, k + 2)."""
    e, increments = np.atleast_1d(e), np.diag(np.atleast_1d(increments))
    with np.errstate(all="ignore"):
        slopes = [(forces(e + δ) - forces(e - δ)) / (2 * δ.sum()) for δ in increments]
        D, force = np.reshape(slopes, (len(e), -1)).T, forces(e)
    return np.column_stack([-D, np.ones(len(e)), force - D @ e])


def small_increment(e0: Motions, e1: Motions, length: Motions) -> Any:
    """Return steps of central differences: the increments of motions in the step, times 6e-6.

    This factor is the third root of the machine precision.  An increment counts as at least 1e-3 of
    the motion and 1e-6 of ``length``.
    """
    least = 1e-3 * np.maximum(np.abs(e1), 1e-3 * length)
    return 6e-6 * np.maximum(np.abs(e1 - e0), least)


# -- constraints, motors, prescribed forces, dampers ---------------------------------------------


class _Known(LawInStep):
    """Law whose equation is known at the beginning of a step, as of a joint, motor or damper."""

    KINDS = {  # noqa: RUF012
        PrescribedMotion: ("supplied", "motors", -1.0, "_Driven"),
        PrescribedForce: ("supplied", "loads", -1.0, "_Pushed"),
        Controller: ("supplied", "controllers", -1.0, "_Controlled"),
        Damper: ("lost", "damping", 1.0, "_Damped"),
    }

    def __init__(self, connector: Connector, setting: Setting) -> None:
        joint = "lost", "", 1.0, "_Held"  # a joint: no motion, no work
        kind = joint if connector.law is RIGID else self.KINDS[type(connector.law)]
        self.account, self.entry, self.sign, self.saved_as = kind
        super().__init__(connector, setting)
        self.z = {"reached": 0.0} if isinstance(self.law, PrescribedForce | Controller) else {}

    def begin(self, e0: float, step: Step) -> None:
        law, connector = self.law, self.connector
        if law is RIGID:
            self._row = 1.0, 0.0, 0.0
        elif isinstance(law, PrescribedMotion):
            wanted = value_at(law.motion, step.motion_time, connector)
            self._row = 1.0, 0.0, e0 + step.fraction * (wanted - e0)
        elif isinstance(law, Damper):
            factor = law.viscosity / step.dt
            self._row = -factor, 1.0, -factor * e0
        else:  # a prescribed force, or the requested force of a controller
            controlled, reached = self.setting.requested_forces.get(connector), self.z["reached"]
            wanted = (
                value_at(law.force, step.load_time, connector) if controlled is None else controlled
            )
            growth = step.fraction * (-wanted - reached)
            self._row, self._end = (0.0, 1.0, reached + step.at * growth), reached + growth

    def accept(self, e1: float, work: float) -> None:
        super().accept(e1, work)
        if self.z:
            self.z["reached"] = self._end


# -- energies, resistances and springs -----------------------------------------------------------


PATH_PARTS = 256
"""Parts of the path of a step for the work of a law, whose error is (1/256)²/8 at a kink."""


class _EnergyLaw(LawInStep):
    """Law with an energy and a resistance, such as the law of a stop."""

    def __init__(self, connector: Connector, setting: Setting) -> None:
        super().__init__(connector, setting)
        scheme = setting.scheme
        self._load_weight, self._θ = scheme.load_weight, scheme.theta
        self._delayed = scheme.weight_of_before == 0 and self._load_weight > 0.5
        if self._delayed:
            setting.loses("numerical")
        if self.law.variables:
            k, (*_, z) = self.law.components, self.after(0.0, 0.0)
            lengths = np.array(
                [self.length] if k == 1 else [setting.numbering.scene.size] * 2 + [1.0]
            )
            slopes = around(lambda e: self._elastic(e, z), np.zeros(k), 1e-6 * lengths[:k])
            self.stiffness = np.abs(np.diag(slopes))

    def _energy(self, e: Motions, z: State) -> Any:
        return np.sum(self.law.energy(self.law.as_argument([*np.atleast_1d(e)[:, None]]), z))

    def _elastic(self, e: Array, z: State) -> Array:
        """Return derivatives of the energy with respect to the motions; (k,)."""
        return np.array([float(np.sum(f)) for f in self.law.elastic_forces([*e[:, None]], z)])

    def _forces(self, e1: Array) -> Array:
        """Return elastic forces at the time of loads plus resistance in a step to ``e1``; (k,)."""
        e0, (*_, z) = np.atleast_1d(self.e0), self.after(e1, self._load_weight)
        resistance = self.law.each(self.law.resistance(*self.after(e1, self._θ), self.dt))
        elastic = end = self._elastic(e1, z)
        if self._load_weight != 1.0:
            # Gauss's rule; if forces are not smooth, their work is corrected to the energy change
            Δe, mean = e1 - e0, self.setting.scheme.mean(lambda e: self._elastic(e, z), e0, e1)
            first, middle = (self._elastic(e, z) for e in (e0, (e0 + e1) / 2))
            errors = (mean - (first + 4 * middle + end) / 6) * Δe
            if np.abs(errors).sum() > 1e-7 * ((np.abs(first) + np.abs(end)) @ np.abs(Δe)):
                missing = self._energy(e1, z) - self._energy(e0, z) - mean @ Δe
                groups = (slice(2), slice(2, None))  # displacements, rotation
                weights = np.array([errors[group].sum() ** 2 for group in groups])
                for group, weight in zip(groups, weights / weights.sum(), strict=True):
                    if Δe[group].any():
                        mean[group] += missing * weight * Δe[group] / (Δe[group] @ Δe[group])
            elastic = mean + (2 * self._load_weight - 1) * (end - mean)
        return elastic + [float(np.sum(force)) for force in resistance]

    def row(self, e1: Motions, λ: Motions) -> Row:
        lengths = np.array([self.length, self.length, 1.0])[: np.size(e1)]
        return around(self._forces, e1, small_increment(self.e0, e1, lengths))

    def _work(self, e1: Motions, work: float) -> float:
        """Return the ``work`` of a step; of a rate-independent law, along the path of the step."""
        if not (self.law.rate_independent and self.setting.scheme.weight_of_before):
            return work
        e0, Δe = np.atleast_1d(self.e0), np.atleast_1d(e1) - np.atleast_1d(self.e0)
        powers = [self._forces(e0 + x * Δe) @ Δe for x in np.linspace(0, 1, PATH_PARTS + 1)]
        return float(np.trapezoid(powers) / PATH_PARTS)

    def change(self, e1: Motions, work: float) -> float:
        if self.entry:
            return self._work(e1, work)
        return float(self._energy(e1, self.after(e1, 0.0)[2])) - self.z["held"]

    def accept(self, e1: Motions, work: float) -> None:
        """Accept the variables; work that is neither stored nor numerical loss is dissipated."""
        (*_, old), (*_, new) = (self.after(e1, fraction) for fraction in (0.0, 1.0))
        stored, numerical = float(self._energy(e1, new)), 0.0
        if self._delayed:  # growth: derivative of the energy along the step, by complex step
            z = {n: x + 1e-30j * (x - getattr(old, n)) for n, x in vars(new).items()}
            along = self._energy(e1 + 1e-30j * (e1 - self.e0), State(z))
            growth = float(np.imag(along)) / 1e-30
            numerical = (2 * self._load_weight - 1) * float(
                self._energy(self.e0, old) - stored + growth
            )
            self.setting.ledger.lost["numerical"] += numerical
        if self.entry:
            lost = self._work(e1, work) - (stored - self.z["held"]) - numerical
            super().accept(e1, lost)
            self.z["dissipated"] += lost
        self.z |= {f"state {name}": float(x[0]) for name, x in vars(new).items()}
        self.z["held"] = stored
        self.stored = {"stored": stored}

    def start(self, e: Motions) -> Any:
        *_, z = self.after(e, 0.0)
        self.z["held"] = float(self._energy(e, z))
        self.stored = {"stored": self.z["held"]}
        return self._elastic(np.atleast_1d(e), z)


class _SpringLaw(LawInStep):
    """Spring: a material point whose strain is the motion."""

    saved_as = "_Sprung"

    def __init__(self, connector: Connector, setting: Setting) -> None:
        super().__init__(connector, setting)
        law, softening = self.law.bulk, self.law.softening
        key = [setting.numbering.scene.stream_keys[connector]]
        section_points = SectionPoints(
            strains=np.eye(1, 3), weights=np.ones(1), stiffness=np.array([self.law.stiffness]),
            laws=((law, 1),), rest=np.zeros(3), breaking=slice(None),
            softening=softening if softening is not None and softening.opens else None,
        )  # fmt: skip
        self._points = MaterialPoints(section_points, key, np.ones(1), setting)
        self.stored, self.stiffness = self._points.stored, self.law.stiffness
        self.opens = self._points if self._points.softens else None

    def row(self, e1: float, λ: float) -> Row:
        self._points.return_map(np.array([[e1, 0.0, 0.0]]), self.dt)
        f, D = float(self._points.r[0, 0]), float(self._points.D[0, 0, 0])
        return -D, 1.0, f - D * e1

    def change(self, e1: float, work: float) -> float:
        self._points.require_dissipation([str(self.connector)])
        return self._points.change()

    def accept(self, e1: float, work: float) -> None:
        self._points.accept()
        self.start(e1)

    def start(self, e: float) -> float:
        self._points.start(np.array([[e, 0.0, 0.0]]))
        self.stored = self._points.stored
        self.z["dissipated"] = float(self._points.recorded[0, 4:].sum())
        return float(self._points.recorded[0, 0])

    def state(self, values: Array | None = None) -> Array:
        return np.asarray(self._points.state(None if values is None else values[None])[0])


# -- friction and plastic hinges -----------------------------------------------------------------


class _Friction(LawInStep):
    """Dry friction, also by a user's law: the connector sticks, or slips in the direction -1 or 1.

    The sliding force of a user's law may be below its limit, so that sticking and sliding can both
    be solutions.  The connector then sticks or slides as in the last step, unless there is no such
    equilibrium.

    Attributes:
        excess: ``|force| / limit - 1`` if ``Search.hold`` keeps a user's law sticking above its
            limit, else 0.  It is infinite if the limit is zero, or if the connector slides back or
            would generate energy by coming to rest.
        released: True if the connector may begin to stick or slide from this iterate on.
    """

    entry, saved_as = "friction", "_Rubbing"

    def __init__(self, connector: Connector, setting: Setting) -> None:
        super().__init__(connector, setting)
        self.z = {"slip": 0.0, **self.z}
        self.excess, self.released = 0.0, False
        if isinstance(self.law, ConnectorLaw):
            self.opens, self.stored = self, {"stored": 0.0}

    def begin(self, e0: float, step: Step) -> None:
        super().begin(e0, step)
        if self.opens:
            self._limit = max(float(np.sum(self.law.limit(self.after(e0, 0.0)[2]))), 0.0)
        else:
            self._limit = self.setting.requested_forces[self.connector]
        softness = CREEP * self.length * self.setting.friction_repeats
        self._creep = softness / self._limit if self._limit > 0 else 0.0
        # A step with this motion ends at rest; without motion it would reverse the velocity.
        self._rest_motion = (
            increment_to_rest(self.setting.scheme, step.dt) * self.setting.rates[self.connector]
        )
        self._direction, self._motionless, self._guessed = self.z["slip"], False, True

    def row(self, e1: float, λ: float) -> Row:
        """Return the equation: sticking up to the limit, slip until the velocity reverses."""
        moved, stuck, search = e1 - self.e0, self._direction == 0, self.setting.search
        if not self._motionless and self._direction * self._rest_motion > 0:
            moved -= self._rest_motion  # the step ends at rest, not with a reversed velocity
        reverses = not stuck and self._direction * moved < -1e-14 * self.length
        # Coming to rest must not generate energy; if it would, the step has no motion at all.  The
        # force of the first guess does not decide this, since it belongs to another motion.
        gives = not self._guessed and not self._motionless and stuck and λ * self._rest_motion < 0
        over = stuck and abs(λ) > self._limit * (1 + 1e-12)
        self._guessed, self.excess = False, 0.0
        if self.opens and search.hold and not self.released:
            if reverses or gives or over:
                changes = reverses or gives or not self._limit
                self.excess, search.over = math.inf if changes else abs(λ) / self._limit - 1, True
        else:
            self._motionless |= gives
            if reverses:
                self._direction = 0.0
            elif over:
                self._direction = math.copysign(1.0, λ)
        if self._direction == 0 and self._limit > 0:
            return 1.0, -self._creep, self.e0 + (0.0 if self._motionless else self._rest_motion)
        if not self.opens:
            return 0.0, 1.0, self._direction * self._limit

        def sliding(e: Array) -> Any:
            return self._direction * self.law.sliding(
                *self.after(e, self.setting.scheme.theta), self.dt
            )

        return around(sliding, e1, small_increment(self.e0, e1, self.length))

    def accept(self, e1: float, work: float) -> None:
        if self.opens:
            new = vars(self.after(e1, 1.0)[2])
            self.z |= {f"state {name}": float(x[0]) for name, x in new.items()}
            self.z["dissipated"] += work
        super().accept(e1, work)
        self.z["slip"] = self._direction


class _Slipping(LawInStep):
    """Rigid-plastic connector, such as a plastic hinge: rigid up to a limit, then with a slip law.

    R is the resistance after the motion m, and r any positive factor.  Without a back force, the
    equation for the force λ is

        r m = 0 where |λ + r m| <= R, else λ = R or -R.

    Its residual is continuous in λ and m, as Newton's method requires.

    Attributes:
        excess: ``|λ - back force + r m| / limit - 1`` if this is positive and ``Search.hold`` keeps
            the connector rigid; else 0.
        released: True if the connector may slip from this iterate on.
    """

    saved_as = "CompiledSlips"

    def __init__(self, connector: Connector, setting: Setting) -> None:
        super().__init__(connector, setting)
        law, self.opens, self.slope = (
            law_of(connector),
            self,
            _slope(connector, setting.numbering.scene.size),
        )
        self._law, self._parameters = law, {name: float(x) for name, x in parameters(law).items()}
        self.z = {"slipped": 0.0, "start": 0.0, "limit": float(law.limit), "back force": 0.0}
        self.z |= {"dissipated": 0.0, "way": 0.0, "stored": 0.0}
        self.excess, self.released, self._hardens = 0.0, False, isinstance(law, ElastoPlastic)
        setting.loses("hinges")
        self._loss = 2 * setting.scheme.alpha if self._hardens else 0.0
        if self._loss:
            setting.loses("numerical")

    def begin(self, e0: float, step: Step) -> None:
        super().begin(e0, step)
        self._direction = int(self.z["way"])  # of slip in an iterate; first as in the last step

    def _law_step(self, grown: Any, direction: int) -> RigidPlasticStep:
        at = {**self._parameters, **self.z, "θ": self.setting.scheme.theta, "dt": self.dt}
        return rigid_plastic_step(
            self._law, {**at, "slip": grown, "direction": direction}, self.setting.scheme
        )

    @np.errstate(all="ignore")
    def row(self, e1: float, λ: float) -> Row:
        """Return (α, β, γ) at an iterate, after finding the direction of slip."""
        z, r, search, self.excess = self.z, self.slope, self.setting.search, 0.0
        motion, limit = e1 - z["start"], z["limit"]
        tested = λ - z["back force"] + r * motion
        over = abs(tested) > limit * (1 + 1e-12)
        direction = -1 if (tested if limit else motion) < 0 else 1
        force, slope = (
            float(x[0])
            for x in derivative(
                lambda a: self._law_step(a, direction).force, np.array([max(direction * motion, 0)])
            )
        )
        if limit == 0:
            flows = True
        elif search.hold and not z["way"] and not self.released:
            flows = False
            if over:
                self.excess, search.over = abs(tested) / limit - 1, True
        else:
            flows = over if direction * motion <= 0 else direction * (λ + r * motion - force) > 0
        self._direction = direction * flows
        if not flows:
            return 1.0, 0.0, z["start"]
        return direction * slope / r, -1 / r, (direction * slope * e1 - force) / r

    def accept(self, e1: float, work: float) -> None:
        """Accept the slip of the step."""
        grown, ledger = max(self._direction * (e1 - self.z["start"]), 0.0), self.setting.ledger
        if math.isfinite(self.z["limit"]):
            end = self._law_step(grown, self._direction)
            ledger.lost["hinges"] += float(end.dissipated)
            if self._loss:
                ledger.lost["numerical"] += self._loss * float(end.lost)
            self.z["dissipated"] += float(end.dissipated)
            self.z |= {"limit": float(end.limit), "back force": float(end.back_force)}
            self.z["stored"] = float(end.stored)
        self.z["slipped"] += grown
        self.z["way"] = float(self._direction * (grown > 0))
        self.start(self.z["start"] + self._direction * grown)

    def start(self, e: float) -> float:
        self.z["start"] = e
        if self._hardens:
            self.stored = {"hardening": self.z["stored"]}
        return 0.0


def _slope(connector: Connector, size: float) -> float:
    """Return the factor r of motions in the equation of a rigid-plastic connector.

    The factor exceeds the steepest softening, so that an open hinge stays open in iterates.  It is
    so large that motions, not round-off of forces, decide in which direction a weak hinge slips.
    """
    law = law_of(connector)
    if not 0.0 < law.limit < np.inf:
        return 1.0
    steepest, _ = law.steepest
    early = law.limit / (REFERENCE_MOTION * (1.0 if connector.is_rotation else size))
    least = (
        LEAST_SLOPE * connector.a.beam.section.EI / size if isinstance(connector.a, Place) else 0.0
    )
    return float(max(early, least) + (2 * steepest if steepest < np.inf else 0.0))


# -- functions of users --------------------------------------------------------------------------


class _UserLaw(LawInStep):
    """Force law of a user: a function of motion, rate, time and its own state."""

    entry, saved_as = "functions", "AskedLaws"

    def __init__(self, connector: Connector, setting: Setting) -> None:
        super().__init__(connector, setting)
        self.z = {str(i): float(x) for i, x in enumerate(self.law.state)}
        self.stored = {"stored": 0.0}

    def begin(self, e0: float, step: Step) -> None:
        super().begin(e0, step)
        fraction = step.fraction * step.at
        t = step.load_time if fraction == 1.0 else step.t0 + fraction * (step.load_time - step.t0)
        state = self.state()
        state.flags.writeable = False  # all iterates begin with the same state
        self._known = {"t": t, "dt": step.dt, "state": state}
        self._last: tuple[float, float, float, float] | None = None  # e, λ, residual, linearized at

    def _evaluate(self, e1: float) -> tuple[float, Array]:
        """Return force and internal variables after a step to the motion ``e1``."""
        w = self.setting.scheme.load_weight
        motion, rate = (1 - w) * self.e0 + w * e1, (e1 - self.e0) / self.dt
        known = {name: self._known[name] for name in self.law.arguments}
        value, after = self.law.force(motion, rate, **known), self.state()
        at = f"motion = {motion:.6g}, rate = {rate:.6g}, t = {self._known['t']:.9g} s"
        if self.z:
            try:
                value, after = value
                after = np.array(after, dtype=np.float64).reshape(len(self.z))
            except (TypeError, ValueError):
                raise ModelError(
                    f"{self.connector}: the function must return the force and the state, a list "
                    f"of {len(self.z)} numbers"
                ) from None
        force = require_returned(value, f"{self.connector}: the function", at)
        for number in (force, *map(float, after)):
            if not math.isfinite(number):  # a shorter step may avoid this motion
                raise NoNumber(f"{self.connector}: the function returned {number} at {at}")
        return force, after

    def row(self, e1: float, λ: float) -> Row:
        """Return the law around an iterate.

        At an infinite slope, Newton's method would oscillate for ever.  The secant through the two
        latest iterates approximates the response of the rest of the scene.  If the residual does
        not halve, the law is linearized at its intersection with this secant.  The intersection
        must be between ``e1`` and the motion of the previous linearization.
        """
        last, at, residual = self._last, e1, self._evaluate(e1)[0] - λ
        if last is not None and abs(residual) > abs(last[2]) / 2 and e1 != last[0]:
            yielding = max(0.0, (last[1] - λ) / (e1 - last[0]))

            def excess(x: float) -> float:
                return self._evaluate(x)[0] - λ + yielding * (x - e1)

            if excess(e1) * excess(last[3]) < 0:
                at = float(scipy.optimize.brentq(excess, e1, last[3], xtol=1e-300, maxiter=2000))
        ε = float(small_increment(self.e0, at, self.length))
        ε_motion = 6e-6 * max(abs(at), 0.0 if last is None else abs(last[3]))
        if 0.0 < ε_motion < ε:  # near zero, where the slope may be infinite
            low, middle, high = (self._evaluate(at + x)[0] for x in (-ε_motion, 0.0, ε_motion))
            ε = ε_motion if abs(high - low) > 1e-8 * abs(middle) else ε
        self._last = e1, λ, residual, at
        return around(lambda e: self._evaluate(float(e[0]))[0], at, ε)

    def accept(self, e1: float, work: float) -> None:
        """Enter lost work in the ledger, and accept the internal variables."""
        before, (_, after) = self.stored["stored"], self._evaluate(e1)
        self.state(after)
        self.start(e1)
        super().accept(e1, work - (self.stored["stored"] - before))

    def start(self, e: float) -> float:
        """Compute the recoverable energy; J."""
        if self.law.stored is not None:
            value = self.law.stored(e, **dict.fromkeys(self.law.stored_arguments, self.state()))
            subject, at = f"{self.connector}: the energy", f"motion = {e:.6g}"
            self.stored = {"stored": require_returned(value, subject, at, finite=True)}
        return 0.0


LAWS: dict[type, type[LawInStep]] = {
    **dict.fromkeys(_Known.KINDS, _Known), ConnectorLaw: _EnergyLaw, Spring: _SpringLaw,
    Coulomb: _Friction, RigidPlastic: _Slipping, ForceLaw: _UserLaw,
}  # fmt: skip
"""Classes of laws in a step, by the class of the law in the scene or its base class."""


def law_in_step(connector: Connector, setting: Setting) -> LawInStep:
    """Return the law of a connector in a step."""
    if isinstance(connector.law, ConnectorLaw) and connector.law.holds:
        return _Friction(connector, setting)
    return next(LAWS[kind] for kind in type(connector.law).__mro__ if kind in LAWS)(
        connector, setting
    )
