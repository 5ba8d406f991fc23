# SPDX-License-Identifier: MIT
"""Calibration: parameters of a model fitted to measurements by least squares."""

from __future__ import annotations

import inspect
import math
import warnings
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, field, replace
from functools import partial
from typing import Any

from mpi4py import MPI

import numpy as np
import scipy  # its subpackages are loaded when they are used

from ufl_beam.analysis.derivatives import checked_case
from ufl_beam.analysis.parameter_study import study
from ufl_beam.arrays import Array, Index
from ufl_beam.display import counted
from ufl_beam.errors import (
    ArgumentError,
    ConvergenceError,
    ModelWarning,
    each_warning_once,
    require_all,
    require_count,
    require_function,
    require_kind,
    require_number,
    require_switch,
    shorten,
    warn,
)
from ufl_beam.model.scene import Scene
from ufl_beam.parallel import communicator
from ufl_beam.simulation.run import simulate
from ufl_beam.simulation.solution import Solution
from ufl_beam.structures.calibration_result import Calibration, Measurement

WHAT = "calibrate"

LEVEL = 0.95  # probability of an interval

STEP = 2.0**-16
"""Step of central differences in the search variables.  The relative error of a derivative is some
1e-10 by truncation, and 1e-7 by the round-off 1e-12 of a run."""

TOLERANCES = {"xtol": 1e-10, "ftol": 1e-10, "gtol": 1e-12}
"""The search ends when a step would change the variables or the cost by less; see scipy."""

ASSUMED = 0.01
"""Standard deviation assumed in the search where none is given, as a fraction of the largest
magnitude of the values."""

ROUND_OFF = 1e-7  # least estimated standard deviation, as a fraction of the assumed one

SETTLED, ROUNDS = 1e-3, 20
"""Relative change of estimated standard deviations at which they are final, and the most rounds."""

SINGULAR = 1e-6
"""Singular value of the Jacobian with columns of unit length below which a direction counts as
undetermined, as a fraction of the largest one; derivatives have errors of 1e-7."""

INVOLVED = 0.1  # least component of a parameter in a singular direction that is named
CORRELATED = 0.99  # correlation above which a warning is issued

WIDE = 1.0
"""Half width of an interval beyond which a warning is issued, in the search variables: a factor of
e for positive parameters."""

STALLED = 0.5
"""Further step of a search that has ended too early, where computed values jump; in standard
deviations."""

NEAR = 1e-4  # distance that counts as zero, in the search variables
RESTARTS = 3  # most further searches from an end that is too early
HALVINGS = 8  # most attempts to find a start at which all runs succeed

FAILURES = ConvergenceError, ArgumentError  # of runs during a search

LEAST_FREE = 0.5
"""Degrees of freedom of a measurement below which its residuals do not estimate a standard
deviation: the fit goes through its values, and each round would make the estimate smaller."""

Model = Callable[..., Scene]

Entry = float | tuple[float, float | None, float | None]  # start, or start with bounds


