"""Damping of a free vibration: its peaks, their logarithmic decrement, and the law of their decay.

Viscous damping takes the same part of the amplitude in every period, which then decays
exponentially; dry friction takes the same amount, and it decays linearly.  What plasticity does
lies somewhere between, so both laws are fitted and compared.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt
from scipy.optimize import curve_fit
from scipy.signal import find_peaks
from scipy.stats import t as student

from ufl_beam.errors import SceneError, require_number

Array = npt.NDArray[np.float64]


@dataclass(frozen=True)
class Envelope:
    """A law of two parameters through the peaks; ``_95``: half-width of the 95 % interval.

    The intervals are Student's, to first order; they hold if the residuals are independent and
    normal.

    Attributes:
        initial: Amplitude A_0 at the first peak; unit of x.
        initial_95: Its uncertainty; unit of x.
        rate: r of A_0 − r t, unit of x per s; or λ of A_0 exp(−λ t), 1/s; t from the first peak.
        rate_95: Its uncertainty; same unit.
        rms: Root mean square of the residuals; unit of x.
    """

    initial: float
    initial_95: float
    rate: float
    rate_95: float
    rms: float

    def __str__(self) -> str:
        return (
            f"A0 = {self.initial:.5g} ± {self.initial_95:.1e}, "
            f"rate = {self.rate:.5g} ± {self.rate_95:.1e}, rms = {self.rms:.1e}"
        )


@dataclass(frozen=True, eq=False)
class Decay:
    """How the peaks of a free vibration decay.

    Attributes:
        times: Times of the peaks; (n,); s.
        amplitudes: Amplitudes of the peaks; (n,); unit of x.
        decrement: Logarithmic decrement δ, mean over the n − 1 periods.
        decrements: That of each period; (n-1,).  They fall or rise where no exponential fits.
        linear: The fit of A_0 − r t, the law of dry friction.
        exponential: The fit of A_0 exp(−λ t), the law of viscous damping.
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
        """Damping ratio ζ that follows from the exponential law: δ = λ T."""
        return float(damping_ratio(self.exponential.rate * self.period))

    @property
    def fitted_ratio_95(self) -> float:
        """Half-width of the 95 % interval of ``fitted_ratio``, from that of λ, to first order."""
        slope = (1 - self.fitted_ratio**2) ** 1.5 / (2 * np.pi)  # dζ/dδ
        return float(slope * self.exponential.rate_95 * self.period)

    @property
    def aic_difference(self) -> float:
        """Akaike's criterion of the linear law less that of the exponential one.

        Both have two parameters, so that only the residuals count; those below round-off do not.
        """
        least = np.finfo(float).eps * np.max(self.amplitudes)
        linear, exponential = (max(e.rms, least) for e in (self.linear, self.exponential))
        return float(2 * len(self.times) * np.log(linear / exponential))

    @property
    def better(self) -> str:
        """The law that is closer to the amplitudes: "linear" or "exponential"."""
        return "linear" if self.aic_difference < 0 else "exponential"

    @property
    def evidence(self) -> float:
        """How many times likelier the better law is, exp(ΔAIC/2) ≥ 1; near 1 neither is."""
        with np.errstate(over="ignore"):
            return float(np.exp(abs(self.aic_difference) / 2))

    def __str__(self) -> str:
        spacing = np.diff(self.times)
        return "\n".join(
            [
                f"{len(self.times)} peaks, period {self.period:.5g} s "
                f"({spacing.min():.5g} to {spacing.max():.5g} s)",
                f"  logarithmic decrement {self.decrement:.4g} "
                f"({self.decrements.min():.4g} to {self.decrements.max():.4g}), "
                f"damping ratio {self.ratio:.4g}",
                f"  linear       {self.linear}",
                f"  exponential  {self.exponential}",
                f"               damping ratio {self.fitted_ratio:.4g} ± {self.fitted_ratio_95:.1e}",
                f"  {self.better} describes the peaks better, evidence ratio {self.evidence:.3g}",
            ]
        )


def damping(
    t: npt.ArrayLike, x: npt.ArrayLike, about: float = 0.0, *, prominence: float = 0.05
) -> Decay:
    """Damping of a free vibration from its history; arguments as of :func:`peaks`.

    Raises:
        SceneError: As of :func:`peaks` and :func:`fit_decay`; or there are less than 3 peaks.
    """
    times, amplitudes = peaks(t, x, about, prominence=prominence)
    if len(times) < 3:
        raise SceneError(
            f"damping: {len(times)} peaks found, 3 are needed; give a longer history, "
            f"or lower the prominence = {prominence:g}"
        )
    return fit_decay(times, amplitudes)


