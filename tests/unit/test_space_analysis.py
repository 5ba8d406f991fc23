# SPDX-License-Identifier: MIT
"""Analyses in space: vibration, buckling, mechanisms, paths, derivatives of runs."""

import re
from dataclasses import replace

import numpy as np
import pytest
from into_space import EXACT, SKEW, InSpace
from scipy.optimize import brentq
from test_space import OTHER, PLANAR, STIFF

import ufl_beam as ub
import ufl_beam.structures as st


def flat_modes(shapes):
    """Return the modes whose displacements are in the turned plane."""
    nodes = shapes.numbering.dofs[:, :3]
    moved = np.array([SKEW.inv().apply(shapes.shapes[nodes, k]) for k in range(len(shapes))])
    return np.abs(moved[..., 2]).max(axis=1) < 1e-6 * np.abs(moved).max(axis=(1, 2))


@pytest.mark.parametrize("loads", [(), ((3.0, -8.0),)])
def test_planar_modes_in_a_turned_plane(loads):
    """Modes of a planar frame are among those in space, undeformed and about a static state."""
    long = ub.Beam((6, 0), (0, 8), PLANAR, cells=6)
    short = ub.Beam((0, 8), (3, 9), PLANAR, cells=3)
    ball = ub.Body((3.5, 9), mass=30.0, inertia=5.0)
    frame = ub.Scene(
        [long, short], bodies=[ball], supports=[ub.Clamped(long.start)],
        joints=[ub.Rigid(long.end, short.start), ub.Rigid(short.end, ball.at(3, 9))],
        loads=[ub.PointLoad(long.end, force=x, amplitude=lambda t: t) for x in loads],
    )  # fmt: skip
    both = []
    for scene, count in ((frame, 4), (InSpace(frame, SKEW).scene, 12)):
        state = None
        if loads:
            state = ub.simulate(scene, ub.Static(), t=(0, 1), dt=0.5, newton=EXACT)
        both.append(ub.modes(scene, count, at=state))
    plane, space = both
    found = space.omega[flat_modes(space)]
    assert np.abs(found[:4] / plane.omega - 1).max() < 1e-9
    assert len(found) < 12  # others are out of the plane


def test_lengths_of_shapes_do_not_depend_on_axes():
    """The largest displacement is a vector of length 1, and that of an imperfection as given."""
    along = np.array([1.0, 2, 2]) / 3
    column = ub.Beam((0, 0, 0), tuple(along), ub.Section(**STIFF, **OTHER), name="column")
    load = ub.PointLoad(column.end, force=tuple(-along))
    scene = ub.Scene([column], supports=[ub.Clamped(column.start)], loads=[load])
    for shapes in (ub.modes(scene, 3), ub.buckling(scene, 1)):
        for k in range(len(shapes)):
            moved = shapes.shapes[shapes.numbering.dofs[:, :3], k]
            size = np.linalg.norm(moved, axis=1).max()
            assert abs(size - 1) < 1e-14 or size < 1e-9  # torsion
    crooked = st.imperfect(scene, mode=shapes, amplitude=0.01)
    moved = np.subtract(crooked["column"].end.point, column.end.point)
    assert abs(np.linalg.norm(moved) - 0.01) < 1e-15


def test_planar_buckling_in_a_turned_plane():
    beam = ub.Beam((0, 0), (0, 5), PLANAR, cells=6)
    load = ub.PointLoad(beam.end, force=(0, -1.0))
    plane = ub.Scene([beam], supports=[ub.Clamped(beam.start)], loads=[load])
    one, other = (ub.buckling(x, 1).factors[0] for x in (plane, InSpace(plane, SKEW).scene))
    assert abs(other / one - 1) < 1e-8


