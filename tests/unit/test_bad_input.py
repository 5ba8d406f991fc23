# SPDX-License-Identifier: MIT
"""Messages: which object is wrong, why, and what to do; and failed runs, which lose nothing.

Kinds of wrong values of each argument are refused in test_wrong_arguments.py.
"""

import csv
import math
import re
from itertools import pairwise

from mpi4py import MPI

import numpy as np
import pytest

import ufl_beam as ub

SECTION = ub.Section(EA=1e4, GA=1e4, EI=100.0, rhoA=1.0, rhoI=1.0)
STEEL = {"E": 210e9, "nu": 0.3}


def beam(**more):
    return ub.Beam((0, 0), (1, 0), SECTION, **{"cells": 2, "name": "girder", **more})


def raises(*parts):
    """`pytest.raises` for an ArgumentError whose message has all `parts`, in this order."""
    return pytest.raises(ub.ArgumentError, match=".*".join(map(re.escape, parts)))


def test_errors_are_a_value_error_or_a_type_error_too():
    """A wrong value is a ValueError, a wrong type a TypeError, too; models have their own class."""
    assert issubclass(ub.ArgumentError, ValueError)
    assert issubclass(ub.ConvergenceError, RuntimeError)
    with pytest.raises(TypeError, match="Newton: rtol = 'x' is not a number"):
        ub.Newton(rtol="x")
    with pytest.raises(ub.ModelError, match="Section: EA = 'x' is not a number"):
        ub.Section("x", 1.0, 1.0)
    with pytest.raises(ub.ArgumentError, match="fps = 0 must be positive") as error:
        ub.animate(
            ub.simulate(ub.Scene([beam()]), ub.EnergyMomentum(), t=(0, 1), dt=1), "a.gif", fps=0
        )
    assert not isinstance(error.value, ub.ModelError | TypeError)


# -- numbers, sections, beams, functions of time -------------------------------------------------


@pytest.mark.parametrize(
    ("value", "says"),
    [
        (0.0, "= 0 must be positive"),
        (-2.5, "= -2.5 must be positive"),
        (math.nan, "= nan is not finite"),
        (math.inf, "= inf is not finite"),
        ("stiff", "= 'stiff' is not a number"),
        (None, "= None is not a number"),
    ],
)
def test_a_wrong_number_is_shown_with_its_condition(value, says):
    with raises(f"Section: EI {says}"):
        ub.Section(EA=1.0, GA=1.0, EI=value)


@pytest.mark.parametrize(
    ("make", "says"),
    [
        (lambda: ub.PointMass(beam().end, -1.0), "PointMass at girder.end (1, 0): mass = -1"),
        (lambda: beam(cells=2.5), "girder: cells = 2.5 must be a whole number, at least 1"),
        (lambda: ub.Beam((0, 0), 3.0, SECTION), "beam: end = 3.0 must be a pair (x, y)"),
        (lambda: beam().at(1.5), "girder.at(1.5): s must lie between 0 and 1"),
        # sections
        (
            lambda: ub.Section.tube(0.1, 0.06, **STEEL),
            "wall t = 0.06 m is thicker than the radius of d",
        ),
        (lambda: ub.Section.i_shape(0.1, 0.1, 0.01, 0.05, **STEEL), "i_shape: .* do not fit"),
        (lambda: ub.Section.i_shape(0.1, 0.1, 0.2, 0.01, **STEEL), "i_shape: .* do not fit"),
        (lambda: ub.Section.circle(0.1, E=1.0, nu=0.6), "nu = 0.6 must lie in (-1, 0.5]"),
        # beams
        (
            lambda: ub.Beam((1, 2), (1, 2), SECTION, name="post"),
            "post: zero length, both ends are at (1.0, 2.0)",
        ),
        (
            lambda: ub.Beam.arc((0, 0), 1.0, (2, 2), SECTION, name="ring"),
            "ring: zero length, both angles of the arc are 2",
        ),
        (
            lambda: ub.Beam.polyline([(0, 0)], SECTION, name="path"),
            "path: a polyline needs at least two points, not 1",
        ),
        (
            lambda: ub.Beam.polyline([(0, 0), (1, 0), (1, 0)], SECTION, name="path"),
            "path: zero length between two points at (1.0, 0.0)",
        ),
        (
            lambda: ub.Beam.along(lambda s: (s, math.inf if s == 0.5 else 0.0), SECTION, cells=4),
            "beam: curve(0.5)[1] = inf is not finite",
        ),
        # functions of time
        (
            lambda: ub.Table([0, 2, 1], [0, 0, 0]),
            "Table: times must increase, but times[1] = 2",
        ),
        (
            lambda: ub.Table([0, 1, 1], [0, 0, 1]),
            "Table: times must increase, but times[1] = 1 is",
        ),
        (lambda: ub.Table([0, 1], [0]), "Table: 2 times and 1 values; give the same number"),
        (lambda: ub.Table([], []), "Table: 0 times and 0 values"),
        (lambda: push(lambda t: 1 / t), "the time function fails at t = 0: ZeroDivisionError"),
        (lambda: push(lambda t: math.nan), "the time function is nan at t = 0"),
        (
            lambda: push(lambda t: "x"),
            "PointLoad at girder.end .*: the time function returned 'x' at t = 0; it must",
        ),
        (lambda: push(lambda: 1.0), "the time function fails at t = 0: TypeError"),
        (lambda: push(2.0), "amplitude = 2.0 must be a function of t, such as ub.Table"),
    ],
)
def test_a_message_says_why_a_part_is_refused(make, says):
    with raises(*says.split(".*")):
        make()


