# SPDX-License-Identifier: MIT
"""Simulation: present state of a scene, and steps to later states."""

from __future__ import annotations

import math
from functools import cached_property, partial
from itertools import chain
from typing import Any, NoReturn

from mpi4py import MPI

import numpy as np

from ufl_beam.arrays import Array
from ufl_beam.compiled.c_library import doubles, ffi, fill, give_back_memory, lib
from ufl_beam.discretization.model_warnings import warn_of_jumps
from ufl_beam.discretization.partition import Subdomain
from ufl_beam.discretization.state_io import Archive, State
from ufl_beam.discretization.state_transfer import same_unknowns
from ufl_beam.errors import ArgumentError, ModelError, StepFailed, require_number, shorten
from ufl_beam.mechanics.time_scheme import Scheme, has_inertia
from ufl_beam.model.beams import Mesh
from ufl_beam.model.connector_laws import RIGID, PrescribedMotion
from ufl_beam.model.loads import RotatingFrame
from ufl_beam.model.scene import Scene
from ufl_beam.output.dolfinx_view import DolfinxView
from ufl_beam.output.extremes import ExtremesInC
from ufl_beam.output.state_rows import BEFORE, FORCES, RECORD, Block, StateWriter
from ufl_beam.output.states import States
from ufl_beam.parallel import Agreement, communicator, sharing
from ufl_beam.simulation.diagnosis import no_equilibrium, turned_far
from ufl_beam.simulation.impacts import Impact, impacts_of
from ufl_beam.simulation.initial_state import (
    StateOf,
    checked_numbering,
    chosen_state,
    continuation,
    initial_state,
    mesh_of,
    require_held,
    require_known,
)
from ufl_beam.simulation.solution import Solution
from ufl_beam.simulation.step_equation import StaticPath, StepEquation, forces_of_scene
from ufl_beam.simulation.stepper import Stepper
from ufl_beam.solvers.newton_options import Newton, checked_newton, require_plain

APPLYING = 1 / 8
"""Fraction of the first step in which loads that act from the start are applied."""

LONGEST = 0.05
"""Wall time after which C returns, so that a run can be interrupted and shows its progress; s."""

MOST_VALUES = 2**20
"""Limit of the numbers that C stores in one call for states; at least one state is stored."""


