# SPDX-License-Identifier: MIT
"""Bodies, joints and connectors: what is refused, what is shared, what solutions say."""

import math
from dataclasses import replace
from functools import partial

import numpy as np
import pytest
from helpers import raises, run
from scenes import clamped

import ufl_beam as ub
from ufl_beam.discretization.dof_numbering import DofNumbering
from ufl_beam.simulation.step_equation import equation_of_scene

SECTION = ub.Section(EA=1e4, GA=1e4, EI=10.0, rhoA=1.0, rhoI=0.01)


def body(x=0.0, y=0.0, name="body", **more):
    return ub.Body((x, y), **({"mass": 1.0, "inertia": 0.1} | more), name=name)


def beam(a=(0, 0), b=(1, 0), name="beam", cells=2):
    return ub.Beam(a, b, SECTION, cells=cells, name=name)


run = partial(run, t=(0, 0.1), dt=0.01)
at_rest = partial(run, scheme=ub.Static(), t=(0, 1), dt=1.0)

# -- bad input -----------------------------------------------------------------------------------

PLACE, HERE = beam().end, body(1.0).middle
BAD = {
    "axis": (
        lambda: ub.Prismatic(ub.ground(0, 0), PLACE, axis=(0, 0)),
        "Prismatic(ground (0, 0), beam.end (1, 0)): the axis has zero length",
    ),
    "axis of one point": (lambda: ub.Prismatic(ub.ground(1, 0), PLACE), "the axis has zero length"),
    "link": (lambda: ub.Link(ub.ground(1, 0), PLACE), "Link(ground (1, 0), beam.end (1, 0)): zero"),
    "rigid link": (lambda: ub.RigidLink(PLACE, HERE), "zero length; join the places"),
    "stretch": (lambda: ub.Stretch(PLACE, HERE, ub.Spring(1.0)), "zero length"),
    "stop": (lambda: ub.Stop(1.0, low=0.1, high=0.2), "Stop: the interval from low = 0.1"),
    "no stop": (lambda: ub.Stop(1.0), "have at least one end"),
    "friction": (lambda: ub.Coulomb(), "Coulomb: force and coefficient are both zero"),
    "friction of what": (lambda: ub.Coulomb(coefficient=0.1), "give coefficient and joint"),
    "release": (lambda: ub.Release(PLACE, HERE, free="X"), "letters of 'NVM'"),
    "no release": (lambda: ub.Release(PLACE, HERE, free=""), "letters of 'NVM'"),
    "guide": (
        lambda: ub.Scene([PLACE.beam], joints=[ub.Guided(PLACE, lambda s: (s, 1.0))]),
        "must be at the place"),
    "guide at rest": (lambda: ub.Guided(PLACE, lambda s: (1.0, 0.0)), "the curve has no direction"),
    "guide of a rim": (lambda: ub.Guided(body().at(1, 0), lambda s: (1, s)), "the centre of the"),
    "clamp of a rim": (lambda: ub.Clamped(body().at(1, 0)), "is not the centre of the body"),
    "clamp of the ground": (lambda: ub.Clamped(ub.ground(1, 0)), "does not move"),
    "follower at a rim": (
        lambda: ub.FollowerLoad(body().at(1, 0), force=(1, 0)), "not the centre of the body"),
}  # fmt: skip


@pytest.mark.parametrize(("build", "text"), BAD.values(), ids=BAD)
def test_wrong_records_are_refused(build, text):
    with raises(text):
        build()


ONE, OTHER = body(name="one"), body(1.0, name="other")
LINK = ub.Link(ONE.middle, OTHER.middle)


def test_wrong_scenes_are_refused():
    inner = ub.Stretch(ONE.middle, ONE.at(0.5, 0), ub.Spring(1.0))
    base = {"joints": [ub.Rigid(ONE.middle, ub.ground(0, 0))], "supports": [ub.Clamped(ONE.middle)]}
    apart = ub.Revolute(ONE.at(0.5, 0), OTHER.middle)
    for bodies, more, text in (
        ([], {}, "Scene: no beams and no bodies"),
        ([ONE], {"joints": [LINK]}, "other is not in the scene; add it to bodies"),
        ([ONE, ONE], {}, "one is in the scene twice, as bodies[0] and bodies[1]"),
        ([ONE], {"connectors": [inner]}, "both ends are at the same body or cross-section"),
        ([ONE, OTHER], {"joints": [apart]}, "joint ends lie 0.5 m apart"),
        ([ONE], base, "supports in conflict: the ground and Clamped"),
    ):
        with raises(text):
            ub.Scene(bodies=bodies, **more)


