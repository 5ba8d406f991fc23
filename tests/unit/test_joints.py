# SPDX-License-Identifier: MIT
"""Bodies, joints and connectors: what is refused, what is shared, what solutions say."""

import math
import time
from dataclasses import replace
from functools import partial
from itertools import pairwise

import numpy as np
import pytest
from helpers import raises, run
from scenes import rigid_chain

import ufl_beam as ub
from ufl_beam.discretization.dof_numbering import DofNumbering
from ufl_beam.model.constraint_checks import require_no_mechanism
from ufl_beam.simulation.step_equation import equation_of_scene

SECTION = ub.Section(EA=1e4, GA=1e4, EI=10.0, rhoA=1.0, rhoI=0.01)


def body(x=0.0, y=0.0, name="body", **more):
    return ub.Body((x, y), **({"mass": 1.0, "inertia": 0.1} | more), name=name)


def beam(a=(0, 0), b=(1, 0), name="beam", cells=2):
    return ub.Beam(a, b, SECTION, cells=cells, name=name)


run = partial(run, t=(0, 0.1), dt=0.01)


# -- bad input -----------------------------------------------------------------------------------

PLACE = beam().end
BAD = {
    "no mass to be negative": (lambda: body(mass=-1.0), "body: mass = -1 must be at least 0"),
    "centre": (lambda: body(x=math.nan), "body: center[0] = nan is not finite"),
    "no place": (lambda: ub.Prismatic(3, PLACE), "Prismatic: rail = 3 is not a place"),
    "axis": (
        lambda: ub.Prismatic(ub.ground(0, 0), PLACE, axis=(0, 0)),
        "Prismatic(ground (0, 0), beam.end (1, 0)): the axis has zero length",
    ),
    "axis of one point": (lambda: ub.Prismatic(ub.ground(1, 0), PLACE), "the axis has zero length"),
    "link": (lambda: ub.Link(ub.ground(1, 0), PLACE), "Link(ground (1, 0), beam.end (1, 0)): zero"),
    "rigid link": (lambda: ub.RigidLink(PLACE, body(1.0).middle), "zero length; join the places"),
    "stretch": (lambda: ub.Stretch(PLACE, body(1.0).middle, ub.Spring(1.0)), "zero length"),
    "law": (lambda: ub.Turn(PLACE, body().middle, 3.0), "law = 3.0 is not a"),
    "stiffness": (lambda: ub.Spring(-1.0), "Spring: stiffness = -1 must be positive"),
    "hardening": (lambda: ub.Spring(1.0, law=2.0), "Spring: law = 2.0 is not an ElastoPlastic"),
    "softening": (lambda: ub.Spring(1.0, softening=2.0), "Spring: softening = 2.0"),
    "viscosity": (lambda: ub.Damper(0.0), "Damper: viscosity = 0 must be positive"),
    "stop": (lambda: ub.Stop(1.0, low=0.1, high=0.2), "Stop: the interval from low = 0.1"),
    "no stop": (lambda: ub.Stop(1.0), "have at least one end"),
    "friction": (lambda: ub.Coulomb(), "Coulomb: force and coefficient are both zero"),
    "friction of what": (lambda: ub.Coulomb(coefficient=0.1), "give coefficient and joint"),
    "motor": (
        lambda: ub.PrescribedMotion(1.0), "PrescribedMotion: motion = 1.0 must be a function of t"
    ),
    "actuator": (
        lambda: ub.PrescribedForce(lambda t: math.nan),
        "PrescribedForce: force: the time function is nan",
    ),
    "controller": (lambda: ub.Controller(1.0), "Controller: force = 1.0 must be a function"),
    "function": (lambda: ub.ForceLaw(1.0), "ForceLaw: force = 1.0 must be a function"),
    "release": (lambda: ub.Release(PLACE, body(1.0).middle, free="X"), "letters of 'NVM'"),
    "no release": (lambda: ub.Release(PLACE, body(1.0).middle, free=""), "letters of 'NVM'"),
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


def test_wrong_scenes_are_refused():
    one, other = body(name="one"), body(1.0, name="other")
    with raises("Scene: no beams and no bodies"):
        ub.Scene()
    with raises("other is not in the scene; add it to bodies"):
        ub.Scene(bodies=[one], joints=[ub.Link(one.middle, other.middle)])
    with raises("one is in the scene twice, as bodies[0] and bodies[1]"):
        ub.Scene(bodies=[one, one])
    with raises("both ends are at the same body or cross-section"):
        spring = ub.Stretch(one.middle, one.at(0.5, 0), ub.Spring(1.0))
        ub.Scene(bodies=[one], connectors=[spring])
    with raises("joint ends lie 0.5 m apart"):
        ub.Scene(bodies=[one, other], joints=[ub.Revolute(one.at(0.5, 0), other.middle)])
    with raises("supports in conflict: the ground and Clamped"):
        base = ub.Rigid(one.middle, ub.ground(0, 0))
        ub.Scene(bodies=[one], joints=[base], supports=[ub.Clamped(one.middle)])


def test_bodies_need_mass_in_dynamics():
    scene = ub.Scene(bodies=[ub.Body((0, 0), name="ghost")])
    with raises("mass or resistance for every motion: ghost", "without mass"):
        run(scene)
    with raises("mass or resistance for every motion: ghost", "can turn", "inertia"):
        run(ub.Scene(bodies=[ub.Body((0, 0), mass=1.0, name="ghost")]))


def test_what_is_carried_or_moved_needs_no_mass():
    hub, one = ub.Body((0, 0), name="hub"), beam()
    moved = ub.PrescribedDisplacement(hub.middle, u=0, v=0, psi=lambda t: t)
    scene = ub.Scene(
        [one], joints=[ub.Rigid(hub.middle, one.start)], supports=[moved], bodies=[hub]
    )
    assert run(scene).displacement(one.start)[-1, 2] == pytest.approx(0.1)
    run(ub.Scene([one], joints=[ub.Rigid(hub.middle, one.start)], bodies=[hub]))
    with raises("hub", "can turn"):
        run(ub.Scene([one], joints=[ub.Revolute(hub.middle, one.start)], bodies=[hub]))


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
    "scheme",
    [ub.EnergyMomentum(), ub.EnergyMomentumDecaying(0.8), ub.GeneralizedAlpha(0.8)],
    ids=lambda scheme: type(scheme).__name__,
)
def test_bodies_that_carry_beams_need_no_mass(scheme):
    """The motion and the ledger are those with 1e-6 kg."""
    ends = []
    for mass in (0.0, 1e-6):
        scene = panel_zone(mass)
        solution = ub.simulate(scene, scheme, t=(0, 0.2), dt=2e-3, progress=False)
        ends.append(solution.displacement(scene.beams[1].end))
        if not isinstance(scheme, ub.GeneralizedAlpha):
            assert solution.energy.worst < 1e-9
    assert np.allclose(*ends, rtol=0.0, atol=1e-6 * np.abs(ends[0]).max())


