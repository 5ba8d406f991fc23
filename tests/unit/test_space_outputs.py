# SPDX-License-Identifier: MIT
"""Scenes in space: section forces, extremes, pictures, further joints, friction."""

import csv
import inspect
import math
import re
from functools import cache
from pathlib import Path

from mpi4py import MPI

import numpy as np
import pytest
import ufl
from into_space import EXACT, SKEW, InSpace, same_in_space
from matplotlib.figure import Figure
from mpl_toolkits.mplot3d.proj3d import proj_transform
from scipy.spatial.transform import Rotation
from test_space import KINDS, OTHER, STIFF, in_plane

import ufl_beam as ub
import ufl_beam.structures as st
from ufl_beam.output.history import MOTION

SECTION = ub.Section(**STIFF, **OTHER)
RUN = {"newton": EXACT}


def skew(*vector):
    return tuple(SKEW.apply(vector))


# -- tables ----------------------------------------------------------------------------------------


@pytest.mark.serial  # files
def test_a_table_has_the_six_components_of_a_place(tmp_path):
    """[closed] A body that a joint holds: the forces of the joint are its weight and its moment."""
    body = ub.Body((1.0, 0.0, 0.0), mass=2.0, inertia=(0.1, 0.2, 0.2), name="load")
    joint = ub.Rigid(ub.ground(0, 0, 0), body.at(0, 0, 0), multipliers=True)
    held = ub.Scene(bodies=[body], joints=[joint], loads=[ub.Gravity((3.0, 0.0, -10.0))])
    table = ub.History(tmp_path / "table.csv", [body.middle], [joint], accelerations=[body.middle])
    run = ub.simulate(held, ub.EnergyMomentum(), t=(0, 0.2), dt=0.1, record=table, **RUN)
    header, *lines = (tmp_path / "table.csv").read_text().replace('"', "").splitlines()
    names = [f"{x} load (1, 0, 0) [{'m' if x in 'uvw' else 'rad'}]" for x in MOTION[3]]
    assert ",".join(names) in header
    rows = np.genfromtxt(lines, delimiter=",")
    assert rows.shape == (3, len(np.genfromtxt([lines[0]], delimiter=",")))
    np.testing.assert_allclose(rows[:, 1:7], run.displacement(body.middle), atol=1e-12)
    np.testing.assert_allclose(rows[1:, 7:13], 0.0, atol=1e-9)
    assert header.count("force Rigid(") == 6
    forces = [np.where([f"), {x} [" in c for c in split(header)])[0][1] for x in ("x", "z", "ry")]
    assert np.abs(rows[-1, forces]) == pytest.approx([6.0, 20.0, 20.0], rel=1e-9)


def split(header):
    """Names of columns, which have commas in parentheses."""
    return re.split(r",(?![^(]*\))(?! )", header)


# -- friction --------------------------------------------------------------------------------------


@pytest.mark.parametrize(("kind", "limit"), [("Stretch", 10.0), ("Slide", 5.0), ("Turn", 30.0)])
def test_friction_is_the_same_in_space(kind, limit):
    """It sticks and slips as in the plane; Stretch and Slide also turn back."""
    scene = in_plane(lambda *ends: [KINDS[kind](*ends, ub.Coulomb(limit))])
    run = same_in_space(scene, ub.EnergyMomentum())[1]
    other = run.connector(run.scene.connectors[0])
    slips = np.abs(np.abs(other.force[1:]) - limit) < 1e-9 * limit
    assert slips.any()
    assert not slips.all()


def wheel(moment, spin):
    """A wheel in a bearing about a skew axis, with dry friction."""
    turn, axis = SKEW.as_matrix(), skew(1, 0, 0)
    body = ub.Body(skew(2, 1, 0), mass=3.0, inertia=turn @ np.diag([0.4, 0.3, 0.3]) @ turn.T)
    bearing = ub.ground(*body.center)
    return ub.Scene(
        bodies=[body], joints=[ub.Revolute(bearing, body.middle, axis=axis)],
        connectors=[ub.Turn(bearing, body.middle, ub.Coulomb(moment), axis=axis)],
        initial=[ub.Velocity([body], angular=tuple(spin * np.array(axis)), linear=(0, 0, 0),
                             about=body.center)],
    )  # fmt: skip


def test_a_bearing_brakes_a_wheel():
    """The speed falls by moment / inertia, and at rest the friction has the kinetic energy."""
    scene = wheel(0.05, 0.5)  # 4 s to rest, 1 rad
    run = ub.simulate(scene, ub.EnergyMomentum(), t=(0, 5), dt=0.02, **RUN)
    speed = run.velocity(scene.bodies[0].middle)[:, 3:] @ skew(1, 0, 0)
    exact = np.maximum(0.5 - 0.05 / 0.4 * run.times, 0.0)
    assert np.abs(speed - exact).max() < 1e-4 * 0.5  # the moment works on angles: (ω dt)²/12
    assert run.energy.lost["friction"][-1] == pytest.approx(0.4 * 0.5**2 / 2, rel=1e-9)
    assert run.energy.worst < 1e-12
    rest = run.displacement(scene.bodies[0].middle)[-10:, 3:]
    assert np.ptp(rest, axis=0).max() < 1e-12


def test_friction_by_the_force_of_a_joint():
    """A block slides on a skew rail: its acceleration has the coefficient times the normal force.

    The limit of a step has the force of the step before, so that friction begins with the second.
    """
    axis, g, coefficient = np.array(skew(0.6, 0.0, -0.8)), np.array(skew(0, 0, -9.81)), 0.3
    block = ub.Body((1, 2, 3), mass=2.0, inertia=(0.1, 0.1, 0.1))
    rail = ub.Prismatic(ub.ground(1, 2, 3), block.middle, axis=tuple(axis))
    law = ub.Coulomb(coefficient=coefficient, joint=rail)
    scene = ub.Scene(
        bodies=[block], joints=[rail], loads=[ub.Gravity(tuple(g))],
        connectors=[ub.Slide(ub.ground(1, 2, 3), block.middle, law, axis=tuple(axis))],
    )  # fmt: skip
    run = ub.simulate(scene, ub.EnergyMomentum(), t=(0, 1), dt=0.1, **RUN)
    speed = run.velocity(block.middle)[:, :3] @ axis
    down, normal = g @ axis, np.linalg.norm(np.cross(g, axis))
    assert np.abs(np.diff(speed)[1:] / 0.1 - (down - coefficient * normal)).max() < 1e-10
    assert np.abs(np.cross(run.position(block.middle) - [1, 2, 3], axis)).max() < 1e-12


