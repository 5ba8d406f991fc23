# SPDX-License-Identifier: MIT
"""Trade-off of speed for accuracy on a user's own scene: runs, search, recommendation."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import product
from statistics import geometric_mean
from typing import TypeVar

from mpi4py import MPI

import numpy as np

from ufl_beam.analysis.refinement_runs import Quantity, RefinementRuns
from ufl_beam.analysis.richardson import Cost, Cross, Level, size
from ufl_beam.analysis.targets import BUDGET_AIM, Choice, Prediction, Target, target_of
from ufl_beam.analysis.tradeoff_result import Dials, Refinement, Run, Tradeoff
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
from ufl_beam.parallel import communicator
from ufl_beam.progress_bar import progress_bar
from ufl_beam.simulation.initial_state import require_scheme
from ufl_beam.simulation.run import simulate
from ufl_beam.simulation.step_control import Adaptive
from ufl_beam.solvers.newton_options import Newton

NEWTON_SHARE = 0.1  # part of the error that another tolerance of Newton's method may change
MOST_DOUBTS, MOST_TRIALS = 4, 6  # refinements without self-convergence; settings tried
SHORT_CHOICE = 2.0  # settings that are tried in a shorter time are run three times; s
ROUNDING = 1e-9  # part of a quantity up to which changes are of rounding or Newton's method
BAR = "trade-off: {n} runs [{elapsed}{postfix}]"
STEP_ORDER = 2.0  # order of the schemes, at most; that of cells is twice their degree

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
    compared with the limit that the others are extrapolated to.  All settings are arguments of
    :func:`simulate`; several schemes, steps and meshes compete.

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
        mesh: The coarsest cells, or several kinds.
        newton: How exactly equilibria are found; of several the first is used, and the others are
            tried in the end.
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
    meshes = _several(Mesh() if mesh is None else mesh, Mesh, "mesh")
    newtons = _several(Newton() if newton is None else newton, Newton, "newton")
    schemes: tuple[Scheme, ...] = _several(scheme, object, "scheme")
    for i, one in enumerate(schemes):
        require_scheme(one, f"tradeoff: scheme[{i}]" if len(schemes) > 1 else "tradeoff: scheme")
    steps: tuple[float | Adaptive, ...] = _several(dt, object, "dt")
    for i, step in enumerate(steps):
        if not isinstance(step, Adaptive):
            require_number(step, f"tradeoff: dt[{i}]" if len(steps) > 1 else "tradeoff: dt")
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
    if not target.accepts(run.seconds, replace(best, run=run).ratio):
        notes.append(f"no setting was found that is nearer to {target}")
    return Tradeoff(
        runs=tuple(runs.runs.values()), best=run, t=t, crosses=crosses,
        units=dict(best.prediction.units), target=target, families=tuple(map(str, families)),
        notes=tuple(notes), spent=runs.spent,
    )  # fmt: skip


@dataclass(frozen=True)
class _Found:
    """Setting that was run, and what the runs of its family predict."""

    run: Run
    prediction: Prediction

    @property
    def choice(self) -> Choice:
        """The setting with its wall time and the predicted error."""
        _, refine, level, _ = self.run.refinement
        return Choice(refine, level, self.run.seconds, self.prediction.ratio(refine, level))

    @property
    def ratio(self) -> float:
        """Largest distance from a limit, in its unit."""
        crosses, values = self.prediction.crosses, self.run.values
        return self.prediction.largest({n: values[n] - c.limit for n, c in crosses.items()})

    def rank(self, target: Target) -> tuple[bool, float]:
        """The least is the best."""
        return target.rank(self.run.seconds, self.ratio, self.choice.ratio)


class _Search:
    """Search from coarse to fine in one family of dials until the setting is known that serves."""

    def __init__(self, runs: RefinementRuns, family: int, target: Target) -> None:
        self._runs, self._family, self._target = runs, family, target
        # Times of settings over the cost that was fitted: machines are noisy
        self._slower: list[float] = []

    def find(self, others: Sequence[_Found]) -> _Found:
        """Find the setting; TradeoffError if none serves, or ``others`` are better."""
        runs, target = self._runs, self._target
        base: Level = (0, 0)
        doubts: list[str] = []
        tried: list[Run] = []
        while True:
            prediction, doubt, moved = self._predict(base)
            if prediction is None:
                doubts.append(doubt)
                if len(doubts) == MOST_DOUBTS:
                    raise TradeoffError("self-convergence is not seen" + "".join(doubts))
                base = moved
                continue
            choice = target.choose(prediction.choices())
            aim = target.objective(choice)
            if any(aim > 2 * target.objective(one.choice) for one in others):
                raise TradeoffError("given up, others are better")
            i, j = prediction.finest
            cells_more = max(0, math.ceil(math.log2(choice.refine) - i))
            more = cells_more, max(0, math.ceil(choice.level - j))
            serves = target.serves(choice)
            if not serves and more == (0, 0) and choice.seconds <= BUDGET_AIM * target.bounds[0]:
                more = prediction.bottleneck(choice)
            if more != (0, 0):
                base = base[0] + more[0], base[1] + more[1]
                continue
            if not serves:
                raise TradeoffError(
                    f"no setting serves; the nearest takes {choice.seconds:.3g} s and has errors "
                    f"of {choice.ratio:.2g} {target.measure}; steps and cells as they are "
                    "given are the coarsest, and the last digits of a quantity are not known"
                )
            one = Refinement(self._family, choice.refine, choice.level)
            runs.run([one], short=SHORT_CHOICE)
            if one in runs.failed:
                raise TradeoffError(f"the chosen setting failed: {runs.failed[one]}")
            found = _Found(runs.runs[one], prediction)
            if target.accepts(found.run.seconds, found.ratio):
                return found
            if found.run in tried or len(tried) + 1 == MOST_TRIALS:
                every = (_Found(run, prediction) for run in runs.of(self._family))
                return min(every, key=lambda one: one.rank(target))
            tried.append(found.run)
            self._slower.append(found.run.seconds * self._mean / choice.seconds)
            if found.ratio > choice.ratio:
                more = prediction.bottleneck(choice)
                base = base[0] + more[0], base[1] + more[1]

    def _predict(self, base: Level) -> tuple[Prediction | None, str, Level]:
        """Return what the runs around a base predict, or why they do not; the next base then."""
        i, j = base
        runs, levels = self._runs, Cross.levels(base)
        wanted = [Refinement(self._family, 2 ** level[0], level[1]) for level in levels]
        runs.run(wanted[:1])  # tells how long the others take
        runs.run(wanted)
        failed = [f"\n  {runs.dials(r)}: {runs.failed[r]}" for r in wanted if r in runs.failed]
        if failed:
            return None, "".join(failed), (i, j + 1)
        at = {level: runs.runs[one] for level, one in zip(levels, wanted, strict=True)}
        finest = at[i, j + 2]
        units = self._target.units({name: size(value) for name, value in finest.values.items()})
        orders = (2.0 * finest.dials.mesh.degree, STEP_ORDER)
        crosses = {}
        for name, unit in units.items():
            if unit == 0:
                raise SceneError(
                    f"tradeoff: quantity {name!r} is zero, so that no part of it can be a "
                    "tolerance; give tolerances by name, in units of the quantities"
                )
            values = {level: run.values[name] for level, run in at.items()}
            floor = max(self._target.negligible * unit, ROUNDING * size(finest.values[name]))
            crosses[name] = Cross.of(values, base, orders, floor)
        doubts = [f"\n  {name}{cross}" for name, cross in crosses.items() if not cross.seen]
        if doubts:
            cells = any(not (one.cells.seen and one.separate) for one in crosses.values())
            steps = any(not (one.steps.seen and one.separate) for one in crosses.values())
            where = f"\n  from {runs.dials(wanted[0])} on:"
            return None, where + "".join(doubts), (i + cells, j + steps)
        done = [run for run in runs.of(self._family) if run.refinement.newton == 0]
        measured = np.array([(run.steps, run.cells, run.seconds) for run in done])
        cost = Cost.of(*measured.T).slower(self._mean)
        cells_now = at[base].cells / wanted[0].refine
        return Prediction(crosses, cost, finest.steps / 2 ** (j + 2), cells_now, units), "", base

    @property
    def _mean(self) -> float:
        return geometric_mean(self._slower or [1.0])


def _find_all(runs: RefinementRuns, target: Target) -> tuple[list[_Found], list[str]]:
    """Find the setting of each family that serves, and notes on the others; raise if none does."""
    found: list[_Found] = []
    notes: list[str] = []
    wrong: list[SceneError] = []
    for family, dials in enumerate(runs.families):
        try:
            runs.begin(family)
        except SceneError as error:
            wrong.append(error)
            notes.append(f"{dials}: {error}")
            continue
        try:
            found.append(_Search(runs, family, target).find(found))
        except TradeoffError as error:
            notes.append(f"{dials}: {error}")
    if len(wrong) == len(runs.families):
        raise wrong[0]
    if not found:
        raise TradeoffError("tradeoff: " + "\n".join(notes), tuple(runs.runs.values()))
    return found, notes


def _other_newton(runs: RefinementRuns, best: _Found) -> Run:
    """The recommended run, or that with another tolerance which is faster and changes little."""
    chosen = best.run
    for number in range(1, len(runs.newtons)):
        one = best.run.refinement._replace(newton=number)
        runs.run([one], short=SHORT_CHOICE)
        if one in runs.runs:
            run = runs.runs[one]
            changes = {name: run.values[name] - value for name, value in best.run.values.items()}
            changed = best.prediction.largest(changes)
            if changed <= NEWTON_SHARE * best.choice.ratio and run.seconds < chosen.seconds:
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
