# SPDX-License-Identifier: MIT
"""Scenes in space: equality with the plane, balances, restart, and errors before a run."""

import re
from dataclasses import dataclass

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

import ufl_beam as ub
import ufl_beam.structures as st

EXACT = ub.Newton(rtol=1e-13)
STIFF = {"EA": 1e4, "GA": 1e4, "EI": 500.0, "rhoA": 1.0, "rhoI": 10.0}
OTHER = {"GA3": 7e3, "EI2": 300.0, "GJ": 400.0, "rhoI2": 6.0}
TURNS = [Rotation.identity(), Rotation.from_rotvec([0.3, -0.7, 1.1])]


def frame(section, at, direction, moment, connectors=lambda *_: []):
    """Two beams with a rigid joint on a pin; vectors of the plane go through ``at``."""
    long = ub.Beam(at(6, 0), at(0, 8), section, cells=10, **direction(1, 1))
    short = ub.Beam(at(0, 8), at(3, 9), section, cells=4, **direction(0, 1))
    push = ub.PointLoad(long.start, force=at(8, 0), moment=moment, amplitude=lambda t: t < 0.5)
    return ub.Scene(
        [long, short], joints=[ub.Rigid(long.end, short.start)],
        supports=[ub.Pinned(short.end)], connectors=connectors(long.start, short.end, at),
        loads=[push, ub.LineLoad(long, force=at(1, -2)), ub.Gravity(at(0.5, -1))],
    )  # fmt: skip


def in_plane(**more):
    return frame(ub.Section(**STIFF), lambda x, y: (x, y), lambda *_: {}, -80.0, **more)


def in_space(turn, **more):
    def at(x, y):
        return tuple(turn.apply([x, y, 0.0]))

    section, moment = ub.Section(**STIFF, **OTHER), tuple(turn.apply([0.0, 0.0, -80.0]))
    return frame(section, at, lambda x, y: {"up": at(x, y)}, moment, **more)


@pytest.mark.parametrize("turn", TURNS)
@pytest.mark.parametrize("scheme", [ub.EnergyMomentum(), ub.EnergyMomentum(alpha=0.1)], ids=str)
def test_a_planar_scene_in_space_has_the_same_motion(scheme, turn):
    """To round-off, also in a turned plane, and nothing moves out of the plane."""
    same_motion(in_plane(), in_space(turn), scheme, turn)


def ground(at, x, y):
    return ub.ground(*at(x, y))


LAWS = {
    "spring": ub.Spring(40.0), "hardening spring": ub.Spring(300.0, ub.ElastoPlastic(20.0)),
    "damper": ub.Damper(15.0), "stop": ub.Stop(200.0, low=-0.02, high=0.05),
    "motor": ub.PrescribedMotion(lambda t: 0.1 * t * t),
    "force": ub.PrescribedForce(lambda t: 30 * t),
    "force law": ub.ForceLaw(lambda motion, rate: 20 * motion + 3 * rate),
}  # fmt: skip
KINDS = {
    "Stretch": lambda tip, pin, at, law: ub.Stretch(tip, ground(at, 9, -2), law),
    "Slide": lambda tip, pin, at, law: ub.Slide(tip, ground(at, 9, -2), law, axis=at(0.6, 0.8)),
    "Turn": lambda tip, pin, at, law: ub.Turn(
        ground(at, 3, 9), pin, law, **{} if len(at(0, 0)) == 2 else {"axis": normal(at)}
    ),
}


def normal(at):
    return tuple(np.cross(at(1, 0), at(0, 1)))


@pytest.mark.parametrize("law", LAWS)
@pytest.mark.parametrize("kind", KINDS)
def test_connectors_have_the_same_motion_in_space(kind, law):
    def add(tip, pin, at):
        return [KINDS[kind](tip, pin, at, LAWS[law])]

    plane, space = in_plane(connectors=add), in_space(TURNS[1], connectors=add)
    runs = same_motion(plane, space, ub.EnergyMomentum(), TURNS[1])
    one, other = (run.connector(run.scene.connectors[0]) for run in runs)
    for name in ("motion", "force", "work", "dissipated"):
        a, b = getattr(one, name), getattr(other, name)
        assert np.abs(a - b).max() < 1e-9 * max(1.0, np.abs(a).max())


