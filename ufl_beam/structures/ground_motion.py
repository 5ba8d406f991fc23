# SPDX-License-Identifier: MIT
"""Recorded ground motions: files, units, scaling, correction, and their integrals."""

from __future__ import annotations

import math
import re
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from fractions import Fraction
from functools import cached_property
from os import PathLike
from pathlib import Path
from typing import Annotated

import numpy as np
import numpy.typing as npt
import scipy  # its subpackages are loaded when they are used

from ufl_beam.arrays import Array
from ufl_beam.display import compact_repr
from ufl_beam.errors import ModelError, shorten
from ufl_beam.file_system import require_path
from ufl_beam.model.checks import raising_model_errors, require_count, require_number, require_row
from ufl_beam.model.functions import Table
from ufl_beam.model.records import Positive, Record, Text

UNITS = {"m/s2": 1.0, "g": 9.80665, "cm/s2": 0.01, "gal": 0.01, "mm/s2": 0.001}
"""Units of acceleration in files; m/s²."""

NUMBER = r"((?:\d+\.?\d*|\.\d+)(?:[ED][+-]?\d+)?)"
PEER = rf"NPTS\s*=\s*(\d+)\s*,\s*DT\s*=\s*{NUMBER}", rf"^\s*(\d+)\s+{NUMBER}\s+NPTS,\s*DT"
"""Number of values and time step in the fourth line of PEER's files, new and old."""

EVEN = 0.1
"""Largest deviation of a time from equal steps, as a fraction of the step.

Times with few digits, such as 0.0039, 0.0078, 0.0117 s, deviate by rounding; a missing value
deviates by a whole step.
"""


def require_motion(values: npt.ArrayLike, what: str) -> tuple[float, ...]:
    """Return accelerations as a tuple of at least two finite floats, or raise."""
    row = require_row(values, what)
    if len(row) < 2:
        raise ModelError(f"{what} must be at least two accelerations, but there is {len(row)}")
    return tuple(map(float, row))