def test_planar_buckling_of_a_frame_with_unequal_loads():
    """Differences of the stiffness need loads below the factor; estimates of errors hold."""
    section = ub.Section(EA=2e6, GA=8e5, EI=300.0)
    posts = [ub.Beam((x, 0), (x, 3), section, cells=8) for x in (0, 3)]
    girder = ub.Beam((0, 3), (3, 3), section, cells=6)
    loads = [ub.PointLoad(x.end, force=(0, -f)) for x, f in zip(posts, (10.0, 3.0), strict=True)]
    joints = [ub.Rigid(x.end, y) for x, y in zip(posts, (girder.start, girder.end), strict=True)]
    feet = [ub.Clamped(x.start) for x in posts]
    plane = ub.Scene([*posts, girder], joints=joints, supports=feet, loads=loads)
    one, other = ub.buckling(plane, 1), ub.buckling(InSpace(plane, SKEW).scene, 2)
    (factor,), (_, found) = one.factors, other.factors  # the first one is out of the plane
    assert abs(found / factor - 1) < one.errors[0] + other.errors[1] < 1e-3


L = 2.0
NARROW = ub.Section(
    EA=1.05e7, GA=3.5e6, GA3=3.5e6, EI=2187.5, EI2=0.875, GJ=1.35, rhoA=0.4, rhoI=8e-5, rhoI2=4e-8
)
"""A strip of 1 x 50 mm; axis 2 is along its height."""


def extrapolated(values, order=2):
    """Return values on halved cells without their error of second order."""
    coarse, fine = values
    return fine + (fine - coarse) / (2**order - 1)


def strip(cells, section=NARROW, **more):
    beam = ub.Beam((0, 0, 0), (L, 0, 0), section, cells=cells)
    return ub.Scene([beam], supports=[ub.Clamped(beam.start)], **more), beam


def omega_along(shapes, component, count):
    """Return frequencies of modes whose largest motion is a component of the nodes."""
    moves = np.abs(shapes.shapes[shapes.numbering.dofs]).max(axis=0)  # (6, n)
    return shapes.omega[moves.argmax(axis=0) == component][:count]


@pytest.mark.parametrize("component", [1, 2])
def test_frequencies_about_both_axes(component):
    """Bending of a cantilever, against closed forms of slender beams."""
    section = ub.Section(
        EA=1e8, GA=1e8, GA3=1e8, EI=90.0, EI2=40.0, GJ=50.0, rhoA=1.0, rhoI=1e-6, rhoI2=1e-6
    )
    found = []
    for cells in (16, 32):
        shapes = ub.modes(strip(cells, section)[0], 8)
        moves = np.abs(shapes.shapes[shapes.numbering.dofs[:, 1:3]]).max(axis=0)
        found.append(shapes.omega[moves[component - 1] > 0.5][:2])
    β = np.array([1.8751040687, 4.6940911330]) / L
    exact = β**2 * np.sqrt(40.0 if component == 1 else 90.0)
    assert np.abs(extrapolated(found) / exact - 1).max() < 1e-4


def test_frequencies_of_torsion_and_stretch():
    section = ub.Section(
        EA=4e4, GA=1e9, GA3=1e9, EI=1e3, EI2=1e3, GJ=3e4, rhoA=1.0, rhoI=0.7, rhoI2=0.3
    )
    found = [ub.modes(strip(cells, section)[0], 8) for cells in (16, 32)]
    for speed, component in ((np.sqrt(4e4), 0), (np.sqrt(3e4), 3)):
        omega = [omega_along(shapes, component, 1)[0] for shapes in found]
        assert abs(extrapolated(omega) / (np.pi * speed / (2 * L)) - 1) < 1e-5


def test_lateral_buckling_of_a_cantilever():
    """Bending before buckling changes the factor by about EI2/EI and GJ/EI."""
    exact = 4.012599 * np.sqrt(NARROW.EI2 * NARROW.GJ) / L**2
    found = []
    for cells in (8, 16):
        scene, beam = strip(cells)
        push = ub.PointLoad(beam.end, force=(0, 0, -1.0))
        shapes = ub.buckling(ub.Scene([beam], supports=scene.supports, loads=[push]), 2)
        assert np.allclose(*np.abs(shapes.factors), rtol=1e-7)
        assert (shapes.errors < 1e-6).all()
        found.append(np.abs(shapes.factors[0]))
    assert abs(extrapolated(found) / exact - 1) < (NARROW.EI2 + NARROW.GJ) / NARROW.EI + 1e-4


