# SPDX-License-Identifier: MIT
"""Laws of hysteresis: curved yielding, steel bars, and N and M that yield together."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from functools import partial
from typing import Annotated, ClassVar

from ufl_beam.model.checks import require_number
from ufl_beam.model.law_functions import (
    Values,
    absolute,
    below,
    exp,
    larger,
    log,
    positive,
    sign,
    smaller,
    sqrt,
    where,
)
from ufl_beam.model.material_law import MaterialLaw, State
from ufl_beam.model.material_laws import Exponent, Limit, PlasticLaw
from ufl_beam.model.records import NotNegative, Positive, Record


@dataclass(frozen=True)
class RambergOsgood(PlasticLaw):
    """Power law of Ramberg and Osgood: strain = stress/C + offset (stress/yield_limit)^exponent.

    The power law holds while the absolute stress exceeds all its previous values.  Otherwise the
    point is elastic, in tension and compression (isotropic hardening).  Initially there is no
    elastic range.  After Ramberg and Osgood, NACA TN 902 (1943).

    Args:
        yield_limit: Stress at which the plastic strain is ``offset``, or a distribution such as
            :class:`Normal`; Pa, N or N m.
        offset: Plastic strain or curvature at the stress ``yield_limit``, such as 0.002; 1 or 1/m.
        exponent: Exponent of the power law, at least 1.

    Raises:
        ModelError: A number is not positive, or the exponent is less than 1.

    Example:
        >>> law = st.RambergOsgood(yield_limit=250e6, offset=0.002, exponent=8)  # Pa, 1
        >>> curved = ub.Section.rectangle(b=0.1, h=0.2, E=70e9, nu=0.3, fibres=ub.Fibres(law))
    """

    yield_limit: Limit
    offset: Positive
    exponent: Exponent
    variables: ClassVar[Mapping[str, float]] = {"plastic": 0.0, "largest": 0.0}

    def residuals(self, strain: Values, old: State, new: State, dt: Values) -> Mapping[str, Values]:
        """Return the residuals of the plastic strain and of the largest value of the power law."""
        stress = self.stress(strain, new)
        largest = larger(
            old.largest, self.offset * (absolute(stress) / self.yield_limit) ** self.exponent
        )
        flow = sign(stress) * (new.largest - old.largest)
        return {"largest": new.largest - largest, "plastic": new.plastic - old.plastic - flow}


@dataclass(frozen=True)
class ArmstrongFrederick(PlasticLaw):
    """Plasticity with nonlinear kinematic hardening: loops that close, ratchet and saturate.

    The stress differs by at most ``yield_limit`` from a back stress X.  With the plastic strain p,
    dX = kinematic dp - recovery X abs(dp), so that X saturates at kinematic/recovery.  After
    Armstrong and Frederick, CEGB report RD/B/N731 (1966).

    Args:
        yield_limit: Yield stress, or a distribution such as :class:`Normal`; Pa, N or N m.
        kinematic: Initial hardening modulus; stress per plastic strain.
        recovery: Rate of dynamic recovery; 1 per plastic strain.  Without recovery use
            :class:`ElastoPlastic` with ``kinematic``.

    Raises:
        ModelError: A number is not positive.

    Example:
        >>> law = st.ArmstrongFrederick(  # Pa, Pa, 1
        ...     yield_limit=200e6, kinematic=40e9, recovery=300
        ... )
        >>> ratchets = ub.Section.rectangle(b=0.1, h=0.2, E=210e9, nu=0.3, fibres=ub.Fibres(law))
    """

    yield_limit: Limit
    kinematic: Positive
    recovery: Positive
    variables: ClassVar[Mapping[str, float]] = {"plastic": 0.0, "back": 0.0}

    def increments(self, strain: Values, state: State, dt: Values) -> Mapping[str, Values]:
        """Return the increments of plastic strain and back stress from a quadratic equation."""
        C, B, r = self.C, self.kinematic, self.recovery
        trial = self.stress(strain, state)
        direction = sign(trial - state.back)
        overstress = positive(direction * (trial - state.back) - self.yield_limit)
        b = C + B - r * (direction * trial - self.yield_limit)  # C r γ² + b γ = overstress
        root = sqrt(b**2 + 4 * C * r * overstress)
        divisor = where(below(b, 0.0), 1.0, b + root)  # if b > 0, root - b has cancellation
        γ = where(below(b, 0.0), (root - b) / (2 * C * r), 2 * overstress / divisor)
        γ = where(below(-overstress, 0.0), γ, 0.0)
        change = (direction * B - r * state.back) * γ / (1 + r * γ)
        return {"plastic": direction * γ, "back": change}

    def dissipation(self, strain: Values, state: State, changes: State, dt: Values) -> Values:
        """Return the plastic work that the back stress does not store; zero without flow."""
        worked = self.stress(strain, state) * changes.plastic
        return worked - state.back * changes.back / self.kinematic

    def hardening_energy(self, state: State) -> Values:
        """Return the density of the energy stored by the back stress."""
        return state.back**2 / (2 * self.kinematic)


@dataclass(frozen=True)
class BoucWen(Record, MaterialLaw):
    """Smooth hysteresis of Bouc and Wen, with the degradation of Baber and Wen.

    The stress at the strain x is C (a x + (1 - a) z) with a = ``hardening``.  The hysteretic strain
    z follows dz = dx (1 - ν abs(z/z0)^n (1 - β + β sign(z dx))) with z0 = yield_limit/C.  Strength
    degrades by ν = 1 + strength e, where e is the dissipated energy in units of
    (1 - a) yield_limit²/C.  After Wen, J. Eng. Mech. Div. ASCE 102 (1976), and Baber and Wen, ibid.
    107 (1981).  Their degradation of stiffness is omitted: in unloading it would return dissipated
    energy.

    Args:
        yield_limit: Stress at which the elastic tangent meets the plastic branch, or a distribution
            such as :class:`Normal`; Pa, N or N m.
        hardening: Slope of the plastic branch divided by C, from 0 to 0.999.
        exponent: Sharpness n of the transition, at least 1.
        shape: β from 1/2 (unloading along C) to 1.
        strength: Increase of ν per unit of e; zero, the default, means no degradation.

    Raises:
        ModelError: A parameter is out of range.

    Example:
        >>> law = st.BoucWen(yield_limit=5e4, hardening=0.05, exponent=2, strength=0.01)  # N m
        >>> base = ub.Turn(ub.ground(0, 0), beam.start, ub.Spring(1e7, law=law))
    """

    yield_limit: Limit
    hardening: Annotated[float, partial(require_number, at_least=0.0, at_most=0.999)] = 0.0
    exponent: Exponent = 1.0
    shape: Annotated[float, partial(require_number, at_least=0.5, at_most=1.0)] = 0.5
    strength: NotNegative = 0.0
    variables: ClassVar[Mapping[str, float]] = {"slip": 0.0, "strain": 0.0, "energy": 0.0}

    def stress(self, strain: Values, state: State) -> Values:
        """Return the stress; the variable ``slip`` is the strain minus z."""
        return self.C * (strain - (1 - self.hardening) * state.slip)

    def residuals(self, strain: Values, old: State, new: State, dt: Values) -> Mapping[str, Values]:
        """Return the residuals of the slip, of the last strain and of the dissipated energy e.

        The flow does not grow further where abs(z) is far too large.  This excludes a second
        solution.
        """
        z, z0, dx = strain - new.slip, self.yield_limit / self.C, strain - old.strain
        before = old.strain - old.slip
        size = smaller(absolute(z), 2 * larger(z0, absolute(before)))
        sliding = dx + before - sign(z) * size
        ν = 1 + self.strength * (old.energy + positive(sign(z) * size * sliding) / z0**2)
        factor = 1 - self.shape + self.shape * sign(z * dx)
        flow = dx * ν * (size / z0) ** self.exponent * factor
        increment = new.slip - old.slip
        return {
            "slip": increment - flow,
            "strain": new.strain - strain,
            "energy": new.energy - old.energy - z * increment / z0**2,
        }

    def elastic_energy(self, strain: Values, state: State) -> Values:
        """Return the energy density of two springs in parallel, with the strains x and z."""
        a = self.hardening
        return self.C * (a * strain**2 + (1 - a) * (strain - state.slip) ** 2) / 2


@dataclass(frozen=True)
class AxialBending(Record, MaterialLaw):
    """Yield surface of axial force and moment, (N/Np)² + abs(M)/Mp = 1, with associated flow.

    The surface is exact for a rectangle of ideally plastic material.  Its corners at M = 0 are
    rounded: with m = M/Mp and w = ``rounding``, (sqrt(m² + w²) - w)/(sqrt(1 + w²) - w) replaces
    abs(m).

    Args:
        axial: Np, the yield force; N.
        bending: Mp, the plastic moment; N m.
        rounding: Width w of the rounded corners; 1.

    Raises:
        ModelError: A number is not positive.

    Example:
        >>> law = st.AxialBending(axial=5e6, bending=2.5e5)  # N, N m
        >>> yields = ub.Section(EA=4.2e9, GA=1.3e9, EI=1.4e7, rhoA=157.0, interaction=law)
    """

    axial: Positive
    bending: Positive
    rounding: Positive = 0.01
    resultants: ClassVar[str] = "NM"
    variables: ClassVar[Mapping[str, float]] = {"stretch": 0.0, "curvature": 0.0, "flow": 0.0}

    def stress(self, strain: Values, state: State) -> Values:
        """Return the resultants (N, M)."""
        (Σ, K), (EA, EI) = strain, self.C
        return EA * (Σ - state.stretch), EI * (K - state.curvature)

    def elastic_energy(self, strain: Values, state: State) -> Values:
        """Return the elastic energy per length."""
        (Σ, K), (EA, EI) = strain, self.C
        return (EA * (Σ - state.stretch) ** 2 + EI * (K - state.curvature) ** 2) / 2

    def dissipation(self, strain: Values, state: State, changes: State, dt: Values) -> Values:
        """Return the work of (N, M) on the plastic strains; without flow it is exactly zero."""
        N, M = self.stress(strain, state)
        return N * changes.stretch + M * changes.curvature

    def excess(self, N: Values, M: Values) -> Values:
        """Return the yield function, which is positive outside the surface."""
        w, m = self.rounding, M / self.bending
        return (N / self.axial) ** 2 + (sqrt(m**2 + w**2) - w) / (sqrt(1 + w**2) - w) - 1

    def residuals(self, strain: Values, old: State, new: State, dt: Values) -> Mapping[str, Values]:
        """Return the residuals of both plastic strains, and of the yield condition.

        A negative flow could lead to a second solution, on the opposite side of the surface.
        A negative flow therefore changes no plastic strain but increases the last residual.
        """
        (N, M), (EA, EI) = self.stress(strain, new), self.C
        w, m, flow = self.rounding, M / self.bending, new.flow - old.flow
        by_m = m / sqrt(m**2 + w**2) / (sqrt(1 + w**2) - w)
        γ = where(below(flow, 0.0), 0.0, flow)
        correction = (flow - γ) * (EA / self.axial**2 + EI / self.bending**2)
        outside = below(-self.excess(*self.stress(strain, old)), 0.0)
        return {
            "stretch": new.stretch - old.stretch - γ * 2 * N / self.axial**2,
            "curvature": new.curvature - old.curvature - γ * by_m / self.bending,
            "flow": where(outside, self.excess(N, M) - correction, flow),
        }


STANDSTILL = 1e-8
"""Change of the strain that counts as a reversal, as a fraction of the yield strain.