@each_warning_once()
def calibrate(
    model: Model,
    parameters: Mapping[str, Entry],
    measured: Sequence[Measurement],
    *,
    starts: int = 1,
    seed: int = 0,
    progress: bool = True,
    comm: MPI.Intracomm | None = None,
) -> Calibration:
    """Fit parameters of a model to measurements by least squares.

    The sum of squares of all residuals, divided by their standard deviations, is minimised by
    SciPy's ``least_squares`` (trust regions, reflective within bounds).  The search variable of a
    positive parameter is its logarithm, that of others the parameter divided by a scale.
    Derivatives are exact, see :func:`differentiate`, or central differences of runs where the
    scene or the quantity has none.  A run that fails during the search shortens the
    step of the search.

    Where no standard deviation is given, it is estimated from the residuals.  With several
    measurements the estimates and the fit are repeated until they agree.  A measurement with as few
    values as the fit can meet, such as one frequency, has no such estimate and needs ``sigma=``.

    Args:
        model: Function that returns the scene for values of the parameters.  It is called as
            ``model(**parameters, **measurement.arguments)``.
        parameters: Start of each parameter by name: a number, or (start, lower bound, upper bound),
            where a bound may be None.  A parameter is positive if its start is positive and it has
            no lower bound, or if its lower bound is positive.
        measured: Measurements.
        starts: Number of searches: from the start given, and from random starts within the bounds,
            a Latin hypercube.  A random start at which a run fails is moved halfway to the start
            given, repeatedly.  Under ``mpirun`` each of several searches runs on one process.
        seed: Seed of the random starts.
        progress: Show a progress bar in a terminal or notebook.
        comm: Processes; by default all.

    Returns:
        The parameters with the least cost, with intervals, residuals and the ends of all searches.

    Raises:
        ArgumentError: The model has no such argument, a start is outside its bounds, there are
            fewer values than parameters, a parameter has no effect on any computed value, or a
            standard deviation cannot be estimated.
        ConvergenceError: The run at the start given failed.

    Warns:
        ModelWarning: The data do not determine a parameter: computed values depend on fewer
            combinations of parameters than there are parameters, two parameters have a correlation
            beyond 0.99, an interval is wider than a factor of e, or a parameter is at its bound.
            Or the search ended where computed values jump.

    Example:
        >>> def cantilever(E):
        ...     steel = ub.Section.rectangle(b=0.1, h=0.2, E=E, nu=0.3, rho=7850.0)
        ...     arm = ub.Beam((0, 0), (2, 0), steel, cells=4, name="arm")
        ...     force = ub.PointLoad(arm.end, force=(0, -1e3), amplitude=lambda t: t)
        ...     return ub.Scene([arm], supports=[ub.Clamped(arm.start)], loads=[force])
        >>> bent = st.Measurement([0.5, 1.0], [-0.095e-3, -0.192e-3],
        ...     lambda run: run.displacement(run.scene["arm"].end)[:, 1],
        ...     scheme=ub.Static(), t=(0, 1), dt=0.5, sigma=1e-6)
        >>> fit = st.calibrate(cantilever, {"E": (100e9, 50e9, 500e9)}, [bent], starts=3)
        >>> print(f"{fit.parameters['E'] / 1e9:.0f} GPa, {fit.same_minimum} of 3 starts")
        207 GPa, 3 of 3 starts
    """
    comm = communicator(comm, f"{WHAT}: comm")
    require_function(model, f"{WHAT}: model", "the parameters")
    several = (measured,) if isinstance(measured, Measurement) else measured
    measurements = require_all(several, f"{WHAT}: measured", Measurement)
    variables = Variables.of(parameters)
    starts = require_count(starts, f"{WHAT}: starts")
    seed = require_count(seed, f"{WHAT}: seed", at_least=0)
    require_switch(progress, f"{WHAT}: progress")
    for measurement in measurements:
        _require_arguments(model, variables, measurement)
    number, p = sum(map(len, measurements)), len(variables.names)
    estimated = [m for m in measurements if m.sigma is None]
    if number < p + bool(estimated):
        raise ArgumentError(
            f"{WHAT}: {number} measured values are too few for {p} parameters"
            + (" and a standard deviation" if estimated else "")
            + "; leave out parameters, or measure more"
        )
    for measurement in estimated:
        if len(measurement) == 1:
            raise _without_estimate(measurement)
    points = _start_points(variables, starts, seed)

    problem = Problem(model, variables, measurements, comm)
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", ModelWarning)  # the final runs repeat those that matter
        _require_effects(problem)
        begins, ends, costs = _search_all(problem, points, progress)
        x = problem.reweight(ends[np.nanargmin(costs)])
        jacobian, residuals = problem.jacobian(x), problem.residuals(x)
    values = variables.values(x)
    solutions = tuple(problem.simulate(m, values) for m in measurements)

    covariance, undetermined = _covariance(jacobian)
    alone = [_covariance(rows)[0].diagonal() for rows in problem.split(jacobian)]
    deviations = np.sqrt(covariance.diagonal())
    with np.errstate(invalid="ignore"):
        correlations = covariance / np.outer(deviations, deviations)
    np.fill_diagonal(correlations, 1.0)
    quantile = scipy.special.stdtrit(number - p if estimated else np.inf, 0.5 + LEVEL / 2)
    slopes, widths = variables.slopes(x), quantile * deviations
    low, high = (variables.values(x + change) for change in (-widths, widths))
    intervals = {name: (low[name], high[name]) for name in values}
    faults = [*_faults(variables, x, widths, intervals, correlations, undetermined)]
    step, far = further_step(variables, x, jacobian, residuals)
    if far.any():
        moving = " and ".join(np.array(variables.names)[far])
        most = np.abs(step / deviations)[far].max()
        faults.append(
            "the search ended where computed values jump, as where friction sticks or a hinge "
            f"opens in another step: a further step would change {moving} by up to {most:.2g} "
            "standard deviations; use smaller steps dt, or other starts"
        )
    result = Calibration(
        parameters=values,
        intervals=intervals,
        covariance=covariance * np.outer(slopes, slopes),
        correlations=correlations,
        half_widths=widths * slopes,
        half_widths_alone=quantile * np.sqrt(alone) * slopes,
        measured=measurements,
        sigma=problem.split(problem.sigma),
        residuals=problem.split(-residuals * problem.sigma),
        cost=0.5 * float(residuals @ residuals),
        starts=np.array([[*variables.values(begin).values()] for begin in begins]),
        ends=np.array([[*variables.values(end).values()] for end in ends]),
        end_costs=costs,
        runs=problem.runs,
        failed=problem.failed,
        solutions=solutions,
        warnings=tuple(faults),
    )
    if comm.rank == 0:
        for message in result.warnings:
            warn(f"{WHAT}: {message}")
    return result