# -- joints ----------------------------------------------------------------------------------------


def shafts(bend):
    """Two shafts with a universal joint; the first is driven, the second is held in its line."""
    along = np.array([math.cos(bend), math.sin(bend), 0.0])
    first = ub.Body(skew(-1, 0, 0), mass=1.0, inertia=(1, 1, 1), name="first")
    second = ub.Body(skew(*along), mass=1.0, inertia=(1, 1, 1), name="second")
    far = second.at(*skew(*(2 * along)))
    cross = ub.Universal(first.at(0, 0, 0), second.at(0, 0, 0), axes=(skew(0, 1, 0), skew(0, 0, 1)))
    bearing = ub.ground(*first.center)
    drive = ub.PrescribedMotion(lambda t: 2.0 * t)
    held = [
        ub.Slide(ub.ground(*far.point), far, ub.PrescribedMotion(lambda t: 0.0), axis=axis)
        for axis in (skew(0, 0, 1), skew(-along[1], along[0], 0))
    ]
    return ub.Scene(
        bodies=[first, second],
        joints=[ub.Revolute(bearing, first.middle, axis=skew(1, 0, 0)), cross],
        connectors=[ub.Turn(bearing, first.middle, drive, axis=skew(1, 0, 0)), *held],
    )  # fmt: skip


def test_angles_of_a_universal_joint():
    """Hooke's joint, whose first arm begins in the plane of the bend: tan a = tan b cos(bend)."""
    bend = 0.6
    scene = shafts(bend)
    run = ub.simulate(scene, ub.EnergyMomentum(), t=(0, 1), dt=0.05, **RUN)
    first, second = (run.displacement(body.middle)[:, 3:] for body in scene.bodies)
    line = np.array(skew(math.cos(bend), math.sin(bend), 0))
    turned = first @ skew(1, 0, 0), second @ line
    assert np.abs(turned[0] - 2.0 * run.times).max() < 1e-10
    exact = np.unwrap(np.arctan2(np.sin(turned[0]), np.cos(turned[0]) * math.cos(bend)))
    assert np.abs(turned[1] - exact).max() < 1e-10
    assert np.abs(np.cross(second, line)).max() < 1e-10


def collar(joint):
    body = ub.Body((1, 2, 3), mass=2.0, inertia=(0.1, 0.1, 0.1))
    axis = np.array(skew(0, 0, 1))
    spin = ub.Velocity([body], angular=tuple(4 * axis), linear=tuple(0.5 * axis), about=body.center)
    return ub.Scene(
        bodies=[body], joints=[joint(ub.ground(1, 2, 3), body.middle, axis=tuple(axis))],
        loads=[ub.Gravity((0, 0, -9.81))], initial=[spin],
    )  # fmt: skip


def test_a_cylindrical_joint():
    """A collar falls along its skew axis and spins: exact at any length of steps."""
    axis = np.array(skew(0, 0, 1))
    runs = [
        ub.simulate(collar(joint), ub.EnergyMomentum(), t=(0, 1), dt=0.1, **RUN)
        for joint in (
            ub.Cylindrical, lambda *places, **more: ub.Prismatic(*places, turning=True, **more)
        )
    ]  # fmt: skip
    assert (runs[0].q == runs[1].q).all()
    run, t = runs[0], runs[0].times
    moved = run.displacement(run.scene.bodies[0].middle)
    fall = 0.5 * t - 9.81 * axis[2] * t**2 / 2
    assert np.abs(moved[:, :3] - fall[:, None] * axis).max() < 1e-12
    per_step = 2 * math.atan(4 * 0.1 / 2)
    turns = Rotation.from_rotvec(per_step * np.arange(11)[:, None] * axis).as_rotvec()
    assert np.abs(moved[:, 3:] - turns).max() < 1e-12
    assert "Cylindrical(ground" in str(run.scene.joints[0])


def machine():
    """A bent drive on beams: universal and cylindrical joints, friction, a spring, gravity."""
    arm = ub.Beam((0, 0, 0), (2, 1, 0), SECTION, cells=3, name="arm")
    wheel = ub.Body((2.5, 1, 0.3), mass=2.0, inertia=(1, 1, 1.5), name="wheel")
    slider = ub.Body((2.5, 1, 1.3), mass=1.0, inertia=(0.2, 0.2, 0.1), name="slider")
    rail = ub.Cylindrical(wheel.middle, slider.middle)
    return ub.Scene(
        [arm], bodies=[wheel, slider], supports=[ub.Clamped(arm.start)],
        joints=[ub.Universal(arm.end, wheel.at(2, 1, 0), axes=((0, 1, 0), (0, 0, 1))), rail],
        connectors=[
            ub.Slide(wheel.middle, slider.middle, ub.Coulomb(coefficient=0.1, joint=rail)),
            ub.Turn(wheel.middle, slider.middle, ub.Coulomb(0.3), axis=(0, 0, 1)),
            ub.Stretch(wheel.at(2.6, 1, 0.4), ub.ground(3, 0, 2), ub.Spring(100.0)),
        ],
        loads=[ub.Gravity((0, 0, -9.81))],
    )  # fmt: skip


def test_functions_of_dolfinx():
    """The mesh is in space, and energies and lengths are integrals over it."""
    simulation = ub.Simulation(machine(), ub.EnergyMomentum(), newton=EXACT)
    simulation.step_to(0.02)
    view, (arm,) = simulation.dolfinx, simulation.scene.beams
    C, e, x = view.stiffness, view.strains, ufl.SpatialCoordinate(view.mesh)
    assert view.total(1.0 * view.dx) == pytest.approx(math.sqrt(5), rel=1e-13)
    assert view.total(x[1]) == pytest.approx(math.sqrt(5) / 2, rel=1e-13)
    stored = view.total(sum(C[i] * e[i] ** 2 / 2 for i in range(6)) * view.dx)
    spring = simulation.now.connector(simulation.scene.connectors[2])
    whole = simulation.now.energy.state["stored"][0]
    assert stored == pytest.approx(whole - 100.0 / 2 * spring.motion[0] ** 2, rel=1e-9)
    forces = view.forces.x.array.reshape(-1, 6)
    assert (forces == simulation.section_forces()[view.cells]).all()
    motion, size = view.configuration, simulation.now.displacement(arm.end)[0]
    for k in range(6):
        values = motion.sub(k).collapse().x.array
        nearest = np.abs(values - size[k]).min()
        assert MPI.COMM_WORLD.allreduce(nearest, MPI.MIN) < 1e-15  # one process has the end
    v = view.velocity.x.array
    assert (v == simulation.velocities()[0][view.dofs]).all()
    simulation.close()