def test_modes_with_bodies_without_mass():
    frequencies = [
        ub.modes(replace(panel_zone(mass), loads=()), 6).frequencies for mass in (0.0, 1e-6)
    ]
    assert np.allclose(*frequencies, rtol=1e-6)


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
    clamped = ub.Scene([one], supports=[ub.Clamped(one.start)], connectors=[drive])
    turned = "Turn(ground (0, 0), beam.start (0, 0)) with PrescribedMotion"
    with raises(f"{turned}; Clamped at beam.start (0, 0) can be left out"):
        run(clamped)
    axes = (1, 0), (-1, 0)
    rails = [ub.Prismatic(ub.ground(0, 0), one.end, axis=x, turning=True) for x in axes]
    with raises("Prismatic(ground (0, 0), beam.end (1, 0)) can be left out"):
        run(ub.Scene([one], joints=rails, supports=[ub.Pinned(one.start)]))
    slope = ub.Roller(one.end, along=(1, 1))
    with raises("Roller at beam.end (1, 0) can be left out"):
        rail = ub.Prismatic(ub.ground(0, -1), one.end, axis=(1, 1), turning=True)
        run(ub.Scene([one], joints=[rail], supports=[ub.Pinned(one.start), slope]))


def test_a_linkage_in_a_singular_position_is_told_so():
    """A flat parallelogram repeats a constraint only here; a second motor does everywhere."""

    def linkage(angle, *motors):
        a = np.array([np.cos(angle), np.sin(angle)])
        b = np.add(a, (2, 0))
        ends = ((0, 0), a), (a, b), ((2, 0), b)
        parts = [body(*(np.array(x) + y) / 2, name=f"rod {i}") for i, (x, y) in enumerate(ends)]
        pins = [(ub.ground(0, 0), parts[0].at(0, 0)), (ub.ground(2, 0), parts[2].at(2, 0))]
        pins += [(parts[i].at(*x), parts[i + 1].at(*x)) for i, x in enumerate((a, b))]
        turns = [ub.Turn(ub.ground(0, 0), parts[0].middle, law) for law in motors]
        return ub.Scene(bodies=parts, joints=[ub.Revolute(*p) for p in pins], connectors=turns)

    motor = ub.PrescribedMotion(lambda t: t)
    run(linkage(0.5, motor))
    with raises("1 of the constraints", "can be left out", "dead centre", "another position"):
        run(linkage(0.0, motor))
    with pytest.raises(ub.ArgumentError, match="can be left out") as refused:
        run(linkage(0.5, motor, motor))
    assert "position" not in str(refused.value)


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


