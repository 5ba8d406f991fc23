# SPDX-License-Identifier: MIT
"""Glyphs and words for springs, dampers, motors and other laws of connectors.

A glyph, along a line or around a pin, is drawn in coordinates (s, t): s runs along the connector,
from -2 at its place a to 2 at its place b, its body from -1 to 1; t is across, half a symbol of a
support being 1.
"""

from __future__ import annotations

import math
from functools import singledispatch
from typing import NamedTuple

import numpy as np

from ufl_beam.arrays import Array
from ufl_beam.model import connector_laws as laws
from ufl_beam.model.force_laws import ForceLaw
from ufl_beam.plotting.style import ORANGE, WHITE, with_unit


class Piece(NamedTuple):
    """Line of a glyph, or an area if it is filled."""

    points: list[tuple[float, float]]  # (s, t)
    fill: str | None = None  # colour of the area
    weight: float = 1.6  # width of the line; points
    inside: bool = False  # drawn upon an area


class Glyph(NamedTuple):
    """Symbol around a pin."""

    pieces: list[Piece]  # lines, bent
    sweep: float = math.pi + 1.0  # angle from place a to place b in the undeformed scene; rad
    spins: bool = False  # turns with b as a whole; others begin at a and end at b


def _box(low: float, high: float, half: float, fill: str) -> Piece:
    return Piece([(low, half), (high, half), (high, -half), (low, -half), (low, half)], fill)


_TEETH = [(float(s), 0.55 * (-1.0) ** k) for k, s in enumerate(np.linspace(-1.0, 1.0, 13)[1::2])]
_LEADS = [Piece([(-2.0, 0.0), (-0.8, 0.0)]), Piece([(0.8, 0.0), (2.0, 0.0)])]
_BOXED = [*_LEADS, _box(-0.8, 0.8, 0.6, WHITE)]
_PUSHED = [Piece([(-2.0, 0.0), (-0.8, 0.0)]), Piece([(0.35, 0.0), (2.0, 0.0)], weight=3.2)]
_ARROW = [
    Piece([(-0.6, 0.0), (0.0, 0.0)], weight=2.2, inside=True),
    Piece([(-0.12, 0.34), (0.2, 0.0), (-0.12, -0.34), (-0.12, 0.34)], ORANGE, 1.0, inside=True),
]
_CYLINDER = [*_PUSHED, _box(-0.8, 0.35, 0.6, WHITE)]

# Along a line; what drives is orange, filled if its motion is given.
STRAIGHT: dict[type, list[Piece]] = {
    laws.Spring: [Piece([(-2.0, 0.0), (-1.0, 0.0), *_TEETH, (1.0, 0.0), (2.0, 0.0)])],
    laws.Damper: [
        Piece([(-2.0, 0.0), (-0.5, 0.0)]),
        Piece([(0.6, 0.6), (-0.5, 0.6), (-0.5, -0.6), (0.6, -0.6)]),
        Piece([(0.15, 0.42), (0.15, -0.42)], weight=2.6),
        Piece([(0.15, 0.0), (2.0, 0.0)]),
    ],
    laws.Stop: [
        Piece([(-2.0, 0.0), (-0.25, 0.0)]),
        Piece([(-0.25, 0.7), (-0.25, -0.7)], weight=3.6),
        Piece([(0.25, 0.7), (0.25, -0.7)], weight=3.6),
        Piece([(0.25, 0.0), (2.0, 0.0)]),
    ],
    laws.Coulomb: [
        Piece([(-2.0, 0.0), (-0.8, 0.0), (-0.8, 0.3), (0.6, 0.3)], weight=2.2),
        Piece([(2.0, 0.0), (0.8, 0.0), (0.8, -0.3), (-0.6, -0.3)], weight=2.2),
        *(Piece([(s - 0.1, -0.3), (s + 0.1, 0.3)], weight=1.0) for s in (-0.4, -0.13, 0.13, 0.4)),
    ],
    laws.Motor: [*_PUSHED, _box(-0.8, 0.35, 0.6, ORANGE)],
    laws.Actuator: [*_CYLINDER, *_ARROW],
    laws.Controller: [
        *(*_CYLINDER, *_ARROW),
        Piece([(0.9, 0.0), (0.9, 1.15), (-0.25, 1.15), (-0.25, 0.6)], weight=1.0),
    ],
    ForceLaw: [
        *_BOXED,
        Piece([(-0.55, -0.35), (-0.25, -0.27), (0.25, 0.27), (0.55, 0.35)], inside=True),
    ],
    laws.RigidPlastic: [  # nothing below a limit, flow at it
        *_BOXED,
        Piece([(-0.55, -0.35), (0.0, -0.35), (0.0, 0.35), (0.55, 0.35)], inside=True),
    ],
}

