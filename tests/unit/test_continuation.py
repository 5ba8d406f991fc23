"""Paths of static equilibria: controls, critical points, branches, what is refused, what fails."""

import math

import numpy as np
import pytest

import ufl_beam as ub
from ufl_beam.processes import ours

EA, WIDTH, HEIGHT = 1e6, 4.0, 1.0  # N, m, m: half a truss


def growing(t):
    return t


def truss(*, time=growing, moved=False):
    """Two bars from their pins up to the apex, which a load of 1 kN pushes down."""
    section = ub.Section(EA=EA, GA=EA, EI=1e9, depth=0.1)
    left = ub.Beam((-WIDTH, 0), (0, HEIGHT), section, cells=1, name="left")
    right = ub.Beam((0, HEIGHT), (WIDTH, 0), section, cells=1, name="right")
    push = ub.Prescribed(left.end, v=lambda t: -t)
    scene = ub.Scene(
        [left, right],
        joints=[ub.Revolute(left.end, right.start)],
        supports=[ub.Pinned(left.start), ub.Pinned(right.end), *([push] if moved else [])],
        loads=[] if moved else [ub.PointLoad(left.end, force=(0, -1e3), time=time)],
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
def test_snap_through(factor):
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
        dofs = path.grid.node(apex)
        assert abs(point.mode[dofs[1]]) > 1e6 * abs(point.mode[dofs[0]])
    assert path.energy.worst < 0.01


def test_displacement_control_goes_through_limit_loads():
    """Steps are as long as asked for; [closed]."""
    apex, scene = truss()
    path = ub.follow(scene, ub.Displacement(apex, "v", -0.125), steps=18)
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
        ub.follow(scene, ub.Load(0.5))
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
    path = ub.follow(scene, ub.Load(0.5), steps=2)
    v = path.displacement(apex)[:, 1]
    np.testing.assert_allclose(path.factor + 2, force(v), rtol=1e-7)


def test_backwards_and_on_from_a_path():
    """A negative step begins with a falling factor; a path goes on where another one ended."""
    apex, scene = truss()
    path = ub.follow(scene, ub.ArcLength(-0.05), steps=4)
    assert (np.diff(path.factor) < 0).all()
    on = ub.follow(scene, ub.Load(0.25), start=path, steps=2)
    assert on.factor[0] == path.factor[-1]
    np.testing.assert_allclose(on.factor, force(on.displacement(apex)[:, 1]), atol=1e-6)


def arch():
    """A semicircle on pins, which sways before it snaps through."""
    section = ub.Section(EA=1e8, GA=1e8, EI=1e6)
    beam = ub.Beam.arc((0, 0), 100.0, (math.pi, 0), section, cells=16)
    load = ub.PointLoad(beam.at(0.5), force=(0, -1e3), time=growing)
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
    with pytest.raises(ub.SceneError, match="limit point"):
        path.critical[0].branch()


def test_recorders_write_paths(tmp_path):
    """Rows of a history are the states of the path, critical points among them."""
    apex, scene = truss()
    file = tmp_path / "path.csv" if ours().size == 1 else None
    record = [ub.History(file, [apex])] if file else []
    path = ub.follow(scene, ub.ArcLength(0.1), steps=12, record=record)
    assert len(path.factor) == 13
    if file:
        rows = np.loadtxt(file, delimiter=",", skiprows=1)
        np.testing.assert_array_equal(rows[:, 0], path.factor)


# -- what is refused ---------------------------------------------------------------------------


def test_controls_refuse_bad_input():
    apex, _ = truss()
    cases = [
        (lambda: ub.ArcLength(0.0), "leads nowhere"),
        (lambda: ub.ArcLength(0.1, factor=-1.0), "must be positive"),
        (lambda: ub.Load(0.0), "leads nowhere"),
        (lambda: ub.Displacement(apex, "w", 0.1), "must be one of u, v, psi"),
        (lambda: ub.Displacement(apex, "v", 0), "leads nowhere"),
        (lambda: ub.Displacement("apex", "v", 0.1), "is not a Place"),
        (lambda: ub.Dissipation(-1.0), "must be positive"),
        (lambda: ub.Dissipation(1.0, ub.Load(1.0)), "is not a ArcLength"),
    ]
    for call, message in cases:
        with pytest.raises(ub.SceneError, match=message):
            call()


def test_paths_refuse_bad_input():
    _, scene = truss()
    other, _ = truss()
    _, steady = truss(time=lambda t: 1.0)
    cases = [
        (lambda: ub.follow(scene, ub.Displacement(other, "v", 0.1)), "is not in the scene"),
        (lambda: ub.follow(scene, "arc"), "must be ArcLength"),
        (lambda: ub.follow(scene, ub.ArcLength), "must be ArcLength"),
        (lambda: ub.follow(scene, ub.Load(1.0), steps=0), "at least 1"),
        (lambda: ub.follow(scene, ub.Load(1.0), start=3), "is not a Solution or Branch"),
        (lambda: ub.follow(steady, ub.Load(1.0)), "no load and no motion depends on time"),
    ]
    for call, message in cases:
        with pytest.raises(ub.SceneError, match=message):
            call()


def test_controllers_need_time():
    apex, scene = truss()
    turn = ub.Turn(apex, ub.ground(0, 0), ub.Controller(lambda now: 0.0))
    scene = ub.Scene(
        scene.beams, joints=scene.joints, supports=scene.supports, loads=scene.loads,
        connectors=[turn],
    )  # fmt: skip
    with pytest.raises(ub.SceneError, match="a path has none"):
        ub.follow(scene, ub.Load(1.0))


def test_loads_that_stop_growing():
    """Beyond the end of a ramp there is no direction to go in; what was reached is kept."""
    _, scene = truss(time=ub.ramp(1.0))
    with pytest.raises(ub.ConvergenceError, match="nothing moves with the load factor") as failure:
        ub.follow(scene, ub.Load(0.4))
    assert failure.value.solution.factor[-1] > 0.9
