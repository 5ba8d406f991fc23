# SPDX-License-Identifier: MIT
"""Scenes in space: equality with the plane, balances, restart, and errors before a run."""

import re
from dataclasses import replace

from mpi4py import MPI

import numpy as np
import pytest
from into_space import EXACT, SKEW, InSpace, same_in_space
from scipy.spatial.transform import Rotation
from user_classes import Stiffening

import ufl_beam as ub
import ufl_beam.structures as st

STIFF = {"EA": 1e4, "GA": 1e4, "EI": 500.0, "rhoA": 1.0, "rhoI": 10.0}
OTHER = {"GA3": 7e3, "EI2": 300.0, "GJ": 400.0, "rhoI2": 6.0}
PLANAR = ub.Section(**STIFF)


def in_plane(connectors=lambda tip, pin: []):
    """Two beams with a rigid joint on a pin."""
    long = ub.Beam((6, 0), (0, 8), PLANAR, cells=10)
    short = ub.Beam((0, 8), (3, 9), PLANAR, cells=4)
    push = ub.PointLoad(long.start, force=(8, 0), moment=-80.0, amplitude=lambda t: t < 0.5)
    return ub.Scene(
        [long, short], joints=[ub.Rigid(long.end, short.start)],
        supports=[ub.Pinned(short.end)], connectors=connectors(long.start, short.end),
        loads=[push, ub.LineLoad(long, force=(1, -2)), ub.Gravity((0.5, -1))],
    )  # fmt: skip


def in_space(**more):
    """The same in a turned plane, on a pin about which it may turn in any direction."""
    scene = InSpace(in_plane(**more), SKEW).scene
    return replace(scene, supports=[ub.Pinned(x.place) for x in scene.supports])


@pytest.mark.parametrize("turn", [Rotation.identity(), SKEW])
@pytest.mark.parametrize("scheme", [ub.EnergyMomentum(), ub.EnergyMomentum(alpha=0.1)], ids=str)
def test_a_planar_scene_in_space_has_the_same_motion(scheme, turn):
    """To round-off, also in a turned plane, and nothing moves out of the plane."""
    same_in_space(in_plane(), scheme, turn=turn)


LAWS = {
    "spring": ub.Spring(40.0), "hardening spring": ub.Spring(300.0, ub.ElastoPlastic(20.0)),
    "damper": ub.Damper(15.0), "stop": ub.Stop(200.0, low=-0.02, high=0.05),
    "motor": ub.PrescribedMotion(lambda t: 0.1 * t * t),
    "force": ub.PrescribedForce(lambda t: 30 * t),
    "force law": ub.ForceLaw(lambda motion, rate: 20 * motion + 3 * rate),
}  # fmt: skip
KINDS = {
    "Stretch": lambda tip, pin, law: ub.Stretch(tip, ub.ground(9, -2), law),
    "Slide": lambda tip, pin, law: ub.Slide(tip, ub.ground(9, -2), law, axis=(0.6, 0.8)),
    "Turn": lambda tip, pin, law: ub.Turn(ub.ground(3, 9), pin, law),
}


@pytest.mark.parametrize("law", LAWS)
@pytest.mark.parametrize("kind", KINDS)
def test_connectors_have_the_same_motion_in_space(kind, law):
    same_in_space(in_plane(lambda *ends: [KINDS[kind](*ends, LAWS[law])]), ub.EnergyMomentum())


def with_ball(joint, moving):
    """A beam with a ball: clamped in statics, else on a pin about which both turn at first."""
    beam = ub.Beam((0, 0), (2, 0), PLANAR, cells=4)
    ball = ub.Body((2.5, 0.3), mass=3.0, inertia=0.7)
    start = [ub.Velocity([beam, ball], angular=0.5, about=(0, 0))] * moving
    loads = [ub.Gravity((2, -9), amplitude=lambda t: min(1.0, 0.5 + t))]
    foot = (ub.Pinned if moving else ub.Clamped)(beam.start)
    parts = {"bodies": [ball], "joints": [joint(beam, ball)], "supports": [foot]}
    return ub.Scene([beam], **parts, loads=loads, initial=start)


