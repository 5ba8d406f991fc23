# SPDX-License-Identifier: MIT
"""Laws of connectors that a user states: energy, resistance, variables; functions."""

from __future__ import annotations

import copy
import inspect
from abc import ABC
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, fields
from functools import partial
from numbers import Real
from typing import Annotated, Any, ClassVar

import numpy as np

from ufl_beam.errors import ModelError, closed, shorten
from ufl_beam.model.checks import require_function, require_number, require_row, require_text
from ufl_beam.model.material_law import (
    State,
    Values,
    initial_state,
    quadratic,
    require_fields,
    require_names,
)
from ufl_beam.model.records import Record, parameters_by_name

LOSSES = ("damping", "friction", "functions", "connectors", "contact")
"""Entries of the energy ledger of what connectors and dampers lose."""

ENTRIES = (
    *("kinetic", "stored", "hardening", "loads", "supports", "motors", "controllers"),
    *("numerical", "plastic", "hinges", *LOSSES),
)
"""Names that entries of the energy ledger have already."""

IMAGINARY = 1e-30
"""Part of a complex step, which leaves all digits to a derivative."""


class ConnectorLaw(ABC):  # noqa: B024 - none of its methods must be there, but one of two
    """Base of the laws of connectors; a law of one's own is a frozen dataclass of it.

    The fields of the dataclass are the numbers of the law.  Its methods are written with the
    functions of ``ub.law_functions``.  A law states an energy, a resistance, or both: the force
    that resists the growth of the motion is the derivative of the energy by the motion, plus the
    resistance.  Work that is not stored is lost.  A law of what rubs states a limit, and perhaps a
    sliding force, instead: the motion is held, without a stiffness, until the force is beyond the
    limit, and again when it comes to rest.  See docs/extending_laws.md.

    Attributes:
        variables: Internal variables, and their values before anything has happened.
        components: Motions that the law acts on; 2 or 3 of a law for :class:`Bushing`, whose
            methods get tuples of motions and rates, and whose resistance is a tuple.
        entry: Entry of the ledger, in ``lost``, of what is not stored.
        active: True of a law that may give energy, such as a drive.  Else runs warn if the energy
            that it has lost falls.

    Example:
        >>> from dataclasses import dataclass
        >>> @dataclass(frozen=True)
        ... class Buffer(ub.ConnectorLaw):
        ...     stiffness: float  # N/m
        ...     cubic: float  # N/m³
        ...     damping: float  # N s²/m²
        ...     def energy(self, motion, state):
        ...         return self.stiffness * motion**2 / 2 + self.cubic * motion**4 / 4
        ...     def resistance(self, motion, rate, state, dt):
        ...         return self.damping * ub.law_functions.absolute(rate) * rate
        >>> buffer = ub.Slide(ub.ground(2, 0), beam.end, Buffer(1e6, 1e9, 1e4), axis=(0, 1))
        >>> caught = ub.Scene(
        ...     [beam], supports=scene.supports, loads=scene.loads, connectors=[buffer]
        ... )
        >>> run = ub.simulate(caught, ub.EnergyMomentum(), t=(0, 0.5), dt=0.005)
        >>> bool(run.energy.lost["connectors"][-1] > 0), bool(run.energy.worst < 1e-9)
        (True, True)
    """

    variables: ClassVar[Mapping[str, float]] = {}
    components: ClassVar[int] = 1
    entry: ClassVar[str] = "connectors"
    active: ClassVar[bool] = False

    def energy(self, motion: Any, state: State) -> Values:
        """Energy that can be had back, zero by default; J.

        Args:
            motion: m or rad; a tuple where there are several components.
            state: Internal variables, as attributes.
        """
        return 0.0

    def resistance(self, motion: Any, rate: Any, state: State, dt: Values) -> Any:
        """Force beside that of the energy, zero by default; N or N m; a tuple of several.

        Args:
            motion: At the time of the step at which the law holds; m or rad.
            rate: Mean rate of the step; m/s or rad/s.
            state: Internal variables at the time of the motion.
            dt: Length of the step; s.
        """
        return 0.0 if self.components == 1 else self.components * (0.0,)

    def limit(self, state: State) -> Values:
        """Force up to which the motion is held, none by default; N or N m.

        Args:
            state: Internal variables at the beginning of the step.
        """
        return 0.0

    def sliding(self, motion: Values, rate: Values, state: State, dt: Values) -> Values:
        """Size of the force against sliding, the limit by default; N or N m.

        It has the arguments of :meth:`resistance`.
        """
        return self.limit(state)

    def increments(self, motion: Any, rate: Any, state: State, dt: Values) -> Mapping[str, Values]:
        """Changes of the variables over a backward-Euler step of length dt, in closed form.

        Args:
            motion: At the end of the step; m or rad.
            rate: Mean rate; m/s or rad/s.
            state: Variables at its beginning.
            dt: s; infinite on a path.
        """
        return {}

    @property
    def holds(self) -> bool:
        """True if the motion is held below a limit."""
        return type(self).limit is not ConnectorLaw.limit

    @property
    def elastic(self) -> bool:
        """True if the law loses nothing."""
        lossless = type(self).resistance is ConnectorLaw.resistance and not self.holds
        return lossless and not self.variables

    @property
    def resists(self) -> bool:
        """True if the law resists every motion, as a spring does."""
        return type(self).energy is not ConnectorLaw.energy

    def numbers(self) -> dict[str, Any]:
        """Numbers of the law by name, its fields."""
        return {field.name: getattr(self, field.name) for field in fields(self)}  # type: ignore[arg-type]

    def of(self, numbers: Mapping[str, Values]) -> ConnectorLaw:
        """Return the law with arrays or symbols in the place of its numbers."""
        law = copy.copy(self)
        vars(law).update(numbers)
        return law

    def given(self, motions: Sequence[Values]) -> Any:
        """Motions as the methods of the law get them: a number, or a tuple of several."""
        return motions[0] if self.components == 1 else tuple(motions)

    def each(self, forces: Any) -> tuple[Values, ...]:
        """Forces of the law as a tuple, also where there is one."""
        return (forces,) if self.components == 1 else tuple(forces)

    def elastic_forces(self, motions: Sequence[Values], state: State) -> list[Values]:
        """Derivatives of the energy by the motions, arrays of real numbers; N or N m."""
        forces = []
        for i, motion in enumerate(motions):
            moved = [*motions[:i], motion + IMAGINARY * 1j, *motions[i + 1 :]]
            with np.errstate(all="ignore"):
                energy = self.energy(self.given(moved), state)
            forces.append(np.imag(energy) / IMAGINARY + 0 * motion)
        return forces


