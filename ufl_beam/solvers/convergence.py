# SPDX-License-Identifier: MIT
"""Convergence of Newton's method, in tolerances without a dimension."""

from __future__ import annotations

import math
from typing import Any

from petsc4py import PETSc

import numpy as np
import numpy.typing as npt

from ufl_beam.arrays import Array, Index
from ufl_beam.compiled.c_library import doubles, ffi, fill, lib
from ufl_beam.compiled.csr import Csr
from ufl_beam.discretization.partition import Share
from ufl_beam.errors import StepFailed
from ufl_beam.solvers.newton_options import Newton

REASONS = {
    lib.SINGULAR: "found a singular tangent",
    lib.TOO_MANY: "did not converge",
    lib.STALLED: "came no closer to an equilibrium",
    lib.DIVERGED: "met a force that is not a finite number",
    -4: "met a force that is not a finite number",  # PETSc's name for it changed in 3.24
}
"""Reasons for which Newton's method stops, in words; by values of SNESConvergedReason."""


class Convergence:
    """Sizes of residuals and motions; newton.c decides by them when to stop.

    Attributes:
        c: ``equation`` of loops.h.
        diagonal: Entries of the tangent on the diagonal.
    """

    def __init__(self, share: Share, c: Any, A: Csr, held: Index, newton: Newton) -> None:
        self._share, self.c, self._held = share, c, held
        self._owned, self._weights = slice(share.num_owned), share.weights()
        self._moves = np.ones(share.size, dtype=np.uint8)
        self.leave_out(np.zeros(share.size, dtype=bool))
        all_dofs = np.arange(share.size, dtype=np.int32)
        self.diagonal = A.positions(all_dofs, all_dofs)
        fill(
            c,
            scene=share.grid.scene.size, rtol=newton.rtol, most=newton.max_iterations,
            space=share.scratch,
            lengths=share.lengths(), diagonal=self.diagonal,
            moves=ffi.from_buffer("uint8_t[]", self._moves),
        )  # fmt: skip

    def size(self, forces: Array) -> float:
        """Euclidean norm over the scene of forces, and moments over its size; N."""
        here = lib.norm(self._share.size, doubles(self._weights), doubles(forces))
        return float(lib.over_processes(self.c, lib.HYPOT, here))

    def scale(self) -> float:
        """Size of the loads and of the internal forces in the latest residual; N."""
        return float(self.c.loads + lib.over_processes(self.c, lib.HYPOT, self.c.inner_size))

    def leave_out(self, idle: npt.NDArray[np.bool_]) -> None:
        """Expect no round-off where supports hold, and where a stiffness holds idle motions."""
        self._moves[:] = ~idle
        self._moves[self._held] = 0

    def residuals(self) -> Array:
        """Sizes of the latest residual, moments over the size of the scene, ghosts zero; N."""
        r = np.frombuffer(ffi.buffer(self.c.residual, 8 * self._share.size))
        return np.asarray(np.abs(r) * self._weights)

    def random_work(self, x: Array, s: Array) -> float:
        """Work in a step ``s`` of the last digits at ``x``, were they independent; J."""
        forces = np.empty(self._share.size)
        lib.find_motion(self.c, doubles(x))
        lib.find_round_off(self.c, doubles(x), doubles(forces))
        works = (forces * s)[self._owned]
        return math.sqrt(self._share.total(float(np.sum(works**2))))

    def failure(self) -> StepFailed:
        """Describe why Newton's method has stopped without a solution."""
        names = {v: k for k, v in vars(PETSc.SNES.ConvergedReason).items() if isinstance(v, int)}
        reason, residuals = self.c.reason, self.residuals()
        worst = self._share.grid.worst(self._share.gather(residuals))
        places = [f"{size:.1e} N in {place}" for place, size in [*worst.items()][:3]]
        size = lib.over_processes(self.c, lib.HYPOT, float(np.linalg.norm(residuals)))
        failure = StepFailed(
            f"Newton's method {REASONS.get(reason, 'was stopped by PETSc')} after "
            f"{self.c.iterations} iterations; residual {size:.3e} N, largest: "
            f"{', '.join(places) or 'nowhere'}; forces in the scene {self.scale():.3e} N"
        )
        failure.residuals, failure.reason = worst, str(names.get(reason, reason))
        return failure
