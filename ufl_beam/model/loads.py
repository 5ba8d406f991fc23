# SPDX-License-Identifier: MIT
"""Loads: forces and moments at places and along beams, weight, rotating frames; damping."""

from __future__ import annotations

import math
from abc import ABC
from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import KW_ONLY, dataclass
from itertools import pairwise
from typing import Annotated, Any, ClassVar

import numpy as np

from ufl_beam.arrays import Array
from ufl_beam.errors import (
    ArgumentTypeError,
    ModelError,
    closed,
    require_all,
    require_vector,
    shorten,
)
from ufl_beam.model import checks, plausibility
from ufl_beam.model.bodies import (
    AttachmentPoint,
    Beams,
    Member,
    PlaceField,
    ground,
    moves_with_node,
)
from ufl_beam.model.connector_laws import PrescribedForce
from ufl_beam.model.connectors import Component, Connector, axes_of
from ufl_beam.model.functions import Table, Timed, TimeFunction, steady, value_at
from ufl_beam.model.records import (
    Instance,
    NotNegative,
    Number,
    Positive,
    Record,
    Switch,
    VectorOfScene,
    require_moment,
)


class Load(Record, ABC):
    """Base of the loads; forces in blocks/loads.py, of dead loads in terms/dead_loads.py."""

    amplitude: TimeFunction  # factor on the load, a function of time t (s)
    dead: ClassVar[bool] = True  # False if the forces depend on the motion


@dataclass(frozen=True, eq=False, repr=False)
class LoadAtPlace(Load):
    """Base of the loads that act at one place."""

    place: PlaceField
    force: VectorOfScene = (0.0, 0.0)
    moment: Annotated[Any, require_moment] = 0.0
    amplitude: Timed = steady

    def __str__(self) -> str:
        return f"{type(self).__name__} at {self.place}"


OWN_LOAD = "state other loads as a VirtualWork, a Potential or a connector with a ForceLaw"
"""Advice in the error that a subclass of a load raises."""


@closed(OWN_LOAD)
@dataclass(frozen=True, eq=False, repr=False)
class PointLoad(LoadAtPlace):
    """Dead force and moment at a place: the force keeps its direction.

    Args:
        place: Loaded place.
        force: (F_x, F_y), in space (F_x, F_y, F_z); N.
        moment: Moment, positive counter-clockwise; in space a vector, whose direction is constant,
            so that it is not conservative; N m.
        amplitude: Factor on force and moment, a function of time t (s).

    Example:
        >>> load = ub.PointLoad(
        ...     beam.end, force=(0, -1e5), amplitude=ub.Table([0, 0.5, 1], [0, 1, 0])
        ... )
        >>> loaded = ub.Scene([beam], supports=scene.supports, loads=[load])
        >>> run = ub.simulate(loaded, ub.Static(), t=(0, 1), dt=0.5)
        >>> print(run.section_forces_at(beam.start)[1, 1:].round())  # V, M at t = 0.5 s
        [-100000. -199989.]
    """

    @property
    def pushes(self) -> tuple[Connector, ...]:
        """Connectors that apply a load away from the centre of a body; otherwise empty."""
        if moves_with_node(self.place):
            return ()
        fixed, axes, connectors = ground(*self.place.point), axes_of(self.place.point), []
        components: list[Any] = [("parting", *x) for x in zip(self.force, axes, strict=False)]
        if len(axes) == 2 and self.moment:  # in space, moments of bodies do not depend on the place
            components.append(("turning", self.moment, axes[0]))
        for motion, size, axis in components:

            def push(t: float, size: float = size) -> float:
                return size * value_at(self.amplitude, t, self)

            law = PrescribedForce(push)
            connectors.append(Component("PointLoad", motion, fixed, self.place, law, axis))
        return tuple(connectors)


