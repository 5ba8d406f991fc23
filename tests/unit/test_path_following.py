# SPDX-License-Identifier: MIT
"""Paths of static equilibria: controls, critical points, branches, what is refused, what fails."""

import itertools
import math
from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
import ufl
from helpers import raises
from scenes import clamped

import ufl_beam as ub
from ufl_beam.analysis.critical_points import Candidate
from ufl_beam.analysis.path_following import PathStepper
from ufl_beam.parallel import active_comm
from ufl_beam.plotting.positions import evenly

EA, WIDTH, HEIGHT = 1e6, 4.0, 1.0  # N, m, m: half a truss


def growing(t):
    return t


def truss(*, time=growing, moved=False):
    """Two bars from their pins up to the apex, which a load of 1 kN pushes down."""
    section = ub.Section(EA=EA, GA=EA, EI=1e9, depth=0.1)
    left = ub.Beam((-WIDTH, 0), (0, HEIGHT), section, cells=1, name="left")
    right = ub.Beam((0, HEIGHT), (WIDTH, 0), section, cells=1, name="right")
    push = ub.PrescribedDisplacement(left.end, v=lambda t: -t)
    scene = ub.Scene(
        [left, right],
        joints=[ub.Revolute(left.end, right.start)],
        supports=[ub.Pinned(left.start), ub.Pinned(right.end), *([push] if moved else [])],
        loads=[] if moved else [ub.PointLoad(left.end, force=(0, -1e3), amplitude=time)],
    )
    return left.end, scene


def force(v):
    """[closed] Load in kN at the displacement v: bars of N = EA (l - l0)/l0 that stay straight."""
    l0, height = math.hypot(WIDTH, HEIGHT), HEIGHT + v
    length = np.hypot(WIDTH, height)
    return -2 * EA * (length - l0) / l0 * height / length / 1e3


LIMIT = math.sqrt((math.hypot(WIDTH, HEIGHT) * WIDTH**2) ** (2 / 3) - WIDTH**2)
"""[closed] Height of the apex at both limit points: dP/dv = 0 where l³ = l0 b²; m."""


def down_to(place, v):
    return lambda now: now.displacement(place)[1] < v


@pytest.mark.parametrize("factor", [4.0, 20.0])
def test_a_two_bar_truss_snaps_through(factor):
    """[closed] The whole curve and both limit points: one cell a bar is exact.

    The solver's tolerance is 1e-10 of forces of 60 kN; a limit point is located to 1e-7 of a step.
    """
    apex, scene = truss()
    path = ub.follow(scene, ub.ArcLength(0.05, factor=factor), until=down_to(apex, -2.2 * HEIGHT))
    v = path.displacement(apex)[:, 1]
    np.testing.assert_allclose(path.factor, force(v), rtol=0, atol=1e-6 * force(-0.4))
    assert [point.kind for point in path.critical] == ["limit", "limit"]
    for point, height in zip(path.critical, (LIMIT, -LIMIT), strict=True):
        assert point.factor == pytest.approx(force(height - HEIGHT), rel=1e-9)
        assert point.factor == path.factor[point.n]
        assert v[point.n] == pytest.approx(height - HEIGHT, abs=1e-5)
        # What moves is the apex, down or up.
        dofs = path.numbering.node(apex)
        assert abs(point.mode[dofs[1]]) > 1e6 * abs(point.mode[dofs[0]])
    assert path.energy.worst < 0.01


def test_displacement_control_goes_through_limit_loads():
    """Steps are as long as asked for; [closed]."""
    apex, scene = truss()
    path = ub.follow(scene, ub.DisplacementControl(apex, "v", -0.125), steps=18)
    v = path.displacement(apex)[:, 1]
    kept = np.setdiff1d(np.arange(len(v)), [point.n for point in path.critical])
    steps = -np.diff(v[kept])
    assert len(path.critical) == 2
    assert np.isclose(steps[0], 0.125, rtol=1e-8)
    np.testing.assert_allclose(path.factor, force(v), rtol=0, atol=1e-6 * force(-0.4))


