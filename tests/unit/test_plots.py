# SPDX-License-Identifier: MIT
"""Pictures: what is in them, that they need no screen, and what is refused."""

import dataclasses
import math
import os
import shutil
import sys
from dataclasses import dataclass
from itertools import pairwise

from mpi4py import MPI

import numpy as np
import pytest
import scenes
from matplotlib.colors import same_color
from matplotlib.path import Path
from matplotlib.text import Text

import ufl_beam as ub
from ufl_beam.plotting import films, symbols
from ufl_beam.plotting.layout import Stage
from ufl_beam.plotting.style import BLUE, INK, RED, WHITE, decimal_prefix, number, with_unit
from ufl_beam.plotting.symbols import EDGE, FILLED, LAWS, glyph_of, support_direction

FIRST = MPI.COMM_WORLD.rank == 0
INDEX = {"N": 0, "V": 1, "M": 2}
UNIT = {"N": "N", "V": "N", "M": "N m"}


@pytest.fixture(scope="module")
def portal():
    return ub.simulate(scenes.portal(), ub.Static(), t=(0, 1), dt=0.5)


@pytest.fixture(scope="module")
def swing():
    return ub.simulate(scenes.swing(), ub.EnergyMomentum(0.01, 0.01), t=(0, 0.1), dt=5e-3)


def values_of(solution, what):
    """What diagrams show along each beam."""
    return [getattr(solution.diagram(beam), what) for beam in solution.scene.beams]


def crank():
    """A crank, a rod without mass, a slider on a rail of the ground, and a spring; no beams."""
    wheel = ub.Body((0.3, 0.2), mass=1.0, inertia=0.1, name="wheel")
    block = ub.Body((3.0, 0.0), mass=2.0, inertia=0.2, name="block")
    bearing = ub.Revolute(ub.ground(0, 0), wheel.at(0, 0))
    rail = ub.Prismatic(ub.ground(2, 0), block.middle)
    rod = ub.Link(wheel.at(0.6, 0.4), block.at(2.8, 0.1))
    spring = ub.Stretch(block.at(3.2, 0.1), ub.ground(4.5, 0.4), ub.Spring(20.0))
    motor = ub.Turn(ub.ground(0, 0), wheel.at(0, 0), ub.PrescribedMotion(lambda t: 3.0 * t**2))
    return ub.Scene(bodies=[wheel, block], joints=[bearing, rail, rod], connectors=[spring, motor])


@pytest.fixture(scope="module")
def engine():
    return ub.simulate(crank(), ub.EnergyMomentum(), t=(0, 0.5), dt=0.05)


def outlines(figure, group, fill=None):
    """Lines and areas of a group, those filled with a colour if one is given; m."""
    drawn = [c for c in figure.axes[0].collections if c.get_gid() == group]
    if fill is not None:
        drawn = [c for c in drawn if any(same_color(x, fill) for x in c.get_facecolor())]
    return [path.vertices for one in drawn for path in one.get_paths()]


def middles(figure, group, fill=None):
    """Where the symbols of a group are; (n, 2); m."""
    found = [(x.min(axis=0) + x.max(axis=0)) / 2 for x in outlines(figure, group, fill)]
    return np.reshape(found, (-1, 2))


def chains(axes):
    """Lines of a picture, each in its pieces, without symbols."""
    lines = [x.get_xydata() for x in axes.lines if x.get_linestyle() != "None"]
    ends = [np.flatnonzero(np.isnan(x[:, 0])) for x in lines]
    return [
        [c[np.isfinite(c[:, 0])] for c in np.split(x, k)] for x, k in zip(lines, ends, strict=True)
    ]


def has(points, point):
    """Whether a point is among others, to round-off of coordinates of 1 m."""
    return bool(len(points)) and float(np.min(np.linalg.norm(points - point, axis=1))) < 1e-12


def pose(solution, n=-1, *, unit=0.05):
    return Stage(solution, 1.0, unit).pose(n)


def boxes_of(figure):
    """Boxes of the labels, without the lines that lead to them; pixels."""
    return [Text.get_window_extent(text).frozen() for text in figure.axes[0].texts]


def areas_of(figure):
    """Outlines of the areas of a diagram, each closed; m."""
    areas = [one for one in figure.axes[0].collections if one.get_gid() in (RED, BLUE)]
    return [path.vertices for one in areas for path in one.get_paths()]


def texts(figure):
    return {text.get_text() for text in figure.axes[0].texts}


# -- Matplotlib --------------------------------------------------------------------------------


def test_shape_draws_the_frame_where_it_is(swing):
    axes = ub.plot(swing).axes[0]
    scene = swing.scene
    undeformed, _, deformed, *_ = chains(axes)
    assert len(undeformed) == len(scene.beams)
    for chain, beam in zip(deformed, scene.beams, strict=True):
        np.testing.assert_array_equal(chain, swing.shape(beam))
    assert len(outlines(axes.figure, "pins", WHITE)) == len(scene.joints)
    at = [swing.position(mass.place)[-1] for mass in scene.masses]
    np.testing.assert_allclose(middles(axes.figure, "masses"), at, atol=1e-12)
    assert axes.get_aspect() == 1.0
    assert (axes.get_xlabel(), axes.get_ylabel()) == ("x (m)", "y (m)")
    assert axes.get_title(loc="left") == "shape at t = 0.1 s"
    assert not areas_of(axes.figure)


def test_the_number_of_artists_does_not_grow_with_the_scene():
    """20 000 beams would take minutes as as many artists."""

    def count(bays):
        beams = [ub.Beam((k, 0), (k + 1, 0), scenes.SLENDER) for k in range(bays)]
        joints = [ub.Rigid(a.end, b.start) for a, b in pairwise(beams)]
        supports = [ub.Clamped(beams[0].start), *(ub.Roller(beam.end) for beam in beams)]
        scene = ub.Scene(beams=beams, joints=joints, supports=supports)
        axes = ub.plot(ub.simulate(scene, ub.Static(), t=(0, 1), dt=1.0)).axes[0]
        return len(axes.get_children())

    assert count(3) == count(30)


def test_pins_shrink_where_beams_are_short():
    def size(count):
        ends = np.linspace(0.0, 1.0, count + 1)
        beams = [ub.Beam((a, 0), (b, 0), scenes.SLENDER) for a, b in pairwise(ends)]
        joints = [ub.Rigid(a.end, b.start) for a, b in pairwise(beams)]
        scene = ub.Scene(beams=beams, joints=joints, supports=[ub.Clamped(beams[0].start)])
        figure = ub.plot(ub.simulate(scene, ub.Static(), t=(0, 1), dt=1.0))
        return np.ptp(outlines(figure, "pins")[0], axis=0)

    # Beams of 0.33 and 0.017 m in a picture of one size: the symbols become 0.3 times as large
    np.testing.assert_allclose(size(60), 0.3 * size(3))


