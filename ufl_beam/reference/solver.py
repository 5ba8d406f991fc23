# SPDX-License-Identifier: MIT
"""Steps of a scene in time, as the theory states them; PETSc's SNES finds the end of each step."""

from __future__ import annotations

import math
import sys
from typing import Any

from mpi4py import MPI
from petsc4py import PETSc

import basix
import numpy as np
from dolfinx import la
from dolfinx.fem import petsc
from scipy.sparse import csr_array, diags_array

from ufl_beam.arrays import Array, State
from ufl_beam.discretization.dof_numbering import DofNumbering
from ufl_beam.dolfinx_compat import fem
from ufl_beam.errors import StepFailed
from ufl_beam.mechanics.time_scheme import Scheme, Step, acting, has_inertia, nodal_step
from ufl_beam.model.bodies import Body, Member, moves_with_node
from ufl_beam.model.functions import still, value_at
from ufl_beam.model.loads import Gravity, LineLoad, PointLoad, Rayleigh
from ufl_beam.output.recorder import PresentState
from ufl_beam.reference.connectors import connectors_of, masses
from ufl_beam.reference.forms import Fields
from ufl_beam.reference.frame import Frame
from ufl_beam.reference.hinges import Hinge
from ufl_beam.reference.points import Points

ADD, SAME = PETSc.InsertMode.ADD_VALUES, PETSc.Mat.Structure.SAME_NONZERO_PATTERN
REASONS = PETSc.SNES.ConvergedReason

OPTIONS = {
    "snes_type": "newtonls", "ksp_type": "preonly", "pc_type": "lu",
    "pc_factor_mat_solver_type": "mumps",
}  # fmt: skip
"""Options of PETSc, which those of :class:`Newton` replace."""

SMALL_STEP, LAST_DIGITS = 1e-9, 1e-15
"""Newton's method ends after a correction of motions below these parts of the motions, or of the
scene: the next error is of the size of the square of the correction."""

PATIENCE = 10
"""Newton's method stalls after this number of iterations that do not halve the least residual."""

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