A, B = ub.Beam((0, 0, 0), (1, 0, 0), SECTION), ub.Beam((1, 0, 0), (1, 1, 0), SECTION)
PLANAR = ub.Beam((0, 0), (1, 0), ub.Section(**STIFF))
WRONG = {
    "not perpendicular": (
        lambda: ub.Universal(A.end, B.start, axes=((0, 1, 0), (0, 1, 1))), "must be perpendicular",
    ),
    "one axis": (lambda: ub.Universal(A.end, B.start, axes=(0, 1, 0)), "must be two directions"),
    "universal in the plane": (
        lambda: ub.Universal(PLANAR.end, ub.ground(1, 0), axes=((1, 0), (0, 1))), "use Revolute",
    ),
    "cylindrical in the plane": (
        lambda: ub.Cylindrical(ub.ground(0, 0), PLANAR.end), "use Prismatic(turning=True)",
    ),
    "clearance": (
        lambda: ub.Bushing(ub.ground(1, 0, 0), A.end, ub.Clearance(1e6, gap=1e-3)),
        "bushings, and so clearances, are for scenes in the plane",
    ),
}  # fmt: skip


@pytest.mark.parametrize("case", WRONG)
def test_errors_before_a_run(case):
    make, words = WRONG[case]
    with pytest.raises(ub.ModelError, match=re.escape(words)):
        make()


# -- section forces and extremes -------------------------------------------------------------------


def bent(cells=(4, 3)):
    """A bent cantilever with a tip force, a line load and gravity, which turns far."""
    root = ub.Beam((0, 0, 0), (2, 1, 0.5), SECTION, cells=cells[0], up=(0.1, 0, 1), name="root")
    tip = ub.Beam((2, 1, 0.5), (2, 2, 1.5), SECTION, cells=cells[1], name="tip")
    return ub.Scene(
        [root, tip], joints=[ub.Rigid(root.end, tip.start)], supports=[ub.Clamped(root.start)],
        loads=[
            ub.PointLoad(tip.end, force=(100, 80, -150), amplitude=lambda t: t),
            ub.LineLoad(root, force=(5, 20, -30)), ub.Gravity((0, 3, -9.81)),
        ],
    )  # fmt: skip


def in_section(run, place, up, vector):
    """Return a vector in axes of the section at the end of the run."""
    beam = place.beam
    ahead = np.subtract(beam.end.point, beam.start.point)
    first = ahead / np.linalg.norm(ahead)
    second = np.array(up) - first @ up * first
    second /= np.linalg.norm(second)
    axes = np.column_stack([first, second, np.cross(first, second)])
    turned = Rotation.from_rotvec(run.displacement(place)[-1, 3:]).as_matrix() @ axes
    return turned.T @ vector


def test_section_forces_are_in_equilibrium():
    """With the reaction, the load at the tip, and at each vertex; rotations are up to 1 rad."""
    scene = bent()
    run = ub.simulate(scene, ub.Static(), t=(0, 1), dt=0.25, **RUN)
    (root, tip), (foot,) = scene.beams, scene.supports
    reaction = run.reaction(foot)[-1]
    own = np.hstack([in_section(run, root.start, root.up, x) for x in np.split(reaction, 2)])
    size = np.abs(reaction).max()
    assert np.abs(run.section_forces_at(root.start)[-1] + own).max() < 1e-10 * size
    load = in_section(run, tip.end, tip.up, np.array([100, 80, -150.0]))
    assert np.abs(run.section_forces_at(tip.end)[-1] - [*load, 0, 0, 0]).max() < 1e-10 * size
    values = np.array(run.diagram(root, points=3)[1:]).T.reshape(4, 3, 6)
    assert np.abs(values[1:, 0] - values[:-1, -1]).max() < 1e-10 * size
    assert np.abs(run.displacement(tip.end)[-1, 3:]).max() > 0.9


LOADS_ALONG = {
    "pressure": lambda beam: ub.Pressure(
        beam, normal=(20, -30), tangential=10, profile=lambda s: 1 + s * s, amplitude=lambda t: t
    ),
    "part of it": lambda beam: ub.Pressure(beam, normal=(20, -30), span=(0, 0.3)),
    "rotating frame": lambda _: ub.RotatingFrame(rate=(1, 0.5, 2), about=(0.1, 0.2, 0.3)),
    "moving force": lambda beam: ub.MovingLoad(beam, lambda t: 0.1 * t, force=(50, 30, -60)),
}


@pytest.mark.parametrize("kind", LOADS_ALONG)
def test_section_forces_balance_all_loads_along_beams(kind):
    """At the foot, whose cell is loaded, and at the free end."""
    massive = ub.Section(**{**STIFF, "rhoI": 0.0}, **{**OTHER, "rhoI2": 0.0})  # acts in the cells
    root = ub.Beam((0, 0, 0), (2, 1, 0.5), massive, cells=3, up=(0.1, 0, 1), name="root")
    foot = ub.Clamped(root.start)
    run = ub.simulate(
        ub.Scene([root], supports=[foot], loads=[LOADS_ALONG[kind](root)]),
        ub.Static(), t=(0, 1), dt=0.25, **RUN,
    )  # fmt: skip
    reaction = run.reaction(foot)[-1]
    own = np.hstack([in_section(run, root.start, root.up, x) for x in np.split(reaction, 2)])
    size = np.abs(reaction).max()
    assert np.abs(run.section_forces_at(root.start)[-1] + own).max() < 1e-9 * size
    assert np.abs(run.section_forces_at(root.end)[-1]).max() < 1e-9 * size


def test_section_forces_of_a_simple_beam():
    """Under its weight: closed forms at all points, for small deflections."""
    q, length = 9.81e-3, 3.0
    beam = ub.Beam((0, 0, 0), (length, 0, 0), SECTION, cells=4)
    scene = ub.Scene(
        [beam], supports=[ub.Clamped(beam.start)], loads=[ub.Gravity((0, 1e-3, -9.81e-3))]
    )
    run = ub.simulate(scene, ub.Static(), t=(0, 1), dt=1.0, **RUN)
    found = run.diagram(beam, points=5)
    left = length * (1 - found.s)
    assert np.abs(found.V2 + q * left).max() < 1e-5 * q * length
    assert np.abs(found.V3 + 1e-3 * left).max() < 1e-5 * q * length
    assert np.abs(found.M3 + q * left**2 / 2).max() < 1e-5 * q * length**2
    assert np.abs(found.M2 - 1e-3 * left**2 / 2).max() < 1e-5 * q * length**2
    assert max(np.abs(x).max() for x in (found.N, found.T)) < 1e-4 * q * length


