# SPDX-License-Identifier: MIT
"""Linearized equations about a state: mass, damping and stiffness matrices of small motions."""

from __future__ import annotations

import math
import warnings
from collections.abc import Callable
from dataclasses import replace
from functools import cached_property

from mpi4py import MPI

import numpy as np
from scipy.sparse import block_array, csr_array, diags_array, eye_array
from scipy.sparse.csgraph import structural_rank
from scipy.sparse.linalg import splu

from ufl_beam.arrays import Array
from ufl_beam.blocks.beams import section_law
from ufl_beam.compiled.c_library import lib
from ufl_beam.compiled.csr import Csr
from ufl_beam.discretization.cell_functions import mass_forces, stress_forces
from ufl_beam.discretization.cells_in_space import (
    STIFFNESS_IN_SPACE,
    TURNS,
    CellsOfState,
    cell_axes,
    rotation_vectors,
    rotations_between,
    turned_further,
    turns_at,
)
from ufl_beam.discretization.dof_numbering import DofNumbering
from ufl_beam.discretization.function_spaces import Fields
from ufl_beam.discretization.model_warnings import warn_of_touching, warn_of_warping
from ufl_beam.discretization.partition import Subdomain
from ufl_beam.errors import ArgumentError, ModelWarning, each_warning_once, warn
from ufl_beam.mechanics.time_scheme import Coefficients, Step
from ufl_beam.mechanics.time_schemes import Newmark
from ufl_beam.model.beams import Mesh
from ufl_beam.model.connector_law import ConnectorLaw, ForceLaw
from ufl_beam.model.connectors import Connector
from ufl_beam.model.constraint_checks import warn_of_held_motions
from ufl_beam.model.functions import value_at
from ufl_beam.model.loads import MovingLoad
from ufl_beam.model.scene import Scene
from ufl_beam.output.states import States
from ufl_beam.simulation.simulation import Simulation
from ufl_beam.simulation.solution import Solution
from ufl_beam.terms.cell_forces import CellForces
from ufl_beam.terms.term import InCells

BALANCED = 1e-13  # forces below this fraction of the stiffness times the scene's size are round-off
CHANGE = 1e-6  # change for difference quotients; rad, or fraction of the size of the scene
SLOWER = 10.0  # ratio of two steps in which forces of laws are compared
RELAXES = 1e-6  # difference of viscosities from two steps that is not round-off, as a fraction
KINK = 1e-3  # difference of stiffnesses beside a motion that is a kink, as a fraction
UNBALANCED = 1e-6  # unbalanced force that is an error, as a fraction of the largest force
MOVING = 1e-6  # velocity that is an error, as a fraction of lowest frequency times size
NAMED = 3  # largest number of names in a message
AT_REST = 1e150  # time step after which rates vanish; its square does not overflow; s


class _Standstill(Newmark):
    """Scheme of small motions, whose terms are evaluated at the present state."""

    has_mean_velocity = True
    accelerations_oscillate = False
    further_rates: tuple[str, ...] = ()  # type: ignore[assignment]

    def coefficients(self, dt: float, last_dt: float, known: int) -> Coefficients:
        own = super().coefficients(dt, last_dt, known)
        return Coefficients(own.inertia, (1 / dt, 0.0, 0.0), own.rates[:1])


class _StandstillInSpace(_Standstill):
    """The same for motions whose changes of rotations are Cayley vectors; momenta do not turn."""

    half_tangents = True

    def coefficients(self, dt: float, last_dt: float, known: int) -> Coefficients:
        own = super().coefficients(dt, last_dt, known)
        return own._replace(rates=[own.velocity])


