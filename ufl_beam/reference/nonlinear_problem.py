# SPDX-License-Identifier: MIT
"""The equation of a step: functions and forms, loads, connectors, and SNES that solves it."""

from __future__ import annotations

import math
from typing import Any

from mpi4py import MPI
from petsc4py import PETSc

import basix
import numpy as np
from dolfinx import la
from dolfinx.fem import petsc
from scipy.sparse import csr_array, diags_array

from ufl_beam.arrays import Array
from ufl_beam.discretization.dof_numbering import DofNumbering
from ufl_beam.dolfinx_compat import fem
from ufl_beam.errors import StepFailed
from ufl_beam.mechanics.time_scheme import Scheme, has_inertia, nodal_step
from ufl_beam.model.bodies import moves_with_node
from ufl_beam.model.functions import value_at
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
    "pc_factor_mat_solver_type": "mumps", "snes_stol": 0,
}  # fmt: skip
"""Options of PETSc; options of :class:`Newton` replace them.  With a tolerance ``snes_stol``, the
line search ``bt`` keeps the unknowns if the full step is shorter and does not help."""

SEARCH = "snes_linesearch_type"
NEARLY = REASONS.DIVERGED_MAX_IT, REASONS.DIVERGED_LINE_SEARCH
"""Reasons to stop where full steps may converge: slow convergence, and round-off."""

SMALL_STEP, LAST_DIGITS = 1e-9, 1e-15
"""Newton's method ends after a correction of motions below these parts of the motions, or of the
scene: the next error is of the size of the square of the correction."""

PATIENCE = 10
"""Newton's method stalls after this number of iterations that do not halve the least residual."""


class NonlinearProblem(PresentState):
    """Equation Cᵀ r(C x + g) = F of a step, with its derivative, and the state before the step.

    Vectors of the scene are whole on every process; functions and matrices are distributed.

    Args:
        numbering: Numbering of the scene, with cells of degree 1.
        scheme: Static, EnergyMomentum or EnergyMomentumStatic.
        t: Time of the initial state; s.
        newton: Options of Newton's method.
        comm: Processes that share the mesh.

    Attributes:
        frame: Mesh, and joints and supports as q = C x + g(t).
        fields: Functions and forms of a step.
        points: Material points of the cells of this process.
        connectors: Joints, motors and hinges of zero length of the scene.
        parts: Hinges of zero length, and points.
        opening: Those that may open.
        y: Coordinates of the scene before the step, see :class:`Frame`.
        q: Configuration of the scene before the step; q1 at its end.
        v: Velocities of the scene before the step.
        x: Unknowns at the end of the step.
        motions: Prescribed coordinates at the end of the step.
        load: Loads in the step.
        coefficients: Numbers of the scheme in the step.
        iterations: Number of Newton iterations so far.
        stiff: 1 if points that do not open have elastic tangents, 2 if hinges of zero length have
            the opposite slope, too.
    """

    q: Array
    q1: Array
    v: Array
    load: Array
    motions: Array
    coefficients: Any
    stiff = iterations = 0

    def __init__(
        self, numbering: DofNumbering, scheme: Scheme, t: float, *, newton: Any,
        comm: MPI.Intracomm,
    ) -> None:  # fmt: skip
        self.scene, self.numbering, self.scheme = numbering.scene, numbering, scheme
        self.t, self.newton, self.comm = t, newton, comm
        self.frame = frame = Frame(numbering, comm)
        self.fields, self.dynamic = Fields(frame, scheme), has_inertia(scheme)
        self.points = list[Points]()
        for kind, cells in numbering.inelastic:
            mine = np.flatnonzero(np.isin(frame.cells, cells))
            self.points.append(Points(kind, mine, numbering, self.fields, scheme))
        self.connectors, self.masses = connectors_of(numbering, scheme), masses(numbering)
        hinges = [hinge for group in self.connectors for hinge in group.hinges.values()]
        self.parts: list[Points | Hinge] = [*hinges, *self.points]
        self.opening = [p for p in self.parts if isinstance(p, Hinge) or p.kind.softening]
        self.r, self.rate = fem.Function(frame.V), fem.Function(frame.V)
        self._add_loads()
        self._make_snes()

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
            values[on] = factors.reshape(len(i), X.size, 1) * (*load.force, load.moment)
        elif isinstance(load, Gravity):
            g = np.array([*load.acceleration, 0.0])
            values[:] = self.fields.inertia.x.array[::2, None, None] * g
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
            forms = fields.mass, fields.at_rest
            self.M, self.damping = (petsc.assemble_matrix(form) for form in forms)
            for A in (self.M, self.damping):
                A.assemble()
            self.damping.scale(a1)
            self.damping.axpy(a0, self.M, SAME)
            self.damping_of_masses, self.scaled = a0 * self.masses, self.M.copy()
        self.matrices = [self.K, *([self.M, self.damping, self.scaled] if self.dynamic else [])]
        self.projected = self.K.ptap(frame.C)
        self.x, f = (frame.C.createVecRight() for _ in range(2))
        A, sizes = self.projected.copy(), (len(frame.mine), len(frame.order))
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
        self.K.ptap(self.frame.C, result=self.projected)
        P.zeroEntries()
        P.axpy(1.0, self.projected, PETSc.Mat.Structure.SUBSET_NONZERO_PATTERN)
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

    def _newton(self, guess: Array) -> None:
        """Run SNES: full steps, a line search, stiffer tangents, each from the guess.

        Points around an opening hinge unload, which their own tangents do not predict.  With
        ``stiff`` 1, points that do not open have elastic tangents; with 2, hinges of zero length
        have the opposite slope, too.  Full steps with true tangents end each attempt: others
        converge slowly, so that a small correction does not prove a small error, and a line search
        leaves the state at the last point that it tried.
        """
        first, second = (self.newton.petsc.get(SEARCH, kind) for kind in ("basic", "bt"))
        attempts = [(first, 0), (second, 0)] + [(first, 1), (first, 2)] * bool(self.opening)
        for attempt in dict.fromkeys(attempts):
            self.x.array_w[:] = guess
            reason = self._solve_by_snes(*attempt)
            if attempt != ("basic", 0) and (reason > 0 or reason in NEARLY):
                reason = self._solve_by_snes("basic", 0)
            if reason > 0:
                return
        names = {v: k for k, v in vars(REASONS).items() if isinstance(v, int)}
        failure = StepFailed(f"Newton's method did not converge ({names.get(reason, reason)})")
        failure.reason = str(names.get(reason, reason))
        raise failure

    def _solve_by_snes(self, search: str, stiff: int) -> int:
        """Iterate from ``x`` with SNES; return its reason to stop."""
        self.stiff = stiff
        self._set({SEARCH: search})
        try:
            self.snes.solve(None, self.x)
        except PETSc.Error as error:  # also raised if a callback is interrupted
            cause: BaseException = error
            while cause.__cause__ is not None:
                cause = cause.__cause__
            raise cause from None
        self.iterations += self.snes.getIterationNumber()
        reason = int(self.snes.getConvergedReason())
        if reason == REASONS.DIVERGED_LINEAR_SOLVE:  # MUMPS has found no pivot, and would be stuck
            self.snes.getKSP().getPC().reset()
        return reason

    def close(self) -> None:
        """Destroy the PETSc objects."""
        for thing in (self.snes, self.x, self.frame.C, self.projected, *self.matrices):
            thing.destroy()