@pytest.mark.serial
def test_tables_and_accelerations(shared_path):
    """Names of columns, displacements, and accelerations of free fall with a constant spin."""
    path, spin = shared_path / "history.csv", np.array([0.0, 0.0, 2.0])
    ball = ub.Body((1, 0, 0), mass=1.0, inertia=(0.1, 0.1, 0.2), name="ball")
    place = ball.at(1.5, 0, 0)
    falling = ub.Scene(
        [], bodies=[ball], loads=[ub.Gravity((0, 0, -9.81))],
        initial=[ub.Velocity([ball], angular=tuple(spin), about=(1, 0, 0))],
    )  # fmt: skip
    run = ub.simulate(
        falling, ub.EnergyMomentum(), t=(0, 0.1), dt=0.01, progress=False,
        record=ub.History(path, [place], accelerations=[place]),
    )  # fmt: skip
    names, *rows = csv.reader(path.read_text().splitlines())
    at = str(place)
    displaced = [f"{c} {at} [m]" for c in "uvw"]
    assert names[1:7] == displaced + [f"r{c} {at} [rad]" for c in "xyz"]
    assert (names[9], names[12]) == (f"d2w/dt2 {at} [m/s2]", f"d2rz/dt2 {at} [rad/s2]")
    table, found = np.array(rows, dtype=float), run.acceleration(place)
    assert len(names) == table.shape[1]
    assert np.array_equal(table[:, 1:7], run.displacement(place))
    assert np.array_equal(table[1:, 7:13], found[1:])
    assert found.shape == (11, 6)
    assert np.isnan(found[0]).all()
    # The midpoint rule: gravity is exact; the centripetal acceleration has the mean of both ends
    centripetal = np.cross(spin, np.cross(spin, run.position(place) - run.position(ball.middle)))
    expected = np.array([0, 0, -9.81]) + (centripetal[1:] + centripetal[:-1]) / 2
    assert np.abs(found[1:, :3] - expected).max() < 1e-3
    assert np.abs(found[1:, 3:]).max() < 1e-9
    assert np.array_equal(run.position(ub.ground(1, 2, 3))[-1], (1, 2, 3))


@pytest.mark.serial
def test_columns_of_joints_have_different_names(shared_path):
    path, axis = shared_path / "joints.csv", (0.2, 0.5, 1.0)
    ball = ub.Body((0, 0, 0), mass=1.0, inertia=(0.1, 0.1, 0.1))
    pin = ub.Revolute(ub.ground(0, 0, 0), ball.middle, axis=axis, multipliers=True)
    ub.simulate(
        ub.Scene([], bodies=[ball], joints=[pin]), ub.EnergyMomentum(), t=(0, 0.1), dt=0.1,
        record=ub.History(path, connectors=[pin]), progress=False,
    )  # fmt: skip
    (names, *_) = csv.reader(path.read_text().splitlines())
    assert len(names) == len(set(names)) == 1 + 5 * 3 + 1


def test_extremes_are_those_of_the_stored_states():
    scene, extremes = machine(), ub.Extremes(points=3, accelerations=True)
    run = ub.simulate(scene, ub.EnergyMomentum(), t=(0, 0.5), dt=0.02, record=extremes, **RUN)
    (arm,), (wheel, _) = scene.beams, scene.bodies
    forces = np.array([np.array(run.diagram(arm, n, points=3)[1:]).T for n in range(len(run))])
    found = extremes.section_forces(arm)
    assert (found.low == forces.min(axis=0)).all()
    assert (found.high == forces.max(axis=0)).all()
    assert (found.time_high == run.times[forces.argmax(axis=0)]).all()
    for owner, place in ((arm, arm.end), (wheel, wheel.middle)):
        moved, some = run.displacement(place), extremes.displacement(owner)
        assert np.abs(some.high[-1] - moved.max(axis=0)).max() < 1e-14
        assert np.abs(some.low[-1] - moved.min(axis=0)).max() < 1e-14
        rates = np.diff(run.velocity(place), axis=0) / 0.02
        assert np.abs(extremes.acceleration(owner).high[-1] - rates.max(axis=0)).max() < 1e-9


# -- analyses of structures ------------------------------------------------------------------------

TUBE = st.steel("HSS8X4X1/4", E=200e9, nu=0.3, rho=7850.0)
TOWER = ub.Beam((0, 0, 0), (0, 0, 6), TUBE, up=(1, 0, 0), name="tower")
BASE = ub.Clamped(TOWER.start)
FREE = ub.Scene([TOWER], supports=[BASE])
WIND = ub.LineLoad(TOWER, force=(300.0, 400.0, 0.0))
STATIC = {"t": (0, 1), "dt": 1.0}


def blown():
    scene = ub.Scene([TOWER], supports=[BASE], loads=[WIND])
    return ub.simulate(scene, ub.Static(), **STATIC)


def fatigue():
    """A tower that sways in a skew direction: the stress of a corner follows both moments."""
    spot = st.HotSpot.fibre(TOWER.start, y=0.1, z=-0.05, E=200e9)
    record = st.Fatigue(spot, st.SNCurve.eurocode(71e6))
    sway = ub.PointLoad(TOWER.end, force=(2e3, 1e3, 0), amplitude=lambda t: math.sin(t))
    scene = ub.Scene([TOWER], supports=[BASE], loads=[sway])
    run = ub.simulate(scene, ub.Static(), t=(0, 20), dt=0.2, record=record)
    forces = run.section_forces_at(TOWER.start)
    own = spot.stress(*forces.T)
    # Axis 2 is x, axis 3 is y: the foot has compression at x = 0.1 and tension at y = -0.05
    exact = 6 * (0.05 * 1e3 / TUBE.EI2 - 0.1 * 2e3 / TUBE.EI) * 200e9 * np.sin(run.times)
    assert np.abs(own - exact).max() < 1e-3 * np.abs(exact).max()
    cycles = record.cycles(spot)
    assert np.ptp(own) == pytest.approx(cycles.range.max(), rel=0.01)
    assert record.life(spot) > 0


