# SPDX-License-Identifier: MIT
"""Solids of scenes in space: blocks of beams, bodies with arms, joints, connectors, supports."""

from __future__ import annotations

from collections import defaultdict
from typing import Any

import numpy as np
from scipy.spatial.transform import Rotation

from ufl_beam.arrays import Array
from ufl_beam.discretization.cells_in_space import cell_axes
from ufl_beam.model.bodies import AttachmentPoint
from ufl_beam.output.scene_lines import BODY, scene_rods
from ufl_beam.output.states import States
from ufl_beam.plotting.positions import DeformedShape
from ufl_beam.plotting.style import GREY, INK
from ufl_beam.plotting.symbols import EDGE, STEEL

PIN = "#707070"  # colour of joints
SLENDER = 0.012  # least size of a drawn cross-section, as a part of the scene's size

UP_IN_SPACE = np.array([0.0, 0.0, 1.0])
"""Direction that is upwards in pictures of scenes in space."""

FROM_A_SIDE = (-0.55, 0.75, -0.4)
"""View direction for scenes in space."""

RESULTANTS = {
    "N": ("axial force", "N"), "V": ("shear force", "N"), "T": ("torsional moment", "N m"),
    "M": ("bending moment", "N m"),
}  # fmt: skip
"""Section forces that colours show; V and M are magnitudes of their two components."""


def values_in_space(solution: States, quantity: str, n: int) -> Array:
    """Return the values that colours show at both ends of all cells; (num_cells, 2)."""
    forces = solution.cell_forces(n, np.array([0.0, 1.0]))
    columns = {"N": [0], "V": [1, 2], "T": [3], "M": [4, 5]}[quantity]
    some = forces[:, :, columns]
    return np.asarray(some[:, :, 0] if len(columns) == 1 else np.linalg.norm(some, axis=2))


def points_in_space(shape: DeformedShape) -> Array:
    """Return points of a shape: nodes of beams, attachment points and centres; (n, 3); m."""
    scene, spots = shape.canvas.scene, shape.canvas.spots
    places = [*(body.middle for body in scene.bodies), *(x for at in spots.values() for x in at)]
    return np.array([*shape.nodes, *map(shape.at, places)])


def beams_in_space(solution: States, n: int, shape: DeformedShape, thickness: float) -> Any:
    """Make a block for each cell, which turns and twists with its nodes.

    Blocks have the depth of the section, and the width of a rectangle with its bending stiffnesses.
    """
    from pyvista import CellType, UnstructuredGrid

    numbering, size = solution.numbering, solution.scene.size
    _, axes = cell_axes(solution.cells.fields)
    halves = []
    for beam in solution.scene.beams:
        section = beam.section
        aspect = np.sqrt(float(section.EI2 or 0.0) / section.EI)
        depth = max(thickness * section.depth, SLENDER * size * max(1.0, 1 / aspect))
        halves.append((depth / 2, max(depth * aspect, SLENDER * size) / 2))
    motion = solution.motion_of_nodes(n)
    corners = np.empty((len(numbering.cells), 2, 4, 3))
    for end, nodes in enumerate(numbering.cells.T):
        turned = Rotation.from_rotvec(motion[nodes, 3:]).as_matrix() @ axes
        depth, width = np.reshape(halves, (-1, 2))[numbering.beam_of_cell].T[..., None]
        for k, (a, b) in enumerate(((1, 1), (-1, 1), (-1, -1), (1, -1))):
            across = a * depth * turned[:, :, 1] + b * width * turned[:, :, 2]
            corners[:, end, k] = shape.nodes[nodes] + across
    points = corners.reshape(-1, 3)
    return UnstructuredGrid({CellType.HEXAHEDRON: np.arange(len(points)).reshape(-1, 8)}, points)


def others_in_space(shape: DeformedShape) -> dict[str, list[Any]]:
    """Make meshes of bodies, joints, connectors, masses and supports, by their colours."""
    from pyvista import Cube, Cylinder, Line, Sphere

    scene, unit = shape.canvas.scene, shape.canvas.unit
    meshes: defaultdict[str, list[Any]] = defaultdict(list)

    def ball(place: AttachmentPoint, radius: float) -> Any:
        return Sphere(radius=radius * unit, center=shape.at(place))

    attached = {spot for spots in shape.canvas.spots.values() for spot in spots}
    for rod in scene_rods(scene):
        if rod.group == BODY and rod.b not in attached:
            continue  # it shows a rotation, in files only
        color = EDGE if rod.group == BODY else STEEL
        line = Line(shape.at(rod.a), shape.at(rod.b))
        meshes[color].append(line.tube(radius=0.25 * unit, n_sides=12))
    meshes[EDGE] += [ball(body.middle, 1.0) for body in scene.bodies]
    meshes[INK] += [ball(mass.place, 0.8) for mass in scene.masses]
    for joint in scene.joints:
        place = joint.places[0]
        if (axis := getattr(joint, "axis", None)) is not None:
            turned = Rotation.from_rotvec(shape.motion(place)[3:]).apply(axis)
            at, height = shape.at(place), 2.0 * unit
            pin = Cylinder(center=at, direction=turned, radius=height / 4, height=height)
            meshes[PIN].append(pin.triangulate())
        elif joint.meets and 2 not in joint.shared:
            meshes[PIN].append(ball(place, 0.6))
    for support in scene.supports:
        lengths = dict.fromkeys(("x_length", "y_length", "z_length"), 1.6 * unit)
        meshes[GREY].append(Cube(center=shape.at(support.place), **lengths).triangulate())
    return {color: several for color, several in meshes.items() if several}