def test_load_control_ends_at_the_limit_load():
    """The error says where, and carries the path so far."""
    apex, scene = truss()
    with pytest.raises(ub.ConvergenceError, match="ArcLength") as failure:
        ub.follow(scene, ub.LoadControl(0.5))
    path = failure.value.solution
    assert path.factor[-1] == pytest.approx(force(LIMIT - HEIGHT), rel=0.01)
    np.testing.assert_allclose(path.factor, force(path.displacement(apex)[:, 1]), atol=1e-6)


def test_motion_that_grows():
    """A prescribed motion is followed as a load is; its reaction is the load."""
    apex, scene = truss(moved=True)
    path = ub.follow(scene, ub.ArcLength(0.1), until=lambda now: now.t > 2)
    np.testing.assert_allclose(path.displacement(apex)[:, 1], -path.factor, rtol=0, atol=1e-12)
    reaction = -path.reaction(scene.supports[2])[1:, 1] / 1e3
    np.testing.assert_allclose(reaction, force(-path.factor[1:]), rtol=0, atol=1e-5)


def test_steady_loads_are_borne_first():
    """A load that is there at once, at factor 0; then the other one grows."""
    apex, scene = truss()
    steady = ub.PointLoad(apex, force=(0, -2e3))
    scene = ub.Scene(
        scene.beams, joints=scene.joints, supports=scene.supports, loads=[*scene.loads, steady]
    )
    path = ub.follow(scene, ub.LoadControl(0.5), steps=2)
    v = path.displacement(apex)[:, 1]
    np.testing.assert_allclose(path.factor + 2, force(v), rtol=1e-7)


CANTILEVER = ub.Beam((0, 0), (4, 0), ub.Section.rectangle(b=0.1, h=0.2, E=210e9, nu=0.3, rho=7850))
"""A tip load of 1 kN turns it by 0.6 mrad."""

STEADY = {
    "line load": {"loads": [ub.LineLoad(CANTILEVER, force=(0, -1e4))]},
    "gravity": {"loads": [ub.Gravity()]},
    "follower load": {"loads": [ub.FollowerLoad(CANTILEVER.end, force=(0, 1e3))]},
    "rotating frame": {"loads": [ub.RotatingFrame(10.0)]},
    "potential": {"works": [ub.Potential("well", lambda q, axis: 1e3 * q[1] + 1e3 * q[1] ** 2)]},
    "virtual work": {"works": [ub.VirtualWork("wind", lambda q, w, axis: -1e3 * w[1])]},
    "support": {"supports": [ub.PrescribedDisplacement(CANTILEVER.at(0.5), v=0.01)]},
    "moving support": {
        "supports": [ub.PrescribedDisplacement(CANTILEVER.end, v=lambda t: 0.01 + 1e-3 * t)]
    },
}


@pytest.mark.parametrize("steady", STEADY)
def test_ledgers_begin_with_what_acts_at_the_factor_zero(steady):
    """Works by the trapezoidal rule: in error by a sixth of the square of turns, of 3 mrad.

    A run of statics that begins with the same state and ends with the same load books the same.
    """
    given = {"supports": [], "loads": [], **STEADY[steady]}
    given["supports"] = [ub.Clamped(CANTILEVER.start), *given["supports"]]
    tip = ub.PointLoad(CANTILEVER.at(0.75), force=(0, -1e3), amplitude=growing)
    scene = ub.Scene([CANTILEVER], **{**given, "loads": [*given["loads"], tip]})
    path = ub.follow(scene, ub.LoadControl(0.5), steps=2)
    assert path.energy.worst < 2e-6
    assert path.imbalance_message == ""
    assert max(abs(path.energy.total[0]), *(abs(x[0]) for x in path.energy.supplied.values())) > 0.5
    first = ub.follow(scene, ub.LoadControl(0.5), steps=1)
    rest = ub.follow(scene, ub.LoadControl(0.5), steps=1, start=first)
    run = ub.simulate(scene, ub.Static(), t=(0.5, 1), dt=0.5, start=first)
    for other in (rest, run):
        assert other.energy.worst < 2e-6
        for name, work in path.energy.supplied.items():
            since = other.energy[name][-1] + path.energy[name][1]
            assert since == pytest.approx(work[-1], rel=1e-6, abs=1e-9)
        for name, energy in path.energy.state.items():
            assert other.energy[name][-1] == pytest.approx(energy[-1], rel=1e-9)


