# SPDX-License-Identifier: MIT
"""Laws for tests: of materials, by residuals and in closed form; of softening; statements."""

from dataclasses import dataclass
from typing import ClassVar

import ufl

import ufl_beam as ub
import ufl_beam.structures as st

f = ub.extend.law_functions


class LinearAbout(ub.extend.MaterialLaw):
    """Linear in the difference of the strain from a variable."""

    about: ClassVar = "plastic"

    def stress(self, strain, state):
        return self.C * (strain - getattr(state, self.about))

    def elastic_energy(self, strain, state):
        return self.C * (strain - getattr(state, self.about)) ** 2 / 2


@dataclass(frozen=True)
class PowerLaw(LinearAbout):
    """Plastic strain k0 (|stress|/M0)^n under growing stresses; by residuals."""

    M0: float
    k0: float
    n: float
    variables: ClassVar = {"plastic": 0.0, "largest": 0.0}

    def residuals(self, strain, old, new, dt):
        M = self.stress(strain, new)
        largest = f.larger(old.largest, self.k0 * (f.absolute(M) / self.M0) ** self.n)
        flows = f.sign(M) * (new.largest - old.largest)
        return {"largest": new.largest - largest, "plastic": new.plastic - old.plastic - flows}


@dataclass(frozen=True)
class Dashpot(LinearAbout):
    """A spring and a dashpot in a row (Maxwell); in closed form."""

    eta: float
    variables: ClassVar = {"creep": 0.0}
    about: ClassVar = "creep"

    def increments(self, strain, state, dt):
        return {"creep": self.stress(strain, state) / (self.eta / dt + self.C)}


@dataclass(frozen=True)
class SameHardening(LinearAbout):
    """What `ElastoPlastic` is, stated by residuals."""

    limit: float
    H: float
    B: float
    eta: float
    variables: ClassVar = {"p": 0.0, "xi": 0.0}
    about: ClassVar = "p"

    def residuals(self, strain, old, new, dt):
        trial = self.stress(strain, old) - self.B * old.p
        over = f.sign(trial) * (self.stress(strain, new) - self.B * new.p)
        over = over - self.limit - self.H * new.xi
        flows = f.below(self.limit + self.H * old.xi - f.absolute(trial), 0.0)
        flow = over * dt - self.eta * (new.xi - old.xi)
        return {
            "p": new.p - old.p - f.sign(trial) * (new.xi - old.xi),
            "xi": f.where(flows, flow, new.xi - old.xi),
        }

    def hardening_energy(self, state):
        return (self.B * state.p**2 + self.H * state.xi**2) / 2


@dataclass(frozen=True)
class Stiffening(ub.extend.MaterialLaw):
    """Elastic, with a stress that grows with the cube of the strain; no variables."""

    cubic: float

    def stress(self, strain, state):
        return self.C * strain + self.cubic * strain**3

    def elastic_energy(self, strain, state):
        return self.C * strain**2 / 2 + self.cubic * strain**4 / 4


@dataclass(frozen=True)
class TwoRoots(st.AxialBending):
    """AxialBending by equations that hold on the far side of the surface, too."""

    def residuals(self, strain, old, new, dt):
        (N, M), γ = self.stress(strain, new), new.flow - old.flow
        w, m = self.rounding, M / self.bending
        by_m = m / f.sqrt(m**2 + w**2) / (f.sqrt(1 + w**2) - w)
        outside = f.below(-self.excess(*self.stress(strain, old)), 0.0)
        return {
            "stretch": new.stretch - old.stretch - γ * 2 * N / self.axial**2,
            "curvature": new.curvature - old.curvature - γ * by_m / self.bending,
            "flow": f.where(outside, self.excess(N, M), γ),
        }


@dataclass(frozen=True)
class GivesEnergy(LinearAbout):
    """Plastic strain against the stress, beyond a limit; no material does so."""

    limit: float
    variables: ClassVar = {"plastic": 0.0}

    def residuals(self, strain, old, new, dt):
        over = f.positive(f.absolute(self.C * (strain - old.plastic)) - self.limit)
        flow = f.sign(strain - old.plastic) * over / self.C / 4
        return {"plastic": new.plastic - old.plastic + flow}


@dataclass(frozen=True)
class Swelling(LinearAbout):
    """Elastic about a strain that grows in time; it gives energy where it is held in tension."""

    rate: float
    variables: ClassVar = {"free": 0.0}
    about: ClassVar = "free"
    active: ClassVar = True

    def residuals(self, strain, old, new, dt):
        return {"free": new.free - old.free + self.rate * dt}


