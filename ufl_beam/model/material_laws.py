# SPDX-License-Identifier: MIT
"""Laws of a material point in one dimension: yielding, hardening, viscous flow.

A point is a resultant of a cross-section (strain 1 or curvature 1/m against N or N m) or a fibre
(strain against Pa).  The laws are plain functions of arrays, and of UFL expressions as well: UFL
derives their tangents and FFCx compiles them for the time loop, see
:mod:`ufl_beam.terms.material_points`.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, ClassVar

import numpy as np

from ufl_beam.errors import (
    SceneError,
    closed,
    require_from_zero_to_infinity,
    require_kind,
    require_number,
)
from ufl_beam.model.law_functions import Values, below, positive, sign, where
from ufl_beam.model.material_law import MaterialLaw, State

OWN_LAW = "state a MaterialLaw of your own"
"""Message of classes that are closed."""


# -- bulk --------------------------------------------------------------------------------------


@closed(OWN_LAW)
@dataclass(frozen=True)
class Perzyna:
    """Perzyna viscoplasticity: overstress in proportion to the plastic strain rate, P(39).

    Args:
        eta: Overstress per rate; Pa s for fibres, N s and N m² s for resultants.  Zero is
            rate-independent, infinity elastic.

    Example:
        >>> law = ub.Hardening(250e6, modulus=2e9, viscosity=ub.Perzyna(eta=1e6))  # Pa, Pa s
        >>> viscous = ub.Fibres(law, number=10)
    """

    eta: float

    def __post_init__(self) -> None:
        require_from_zero_to_infinity(self.eta, "Perzyna: eta")

    def coefficient(self, stiffness: Values) -> Values:
        """Overstress per rate of plastic strain, the same for any stiffness."""
        return np.full_like(stiffness, self.eta)


@closed(OWN_LAW)
@dataclass(frozen=True)
class DuvautLions:
    """Duvaut-Lions viscoplasticity: relaxation towards the rate-independent stress, P(45).

    The same law as :class:`Perzyna` with ``eta = tau (C + H)``, given by its relaxation time.

    Args:
        tau: Relaxation time; s.  Zero is rate-independent, infinity elastic.

    Example:
        >>> law = ub.Hardening(250e6, modulus=2e9, viscosity=ub.DuvautLions(tau=1e-3))  # Pa, s
        >>> viscous = ub.Fibres(law, number=10)
    """

    tau: float

    def __post_init__(self) -> None:
        require_from_zero_to_infinity(self.tau, "DuvautLions: tau")

    def coefficient(self, stiffness: Values) -> Values:
        """Overstress per rate of plastic strain: tau times the stiffness of plastic flow."""
        return np.asarray(self.tau * stiffness)  # P(46)


@dataclass(frozen=True)
class Hardening(MaterialLaw):
    """Elasto-(visco)plastic law with linear isotropic and kinematic hardening, P(35)-P(48).

    Args:
        limit: Yield stress, or yield force or moment of a resultant; Pa, N or N m.  For fibres
            also a distribution such as :class:`Normal`.
        modulus: Isotropic hardening; stress per plastic strain.
        kinematic: Kinematic hardening (Prager); stress per plastic strain.
        viscosity: :class:`Perzyna` or :class:`DuvautLions`; rate-independent by default.

    Raises:
        SceneError: A number is negative or none; infinity is allowed for the limit.

    Example:
        >>> law = ub.Hardening(3e5, modulus=1e6)  # N m, N m²
        >>> yielding = ub.Section(EA=4e9, GA=1e9, EI=1.4e7, rhoA=157.0, bending=law)
    """

    limit: Any
    modulus: float = 0.0
    kinematic: float = 0.0
    viscosity: Any = Perzyna(0.0)

    def __post_init__(self) -> None:
        if not hasattr(self.limit, "draw"):
            require_from_zero_to_infinity(self.limit, "Hardening: limit")
        for name in ("modulus", "kinematic"):
            value = getattr(self, name)
            require_number(value, f"Hardening: {name}")
            if value < 0.0:
                raise SceneError(
                    f"Hardening: {name} = {value:g} must not be negative: a softening bulk has no "
                    "size, and results would depend on the mesh; use Softening(limit, energy)"
                )
        require_kind(self.viscosity, (Perzyna, DuvautLions), "Hardening: viscosity")

    variables: ClassVar[Mapping[str, float]] = {"plastic": 0.0, "accumulated": 0.0}

    def numbers(self, C: Values) -> dict[str, Any]:
        """Limit and moduli; in the place of the viscosity, the overstress per plastic rate."""
        eta = self.viscosity.coefficient(C + self.modulus + self.kinematic)
        return super().numbers(C) | {"viscosity": eta}

    def stress(self, strain: Values, state: State) -> Values:
        """Stress of the elastic part of the strain."""
        return self.C * (strain - state.plastic)

    def increments(self, strain: Values, state: State, dt: Values) -> dict[str, Values]:
        """Plastic strain of a step, and the size of it, in closed form, P(38)-P(44)."""
        trial = self.stress(strain, state) - self.kinematic * state.plastic
        direction = sign(trial)
        overstress = direction * trial - (self.limit + self.modulus * state.accumulated)  # P(38)
        stiffness = self.viscosity / dt + (self.C + self.modulus + self.kinematic)
        γ = positive(overstress) / stiffness  # P(44)
        return {"plastic": direction * γ, "accumulated": γ}

    def elastic_energy(self, strain: Values, state: State) -> Values:
        """Energy per volume of the elastic part of the strain."""
        return self.C * (strain - state.plastic) ** 2 / 2

    def hardening_energy(self, state: State) -> Values:
        """Energy per volume that hardening stores."""
        return (
            self.kinematic * state.plastic**2 + self.modulus * state.accumulated**2
        ) / 2  # P(35)

    def dissipation(self, strain: Values, state: State, changes: State, dt: Values) -> Values:
        """Energy per volume that a plastic increment dissipates, by yield stress and viscosity."""
        γ = changes.accumulated
        flows = below(-γ, 0.0)  # a limit that is infinite must not meet an increment of zero
        return (
            where(flows, self.limit, 0.0) + where(flows, self.viscosity, 0.0) * γ / dt
        ) * γ  # P(37)

    @property
    def elastic(self) -> bool:
        """True if it never flows."""
        return bool(self.limit == np.inf)

    @property
    def opens(self) -> bool:
        """True if it ever flows."""
        return not self.elastic

    @property
    def energy(self) -> float:
        """Fracture energy: infinite, as it never breaks."""
        return np.inf

    @property
    def steepest(self) -> tuple[float, float]:
        """Largest fall of the stress, and where: none, as it never softens."""
        return 0.0, 0.0

    @property
    def bounded(self) -> bool:
        """True if the stress never exceeds the limit."""
        viscous = bool(np.any(self.viscosity.coefficient(np.ones(1)) > 0.0))
        return self.modulus == self.kinematic == 0.0 and not viscous
