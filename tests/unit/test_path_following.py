# SPDX-License-Identifier: MIT
"""Paths of static equilibria: controls, critical points, what is refused, what fails."""

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
from ufl_beam.plotting.positions import evenly

EA, WIDTH, HEIGHT = 1e6, 4.0, 1.0  # N, m, m: half a truss


def growing(t):
    return t


def truss(*, time=growing, load=1e3):
    """Two bars from their pins up to the apex, which a load pushes down."""
    section = ub.Section(EA=EA, GA=EA, EI=1e9, depth=0.1)
    left = ub.Beam((-WIDTH, 0), (0, HEIGHT), section, cells=1, name="left")
    right = ub.Beam((0, HEIGHT), (WIDTH, 0), section, cells=1, name="right")
    return left.end, ub.Scene(
        [left, right],
        joints=[ub.Revolute(left.end, right.start)],
        supports=[ub.Pinned(left.start), ub.Pinned(right.end)],
        loads=[ub.PointLoad(left.end, force=(0, -load), amplitude=time)],
    )


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
        with raises("limit point"):
            point.branch()
    assert path.energy.worst < 0.01
    with raises("ArcLength", kind=ub.ConvergenceError) as failure:
        ub.follow(scene, ub.LoadControl(0.5))
    # The error carries the path so far
    assert failure.value.solution.factor[-1] == pytest.approx(force(LIMIT - HEIGHT), rel=0.01)


@pytest.mark.parametrize("unit", [1e3, 1e-3])
def test_displacement_control_goes_through_limit_loads(unit):
    """[closed] In any unit of the load.  Limit points shift steps, but not the end of the path."""
    apex, scene = truss(load=unit)
    control = ub.DisplacementControl(apex, "v", -0.125, end=-1.9)
    path = ub.follow(scene, control)
    v = path.displacement(apex)[:, 1]
    assert v[1] == pytest.approx(-0.125, rel=1e-8)
    assert np.diff(v).min() >= -0.125 * (1 + 1e-9)
    assert v[-1] == pytest.approx(-1.9, rel=1e-12)
    kN = path.factor * unit / 1e3
    np.testing.assert_allclose(kN, force(v), rtol=0, atol=1e-6 * force(-0.4))
    assert [point.kind for point in path.critical] == ["limit", "limit"]
    # Located to 1e-7 of a step, where the load is flat.
    limits = [kN[point.n] for point in path.critical]
    np.testing.assert_allclose(limits, [force(s * LIMIT - HEIGHT) for s in (1, -1)], rtol=1e-9)
    further = ub.follow(scene, replace(control, end=-2.0), start=path)
    assert further.displacement(apex)[-1, 1] == pytest.approx(-2.0, rel=1e-12)
    with raises("end = -1.9 is behind v of", "= -2 for step = -0.125"):
        ub.follow(scene, control, start=further)


def test_backwards_and_on_from_a_path():
    """A path begins with a falling factor, under a steady load, and goes on where it ended."""
    apex, scene = truss()
    steady = ub.PointLoad(apex, force=(0, -2e3))
    scene = replace(scene, loads=[*scene.loads, steady])
    path = ub.follow(scene, ub.ArcLength(-0.05), steps=4)
    assert (np.diff(path.factor) < 0).all()
    on = ub.follow(scene, ub.LoadControl(0.25), start=path, steps=2)
    assert on.factor[0] == path.factor[-1]
    for one in (path, on):
        v = one.displacement(apex)[:, 1]
        np.testing.assert_allclose(one.factor + 2, force(v), atol=1e-6)


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
    tip = ub.PointLoad(CANTILEVER.at(0.75), force=(0, -1e3), amplitude=growing)
    scene = clamped(CANTILEVER, loads=[tip])
    scene = replace(scene, **{x: [*getattr(scene, x), *y] for x, y in STEADY[steady].items()})
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


# -- joints whose forces hold what would float --------------------------------------------------


