# SPDX-License-Identifier: MIT
"""Scenes that are likely wrong are warned of, by name, on the line of the user; others are not."""

import math
import re
import sys
import warnings
from dataclasses import replace
from itertools import pairwise

from mpi4py import MPI

import numpy as np
import pytest
from helpers import raises
from scenes import clamped

import ufl_beam as ub
import ufl_beam.structures as st

HEAVY = ub.Section(EA=1e6, GA=3e5, EI=1e2, rhoA=1.0, rhoI=1e-3)
LIGHT = {"EA": 1e6, "GA": 3e5, "EI": 1e2}


def beam(a=(0, 0), b=(1, 0), section=HEAVY, **more):
    return ub.Beam(a, b, section, **{"cells": 2, "name": "girder", **more})


def begin(*beams, scheme=None, **parts):
    """A simulation of a scene that has made no step."""
    scene = ub.Scene(beams, **parts)
    simulation = ub.Simulation(scene, scheme or ub.EnergyMomentum(), comm=MPI.COMM_SELF)
    simulation.close()
    return simulation


def warns(*parts):
    """`pytest.warns` for a ModelWarning whose message has all `parts`, in this order."""
    return pytest.warns(ub.ModelWarning, match=".*".join(map(re.escape, parts)))


def test_warnings_point_at_the_line_of_the_user():
    thick = ub.Section.rectangle(200.0, 300.0, E=210e9, nu=0.3)
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always")
        ub.Beam((0, 0), (6, 0), thick)
        ub.Beam.polyline([(0, 0), (3, 0), (6, 0)], thick)
    assert [warning.filename for warning in caught] == [__file__] * 2
    assert caught[1].lineno == caught[0].lineno + 1


# -- masses --------------------------------------------------------------------------------------


@pytest.mark.parametrize("rotary", [0.0, 1e-3])
def test_a_massless_beam_that_nothing_holds(rotary):
    """Its motion is not determined; EnergyMomentum made it go to and fro."""
    loose = beam((2, 0), (3, 1), ub.Section(**LIGHT, rhoA=0.0, rhoI=rotary), name="loose")
    held = beam()
    with raises("dynamics needs mass or resistance for every motion: loose (beam 1) can shift"):
        begin(held, loose, supports=[ub.Clamped(held.start)])


@pytest.mark.parametrize(
    ("hold", "moves"),
    [
        (lambda a, b: {}, "shift"),
        (lambda a, b: {"joints": [ub.Revolute(a.end, b.start)]}, "turn about (1, 0)"),
        (lambda a, b: {"supports": [ub.Pinned(b.end)]}, "turn about (2, 0)"),
        (lambda a, b: {"masses": [ub.PointMass(b.start, 1.0)]}, "turn about (1, 0)"),
        # A stop is free inside of its interval
        (
            lambda a, b: {
                "joints": [ub.Revolute(a.end, b.start)],
                "connectors": [ub.Turn(a.end, b.start, ub.Stop(1.0, low=-0.1, high=0.1))],
            },
            "turn about (1, 0)",
        ),
        (
            lambda a, b: {
                "joints": [ub.Revolute(a.end, b.start)],
                "connectors": [ub.Turn(a.end, b.start, ub.PrescribedForce(lambda t: t))],
            },
            "turn about (1, 0)",
        ),
    ],
)
def test_massless_parts_whose_motion_is_not_determined(hold, moves):
    a = beam((0, 0), (1, 0), name="a")
    b = beam((1, 0), (2, 0), ub.Section(**LIGHT, rhoA=0.0), name="b")
    parts = hold(a, b)
    with raises("b (beam 1) can", moves) as failure:
        begin(a, b, **parts)
    assert "a (beam 0)" not in str(failure.value)