# -- checks --------------------------------------------------------------------------------------


def require_connector_law(law: ConnectorLaw, what: str) -> None:
    """Raise :class:`ModelError` unless a law of a connector is complete; it is called at no motion.

    Its methods are compiled when a run begins.
    """
    what = f"{what}: {type(law).__name__}"
    require_fields(law, ConnectorLaw, what)
    for name, value in law.numbers().items():
        require_number(value, f"{what}: {name}")
    stated = {n for n in CALLED if getattr(type(law), n) is not getattr(ConnectorLaw, n)}
    if not stated & {"energy", "resistance", "limit"}:
        raise ModelError(
            f"{what} has neither energy nor resistance, nor a limit; define one of these methods"
        )
    if law.holds and (stated & {"energy", "resistance"} or law.components > 1):
        raise ModelError(
            f"{what} has a limit, which is for laws of one component without energy and "
            "resistance; let another connector beside it have these"
        )
    if "sliding" in stated and not law.holds:
        raise ModelError(f"{what} has a sliding force and no limit; define this method")
    if law.variables and "increments" not in stated:
        raise ModelError(f"{what} has variables and no increments; define this method")
    require_text(law.entry, f"{what}.entry")
    if not law.entry or (law.entry in ENTRIES and law.entry not in LOSSES):
        raise ModelError(
            f"{what}.entry = {law.entry!r} is no name for what is lost; there are "
            f"{', '.join(LOSSES)}, or take a name of your own"
        )
    for name, value in law.variables.items():
        require_number(value, f"{what}.variables[{name!r}]")
    if law.components not in (1, 2, 3):
        raise ModelError(f"{what}.components = {law.components!r} must be 1, 2 or 3")
    motion, state = law.given([np.zeros(1)] * law.components), initial_state(law)
    calls = {"energy": (motion, state), "limit": (state,)}
    calls |= dict.fromkeys(CALLED[2:], (motion, motion, state, 1.0))
    for name, arguments in calls.items():
        try:
            with np.errstate(all="ignore"):
                found = getattr(law, name)(*arguments)
        except Exception as error:
            raise ModelError(
                f"{what}.{name} fails at no motion: {error}{stated_at(law)}"
            ) from error
        if name == "increments":
            require_names(found, law, f"{what}.{name}")
        if name == "resistance" and law.components > 1:
            if not isinstance(found, tuple | list) or len(found) != law.components:
                raise ModelError(
                    f"{what}.resistance returns {shorten(found)}; it must return a tuple of "
                    f"{law.components} forces{stated_at(law)}"
                )
            values = [("", force) for force in found]
        else:
            values = list(found.items()) if name == "increments" else [("", found)]
        for of, value in values:
            number = isinstance(value, Real) or np.shape(value) == (1,)
            if not number or not np.all(np.isfinite(value)):
                raise ModelError(
                    f"{what}.{name} returns {f'{of} = ' * bool(of)}{shorten(value)} at no motion; "
                    f"it must return a number there{stated_at(law)}"
                )


CALLED = ("energy", "limit", "resistance", "sliding", "increments")
"""Methods that a law of a connector may define."""