@closed(OWN_LOAD)
@dataclass(frozen=True, eq=False, repr=False)
class FollowerLoad(LoadAtPlace):
    """Follower force, which turns with the cross-section or body, and is not conservative.

    It has the arguments of :class:`PointLoad`; ``force`` is the force in the undeformed scene.
    A place on a body must be the centre of the body.

    Example:
        >>> thrust = ub.FollowerLoad(beam.end, force=(0, -1e5), amplitude=lambda t: t)
        >>> pushed = ub.Scene([beam], supports=[ub.Clamped(beam.start)], loads=[thrust])
        >>> run = ub.simulate(pushed, ub.Static(), t=(0, 1), dt=0.25)
        >>> bool(run.reaction(pushed.supports[0])[-1, 0] > 1e3)  # N: the force has turned
        True
    """

    dead: ClassVar = False

    def __post_init__(self) -> None:
        super().__post_init__()
        if not moves_with_node(self.place):
            raise ModelError(
                f"{self}: not the centre of the body; apply the force at the centre, with its "
                "moment about the centre"
            )


def require_span(span: object, what: str) -> tuple[float, float]:
    """Return ``span`` as two increasing parameters from 0 to 1, or raise."""
    first, last = require_vector(span, what)
    if not 0.0 <= first < last <= 1.0:
        raise ModelError(
            f"{what} = {shorten(span)} must be two parameters of the beam, 0 <= first < last <= 1"
        )
    return first, last


Profile = tuple[float, float] | Callable[[float], float]


def require_profile(profile: object, what: str) -> Profile:
    """Return ``profile`` as two finite numbers or a function of s, or raise."""
    if isinstance(profile, Table):
        plausibility.check(what, "end of a table along the beam", float(profile.times[-1]))
    return profile if callable(profile) else checks.require_vector(profile, what)


def profile_at(s: Array, profile: Profile, span: tuple[float, float], what: str) -> Array:
    """Return the values of a profile at parameters ``s``; they are zero outside of the span.

    Raises:
        ModelError: The profile, named ``what``, is not a finite number at one of them.
    """
    first, last = span
    if not callable(profile):
        return np.where((s < first) | (s > last), 0.0, np.interp(s, span, profile))
    values = np.zeros(s.shape)
    for index, at in np.ndenumerate(s):
        if first <= at <= last:
            where = f"s = {at:.9g}"
            try:
                value = profile(float(at))
            except Exception as error:
                raise ModelError(f"{what} fails at {where}: {shorten(error)}") from error
            values[index] = checks.require_returned(value, what, where, finite=True)
    return values


@dataclass(frozen=True, eq=False, repr=False)
class LoadAlongBeam(Load):
    """Base of the loads that are distributed along a beam or a part of it."""

    beam: Instance[Member]
    _: KW_ONLY
    span: Annotated[tuple[float, float], require_span] = (0.0, 1.0)
    profile: Annotated[Profile, require_profile] = (1.0, 1.0)

    def __post_init__(self) -> None:
        super().__post_init__()
        self.factors(np.array(self.span))

    def __str__(self) -> str:
        return f"{type(self).__name__} on {self.beam.name}"

    def attached_to(self) -> Iterable[AttachmentPoint]:
        """See the base class."""
        return (self.beam.at(s) for s in self.span)

    def factors(self, s: Array) -> Array:
        """Return the factors of the profile at parameters ``s``, see :func:`profile_at`."""
        return profile_at(s, self.profile, self.span, f"{self}: profile")