@pytest.mark.parametrize(
    "hold",
    [
        lambda a, b: {"joints": [ub.Rigid(a.end, b.start)]},
        lambda a, b: {"joints": [ub.Revolute(a.end, b.start)], "supports": [ub.Roller(b.end)]},
        lambda a, b: {"joints": [ub.Rigid(a.end, b.start, multipliers=True)]},
        lambda a, b: {"supports": [ub.Clamped(b.end)], "joints": [ub.Link(a.start, b.start)]},
        lambda a, b: {"masses": [ub.PointMass(b.start, 1.0, 1.0)]},
        lambda a, b: {"masses": [ub.PointMass(b.start, 1.0), ub.PointMass(b.end, 1.0)]},
        *(
            lambda a, b, law=law: {
                "joints": [ub.Revolute(a.end, b.start)],
                "connectors": [ub.Turn(a.end, b.start, law)],
            }
            for law in (
                ub.Spring(1.0), ub.Damper(1.0), ub.PrescribedMotion(lambda t: t), ub.Coulomb(1.0),
                ub.ForceLaw(lambda e, rate: e), ub.Stop(1.0, low=0.0),
            )
        ),
    ],
)  # fmt: skip
def test_massless_parts_that_something_holds_do_not_warn(hold):
    a = beam((0, 0), (1, 0), name="a")
    b = beam((1, 0), (2, 0), ub.Section(**LIGHT, rhoA=0.0), name="b")
    with warnings.catch_warnings():
        warnings.filterwarnings("ignore", ".*touch", ub.ModelWarning)
        begin(a, b, **hold(a, b))  # no other warning is issued


def test_massless_parts_of_large_scenes():
    """Beyond the size of dense decompositions: 40 massless beams on a row, the last one loose."""
    light = ub.Section(**LIGHT, rhoA=0.0)
    a = beam(name="a")
    row = [beam((i, 0), (i + 1, 0), light, name=f"b{i}") for i in range(1, 41)]
    joints = [ub.Rigid(x.end, y.start) for x, y in zip([a, *row], row[:-1], strict=False)]
    hinge = ub.Revolute(row[-2].end, row[-1].start)
    with raises("b40 (beam 40) can turn about (40, 0)"):
        begin(a, *row, joints=[*joints, hinge])
    begin(a, *row, joints=[*joints, ub.Rigid(row[-2].end, row[-1].start)])


def test_a_forgotten_density():
    """Of one section beside others; stated as zero it is meant, as in cables of a swing."""
    for forgotten, cached_forms in (
        (ub.Section(**LIGHT), ub.Section(**LIGHT, rhoA=0.0)),
        (
            ub.Section.circle(0.1, E=1e9, nu=0.3),
            ub.Section.circle(0.1, E=1e9, nu=0.3, rho=0.0),
        ),
    ):
        for section, context in ((forgotten, warns("b: without mass")), (cached_forms, None)):
            a, b = beam(name="a"), beam((1, 0), (2, 0), section, name="b")
            parts = {"joints": [ub.Rigid(a.end, b.start)]}
            if context is None:
                begin(a, b, **parts)
                continue
            with context:
                begin(a, b, **parts)
            with warns("b: without mass"):
                ub.modes(ub.Scene([a, b], **parts), 1)
            # Statics has no use for mass
            begin(a, b, scheme=ub.Static(), supports=[ub.Clamped(a.start)], **parts)


def test_dynamics_without_any_mass():
    one = beam(section=ub.Section(**LIGHT))
    with warns("girder: without mass", "nothing else in the scene has mass", "Static()"):
        begin(one, supports=[ub.Clamped(one.start)])
    # A mast without mass that carries one
    begin(one, supports=[ub.Clamped(one.start)], masses=[ub.PointMass(one.end, 1.0)])


# -- places that touch ---------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("shift", "names"),
    [
        (0.0, ("a.end (1, 0)", "b.start (1, 0)", "(0 m apart)")),
        (1e-4, ("a.end (1, 0)", "b.start (1.0001, 0)", "(0.0001 m apart)")),
    ],
)
def test_beams_that_touch_without_a_joint(shift, names):
    a, b = beam(name="a"), beam((1 + shift, 0), (2, 0), name="b")
    with warns(*names[:2], "touch", names[2], "Join them with Rigid or Revolute"):
        begin(a, b)