def test_backwards_and_on_from_a_path():
    """A negative step begins with a falling factor; a path goes on where another one ended."""
    apex, scene = truss()
    path = ub.follow(scene, ub.ArcLength(-0.05), steps=4)
    assert (np.diff(path.factor) < 0).all()
    on = ub.follow(scene, ub.LoadControl(0.25), start=path, steps=2)
    assert on.factor[0] == path.factor[-1]
    np.testing.assert_allclose(on.factor, force(on.displacement(apex)[:, 1]), atol=1e-6)


def arch():
    """A semicircle on pins, which sways before it snaps through."""
    section = ub.Section(EA=1e8, GA=1e8, EI=1e6)
    beam = ub.Beam.arc((0, 0), 100.0, (math.pi, 0), section, cells=16)
    load = ub.PointLoad(beam.at(0.5), force=(0, -1e3), amplitude=growing)
    supports = [ub.Pinned(beam.start), ub.Pinned(beam.end)]
    return beam.at(0.5), ub.Scene([beam], supports=supports, loads=[load])


def test_sway_branches_off():
    """The arch goes on straight down; both branches sway, mirrored, under loads that are lower."""
    crown, scene = arch()
    path = ub.follow(scene, ub.ArcLength(0.04), until=down_to(crown, -40.0))
    (point,) = path.critical
    assert point.kind == "bifurcation"
    assert np.abs(path.displacement(crown)[:, 0]).max() < 1e-3
    ways = [
        ub.follow(scene, ub.ArcLength(0.04), start=point.branch(sign), steps=5) for sign in (1, -1)
    ]
    one, other = (way.displacement(crown) for way in ways)
    assert abs(one[-1, 0]) > 5
    # The point is located to 1e-7 of a step, and as far off the axis may its state be.
    np.testing.assert_allclose(one * (-1, 1, -1), other, rtol=0, atol=1e-3)
    at = np.interp(-one[-1, 1], -path.displacement(crown)[:, 1], path.factor)
    assert ways[0].factor[-1] < at


def test_a_limit_point_has_no_branch():
    _, scene = truss()
    path = ub.follow(scene, ub.ArcLength(0.1), until=lambda now: now.solution.critical)
    with pytest.raises(ub.ArgumentError, match="limit point"):
        path.critical[0].branch()


def test_recorders_write_paths(tmp_path):
    """Rows of a history are the states of the path, critical points among them."""
    apex, scene = truss()
    file = tmp_path / "path.csv" if active_comm().size == 1 else None
    record = [ub.History(file, [apex])] if file else []
    path = ub.follow(scene, ub.ArcLength(0.1), steps=12, record=record)
    assert len(path.factor) == 13
    if file:
        rows = np.loadtxt(file, delimiter=",", skiprows=1)
        np.testing.assert_array_equal(rows[:, 0], path.factor)


# -- joints whose forces hold what would float --------------------------------------------------


def lee_frame(*, multipliers, angle=0.0, length=1.0, force=1.0):
    """Lee's frame with 10 cells a beam; turned, and in other units of length and force."""
    EA, EI, nu = 43.2e6, 1440.0, 0.3
    section = ub.Section(EA=EA * force, GA=EA / (2 * (1 + nu)) * force, EI=EI * force * length**2)
    c, s = math.cos(angle), math.sin(angle)

    def at(x, y):
        return length * (c * x - s * y), length * (s * x + c * y)

    foot, corner, end = at(0, 0), at(0, 1.2), at(1.2, 1.2)
    column = ub.Beam(foot, corner, section, cells=10, name="column")
    girder = ub.Beam(corner, end, section, cells=10, name="girder")
    place, size = girder.at(0.2), 1e3 * force
    load = ub.PointLoad(place, force=(size * s, -size * c), amplitude=growing)
    stiff = ub.Rigid(column.end, girder.start, multipliers=multipliers)
    if not multipliers:
        supports = [ub.Pinned(column.start), ub.Pinned(girder.end)]
        return ub.Scene([column, girder], joints=[stiff], supports=supports, loads=[load])
    pins = [
        ub.Revolute(ub.ground(*where), place, multipliers=True)
        for where, place in ((foot, column.start), (end, girder.end))
    ]
    return ub.Scene([column, girder], joints=[stiff, *pins], loads=[load])


