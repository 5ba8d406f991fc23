# SPDX-License-Identifier: MIT
"""Runs by the reference solvers: their scope, and results in the form of other runs."""

from __future__ import annotations

import math
from abc import ABC, abstractmethod
from collections.abc import Sequence
from dataclasses import replace
from typing import Any

from mpi4py import MPI

import numpy as np
from scipy.sparse import coo_array
from scipy.sparse.linalg import splu

from ufl_beam.arrays import Array
from ufl_beam.blocks.block import Block as Elements
from ufl_beam.compiled.c_library import fill
from ufl_beam.discretization.dof_numbering import DofNumbering
from ufl_beam.errors import ArgumentError, StepFailed
from ufl_beam.mechanics.point_equations import rows
from ufl_beam.mechanics.time_scheme import Scheme, Step, has_inertia, stages_of
from ufl_beam.mechanics.time_schemes import EnergyMomentum, EnergyMomentumStatic, Static
from ufl_beam.model.connector_laws import PrescribedMotion
from ufl_beam.model.connectors import law_of
from ufl_beam.model.loads import Gravity, LineLoad, PointLoad, Rayleigh
from ufl_beam.model.softening_laws import SofteningLaw
from ufl_beam.reference.solver import Solver
from ufl_beam.simulation.impacts import Impact
from ufl_beam.simulation.initial_state import StateOf
from ufl_beam.simulation.simulation import APPLYING, Simulation
from ufl_beam.simulation.stepper import MOST_SUBSTEPS
from ufl_beam.solvers.newton_options import Newton, checked_newton

SCHEMES = Static, EnergyMomentum, EnergyMomentumStatic
DEAD_LOADS = PointLoad, LineLoad, Gravity


def require_scope(numbering: DofNumbering, scheme: Scheme, comm: MPI.Intracomm) -> None:
    """Raise :class:`ArgumentError` if the solver leaves out a part of the scene, or the scheme."""
    scene = numbering.scene
    kinds = {id(kind): kind for kind, _ in numbering.inelastic}.values()
    sections = {beam.section for beam in scene.beams}
    several = [s for s in sections if len(s.section_points(s.hinge)) > 1]
    connectors = (c for c in scene.all_connectors if c not in scene.hinges)
    known = isinstance(scheme, SCHEMES) and getattr(scheme, "order", 2) == 2
    refused: dict[str, Sequence[object]] = {
        "a scene without beams,": [scene] * (not scene.beams),
        "the scheme": [scheme] * (not known),
        "a mesh of degree above 1": [numbering.mesh] * (numbering.mesh.degree > 1),
        "the law of": [c for c in connectors if not isinstance(c.law, PrescribedMotion)],
        "the law of the hinge": [
            hinge for hinge in scene.hinges if not isinstance(law_of(hinge), SofteningLaw)
        ],
        "the load": [x for x in scene.loads if not isinstance(x, DEAD_LOADS)],
        "the damping": [x for x in scene.damping if not isinstance(x, Rayleigh) or x.tangent],
        "the work": scene.works,
        "the law": [
            kind.kind.law for kind in kinds
            if kind.kind.law.solves or rows(kind.kind.law, "strain") != ("strain",)
        ],
        "laws of several classes in": several,
        f"{comm.size} processes for": [numbering] * (comm.size > len(numbering.cells)),
    }  # fmt: skip
    for kind, objects in refused.items():
        for what in objects:
            raise ArgumentError(
                f"Newton: reference=True cannot be combined with {kind} {what}: the reference "
                "solver computes beams with resultants or fibres, hinges, joints, bodies and dead "
                "loads, see docs/theory.md; leave it out"
            )


