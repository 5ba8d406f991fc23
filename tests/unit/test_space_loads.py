# SPDX-License-Identifier: MIT
"""Supports and loads in space: equality with the plane, closed forms, balances, restart, errors."""

import re

import numpy as np
import pytest
from into_space import EXACT, SKEW, same_in_space
from scipy.spatial.transform import Rotation
from test_space import OTHER, PLANAR, STIFF

import ufl_beam as ub

SECTION = ub.Section(**STIFF, **OTHER)
SCHEMES = [
    ub.EnergyMomentum(), ub.EnergyMomentum(alpha=0.1, beta=0.1), ub.Static(),
    ub.EnergyMomentumStatic(),
]  # fmt: skip


def driven(loads=lambda post, girder: []):
    """A frame whose foot moves and turns as functions of time, on a roller at an angle."""
    post = ub.Beam((0, 0), (4, 3), PLANAR, cells=4)
    girder = ub.Beam((4, 3), (7, 3), PLANAR, cells=3)
    foot = ub.PrescribedDisplacement(
        post.start, u=lambda t: 0.3 * np.sin(2 * t), v=lambda t: 0.1 * t, psi=lambda t: 1.5 * t * t,
        along=(3, 4),
    )  # fmt: skip
    return ub.Scene(
        [post, girder], joints=[ub.Rigid(post.end, girder.start)],
        supports=[foot, ub.Roller(girder.end, along=(2, 1))],
        loads=[ub.Gravity((0.5, -1)), *loads(post, girder)],
    )  # fmt: skip


AXIS = np.array([1.0, 2.0, -1.0]) / np.sqrt(6)


def turns(t):
    """Three turns, which begin slowly and end."""
    return 6 * np.pi * t * t / (t * t + 1)


def propeller(psi=turns, arm=True):
    """A beam whose root turns about a skew axis; with a body at its end."""
    beam = ub.Beam((0, 0, 0), (3, 1, 0.5), SECTION, cells=4)
    ball = ub.Body((3, 1, 0.5), mass=2.0, inertia=(1, 1, 1.5))
    more = {"bodies": [ball], "joints": [ub.Rigid(beam.end, ball.middle)]} if arm else {}
    root = ub.PrescribedDisplacement(beam.start, u=0, v=0, w=0, psi=psi, axis=tuple(AXIS))
    return ub.Scene([beam], supports=[root], **more)


def test_a_root_turns_three_times_about_a_skew_axis():
    """The work is the energy, the moment changes the angular momentum, the axis stays."""
    run = ub.simulate(propeller(), ub.EnergyMomentum(), t=(0, 4), dt=0.02, newton=EXACT)
    (root,), energy = run.scene.supports, run.energy
    assert np.abs(energy.supplied["supports"] - energy.total).max() < 1e-12 * energy.total.max()
    assert energy.total[-1] > 100.0
    rotation = Rotation.from_rotvec(run.displacement(root.place)[:, 3:])
    assert np.abs(rotation.apply(AXIS) - AXIS).max() < 1e-12
    exact = Rotation.from_rotvec(turns(run.times)[:, None] * AXIS)
    assert (rotation * exact.inv()).magnitude().max() < 1e-12
    momentum, reaction = run.momentum(), run.reaction(root)
    rates = np.diff(momentum, axis=0) / 0.02
    assert np.abs(rates - reaction[1:]).max() < 1e-10 * np.abs(rates).max()


def test_a_driven_root_equals_a_joint_with_a_motor():
    """Within half a turn, which motors can measure."""
    driven = propeller(arm=False)
    beam = ub.Beam((0, 0, 0), (3, 1, 0.5), SECTION, cells=4)
    ground = ub.ground(0, 0, 0)
    motor = ub.Turn(ground, beam.start, ub.PrescribedMotion(turns), axis=tuple(AXIS))
    joint = ub.Revolute(ground, beam.start, axis=tuple(AXIS))
    jointed = ub.Scene([beam], joints=[joint], connectors=[motor])
    one, other = (
        ub.simulate(x, ub.EnergyMomentum(), t=(0, 0.4), dt=0.02, newton=ub.Newton(rtol=1e-12))
        for x in (driven, jointed)
    )
    ends = [run.displacement(run.scene.beams[0].end) for run in (one, other)]
    assert np.abs(ends[0] - ends[1]).max() < 1e-13
    supplied = one.energy.supplied["supports"], other.energy.supplied["motors"]
    assert np.abs(supplied[0] - supplied[1]).max() < 1e-11 * supplied[0].max()


