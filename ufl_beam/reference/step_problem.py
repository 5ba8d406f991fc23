# SPDX-License-Identifier: MIT
"""The equation of a step, and SNES that solves it."""

from __future__ import annotations

import math
from typing import Any

from mpi4py import MPI
from petsc4py import PETSc

import numpy as np
from dolfinx import la
from dolfinx.fem import petsc
from scipy.sparse import csr_array, diags_array

from ufl_beam.arrays import Array
from ufl_beam.discretization.dof_numbering import DofNumbering
from ufl_beam.discretization.function_spaces import point_masses
from ufl_beam.dolfinx_compat import fem
from ufl_beam.errors import StepFailed
from ufl_beam.mechanics.time_scheme import Scheme, has_inertia, nodal_step
from ufl_beam.model.bodies import moves_with_node
from ufl_beam.model.loads import Gravity, PointLoad, Rayleigh
from ufl_beam.reference.connectors import Hinge, connectors_of
from ufl_beam.reference.forms import Fields
from ufl_beam.reference.frame import Frame
from ufl_beam.reference.points import Points

SAME, SUBSET = (getattr(PETSc.Mat.Structure, f"{x}_NONZERO_PATTERN") for x in ("SAME", "SUBSET"))
REASONS = PETSc.SNES.ConvergedReason

SEARCH = "snes_linesearch_type"
OPTIONS = {
    "snes_type": "newtonls", "ksp_type": "preonly", "pc_type": "lu",
    "pc_factor_mat_solver_type": "mumps", "snes_stol": 0,
}  # fmt: skip
"""Options of PETSc; options of :class:`Newton` replace them.  With a tolerance ``snes_stol``, the
line search ``bt`` keeps the unknowns if the full step is shorter and does not help."""

NEARLY = REASONS.DIVERGED_MAX_IT, REASONS.DIVERGED_LINE_SEARCH
"""Reasons to stop where full steps may converge: slow convergence, and round-off."""

SMALL_STEP, LAST_DIGITS = 1e-9, 1e-15
"""Newton's method ends after a correction of motions below these parts of the motions, or of the
scene.  With true tangents, the next error is of the size of the square of the correction."""

PATIENCE = 10
"""Newton's method stalls in the next iteration after this number of iterations that do not halve
the least residual."""