def test_statics_names_what_is_free():
    one = body(name="loose")
    hung = ub.Scene(bodies=[one], joints=[ub.Revolute(one.at(1, 0), ub.ground(1, 0))])
    with raises("loose (body 0) can turn about (1, 0)"):
        run(hung, ub.Static())
    # A spring resists, a damper does not.
    turn = ub.Turn(ub.ground(0, 0), one.middle, ub.Spring(1.0))
    run(ub.Scene(bodies=[one], joints=hung.joints, connectors=[turn]), ub.Static())
    with raises("loose (body 0) can turn"):
        turn = ub.Turn(ub.ground(0, 0), one.middle, ub.Damper(1.0))
        run(ub.Scene(bodies=[one], joints=hung.joints, connectors=[turn]), ub.Static())


def test_free_motions_of_many_beams():
    """Above 30 beams the matrix of the constraints is sparse."""
    for n in (30, 31, 60):
        rods = [beam((i, 0), (i + 1, 0), name=f"rod {i}") for i in range(n)]
        pinned = rigid_chain(rods, supports=[ub.Pinned(rods[0].start)])
        said = "in 1 way", "rod 0 (beam 0) can turn about (0, 0)", f"and {n - 4} more"
        with raises(*said):
            run(pinned, ub.Static())
        ub.Simulation(replace(pinned, supports=[ub.Clamped(rods[0].start)]), ub.Static()).close()
        with raises(f"in {3 * n if n == 30 else 'at least 6'} independent ways"):
            run(ub.Scene(rods), ub.Static())


