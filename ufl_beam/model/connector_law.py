# SPDX-License-Identifier: MIT
"""Connector laws of users: classes with energy and resistance, or Python functions."""

from __future__ import annotations

import copy
import inspect
import math
from abc import ABC
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, fields
from functools import partial
from numbers import Real
from typing import Annotated, Any, ClassVar

import numpy as np

from ufl_beam.errors import ModelError, calling, closed, shorten
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

LOSSES = ("plastic", "damping", "friction", "functions", "connectors", "contact")
"""Entries of the package in the energy ledger to which a user's law may add its losses."""

CONTRIBUTIONS = (
    *("kinetic", "stored", "hardening", "loads", "supports", "motors", "controllers"),
    *("numerical", "impacts", "hinges", *LOSSES),
)
"""Names of all entries of the energy ledger that the package uses."""

IMAGINARY = 1e-30
"""Imaginary increment of complex-step derivatives, which do not suffer from cancellation."""


class ConnectorLaw(ABC):  # noqa: B024 - energy, resistance or limit must be defined
    """Base of connector laws; a user's law is a frozen dataclass derived from it.

    The fields of the dataclass are the parameters of the law.  The methods use the functions of
    ``ub.extend.law_functions``.  A law defines an energy, a resistance, or both.  The force is the
    derivative of the energy with respect to the motion, plus the resistance.  A positive force
    resists growth of the motion.  Work that is not stored is lost.  A friction law defines a limit
    instead, and optionally a sliding force: a constraint holds the motion until the constraint
    force exceeds the limit.  Then the motion slides until it stops.  See docs/extending_laws.md.

    Attributes:
        variables: Initial values of the internal variables, by name.
        components: Number of relative motions, by default 1.  A law for :class:`Bushing` has 2 or
            3; motions and rates are then tuples, and the resistance must be a tuple.
        entry: Name of the entry in ``energy.lost`` for work that is not stored.
        active: True if the law may supply energy, as a drive does.  Otherwise runs warn if the
            lost energy decreases.
        rate_independent: True if the increments are exact for a monotone motion of any length.
            The variables after a fraction of a step are then the increments for this fraction;
            otherwise they are proportional to the fraction.

    Example:
        >>> from dataclasses import dataclass
        >>> @dataclass(frozen=True)
        ... class Buffer(ub.extend.ConnectorLaw):
        ...     stiffness: float  # N/m
        ...     cubic: float  # N/m³
        ...     damping: float  # N s²/m²
        ...     def energy(self, motion, state):
        ...         return self.stiffness * motion**2 / 2 + self.cubic * motion**4 / 4
        ...     def resistance(self, motion, rate, state, dt):
        ...         return self.damping * ub.extend.law_functions.absolute(rate) * rate
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
    rate_independent: ClassVar[bool] = False

    def energy(self, motion: Any, state: State) -> Values:
        """Return the recoverable energy, zero by default; J.

        Args:
            motion: Relative motion, or a tuple of several components; m or rad.
            state: Internal variables, as attributes.
        """
        return 0.0

    def resistance(self, motion: Any, rate: Any, state: State, dt: Values) -> Any:
        """Return the force besides the derivative of the energy, zero by default; N or N m.

        A law with several components returns a tuple.

        Args:
            motion: Motion at the instant of the step at which the law is evaluated; m or rad.
            rate: Mean rate of the step; m/s or rad/s.
            state: Internal variables at this instant, as attributes.
            dt: Length of the step, infinite in ``follow``; s.
        """
        return 0.0 if self.components == 1 else self.components * (0.0,)

    def limit(self, state: State) -> Values:
        """Return the largest constraint force that holds the motion, zero by default; N or N m.

        Args:
            state: Internal variables at the beginning of the step.
        """
        return 0.0

    def sliding(self, motion: Values, rate: Values, state: State, dt: Values) -> Values:
        """Return the magnitude of the force against sliding, the limit by default; N or N m.

        The arguments are the same as for :meth:`resistance`.
        """
        return self.limit(state)

    @property
    def elastic_rotation(self) -> tuple[float, float]:
        """Elastic stiffness of a rotation (N m/rad), and its first limit (N m); NaN if unknown.

        Tables of hinges compute plastic rotations and ductilities with them.
        """
        return math.nan, math.nan

    def increments(self, motion: Any, rate: Any, state: State, dt: Values) -> Mapping[str, Values]:
        """Return increments of the variables over a backward-Euler step, in closed form.

        Args:
            motion: Motion at the end of the step; m or rad.
            rate: Mean rate of the step; m/s or rad/s.
            state: Variables at the beginning of the step, as attributes.
            dt: Length of the step, infinite in ``follow``; s.
        """
        return {}

    @property
    def holds(self) -> bool:
        """True if the law has a limit, below which a constraint holds the motion."""
        return type(self).limit is not ConnectorLaw.limit

    @property
    def elastic(self) -> bool:
        """True if the law loses no energy."""
        lossless = type(self).resistance is ConnectorLaw.resistance and not self.holds
        return lossless and not self.variables

    @property
    def resists(self) -> bool:
        """True if the law has an energy, so that it resists every motion as a spring does."""
        return type(self).energy is not ConnectorLaw.energy

    def parameters(self) -> dict[str, Any]:
        """Return the parameters of the law, its fields, by name."""
        return {field.name: getattr(self, field.name) for field in fields(self)}  # type: ignore[arg-type]

    def with_parameters(self, parameters: Mapping[str, Values]) -> ConnectorLaw:
        """Return the law with arrays or symbols as parameters."""
        law = copy.copy(self)
        vars(law).update(parameters)
        return law

    def as_argument(self, motions: Sequence[Values]) -> Any:
        """Return motions as the argument of the methods: the only motion, or a tuple of several."""
        return motions[0] if self.components == 1 else tuple(motions)

    def each(self, forces: Any) -> tuple[Values, ...]:
        """Return the result of :meth:`resistance` as a tuple, also for one component."""
        return (forces,) if self.components == 1 else tuple(forces)

    def elastic_forces(self, motions: Sequence[Values], state: State) -> list[Values]:
        """Return the derivatives of the energy with respect to real motions; N or N m."""
        forces = []
        for i, motion in enumerate(motions):
            moved = [*motions[:i], motion + IMAGINARY * 1j, *motions[i + 1 :]]
            with np.errstate(all="ignore"):
                energy = self.energy(self.as_argument(moved), state)
            forces.append(np.imag(energy) / IMAGINARY + 0 * motion)
        return forces


# -- checks --------------------------------------------------------------------------------------


def require_connector_law(law: ConnectorLaw, what: str) -> None:
    """Raise :class:`ModelError` unless a connector law is complete, by calls at zero motion."""
    what = f"{what}: {type(law).__name__}"
    require_fields(law, ConnectorLaw, what)
    for name, value in law.parameters().items():
        require_number(value, f"{what}: {name}")
    defined = {n for n in CALLED if getattr(type(law), n) is not getattr(ConnectorLaw, n)}
    if not defined & {"energy", "resistance", "limit"}:
        raise ModelError(
            f"{what} has neither energy nor resistance, nor a limit; define one of these methods"
        )
    if law.holds and (defined & {"energy", "resistance"} or law.components > 1):
        raise ModelError(
            f"{what} has a limit, which is for laws of one component without energy and "
            "resistance; give these to a second connector between the same places"
        )
    if "sliding" in defined and not law.holds:
        raise ModelError(f"{what} has a sliding force and no limit; define the method limit")
    if law.variables and "increments" not in defined:
        raise ModelError(f"{what} has variables and no increments; define this method")
    require_text(law.entry, f"{what}.entry")
    if not law.entry or (law.entry in CONTRIBUTIONS and law.entry not in LOSSES):
        raise ModelError(
            f"{what}.entry = {law.entry!r} is no entry for a loss; use one of "
            f"{', '.join(LOSSES)}, or a name of your own"
        )
    for name, value in law.variables.items():
        require_number(value, f"{what}.variables[{name!r}]")
    if law.components not in (1, 2, 3):
        raise ModelError(f"{what}.components = {law.components!r} must be 1, 2 or 3")
    motion, state = law.as_argument([np.zeros(1)] * law.components), initial_state(law)
    calls = {"energy": (motion, state), "limit": (state,)}
    calls |= dict.fromkeys(CALLED[2:], (motion, motion, state, 1.0))
    for name, arguments in calls.items():
        with calling(f"{what}.{name} fails at no motion"):
            result = getattr(law, name)(*arguments)
        if name == "increments":
            require_names(result, law, f"{what}.{name}")
        if name == "resistance" and law.components > 1:
            if not isinstance(result, tuple | list) or len(result) != law.components:
                raise ModelError(
                    f"{what}.resistance returns {shorten(result)}; it must return a tuple of "
                    f"{law.components} forces{source_location(law)}"
                )
            values = [("", force) for force in result]
        else:
            values = list(result.items()) if name == "increments" else [("", result)]
        for variable, value in values:
            number = isinstance(value, Real) or np.shape(value) == (1,)
            if not number or not np.all(np.isfinite(value)):
                raise ModelError(
                    f"{what}.{name} returns {f'{variable} = ' * bool(variable)}{shorten(value)} "
                    f"at no motion; it must return a number there{source_location(law)}"
                )
            if name in ("limit", "sliding") and np.any(np.asarray(value) < 0):
                raise ModelError(
                    f"{what}.{name} returns {shorten(value)} at no motion; it must return the size "
                    f"of a force without a sign{source_location(law)}"
                )


CALLED = ("energy", "limit", "resistance", "sliding", "increments")
"""Methods that a user's connector law may define."""