LEE = (18.7923, -9.86194)
"""Limit loads with 10 cells a beam and no joint that measures; the digits that are printed."""


@pytest.mark.parametrize("multipliers", [False, True])
@pytest.mark.parametrize(
    "other", [{}, {"length": 1e3, "force": 1e-6}, {"length": 1e-6, "force": 1e9}, {"angle": 0.7}]
)
def test_limit_points_do_not_depend_on_joints_axes_and_units(multipliers, other):
    """No beam is held by anything but forces of joints where they are multipliers.

    A limit load is located to 1e-7 of a step, where it is flat; half a unit of the last digit.
    """
    scene = lee_frame(multipliers=multipliers, **other)
    two = ub.follow(
        scene, ub.ArcLength(0.08, factor=10), until=lambda now: len(now.solution.critical) == 2
    ).critical
    assert [point.kind for point in two] == ["limit", "limit"]
    np.testing.assert_allclose([point.factor for point in two], LEE, rtol=0, atol=6e-5)


def frame(corner):
    """A right angle whose corner is made by a function of both ends."""
    section = ub.Section(EA=1e6, GA=1e6, EI=1e3)
    column = ub.Beam((0, 0), (0, 3), section, cells=4)
    girder = ub.Beam((0, 3), (3, 3), section, cells=4)
    load = ub.PointLoad(column.end, force=(10.0, -5.0), amplitude=growing)
    return ub.Scene(
        [column, girder],
        joints=[corner(column.end, girder.start)],
        supports=[ub.Clamped(column.start), ub.Clamped(girder.end)],
        loads=[load],
    )


@pytest.mark.parametrize("free", ["N", "V", "M", "NM", "VM"])
def test_releases_make_no_critical_points(free):
    """An elastic frame under small loads has no critical point; Newton's method takes few steps."""
    scene = frame(lambda a, b: ub.Release(a, b, free=free))
    path = ub.follow(scene, ub.LoadControl(1.0), steps=10)
    assert path.factor[-1] == pytest.approx(10, rel=1e-12)
    assert path.critical == []
    assert path.iterations <= 40


def test_a_cantilever_held_by_measured_forces():
    """It has no critical points, and takes as many iterations as one that is clamped, 2.0 a step.

    With noise for a direction most steps fail.
    """
    section = ub.Section(EA=1e6, GA=1e6, EI=1e3)
    beam = ub.Beam((0, 0), (0, 3), section, cells=4)
    load = ub.PointLoad(beam.end, force=(10.0, 0), amplitude=growing)
    clamp = ub.Rigid(ub.ground(0, 0), beam.start, multipliers=True)
    path = ub.follow(ub.Scene([beam], joints=[clamp], loads=[load]), ub.LoadControl(0.5), steps=20)
    assert path.factor[-1] == pytest.approx(10, rel=1e-12)
    assert path.critical == []
    assert path.iterations <= 3 * 20


def test_springs_of_all_slopes():
    """[closed] A column on springs of 5, -1 and 0 N m at its foot leans at P l = 4 N m.

    The column itself bends by P l²/3EI = 1.3e-6 of that; located to 1e-7 of a step.
    """
    section = ub.Section(EA=1e7, GA=1e7, EI=1e6)
    column = ub.Beam((0, 0), (0, 1), section, cells=4)
    foot = ub.ground(0, 0)
    springs = [
        ub.Turn(foot, column.start, ub.ForceLaw(lambda angle, rate, k=k: k * angle))
        for k in (5.0, -1.0, 0.0)
    ]
    scene = ub.Scene(
        [column],
        joints=[ub.Revolute(foot, column.start, multipliers=True)],
        connectors=springs,
        loads=[ub.PointLoad(column.end, force=(0, -1.0), amplitude=growing)],
    )
    path = ub.follow(scene, ub.LoadControl(0.7), steps=10)
    (point,) = path.critical
    assert point.kind == "bifurcation"
    assert point.factor == pytest.approx(4.0, rel=3e-6)


# -- springs that soften ------------------------------------------------------------------------