def with_ball(at, joint, *, in_plane, moving):
    """A beam with a ball: clamped in statics, else on a pin about which both turn at first."""
    section = ub.Section(**STIFF, **{} if in_plane else OTHER)
    beam = ub.Beam(at(0, 0), at(2, 0), section, cells=4, **{} if in_plane else {"up": at(0, 1)})
    ball = ub.Body(at(2.5, 0.3), mass=3.0, inertia=0.7 if in_plane else (0.7, 0.7, 0.7))
    spin = 0.5 if in_plane else tuple(0.5 * np.array(normal(at)))
    start = [ub.Velocity([beam, ball], angular=spin, about=at(0, 0))] * moving
    joints = [joint(beam, ball, at, {} if in_plane else {"axis": normal(at)})]
    loads = [ub.Gravity(at(2, -9), amplitude=lambda t: min(1.0, 0.5 + t))]
    foot = (ub.Pinned if moving else ub.Clamped)(beam.start)
    parts = {"bodies": [ball], "joints": joints, "supports": [foot]}
    return ub.Scene([beam], **parts, loads=loads, initial=start)


JOINTS = {
    "rigid": lambda beam, ball, at, axis: ub.Rigid(beam.end, ball.at(*at(2, 0))),
    "rigid link": lambda beam, ball, at, axis: ub.RigidLink(beam.at(0.5), ball.middle),
    "revolute": lambda beam, ball, at, axis: ub.Revolute(beam.end, ball.at(*at(2, 0)), **axis),
    "prismatic": lambda beam, ball, at, axis: ub.Prismatic(
        beam.end, ball.at(*at(2, 0)), axis=at(0.6, 0.8)
    ),
    "link": lambda beam, ball, at, axis: ub.Link(beam.at(0.5), ball.middle),
}
BOTH = [(joint, ub.EnergyMomentum()) for joint in JOINTS] + [
    (joint, scheme)
    for joint in ("rigid", "rigid link")
    for scheme in (ub.Static(), ub.EnergyMomentumStatic())
]


@pytest.mark.parametrize(("joint", "scheme"), BOTH, ids=str)
def test_joints_have_the_same_motion_in_space(joint, scheme):
    turn, both = TURNS[1], []
    for in_plane in (True, False):
        at = (lambda x, y: (x, y)) if in_plane else (lambda x, y: tuple(turn.apply([x, y, 0.0])))
        moving = isinstance(scheme, ub.EnergyMomentum)
        both.append(with_ball(at, JOINTS[joint], in_plane=in_plane, moving=moving))
    for place in (lambda scene: scene.beams[0].end, lambda scene: scene.bodies[0].middle):
        same_motion(*both, scheme, turn, place)


def test_a_slider_that_may_turn_moves_along_and_about_the_axis_only():
    """[closed] A body on the ground: m u'' = F and J ω' = M along the axis, in Cayley steps."""
    axis, m, J, dt = np.array([1.0, 2.0, 2.0]) / 3, 2.0, 0.5, 0.1
    at, force, moment = (0.3, 0.1, -0.2), (1.0, -3.0, 2.0), (0.4, 0.3, 0.1)
    body = ub.Body(at, mass=m, inertia=(J, J, J))
    slot = ub.Prismatic(ub.ground(*at), body.middle, axis=axis, turning=True)
    load = ub.PointLoad(body.middle, force=force, moment=moment)
    scene = ub.Scene(bodies=[body], joints=[slot], loads=[load])
    run = ub.simulate(scene, ub.EnergyMomentum(), t=(0, 1), dt=dt, newton=EXACT, progress=False)
    F, M = axis @ force, axis @ moment
    changes = M / J * dt**2 * (np.arange(10) + 0.5)
    turns = np.append(0.0, np.cumsum(2 * np.arctan(changes / 2)))
    expected = np.outer(F * run.times**2 / (2 * m), axis), np.outer(turns, axis)
    np.testing.assert_allclose(run.displacement(body.middle), np.hstack(expected), atol=1e-13)