def test_checks_of_many_hinged_beams_are_fast():
    rods = [beam((i, 0), (i + 1, 0), cells=1) for i in range(2000)]
    joints = [ub.Revolute(one.end, other.start) for one, other in pairwise(rods)]
    supports = [ub.Clamped(rods[0].start), *(ub.Roller(one.end) for one in rods)]
    scene, begin = ub.Scene(rods, joints=joints, supports=supports), time.process_time()
    assert require_no_mechanism(scene) == ""
    assert time.process_time() - begin < 5


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
    scene = ub.Scene(
        [rod, mast], bodies=[hub, rim], joints=joints, connectors=connectors,
        loads=[ub.PointLoad(rim.at(2, 2), force=(1, 0), moment=1.0)],
    )  # fmt: skip
    equation = equation_of_scene(DofNumbering(scene, ub.Mesh()), ub.EnergyMomentum(), 0.0)
    numbering, seen, ε = equation.subdomain.numbering, 0, 1e-5
    ground = numbering.node(ub.ground(0, 0))
    for group in equation.connector_terms:
        for k, (connector, dofs) in enumerate(
            zip(group.connectors, numbering.dofs_of_connectors[group.indices], strict=True)
        ):
            ends, derivatives = (dofs[:6:2], dofs[1:6:2]), np.zeros(numbering.size)
            for end, by_end in zip(ends, connector.rigidly(), strict=True):
                np.add.at(derivatives, end, by_end)  # ends may share a degree of freedom
            derivatives[ground] = 0.0
            steps = ε * np.eye(numbering.size)
            steps[ground] = 0.0  # its motion is zero, and `Guided` does not read it
            slopes = [(group.motion(q)[k] - group.motion(-q)[k]) / (2 * ε) for q in steps]
            np.testing.assert_allclose(slopes, derivatives, atol=1e-8, err_msg=str(connector))
            seen += 1
    assert seen == len(scene.all_connectors)


def test_velocities_must_agree_with_joints():
    a, b = body(name="a"), body(2.0, name="b")
    scene = ub.Scene(
        bodies=[a, b], joints=[ub.Link(a.middle, b.middle)],
        initial=[ub.Velocity((b,), linear=(1.0, 0.0))],
    )  # fmt: skip
    with raises("the parts that Link(a (0, 0), b (2, 0)) joins would move apart at 1 m/s"):
        run(scene)


# -- what is an unknown --------------------------------------------------------------------------


def unknowns(**parts):
    return ub.Simulation(ub.Scene(**parts), ub.EnergyMomentum()).numbering.size


def test_only_what_is_there_has_unknowns():
    left, right = beam(), beam((1, 0), (2, 0))
    with pytest.warns(ub.ModelWarning, match="touch"):
        free = unknowns(beams=[left, right])
    assert free == 18
    shared = unknowns(beams=[left, right], joints=[ub.Rigid(left.end, right.start)])
    assert shared == free - 3
    multipliers = [ub.Rigid(left.end, right.start, multipliers=True)]
    assert unknowns(beams=[left, right], joints=multipliers) == free + 3
    hub = body(1.0)
    carried = [ub.Rigid(left.end, hub.middle, right.start)]
    assert unknowns(beams=[left, right], bodies=[hub], joints=carried) == free - 3
    # The rim of a body: two forces, and the rotation is shared.
    rim = body(1.0, 1.0)
    held = [ub.Rigid(left.end, rim.at(1.0, 0.0))]
    assert unknowns(beams=[left], bodies=[rim], joints=held) == 9 + 3 + 2 - 1


def test_elastic_scenes_without_links_have_no_couplings():
    simulation = ub.Simulation(ub.Scene([beam()]), ub.EnergyMomentum())
    assert simulation.connector_terms == []
    assert simulation.numbering.multipliers.size == 0


# -- results -------------------------------------------------------------------------------------


def test_measured_joints_move_as_shared_ones():
    ends = []
    for multipliers in (False, True):
        left, right = beam(), beam((1, 0), (1, 1), name="right")
        joint = ub.Rigid(left.end, right.start, multipliers=multipliers)
        load = ub.PointLoad(right.end, force=(2.0, -1.0))
        scene = ub.Scene(
            [left, right], joints=[joint], supports=[ub.Clamped(left.start)], loads=[load]
        )
        solution = run(scene)
        ends.append(solution.displacement(right.end))
    # Newton's tolerance in each of ten steps, 1e-10 of forces of some newtons on 10 N/m
    assert np.abs(ends[0] - ends[1]).max() < 1e-9


