# SPDX-License-Identifier: MIT
"""Virtual works that a scene may contribute to the equation of a step.

A term adds its part of the residual and of the tangent at the end of the step, and says what the
step did to the energy.  Vectors hold the local degrees of freedom of a process, ghosts included;
what several processes add to one degree of freedom is summed by the solver.
"""

from __future__ import annotations

from abc import ABC
from collections.abc import Sequence

from ufl_beam.arrays import Array
from ufl_beam.compiled.c_library import Loop, doubles
from ufl_beam.compiled.csr import Csr
from ufl_beam.discretization.state_io import Memory
from ufl_beam.mechanics.time_schemes import Step
from ufl_beam.terms.in_cells import InCells
from ufl_beam.terms.phases import Callbacks, Phases

KINDS = ("beams", "connectors", "loads", "inertia", "damping")
"""Kinds of forces."""


class Term(ABC):
    """Virtual work of one physical effect; a method that a term does not define does nothing."""

    kind: str
    """Kind of its forces, one of :data:`KINDS`."""

    _A: Csr
    """Matrix that takes the tangent."""

    def loops(self) -> tuple[Loop, Loop | None] | None:
        """Return C loops of residual and tangent with data; None where Python evaluates them."""
        return None

    def phases(self, callbacks: Callbacks) -> Phases:
        """Return C functions of a step; by default they call the methods of these names below."""
        return Phases(
            [callbacks.begin(self.begin)], [callbacks.accept(self.accept)],
            [callbacks.add_state(self.add_state)],
        )  # fmt: skip

    def in_cells(self) -> Sequence[InCells]:
        """Forces on the nodes of cells; none if all act between nodes that joints may share."""
        return ()

    def begin(self, step: Step) -> None:
        """Take note of the step that is to be solved."""

    def add_residual(self, q1: Array, r: Array) -> None:
        """Add the virtual work at ``q1`` to ``r``; by default as C does."""
        if (loops := self.loops()) is not None:
            (force, data), _ = loops
            force(data, doubles(q1), doubles(r))

    def add_tangent(self, q1: Array) -> None:
        """Add the derivative at ``q1`` to the matrix that the term was made with."""
        if (loops := self.loops()) is not None and loops[1] is not None:
            tangent, data = loops[1]
            tangent(data, doubles(q1), doubles(self._A.data))

    def add_tangent_change(self, q1: Array, u: Array) -> None:
        """Add the derivative of the tangent at ``q1`` along ``u``; no internal variable changes."""

    def accept(self, q1: Array, s: Array) -> None:
        """Take the end of the step as the new state, and enter what the step supplied or lost.

        ``s`` is the step of the nodes that the virtual works are works on.
        """

    def start(self, q: Array) -> None:
        """Take ``q`` for the accepted configuration, which no step has led to."""

    def add_state(self, q: Array) -> None:
        """Enter the energy that the term holds in the accepted state ``q``."""

    def remember(self, memory: Memory, q: Array) -> None:
        """State what later steps depend on; ``q`` is the configuration of the state."""


class InternalForces(Term):
    """Forces inside a scene: those of its cells and connectors."""

    must_dissipate = False
    """True if :meth:`require_dissipation` has to be called before a step is accepted."""

    def require_dissipation(self, q1: Array) -> None:
        """Raise :class:`StepFailed` if the law of a point gives energy in the step to ``q1``."""
