# SPDX-License-Identifier: MIT
"""Inelastic beams in space: equality with the plane, fibres, hinges, balances, restart."""

import numpy as np
import pytest
from into_space import EXACT, SKEW, same_in_space
from scipy.spatial.transform import Rotation
from test_space import OTHER, STIFF
from user_laws import SameHardening

import ufl_beam as ub
import ufl_beam.structures as st
from ufl_beam.model.constraint_checks import parts_that_switch


def in_plane(x, y):
    return x, y


def skew(x, y):
    return tuple(SKEW.apply([x, y, 0.0]))


def cantilever(section, at, *, amplitude, hinges=None, size=1.0, damping=()):
    """A beam of five cells, pushed across at its end; vectors of the plane go through ``at``."""
    up = {} if at is in_plane else {"up": at(-3, 4)}
    beam = ub.Beam(at(1, 0), at(5, 3), section, cells=5, hinges=hinges or {}, **up)
    load = ub.PointLoad(beam.end, force=at(-3 * size, 4 * size), amplitude=amplitude)
    return ub.Scene([beam], supports=[ub.Clamped(beam.start)], loads=[load], damping=[*damping])


def in_both(scheme, laws, *, end=1.0, **more):
    """Run a cantilever in the plane and in a skew plane, whose results are equal."""
    plane = cantilever(ub.Section(**STIFF, **laws), in_plane, **more)
    return same_in_space(plane, scheme, t=(0, end), dt=0.02)


def same_histories(one, other):
    for a, b in zip(one, other, strict=True):
        assert np.abs(a - b).max() < 1e-11 * max(1.0, np.abs(a).max())


def push(t):
    """Push, then pull."""
    return 3 * np.sin(4 * t)


IN_LONG_CELLS = pytest.mark.filterwarnings("ignore:.*hinge of the section opened")

RESULTANTS = {
    "bending": {"bending": ub.ElastoPlastic(8.0, isotropic=20.0, kinematic=30.0)},
    "shear": {"shear": ub.ElastoPlastic(2.0, isotropic=3e3)},
    "axial": {"axial": ub.ElastoPlastic(0.03, isotropic=1e3)},
    "three laws": {
        "bending": ub.ElastoPlastic(8.0, isotropic=20.0),
        "shear": ub.ElastoPlastic(2.0, kinematic=3e3),
        "axial": ub.ElastoPlastic(0.03, isotropic=1e3),
    },
    "two classes": {"bending": st.BoucWen(8.0, 0.1), "shear": ub.ElastoPlastic(2.0, kinematic=3e3)},
    "Perzyna": {"bending": ub.ElastoPlastic(8.0, viscosity=ub.Perzyna(eta=50.0))},
    "Duvaut-Lions": {"bending": ub.ElastoPlastic(8.0, viscosity=ub.DuvautLions(tau=0.1))},
    "Ramberg-Osgood": {"bending": st.RambergOsgood(8.0, offset=0.002, exponent=5.0)},
    "Armstrong-Frederick": {"bending": st.ArmstrongFrederick(8.0, 100.0, 10.0)},
    "by residuals": {"bending": SameHardening(8.0, 20.0, 30.0, 1.0)},
    "hinge of the section": {"hinge": ub.LinearSoftening(8.0, fracture_energy=10.0)},
}  # fmt: skip


@IN_LONG_CELLS
@pytest.mark.parametrize("name", RESULTANTS)
def test_laws_have_the_same_motion_in_space(name):
    runs = in_both(ub.EnergyMomentum(), RESULTANTS[name], amplitude=push)
    lost = runs[1].energy["hinges" if name.startswith("hinge") else "plastic"]
    assert lost[-1] > 1e-5 * runs[1].energy["loads"].max(), "the law yields"
    assert np.abs(runs[1].energy.imbalance).max() < 1e-12 * runs[1].energy["loads"].max()
    one, other = (run.material(run.scene.beams[0]) for run in runs)
    for field in ("jump", "plastic", "hinge"):
        a, b = getattr(one, field), getattr(other, field)
        assert np.abs(a - b).max() < 1e-11 * max(1.0, np.abs(a).max())
    lost_in_cells = np.sum(other.plastic + other.hinge)
    at_ends = [runs[1].connector(x).dissipated[-1] for x in runs[1].scene.hinges]
    assert np.isclose(lost_in_cells + sum(at_ends), lost[-1], rtol=1e-12)


