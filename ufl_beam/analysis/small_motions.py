# SPDX-License-Identifier: MIT
"""Eigenvalues of linearized equations: exponents of vibrations, and buckling factors."""

from __future__ import annotations

import math
from collections.abc import Callable
from contextlib import suppress
from typing import TypeVar

import numpy as np
import numpy.typing as npt
from scipy.linalg import null_space
from scipy.sparse import block_array, csc_array, csr_array, diags_array, eye_array
from scipy.sparse.linalg import splu

from ufl_beam.analysis.linearization import Linearization
from ufl_beam.arrays import Array, Complex
from ufl_beam.compiled.c_library import lib
from ufl_beam.errors import ArgumentError, StepFailed
from ufl_beam.mechanics.time_scheme import Step
from ufl_beam.simulation.simulation import Simulation
from ufl_beam.solvers import eigensolvers
from ufl_beam.solvers.eigensolvers import DENSE, ROUND_OFF, SHIFT, ZERO

Equilibrium = tuple[csr_array, Callable[[Array], float]]
"""Stiffness in an equilibrium, and the work xᵀ K x of a shape x, without the matrix's round-off."""

V = TypeVar("V", Array, Complex)

REAL = 1e-6  # imaginary part of a buckling factor that is round-off, as a fraction
SECOND = 1e-3  # change for second derivatives; rad, or fraction of the size of the scene
NEAR = 0.2  # largest load of differences, as a fraction of the first buckling factor
MOST_REFINEMENTS = 20  # largest number of iterations for a buckling factor
SECANT = 1e-3  # change of a factor from which slopes follow, as a fraction
LARGEST_CHANGE = 0.02  # largest relative change of a factor beyond half of it, without equilibrium
REFINED = 1e-8  # change of a buckling factor in the last iteration, as a fraction
SAME = 1e-6  # difference of factors that may be one, as a fraction
MODAL_TOLERANCE = 1e-9  # coupling below this fraction of the largest damping is neglected