@pytest.mark.parametrize("what", ["N", "V", "M"])
def test_extreme_values_are_those_of_the_solution(portal, what):
    values = np.concatenate(values_of(portal, what))
    factor, prefix = decimal_prefix(np.abs(values).max())
    expected = {number(x / factor) for x in (values.max(), values.min())}
    if what == "N":  # all beams are in compression
        expected = {number(values.min() / factor)}
    figure = ub.plot(portal, what)
    bold = {text.get_text() for text in figure.axes[0].texts if text.get_weight() == "bold"}
    assert bold == expected
    assert texts(figure) <= {number(x / factor) for x in values}
    title = figure.axes[0].get_title(loc="left")
    assert f" {what} ({prefix}{UNIT[what]}) at t = 1 s" in title.replace("\N{NO-BREAK SPACE}", " ")


@pytest.mark.parametrize("what", ["N", "V", "M"])
def test_an_area_for_each_run_of_one_sign(portal, what):
    runs = sum(1 + np.count_nonzero(np.diff(f > 0)) for f in values_of(portal, what))
    assert len(areas_of(ub.plot(portal, what))) == runs


def test_ordinates_are_in_proportion_to_the_values(portal):
    # A patch of one beam: axis start, the values, axis back.  The roof is nearly horizontal, its
    # displacement at this load some millimetres: 1 % of the ordinates.
    roof = portal.scene.beams[1]
    s, values, *_ = portal.diagram(roof)
    outlines = areas_of(ub.plot(portal, "N"))
    (outline,) = [outline for outline in outlines if np.ptp(outline[:, 0]) > 5.5]
    tips, shape = outline[1 : 1 + len(values)], portal.shape(roof)
    heights = tips[:, 1] - np.interp(s, portal.grid.parameters(roof), shape[:, 1])
    np.testing.assert_allclose(heights / heights[0], values / values[0], rtol=0.01)


def test_moments_stand_on_the_side_in_tension():
    for a, b in (((0, 0), (1, 0)), ((1, 0), (0, 0))):
        beam = ub.Beam(a, b, scenes.SLENDER, cells=2)
        left, right = (beam.start, beam.end) if a == (0, 0) else (beam.end, beam.start)
        force = 1e-3 * scenes.SLENDER.EI
        load = ub.PointLoad(right, force=(0, -force))
        scene = ub.Scene([beam], supports=[ub.Clamped(left)], loads=[load])
        solution = ub.simulate(scene, ub.Static(), t=(0, 1), dt=1)
        (area,) = areas_of(ub.plot(solution, "M"))
        assert area[:, 1].max() > 0.05  # the upper fibre of a cantilever pulled down


def simple_beam(cells, length=6.0, load=10e3, direction=0.0):
    """A beam on two supports under a line load across it; turned by an angle."""
    along = np.array([math.cos(direction), math.sin(direction)])
    section = ub.Section(EA=1e10, GA=1e10, EI=1e9)
    beam = ub.Beam((0, 0), tuple(length * along), section, cells=cells)
    across = load * np.array([along[1], -along[0]])
    scene = ub.Scene(
        [beam],
        supports=[ub.Pinned(beam.start), ub.Roller(beam.end, along=tuple(along))],
        loads=[ub.LineLoad(beam, force=tuple(across), amplitude=lambda t: t)],
    )
    return ub.simulate(scene, ub.Static(), t=(0, 1), dt=1, progress=False)


@pytest.mark.parametrize("direction", [0.0, 2.0])
def test_moments_under_a_line_load(direction):
    """[closed] w l²/8 = 45 kN m, a parabola without steps; the deflection is 2e-5 of l."""
    solution = simple_beam(4, direction=direction)
    figure = ub.plot(solution, "M")
    assert texts(figure) == {"45"}
    (area,) = areas_of(figure)
    x = np.repeat(np.linspace(0.0, 6.0, 33), [1, *(1, 1, 1, 1, 1, 1, 1, 2) * 3, *[1] * 8])
    along = np.array([math.cos(direction), math.sin(direction)])
    tips = area[1 : 1 + len(x)]
    np.testing.assert_allclose(tips @ along, x, atol=1e-3)
    depth = tips @ (along[1], -along[0])
    parabola = 4 * (x / 6) * (1 - x / 6)
    np.testing.assert_allclose(depth, depth.max() * parabola, atol=1e-3)


@pytest.mark.parametrize("what", ["N", "V", "M"])
@pytest.mark.parametrize("name", ["portal", "beam", "upright"])
def test_extreme_values_cover_nothing(portal, name, what):
    """Neither areas of the diagram nor beams; labels do not overlap and are in the picture."""
    solution = {
        "portal": lambda: portal,
        "beam": lambda: simple_beam(8),
        "upright": lambda: simple_beam(8, direction=math.pi / 2),
    }[name]()
    figure = ub.plot(solution, what)
    figure.draw_without_rendering()
    axes, boxes = figure.axes[0], boxes_of(figure)
    whole = figure.bbox
    for k, box in enumerate(boxes):
        assert whole.x0 <= box.x0 and box.x1 <= whole.x1  # noqa: PT018
        assert whole.y0 <= box.y0 and box.y1 <= whole.y1  # noqa: PT018
        assert not any(box.overlaps(other) for other in boxes[:k])
        if axes.texts[k].get_weight() != "bold":
            continue
        inside = np.stack(
            np.meshgrid(np.linspace(box.x0, box.x1, 20), np.linspace(box.y0, box.y1, 10)), axis=-1
        ).reshape(-1, 2)
        for outline in map(Path, areas_of(figure)):
            outline = outline.transformed(axes.transData)
            assert not outline.contains_points(inside).any()
        for line in axes.lines[:3]:
            drawn = line.get_path().transformed(line.get_transform())
            assert not drawn.intersects_bbox(box, filled=False)