@pytest.mark.parametrize("z", [[], [0.0]], ids=["plane", "space"])
def test_buckling_under_other_loads_than_those_of_the_state(z):
    """New loads grow from zero to their values, and others vanish."""
    more = {"EI2": 2e3, "GA3": 1e7, "GJ": 1e3} if z else {}
    beam = ub.Beam((0, 0, *z), (2, 0, *z), ub.Section(EA=1e7, GA=1e7, EI=1e3, **more), cells=8)
    support = [ub.Clamped(beam.start)]  # the column bears 617 N
    one, two, three = (ub.PointLoad(beam.end, force=(-x, 0, *z)) for x in (100.0, 200.0, 50.0))
    scene = ub.Scene([beam], supports=support, loads=[one, two])
    (critical,) = ub.buckling(replace(scene, loads=[one]), 1).factors
    at = ub.simulate(replace(scene, loads=[one, three]), ub.Static(), t=(0, 1), dt=1.0)
    (factor,) = ub.buckling(scene, 1, at=at).factors
    assert 1.5 + 1.5 * factor == pytest.approx(critical, rel=1e-7)  # times 100 N


def test_buckling_in_uniform_bending():
    """Fork ends; constant moments at both ends."""
    exact, found = np.pi * np.sqrt(NARROW.EI2 * NARROW.GJ) / L, []
    held = ub.PrescribedMotion(lambda t: 0.0)
    for cells in (8, 16):
        beam = ub.Beam((0, 0, 0), (L, 0, 0), NARROW, cells=cells)
        ends = (ub.ground(0, 0, 0), beam.start), (ub.ground(L, 0, 0), beam.end)
        forks = [ub.Turn(*end, held, axis=(1, 0, 0)) for end in ends]
        forks += [ub.Slide(*ends[1], held, axis=axis) for axis in ((0, 1, 0), (0, 0, 1))]
        scene = ub.Scene(
            [beam], joints=[ub.Spherical(*ends[0])], connectors=forks,
            loads=[
                ub.PointLoad(beam.start, moment=(0, 1.0, 0)),
                ub.PointLoad(beam.end, moment=(0, -1.0, 0)),
            ],
        )  # fmt: skip
        found.append(abs(ub.buckling(scene, 1).factors[0]))
    assert abs(extrapolated(found) / exact - 1) < (NARROW.EI2 + NARROW.GJ) / NARROW.EI + 1e-4


def test_a_square_column_buckles_about_both_axes():
    section = ub.Section(**STIFF | OTHER | {"EI": 500.0, "EI2": 500.0, "GA3": 1e4})
    beam = ub.Beam((0, 0, 0), (3, 4, 12), section, cells=8)
    push = ub.PointLoad(beam.end, force=(-3 / 13, -4 / 13, -12 / 13))
    found = ub.buckling(ub.Scene([beam], supports=[ub.Clamped(beam.start)], loads=[push]), 2)
    assert abs(found.factors[0] / found.factors[1] - 1) < 1e-9
    weak = ub.Section(**STIFF | OTHER | {"EI2": 200.0})
    both = []
    for cells in (8, 16):
        beam = ub.Beam((0, 0, 0), (3, 4, 12), weak, cells=cells)
        push = ub.PointLoad(beam.end, force=(-3 / 13, -4 / 13, -12 / 13))
        scene = ub.Scene([beam], supports=[ub.Clamped(beam.start)], loads=[push])
        both.append(ub.buckling(scene, 1).factors[0])
    euler = np.pi**2 * 200.0 / (4 * 13.0**2)
    assert abs(extrapolated(both) / euler - 1) < 2 * euler / 7e3 + 1e-4  # shear


