# SPDX-License-Identifier: MIT
"""Scenes that are likely wrong are warned of, by name, on the line of the user; others are not."""

import math
import re
import warnings
from dataclasses import replace
from functools import partial

from mpi4py import MPI

import pytest
from helpers import raises
from scenes import clamped, rigid_chain

import ufl_beam as ub
import ufl_beam.structures as st

HEAVY = ub.Section(EA=1e6, GA=3e5, EI=1e2, rhoA=1.0, rhoI=1e-3)
LIGHT = {"EA": 1e6, "GA": 3e5, "EI": 1e2}
MASSLESS = ub.Section(**LIGHT, rhoA=0.0)
SOFT = ub.Spring(1e3)


def beam(a=(0, 0), b=(1, 0), section=HEAVY, **more):
    return ub.Beam(a, b, section, **{"cells": 2, "name": "girder", **more})


def pair(section=HEAVY):
    """Beams a and b in a row."""
    return beam(name="a"), beam((1, 0), (2, 0), section, name="b")


def begin(*beams, scheme=None, **parts):
    """A simulation of a scene that has made no step."""
    scene = ub.Scene(beams, **parts)
    ub.Simulation(scene, scheme or ub.EnergyMomentum(), comm=MPI.COMM_SELF).close()


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


def pinned(*laws):
    """Function of two beams: they are pinned to each other, with laws of the turn."""
    return lambda a, b: {
        "joints": [ub.Revolute(a.end, b.start)],
        "connectors": [ub.Turn(a.end, b.start, law) for law in laws],
    }


@pytest.mark.parametrize(
    ("hold", "moves"),
    [
        (lambda a, b: {}, "shift"),
        (lambda a, b: {"supports": [ub.Pinned(b.end)]}, "turn about (2, 0)"),
        (lambda a, b: {"masses": [ub.PointMass(b.start, 1.0)]}, "turn about (1, 0)"),
        (pinned(), "turn about (1, 0)"),
        # A stop is free inside of its interval
        (pinned(ub.Stop(1.0, low=-0.1, high=0.1)), "turn about (1, 0)"),
        (pinned(ub.PrescribedForce(lambda t: t)), "turn about (1, 0)"),
    ],
)
def test_massless_parts_whose_motion_is_not_determined(hold, moves):
    a, b = pair(MASSLESS)
    with raises("b (beam 1) can", moves) as failure:
        begin(a, b, **hold(a, b))
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
        *map(pinned, (
            ub.Spring(1.0), ub.Damper(1.0), ub.PrescribedMotion(lambda t: t), ub.Coulomb(1.0),
            ub.ForceLaw(lambda e, rate: e), ub.Stop(1.0, low=0.0),
        )),
    ],
)  # fmt: skip
@pytest.mark.filterwarnings("ignore:.*touch:ufl_beam.ModelWarning")
def test_massless_parts_that_something_holds_do_not_warn(hold):
    a, b = pair(MASSLESS)
    begin(a, b, **hold(a, b))  # no other warning is issued


def test_massless_parts_of_large_scenes():
    """Beyond the size of dense decompositions: 40 massless beams on a row, the last one loose."""
    row = [beam((i, 0), (i + 1, 0), MASSLESS, name=f"b{i}") for i in range(1, 41)]
    scene = rigid_chain([beam(name="a"), *row])
    joints = [*scene.joints[:-1], ub.Revolute(row[-2].end, row[-1].start)]
    with raises("b40 (beam 40) can turn about (40, 0)"):
        begin(*scene.beams, joints=joints)
    begin(*scene.beams, joints=scene.joints)


CIRCLE = partial(ub.Section.circle, 0.1, E=1e9, nu=0.3)


