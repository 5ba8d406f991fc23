# SPDX-License-Identifier: MIT
"""Structures of civil engineering: the numbers that ufl_beam and OpenSees share; SI units."""

from itertools import pairwise
from typing import ClassVar

import numpy as np


def through(corners, steps):
    """Return a history through values, in so many equal steps between two of them."""
    parts = [np.linspace(a, b, steps + 1)[1:] for a, b in pairwise(corners)]
    return np.concatenate([corners[:1], *parts])


def cycles(sizes, steps):
    """Return the history of two cycles of each size."""
    return through([0.0, *(way * size for size in sizes for way in (1, -1, 1, -1)), 0.0], steps)


class Reinforced:
    """Rectangular section of concrete, 0.4 m by 0.5 m, with three rows of bars."""

    cover: ClassVar = {"strength": 30e6, "residual": 6e6, "ultimate": 0.006}  # Pa, Pa, 1
    core: ClassVar = {"strength": 36e6, "residual": 7.2e6, "ultimate": 0.025}
    concrete = 30e9  # Young's modulus, Pa
    steel: ClassVar = {
        "yield_limit": 500e6, "hardening": 0.01, "a1": 0.05, "a2": 5.0, "a3": 0.05, "a4": 5.0,
    }  # fmt: skip
    bars = 200e9  # Young's modulus, Pa
    N = -1e6  # N

    @classmethod
    def fibres(cls):
        """Return (y, A, material) of each fibre; the concrete has strips of 12.5 mm."""
        number, b, h, cover = 40, 0.4, 0.5, 0.04
        for i in range(number):
            y = h * ((i + 0.5) / number - 0.5)
            wide = b - 2 * cover if abs(y) < h / 2 - cover else 0.0
            if wide:
                yield y, wide * h / number, "core"
            yield y, (b - wide) * h / number, "cover"
        for y, A in ((-0.2, 1.5e-3), (0.0, 0.6e-3), (0.2, 1.5e-3)):
            yield y, A, "steel"


class Plate:
    """Section of 40 fibres of steel, 0.1 m by 0.2 m."""

    steel: ClassVar = {
        "yield_limit": 355e6, "hardening": 0.01, "a1": 0.0, "a2": 1.0, "a3": 0.0, "a4": 1.0,
    }  # fmt: skip
    bars = 210e9
    N = -1e6

    @classmethod
    def fibres(cls):
        """Return (y, A, material) of each fibre."""
        for i in range(40):
            yield 0.2 * ((i + 0.5) / 40 - 0.5), 0.1 * 0.2 / 40, "steel"


SECTIONS = {"concrete": Reinforced, "steel": Plate}
CURVATURES = cycles((0.005, 0.015, 0.03, 0.05), 100)  # 1/m


class Column:
    """Cantilever of the section of concrete under its axial force, pushed at its top."""

    length = 3.0  # m
    moves = cycles((0.015, 0.03, 0.06, 0.09), 100)  # m


class Hinge:
    """Hinge of Ibarra, Medina and Krawinkler."""

    stiffness = 3e7  # N m/rad
    limit, capping, post_capping = 3e5, 0.025, 0.17  # N m, rad, rad
    overstrength, residual, ultimate = 1.1, 0.4, 0.25
    kappa_F, kappa_D = 0.4, 0.3

    @staticmethod
    def rotations(largest):
        """Return cycles that grow to the largest rotation; the cap is at 0.035 rad."""
        return cycles([largest * i / 6 for i in range(1, 7)], 200)


class Frame:
    """Three storeys, one bay: elastic members, hinges at both ends of girders and at the feet.

    The masses are at the joints of columns and girders; the sum of their weights times their
    heights exceeds the hardening of all hinges, so that the frame collapses when it yields far.
    """

    storeys, height, bay = 3, 3.5, 8.0  # m
    column: ClassVar = {"EA": 4.15e9, "EI": 1.21e8}  # N, N m²
    girder: ClassVar = {"EA": 2.07e9, "EI": 7.09e7}
    mass, inertia = 6e4, 6e3  # kg, kg m², at each joint
    g = 9.81
    hinge: ClassVar = {
        "stiffness": 5.3e8,
        "limit": 4.0e5,
        "ratio": 1e-3,
    }  # of girders; N m/rad, N m
    foot: ClassVar = {"stiffness": 2.0e9, "limit": 7.6e5, "ratio": 1e-3}
    damping = 0.3  # of masses, 1/s
    dt_record, end, sampled = 0.01, 12.0, 0.05  # s

    @classmethod
    def record(cls, scale):
        """Return accelerations of the ground at equal steps: eight waves that swell and fade."""
        t = np.arange(0.0, cls.end, cls.dt_record)
        waves = sum(
            np.sin(2 * np.pi * f * t + phase)
            for f, phase in zip((0.4, 0.55, 0.7, 0.9, 1.1, 1.5, 2.1, 3.0), range(8), strict=True)
        )
        return scale * (t / 3) * np.exp(1 - t / 3) * waves / 2.0
