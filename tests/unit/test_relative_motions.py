# SPDX-License-Identifier: MIT
"""Relative motions: values, variations that are increments, rigid motions; tangents of all laws."""

import math

from mpi4py import MPI

import numpy as np
import pytest
from test_tangent import Probe

import ufl_beam as ub
from ufl_beam.model.connector_laws import RIGID
from ufl_beam.model.connectors import Component

SCHEMES = [
    ub.EnergyMomentum(),
    ub.EnergyMomentum(0.1, 0.1),
    ub.EnergyMomentumStatic(0.5),
    ub.Static(),
]
EXACT = SCHEMES[:3]
SEEDS = range(4)
MOTIONS = ["turning", "stretching", "parting", "sliding"]


def rotation(angle):
    c, s = math.cos(angle), math.sin(angle)
    return np.array([[c, -s], [s, c]])


def bodies():
    a = ub.Body((0.3, -0.2), mass=2.0, inertia=0.5, name="a")
    b = ub.Body((1.4, 0.6), mass=1.0, inertia=0.3, name="b")
    return a, b


def pair(motion, law=RIGID):
    """Two bodies and a connector between points of them that are not their centres."""
    a, b = bodies()
    axis = (math.cos(0.4), math.sin(0.4))
    connector = Component("test", motion, a.at(0.5, 0.3), b.at(1.1, 0.9), law, axis)
    return ub.Scene(bodies=[a, b], connectors=[connector]), connector


def by_hand(connector, q):
    """The relative motion, from the coordinates of both points."""
    points = []
    for point, motion in zip((connector.a, connector.b), q, strict=True):
        center = np.array(point.body.center)
        points.append(center + motion[:2] + rotation(motion[2]) @ (point.point - center))
    d, d0 = points[1] - points[0], np.subtract(connector.b.point, connector.a.point)
    axis = np.array(connector.axis)
    return {
        "turning": q[1][2] - q[0][2],
        "stretching": np.linalg.norm(d) - np.linalg.norm(d0),
        "parting": axis @ (d - d0),
        "sliding": rotation(q[0][2]) @ axis @ d - axis @ d0,
    }[connector.motion]


class Between:
    """A coupling of two bodies in a step between random configurations."""

    def __init__(self, motion, scheme, seed, turn=1.4):
        scene, self.connector = pair(motion)
        if not scheme.dynamic:
            # Springs, so that statics has an answer.
            ends, soft = [body.middle for body in scene.bodies], ub.Spring(1.0)
            springs = [
                Component("spring", "parting", *ends, soft, axis) for axis in ((1, 0), (0, 1))
            ]
            scene = ub.Scene(
                bodies=scene.bodies, supports=[ub.Clamped(ends[0])],
                connectors=[self.connector, ub.Turn(*ends, soft), *springs],
            )  # fmt: skip
        self.simulation = ub.Simulation(scene, scheme, comm=MPI.COMM_SELF)
        self.zero_matrix = next(
            c
            for c in self.simulation.connector_terms
            if self.connector in c.connectors and len(c.connectors) == 1
        )
        self.dofs = self.simulation.numbering.dofs_of_bodies
        random = np.random.default_rng(seed)
        size = self.simulation.subdomain.size
        self.q0, self.q1 = np.zeros((2, size))
        self.q0[self.dofs] = random.uniform(-1, 1, (2, 3))
        self.q1[self.dofs] = self.q0[self.dofs] + random.uniform(-turn, turn, (2, 3))
        self.scheme = scheme

    def step_of_nodes(self):
        s = self.q1 - self.q0
        turning = self.dofs[:, 2]
        s[turning] = 2 * np.tan(s[turning] / 2)
        return s

    def gradient(self):
        """Virtual work of a unit force: the residual is linear in it."""
        step = ub.extend.Step.create(self.scheme, 0.0, 0.1, 0.1, self.q0)
        self.simulation.equation.begin(step, [self.zero_matrix])
        r = np.zeros((2, len(self.q0)))
        for force, row in zip((0.0, 1.0), r, strict=True):
            q = self.q1.copy()
            q[self.simulation.subdomain.multipliers[self.zero_matrix.indices]] = force
            self.zero_matrix.add_residual(q, row)
        difference = r[1] - r[0]
        difference[self.simulation.subdomain.multipliers] = 0.0
        return difference


@pytest.mark.parametrize("seed", SEEDS)
@pytest.mark.parametrize("motion", MOTIONS)
def test_relative_motions_are_those_by_hand(motion, seed):
    some = Between(motion, ub.EnergyMomentum(), seed)
    expected = by_hand(some.connector, some.q1[some.dofs])
    (value,) = some.zero_matrix.motion(some.q1)
    assert value == pytest.approx(expected, abs=1e-14)  # round-off of lengths near one
    assert some.zero_matrix.motion(np.zeros_like(some.q1)) == pytest.approx(0.0, abs=1e-15)