def softening_row(number, stronger=0.0):
    """Columns on softening springs, linked at their tops; limit moments 300 kN m and more."""
    EI, M, G = 63e6, 300e3, 40e3  # N m², N m, J
    section = ub.Section(EA=40 * EI, GA=8 * EI, EI=EI)
    columns = [ub.Beam((3.0 * i, 0), (3.0 * i, 3), section, cells=4) for i in range(number)]
    feet = [ub.ground(*column.ends[0]) for column in columns]
    springs = [
        ub.Spring(1e5 * EI, softening=ub.Softening(M * (1 + stronger * i), G))
        for i in range(number)
    ]
    scene = ub.Scene(
        columns,
        joints=[
            *(ub.Revolute(foot, c.start) for foot, c in zip(feet, columns, strict=True)),
            *(ub.Link(a.end, b.end) for a, b in itertools.pairwise(columns)),
        ],
        connectors=[
            ub.Turn(foot, c.start, spring)
            for foot, c, spring in zip(feet, columns, springs, strict=True)
        ],
        loads=[ub.PointLoad(columns[0].end, force=(1e3, 0), amplitude=growing)],
    )
    return columns[0].end, scene


@pytest.mark.parametrize(("number", "stronger"), [(1, 0.0), (2, 0.0), (2, 0.02), (3, 0.0)])
@pytest.mark.parametrize("control", ["displacement", "arc length"])
def test_springs_that_soften_together(number, stronger, control):
    """The peak is one limit point, however many springs open in it.

    [closed] Springs that are alike open at M/3 m each; the slope of the columns, 0.005 rad, adds
    1e-5 of it.  Others open one after the other, the stronger ones later.
    """
    top, scene = softening_row(number, stronger)
    along = {
        "displacement": ub.DisplacementControl(top, "u", 0.02),
        "arc length": ub.ArcLength(5e-3, factor=2e4),
    }[control]
    path = ub.follow(scene, along, until=lambda now: now.displacement(top)[0] > 0.15)
    assert path.displacement(top)[-1, 0] > 0.15
    (peak,) = path.critical
    assert peak.kind == "limit"
    assert peak.factor == path.factor.max()
    assert path.factor[-1] < 0.9 * peak.factor
    lowest, highest = (100.0 * sum(1 + k * stronger * i for i in range(number)) for k in (0, 1))
    assert lowest <= peak.factor <= highest * (1 + 3e-5)


def test_displacement_control_in_any_unit_of_the_load():
    """Whether the load is 1 N or 1 kN, what turns at a limit point is the load."""
    for unit in (1e3, 1.0, 1e-3):
        apex, scene = truss()
        load = ub.PointLoad(apex, force=(0, -unit), amplitude=growing)
        scene = ub.Scene(scene.beams, joints=scene.joints, supports=scene.supports, loads=[load])
        path = ub.follow(scene, ub.DisplacementControl(apex, "v", -0.125), steps=18)
        assert [point.kind for point in path.critical] == ["limit", "limit"]
        factors = [point.factor * unit / 1e3 for point in path.critical]
        # Located to 1e-7 of a step, where the load is flat.
        np.testing.assert_allclose(factors, [force(s * LIMIT - HEIGHT) for s in (1, -1)], rtol=1e-9)


def test_displacement_control_ends_where_it_is_told_to():
    """Limit points within the path shift its steps, but not its end; round-off is left."""
    apex, scene = truss()
    control = ub.DisplacementControl(apex, "v", -0.125, end=-1.9)
    path = ub.follow(scene, control)
    v = path.displacement(apex)[:, 1]
    assert len(path.critical) == 2
    assert v[-1] == pytest.approx(-1.9, rel=1e-12)
    assert np.diff(v).min() >= -0.125 * (1 + 1e-9)
    further = ub.follow(scene, replace(control, end=-2.0), start=path)
    assert further.displacement(apex)[-1, 1] == pytest.approx(-2.0, rel=1e-12)
    with raises("end = -1.9 is behind v of", "= -2 for step = -0.125"):
        ub.follow(scene, control, start=further)