class Linearization:
    """Matrices of small motions about a state, without degrees of freedom constrained by supports.

    The state is the last state of ``at``, by default the undeformed scene.  Loads are evaluated at
    the time ``t`` (s), by default the time of the state.  Masses of moving loads are left out.

    Attributes:
        tangent: Derivative of forces with respect to all unknowns; (size, size).
        masses: Masses of all unknowns; (size, size).
        turns: Column of the state with the rotations in space, see :data:`TURNS`; (nodes, 4).
        K, M, C: Stiffness, mass and damping of free motions and scaled forces of constraints.
        left: Degrees of freedom of the rows of K, in the axes of supports.
        scale: Factors of the unknowns of K; (size,).
        most: Largest number of modes.
    """

    def __init__(
        self, scene: Scene, at: Solution | None, t: float | None = None, mesh: Mesh | None = None
    ) -> None:
        time = 0.0 if at is None else float(at.times[-1])
        if any(isinstance(load, MovingLoad) and load.mass for load in scene.loads):
            loads = [replace(x, mass=0.0) if isinstance(x, MovingLoad) else x for x in scene.loads]
            scene = replace(scene, loads=loads)
        # All processes compute all matrices, so that no result depends on their number.
        with warnings.catch_warnings(), each_warning_once(anew=True):
            warnings.simplefilter("ignore", ModelWarning)  # these warnings concern runs
            scheme = _StandstillInSpace() if scene.in_space else _Standstill()
            simulation = Simulation(scene, scheme, t0=time, start=at, mesh=mesh, comm=MPI.COMM_SELF)
        warn_of_touching(simulation.numbering)
        warn_of_warping(scene)
        warn_of_held_motions(scene)
        if t is not None:
            simulation.t = t
        self.scene, self._simulation = scene, simulation
        self.beams, self.numbering, self.q = simulation.beams, simulation.numbering, simulation.q
        self.turns: Array = np.zeros((0, 4))
        if scene.in_space:
            self.turns = simulation.now.column(TURNS)[0,].copy()
        simulation.solver.destroy()  # not closed: functions of a user are called below
        # Plastic strains and openings of hinges are constant from now on.
        simulation.controllers.evaluate(simulation)
        for cells in simulation.inelastic:
            cells.points.freeze()
        for group in simulation.connector_terms:
            group.freeze()
        Q = eye_array(self.numbering.size, format="lil")
        for support in (support for support in scene.supports if support.turns):
            dofs = self.numbering.node(support.place)
            Q[np.ix_(dofs, dofs)] = support.axes.T
        self._axes = csr_array(Q)  # columns: unit motions along the axes of supports
        _, T = self._linearized(self.q)
        multipliers = self.numbering.multipliers
        about_forces = T.diagonal()[multipliers] != 0.0
        self._laws, constraints = multipliers[about_forces], multipliers[~about_forces]
        left = np.ones(self.numbering.size, dtype=bool)
        left[simulation.supports.dofs] = left[self._laws] = False
        scale = np.ones(self.numbering.size)
        scale[constraints] = abs(T.data).max()  # rows of constraints become as large as stiffnesses
        self.left, self.scale = np.flatnonzero(left), scale
        # Columns: unit motions that supports allow, and unit forces of constraints.
        self._Z = (self._axes @ diags_array(scale, format="csr"))[:, self.left]
        masses = self._matrix(simulation.inertia.M.data)
        self.tangent, self.masses = T, masses  # of all degrees of freedom
        self.K, self.M = self._reduced(T), self._reduced(masses)
        # Number of modes: a constraint removes its force and one motion; a mode needs mass.  A
        # constraint between motions without mass, as of a hinge, removes one of these.
        massless = self.M.diagonal() == 0.0
        self._constraint_rows = rows = np.isin(self.left, constraints)
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

    def _condensed(self, T: csr_array) -> csr_array:
        """Eliminate forces that follow from force laws; their rows and columns become zero."""
        laws = self._laws
        if len(laws):
            flexibility = diags_array(1 / (T.diagonal()[laws] + (T.diagonal()[laws] == 0.0)))
            T = T - T[:, laws] @ flexibility @ T[laws, :]
        return T

    def _reduced(self, T: csr_array) -> csr_array:
        """Reduce a matrix to columns of ``_Z``; eliminate forces that follow from force laws."""
        return csr_array(self._Z.T @ self._condensed(T) @ self._Z)

    @cached_property
    def squares(self) -> Array:
        """Squared frequencies of single degrees of freedom with mass and stiffness; rad²/s²."""
        heavy = (self.M.diagonal() > 0) & (self.K.diagonal() != 0)
        squares = np.abs(self.K.diagonal()[heavy]) / self.M.diagonal()[heavy]
        return np.asarray(squares if heavy.any() else np.ones(1))

    @cached_property
    def _in_short_step(self) -> tuple[float, csr_array]:
        """Shortest period over 2π, and the tangent in a step of this length; s."""
        τ = float(self.squares.max()) ** -0.5
        return τ, self._linearized(self.q, τ)[1]

    @cached_property
    def C(self) -> csr_array:
        """Derivative of forces with respect to velocities, reduced as K."""
        τ, T = self._in_short_step
        return (self._reduced(T) - self.K) * τ

    def warn_of_relaxation(self, call: str) -> None:
        """Warn of laws whose internal variables change in time, which have no matrix of damping.

        Their forces depend on the step in another way than by a viscosity.
        """
        τ, viscosities, laws = self._in_short_step[0], list[Array](), self._laws
        if not len(laws):
            return
        largest = np.zeros(len(laws))
        for factor in (1.0, SLOWER):
            forces = []
            for T in (self.tangent, self._linearized(self.q, factor * τ)[1]):
                rows = T[laws].tolil()
                rows[:, laws] = 0.0
                forces.append(csr_array(rows / T.diagonal()[laws][:, None]))
                largest = np.maximum(largest, abs(forces[-1]).max(axis=1).toarray().ravel())
            viscosities.append((forces[1] - forces[0]) * factor)
        apart, size = (
            abs(A).max(axis=1).toarray().ravel()
            for A in (viscosities[1] - viscosities[0], abs(viscosities[0]) + abs(viscosities[1]))
        )
        where = dict(zip(self.numbering.multipliers, self.scene.all_connectors, strict=True))
        for law in laws[apart > RELAXES * np.maximum(size, largest)]:
            warn(
                f"{call}: {where[law]}: the force of the law changes in time while the motion is "
                "constant, or depends on the length of a step; stiffness and viscosity cannot "
                "describe this, so that results are wrong. Replace the law by springs and dampers, "
                "with a body without mass between those in series"
            )

    def warn_of_limits(self, call: str) -> None:
        """Warn of connectors whose stiffness differs on both sides of their motion in the state."""
        T, multipliers, found = self.tangent.tocsc(), self.numbering.multipliers, list[Connector]()
        for group in self._simulation.connector_terms:
            for i, connector in enumerate(group.connectors):
                if not isinstance(connector.law, ConnectorLaw | ForceLaw):
                    break
                along = T[:, [group.forces_at[i]]].toarray()[:, 0] * self.lengths
                along[multipliers] = 0.0
                step = CHANGE * self.lengths[self._motion_of(connector)]
                apart = step * along * self.lengths / max(along @ along, 1e-300)
                around = [self.q + part * apart for part in (0.0, -1.0, 1.0, -0.5, 0.5)]
                slopes = np.array([group.slopes(q)[i] for q in around])
                jumps, inner = np.abs(slopes[1:] - slopes[0]).max(axis=-1).reshape(2, 2)
                # A slope that varies smoothly changes by half as much in half the distance.
                if ((jumps > KINK * np.abs(slopes).max()) & (inner > 0.6 * jumps)).any():
                    found.append(connector)
        if found:
            names = ", ".join(map(str, found[:NAMED])) + ", ..." * (len(found) > NAMED)
            warn(
                f"{call}: {names}: the motion of the state is at a limit, beside which the "
                "stiffness differs, as of a stop that just touches, which counts as open. Give "
                "at=, a state under loads or a preload that close or open it"
            )

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
        """Return forces and moments of supports in modes of given frequencies (rad/s).

        They are T x - ω² M x, along the axes of the scene; (num_supports, 3 or 6, n).
        """
        forces = self.condensed_tangent @ shapes - self.masses @ shapes * omega**2
        places = [support.place for support in self.scene.supports]
        nodes = np.reshape([self.numbering.node(x) for x in places], (-1, self.numbering.width))
        found = np.asarray(forces[nodes])
        for k, place in enumerate(places if self.scene.in_space else ()):
            turn = turns_at(self.numbering, place, self.turns[None]).as_matrix()[0]
            found[k, 3:] = turn @ found[k, 3:]  # moments are about axes of the node
        return found

    # -- forces of the state -------------------------------------------------------------------

    @cached_property
    def damping(self) -> csr_array:
        """Derivative of forces with respect to velocities of all unknowns; (size, size)."""
        τ, T = self._in_short_step
        return csr_array((T - self.tangent) * τ)

    @cached_property
    def condensed_tangent(self) -> csr_array:
        """Derivative of forces of all unknowns, without forces that follow from force laws."""
        return self._condensed(self.tangent)

    @cached_property
    def condensed_damping(self) -> csr_array:
        """Derivative with respect to velocities, without forces that follow from force laws."""
        τ, T = self._in_short_step
        return csr_array((self._condensed(T) - self.condensed_tangent) * τ)

    @property
    def lengths(self) -> Array:
        """Size of the scene for displacements, 1 for rotations and forces; (size,)."""
        scales = self.numbering.scales
        return np.divide(1.0, scales, out=np.ones(len(scales)), where=scales > 0)

    def require_equilibrium(self, at: Solution | None) -> None:
        """Raise unless the state, the last one of ``at``, is an equilibrium at rest."""
        numbering, laws, T = self.numbering, self._laws, self.tangent
        forces_and_gaps, _ = self._linearized(self.q)
        terms = np.zeros(numbering.size)  # sums of magnitudes
        for term in self._simulation.equation.terms:
            if term.kind != "inertia":
                forces = np.zeros(numbering.size)
                term.add_residual(self.q, forces)
                terms += np.abs(forces)
        borne = T[:, laws] @ (forces_and_gaps[laws] / T.diagonal()[laws])
        r = self._axes.T @ (forces_and_gaps - borne)
        held = self._simulation.supports.dofs, numbering.multipliers
        r[held[0]] = r[held[1]] = terms[held[1]] = 0.0
        weights = np.ones(len(r))
        weights[numbering.rotations] = 1 / self.scene.size
        apart = np.abs(r) * weights
        apart[apart <= UNBALANCED * np.max(terms * weights, initial=0.0)] = 0.0
        apart[np.abs(r) <= self._round_off] = 0.0
        worst = numbering.worst(apart)
        gaps = self._gaps(forces_and_gaps)
        worst |= {f"gap of {x}": gap for x, gap in gaps.items() if gap > UNBALANCED}
        if worst:
            listed = ", ".join(f"{name}: {value:.3g}" for name, value in [*worst.items()][:NAMED])
            remedy = (
                "loads or motions have changed, or dampers still bear forces; give the last state "
                "of a static run of this scene in which nothing changes"
                if at is not None
                else "the undeformed scene is not in equilibrium with its loads, except inputs; "
                "give at=simulate(scene, Static(), ...)"
            )
            raise ArgumentError(
                f"linearize: no equilibrium; unbalanced forces (N) at {listed}: {remedy}"
            )
        if at is None or not len(at.v):
            return
        fast = np.abs(at.v[-1]) * numbering.scales
        fast[fast <= MOVING * float(self.squares.min()) ** 0.5] = 0.0
        for name, rate in [*numbering.worst(fast).items()][:1]:
            raise ArgumentError(
                f"linearize: at moves: {name} by {rate:.3g} 1/s of the size of the scene; give a "
                "state at rest, as the last state of a static run, or of a run with more damping"
            )

    @property
    def _round_off(self) -> Array:
        """Forces at unknowns that are round-off; (size,); N, N m."""
        sizes = abs(self.tangent).max(axis=1).toarray().ravel()
        return np.asarray(BALANCED * self.scene.size * sizes)

    def _gaps(self, r: Array) -> dict[str, float]:
        """Return gaps of constraints and prescribed motions by name; rad or size of the scene."""
        gaps, q, t = dict[str, float](), self.q.copy(), self._simulation.t
        if self.scene.in_space:
            self._set_rotations(q, rotation_vectors(self.turns))
        connectors = zip(self.scene.all_connectors, self.numbering.multipliers, strict=True)
        for connector, force in connectors:
            if force not in self._laws:
                gap = abs(r[force]) / self.lengths[self._motion_of(connector)]
                gaps[str(connector)] = max(float(gap), gaps.get(str(connector), 0.0))
        at = self._axes.T @ q
        for support in self.scene.supports:
            for component, motion in support.held.items():
                dof = self.numbering.node(support.place)[component]
                gap = at[dof] - value_at(motion, t, support)
                if component > 2:  # in space rotations are known up to full turns
                    gap = math.remainder(gap, 2 * math.pi)
                gap = abs(gap) / self.lengths[dof]
                gaps[str(support)] = max(float(gap), gaps.get(str(support), 0.0))
        return gaps

    def change_to(self, now: States) -> Array:
        """Return the motion from the state to the last of some states; (size,)."""
        q: Array = now.q[-1] - self.q
        if self.scene.in_space:
            self._set_rotations(q, rotations_between(self.turns, now.turns(-1)))
        return q

    def _set_rotations(self, q: Array, rotations: Array) -> None:
        dofs = np.vstack([self.numbering.dofs, self.numbering.dofs_of_bodies])[: len(rotations)]
        q[dofs[:, 3:]] = rotations

    def _motion_of(self, connector: Connector) -> int:
        """Return a degree of freedom with the unit of the motion of a connector."""
        first = self.numbering.displacements if connector.is_rotation else 0
        return int(self.numbering.node(connector.b)[first])

    def forces(self) -> tuple[Array, Array]:
        """Return all forces except inertia, (size,), and those on the ends of cells.

        The latter are ordered as ``cell_number`` of loops.h; (9, num_cells).
        """
        residual, _ = self._linearized(self.q)
        cells = self._simulation.equation.cell_forces
        if self.scene.in_space:  # section forces are no outputs there
            return residual, np.zeros((9, len(self.numbering.cells)))
        cells.accept()
        return residual, cells(self.q, self.q)

    def changes_of_cells(self, dof: int) -> tuple[Array, Array, Array]:
        """Return derivatives of forces on cells by a motion, its rate and acceleration; (9, n).

        Stress and inertia are linearized exactly; damping, loads and works of cells by differences.
        """
        unit, still = np.zeros((2, self.numbering.size))
        unit[dof] = 1.0
        by_motion = self._linear_in_cells(unit, still)
        by_acceleration = self._linear_in_cells(still, unit)
        by_rate = np.zeros_like(by_motion)
        if self._others_in_cells is not None:
            change, (τ, _) = CHANGE * self.lengths[dof], self._in_short_step
            derivatives = []
            for dt in (AT_REST, τ):
                ends = []
                for sign in (1.0, -1.0):
                    q = self.q + sign * change * unit
                    self._linearized(q, dt)
                    self._others_in_cells.accept()
                    ends.append(self._others_in_cells(q, self.q))
                derivatives.append((ends[0] - ends[1]) / (2 * change))
            by_motion = by_motion + derivatives[0]
            by_rate = τ * (derivatives[1] - derivatives[0])
        return by_motion, by_rate, by_acceleration

    @cached_property
    def _linear_in_cells(self) -> Callable[[Array, Array], Array]:
        law = section_law(self.beams, self.numbering)
        return linear_forces_of_cells(self.numbering, self.q, law)

    @cached_property
    def _others_in_cells(self) -> CellForces | None:
        """Forces on cells besides stress, inertia and dead loads; None if there are none."""
        terms = self._simulation.equation.terms
        terms = [term for term in terms if term.kind not in ("beams", "inertia")]
        others = [forces for term in terms for forces in term.in_cells]
        return CellForces(self._simulation.subdomain, others) if others else None

    def unbalanced(self) -> str:
        """Return a warning of works, connectors, supports that disturb the equilibrium, or ""."""
        t, (r, _) = self._simulation.t, self._linearized(self.q)
        apart = np.abs(self._axes.T @ r) > self._round_off
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

    def linear_change(self, call: str) -> tuple[Array, Callable[[Array], Array]]:
        """Compute the linear change of the configuration due to loads and prescribed motions.

        ``call`` is the caller in messages.  The function returns the change by residuals (N).
        """
        simulation, supports = self._simulation, self._simulation.supports
        (r, T), Q = self._linearized(self.q), self._axes
        before = supports.in_axes(self.q)
        after = before.copy()
        supports.move(after, before, Step(0.0, 1.0, self.q, simulation.t, simulation.t, 1.0))
        g = Q @ (after - before)
        Z = Q[:, np.setdiff1d(np.arange(len(g)), supports.dofs)]
        rest = r + T @ g
        if not (Z.T @ rest).any():
            raise ArgumentError(
                f"{call}: nothing acts on the scene at t = {simulation.t:g} s that does not act "
                "in the initial state; give the scene loads, or another t"
            )
        try:
            factors = splu((Z.T @ T @ Z).tocsc())
        except RuntimeError:
            raise ArgumentError(f"{call}: the scene is free to move in its state") from None

        def change(residual: Array) -> Array:
            return np.asarray(-(Z @ factors.solve(Z.T @ residual)))

        return g + change(rest), change