@dataclass(frozen=True, repr=False)
class GroundMotion(Record):
    """Acceleration of the ground at equal time steps from t = 0 on, linear between them.

    The acceleration falls to zero in a further step after the record.

    If all supports have the same motion, ``Gravity((-1, 0), amplitude=motion.acceleration)`` loads
    the scene with fixed supports, and results are relative to the ground.  Otherwise
    ``PrescribedDisplacement(place, u=motion.displacement)`` moves each support, and results are
    absolute.

    Args:
        dt: Time step; s.
        values: Accelerations at 0, dt, 2 dt, ...; m/s².
        name: Name in pictures and messages.

    Raises:
        ModelError: The step is not positive, or the values are not at least two finite numbers.

    Example:
        >>> motion = st.GroundMotion(0.01, 3.0 * np.sin(0.06 * np.arange(400)))
        >>> shaken = ub.Scene([beam], supports=scene.supports,
        ...     loads=[ub.Gravity((-1, 0), amplitude=motion.acceleration)])  # relative
        >>> moving = ub.PrescribedDisplacement(beam.start, u=motion.displacement, v=0.0, psi=0.0)
        >>> moved = ub.Scene([beam], supports=[moving])  # absolute
        >>> print(round(motion.peak, 2), round(motion.duration, 2))  # m/s², s
        3.0 3.99
    """

    dt: Positive
    values: Annotated[Sequence[float], require_motion]
    name: Text = "motion"

    __repr__ = compact_repr

    @classmethod
    def from_history(
        cls,
        times: npt.ArrayLike,
        values: npt.ArrayLike,
        dt: float | None = None,
        name: str = "motion",
    ) -> GroundMotion:
        """Build the record of accelerations at given times, such as a history of a floor.

        Args:
            times: Increasing times; s.  The first one becomes t = 0.
            values: Acceleration at each time; m/s².
            dt: Step at which the values are interpolated linearly; s.  Without it the times must
                have equal steps.
            name: Name in pictures and messages.

        Raises:
            ModelError: Times do not increase, are uneven without ``dt``, or numbers are missing.

        Example:
            >>> floor = st.GroundMotion.from_history([0, 1, 3], [0, 2, 0], dt=0.5)
            >>> floor.values
            (0.0, 1.0, 2.0, 1.5, 1.0, 0.5, 0.0)
        """
        what = "GroundMotion.from_history"
        t, a = require_row(times, f"{what}: times"), require_row(values, f"{what}: values")
        if len(t) != len(a) or len(t) < 2:
            raise ModelError(
                f"{what}: {len(t)} times and {len(a)} values; give two of each or more"
            )
        if dt is None:
            dt = _equal_step(t, lambda k: f"{what}: times[{k}]", "; or give dt=")
            return cls(dt, tuple(a), name)
        dt = require_number(dt, f"{what}: dt", positive=True)
        if (np.diff(t) <= 0).any():
            k = int(np.argmax(np.diff(t) <= 0))
            raise ModelError(f"{what}: times must increase, but {t[k + 1]:g} follows {t[k]:g}")
        return cls(dt, np.interp(np.arange(_steps(t[-1] - t[0], dt) + 1) * dt, t - t[0], a), name)

    @classmethod
    def read(
        cls, path: str | PathLike[str], *, unit: str | None = None, dt: float | None = None
    ) -> GroundMotion:
        """Read a record from a text file or a file of PEER (AT2).

        A text file has two columns, time (s) and acceleration; with ``dt`` it has accelerations
        only, in any number of columns that are read row by row.  Columns are separated by spaces,
        commas or semicolons.  Lines that begin with ``#`` or ``%`` are comments.

        Args:
            path: File; the name of the record is its name without extension.
            unit: Unit of the accelerations: "m/s2", "g", "cm/s2", "gal" or "mm/s2".  Files of PEER
                state their unit, which ``unit`` must equal.
            dt: Time step of a text file without times; s.

        Raises:
            ModelError: The file cannot be read, the unit is missing, unknown or not the unit in the
                file, or the data have text, missing numbers or uneven time steps; the message has
                the file and the line.

        Example:
            >>> np.savetxt("record.txt", [[0.00, 0.0], [0.01, 0.5], [0.02, 0.0]])
            >>> st.GroundMotion.read("record.txt", unit="g").values
            (0.0, 4.903325, 0.0)
        """
        file = raising_model_errors(require_path)(path, "GroundMotion.read")
        try:
            lines = file.read_text("utf-8-sig", errors="replace").splitlines()
        except OSError as error:
            raise ModelError(f"GroundMotion.read: {file}: {error.strerror}") from None
        head, first, count, unit_in_file = "\n".join(lines[:4]), 0, None, None
        if header := next(filter(None, (re.search(x, head, re.I | re.M) for x in PEER)), None):
            first, count, step = 4, int(header[1]), _number(header[2])
            if dt is not None and not math.isclose(dt, step, rel_tol=1e-9):
                raise ModelError(f"{file}: dt = {dt:g} s, but the file has {step:g} s")
            dt = step
            if named := re.search(r"UNITS\s+OF\s+(\S+)", head, re.I):
                unit_in_file = named[1].strip(".,")
        unit = unit_in_file if unit is None else unit
        size, size_in_file = (
            UNITS.get(re.sub(r"/s(ec)?(/s(ec)?|\^2|²)$", "/s2", str(name).lower()))
            for name in (unit, unit_in_file)
        )
        if size is None:
            wrong = (
                "the record has no unit" if unit is None else f"unit = {shorten(unit)} is unknown"
            )
            raise ModelError(f"{file}: {wrong}; give unit= one of {', '.join(UNITS)}")
        if size_in_file not in (None, size):
            raise ModelError(f"{file}: unit = {unit!r}, but the file has {unit_in_file}; omit unit")
        rows = [*_rows(file, lines, first)]
        if not rows:
            raise ModelError(f"{file}: the file has no numbers")
        columns = {len(row) for _, row in rows}
        t = np.array([row[0] for _, row in rows])
        if dt is not None:
            dt = require_number(dt, "GroundMotion.read: dt", positive=True)
            steps = np.diff(t)  # even ones are of times, with another dt, too
            if columns == {2} and len(t) > 2 and np.ptp(steps) < EVEN * steps.min():
                raise ModelError(
                    f"{file}: the first column has times with the step {steps[0]:g} s; omit dt="
                )
            values = [x for _, row in rows for x in row]
        elif columns != {2}:
            number, row = next((number, row) for number, row in rows if len(row) != 2)
            raise ModelError(
                f"{file}, line {number}: a time and an acceleration are expected, but the numbers "
                f"are {len(row)}; give dt= if the file has no times"
            )
        elif len(t) < 2:
            raise ModelError(f"{file}: a record has at least two lines")
        else:
            dt = _equal_step(t, lambda k: f"{file}, line {rows[k][0]}")
            values = [row[1] for _, row in rows]
        if count is not None and len(values) != count:
            raise ModelError(f"{file}: {len(values)} accelerations, but NPTS = {count} in the head")
        return cls(dt, [size * x for x in values], file.stem)

    # -- functions of time --------------------------------------------------------------------

    @property
    def duration(self) -> float:
        """Time of the last value; s."""
        return self.dt * (len(self.values) - 1)

    @property
    def peak(self) -> float:
        """Largest magnitude of the acceleration (PGA); m/s²."""
        return float(np.abs(self.values).max())

    @cached_property
    def acceleration(self) -> Table:
        """Acceleration as a function of time; m/s²."""
        return Table([self.dt * k for k in range(len(self.values) + 1)], (*self.values, 0.0))

    @property
    def velocity(self) -> Integral:
        """Velocity as a function of time, the exact integral of the acceleration; m/s."""
        return Integral(self, 1)

    @property
    def displacement(self) -> Integral:
        """Displacement as a function of time, the exact second integral; m."""
        return Integral(self, 2)

    @cached_property
    def histories(self) -> tuple[Array, Array, Array, Array]:
        """Times, accelerations, velocities and displacements at the values and one step later."""
        t, a, dt = np.array(self.acceleration.times), np.array(self.acceleration.values), self.dt
        v = scipy.integrate.cumulative_trapezoid(a, dx=dt, initial=0.0)
        u = np.append(0.0, np.cumsum(dt * v[:-1] + dt**2 * (a[:-1] / 3 + a[1:] / 6)))
        return t, a, v, u

    # -- other records ------------------------------------------------------------------------

    def scaled(self, factor: float | None = None, *, peak: float | None = None) -> GroundMotion:
        """Return the record times a factor, or with a given peak acceleration; m/s²."""
        if (factor is None) == (peak is None):
            raise ModelError("GroundMotion.scaled: give either factor or peak")
        if peak is not None:
            if not self.peak:
                raise ModelError(f"GroundMotion.scaled: {self.name} is zero and has no peak")
            factor = require_number(peak, "GroundMotion.scaled: peak", positive=True) / self.peak
        factor = require_number(factor, "GroundMotion.scaled: factor")
        return replace(self, values=[factor * a for a in self.values])

    def corrected(self, degree: int = 1, *, highpass: float | None = None) -> GroundMotion:
        """Return the record without the drift of its velocity.

        A polynomial is subtracted from the accelerations so that the mean square of the velocity is
        least (Berg and Housner, Bulletin of the Seismological Society of America 51, 1961).

        Args:
            degree: Degree of the polynomial.
            highpass: Frequency (Hz) below which a Butterworth filter of order 4, applied forwards
                and backwards, removes the motion before; None means no filter.
        """
        degree = require_count(degree, "GroundMotion.corrected: degree", at_least=0)
        a, highest = np.array(self.values), 0.5 / self.dt
        if highpass is not None:
            highpass = require_number(highpass, "GroundMotion.corrected: highpass", positive=True)
            if highpass >= highest:
                raise ModelError(
                    f"GroundMotion.corrected: highpass = {highpass:g} Hz must be below the highest "
                    f"frequency of the record, {highest:g} Hz"
                )
            sections = scipy.signal.butter(4, highpass, "highpass", fs=2 * highest, output="sos")
            if len(a) <= (least := 3 * (2 * len(sections) + 1)):
                raise ModelError(
                    f"GroundMotion.corrected: the record has {len(a)} values; a filter needs more "
                    f"than {least}; leave out highpass"
                )
            a = np.asarray(scipy.signal.sosfiltfilt(sections, a))
        v = scipy.integrate.cumulative_trapezoid(a, dx=self.dt, initial=0.0)
        s, powers = np.linspace(0.0, 1.0, len(a))[:, None], np.arange(1, degree + 2)
        factors = np.linalg.lstsq(s**powers, v, rcond=None)[0]
        return replace(self, values=a - s ** (powers - 1) @ (powers * factors) / self.duration)

    def resampled(self, dt: float) -> GroundMotion:
        """Return the record with another time step.

        Shorter steps interpolate linearly; they describe the same function of time if they divide
        the step.  Before longer steps, a filter removes the frequencies that they cannot represent;
        they must be in the ratio of small whole numbers to the step.
        """
        dt = require_number(dt, "GroundMotion.resampled: dt", positive=True)
        if dt <= self.dt:
            # The step after the last value, in which the acceleration falls to zero, belongs to it.
            end = self.duration + self.dt
            t = dt * np.arange(math.ceil(end / dt * (1 - 1e-12)))
            times, values = self.dt * np.arange(len(self.values) + 1), (*self.values, 0.0)
            return replace(self, dt=dt, values=np.interp(t, times, values))
        ratio = Fraction(self.dt / dt).limit_denominator(1000)
        if not math.isclose(ratio * dt, self.dt, rel_tol=1e-9):
            raise ModelError(
                f"GroundMotion.resampled: dt = {dt:g} s and the step, {self.dt:g} s, are not in "
                "the ratio of small whole numbers"
            )
        values = scipy.signal.resample_poly(self.values, ratio.numerator, ratio.denominator)
        return replace(self, dt=dt, values=values)