def storeys(bays, floors):
    """A frame of many members under line loads and wind."""
    section = ub.Section.rectangle(b=0.3, h=0.3, E=30e9, nu=0.2, rho=2500.0)
    posts = {
        (i, k): ub.Beam((5 * i, 3 * k), (5 * i, 3 * k + 3), section, cells=2)
        for i in range(bays + 1) for k in range(floors)
    }  # fmt: skip
    roofs = {
        (i, k): ub.Beam((5 * i, 3 * k + 3), (5 * i + 5, 3 * k + 3), section, cells=2)
        for i in range(bays) for k in range(floors)
    }  # fmt: skip
    corners = [
        [
            posts[i, k].end,
            *([posts[i, k + 1].start] if k + 1 < floors else []),
            *([roofs[i - 1, k].end] if i > 0 else []),
            *([roofs[i, k].start] if i < bays else []),
        ]
        for i, k in posts
    ]
    loads = [ub.LineLoad(roof, force=(0, -25e3)) for roof in roofs.values()]
    loads += [ub.PointLoad(posts[0, k].end, force=(40e3, 0)) for k in range(floors)]
    return ub.Scene(
        [*posts.values(), *roofs.values()],
        joints=[ub.Rigid(*places) for places in corners],
        supports=[ub.Clamped(posts[i, 0].start) for i in range(bays + 1)],
        loads=loads,
    )


def test_forty_labels_do_not_overlap():
    scene = storeys(3, 4)
    figure = ub.plot(ub.simulate(scene, ub.Static(), t=(0, 1), dt=1, progress=False), "M")
    figure.draw_without_rendering()
    boxes = boxes_of(figure)
    assert len(boxes) >= 40
    for k, box in enumerate(boxes):
        assert not any(box.overlaps(other) for other in boxes[:k])
        assert figure.bbox.containsx(box.x0)
        assert figure.bbox.containsx(box.x1)
    # Lines that lead to labels cross no other label
    for mark, own in zip(figure.axes[0].texts, boxes, strict=True):
        if mark.arrow_patch is not None:
            line = mark.arrow_patch.get_path().transformed(mark.arrow_patch.get_transform())
            assert not any(line.intersects_bbox(box) for box in boxes if box is not own)


def test_legend_names_the_signs_in_the_picture(portal):
    """The roof of the portal is in compression, and so are its posts."""
    (legend,) = ub.plot(portal, "N").legends
    assert [text.get_text() for text in legend.get_texts()] == ["N < 0: compression"]
    (legend,) = ub.plot(portal, "M").legends
    assert [text.get_text()[:5] for text in legend.get_texts()] == ["M > 0", "M < 0"]
    assert not ub.plot(portal).legends


@pytest.mark.parametrize(("width", "height"), [(1.0, 1.0), (1.0, 3.0), (4.0, 1.0), (1.0, 1.6)])
def test_no_blank_margins(width, height):
    """The axes fill the figure but for words and numbers: an inch or so in each direction."""
    section = ub.Section(EA=1e9, GA=1e9, EI=1e7)
    post = ub.Beam((0, 0), (0, height), section, cells=4)
    roof = ub.Beam((0, height), (width, height), section, cells=4)
    scene = ub.Scene(
        [post, roof],
        joints=[ub.Rigid(post.end, roof.start)],
        supports=[ub.Clamped(post.start)],
        loads=[ub.PointLoad(roof.end, force=(0, -1e3), amplitude=lambda t: t)],
    )
    figure = ub.plot(ub.simulate(scene, ub.Static(), t=(0, 1), dt=1, progress=False), "M")
    figure.draw_without_rendering()
    inches = figure.get_size_inches()
    blank = inches * (1 - figure.axes[0].get_position().size)
    assert inches.max() <= 9.0
    assert (blank < 1.5).all()


def test_extremes_of_beams_of_one_cell():
    beam = ub.Beam((0, 0), (0, 1), scenes.SLENDER, cells=1)
    load = ub.PointLoad(beam.end, force=(1.0, 0.0), amplitude=lambda t: t)
    scene = ub.Scene([beam], supports=[ub.Clamped(beam.start)], loads=[load])
    extremes = ub.Extremes()
    times = {"t": (0, 1), "dt": 1, "progress": False}
    ub.simulate(scene, ub.Static(), record=extremes, **times)
    assert len(areas_of(ub.plot(extremes, "V"))) == 1


def test_envelopes_are_two_diagrams():
    """Each area has ordinates of one of both, across the axis: none leads from one to the other."""
    section = ub.Section(EA=1e6, GA=1e6, EI=1e4, rhoA=1.0, rhoI=0.01)
    beam = ub.Beam((0, 0), (6, 0), section, cells=8)
    shake = ub.LineLoad(beam, force=(0.0, 1.0), amplitude=lambda t: math.sin(7 * t))
    supports = [ub.Clamped(beam.start), ub.Clamped(beam.end)]
    scene = ub.Scene([beam], supports=supports, loads=[shake])
    extremes = ub.Extremes()
    times = {"t": (0, 1), "dt": 0.05, "progress": False}
    run = ub.simulate(scene, ub.EnergyMomentum(), record=extremes, **times)
    found = extremes.section_forces(beam)
    axes = ub.plot(extremes, "V").axes[0]
    x = 6 * run.diagram(beam, points=2).s
    scale = None
    drawn = [area for color in (RED, BLUE) for area in outlines_of(axes, color)]
    assert drawn
    for outline in drawn:
        tips = outline[np.abs(outline[:, 1]) > 1e-12]
        for at, ordinate in tips:
            near = np.isclose(x, at)
            assert near.any()
            values = np.concatenate([found.low[near, 1], found.high[near, 1]])
            scale = scale or ordinate / values[np.argmax(values * np.sign(ordinate))]
            assert np.isclose(scale * values, ordinate, rtol=1e-9).any()
        # From the lowest to the largest x along the tips, and back along the axis
        assert (np.diff(tips[:, 0]) >= 0).all()


def outlines_of(axes, color):
    return [
        path.vertices[:-1]
        for one in axes.collections if one.get_gid() == color for path in one.get_paths()
    ]  # fmt: skip


def test_no_diagram_where_there_is_no_force(swing):
    figure = ub.plot(swing, "M", n=0)
    assert not areas_of(figure)
    assert not texts(figure)


def test_magnified(portal):
    axes = ub.plot(portal, magnify=10).axes[0]
    roof = portal.scene.beams[1]
    drawn = chains(axes)[2][1]
    undeformed = portal.grid.points[portal.grid.vertices_of(roof)]
    np.testing.assert_allclose(drawn - undeformed, 10 * (portal.shape(roof) - undeformed))
    assert "× 10" in axes.get_title(loc="left")


def test_saved_picture_has_its_size(portal, tmp_path):
    from matplotlib.image import imread

    figure = ub.plot(portal, "M")
    figure.savefig(tmp_path / "portal.png")
    assert (tmp_path / "portal.png").exists() == FIRST
    if FIRST:
        width, height = figure.get_size_inches() * figure.dpi
        picture = imread(tmp_path / "portal.png")
        assert abs(picture.shape[0] - height) <= 1
        assert abs(picture.shape[1] - width) <= 1
        assert picture[..., :3].std() > 0.01


