# SPDX-License-Identifier: MIT
"""Diagrams, shapes, histories and energies: values, units, labels, and refused arguments."""

import math
from itertools import pairwise

import numpy as np
import pytest
import scenes
from drawn import FIRST, boxes_of, middles, outlines, require_apart, static, storeys, texts
from helpers import raises, run

import ufl_beam as ub
import ufl_beam.structures as st
from ufl_beam.plotting.style import BLUE, RED, WHITE, decimal_prefix, number, with_unit

UNIT = {"N": "N", "V": "N", "M": "N m"}


@pytest.fixture(scope="module")
def diagrams(portal):
    """Pictures of the portal by the section force."""
    return {what: ub.plot(portal, what) for what in UNIT}


def values_of(solution, what):
    """What diagrams show along each beam."""
    return [getattr(solution.diagram(beam), what) for beam in solution.scene.beams]


def chains(axes):
    """Lines of a picture, each in its pieces, without symbols."""
    lines = [x.get_xydata() for x in axes.lines if x.get_linestyle() != "None"]
    ends = [np.flatnonzero(np.isnan(x[:, 0])) for x in lines]
    return [
        [c[np.isfinite(c[:, 0])] for c in np.split(x, k)] for x, k in zip(lines, ends, strict=True)
    ]


def areas_of(figure):
    """Outlines of the areas of a diagram, each closed; m."""
    return outlines(figure, RED) + outlines(figure, BLUE)


def test_the_shape_has_all_beams_where_they_are(swing):
    figure = ub.plot(swing)
    axes, scene = figure.axes[0], swing.scene
    undeformed, _, deformed, *_ = chains(axes)
    assert len(undeformed) == len(scene.beams)
    for chain, beam in zip(deformed, scene.beams, strict=True):
        np.testing.assert_array_equal(chain, swing.shape(beam))
    assert len(outlines(figure, "pins", fill=WHITE)) == len(scene.joints)
    at = [swing.position(mass.place)[-1] for mass in scene.masses]
    np.testing.assert_allclose(middles(figure, "masses"), at, atol=1e-12)
    assert axes.get_aspect() == 1.0
    assert (axes.get_xlabel(), axes.get_ylabel()) == ("x (m)", "y (m)")
    assert axes.get_title(loc="left") == "shape at t = 0.1 s"
    assert not areas_of(figure)
    assert not [*areas_of(ub.plot(swing, "M", n=0)), *texts(figure)]  # there is no force yet


def in_a_row(count):
    """Picture of beams in a line of 1 m, rigidly joined."""
    ends = np.linspace(0.0, 1.0, count + 1)
    beams = [ub.Beam((a, 0), (b, 0), scenes.SLENDER) for a, b in pairwise(ends)]
    supports = [ub.Clamped(beams[0].start), *(ub.Roller(beam.end) for beam in beams)]
    return ub.plot(static(scenes.rigid_chain(beams, supports=supports)))


def test_many_beams_have_few_artists_and_small_pins():
    """Beams of 0.33 and 0.017 m; 20 000 beams would take minutes as as many artists."""
    few, many = in_a_row(3), in_a_row(60)
    assert len(few.axes[0].get_children()) == len(many.axes[0].get_children())
    long, short = (np.ptp(outlines(figure, "pins")[0], axis=0) for figure in (few, many))
    np.testing.assert_allclose(short, 0.3 * long)


@pytest.mark.parametrize("what", UNIT)
def test_extreme_values_are_those_of_the_solution(portal, diagrams, what):
    """And an area for each run of one sign."""
    values = np.concatenate(values_of(portal, what))
    factor, prefix = decimal_prefix(np.abs(values).max())
    extremes = (values.min(),) if what == "N" else (values.max(), values.min())
    assert (values.max() < 0.0) == (what == "N")  # all beams are in compression
    figure = diagrams[what]
    bold = {text.get_text() for text in figure.axes[0].texts if text.get_weight() == "bold"}
    assert bold == {number(x / factor) for x in extremes}
    assert set(texts(figure)) <= {number(x / factor) for x in values}
    title = figure.axes[0].get_title(loc="left")
    assert f" {what} ({prefix}{UNIT[what]}) at t = 1 s" in title.replace("\N{NO-BREAK SPACE}", " ")
    runs = sum(1 + np.count_nonzero(np.diff(f > 0)) for f in values_of(portal, what))
    assert len(areas_of(figure)) == runs


def simple_beam(cells, direction):
    """A beam of 6 m on two supports under a line load of 10 kN/m across it; turned by an angle."""
    x, y = math.cos(direction), math.sin(direction)
    section = ub.Section(EA=1e10, GA=1e10, EI=1e9)
    beam = ub.Beam((0, 0), (6 * x, 6 * y), section, cells=cells)
    supports = [ub.Pinned(beam.start), ub.Roller(beam.end, along=(x, y))]
    load = ub.LineLoad(beam, force=(10e3 * y, -10e3 * x))
    return static(ub.Scene([beam], supports=supports, loads=[load]))


