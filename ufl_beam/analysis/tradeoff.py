# SPDX-License-Identifier: MIT
"""Trade-off of speed for accuracy on a user's scene: runs, search and recommendation."""

from __future__ import annotations

import math
import time
from collections.abc import Callable, Mapping, Sequence
from contextlib import suppress
from contextvars import copy_context
from dataclasses import dataclass, field, replace
from fractions import Fraction
from functools import partial
from itertools import product
from typing import Any, NamedTuple

from mpi4py import MPI

import numpy as np
import numpy.typing as npt

from ufl_beam.analysis.richardson import Convergence, SelfConvergence, fit_cost, size
from ufl_beam.analysis.tradeoff_result import Refinement, Run, Setting, Target, Tradeoff
from ufl_beam.arrays import Array
from ufl_beam.errors import (
    ArgumentError,
    ConvergenceError,
    TradeoffError,
    each_warning_once,
    require_function,
    require_kind,
    require_number,
    require_switch,
    require_text,
)
from ufl_beam.mechanics.time_scheme import Scheme, order_of
from ufl_beam.model.beams import Mesh
from ufl_beam.model.scene import Scene
from ufl_beam.parallel import alone, communicator, progress_bar
from ufl_beam.simulation.initial_state import require_scheme
from ufl_beam.simulation.run import interrupt, require_times, simulate
from ufl_beam.simulation.solution import Solution
from ufl_beam.simulation.step_lengths import Adaptive
from ufl_beam.solvers.newton_options import Newton

MESHES = Mesh(degree=2), Mesh()  # meshes that are compared by default
NEWTONS = (Newton(),)
BAR = "trade-off: {n} runs [{elapsed}{postfix}]"
LEAST_USED = 0.3  # least error of the recommended run, as a fraction of a tolerance
# Largest uncertainty of a limit, as a fraction of a tolerance.  The sum of an error of LEAST_USED
# and this uncertainty is the tolerance.
MOST_UNCERTAINTY = 1 - LEAST_USED
# Largest negligible error, as a fraction of a tolerance.  The search accepts errors about the
# geometric mean of the least and the largest error, 0.55 for an accurate limit.  Four negligible
# errors share the rest: of unrefined cells, of unrefined steps, of options of Newton's method, and
# of the limit.
NEGLIGIBLE = (1 - math.sqrt(LEAST_USED)) / 4
NOISE = 1e-9  # noise as a fraction of a quantity: Newton's method leaves residuals of 1e-10
FURTHER = 2  # most levels from one base of the search to the next
REACH = 8  # most levels from the finest run to a setting; second-order errors fall by 2**16
SETTINGS_PER_LEVEL = 8  # between two settings a second-order error changes by a factor of 2**(2/8)
MOST_UNCONVERGED = 4  # number of bases without convergence after which the search ends
MOST_TRIALS = 3  # most settings tried; each costs about a quarter of the run for the limit
SCATTER = 0.1  # relative scatter of times of equal runs on an idle machine, see bench_budget.py

Quantity = Callable[[Solution], npt.ArrayLike]

Found = tuple[dict[str, Array], dict[str, float]]  # quantities and cost of a run