@pytest.mark.parametrize(
    "scheme", [ub.EnergyMomentum(alpha=0.1), ub.Static(), ub.EnergyMomentumStatic()], ids=str
)
def test_schemes_have_the_same_motion_in_space(scheme):
    in_both(scheme, RESULTANTS["three laws"], amplitude=push, end=0.7)


@pytest.mark.parametrize(
    "law",
    [
        ub.LinearSoftening(8.0, fracture_energy=5.0),
        ub.Softening(8.0, fracture_energy=5.0),
        ub.ElastoPlastic(8.0, isotropic=5.0),
    ],
    ids=str,
)
def test_hinges_of_zero_length_have_the_same_motion_in_space(law):
    runs = in_both(ub.EnergyMomentum(), {}, amplitude=push, hinges={0.0: law, 0.4: law})
    histories = [[run.connector(x) for x in run.scene.hinges] for run in runs]
    for one, other in zip(*histories, strict=True):
        same_histories(one, other)
    assert max(np.ptp(one.motion) for one in histories[0]) > 0.01, "a hinge turns"


@pytest.mark.parametrize("scheme", [ub.EnergyMomentum(), ub.Static()], ids=str)
def test_viscous_beams_have_the_same_motion_in_space(scheme):
    laws, damping = RESULTANTS["bending"], [ub.KelvinVoigt(0.05)]
    runs = in_both(scheme, laws, amplitude=push, end=0.7, damping=damping)
    assert runs[1].energy["damping"][-1] > 1e-3 * runs[1].energy["loads"].max()


def test_creep_under_torsion_in_space():
    """The angle T L/GJ (1 - exp(-t/τ)), in steps of backward Euler (1 + dt/τ)^-n."""
    beam = ub.Beam((0, 0, 0), (1, 2, 2), ub.Section(**STIFF, **OTHER), cells=2, up=(1, 0, 0))
    axis, τ, dt = np.array([1, 2, 2]) / 3, 0.5, 0.1
    load = ub.PointLoad(beam.end, moment=tuple(4.0 * axis), amplitude=lambda t: float(t > 0))
    scene = ub.Scene(
        [beam], supports=[ub.Clamped(beam.start)], loads=[load], damping=[ub.KelvinVoigt(τ)]
    )  # fmt: skip
    run = ub.simulate(scene, ub.Static(), t=(0, 1), dt=dt, newton=EXACT)
    angle = run.displacement(beam.end)[:, 3:] @ axis
    exact = 4.0 * 3.0 / 400.0 * (1 - (1 + dt / τ) ** -np.arange(11.0))
    assert np.abs(angle - exact).max() < 1e-12


SPRINGS = {
    "softening spring": ub.Spring(300.0, softening=ub.LinearSoftening(8.0, fracture_energy=5.0)),
    "exponential": ub.Spring(300.0, softening=ub.Softening(8.0, fracture_energy=5.0)),
    "Bouc-Wen": ub.Spring(300.0, st.BoucWen(8.0, 0.1)),
    "viscoplastic": ub.Spring(300.0, ub.ElastoPlastic(8.0, viscosity=ub.Perzyna(eta=30.0))),
    "rigid-plastic": ub.RigidPlastic(ub.ElastoPlastic(8.0, kinematic=20.0)),
    "rigid-softening": ub.RigidPlastic(ub.LinearSoftening(8.0, fracture_energy=5.0)),
    "pinching": st.PinchingHinge(
        300.0, st.Backbone(8.0, capping=0.1, post_capping=0.4), strength=1.0, kappa_F=0.4,
        kappa_D=0.3,
    ),
}  # fmt: skip