def require_limit(law: ConnectorLaw, what: str) -> None:
    """Raise :class:`ModelError` unless the increments of a law are finite for ``dt = inf``."""
    motion, rest = (law.as_argument([np.full(1, x)] * law.components) for x in (0.5, 0.0))
    with np.errstate(all="ignore"):
        changes = law.increments(motion, rest, initial_state(law), np.inf) if law.variables else {}
    for name, change in changes.items():
        if not np.all(np.isfinite(change)):
            raise ModelError(
                f"{what}: {type(law).__name__}.increments returns {name} = {shorten(change)} for "
                "dt = inf, and steps of a path are infinitely slow; state the increment so that "
                "it has a limit, as a / (b / dt + c), or use simulate(scene, Static(), ...)"
                f"{source_location(law)}"
            )


def source_location(law: object) -> str:
    """Return " (file, line n)" of the class of a law, or an empty text if it is unknown."""
    try:
        file, (_, line) = inspect.getsourcefile(type(law)), inspect.getsourcelines(type(law))
    except (OSError, TypeError):
        return ""
    return f" ({file}, line {line})"


def loss_must_grow(law: ConnectorLaw) -> bool:
    """Return whether the loss of a law must not decrease in a run, for steps of any length.

    With internal variables the loss has an integration error, unless the energy is quadratic.  An
    active law may supply energy.
    """
    return not law.active and (not law.variables or quadratic(law, law.components, law.energy))


