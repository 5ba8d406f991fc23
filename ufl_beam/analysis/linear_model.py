# SPDX-License-Identifier: MIT
"""Linear models: matrices, state spaces and frequency responses about an equilibrium."""

from __future__ import annotations

import copy
from collections.abc import Sequence
from dataclasses import replace
from functools import cached_property
from typing import Any

import numpy as np
import numpy.typing as npt
from scipy.linalg import lstsq, qr, solve, svd
from scipy.sparse import block_array, csc_array, csr_array, diags_array, eye_array, hstack
from scipy.sparse.linalg import splu

from ufl_beam.analysis.linear_inputs_and_outputs import (
    Inputs,
    Outputs,
    checked_inputs,
    checked_outputs,
)
from ufl_beam.analysis.modes import require_state
from ufl_beam.analysis.small_motions import SmallMotions
from ufl_beam.arrays import Array, Complex
from ufl_beam.discretization.model_warnings import warn_of_masses
from ufl_beam.display import Rich
from ufl_beam.errors import (
    ArgumentError,
    require_array,
    require_count,
    require_kind,
    require_sequence,
    shorten,
    warn,
)
from ufl_beam.model.beams import Mesh
from ufl_beam.model.bodies import AttachmentPoint
from ufl_beam.model.connector_laws import Controller, Coulomb
from ufl_beam.model.connectors import Connector
from ufl_beam.model.functions import Constant
from ufl_beam.model.loads import Load
from ufl_beam.model.scene import Scene
from ufl_beam.model.supports import COMPONENTS
from ufl_beam.output.states import States
from ufl_beam.simulation.simulation import Simulation
from ufl_beam.simulation.solution import Solution
from ufl_beam.solvers.eigensolvers import ROUND_OFF

UNBALANCED = 1e-6  # unbalanced force that is an error, as a fraction of the largest force
MOVING = 1e-6  # velocity that is an error, as a fraction of lowest frequency times size
SINGULAR = 1e-12  # eigenvalue or pivot that is zero, as a fraction of the largest one
HELD = 1e-9  # fraction of a motion that constraints allow, below which they hold it
ABSENT = 1e-9  # coefficient of a derivative that is round-off, as a fraction of its terms
QUASI_STATIC = 1e-2  # exponent of the static correction, as a fraction of the lowest frequency
ITERATIONS = 4  # of the static motions of a reduced model
MOST_STATES = 4000  # largest number of states without modal reduction
NAMED = 3  # largest number of unbalanced forces in a message