def push(amplitude):
    return ub.PointLoad(beam().end, force=(1, 0), amplitude=amplitude)


def test_a_curve_that_stands_still_is_refused():
    point = ub.Beam.along(lambda s: (max(s, 0.5), 0.0), SECTION, cells=4, name="halt")
    scene = ub.Scene([point])
    with raises("halt: zero length of a cell at"):
        ub.Simulation(scene, ub.EnergyMomentum())


# -- supports and joints -------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("make", "says"),
    [
        (lambda: ub.Clamped(beam()), ("Clamped", "is not a place; use beam.start, .end or .at(s)")),
        (lambda: ub.Roller(beam().end, along=(0, 0)), ("Roller at girder.end", "no direction")),
        (
            lambda: ub.PrescribedDisplacement(beam().end),
            ("PrescribedDisplacement", "nothing", "at least one of u, v, psi"),
        ),
        (lambda: ub.Rigid(beam().end), ("Rigid: a joint needs at least two places",)),
        (lambda: ub.Revolute(), ("Revolute: a joint needs at least two places",)),
    ],
)
def test_a_message_says_what_a_support_or_a_joint_needs(make, says):
    with raises(*says):
        make()


# -- the scene as a whole ------------------------------------------------------------------------


def test_a_scene_without_beams_is_refused():
    with raises("Scene: no beams"):
        ub.Scene([])


def test_a_beam_in_the_scene_twice_is_refused():
    one, other = beam(), beam(name="other")
    with raises("girder is in the scene twice, as beams[0] and beams[2]"):
        ub.Scene([one, other, one])


@pytest.mark.parametrize(
    ("part", "expected"),
    [("joints", "Joint"), ("loads", "PointLoad or FollowerLoad or LineLoad or Gravity")],
)
def test_a_support_in_another_list_is_refused(part, expected):
    one = beam()
    with raises(f"Scene: {part}[0] = ", f"is not a {expected}"):
        ub.Scene([one], **{part: [ub.Clamped(one.start)]})


STRAY = ub.Beam((0, 0), (1, 0), SECTION, name="stray")


@pytest.mark.parametrize(
    ("owner", "parts"),
    [
        ("Clamped at stray.start", {"supports": [ub.Clamped(STRAY.start)]}),
        ("PointLoad", {"loads": [ub.PointLoad(STRAY.end)]}),
        ("FollowerLoad", {"loads": [ub.FollowerLoad(STRAY.end)]}),
        ("LineLoad", {"loads": [ub.LineLoad(STRAY)]}),
        ("PointMass", {"masses": [ub.PointMass(STRAY.end, 1.0)]}),
        ("Velocity", {"initial": [ub.Velocity([STRAY])]}),
        ("Rigid(stray.start", {"joints": [ub.Rigid(STRAY.start, STRAY.end)]}),
    ],
)
def test_parts_of_beams_outside_of_the_scene_are_refused(owner, parts):
    with raises(owner, "stray is not in the scene; add it to beams"):
        ub.Scene([beam()], **parts)


def test_places_of_a_joint_that_lie_apart_are_refused():
    left = ub.Beam((0, 0), (0, 3.75), SECTION, name="left")
    roof = ub.Beam((0, 4), (6, 4), SECTION, name="roof")
    with raises("Rigid: joint ends lie 0.25 m apart: roof.start (0, 4) and left.end (0, 3.75)"):
        ub.Scene([left, roof], joints=[ub.Rigid(roof.start, left.end)])


def test_a_third_place_that_lies_apart_is_refused():
    a, b = beam(name="a"), beam(name="b")
    with raises("Revolute: joint ends lie 1 m apart: a.start (0, 0) and b.end (1, 0)"):
        ub.Scene([a, b], joints=[ub.Revolute(a.start, b.start, b.end)])


def test_a_place_joined_to_itself_is_refused():
    one = beam()
    with raises("Rigid(girder.end (1, 0), girder.end (1, 0)): the same place twice"):
        ub.Scene([one], joints=[ub.Rigid(one.end, one.at(1.0))])
    other = beam(name="other")
    with raises("the same place twice"):
        ub.Scene([one, other], joints=[ub.Rigid(one.end, other.end, other.end)])


# -- supports in conflict ------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("first", "second", "what"),
    [
        (ub.Clamped, ub.Pinned, "u"),
        (ub.Pinned, ub.Roller, "v"),
        (ub.Roller, lambda p: ub.Roller(p, along=(1, 1)), "v"),
        (lambda p: ub.Roller(p, along=(0, 1)), lambda p: ub.Roller(p, along=(1, 1)), "u"),
        (ub.Clamped, lambda p: ub.PrescribedDisplacement(p, psi=1.0), "psi"),
        (
            lambda p: ub.PrescribedDisplacement(p, u=0),
            lambda p: ub.PrescribedDisplacement(p, u=1.0),
            "u",
        ),
        # An inclined roller takes both displacements of its place
        (lambda p: ub.Roller(p, along=(1, 1)), lambda p: ub.PrescribedDisplacement(p, u=0), "u"),
    ],
)
def test_two_supports_that_hold_one_displacement_are_refused(first, second, what):
    one = beam()
    with raises("in conflict", "girder.end (1, 0) and", f"both hold {what}; remove one"):
        ub.Scene([one], supports=[first(one.end), second(one.end)])