@closed(OWN_LOAD)
@dataclass(frozen=True, eq=False, repr=False)
class LineLoad(LoadAlongBeam):
    """Distributed dead force and moment along a beam or a part of it, per undeformed length.

    Args:
        beam: Loaded beam.
        force: (f_x, f_y), in space (f_x, f_y, f_z); N/m.
        moment: Moment, positive counter-clockwise; N m/m.
        amplitude: Factor on force and moment, a function of time t (s).
        span: Parameters of the beam at both ends of the load, from 0 (start of the beam) to 1
            (end).  Both ends become vertices of the mesh.
        profile: Factors on force and moment at both ends of the span, linear between them; or a
            function of the parameter s of the beam.  Consistent nodal forces are exact for
            polynomials up to degree 4 in each cell.  Section forces are exact at the ends of cells.
            Between these they are exact for forces that are linear in each cell, and moments that
            are constant.  A saved solution has samples of the function.

    Raises:
        ModelError: The span is not inside the beam, or the profile is no number somewhere.

    Example:
        >>> snow = ub.LineLoad(beam, force=(0, -1e3))
        >>> loaded = ub.Scene([beam], supports=scene.supports, loads=[snow])
        >>> run = ub.simulate(loaded, ub.Static(), t=(0, 1), dt=1.0)
        >>> print(run.reaction(loaded.supports[0])[-1, 1:].round())  # N, N m
        [2000. 2000.]
        >>> drift = ub.LineLoad(beam, force=(0, -1e3), span=(0.5, 1.0), profile=(0.0, 2.0))
        >>> loaded = ub.Scene([beam], supports=scene.supports, loads=[drift])
        >>> run = ub.simulate(loaded, ub.Static(), t=(0, 1), dt=1.0)
        >>> print(run.reaction(loaded.supports[0])[-1, 1:].round())  # 1 kN at 5/3 m
        [1000. 1667.]
    """

    force: VectorOfScene = (0.0, 0.0)
    moment: Number = 0.0
    amplitude: Timed = steady


def require_normal(normal: object, what: str) -> float | tuple[float, float]:
    """Return a pressure as a number, or as two numbers in space, or raise."""
    if np.ndim(normal) == 0:  # type: ignore[arg-type]
        return checks.require_number(normal, what)
    return checks.require_vector(normal, what)


@closed(OWN_LOAD)
@dataclass(frozen=True, eq=False, repr=False)
class Pressure(LoadAlongBeam):
    """Pressure on a beam or a part of it: forces that turn with the deformed axis.

    The forces are per deformed length, so a pressure p on a closed line has the potential p times
    the enclosed area.  A pressure on an open line is not conservative if its ends move.

    Args:
        beam: Loaded beam.
        normal: Force along the normal, which points to the left of the direction of the beam; in
            space two forces, normal to the deformed axis in the directions of the axes 2 and 3 of
            the section; N/m.
        tangential: Force along the axis, in the direction of the beam; N/m.
        amplitude: Factor on both forces, a function of time t (s).
        span: As in :class:`LineLoad`.
        profile: As in :class:`LineLoad`.

    Raises:
        ModelError: The span is not inside the beam, or the profile is no number somewhere.

    Example:
        >>> wind = ub.Pressure(beam, normal=-1e3)
        >>> blown = ub.Scene([beam], supports=[ub.Clamped(beam.start)], loads=[wind])
        >>> run = ub.simulate(blown, ub.Static(), t=(0, 1), dt=1.0)
        >>> horizontal, vertical, _ = run.reaction(blown.supports[0])[-1]
        >>> print(f"{horizontal:.2f} N, {vertical:.0f} N")  # the axis has turned
        0.14 N, 2000 N
    """

    normal: Annotated[Any, require_normal] = 0.0
    tangential: Number = 0.0
    amplitude: Timed = steady

    dead: ClassVar = False


def require_route(beams: object, what: str) -> Member | tuple[Member, ...]:
    """Return a beam, or several in a row as a tuple, or raise."""
    if isinstance(beams, Member):
        return beams
    if not isinstance(beams, Sequence):
        raise ArgumentTypeError(f"{what} = {shorten(beams)} is neither a Beam nor a list of beams")
    route: tuple[Member, ...] = require_all(beams, what, Member)
    if not route:
        raise ModelError(f"{what} is empty; give the beam along which the load moves")
    for a, b in pairwise(route):
        gap = math.dist(a.end.point, b.start.point)
        if gap > 1e-9 * math.dist(a.start.point, a.end.point):
            raise ModelError(
                f"{what}: {b.name} starts {gap:.6g} m from the end of {a.name}; give beams in the "
                "order and direction of the distance"
            )
    return route