def test_forces_of_a_joint_at_rest():
    """A hung frame: the joint bears the weight below it, and its moment."""
    left, right = beam((0, 0), (1, 0)), beam((1, 0), (2, 0), name="right")
    joint = ub.Rigid(left.end, right.start, multipliers=True)
    load = ub.PointLoad(right.end, force=(0.0, -0.01))
    scene = ub.Scene([left, right], joints=[joint], supports=[ub.Clamped(left.start)], loads=[load])
    solution = run(scene, ub.Static(), t=(0, 1), dt=1.0)
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
        scene = ub.Scene(
            [a, b], bodies=[body], joints=[joint], loads=loads, supports=[ub.Clamped(body.middle)]
        )
        return run(scene, ub.Static(), t=(0, 1), dt=1.0).joint(joint).force[-1]

    if multipliers:
        assert force(pin, a.start, b.start) == pytest.approx([-0.02, -0.01], abs=1e-10)
        assert force(a.start, b.start, pin) == pytest.approx([0.0, -0.03], abs=1e-10)
    else:
        for places in ((pin, a.start, b.start), (a.start, b.start, pin)):
            with raises("share unknowns, so that the force between them"):
                force(*places)
    assert force(a.start, pin, b.start) == pytest.approx([0.02, 0.04], abs=1e-10)


def test_force_on_a_pin_of_two_bodies():
    """One body holds the other one and a beam; all are loaded."""
    held, hung = (ub.Body((x, 0), mass=1.0, inertia=0.1) for x in (0, 2))
    pins, bar = (held.at(1, 0), hung.at(1, 0)), beam((1, 0), (1, 1))
    scene = {
        "bodies": [held, hung],
        "loads": [ub.PointLoad(x, force=(0, y)) for x, y in ((bar.end, 3e-2), (hung.middle, 5e-2))],
        "supports": [
            ub.Clamped(held.middle),
            *(ub.PrescribedDisplacement(x, psi=0.0) for x in (hung.middle, bar.start)),
        ],
    }
    for places, expected in (((*pins, bar.start), -5e-2), ((pins[0], bar.start, pins[1]), -3e-2)):
        joint = ub.Revolute(*places)
        solution = run(ub.Scene([bar], joints=[joint], **scene), ub.Static(), t=(0, 1), dt=1.0)
        assert solution.joint(joint).force[-1, 1] == pytest.approx(expected, abs=1e-10)


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
    solution = run(scene, t=(0, 1), dt=0.01)
    rim, t = disc.at(1.5, 2.0), solution.times
    # 2 tan(Δψ/2) = ω Δt: the midpoint rule turns a little less, by (ω Δt)²/12
    angle = 2 * np.arctan(0.01) * t / 0.01
    expected = [1 + t + 0.5 * np.cos(angle), 2 + 0.5 * t + 0.5 * np.sin(angle)]
    assert solution.position(rim) == pytest.approx(np.transpose(expected), abs=1e-11)
    speed = [1 - np.sin(angle), 0.5 + np.cos(angle), 2 + 0 * t]
    assert solution.velocity(rim) == pytest.approx(np.transpose(speed), abs=1e-10)
    about_origin = 3 * (1.0 * 0.5 - 2.0 * 1.0) + 0.5 * 2.0
    assert solution.momentum() == pytest.approx(
        np.tile([3, 1.5, about_origin], (101, 1)), abs=1e-10
    )
    assert "1 body, 3 degrees of freedom" in str(solution)