def lee_frame(cells=10, *, multipliers=False, angle=0.0, length=1.0, force=1.0):
    """Lee's frame; turned, and in other units of length and force."""
    EA, EI, nu = 43.2e6, 1440.0, 0.3
    section = ub.Section(EA=EA * force, GA=EA / (2 * (1 + nu)) * force, EI=EI * force * length**2)
    c, s = math.cos(angle), math.sin(angle)
    foot, corner, end = (
        (length * (c * x - s * y), length * (s * x + c * y))
        for x, y in ((0, 0), (0, 1.2), (1.2, 1.2))
    )
    column = ub.Beam(foot, corner, section, cells=cells, name="column")
    girder = ub.Beam(corner, end, section, cells=cells, name="girder")
    load = ub.PointLoad(girder.at(0.2), (1e3 * force * s, -1e3 * force * c), amplitude=growing)
    joints = [ub.Rigid(column.end, girder.start, multipliers=multipliers)]
    pinned = column.start, girder.end
    if multipliers:
        joints += [ub.Revolute(ub.ground(*p.point), p, multipliers=True) for p in pinned]
    supports = [] if multipliers else [ub.Pinned(p) for p in pinned]
    return ub.Scene([column, girder], joints=joints, supports=supports, loads=[load])


def limit_loads(scene, step=0.08, **more):
    def until(now):
        return len(now.solution.critical) == 2

    two = ub.follow(scene, ub.ArcLength(step, factor=10), until=until, **more).critical
    assert [point.kind for point in two] == ["limit", "limit"]
    return np.array([point.factor for point in two])


@pytest.mark.parametrize(
    "other",
    [
        {}, {"multipliers": True}, {"length": 1e3, "force": 1e-6, "multipliers": True},
        {"length": 1e-6, "force": 1e9}, {"angle": 0.7, "multipliers": True},
    ],
)  # fmt: skip
def test_limit_points_do_not_depend_on_joints_axes_and_units(other):
    """With multipliers only forces of joints hold beams.  To half a unit of the last digits."""
    found = limit_loads(lee_frame(**other))
    np.testing.assert_allclose(found, (18.7923, -9.86194), rtol=0, atol=6e-5)


@pytest.mark.parametrize(("degree", "cells", "error"), [(3, 10, 1e-5), (1, 60, 1.4e-3)])
def test_limit_loads_of_the_lee_frame(degree, cells, error):
    """README.md: relative errors; the converged limit loads are those of demo_lee_frame.py."""
    found = limit_loads(lee_frame(cells), 0.05, mesh=ub.Mesh(degree=degree))
    assert (np.abs(found / (18.5466, -9.3961) - 1) < error).all()


@pytest.mark.parametrize("free", ["", "M", "NM", "VM"])
def test_forces_of_joints_make_no_critical_points(free):
    """In 2.0 iterations a step under small loads; with noise for a direction most steps fail."""
    section = ub.Section(EA=1e6, GA=1e6, EI=1e3)
    column = ub.Beam((0, 0), (0, 3), section, cells=4)
    girder = ub.Beam((0, 3), (3, 3), section, cells=4)
    load = ub.PointLoad(column.end, force=(10.0, -5.0), amplitude=growing)
    corner = ub.Release(column.end, girder.start, free=free) if free else None
    scene = ub.Scene(
        [column, girder],
        joints=[
            corner or ub.Rigid(column.end, girder.start),
            ub.Rigid(ub.ground(0, 0), column.start, multipliers=True),
        ],
        supports=[ub.Clamped(girder.end)],
        loads=[load],
    )
    path = ub.follow(scene, ub.LoadControl(1.0), steps=10)
    assert path.factor[-1] == pytest.approx(10, rel=1e-12)
    assert path.critical == []
    assert path.iterations <= 40


def test_springs_of_all_slopes():
    """[closed] A column on springs of 5, -1 and 0 N m at its foot leans at P l = 4 N m.

    The column itself bends by P l²/3EI = 1.3e-6 of that; located to 1e-7 of a step.
    """
    column = ub.Beam((0, 0), (0, 1), ub.Section(EA=1e7, GA=1e7, EI=1e6), cells=4)
    foot = ub.ground(0, 0)
    scene = ub.Scene(
        [column],
        joints=[ub.Revolute(foot, column.start, multipliers=True)],
        connectors=[
            ub.Turn(foot, column.start, ub.ForceLaw(lambda angle, rate, k=k: k * angle))
            for k in (5.0, -1.0, 0.0)
        ],
        loads=[ub.PointLoad(column.end, force=(0, -1.0), amplitude=growing)],
    )
    (point,) = ub.follow(scene, ub.LoadControl(0.7), steps=10).critical
    assert point.kind == "bifurcation"
    assert point.factor == pytest.approx(4.0, rel=3e-6)


# -- springs and hinges that soften -------------------------------------------------------------


