# SPDX-License-Identifier: MIT
"""Base of the terms of connectors."""

from __future__ import annotations

import numpy as np

from ufl_beam.arrays import Array, Index
from ufl_beam.compiled.c_library import Loop
from ufl_beam.compiled.csr import Csr
from ufl_beam.discretization.partition import Share
from ufl_beam.model.connectors import Connector
from ufl_beam.terms.base import Beams
from ufl_beam.terms.connector_responses import Response
from ufl_beam.terms.openings import Openable


class Links(Beams):
    """Connectors that are alike; each has a force among the unknowns.

    Attributes:
        numbers: Of the connectors in the scene's links.
        work: That they have taken since the beginning; (num_links,); J.
        rate: Mean rate of the motions in the last step; (num_links,); m/s or rad/s.
    """

    kind = "connectors"

    def __init__(self, share: Share, here: Index, A: Csr) -> None:
        self.numbers: Index = share.links[here]
        self.links: list[Connector] = [share.grid.scene.links[i] for i in self.numbers]
        self._dofs = share.link_dofs[here].astype(np.int32)
        self._forces_at = self._dofs[:, 6]
        self._A = A
        self._before: Array = np.zeros(len(self.links))
        self.work: Array = np.zeros(len(self.links))
        self.rate: Array = np.zeros(len(self.links))
        self.response = Response(self.links)

    def force(self, q: Array) -> Array:
        """Forces that resist the growth of the motions; (num_links,); N or N m."""
        return q[self._forces_at]

    def motion(self, q: Array) -> Array:
        """Relative motions at ``q``; (num_links,); m or rad."""
        raise NotImplementedError

    def rates(self, q: Array, v: Array) -> Array:
        """Rates of the motions at ``q`` if the velocities are ``v``; (num_links,); m/s or rad/s."""
        return np.zeros(len(self.links))

    def shown_motion(self, q: Array) -> Array:
        """Motions of the accepted state ``q`` as solutions show them; (num_links,); m or rad."""
        return self.response.motion(self.motion(q))

    def demand(self) -> Loop | None:
        """Return the C function of :meth:`excess` with its data, if there is one."""
        return None

    def excess(self, q: Array, r: Array, force: float, moved: float) -> float:
        """Largest residual of a law, without dimension, see :meth:`Equation.missed`."""
        raise NotImplementedError

    def again(self) -> None:
        """Begin the step again: forget what its iterates have tried."""
        self.response.again()

    def put_motions(self, q: Array, v: Array, works: Array) -> None:
        """Put what laws of forces work on in the step ``v`` from ``q`` in the place of forces."""

    def take(self, q: Array) -> None:
        """Take the forces in ``q`` as those before the next step."""
        self._before[:] = self.force(q)

    def effort(self, q1: Array) -> float:
        """Sum of the sizes of the works that the connectors take in the step to ``q1``; J."""
        return 0.0

    # -- yielding, which most laws do not know -------------------------------------------------

    def flows(self) -> bool:
        """Return whether a connector of this process slips plastically in the latest iterate."""
        return self.response.flows()

    def dissipation(self, q1: Array) -> float:
        """Energy that connectors of this process dissipate plastically in the step to ``q1``; J."""
        return 0.0

    def dissipated(self) -> Array:
        """Energy that each connector has dissipated by yielding and softening; (num_links,); J."""
        return self.response.dissipated

    def remaining(self) -> Array:
        """Part of the elastic stiffness that is left in the latest iterate; (num_links,)."""
        return self.response.remaining()

    @property
    def openable(self) -> Openable | None:
        """Connectors that open beyond a limit, if there are."""
        return self.response.openable

    def freeze(self) -> None:
        """Keep everything elastic from now on: nothing yields or breaks further."""
        self.response.freeze()