def test_velocities_must_agree_with_joints():
    start = [ub.Velocity((OTHER,), linear=(1.0, 0.0))]
    with raises("the parts that Link(one (0, 0), other (1, 0)) joins would move apart at 1 m/s"):
        run(ub.Scene(bodies=[ONE, OTHER], joints=[LINK], initial=start))


# -- bodies without mass ---------------------------------------------------------------------------


def test_bodies_need_mass_in_dynamics():
    with raises("mass or resistance for every motion: ghost", "without mass"):
        run(ub.Scene(bodies=[ub.Body((0, 0), name="ghost")]))
    with raises("mass or resistance for every motion: ghost", "can turn", "inertia"):
        run(ub.Scene(bodies=[ub.Body((0, 0), mass=1.0, name="ghost")]))


def test_what_is_carried_or_moved_needs_no_mass():
    hub, one = ub.Body((0, 0), name="hub"), beam()
    moved = ub.PrescribedDisplacement(hub.middle, u=0, v=0, psi=lambda t: t)
    fixed = {"beams": [one], "bodies": [hub], "joints": [ub.Rigid(hub.middle, one.start)]}
    solution = run(ub.Scene(**fixed, supports=[moved]))
    assert solution.displacement(one.start)[-1, 2] == pytest.approx(0.1)
    run(ub.Scene(**fixed))
    with raises("hub", "can turn"):
        run(ub.Scene(**fixed | {"joints": [ub.Revolute(hub.middle, one.start)]}))


def panel_zone(mass):
    """Joint of a frame whose panel is two bodies with arms, a pin and a spring; pushed by 1 kN."""
    section = ub.Section.rectangle(b=0.2, h=0.3, E=210e9, nu=0.3, rho=7850.0)
    lower = ub.Beam((0, -2), (0, -0.3), section, cells=2, name="lower")
    upper = ub.Beam((0, 0.3), (0, 2), section, cells=2, name="upper")
    girder = ub.Beam((0.2, 0), (4, 0), section, cells=2, name="girder")
    parts = [ub.Body((0, 0), mass=mass, inertia=mass, name=f"panel {n}") for n in range(2)]
    joints = [
        ub.Rigid(lower.end, parts[0].at(0, -0.3)), ub.Rigid(upper.start, parts[0].at(0, 0.3)),
        ub.Rigid(girder.start, parts[1].at(0.2, 0)), ub.Revolute(*(x.middle for x in parts)),
    ]  # fmt: skip
    turn = ub.Turn(*(x.middle for x in parts), ub.Spring(6e7))
    supports = [ub.Pinned(lower.start), ub.Roller(girder.end)]
    push = ub.PointLoad(upper.end, force=(1e3, 0), amplitude=lambda t: min(t / 0.05, 1.0))
    members = [lower, upper, girder]
    return ub.Scene(
        members, bodies=parts, joints=joints, connectors=[turn], supports=supports, loads=[push]
    )


@pytest.mark.parametrize(
    "scheme", [ub.EnergyMomentum(), ub.EnergyMomentumDecaying(0.8), ub.GeneralizedAlpha(0.8)],
    ids=lambda scheme: type(scheme).__name__,
)  # fmt: skip
def test_bodies_that_carry_beams_need_no_mass(scheme):
    """The motion and the ledger are those with 1e-6 kg."""
    ends = []
    for mass in (0.0, 1e-6):
        scene = panel_zone(mass)
        solution = run(scene, scheme, t=(0, 0.2), dt=2e-3)
        ends.append(solution.displacement(scene.beams[1].end))
        if not isinstance(scheme, ub.GeneralizedAlpha):
            assert solution.energy.worst < 1e-9
    assert np.allclose(*ends, rtol=0.0, atol=1e-6 * np.abs(ends[0]).max())


def test_modes_with_bodies_without_mass():
    scenes = [replace(panel_zone(mass), loads=()) for mass in (0.0, 1e-6)]
    assert np.allclose(*(ub.modes(scene, 6).frequencies for scene in scenes), rtol=1e-6)


# -- constraints that repeat, and mechanisms -------------------------------------------------------


