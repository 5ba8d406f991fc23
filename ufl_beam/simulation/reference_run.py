# SPDX-License-Identifier: MIT
"""Run by the reference solver, which ``Newton(reference=True)`` asks for."""

from __future__ import annotations

import time
from typing import Any

from mpi4py import MPI

import numpy as np

from ufl_beam.discretization.state_transfer import same_unknowns
from ufl_beam.errors import ConvergenceError, StepFailed
from ufl_beam.mechanics.time_schemes import Scheme, has_inertia
from ufl_beam.model.mesh_options import Mesh
from ufl_beam.model.scene import Scene
from ufl_beam.output.joint_histories import turned
from ufl_beam.output.state_rows import Columns
from ufl_beam.parallel import progress_bar
from ufl_beam.reference.solver import Solver
from ufl_beam.simulation.initial_state import checked_grid, initial_state, mesh_of
from ufl_beam.simulation.solution import Solution
from ufl_beam.solvers.newton_options import Newton, checked_newton, require_plain


def simulate_by_reference(
    scene: Scene, scheme: Scheme, newton: Newton, times: tuple[float, float], number: int, *,
    start: Solution | None, mesh: Mesh | None, every: int, most: int, comm: MPI.Intracomm,
    progress: bool,
) -> Solution:  # fmt: skip
    """Simulate a scene by so many equal steps; arguments are those of ``simulate``."""
    if comm.size > 1:
        require_plain(newton, f"mpirun, here with {comm.size} processes")
    newton = checked_newton(newton, comm)
    begin, (t0, t1) = time.perf_counter(), times
    grid, _ = checked_grid(scene, scheme, mesh_of(start, mesh), fresh=start is None)
    q, v, internal = initial_state(grid, start)
    options: dict[str, Any] = {"max_iterations": newton.max_iterations, "petsc": newton.petsc}
    solver = Solver(grid, scheme, t0, q, v, rtol=newton.rtol, **options)
    same = start is not None and start.scene is scene and bool(start.times[-1] == t0)
    between = float(scheme.average(0.0, 1.0))
    solver.start(None if start is None else internal, same=same)
    if start is not None and start.between == between and same_unknowns(start.grid, grid):
        goes_on = same and "reactions" in internal and not len(start.v)
        if goes_on or has_inertia(scheme):
            solver.on_nodes, solver.q_before = start.numbers(-1), start.before(-1)
    solution = Solution(scene, grid)
    solution.between, solution.begun, solution.scheme = between, between < 1, scheme
    solution.every, solution.building = every, time.perf_counter() - begin

    def keep() -> None:
        state = solver.snapshot()
        forces = state["reactions"][:, :2]
        for k, support in enumerate(scene.supports):
            forces[k] = turned(forces[k], np.full(1, -support.angle))[0]  # in its axes
        columns = Columns({name: np.shape(values) for name, values in state.items()})
        solution.append(columns, *map(np.ravel, state.values()))
        solution.count(solver.parts, solver.iterations)

    keep()
    try:
        with progress_bar(progress, comm, total=1.0) as bar:
            for k in range(1, number + 1):
                end = t1 if k == number else t0 + (t1 - t0) * k / number
                solver.step_to(end)
                if k % solution.every == 0 or k == number:
                    keep()
                    if len(solution) > most + 1 and k < number:
                        solution.thin()
                        solution.every *= 2
                bar.update(k / number - bar.n)
    except StepFailed as failure:
        raise ConvergenceError(
            f"no equilibrium after t = {solver.t:.9g} s: {failure}. {scheme.advice}",
            time=solver.t, dt=end - solver.t, solution=solution, residuals=failure.residuals,
            forces={}, reason=failure.reason,
        ) from failure  # fmt: skip
    except BaseException as error:
        stopped: Any = error
        stopped.solution = solution
        raise
    finally:
        if solution.times[-1] != solver.t:
            keep()
        solution.internal = solver.internal()
        solution.seconds = time.perf_counter() - begin
    return solution
