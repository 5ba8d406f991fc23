# SPDX-License-Identifier: MIT
"""Solid pictures and films of a solution, by PyVista, and a screen where VTK needs one."""

from __future__ import annotations

import gc
import importlib
import os
import shutil
import subprocess
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import numpy as np

from ufl_beam.arrays import Array
from ufl_beam.errors import SceneError, require_number
from ufl_beam.parallel import active_comm
from ufl_beam.plotting.drawing import evenly
from ufl_beam.plotting.solids import QUANTITIES, Solids
from ufl_beam.plotting.style import decimal_prefix, magnified
from ufl_beam.simulation.solution import Solution

# Where the camera looks from, and what is up in the picture; the frame is in the plane of x and y.
_TOWARDS = np.array([-0.20, -0.28, -1.0])
_UP = np.array([0.0, 1.0, 0.0])


def render(
    solution: Solution,
    path: str | Path,
    *,
    n: int = -1,
    color: str = "M",
    thickness: float = 1.0,
    magnify: float = 1.0,
    size: tuple[int, int] = (1600, 900),
) -> None:
    """Write a rendered picture of the frame at the n-th kept time.

    In the plane, beams have the depth of their section; across, they have the same depth, or a
    visible one if they are slender.  Bodies are plates, see :func:`plot`.  Orange pins are hinges
    that have opened.  Needs no screen, see :func:`animate`.

    Args:
        solution: Solution to draw.
        path: File, ending in ``.png``.
        n: Number of the kept time; negative from the end.
        color: Quantity that colours the beams: "N", "V", "M" or "rotation".
        thickness: Factor on the depth of the sections.
        magnify: Factor on the displacements.
        size: Width and height; pixels.

    Raises:
        SceneError: A wrong argument; the message says which.
        ImportError: PyVista is missing.
        RuntimeError: There is neither a screen nor Xvfb.

    Example:
        >>> ub.render(solution, "beam.png", color="M", size=(640, 360))
    """
    from matplotlib.image import imsave

    solids = Solids(solution, color, thickness, magnify, size)
    path = _require_suffix(path, (".png",))
    solids.stage([n]).pose(n)
    if active_comm().rank == 0:
        with _film(solids, [n]) as frames:
            for frame in frames:
                imsave(path, frame)


def animate(
    solution: Solution,
    path: str | Path,
    *,
    fps: float = 25.0,
    seconds: float = 4.0,
    color: str = "M",
    thickness: float = 1.0,
    magnify: float = 1.0,
    size: tuple[int, int] = (960, 544),
) -> None:
    """Write an animation of the whole motion as GIF or MP4.

    The camera is fixed and sees the whole motion; colours have the same meaning in all frames.  No
    screen is needed: for VTK before 9.4 an Xvfb is started for the time being.

    Args:
        solution: Solution to draw.
        path: File, ending in ``.gif``, or in ``.mp4`` if imageio-ffmpeg is installed.
        fps: Frames per second.
        seconds: Duration of the film, whatever the duration of the motion; s.
        color: Quantity that colours the beams: "N", "V", "M" or "rotation".
        thickness: Factor on the depth of the sections.
        magnify: Factor on the displacements.
        size: Width and height; pixels.

    Raises:
        SceneError: A wrong argument; the message says which.
        ImportError: PyVista, imageio or imageio-ffmpeg is missing.
        RuntimeError: There is neither a screen nor Xvfb.

    Example:
        >>> ub.animate(solution, "beam.gif", fps=5, seconds=0.4, size=(320, 192))
    """
    solids = Solids(solution, color, thickness, magnify, size)
    path = _require_suffix(path, (".gif", ".mp4"))
    require_number(fps, "animate: fps", positive=True)
    require_number(seconds, "animate: seconds", positive=True)
    shown = evenly(solution, max(1, round(fps * seconds)))
    if active_comm().rank == 0:
        with _film(solids, shown) as frames, _film_writer(path, fps) as film:
            for frame in frames:
                film.append_data(frame)


@contextmanager
def _film(solids: Solids, shown: list[int]) -> Iterator[Iterator[Any]]:
    """The frames of these states, one after the other, as images (height, width, 3)."""
    pyvista = _optional("pyvista", "ufl_beam[view]", "pictures of solid bodies need PyVista")
    with _screen(pyvista):
        plotter = pyvista.Plotter(off_screen=True, window_size=list(solids.size))
        try:
            yield _frames(pyvista.merge, plotter, solids, shown)
        finally:
            plotter.close()
            del plotter
            # A window that is left to the collector would outlive its X server.
            gc.collect()


