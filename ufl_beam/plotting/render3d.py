# SPDX-License-Identifier: MIT
"""Solid pictures and films of a solution, by PyVista: what is built, and on which screen."""

from __future__ import annotations

import gc
import importlib
import math
import os
import shutil
import subprocess
import sys
from collections.abc import Iterable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from ufl_beam.arrays import Array
from ufl_beam.errors import SceneError, require_number
from ufl_beam.model.bodies import Anchor, Member, Place
from ufl_beam.parallel import ours
from ufl_beam.plotting import symbols
from ufl_beam.plotting.connector_glyphs import INK, ORANGE
from ufl_beam.plotting.plots import (
    RESULTANTS,
    decimal_prefix,
    evenly,
    moved_points,
    open_hinges,
    require_choice,
)
from ufl_beam.plotting.scene_layout import Pose, Stage
from ufl_beam.plotting.symbols import FILLED, FRONT, MIDDLE, Pin, Stroke
from ufl_beam.simulation.solution import Solution

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
    """Write a rendered picture of the frame at the n-th kept time.

    In the plane, beams have the depth of their section; across, they have the same depth, or a
    visible one if they are slender.  Bodies are plates, see :func:`plot`.  Orange pins are hinges
    that have opened.  Needs no screen, see :func:`animate`.

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

    Example:
        >>> ub.render(solution, "beam.png", color="M", size=(640, 360))
    """
    from matplotlib.image import imsave

    look = _Look(solution, color, thickness, magnify, size)
    path = _require_suffix(path, (".png",))
    moved_points(solution, n, magnify)
    if ours().rank == 0:
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
    """Write an animation of the whole motion as GIF or MP4.

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

    Example:
        >>> ub.animate(solution, "beam.gif", fps=5, seconds=0.4, size=(320, 192))
    """
    look = _Look(solution, color, thickness, magnify, size)
    path = _require_suffix(path, (".gif", ".mp4"))
    require_number(fps, "animate: fps", positive=True)
    require_number(seconds, "animate: seconds", positive=True)
    shown = evenly(solution, max(1, round(fps * seconds)))
    if ours().rank == 0:
        with look.film(shown) as frames, _writer(path, fps) as film:
            for frame in frames:
                film.append_data(frame)


# -- the body ----------------------------------------------------------------------------------


@dataclass(frozen=True)
class _Look:
    """Options of a picture of a solution, checked.

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
        deepest = max(map(self.depth, self.solution.scene.beams), default=0.0)
        return max(0.022 * self.solution.scene.size, 0.7 * deepest)

    def stage(self, shown: list[int]) -> Stage:
        """Add bodies, joints, connectors and supports."""
        return Stage(self.solution, self.magnify, self.symbol, sorted(set(shown)))

    def depth(self, beam: Member) -> float:
        """Depth in the plane; m."""
        return self.thickness * float(beam.section.depth)

    def width(self, beam: Member) -> float:
        """Width across the plane; m."""
        return max(self.depth(beam), self.least_width)

    @property
    def least_width(self) -> float:
        """Width across the plane of slender beams and of bodies; m."""
        return 0.04 * self.solution.scene.size

    @property
    def widest(self) -> float:
        """Width across the plane of the widest beam, or of bodies; m."""
        return max(map(self.width, self.solution.scene.beams), default=self.least_width)

    def around(self, places: Iterable[Anchor]) -> tuple[float, float]:
        """Depth and width of the thickest beam of some places; m."""
        beams = [place.beam for place in places if isinstance(place, Place)]
        return max(map(self.depth, beams), default=0.0), max(
            map(self.width, beams), default=self.least_width
        )

    def values(self, beam: Member, n: int) -> Array:
        """Return the values of a beam's colours: (num_cells,), of rotations (num_vertices,)."""
        if self.color == "rotation":
            dofs = self.solution.grid.dofs[self.solution.grid.vertices_of(beam), 2]
            return np.asarray(self.solution.q[n][dofs])
        return self.solution.section_forces(beam, n)[:, list(RESULTANTS).index(self.color)]

    def corners(self, beam: Member, n: int, points: Array) -> Array:
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
        stage = self.stage(shown)
        poses = [stage.undeformed, *(stage.pose(n) for n in set(shown))]
        xy = np.concatenate([*shapes, *(pose.points() for pose in poses)])
        half = max(self.widest, *map(self.depth, self.solution.scene.beams), 0.0) / 2
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
        sizes = (float(np.abs(self.values(b, n)).max()) for b in beams for n in set(shown))
        largest = max(sizes, default=0.0)
        stage = self.stage(shown)
        _set_camera(plotter, self.bounds(shown), self.size)
        plotter.set_background("white")
        plotter.enable_anti_aliasing("msaa")
        scaled = f", displacements × {self.magnify:g}" if self.magnify != 1 else ""
        for n in shown:
            plotter.suppress_rendering = True
            points = moved_points(self.solution, n, self.magnify)
            pose = stage.pose(n)
            if beams:
                _add_beams(pyvista, plotter, self, n, points, largest)
            _add_strokes(pyvista, plotter, self, pose)
            _add_fittings(pyvista, plotter, self, pose)
            _add_hinges(pyvista, plotter, self, n, points)
            time = self.solution.parameter.at(self.solution.times[n], ".3f")
            _add_text(plotter, self, f"{time}{scaled}", (0.02, 0.93))
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