def same_motion(plane, space, scheme, turn, place=lambda scene: scene.beams[0].start):
    """Check that displacements and rotations are equal, and return both runs."""
    runs = [
        ub.simulate(x, scheme, t=(0, 1), dt=0.1, newton=EXACT, progress=False)
        for x in (plane, space)
    ]
    plane, space = [run.displacement(place(run.scene)) for run in runs]
    back = turn.inv()
    u, rotation = back.apply(space[:, :3]), back.apply(space[:, 3:])
    size = runs[0].scene.size
    assert np.abs(u[:, :2] - plane[:, :2]).max() < 1e-13 * size
    assert np.abs(u[:, 2]).max() < 1e-13 * size
    wrapped = Rotation.from_rotvec(plane[:, 2:] * [[0.0, 0.0, 1.0]]).as_rotvec()
    assert np.abs(rotation - wrapped).max() < 1e-12
    for name in runs[0].energy:
        pair = [run.energy[name] for run in runs]
        assert np.allclose(*pair, rtol=1e-12, atol=1e-12 * runs[0].energy.energy_transferred)
    reactions = [run.reaction(run.scene.supports[0])[1:] for run in runs]
    forces = back.apply(reactions[1][:, :3])[:, :2]
    assert np.abs(forces - reactions[0][:, :2]).max() < 1e-12 * np.abs(forces).max() * size
    return runs


def flight(**more):
    """A free beam that turns and bends in space, pushed until t = 5 s."""
    section = ub.Section(EA=1e4, GA=1e4, EI=500.0, rhoA=1.0, rhoI=10.0, GA3=1e4, EI2=500.0,
                         GJ=500.0, rhoI2=10.0)  # fmt: skip
    beam = ub.Beam((6, 0, 0), (0, 8, 0), section, cells=10)
    pulse = ub.Table([0, 2.5, 5], [0, 200, 0])
    push = ub.PointLoad(beam.start, force=(0.1, 0, 0), moment=(0, -0.5, -1), amplitude=pulse)
    return ub.Scene([beam], loads=[push], **more)


def test_flight_in_space():
    """Energy and positions at 5 s, computed by a separate program with quaternions and NumPy."""
    run = ub.simulate(flight(), ub.EnergyMomentum(), t=(0, 5), dt=0.02, progress=False)
    (beam,) = run.scene.beams
    assert np.allclose(run.energy.total[-1], 723.36647059, rtol=1e-11)
    moved = run.displacement(beam.start)[-1, :3]
    assert np.abs(moved - [13.25048125, 1.63440641, -2.07060071]).max() < 1e-7
    free = ub.simulate(run.scene, ub.EnergyMomentum(), t=(5, 25), dt=0.1, start=run, progress=False)
    total = free.energy.total
    assert np.ptp(total) < 1e-12 * total[0]


def test_restart_in_space_changes_no_bit():
    whole, first = (
        ub.simulate(in_space(TURNS[1]), ub.EnergyMomentum(), t=(0, t), dt=0.05, progress=False)
        for t in (2, 1)
    )
    second = ub.simulate(
        first.scene, ub.EnergyMomentum(), t=(1, 2), dt=0.05, start=first, progress=False
    )
    for one, other in zip(whole.scene.beams, first.scene.beams, strict=True):
        assert (whole.displacement(one.at(0.3))[-1] == second.displacement(other.at(0.3))[-1]).all()


@dataclass(frozen=True)
class Stiffening(ub.extend.ConnectorLaw):
    """A law of a user."""

    def energy(self, motion, *_):
        return 30 * motion**2 + 100 * motion**4


@pytest.mark.parametrize("law", [*LAWS, "own law"])
def test_start_with_a_connector_at_an_arm(law):
    """The motion at the beginning depends on the rotation of the body in the earlier run."""
    beam = ub.Beam((0, 0, 0), (2, 1, 0), ub.Section(**STIFF, **OTHER), cells=3)
    wheel = ub.Body((2.5, 1, 0.3), mass=2.0, inertia=(1, 1, 1.5))
    one = LAWS.get(law, Stiffening())
    pull = ub.Stretch(wheel.at(2.6, 1, 0.4), ub.ground(3, 0, 2), one)
    scene = ub.Scene(
        [beam], bodies=[wheel], supports=[ub.Clamped(beam.start)], connectors=[pull],
        joints=[ub.Revolute(beam.end, wheel.at(2, 1, 0), axis=(0, 0, 1))],
        loads=[ub.Gravity((0, 0, -9.81))],
    )  # fmt: skip
    whole = ub.simulate(scene, ub.EnergyMomentum(), t=(0, 1), dt=0.05, progress=False)
    first = ub.simulate(scene, ub.EnergyMomentum(), t=(0, 0.5), dt=0.05, progress=False)
    second = ub.simulate(
        scene, ub.EnergyMomentum(), t=(0.5, 1), dt=0.05, start=first, progress=False
    )
    results = (lambda run: run.displacement(wheel.middle)), (lambda run: run.connector(pull).force)
    for result in results:
        there = result(whole)[10:]
        assert np.abs(result(second) - there).max() < 1e-11 * max(1.0, np.abs(there).max())


