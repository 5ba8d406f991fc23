# SPDX-License-Identifier: MIT
"""A scene as one data set of lines, with fields at its points and in its cells, for files."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from ufl_beam.arrays import Array, Index
from ufl_beam.model.bodies import arm
from ufl_beam.output.joint_histories import turned
from ufl_beam.output.wireframe import BEAM, rods_of

if TYPE_CHECKING:
    from ufl_beam.output.state_view import StateView

LineFields = tuple[dict[str, Array], dict[str, Array]]
"""Fields at points, (n,) or (n, 3), and in cells, (m,), by name."""


class LineData:
    """Geometry of beams, bodies and connectors as lines, and the fields of a state on it.

    Beams come first, node after node; behind them each line of a body or connector with two points
    of its own.  N is the force of a connector that acts along its line; V and M are zero there.

    Args:
        simulation: The run, or what has its ``scene``, ``grid``, ``velocities``, ``may_break``,
            ``damage``, ``connections`` and ``section_forces``.

    Attributes:
        points: Undeformed; (n, 3); m.
        cells: Both points of each line; (m, 2).
        parts: 0 in beams, 1 in bodies, 2 in joints and connectors; (m,).
    """

    def __init__(self, simulation: StateView) -> None:
        grid, rods = simulation.grid, rods_of(simulation.scene)
        ends = [anchor for rod in rods for anchor in (rod.a, rod.b)]
        corners = np.reshape([anchor.point for anchor in ends], (-1, 2))
        self.points = np.zeros((len(grid.points) + len(ends), 3))
        self.points[:, :2] = np.concatenate([grid.points, corners])
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
        self._inelastic = simulation.may_break

    def fields(self, simulation: StateView) -> LineFields:
        """Fields of the present state; all processes that share the scene call it together.

        Returns:
            At points the displacement (m) and rotation (rad), in dynamics also the velocity (m/s)
            and angular velocity (rad/s); in cells N, V (N), M (N m), and where anything yields or
            breaks also the jump of the hinge (rad) and the dissipated energy (J).
        """
        q = simulation.share.gather(simulation.q)[self._nodes]
        arms = turned(self._arms, q[self._ends, 2]) if self._num_rods else self._arms
        displacement = _in_space(q)
        displacement[self._ends, :2] += arms - self._arms
        at_points = {"displacement": displacement, "rotation": q[:, 2]}
        for velocities in simulation.velocities():
            v = simulation.share.gather(velocities)[self._nodes]
            velocity = _in_space(v)
            velocity[self._ends, :2] += v[self._ends, 2:] * arms[:, ::-1] * (-1.0, 1.0)
            at_points |= {"velocity": velocity, "angular velocity": v[:, 2]}
        return at_points, self._in_cells(simulation)

    def _in_cells(self, simulation: StateView) -> dict[str, Array]:
        forces = simulation.section_forces()
        in_cells: dict[str, Array] = {name: forces[:, k] for k, name in enumerate("NVM")}
        if self._inelastic:
            jump, dissipated = simulation.damage()
            in_cells |= {"jump": jump, "dissipated energy": dissipated}
        in_cells = {name: self._spread(values) for name, values in in_cells.items()}
        if len(self._pulling):
            rods = in_cells["N"][len(self.cells) - self._num_rods :]
            rods[self._pulling] = simulation.connections()[self._along, 1]
        return in_cells

    def _spread(self, values: Array) -> Array:
        """Values of the cells of beams in all lines; zero in those of bodies and connectors."""
        return np.append(np.repeat(values, self._pieces_of_cell), np.zeros(self._num_rods))


def _in_space(plane: Array) -> Array:
    """The first two of three components, and zero across the plane; (n, 3)."""
    vectors = plane.copy()
    vectors[:, 2] = 0.0
    return vectors