@pytest.mark.parametrize(
    ("forgotten", "stated"), [(ub.Section(**LIGHT), MASSLESS), (CIRCLE(), CIRCLE(rho=0.0))]
)
def test_a_forgotten_density(forgotten, stated):
    """Of one section beside others; stated as zero it is meant, as in cables of a swing."""
    a, b = pair(stated)
    begin(a, b, joints=[ub.Rigid(a.end, b.start)])
    a, b = pair(forgotten)
    joints = [ub.Rigid(a.end, b.start)]
    with warns("b: without mass"):
        begin(a, b, joints=joints)
    with warns("b: without mass"):
        ub.modes(ub.Scene([a, b], joints=joints), 1)
    # Statics has no use for mass
    begin(a, b, scheme=ub.Static(), supports=[ub.Clamped(a.start)], joints=joints)


def test_dynamics_without_any_mass():
    one = beam(section=ub.Section(**LIGHT))
    with warns("girder: without mass", "nothing else in the scene has mass", "Static()"):
        begin(one, supports=[ub.Clamped(one.start)])
    # A mast without mass that carries one
    begin(one, supports=[ub.Clamped(one.start)], masses=[ub.PointMass(one.end, 1.0)])


# -- places that touch ---------------------------------------------------------------------------


def test_beams_that_touch_without_a_joint():
    a, middle = beam(name="a"), beam((0.5, 0), (0.5, 1), name="b")
    for x, apart in ((1, "0"), (1.0001, "0.0001")):
        b = beam((x, 0), (2, 0), name="b")
        with warns(f"a.end (1, 0) and b.start ({x}, 0) touch ({apart} m apart)", "Join them with"):
            begin(a, b)
    with warns("b.start (0.5, 0) and a.at(0.5) (0.5, 0) touch"):
        begin(a, middle)
    with warns("b.start (0.4, 5e-05) and a beside a.at(0.5) (0.5, 0) touch (5e-05 m apart)"):
        begin(a, beam((0.4, 5e-5), (0.4, 1), name="b"))  # between two vertices of a
    ring = ub.Beam.arc((0, 0), 1.0, (0, 2 * math.pi), HEAVY, name="ring")
    with warns("ring.start (1, 0) and ring.end (1, ", "touch"):
        begin(ring)
    begin(ring, joints=[ub.Rigid(ring.start, ring.end)])
    # Beams in two planes may cross, and others are apart; no warning is issued.
    begin(beam((-1, 0), (1, 0)), beam((0, -1), (0, 1)), beam((1.01, 0), (2, 0)))


HUB = ub.Body((1, 0), mass=1.0, inertia=1.0)


@pytest.mark.parametrize(
    "join",
    [
        lambda a, b: {"joints": [ub.Revolute(a.end, b.start, multipliers=True)]},
        lambda a, b: {"connectors": [ub.Turn(a.end, b.start, ub.Spring(1.0))]},
        lambda a, b: {"supports": [ub.Pinned(a.end), ub.Clamped(b.start)]},
        lambda a, b: {
            "supports": [ub.Pinned(a.end)],
            "joints": [ub.Revolute(ub.ground(1, 0), b.start)],
        },
        lambda a, b: {
            "bodies": [HUB],
            "joints": [ub.Rigid(a.end, HUB.middle), ub.Rigid(HUB.middle, b.start)],
        },
    ],
)
def test_beams_that_are_joined_where_they_touch_do_not_warn(join):
    a, b = pair()
    begin(a, b, **join(a, b))  # no warning is issued


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


# -- connectors without effect, and the same thing twice -------------------------------------------


@pytest.mark.parametrize(
    ("joint", "multipliers", "connect", "support"),
    [
        (ub.Rigid, False, lambda a, b: ub.Turn(a.end, b.start, SOFT), ub.Pinned),
        (ub.Rigid, True, lambda a, b: ub.Turn(a.end, b.start, ub.Damper(1.0)), ub.Pinned),
        (ub.Revolute, False, lambda a, b: ub.Slide(a.end, b.start, SOFT, axis=(1, 0)), ub.Pinned),
        (ub.Revolute, True, lambda a, b: ub.Slide(a.end, b.start, SOFT, axis=(1, 1)), ub.Pinned),
        (
            ub.Revolute, False,
            lambda a, b: ub.Bushing(a.end, b.start, ub.Clearance(stiffness=1e6, gap=1e-3)),
            ub.Pinned,
        ),
        (ub.Revolute, False, lambda a, b: ub.Turn(ub.ground(0, 0), a.start, SOFT), ub.Clamped),
    ],
)  # fmt: skip
def test_connectors_whose_motion_is_held(joint, multipliers, connect, support):
    a, b = pair()
    joints, held = [joint(a.end, b.start, multipliers=multipliers)], [support(a.start)]
    named = "Clamped" if support is ub.Clamped else f"{joint.__name__}(a.end"
    with warns("its motion is held at zero by", named, "Revolute"):
        begin(a, b, joints=joints, connectors=[connect(a, b)], supports=held)