def test_buckling_of_a_frame_whose_column_shortens():
    """[closed] A clamped column, a beam pinned at its far end: the rotation of the corner buckles.

    The beam bends as the column shortens, so that no equilibrium is near the factor.
    """
    L, a, EI, found = 1.5, 1.2, 3.0, []
    section = ub.Section(EA=2e5, GA=8e4, GA3=8e4, EI=EI, EI2=9.0, GJ=5.0)
    for cells in (16, 32):
        column = ub.Beam((0, 0, 0), (0, 0, L), section, cells=cells, up=(1, 0, 0))
        beam = ub.Beam((0, 0, L), (a, 0, L), section, cells=cells)
        feet = [ub.Clamped(column.start), ub.Pinned(beam.end)]
        push = ub.PointLoad(column.end, force=(0, 0, -1.0))
        joints = [ub.Rigid(column.end, beam.start)]
        frame = ub.Scene([column, beam], joints=joints, supports=feet, loads=[push])
        found.append(ub.buckling(frame, 2))

    def stiffness(u):  # of the corner, in EI
        return u * (np.sin(u) - u * np.cos(u)) / (2 - 2 * np.cos(u) - u * np.sin(u)) / L + 3 / a

    P = brentq(stiffness, 4.6, 6.2) ** 2 * EI / L**2
    coarse, fine = (x.factors[1] for x in found)
    assert (4 * fine - coarse) / 3 == pytest.approx(P / (1 + P / section.GA), rel=5e-4)
    assert found[1].errors[1] < 1e-3


def test_frequencies_vanish_at_the_buckling_load():
    """Modes about loaded states, at stored states before the last one, too."""
    scene, beam = strip(8)
    (factor,) = ub.buckling(
        ub.Scene(
            [beam], supports=scene.supports, loads=[ub.PointLoad(beam.end, force=(-1.0, 0, 0))]
        ), 1,
    ).factors  # fmt: skip
    push = ub.PointLoad(beam.end, force=(-factor, 0, 0), amplitude=lambda t: t)
    scene = ub.Scene([beam], supports=scene.supports, loads=[push])
    run = ub.simulate(scene, ub.Static(), t=(0, 0.999), dt=0.333, newton=EXACT)
    squares = [ub.modes(scene, 1, at=(run, n)).omega[0] ** 2 for n in range(4)]
    assert squares[3] < 2e-3 * squares[0]
    assert np.all(np.diff(squares) < 0)


def test_runs_start_from_stored_states():
    """In dynamics and statics, with a dead moment and a spring at an arm of a body."""
    for scheme in (ub.EnergyMomentum(), ub.Static()):
        scene = bent_arm()
        options = {"dt": 0.1, "newton": EXACT}
        whole = ub.simulate(scene, scheme, t=(0, 1), **options)
        second = ub.simulate(scene, scheme, t=(0.5, 1), start=(whole, 5), **options)
        for part in (*scene.beams, *scene.bodies):
            place = getattr(part, "end", None) or part.middle
            a, b = (run.displacement(place)[-1] for run in (whole, second))
            assert np.abs(a - b).max() < 1e-10


def test_runs_start_from_states_that_a_simulation_keeps():
    """Without end(), and after later states than that of end()."""
    scene = bent_arm()
    for scheme in (ub.EnergyMomentum(), ub.Static()):
        simulation = ub.Simulation(scene, scheme, newton=EXACT)
        for t in (0.1, 0.3):
            simulation.step_to(t)
            simulation.keep()
            follower = ub.Simulation(scene, scheme, t0=t, start=simulation.solution, newton=EXACT)
            simulation.end()
            follower.step_to(t + 0.1)
            simulation.step_to(t + 0.1)
            for beam in scene.beams:
                a, b = (x.displacement(beam.end) for x in (simulation, follower))
                assert np.abs(a - b).max() < 1e-10


def test_pictures_and_files_of_modes(shared_path):
    shapes = ub.modes(strip(4)[0], 3)
    swing = shapes.motion(1, count=8)
    (beam,) = shapes.scene.beams
    tip = swing.displacement(beam.end)
    assert np.abs(tip[0, :3]).max() == pytest.approx(0.1 * L)
    assert np.abs(tip[4] + tip[0]).max() < 1e-12
    assert shapes.shape(1, beam.end).shape == (6,)
    shapes.write(shared_path / "modes.hdf")


