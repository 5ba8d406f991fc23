# SPDX-License-Identifier: MIT
"""Internal variables and forces that a run passes on to one that starts where it ends."""

from __future__ import annotations

import numpy as np

from ufl_beam.arrays import Array
from ufl_beam.discretization.state_io import NOWHERE, Restoring, Saving, State
from ufl_beam.model.connector_laws import Coulomb
from ufl_beam.simulation.assembly import Assembly


def internal_variables(parts: Assembly, q: Array) -> State:
    """Return what cells and connectors remember, reactions and accelerations."""
    memory = Saving(parts.equation.share)
    for one in parts.remembering:
        one.remember(memory, q)
    if parts.supports.work or any(isinstance(link.law, Coulomb) for link in parts.asked):
        parts.supports.carry_on(memory, q)
    if parts.inertia is not None:
        parts.inertia.carry_on(memory, len(parts.inertia.more))
    return memory.state()


def take_internal_variables(parts: Assembly, q: Array, internal: State, *, same: bool) -> None:
    """Take over :func:`internal_variables` of another run.

    Args:
        parts: The terms of this one.
        q: The initial configuration at the local degrees of freedom.
        internal: What the other run has passed on.
        same: Whether no force has changed since, so that accelerations are still what they were.
    """
    memory = Restoring(parts.equation.share, internal)
    for one in parts.remembering:
        one.remember(memory, NOWHERE)
    if "reactions" in internal:
        parts.supports.carry_on(memory, q)
    if parts.inertia is not None and same:
        known = sum(name in internal for name in parts.inertia.scheme.kept)
        parts.inertia.carry_on(memory, known)


def bear(parts: Assembly, force: Array, loads: list[Array]) -> None:
    """Set the reactions to those of the initial state of a static run.

    Args:
        parts: The terms.
        force: The internal forces of that state.
        loads: The loads that it is in equilibrium with; none if nothing acts yet.
    """
    r = np.asarray(force - sum(loads))
    parts.supports.enter(r)
    parts.supports.hold(parts.equation.share.added(r))
    parts.supports.take()
