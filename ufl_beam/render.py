"""Solid pictures and films of a solution, by PyVista: what is built, and on which screen."""

from __future__ import annotations

import gc
import importlib
import math
import os
import shutil
import subprocess
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from mpi4py import MPI

import numpy as np

from ufl_beam.beams import Beam, Place
from ufl_beam.compat import Array
from ufl_beam.errors import SceneError, require_number
from ufl_beam.solution import Solution
from ufl_beam.view import (
    INK,
    ORANGE,
    RESULTANTS,
    decimal_prefix,
    moved_points,
    nearest,
    open_hinges,
    require_choice,
    support_direction,
    support_symbol,
)

# Where the camera looks from, and what is up in the picture; the frame is in the plane of x and y.
_TOWARDS = np.array([-0.20, -0.28, -1.0])
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
    visible one if they are slender.  Orange pins are hinges that have opened.  Needs no screen, see
    :func:`animate`.

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
    from matplotlib.image import imsave

    look = _Look(solution, color, thickness, magnify, size)
    path = _require_suffix(path, (".png",))
    moved_points(solution, n, magnify)
    if MPI.COMM_WORLD.rank == 0:
        with look.film([n]) as frames:
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
        with look.film(shown) as frames, _writer(path, fps) as film:
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
        """Half the size of the symbols of supports and masses; m."""
        deepest = max(self.depth(beam) for beam in self.solution.scene.beams)
        return max(0.022 * self.solution.scene.size, 0.7 * deepest)

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
        largest = max(float(np.abs(self.values(b, n)).max()) for b in beams for n in set(shown))
        _set_camera(plotter, self.bounds(shown), self.size)
        plotter.set_background("white")
        plotter.enable_anti_aliasing("msaa")
        scaled = f", displacements × {self.magnify:g}" if self.magnify != 1 else ""
        for n in shown:
            plotter.suppress_rendering = True
            points = moved_points(self.solution, n, self.magnify)
            _add_beams(pyvista, plotter, self, n, points, largest)
            _add_fittings(pyvista, plotter, self, n, points)
            _add_text(plotter, self, f"t = {self.solution.times[n]:.3f} s{scaled}", (0.02, 0.93))
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