def test_the_same_joint_twice():
    a, b = pair()
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


# -- points of bodies, velocities and motions ------------------------------------------------------


@pytest.mark.parametrize("inertia", [0.1, 0.0])
def test_a_point_of_a_body_that_was_meant_relative_to_its_centre(inertia):
    """at(x, y) takes coordinates of the scene; with inertia the radius of gyration tells."""
    wheel = ub.Body((12, 0), mass=1.0, inertia=inertia, name="wheel")
    held = {"bodies": [wheel], "supports": [ub.PrescribedDisplacement(wheel.middle, psi=0.0)]}

    def spring(x, y):
        return [ub.Stretch(ub.ground(12, 1), wheel.at(x, y), ub.Spring(1.0))]

    with warns("wheel (0.1, 0.2) is 11.9 m away from the centre of wheel", "at(12 + 0.1, 0 + 0.2)"):
        begin(connectors=spring(0.1, 0.2), **held)
    begin(connectors=spring(12.1, 0.2), **held)
    # A small bob on a long massless arm: the point is far out, but the pivot is there.
    bob = ub.Body((0, -5), mass=1.0, inertia=1e-4)
    begin(bodies=[bob], joints=[ub.Revolute(ub.ground(0, 0), bob.at(0, 0))])


def test_a_rotation_about_the_origin_by_default():
    far, near = beam((10, 0), (11, 0)), beam((0.5, 0), (1.5, 0))  # near: a blade on a hub
    with warns("Velocity of girder: angular = 3 rad/s without about=", "10 m away"):
        begin(far, initial=[ub.Velocity([far], angular=3.0)])
    begin(far, initial=[ub.Velocity([far], angular=3.0, about=(0, 0))])
    begin(far, initial=[ub.Velocity([far], linear=(1, 0))])
    begin(near, initial=[ub.Velocity([near], angular=3.0)])


def test_a_velocity_that_a_support_takes_away():
    one, hub = beam(), ub.Body((0, 0), mass=1.0, inertia=1.0, name="hub")
    turn = [ub.Velocity([one], angular=1.0)]
    with warns("Velocity of girder: Clamped at girder.start (0, 0) prescribes", "psi", "an impact"):
        begin(one, supports=[ub.Clamped(one.start)], initial=turn)
    begin(one, supports=[ub.Pinned(one.start)], initial=turn)  # about a pin it agrees
    shift = [ub.Velocity([hub], linear=(1, 0))]
    with raises("Velocity: hub does not move, because Clamped at hub (0, 0) holds it"):
        begin(bodies=[hub], supports=[ub.Clamped(hub.middle)], initial=shift)


def test_motions_that_jump_at_the_start():
    one = beam()
    jump = [ub.Clamped(one.start), ub.PrescribedDisplacement(one.end, v=0.5)]
    with warns("at girder.end (1, 0): v jumps from 0 to 0.5 m at the start, t = 0 s"):
        begin(one, supports=jump)
    begin(one, scheme=ub.Static(), supports=jump)  # a step of loading
    turn = ub.Turn(ub.ground(0, 0), one.start, ub.PrescribedMotion(lambda t: 0.2 + t))
    with warns("Turn(", "its motion jumps from 0 to 0.2 rad"):
        begin(one, supports=[ub.Pinned(one.start)], connectors=[turn])
    scene = clamped(one, ub.PrescribedDisplacement(one.end, v=0.01))
    at = ub.simulate(scene, ub.Static(), t=(0, 1), dt=0.5, comm=MPI.COMM_SELF)
    # A run that begins where the motion is: no warning is issued.
    ub.Simulation(scene, ub.EnergyMomentum(), t0=1.0, start=at, comm=MPI.COMM_SELF).close()