def _steps(duration: float, dt: float) -> int:
    """Return the number of whole steps in a duration, except for round-off."""
    return math.floor(duration / dt * (1 + 1e-12))


def _number(word: str) -> float:
    """Return a number, whose exponent may begin with E or, as in Fortran, with D."""
    return float(re.sub("[dD]", "E", word))


def _rows(file: Path, lines: Sequence[str], first: int) -> Iterator[tuple[int, list[float]]]:
    """Yield (number of the line, numbers in it) without comments and empty lines."""
    trails: bool | None = None  # whether lines end with a separator, which all or none must do
    for number, line in enumerate(lines[first:], first + 1):
        if not (text := line.strip()) or text[0] in "#%":
            continue
        trails, before = text[-1] in ",;", trails
        if before is not None and trails != before:
            raise ModelError(
                f"{file}, line {number}: a value is missing here, or a separator ends some lines "
                f"and not others: {shorten(text)}"
            )
        try:
            row = [_number(word) for word in re.split(r"\s*[,;]\s*|\s+", text.rstrip(" \t,;"))]
        except ValueError:
            raise ModelError(
                f"{file}, line {number}: no numbers: {shorten(text)}; comments begin with #"
            ) from None
        if not all(map(math.isfinite, row)):
            raise ModelError(f"{file}, line {number}: a number is not finite: {shorten(text)}")
        yield number, row


