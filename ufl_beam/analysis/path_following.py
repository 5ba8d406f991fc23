# SPDX-License-Identifier: MIT
"""Path following: static equilibria with the load factor among the unknowns."""

from __future__ import annotations

import time
from collections.abc import Callable, Sequence
from typing import cast

from mpi4py import MPI

import numpy as np

from ufl_beam.analysis.critical_points import Branch, CriticalPoint
from ufl_beam.analysis.path_corrector import Control
from ufl_beam.analysis.path_stepper import PathStepper
from ufl_beam.arrays import Array
from ufl_beam.display import FACTOR
from ufl_beam.errors import (
    SceneError,
    StepFailed,
    require_count,
    require_function,
    require_kind,
    require_switch,
)
from ufl_beam.mechanics.classical import Static
from ufl_beam.model.connector_law import ConnectorLaw
from ufl_beam.model.connector_law_checks import require_limit
from ufl_beam.model.connector_laws import Controller, Coulomb
from ufl_beam.model.mesh_options import Mesh
from ufl_beam.model.scene import Scene
from ufl_beam.output.archive import Content, above, below, require_arrays
from ufl_beam.output.recorders import Recorder, recorders_of
from ufl_beam.parallel import communicator, progress_bar
from ufl_beam.simulation.run import running
from ufl_beam.simulation.simulation import Simulation
from ufl_beam.simulation.solution import Solution
from ufl_beam.simulation.solution_files import NAMED
from ufl_beam.solvers.newton_options import Newton

MOST_POINTS = 5  # critical points that the text of a path names

ADVICE = (
    "Try a shorter step or another control: ArcLength goes through limit points of loads and of "
    "displacements, DissipationControl through softening that snaps back"
)


class Path(Solution):
    """Equilibrium path: a solution whose times are load factors.

    Attributes:
        critical: Limit and bifurcation points, in the order in which they were passed.

    Example:
        >>> path = ub.follow(scene, ub.LoadControl(0.5), steps=4)
        >>> print(path.factor, path.critical)
        [0.  0.5 1.  1.5 2. ] []
    """

    critical: Sequence[CriticalPoint] = ()
    parameter = FACTOR

    @property
    def factor(self) -> Array:
        """Load factors, the time of the time functions; (n+1,)."""
        return self.times

    def summary(self) -> list[str]:
        """Return lines on the model, the path, embedded hinges, and the first critical points."""
        first = ", ".join(map(str, self.critical[:MOST_POINTS]))
        rest = len(self.critical) - MOST_POINTS
        points = f"{first} and {rest} more" if rest > 0 else first
        return [*super().summary(), *filter(None, [points])]

    def _content(self) -> Content:
        content = super()._content()
        content["critical"] = [
            {"kind": c.kind, "factor": c.factor, "n": c.n} for c in self.critical
        ]
        for k, point in enumerate(self.critical):
            content[f"critical/{k}/mode"] = point.mode
            content |= above(f"critical/{k}/state/", point.state._arrays())
        return content

    def _take(self, content: Content) -> None:
        super()._take(content)
        critical = []
        for k, one in enumerate(content["critical"]):
            state, inside = Solution(self.scene, self.grid), below(f"critical/{k}/", content)
            require_arrays(inside, {"mode": (self.grid.size,)})
            state._take({**{n: content[n] for n in NAMED}, **below("state/", inside)})
            kind, factor, n = str(one["kind"]), float(one["factor"]), range(len(self))[one["n"]]
            critical.append(CriticalPoint(kind, factor, n, state, inside["mode"]))
        self.critical = critical

    @property
    def progress(self) -> Array:
        """Arc length of the path in the displacements of nodes, root mean square; (n+1,); m."""
        nodes = np.unique(np.vstack([self.grid.dofs, self.grid.dofs_of_bodies])[:, :2])
        steps = np.sqrt(2 * np.mean(np.diff(self.q[:, nodes], axis=0) ** 2, axis=1))
        return np.concatenate([[0.0], np.cumsum(steps)])


