# SPDX-License-Identifier: MIT
"""Scenes as lines, with the fields of a state at their points and in their cells."""

from __future__ import annotations

from collections.abc import Mapping
from typing import NamedTuple

import numpy as np

from ufl_beam.arrays import Array, Index
from ufl_beam.model.bodies import AttachmentPoint
from ufl_beam.model.connectors import Connector
from ufl_beam.model.scene import Scene, attachment_points
from ufl_beam.output.internal_variables import in_cells
from ufl_beam.output.recorder import StateView
from ufl_beam.output.section_forces import Diagram, DiagramInSpace

LineFields = tuple[Mapping[str, Array], Mapping[str, Array]]
"""Fields at points, (n,) or (n, 3), and in cells, (m,), by name."""


BODY, CONNECTOR = 1, 2  # kinds of lines: bodies, and links or connectors


class Rod(NamedTuple):
    """Straight line of a body or a connector, between two places."""

    a: AttachmentPoint
    b: AttachmentPoint
    group: int  # BODY or CONNECTOR
    along: Connector | None = None  # connector whose force acts along the line


def scene_rods(scene: Scene) -> list[Rod]:
    """Return lines from the centre of a body to its points, and along links and connectors."""
    spots, rods = attachment_points(scene), list[Rod]()
    for body in scene.bodies:
        # A body with attachments at its centre alone also gets a line, which shows its rotation.
        x, *others = body.center
        beside = body.at(x + 0.02 * scene.size, *others)
        others = [s for s in spots[body] if s.point != body.center] or [beside]
        rods += [Rod(body.middle, place, BODY) for place in others]
    for joint in scene.joints:
        if joint.is_rod:
            a, b = joint.places
            pulls = next((c for c in joint.holders if c.stretches), None)
            rods.append(Rod(a, b, CONNECTOR, pulls))
    rods += [
        Rod(c.a, c.b, CONNECTOR, c if c.stretches else None)
        for c in scene.connectors
        if not c.is_rotation and any(c.apart)
    ]
    return rods


class LineData:
    """Geometry of beams, bodies and connectors as lines, and the fields of a state on these lines.

    Points and lines of beams come first.  Each line of a body or connector follows, with two points
    of its own.  There N is the force of a connector along its line; other section forces are zero.

    Attributes:
        points: Coordinates of points; (n, 3); m.
        cells: Indices of the points at both ends of each line; (m, 2).
        kinds: Kind of each line: 0 for beams, or BODY, or CONNECTOR; (m,).
    """

    def __init__(self, simulation: StateView) -> None:
        numbering, rods = simulation.numbering, scene_rods(simulation.scene)
        self._ends = [end for rod in rods for end in (rod.a, rod.b)]
        own = len(numbering.points) + np.arange(len(self._ends)).reshape(-1, 2)
        points = np.array([*numbering.points, *(end.point for end in self._ends)])
        self.points: Array = _in_three(points)
        self.cells: Index = np.concatenate([numbering.pieces, own])
        self.kinds = np.append(np.zeros(len(numbering.pieces)), [rod.group for rod in rods])
        connectors = simulation.scene.all_connectors
        # Connectors whose forces act along lines, by the index of the line in ``rods``
        self._pulls = {k: connectors.index(rod.along) for k, rod in enumerate(rods) if rod.along}
        self._pieces_per_cell, self._num_rods = numbering.mesh.degree, len(rods)

    def fields(self, simulation: StateView) -> LineFields:
        """Compute the fields of the present state, see :class:`XDMF`, on all processes together."""
        now, at_points, d = simulation.now, dict[str, Array](), simulation.numbering.displacements
        motions = [("rotation", "displacement", now.motion_of_nodes(0), now.displacement)]
        if len(v := now.v):
            of_nodes = v[0, simulation.numbering.dofs]
            motions.append(("angular velocity", "velocity", of_nodes, now.velocity))
        for turning, moving, of_nodes, of_place in motions:
            values = np.array([*of_nodes, *(of_place(end)[0] for end in self._ends)])
            at_points[moving] = _in_three(values[:, :d])
            at_points[turning] = values[:, 2] if d == 2 else values[:, d:]
        forces = simulation.section_forces()
        names = (Diagram if d == 2 else DiagramInSpace)._fields[1:]
        fields: dict[str, Array] = dict(zip(names, forces.T, strict=True))
        if simulation.may_break:
            fields["jump"], fields["dissipated energy"] = simulation.damage()
            variables = in_cells(simulation.numbering, simulation.internal())
            fields |= {f"state.{name}": values for name, values in variables.items()}
        of_lines = {
            name: np.append(np.repeat(values, self._pieces_per_cell), np.zeros(self._num_rods))
            for name, values in fields.items()
        }
        if self._pulls:
            rods = of_lines["N"][len(self.cells) - self._num_rods :]
            rods[[*self._pulls]] = simulation.connections()[[*self._pulls.values()], 1]
        return at_points, of_lines


def _in_three(vectors: Array) -> Array:
    """Return vectors of the plane with a third component 0, and those in space as they are."""
    flat = np.zeros((len(vectors), 3 - vectors.shape[1]))
    return np.hstack([vectors, flat])