def linear_forces_of_cells(
    numbering: DofNumbering, q: Array, section_law: tuple[Array, Array]
) -> Callable[[Array, Array], Array]:
    """Return a function of a small motion from ``q``, and of its acceleration; (size,) each.

    The function computes the forces of stress and inertia on the ends of cells, ``cell_number`` of
    loops.h; (9, num_cells).  For ``section_law`` see :class:`Shapes`.
    """
    subdomain = Subdomain(numbering, MPI.COMM_SELF)
    fields, space = Fields(subdomain), np.zeros(subdomain.size)
    stress, inertia = stress_forces(fields, section_law, about=q), mass_forces(fields)
    both = (lambda: stress, lib.STRESS), (lambda: inertia, lib.DENSITY)
    cells = CellForces(subdomain, [InCells(*form, fields.order) for form in both])

    def forces(x: Array, acceleration: Array) -> Array:
        stress.add(x, space)
        inertia.add(acceleration, space)
        cells.accept()
        return cells(x, x)

    return forces


def linear_forces_in_space(
    numbering: DofNumbering, q: Array, turns: Array, given: Array | None
) -> Callable[[Array, Array], Array]:
    """Return a function of a small motion, and of its acceleration; (size,) each.

    The state has the rotations ``turns``, and the section forces ``given`` in the middle of cells
    (num_cells, 6); without ``given`` they follow from elastic strains.  The function computes
    changes of the section forces at the start, in the middle and at the end of cells, with inertial
    forces on their nodes, in axes of the sections of the state; (num_cells, 3, 6).
    """
    fields, fractions = Fields(Subdomain(numbering, MPI.COMM_SELF)), np.array([0.0, 0.5, 1.0])
    axes, stiffness = cell_axes(fields), fields.section_values(*STIFFNESS_IN_SPACE)
    state = CellsOfState.of(numbering, axes, q, turns)
    strains = state.strains()
    resultants = stiffness * strains if given is None else given
    shares = np.array([[2.0, 1.0], [1.0, 2.0]]) / 6
    masses = fields.section_values("rhoA")[:, :, None] * state.lengths[:, None, None] * shares
    dofs = numbering.dofs[numbering.cells][:, :, :3]

    def forces(x: Array, acceleration: Array) -> Array:
        ε, ends = 10 * CHANGE / (np.abs(x * numbering.scales).max() or 1.0), []
        for part in (ε, -ε):
            further = turned_further(numbering, turns, part * x)
            cells = CellsOfState.of(numbering, axes, q + part * x, further)
            changed = resultants + stiffness * (cells.strains() - strains)
            along = -part * masses @ acceleration[dofs]
            ends.append(cells.section_forces(fractions, changed, along, in_scene=True))
        change = (ends[0] - ends[1]) / (2 * ε)
        found = [state.in_section(s, *np.hsplit(change[:, k], 2)) for k, s in enumerate(fractions)]
        return np.stack(found, axis=1)

    return forces
