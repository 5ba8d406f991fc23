# SPDX-License-Identifier: MIT
"""Run from beginning to end: steps, stored states, output files and checkpoints."""

from __future__ import annotations

import math
import sys
import time
from collections.abc import Callable, Iterator, Sequence
from contextlib import ExitStack, contextmanager
from contextvars import ContextVar
from itertools import chain
from typing import Any

from mpi4py import MPI

import numpy as np

from ufl_beam.discretization.model_warnings import warn_of_loads, warn_of_tables
from ufl_beam.errors import (
    ArgumentError,
    require_count,
    require_function,
    require_kind,
    require_number,
    require_switch,
    shorten,
    warn,
)
from ufl_beam.mechanics.time_scheme import Scheme, has_inertia
from ufl_beam.model.beams import Mesh
from ufl_beam.model.connector_laws import Controller
from ufl_beam.model.constraint_checks import parts_that_switch
from ufl_beam.model.scene import Scene
from ufl_beam.output.output_files import Output, reserved
from ufl_beam.output.recorder import Recorder, checked_recorders
from ufl_beam.output.serialization import Description
from ufl_beam.parallel import communicator, print_once, progress_bar
from ufl_beam.simulation.checkpoint import Checkpoint, CheckpointFile, checksum_at
from ufl_beam.simulation.diagnosis import (
    LEDGER_TOLERANCE,
    LedgerWatch,
    warn_of_instability,
    warn_of_rayleigh,
    work_of_round_off,
)
from ufl_beam.simulation.initial_state import StateOf, chosen_state, mesh_of, require_scheme
from ufl_beam.simulation.reference_run import ReferenceInPlane, ReferenceInSpace
from ufl_beam.simulation.simulation import Simulation
from ufl_beam.simulation.solution import Opened, Solution
from ufl_beam.simulation.step_lengths import (
    Adaptive,
    AdaptiveSteps,
    EqualSteps,
    JudgedSteps,
    Pilot,
    step_count,
)
from ufl_beam.simulation.stepper import MOST_SUBSTEPS
from ufl_beam.solvers.newton_options import Newton, require_plain

interrupt: ContextVar[Callable[[], None]] = ContextVar("interrupt", default=lambda: None)
"""Function that runs call between calls of C; it raises an exception to end the run."""


