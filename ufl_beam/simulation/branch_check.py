# SPDX-License-Identifier: MIT
"""Check that a static step followed the path of equilibria, and did not leap to another one."""

from __future__ import annotations

import math
import sys
from collections.abc import Sequence
from typing import Any

import numpy as np

from ufl_beam.arrays import Array
from ufl_beam.compiled.c_library import Loop, doubles, ffi, struct
from ufl_beam.discretization.partition import Share
from ufl_beam.discretization.state_io import Memory
from ufl_beam.errors import StepFailed
from ufl_beam.mechanics.time_schemes import Scheme
from ufl_beam.terms.base import InternalForces
from ufl_beam.terms.energy_ledger import Ledger
from ufl_beam.terms.links import Links
from ufl_beam.terms.phases import weight_of_before

FAR = 1e3
"""Largest motion of a node in a static step that is no mechanism; sizes of the scene or radians."""

KINK = 1e-6
"""Work that a kink of a law may leave unexplained, as a part of the energy that went through."""


def add_forces_at_rest(
    beams: Sequence[InternalForces], scheme: Scheme, q: Array, force: Array
) -> None:
    """Add the forces of beams at ``q``, in a step so short that nothing viscous flows."""
    short = scheme.step(0.0, sys.float_info.min, sys.float_info.min, q)
    for beam in beams:
        beam.begin(short)
        beam.add_residual(q, force)


class StaticPath:
    """Checks of a static step before it is accepted, from the state in which the path begins.

    The ``slack`` of the scheme says how much work may stay unexplained; ``force`` are the internal
    forces at the end of the last step.
    """

    def __init__(
        self,
        share: Share,
        scheme: Scheme,
        beams: Sequence[InternalForces],
        couplings: Sequence[Links],
        ledger: Ledger,
        q: Array,
        t0: float,
    ) -> None:
        self._share, self._scheme, self._ledger = share, scheme, ledger
        self._beams, self._couplings = beams, couplings
        self._rotations = share.rotations()
        self.force: Array = np.zeros(share.size)
        # Connectors have theirs among the unknowns.
        add_forces_at_rest(beams, scheme, q, self.force)
        begins = scheme.step(t0, t0 + 1.0, t0 + 1.0, q)._replace(load_time=t0, motion_time=t0)
        for coupling in couplings:
            coupling.begin(begins)
            coupling.add_residual(q, self.force)

    def remember(self, memory: Memory, q: Array) -> None:
        """The internal forces at the end of the last step."""
        self.force = memory.added("internal forces", self.force)

    def require(self, q1: Array, s: Array, force: Array, least_work: float) -> None:
        """Raise :class:`StepFailed` unless the step ``s`` of the nodes to ``q1`` was followed.

        The internal forces, ``force`` in the step, must account for what it stores and dissipates.
        Otherwise Newton's method may have found another branch of equilibria: beyond a limit load,
        or where softening lets go more than it dissipates.  Round-off does the work ``least_work``
        (J).
        """
        moves = np.abs(s) / self._share.grid.scene.size
        moves[self._rotations] = np.abs(s[self._rotations])
        far = self._share.largest(moves.max(initial=0.0))
        if not far <= FAR:
            raise StepFailed(
                f"a node moves by {far:.1e} times the size of the scene, or turns by so many "
                "radians, in the step: what yields and what has opened leave a mechanism"
            )
        if math.isinf(self._scheme.slack):
            return
        total = self._share.total
        work = total(float(self._scheme.acting(self.force, force) @ s))
        in_beams = total(sum(one.change(q1) for one in self._beams))
        change = in_beams + total(sum(one.change(q1) for one in self._couplings))
        # A motor that stretches a spring gives what the spring takes; their sum measures nothing.
        # Connectors count one by one, so that the size is the same on any number of processes.
        size = abs(work) + abs(in_beams) + total(sum(one.effort(q1) for one in self._couplings))
        # Smaller numbers than the least normal one have not all their digits.
        slack = self._scheme.slack * size + least_work + sys.float_info.min
        if abs(work - change) > slack + KINK * total(self._ledger.size()):
            raise StepFailed(
                f"the step stores and dissipates {change:.3e} J, but the forces along it do "
                f"{work:.3e} J of work: it leaps to another branch of equilibria, or is too long "
                "to tell"
            )

    def in_c(self, changes: Sequence[Loop]) -> Any:
        """``static_path`` of loops.h; ``changes`` are those of the terms."""
        parts = self._ledger.state, self._ledger.supplied, self._ledger.lost
        per_far = np.full(self._share.size, 1 / self._share.grid.scene.size)
        per_far[self._rotations] = 1.0
        return struct(
            "static_path", slack=self._scheme.slack, far=FAR, kink=KINK, per_far=per_far,
            force=np.zeros(self._share.size), terms=len(changes),
            weight_of_before=weight_of_before(self._scheme.acting),
            change=ffi.new("change_call[]", list(changes)), accounts=len(parts),
            account=ffi.new("double *[]", [doubles(part.numbers) for part in parts]),
            entries=np.array([len(part) for part in parts], dtype=np.int32),
        )  # fmt: skip

    def accept(self, force: Array) -> None:
        """Take the internal forces of a step as those before the next."""
        self.force = force.copy()
