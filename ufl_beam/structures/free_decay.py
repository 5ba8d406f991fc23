# SPDX-License-Identifier: MIT
"""Damping of a free vibration: peaks, logarithmic decrement and decay laws."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt
import scipy  # imports its modules when they are used

from ufl_beam.arrays import Array
from ufl_beam.display import compact_repr
from ufl_beam.errors import ArgumentError, require_array, require_number, require_row, warn

OFF_CENTRE = 0.25  # largest offset of a vibration from its given equilibrium, of the amplitude


@dataclass(frozen=True)
class Envelope:
    """Decay law fitted to peaks, with 95 % confidence intervals of Student's t distribution.

    Attributes:
        initial: A_0, the fitted amplitude at the first peak, where t = 0; in the unit of the
            vibration x.
        rate: r of the law A_0 − r t, in the unit of x per s; or λ of the law A_0 exp(−λ t), 1/s.
        initial_95: Half-width of the confidence interval of ``initial``; unit of x.
        rate_95: Half-width of the confidence interval of ``rate``; unit of ``rate``.
        rms: Root mean square of the residuals; unit of x.

    Example:
        >>> t = np.arange(5.0)
        >>> fit = st.fit_decay(t, 1.0 - 0.1 * t).linear
        >>> print(f"{fit.initial:.2f} - {fit.rate:.2f} t")
        1.00 - 0.10 t
    """

    initial: float
    rate: float
    initial_95: float
    rate_95: float
    rms: float

    __repr__ = compact_repr

    def __str__(self) -> str:
        return (
            f"A0 = {self.initial:.5g} ± {self.initial_95:.1e}, "
            f"rate = {self.rate:.5g} ± {self.rate_95:.1e}, rms = {self.rms:.1e}"
        )


@dataclass(frozen=True, eq=False)
class Decay:
    """Decay of a free vibration: peaks, logarithmic decrement and fitted laws.

    Attributes:
        times: Times of the n peaks; (n,); s.
        amplitudes: Amplitudes of the peaks; (n,); unit of x.
        decrement: Mean logarithmic decrement δ of all periods.
        decrements: Logarithmic decrement of each period; (n-1,).
        linear: Fit of A_0 − r t, the law of dry friction; t from the first peak.
        exponential: Fit of A_0 exp(−λ t), the law of viscous damping; t from the first peak.

    Example:
        >>> t = np.arange(0, 5, 0.01)
        >>> decay = st.damping(t, np.exp(-0.1 * t) * np.cos(2 * np.pi * t))
        >>> print(f"{decay.period:.2f} s, ratio {decay.ratio:.4f}, {decay.better}")
        1.00 s, ratio 0.0159, exponential
    """

    times: Array
    amplitudes: Array
    decrement: float
    decrements: Array
    linear: Envelope
    exponential: Envelope

    @property
    def period(self) -> float:
        """Mean time between successive peaks; s."""
        return float(np.mean(np.diff(self.times)))

    @property
    def ratio(self) -> float:
        """Damping ratio ζ that follows from the mean decrement."""
        return float(damping_ratio(self.decrement))

    @property
    def fitted_ratio(self) -> float:
        """Damping ratio ζ that follows from the exponential law, δ = λ T."""
        return float(damping_ratio(self.exponential.rate * self.period))

    @property
    def fitted_ratio_95(self) -> float:
        """Half-width of the 95 % confidence interval of ``fitted_ratio``, for the mean period."""
        slope = (1 - self.fitted_ratio**2) ** 1.5 / (2 * np.pi)  # dζ/dδ
        return float(slope * self.exponential.rate_95 * self.period)

    @property
    def better(self) -> str:
        """Name of the law with the smaller residuals, "linear" or "exponential"."""
        return "linear" if self.linear.rms < self.exponential.rms else "exponential"

    @property
    def evidence(self) -> float:
        """Evidence ratio of the better law, exp(ΔAIC/2) with Akaike's information criterion AIC.

        Residuals are assumed independent and normal.  An ``rms`` below the round-off of the
        amplitudes is replaced by this round-off.
        """
        least = np.finfo(float).eps * np.max(self.amplitudes)
        linear, exponential = (max(law.rms, least) for law in (self.linear, self.exponential))
        with np.errstate(over="ignore"):
            return float(np.exp(len(self.times) * abs(np.log(linear / exponential))))

    def __repr__(self) -> str:
        return f"<Decay: {len(self.times)} peaks, damping ratio {self.ratio:.4g}>"

    def __str__(self) -> str:
        spacing, each = np.diff(self.times), self.decrements
        return (
            f"{len(self.times)} peaks, period {self.period:.5g} s "
            f"({spacing.min():.5g} to {spacing.max():.5g} s)\n"
            f"  decrement    {self.decrement:.4g} ({each.min():.4g} to {each.max():.4g}), "
            f"damping ratio {self.ratio:.4g}\n"
            f"  linear       {self.linear}\n"
            f"  exponential  {self.exponential}, "
            f"damping ratio {self.fitted_ratio:.4g} ± {self.fitted_ratio_95:.1e}\n"
            f"  {self.better} describes them better, evidence ratio {self.evidence:.3g}"
        )


def damping(
    t: npt.ArrayLike, x: npt.ArrayLike, about: float = 0.0, *, prominence: float = 0.05
) -> Decay:
    """Estimate the damping of a free vibration; the arguments are as in :func:`peaks`.

    Raises:
        ArgumentError: As in :func:`peaks` and :func:`fit_decay`; or there are fewer than 3 peaks,
            or a peak is not above ``about``.

    Warns:
        ModelWarning: The last vibration is not about ``about``, as after yielding, which leaves a
            residual displacement.

    Example:
        >>> t = np.arange(0, 5, 0.01)
        >>> decay = st.damping(t, np.exp(-0.1 * t) * np.cos(2 * np.pi * t))
        >>> print(f"{decay.decrement:.3f} {decay.ratio:.4f}")
        0.100 0.0159
    """
    times, amplitudes = _maxima("damping", t, x, about, prominence)
    if len(times) < 3:
        raise ArgumentError(
            f"damping: peaks found: {len(times)}, needed: 3; give a longer history, "
            f"or lower prominence = {prominence:g}"
        )
    decay = fit_decay(times, amplitudes)
    _require_centre(*_series("damping", t, x, "x"), about, prominence)
    return decay


def peaks(
    t: npt.ArrayLike, x: npt.ArrayLike, about: float = 0.0, *, prominence: float = 0.05
) -> tuple[Array, Array]:
    """Find times (s) and amplitudes (unit of x) of the maxima of a vibration; (m,) each.

    Minima are left out, so that successive peaks are one period apart even if ``about`` is wrong.
    A parabola through three samples gives each maximum.  The ends of the history are no maxima.

    Noise raises small peaks by a larger fraction than large peaks.  If noise exceeds 0.3 % of the
    amplitudes, filter it first.

    Args:
        t: Increasing times, not necessarily equidistant; (n,); s.
        x: Values of the free vibration, without the forced vibration before; (n,).
        about: Value of x at equilibrium, from which amplitudes are measured.
        prominence: Least fall of x on both sides of a maximum, as a fraction of the range of x.
            Choose it larger than superposed vibrations of high frequency, and smaller than the
            last peaks.

    Raises:
        ArgumentError: t and x differ in length, t does not increase, or a number is out of range.

    Example:
        >>> t = np.arange(0, 3, 0.01)
        >>> times, amplitudes = st.peaks(t, np.cos(2 * np.pi * t))
        >>> print(times.round(3), amplitudes.round(3))
        [1. 2.] [1. 1.]
    """
    return _maxima("peaks", t, x, about, prominence)


def _maxima(
    call: str, t: npt.ArrayLike, x: npt.ArrayLike, about: float, prominence: float
) -> tuple[Array, Array]:
    """Return times and amplitudes of :func:`peaks`; ``call`` names the caller in errors."""
    t, x = _series(call, t, x, "x")
    require_number(about, f"{call}: about")
    require_number(prominence, f"{call}: prominence", at_least=0.0)
    i = scipy.signal.find_peaks(x, prominence=prominence * np.ptp(x))[0] if len(x) else np.arange(0)
    before, after = t[i] - t[i - 1], t[i + 1] - t[i]
    rise, fall = (x[i] - x[i - 1]) / before, (x[i + 1] - x[i]) / after
    curvature = 2 * (fall - rise) / (before + after)
    slope = (rise * after + fall * before) / (before + after)
    # Three equal samples have slope and curvature zero; the middle sample is the peak.
    shift = np.divide(-slope, curvature, out=np.zeros(len(i)), where=curvature < 0)
    return t[i] + shift, x[i] + slope * shift / 2 - about


def _require_centre(t: Array, x: Array, about: float, prominence: float) -> None:
    """Warn if the last two minima and the maximum between them are not about ``about``."""
    high, low = (
        scipy.signal.find_peaks(sign * x, prominence=prominence * np.ptp(x))[0] for sign in (1, -1)
    )
    if len(low) < 2 or not (between := (low[-2] < high) & (high < low[-1])).any():
        return
    top, bottom = x[high[between][-1]], (x[low[-2]] + x[low[-1]]) / 2
    centre, amplitude = (top + bottom) / 2, (top - bottom) / 2
    if abs(centre - about) > OFF_CENTRE * amplitude:
        warn(
            f"damping: the vibration near t = {t[low[-1]]:.4g} s is about {centre:.3g}, with the "
            f"amplitude {amplitude:.2g}, but amplitudes are measured from about = {about:g}; give "
            f"about={centre:.3g} if the equilibrium has moved"
        )


def logarithmic_decrement(amplitudes: npt.ArrayLike) -> tuple[float, Array]:
    """Compute the mean logarithmic decrement δ of n + 1 amplitudes, and each period's δ; (n,).

    Raises:
        ArgumentError: There are fewer than two amplitudes, or an amplitude is not positive.

    Example:
        >>> mean, each = st.logarithmic_decrement([1.0, 0.9, 0.81])
        >>> print(round(mean, 4), each.round(4))
        0.1054 [0.1054 0.1054]
    """
    Φ = require_row(amplitudes, "logarithmic_decrement: amplitudes")
    n = len(Φ) - 1
    if n < 1:
        raise ArgumentError(f"logarithmic_decrement: amplitudes given: {n + 1}, needed: 2")
    for i in np.flatnonzero(Φ <= 0):
        raise ArgumentError(
            f"logarithmic_decrement: amplitudes[{i}] = {Φ[i]:g} must be positive; "
            "peaks must be measured from the equilibrium (about= of damping), and lie above noise"
        )
    δ = np.log(Φ[0] / Φ[n]) / n  # P(61)
    return float(δ), np.log(Φ[:-1] / Φ[1:])


def damping_ratio(decrement: npt.ArrayLike) -> Array:
    """Compute damping ratios ζ = δ/√(δ² + 4π²) of decrements δ; an array of the same shape.

    Example:
        >>> print(f"{st.damping_ratio(0.1):.4f}")
        0.0159
    """
    δ = require_array(decrement, "damping_ratio: decrement")
    ζ: Array = δ / np.hypot(δ, 2 * np.pi)  # P(62)
    return ζ


def fit_decay(t: npt.ArrayLike, amplitudes: npt.ArrayLike) -> Decay:
    """Fit a linear and an exponential law to peaks that are one period apart, by least squares.

    Both laws are fitted to the amplitudes, not to logarithms, so that residuals can be compared.

    Args:
        t: Increasing times of the peaks; (n,); s.
        amplitudes: Amplitudes of the peaks; (n,).

    Raises:
        ArgumentError: There are fewer than 3 peaks; t and amplitudes differ in length or are not
            finite; t does not increase; an amplitude is not positive; or no exponential law fits.

    Example:
        >>> t = np.arange(6.0)
        >>> decay = st.fit_decay(t, 2.0 * np.exp(-0.1 * t))
        >>> print(decay.better, f"{decay.exponential.rate:.3f}")
        exponential 0.100
    """
    t, A = _series("fit_decay", t, amplitudes, "amplitudes")
    if len(A) < 3:
        raise ArgumentError(f"fit_decay: amplitudes given: {len(A)}, needed: 3")
    mean, each = logarithmic_decrement(A)
    s = t - t[0]
    line = scipy.stats.linregress(s, A)
    errors = line.intercept_stderr, line.stderr
    linear = _envelope((line.intercept, -line.slope), errors, A - line.intercept - line.slope * s)
    # A line through the logarithms, weighted by the amplitudes, is the initial guess of the fit.
    τ, a, units = s / s[-1], A / np.max(A), np.array([np.max(A), 1 / s[-1]])
    slope, logarithm = np.polyfit(τ, np.log(a), 1, w=a)
    guess = np.exp(logarithm), -slope
    try:
        with np.errstate(over="ignore"):
            fitted, covariance = scipy.optimize.curve_fit(
                lambda t, initial, rate: initial * np.exp(-rate * t), τ, a, guess,
                # Derivatives by difference quotients would fail at the rate 0.
                jac=lambda t, initial, rate: np.exp(-rate * t)[:, None] * np.stack(
                    [np.ones_like(t), -initial * t], axis=1
                ),
            )  # fmt: skip
    except RuntimeError:
        raise ArgumentError(
            f"fit_decay: no exponential fits amplitudes from {A.min():g} to {A.max():g}; "
            "are they successive peaks of one free vibration?"
        ) from None
    half = units * np.sqrt(np.diag(covariance))
    initial, rate = fitted * units
    exponential = _envelope((initial, rate), half, A - initial * np.exp(-rate * s))
    return Decay(t, A, mean, each, linear, exponential)


def _envelope(values: npt.ArrayLike, errors: npt.ArrayLike, residuals: Array) -> Envelope:
    half = scipy.stats.t.ppf(0.975, len(residuals) - 2) * np.abs(errors)
    rms = np.sqrt(np.mean(residuals**2))
    return Envelope(*np.concatenate([values, half, [rms]]).tolist())


def _series(call: str, t: npt.ArrayLike, x: npt.ArrayLike, what: str) -> tuple[Array, Array]:
    """Return increasing times and values of the same length, or raise :class:`ArgumentError`."""
    times, values = require_row(t, f"{call}: t"), require_row(x, f"{call}: {what}")
    if len(times) != len(values):
        raise ArgumentError(
            f"{call}: {len(times)} t and {len(values)} {what}; give the same number of each"
        )
    for i in np.flatnonzero(np.diff(times) <= 0):
        raise ArgumentError(
            f"{call}: t must increase, but t[{i}] = {times[i]:g} is followed by {times[i + 1]:g}"
        )
    return times, values