def simulate(
    scene: Scene,
    scheme: Scheme,
    *,
    t: tuple[float, float],
    dt: float | Adaptive,
    record: Sequence[Recorder] | Recorder = (),
    every: int = 1,
    max_states: int = sys.maxsize,
    start: StateOf | None = None,
    until: Callable[[Simulation], bool] | None = None,
    newton: Newton | None = None,
    mesh: Mesh | None = None,
    checkpoint: Checkpoint | None = None,
    progress: bool = True,
    comm: MPI.Intracomm | None = None,
) -> Solution:
    """Simulate the motion of a scene in time, or its equilibria under growing loads.

    Args:
        scene: Model.
        scheme: :class:`Static`, :class:`EnergyMomentum` or another scheme, see docs/schemes.md.
        t: Beginning and end; s.  In statics time is the load parameter.
        dt: Time step; s.  All steps are a little shorter if the run is no multiple of ``dt``.  A
            step without convergence is divided into substeps.  :class:`Adaptive` steps are as long
            as a tolerance allows.
        record: Recorders of files or results, such as :class:`XDMF` and :class:`History`.
        every: Number of steps between stored states; the last state is always stored.
        max_states: Largest number of stored states, besides the initial and the last state.  If a
            run has more, every other state is deleted and ``every`` is doubled.
        start: Solution whose last state is the initial state, with the same beams, or
            ``(solution, n)`` for its n-th stored state, if no law has internal variables.  Joints
            may be removed, or added where places coincide.
        until: Function that ends the run after the first step for which it is true, as in
            ``until=lambda now: now.displacement(tip)[1] < -0.5``; by default the run ends at t[1].
        newton: Tolerances and options of Newton's method.
        mesh: Discretization; by default as in ``start``, or the cells of the beams.
        checkpoint: File from which the run continues if the script is run again.
        progress: Show a progress bar in a terminal or notebook.
        comm: Processes that share the scene; by default all, or in a :func:`study` this process
            alone.  A small scene is not divided: each process computes all of it.

    Returns:
        The motion, the forces and the energy ledger.

    Raises:
        ArgumentError: An argument or the scene is wrong; :class:`ModelError` is a kind of it.
        ConvergenceError: Even the smallest step failed; ``solution`` has the results so far.

    Example:
        >>> run = ub.simulate(scene, ub.EnergyMomentum(), t=(0, 1), dt=0.05)
        >>> print((1e3 * run.displacement(beam.end)[-1]).round(1))  # mm, mm, mrad
        [ -0.1 -18.9 -14.3]
    """
    comm = communicator(comm, "simulate: comm")
    require_switch(progress, "simulate: progress")
    t0, t1 = require_times(t)
    require_scheme(scheme, "scheme")
    if not isinstance(dt, Adaptive):
        require_number(dt, "simulate: dt", positive=True)
        least = MOST_SUBSTEPS * math.ulp(max(abs(t0), abs(t1)))
        if dt < least:
            raise ArgumentError(
                f"simulate: dt = {dt:g} s is too small: steps from t = {t0:g} to {t1:g} s, and "
                f"substeps of them, exceed round-off from dt = {least:.1e} s on; use a larger dt, "
                "or begin at 0"
            )
    elif not has_inertia(scheme):
        raise ArgumentError(
            "simulate: dt = Adaptive(...) estimates the error of accelerations, and a static "
            "scheme has none; give a number"
        )
    elif scheme.lost_fraction:
        raise ArgumentError(
            f"simulate: dt = Adaptive(...) with {scheme!r}: in steps that grow its dissipation is "
            "of first order, whatever the tolerance is; give a number, or the scheme "
            "EnergyMomentum(alpha, beta) or GeneralizedAlpha(rho_inf)"
        )
    if isinstance(scene, Scene):
        steps = -1 if isinstance(dt, Adaptive) else step_count(t1 - t0, dt)
        ends = np.linspace(t0, t1, steps + 1, dtype=np.float64)
        warn_of_loads(scene, (t0, t1), ends)
        if has_inertia(scheme) and len(ends):
            warn_of_tables(scene, ends)
    require_count(every, "simulate: every")
    require_count(max_states, "simulate: max_states")
    start = chosen_state(start, "start")
    if until is not None:
        require_function(until, "simulate: until", "the Simulation")
    if checkpoint is not None:
        require_kind(checkpoint, Checkpoint, "simulate: checkpoint")
    files = [] if checkpoint is None else [("checkpoint", checkpoint.files)]
    recorders, outputs = checked_recorders(record, comm, "simulate", *files)
    begin = time.perf_counter()
    if isinstance(dt, Adaptive):
        require_plain(newton, "adaptive steps, dt = Adaptive(...)")
    if checkpoint is not None:
        require_plain(newton, "checkpoint")
    with ExitStack() as stack:
        keeper: CheckpointFile | None = None
        if checkpoint is not None:
            step = None if isinstance(dt, Adaptive) else (t1 - t0) / step_count(t1 - t0, dt)
            call = {
                "scene": scene, "scheme": scheme, "t[0]": t0, "dt": dt, "every": every,
                "max_states": max_states, "newton": newton or Newton(), "start": checksum_at(start),
                "mesh": mesh_of(start, mesh), "t[1]": t1 if step is None else "any",
                "record": [type(recorder).__qualname__ for recorder in recorders],
            }  # fmt: skip
            keeper = CheckpointFile(checkpoint, call, step, t1, recorders, comm)
            stack.callback(keeper.lock.unlock)
        kind: Any = Simulation
        if isinstance(newton, Newton) and newton.reference:
            in_space = isinstance(scene, Scene) and scene.in_space
            kind = ReferenceInSpace if in_space else ReferenceInPlane
        simulation = kind(scene, scheme, t0=t0, start=start, newton=newton, mesh=mesh, comm=comm)
        solution: Solution = simulation.solution
        solution.every, solution.building = every, time.perf_counter() - begin
        stack.enter_context(running(simulation, recorders, outputs, begin))
        pace: EqualSteps | AdaptiveSteps | JudgedSteps  # `error`: see Solution.time_error
        if isinstance(dt, Adaptive):
            pace = AdaptiveSteps(simulation, t1, dt)
            if any(parts_that_switch(scene)):
                if has_memory(scene):
                    pace.error = math.nan
                    simulation.warn([NOT_KNOWN])
                else:
                    pilot = Pilot(
                        scene, scheme, t0=t0, start=start, newton=newton, mesh=mesh,
                        comm=simulation.subdomain.comm,
                    )  # fmt: skip
                    stack.callback(pilot.close)
                    pace = JudgedSteps(simulation, pilot, t1, dt)
        else:
            pace = EqualSteps(simulation, t1, dt)
        bar = progress_bar(progress, comm, total=1.0)
        take_steps(
            simulation, pace, recorders, bar, max_states=max_states, until=until, keeper=keeper,
            begin=begin,
        )  # fmt: skip
        if not has_inertia(scheme) and simulation.comm.rank == 0:
            warn_of_instability(solution, simulation.equation, simulation.q)
    return solution


