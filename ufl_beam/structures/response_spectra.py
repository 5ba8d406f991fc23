# SPDX-License-Identifier: MIT
"""Response spectra of ground motions and floors, elastic and of constant ductility."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt
import scipy  # its subpackages are loaded when they are used

from ufl_beam.arrays import Array
from ufl_beam.compiled.c_library import doubles, lib, struct
from ufl_beam.display import in_one_line
from ufl_beam.errors import (
    ArgumentError,
    require_kind,
    require_number,
    require_returned,
    require_row,
    shorten,
)
from ufl_beam.structures.ground_motion import GroundMotion

Spectrum = Callable[[float], float] | tuple[Sequence[float], Sequence[float]]
"""Spectral acceleration (m/s²) as a function of the period (s), or (periods, accelerations)."""

ROUND_OFF = 1e-12  # of periods at the ends of a table


def spectral_accelerations(spectrum: Any, periods: Array, what: str) -> Array:
    """Evaluate a spectrum at periods (s); a table is linear between its periods; m/s².

    An object with the attributes ``periods`` and ``pseudo_acceleration`` is a table, too.

    Raises:
        ArgumentError: The spectrum is neither, does not cover the periods, or is not positive.
    """
    periods = np.asarray(periods, dtype=float)
    if callable(spectrum):
        values = np.array([
            require_returned(spectrum(float(T)), f"{what}: spectrum", f"T = {T:.4g} s", finite=True)
            for T in periods
        ])  # fmt: skip
    else:
        table: list[Any] = [
            getattr(spectrum, name, None) for name in ("periods", "pseudo_acceleration")
        ]
        try:
            if isinstance(spectrum, Mapping):
                raise TypeError
            T, a = spectrum if table[1] is None else table
            if np.ndim(T) != 1 or np.ndim(a) != 1:
                raise TypeError
        except (TypeError, ValueError):
            raise ArgumentError(
                f"{what}: spectrum = {shorten(spectrum)} must be a function of the period (s) that "
                "returns m/s², or a pair (periods, accelerations), such as ([*d], [*d.values()]) "
                "of a dict"
            ) from None
        T, a = (require_row(x, f"{what}: spectrum") for x in (T, a))
        if len(T) != len(a) or not (np.diff(T) > 0).all():
            raise ArgumentError(
                f"{what}: the spectrum has {len(T)} periods and {len(a)} accelerations; their "
                "numbers must be equal, and periods must increase"
            )
        outside = (periods < T[0] * (1 - ROUND_OFF)) | (periods > T[-1] * (1 + ROUND_OFF))
        if outside.any():
            listed = ", ".join(f"{x:.4g}" for x in periods[outside])
            raise ArgumentError(
                f"{what}: the spectrum covers periods from {T[0]:g} to {T[-1]:g} s, but not "
                f"{listed} s; extend it"
            )
        values = np.interp(periods, T, a)
    if (values <= 0).any():
        k = int(np.argmax(values <= 0))
        raise ArgumentError(
            f"{what}: the spectrum is {values[k]:g} m/s² at T = {periods[k]:.4g} s; it must be "
            "positive"
        )
    return values


POINTS = 100
"""Smallest number of steps in the elastic period of an oscillator.

