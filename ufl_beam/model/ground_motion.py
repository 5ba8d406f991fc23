# SPDX-License-Identifier: MIT
"""Recorded ground motions: files, units, correction, and elastic response spectra."""

from __future__ import annotations

import math
import re
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from fractions import Fraction
from functools import cached_property
from os import PathLike
from pathlib import Path
from typing import Annotated, NamedTuple, TypeAlias

import numpy as np
import numpy.typing as npt
import scipy  # its subpackages are loaded when they are used

from ufl_beam.arrays import Array
from ufl_beam.display import compact_repr, in_one_line
from ufl_beam.errors import (
    ArgumentError,
    ModelError,
    closed,
    require_array,
    require_count,
    require_number,
    shorten,
)
from ufl_beam.file_system import require_path
from ufl_beam.model.functions import Table
from ufl_beam.model.records import Positive, Record, Text

UNITS = {"m/s2": 1.0, "g": 9.80665, "cm/s2": 0.01, "gal": 0.01, "mm/s2": 0.001}
"""Units of acceleration in files; m/s²."""

PEER = (
    r"NPTS\s*=?\s*(\d+)[\s,]+DT\s*=?\s*([\d.]+(?:E[+-]?\d+)?)",
    r"^\s*(\d+)\s+([\d.]+(?:E[+-]?\d+)?)\s+NPTS,\s*DT",
)
"""Number of values and time step in the fourth line of files of the PEER, new and old."""

FilePath: TypeAlias = str | PathLike[str]

EVEN = 1e-3
"""Largest deviation of a time in a file from equal steps, as a fraction of the step.

Files have few digits: 0.005 s is written as 0.01 by the usual format with two digits after the
point, a deviation of the whole step, which is refused.
"""

SAMPLES_OF_A_PERIOD = 20
"""Smallest number of points in the period of an oscillator.

The peak between two points follows from displacements and velocities at both, with a relative
error of (2 π/20)⁴/384, or 3e-5.
"""


def require_motion(values: npt.ArrayLike, what: str) -> tuple[float, ...]:
    """Return accelerations as a tuple of at least two finite floats, or raise."""
    array = require_array(values, what)
    if array.ndim != 1 or len(array) < 2:
        raise ModelError(
            f"{what} must be at least two accelerations, but the shape is {array.shape}"
        )
    return tuple(map(float, array))


@in_one_line
class ResponseSpectrum(NamedTuple):
    """Largest responses of elastic oscillators to a ground motion; all arrays are (periods,).

    Attributes:
        periods: Periods without damping; s.
        displacement: Largest displacement relative to the ground; m.
        velocity: Largest velocity relative to the ground; m/s.
        acceleration: Largest absolute acceleration; m/s².
        pseudo_acceleration: ω² times ``displacement``: largest spring force per mass; m/s².
    """

    periods: Array
    displacement: Array
    velocity: Array
    acceleration: Array
    pseudo_acceleration: Array


