# SPDX-License-Identifier: MIT
"""Laws of material points with curved branches: power law, ratcheting, smooth hysteresis."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from functools import partial
from typing import Annotated, Any, ClassVar

from ufl_beam.errors import SceneError, require_number
from ufl_beam.model.law_functions import (
    Values,
    absolute,
    below,
    larger,
    positive,
    sign,
    smaller,
    sqrt,
    where,
)
from ufl_beam.model.material_law import MaterialLaw, State
from ufl_beam.model.records import NotNegative, Positive, Record


def _require_positive_or_random(value: Any, what: str) -> None:
    if not hasattr(value, "draw"):
        require_number(value, what, positive=True)


Limit = Annotated[Any, _require_positive_or_random]
"""A positive number, or a distribution."""

AtLeastOne = Annotated[float, partial(require_number, at_least=1.0)]


def _require_part(value: float, what: str) -> None:
    require_between(value, what, 0.0, 0.999)


def _require_shape(value: float, what: str) -> None:
    require_between(value, what, 0.5, 1.0)


def require_between(value: float, what: str, low: float, high: float) -> None:
    """Raise :class:`SceneError` unless a number lies between two others."""
    if require_number(value, what, at_least=low) > high:
        raise SceneError(f"{what} = {value:g} must lie between {low:g} and {high:g}")


class _Plastic(Record, MaterialLaw):
    """Base of laws whose stress is that of the strain less a plastic strain."""

    def stress(self, strain: Values, state: State) -> Values:
        """Stress of the elastic part of the strain."""
        return self.C * (strain - state.plastic)

    def elastic_energy(self, strain: Values, state: State) -> Values:
        """Energy per volume of the elastic part of the strain."""
        return self.C * (strain - state.plastic) ** 2 / 2


@dataclass(frozen=True)
class RambergOsgood(_Plastic):
    """Power law of Ramberg and Osgood: strain = stress/C + offset (stress/limit)^exponent.

    It holds while the stress grows beyond all stresses so far; below them the point is elastic, in
    both directions (isotropic hardening).  There is no yield limit.  After Ramberg and Osgood,
    NACA TN 902 (1943).

    Args:
        limit: Stress at which the plastic strain is ``offset``, or a distribution such as
            :class:`Normal`; Pa, N or N m.
        offset: Plastic strain or curvature at that stress, such as 0.002; 1 or 1/m.
        exponent: At least 1.

    Raises:
        SceneError: A number is not positive, or the exponent is less than 1.

    Example:
        >>> law = ub.RambergOsgood(limit=250e6, offset=0.002, exponent=8)  # Pa, 1
        >>> curved = ub.Section.rectangle(b=0.1, h=0.2, E=70e9, nu=0.3, fibres=ub.Fibres(law))
    """

    limit: Limit
    offset: Positive
    exponent: AtLeastOne
    variables: ClassVar[Mapping[str, float]] = {"plastic": 0.0, "largest": 0.0}

    def residuals(self, strain: Values, old: State, new: State, dt: Values) -> Mapping[str, Values]:
        """Accumulated plastic strain of the largest stress; plastic strain along the stress."""
        stress = self.stress(strain, new)
        largest = larger(
            old.largest, self.offset * (absolute(stress) / self.limit) ** self.exponent
        )
        flow = sign(stress) * (new.largest - old.largest)
        return {"largest": new.largest - largest, "plastic": new.plastic - old.plastic - flow}


@dataclass(frozen=True)
class ArmstrongFrederick(_Plastic):
    """Plasticity with nonlinear kinematic hardening: loops that close, ratchet and saturate.

    The stress lies within ``limit`` of a back stress X with dX = kinematic dp - recovery X abs(dp),
    which saturates at kinematic/recovery.  After Armstrong and Frederick, CEGB report RD/B/N731
    (1966).

    Args:
        limit: Yield stress, or a distribution such as :class:`Normal`; Pa, N or N m.
        kinematic: Initial hardening; stress per plastic strain.
        recovery: Rate at which hardening fades; per plastic strain.  Without it use
            :class:`Hardening` with ``kinematic``.

    Raises:
        SceneError: A number is not positive.

    Example:
        >>> law = ub.ArmstrongFrederick(limit=200e6, kinematic=40e9, recovery=300)  # Pa, Pa, 1
        >>> ratchets = ub.Section.rectangle(b=0.1, h=0.2, E=210e9, nu=0.3, fibres=ub.Fibres(law))
    """

    limit: Limit
    kinematic: Positive
    recovery: Positive
    variables: ClassVar[Mapping[str, float]] = {"plastic": 0.0, "back": 0.0}

    def increments(self, strain: Values, state: State, dt: Values) -> Mapping[str, Values]:
        """Plastic strain and back stress of a step: the positive root of a quadratic equation."""
        C, B, r = self.C, self.kinematic, self.recovery
        trial = self.stress(strain, state)
        direction = sign(trial - state.back)
        over = positive(direction * (trial - state.back) - self.limit)
        b = C + B - r * (direction * trial - self.limit)  # C r γ² + b γ = over
        root = sqrt(b**2 + 4 * C * r * over)
        above = where(below(b, 0.0), 1.0, b + root)  # no difference of numbers that are close
        γ = where(below(b, 0.0), (root - b) / (2 * C * r), 2 * over / above)
        γ = where(below(-over, 0.0), γ, 0.0)
        change = (direction * B - r * state.back) * γ / (1 + r * γ)
        return {"plastic": direction * γ, "back": change}

    def hardening_energy(self, state: State) -> Values:
        """Energy per volume that the back stress stores."""
        return state.back**2 / (2 * self.kinematic)


@dataclass(frozen=True)
class BoucWen(Record, MaterialLaw):
    """Smooth hysteresis of Bouc and Wen, with the degradation of Baber and Wen.

    The stress is C (hardening strain + (1 - hardening) z), where the hysteretic strain z follows
    dz = dx (1 - ν abs(z/z0)^n (1 - β + β sign(z dx))) with z0 = limit/C.  Strength degrades by
    ν = 1 + strength e with the dissipated energy e, in parts of limit²/C.  After Wen, J. Eng. Mech.
    Div. ASCE 102 (1976), and Baber and Wen, ibid. 107 (1981).  Their degradation of stiffness is
    left out: in unloading it would give back energy that was dissipated.

    Args:
        limit: Stress at which the tangents of both branches meet, hardening left out, or a
            distribution such as :class:`Normal`; Pa, N, N m.
        hardening: Slope of the plastic branch as a part of C, below 1.
        exponent: Sharpness n of the transition, at least 1.
        shape: β from 1/2, unloading along C, to 1.
        strength: Degradation per dissipated energy; zero by default.

    Raises:
        SceneError: A number is out of its range.

    Example:
        >>> law = ub.BoucWen(limit=5e4, hardening=0.05, exponent=2, strength=0.01)  # N m
        >>> base = ub.Turn(ub.ground(0, 0), beam.start, ub.Spring(1e7, law=law))
    """

    limit: Limit
    hardening: Annotated[float, _require_part] = 0.0
    exponent: AtLeastOne = 1.0
    shape: Annotated[float, _require_shape] = 0.5
    strength: NotNegative = 0.0
    variables: ClassVar[Mapping[str, float]] = {"slip": 0.0, "strain": 0.0, "energy": 0.0}

    def stress(self, strain: Values, state: State) -> Values:
        """Stress of both springs; that of the slip, strain less z, is missing."""
        return self.C * (strain - (1 - self.hardening) * state.slip)

    def residuals(self, strain: Values, old: State, new: State, dt: Values) -> Mapping[str, Values]:
        """Evolution of the hysteretic strain; strain and dissipated energy are remembered.

        Far beyond all solutions the flow grows no more with z, and so has one zero there, too.
        """
        z, z0, dx = strain - new.slip, self.limit / self.C, strain - old.strain
        before = old.strain - old.slip
        size = smaller(absolute(z), 2 * larger(z0, absolute(before)))
        slips = dx + before - sign(z) * size
        weaker = 1 + self.strength * (old.energy + positive(sign(z) * size * slips) / z0**2)
        bends = 1 - self.shape + self.shape * sign(z * dx)
        flow = dx * weaker * (size / z0) ** self.exponent * bends
        slip = new.slip - old.slip
        return {
            "slip": slip - flow,
            "strain": new.strain - strain,
            "energy": new.energy - old.energy - z * slip / z0**2,
        }

    def elastic_energy(self, strain: Values, state: State) -> Values:
        """Energy per volume of both springs."""
        a = self.hardening
        return self.C * (a * strain**2 + (1 - a) * (strain - state.slip) ** 2) / 2