def _add_beams(
    pyvista: Any, plotter: Any, look: _Look, n: int, points: Array, largest: float
) -> None:
    """The beams in colour, the undeformed axes in grey, and the colour bar."""
    quantity, unit = _QUANTITIES[look.color]
    factor, prefix = decimal_prefix(largest)
    limit = largest / factor or 1.0
    title = f"{quantity} {look.color.replace('rotation', '')}".strip() + f" ({prefix}{unit})"
    bar = {
        "title": title, "color": "black", "n_labels": 5, "fmt": "%.3g", "width": 0.48,
        "height": 0.09, "position_x": 0.46, "position_y": 0.01,
        "label_font_size": look.size[1] // 36,
    }  # fmt: skip
    _add_text(plotter, look, title, (0.02, 0.025))
    for i, beam in enumerate(look.solution.scene.beams):
        values = look.values(beam, n) / factor
        corners = look.corners(beam, n, points)
        first = 4 * np.arange(len(corners) // 4 - 1)[:, None]
        cells = {pyvista.CellType.HEXAHEDRON: first + np.arange(8)}
        body = pyvista.UnstructuredGrid(cells, corners)
        if look.color == "rotation":
            body.point_data[title] = np.repeat(values, 4)
        else:
            body.cell_data[title] = values
        plotter.add_mesh(
            body, scalars=title, clim=(-limit, limit), cmap="coolwarm", name=f"beam {i}",
            scalar_bar_args=bar, show_scalar_bar=i == 0, reset_camera=False, ambient=0.4,
            diffuse=0.7,
        )  # fmt: skip
        if i == 0:
            # VTK would set the title over the numbers.
            plotter.scalar_bars[title].SetTitle("")
        axis = look.solution.grid.points[look.solution.grid.vertices_of(beam)]
        line = pyvista.lines_from_points(np.insert(axis, 2, 0.0, axis=1))
        plotter.add_mesh(line, color="#A0A0A0", name=f"axis {i}", reset_camera=False)


def _add_text(plotter: Any, look: _Look, text: str, position: tuple[float, float]) -> None:
    size = look.size[1] // 40
    plotter.add_text(
        text,
        position=position,
        font_size=size,
        color="black",
        name=str(position),
        viewport=True,
    )


def _add_fittings(pyvista: Any, plotter: Any, look: _Look, n: int, points: Array) -> None:
    """Joints and open hinges as pins across the plane, masses as balls, supports as symbols."""
    solution, scene, symbol = look.solution, look.solution.scene, look.symbol

    def add(parts: list[Any], color: str, name: str) -> None:
        if parts:
            mesh = pyvista.merge(parts)
            plotter.add_mesh(mesh, color=color, name=name, reset_camera=False, ambient=0.25)

    def center(place: Place) -> Array:
        return np.append(points[solution.grid.vertex(place)], 0.0)

    pins = []
    for joint in scene.joints:
        beams = [place.beam for place in joint.places]
        turns = 2 not in joint.shared
        radius = max(max(map(look.depth, beams)) / 2, (0.4 if turns else 0.0) * symbol)
        height = max(map(look.width, beams)) * (1.25 if turns else 1.02)
        at = center(joint.places[0])
        pin = {"center": at, "direction": (0, 0, 1), "radius": radius, "height": height}
        pins.append(pyvista.Cylinder(**pin, resolution=32))
    add(pins, "#707070", "joints")
    hinges = []
    for cell in open_hinges(solution, n)[0]:
        beam = scene.beams[solution.grid.beam_of_cell[cell]]
        at = np.append(points[solution.grid.cells[cell]].mean(axis=0), 0.0)
        radius, height = max(look.depth(beam) / 2, 0.4 * symbol), 1.25 * look.width(beam)
        pin = {"center": at, "direction": (0, 0, 1), "radius": radius, "height": height}
        hinges.append(pyvista.Cylinder(**pin, resolution=32))
    add(hinges, ORANGE, "hinges")
    add(
        [pyvista.Sphere(radius=1.1 * symbol, center=center(m.place)) for m in scene.masses],
        INK,
        "masses",
    )
    supports = []
    for support in scene.supports:
        turned = solution.q[n][solution.grid.dofs[solution.grid.vertex(support.place), 2]]
        angle, width = support_direction(support, turned), 1.2 * look.width(support.place.beam)
        for outline in support_symbol(support):
            flat = np.array([[x, y, -0.5 * width / symbol] for x, y in outline[:-1]]) * symbol
            face = pyvista.PolyData(flat, [len(flat), *range(len(flat))])
            block = face.triangulate().extrude((0.0, 0.0, width), capping=True)
            supports.append(block.rotate_z(math.degrees(angle)).translate(center(support.place)))
    add(supports, "#808080", "supports")


# -- files and screens -------------------------------------------------------------------------


def _import(module: str, package: str, why: str) -> Any:
    try:
        return importlib.import_module(module)
    except ImportError as error:
        raise ImportError(f"{why}; install it by: pip install {package}") from error


def _require_suffix(path: str | Path, suffixes: tuple[str, ...]) -> Path:
    path = Path(path)
    if path.suffix.lower() not in suffixes:
        raise SceneError(f"{path}: the name must end in {' or '.join(suffixes)}")
    if not path.parent.is_dir():
        raise SceneError(f"{path}: there is no directory {path.parent}; make it first")
    return path


def _writer(path: Path, fps: float) -> Any:
    imageio = _import("imageio.v2", "ufl_beam[view]", "films need imageio")
    if path.suffix.lower() == ".gif":
        return imageio.get_writer(path, mode="I", duration=1000.0 / fps, loop=0)
    _import("imageio_ffmpeg", "imageio-ffmpeg", "MP4 needs imageio-ffmpeg, GIF does not")
    return imageio.get_writer(path, fps=fps, macro_block_size=2)


@contextmanager
def _screen(pyvista: Any) -> Iterator[None]:
    """A screen, if VTK needs one and there is none: without, it ends the interpreter."""
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