def take_steps(
    simulation: Simulation,
    pace: Any,
    recorders: Sequence[Recorder],
    bar: Any,
    *,
    max_states: int = sys.maxsize,
    until: Callable[[Simulation], bool] | None = None,
    keeper: CheckpointFile | None = None,
    begin: float = 0.0,
) -> None:
    """Take the steps of a run: store states, check the ledger, write files, show the progress.

    Args:
        simulation: Simulation in its initial state.
        pace: Step control: :class:`EqualSteps`, :class:`AdaptiveSteps`, or a path.
        recorders: Recorders of each step.
        bar: Progress bar.
        max_states: Largest number of stored states, see :func:`simulate`.
        until: Condition; the run ends after the first step with a state that satisfies it.
        keeper: Writer of checkpoints.
        begin: ``time.perf_counter()`` at the beginning of the run, for checkpoints; s.
    """
    solution, ended = simulation.solution, False
    tolerance = LEDGER_TOLERANCE * simulation.newton.rtol
    watch = LedgerWatch(simulation.numbering, simulation.scheme, tolerance)

    def after_step() -> None:
        solution.time_error = pace.error
        if recorders or keeper is not None:
            simulation.comparison.synchronize()  # raises before processes write different results
        if pace.steps % solution.every == 0 or pace.finished:
            simulation.keep()
            thins = len(solution) > max_states + 1 and not pace.finished
            simulation.warn(watch.faults(solution, solution.every, last=thins or pace.finished))
            if thins:
                solution.downsample()
                solution.every *= 2
                watch.last_checked = len(solution) - 1
        for recorder in recorders:
            recorder.write(simulation)

    def satisfied() -> bool:  # on any process
        answer = until is not None and simulation.together(require_answer, until, simulation)
        return until is not None and simulation.subdomain.largest(answer) > 0

    if keeper is not None and keeper.content:
        simulation.together(keeper.resume, simulation, pace)
        print_once(f"checkpoint {keeper.path}: the run goes on from t = {simulation.t:.9g} s")
        ended = satisfied()
    else:
        for recorder in recorders:
            simulation.together(recorder.open, simulation)
        simulation.keep()
    with bar:
        quiet = until is None and keeper is None and all(r.by_itself for r in recorders)
        while not (pace.finished or ended):
            interrupt.get()()
            if quiet and solution.every == 1 and max_states == sys.maxsize:
                pace.advance(sys.maxsize, keep=True)
                solution.time_error = pace.error
                simulation.together(simulation.warn, watch.faults(solution, solution.every))
            else:
                left = solution.every - pace.steps % solution.every
                pace.advance(left if quiet else 1)
                simulation.together(after_step)
                ended = satisfied()
                if keeper is not None and (keeper.due(pace.steps) or pace.finished or ended):
                    spent = time.perf_counter() - begin
                    simulation.together(keeper.write, simulation, pace, spent)
            if not bar.disable:
                bar.set_postfix_str(simulation.parameter.at(simulation.t), refresh=False)
                bar.update(pace.progress - bar.n)
    simulation.end()
    simulation.together(simulation.warn, watch.faults(solution, solution.every, last=True))