@pytest.mark.serial
@pytest.mark.parametrize(
    "analysis",
    [
        lambda x, end: ub.simulate(x, ub.Static(), t=(0, 1), dt=1.0),
        lambda x, end: ub.simulate(
            x, ub.Static(), t=(0, 1), dt=1.0, newton=ub.Newton(reference=True)
        ),
        lambda x, end: ub.modes(x, 1),
        lambda x, end: ub.buckling(x, 1),
        lambda x, end: st.pushover(x, end, 1e-3, pattern=x.loads),
        lambda x, end: ub.follow(x, ub.LoadControl(0.5), steps=2),
        lambda x, end: st.load_combinations(
            replace(x, loads=[]), {"Q": x.loads}, {"1": {"Q": 1.0}, "2": {"Q": 1.5}}
        ),
        lambda x, end: st.response_spectrum_analysis(
            replace(x, loads=[]), lambda T: 1.0, n=2, direction=(1, 0)
        ),
        lambda x, end: ub.linearize(
            replace(x, loads=[]), inputs=[x.supports[0]], outputs=[("displacement", end, "u")]
        ),
    ],
)
def test_each_analysis_warns_once_of_beams_that_touch(analysis):
    a, b = beam((0, 0), (0, 1), name="a"), beam((0, 1), (1, 1), name="b")
    push = ub.PointLoad(a.end, force=(1.0, -1.0), amplitude=lambda t: t)
    x = ub.Scene([a, b], supports=[ub.Clamped(a.start), ub.Clamped(b.end)], loads=[push])
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always")
        analysis(x, a.end)
    assert ["touch" in str(w.message) for w in caught].count(True) == 1


# -- connectors without effect ---------------------------------------------------------------------

SOFT = ub.Spring(1e3)


@pytest.mark.parametrize(
    ("joints", "connect", "supports", "named"),
    [
        (ub.Rigid, lambda a, b: ub.Turn(a.end, b.start, SOFT), (), "Rigid(a.end"),
        (
            lambda a, b: ub.Rigid(a, b, multipliers=True),
            lambda a, b: ub.Turn(a.end, b.start, ub.Damper(1.0)), (), "Rigid(a.end",
        ),
        (ub.Revolute, lambda a, b: ub.Slide(a.end, b.start, SOFT, axis=(1, 0)), (), "Revolute("),
        (
            lambda a, b: ub.Revolute(a, b, multipliers=True),
            lambda a, b: ub.Slide(a.end, b.start, SOFT, axis=(1, 1)), (), "Revolute(",
        ),
        (
            ub.Revolute,
            lambda a, b: ub.Bushing(a.end, b.start, ub.Clearance(stiffness=1e6, gap=1e-3)),
            (), "Revolute(",
        ),
        (
            ub.Revolute, lambda a, b: ub.Turn(ub.ground(0, 0), a.start, SOFT), ub.Clamped,
            "Clamped",
        ),
    ],
)  # fmt: skip
def test_connectors_whose_motion_is_held(joints, connect, supports, named):
    a, b = beam((0, 0), (1, 0), name="a"), beam((1, 0), (2, 0), name="b")
    held = [supports(a.start)] if supports else [ub.Pinned(a.start)]
    more = {"joints": [joints(a.end, b.start)], "connectors": [connect(a, b)], "supports": held}
    with warns("its motion is held at zero by", named, "Revolute"):
        begin(a, b, **more)


def test_connectors_whose_motion_is_free_do_not_warn():
    a, b = beam((0, 0), (1, 0), name="a"), beam((1, 0), (2, 0), name="b")
    turned = ub.PrescribedDisplacement(a.start, u=0.0, v=0.0, psi=lambda t: t)
    begin(
        a, b, joints=[ub.Revolute(a.end, b.start)], supports=[turned],
        connectors=[
            ub.Turn(a.end, b.start, SOFT), ub.Turn(ub.ground(0, 0), a.start, SOFT),
            ub.Stretch(a.start, b.end, SOFT),
        ],
    )  # fmt: skip
    # no warning is issued