@dataclass(frozen=True)
class Eigenstrain(ub.extend.MaterialLaw):
    """Elastic about a strain e0, as of temperature, shrinkage or prestress."""

    e0: float
    variables: ClassVar = {"none": 0.0}

    def stress(self, strain, state):
        return self.C * (strain - self.e0)

    def increments(self, strain, state, dt):
        return {"none": 0.0 * strain}

    def elastic_energy(self, strain, state):
        return self.C * (strain - self.e0) ** 2 / 2


@dataclass(frozen=True)
class YieldingEigenstrain(SameHardening):
    """Hardening by residuals about a strain of 0.01."""

    e0: float = 0.01

    def stress(self, strain, state):
        return super().stress(strain - self.e0, state)

    def elastic_energy(self, strain, state):
        return super().elastic_energy(strain - self.e0, state)


# -- softening -----------------------------------------------------------------------------------


@dataclass(frozen=True)
class Exponential(ub.extend.SofteningLaw):
    """The traction of `Softening`; its energy by quadrature."""

    limit: float
    energy: float

    def traction(self, opening):
        return self.limit * f.exp(-self.limit / self.energy * opening)


@dataclass(frozen=True)
class Petersson(ub.extend.SofteningLaw):
    """Concrete: down to a third at 0.8 G/t, to zero at 3.6 G/t; two straight lines and a sum."""

    t: float
    G: float

    def _lines(self):
        first, last = 0.8 * self.G / self.t, 3.6 * self.G / self.t
        slope = self.t / 3 / (last - first)
        return ((self.t - slope * last) / first, first), (slope, last)

    def traction(self, opening):
        return sum(slope * f.positive(end - opening) for slope, end in self._lines())

    def energy_to(self, opening):
        return sum(
            slope * (end**2 - f.positive(end - opening) ** 2) / 2 for slope, end in self._lines()
        )


@dataclass(frozen=True)
class Kinked(Petersson):
    """The same traction, its energy by quadrature."""

    def energy_to(self, opening):
        return None


@dataclass(frozen=True)
class Fading(ub.extend.SofteningLaw):
    """Down by a power, never to zero."""

    t: float
    width: float
    n: float

    def traction(self, opening):
        return self.t * (1 + opening / self.width) ** -self.n


@dataclass(frozen=True)
class Rising(ub.extend.SofteningLaw):
    """Up to a peak at width/4 first; its integral is 3/2 t width."""

    t: float
    width: float

    def traction(self, opening):
        x = opening / self.width
        return self.t * (1 + 4 * x) * f.exp(-2 * x)


@dataclass(frozen=True)
class HardeningSpring(ub.extend.Statement):
    """Spring along y between two places, k/2 e² + h/4 e⁴."""

    nodes = 2
    numbers = "k", "h"  # N/m, N/m³

    def equations(self, at):
        def energy(q, n):
            e = q[1][1] - q[0][1]
            return n["k"] / 2 * e**2 + n["h"] / 4 * e**4

        return at.potential("spring", energy)


@dataclass(frozen=True)
class AirDrag(ub.extend.Statement):
    """Drag in proportion to the square of the velocity."""

    numbers = ("c",)

    def equations(self, at):
        x, y, _ = at.v[0]
        size = ufl.sqrt(x**2 + y**2 + 1e-12)
        force = [[at["c"] * size * x, at["c"] * size * y, 0.0]]
        return ub.extend.Equations(force, lost={"drag": at.work(force)})


@dataclass(frozen=True)
class MaxwellElement(ub.extend.Statement):
    """Spring and dashpot in a row along y; the dashpot has grown by ``flow``."""

    nodes = 2
    numbers = "k", "time"
    state = ("flow",)

    def equations(self, at):
        θ, k = at.scheme.load_weight, at["k"]
        e0, e1 = (q[1][1] - q[0][1] for q in (at.q0, at.q1))
        rate = at["dt"] / at["time"]
        # (flow1 - flow) = rate (e - flow) with the means of both in the step
        e = (1.0 - θ) * e0 + θ * e1
        flow = at["flow"] + rate / (1.0 + θ * rate) * (e - at["flow"])
        mean = k * (e - (1.0 - θ) * at["flow"] - θ * flow)
        force = [[0.0, -mean, 0.0], [0.0, mean, 0.0]]
        stored = k / 2 * (e1 - flow) ** 2
        before = k / 2 * (e0 - at["flow"]) ** 2
        lost = at.work(force) - (stored - before)
        of_end = {"flow": flow}, {"stored": stored}, {"damping": lost}
        return ub.extend.Equations(force, *of_end, before={"stored": before})