@pytest.mark.parametrize("psi", [None, lambda t: 4 * t], ids=["on a spring", "driven"])
def test_moments_of_a_hinge_in_statics(psi):
    """The moments balance the force at the tip; a hinge that is free has none about its axis."""
    scene = propeller(psi, arm=False)
    (beam,), (root,) = scene.beams, scene.supports
    pull = ub.PointLoad(beam.end, force=(1, -2, 3), amplitude=lambda t: 1 + t)
    spring = ub.Turn(ub.ground(0, 0, 0), beam.start, ub.Spring(100.0), axis=tuple(AXIS))
    whole = ub.Scene([beam], supports=[root], loads=[pull], connectors=[spring] * (psi is None))
    run = ub.simulate(whole, ub.Static(), t=(0, 1), dt=0.25)
    force = np.array([1.0, -2.0, 3.0]) * (1 + run.times[1:, None])
    reaction, tip = run.reaction(root)[1:], run.position(beam.end)[1:]
    moment = reaction[:, 3:].copy()
    if psi is None:
        assert np.abs(moment @ AXIS).max() < 1e-9
        assert np.linalg.norm(run.displacement(beam.start)[-1, 3:]) > 0.04
        moment -= run.connector(spring).force[1:, None] * AXIS
    assert np.abs(reaction[:, :3] + force).max() < 1e-9
    assert np.abs(moment + np.cross(tip, force)).max() < 1e-8


def test_a_point_slides_in_turned_axes():
    """A heavy beam whose ends slide along skew lines: the lines, the ledger, and reactions."""
    lines = np.array([[1.0, 2.0, -1.0], [2.0, -1.0, 1.0]])
    beam = ub.Beam((0, 0, 0), (3, 1, 0.5), SECTION, cells=4)
    rollers = [
        ub.Roller(place, along=tuple(line))
        for place, line in zip((beam.start, beam.end), lines, strict=True)
    ]
    twist = ub.Turn(ub.ground(0, 0, 0), beam.start, ub.Spring(50.0), axis=(3, 1, 0.5))
    scene = ub.Scene(
        [beam], supports=rollers, connectors=[twist], loads=[ub.Gravity((0.0, -1.0, -9.81))]
    )
    run = ub.simulate(scene, ub.EnergyMomentum(), t=(0, 2), dt=0.02)
    assert run.energy.worst < 1e-10
    for roller, line in zip(rollers, lines, strict=True):
        moved, force = run.displacement(roller.place)[:, :3], run.reaction(roller)[1:, :3]
        assert np.abs(moved).max() > 0.1
        assert np.abs(np.cross(moved, line)).max() < 1e-13
        assert np.abs(force @ line).max() < 1e-12 * np.abs(force).max()


def test_a_base_that_shakes_equals_an_acceleration_of_all_masses():
    """In the frame of the base; the base is shaken along skew axes, in directions of its own."""
    shake, accelerations = (lambda t: 0.05 * t**2), 0.1
    along, up = np.array([1.0, 2.0, 2.0]) / 3, np.array([2.0, 1.0, -2.0]) / 3
    beam = ub.Beam((0, 0, 0), (0, 0.5, 3), SECTION, cells=4, up=(1, 0, 0))
    base = ub.PrescribedDisplacement(
        beam.start, u=shake, v=0.0, w=lambda t: -2 * shake(t), along=tuple(along), up=tuple(up),
        axis=(0, 0, 1), psi=0.0,
    )  # fmt: skip
    drift = ub.Velocity([beam], linear=(0, 0, 0))
    moving = ub.Scene([beam], supports=[base], initial=[drift])
    still = ub.Scene(
        [beam], supports=[ub.Clamped(beam.start)],
        loads=[ub.Gravity(tuple(-accelerations * (along - 2 * up)))],
    )  # fmt: skip
    runs = [
        ub.simulate(x, ub.EnergyMomentum(), t=(0, 1), dt=0.05, newton=EXACT)
        for x in (moving, still)
    ]
    one, other = (run.displacement(beam.end) for run in runs)
    carried = shake(runs[0].times)[:, None] * (along - 2 * up)
    assert np.abs(one[:, :3] - carried - other[:, :3]).max() < 1e-12
    assert np.abs(one[:, 3:] - other[:, 3:]).max() < 1e-12
    assert np.abs(other[:, :3]).max() > 1e-3
    assert runs[0].energy.worst < 1e-12


