# SPDX-License-Identifier: MIT
"""Simulation: a scene in motion, one state and the step to the next."""

from __future__ import annotations

import math
from collections.abc import Iterable
from functools import cached_property, partial
from typing import Any, NoReturn

from mpi4py import MPI

import numpy as np

from ufl_beam.arrays import Array
from ufl_beam.discretization.model_warnings import warn_of_jumps
from ufl_beam.discretization.partition import Share
from ufl_beam.discretization.state_io import Memory, State
from ufl_beam.errors import SceneError, StepFailed, require_kind, require_number, shorten, warn
from ufl_beam.mechanics.time_schemes import Scheme, Step, has_inertia
from ufl_beam.model.beams import Mesh
from ufl_beam.model.scene import Scene
from ufl_beam.output.dolfinx_view import DolfinxView
from ufl_beam.output.extremes import ExtremesInC
from ufl_beam.output.postprocessing import ForcesAlongCells
from ufl_beam.output.recorders import StateView
from ufl_beam.output.state_rows import BEFORE, FORCES, RECORD, Block, StateWriter, new_rows
from ufl_beam.output.states import States
from ufl_beam.parallel import Agreement, Copies, communicator, sharing
from ufl_beam.simulation.assembly import assemble
from ufl_beam.simulation.controllers import ForceWatch
from ufl_beam.simulation.diagnosis import no_equilibrium, require_held
from ufl_beam.simulation.initial_state import checked_grid, initial_state, last_forces, mesh_of
from ufl_beam.simulation.solution import Solution
from ufl_beam.simulation.stepper import (
    APPLYING,
    Extras,
    Prediction,
    Stepper,
    Trial,
    begins_loaded,
)
from ufl_beam.solvers.newton_options import Newton, checked_newton, require_plain

ROOM = 2**20
"""Numbers that C writes of states in a call."""


