# SPDX-License-Identifier: MIT
"""Symbols of bodies, joints, connectors and supports: where they are, and how they move."""

import dataclasses
import math

import numpy as np
import pytest
import scenes
from drawn import LAWS, has, middles, outlines, static
from helpers import PUBLIC, run
from matplotlib.collections import LineCollection, PolyCollection
from matplotlib.path import Path
from user_classes import Stiffening

import ufl_beam as ub
from ufl_beam.plotting.style import INK, WHITE
from ufl_beam.plotting.symbols import FILLED

ROD, RAIL, SLEEVE, STRUT, PLAIN = 2.6, 2.2, 2.4, 6.0, 1.6
"""Widths of lines of links, rails and guides, releases, rigid links and other joints; points."""


@pytest.fixture(scope="module")
def engine_drawn(engine):
    return ub.plot(engine)


def zigzags(figure):
    """Lines of springs."""
    return [x for x in outlines(figure, "connectors", LineCollection) if len(x) > 8]


def test_outlines_of_bodies_move_rigidly_and_enclose_the_places_of_joints(engine):
    shown = (0, 5, 10)
    figure = ub.plot(engine, "shapes", engine.times[[*shown]])
    assert len(outlines(figure, "moving", fill=FILLED)) == 0  # each in the colour of its time
    assert len(outlines(figure, "moving")) == 3 * (2 + 1)  # bodies and a rod
    assert figure.axes[0].get_xlim()[1] > 4.5
    drawn = outlines(figure, "moving", PolyCollection)
    wheel, block = engine.scene.bodies
    for n, turning, sliding in zip(shown, drawn[::2], drawn[1::2], strict=True):
        for outline, body, spots in (
            (turning, wheel, [(0, 0), (0.3, 0.2), (0.6, 0.4)]),
            (sliding, block, [(3, 0), (2.8, 0.1), (3.2, 0.1)]),
        ):
            at = [engine.position(body.at(*spot))[n] for spot in spots]
            assert Path(outline).contains_points(at).all()
        # The wheel has turned about the bearing by what the motor gives
        turn = np.exp(3j * engine.times[n] ** 2)
        np.testing.assert_allclose(turning @ [1, 1j], drawn[0] @ [1, 1j] * turn, atol=1e-9)


def test_a_single_body_is_in_the_picture():
    """Also of a scene that has no size, or is far away."""
    for x in (0.0, 1e5):
        body = ub.Body((x, 0), mass=1.0, inertia=0.1)
        solution = run(ub.Scene(bodies=[body], loads=[ub.Gravity()]))
        for n in (0, -1):  # it has fallen 5 m
            figure = ub.plot(solution, n=n)
            (outline,) = outlines(figure, "bodies", fill=FILLED)
            at, r = solution.position(body.middle)[n], np.ptp(outline[:, 0]) / 2
            radii = np.linalg.norm(outline - at, axis=1)
            np.testing.assert_allclose(radii, r, rtol=1e-12, atol=1e-15 * x)
            low, high = figure.axes[0].get_ylim()
            assert low < at[1] - r < at[1] + r < high
    with pytest.raises(ub.ArgumentError, match="neither beams nor connectors"):
        ub.plot(solution, "dissipation")


def test_links_and_springs_reach_from_place_to_place(engine, engine_drawn):
    rod, spring = engine.scene.joints[2], engine.scene.connectors[0]
    for n, figure in ((0, ub.plot(engine, n=0)), (-1, engine_drawn)):
        (line,) = outlines(figure, "joints", width=ROD)
        ends = [engine.position(p)[n] for p in rod.places]
        np.testing.assert_allclose(line, ends, atol=1e-12)
        ends = [engine.position(p)[n] for p in (spring.a, spring.b)]
        (zigzag,) = (x for x in zigzags(figure) if has(x[[0]], ends[0]))
        np.testing.assert_allclose(zigzag[-1], ends[1], atol=1e-12)
    point = rod.places[0]
    (line,) = outlines(ub.plot(engine, magnify=3), "joints", width=ROD)
    expected = point.point + 3 * (engine.position(point)[-1] - point.point)
    np.testing.assert_allclose(line[0], expected, atol=1e-12)