def softening_row(number, stronger=0.0):
    """Columns on softening springs, linked at their tops; limit moments 300 kN m and more."""
    EI, M, G = 63e6, 300e3, 40e3  # N m², N m, J
    section = ub.Section(EA=40 * EI, GA=8 * EI, EI=EI)
    columns = [ub.Beam((3.0 * i, 0), (3.0 * i, 3), section, cells=4) for i in range(number)]
    joints = [ub.Link(a.end, b.end) for a, b in itertools.pairwise(columns)]
    springs = []
    for i, column in enumerate(columns):
        foot, law = ub.ground(3.0 * i, 0), ub.Softening(M * (1 + stronger * i), G)
        joints.append(ub.Revolute(foot, column.start))
        springs.append(ub.Turn(foot, column.start, ub.Spring(1e5 * EI, softening=law)))
    load = ub.PointLoad(columns[0].end, force=(1e3, 0), amplitude=growing)
    return columns[0].end, ub.Scene(columns, joints=joints, connectors=springs, loads=[load])


@pytest.mark.parametrize(("number", "stronger"), [(1, 0.0), (2, 0.02), (3, 0.0)])
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
    (peak,) = path.critical
    assert peak.kind == "limit"
    assert peak.factor == path.factor.max()
    assert path.factor[-1] < 0.9 * peak.factor
    lowest, highest = (100.0 * sum(1 + k * stronger * i for i in range(number)) for k in (0, 1))
    assert lowest <= peak.factor <= highest * (1 + 3e-5)


def test_load_factors_are_not_called_times(shared_path, on_first_rank):
    """In what is printed, in events, tables, pictures and errors."""
    top, scene = softening_row(1)
    events, table = ub.Events(), ub.History(shared_path / "path.csv", [top])
    path = ub.follow(scene, ub.ArcLength(5e-3, factor=2e4), steps=6, record=[events, table])
    assert "load factor 0 to" in str(path)
    assert str(events.found[0]).startswith("load factor ")
    assert "t =" not in str(path)
    header, *rows = on_first_rank((shared_path / "path.csv").read_text).splitlines()
    assert header.startswith("load factor [-],")
    assert [float(row.split(",")[0]) for row in rows] == list(path.factor)
    for figure in (ub.plot(path, "history", top), ub.plot(path, "energy"), ub.plot(path)):
        texts = [a.get_xlabel() + a.get_title(loc="left") for a in figure.axes]
        assert any("load factor" in text or "path length" in text for text in texts)
        assert not any("time" in text or "t =" in text for text in texts)
    words = "no equilibrium after load factor 100.00", "the load factor turns back"
    with raises(*words, kind=ub.ConvergenceError) as failure:
        ub.follow(scene, ub.LoadControl(7.0))
    text = str(failure.value)
    assert "a change of the load factor by" in text
    assert " s," not in text
    assert "dt =" not in text


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
    words = "no equilibrium after ", ": u of beam.end (0, 1) turns back, where"
    with raises(*words, kind=ub.ConvergenceError) as failure:
        path(critical / 2)
    assert failure.value.time == pytest.approx(1.5 * M, rel=1e-3)
    assert "perhaps" not in str(failure.value)


def test_a_stop_under_a_falling_load():
    """The load factor turns sharply there: the path goes on if displacements weigh enough."""
    apex, scene = truss()
    stop = ub.Slide(ub.ground(0, HEIGHT), apex, ub.Stop(1e6, low=-1.1), axis=(0, 1))
    stopped, end = replace(scene, connectors=[stop]), down_to(apex, -1.11)
    with raises("with a larger factor also", kind=ub.ConvergenceError) as failure:
        ub.follow(stopped, ub.ArcLength(0.05, factor=10), until=end)
    assert "ub.follow" not in str(failure.value)  # the run is such a path already
    path = ub.follow(stopped, ub.ArcLength(0.05, factor=1e4), until=end)
    assert path.displacement(apex)[-1, 1] < -1.11


# -- shapes along a path ------------------------------------------------------------------------


def test_progress_sums_root_mean_squares_of_displacements():
    beam = ub.Beam((0, 0), (2, 0), ub.Section(EA=4e9, GA=1e9, EI=1.4e7), cells=2)
    push = ub.PointLoad(beam.end, force=(0, -1e6), amplitude=growing)
    path = ub.follow(clamped(beam, loads=[push]), ub.LoadControl(0.5), steps=4)
    moved = np.stack([path.displacement(beam.at(s))[:, :2] for s in (0.0, 0.5, 1.0)])
    steps = np.sqrt(np.mean(np.sum(np.diff(moved, axis=1) ** 2, axis=2), axis=0))
    assert path.progress == pytest.approx(np.append(0.0, np.cumsum(steps)))


