# SPDX-License-Identifier: MIT
"""Solid pictures and films of a solution, by PyVista."""

from __future__ import annotations

import gc
from collections.abc import Collection, Generator
from contextlib import closing
from pathlib import Path
from typing import Any

import numpy as np

from ufl_beam.errors import SceneError, require_kind, require_number, require_switch
from ufl_beam.parallel import active_comm, progress_bar
from ufl_beam.plotting.camera import Camera
from ufl_beam.plotting.drawing import evenly
from ufl_beam.plotting.films import WRITERS, Film
from ufl_beam.plotting.screen import screen
from ufl_beam.plotting.solids import QUANTITIES, Solids
from ufl_beam.plotting.style import decimal_prefix, magnified
from ufl_beam.simulation.solution import Solution

CAMERA = Camera()  # stands still and sees the whole motion


def render(
    solution: Solution,
    path: str | Path,
    *,
    n: int = -1,
    color: str = "M",
    thickness: float = 1.0,
    magnify: float = 1.0,
    camera: Camera = CAMERA,
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
        camera: Where the camera looks, and the place that it follows.
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
    require_kind(camera, Camera, "render: camera")
    camera.origin(solids.stage([n]).pose(n))
    if active_comm().rank == 0:
        with closing(_film(solids, [n], camera)) as frames:
            imsave(path, next(frames))


def animate(
    solution: Solution,
    path: str | Path,
    *,
    fps: float = 25.0,
    seconds: float = 4.0,
    color: str = "M",
    thickness: float = 1.0,
    magnify: float = 1.0,
    camera: Camera = CAMERA,
    size: tuple[int, int] = (960, 544),
    progress: bool = True,
) -> Film:
    """Write an animation of the whole motion as GIF or MP4, and return it as a film to show.

    Colours have the same meaning in all frames.  No screen is needed: for VTK before 9.4 an Xvfb is
    started for the time being.

    Args:
        solution: Solution to draw.
        path: File, ending in ``.gif``, or in ``.mp4`` if there is ffmpeg, as in imageio-ffmpeg.
        fps: Frames per second; browsers show at most 50 of a GIF.
        seconds: Duration of the film, whatever the duration of the motion; s.
        color: Quantity that colours the beams: "N", "V", "M" or "rotation".
        thickness: Factor on the depth of the sections.
        magnify: Factor on the displacements.
        camera: Where the camera looks, and the place that it follows.
        size: Width and height; pixels.
        progress: Show a progress bar in a terminal or notebook.

    Returns:
        The film: a path that a notebook plays.

    Raises:
        SceneError: A wrong argument; the message says which.
        ImportError: PyVista is missing, or ffmpeg for MP4; the message says how to install it.
        RuntimeError: There is neither a screen nor Xvfb, or ffmpeg failed.

    Example:
        >>> ub.animate(solution, "beam.gif", fps=5, seconds=0.4, size=(320, 192))
        Film('beam.gif')
    """
    solids = Solids(solution, color, thickness, magnify, size)
    path = _require_suffix(path, WRITERS)
    require_kind(camera, Camera, "animate: camera")
    require_switch(progress, "animate: progress")
    require_number(fps, "animate: fps", positive=True)
    require_number(seconds, "animate: seconds", positive=True)
    shown = evenly(solution, max(1, round(fps * seconds)))
    camera.origin(solids.stage(shown).undeformed)
    if active_comm().rank == 0:
        with closing(_film(solids, shown, camera)) as frames:
            about = {"iterable": frames, "total": len(shown), "unit": "frame"}
            bar = progress_bar(progress, active_comm(), **about)
            WRITERS[path.suffix.lower()](path, iter(bar), fps)
    return Film(path)


def _film(solids: Solids, shown: list[int], camera: Camera) -> Generator[Any, None, None]:
    """Images (height, width, 3) of these states, one after the other."""
    try:
        import pyvista
    except ImportError as error:
        raise ImportError(
            "pictures of solid bodies need PyVista; install it by: pip install ufl_beam[view]"
        ) from error
    with screen(pyvista):
        plotter = pyvista.Plotter(off_screen=True, window_size=list(solids.size))
        try:
            yield from _frames(pyvista.merge, plotter, solids, shown, camera)
        finally:
            plotter.close()
            del plotter
            # A window that is left to the collector would outlive its X server.
            gc.collect()


def _frames(
    merge: Any, plotter: Any, solids: Solids, shown: list[int], camera: Camera
) -> Generator[Any, None, None]:
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
    box = solids.bounds([pose.points() - camera.origin(pose) for pose in stage.poses()])
    plotter.set_background("white")
    plotter.enable_anti_aliasing("msaa")
    if solution.scene.beams:
        plotter.add_mesh(solids.axes(), color="#A0A0A0", reset_camera=False)
        plotter.add_text(f"{quantity} ({prefix}{unit})", position=(0.02, 0.025), **text)
    for n in shown:
        plotter.suppress_rendering = True
        pose = stage.pose(n)
        camera.aim(plotter, box, camera.origin(pose), solids.size)
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


def _require_suffix(path: str | Path, suffixes: Collection[str]) -> Path:
    """Return the path of a picture, or raise :class:`SceneError`."""
    path = Path(path)
    if path.suffix.lower() not in suffixes:
        raise SceneError(f"{path}: the name must end in {' or '.join(suffixes)}")
    if not path.parent.is_dir():
        raise SceneError(f"{path}: there is no directory {path.parent}; make it first")
    return path