def peaks(
    t: npt.ArrayLike, x: npt.ArrayLike, about: float = 0.0, *, prominence: float = 0.05
) -> tuple[Array, Array]:
    """Times (s) and amplitudes (unit of x) of the maxima of a vibration, one a period; (m,) each.

    They are maxima of x, not of its magnitude, so that they are one period apart even where the
    equilibrium is not quite known; for the minima give −x and −about.  Each is that of the parabola
    through the highest sample and its neighbours; an end of the history is no maximum.

    Args:
        t: Increasing times, in any steps; (n,); s.
        x: Values of the free vibration, without what came before it; (n,).
        about: Equilibrium from which amplitudes count; unit of x.
        prominence: How far x falls on both sides of a maximum before it rises above it, at least,
            as a part of the range of x: more than the high frequencies that ride on the vibration,
            less than the last peak that is to count.

    Raises:
        SceneError: t and x are not of the same length, finite and increasing in t; or ``about`` or
            ``prominence`` is no number.
    """
    t, x = _series("peaks", t, x, "x")
    require_number(about, "peaks: about")
    require_number(prominence, "peaks: prominence", at_least=0.0)
    i, _ = find_peaks(x, prominence=prominence * np.ptp(x))
    before, after = t[i] - t[i - 1], t[i + 1] - t[i]
    rise, fall = (x[i] - x[i - 1]) / before, (x[i + 1] - x[i]) / after
    curvature = 2 * (fall - rise) / (before + after)
    slope = (rise * after + fall * before) / (before + after)
    # On top of three equal samples there is no curvature, and no slope
    shift = np.divide(-slope, curvature, out=np.zeros(len(i)), where=curvature < 0)
    return t[i] + shift, x[i] + slope * shift / 2 - about


def logarithmic_decrement(amplitudes: npt.ArrayLike) -> tuple[float, Array]:
    """Logarithmic decrement δ, mean over n periods and of each one, (n,), from n + 1 amplitudes.

    Raises:
        SceneError: Less than two amplitudes, or some are not positive.
    """
    Φ = _row("logarithmic_decrement", amplitudes, "amplitudes")
    n = len(Φ) - 1
    if n < 1:
        raise SceneError(f"logarithmic_decrement: {n + 1} amplitudes; give at least 2")
    for i in np.flatnonzero(Φ <= 0):
        raise SceneError(
            f"logarithmic_decrement: amplitudes[{i}] = {Φ[i]:g} must be positive; "
            "is `about` the equilibrium of the vibration?"
        )
    δ = np.log(Φ[0] / Φ[n]) / n  # P(61)
    return float(δ), -np.diff(np.log(Φ))


def damping_ratio(decrement: npt.ArrayLike) -> Array:
    """Damping ratio ζ of logarithmic decrements δ of any shape; negative where vibrations grow."""
    δ = _numbers("damping_ratio", decrement, "decrement")
    ζ: Array = δ / np.hypot(δ, 2 * np.pi)  # P(62)
    return ζ


def fit_decay(t: npt.ArrayLike, amplitudes: npt.ArrayLike) -> Decay:
    """Fit a linear and an exponential law to peaks that are one period apart, by least squares.

    The exponential is fitted to the amplitudes and not to their logarithms, so that residuals of
    both laws are of the same kind and may be compared.

    Args:
        t: Increasing times of the peaks; (n,); s.
        amplitudes: Their amplitudes; (n,).

    Raises:
        SceneError: t and the amplitudes are not of the same length, at least 3, finite and
            increasing in t; or an amplitude is not positive.
    """
    t, A = _series("fit_decay", t, amplitudes, "amplitudes")
    if len(A) < 3:
        raise SceneError(f"fit_decay: {len(A)} amplitudes; give at least 3")
    mean, each = logarithmic_decrement(A)
    return Decay(t, A, mean, each, _fit(_linear, t, A), _fit(_exponential, t, A))


def _linear(t: Array, initial: float, rate: float) -> Array:
    return initial - rate * t


def _exponential(t: Array, initial: float, rate: float) -> Array:
    return initial * np.exp(-rate * t)


def _fit(law: Callable[[Array, float, float], Array], t: Array, A: Array) -> Envelope:
    # Without units: time as a part of the whole, amplitude of the largest
    duration, size = t[-1] - t[0], np.max(A)
    τ, a = (t - t[0]) / duration, A / size
    # To 1e-12 of the parameters, beyond what is shown of them
    found, covariance = curve_fit(
        law, τ, a, p0=(a[0], np.log(a[0] / a[-1])), ftol=1e-12, xtol=1e-12
    )
    half = student.ppf(0.975, len(t) - 2) * np.sqrt(np.diag(covariance))
    rms = np.sqrt(np.mean((law(τ, *found) - a) ** 2))
    per_time = (size if law is _linear else 1.0) / duration
    units = np.array([size, per_time])
    return Envelope(*np.ravel([found * units, half * units], order="F").tolist(), rms=rms * size)


def _numbers(call: str, values: npt.ArrayLike, what: str) -> Array:
    """``values`` as an array of finite numbers, or :class:`SceneError`."""
    try:
        array = np.asarray(values, dtype=float)
    except (TypeError, ValueError):
        raise SceneError(f"{call}: {what} must be numbers") from None
    for i in np.argwhere(~np.isfinite(array)):
        place = ", ".join(map(str, i))
        raise SceneError(f"{call}: {what}[{place}] = {array[tuple(i)]} is not finite")
    return array


def _row(call: str, values: npt.ArrayLike, what: str) -> Array:
    array = _numbers(call, values, what)
    if array.ndim != 1:
        raise SceneError(f"{call}: {what} have shape {array.shape}; give one row of numbers")
    return array


def _series(call: str, t: npt.ArrayLike, x: npt.ArrayLike, what: str) -> tuple[Array, Array]:
    """Increasing times and as many values, or :class:`SceneError`."""
    times, values = _row(call, t, "t"), _row(call, x, what)
    if len(times) != len(values):
        raise SceneError(f"{call}: {len(times)} t and {len(values)} {what}; give as many of each")
    for i in np.flatnonzero(np.diff(times) <= 0):
        raise SceneError(
            f"{call}: t must increase, but t[{i}] = {times[i]:g} is followed by {times[i + 1]:g}"
        )
    return times, values
