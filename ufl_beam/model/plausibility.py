# SPDX-License-Identifier: MIT
"""Ranges of numbers beyond which a mistake of units is likely."""

from __future__ import annotations

import math

from ufl_beam.errors import warn

RANGES = {
    "yield strain": (1e-8, math.inf, "; limits of fibres and E are in Pa"),
    "damping ratio": (0.0, 1.0, "; 0.05 is 5 %"),
    "imposed strain": (0.0, 5.0, "; for a temperature use ImposedStrain.temperature"),
    "imposed curvature times depth": (0.0, 1.0, "; curvatures are in 1/m, gradients in K/m"),
    "inclination": (0.0, 0.5, "; a sway is a displacement per height, such as 1/200"),
    "bow": (0.0, 0.5, "; a bow is a fraction of the length, such as 1/250, not in mm"),
    "target over the size of the scene": (0.0, 1.0, "; the target is a displacement in m"),
    "distance from the axis over the depth": (0.0, 1.0, "; y is in m"),
    "gap over the size of the scene": (0.0, 0.1, "; a gap is in m"),
    "stress range": (1e4, math.inf, "; it is in Pa"),
    "strain over strength / E": (0.0, 50.0, "; 0.002 is 0.2 %"),
    "end of a table along the beam": (0.0, 1.5, "; s is from 0 to 1, not in m"),
}
"""Smallest and largest absolute values without a warning, and a hint."""

STRUCTURAL = (400.0, 9000.0), (2e10, 3e11)
"""Densities of timber to steel, kg/m³; moduli of concrete to steel, Pa."""

RUBBER = 800.0, 2300.0
"""Densities of rubber, whose modulus may be as small as one of steel in kN/m²; kg/m³."""


def check(owner: str, kind: str, value: float) -> None:
    """Warn if a number is out of its range in :data:`RANGES`."""
    low, high, hint = RANGES[kind]
    if not low <= abs(value) <= high * (1 + 1e-9):
        warn(f"{owner}: {kind} {value:.3g}{hint}. Is a number in other units?")


def check_material(E: float, rho: float) -> None:
    """Warn of a modulus in kN/m², MPa or GPa, or a density in t/m³, beside a usual other one."""
    (light, heavy), (soft, stiff) = STRUCTURAL
    least = 100.0 if RUBBER[0] < rho < RUBBER[1] else 5e4
    wrong_E = light <= rho <= heavy and E >= 1.0 and E / rho < least
    wrong_rho = soft <= E <= stiff and 2.0 <= rho <= heavy / 1e3
    if wrong_E or wrong_rho:
        warn(
            f"Section: E = {E:.4g} Pa and rho = {rho:.4g} kg/m³ are of no material: the speed of "
            f"sound were {math.sqrt(E / rho):.3g} m/s. Is a number in other units?"
        )