@pytest.mark.parametrize("name", SPRINGS)
def test_hinges_at_joints_have_the_same_motion_in_space(name):
    beam = ub.Beam((1, 0), (5, 3), ub.Section(**STIFF), cells=3)
    places = ub.ground(1, 0), beam.start
    scene = ub.Scene(
        [beam], joints=[ub.Revolute(*places)], connectors=[ub.Turn(*places, SPRINGS[name])],
        loads=[ub.PointLoad(beam.end, force=(-3, 4), amplitude=push)],
    )  # fmt: skip
    runs = same_in_space(scene, ub.EnergyMomentum(), dt=0.02)
    one, other = (run.connector(run.scene.connectors[0]) for run in runs)
    assert np.ptp(one.motion) > 0.05
    assert one.dissipated[-1] > 0.01
    same_histories(one, other)
    largest = runs[1].energy["loads"].max()
    assert np.abs(runs[1].energy.imbalance).max() < 1e-12 * largest


# -- all directions ------------------------------------------------------------------------------

SIX = {
    "axial": ub.ElastoPlastic(3.0, isotropic=1e3),
    "shear": ub.ElastoPlastic(2.0, kinematic=1e3),
    "shear3": ub.ElastoPlastic(2.0, isotropic=1e3),
    "twisting": ub.ElastoPlastic(3.0, isotropic=40.0, viscosity=ub.Perzyna(eta=2.0)),
    "bending2": ub.ElastoPlastic(6.0, kinematic=30.0),
    "bending": ub.ElastoPlastic(8.0, isotropic=20.0),
}
RANDOM = Rotation.from_rotvec([-1.1, 0.4, 0.9])


def flight(turn, **laws):
    """A free bent beam with a wheel on a revolute joint, pushed and twisted for a second."""

    def at(*x):
        return tuple(turn.apply(x))

    section = ub.Section(**STIFF, **OTHER, **laws)
    beam = ub.Beam(at(0, 0, 0), at(3, 1, 0), section, cells=4, up=at(0, 1, 2))
    arm = ub.Beam(at(3, 1, 0), at(3, 3, 1), section, cells=3, up=at(1, 0, 1))
    inertia = turn.as_matrix() @ np.diag([1.0, 2.0, 1.5]) @ turn.as_matrix().T
    wheel = ub.Body(at(0, -0.2, 0), mass=2.0, inertia=inertia)
    axle = ub.Revolute(beam.start, wheel.at(*at(0, 0, 0)), axis=at(1, 0, 1))
    push = ub.PointLoad(
        arm.end, force=at(9, -12, 14), moment=at(10, -8, 12), amplitude=lambda t: float(t < 1)
    )
    return ub.Scene([beam, arm], joints=[ub.Rigid(beam.end, arm.start), axle], bodies=[wheel],
                    loads=[push])  # fmt: skip


def flown(turn, scheme=None, t=(0, 1.5), **more):
    return ub.simulate(
        flight(turn, **SIX), scheme or ub.EnergyMomentum(), t=t, dt=0.02, newton=EXACT, **more,
    )  # fmt: skip


def test_balances_of_six_laws_in_flight():
    """The work of the loads is energy and dissipation; afterwards momenta are constant."""
    run = flown(Rotation.identity())
    largest = run.energy["loads"].max()
    assert run.energy["plastic"][-1] > 0.05 * largest
    assert np.abs(run.energy.imbalance).max() < 1e-12 * largest
    free = run.times >= 1.0
    momenta = run.momentum()[free]
    assert np.abs(momenta - momenta[0]).max() < 1e-12 * np.abs(momenta).max()
    beam = run.scene.beams[0]
    plastic = [run.variables(x)["plastic"] for x in run.scene.beams]
    assert all((np.abs(x[:, 0]).max(axis=0) > 0).any() for x in plastic)
    assert plastic[0].shape == (4, 1, 6), "cells, points along a cell, laws"
    lost = sum(run.material(x).plastic.sum() for x in run.scene.beams)
    assert np.isclose(lost, run.energy["plastic"][-1], rtol=1e-12)
    assert run.material(beam).forces.shape == (4, 6)
    assert np.array_equal(run.material(beam).forces, run.section_forces(beam))