class ReferenceRun(Simulation, ABC):
    """Simulation that another solver than the ordinary one steps.

    The ordinary step checks and accepts the configurations that it finds, so that results have the
    ordinary form.  The classes take the arguments of :class:`Simulation`.
    """

    def __init__(
        self, *arguments: Any, newton: Newton | None, comm: MPI.Intracomm, **more: Any
    ) -> None:
        self.options = checked_newton(newton, comm)
        plain = replace(self.options, reference=False, petsc={})
        super().__init__(*arguments, newton=plain, comm=comm, **more)

    @abstractmethod
    def _solve(self, step: Step) -> Array:
        """Return the configuration at the end of a step, at the degrees of freedom here."""

    def steps_to(self, ends: Array, *, keep: bool = False) -> int:
        """Go to one of the times ``ends``; return 1.

        Raises:
            ConvergenceError: Even the smallest substep failed.
        """
        c, end = self.time_loop, float(ends[0])
        if self._applies and self.substeps == 0:
            first = self.t + APPLYING * (end - self.t)
            fill(c, begin_of_run=self.t, applied_by=first)
            self._in_substeps(first, loads_of=self.t)
            c.prediction.dt = math.inf  # the next step is not extrapolated from this one
        self._in_substeps(end)
        if keep:
            self.keep()
        return 1

    def _in_substeps(self, end: float, loads_of: float | None = None) -> None:
        """Go to a time at once, or in substeps: halves, quarters, and so on.

        With ``loads_of``, the loads of that time are applied.
        """
        c, begin, done, some, rejected = self.time_loop, self.t, 0, MOST_SUBSTEPS, 0.0
        row: Array = np.zeros((1, self._writer.columns.width))
        while done < MOST_SUBSTEPS:
            last = done + some == MOST_SUBSTEPS
            t1 = end if last else begin + (end - begin) * (done + some) / MOST_SUBSTEPS
            try:
                if c.meet_jumps and self.t + 1e-9 * (t1 - self.t) >= c.next_jump:
                    c.next_jump = self._meet_jumps(t1)
                step = Step.create(self.scheme, self.t, t1, end, self.q)
                if loads_of is not None:
                    step = step._replace(load_time=loads_of, motion_time=loads_of)
                given = np.array([t1, end, loads_of is not None])
                if self._path is not None:
                    self._path.c.rejected = rejected
                self._accept_given(given, self._solve(step), row)
                self._accepted()
            except StepFailed as failure:
                if some == 1:
                    self.give_up(failure, t1)
                if self._path is not None:
                    rejected = self._path.c.rejected
                some //= 2
                continue
            done += some
            if done % (2 * some) == 0 and some < MOST_SUBSTEPS:
                some *= 2  # a larger substep can begin here

    def _accepted(self) -> None:
        """Accept the end of the latest step."""


class ReferenceInPlane(ReferenceRun):
    """Simulation by the solver in :mod:`ufl_beam.reference`."""

    def __init__(self, *arguments: Any, start: StateOf | None, **more: Any) -> None:
        super().__init__(*arguments, start=start, **more)
        numbering, comm = self.numbering, self.comm
        require_scope(numbering, self.scheme, comm)
        self.problem = problem = Solver(numbering, self.scheme, newton=self.options, comm=comm)
        internal = self.equation.internal_variables(self.q, self.t, self.prediction)
        q, v = map(self.subdomain.gather, (self.q, *(self.velocities() or [0.0 * self.q])))
        problem.start(self.t, q.copy(), v.copy(), internal, fresh=start is None)

    @property
    def snes(self) -> Any:
        """See the base class."""
        return self.problem.snes

    def _solve(self, step: Step) -> Array:
        problem, before = self.problem, self.problem.iterations
        problem.last_dt = float(self.prediction.c.dt)
        try:
            q1: Array = problem.solve_step(step)[self.subdomain.dofs]
            return q1
        finally:
            self.equation.c.total += problem.iterations - before

    def _meet(self, equation: Any, impact: Impact | None) -> None:
        super()._meet(equation, impact)
        if impact is not None and hasattr(self, "problem"):
            self.problem.v = impact.v

    def _accepted(self) -> None:
        self.problem.accept()

    def close(self) -> None:
        """Destroy the PETSc objects."""
        self.problem.close()
        super().close()


SMALL_CHANGE = 1e-9
"""Largest change of the last iterate but one, in sizes of the scene or rad."""


class ReferenceInSpace(ReferenceRun):
    """Simulation in space by Newton's method in a plain loop over kernels.

    Assembly in lanes, static condensation, prediction and search of the ordinary solver are not
    used.

    Raises:
        ArgumentError: The solver leaves out a part of the scene, or there are several processes.
    """

    def __init__(self, *arguments: Any, comm: MPI.Intracomm, **more: Any) -> None:
        super().__init__(*arguments, comm=comm, **more)
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

    def _solve(self, step: Step) -> Array:
        equation, last_dt = self.equation, float(self.prediction.c.dt)
        self._evaluate_controllers()
        equation.begin(step)
        x = self.q + step.dt / last_dt * (self.q - self.q_before)
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
            if not np.isfinite([left, K.sum()]).all():
                raise StepFailed("a force is not a finite number")
            try:
                apart = splu(K[free][:, free].tocsc()).solve(r[free])
            except RuntimeError:
                raise StepFailed("the tangent is singular") from None
            x[free] -= apart
            equation.c.total += 1
            change = float(np.abs(apart * scales[free]).max(initial=0.0))
        raise StepFailed(f"Newton's method changes the iterate by {change:.1e} without an end")

    def _equation(self, x: Array) -> tuple[Array, Any, float]:
        """Return the residual at ``x``, its tangent, and the sum of the sizes of forces."""
        r, K, size = np.zeros(len(x)), coo_array((len(x), len(x))).tocsr(), 0.0
        rows, columns, values = list[Array](), list[Array](), list[Array]()
        for term in self.terms:
            own = np.zeros(len(x))
            term.add_residual(x, own)  # laws choose their branches
            if isinstance(term, Elements):
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
