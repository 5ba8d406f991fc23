# SPDX-License-Identifier: MIT
"""Calibration: parameters of a model fitted to measurements by least squares."""

from __future__ import annotations

import inspect
import math
import warnings
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager, suppress
from dataclasses import dataclass, field, replace
from functools import partial
from typing import Any, NamedTuple

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

ROUND_OFF = 1e-9  # least estimated standard deviation, as a fraction of the largest magnitude

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

STALLED, LEAST_MOVE = 0.5, 1e-6
"""Further step of a search that has ended too early, where computed values jump: in standard
deviations, and in the search variables, in which errors of derivatives move the end."""

RESTARTS = 3  # most further searches from such an end
HALVINGS = 8  # most attempts to find a start at which all runs succeed
AT_BOUND = 1e-4  # distance from a bound that counts as zero, in the search variables

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
    least = p + any(m.sigma is None for m in measurements)
    if number < least:
        raise ArgumentError(
            f"{WHAT}: {number} measured values are too few for {p} parameters"
            + (" and a standard deviation" if least > p else "")
            + "; leave out parameters, or measure more"
        )
    for measurement in measurements:
        if measurement.sigma is None and len(measurement) == 1:
            raise _without_estimate(measurement)
    points = _start_points(variables, starts, seed)

    sigma = [_assumed_sigma(m) for m in measurements]
    problem = Problem(model, variables, measurements, sigma, comm)
    with _quiet():
        _require_effects(problem)
        found = _search_all(problem, points, progress, comm)
        x = problem.reweight(found[int(np.nanargmin([search.cost for search in found]))].end)
        computed, jacobian = problem.linearize(x)
    values = variables.values(x)
    solutions = tuple(problem.simulate(m, values) for m in measurements)

    stacked = np.concatenate(problem.sigma)
    residuals = np.concatenate([m.values for m in measurements]) - computed
    scaled, splits = jacobian / stacked[:, None], problem.splits
    covariance, undetermined = _covariance(scaled)
    alone = [_covariance(rows)[0].diagonal() for rows in np.split(scaled, splits)]
    deviations = np.sqrt(covariance.diagonal())
    with np.errstate(invalid="ignore"):
        correlations = covariance / np.outer(deviations, deviations)
    np.fill_diagonal(correlations, 1.0)
    quantile = scipy.special.ndtri(0.5 + LEVEL / 2)
    if least > p:
        quantile = scipy.special.stdtrit(number - p, 0.5 + LEVEL / 2)
    slopes, widths = variables.slopes(x), quantile * deviations
    low, high = (variables.values(x + change) for change in (-widths, widths))
    faults = [*_faults(variables, x, widths, correlations, undetermined)]
    step, far = further_step(variables, x, scaled, -residuals / stacked)
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
        intervals={name: (low[name], high[name]) for name in values},
        covariance=covariance * np.outer(slopes, slopes),
        correlations=correlations,
        half_widths=widths * slopes,
        half_widths_alone=quantile * np.sqrt(alone) * slopes,
        measured=measurements,
        sigma=tuple(problem.sigma),
        residuals=tuple(np.split(residuals, splits)),
        cost=0.5 * float(np.sum((residuals / stacked) ** 2)),
        starts=np.array([[*variables.values(search.start).values()] for search in found]),
        ends=np.array([[*variables.values(search.end).values()] for search in found]),
        end_costs=np.array([search.cost for search in found]),
        runs=problem.runs + sum(search.runs for search in found),
        failed=problem.failed + sum(search.failed for search in found),
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
        lower, upper: Bounds of the parameters, which may be infinite; (p,).
    """

    names: tuple[str, ...]
    positive: Index
    start: Array
    scale: Array
    lower: Array
    upper: Array

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
            positive = start > 0 if low is None else low > 0
            low = -math.inf if low is None else require_number(low, f"{what}: bound")
            high = math.inf if high is None else require_number(high, f"{what}: bound")
            if not low <= start <= high or not low < high:
                raise ArgumentError(
                    f"{what}: {start:g} is not between the bounds {low:g} and {high:g}"
                )
            scale = (high - low) / 2 if math.isfinite(high - low) else abs(start)
            if not scale:
                raise ArgumentError(f"{what} = 0 has no scale; give (start, lower, upper)")
            rows.append((positive, start, start if positive else scale, low, high))
        return cls(tuple(parameters), *map(np.array, zip(*rows, strict=True)))

    def values(self, x: Array) -> dict[str, float]:
        """Return the parameters by name, within their bounds."""
        with np.errstate(over="ignore"):
            p = np.where(self.positive, self.start * np.exp(x), self.start + self.scale * x)
        p = np.clip(p, self.lower, self.upper)
        return dict(zip(self.names, map(float, p), strict=True))

    def slopes(self, x: Array) -> Array:
        """Return the derivatives of the parameters by the search variables; (p,)."""
        return np.where(self.positive, self.start * np.exp(x), self.scale)

    def bounds(self) -> Array:
        """Return the bounds of the search variables; (2, p)."""
        ends = np.array([self.lower, self.upper])
        with np.errstate(all="ignore"):
            logarithms = np.log(ends / self.start)
        logarithms[~np.isfinite(ends)] = ends[~np.isfinite(ends)]
        return np.where(self.positive, logarithms, (ends - self.start) / self.scale)


def _require_arguments(model: Model, variables: Variables, measurement: Measurement) -> None:
    """Raise :class:`ArgumentError` unless the model accepts the arguments of a measurement."""
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
        low, high = variables.bounds()
        for name, finite in zip(variables.names, np.isfinite(high - low), strict=True):
            if not finite:
                raise ArgumentError(
                    f"{WHAT}: {starts} starts need bounds of {name}; give (start, lower, upper)"
                )
        random = scipy.stats.qmc.LatinHypercube(len(low), rng=np.random.default_rng(seed))
        points[1:] = low + (high - low) * random.random(starts - 1)
    return points


# -- search ----------------------------------------------------------------------------------------


class Search(NamedTuple):
    """Start and end of a search, with its numbers of runs; the end is NaN if the search failed."""

    start: Array
    end: Array
    cost: float
    runs: int
    failed: int


@contextmanager
def _quiet() -> Iterator[None]:
    """Ignore warnings of runs in a search; the final runs repeat those that matter."""
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", ModelWarning)
        yield


def _assumed_sigma(measurement: Measurement) -> Array:
    """Return the standard deviations of a measurement, given or assumed; (m,)."""
    sigma = measurement.sigma
    if sigma is None:
        sigma = ASSUMED * np.abs(measurement.values).max() or 1.0
    return np.broadcast_to(sigma, len(measurement)).astype(float)


@dataclass
class Problem:
    """Least squares problem of a calibration.

    Attributes:
        sigma: Standard deviations, by measurement; (m,) each.
        comm: Processes of each run; None for those that are active.
        runs, failed: Number of runs so far, and of those that failed.
    """

    model: Model
    variables: Variables
    measured: tuple[Measurement, ...]
    sigma: list[Array]
    comm: MPI.Intracomm | None
    runs: int = 0
    failed: int = 0
    _last: tuple[bytes, Array] = (b"", np.empty(0))  # variables and computed values of a run
    _refused: set[int] = field(default_factory=set)  # measurements whose runs have no derivatives

    @property
    def splits(self) -> Index:
        """Index of the first value of each measurement but the first."""
        return np.cumsum([*map(len, self.measured)])[:-1]

    def simulate(self, measurement: Measurement, values: dict[str, float]) -> Solution:
        """Run the model of a measurement."""
        self.runs += 1
        scene = self.model(**values, **measurement.arguments)
        require_kind(scene, Scene, f"{WHAT}: model(...)")
        return simulate(
            scene, measurement.scheme, t=measurement.t, dt=measurement.dt, mesh=measurement.mesh,
            newton=measurement.newton, progress=False, comm=self.comm,
        )  # fmt: skip

    def computed(self, x: Array) -> Array:
        """Return the computed values of all measurements; (N,)."""
        if self._last[0] != x.tobytes():
            values = self.variables.values(x)
            rows = [self._computed(m, values) for m in self.measured]
            self._last = x.tobytes(), np.concatenate(rows)
        return self._last[1]

    def _computed(self, measurement: Measurement, values: dict[str, float]) -> Array:
        """Return the computed values of a measurement; the same bits on all processes; (m,)."""
        row = measurement.computed(self.simulate(measurement, values))
        return row if self.comm is None else self.comm.bcast(row)

    def linearize(self, x: Array) -> tuple[Array, Array]:
        """Return the computed values and their derivatives by the variables; (N,), (N, p)."""
        base = self.computed(x)
        pieces = zip(self.measured, np.split(base, self.splits), strict=True)
        return base, np.concatenate([self._differentiate(m, x, own) for m, own in pieces])

    def _differentiate(self, measurement: Measurement, x: Array, base: Array) -> Array:
        """Return the derivatives of the values of a measurement, which are ``base`` at x; (m, p).

        Raises:
            ConvergenceError, ArgumentError: Runs failed.
        """
        if id(measurement) not in self._refused:
            model = partial(self.model, **measurement.arguments)
            (t0, t1), dt = measurement.t, measurement.dt
            arguments = (measurement.scheme, t0, dt, measurement.newton, measurement.mesh)
            try:
                case = checked_case(WHAT, model, self.variables.values(x), *arguments)
                row = case.run(t1, dt).of(measurement.computed) * self.variables.slopes(x)
                self.runs += 1
                return row if self.comm is None else self.comm.bcast(row)
            except ArgumentError:  # an effect of the scene, or a quantity, has no derivatives
                self._refused.add(id(measurement))
        return self._differences(measurement, x, base)

    def _differences(self, measurement: Measurement, x: Array, base: Array) -> Array:
        """Return differences between runs for :meth:`_differentiate`.

        They are central differences, but one-sided at a bound, and where a run fails.

        Raises:
            ConvergenceError, ArgumentError: The runs on both sides failed.
        """
        columns, (low, high) = [], self.variables.bounds()
        for i in range(len(x)):
            known: list[tuple[float, Array]] = []
            errors: list[Exception] = []
            for end in max(x[i] - STEP, low[i]), min(x[i] + STEP, high[i]):
                moved = x.copy()
                moved[i] = end
                try:
                    known.append((end, self._computed(measurement, self.variables.values(moved))))
                except FAILURES as error:
                    self.failed += 1
                    errors.append(error)
            if len(errors) == 2:
                raise errors[0]
            if errors:
                known.append((x[i], base))
            (a, below), (b, above) = known
            columns.append((above - below) / (b - a))
        return np.stack(columns, axis=1)

    def _or_nan(self, x: Array) -> Array:
        """Return the computed values, or NaN if a run fails."""
        try:
            return self.computed(x)
        except FAILURES:
            self.failed += 1
            return np.full(sum(map(len, self.measured)), math.nan)

    def search(self, x: Array) -> tuple[Array, Array, float]:
        """Search for a minimum from x; return the start of the search, its end, and the cost there.

        A start at which a run fails is moved halfway to zero, the start given, until runs succeed.
        A search ends too early where computed values jump; it goes on from beyond the jump.
        """
        sigma = np.concatenate(self.sigma)
        values = np.concatenate([m.values for m in self.measured])
        for _ in range(HALVINGS):
            if not np.isnan(self._or_nan(x)).any():
                break
            x = np.divide(x, 2.0)
        else:
            raise ArgumentError(f"{WHAT}: runs fail at all points between two starts")
        start, best = x, None
        for _ in range(1 + RESTARTS):
            end = scipy.optimize.least_squares(
                lambda x: (self._or_nan(x) - values) / sigma, x,
                lambda x: self.linearize(x)[1] / sigma[:, None],
                bounds=self.variables.bounds(), method="trf", **TOLERANCES,
            )  # fmt: skip
            if best is not None and end.cost >= best.cost:
                break
            best = end
            step, far = further_step(self.variables, end.x, end.jac, end.fun)
            x = np.clip(end.x + step, *self.variables.bounds())
            if not far.any() or np.isnan(self._or_nan(x)).any():
                break
        assert best is not None
        return start, best.x, float(best.cost)

    def reweight(self, x: Array) -> Array:
        """Return the minimum near x with estimated standard deviations, which become final.

        The estimate of a measurement is sqrt(S/(m - h)) with the sum S of its squared residuals and
        its part h of the trace of the hat matrix; the sum of h is p.

        Raises:
            ArgumentError: The values of a measurement are too few for an estimate.
        """
        unknown = [k for k, m in enumerate(self.measured) if m.sigma is None]
        splits, free = self.splits, dict[int, float]()
        for _ in range(ROUNDS if unknown else 0):
            computed, jacobian = self.linearize(x)
            orthogonal = np.linalg.qr(jacobian / np.concatenate(self.sigma)[:, None])[0]
            rows, blocks = np.split(computed, splits), np.split(orthogonal, splits)
            change = 0.0
            for k in unknown:
                values = self.measured[k].values
                free[k] = len(values) - float(np.sum(blocks[k] ** 2))
                least = ROUND_OFF * (np.abs(values).max() or 1.0)
                deviation = math.sqrt(np.sum((values - rows[k]) ** 2) / max(free[k], 1.0))
                estimate = max(deviation, least)
                change = max(change, abs(self.sigma[k][0] / estimate - 1.0))
                self.sigma[k] = np.full(len(values), estimate)
            if change < SETTLED or len(self.measured) == 1:
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
        _, jacobian = problem.linearize(np.zeros(len(names)))
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


def _search_all(
    problem: Problem, points: Array, progress: bool, comm: MPI.Intracomm
) -> list[Search]:
    """Search from each point; several searches are the members of a study."""
    if len(points) == 1:
        return [Search(*problem.search(points[0]), 0, 0)]

    def member(start: list[float]) -> dict[str, Any]:
        own = replace(problem, comm=None, runs=0, failed=0)
        begin: Array = np.array(start)
        end, cost = np.full_like(begin, math.nan), math.nan
        with _quiet(), suppress(*FAILURES):
            begin, end, cost = own.search(begin)
        return dict(zip(Search._fields, (begin, end, cost, own.runs, own.failed), strict=True))

    member.__name__ = WHAT
    cases = [{"start": [*map(float, point)]} for point in points]
    found = study(member, cases, progress=progress, comm=comm)
    if np.isnan(found["cost"]).all():
        raise ArgumentError(f"{WHAT}: all searches failed; give narrower bounds around the start")
    rows = zip(*(found[name] for name in Search._fields), strict=True)
    return [Search(begin, end, float(c), int(n), int(m)) for begin, end, c, n, m in rows]


# -- what data determine ---------------------------------------------------------------------------


def _covariance(jacobian: Array) -> tuple[Array, list[list[int]]]:
    """Return the covariance of variables, and the variables in each undetermined direction.

    Args:
        jacobian: Derivatives of values divided by their standard deviations; (N, p).

    Returns:
        The inverse of the product of the Jacobian with itself; (p, p).  A variable in an
        undetermined direction has an infinite variance, and NaN as covariance with others.
    """
    lengths = np.sqrt(np.sum(jacobian**2, axis=0))
    lengths[lengths == 0.0] = 1.0
    p = len(lengths)
    triangle = np.zeros((p, p))
    r = np.linalg.qr(jacobian / lengths, mode="r")
    triangle[: len(r)] = r
    _, s, directions = np.linalg.svd(triangle)
    weak = s <= SINGULAR * s[0]
    undetermined = [[*np.flatnonzero(row > INVOLVED)] for row in np.abs(directions[weak])]
    rows = directions[~weak] / s[~weak, None] / lengths
    covariance: Array = rows.T @ rows
    for i in sorted({i for group in undetermined for i in group}):
        covariance[i] = covariance[:, i] = math.nan
        covariance[i, i] = math.inf
    return covariance, undetermined


def further_step(
    variables: Variables, x: Array, jacobian: Array, residuals: Array
) -> tuple[Array, Array]:
    """Return the further step of a search that has ended at x, and where it is too long; (p,) each.

    Args:
        variables: Search variables.
        x: End of the search.
        jacobian: Derivatives of ``residuals``; (N, p).
        residuals: Computed minus measured values, divided by their standard deviations; (N,).
    """
    free = np.abs(x - variables.bounds()).min(axis=0) >= AT_BOUND
    step, far = np.zeros(len(x)), np.zeros(len(x), dtype=bool)
    if not free.any():
        return step, far
    covariance, undetermined = _covariance(jacobian[:, free])
    if undetermined:
        return step, far
    step[free] = -covariance @ (jacobian[:, free].T @ residuals)
    if np.abs(step).max() > WIDE:  # the data hardly determine a parameter
        return np.zeros(len(x)), far
    # The residuals tell the sizes of errors if standard deviations are assumed.
    variance = covariance.diagonal() * np.mean(residuals**2)
    far[free] = np.abs(step[free]) > np.maximum(STALLED * np.sqrt(variance), LEAST_MOVE)
    return step, far


def _faults(
    variables: Variables, x: Array, widths: Array, correlations: Array,
    undetermined: list[list[int]],
) -> Iterator[str]:  # fmt: skip
    """Yield a sentence for each parameter, or group of them, that the data do not determine."""
    names, values, (low, high) = variables.names, variables.values(x), variables.bounds()
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
            least, most = (variables.values(x + sign * widths)[name] for sign in (-1, 1))
            yield (
                f"the data hardly determine {name}: its 95 % interval is {least:.3g} to "
                f"{most:.3g}; {remedy}"
            )
        for word, bound in ("lower", low[i]), ("upper", high[i]):
            if abs(x[i] - bound) < AT_BOUND:
                yield (
                    f"{name} = {values[name]:.4g} is at its {word} bound, so that its interval and "
                    "those of others do not hold; give wider bounds, or fix it"
                )