def test_two_supports_that_hold_one_displacement_through_a_joint_are_refused():
    a, b, c = (beam(name=name) for name in "abc")
    joints = [ub.Rigid(a.end, b.end), ub.Revolute(b.end, c.end)]
    with raises("in conflict: Pinned at a.end (1, 0) and Roller at c.end (1, 0) both hold v"):
        ub.Scene([a, b, c], joints=joints, supports=[ub.Pinned(a.end), ub.Roller(c.end)])
    with raises("Roller at a.end", "PrescribedDisplacement at b.end", "both hold u"):
        ub.Scene(
            [a, b, c],
            joints=joints,
            supports=[ub.Roller(a.end, along=(2, 1)), ub.PrescribedDisplacement(b.end, u=1.0)],
        )


def test_supports_at_one_place_may_hold_different_displacements():
    a, b = beam(name="a"), beam(name="b")
    scene = ub.Scene(
        [a, b],
        joints=[ub.Revolute(a.end, b.end)],
        supports=[
            ub.Roller(a.end),
            ub.PrescribedDisplacement(a.end, u=0.0),
            ub.PrescribedDisplacement(a.end, psi=0.0),
            ub.PrescribedDisplacement(b.end, psi=1.0),  # a hinge: another rotation
        ],
    )
    assert len(scene.supports) == 4


# -- what presses on friction --------------------------------------------------------------------


@pytest.mark.parametrize(
    ("press", "says"),
    [
        (lambda a, b: ub.Revolute(a.end, b.start), ("shares unknowns", "multipliers=True")),
        (
            lambda a, b: ub.Release(a.end, b.start, free="M"),
            ("shares unknowns", "multipliers=True"),
        ),
        (lambda a, b: ub.PrescribedDisplacement(a.start, psi=0.0), ("holds no displacement",)),
    ],
)
def test_friction_pressed_by_an_unknown_force_is_refused(press, says):
    a, b = beam(name="a"), ub.Beam((1, 0), (2, 0), SECTION, name="b")
    pressing = press(a, b)
    rub = ub.Turn(a.end, b.start, ub.Coulomb(coefficient=1.0, joint=pressing))
    kind = "joints" if isinstance(pressing, ub.Joint) else "supports"
    with raises("Turn(a.end (1, 0), b.start (1, 0))", str(pressing), *says):
        ub.Scene([a, b], connectors=[rub], **{kind: [pressing]})
    with raises("Turn(a.end (1, 0), b.start (1, 0))", str(pressing), "is not in the scene"):
        ub.Scene([a, b], connectors=[rub])


@pytest.mark.parametrize("free", ["M", "N", "V", "NV", "NM"])
def test_a_release_with_multipliers_has_the_same_equilibrium(free):
    """What it transmits is held by forces, its rotation too."""
    a, b = beam(name="a"), ub.Beam((1, 0), (2, 0), SECTION, name="b")
    joint = ub.Release(a.end, b.start, free=free, multipliers=True)
    assert joint.shared == ()
    assert len(joint.holders) == 3 - len(free)
    held = [ub.Clamped(a.start), ub.Clamped(b.end)]
    push = ub.PointLoad(a.at(0.5), force=(1.0, 1.0), moment=1.0)
    motions = []
    for one in (ub.Release(a.end, b.start, free=free), joint):
        scene = ub.Scene([a, b], joints=[one], supports=held, loads=[push])
        motions.append(run(scene, ub.Static()).displacement(b.start)[-1])
    # The same equilibrium with other unknowns; Newton's tolerance is 1e-10 of the forces
    np.testing.assert_allclose(motions[1], motions[0], rtol=1e-7, atol=1e-12)


# -- mechanisms in statics -----------------------------------------------------------------------


def static(scene):
    return ub.Simulation(scene, ub.Static())


def centers(failure):
    """What a message says: beam -> the point about which it can turn."""
    found = re.findall(
        r"(\w+) \(beam \d+\) can turn about \(([^,]+), ([^)]+)\)", str(failure.value)
    )
    return {name: pytest.approx((float(x), float(y)), abs=1e-9) for name, x, y in found}


def test_a_beam_without_supports_is_free_in_3_ways():
    with raises(
        "free to move in 3 independent ways",
        "girder (beam 0)",
        "Add supports or joints",
        "EnergyMomentum",
    ):
        static(ub.Scene([beam()]))


def test_a_beam_on_one_pin_can_turn_about_it():
    one = beam()
    with raises("free to move in 1 way", "girder (beam 0) can turn about") as failure:
        static(ub.Scene([one], supports=[ub.Pinned(one.start)]))
    assert centers(failure) == {"girder": (0, 0)}