def _add(pyvista: Any, plotter: Any, parts: list[Any], color: str, name: str) -> None:
    if parts:
        mesh = pyvista.merge(parts)
        plotter.add_mesh(mesh, color=color, name=name, reset_camera=False, ambient=0.25)


def _extruded(pyvista: Any, outline: Array, low: float, high: float) -> Any:
    """A block between two planes; the outline is closed; m."""
    flat = np.insert(outline[:-1], 2, low, axis=1)
    face = pyvista.PolyData(flat, [len(flat), *range(len(flat))])
    return face.triangulate().extrude((0.0, 0.0, high - low), capping=True)


def _add_strokes(pyvista: Any, plotter: Any, look: _Look, pose: Pose) -> None:
    """Bodies as plates; lines as rods, filled areas as blocks."""
    body, front = look.least_width, 0.7 * look.widest
    found: dict[str, list[Any]] = {}
    lines: dict[tuple[str, float], list[Array]] = {}

    def add(strokes: Iterable[Stroke], half: float) -> None:
        for points, color, weight, fill, layer in strokes:
            base = front if layer == FRONT else half
            low, high = (-half, half) if layer <= MIDDLE else (base, 1.1 * base)
            if fill is not None:
                found.setdefault(fill, []).append(_extruded(pyvista, points, low, high))
            if fill != FILLED:
                z = 0.0 if fill is None and layer <= MIDDLE else high
                lines.setdefault((color, weight), []).append(np.insert(points, 2, z, axis=1))

    add(symbols.bodies(pose), 0.4 * body)
    add(symbols.centres(pose), 0.48 * body)
    add(symbols.rods(pose), 0.1 * body)
    add((*symbols.rails(pose), *symbols.connectors(pose)), 0.45 * body)
    for (color, weight), several in lines.items():
        tubes = _tubes(pyvista, several, weight * look.symbol / 20.0)
        found.setdefault(color, []).append(tubes)
    for color, parts in found.items():
        _add(pyvista, plotter, parts, color, f"strokes {color}")


def _tubes(pyvista: Any, lines: list[Array], radius: float) -> Any:
    """Tubes along lines, made at once: one after the other takes long.

    Each piece between two points is a tube of its own, as tubes get thin at sharp corners.
    """
    starts = np.cumsum([0, *map(len, lines)])
    first = np.delete(np.arange(starts[-1]), starts[1:] - 1)  # all points but the last of each line
    pieces = np.column_stack([np.full(len(first), 2), first, first + 1])
    chains = pyvista.PolyData(np.concatenate(lines), lines=pieces.ravel())
    return chains.tube(radius=radius, n_sides=12)


def _add_fittings(pyvista: Any, plotter: Any, look: _Look, pose: Pose) -> None:
    """Joints as pins across the plane, masses as balls, supports as symbols."""
    solution, symbol = look.solution, look.symbol
    pins = [_cylinder(pyvista, look, pin) for pin in symbols.pins(pose)]
    _add(pyvista, plotter, pins, "#707070", "joints")
    balls = [
        pyvista.Sphere(radius=1.1 * symbol, center=(*pose.at(mass.place), 0.0))
        for mass in solution.scene.masses
    ]
    _add(pyvista, plotter, balls, INK, "masses")
    blocks: dict[str, list[Any]] = {}
    for at, angle, outlines, color, place in symbols.footings(pose):
        half = 0.6 * look.around([place])[1]
        for outline in outlines:
            block = _extruded(pyvista, symbol * np.array(outline), -half, half)
            block = block.rotate_z(math.degrees(angle)).translate((*at, 0.0))
            blocks.setdefault(color, []).append(block)
    for color, parts in blocks.items():
        _add(pyvista, plotter, parts, color, f"supports {color}")


def _cylinder(pyvista: Any, look: _Look, pin: Pin) -> Any:
    depth, width = look.around(pin.places)
    radius = max(depth / 2, (0.4 if pin.turns else 0.0) * look.symbol)
    if not depth:
        radius = 0.4 * look.symbol
    height = width * (1.25 if pin.turns else 1.02)
    center = (*pin.at, 0.0)
    return pyvista.Cylinder(
        center=center, direction=(0, 0, 1), radius=radius, height=height, resolution=32
    )


def _add_hinges(pyvista: Any, plotter: Any, look: _Look, n: int, points: Array) -> None:
    """Open hinges as orange pins."""
    hinges = [
        _cylinder(pyvista, look, Pin(hinge.at, True, (hinge.beam.start,)))
        for hinge in open_hinges(look.solution, n, points)
    ]
    _add(pyvista, plotter, hinges, ORANGE, "hinges")


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
