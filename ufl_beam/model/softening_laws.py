# SPDX-License-Identifier: MIT
"""Softening laws of hinges, cracks and springs: traction as a function of the opening."""

from __future__ import annotations

import copy
from abc import ABC, abstractmethod
from collections.abc import Mapping
from dataclasses import dataclass, fields
from functools import lru_cache
from typing import Any, ClassVar, NamedTuple

import numpy as np

from ufl_beam.arrays import Array
from ufl_beam.errors import ModelError, calling, closed, shorten
from ufl_beam.model.checks import require_kind
from ufl_beam.model.law_functions import Values, below, exp, positive, where
from ufl_beam.model.material_law import WRITTEN, require_field, require_fields
from ufl_beam.model.records import FromZero, Positive, Record
from ufl_beam.quadrature import gauss_rule

OWN_LAW = "state a SofteningLaw of your own"
"""Advice in the error that a subclass of a closed class raises."""

QUADRATURE_POINTS = 6
"""Number of Gauss points in the integral of a traction over a step; Lobatto's rule has one more.

For an exponential traction the relative error of the mean is below 1e-12 in a step that opens by
2 energy/limit, which dissipates 86 % of the energy.  For 0.5 energy/limit the error is 5e-20.
"""

SMALL_GROWTH = 1e-4
"""Growth, as a multiple of energy/limit, above which the mean traction is the difference of
energies divided by the growth.

At this growth the difference loses four digits.  For a smaller growth quadrature is exact to
round-off, or to 1e-10 of the energy if the step contains a kink.
"""

MOST_INTERVALS = 10_000
"""Number of intervals above which adaptive quadrature stops, as for a law with noise."""

DECADES = 20  # laws are sampled at openings from 10**-DECADES to 10**DECADES; m or rad


class SofteningLaw(ABC):
    """Base of the softening laws of hinges, cracks and springs.

    A user's law is a frozen dataclass, whose fields are its parameters.  Its methods are called
    with arrays and with UFL expressions; therefore they use ``ub.extend.law_functions``.
    The traction must be positive at zero opening and vanish at large openings.  It may rise before
    it falls.  Tractions are in N m, N or Pa, openings in rad or m.  See docs/extending_laws.md.

    Attributes:
        limit: Traction at zero opening; a field of the law, or computed from :meth:`traction`.
        fracture_energy: Integral of the traction over all openings, J or J/m²; a field of the law,
            or computed by quadrature.

    Example:
        >>> from dataclasses import dataclass
        >>> @dataclass(frozen=True)
        ... class PowerLaw(ub.extend.SofteningLaw):
        ...     limit: float  # N m
        ...     width: float  # rad
        ...     n: float
        ...     def traction(self, opening):
        ...         return self.limit * (1 + opening / self.width) ** -self.n
        >>> law = PowerLaw(limit=5e4, width=0.02, n=3.0)
        >>> print(f"{law.fracture_energy:.6g}")  # limit width / (n - 1); J
        500
        >>> breaks = ub.Section(EA=4e9, GA=1e9, EI=1.4e7, rhoA=157.0, hinge=law)
    """

    limit: Values
    fracture_energy: Values

    @abstractmethod
    def traction(self, opening: Values) -> Values:
        """Return the traction at an accumulated opening; N m, N or Pa."""

    def energy_to(self, opening: Values) -> Values | None:
        """Return the integral of the traction from zero to an opening; None means quadrature."""
        return None

    def mean_traction(self, opening: Values, growth: Values) -> Values:
        """Return the mean traction over a growth of the opening; mean times growth is dissipated.

        The mean is a difference of :meth:`energy_to` divided by the growth.  If a law has no
        ``energy_to``, or if the growth is small, the mean is computed by Gauss-Legendre quadrature.
        """
        rule = [(float(x), float(w)) for x, w in zip(*gauss_rule(QUADRATURE_POINTS), strict=True)]
        mean = sum(w * self.traction(opening + x * growth) for x, w in rule)
        before, after = self.energy_to(opening), self.energy_to(opening + growth)
        if before is None or after is None:
            return mean
        large = below(SMALL_GROWTH * self.fracture_energy, growth * self.limit)
        return where(large, (after - before) / where(large, growth, 1.0), mean)

    def __getattr__(self, name: str) -> Any:
        if name in ("limit", "fracture_energy"):
            return getattr(traction_properties(self), name)
        raise AttributeError(f"{type(self).__name__} has no attribute {name!r}")

    @property
    def opens(self) -> bool:
        """True if the limit is finite."""
        return bool(self.limit < np.inf)

    @property
    def bounded(self) -> bool:
        """True if the traction never exceeds the limit."""
        return bool(traction_properties(self).largest <= self.limit)

    @property
    def steepest(self) -> tuple[float, float]:
        """Steepest decrease of the traction per opening, and an opening with this decrease."""
        return traction_properties(self).steepest

    def parameters(self) -> dict[str, Any]:
        """Return the parameters of the law by name: fields, limit and fracture energy."""
        own = {field.name: getattr(self, field.name) for field in fields(self)}  # type: ignore[arg-type]
        return {"limit": self.limit, "fracture_energy": self.fracture_energy} | own

    def with_parameters(self, parameters: Mapping[str, Values]) -> SofteningLaw:
        """Return the law with other parameters: numbers, arrays or symbols."""
        law = copy.copy(self)
        vars(law).update(parameters)
        return law

    def kind(self) -> SofteningLaw:
        """Return the law with all parameters equal to 1."""
        return self.with_parameters(dict.fromkeys(self.parameters(), 1.0))


