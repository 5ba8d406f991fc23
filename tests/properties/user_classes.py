# SPDX-License-Identifier: MIT
"""Functions and classes of a user, as in docs/; the same objects in all scenes, compiled once."""

import sys
from dataclasses import dataclass
from pathlib import Path
from typing import ClassVar

import numpy as np
import ufl

import ufl_beam as ub

sys.path.append(str(Path(__file__).parents[1]))
from user_laws import *  # noqa: F403 - other laws have names of their own

f = ub.extend.law_functions


# -- works, N/m and J/m ------------------------------------------------------------------------


def drag(v, w, c):
    """Resistance in proportion to the velocity."""
    return -c * (v[0] * w[0] + v[1] * w[1])


def wind(v, w, t, c, speed):
    """Square of the velocity relative to air that moves along x."""
    x, y = v[0] - speed * t, v[1]
    return -c * ufl.sqrt(x**2 + y**2 + 1e-6) * (x * w[0] + y * w[1])


def current(q, w, axis, p):
    """Force across the deformed axis."""
    tangent = axis.t0 + axis.d(ufl.as_vector([q[0], q[1]]))
    return p * (tangent[0] * w[1] - tangent[1] * w[0])


def dead(w, x, y):
    """Dead force."""
    return x * w[0] + y * w[1]


def soil(q, k):
    """Winkler's soil below y."""
    return k * q[1] ** 2 / 2


def field(q, size):
    """Magnets in a field along y."""
    return -size * ufl.sin(q[2])


def warming(q, axis, M):
    """Curvature of a temperature that differs across the section; M = EI alpha dT/h."""
    return -M * axis.d(q[2])


LAWS, SOFTENING = ("Dashpot", "PowerLaw"), ("Petersson", "Rising")
"""Names of the material laws and of the softening laws."""

CONNECTOR_LAWS = "Stiffening", "Relaxing", "Cushion", "Brake"


# -- laws of connectors ------------------------------------------------------------------------


class Maxwell:
    """Spring in series with a damper: force and state after the step."""

    def __init__(self, k, time):
        self.k, self.time = k, time

    def __call__(self, motion, rate, dt, state):
        after = (state[0] + self.k * rate * dt) / (1 + dt / self.time)
        return (state[0] + after) / 2, [after]


class Cubic:
    """Nonlinear spring and its energy."""

    def __init__(self, k, cubic):
        self.k, self.cubic = k, cubic

    def __call__(self, motion, rate):
        return self.k * motion + self.cubic * motion**3

    def energy(self, motion):
        return self.k * motion**2 / 2 + self.cubic * motion**4 / 4


@dataclass(frozen=True)
class Stiffening(ub.extend.ConnectorLaw):
    """Spring of a quartic energy."""

    k: float
    cubic: float

    def energy(self, motion, state):
        return self.k * motion**2 / 2 + self.cubic * motion**4 / 4


@dataclass(frozen=True)
class Relaxing(ub.extend.ConnectorLaw):
    """Spring and damper in series, beside a quadratic damper."""

    k: float
    time: float
    drag: float
    variables: ClassVar = {"creep": 0.0}

    def energy(self, motion, state):
        return self.k * (motion - state.creep) ** 2 / 2

    def resistance(self, motion, rate, state, dt):
        return self.drag * f.absolute(rate) * rate

    def increments(self, motion, rate, state, dt):
        return {"creep": (motion - state.creep) / (self.time / dt + 1)}


@dataclass(frozen=True)
class Cushion(ub.extend.ConnectorLaw):
    """Two components that stiffen each other, with a damper."""

    k: float
    size: float
    c: float
    components: ClassVar = 2

    def energy(self, motion, state):
        x, y = motion
        return self.k * (x**2 + 2 * y**2) / 2 * (1 + (x**2 + y**2) / self.size**2)

    def resistance(self, motion, rate, state, dt):
        return self.c * rate[0], self.c * rate[1]


@dataclass(frozen=True)
class Brake(ub.extend.ConnectorLaw):
    """It breaks loose at a limit, which grows with the way of sliding, and slides below it."""

    rest: float
    moving: float
    way: float
    variables: ClassVar = {"slipped": 0.0}

    def limit(self, state):
        return self.rest * (1 + state.slipped / self.way)

    def sliding(self, motion, rate, state, dt):
        return self.moving * (1 + state.slipped / self.way)

    def increments(self, motion, rate, state, dt):
        return {"slipped": f.absolute(rate) * dt}


class Integral:
    """Controller that remembers the sum of the rotations of a place."""

    def __init__(self, place, gain):
        self.place, self.gain, self.sum = place, gain, 0.0

    def __call__(self, now):
        self.sum += now.displacement(self.place)[2]
        return -self.gain * self.sum

    def state(self):
        return self.sum

    def restore(self, state):
        self.sum = state


# -- scheme and recorder -----------------------------------------------------------------------


@dataclass(frozen=True)
class Weighted(ub.extend.EnergyMomentumBase, ub.extend.MidpointDynamics):
    """Midpoint rule with one weight for resultants and velocities, as in docs/extending.md."""

    weight: float = 0.55

    @property
    def alpha(self):
        return self.weight - 0.5

    def coefficients(self, dt, last_dt, known):  # of the step s, the velocity v0, the one before v0
        w = self.weight
        return ub.extend.Coefficients(
            inertia=(1 / (w * dt**2), -1 / (w * dt), 0.0),  # (v1 - v0) / dt
            velocity=(1 / dt, 0.0, 0.0),  # s / dt
            rates=((1 / (w * dt), -(1 - w) / w, 0.0),),  # v1 of s/dt = (1 - w) v0 + w v1
            velocity_defect=(self.alpha, 0.0, 0.0),  # s/dt - (v0 + v1)/2, s for v1 - v0
        )

    def error_weights(self):
        return self.alpha, 1 / 12 + self.alpha


class LargestCurvature(ub.extend.Recorder):
    """Largest size of the curvature in any cell, by DOLFINx."""

    def open(self, simulation):
        self.largest = 0.0

    def write(self, simulation):
        curvature = simulation.dolfinx.strains.x.array.reshape(-1, 3)[:, 2]
        here = np.abs(curvature).max(initial=0.0)
        self.largest = simulation.subdomain.largest(max(self.largest, here))

    def state(self):
        return {"largest": np.array([self.largest])}

    def resume(self, simulation, state):
        (self.largest,) = state["largest"].tolist()