def test_a_rail_reaches_along_the_whole_way_and_the_block_is_at_the_slider(engine, engine_drawn):
    way = engine.position(engine.scene.bodies[1].middle)
    assert np.ptp(way[:, 0]) > 0.1  # something moves
    (rail,) = outlines(ub.plot(engine, "shapes", count=11), "still", width=RAIL)
    np.testing.assert_allclose(rail[:, 1], 0.0, atol=1e-9)
    first, last = sorted(rail[:, 0])
    assert first < way[:, 0].min() < way[:, 0].max() < last
    for n, figure in ((4, ub.plot(engine, n=4)), (-1, engine_drawn)):
        (block,) = outlines(figure, "joints", fill=WHITE)
        np.testing.assert_allclose(block[:4].mean(axis=0), way[n], atol=1e-9)


def test_a_rail_on_a_body_turns_with_it_and_is_fixed_to_it():
    along = 0.6, 0.8
    carrier, block = (ub.Body(at, mass=1.0, inertia=0.1) for at in ((0, 0), (1, 2)))
    joints = [ub.Prismatic(carrier.at(0.5, 0), block.middle, axis=along)]
    start = ub.Velocity([carrier, block], angular=2.0)
    push = ub.PointLoad(block.middle, force=(0.5, 0.2))
    scene = ub.Scene(bodies=[carrier, block], joints=joints, initial=[start], loads=[push])
    solution = run(scene, t=(0, 0.4), dt=0.05)
    rail, arm = outlines(ub.plot(solution), "joints", width=RAIL)
    ψ = solution.displacement(carrier.middle)[-1, 2]
    assert ψ > 0.3
    turned = np.array([[math.cos(ψ), -math.sin(ψ)], [math.sin(ψ), math.cos(ψ)]]) @ along
    way = rail[1] - rail[0]
    np.testing.assert_allclose(way / np.linalg.norm(way), turned, atol=1e-9)
    np.testing.assert_allclose(arm[0], solution.position(carrier.at(0.5, 0))[-1], atol=1e-12)
    # The arm ends on the rail
    inside = (arm[1] - rail[0]) @ turned / np.linalg.norm(way)
    assert -1e-9 < inside < 1 + 1e-9
    assert abs((arm[1] - rail[0]) @ (-turned[1], turned[0])) < 1e-9


@pytest.mark.parametrize(
    ("free", "bars", "aspect"), [("N", 2, 1.5), ("V", 2, 1 / 1.5), ("NV", 4, 1.5), ("M", 0, None)]
)
def test_releases_show_the_free_directions(free, bars, aspect):
    left, right = (ub.Beam((x, 0), (x + 1, 0), scenes.SLENDER, cells=2) for x in (0, 1))
    joint = ub.Release(left.end, right.start, free=free)
    figure = ub.plot(ub.Scene([left, right], joints=[joint]))
    drawn = outlines(figure, "joints", width=SLEEVE)
    assert len(drawn) == bars
    assert len(outlines(figure, "pins", fill=WHITE)) == (bars == 0)
    if bars:
        low, high = np.min(drawn, axis=(0, 1)), np.max(drawn, axis=(0, 1))
        np.testing.assert_allclose((low + high) / 2, (1, 0), atol=1e-12)
        assert np.divide(*(high - low)) == pytest.approx(aspect)


def test_joints_of_a_user_have_a_plain_symbol():
    left, right, apart = (ub.Beam((x, 0), (x + 1, 0), scenes.SLENDER) for x in (0, 1, 3))

    @dataclasses.dataclass(frozen=True, eq=False, repr=False)
    class Own(ub.extend.Joint):
        places: tuple
        shared: tuple
        holders: tuple
        meets: bool

    together, connector = (left.end, right.start), ub.RigidLink(right.end, apart.start)
    far = Own(connector.places, (2,), connector.holders, False)
    joints = [Own(together, (0, 1), (), True), far]
    figure = ub.plot(ub.Scene([left, right, apart], joints=joints))
    np.testing.assert_allclose(middles(figure, "pins"), [(1, 0)], atol=1e-12)
    np.testing.assert_array_equal(outlines(figure, "joints", width=PLAIN), [[(2, 0), (3, 0)]])