def test_a_beam_on_one_roller_is_free_in_2_ways():
    one = beam()
    with raises("free to move in 2 independent ways", "girder (beam 0)"):
        static(ub.Scene([one], supports=[ub.Roller(one.end)]))


def test_a_beam_on_parallel_rollers_can_shift_along_them():
    one = beam()
    supports = [ub.Roller(one.start, along=(3, 4)), ub.Roller(one.end, along=(3, 4))]
    with raises("free to move in 1 way", "girder (beam 0) can shift along") as failure:
        static(ub.Scene([one], supports=supports))
    # The direction, (3, 4) scaled to a largest component of 1
    u, v = str(failure.value).split("along (")[1].split(")")[0].split(", ")
    assert (abs(float(u)), abs(float(v))) == (0.75, 1.0)


def test_a_frame_of_hinges_can_sway():
    left = ub.Beam((0, 0), (0, 4), SECTION, name="left")
    roof = ub.Beam((0, 4), (6, 4), SECTION, name="roof")
    right = ub.Beam((6, 4), (6, 0), SECTION, name="right")
    joints = [ub.Revolute(left.end, roof.start), ub.Revolute(roof.end, right.start)]
    supports = [ub.Pinned(left.start), ub.Pinned(right.end)]
    with raises("free to move in 1 way", "roof (beam 1) can shift along") as failure:
        static(ub.Scene([left, roof, right], joints=joints, supports=supports))
    assert centers(failure) == {"left": (0, 0), "right": (6, 0)}
    # One rigid corner holds it
    joints = [ub.Rigid(left.end, roof.start), ub.Revolute(roof.end, right.start)]
    static(ub.Scene([left, roof, right], joints=joints, supports=supports))


def test_only_the_beam_that_hangs_loose_is_named():
    fast, loose = beam(name="fast"), ub.Beam((1, 0), (2, 0), SECTION, name="loose")
    scene = ub.Scene(
        [fast, loose],
        joints=[ub.Revolute(fast.end, loose.start)],
        supports=[ub.Clamped(fast.start)],
    )
    with raises("1 way") as failure:
        static(scene)
    assert centers(failure) == {"loose": (1, 0)}
    assert "fast" not in str(failure.value)


def test_many_loose_beams_are_counted():
    loose = [ub.Beam((0, i), (1, i), SECTION, name=f"b{i}") for i in range(7)]
    with raises("21 independent ways"):
        static(ub.Scene(loose))


def test_an_infinitesimal_mechanism_is_refused():
    """Two links in one line between pins: free at first order only, but statics starts there."""
    a, b = beam(name="a"), ub.Beam((1, 0), (2, 0), SECTION, name="b")
    scene = ub.Scene(
        [a, b],
        joints=[ub.Revolute(a.end, b.start)],
        supports=[ub.Pinned(a.start), ub.Pinned(b.end)],
    )
    with raises("1 way") as failure:
        static(scene)
    assert centers(failure) == {"a": (0, 0), "b": (2, 0)}


def test_a_mechanism_of_310_beams_is_named_in_part():
    """Beyond the size of dense decompositions, by another method."""
    count = 310  # 930 unknowns
    beams = [ub.Beam((i, 0), (i + 1, 0), SECTION, cells=1, name=f"b{i}") for i in range(count)]
    joints = [ub.Rigid(x.end, y.start) for x, y in pairwise(beams)]
    with raises("free to move in 1 way", "; and 306 more") as failure:
        static(ub.Scene(beams, joints=joints, supports=[ub.Pinned(beams[0].start)]))
    assert centers(failure) == {f"b{i}": (0, 0) for i in range(4)}
    static(ub.Scene(beams, joints=joints, supports=[ub.Clamped(beams[0].start)]))


def test_mechanisms_may_run_in_dynamics():
    assert ub.Simulation(ub.Scene([beam()]), ub.EnergyMomentum()).t == 0.0


# -- the call ------------------------------------------------------------------------------------


def run(scene=None, scheme=None, *, t=(0.0, 1.0), dt=0.5, **more):
    return ub.simulate(
        scene or ub.Scene([beam()]), scheme or ub.EnergyMomentum(), t=t, dt=dt, **more
    )


@pytest.mark.parametrize(
    ("call", "says"),
    [
        (lambda: run(t=(1.0, 1.0)), ("the end t[1] = 1 must come after the beginning 1",)),
        (lambda: run(t=1.0), ("simulate: t = 1.0 must be a pair (beginning, end)",)),
        (lambda: ub.XDMF("x.xdmf", every=0), ("XDMF x.xdmf: every = 0 must be a whole number",)),
        (
            lambda: ub.EnergyMomentum(alpha=0.6),
            ("EnergyMomentum: alpha = 0.6", "between 0 and 0.5"),
        ),
    ],
)
def test_a_message_says_why_a_call_is_refused(call, says):
    with raises(*says):
        call()