# -- laws of the package -------------------------------------------------------------------------

LARGEST_DECAY = 70.0
"""Exponent of the decay above which a traction is set to zero.

The traction is then below 1e-30 of the limit, far below round-off.  Still smaller tractions would
cause underflow.
"""


@dataclass(frozen=True)
class _LimitAndEnergy(Record, SofteningLaw):
    """Base of laws with the parameters limit and energy, whose tractions never exceed the limit.

    Tractions decrease by at most limit²/energy per opening; a steeper law must define ``steepest``.
    """

    limit: FromZero
    fracture_energy: Positive
    bounded: ClassVar[bool] = True

    @property
    def steepest(self) -> tuple[float, float]:
        """Upper bound of the decrease per opening, and zero, where exponential softening has it."""
        return self.limit * (self.limit / self.fracture_energy), 0.0


@closed(OWN_LAW)
class Softening(_LimitAndEnergy):
    """Exponential softening of a hinge, crack or spring to zero traction, P(51)-P(53).

    Args:
        limit: Traction at which opening begins: moment of a hinge (N m), stress of a fibre (Pa),
            force or moment of a spring.  Zero is a frictionless joint; infinity prevents opening.
        fracture_energy: Energy that a complete opening dissipates: J; for fibres J/m².

    Raises:
        ModelError: The limit is negative, or the energy is not positive.

    Example:
        >>> law = ub.Softening(limit=5e4, fracture_energy=1e3)  # N m, J
        >>> print(law.traction(np.array([0.0, 0.02, 0.04])).round())  # after jumps in rad; N m
        [50000. 18394.  6767.]
    """

    def traction(self, ξ: Values) -> Values:
        """Return the traction at the accumulated opening ξ."""
        decay = self.limit / self.fracture_energy * ξ
        return where(below(decay, LARGEST_DECAY), self.limit * exp(-decay), 0.0)  # P(52)!

    def mean_traction(self, ξ: Values, a: Values) -> Values:
        """Return the mean traction from ξ to ξ + a; mean times a is dissipated."""
        x = self.limit / self.fracture_energy * a
        small = below(x, 0.1)  # where the series of (1 - exp(-x))/x is exact
        series = 1.0
        for k in range(12, 1, -1):
            series = 1 - x / k * series
        safe = where(small, 1.0, x)
        return self.traction(ξ) * where(small, series, (1 - exp(-safe)) / safe)


@closed(OWN_LAW)
class LinearSoftening(_LimitAndEnergy):
    """Linear softening to zero traction at the opening 2 fracture_energy / limit.

    It has the arguments and errors of :class:`Softening`.

    Example:
        >>> law = ub.LinearSoftening(limit=5e4, fracture_energy=1e3)  # N m, J
        >>> print(law.traction(np.array([0.0, 0.02, 0.04])))  # after jumps in rad; N m
        [50000. 25000.     0.]
    """

    def traction(self, ξ: Values) -> Values:
        """Return the traction at the accumulated opening ξ."""
        return positive(self.limit - self.limit**2 / (2 * self.fracture_energy) * ξ)

    def mean_traction(self, ξ: Values, a: Values) -> Values:
        """Return the mean traction from ξ to ξ + a; mean times a is dissipated."""
        now, slope = self.traction(ξ), self.limit**2 / (2 * self.fracture_energy)
        ends = below(now - slope * a, 0.0)
        safe = where(ends, slope * a, 1.0)
        return where(ends, now**2 / (2 * safe), now - slope * a / 2)