def test_shapes(swing):
    figure = ub.plot(swing, "shapes", count=5)
    axes, bar = figure.axes
    scene = swing.scene
    shapes = [chain for chain in chains(axes) if len(chain) == len(scene.beams)]
    assert len(shapes) == 6
    assert len(outlines(figure, "masses")) == 5 * len(scene.masses)
    assert bar.get_ylabel() == "time t (s)"
    np.testing.assert_allclose(bar.get_ylim(), (0, 0.1))


def test_shapes_at_the_nearest_kept_times(swing):
    axes = ub.plot(swing, "shapes", [0.0519, 0.0]).axes[0]
    # Undeformed, then t = 0, then t = 0.05, which is step 10
    _, _, last = [chain for chain in chains(axes) if len(chain) == len(swing.scene.beams)]
    np.testing.assert_array_equal(last[0], swing.shape(swing.scene.beams[0], 10))


@pytest.mark.parametrize(
    ("component", "column", "label"),
    [
        ("u", 0, "displacement u (m)"),
        ("psi", 2, "rotation ψ (rad)"),
        ("dv/dt", 1, "velocity dv/dt (m/s)"),
    ],
)
def test_history(swing, component, column, label):
    beam = swing.scene.beams[0]
    places = [beam.start, beam.at(0.3)]
    figure = ub.plot(swing, "history", places, component=component)
    axes = figure.axes[0]
    motion = swing.velocity if "/" in component else swing.displacement
    for line, place in zip(axes.lines[1:], places, strict=True):
        np.testing.assert_array_equal(line.get_xdata(), swing.times)
        np.testing.assert_array_equal(line.get_ydata(), motion(place)[:, column])
        assert line.get_label() == str(place)
    assert axes.get_ylabel() == label
    assert axes.get_xlabel() == "time t (s)"


def test_history_of_one_place(portal):
    place = portal.scene.beams[0].end
    (_, line) = ub.plot(portal, "history", place).axes[0].lines
    np.testing.assert_array_equal(line.get_ydata(), portal.displacement(place)[:, 1])


def test_energy(swing):
    ledger, check = ub.plot(swing, "energy").axes
    energy = swing.energy
    drawn = {line.get_label(): line.get_ydata() for line in ledger.lines}
    entries = {*energy.state, *energy.supplied, *energy.lost}
    assert set(drawn) == entries | {"in the scene"}
    for name in entries:
        np.testing.assert_array_equal(drawn[name], energy[name])
    assert check.get_yscale() == "log"
    assert check.lines[0].get_ydata().max() == pytest.approx(energy.worst)
    assert "(J)" in ledger.get_ylabel()


@pytest.mark.parametrize(
    ("value", "text"),
    [
        (0.0, "0 N m"),
        (-12345.0, "−12.3 kN m"),
        (999.9, "1 kN m"),
        (0.0158, "15.8 mN m"),
        (2.5e6, "2.5 MN m"),
    ],
)
def test_values_with_a_decimal_prefix(value, text):
    assert with_unit(value, "N m") == text


# -- bodies, joints and connectors -------------------------------------------------------------


@pytest.mark.parametrize("n", [0, 5, -1])
def test_bodies_are_outlined_and_move_rigidly(engine, n):
    scene = engine.scene
    wheel, block = (s.points for s in symbols.bodies(pose(engine, n)))
    made, _ = (s.points for s in symbols.bodies(pose(engine, 0)))
    # Distances of all points of the outline from each other
    apart, before = (np.linalg.norm(x[:, None] - x[None], axis=2) for x in (wheel, made))
    np.testing.assert_allclose(apart, before, atol=1e-12)
    for outline, spots in (
        (wheel, [(0, 0), (0.3, 0.2), (0.6, 0.4)]),
        (block, [(3, 0), (2.8, 0.1), (3.2, 0.1)]),
    ):
        body = scene.bodies[0] if outline is wheel else scene.bodies[1]
        for spot in spots:
            gaps = np.linalg.norm(outline - engine.position(body.at(*spot))[n], axis=1)
            assert gaps.min() > 0.7 * 0.05  # inside, and not at the edge
    # The wheel has turned about the bearing by what the motor gives
    turned = 3.0 * engine.times[n] ** 2
    np.testing.assert_allclose(
        wheel @ [1.0, 1j], (made @ [1.0, 1j]) * np.exp(1j * turned), atol=1e-9
    )


@pytest.mark.parametrize("what", ["shape", "M"])
def test_plot_without_beams(engine, what):
    wheel, block = engine.scene.bodies
    bearing, _, rod = engine.scene.joints
    figure = ub.plot(engine, what)
    at = [engine.position(p)[-1] for p in (*bearing.places[:1], *rod.places)]
    np.testing.assert_allclose(middles(figure, "pins", WHITE), at, atol=1e-12)
    assert len(outlines(figure, "bodies", FILLED)) == 2
    marks = outlines(figure, "centres", EDGE)
    assert len(marks) == 4  # two quarters each
    for body, (mark, _) in zip((wheel, block), (marks[:2], marks[2:]), strict=True):
        assert has(mark, engine.position(body.middle)[-1])


def test_links_and_springs_reach_from_place_to_place(engine):
    rod, spring = engine.scene.joints[2], engine.scene.connectors[0]
    for n in (0, -1):
        (line,) = symbols.rods(pose(engine, n))
        ends = [engine.position(p)[n] for p in rod.places]
        np.testing.assert_allclose(line.points, ends, atol=1e-12)
        zigzag, *_ = symbols.connectors(pose(engine, n))
        ends = [engine.position(p)[n] for p in (spring.a, spring.b)]
        np.testing.assert_allclose(zigzag.points[[0, -1]], ends, atol=1e-12)
        assert len(zigzag.points) > 8


def test_rail_reaches_along_the_whole_way_and_the_block_is_at_the_slider(engine):
    way = engine.position(engine.scene.bodies[1].middle)
    assert np.ptp(way[:, 0]) > 0.1  # something moves
    for n in (0, 4, -1):
        line, *_, block = symbols.rails(pose(engine, n))
        np.testing.assert_allclose(line.points[:, 1], 0.0, atol=1e-9)
        first, last = sorted(line.points[:, 0])
        assert first < way[:, 0].min() < way[:, 0].max() < last
        np.testing.assert_allclose(block.points[:-1].mean(axis=0), way[n], atol=1e-9)


def test_rails_are_as_long_as_what_is_shown(engine):
    way = engine.position(engine.scene.bodies[1].middle)[:, 0]
    rail = next(symbols.rails(Stage(engine, 1.0, 0.05, [4]).pose(4)))
    ends = sorted(rail.points[:, 0])
    # From where it was made to where it is, and 1.8 units more
    np.testing.assert_allclose(ends, [way[4] - 0.09, way[0] + 0.09], atol=1e-9)


