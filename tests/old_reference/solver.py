# SPDX-License-Identifier: MIT
"""Solver of a scene in time: the steps, and the state between steps.

:meth:`Solver.step_to` takes a step: substeps, initial guess, search for points that open, SNES with
the sum of all forces, check of static branches, acceptance.
"""

from __future__ import annotations

import math
import sys
from collections import defaultdict
from collections.abc import Callable, Mapping
from functools import partial
from typing import Any

from petsc4py import PETSc

import numpy as np
from scipy.sparse import csr_array

from old_reference.beam_residuals import ElasticBeams, Inertia, YieldingBeams, damping_forces
from old_reference.cell_forms import Archive, Force, Response, Setting
from old_reference.connector_residuals import Connectors, all_connectors
from old_reference.load_vectors import MovingForce, Supports, all_loads
from ufl_beam.arrays import Array
from ufl_beam.discretization.dof_numbering import DofNumbering, turned
from ufl_beam.errors import StepFailed
from ufl_beam.mechanics.time_scheme import Scheme, Step, acting, has_inertia, nodal_step, stages_of
from ufl_beam.model.bodies import Body, Member
from ufl_beam.model.connector_law import ForceLaw
from ufl_beam.model.connector_laws import (
    Controller,
    Coulomb,
    PrescribedMotion,
    RigidPlastic,
    has_friction,
)
from ufl_beam.model.connectors import Connector
from ufl_beam.model.constraint_checks import friction_repeats
from ufl_beam.model.loads import RotatingFrame
from ufl_beam.output.recorder import PresentState
from ufl_beam.output.state_rows import BEFORE, FORCES, Block, Columns, Connection
from ufl_beam.output.states import States

LARGEST_ROTATION = 0.75 * math.pi
"""Rotation of a node above which a step is cut, as 2 tan(Δψ/2) is infinite at π; rad."""

LARGEST_RIGID_ROTATION, BENT = 0.5, 1 / 50
"""Largest rotation of a part without strain in a step, rad; relative difference of rotations of the
nodes of a beam up to which it counts as such."""

MOST_SUBSTEPS = 2**12
"""Largest number of substeps of a step."""

FIRST_TOLERANCE = 1e-4
"""Factor on the tolerance for the guess, in statics also for the first iterate."""

STALL_LIMIT = 8
"""Newton's method stops after this number of iterations that do not halve the least residual."""

TRIAL_STEP = 1 / 16
"""Length of the trial step for initial accelerations, as a fraction of the first step."""

APPLYING = 1 / 8
"""Fraction of the first step, at its beginning, in which loads of the initial time are applied."""

APPLYING_ROTATION = 0.02
"""Largest rotation of a node in a substep while these loads are applied; rad."""

SHORT_SUBSTEP = 512
"""Time in which these loads are applied, divided by the longest substep without this limit."""

EXCESS_DECAY = 0.7
"""Fraction of the largest excess above which points open; its power n in the n-th repetition."""

EXCESS_TOLERANCE = 1e-9
"""Largest difference of excesses that count as equal."""

LARGEST_MOTION = 1e3
"""Largest motion in a static step that is no mechanism; rad, or divided by the scene's size."""

KINK_WORK = 1e-6
"""Largest difference of work and energy due to kinks of laws, relative to the ledger's sum."""

SAMPLE_TOLERANCE = 1e-9
"""Largest distance of the end of a step from a sample time, divided by the sample interval."""

REASONS = PETSc.SNES.ConvergedReason