def require_answer(until: Callable[[Any], bool], now: Any) -> bool:
    """Return whether the condition ``until`` is satisfied; raise if it has no answer."""
    answer = until(now)
    if answer is None or (isinstance(answer, np.ndarray) and answer.size != 1):
        raise ArgumentError(f"until returned {shorten(answer)}; it must return True or False")
    return bool(answer)


def check_ledger(simulation: Simulation) -> None:
    """Warn if the ledger does not balance although the scheme claims that it does.

    The solution gets this warning and the warnings of all processes.  All processes call the
    function together at the end of a run.

    Warns:
        ModelWarning: The ledger does not balance, perhaps because of round-off.
    """
    solution, subdomain = simulation.solution, simulation.subdomain
    if not subdomain.alone:  # only the process that has a connector watches its force
        everyone = subdomain.comm.allgather(solution.warnings.splitlines(keepends=True))
        solution.warnings = "".join(dict.fromkeys(chain.from_iterable(everyone)))
    if getattr(simulation.scheme, "exact_ledger", False) and len(solution) > 1:
        energy, tolerance = solution.energy, LEDGER_TOLERANCE * simulation.newton.rtol
        moves = energy.energy_transferred > work_of_round_off(solution)
        if moves and energy.describe_imbalance(tolerance, 0.0):
            # Round-off errors of steps are independent, so their squares add up.
            q = solution.q[:, subdomain.dofs]
            steps = np.sqrt(np.sum(np.diff(q, axis=0) ** 2, axis=0))
            round_off = simulation.random_work(np.abs(q).max(axis=0), steps)
            solution.imbalance_message = energy.describe_imbalance(tolerance, round_off)
    if solution.imbalance_message and simulation.comm.rank == 0:
        warn(solution.imbalance_message)


@contextmanager
def running(
    simulation: Simulation, recorders: Sequence[Recorder], outputs: Sequence[Output], begin: float
) -> Iterator[None]:
    """Context of a run, which closes the simulation and its recorders at the end.

    An error gets the solution so far as its attribute ``solution``.  A nested run must not write
    the files ``outputs``.  ``begin`` is ``time.perf_counter()`` at the beginning of the run (s).
    After the last step the ledger and the mesh dependence of hinges are checked.
    """
    with ExitStack() as stack:
        stack.callback(simulation.close)
        for recorder in recorders:
            stack.callback(recorder.close)
        stack.enter_context(reserved(outputs))
        try:
            yield
            check_ledger(simulation)
        except BaseException as error:
            simulation.comparison.finish()
            if simulation.subdomain.comm.size == 1 or error is simulation.together.raised:
                simulation.end()  # otherwise only some processes would call it, and wait
            stopped: Any = error
            stopped.solution = simulation.solution
            raise
        finally:
            simulation.solution.seconds += time.perf_counter() - begin
    if simulation.comm.rank == 0:
        Opened(simulation.solution).warn(simulation.scheme)
        warn_of_rayleigh(simulation.solution)


NOT_KNOWN = (
    "Adaptive: the error is not known, and time_error is NaN: steps that may contain sliding, "
    "contact, yielding or breaking are taken twice to judge them, but a function with a state(), a "
    "random generator, or a Controller with a sample time must be called once"
)
"""Warning of runs whose steps cannot be taken twice."""


def has_memory(scene: Scene) -> bool:
    """Return whether forces of a scene may depend on the number of calls of functions."""
    laws = (connector.law for connector in scene.all_connectors)
    sampled = any(isinstance(law, Controller) and law.sample for law in laws)
    return sampled or bool(Description({"scene": scene}).stateful)


def require_times(t: tuple[float, float], call: str = "simulate") -> tuple[float, float]:
    """Check and return the beginning and end of a run (s); ``call`` names the caller in errors."""
    try:
        t0, t1 = t
    except (TypeError, ValueError):
        raise ArgumentError(f"{call}: t = {t!r} must be a pair (beginning, end)") from None
    require_number(t0, f"{call}: t[0]")
    require_number(t1, f"{call}: t[1]")
    if t1 <= t0:
        raise ArgumentError(f"{call}: the end t[1] = {t1:g} must come after the beginning {t0:g}")
    return float(t0), float(t1)