@pytest.mark.parametrize("along", [(1.0, 0.0), (0.6, 0.8)])
def test_a_rail_on_a_body_turns_with_it_and_is_fixed_to_it(along):
    carrier = ub.Body((0.0, 0.0), mass=1.0, inertia=0.1)
    block = ub.Body((1.0, 2.0), mass=1.0, inertia=0.1)
    joints = [ub.Prismatic(carrier.at(0.5, 0), block.middle, axis=along)]
    start = ub.Velocity([carrier, block], angular=2.0)
    push = ub.PointLoad(block.middle, force=(0.5, 0.2))
    scene = ub.Scene(bodies=[carrier, block], joints=joints, initial=[start], loads=[push])
    solution = ub.simulate(scene, ub.EnergyMomentum(), t=(0, 0.4), dt=0.05)
    rail, arm, _ = symbols.rails(pose(solution))
    ψ = solution.displacement(carrier.middle)[-1, 2]
    assert ψ > 0.3
    turned = np.array([[math.cos(ψ), -math.sin(ψ)], [math.sin(ψ), math.cos(ψ)]]) @ along
    (x, y), length = rail.points[1] - rail.points[0], np.linalg.norm(np.diff(rail.points, axis=0))
    np.testing.assert_allclose((x / length, y / length), turned, atol=1e-9)
    np.testing.assert_allclose(arm.points[0], solution.position(carrier.at(0.5, 0))[-1], atol=1e-12)
    inside = (arm.points[1] - rail.points[0]) @ turned / length
    assert -1e-9 < inside < 1 + 1e-9  # it ends on the rail
    across = (arm.points[1] - rail.points[0]) @ (-turned[1], turned[0])
    assert abs(across) < 1e-9


def test_points_of_the_ground_are_marked(engine):
    # The bearing from beneath, the spring from its right; the rail has hatches.
    marks = {tuple(f.at): f for f in symbols.footings(pose(engine))}
    assert set(marks) == {(0.0, 0.0), (4.5, 0.4)}
    assert marks[0.0, 0.0].angle == 0.0
    toward = math.atan2(0.1 - 0.4, 3.2 - 4.5)
    assert marks[4.5, 0.4].angle == pytest.approx(toward - math.pi / 2)


def test_displacements_of_bodies_are_magnified(engine):
    point = engine.scene.bodies[0].at(0.6, 0.4)
    (line,) = symbols.rods(Stage(engine, 3.0, 0.05).pose(-1))
    expected = point.point + 3 * (engine.position(point)[-1] - point.point)
    np.testing.assert_allclose(line.points[0], expected, atol=1e-12)


@dataclass(frozen=True)
class Quadratic(ub.ConnectorLaw):
    """A law of a user."""

    k: float

    def energy(self, motion, state):
        return self.k * motion**2 / 2


CONNECTOR_LAWS = [
    ub.PrescribedMotion(lambda t: 0.1 * t),
    ub.PrescribedForce(lambda t: t),
    ub.Controller(lambda simulation: 1.0),
    ub.Spring(10.0),
    ub.Damper(1.0),
    ub.Stop(100.0, high=0.05),
    ub.Coulomb(0.1),
    ub.ForceLaw(lambda x, v: 10.0 * x),
    Quadratic(10.0),
    ub.RigidPlastic(ub.Softening(0.5, 1.0)),
]


def slider(connect, *laws):
    """A body on a rail at an angle, pushed, with connectors to the ground."""
    body = ub.Body((1.0, 0.0), mass=1.0, inertia=0.1)
    rail = ub.Prismatic(ub.ground(1, 0), body.middle, axis=(1, 0.5), turning=connect is ub.Turn)
    at = ub.ground(1, 0) if connect is ub.Turn else ub.ground(0, 0)
    return ub.Scene(
        bodies=[body],
        joints=[rail],
        connectors=[connect(at, body.middle, law) for law in laws],
        loads=[ub.PointLoad(body.middle, force=(0.0, 1.0), moment=0.2)],
    )


def test_each_law_has_its_symbol():
    """All but those of a user, which have one in common."""
    own = {type(law) for law in CONNECTOR_LAWS if not isinstance(law, Quadratic)}
    assert own == set(LAWS) - {ub.ConnectorLaw}
    assert glyph_of(Quadratic(10.0)) is LAWS[ub.ConnectorLaw]


def test_joints_without_an_entry_have_a_plain_symbol():
    left = ub.Beam((0, 0), (1, 0), scenes.SLENDER)
    right = ub.Beam((1, 0), (2, 0), scenes.SLENDER)
    apart = ub.Beam((3, 0), (4, 0), scenes.SLENDER)

    @dataclasses.dataclass(frozen=True, eq=False, repr=False)
    class Own(ub.Joint):
        places: tuple
        shared: tuple
        holders: tuple
        meets: bool

    together, link = (left.end, right.start), ub.RigidLink(right.end, apart.start)
    joints = [Own(together, (0, 1), (), True), Own(link.places, (2,), link.holders, False)]
    scene = ub.Scene([left, right, apart], joints=joints, supports=[ub.Clamped(left.start)])
    undeformed = Stage(scene, 1.0, 0.05).undeformed
    (pin,) = symbols.pins(undeformed)
    np.testing.assert_array_equal(pin.at, (1, 0))
    (rod,) = symbols.rods(undeformed)
    np.testing.assert_array_equal(rod.points, [(2, 0), (3, 0)])


@pytest.mark.parametrize("law", CONNECTOR_LAWS, ids=lambda law: type(law).__name__)
@pytest.mark.parametrize("connect", [ub.Stretch, ub.Turn])
def test_symbols_are_where_their_connector_is(connect, law):
    solution = ub.simulate(slider(connect, law), ub.EnergyMomentum(), t=(0, 0.2), dt=0.1)
    for n in (0, -1):
        points = np.concatenate([s.points for s in symbols.connectors(pose(solution, n))])
        a = np.array([0.0, 0.0])
        b = solution.position(solution.scene.bodies[0].middle)[n]
        if connect is ub.Turn:
            r = np.linalg.norm(points - b, axis=1)
            assert 0.05 < r.max() < 3 * 0.05  # around the pin, in units of the symbols
        else:
            assert has(points, a)
            assert has(points, b)
            x, y = (b - a) / np.linalg.norm(b - a)
            assert np.abs(points @ (-y, x)).max() < 1.2 * 0.05


