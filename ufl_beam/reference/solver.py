# SPDX-License-Identifier: MIT
"""Steps of a scene in time, with the search for hinges that open, and checks of each step."""

from __future__ import annotations

import math
import sys

from mpi4py import MPI

import numpy as np

from ufl_beam.arrays import Array, State
from ufl_beam.dolfinx_compat import fem
from ufl_beam.errors import StepFailed
from ufl_beam.mechanics.time_scheme import Step, acting, acts_at_end, has_inertia
from ufl_beam.model.functions import still, value_at
from ufl_beam.reference.connectors import Hinge
from ufl_beam.reference.points import Points
from ufl_beam.reference.step_problem import StepProblem

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


class Solver(StepProblem):
    """State of a scene, and its steps."""

    energies = 0.0  # sum of all energies so far, which a run with a ledger updates; J
    substeps = 0  # number of steps so far; substeps count as steps
    last_dt = math.inf  # length of the last step; s

    def start(self, q: Array, v: Array, internal: State | None) -> None:
        """Begin with a configuration, velocities, and the internal variables of another run."""
        frame, fields = self.frame, self.fields
        self.fresh, self.q, self.q1, self.y = internal is None, q, q, frame.E.T @ q
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
        self.reached = self.factors = self._factors(self.t) * (not self.fresh)
        self.load = self.factors @ self.of_loads
        self._assemble_forces()
        self._keep()

    def _factors(self, t: float) -> Array:
        """Return the factors of the loads at a time."""
        return np.array([value_at(load.amplitude, t, load) for load in self.scene.loads])

    def _keep(self) -> None:
        """Keep forces and energies of the accepted state, for the check of the next step."""
        self.r_before, self.elastic = self.r.x.petsc_vec.array.copy(), self._elastic_energy()

    # -- a step, and its substeps ----------------------------------------------------------------

    def step_to(self, t1: float) -> None:
        """Go to the time ``t1``, in one step or, if it fails, in substeps.

        Raises:
            StepFailed: Even the smallest substep failed.
        """
        at_end = self.dynamic or acts_at_end(self.scheme)
        first = self.substeps == 0 and self.fresh and not at_end
        if first and any(f(self.t) != 0 for _, f in self.scene.time_functions()):
            self._in_substeps(self.t + APPLYING * (t1 - self.t), load_time=self.t)
            self.last_dt = math.inf  # the next guess does not extrapolate these substeps
        self._in_substeps(t1)

    def _in_substeps(self, t1: float, load_time: float | None = None) -> None:
        """Go to ``t1`` at once, or in substeps: halves, quarters, and so on.

        With ``load_time``, the loads of that time are applied, and nodes must not turn far.
        """
        t0, done, substep, self._rejected = self.t, 0, MOST_SUBSTEPS, 0.0
        while done < MOST_SUBSTEPS:
            last = done + substep == MOST_SUBSTEPS
            end = t1 if last else t0 + (t1 - t0) * (done + substep) / MOST_SUBSTEPS
            step = Step.create(self.scheme, self.t, end, t1, self.q)
            if load_time is not None:
                step = step._replace(load_time=load_time, motion_time=load_time)
            try:
                self._solve(step)
                turn = self._check(step)
                short = SHORT_SUBSTEP * step.dt <= t1 - t0
                if load_time is not None and turn > APPLYING_ROTATION and not short:
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

    def _solve(self, step: Step) -> None:
        """Find the end of a step, if possible without an opening of points that do not flow."""
        frame, scheme = self.frame, self.scheme
        if has_inertia(scheme):
            self.coefficients = scheme.coefficients(step.dt, self.last_dt, 0)
        y = self.y + step.dt / self.last_dt * (self.y - self.y_before)
        ends = np.array([value_at(f, step.motion_time, "support") for f in frame.motions])
        y[frame.held] = self.y[frame.held] + step.fraction * (ends - self.y[frame.held])
        self.growths = step.fraction * (self._factors(step.load_time) - self.reached)
        self.factors = self.reached + step.at * self.growths
        self.load = self.factors @ self.of_loads
        for group in self.connectors:
            group.begin(step)
        for hold in (True, False):
            for part in self.parts:
                part.begin(step.dt, hold=hold)
            try:
                return self._equilibrium(y[frame.mine])
            except StepFailed:
                if not hold or not any(isinstance(part, Points) for part in self.opening):
                    raise  # a second search of hinges of zero length would repeat the first

    def _equilibrium(self, guess: Array) -> None:
        """Find an equilibrium in which nothing opens without need: largest excesses open first."""
        hinges, returns = [part for part in self.opening if isinstance(part, Hinge)], 0
        for k in range(MOST_ROUNDS):
            self.solve(guess)
            back = sum(hinge.turns_back() for hinge in hinges)
            excess = max((float(np.max(p.excess, initial=0.0)) for p in self.opening), default=0.0)
            (excess,) = map(float, self.largest(excess))
            if not back and excess == 0.0:
                return
            if (returns := returns + bool(back)) > MOST_RETURNS:
                break
            for part in self.opening:
                part.release(EXCESS_DECAY**k * excess - EXCESS_TOLERANCE)
            guess = self.x.array.copy()
        raise StepFailed("hinges open and close again and again, or one after the other")

    # -- checks ----------------------------------------------------------------------------------

    def _check(self, step: Step) -> float:
        """Return the largest rotation of a node in a step; rad.

        Raises:
            StepFailed: The step turns a part too far, or leaps to another branch.
        """
        scheme, turns = self.scheme, np.abs(self.q1 - self.q)[self.numbering.rotations]
        turn = float(turns.max(initial=0.0))
        if scheme.limits_rotation and not turn <= LARGEST_ROTATION:
            raise StepFailed(
                f"a node turns by {turn:.3g} rad in the step, more than the limit of 0.75 π; "
                "reduce dt"
            )
        if not (scheme.half_tangents and self.dynamic):
            self._require_small_turns()
        if not self.dynamic and math.isfinite(scheme.slack):
            self._require_path()
        return turn

    def _require_small_turns(self) -> None:
        """Raise if a step turns a body, or a beam without strain, by more than the limit."""
        for part in self.scene.parts:
            turns = (self.q1 - self.q)[self.numbering.nodes_of(part)[1][:, 2]]
            largest = float(np.abs(turns).max())
            if np.ptp(turns) <= BENT * largest and largest > LARGEST_RIGID_ROTATION:
                raise StepFailed(f"{part.name} turns by {largest:.3g} rad in the step")

    def _require_path(self) -> None:
        """Raise if the work of the internal forces in a step is not the change of the energy."""
        r = acting(self.scheme, self.r_before, self.r.x.petsc_vec.array)
        change = self._elastic_energy() - self.elastic
        change += sum(points.change() for points in self.points)
        sums = np.array([r @ self.s[self.frame.dofs[: len(r)]], change])
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

    def _elastic_energy(self) -> float:
        """Return the energy of the elastic cells of this process at ``q1``; J."""
        return float(fem.assemble_scalar(self.fields.elastic_energy))

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
        self.y_before, self.y, self.q = self.y, self.y1, self.q1
        self.t, self.substeps = step.t1, self.substeps + 1
        self.fields.q0.x.array[:] = self.fields.q1.x.array
        self._keep()
