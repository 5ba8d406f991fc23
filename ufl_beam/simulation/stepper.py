# SPDX-License-Identifier: MIT
"""Steps of a scene, which steps.c solves, checks and accepts, or divides if they fail.

Some static schemes satisfy equilibrium inside a step.  After large nodal rotations the end of the
step is then out of equilibrium.  So with these schemes, loads that already act at the beginning of
a run grow during the first eighth of the first step, in substeps with small rotations.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any, NamedTuple

from mpi4py import MPI

import numpy as np

from ufl_beam.arrays import Array
from ufl_beam.compiled.c_library import doubles, ffi, fill, lib, struct
from ufl_beam.discretization.partition import Subdomain
from ufl_beam.discretization.state_io import Archive
from ufl_beam.errors import ModelError, StepFailed
from ufl_beam.mechanics.time_scheme import Step, acts_at_end, stages_of, with_half_tangents
from ufl_beam.model.bodies import base_of
from ufl_beam.model.connector_laws import PrescribedMotion
from ufl_beam.model.constraint_checks import INSTEAD, describe_motions
from ufl_beam.output.recorder import StateView
from ufl_beam.output.states import States
from ufl_beam.parallel import Agreement, ProcessComparison
from ufl_beam.simulation.controllers import ForceWatch
from ufl_beam.simulation.solution import Solution
from ufl_beam.simulation.step_equation import StaticPath, StepEquation
from ufl_beam.solvers.newton import Solver
from ufl_beam.solvers.newton_options import Newton
from ufl_beam.solvers.null_vectors import soft_motions

# -- prediction ------------------------------------------------------------------------------------


class Prediction:
    """Initial guess of a step, extrapolated from the last steps.

    The guess continues with the velocity of the last step.  In dynamics (``in_motion``), after
    three steps of equal length, a fraction of the last second difference of the configuration is
    added.  The fraction measures how well the last two second differences agree: it is nearly 1 in
    smooth motion, and 0 if their scalar product is negative or steps do not resolve the motion.

    Args:
        weights: Weights of residuals, see :class:`StepEquation`.

    Attributes:
        c: ``prediction`` of loops.h; C writes to it when a step is accepted.
    """

    def __init__(
        self, subdomain: Subdomain, q: Array, weights: Array, *, in_motion: bool, several: bool
    ) -> None:
        self._subdomain, self._in_motion = subdomain, in_motion
        self.c = struct("prediction", size=subdomain.size, dt=math.inf)
        self._q_before = q.copy()
        fill(self.c, q_before=self._q_before)
        self._past = np.zeros((several * lib.MOST_KNOWN_ENDS, subdomain.size))
        if several:
            fill(self.c, past=self._past)
            self.c.place = list(range(lib.MOST_KNOWN_ENDS))
        if in_motion:
            self._second = np.zeros(subdomain.size)
            size = {"scene": subdomain.numbering.scene.size, "unknowns": subdomain.numbering.size}
            fill(self.c, second=self._second, weight=weights, **size)

    def carry_on(self, archive: Archive) -> None:
        """Restore the data of a run that ended in the present state, if it has all of them."""
        needed = ["last dt"] + ["second difference"] * self._in_motion
        if all(map(archive.has, needed + ["known ends of stages"] * bool(len(self._past)))):
            self.save_or_restore(archive)

    def save_or_restore(self, archive: Archive) -> None:
        """Save or restore the data, in the numbering of the scene; see state_io.py."""
        self.c.dt = archive.number("last dt", self.c.dt)
        bytes_now = ffi.buffer(self.c.q_before, 8 * self._subdomain.size)
        q_before = archive.at_dofs("q before", np.frombuffer(bytes_now).copy())
        ffi.memmove(self.c.q_before, doubles(q_before), q_before.nbytes)
        if self._in_motion:
            self.c.equal = int(archive.number("equal steps", self.c.equal))
            self.c.repeated = archive.number("part that repeats itself", self.c.repeated)
            self.c.now = archive.number("square of the second difference", self.c.now)
            self._second[:] = archive.at_dofs("second difference", self._second)
        if len(self._past):
            known = min(self.c.known, lib.POINTS_OF_GUESS)
            self.c.known = int(archive.number("known ends of stages", known))
            for k in range(self.c.known):
                self.c.time[k] = archive.number(f"time of end {k}", self.c.time[k])
                past = self._past[self.c.place[k]]
                past[:] = archive.at_dofs(f"q at end {k}", past)


# -- check of static steps -------------------------------------------------------------------------

LARGEST_ROTATION = 0.75 * math.pi
"""Largest rotation of a node in a step; rad.  Algorithmic strains are valid up to π.