@pytest.mark.parametrize(
    "recorder",
    [lambda path: ub.XDMF(path.with_suffix(".xdmf")), lambda path: ub.History(path)],
    ids=["XDMF", "History"],
)
def test_an_output_that_cannot_be_written_is_refused_before_the_run(recorder, shared_path):
    missing = shared_path / "nowhere" / "out.csv"
    with raises("output", "nowhere", "there is no directory", "make it first"):
        run(record=recorder(missing))
    blocked = shared_path / "out.csv"
    if MPI.COMM_WORLD.rank == 0:
        blocked.mkdir()
        blocked.with_suffix(".xdmf").mkdir()
    MPI.COMM_WORLD.barrier()
    with raises("output", "out.", "cannot be written", "directory"):
        run(record=[recorder(blocked)])


def test_a_refused_output_leaves_no_file(shared_path):
    with raises("every"):
        run(record=ub.History(shared_path / "a.csv"), every=0)
    with raises("nowhere"):
        run(record=[ub.History(shared_path / "a.csv"), ub.XDMF(shared_path / "nowhere" / "b.xdmf")])
    MPI.COMM_WORLD.barrier()
    assert list(shared_path.iterdir()) == []


def test_a_history_of_a_place_outside_of_the_scene_is_refused(shared_path):
    with raises("stray.end (1, 0): stray is not in the scene"):
        run(record=ub.History(shared_path / "a.csv", [STRAY.end]))


def test_a_start_from_another_scene_is_refused():
    other = run()
    with raises(
        "start: the solution is of other beams, joints or cells; use the same Beam objects"
    ):
        run(start=other)


def test_a_start_from_other_cells_is_refused():
    """What is attached inside of a beam makes a vertex there."""
    one = beam()
    first = run(ub.Scene([one], masses=[ub.PointMass(one.at(0.3), 1.0)]))
    with raises("start: girder has other vertices", "corners=(s, ...)"):
        run(ub.Scene([one]), start=first)
    with raises("start: the solution is of other beams, joints or cells"):
        run(ub.Scene([one]), start=first, mesh=ub.Mesh(2))


def test_a_start_with_another_body_is_refused():
    one = beam()
    hub = ub.Body((3, 0), mass=1.0, inertia=1.0, name="hub")
    with raises("start: hub is not in the scene of the solution"):
        run(ub.Scene([one], bodies=[hub]), start=run(ub.Scene([one])))


def test_a_start_with_a_new_joint_of_places_apart_is_refused():
    """The hinge has turned by 2 rad/s · 1 s; a rigid joint would have to turn it back."""
    a, b = beam(name="a"), ub.Beam((1, 0), (2, 0), SECTION, name="b")
    turns = [ub.Velocity([x], angular=w, about=(1, 0)) for x, w in ((a, 0.0), (b, 2.0))]
    hinge = ub.Revolute(a.end, b.start)
    for end, says in ((1.0, ("are", "rad apart")), (1e-9, ("move", "rad/s apart"))):
        hinged = run(ub.Scene([a, b], joints=[hinge], initial=turns), t=(0, end), dt=end / 8)
        with raises("start: the new scene joins places that", *says, "psi of"):
            run(ub.Scene([a, b], joints=[ub.Rigid(a.end, b.start)]), start=hinged)
    still = run(ub.Scene([a, b], joints=[hinge]))
    run(ub.Scene([a, b], joints=[ub.Rigid(a.end, b.start)]), start=still)


# -- initial velocities --------------------------------------------------------------------------


def test_two_velocities_at_a_joint_are_refused():
    a, b = beam(name="a"), ub.Beam((1, 0), (2, 0), SECTION, name="b")
    scene = ub.Scene(
        [a, b],
        joints=[ub.Revolute(a.end, b.start)],
        initial=[ub.Velocity([a], linear=(1, 0)), ub.Velocity([b], linear=(2, 0))],
    )
    with raises("Velocity: b gets two different velocities at (1, 0)", "joined to"):
        ub.Simulation(scene, ub.EnergyMomentum())


def test_two_velocities_of_one_beam_are_refused():
    one = beam()
    scene = ub.Scene([one], initial=[ub.Velocity([one], angular=1.0), ub.Velocity([one])])
    with raises("Velocity: girder gets two different velocities at (0, 0)"):
        ub.Simulation(scene, ub.EnergyMomentum())


def test_velocities_may_differ_where_they_agree_at_the_joint():
    # Both turn about the hinge, at different rates
    a, b = beam(name="a"), ub.Beam((1, 0), (2, 0), SECTION, name="b")
    turns = [ub.Velocity([x], angular=w, about=(1, 0)) for x, w in ((a, 1.0), (b, -3.0))]
    scene = ub.Scene([a, b], joints=[ub.Revolute(a.end, b.start)], initial=turns)
    assert ub.Simulation(scene, ub.EnergyMomentum()).t == 0.0


# -- questions to a solution ---------------------------------------------------------------------


@pytest.mark.parametrize(
    ("ask", "says"),
    [
        (lambda s: s.displacement(STRAY.end), ("stray.end (1, 0): stray is not in the scene",)),
        (lambda s: s.position(STRAY.end), ("stray.end (1, 0): stray is not in the scene",)),
        (lambda s: s.section_forces_at(STRAY.end), ("stray is not in the scene",)),
        (lambda s: s.section_forces(STRAY), ("stray is not in the scene",)),
        (lambda s: s.displacement(STRAY), ("stray", "is not a Place")),
        (lambda s: s.reaction(ub.Clamped(STRAY.end)), ("reaction: Clamped at stray.end", "not in")),
    ],
)
def test_results_of_beams_and_supports_outside_of_the_scene_are_refused(ask, says):
    with raises(*says):
        ask(run())