JOINTS = {
    "rigid": lambda beam, ball: ub.Rigid(beam.end, ball.at(2, 0)),
    "rigid link": lambda beam, ball: ub.RigidLink(beam.at(0.5), ball.middle),
    "revolute": lambda beam, ball: ub.Revolute(beam.end, ball.at(2, 0)),
    "prismatic": lambda beam, ball: ub.Prismatic(beam.end, ball.at(2, 0), axis=(0.6, 0.8)),
    "link": lambda beam, ball: ub.Link(beam.at(0.5), ball.middle),
}
BOTH = [(joint, ub.EnergyMomentum()) for joint in JOINTS] + [
    (joint, scheme)
    for joint in ("rigid", "rigid link")
    for scheme in (ub.Static(), ub.EnergyMomentumStatic())
]


@pytest.mark.parametrize(("joint", "scheme"), BOTH, ids=str)
def test_joints_have_the_same_motion_in_space(joint, scheme):
    same_in_space(with_ball(JOINTS[joint], scheme.dynamic), scheme)


def test_a_slider_that_may_turn_moves_along_and_about_the_axis_only():
    """[closed] A body on the ground: m u'' = F and J ω' = M along the axis, in Cayley steps."""
    axis, m, J, dt = np.array([1.0, 2.0, 2.0]) / 3, 2.0, 0.5, 0.1
    at, force, moment = (0.3, 0.1, -0.2), (1.0, -3.0, 2.0), (0.4, 0.3, 0.1)
    body = ub.Body(at, mass=m, inertia=(J, J, J))
    slot = ub.Prismatic(ub.ground(*at), body.middle, axis=axis, turning=True)
    load = ub.PointLoad(body.middle, force=force, moment=moment)
    scene = ub.Scene(bodies=[body], joints=[slot], loads=[load])
    run = ub.simulate(scene, ub.EnergyMomentum(), t=(0, 1), dt=dt, newton=EXACT)
    F, M = axis @ force, axis @ moment
    changes = M / J * dt**2 * (np.arange(10) + 0.5)
    turns = np.append(0.0, np.cumsum(2 * np.arctan(changes / 2)))
    expected = np.outer(F * run.times**2 / (2 * m), axis), np.outer(turns, axis)
    np.testing.assert_allclose(run.displacement(body.middle), np.hstack(expected), atol=1e-13)


def flight():
    """A free beam that turns and bends in space, pushed until t = 5 s."""
    section = ub.Section(EA=1e4, GA=1e4, EI=500.0, rhoA=1.0, rhoI=10.0, GA3=1e4, EI2=500.0,
                         GJ=500.0, rhoI2=10.0)  # fmt: skip
    beam = ub.Beam((6, 0, 0), (0, 8, 0), section, cells=10)
    pulse = ub.Table([0, 2.5, 5], [0, 200, 0])
    push = ub.PointLoad(beam.start, force=(0.1, 0, 0), moment=(0, -0.5, -1), amplitude=pulse)
    return ub.Scene([beam], loads=[push])


@pytest.mark.skipif(MPI.COMM_WORLD.size > 1, reason="for one process")
def test_20_000_steps_conserve_energy_and_momenta():
    """Positions of 10 km have digits of 2e-12 m, which are 2e-10 m/s in a step of 0.02 s."""
    tight = ub.Newton(rtol=1e-13)
    run = ub.simulate(flight(), ub.EnergyMomentum(), t=(0, 405), dt=0.02, newton=tight, every=50)
    free = run.times >= 5
    energy, momenta = run.energy.total[free], run.momentum()[free].reshape(-1, 2, 3)
    assert np.ptp(energy) < 1e-11 * energy[0]
    drifts = np.linalg.norm(momenta - momenta[0], axis=2).max(axis=0)
    assert (drifts < 1e-11 * np.linalg.norm(momenta[0], axis=1)).all()


def test_flight_in_space():
    """Energy and positions at 5 s, computed by a separate program with quaternions and NumPy."""
    run = ub.simulate(flight(), ub.EnergyMomentum(), t=(0, 5), dt=0.02)
    (beam,) = run.scene.beams
    assert np.allclose(run.energy.total[-1], 723.36647059, rtol=1e-11)
    moved = run.displacement(beam.start)[-1, :3]
    assert np.abs(moved - [13.25048125, 1.63440641, -2.07060071]).max() < 1e-7