@pytest.mark.parametrize("connect", [ub.Stretch, ub.Turn])
def test_each_connector_is_drawn(connect):
    """One picture with all laws but the motor, which would hold the motion of a hinge."""
    laws = CONNECTOR_LAWS[1:]
    solution = ub.simulate(slider(connect, *laws), ub.EnergyMomentum(), t=(0, 0.1), dt=0.1)
    drawn = outlines(ub.plot(solution), "connectors")
    assert len(drawn) >= len(laws)


def test_connectors_side_by_side_do_not_cover_each_other():
    laws = [ub.Spring(10.0), ub.Damper(1.0), ub.Spring(5.0)]
    straight = ub.simulate(slider(ub.Stretch, *laws), ub.EnergyMomentum(), t=(0, 0.1), dt=0.1)
    lanes = Stage(straight, 1.0, 0.05).offsets
    assert sorted(lanes.values()) == [-1.6, 0.0, 1.6]
    # Springs are 0.55 to each side, dampers 0.6
    turning = ub.simulate(slider(ub.Turn, *laws), ub.EnergyMomentum(), t=(0, 0.1), dt=0.1)
    assert np.diff(sorted(Stage(turning, 1.0, 0.05).offsets.values())).min() > 1.0


def test_a_slide_of_zero_length_points_along_its_axis():
    body = ub.Body((0.0, 0.0), mass=1.0, inertia=0.1)
    spring = ub.Slide(ub.ground(0, 0), body.middle, ub.Spring(1.0), axis=(1, 0))
    rail = ub.Prismatic(ub.ground(0, 0), body.middle, axis=(1, 0))
    scene = ub.Scene(bodies=[body], joints=[rail], connectors=[spring])
    solution = ub.simulate(scene, ub.EnergyMomentum(), t=(0, 0.1), dt=0.1)
    *_, zigzag = (s.points for s in symbols.connectors(pose(solution, 0)))
    # 0.2 m long, but for the ends that lead around the rail on the same line
    np.testing.assert_allclose(zigzag[[0, -1], 0], (-0.188, -0.012), atol=1e-12)
    assert zigzag[0, 1] == pytest.approx(zigzag[-1, 1])
    assert 0.05 < np.ptp(zigzag[:, 1]) < 0.1


@pytest.mark.parametrize(
    ("free", "bars", "extent"),
    [("N", 2, (1.8, 1.2)), ("V", 2, (1.2, 1.8)), ("NV", 4, (1.8, 1.2)), ("M", 0, None)],
)
def test_releases_show_what_is_free(free, bars, extent):
    left = ub.Beam((0, 0), (1, 0), scenes.SLENDER, cells=2)
    right = ub.Beam((1, 0), (2, 0), scenes.SLENDER, cells=2)
    joint = ub.Release(left.end, right.start, free=free)
    supports = [ub.Clamped(left.start), ub.Clamped(right.end)]
    scene = ub.Scene([left, right], joints=[joint], supports=supports)
    solution = ub.simulate(scene, ub.Static(), t=(0, 1), dt=1)
    strokes, pins = list(symbols.rails(pose(solution))), list(symbols.pins(pose(solution)))
    assert len(strokes) == bars
    if extent is None:
        assert pins[0].turns
    else:
        points = np.concatenate([s.points for s in strokes])
        np.testing.assert_allclose(np.ptp(points, axis=0), 0.05 * np.array(extent), atol=1e-12)
        np.testing.assert_allclose(points.mean(axis=0), (1, 0), atol=1e-12)
        assert not pins


def test_beams_and_bodies_in_one_picture():
    beam = ub.Beam((0, 0), (1, 0), scenes.SLENDER, cells=2)
    hub = ub.Body((1.2, 0.1), mass=1.0, inertia=0.1)
    bead = ub.Body((2.0, 0.0), mass=1.0, inertia=0.1)
    far = ub.Body((0.5, 0.5), mass=1.0, inertia=0.1)
    joints = [
        ub.Rigid(beam.end, hub.at(1, 0), multipliers=True),
        ub.Guided(bead.middle, lambda s: (2.0 + s, s * s)),
        ub.RigidLink(beam.at(0.5), far.middle),
    ]
    scene = ub.Scene(
        [beam],
        bodies=[hub, bead, far],
        joints=joints,
        supports=[ub.Clamped(beam.start)],
        loads=[ub.PointLoad(bead.middle, force=(1.0, 0.3)), ub.Gravity()],
    )
    solution = ub.simulate(scene, ub.EnergyMomentum(), t=(0, 0.2), dt=0.02)
    figure = ub.plot(solution)
    corner, at = solution.position(beam.end)[-1], solution.position(bead.middle)
    np.testing.assert_allclose(middles(figure, "pins", INK), [corner], atol=1e-12)
    np.testing.assert_allclose(middles(figure, "pins", WHITE), [at[-1]], atol=1e-12)
    curve = next(symbols.rails(pose(solution))).points
    np.testing.assert_allclose(curve[:, 1], (curve[:, 0] - 2.0) ** 2, atol=1e-12)
    assert curve[:, 0].min() < at[:, 0].min() < at[:, 0].max() < curve[:, 0].max()
    (link,) = symbols.rods(pose(solution))
    ends = [solution.position(p)[-1] for p in joints[2].places]
    np.testing.assert_allclose(link.points, ends, atol=1e-12)
    assert link.weight > 4.0


def test_slide_is_drawn_along_its_axis():
    beam = ub.Beam((0, 0), (2, 0), scenes.SLENDER)
    stop = ub.Slide(ub.ground(2.4, 0.5), beam.end, ub.Stop(1e3, high=0.3), axis=(0, 1))
    scene = ub.Scene(beams=[beam], supports=[ub.Clamped(beam.start)], connectors=[stop])
    undeformed = Stage(scene, 1.0, 0.05).undeformed
    across, *glyph = symbols.connectors(undeformed)
    np.testing.assert_allclose(across.points, [(2.4, 0.0), (2.0, 0.0)], atol=1e-12)
    x, y = np.concatenate([stroke.points for stroke in glyph]).T
    assert np.abs(x - 2.4).max() < 0.05  # a symbol wide
    np.testing.assert_allclose((y.min(), y.max()), (0.0, 0.5), atol=1e-12)


def test_shapes_of_bodies(engine):
    figure = ub.plot(engine, "shapes", count=3)
    assert len(outlines(figure, "moving", FILLED)) == 0  # each in the colour of its time
    assert len(outlines(figure, "moving")) == 3 * (2 + 1)  # bodies and a rod
    assert figure.axes[0].get_xlim()[1] > 4.5


