# SPDX-License-Identifier: MIT
"""Runs of the old solver with the interface of the present one."""

import math

from mpi4py import MPI

import numpy as np

from old_reference.solver import Solver
from ufl_beam.discretization.partition import Subdomain
from ufl_beam.discretization.state_transfer import same_unknowns
from ufl_beam.errors import ArgumentError, ConvergenceError, StepFailed
from ufl_beam.mechanics.time_scheme import has_inertia
from ufl_beam.model.works import Effect
from ufl_beam.output.recorder import StateView
from ufl_beam.parallel import Agreement, ProcessComparison
from ufl_beam.simulation.impacts import impacts_of
from ufl_beam.simulation.initial_state import (
    checked_numbering,
    chosen_state,
    continuation,
    initial_state,
    mesh_of,
)
from ufl_beam.simulation.reference_run import ReferenceRun
from ufl_beam.simulation.solution import Solution
from ufl_beam.solvers.newton_options import checked_newton, require_plain


class OldSimulation(Solver):
    """Present state of a run by the old solver."""

    warn = StateView.warn

    def __init__(self, scene, scheme, *, t0, start, newton, mesh, comm):
        if comm.size > 1:
            require_plain(newton, f"mpirun, here with {comm.size} processes")
        self.newton = newton = checked_newton(newton, comm)
        start = chosen_state(start, "start")
        numbering, _ = checked_numbering(scene, scheme, mesh_of(start, mesh), fresh=start is None)
        q, v, internal, _ = state = initial_state(numbering, start)
        t0, same = continuation(start, scene, t0)
        impacts, impact = impacts_of(numbering, scheme, t0, start, same, state)
        v = v if impact is None else impact.v
        options = {"max_iterations": newton.max_iterations, "petsc": newton.petsc}
        super().__init__(numbering, scheme, t0, q, v, rtol=newton.rtol, **options)
        between = float(scheme.average(0.0, 1.0))
        self.start(None if start is None else internal, same=same)
        self.impacts = impacts
        if impacts is not None and impacts.moves:
            self.ledger.lost["impacts"] += 0.0
        self.meet(impact)
        if (
            start is not None
            and start.equilibrium_fraction == between
            and same_unknowns(start.numbering, numbering)
        ):
            goes_on = same and "reactions" in internal and not len(start.v)
            if goes_on or has_inertia(scheme):
                self.on_nodes, self.q_before = start.cell_resultants(-1), start.before(-1)
        self.solution = Solution(scene, numbering)
        self.solution.equilibrium_fraction, self.solution.needs_start = between, between < 1
        self.solution.scheme, self.parameter = scheme, self.solution.parameter
        self.comm, self.together = comm, Agreement(comm)
        self.subdomain = Subdomain(numbering, MPI.COMM_SELF)
        self.comparison = ProcessComparison(MPI.COMM_SELF, self.subdomain)

    def steps_to(self, ends, *, keep=False):
        for end in map(float, ends[:16]):
            try:
                self.step_to(end)
            except StepFailed as failure:
                raise ConvergenceError(
                    f"no equilibrium after t = {self.t:.9g} s: {failure}. {self.scheme.advice}",
                    time=self.t, dt=end - self.t, solution=self.solution,
                    residuals=failure.residuals, forces={}, reason=failure.reason,
                ) from failure  # fmt: skip
            if keep:
                self.keep()
        return len(ends[:16])

    def keep(self):
        columns, row = self.now.row(0)
        if self.substeps == 0 and has_inertia(self.scheme):
            columns.column_of("reactions", row).fill(math.nan)
        self.solution.append(columns, row)
        self.solution.count(self.substeps, self.iterations)

    def end(self):
        if self.t not in self.solution.times[-1:]:
            self.keep()
        self.solution.internal = self.internal()

    def random_work(self, q, s):
        return float(self._round_off(q) @ np.abs(s))

    def watch(self, fractions):
        require_plain(self.newton, "Extremes")

    def close(self):
        pass


def simulation_by_either(scene, scheme, **options):
    """The present solver, or the old one, which has no statements of users, for other scenes."""
    try:
        return ReferenceRun(scene, scheme, **options)
    except ArgumentError as error:
        own = any(isinstance(work, Effect) for work in scene.works)
        if own or "reference=True cannot be combined" not in str(error):
            raise
    return OldSimulation(scene, scheme, **options)