def test_beams_bodies_and_their_joints_are_in_one_picture():
    beam = ub.Beam((0, 0), (1, 0), scenes.SLENDER, cells=2)
    hub, bead, far = (
        ub.Body(at, mass=1.0, inertia=0.1) for at in ((1.2, 0.1), (2.0, 0.0), (0.5, 0.5))
    )
    joints = [
        ub.Rigid(beam.end, hub.at(1, 0), multipliers=True),
        ub.Guided(bead.middle, lambda s: (2.0 + s, s * s)),
        ub.RigidLink(beam.at(0.5), far.middle),
    ]
    loads = [ub.PointLoad(bead.middle, force=(1.0, 0.3)), ub.Gravity()]
    scene = scenes.clamped(beam, bodies=[hub, bead, far], joints=joints, loads=loads)
    solution = run(scene, t=(0, 0.2), dt=0.02)
    figure = ub.plot(solution)
    corner, at = solution.position(beam.end)[-1], solution.position(bead.middle)[-1]
    np.testing.assert_allclose(middles(figure, "pins", INK), [corner], atol=1e-12)
    np.testing.assert_allclose(middles(figure, "pins", WHITE), [at], atol=1e-12)
    (curve,) = outlines(figure, "joints", width=RAIL)
    np.testing.assert_allclose(curve[:, 1], (curve[:, 0] - 2.0) ** 2, atol=1e-12)
    assert curve[:, 0].min() < at[0] < curve[:, 0].max()
    (connector,) = outlines(figure, "joints", width=STRUT)
    ends = [solution.position(p)[-1] for p in joints[2].places]
    np.testing.assert_allclose(connector, ends, atol=1e-12)


def slider(connect, *laws):
    """A body on a rail at an angle, pushed, with connectors to the ground."""
    body = ub.Body((1.0, 0.0), mass=1.0, inertia=0.1)
    rail = ub.Prismatic(ub.ground(1, 0), body.middle, axis=(1, 0.5), turning=connect is ub.Turn)
    at = ub.ground(1, 0) if connect is ub.Turn else ub.ground(0, 0)
    connectors = [connect(at, body.middle, law) for law in laws]
    push = ub.PointLoad(body.middle, force=(0.0, 1.0), moment=0.2)
    return ub.Scene(bodies=[body], joints=[rail], connectors=connectors, loads=[push])


def test_all_public_connector_laws_are_drawn_below():
    public = {*PUBLIC.values()}
    laws = {x for x in public if getattr(x, "__module__", "").endswith(".connector_laws")}
    assert {type(law) for law in LAWS} == laws - {ub.Clearance} | {ub.ForceLaw, Stiffening}


@pytest.mark.parametrize("law", LAWS, ids=lambda law: type(law).__name__)
@pytest.mark.parametrize("connect", [ub.Stretch, ub.Turn])
def test_the_symbol_of_a_law_is_where_its_connector_is(connect, law):
    points = np.concatenate(outlines(ub.plot(slider(connect, law)), "connectors"))
    if connect is ub.Turn:  # around the pin; in a picture of 1 m
        assert 0.005 < np.linalg.norm(points - (1, 0), axis=1).max() < 0.2
    else:
        assert has(points, (0, 0))
        assert has(points, (1, 0))
        assert np.abs(points[:, 1]).max() < 0.05


def test_connectors_side_by_side_do_not_cover_each_other():
    laws = [ub.Spring(10.0), ub.Damper(1.0), ub.Spring(5.0)]
    first, last = (x[2:-2, 1] for x in zigzags(ub.plot(slider(ub.Stretch, *laws))))
    assert first.max() < 0.0 < last.min() or last.max() < 0.0 < first.min()


