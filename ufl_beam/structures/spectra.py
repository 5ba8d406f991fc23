# SPDX-License-Identifier: MIT
"""Accelerations of response spectra that users give as functions or tables."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from typing import Any

import numpy as np

from ufl_beam.arrays import Array
from ufl_beam.errors import ArgumentError, require_returned, require_row, shorten

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
                f"{what}: the spectrum has {len(T)} periods and {len(a)} accelerations; it needs "
                "as many of each, and periods must increase"
            )
        outside = (periods < T[0] * (1 - ROUND_OFF)) | (periods > T[-1] * (1 + ROUND_OFF))
        if outside.any():
            listed = ", ".join(f"{x:.4g}" for x in periods[outside])
            raise ArgumentError(
                f"{what}: the spectrum covers periods from {T[0]:g} to {T[-1]:g} s, but not "
                f"{listed} s; extend it, or give fewer modes"
            )
        values = np.interp(periods, T, a)
    if (values <= 0).any():
        k = int(np.argmax(values <= 0))
        raise ArgumentError(
            f"{what}: the spectrum is {values[k]:g} m/s² at T = {periods[k]:.4g} s; it must be "
            "positive"
        )
    return values
