# SPDX-License-Identifier: MIT
"""Measurements, and the result of a calibration: parameters, intervals, residuals, minima."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import KW_ONLY, dataclass
from functools import partial
from types import MappingProxyType
from typing import Annotated, Any, ClassVar

import numpy as np
import numpy.typing as npt
import scipy  # its subpackages are loaded when they are used

from ufl_beam.arrays import Array, Index
from ufl_beam.display import TIME, Rich, aligned, counted
from ufl_beam.errors import (
    ArgumentError,
    require_all,
    require_array,
    require_function,
    require_kind,
    require_number,
    require_row,
    shorten,
)
from ufl_beam.mechanics.time_scheme import Scheme, order_of
from ufl_beam.model.beams import Mesh
from ufl_beam.model.records import Instance, Positive, Record, Text
from ufl_beam.simulation.initial_state import SAME_TIME, require_scheme
from ufl_beam.simulation.run import require_times
from ufl_beam.simulation.solution import Solution
from ufl_beam.solvers.newton_options import Newton

Quantity = Callable[[Solution], npt.ArrayLike]

SAME = 1e-8
"""Largest difference of costs that count as one minimum, as a fraction of 1 + cost; a difference
of the cost by 1/2 is one standard deviation."""


def _require_sigma(value: Any, what: str) -> Any:
    """Return a standard deviation, or one for each value, as a float or an array; all positive."""
    array = require_array(value, what)
    if array.ndim == 0:
        return require_number(array, what, positive=True)
    if array.ndim > 1 or not (array > 0).all():
        raise ArgumentError(f"{what} must be a positive number, or one for each value")
    return array


def _require_labels(value: Any, what: str) -> tuple[str, str]:
    texts = require_all(value, what, str)
    if len(texts) != 2:
        raise ArgumentError(f"{what} = {shorten(value)} must be two texts, for the axes")
    return texts


@dataclass(frozen=True, eq=False, repr=False)
class Measurement(Record):
    """Measured values, and the run that computes them; an argument of :func:`calibrate`.

    A cubic spline through the stored states interpolates the computed history at the measured
    times.  For smooth motions this error is of fourth order in the step and smaller than the error
    of the steps, of second order.  Runs with ``EnergyMomentum(order=4)`` have a quintic spline and
    an error of sixth order.  Near a jump or kink of a history the interpolation is of first order
    at best; choose steps that end at the measured times.

    Accelerations hold in the middle of the step that ends at the time of their row.  So do
    reactions and section forces in energy-momentum schemes; with ``order=4`` these hold 0.207 dt
    before that time.  Add half a step, or 0.207 dt, to the times of such measurements, as in
    ``Measurement(times + dt / 2, ...)``.  Otherwise the comparison has an error of first order.

    In statics t is the parameter of loads and prescribed displacements.  A pushover curve is a run
    in which ``PrescribedDisplacement(place, u=lambda t: t)`` moves a place, so that t is the
    displacement, and the quantity is the reaction.

    Args:
        times: Increasing times of the values, within the run; (m,); s.  None if the quantity
            returns values without times, such as a peak or a natural frequency.
        values: Measured values; (m,), in the unit of the quantity.
        quantity: Function of the solution that returns a history at the stored times; (n+1,).
            Places are those of its scene: ``lambda run: run.displacement(run.scene["mast"].end)[:,
            0]``.  Without times it returns m values.
        scheme: Time scheme of the run.
        t: Beginning and end of the run; s.
        dt: Time step; s.  Steps are equal, so that results are smooth functions of parameters.
        sigma: Standard deviation of the errors of measurement, a number or (m,), in the unit of the
            values.  By default it is estimated from the residuals.  Errors are independent.
        arguments: Further arguments of the model in this run, such as ``{"load": pulse}``.
        name: Name in tables and pictures.
        labels: Labels of the axes of times and values.
        mesh: Discretization; by default the cells of the beams.
        newton: Tolerances and options of Newton's method.

    Raises:
        ArgumentError: Times do not increase or are outside the run, numbers of times and values
            differ, a standard deviation is not positive, or another argument is wrong.

    Example:
        >>> def deflection(run):
        ...     return run.displacement(run.scene["beam"].end)[:, 1]
        >>> swing = st.Measurement([0.1, 0.2], [-0.8e-3, -2.4e-3], deflection,
        ...     scheme=ub.EnergyMomentum(), t=(0, 0.2), dt=0.01, sigma=1e-5,
        ...     labels=("time (s)", "deflection (m)"))
        >>> len(swing)
        2
    """

    times: npt.ArrayLike | None
    values: Annotated[Any, require_row]
    quantity: Annotated[Quantity, partial(require_function, arguments="a solution")]
    _: KW_ONLY
    scheme: Annotated[Scheme, require_scheme]
    t: tuple[float, float]
    dt: Positive
    sigma: Annotated[Any, _require_sigma] = None
    arguments: Annotated[Mapping[str, Any], partial(require_kind, kind=Mapping)] = MappingProxyType(
        {}
    )
    name: Text = "measurement"
    labels: Annotated[tuple[str, str], _require_labels] = (TIME.name, "value")
    mesh: Instance[Mesh | None] = None
    newton: Instance[Newton | None] = None

    _refused: ClassVar[type[ArgumentError]] = ArgumentError

    def __post_init__(self) -> None:
        super().__post_init__()
        what = self._label()
        t0, t1 = require_times(self.t, what)
        if not len(self):
            raise ArgumentError(f"{what}: values is empty")
        if np.shape(self.sigma) not in {(), (len(self),)}:
            raise ArgumentError(
                f"{what}: sigma has {len(self.sigma)} standard deviations for {len(self)} values"
            )
        if self.times is None:
            return
        times = require_row(self.times, f"{what}: times")
        inside = np.clip(times, t0, t1)
        times = np.where(np.abs(times - inside) <= SAME_TIME * max(abs(t0), abs(t1)), inside, times)
        object.__setattr__(self, "times", times)
        if len(times) != len(self):
            raise ArgumentError(f"{what}: {len(times)} times and {len(self)} values")
        for k in np.flatnonzero(np.diff(times) <= 0):
            raise ArgumentError(
                f"{what}: times must increase, but {times[k + 1]:g} follows {times[k]:g}"
            )
        for k in np.flatnonzero((times < t0) | (times > t1)):
            raise ArgumentError(
                f"{what}: times[{k}] = {times[k]:g} is outside the run from {t0:g} to {t1:g}; "
                "change t=, or leave out the value"
            )

    def _label(self) -> str:
        return f"Measurement {self.name}"

    def __len__(self) -> int:
        return len(self.values)

    def __repr__(self) -> str:
        return f"<Measurement {self.name}: {counted((len(self), 'value', 'values'))}>"

    def computed(self, solution: Solution) -> Array:
        """Return the computed values of a run at the measured times; (m,).

        Raises:
            ArgumentError: The quantity returned another number of values, or no finite numbers.
        """
        what = f"{self._label()}: quantity"
        with np.errstate(all="ignore"):
            returned = self.quantity(solution)
        try:
            values = np.asarray(returned, dtype=float)
        except (TypeError, ValueError):
            raise ArgumentError(f"{what} returned {shorten(returned)}, not numbers") from None
        number, of = len(solution), "stored time"
        if self.times is None:
            number, of, values = len(self), "measured value", values.reshape(-1)
        if values.shape != (number,):
            raise ArgumentError(
                f"{what} returned an array of shape {values.shape}; it must return one number for "
                f"each {of}, of shape ({number},)"
            )
        # The first rows of accelerations and reactions may be NaN.
        first = 0 if self.times is None else int(np.argmax(np.isfinite(values)))
        for k in first + np.flatnonzero(~np.isfinite(values[first:])):
            raise ArgumentError(f"{what} returned {values[k]} at index {k}, not a finite number")
        if self.times is None:
            return values
        at, stored = np.asarray(self.times), solution.times[first:]
        if at[0] < stored[0]:
            raise ArgumentError(
                f"{what} returned {values[0]} at the beginning of the run; leave out the measured "
                f"values before {stored[0]:g}"
            )
        degree = min(order_of(self.scheme) + 1, len(stored) - 1)
        spline = scipy.interpolate.make_interp_spline(stored, values[first:], k=degree)
        return np.asarray(spline(at))


@dataclass(frozen=True, eq=False, repr=False)
class Calibration(Rich):
    """Parameters of a model fitted to measurements; made by :func:`calibrate`.

    Rows and columns belong to parameters in their order, p in number.  Intervals and covariances
    come from the derivatives at the minimum, in which the model is linear in the search variables:
    log p of a positive parameter, the parameter itself otherwise.

    Attributes:
        parameters: Fitted values by name.
        intervals: Ends of the 95 % interval of each parameter by name, within the bounds; with
            Student's distribution if a standard deviation was estimated.
        covariance: Covariance of the parameters; (p, p).  It is infinite where the data do not
            determine a parameter.
        correlations: Correlations of the parameters; (p, p).
        half_widths: Half of the width of each interval, to first order; (p,).
        half_widths_alone: The same if one measurement alone were used to fit all parameters;
            infinite if it does not determine a parameter; (number of measurements, p).
        measured: Measurements.
        sigma: Standard deviation of each value, given or estimated, by measurement; (m,) each.
        residuals: Measured minus computed values, by measurement; (m,) each.
        cost: Half of the sum of squares of residuals divided by standard deviations.
        starts: Values of the parameters at which searches began; (number of starts, p).
        ends: Values of the parameters at which they ended, NaN for a search that failed;
            (number of starts, p).
        end_costs: Cost at each end, with the standard deviations that were assumed in the search;
            NaN for a search that failed; (number of starts,).
        runs: Number of runs.
        failed: Number of runs that failed.
        solutions: Run of each measurement with the fitted parameters.
        warnings: Warnings on parameters that the data do not determine.

    Example:
        >>> def pushed(push):
        ...     load = ub.PointLoad(beam.end, force=(0, push), amplitude=lambda t: t)
        ...     return ub.Scene([beam], supports=[ub.Clamped(beam.start)], loads=[load])
        >>> bent = st.Measurement(
        ...     None, [-0.99e-3, -2.01e-3], lambda run: run.displacement(beam.end)[1:, 1],
        ...     scheme=ub.Static(), t=(0, 1), dt=0.5)
        >>> fit = st.calibrate(pushed, {"push": -1e3}, [bent])
        >>> print(f"{fit.parameters['push']:.0f} N")
        -10604 N
        >>> figure = ub.plot(fit)
    """

    parameters: dict[str, float]
    intervals: dict[str, tuple[float, float]]
    covariance: Array
    correlations: Array
    half_widths: Array
    half_widths_alone: Array
    measured: tuple[Measurement, ...]
    sigma: tuple[Array, ...]
    residuals: tuple[Array, ...]
    cost: float
    starts: Array
    ends: Array
    end_costs: Array
    runs: int
    failed: int
    solutions: tuple[Solution, ...]
    warnings: tuple[str, ...]

    @property
    def identified_by(self) -> dict[str, str]:
        """Name of the measurement with the narrowest interval alone, by parameter.

        It is "all together" if no measurement alone determines the parameter.
        """
        best = np.argmin(self.half_widths_alone, axis=0)
        return {
            name: self.measured[k].name if np.isfinite(self.half_widths_alone[k, i])
            else "all together"
            for i, (name, k) in enumerate(zip(self.parameters, best, strict=True))
        }  # fmt: skip

    @property
    def same_minimum(self) -> int:
        """Number of starts that ended at the least cost, within 1e-8 of 1 + cost."""
        return len(self._minima()[0])

    def _minima(self) -> list[Index]:
        """Return the indices of the starts that ended at each minimum, by increasing cost."""
        order = np.argsort(self.end_costs)[: np.isfinite(self.end_costs).sum()]
        costs = self.end_costs[order]
        return np.split(order, 1 + np.flatnonzero(np.diff(costs) > SAME * (1.0 + costs[:-1])))

    def table(self) -> list[list[str]]:
        """Return a header and a row of texts for each parameter."""
        several = len(self.measured) > 1
        names = [m.name for m in self.measured] if several else []
        rows = [["parameter", "value", "95 % interval", *(f"± by {name}" for name in names)]]
        for i, (name, value) in enumerate(self.parameters.items()):
            low, high = self.intervals[name]
            digits = max(4, _digits(value, high - low))
            alone = (_relative(w, value) for w in self.half_widths_alone[:, i] if several)
            shown = f"{low:.{digits}g} to {high:.{digits}g}"
            rows.append([name, f"{value:.{max(5, digits)}g}", shown, *alone])
        return rows

    def remarks(self) -> list[str]:
        """Return lines on correlations, residuals, minima and warnings."""
        lines, names = [], [*self.parameters]
        pairs = [
            f"{a}, {b} {self.correlations[i, j]:.2f}"
            for i, a in enumerate(names) for j, b in enumerate(names[:i])
        ]  # fmt: skip
        if pairs:
            lines.append(f"correlations: {'; '.join(pairs)}")
        for m, sigma, r in zip(self.measured, self.sigma, self.residuals, strict=True):
            origin = "estimated" if m.sigma is None else "given"
            size = f"{sigma.min():.4g}" + (f" to {sigma.max():.4g}" if np.ptp(sigma) else "")
            root = math.sqrt(np.mean((r / sigma) ** 2))
            number = counted((len(m), "value", "values"))
            lines.append(
                f"{m.name}: {number}, standard deviation {size} ({origin}), residuals "
                f"{root:.2f} times as large"
            )
        if (starts := len(self.starts)) > 1:
            lines.append(f"{self.same_minimum} of {starts} starts end at the least cost")
            best, *others = self._minima()
            for group in others:
                ratio = self.end_costs[group[0]] / self.end_costs[best[0]]
                ends = zip(names, self.ends[group[0]], strict=True)
                end = ", ".join(f"{name} = {value:.4g}" for name, value in ends)
                lines.append(f"  {len(group)} at {ratio:.6g} times this cost, {end}")
            if lost := int(np.isnan(self.end_costs).sum()):
                lines.append(f"  {lost} failed")
        return [*lines, *self.warnings]

    def __str__(self) -> str:
        return "\n".join([repr(self)[1:-1], *aligned(self.table()), *self.remarks()])

    def __repr__(self) -> str:
        failed = f", {self.failed} failed" if self.failed else ""
        p, m = len(self.parameters), len(self.measured)
        numbers = counted((p, "parameter", "parameters"), (m, "measurement", "measurements"))
        return f"<Calibration: {numbers}, {self.runs} runs{failed}>"


def _digits(value: float, width: float) -> int:
    """Return the number of digits of a value that show two digits of the width of its interval."""
    known = value and 0.0 < width < math.inf
    return min(15, 2 + math.ceil(math.log10(abs(value / width)))) if known else 0


def _relative(width: float, value: float) -> str:
    """Write a half width in per cent of the value, or a dash where it is infinite."""
    if not math.isfinite(width):
        return "-"
    return f"{100 * width / abs(value):.2g} %" if value else f"{width:.2g}"