def bend(cells):
    """Arc of 45 degrees under a force normal to its plane (Bathe and Bolourchi 1979)."""
    E, A, I = 1e7, 1.0, 1 / 12
    section = ub.Section(EA=E * A, GA=E * A / 2, EI=E * I, GA3=E * A / 2, EI2=E * I, GJ=E * I)

    def arc(s):
        angle = s * np.pi / 4
        return 100 * np.sin(angle), 100 * (1 - np.cos(angle)), 0.0

    beam = ub.Beam.along(arc, section, cells=cells)
    load = ub.PointLoad(beam.end, force=(0, 0, 600.0), amplitude=lambda t: t)
    return ub.Scene([beam], supports=[ub.Clamped(beam.start)], loads=[load])


def test_bend_in_statics():
    """The tip converges with the square of the cells to a solution of the differential equation.

    It was computed by shooting.
    """
    exact, errors = np.array([47.15010, 15.68469, 53.47548]), []
    for cells in (8, 16):
        run = ub.simulate(bend(cells), ub.Static(), t=(0, 1), dt=0.25, progress=False)
        tip = run.position(run.scene.beams[0].end)[-1]
        errors.append(np.linalg.norm(tip - exact))
        foot = run.reaction(run.scene.supports[0])[-1]
        assert np.abs(foot[:3] - [0, 0, -600.0]).max() < 1e-6
        assert np.abs(foot[3:] - np.cross(tip, [0, 0, -600.0])).max() < 1e-5
    assert 1.9 < np.log2(errors[0] / errors[1]) < 2.1
    assert errors[1] < 0.05


def test_heavy_top():
    """A body on a ball joint against its differential equation: second order in the step."""
    mass, arm, g, J = 2.0, 0.7, 9.81, np.array([0.5, 0.5, 0.2])
    tilt = Rotation.from_rotvec([0.0, 0.4, 0.0])
    centre, spin = tilt.apply([0, 0, arm]), tilt.apply([0, 0, 30.0])
    tensor = tilt.as_matrix() @ np.diag(J) @ tilt.as_matrix().T
    about = np.diag(J) + mass * arm**2 * np.diag([1.0, 1.0, 0.0])

    def rates(q, w):
        moment = np.cross([0, 0, arm], Rotation.from_quat(q).inv().apply([0, 0, -mass * g]))
        change = np.linalg.solve(about, moment - np.cross(w, about @ w))
        x, y, z, r = q
        a, b, c = w
        return np.array([r * a + y * c - z * b, r * b + z * a - x * c, r * c + x * b - y * a,
                         -x * a - y * b - z * c]) / 2, change  # fmt: skip

    q, w, h, n = tilt.as_quat(), np.array([0, 0, 30.0]), 0.5 / 4000, 4000
    for _ in range(n):  # the method of Runge and Kutta of fourth order
        k1 = rates(q, w)
        k2 = rates(q + h / 2 * k1[0], w + h / 2 * k1[1])
        k3 = rates(q + h / 2 * k2[0], w + h / 2 * k2[1])
        k4 = rates(q + h * k3[0], w + h * k3[1])
        q = q + h / 6 * (k1[0] + 2 * k2[0] + 2 * k3[0] + k4[0])
        w = w + h / 6 * (k1[1] + 2 * k2[1] + 2 * k3[1] + k4[1])
    exact, errors = Rotation.from_quat(q).apply([0, 0, arm]), []
    for dt in (0.01, 0.005):
        top = ub.Body(tuple(centre), mass=mass, inertia=tensor, name="top")
        scene = ub.Scene(
            bodies=[top], joints=[ub.Spherical(ub.ground(0, 0, 0), top.at(0, 0, 0))],
            loads=[ub.Gravity((0, 0, -g))],
            initial=[ub.Velocity([top], linear=(0, 0, 0), angular=tuple(spin), about=(0, 0, 0))],
        )  # fmt: skip
        run = ub.simulate(scene, ub.EnergyMomentum(), t=(0, 0.5), dt=dt, progress=False)
        path = run.position(top.middle)
        assert np.abs(np.linalg.norm(path, axis=1) - arm).max() < 1e-13
        assert run.energy.worst < 1e-10
        errors.append(np.linalg.norm(path[-1] - exact))
    assert 1.9 < np.log2(errors[0] / errors[1]) < 2.1


