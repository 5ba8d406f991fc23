# SPDX-License-Identifier: MIT
"""The trade of speed for accuracy on a user's own scene, measured and chosen from."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from itertools import product
from typing import TypeVar, cast

from mpi4py import MPI

from ufl_beam.analysis.refinement_runs import Dials, Ladder, Quantity, Run
from ufl_beam.analysis.refinement_search import CAREFUL, Climb
from ufl_beam.analysis.richardson import size
from ufl_beam.analysis.targets import Budget, Found, Goal, Tolerance
from ufl_beam.analysis.tradeoff_result import Tradeoff
from ufl_beam.errors import (
    SceneError,
    TradeoffError,
    require_kind,
    require_number,
    require_text,
    shorten,
)
from ufl_beam.mechanics.time_schemes import Scheme
from ufl_beam.model.mesh_options import Mesh
from ufl_beam.model.scene import Scene
from ufl_beam.parallel import communicator
from ufl_beam.simulation.step_control import Adaptive
from ufl_beam.solvers.newton_options import Newton

SHARE = 0.1
"""Part of the error that another tolerance of Newton's method may change."""

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
    comm: MPI.Intracomm | None = None,
) -> Tradeoff:
    """Find the cheapest setting for a tolerance, or the most accurate one for a time.

    The scene is run with finer and finer steps, cells and both.  Where the changes fall as they
    should, they tell the error of each run, and which one is needed; that one is run as well and
    compared with the limit that the others are extrapolated to.  All dials are arguments of
    :func:`simulate`; several schemes, steps, meshes compete.

    Args:
        scene: What is simulated; ``cells`` of its beams are the coarsest.
        quantities: Functions of a :class:`Solution` by name that return a number, or an array of
            the same shape whatever the steps and cells: ``{"tip": lambda s:
            s.position(beam.end)[-1]}``.  The error of an array is that of its worst entry.
        scheme: The scheme, or several.
        t: Beginning and end; s.
        dt: The longest step, s; or :class:`Adaptive` steps with the largest tolerance; or several.
        tolerance: Largest error of each quantity, by name, in its own unit; or for all of them, as
            a part of the quantity's largest magnitude.
        budget: Wall time of one run, in the place of a tolerance; s.
        mesh: The coarsest cells, or several kinds.
        newton: How exactly equilibria are found; of several the first is used, and the others are
            tried in the end.
        most: Wall time of all runs; s.
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
    goal = _goal(quantities, tolerance, budget)
    require_number(most, "tradeoff: most", positive=True)
    comm = communicator(comm, "tradeoff: comm")
    meshes = _several(Mesh() if mesh is None else mesh, Mesh, "mesh")
    newtons = _several(Newton() if newton is None else newton, Newton, "newton")
    schemes = _several(scheme, Scheme, "scheme")
    steps: tuple[float | Adaptive, ...] = _several(dt, object, "dt")
    for i, step in enumerate(steps):
        if not isinstance(step, Adaptive):
            require_number(step, f"tradeoff: dt[{i}]" if len(steps) > 1 else "tradeoff: dt")
    families = [Dials(*one, newtons[0]) for one in product(schemes, steps, meshes)]
    ladder = Ladder(
        scene, quantities, t=t, families=families, newtons=newtons, most=most,
        comm=comm,
    )  # fmt: skip
    found: list[Found] = []
    notes: list[str] = []
    wrong: list[SceneError] = []
    for family, dials in enumerate(families):
        try:
            ladder.begin(family)
        except SceneError as error:
            wrong.append(error)
            notes.append(f"{dials}: {error}")
            continue
        try:
            one = Climb(ladder, family, goal).find(found)
        except TradeoffError as error:
            notes.append(f"{dials}: {error}")
            continue
        if one is None:
            notes.append(f"{dials}: given up, others are better")
        else:
            found.append(one)
    if len(wrong) == len(families):
        raise wrong[0]
    if not found:
        raise TradeoffError("tradeoff: " + "\n".join(notes), tuple(ladder.runs.values()))
    best = min(found, key=goal.rank)
    crosses = best.outlook.crosses
    for other in found:
        for name, cross in other.outlook.crosses.items():
            apart = size(cross.limit - crosses[name].limit)
            if apart > cross.uncertainty + crosses[name].uncertainty:
                notes.append(f"{other.run.dials}: its limit of {name} is {apart:.2g} away")
    run = _other_newton(ladder, best)
    if not goal.accepts(replace(best, run=run)):
        notes.append(f"no setting was found that is nearer to {goal}")
    return Tradeoff(
        runs=tuple(ladder.runs.values()),
        best=run,
        t=t,
        crosses=crosses,
        units=dict(best.outlook.units),
        goal=goal,
        families=tuple(map(str, families)),
        notes=tuple(notes),
        spent=ladder.spent,
    )


def _other_newton(ladder: Ladder, best: Found) -> Run:
    """The recommended run, or that with another tolerance which is faster and changes little."""
    chosen = best.run
    for number in range(1, len(ladder.newtons)):
        rung = best.run.rung._replace(newton=number)
        ladder.climb([rung], short=CAREFUL)
        if rung in ladder.runs:
            run = ladder.runs[rung]
            changed = best.outlook.largest(
                {name: run.values[name] - value for name, value in best.run.values.items()}
            )
            if changed <= SHARE * best.choice.ratio and run.seconds < chosen.seconds:
                chosen = run
    return chosen


def _goal(
    quantities: Mapping[str, Quantity],
    tolerance: float | Mapping[str, float] | None,
    budget: float | None,
) -> Goal:
    """Return the target in words."""
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
    if (tolerance is None) == (budget is None):
        raise SceneError("tradeoff: give either a tolerance or a budget")
    if budget is not None:
        require_number(budget, "tradeoff: budget", positive=True)
        return Budget(budget)
    if not isinstance(tolerance, Mapping):
        require_number(cast("float", tolerance), "tradeoff: tolerance", positive=True)
        return Tolerance({}, cast("float", tolerance))
    if set(tolerance) != set(quantities):
        raise SceneError(
            f"tradeoff: tolerance is of {', '.join(tolerance)}, quantities are "
            f"{', '.join(quantities)}; name the same"
        )
    for name, value in tolerance.items():
        require_number(value, f"tradeoff: tolerance of {name}", positive=True)
    return Tolerance(tolerance, 0.0)


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
