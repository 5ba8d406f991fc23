# SPDX-License-Identifier: MIT
"""Reference solver of scenes in space: Newton's method by a plain loop over kernels.

Assembly in lanes, static condensation, prediction and search of the ordinary solver are not used.
The ordinary step then accepts the solution, so that results have the ordinary form.
"""

from __future__ import annotations

from dataclasses import replace
from typing import Any

from mpi4py import MPI

import numpy as np
from scipy.sparse import coo_array
from scipy.sparse.linalg import splu

from ufl_beam.arrays import Array
from ufl_beam.blocks.block import Block
from ufl_beam.errors import ArgumentError, StepFailed
from ufl_beam.mechanics.time_scheme import Step, has_inertia, stages_of
from ufl_beam.simulation.simulation import Simulation
from ufl_beam.simulation.stepper import MOST_SUBSTEPS
from ufl_beam.solvers.newton_options import Newton, checked_newton

SMALL_CHANGE = 1e-9
"""Largest change of the last iterate but one, in sizes of the scene or rad."""


class ReferenceInSpace(Simulation):
    """Simulation by the reference solver in space.

    Raises:
        ArgumentError: The solver leaves out a part of the scene, or there are several processes.
    """

    def __init__(
        self, *arguments: Any, newton: Newton | None, comm: MPI.Intracomm, **more: Any
    ) -> None:
        plain = replace(checked_newton(newton, comm), reference=False)
        super().__init__(*arguments, newton=plain, comm=comm, **more)
        refused = {
            f"{comm.size} processes": comm.size > 1,
            "supports that move or have their own axes": self.supports.turned or self.supports.work,
            "loads that act from the start of statics": self._applies,
            f"{self.scheme!r}": len(stages_of(self.scheme)) > 1,
        }
        for what, refuses in refused.items():
            if refuses:
                raise ArgumentError(
                    f"Newton: reference=True in space cannot be combined with {what}; leave it out"
                )

    def steps_to(self, ends: Array, *, keep: bool = False) -> int:
        """Go to one of the times ``ends``; return 1.

        Raises:
            ConvergenceError: Even the smallest substep failed.
        """
        end, begin, done, some = float(ends[0]), self.t, 0, MOST_SUBSTEPS
        while done < MOST_SUBSTEPS:
            last = done + some == MOST_SUBSTEPS
            t1 = end if last else begin + (end - begin) * (done + some) / MOST_SUBSTEPS
            row: Array = np.zeros((1, self._writer.columns.width))
            try:
                self._accept_given(np.array([t1, end, 0.0]), self._solve(t1, end), row)
                done += some
            except StepFailed as failure:
                if some == 1:
                    self.give_up(failure, t1)
                some //= 2
        if keep:
            self.keep()
        return 1

    def _solve(self, t1: float, end: float) -> Array:
        """Return the configuration at the end of a step."""
        equation, last_dt = self.equation, float(self.prediction.c.dt)
        self._evaluate_controllers()
        equation.begin(Step.create(self.scheme, self.t, t1, end, self.q))
        x = self.q + (t1 - self.t) / last_dt * (self.q - self.q_before)
        scales = self.numbering.scales
        free = np.setdiff1d(np.arange(len(x)), self.supports.dofs)
        x[self.supports.dofs] = self.q[self.supports.dofs]
        change = last = np.inf
        for _ in range(self.newton.max_iterations):
            r, K, size = self._equation(x)
            left = float(np.linalg.norm((equation.weights * r)[free]))
            if change <= SMALL_CHANGE and (left <= self.newton.rtol * size or left > last / 2):
                return x  # to the tolerance, or to round-off
            last = left
            try:
                step = splu(K[free][:, free].tocsc()).solve(r[free])
            except RuntimeError:
                raise StepFailed("the tangent is singular") from None
            x[free] -= step
            equation.c.total += 1
            change = float(np.abs(step * scales[free]).max(initial=0.0))
        raise StepFailed(f"Newton's method changes the iterate by {change:.1e} without an end")

    def _equation(self, x: Array) -> tuple[Array, Any, float]:
        """Return the residual at ``x``, its tangent, and the sum of the sizes of forces."""
        r, K, size = np.zeros(len(x)), coo_array((len(x), len(x))).tocsr(), 0.0
        rows, columns, values = list[Array](), list[Array](), list[Array]()
        for term in self.terms:
            own = np.zeros(len(x))
            term.add_residual(x, own)  # laws choose their branches
            if isinstance(term, Block):
                own[:] = 0.0
                for dofs, forces, entries, tangent in term.each_element(x):
                    np.add.at(own, dofs, forces)
                    rows.append(dofs[entries[: len(tangent), 0]])
                    columns.append(dofs[entries[: len(tangent), 1]])
                    values.append(tangent)
            size += float(np.linalg.norm(self.equation.weights * own))
            r += own
        if values:
            places = np.concatenate(rows), np.concatenate(columns)
            K = K + coo_array((np.concatenate(values), places), shape=K.shape).tocsr()
        if has_inertia(self.scheme):
            K = K + self.inertia.c.now.inertia[0] * self.inertia.M.sparse()
        return r, K, size