In motion, schemes without such strains limit the difference from the rotation with the velocity
before the step: Newton's method may find a solution to which no motion leads.
"""

LARGEST_IN_SPACE = 2 * math.tan(math.pi / 3)
"""Length of the Cayley vector of a rotation by 120°, the largest one of a node in a step in space.
Newton's method may find steps whose vectors are without bound, close to 180°."""

LARGEST_RIGID_ROTATION = 0.5
"""Largest rotation of a part that a step turns without strain, in statics and if forces work on Δψ.

A linkage has several assemblies, which no energy tells apart.  In longer steps Newton's method may
find another one than the assembly to which the motion leads; docs/steps.md has measurements.
"""

LEAST_AT_REST, LEAST_IN_MOTION = 2, 1
"""Least numbers of Newton iterations in statics and in dynamics.  Newton's method stops earlier
only if the residual is far below the tolerance.

Near buckling, a load hardly larger than the tolerance moves a column far.  In dynamics the inertia
of the column prevents this.
"""

APPLYING_ROTATION = 0.02
"""Largest rotation of a node in a substep while loads are applied; rad.

The relative error of a moment in a substep is a quarter of the square of this angle, about 1e-4.
"""

FREE_STIFFNESS = 1e-3
"""Loads count as resisting a motion without strain only if the stiffness against it exceeds this
fraction of (size of the forces) · (size of the scene); N m.  The motion is measured as an angle,
and the stiffness as a moment per angle.  The stiffness by a weight or a tension is typically some
tenths of this product."""

HELD = 0.01  # least change of a constraint by a motion that it holds, by its largest change

SHORT_SUBSTEP = 512
"""A substep of at most 1/512 of the time in which loads are applied may exceed APPLYING_ROTATION.
If nodes rotate that far in so short a time, the scene jumps, and shorter substeps do not help."""

MOST_SUBSTEPS: int = lib.MOST_SUBSTEPS
"""Largest number of substeps of a step."""


def rigid_parts(subdomain: Subdomain) -> Any:
    """Create ``rigid_parts`` of loops.h: beams, bodies, and rods of fixed length."""
    numbering, connectors = subdomain.numbering, subdomain.numbering.scene.all_connectors
    rotations = subdomain.cell_dofs[:, -(numbering.mesh.degree + 1) :]
    beams = np.repeat(numbering.beam_of_cell[subdomain.cells], rotations.shape[1])
    pairs = np.unique(np.column_stack([beams, rotations.ravel()]), axis=0)
    last = np.flatnonzero(np.diff(pairs[:, 0], append=-1)) + 1
    bodies = subdomain.body_dofs[:, 2]
    here = [connectors[i] for i in subdomain.connectors]
    rods = [k for k, c in enumerate(here) if c.stretches and isinstance(c.law, PrescribedMotion)]
    geometry = [(*here[k].arms[0], *here[k].arms[1], *here[k].apart) for k in rods]
    return struct(
        "rigid_parts", members=len(last) + len(bodies), rods=len(rods),
        end=np.append(last, len(pairs) + 1 + np.arange(len(bodies))).astype(np.int32),
        rotation=np.append(pairs[:, 1], bodies).astype(np.int32),
        dof=subdomain.connector_dofs[rods, :6].astype(np.int32),
        geometry=np.array(geometry).ravel(),
        largest_turn=LARGEST_RIGID_ROTATION,
    )  # fmt: skip


class Trial(NamedTuple):
    """Solved step that is not yet accepted, and the configuration ``q1`` at its end.

    Forces do work on the nodal step ``s``, see :func:`~ufl_beam.mechanics.time_scheme.nodal_step`.
    """

    step: Step
    q1: Array
    s: Array