class SmallMotions(Linearization):
    """Eigenvalues and eigenvectors of the matrices of small motions."""

    @property
    def symmetric(self) -> bool:
        """True if the stiffness is symmetric, apart from round-off."""
        return bool(abs(self.K - self.K.T).max() <= ROUND_OFF * abs(self.K).max())

    # -- frequencies ---------------------------------------------------------------------------

    def exponents(self, n: int, *, damped: bool = True) -> tuple[Complex, Array | Complex]:
        """Compute up to n exponents nearest to zero, and their shapes; (n,), 1/s; (size, n).

        With ``damped=False`` forces that depend on velocities are left out.
        """
        K, C, M, highest = self.K, self.C, self.M, self.squares.max()
        τ = highest**-0.5
        symmetric, round_off = self.symmetric, ROUND_OFF * abs(K).max()
        matrix = (K + K.T) / 2 if symmetric else K
        _, x, works, zero, first = self.undamped(n, matrix, definite=symmetric)
        if symmetric and (not damped or abs(C).max() <= round_off * τ):
            values = works / np.sum(x * (M @ x), axis=0)
            values[zero] = 0.0
            s, motions = np.sqrt((-values).astype(complex)), x.astype(complex)
        else:
            s, motions = self._damped(C, x[:, zero], n, first**0.5)
        finite = s.imag >= 0
        if K.shape[0] > DENSE:  # SLEPc finds infinite exponents, too
            heavy = M.diagonal() > 0.0
            fastest = (np.abs(C.diagonal()[heavy]) / M.diagonal()[heavy]).max()
            finite &= np.abs(s) <= 30 * max(highest**0.5, fastest)
        return self._nearest(n, s[finite], motions[:, finite])

    def undamped(
        self, n: int, matrix: csr_array, *, definite: bool
    ) -> tuple[Array, Array, Array, npt.NDArray[np.bool_], float]:
        """Compute at least n motions nearest to zero with a stiffness ``matrix``, undamped.

        Returns squared frequencies (rad²/s²), motions x in columns, their works xᵀ K x (J), whether
        each work may be round-off, and the least squared frequency of the other motions.
        """
        least = -SHIFT * self.squares.min()

        def solve(shift: float) -> tuple[Array, Array, Array, npt.NDArray[np.bool_]]:
            values, x = eigensolvers.linear(
                matrix, self.M, n, most=self.most, definite=definite, shift=shift
            )
            motions = np.where(values.imag < 0.0, x.imag, x.real)  # both of a conjugate pair
            zero = np.abs(values) <= ROUND_OFF * self.squares.max()
            if zero.any() and not definite:
                # Eigenvectors have errors above round-off; an inverse iteration reduces them.
                inverse = splu(csc_array(matrix - least * self.M))
                motions[:, zero] = inverse.solve(self.M @ motions[:, zero])
                motions[:, zero] /= np.linalg.norm(motions[:, zero], axis=0)
            return values.real, motions, *self._works(motions)

        try:
            values, x, works, zero = solve(least)
        except np.linalg.LinAlgError:
            raise ArgumentError(
                "neither mass nor stiffness determines some motion in this state; give it mass"
            ) from None
        first = np.abs(values[~zero]).min(initial=self.squares.max())
        if zero.any():
            # A second shift is far from zero eigenvalues, whose huge inverses cost digits.
            values, x, works, zero = solve(-first / 2)
        return values, x, works, zero, first

    def _works(self, x: Array) -> tuple[Array, npt.NDArray[np.bool_]]:
        """Return works xᵀ K x (J) of the columns of x, and whether each may be round-off."""
        right, left = self._with_laws(self._linearized(self.q)[1])
        works = self._simulation.equation.stiffness_works(self.q, right @ x, left.T @ x)
        sizes = ZERO * np.sum(np.abs(x) * (abs(self.K) @ np.abs(x)), axis=0)
        sizes += ROUND_OFF**2 * self.squares.max() * np.sum(x * (self.M @ x), axis=0)  # of x
        return works, np.asarray(np.abs(works) <= sizes)

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
        most = 2 * (self.most - B.shape[1]) + self._number_of_decays(self.C)
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

    def _number_of_decays(self, C: csr_array) -> int:
        """Return the number of motions without mass that dampers resist; each has one exponent."""
        rows = self._constraint_rows
        light = np.flatnonzero((self.M.diagonal() == 0.0) & ~rows)
        between = C[light][:, light]
        if not between.nnz or C.shape[0] > DENSE:
            return int(between.nnz > 0) * len(light)  # SLEPc seeks far fewer
        sizes = self.lengths[self.left[light]]
        N = null_space(self.K[np.flatnonzero(rows)][:, light].toarray() * sizes)
        stiff, viscous = (N.T @ (A.toarray() * np.outer(sizes, sizes)) @ N
                          for A in (self.K[light][:, light], between))  # fmt: skip
        round_off = ROUND_OFF * np.abs(stiff).max(initial=0.0) / self.squares.max() ** 0.5
        values = np.linalg.svd(viscous, compute_uv=False)
        largest = float(values.max(initial=0.0))
        return int(np.sum(values > max(MODAL_TOLERANCE * largest, round_off)))

    # -- buckling ------------------------------------------------------------------------------

    def buckling(self, n: int, static: Simulation) -> tuple[Array, Array | Complex, Array, Array]:
        """Compute up to n buckling factors nearest to zero, their shapes, and estimated errors.

        The shapes are (n,), (size, n) and (n,).  The stiffness vanishes in the equilibrium at a
        factor.  The stiffness of neighbouring equilibria yields estimates of factors.  A ``static``
        simulation in the same state finds the equilibrium at each estimate, and the work of the
        shape there yields the next estimate.  Errors are the last relative changes.  The last
        result has the magnitudes of complex solutions, and of factors that no equilibrium confirms.
        """
        u, t = self.linear_change("buckling"), self._simulation.t
        equation, supports = static.equation, static.supports

        def equilibrium(λ: float) -> Equilibrium:
            step = Step(-math.inf, t, self.q, t, t, fraction=λ)
            guess = supports.in_axes(self.q + λ * u)
            supports.move(guess, guess, step)
            q1 = static.attempt_along(step, guess, None).q1
            lib.restart(equation.c, lib.EXACT)
            T = self._matrix(equation.linearize(q1, step)[1])
            right, left = self._with_laws(T)

            def work(x: Array) -> float:
                along = (right @ x)[:, None], (left.T @ x)[:, None]
                return float(equation.stiffness_works(q1, *along)[0])

            return self._reduced(T), work

        K, ε = self.K, SECOND / np.abs(u * self.numbering.scales).max()
        λ, x = np.asarray([], complex), np.zeros((K.shape[0], 0), complex)
        for _ in range(MOST_REFINEMENTS):
            try:
                ends = [equilibrium(sign * ε)[0] for sign in (1.0, -1.0)]
            except StepFailed:  # beyond the end of the path
                ε /= 4
                continue
            slope, bend = (ends[0] - ends[1]) / (2 * ε), (ends[0] + ends[1] - 2 * K) / (2 * ε**2)
            λ, x = eigensolvers.quadratic_near_zero(K, slope, bend, n)
            if not ε > NEAR * np.abs(λ).min(initial=math.inf) > 0:
                break
            ε = NEAR / 2 * np.abs(λ).min()
        real = np.abs(λ.imag) <= REAL * np.abs(λ)
        others, found = [*np.abs(λ[~real])], list[tuple[float, float, Array]]()
        half = np.abs(λ[real]).min(initial=math.inf) / 2
        for guess in np.flatnonzero(real)[np.argsort(np.abs(λ[real]), kind="stable")]:
            if len(found) == n:
                break
            new = self._refined(λ[guess].real, x[:, guess].real, equilibrium, half)
            if new[1] > LARGEST_CHANGE:
                others.append(abs(λ[guess]))
            elif not any(_same(new, other) for other in found):
                found.append(new)
        factors, errors = np.array([pair[:2] for pair in found]).reshape(-1, 2).T
        shapes = np.array([y for *_, y in found], dtype=complex).reshape(-1, len(x)).T
        order = np.argsort(np.abs(factors), kind="stable")
        return *self._nearest(n, factors, shapes), errors[order], np.array(others)

    def _refined(
        self, λ: float, x: Array, equilibrium: Callable[[float], Equilibrium], half: float
    ) -> tuple[float, float, Array]:
        """Return a buckling factor near ``λ``, its last relative change, and its shape near x.

        The factor is found by the secant method.  Imperfections may end the path of equilibria
        before the factor, or bend it away.  Then the stiffness in the state and at half of the
        first factor yield the factor.
        """

        def excess(λ: float, x: Array) -> tuple[float, Array]:
            """Return by how much ``λ`` exceeds a factor that grows in proportion, and its shape."""
            K, work = equilibrium(λ)
            change = K - self.K
            y = np.full(len(x), np.nan)
            with suppress(RuntimeError):  # the stiffness is singular
                y = splu(K.tocsc()).solve(change @ x)
            x = y / np.abs(y).max() if np.isfinite(y).all() else x
            return λ * work(x) / float(x @ (change @ x)), x

        guess, shape, before, slope = λ, x, (1 - SECANT) * λ, 1.0
        with suppress(StepFailed):
            last, x = excess(before, x)
            for _ in range(MOST_REFINEMENTS):
                beyond, x = excess(λ, x)
                if abs(λ - before) >= SECANT / 2 * abs(λ):
                    slope = (beyond - last) / (λ - before)
                before, last, λ = λ, beyond, λ - beyond / slope
                if (change := abs(λ / before - 1)) <= REFINED:
                    return λ, change, x
        with suppress(StepFailed):
            λ = math.copysign(half, guess)
            beyond, x = excess(λ, shape)
            return λ - beyond, abs((λ - beyond) / guess - 1), x
        return guess, math.inf, shape

    def _with_laws(self, T: csr_array) -> tuple[csr_array, csr_array]:
        """Return the matrices R and L that reduce the tangent T of all unknowns to K = L T R.

        Columns of R and rows of L are motions with the forces that follow from force laws.
        """
        laws, Z = self._laws, self._Z
        flexibility = diags_array(1 / T.diagonal()[laws])
        columns = eye_array(self.numbering.size, format="csr")[:, laws]
        right = Z - columns @ (flexibility @ (T[laws, :] @ Z))
        left = Z.T - ((Z.T @ T[:, laws]) @ flexibility) @ columns.T
        return csr_array(right), csr_array(left)

    # -- shapes --------------------------------------------------------------------------------

    def _nearest(self, n: int, values: V, x: Complex) -> tuple[V, Array | Complex]:
        """Return the n eigenvalues nearest to zero, and shapes with a largest displacement of 1."""
        order = np.argsort(np.abs(values), kind="stable")[:n]
        shapes, d = self._Z @ x[:, order], self.numbering.displacements
        nodes = np.vstack([self.numbering.dofs, self.numbering.dofs_of_bodies])
        for k, shape in enumerate(shapes.T):
            vectors, turned = shape[nodes[:, :d]], shape[nodes[:, d:]]
            # If only rotations move, the largest rotation is 1.
            if np.abs(vectors).max() <= 1e-9 * self.scene.size * np.abs(turned).max():
                vectors = turned
            lengths = np.linalg.norm(vectors, axis=1)
            vector = vectors[lengths.argmax()]
            largest = vector[np.abs(vector).argmax()]
            shapes[:, k] = shape * (np.abs(largest) / largest / lengths.max())
        real = np.abs(shapes.imag).max(initial=0.0) <= 1e-8
        return values[order], np.asarray(shapes.real if real else shapes)


def _same(one: tuple[float, float, Array], other: tuple[float, float, Array]) -> bool:
    (λ, _, x), (λ1, _, y) = one, other
    parallel = abs(x @ y) > (1 - SAME) * np.linalg.norm(x) * np.linalg.norm(y)
    return bool(parallel and abs(λ / λ1 - 1) < SAME)