def test_a_revolute_joint_keeps_its_axis():
    """Two flying beams about a skew axis: energy is constant, and the axes stay together."""
    section, axis = ub.Section(**STIFF, **OTHER), np.array([1.0, 2.0, 3.0]) / np.sqrt(14)
    first = ub.Beam((0, 0, 0), (4, 0, 0), section, cells=4)
    second = ub.Beam((4, 0, 0), (4, 3, 1), section, cells=4)
    joint = ub.Revolute(first.end, second.start, axis=tuple(axis))
    spin = ub.Velocity([first], linear=(1, 0, 2), angular=(0.3, 1.0, -0.5))
    still = ub.Velocity([second], linear=spin.at(4, 0, 0)[:3], about=(4, 0, 0), angular=(0, 0, 0.2))
    scene = ub.Scene([first, second], joints=[joint], initial=[spin, still])
    with pytest.raises(ub.ArgumentError, match="would move apart"):
        ub.simulate(scene, ub.EnergyMomentum(), t=(0, 1), dt=0.1, progress=False)
    along = np.array(spin.angular) + 0.7 * axis
    turning = ub.Velocity(
        [second], linear=spin.at(4, 0, 0)[:3], about=(4, 0, 0), angular=tuple(along)
    )
    scene = ub.Scene([first, second], joints=[joint], initial=[spin, turning])
    run = ub.simulate(scene, ub.EnergyMomentum(), t=(0, 10), dt=0.1, progress=False)
    total = run.energy.total
    assert np.ptp(total) < 1e-11 * total[0]
    axes = [
        Rotation.from_rotvec(run.displacement(place)[:, 3:]).apply(axis) for place in joint.places
    ]
    assert np.abs(axes[0] - axes[1]).max() < 1e-12
    relative = Rotation.from_rotvec(run.displacement(joint.places[0])[:, 3:]).inv()
    relative = relative * Rotation.from_rotvec(run.displacement(joint.places[1])[:, 3:])
    assert np.linalg.norm(relative.as_rotvec(), axis=1).max() > 1.0


def test_momenta_are_constant_in_flight():
    run = ub.simulate(flight(), ub.EnergyMomentum(), t=(0, 10), dt=0.1, progress=False)
    free = run.momentum()[run.times >= 5.0]
    for some in (slice(0, 3), slice(3, 6)):
        size = np.linalg.norm(free[0, some])
        assert size > 1.0
        assert np.abs(free[:, some] - free[0, some]).max() < 1e-11 * size


def test_section_forces_of_a_cantilever():
    """Small loads: forces and moments of beam theory, in the axes of the section."""
    section = ub.Section(**STIFF, **OTHER)
    up, length = np.array([0.6, 0.0, 0.8]), 4.0  # the beam is along y
    beam = ub.Beam((0, 0, 0), (0, length, 0), section, cells=4, up=tuple(up))
    third = np.cross([0, 1, 0], up)
    force, moment = 1e-4 * (3.0 * up - 2.0 * third + [0, 5.0, 0]), 1e-4 * np.array([0, 7.0, 0])
    load = ub.PointLoad(beam.end, force=tuple(force), moment=tuple(moment))
    scene = ub.Scene([beam], supports=[ub.Clamped(beam.start)], loads=[load])
    run = ub.simulate(scene, ub.Static(), t=(0, 1), dt=1.0, progress=False)
    arm = length - (np.arange(4) + 0.5) * length / 4
    expected = 1e-4 * np.column_stack(
        [np.full(4, 5.0), np.full(4, 3.0), np.full(4, -2.0), np.full(4, 7.0), 2 * arm, 3 * arm]
    )
    assert np.abs(run.section_forces(beam) - expected).max() < 1e-4 * np.abs(expected).max()
    bent = 1e-4 * (3.0 * length**3 / 3 / section.EI + 3.0 * length / section.GA)
    tip = run.displacement(beam.end)[-1]
    assert abs(tip[:3] @ up / bent - 1) < 2e-2  # four cells


