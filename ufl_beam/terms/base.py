# SPDX-License-Identifier: MIT
"""Virtual works that a scene may contribute to the equation of a step.

A term adds its part of the residual and of the tangent at the end of the step, and says what the
step did to the energy.  Vectors hold the local degrees of freedom of a process, ghosts included;
what several processes add to one degree of freedom is summed by the solver.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Callable, Sequence
from typing import Any, NamedTuple

from ufl_beam.arrays import Array, Index
from ufl_beam.compiled.c_library import Loop, doubles
from ufl_beam.compiled.csr import Csr
from ufl_beam.discretization.state_io import Memory
from ufl_beam.terms.phases import Callbacks, Phases

KINDS = ("beams", "connectors", "loads", "inertia", "damping")
"""Kinds of forces."""


class InCells(NamedTuple):
    """Forces on the nodes of cells, as a term states them; see cell_forces.py.

    Attributes:
        form: Makes the form whose entries are the forces; those of its latest evaluation count.
        kind: ``force_kind`` of loops.h.
        order: Positions in ``share.cells`` of its cells.
        vector: If the form is linear, and nothing else evaluates it: place of the address of the
            vector that it is evaluated at.
        factor: Factor of the forces.
        q0: If the form depends on the configurations at both ends of the step alone: the first.
    """

    form: Callable[[], Any]
    kind: int
    order: Index
    vector: Any = None
    factor: float = 1.0
    q0: Any = None


class Term(ABC):
    """Virtual work of one physical effect; a method that a term does not define does nothing."""

    kind: str
    """Kind of its forces, one of :data:`KINDS`."""

    _A: Csr
    """Matrix that takes the tangent."""

    _loops: tuple[Loop, Loop | None]

    def loops(self) -> tuple[Loop, Loop | None]:
        """Return C functions of residual and tangent, with their data."""
        return self._loops

    @abstractmethod
    def phases(self, callbacks: Callbacks) -> Phases:
        """Return C functions of the beginning and the acceptance of a step; called once."""

    def in_cells(self) -> Sequence[InCells]:
        """Forces on the nodes of cells; none if all act between nodes that joints may share."""
        return ()

    def add_residual(self, q1: Array, r: Array) -> None:
        """Add the virtual work at ``q1`` to ``r``."""
        (force, data), _ = self.loops()
        force(data, doubles(q1), doubles(r))

    def add_tangent(self, q1: Array) -> None:
        """Add the derivative at ``q1`` to the matrix that the term was made with."""
        _, tangent = self.loops()
        if tangent is not None:
            tangent[0](tangent[1], doubles(q1), doubles(self._A.data))

    def add_tangent_change(self, q1: Array, u: Array) -> None:
        """Add the derivative of the tangent at ``q1`` along ``u``; no internal variable changes."""

    def start(self, q: Array) -> None:
        """Take ``q`` for the accepted configuration, which no step has led to."""

    def remember(self, memory: Memory, q: Array) -> None:
        """State what later steps depend on; ``q`` is the configuration of the state."""


class InternalForces(Term):
    """Forces inside a scene: those of its cells and connectors."""

    must_dissipate = False
    """True if :meth:`require_dissipation` has to be called before a step is accepted."""

    def require_dissipation(self, q1: Array) -> None:
        """Raise :class:`StepFailed` if the law of a point gives energy in the step to ``q1``."""
