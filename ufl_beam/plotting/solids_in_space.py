# SPDX-License-Identifier: MIT
"""Solids of scenes in space: blocks of beams, and symbols as balls, tubes and plates."""

from __future__ import annotations

from collections import defaultdict
from itertools import pairwise
from typing import Any

import numpy as np

from ufl_beam.output.states import States
from ufl_beam.plotting.positions import FROM_A_SIDE, DeformedShape
from ufl_beam.plotting.style import INK, WHITE
from ufl_beam.plotting.symbols import all_symbols

PIN = "#707070"  # colour of joints
SLENDER = 0.012  # least size of a drawn cross-section, as a part of the scene's size
ROUND = 20  # number of points of an outline from which it is drawn as a ball


def beams_in_space(solution: States, shape: DeformedShape, thickness: float) -> Any:
    """Make a block for each cell, which turns and twists with its nodes.

    Blocks have the depth of the section, and the width of a rectangle with its bending stiffnesses.
    """
    from pyvista import CellType, UnstructuredGrid

    numbering, size = solution.numbering, solution.scene.size
    halves = []
    for beam in solution.scene.beams:
        section = beam.section
        aspect = np.sqrt(float(section.EI2 or 0.0) / section.EI)
        depth = max(thickness * section.depth, SLENDER * size * max(1.0, 1 / aspect))
        halves.append((depth / 2, max(depth * aspect, SLENDER * size) / 2))
    of_cells = np.reshape(halves, (-1, 2))[numbering.beam_of_cell]
    square = np.array([(1, 1), (-1, 1), (-1, -1), (1, -1)])
    across = shape.section_axes(np.array([0.0, 1.0]))[..., 1:]  # (num_cells, 2, 3, 2)
    corners = np.einsum("neik,ck,nk->neci", across, square, of_cells)
    points = (shape.nodes[numbering.cells][:, :, None] + corners).reshape(-1, 3)
    return UnstructuredGrid({CellType.HEXAHEDRON: np.arange(len(points)).reshape(-1, 8)}, points)


def others_in_space(shape: DeformedShape) -> dict[str, list[Any]]:
    """Make meshes of bodies, joints, connectors, masses and supports, by their colours."""
    from pyvista import PolyData, Sphere, lines_from_points, merge

    unit, meshes = shape.canvas.unit, defaultdict[str, list[Any]](list)
    for group, strokes in all_symbols(shape).items():
        for points, color, weight, fill, _ in strokes:
            color = PIN if group in ("pins", "joints") and color == INK else color
            if fill is None:
                tubes = [
                    lines_from_points(np.array(ends)).tube(radius=weight * unit / 20, n_sides=12)
                    for ends in pairwise(points)
                    if np.linalg.norm(np.subtract(*ends)) > 1e-6 * unit  # else it has no points
                ]
                meshes[color] += [merge(tubes)] if tubes else []
                continue
            middle, color = points[:-1].mean(axis=0), color if fill == WHITE else fill
            if len(points) > ROUND:
                radius = float(np.linalg.norm(points[0] - middle))
                meshes[color].append(Sphere(radius=radius, center=middle))
            else:
                step = 0.6 * unit * FROM_A_SIDE / np.linalg.norm(FROM_A_SIDE)
                plate = PolyData(points[:-1] - step / 2, [len(points) - 1, *range(len(points) - 1)])
                meshes[color].append(plate.triangulate().extrude(step, capping=True))
    return {color: some for color, some in meshes.items() if some}