@pytest.mark.parametrize("law", [*LAWS, "own law"])
def test_start_with_a_connector_at_an_arm(law):
    """The motion at the beginning depends on the rotation of the body in the earlier run."""
    beam = ub.Beam((0, 0, 0), (2, 1, 0), ub.Section(**STIFF, **OTHER), cells=3)
    wheel = ub.Body((2.5, 1, 0.3), mass=2.0, inertia=(1, 1, 1.5))
    one = LAWS.get(law, Stiffening(60.0, 400.0))
    pull = ub.Stretch(wheel.at(2.6, 1, 0.4), ub.ground(3, 0, 2), one)
    scene = ub.Scene(
        [beam], bodies=[wheel], supports=[ub.Clamped(beam.start)], connectors=[pull],
        joints=[ub.Revolute(beam.end, wheel.at(2, 1, 0), axis=(0, 0, 1))],
        loads=[ub.Gravity((0, 0, -9.81))],
    )  # fmt: skip
    whole = ub.simulate(scene, ub.EnergyMomentum(), t=(0, 1), dt=0.05)
    first = ub.simulate(scene, ub.EnergyMomentum(), t=(0, 0.5), dt=0.05)
    second = ub.simulate(scene, ub.EnergyMomentum(), t=(0.5, 1), dt=0.05, start=first)
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
        run = ub.simulate(bend(cells), ub.Static(), t=(0, 1), dt=0.25)
        tip = run.position(run.scene.beams[0].end)[-1]
        errors.append(np.linalg.norm(tip - exact))
        foot = run.reaction(run.scene.supports[0])[-1]
        assert np.abs(foot[:3] - [0, 0, -600.0]).max() < 1e-6
        assert np.abs(foot[3:] - np.cross(tip, [0, 0, -600.0])).max() < 1e-5
    assert 1.9 < np.log2(errors[0] / errors[1]) < 2.1
    assert errors[1] < 0.05


def test_velocities_must_agree_with_a_revolute_joint():
    section = ub.Section(**STIFF, **OTHER)
    first = ub.Beam((0, 0, 0), (4, 0, 0), section, cells=4)
    second = ub.Beam((4, 0, 0), (4, 3, 1), section, cells=4)
    joint = ub.Revolute(first.end, second.start, axis=(1, 2, 3))
    spin = ub.Velocity([first], linear=(1, 0, 2), angular=(0.3, 1.0, -0.5))
    still = ub.Velocity([second], linear=spin.at(4, 0, 0)[:3], about=(4, 0, 0), angular=(0, 0, 0.2))
    scene = ub.Scene([first, second], joints=[joint], initial=[spin, still])
    with pytest.raises(ub.ArgumentError, match="would move apart"):
        ub.simulate(scene, ub.EnergyMomentum(), t=(0, 1), dt=0.1)


def test_section_forces_of_a_cantilever():
    """Small loads: forces and moments of beam theory, in the axes of the section."""
    section = ub.Section(**STIFF, **OTHER)
    up, length = np.array([0.6, 0.0, 0.8]), 4.0  # the beam is along y
    beam = ub.Beam((0, 0, 0), (0, length, 0), section, cells=4, up=tuple(up))
    third = np.cross([0, 1, 0], up)
    force, moment = 1e-4 * (3.0 * up - 2.0 * third + [0, 5.0, 0]), 1e-4 * np.array([0, 7.0, 0])
    load = ub.PointLoad(beam.end, force=tuple(force), moment=tuple(moment))
    scene = ub.Scene([beam], supports=[ub.Clamped(beam.start)], loads=[load])
    run = ub.simulate(scene, ub.Static(), t=(0, 1), dt=1.0)
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
    run = ub.simulate(scene, ub.EnergyMomentum(), t=(0, 0.2), dt=0.05)
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
    run = ub.simulate(scene, ub.EnergyMomentum(), t=(0, 0.1), dt=0.02, record=files)
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
    run = ub.simulate(crane(), ub.EnergyMomentum(), t=(0, 0.1), dt=0.02)
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
    tip = ub.simulate(scene, ub.Static(), t=(0, 1), dt=1.0).displacement(beam.end)
    bending, shear = [section.EI, section.EI2], [section.GA, section.GA3]
    exact = 9.0 / np.array(bending) * (1 - 1 / (4 * 4**2)) + 3.0 / np.array(shear)
    assert np.abs(tip[-1, 1:3] / force / exact - 1).max() < 1e-5


