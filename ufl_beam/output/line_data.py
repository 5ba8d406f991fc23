# SPDX-License-Identifier: MIT
"""Scene as one data set of lines, with fields at its points and in its cells, for files."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from ufl_beam.arrays import Array, Index
from ufl_beam.model.bodies import GROUND, Anchor, Body, Spot, arm
from ufl_beam.model.connectors import Connector
from ufl_beam.model.loads import FollowerLoad, PointLoad
from ufl_beam.model.scene import Scene
from ufl_beam.output.joint_histories import turned
from ufl_beam.output.recorders import RecordedState

LineFields = tuple[dict[str, Array], dict[str, Array]]  # at points, (n,) or (n, 3); in cells, (m,)
BEAM, BODY, LINK = 0, 1, 2  # numbers of the parts of a scene in files


class Rod(NamedTuple):
    """Straight line between two anchors, of a body or a connector."""

    a: Anchor
    b: Anchor
    part: int  # BODY or LINK
    along: Connector | None = None  # whose force acts along it


def spots_of(scene: Scene) -> dict[Body, list[Spot]]:
    """Find the points of bodies and of the ground that something is attached to, each once."""
    anchors = [place for joint in scene.joints for place in joint.places]
    anchors += [place for connector in scene.connectors for place in (connector.a, connector.b)]
    anchors += [x.place for x in scene.loads if isinstance(x, PointLoad | FollowerLoad)]
    found: dict[Body, dict[Spot, None]] = {body: {} for body in (*scene.bodies, GROUND)}
    for anchor in anchors:
        if isinstance(anchor, Spot):
            found[anchor.body][anchor] = None
    return {body: list(spots) for body, spots in found.items()}


def rods_of(scene: Scene) -> list[Rod]:
    """List the lines from the centre of each body to its points, and along links and springs."""
    spots, rods = spots_of(scene), []
    for body in scene.bodies:
        x, y = body.center
        # If something is attached to its centre alone, it is shown too, and turns.
        beside = body.at(x + 0.02 * scene.size, y)
        others = [s for s in spots[body] if s.point != body.center] or [beside]
        rods += [Rod(body.middle, spot, BODY) for spot in others]
    for joint in scene.joints:
        if joint.look in ("RigidLink", "Link"):
            a, b = joint.places
            pulls = next((c for c in joint.holders if c.stretches), None)
            rods.append(Rod(a, b, LINK, pulls))
    rods += [
        Rod(c.a, c.b, LINK, c if c.stretches else None)
        for c in scene.connectors
        if not c.turns and c.apart != (0.0, 0.0)
    ]
    return rods


class LineData:
    """Geometry of beams, bodies and connectors as lines, and the fields of a state on it.

    Beams come first, node after node; behind them each line of a body or connector with two points
    of its own.  N is the force of a connector that acts along its line; V and M are zero there.
    """

    def __init__(self, simulation: RecordedState) -> None:
        grid, rods = simulation.grid, rods_of(simulation.scene)
        ends = [anchor for rod in rods for anchor in (rod.a, rod.b)]
        corners = np.reshape([anchor.point for anchor in ends], (-1, 2))
        self.points = np.insert(np.concatenate([grid.points, corners]), 2, 0.0, axis=1)
        lines = len(grid.points) + np.arange(len(ends)).reshape(-1, 2)
        self.cells: Index = np.concatenate([grid.pieces, lines])
        self.parts = np.r_[np.full(len(grid.pieces), float(BEAM)), [rod.part for rod in rods]]
        self._nodes = np.concatenate([grid.dofs, *(grid.node(a)[None] for a in ends)])
        self._ends = slice(len(grid.points), None)
        self._arms = np.reshape([arm(anchor) for anchor in ends], (-1, 2))
        links = simulation.scene.links
        pulls = [(k, links.index(rod.along)) for k, rod in enumerate(rods) if rod.along is not None]
        self._pulling, self._along = np.reshape(pulls, (-1, 2)).astype(int).T
        self._pieces_of_cell, self._num_rods = grid.mesh.degree, len(rods)

    def fields(self, simulation: RecordedState) -> LineFields:
        """Compute the fields of the present state, see :class:`XDMF`; all processes call it."""
        q = simulation.share.gather(simulation.q)[self._nodes]
        arms = turned(self._arms, q[self._ends, 2]) if self._num_rods else self._arms
        displacement = np.insert(q[:, :2], 2, 0.0, axis=1)
        displacement[self._ends, :2] += arms - self._arms
        at_points = {"displacement": displacement, "rotation": q[:, 2]}
        for velocities in simulation.velocities():
            v = simulation.share.gather(velocities)[self._nodes]
            velocity = np.insert(v[:, :2], 2, 0.0, axis=1)
            velocity[self._ends, :2] += v[self._ends, 2:] * arms[:, ::-1] * (-1.0, 1.0)
            at_points |= {"velocity": velocity, "angular velocity": v[:, 2]}
        return at_points, self._in_cells(simulation)

    def _in_cells(self, simulation: RecordedState) -> dict[str, Array]:
        forces = simulation.section_forces()
        in_cells: dict[str, Array] = {name: forces[:, k] for k, name in enumerate("NVM")}
        if simulation.may_break:
            in_cells["jump"], in_cells["dissipated energy"] = simulation.damage()
        in_lines = {
            name: np.append(np.repeat(values, self._pieces_of_cell), np.zeros(self._num_rods))
            for name, values in in_cells.items()
        }
        if len(self._pulling):
            rods = in_lines["N"][len(self.cells) - self._num_rods :]
            rods[self._pulling] = simulation.connections()[self._along, 1]
        return in_lines
