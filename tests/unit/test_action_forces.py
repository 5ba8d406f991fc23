# SPDX-License-Identifier: MIT
"""Diagrams and envelopes under actions agree with reactions and joint forces at beam ends."""

import math

import numpy as np
import pytest
from helpers import in_turn, run

import ufl_beam as ub
import ufl_beam.structures as st

SECTION = ub.Section(EA=1e4, GA=1e4, EI=100.0, rhoA=3.0, rhoI=0.1)


def hinged(action):
    """Two beams with a pin between them and clamps at the other ends."""
    a = ub.Beam((0, 0), (1, 0), SECTION, cells=3, name="a")
    b = ub.Beam((1, 0), (2, 0), SECTION, cells=2, name="b")
    end, loads = ub.PrescribedDisplacement(b.end, u=0, v=0, psi=0), []
    if action == "pressure":
        loads = [ub.Pressure(a, 300.0, 50.0, lambda t: t, profile=(1, 2)), ub.Pressure(b, -200.0)]
    elif action == "moving":
        loads = [ub.MovingLoad([a, b], lambda t: 10 * t, (20, -100), mass=2.0)]
    elif action == "settlement":
        end = ub.PrescribedDisplacement(
            b.end, u=lambda t: t**2, v=lambda t: -5 * t**2, psi=lambda t: t**2, along=(2, 1)
        )
    else:
        loads = [ub.PointLoad(b.at(0.5), (-300.0, 0), amplitude=lambda t: math.sin(8 * t))]
    pin = ub.Revolute(a.end, b.start, multipliers=True)
    scene = ub.Scene([a, b], joints=[pin], supports=[ub.Clamped(a.start), end], loads=loads)
    return st.imperfect(scene, sway=0.01, bow={a: 0.05, b: -0.1}) if action == "bow" else scene


ACTIONS = "pressure", "moving", "settlement", "bow"
SCHEMES = (ub.Static(), 1), (ub.EnergyMomentum(), 2), (ub.GeneralizedAlpha(0.8), 1)


@pytest.mark.parametrize(("action", "scheme"), in_turn(ACTIONS, SCHEMES), ids=str)
def test_ends_of_diagrams_and_envelopes(action, scheme):
    scheme, degree = scheme
    scene, extremes = hinged(action), ub.Extremes(points=3)
    (a, b), (clamp, end), (pin,) = scene.beams, scene.supports, scene.joints
    found = run(
        scene, scheme, t=(0, 0.2), dt=0.02, mesh=ub.Mesh(degree=degree), record=extremes,
        newton=ub.Newton(rtol=1e-12),
    )  # fmt: skip
    of_a, of_b = (
        np.array([found.diagram(beam, n, points=3)[1:] for n in range(len(found))])
        for beam in (a, b)
    )
    ends = of_a[1:, :, 0], of_a[1:, :, -1], of_b[1:, :, 0], of_b[1:, :, -1]
    joint = found.joint(pin).force[1:]
    left, right = (found.reaction(support)[1:] for support in (clamp, end))
    size = np.abs([of_a[:, :, 0], of_b[:, :, -1]]).max()
    assert size > 10.0
    moments = -left[:, 2], np.zeros(len(left)), np.zeros(len(left)), right[:, 2]
    # Newton's method leaves 1e-12 of the forces
    for forces, outer, moment in zip(ends, (left, joint, joint, right), moments, strict=True):
        assert np.hypot(*forces[:, :2].T) == pytest.approx(np.hypot(*outer.T[:2]), abs=1e-10 * size)
        assert forces[:, 2] == pytest.approx(moment, abs=1e-10 * size)
    for beam, forces in ((a, of_a), (b, of_b)):
        recorded = extremes.section_forces(beam)
        for values, extreme in ((recorded.low, np.min), (recorded.high, np.max)):
            expected = extreme(forces, axis=0)
            assert pytest.approx(expected, abs=1e-12 * size) == values.reshape(-1, 3).T
