# SPDX-License-Identifier: MIT
"""Solid bodies of a solution for PyVista: beams, bodies, joints, connectors and supports."""

from __future__ import annotations

import math
from collections.abc import Iterable
from dataclasses import dataclass
from typing import Any

import numpy as np

from ufl_beam.arrays import Array
from ufl_beam.errors import require_number
from ufl_beam.model.bodies import Anchor, Member, Place
from ufl_beam.plotting import style, symbols
from ufl_beam.plotting.drawing import OpenHinge
from ufl_beam.plotting.scene_layout import Pose, Stage
from ufl_beam.plotting.symbols import FILLED, Pin
from ufl_beam.simulation.solution import Solution

QUANTITIES = {**style.RESULTANTS, "rotation": ("rotation", "rad")}


@dataclass(frozen=True)
class Look:
    """Options of a picture of a solution, checked; see :func:`render`."""

    solution: Solution
    color: str
    thickness: float
    magnify: float
    size: tuple[int, int]

    def __post_init__(self) -> None:
        style.require_choice(self.color, QUANTITIES, "color")
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
        """Return the stage of bodies, joints, connectors and supports."""
        return Stage(self.solution, self.magnify, self.symbol, sorted(set(shown)))

    def depth(self, beam: Member) -> float:
        """Return the depth of a beam in the plane; m."""
        return self.thickness * float(beam.section.depth)

    def width(self, beam: Member) -> float:
        """Return the width of a beam across the plane; m."""
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
        """Return depth and width of the thickest beam of some places; m."""
        beams = [place.beam for place in places if isinstance(place, Place)]
        return max(map(self.depth, beams), default=0.0), max(
            map(self.width, beams), default=self.least_width
        )

    def values(self, beam: Member, n: int) -> Array:
        """Return the values of a beam's colours: (num_cells,), of rotations (num_vertices,)."""
        if self.color == "rotation":
            dofs = self.solution.grid.dofs[self.solution.grid.vertices_of(beam), 2]
            return np.asarray(self.solution.q[n][dofs])
        return self.solution.section_forces(beam, n)[:, list(style.RESULTANTS).index(self.color)]

    def corners(self, beam: Member, n: int, points: Array) -> Array:
        """Corners of cross-sections, which turn with ψ and halve angles; (4 num_vertices, 3); m."""
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
        """Compute lower and upper corner of the box around these states; (2, 3); m."""
        margin, xy = 2.2 * self.symbol, self.stage(shown).points()
        half = max(self.widest, *map(self.depth, self.solution.scene.beams), 0.0) / 2
        low, high = xy.min(axis=0) - margin, xy.max(axis=0) + margin
        return np.array([[*low, -half], [*high, half]])