def test_an_end_that_touches_the_middle_of_a_beam():
    a, b = beam(name="a"), beam((0.5, 0), (0.5, 1), name="b")
    with warns("b.start (0.5, 0) and a.at(0.5) (0.5, 0) touch"):
        begin(a, b)


def test_a_ring_that_is_not_closed():
    ring = ub.Beam.arc((0, 0), 1.0, (0, 2 * math.pi), HEAVY, name="ring")
    with warns("ring.start (1, 0) and ring.end (1, ", "touch"):
        begin(ring)
    begin(ring, joints=[ub.Rigid(ring.start, ring.end)])


@pytest.mark.parametrize(
    "join",
    [
        lambda a, b: {"joints": [ub.Rigid(a.end, b.start)]},
        lambda a, b: {"joints": [ub.Revolute(a.end, b.start, multipliers=True)]},
        lambda a, b: {"connectors": [ub.Turn(a.end, b.start, ub.Spring(1.0))]},
        lambda a, b: {"supports": [ub.Pinned(a.end), ub.Clamped(b.start)]},
        lambda a, b: {
            "supports": [ub.Pinned(a.end)],
            "joints": [ub.Revolute(ub.ground(1, 0), b.start)],
        },
        lambda a, b: {
            "bodies": [hub := ub.Body((1, 0), mass=1.0, inertia=1.0)],
            "joints": [ub.Rigid(a.end, hub.middle), ub.Rigid(hub.middle, b.start)],
        },
    ],
)
def test_beams_that_are_joined_where_they_touch_do_not_warn(join):
    a, b = beam(name="a"), beam((1, 0), (2, 0), name="b")
    begin(a, b, **join(a, b))  # no warning is issued


def test_beams_that_cross_or_are_apart_do_not_warn():
    """Ends matter: beams in two planes may cross."""
    a, b, c = beam((-1, 0), (1, 0)), beam((0, -1), (0, 1)), beam((1.01, 0), (2, 0))
    begin(a, b, c)  # no warning is issued


def test_touching_places_of_large_scenes_are_found_fast():
    """20 000 beams in a row, one joint forgotten: Python calls grow with beams, not with pairs."""
    from ufl_beam.discretization.dof_numbering import DofNumbering
    from ufl_beam.discretization.model_warnings import warn_of_touching

    number, forgotten = 20_000, 12_345
    row = [beam((i, 0), (i + 1, 0), name=f"b{i}", cells=1) for i in range(number)]
    pairs = [pair for i, pair in enumerate(pairwise(row)) if i != forgotten]
    numbering = DofNumbering(ub.Scene(row, joints=[ub.Rigid(x.end, y.start) for x, y in pairs]))
    calls = 0

    def count(frame, event, argument):
        nonlocal calls
        calls += event in ("call", "c_call")

    with warns("b12345.end (12346, 0) and b12346.start (12346, 0) touch"):
        sys.setprofile(count)
        try:
            warn_of_touching(numbering)
        finally:
            sys.setprofile(None)
    assert calls < 10 * number  # pairs of beams: 2e8


# -- the same thing twice ------------------------------------------------------------------------


def test_the_same_joint_twice():
    a, b = beam(name="a"), beam((1, 0), (2, 0), name="b")
    joint = ub.Revolute(a.end, b.start)
    for second in (joint, ub.Revolute(a.end, b.start), ub.Revolute(b.start, a.end)):
        with raises("Scene: Revolute(", "occurs twice, as joints[0] and joints[1]; remove one"):
            ub.Scene([a, b], joints=[joint, second])


@pytest.mark.parametrize(
    ("part", "make"),
    [
        ("loads", lambda b: ub.PointLoad(b.end, force=(1, 0))),
        ("masses", lambda b: ub.PointMass(b.end, 1.0)),
        ("connectors", lambda b: ub.Turn(ub.ground(0, 0), b.start, ub.Spring(1.0))),
        ("initial", lambda b: ub.Velocity([b], linear=(1, 0))),
        ("damping", lambda b: ub.Rayleigh(mass=1.0)),
    ],
)
def test_the_same_record_twice(part, make):
    one = beam()
    record = make(one)
    with raises("occurs twice", f"{part}[0] and {part}[2]"):
        ub.Scene([one], **{part: [record, make(one), record]})
    ub.Scene([one], **{part: [record, make(one)]})


