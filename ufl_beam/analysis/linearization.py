# SPDX-License-Identifier: MIT
"""Linearized equations about a state: matrices and eigenvalues of small motions."""

from __future__ import annotations

import math
import warnings
from dataclasses import replace
from functools import partial
from typing import TypeVar

from mpi4py import MPI

import numpy as np
import numpy.typing as npt
from scipy.sparse import block_array, csr_array, diags_array, eye_array
from scipy.sparse.csgraph import structural_rank
from scipy.sparse.linalg import splu

from ufl_beam.arrays import Array, Complex
from ufl_beam.compiled.csr import Csr
from ufl_beam.errors import ArgumentError, ModelWarning
from ufl_beam.mechanics.time_scheme import Coefficients, Step
from ufl_beam.mechanics.time_schemes import Newmark
from ufl_beam.model.beams import Mesh
from ufl_beam.model.functions import value_at
from ufl_beam.model.loads import MovingLoad
from ufl_beam.model.scene import Scene
from ufl_beam.simulation.simulation import Simulation
from ufl_beam.simulation.solution import Solution
from ufl_beam.solvers import eigensolvers
from ufl_beam.solvers.eigensolvers import ROUND_OFF, SHIFT, ZERO

V = TypeVar("V", Array, Complex)

MODAL_TOLERANCE = 1e-9  # coupling below this fraction of the largest damping is neglected
BALANCED = 1e-13  # forces below this fraction of the stiffness times the scene's size are round-off
AT_REST = 1e150  # time step after which rates vanish; its square does not overflow; s


class _Standstill(Newmark):
    """Scheme of small motions, whose terms are evaluated at the present state."""

    has_mean_velocity = True
    accelerations_oscillate = False
    further_rates: tuple[str, ...] = ()  # type: ignore[assignment]

    def coefficients(self, dt: float, last_dt: float, known: int) -> Coefficients:
        own = super().coefficients(dt, last_dt, known)
        return Coefficients(own.inertia, (1 / dt, 0.0, 0.0), own.rates[:1])