# -- parameters ------------------------------------------------------------------------------------


@dataclass(frozen=True)
class Variables:
    """Search variables x, which are zero at the start.

    A positive parameter is ``start exp(x)``, another one ``start + scale x``.

    Attributes:
        names: Names of the parameters; p in number.
        positive: True for positive parameters; (p,).
        start, scale: Numbers of the formulas above; (p,).
        limits: Lower and upper bounds of the parameters, which may be infinite; (2, p).
    """

    names: tuple[str, ...]
    positive: Index
    start: Array
    scale: Array
    limits: Array

    @classmethod
    def of(cls, parameters: Mapping[str, Entry]) -> Variables:
        """Check parameters and their bounds."""
        require_kind(parameters, Mapping, f"{WHAT}: parameters")
        if not parameters:
            raise ArgumentError(f"{WHAT}: parameters is empty")
        rows = []
        for name, entry in parameters.items():
            require_kind(name, str, f"{WHAT}: parameters: name")
            what = f"{WHAT}: parameters[{name!r}]"
            try:
                start, low, high = entry if isinstance(entry, Sequence) else (entry, None, None)
            except ValueError:
                raise ArgumentError(
                    f"{what} = {shorten(entry)} must be a start, or (start, lower, upper)"
                ) from None
            start = require_number(start, what)
            positive = low is None and start > 0
            low = -math.inf if low is None else require_number(low, f"{what}: bound")
            high = math.inf if high is None else require_number(high, f"{what}: bound")
            if not low <= start <= high or not low < high:
                raise ArgumentError(
                    f"{what}: {start:g} is not between the bounds {low:g} and {high:g}"
                )
            scale = (high - low) / 2 if math.isfinite(high - low) else abs(start)
            if not scale:
                raise ArgumentError(f"{what} = 0 has no scale; give (start, lower, upper)")
            rows.append((positive or low > 0, start, scale, 0.0 if positive else low, high))
        signs, begin, scales, *limits = map(np.array, zip(*rows, strict=True))
        return cls(tuple(parameters), signs, begin, scales, np.array(limits))

    def values(self, x: Array) -> dict[str, float]:
        """Return the parameters by name, within their bounds."""
        with np.errstate(over="ignore"):
            p = np.where(self.positive, self.start * np.exp(x), self.start + self.scale * x)
        return dict(zip(self.names, map(float, np.clip(p, *self.limits)), strict=True))

    def slopes(self, x: Array) -> Array:
        """Return the derivatives of the parameters by the search variables; (p,)."""
        return np.where(self.positive, self.start * np.exp(x), self.scale)

    @property
    def bounds(self) -> Array:
        """Bounds of the search variables; (2, p)."""
        with np.errstate(all="ignore"):
            logarithms = np.log(self.limits / self.start)
        return np.where(self.positive, logarithms, (self.limits - self.start) / self.scale)


def _require_arguments(model: Model, variables: Variables, measurement: Measurement) -> None:
    if twice := [name for name in variables.names if name in measurement.arguments]:
        raise ArgumentError(
            f"{WHAT}: {twice[0]} is a parameter, and an argument of {measurement!r}"
        )
    try:
        signature = inspect.signature(model)
    except (TypeError, ValueError):
        return  # some objects have none
    try:
        signature.bind(**dict.fromkeys(variables.names), **measurement.arguments)
    except TypeError as error:
        raise ArgumentError(
            f"{WHAT}: parameters do not fit the model: {error}; its arguments are "
            f"{', '.join(signature.parameters)}"
        ) from None


