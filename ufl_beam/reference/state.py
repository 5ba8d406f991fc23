# SPDX-License-Identifier: MIT
"""State of a running simulation, as controllers and friction see it."""

from __future__ import annotations

from typing import Any

import numpy as np

from ufl_beam.arrays import Array
from ufl_beam.errors import SceneError
from ufl_beam.model.bodies import Anchor
from ufl_beam.model.connectors import Connector
from ufl_beam.model.joints import Joint
from ufl_beam.model.supports import Support
from ufl_beam.output.joint_histories import links_of, motion_of, velocity_of
from ufl_beam.output.state_rows import Connection


class Now:
    """State between two steps, by objects of the scene.

    Attributes:
        t: Time; s.
        scene: Model.
        scheme: Time scheme.
    """

    def __init__(self, solver: Any) -> None:
        self._solver, self.t, self._grid = solver, solver.t, solver.grid
        self.scene, self.scheme = solver.grid.scene, solver.scheme

    def displacement(self, place: Anchor) -> Array:
        """Displacement and rotation (u, v, ψ) of a place; (3,); m, m, rad."""
        return np.asarray(motion_of(self._grid, place, self._solver.q[None])[0])

    def velocity(self, place: Anchor) -> Array:
        """Velocity (du/dt, dv/dt, dψ/dt) of a place; (3,); m/s, m/s, rad/s.

        Raises:
            SceneError: The run is static.
        """
        if self._solver.inertia is None:
            raise SceneError(
                f"velocity of {place}: the run is static; there is none. A controller for both "
                "kinds of runs can ask now.scheme.dynamic"
            )
        q, v = self._solver.q[None], self._solver.inertia.v[None]
        return np.asarray(velocity_of(self._grid, place, q, v)[0])

    def connector(self, connector: Connector) -> Connection:
        """Motion, force, work and rate of a connector at the end of the last step.

        Raises:
            SceneError: It is not in the scene.
        """
        (number,) = links_of(self.scene, connector)
        return Connection(*self._solver.connections()[number].tolist())

    def press(self, joint: Joint | Support) -> float:
        """Size of the force of a joint or a support at the end of the last step; N.

        Raises:
            SceneError: The joint shares its displacement; make it with ``measured=True``.
        """
        if isinstance(joint, Support):
            force = self._solver.supports.forces()[self.scene.supports.index(joint)]
            return float(np.linalg.norm(force[:2]))
        links = self.scene.links
        numbers = [n for n in links_of(self.scene, joint) if not links[n].turns]
        return float(np.linalg.norm(self._solver.connections()[numbers, 1]))

    def reactions(self) -> Array:
        """Forces of all supports on the scene; (num_supports, 3); N, N, N m."""
        return np.asarray(self._solver.supports.forces())
