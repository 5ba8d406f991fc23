# SPDX-License-Identifier: MIT
"""Simulation: a scene in motion, one state and the step to the next."""

from __future__ import annotations

from collections.abc import Iterable
from functools import cached_property
from typing import NoReturn

from mpi4py import MPI

import numpy as np

from ufl_beam.arrays import Array, Later, Snapshots
from ufl_beam.discretization.model_warnings import warn_of_jumps
from ufl_beam.discretization.partition import Share
from ufl_beam.discretization.state_io import Memory, Restoring, Saving, State
from ufl_beam.display import Parameter
from ufl_beam.errors import SceneError, StepFailed, require_kind, require_number, shorten, warn
from ufl_beam.mechanics.time_schemes import Scheme, Step, has_inertia
from ufl_beam.model.connectors import Connector
from ufl_beam.model.mesh_options import Mesh
from ufl_beam.model.scene import Scene
from ufl_beam.output.dolfinx_view import DolfinxView
from ufl_beam.output.state_view import StateView
from ufl_beam.output.watches import Watch
from ufl_beam.parallel import Agreement, communicator
from ufl_beam.simulation.assembly import assemble
from ufl_beam.simulation.diagnosis import no_equilibrium, require_held
from ufl_beam.simulation.initial_state import checked_grid, initial_state, last_forces, mesh_of
from ufl_beam.simulation.prediction import Prediction
from ufl_beam.simulation.replicas import Copies, sharing
from ufl_beam.simulation.solution import Solution
from ufl_beam.simulation.stepper import APPLYING, Extras, Stepper, Trial, begins_loaded
from ufl_beam.simulation.watches import ForceWatch
from ufl_beam.solvers.newton import Border
from ufl_beam.solvers.newton_options import Newton, checked_newton, require_plain


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
        q: Configuration at the local degrees of freedom.
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
        self.loads, self.supports, self._has_inelastic = parts.loads, parts.supports, parts.yields
        self.equation, self.terms = parts.equation, parts.equation.terms

        self.t, self.parts, self.q = t0, 0, q[share.dofs]
        self._begun_at: Array | None = None  # of the state before the first step
        weights, in_motion = self.equation.weights, has_inertia(scheme)
        self.prediction = Prediction(share, self.q, weights, in_motion=in_motion)
        self._continues = start is not None
        loaded: list[Array] = []
        same = start is not None and start.scene is scene and bool(start.times[-1] == t0)
        goes_on = same and "reactions" in internal and start is not None and not len(start.v)
        if self._continues or (has_inertia(scheme) and scheme.kept):
            loaded = together(parts.carry_on, t0, self.q, internal if same else None)
        if start is not None:
            parts.take_over(self.q, t0, internal, same=same)
        self.equation.start(self.q)
        self.equation.add_state(self.q)
        for coupling in parts.couplings if start is None else ():
            coupling.put_forces(self.q)
        if parts.inertia is not None:
            self.inertia = parts.inertia
            if scene.links or scene.supports:
                together(warn_of_jumps, grid, t0, q, self.connections()[:, 0])
        self._branch = parts.static_path(scheme, self.q, t0, loaded, together, goes_on=goes_on)
        self.reactions_known = self._branch is not None
        self.cell_forces, self.between = parts.cell_forces, float(scheme.average(0.0, 1.0))
        if not self.reactions_known:
            together(self.equation.forces_at_rest, scheme, self.q)
        goes_on = goes_on or not self.reactions_known
        forces, before = last_forces(grid, share, scheme, start) if goes_on else (None, None)
        if forces is not None or not self.reactions_known:
            self.cell_forces.begin(forces)
            self._begun_at = before
        self.begun = self.between < 1 or self.cell_forces.asks_for_before

        self.solution, self._end = kind(scene, grid), np.zeros(1)
        self._watches: list[Watch] = []
        self._describe(self.solution)
        self._watch = ForceWatch(self.couplings, self.controllers, scene.size)
        extras = Extras(
            self.ask if self.controllers.asks else None, self.controllers.stops,
            self._require_held if self._loose else None,
            None if self._copies is None else self._copies.note, self._watch.c,
        )  # fmt: skip
        self._applies = fresh and begins_loaded(scene, scheme, t0)
        self._stepper = Stepper(
            scheme, self.equation, newton, self.ledger, parts.inertia, self._branch,
            self.support_dofs, self.cell_forces, self.begun, together, extras,
        )  # fmt: skip
        self.solver = self._stepper.solver
        self._stepper.begin_at(self)

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
                self.prediction.forget()
            taken = self._stepper.take(self, ends, keep=keep)
            self._begun_at = None
            self.warn(self._watch.told(), here=not self.share.alone)
            return taken
        except StepFailed as failure:
            self.give_up(failure, float(self._stepper.c.failed_end))

    def watch(self, parts: Array) -> Watch | None:
        """Begin to take in extremes after each step in C, or return None if that cannot be."""
        if not self.share.alone:
            return None
        self._watches.append(one := Watch(self.fields, self.cell_forces, self._along, parts))
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

    def attempt_along(
        self, step: Step, guess: Array, border: Border, *, hold: bool = True
    ) -> Trial:
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
    def q_before(self) -> Array:  # type: ignore[override]
        """Configuration at the beginning of the last step."""
        return self.prediction.q_before if self._begun_at is None else self._begun_at

    @property
    def asked(self) -> dict[Connector, float]:
        """Forces of controllers, and limits of friction; N or N m."""
        return self.controllers.values

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

    def _describe(self, solution: Solution) -> None:
        """Tell a solution how section forces follow from what it keeps."""
        solution.between = self.between
        solution.find_cell_forces(self.scheme, self.cell_forces if self.share.alone else None)

    # -- the end, and going on -----------------------------------------------------------------

    @property
    def parameter(self) -> Parameter:
        """Time, or the load factor of a path."""
        return self.solution.parameter

    @cached_property
    def dolfinx(self) -> DolfinxView:
        """Mesh, functions and forms of this simulation, in the types of DOLFINx."""
        return DolfinxView(self)

    def keep(self) -> None:
        """Append the state to the solution; all processes call it together."""
        if self.share.alone and (self.parts or self.reactions_known):
            now: Later | Snapshots = self._stepper.now(self)
        else:
            now = Snapshots.of(self.gather())
        self.solution.keep(now, self.parts, self.iterations)

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
        now.keep(Snapshots.of(self.gather()), self.parts, self.iterations)
        now.internal = self._assembly.internal_variables(self.q, self.t)
        return now

    def state(self) -> State:
        """Return the state on which later steps depend; all processes call it together."""
        memory = Saving(self.share)
        self._pass_on(memory)
        return memory.state()

    def resume(self, state: State) -> None:
        """Go on from a :meth:`state`, perhaps of other processes."""
        self._pass_on(Restoring(self.share, state))
        self.ledger.begin()
        self.equation.add_state(self.q)
        self._stepper.begin_at(self)

    def _pass_on(self, memory: Memory) -> None:
        self.t = memory.number("t", self.t)
        self.parts = int(memory.number("parts", self.parts))
        self.solver.remember(memory)
        self.q = memory.at_dofs("q", self.q)
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