@pytest.mark.parametrize("psi", [None, turns], ids=["free", "driven"])
def test_start_and_checkpoint_of_a_hinge(psi, shared_path):
    """A restart changes no bit; another scene, which finds the angle of the place, only digits."""
    scene = propeller(psi, arm=False)
    (beam,), (root,) = scene.beams, scene.supports
    push = ub.PointLoad(beam.end, force=(1, 4, 2), amplitude=lambda t: t < 0.3)
    pushed = ub.Scene([beam], supports=[root], loads=[push])

    def run(end, scene=pushed, begin=0.0, **more):  # times are binary numbers
        return ub.simulate(scene, ub.EnergyMomentum(), t=(begin, end), dt=1 / 16, **more)

    checkpoint = ub.Checkpoint(shared_path / "run.checkpoint", every=8)
    whole, first = run(4), run(2, checkpoint=checkpoint)
    restarted = run(4, checkpoint=checkpoint)
    for result in (lambda x: x.displacement(beam.end), lambda x: x.reaction(root)[1:]):
        assert (result(whole) == result(restarted)).all()
    assert np.linalg.norm(whole.displacement(beam.start)[32, 3:]) > 0.1
    other = ub.PrescribedDisplacement(beam.start, u=0, v=0, w=0, psi=psi, axis=tuple(AXIS))
    for parts in ({"supports": [root], "loads": [push]}, {"supports": [other]}):
        second = run(4, ub.Scene([beam], **parts), begin=2.0, start=first)
        apart = whole.displacement(beam.end)[32:] - second.displacement(beam.end)
        assert np.abs(apart).max() < 1e-9
    tilted = ub.PrescribedDisplacement(beam.start, u=0, v=0, w=0, axis=(0, 0, 1))
    with pytest.raises(ub.ModelError, match="turned about another axis"):
        run(4, ub.Scene([beam], supports=[tilted]), begin=2.0, start=first)


def following(post, girder):
    """A follower force with a moment, and pressures on a part of a beam and on another beam."""
    return [
        ub.FollowerLoad(girder.end, force=(3, 8), moment=-20.0, amplitude=lambda t: 1 + t),
        ub.Pressure(post, normal=15.0, tangential=-4.0, span=(0.25, 1.0), profile=(0.5, 2.0)),
        ub.Pressure(girder, normal=9.0, amplitude=lambda t: t),
    ]


def moves(post, girder):
    """A force that crosses the joint of two beams, and leaves the second one."""
    return [ub.MovingLoad([post, girder], lambda t: 9 * t, force=(5, -20))]


@pytest.mark.parametrize("scheme", SCHEMES, ids=str)
@pytest.mark.parametrize("loads", [lambda *_: [], following, moves])
def test_a_driven_frame_with_loads_equals_the_plane(loads, scheme):
    same_in_space(driven(loads), scheme)


def with_ball(loads):
    """A beam with a ball."""
    beam = ub.Beam((0, 0), (2, 0), PLANAR, cells=4)
    ball = ub.Body((2.5, 0.3), mass=3.0, inertia=0.7)
    return ub.Scene(
        [beam], bodies=[ball], joints=[ub.Rigid(beam.end, ball.at(2, 0))],
        supports=[ub.Clamped(beam.start)], loads=loads(beam, ball),
    )  # fmt: skip


def at_an_arm(beam, ball):
    """A force at the edge of the ball, and a moment, which does not depend on its place."""
    push, twist = ub.PointLoad(ball.at(3, 1), force=(20, 90)), ub.PointLoad(ball.middle, moment=30)
    return [push, twist, ub.Pressure(beam, normal=-25.0)]


def in_a_frame(beam, ball):
    return [ub.PointLoad(ball.at(3, 1), force=(20, 90)), ub.RotatingFrame(2.5, about=(-1, 0.5))]


