# SPDX-License-Identifier: MIT
"""Base of the laws of connectors that a user states: energy, resistance, internal variables."""

from __future__ import annotations

import copy
from abc import ABC
from collections.abc import Mapping, Sequence
from dataclasses import fields
from typing import Any, ClassVar

import numpy as np

from ufl_beam.model.material_law import State, Values

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
        components: Motions that the law acts on; 2 or 3 of a law for :func:`Bushing`, whose
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
        >>> caught = ub.Scene([beam], [], scene.supports, scene.loads, connectors=[buffer])
        >>> run = ub.simulate(caught, ub.Midpoint(), t=(0, 0.5), dt=0.005)
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

        Args:
            motion: At the time of the step at which the law holds; m or rad.
            rate: Mean rate of the step; m/s or rad/s.
            state: Internal variables at the time of the motion.
            dt: Length of the step; s.
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

    def initially(self) -> State:
        """Internal variables before anything has happened, each (1,)."""
        return State({name: np.full(1, float(x)) for name, x in self.variables.items()})

    def elastic_forces(self, motions: Sequence[Values], state: State) -> list[Values]:
        """Derivatives of the energy by the motions, arrays of real numbers; N or N m."""
        forces = []
        for i, motion in enumerate(motions):
            moved = [*motions[:i], motion + IMAGINARY * 1j, *motions[i + 1 :]]
            with np.errstate(all="ignore"):
                energy = self.energy(self.given(moved), state)
            forces.append(np.imag(energy) / IMAGINARY + 0 * motion)
        return forces