@pytest.mark.parametrize("direction", [0.0, 2.0])
def test_moments_under_a_line_load_are_a_parabola(direction):
    """[closed] w l²/8 = 45 kN m, a parabola without steps, on the side in tension.

    The deflection is 2e-5 of l.
    """
    solution = simple_beam(4, direction)
    figure = ub.plot(solution, "M")
    assert texts(figure) == ["45"]
    (area,) = areas_of(figure)
    x = np.repeat(np.linspace(0.0, 6.0, 33), [1, *(1, 1, 1, 1, 1, 1, 1, 2) * 3, *[1] * 8])
    along = np.array([math.cos(direction), math.sin(direction)])
    tips = area[1 : 1 + len(x)]
    np.testing.assert_allclose(tips @ along, x, atol=1e-3)
    depth = tips @ (along[1], -along[0])
    parabola = 4 * (x / 6) * (1 - x / 6)
    np.testing.assert_allclose(depth, depth.max() * parabola, atol=1e-3)


def test_forty_labels_do_not_overlap():
    figure = ub.plot(static(storeys(3, 4)), "M")
    boxes = boxes_of(figure)
    assert len(boxes) >= 40
    require_apart(boxes, figure.bbox)
    # Lines that lead to labels cross no other label
    for mark, own in zip(figure.axes[0].texts, boxes, strict=True):
        if mark.arrow_patch is not None:
            line = mark.arrow_patch.get_path().transformed(mark.arrow_patch.get_transform())
            assert not any(line.intersects_bbox(box) for box in boxes if box is not own)


def test_the_legend_names_the_signs_in_the_picture(portal, diagrams):
    """The roof of the portal is in compression, and so are its posts."""
    (legend,) = diagrams["N"].legends
    assert [text.get_text() for text in legend.get_texts()] == ["N < 0: compression"]
    (legend,) = diagrams["M"].legends
    assert [text.get_text()[:5] for text in legend.get_texts()] == ["M > 0", "M < 0"]
    assert not ub.plot(portal).legends


def test_envelopes_are_two_diagrams():
    """Each area has ordinates of one of both, across the axis: none leads from one to the other."""
    section = ub.Section(EA=1e6, GA=1e6, EI=1e4, rhoA=1.0, rhoI=0.01)
    beam, extremes = ub.Beam((0, 0), (6, 0), section, cells=8), ub.Extremes()
    shake = ub.LineLoad(beam, force=(0.0, 1.0), amplitude=lambda t: math.sin(7 * t))
    scene = scenes.clamped(beam, ub.Clamped(beam.end), loads=[shake])
    solution = run(scene, dt=0.05, record=extremes)
    found, x = extremes.section_forces(beam), 6 * solution.diagram(beam, points=2).s
    drawn = [outline[:-1] for outline in areas_of(ub.plot(extremes, "V"))]
    scale = None
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
    static(scenes.cantilever(cells=1, force=(0.0, 1.0)), record=extremes)
    assert len(areas_of(ub.plot(extremes, "V"))) == 1


def test_a_saved_picture_has_the_size_of_its_figure(diagrams, tmp_path):
    from matplotlib.image import imread

    figure = diagrams["M"]
    figure.savefig(tmp_path / "portal.png")
    assert (tmp_path / "portal.png").exists() == FIRST
    if FIRST:
        size = (figure.get_size_inches() * figure.dpi)[::-1]
        picture = imread(tmp_path / "portal.png")
        np.testing.assert_allclose(picture.shape[:2], size, rtol=0, atol=1)
        assert picture[..., :3].std() > 0.01


def test_shapes_have_a_bar_of_times(swing):
    """Given times are those of the nearest kept states."""
    figure, scene = ub.plot(swing, "shapes", count=5), swing.scene
    axes, bar = figure.axes
    assert sum(len(chain) == len(scene.beams) for chain in chains(axes)) == 6
    assert len(outlines(figure, "masses")) == 5 * len(scene.masses)
    assert bar.get_ylabel() == "time t (s)"
    np.testing.assert_allclose(bar.get_ylim(), (0, 0.1))
    axes = ub.plot(swing, "shapes", [0.0519, 0.0]).axes[0]
    # Undeformed, then t = 0, then t = 0.05, which is step 10
    _, _, last = [chain for chain in chains(axes) if len(chain) == len(scene.beams)]
    np.testing.assert_array_equal(last[0], swing.shape(scene.beams[0], 10))


def test_a_history_has_a_line_for_each_place(swing, engine):
    (beam, *_), (wheel, _) = swing.scene.beams, engine.scene.bodies
    for solution, component, column, label, places in (
        (swing, "u", 0, "displacement u (m)", [beam.start, beam.at(0.3)]),
        (swing, "dv/dt", 1, "velocity dv/dt (m/s)", [beam.start]),
        (engine, "psi", 2, "rotation ψ (rad)", [wheel.middle]),
    ):
        axes = ub.plot(solution, "history", places, component=component).axes[0]
        motion = solution.velocity if "/" in component else solution.displacement
        for line, place in zip(axes.lines[1:], places, strict=True):
            np.testing.assert_array_equal(line.get_xdata(), solution.times)
            np.testing.assert_array_equal(line.get_ydata(), motion(place)[:, column])
            assert line.get_label() == str(place)
        assert (axes.get_xlabel(), axes.get_ylabel()) == ("time t (s)", label)
    (_, line) = ub.plot(engine, "history", wheel.middle).axes[0].lines
    np.testing.assert_array_equal(line.get_ydata(), engine.displacement(wheel.middle)[:, 1])