def _start_points(variables: Variables, starts: int, seed: int) -> Array:
    """Return the start given and random starts within the bounds; (starts, p)."""
    points = np.zeros((starts, len(variables.names)))
    if starts > 1:
        low, high = variables.bounds
        for i in np.flatnonzero(~np.isfinite(high - low)):
            raise ArgumentError(
                f"{WHAT}: {starts} starts need bounds of {variables.names[i]}; give (start, "
                "lower, upper)"
            )
        random = scipy.stats.qmc.LatinHypercube(len(low), rng=np.random.default_rng(seed))
        points[1:] = scipy.stats.qmc.scale(random.random(starts - 1), low, high)
    return points


# -- search ----------------------------------------------------------------------------------------


@dataclass
class Problem:
    """Least squares problem of a calibration, with N measured values and p parameters.

    Attributes:
        comm: Processes of each run; None for those that are active.
        runs, failed: Number of runs so far, and of those that failed.
        sigma: Standard deviations, given, assumed or estimated; (N,).
    """

    model: Model
    variables: Variables
    measured: tuple[Measurement, ...]
    comm: MPI.Intracomm | None
    runs: int = 0
    failed: int = 0
    _last: tuple[bytes, Array] = (b"", np.empty(0))  # variables and computed values of a run
    _refused: set[Measurement] = field(default_factory=set)  # whose runs have no derivatives

    def __post_init__(self) -> None:
        sizes = (np.abs(m.values).max() or 1.0 for m in self.measured)
        sigma = (
            np.full(len(m), ASSUMED * size if m.sigma is None else m.sigma)
            for m, size in zip(self.measured, sizes, strict=True)
        )
        self.sigma = np.concatenate([*sigma])

    def split(self, rows: Array) -> tuple[Array, ...]:
        """Return the rows of each measurement."""
        return tuple(np.split(rows, np.cumsum([*map(len, self.measured)])[:-1]))

    def simulate(self, measurement: Measurement, values: dict[str, float]) -> Solution:
        """Run the model of a measurement."""
        self.runs += 1
        scene = self.model(**values, **measurement.arguments)
        require_kind(scene, Scene, f"{WHAT}: model(...)")
        return simulate(
            scene, measurement.scheme, t=measurement.t, dt=measurement.dt, mesh=measurement.mesh,
            newton=measurement.newton, progress=False, comm=self.comm,
        )  # fmt: skip

    def residuals(self, x: Array) -> Array:
        """Return computed minus measured values, divided by standard deviations; (N,).

        They are NaN if a run fails, so that the search shortens its step.
        """
        measured = np.concatenate([m.values for m in self.measured])
        try:
            return np.asarray((self._all_computed(x) - measured) / self.sigma)
        except FAILURES:
            self.failed += 1
            return np.full_like(self.sigma, math.nan)

    def jacobian(self, x: Array) -> Array:
        """Return the derivatives of the residuals by the variables; (N, p).

        Raises:
            ConvergenceError, ArgumentError: Runs failed.
        """
        pieces = zip(self.measured, self.split(self._all_computed(x)), strict=True)
        rows = np.concatenate([self._derivatives(m, x, computed) for m, computed in pieces])
        return np.asarray(rows / self.sigma[:, None])

    def _all_computed(self, x: Array) -> Array:
        if self._last[0] != x.tobytes():
            self._last = x.tobytes(), np.concatenate([self._computed(m, x) for m in self.measured])
        return self._last[1]

    def _computed(self, measurement: Measurement, x: Array) -> Array:
        """Return the computed values of a measurement; the same bits on all processes; (m,)."""
        row = measurement.computed(self.simulate(measurement, self.variables.values(x)))
        return row if self.comm is None else self.comm.bcast(row)

    def _derivatives(self, measurement: Measurement, x: Array, computed: Array) -> Array:
        """Return the derivatives of the values of a measurement, which are known at x; (m, p)."""
        if measurement not in self._refused:
            model = partial(self.model, **measurement.arguments)
            (t0, t1), dt = measurement.t, measurement.dt
            arguments = (measurement.scheme, t0, dt, measurement.newton, measurement.mesh)
            try:
                case = checked_case(WHAT, model, self.variables.values(x), *arguments)
                row = case.run(t1, dt).of(measurement.computed) * self.variables.slopes(x)
                self.runs += 1
                return row if self.comm is None else self.comm.bcast(row)
            except ArgumentError:  # an effect of the scene, or a quantity, has no derivatives
                self._refused.add(measurement)
        return self._differences(measurement, x, computed)

    def _differences(self, measurement: Measurement, x: Array, computed: Array) -> Array:
        """Return differences between runs for :meth:`_derivatives`.

        They are central differences, but one-sided at a bound, and where a run fails.
        """
        columns, (low, high) = [], self.variables.bounds
        for i in range(len(x)):
            sides = list[tuple[float, Array]]()
            for end in max(x[i] - STEP, low[i]), min(x[i] + STEP, high[i]):
                moved = x.copy()
                moved[i] = end
                try:
                    sides.append((end, self._computed(measurement, moved)))
                except FAILURES:
                    self.failed += 1
                    if any(known == x[i] for known, _ in sides):
                        raise
                    sides.append((x[i], computed))
            (a, below), (b, above) = sides
            columns.append((above - below) / (b - a))
        return np.stack(columns, axis=1)

    def search(self, x: Array) -> tuple[Array, Array, float]:
        """Search for a minimum from x; return the start of the search, its end, and the cost there.

        A start at which a run fails is moved halfway to zero, the start given, until runs succeed.
        A search ends too early where computed values jump; it goes on from beyond the jump.
        """
        for _ in range(HALVINGS):
            if not np.isnan(self.residuals(x)).any():
                break
            x = np.divide(x, 2.0)
        else:
            raise ArgumentError(f"{WHAT}: runs fail at all points between two starts")
        best = self._minimum(x)
        for _ in range(RESTARTS):
            step, far = further_step(self.variables, best.x, best.jac, best.fun)
            beyond = np.clip(best.x + step, *self.variables.bounds)
            if not far.any() or np.isnan(self.residuals(beyond)).any():
                break
            further = self._minimum(beyond)
            if further.cost >= best.cost:
                break
            best = further
        return x, best.x, float(best.cost)

    def _minimum(self, x: Array) -> Any:
        return scipy.optimize.least_squares(
            self.residuals, x, self.jacobian, bounds=self.variables.bounds, **TOLERANCES
        )

    def reweight(self, x: Array) -> Array:
        """Return the minimum near x with estimated standard deviations, which become final.

        The estimate of a measurement is sqrt(S/(m - h)) with the sum S of its squared residuals and
        its part h of the trace of the hat matrix; the sum of h is p.

        Raises:
            ArgumentError: The values of a measurement are too few for an estimate.
        """
        unknown = [k for k, m in enumerate(self.measured) if m.sigma is None]
        least, free = ROUND_OFF * self.sigma, dict[int, float]()
        for _ in range(ROUNDS if unknown else 0):
            orthogonal, before = self.split(np.linalg.qr(self.jacobian(x))[0]), self.sigma.copy()
            rows = self.split(self.residuals(x) * before)
            for k in unknown:
                free[k] = len(rows[k]) - float(np.sum(orthogonal[k] ** 2))
                self.split(self.sigma)[k][:] = math.sqrt(np.sum(rows[k] ** 2) / max(free[k], 1.0))
            self.sigma = np.maximum(self.sigma, least)
            if (np.abs(before / self.sigma - 1.0) < SETTLED).all() or len(self.measured) == 1:
                break  # the minimum of one measurement does not depend on its deviation
            _, x, _ = self.search(x)
        for k in unknown:
            if free[k] < LEAST_FREE:
                raise _without_estimate(self.measured[k])
        return x