class LinearModel(Rich):
    """Small motions about an equilibrium with inputs and outputs; made by :func:`linearize`.

    All values are changes from the equilibrium.  The equations are ``M x'' + (C + G) x' + K x = f``
    for the free motions and the forces of constraints, x.  A prescribed motion u is an input by its
    acceleration; u and u' are states.  docs/linear_models.md derives the state space.

    Attributes:
        scene: Model.
        unknowns: Place and component ("u", "v", "psi") of each unknown x, or the constraint and
            "force".  At supports with turned axes, u and v are along and across the axis.
        M: Mass; sparse, (n, n), symmetric; zero in rows of constraints.
        C: Symmetric part of the derivative of forces with respect to velocities: damping.
        G: Skew-symmetric part of this derivative: gyroscopic forces.
        K: Tangent stiffness, with rows and columns of constraints; it is symmetric unless a
            follower force or a force law makes it unsymmetric.
        inputs: Names of the inputs, with units.
        outputs: Names of the outputs, with units.

    Example:
        >>> push = ub.PointLoad(beam.end, force=(0, 1.0))
        >>> arm = ub.Scene([beam], supports=[ub.Clamped(beam.start)], loads=[push])
        >>> model = ub.linearize(arm, inputs=[push], outputs=[("displacement", beam.end, "v")])
        >>> print(model.outputs, model.frequency_response(0.0).real.shape)
        ['v beam.end (2, 0) [m]'] (1, 1, 1)
        >>> A, B, C, D = model.reduced(3).state_space()
        >>> print(A.shape, np.sort(np.linalg.eigvals(A).imag / (2 * np.pi)).round()[3:])  # Hz
        (6, 6) [ 42. 286. 651.]
    """

    def __init__(self, small: SmallMotions, scene: Scene, inputs: Inputs, outputs: Outputs) -> None:
        self.scene, self._small, self._inputs, self._outputs = scene, small, inputs, outputs
        self.inputs, self.outputs = inputs.names, outputs.names
        self._basis: tuple[Array, Array] | None = None  # modes and motions with unit inputs
        self._correction: Array | float = 0.0  # of D in a reduced model
        self._squares: Array = np.zeros(0)  # squared frequencies of the modes
        self._mode_names: list[str] = []
        require_free(small, inputs, outputs)

    def __str__(self) -> str:
        size = f"{len(self.states)} states" if self._basis else f"{len(self.unknowns)} unknowns"
        lines = [f"linear model with {size}", "inputs"]
        lines += [f"  {name}" for name in self.inputs]
        return "\n".join([*lines, "outputs", *(f"  {name}" for name in self.outputs)])

    def __repr__(self) -> str:
        return (
            f"<LinearModel: {len(self.unknowns)} unknowns, {len(self.inputs)} inputs, "
            f"{len(self.outputs)} outputs>"
        )

    # -- matrices ------------------------------------------------------------------------------

    @cached_property
    def unknowns(self) -> list[tuple[AttachmentPoint | Connector, str]]:
        """Place and component of each unknown."""
        numbering, small = self._small.numbering, self._small
        where: dict[int, tuple[Any, str]] = {}
        for body, dofs in zip(self.scene.rigid_bodies, numbering.dofs_of_bodies, strict=True):
            where.update((int(d), (body.middle, c)) for d, c in zip(dofs, COMPONENTS, strict=True))
        for beam in self.scene.beams:
            s, inner = numbering.parameters(beam), numbering.mesh.nodes[1:-1]
            between = s[:-1, None] + inner * np.diff(s)[:, None]
            at = np.append(np.column_stack([s[:-1], between]), s[-1])
            for place, node in zip(at, numbering.nodes_along(beam), strict=True):
                dofs = zip(numbering.dofs[node], COMPONENTS, strict=True)
                where.update((int(d), (beam.at(float(place)), c)) for d, c in dofs)
        for place, node in numbering.beyond.items():
            dofs = zip(numbering.dofs[node], COMPONENTS, strict=True)
            where.update((int(d), (place, c)) for d, c in dofs)
        forces = zip(numbering.multipliers, self.scene.all_connectors, strict=True)
        where.update((int(d), (connector, "force")) for d, connector in forces)
        return [where[int(dof)] for dof in small.left]

    def _unscaled(self, A: csr_array) -> csr_array:
        """Undo the scaling of the rows and columns of constraints."""
        scale = diags_array(1 / self._small.scale[self._small.left])
        return csr_array(scale @ A @ scale)

    @cached_property
    def M(self) -> csr_array:
        """Mass."""
        return self._unscaled(self._small.M)

    @cached_property
    def C(self) -> csr_array:
        """Damping."""
        return self._unscaled((self._damping + self._damping.T) / 2)

    @cached_property
    def G(self) -> csr_array:
        """Gyroscopic forces."""
        return self._unscaled((self._damping - self._damping.T) / 2)

    @cached_property
    def K(self) -> csr_array:
        """Tangent stiffness."""
        return self._unscaled(self._small.K)

    @cached_property
    def _damping(self) -> csr_array:
        """Derivative of forces with respect to velocities, without round-off of the tangent."""
        small = self._small
        rows = abs(small.K).max(axis=1).toarray().ravel()
        C = small.C.tocoo()
        i, j = C.coords
        noise = ROUND_OFF * np.sqrt(rows[i] * rows[j] / small.squares.max())
        kept = np.abs(C.data) > noise
        return csr_array((C.data[kept], (i[kept], j[kept])), shape=C.shape)

    @property
    def _loads(self) -> tuple[csr_array, tuple[csr_array, csr_array, csr_array]]:
        """Forces of unit inputs f, and those of unit u, u', u'' of prescribed motions."""
        small, inputs = self._small, self._inputs
        S = inputs.motions
        moved = [
            csr_array(-(small._Z.T @ (A @ S)))
            for A in (small.condensed_tangent, small.condensed_damping, small.masses)
        ]
        return csr_array(small._Z.T @ inputs.condensed), (
            csr_array(moved[0] + small._Z.T @ inputs.prescribed), moved[1], moved[2],
        )  # fmt: skip

    def descriptor(self) -> tuple[csr_array, csr_array, csr_array, csr_array, Array]:
        """Return sparse E, A, B, C and dense D of ``E w' = A w + B i``, ``y = C w + D i``.

        The variables w are the free motions, their velocities and accelerations, the forces of
        constraints, then u and u' of the prescribed motions.  i are the inputs, y the outputs.  E
        is singular.  A reduced model returns the state space with a unit matrix E.
        """
        if self._basis is not None:
            A, B, C, D = self.state_space()
            return csr_array(np.eye(len(A))), csr_array(A), csr_array(B), csr_array(C), D
        small, (P0, P1, P2) = self._small, self._outputs.rows
        F, moved = self._loads
        n, nu = small.K.shape[0], self._inputs.number_of_motions
        y, μ = np.flatnonzero(~small._constraint_rows), np.flatnonzero(small._constraint_rows)
        M, Cd, K, Z = small.M, self._damping, small.K, small._Z
        S, one = self._inputs.motions, eye_array(nu)
        I, none = eye_array(len(y)), None
        E = block_array([
            [I, none, none, none, none, none],
            [none, I, none, none, none, none],
            [csr_array((n, len(y))), none, csr_array((n, len(y))), csr_array((n, len(μ))), none, none],
            [none, none, none, none, one, none],
            [none, none, none, none, none, one],
        ])  # fmt: skip
        A = block_array([
            [csr_array((len(y), len(y))), I, none, none, none, none],
            [none, csr_array((len(y), len(y))), I, none, none, none],
            [-K[:, y], -Cd[:, y], -M[:, y], -K[:, μ], moved[0], moved[1]],
            [none, none, none, none, csr_array((nu, nu)), one],
            [none, none, none, none, none, csr_array((nu, nu))],
        ])  # fmt: skip
        nf = F.shape[1]
        B = block_array([
            [csr_array((2 * len(y), nf)), csr_array((2 * len(y), nu))], [F, moved[2]],
            [csr_array((nu, nf)), csr_array((nu, nu))], [csr_array((nu, nf)), one],
        ])  # fmt: skip
        C = hstack([P0 @ Z[:, y], P1 @ Z[:, y], P2 @ Z[:, y], P0 @ Z[:, μ], P0 @ S, P1 @ S])
        order = self._inputs.order
        D = np.hstack([self._outputs.direct, (P2 @ S).toarray()])[:, order]
        return csr_array(E), csr_array(A), csr_array(csr_array(B)[:, order]), csr_array(C), D

    # -- responses -----------------------------------------------------------------------------

    def transfer_function(self, s: npt.ArrayLike) -> Complex:
        """Return outputs for inputs ``exp(s t)``; (num_outputs, num_inputs, len(s)).

        Args:
            s: Complex exponents; 1/s.  Zero and other exponents of the model are poles.
        """
        values = np.atleast_1d(np.asarray(s, dtype=complex))
        if values.ndim != 1 or not np.isfinite(values).all():
            raise ArgumentError(f"transfer_function: s = {shorten(s)} must be finite, (n,)")
        response = np.zeros((len(self.outputs), len(self.inputs), len(values)), dtype=complex)
        if self._basis is not None:
            A, B, C, D = self.state_space()
            for k, at in enumerate(values):
                response[:, :, k] = C @ np.linalg.solve(at * np.eye(len(A)) - A, B) + D
            return response
        for k, at in enumerate(values):
            response[:, :, k] = self._response(at)
        return response

    def frequency_response(self, omega: npt.ArrayLike) -> Complex:
        """Return amplitudes of outputs for harmonic inputs of amplitude 1.

        Displacements per force are receptances, velocities per force mobilities.

        Args:
            omega: Circular frequencies; rad/s.

        Returns:
            Complex amplitudes; (num_outputs, num_inputs, len(omega)).
        """
        values = require_array(np.atleast_1d(np.asarray(omega)), "frequency_response: omega")
        return self.transfer_function(1j * values)

    def _response(self, s: complex) -> Complex:
        """Return outputs for inputs ``exp(s t)`` of the full model; (num_outputs, num_inputs)."""
        small, (P0, P1, P2), S = self._small, self._outputs.rows, self._inputs.motions
        F, moved = self._loads
        nu = S.shape[1]
        if nu and s == 0:
            raise ArgumentError("transfer_function: s = 0: a prescribed motion grows without bound")
        try:
            factors = splu(csc_array(small.K + s * self._damping + s**2 * small.M))
        except RuntimeError:
            raise ArgumentError(f"transfer_function: s = {s:g} is an exponent of the model") from None
        u = 1 / s**2 if nu else 0.0
        load = np.hstack([F.toarray(), u * sum(s**k * A.toarray() for k, A in enumerate(moved))])
        X = small._Z @ factors.solve(load.astype(complex)) + np.hstack(
            [np.zeros((S.shape[0], F.shape[1])), u * S.toarray()]
        )
        Y = P0 @ X + s * (P1 @ X) + s**2 * (P2 @ X)
        Y[:, : F.shape[1]] += self._outputs.direct
        return np.asarray(Y[:, self._inputs.order])

    # -- modal reduction -----------------------------------------------------------------------

    def reduced(self, n: int) -> LinearModel:
        """Return a model of the first n undamped modes, with static corrections of the outputs.

        The modes are those nearest to zero frequency, rigid motions included.  Damping and
        gyroscopic forces couple them.  Prescribed motions keep their states; the scene follows them
        as in statics.  The correction, a part of D, makes the response to slow inputs exact.

        Args:
            n: Number of modes; fewer if the scene has fewer.
        """
        n, small, nu = require_count(n, "reduced: n"), self._small, self._inputs.number_of_motions
        _, x, works, zero, _ = small.undamped(n, (small.K + small.K.T) / 2, definite=True)
        masses = np.sum(x * (small.M @ x), axis=0)
        values = np.where(zero, 0.0, works / masses)
        order = np.argsort(np.abs(values), kind="stable")[:n]
        values, x = values[order], (x / np.sqrt(masses))[:, order]
        lowest = np.abs(values[np.abs(values) > HELD * small.squares.min()]).min(
            initial=small.squares.max()
        )
        s = QUASI_STATIC * float(lowest) ** 0.5
        # Static motions P with K P = B; K may be singular, and an iteration reduces the error of the
        # shifted matrix by the factor QUASI_STATIC² each time.
        P = np.zeros((len(x), nu))
        if nu:
            shifted = splu(csc_array(small.K + s**2 * small.M))
            for _ in range(ITERATIONS):
                P = shifted.solve(self._loads[1][0].toarray() + s**2 * (small.M @ P))
        model = copy.copy(self)
        for name in ("_space", "states"):
            vars(model).pop(name, None)
        model._basis = x, P
        model._squares = values
        hertz = np.sqrt(np.abs(values)) / (2 * np.pi)
        model._mode_names = [f"mode {k} ({f:.4g} Hz)" for k, f in enumerate(hertz)]
        model._correction = (self._response(complex(s)) - model.transfer_function(s)[:, :, 0]).real
        vars(model).pop("_space")
        return model

    # -- state space ---------------------------------------------------------------------------

    def state_space(self) -> tuple[Array, Array, Array, Array]:
        """Return A, B, C, D of ``w' = A w + B i``, ``y = C w + D i``; dense.

        The states are independent motions, motions of dampers without mass, velocities, then u and
        u' of prescribed motions; :attr:`states` names them.

        Raises:
            ArgumentError: The model is too large; nothing determines a motion; or an output is the
                rate of a motion without mass that follows an input at once.
        """
        *matrices, _ = self._space
        A, B, C, D = (matrix.copy() for matrix in matrices)
        return A, B, C, D

    @cached_property
    def states(self) -> list[str]:
        """Names of the states of :meth:`state_space`."""
        return self._space[4][0]

    def state(self, run: Solution | Simulation) -> Array:
        """Return the states of the last state of a solution or simulation; (num_states,).

        Deviations from the equilibrium are taken as small.  Velocities are zero in statics.

        Raises:
            ArgumentError: The run has other unknowns.
        """
        require_kind(run, (Solution, Simulation), "state: run")
        now: States = run.now if isinstance(run, Simulation) else run
        small, inputs = self._small, self._inputs
        if not now.numbering.agrees(small.numbering):
            raise ArgumentError("state: run has other beams, joints or cells than the model")
        if not len(now):
            raise ArgumentError("state: run has no state; give simulation, or simulation.snapshot()")
        q = now.q[-1] - small.q
        v = now.v[-1] if len(now.v) else np.zeros(len(q))
        y = ~small._constraint_rows
        from_axes, (read, rate), P = small._axes.T, self._space[4][1], self._space[4][2]
        u, du = (np.asarray(inputs.read @ x) for x in (q, v))
        z, dz = ((from_axes @ x)[small.left[y]] - P @ w for x, w in ((q, u), (v, du)))
        return np.concatenate([read @ z, rate @ dz, u, du])

    def to_control(self) -> Any:
        """Return the state space as a ``StateSpace`` of python-control, with names.

        Raises:
            ImportError: python-control is not installed.
        """
        try:
            import control
        except ImportError as error:  # pragma: no cover - depends on the machine
            raise ImportError("to_control needs python-control: pip install control") from error
        # Dots separate names of systems and signals there
        names = [[x.replace(".", "_") for x in names]
                 for names in (self.states, self.inputs, self.outputs)]  # fmt: skip
        return control.ss(
            *self.state_space(), states=names[0], inputs=names[1], outputs=names[2]
        )

    @cached_property
    def _space(self) -> tuple[Array, Array, Array, Array, Any]:
        """A, B, C, D; and names of states, matrices that read them, particular motions."""
        small, inputs = self._small, self._inputs
        rows = small._constraint_rows
        y, μ = np.flatnonzero(~rows), np.flatnonzero(rows)
        F, moved = self._loads
        nf, nu = F.shape[1], inputs.number_of_motions
        Z, D = small._Z, small.lengths[small.left[y]]
        K, M, Cd = small.K.tocsr(), small.M.tocsr(), self._damping
        if self._basis is None:
            if 2 * len(y) > MOST_STATES:
                raise ArgumentError(
                    f"state_space: {2 * len(y)} states are too many for dense matrices; use "
                    "reduced(n), or descriptor() and frequency_response(omega)"
                )
            N, P, kept = _independent(K[μ][:, y], moved[0][μ].toarray(), D)
        else:
            N, P = self._basis[0][y], self._basis[1][y]
        k = N.shape[1]
        Mr, Cr, Kr = (N.T @ (A[y][:, y] @ N) for A in (M, Cd, K))
        if self._basis is not None and abs(K - K.T).max() <= ROUND_OFF * abs(K).max():
            Kr = np.diag(self._squares)  # quotients of works, more accurate than products with K
        Ps = [N.T @ (A[y].toarray() - B[y][:, y] @ P) for A, B in zip(moved, (K, Cd, M), strict=True)]
        if self._basis is None:
            sizes = np.einsum("ij,ij->j", np.abs(N), abs(M[y][:, y]) @ np.abs(N))
            V1, V0 = _with_mass(Mr, D[kept], sizes)
        else:
            V1, V0 = np.eye(k), np.zeros((k, 0))
        W1, W0, U1, U0, viscosity = _damped(V0.T @ Cr @ V0)
        na, nb = V1.shape[1], W1.shape[1]
        # Linear functions of states (a, b1, a', u, u') and inputs (f, u''), one column each
        widths = [na, nb, na, nu, nu, nf, nu]
        at = np.cumsum([0, *widths])
        a, b1, da, u, du, f, ddu = (np.eye(at[-1])[i:j] for i, j in zip(at, at[1:], strict=False))
        forces = N.T @ (F[y] @ f) + Ps[0] @ u + Ps[1] @ du + Ps[2] @ ddu
        known = V1 @ a + V0 @ (W1 @ b1)
        stiffness = U0.T @ V0.T @ Kr @ V0 @ W0
        if stiffness.size and np.linalg.cond(stiffness) > 1 / SINGULAR:
            name = _free(svd(stiffness)[2][-1], N @ V0 @ W0 / D[:, None], self._motions(y))
            raise ArgumentError(f"state_space: neither mass, damper nor stiffness determines {name}")
        b0 = np.zeros((0, at[-1]))
        if stiffness.size:
            b0 = solve(stiffness, U0.T @ (V0.T @ (forces - Kr @ known - Cr @ (V1 @ da))))
        z = known + V0 @ (W0 @ b0)
        db1 = (U1.T @ (V0.T @ (forces - Kr @ z - Cr @ (V1 @ da)))) / viscosity[:, None]
        dz = V1 @ da + V0 @ (W1 @ db1)  # without rates of b0, which meet neither mass nor damping
        dda = solve(V1.T @ Mr @ V1, V1.T @ (forces - Kr @ z - Cr @ dz), assume_a="pos")
        rates = np.vstack([da, db1, dda, du, ddu])
        ns = at[5]
        A, B = rates[:, :ns], rates[:, ns:]
        motion = N @ z + P @ u
        X = Z[:, y] @ motion + inputs.motions @ u
        if self._basis is None:
            velocity, acceleration = N @ dz + P @ du, N @ (V1 @ dda) + P @ ddu
            rest = F[y] @ f + moved[0][y] @ u + moved[1][y] @ du + moved[2][y] @ ddu
            rest -= K[y][:, y] @ motion + Cd[y][:, y] @ velocity + M[y][:, y] @ acceleration
            borne = _least_squares(D[:, None] * K[y][:, μ].toarray(), D[:, None] * rest)
        else:
            borne = self._basis[0][μ] @ z + self._basis[1][μ] @ u
        out = self._outputs
        Y = out.rows[0] @ (X + Z[:, μ] @ borne)
        Y[:, ns : ns + nf] += out.direct
        first = self._rate(out.rows[1], X, rates, ns)
        dX = X[:, :ns] @ rates
        Y += first + self._rate(out.rows[2], dX, rates, ns, (abs(X[:, :ns]) @ abs(rates)))
        C, Dm = Y[:, :ns], Y[:, ns:] + 0.0
        Dm = Dm[:, inputs.order] + self._correction
        inverse = np.linalg.inv(np.hstack([V1, V0]))
        if self._basis is None:
            pick = np.zeros((k, len(y)))
            pick[np.arange(k), kept] = 1.0
        else:
            pick = N.T @ M[y][:, y]
        coordinates = inverse @ pick
        read = np.vstack([coordinates[:na], W1.T @ coordinates[na:]])
        names = self._state_names(V1, V0 @ W1, None if self._basis else kept, y)
        return A, B[:, inputs.order], C, Dm, (names, (read, coordinates[:na]), P)

    def _rate(
        self, rows: csr_array, X: Array, rates: Array, ns: int, terms: Array | None = None
    ) -> Array:
        """Return rows times the derivative of X, a function of states and inputs."""
        sizes = abs(rows) @ (np.abs(X) if terms is None else terms)
        through = np.abs(rows @ X)
        jumps = through[:, ns:] > ABSENT * (sizes[:, ns:] + sizes[:, :ns].max(axis=1, initial=0)[:, None])
        wrong = jumps & (through[:, ns:] > 0)
        for i, j in np.argwhere(wrong)[:1]:
            names = [self.inputs[k] for k in np.argsort(self._inputs.order)]
            raise ArgumentError(
                f"state_space: {self.outputs[i]} depends on the rate of {names[j]}, because the "
                "motion has no mass; give it mass, use another output, or frequency_response"
            )
        return np.asarray(rows @ (X[:, :ns] @ rates))

    def _motions(self, y: npt.NDArray[Any]) -> list[str]:
        return [f"{self.unknowns[i][1]} {self.unknowns[i][0]}" for i in y]

    def _state_names(self, V1: Array, V: Array, kept: Any, y: npt.NDArray[Any]) -> list[str]:
        """Return names of states: motions by their place, combinations by their largest part."""
        if kept is None:
            motions, slow = self._mode_names, list[str]()
        else:
            names = [self._motions(y)[i] for i in kept]

            def named(column: Array) -> str:
                largest = names[int(np.abs(column).argmax())]
                return largest if np.count_nonzero(column) == 1 else f"motion with {largest}"

            motions, slow = ([named(column) for column in matrix.T] for matrix in (V1, V))
        prescribed = self._inputs.prescribed_names
        return [
            *motions, *slow, *(f"d/dt {name}" for name in motions),
            *prescribed, *(f"d/dt {name}" for name in prescribed),
        ]  # fmt: skip