@closed("any function of t will do as an amplitude")
@dataclass(frozen=True, repr=False)
class GroundMotion(Record):
    """Acceleration of the ground at equal time steps, linear between them.

    Before the record it is zero; after the record it falls to zero in a further step.

    ``Gravity((-1, 0), amplitude=motion.acceleration)`` loads a scene that moves with the ground;
    its results are relative to the ground.  A support moves with
    ``PrescribedDisplacement(place, u=motion.displacement)``, and supports may have different
    motions; the results are then absolute.

    Args:
        dt: Time step of the record; s.
        values: Accelerations at 0, dt, 2 dt, ...; m/s².
        name: Name in pictures and messages.

    Raises:
        ModelError: The step is not positive, or the values are no sequence of finite numbers.

    Example:
        >>> t = np.arange(0.0, 4.0, 0.01)
        >>> motion = ub.GroundMotion(0.01, 3.0 * np.sin(6.0 * t))
        >>> shaken = ub.Scene([beam], supports=scene.supports,
        ...     loads=[ub.Gravity((-1, 0), amplitude=motion.acceleration)])
        >>> spectrum = motion.spectrum([0.5, 1.0], damping=0.05)
        >>> bool(spectrum.pseudo_acceleration[1] > motion.peak)  # near resonance
        True
    """

    dt: Positive
    values: Annotated[Sequence[float], require_motion]
    name: Text = "record"

    __repr__ = compact_repr

    @classmethod
    def read(
        cls, path: FilePath, *, unit: str | None = None, dt: float | None = None
    ) -> GroundMotion:
        """Read a record from a file of the PEER format (AT2) or from a text file.

        A text file has one column of accelerations, or several in a row that are read row by row,
        with ``dt=``; or two columns, time (s) and acceleration, without it.  Columns are separated
        by spaces, commas or semicolons; lines that begin with ``#`` or ``%`` are comments.

        Args:
            path: File.
            unit: Unit of the accelerations: "g", "m/s2", "cm/s2", "gal" or "mm/s2".  A file of the
                PEER format states it; otherwise it must be given.
            dt: Time step of a file without times; s.

        Raises:
            ArgumentError: The file cannot be read, or the unit is missing or unknown.
            ModelError: A line has text or missing numbers, or time steps are uneven; the message
                has the file and the line.
        """
        file = require_path(path, "GroundMotion.read")
        try:
            lines = file.read_text("utf-8", errors="replace").splitlines()
        except OSError as error:
            raise ArgumentError(f"GroundMotion.read: {file}: {error.strerror}") from None
        first, head, count = 0, "\n".join(lines[:4]), None
        if header := next(filter(None, (re.search(x, head, re.I | re.M) for x in PEER)), None):
            count, step, first = int(header[1]), float(header[2]), 4
        if first:
            if dt is not None and not math.isclose(dt, step, rel_tol=1e-9):
                raise ArgumentError(f"{file}: dt = {dt:g} s, but the file has {step:g} s")
            dt = step
            if unit is None and (named := re.search(r"UNITS\s+OF\s+(\S+)", head, re.I)):
                unit = named[1].strip("().,").lower()
        if unit is None or unit.lower() not in UNITS:
            said = "has no unit" if unit is None else f"unit = {shorten(unit)} is unknown"
            raise ArgumentError(f"{file}: the record {said}; give unit= one of {', '.join(UNITS)}")
        rows = [*_rows(file, lines, first)]
        if not rows:
            raise ModelError(f"{file}: the file has no numbers")
        if dt is None:
            dt, values = _with_times(file, rows)
        else:
            dt = require_number(dt, "GroundMotion.read: dt", positive=True)
            values = [x for _, row in rows for x in row]
        if count is not None and len(values) != count:
            raise ModelError(f"{file}: {len(values)} accelerations, but NPTS = {count} in the head")
        values = [UNITS[unit.lower()] * x for x in values]
        return cls(dt, values, file.stem)

    # -- functions of time --------------------------------------------------------------------

    @property
    def duration(self) -> float:
        """Time of the last value; s."""
        return self.dt * (len(self.values) - 1)

    @property
    def times(self) -> Array:
        """Times of the values; (n,); s."""
        return np.asarray(self.dt * np.arange(len(self.values)))

    @property
    def peak(self) -> float:
        """Largest magnitude of the acceleration (PGA); m/s²."""
        return float(np.abs(self.values).max())

    @cached_property
    def acceleration(self) -> Table:
        """Acceleration as a function of time, zero after the record; m/s²."""
        return Table((*self.times, self.duration + self.dt), (*self.values, 0.0))

    @property
    def velocity(self) -> Integral:
        """Velocity as a function of time, the exact integral of :attr:`acceleration`; m/s."""
        return Integral(self, 1)

    @property
    def displacement(self) -> Integral:
        """Displacement as a function of time, the exact second integral; m."""
        return Integral(self, 2)

    @cached_property
    def integrals(self) -> tuple[Array, Array, Array, Array]:
        """Times, accelerations, velocities and displacements at the values and one step later."""
        times: Array = np.array(self.acceleration.times)
        a: Array = np.array(self.acceleration.values)
        v, u = np.zeros((2, len(a)))
        v[1:] = np.cumsum(self.dt * (a[:-1] + a[1:]) / 2)
        u[1:] = np.cumsum(self.dt * v[:-1] + self.dt**2 * (a[:-1] / 3 + a[1:] / 6))
        return times, a, v, u

    # -- other records ------------------------------------------------------------------------

    def _with(self, values: Array, dt: float | None = None) -> GroundMotion:
        return replace(self, values=tuple(map(float, values)), dt=dt or self.dt)

    def scaled(self, factor: float | None = None, *, peak: float | None = None) -> GroundMotion:
        """Return the record times a ``factor``, or with a given ``peak`` acceleration; m/s²."""
        if (factor is None) == (peak is None):
            raise ArgumentError("GroundMotion.scaled: give either factor or peak")
        if peak is not None:
            if not self.peak:
                raise ArgumentError(f"GroundMotion.scaled: {self.name} is zero and has no peak")
            factor = require_number(peak, "GroundMotion.scaled: peak", positive=True) / self.peak
        factor = require_number(factor, "GroundMotion.scaled: factor")
        return self._with(factor * np.array(self.values))

    def corrected(
        self, degree: int = 1, *, band: tuple[float | None, float | None] | None = None
    ) -> GroundMotion:
        """Return the record without the drift of its velocity.

        The polynomial that is subtracted from the accelerations minimizes the mean square of the
        velocity (Berg and Housner, Bulletin of the Seismological Society of America 51, 1961).

        Args:
            degree: Degree of the polynomial.
            band: Frequencies (Hz) between which the record is kept, by a Butterworth filter of
                order 4 at each end, applied forwards and backwards; None at an end means no limit.
        """
        degree = require_count(degree, "GroundMotion.corrected: degree", at_least=0)
        values, t = np.array(self.values), self.times
        if band is not None:
            values = self._filtered(values, band)
        v = scipy.integrate.cumulative_trapezoid(values, dx=self.dt, initial=0.0)
        s = t / self.duration
        powers = np.arange(1, degree + 2)
        factors = np.linalg.lstsq(s[:, None] ** powers, v, rcond=None)[0]
        values -= (s[:, None] ** (powers - 1)) @ (powers * factors) / self.duration
        return self._with(values)

    def _filtered(self, values: Array, band: tuple[float | None, float | None]) -> Array:
        low, high = band
        highest = 0.5 / self.dt
        for limit in (low, high):
            if limit is not None and not 0 < limit < highest:
                raise ArgumentError(
                    f"GroundMotion.corrected: band = {shorten(band)} must be between 0 and the "
                    f"highest frequency of the record, {highest:g} Hz"
                )
        if low is not None and high is not None and low >= high:
            raise ArgumentError(f"GroundMotion.corrected: band = {shorten(band)} must increase")
        for limit, kind in ((low, "highpass"), (high, "lowpass")):
            if limit is not None:
                sections = scipy.signal.butter(4, limit, kind, fs=1 / self.dt, output="sos")
                values = np.asarray(scipy.signal.sosfiltfilt(sections, values))
        return values

    def resampled(self, dt: float) -> GroundMotion:
        """Return the record with another time step.

        Shorter steps interpolate linearly and are the same function of time if the step is divided
        by a whole number.  Longer steps are preceded by a filter against frequencies that they
        cannot represent; the ratio of the steps must then be a fraction of small numbers.
        """
        dt = require_number(dt, "GroundMotion.resampled: dt", positive=True)
        if dt > self.dt:
            ratio = Fraction(self.dt / dt).limit_denominator(1000)
            if abs(float(ratio) * dt / self.dt - 1) > 1e-9:
                raise ArgumentError(
                    f"GroundMotion.resampled: dt = {dt:g} s is no simple multiple of {self.dt:g} s"
                )
            values = scipy.signal.resample_poly(self.values, ratio.numerator, ratio.denominator)
            return self._with(values, dt)
        number = math.floor(self.duration / dt * (1 + 1e-12)) + 1
        return replace(
            self, dt=dt, values=np.interp(dt * np.arange(number), self.times, self.values)
        )

    # -- response -----------------------------------------------------------------------------

    def spectrum(self, periods: npt.ArrayLike, damping: float = 0.05) -> ResponseSpectrum:
        """Compute the elastic response spectrum.

        Each step is exact for the acceleration that is linear in it (Nigam and Jennings, Bulletin
        of the Seismological Society of America 59, 1969).  Oscillators go on for the half of their
        period after the record.

        Args:
            periods: Periods of oscillators without damping, all positive; s.
            damping: Damping ratio, below 1.

        Example:
            >>> motion = ub.GroundMotion(0.01, [0.0, *np.ones(100)])  # a sudden constant push
            >>> print(motion.spectrum([0.4], damping=0.0).pseudo_acceleration.round(2))  # twice
            [2.]
        """
        T = np.atleast_1d(require_array(periods, "GroundMotion.spectrum: periods"))
        if T.ndim != 1 or not (T > 0).all():
            raise ArgumentError("GroundMotion.spectrum: periods must be positive")
        ζ = require_number(damping, "GroundMotion.spectrum: damping", at_least=0.0)
        if ζ >= 1:
            raise ArgumentError(f"GroundMotion.spectrum: damping = {ζ:g} must be below 1")
        u, v, a = np.array([self._response(float(x), ζ) for x in T]).reshape(-1, 3).T
        return ResponseSpectrum(T, u, v, a, (2 * np.pi / T) ** 2 * u)

    def _response(self, period: float, ζ: float) -> tuple[float, float, float]:
        """Return the largest displacement, velocity and absolute acceleration of an oscillator."""
        ω, n = 2 * math.pi / period, math.ceil(SAMPLES_OF_A_PERIOD * self.dt / period)
        dt = self.dt / n
        steps = np.arange(math.ceil((self.duration + self.dt + period / 2) / dt) + 1)
        a = np.array([*self.values, 0.0])
        a = np.interp(steps / n, np.arange(len(a)), a, right=0.0)
        # State (u, v, a, da) with the exponential of its matrix: exact for a linear acceleration
        system = np.zeros((4, 4))
        system[0, 1] = system[2, 3] = 1.0
        system[1, :3] = -(ω**2), -2 * ζ * ω, -1.0
        E = scipy.linalg.expm(system * dt)
        pushes = np.column_stack([a[:-1], np.diff(a) / dt]) @ E[:2, 2:].T
        # Two-step form of the recursion, for each component: its filter has the matrix's polynomial
        trace, det = E[0, 0] + E[1, 1], np.linalg.det(E[:2, :2])
        forced = np.zeros((len(a), 2))
        forced[1:] = pushes
        carried = pushes @ np.array([[-E[1, 1], E[0, 1]], [E[1, 0], -E[0, 0]]]).T
        forced[2:] += carried[:-1]
        u, v = scipy.signal.lfilter([1.0], [1.0, -trace, det], forced, axis=0).T
        absolute = -2 * ζ * ω * v - ω**2 * u
        return (
            _peak(u, v, dt),
            _peak(v, absolute - a, dt),
            _peak(absolute, -2 * ζ * ω * (absolute - a) - ω**2 * v, dt),
        )