class StepProblem:
    """Equation Cᵀ r(C x) = F of a step, with its derivative, and the state before the step.

    ``fields`` has functions on the mesh; other vectors are of the whole scene, on all processes.
    """

    y: Array  # coordinates at the beginning of the step, see Frame; y1: at the latest iterate
    q: Array  # configuration at the beginning of the step, E y; q1: at the latest iterate
    v: Array  # velocities at the beginning of the step; s: steps on which inertia does work
    load: Array  # loads in the step
    coefficients: Any  # numbers of the scheme in the step
    stiff = 0  # 1: points that do not open have elastic tangents; 2: hinges are steep, too
    iterations = 0  # of Newton's method so far

    def __init__(
        self, numbering: DofNumbering, scheme: Scheme, *, newton: Any, comm: MPI.Intracomm
    ) -> None:
        self.scene, self.numbering, self.scheme = numbering.scene, numbering, scheme
        self.newton, self.comm = newton, comm
        self.frame = frame = Frame(numbering, comm)
        self.fields, self.dynamic = Fields(frame, scheme), has_inertia(scheme)
        self.points = list[Points]()
        for kind, cells in numbering.inelastic:
            mine = np.flatnonzero(np.isin(frame.cells, cells))
            self.points.append(Points(kind, mine, numbering, self.fields, scheme))
        self.connectors = connectors_of(numbering, scheme)
        hinges = [hinge for group in self.connectors for hinge in group.hinges.values()]
        self.parts: list[Points | Hinge] = [*hinges, *self.points]
        # Those that may open
        self.opening = [p for p in self.parts if isinstance(p, Hinge) or p.section.softening]
        self.r, self.rate = fem.Function(frame.V), fem.Function(frame.V)
        self._set_masses_and_loads()
        self._make_matrices()
        self._make_snes()

    def _set_masses_and_loads(self) -> None:
        """Set masses of bodies and point masses, and forces of dead loads for factors of one."""
        numbering, loads = self.numbering, self.scene.loads
        self.masses: Array = np.zeros(numbering.size)
        self.of_loads = np.zeros((len(loads), numbering.size))
        for place, mass, inertia in point_masses(self.scene):
            np.add.at(self.masses, numbering.node(place), [mass, mass, inertia])
        for load, forces in zip(loads, self.of_loads, strict=True):
            values = self._assembled(self.fields.work_of(load)).array_r
            np.add.at(forces, self.frame.dofs[: len(values)], values)
            self.comm.Allreduce(MPI.IN_PLACE, forces)
            if isinstance(load, PointLoad) and moves_with_node(load.place):
                np.add.at(forces, numbering.node(load.place), [*load.force, load.moment])
            elif isinstance(load, Gravity):
                at = np.concatenate([numbering.dofs[:, :2], numbering.dofs_of_bodies[:, :2]])
                forces[at] += self.masses[at] * load.acceleration

    def _make_matrices(self) -> None:
        """Make the matrices of the mesh: K, and with inertia the mass M, and the damping."""
        fields, dampers = self.fields, [x for x in self.scene.damping if isinstance(x, Rayleigh)]
        self.rayleigh = a0, a1 = sum(x.mass for x in dampers), sum(x.stiffness for x in dampers)
        forms = [fields.tangent] + [fields.mass, fields.stiffness_at_rest] * self.dynamic
        self.matrices = [petsc.assemble_matrix(form) for form in forms]
        for A in self.matrices:
            A.assemble()
        self.K = self.matrices[0]
        if self.dynamic:
            _, self.M, self.damping = self.matrices
            self.damping.scale(a1)
            self.damping.axpy(a0, self.M, SAME)
        self.projected = self.K.ptap(self.frame.C)

    def _make_snes(self) -> None:
        frame = self.frame
        self.x, f = (frame.C.createVecRight() for _ in range(2))
        A = self.projected.copy()
        A.setOption(PETSc.Mat.Option.NEW_NONZERO_ALLOCATION_ERR, False)  # for connectors
        A.setOption(PETSc.Mat.Option.KEEP_NONZERO_PATTERN, True)
        self.matrices += [self.projected, A]
        self.weights = self.numbering.scales[frame.mine]
        self.weights[frame.fixed] = 0.0
        self.snes = snes = PETSc.SNES().create(self.comm)
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

    def close(self) -> None:
        """Destroy the PETSc objects."""
        for thing in (self.snes, self.x, self.frame.C, *self.matrices):
            thing.destroy()

    # -- residual and tangent --------------------------------------------------------------------

    def _residual(self, snes: PETSc.SNES, x: PETSc.Vec, f: PETSc.Vec) -> None:
        """Compute Cᵀ r - F of the step that ends at q1 = C x."""
        frame, fields, numbering = self.frame, self.fields, self.numbering
        self.y1 = frame.coordinates(x)
        self.q1 = frame.E @ self.y1
        self.s = nodal_step(self.scheme, self.q, self.q1, numbering.rotations)
        self.s[numbering.multipliers] = 0.0
        fields.q1.x.array[:] = self.q1[frame.dofs]
        strains = fields.strains()
        for points in self.points:
            points.return_map(strains, stiff=self.stiff > 0)
        further = sum(
            (group.residual(self.q1, steep=self.stiff == 2) for group in self.connectors),
            np.zeros(numbering.size),
        )
        r = self._assembled(fields.force)
        if self.dynamic:
            c = self.coefficients
            a, v = (row[0] * self.s + row[1] * self.v for row in (c.inertia, c.velocity))
            for A, rate in ((self.M, a), (self.damping, v)):  # equation (78)
                self.rate.x.array[:] = rate[frame.dofs]
                A.multAdd(self.rate.x.petsc_vec, r, r)
            further += self.masses * (a + self.rayleigh[0] * v)
        frame.C.multTranspose(r, f)
        f.array_w[:] += frame.rows @ (further - self.load)
        f.array_w[frame.fixed] = 0.0  # the guess has the prescribed motions

    def _assembled(self, work: fem.Form) -> PETSc.Vec:
        """Return the forces on the mesh that do a virtual work."""
        self.r.x.array[:] = 0.0
        fem.assemble_vector(self.r.x.array, work)
        self.r.x.scatter_reverse(la.InsertMode.add)
        return self.r.x.petsc_vec

    def _jacobian(self, snes: PETSc.SNES, x: PETSc.Vec, A: PETSc.Mat, P: PETSc.Mat) -> None:
        """Compute the derivative at the point of the latest residual."""
        frame, slope = self.frame, np.zeros(self.numbering.size)  # of forces on bodies and points
        self.K.zeroEntries()
        petsc.assemble_matrix(self.K, self.fields.tangent)
        self.K.assemble()
        if self.dynamic:
            c, rotations = self.coefficients, self.numbering.rotations
            growth = np.ones(len(slope))  # of s, by q1
            if self.scheme.half_tangents:
                growth[rotations] = 1 / np.cos((self.q1 - self.q)[rotations] / 2) ** 2
            slope = (c.inertia[0] + c.velocity[0] * self.rayleigh[0]) * self.masses * growth
            of_rates = c.inertia[0] * self.M
            of_rates.axpy(c.velocity[0], self.damping, SAME)
            self.rate.x.array[:] = growth[frame.dofs]
            of_rates.diagonalScale(R=self.rate.x.petsc_vec)
            self.K.axpy(1.0, of_rates, SAME)
            of_rates.destroy()
        self.K.ptap(frame.C, result=self.projected)
        P.zeroEntries()
        P.axpy(1.0, self.projected, SUBSET)
        if self.connectors or self.masses.any():
            D = sum((group.tangent() for group in self.connectors), diags_array(slope).tocsr())
            further = csr_array(frame.rows @ D @ frame.columns).sorted_indices()
            rows = (x.astype(PETSc.IntType) for x in (further.indptr, further.indices))
            P.setValuesCSR(*rows, further.data, addv=PETSc.InsertMode.ADD_VALUES)
            P.assemble()
        P.zeroRowsColumns((frame.fixed + P.getOwnershipRange()[0]).astype(PETSc.IntType))

    # -- Newton's method -------------------------------------------------------------------------

    def solve(self, guess: Array) -> None:
        """Run SNES: full steps, a line search, stiffer tangents, each from the guess of ``x``.

        Points around an opening hinge unload, which their own tangents do not predict; so with
        ``stiff``, tangents are stiffer.  Full steps with true tangents end each attempt: others
        converge slowly, so that a small correction does not prove a small error, and a line search
        leaves the state at the last point that it tried.

        Raises:
            StepFailed: No attempt converges.
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
        name = next(k for k, v in vars(REASONS).items() if v == reason)
        failure = StepFailed(f"Newton's method did not converge ({name})")
        failure.reason = name
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

    def _converged(self, snes: PETSc.SNES, iteration: int, norms: tuple[float, ...]) -> Any:
        """Stop after a correction so small that the next one would be round-off."""
        if norms[2] == 0.0:
            return REASONS.CONVERGED_FNORM_ABS
        if iteration == 0:
            self._least, self._slow = math.inf, 0
            return REASONS.CONVERGED_ITERATING
        vectors = snes.getSolutionUpdate(), snes.getSolution()
        sizes = (np.max(np.abs(self.weights * x.array_r), initial=0.0) for x in vectors)
        correction, motion = self.largest(*sizes)
        if correction <= max(SMALL_STEP * motion, LAST_DIGITS):
            return REASONS.CONVERGED_SNORM_RELATIVE
        forces = snes.getFunction()[0].array_r * (self.weights > 0)  # without other equations
        size = math.sqrt(self.comm.allreduce(float(forces @ forces)))
        self._slow = 0 if size <= self._least / 2 else self._slow + 1
        self._least = self._least if self._slow else size
        stalls = self._slow > PATIENCE  # SNES has no reason of its own for this
        return REASONS.DIVERGED_DTOL if stalls else REASONS.CONVERGED_ITERATING

    def largest(self, *values: float) -> Array:
        """Return the largest values on all processes; NaN counts as infinite."""
        most = np.nan_to_num(np.array(values, dtype=np.float64), nan=np.inf)
        self.comm.Allreduce(MPI.IN_PLACE, most, MPI.MAX)
        return most