def _without_estimate(measurement: Measurement) -> ArgumentError:
    """Return the error of a measurement without a standard deviation and with too few values."""
    number = counted((len(measurement), "value", "values"))
    return ArgumentError(
        f"{WHAT}: {measurement.name} has {number}, too few to estimate a standard deviation, "
        "because the parameters can be chosen so that its residuals vanish; give sigma="
    )


def _require_effects(problem: Problem) -> None:
    """Raise unless runs at the start succeed, and each parameter has an effect on them."""
    names = problem.variables.names
    try:
        jacobian = problem.jacobian(np.zeros(len(names)))
    except ConvergenceError as error:
        error.args = (f"{WHAT}: the run at the start failed; give another start. {error}",)
        raise
    for name, column in zip(names, jacobian.T, strict=True):
        if not column.any():
            raise ArgumentError(
                f"{WHAT}: the parameter {name} has no effect on the computed values at its start; "
                "begin where it has one (a hinge has opened, a cell yields), add a measurement, or "
                "leave it out"
            )


def _search_all(problem: Problem, points: Array, progress: bool) -> tuple[Array, Array, Array]:
    """Search from each point; return starts, ends and costs, which are NaN for failed searches.

    Several searches are the members of a study.
    """
    if len(points) == 1:
        begin, end, cost = problem.search(points[0])
        return begin[None], end[None], np.array([cost])

    def member(start: list[float]) -> dict[str, Any]:
        own = replace(problem, comm=None, runs=0, failed=0)
        begin = np.array(start)
        end, cost = np.full_like(begin, math.nan), math.nan
        with suppress(*FAILURES):
            begin, end, cost = own.search(begin)
        return {"start": begin, "end": end, "cost": cost, "counts": [own.runs, own.failed]}

    member.__name__ = WHAT
    cases = [{"start": [*map(float, point)]} for point in points]
    found = study(member, cases, progress=progress, comm=problem.comm)
    if np.isnan(found["cost"]).all():
        raise ArgumentError(f"{WHAT}: all searches failed; give narrower bounds around the start")
    runs, failed = found["counts"].sum(axis=0).astype(int)
    problem.runs, problem.failed = problem.runs + int(runs), problem.failed + int(failed)
    return found["start"], found["end"], found["cost"]