ARM = ub.Beam((0, 0, 0), (1, 2, 0), ub.Section(**STIFF, **OTHER), name="arm")
BALL = ub.Body((1, 2, 1), mass=1.0, inertia=(1, 1, 1), name="ball")
BASE, HELD, PINNED = ub.ground(0, 0, 0), [ub.Clamped(ARM.start)], [ub.Pinned(ARM.start)]
MECHANISMS = {
    "free": ({}, "6 independent ways"),
    "pinned": ({"supports": PINNED}, "3 independent ways"),
    "turning": (
        {"joints": [ub.Revolute(BASE, ARM.start, axis=(1, 1, 0))]},
        "arm (beam 0) can turn about the axis (0.707, 0.707, 0) through (0, 0, 0)",
    ),
    "sliding": (
        {"joints": [ub.Prismatic(BASE, ARM.start, axis=(0, 0, 1))]},
        "1 way, so statics has no unique answer: arm (beam 0) can shift along (0, 0, ",
    ),
    "hanging": (
        {"supports": HELD, "bodies": [BALL], "joints": [ub.Link(ARM.end, BALL.middle)]},
        "5 independent ways",
    ),
    "loaded": (
        {"supports": PINNED, "loads": [ub.Gravity((1, 2, 0))]},
        "arm (beam 0) can turn about the axis (0.447, 0.894, 0) through (0, 0, 0). The loads do "
        "not hold it either",
    ),
    "held": ({"supports": HELD, "loads": [ub.Gravity((1, 2, 0))]}, ""),
}  # fmt: skip


@pytest.mark.parametrize("case", MECHANISMS)
def test_mechanisms_in_statics(case):
    parts, words = MECHANISMS[case]
    scene = ub.Scene([ARM], **parts)
    if not words:
        ub.simulate(scene, ub.Static(), t=(0, 1), dt=1.0)
        return
    with pytest.raises(ub.ModelError, match=re.escape(words)):
        ub.simulate(scene, ub.Static(), t=(0, 1), dt=1.0)


def test_modes_of_pendulums_that_may_spin():
    """[closed] ω² = m g l / J about a ball joint; g / l of a load on a rope, which spins."""
    weight, g = [ub.Gravity((0, 0, -9.81))], ub.ground(0, 0, 0)
    top = ub.Body((0, 0, -1), mass=2.0, inertia=(0.3, 0.2, 0.1))
    swing = ub.Scene(bodies=[top], joints=[ub.Spherical(g, top.at(0, 0, 0))], loads=weight)
    expected = np.sqrt([0.0, 2 * 9.81 / 2.3, 2 * 9.81 / 2.2])
    assert ub.modes(swing, 3).omega == pytest.approx(expected, rel=1e-9)
    hung = ub.Scene(bodies=[top], joints=[ub.Link(g, top.middle)], loads=weight)
    assert ub.modes(hung, 5).omega == pytest.approx([0.0] * 3 + [9.81**0.5] * 2, rel=1e-9)
    off = ub.Body((0.6, 0, -0.8), mass=2.0, inertia=(0.3, 0.2, 0.1))
    with pytest.warns(ub.ModelWarning, match="loads have no effect"):
        ub.modes(ub.Scene(bodies=[off], joints=[ub.Spherical(g, off.at(0, 0, 0))], loads=weight), 1)


# -- paths -----------------------------------------------------------------------------------------


def test_planar_paths_in_a_turned_plane():
    """Limit points of half a shallow arch that snaps through; states at equal load factors."""
    half = ub.Beam((0, 0), (2, 0.3), ub.Section(EA=1e4, GA=1e4, EI=3.0), cells=8)
    crown = ub.Prismatic(ub.ground(2, 0), half.end, axis=(0, 1))
    down = ub.PointLoad(half.end, force=(0, -10.0), amplitude=lambda t: t)
    joints = [ub.Revolute(ub.ground(0, 0), half.start), crown]
    arch = ub.Scene([half], joints=joints, loads=[down])
    both, copy = [], InSpace(arch, SKEW)
    for scene in (arch, copy.scene):
        path = ub.follow(scene, ub.ArcLength(0.02), steps=40)
        at_load = ub.follow(scene, ub.LoadControl(0.1), steps=3)
        tip = at_load.position(scene.beams[0].end)
        both.append(([x.factor for x in path.critical if x.kind == "limit"], tip))
    (limits, tips), (in_space, turned) = both
    assert len(limits) == 2
    assert np.abs(np.array(in_space) / limits - 1).max() < 1e-6
    assert np.abs(copy.back(turned) - np.pad(tips, ((0, 0), (0, 1)))).max() < 1e-8


