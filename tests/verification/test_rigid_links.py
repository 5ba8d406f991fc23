# SPDX-License-Identifier: MIT
"""Parts without deformation and mass: eccentric loads, stiff beams; test_swing.py has links."""

import math

import numpy as np
import pytest
from scenes import clamped

import ufl_beam as ub

# -- eccentric loads ---------------------------------------------------------------------------

SECTION = ub.Section(EA=1e6, GA=1e6, EI=100.0, rhoA=1.0, rhoI=1e-3)


def outrigger(scheme, *, load, how, cells=4, arm=0.5):
    """A cantilever of 1 m with a rigid arm upwards at its end that is pushed at its tip."""
    beam = ub.Beam((0, 0), (1, 0), SECTION, cells=cells)
    plate = ub.Body((1.0, arm), mass=1.0, inertia=1.0, name="plate")
    if how == "link":
        joint, at = ub.RigidLink(beam.end, plate.middle), plate.middle
    elif how == "off-centre":
        plate = ub.Body((1.3, 0.2), mass=1.0, inertia=1.0, name="plate")
        joint, at = ub.Rigid(beam.end, plate.at(1, 0)), plate.at(1.0, arm)
    else:
        at = beam.end
    bodies = [] if how == "statically" else [plate]
    joints = [joint] if bodies else []
    x, y = load
    moment = -arm * x if how == "statically" else 0.0
    loads = [ub.PointLoad(at, force=(x, y), moment=moment, amplitude=ub.ramp(1.0))]
    scene = clamped(beam, joints=joints, bodies=bodies, loads=loads)
    solution = ub.simulate(scene, scheme, t=(0, 1), dt=0.1)
    return solution, beam


@pytest.mark.parametrize("how", ["link", "off-centre"])
def test_moment_is_force_times_offset(how):
    """A small force: the moment in the beam is force x offset, [closed], to the displacements.

    1e-3 N at 0.5 m bends the beam by 5e-6 rad, which is what the lever changes by.
    """
    for load in ((1e-3, 0.0), (0.0, 1e-3), (1e-3, 2e-3)):
        solution, beam = outrigger(ub.Static(), load=load, how=how)
        N, V, M = solution.section_forces(beam)[-1]
        assert pytest.approx(load[0], abs=1e-5 * 2e-3) == N
        assert pytest.approx(load[1], abs=1e-5 * 2e-3) == V
        # In the middle of the last cell, 1/8 m from the end
        assert pytest.approx(load[1] / 8 - 0.5 * load[0], abs=1e-5 * 2e-3) == M
        reaction = solution.reaction(solution.scene.supports[0])[-1]
        by_hand = -load[0], -load[1], 0.5 * load[0] - load[1]
        np.testing.assert_allclose(reaction, by_hand, rtol=0, atol=1e-5 * 2e-3)


def test_large_rotation_by_an_eccentric_load():
    """The equilibrium by hand: the reaction is minus the load, and its moment that of the tip."""
    solution, beam = outrigger(ub.Static(), load=(-150.0, -40.0), how="link")
    tip = solution.displacement(beam.end)[-1]
    assert abs(tip[2]) > 0.5  # it bends a lot
    x, y = solution.position(beam.end)[-1]
    lever = np.array([x - 0.5 * math.sin(tip[2]), y + 0.5 * math.cos(tip[2])])
    moment = lever[0] * -40.0 - lever[1] * -150.0
    reaction = solution.reaction(solution.scene.supports[0])[-1]
    np.testing.assert_allclose(reaction, [150.0, 40.0, -moment], rtol=1e-8)


def test_eccentric_load_on_a_body():
    """The same with the arm as a part of a body, which is pushed off its centre."""
    tips = []
    for how in ("link", "off-centre"):
        solution, beam = outrigger(ub.Static(), load=(-150.0, -40.0), how=how)
        tips.append(solution.displacement(beam.end)[-1])
    # Each is solved to 1e-10 of the forces, up to EA = 1e6 N over EI = 100 N m²
    np.testing.assert_allclose(*tips, rtol=0, atol=1e-8)


# -- stiff beams in the place of rigid parts ---------------------------------------------------


def with_arm(ratio):
    """The outrigger in dynamics, its arm a RigidLink or a beam that is so many times as stiff."""
    beam = ub.Beam((0, 0), (1, 0), SECTION, cells=4)
    load = {"force": (-20.0, -30.0), "amplitude": ub.ramp(0.1)}
    if ratio is None:
        plate = ub.Body((1.0, 0.5), mass=1.0, inertia=0.1, name="plate")
        beams, bodies, masses = [beam], [plate], []
        joint = ub.RigidLink(beam.end, plate.middle)
        loads = [ub.PointLoad(plate.middle, **load)]
    else:
        stiff = ub.Section(EA=ratio * 1e3, GA=ratio * 1e3, EI=ratio * 100.0, rhoA=0.0)
        arm = ub.Beam((1, 0), (1, 0.5), stiff, cells=1, name="arm")
        beams, bodies, masses = [beam, arm], [], [ub.PointMass(arm.end, 1.0, 0.1)]
        joint = ub.Rigid(beam.end, arm.start)
        loads = [ub.PointLoad(arm.end, **load)]
    scene = ub.Scene(
        beams, joints=[joint], bodies=bodies, masses=masses,
        supports=[ub.Clamped(beam.start)], loads=loads,
    )  # fmt: skip
    solution = ub.simulate(scene, ub.EnergyMomentum(), t=(0, 1), dt=0.01)
    assert solution.energy.worst < 1e-9
    return solution.displacement(beam.end)[-1]


def test_stiff_beams_become_rigid():
    """The error falls like 1/ratio until round-off, and all ratios can be solved."""
    exact = with_arm(None)
    errors = np.array([np.abs(with_arm(10.0**n) - exact).max() for n in range(2, 9)])
    falls = errors[1:] / errors[:-1]
    np.testing.assert_allclose(falls, 0.1, rtol=0, atol=0.011)
    assert errors[-1] < 1e-8