class Simulation(StateView):
    """Time stepper of a scene: its present state and the step to the next.

    :func:`simulate` is a loop over :meth:`step_to`; use this class for loops of your own.

    Args:
        scene: Model.
        scheme: :class:`Static`, :class:`Midpoint` or another one, see docs/schemes.md.
        t0: Time of the initial state; s.
        start: Solution of the same beams whose last state is the initial state.  Joints may be
            removed, or added where places are together.
        newton: Tolerances and PETSc options.
        mesh: Discretization; as ``start``, or with the cells of the beams.
        comm: Processes that share the scene; all of them, or in a :func:`study` this one alone.
        kind: Class of the solution.

    Attributes:
        t: Time; s.
        ledger: Energies of this process.
        equation: The equation of a step.
        solution: The motion so far.
        parts: Number of parts that steps were cut into, those not cut included.
        together: Calls that raise on all processes of a shared scene what they raise on one.
        prediction: What the guess of the next step needs of the last ones.

    Example:
        >>> simulation = ub.Simulation(scene, ub.Midpoint())
        >>> while simulation.t < 1:
        ...     simulation.step_to(simulation.t + 0.05)
        >>> print((1e3 * simulation.displacement(beam.end)).round(1))  # mm, mm, mrad
        [ -0.1 -18.9 -14.3]
        >>> simulation.close()
    """

    def __repr__(self) -> str:
        return f"<Simulation at {self.parameter.at(self.t)}: {self.grid}, {self.scheme!r}>"

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
        kind: type[Solution] = Solution,
    ) -> None:
        comm = communicator(comm, "comm")
        require_number(t0, "t0")
        newton = checked_newton(newton, comm)
        require_plain(newton, "Simulation" if kind is Solution else "follow")
        if not (isinstance(kind, type) and issubclass(kind, Solution)):
            raise SceneError(f"kind = {shorten(kind)} must be a class of solutions, such as Path")
        if start is not None:
            require_kind(start, Solution, "start")
        fresh = start is None
        grid, self._loose = checked_grid(scene, scheme, mesh_of(start, mesh), fresh=fresh)
        share = Share(grid, sharing(comm, len(grid.cells)))
        self.scene, self.scheme, self.comm, self.grid, self.share = scene, scheme, comm, grid, share
        self.together = together = Agreement(share.comm)
        self._copies = Copies(comm, share) if comm.size > share.comm.size else None
        q, v, internal = initial_state(grid, start)
        self._assembly = parts = assemble(share, scheme, t0, v[share.dofs], together)
        self.fields, self.ledger, self.controllers = parts.fields, parts.ledger, parts.controllers
        self.beams, self.inelastic, self.couplings = parts.beams, parts.inelastic, parts.couplings
        self.loads, self.supports = parts.loads, parts.supports
        self.equation, self.terms = parts.equation, parts.equation.terms

        self.t, self.parts, q_here = t0, 0, q[share.dofs]
        self._begun_at: Array | None = None  # of the state before the first step
        weights, in_motion = self.equation.weights, has_inertia(scheme)
        self.prediction = Prediction(share, q_here, weights, in_motion=in_motion)
        loaded: list[Array] = []
        same = start is not None and start.scene is scene and bool(start.times[-1] == t0)
        goes_on = same and "reactions" in internal and start is not None and not len(start.v)
        if not fresh or (has_inertia(scheme) and scheme.kept):
            loaded = together(parts.carry_on, t0, q_here, internal if same else None)
        if start is not None:
            parts.take_over(q_here, t0, internal, same=same)
        self.equation.start(q_here)
        self.equation.add_state(q_here)
        for coupling in parts.couplings if start is None else ():
            coupling.put_forces(q_here)
        if parts.inertia is not None:
            self.inertia = parts.inertia
        self._branch = parts.static_path(scheme, q_here, t0, loaded, together, goes_on=goes_on)
        self._reactions_known = self._branch is not None  # those of the initial state
        self.cell_forces = parts.cell_forces
        if not self._reactions_known:
            together(self.equation.forces_at_rest, scheme, q_here)
        goes_on = goes_on or not self._reactions_known
        forces, before = last_forces(grid, share, scheme, start) if goes_on else (None, None)
        if forces is not None or not self._reactions_known:
            self.cell_forces.begin(forces)
            self._begun_at = before

        self.solution, self._end = kind(scene, grid), np.zeros(1)
        self.parameter = self.solution.parameter
        self._describe(self.solution)
        self._watches: list[ExtremesInC] = []
        self._watch = ForceWatch(self.couplings, self.controllers, scene.size)
        extras = Extras(
            self.ask if self.controllers.asks else None,
            self.controllers.next_sample if self.controllers.sampled else None,
            self._require_held if self._loose else None,
            None if self._copies is None else self._copies.note, self._watch.c,
        )  # fmt: skip
        self._applies = fresh and begins_loaded(scene, scheme, t0)
        self._stepper = Stepper(
            scheme, self.equation, newton, self.ledger, parts.inertia, self._branch,
            self.cell_forces, together, extras,
        )  # fmt: skip
        self.solver = self._stepper.solver
        self._stepper.begin_at(self, t0, q_here)
        self.moved(t0)
        if has_inertia(scheme) and (scene.links or scene.supports):
            motions = self.connections()[:, 0] if scene.links else np.zeros(0)
            together(warn_of_jumps, grid, t0, q, motions)

    # -- stepping ------------------------------------------------------------------------------

    def step_to(self, t1: float) -> None:
        """Go to the time ``t1``, in one step or, where that fails, in parts.

        Raises:
            ConvergenceError: Even the smallest part failed; the state is that of the last part that
                was accepted, which the solution of the error ends with.
        """
        self._end[0] = t1
        self._take(self._end)

    def steps_to(self, ends: Array, *, keep: bool = False) -> int:
        """Go to the first of these times, and on to others for a moment.

        Args:
            ends: Ends of steps; (n,); s.
            keep: Append the state at the end of each step to the solution.

        Returns:
            How many steps were taken: at least one, and no more than take a moment.

        Raises:
            ConvergenceError: See :meth:`step_to`.

        Example:
            >>> simulation, ends = ub.Simulation(scene, ub.Midpoint()), np.linspace(0, 1, 21)[1:]
            >>> while len(ends):
            ...     ends = ends[simulation.steps_to(ends) :]
            >>> print((1e3 * simulation.displacement(beam.end)).round(1))  # mm, mm, mrad
            [ -0.1 -18.9 -14.3]
            >>> simulation.close()
        """
        ends = np.ascontiguousarray(ends, dtype=np.float64)
        if self.share.alone:
            return self._take(ends, keep=keep)
        self._take(ends[:1])
        if keep:
            self.keep()
        return 1

    def _take(self, ends: Array, *, keep: bool = False) -> int:
        """Take steps in C; end the run where even the smallest part fails."""
        try:
            if self._applies and self.parts == 0:
                self._applies = False
                self._stepper.apply_loads(self, self.t + APPLYING * (float(ends[0]) - self.t))
                self.prediction.c.dt = math.inf  # the next step does not go on as this one did
            taken = self._stepper.take(self, ends, keep=keep)
            self._begun_at = None
            self.warn(self._watch.told(), here=not self.share.alone)
            return taken
        except StepFailed as failure:
            self.give_up(failure, float(self._stepper.c.failed_end))

    def watch(self, parts: Array) -> ExtremesInC | None:
        """Begin to take in extremes after each step in C, or return None if that cannot be."""
        if not self.share.alone:
            return None
        along = ForcesAlongCells(self.grid), self.solution.between
        self._watches.append(one := ExtremesInC(self.fields, self.cell_forces, *along, parts))
        self._stepper.watch(self._watches)
        return one

    def attempt(self, t1: float, end: float | None = None) -> Trial:
        """Solve the next step, to ``t1``; the state changes if :meth:`accept` takes it.

        Args:
            t1: End of the step; s.
            end: End of the whole step where this is a part of one; s.

        Raises:
            StepFailed: There is no equilibrium, or it is too far away.
        """
        return self._stepper.attempt(self, t1, t1 if end is None else end)

    def attempt_along(self, step: Step, guess: Array, border: Any, *, hold: bool = True) -> Trial:
        """Solve the next step with the load factor; see :meth:`Stepper.attempt_along`."""
        return self._stepper.attempt_along(self, step, guess, border, hold=hold)

    def accept(self, trial: Trial) -> None:
        """Go where the latest :meth:`attempt` went."""
        self._stepper.accept(self, trial)
        self._begun_at = None
        self.warn(self._watch.told(), here=not self.share.alone)

    def _require_held(self, q1: Array) -> None:
        """Raise if loads do not hold in an equilibrium what nothing else holds."""
        if self._loose:
            self._loose = require_held(self.equation, self.solver, q1, self._loose)

    def warn(self, found: Iterable[str], *, here: bool = False) -> None:
        """Warn, and note in the solution, of what it does not say; by one process or ``here``."""
        for said in found:
            if said not in self.solution.warnings:
                self.solution.warnings += f"{said}\n"
                if here or self.comm.rank == 0:
                    warn(said)

    @property
    def q_before(self) -> Array:
        """Configuration at the beginning of the last step."""
        return self.prediction.q_before if self._begun_at is None else self._begun_at

    def ask(self) -> None:
        """Ask controllers and friction for forces and limits in the next step, on all processes."""
        self.controllers.ask(self)

    def give_up(self, failure: StepFailed, end: float, advice: str = "") -> NoReturn:
        """End the run where it is, because even the smallest step, to ``end``, failed.

        Raises:
            ConvergenceError: With the solution so far.
        """
        self.leave()
        self.supports.go_back()
        self.end()
        raise no_equilibrium(
            self.equation, self.solver, self.solution, failure, self.q, (self.t, end),
            advice or self.scheme.advice, self._loose,
        ) from failure  # fmt: skip

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

    # -- the state -----------------------------------------------------------------------------

    def moved(self, t: float) -> None:
        """Take note that the state is another one, at the time ``t``."""
        self.t = t
        self._q: Array | None = None  # copied when Python asks for it
        self._now: States | None = None

    @property
    def q(self) -> Array:
        """Configuration at the local degrees of freedom."""
        if self._q is None:
            self._q = self._stepper.q
        return self._q

    @property
    def now(self) -> States:
        """The present state, read as a solution; all processes call it together.

        Before the first step of a dynamic run, reactions are those of the scene at rest.

        Example:
            >>> simulation = ub.Simulation(scene, ub.Midpoint())
            >>> simulation.step_to(0.05)
            >>> print(simulation.now.diagram(beam, points=2).M[:2].round(-3))
            [-5000. -4000.]
            >>> simulation.close()
        """
        if self._now is None:
            columns = self._writer.columns
            size = columns.width
            (row,) = new_rows(1, size + self.solution.begun * self.grid.size)
            self._writer.write(row[:size])
            if self.solution.begun:
                row[size:] = self.share.gather(self.q_before)
                columns = columns.plus(BEFORE, (self.grid.size,))
            self._now = States(self.grid, self.solution, Block(columns, row[None], 1))
            if self._gathers:
                self._now.of_record = partial(self._gathered_forces, self.parts)
        return self._now

    @cached_property
    def _writer(self) -> StateWriter:
        return StateWriter(
            self._stepper.c, self.share, self.ledger, self.supports, self.inelastic,
            self.couplings, self.cell_forces,
        )  # fmt: skip

    @property
    def _gathers(self) -> bool:
        """True if rows have no record that forces of cells follow from."""
        return not self.share.alone or bool(self.cell_forces.c.given)

    def _gathered_forces(self, parts: int, *_: Array) -> Array:
        """``cell_number`` of loops.h of all cells after so many steps, which are the present."""
        if parts != self.parts:
            raise SceneError("section forces of an earlier state: ask for simulation.now again")
        numbers = self.cell_forces(self.q, self.q_before).T
        return np.ascontiguousarray(self.share.gather_cells(numbers).T)

    def keep(self) -> None:
        """Append the state to the solution; all processes call it together."""
        solution, parts = self.solution, self.parts
        follows = not solution.begun or solution.parts_of_last == parts - 1
        if not parts or not follows or self._gathers:
            return self._keep_in(solution)
        self._writer.write(solution.room(self._writer.columns))
        solution.grow()
        solution.count(parts, self.iterations)

    def _keep_in(self, solution: Solution) -> None:
        columns, (_, row) = self._writer.columns, self.now.row(0)
        parts, before = [row[: columns.width]], row[columns.width :]
        unknown = self.parts == 0 and not self._reactions_known
        if self._gathers:
            forces = self.now.numbers(0)
            parts = [row[: columns.at[RECORD].start], forces.ravel()]
            columns = columns.plus(FORCES, forces.shape, without=RECORD)
        at_rest = not len(solution) and np.array_equal(before, self.now.q[0])
        if solution.begun and solution.parts_of_last != self.parts - 1 and not at_rest:
            columns = columns.plus(BEFORE, before.shape)
            parts.append(before)
        solution.append(columns, *parts)
        if unknown:
            columns, row = solution.row(-1)
            columns.of_rows("reactions", row).fill(math.nan)
        solution.count(self.parts, self.iterations)

    def room(self, steps: int) -> Array:
        """Rows of the solution for the states after so many steps; none for what C cannot keep."""
        solution, columns = self.solution, self._writer.columns
        if not self.share.alone or (solution.begun and solution.parts_of_last != self.parts):
            return np.empty((0, columns.width))
        return solution.room(columns, min(steps, 1 + ROOM // columns.width))

    def grow(self, written: int, parts_of_last: int) -> None:
        """Take note of steps whose states C wrote to the :meth:`room`; it had none for the last.

        One that was taken in parts is written anew: it does not begin at the state before it.
        """
        in_parts = self.solution.begun and written > 0 and parts_of_last > 1
        if whole := written - in_parts:
            self.solution.grow(whole)
            self.solution.count(self.parts - in_parts * parts_of_last, self.iterations)
        if in_parts or not written:
            self.keep()

    def _describe(self, solution: Solution) -> None:
        """Tell a solution how section forces follow from what it keeps."""
        solution.between = float(self.scheme.average(0.0, 1.0))
        solution.begun = solution.between < 1 or self.cell_forces.asks_for_before
        solution.of_record = self.cell_forces.of_record if self.share.alone else None
        solution.scheme = self.scheme

    # -- the end, and going on -----------------------------------------------------------------

    @cached_property
    def dolfinx(self) -> DolfinxView:
        """Mesh, functions and forms of this simulation, in the types of DOLFINx."""
        return DolfinxView(self)

    def end(self) -> None:
        """Let the solution have the last state, and what another run that starts there needs."""
        self.settle()
        if self.t not in self.solution.times[-1:]:
            self.keep()
        self.solution.parts, self.solution.iterations = self.parts, self.iterations  # of failures
        self.solution.internal = self._assembly.internal_variables(self.q, self.t)

    def snapshot(self) -> Solution:
        """The state now, as a solution that other runs may start with; all processes call it."""
        self.settle()
        now = Solution(self.scene, self.grid)
        self._describe(now)
        self._keep_in(now)
        now.internal = self._assembly.internal_variables(self.q, self.t)
        return now

    def state(self) -> State:
        """Return the state on which later steps depend; all processes call it together."""
        memory = Memory(self.share)
        self._pass_on(memory)
        return memory.state()

    def resume(self, state: State) -> None:
        """Go on from a :meth:`state`, perhaps of other processes."""
        self._pass_on(Memory(self.share, state))
        self.ledger.begin()
        self.equation.add_state(self.q)
        self._stepper.begin_at(self, self.t, self.q)
        self.moved(self.t)

    def _pass_on(self, memory: Memory) -> None:
        self.t = memory.number("t", self.t)
        self.parts = int(memory.number("parts", self.parts))
        self.solver.remember(memory)
        self._q = memory.at_dofs("q", self.q)
        self.controllers.remember(memory, self.t)
        self.prediction.remember(memory)
        self._begun_at = None
        self.cell_forces.remember(memory, self.q, self.q_before)
        self.ledger.remember(memory)
        for term in self.terms:
            term.remember(memory, self.q)
        self.supports.remember(memory, self.q)
        if self._branch is not None:
            self._branch.remember(memory, self.q)

    def close(self) -> None:
        """Give back what PETSc holds."""
        self.solver.destroy()