CENTRE = -9.0  # the coordinate t of the pin
_SPOKES = [Piece([(s, CENTRE), (s, 0.0)]) for s in (-2.0, 2.0)]


def _turning(fill: str, *more: Piece, tail: float = -2.0) -> Glyph:
    """A curved arrow."""
    shaft = Piece([(tail, 0.0), (1.6, 0.0)], weight=2.6)
    head = Piece([(1.45, 0.95), (2.05, 0.0), (1.45, -0.95), (1.45, 0.95)], fill, 1.4)
    return Glyph([shaft, head, *more], sweep=1.4 * math.pi, spins=True)


AROUND: dict[type, Glyph] = {
    laws.Spring: Glyph([Piece([(2.0, CENTRE), (2.0, -2.1), (-2.0, 0.0)])], sweep=4.3 * math.pi),
    **{
        law: Glyph([*STRAIGHT[law], *_SPOKES])  # the straight one, with a spoke at both ends
        for law in (laws.Damper, laws.Stop, laws.Coulomb, ForceLaw, laws.RigidPlastic)
    },
    laws.Motor: _turning(ORANGE),
    laws.Actuator: _turning(WHITE),
    laws.Controller: _turning(WHITE, _box(-2.0, -1.4, 0.5, WHITE), tail=-1.4),
}


def along(piece: Piece, a: Array, b: Array, sides: tuple[Array, float], body: float) -> Array:
    """Compute points of a piece of a straight glyph from a to b; (n, 2); m.

    ``sides`` are the unit vector across and the length of 1 in it (m), ``body`` is the part of the
    way that the body of the glyph takes.
    """
    s, t = np.array(piece.points).T
    part = np.interp(s, [-2.0, -1.0, 1.0, 2.0], [0.0, (1 - body) / 2, (1 + body) / 2, 1.0])
    across, unit = sides
    return np.asarray(a + part[:, None] * (b - a) + (t * unit)[:, None] * across)


def around(piece: Piece, pin: Array, radius: float, angles: tuple[float, float]) -> Array:
    """Compute points of a piece of a glyph around a pin; (n, 2); m.

    The ``radius`` is that of t = 0, three units of t; ``angles`` are those of s = -2 and 2.
    """
    points = np.array(piece.points)
    # Steps of 5 degrees, such that what is straight between two points is bent.
    steps = np.abs(np.diff(points[:, 0])) / 4.0 * abs(angles[1] - angles[0])
    counts = np.maximum(1, np.ceil(steps / math.radians(5.0))).astype(int)
    at = np.concatenate([[0.0], *(k + np.arange(1, n + 1) / n for k, n in enumerate(counts))])
    s, t = (np.interp(at, np.arange(len(points)), column) for column in points.T)
    angle = np.interp(s, [-2.0, 2.0], angles)
    r = np.maximum(radius * (1.0 + t / 3.0), 0.18 * radius)
    return np.asarray(pin + r[:, None] * np.column_stack([np.cos(angle), np.sin(angle)]))


@singledispatch
def law_in_words(law: laws.Law, turns: bool) -> str:
    """Describe the law of a connector, which turns or not, and its size."""
    return type(law).__name__.lower()


@law_in_words.register
def _(law: laws.Spring, turns: bool) -> str:
    ends = [word for word, given in (("yields", law.law), ("breaks", law.softening)) if given]
    return ", ".join([with_unit(law.stiffness, "N m/rad" if turns else "N/m"), *ends])


@law_in_words.register
def _(law: laws.Damper, turns: bool) -> str:
    return with_unit(law.viscosity, "N m s/rad" if turns else "N s/m")


@law_in_words.register
def _(law: laws.Stop, turns: bool) -> str:
    if math.isinf(law.low):
        return f"stop ≤ {_motion_in_words(law.high, turns)}"
    if math.isinf(law.high):
        return f"stop ≥ {_motion_in_words(law.low, turns)}"
    return "stop " + " … ".join(_motion_in_words(end, turns) for end in (law.low, law.high))


def _motion_in_words(motion: float, turns: bool) -> str:
    return f"{motion:.3g} rad".replace("-", "−") if turns else with_unit(motion, "m")


@law_in_words.register
def _(law: laws.Coulomb, turns: bool) -> str:
    limit = [with_unit(law.force, "N m" if turns else "N")] if law.force else []
    rate = [f"{law.coefficient:g}{' m' if turns else ''} × press"] if law.coefficient else []
    return f"friction {' + '.join([*limit, *rate])}"


@law_in_words.register
def _(law: laws.RigidPlastic, turns: bool) -> str:
    return f"rigid up to {with_unit(float(law.law.limit), 'N m' if turns else 'N')}"
