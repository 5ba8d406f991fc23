# SPDX-License-Identifier: MIT
"""Follower loads: forces that turn with the cross-section they act on."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from ufl_beam.arrays import Array
from ufl_beam.compiled.c_library import Loop, fill, loop, struct
from ufl_beam.compiled.csr import Csr
from ufl_beam.discretization.partition import Share
from ufl_beam.discretization.state_io import Memory, Restoring
from ufl_beam.mechanics.time_schemes import Scheme
from ufl_beam.model.loads import FollowerLoad
from ufl_beam.model.time_functions import value_at
from ufl_beam.terms.energy_ledger import Ledger
from ufl_beam.terms.loads import LoadTerm
from ufl_beam.terms.phases import Callbacks, Phases


class FollowerLoads(LoadTerm):
    """Forces that turn with the cross-section they act on."""

    def __init__(
        self, loads: Sequence[FollowerLoad], share: Share, scheme: Scheme, ledger: Ledger, A: Csr
    ) -> None:
        super().__init__(scheme, ledger)
        here = [i for i, load in enumerate(loads) if share.computes(load.place)]
        self._numbers, self._loads = np.array(here, dtype=np.int64), [loads[i] for i in here]
        places = [share.local(share.at(load.place)) for load in self._loads]
        dofs = np.array(places, dtype=np.int32).reshape(-1, 3)
        x, y, self._turning = np.ascontiguousarray(dofs.T)
        loaded: Array = np.zeros(share.size)
        loaded[dofs] = 1.0
        # A process may own degrees of freedom that others load.
        self._dofs = np.flatnonzero(share.added(loaded)).astype(np.int32)
        given = [[*load.force, load.moment] for load in self._loads]
        self._given = np.array(given, dtype=np.float64).reshape(-1, 3)
        # In the equation, at the end of the step, and at that of the last one.
        self._sizes = np.zeros((3, *self._given.shape))
        self._turns, self._size, self._A = np.zeros(len(here)), share.size, A
        # In the latest residual, and in that of the last step.
        self._forces = np.zeros((2, len(self._dofs)))
        self.vector = struct("vector", size=len(self._dofs), dof=self._dofs, values=self._forces[0])
        self._c = struct(
            "follower_loads", number=len(here), size=len(self._dofs), dof=self._dofs,
            at=np.searchsorted(self._dofs, dofs).astype(np.int32), given=self._given,
            turning=self._turning, turn0=self._turns, part=scheme.load_weight,
            now=self._sizes[0], end=self._sizes[1], before=self._sizes[2],
            x=A.positions(x, self._turning), y=A.positions(y, self._turning),
            force=self._forces[0], force_before=self._forces[1],
            weight_of_before=scheme.weight_of_before,
        )  # fmt: skip

    def loops(self) -> tuple[Loop, Loop | None]:
        """C loops of the forces in the plane, and of their derivatives by the rotation."""
        loops = "subtract_follower_loads", "add_tangent_of_follower_loads"
        force, tangent = (loop(name, self._c) for name in loops)
        return force, tangent

    def phases(self, callbacks: Callbacks) -> Phases:
        """Loops over the loads."""
        c = fill(self._c, factor=callbacks.of_time([(load.time, load) for load in self._loads]))
        c.work = self._ledger.supplied.pointer("loads")
        begin, accept = (loop(f"{name}_follower_loads", c) for name in ("begin", "accept"))
        return Phases([begin], [accept])

    def carry_on(self, t: float, q: Array, v: Array | None, past: Restoring | None) -> Array:
        """The loads at time ``t``; take the state ``q`` as one that is in equilibrium with them."""
        self._sizes[:] = self._sizes_at(t)
        self._turns[:] = q[self._turning]
        self.add_residual(q, np.zeros(self._size))
        self._forces[1] = self._forces[0]
        return self._whole(self._forces[0])

    def _sizes_at(self, t: float) -> Array:
        factors = np.array([value_at(load.time, t, load) for load in self._loads])
        return np.asarray(self._given * factors.reshape(-1, 1))

    def _whole(self, forces: Array) -> Array:
        """Forces at all local degrees of freedom, from those that are loaded."""
        whole: Array = np.zeros(self._size)
        whole[self._dofs] = forces
        return whole

    def remember(self, memory: Memory, q: Array) -> None:
        """The forces in the equation of the last step, and their sizes."""
        self._forces[:] = memory.added("follower loads", self._whole(self._forces[1]))[self._dofs]
        self._sizes[:] = memory.rows("follower loads", self._numbers, self._sizes[2])