@pytest.mark.parametrize("scheme", SCHEMES, ids=str)
@pytest.mark.parametrize("loads", [at_an_arm, in_a_frame])
def test_loads_of_a_ball_equal_the_plane(loads, scheme):
    same_in_space(with_ball(loads), scheme)


@pytest.mark.parametrize("kind", [ub.PointLoad, ub.FollowerLoad])
def test_work_of_a_moment_in_statics(kind):
    """In bending about one axis, work and energy are linear in angles, and equal to digits.

    Also after a continued run, whose first step begins with the last moment.
    """
    end, up, moment = map(tuple, SKEW.apply([(3, 1, 0), (-1, 3, 0), (0, 0, 300.0)]))
    beam = ub.Beam((0, 0, 0), end, SECTION, cells=8, up=up)
    bend = kind(beam.end, moment=moment, amplitude=lambda t: t)
    scene = ub.Scene([beam], supports=[ub.Clamped(beam.start)], loads=[bend])
    first = ub.simulate(scene, ub.Static(), t=(0, 1), dt=0.25)
    assert first.energy.worst < 1e-14
    second = ub.simulate(scene, ub.Static(), t=(1, 2), dt=0.25, start=first)
    assert second.energy.worst < 1e-14
    angle = np.linalg.norm(first.displacement(beam.end)[-1, 3:])
    exact = 300.0 * np.hypot(3, 1) / STIFF["EI"]
    assert abs(angle - exact) < 1e-9
    assert abs(first.energy.supplied["loads"][-1] - 300.0 * exact / 2) < 1e-9


def test_a_spinning_body_with_a_follower_force():
    """The force turns with the body, by the same angle in each step: sums of its directions."""
    force, spin, dt = np.array([3.0, -1.0, 2.0]), np.array([1.0, -2.0, 2.0]), 0.05
    ball = ub.Body((1, 2, 3), mass=2.0, inertia=(4, 4, 4))
    scene = ub.Scene(
        bodies=[ball], loads=[ub.FollowerLoad(ball.middle, force=tuple(force))],
        initial=[ub.Velocity([ball], angular=tuple(spin), about=(1, 2, 3), linear=(0, 0, 0))],
    )  # fmt: skip
    run = ub.simulate(scene, ub.EnergyMomentum(), t=(0, 2), dt=dt, newton=EXACT)
    steps = 2 * np.arctan(np.linalg.norm(spin) * dt / 2) * (np.arange(40) + 0.5)
    directions = Rotation.from_rotvec(steps[:, None] * spin / np.linalg.norm(spin))
    momentum = np.cumsum(dt * directions.apply(force), axis=0)
    assert np.abs(run.momentum()[1:, :3] - momentum).max() < 1e-12
    assert run.energy.worst < 1e-13


def test_a_load_that_is_added_follows_the_rotation():
    """In a run with start=, a new load begins with the rotation of its place in the earlier run."""
    beam = ub.Beam((0, 0, 0), (3, 1, 0.5), SECTION, cells=3)
    spin = ub.Velocity([beam], angular=(1, 2, -1), linear=(0, 0, 0), about=(0, 0, 0))

    def run(begin, end, amplitude, start=None):
        loads = [
            ub.FollowerLoad(beam.end, force=(1, 5, -2), moment=(3, 0, 9), amplitude=amplitude),
            ub.Pressure(beam, normal=(4, -3), amplitude=amplitude),
        ]
        scene = ub.Scene([beam], loads=loads, initial=[spin])
        return ub.simulate(
            scene, ub.EnergyMomentum(), t=(begin, end), dt=1 / 32, start=start
        ).displacement(beam.end)[-1]

    whole = run(0, 2, lambda t: t > 1)
    scene = ub.Scene([beam], initial=[spin])
    first = ub.simulate(scene, ub.EnergyMomentum(), t=(0, 1), dt=1 / 32)
    assert np.linalg.norm(first.displacement(beam.end)[-1, 3:]) > 1
    second = run(1, 2, lambda t: 1.0, first)
    assert np.abs(second - whole).max() < 1e-9