def require_softening(law: object, what: str) -> None:
    """Raise :class:`ModelError` unless ``law`` is a valid softening law."""
    require_kind(law, (Softening, LinearSoftening, SofteningLaw), what)
    if isinstance(law, _LimitAndEnergy):
        return
    kind = f"{what}: {type(law).__name__}"
    require_fields(law, SofteningLaw, kind, but=("limit", "fracture_energy"))
    for field in fields(law):  # type: ignore[arg-type]
        value = getattr(law, field.name)
        if hasattr(value, "draw"):
            raise ModelError(
                f"{kind}: {field.name} = {shorten(value)} is a distribution, but the parameters of "
                "softening are the same in all cells; give a number"
            )
        require_field(value, f"{kind}: {field.name}")
    try:
        traction_properties(law)
    except ModelError as error:
        raise ModelError(f"{what}: {error}") from error.__cause__


# -- properties computed from the traction -------------------------------------------------------


class TractionProperties(NamedTuple):
    """Properties of the traction of a law as a function of the opening."""

    limit: float
    fracture_energy: float
    largest: float  # largest traction
    steepest: tuple[float, float]  # steepest decrease per opening, and an opening where it occurs


@lru_cache(maxsize=256)
def traction_properties(law: SofteningLaw) -> TractionProperties:
    """Sample the traction of a law at all openings; raise :class:`ModelError` if it is invalid."""
    kind = type(law).__name__
    edges = np.append(0.0, np.logspace(-DECADES, DECADES, 16 * DECADES + 1))
    t = _called(law, "traction", edges)
    limit = float(t[0])
    if limit <= 0:
        raise ModelError(
            f"{kind}: its traction at zero opening, which is the limit, is {limit:g}; it must be "
            "positive. For a hinge that never resists give Softening(0.0, 1.0)"
        )
    _require_not_negative(kind, edges, t)
    energy = _integral(law, edges)
    if t[-1] > 0:  # add the energy of larger openings by the power law of the last two decades
        power = np.log(t[-17] / t[-1]) / np.log(edges[-1] / edges[-17])
        if power <= 1.01:
            raise ModelError(
                f"{kind}: its traction is still {t[-1]:.6g} at the opening {edges[-1]:g}, so that "
                "its energy is not finite; let it fall to zero, or faster than 1/opening. For a "
                "hinge that never breaks give ElastoPlastic(limit)"
            )
        energy += float(t[-1] * edges[-1] / (power - 1))
    unit = energy / limit
    some = np.append(0.0, unit * np.logspace(-6, 6, 4001))
    tractions = _called(law, "traction", some)
    _require_not_negative(kind, some, tractions)
    tiny = 1e-200
    with np.errstate(all="ignore"):
        slope = _called(law, "traction", np.array([1j * tiny])).imag[0] / tiny
    if not abs(slope) * unit < 1e9 * limit:
        raise ModelError(
            f"{kind}: its traction has an infinite slope at zero opening, for which there is no "
            "tangent; let it begin with a finite slope"
        )
    _require_integral(law, unit, energy)
    falls = -np.diff(tractions) / np.diff(some)
    worst = {int(np.argmax(falls)), int(np.argmax(np.abs(np.diff(tractions))))}
    steepest = max(_slope(law, some[i], some[i + 1], limit, unit) for i in worst)
    return TractionProperties(limit, energy, float(tractions.max()), steepest)


def _require_not_negative(kind: str, jumps: Array, t: Array) -> None:
    """Raise :class:`ModelError` if a traction is negative."""
    if (negative := t < 0).any():
        raise ModelError(
            f"{kind}: its traction is {t[negative][0]:.6g} at the opening "
            f"{jumps[negative][0]:.6g}, where it would drive the opening; let the traction end "
            "at zero, for example by ub.extend.law_functions.positive"
        )