@closed(OWN_LOAD)
@dataclass(frozen=True, eq=False, repr=False)
class MovingLoad(Load):
    """Dead force, and mass, that move along a beam, or along several beams in a row.

    Nodal forces are consistent: the force times the shape functions of the cell in which it is.
    Section forces are exact at the ends of cells.  Inside the cell of the load they are those of a
    distributed force with the same resultant, so that there bending moments have errors up to
    0.15 times the force times the length of the cell.

    In dynamics, the mass has the velocity v = ∂r/∂t + ṡ ∂r/∂s of the point r(s, t) of the axis at
    its distance s, and the acceleration dv/dt, which includes the terms of Coriolis and of the
    curvature.  A kink of r between two cells changes the momentum of the mass by the opposite of
    what the beam receives.  A scheme without numerical damping keeps small oscillations of the
    velocity of the mass and of forces near it after such kinks; they change sign in each step, and
    displacements hardly have them.  A mass that comes to the beam has at once the velocity of the
    axis there.  The kinetic energy of the mass on the beam is part of "kinetic" in the ledger, from
    the beginning if the mass is then on the beam; "loads" contains the energy that the drive of the
    mass supplies, and with which the mass enters and leaves.  ``Gravity`` does not weigh this mass:
    ``force`` contains its weight.  Analyses of modes ignore it.  Where the mass begins, its speed
    is a difference of positions over 1e-4 s.

    Args:
        beam: Beam along which the force moves, or a sequence of beams, each of which starts where
            the one before ends.
        position: Distance from the start of the first beam along the undeformed axis, a function of
            time t (s); m.  The force acts while it is between zero and the length of the beams.
        force: (F_x, F_y), in space (F_x, F_y, F_z); N.
        amplitude: Factor on the force, a function of time t (s).
        mass: Mass that moves with the force, in the plane; kg.

    Raises:
        ModelError: A beam does not start where the one before ends.

    Example:
        >>> axle = ub.MovingLoad(beam, lambda t: 10.0 * t, force=(0, -1e4))  # 10 m/s
        >>> crossed = ub.Scene([beam], supports=[ub.Clamped(beam.start)], loads=[axle])
        >>> run = ub.simulate(crossed, ub.Static(), t=(0, 0.3), dt=0.1)  # it leaves at t = 0.2 s
        >>> print(run.reaction(crossed.supports[0])[:, 2].round())  # N m
        [    0. 10000. 20000.     0.]
    """

    beam: Annotated[Member | Sequence[Member], require_route]
    position: Timed
    force: VectorOfScene = (0.0, 0.0)
    amplitude: Timed = steady
    _: KW_ONLY
    mass: NotNegative = 0.0

    def __str__(self) -> str:
        return f"MovingLoad on {', '.join(beam.name for beam in self.route)}"

    def attached_to(self) -> Iterable[AttachmentPoint]:
        """See the base class."""
        return (beam.start for beam in self.route)

    @property
    def route(self) -> tuple[Member, ...]:
        """The beams in the order of the distance."""
        return (self.beam,) if isinstance(self.beam, Member) else tuple(self.beam)

    @property
    def length(self) -> float:
        """Length of the beams, of their cells without refinement, and its round-off; m."""
        length = 0.0
        for beam in self.route:
            ends = sorted({*(i / beam.cells for i in range(beam.cells + 1)), *beam.corners})
            points = [beam.at(s).point for s in ends]
            length += sum(math.dist(a, b) for a, b in pairwise(points))
        return length * (1.0 + 1e-9)

    def places(self, times: Array) -> Array:
        """Return the distances from the start of the first beam; (n,); m."""
        return np.array([value_at(self.position, float(t), self) for t in times])

    def arrivals(self, t0: float, t1: float) -> Iterator[float]:
        """Yield times at which the load comes to the beams or leaves them; s.

        They are exact if its speed is constant in a thousandth of the run.
        """
        times = np.linspace(t0, t1, 1001, dtype=np.float64)
        places = self.places(times)
        for end in (0.0, self.length):
            for k in np.flatnonzero(np.diff(places > end)):
                fraction = (end - places[k]) / (places[k + 1] - places[k])
                yield float(times[k] + fraction * (times[k + 1] - times[k]))