class Solver(PresentState):
    """State of a scene, and its time steps; controllers get this object as the simulation.

    Args:
        numbering: Numbering of the degrees of freedom.
        scheme: Time scheme.
        t: Time of the initial state; s.
        q: Initial configuration; (size,).
        v: Initial velocities; (size,).
        rtol: Tolerance of the residual, relative to the forces in the scene.
        max_iterations: Largest number of iterations before a step is cut.
        petsc: Options of SNES, without a prefix.

    Attributes:
        forces: All forces of the scene, inner forces first.
        impacts: Finds impacts where prescribed rates jump; None if no rate does.
    """

    impacts: Any = None

    def __init__(
        self, numbering: DofNumbering, scheme: Scheme, t: float, q: Array, v: Array, *, rtol: float,
        max_iterations: int, petsc: dict[str, Any],
    ) -> None:  # fmt: skip
        self.scene, self.numbering, self.scheme, scene = (
            numbering.scene,
            numbering,
            scheme,
            numbering.scene,
        )
        self.t, self.q, self.q_before, self.last_dt = t, q, q, math.inf
        self.substeps = self.iterations = 0
        self._rejected = 0.0  # energy of the first attempt of a step that leapt; J
        controlled = [
            connector
            for connector in scene.all_connectors
            if isinstance(connector.law, Controller | Coulomb)
        ]
        frictional = [
            connector for connector in scene.all_connectors if has_friction(connector.law)
        ]
        self.requested_forces: dict[Connector, float] = dict.fromkeys(controlled, 0.0)
        self.rates: dict[Connector, float] = dict.fromkeys([*controlled, *frictional], 0.0)
        self.samples: dict[Connector, tuple[float, int]] = {}  # first time, last number
        laws = {
            connector: connector.law
            for connector in controlled
            if isinstance(connector.law, Controller)
        }
        self._sampled = {connector: law.sample for connector, law in laws.items() if law.sample}

        repeats = friction_repeats(scene)
        setting = Setting(numbering, scheme, self.requested_forces, self.rates, repeats)
        self.ledger, self.search, self.supports = setting.ledger, setting.search, Supports(setting)
        rest = np.arange(len(numbering.cells))
        self.yielding: list[YieldingBeams] = []
        for section_points, cells in numbering.inelastic:
            self.yielding.append(YieldingBeams(cells, section_points, setting, t))
            rest = np.setdiff1d(rest, cells)
        elastic = [ElasticBeams(rest, setting, t)] if len(rest) else []
        self.beams: list[ElasticBeams | YieldingBeams] = [*self.yielding, *elastic]
        self.connectors = all_connectors(setting)
        self.inertia = None
        if has_inertia(scheme):
            self.inertia = Inertia(setting, scheme, self.supports.stop(v))
        inertia = [] if self.inertia is None else [self.inertia]
        self.loads = all_loads(setting, self.inertia, t)
        self.inner: list[Force] = [*self.beams, *self.connectors]
        damping = damping_forces(setting, self.inertia, self.yielding)
        self.forces: list[Force] = [*self.inner, *self.loads, *inertia, *damping]
        self._groups = [group for group in self.connectors if isinstance(group, Connectors)]
        candidates = (law.opens for group in self._groups for law in group.laws)
        self._candidates: list[Any] = [
            candidate for candidate in candidates if candidate is not None
        ]
        self._candidates += [beams.points for beams in self.yielding if beams.points.softens]

        self._weights: Array = np.ones(numbering.size)  # make forces and moments comparable
        self._weights[numbering.rotations] = 1 / self.scene.size
        self._weights[numbering.multipliers] = 0.0
        self._rtol, self._max_iterations, self._petsc = rtol, max_iterations, petsc
        self._x = q
        self._K: Array = np.zeros((numbering.size, numbering.size))
        self._inner: Array = np.zeros(numbering.size)  # inner forces in the latest residual
        self._inner_before: Array = self._inner
        self._error: Exception | None = None
        self._make_snes()

    def start(self, internal: dict[str, Array] | None, *, same: bool) -> None:
        """Begin with the internal variables of another run, if there are any.

        ``same`` is True if scene and time are as at the end of that run, so that no force has
        jumped.
        """
        scheme, variables = self.scheme, dict(internal or {})
        self._continues = internal is not None
        v = None if self.inertia is None else self.inertia.v
        loads: Array = np.zeros(self.numbering.size)
        if self._continues or (has_inertia(scheme) and scheme.further_rates):
            loads = sum((load.equilibrium(self.t, self.q, v) for load in self.loads), loads)
            for beam in self.beams:
                beam.imposed.start(self.t)
        elif v is not None:
            for load in self.loads:
                if isinstance(load, MovingForce):
                    load.begin_energy(self.t, self.q, v)
        known = same and "reactions" in variables
        if not same:  # rates and forces of the last step belong to the forces before the jump
            lasting = (n for n, x in variables.items() if x.ndim == 2 or n == "reactions")
            variables = {n: variables[n] for n in lasting if not n.startswith("changes of strains")}
        self.internal(variables)
        for force in self.forces:
            force.start(self.q)
        if not self._continues:
            self.q = self.q.copy()
            for group in self.connectors:
                self.q[group.forces_at] = group.before = group.at_rest
        # Forces of beams at rest are computed in a step that is too short for viscous flow.
        short = Step.create(scheme, 0.0, sys.float_info.min, sys.float_info.min, self.q)
        for beam in self.beams:
            self._inner_before = self._inner_before + beam.response(short, self.q)[0]
        self.on_nodes = sum(beam.on_nodes for beam in self.beams)
        if self.inertia is None:
            step = Step.create(scheme, self.t, self.t + 1.0, self.t + 1.0, self.q)
            step = step._replace(load_time=self.t, motion_time=self.t)
            for group in self.connectors:
                group.begin(step)
                self._inner_before = self._inner_before + group.response(step, self.q)[0]
            if not known:
                self.supports.store_reactions(self.supports.axes @ (self._inner_before - loads))
                self.supports.before = self.supports.reactions
        self._sum_energies()

    def internal(self, variables: Mapping[str, Array] | None = None) -> dict[str, Array]:
        """Return the data that later steps need, by name; ``variables`` replace them first."""
        archive, supports = Archive(variables or {}), self.supports
        supports.before = supports.reactions = archive.vector("reactions", supports.before)
        for force in self.forces:
            force.save_or_restore(archive)
        for connector, value in self.requested_forces.items():
            sample = self.samples.get(connector, (math.nan, math.nan))
            at = np.array([self.scene.all_connectors.index(connector)])
            (row,) = archive.rows("asked", at, np.array([[value, *sample, self.t]]))
            self.requested_forces[connector] = float(row[0])
            if math.isfinite(row[1]) and row[3] == self.t:
                self.samples[connector] = float(row[1]), int(row[2])
        together = {name: np.concatenate(arrays) for name, arrays in archive.saved.items()}
        return {n: x if x.ndim == 1 else x[np.argsort(x[:, 0])] for n, x in together.items()}

    def meet(self, impact: Any) -> None:
        """Change the velocities by an impact, if there is one; see :attr:`impacts`."""
        if impact is not None and self.inertia is not None:
            self.inertia.v = self.inertia.v_before = impact.v
            self.inertia.more = ()
            groups = [(group.indices, group.work) for group in self.connectors]
            self.impacts.enter(impact, self.ledger, groups)

    # -- a step, and its substeps ----------------------------------------------------------------

    def step_to(self, t1: float) -> None:
        """Go to the time ``t1``, in one step or, if it fails, in substeps.

        Raises:
            StepFailed: Even the smallest substep failed; the state is the end of the last
                successful substep.
        """
        scheme, scene = self.scheme, self.scene
        at_end = has_inertia(scheme) or scheme.average(0.0, 1.0) == 1.0
        if self.substeps == 0 and not self._continues and not at_end:
            frames = any(isinstance(load, RotatingFrame) for load in scene.loads)
            if frames or scene.works or any(f(self.t) != 0 for _, f in scene.time_functions()):
                # Loads of the initial time are applied first, in a fraction of the step.
                begin, end = self.t, self.t + APPLYING * (t1 - self.t)
                self._in_substeps(end, partial(self._attempt, end=end, at_rest=begin))
                self.last_dt = math.inf  # the next guess does not extrapolate these substeps
        while self.t != t1:
            end = self._next_sample(t1)
            self._in_substeps(end, partial(self._attempt, end=end))

    def _in_substeps(self, t1: float, attempt: Callable[[float], None]) -> None:
        """Go to ``t1`` at once, or in substeps: halves, quarters, and so on."""
        t0, done, substep = self.t, 0, MOST_SUBSTEPS
        self._rejected = 0.0
        while done < MOST_SUBSTEPS:
            last = done + substep == MOST_SUBSTEPS
            try:
                attempt(t1 if last else t0 + (t1 - t0) * (done + substep) / MOST_SUBSTEPS)
            except StepFailed:
                if substep == 1:
                    raise
                substep //= 2
                continue
            done += substep
            if done % (2 * substep) == 0 and substep < MOST_SUBSTEPS:
                substep *= 2  # a larger substep can begin here

    def _attempt(self, t1: float, end: float, at_rest: float | None = None) -> None:
        """Take the substep to ``t1`` of a whole step to ``end``.

        If ``at_rest`` is a time, the loads of that time are applied, and nodes must not turn far.
        """
        inertia = self.inertia
        if self.impacts is not None and inertia is not None:
            counts = self.impacts.after(self.last_dt, self.t, t1)
            state = self.internal() if any(counts) else {}
            at = self.q, inertia.v, self.t, counts, state
            self.meet(self.impacts.find(*at, longest=(t1 - self.t) / 4))
        if inertia is not None and inertia.scheme.further_rates and not inertia.more:
            # A short trial step gives the initial accelerations.
            t = self.t + TRIAL_STEP * (t1 - self.t)
            trial = Step.create(self.scheme, self.t, t, t1, self.q)
            q1, s = self._solve(trial)
            for load in self.loads:
                if isinstance(load, MovingForce):
                    load.prepare(trial, q1)
            inertia.more = inertia.after(s)[1:]
            self.supports.before = self.supports.reactions
            for group in self.connectors:
                group.before = q1[group.forces_at]
        t0, begun = self.t, list[float]()  # begun: times at which stages have begun; s
        try:
            for fraction in np.cumsum(stages_of(self.scheme)[:-1]):
                t = t0 + fraction * (t1 - t0)
                step = Step.create(self.scheme, self.t, t, t, self.q)
                self._accept(step, *self._solve(step))
                begun.append(step.t0)
            step = Step.create(self.scheme, self.t, t1, end, self.q)
            self._finish(step, end, at_rest)
        except StepFailed:
            for t in reversed(begun):  # the equation is the same in both directions of time
                step = Step.create(self.scheme, self.t, t, t, self.q)
                self._accept(step, *self._solve(step))
            self.substeps -= 2 * len(begun)
            raise
        self.substeps -= len(begun)  # stages are no substeps

    def _finish(self, step: Step, end: float, at_rest: float | None) -> None:
        """Solve and accept a step, or the last stage of a step; see :meth:`_attempt`."""
        if at_rest is not None:
            step = step._replace(load_time=at_rest, motion_time=at_rest)
        q1, s = self._solve(step)
        short = at_rest is None or SHORT_SUBSTEP * step.dt <= end - at_rest
        if not short and self._largest_rotation(q1) > APPLYING_ROTATION:
            raise StepFailed("a node turns too far while the loads at the beginning are applied")
        self._accept(step, q1, s)

    def _solve(self, step: Step) -> tuple[Array, Array]:
        """Return the end configuration of a step, and the nodal step on which forces do work."""
        q0, axes = self.q, self.supports.axes
        self.evaluate()
        self.begin(step)
        guess = axes @ (q0 + step.dt / self.last_dt * (q0 - self.q_before))
        self.supports.move(guess, axes @ q0, step)
        q1 = np.asarray(axes.T @ self._equilibrium(guess, step))
        s = nodal_step(self.scheme, q0, q1, self.numbering.rotations)
        s[self.numbering.multipliers] = 0.0
        if (
            self.scheme.limits_rotation
            and not (rotation := self._largest_rotation(q1)) <= LARGEST_ROTATION
        ):
            raise StepFailed(
                f"a node turns by {rotation:.3g} rad in the step, more than the limit of 0.75 π; "
                "reduce dt"
            )
        if (
            not (self.scheme.half_tangents and self.inertia is not None)
            and (rotation := self._largest_rigid_rotation(q1)) > LARGEST_RIGID_ROTATION
        ):
            raise StepFailed(f"a rigid part turns by {rotation:.3g} rad in the step")
        in_beams = sum(beam.change(step, q1) for beam in self.beams)
        in_connectors = sum(group.change(step, q1) for group in self.connectors)
        if self.inertia is None:
            self._require_path(q1, s, in_beams, in_connectors)
        return q1, s

    def _largest_rotation(self, q1: Array) -> float:
        """Return the largest rotation of a node in the step to ``q1``; rad."""
        return float(np.abs(q1 - self.q)[self.numbering.rotations].max(initial=0.0))

    def _largest_rigid_rotation(self, q1: Array) -> float:
        """Return the largest rotation of a body, a beam without strain or a rod of fixed length."""
        scene, numbering, rotations = self.scene, self.numbering, [0.0]
        members: list[Member | Body] = [*scene.beams, *scene.bodies]
        for member in members:
            changes = (q1 - self.q)[numbering.nodes_of(member)[1][:, 2]]
            if np.ptp(changes) <= BENT * (largest := float(np.abs(changes).max())):
                rotations.append(largest)
        for connector, dofs in zip(
            scene.all_connectors, numbering.dofs_of_connectors[:, :6], strict=True
        ):
            if connector.stretches and isinstance(connector.law, PrescribedMotion):
                vectors = []
                for q in (self.q, q1):
                    u, v, ψ = q[dofs].reshape(3, 2)
                    arms = np.array([complex(*arm) for arm in connector.arms])
                    moved = u + 1j * v + (np.exp(1j * ψ) - 1) * arms
                    vectors.append(complex(*connector.apart) + moved[1] - moved[0])
                rotations.append(abs(np.angle(vectors[1] / vectors[0])))
        return max(rotations)

    def _require_path(self, q1: Array, s: Array, in_beams: float, in_connectors: float) -> None:
        """Raise :class:`StepFailed` if a static step leads far away or to another branch.

        Along a path of equilibria the work of the internal forces equals the energy that the step
        stores and dissipates.
        """
        moves = np.abs(s) / self.scene.size
        moves[self.numbering.rotations] *= self.scene.size
        if not moves.max(initial=0.0) <= LARGEST_MOTION:
            raise StepFailed("points that yield or have opened leave a mechanism")
        if math.isinf(self.scheme.slack):
            return
        work = float(acting(self.scheme, self._inner_before, self._inner) @ s)
        size = abs(work) + abs(in_beams)
        size += sum(float(np.abs(group.taken(q1)).sum()) for group in self._groups)
        size += sum((abs(beam.work_on_imposed()) for beam in self.beams), 0.0)
        others = size - abs(work) - abs(in_beams) + abs(in_connectors)
        only_beams = others <= self.scheme.slack * abs(in_beams)
        energies = (abs(x) for account in vars(self.ledger).values() for x in account.values())
        slack = self.scheme.slack * size + sys.float_info.min
        slack += KINK_WORK * (sum(energies) + self._rejected)
        slack += float(self._round_off(self.supports.axes @ q1) @ np.abs(s))
        # Newton's method leaves a residual, and violations of constraints of 1 % of its tolerance.
        moved = min(float((np.abs(q1) * (self._weights > 0)).max()), self.scene.size)
        far = self.scene.size * float(np.linalg.norm(moves)) + 0.01 * moved
        slack += self._rtol * self._scale() * far
        change = in_beams + in_connectors
        if abs(work - change) > slack and not (only_beams and self._stiffens(q1, s)):
            self._rejected = self._rejected or size
            raise StepFailed(
                f"the step stores and dissipates {change:.3e} J, but the forces along it do "
                f"{work:.3e} J of work: it leaps to another branch of equilibria"
            )

    def _stiffens(self, q1: Array, s: Array) -> bool:
        """Return whether internal forces grow faster and faster along the line of a step.

        Between stable states before and after a leap they fall.
        """
        laws = [connector.law for connector in self.scene.all_connectors]
        if self._candidates or any(
            isinstance(law, RigidPlastic | ForceLaw) or has_friction(law) for law in laws
        ):
            return False
        works = [self._inner_before @ s]
        for part in (0.25, 0.5, 0.75, 1.0):
            self.response(self.supports.axes @ (self.q + part * (q1 - self.q)))
            works.append(self._inner @ s)
        growths = np.diff(works)
        return bool(growths[0] >= 0 and np.all(np.diff(growths) >= 0))

    def _accept(self, step: Step, q1: Array, s: Array) -> None:
        """Accept the end of a step, and enter works and losses in the ledger."""
        self._inner_before = self._inner
        for force in self.forces:
            force.accept(step, q1, s)
        self.supports.accept(s)
        self.on_nodes = sum(force.on_nodes for force in self.forces)
        self.q_before, self.last_dt = self.q, step.dt
        self.q, self.t, self.substeps = q1, step.t1, self.substeps + 1
        self._sum_energies()

    def _sum_energies(self) -> None:
        """Sum the stored energies of forces in the accepted state."""
        total: dict[str, float] = defaultdict(float)
        for name, energy in (item for force in self.forces for item in force.stored.items()):
            total[name] += energy
        self.ledger.state = dict(total)

    # -- openings --------------------------------------------------------------------------------

    def _equilibrium(self, guess: Array, step: Step) -> Array:
        """Find the equilibrium of a step without unnecessary opening and slip.

        A point or connector that does not flow at the beginning stays closed if an equilibrium
        exists in which it bears at most its limit.  If several exceed their limits, the largest
        excesses open first.
        """
        if not self._candidates:
            return self._newton(guess)
        self.search.hold, self.search.over = True, False
        try:
            x, times = self._newton(guess), 0
            while excess := max(float(np.max(candidate.excess)) for candidate in self._candidates):
                least = EXCESS_DECAY**times * excess - EXCESS_TOLERANCE
                for candidate in self._candidates:
                    candidate.released |= (candidate.excess > 0) & (candidate.excess >= least)
                x, times = self._newton(x), times + 1
            return x
        except StepFailed:
            if not self.search.over:
                raise  # nothing was kept closed
        finally:
            self.search.hold = False
            for candidate in self._candidates:
                candidate.released = False
        self.begin(step)
        return self._newton(guess)

    # -- the equation of a step ------------------------------------------------------------------

    def begin(self, step: Step) -> None:
        """Begin a step, and reset data of iterates."""
        self._step = step
        for group in self.connectors:
            group.begin(step)

    def response(self, x: Array) -> Response:
        """Return the residual at ``x`` and its derivative, in the axes of the supports."""
        axes, q1, step = self.supports.axes, self.supports.axes.T @ x, self._step
        responses = [force.response(step, q1) for force in self.forces]
        n, none = len(self.inner), np.zeros(len(x))
        self._inner = sum((r for r, _ in responses[:n]), none)
        r = np.asarray(axes @ sum((r for r, _ in responses[n:]), self._inner))
        self.supports.store_reactions(r)
        K = sum((K for _, K in responses), np.zeros((len(x), len(x))))
        return r, np.asarray(axes @ K @ axes.T)

    # -- Newton's method -------------------------------------------------------------------------

    def _make_snes(self) -> None:
        """Make the SNES of steps, whose unknowns are the free degrees of freedom."""
        petsc, n = self._petsc, len(self.supports.free)
        self._vector, f = (PETSc.Vec().createSeq(n) for _ in range(2))
        matrix = PETSc.Mat().createAIJ((n, n), comm=PETSc.COMM_SELF)
        matrix.setOption(PETSc.Mat.Option.NEW_NONZERO_ALLOCATION_ERR, False)
        matrix.setUp()
        self.snes = snes = PETSc.SNES().create(PETSc.COMM_SELF)
        snes.setOptionsPrefix("ub_")
        snes.setFunction(self._function, f)
        snes.setJacobian(self._jacobian, matrix)
        snes.setConvergenceTest(self._converged)
        snes.setTolerances(max_it=self._max_iterations)
        snes.setType("newtonls")
        snes.ksp.setType("preonly")
        snes.ksp.pc.setType("lu")
        snes.ksp.pc.setFactorSolverType("mumps")
        self._set(petsc)
        search = "snes_linesearch_type"  # if not set: full steps, then backtracking if they fail
        self._searches = [{}] if search in petsc else [{search: "basic"}, {search: "bt"}]

    def _set(self, values: dict[str, Any]) -> None:
        """Set options of the SNES."""
        options = PETSc.Options("ub_")
        for name, value in values.items():
            options[name] = value
        self.snes.setFromOptions()
        for name in values:
            options.delValue(name)

    def _newton(self, guess: Array) -> Array:
        """Find the equilibrium from a guess, by SNES; both are in the axes of the supports."""
        for search in self._searches:
            self._set(search)
            self._x, self._error = guess, None
            self._last, self._best, self._slow = math.inf, math.inf, 0
            self._vector.array_w[:] = guess[self.supports.free]
            reason = self._iterate()
            if self._error is not None and not isinstance(self._error, StepFailed):
                raise self._error
            if reason > 0:
                return self._all(self._vector)
            self.begin(self._step)
        raise self._error or self._failure(reason)

    def _iterate(self) -> int:
        """Iterate with SNES; return its reason to stop."""
        try:
            self.snes.solve(None, self._vector)
        except PETSc.Error as error:  # also raised if a callback is interrupted
            cause: BaseException = error
            while cause.__cause__ is not None:
                cause = cause.__cause__
            if not isinstance(cause, PETSc.Error):
                raise cause from None
            self._make_snes()  # MUMPS has found no pivot
            return int(REASONS.DIVERGED_LINEAR_SOLVE)
        self.iterations += self.snes.getIterationNumber()
        return int(self.snes.getConvergedReason())

    def _all(self, vector: PETSc.Vec) -> Array:
        """Return all degrees of freedom from a vector of the free ones."""
        x = self._x.copy()
        x[self.supports.free] = vector.array_r
        return x

    def _function(self, snes: PETSc.SNES, vector: PETSc.Vec, f: PETSc.Vec) -> None:
        """Compute the residual of the free degrees of freedom; NaN after an error stops SNES."""
        try:
            self._r, self._K = self.response(self._all(vector))
        except Exception as error:  # of a user's function
            self._error = error
        if self._error is not None:
            self._r = np.full(self.numbering.size, np.nan)
        f.array_w[:] = self._r[self.supports.free]

    def _jacobian(self, snes: PETSc.SNES, vector: PETSc.Vec, A: PETSc.Mat, P: PETSc.Mat) -> None:
        """Set the derivative with respect to the free degrees of freedom."""
        K = csr_array(self._K[np.ix_(self.supports.free, self.supports.free)])
        if not np.isfinite(K.data).all():
            self._error = self._error or StepFailed("the tangent has entries that are no numbers")
            K.data[:] = 0.0
        P.zeroEntries()
        P.setValuesCSR(*(x.astype(PETSc.IntType) for x in (K.indptr, K.indices)), K.data)
        P.assemble()

    def _converged(self, snes: PETSc.SNES, iteration: int, norms: Any) -> Any:
        """Stop if the residual is small relative to the forces, or as small as round-off allows."""
        x, r = self._all(snes.getSolution()), self._r.copy()
        r[self.supports.constrained] = 0.0
        size = self._norm(r)
        if not math.isfinite(size):
            return REASONS.DIVERGED_FNORM_NAN
        scale = self._scale()
        moved = min(float(np.max(np.abs(x) * (self._weights > 0), initial=0.0)), self.scene.size)
        q1 = self.supports.axes.T @ x
        residual = max(
            (c.relative_residual(q1, r, scale, moved) for c in self.connectors), default=0.0
        )
        # A guess that just meets the tolerance would ignore a small load beside large loads.
        least = 1 if self.inertia is not None else 2
        enough = self._rtol * scale * (FIRST_TOLERANCE if iteration < least else 1.0)
        if size <= enough and residual <= self._rtol:
            return REASONS.CONVERGED_FNORM_ABS
        digits = 8 * self._norm(self._round_off(x)) if iteration > 1 else 0.0
        # A residual of round-off is no longer halved by Newton's method.
        stays = size <= digits and size > self._last / 2
        if iteration > 1 and stays and residual <= max(self._rtol, 1e-10):
            return REASONS.CONVERGED_FNORM_ABS
        self._last, self._slow = size, self._slow + 1
        if size <= self._best / 2:
            self._best, self._slow = size, 0
        return REASONS.DIVERGED_DTOL if self._slow > STALL_LIMIT else REASONS.CONVERGED_ITERATING

    def _scale(self) -> float:
        """Return the size of the forces in the scene; N."""
        return self._norm(self._inner) + sum(self._norm(load.force) for load in self.loads)

    def _norm(self, forces: Array) -> float:
        """Return the norm of forces, and of moments divided by the size of the scene; N."""
        return float(np.linalg.norm(self._weights * forces))

    def _round_off(self, x: Array) -> Array:
        """Return the residuals that round-off of the motions causes; N, N m."""
        motions = np.abs(x) * (self._weights > 0)
        return np.asarray(np.abs(self._K) @ np.spacing(motions))

    def _failure(self, reason: int) -> StepFailed:
        names = {v: k for k, v in vars(REASONS).items() if isinstance(v, int)}
        r = np.abs(self._r) * self._weights
        r[self.supports.constrained] = 0.0
        failure = StepFailed(
            f"Newton's method did not converge ({names.get(reason, reason)}); residual "
            f"{np.linalg.norm(r):.3e} N"
        )
        failure.residuals = self.numbering.worst(np.nan_to_num(r))
        failure.reason = str(names.get(reason, reason))
        return failure

    # -- controllers and friction ----------------------------------------------------------------

    def evaluate(self) -> None:
        """Evaluate controllers and limits of friction; store the rates of motions with friction."""
        for connector in self.requested_forces:
            due = self._due(connector) if connector in self._sampled else None
            if due is None or due != self.samples.get(connector):
                self.requested_forces[connector] = connector.law.evaluate(self, connector)  # type: ignore[union-attr]
            if due is not None:
                self.samples[connector] = due
        if self.inertia is not None:
            groups = (group for group in self._groups if self.rates.keys() & {*group.connectors})
            for group in groups:
                rates = group.rates(self.q, self.inertia.v)
                self.rates.update(zip(group.connectors, map(float, rates), strict=True))

    def _due(self, connector: Connector) -> tuple[float, int]:
        """Return the first sample time of a controller, s, and the index of the due sample."""
        sample, (first, _) = self._sampled[connector], self.samples.get(connector, (self.t, -1))
        digits = SAMPLE_TOLERANCE * sample + 4 * math.ulp(max(self.t, first, key=abs))
        return first, math.floor((self.t - first + digits) / sample)

    def _next_sample(self, end: float) -> float:
        """Return the next sample time of a controller, or ``end`` if that comes first; s."""
        stop = end
        for connector, sample in self._sampled.items():
            first, number = self._due(connector)
            at = first + (number + 1) * sample
            if (
                self.t
                < at
                < stop - SAMPLE_TOLERANCE * sample - 4 * math.ulp(max(at, stop, key=abs))
            ):
                stop = at
        return stop

    # -- the state, by objects of the scene ------------------------------------------------------

    def connections(self) -> Array:
        """Return the columns of ``Connection`` for all connectors; (num_connectors, 5)."""
        table = np.zeros((len(self.scene.all_connectors), len(Connection._fields)))
        for group in self.connectors:
            table[group.indices] = group.columns(self.q)
        return table

    @property
    def now(self) -> States:
        """Present state as a solution; initial static reactions belong to the initial forces."""
        reactions = np.array(self.supports.forces())
        for k, support in enumerate(self.scene.supports):  # in the axes of the support
            reactions[k, :2] = turned(reactions[k, :2], np.full(1, -support.angle))[0]
        degree = self.numbering.mesh.degree
        material = np.zeros((len(self.numbering.inelastic_cells), degree, 6))
        for beams in self.yielding:
            rows = np.searchsorted(self.numbering.inelastic_cells, beams.cells.cell_indices)
            material[rows] += beams.material()
        state = {"t": np.array(self.t), "q": self.q, "reactions": reactions}
        if self.inertia is not None:
            state["v"] = self.inertia.v
        for account, energies in vars(self.ledger).items():
            state |= {f"{account}: {name}": np.array(value) for name, value in energies.items()}
        state |= {
            "connectors": self.connections(), "material": material.reshape(-1, 6),
            FORCES: np.zeros((9, len(self.numbering.cells))) + self.on_nodes,
        }  # fmt: skip
        between = float(self.scheme.average(0.0, 1.0))
        if between < 1:
            state[BEFORE] = self.q_before
        columns = Columns({name: np.shape(values) for name, values in state.items()})
        row = np.concatenate([np.ravel(values) for values in state.values()])
        now = States(self.numbering, None, Block(columns, row[None], 1))
        now.equilibrium_fraction, now.needs_start = between, between < 1
        return now