def test_a_flight_seen_from_a_rotating_frame():
    """A bent beam with a spinning wheel, in a frame that turns: the errors are of second order.

    The flight in the frame at rest is turned back; its steps are short.
    """
    rate, about = np.array([0.4, -0.8, 0.6]), np.array([0.5, 1.0, -0.3])

    def flight(turning):
        beam = ub.Beam((0, 0, 0), (2, 1, 0.5), SECTION, cells=2)
        wheel = ub.Body((2, 1, 0.5), mass=3.0, inertia=(2.0, 3.0, 1.5))
        joint = ub.Rigid(beam.end, wheel.middle)
        spin, linear = np.array([0.5, 0.2, -1.0]), np.array([0.3, 0.0, 0.1])
        if turning:  # velocities of the same motion in the frame
            spin, linear = spin - rate, linear + np.cross(rate, about)
        start = ub.Velocity(
            [beam, wheel], linear=tuple(linear), angular=tuple(spin), about=(0, 0, 0)
        )
        frames = [ub.RotatingFrame(tuple(rate), about=tuple(about))] * turning
        return ub.Scene([beam], bodies=[wheel], joints=[joint], initial=[start], loads=frames)

    def states(turning, dt):
        run = ub.simulate(flight(turning), ub.EnergyMomentum(), t=(0, 1), dt=dt, newton=EXACT)
        assert run.energy.worst < 1e-12
        wheel = run.scene.bodies[0].middle
        return run.position(wheel)[-1], Rotation.from_rotvec(run.displacement(wheel)[-1, 3:])

    place, rotation = states(False, 1 / 320)
    back, errors = Rotation.from_rotvec(-rate), []
    for dt in (0.1, 0.05):
        at, turned = states(True, dt)
        apart = (turned * (back * rotation).inv()).magnitude()
        errors.append((np.linalg.norm(at - about - back.apply(place - about)), apart))
    assert (np.abs(np.log2(np.divide(*errors)) - 2) < 0.2).all()
    assert np.max(errors[1]) < 1e-2


def test_a_point_mass_is_a_body_without_rotary_inertia():
    """In a rotating frame, with weight, of a place on a skew roller; and its modes."""
    beam = ub.Beam((0, 0, 0), (2, 1, 0.5), SECTION, cells=2)
    feet = [ub.Pinned(beam.start), ub.Roller(beam.end, along=(1, -1, 2))]
    loads = [ub.RotatingFrame((0.4, -0.8, 0.6), about=(0, 0, 1)), ub.Gravity((1, 2, -9.81))]
    ball, found = ub.Body((2, 1, 0.5), mass=3.0), []
    for parts in (
        {"masses": [ub.PointMass(beam.end, 2.0), ub.PointMass(beam.end, 1.0)]},
        {"bodies": [ball], "joints": [ub.Rigid(beam.end, ball.middle)]},
    ):
        scene = ub.Scene([beam], supports=feet, loads=loads, **parts)
        run = ub.simulate(scene, ub.EnergyMomentum(), t=(0, 1), dt=0.02, newton=EXACT)
        shapes = ub.modes(ub.Scene([beam], supports=[ub.Clamped(beam.start)], **parts), 4)
        found.append((run.position(beam.end), run.momentum(), shapes.omega))
    for one, other in zip(*found, strict=True):
        assert np.abs(one - other).max() < 1e-11 * np.abs(other).max()
    with pytest.raises(ub.ModelError, match="only a Body has rotary inertia"):
        ub.Scene([beam], masses=[ub.PointMass(beam.end, 1.0, 1.0)])