# -- elimination -----------------------------------------------------------------------------------


def _independent(G: csr_array, h: Array, sizes: Array) -> tuple[Array, Array, npt.NDArray[Any]]:
    """Solve constraints ``G y = h u``: y = N y[kept] + P u, with independent motions ``kept``.

    ``sizes`` make motions dimensionless.  N has unit rows, and P zero rows, for ``kept``.
    """
    n, (m, nu) = G.shape[1], h.shape
    if not m:
        return np.eye(n), np.zeros((n, nu)), np.arange(n)
    scaled = G.toarray() * sizes
    lengths = np.linalg.norm(scaled, axis=1)
    scaled, h = scaled / lengths[:, None], h / lengths[:, None]
    Q, R, order = qr(scaled, mode="economic", pivoting=True)
    rank = int(np.sum(np.abs(R.diagonal()) > SINGULAR * abs(R[0, 0])))
    dependent, kept = order[:rank], np.sort(order[rank:])
    position = np.argsort(order[rank:])
    R1, R2 = R[:rank, :rank], R[:rank, rank:][:, position]
    N, P = np.zeros((n, n - rank)), np.zeros((n, nu))
    N[kept, np.arange(n - rank)] = 1.0
    N[dependent] = sizes[dependent, None] * -solve(R1, R2) / sizes[kept]
    P[dependent] = sizes[dependent, None] * solve(R1, (Q.T @ h)[:rank])
    return N, P, kept


