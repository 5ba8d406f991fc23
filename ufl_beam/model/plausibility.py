# SPDX-License-Identifier: MIT
"""Ranges of numbers beyond which a mistake of units is likely."""

from __future__ import annotations

import math

from ufl_beam.errors import warn

RANGES = {
    "speed of sound sqrt(E/rho)": (20.0, 2e4, "m/s; E is in Pa, rho in kg/m³"),
    "yield strain": (1e-6, math.inf, "; limits of fibres and E are in Pa"),
    "damping ratio": (0.0, 1.0, "; 0.05 is 5 %"),
    "imposed strain": (
        0.0,
        5.0,
        "; for a temperature use ImposedStrain.temperature",
    ),
    "imposed curvature times depth": (0.0, 1.0, "; curvatures are in 1/m, gradients in K/m"),
    "inclination": (
        0.0,
        0.5,
        "; a sway is a displacement per height, such as 1/200",
    ),
    "bow": (0.0, 0.5, "; a bow is a fraction of the length, such as 1/250, not in mm"),
    "target over the size of the scene": (0.0, 1.0, "; the target is a displacement in m"),
    "distance from the axis over the depth": (0.0, 1.0, "; y is in m"),
    "gap over the size of the scene": (0.0, 0.1, "; a gap is in m"),
}
"""Smallest and largest absolute values without a warning, and the unit with a hint."""


def check(owner: str, kind: str, value: float) -> None:
    """Warn if a number is out of its range in :data:`RANGES`."""
    low, high, hint = RANGES[kind]
    if not low <= abs(value) <= high * (1 + 1e-9):
        unit = hint if hint.startswith(";") else f" {hint}"
        warn(f"{owner}: {kind} {value:.3g}{unit}. Is a number in other units?")