def test_whirling_of_a_shaft():
    """Both frequencies of a Rayleigh shaft on bearings, in the frame that turns with it.

    (ρA + I k²) ω² - J Ω k² ω - E I k⁴ = 0 with k = π/L, about the frame at rest.  The scheme maps
    a frequency ω to 2/dt arctan(ω dt/2).  Errors are of second order in the length of the cells.
    """
    L, E, Ω, k, dt = 10.0, 400.0, 12.0, np.pi / 10.0, 0.02
    exact = np.roots([1 + 0.3 * k**2, -0.6 * Ω * k**2, -E * k**4])
    assert np.abs(np.sort(exact) - [-1.630614, 2.320791]).max() < 1e-6
    section = ub.Section(
        EA=1e7, GA=1e7, GA3=1e7, EI=E, EI2=E, GJ=300.0, rhoA=1.0, rhoI=0.3, rhoI2=0.3
    )

    def frequencies(cells):
        shaft = ub.Beam((0, 0, 0), (L, 0, 0), section, cells=cells)
        bearings = [ub.Pinned(shaft.start), ub.Roller(shaft.end, along=(1, 0, 0))]
        push = ub.LineLoad(shaft, force=(0, 1e-6, 0), amplitude=lambda t: t < 0.5,
                           profile=lambda s: np.sin(np.pi * s))  # fmt: skip
        frame = ub.RotatingFrame((Ω, 0, 0))
        scene = ub.Scene([shaft], supports=bearings, loads=[push, frame])
        run = ub.simulate(scene, ub.EnergyMomentum(), t=(0, 30), dt=dt)
        y = run.displacement(shaft.at(0.5))[int(1 / dt) :, 1:3] @ [1.0, 1.0j]
        # The sum of two exponentials: y[n + 1] is a combination of y[n] and y[n - 1]
        (a, b), *_ = np.linalg.lstsq(np.column_stack([y[1:-1], y[:-2]]), y[2:], rcond=None)
        steps = np.angle(np.roots([1.0, -a, -b]))
        return np.sort(2 / dt * np.tan(steps / 2) + Ω)

    coarse, fine = frequencies(16), frequencies(32)
    assert (np.abs(np.log2((coarse - np.sort(exact)) / (fine - np.sort(exact))) - 2) < 0.1).all()
    assert np.abs((4 * fine - coarse) / 3 - np.sort(exact)).max() < 1e-4


BEAM = ub.Beam((0, 0, 0), (1, 0, 0), SECTION, name="arm")
FLAT = ub.Beam((0, 0), (1, 0), PLANAR)
MOVED = ub.PrescribedDisplacement
WRONG = {
    "roller of the plane": (lambda: ub.Roller(BEAM.end, along=(1, 1)), "must have 3 components"),
    "roller of space": (lambda: ub.Roller(FLAT.end, along=(1, 1, 0)), "must have 2 components"),
    "rotation without axis": (lambda: MOVED(BEAM.end, psi=0.1), "give the axis=(x, y, z)"),
    "axis in the plane": (lambda: MOVED(FLAT.end, axis=(0, 0, 1)), "axis is for scenes in space"),
    "third displacement in the plane": (lambda: MOVED(FLAT.end, w=0), "w is for scenes in space"),
    "axis of length zero": (lambda: MOVED(BEAM.end, axis=(0, 0, 0)), "is no direction"),
    "up along u": (lambda: MOVED(BEAM.end, u=0, along=(0, 0, 2)), "up is along the direction of u"),
    "nothing": (lambda: MOVED(BEAM.end), "at least one of u, v, w, axis"),
    "two supports": (
        lambda: ub.Scene([BEAM], supports=[ub.Pinned(BEAM.end), MOVED(BEAM.end, w=0)]),
        "both hold w",
    ),
    "clamp and axis": (
        lambda: ub.Scene([BEAM], supports=[ub.Clamped(BEAM.end), MOVED(BEAM.end, axis=(0, 1, 0))]),
        "both hold rotation across the axis",
    ),
    "one pressure": (lambda: ub.Scene([BEAM], loads=[ub.Pressure(BEAM, normal=1.0)]), "2 comp"),
    "two pressures": (
        lambda: ub.Scene([FLAT], loads=[ub.Pressure(FLAT, normal=(1.0, 2.0))]),
        "1 comp",
    ),
}


@pytest.mark.parametrize("case", WRONG)
def test_errors_before_a_run(case):
    make, words = WRONG[case]
    with pytest.raises(ub.ModelError, match=re.escape(words)):
        make()


def test_a_turn_of_more_than_135_degrees_is_divided():
    """Also the sign of the rotation is kept, which a step of 270 degrees would not tell."""
    run = ub.simulate(propeller(lambda t: 6 * t, arm=False), ub.Static(), t=(0, 1), dt=1.0)
    turned = Rotation.from_rotvec(run.displacement(run.scene.supports[0].place)[-1, 3:])
    assert (turned * Rotation.from_rotvec(-6 * AXIS)).magnitude() < 1e-12
    assert np.abs(run.strains(run.scene.beams[0])).max() < 1e-12