class Simulation(Stepper):
    """Time stepper of a scene: its present state, and steps to later states.

    :func:`simulate` is a loop over steps; use this class for loops of your own.  Steps are not
    stored: :meth:`keep` appends the present state to :attr:`solution`.

    Args:
        scene: Model.
        scheme: :class:`Static`, :class:`EnergyMomentum` or another scheme, see docs/schemes.md.
        t0: Time of the initial state; s.
        start: Solution whose last state is the initial state, with the same beams, or
            ``(solution, n)`` for its n-th stored state.  Joints may be removed, or added where
            places coincide.
        newton: Tolerances and options of Newton's method.
        mesh: Discretization; by default as in ``start``, or the cells of the beams.
        comm: Processes that share the scene; by default all, or in a :func:`study` this process
            alone.
        kind: Class of :attr:`solution`.

    Attributes:
        t: Time; s.
        solution: States stored by :meth:`keep`, or ``steps_to(..., keep=True)``; empty at first.
        substeps: Number of substeps so far; an undivided step counts as one substep.
        begins_with_impact: True if velocities at the beginning meet constraints.
        comparison: Comparison of the processes if each of them computes a small scene as a whole.

    Example:
        >>> simulation = ub.Simulation(scene, ub.EnergyMomentum())
        >>> while simulation.t < 1:
        ...     simulation.step_to(simulation.t + 0.05)
        ...     simulation.keep()
        >>> print((1e3 * simulation.displacement(beam.end)).round(1))  # mm, mm, mrad
        [ -0.1 -18.9 -14.3]
        >>> len(simulation.solution)
        20
        >>> simulation.close()
    """

    solution: Solution

    def __repr__(self) -> str:
        return f"<Simulation at {self.parameter.at(self.t)}: {self.numbering}, {self.scheme!r}>"

    def __init__(
        self,
        scene: Scene,
        scheme: Scheme,
        *,
        t0: float = 0.0,
        start: StateOf | None = None,
        newton: Newton | None = None,
        mesh: Mesh | None = None,
        comm: MPI.Intracomm | None = None,
        kind: type[Solution] = Solution,
    ) -> None:
        comm = communicator(comm, "comm")
        require_number(t0, "t0")
        newton = checked_newton(newton, comm)
        require_plain(newton, "Simulation" if kind is Solution else "follow")
        if not (isinstance(kind, type) and issubclass(kind, Solution)):
            raise ArgumentError(
                f"kind = {shorten(kind)} must be a class of solutions, such as Path"
            )
        start = chosen_state(start, "start")
        fresh = start is None
        numbering, free_motion = checked_numbering(scene, scheme, mesh_of(start, mesh), fresh=fresh)
        subdomain = Subdomain(numbering, sharing(comm, len(numbering.cells)))
        together, state = Agreement(subdomain.comm), initial_state(numbering, start)
        q, v, internal, _ = state
        t0, same = continuation(start, scene, t0)
        equation = StepEquation(subdomain, scheme, t0, v[subdomain.dofs], together)
        inertia, q_local, loaded = equation.inertia, q[subdomain.dofs], list[Array]()
        goes_on = same and "reactions" in internal and start is not None and not len(start.v)
        whole = equation if subdomain.alone else None
        impacts, impact = together(impacts_of, numbering, scheme, t0, start, same, state, whole)
        self._impacts: Any = impacts
        self.begins_with_impact = impact is not None
        if moves := impacts is not None and impacts.moves:
            equation.ledger.lost["impacts"] += 0.0
        self._meet(equation, impact)
        if not fresh or (inertia is not None and inertia.scheme.further_rates):
            rates = None if inertia is None else inertia.v
            past = Archive(subdomain, internal) if same else None
            loads = [*equation.loads, *equation.imposed]
            loaded = together(lambda: [x.carry_on(t0, q_local, rates, past) for x in loads])
        elif inertia is not None:
            together(equation.begin_energies, t0, q_local, inertia.v)
        if start is not None:
            remembered = partial(equation.set_internal_variables, same=same)
            unknown = together(remembered, q_local, t0, internal)
            together(require_known, numbering, start, unknown)
            together(self._require_held, equation, q_local)
        for term in equation.terms:
            term.start(q_local)
        equation.add_state(q_local)
        for group in equation.connector_terms if fresh else ():
            group.put_forces(q_local)
        path = None
        if inertia is None:
            path = StaticPath(equation, q_local, t0, loaded, together, goes_on=goes_on)
        else:
            together(equation.inner_forces, q_local)
        goes_on = goes_on or inertia is not None
        solution, forces, before = kind(scene, numbering), None, None
        solution.equilibrium_fraction, solution.scheme = float(scheme.average(0.0, 1.0)), scheme
        alike = start is not None and start.equilibrium_fraction == solution.equilibrium_fraction
        if goes_on and alike and start is not None and same_unknowns(start.numbering, numbering):
            forces = np.ascontiguousarray(start.cell_resultants(-1)[:, subdomain.cells])
            before = start.before(-1)[subdomain.dofs] if start.needs_start else None
        if forces is not None or inertia is not None:
            equation.cell_forces.begin(forces)
        super().__init__(comm, equation, newton, t0, q_local, path, solution, together, free_motion)
        self._begun_at = before
        if same:
            self.prediction.carry_on(Archive(subdomain, internal))
        if moves:
            fill(self.time_loop, meet_jumps=lib.time_in_python, next_jump=-math.inf)
            self.time_loop.impacts = equation.callbacks.handle(self._meet_jumps)
        solution.needs_start = solution.equilibrium_fraction < 1 or self.cell_forces.needs_q0
        solution.forces_from_record = self.cell_forces.forces_from_record
        if not subdomain.alone:
            solution.forces_from_record = forces_of_scene(numbering, scheme, t0)
        acts = any(isinstance(load, RotatingFrame) for load in scene.loads) or bool(scene.works)
        acts = acts or any(f(t0) != 0 for _, f in scene.time_functions())
        # Whether loads that act from the start are applied in substeps at first, see stepper.py
        self._applies = fresh and inertia is None and solution.equilibrium_fraction != 1.0 and acts
        give_back_memory(len(q_local))
        laws = [connector.law for connector in scene.all_connectors]
        driven = any(isinstance(x, PrescribedMotion) and x is not RIGID for x in laws)
        if inertia is not None and (driven or scene.supports):
            motions = self.connections()[:, 0] if driven else np.zeros(len(laws))
            together(warn_of_jumps, numbering, t0, q, motions, self.supports.angle_of)

    # -- impacts -------------------------------------------------------------------------------

    def _meet_jumps(self, t1: float) -> float:
        """Let velocities meet rates that have jumped before a step to ``t1``.

        Returns the time from which on rates may jump again.
        """
        c, t, impacts = self.time_loop, self.time_loop.t, self._impacts
        if any(counts := impacts.after(c.prediction.dt, t, t1)):
            q, alone = self._copy(c.q), self.subdomain.alone
            state = {} if alone else self.equation.internal_variables(q, t, self.prediction)
            q, v = (self.subdomain.gather(x).copy() for x in (q, self.inertia.v))
            impact = impacts.find(q, v, t, counts, state, longest=(t1 - t) / 4)
            if impact is not None and (c.derivatives or c.adjoint):
                raise ModelError(
                    f"the run has no derivative: at t = {t:.9g} s the rate of a prescribed motion "
                    "jumps; let the rate grow in time, or begin the run there"
                )
            self._meet(self.equation, impact)
            self._moved(t)
        return float(impacts.next_check(t + 1e-9 * (t1 - t)))

    @staticmethod
    def _require_held(equation: StepEquation, q: Array) -> None:
        for group in equation.connector_terms:
            if group.law is RIGID:
                size = equation.subdomain.numbering.scene.size
                require_held(group.connectors, group.motion_at_begin(q), size)

    def _meet(self, equation: StepEquation, impact: Impact | None) -> None:
        """Change the velocities of this process by an impact, if there is one."""
        if impact is None:
            return
        inertia, v = equation.inertia, impact.v[equation.subdomain.dofs]
        assert inertia is not None
        inertia.commit(v, v, inertia.c.last_dt)
        inertia.keep()  # accelerations are unknown
        groups = [(term.indices, dict(term.fields)["work"]) for term in equation.connector_terms]
        share = float(equation.subdomain.comm.rank == 0)
        self._impacts.enter(impact, equation.ledger, groups, share)

    # -- stepping ------------------------------------------------------------------------------

    def step_to(self, t1: float) -> None:
        """Advance to the time ``t1`` in one step or, if it fails, in substeps.

        Raises:
            ConvergenceError: Even the smallest substep failed.  The present state is then the end
                of the last accepted substep, as is the last state of ``error.solution``.
            ArgumentError: Loads of the first static step do not resist a motion without strain, or
                ``t1`` is not later than the present time.
        """
        if not t1 > self.t:
            raise ArgumentError(
                f"step_to({t1}): the simulation is at {self.parameter.at(self.t)} already"
            )
        self.steps_to(np.array([t1]))

    def steps_to(self, ends: Array, *, keep: bool = False) -> int:
        """Advance to one or more of the times ``ends``, until C returns.

        C returns after :data:`LONGEST`, after a divided step, and when the memory for new states is
        full; with several processes that share the scene, after each step.

        Args:
            ends: Ends of steps; (n,); s.
            keep: Append the state at the end of each step to the solution.

        Returns:
            Number of steps taken, at least 1.

        Raises:
            ConvergenceError: See :meth:`step_to`.

        Example:
            >>> simulation = ub.Simulation(scene, ub.EnergyMomentum())
            >>> ends = np.linspace(0, 1, 21)[1:]
            >>> while len(ends):
            ...     ends = ends[simulation.steps_to(ends) :]
            >>> print((1e3 * simulation.displacement(beam.end)).round(1))  # mm, mm, mrad
            [ -0.1 -18.9 -14.3]
            >>> simulation.close()
        """
        c, solution, row_limit, rows = self.time_loop, self.solution, 0, ffi.NULL
        ends = np.ascontiguousarray(ends, dtype=np.float64)
        number = len(ends) if self.subdomain.alone else 1  # clocks of processes differ
        try:
            if self._applies and self.substeps == 0:
                self._applies = False
                first = self.t + APPLYING * (float(ends[0]) - self.t)
                fill(c, applies=1, begin_of_run=self.t, applied_by=first)
                with self._in_c():
                    reached = lib.step_or_subdivide(c, first)
                c.applies = 0
                if not reached:
                    self._fail()
                c.prediction.dt = math.inf  # the next step is not extrapolated from this step
            if keep:
                columns = self._writer.columns
                lacks_start = solution.needs_start and BEFORE not in columns.at
                follows = not lacks_start or solution.substeps_of_last == self.substeps
                if self.subdomain.alone and follows:
                    most = 1 + MOST_VALUES // columns.width
                    space = solution.free_rows(columns, min(number, most))
                    row_limit, rows = len(space), doubles(space)
                number = max(row_limit, 1)
            with self._in_c():
                taken: int = lib.take_steps(c, number, doubles(ends), LONGEST, row_limit > 0, rows)
            if keep and taken:
                # The row of a divided step lacks q at the beginning of the last substep, on which
                # forces depend.  So `keep` writes this state instead.
                divided = lacks_start and row_limit > 0 and c.substeps_of_last > 1
                if row_limit and taken > divided:
                    solution.grow(taken - divided)
                    solution.count(self.substeps - divided * c.substeps_of_last, self.iterations)
                if divided or not row_limit:
                    self.keep()
            if c.failure:
                self._fail()
        except StepFailed as failure:
            self.give_up(failure, float(c.failed_end))
        return taken

    def repeat(self, steps: Array, configurations: Array) -> None:
        """Accept given configurations at the ends of steps, without solutions; keep the states.

        Args:
            steps: For each substep, or step that is not divided: its end, the end of the step (s),
                and 1 if it applies the loads at the beginning of the run, else 0; (n, 3).
            configurations: Configurations at the ends; (n, size).

        Raises:
            StepFailed: A law or a function of a user fails in a step.
        """
        self.keep()
        steps, configurations = map(np.ascontiguousarray, (steps, configurations))
        columns, done = self._writer.columns, 0
        if self._path is not None:
            self._path.c.slack = math.inf  # the steps have been accepted before
        most = 1 + MOST_VALUES // columns.width
        self.time_loop.begin_of_run = self.t
        ends = (steps[:, 0] == steps[:, 1]) & (steps[:, 2] == 0)  # of whole steps, or divided ones
        while done < len(steps):
            # Whole steps together, or all substeps of a step, which keep() stores
            number = int(np.argmin(ends[done:])) if not ends[done:].all() else len(steps) - done
            whole = number > 0
            number = min(number, most) if whole else 1 + int(np.argmax(ends[done:]))
            if whole:
                space = self.solution.free_rows(columns, number)
            else:
                space = np.zeros((number, columns.width))
            self._accept_given(steps[done:], configurations[done:], space)
            taken = len(space)
            if whole:
                self.solution.grow(taken)
                self.solution.count(self.substeps, self.iterations)
            else:
                self.keep()
            done += taken

    def _accept_given(self, steps: Array, configurations: Array, rows: Array) -> None:
        """Accept as many given configurations as there are ``rows``, which get the states."""
        with self._in_c():
            arrays = doubles(steps), doubles(configurations), doubles(rows)
            taken: int = lib.repeat_steps(self.time_loop, len(rows), *arrays)
        if taken < len(rows):
            self._fail()

    def watch(self, fractions: Array) -> ExtremesInC:
        """Return extremes of motions, and of section forces at ``fractions`` of cells.

        C updates them after each substep.  All processes that share the scene call this method.
        """
        between = self.solution.equilibrium_fraction
        extremes = ExtremesInC(self.fields, self.cell_forces, between, fractions)
        self._watches.append(extremes)
        pointers = ffi.new("watch *[]", [watch.c for watch in self._watches])
        fill(self.time_loop, watches=len(self._watches), watch=pointers)
        return extremes

    def give_up(self, failure: StepFailed, end: float, advice: str = "") -> NoReturn:
        """End the run in its present state, because even the smallest step, to ``end`` (s), failed.

        Raises:
            ConvergenceError: Always, except in the next case; the error has the solution so far.
            ModelError: The first static step failed, and the scene can move without strain.
        """
        self.comparison.finish()
        self.supports.go_back()
        self.end()
        local = [f"{said}." for said in self._force_watch.suspects(self.t)]
        suspects = dict.fromkeys(chain.from_iterable(self.subdomain.comm.allgather(local)))
        if self.scene.in_space:
            advice = turned_far(self.now) or advice
        raise no_equilibrium(
            self.equation, self.solver, self.solution, failure, self.q, (self.t, end),
            " ".join([*suspects, advice or self.scheme.advice]), self._free_motion,
        ) from failure  # fmt: skip

    # -- the state -----------------------------------------------------------------------------

    @property
    def now(self) -> States:
        """Present state in the form of a solution; all processes read it together.

        Before the first step of a dynamic run, reactions are zero or taken from ``start``.

        Example:
            >>> simulation = ub.Simulation(scene, ub.EnergyMomentum())
            >>> simulation.step_to(0.05)
            >>> print(simulation.now.diagram(beam, points=2).M[:2].round(-3))
            [-5000. -4000.]
            >>> simulation.close()
        """
        if self._now is None:
            columns = self._writer.columns
            size = columns.width
            if self.solution.needs_start and BEFORE not in columns.at:
                columns = columns.plus(BEFORE, (self.numbering.size,))
            row = np.zeros(columns.width)
            self._writer.write(row[:size])
            if self.solution.needs_start:
                columns.column_of(BEFORE, row)[:] = self.subdomain.gather(self.q_before)
            self._now = States(self.numbering, self.solution, Block(columns, row[None], 1))
            if not self.subdomain.alone or self._lacks_record:
                self._now.forces_from_record = partial(self._gathered_forces, self.substeps)
        return self._now

    @cached_property
    def _writer(self) -> StateWriter:
        return StateWriter(
            self.time_loop, self.subdomain, self.ledger, self.supports, self.inelastic,
            self.connector_terms, self.cell_forces, self.equation.nodes_in_space,
        )  # fmt: skip

    @property
    def _lacks_record(self) -> bool:
        """True if the forces of cells cannot be computed from the stored numbers of a state."""
        return not self._writer.records or bool(self.cell_forces.c.initial)

    def _gathered_forces(self, substeps: int, *_: Array) -> Array:
        """Return the forces of all cells, ``cell_number`` of loops.h; (9, num_cells).

        They belong to the state after ``substeps`` substeps, which must be the present state.
        """
        if substeps != self.substeps:
            raise ArgumentError("section forces of an earlier state: ask for simulation.now again")
        forces: Array = np.zeros((lib.CELL_NUMBERS, len(self.numbering.cells)))
        forces[:, self.subdomain.cells] = self.cell_forces(self.q, self.q_before)
        if not self.subdomain.alone:
            self.subdomain.comm.Allreduce(MPI.IN_PLACE, forces)
        return forces

    def keep(self, solution: Solution | None = None) -> None:
        """Append the state to ``solution``, by default :attr:`solution`; all processes call it."""
        solution = self.solution if solution is None else solution
        columns = self._writer.columns
        follows = not solution.needs_start or BEFORE in columns.at
        follows = follows or solution.substeps_of_last == self.substeps - 1
        if self.substeps and follows and not self._lacks_record:
            (row,) = solution.free_rows(columns)
            self._writer.write(row)
            solution.grow()
        else:
            _, row = self.now.row(0)
            rows, before = [row[: columns.width]], row[columns.width :]
            if self._lacks_record:
                forces = self.now.cell_resultants(0)
                rows = [row[: columns.at[RECORD].start], forces.ravel()]
                columns = columns.plus(FORCES, forces.shape, without=RECORD)
            at_rest = not len(solution) and np.array_equal(before, self.now.q[0])
            if not follows and not at_rest:
                columns = columns.plus(BEFORE, before.shape)
                rows.append(before)
            solution.append(columns, *rows)
            if self.substeps == 0 and has_inertia(self.scheme):  # reactions are not yet known
                columns, row = solution.row(-1)
                columns.column_of("reactions", row).fill(math.nan)
        solution.count(self.substeps, self.iterations)

    # -- end and restart -----------------------------------------------------------------------

    @cached_property
    def dolfinx(self) -> DolfinxView:
        """Mesh, functions and forms of this simulation, in the types of DOLFINx."""
        return DolfinxView(self)

    def internal(self) -> State:
        """See the base class."""
        archive = Archive(self.subdomain)
        for cells in self.inelastic:
            cells.save_or_restore(archive, self.q)
        return archive.state()

    def end(self) -> None:
        """Store the last state, and the data for ``start=``, in the solution; gather extremes."""
        self.take_back()
        self.comparison.synchronize()
        if self.t not in self.solution.times[-1:]:
            self.keep()
        for extremes in self._watches:
            extremes.gather()
        # Iterations of failed steps count, too.
        self.solution.substeps, self.solution.iterations = self.substeps, self.iterations
        self.solution.internal = self.equation.internal_variables(self.q, self.t, self.prediction)

    def snapshot(self) -> Solution:
        """Return the present state as a solution for ``start=``; all processes call it."""
        self.comparison.synchronize()
        now = Solution(self.scene, self.numbering, self.solution)
        self.keep(now)
        now.internal = self.equation.internal_variables(self.q, self.t, self.prediction)
        return now

    def save_or_restore(self, archive: Archive) -> None:
        """Save or restore the data for later steps, which may run on another number of processes.

        All processes call it together.
        """
        t, restores = archive.number("t", self.t), archive.has("t")
        self.substeps = int(archive.number("substeps", self.substeps))
        self.solver.save_or_restore(archive)
        q = archive.at_dofs("q", self.q)
        self.controllers.save_or_restore(archive, t)
        self.prediction.save_or_restore(archive)
        if restores:
            ffi.memmove(self.time_loop.q, doubles(q), q.nbytes)
            self.time_loop.t, self._begun_at = t, None
            self._moved(t)
        self.cell_forces.save_or_restore(archive, self.q, self.q_before)
        self.ledger.save_or_restore(archive)
        for term in self.terms:
            term.save_or_restore(archive, self.q)
        self.supports.save_or_restore(archive, self.q)
        if self._path is not None:
            self._path.save_or_restore(archive)
        if restores:
            self.ledger.begin()
            self.equation.add_state(self.q)
            give_back_memory(len(self.q))

    def close(self) -> None:
        """Destroy the PETSc objects; later steps raise :class:`ArgumentError`."""
        self.solver.destroy()
        self.equation.callbacks.close()
        self._alive.clear()  # has some of the functions, too