def follow(
    scene: Scene,
    control: Control,
    *,
    until: Callable[[Simulation], bool] | None = None,
    steps: int = 200,
    start: Solution | Branch | None = None,
    record: Sequence[Recorder] | Recorder = (),
    newton: Newton | None = None,
    mesh: Mesh | None = None,
    progress: bool = True,
    comm: MPI.Intracomm | None = None,
) -> Path:
    """Follow a path of static equilibria through limit points and snap-backs.

    The load factor is the time of loads and motions, and an unknown like the displacements.  A path
    begins with the equilibrium at the factor 0, in the direction of the control, and goes on in its
    own direction.  It is quasi-static: viscosity and masses have no effect.

    Limit points of the load factor and bifurcation points become states of the path.

    Args:
        scene: Model; some load or motion must vary in time, ``time=lambda t: t``.
        control: :class:`ArcLength`, :class:`LoadControl`, :class:`DisplacementControl` or
            :class:`DissipationControl`.
        until: The path ends after the first step for which this is true, as in
            ``until=lambda now: now.displacement(tip)[1] < -0.5``; ``now.t`` is the load factor.
        steps: The path ends after so many.
        start: Branch of a :class:`CriticalPoint`, or a solution whose last state is the beginning.
        record: Files to write on the way.
        newton: Tolerances and PETSc options; line searches and Krylov methods are not used.
        mesh: Discretization; as ``start``, or with the cells of the beams.
        progress: Show a progress bar in a terminal or notebook.
        comm: Processes that share the scene.

    Raises:
        SceneError: The call or the scene is wrong; nothing was computed.
        ConvergenceError: A step failed; it carries the path so far.

    Example:
        >>> path = ub.follow(scene, ub.LoadControl(0.5), until=lambda now: now.t >= 2)
        >>> print(path.factor)
        [0.  0.5 1.  1.5 2. ]
    """
    comm = communicator(comm, "follow: comm")
    if until is not None:
        require_function(until, "follow: until", "the Simulation")
    require_kind(scene, Scene, "scene")
    if not isinstance(control, Control) or isinstance(control, type):
        raise SceneError(
            f"follow: control = {control!r} must be ArcLength(...), LoadControl(...), "
            "DisplacementControl(...) or DissipationControl(...)"
        )
    control.require(scene)
    require_count(steps, "follow: steps")
    require_switch(progress, "follow: progress")
    if start is not None:
        require_kind(start, (Solution, Branch), "follow: start")
    recorders, outputs = recorders_of(record, comm, "follow")
    branch, state = (start, start.state) if isinstance(start, Branch) else (None, start)
    t0 = 0.0 if state is None else float(state.times[-1])
    _require_driven(scene, t0)
    began = time.perf_counter()
    simulation = Simulation(
        scene, Static(), t0=t0, start=state, newton=newton, mesh=mesh, comm=comm, kind=Path
    )
    path = cast(Path, simulation.solution)
    stepper = PathStepper(simulation, control)
    path.critical = stepper.critical

    def after_step() -> bool:
        if recorders:
            simulation.settle()  # before anything is written
        simulation.keep()
        for recorder in recorders:
            recorder.write(simulation)
        return until is not None and bool(until(simulation))

    bar = progress_bar(progress, comm, total=steps, unit="step")
    with running(simulation, recorders, outputs, began), bar:
        try:
            stepper.begin(branch, fresh=state is None)
            for recorder in recorders:
                simulation.together(recorder.open, simulation)
            simulation.keep()
            for _ in range(steps):
                stepper.advance()
                bar.set_postfix_str(FACTOR.at(simulation.t), refresh=False)
                bar.update()
                if simulation.share.largest(simulation.together(after_step)):
                    break
        except StepFailed as failure:
            simulation.give_up(failure, stepper.tried, ADVICE)
        simulation.end()
    if comm.rank == 0:
        path.opened.warn(simulation.scheme, path.times)
    return path


def _require_driven(scene: Scene, t0: float) -> None:
    """Raise unless something depends on the load factor, and nothing on the history of time."""
    for link in scene.links:
        if isinstance(link.law, Controller):
            raise SceneError(f"{link}: a controller acts in time, and a path has none")
        if isinstance(link.law, Coulomb):
            raise SceneError(
                f"{link}: dry friction sticks or slides in steps of time, and a path has none; use "
                "simulate(scene, Static(), ...), or a Spring that yields"
            )
        if isinstance(link.law, ConnectorLaw):
            require_limit(link.law, str(link))
    for work in scene.works:
        if "v" in work.asked:
            raise SceneError(
                f"{work}: it depends on the velocity v, and a path has no time; leave v out, or "
                "use simulate(scene, Static(), ...)"
            )
    times = (t0 + 1e-3, t0 + 1.0, t0 - 1e-3, t0 - 1.0)
    driven = any("t" in work.asked for work in scene.works)
    if not driven and not any(f(t) != f(t0) for _, f in scene.time_functions() for t in times):
        raise SceneError(
            "follow: no load and no motion depends on time, which is the load factor here; give "
            "the one that is to grow time=lambda t: t"
        )