def test_turned_scene_with_six_laws():
    one, other = flown(Rotation.identity()), flown(RANDOM)
    for a, b in zip(one.scene.beams, other.scene.beams, strict=True):
        moved = RANDOM.inv().apply(other.position(b.end))
        assert np.abs(moved - one.position(a.end)).max() < 1e-12 * one.scene.size
        forces = [run.section_forces(x) for run, x in ((one, a), (other, b))]
        assert np.abs(forces[0] - forces[1]).max() < 1e-11 * np.abs(forces[0]).max()
    assert np.isclose(*(x.energy["plastic"][-1] for x in (one, other)), rtol=1e-12)


# -- hinges --------------------------------------------------------------------------------------


def two_hinges():
    """Softening hinges about two axes between nodes, in a cell, and at the foot of a beam."""
    law = ub.LinearSoftening(6.0, fracture_energy=20.0)
    section = ub.Section(**STIFF, **OTHER)
    lower = ub.Beam((0, 0, 0), (0, 0, 3), section, cells=3, up=(1, 0, 0), hinges={0: law})
    upper = ub.Beam((0, 0, 3), (2, 0, 4), ub.Section(**STIFF, **OTHER, hinge=law), cells=2,
                    hinges={0: None, 1: None})  # fmt: skip
    ball, places = ub.Spherical(lower.end, upper.start), (lower.end, upper.start)
    turns = [ub.Turn(*places, ub.RigidPlastic(law), axis=x) for x in ((1, 0, 0), (0, 1, 0))]
    turns.append(ub.Turn(*places, ub.Spring(400.0), axis=(0, 0, 1)))
    push = ub.PointLoad(upper.end, force=(6, 8, -3), amplitude=lambda t: min(1.0, 4 * t))
    return ub.Scene(
        [lower, upper], joints=[ball], supports=[ub.Clamped(lower.start)], connectors=turns,
        loads=[push],
    )  # fmt: skip


@IN_LONG_CELLS
def test_balance_of_hinges_about_several_axes():
    run = ub.simulate(two_hinges(), ub.EnergyMomentum(), t=(0, 2), dt=0.01, newton=EXACT)
    largest = run.energy["loads"].max()
    assert np.abs(run.energy.imbalance).max() < 1e-12 * largest
    connectors = [*run.scene.connectors[:2], *run.scene.hinges]
    lost = [run.connector(x).dissipated[-1] for x in connectors]
    lost.append(run.material(run.scene.beams[1]).hinge.sum())
    assert np.isclose(sum(lost), run.energy["hinges"][-1], rtol=1e-12)
    assert min(lost) > 0, "all hinges open"


