# SPDX-License-Identifier: MIT
"""A run from beginning to end: steps, what is kept, what is written on the way."""

from __future__ import annotations

import math
import sys
import time
from collections.abc import Iterator, Sequence
from contextlib import ExitStack, contextmanager
from itertools import chain
from typing import Any, cast

from mpi4py import MPI

from ufl_beam.errors import (
    SceneError,
    require_count,
    require_kind,
    require_number,
    require_switch,
    warn,
)
from ufl_beam.mechanics.time_schemes import Scheme, has_inertia
from ufl_beam.model.mesh_options import Mesh
from ufl_beam.model.scene import Scene
from ufl_beam.output.output_files import Output, take
from ufl_beam.output.recorders import Recorder, recorders_of
from ufl_beam.parallel import communicator, progress_bar, say
from ufl_beam.simulation.checkpoint import Checkpoint, Keeper, end_of
from ufl_beam.simulation.diagnosis import ROOM, open_ledger
from ufl_beam.simulation.initial_state import mesh_of
from ufl_beam.simulation.reference_run import simulate_by_reference
from ufl_beam.simulation.simulation import Simulation
from ufl_beam.simulation.solution import Solution
from ufl_beam.simulation.step_control import Adaptive, number_of_steps, steps_of
from ufl_beam.simulation.stepper import MOST_PARTS
from ufl_beam.simulation.watches import LedgerWatch
from ufl_beam.solvers.newton_options import Newton, require_plain

BAR = "{percentage:3.0f}%|{bar}| [{elapsed}<{remaining}]"


def simulate(
    scene: Scene,
    scheme: Scheme,
    *,
    t: tuple[float, float],
    dt: float | Adaptive,
    record: Sequence[Recorder] | Recorder = (),
    every: int = 1,
    most: int = sys.maxsize,
    start: Solution | None = None,
    newton: Newton | None = None,
    mesh: Mesh | None = None,
    checkpoint: Checkpoint | None = None,
    progress: bool = True,
    comm: MPI.Intracomm | None = None,
) -> Solution:
    """Simulate the motion of a scene in time, or its equilibria under growing loads.

    Args:
        scene: Model.
        scheme: :class:`Static`, :class:`Midpoint` or another one, see docs/schemes.md.
        t: Beginning and end; s.  In statics time is the load parameter.
        dt: Step; s.  All steps are a little shorter if ``dt`` does not divide the time.  A step
            without convergence is cut into parts.  :class:`Adaptive` steps are as long as an
            accuracy allows.
        record: Files to write on the way, such as :class:`XDMF` and :class:`History`.
        every: Keep every so many steps in the solution; the last one always.
        most: Largest number of states in the solution, besides the initial and the last one.  When
            it is exceeded, every other state is deleted, and half as many steps are kept from then
            on.
        start: Solution of the same beams whose last state is the initial state.  Joints may be
            removed, or added where places are together.
        newton: Tolerances and PETSc options.
        mesh: Discretization; as ``start``, or with the cells of the beams.
        checkpoint: Checkpoint file from which the run goes on if the script is run again.
        progress: Show a progress bar in a terminal or notebook.
        comm: Processes that share the scene; all of them, or in a :func:`study` this one alone.  A
            small scene is computed by each of them.

    Returns:
        The motion, the forces and the ledger.

    Raises:
        SceneError: The call or the scene is wrong; nothing was computed.
        ConvergenceError: A step failed; it carries the solution so far, and files are complete.

    Example:
        >>> run = ub.simulate(scene, ub.Midpoint(), t=(0, 1), dt=0.05)
        >>> print((1e3 * run.displacement(beam.end)[-1]).round(1))  # mm, mm, mrad
        [ -0.1 -18.9 -14.3]
    """
    comm = communicator(comm, "simulate: comm")
    require_switch(progress, "simulate: progress")
    t0, t1 = require_times(t)
    _require_step(dt, scheme, (t0, t1))
    require_count(every, "simulate: every")
    require_count(most, "simulate: most")
    if start is not None:
        require_kind(start, Solution, "start")
    if checkpoint is not None:
        require_kind(checkpoint, Checkpoint, "simulate: checkpoint")
    kept = [] if checkpoint is None else [("checkpoint", checkpoint.files)]
    recorders, outputs = recorders_of(record, comm, "simulate", *kept)
    begin = time.perf_counter()
    if isinstance(newton, Newton) and newton.reference:
        if isinstance(dt, Adaptive):
            require_plain(newton, "adaptive steps, dt = Adaptive(...)")
        if recorders or checkpoint is not None:
            require_plain(newton, "recorders" if recorders else "checkpoint")
        number = number_of_steps(t1 - t0, cast(float, dt))
        return simulate_by_reference(
            scene, scheme, newton, (t0, t1), number, start=start, mesh=mesh, every=every, most=most,
            comm=comm, progress=progress,
        )  # fmt: skip
    with ExitStack() as stack:
        keeper: Keeper | None = None
        if checkpoint is not None:
            step = None if isinstance(dt, Adaptive) else (t1 - t0) / number_of_steps(t1 - t0, dt)
            call = {
                "scene": scene, "scheme": scheme, "t[0]": t0, "dt": dt, "every": every,
                "most": most, "newton": newton or Newton(), "start": end_of(start),
                "mesh": mesh_of(start, mesh), "t[1]": t1 if step is None else "any",
                "record": [type(recorder).__qualname__ for recorder in recorders],
            }  # fmt: skip
            keeper = Keeper(checkpoint, call, step, t1, recorders, comm)
            stack.callback(keeper.close)
        simulation = Simulation(
            scene, scheme, t0=t0, start=start, newton=newton, mesh=mesh, comm=comm
        )
        solution = simulation.solution
        solution.every, solution.building = every, time.perf_counter() - begin
        stack.enter_context(running(simulation, recorders, outputs, begin))
        pace = steps_of(simulation, t1, dt)
        watch = LedgerWatch(simulation.grid, scheme, ROOM * simulation.solver.convergence.c.rtol)

        def after_step() -> None:
            solution.time_error = pace.error
            if recorders or keeper is not None:
                simulation.settle()  # before anything is written
            if pace.steps % solution.every == 0 or pace.finished:
                simulation.keep()
                thins = len(solution) > most + 1 and not pace.finished
                simulation.warn(watch.judge(solution, solution.every, last=thins or pace.finished))
                if thins:
                    solution.thin()
                    solution.every *= 2
                    watch.thinned(solution)
            for recorder in recorders:
                recorder.write(simulation)
            if keeper is not None and (keeper.due(pace.steps) or pace.finished):
                keeper.write(simulation, pace, time.perf_counter() - begin)

        if keeper is not None and keeper.found:
            simulation.together(keeper.resume, simulation, pace)
            say(f"checkpoint {keeper.path}: the run goes on from t = {simulation.t:.9g} s")
        else:
            for recorder in recorders:
                simulation.together(recorder.open, simulation)
            simulation.keep()
        with progress_bar(progress, comm, total=1.0, bar_format=BAR) as bar:
            quiet = keeper is None and all(one.by_itself for one in recorders)
            while not pace.finished:
                if quiet and solution.every == 1 and most == sys.maxsize:
                    pace.advance(sys.maxsize, keep=True)
                    solution.time_error = pace.error
                    simulation.together(simulation.warn, watch.judge(solution, solution.every))
                else:
                    left = solution.every - pace.steps % solution.every
                    pace.advance(left if quiet else 1)
                    simulation.together(after_step)
                bar.update(pace.progress - bar.n)
        simulation.end()
        simulation.together(simulation.warn, watch.judge(solution, solution.every, last=True))
        check_ledger(simulation)
    if comm.rank == 0:
        solution.opened.warn(scheme, solution.times)
    return solution