class Solids:
    """Plotter of PyVista with methods that add the solid bodies of one state."""

    def __init__(self, pyvista: Any, plotter: Any, look: Look) -> None:
        self._pyvista, self._plotter, self._look = pyvista, plotter, look

    def add_beams(self, n: int, points: Array, largest: float) -> None:
        """Add the beams in colour, the undeformed axes in grey, and the colour bar."""
        quantity, unit = QUANTITIES[self._look.color]
        factor, prefix = style.decimal_prefix(largest)
        limit = largest / factor or 1.0
        letter = "" if self._look.color == "rotation" else f" {self._look.color}"
        title = f"{quantity}{letter} ({prefix}{unit})"
        bar = {
            "title": title, "color": "black", "n_labels": 5, "fmt": "%.3g", "width": 0.48,
            "height": 0.09, "position_x": 0.46, "position_y": 0.01,
            "label_font_size": self._look.size[1] // 36,
        }  # fmt: skip
        self.add_text(title, (0.02, 0.025))
        grid = self._look.solution.grid
        for i, beam in enumerate(self._look.solution.scene.beams):
            values = self._look.values(beam, n) / factor
            corners = self._look.corners(beam, n, points)
            first = 4 * np.arange(len(corners) // 4 - 1)[:, None]
            cells = {self._pyvista.CellType.HEXAHEDRON: first + np.arange(8)}
            body = self._pyvista.UnstructuredGrid(cells, corners)
            if self._look.color == "rotation":
                body.point_data[title] = np.repeat(values, 4)
            else:
                body.cell_data[title] = values
            self._plotter.add_mesh(
                body, scalars=title, clim=(-limit, limit), cmap="coolwarm", name=f"beam {i}",
                scalar_bar_args=bar, show_scalar_bar=i == 0, reset_camera=False, ambient=0.4,
                diffuse=0.7,
            )  # fmt: skip
            if i == 0:
                # VTK would set the title over the numbers.
                self._plotter.scalar_bars[title].SetTitle("")
            axis = grid.points[grid.vertices_of(beam)]
            line = self._pyvista.lines_from_points(np.insert(axis, 2, 0.0, axis=1))
            self._plotter.add_mesh(line, color="#A0A0A0", name=f"axis {i}", reset_camera=False)

    def add_text(self, text: str, position: tuple[float, float]) -> None:
        """Write a text at a position in parts of the picture, in place of the one before."""
        look = {"font_size": self._look.size[1] // 40, "color": "black", "viewport": True}
        self._plotter.add_text(text, position=position, name=str(position), **look)

    def _add(self, parts: list[Any], color: str, name: str) -> None:
        if parts:
            mesh = self._pyvista.merge(parts)
            self._plotter.add_mesh(mesh, color=color, name=name, reset_camera=False, ambient=0.25)

    def _extruded(self, outline: Array, low: float, high: float) -> Any:
        """A block between two planes; the outline is closed; m."""
        flat = np.insert(outline[:-1], 2, low, axis=1)
        face = self._pyvista.PolyData(flat, [len(flat), *range(len(flat))])
        return face.triangulate().extrude((0.0, 0.0, high - low), capping=True)

    def add_strokes(self, pose: Pose) -> None:
        """Add bodies as plates, lines as rods, and filled areas as blocks."""
        body, front = self._look.least_width, 0.7 * self._look.widest
        found: dict[str, list[Any]] = {}
        lines: dict[tuple[str, float], list[Array]] = {}

        def add(strokes: Iterable[style.Stroke], half: float) -> None:
            for points, color, weight, fill, layer in strokes:
                base = front if layer == style.FRONT else half
                low, high = (-half, half) if layer <= style.MIDDLE else (base, 1.1 * base)
                if fill is not None:
                    found.setdefault(fill, []).append(self._extruded(points, low, high))
                if fill != FILLED:
                    z = 0.0 if fill is None and layer <= style.MIDDLE else high
                    lines.setdefault((color, weight), []).append(np.insert(points, 2, z, axis=1))

        add(symbols.bodies(pose), 0.4 * body)
        add(symbols.centres(pose), 0.48 * body)
        add(symbols.rods(pose), 0.1 * body)
        add((*symbols.rails(pose), *symbols.connectors(pose)), 0.45 * body)
        for (color, weight), several in lines.items():
            tubes = self._tubes(several, weight * self._look.symbol / 20.0)
            found.setdefault(color, []).append(tubes)
        for color, parts in found.items():
            self._add(parts, color, f"strokes {color}")

    def _tubes(self, lines: list[Array], radius: float) -> Any:
        """Tubes along lines at once, which is fast; one for each piece: corners make them thin."""
        starts = np.cumsum([0, *map(len, lines)])
        first = np.delete(np.arange(starts[-1]), starts[1:] - 1)  # not the last of each line
        pieces = np.column_stack([np.full(len(first), 2), first, first + 1])
        chains = self._pyvista.PolyData(np.concatenate(lines), lines=pieces.ravel())
        return chains.tube(radius=radius, n_sides=12)

    def add_fittings(self, pose: Pose, hinges: list[OpenHinge]) -> None:
        """Add joints as pins across the plane, open hinges as orange ones, masses, supports."""
        solution, symbol = self._look.solution, self._look.symbol
        pins = [self._cylinder(pin) for pin in symbols.pins(pose)]
        self._add(pins, "#707070", "joints")
        orange = (Pin(hinge.at, True, (hinge.beam.start,)) for hinge in hinges)
        self._add([*map(self._cylinder, orange)], style.ORANGE, "hinges")
        balls = [
            self._pyvista.Sphere(radius=1.1 * symbol, center=(*pose.at(mass.place), 0.0))
            for mass in solution.scene.masses
        ]
        self._add(balls, style.INK, "masses")
        blocks: dict[str, list[Any]] = {}
        for at, angle, outlines, color, place in symbols.footings(pose):
            half = 0.6 * self._look.around([place])[1]
            for outline in outlines:
                block = self._extruded(symbol * np.array(outline), -half, half)
                block = block.rotate_z(math.degrees(angle)).translate((*at, 0.0))
                blocks.setdefault(color, []).append(block)
        for color, parts in blocks.items():
            self._add(parts, color, f"supports {color}")

    def _cylinder(self, pin: Pin) -> Any:
        """A pin across the plane, as thick as the beams that it joins."""
        depth, width = self._look.around(pin.places)
        least = 0.4 * self._look.symbol if pin.turns or not depth else 0.0
        return self._pyvista.Cylinder(
            center=(*pin.at, 0.0), direction=(0, 0, 1), radius=max(depth / 2, least),
            height=width * (1.25 if pin.turns else 1.02), resolution=32,
        )  # fmt: skip