def _called(law: SofteningLaw, method: str, jumps: Array) -> Array:
    """Evaluate a method of a law at openings; raise :class:`ModelError` if results are invalid."""
    what = f"{type(law).__name__}.{method}"
    remedy = ". It is called with arrays of openings, real or complex"
    with calling(f"{what} fails", remedy + WRITTEN):
        values = getattr(law, method)(jumps) + 0 * jumps
    if np.shape(values) != jumps.shape:
        raise ModelError(
            f"{what} returns an array of shape {np.shape(values)} for {len(jumps)} openings; it "
            "must return one number for each opening"
        )
    if (bad := ~np.isfinite(values)).any():
        raise ModelError(
            f"{what} is {values[bad][0]} at the opening {jumps[bad][0]:.6g}; it must be a "
            "finite number at all openings"
        )
    return np.asarray(values)


def _integral(law: SofteningLaw, edges: Array) -> float:
    """Integrate a traction by adaptive Lobatto quadrature, if possible to round-off.

    Lobatto's rule detects kinks near the ends of an interval, because it has points at both ends.
    """
    polynomial = np.polynomial.Legendre.basis(QUADRATURE_POINTS)
    x = np.array([-1.0, *polynomial.deriv().roots(), 1.0])
    w = 2 / (QUADRATURE_POINTS * (QUADRATURE_POINTS + 1) * polynomial(x) ** 2)

    def lobatto(a: Array, b: Array) -> Array:
        at = a[:, None] + (b - a)[:, None] * (1 + x) / 2
        return _called(law, "traction", at.ravel()).reshape(at.shape) @ w * (b - a) / 2

    a, b, total = edges[:-1], edges[1:], 0.0
    for _ in range(60):
        whole, middle = lobatto(a, b), (a + b) / 2
        halves = lobatto(a, middle) + lobatto(middle, b)
        exact = np.abs(whole - halves) <= 1e-15 * (total + np.abs(halves).sum())
        total += float(halves[exact].sum())
        a, b, middle = a[~exact], b[~exact], middle[~exact]
        if not len(a) or len(a) > MOST_INTERVALS:
            break
        a, b = np.append(a, middle), np.append(middle, b)
    return total + float(lobatto(a, b).sum())


def _require_integral(law: SofteningLaw, unit: float, energy: float) -> None:
    """Raise :class:`ModelError` unless ``energy_to``, limit and energy agree with the traction."""
    kind = type(law).__name__
    if law.energy_to(np.zeros(1)) is not None:
        for opening in (0.0, *(unit * np.array([0.1, 0.5, 1.0, 2.0, 5.0]))):
            (defined,) = _called(law, "energy_to", np.array([opening]))
            computed = _integral(law, np.linspace(0.0, opening, 17)) if opening else 0.0
            if abs(defined - computed) > 1e-6 * energy:
                raise ModelError(
                    f"{kind}: energy_to is {defined:.6g} at the opening {opening:.6g}, but the "
                    f"integral of the traction is {computed:.6g}; correct or omit it"
                )
    (first,) = _called(law, "traction", np.zeros(1))
    for name, computed in (("limit", first), ("fracture_energy", energy)):
        if name in vars(law) or hasattr(type(law), name):
            defined = getattr(law, name)
            if not abs(defined - computed) <= 1e-6 * computed:
                what = "traction at zero opening" if name == "limit" else "integral of the traction"
                raise ModelError(
                    f"{kind}: {name} = {defined:.6g}, but the {what} is {computed:.6g}; make both "
                    "agree, or give the number another name"
                )


def _slope(law: SofteningLaw, a: float, b: float, limit: float, unit: float) -> tuple[float, float]:
    """Find the steepest decrease in an interval by bisection, and the opening where it begins."""

    def traction(opening: float) -> float:
        return float(_called(law, "traction", np.array([opening]))[0])

    at_a, at_b = traction(a), traction(b)
    while b - a > 1e-6 * unit or abs(at_b - at_a) > 1e-3 * limit:
        middle = (a + b) / 2
        if not a < middle < b:
            raise ModelError(
                f"{type(law).__name__}: its traction jumps from {at_a:.6g} to {at_b:.6g} at the "
                f"opening {a:.6g}, for which there is no tangent; make it continuous"
            )
        at_middle = traction(middle)
        if abs(at_middle - at_a) >= abs(at_b - at_middle):
            b, at_b = middle, at_middle
        else:
            a, at_a = middle, at_middle
    return (at_a - at_b) / (b - a), a
