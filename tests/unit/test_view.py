"""Pictures: what is in them, that they need no screen, and what is refused."""

import os
import shutil
import sys

from mpi4py import MPI

import numpy as np
import pytest
import scenes

import ufl_beam as ub
from ufl_beam.view import support_direction, with_unit

FIRST = MPI.COMM_WORLD.rank == 0
INDEX = {"N": 0, "V": 1, "M": 2}
UNIT = {"N": "N", "V": "N", "M": "N m"}


@pytest.fixture(scope="module")
def portal():
    return ub.simulate(scenes.portal(), ub.Static(), t=(0, 1), dt=0.5)


@pytest.fixture(scope="module")
def swing():
    return ub.simulate(scenes.swing(), ub.Midpoint(0.01, 0.01), t=(0, 0.1), dt=5e-3)


def forces(solution, what):
    return [solution.section_forces(b)[:, INDEX[what]] for b in solution.scene.beams]


def texts(figure):
    return {text.get_text() for text in figure.axes[0].texts}


# -- Matplotlib --------------------------------------------------------------------------------


def test_shape_draws_the_frame_where_it_is(swing):
    axes = ub.plot(swing).axes[0]
    scene = swing.scene
    # Undeformed and deformed axes; then one line with a symbol each.
    symbols = len(scene.supports) + len(scene.joints) + len(scene.masses)
    assert len(axes.lines) == 2 * len(scene.beams) + symbols
    for line, beam in zip(axes.lines[len(scene.beams) :], scene.beams, strict=False):
        np.testing.assert_array_equal(line.get_xydata(), swing.shape(beam))
    assert axes.get_aspect() == 1.0
    assert (axes.get_xlabel(), axes.get_ylabel()) == ("x (m)", "y (m)")
    assert axes.get_title(loc="left") == "shape at t = 0.1 s"
    assert not axes.patches


@pytest.mark.parametrize("what", ["N", "V", "M"])
def test_extreme_values_are_those_of_the_solution(portal, what):
    values = np.concatenate(forces(portal, what))
    expected = {with_unit(values.max(), UNIT[what])} if values.max() > 0 else set()
    expected |= {with_unit(values.min(), UNIT[what])} if values.min() < 0 else set()
    figure = ub.plot(portal, what)
    assert texts(figure) == expected
    assert f" {what} at t = 1 s" in figure.axes[0].get_title(loc="left")


@pytest.mark.parametrize("what", ["N", "V", "M"])
def test_an_area_for_each_run_of_one_sign(portal, what):
    runs = sum(1 + np.count_nonzero(np.diff(f > 0)) for f in forces(portal, what))
    assert len(ub.plot(portal, what).axes[0].patches) == runs


def test_ordinates_are_in_proportion_to_the_values(portal):
    # A patch of one beam: axis start, two points a cell, axis back.  The roof is nearly horizontal,
    # its displacement at this load some millimetres: 1 % of the ordinates.
    roof = portal.scene.beams[1]
    values = portal.section_forces(roof)[:, INDEX["N"]]
    patches = ub.plot(portal, "N").axes[0].patches
    (outline,) = [p.get_xy() for p in patches if np.ptp(p.get_xy()[:, 0]) > 5.5]
    tips = outline[1 : 1 + 2 * len(values)].reshape(-1, 2, 2).mean(axis=1)
    ends = portal.shape(roof)
    heights = tips[:, 1] - (ends[1:, 1] + ends[:-1, 1]) / 2
    np.testing.assert_allclose(heights / heights[0], values / values[0], rtol=0.01)


def test_moments_stand_on_the_side_in_tension():
    for a, b in (((0, 0), (1, 0)), ((1, 0), (0, 0))):
        beam = ub.Beam(a, b, scenes.SLENDER, cells=2)
        left, right = (beam.start, beam.end) if a == (0, 0) else (beam.end, beam.start)
        force = 1e-3 * scenes.SLENDER.EI
        load = ub.PointLoad(right, force=(0, -force))
        scene = ub.Scene([beam], supports=[ub.Clamped(left)], loads=[load])
        solution = ub.simulate(scene, ub.Static(), t=(0, 1), dt=1)
        (area,) = ub.plot(solution, "M").axes[0].patches
        assert area.get_xy()[:, 1].max() > 0.05  # the upper fibre of a cantilever pulled down


def test_no_diagram_where_there_is_no_force(swing):
    figure = ub.plot(swing, "M", n=0)
    assert not figure.axes[0].patches
    assert not texts(figure)