def right_angle(cells, factor=1.0):
    """Frame of a strip of 30 x 0.6 mm, 240 mm legs, under a force in its plane (N, mm)."""
    E, G, w, h = 71240.0, 71240.0 / 2.62, 0.6, 30.0
    strip = ub.Section(
        EA=E * w * h, GA=G * w * h / 1.2, GA3=G * w * h / 1.2, EI=E * w * h**3 / 12,
        EI2=E * h * w**3 / 12, GJ=G * h * w**3 / 3,
    )  # fmt: skip
    leg = ub.Beam((0, 0, 0), (240, 0, 0), strip, cells=cells, up=(0, 1, 0))
    arm = ub.Beam((240, 0, 0), (240, -240, 0), strip, cells=cells, up=(1, 0, 0))
    push = ub.PointLoad(arm.end, force=(factor, 0, 0), amplitude=lambda t: t)
    return ub.Scene(
        [leg, arm], joints=[ub.Rigid(leg.end, arm.start)], supports=[ub.Clamped(leg.start)],
        loads=[push],
    )  # fmt: skip


def test_lateral_buckling_of_a_right_angle_frame():
    """Path, buckling analysis and the published 1.088 N agree; the branch leaves the plane.

    Simo and Vu-Quoc, Computer Methods in Applied Mechanics and Engineering 58 (1986).
    """
    scene = right_angle(20)
    path = ub.follow(scene, ub.LoadControl(0.25), steps=5)
    (point,) = path.critical
    assert point.kind == "bifurcation"
    assert abs(point.factor / 1.088 - 1) < 5e-4
    factors = ub.buckling(scene, 2).factors
    assert abs(factors.max() / point.factor - 1) < 1e-6
    tip, out = scene.beams[1].end, []
    for sign in (1, -1):
        branch = ub.follow(scene, ub.ArcLength(0.05), start=point.branch(sign), steps=6)
        assert (np.diff(branch.factor) > 0).all()
        out.append(branch.displacement(tip)[:, 2])
    assert np.abs(out[0] + out[1]).max() < 1e-6 * np.abs(out[0]).max()
    assert abs(out[0][-1]) > 50.0


def test_paths_continue():
    """A path in two parts is the whole path; displacement control in space."""
    scene = right_angle(4)
    tip = scene.beams[1].end
    scene = ub.Scene(
        scene.beams, joints=scene.joints, supports=scene.supports,
        loads=[*scene.loads, ub.PointLoad(tip, force=(0, 0, 0.02), amplitude=lambda t: t)],
    )  # fmt: skip
    whole, first = (
        ub.follow(scene, ub.DisplacementControl(tip, "w", 10.0, end=end), steps=20)
        for end in (60.0, 30.0)
    )
    control = ub.DisplacementControl(tip, "w", 10.0, end=60.0)
    for start in (first, (whole, 4)):
        second = ub.follow(scene, control, steps=20, start=start)
        assert abs(second.displacement(tip)[-1, 2] - 60.0) < 1e-4
        assert abs(second.factor[-1] / whole.factor[-1] - 1) < 1e-6
    for component in ("psi", "x"):
        with pytest.raises(ub.ArgumentError, match="must be one of u, v, w"):
            ub.DisplacementControl(tip, component, 0.1)