def parallelogram(cranks):
    """A coupler on parallel cranks, all of them bodies."""
    arms = [body(x, 0.5, name=f"crank {x}") for x in range(cranks)]
    coupler = body(1.0, 1.0, name="coupler")
    joints = [ub.Revolute(ub.ground(x, 0), arm.at(x, 0)) for x, arm in enumerate(arms)]
    joints += [ub.Revolute(arm.at(x, 1), coupler.at(x, 1)) for x, arm in enumerate(arms)]
    idle = body(9.0, 9.0, name="idle")
    return ub.Scene(
        bodies=[*arms, coupler, idle], joints=[*joints, ub.Revolute(idle.middle, ub.ground(9, 9))]
    )


def test_redundant_loops_are_refused_by_name():
    ub.Simulation(parallelogram(2), ub.EnergyMomentum()).close()
    with pytest.raises(ub.ArgumentError) as refused:
        ub.Simulation(parallelogram(3), ub.EnergyMomentum())
    message = str(refused.value)
    assert "constraints repeat or contradict each other: 1 of the constraints of" in message
    for x in range(3):
        assert f"Revolute(ground ({x}, 0), crank {x} ({x}, 0))" in message
        assert f"Revolute(crank {x} ({x}, 1), coupler ({x}, 1))" in message
    assert "idle" not in message


def test_contradictions_are_refused_by_name():
    one = beam()
    drive = ub.Turn(ub.ground(0, 0), one.start, ub.PrescribedMotion(lambda t: t))
    turned = "Turn(ground (0, 0), beam.start (0, 0)) with PrescribedMotion"
    with raises(f"{turned}; Clamped at beam.start (0, 0) can be left out"):
        run(clamped(one, connectors=[drive]))
    axes = (1, 0), (-1, 0)
    rails = [ub.Prismatic(ub.ground(0, 0), one.end, axis=x, turning=True) for x in axes]
    with raises("Prismatic(ground (0, 0), beam.end (1, 0)) can be left out"):
        run(ub.Scene([one], joints=rails, supports=[ub.Pinned(one.start)]))
    slope = ub.Roller(one.end, along=(1, 1))
    rail = ub.Prismatic(ub.ground(0, -1), one.end, axis=(1, 1), turning=True)
    with raises("Roller at beam.end (1, 0) can be left out"):
        run(ub.Scene([one], joints=[rail], supports=[ub.Pinned(one.start), slope]))


def test_a_linkage_in_a_singular_position_is_told_so():
    """A flat parallelogram repeats a constraint only here; a second motor does everywhere."""

    def linkage(angle, motors):
        a = np.array([np.cos(angle), np.sin(angle)])
        b = np.add(a, (2, 0))
        ends = ((0, 0), a), (a, b), ((2, 0), b)
        parts = [body(*(np.array(x) + y) / 2, name=f"rod {i}") for i, (x, y) in enumerate(ends)]
        pins = [(ub.ground(0, 0), parts[0].at(0, 0)), (ub.ground(2, 0), parts[2].at(2, 0))]
        pins += [(parts[i].at(*x), parts[i + 1].at(*x)) for i, x in enumerate((a, b))]
        motor = ub.PrescribedMotion(lambda t: t)
        turns = [ub.Turn(ub.ground(0, 0), parts[0].middle, motor)] * motors
        turns = [replace(turn) for turn in turns]
        return ub.Scene(bodies=parts, joints=[ub.Revolute(*p) for p in pins], connectors=turns)

    run(linkage(0.5, 1))
    with raises("1 of the constraints", "can be left out", "dead centre", "another position"):
        run(linkage(0.0, 1))
    with pytest.raises(ub.ArgumentError, match="can be left out") as refused:
        run(linkage(0.5, 2))
    assert "position" not in str(refused.value)


def test_statics_names_what_is_free():
    one = body(name="loose")
    hung = ub.Scene(bodies=[one], joints=[ub.Revolute(one.at(1, 0), ub.ground(1, 0))])
    turns = [ub.Turn(ub.ground(0, 0), one.middle, x) for x in (ub.Spring(1.0), ub.Damper(1.0))]
    at_rest(replace(hung, connectors=turns[:1]))  # a spring resists, a damper does not
    for scene in (hung, replace(hung, connectors=turns[1:])):
        with raises("loose (body 0) can turn about (1, 0)"):
            at_rest(scene)