def _with_mass(M: Array, sizes: Array, terms: Array) -> tuple[Array, Array]:
    """Return bases of the motions with mass and of those without; unit vectors where possible.

    ``terms`` are sums of magnitudes of the terms of the diagonal of M.
    """
    massive = M.diagonal() > ROUND_OFF * terms
    I = np.eye(len(M))
    V1, V0 = I[:, massive], I[:, ~massive] * sizes[~massive]
    scale = 1 / np.sqrt(M.diagonal()[massive])
    values, vectors = np.linalg.eigh(M[np.ix_(massive, massive)] * np.outer(scale, scale))
    if values.min(initial=1.0) < SINGULAR:
        light = values < SINGULAR
        V0 = np.hstack([V0, V1 @ (scale[:, None] * vectors[:, light])])
        V1 = V1 @ (scale[:, None] * vectors[:, ~light])
    return V1, V0


def _damped(C: Array) -> tuple[Array, Array, Array, Array, Array]:
    """Split motions by their damping: right bases with and without, left bases, viscosities."""
    if not C.size or not C.any():
        n = len(C)
        return np.zeros((n, 0)), np.eye(n), np.zeros((n, 0)), np.eye(n), np.zeros(0)
    U, s, Vt = svd(C)
    r = int(np.sum(s > SINGULAR * s[0]))
    return Vt[:r].T, Vt[r:].T, U[:, :r], U[:, r:], s[:r]


