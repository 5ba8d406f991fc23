# SPDX-License-Identifier: MIT
"""Connectors in space that turn by more than 360° about the axis of a joint."""

import numpy as np
import pytest

import ufl_beam as ub

QUIET = {"progress": False}
AXIS = np.array([1.0, -2.0, 2.0]) / 3
LAWS = {
    "spring": ub.Spring(0.01),
    "damper": ub.Damper(0.01),
    "friction": ub.Coulomb(0.1),
    "stop": ub.Stop(10.0, high=7.0),
    "motor": ub.PrescribedMotion(lambda t: 3 * t * t),
    "actuator": ub.PrescribedForce(lambda t: -0.1),
    "yielding": ub.Spring(1.0, ub.ElastoPlastic(0.1)),
    "softening": ub.RigidPlastic(ub.LinearSoftening(limit=1.0, fracture_energy=5.0)),
    "function": ub.ForceLaw(lambda e, v: 0.01 * e + 0.002 * v),
}


def wheel(law, spin=20.0, in_space=True):
    """A wheel on a pin, and a connector of its rotation."""
    zero = (0.0,) * (2 + in_space)
    inertia, angular = (np.full(3, 0.03), spin * AXIS) if in_space else (0.03, spin)
    axis = {"axis": tuple(AXIS)} if in_space else {}
    body, base = ub.Body(zero, mass=1.0, inertia=inertia, name="wheel"), ub.ground(*zero)
    turn = ub.Turn(base, body.middle, law, **axis, name="turn")
    spins = [ub.Velocity([body], angular=angular)] if spin else []
    scene = ub.Scene(
        [], bodies=[body], joints=[ub.Revolute(base, body.middle, **axis)], connectors=[turn],
        initial=spins,
    )  # fmt: skip
    return scene, turn


@pytest.mark.parametrize("name", LAWS)
def test_laws_count_whole_turns_as_in_the_plane(name):
    motions = []
    for in_space in (True, False):
        scene, turn = wheel(LAWS[name], 0.0 if name == "motor" else 20.0, in_space)
        run = ub.simulate(scene, ub.EnergyMomentum(), t=(0, 2.5), dt=0.02, **QUIET)
        motions.append(run.connector(turn).motion)
        assert run.energy.worst < 1e-9
    space, plane = motions
    assert np.abs(plane).max() > 2 * np.pi
    # Newton's method ends at 1e-10 of the forces, in each of 125 steps
    np.testing.assert_allclose(space, plane, rtol=0, atol=1e-8)


def test_statics_winds_up_a_spring():
    scene, turn = wheel(ub.Spring(0.1), spin=0.0)
    moment = ub.PointLoad(
        scene.bodies[0].middle, moment=tuple(2 * AXIS), amplitude=lambda t: t
    )  # about the axis, so that it is conservative
    wound = ub.Scene(
        [], bodies=scene.bodies, joints=scene.joints, connectors=[turn], loads=[moment]
    )
    run = ub.simulate(wound, ub.Static(), t=(0, 1), dt=0.05, **QUIET)
    np.testing.assert_allclose(run.connector(turn).motion, 20 * run.times, rtol=1e-9, atol=1e-9)


def test_start_continues_whole_turns():
    scene, turn = wheel(LAWS["spring"])
    whole = ub.simulate(scene, ub.EnergyMomentum(), t=(0, 1), dt=0.05, **QUIET)
    first = ub.simulate(scene, ub.EnergyMomentum(), t=(0, 0.5), dt=0.05, **QUIET)
    second = ub.simulate(scene, ub.EnergyMomentum(), t=(0.5, 1), dt=0.05, start=first, **QUIET)
    assert first.connector(turn).motion[-1] > 2 * np.pi
    assert np.array_equal(second.q[-1], whole.q[-1])
    assert second.connector(turn).motion[-1] == whole.connector(turn).motion[-1]
    with pytest.raises(ub.ArgumentError, match="turn has internal variables"):
        ub.simulate(scene, ub.EnergyMomentum(), t=(0.5, 1), dt=0.05, start=(whole, 10), **QUIET)


def test_a_rotation_about_another_axis_is_below_360_degrees():
    body, base = ub.Body((0, 0, 0), mass=1.0, inertia=(0.02, 0.02, 0.03)), ub.ground(0, 0, 0)
    turn = ub.Turn(base, body.middle, ub.Spring(0.05), axis=(1, 0, 0), name="brake")
    top = ub.Scene(
        [], bodies=[body], joints=[ub.Spherical(base, body.middle)], connectors=[turn],
        initial=[ub.Velocity([body], angular=(0, 0, 6.0))],
    )  # fmt: skip
    with pytest.raises(ub.ConvergenceError, match="brake: in space it turns by 360° about an axis"):
        ub.simulate(top, ub.EnergyMomentum(), t=(0, 2), dt=0.01, **QUIET)


def test_a_double_cardan_joint_turns_at_constant_velocity():
    """Five turns of two universal joints in phase, with shafts at an angle of 0.5 rad."""
    along = np.array([np.cos(0.5), np.sin(0.5), 0.0])
    ahead = (1, 0, 0)
    first = ub.Body((-0.5, 0, 0), mass=1.0, inertia=(0.02, 0.03, 0.03), name="driving shaft")
    middle = ub.Body(tuple(along / 2), mass=1.0, inertia=(0.02,) * 3, name="middle shaft")
    last = ub.Body(np.add(along, (0.5, 0, 0)), mass=1.0, inertia=(0.02, 0.03, 0.03), name="driven")
    base, bearing = ub.ground(*first.center), ub.ground(*last.center)
    driving = ub.Turn(
        base, first.middle, ub.PrescribedMotion(lambda t: 10 * t * t / (1 + t)), axis=ahead
    )
    brake = ub.Turn(bearing, last.middle, ub.Damper(0.1), axis=ahead)
    joints = [
        ub.Revolute(base, first.middle, axis=ahead),
        ub.Universal(first.at(0, 0, 0), middle.at(0, 0, 0), axes=((0, 1, 0), (0, 0, 1))),
        ub.Universal(middle.at(*along), last.at(*along), axes=((0, 0, 1), (0, 1, 0))),
        ub.Cylindrical(bearing, last.middle, axis=ahead),
    ]
    shafts = ub.Scene([], bodies=[first, middle, last], joints=joints, connectors=[driving, brake])
    run = ub.simulate(shafts, ub.EnergyMomentum(), t=(0, 4), dt=0.01, **QUIET)
    angles = [run.connector(x).motion for x in (driving, brake)]
    assert angles[0][-1] > 5 * 2 * np.pi
    np.testing.assert_allclose(angles[1], angles[0], rtol=0, atol=1e-9)
    assert run.energy.worst < 1e-11


def test_derivatives_through_whole_turns():
    def model(stiffness):
        scene, _ = wheel(ub.Spring(stiffness))
        return scene

    def end(run):
        return run.connector(run.scene.connectors[0]).motion[-1]

    when = {"t": (0, 1), "dt": 0.05, **QUIET}
    found = ub.differentiate(model, {"stiffness": 0.1}, ub.EnergyMomentum(), **when).of(end)
    h, newton = 1e-4, ub.Newton(rtol=1e-14)
    more, less = (
        end(ub.simulate(model(0.1 + x), ub.EnergyMomentum(), newton=newton, **when))
        for x in (h, -h)
    )
    np.testing.assert_allclose(found, [(more - less) / (2 * h)], rtol=1e-6)