def _rows(file: Path, lines: Sequence[str], first: int) -> Iterator[tuple[int, list[float]]]:
    """Yield (number of the line, numbers in it)."""
    for number, line in enumerate(lines[first:], first + 1):
        if not (text := line.strip()) or text[0] in "#%":
            continue
        try:
            row = [float(word) for word in re.split(r"[\s,;]+", text.strip(",; "))]
        except ValueError:
            raise ModelError(f"{file}, line {number}: no numbers: {shorten(text)}") from None
        if not all(map(math.isfinite, row)):
            raise ModelError(f"{file}, line {number}: not finite: {shorten(text)}")
        yield number, row


def _with_times(file: Path, rows: list[tuple[int, list[float]]]) -> tuple[float, list[float]]:
    """Return the step and the accelerations of rows with a time and an acceleration."""
    for number, row in rows:
        if len(row) != 2:
            raise ModelError(
                f"{file}, line {number}: {len(row)} numbers; a file without dt= has a time and an "
                "acceleration in each line"
            )
    if len(rows) < 2:
        raise ModelError(f"{file}: one line; a record has two accelerations at least")
    times = np.array([row[0] for _, row in rows])
    dt = (times[-1] - times[0]) / (len(times) - 1)
    wrong = np.abs(times - times[0] - dt * np.arange(len(times))) > EVEN * abs(dt)
    steps = np.diff(times)
    if dt <= 0 or wrong.any():
        usual = float(np.median(steps))
        k = int(np.argmax(np.abs(steps - usual) > EVEN * abs(usual)))
        raise ModelError(
            f"{file}, line {rows[k + 1][0]}: the step from t = {times[k]:g} s is {steps[k]:g} s, "
            f"others are {usual:g} s; a record has equal steps without gaps"
        )
    return float(dt), [row[1] for _, row in rows]


