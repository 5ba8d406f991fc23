# SPDX-License-Identifier: MIT
"""Steps of a scene in time, with the search for hinges that open, and checks of each step."""

from __future__ import annotations

import math
import sys
from typing import Any

from mpi4py import MPI

import numpy as np

from ufl_beam.arrays import Array, State
from ufl_beam.discretization.dof_numbering import DofNumbering
from ufl_beam.dolfinx_compat import fem
from ufl_beam.errors import StepFailed
from ufl_beam.mechanics.time_scheme import Scheme, Step, acting, nodal_step
from ufl_beam.model.bodies import Body, Member
from ufl_beam.model.functions import still, value_at
from ufl_beam.reference.hinges import Hinge
from ufl_beam.reference.nonlinear_problem import NonlinearProblem
from ufl_beam.reference.points import Points

LARGEST_ROTATION = 0.75 * math.pi
"""Largest rotation of a node in a step, as 2 tan(Δψ/2) is infinite at π; rad."""

LARGEST_RIGID_ROTATION, BENT = 0.5, 1 / 50
"""Largest rotation of a part without strain in a static step, rad; relative difference of rotations
of the nodes of a beam up to which it counts as such."""

MOST_SUBSTEPS = 2**12
"""Largest number of substeps of a step."""

APPLYING, APPLYING_ROTATION, SHORT_SUBSTEP = 1 / 8, 0.02, 512
"""Fraction of the first step in which loads of the initial time are applied, if equilibrium holds
inside steps; largest rotation of a node in a substep of it, rad; its number of substeps from which
this limit does not apply."""

EXCESS_DECAY, EXCESS_TOLERANCE = 0.7, 1e-9
"""Fraction of the largest excess above which points open; its power n in the n-th round.  Largest
difference of excesses that count as equal."""

MOST_ROUNDS, MOST_RETURNS = 40, 3
"""Largest number of rounds, and of those in which hinges turn back."""

KINK_WORK = 1e-6
"""Largest difference of work and energy by kinks of laws, relative to the sum of the ledger."""


