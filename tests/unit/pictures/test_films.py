# SPDX-License-Identifier: MIT
"""Pictures and films by PyVista: what they show, without a screen."""

import os
import shutil
import sys

import numpy as np
import pytest
from drawn import FIRST, static
from scenes import clamped

import ufl_beam as ub
from ufl_beam.plotting import films

on_first = pytest.mark.skipif(not FIRST, reason="only the first process makes pictures of bodies")


@pytest.fixture
def no_screen(monkeypatch):
    pyvista = pytest.importorskip("pyvista")
    if tuple(pyvista.vtk_version_info) < (9, 4) and shutil.which("Xvfb") is None:
        pytest.skip("neither Xvfb nor a VTK that draws without a screen")
    monkeypatch.delenv("DISPLAY", raising=False)
    yield
    assert "DISPLAY" not in os.environ


@pytest.mark.usefixtures("no_screen")
@pytest.mark.parametrize(("degree", "color"), [(None, "M"), (1, "rotation"), (3, "M")])
def test_a_frame_is_rendered(swing, tmp_path, degree, color):
    """With hinges and inner nodes the vertices of a beam are not one after the other."""
    from matplotlib.image import imread

    if degree is None:
        solution = swing
    else:
        section = ub.Section(EA=1e6, GA=1e6, EI=1e3)
        beam = ub.Beam((0, 0), (2, 0), section, cells=4, hinges={0.5: ub.Softening(50.0, 20.0)})
        force = ub.PointLoad(beam.end, force=(0, -40), amplitude=ub.ramp(1.0))
        solution = static(clamped(beam, loads=[force]), mesh=ub.Mesh(degree=degree))
    path = tmp_path / "frame.png"
    ub.render(solution, path, quantity=color, thickness=20, size=(320, 200))
    assert path.exists() == FIRST
    if FIRST:
        picture = imread(path)
        assert picture.shape[:2] == (200, 320)
        # Between the time and the bar of colours is the frame
        assert np.count_nonzero(picture[30:160, :, :3].min(axis=-1) < 0.8) > 300


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
def test_a_front_camera_follows_a_place(tmp_path):
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
@pytest.mark.parametrize(
    ("name", "height", "options"),
    [("swing", 130, {"quantity": "N", "magnify": 3}), ("engine", 160, {})],
)
def test_a_camera_sees_the_whole_motion_and_stands_still(request, tmp_path, name, height, options):
    """Of beams, and of bodies without beams."""
    path = tmp_path / "film.gif"
    run = request.getfixturevalue(name)
    ub.animate(run, path, fps=10, seconds=0.4, size=(320, 160), **options)
    assert path.exists() == FIRST
    if FIRST:
        frames, durations = frames_of(path)
        assert durations == [100] * 4
        assert frames.shape[:3] == (4, 160, 320)
        seen = frames[:, 25:height].astype(float).mean(axis=-1)
        assert np.count_nonzero(seen[0] < 200) > 100
        assert np.abs(seen[-1] - seen[0]).max() > 50  # it moves
        edge = np.concatenate([seen[:, :, :2], seen[:, :, -2:]], axis=2)
        assert edge.min() > 240  # and stays within the picture
        bar = frames[:, 150:].astype(float)
        # One scale of colours; GIF has 256 of them
        assert name == "engine" or np.abs(bar - bar[0]).max() < 40


def images(count):
    return iter(np.full((count, 15, 21, 3), 200, np.uint8))


def test_ffmpeg_writes_mp4(tmp_path):
    try:
        films.write_mp4(tmp_path / "a.mp4", images(3), fps=10)
    except ImportError as error:
        pytest.skip(str(error))
    film = ub.Film(tmp_path / "a.mp4")
    with open(film, "rb") as file:
        assert file.read(12)[4:8] == b"ftyp"
    start = '<video controls loop style="max-width: 100%" src="data:video/mp4;base64,AAAA'
    assert start in film._repr_html_()


@pytest.fixture
def ffmpeg(tmp_path, monkeypatch):
    """File of a script that runs instead of ffmpeg."""
    program = tmp_path / "ffmpeg"
    program.touch(0o755)
    monkeypatch.setitem(sys.modules, "imageio_ffmpeg", None)
    monkeypatch.setenv("PATH", f"{tmp_path}:{os.environ['PATH']}")
    return program


def test_the_message_of_ffmpeg_is_passed_on(tmp_path, ffmpeg):
    ffmpeg.write_text("#!/bin/sh\necho no such codec >&2\nexit 3\n")
    with pytest.raises(RuntimeError, match="ffmpeg: no such codec"):
        films.write_mp4(tmp_path / "a.mp4", images(2000), fps=10)


def test_an_interrupted_film_leaves_no_file(tmp_path, ffmpeg):
    ffmpeg.write_text('#!/bin/sh\nfor last; do :; done\ncat > "$last"\n')

    def interrupted():
        yield from images(3)
        raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        films.write_mp4(tmp_path / "a.mp4", interrupted(), fps=10)
    assert not (tmp_path / "a.mp4").exists()


@on_first
@pytest.mark.usefixtures("no_screen")
@pytest.mark.parametrize(
    ("missing", "name", "message"),
    [
        ("pyvista", "a.gif", r"pip install ufl_beam\[view\]"),
        ("imageio_ffmpeg", "a.mp4", "pip install imageio-ffmpeg, or: apt-get install ffmpeg"),
    ],
)
def test_a_missing_package_is_named(portal, tmp_path, monkeypatch, missing, name, message):
    monkeypatch.setitem(sys.modules, missing, None)
    monkeypatch.setattr(shutil, "which", lambda name: None)
    with pytest.raises(ImportError, match=message):
        ub.animate(portal, tmp_path / name)
    assert not (tmp_path / name).exists()


@on_first
def test_a_missing_screen_is_an_error(portal, tmp_path, monkeypatch):
    pyvista = pytest.importorskip("pyvista")
    monkeypatch.setattr(pyvista, "vtk_version_info", (9, 3, 0))
    monkeypatch.delenv("DISPLAY", raising=False)
    monkeypatch.setattr(shutil, "which", lambda name: None)
    with pytest.raises(RuntimeError, match="apt-get install xvfb"):
        ub.render(portal, tmp_path / "a.png")