@pytest.mark.serial
@pytest.mark.parametrize("kind", ["between nodes", "in a cell", "about two axes"])
def test_moment_of_a_hinge_equals_its_law_to_330_degrees(kind):
    """A cell is turned about axis 3 by a motor.

    In a cell the derivative of the series of the angle has a relative error of 6e-9 at 330 degrees.
    """
    law, stiff = (
        ub.LinearSoftening(8.0, fracture_energy=60.0),
        STIFF | OTHER | {"EA": 1e6, "GA": 1e6},
    )
    hinges = {"between nodes": {0.0: law}, "in a cell": {0.0: None, 1.0: None}}.get(kind, {})
    section = ub.Section(**stiff, hinge=law if kind == "in a cell" else None)
    beam = ub.Beam((0, 0, 0), (1, 0, 0), section, cells=1, hinges=hinges)
    turns, foot = [], (ub.ground(0, 0, 0), beam.start)
    if kind == "about two axes":
        turns = [ub.Turn(*foot, ub.RigidPlastic(law), axis=x) for x in ((0, -1, 0), (0, 0, 1))]
        turns.append(ub.Turn(*foot, ub.Spring(1e6), axis=(1, 0, 0)))
    motor = ub.Turn(
        ub.ground(1, 0, 0), beam.end, ub.PrescribedMotion(lambda t: np.radians(330) * t),
        axis=(0, -1, 0),
    )  # fmt: skip
    scene = ub.Scene(
        [beam], joints=[ub.Spherical(*foot)] * bool(turns), connectors=[*turns, motor],
        supports=[ub.Clamped(beam.start)] * (not turns),
    )  # fmt: skip
    if kind == "in a cell":
        with pytest.warns(ub.ModelWarning, match="turned by 329 degrees.*times too stiff"):
            run = ub.simulate(scene, ub.Static(), t=(0, 1), dt=0.01)
        jump = np.array([run.material(beam, n).jump[0] for n in range(len(run))])
    else:
        run = ub.simulate(scene, ub.Static(), t=(0, 1), dt=0.01)
        jump = run.connector(turns[0] if turns else run.scene.hinges[0]).motion
    moment = -run.connector(motor).force
    opened = slice(5, None)
    rtol = 1e-8 if kind == "in a cell" else 1e-9
    assert np.allclose(moment[opened], law.traction(np.abs(jump[opened])), rtol=rtol)
    assert np.allclose(run.section_forces(beam)[0, 5], moment[-1], rtol=1e-7)
    area = 8.0 * np.abs(jump[-1]) - 8.0**2 / (4 * 60.0) * jump[-1] ** 2  # of the law, to the jump
    assert np.isclose(run.energy["hinges"][-1], area, rtol=1e-8)


@pytest.mark.serial
@pytest.mark.filterwarnings("ignore:beam. the hinge:ufl_beam.ModelWarning")
@pytest.mark.parametrize(
    ("hinge", "sprung", "words"),
    [
        (True, False, "hinge in a cell, beam at .* by 3[56].°.* Beam.hinges="),
        (False, False, "A cell, beam at .* is bent or twisted by 3[56].°.* more cells"),
        (False, True, "Turn.ground.* turns by 360° about an axis that is not its own"),
    ],
)
def test_error_names_the_place_that_turns_by_360_degrees(hinge, sprung, words):
    law = ub.LinearSoftening(8.0, fracture_energy=60.0) if hinge else None
    section, ends = ub.Section(**STIFF | OTHER, hinge=law), {0.0: None, 1.0: None}
    beam = ub.Beam((0, 0, 0), (1, 0, 0), section, cells=1, hinges=ends)
    axis, ground = (0, -1, 0), ub.ground(1, 0, 0)
    angle = {} if sprung else {"psi": lambda t: np.radians(410) * t}
    drive = ub.PrescribedDisplacement(beam.end, axis=axis, **angle)
    spring = ub.Turn(ground, beam.end, ub.Spring(1.0), axis=(1, -1, 0))
    held = [ub.Clamped(beam.start)] * (not sprung)
    push = ub.PointLoad(beam.end, moment=(0, -500.0, 0))
    scene = ub.Scene(
        [beam], supports=[drive, *held], connectors=[spring] * sprung, loads=[push] * sprung
    )
    with pytest.raises(ub.ConvergenceError, match=words):
        ub.simulate(scene, ub.EnergyMomentum(), t=(0, 1), dt=0.01, progress=False)


