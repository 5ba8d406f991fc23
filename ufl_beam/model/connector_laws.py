# SPDX-License-Identifier: MIT
"""Laws of connectors: forces as functions of a relative motion, prescribed motions or forces."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import KW_ONLY, dataclass
from functools import partial
from numbers import Real
from typing import Annotated, Any, ClassVar, Protocol

from ufl_beam.errors import ModelError, closed
from ufl_beam.model.checks import require_function, require_kind, require_number, require_returned
from ufl_beam.model.connector_law import ConnectorLaw
from ufl_beam.model.connector_law import ForceLaw as ForceLaw
from ufl_beam.model.functions import Constant, GuideCurve, Timed
from ufl_beam.model.law_functions import Values, larger, positive, smaller, sqrt
from ufl_beam.model.material_law import MaterialLaw, State, require_law
from ufl_beam.model.material_laws import DuvautLions, ElastoPlastic
from ufl_beam.model.records import Instance, NotNegative, Number, Positive, PositiveOrNone, Record
from ufl_beam.model.softening_laws import (
    LinearSoftening,
    Softening,
    SofteningLaw,
    require_softening,
)

OWN_LAW = "state a ConnectorLaw of your own"
"""Advice in the error that a subclass of a law of the package raises."""


@closed(OWN_LAW)
@dataclass(frozen=True, repr=False)
class PrescribedMotion(Record):
    """Prescribed relative motion of a connector, whose force is an unknown of the run.

    Args:
        motion: Motion as a function of time; m or rad.  Joints prescribe zero.

    Example:
        >>> motor = ub.Turn(
        ...     ub.ground(0, 0), beam.start, ub.PrescribedMotion(lambda t: np.pi / 2 * t)
        ... )
        >>> arm = ub.Scene([beam], supports=[ub.Pinned(beam.start)], connectors=[motor])
        >>> run = ub.simulate(arm, ub.Static(), t=(0, 1), dt=0.25)
        >>> np.allclose(run.position(beam.end)[-1], (0, 2))
        True
    """

    motion: Timed


@closed(OWN_LAW)
@dataclass(frozen=True, repr=False)
class PrescribedForce(Record):
    """Prescribed force or moment of a connector; a positive force makes the motion grow.

    Args:
        force: Force as a function of time; N or N m.

    Example:
        >>> jack = ub.Slide(
        ...     ub.ground(2, 0), beam.end, ub.PrescribedForce(lambda t: 1e3 * t), axis=(0, 1)
        ... )
        >>> lifted = ub.Scene([beam], supports=[ub.Clamped(beam.start)], connectors=[jack])
        >>> run = ub.simulate(lifted, ub.Static(), t=(0, 1), dt=0.5)
        >>> print(run.connector(jack).force.round())  # force that resists growth of the motion; N
        [    0.  -500. -1000.]
    """

    force: Timed


class Bearing:
    """Base of joints and supports, whose force may be the normal force of friction."""


class Running(Protocol):
    """Attributes of a simulation between two steps that laws of connectors need."""

    t: float
    """Time; s."""

    def press(self, joint: Any) -> float:
        """Return the magnitude of the force of a joint or support in the last step; N."""


@closed(OWN_LAW)
@dataclass(frozen=True, repr=False)
class Controller(Record):
    """Force computed from the state of a run, constant until the next evaluation.

    The force acts during the step, or the sample time, after the state from which it is computed.
    Because of this delay, a force of ``-kd`` times a rate changes its sign at each evaluation and
    grows unless ``kd sample < 2 J``.  J is the inertia that the force accelerates within a sample
    time, nearly zero at the end of a beam without a body.  A :class:`ForceLaw` has no delay.

    Args:
        force: ``force(simulation)``; N or N m; a positive force makes the motion grow.  The
            function may read time, motions, velocities and joint forces of the simulation.
        sample: Time between evaluations, counted from the beginning of the run; s.  Steps end at
            each evaluation.  By default the force is computed for every step.

    Example:
        >>> brake = ub.Controller(lambda now: -1e4 * now.velocity(beam.end)[1])
        >>> device = ub.Slide(ub.ground(2, 0), beam.end, brake, axis=(0, 1))
        >>> braked = ub.Scene(
        ...     [beam], supports=scene.supports, loads=scene.loads, connectors=[device]
        ... )
        >>> run = ub.simulate(braked, ub.EnergyMomentum(), t=(0, 0.2), dt=0.001)
        >>> bool(run.connector(device).work[-1] > 0)  # it takes energy
        True
    """

    force: Annotated[Callable[[Any], float], partial(require_function, arguments="the simulation")]
    sample: PositiveOrNone = None

    def evaluate(self, simulation: Running, connector: object) -> float:
        """Return the force until the next evaluation; N or N m; all processes must call this."""
        at = f"t = {simulation.t:.9g} s"
        return require_returned(
            self.force(simulation), f"{connector}: the controller", at, finite=True
        )


@dataclass(frozen=True)
class _FreeAt(MaterialLaw):
    """Linear elastic law without stress at a given strain."""

    free: float
    elastic: ClassVar[bool] = True

    def stress(self, strain: Values, state: State) -> Values:
        return self.C * (strain - self.free)

    def elastic_energy(self, strain: Values, state: State) -> Values:
        return self.C * (strain - self.free) ** 2 / 2


@closed(OWN_LAW)
@dataclass(frozen=True)
class Spring(Record):
    """Elastic spring of a connector, which may yield and break.

    Args:
        stiffness: Elastic stiffness; N/m or N m/rad.
        law: Law of yielding; limit in N or N m, moduli in the unit of the stiffness.
        softening: Law of fracture; limit in N or N m, energy in J.
        free: Motion without force, in an elastic spring; m or rad.  For a :class:`Stretch` it is
            the free length minus the distance of the places in the undeformed scene.

    Raises:
        ModelError: The stiffness is not positive, or a spring with ``free`` has another law.

    Example:
        >>> spring = ub.Stretch(ub.ground(2, 1), beam.end, ub.Spring(1e6))  # N/m
        >>> hung = ub.Scene([beam], supports=scene.supports, loads=scene.loads, connectors=[spring])
        >>> run = ub.simulate(hung, ub.Static(), t=(0, 1), dt=0.5)
        >>> bool(run.connector(spring).force[-1] > 0)  # it is stretched
        True
    """

    stiffness: Positive
    law: Annotated[MaterialLaw | None, require_law] = None
    softening: Annotated[SofteningLaw | None, require_softening] = None
    free: Number = 0.0

    def __post_init__(self) -> None:
        super().__post_init__()
        if self.law is not None and (fault := self.law.fault(self.stiffness, 1.0)):
            raise ModelError(f"Spring: {type(self.law).__name__}: {fault}")
        if self.free and (self.law or self.softening):
            raise ModelError("Spring: free is for an elastic spring; leave law and softening out")

    @property
    def bulk(self) -> MaterialLaw:
        """Law of the spring as a material point whose strain is the motion."""
        if self.free:
            return _FreeAt(self.free)
        return self.law or ElastoPlastic(yield_limit=math.inf)


@closed(OWN_LAW)
@dataclass(frozen=True)
class Damper(Record):
    """Viscous damper: a force proportional to the rate of the motion.

    Args:
        viscosity: Force divided by rate; N s/m or N m s/rad.

    Example:
        >>> damper = ub.Stretch(ub.ground(2, -1), beam.end, ub.Damper(2e3))  # N s/m
        >>> damped = ub.Scene(
        ...     [beam], supports=scene.supports, loads=scene.loads, connectors=[damper]
        ... )
        >>> run = ub.simulate(damped, ub.EnergyMomentum(), t=(0, 1), dt=0.01)
        >>> np.allclose(run.connector(damper).force, 2e3 * run.connector(damper).rate)
        True
    """

    viscosity: Positive


@closed(OWN_LAW)
@dataclass(frozen=True)
class Stop(Record, ConnectorLaw):
    """Stop: an elastic or damped contact force while the motion is outside an interval.

    At a depth δ the force is stiffness δ (1 + damping dδ/dt), or zero where this is negative (Hunt
    and Crossley 1975).  A contact begins and ends with zero force.  The lost energy is in the entry
    "contact" of the ledger.

    Args:
        low, high: Ends of the interval; m or rad.
        stiffness: Contact stiffness; N/m or N m/rad.
        damping: Contact damping; s/m or s/rad.  A mass that arrives with a small velocity v leaves
            with the velocity (1 - 2/3 damping v) v.

    Raises:
        ModelError: The interval does not contain 0 or is unbounded, the stiffness is not positive,
            or the damping is negative.

    Example:
        >>> buffer = ub.Slide(ub.ground(2, 0), beam.end, ub.Stop(1e9, low=-0.01), axis=(0, 1))
        >>> caught = ub.Scene(
        ...     [beam], supports=scene.supports, loads=scene.loads, connectors=[buffer]
        ... )
        >>> run = ub.simulate(caught, ub.Static(), t=(0, 1), dt=0.05)
        >>> print(run.displacement(beam.end)[-1, 1].round(3))  # m
        -0.01
    """

    stiffness: Positive
    _: KW_ONLY
    low: float = -math.inf
    high: float = math.inf
    damping: NotNegative = 0.0

    entry = "contact"
    resists: ClassVar[bool] = False  # no force within the interval

    def energy(self, motion: Values, state: State) -> Values:
        """Return the contact energy; J."""
        below, above = positive(self.low - motion), positive(motion - self.high)
        return self.stiffness * (below**2 + above**2) / 2

    def resistance(self, motion: Values, rate: Values, state: State, dt: Values) -> Values:
        """Return the damping force, limited so that the total force does not pull; N or N m."""
        below, above = positive(self.low - motion), positive(motion - self.high)
        above = above * larger(self.damping * rate, -1.0)
        below = below * larger(-self.damping * rate, -1.0)
        return self.stiffness * (above - below)

    @property
    def elastic(self) -> bool:
        """True if the stop has no damping."""
        return self.damping == 0.0

    def __post_init__(self) -> None:
        super().__post_init__()
        for name, end in (("low", self.low), ("high", self.high)):
            if not isinstance(end, Real) or abs(end) != math.inf:
                require_number(end, f"Stop: {name}")
        if not self.low <= 0.0 <= self.high or (math.isinf(self.low) and math.isinf(self.high)):
            raise ModelError(
                f"Stop: the interval from low = {self.low:g} to high = {self.high:g} must contain "
                "0, the undeformed scene, and have at least one end"
            )


@closed(OWN_LAW)
@dataclass(frozen=True)
class Clearance(Record, ConnectorLaw):
    """Law of a :class:`Bushing` for a pin in a larger round hole: no force without contact.

    At a depth δ beyond the gap the normal force is stiffness δ (1 + damping dδ/dt), as in a
    :class:`Stop`.  Friction acts along the edge, against the motion of the surface of the pin, and
    exerts a moment on the pin.  A sticking contact deflects elastically, with the contact
    stiffness, until the friction force is ``friction`` times the normal force.  The lost energy is
    in the entry "contact" of the ledger.

    Args:
        stiffness: Contact stiffness; N/m.
        gap: Difference of the radii of hole and pin; m.
        damping: Contact damping; s/m.
        friction: Coefficient of friction.  If it is positive, the rotation is a third component.
        radius: Radius of the pin; m.

    Raises:
        ModelError: Stiffness or gap is not positive, a parameter is negative, or only one of
            friction and radius is given.

    Example:
        >>> hole = ub.Clearance(stiffness=1e8, gap=1e-3, friction=0.2, radius=0.02)
        >>> pin = ub.Bushing(ub.ground(2, 0), beam.end, hole)
        >>> hung = ub.Scene([beam], supports=scene.supports, loads=scene.loads, connectors=[pin])
        >>> run = ub.simulate(hung, ub.Static(), t=(0, 1), dt=0.1)
        >>> along, across, turn = run.connector(pin).force[-1]  # N, N, N m
        >>> bool(abs(turn) <= 0.2 * 0.02 * np.hypot(along, across))
        True
    """

    stiffness: Positive
    _: KW_ONLY
    gap: Positive
    damping: NotNegative = 0.0
    friction: NotNegative = 0.0
    radius: NotNegative = 0.0

    entry = "contact"
    resists: ClassVar[bool] = False  # no force within the gap

    def __post_init__(self) -> None:
        super().__post_init__()
        if (self.friction > 0.0) != (self.radius > 0.0):
            raise ModelError("Clearance: give friction and the radius of the pin together")

    @property
    def has_friction(self) -> bool:
        """True if the coefficient of friction is positive, or an array or symbol."""
        return not isinstance(self.friction, Real) or self.friction > 0.0

    @property
    def components(self) -> int:  # type: ignore[override]
        """Number of components: 3 with friction (two displacements, rotation), otherwise 2."""
        return 3 if self.has_friction else 2

    @property
    def variables(self) -> dict[str, float]:  # type: ignore[override]
        """Initial elastic deflection of the contact along the edge, with friction; m."""
        return {"deflection": 0.0} if self.has_friction else {}

    def parameters(self) -> dict[str, Any]:
        """Return the parameters by name, without friction and radius if they are zero."""
        unused = () if self.has_friction else ("friction", "radius")
        return {name: x for name, x in super().parameters().items() if name not in unused}

    @property
    def elastic(self) -> bool:
        """True if the law dissipates no energy."""
        return self.damping == 0.0 and not self.has_friction

    def _contact(self, motion: Any, rate: Any = (0.0, 0.0)) -> tuple[Values, ...]:
        """Return elastic and damping force (N), and the unit vector from hole to pin centre."""
        x, y = motion[:2]
        r = sqrt(larger(x**2 + y**2, (self.gap / 2) ** 2))  # avoids 0/0 at the centre
        x, y, elastic = x / r, y / r, self.stiffness * positive(r - self.gap)
        return elastic, elastic * larger(self.damping * (x * rate[0] + y * rate[1]), -1.0), x, y

    def energy(self, motion: Any, state: State) -> Values:
        """Return the energy of the normal and of the tangential deflection; J."""
        pressure, *_ = self._contact(motion)
        stored = pressure**2 / (2 * self.stiffness)
        return stored + self.stiffness * state.deflection**2 / 2 if self.has_friction else stored

    def resistance(self, motion: Any, rate: Any, state: State, dt: Values) -> Any:
        """Return the forces of damping and friction; N, N and N m."""
        _, damped, x, y = self._contact(motion, rate)
        if not self.has_friction:
            return damped * x, damped * y
        friction = self.stiffness * state.deflection
        return damped * x - friction * y, damped * y + friction * x, friction * self.radius

    def increments(self, motion: Any, rate: Any, state: State, dt: Values) -> Mapping[str, Values]:
        """Return the increment of the deflection along the edge, which sliding limits; m."""
        if not self.has_friction:
            return {}
        elastic, damped, x, y = self._contact(motion, rate)
        limit = self.friction * (elastic + damped) / self.stiffness
        increment = dt * (x * rate[1] - y * rate[0] + self.radius * rate[2])
        moved = smaller(larger(state.deflection + increment, -limit), limit)
        return {"deflection": moved - state.deflection}


@closed(OWN_LAW)
@dataclass(frozen=True)
class Coulomb(Record):
    """Coulomb friction: a connector sticks below a limit of its force, and slides at the limit.

    The limit is ``force``, plus ``coefficient`` times the force of ``joint`` at the end of the
    previous step.  A sticking connector has no elasticity: a constraint holds the motion.

    Args:
        force: Constant term of the limit; N or N m.
        coefficient: Coefficient of friction; 1.  For rotations give its product with the radius of
            the pin; m.
        joint: Joint or support whose force is the normal force.  A joint needs ``multipliers=True``
            unless it always has constraint forces, such as :class:`Prismatic` and :class:`Link`.

    Raises:
        ModelError: Force and coefficient are zero, or only one of coefficient and joint is given.

    Example:
        >>> brake = ub.Turn(ub.ground(0, 0), beam.start, ub.Coulomb(1e3))  # N m
        >>> spin = ub.Velocity((beam,), angular=1.0)
        >>> arm = ub.Scene(
        ...     [beam], supports=[ub.Pinned(beam.start)], initial=[spin], connectors=[brake]
        ... )
        >>> run = ub.simulate(arm, ub.EnergyMomentum(alpha=0.1), t=(0, 0.5), dt=0.01)
        >>> print(run.connector(brake).motion[-1].round(2))  # rad, to rest
        0.21
    """

    force: NotNegative = 0.0
    _: KW_ONLY
    coefficient: NotNegative = 0.0
    joint: Instance[Bearing | None] = None

    def __post_init__(self) -> None:
        super().__post_init__()
        if self.force == self.coefficient == 0.0:
            raise ModelError("Coulomb: force and coefficient are both zero; leave it out")
        if (self.coefficient > 0) != (self.joint is not None):
            raise ModelError("Coulomb: give coefficient and joint together")

    def evaluate(self, simulation: Running, connector: object) -> float:
        """Return the limit in the next step; all processes call this together; N or N m."""
        if self.joint is None:
            return self.force
        return self.force + self.coefficient * simulation.press(self.joint)


OWN_HINGE = (
    "join both sides by Turn(a, b, law) with Spring(stiffness, law=) or a ForceLaw of your own"
)

HingeLaw = SofteningLaw | ElastoPlastic
"""Laws of plastic hinges of zero length; such a hinge is rigid before it yields."""


def require_hinge_law(law: object, what: str) -> None:
    """Raise :class:`ModelError` unless ``law`` can be the law of a hinge of zero length."""
    if isinstance(law, MaterialLaw) and not isinstance(law, ElastoPlastic):
        raise ModelError(
            f"{what}: {type(law).__name__} is the law of an elastic stiffness, and a hinge of zero "
            "length has none; use it as Section(bending=), or join both sides by "
            "Turn(a, b, Spring(stiffness, law=))"
        )
    if isinstance(law, SofteningLaw):
        require_softening(law, what)
        return
    require_kind(law, (Softening, ElastoPlastic, LinearSoftening, SofteningLaw), what)
    if isinstance(law, ElastoPlastic):
        if type(law) is not ElastoPlastic:
            raise ModelError(
                f"{what}: {type(law).__name__} is a subclass of ElastoPlastic, and a hinge of zero "
                f"length would ignore its own methods; {OWN_HINGE}"
            )
        require_number(law.limit, f"{what}: limit", at_least=0.0, infinite=True)
        if isinstance(law.viscosity, DuvautLions):
            raise ModelError(
                f"{what}: DuvautLions relaxes an elastic stress, and a hinge of zero length is "
                "rigid before it flows; use Perzyna(eta)"
            )


@closed(OWN_LAW)
@dataclass(frozen=True)
class RigidPlastic(Record):
    """Rigid-plastic law: no motion below a limit force, plastic flow or softening at the limit.

    Below the limit a constraint holds the motion, without elasticity.  No other constraint may hold
    the same motion, see docs/warnings.md.  Plastic hinges of beams, ``Beam(hinges={s: law})``,
    follow this law.

    Args:
        law: A :class:`SofteningLaw` or :class:`ElastoPlastic`; limit in N m or N, moduli in N m/rad
            or N/m, fracture energy in J.

    Raises:
        ModelError: ``law`` is of another kind, or has :class:`DuvautLions` viscosity.

    Example:
        >>> fuse = ub.RigidPlastic(ub.ElastoPlastic(yield_limit=5e4))  # N m
        >>> hinge = ub.Turn(ub.ground(0, 0), beam.start, fuse)
        >>> arm = ub.Scene([beam], supports=[ub.Pinned(beam.start)], connectors=[hinge])
    """

    law: Annotated[HingeLaw, require_hinge_law]


@closed(OWN_LAW)
@dataclass(frozen=True)
class Guide(Record):
    """Law that constrains a point to a curve of the plane; see :class:`Guided`."""

    curve: Instance[GuideCurve]


Law = (
    Guide | PrescribedMotion | PrescribedForce | Controller | Spring | Damper | ConnectorLaw
    | ForceLaw | Coulomb | RigidPlastic
)  # fmt: skip

HOLDING = (PrescribedMotion, Guide)
"""Laws that always constrain the motion."""

DRIVING = (PrescribedForce, Controller)
"""Laws whose force in a step does not depend on the motion in the step."""


def resists(law: Law) -> bool:
    """Return whether a law resists every motion, by a force or by a constraint."""
    if isinstance(law, ConnectorLaw):
        return law.resists
    return not isinstance(law, (*DRIVING, Damper, Coulomb))


def has_friction(law: object) -> bool:
    """Return whether a law is dry friction: it sticks below a limit, and slides at the limit."""
    return isinstance(law, Coulomb) or (isinstance(law, ConnectorLaw) and law.holds)


RIGID = PrescribedMotion(Constant(0.0))
"""Law of the connectors of joints: a prescribed motion of zero."""
