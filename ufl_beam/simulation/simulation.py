# SPDX-License-Identifier: MIT
"""From a scene to its motion: build what the scene requires, then step through time."""

from __future__ import annotations

import math
import warnings
from collections.abc import Callable
from functools import partial
from typing import NamedTuple, NoReturn

from mpi4py import MPI

import numpy as np

from ufl_beam.arrays import Array
from ufl_beam.collective_errors import Agreement
from ufl_beam.compiled.c_library import extrapolated
from ufl_beam.compiled.csr import Csr, Product, as_slice
from ufl_beam.discretization.dof_numbering import Grid, Share
from ufl_beam.discretization.function_spaces import Fields
from ufl_beam.discretization.model_warnings import (
    warn_of_far_points,
    warn_of_free_hinges,
    warn_of_jumps,
    warn_of_masses,
    warn_of_origin,
    warn_of_touching,
)
from ufl_beam.discretization.state_io import NOWHERE, Memory, Restoring, Saving, State
from ufl_beam.errors import (
    ConvergenceError,
    ModelWarning,
    SceneError,
    StepFailed,
    require_kind,
    require_number,
    shorten,
)
from ufl_beam.mechanics.time_schemes import Scheme, Step, has_inertia
from ufl_beam.model.connector_laws import Controller, Coulomb
from ufl_beam.model.connectors import Connector
from ufl_beam.model.constraint_checks import (
    friction_repeats,
    no_number,
    require_independent,
    require_inertia,
    require_masses,
    require_no_mechanism,
)
from ufl_beam.model.loads import FollowerLoad, RotatingFrame
from ufl_beam.model.mesh_options import Mesh
from ufl_beam.model.scene import Scene
from ufl_beam.output.state_view import StateView
from ufl_beam.parallel import communicator, give_back_memory
from ufl_beam.parameter import Parameter
from ufl_beam.simulation.branch_check import StaticPath
from ufl_beam.simulation.initial_state import initial_state, mesh_of
from ufl_beam.simulation.replicas import Copies
from ufl_beam.simulation.singularity import singularity
from ufl_beam.simulation.solution import Solution
from ufl_beam.solvers.c_equation import Equation
from ufl_beam.solvers.newton import Border, Newton, Solver
from ufl_beam.terms.algorithmic_damping import numerical_forces
from ufl_beam.terms.beams import KINDS, Beams, Cells, ElasticBeams, Inertia, Term
from ufl_beam.terms.connector_laws import Setting
from ufl_beam.terms.connectors import Couplings, couplings
from ufl_beam.terms.damping import damping_forces
from ufl_beam.terms.energy_ledger import Ledger
from ufl_beam.terms.inelastic_beams import InelasticBeams, inelastic_cells
from ufl_beam.terms.loads import DeadLoads, FollowerLoads
from ufl_beam.terms.material_points import Course, expect_entries
from ufl_beam.terms.openings import Openable, Openings
from ufl_beam.terms.rotating_frame import FrameForces
from ufl_beam.terms.supports import Supports

SMALLEST_PART = 2**12
"""A step is cut into at most this number of parts."""

SMALLEST_SHARE = 6_000
"""Scenes with fewer cells per process are computed by each process.

Measured on two cores with lattices: two processes break even at some 3 000 cells each, and are 1.2
times as fast at 6 000; see benchmarks/README.md.
"""

LARGEST_TURN = 0.75 * math.pi
"""A step that turns a node further is cut; the algorithmic strains end at π."""

APPLYING = 1 / 8
"""Part of the first step in which loads that are there from the start are applied."""

APPLYING_TURN = 0.02
"""Largest turn of a node meanwhile in a part; rad.

Over a part a moment is in error by a quarter of the square: some 1e-4 of it.
"""

SHORT_PART = 512
"""So many times shorter parts may turn nodes further: their oscillations do not become smaller."""

LEAST_AT_REST, LEAST_IN_MOTION = 2, 1
"""Iterations at least in statics and dynamics, unless a residual is far below its tolerance.

A column that nearly buckles magnifies a load that is hardly larger than the tolerance.  In motion
its inertia holds it meanwhile.
"""

ROOM = 10.0
"""Largest imbalance of an exact ledger over the tolerance of the solver."""