@pytest.mark.parametrize("scheme", [ub.EnergyMomentum(), ub.Static()], ids=str)
@pytest.mark.parametrize("kind", ["support", "joint", "joint of beams"])
def test_hinges_about_the_axis_of_a_support_or_joint_are_left_out(kind, scheme):
    """Nothing bears a moment about it, as at a pin in the plane; a hinge of any limit may be there.

    Also in a skew beam, in which round-off would be the stiffness of the node.
    """
    end, up = np.array([1.0, 2.0, 2.0]), (0.3, -1.0, 0.2)
    section, weak = ub.Section(**STIFF | OTHER), ub.LinearSoftening(0.0, fracture_energy=1.0)
    found = []
    for hinges in ({}, {0.0: weak}):
        beam = ub.Beam((0, 0, 0), tuple(end), section, cells=3, up=up, hinges=hinges)
        other = ub.Beam((0, 0, 0), tuple(-end), section, cells=1, up=up)
        axis, of_beams = tuple(2 * np.array(beam.third_axis(0.0))), kind == "joint of beams"
        base = other.start if of_beams else ub.ground(0, 0, 0)
        hinge = ub.PrescribedDisplacement(beam.start, u=0, v=0, w=0, axis=axis)
        scene = ub.Scene(
            [beam] + [other] * of_beams,
            joints=[ub.Revolute(base, beam.start, axis=axis)] * (kind != "support"),
            supports=[hinge] * (kind == "support") + [ub.Clamped(other.end)] * of_beams
            + [ub.Pinned(beam.end)],
            loads=[ub.PointLoad(beam.at(0.5), force=(1.0, 2.0, 3.0))],
        )  # fmt: skip
        assert not scene.hinges
        run = ub.simulate(scene, scheme, t=(0, 1), dt=0.25, progress=False)
        found.append(run.displacement(beam.at(0.5)))
    assert np.array_equal(*found)
    tilted = ub.PrescribedDisplacement(beam.start, u=0, v=0, w=0, axis=tuple(end))
    assert len(ub.Scene([beam], supports=[tilted, ub.Pinned(beam.end)]).hinges) == 1


# -- fibres --------------------------------------------------------------------------------------

a, E, fy = 0.2, 210e9, 355e6  # m, Pa, Pa


def square(m, angle, law):
    """Fibres of a square of side a, turned by an angle."""
    x = (np.arange(m) + 0.5) * a / m - a / 2
    y, z = (u.ravel() for u in np.meshgrid(x, x))
    c, s = np.cos(angle), np.sin(angle)
    return ub.Section.of_fibres(
        c * y - s * z, np.full(m * m, (a / m) ** 2), z=s * y + c * z, E=E, nu=0.3, rho=7850.0,
        torsion=0.1406 * a**4, fibres=ub.Fibres(law),
    )  # fmt: skip


@pytest.mark.parametrize("axis", [(0, -1, 0), (0, 0, 1)])
@pytest.mark.parametrize(("m", "angle"), [(4, 0.0), (6, 0.0), (4, np.pi / 4), (6, np.pi / 4)])
def test_limit_moment_of_a_square_of_fibres(m, angle, axis):
    """About a side a³/4 fy; about a diagonal the sum of A |distance| fy, 0.22097 and 0.22915."""
    law = ub.ElastoPlastic(fy, isotropic=1e3)  # Pa; without it, the axial stiffness vanishes
    beam = ub.Beam((0, 0, 0), (1, 0, 0), square(m, angle, law), cells=1)
    motor = ub.Turn(ub.ground(1, 0, 0), beam.end, ub.PrescribedMotion(lambda t: t), axis=axis)
    scene = ub.Scene([beam], supports=[ub.Clamped(beam.start)], connectors=[motor])
    run = ub.simulate(scene, ub.Static(), t=(0, 0.3), dt=0.01)
    x = (np.arange(m) + 0.5) / m - 0.5
    across = np.abs(np.add.outer(x, x)) / np.sqrt(2) if angle else np.abs(np.add.outer(x, 0 * x))
    limit = fy * a**3 * across.sum() / m**2
    moments = run.section_forces(beam)[0, 4:]
    assert np.isclose(np.abs(moments).max(), limit, rtol=1e-6)
    assert np.isclose(
        limit / (fy * a**3), {0: 0.25, 4: 0.22097, 6: 0.22915}[m if angle else 0], rtol=3e-5
    )
    assert np.isclose(-run.connector(motor).force[-1], limit, rtol=1e-6)