def combinations():
    """Statics is nearly linear: the envelope has the sums of closed forms, in both directions."""
    push = {name: ub.PointLoad(TOWER.end, force=force) for name, force in (
        ("x", (1e3, 0, 0)), ("y", (0, 2e3, 0))
    )}  # fmt: skip
    both = st.load_combinations(
        FREE, {name: [load] for name, load in push.items()},
        {"A": {"x": 1.5}, "B": {"x": -1.0, "y": 1.0}},
    )  # fmt: skip
    found = both.section_forces(TOWER)
    M3, M2 = (found.high[0, 5], found.low[0, 5]), (found.high[0, 4], found.low[0, 4])
    assert np.allclose(np.sort(np.abs(M3)), [6e3, 9e3], rtol=1e-3)
    assert np.allclose(np.sort(np.abs(M2)), [0, 12e3], rtol=1e-3, atol=1.0)
    assert both.reaction(BASE).low[0] == pytest.approx(-1.5e3, rel=1e-9)
    assert "M3" in str(both)
    title = ub.plot(both, "M3").axes[0].get_title("left").replace("\N{NO-BREAK SPACE}", " ")
    assert title == "extremes of the bending moment M3 (kN m) of 2 load combinations"


def drifts():
    """Shears by equilibrium of the wind on the tower above a cut, along its direction."""
    found = st.storeys(blown(), [TOWER.start, TOWER.at(0.5), TOWER.end], direction=(3, 4))
    assert np.abs(found.shear[-1] - [500.0 * 6, 500.0 * 3]).max() < 1e-6
    across = st.storeys(blown(), [TOWER.start, TOWER.end], direction=(-4, 3))
    assert np.abs(across.shear[-1]).max() < 1e-6
    moved = blown().displacement(TOWER.end)[-1, :2]
    assert found.drift[-1].sum() == pytest.approx(moved @ (0.6, 0.8), rel=1e-12)
    stays = [ub.Stretch(ub.ground(2, k, 0), TOWER.end, ub.Spring(1e5)) for k in (-1, 2)]
    stayed = ub.Scene([TOWER], supports=[BASE], loads=[WIND], connectors=stays)
    run = ub.simulate(stayed, ub.Static(), t=(0, 1), dt=0.25)
    found = st.storeys(run, [TOWER.start, TOWER.at(0.5), TOWER.end], direction=(3, 4))
    assert np.abs(found.shear[-1] - [500.0 * 6, 500.0 * 3]).max() < 1e-5
    assert max(abs(run.connector(x).force[-1]) for x in stays) > 1e3
    for words, more in (("in space give direction", {}), ("has no length", {"direction": (0, 0)})):
        with pytest.raises(ub.ArgumentError, match=words):
            st.storeys(blown(), [TOWER.start, TOWER.end], **more)


FRAME_HINGE = ub.LinearSoftening(limit=100e3, fracture_energy=20e3)


def portal():
    """A frame in the plane; weight on its girder."""
    left, right = (
        ub.Beam((x, 0), (x, 4), TUBE, cells=6, name=name, hinges={0: FRAME_HINGE})
        for name, x in (("left", 0), ("right", 6))
    )
    both = {0: FRAME_HINGE, 1: FRAME_HINGE}
    girder = ub.Beam((0, 4), (6, 4), TUBE, cells=6, name="girder", hinges=both)
    return ub.Scene(
        [left, right, girder],
        joints=[ub.Rigid(left.end, girder.start), ub.Rigid(right.end, girder.end)],
        supports=[ub.Clamped(left.start), ub.Clamped(right.start)],
        loads=[ub.LineLoad(girder, force=(0, -5e3))],
    )


@cache
def capacities(pattern):
    """Capacity curves in the plane, and of the frame turned into the plane of y and z."""
    turned = InSpace(portal(), Rotation.from_matrix([[0, 0, 1], [1, 0, 0], [0, 1, 0]])).scene
    return [
        st.pushover(scene, scene["left"].end, 0.2, pattern=pattern, component=component, steps=50)
        for scene, component in ((portal(), "u"), (turned, "v"))
    ]


def pushes():
    """The capacity curve is that of the plane."""
    for pattern in ("mode", "triangular"):
        plane, space = capacities(pattern)
        for name in ("stiffness", "mass", "equivalent_mass", "gamma", "period"):
            assert getattr(space, name) == pytest.approx(getattr(plane, name), rel=1e-7)
        hinges = [[x.where.beam.name for x in some.hinges] for some in (plane, space)]
        assert hinges[0] == hinges[1]
        # Steps end elsewhere, and the curve has corners where hinges open
        grid = np.linspace(0.0, 0.2, 50)
        curves = [np.interp(grid, x.displacement, x.base_shear) for x in (plane, space)]
        assert np.abs(curves[1] - curves[0]).max() < 0.01 * curves[0].max()
    with pytest.raises(ub.ArgumentError, match="must be 'u' or 'v' or 'w'"):
        st.pushover(FREE, TOWER.end, 0.2, component="x")


def hinges():
    """Hinges of both frames turn alike, in the same order."""
    tables = [st.hinge_table(x.path, {"IO": 0.01, "LS": 0.02}) for x in capacities("mode")]
    rows = [[(x.rotation, x.dissipated, x.state) for x in table.rows] for table in tables]
    assert len(rows[0]) == 4
    for row, other in zip(*rows, strict=True):
        assert row[:2] == pytest.approx(other[:2], rel=1e-3)
        assert row[2] == other[2]


def leaning():
    """A column that leans, or is bowed, in a skew direction."""
    leans = st.imperfect(FREE, sway=(0.003, -0.004))
    assert leans["tower"].end.point == pytest.approx((0.018, -0.024, 6.0))
    assert leans["tower"].at(0.5).point == pytest.approx((0.009, -0.012, 3.0))
    bowed = st.imperfect(FREE, bow={TOWER: (1 / 300, -1 / 600)})  # axis 2 is x, axis 3 is y
    assert bowed["tower"].at(0.5).point == pytest.approx((0.02, -0.01, 3.0))
    assert bowed["tower"].end.point == pytest.approx((0, 0, 6))
    # The first mode is about the weak axis; it grows by 1 / (N / Euler - 1)
    push = ub.PointLoad(TOWER.end, force=(0, 0, -1e4))
    column = ub.Scene([TOWER], supports=[BASE], loads=[push])
    buckles = ub.buckling(column, 1)
    crooked = st.imperfect(column, mode=buckles, amplitude=0.01)
    run = ub.simulate(crooked, ub.Static(), t=(0, 1), dt=0.5)
    moved = np.linalg.norm(run.displacement(crooked["tower"].end)[-1, :2])
    assert moved == pytest.approx(0.01 / (buckles.factors[0] - 1), rel=1e-3)
    for words, more in (
        (r"must be a pair \(x, y\)", {"sway": 0.01}),
        (r"bow of tower = 0.01 must be a pair", {"bow": {TOWER: 0.01}}),
        ("nothing changes the geometry", {"sway": (0.0, 0.0)}),
    ):
        with pytest.raises(ub.ArgumentError, match=words):
            st.imperfect(FREE, **more)