def test_velocity_of_a_point_of_a_body():
    """A ball turns about a constant axis and flies along a line."""
    ball, spin, speed = ub.Body((1, 2, 3), mass=2.0, inertia=(4, 4, 4)), (1, -2, 2), (3.0, 0, 1)
    point = ball.at(1, 2.5, 2)
    start = ub.Velocity([ball], angular=spin, linear=speed, about=(1, 2, 3))
    scene = ub.Scene(bodies=[ball], initial=[start])
    run = ub.simulate(scene, ub.EnergyMomentum(), t=(0, 0.2), dt=0.05, progress=False)
    arms = run.position(point) - run.position(ball.middle)
    assert np.abs(run.velocity(point)[:, :3] - speed - np.cross(spin, arms)).max() < 1e-12
    turned = run.displacement(point)[1:, 3:] / run.times[1:, None]
    assert np.abs(turned / spin - 1).max() < 0.05**2 * 9 / 12  # Cayley vectors, |spin| = 3


def crane():
    """A spinning wheel on a clamped frame, with a link to the ground."""
    section = ub.Section(**STIFF, **OTHER)
    leg = ub.Beam((0, 0, 0), (0, 0, 1.5), section, up=(1, 0, 0), cells=2)
    arm = ub.Beam((0, 0, 1.5), (1, 0, 1.5), section, cells=3)
    wheel = ub.Body((1, 0, 1.5), mass=20.0, inertia=(0.4, 0.7, 0.4))
    spring = ub.Stretch(wheel.at(1.2, 0.1, 1.5), ub.ground(2, 1, 0), ub.Spring(100.0))
    return ub.Scene(
        [leg, arm], bodies=[wheel], connectors=[spring],
        joints=[ub.Rigid(leg.end, arm.start), ub.Revolute(arm.end, wheel.middle, axis=(0, 1, 0))],
        supports=[ub.Clamped(leg.start)], loads=[ub.Gravity((0, 0, -9.81))],
        initial=[ub.Velocity([wheel], angular=(0, 30, 0), linear=(0, 0, 0), about=(1, 0, 1.5))],
    )  # fmt: skip


