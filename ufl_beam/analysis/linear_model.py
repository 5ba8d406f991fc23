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
from scipy.sparse import block_array, block_diag, csc_array, csr_array, diags_array, eye_array
from scipy.sparse.linalg import splu

from ufl_beam.analysis.linear_inputs_and_outputs import (
    NEGLIGIBLE,
    Inputs,
    Outputs,
    checked_inputs,
    checked_output,
    require_free,
)
from ufl_beam.analysis.modes import require_state
from ufl_beam.analysis.small_motions import SmallMotions
from ufl_beam.analysis.state_space import (
    Motion,
    constraint_forces,
    first_order,
    jumps,
    reduced_motion,
)
from ufl_beam.arrays import Array, Complex, Index
from ufl_beam.discretization.model_warnings import warn_of_masses
from ufl_beam.display import Rich, counted
from ufl_beam.errors import (
    ArgumentError,
    each_warning_once,
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
from ufl_beam.output.states import States
from ufl_beam.simulation.initial_state import StateOf
from ufl_beam.simulation.simulation import Simulation
from ufl_beam.simulation.solution import Solution
from ufl_beam.solvers.eigensolvers import ROUND_OFF

MOST_STATES = 4000  # largest number of states without modal reduction


class LinearModel(Rich):
    """Small motions about an equilibrium with inputs and outputs; made by :func:`linearize`.

    All values are changes from the equilibrium.  The equations are ``M x'' + (C + G) x' + K x = f``
    for the free motions and the forces of constraints, x.  A prescribed motion u is an input by its
    acceleration; u and u' are states.  docs/linear_models.md derives the state space.

    Attributes:
        scene: Model.
        unknowns: Place and component ("u", "v", "psi") of each unknown x, or the constraint and
            "force".  At supports with turned axes, u and v are along and across the axis.  In space
            rotations are about axes of the node, or of the support.
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
        rows = small._constraint_rows
        self._free, self._constraints = np.flatnonzero(~rows), np.flatnonzero(rows)  # rows of K
        self._reduction: tuple[Motion, Array] | None = None  # of a reduced model
        self._mode_names: list[str] = []
        require_free(small, inputs, outputs)

    def __str__(self) -> str:
        lines = [f"linear model with {self._size}", "inputs"]
        lines += [f"  {name}" for name in self.inputs]
        return "\n".join([*lines, "outputs", *(f"  {name}" for name in self.outputs)])

    def __repr__(self) -> str:
        inputs, outputs = len(self.inputs), len(self.outputs)
        both = counted((inputs, "input", "inputs"), (outputs, "output", "outputs"))
        return f"<LinearModel: {self._size}, {both}>"

    @property
    def _size(self) -> str:
        """Number of states of a reduced model, else number of unknowns."""
        if self._reduction is not None:
            return f"{len(self.states)} states"
        return counted((len(self.unknowns), "unknown", "unknowns"))

    # -- matrices ------------------------------------------------------------------------------

    @cached_property
    def unknowns(self) -> list[tuple[AttachmentPoint | Connector, str]]:
        """Place and component of each unknown."""
        numbering, scene = self._small.numbering, self.scene
        names = numbering.names
        at: list[tuple[Any, Index]] = [
            (b.middle, numbering.node(b.middle)) for b in scene.rigid_bodies
        ]
        for beam in scene.beams:
            s, inner = numbering.parameters(beam), numbering.mesh.nodes[1:-1]
            between = s[:-1, None] + inner * np.diff(s)[:, None]
            along = np.append(np.column_stack([s[:-1], between]), s[-1])
            nodes = zip(along, numbering.nodes_along(beam), strict=True)
            at += [(beam.at(float(place)), numbering.dofs[node]) for place, node in nodes]
        at += [(place, numbering.dofs[node]) for place, node in numbering.beyond.items()]
        where = {int(d): (x, c) for x, dofs in at for d, c in zip(dofs, names, strict=True)}
        connectors = zip(numbering.multipliers, scene.all_connectors, strict=True)
        where |= {int(d): (connector, "force") for d, connector in connectors}
        return [where[int(dof)] for dof in self._small.left]

    def _unscaled(self, A: csr_array) -> csr_array:
        """Undo the scaling of the rows and columns of constraints."""
        scale = diags_array(1 / self._small.scale[self._small.left])
        return csr_array(scale @ A @ scale)

    @cached_property
    def M(self) -> csr_array:
        """Mass matrix of the unknowns."""
        return self._unscaled(self._small.M)

    @cached_property
    def C(self) -> csr_array:
        """Symmetric part of the velocity-dependent forces."""
        return self._unscaled((self._damping + self._damping.T) / 2)

    @cached_property
    def G(self) -> csr_array:
        """Skew-symmetric part of the velocity-dependent forces."""
        return self._unscaled((self._damping - self._damping.T) / 2)

    @cached_property
    def K(self) -> csr_array:
        """Tangent stiffness with rows of constraints."""
        return self._unscaled(self._small.K)

    @cached_property
    def _damping(self) -> csr_array:
        """Derivative of forces with respect to velocities, without round-off of the tangent."""
        small = self._small
        rows = abs(small.K).max(axis=1).toarray().ravel()
        C = small.C.tocoo()
        i, j = C.coords
        noise = ROUND_OFF * np.sqrt(rows[i] * rows[j] / small.squares.max())
        above = np.abs(C.data) > noise
        return csr_array((C.data[above], (i[above], j[above])), shape=C.shape)

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
        if self._reduction is not None:
            A, B, C, D = self.state_space()
            return csr_array(np.eye(len(A))), csr_array(A), csr_array(B), csr_array(C), D
        small, (P0, P1, P2), (F, moved) = self._small, self._outputs.rows, self._loads
        y, μ, S, Z = self._free, self._constraints, self._inputs.motions, self._small._Z
        (n, nf), nu, ny = F.shape, S.shape[1], len(y)
        I, unity, K = eye_array(ny), eye_array(nu), small.K
        E = block_diag([I, I, csr_array((n, ny + len(μ))), unity, unity], format="csr")
        A = block_array([
            [None, I, None, None, None, None],
            [None, None, I, None, None, None],
            [-K[:, y], -self._damping[:, y], -small.M[:, y], -K[:, μ], moved[0], moved[1]],
            [None, None, None, None, None, unity],
        ])  # fmt: skip
        A.resize(E.shape)  # the rate of u' is an input
        B = block_array([
            [csr_array((2 * ny, nf)), None], [F, moved[2]], [csr_array((nu, nf)), None],
            [None, unity],
        ], format="csr")  # fmt: skip
        C = block_array([[P0 @ Z[:, y], P1 @ Z[:, y], P2 @ Z[:, y], P0 @ Z[:, μ], P0 @ S, P1 @ S]])
        order = self._inputs.order
        D = np.hstack([self._outputs.direct, (P2 @ S).toarray()])[:, order]
        return E, csr_array(A), csr_array(B[:, order]), csr_array(C), D

    # -- responses -----------------------------------------------------------------------------

    def transfer_function(self, s: npt.ArrayLike) -> Complex:
        """Return outputs for inputs ``exp(s t)``; (num_outputs, num_inputs, len(s)).

        Args:
            s: Complex exponents; 1/s.  Zero and other exponents of the model are poles.
        """
        values = np.atleast_1d(np.asarray(s, dtype=complex))
        if values.ndim != 1 or not np.isfinite(values).all():
            raise ArgumentError(f"transfer_function: s = {shorten(s)} must be finite, (n,)")
        responses = np.array([self._response(at) for at in values], dtype=complex)
        shape = len(values), len(self.outputs), len(self.inputs)
        return np.ascontiguousarray(responses.reshape(shape).transpose(1, 2, 0))

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
        """Return outputs for inputs ``exp(s t)``; (num_outputs, num_inputs)."""
        if self._reduction is not None:
            A, B, C, D = self._space
            try:
                return np.asarray(C @ np.linalg.solve(s * np.eye(len(A)) - A, B) + D)
            except np.linalg.LinAlgError:
                raise self._pole(s) from None
        small, (P0, P1, P2), S = self._small, self._outputs.rows, self._inputs.motions
        F, moved = self._loads
        nu = S.shape[1]
        if nu and s == 0:
            raise self._pole(s)
        try:
            factors = splu(csc_array(small.K + s * self._damping + s**2 * small.M))
        except RuntimeError:
            raise self._pole(s) from None
        u = 1 / s**2 if nu else 0.0
        load = np.hstack([F.toarray(), u * sum(s**k * A.toarray() for k, A in enumerate(moved))])
        X = small._Z @ factors.solve(load.astype(complex)) + np.hstack(
            [np.zeros((S.shape[0], F.shape[1])), u * S.toarray()]
        )
        Y = P0 @ X + s * (P1 @ X) + s**2 * (P2 @ X)
        Y[:, : F.shape[1]] += self._outputs.direct
        return np.asarray(Y[:, self._inputs.order])

    def _pole(self, s: complex) -> ArgumentError:
        """Return the error of a response at an exponent of the model."""
        why = "s = {:g} is an exponent of the model"
        if self._inputs.number_of_motions and s == 0:
            why = "s = 0: a prescribed motion grows without bound"
        return ArgumentError("transfer_function: " + why.format(s))

    # -- modal reduction -----------------------------------------------------------------------

    def reduced(self, n: int) -> LinearModel:
        """Return a model of the first n undamped modes; other motions respond as in statics.

        The modes are those nearest to zero frequency, rigid motions included.  Damping and
        gyroscopic forces couple them.  With an unsymmetric stiffness, as of a follower force, the
        real and imaginary parts of the first n modes of :func:`modes` are the basis.  Prescribed
        motions keep their states; the scene follows them as in statics.  The motions that are left
        out follow inputs, dampers and the inertia of the modes as in statics (mode acceleration,
        see :func:`reduced_motion`), so that the response to slow inputs is exact.  Where a damper
        makes them lag behind, as one in series with a spring or a strong one, they have further
        states of first order.

        Args:
            n: Number of modes; fewer if the scene has fewer.

        Warns:
            ModelWarning: The n modes leave out motions without stiffness on which inputs work.
        """
        n, small = require_count(n, "reduced: n"), self._small
        x, squares, others, first, names = self._modes(n)
        F, moved = self._loads
        works = np.abs(others.T @ F), np.abs(others).T @ abs(F)
        if (works[0] > NEGLIGIBLE * works[1]).any():
            warn(
                f"reduced: {n} modes leave out motions without stiffness on which inputs work, so "
                f"that slow responses are wrong; give at least {n + others.shape[1]}"
            )
        # Of real, then of imaginary parts
        omega = np.resize(np.sqrt(np.maximum(np.abs(squares), first)), x.shape[1])
        lengths = small.lengths[small.left[self._free]]
        exact = squares if small.symmetric else None
        model = copy.copy(self)
        for name in ("_motion_and_rest", "_space", "states"):
            vars(model).pop(name, None)
        model._reduction = reduced_motion(
            small.M, self._damping, small.K, F, moved, self._free, x, exact, others, omega, lengths
        )
        lags = range(len(model._motion.read) - x.shape[1])
        model._mode_names = names + [f"lag {k} of dampers" for k in lags]
        return model

    def _modes(self, n: int) -> tuple[Array, Array, Array, float, list[str]]:
        """Return n modes with unit masses, their squared frequencies (rad²/s²), and their names.

        Before the names come further motions without stiffness, and the least of the squared
        frequencies that are not zero.
        """
        small = self._small
        K, M = small.K, small.M
        if small.symmetric:
            _, x, works, zero, first = small.undamped(n, (K + K.T) / 2, definite=True)
            masses = np.sum(x * (M @ x), axis=0)
            values = np.where(zero, 0.0, works / masses)
            order = np.argsort(np.abs(values), kind="stable")
            squares, x = values[order], (x / np.sqrt(masses))[:, order]
            hertz = np.sqrt(np.abs(squares[:n])) / (2 * np.pi)
            names = [f"mode {k} ({f:.4g} Hz)" for k, f in enumerate(hertz)]
            return x[:, :n], squares[:n], x[:, n:][:, squares[n:] == 0.0], first, names
        # Real and imaginary parts of the modes, made orthogonal
        exponents, shapes = small.exponents(n)
        x = (small._axes.T @ shapes)[small.left] / small.scale[small.left, None]
        x = np.hstack([x.real, x.imag])
        masses = np.sum(x * (M @ x), axis=0)
        heavy = masses > NEGLIGIBLE * masses.max()
        x = x[:, heavy] / np.sqrt(masses[heavy])
        values, mix = np.linalg.eigh(x.T @ (M @ x))
        chosen = values > NEGLIGIBLE * values.max()
        x = x @ (mix[:, chosen] / np.sqrt(values[chosen]))
        squares = np.abs(exponents) ** 2
        moving = squares[squares > NEGLIGIBLE * small.squares.min()]
        first = float(moving.min(initial=small.squares.max()))
        names = [f"part {k} of the modes" for k in range(x.shape[1])]
        return x, squares, np.zeros((len(x), 0)), first, names

    # -- state space ---------------------------------------------------------------------------

    def state_space(self) -> tuple[Array, Array, Array, Array]:
        """Return A, B, C, D of ``w' = A w + B i``, ``y = C w + D i``; dense.

        The states are independent motions, motions of dampers without mass, velocities, then u and
        u' of prescribed motions; :attr:`states` names them.

        Raises:
            ArgumentError: The model is too large; nothing determines a motion; or an output is the
                rate of a motion without mass that follows an input at once.
        """
        A, B, C, D = (matrix.copy() for matrix in self._space)
        return A, B, C, D

    @cached_property
    def states(self) -> list[str]:
        """Names of the states of :meth:`state_space`."""
        motion, names = self._motion, self._names_of_motions

        def named(row: Array) -> str:
            """Name the motion that a row reads, or the largest one of several."""
            largest = names[int(np.abs(row).argmax())]
            return largest if np.count_nonzero(row) == 1 else f"motion with {largest}"

        prescribed = self._inputs.prescribed_names
        count = motion.states - len(motion.read) - 2 * len(prescribed)
        read = self._mode_names or [named(row) for row in motion.read]
        return [
            *read, *(f"d/dt {name}" for name in read[:count]),
            *prescribed, *(f"d/dt {name}" for name in prescribed),
        ]  # fmt: skip

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
            raise ArgumentError(
                "state: run has no state; give simulation, or simulation.snapshot()"
            )
        q = small.change_to(now)
        v = now.v[-1] if len(now.v) else np.zeros(len(q))
        read, P = self._motion.read, self._motion.P
        count = self._motion.states - len(read) - 2 * inputs.number_of_motions
        u, du = (np.asarray(inputs.read @ x) for x in (q, v))
        z, dz = ((small._axes.T @ x)[small.left[self._free]] - P @ w for x, w in ((q, u), (v, du)))
        return np.concatenate([read @ z, read[:count] @ dz, u, du])

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
        return control.ss(*self.state_space(), states=names[0], inputs=names[1], outputs=names[2])

    @property
    def _motion(self) -> Motion:
        return self._motion_and_rest[0]

    @cached_property
    def _motion_and_rest(self) -> tuple[Motion, Array]:
        """Motions, and static responses besides them with forces of constraints, at all unknowns.

        Both are functions of states and inputs.
        """
        if self._reduction is not None:
            return self._reduction
        small, y, μ = self._small, self._free, self._constraints
        if 2 * len(y) > MOST_STATES:
            raise ArgumentError(
                f"state_space: {2 * len(y)} states are too many for dense matrices; use "
                "reduced(n), or descriptor() and frequency_response(omega)"
            )
        M, C, K = (csr_array(A[y][:, y]) for A in (small.M, self._damping, small.K.tocsr()))
        F, moved = self._loads
        J, h = small.K.tocsr()[μ][:, y], moved[0][μ].toarray()
        names, sizes = self._names_of_motions, small.lengths[small.left[y]]
        motion, missed = first_order(
            M, C, K, F[y], tuple(B[y].toarray() for B in moved), J, h, sizes,
            lambda motion: names[int(np.abs(motion / sizes).argmax())],
        )  # fmt: skip
        rest = np.zeros((small.K.shape[0], missed.shape[1]))
        rest[μ] = constraint_forces(small.K.tocsr()[y][:, μ].toarray(), missed, sizes)
        return motion, rest

    @cached_property
    def _space(self) -> tuple[Array, Array, Array, Array]:
        """A, B, C and D with inputs in the order of the user."""
        inputs, out, (motion, rest) = self._inputs, self._outputs, self._motion_and_rest
        ns, Z = motion.states, self._small._Z
        X = Z[:, self._free] @ motion.y + inputs.motions @ motion.u
        dX, terms = X[:, :ns] @ motion.rates, np.abs(X[:, :ns]) @ np.abs(motion.rates)
        for rows, x, magnitudes in ((out.rows[1], X, np.abs(X)), (out.rows[2], X, np.abs(X)),
                              (out.rows[2], dX, terms)):  # fmt: skip
            for i, j in jumps(rows, x, magnitudes, ns)[:1]:
                name = self.inputs[int(np.flatnonzero(inputs.order == j)[0])]
                raise ArgumentError(
                    f"state_space: {self.outputs[i]} depends on the rate of {name}, because the "
                    "motion has no mass; give it mass, use another output, or frequency_response"
                )
        Y = out.rows[0] @ (X + Z @ rest)
        Y[:, ns : ns + out.direct.shape[1]] += out.direct
        Y += out.rows[1] @ dX + out.rows[2] @ (dX[:, :ns] @ motion.rates)
        A, B = motion.rates[:, :ns], motion.rates[:, ns:]
        return A, B[:, inputs.order], Y[:, :ns], Y[:, ns:][:, inputs.order]

    @cached_property
    def _names_of_motions(self) -> list[str]:
        return [f"{self.unknowns[i][1]} {self.unknowns[i][0]}" for i in self._free]


# -- the function ----------------------------------------------------------------------------------


@each_warning_once()
def linearize(
    scene: Scene,
    *,
    inputs: Sequence[Any],
    outputs: Sequence[Any],
    at: StateOf | None = None,
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
            it holds, by default of each; in space "u", "v", "w", and "psi" about an axis.
        outputs: Each is a tuple of the name of a method of :class:`Solution`, its argument, and
            optionally a component: ``("displacement", place)``, ``("velocity", place)``,
            ``("acceleration", place)`` with the components "u", "v", "psi";
            ``("section_forces_at", place)`` with "N", "V", "M"; ``("connector", connector)`` with
            "motion", "rate", "force"; ``("joint", joint)`` and ``("reaction", support)`` with "x",
            "y", "moment".  Without a component, each component is an output.  In space, motions
            have "u", "v", "w", reactions "x", "y", "z"; section forces and joints are no outputs.
        at: Solution of the same beams with equal joints, which ends in equilibrium at rest, or
            ``(solution, n)`` with such a state.
        mesh: Discretization; by default the mesh of ``at``, or the cells of the beams.

    Raises:
        ArgumentError: The call is wrong, the state is no equilibrium, or constraints hold an
            input or output.

    Warns:
        ModelWarning: Some beams have no mass, a controller or sliding friction is left out, a stop
            just touches, or internal variables of a law of a connector relax.

    Example:
        >>> push = ub.PointLoad(beam.end, force=(0, 1.0))
        >>> arm = ub.Scene([beam], supports=[ub.Clamped(beam.start)], loads=[push])
        >>> tip = ("acceleration", beam.end, "v")
        >>> model = ub.linearize(arm, inputs=[push, (arm.supports[0], "v")], outputs=[tip])
        >>> print(model.inputs[1])
        d2v/dt2 of Clamped at beam.start (0, 0) [m/s2]
        >>> print(abs(model.frequency_response(1e-3)[0, 1]).round(6))  # as the support
        [1.]
    """
    at = require_state("linearize", scene, at, mesh)
    sequences = {"inputs": inputs, "outputs": outputs}
    for name, some in sequences.items():
        if not require_sequence(some, f"linearize: {name}"):
            raise ArgumentError(f"linearize: {name} is empty; give at least one")
    requested = checked_inputs(scene, inputs)
    wanted = [checked_output(scene, x, f"linearize: outputs[{n}]") for n, x in enumerate(outputs)]
    unit = [x for x, _ in requested if isinstance(x, Load)]
    factors = {
        id(load): _Amplitude(load.amplitude if at is not None else Constant(0.0)) for load in unit
    }
    loads: list[Any] = [*scene.loads]
    loads = [replace(x, amplitude=factors[id(x)]) if id(x) in factors else x for x in loads]
    small = SmallMotions(replace(scene, loads=loads) if unit else scene, at, mesh=mesh)
    if not small.M.data.any():
        raise ArgumentError("linearize: nothing that can move has mass; give sections rho or rhoA")
    small.require_equilibrium(at)
    warn_of_masses(scene)
    for connector in small.scene.all_connectors:
        if isinstance(connector.law, Controller) and connector not in [x for x, _ in requested]:
            warn(f"linearize: {connector}: the force of the controller is constant")
    small.warn_of_relaxation("linearize")
    small.warn_of_limits("linearize")
    for group in small._simulation.equation.connector_terms:
        if isinstance(group.law, Coulomb) and group.sticks is not None:
            for connector, sticks in zip(group.connectors, group.sticks, strict=True):
                if not sticks:
                    warn(f"linearize: {connector}: sliding friction is left out")
    model_inputs = Inputs(small, scene, requested, factors)
    return LinearModel(small, scene, model_inputs, Outputs(small, scene, wanted, model_inputs))


class _Amplitude:
    """Time function of a load plus a change."""

    def __init__(self, function: Any) -> None:
        self.function, self.change = function, 0.0

    def __call__(self, t: float) -> float:
        return float(self.function(t)) + self.change