@pytest.mark.serial
def test_start_with_a_hinge_at_a_joint():
    """Rotations of vertices that are in no cell, before hinges, begin with those of the run."""
    first = InSpace(portal(), SKEW).scene
    arguments = {"scheme": ub.Static(), "dt": 1.0}
    before = ub.simulate(first, t=(0, 1), **arguments)
    # Another scene of the same beams, so that loads and supports are set anew
    second = ub.Scene(
        first.beams, joints=first.joints, supports=first.supports, loads=[*first.loads]
    )
    after = ub.simulate(second, t=(1, 2), start=before, **arguments)
    assert np.abs(after.turns(0) - before.turns(-1)).max() == 0.0
    assert np.abs(after.q[-1] - before.q[-1])[after.numbering.dofs].max() < 1e-9


def incremental():
    """A stiff tower of one mass at its top: the drift is proportional to the motion."""
    pulse = st.GroundMotion(0.02, np.sin(10 * np.arange(0, 0.4, 0.02)))

    def build(motion):
        shaking = ub.Gravity((-1, 0, 0), amplitude=motion.acceleration)
        return ub.Scene([TOWER], supports=[BASE], loads=[shaking])

    found = st.incremental_dynamic_analysis(
        build, [pulse], [0.5, 1.0], limit=1.0, measure=lambda run: run.displacement(TOWER.end)[:, 0]
    )
    assert found.demand[0, 1] == pytest.approx(2 * found.demand[0, 0], rel=1e-3)


def calibrated():
    """The modulus from a deflection; derivatives are differences of runs in space."""

    def model(E):
        section = ub.Section(**{**STIFF, **OTHER, "EI": 1e3 * E})
        beam = ub.Beam((0, 0, 0), (1, 0, 0), section, cells=2, name="arm")
        load = ub.PointLoad(beam.end, force=(0, 0, 0.1))
        return ub.Scene([beam], supports=[ub.Clamped(beam.start)], loads=[load])

    run = ub.simulate(model(0.7), ub.Static(), **STATIC)
    tip = run.displacement(run.scene["arm"].end)[-1, 2]
    measured = st.Measurement(
        None,
        [tip],
        lambda run: run.displacement(run.scene["arm"].end)[-1:, 2],
        scheme=ub.Static(),
        t=(0, 1),
        dt=1.0,
        sigma=1e-9,
    )
    fit = st.calibrate(model, {"E": 1.0}, [measured])
    assert fit.parameters["E"] == pytest.approx(0.7, rel=1e-5)


def spectral():
    """Peaks of a bent frame are those of the plane, also about a loaded state."""

    section = ub.Section(EA=1e8, GA=4e7, EI=2e6, rhoA=30.0, rhoI=0.0)
    post = ub.Beam((0, 0), (0, 6), section, cells=5)
    girder = ub.Beam((0, 6), (3, 6), section, cells=5)
    box = ub.Body((3, 6), mass=200.0)
    flat = ub.Scene(
        [post, girder], bodies=[box],
        joints=[ub.Rigid(post.end, girder.start), ub.Rigid(girder.end, box.middle)],
        supports=[ub.Clamped(post.start)],
        loads=[ub.PointLoad(girder.end, force=(0, -2e4))],
    )  # fmt: skip
    copy = InSpace(flat, SKEW)
    for loaded in (False, True):
        found = []
        for scene, direction in (flat, (1, 0.3)), (copy.scene, copy.vector((1, 0.3))):  # all modes
            state = {"at": ub.simulate(scene, ub.Static(), t=(0, 1), dt=0.25)}
            found.append(st.response_spectrum_analysis(
                scene, ([1e-9, 9.0], [3.0, 3.0]), n=200, direction=direction,
                **(state if loaded else {}),
            ))  # fmt: skip
        plane, space = found
        assert space.base_shear == pytest.approx(plane.base_shear, rel=1e-5)
        assert max(abs(plane.missing_mass), abs(space.missing_mass)) < 1e-9
        for one, other in zip(plane.scene.beams, space.scene.beams, strict=True):
            a, b = plane.diagram(one, points=2), space.diagram(other, points=2)
            for name, value in {"N": b.N, "V": b.V2, "M": b.M3}.items():
                exact = getattr(a, name)
                assert np.abs(value - exact).max() < 1e-5 * exact.max()
            assert max(x.max() for x in (b.V3, b.T, b.M2)) < 1e-6 * b.M3.max()
        tip, other = plane.scene.beams[1].end, space.scene.beams[1].end
        moved = space.combine(SKEW.inv().apply(space.peaks(other)[:, :3]))
        assert moved[:2] == pytest.approx(plane.displacement(tip)[:2], rel=1e-5)
        sides = [SKEW.inv().apply(x) for x in np.split(space.reactions[:, 0], 2, axis=1)]
        reaction = np.append(space.combine(sides[0])[:2], space.combine(sides[1])[2])
        assert reaction == pytest.approx(plane.reaction(plane.scene.supports[0]), rel=1e-5)
    assert ub.plot(space, "M2").axes
    with pytest.raises(ub.ArgumentError, match="must have 3 components"):
        st.response_spectrum_analysis(scene, lambda T: 1.0, direction=(1, 0))


ANALYSES = {
    "Fatigue": fatigue, "HotSpot": fatigue, "calibrate": calibrated,
    "incremental_dynamic_analysis": incremental, "load_combinations": combinations,
    "storeys": drifts,
    "hinge_table": hinges, "pushover": pushes, "imperfect": leaning,
    "response_spectrum_analysis": spectral,
}  # fmt: skip
TAKES = "Scene", "Solution", "Place", "HotSpot", "Model"
"""Types of parameters that belong to scenes."""