def _least_squares(A: Array, b: Array) -> Array:
    """Return the least-squares solution of A x = b with scaled columns."""
    if not A.size:
        return np.zeros((A.shape[1], b.shape[1]))
    lengths = np.linalg.norm(A, axis=0)
    return np.asarray(lstsq(A / lengths, b, lapack_driver="gelsy")[0] / lengths[:, None])


def _free(combination: Array, motions: Array, names: Sequence[str]) -> str:
    return names[int(np.abs(motions @ combination).argmax())]


# -- checks ----------------------------------------------------------------------------------------


def require_free(small: SmallMotions, inputs: Inputs, outputs: Outputs) -> None:
    """Raise if constraints hold an output, or the motions on which an input works.

    Prescribed motions that are inputs do not hold outputs.
    """
    forces, motions = inputs.condensed.toarray(), outputs.motions.T.toarray()
    moved = inputs.prescribed[small.left].tocsr()[np.flatnonzero(small._constraint_rows)]
    fixed = np.ones(moved.shape[0], dtype=bool) if not moved.nnz else abs(moved).sum(axis=1) == 0
    by_supports = abs(outputs.motions @ inputs.motions).sum(axis=1) > 0
    free = _allowed(small, motions, fixed) | by_supports
    for name in [x for x, able in zip(outputs.motion_names, free, strict=True) if not able][:1]:
        raise ArgumentError(
            f"linearize: outputs: {name}: supports or constraints hold this motion, so that it "
            "does not change; choose another place, or one component that moves, as (..., 'u') or (..., 'force')"
        )
    works = _allowed(small, forces, fixed | True)
    for name in [x for x, able in zip(inputs.force_names, works, strict=True) if not able][:1]:
        raise ArgumentError(
            f"linearize: inputs: {name}: supports or constraints hold the motion on which it "
            "works, so that it moves nothing; choose another place or direction"
        )