def test_files_have_the_results(shared_path):
    """XDMF and VTKHDF have the same numbers, which are those of the solution."""
    import h5py

    scene, files = crane(), (ub.VTKHDF(shared_path / "a.hdf"), ub.XDMF(shared_path / "a.xdmf"))
    run = ub.simulate(scene, ub.EnergyMomentum(), t=(0, 0.1), dt=0.02, record=files, progress=False)
    text = (shared_path / "a.xdmf").read_text("utf-8")
    with h5py.File(shared_path / "a.hdf") as file:
        points, cells = file["VTKHDF/PointData"], file["VTKHDF/CellData"]
        last = {name: values[-len(values) // 6 :] for name, values in points.items()}
        forces = {name: values[-len(values) // 6 :] for name, values in cells.items()}
        for name, values in last.items():
            number = repr(values.ravel().tolist()[-1])
            assert number in text.rpartition(f'Name="{name}"')[2]
    ends = [arm.end for arm in scene.beams[1:]] + [scene.connectors[0].a]
    for at, place in zip((6, -2), ends, strict=True):
        for (moving, turning), values in (
            (("displacement", "rotation"), run.displacement(place)),
            (("velocity", "angular velocity"), run.velocity(place)),
        ):
            given = np.hstack([last[moving][at], last[turning][at]])
            assert np.abs(given - values[-1]).max() < 1e-14
    rows = np.column_stack([forces[name] for name in ("N", "V2", "V3", "T", "M2", "M3")])
    assert (rows[:5] == np.vstack([run.section_forces(beam) for beam in scene.beams])).all()
    assert rows[-1, 0] == run.connector(scene.connectors[0]).force[-1] != 0


@pytest.mark.serial
@pytest.mark.parametrize("quantity", ["N", "V", "T", "M"])
def test_rendered_picture(tmp_path, quantity):
    from matplotlib.image import imread

    pytest.importorskip("pyvista")
    run = ub.simulate(crane(), ub.EnergyMomentum(), t=(0, 0.1), dt=0.02, progress=False)
    camera = ub.Camera(follow=run.scene.beams[1].end, width=4.0)
    path = tmp_path / "crane.png"
    ub.render(run, path, quantity=quantity, camera=camera, size=(320, 192))
    picture = imread(path)[..., :3]
    colored = np.ptp(picture, axis=2) > 0.2
    assert 0.005 < colored.mean() < 0.5
    with pytest.raises(ub.ArgumentError, match="along z, which is upwards"):
        ub.render(run, path, camera=ub.Camera((0, 0, -1)))


@pytest.mark.parametrize("force", [1e-6, 1.0, 100.0])
def test_statics_of_small_loads_converge(force):
    """A steel tube, four linear cells: the bending part is 1 - 1/(4 n²) of the exact one."""
    section = st.steel("HSS8X4X1/4", E=200e9, nu=0.3, rho=7850)
    beam = ub.Beam((0, 0, 0), (3, 0, 0), section, cells=4, up=(0, 1, 0))
    load = ub.PointLoad(beam.end, force=(0, force, force), amplitude=lambda t: t)
    scene = ub.Scene([beam], supports=[ub.Clamped(beam.start)], loads=[load])
    tip = ub.simulate(scene, ub.Static(), t=(0, 1), dt=1.0, progress=False).displacement(beam.end)
    bending, shear = [section.EI, section.EI2], [section.GA, section.GA3]
    exact = 9.0 / np.array(bending) * (1 - 1 / (4 * 4**2)) + 3.0 / np.array(shear)
    assert np.abs(tip[-1, 1:3] / force / exact - 1).max() < 1e-5


BEAM = ub.Beam((0, 0, 0), (1, 0, 0), ub.Section(**STIFF, **OTHER), name="arm")
PLANAR = ub.Beam((0, 0), (1, 0), ub.Section(**STIFF))
BALL = ub.Body((0, 0, 0), mass=1.0, inertia=(1, 1, 1), name="ball")
WRONG = {
    "mixed points": (lambda: ub.Scene([BEAM, PLANAR]), "two coordinates"),
    "mixed ends": (lambda: ub.Beam((0, 0), (1, 0, 0), BEAM.section), "must both have"),
    "up along the beam": (
        lambda: ub.Beam((0, 0, 0), (0, 0, 2), BEAM.section), "up = (0.0, 0.0, 1.0) is along",
    ),
    "up in the plane": (lambda: ub.Beam((0, 0), (1, 0), BEAM.section, up=(0, 1)), "in space"),
    "up along a short leg": (
        lambda: ub.Beam.polyline([(0, 0, 0), (1, 0, 0), (1, 0, 0.1)], BEAM.section, cells=2),
        "is along the beam",
    ),
    "axis of a hinge": (
        lambda: ub.Beam.polyline(
            [(1, 0, -1), (0, 0, 0), (1, 0, 1)], BEAM.section, cells=4,
            hinges={0.5: ub.Softening(1.0, 1.0)},
        ), "is along the beam",
    ),
    "ring around up": (
        lambda: ub.Beam(
            (0, 0, 0), (-1, 0, 1), BEAM.section, cells=9,
            curve=lambda s: (np.sin(1.5 * np.pi * s), 0, 1 - np.cos(1.5 * np.pi * s)),
        ), "axis 2 of the section is reversed at s = 0.333",
    ),
    "turn without axis": (
        lambda: ub.Turn(ub.ground(0, 0, 0), BEAM.end, ub.Spring(1.0), axis=None),
        "in space give axis=(x, y, z)",
    ),
    "release": (
        lambda: ub.Scene(
            [BEAM], joints=[ub.Release(BEAM.end, ub.ground(*BEAM.end.point), free="V")]
        ), "Release is for scenes in the plane",
    ),
    "no torsion": (
        lambda: ub.Scene([ub.Beam((0, 0, 0), (1, 0, 0), PLANAR.section)]), "no GA3, EI2, GJ",
    ),
    "planar force": (
        lambda: ub.Scene([BEAM], loads=[ub.PointLoad(BEAM.end, force=(1, 0))]),
        "must have 3 components",
    ),
    "number as a moment": (
        lambda: ub.Scene([BEAM], loads=[ub.PointLoad(BEAM.end, moment=1.0)]),
        "must have 3 components",
    ),
    "vector as a moment": (
        lambda: ub.Scene([PLANAR], loads=[ub.PointLoad(PLANAR.end, moment=(0, 0, 1))]),
        "must have 1 components",
    ),
    "follower at an arm": (
        lambda: ub.Scene(
            bodies=[BALL], loads=[ub.FollowerLoad(BALL.at(1, 0, 0), force=(1, 0, 0))]
        ), "not the centre of the body",
    ),
    "moving mass": (
        lambda: ub.Scene([BEAM], loads=[ub.MovingLoad(BEAM, abs, mass=1.0)]), "masses that move",
    ),
    "revolute without axis": (
        lambda: ub.Revolute(ub.ground(0, 0, 0), BEAM.start), "give axis=(x, y, z)",
    ),
    "axis of length zero": (
        lambda: ub.Revolute(ub.ground(0, 0, 0), BEAM.start, axis=(0, 0, 0)), "zero length",
    ),
    "no such body": (
        lambda: ub.Body((0, 0, 0), mass=1.0, inertia=(1, 1, 3)), "no body has them",
    ),
    "scheme": (
        lambda: ub.Simulation(ub.Scene([BEAM]), ub.Newmark()), "rotations in space need",
    ),
    "degree": (
        lambda: ub.Simulation(ub.Scene([BEAM]), ub.EnergyMomentum(), mesh=ub.Mesh(degree=2)),
        "degree 1",
    ),
}  # fmt: skip


@pytest.mark.parametrize("case", WRONG)
def test_errors_before_a_run(case):
    make, words = WRONG[case]
    with pytest.raises(ub.ModelError, match=re.escape(words)):
        make()


@pytest.mark.serial
def test_what_is_planar_says_so():
    scene = ub.Scene([BEAM], supports=[ub.Clamped(BEAM.start)])
    with pytest.raises(ub.ModelError, match="forms: only for scenes in the plane"):
        _ = ub.Simulation(scene, ub.EnergyMomentum()).dolfinx.forms


def pendulums():
    """Two bodies on ball joints at their arms."""
    upper = ub.Body((0.15, 0, -0.2), mass=1.0, inertia=(0.03, 0.02, 0.01), name="upper")
    lower = ub.Body((0.3, 0.25, -0.4), mass=2.0, inertia=(0.02, 0.05, 0.04), name="lower")
    elbow = [body.at(0.3, 0, -0.4) for body in (upper, lower)]
    joints = [ub.Spherical(ub.ground(0, 0, 0), upper.at(0, 0, 0)), ub.Spherical(*elbow)]
    return ub.Scene(bodies=[upper, lower], joints=joints, loads=[ub.Gravity((0, 0, -9.81))])


@pytest.mark.parametrize("dt", [1e-3, 1e-6])
def test_joints_at_arms_are_exact_at_rest(dt):
    """Motions of 1e-12 of the arms have their own digits."""
    newton = ub.Newton(rtol=1e-13)
    run = ub.simulate(
        pendulums(), ub.EnergyMomentum(), t=(0, 20 * dt), dt=dt, newton=newton, progress=False
    )
    moved = np.abs(run.displacement(run.scene.bodies[1].at(0.3, 0, -0.4))[-1, :3])
    assert 0 < moved.max() < 9.81 * (20 * dt) ** 2


def test_a_failed_step_names_the_residual():
    scene = pendulums()
    with pytest.raises(ub.ConvergenceError, match=r"inertia .* N"):
        ub.simulate(scene, ub.EnergyMomentum(), t=(0, 1), dt=0.5, progress=False,
                    newton=ub.Newton(max_iterations=1))  # fmt: skip