The error of yielding oscillators is of second order; see
tests/verification/test_ground_motions.py.
"""

RATIO = 1.05  # ratio of successive strengths in the search for a ductility


@in_one_line
class ResponseSpectrum(NamedTuple):
    """Largest responses of oscillators to a ground motion; all arrays are (periods,).

    Attributes:
        periods: Elastic periods without damping; s.
        displacement: Largest displacement relative to the ground; m.
        velocity: Largest velocity relative to the ground; m/s.
        acceleration: Largest absolute acceleration; m/s².
        pseudo_acceleration: (2 π/T)² times the displacement at first yield, which is the strength
            per mass; of an elastic oscillator (2 π/T)² ``displacement``; m/s².
        ductility: Largest displacement divided by the displacement at first yield; 1 if elastic.

    Example:
        >>> motion = st.GroundMotion(0.01, np.ones(200))
        >>> spectrum = st.response_spectrum(motion, [0.5, 1.0], damping=0.0)
        >>> print(spectrum.pseudo_acceleration.round(2))  # twice the acceleration: a sudden load
        [2. 2.]
    """

    periods: Array
    displacement: Array
    velocity: Array
    acceleration: Array
    pseudo_acceleration: Array
    ductility: Array


def response_spectrum(
    motion: GroundMotion,
    periods: npt.ArrayLike,
    damping: float = 0.05,
    *,
    ductility: float = 1.0,
    hardening: float = 0.0,
) -> ResponseSpectrum:
    """Compute the elastic response spectrum, or the spectrum of a constant ductility.

    Steps are exact for an elastic oscillator under an acceleration that is linear in them (Nigam
    and Jennings, Bulletin of the Seismological Society of America 59, 1969).  Oscillators go on
    after the motion until they have turned.

    Yielding oscillators have a bilinear spring with kinematic hardening.  Since the ductility is
    not a monotone function of the strength, the strength is the largest one at which the ductility
    reaches its target.  The search begins at the elastic force and goes down in steps of 5 %.

    Args:
        motion: Motion of the ground, or of a floor, see :meth:`GroundMotion.from_history`.
        periods: Elastic periods without damping; s.
        damping: Damping ratio of the elastic oscillator, below 1; the damping coefficient remains
            constant when the spring yields.
        ductility: Largest displacement divided by the displacement at first yield; 1 is elastic.
        hardening: Stiffness after yield divided by elastic stiffness, below 1.

    Raises:
        ArgumentError: An argument is out of range, or a motion that is zero has a ductility.

    Example:
        >>> motion = st.GroundMotion(0.01, 3.0 * np.sin(0.06 * np.arange(400)))
        >>> elastic = st.response_spectrum(motion, [1.0])
        >>> yielding = st.response_spectrum(motion, [1.0], ductility=4.0, hardening=0.05)
        >>> bool(yielding.pseudo_acceleration < elastic.pseudo_acceleration / 2)
        True
    """
    what = "response_spectrum"
    require_kind(motion, GroundMotion, f"{what}: motion")
    T = require_row(np.atleast_1d(periods), f"{what}: periods")
    if not (len(T) and (T > 0).all()):
        raise ArgumentError(f"{what}: periods must be one or more positive numbers")
    ζ = require_number(damping, f"{what}: damping", at_least=0.0)
    α = require_number(hardening, f"{what}: hardening", at_least=0.0)
    for name, value in (("damping", ζ), ("hardening", α)):
        if value >= 1:
            raise ArgumentError(f"{what}: {name} = {value:g} must be below 1")
    μ = require_number(ductility, f"{what}: ductility", at_least=1.0)
    if μ > 1 and motion.peak == 0:
        raise ArgumentError(f"{what}: {motion.name} is zero and causes no ductility; omit it")
    rows = [_response(_oscillator(motion, float(x), ζ, α, μ), float(x), μ) for x in 2 * np.pi / T]
    return ResponseSpectrum(T, *np.array(rows).T)


def _oscillator(
    motion: GroundMotion, ω: float, ζ: float, α: float, μ: float
) -> Callable[[float], Array]:
    """Return a function of the strength per mass, m/s², that returns three peaks.

    The peaks are of displacement, velocity and absolute acceleration.
    """
    period = 2 * math.pi / ω
    n = math.ceil(POINTS * motion.dt / period)
    dt = motion.dt / n
    # Even an oscillator that yields up to the ductility μ turns within sqrt(μ) periods.
    rest = np.zeros(math.ceil(math.sqrt(μ) * period / motion.dt) + 1)
    load = np.append(np.negative(motion.values), rest)
    λ = ω * (-ζ + 1j * math.sqrt(1 - ζ**2))
    constant = np.expm1(λ * dt) / λ  # factor of a constant load
    c1 = (constant - dt) / (λ * dt)
    factors = {"E": np.exp(λ * dt), "c0": constant - c1, "c1": c1}
    oscillator = struct(
        "oscillator", omega=ω, damping=ζ, hardening=α, dt=dt, substeps=n,
        **{name: [x.real, x.imag] for name, x in factors.items()},
    )  # fmt: skip

    def peaks(strength: float) -> Array:
        values = np.empty(3)
        lib.oscillator_peaks(oscillator, len(load), doubles(load), strength, doubles(values))
        return values

    return peaks


def _response(peaks: Callable[[float], Array], ω: float, μ: float) -> tuple[float, ...]:
    """Return the numbers of a spectrum at one period."""
    elastic = peaks(math.inf)
    if μ == 1:
        return *elastic, ω**2 * elastic[0], 1.0

    def excess(ratio: float) -> float:
        return ratio * float(peaks(ω**2 * elastic[0] / ratio)[0] / elastic[0]) - μ

    ratio = 1.0  # of the elastic force and the strength
    while excess(RATIO * ratio) <= 0:
        ratio *= RATIO
    ratio = scipy.optimize.brentq(excess, ratio, RATIO * ratio, xtol=1e-9)
    largest = peaks(ω**2 * elastic[0] / ratio)
    return *largest, ω**2 * elastic[0] / ratio, ratio * largest[0] / elastic[0]