def _allowed(
    small: SmallMotions, vectors: Array, chosen: npt.NDArray[np.bool_]
) -> npt.NDArray[np.bool_]:
    """Return which columns, rows of motions or forces, the ``chosen`` constraints leave free.

    A column is free if its part in the motions that the constraints allow is not round-off.
    """
    y, μ = np.flatnonzero(~small._constraint_rows), np.flatnonzero(small._constraint_rows)[chosen]
    whole = np.linalg.norm(small.lengths[:, None] * vectors, axis=0)
    W = small.lengths[small.left[y], None] * (small._Z.T @ vectors)[y]
    if len(μ) and W.size:
        G = csr_array(small.K)[μ][:, y] @ diags_array(small.lengths[small.left[y]])
        G = diags_array(1 / np.sqrt((G * G).sum(axis=1))) @ G
        system = block_array([[eye_array(len(y)), G.T], [G, None]])
        W = splu(csc_array(system)).solve(np.vstack([W, np.zeros((len(μ), W.shape[1]))]))[: len(y)]
    return np.asarray(np.linalg.norm(W, axis=0) > HELD * whole)


def require_equilibrium(small: SmallMotions, at: Solution | None) -> None:
    """Raise unless the state is an equilibrium at rest."""
    r, terms, round_off = small.imbalance()
    numbering = small.numbering
    weights = 1 / np.where(np.isin(np.arange(len(r)), numbering.rotations), small.scene.size, 1.0)
    apart = np.abs(r) * weights
    apart[apart <= UNBALANCED * np.max(terms * weights, initial=0.0)] = 0.0
    apart[np.abs(r) <= round_off] = 0.0
    worst = numbering.worst(apart)
    worst |= {f"gap of {x}": gap for x, gap in small.gaps().items() if gap > UNBALANCED}
    if worst:
        listed = ", ".join(f"{name}: {value:.3g}" for name, value in [*worst.items()][:NAMED])
        remedy = (
            "loads or motions have changed, or dampers still bear forces; give the last state of a "
            "static run of this scene in which nothing changes"
            if at is not None
            else "the undeformed scene is not in equilibrium with its loads, except inputs; give "
            "at=simulate(scene, Static(), ...)"
        )
        raise ArgumentError(f"linearize: no equilibrium; unbalanced forces (N) at {listed}: {remedy}")
    if at is None or not len(at.v):
        return
    fast = np.abs(at.v[-1]) * numbering.scales
    fast[fast <= MOVING * float(small.squares.min()) ** 0.5] = 0.0
    for name, rate in [*numbering.worst(fast).items()][:1]:
        raise ArgumentError(
            f"linearize: at moves: {name} by {rate:.3g} 1/s of the size of the scene; give a state "
            "at rest, as the last state of a static run, or of a run with more damping"
        )