def test_magnified(portal):
    axes = ub.plot(portal, magnify=10).axes[0]
    roof = portal.scene.beams[1]
    drawn = axes.lines[len(portal.scene.beams) + 1].get_xydata()
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
    figure = ub.plot_shapes(swing, count=5)
    axes, bar = figure.axes
    scene = swing.scene
    symbols = len(scene.supports) + 5 * len(scene.masses)
    assert len(axes.lines) == 6 * len(scene.beams) + symbols
    assert bar.get_ylabel() == "time t (s)"
    np.testing.assert_allclose(bar.get_ylim(), (0, 0.1))


def test_shapes_at_the_nearest_kept_times(swing):
    axes = ub.plot_shapes(swing, [0.0519, 0.0]).axes[0]
    number = len(swing.scene.beams)
    # Undeformed, then t = 0, then t = 0.05, which is step 10; a mass after the beams of each.
    last = axes.lines[2 * number + 1].get_xydata()
    np.testing.assert_array_equal(last, swing.shape(swing.scene.beams[0], 10))


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
    figure = ub.plot_history(swing, places, component=component)
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
    (_, line) = ub.plot_history(portal, place).axes[0].lines
    np.testing.assert_array_equal(line.get_ydata(), portal.displacement(place)[:, 1])


def test_energy(swing):
    ledger, check = ub.plot_energy(swing).axes
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
        (lambda s: ub.plot(s, "Q"), 'what = \'Q\' is not one of "shape", "N", "V", "M"'),
        (lambda s: ub.plot(s, n=3), "n = 3: the solution kept 3 times; give -3 to 2"),
        (lambda s: ub.plot(s, magnify=0), "magnify = 0 must be positive"),
        (lambda s: ub.plot_shapes(s, count=0), "count = 0 must be at least 1"),
        (lambda s: ub.plot_history(s, s.scene.beams[0].end, component="w"), "component = 'w'"),
        (lambda s: ub.plot_history(s, s.scene.beams[0].end, component="du/dt"), "static"),
        (lambda s: ub.render(s, "a.jpg"), r"a.jpg: the name must end in .png"),
        (lambda s: ub.render(s, "nowhere/a.png"), "no directory nowhere"),
        (lambda s: ub.render(s, "a.png", color="K"), "color = 'K' is not one of"),
        (lambda s: ub.render(s, "a.png", n=7), "n = 7"),
        (lambda s: ub.render(s, "a.png", thickness=-1), "thickness = -1 must be positive"),
        (lambda s: ub.render(s, "a.png", size=(800, 0)), "size = 0 must be at least"),
        (lambda s: ub.animate(s, "a.avi"), "must end in .gif or .mp4"),
        (lambda s: ub.animate(s, "a.gif", fps=0), "fps = 0 must be positive"),
        (lambda s: ub.animate(s, "a.gif", seconds=0), "seconds = 0 must be positive"),
    ],
)
def test_refused(portal, call, message):
    with pytest.raises(ub.SceneError) as caught:
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
    ub.render(swing, path, color=color, thickness=20, size=(320, 200))
    assert path.exists() == FIRST
    if FIRST:
        picture = imread(path)
        assert picture.shape[:2] == (200, 320)
        # Neither the colour bar nor the time: what is left is the frame.
        assert np.count_nonzero(picture[30:160, :, :3].min(axis=-1) < 0.8) > 300


@pytest.mark.usefixtures("no_screen")
def test_camera_sees_the_whole_motion_and_stands_still(swing, tmp_path):
    imageio = pytest.importorskip("imageio.v3")
    path = tmp_path / "swing.gif"
    ub.animate(swing, path, fps=10, seconds=0.5, color="N", magnify=3, size=(240, 160))
    assert path.exists() == FIRST
    if FIRST:
        frames = imageio.imread(path)
        assert frames.shape[:3] == (5, 160, 240)
        middle = frames[:, 25:130].astype(float).mean(axis=-1)
        assert np.abs(middle[-1] - middle[0]).max() > 50  # it moves
        edge = np.concatenate([middle[:, :, :2], middle[:, :, -2:]], axis=2)
        assert edge.min() > 240  # and stays within the picture
        bar = frames[:, 150:].astype(float)
        assert np.abs(bar - bar[0]).max() < 40  # one scale of colours; GIF has 256 of them


@pytest.mark.skipif(not FIRST, reason="only the first process makes pictures of bodies")
@pytest.mark.parametrize(
    ("missing", "path", "message"),
    [
        ("pyvista", "a.gif", r"pip install ufl_beam\[view\]"),
        ("imageio_ffmpeg", "a.mp4", "pip install imageio-ffmpeg"),
    ],
)
@pytest.mark.usefixtures("no_screen")
def test_missing_package_is_named(portal, tmp_path, monkeypatch, missing, path, message):
    monkeypatch.setitem(sys.modules, missing, None)
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
