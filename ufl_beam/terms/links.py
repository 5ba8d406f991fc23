# SPDX-License-Identifier: MIT
"""Base of the terms of connectors."""

from __future__ import annotations

from abc import abstractmethod
from collections.abc import Iterator

import numpy as np

from ufl_beam.arrays import Array, Index
from ufl_beam.compiled.c_library import Loop
from ufl_beam.compiled.csr import Csr
from ufl_beam.discretization.partition import Share
from ufl_beam.model.connectors import Connector
from ufl_beam.terms.base import InternalForces
from ufl_beam.terms.connector_responses import Setting, respond
from ufl_beam.terms.phases import Callbacks


class Links(InternalForces):
    """Connectors that are alike; each has a force among the unknowns.

    Attributes:
        numbers: Of the connectors in the scene's links.
        response: What their law makes of motions and forces.
        work: That they have taken since the beginning; (num_links,); J.
        rate: Mean rate of the motions in the last step; (num_links,); m/s or rad/s.
    """

    kind = "connectors"

    def __init__(self, share: Share, here: Index, setting: Setting, A: Csr) -> None:
        self.numbers: Index = share.links[here]
        self.links: list[Connector] = [share.grid.scene.links[i] for i in self.numbers]
        self._dofs = share.link_dofs[here].astype(np.int32)
        self._forces_at = self._dofs[:, 6]
        self._A = A
        self._callbacks: Callbacks  # from when the phases are made
        self.response = respond(self.links[0].law, self.links, setting)
        self.must_dissipate = self.response.must_dissipate
        self._before, self.work, self.rate = np.zeros((3, len(self.links)))

    def force(self, q: Array) -> Array:
        """Forces that resist the growth of the motions; (num_links,); N or N m."""
        return q[self._forces_at]

    @property
    def forces_at(self) -> Index:
        """Local degrees of freedom that are the forces; (num_links,)."""
        return self._forces_at

    def kept(self, q: Array) -> Iterator[tuple[str, Array]]:
        """Numbers of the accepted state ``q`` that are added to fields of ``Connection``.

        They are all of these but the forces; (num_links,) each.  Later steps change them.
        """
        yield "motion", self._kept_motion(q)
        yield "work", self.work
        yield "rate", self.rate
        for energy in self.response.dissipated():
            yield "dissipated", energy

    def _kept_motion(self, q: Array) -> Array:
        """Motions of the accepted state as solutions show them."""
        return self.motion(q)

    @abstractmethod
    def motion(self, q: Array) -> Array:
        """Relative motions at ``q``; (num_links,); m or rad."""

    def rates(self, q: Array, v: Array) -> Array:
        """Rates of the motions at ``q`` if the velocities are ``v``; (num_links,); m/s or rad/s."""
        return np.zeros(len(self.links))

    @abstractmethod
    def demand(self) -> Loop:
        """C function of ``demand`` in loops.h with its data: how far laws are missed."""

    def add_residual(self, q1: Array, r: Array) -> None:
        """Add forces and rows of laws, and raise what functions of a user raise."""
        with self._callbacks.raising():
            super().add_residual(q1, r)

    def add_tangent(self, q1: Array) -> None:
        """Add their derivatives, and raise what functions of a user raise."""
        with self._callbacks.raising():
            super().add_tangent(q1)

    def put_motions(self, q: Array, v: Array, works: Array) -> None:
        """Put what laws of forces work on in the step ``v`` from ``q`` in the place of forces."""

    def take(self, q: Array) -> None:
        """Take the forces in ``q`` as those before the next step."""
        self._before[:] = self.force(q)

    def put_forces(self, q: Array) -> None:
        """Put the forces that springs bear in the undeformed scene into its configuration."""
        if (borne := self.response.borne()) is not None:
            q[self._forces_at] = self._before[:] = borne

    def require_dissipation(self, q1: Array) -> None:
        """Raise :class:`StepFailed` if a law gives energy in the step to ``q1``."""
        self.response.require_dissipation(self.motion(q1))

    def dissipation(self, q1: Array) -> float:
        """Energy that connectors of this process dissipate plastically in the step to ``q1``; J."""
        return self.response.dissipation(self.motion(q1), self.force(q1))