def test_load_control_says_what_turns():
    """At the opening of a spring the load factor turns, and nothing else is said of it."""
    _, scene = softening_row(1)
    with pytest.raises(ub.ConvergenceError, match="the load factor turns back") as failure:
        ub.follow(scene, ub.LoadControl(7.0))
    text = str(failure.value)
    assert "no equilibrium after load factor 100.00" in text
    assert "a change of the load factor by" in text
    assert " s," not in text
    assert "dt =" not in text


def test_a_held_displacement_controls_no_path():
    _, scene = truss()
    foot = scene["left"].start
    with pytest.raises(ub.ConvergenceError, match=r"v of left.start \(-4, 0\) is held, or does"):
        ub.follow(scene, ub.DisplacementControl(foot, "v", 0.1))


def test_a_stop_under_a_falling_load():
    """The load factor turns sharply there: the path goes on if displacements weigh enough."""
    apex, scene = truss()
    stop = ub.Slide(ub.ground(0, HEIGHT), apex, ub.Stop(1e6, low=-1.1), axis=(0, 1))
    stopped = replace(scene, connectors=[stop])

    def end(now):
        return now.displacement(apex)[1] < -1.11

    with pytest.raises(ub.ConvergenceError, match="with a larger factor also") as failure:
        ub.follow(stopped, ub.ArcLength(0.05, factor=10), until=end)
    assert "ub.follow" not in str(failure.value)  # the run is such a path already
    path = ub.follow(stopped, ub.ArcLength(0.05, factor=1e4), until=end)
    assert path.displacement(apex)[-1, 1] < -1.11


def test_the_snap_back_of_a_second_hinge_is_told_apart_from_a_softening_that_is_gentle():
    """[closed] The tops turn back if the hinge softens faster than a column resists, 3 EI/h.

    The first hinge hardly softens, so that the second one opens while the first one flows.
    """
    EI, M = 1e5, 100.0  # N m², N m; columns of 1 m
    critical = M**2 / (6 * EI)  # J
    section = ub.Section(EA=1e8, GA=1e8, EI=EI)

    def path(energy):
        laws = ub.LinearSoftening(M / 2, 1e3), ub.LinearSoftening(M, energy)
        columns = [
            ub.Beam((x, 0), (x, 1), section, cells=1, hinges={0.0: law})
            for x, law in enumerate(laws)
        ]
        top, other = (column.end for column in columns)
        feet = [ub.Clamped(column.start) for column in columns]
        push = ub.PointLoad(top, force=(1, 0), amplitude=growing)
        scene = ub.Scene(columns, joints=[ub.Link(top, other)], supports=feet, loads=[push])
        return ub.follow(scene, ub.DisplacementControl(top, "u", 2e-5), steps=60)

    gentle = path(2 * critical).factor
    assert gentle.max() == pytest.approx(1.5 * M, rel=1e-3)  # (M/2 + M)/h, less the softening
    assert gentle[-1] < M
    begins = r"no equilibrium after [^:]*: u of beam.end \(0, 1\) turns back, where"
    with pytest.raises(ub.ConvergenceError, match=begins) as failure:
        path(critical / 2)
    assert failure.value.time == pytest.approx(1.5 * M, rel=1e-3)
    assert "perhaps" not in str(failure.value)


# -- words and pictures -------------------------------------------------------------------------


def test_load_factors_are_not_called_times(tmp_path):
    """In what is printed, in events, tables and pictures."""
    top, scene = softening_row(1)
    events = ub.Events()
    table = tmp_path / "path.csv"
    record = [events, ub.History(table, [top])] if active_comm().size == 1 else [events]
    path = ub.follow(scene, ub.ArcLength(5e-3, factor=2e4), steps=6, record=record)
    assert "load factor 0 to" in str(path)
    assert "t =" not in str(path)
    if active_comm().size == 1:
        assert table.read_text().startswith("load factor [-],")
    for figure in (ub.plot(path, "history", top), ub.plot(path, "energy"), ub.plot(path)):
        texts = [a.get_xlabel() + a.get_title(loc="left") for a in figure.axes]
        assert any("load factor" in text or "path length" in text for text in texts)
        assert not any("time" in text or "t =" in text for text in texts)


