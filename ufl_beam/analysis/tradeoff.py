# SPDX-License-Identifier: MIT
"""Trade-off of speed for accuracy on a user's own scene: runs, search, recommendation."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from itertools import groupby, product
from typing import TypeVar

from mpi4py import MPI

from ufl_beam.analysis.found_setting import Found
from ufl_beam.analysis.refinement_runs import FASTER, Quantity, RefinementRuns
from ufl_beam.analysis.refinement_search import RefinementSearch
from ufl_beam.analysis.richardson import size
from ufl_beam.analysis.targets import Target, target_of
from ufl_beam.analysis.tradeoff_result import Dials, Run, Tradeoff
from ufl_beam.errors import (
    SceneError,
    TradeoffError,
    require_kind,
    require_number,
    require_switch,
    require_text,
    shorten,
)
from ufl_beam.mechanics.time_schemes import Scheme
from ufl_beam.model.mesh_options import Mesh
from ufl_beam.model.scene import Scene
from ufl_beam.parallel import communicator, progress_bar
from ufl_beam.simulation.initial_state import require_scheme
from ufl_beam.simulation.run import require_times, simulate
from ufl_beam.simulation.step_control import Adaptive
from ufl_beam.solvers.newton_options import Newton

NEWTON_SHARE = 0.1  # part of the error that other options of Newton's method may change
MESHES = Mesh(degree=2), Mesh()  # that compete unless others are given; the likely best first
NEWTONS = Newton(), Newton(modified=True)
BAR = "trade-off: {n} runs [{elapsed}{postfix}]"

One = TypeVar("One")


def tradeoff(
    scene: Scene,
    quantities: Mapping[str, Quantity],
    *,
    scheme: Scheme | Sequence[Scheme],
    t: tuple[float, float],
    dt: float | Adaptive | Sequence[float | Adaptive],
    tolerance: float | Mapping[str, float] | None = None,
    budget: float | None = None,
    mesh: Mesh | Sequence[Mesh] | None = None,
    newton: Newton | Sequence[Newton] | None = None,
    most: float = 600.0,
    progress: bool = True,
    comm: MPI.Intracomm | None = None,
) -> Tradeoff:
    """Find the cheapest setting for a tolerance, or the most accurate one for a time.

    The scene is run with finer steps, finer cells and both.  From the convergence of the quantities
    the errors of the runs and the required setting are estimated.  That setting is run as well and
    compared with the limit that the others are extrapolated to; if the limit is not known well, it
    is also compared with a finer run.  Its errors shall be 0.3 to 1 times the tolerance, and the
    steps of all runs are planned to take at most 10 times as long as those of the recommended one
    where one scheme is given.  All settings are arguments of :func:`simulate`; several schemes,
    steps and meshes compete.

    Args:
        scene: Model; ``cells`` of its beams are the coarsest.
        quantities: Functions of a :class:`Solution` by name that return a number, or an array of
            the same shape whatever the steps and cells: ``{"tip": lambda s:
            s.position(beam.end)[-1]}``.  The error of an array is that of its worst entry.
        scheme: The scheme, or several.
        t: Beginning and end; s.
        dt: The longest step, s; or :class:`Adaptive` steps with the largest tolerance; or several.
        tolerance: Largest error of each quantity, by name, in its own unit; or for all of them, as
            a part of the quantity's largest magnitude.
        budget: Wall time of one run, in the place of a tolerance; s.
        mesh: The coarsest cells, or several kinds; by default of degree 1, and of degree 2 where
            the scene allows it.
        newton: How exactly equilibria are found; of several the first is used, and the others are
            tried in the end.  Those that differ in ``modified`` alone are compared on coarse runs,
            and the faster one is used from there on.  By default also the modified Newton method.
        most: Wall time of all runs; s.
        progress: Show the number of runs in a terminal or notebook.
        comm: Processes; each run is done by one of them, several at a time.  Runs that go on
            together disturb each other's times: leave cores idle where times matter.

    Returns:
        The runs with their times and errors, and the recommended arguments.

    Raises:
        SceneError: The call is wrong, or no kind of dials can be used for the scene.
        TradeoffError: Self-convergence is not seen, or it would take too long; it says what was
            seen and has the runs.

    Example:
        >>> tip = {"tip": lambda run: run.position(beam.end)[-1]}
        >>> found = ub.tradeoff(scene, tip, scheme=ub.Static(), t=(0, 1), dt=0.5, tolerance=0.01)
        >>> run = ub.simulate(scene, **found.recommended)
    """
    require_kind(quantities, Mapping, "tradeoff: quantities")
    if not quantities:
        raise SceneError("tradeoff: quantities is empty; name what is to be accurate")
    for name, quantity in quantities.items():
        require_text(name, "tradeoff: the name of a quantity")
        if not callable(quantity):
            raise SceneError(
                f"tradeoff: quantity {name!r} = {shorten(quantity)} cannot be called; give a "
                "function of a Solution"
            )
    target = target_of(quantities, tolerance, budget)
    require_number(most, "tradeoff: most", positive=True)
    require_switch(progress, "tradeoff: progress")
    comm = communicator(comm, "tradeoff: comm")
    t = require_times(t)
    meshes = _several(MESHES if mesh is None else mesh, Mesh, "mesh")
    newtons = _several(NEWTONS if newton is None else newton, Newton, "newton")
    schemes: tuple[Scheme, ...] = _several(scheme, object, "scheme")
    for i, one in enumerate(schemes):
        require_scheme(one, f"tradeoff: scheme[{i}]" if len(schemes) > 1 else "tradeoff: scheme")
    steps: tuple[float | Adaptive, ...] = _several(dt, object, "dt")
    for i, step in enumerate(steps):
        if not isinstance(step, Adaptive):
            what = f"tradeoff: dt[{i}]" if len(steps) > 1 else "tradeoff: dt"
            require_number(step, what, positive=True)
    families = [Dials(*one, newtons[0]) for one in product(schemes, steps, meshes)]
    with progress_bar(progress, comm, unit="run", bar_format=BAR) as bar:
        runs = RefinementRuns(
            scene, quantities, simulate, families, newtons, t=t, most=most, comm=comm, bar=bar
        )
        found, notes = _find_all(runs, target)
        best = min(found, key=lambda one: one.rank(target))
        run = _other_newton(runs, best)
    crosses = best.prediction.crosses
    for other in found:
        for name, cross in other.prediction.crosses.items():
            apart = size(cross.limit - crosses[name].limit)
            if apart > cross.uncertainty + crosses[name].uncertainty:
                notes.append(f"{other.run.dials}: its limit of {name} is {apart:.2g} away")
    if not best.accepted(target, run):
        notes.append(_reason(runs, best, target))
    return Tradeoff(
        runs=runs.all, best=run, t=t, crosses=crosses,
        units=dict(best.prediction.units), target=target, families=tuple(map(str, families)),
        notes=tuple(notes), spent=runs.spent,
    )  # fmt: skip


def _find_all(runs: RefinementRuns, target: Target) -> tuple[list[Found], list[str]]:
    """Find the setting of each scheme and step that serves; raise if none does.

    Also returns notes on the others.
    """
    found: list[Found] = []
    notes: list[str] = []
    wrong: list[SceneError] = []
    for _, group in groupby(range(len(runs.families)), lambda k: runs.families[k].steps):
        families = []
        for family in group:
            try:
                runs.begin(family)
                families.append(family)
            except SceneError as error:
                wrong.append(error)
                notes.append(f"{runs.families[family]}: {error}")
        if not families:
            continue
        search = RefinementSearch(runs, families, target)
        try:
            found.append(search.find(found))
        except TradeoffError as error:
            notes.append(f"{runs.families[search.family]}: {error}")
        notes += search.notes
    if len(wrong) == len(runs.families):
        raise wrong[0]
    if not found:
        raise TradeoffError("tradeoff: " + "\n".join(notes), runs.all)
    return found, notes


def _reason(runs: RefinementRuns, best: Found, target: Target) -> str:
    """Say by how much the recommended run is not what was asked for, and what is next to it."""
    said = f"no setting was found that is nearer to {target}: errors are {best.ratio:.2g} of it"
    larger = [
        ratio for run in runs.of(best.run.refinement.family) if (ratio := best.ratio_of(run)) > 1
    ]
    if best.ratio > 1 or math.isinf(target.bounds[1]):
        return said
    if larger:
        return f"{said}; the next coarser of the runs has {min(larger):.2g} of it"
    return f"{said}; all runs keep it, begin with coarser steps and cells"


def _other_newton(runs: RefinementRuns, best: Found) -> Run:
    """The recommended run, or that with other options which is faster and changes little."""
    chosen, one = best.run, best.run.refinement
    for number in range(len(runs.newtons)):
        run = runs.run_with(one, number) if runs.may_be_faster(number) else None
        if run is not None:
            changes = {name: run.values[name] - value for name, value in best.run.values.items()}
            changed = best.prediction.largest(changes)
            faster = run.stepping < FASTER * chosen.stepping
            if faster and changed <= NEWTON_SHARE * best.choice.ratio:
                chosen = run
    return chosen


def _several(values: One | Sequence[One], kind: type, what: str) -> tuple[One, ...]:
    """Return one value, or a sequence of them, as a tuple of values of a kind."""
    if not isinstance(values, Sequence) or isinstance(values, str | bytes):
        require_kind(values, kind, f"tradeoff: {what}")
        return (values,)  # type: ignore[return-value]
    if not values:
        raise SceneError(f"tradeoff: {what} is empty")
    for i, value in enumerate(values):
        require_kind(value, kind, f"tradeoff: {what}[{i}]")
    return tuple(values)