# -- points of bodies ----------------------------------------------------------------------------


@pytest.mark.parametrize("inertia", [0.1, 0.0])
def test_a_point_of_a_body_that_was_meant_relative_to_its_centre(inertia):
    """at(x, y) takes coordinates of the scene; with inertia the radius of gyration tells."""
    wheel = ub.Body((12, 0), mass=1.0, inertia=inertia, name="wheel")
    spring = ub.Stretch(ub.ground(12, 1), wheel.at(0.1, 0.2), ub.Spring(1.0))
    far = [ub.PrescribedDisplacement(wheel.middle, psi=0.0)]
    with warns("wheel (0.1, 0.2) is 11.9 m away from the centre of wheel", "at(12 + 0.1, 0 + 0.2)"):
        begin(bodies=[wheel], connectors=[spring], supports=far)
    near = ub.Stretch(ub.ground(12, 1), wheel.at(12.1, 0.2), ub.Spring(1.0))
    begin(bodies=[wheel], connectors=[near], supports=far)


def test_a_long_arm_that_meets_something_does_not_warn():
    """A small bob on a long massless arm: the point is far out, but the pivot is there."""
    bob = ub.Body((0, -5), mass=1.0, inertia=1e-4, name="bob")
    # no warning is issued
    begin(bodies=[bob], joints=[ub.Revolute(ub.ground(0, 0), bob.at(0, 0))])


# -- initial velocities --------------------------------------------------------------------------


def test_a_rotation_about_the_origin_by_default():
    one = beam((10, 0), (11, 0))
    with warns("Velocity of girder: angular = 3 rad/s without about=", "10 m away"):
        begin(one, initial=[ub.Velocity([one], angular=3.0)])
    begin(one, initial=[ub.Velocity([one], angular=3.0, about=(0, 0))])
    begin(one, initial=[ub.Velocity([one], linear=(1, 0))])
    # A blade on a hub in the origin
    near = beam((0.5, 0), (1.5, 0))
    begin(near, initial=[ub.Velocity([near], angular=3.0)])


def test_a_velocity_that_a_support_takes_away():
    one = beam()
    with warns("Velocity of girder: Clamped at girder.start (0, 0) prescribes", "psi", "an impact"):
        begin(one, supports=[ub.Clamped(one.start)], initial=[ub.Velocity([one], angular=1.0)])
    # About a pin it agrees
    begin(one, supports=[ub.Pinned(one.start)], initial=[ub.Velocity([one], angular=1.0)])
    hub = ub.Body((0, 0), mass=1.0, inertia=1.0, name="hub")
    with raises("Velocity: hub does not move, because Clamped at hub (0, 0) holds it"):
        begin(
            bodies=[hub],
            supports=[ub.Clamped(hub.middle)],
            initial=[ub.Velocity([hub], linear=(1, 0))],
        )


# -- prescribed motions --------------------------------------------------------------------------


def test_motions_that_jump_at_the_start():
    one = beam()
    jump = ub.PrescribedDisplacement(one.end, v=0.5)
    with warns(
        "PrescribedDisplacement at girder.end (1, 0): v jumps from 0 to 0.5 m at the start, t = 0 s"
    ):
        begin(one, supports=[ub.Clamped(one.start), jump])
    turn = ub.Turn(ub.ground(0, 0), one.start, ub.PrescribedMotion(lambda t: 0.2 + t))
    with warns("Turn(", "its motion jumps from 0 to 0.2 rad"):
        begin(one, supports=[ub.Pinned(one.start)], connectors=[turn])
    # In statics it is a step of loading
    begin(one, scheme=ub.Static(), supports=[ub.Clamped(one.start), jump])


