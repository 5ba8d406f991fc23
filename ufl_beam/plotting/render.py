# SPDX-License-Identifier: MIT
"""Pictures and films of a solution as solids, rendered by PyVista."""

from __future__ import annotations

import gc
from collections import defaultdict
from collections.abc import Collection, Generator, Sequence
from contextlib import closing
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import Annotated, Any

import numpy as np

from ufl_beam.arrays import Array
from ufl_beam.errors import ArgumentError, require_kind, require_number, require_row, require_switch
from ufl_beam.model.bodies import AttachmentPoint, require_place
from ufl_beam.model.records import PositiveOrNone, Record
from ufl_beam.output.paraview_files import in_three
from ufl_beam.parallel import active_comm, progress_bar
from ufl_beam.plotting import style, symbols
from ufl_beam.plotting.films import WRITERS, Film, screen
from ufl_beam.plotting.inelastic_pictures import open_hinges
from ufl_beam.plotting.positions import (
    FROM_A_SIDE,
    UP_IN_SPACE,
    Canvas,
    DeformedShape,
    evenly,
    picture_axes,
    unit_vectors,
)
from ufl_beam.plotting.symbols import FILLED, FRONT, MIDDLE, Stroke, disc
from ufl_beam.simulation.solution import Solution

QUANTITIES = {**{name: style.resultant(name) for name in "NVM"}, "rotation": ("rotation", "rad")}
QUANTITIES_IN_SPACE = {name: style.resultant(name) for name in "NVTM"}
UP = np.array([0.0, 1.0, 0.0])  # upwards in the picture; the scene is in the plane of x and y
FROM_THE_FRONT = (-0.20, -0.28, -1.0)  # view direction
PIN = "#707070"  # colour of joints
SLENDER = 0.012  # least size of a drawn cross-section in space, as a part of the scene's size
ROUND = 20  # number of points of an outline in space from which it is drawn as a ball

HALF_WIDTHS = {
    "bodies": 0.4, "centres": 0.48, "joints": 0.45, "connectors": 0.45, "supports": 0.6,
    "beams": 0.7,
}  # fmt: skip
"""Halves of the widths of symbols, as fractions of the width of beams."""

SQUARE = (1, 1), (-1, 1), (-1, -1), (1, -1)  # corners of a cross-section, as fractions of its size

Direction = tuple[float, float, float]


def _require_direction(value: Any, what: str) -> Direction | None:
    if value is None:
        return None
    direction = require_row(value, what)
    if direction.shape != (3,) or not direction.any():
        raise ArgumentError(f"{what} = {value} must be three numbers (x, y, z), not all zero")
    x, y, z = map(float, direction)
    return x, y, z


@dataclass(frozen=True)
class Camera(Record):
    """Camera of :func:`render` and :func:`animate`, without perspective.

    By default it is fixed and shows the whole motion.

    Attributes:
        direction: View direction; (x, y, z).  For a scene in the plane of x and y, y is upwards in
            the picture, and (0, 0, -1) is the front view.  For a scene in space, z is upwards.
        follow: Place that the camera moves with, so that the place is at rest in the picture.
        width: Width of the picture around the followed place, or around the middle of the motion;
            m.  By default it contains the whole motion.

    Raises:
        ArgumentError: A wrong argument; the message says which.  A picture refuses a direction
            along the axis that is upwards.

    Example:
        >>> front = ub.Camera((0, 0, -1))
        >>> ub.render(solution, "front.png", camera=front, size=(640, 360))
        >>> ub.render(solution, "tip.png", camera=ub.Camera(follow=beam.end, width=0.5))
    """

    _refused = ArgumentError

    direction: Annotated[Direction | None, _require_direction] = None
    follow: Annotated[AttachmentPoint | None, require_place] = None
    width: PositiveOrNone = None

    def axes(self, in_space: bool) -> tuple[Array, Array]:
        """Return the view direction, of length 1, and the direction that is upwards; (3,)."""
        default, up = (FROM_A_SIDE, UP_IN_SPACE) if in_space else (FROM_THE_FRONT, UP)
        direction = np.array(self.direction or default)
        if not np.cross(direction, up).any():
            raise ArgumentError(
                f"Camera: direction = {self.direction} is along {'yz'[in_space]}, which is upwards "
                "in the picture"
            )
        return direction / np.linalg.norm(direction), up

    def aim(self, plotter: Any, box: Array, shape: DeformedShape, size: tuple[int, int]) -> None:
        """Fit a box between the colour bar and the line with the time, or show ``width``.

        Args:
            plotter: Plotter of PyVista.
            box: Lower and upper corner, relative to the followed place; (2, 3); m.
            shape: Shape of the scene with the followed place.
            size: Width and height of the picture; pixels.
        """
        origin = np.zeros(3)
        if self.follow is not None:
            origin[: len(self.follow.point)] = shape.at(self.follow)
        towards, upwards = self.axes(shape.canvas.scene.in_space)
        right, up = picture_axes(towards, upwards)
        middle, aspect = box.mean(axis=0), size[1] / size[0]
        if self.width is None:
            corners = np.stack(np.meshgrid(*box.T), axis=-1).reshape(-1, 3)
            width, height = np.ptp(corners @ right), np.ptp(corners @ up)
            scale = max(height / 0.76, width / 0.96 * aspect) / 2
        else:
            scale = self.width * aspect / 2
            middle = middle if self.follow is None else np.zeros(3)
        focus = origin + middle - 0.08 * scale * up
        plotter.camera.parallel_projection = True
        plotter.camera.parallel_scale = scale
        plotter.camera.focal_point = focus
        plotter.camera.position = focus - 4 * np.linalg.norm(np.ptp(box, axis=0)) * towards
        plotter.camera.up = up
        plotter.camera_set = True