@each_warning_once()
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
    max_seconds: float = 600.0,
    progress: bool = True,
    comm: MPI.Intracomm | None = None,
) -> Tradeoff:
    """Find the cheapest setting for a tolerance, or the most accurate setting for a wall time.

    The scene is run on three levels of cells and of steps.  Richardson extrapolation estimates the
    errors of the runs, the limits and the required setting.  A run finer than this setting confirms
    the limits.  Up to three settings are then run, until errors are 0.3 to 1 times the tolerance,
    or the time is 0.8 to 1 times the budget.  A setting consists of arguments of :func:`simulate`.
    Coarse runs decide between several schemes, steps and meshes.

    Args:
        scene: Model; the ``cells`` of its beams are the coarsest cells of degree 1.
        quantities: Functions of a :class:`Solution` by name that return a number, or an array
            whose shape does not depend on steps and cells: ``{"tip": lambda s:
            s.position(beam.end)[-1]}``.  The error of an array is its largest error.
        scheme: Time scheme, or several.
        t: Beginning and end; s.
        dt: Longest step, s; or :class:`Adaptive` with the largest tolerance; or several of these.
        tolerance: Largest error of each quantity, by name, in its unit; or one number for all
            quantities, as a fraction of their largest magnitudes.
        budget: Largest wall time of one run, instead of a tolerance; s.
        mesh: Mesh that the search begins with, or several meshes; by default cells of degree 1
            and 2.
        newton: Options of Newton's method, or several.  The search uses the
            first options; one coarse run with each of the others compares them.  The
            recommendation uses the fastest options that change the quantities little.
        max_seconds: Largest total wall time of the runs; a run in progress is ended then; s.
        progress: Show the number of runs in a terminal or notebook.
        comm: Processes; each run uses one process, and several run at a time.  Simultaneous runs
            disturb each other's times: leave cores idle if times matter.

    Returns:
        The runs with their times and errors, and the recommended arguments.

    Raises:
        ArgumentError: The call is wrong, or the scene allows none of the schemes, steps and meshes.
        TradeoffError: The runs show no self-convergence, or would take too long.  The message
            describes the results; ``runs`` of the error has the runs.

    Example:
        >>> tip = {"tip": lambda run: run.position(beam.end)[-1]}
        >>> found = ub.tradeoff(scene, tip, scheme=ub.Static(), t=(0, 1), dt=0.5, tolerance=0.01)
        >>> run = ub.simulate(scene, **found.recommended)
    """
    require_kind(quantities, Mapping, "tradeoff: quantities")
    if not quantities:
        raise ArgumentError("tradeoff: quantities is empty; name at least one quantity")
    for name, quantity in quantities.items():
        require_text(name, "tradeoff: the name of a quantity")
        require_function(quantity, f"tradeoff: quantity {name!r}", "a Solution")
    target = _checked_target(quantities, tolerance, budget)
    require_number(max_seconds, "tradeoff: max_seconds", positive=True)
    require_switch(progress, "tradeoff: progress")
    comm = communicator(comm, "tradeoff: comm")
    t = require_times(t, "tradeoff")
    meshes = _several(MESHES if mesh is None else mesh, "mesh", partial(require_kind, kind=Mesh))
    newtons = _several(
        NEWTONS if newton is None else newton, "newton", partial(require_kind, kind=Newton)
    )
    schemes, steps = _several(scheme, "scheme", require_scheme), _several(dt, "dt", _require_step)
    families = [Setting(*x, newtons[0]) for x in product(schemes, steps, meshes)]
    with progress_bar(progress, comm, unit="run", bar_format=BAR) as bar:
        runs = _Runs(scene, quantities, families, newtons, t, max_seconds, comm, bar)
        best, others, notes = _find(runs, target)
        run = best.best()
    for search in others:
        if search.uncertainty > MOST_UNCERTAINTY:
            continue  # its coarse runs give no accurate limit
        for name, convergence in search.convergence.items():
            known = best.convergence[name]
            apart = size(convergence.limit - known.limit)
            if apart > convergence.uncertainty + known.uncertainty:
                notes.append(
                    f"{families[search.family]}: its limit of {name} differs by {apart:.2g} from "
                    "the limit of the recommended family"
                )
    return Tradeoff(
        runs=tuple(runs.runs.values()), best=run, t=t, convergence=best.convergence,
        units=best.units, target=target, families=tuple(map(str, families)),
        notes=tuple(notes + best.remarks(run)),
        spent=runs.spent,
    )  # fmt: skip