def test_a_run_that_begins_where_the_motion_is_does_not_warn():
    one = beam()
    held = ub.PrescribedDisplacement(one.end, v=0.01)
    scene = clamped(one, held)
    statics = ub.simulate(scene, ub.Static(), t=(0, 1), dt=0.5, comm=MPI.COMM_SELF)
    # no warning is issued
    ub.Simulation(scene, ub.EnergyMomentum(), t0=1.0, start=statics, comm=MPI.COMM_SELF).close()


# -- sections ------------------------------------------------------------------------------------


@pytest.mark.parametrize("unit", [1.0, 1e3, 1e-3])
def test_sections_in_millimetres(unit):
    """Whatever the unit of the scene is, a section is smaller than its beam is long."""
    steel = {"E": 210e9, "nu": 0.3}
    with warns("girder: its section is", "m long", "in mm?"):
        beam(b=(6 * unit, 0), section=st.i_shape(
            300 * unit, 150 * unit, 7 * unit, 11 * unit, **steel
        ))  # fmt: skip
    with warns("girder: its section is"):
        beam(b=(6 * unit, 0), section=ub.Section(EA=1.0, GA=1.0, EI=(87 * unit) ** 2))
    beam(b=(6 * unit, 0), section=st.i_shape(
        0.3 * unit, 0.15 * unit, 0.007 * unit, 0.011 * unit, **steel
    ))  # fmt: skip
    # Rigid in bending on purpose
    beam(b=(6 * unit, 0), section=ub.Section(1.0, 1.0, (87 * unit) ** 2, depth=0.3 * unit))


# -- too many cells ------------------------------------------------------------------------------


def test_more_cells_than_memory():
    with raises("girder: cells = 1000000000000 would take 4e+05 GB of memory; this machine has"):
        beam(cells=10**12)
    one = beam()
    with raises("Mesh: refine = 1000000000000 of girder, 2000000000000 cells, would take 8e+05 GB"):
        ub.Simulation(ub.Scene([one]), ub.EnergyMomentum(), mesh=ub.Mesh(refine=10**12))


def test_good_scenes_are_silent():
    """Warnings are errors in the tests: a portal on a spring, pushed, dragged and thrown."""
    left, roof, right = beam((0, 0), (0, 1)), beam((0, 1), (1, 1)), beam((1, 1), (1, 0))
    hub = ub.Body((1, 0), mass=1.0, inertia=0.1)
    scene = ub.Scene(
        [left, roof, right],
        bodies=[hub],
        joints=[
            ub.Rigid(left.end, roof.start),
            ub.Release(roof.end, right.start, free="M"),
            ub.Rigid(right.end, hub.middle),
        ],
        supports=[ub.PrescribedDisplacement(left.start, u=lambda t: 0.01 * t, v=0, psi=0)],
        connectors=[ub.Stretch(ub.ground(1.2, 0.1), hub.at(1.1, 0.1), ub.Spring(10.0))],
        loads=[ub.Gravity()],
        initial=[ub.Velocity([right, hub], linear=(0, 0))],
    )
    solution = ub.simulate(scene, ub.EnergyMomentum(), t=(0, 0.02), dt=0.01, comm=MPI.COMM_SELF)
    assert np.isfinite(solution.q).all()


# -- numbers in other units ------------------------------------------------------------------------

STEEL = {"E": 210e9, "nu": 0.3, "rho": 7850.0}


def square(**more):
    return ub.Section.rectangle(b=0.1, h=0.1, **(STEEL | more))


def still(*loads):
    bar = beam((0, 0), (2, 0), square())
    loads = [load(bar) for load in loads]
    scene = ub.Scene([bar], supports=[ub.Clamped(bar.start)], loads=loads)
    return ub.simulate(scene, ub.Static(), t=(0, 1), dt=1.0, comm=MPI.COMM_SELF)