def _frames(merge: Any, plotter: Any, solids: Solids, shown: list[int]) -> Iterator[Any]:
    solution, stage = solids.solution, solids.stage(shown)
    largest = max(float(np.abs(solids.values(n)).max(initial=0.0)) for n in set(shown))
    factor, prefix = decimal_prefix(largest)
    limit, (quantity, unit) = largest / factor or 1.0, QUANTITIES[solids.color]
    height = solids.size[1]
    text = {"font_size": height // 40, "color": "black", "viewport": True}
    bar = {
        "title": "values", "color": "black", "n_labels": 5, "fmt": "%.3g", "width": 0.48,
        "height": 0.09, "position_x": 0.46, "position_y": 0.01, "label_font_size": height // 36,
    }  # fmt: skip
    _set_camera(plotter, solids.bounds(stage), solids.size)
    plotter.set_background("white")
    plotter.enable_anti_aliasing("msaa")
    if solution.scene.beams:
        plotter.add_mesh(solids.axes(), color="#A0A0A0", reset_camera=False)
        plotter.add_text(f"{quantity} ({prefix}{unit})", position=(0.02, 0.025), **text)
    for n in shown:
        plotter.suppress_rendering = True
        pose = stage.pose(n)
        # Meshes and texts replace those of the same name.
        if solution.scene.beams:
            plotter.add_mesh(
                solids.beams(n, pose, factor), scalars="values", clim=(-limit, limit),
                cmap="coolwarm", name="beams", scalar_bar_args=bar, reset_camera=False,
                ambient=0.4, diffuse=0.7,
            )  # fmt: skip
            plotter.scalar_bars["values"].SetTitle("")  # VTK would set it over the numbers.
        for color, meshes in solids.others(n, pose).items():
            look = {"color": color, "name": color, "ambient": 0.25}
            plotter.add_mesh(merge(meshes), reset_camera=False, **look)
        time = f"{solution.parameter.at(solution.times[n], '.3f')}{magnified(solids.magnify)}"
        plotter.add_text(time, position=(0.02, 0.93), name="time", **text)
        plotter.reset_camera_clipping_range()
        plotter.suppress_rendering = False
        plotter.render()
        yield plotter.screenshot(return_img=True)


def _set_camera(plotter: Any, bounds: Array, size: tuple[int, int]) -> None:
    """Fit the box into the middle of the picture, above the colour bar and below the time."""
    towards = _TOWARDS / np.linalg.norm(_TOWARDS)
    right = np.cross(towards, _UP)
    right /= np.linalg.norm(right)
    up = np.cross(right, towards)
    corners = np.stack(np.meshgrid(*bounds.T), axis=-1).reshape(-1, 3)
    width, height = np.ptp(corners @ right), np.ptp(corners @ up)
    scale = max(height / 0.76, width / 0.96 * size[1] / size[0]) / 2
    focus = bounds.mean(axis=0) - 0.08 * scale * up
    plotter.camera.parallel_projection = True
    plotter.camera.parallel_scale = scale
    plotter.camera.focal_point = focus
    plotter.camera.position = focus - 4 * np.linalg.norm(np.ptp(bounds, axis=0)) * towards
    plotter.camera.up = up
    plotter.camera_set = True


def _optional(module: str, package: str, why: str) -> Any:
    """Import a module that need not be installed, or say how to install it."""
    try:
        return importlib.import_module(module)
    except ImportError as error:
        raise ImportError(f"{why}; install it by: pip install {package}") from error


def _require_suffix(path: str | Path, suffixes: tuple[str, ...]) -> Path:
    """Return the path of a picture, or raise :class:`SceneError`."""
    path = Path(path)
    if path.suffix.lower() not in suffixes:
        raise SceneError(f"{path}: the name must end in {' or '.join(suffixes)}")
    if not path.parent.is_dir():
        raise SceneError(f"{path}: there is no directory {path.parent}; make it first")
    return path


def _film_writer(path: Path, fps: float) -> Any:
    """Open a GIF or MP4 with so many frames per second."""
    imageio = _optional("imageio.v2", "ufl_beam[view]", "films need imageio")
    if path.suffix.lower() == ".gif":
        return imageio.get_writer(path, mode="I", duration=1000.0 / fps, loop=0)
    _optional("imageio_ffmpeg", "imageio-ffmpeg", "MP4 needs imageio-ffmpeg, GIF does not")
    return imageio.get_writer(path, fps=fps, macro_block_size=2)


@contextmanager
def _screen(pyvista: Any) -> Iterator[None]:
    """Provide a screen if VTK needs one and there is none: without, it ends the interpreter."""
    needed = sys.platform == "linux" and tuple(pyvista.vtk_version_info) < (9, 4)
    if not needed or os.environ.get("DISPLAY"):
        yield
        return
    if shutil.which("Xvfb") is None:
        raise RuntimeError(
            "PyVista with this VTK needs a screen, and DISPLAY is not set; install Xvfb "
            "(apt-get install xvfb) or VTK 9.4 or newer"
        )
    reader, writer = os.pipe()
    server = subprocess.Popen(
        ["Xvfb", "-displayfd", str(writer), "-screen", "0", "1280x1024x24", "-nolisten", "tcp"],
        pass_fds=[writer],
        start_new_session=True,  # Ctrl-C is for this process; it still needs its screen to end
        stdin=subprocess.DEVNULL,
        stdout=subprocess.DEVNULL,
        stderr=subprocess.DEVNULL,
    )
    os.close(writer)
    try:
        with os.fdopen(reader) as answer:
            number = answer.readline().strip()
        if not number:
            raise RuntimeError("Xvfb did not start; try: Xvfb -displayfd 1")
        os.environ["DISPLAY"] = f":{number}"
        yield
    finally:
        os.environ.pop("DISPLAY", None)
        server.terminate()
        server.wait()