def test_shapes_of_a_path_are_spaced_along_it():
    """Of 8 shapes of a snap-through, under loads that come again, none is near to another.

    Apart by a seventh of the path, to half a step on either side.  Colours are along the path; the
    numbers beside them are load factors.
    """
    apex, scene = truss()
    path = ub.follow(scene, ub.ArcLength(0.05, factor=4.0), until=down_to(apex, -2.2 * HEIGHT))
    (bar,) = (x for x in ub.plot(path, "shapes").axes if "load factor" in x.get_ylabel())
    assert bar.get_ylim() == pytest.approx((path.progress[0], path.progress[-1]))
    write = bar.yaxis.get_major_formatter()
    written = [float(write(at).replace("−", "-")) for at in path.progress]
    np.testing.assert_allclose(written, path.factor, rtol=5e-3, atol=1e-12)
    v = path.displacement(apex)[:, 1]
    steps = -np.diff(v[evenly(path.progress, 8)])
    assert np.abs(steps + v[-1] / 7).max() <= np.abs(np.diff(v)).max() * (1 + 1e-9)


# -- what is refused ---------------------------------------------------------------------------


APEX, SCENE = truss()
LOAD = ub.LoadControl(1.0)


DRAG = ub.VirtualWork("drag", lambda v, w: -ufl.dot(v, w))
CREEP = ub.VirtualWork("creep", lambda q, w, dt: -ufl.dot(q, w) * dt)
FOOT, (_, STILL) = SCENE["left"].start, truss(time=lambda t: 1.0)


def acting(law):
    return replace(SCENE, connectors=[ub.Slide(ub.ground(0, 0), APEX, law, axis=(0, 1))])


@pytest.mark.parametrize(
    ("call", "words"),
    [
        (lambda: ub.ArcLength(0.0), "leads nowhere"),
        (lambda: ub.DissipationControl(1.0, LOAD), "is not a ArcLength"),
        (lambda: ub.follow(STILL, ub.DisplacementControl(APEX, "v", 1)), "is not in the scene"),
        (lambda: ub.follow(STILL, LOAD), "no load and no motion depends on time"),
        (lambda: ub.follow(acting(ub.Controller(lambda now: 0.0)), LOAD), "a path has none"),
        (lambda: ub.follow(acting(ub.Coulomb(5.0)), LOAD), "dry friction sticks or slides"),
        (lambda: ub.follow(replace(SCENE, works=[DRAG]), LOAD),
         "depends on the velocity v, and a path has no time; leave v"),
        (lambda: ub.follow(replace(SCENE, works=[CREEP]), LOAD), "depends on the step length dt"),
    ],
)  # fmt: skip
def test_bad_input_is_refused(call, words):
    with raises(words):
        call()


@pytest.mark.parametrize(
    ("control", "words", "reached"),
    [
        (ub.DisplacementControl(FOOT, "v", 0.1), "v of left.start (-4, 0) is held, or does", 0),
        (ub.LoadControl(0.4), "nothing moves with the load factor", 0.9),
    ],
)  # fmt: skip
def test_controls_that_lead_nowhere(control, words, reached):
    """Held places, and loads that stop growing; what was reached is kept."""
    ramp = ub.PointLoad(APEX, force=(0, -1e3), amplitude=ub.ramp(1.0))
    with raises(words, kind=ub.ConvergenceError) as failure:
        ub.follow(replace(SCENE, loads=[ramp]), control)
    assert failure.value.solution.factor[-1] >= reached


# -- steps that leap to another branch ------------------------------------------------------------


class Turns(PathStepper):
    """A path of one unknown whose load factor turns at 0.4, where it leaps to another branch."""

    def __init__(self):
        self.corrector = SimpleNamespace(
            start=np.zeros(2), direction=np.ones(2), length=lambda way: math.hypot(*way)
        )

    def _seek(self, part):
        q, way = np.array([part + 0.5 * (part > 0.4)]), np.array([1.0, 0.4 - part])
        stiffness = SimpleNamespace(negative=0, symmetric=True)
        trial = SimpleNamespace(q1=q, step=SimpleNamespace(t1=0.0))
        return Candidate(trial, stiffness, way, slope=abs(way[-1]))


def test_a_leap_is_no_critical_point():
    """From the last state before it, steps become shorter."""
    path = Turns()
    before = path._seek(0.0)
    found, reached = path._locate(before, path._seek(1.0), 1.0)
    assert reached == pytest.approx(0.4, abs=2e-7)
    assert not found.passed(before)
    assert path._fraction == (1.0 - reached) / 2