def warn_of_omissions(small: SmallMotions, inputs: Sequence[Any]) -> None:
    """Warn of controllers and sliding friction, which the linear model leaves out."""
    for connector in small.scene.all_connectors:
        if isinstance(connector.law, Controller) and connector not in inputs:
            warn(f"linearize: {connector}: the force of the controller is constant")
    for group in small._simulation.equation.connector_terms:
        if isinstance(group.connectors[0].law, Coulomb):
            for connector, sticks in zip(group.connectors, group.response.sticks, strict=True):
                if not sticks:
                    warn(f"linearize: {connector}: sliding friction is left out")


# -- the function ----------------------------------------------------------------------------------


def linearize(
    scene: Scene,
    *,
    inputs: Sequence[Any],
    outputs: Sequence[Any],
    at: Solution | None = None,
    mesh: Mesh | None = None,
) -> LinearModel:
    """Linearize a scene about an equilibrium, with inputs and outputs for control or vibration.

    The equilibrium is the last state of ``at``, or the undeformed scene.  Inputs and outputs are
    changes from it.  As in :func:`modes`, all material responds elastically, hinges keep their
    openings, and sticking friction is a constraint.  Sliding friction is ignored, forces of
    controllers that are no inputs are constant, and moving masses are left out.

    Args:
        scene: Model.
        inputs: Each is a load of the scene: the change of its amplitude; a connector with a
            :class:`PrescribedForce` or :class:`Controller`: the change of its force (N, N m); a
            connector with a :class:`PrescribedMotion`: the acceleration of its motion; a support
            or ``(support, "u")``: the acceleration of one of the components "u", "v", "psi" that
            it holds, by default of each.
        outputs: Each is a tuple of the name of a method of :class:`Solution`, its argument, and
            optionally a component: ``("displacement", place)``, ``("velocity", place)``,
            ``("acceleration", place)`` with the components "u", "v", "psi";
            ``("section_forces_at", place)`` with "N", "V", "M"; ``("connector", connector)`` with
            "motion", "rate", "force"; ``("joint", joint)`` and ``("reaction", support)`` with "x",
            "y", "moment".  Without a component, each component is an output.
        at: Solution of the same beams with equal joints, which ends in equilibrium at rest.
        mesh: Discretization; by default the mesh of ``at``, or the cells of the beams.

    Raises:
        ArgumentError: The call is wrong, the state is no equilibrium, or constraints hold an
            input or output.

    Warns:
        ModelWarning: Some beams have no mass, or a controller or sliding friction is left out.

    Example:
        >>> push = ub.PointLoad(beam.end, force=(0, 1.0))
        >>> arm = ub.Scene([beam], supports=[ub.Clamped(beam.start)], loads=[push])
        >>> model = ub.linearize(
        ...     arm, inputs=[push, (arm.supports[0], "v")], outputs=[("acceleration", beam.end, "v")]
        ... )
        >>> print(model.inputs[1])
        d2v/dt2 of Clamped at beam.start (0, 0) [m/s2]
        >>> print(abs(model.frequency_response(1e-3)[0, 1]).round(6))  # as the support
        [1.]
    """
    require_state("linearize", scene, at, mesh)
    sequences = {"inputs": inputs, "outputs": outputs}
    for name, some in sequences.items():
        if not require_sequence(some, f"linearize: {name}"):
            raise ArgumentError(f"linearize: {name} is empty; give at least one")
    given, wanted = checked_inputs(scene, inputs), checked_outputs(scene, outputs)
    unit = [x for x, _ in given if isinstance(x, Load)]
    factors = {id(load): _Amplitude(load.amplitude if at else Constant(0.0)) for load in unit}
    loads = [
        replace(x, amplitude=factors[id(x)]) if id(x) in factors else x for x in scene.loads
    ]
    small = SmallMotions(replace(scene, loads=loads) if unit else scene, at, mesh=mesh)
    if not small.M.data.any():
        raise ArgumentError("linearize: nothing that can move has mass; give sections rho or rhoA")
    require_equilibrium(small, at)
    warn_of_masses(scene)
    warn_of_omissions(small, [x for x, _ in given])
    driven = Inputs(small, scene, given, factors)
    return LinearModel(small, scene, driven, Outputs(small, scene, wanted, driven))


class _Amplitude:
    """Time function of a load plus a change."""

    def __init__(self, function: Any) -> None:
        self.function, self.change = function, 0.0

    def __call__(self, t: float) -> float:
        return float(self.function(t)) + self.change