CAMERA = Camera()  # fixed, shows the whole motion


def render(
    solution: Solution,
    path: str | Path,
    *,
    n: int = -1,
    quantity: str = "M",
    thickness: float = 1.0,
    magnify: float = 1.0,
    camera: Camera = CAMERA,
    size: tuple[int, int] = (1600, 900),
) -> None:
    """Write a rendered picture of the scene at the n-th recorded time.

    In the plane, beams have the depth of their section.  Their width is equal to this depth, or
    larger if beams are too slender to be visible.  Bodies are plates around their attachment
    points.  Orange pins mark opened hinges.  No screen is needed, see :func:`animate`.

    Args:
        solution: Solution to draw.
        path: File, ending in ``.png``.
        n: Index of the recorded time; negative from the end.
        quantity: Quantity that colours the beams: "N", "V", "M" or "rotation"; in space "N", "V",
            "T" or "M", where V and M are magnitudes.
        thickness: Factor on the depth of the sections.
        magnify: Factor on the displacements.
        camera: View direction, and the place that the camera follows.
        size: Width and height; pixels.

    Raises:
        ArgumentError: A wrong argument; the message says which.
        ImportError: PyVista is missing.
        RuntimeError: VTK is older than 9.4, and there is neither a screen nor Xvfb.

    Example:
        >>> ub.render(solution, "beam.png", quantity="M", size=(640, 360))
    """
    from matplotlib.image import imsave

    solids = Solids(solution, [n], quantity, thickness, magnify, camera, size)
    path = _require_suffix(path, (".png",))
    if active_comm().rank == 0:
        with closing(_frames(solids)) as frames:
            imsave(path, next(frames))


def animate(
    solution: Solution,
    path: str | Path,
    *,
    fps: float = 25.0,
    seconds: float = 4.0,
    quantity: str = "M",
    thickness: float = 1.0,
    magnify: float = 1.0,
    camera: Camera = CAMERA,
    size: tuple[int, int] = (960, 544),
    progress: bool = True,
) -> Film:
    """Write a film of the whole motion to a GIF or MP4 file.

    All frames have the same colour scale.  No screen is needed: with VTK before 9.4, Xvfb runs
    during the call.

    Args:
        solution: Solution to draw.
        path: File ending in ``.gif``, or in ``.mp4``, which needs ffmpeg (imageio-ffmpeg).
        fps: Frames per second; browsers show at most 50 frames per second of a GIF.
        seconds: Duration of the film, independent of the duration of the motion; s.
        quantity: Quantity that colours the beams: "N", "V", "M" or "rotation"; in space "N", "V",
            "T" or "M", where V and M are magnitudes.
        thickness: Factor on the depth of the sections.
        magnify: Factor on the displacements.
        camera: View direction, and the place that the camera follows.
        size: Width and height; pixels.
        progress: Show a progress bar in a terminal or notebook.

    Returns:
        The film, which is a path and which notebooks play.

    Raises:
        ArgumentError: A wrong argument; the message says which.
        ImportError: PyVista is missing, or ffmpeg for MP4; the message says how to install it.
        RuntimeError: VTK is older than 9.4 without a screen or Xvfb, or ffmpeg failed.

    Example:
        >>> ub.animate(solution, "beam.gif", fps=5, seconds=0.4, size=(320, 192))
        Film('beam.gif')
    """
    path = _require_suffix(path, WRITERS)
    require_switch(progress, "animate: progress")
    require_number(fps, "animate: fps", positive=True)
    require_number(seconds, "animate: seconds", positive=True)
    shown = evenly(solution.progress, max(1, round(fps * seconds)))
    solids = Solids(solution, shown, quantity, thickness, magnify, camera, size)
    if active_comm().rank == 0:
        with closing(_frames(solids)) as frames:
            about = {"iterable": frames, "total": len(shown), "unit": "frame"}
            bar = progress_bar(progress, active_comm(), **about)
            WRITERS[path.suffix.lower()](path, iter(bar), fps)
    return Film(path)