BEAM = ub.Beam((0, 0, 0), (1, 0, 0), ub.Section(**STIFF, **OTHER), name="arm")
FLAT = ub.Beam((0, 0), (1, 0), PLANAR)
BALL = ub.Body((0, 0, 0), mass=1.0, inertia=(1, 1, 1), name="ball")
WRONG = {
    "mixed points": (lambda: ub.Scene([BEAM, FLAT]), "two coordinates"),
    "mixed ends": (lambda: ub.Beam((0, 0), (1, 0, 0), BEAM.section), "must both have"),
    "up along the beam": (
        lambda: ub.Beam((0, 0, 0), (0, 0, 2), BEAM.section),
        "up = (0.0, 0.0, 1.0) is along",
    ),
    "up in the plane": (lambda: ub.Beam((0, 0), (1, 0), BEAM.section, up=(0, 1)), "in space"),
    "up along a short leg": (
        lambda: ub.Beam.polyline([(0, 0, 0), (1, 0, 0), (1, 0, 0.1)], BEAM.section, cells=2),
        "is along the beam",
    ),
    "axis of a hinge": (
        lambda: ub.Beam.polyline(
            [(1, 0, -1), (0, 0, 0), (1, 0, 1)],
            BEAM.section,
            cells=4,
            hinges={0.5: ub.Softening(1.0, 1.0)},
        ),
        "is along the beam",
    ),
    "ring around up": (
        lambda: ub.Beam(
            (0, 0, 0),
            (-1, 0, 1),
            BEAM.section,
            cells=9,
            curve=lambda s: (np.sin(1.5 * np.pi * s), 0, 1 - np.cos(1.5 * np.pi * s)),
        ),
        "axis 2 of the section is reversed at s = 0.333",
    ),
    "turn without axis": (
        lambda: ub.Turn(ub.ground(0, 0, 0), BEAM.end, ub.Spring(1.0), axis=None),
        "in space give axis=(x, y, z)",
    ),
    "release": (
        lambda: ub.Scene(
            [BEAM], joints=[ub.Release(BEAM.end, ub.ground(*BEAM.end.point), free="V")]
        ),
        "Release is for scenes in the plane",
    ),
    "no torsion": (lambda: ub.Scene([ub.Beam((0, 0, 0), (1, 0, 0), PLANAR)]), "no GA3, EI2, GJ"),
    "planar force": (
        lambda: ub.Scene([BEAM], loads=[ub.PointLoad(BEAM.end, force=(1, 0))]),
        "must have 3 components",
    ),
    "number as a moment": (
        lambda: ub.Scene([BEAM], loads=[ub.PointLoad(BEAM.end, moment=1.0)]),
        "must have 3 components",
    ),
    "vector as a moment": (
        lambda: ub.Scene([FLAT], loads=[ub.PointLoad(FLAT.end, moment=(0, 0, 1))]),
        "must have 1 components",
    ),
    "follower at an arm": (
        lambda: ub.Scene(bodies=[BALL], loads=[ub.FollowerLoad(BALL.at(1, 0, 0), force=(1, 0, 0))]),
        "not the centre of the body",
    ),
    "moving mass": (
        lambda: ub.Scene([BEAM], loads=[ub.MovingLoad(BEAM, abs, mass=1.0)]),
        "masses that move",
    ),
    "revolute without axis": (
        lambda: ub.Revolute(ub.ground(0, 0, 0), BEAM.start),
        "give axis=(x, y, z)",
    ),
    "axis of length zero": (
        lambda: ub.Revolute(ub.ground(0, 0, 0), BEAM.start, axis=(0, 0, 0)),
        "zero length",
    ),
    "no such body": (lambda: ub.Body((0, 0, 0), mass=1.0, inertia=(1, 1, 3)), "no body has them"),
    "scheme": (lambda: ub.Simulation(ub.Scene([BEAM]), ub.Newmark()), "rotations in space need"),
    "degree": (
        lambda: ub.Simulation(ub.Scene([BEAM]), ub.EnergyMomentum(), mesh=ub.Mesh(degree=2)),
        "degree 1",
    ),
}


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
    run = ub.simulate(pendulums(), ub.EnergyMomentum(), t=(0, 20 * dt), dt=dt, newton=newton)
    moved = np.abs(run.displacement(run.scene.bodies[1].at(0.3, 0, -0.4))[-1, :3])
    assert 0 < moved.max() < 9.81 * (20 * dt) ** 2


def test_a_failed_step_names_the_residual():
    scene = pendulums()
    with pytest.raises(ub.ConvergenceError, match=r"inertia .* N"):
        ub.simulate(scene, ub.EnergyMomentum(), t=(0, 1), dt=0.5,
                    newton=ub.Newton(max_iterations=1))  # fmt: skip
