# SPDX-License-Identifier: MIT
"""Solid bodies of a solution for PyVista: beams, bodies, joints, connectors and supports."""

from __future__ import annotations

import math
from collections import defaultdict
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np

from ufl_beam.arrays import Array
from ufl_beam.errors import require_number
from ufl_beam.model.bodies import Anchor, Member, Place
from ufl_beam.plotting import style, symbols
from ufl_beam.plotting.damage_marks import open_hinges
from ufl_beam.plotting.geometry import directions, left_of, unit_vectors
from ufl_beam.plotting.scene_layout import Pose, Stage
from ufl_beam.plotting.style import RESULTANTS
from ufl_beam.plotting.symbols import FILLED, Pin
from ufl_beam.simulation.solution import Solution

QUANTITIES = {name: (f"{words} {name}", unit) for name, (words, unit) in RESULTANTS.items()}
QUANTITIES["rotation"] = "rotation", "rad"
PIN = "#707070"  # colour of joints

Meshes = defaultdict[str, list[Any]]  # meshes of PyVista, by colours


@dataclass(frozen=True)
class Solids:
    """Solid bodies of a solution, as the arguments of :func:`render` ask for them, checked."""

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

    @cached_property
    def symbol(self) -> float:
        """Half the size of the symbols of supports and masses; m."""
        scene = self.solution.scene
        return max(0.022 * scene.size, 0.7 * self._thickest(scene.beams)[0])

    @cached_property
    def least_width(self) -> float:
        """Width across the plane of slender beams and of bodies; m."""
        return 0.04 * self.solution.scene.size

    def _thickest(self, beams: Iterable[Member]) -> tuple[float, float]:
        """Largest depth in the plane and width across it of some beams; m."""
        depth = self.thickness * max((float(b.section.depth) for b in beams), default=0.0)
        return depth, max(depth, self.least_width)

    def _around(self, places: Iterable[Anchor]) -> tuple[float, float]:
        return self._thickest(place.beam for place in places if isinstance(place, Place))

    def stage(self, shown: list[int]) -> Stage:
        """Return the stage of bodies, joints, connectors and supports."""
        return Stage(self.solution, self.magnify, self.symbol, sorted(set(shown)))

    def bounds(self, points: Sequence[Array]) -> Array:
        """Compute lower and upper corner of the box around points and symbols; (2, 3); m."""
        margin, xy = 2.2 * self.symbol, np.concatenate(points)
        half = self._thickest(self.solution.scene.beams)[1] / 2
        low, high = xy.min(axis=0) - margin, xy.max(axis=0) + margin
        return np.array([[*low, -half], [*high, half]])

    def values(self, n: int) -> Array:
        """Values of the colours at both ends of all cells; (num_cells, 2)."""
        solution, grid = self.solution, self.solution.grid
        if self.color == "rotation":
            return np.asarray(solution.q[n][grid.dofs[grid.cells, 2]])
        index = list(RESULTANTS).index(self.color)
        beams = solution.scene.beams
        forces = [solution.diagram(beam, n, points=2)[1 + index] for beam in beams]
        return np.concatenate([np.empty(0), *forces]).reshape(-1, 2)

    def beams(self, n: int, pose: Pose, factor: float) -> Any:
        """Make a hexahedron for each cell of the beams, with values that are the colours."""
        from pyvista import CellType, UnstructuredGrid

        corners = 4 * self.solution.grid.cells[:, :, None] + np.arange(4)  # of start and end
        points = self._corners(n, pose.nodes)[corners.ravel()]  # of each cell: colours may jump
        mesh = UnstructuredGrid(
            {CellType.HEXAHEDRON: np.arange(len(points)).reshape(-1, 8)}, points
        )
        mesh.point_data["values"] = np.repeat(self.values(n) / factor, 4)
        return mesh

    def _corners(self, n: int, nodes: Array) -> Array:
        """Corners of cross-sections, which turn with ψ and halve angles; (4 num_vertices, 3); m."""
        grid = self.solution.grid
        vertices = np.arange(grid.cells.max(initial=-1) + 1)
        along = unit_vectors(np.diff(grid.points[grid.cells], axis=1)[:, 0])
        sizes = np.reshape([self._thickest([beam]) for beam in self.solution.scene.beams], (-1, 2))
        mean, halves = np.zeros((len(vertices), 2)), np.zeros((len(vertices), 2))
        for end in grid.cells.T:
            mean[end] += along  # no vertex is the same end of two cells
            halves[end] = sizes[grid.beam_of_cell] / 2
        angle = np.arctan2(mean[:, 1], mean[:, 0]) + self.solution.q[n][grid.dofs[vertices, 2]]
        depth, width = halves.T
        left = depth[:, None] * left_of(directions(angle))
        planes = [
            np.column_stack([nodes[vertices] + sign * left, side * width])
            for sign, side in ((1, 1), (-1, 1), (-1, -1), (1, -1))
        ]
        return np.stack(planes, axis=1).reshape(-1, 3)

    def axes(self) -> Any:
        """Make lines along the undeformed beams."""
        grid = self.solution.grid
        axes = [grid.points[grid.vertices_of(beam)] for beam in self.solution.scene.beams]
        return _polyline([np.insert(axis, 2, 0.0, axis=1) for axis in axes])

    def others(self, n: int, pose: Pose) -> Meshes:
        """Make bodies, joints, connectors, masses and supports."""
        found: Meshes = defaultdict(list)
        self._add_strokes(found, pose)
        self._add_fittings(found, n, pose)
        return found

    def _add_strokes(self, found: Meshes, pose: Pose) -> None:
        """Bodies as plates, lines as rods, and filled areas as blocks."""
        body, front = self.least_width, 0.7 * self._thickest(self.solution.scene.beams)[1]
        lines: defaultdict[tuple[str, float], list[Array]] = defaultdict(list)
        for strokes, half in (
            (symbols.bodies(pose), 0.4 * body),
            (symbols.centres(pose), 0.48 * body),
            (symbols.rods(pose), 0.1 * body),
            (symbols.rails(pose), 0.45 * body),
            (symbols.connectors(pose), 0.45 * body),
        ):
            for points, color, weight, fill, layer in strokes:
                base = front if layer == style.FRONT else half
                low, high = (-half, half) if layer <= style.MIDDLE else (base, 1.1 * base)
                if fill is not None:
                    found[fill].append(_extruded(points, low, high))
                if fill != FILLED:
                    z = 0.0 if fill is None and layer <= style.MIDDLE else high
                    lines[color, weight].append(np.insert(points, 2, z, axis=1))
        for (color, weight), several in lines.items():
            tubes = _polyline(several).tube(radius=weight * self.symbol / 20.0, n_sides=12)
            found[color].append(tubes)

    def _add_fittings(self, found: Meshes, n: int, pose: Pose) -> None:
        """Joints as pins across the plane, open hinges as orange ones, masses, supports."""
        from pyvista import Cylinder, Sphere

        pins = [(pin, PIN) for pin in symbols.pins(pose)]
        for hinge in open_hinges(self.solution, n, pose.nodes):
            pins.append((Pin(hinge.at, True, (hinge.beam.start,)), style.ORANGE))
        cylinders: defaultdict[tuple[float, float, str], list[Array]] = defaultdict(list)
        for pin, color in pins:
            cylinders[(*self._size(pin), color)].append(pin.at)
        for (radius, height, color), places in cylinders.items():
            cylinder = Cylinder(
                direction=(0, 0, 1), radius=radius, height=height, resolution=32
            ).triangulate()
            found[color].append(_copies(cylinder, places))
        if masses := [pose.at(mass.place) for mass in self.solution.scene.masses]:
            found[style.INK].append(_copies(Sphere(radius=1.1 * self.symbol), masses))
        for at, angle, outlines, color, place in symbols.footings(pose):
            half = 0.6 * self._around([place])[1]
            for outline in outlines:
                block = _extruded(self.symbol * np.array(outline), -half, half)
                block = block.rotate_z(math.degrees(angle)).translate((*at, 0.0))
                found[color].append(block)

    def _size(self, pin: Pin) -> tuple[float, float]:
        """Radius and height of a pin across the plane, as thick as the beams that it joins; m."""
        depth, width = self._around(pin.places)
        least = 0.4 * self.symbol if pin.turns or not depth else 0.0
        return max(depth / 2, least), width * (1.25 if pin.turns else 1.02)


def _copies(mesh: Any, places: list[Array]) -> Any:
    """Copies of a mesh at places of the plane, in one mesh."""
    from pyvista import PolyData

    points = PolyData(np.insert(np.array(places), 2, 0.0, axis=1))
    return points.glyph(geom=mesh, orient=False, scale=False)


def _polyline(lines: list[Array]) -> Any:
    """Lines in one mesh, which is fast; each piece of its own: corners make tubes thin."""
    from pyvista import PolyData

    starts = np.cumsum([0, *map(len, lines)])
    first = np.delete(np.arange(starts[-1]), starts[1:] - 1)  # not the last of each line
    pieces = np.column_stack([np.full(len(first), 2), first, first + 1])
    return PolyData(np.concatenate(lines), lines=pieces.ravel())


def _extruded(outline: Array, low: float, high: float) -> Any:
    """A block between two planes; the outline is closed; m."""
    from pyvista import PolyData

    flat = np.insert(outline[:-1], 2, low, axis=1)
    face = PolyData(flat, [len(flat), *range(len(flat))])
    return face.triangulate().extrude((0.0, 0.0, high - low), capping=True)