@closed(OWN_LOAD)
@dataclass(frozen=True, eq=False, repr=False)
class Gravity(Load):
    """Weight of all beams, bodies and point masses.

    Args:
        acceleration: (g_x, g_y); m/s².
        amplitude: Factor on the acceleration, a function of time t (s).

    Example:
        >>> hanging = ub.Scene([beam], supports=[ub.Clamped(beam.start)], loads=[ub.Gravity()])
        >>> run = ub.simulate(hanging, ub.Static(), t=(0, 1), dt=1.0)
        >>> print(run.reaction(hanging.supports[0])[-1, 1].round())  # weight, 2 m of 157 kg/m; N
        3080.0
    """

    acceleration: VectorOfScene = (0.0, -9.81)
    amplitude: Timed = steady

    def __str__(self) -> str:
        return "Gravity"


@closed(OWN_LOAD)
@dataclass(frozen=True, eq=False)
class RotatingFrame(Load):
    """Centrifugal and Coriolis forces on all masses, in a frame that turns at a constant rate.

    Motions, velocities and all other loads refer to the rotating frame.  A static run gives the
    state of steady rotation, with its deformation.  A scene with a frame refuses a
    :class:`MovingLoad` with a mass, on which these forces would not act.

    Args:
        rate: Angular velocity of the frame, counter-clockwise; in space a vector; rad/s.
        about: Centre of rotation, or a point of its axis; m.

    Example:
        >>> blade = ub.Scene([beam], supports=scene.supports, loads=[ub.RotatingFrame(rate=50.0)])
        >>> turning = ub.simulate(blade, ub.Static(), t=(0, 1), dt=1.0)
        >>> bool(ub.modes(blade, 1, at=turning).omega > ub.modes(scene, 1).omega)  # stiffer
        True
    """

    rate: Annotated[Any, require_moment]
    about: VectorOfScene = (0.0, 0.0)

    # A rate that varies in time would cause a further force, the Euler force.
    amplitude: ClassVar[TimeFunction] = steady  # type: ignore[misc]
    dead: ClassVar = False

    def functions_of_time(self) -> Iterable[TimeFunction]:
        """See the base class."""
        return (steady,)


LOADS = PointLoad, FollowerLoad, LineLoad, Pressure, MovingLoad, Gravity, RotatingFrame
"""All classes of loads."""


# -- viscous damping of the elastic motion ------------------------------------------------------