@pytest.mark.parametrize("law", [ub.Softening, ub.LinearSoftening])
def test_events_of_a_path(law):
    """A hinge opens at the load factor 1; the event is that of the end of the step, a bit below."""
    section = ub.Section(EA=1e6, GA=1e6, EI=1e3)
    beam = ub.Beam((0, 0), (1, 0), section, cells=4, hinges={0.0: law(10.0, 5.0)})
    load = ub.PointLoad(beam.end, force=(0, 10.0), amplitude=growing)
    scene = clamped(beam, loads=[load])
    events = ub.Events()
    ub.follow(scene, ub.DissipationControl(0.5), steps=30, record=events)
    assert events.found
    assert str(events.found[0]).startswith("load factor ")
    assert 0.9 < events.found[0].time <= 1.0


def test_shapes_of_a_path_are_spaced_along_it():
    """Of 8 shapes of a snap-through, under loads that come again, none is near to another.

    Apart by a seventh of the path, to half a step on either side.
    """
    apex, scene = truss()
    path = ub.follow(scene, ub.ArcLength(0.05, factor=4.0), until=down_to(apex, -2.2 * HEIGHT))
    figure = ub.plot(path, "shapes")
    (bar,) = (axes for axes in figure.axes if "load factor" in axes.get_ylabel())
    # Colours are along the path, because load factors come again; the numbers are load factors
    assert bar.get_ylim() == pytest.approx((path.progress[0], path.progress[-1]))
    write = bar.yaxis.get_major_formatter()
    written = [float(write(at).replace("−", "-")) for at in path.progress]
    np.testing.assert_allclose(written, path.factor, rtol=5e-3, atol=1e-12)
    axes = figure.axes[0]
    heights = sorted(
        {
            round(float(np.nanmax(line.get_ydata())), 6)
            for line in axes.lines
            if len(line.get_xdata()) == 5 and line.get_linewidth() > 2  # both beams, NaN between
        }
    )
    v = path.displacement(apex)[evenly(path.progress, 8), 1]
    assert len(heights) >= 4
    steps = -np.diff(v)
    whole = -path.displacement(apex)[-1, 1]
    largest = np.abs(np.diff(path.displacement(apex)[:, 1])).max()
    assert np.abs(steps - whole / 7).max() <= largest * (1 + 1e-9)


# -- what is refused ---------------------------------------------------------------------------


def test_controls_refuse_bad_input():
    apex, _ = truss()
    cases = [
        (lambda: ub.ArcLength(0.0), "leads nowhere"),
        (lambda: ub.ArcLength(0.1, factor=-1.0), "must be positive"),
        (lambda: ub.LoadControl(0.0), "leads nowhere"),
        (lambda: ub.DisplacementControl(apex, "w", 0.1), "must be one of u, v, psi"),
        (lambda: ub.DisplacementControl(apex, "v", 0), "leads nowhere"),
        (lambda: ub.DisplacementControl("apex", "v", 0.1), "is not a Place"),
        (lambda: ub.DissipationControl(-1.0), "must be positive"),
        (lambda: ub.DissipationControl(1.0, ub.LoadControl(1.0)), "is not a ArcLength"),
    ]
    for call, message in cases:
        with pytest.raises(ub.ArgumentError, match=message):
            call()


def test_paths_refuse_bad_input():
    _, scene = truss()
    other, _ = truss()
    _, steady = truss(time=lambda t: 1.0)
    cases = [
        (lambda: ub.follow(scene, ub.DisplacementControl(other, "v", 0.1)), "is not in the scene"),
        (lambda: ub.follow(scene, "arc"), "must be ArcLength"),
        (lambda: ub.follow(scene, ub.ArcLength), "must be ArcLength"),
        (lambda: ub.follow(scene, ub.LoadControl(1.0), steps=0), "at least 1"),
        (lambda: ub.follow(scene, ub.LoadControl(1.0), start=3), "is not a Solution or Branch"),
        (lambda: ub.follow(steady, ub.LoadControl(1.0)), "no load and no motion depends on time"),
    ]
    for call, message in cases:
        with pytest.raises(ub.ArgumentError, match=message):
            call()


def test_controllers_need_time():
    apex, scene = truss()
    turn = ub.Turn(apex, ub.ground(0, 0), ub.Controller(lambda now: 0.0))
    scene = ub.Scene(
        scene.beams, joints=scene.joints, supports=scene.supports, loads=scene.loads,
        connectors=[turn],
    )  # fmt: skip
    with pytest.raises(ub.ArgumentError, match="a path has none"):
        ub.follow(scene, ub.LoadControl(1.0))