@pytest.mark.parametrize(
    ("make", "said"),
    [
        (lambda: square(E=210e3), "are of no material"),
        (lambda: square(E=210.0), "are of no material"),
        (lambda: square(rho=7.85), "are of no material"),
        (lambda: square(E=30e3, rho=2500.0), "are of no material"),
        (lambda: square(fibres=ub.Fibres(ub.ElastoPlastic(355.0))), "yield strain 1.69e-09"),
        (lambda: square(fibres=ub.Fibres(ub.ElastoPlastic(0.355))), "yield strain 1.69e-12"),
        (
            lambda: square(E=27e9, rho=2400.0, fibres=ub.Fibres(st.Mander(30e6, 0.2))),
            "strain over strength / E 180; 0.002 is 0.2 %",
        ),
        (lambda: st.SNCurve(range=71.0), "stress range 71; it is in Pa"),
        (
            lambda: ub.ImposedStrain.tendon(beam(), 1e3, ub.Table([0, 10], [0.0, 0.01])),
            "end of a table along the beam 10; s is from 0 to 1",
        ),
        (
            lambda: ub.LineLoad(beam(), (0, -1e3), profile=ub.Table([0, 10], [1.0, 0.5])),
            "profile: end of a table along the beam 10",
        ),
        (lambda: ub.Rayleigh.with_ratios(5.0, (10.0, 60.0)), "damping ratio 5; 0.05 is 5 %"),
        (lambda: ub.ImposedStrain(beam(), axial=20.0), "imposed strain 20"),
        (
            lambda: ub.ImposedStrain.temperature(beam(), 20.0, 1e-5, gradient=100.0),
            "curvature times depth",
        ),
        (lambda: ub.ImposedStrain.tendon(beam(), 1e12), "imposed strain -1e+06|strain 1e+06"),
        (lambda: st.imperfect(ub.Scene([beam()]), sway=5.0), "inclination 5"),
        (lambda: st.imperfect(ub.Scene([b := beam()]), bow={b: 6.7}), "bow 6.7"),
        (lambda: st.HotSpot.fibre(beam(section=square()).start, y=100.0, E=210e9), "y is in m"),
        (lambda: still(lambda b: ub.MovingLoad(b, lambda t: 100 + t, (0, -1))), "does not act"),
        (
            lambda: still(lambda b: ub.Gravity(), lambda b: ub.MovingLoad(b, lambda t: t, mass=1)),
            "its mass has no weight",
        ),
    ],
)  # fmt: skip
def test_numbers_that_are_likely_in_other_units(make, said):
    with pytest.warns(ub.ModelWarning, match=said.replace("+", r"\+")):
        make()


def test_a_target_of_a_pushover_beyond_the_scene():
    bar = beam((0, 0), (2, 0), square())
    scene = ub.Scene([bar], supports=[ub.Clamped(bar.start)])
    with warns("target over the size of the scene -25"), pytest.raises(ub.ArgumentError):
        st.pushover(scene, bar.end, -50.0, component="v", pattern="none")


@pytest.mark.parametrize(
    ("E", "rho", "limit"), [(210e9, 7850.0, 355e6), (1e6, 1000.0, 1e4), (11e9, 500.0, 30e6)]
)
def test_steel_rubber_and_timber_are_plausible(E, rho, limit):
    square(E=E, rho=rho, fibres=ub.Fibres(ub.ElastoPlastic(limit)))  # no warning is issued


@pytest.mark.parametrize(
    ("damping", "rate"),
    [
        (ub.Rayleigh(stiffness=1e-5), 2.0),
    ],
)
def test_rayleigh_damping_of_a_beam_that_turns(damping, rate):
    """The boom turns by 0.3 rad until it rests, and strains store hardly anything."""

    def turn(damping, rate):
        boom = beam((0, 0), (2, 0), square())
        scene = ub.Scene(
            [boom], supports=[ub.Pinned(boom.start)], damping=[damping],
            initial=[ub.Velocity((boom,), angular=rate, about=(0, 0))],
        )  # fmt: skip
        ub.simulate(scene, ub.EnergyMomentum(), t=(0, 0.5), dt=5e-3, comm=MPI.COMM_SELF)

    with warns("resists rigid turning", "Use KelvinVoigt"):
        turn(damping, rate)
    turn(ub.KelvinVoigt(1e-5), rate)  # no warning is issued
    turn(damping, 0.1)  # no warning is issued