@closed("state other damping as a VirtualWork of v")
@dataclass(frozen=True)
class Rayleigh(Record):
    """Rayleigh damping (a0 M + a1 K) v with the stiffness K of the undeformed scene, P(92).

    The damping ratio of a mode of circular frequency ω is a0/(2ω) + a1 ω/2.  This damping is not
    objective: it acts on rigid rotations.  In large motion use KelvinVoigt.  It also acts on
    yielding cells and on hinges that open in cells, but neither on hinges of zero length nor on
    springs, see docs/howto_earthquake.md.

    With ``tangent=True``, K is the tangent stiffness of the cells at the end of the last step, the
    committed stiffness of other programs.  It is constant during a step.  Yielding cells and open
    hinges are then damped with their reduced stiffness, in the present directions of the beams.

    * Negative eigenvalues of the tangents of sections, as of softening, count as zero.  With them
      the damping would supply energy.
    * Geometric stiffness is left out.  It would resist the rotation of beams in tension and supply
      energy to beams in compression.
    * K is of the last step, so that a run is of first order in the step where K changes.
    * A run begins with the elastic stiffness, also after :func:`simulate` with ``start=``, unless
      the earlier run had this damping.

    Args:
        mass: Factor a0 on the mass matrix; 1/s.
        stiffness: Factor a1 on the stiffness matrix; s.
        tangent: True for the tangent stiffness of the last step instead of the initial stiffness.

    Raises:
        ModelError: A factor is negative, both are zero, or ``stiffness`` is zero with
            ``tangent=True``.

    Example:
        >>> damping = ub.Rayleigh(mass=1.0, stiffness=1e-5)  # 1/s, s
        >>> damped = ub.Scene([beam], supports=scene.supports, damping=[damping])
        >>> vibration = ub.modes(damped, 3)
        >>> np.allclose(vibration.damping, 0.5 / vibration.omega + 0.5e-5 * vibration.omega)
        True
    """

    _: KW_ONLY
    mass: NotNegative = 0.0
    stiffness: NotNegative = 0.0
    tangent: Switch = False
    beams: ClassVar[None] = None

    def __post_init__(self) -> None:
        super().__post_init__()
        if self.mass == self.stiffness == 0.0:
            raise ModelError("Rayleigh: mass and stiffness are both zero; leave damping out")
        if self.tangent and self.stiffness == 0.0:
            raise ModelError(
                "Rayleigh: tangent=True has no effect with stiffness = 0; give stiffness, or leave "
                "out tangent"
            )

    @classmethod
    def with_ratios(
        cls,
        ratios: float | tuple[float, float],
        omega: tuple[float, float],
        *,
        tangent: bool = False,
    ) -> Rayleigh:
        """Build the damping that has given damping ratios at two circular frequencies.

        Args:
            ratios: Damping ratio at both frequencies, or a pair of damping ratios.
            omega: Two different circular frequencies, such as ``modes(scene, 2).omega``; rad/s.
            tangent: As in :class:`Rayleigh`.

        Raises:
            ModelError: A frequency is not positive, the frequencies are equal, or the ratios would
                need a negative factor, or with ``tangent=True`` a zero stiffness factor.

        Example:
            >>> damping = ub.Rayleigh.with_ratios(0.03, ub.modes(scene, 2).omega)
            >>> damped = ub.Scene([beam], supports=scene.supports, damping=[damping])
            >>> print(ub.modes(damped, 2).damping.round(6))
            [0.03 0.03]
        """
        what = "Rayleigh.with_ratios"
        pair = (ratios, ratios) if np.ndim(ratios) == 0 else ratios
        z1, z2 = checks.require_vector(pair, f"{what}: ratios")
        w1, w2 = checks.require_vector(omega, f"{what}: omega")
        if min(w1, w2) <= 0 or w1 == w2:
            raise ModelError(
                f"{what}: omega = ({w1:g}, {w2:g}) must be two different, positive frequencies"
            )
        mass, stiffness = np.linalg.solve([[0.5 / w1, w1 / 2], [0.5 / w2, w2 / 2]], [z1, z2])
        if min(z1, z2) <= 0 or min(mass, stiffness) < 0:
            raise ModelError(
                f"{what}: ratios = ({z1:g}, {z2:g}) at omega = ({w1:g}, {w2:g}) rad/s need the "
                f"factors mass = {mass:.3g}, stiffness = {stiffness:.3g}, which must not be "
                "negative; give positive ratios that differ less than the frequencies"
            )
        plausibility.check(what, "damping ratio", max(z1, z2))
        return cls(mass=mass, stiffness=stiffness, tangent=tangent)


@closed("state other damping as a VirtualWork of v")
@dataclass(frozen=True, eq=False)
class KelvinVoigt(Record):
    """Kelvin-Voigt damping: retardation time times elastic stiffness times strain rates.

    The damping is objective: rigid motions are not damped.  In small vibration, the damping ratio
    of a mode of circular frequency ω is retardation_time ω/2, as with
    ``Rayleigh(stiffness=retardation_time)``.  Beams with ``Section(hinge=)`` are not damped.

    Args:
        retardation_time: Viscosity divided by stiffness; s.
        beams: The damped beams; all by default.

    Raises:
        ModelError: ``retardation_time`` is not positive.

    Example:
        >>> damped = ub.Scene([beam], supports=scene.supports, damping=[ub.KelvinVoigt(1e-4)])
        >>> vibration = ub.modes(damped, 2)
        >>> np.allclose(vibration.damping, 0.5e-4 * vibration.omega)
        True
    """

    retardation_time: Positive
    beams: Beams = None

    def attached_to(self) -> Iterable[AttachmentPoint]:
        """See the base class."""
        return (beam.start for beam in self.beams or ())


Damping = Rayleigh | KelvinVoigt