def test_a_static_run_has_no_velocity():
    one = beam()
    solution = run(ub.Scene([one], supports=[ub.Clamped(one.start)]), ub.Static())
    with raises("velocity: the run was static"):
        solution.velocity(one.end)
    with raises("momentum: the run was static"):
        solution.momentum()


# -- inelastic material ----------------------------------------------------------------------------

STEEL_LAW = ub.ElastoPlastic(250e6)
BREAKS = ub.Softening(10.0, 5.0)
INF, NAN = math.inf, math.nan


def in_fibres(fibres=None, **more):
    return ub.Section.rectangle(0.1, 0.2, **STEEL, fibres=fibres or ub.Fibres(STEEL_LAW), **more)


def resultant(**laws):
    return ub.Section(EA=1e4, GA=1e4, EI=100.0, **laws)


@pytest.mark.parametrize(
    ("make", "says"),
    [
        (
            lambda: ub.ElastoPlastic(1.0, isotropic=-2.0),
            ("ElastoPlastic: isotropic = -2 must not be negative", "use Softening("),
        ),
        (
            lambda: ub.ElastoPlastic(1.0, kinematic=-2.0),
            ("ElastoPlastic: kinematic = -2 must not be negative", "use Softening("),
        ),
        (
            lambda: ub.ElastoPlastic(1.0, viscosity=5.0),
            ("ElastoPlastic: viscosity = 5.0 is not a Perzyna or DuvautLions",),
        ),
        (lambda: resultant(bending=BREAKS), ("Section: bending", "is not a ElastoPlastic")),
        # fibres
        (lambda: in_fibres(bending=STEEL_LAW), ("Section: a law bending beside fibres",)),
        (lambda: in_fibres(axial=STEEL_LAW), ("Section: a law axial beside fibres",)),
        (lambda: in_fibres(shear=STEEL_LAW), ("Section: a law shear beside fibres", "elastic")),
        (lambda: in_fibres(hinge=BREAKS), ("Section: a law hinge beside fibres",)),
        # fibres of a user
        (lambda: of_fibres([0.1, 0.1], [1, 1]), ("of_fibres: all fibres at one y", "spread them")),
        (lambda: of_fibres([0, 1], [1, 1, 1]), ("y and A must be lists of one length", "(2,)")),
        (lambda: of_fibres([0, 1], [1, -1]), ("y must be finite, and all A positive",)),
        (
            lambda: in_fibres(ub.Fibres(STEEL_LAW, number=1)),  # its middle is the axis
            ("Fibres: number = 1 has no bending stiffness; use 2 or more",),
        ),
        # hinges of a beam
        (lambda: beam(hinges={1.5: BREAKS}), ("girder: hinge at s = 1.5 must lie between 0 and",)),
        (lambda: beam(hinges={0.5: 3.0}), ("girder: hinge at s = 0.5", "a Softening or Elasto")),
        (
            lambda: beam(hinges={0.5: BREAKS, 0.5 + 1e-13: BREAKS}),
            ("girder: two hinges at s = 0.5", "give one"),
        ),
        (
            lambda: ub.Beam((0, 0), (1, 0), in_fibres(), name="post", hinges={0.5: BREAKS}),
            ("post: hinges are for resultants; here the fibres of the section soften",),
        ),
    ],
)  # fmt: skip
def test_a_message_says_why_a_material_is_refused(make, says):
    with raises(*says):
        make()


def of_fibres(y, A):
    return ub.Section.of_fibres(y, A, **STEEL, fibres=ub.Fibres(STEEL_LAW))


@pytest.mark.parametrize("ask", ["material", "material_at"])
def test_an_elastic_scene_has_no_material_states(ask):
    one = beam()
    solution = run(ub.Scene([one], supports=[ub.Clamped(one.start)]), ub.Static())
    with raises("material: nothing in the scene yields or breaks; it is elastic"):
        solution.material(one) if ask == "material" else solution.material_at(one.end)


def test_material_of_a_beam_outside_of_the_scene_is_refused():
    one = ub.Beam((0, 0), (1, 0), resultant(bending=ub.ElastoPlastic(1.0)), cells=2)
    solution = run(ub.Scene([one], supports=[ub.Clamped(one.start)]), ub.Static())
    with raises("stray is not in the scene"):
        solution.material(STRAY)
    with raises("stray", "is not in the scene"):
        solution.material_at(STRAY.end)


@pytest.mark.parametrize(
    "make",
    [
        lambda: ub.ElastoPlastic(0.0, viscosity=ub.Perzyna(INF)),
        lambda: ub.ElastoPlastic(INF, 0.0, 0.0, ub.DuvautLions(INF)),
        lambda: ub.Softening(INF, 1.0),
        lambda: ub.LinearSoftening(0.0, 1.0),
        lambda: beam(hinges={0.0: BREAKS, 1.0: ub.LinearSoftening(1.0, 1.0)}),
        lambda: ub.EnergyMomentumStatic(0.5),
        lambda: in_fibres(ub.Fibres(STEEL_LAW, number=2, softening=BREAKS)),
    ],
)
def test_limits_of_ranges_are_allowed(make):
    assert make() is not None