def test_what_needs_steps_in_time_is_refused():
    """Dry friction and works with velocities; dampers have no effect, as paths are quasi-static."""
    left, scene = truss()
    parts = {"beams": scene.beams, "joints": scene.joints, "supports": scene.supports}
    has_friction = ub.Slide(ub.ground(0, 0), left, ub.Coulomb(5.0), axis=(0, 1))
    drag = ub.VirtualWork("drag", lambda v, w, axis: -ufl.dot(v, w))
    creep = ub.VirtualWork("creep", lambda q, w, dt, axis: -ufl.dot(q, w) * dt)
    for more, said in (
        (
            {"connectors": [has_friction]},
            r"Slide.*dry friction sticks or slides .* a path has none",
        ),
        ({"works": [drag]}, r"'drag'.*depends on the velocity v, and a path has no time; leave v"),
        ({"works": [creep]}, r"'creep'.*depends on the step length dt, and .*; leave dt out"),
    ):
        with pytest.raises(ub.ArgumentError, match=said):
            ub.follow(ub.Scene(**parts, loads=scene.loads, **more), ub.LoadControl(0.1))
    damper = ub.Slide(ub.ground(0, 0), left, ub.Damper(1e5), axis=(0, 1))
    damped = ub.Scene(**parts, loads=scene.loads, connectors=[damper])
    one, other = (ub.follow(s, ub.LoadControl(0.1), steps=3) for s in (scene, damped))
    np.testing.assert_allclose(
        one.displacement(left), other.displacement(left), rtol=1e-9, atol=1e-12
    )


def test_loads_that_stop_growing():
    """Beyond the end of a ramp there is no direction to go in; what was reached is kept."""
    _, scene = truss(time=ub.ramp(1.0))
    with pytest.raises(ub.ConvergenceError, match="nothing moves with the load factor") as failure:
        ub.follow(scene, ub.LoadControl(0.4))
    assert failure.value.solution.factor[-1] > 0.9


# -- steps that leap to another branch ------------------------------------------------------------


class Turns(PathStepper):
    """A path of one unknown whose load factor turns at 0.4, where it may leap to another branch."""

    def __init__(self, leap):
        self.corrector = SimpleNamespace(
            start=np.zeros(2), direction=np.ones(2), length=lambda way: math.hypot(*way)
        )
        self._leap = leap

    def _seek(self, part):
        beyond = part > 0.4
        q, way = np.array([part + self._leap * beyond]), np.array([1.0, 0.4 - part])
        stiffness = SimpleNamespace(negative=0, symmetric=True)
        trial = SimpleNamespace(q1=q, step=SimpleNamespace(t1=0.0))
        return Candidate(trial, stiffness, way, slope=abs(way[-1]))


@pytest.mark.parametrize("leap", [0.0, 0.5])
def test_a_leap_is_no_critical_point(leap):
    """From the last state before it, steps become shorter."""
    path = Turns(leap)
    before = path._seek(0.0)
    found, reached = path._locate(before, path._seek(1.0), 1.0)
    assert reached == pytest.approx(0.4, abs=2e-7)
    assert found.passed(before) == (leap == 0)
    assert leap == 0 or path._fraction == (1.0 - reached) / 2


def test_progress_sums_root_mean_squares_of_displacements():
    section = ub.Section(EA=4e9, GA=1e9, EI=1.4e7, rhoA=157.0)
    beam = ub.Beam((0, 0), (2, 0), section, cells=2)
    push = ub.PointLoad(beam.end, force=(0, -1e6), amplitude=lambda t: t)
    scene = ub.Scene([beam], supports=[ub.Clamped(beam.start)], loads=[push])
    path = ub.follow(scene, ub.LoadControl(0.5), steps=4)
    moved = np.stack([path.displacement(beam.at(s))[:, :2] for s in (0.0, 0.5, 1.0)])
    steps = np.sqrt(np.mean(np.sum(np.diff(moved, axis=1) ** 2, axis=2), axis=0))
    assert path.progress == pytest.approx(np.append(0.0, np.cumsum(steps)))