def test_derivatives_of_undeformed_motions():
    """[reference] `rigidly` of connectors: differences of the motions that `blocks/` computes."""
    rod, mast = beam((0, 0), (2, 1), name="rod"), beam((2, 1), (3, 3), name="mast")
    hub, rim = body(1.0, 2.0, name="hub"), body(-1.0, 1.0, name="rim")
    spring, hole = ub.Spring(1.0), ub.Clearance(1.0, gap=1.0, friction=0.1, radius=0.1)
    joints = [
        ub.Revolute(rod.end, mast.start, multipliers=True),
        ub.Rigid(hub.at(2, 1), mast.start),
        ub.Prismatic(rim.at(0, 2), hub.at(1, 3), axis=(1, 2)),
        ub.RigidLink(mast.end, hub.at(0, 1)),
        ub.Link(rod.start, rim.at(-1, 2)),
        ub.Guided(mast.end, lambda s: (3 + s, 3 + s + s**2)),
        ub.Release(rod.at(0.5), rim.at(1, 0.5), free="V"),
    ]
    connectors = [
        ub.Turn(ub.ground(0, 1), hub.middle, spring),
        ub.Stretch(ub.ground(3, 0), hub.at(0, 3), spring),
        ub.Slide(rim.at(0, 3), rod.end, spring, axis=(1, 1)),
        ub.Slide(ub.ground(0, 3), rod.end, spring),
        ub.Bushing(hub.at(1, 3), rim.at(2, 2), hole, axis=(3, 1)),
    ]
    loads = [ub.PointLoad(rim.at(2, 2), force=(1, 0), moment=1.0)]
    scene = ub.Scene(
        [rod, mast], bodies=[hub, rim], joints=joints, connectors=connectors, loads=loads
    )
    equation = equation_of_scene(DofNumbering(scene, ub.Mesh()), ub.EnergyMomentum(), 0.0)
    numbering, seen, ε = equation.subdomain.numbering, 0, 1e-5
    ground, steps = numbering.node(ub.ground(0, 0)), ε * np.eye(numbering.size)
    steps[ground] = 0.0  # its motion is zero, and `Guided` does not read it
    for group in equation.connector_terms:
        dofs = numbering.dofs_of_connectors[group.indices]
        for k, connector in enumerate(group.connectors):
            derivatives = np.zeros(numbering.size)
            for first, by_end in enumerate(connector.rigidly()):
                # ends may share a degree of freedom
                np.add.at(derivatives, dofs[k][first : first + 5 : 2], by_end)
            derivatives[ground] = 0.0
            slopes = [(group.motion(q)[k] - group.motion(-q)[k]) / (2 * ε) for q in steps]
            np.testing.assert_allclose(slopes, derivatives, atol=1e-8, err_msg=str(connector))
            seen += 1
    assert seen == len(scene.all_connectors)


# -- forces of joints ------------------------------------------------------------------------------


def test_bodies_pinned_to_each_other_away_from_their_centres():
    """[closed] A double pendulum of rods of 1 m and 1 kg; both small modes of M and K by Lagrange.

    Such a joint shares no unknown, and needs no `multipliers=True`.
    """
    upper, lower = (body(0.0, y, inertia=1 / 12) for y in (-0.5, -1.5))
    joints = [
        ub.Revolute(ub.ground(0, 0), upper.at(0, 0)),
        ub.Revolute(upper.at(0, -1), lower.at(0, -1)),
    ]
    scene = ub.Scene(bodies=[upper, lower], joints=joints, loads=[ub.Gravity()])
    M, K = np.array([[4 / 3, 1 / 2], [1 / 2, 1 / 3]]), 9.81 * np.diag([3 / 2, 1 / 2])
    omega = np.sqrt(np.linalg.eigvals(np.linalg.solve(M, K)))
    assert ub.modes(scene, 2).omega == pytest.approx(np.sort(omega), rel=1e-9)
    for scheme in (ub.Static(), ub.EnergyMomentumStatic()):
        hung = run(scene, scheme)
        assert np.abs(hung.displacement(lower.middle)).max() < 1e-12
        # Weights of one and of two rods, to the tolerance 1e-10 of Newton's method
        forces = [hung.joint(joint).force[-1] for joint in joints]
        np.testing.assert_allclose(forces, [[0, 19.62], [0, 9.81]], atol=1e-8)
    with raises("free to move in 2 independent ways"):
        ub.buckling(scene, 1)
    # A body without inertia that is fixed to another one
    light = ub.Body((0, -1.5))
    fixed = [joints[0], ub.Rigid(upper.at(0, -1), light.at(0, -1))]
    run(ub.Scene(bodies=[upper, light], joints=fixed, loads=[ub.Gravity()]))