Smaller changes are errors of the equilibrium.  If they were reversals, steps under a constant load
would restore the elastic stiffness of yielding fibres.
"""


@dataclass(frozen=True)
class MenegottoPinto(PlasticLaw):
    """Steel of Menegotto and Pinto, with the isotropic hardening of Filippou, Popov and Bertero.

    A branch begins at each reversal (εr, σr) with the stiffness C and approaches the hardening
    line of its direction.  With x = (ε - εr)/(ε0 - εr), where ε0 is the strain at which the elastic
    line through the reversal meets the hardening line, the stress is
    σr + C (ε0 - εr) (b x + (1 - b) x/(1 + x^R)^(1/R)).  The exponent is
    R = R0 (1 - cR1 ξ/(cR2 + ξ)), where ξ is the distance of ε0 from the largest strain in the
    direction of the branch, in yield strains.  The hardening line has the slope b C.  Its yield
    stress is multiplied by 1 + a1 ((εmax - εmin)/(2 a2 εy))^0.8 in compression, with a3 and a4
    in tension.  The entry "plastic" of the ledger is the work minus the elastic energy σ²/2C, by
    the mean stress of each step.  It falls between a reversal and the next zero of the stress,
    where yielding begins (Bauschinger effect).  After Menegotto and Pinto, IABSE Reports 13 (1973),
    and Filippou, Popov and Bertero, report UCB/EERC-83/19; the law is ``Steel02`` of OpenSees.

    Args:
        yield_limit: Stress at which the elastic line meets the hardening line, or a distribution
            such as :class:`Normal`; Pa, N or N m.
        hardening: Slope b of the hardening line, divided by C; from 0 to 0.999.
        R0: Exponent R of the first branch; 10 to 20.
        cR1: Largest relative decrease of R, less than 1.
        cR2: Value of ξ at which half of this decrease is reached.
        a1: Isotropic hardening in compression; zero, the default, means none.
        a2: Half of the range of strains in yield strains, at which the increase is a1.
        a3: Isotropic hardening in tension.
        a4: The same as a2, in tension.

    Raises:
        ModelError: A parameter is out of range.

    Example:
        >>> law = st.MenegottoPinto(yield_limit=500e6, hardening=0.01)  # Pa, 1
        >>> bars = ub.Section.of_fibres(
        ...     y=[-0.2, 0.2], A=[1e-3, 1e-3], E=200e9, nu=0.3, fibres=ub.Fibres(law)
        ... )
    """

    yield_limit: Limit
    hardening: Annotated[float, partial(require_number, at_least=0.0, at_most=0.999)]
    R0: Positive = 20.0
    cR1: Annotated[float, partial(require_number, at_least=0.0, at_most=0.999)] = 0.925
    cR2: Positive = 0.15
    a1: NotNegative = 0.0
    a2: Positive = 1.0
    a3: NotNegative = 0.0
    a4: Positive = 1.0
    active: ClassVar[bool] = True  # energy of the Bauschinger effect is not in the stored energy
    records_path: ClassVar[bool] = True
    # A branch has a start, a level σr/C, a span ε0 - εr and a sharpness R.  "turned" is the branch
    # that begins if the strain turns at "last".  Virgin steel has a span of zero.
    variables: ClassVar[Mapping[str, float]] = {
        "plastic": 0.0, "last": 0.0, "largest": 0.0, "least": 0.0, "start": 0.0, "level": 0.0,
        "span": 0.0, "sharpness": 0.0, "turned_span": 0.0, "turned_sharpness": 0.0,
    }  # fmt: skip

    def increments(self, strain: Values, state: State, dt: Values) -> dict[str, Values]:
        """Return the increments; strains that change by less than a limit leave the branch."""
        b, y = self.hardening, self.yield_limit / self.C
        change, none = strain - state.last, STANDSTILL * y
        virgin = below(absolute(state.span), 1e-4 * none)
        reverses = below(change * where(virgin, 0.0, sign(state.span)), -none)

        start = where(reverses, state.last, state.start)
        level = where(reverses, state.last - state.plastic, state.level)
        span = where(reverses, state.turned_span, where(virgin, sign(change) * y, state.span))
        R = where(reverses, state.turned_sharpness, where(virgin, self.R0, state.sharpness))
        x = (strain - start) / span
        size = log(larger(absolute(x), 1e-30))
        root = positive(size) + log(1 + exp(-R * absolute(size))) / R  # log(1 + abs(x)^R)/R
        elastic = level + (strain - start) * (b + (1 - b) * exp(-root))  # strain of the stress

        up = below(span, 0.0)  # the direction after a reversal
        largest, least = larger(state.largest, strain), smaller(state.least, strain)
        highest, lowest = larger(largest, y), smaller(least, -y)
        a, per = where(up, self.a3, self.a1), where(up, self.a4, self.a2)
        shift = 1 + a * ((highest - lowest) / (2 * per * y)) ** 0.8
        turned = where(up, y, -y) * shift + (b * strain - elastic) / (1 - b)
        ξ = absolute(where(up, highest, lowest) - strain - turned) / y
        moves = {
            "last": strain, "largest": largest, "least": least, "start": start,
            "level": level, "span": span, "sharpness": R, "turned_span": turned,
            "turned_sharpness": self.R0 * (1 - self.cR1 * ξ / (self.cR2 + ξ)),
        }  # fmt: skip
        stays = below(absolute(change), none)
        return {
            name: where(stays, 0.0, new - getattr(state, name)) for name, new in moves.items()
        } | {"plastic": strain - elastic - state.plastic}