# -- sizes and numbers in other units --------------------------------------------------------------


def test_tables_that_change_within_steps():
    """[closed] The impulse of a pulse of 2 ms that ends before the middle of a step is lost."""
    body = ub.Body((0, 0), mass=2.0, inertia=1.0)
    pulse = ub.Table([0, 0.021, 0.022, 0.023], [0, 0, 1, 0])
    push = ub.PointLoad(body.middle, force=(10.0, 0), amplitude=pulse)
    scene = ub.Scene(bodies=[body], loads=[push])
    coarse, fine = partial(ub.simulate, scene, ub.EnergyMomentum(), t=(0, 0.1)), 10.0 * 1e-3 / 2.0
    with warns("PointLoad at body", "Table changes within steps of 0.01 s", "wrong by 100%"):
        assert not coarse(dt=0.01).velocity(body.middle).any()
    for dt in (1e-3, ub.Adaptive(1e-3)):
        assert coarse(dt=dt).velocity(body.middle)[-1, 0] == pytest.approx(fine, rel=1e-9)

    one, there_and_back = beam(), ub.Table([0, 0.5, 1], [0, 0.1, 0])
    root = ub.PrescribedDisplacement(one.start, u=0.0, v=there_and_back, psi=0.0)
    shaken = ub.Scene([one], supports=[root])
    with warns("girder.start", "within steps of 0.3333 s, so that 33% of it are missed"):
        ub.simulate(shaken, ub.EnergyMomentum(), t=(0, 1), dt=0.4)
    ub.simulate(shaken, ub.EnergyMomentum(), t=(0, 1), dt=0.25)


@pytest.mark.serial  # scenes that processes share are not examined
@pytest.mark.parametrize("push", [0.0, 1.0])
def test_an_unstable_equilibrium(push):
    """[closed] A column of 100 N m² and 1 m, shortened by 2 %: EA bears 20 times Euler's load."""
    column = ub.Beam((0, 0), (0, 1), ub.Section(EA=1e6, GA=3e5, EI=1e2), cells=8)
    down = ub.PrescribedDisplacement(column.end, u=0.0, v=lambda t: -0.02 * t)
    load = ub.PointLoad(column.at(0.5), force=(push, 0))
    scene = ub.Scene([column], supports=[ub.Pinned(column.start), down], loads=[load])
    with warns("the equilibrium at t = 1 s is unstable", "negative eigenvalues", "imperfection"):
        straight = ub.simulate(scene, ub.Static(), t=(0, 1), dt=0.25)
    assert straight.displacement(column.at(0.5))[-1, 0] <= 0.0  # against the push
    if push:
        bent = ub.simulate(scene, ub.Static(), t=(0, 1), dt=0.005)
        assert bent.displacement(column.at(0.5))[-1, 0] > 0.08  # 2 L √(0.02)/π = 0.09


@pytest.mark.parametrize("unit", [1.0, 1e3, 1e-3])
def test_sections_in_millimetres(unit):
    """Whatever the unit of the scene is, a section is smaller than its beam is long."""

    def ipe(size):
        return st.i_shape(*(x * size * unit for x in (300, 150, 7, 11)), E=210e9, nu=0.3)

    end, square = (6 * unit, 0), (87 * unit) ** 2
    with warns("girder: its section is", "m long", "in mm?"):
        beam(b=end, section=ipe(1.0))
    with warns("girder: its section is"):
        beam(b=end, section=ub.Section(EA=1.0, GA=1.0, EI=square))
    beam(b=end, section=ipe(1e-3))
    beam(b=end, section=ub.Section(1.0, 1.0, square, depth=0.3 * unit))  # rigid on purpose