def test_the_table_has_all_analyses_of_scenes():
    """All public names of `structures` whose parameters are scenes, runs or places."""
    found = set()
    for name in st.__all__:
        parameters = inspect.signature(getattr(st, name)).parameters.values()
        types = " ".join(str(x.annotation) for x in parameters)
        if any(re.search(rf"\b{kind}\b", types) for kind in TAKES):
            found.add(name)
    assert found == set(ANALYSES)
    page = (Path(__file__).parents[2] / "docs/space.md").read_text("utf-8")
    table = page.partition("| of `structures`")[2].partition("\n\n")[0]
    assert [name for name in st.__all__ if f"`{name}`" not in table] == []


@pytest.mark.parametrize("name", ANALYSES)
def test_analyses_of_structures(name):
    ANALYSES[name]()


# -- joints ----------------------------------------------------------------------------------------

PIN, CENTER, AXIS = (0.3, -0.2, 0.5), (0.7, 0.1, 0.2), (1, 2, -1)
SWINGING = ub.Body(
    CENTER, mass=2.0, inertia=((0.05, 0.01, 0), (0.01, 0.08, 0.02), (0, 0.02, 0.06)), name="pan"
)
ROOT, HELD, APART = ub.ground(*PIN), SWINGING.at(*PIN), ub.ground(0, 0, 1.0)
BEARINGS = {
    "Rigid": ub.Rigid(ROOT, HELD, multipliers=True),
    "Revolute": ub.Revolute(ROOT, HELD, axis=AXIS),
    "Spherical": ub.Spherical(ROOT, HELD),
    "reversed": ub.Revolute(HELD, ROOT, axis=AXIS),
    "Universal": ub.Universal(ROOT, HELD, axes=(AXIS, (1, 0, 1))),
    "Cylindrical": ub.Cylindrical(ROOT, HELD, axis=AXIS),
    "Prismatic": ub.Prismatic(ROOT, HELD, axis=AXIS),
    "Link": ub.Link(APART, HELD),
    "RigidLink": ub.RigidLink(APART, HELD),
}
"""Joints of a body with the ground; those of the places of `Prismatic` and `RigidLink` turn alike,
so that their moments are not known."""


@pytest.mark.parametrize("kind", BEARINGS)
def test_forces_of_joints_change_the_momenta(kind):
    """Impulses of force, moment and weight are the changes of momentum and angular momentum."""
    joint, weight = BEARINGS[kind], 2.0 * np.array([3.0, -9.0, -2.0])
    scene = ub.Scene(bodies=[SWINGING], joints=[joint], loads=[ub.Gravity(tuple(weight / 2))])
    arguments = {"t": (0, 2.4), "dt": 0.02, **RUN}
    run = ub.simulate(scene, ub.EnergyMomentum(), **arguments)
    found, sign = run.joint(joint), -1.0 if joint.places[1] is ROOT else 1.0
    force, moment = sign * found.force[1:], sign * found.moment[1:]
    rates = np.diff(run.momentum(), axis=0) / 0.02
    held, center = ((x[1:] + x[:-1]) / 2 for x in map(run.position, (HELD, SWINGING.middle)))
    size = np.abs(force).max()
    assert np.abs(rates[:, :3] - force - weight).max() < 1e-9 * size
    moments = rates[:, 3:] - np.cross(held, force) - np.cross(center, weight)
    if kind in ("Prismatic", "RigidLink"):
        assert np.isnan(moment).all()
    else:
        assert np.abs(moments - moment).max() < 1e-9 * size
    # States of every third step have the same forces
    some = ub.simulate(scene, ub.EnergyMomentum(), every=3, **arguments).joint(joint)
    for every, third in zip(found, some, strict=True):
        assert np.allclose(every[::3], third, rtol=0.0, atol=1e-10 * size, equal_nan=True)
    for side, place in ((found.in_a, joint.places[0]), (found.in_b, joint.places[1])):
        turns = Rotation.from_rotvec(run.displacement(place)[:, 3:])
        middle = turns[:-1] * Rotation.from_rotvec((turns[:-1].inv() * turns[1:]).as_rotvec() / 2)
        assert np.abs(middle.apply(side[1:]) - found.force[1:]).max() < 1e-12 * size


def test_a_joint_bears_what_is_beyond_it():
    """In statics force and moment of a corner are in equilibrium with the load, deformed."""
    section = ub.Section(**STIFF, **OTHER)
    one = ub.Beam((0, 0, 0), (1, 0.3, 0.2), section, name="one")
    other = ub.Beam((1, 0.3, 0.2), (1.2, 1.1, 0), section, name="other")
    corner, F = ub.Rigid(one.end, other.start, multipliers=True), np.array((3.0, -8.0, 5.0))
    scene = ub.Scene(
        [one, other], joints=[corner], supports=[ub.Clamped(one.start)],
        loads=[ub.PointLoad(other.end, force=tuple(F))],
    )  # fmt: skip
    run = ub.simulate(scene, ub.Static(), t=(0, 1), dt=0.5, **RUN)
    found, arm = run.joint(corner), run.position(other.end)[-1] - run.position(other.start)[-1]
    assert np.abs(run.displacement(other.end)[-1, :3]).max() > 0.01
    assert np.abs(found.force[-1] + F).max() < 1e-9
    assert np.abs(found.moment[-1] + np.cross(arm, F)).max() < 1e-9
    assert np.abs(found.motion).max() < 1e-12


def test_forces_of_joints_are_those_of_the_plane():
    body = ub.Body((0.5, 0.2), mass=2.0, inertia=0.1)
    joint, weight = ub.Revolute(ub.ground(0, 0), body.at(0, 0)), ub.Gravity((0, -9.81))
    scene = ub.Scene(bodies=[body], joints=[joint], loads=[weight])
    runs = same_in_space(scene, ub.EnergyMomentum(), t=(0, 0.5), dt=0.02)
    plane, space = (run.joint(run.scene.joints[0]) for run in runs)
    for name in ("force", "in_a", "in_b"):
        back = SKEW.inv().apply(getattr(space, name))
        assert np.abs(back[:, :2] - getattr(plane, name)).max() < 1e-10
        assert np.abs(back[:, 2]).max() < 1e-10
    turned = SKEW.inv().apply(space.motion[:, 3:])
    assert np.abs(turned - [[0, 0, x] for x in plane.motion[:, 2]]).max() < 1e-10


# -- pictures --------------------------------------------------------------------------------------

QUANTITIES = "shape", "N", "V", "T", "M", "V2", "V3", "M2", "M3"


