# SPDX-License-Identifier: MIT
"""Glyphs and words for springs, dampers, motors and other laws of connectors.

A glyph, along a line or around a pin, is drawn in coordinates (s, t): s runs along the connector,
from -2 at its place a to 2 at its place b, its body from -1 to 1; t is across, half a symbol of a
support being 1.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from ufl_beam.arrays import Array
from ufl_beam.model import connector_laws as laws
from ufl_beam.model.connector_law import ConnectorLaw
from ufl_beam.plotting.geometry import directions
from ufl_beam.plotting.style import FRONT, INK, MIDDLE, ORANGE, UPON, WHITE, Stroke, with_unit


class Glyph(NamedTuple):
    """Symbol around a pin."""

    strokes: list[Stroke]  # straight lines become arcs
    sweep: float = math.pi + 1.0  # angle from place a to place b in the undeformed scene; rad
    spins: bool = False  # turns with b as a whole; others begin at a and end at b


def _line(*points: tuple[float, float], weight: float = 1.6, layer: float = MIDDLE) -> Stroke:
    return Stroke(np.array(points), INK, weight, layer=layer)


def _box(low: float, high: float, half: float, fill: str) -> Stroke:
    corners = [(low, half), (high, half), (high, -half), (low, -half), (low, half)]
    return Stroke(np.array(corners), fill=fill)


_TEETH = [(float(s), 0.55 * (-1.0) ** k) for k, s in enumerate(np.linspace(-1.0, 1.0, 13)[1::2])]
_BOXED = [_line((-2, 0), (-0.8, 0)), _line((0.8, 0), (2, 0)), _box(-0.8, 0.8, 0.6, WHITE)]
_PUSHED = [_line((-2, 0), (-0.8, 0)), _line((0.35, 0), (2, 0), weight=3.2)]
_HEAD = np.array([(-0.12, 0.34), (0.2, 0.0), (-0.12, -0.34), (-0.12, 0.34)])
_CYLINDER = [
    *(*_PUSHED, _box(-0.8, 0.35, 0.6, WHITE)),
    _line((-0.6, 0), (0, 0), weight=2.2, layer=UPON),
    Stroke(_HEAD, INK, 1.0, ORANGE, UPON),
]
_STATED = [
    *_BOXED,
    _line((-0.55, -0.35), (-0.25, -0.27), (0.25, 0.27), (0.55, 0.35), layer=UPON),
]

# Along a line; what drives is orange, filled if its motion is given.
STRAIGHT: dict[type, list[Stroke]] = {
    laws.Spring: [_line((-2, 0), (-1, 0), *_TEETH, (1, 0), (2, 0))],
    laws.Damper: [
        _line((-2, 0), (-0.5, 0)),
        _line((0.6, 0.6), (-0.5, 0.6), (-0.5, -0.6), (0.6, -0.6)),
        _line((0.15, 0.42), (0.15, -0.42), weight=2.6),
        _line((0.15, 0), (2, 0)),
    ],
    laws.Stop: [
        _line((-2, 0), (-0.25, 0)),
        _line((-0.25, 0.7), (-0.25, -0.7), weight=3.6),
        _line((0.25, 0.7), (0.25, -0.7), weight=3.6),
        _line((0.25, 0), (2, 0)),
    ],
    laws.Coulomb: [
        _line((-2, 0), (-0.8, 0), (-0.8, 0.3), (0.6, 0.3), weight=2.2),
        _line((2, 0), (0.8, 0), (0.8, -0.3), (-0.6, -0.3), weight=2.2),
        *(_line((s - 0.1, -0.3), (s + 0.1, 0.3), weight=1.0) for s in (-0.4, -0.13, 0.13, 0.4)),
    ],
    laws.Motor: [*_PUSHED, _box(-0.8, 0.35, 0.6, ORANGE)],
    laws.Actuator: _CYLINDER,
    laws.Controller: [
        *_CYLINDER,
        _line((0.9, 0), (0.9, 1.15), (-0.25, 1.15), (-0.25, 0.6), weight=1.0),
    ],
    laws.ForceLaw: _STATED,
    ConnectorLaw: _STATED,
    laws.RigidPlastic: [  # nothing below a limit, flow at it
        *_BOXED,
        _line((-0.55, -0.35), (0, -0.35), (0, 0.35), (0.55, 0.35), layer=UPON),
    ],
}

CENTRE = -9.0  # the coordinate t of the pin
_SPOKES = [_line((s, CENTRE), (s, 0)) for s in (-2, 2)]


def _turning(fill: str, *more: Stroke, tail: float = -2.0) -> Glyph:
    """A curved arrow."""
    head = np.array([(1.45, 0.95), (2.05, 0.0), (1.45, -0.95), (1.45, 0.95)])
    strokes = [_line((tail, 0), (1.6, 0), weight=2.6), Stroke(head, INK, 1.4, fill), *more]
    return Glyph(strokes, sweep=1.4 * math.pi, spins=True)


AROUND: dict[type, Glyph] = {
    laws.Spring: Glyph([_line((2, CENTRE), (2, -2.1), (-2, 0))], sweep=4.3 * math.pi),
    **{
        law: Glyph([*STRAIGHT[law], *_SPOKES])  # the straight one, with a spoke at both ends
        for law in (
            *(laws.Damper, laws.Stop, laws.Coulomb, laws.ForceLaw, ConnectorLaw),
            laws.RigidPlastic,
        )
    },
    laws.Motor: _turning(ORANGE),
    laws.Actuator: _turning(WHITE),
    laws.Controller: _turning(WHITE, _box(-2.0, -1.4, 0.5, WHITE), tail=-1.4),
}


def kind_of(law: laws.Law) -> type:
    """Class by which a law has its glyph; those of a user have one."""
    return ConnectorLaw if type(law) not in STRAIGHT else type(law)


def along(stroke: Stroke, a: Array, b: Array, across: Array, body: float) -> Stroke:
    """Place a stroke of a straight glyph from a to b; (2,) each; m.

    ``across`` is the vector of t = 1 (m), ``body`` the part of the way that the body takes.
    """
    s, t = stroke.points.T
    part = np.interp(s, [-2.0, -1.0, 1.0, 2.0], [0.0, (1 - body) / 2, (1 + body) / 2, 1.0])
    return stroke._replace(points=a + np.outer(part, b - a) + np.outer(t, across))


def around(stroke: Stroke, pin: Array, radius: float, angles: tuple[float, float]) -> Stroke:
    """Place a stroke of a glyph around a pin, over the beams.

    The ``radius`` (m) is that of t = 0, three units of t; ``angles`` are those of s = -2 and 2.
    """
    # Steps of 5 degrees, such that what is straight between two points is bent.
    steps = np.abs(np.diff(stroke.points[:, 0])) / 4.0 * abs(angles[1] - angles[0])
    counts = np.maximum(1, np.ceil(steps / math.radians(5.0))).astype(int)
    at = np.concatenate([[0.0], *(k + np.arange(1, n + 1) / n for k, n in enumerate(counts))])
    s, t = (np.interp(at, np.arange(len(stroke.points)), x) for x in stroke.points.T)
    r = np.maximum(radius * (1.0 + t / 3.0), 0.18 * radius)
    way = directions(np.interp(s, [-2.0, 2.0], angles))
    return stroke._replace(points=pin + r[:, None] * way, layer=FRONT)


def law_in_words(law: laws.Law, turns: bool) -> str:
    """Describe the law of a connector, which turns or not, and its size."""
    force, way = ("N m", "rad") if turns else ("N", "m")
    match law:
        case laws.Spring():
            words = [with_unit(law.stiffness, f"{force}/{way}")]
            words += ["yields"] if law.law else []
            words += ["breaks"] if law.softening else []
            return ", ".join(words)
        case laws.Damper():
            return with_unit(law.viscosity, f"{force} s/{way}")
        case laws.Stop():
            ends = [end for end in (law.low, law.high) if math.isfinite(end)]
            words = [f"{x:.3g} rad".replace("-", "−") if turns else with_unit(x, "m") for x in ends]
            sign = "≤ " if math.isinf(law.low) else "≥ " if math.isinf(law.high) else ""
            return f"stop {sign}{' … '.join(words)}"
        case laws.Coulomb():
            words = [with_unit(law.force, force)] if law.force else []
            words += [f"{law.coefficient:g}{' m' * turns} × press"] if law.coefficient else []
            return f"friction {' + '.join(words)}"
        case laws.RigidPlastic():
            return f"rigid up to {with_unit(float(law.law.limit), force)}"
        case ConnectorLaw():
            return type(law).__name__
        case _:
            return type(law).__name__.lower()