def test_a_slide_is_drawn_along_its_axis():
    """From the ground to the place, and if its length is zero."""
    beam = ub.Beam((0, 0), (2, 0), scenes.SLENDER)
    stop = ub.Slide(ub.ground(2.4, 0.5), beam.end, ub.Stop(1e3, high=0.3), axis=(0, 1))
    drawn = outlines(ub.plot(scenes.clamped(beam, connectors=[stop])), "connectors")
    (across,) = (x for x in drawn if has(x, (2.0, 0.0)))
    np.testing.assert_allclose(across, [(2.4, 0.0), (2.0, 0.0)], atol=1e-12)
    x, y = np.concatenate([line for line in drawn if line is not across]).T
    assert np.abs(x - 2.4).max() < 0.1  # a symbol wide
    np.testing.assert_allclose((y.min(), y.max()), (0.0, 0.5), atol=1e-12)
    body = ub.Body((0.0, 0.0), mass=1.0, inertia=0.1)
    spring = ub.Slide(ub.ground(0, 0), body.middle, ub.Spring(1.0), axis=(1, 0))
    (zigzag,) = zigzags(ub.plot(ub.Scene(bodies=[body], connectors=[spring])))
    x, y = zigzag.T
    assert y[0] == pytest.approx(y[-1])
    assert 0.0 < np.ptp(y) < np.ptp(x) == pytest.approx(abs(x[-1] - x[0]))


def test_connectors_are_drawn_in_a_run_without_beams():
    """All laws but two that would hold the motion."""
    solution = run(slider(ub.Stretch, *LAWS[1:-1]), t=(0, 0.1))
    for figure in (ub.plot(solution), ub.plot(solution, "damage")):
        assert len(outlines(figure, "connectors")) >= len(LAWS[1:-1])
    drawn = {x.get_label(): x.get_ydata() for x in ub.plot(solution, "dissipation").axes[0].lines}
    assert drawn["supplied"][-1] > 0.0


@pytest.mark.parametrize(
    ("end", "support", "away"),
    [
        ((0, 2), lambda beam: ub.Pinned(beam.start), (0, -1)),
        ((0, 2), lambda beam: ub.Pinned(beam.end), (0, 1)),
        ((0, 2), lambda beam: ub.Clamped(beam.start), (0, -1)),
        ((2, 0), lambda beam: ub.Roller(beam.end, along=(0, 1)), (1, 0)),
    ],
)
def test_symbols_of_supports_stand_away_from_the_beam(end, support, away):
    beam = ub.Beam((0, 0), end, scenes.SLENDER)
    support = support(beam)
    drawn = np.concatenate(outlines(ub.plot(ub.Scene([beam], supports=[support])), "supports"))
    heights = (drawn - support.place.point) @ away
    assert -1e-12 < heights.min() < 1e-12 < 0.01 < heights.max()


def test_a_clamp_turns_with_its_beam():
    beam = ub.Beam((0, 0), (0, 2), scenes.SLENDER)
    clamp = ub.PrescribedDisplacement(beam.start, u=0.0, v=0.0, psi=lambda t: 0.1 * t)
    (mark,) = outlines(ub.plot(static(ub.Scene([beam], supports=[clamp]))), "supports")
    edge = mark[1] - mark[0]
    assert math.atan2(edge[1], edge[0]) == pytest.approx(0.1)


def test_points_of_the_ground_are_supports(engine_drawn):
    # The bearing from beneath, the spring from its right; the rail has hatches.
    bearing, spring = outlines(engine_drawn, "supports", PolyCollection)[::2]
    assert has(bearing, (0.0, 0.0))
    assert bearing[:, 1].max() < 1e-12
    np.testing.assert_allclose((spring[0] + spring[1]) / 2, (4.5, 0.4), atol=1e-12)
    away = np.array([4.5 - 3.2, 0.4 - 0.1])
    assert ((spring - (4.5, 0.4)) @ away > -1e-12).all()