FIRST = 1 / 16
"""Part of the first step after which accelerations are taken for those at the beginning.

Shorter ones are nearer to it, but magnify the velocities of supports that do not begin with theirs.
"""


class Trial(NamedTuple):
    """A step that was solved but not yet accepted.

    Attributes:
        step: Its times.
        q1: Configuration at its end, local degrees of freedom.
        s: What forces work on, see :meth:`Scheme.nodal_step`; in dynamics the mean velocity of the
            step times its length.
    """

    step: Step
    q1: Array
    s: Array


class Simulation(StateView):
    """Time stepper of a scene: its present state and the step to the next.

    :func:`simulate` is a loop over :meth:`step_to`; use this class for loops of your own.

    Args:
        scene: What is modelled.
        scheme: :class:`Static`, :class:`Midpoint` or another one, see docs/schemes.md.
        t0: Time of the initial state; s.
        start: Solution of the same beams whose last state is the initial state.  Joints may be
            removed, or added where places are together.
        newton: Tolerances and PETSc options.
        mesh: How finely it is discretised; as ``start``, or with the cells of the beams.
        comm: Processes that share the scene; all of them, or in a :func:`study` this one alone.

    Attributes:
        t: Time; s.
        q: Configuration at the local degrees of freedom.
        ledger: Energies of this process.
        solution: The motion so far.
        parts: Number of parts that steps were cut into, those not cut included.
        together: Calls that raise on all processes of a shared scene what they raise on one.
        last_dt: Length of the last accepted step; s.

    Example:
        >>> simulation = ub.Simulation(scene, ub.Midpoint())
        >>> while simulation.t < 1:
        ...     simulation.step_to(simulation.t + 0.05)
        >>> print((1e3 * simulation.displacement(beam.end)).round(1))  # mm, mm, mrad
        [ -0.1 -18.9 -14.3]
        >>> simulation.close()
    """

    def __init__(
        self,
        scene: Scene,
        scheme: Scheme,
        *,
        t0: float = 0.0,
        start: Solution | None = None,
        newton: Newton | None = None,
        mesh: Mesh | None = None,
        comm: MPI.Intracomm | None = None,
    ) -> None:
        comm = communicator(comm, "comm")
        require_kind(scene, Scene, "scene")
        if not isinstance(scheme, Scheme) or isinstance(scheme, type):
            raise SceneError(
                f"scheme = {shorten(scheme)} must be a scheme, such as Static() or Midpoint()"
            )
        require_number(t0, "t0")
        newton = Newton() if newton is None else newton
        require_kind(newton, Newton, "newton")
        if has_inertia(scheme):
            require_masses(scene)
            require_inertia(scene)
            warn_of_masses(scene)
            if scene.initial:
                warn_of_origin(scene)
            scheme.require(scene)
        else:
            require_no_mechanism(scene)
        require_independent(scene)
        self.scene, self.scheme, self.comm = scene, scheme, comm
        warn_of_far_points(scene)
        warn_of_free_hinges(scene)
        self.grid = Grid(scene, mesh_of(start, mesh))
        if has_inertia(scheme):
            warn_of_touching(self.grid)
        together = len(self.grid.cells) >= comm.size * SMALLEST_SHARE
        self.share = Share(self.grid, comm if together else MPI.COMM_SELF)
        self.together = Agreement(self.share.comm)
        self._copies = None if together or comm.size == 1 else Copies(comm, self._scales())
        q, v, internal = initial_state(self.grid, start)
        self.fields = Fields(self.share)
        self._A = self.fields.matrix()
        self.t = t0
        self.q: Array = q[self.share.dofs]
        self.ledger = Ledger()
        self.parts = 0

        self.beams: list[Cells] = []
        self.inelastic: list[InelasticBeams] = []
        self._numerical: list[Term] = []
        self._make_beams()
        self.force = np.zeros(self.share.size)
        self._asking = [
            (link, link.law) for link in scene.links if isinstance(link.law, Controller | Coulomb)
        ]
        self.asked: dict[Connector, float] = dict.fromkeys((link for link, _ in self._asking), 0.0)
        self._sliding = dict.fromkeys(self.asked, 0.0)
        setting = Setting(
            self.asked, self._sliding, scene.size, scheme, self.ledger, friction_repeats(scene),
            self._course,
        )  # fmt: skip
        self.couplings = self.together(couplings, self.share, setting, self._A)
        self._openings = Openings.of(self._course, self._openable(), self.share.comm)
        self.loads = self._make_loads()
        self._others: list[Term] = [*self.loads, *self._numerical]
        if has_inertia(scheme):
            v = v[self.share.dofs]
            self.inertia = Inertia(self.fields, scheme, self._A, self.ledger, v)
            self._others.append(self.inertia)
        for damping in scene.damping:
            inertia = self.inertia if scheme.dynamic else None
            setting_of = (self.fields, scheme, self._A, self.ledger, inertia)
            self._others += damping_forces(damping, *setting_of)
        self._inner: list[Beams] = [*self.beams, *self.couplings]
        self.terms: list[Term] = [*self._inner, *self._others]
        self.supports = Supports(self.share, scheme, self.ledger, self._A)
        if has_inertia(scheme):
            self.supports.stop(self.inertia.v)
        loaded: list[Array] = []
        if start is not None or (has_inertia(scheme) and scheme.kept):
            loaded = self.together(self._carry_on)
        if start is not None:
            memory = Restoring(self.share, internal)
            for one in (*self.inelastic, *self.couplings):
                one.remember(memory, NOWHERE)
            if "reactions" in internal:
                self.supports.carry_on(memory, self.q)
            if has_inertia(scheme) and start.scene is scene and start.times[-1] == t0:
                # No force has changed since: accelerations are still what they were.
                known = sum(name in internal for name in scheme.kept)
                self.inertia.carry_on(memory, known)
        self._q_before: Array = self.q
        self.last_dt: float = math.inf
        self._rubbing = [
            one
            for one in self.couplings
            if isinstance(one, Couplings) and isinstance(one.links[0].law, Coulomb)
        ]
        self._rotations = self.share.rotations()
        self._multipliers = as_slice(self.share.multipliers())
        for term in self.terms:
            term.add_state(self.q)
        if has_inertia(scheme) and (scene.links or scene.supports):
            motions = self.connections()[:, 0]
            self.together(warn_of_jumps, self.grid, t0, q, motions)
        self._continues = start is not None
        self._path: StaticPath | None = None
        if not scheme.dynamic:
            parts = (self.beams, self.couplings)
            path = (self.share, scheme, *parts, self.ledger, self.q, t0)
            self._path = self.together(StaticPath, *path)
            self._bear(self._path, loaded)
        equation = None
        if self.share.comm.size == 1 and not self.supports.turned:
            terms = (self.beams, self.couplings, self._others)
            equation = Equation(self._A, *terms, self.supports, self.force)
        self._solver = Solver(
            self.share,
            self._A,
            equation=equation,
            residual=self._residual,
            complete=self.supports.hold,
            tangent=self._tangent,
            forces=self.force,
            excess=self._excess,
            relieve=self._relieve,
            working=self._working,
            held=self.supports.dofs,
            newton=newton,
            least=LEAST_IN_MOTION if scheme.dynamic else LEAST_AT_REST,
            agreement=self.together,
        )
        self.solution: Solution = Solution(scene, self.grid)
        give_back_memory()

    def _scales(self) -> Array:
        """Return the weights of displacements, rotations and forces; 1/m, 1, zero."""
        scales: Array = np.full(self.share.size, 1 / self.scene.size)
        scales[self.share.rotations()] = 1.0
        scales[self.share.multipliers()] = 0.0
        return scales

    # -- building ------------------------------------------------------------------------------

    def _make_beams(self) -> None:
        """Beams of the cells of this process: elastic ones, and those with material points."""
        elastic = np.ones(len(self.share.cells), dtype=bool)
        self._course = course = Course()
        groups = inelastic_cells(self.grid)
        self._has_inelastic = bool(groups)
        for layout, cells in groups:
            expect_entries(layout, self.scheme, self.ledger)
            part = np.flatnonzero(np.isin(self.share.cells, cells))
            if len(part):
                elastic[part] = False
                fields = Fields(self.share, part)
                self.inelastic.append(
                    InelasticBeams(fields, layout, self.scheme, self._A, self.ledger, course)
                )
        self.beams.extend(self.inelastic)
        if elastic.any():
            part = np.flatnonzero(elastic)
            fields = self.fields if elastic.all() else Fields(self.share, part)
            self.beams.append(ElasticBeams(fields, self.scheme, self._A, self.ledger))
            self._numerical = numerical_forces(self.scheme, fields, self._A, self.ledger)

    def _openable(self) -> list[Openable]:
        """Return the places of this process that may open: hinges, cracks, softening springs."""
        cells: list[Openable] = [one for one in self.inelastic if one.points.softens]
        groups = [one.response.openable for one in self.couplings if isinstance(one, Couplings)]
        return [*cells, *(places for places in groups if places is not None)]

    def _carry_on(self) -> list[Array]:
        """Take the initial state as one in equilibrium with the loads; return their forces."""
        return [load.carry_on(self.t, self.q) for load in self.loads]

    def _make_loads(self) -> list[DeadLoads | FollowerLoads | FrameForces]:
        followers = [load for load in self.scene.loads if isinstance(load, FollowerLoad)]
        frames = [load for load in self.scene.loads if isinstance(load, RotatingFrame)]
        dead = [load for load in self.scene.loads if load not in (*followers, *frames)]
        loads: list[DeadLoads | FollowerLoads | FrameForces] = [
            FrameForces(frame, self.fields, self.scheme, self.ledger, self._A) for frame in frames
        ]
        if dead:
            loads.append(DeadLoads(dead, self.share, self.scheme, self.ledger))
        if followers:
            loads.append(FollowerLoads(followers, self.share, self.scheme, self.ledger, self._A))
        return loads

    def _bear(self, path: StaticPath, loads: list[Array]) -> None:
        """Set the reactions to those of the initial state of a static run.

        Args:
            path: Knows the internal forces of that state.
            loads: The loads that it is in equilibrium with; none if nothing acts yet.
        """
        r = path.force - sum(loads)
        self.supports.enter(r)
        self.supports.hold(self.share.added(r))
        self.supports.take()
        self.reactions_known = True

    # -- the equation of a step ----------------------------------------------------------------

    def _residual(self, x: Array, r: Array) -> None:
        q1 = self.supports.in_plane(x)
        self.force.fill(0.0)
        for inner in self._inner:
            inner.add_residual(q1, self.force)
        r[:] = self.force
        for term in self._others:
            term.add_residual(q1, r)
        self.supports.enter(r)

    def _relieve(self, relief: bool) -> bool:
        """Begin again with relieved points, or end that; return if it makes a difference."""
        opened = bool(self.share.largest(float(self._course.opened)))
        self._course.relieve(relief and opened)
        if relief:
            for coupling in self.couplings:
                coupling.again()
        return opened

    def _excess(self, x: Array, r: Array, scale: float, moved: float) -> float:
        """Return the largest residual of the laws of connectors, without dimension."""
        q1 = self.supports.in_plane(x)
        here = max((c.excess(q1, r, scale, moved) for c in self.couplings), default=0.0)
        return self.share.largest(here) if self.scene.links else 0.0

    def _working(self, x: Array, y: Array) -> Array:
        """Return the conjugates of residuals in the step ``y`` from ``x``."""
        q, v, works = self.supports.in_plane(x), self.supports.in_plane(y), y.copy()
        for coupling in self.couplings:
            coupling.put_motions(q, v, works)
        return works

    def _tangent(self, x: Array) -> None:
        self._assemble(self.supports.in_plane(x))
        self.supports.hold_matrix(self._A.data)

    def tangent_at(self, x: Array, v: Array, r: Array) -> Csr:
        """The tangent at ``x``; adds to ``r`` what it makes of a motion ``v`` of the supports.

        All are in the axes of the supports, and the local part.
        """
        self._assemble(self.supports.in_plane(x))
        if len(self.supports.moving):
            forces = Product(self._A)(self.supports.in_plane(v))
            self.supports.enter(forces)
            r += forces
        self.supports.hold_matrix(self._A.data)
        return self._A

    @property
    def tangent(self) -> Csr:
        """Local part of the latest tangent; what is held has nothing but a diagonal entry."""
        return self._A

    def respond_at(self, q1: Array) -> bool:
        """Evaluate forces and tangent of the present step at ``q1``; false if a process cannot."""
        x, failed = self.supports.in_axes(q1), 0.0
        try:
            self._residual(x, np.zeros(self.share.size))
            self._tangent(x)
        except StepFailed:
            failed = 1.0
        return self.share.largest(failed) == 0.0

    def _assemble(self, q1: Array) -> None:
        self._A.data.fill(0.0)
        for term in self.terms:
            term.add_tangent(q1)

    def linearise(self, q: Array, dt: float) -> tuple[Array, Array]:
        """All forces but those of inertia at ``q``, as they answer the present state; derivatives.

        Nothing yields or opens any further, now and later: no step may follow.

        Args:
            q: Configuration at the local degrees of freedom.
            dt: What velocities are divided by: the derivatives are K + C / dt; s.

        Returns:
            The residual; and the entries of the matrix; in the axes of the plane, nothing held.
        """
        step, r = Step(0.0, dt, self.q, self.t, self.t, toward=1.0), np.zeros(self.share.size)
        self.ask()
        for one in (*self.inelastic, *self.couplings):
            one.freeze()
        self._A.data.fill(0.0)
        for term in self.terms:
            if not isinstance(term, Inertia):
                term.begin(step)
                term.add_residual(q, r)
                term.add_tangent(q)
        return r, self._A.data.copy()

    def tangent_change(self, q: Array, u: Array) -> Array:
        """Derivative of the tangent of :meth:`linearise` along ``u``; entries of the matrix.

        Args:
            q: Configuration at the local degrees of freedom, which was linearised about last.
            u: Direction, forces of connectors included.
        """
        self._A.data.fill(0.0)
        for one in self._inner:
            one.add_tangent_change(q, u)
        return self._A.data.copy()

    def stiffness_works(self, q: Array, X: Array, Y: Array) -> Array:
        """Works of the tangent of :meth:`linearise` for the motions X, each on its own of Y; J.

        Args:
            q: Configuration at the local degrees of freedom, which was linearised about last.
            X: Motions, in columns.
            Y: Virtual motions, in columns.
        """
        self._A.data.fill(0.0)
        for term in self.terms:
            if not (isinstance(term, Inertia) or term in self.beams):
                term.add_tangent(q)
        times, works = Product(self._A), np.zeros(X.shape[1])
        for i, (x, y) in enumerate(zip(*map(np.ascontiguousarray, (X.T, Y.T)), strict=True)):
            of_beams = sum(one.tangent_work(q, x, y) for one in self.beams)
            works[i] = of_beams + times(x) @ y
        return works

    def tangent_works(self, q: Array, u: Array, X: Array, Y: Array) -> tuple[Array, Array]:
        """Works of the tangent for the motions X on Y, and of its derivative along u; J.

        Args:
            q: See :meth:`tangent_change`.
            u: Direction, forces of connectors included.
            X: Motions, in columns.
            Y: Virtual motions, in columns.

        Returns:
            Two symmetric matrices.
        """
        works = np.zeros((2, X.shape[1], Y.shape[1]))
        for i, j in zip(*np.triu_indices(X.shape[1]), strict=True):
            x, y = (np.ascontiguousarray(one) for one in (X[:, i], Y[:, j]))
            works[0, i, j] = sum(one.tangent_work(q, x, y) for one in self.beams)
            works[1, i, j] = sum(one.work_of_change(q, u, x, y) for one in self.beams)
        for k, work in enumerate(works):
            self._A.data.fill(0.0)
            for one in self.couplings:
                if k == 0:
                    one.add_tangent(q)
                else:
                    one.add_tangent_change(q, u)
            times = Product(self._A)
            work += np.triu([times(np.ascontiguousarray(x)) @ Y for x in X.T])
            work += np.triu(work, 1).T
        return works[0], works[1]

    # -- stepping ------------------------------------------------------------------------------

    def step_to(self, t1: float) -> None:
        """Go to the time ``t1``, in one step or, where that fails, in parts.

        Raises:
            ConvergenceError: Even the smallest part failed; the state is that of the last part that
                was accepted, which the solution of the error ends with.
        """
        if self.parts == 0 and self._begins_loaded():
            begin = self.t
            self._in_parts(
                begin + APPLYING * (t1 - begin),
                lambda part, end: self._attempt_loads(begin, part, end),
            )
        self._in_parts(t1, self.attempt)

    def _begins_loaded(self) -> bool:
        """Return whether the loads at the beginning are to be applied before the first step.

        Where forces act over the step, a step that turns a node far does not end in equilibrium.
        So the loads are applied in parts that turn nodes little, and the rest of the step has
        nothing left to do but to follow them.
        """
        over_step = self.scheme.average(0.0, 1.0) != 1.0
        if self.scheme.dynamic or not over_step or self._continues:
            return False
        frames = any(isinstance(load, RotatingFrame) for load in self.scene.loads)
        return frames or any(f(self.t) != 0 for _, f in self.scene.time_functions())

    def _attempt_loads(self, begin: float, t1: float, end: float) -> Trial:
        """Solve a part of the application of the loads at the time ``begin``; it lasts to ``end``.

        Raises:
            StepFailed: There is no equilibrium; or a node turns far, and shorter parts may help.
        """
        step = self.scheme.step(self.t, t1, end, self.q)
        trial = self._attempt(step._replace(load_time=begin, motion_time=begin))
        turn = self.share.largest(np.abs(trial.q1 - self.q)[self._rotations].max(initial=0.0))
        if turn > APPLYING_TURN and SHORT_PART * step.dt > end - begin:
            raise StepFailed("a node turns too far while the loads at the beginning are applied")
        return trial

    def _in_parts(self, t1: float, attempt: Callable[[float, float], Trial]) -> None:
        """Go to the time ``t1`` by attempts of the whole way or of parts of it."""
        t0, done, part = self.t, 0, SMALLEST_PART
        while done < SMALLEST_PART:
            end = (
                t1
                if done + part == SMALLEST_PART
                else t0 + (t1 - t0) * (done + part) / SMALLEST_PART
            )
            try:
                self.accept(attempt(end, t1))
            except StepFailed as failure:
                if part == 1:
                    self.give_up(failure, end)
                part //= 2
                continue
            done += part
            # A part grows again where the larger one would begin anyway.
            if done % (2 * part) == 0 and part < SMALLEST_PART:
                part *= 2

    def attempt(self, t1: float, end: float | None = None) -> Trial:
        """Solve the next step, to ``t1``; the state changes if :meth:`accept` takes it.

        Args:
            t1: End of the step; s.
            end: End of the whole step where this is a part of one; s.

        Raises:
            StepFailed: There is no equilibrium, or it is too far away.
        """
        if self._path is None and not self.inertia.ready:
            t = self.t + FIRST * (t1 - self.t)
            first = self._attempt(self.scheme.step(self.t, t, t1, self.q))
            self.inertia.prepare(first.s)
            self.supports.take()
            for coupling in self.couplings:
                coupling.take(first.q1)
        return self._attempt(self.scheme.step(self.t, t1, t1 if end is None else end, self.q))

    def _attempt(self, step: Step) -> Trial:
        """Solve a step; see :meth:`attempt`."""
        guess = self.together(self._begin, step)
        try:
            like_last = self.scheme.dynamic and math.isclose(step.dt, self.last_dt, rel_tol=1e-6)
            loads = self._loads()
            if self._openings is None:
                q1 = self._solver.solve(guess, loads, like_last)
            else:
                solve = partial(self._solver.solve, loads=loads, like_last=like_last)
                q1 = self._openings.solve(guess, solve, partial(self._begin_terms, step))
        except StepFailed:
            try:
                self.together(self._require_numbers, step)
            except StepFailed as better:
                raise better from None
            raise
        return self._trial(step, q1)

    def _begin(self, step: Step) -> Array:
        """Begin a step; return a guess of its end, in the axes of the supports."""
        self._ask_and_begin(step)
        guess = extrapolated(self.q, self._q_before, step.dt / self.last_dt)
        self.supports.enter(guess)
        self.supports.move(guess, self.supports.in_axes(self.q), step)
        return guess

    def _ask_and_begin(self, step: Step) -> None:
        self.ask()
        self._begin_terms(step)

    def _begin_terms(self, step: Step) -> None:
        for term in self.terms:
            term.begin(step)

    def _require_numbers(self, step: Step) -> None:
        """Raise :class:`StepFailed` if a time function is no finite number in a step."""
        if said := no_number(self.scene, (step.load_time, step.motion_time)):
            raise StepFailed(said)

    def attempt_along(
        self, step: Step, guess: Array, border: Border, *, hold: bool = True
    ) -> Trial:
        """Solve the next step together with the load factor; :meth:`accept` may take it.

        Args:
            step: Where it begins; its times are those of the guess.
            guess: Configuration, in the axes of the supports.
            border: The equation of the factor.
            hold: Whether what does not flow stays closed if it can, see openings.py.

        Raises:
            StepFailed: There is no equilibrium, or it is too far away.
        """
        self.together(self._ask_and_begin, step)
        loads, t = self._loads(), border.t
        solve = partial(self._solver.solve_along, loads=loads, border=border)

        def again() -> None:
            self._begin_terms(step)
            border.t = t

        if self._openings is None or not hold:
            return self._trial(step, solve(guess))
        return self._trial(step, self._openings.solve(guess, solve, again))

    def _loads(self) -> list[Array]:
        return [load.force for load in self.loads]

    def _trial(self, step: Step, q1: Array) -> Trial:
        """Return the result ``q1`` of a step, in the axes of the supports, if it can be trusted."""
        self.supports.leave(q1)
        s, turn = self.scheme.nodal_step(self.q, q1, self._rotations)
        if len(self.grid.multipliers):
            s[self._multipliers] = 0.0
        self._require_small(turn)
        if self._path is not None:
            self._path.require(q1, s, self.force, self._solver.least_work(s))
        return Trial(step, q1, s)

    def accept(self, trial: Trial) -> None:
        """Go where the latest :meth:`attempt` went."""
        self.together(self._accept, trial)
        if self._copies is not None:
            self._copies.note(self.t, self.q)

    def _accept(self, trial: Trial) -> None:
        """See :meth:`accept`."""
        step, q1, s = trial
        if self._path is not None:
            self._path.accept(self.force)
        for term in self.terms:
            term.accept(q1, s)
        self.supports.enter(s)
        self.supports.accept(s)
        self._q_before, self.last_dt = self.q, step.dt
        self.q, self.t = q1, step.t1
        self.parts += 1
        self.ledger.begin()
        for term in self.terms:
            term.add_state(q1)

    def ask(self) -> None:
        """Ask controllers and friction what acts in the next step.

        All processes ask together, whoever computes the connector.
        """
        self.asked.update({link: law.ask(self, link) for link, law in self._asking})
        for coupling in self._rubbing if has_inertia(self.scheme) else ():
            rates = coupling.rates(self.q, self.inertia.v)
            self._sliding.update(zip(coupling.links, rates, strict=True))

    def _require_small(self, turn: float) -> None:
        """Raise if a node of any process turns too far in the step."""
        turn = self.share.largest(turn)
        if not turn <= LARGEST_TURN:
            raise StepFailed(
                f"a node turns by {turn:.3g} rad in the step, and |Δψ| must stay below π; reduce dt"
            )

    def give_up(self, failure: StepFailed, end: float, advice: str = "") -> NoReturn:
        """End the run where it is, because even the smallest step, to ``end``, failed.

        Raises:
            ConvergenceError: With the solution so far.
        """
        self.leave()
        self.end()
        dt, forces, named = end - self.t, self._forces_by_kind(), self.solution.parameter
        sizes = ", ".join(f"{kind} {size:.1e} N" for kind, size in forces.items())
        where = f"at {named.at(self.t, '.9g')}"
        if dt != 0:
            where = f"after {named.at(self.t, '.9g')}, even with {named.over(dt)}"
        why = singularity(self, self.supports.in_plane(self._solver.iterate()))
        said = f"{failure} ({sizes})" if sizes else str(failure)
        raise ConvergenceError(
            f"no equilibrium {where}: {why}{'; ' if why else ''}{said}. "
            f"{advice or self.scheme.advice}",
            time=self.t,
            dt=dt,
            solution=self.solution,
            residuals=failure.residuals,
            forces=forces,
            reason=failure.reason,
        ) from failure

    def _forces_by_kind(self) -> dict[str, float]:
        """Sizes of the forces at the latest iterate; N."""
        q1 = self.supports.in_plane(self._solver.iterate())
        forces = {kind: np.zeros(self.share.size) for kind in KINDS}
        for term in self.terms:
            try:
                term.add_residual(q1, forces[term.kind])
            except Exception:
                forces[term.kind].fill(np.nan)  # it is why the step has failed
        sizes = {kind: self._solver.size(force) for kind, force in forces.items()}
        return {kind: size for kind, size in sizes.items() if size}

    def settle(self) -> None:
        """Compare the states so far where each process computes a copy of the scene.

        Raises:
            CopiesDiffer: They are not the same.
        """
        if self._copies is not None:
            self._copies.settle()

    def leave(self) -> None:
        """Tell processes that compute copies of the scene that this one does not go on."""
        if self._copies is not None:
            self._copies.leave()

    # -- the end, and going on -----------------------------------------------------------------

    @property
    def parameter(self) -> Parameter:
        """Time, or the load factor of a path."""
        return self.solution.parameter

    @property
    def iterations(self) -> int:
        """Newton iterations so far."""
        return self._solver.iterations

    def end(self) -> None:
        """Let the solution have the last state, and what another run that starts there needs."""
        self.settle()
        if self.t not in self.solution.times[-1:]:
            self.solution.keep(self)
        self._remember(self.solution)

    def snapshot(self) -> Solution:
        """The state now, as a solution that other runs may start with; all processes call it."""
        self.settle()
        now = Solution(self.scene, self.grid)
        now.keep(self)
        self._remember(now)
        return now

    def _remember(self, solution: Solution) -> None:
        memory = Saving(self.share)
        for one in (*self.inelastic, *self.couplings):
            one.remember(memory, self.q)
        if self.supports.work or any(isinstance(law, Coulomb) for _, law in self._asking):
            self.supports.carry_on(memory, self.q)
        if self._path is None:
            self.inertia.carry_on(memory, len(self.inertia.more))
        solution.internal = memory.state()

    def state(self) -> State:
        """All that later steps depend on; all processes call it together."""
        memory = Saving(self.share)
        self._pass_on(memory)
        return memory.state()

    def resume(self, state: State) -> None:
        """Go on from a :meth:`state`, perhaps of other processes."""
        self._pass_on(Restoring(self.share, state))
        self.ledger.begin()
        for term in self.terms:
            term.add_state(self.q)

    def _pass_on(self, memory: Memory) -> None:
        self.t = memory.number("t", self.t)
        self.last_dt = memory.number("last dt", self.last_dt)
        self.parts = int(memory.number("parts", self.parts))
        self._solver.remember(memory)
        self.q = memory.at_dofs("q", self.q)
        self._q_before = memory.at_dofs("q before", self._q_before)
        for kind, entries in (("supplied", self.ledger.supplied), ("lost", self.ledger.lost)):
            for name, value in entries.items():
                entries[name] = memory.total(f"{kind}: {name}", value)
        for term in self.terms:
            term.remember(memory, self.q)
        self.supports.remember(memory, self.q)
        if self._path is not None:
            self._path.remember(memory, self.q)

    def check_ledger(self) -> None:
        """Warn, and note in the solution, if a ledger is open that the scheme claims to close.

        All processes call it together, at the end of a run.

        Warns:
            ModelWarning: It is open, perhaps by round-off.
        """
        if not getattr(self.scheme, "exact_ledger", False) or len(self.solution) < 2:
            return
        energy, claimed = self.solution.energy, ROOM * self._solver.rtol
        if not energy.opened(claimed, 0.0):
            return
        # Errors of steps are independent: their squares add up.
        q = self.solution.q[:, self.share.dofs]
        steps = np.sqrt(np.sum(np.diff(q, axis=0) ** 2, axis=0))
        round_off = self._solver.random_work(np.abs(q).max(axis=0), steps)
        self.solution.open_ledger = energy.opened(claimed, round_off)
        if self.solution.open_ledger and self.comm.rank == 0:
            warnings.warn(self.solution.open_ledger, ModelWarning, stacklevel=3)

    def close(self) -> None:
        """Give back what PETSc holds."""
        self._solver.destroy()