# -- no convergence: nothing is lost ---------------------------------------------------------------


def turned(psi, **more):
    one = beam()
    support = ub.PrescribedDisplacement(one.start, u=0, v=0, psi=psi)
    return ub.Scene([one], supports=[support], **more)


@pytest.mark.filterwarnings(
    "ignore:PrescribedDisplacement at girder.start .* psi jumps:ufl_beam.ModelWarning"
)
@pytest.mark.parametrize(
    ("psi", "time"),
    [(lambda t: 4.0 * (t > 0.55), 0.55), (lambda t: 4.0 * (t > 0), 0.0), (4.0, 0.0)],
)
def test_a_jump_of_more_than_a_half_turn_has_no_equilibrium(psi, time):
    with pytest.raises(ub.ConvergenceError) as failure:
        run(turned(psi), dt=0.1)
    message = str(failure.value)
    assert "turns by 4 rad in the step, and |Δψ| must stay below π; reduce dt" in message
    assert f"no equilibrium after t = {time:g} s" in message
    assert "Try a smaller dt" in message
    # Parts of 1/4096 of the step are the smallest
    assert failure.value.dt == pytest.approx(0.1 / 4096, rel=1e-6)
    assert failure.value.time == pytest.approx(time, abs=1e-12)


def test_a_step_with_a_large_turn_is_subdivided():
    """4 rad in 0.1 s is too much for one step of 0.1 s, but not for its parts."""
    scene = turned(lambda t: 40.0 * t)
    solution = run(scene, t=(0, 0.1), dt=0.1)
    assert solution.parts > 1
    assert solution.displacement(scene.beams[0].start)[-1, 2] == pytest.approx(4.0, rel=1e-12)


def test_nothing_is_lost_when_a_step_fails(shared_path, on_first_rank):
    """The solution ends with the last accepted state, the table with the last whole step."""
    path = shared_path / "run.csv"
    scene = turned(lambda t: t + 4.0 * (t > 0.55))
    end = scene.beams[0].end
    with pytest.raises(ub.ConvergenceError) as failure:
        run(scene, dt=0.1, record=ub.History(path, [end]))
    error = failure.value
    solution = error.solution
    # Five whole steps, then parts up to 0.55 s or the last multiple of 0.1/4096 s before it
    assert solution.times[:6] == pytest.approx(0.1 * np.arange(6), abs=1e-12)
    assert solution.times[-1] == error.time
    assert 0.55 - 0.1 / 4096 <= error.time <= 0.55 + 1e-12
    assert len(solution.times) == len(solution.displacement(end)) == 7
    assert solution.energy.worst < 1e-9  # closed by design, section 9
    assert solution.displacement(scene.beams[0].start)[-1, 2] == pytest.approx(error.time)

    def read():
        with path.open(newline="") as file:
            return list(csv.reader(file))

    _, *rows = on_first_rank(read)
    assert [float(row[0]) for row in rows] == list(solution.times[:6])
    motion = np.array([[float(x) for x in row[1:4]] for row in rows])
    assert (motion == solution.displacement(end)[:6]).all()


def test_nothing_is_lost_when_the_force_is_not_a_number():
    one = beam()
    push = ub.PointLoad(one.end, force=(1, 0), amplitude=lambda t: 1.0 if t < 0.55 else math.nan)
    with pytest.raises(ub.ConvergenceError, match=r"no equilibrium after t = 0\.5") as failure:
        run(ub.Scene([one], loads=[push]), dt=0.1)
    kept = failure.value.solution
    assert kept.times[-1] == failure.value.time
    assert np.isfinite(kept.displacement(one.end)).all()
    assert np.isfinite(kept.energy.total).all()


def test_a_step_with_too_few_iterations_says_where_the_residual_is():
    one = beam()
    push = ub.PointLoad(one.end, force=(0, 500), amplitude=lambda t: 1.0 * (t > 0.25))
    scene = ub.Scene([one], supports=[ub.Clamped(one.start)], loads=[push])
    message = "did not converge after 1 iterations; residual"
    with pytest.raises(ub.ConvergenceError, match=message) as failure:
        run(scene, ub.Static(), dt=0.5, newton=ub.Newton(rtol=1e-14, max_iterations=1))
    # Where the equilibrium is missed, and by which forces
    (place, residual), *_ = failure.value.residuals.items()
    assert f"{residual:.1e} N in {place}" in str(failure.value)
    assert f"of {one.name} at (" in place
    assert list(failure.value.residuals.values()) == sorted(
        failure.value.residuals.values(), reverse=True
    )
    assert set(failure.value.forces) == {"beams", "loads"}
    assert min(failure.value.forces.values()) > residual > 0