def _frames(solids: Solids) -> Generator[Any, None, None]:
    """Yield images of the shown times; (height, width, 3), np.uint8."""
    try:
        import pyvista
    except ImportError as error:
        raise ImportError(
            "pictures of solid bodies need PyVista; install it by: pip install ufl_beam[view]"
        ) from error
    solution, canvas, size = solids.solution, solids.canvas, solids.size
    numbering, beams = solution.numbering, solution.scene.beams
    largest = max(float(np.abs(solids.values(n)).max(initial=0.0)) for n in set(solids.shown))
    factor, prefix = style.decimal_prefix(largest)
    limit, (words, unit) = largest / factor or 1.0, solids.quantities[solids.quantity]
    text = {"font_size": size[1] // 40, "color": "black", "viewport": True}
    bar = {
        "title": "values", "color": "black", "n_labels": 5, "fmt": "%.3g", "width": 0.48,
        "height": 0.09, "position_x": 0.46, "position_y": 0.01, "label_font_size": size[1] // 36,
    }  # fmt: skip
    box = solids.box()
    with screen(pyvista):
        plotter = pyvista.Plotter(off_screen=True, window_size=list(size))
        try:
            plotter.set_background("white")
            plotter.enable_anti_aliasing("msaa")
            if beams:
                axes = [numbering.points[numbering.vertices_of(beam)] for beam in beams]
                plotter.add_mesh(_lines(axes), color="#A0A0A0", reset_camera=False)
                plotter.add_text(f"{words} ({prefix}{unit})", position=(0.02, 0.025), **text)
            for n in solids.shown:
                plotter.suppress_rendering = True
                shape = canvas.shape(n)
                solids.camera.aim(plotter, box, shape, size)
                # Meshes and texts replace the old ones of the same name.
                if beams:
                    plotter.add_mesh(
                        solids.beams(n, shape, factor), scalars="values",
                        clim=(0.0 if solids.magnitudes else -limit, limit),
                        cmap="viridis" if solids.magnitudes else "coolwarm", name="beams",
                        scalar_bar_args=bar, reset_camera=False, ambient=0.4, diffuse=0.7,
                    )  # fmt: skip
                    plotter.scalar_bars["values"].SetTitle("")  # VTK would draw it over the numbers
                for color, meshes in solids.others(n, shape).items():
                    look = {"color": color, "name": color, "ambient": 0.25}
                    plotter.add_mesh(pyvista.merge(meshes), reset_camera=False, **look)
                time = solution.parameter.at(solution.times[n], ".3f")
                time += style.magnified(solids.magnify)
                plotter.add_text(time, position=(0.02, 0.93), name="time", **text)
                plotter.reset_camera_clipping_range()
                plotter.suppress_rendering = False
                plotter.render()
                yield plotter.screenshot(return_img=True)
        finally:
            plotter.close()
            del plotter
            # Without this collection the window would outlive its X server.
            gc.collect()


def _require_suffix(path: str | Path, suffixes: Collection[str]) -> Path:
    """Return the checked path of a picture or film, or raise :class:`ArgumentError`."""
    path = Path(path)
    if path.suffix.lower() not in suffixes:
        raise ArgumentError(f"{path}: the name must end in {' or '.join(suffixes)}")
    if not path.parent.is_dir():
        raise ArgumentError(f"{path}: there is no directory {path.parent}; make it first")
    return path


# -- meshes ------------------------------------------------------------------------------------


@dataclass(frozen=True)
class Solids:
    """Solids of a solution for :func:`render` and :func:`animate`, with checked arguments."""

    solution: Solution
    shown: list[int]  # indices of the recorded times
    quantity: str
    thickness: float
    magnify: float
    camera: Camera
    size: tuple[int, int]

    def __post_init__(self) -> None:
        style.require_option(self.quantity, self.quantities, "quantity")
        require_number(self.thickness, "thickness", positive=True)
        require_kind(self.camera, Camera, "camera")
        for pixels in self.size:
            require_number(pixels, "size", at_least=16)
        self.camera.axes(self.in_space)  # raises if the camera looks along the vertical
        shape = self.canvas.shape(self.shown[0])  # raises if ``magnify`` or the time is wrong
        if self.camera.follow is not None:
            shape.at(self.camera.follow)  # raises if the place is not in the scene

    @property
    def in_space(self) -> bool:
        """True if the scene is in space."""
        return self.solution.scene.in_space

    @property
    def magnitudes(self) -> bool:
        """True if colours show magnitudes, from zero on."""
        return self.in_space and self.quantity in ("V", "M")

    @property
    def quantities(self) -> dict[str, tuple[str, str]]:
        """Names and units of the quantities that colours can show."""
        return QUANTITIES_IN_SPACE if self.in_space else QUANTITIES

    def box(self) -> Array:
        """Return the lower and upper corner of the whole motion, beside the followed place; m."""
        points, margin = self.canvas.points(self.camera.follow), 2.2 * self.canvas.unit
        half = [self.thickest[1] / 2] * (3 - points.shape[1])
        low, high = points.min(axis=0) - margin, points.max(axis=0) + margin
        return np.array([[*low, *np.negative(half)], [*high, *half]])

    @cached_property
    def canvas(self) -> Canvas:
        """Canvas for bodies, joints, connectors and supports."""
        scene = self.solution.scene
        symbol = max(0.022 * scene.size, 0.7 * self.thickest[0])
        return Canvas(self.solution, self.magnify, sorted({*self.shown}), unit=symbol)

    @cached_property
    def thickest(self) -> tuple[float, float]:
        """Largest depth and width of beams in the plane; at least 4 % of the scene wide; m."""
        beams = self.solution.scene.beams
        depth = self.thickness * max((float(b.section.depth) for b in beams), default=0.0)
        return depth, max(depth, 0.04 * self.solution.scene.size)

    def values(self, n: int) -> Array:
        """Return the values that colours show at both ends of all cells; (num_cells, 2)."""
        solution, numbering = self.solution, self.solution.numbering
        if self.quantity == "rotation":
            return np.asarray(solution.q[n][numbering.dofs[numbering.cells, 2]])
        forces = style.components(solution.cell_forces(n, np.array([0.0, 1.0])), self.quantity)
        return np.linalg.norm(forces, axis=2) if self.magnitudes else forces[:, :, 0]

    def beams(self, n: int, shape: DeformedShape, factor: float) -> Any:
        """Make a hexahedron for each cell of the beams, with values that colours show."""
        from pyvista import CellType, UnstructuredGrid

        points = self.corners(shape).reshape(-1, 3)  # for each cell, as values may jump
        hexahedra = {CellType.HEXAHEDRON: np.arange(len(points)).reshape(-1, 8)}
        mesh = UnstructuredGrid(hexahedra, points)
        mesh.point_data["values"] = np.repeat(self.values(n) / factor, 4)
        return mesh

    def corners(self, shape: DeformedShape) -> Array:
        """Return corners of cross-sections at both ends of cells; (num_cells, 2, 4, 3); m.

        Beams have the depth of the section.  In the plane their width is the depth or more.  In
        space it is the width of a rectangle with the bending stiffnesses of the section.
        """
        numbering, size = self.solution.numbering, self.solution.scene.size
        halves = []
        for section in (beam.section for beam in self.solution.scene.beams):
            depth = self.thickness * float(section.depth)
            if self.in_space:
                aspect = np.sqrt(float(section.EI2 or 0.0) / section.EI)
                depth = max(depth, SLENDER * size * max(1.0, 1 / aspect))
                halves.append((depth / 2, max(depth * aspect, SLENDER * size) / 2))
            else:
                halves.append((depth / 2, max(depth, 0.04 * size) / 2))
        of_cells = np.reshape(halves, (-1, 2))[numbering.beam_of_cell]
        ends = np.array([0.0, 1.0])
        points, across = in_three(shape.axis_points(ends)), shape.section_axes(ends)[..., 1:]
        corners = np.einsum("neik,ck,nk->neci", across, np.array(SQUARE), of_cells)
        return np.asarray(points[:, :, None] + corners)

    def others(self, n: int, shape: DeformedShape) -> dict[str, list[Any]]:
        """Make meshes of bodies, joints, connectors, masses and supports, by their colours.

        Areas are plates, discs in space balls, and lines rods.
        """
        from pyvista import Sphere

        unit, (depth, width) = shape.canvas.unit, self.thickest
        towards = np.array([0.0, 0.0, 1.0])  # the viewer
        if self.in_space:
            depth, width, towards = 0.0, 0.6 * unit, -unit_vectors(FROM_A_SIDE)
        meshes: defaultdict[str, list[Any]] = defaultdict(list)
        lines: defaultdict[tuple[str, float], list[Array]] = defaultdict(list)
        plates: defaultdict[tuple[str, float, float], list[Array]] = defaultdict(list)

        def add(stroke: Stroke, low: float, high: float) -> None:
            """Add an area between two heights above the plane of the picture, or its edge."""
            points, fill = stroke.points, stroke.fill
            if fill is not None and self.in_space and len(points) > ROUND:
                middle = points[:-1].mean(axis=0)
                radius = float(np.linalg.norm(points[0] - middle))
                meshes[fill].append(Sphere(radius=radius, center=middle))
                return
            points = in_three(points)
            if fill is not None:
                plates[fill, low, high].append(points)
            if fill not in (FILLED, stroke.color):
                height = high if fill is not None or stroke.layer > MIDDLE else 0.0
                lines[stroke.color, stroke.weight].append(points + height * towards)

        for group, strokes in symbols.all_symbols(shape).items():
            for stroke in strokes if group in HALF_WIDTHS else ():
                half = HALF_WIDTHS["beams" if stroke.layer >= FRONT else group] * width
                low, high = (half, 1.1 * half) if stroke.layer > MIDDLE else (-half, half)
                add(stroke, low, high)
        radius = max(depth / 2, 0.4 * unit)  # of pins, as thick as beams
        dots = [(at, PIN, radius, 0.62 if rotates else 0.51) for at, rotates in symbols.pins(shape)]
        dots += [
            (x.at, style.ORANGE, radius, 0.62) for x in open_hinges(self.solution, n, shape.at)
        ]
        masses = self.solution.scene.masses
        dots += [(shape.at(mass.place), style.INK, 1.1 * unit, 0.7) for mass in masses]
        for at, color, r, half in dots:
            add(disc(at, r, color, color), -half * width, half * width)
        for (color, low, high), outlines in plates.items():
            meshes[color].append(_extruded(outlines, low * towards, high * towards))
        for (color, weight), several in lines.items():
            rod = _lines(several).tube(radius=weight * unit / 20.0, n_sides=12)
            meshes[color] += [rod] if rod.n_points else []
        return {color: some for color, some in meshes.items() if some}


def _lines(lines: list[Array]) -> Any:
    """Join lines in one mesh of separate segments, because tubes get thin at corners."""
    from pyvista import line_segments_from_points

    ends = in_three(np.concatenate([np.repeat(line, 2, axis=0)[1:-1] for line in lines]))
    long = np.abs(ends[1::2] - ends[::2]).max(axis=1) > 1e-9 * np.ptp(ends)  # others have no tube
    return line_segments_from_points(ends[np.repeat(long, 2)])


def _extruded(outlines: Sequence[Array], low: Array, high: Array) -> Any:
    """Extrude closed plane outlines from ``low`` to ``high``; m."""
    from pyvista import PolyData

    points = low + np.concatenate([outline[:-1] for outline in outlines])
    ends = np.cumsum([len(outline) - 1 for outline in outlines])
    faces = np.split(np.arange(len(points)), ends[:-1])
    solid = PolyData(points, np.concatenate([[len(face), *face] for face in faces])).triangulate()
    return solid.extrude(high - low, capping=True)
