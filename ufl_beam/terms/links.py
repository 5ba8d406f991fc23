# SPDX-License-Identifier: MIT
"""Base of the terms of connectors."""

from __future__ import annotations

import numpy as np

from ufl_beam.arrays import Array, Index
from ufl_beam.compiled.csr import Csr
from ufl_beam.discretization.dof_numbering import Share
from ufl_beam.model.connectors import Connector


class Links:
    """Connectors that are alike; each has a force among the unknowns.

    Args:
        share: The degrees of freedom of this process.
        here: Which of its connectors.
        A: Matrix that takes the tangent.

    Attributes:
        numbers: Of the connectors in the scene's links.
        links: The connectors.
        work: That they have taken since the beginning; (num_links,); J.
        rate: Mean rate of the motions in the last step; (num_links,); m/s or rad/s.
    """

    def __init__(self, share: Share, here: Index, A: Csr) -> None:
        self.numbers: Index = share.links[here]
        self.links: list[Connector] = [share.grid.scene.links[i] for i in self.numbers]
        self._dofs = share.link_dofs[here].astype(np.int32)
        self._forces_at = self._dofs[:, 6]
        self._A = A
        self._before: Array = np.zeros(len(self.links))
        self.work: Array = np.zeros(len(self.links))
        self.rate: Array = np.zeros(len(self.links))

    def force(self, q: Array) -> Array:
        """Forces that resist the growth of the motions; (num_links,); N or N m."""
        return q[self._forces_at]

    def again(self) -> None:
        """Begin the step again: forget what its iterates have tried."""

    def put_motions(self, q: Array, v: Array, works: Array) -> None:
        """Put what laws of forces work on in the step ``v`` from ``q`` in the place of forces."""

    def take(self, q: Array) -> None:
        """Take the forces in ``q`` as those before the next step."""
        self._before[:] = self.force(q)
