# SPDX-License-Identifier: MIT
"""Relative motions: values, works of their forces, rigid motions; tangents of all laws."""

import math
from dataclasses import replace

import numpy as np
import pytest
from helpers import run
from test_tangent import Probe

import ufl_beam as ub
from ufl_beam.model.connector_laws import RIGID
from ufl_beam.model.connectors import Component

MOTIONS = ["turning", "stretching", "parting", "sliding"]


def pair(motion, law=RIGID):
    """Two bodies and a connector between points of them that are not their centres."""
    a = ub.Body((0.3, -0.2), mass=2.0, inertia=0.5, name="a")
    b = ub.Body((1.4, 0.6), mass=1.0, inertia=0.3, name="b")
    axis = (math.cos(0.4), math.sin(0.4))
    connector = Component("test", motion, a.at(0.5, 0.3), b.at(1.1, 0.9), law, axis)
    return ub.Scene(bodies=[a, b], connectors=[connector])


def rotation(angle):
    c, s = math.cos(angle), math.sin(angle)
    return np.array([[c, -s], [s, c]])


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


@pytest.mark.parametrize("speed", [1.0, 1e-9])
@pytest.mark.parametrize("scheme", [ub.EnergyMomentum(), ub.EnergyMomentum(0.1, 0.1)], ids=str)
@pytest.mark.parametrize("motion", MOTIONS)
def test_a_spring_does_work_on_its_motion_only(motion, scheme, speed):
    """In large steps and in small ones, where x/tan x is 0/0; momenta stay but for a fixed axis."""
    scene = pair(motion, ub.Spring(5.0))
    velocities = ((0.3, -0.2), 1.0), ((-0.1, 0.4), -2.0)
    initial = [
        ub.Velocity([body], linear=(speed * x, speed * y), angular=speed * ω)
        for body, ((x, y), ω) in zip(scene.bodies, velocities, strict=True)
    ]
    scene, (connector,) = replace(scene, initial=initial), scene.connectors
    solution = run(scene, scheme, t=(0, 2), dt=0.2, newton=ub.Newton(rtol=1e-13))
    q = np.stack([solution.displacement(body.middle) for body in scene.bodies], axis=1)
    expected = np.array([by_hand(connector, row) for row in q])
    assert np.ptp(expected) > 0.1 * speed
    # round-off of lengths near one
    np.testing.assert_allclose(solution.connector(connector).motion, expected, atol=1e-14)
    assert solution.energy.worst < 1e-10
    kept = slice(0, 2 if motion == "parting" or scheme.beta else 3)
    assert np.ptp(solution.momentum()[:, kept], axis=0).max() < 1e-11 * speed


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
    [
        *((MOTIONS[i % 4], law, LOSSES[i % 2]) for i, law in enumerate(LAWS)),
        *((motion, "function", LOSSES[0]) for motion in MOTIONS),
    ],
    ids=str,
)
def test_tangents_are_derivatives(motion, law, scheme):
    scene = pair(motion, LAWS[law])
    for seed in range(9):
        probe = Probe(scene, scheme, turn=0.8, seed=seed)
        # Rows belong to the latest residual; what neither sticks nor slips has no tangent.
        if np.array_equal(*(probe.residual(probe.x) for _ in range(2))):
            break
    tangent = probe.tangent()
    # As in test_tangent.py; the slope of a function is itself a difference, to 1e-9
    scale = np.abs(tangent).max()
    assert np.abs(tangent - probe.differences(1e-5)).max() < 1e-7 * scale