# -- functions of users ------------------------------------------------------------------------


@closed("give it a function of your own")
@dataclass(frozen=True, repr=False)
class ForceLaw(Record):
    """Force of a connector as a function of motion, rate, time and internal variables.

    Args:
        force: ``force(motion, rate)``; N or N m; a positive force resists growth of the motion.
            Dynamic energy-momentum schemes evaluate the function in the middle of a step,
            :class:`EnergyMomentumStatic` at the fraction ``theta`` of a step, other schemes at the
            end.  Optional parameters are ``t``, the time of evaluation (s), ``dt``, the length of
            the step (s), and ``state``, the internal variables before the step.  A function with
            ``state`` returns the force and the variables after the step.
        state: Initial values of the internal variables.
        stored: ``stored(motion)`` or ``stored(motion, state)``, the recoverable energy; J.  The
            entry "stored" of the ledger includes this energy.  All other work on the law is in the
            entry "functions".

    Raises:
        ModelError: A function has an unknown parameter, or only one of ``state`` and the parameter
            ``state`` of ``force`` is given.

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

    force: Annotated[Callable[..., Any], partial(require_function, arguments="(motion, rate)")]
    state: Annotated[Sequence[float], require_row] = ()
    stored: Annotated[
        Callable[..., float] | None,
        partial(require_function, arguments="the motion, or (motion, state)"),
    ] = None

    def __post_init__(self) -> None:
        super().__post_init__()
        object.__setattr__(self, "state", tuple(map(float, self.state)))
        if self.state and "state" not in self.arguments:
            raise ModelError(
                "ForceLaw: the function has no parameter for the state; give it a parameter state, "
                "and return the force and the state after the step"
            )
        _ = self.arguments, self.stored_arguments  # raises for unknown names

    @property
    def arguments(self) -> tuple[str, ...]:
        """Names of the parameters of ``force`` after motion and rate."""
        return self._names(self.force, "force", "t", "dt", after=2)

    @property
    def stored_arguments(self) -> tuple[str, ...]:
        """Names of the parameters of ``stored`` after the motion."""
        return self._names(self.stored, "stored", after=1) if self.stored else ()

    def _names(
        self, function: Callable[..., Any], what: str, *known: str, after: int
    ) -> tuple[str, ...]:
        more = "" if self.state else f"{', ' * bool(known)}with ForceLaw(..., state=[...]) state"
        known = (*known, "state") if self.state else known
        return parameters_by_name(function, known, f"ForceLaw: {what}", after, more) or ()