def test_live_questions_agree_with_the_solution():
    mass = body(1.0)
    rail = ub.Prismatic(ub.ground(0, 0), mass.middle)
    spring = ub.Slide(ub.ground(0, 0), mass.middle, ub.Spring(4.0))
    scene = ub.Scene(
        bodies=[mass], joints=[rail], connectors=[spring],
        initial=[ub.Velocity((mass,), linear=(1.0, 0.0))],
    )  # fmt: skip
    simulation = ub.Simulation(scene, ub.EnergyMomentum())
    simulation.keep()
    for n in range(1, 6):
        simulation.step_to(0.1 * n)
        simulation.keep()
    solution, now = simulation.solution, simulation.connector(spring)
    then = solution.connector(spring)
    assert now == pytest.approx([field[-1] for field in then], rel=1e-14)
    motions = solution.displacement(mass.middle)
    assert simulation.displacement(mass.middle) == pytest.approx(motions[-1])
    assert simulation.velocity(mass.middle) == pytest.approx(solution.velocity(mass.middle)[-1])
    assert then.motion == pytest.approx(motions[:, 0], abs=1e-15)
    assert now.rate == pytest.approx(np.diff(motions[:, 0])[-1] / 0.1)
    # The force in the step is that in the middle, and its work is what the spring stores.
    middle = (motions[1:, 0] + motions[:-1, 0]) / 2
    assert then.force[1:] == pytest.approx(4 * middle, rel=1e-9)
    assert then.work == pytest.approx(2 * motions[:, 0] ** 2, abs=1e-12)
    simulation.close()


def test_a_run_that_goes_on_remembers_its_connectors():
    """Two runs, one after the other, are one: yielding springs, friction, work so far."""

    def scene():
        mass = body(1.0)
        base = ub.ground(0, 0)
        return ub.Scene(
            bodies=[mass], joints=[ub.Prismatic(base, mass.middle)],
            connectors=[
                ub.Slide(base, mass.middle, ub.Spring(40.0, ub.ElastoPlastic(1.0, kinematic=5.0))),
                ub.Slide(base, mass.middle, ub.Coulomb(0.2)),
            ],
            loads=[
                ub.PointLoad(mass.middle, force=(3.0, 0.0), amplitude=lambda t: math.cos(4 * t))
            ],
        )  # fmt: skip

    one = scene()
    whole = run(one, t=(0, 1), dt=0.01)
    half = run(one, t=(0, 0.5), dt=0.01)
    rest = run(one, t=(0.5, 1), dt=0.01, start=half)
    assert whole.energy["plastic"][-1] > 0.1
    assert np.abs(rest.q[-1][:3] - whole.q[-1][:3]).max() < 1e-9
    for connector in one.connectors:
        ends = [solution.connector(connector).work[-1] for solution in (whole, rest)]
        assert ends[1] == pytest.approx(ends[0], abs=1e-9)


def test_works_of_connectors_are_in_the_ledger():
    a, b = body(name="a"), body(1.0, name="b")
    spring = ub.Stretch(a.middle, b.middle, ub.Spring(30.0))
    damper = ub.Stretch(a.middle, b.middle, ub.Damper(0.5))
    motor = ub.Turn(ub.ground(0, 0), a.middle, ub.PrescribedMotion(lambda t: t**2))
    scene = ub.Scene(
        bodies=[a, b], connectors=[spring, damper, motor],
        joints=[ub.Revolute(a.middle, ub.ground(0, 0)), ub.Prismatic(a.middle, b.middle)],
    )  # fmt: skip
    solution = run(scene, t=(0, 1), dt=0.01)
    works = [solution.connector(connector).work for connector in (spring, damper, motor)]
    assert solution.energy["stored"] == pytest.approx(works[0], abs=1e-12)
    assert solution.energy["damping"] == pytest.approx(works[1], abs=1e-12)
    assert solution.energy["motors"] == pytest.approx(-works[2], abs=1e-12)
    assert (np.diff(works[1]) >= -np.spacing(works[1][-1])).all()
    assert solution.energy.worst < 1e-10