@pytest.mark.parametrize("seed", SEEDS)
@pytest.mark.parametrize("scheme", EXACT, ids=str)
@pytest.mark.parametrize("motion", MOTIONS)
def test_variation_of_the_step_is_the_increment(motion, scheme, seed):
    """The force does work on nothing but the growth of the motion, at any size of the step."""
    some = Between(motion, scheme, seed)
    increment = by_hand(some.connector, some.q1[some.dofs]) - by_hand(
        some.connector, some.q0[some.dofs]
    )
    assert some.gradient() @ some.step_of_nodes() == pytest.approx(increment, abs=1e-13)


@pytest.mark.parametrize("motion", MOTIONS)
def test_variation_of_a_small_turn(motion):
    """Where angles hardly change no digit is lost: 0/0 of x/tan x."""
    some = Between(motion, ub.EnergyMomentum(), 3, turn=1e-9)
    increment = by_hand(some.connector, some.q1[some.dofs]) - by_hand(
        some.connector, some.q0[some.dofs]
    )
    assert some.gradient() @ some.step_of_nodes() == pytest.approx(increment, abs=2e-15)


@pytest.mark.parametrize("seed", SEEDS)
@pytest.mark.parametrize("motion", MOTIONS)
def test_static_variation_is_the_derivative(motion, seed):
    some = Between(motion, ub.Static(), seed)
    w = np.zeros_like(some.q1)
    w[some.dofs] = np.random.default_rng(99 + seed).uniform(-1, 1, (2, 3))
    ε = 1e-6
    ends = [by_hand(some.connector, (some.q1 + sign * ε * w)[some.dofs]) for sign in (1, -1)]
    derivative = (ends[0] - ends[1]) / (2 * ε)
    # ε² of third derivatives, 1e-12, and 1e-16/ε of values
    assert some.gradient() @ w == pytest.approx(derivative, abs=1e-9)


@pytest.mark.parametrize("seed", SEEDS)
@pytest.mark.parametrize("scheme", SCHEMES, ids=str)
@pytest.mark.parametrize("motion", ["turning", "stretching", "sliding"])
def test_rigid_motions_are_free(motion, scheme, seed):
    """No force on the whole, and no moment: momentum and angular momentum stay."""
    some = Between(motion, scheme, seed)
    force = some.gradient()[some.dofs]
    ends = [some.q0, some.q1] if scheme in EXACT else [some.q1, some.q1]
    centers = np.array([body.center for body in some.simulation.scene.bodies])
    middle = centers + (ends[0][some.dofs] + ends[1][some.dofs])[:, :2] / 2
    assert force[:, :2].sum(axis=0) == pytest.approx([0, 0], abs=1e-14)
    x, y = middle.T
    moment = force[:, 2].sum() + (x * force[:, 1] - y * force[:, 0]).sum()
    assert moment == pytest.approx(0.0, abs=1e-13)


LAWS = {
    "held": RIGID,
    "motor": ub.PrescribedMotion(lambda t: 0.2 * t),
    "actuator": ub.PrescribedForce(lambda t: 3.0),
    "controller": ub.Controller(lambda simulation: 2.0),
    "spring": ub.Spring(20.0),
    "yielding": ub.Spring(20.0, ub.ElastoPlastic(yield_limit=1.0, isotropic=3.0, kinematic=2.0)),
    "viscous": ub.Spring(20.0, ub.ElastoPlastic(yield_limit=1.0, viscosity=ub.Perzyna(2.0))),
    "breaking": ub.Spring(20.0, softening=ub.Softening(limit=1.0, fracture_energy=5.0)),
    "damper": ub.Damper(3.0),
    "stop": ub.Stop(30.0, low=-0.05, high=0.05),
    "damped stop": ub.Stop(30.0, low=-0.05, high=0.05, damping=0.4),
    "function": ub.ForceLaw(lambda e, rate: 5 * e + e**3 + 0.3 * rate),
    "friction": ub.Coulomb(0.7),
}


LOSSES = ub.EnergyMomentum(), ub.EnergyMomentum(0.2, 0.1)


@pytest.mark.parametrize(
    ("motion", "law", "scheme"),
    [(m, law, LOSSES[(i + j) % 2]) for i, m in enumerate(MOTIONS) for j, law in enumerate(LAWS)],
    ids=str,
)
def test_tangents_are_derivatives(motion, law, scheme):
    scene, _ = pair(motion, LAWS[law])
    for seed in range(9):
        probe = Probe(scene, scheme, turn=0.8, seed=seed)
        # Rows belong to the latest residual; what neither sticks nor slips has no tangent.
        if np.array_equal(*(probe.residual(probe.x) for _ in range(2))):
            break
    tangent = probe.tangent()
    # As in test_tangent.py; the slope of a function is itself a difference, to 1e-9
    scale = np.abs(tangent).max()
    assert np.abs(tangent - probe.differences(1e-5)).max() < 1e-7 * scale