def test_the_ledger_is_drawn_with_its_error(swing):
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


def test_a_ground_motion_is_drawn_with_its_integrals():
    motion = st.GroundMotion(0.5, [0.0, 2.0, -1.0], "quake")
    figure = ub.plot(motion)
    for axes, values in zip(figure.axes, motion.histories[1:], strict=True):
        np.testing.assert_array_equal(axes.lines[-1].get_ydata(), values)
    units = [axes.get_ylabel().split()[-1] for axes in figure.axes]
    assert units == ["(m/s²)", "(m/s)", "(m)"]
    assert figure.axes[0].get_title("left") == "quake"


def test_spectra_share_axes():
    motion = st.GroundMotion(0.5, [0.0, 2.0, -1.0])
    elastic = st.response_spectrum(motion, [0.5, 1.0])
    figure = ub.plot(elastic)
    ub.plot(st.response_spectrum(motion, [0.5, 1.0], ductility=2.0), ax=figure.axes[0])
    first, _ = figure.axes[0].lines
    np.testing.assert_array_equal(first.get_ydata(), elastic.pseudo_acceleration)
    assert figure.axes[0].get_ylabel() == "pseudo-acceleration (m/s²)"
    assert ub.plot(elastic, "displacement").axes[0].get_ylabel() == "displacement (m)"
    assert ub.plot(elastic, "ductility").axes[0].get_ylabel() == "ductility"


def test_values_have_a_decimal_prefix():
    values = {0.0: "0 N m", -12345.0: "−12.3 kN m", 999.9: "1 kN m", 0.0158: "15.8 mN m"}
    assert [with_unit(value, "N m") for value in values] == [*values.values()]


ELSEWHERE = ub.Camera(follow=ub.Body((0, 0), mass=1.0, inertia=1.0).middle)


def end(s):
    return s.scene.beams[0].end


@pytest.mark.parametrize(
    ("call", "message"),
    [
        (lambda s: ub.plot(s, "Q"), "plot: quantity = 'Q' of a Solution is not one of shape, "),
        (lambda s: ub.plot(s, n=3), "n = 3: the solution kept 3 times; give -3 to 2"),
        (lambda s: ub.plot(s, "M", n="end"), "plot: n = 'end'"),
        (lambda s: ub.plot(s, magnify=0), "magnify = 0 must be positive"),
        (lambda s: ub.plot(s, "shapes", count=0), "count = 0 must be at least 1"),
        (lambda s: ub.plot(s, "shapes", 8), "for a number of shapes give count=8"),
        (lambda s: ub.plot(s, "shapes", times="all"), "plot: times = 'all' must be numbers"),
        (lambda s: ub.plot(s, "shapes", times=[]), "plot: times is empty"),
        (lambda s: ub.plot(ub.modes(s.scene, 1), numbers=[]), "plot: numbers is empty"),
        (lambda s: ub.plot(s, "history", 3), "plot: places = 3"),
        (lambda s: ub.plot(s, "history", "end"), "plot: places = 'end' must be a list"),
        (lambda s: ub.plot(s, "history", []), "plot: places is empty"),
        (lambda s: ub.plot(s, "history", end(s), component="w"), "component = 'w'"),
        (lambda s: ub.plot(s, "history", end(s), component="du/dt"), "static"),
        (lambda s: ub.render(s, "a.jpg"), "a.jpg: the name must end in .png"),
        (lambda s: ub.render(s, "nowhere/a.png"), "no directory nowhere"),
        (lambda s: ub.render(s, "a.png", quantity="K"), "quantity = 'K' is not one of"),
        (lambda s: ub.render(s, "a.png", n=7), "n = 7"),
        (lambda s: ub.render(s, "a.png", thickness=-1), "thickness = -1 must be positive"),
        (lambda s: ub.render(s, "a.png", size=(800, 0)), "size = 0 must be at least"),
        (lambda s: ub.render(s, "a.png", camera="front"), "camera = 'front' is not a Camera"),
        (lambda s: ub.render(s, "a.png", magnify=0), "magnify = 0 must be positive"),
        (lambda s: ub.animate(s, "a.gif", camera=ELSEWHERE), "is not in the scene"),
        (lambda s: ub.animate(s, "a.gif", progress=2), "progress = 2 must be True or False"),
        (lambda s: ub.animate(s, "a.avi"), "must end in .gif or .mp4"),
        (lambda s: ub.animate(s, "a.gif", fps=0), "fps = 0 must be positive"),
        (lambda s: ub.animate(s, "a.gif", seconds=0), "seconds = 0 must be positive"),
    ],
)
def test_wrong_arguments_of_pictures_are_refused(portal, call, message):
    with raises(message):
        call(portal)