def test_more_cells_than_memory():
    with raises("girder: cells = 1000000000000 would take 4e+05 GB of memory; this machine has"):
        beam(cells=10**12)
    scene = ub.Scene([beam()])
    with raises("Mesh: refine = 1000000000000 of girder, 2000000000000 cells, would take 8e+05 GB"):
        ub.Simulation(scene, ub.EnergyMomentum(), mesh=ub.Mesh(refine=10**12))


STEEL = {"E": 210e9, "nu": 0.3, "rho": 7850.0}


def square(limit=None, **more):
    fibres = None if limit is None else ub.Fibres(ub.ElastoPlastic(limit))
    return ub.Section.rectangle(b=0.1, h=0.1, **{**STEEL, "fibres": fibres, **more})


def still(*loads):
    bar = beam((0, 0), (2, 0), square())
    scene = clamped(bar, loads=[load(bar) for load in loads])
    return ub.simulate(scene, ub.Static(), t=(0, 1), dt=1.0, comm=MPI.COMM_SELF)


@pytest.mark.parametrize(
    ("make", "said"),
    [
        (lambda: square(E=210e3), "are of no material"),
        (lambda: square(rho=7.85), "are of no material"),
        (lambda: square(E=30e3, rho=2500.0), "are of no material"),
        (lambda: square(E=210e6), "are of no material"),  # kN/m²
        (lambda: square(355.0), "yield strain 1.69e-09"),
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
        (lambda: ub.ImposedStrain.tendon(beam(), 1e12), "strain 1e+06"),
        (lambda: st.imperfect(ub.Scene([beam()]), sway=5.0), "inclination 5"),
        (lambda: st.imperfect(ub.Scene([b := beam()]), bow={b: 6.7}), "bow 6.7"),
        (lambda: st.HotSpot.fibre(beam(section=square()).start, y=100.0, E=210e9), "y is in m"),
        (lambda: still(lambda b: ub.MovingLoad(b, lambda t: 100 + t, (0, -1))), "does not act"),
        (lambda: still(lambda b: ub.MovingLoad(b, lambda t: 3 * t, (0, -1))), "in one step, so"),
        (lambda: still(lambda b: ub.MovingLoad(b, lambda t: 2 - 3 * t, (0, -1))), "in one step"),
        (
            lambda: still(lambda b: ub.Gravity(), lambda b: ub.MovingLoad(b, lambda t: t, mass=1)),
            "its mass has no weight",
        ),
    ],
)  # fmt: skip
def test_numbers_that_are_likely_in_other_units(make, said):
    with warns(said):
        make()


def test_a_target_of_a_pushover_beyond_the_scene():
    bar = beam((0, 0), (2, 0), square())
    with warns("target over the size of the scene -25"), pytest.raises(ub.ArgumentError):
        st.pushover(clamped(bar), bar.end, -50.0, component="v", pattern="none")


@pytest.mark.parametrize(
    ("E", "rho", "limit"), [(210e9, 7850.0, 355e6), (1e6, 1000.0, 1e4), (11e9, 500.0, 30e6)]
)
def test_steel_rubber_and_timber_are_plausible(E, rho, limit):
    square(limit, E=E, rho=rho)  # no warning is issued


def test_rayleigh_damping_of_a_beam_that_turns():
    """The boom turns by 0.3 rad until it rests, and strains store hardly anything."""

    def turn(damping, rate):
        boom = beam((0, 0), (2, 0), square())
        spin = ub.Velocity((boom,), angular=rate, about=(0, 0))
        supports = [ub.Pinned(boom.start)]
        scene = ub.Scene([boom], supports=supports, damping=[damping], initial=[spin])
        ub.simulate(scene, ub.EnergyMomentum(), t=(0, 0.5), dt=5e-3, comm=MPI.COMM_SELF)

    rayleigh = ub.Rayleigh(stiffness=1e-5)
    with warns("resists rigid turning", "Use KelvinVoigt"):
        turn(rayleigh, 2.0)
    turn(ub.KelvinVoigt(1e-5), 2.0)  # no warning is issued
    turn(rayleigh, 0.1)  # no warning is issued