class Solver(PresentState):
    """State of a scene, and its steps.

    Vectors of the scene are whole on every process; functions and matrices are distributed.

    Args:
        numbering: Numbering of the scene, with cells of degree 1.
        scheme: Static, EnergyMomentum or EnergyMomentumStatic.
        t: Time of the initial state; s.
        newton: Options of Newton's method.
        comm: Processes that share the mesh.
        impacts: Finds impacts where prescribed rates jump; None if no rate does.

    Attributes:
        frame: Mesh, and joints and supports as q = C x + g(t).
        fields: Functions and forms of a step.
        points: Material points of the cells of this process.
        connectors: Joints, motors and hinges of zero length of the scene.
        y: Coordinates of the scene, see :class:`Frame`; y1 at the end of the step.
        q: Configuration of the scene; q1 at the end of the step.
        v: Velocities of the scene.
        s: Steps of the nodes on which forces do work.
        load: Loads in the step.
        energies: Sum of all energies so far; J.
    """

    energies, stiff = 0.0, 0
    on_cells_before: Array
    reached: Array
    v: Array
    y: Array

    def __init__(
        self, numbering: DofNumbering, scheme: Scheme, t: float, *, newton: Any,
        comm: MPI.Intracomm, impacts: Any = None,
    ) -> None:  # fmt: skip
        self.scene, self.numbering, self.scheme = numbering.scene, numbering, scheme
        self.t, self.newton, self.comm, self.impacts = t, newton, comm, impacts
        self.frame = frame = Frame(numbering, comm)
        self.fields, self.dynamic = Fields(frame, scheme), has_inertia(scheme)
        self.substeps, self.iterations, self.last_dt, self._rejected = 0, 0, math.inf, 0.0
        self.points = list[Points]()
        for kind, cells in numbering.inelastic:
            mine = np.flatnonzero(np.isin(frame.cells, cells))
            self.points.append(Points(kind, mine, numbering, self.fields, scheme))
        self.connectors, self.masses = connectors_of(numbering, scheme), masses(numbering)
        hinges = [hinge for group in self.connectors for hinge in group.hinges.values()]
        self.opening: list[Points | Hinge] = [
            *hinges,
            *(p for p in self.points if p.kind.softening),
        ]
        self.parts: list[Points | Hinge] = [*hinges, *self.points]
        self.r, self.rate = fem.Function(frame.V), fem.Function(frame.V)
        self._add_loads()
        self._make_snes()

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
            group.e0 = group.motions(q)
        self.reached = self.factors = self._factors() * (not self.fresh)
        self.load = self.factors @ self.of_loads
        self.on_cells_before = fields.forces_on_cells(fields.on_cells[0])
        self.elastic = self.elastic_energy()

    # -- loads -----------------------------------------------------------------------------------

    def _add_loads(self) -> None:
        """Compute forces of dead loads for factors of one, on the scene and on cells."""
        loads, fields, cells = self.scene.loads, self.fields, len(self.frame.cells)
        self.of_loads = np.zeros((len(loads), self.numbering.size))
        self.of_loads_on_cells = np.zeros((len(loads), cells, 2, 3))
        density = fields.at_points((3,), degree=9)
        whole, apart = fields.load(density)
        for load, forces, on_cells in zip(
            loads, self.of_loads, self.of_loads_on_cells, strict=True
        ):
            density.x.array[:] = 0.0
            self._set_load(load, forces, density.x.array.reshape(cells, -1, 3))
            forces += self._total(self._assembled(whole))
            on_cells[:] = fields.forces_on_cells(apart)

    def _set_load(self, load: Any, forces: Array, values: Array) -> None:
        """Set the forces of a dead load at nodes, and along beams at five points of each cell."""
        numbering, cells = self.numbering, self.frame.cells
        if isinstance(load, PointLoad) and moves_with_node(load.place):
            np.add.at(forces, numbering.node(load.place), [*load.force, load.moment])
        elif isinstance(load, LineLoad):
            X, _ = basix.make_quadrature(basix.CellType.interval, 9)
            s, i = numbering.parameters(load.beam), cells - numbering.cells_of(load.beam)[0]
            i = i[on := (i >= 0) & (i < len(s) - 1)]
            factors = load.factors((s[i, None] + np.diff(s)[i, None] * X.T).ravel())
            values[on] = factors.reshape(len(i), -1, 1) * (*load.force, load.moment)
        elif isinstance(load, Gravity):
            g = np.array([*load.acceleration, 0.0])
            values[:] = self.fields.rho.x.array[::2, None, None] * g
            at = np.concatenate([numbering.dofs[:, :2], numbering.dofs_of_bodies[:, :2]])
            forces[at] = self.masses[at] * g[:2]

    def _factors(self, t: float | None = None) -> Array:
        """Return the factors of the loads at a time, by default at the beginning of the step."""
        t = self.t if t is None else t
        return np.array([value_at(load.amplitude, t, load) for load in self.scene.loads])

    # -- the equation of a step ------------------------------------------------------------------

    def _make_snes(self) -> None:
        """Make the matrices of a step, and SNES with the options of the run."""
        frame, fields, comm = self.frame, self.fields, self.comm
        self.K = petsc.assemble_matrix(fields.tangent)
        self.K.assemble()
        dampers = [(x.mass, x.stiffness) for x in self.scene.damping if isinstance(x, Rayleigh)]
        self.rayleigh = a0, a1 = np.sum(dampers, axis=0) if dampers else (0.0, 0.0)
        if self.dynamic:  # inertia, and damping
            forms = fields.mass, fields.stiffness
            self.M, self.damping = (petsc.assemble_matrix(form) for form in forms)
            for A in (self.M, self.damping):
                A.assemble()
            self.damping.scale(a1)
            self.damping.axpy(a0, self.M, SAME)
            self.damping_of_masses, self.scaled = a0 * self.masses, self.M.copy()
        self.CKC = self.K.ptap(frame.C)
        self.x, f = (frame.C.createVecRight() for _ in range(2))
        A, sizes = self.CKC.copy(), (len(frame.mine), len(frame.order))
        further = self._further_tangent(ones=True)
        pattern = PETSc.Mat().createAIJ((sizes, sizes), csr=further, comm=comm)
        A.axpy(1.0, pattern, PETSc.Mat.Structure.DIFFERENT_NONZERO_PATTERN)
        A.setOption(PETSc.Mat.Option.KEEP_NONZERO_PATTERN, True)
        self.weights = self.numbering.scales[frame.mine]
        self.snes = snes = PETSc.SNES().create(comm)
        snes.setOptionsPrefix("ub_")
        snes.setFunction(self._residual, f)
        snes.setJacobian(self._jacobian, A)
        snes.setConvergenceTest(self._converged)
        snes.setTolerances(max_it=self.newton.max_iterations)
        self._set(OPTIONS | self.newton.petsc)

    def _set(self, values: dict[str, Any]) -> None:
        """Set options of SNES."""
        options = PETSc.Options("ub_")
        for name, value in values.items():
            options[name] = value
        self.snes.setFromOptions()
        for name in values:
            options.delValue(name)

    def _assembled(self, form: fem.Form) -> Array:
        """Return an assembled form on V at the degrees of freedom that this process owns."""
        self.r.x.array[:] = 0.0
        fem.assemble_vector(self.r.x.array, form)
        self.r.x.scatter_reverse(la.InsertMode.add)
        return np.asarray(self.r.x.petsc_vec.array)

    def _total(self, forces: Array) -> Array:
        """Return forces on the scene, on all processes, from those on owned dofs of V."""
        whole: Array = np.zeros(self.numbering.size)
        np.add.at(whole, self.frame.dofs[: len(forces)], forces)
        self.comm.Allreduce(MPI.IN_PLACE, whole)
        return whole

    def _residual(self, snes: PETSc.SNES, x: PETSc.Vec, f: PETSc.Vec) -> None:
        """Compute Cᵀ r - F of the step that ends at q1 = C x + g."""
        frame, fields, q1, r = self.frame, self.fields, self.fields.q1.x, self.r.x.petsc_vec
        frame.C.mult(x, q1.petsc_vec)
        q1.scatter_forward()
        q1.array[:] += frame.g(self.motions)
        strains = fields.strains()
        for points in self.points:
            points.return_map(strains, stiff=self.stiff > 0)
        self._assembled(fields.force)
        if self.dynamic:  # equation (78)
            self._add(self.M, self.coefficients.inertia)
            self._add(self.damping, self.coefficients.velocity)
        frame.C.multTranspose(r, f)
        if self.connectors or self.masses.any():
            self.q1 = frame.E @ frame.coordinates(x, self.motions)
        f.array_w[:] += frame.rows @ (self._further_forces() - self.load)

    def _add(self, A: PETSc.Mat, row: Any) -> None:
        """Add the product of a matrix and a rate of the step to the residual."""
        q0, q1 = self.fields.q0.x.array, self.fields.q1.x.array
        s = nodal_step(self.scheme, q0, q1, np.arange(2, len(q0), 3))
        self.rate.x.array[:] = row[0] * s + row[1] * self.v[self.frame.dofs]
        A.multAdd(self.rate.x.petsc_vec, self.r.x.petsc_vec, self.r.x.petsc_vec)

    def _further_forces(self) -> Array:
        """Return forces of connectors, bodies and point masses at ``q1``; (size,)."""
        r: Array = np.zeros(self.numbering.size)
        for group in self.connectors:
            r += group.residual(self.q1, steep=self.stiff == 2)
        if self.dynamic and self.masses.any():
            s, c = (
                nodal_step(self.scheme, self.q, self.q1, self.numbering.rotations),
                self.coefficients,
            )
            r += self.masses * (c.inertia[0] * s + c.inertia[1] * self.v)
            r += self.damping_of_masses * (c.velocity[0] * s + c.velocity[1] * self.v)
        return r

    def _further_tangent(self, *, ones: bool = False) -> tuple[Any, Any, Array]:
        """Return the derivative of these forces in rows of this process, or a matrix of ones."""
        slope: Array = np.full(self.numbering.size, float(ones))
        if self.dynamic and not ones:
            c, at = self.coefficients, self.numbering.rotations
            slope += c.inertia[0] * self.masses + c.velocity[0] * self.damping_of_masses
            if self.scheme.half_tangents:
                slope[at] /= np.cos((self.q1 - self.q)[at] / 2) ** 2
        K = sum((group.tangent(ones=ones) for group in self.connectors), diags_array(slope).tocsr())
        pair = self.frame.rows, self.frame.columns
        left, right = (abs(x) for x in pair) if ones else pair
        rows = csr_array(left @ K @ right).sorted_indices()
        return rows.indptr.astype(PETSc.IntType), rows.indices.astype(PETSc.IntType), rows.data

    def _jacobian(self, snes: PETSc.SNES, x: PETSc.Vec, A: PETSc.Mat, P: PETSc.Mat) -> None:
        """Compute Cᵀ K C, and the derivatives of the other forces."""
        self.K.zeroEntries()
        petsc.assemble_matrix(self.K, self.fields.tangent)
        self.K.assemble()
        if self.dynamic:
            c, q0, q1 = self.coefficients, self.fields.q0.x.array, self.fields.q1.x.array
            self.M.copy(self.scaled, SAME)
            self.scaled.scale(c.inertia[0])
            self.scaled.axpy(c.velocity[0], self.damping, SAME)
            self.rate.x.array[:] = 1.0
            if self.scheme.half_tangents:
                self.rate.x.array[2::3] /= np.cos((q1 - q0)[2::3] / 2) ** 2
            self.scaled.diagonalScale(R=self.rate.x.petsc_vec)
            self.K.axpy(1.0, self.scaled, SAME)
        self.K.ptap(self.frame.C, result=self.CKC)
        P.zeroEntries()
        P.axpy(1.0, self.CKC, PETSc.Mat.Structure.SUBSET_NONZERO_PATTERN)
        if self.connectors or self.masses.any():
            P.setValuesCSR(*self._further_tangent(), addv=ADD)
            P.assemble()

    def _converged(self, snes: PETSc.SNES, iteration: int, norms: tuple[float, ...]) -> Any:
        """Stop after a correction so small that the next one would be round-off."""
        if not math.isfinite(norms[2]):
            return REASONS.DIVERGED_FNORM_NAN
        if norms[2] == 0.0:
            return REASONS.CONVERGED_FNORM_ABS
        if iteration == 0:
            self._best, self._slow = math.inf, 0
            return REASONS.CONVERGED_ITERATING
        vectors = snes.getSolutionUpdate(), snes.getSolution()
        sizes = (np.max(np.abs(self.weights * x.array_r), initial=0.0) for x in vectors)
        correction, motion = self._largest(*sizes)
        if correction <= max(SMALL_STEP * motion, LAST_DIGITS):
            return REASONS.CONVERGED_SNORM_RELATIVE
        forces = snes.getFunction()[0].array_r * (self.weights > 0)  # without other equations
        size = math.sqrt(self.comm.allreduce(float(forces @ forces)))
        self._slow = 0 if size <= self._best / 2 else self._slow + 1
        self._best = self._best if self._slow else size
        return REASONS.DIVERGED_DTOL if self._slow > PATIENCE else REASONS.CONVERGED_ITERATING

    def _largest(self, *values: float) -> Array:
        """Return the largest values on all processes; NaN counts as infinite."""
        largest = np.nan_to_num(np.array(values, dtype=np.float64), nan=np.inf)
        self.comm.Allreduce(MPI.IN_PLACE, largest, MPI.MAX)
        return largest

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
                if not hold or not self.opening:
                    raise
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

    def _newton(self, guess: Array) -> None:
        """Run SNES: full steps, a line search, stiffer tangents, full steps from where they end.

        Points around an opening hinge unload, which their own tangents do not predict.  With
        ``stiff`` 1, points that do not open have elastic tangents; with 2, hinges of zero length
        have the opposite slope, too.
        """
        search = "snes_linesearch_type"
        attempts = [("basic", 0), ("bt", 0)] + [("basic", 1), ("basic", 2)] * bool(self.opening)
        for kind, self.stiff in attempts:
            self._set({search: self.newton.petsc.get(search, kind)})
            self.x.array_w[:] = guess
            reason = self._iterate()
            if self.stiff and reason == REASONS.DIVERGED_MAX_IT:
                self.stiff = 0
                reason = self._iterate()
            if reason > 0:
                return
        names = {v: k for k, v in vars(REASONS).items() if isinstance(v, int)}
        failure = StepFailed(f"Newton's method did not converge ({names.get(reason, reason)})")
        failure.reason = str(names.get(reason, reason))
        raise failure

    def _iterate(self) -> int:
        """Iterate with SNES; return its reason to stop."""
        try:
            self.snes.solve(None, self.x)
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
            group.e0 = group.motions(self.q1)
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
        return float(fem.assemble_scalar(self.fields.potential))

    def close(self) -> None:
        """Destroy the PETSc objects."""
        for thing in (self.snes, self.K, self.CKC, self.x, self.frame.C):
            thing.destroy()