# -- what data determine ---------------------------------------------------------------------------


def _covariance(jacobian: Array) -> tuple[Array, list[Index]]:
    """Return the covariance of variables, and the variables in each undetermined direction.

    Args:
        jacobian: Derivatives of values divided by their standard deviations; (N, p).

    Returns:
        The inverse of the product of the Jacobian with itself; (p, p).  A variable in an
        undetermined direction has an infinite variance, and NaN as covariance with others.
    """
    lengths = np.sqrt(np.sum(jacobian**2, axis=0))
    lengths[lengths == 0.0] = 1.0
    unit = jacobian / lengths
    squares, directions = np.linalg.eigh(unit.T @ unit)
    weak = squares <= SINGULAR**2 * squares[-1]
    undetermined = [np.flatnonzero(row > INVOLVED) for row in np.abs(directions[:, weak].T)]
    rows = directions[:, ~weak].T / np.sqrt(squares[~weak, None]) / lengths
    covariance: Array = rows.T @ rows
    for group in undetermined:
        covariance[group] = covariance[:, group] = math.nan
        covariance[group, group] = math.inf
    return covariance, undetermined


def further_step(
    variables: Variables, x: Array, jacobian: Array, residuals: Array
) -> tuple[Array, Array]:
    """Return the further step of a search that has ended at x, and where it is too long; (p,) each.

    It is the minimum of the linearized problem within the bounds, or zero if this is far away,
    because the data hardly determine a parameter.  ``jacobian`` has the derivatives of
    ``residuals``; (N, p) and (N,).
    """
    step = scipy.optimize.lsq_linear(jacobian, -residuals, variables.bounds - x).x
    if np.abs(step).max() > WIDE:
        step = 0.0 * step
    # The residuals tell the sizes of errors if standard deviations are assumed.
    deviations = np.sqrt(_covariance(jacobian)[0].diagonal() * np.mean(residuals**2))
    return step, np.abs(step) > np.maximum(STALLED * deviations, NEAR)


def _faults(
    variables: Variables, x: Array, widths: Array, intervals: dict[str, tuple[float, float]],
    correlations: Array, undetermined: list[Index],
) -> Iterator[str]:  # fmt: skip
    """Yield a sentence for each parameter, or group of them, that the data do not determine."""
    names, values, (low, high) = variables.names, variables.values(x), variables.bounds
    remedy = "fix a parameter, or add a measurement that depends on it in another way"
    for group in undetermined:
        several = " and ".join(names[i] for i in group)
        effect = "it has no effect at the minimum"
        if len(group) > 1:
            effect = "they have the same effect on all computed values"
        yield f"the data do not determine {several}: {effect}; {remedy}"
    for i, name in enumerate(names):
        for j in range(i):
            if abs(correlations[i, j]) > CORRELATED:
                yield (
                    f"the data hardly distinguish {names[j]} and {name}: their correlation is "
                    f"{correlations[i, j]:.4f}; {remedy}"
                )
        if WIDE < widths[i] < math.inf:
            least, most = intervals[name]
            yield (
                f"the data hardly determine {name}: its 95 % interval is {least:.3g} to "
                f"{most:.3g}; {remedy}"
            )
        for word, bound in ("lower", low[i]), ("upper", high[i]):
            if abs(x[i] - bound) < NEAR:
                yield (
                    f"{name} = {values[name]:.4g} is at its {word} bound, so that its interval and "
                    "those of others do not hold; give wider bounds, or fix it"
                )