def test_the_solution_of_an_interrupted_run_goes_on():
    """What stops it is the user's own; internal variables are those of the last state."""
    section = ub.Section(
        EA=1e4, GA=1e4, EI=100.0, bending=ub.ElastoPlastic(yield_limit=10.0, isotropic=10.0)
    )
    one = ub.Beam((0, 0), (1, 0), section, cells=2)

    class Interrupted:
        until = 0.55

        def __call__(self, t):
            if t > self.until:
                raise KeyboardInterrupt
            return 0.4 * t

    motion = Interrupted()
    scene = ub.Scene(
        [one], supports=[ub.Clamped(one.start), ub.PrescribedDisplacement(one.end, psi=motion)]
    )
    with pytest.raises(KeyboardInterrupt) as failure:
        ub.simulate(scene, ub.Static(), t=(0, 1), dt=0.1, every=4, comm=MPI.COMM_SELF)
    reached = failure.value.solution
    assert reached.times[-1] == pytest.approx(0.5)
    motion.until = 2.0
    rest = ub.simulate(
        scene, ub.Static(), t=(reached.times[-1], 1), dt=0.1, start=reached, comm=MPI.COMM_SELF
    )
    whole = ub.simulate(scene, ub.Static(), t=(0, 1), dt=0.1, comm=MPI.COMM_SELF)
    assert whole.energy.lost["plastic"][-1] > 0
    np.testing.assert_allclose(rest.section_forces(one), whole.section_forces(one), atol=1e-9)


@pytest.mark.filterwarnings(
    "ignore:PrescribedDisplacement at girder.start .* psi jumps:ufl_beam.ModelWarning"
)
def test_a_failed_run_does_not_change_the_next_one():
    one = beam()
    scene = ub.Scene([one], loads=[ub.PointLoad(one.end, force=(1, 0))])
    before = run(scene)
    with pytest.raises(ub.ConvergenceError):
        run(turned(4.0))
    assert (run(scene).q == before.q).all()


def test_files_are_complete_when_a_time_function_fails_on_the_way(shared_path, on_first_rank):
    path = shared_path / "run.csv"
    one = beam()
    push = ub.PointLoad(one.end, force=(1, 0), amplitude=lambda t: math.sqrt(0.5 - t))
    with pytest.raises(ValueError, match=r"math domain error|nonnegative"):
        run(ub.Scene([one], loads=[push]), dt=0.1, record=ub.History(path, [one.end]))
    lines = on_first_rank(lambda: path.read_text().splitlines())
    assert len(lines) == 1 + 6  # the header, the initial state, five steps
    assert lines[-1].startswith("0.5,")


# -- what is allowed ------------------------------------------------------------------------------


class Pulse:
    """A time function with equality and no hash, as a plain dataclass has."""

    def __call__(self, t):
        return 1.0

    def __eq__(self, other):
        return isinstance(other, Pulse)


def test_whole_numbers_of_cells_may_be_floats():
    assert len(run(ub.Scene([beam(cells=2.0)])).grid.cells) == 2


def test_time_functions_need_no_hash():
    one = beam()
    run(ub.Scene([one], loads=[ub.PointLoad(one.end, force=(1, 0), amplitude=Pulse())]))
    # no error is raised


# -- options of PETSc -----------------------------------------------------------------------------


@pytest.fixture
def database():
    """PETSc's options of Newton's method, which a test may change."""
    from petsc4py import PETSc

    database = PETSc.Options("ub_")
    before = database.getAll()
    yield database
    for name in database.getAll():
        del database[name]
    for name, value in before.items():
        database[name] = value


@pytest.mark.serial  # PETSc reports an error of all ranks by aborting some of them
def test_wrong_petsc_options_do_no_harm_to_the_next_run(database):
    with raises("PETSc refuses the options -ub_snes_type nonsense: "):
        run(newton=ub.Newton(petsc={"snes_type": "nonsense"}))
    assert database.getAll() == {}
    run()


@pytest.mark.parametrize(
    ("name", "said"),
    [
        ("snes_monitr", "no use for the option ub_snes_monitr; did you mean ub_snes_monitor"),
        ("snes_tr_delta0", "no use for the option ub_snes_tr_delta0; "),  # of another method
        ("tolerance", "no use for the option ub_tolerance; leave it out"),
    ],
)
def test_an_option_without_effect_is_refused(database, name, said):
    with raises(f"Newton: petsc: PETSc has {said}"):
        run(newton=ub.Newton(petsc={"snes_max_it": 20, name: "1"}))
    assert database.getAll() == {}
    database[name] = "1"
    assert database.hasName(name)  # someone has asked for it, which PETSc remembers
    with raises(f"PETSC_OPTIONS: PETSc has {said}"):
        run()
    assert database.getAll() == {name: "1"}  # for whoever else reads it


def test_an_option_that_petsc_asks_for_later_is_refused_unless_in_petsc_options(database):
    with raises("ub_snes_view; such options must stand in PETSC_OPTIONS"):
        run(newton=ub.Newton(petsc={"snes_view": None}))
    database["snes_view"] = ":/dev/null"
    run()
    run()  # known as used by now


def test_an_option_of_another_linear_solver_is_refused():
    """PETSc asks for some options only where others choose their solver."""
    with raises("ub_pc_factor_mat_ordering_type"):
        run(newton=ub.Newton(petsc={"pc_factor_mat_ordering_type": "rcm"}))
    run(newton=ub.Newton(petsc={"ksp_type": "richardson", "ksp_richardson_scale": 1.0}))
