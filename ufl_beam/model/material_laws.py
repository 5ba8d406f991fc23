# SPDX-License-Identifier: MIT
"""Material laws: yielding, hardening, viscous flow, hysteresis, interaction of N and M.

A law acts on a resultant of a cross-section (N or N m; strain 1 or 1/m), on N and M together, on a
fibre (Pa; strain 1) or on a spring (N or N m; m or rad).  The laws are functions of arrays and of
UFL expressions.  UFL derives the tangents, and FFCx compiles the laws for the time loop, see
:mod:`ufl_beam.blocks.material_points`.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from functools import partial
from typing import Annotated, Any, ClassVar

import numpy as np

from ufl_beam.errors import ModelError, closed
from ufl_beam.model.checks import require_kind, require_number
from ufl_beam.model.law_functions import Values, below, positive, sign, where
from ufl_beam.model.material_law import MaterialLaw, State
from ufl_beam.model.records import FromZero, Record

OWN_LAW = "state a MaterialLaw of your own"
"""Advice in the error that a subclass of a closed class raises."""


@closed(OWN_LAW)
@dataclass(frozen=True)
class Perzyna(Record):
    """Perzyna viscoplasticity: overstress proportional to the plastic strain rate, P(39).

    Args:
        eta: Overstress per plastic strain rate; Pa s for fibres, N s and N m² s for resultants.
            Zero makes the law rate-independent, infinity makes the law elastic.

    Example:
        >>> law = ub.ElastoPlastic(250e6, isotropic=2e9, viscosity=ub.Perzyna(eta=1e6))  # Pa, Pa s
        >>> viscous = ub.Fibres(law, number=10)
    """

    eta: FromZero

    def coefficient(self, stiffness: Values) -> Values:
        """Return the overstress per rate of plastic strain, in the shape of ``stiffness``."""
        return np.full_like(stiffness, self.eta)


@closed(OWN_LAW)
@dataclass(frozen=True)
class DuvautLions(Record):
    """Duvaut-Lions viscoplasticity: relaxation towards the rate-independent stress, P(45).

    It equals :class:`Perzyna` with ``eta = tau (C + isotropic + kinematic)``.

    Args:
        tau: Relaxation time; s.  Zero makes the law rate-independent, infinity elastic.

    Example:
        >>> law = ub.ElastoPlastic(  # Pa, s
        ...     250e6, isotropic=2e9, viscosity=ub.DuvautLions(tau=1e-3)
        ... )
        >>> viscous = ub.Fibres(law, number=10)
    """

    tau: FromZero

    def coefficient(self, stiffness: Values) -> Values:
        """Return the overstress per rate of plastic strain; ``stiffness`` includes hardening."""
        return np.asarray(self.tau * stiffness)  # P(46)


def _require_limit(value: Any, what: str, **limits: Any) -> None:
    """Raise :class:`ModelError` unless a limit is a distribution, or a number in range."""
    if not hasattr(value, "draw"):
        require_number(value, what, **limits)


def _require_modulus(value: Any, what: str) -> None:
    if require_number(value, what) < 0.0:
        raise ModelError(
            f"{what} = {value:g} must not be negative: softening of the bulk has no length scale, "
            "and results would depend on the mesh; use Softening(limit, fracture_energy)"
        )


Limit = Annotated[Any, partial(_require_limit, positive=True)]
Modulus = Annotated[float, _require_modulus]
Exponent = Annotated[float, partial(require_number, at_least=1.0)]


class PlasticLaw(Record, MaterialLaw):
    """Base of laws with the stress ``C (strain - plastic strain)``."""

    def stress(self, strain: Values, state: State) -> Values:
        """Return the stress of the elastic strain."""
        return self.C * (strain - state.plastic)

    def elastic_energy(self, strain: Values, state: State) -> Values:
        """Return the density of the elastic energy."""
        return self.C * (strain - state.plastic) ** 2 / 2


@dataclass(frozen=True)
class ElastoPlastic(PlasticLaw):
    """Elasto-(visco)plastic law with linear isotropic and kinematic hardening, P(35)-P(48).

    Args:
        yield_limit: Yield stress, or yield force or moment of a resultant, or a distribution such
            as :class:`Normal`; Pa, N or N m.
        isotropic: Isotropic hardening; stress per plastic strain.
        kinematic: Kinematic hardening (Prager); stress per plastic strain.
        viscosity: :class:`Perzyna` or :class:`DuvautLions`; rate-independent by default.

    Raises:
        ModelError: A parameter is negative or not a number; only the limit may be infinite.

    Example:
        >>> law = ub.ElastoPlastic(3e5, isotropic=1e6)  # N m, N m²
        >>> yielding = ub.Section(EA=4e9, GA=1e9, EI=1.4e7, rhoA=157.0, bending=law)
    """

    yield_limit: Annotated[Any, partial(_require_limit, at_least=0.0, infinite=True)]
    isotropic: Modulus = 0.0
    kinematic: Modulus = 0.0
    viscosity: Annotated[Any, partial(require_kind, kind=(Perzyna, DuvautLions))] = Perzyna(0.0)
    variables: ClassVar[Mapping[str, float]] = {"plastic": 0.0, "accumulated": 0.0}
    fracture_energy: ClassVar[float] = math.inf  # as in a SofteningLaw that never breaks
    steepest: ClassVar[tuple[float, float]] = (0.0, 0.0)  # as in a SofteningLaw; no decrease

    def parameters(self, C: Values) -> dict[str, Any]:
        """Return the fields, with the viscosity as overstress per rate of plastic strain."""
        eta = self.viscosity.coefficient(C + self.isotropic + self.kinematic)
        return super().parameters(C) | {"viscosity": eta}

    def increments(self, strain: Values, state: State, dt: Values) -> dict[str, Values]:
        """Return the increments of plastic strain and accumulated plastic strain, P(38)-P(44)."""
        trial = self.stress(strain, state) - self.kinematic * state.plastic
        direction = sign(trial)
        overstress = direction * trial - (
            self.yield_limit + self.isotropic * state.accumulated
        )  # P(38)
        stiffness = self.viscosity / dt + (self.C + self.isotropic + self.kinematic)
        γ = positive(overstress) / stiffness  # P(44)
        return {"plastic": direction * γ, "accumulated": γ}

    def hardening_energy(self, state: State) -> Values:
        """Return the density of the energy that hardening stores."""
        return (
            self.kinematic * state.plastic**2 + self.isotropic * state.accumulated**2
        ) / 2  # P(35)

    def dissipation(self, strain: Values, state: State, changes: State, dt: Values) -> Values:
        """Return the density of the energy dissipated by yield stress and viscosity in a step."""
        γ = changes.accumulated
        flows = below(-γ, 0.0)  # avoids infinity times zero
        return (
            where(flows, self.yield_limit, 0.0) + where(flows, self.viscosity, 0.0) * γ / dt
        ) * γ  # P(37)

    @property
    def limit(self) -> Any:
        """Yield limit, by the name that all laws of hinges have."""
        return self.yield_limit

    @property
    def elastic(self) -> bool:
        """True if the yield limit is infinite."""
        return bool(self.yield_limit == np.inf)

    @property
    def opens(self) -> bool:
        """True if the yield limit is finite."""
        return not self.elastic

    @property
    def bounded(self) -> bool:
        """True if the stress never exceeds the limit."""
        viscous = bool(np.any(self.viscosity.coefficient(np.ones(1)) > 0.0))
        return self.isotropic == self.kinematic == 0.0 and not viscous
