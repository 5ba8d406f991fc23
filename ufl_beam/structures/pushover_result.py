# SPDX-License-Identifier: MIT
"""Results of a pushover: capacity curve, sequence of hinges, and target displacements."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np
import scipy  # its subpackages are loaded when they are used

from ufl_beam.arrays import Array
from ufl_beam.display import Rich, bracketed, in_one_line
from ufl_beam.errors import ArgumentError, require_number, shorten, warn
from ufl_beam.model.bodies import Place
from ufl_beam.model.connectors import Connector
from ufl_beam.output.states import States
from ufl_beam.structures.spectra import Spectrum, spectral_accelerations

SAME = 1e-9  # relative change of the target that ends its iterations
MOST_ITERATIONS = 100  # for the target that bounds the two lines of ASCE 41
STRAIGHT = 1e-3  # excess of energy below which a curve is elastic and perfectly plastic, or elastic
SITES = {"A": 130.0, "B": 130.0, "C": 90.0, "D": 60.0, "E": 60.0, "F": 60.0}
"""Factors a of ASCE/SEI 41-17, equation 7-29, by site class."""


@in_one_line
class HingeFormation(NamedTuple):
    """Event of a pushover: a hinge or cell yields, opens or becomes free.

    Attributes:
        n: Index of the state at the end of the step in which the event occurred.
        displacement: Displacement of the control place in this state; m.
        base_shear: Base shear in this state; N.  Shorter steps are nearer to the event.
        where: Place of the hinge, middle of the cell, or connector.
        what: "yields", "opens", "is free" or another event of :class:`Event`.

    Example:
        >>> mass = ub.PointMass(weak.end, 5e3)
        >>> pile = ub.Scene([weak], supports=[ub.Clamped(weak.start)], masses=[mass])
        >>> print(st.pushover(pile, weak.end, -0.05, component="v").hinges[0])
         -0.0053 m    -24.80 kN  beam.start (0, 0) opens
    """

    n: int
    displacement: float
    base_shear: float
    where: Place | Connector
    what: str

    def __str__(self) -> str:
        return (
            f"{self.displacement:8.4f} m {self.base_shear / 1e3:9.2f} kN  {self.where} {self.what}"
        )


class TargetDisplacement(NamedTuple):
    """Displacement of the control place that a spectrum demands, with its derivation.

    Attributes:
        method: "N2" or "ASCE 41".
        displacement: Magnitude of the target displacement of the control place; m.
        n: Index of the first state of the path with this displacement, or of its last state.
        yield_displacement: Displacement of the control place at the yield point of the idealised
            curve; m.
        yield_shear: Base shear there; N.
        period: Effective period: T* of N2, T_e of ASCE 41; s.
        acceleration: Spectral acceleration at this period; m/s².
        strength_ratio: Elastic force divided by the yield force: q_u of N2, μ_strength of ASCE 41.
        factors: Further factors by name: "Gamma" of N2, "C0", "C1", "C2", "Cm" of ASCE 41.

    Example:
        >>> mass = ub.PointMass(weak.end, 5e3)
        >>> pile = ub.Scene([weak], supports=[ub.Clamped(weak.start)], masses=[mass])
        >>> capacity = st.pushover(pile, weak.end, -0.05, component="v")
        >>> demand = capacity.asce41(([0.01, 0.5, 4.0], [8.0, 8.0, 1.0]), site="C")
        >>> print(f"{1e3 * demand.displacement:.2f} mm, ductility {demand.ductility:.2f}")
        9.35 mm, ductility 1.96
    """

    method: str
    displacement: float
    n: int
    yield_displacement: float
    yield_shear: float
    period: float
    acceleration: float
    strength_ratio: float
    factors: dict[str, float]

    @property
    def ductility(self) -> float:
        """Target displacement divided by the yield displacement."""
        return self.displacement / self.yield_displacement

    def __repr__(self) -> str:
        return bracketed(self)

    def __str__(self) -> str:
        factors = ", ".join(f"{name} = {value:.3f}" for name, value in self.factors.items())
        return (
            f"{self.method}: target displacement {self.displacement:.4g} m, ductility "
            f"{self.ductility:.2f}, period {self.period:.3g} s, strength ratio "
            f"{self.strength_ratio:.2f}, {factors}"
        )


@dataclass(frozen=True, eq=False, repr=False)
class Pushover(Rich):
    """Capacity curve of a structure under growing loads; made by :func:`pushover`.

    Attributes:
        path: Equilibrium path, a :class:`Path`; its load factor is the base shear (N).
        place: Control place.
        component: Controlled component, "u", "v" or "w".
        target: Displacement asked for; m.
        displacement: Displacement of the control place since the loads of the scene; (n+1,); m.
        base_shear: Sum of the pushing forces in the direction of the component; (n+1,); N.
        hinges: Events in the order of the path.
        stiffness: Base shear over displacement of the first, elastic step; N/m.
        mass: Mass of the scene without point masses at supports; kg.
        equivalent_mass: m* = Σ m φ, with the shape φ of the pattern, 1 at the control place; kg.
        gamma: Participation factor Σ m φ / Σ m φ²; NaN without mass.
        period: Period of the elastic mode with the largest effective mass; NaN without mass; s.
        failure: Reason why the path ended before the target; empty if it reached the target.

    Example:
        >>> mass = ub.PointMass(weak.end, 5e3)
        >>> pile = ub.Scene([weak], supports=[ub.Clamped(weak.start)], masses=[mass])
        >>> capacity = st.pushover(pile, weak.end, -0.05, component="v")
        >>> print(f"{1e-3 * abs(capacity.base_shear).max():.1f} kN")
        25.2 kN
        >>> demand = capacity.n2(lambda T: 8.0 * min(1.0, 0.5 / T), corner=0.5)
        >>> print(f"{1e3 * demand.displacement:.2f} mm")
        12.59 mm
        >>> figure = ub.plot(capacity, targets=demand)
    """

    path: States
    place: Place
    component: str
    target: float
    displacement: Array
    base_shear: Array
    hinges: tuple[HingeFormation, ...]
    stiffness: float
    mass: float
    equivalent_mass: float
    gamma: float
    period: float
    failure: str = ""

    def __str__(self) -> str:
        first = (
            f"pushover of {self.component} at {self.place} to {self.displacement[-1]:.4g} m, "
            f"largest base shear {np.abs(self.base_shear).max() / 1e3:.4g} kN"
        )
        return "\n".join([first, *map(str, self.hinges), *filter(None, [self.failure])])

    def __repr__(self) -> str:
        return f"<Pushover: {str(self).splitlines()[0]}>"

    def _curve(self, upto: float | None, what: str) -> tuple[Array, Array]:
        """Return the curve up to ``upto``, by default the largest base shear, as positive numbers.

        Raises:
            ArgumentError: The scene has no mass, or ``upto`` is outside of the curve.
        """
        if not self.mass > 0:
            raise ArgumentError(
                f"{what}: the scene has no mass, so that it has no period; give sections rho or "
                "rhoA, or PointMass"
            )
        sign = math.copysign(1.0, self.target)
        d, V = sign * self.displacement, sign * self.base_shear
        end = float(d[np.argmax(V)])
        if upto is not None:
            end = require_number(upto, f"{what}: upto", positive=True)
            if end > d[-1]:
                raise ArgumentError(
                    f"{what}: upto = {end:g} m is beyond the end of the curve at {d[-1]:.4g} m; "
                    "push farther"
                )
        inside = d < end
        return np.append(d[inside], end), np.append(V[inside], np.interp(end, d, V))

    def _target(self, method: str, displacement: float, *rest: Any) -> TargetDisplacement:
        reached = np.abs(self.displacement) >= displacement
        if not reached.any():
            warn(
                f"{method}: the target displacement {displacement:.4g} m is beyond the end of the "
                f"capacity curve at {abs(self.displacement[-1]):.4g} m; "
                + (f"the structure ends there: {self.failure}" if self.failure else "push farther")
            )
        n = int(np.argmax(reached)) if reached.any() else len(self.displacement) - 1
        return TargetDisplacement(method, displacement, n, *rest)

    def n2(
        self, spectrum: Spectrum, corner: float, *, upto: float | None = None
    ) -> TargetDisplacement:
        """Compute the target displacement by the N2 method.

        The equivalent oscillator has the mass m* = Σ m φ and the force and displacement of the
        curve divided by Γ.  The curve is idealised as elastic and perfectly plastic, with equal
        energy up to the plastic mechanism.  Fajfar, Earthquake Spectra 16(3), 2000; EN 1998-1:2004,
        annex B.

        Args:
            spectrum: Elastic spectral acceleration (m/s²) as a function of the period (s), or
                (periods, accelerations).
            corner: Period T_C between constant acceleration and constant velocity; s.
            upto: Displacement of the control place at which the mechanism forms; by default the one
                of the largest base shear; m.  With the computed target it may be called again.

        Raises:
            ArgumentError: The spectrum does not cover the period, the scene has no mass, or
                ``upto`` is so far beyond the largest base shear that no such curve exists.

        Warns:
            ModelWarning: The target displacement is beyond the end of the curve.
        """
        corner = require_number(corner, "n2: corner", positive=True)
        d, V = self._curve(upto, "n2")
        energy = float(scipy.integrate.trapezoid(V, d))
        strength = float(V[-1])
        yields = 2.0 * (float(d[-1]) - energy / strength)
        if yields * self.stiffness < 0.99 * strength:
            peak = abs(float(self.displacement[np.abs(self.base_shear).argmax()]))
            raise ArgumentError(
                f"n2: up to {d[-1]:g} m the base shear has fallen so far that a curve of equal "
                f"energy would be stiffer than the structure; give upto at most {peak:.4g} m, "
                "where the base shear is largest"
            )
        period = 2.0 * math.pi * math.sqrt(self.equivalent_mass * yields / strength)
        acceleration = float(spectral_accelerations(spectrum, np.array([period]), "n2")[0])
        elastic = acceleration * (period / (2.0 * math.pi)) ** 2
        ratio = acceleration * self.equivalent_mass * self.gamma / strength
        demand = elastic
        if period < corner and ratio > 1.0:
            demand = elastic / ratio * (1.0 + (ratio - 1.0) * corner / period)
            demand = min(demand, 3.0 * elastic)
        return self._target(
            "N2", self.gamma * demand, yields, strength, period, acceleration, ratio,
            {"Gamma": self.gamma},
        )  # fmt: skip

    def asce41(self, spectrum: Spectrum, *, site: str = "D") -> TargetDisplacement:
        """Compute the target displacement by the coefficient method, C0 C1 C2 S_a T_e²/(4 π²).

        C0 is Γ.  The curve is idealised by two lines with equal energy up to the target or the
        largest base shear, the first through 60 % of the yield force.  C1 and C2 are equations 7-29
        and 7-30 of ASCE/SEI 41-17, the target is equation 7-28.  C_m is the fraction of the
        effective mass, or 1 for periods above 1 s.  The pattern should be "mode".  The largest
        strength ratio for dynamic stability (equation 7-32) is not checked.

        Args:
            spectrum: Elastic spectral acceleration (m/s²) as a function of the period (s), or
                (periods, accelerations).
            site: Site class, "A" to "F".

        Raises:
            ArgumentError: The spectrum does not cover the period, or the scene has no mass.

        Warns:
            ModelWarning: The target displacement is beyond the end of the curve.
        """
        if not isinstance(site, str) or site not in SITES:
            raise ArgumentError(f"asce41: site = {shorten(site)} must be one of {', '.join(SITES)}")
        d, V = self._curve(None, "asce41")
        end = float(d[-1])
        fraction = 1.0 if self.period > 1.0 else self.gamma * self.equivalent_mass / self.mass
        for _ in range(MOST_ITERATIONS):
            strength, stiffness = bilinear(d, V, end)
            period = self.period * math.sqrt(self.stiffness / stiffness)
            acceleration = float(spectral_accelerations(spectrum, np.array([period]), "asce41")[0])
            ratio = acceleration * self.mass * fraction / strength
            more = max(ratio - 1.0, 0.0)
            c1 = 1.0 if period > 1.0 else 1.0 + more / (SITES[site] * max(period, 0.2) ** 2)
            c2 = 1.0 if period > 0.7 else 1.0 + (more / period) ** 2 / 800.0
            demand = self.gamma * c1 * c2 * acceleration * (period / (2.0 * math.pi)) ** 2
            end, before = min(demand, float(d[-1])), end
            if abs(end - before) <= SAME * end:
                break
        factors = {"C0": self.gamma, "C1": c1, "C2": c2, "Cm": fraction}
        return self._target(
            "ASCE 41", demand, strength / stiffness, strength, period, acceleration, ratio, factors
        )


def bilinear(d: Array, V: Array, end: float) -> tuple[float, float]:
    """Return yield force and stiffness of two lines with the energy of a curve up to ``end``.

    The first line crosses the curve at 60 % of the yield force; ASCE/SEI 41-17, 7.4.3.2.4.
    """
    last, inside = float(np.interp(end, d, V)), d < end
    d, V = np.append(d[inside], end), np.append(V[inside], last)
    energy = float(scipy.integrate.trapezoid(V, d))
    rising = np.maximum.accumulate(V)

    def stiffness(strength: float) -> float:
        return 0.6 * strength / float(np.interp(0.6 * strength, rising, d))

    def more(strength: float) -> float:
        """Return the energy of the lines minus the energy of the curve, per energy."""
        yields = strength / stiffness(strength)
        return ((strength * end + last * (end - yields)) / 2.0) / energy - 1.0

    if more(last) <= STRAIGHT:
        return last, stiffness(last)
    strength = float(scipy.optimize.brentq(more, 1e-6 * last, last, xtol=1e-12 * last))
    return strength, stiffness(strength)
