# SPDX-License-Identifier: MIT
"""Eccentric loads on parts without deformation and mass; test_swing.py has links."""

import math

import numpy as np
import pytest
from scenes import clamped

import ufl_beam as ub

SECTION = ub.Section(EA=1e6, GA=1e6, EI=100.0, rhoA=1.0, rhoI=1e-3)


def outrigger(load, how):
    """A cantilever of 1 m with a rigid arm of 0.5 m upwards, which is pushed at its tip."""
    beam = ub.Beam((0, 0), (1, 0), SECTION, cells=4)
    if how == "link":
        plate = ub.Body((1.0, 0.5), mass=1.0, inertia=1.0, name="plate")
        joint, at = ub.RigidLink(beam.end, plate.middle), plate.middle
    else:
        plate = ub.Body((1.3, 0.2), mass=1.0, inertia=1.0, name="plate")
        joint, at = ub.Rigid(beam.end, plate.at(1, 0)), plate.at(1.0, 0.5)
    loads = [ub.PointLoad(at, force=load, amplitude=ub.ramp(1.0))]
    scene = clamped(beam, joints=[joint], bodies=[plate], loads=loads)
    return ub.simulate(scene, ub.Static(), t=(0, 1), dt=0.1), beam


@pytest.mark.parametrize("how", ["link", "off-centre"])
def test_moment_is_force_times_offset(how):
    """[closed] The moment of a small force in the beam; 1e-3 N change the lever by 5e-6."""
    for load in ((1e-3, 0.0), (0.0, 1e-3), (1e-3, 2e-3)):
        solution, beam = outrigger(load, how)
        N, V, M = solution.section_forces(beam)[-1]
        assert pytest.approx(load[0], abs=1e-5 * 2e-3) == N
        assert pytest.approx(load[1], abs=1e-5 * 2e-3) == V
        # In the middle of the last cell, 1/8 m from the end
        assert pytest.approx(load[1] / 8 - 0.5 * load[0], abs=1e-5 * 2e-3) == M
        reaction = solution.reaction(solution.scene.supports[0])[-1]
        by_hand = -load[0], -load[1], 0.5 * load[0] - load[1]
        np.testing.assert_allclose(reaction, by_hand, rtol=0, atol=1e-5 * 2e-3)


@pytest.mark.parametrize("how", ["link", "off-centre"])
def test_large_rotation_by_an_eccentric_load(how):
    """[closed] The reaction is minus the load, and its moment that of the tip."""
    solution, beam = outrigger((-150.0, -40.0), how)
    tip = solution.displacement(beam.end)[-1]
    assert abs(tip[2]) > 0.5  # it bends a lot
    x, y = solution.position(beam.end)[-1]
    lever = np.array([x - 0.5 * math.sin(tip[2]), y + 0.5 * math.cos(tip[2])])
    moment = lever[0] * -40.0 - lever[1] * -150.0
    reaction = solution.reaction(solution.scene.supports[0])[-1]
    np.testing.assert_allclose(reaction, [150.0, 40.0, -moment], rtol=1e-8)