def require_limit(law: ConnectorLaw, what: str) -> None:
    """Raise :class:`ModelError` unless increments of a law have a limit for ever longer steps."""
    motion, rest = (law.given([np.full(1, x)] * law.components) for x in (0.5, 0.0))
    with np.errstate(all="ignore"):
        changes = law.increments(motion, rest, initial_state(law), np.inf) if law.variables else {}
    for name, change in changes.items():
        if not np.all(np.isfinite(change)):
            raise ModelError(
                f"{what}: {type(law).__name__}.increments returns {name} = {shorten(change)} for "
                "dt = inf, and steps of a path are infinitely slow; state it so that it has a "
                f"limit, as a / (b / dt + c), or use simulate(scene, Static(), ...){stated_at(law)}"
            )


def stated_at(law: object) -> str:
    """Return file and line of the class of a law in brackets, if they are known."""
    try:
        file, (_, line) = inspect.getsourcefile(type(law)), inspect.getsourcelines(type(law))
    except (OSError, TypeError):
        return ""
    return f" ({file}, line {line})"


def judges_loss(law: ConnectorLaw) -> bool:
    """Return whether what a law of a connector loses is its own dissipation, whatever the step.

    With variables it is, up to an error of the step, unless the energy is quadratic.
    """

    def energy(factor: float) -> list[float]:
        draw = np.random.default_rng(0).uniform
        state = State({name: factor * draw(-1.0, 1.0, 1) for name in law.variables})
        with np.errstate(all="ignore"):
            motions = [factor * draw(-1.0, 1.0, 1) for _ in range(law.components)]
            return [float(np.sum(law.energy(law.given(motions), state)))]

    return not law.active and (not law.variables or quadratic(energy))


# -- functions of a user ------------------------------------------------------------------------


def _require_state(value: Any, what: str) -> tuple[float, ...]:
    return tuple(map(float, require_row(value, what)))


@closed("give it a function of your own")
@dataclass(frozen=True, repr=False)
class ForceLaw(Record):
    """Force of a connector as a function of its motion and rate, of time and its own history.

    Args:
        force: ``force(motion, rate)``; N or N m; a positive one resists growth.  It is evaluated
            where loads are, in dynamics in the middle of the step.  By name it may ask for ``t``,
            the time of that (s), ``dt``, the length of the step (s), and ``state``, the internal
            variables before it; then it returns the force and those after the step.
        state: Internal variables before the run.
        stored: ``stored(motion)``, or ``stored(motion, state)``, the energy that can be had back;
            J.  It is in the entry "stored" of the ledger, and the work that the law takes beyond it
            in the entry "functions"; without it all of the work.

    Raises:
        ModelError: A parameter that is not known; a state that the function does not ask for, or
            that it does and is not there.

    Example:
        >>> law = ub.ForceLaw(lambda motion, rate: 1e6 * motion + 1e9 * motion**3)
        >>> spring = ub.Slide(ub.ground(2, 0), beam.end, law, axis=(0, 1))
        >>> propped = ub.Scene(
        ...     [beam], supports=scene.supports, loads=scene.loads, connectors=[spring]
        ... )
        >>> run = ub.simulate(propped, ub.Static(), t=(0, 1), dt=0.25)
        >>> bool(run.connector(spring).force[-1] < 0)  # it is compressed
        True
        >>> def maxwell(motion, rate, dt, state):  # a spring in series with a damper, and its force
        ...     after = (state[0] + 1e6 * rate * dt) / (1 + dt / 0.1)
        ...     return (state[0] + after) / 2, [after]
        >>> device = ub.Slide(ub.ground(2, 0), beam.end, ub.ForceLaw(maxwell, [0.0]), axis=(0, 1))
        >>> relaxing = ub.Scene(
        ...     [beam], supports=scene.supports, loads=scene.loads, connectors=[device]
        ... )
        >>> run = ub.simulate(relaxing, ub.EnergyMomentum(), t=(0, 1), dt=0.01)
        >>> bool(run.energy["functions"][-1] > 0), bool(run.energy.worst < 1e-9)
        (True, True)
    """

    force: Annotated[Callable[..., Any], partial(require_function, of="(motion, rate)")]
    state: Annotated[Sequence[float], _require_state] = ()
    stored: Annotated[
        Callable[..., float] | None,
        partial(require_function, of="the motion, or (motion, state)"),
    ] = None

    def __post_init__(self) -> None:
        super().__post_init__()
        if self.state and "state" not in self.asked:
            raise ModelError(
                "ForceLaw: the function does not ask for the state; let it have a parameter state, "
                "and return the force and the state after the step"
            )
        _ = self.asked, self.asked_by_stored  # which refuse names that nobody knows

    @property
    def asked(self) -> tuple[str, ...]:
        """Names by which the function asks for more than motion and rate."""
        return self._names(self.force, "force", "t", "dt", after=2)

    @property
    def asked_by_stored(self) -> tuple[str, ...]:
        """Names by which the energy asks for more than the motion."""
        return self._names(self.stored, "stored", after=1) if self.stored else ()

    def _names(
        self, function: Callable[..., Any], what: str, *known: str, after: int
    ) -> tuple[str, ...]:
        more = "" if self.state else f"{', ' * bool(known)}with ForceLaw(..., state=[...]) state"
        known = (*known, "state") if self.state else known
        return parameters_by_name(function, known, f"ForceLaw: {what}", after, more) or ()