def _find(runs: _Runs, target: Target) -> tuple[_Search, list[_Search], list[str]]:
    """Search with the family that coarse runs predict to be the best; after a failure, the next.

    Return the successful search, the other searches, and notes on failed and other searches.
    """
    searches, notes = list[_Search](), list[str]()
    failed = list[ArgumentError | TradeoffError]()
    for k in range(len(runs.families)):
        try:
            runs.begin(k)
            searches.append(_Search(runs, k, target))
        except (ArgumentError, TradeoffError) as error:
            failed.append(error)
            notes.append(f"{runs.families[k]}: {error}")
    if not searches and all(isinstance(error, ArgumentError) for error in failed):
        raise failed[0]
    searches.sort(key=lambda search: search.objective)
    for n, best in enumerate(searches):
        try:
            best.find()
        except TradeoffError as error:
            notes.append(f"{runs.families[best.family]}: {error}")
            continue
        given_up = "given up, another is better in coarse runs"
        notes += [f"{runs.families[x.family]}: {given_up}" for x in searches[n + 1 :]]
        return best, [search for search in searches if search is not best], notes
    raise TradeoffError("tradeoff: " + "\n".join(notes), tuple(runs.runs.values()))


def _checked_target(
    quantities: Mapping[str, Quantity],
    tolerance: float | Mapping[str, float] | None,
    budget: float | None,
) -> Target:
    if (tolerance is None) == (budget is None):
        raise ArgumentError("tradeoff: give either a tolerance or a budget")
    if budget is not None:
        return Target({}, 1.0, require_number(budget, "tradeoff: budget", positive=True))
    if not isinstance(tolerance, Mapping):
        relative = require_number(tolerance, "tradeoff: tolerance", positive=True)
        return Target({}, relative, math.inf)
    if set(tolerance) != set(quantities):
        raise ArgumentError(
            f"tradeoff: tolerance is of {', '.join(tolerance)}, quantities are "
            f"{', '.join(quantities)}; name the same quantities"
        )
    for name, value in tolerance.items():
        require_number(value, f"tradeoff: tolerance of {name}", positive=True)
    return Target(tolerance, 0.0, math.inf)


def _several(values: Any, argument: str, check: Callable[..., object]) -> tuple[Any, ...]:
    """Return a value, or a sequence of values, as a tuple of checked values."""
    what = f"tradeoff: {argument}"
    if not isinstance(values, Sequence) or isinstance(values, str | bytes):
        check(values, what=what)
        return (values,)
    if not values:
        raise ArgumentError(f"{what} is empty")
    for i, value in enumerate(values):
        check(value, what=f"{what}[{i}]")
    return tuple(values)


def _require_step(step: float | Adaptive, what: str) -> None:
    if not isinstance(step, Adaptive):
        require_number(step, what, positive=True)