def test_damage_and_dissipation_without_beams(engine):
    solution = ub.simulate(
        slider(ub.Stretch, ub.Damper(1.0)), ub.EnergyMomentum(), t=(0, 0.2), dt=0.1
    )
    drawn = {x.get_label(): x.get_ydata() for x in ub.plot(solution, "dissipation").axes[0].lines}
    assert drawn["supplied"][-1] > 0.0
    (spot,) = symbols.footings(pose(solution))
    assert has(np.array([spot.at]), (0.0, 0.0))
    assert outlines(ub.plot(solution, "damage"), "connectors")
    falling = ub.Scene(bodies=[ub.Body((0, 0), mass=1.0, inertia=0.1)], loads=[ub.Gravity()])
    with pytest.raises(ub.ArgumentError, match="neither beams nor connectors"):
        ub.plot(ub.simulate(falling, ub.EnergyMomentum(), t=(0, 0.1), dt=0.1), "dissipation")


def test_one_body_alone():
    falling = ub.Scene(bodies=[ub.Body((0, 0), mass=1.0, inertia=0.1)], loads=[ub.Gravity()])
    solution = ub.simulate(falling, ub.EnergyMomentum(), t=(0, 1.0), dt=0.1)
    for n in (0, -1):  # a scene without any size; and one that has fallen 5 m
        axes = ub.plot(solution, n=n).axes[0]
        (outline,) = outlines(axes.figure, "bodies", FILLED)
        (x, y), r = solution.position(falling.bodies[0].middle)[n], np.ptp(outline[:, 0]) / 2
        np.testing.assert_allclose(np.linalg.norm(outline - (x, y), axis=1), r, rtol=1e-12)
        low, high = axes.get_ylim()
        assert low < y - r < y + r < high


def test_history_of_a_point_of_a_body(engine):
    point = engine.scene.bodies[0].at(0.6, 0.4)
    (_, line) = ub.plot(engine, "history", point, component="u").axes[0].lines
    np.testing.assert_array_equal(line.get_ydata(), engine.displacement(point)[:, 0])


def test_symbols_of_supports_stand_away_from_the_beam():
    beam = ub.Beam((0, 0), (0, 2), scenes.SLENDER)
    assert support_direction(ub.Pinned(beam.start), 0.0) == pytest.approx(0.0)  # beneath
    assert support_direction(ub.Pinned(beam.end), 0.0) == pytest.approx(np.pi)  # above
    assert support_direction(ub.Clamped(beam.start), 0.1) == pytest.approx(0.1)
    level = ub.Beam((0, 0), (2, 0), scenes.SLENDER)
    wall = ub.Roller(level.end, along=(0, 1))  # beyond the end: its foot points to +x
    assert np.sin(support_direction(wall, 0.0)) == pytest.approx(1.0)


@pytest.mark.parametrize(
    ("call", "message"),
    [
        (lambda s: ub.plot(s, "Q"), "quantity = 'Q' of a Solution is not one of shape, "),
        (lambda s: ub.plot(s, n=3), "n = 3: the solution kept 3 times; give -3 to 2"),
        (lambda s: ub.plot(s, magnify=0), "magnify = 0 must be positive"),
        (lambda s: ub.plot(s, "shapes", count=0), "count = 0 must be at least 1"),
        (lambda s: ub.plot(s, "shapes", 8), "for so many shapes give count=8"),
        (lambda s: ub.plot(s, "history", s.scene.beams[0].end, component="w"), "component = 'w'"),
        (lambda s: ub.plot(s, "history", s.scene.beams[0].end, component="du/dt"), "static"),
        (lambda s: ub.render(s, "a.jpg"), r"a.jpg: the name must end in .png"),
        (lambda s: ub.render(s, "nowhere/a.png"), "no directory nowhere"),
        (lambda s: ub.render(s, "a.png", quantity="K"), "quantity = 'K' is not one of"),
        (lambda s: ub.render(s, "a.png", n=7), "n = 7"),
        (lambda s: ub.render(s, "a.png", thickness=-1), "thickness = -1 must be positive"),
        (lambda s: ub.render(s, "a.png", size=(800, 0)), "size = 0 must be at least"),
        (lambda s: ub.render(s, "a.png", camera="front"), "camera = 'front' is not a Camera"),
        (lambda s: ub.animate(s, "a.gif", progress=2), "progress = 2 must be True or False"),
        (lambda s: ub.animate(s, "a.avi"), "must end in .gif or .mp4"),
        (lambda s: ub.animate(s, "a.gif", fps=0), "fps = 0 must be positive"),
        (lambda s: ub.animate(s, "a.gif", seconds=0), "seconds = 0 must be positive"),
    ],
)
def test_refused(portal, call, message):
    with pytest.raises(ub.ArgumentError) as caught:
        call(portal)
    assert message in str(caught.value)


# -- PyVista, without a screen -----------------------------------------------------------------


@pytest.fixture
def no_screen(monkeypatch):
    pyvista = pytest.importorskip("pyvista")
    if tuple(pyvista.vtk_version_info) < (9, 4) and shutil.which("Xvfb") is None:
        pytest.skip("neither Xvfb nor a VTK that draws without a screen")
    monkeypatch.delenv("DISPLAY", raising=False)
    yield
    assert "DISPLAY" not in os.environ


@pytest.mark.usefixtures("no_screen")
@pytest.mark.parametrize("color", ["M", "rotation"])
def test_render(swing, tmp_path, color):
    from matplotlib.image import imread

    path = tmp_path / "swing.png"
    ub.render(swing, path, quantity=color, thickness=20, size=(320, 200))
    assert path.exists() == FIRST
    if FIRST:
        picture = imread(path)
        assert picture.shape[:2] == (200, 320)
        # Neither the colour bar nor the time: what is left is the frame.
        assert np.count_nonzero(picture[30:160, :, :3].min(axis=-1) < 0.8) > 300


@pytest.mark.usefixtures("no_screen")
@pytest.mark.parametrize("degree", [1, 3])
@pytest.mark.parametrize("color", ["M", "rotation"])
def test_hinges_and_inner_nodes_are_rendered(tmp_path, color, degree):
    """The vertices of a beam are not one after the other then."""
    from matplotlib.image import imread

    section = ub.Section(EA=1e6, GA=1e6, EI=1e3)
    beam = ub.Beam((0, 0), (2, 0), section, cells=4, hinges={0.5: ub.Softening(50.0, 20.0)})
    force = ub.PointLoad(beam.end, force=(0, -40), amplitude=ub.ramp(1.0))
    scene = ub.Scene([beam], supports=[ub.Clamped(beam.start)], loads=[force])
    mesh = ub.Mesh(degree=degree)
    solution = ub.simulate(scene, ub.Static(), t=(0, 1), dt=1.0, mesh=mesh, progress=False)
    path = tmp_path / "hinged.png"
    ub.render(solution, path, quantity=color, size=(320, 200))
    assert path.exists() == FIRST
    if FIRST:
        assert np.count_nonzero(imread(path)[30:160, :, :3].min(axis=-1) < 0.8) > 300