def drawn(figure):
    """Labels of a picture, after it was drawn; no two cover each other."""
    figure.draw_without_rendering()
    (axes, *_) = figure.axes
    labels = [x for x in axes.texts if x.get_gid() == "labels"]
    boxes = [x.get_window_extent() for x in labels]
    assert not any(a.overlaps(b) for i, a in enumerate(boxes) for b in boxes[:i])
    return axes, [x.get_text() for x in labels]


@pytest.mark.serial
def test_pictures_of_section_forces():
    """Labels are the values; the scale is the same along all axes, and z is up."""
    run = ub.simulate(bent(), ub.Static(), t=(0, 1), dt=0.25, **RUN)
    for quantity in QUANTITIES:
        axes, labels = drawn(ub.plot(run, quantity))
        size = np.ptp([getattr(axes, f"get_{x}lim")() for x in "xyz"], axis=1)
        assert np.allclose(axes._box_aspect / size, (axes._box_aspect / size)[0])
        up = [
            axes.transData.transform(proj_transform(0, 0, z, axes.get_proj())[:2]) for z in (0, 1)
        ]
        assert up[1][1] > up[0][1]
        assert abs(up[1][0] - up[0][0]) < 1e-6 * (up[1][1] - up[0][1])
        if quantity != "shape":
            assert labels
    root = run.scene.beams[0]
    M = run.section_forces_at(root.start)[-1, 4:]
    assert f"{np.linalg.norm(M):.3g}" in drawn(ub.plot(run, "M"))[1]


@pytest.mark.serial
def test_other_pictures(tmp_path):
    """Models with all joints, shapes, histories, extremes, notebooks, axes of a user."""
    scene, extremes = machine(), ub.Extremes()
    run = ub.simulate(scene, ub.EnergyMomentum(), t=(0, 0.1), dt=0.02, record=extremes, **RUN)
    for shown, quantity, places, more in (
        (scene, "", (), {}), (run, "", (), {"magnify": 5}), (run, "shapes", (), {"count": 3}),
        (run, "history", (scene.beams[0].end,), {"component": "dw/dt"}),
        (run, "history", (scene.beams[0].end,), {"component": "rx"}),
        (run, "energy", (), {}), (run, "dissipation", (), {}), (extremes, "", (), {}),
        (extremes, "T", (), {}),
    ):  # fmt: skip
        ub.plot(shown, quantity, *places, **more).savefig(tmp_path / "picture.png")
    assert drawn(ub.plot(scene))[1]
    assert "<img" in scene._repr_html_() + run._repr_html_()
    figure = Figure()
    assert ub.plot(scene, ax=figure.add_subplot(projection="3d")) is figure
    with pytest.raises(ub.ArgumentError, match="needs axes in space"):
        ub.plot(scene, ax=Figure().add_subplot())
    with pytest.raises(ub.ArgumentError, match="component = 'psi' is not one of"):
        ub.plot(run, "history", scene.beams[0].end, component="psi")


@pytest.mark.serial
def test_pictures_of_damage():
    """Yielded cells, hinges and their curves are those of the scene in the plane."""
    law, hinge = ub.ElastoPlastic(30.0, isotropic=50.0), ub.LinearSoftening(20.0, 40.0)
    section = ub.Section(**STIFF, bending=law)
    post = ub.Beam((0, 0), (1, 0), section, cells=4, hinges={0.5: hinge}, name="post")
    pull = ub.PrescribedDisplacement(post.end, v=lambda t: 0.3 * math.sin(3 * t))
    scene = ub.Scene([post], supports=[ub.Clamped(post.start), pull])
    runs = same_in_space(scene, ub.Static(), dt=0.05)
    marks = []
    for run in runs:
        (post,) = run.scene.beams
        axes, bar = ub.plot(run, "damage", limits={"IO": 0.01}).axes
        (zones,) = (x for x in axes.collections if x.get_gid() == "yielded")
        marks.append((zones.get_array(), len(zones.get_edgecolor()), bar.get_ylim()))
        for quantity, place in (("hinge", post.at(0.5)), ("moment-curvature", post.at(0.1))):
            axes = ub.plot(run, quantity, place).axes[0]
            curve = np.array(axes.collections[-1].get_segments())
            marks[-1] += (curve, axes.get_title("left").partition(":")[2])
    for a, b in zip(*marks, strict=True):
        if isinstance(a, np.ndarray | tuple):
            assert np.allclose(a, b, rtol=1e-6, atol=1e-9)
        else:
            assert a == b


@pytest.mark.serial
def test_pictures_of_modes(tmp_path):
    """Modes side by side, drawn to one scale in a view with z up; also of buckling."""
    shapes = ub.modes(FREE, 3)
    figure = ub.plot(shapes, numbers=[0, 2])
    figure.savefig(tmp_path / "modes.png")
    assert [x.get_title("left") for x in figure.axes] == [
        f"{k}: {shapes.titles[k]}" for k in (0, 2)
    ]
    assert len({(*x.get_xlim(), *x.get_ylim(), *x.get_zlim()) for x in figure.axes}) == 1
    for axes in figure.axes:  # inside of the panel, and not small
        lines = np.hstack([x.get_data_3d() for x in axes.lines])
        at = np.array(proj_transform(*lines, axes.get_proj())[:2]).T
        at = axes.transAxes.inverted().transform(axes.transData.transform(at))
        assert np.nanmin(at) > 0.0
        assert np.nanmax(at) < 1.0
        assert np.ptp(at[~np.isnan(at).any(axis=1)], axis=0).max() > 0.7
    push = ub.PointLoad(TOWER.end, force=(0, 0, -1.0))
    column = ub.Scene([TOWER], supports=[BASE], loads=[push])
    assert "<img" in ub.buckling(column, 1)._repr_html_()


@pytest.mark.serial
def test_magnitudes_are_coloured_from_zero(monkeypatch, tmp_path):
    pyvista = pytest.importorskip("pyvista")
    scales, add = {}, pyvista.Plotter.add_mesh

    def add_mesh(self, mesh, *args, clim=None, **more):
        if clim is not None:
            scales[quantity] = clim, mesh.point_data["values"]
        return add(self, mesh, *args, clim=clim, **more)

    monkeypatch.setattr(pyvista.Plotter, "add_mesh", add_mesh)
    run = blown()
    for quantity in "NVTM":
        ub.render(run, tmp_path / "tower.png", quantity=quantity, size=(160, 96))
        (low, high), values = scales[quantity]
        assert low == (0.0 if quantity in "VM" else -high)
    assert values.max() == pytest.approx(500 * 18 / 1e3, rel=1e-4)  # kN m at the foot