def _equal_step(times: Array, at: Callable[[int], str], remedy: str = "") -> float:
    """Return the step of equally spaced times, or raise and name the place of an uneven step."""
    steps, number = np.diff(times), np.arange(len(times))
    dt = float(times[-1] - times[0]) / (len(times) - 1)
    if dt <= 0 or (np.abs(times - times[0] - dt * number) > EVEN * dt).any():
        usual = float(np.median(steps))
        k = int(np.argmax(np.abs(steps - usual)))
        raise ModelError(
            f"{at(k + 1)}: the step from t = {times[k]:g} s to {times[k + 1]:g} s is uneven; the "
            f"median step is {usual:g} s. A record has equal steps without gaps{remedy}"
        )
    return dt


@dataclass(frozen=True)
class Integral:
    """First or second integral of a ground motion from t = 0 on, a function of time.

    The velocity is constant after the record.
    """

    motion: GroundMotion
    order: int  # 1: velocity, 2: displacement

    @property
    def kinks(self) -> Sequence[float]:
        """Times at which a derivative jumps; adaptive steps end there; s."""
        return self.motion.acceleration.times

    def __call__(self, t: float) -> float:
        """Return the velocity (m/s) or displacement (m) at time ``t``."""
        times, a, v, u = self.motion.histories
        if t <= 0:
            return 0.0
        dt = self.motion.dt
        k = min(int(t / dt), len(times) - 1)
        s, jerk = t - k * dt, (a[k + 1] - a[k]) / dt if k + 1 < len(a) else 0.0
        if self.order == 1:
            return float(v[k] + s * (a[k] + s * jerk / 2))
        return float(u[k] + s * (v[k] + s * (a[k] / 2 + s * jerk / 6)))
