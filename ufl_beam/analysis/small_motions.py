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
from ufl_beam.errors import ArgumentError, StepFailed
from ufl_beam.mechanics.time_scheme import Step
from ufl_beam.simulation.simulation import Simulation
from ufl_beam.solvers import eigensolvers
from ufl_beam.solvers.eigensolvers import DENSE, ROUND_OFF, SHIFT, ZERO

Found = tuple[Array, Array | Complex, Array, Array]
"""Results of :meth:`SmallMotions.buckling`."""

V = TypeVar("V", Array, Complex)

REAL = 1e-6  # imaginary part of a buckling factor that is round-off, as a fraction
SECOND = 1e-3  # change for second derivatives; rad, or fraction of the size of the scene
NEAR = 0.2  # largest load of differences in space, as a fraction of the first buckling factor
MOST_REFINEMENTS = 20  # largest number of iterations for a buckling factor in space
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
        right, left = self._with_laws()
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

    def buckling(self, n: int) -> Found:
        """Compute up to n buckling factors nearest to zero, their shapes, and estimated errors.

        The shapes are (n,), (size, n) and (n,).  The factors are real solutions of
        (K + λ K' + λ² K''/2) x = 0, with derivatives along the path q + λ u + λ² w/2 of equilibria.
        Terms of second order matter where a stiffness is large: without them, cells with the
        normal force N lose GA (N/EA)².  The error is the stiffness of the shape in this
        configuration, divided by its change with log λ.  The last result has the magnitudes of
        complex solutions.
        """
        equation, laws = self._simulation.equation, self._laws
        u, solve = self.linear_change("buckling")
        T1 = self._matrix(equation.tangent_change(self.q, u))
        w = solve(T1 @ u)
        # K''/2 along the path; the derivative of K' along u is a central difference.
        ε = SECOND / np.abs(u * self.numbering.scales).max()
        terms = (self.q, w, 0.5), (self.q + ε * u, u, 0.25 / ε), (self.q - ε * u, u, -0.25 / ε)
        T2 = sum(c * self._matrix(equation.tangent_change(q, along)) for q, along, c in terms)
        right, left = self._with_laws()
        K1, K2 = (csr_array(left @ T @ right) for T in (T1, T2))
        into, out_of = csr_array(T1 @ right)[laws], csr_array(left @ T1)[:, laws]
        flexible = csr_array(into.multiply(1 / self.tangent.diagonal()[laws, None]))
        λ, x = eigensolvers.quadratic_near_zero(self.K, K1, K2 - out_of @ flexible, n)
        # Solve again in the space of these shapes, because works are more accurate than matrices:
        # the symmetric linear problem of the vectors (x, λ x), real and imaginary parts.
        λ, x = λ[λ.imag >= 0.0], x[:, λ.imag >= 0.0]
        pairs = np.flatnonzero(λ.imag)
        x = np.hstack([x.real, x[:, pairs].imag])
        by = np.diag(np.append(λ, λ[pairs]).real)
        for j, k in enumerate(pairs, len(λ)):
            by[k, j], by[j, k] = λ[k].imag, -λ[k].imag
        X, Y = right @ x, left.T @ x
        W0, W1 = equation.tangent_works(self.q, u, X, Y)
        W2 = sum(c * equation.tangent_works(q, along, X, Y)[1] for q, along, c in terms)
        W2 = W2 - (out_of.T @ x).T @ (flexible @ x)
        values, mixed = eigensolvers.small(W0 - by.T @ W2 @ by, -W1 - W2 @ by - by.T @ W2)
        real = np.abs(values.imag) <= REAL * np.abs(values)
        factors, others = values[real].real, np.abs(values[~real])
        order = np.argsort(np.abs(factors), kind="stable")[:n]
        factors, mix = factors[order], mixed[:, real].real[:, order]
        errors = []
        for λ1, a, y in zip(factors, mix.T, (x @ mix).T, strict=True):
            after = self._linearized(self.q + λ1 * u + λ1**2 / 2 * w)[1]
            change = λ1 * a @ (W1 + 2 * λ1 * W2) @ a  # with the logarithm of the factor
            errors.append(abs((y @ left) @ after @ (right @ y) / change))
        shapes = self._nearest(n, factors, (x @ mix).astype(complex))
        return *shapes, np.array(errors), others

    def buckling_in_space(self, n: int, static: Simulation) -> Found:
        """Compute the results of :meth:`buckling` with stiffnesses in equilibrium.

        Second-order paths as in the plane would miss forces of third order, which are large in
        slender beams that the loads bend.  So a ``static`` simulation in the same state finds the
        equilibrium at each estimate of a factor.  The stiffness there, and its slope since the last
        estimate, yield the next estimate.  Errors are the last changes.
        """
        (u, _), supports, t = self.linear_change("buckling"), static.supports, self._simulation.t

        def stiffness(λ: float) -> csr_array:
            step = Step(-math.inf, t, self.q, t, t, fraction=λ)
            guess = supports.in_axes(self.q + λ * u)
            supports.move(guess, guess, step)
            q1 = static.attempt_along(step, guess, None).q1
            return self._reduced(self._matrix(static.equation.linearize(q1, step)[1]))

        K, ε = self.K, SECOND / np.abs(u * self.numbering.scales).max()
        λ, x = np.asarray([], complex), np.zeros((K.shape[0], 0), complex)
        for _ in range(MOST_REFINEMENTS):
            try:
                ends = [stiffness(sign * ε) for sign in (1.0, -1.0)]
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
            new = self._refined(λ[guess].real, x[:, guess].real, stiffness, half)
            if new[1] > LARGEST_CHANGE:
                others.append(abs(λ[guess]))
            elif not any(_same(new, other) for other in found):
                found.append(new)
        factors, errors = np.array([pair[:2] for pair in found]).reshape(-1, 2).T
        shapes = np.array([y for *_, y in found], dtype=complex).reshape(-1, len(x)).T
        order = np.argsort(np.abs(factors), kind="stable")
        return *self._nearest(n, factors, shapes), errors[order], np.array(others)

    def _refined(
        self, λ: float, x: Array, stiffness: Callable[[float], csr_array], half: float
    ) -> tuple[float, float, Array]:
        """Return a buckling factor near ``λ``, its last relative change, and its shape near x.

        Imperfections may end the path of equilibria before the factor, or bend it away.  Then the
        stiffness at half of the first factor and its slope up to there yield the factor.
        """

        def after(
            λ: float, x: Array, before: float, last: csr_array
        ) -> tuple[csr_array, float, Array]:
            K = stiffness(λ)
            slope = (K - last) / (λ - before)
            try:
                x = splu(K.tocsc()).solve(slope @ x)
            except RuntimeError:  # the stiffness is singular
                return K, λ, x
            x /= np.abs(x).max()
            return K, λ - (x @ (K @ x)) / (x @ (slope @ x)), x

        guess, shape, before, last = λ, x, 0.0, self.K
        with suppress(StepFailed):
            for _ in range(MOST_REFINEMENTS):
                before, (last, λ, x) = λ, after(λ, x, before, last)
                if (change := abs(λ / before - 1)) <= REFINED:
                    return λ, change, x
        with suppress(StepFailed):
            _, λ, x = after(math.copysign(half, guess), shape, 0.0, self.K)
            return λ, abs(λ / guess - 1), x
        return guess, math.inf, shape

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