def _peak(x: Array, rate: Array, dt: float) -> float:
    """Return the largest magnitude of a function, from its values and rates at equal steps."""
    k = np.flatnonzero(rate[:-1] * rate[1:] < 0)
    s = rate[k] / (rate[k] - rate[k + 1])
    # Cubic through values and rates at both ends, at the zero of the rate
    between = (
        (1 + 2 * s) * (1 - s) ** 2 * x[k] + s * (1 - s) ** 2 * dt * rate[k]
        + s**2 * (3 - 2 * s) * x[k + 1] - s**2 * (1 - s) * dt * rate[k + 1]
    )  # fmt: skip
    return float(max(np.abs(x).max(), np.abs(between).max(initial=0.0)))


@closed("any function of t will do")
@dataclass(frozen=True)
class Integral:
    """First or second integral of a ground motion from t = 0 on, a function of time.

    After the record the velocity is constant; a record with :meth:`GroundMotion.corrected` hardly
    drifts.
    """

    motion: GroundMotion
    order: int  # 1: velocity, 2: displacement

    @property
    def kinks(self) -> Sequence[float]:
        """Times at which a derivative jumps; adaptive steps end there; s."""
        return self.motion.acceleration.times

    def __call__(self, t: float) -> float:
        """Return the velocity (m/s) or displacement (m) at time ``t``."""
        times, a, v, u = self.motion.integrals
        if t <= 0:
            return 0.0
        dt = self.motion.dt
        k = min(int(t / dt), len(times) - 1)
        s, jerk = t - k * dt, (a[k + 1] - a[k]) / dt if k + 1 < len(a) else 0.0
        if self.order == 1:
            return float(v[k] + s * (a[k] + s * jerk / 2))
        return float(u[k] + s * (v[k] + s * (a[k] / 2 + s * jerk / 6)))