def test_fibres_at_z_bend_about_axis_2_as_fibres_at_y_do_in_the_plane():
    """Unequal fibres, whose signs matter; they crack and yield.  z is to the left in the plane."""
    y, A = np.array([-0.08, -0.02, 0.03, 0.09]), np.array([2e-3, 1e-3, 1e-3, 3e-3])
    laws = [ub.Fibres(ub.ElastoPlastic(x, isotropic=5e9)) for x in (200e6, 250e6, 300e6, 120e6)]
    material = {"E": 70e9, "nu": 0.3, "fibres": laws, "rho": 2700.0}
    flat = ub.Section.of_fibres(y, A, **material)
    twice = {name: [*x, *x] if isinstance(x, list) else x for name, x in material.items()}
    solid = ub.Section.of_fibres(
        [-0.05] * 4 + [0.05] * 4, [*A / 2, *A / 2], z=[*y, *y], torsion=1e-5, **twice
    )
    runs = []
    for section, at in ((flat, in_plane), (solid, skew)):
        # axis 2 is out of the plane, so that axis 3 is to the left
        up = {} if at is in_plane else {"up": tuple(-SKEW.apply([0, 0, 1.0]))}
        beam = ub.Beam(at(0, 0), at(1.6, 1.2), section, cells=4, **up)
        load = ub.PointLoad(beam.end, force=at(-3e4, 4e4), amplitude=lambda t: np.sin(30 * t))
        scene = ub.Scene([beam], supports=[ub.Clamped(beam.start)], loads=[load])
        runs.append(ub.simulate(scene, ub.EnergyMomentum(), t=(0, 0.2), dt=2e-3, newton=EXACT))
    plane, space = (run.displacement(run.scene.beams[0].end) for run in runs)
    moved = SKEW.inv().apply(space[:, :3])
    assert np.abs(moved[:, :2] - plane[:, :2]).max() < 1e-12 * 2
    assert np.abs(moved[:, 2]).max() < 1e-12 * 2
    lost = [run.energy["plastic"][-1] for run in runs]
    assert lost[0] > 0.1 * runs[0].energy["loads"].max()
    assert np.isclose(*lost, rtol=1e-11)
    M = [run.section_forces(run.scene.beams[0])[:, k] for run, k in zip(runs, (2, 4), strict=True)]
    assert np.corrcoef(*M)[0, 1] < -0.99, "axis 2 is along the negative normal of the plane"


def test_fibres_of_large_limits_are_elastic():
    elastic, fibres = (
        square(4, 0.0, ub.ElastoPlastic(np.inf)),
        square(4, 0.0, ub.ElastoPlastic(1e15)),
    )
    tips = []
    for section in (elastic, fibres):
        beam = ub.Beam((0, 0, 0), (2, 1, 0.5), section, cells=4)
        load = ub.PointLoad(beam.end, force=(2e5, -3e5, 4e5), moment=(5e5, 0, 0))
        scene = ub.Scene([beam], supports=[ub.Clamped(beam.start)], loads=[load])
        run = ub.simulate(scene, ub.EnergyMomentum(), t=(0, 0.02), dt=1e-3, newton=EXACT)
        tips.append(run.displacement(beam.end))
    assert np.abs(tips[0] - tips[1]).max() < 1e-12


# -- errors --------------------------------------------------------------------------------------


