# SPDX-License-Identifier: MIT
"""Effects of a user in UFL: statements, virtual works and potentials."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import KW_ONLY, dataclass, field, is_dataclass
from functools import partial
from typing import Annotated, Any, ClassVar

from ufl_beam.display import bracketed
from ufl_beam.errors import ModelError, closed, shorten
from ufl_beam.model import checks
from ufl_beam.model.bodies import AttachmentPoint, Beams, BodyPoint, Member, Place
from ufl_beam.model.connector_law import CONTRIBUTIONS
from ufl_beam.model.functions import TimeFunction, require_time_function
from ufl_beam.model.records import Record, parameters_by_name


def _require_name(name: Any, what: str) -> None:
    checks.require_text(name, what)
    if not name or name in CONTRIBUTIONS:
        raise ModelError(
            f"{what} = {name!r} is empty or a reserved entry of the energy ledger; give the work "
            "another name"
        )


def _require_numbers(owner: Work | Effect) -> None:
    """Require numbers and functions of time by name, and at least one beam."""
    if owner.beams is not None and not owner.beams:
        raise ModelError(f"{owner}: beams is empty; leave it out for all beams")
    if not isinstance(owner.numbers, Mapping):
        raise ModelError(
            f"{owner}: numbers = {shorten(owner.numbers)} must be numbers by name, as {{'c': 1}}"
        )
    object.__setattr__(owner, "numbers", dict(owner.numbers))
    for name, value in owner.numbers.items():
        what = f"{owner}: numbers[{shorten(name)}]"
        if callable(value):
            require_time_function(value, what)
        else:
            checks.require_number(value, what)


class _WithNumbers(Record):
    """Base of effects at places or along beams, with numbers that may be functions of time."""

    __repr__ = bracketed

    def attached_to(self: Any) -> Iterable[AttachmentPoint]:
        """See the base class."""
        return *(beam.start for beam in self.beams or ()), *self.places

    def functions_of_time(self: Any) -> Iterable[TimeFunction]:
        """See the base class."""
        return (number for number in self.numbers.values() if callable(number))


@dataclass(frozen=True, eq=False, repr=False)
class Work(_WithNumbers):
    """Base of effects along beams, defined by a function that returns a work or energy per length.

    Attributes:
        arguments: Possible names of the parameters of the function, besides names in ``numbers``.
    """

    arguments: ClassVar[tuple[str, ...]]
    places: ClassVar[tuple[()]] = ()

    name: Annotated[str, _require_name]
    density: Callable[..., Any]
    _: KW_ONLY
    beams: Beams = None
    numbers: Mapping[str, float | TimeFunction] = field(default_factory=dict)
    degree: Annotated[int, checks.require_count] = 2

    def __post_init__(self) -> None:
        super().__post_init__()
        _require_numbers(self)
        for name in self.numbers:
            if name in self.arguments:
                raise ModelError(
                    f"{self}: numbers[{name!r}]: the name has a meaning already; take another name"
                )
        checks.require_function(self.density, f"{self}: density", ", ".join(self.arguments))
        parameters = self.used_arguments
        for name in self.numbers:
            if name not in parameters:
                raise ModelError(f"{self}: numbers[{name!r}] is no parameter of the function")

    def __str__(self) -> str:
        return f"{type(self).__name__} {self.name!r}"

    @property
    def used_arguments(self) -> tuple[str, ...]:
        """Names of the parameters of the function; an unknown name raises :class:`ModelError`."""
        known = (*self.arguments, *self.numbers)
        parameters = parameters_by_name(
            self.density, known, f"{self}: the function", more=", and the names in `numbers`"
        )
        if parameters is None:
            raise ModelError(
                f"{self}: the parameters of {shorten(self.density)} have no names; write a "
                f"function of some of {', '.join(known)}"
            )
        return parameters

    @property
    def takes_rates(self) -> bool:
        """True if the function has a parameter ``v`` or ``dt``, which only a time step defines."""
        return not {"v", "dt"}.isdisjoint(self.used_arguments)

    @property
    def in_time(self) -> str:
        """Ledger entry of the energy that a potential gains by explicit dependence on time."""
        return f"{self.name} in time"

    def on(self, beams: Sequence[Member]) -> Sequence[Member]:
        """Return the beams on which the work acts; ``beams`` are all beams of the scene."""
        return beams if self.beams is None else self.beams


@closed("give it a function of your own")
@dataclass(frozen=True, eq=False, repr=False)
class VirtualWork(Work):
    """Virtual work of a distributed effect, written in UFL.

    The function returns the work of the effect in a virtual motion, per undeformed length and with
    the sign of loads: for a force f along y it is ``f * w[1]``.  UFL derives the tangent.  The
    function may have parameters of these names:

    * ``q0``, ``q1``: configurations (u_x, u_y, ψ) at both ends of the step; m, m, rad,
    * ``q``: configuration at the time of the loads, in :class:`EnergyMomentum` the mean of ``q0``
      and ``q1``,
    * ``v``: mean velocity of the step, (q1 - q0)/dt, also in static runs; m/s, m/s, rad/s,
    * ``w``: virtual motion (w_x, w_y, w_ψ), in which the work is linear; m, m, rad,
    * ``axis``: undeformed axis with point ``axis.x`` (m), unit tangent ``axis.t0`` and normal
      ``axis.n0``, all (2,), derivative ``axis.d(f)`` by arc length, cell length ``axis.h`` (m),
    * ``t``, ``dt``: time at which the effect acts, and length of the step; s,
    * the names in ``numbers``.

    The entry ``name`` in ``energy.supplied`` is the work of the effect since the beginning of the
    run.  For effects that store energy use a :class:`Potential`.  In a static run, too, ``v`` is
    not zero: works with ``v`` act as dampers there, with a warning.

    Args:
        name: Name of the entry in the ledger.
        density: The function; J/m.
        beams: Beams on which the effect acts; all by default.
        numbers: Parameters of the function: numbers or functions of time.  New values need no
            compilation.
        degree: Degree of polynomials along a cell that quadrature integrates exactly, for
            ``Mesh(degree=1)``.  Each further degree of the mesh adds two.

    Raises:
        ModelError: The name is empty, or an entry of the ledger of the package.  Scenes refuse two
            works of one name.  Runs refuse a result that is no UFL scalar linear in w.

    Example:
        >>> def drag(v, w, c):
        ...     return -c * (v[0] ** 2 + v[1] ** 2 + 1e-12) ** 0.5 * (v[0] * w[0] + v[1] * w[1])
        >>> air = ub.VirtualWork("air", drag, numbers={"c": 0.6 * 1.2 * 0.2})  # N s²/m³
        >>> kick = ub.Velocity((beam,), linear=(0.0, 30.0))  # m/s
        >>> flying = ub.Scene([beam], initial=[kick], works=[air])
        >>> run = ub.simulate(flying, ub.EnergyMomentum(), t=(0, 1), dt=0.05)
        >>> bool(run.energy.worst < 1e-9), bool(run.energy["air"][-1] < 0)  # what the air takes
        (True, True)
    """

    arguments = ("q0", "q1", "q", "v", "w", "axis", "t", "dt")


@closed("give it a function of your own")
@dataclass(frozen=True, eq=False, repr=False)
class Potential(Work):
    """Potential energy of a distributed effect, written in UFL.

    The function returns the energy per undeformed length.  Its parameters may be ``q``, ``axis``,
    ``t`` and the names in ``numbers``, see :class:`VirtualWork`.  UFL derives the forces.
    Energy-momentum schemes use the mean of the forces over the step.  The work of the forces is
    then the increment of the energy: to round-off for polynomials up to degree 8, otherwise with an
    error of order nine in the step.  With ``alpha`` the dissipated part is the entry "numerical".
    The energy is the entry ``name`` in ``energy.state``.  The entry of ``energy.supplied`` with the
    name and " in time", such as "soil in time", is the energy gained by explicit dependence on
    time.

    It has the arguments of :class:`VirtualWork`.

    Raises:
        ModelError: The name is empty, or an entry of the ledger of the package.  Scenes refuse two
            works of one name.  Runs refuse a result that is no UFL scalar with q.

    Example:
        >>> soil = ub.Potential("soil", lambda q, k: k * q[1] ** 2 / 2, numbers={"k": 1e6})  # N/m²
        >>> load = ub.PointLoad(beam.at(0.5), force=(0, -1e3))
        >>> rail = ub.Scene(
        ...     [beam], supports=[ub.Roller(beam.start, along=(0, 1))], loads=[load], works=[soil]
        ... )
        >>> run = ub.simulate(rail, ub.Static(), t=(0, 1), dt=1.0)
        >>> print((1e3 * run.displacement(beam.end)[-1, 1]).round(3))  # mm
        -0.497
    """

    arguments = ("q", "axis", "t")


def _require_statement(statement: Any, what: str) -> None:
    kind = type(statement)
    if isinstance(statement, type) or not callable(getattr(statement, "equations", None)):
        raise ModelError(
            f"{what} = {shorten(statement)} must be an object of a class derived from "
            "ub.extend.Statement"
        )
    if not is_dataclass(statement) or "__hash__" not in vars(kind) or kind.__hash__ is None:
        raise ModelError(
            f"{what}: {kind.__name__} must be a frozen dataclass, because compiled functions are "
            "kept by statement; decorate the class with @dataclass(frozen=True)"
        )


@closed("give it a statement of your own")
@dataclass(frozen=True, eq=False, repr=False)
class Effect(_WithNumbers):
    """Effect of a user, by a :class:`Statement`: at places, or along beams.

    A statement of one place may also act along beams.  Its forces and energies are then those per
    undeformed length, and each quadrature point has a state of its own.

    Args:
        statement: Forces, state and energies; a frozen dataclass derived from :class:`Statement`.
        places: Places of beams, bodies and the ground, as many as the statement has.
        beams: Beams on which the effect acts, instead of places.
        numbers: Numbers of the statement by name: numbers or functions of time.  New values need no
            compilation.
        degree: Degree of polynomials along a cell that quadrature integrates exactly, see
            :class:`VirtualWork`.

    Raises:
        ModelError: The statement is no frozen dataclass, or has other places or numbers.  Runs
            refuse statements whose forces, state or energies do not fit, see :class:`Statement`.

    Example:
        >>> from dataclasses import dataclass
        >>> @dataclass(frozen=True)
        ... class Drag(ub.extend.Statement):
        ...     numbers = ("c",)  # N s/m, or N s/m² along beams
        ...
        ...     def equations(self, at):
        ...         force = [at["c"] * at.v[0][0], at["c"] * at.v[0][1], 0.0]
        ...         return ub.extend.Equations([force], lost={"drag": at.work([force])})
        >>> air = ub.Effect(Drag(), beams=[beam], numbers={"c": 2.0})
        >>> sail = ub.Effect(Drag(), places=[beam.end], numbers={"c": 5.0})
        >>> kick = ub.Velocity((beam,), linear=(0.0, 30.0))  # m/s
        >>> flying = ub.Scene([beam], initial=[kick], works=[air, sail])
        >>> run = ub.simulate(flying, ub.EnergyMomentum(), t=(0, 1), dt=0.05)
        >>> bool(run.energy.worst < 1e-9), bool(run.energy["drag"][-1] > 0)
        (True, True)
    """

    used_arguments: ClassVar[tuple[str, ...]] = ()
    takes_rates: ClassVar[bool] = False

    statement: Annotated[Any, _require_statement]
    _: KW_ONLY
    places: Annotated[
        Sequence[AttachmentPoint], partial(checks.require_all, kind=(Place, BodyPoint))
    ] = ()
    beams: Beams = None
    numbers: Mapping[str, float | TimeFunction] = field(default_factory=dict)
    degree: Annotated[int, checks.require_count] = 2

    def __post_init__(self) -> None:
        super().__post_init__()
        if bool(self.places) == bool(self.beams):
            raise ModelError(f"{self}: give either places or beams")
        _require_numbers(self)
        if (places := len(self.places) or 1) != self.statement.nodes:
            where = "along beams it has one" if self.beams else f"the effect has {places}"
            raise ModelError(
                f"{self}: the statement has {self.statement.nodes} places, and {where}"
            )
        if {*self.numbers} != {*self.statement.numbers}:
            raise ModelError(
                f"{self}: numbers has {', '.join(self.numbers) or 'no names'}, and the statement "
                f"{', '.join(self.statement.numbers) or 'none'}"
            )

    def __str__(self) -> str:
        return f"Effect {self.name}"

    @property
    def name(self) -> str:
        """Name of the statement."""
        return type(self.statement).__name__

    def on(self, beams: Sequence[Member]) -> Sequence[Member]:
        """Return the beams on which the effect acts."""
        return self.beams or ()