def check_ledger(simulation: Simulation) -> None:
    """Warn, and note in the solution, if a ledger is open that the scheme claims to close.

    All processes call it together, at the end of a run, and know all warnings then.

    Warns:
        ModelWarning: It is open, perhaps by round-off.
    """
    solution, share = simulation.solution, simulation.share
    if not share.alone:  # forces are watched by the process that has the connector
        everyone = share.comm.allgather(solution.warnings.splitlines(keepends=True))
        solution.warnings = "".join(dict.fromkeys(chain.from_iterable(everyone)))
    if getattr(simulation.scheme, "exact_ledger", False) and len(solution) > 1:
        solution.open_ledger = open_ledger(solution, share, simulation.solver)
    if solution.open_ledger and simulation.comm.rank == 0:
        warn(solution.open_ledger)


@contextmanager
def running(
    simulation: Simulation, recorders: Sequence[Recorder], outputs: Sequence[Output], begin: float
) -> Iterator[None]:
    """Close what a run has opened at its end, and let whatever stops it carry ``error.solution``.

    Meanwhile no other run writes its files; ``begin`` is the value of a clock for its seconds.
    """
    with ExitStack() as stack:
        stack.callback(simulation.close)
        for recorder in recorders:
            stack.callback(recorder.close)
        stack.callback(take(outputs))
        try:
            yield
        except BaseException as error:
            simulation.leave()
            if simulation.share.comm.size == 1 or error is simulation.together.raised:
                simulation.end()  # else the processes may not all be here
            stopped: Any = error
            stopped.solution = simulation.solution
            raise
        finally:
            simulation.solution.seconds += time.perf_counter() - begin


def require_times(t: tuple[float, float]) -> tuple[float, float]:
    """Return the beginning and the end of a run, checked."""
    try:
        t0, t1 = t
    except (TypeError, ValueError):
        raise SceneError(f"simulate: t = {t!r} must be a pair (beginning, end)") from None
    require_number(t0, "simulate: t[0]")
    require_number(t1, "simulate: t[1]")
    if t1 <= t0:
        raise SceneError(f"simulate: the end t[1] = {t1:g} must come after the beginning {t0:g}")
    return float(t0), float(t1)


def _require_step(dt: float | Adaptive, scheme: Scheme, t: tuple[float, float]) -> None:
    if not isinstance(dt, Adaptive):
        require_number(dt, "simulate: dt", positive=True)
        least = MOST_PARTS * math.ulp(max(map(abs, t)))
        if dt < least:
            raise SceneError(
                f"simulate: dt = {dt:g} s is too small: steps from t = {t[0]:g} to {t[1]:g} s can "
                f"be told apart, and cut, from {least:.1e} s on; use a larger one, or begin at 0"
            )
    elif not has_inertia(scheme):
        raise SceneError(
            "simulate: dt = Adaptive(...) estimates the error of accelerations, and a static "
            "scheme has none; give a number"
        )