def test_forces_of_a_joint_at_rest():
    """A hung frame: the joint bears the weight below it, and its moment."""
    left, right = beam(), beam((1, 0), (2, 0), name="right")
    joint = ub.Rigid(left.end, right.start, multipliers=True)
    load = ub.PointLoad(right.end, force=(0.0, -0.01))
    supports = [ub.Clamped(left.start)]
    solution = at_rest(ub.Scene([left, right], joints=[joint], supports=supports, loads=[load]))
    history = solution.joint(joint)
    turn = solution.displacement(left.end)[-1, 2]
    arm = solution.position(right.end)[-1] - solution.position(right.start)[-1]
    assert history.force[-1] == pytest.approx([0.0, 0.01], abs=1e-10)
    assert history.moment[-1] == pytest.approx(0.01 * arm[0], rel=1e-8)
    along, across = 0.01 * math.sin(turn), 0.01 * math.cos(turn)
    assert history.in_a[-1] == pytest.approx([along, across], abs=1e-10)
    assert history.in_b[-1] == pytest.approx(history.in_a[-1], abs=1e-12)
    assert history.motion == pytest.approx(np.zeros((2, 3)), abs=1e-12)


@pytest.mark.parametrize("multipliers", [False, True])
def test_force_of_a_joint_of_three_places(multipliers):
    """A body holds two beams at one of its points, and a third place may share unknowns."""
    body = ub.Body((0, 0), mass=1.0, inertia=0.1)
    pin, a, b = body.at(1, 0), beam((1, 0), (2, 0), name="a"), beam((1, 0), (1, 1), name="b")
    loads = [ub.PointLoad(a.end, force=(0.02, 0.01)), ub.PointLoad(b.end, force=(0.0, 0.03))]

    def force(*places):
        joint = ub.Rigid(*places, multipliers=multipliers)
        held = {"bodies": [body], "supports": [ub.Clamped(body.middle)], "loads": loads}
        return at_rest(ub.Scene([a, b], joints=[joint], **held)).joint(joint).force[-1]

    if multipliers:
        assert force(pin, a.start, b.start) == pytest.approx([-0.02, -0.01], abs=1e-10)
        assert force(a.start, b.start, pin) == pytest.approx([0.0, -0.03], abs=1e-10)
    else:
        for places in ((pin, a.start, b.start), (a.start, b.start, pin)):
            with raises("share unknowns, so that the force between them"):
                force(*places)
    assert force(a.start, pin, b.start) == pytest.approx([0.02, 0.04], abs=1e-10)


# -- results -------------------------------------------------------------------------------------


def test_questions_about_joints():
    left, right = beam(), beam((1, 0), (2, 0))
    joint, other = ub.Rigid(left.end, right.start), ub.Revolute(left.end, right.start)
    solution = run(ub.Scene([left, right], joints=[joint]))
    with raises("Rigid(beam.end (1, 0), beam.start (1, 0)) shares unknowns"):
        solution.joint(joint)
    with raises("is not in the scene"):
        solution.joint(other)
    with raises("is not in the scene"):
        solution.connector(ub.Turn(left.end, right.start, ub.Spring(1.0)))


def test_points_of_bodies():
    """A spinning disc: points, velocities and momenta of a rigid motion."""
    disc = body(1.0, 2.0, mass=3.0, inertia=0.5)
    scene = ub.Scene(bodies=[disc], initial=[ub.Velocity((disc,), (1.0, 0.5), 2.0, (1.0, 2.0))])
    solution = run(scene, t=(0, 1))
    rim, t = disc.at(1.5, 2.0), solution.times
    # 2 tan(Δψ/2) = ω Δt: the midpoint rule turns a little less, by (ω Δt)²/12
    angle = 2 * np.arctan(0.01) * t / 0.01
    expected = [1 + t + 0.5 * np.cos(angle), 2 + 0.5 * t + 0.5 * np.sin(angle)]
    assert solution.position(rim) == pytest.approx(np.transpose(expected), abs=1e-11)
    speed = [1 - np.sin(angle), 0.5 + np.cos(angle), 2 + 0 * t]
    assert solution.velocity(rim) == pytest.approx(np.transpose(speed), abs=1e-10)
    momentum = [3, 1.5, 3 * (1.0 * 0.5 - 2.0 * 1.0) + 0.5 * 2.0]
    assert solution.momentum() == pytest.approx(np.tile(momentum, (101, 1)), abs=1e-10)
    assert "1 body, 3 degrees of freedom" in str(solution)
