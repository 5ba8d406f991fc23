# SPDX-License-Identifier: MIT
"""Check that a static step followed the path of equilibria, and did not leap to another one."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from ufl_beam.arrays import Array
from ufl_beam.compiled.c_library import Loop, doubles, ffi, struct
from ufl_beam.discretization.partition import Share
from ufl_beam.discretization.state_io import Memory
from ufl_beam.errors import StepFailed
from ufl_beam.mechanics.time_schemes import Scheme
from ufl_beam.terms.energy_ledger import Ledger

FAR = 1e3
"""Largest motion of a node in a static step that is no mechanism; sizes of the scene or radians."""

KINK = 1e-6
"""Work that a kink of a law may leave unexplained, as a part of the energy that went through."""


class StaticPath:
    """Checks of a static step before it is accepted, from the state in which the path begins.

    The internal forces must account for what a step stores and dissipates.  Otherwise Newton's
    method may have found another branch of equilibria: beyond a limit load, or where softening lets
    go more than it dissipates.  The ``slack`` of the scheme says how much work may stay
    unexplained; ``force`` are the internal forces at the end of the last step.
    """

    _c: Any

    def __init__(self, share: Share, scheme: Scheme, ledger: Ledger, force: Array) -> None:
        self._share, self._scheme, self._ledger, self.force = share, scheme, ledger, force

    def remember(self, memory: Memory, q: Array) -> None:
        """The internal forces at the end of the last step."""
        self.force[:] = memory.added("internal forces", self.force)

    def failure(self, mechanism: bool) -> StepFailed:
        """Describe why the latest step was not followed: it leaves a mechanism, or leaps."""
        c = self._c
        if mechanism:
            return StepFailed(
                f"a node moves by {c.moves:.1e} times the size of the scene, or turns by so many "
                "radians, in the step: what yields and what has opened leave a mechanism"
            )
        return StepFailed(
            f"the step stores and dissipates {c.stored:.3e} J, but the forces along it do "
            f"{c.work:.3e} J of work: it leaps to another branch of equilibria, or is too long "
            "to tell"
        )

    def in_c(self, changes: Sequence[Loop]) -> Any:
        """``static_path`` of loops.h; ``changes`` are those of the terms."""
        parts = self._ledger.state, self._ledger.supplied, self._ledger.lost
        per_far = np.full(self._share.size, 1 / self._share.grid.scene.size)
        per_far[self._share.rotations()] = 1.0
        self._c = struct(
            "static_path", slack=self._scheme.slack, far=FAR, kink=KINK, per_far=per_far,
            force=self.force, terms=len(changes),
            weight_of_before=self._scheme.weight_of_before,
            change=ffi.new("change_call[]", list(changes)), accounts=len(parts),
            account=ffi.new("double *[]", [doubles(part.numbers) for part in parts]),
            entries=np.array([len(part) for part in parts], dtype=np.int32),
        )  # fmt: skip
        return self._c