class Solver(NonlinearProblem):
    """State of a scene, and its steps.

    Args:
        impacts: Finds impacts where prescribed rates jump; None if no rate does.

    Attributes:
        y1: Coordinates at the end of the step.
        s: Steps of the nodes on which forces do work.
        energies: Sum of all energies so far; J.
    """

    energies = 0.0
    on_cells_before: Array
    reached: Array
    y: Array

    def __init__(
        self, numbering: DofNumbering, scheme: Scheme, t: float, *, newton: Any,
        comm: MPI.Intracomm, impacts: Any = None,
    ) -> None:  # fmt: skip
        super().__init__(numbering, scheme, t, newton=newton, comm=comm)
        self.impacts, self.substeps = impacts, 0
        self.last_dt, self._rejected = math.inf, 0.0

    def start(self, q: Array, v: Array, internal: State | None, *, same: bool) -> None:
        """Begin with a configuration, velocities, and the internal variables of another run.

        ``same`` is True if scene and time are as at the end of that run.
        """
        frame, fields = self.frame, self.fields
        self.fresh, self.q, self.q_before, self.y = internal is None, q, q, frame.E.T @ q
        self.y_before, rates = self.y, frame.E.T @ v
        rates[frame.held[[f == still for f in frame.motions]]] = 0.0  # at fixed supports
        self.v = frame.E @ rates
        fields.q0.x.array[:] = fields.q1.x.array[:] = q[frame.dofs]
        strains = fields.strains()
        for points in self.points:
            points.start(strains, internal or {})
            # Forces of beams at rest are computed in a step that is too short for viscous flow.
            points.begin(sys.float_info.min, hold=True)
            points.return_map(strains, stiff=False)
        for group in self.connectors:
            group.accept(q)
        self.reached = self.factors = self._factors() * (not self.fresh)
        self.load = self.factors @ self.of_loads
        self.on_cells_before = fields.forces_on_cells(fields.on_cells[0])
        self.elastic = self.elastic_energy()

    # -- a step, and its substeps ----------------------------------------------------------------

    def step_to(self, t1: float) -> None:
        """Go to the time ``t1``, in one step or, if it fails, in substeps.

        Raises:
            StepFailed: Even the smallest substep failed.
        """
        at_end = self.dynamic or self.scheme.average(0.0, 1.0) == 1.0
        first = self.substeps == 0 and self.fresh and not at_end
        if first and any(f(self.t) != 0 for _, f in self.scene.time_functions()):
            self._in_substeps(self.t + APPLYING * (t1 - self.t), at_rest=self.t)
            self.last_dt = math.inf  # the next guess does not extrapolate these substeps
        self._in_substeps(t1)

    def _in_substeps(self, t1: float, at_rest: float | None = None) -> None:
        """Go to ``t1`` at once, or in substeps: halves, quarters, and so on.

        If ``at_rest`` is a time, the loads of that time are applied, and nodes must not turn far.
        """
        t0, done, substep, self._rejected = self.t, 0, MOST_SUBSTEPS, 0.0
        while done < MOST_SUBSTEPS:
            last = done + substep == MOST_SUBSTEPS
            end = t1 if last else t0 + (t1 - t0) * (done + substep) / MOST_SUBSTEPS
            step = Step.create(self.scheme, self.t, end, t1, self.q)
            if at_rest is not None:
                step = step._replace(load_time=at_rest, motion_time=at_rest)
            try:
                turn = self._solve(step)
                short = SHORT_SUBSTEP * step.dt <= t1 - t0
                if at_rest is not None and turn > APPLYING_ROTATION and not short:
                    raise StepFailed("a node turns too far while the first loads are applied")
            except StepFailed:
                if substep == 1:
                    raise
                substep //= 2
                continue
            self.accept(step)
            done += substep
            if done % (2 * substep) == 0 and substep < MOST_SUBSTEPS:
                substep *= 2  # a larger substep can begin here

    def _solve(self, step: Step) -> float:
        """Find the end of a step; return the largest rotation of a node; rad."""
        frame, ratio = self.frame, step.dt / self.last_dt
        if self.dynamic:
            self._meet_jumps(step)
            scheme: Any = self.scheme
            self.coefficients = scheme.coefficients(step.dt, self.last_dt, 0)
        held = self.y[frame.held]
        ends = np.array([value_at(f, step.motion_time, "support") for f in frame.motions])
        self.motions = held + step.fraction * (ends - held)
        self.growths = step.fraction * (self._factors(step.load_time) - self.reached)
        self.factors = self.reached + step.at * self.growths
        self.load = self.factors @ self.of_loads
        for group in self.connectors:
            group.begin(step)
        guess = (self.y + ratio * (self.y - self.y_before))[frame.mine]
        for hold in (True, False):
            for part in self.parts:
                part.begin(step.dt, hold=hold)
            try:
                self._equilibrium(guess)
                break
            except StepFailed:
                if not hold or not any(isinstance(part, Points) for part in self.opening):
                    raise  # a second search of hinges of zero length would repeat the first
        return self._check(step)

    def _equilibrium(self, guess: Array) -> None:
        """Find an equilibrium in which nothing opens without need: largest excesses open first."""
        hinges, turned_back = [part for part in self.opening if isinstance(part, Hinge)], 0
        for k in range(MOST_ROUNDS):
            self._newton(guess)
            back = sum(hinge.turns_back() for hinge in hinges)
            excess = max((float(np.max(p.excess, initial=0.0)) for p in self.opening), default=0.0)
            (excess,) = map(float, self._largest(excess))
            if not back and excess == 0.0:
                return
            if (turned_back := turned_back + bool(back)) > MOST_RETURNS:
                break
            for part in self.opening:
                part.release(EXCESS_DECAY**k * excess - EXCESS_TOLERANCE)
            guess = self.x.array.copy()
        raise StepFailed("hinges open and close again and again")

    def _check(self, step: Step) -> float:
        """Raise :class:`StepFailed` if a step turns a part too far, or leaps to another branch."""
        numbering, frame, scheme = self.numbering, self.frame, self.scheme
        self.y1 = frame.coordinates(self.x, self.motions)
        self.q1 = frame.E @ self.y1
        self.s = nodal_step(scheme, self.q, self.q1, numbering.rotations)
        self.s[numbering.multipliers] = 0.0
        turn = float(np.abs(self.q1 - self.q)[numbering.rotations].max(initial=0.0))
        if scheme.limits_rotation and not turn <= LARGEST_ROTATION:
            raise StepFailed(
                f"a node turns by {turn:.3g} rad in the step, more than the limit of 0.75 π; "
                "reduce dt"
            )
        self.on_cells = self.fields.forces_on_cells(self.fields.on_cells[0])
        if not (scheme.half_tangents and self.dynamic):
            self._require_small_turns()
        if not self.dynamic and math.isfinite(scheme.slack):
            self._require_path()
        return turn

    def _require_small_turns(self) -> None:
        """Raise if a step turns a body, or a beam without strain, by more than the limit."""
        members: list[Member | Body] = [*self.scene.beams, *self.scene.bodies]
        for member in members:
            turns = (self.q1 - self.q)[self.numbering.nodes_of(member)[1][:, 2]]
            largest = float(np.abs(turns).max())
            if np.ptp(turns) <= BENT * largest and largest > LARGEST_RIGID_ROTATION:
                raise StepFailed(f"{member.name} turns by {largest:.3g} rad in the step")

    def _require_path(self) -> None:
        """Raise if the work of the internal forces in a step is not the change of the energy."""
        steps = self.s[self.numbering.dofs[self.numbering.cells[self.frame.cells]]]
        work = np.sum(acting(self.scheme, self.on_cells_before, self.on_cells) * steps)
        change = self.elastic_energy() - self.elastic
        change += sum(points.change() for points in self.points)
        sums = np.array([work, change])
        self.comm.Allreduce(MPI.IN_PLACE, sums)
        work, change = map(float, sums)
        size = abs(work) + abs(change)
        slack = self.scheme.slack * size + KINK_WORK * (self.energies + self._rejected)
        if abs(work - change) > slack + 8 * self.random_work(self.q1, self.s):
            self._rejected = self._rejected or size
            raise StepFailed(
                f"the step stores and dissipates {change:.3e} J, but the forces along it do "
                f"{work:.3e} J of work: it leaps to another branch of equilibria"
            )

    def random_work(self, q: Array, s: Array) -> float:
        """Return the work that round-off of a configuration does on a step ``s``; J."""
        diagonal = self.K.getDiagonal().array
        dofs = self.frame.dofs[: len(diagonal)]
        works = diagonal * np.spacing(np.abs(q[dofs])) * s[dofs]
        return math.sqrt(self.comm.allreduce(float(works @ works)))

    def accept(self, step: Step) -> None:
        """Accept the end of a step."""
        if self.dynamic:
            of_step, of_v, *_ = self.coefficients.rates[0]
            self.v = of_step * self.s + of_v * self.v  # equation (87)
        for part in self.parts:
            part.accept()
        for group in self.connectors:
            group.accept(self.q1)
        self.reached, self.last_dt = self.reached + self.growths, step.dt
        self.y_before, self.q_before, self.y, self.q = self.y, self.q, self.y1, self.q1
        self.t, self.substeps = step.t1, self.substeps + 1
        self.fields.q0.x.array[:] = self.fields.q1.x.array
        self.on_cells_before, self.elastic = self.on_cells, self.elastic_energy()

    def _meet_jumps(self, step: Step) -> None:
        """Let velocities meet rates of motions that have jumped."""
        if self.impacts is not None:
            counts = self.impacts.after(self.last_dt, self.t, step.t1)
            self.meet(self.impacts.find(self.q, self.v, self.t, counts, {}, longest=step.dt / 4))

    def meet(self, impact: Any) -> None:
        """Change the velocities by an impact, if there is one."""
        if impact is not None:
            self.v = impact.v

    def elastic_energy(self) -> float:
        """Return the energy of the elastic cells of this process at ``q1``; J."""
        return float(fem.assemble_scalar(self.fields.elastic_energy))