@dataclass(eq=False)
class _Runs:
    """Runs of a trade-off, each with its wall time, see :func:`tradeoff`."""

    scene: Scene
    quantities: Mapping[str, Quantity]
    families: Sequence[Setting]  # coarsest setting of each family: scheme, step, mesh
    newtons: Sequence[Newton]
    t: tuple[float, float]
    max_seconds: float  # largest total wall time of the runs; s
    comm: MPI.Intracomm
    bar: Any  # progress bar
    runs: dict[Refinement, Run] = field(default_factory=dict, init=False)
    failed: dict[Refinement, str] = field(default_factory=dict, init=False)  # reasons of failures
    spent: float = field(default=0.0, init=False)  # wall time of all runs; s
    begun: float = field(default_factory=time.perf_counter, init=False)  # s

    def begin(self, family: int) -> None:
        """Let each process compile by a run, of one step if ``dt`` is a number."""
        dt = self.families[family].dt
        until = min(self.t[1], self.t[0] + dt) if isinstance(dt, float | int) else self.t[1]
        with alone(), suppress(ConvergenceError):  # finer steps may converge
            self._simulate(until, self.families[family])

    def run(self, refinements: Sequence[Refinement], *, optional: bool = False) -> None:
        """Do the runs that are missing, several at a time if there are several processes.

        If the runs would exceed ``max_seconds``, omit them if they are ``optional``, else raise
        :class:`TradeoffError`.
        """
        missing = [r for r in refinements if r not in self.runs and r not in self.failed]
        if not missing:
            return
        finest, needed = self.setting(missing[-1]), sum(map(self._longest, missing))
        if self.spent + needed > self.max_seconds:
            if optional:
                return
            raise TradeoffError(
                f"the next {len(missing)} runs would take about {needed:.3g} s after "
                f"{self.spent:.3g} s of runs, more than max_seconds = {self.max_seconds:g} s; the "
                f"finest is {finest}"
            )
        self.bar.set_postfix_str(f"{len(missing)} more up to {finest}")
        rank, size = self.comm.rank, self.comm.size
        done = self.comm.allgather([self._outcome(r) for r in missing[rank::size]])
        self.bar.set_postfix_str("", refresh=False)
        self.bar.update(len(missing))
        for k, refinement in enumerate(missing):
            found = done[k % size][k // size]
            if isinstance(found, tuple):
                self._store(refinement, found)
            elif isinstance(found, ArgumentError) or (
                isinstance(found, TradeoffError) and not optional
            ):
                raise found
            else:
                self.failed[refinement] = str(found)

    def setting(self, refinement: Refinement) -> Setting:
        """Return the setting of a refinement.

        The error of an adaptive step is proportional to its length to the power 1 + order of the
        scheme.  So doubling the number of steps divides the tolerance by 2 to this power.
        """
        family, refine, level, newton = refinement
        coarsest = replace(self.families[family], newton=self.newtons[newton])
        if refine == 1 and level == 0:
            return coarsest  # unchanged, so that simulate checks the user's arguments
        dt, mesh, duration = coarsest.dt, coarsest.mesh, self.t[1] - self.t[0]
        if isinstance(dt, Adaptive):
            power = 1 + order_of(coarsest.scheme)
            dt = replace(dt, tolerance=dt.tolerance / 2 ** (power * level))
        else:
            number = max(1, math.ceil(duration / dt * (1 - 1e-9)))
            dt = duration / round(number * 2**level)
        return replace(coarsest, dt=dt, mesh=replace(mesh, refine=mesh.refine * refine))

    def in_family(self, family: int) -> list[Run]:
        return [run for refinement, run in self.runs.items() if refinement.family == family]

    def divisor(self, family: int) -> int:
        """Return the largest q ≤ SETTINGS_PER_LEVEL for which ``refine`` may be (q+1)/q, else 1."""
        mesh, scene = self.families[family].mesh, self.scene
        for q in range(SETTINGS_PER_LEVEL, 1, -1):
            finer = replace(mesh, refine=mesh.refine * Fraction(q + 1, q))
            try:
                for beam in scene.beams:
                    finer.vertices(beam, scene.attached[beam])
            except ArgumentError:
                continue
            return q
        return 1

    def _longest(self, refinement: Refinement) -> float:
        """Estimate the wall time (s) of a run from other runs of its family; 0 without these."""
        times = (
            run.seconds
            * 2 ** max(0.0, refinement.level - run.refinement.level)
            * max(1.0, float(refinement.refine / run.refinement.refine))
            for run in self.in_family(refinement.family)
        )
        return min(times, default=0.0)

    def _simulate(self, until: float, setting: Setting) -> Solution:
        """Simulate until a time (s); raise :class:`TradeoffError` when ``max_seconds`` are over."""

        def require_time() -> None:
            if time.perf_counter() > self.begun + self.max_seconds:
                raise TradeoffError(
                    f"max_seconds = {self.max_seconds:g} s are over, which ended the run {setting}"
                )

        context, t = copy_context(), (self.t[0], until)
        context.run(interrupt.set, require_time)
        return context.run(simulate, self.scene, t=t, progress=False, **vars(setting))

    def _outcome(self, refinement: Refinement) -> Found | Exception:
        """Return the result of a run on this process alone, or its error."""
        try:
            with alone():
                return self._compute(refinement)
        except Exception as error:
            # No refinement can avoid the first kind of error; the second one ends a late run.
            if type(error) in (ArgumentError, TradeoffError):
                return error
            return RuntimeError(f"{type(error).__name__}: {error}")  # any process can receive it

    def _compute(self, refinement: Refinement) -> Found:
        """Return the quantities and the cost of a run, as in :class:`Run`."""
        solution = self._simulate(self.t[1], self.setting(refinement))
        return {name: self._value(name, solution) for name in self.quantities}, {
            "seconds": solution.seconds,
            "building": solution.building,
            "steps": float(solution.substeps),
            "cells": float(len(solution.numbering.cells)),
            "iterations": solution.iterations / solution.substeps,
        }

    def _store(self, refinement: Refinement, found: Found) -> None:
        values, cost = found
        self.runs[refinement] = Run(refinement, self.setting(refinement), values, **cost)
        self.spent += cost["seconds"]

    def _value(self, name: str, solution: Solution) -> Array:
        """Return a quantity of a run, which must be finite, and of the same shape in all runs."""
        value = np.asarray(self.quantities[name](solution), dtype=float)
        if not np.isfinite(value).all():
            raise ArgumentError(f"tradeoff: quantity {name!r} is not finite")
        before = next((np.shape(run.values[name]) for run in self.runs.values()), value.shape)
        if before != value.shape:
            raise ArgumentError(
                f"tradeoff: quantity {name!r} has shape {before} in a run and {value.shape} "
                "in another with other steps or cells; give a number, or an array at times "
                "and places of your own (np.interp)"
            )
        return value


class _Candidate(NamedTuple):
    """Refinement of a possible run, with predicted time and errors, see :class:`_Search`."""

    refine: Fraction  # factor on the number of cells
    level: float  # the number of steps is multiplied by about 2**level
    seconds: float  # wall time; s
    likely: float  # largest error, divided by units; errors of cells and steps may cancel
    bound: float  # largest error, divided by units, if errors of cells and steps add up


class _Search:
    """Search with one family: three levels of cells and of steps from a base, and a finer run.

    While limits are uncertain, the base moves to about a level below the chosen setting, so that
    the finest levels are about a level above the setting.

    Errors and uncertainties are divided by ``units``.  These are the tolerances or, with a budget,
    the sizes of the quantities.
    """

    def __init__(self, runs: _Runs, family: int, target: Target) -> None:
        self.family = family
        self.convergence: dict[str, SelfConvergence] = {}
        self.units: dict[str, float] = {}
        self._runs, self._target = runs, target
        self._base = [0, 0]  # levels of cells and of steps
        self._unconverged: list[str] = []
        self._error_ratio = 1.0  # errors of runs divided by predicted errors
        # Times divided by predicted times, for each of the options of Newton's method.
        self._time_ratios = [1.0] * len(runs.newtons)
        self._newton = 0
        self._divisor = runs.divisor(family)
        self._refine_base()
        candidate = self._choose(NEGLIGIBLE)
        self.objective = candidate.seconds if math.isinf(target.budget) else candidate.bound

    def find(self) -> None:
        """Find the setting and its error by runs; raise TradeoffError if no setting is found."""
        while True:
            expected = min(self.uncertainty, NEGLIGIBLE)  # uncertainty after refinement of the base
            candidate, before = self._choose(expected), self._base.copy()
            levels = math.log2(candidate.refine), candidate.level
            far = np.greater(levels, self._finest).any()
            if far or self.uncertainty > self._negligible(candidate):
                further = np.clip(np.round(levels) - 1, before, np.add(before, FURTHER))
                self._base = [int(x) for x in further]
            if self._base == before:
                self._confirm(candidate)
                if self.uncertainty <= MOST_UNCERTAINTY:
                    break
                self._base[self._worst()[0]] += 1
            try:
                self._refine_base()
            except TradeoffError:
                if self.uncertainty > MOST_UNCERTAINTY:
                    raise
                self._base = before  # no finer base can run, but the limits are accurate enough
                break
        self._choose_newton()
        self._try_settings()

    @property
    def _finest(self) -> tuple[int, int]:
        """Finest levels of cells and of steps that show the convergence."""
        some = next(iter(self.convergence.values()))
        return some.cells.finest, some.steps.finest

    @property
    def uncertainty(self) -> float:
        """Largest uncertainty of a limit, divided by the unit of its quantity."""
        return max(x.uncertainty / self.units[n] for n, x in self.convergence.items())

    def best(self) -> Run:
        return min(self._runs.in_family(self.family), key=self._rank)

    def remarks(self, run: Run) -> list[str]:
        """Return notes on missing convergence, and on a run that misses the target."""
        notes = [
            f"the order of convergence is not seen: {name}{convergence}"
            for name, convergence in self.convergence.items()
            if not (convergence.cells.seen and convergence.steps.seen)
        ]
        if not self._accepts(run):
            ratio = self.ratio(run)
            said = f"no setting was found that is nearer to {self._target}: errors are "
            notes.append(f"{said}{ratio:.2g} of the {self._target.measure}")
            if ratio < LEAST_USED and run.refinement == self._at(1, 0, run.refinement.newton):
                notes[-1] += "; begin with coarser steps and cells"
        return notes

    def ratio(self, run: Run, reference: Run | None = None) -> float:
        """Return the largest distance from the limits, or another run, divided by ``units``."""
        limits = {name: convergence.limit for name, convergence in self.convergence.items()}
        goal = reference.values if reference else limits
        return max(size(run.values[name] - goal[name]) / unit for name, unit in self.units.items())

    # -- runs ----------------------------------------------------------------------------------

    def _at(self, refine: Fraction | int, level: float, newton: int = 0) -> Refinement:
        return Refinement(self.family, Fraction(refine), float(level), newton)

    def _refine_base(self) -> None:
        """Run two or three levels from the base; refine it while limits are too uncertain."""
        while True:
            i, j = self._base
            # Three levels of cells, and of steps
            along = [[self._at(2 ** (i + k), j) for k in range(3)]]
            along.append([self._at(2**i, j + k) for k in range(3)])
            wanted = [along[0][0], along[0][1], along[1][1]]
            self._runs.run(wanted[:1])  # its time predicts the times of the other runs
            self._runs.run(wanted)
            failed = [self._runs.failed[run] for run in wanted if run in self._runs.failed]
            if failed:
                self._move_base(failed[0], axis=1)
                continue
            values = [self._runs.runs[run].values for run in wanted]
            for name, value in values[-1].items():
                unit = self._target.absolute.get(name, self._target.relative * size(value))
                if unit == 0:
                    raise ArgumentError(
                        f"tradeoff: quantity {name!r} is zero, so that its error cannot be a "
                        "fraction of it; leave it out, or give tolerances by name, in units of the "
                        "quantities, and no budget"
                    )
                self.units[name] = unit
            for line, finer in zip(along, values[1:], strict=True):
                if not self._matters(values[0], finer):
                    line.pop()  # two levels suffice
            self._runs.run([run for line in along for run in line])
            along = [[run for run in line if run in self._runs.runs] for line in along]
            family = self._runs.families[self.family]
            orders = 2.0 * family.mesh.degree, float(order_of(family.scheme))
            for name in self.units:
                levels = ([self._runs.runs[run].values[name] for run in line] for line in along)
                cells, steps = map(Convergence.estimate, levels, self._base, orders)
                self.convergence[name] = SelfConvergence.extrapolate(values[0][name], cells, steps)
            if self.uncertainty <= MOST_UNCERTAINTY or self._worst()[1]:
                return
            self._move_base("".join(f"\n  {name}{x}" for name, x in self.convergence.items()))

    def _matters(self, values: Mapping[str, Array], finer: Mapping[str, Array]) -> bool:
        """Return whether a change between levels is too large to be neglected."""
        least = NEGLIGIBLE if math.isinf(self._target.budget) else 0.0
        return any(
            size(finer[name] - values[name]) > max(least * unit, NOISE * size(finer[name]))
            for name, unit in self.units.items()
        )

    def _worst(self) -> tuple[int, bool]:
        """Return the larger source of uncertainty, cells (0) or steps (1), and if changes fall."""
        sources = [
            (convergence.error_bound / self.units[name], axis, convergence.seen)
            for name, x in self.convergence.items()
            for axis, convergence in enumerate((x.cells, x.steps))
        ]
        return max(sources)[1:]

    def _move_base(self, said: str, axis: int | None = None) -> None:
        """Refine cells (``axis`` 0) or steps (1) of the base; by default the larger error source.

        Raise :class:`TradeoffError` after ``MOST_UNCONVERGED`` bases without convergence.
        """
        where = self._runs.setting(self._at(2 ** self._base[0], self._base[1]))
        self._unconverged.append(f"\n  from {where} on: {said}")
        if len(self._unconverged) == MOST_UNCONVERGED:
            raise TradeoffError("self-convergence is not seen" + "".join(self._unconverged))
        self._base[self._worst()[0] if axis is None else axis] += 1

    def _confirm(self, candidate: _Candidate) -> None:
        """Confirm the limit, if time allows, by a run one level finer than a candidate."""
        i, j = self._base
        intervals = 2 * max(round(2**candidate.level), 2**j)
        finer = self._at(2 * max(candidate.refine, Fraction(2**i)), math.log2(intervals))
        self._runs.run([finer], optional=True)
        if finer in self._runs.runs:
            values, at = self._runs.runs[finer].values, (math.log2(finer.refine), finer.level)
            for name, convergence in self.convergence.items():
                self.convergence[name] = convergence.confirmed(values[name], *at)

    def _choose_newton(self) -> None:
        """Choose the fastest options of Newton's method that change the quantities little."""
        first = self._at(2 ** self._base[0], self._base[1])
        strict = self._runs.runs[first]
        most = self._negligible(self._choose(self.uncertainty))
        least = (1 - SCATTER) * strict.stepping
        for newton in range(1, len(self._runs.newtons)):
            second = first._replace(newton=newton)
            self._runs.run([second], optional=True)
            run = self._runs.runs.get(second)
            if run is None:
                continue
            self._time_ratios[newton] = run.seconds / strict.seconds
            if run.stepping < least and self.ratio(run, strict) <= most:
                self._newton, least = newton, run.stepping

    def _try_settings(self) -> None:
        """Run the chosen setting; if it misses the target, correct predictions and try again."""
        for _ in range(MOST_TRIALS):
            candidate = self._choose(self.uncertainty)
            setting = self._at(candidate.refine, candidate.level, self._newton)
            self._runs.run([setting], optional=not self._rank(self.best())[0])
            if setting in self._runs.failed:
                raise TradeoffError(f"the chosen setting failed: {self._runs.failed[setting]}")
            run = self._runs.runs.get(setting)
            if run is None or self._accepts(run):
                return
            self._time_ratios[self._newton] *= run.seconds / candidate.seconds
            if candidate.likely > 0:
                # Errors below the uncertainty of the limit are unknown.
                self._error_ratio *= max(self.ratio(run), self.uncertainty) / candidate.likely

    # -- decisions -----------------------------------------------------------------------------

    def _negligible(self, candidate: _Candidate) -> float:
        """Return the largest negligible error: a fraction of the tolerance, or of the error."""
        return NEGLIGIBLE * (1.0 if math.isinf(self._target.budget) else candidate.bound)

    def _choose(self, uncertainty: float) -> _Candidate:
        """Choose the cheapest setting that is accurate enough, or the most accurate in the budget.

        ``uncertainty`` of the limit is divided by units, see :class:`_Search`.
        """
        setting, top = self._runs.families[self.family], [2 ** (x + REACH) for x in self._finest]
        # The coarsest mesh of degree p has 1/p of the user's cells: the number of nodes is similar.
        first = math.ceil(self._divisor / setting.mesh.degree)
        refine = [Fraction(k, self._divisor) for k in _geometric(first, self._divisor * top[0])]
        # Numbers of steps are multiples of the user's, so that all runs reach the user's times.
        multiples = np.array(_geometric(1, top[1]), dtype=float)
        cell_levels, step_levels = np.log2(np.array(refine, dtype=float)), np.log2(multiples)
        likely, bound = self._errors(cell_levels, step_levels)
        seconds = self._time_ratios[self._newton] * self._seconds(
            2.0 ** cell_levels[:, None], multiples
        )
        if math.isinf(self._target.budget):
            # The target is the middle half of the allowed errors, on a logarithmic scale.
            largest = 1 - uncertainty
            least, most = ((LEAST_USED ** (1 - p)) * largest**p for p in (1 / 4, 3 / 4))
            allowed = (likely <= most) & (bound <= largest)
            costs = np.where(allowed, seconds, np.inf)
            # Avoid errors below ``least``, which are due to cancellation, even at twice the cost.
            used = allowed & (likely >= least) & (seconds <= 2 * costs.min())
            costs = np.where(used, seconds, np.inf) if used.any() else costs
            k = costs.argmin() if allowed.any() else bound.argmin()
        else:
            allowed = seconds <= (1 - SCATTER) * self._target.budget
            k = np.where(allowed, bound, np.inf).argmin()
            if not allowed.any() or bound.flat[k] > 1:
                k = k if allowed.any() else seconds.argmin()
                raise TradeoffError(
                    f"no setting serves; the nearest takes {seconds.flat[k]:.3g} s and has errors "
                    f"of {bound.flat[k]:.2g} {self._target.measure}; the given steps and cells "
                    "are the coarsest"
                )
        row, column = np.unravel_index(k, seconds.shape)
        predicted = (float(x.flat[k]) for x in (seconds, likely, bound))
        return _Candidate(refine[row], float(step_levels[column]), *predicted)

    def _errors(self, i: npt.ArrayLike, j: npt.ArrayLike) -> tuple[Array, Array]:
        """Predict errors, divided by units, on levels i of cells and j of steps; (len(i), len(j)).

        The first result has the largest errors of the quantities, the second one their bounds, as
        errors by cells and by steps may cancel.
        """
        likely, bound = [], []
        for name, convergence in self.convergence.items():
            both = (convergence.cells, i), (convergence.steps, j)
            cells, steps = (x.remaining_error(k).reshape(np.size(k), -1) for x, k in both)
            unit = self.units[name] / self._error_ratio
            likely.append(np.abs(cells[:, None] + steps).max(axis=2) / unit)
            bound.append((np.abs(cells).max(axis=1)[:, None] + np.abs(steps).max(axis=1)) / unit)
        return np.max(likely, axis=0), np.max(bound, axis=0)

    def _seconds(self, refine: npt.ArrayLike, multiples: npt.ArrayLike) -> Array:
        """Predict wall times with the first options of Newton's method; s."""
        runs = [run for run in self._runs.in_family(self.family) if run.refinement.newton == 0]
        a, b, c, d = fit_cost(*np.array([(r.steps, r.cells, r.seconds) for r in runs]).T)
        steps = runs[0].steps / 2 ** runs[0].refinement.level * np.asarray(multiples)
        cells = runs[0].cells / float(runs[0].refinement.refine) * np.asarray(refine)
        return np.asarray(a + b * cells + steps * (c + d * cells))

    def _accepts(self, run: Run) -> bool:
        """Return whether a run is accurate or fast enough, but not much better than required."""
        budget, ratio = self._target.budget, self.ratio(run)
        if math.isinf(budget):
            return LEAST_USED <= ratio <= 1 - self.uncertainty
        return (1 - 2 * SCATTER) * budget <= run.seconds <= budget

    def _rank(self, run: Run) -> tuple[bool, bool, float]:
        """Return a key that is smaller for better runs.

        Accurate runs are sorted by time, and come before other runs, sorted by error.  With a
        budget, fast runs are sorted by error, and come before other runs, sorted by time.  A run
        does not count as accurate if only errors that cancel make it so.
        """
        _, refine, level, newton = run.refinement
        bound = self._errors(math.log2(refine), level)[1].item()
        if math.isfinite(self._target.budget):
            slow = run.seconds > self._target.budget
            return slow, False, run.seconds if slow else bound
        inaccurate = self.ratio(run) + self.uncertainty > 1 or bound > 1
        seconds = self._time_ratios[newton] * float(self._seconds(float(refine), 2**level))
        return inaccurate, not self._accepts(run), self.ratio(run) if inaccurate else seconds


def _geometric(first: int, last: int) -> list[int]:
    """Return integers in nearly geometric progression, SETTINGS_PER_LEVEL for a factor of 2."""
    spread = first * 2 ** np.arange(0.0, math.log2(last / first) + 1e-9, 1 / SETTINGS_PER_LEVEL)
    return [int(x) for x in np.unique(np.round(spread))]
