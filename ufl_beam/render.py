"""Solid pictures and films of a solution, by PyVista: what is built, and how it gets on a screen."""

from __future__ import annotations

import gc
import os
import shutil
import subprocess
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from mpi4py import MPI

from ufl_beam.beams import Beam
from ufl_beam.compat import Array
from ufl_beam.errors import SceneError, require_number
from ufl_beam.solution import Solution
from ufl_beam.view import RESULTANTS, moved_points, nearest, require_choice, support_direction

# Where the camera looks from, and what is up in the picture; the frame is in the plane of x and y.
_TOWARDS = np.array([-0.30, -0.36, -1.0])
_UP = np.array([0.0, 1.0, 0.0])

_QUANTITIES = {**RESULTANTS, "rotation": ("rotation", "rad")}


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
    """Write a picture of the frame at the n-th kept time as a solid body.

    In the plane, beams have the depth of their section; across, they have the same depth, or a
    visible one if they are slender.  Needs no screen, see :func:`animate`.

    Args:
        solution: What to show.
        path: File, ending in ``.png``.
        n: Number of the kept time; negative from the end.
        color: What colours the beams: "N", "V", "M" or "rotation".
        thickness: Factor on the depth of the sections.
        magnify: Factor on the displacements.
        size: Width and height; pixels.

    Raises:
        SceneError: A wrong argument; the message says which.
        ImportError: PyVista is missing.
        RuntimeError: There is neither a screen nor Xvfb.
    """
    look = _Look(solution, color, thickness, magnify, size)
    path = _require_suffix(path, (".png",))
    moved_points(solution, n, magnify)
    if MPI.COMM_WORLD.rank == 0:
        with look.film([n]) as frames:
            for frame in frames:
                _save_png(path, frame)


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
    """Write a film of the whole motion.

    The camera stands still and sees all of the motion; colours mean the same in all frames.  Works
    without a screen: where VTK cannot (before 9.4), an Xvfb is started for the time being.

    Args:
        solution: What to show.
        path: File, ending in ``.gif``, or in ``.mp4`` if imageio-ffmpeg is installed.
        fps: Frames per second.
        seconds: Duration of the film, whatever the duration of the motion; s.
        color: What colours the beams: "N", "V", "M" or "rotation".
        thickness: Factor on the depth of the sections.
        magnify: Factor on the displacements.
        size: Width and height; pixels.

    Raises:
        SceneError: A wrong argument; the message says which.
        ImportError: PyVista, imageio or imageio-ffmpeg is missing.
        RuntimeError: There is neither a screen nor Xvfb.
    """
    look = _Look(solution, color, thickness, magnify, size)
    path = _require_suffix(path, (".gif", ".mp4"))
    require_number(fps, "animate: fps", positive=True)
    require_number(seconds, "animate: seconds", positive=True)
    kept = solution.times
    count = max(1, round(fps * seconds))
    shown = nearest(kept, np.linspace(kept[0], kept[-1], count))
    if MPI.COMM_WORLD.rank == 0:
        with _writer(path, fps) as film, look.film(shown) as frames:
            for frame in frames:
                film.append_data(frame)


# -- the body ----------------------------------------------------------------------------------


@dataclass(frozen=True)
class _Look:
    """How a solution is shown; checks what the user asked for.

    Attributes:
        solution: What is shown.
        color: What colours the beams.
        thickness: Factor on the depth of the sections.
        magnify: Factor on the displacements.
        size: Width and height; pixels.
    """

    solution: Solution
    color: str
    thickness: float
    magnify: float
    size: tuple[int, int]

    def __post_init__(self) -> None:
        require_choice(self.color, _QUANTITIES, "color")
        require_number(self.thickness, "thickness", positive=True)
        require_number(self.magnify, "magnify", positive=True)
        for pixels in self.size:
            require_number(pixels, "size", at_least=16)

    @property
    def symbol(self) -> float:
        """Size of the symbols of supports and masses; m."""
        return 0.022 * self.solution.scene.size

    def depth(self, beam: Beam) -> float:
        """Depth in the plane; m."""
        return self.thickness * beam.section.depth

    def width(self, beam: Beam) -> float:
        """Width across the plane; m."""
        return max(self.depth(beam), 0.04 * self.solution.scene.size)

    def values(self, beam: Beam, n: int) -> Array:
        """What colours a beam: (num_cells,) or, for the rotation, (num_vertices,)."""
        if self.color == "rotation":
            dofs = self.solution.grid.dofs[self.solution.grid.vertices_of(beam), 2]
            return np.asarray(self.solution.q[n][dofs])
        return self.solution.section_forces(beam, n)[:, list(RESULTANTS).index(self.color)]

    def corners(self, beam: Beam, n: int, points: Array) -> Array:
        """Corners of all cross-sections of a beam; (4 num_vertices, 3); m.

        Cross-sections turn with ψ; at a corner of the axis they halve the angle.
        """
        grid = self.solution.grid
        vertices = grid.vertices_of(beam)
        along = np.diff(grid.points[vertices], axis=0)
        along /= np.linalg.norm(along, axis=1)[:, None]
        mean = np.concatenate([along[:1], along[1:] + along[:-1], along[-1:]])
        angle = np.arctan2(mean[:, 1], mean[:, 0]) + self.solution.q[n][grid.dofs[vertices, 2]]
        left = self.depth(beam) / 2 * np.column_stack([-np.sin(angle), np.cos(angle)])
        width = self.width(beam) / 2
        sides = ((1, 1), (-1, 1), (-1, -1), (1, -1))
        planes = [np.insert(points[vertices] + a * left, 2, b * width, axis=1) for a, b in sides]
        return np.stack(planes, axis=1).reshape(-1, 3)

    def bounds(self, shown: list[int]) -> Array:
        """Lower and upper corner of the box around everything in these states; (2, 3); m."""
        grid, margin = self.solution.grid, 2.2 * self.symbol
        shapes = [grid.points, *(moved_points(self.solution, n, self.magnify) for n in set(shown))]
        xy = np.concatenate(shapes)
        half = max(max(self.width(b), self.depth(b)) for b in self.solution.scene.beams) / 2
        low, high = xy.min(axis=0) - margin, xy.max(axis=0) + margin
        return np.array([[*low, -half], [*high, half]])

    @contextmanager
    def film(self, shown: list[int]) -> Iterator[Iterator[Any]]:
        """The frames of these states, one after the other, as images (height, width, 3)."""
        pyvista = _import("pyvista", "ufl_beam[view]", "pictures of solid bodies need PyVista")
        with _screen(pyvista):
            plotter = pyvista.Plotter(off_screen=True, window_size=list(self.size))
            try:
                yield self._frames(pyvista, plotter, shown)
            finally:
                plotter.close()
                del plotter
                # A window that is left to the collector would outlive its X server.
                gc.collect()

    def _frames(self, pyvista: Any, plotter: Any, shown: list[int]) -> Iterator[Any]:
        beams = self.solution.scene.beams
        states = set(shown)
        largest = max(float(np.abs(self.values(b, n)).max()) for b in beams for n in states)
        _set_camera(plotter, self.bounds(shown), self.size)
        plotter.set_background("white")
        _add_axes(pyvista, plotter, self)
        for n in shown:
            _add_body(pyvista, plotter, self, n, largest or 1.0)
            plotter.render()
            yield plotter.screenshot(None, return_img=True)