class Stepper(StateView):
    """Steps of a scene in C, see steps.c: the base class of :class:`Simulation`.

    C holds the state.  After each call of C, Python has the time, configuration, velocities,
    reactions and ledger of the new state.

    Args:
        comm: Processes of the run.
        newton: Tolerances and options of Newton's method.
        t: Time of the initial state; s.
        q: Local configuration of the initial state.
        path: Checks of static steps; None in dynamics.
        free_motion: Description of a motion that only loads may resist; empty if there is none.

    Attributes:
        t: Time; s.
        substeps: Number of substeps so far; an undivided step counts as one substep.
        equation: Equation of a step, with its ``ledger``, ``controllers`` and terms.
        solver: Newton's method.
        prediction: Data of the last steps from which the initial guess is extrapolated.
        solution: Solution so far.
        time_loop: ``time_loop`` of loops.h.
        comparison: Comparison of the processes if each of them computes the scene as a whole.
        together: Caller of functions on all processes that share the scene; if a function raises
            on one process, it raises on all.
        may_be_free: True if statics may leave motions free that nothing holds.
    """

    may_be_free = False

    def __init__(
        self, comm: MPI.Intracomm, equation: StepEquation, newton: Newton, t: float, q: Array,
        path: StaticPath | None, solution: Solution, together: Agreement, free_motion: str,
    ) -> None:  # fmt: skip
        subdomain, scheme, ledger = equation.subdomain, equation.scheme, equation.ledger
        self.comm, self.subdomain, self.numbering = comm, subdomain, subdomain.numbering
        self.scene = subdomain.numbering.scene
        self.equation, self.scheme, self.ledger, self.solution = equation, scheme, ledger, solution
        self.newton = newton
        self.together, self._path, self._free_motion = together, path, free_motion
        self.comparison, self.parameter = ProcessComparison(comm, subdomain), solution.parameter
        self.fields, self.terms, self.supports = equation.fields, equation.terms, equation.supports
        self.beams, self.inelastic = equation.beams, equation.inelastic
        self.connector_terms, self.loads = equation.connector_terms, equation.loads
        self.controllers, self.cell_forces = equation.controllers, equation.cell_forces
        if equation.inertia is not None:
            self.inertia = equation.inertia
        in_motion, phases = equation.inertia is not None, equation.phases
        self._begun_at: Array | None = None  # `q_before` of the initial state
        self.substeps = 0
        stages = stages_of(scheme)
        self.prediction = Prediction(
            subdomain, q, equation.weights, in_motion=in_motion, several=len(stages) > 1
        )

        again = [phase.again for phase in phases if phase.again is not None]
        self._again = equation.c.again.call = ffi.new("phase_call[]", again)
        equation.c.again.number = len(again)
        least = LEAST_IN_MOTION if in_motion else LEAST_AT_REST
        self.solver = solver = Solver(subdomain, equation, newton, least)
        rotations = subdomain.rotations
        half_tangents = with_half_tangents(scheme, subdomain.plane_rotations)
        multipliers = subdomain.multipliers.astype(np.int32)
        opens = [phase.opens for phase in phases if phase.opens is not None]
        places = ffi.new("element_block *[]", opens)
        admits = [phase.admits for phase in phases if phase.admits is not None]
        s = np.zeros(subdomain.size) if equation.supports.turned else solver.change
        largest_turn = LARGEST_IN_SPACE if self.scene.in_space else LARGEST_ROTATION
        self.time_loop = fill(
            ffi.new("time_loop *"),
            equation=equation.c, size=subdomain.size, t=t, q=q.copy(), x=solver.unknowns, s=s,
            prediction=self.prediction.c,
            guess=np.zeros(subdomain.size), proportional=not in_motion,
            load_weight=scheme.load_weight, at=1.0 if in_motion else scheme.load_weight,
            largest_turn=largest_turn if scheme.limits_rotation or in_motion else math.inf,
            turns_from_velocities=in_motion and not scheme.limits_rotation,
            rotations=len(rotations), rotation=rotations, axes=3 if self.scene.in_space else 1,
            half_tangents=len(half_tangents), half_tangent=half_tangents,
            multipliers=len(multipliers), multiplier=multipliers,
            supports=equation.supports.in_c(equation.callbacks),
            states=len(ledger.state), state=ledger.state.amounts, cell_forces=self.cell_forces.c,
            opens=int(subdomain.largest(float(bool(opens)))), places=len(opens), place=places,
            admissions=len(admits), admission=ffi.new("admission_call[]", admits),
            checks_laws=int(subdomain.largest(float(bool(admits)))),
            applying_turn=APPLYING_ROTATION, short_part=SHORT_SUBSTEP,
            stages=len(stages), stage=np.cumsum(stages),
            begun=np.zeros((len(stages) - 1, subdomain.size)), stage_begin=np.zeros(len(stages)),
        )  # fmt: skip
        if self.scene.in_space and acts_at_end(scheme):
            spaces: Array = np.zeros((4, subdomain.size))
            base, turning, turned_by, to = spaces
            fill(equation.c, rotations=len(rotations), rotation=rotations, base=base,
                 turning=turning, turned_by=turned_by, to=to)  # fmt: skip
        if self.time_loop.opens:
            fill(self.time_loop, found=np.zeros(subdomain.size))
        if equation.supports.turned:
            fill(self.time_loop, x=np.zeros(subdomain.size))
        if path is not None:
            fill(self.time_loop, path=path.c)
        if not (scheme.half_tangents and in_motion) and not self.scene.in_space:
            fill(self.time_loop, parts=rigid_parts(subdomain))
        self._alive: list[Any] = [opens]
        self._watches = list[Any]()  # extremes that C updates after each step
        self._force_watch = ForceWatch(equation.connector_terms, self.controllers, self.scene.size)
        if self._force_watch.c is not None:
            fill(self.time_loop, forces=self._force_watch.c)
        self._add_callbacks()
        self._moved(t)

    def _add_callbacks(self) -> None:
        """Add functions of Python to the phases of the terms in a step.

        Handles of Python functions are assigned without `fill`, which would store references to the
        functions, and so to this object.
        """
        c, callbacks, controllers = self.time_loop, self.equation.callbacks, self.controllers
        loops = {
            name: [x for phases in self.equation.phases for x in getattr(phases, name)]
            for name in ("begin", "accept", "add_state")
        }
        if self.equation.inertia is not None:
            fill(c, rates=self.inertia.c, prepare=lib.run_in_python)
            c.handle = callbacks.handle(self._prepare)
        if controllers.sampled:
            c.stop = lib.time_in_python
            c.stops = callbacks.handle(lambda t: controllers.next_sample(c.t, t))
        # Calls that may raise come first, before any loop of C has accepted the step.
        mine = [call for call in loops["accept"] if call[0] == lib.phase_in_python]
        if self._free_motion:
            mine.insert(0, callbacks.phase(self._require_stiffness))
        loops["accept"] = mine + [x for x in loops["accept"] if x[0] != lib.phase_in_python]
        if controllers.needs_evaluation:
            loops["begin"].insert(0, callbacks.phase(self._evaluate_controllers))
        if self.comparison.several:
            record = self.comparison.compare
            took = callbacks.phase(lambda step, q1, s: record(step.t1, self._copy(q1)))
            loops["add_state"].append(took)
        for name, calls in loops.items():
            place, in_c = getattr(c, name), ffi.new("phase_call[]", calls)
            self._alive += [in_c, calls]
            place.number, place.call = len(calls), in_c

    # -- callbacks -----------------------------------------------------------------------------

    def _evaluate_controllers(self, *_: Any) -> None:
        """Evaluate controllers and limits of friction in the present state of C."""
        self._moved(self.time_loop.t)
        self.together(self.controllers.evaluate, self)

    def _prepare(self) -> None:
        """Take further rates, reactions and forces of connectors from a short trial step.

        The first step of schemes with accelerations needs them.  The state does not advance.
        """
        c = self.time_loop
        _, *more = self.inertia.after(self._copy(c.s), c.step.dt)
        self.inertia.keep(*more)
        self.supports.commit()
        q1 = self._copy(c.x)
        for group in self.connector_terms:
            group.commit(q1)
        for load in self.equation.loads:
            load.prepare(q1)

    def _require_stiffness(self, step: Any, q1: Any, s: Any) -> None:
        """Raise if the loads do not resist a motion that only loads can resist.

        If they do, the tangent stays regular without the artificial stiffness that the solver adds
        against zero-energy modes.  All processes call the function together.
        """
        if not self._free_motion:
            return
        equation, newton = self.equation, self.solver
        newton.forget_zero_modes()
        if newton.scale() == 0.0:  # of a path without loads yet
            return
        if equation.evaluate(self._copy(q1)) and (found := soft_motions(equation)) is not None:
            K, free, _, vectors = found
            x, scales = vectors[:, -1], self.numbering.scales[free]
            motion = np.abs(x * scales).max()
            left, moves = K @ x, scales > 0
            forces = np.linalg.norm(left[moves] / scales[moves])
            most = abs(K)[:, moves] @ (motion / scales[moves])
            held = np.any((np.abs(left) > HELD * most)[~moves])  # as by friction that sticks
            if not held and forces <= FREE_STIFFNESS * newton.scale() * self.scene.size * motion:
                if self.may_be_free:
                    return
                said = describe_motions(self.scene, self._of_members(vectors, free))
                raise ModelError(f"{said}The loads do not hold it either. {INSTEAD}")
        self._free_motion = ""

    def _of_members(self, vectors: Array, free: Array) -> Array:
        """Return (u, v, size ψ) at ``base_of`` each beam and body; ``vectors`` are at ``free``."""
        x = np.zeros((self.numbering.size, vectors.shape[1]))
        x[free] = vectors
        dofs = [self.numbering.node(base_of(part)) for part in self.scene.parts]
        d = self.numbering.displacements
        units = np.where(np.arange(self.numbering.width) < d, 1.0, self.scene.size)
        motions: Array = x[np.array(dofs)] * units[:, None]
        return motions.reshape(-1, x.shape[1])

    # -- steps ---------------------------------------------------------------------------------

    def attempt(self, t1: float, end: float | None = None) -> Trial:
        """Solve the next step, to ``t1``; the state changes in :meth:`accept`.

        Args:
            t1: End of the step; s.
            end: End of the whole step if this is a substep; s.

        Raises:
            StepFailed: No equilibrium was found, or the checks of a step reject it.
        """
        with self._in_c():
            solved = lib.attempt_step(self.time_loop, t1, t1 if end is None else end)
        return self._trial(solved)

    def attempt_along(self, step: Step, guess: Array, border: Any, *, hold: bool = True) -> Trial:
        """Solve for a step and, with a ``border``, its load factor: the time at its end.

        ``step`` has the times of the initial guess.  The guess is in the axes of supports.  With
        ``hold``, a hinge or spring that did not open further in the last step keeps its opening if
        an equilibrium exists in which its force is within the limit; see material_points.py.
        """
        c = self.time_loop
        self.solver.follow(border)
        with self._in_c():
            trial = c.step
            trial.t0, trial.t1, trial.dt = step.t0, step.t1, step.dt
            trial.load_time, trial.motion_time = step.load_time, step.motion_time
            trial.fraction, trial.at = step.fraction, step.at
            trial.ratio, trial.q0, trial.q_before = 0.0, c.q, c.prediction.q_before
            ffi.memmove(c.guess, doubles(guess), guess.nbytes)
            solved = lib.solve_begun_step(c, hold)
        self.solver.follow(None)
        return self._trial(solved)

    def take_back(self) -> None:
        """Return to the state before the latest :meth:`attempt`, if its step has several stages."""
        if self.time_loop.taken:
            with self._in_c():
                lib.take_back(self.time_loop)

    def stage_end(self, index: int) -> Array:
        """Return the configuration after a stage of the latest :meth:`attempt`; not the last."""
        size = self.subdomain.size
        end = np.frombuffer(ffi.buffer(self.time_loop.begun + (index + 1) * size, 8 * size)).copy()
        return self.supports.in_plane(end)

    def accept(self, trial: Trial) -> None:
        """Accept the step of the latest :meth:`attempt` or :meth:`attempt_along`."""
        self.time_loop.step.t1 = trial.step.t1
        with self._in_c():
            accepted = lib.accept_step(self.time_loop)
        if not accepted:
            self._fail()

    def _trial(self, solved: int) -> Trial:
        if not solved:
            self._fail()
        c = self.time_loop
        q0, q1, s, q_before = map(self._copy, (c.q, c.x, c.s, c.step.q_before))
        step = c.step
        instants = step.load_time, step.motion_time, step.fraction, step.at
        return Trial(Step(step.t0, step.t1, q0, *instants, q_before, step.ratio), q1, s)

    @contextmanager
    def _in_c(self) -> Iterator[None]:
        """Context in which C takes steps; at its end Python gets the new state."""
        c, callbacks = self.time_loop, self.equation.callbacks
        callbacks.require_open()
        c.substeps, c.failure, callbacks.error = 0, lib.SUCCEEDS, None
        try:
            yield
        except SystemError as error:
            # An exception in a preconditioner written in Python is still set when C returns.
            raise error.__cause__ or error from None
        finally:
            self._moved(c.t)
            self.substeps += c.substeps
            if c.substeps:
                self._begun_at = None
            for extremes in self._watches:
                extremes.seen = self.substeps
        self.warn(self._force_watch.told(), local=not self.subdomain.alone)

    def _fail(self) -> None:
        """Raise the error of the latest step; all processes call it together."""
        c, callbacks = self.time_loop, self.equation.callbacks
        error, callbacks.error = callbacks.error, None
        if not self.equation.c.raised:  # Newton's method discarded the iterate that raised it
            error = None
        failure, c.failure = c.failure, lib.SUCCEEDS
        if failure == lib.RAISED:
            self.together.synchronize(error)
        if failure == lib.NO_EQUILIBRIUM:
            self.together.synchronize(self.solver.error() or error)
            raise self.solver.failure()
        if failure == lib.TURNS_TOO_FAR and c.turn < 0:
            driven = " or ".join(str(x) for x in self.supports.about if 5 in x.moving)
            raise StepFailed(
                f"{driven} turns by {math.degrees(-c.turn):.0f}° in the step, more than the limit "
                f"of 135°; with dt = {math.pi / 3 / -c.turn * c.step.dt:.1e} s it would turn by "
                "about 60°"
            )
        if failure == lib.TURNS_TOO_FAR and self.scene.in_space:
            rotations = self.numbering.rotations
            vectors = self.subdomain.gather(self._copy(c.s))[rotations].reshape(-1, 3)
            largest = int(rotations[3 * int(np.argmax(np.hypot.reduce(vectors.T)))])
            angle, wanted = 2 * math.atan(c.turn / 2), 2 * math.tan(math.pi / 6)
            raise StepFailed(
                f"{self.numbering.describe(largest).split(' of ', 1)[1]} turns by "
                f"{math.degrees(angle):.0f}° in the step, more than the limit of 120°; with dt = "
                f"{wanted / c.turn * c.step.dt:.1e} s it would turn by about 60°"
            )
        if failure == lib.TURNS_TOO_FAR:
            raise StepFailed(
                f"a node turns by {c.turn:.3g} rad in the step"
                f"{' beyond its velocity' * c.turns_from_velocities}, more than the limit of "
                "0.75 π; reduce dt"
            )
        if failure == lib.PART_TURNS_TOO_FAR:
            raise StepFailed(
                f"a rigid part turns by {c.parts.turn:.3g} rad in the step, more than the limit of "
                f"{LARGEST_RIGID_ROTATION:g}: the mechanism may leap to another assembly; reduce dt"
            )
        if failure == lib.NO_DERIVATIVE:
            at = f"{c.failed_end:.9g} s"
            reason = "the tangent is singular" + ", or a stage has failed" * (c.stages > 1)
            raise ModelError(f"the step to t = {at} has no derivative: {reason}; use a smaller dt")
        if failure == lib.APPLIED_TOO_FAST:
            raise StepFailed("a node turns too far while the loads at the beginning are applied")
        if failure == lib.GIVES_ENERGY:
            q1 = self._copy(c.x)

            def require() -> None:
                for term in self.equation.inner:
                    if term.must_dissipate:
                        term.require_dissipation(q1)

            self.together(require)
        if self._path is not None:
            raise self._path.failure(failure == lib.LEAVES_MECHANISM)
        raise StepFailed("the step cannot be trusted")

    def random_work(self, q: Array, s: Array) -> float:
        """Return the expected work of round-off forces in a step ``s``; J."""
        return self.solver.random_work(q, s)

    # -- the state -----------------------------------------------------------------------------

    def _moved(self, t: float) -> None:
        """Set the time ``t`` of a new state, and drop cached data of the old state."""
        self.t = t
        self._q: Array | None = None  # copied when it is read
        self._now: States | None = None

    @property
    def q(self) -> Array:
        """Configuration at the local degrees of freedom; (size,); m, rad."""
        if self._q is None:
            self._q = self._copy(self.time_loop.q)
        return self._q

    @property
    def q_before(self) -> Array:
        """Configuration at the beginning of the last step; (size,); m, rad."""
        if self._begun_at is not None and self.cell_forces.c.initial:  # nothing accepted since
            return self._begun_at
        return self._copy(self.time_loop.prediction.q_before)

    def _copy(self, values: Any) -> Array:
        return np.frombuffer(ffi.buffer(values, 8 * self.subdomain.size)).copy()