def test_refused_by_name():
    points = (0, 0, 0), (1, 0, 0)
    coupled = ub.Section(**STIFF, **OTHER, interaction=st.AxialBending(10.0, 8.0))
    with pytest.raises(ub.ModelError, match="girder: interaction of N and M is for scenes in the"):
        ub.Scene([ub.Beam(*points, coupled, name="girder")])
    twisted = ub.Section(**STIFF, twisting=ub.ElastoPlastic(1.0))
    with pytest.raises(ub.ModelError, match="girder: its section has no GA3, EI2, GJ"):
        ub.Scene([ub.Beam(*points, twisted, name="girder")])
    steel = ub.Fibres(ub.ElastoPlastic(355e6))
    material = {"E": 210e9, "nu": 0.3, "fibres": steel, "torsion": 1e-6}
    with pytest.raises(ub.ModelError, match="3 coordinates z of 2 fibres"):
        ub.Section.of_fibres([-0.1, 0.1], [1e-3, 1e-3], z=[0, 0, 0], **material)
    with pytest.raises(ub.ModelError, match=r"axes 2 and 3 must be principal axes.* 0 and 0 N m"):
        ub.Section.of_fibres([-0.1, 0.1], [1e-3, 1e-3], z=[0.1, 0.1], **material)
    with pytest.raises(ub.ModelError, match="axes 2 and 3 must be principal axes"):
        ub.Section.of_fibres([-0.1, 0.1], [1e-3, 1e-3], z=[-0.1, 0.1], **material)


def test_parts_that_yield_in_space_only():
    for name, law in SIX.items():
        beam = ub.Beam((0, 0, 0), (1, 0, 0), ub.Section(**STIFF, **OTHER, **{name: law}))
        assert [part for part, _ in parts_that_switch(ub.Scene([beam]))] == [beam.name], name


@pytest.mark.serial
def test_solution_with_fibres_is_saved(tmp_path):
    beam = ub.Beam((0, 0, 0), (1, 0, 0), square(4, 0.0, ub.ElastoPlastic(fy)), cells=2)
    load = ub.PointLoad(beam.end, force=(0, 1e6, 2e6), amplitude=lambda t: t)
    scene = ub.Scene([beam], supports=[ub.Clamped(beam.start)], loads=[load])
    run = ub.simulate(scene, ub.EnergyMomentum(), t=(0, 0.01), dt=1e-3)
    run.save(tmp_path / "run.npz")
    loaded = ub.Solution.load(tmp_path / "run.npz")
    (own,) = loaded.scene.beams
    assert np.array_equal(own.section.fibres.z, beam.section.fibres.z)
    assert np.array_equal(loaded.section_forces(own), run.section_forces(beam))
    assert np.array_equal(loaded.variables(own)["plastic"], run.variables(beam)["plastic"])


@pytest.mark.filterwarnings("ignore:.*times too stiff")
@pytest.mark.parametrize("degrees", [60, 90, 120])
def test_stiffness_across_an_embedded_hinge(degrees):
    """Too large by ((Θ/2)/sin(Θ/2))², as docs/space.md says: a broken hinge, turned, then twisted.

    The frame of the cell is in the middle between its nodes, so axis 1 of the cell is at Θ/2.
    """
    Θ, law = np.radians(degrees), ub.LinearSoftening(1.0, fracture_energy=0.05)
    section = ub.Section(**STIFF, **OTHER, hinge=law)
    beam = ub.Beam(
        (0, 0, 0), (1, 0, 0), section, cells=1, up=(0, 1, 0), hinges={0.0: None, 1.0: None}
    )
    turn = ub.PrescribedMotion(lambda t: Θ * min(t, 1.0))
    motor = ub.Turn(ub.ground(1, 0, 0), beam.end, turn, axis=(0, 0, 1))
    along = np.array([np.cos(Θ / 2), np.sin(Θ / 2), 0.0])
    twist = ub.PointLoad(beam.end, moment=tuple(1e-2 * along), amplitude=lambda t: float(t > 1.001))
    scene = ub.Scene([beam], supports=[ub.Clamped(beam.start)], connectors=[motor], loads=[twist])
    run = ub.simulate(scene, ub.Static(), t=(0, 1.02), dt=0.02, newton=EXACT)
    before, after = (Rotation.from_rotvec(x[3:]) for x in run.displacement(beam.end)[-2:])
    small = (after * before.inv()).as_rotvec()
    stiffness = 1e-2 / (small @ along)
    factor = (Θ / 2 / np.sin(Θ / 2)) ** 2
    assert np.isclose(stiffness, 400.0 * factor, rtol=1e-4)  # GJ/h