class SmallMotions:
    """Matrices of small motions about a state, without degrees of freedom constrained by supports.

    The state is the last state of ``at``, by default the undeformed scene.  Loads are evaluated at
    the time ``t`` (s), by default the time of the state.  Masses of moving loads are left out.
    """

    def __init__(
        self, scene: Scene, at: Solution | None, t: float | None = None, mesh: Mesh | None = None
    ) -> None:
        time = 0.0 if at is None else float(at.times[-1])
        if any(isinstance(load, MovingLoad) and load.mass for load in scene.loads):
            loads = [replace(x, mass=0.0) if isinstance(x, MovingLoad) else x for x in scene.loads]
            scene = replace(scene, loads=loads)
        # All processes compute all matrices, so that no result depends on their number.
        with warnings.catch_warnings():
            warnings.simplefilter("ignore", ModelWarning)  # these warnings concern runs
            simulation = Simulation(
                scene, _Standstill(), t0=time, start=at, mesh=mesh, comm=MPI.COMM_SELF
            )
        if t is not None:
            simulation.t = t
        self.scene, self._simulation = scene, simulation
        self.beams, self.numbering, self.q = simulation.beams, simulation.numbering, simulation.q
        simulation.solver.destroy()  # not closed: functions of a user are called below
        # Plastic strains and openings of hinges are constant from now on.
        simulation.controllers.evaluate(simulation)
        for cells in simulation.inelastic:
            cells.points.freeze()
        for group in simulation.connector_terms:
            group.response.freeze()
        Q = eye_array(self.numbering.size, format="lil")
        for support in (support for support in scene.supports if support.angle):
            i, j = self.numbering.node(support.place)[:2]
            c, s = math.cos(support.angle), math.sin(support.angle)
            Q[i, i], Q[i, j], Q[j, i], Q[j, j] = c, -s, s, c
        self._axes = csr_array(Q)  # columns: unit motions along the axes of supports
        _, T = self._linearized(self.q)
        multipliers = self.numbering.multipliers
        about_forces = T.diagonal()[multipliers] != 0.0
        self._laws, constraints = multipliers[about_forces], multipliers[~about_forces]
        left = np.ones(self.numbering.size, dtype=bool)
        left[simulation.supports.dofs] = left[self._laws] = False
        scale = np.ones(self.numbering.size)
        scale[constraints] = abs(T.data).max()  # rows of constraints become as large as stiffnesses
        # Columns: unit motions that supports allow, and unit forces of constraints.
        self._Z = (self._axes @ diags_array(scale, format="csr"))[:, np.flatnonzero(left)]
        masses = self._matrix(simulation.inertia.M.data)
        self.tangent, self.masses = T, masses  # of all degrees of freedom
        self.K, self.M = self._reduced(T), self._reduced(masses)
        # Number of modes: a constraint removes its force and one motion; a mode needs mass.  A
        # constraint between motions without mass, as of a hinge, removes one of these.
        massless = self.M.diagonal() == 0.0
        self._constraint_rows = rows = np.isin(np.flatnonzero(left), constraints)
        between = self.K[np.flatnonzero(rows)][:, np.flatnonzero(massless & ~rows)]
        removed = structural_rank(between) if min(between.shape) else 0
        self.most = self.K.shape[0] - len(constraints) - int(massless.sum()) + int(removed)

    def _matrix(self, data: Array) -> csr_array:
        A: Csr = self._simulation.inertia.M  # all matrices have this sparsity pattern
        return csr_array((data.copy(), A.indices.copy(), A.indptr.copy()), shape=(A.size, A.size))

    def _linearized(self, q: Array, dt: float = AT_REST) -> tuple[Array, csr_array]:
        """Return all forces except inertia at ``q``, and their derivative K + C / dt."""
        simulation = self._simulation
        step = Step(0.0, dt, simulation.q, simulation.t, simulation.t, fraction=1.0)
        r, data = simulation.equation.linearize(q, step)
        return r, self._matrix(data)

    def _reduced(self, T: csr_array) -> csr_array:
        """Reduce a matrix to columns of ``_Z``; eliminate forces that follow from force laws."""
        laws = self._laws
        if len(laws):
            flexibility = diags_array(1 / (T.diagonal()[laws] + (T.diagonal()[laws] == 0.0)))
            T = T - T[:, laws] @ flexibility @ T[laws, :]
        return csr_array(self._Z.T @ T @ self._Z)

    def participation(self, direction: Array) -> tuple[Array, float]:
        """Return M r for a translation r of all nodes along a unit vector, and the moving mass.

        The shapes are (size,), kg, and ().  The moving mass is the sum of the effective masses of
        all modes: the mass of the scene without the part that only moves with supports.
        """
        r = np.zeros(self.numbering.size)
        for axis, component in enumerate(direction):
            for dofs in (self.numbering.dofs, self.numbering.dofs_of_bodies):
                r[dofs[:, axis]] = component
        toward = np.asarray(self.masses @ r)
        massive = self.M.diagonal() > 0.0
        along = np.asarray(self._Z.T @ toward)[massive]
        # Constraints that also move degrees of freedom without mass do not restrict the others.
        rows = self.K[np.flatnonzero(self._constraint_rows)]
        between = abs(rows[:, np.flatnonzero(~massive)]).sum(axis=1) == 0
        rows = rows[np.flatnonzero(between)][:, np.flatnonzero(massive)]
        scales = diags_array(abs(self.M).max() / abs(rows).max(axis=1).toarray().ravel())
        G, M = scales @ rows, self.M[np.flatnonzero(massive)][:, np.flatnonzero(massive)]
        A = csr_array(block_array([[M, G.T], [G, None]])) if G.shape[0] else M
        y = splu(A.tocsc()).solve(np.append(along, np.zeros(G.shape[0])))
        return toward, float(along @ y[: len(along)])

    def support_forces(self, shapes: Array, omega: Array) -> Array:
        """Return the forces that supports exert in modes of given frequencies (rad/s); (size, n).

        They are T x - ω² M x; at degrees of freedom without support they vanish.
        """
        x, laws = shapes.copy(), self._laws
        x[laws] = 0.0
        if len(laws):
            x[laws] = -(self.tangent[laws] @ x) / self.tangent.diagonal()[laws][:, None]
        return np.asarray(self.tangent @ x - self.masses @ x * omega**2)

    def unbalanced(self) -> str:
        """Return a warning of works, connectors, supports that disturb the equilibrium, or ""."""
        t = self._simulation.t
        r, T = self._linearized(self.q)
        sizes = abs(T).max(axis=1).toarray().ravel()
        apart = np.abs(self._axes.T @ r) > BALANCED * self.scene.size * sizes
        apart[self._simulation.supports.dofs] = False
        connectors = zip(self.scene.all_connectors, self.numbering.multipliers, strict=True)
        names = [str(connector) for connector, force in connectors if apart[force]]
        apart[self.numbering.multipliers] = False
        names += [str(work) for work in self.scene.works if apart.any()]
        supports = ((s, motion) for s in self.scene.supports for motion in s.held.values())
        names += [str(s) for s, motion in supports if value_at(motion, t, s) != 0.0]
        if not names:
            return ""
        return (
            f"modes: {', '.join(names)}: the undeformed scene is no equilibrium with these; for "
            "vibrations about the equilibrium give at=simulate(scene, Static(), ...)"
        )

    # -- frequencies ---------------------------------------------------------------------------

    def exponents(self, n: int, *, damped: bool = True) -> tuple[Complex, Array | Complex]:
        """Compute up to n exponents nearest to zero, and their shapes; (n,), 1/s; (size, n).

        With ``damped=False`` forces that depend on velocities are left out.
        """
        K, M = self.K, self.M
        heavy = (M.diagonal() > 0) & (K.diagonal() != 0)
        squares = np.abs(K.diagonal()[heavy]) / M.diagonal()[heavy]
        highest, low = (squares.max(), squares.min()) if heavy.any() else (1.0, 1.0)
        τ = highest**-0.5
        C = (self._reduced(self._linearized(self.q, τ)[1]) - K) * τ
        round_off = ROUND_OFF * abs(K).max()
        symmetric = abs(K - K.T).max() <= round_off
        matrix = (K + K.T) / 2 if symmetric else K
        solve = partial(eigensolvers.linear, matrix, M, n, most=self.most, definite=symmetric)
        values, x = solve(shift=-SHIFT * low)
        works, zero = self._works(x)
        first = np.abs(values[~zero]).min(initial=highest)
        if zero.any():
            # A second shift is far from zero eigenvalues, whose huge inverses cost digits.
            values, x = solve(shift=-first / 2)
            works, zero = self._works(x)
        if symmetric and (not damped or abs(C).max() <= round_off * τ):
            values = works / np.sum(x * (M @ x), axis=0)
            values[zero] = 0.0
            s, motions = np.sqrt((-values).astype(complex)), x.astype(complex)
        else:
            s, motions = self._damped(C, x[:, zero], n, first**0.5)
        finite = (np.abs(s) ** 2 <= 1e3 * highest) & (s.imag >= 0)
        return self._nearest(n, s[finite], motions[:, finite])

    def _works(self, x: Array) -> tuple[Array, npt.NDArray[np.bool_]]:
        """Return works xᵀ K x (J) of the columns of x, and whether each may be round-off."""
        right, left = self._with_laws()
        works = self._simulation.equation.stiffness_works(self.q, right @ x, left.T @ x)
        sizes = np.sum(np.abs(x) * (abs(self.K) @ np.abs(x)), axis=0)
        return works, np.asarray(np.abs(works) <= ZERO * sizes)

    def _damped(self, C: csr_array, free: Array, n: int, lowest: float) -> tuple[Complex, Complex]:
        """Compute at least n exponents and motions with velocity-dependent forces C.

        Columns of ``free`` are the motions without stiffness; ``lowest`` is the lowest undamped
        frequency of the other motions; rad/s.
        """
        # Motions without stiffness may have the double exponent zero, which no solver finds
        # accurately.  Motions N among them with C N = M N Λ have the exponent 0 and the eigenvalues
        # of -Λ as exponents.  Constraints exclude N from the eigenvalue problem.
        N = free @ np.linalg.inv(np.linalg.cholesky(free.T @ (self.M @ free))).T
        Λ = N.T @ (C @ N)
        _, sizes, rows = np.linalg.svd(C @ N - self.M @ N @ Λ, full_matrices=False)
        W = rows[sizes <= MODAL_TOLERANCE * abs(C).max() * np.abs(N).max(initial=0.0)].T
        N, Λ = N @ W, W.T @ Λ @ W
        B = csr_array(self.M @ N * (abs(self.K).max() / abs(self.M).max() ** 0.5))
        K = csr_array(block_array([[self.K, B], [B.T, csr_array((B.shape[1],) * 2)]]))
        C, M = C.copy(), self.M.copy()
        for A in (C, M):
            A.resize(K.shape)
        most = 2 * (self.most - B.shape[1])
        s, x = eigensolvers.quadratic(K, C, M, 2 * n, most=most, shift=lowest)
        # Nearly zero exponents of the motions without stiffness become exact zeros.
        x = x[: len(free)]
        momentum, mass = free.T @ (self.M @ x), np.sum(x.conj() * (self.M @ x), axis=0).real
        own = np.linalg.solve(free.T @ (self.M @ free), momentum)
        fraction = np.sum(momentum.conj() * own, axis=0).real / mass
        noise = 16 * ROUND_OFF * np.sum(np.abs(x) * (abs(self.K) @ np.abs(x)), axis=0) / mass
        elastic = (fraction < 0.5) | (np.abs(s) ** 2 > noise)
        decay, mix = np.linalg.eig(-Λ)
        decay = np.where(np.abs(decay.imag) <= MODAL_TOLERANCE * np.abs(decay), decay.real, decay)
        nonzero = np.abs(decay) > ROUND_OFF * abs(C).max() / abs(self.M).max()
        exponents = np.concatenate([np.zeros(free.shape[1]), s[elastic], decay[nonzero]])
        return exponents, np.hstack([free, x[:, elastic], N @ mix[:, nonzero]])

    # -- buckling ------------------------------------------------------------------------------

    def buckling(self, n: int) -> tuple[Array, Array | Complex, Array]:
        """Compute up to n buckling factors nearest to zero, their shapes, and estimated errors.

        The shapes are (n,), (size, n) and (n,).  At a factor λ the stiffness of the shape would
        vanish if the stiffness changed linearly.  The error is the stiffness of the shape in the
        configuration q + λ u of the linear path u, divided by its stiffness in the state q.
        """
        u = self.linear_change("buckling")
        right, left = self._with_laws()
        change = csr_array(
            left @ self._matrix(self._simulation.equation.tangent_change(self.q, u)) @ right
        )
        factors, x = eigensolvers.linear(self.K, -change, n, most=self.K.shape[0], definite=False)
        x = x[:, np.abs(factors) < 1e9 * np.abs(factors).min(initial=np.inf)]
        # Solve again in the space of these shapes, because works are more accurate than matrices.
        works = self._simulation.equation.tangent_works(self.q, u, right @ x, left.T @ x)
        factors, mix = eigensolvers.small(works[0], -works[1])
        order = np.argsort(np.abs(factors), kind="stable")[:n]
        factors, x = factors[order], (x @ mix)[:, order]
        errors = []
        for factor, y in zip(factors, x.T, strict=True):
            T, after = (self._linearized(q)[1] for q in (self.q, self.q + factor * u))
            errors.append(abs(((y @ left) @ after @ (right @ y)) / ((y @ left) @ T @ (right @ y))))
        return *self._nearest(n, factors, x.astype(complex)), np.array(errors)

    def _with_laws(self) -> tuple[csr_array, csr_array]:
        """Return the matrices R and L that reduce the tangent T of all unknowns to K = L T R.

        Columns of R and rows of L are motions with the forces that follow from force laws.  The
        derivative of K is L T' R.
        """
        (_, T), laws, Z = self._linearized(self.q), self._laws, self._Z
        flexibility = diags_array(1 / T.diagonal()[laws])
        columns = eye_array(self.numbering.size, format="csr")[:, laws]
        right = Z - columns @ (flexibility @ (T[laws, :] @ Z))
        left = Z.T - ((Z.T @ T[:, laws]) @ flexibility) @ columns.T
        return csr_array(right), csr_array(left)

    def linear_change(self, call: str) -> Array:
        """Compute the linear change of the configuration due to loads and prescribed motions.

        ``call`` is the caller in messages.
        """
        simulation, supports = self._simulation, self._simulation.supports
        (r, T), Q = self._linearized(self.q), self._axes
        before = supports.in_axes(self.q)
        after = before.copy()
        supports.move(after, before, Step(0.0, 1.0, self.q, simulation.t, simulation.t, 1.0))
        g = Q @ (after - before)
        Z = Q[:, np.setdiff1d(np.arange(len(g)), supports.dofs)]
        rest = Z.T @ (r + T @ g)
        if not rest.any():
            raise ArgumentError(
                f"{call}: nothing acts on the scene at t = {simulation.t:g} s that does not act "
                "in the initial state; give the scene loads, or another t"
            )
        try:
            return np.asarray(g - Z @ splu((Z.T @ T @ Z).tocsc()).solve(rest))
        except RuntimeError:
            raise ArgumentError(f"{call}: the scene is free to move in its state") from None

    # -- shapes --------------------------------------------------------------------------------

    def _nearest(self, n: int, values: V, x: Complex) -> tuple[V, Array | Complex]:
        """Return the n eigenvalues nearest to zero, and shapes with a largest displacement of 1."""
        order = np.argsort(np.abs(values), kind="stable")[:n]
        shapes = self._Z @ x[:, order]
        rotations = self._simulation.subdomain.rotations
        sizes = np.abs(shapes)
        sizes[self.numbering.multipliers] = 0.0
        turning = sizes[rotations].max(axis=0, initial=0.0)
        sizes[rotations] = 0.0
        # If only rotations move, the largest rotation is 1.
        only = sizes.max(axis=0, initial=0.0) <= 1e-9 * self.scene.size * turning
        sizes[np.ix_(rotations, only)] = np.abs(shapes[np.ix_(rotations, only)])
        largest = shapes[sizes.argmax(axis=0), np.arange(shapes.shape[1])]
        shapes = shapes / largest
        real = np.abs(shapes.imag).max(initial=0.0) <= 1e-8
        return values[order], np.asarray(shapes.real if real else shapes)
