# SPDX-License-Identifier: MIT
"""Convergence of Newton's method, in tolerances without a dimension."""

from __future__ import annotations

import math
from typing import Any

from petsc4py import PETSc

import numpy as np
import numpy.typing as npt

from ufl_beam.arrays import Array
from ufl_beam.compiled.c_library import doubles, ffi, fill, lib
from ufl_beam.discretization.partition import Share
from ufl_beam.errors import StepFailed
from ufl_beam.solvers.equation import Equation
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
    """Sizes of residuals and motions, and the decision to stop; ``c``: ``judge`` of newton.c."""

    def __init__(
        self, share: Share, equation: Equation, x: Array, r: Array, newton: Newton, least: int
    ) -> None:
        self._share, self._x, self._r = share, x, r
        self._held, self._owned = equation.held, slice(share.num_owned)
        self._weights = equation.weights
        self._norm = (share.size, doubles(self._weights))
        self._moves = np.ones(share.size, dtype=np.uint8)
        self.leave_out(np.zeros(share.size, dtype=bool))
        self.diagonal = equation.A.diagonal(np.arange(share.size, dtype=np.int32))
        self._at_r = doubles(self._r)
        self._last_loads: list[Array] = []
        self._loads = 0.0
        # Only statics needs round-off and a step at once; loops over matrices are over before.
        change = np.empty(share.size) if len(equation.force) else share.scratch
        self.c = fill(
            equation.c,
            scene=share.grid.scene.size, rtol=newton.rtol, rate=math.inf,
            modified=newton.modified, most=newton.max_iterations, least=least,
            residual=r, change=change, space=share.scratch, lengths=share.lengths(),
            diagonal=self.diagonal, tangent=equation.A.data,
            moves=ffi.from_buffer("uint8_t[]", self._moves),
        )  # fmt: skip

    # -- sizes ---------------------------------------------------------------------------------

    def size(self, forces: Array) -> float:
        """Euclidean norm over the scene of forces, and moments over its size; N."""
        return self._size(doubles(forces))

    def _size(self, forces: Any) -> float:
        return self._over_processes(lib.norm(*self._norm, forces))

    def _over_processes(self, here: float) -> float:
        """Norm over the scene, from that of the part of this process."""
        return here if self._share.alone else math.hypot(*self._share.comm.allgather(here))

    def take_loads(self, loads: list[Array]) -> None:
        """Take vectors of the loads for the scale; new arrays where they have changed."""
        # On several processes they may change on some only.
        if not self._share.alone or list(map(id, loads)) != list(map(id, self._last_loads)):
            self._last_loads = loads
            self._loads = self.c.loads = sum(map(self.size, loads))

    def leave_out(self, idle: npt.NDArray[np.bool_]) -> None:
        """Expect no round-off where supports hold, and where a stiffness holds idle motions."""
        self._moves[:] = ~idle
        self._moves[self._held] = 0

    def scale(self) -> float:
        """Size of the loads and of the internal forces in the latest residual; N."""
        return self._loads + self._over_processes(self.c.inner_size)

    def residuals(self) -> Array:
        """Sizes of the latest residual, moments over the size of the scene, ghosts zero; N."""
        return np.asarray(np.abs(self._r) * self._weights)

    def work(self, step: Array) -> float:
        """Work of the latest residual on a step; J."""
        return self._share.total(float(self._r[self._owned] @ step[self._owned]))

    # -- the test ------------------------------------------------------------------------------

    def begin(self, patience: int, *, like_last: bool) -> None:
        """Begin an iteration that ends after so many residuals in a row without half the least."""
        lib.begin_newton(self.c, patience, like_last)

    def test(self, iteration: int) -> int:
        """Return why to stop after an iteration, or zero."""
        residual, floor = self._size(self._at_r), 0.0
        if not math.isfinite(residual):
            return int(lib.DIVERGED)
        scale = self.scale()
        nearly = iteration > 1 and residual > self.c.rtol * scale
        if nearly or self.c.demands:
            self._find_motion(self._x)
        if self.c.demands:  # all processes make a new tangent, or none
            self.c.switched[0] = int(self._share.largest(float(self.c.switched[0])))
        if nearly or (iteration > 1 and self.c.demands):
            floor = 8 * self.size(self._round_off(self._x))
        return int(lib.judge(self.c, doubles(self._x), iteration, residual, scale, floor))

    def failure(self, reason: int, iterations: int) -> StepFailed:
        """Describe why Newton's method has stopped without a solution."""
        names = {v: k for k, v in vars(PETSc.SNES.ConvergedReason).items() if isinstance(v, int)}
        scale = self.scale()
        residuals = self._share.grid.worst(self._share.gather(self.residuals()))
        places = [f"{size:.1e} N in {place}" for place, size in [*residuals.items()][:3]]
        failure = StepFailed(
            f"Newton's method {REASONS.get(reason, 'was stopped by PETSc')} after {iterations} "
            f"iterations; residual {self._size(self._at_r):.3e} N, largest: "
            f"{', '.join(places) or 'nowhere'}; forces in the scene {scale:.3e} N"
        )
        failure.residuals = residuals
        failure.reason = str(names.get(reason, reason))
        return failure

    # -- round-off -----------------------------------------------------------------------------

    def _round_off(self, x: Array) -> Array:
        """Residual that the last digit of displacements, strains and rotations at ``x`` makes; N.

        Stiff or finely divided beams cannot be solved any better, however small the forces are.
        """
        forces = np.empty(self._share.size)
        lib.find_round_off(self.c, doubles(x), doubles(forces))
        return forces

    def _find_motion(self, x: Array) -> None:
        """Note the largest motion in any process, at most the size of the scene."""
        largest = lib.largest_motion(*self._norm, doubles(x))
        self.c.moved = min(self._share.largest(largest), self.c.scene)

    def least_work(self, s: Array) -> float:
        """Work in a step ``s`` of what the last digit of displacements makes; less is none; J."""
        self._find_motion(self._x)
        works = self._round_off(self._x) * np.abs(s)
        return self._share.total(float(works[self._owned].sum()))

    def random_work(self, x: Array, s: Array) -> float:
        """Work in a step ``s`` of the last digits at ``x``, were they independent; J."""
        self._find_motion(x)
        works = self._round_off(x) * s
        return math.sqrt(self._share.total(float(np.sum(works[self._owned] ** 2))))