def frames_of(film):
    """Images of a GIF, (n, height, width, 3), and their durations in ms."""
    from PIL import Image, ImageSequence

    with Image.open(film) as gif:
        shown = [
            (np.asarray(f.convert("RGB")), f.info["duration"]) for f in ImageSequence.Iterator(gif)
        ]
    images, durations = zip(*shown, strict=True)
    return np.array(images), list(durations)


@pytest.mark.usefixtures("no_screen")
def test_front_camera_follows_a_place(tmp_path):
    bar = ub.Section(EA=1e4, GA=1e4, EI=10.0, rhoA=1.0, rhoI=1e-3)
    beam = ub.Beam((0, 0), (1, 0), bar)
    scene = ub.Scene(beams=[beam], initial=[ub.Velocity([beam], linear=(0.0, 3.0))])
    flight = ub.simulate(scene, ub.EnergyMomentum(), t=(0, 1), dt=0.25)
    camera = ub.Camera((0, 0, -1), follow=beam.at(0.5), width=2.0)
    film = ub.animate(
        flight, tmp_path / "flight.gif", fps=4, seconds=1, thickness=3, camera=camera,
        size=(400, 200),
    )  # fmt: skip
    assert os.fspath(film) == str(tmp_path / "flight.gif")
    if FIRST:
        for frame in frames_of(film)[0]:
            # The beam is half as wide as the picture, and in the middle of it.
            dark = np.flatnonzero(frame[60:140].min(axis=(0, 2)) < 240)
            np.testing.assert_allclose([dark[0], dark[-1]], [100, 300], atol=3)
        assert film._repr_html_().startswith('<img alt="flight"')


@pytest.mark.usefixtures("no_screen")
def test_camera_sees_the_whole_motion_and_stands_still(swing, tmp_path):
    path = tmp_path / "swing.gif"
    ub.animate(swing, path, fps=10, seconds=0.5, quantity="N", magnify=3, size=(240, 160))
    assert path.exists() == FIRST
    if FIRST:
        frames, durations = frames_of(path)
        assert durations == [100] * 5
        assert frames.shape[:3] == (5, 160, 240)
        middle = frames[:, 25:130].astype(float).mean(axis=-1)
        assert np.abs(middle[-1] - middle[0]).max() > 50  # it moves
        edge = np.concatenate([middle[:, :, :2], middle[:, :, -2:]], axis=2)
        assert edge.min() > 240  # and stays within the picture
        bar = frames[:, 150:].astype(float)
        assert np.abs(bar - bar[0]).max() < 40  # one scale of colours; GIF has 256 of them


@pytest.mark.usefixtures("no_screen")
def test_film_without_beams(engine, tmp_path):
    path = tmp_path / "engine.gif"
    ub.animate(engine, path, fps=10, seconds=0.4, size=(320, 160))
    assert path.exists() == FIRST
    if FIRST:
        frames = frames_of(path)[0].astype(float).mean(axis=-1)[:, 25:]
        assert len(frames) == 4
        assert np.count_nonzero(frames[0] < 200) > 500  # bodies, and all that is on them
        assert np.count_nonzero(np.abs(frames[-1] - frames[0]) > 50) > 100  # they move
        edge = np.concatenate([frames[:, :, :2], frames[:, :, -2:]], axis=2)
        assert edge.min() > 240  # and stay within the picture


def images(count):
    return iter(np.full((count, 15, 21, 3), 200, np.uint8))


def test_mp4_by_ffmpeg(tmp_path):
    try:
        films.write_mp4(tmp_path / "a.mp4", images(3), fps=10)
    except ImportError as error:
        pytest.skip(str(error))
    film = ub.Film(tmp_path / "a.mp4")
    with open(film, "rb") as file:
        assert file.read(12)[4:8] == b"ftyp"
    assert '<video controls loop style="max-width: 100%" src="data:video/mp4;base64,AAAA' in (
        film._repr_html_()
    )


def test_message_of_ffmpeg_is_passed_on(tmp_path, monkeypatch):
    program = tmp_path / "ffmpeg"
    program.write_text("#!/bin/sh\necho no such codec >&2\nexit 3\n")
    program.chmod(0o755)
    monkeypatch.setattr(films, "_ffmpeg", lambda: str(program))
    with pytest.raises(RuntimeError, match="ffmpeg: no such codec"):
        films.write_mp4(tmp_path / "a.mp4", images(2000), fps=10)


def test_interrupted_film_leaves_no_file(tmp_path, monkeypatch):
    program = tmp_path / "ffmpeg"
    program.write_text('#!/bin/sh\nfor last; do :; done\ncat > "$last"\n')
    program.chmod(0o755)
    monkeypatch.setattr(films, "_ffmpeg", lambda: str(program))

    def interrupted():
        yield from images(3)
        raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        films.write_mp4(tmp_path / "a.mp4", interrupted(), fps=10)
    assert not (tmp_path / "a.mp4").exists()


@pytest.mark.skipif(not FIRST, reason="only the first process makes pictures of bodies")
@pytest.mark.parametrize(
    ("missing", "path", "message"),
    [
        ("pyvista", "a.gif", r"pip install ufl_beam\[view\]"),
        ("imageio_ffmpeg", "a.mp4", "pip install imageio-ffmpeg, or: apt-get install ffmpeg"),
    ],
)
@pytest.mark.usefixtures("no_screen")
def test_missing_package_is_named(portal, tmp_path, monkeypatch, missing, path, message):
    monkeypatch.setitem(sys.modules, missing, None)
    monkeypatch.setattr(shutil, "which", lambda name: None)
    with pytest.raises(ImportError, match=message):
        ub.animate(portal, tmp_path / path)
    assert not (tmp_path / path).exists()


@pytest.mark.skipif(not FIRST, reason="only the first process makes pictures of bodies")
def test_missing_screen_is_no_abort(portal, tmp_path, monkeypatch):
    pyvista = pytest.importorskip("pyvista")
    monkeypatch.setattr(pyvista, "vtk_version_info", (9, 3, 0))
    monkeypatch.delenv("DISPLAY", raising=False)
    monkeypatch.setattr(shutil, "which", lambda name: None)
    with pytest.raises(RuntimeError, match="apt-get install xvfb"):
        ub.render(portal, tmp_path / "a.png")