def test_a_ring_turned_twice_by_180_degrees():
    """It has a third of its radius (Goto et al. 1992), and needs no moments there."""
    R, E, b, h, ends = 20.0, 2.1e7, 1 / 3, 1.0, []
    strip = ub.Section(
        EA=E * b * h, GA=E * b * h / 2, GA3=E * b * h / 2, GJ=9.753e-3 * 8.0769e6,
        EI2=E * h * b**3 / 12, EI=E * b * h**3 / 12,
    )  # fmt: skip
    axis = (1.0, 0, 0)
    for cells in (20, 40):
        half = ub.Beam.along(
            lambda s: (R * np.cos(np.pi * s), R * np.sin(np.pi * s), 0.0), strip, cells=cells
        )
        places = (ub.ground(R, 0, 0), half.start), (ub.ground(-R, 0, 0), half.end)
        turns = [
            ub.Turn(*pair, ub.PrescribedMotion(lambda t, k=sign * np.pi: k * t), axis=axis)
            for pair, sign in zip(places, (1, -1), strict=True)
        ]
        joints = [ub.Revolute(*places[0], axis=axis)]
        joints.append(ub.Prismatic(*places[1], axis=axis, turning=True))
        scene = ub.Scene([half], joints=joints, connectors=turns)
        path = ub.follow(scene, ub.LoadControl(1 / 60), steps=60)
        assert abs(path.factor[-1] - 1) < 1e-9
        ends.append(np.linalg.norm(np.subtract(*(path.position(x)[-1] for _, x in places))))
        torque = path.connector(turns[0]).force
        assert abs(torque[-1]) < 1e-6 * np.abs(torque).max()
    coarse = abs(ends[1] / (2 * R / 3) - 1)
    assert abs(extrapolated(ends) / (2 * R / 3) - 1) < 10 * coarse**2


# -- derivatives of runs ---------------------------------------------------------------------------


def growing(t):
    return t


def bent_arm(EI=500.0, force=30.0, length=4.0, arm=0.5):
    """Two beams, with a body that a spring pulls at an arm."""
    section = ub.Section(**STIFF | OTHER | {"EI": EI})
    first = ub.Beam((0, 0, 0), (length, 1, 0), section, cells=2)
    second = ub.Beam((length, 1, 0), (length, 1, 2), section, cells=1, up=(1, 0, 0))
    ball = ub.Body((length, 1, 2.5), mass=2.0, inertia=(0.3, 0.3, 0.4))
    pull = ub.Stretch(ball.at(length, 1 + arm, 2.5), ub.ground(2, 4, 4), ub.Spring(20.0))
    loads = [
        ub.PointLoad(
            second.end, force=(0, force, 0.5 * force), moment=(0, 2 * force, 0), amplitude=growing
        ),
        ub.Gravity((0, 0, -1.0), amplitude=growing),
    ]
    return ub.Scene(
        [first, second], bodies=[ball], connectors=[pull], supports=[ub.Clamped(first.start)],
        joints=[ub.Rigid(first.end, second.start), ub.Rigid(second.end, ball.at(length, 1, 2))],
        loads=loads,
    )  # fmt: skip


AT = {"EI": 500.0, "force": 30.0, "length": 4.0, "arm": 0.5}


@pytest.mark.parametrize("scheme", [ub.EnergyMomentum(), ub.Static()], ids=str)
def test_adjoint_of_runs(scheme):
    run = ub.differentiate(bent_arm, AT, scheme, t=(0, 1), dt=0.1, newton=EXACT)

    def height(s):
        return s.displacement(s.scene.bodies[0].middle)[:, 2]

    _, slopes = ub.gradient(bent_arm, AT, scheme, t=(0, 1), dt=0.1, newton=EXACT, of=height)
    direct = run.of(lambda s: height(s)[-1])
    assert np.abs(slopes - direct).max() < 1e-9 * np.abs(direct).max()
    with pytest.raises(ub.ArgumentError, match="rotations in space, of which there is no adjoint"):
        ub.gradient(
            bent_arm, AT, scheme, t=(0, 1), dt=0.1,
            of=lambda s: s.displacement(s.scene.bodies[0].middle)[:, 3],
        )  # fmt: skip


def test_derivatives_of_a_run_in_two_parts():
    scheme = ub.EnergyMomentum()
    whole = ub.differentiate(bent_arm, AT, scheme, t=(0, 1), dt=0.1, newton=EXACT)
    first = ub.differentiate(bent_arm, AT, scheme, t=(0, 0.5), dt=0.1, newton=EXACT)
    second = ub.differentiate(bent_arm, AT, scheme, t=(0.5, 1), dt=0.1, newton=EXACT, start=first)
    for quantity in (
        lambda s: s.displacement(s.scene.beams[1].end)[-1],
        lambda s: s.position(s.scene.connectors[0].a)[-1],
    ):
        a, b = whole.of(quantity), second.of(quantity)
        assert np.abs(a - b).max() < 1e-9 * np.abs(a).max()
