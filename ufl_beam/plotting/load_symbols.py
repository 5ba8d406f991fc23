# SPDX-License-Identifier: MIT
"""Symbols of loads, prescribed motions and initial velocities, with their labels."""

from __future__ import annotations

import math
from collections.abc import Callable
from functools import singledispatch
from typing import NamedTuple

import numpy as np

from ufl_beam.arrays import Array
from ufl_beam.model.bodies import Anchor, Body, Member, Place
from ufl_beam.model.loads import FollowerLoad, Gravity, LineLoad, Load, PointLoad, RotatingFrame
from ufl_beam.model.masses import Velocity
from ufl_beam.model.supports import COMPONENTS, Support
from ufl_beam.model.time_functions import TimeFunction, steady
from ufl_beam.plotting.connector_glyphs import GREEN, RED, WHITE
from ufl_beam.plotting.labels import Label, Spot
from ufl_beam.plotting.plots import with_unit
from ufl_beam.plotting.symbols import FRONT, Stroke

MOVED = "#A86E00"
"""Colour of prescribed motions: the orange of what drives, dark enough for text."""

LOADS, MOTIONS, CAPTIONS, NAMES = range(4)
"""Ranks of labels: those of loads are placed first."""

HEAD, SHAFT = 0.85, 1.9
"""Length of the head of an arrow in units, and width of its line in points."""

Words = tuple[list[Stroke], list[Label]]
"""Strokes and labels of one object."""


class Bench(NamedTuple):
    """Sizes that the symbols of one picture share.

    Attributes:
        unit: Half the size of a symbol of a support; m.
        points: Points of length in a metre of the scene.
        axes: Axis of each beam through its vertices; (n, 2); m.
        ways: Directions in which beams leave a point; from it, (k, 2).
        largest: Largest force, force per length and velocity; N, N/m, m/s.
        stacks: Number of arrows that already stand at a place in a direction.
    """

    unit: float
    points: float
    axes: dict[Member, Array]
    ways: Callable[[Anchor], Array]
    largest: tuple[float, float, float]
    stacks: dict[object, float]

    def stacked(self, key: object, height: float) -> float:
        """Height at which the next symbol at a place begins, after those that are there; m."""
        before = self.stacks.get(key, 0.0)
        self.stacks[key] = before + height
        return before


# -- arrows ------------------------------------------------------------------------------------


def arrow(
    tail: Array, tip: Array, color: str, unit: float, *, hollow: bool = False, size: float = 1.0
) -> list[Stroke]:
    """A straight arrow.

    Args:
        tail: Where it begins; (2,); m.
        tip: Where it points to; (2,); m.
        color: Of line and head.
        unit: Half the size of a symbol of a support; m.
        hollow: Draw the head as an outline.
        size: Factor on the size of the head and the width of the line.
    """
    way = (tip - tail) / np.linalg.norm(tip - tail)
    head = size * unit * np.array([(0.0, 0.0), (-HEAD, 0.3), (-HEAD, -0.3), (0.0, 0.0)])
    outline = tip + head @ np.array([way, (-way[1], way[0])])
    fill = WHITE if hollow else color
    return [
        Stroke(np.array([tail, tip - size * HEAD * unit * way]), color, size * SHAFT, layer=FRONT),
        Stroke(outline, color, 1.0, fill, FRONT),
    ]


def turning_arrow(
    center: Array, radius: float, sign: float, color: str, unit: float, *, hollow: bool = False
) -> list[Stroke]:
    """An arrow around a point, counter-clockwise if ``sign`` is positive; lengths in m."""
    angles = np.radians(90.0 + sign * np.linspace(-150.0, 120.0, 40))
    arc = center + radius * np.column_stack([np.cos(angles), np.sin(angles)])
    length = min(HEAD * unit, radius)
    last = angles[-1] - sign * 0.5 * length / radius  # so that the head lies on the circle
    way = sign * np.array([-math.sin(last), math.cos(last)])
    head = length * np.array([(0.5, 0.0), (-0.5, 0.38), (-0.5, -0.38), (0.5, 0.0)])
    middle = center + radius * np.array([math.cos(last), math.sin(last)])
    shaft = arc[: int(len(arc) * (1 - length / radius / (1.5 * math.pi)))]
    return [
        Stroke(shaft, color, SHAFT, layer=FRONT),
        Stroke(
            middle + head @ np.array([way, (-way[1], way[0])]),
            color, 1.0, WHITE if hollow else color, FRONT,
        ),
    ]  # fmt: skip


def around(at: Array, gap: float) -> tuple[Spot, ...]:
    """Spots of a label on all sides of a symbol.

    Args:
        at: Centre of the symbol; (2,); m.
        gap: Its radius; points.
    """
    angles = np.radians([0, 180, 90, 270, 45, 135, 315, 225])
    return tuple(Spot(at, np.array([math.cos(a), math.sin(a)]), gap) for a in angles)


def beside(tail: Array, tip: Array) -> tuple[Spot, ...]:
    """Spots of the label of an arrow: beyond its tail, and on both sides."""
    way = (tip - tail) / np.linalg.norm(tip - tail)
    left = np.array([-way[1], way[0]])
    middle = (tail + tip) / 2
    return (
        Spot(tail, -way), Spot(tail, left), Spot(tail, -left), Spot(middle, left),
        Spot(middle, -left), Spot(tail, (left - way) / math.sqrt(2)),
        Spot(tail, (-left - way) / math.sqrt(2)),
    )  # fmt: skip


def in_time(text: str, time: TimeFunction) -> str:
    """The text, with a sign that the quantity varies in time if it does."""
    return text if time is steady else f"{text} × f(t)"


# -- loads -------------------------------------------------------------------------------------


@singledispatch
def load_symbol(load: Load, bench: Bench) -> Words:
    """Strokes and labels of a load; none of what acts on the whole scene."""
    return [], []


@load_symbol.register
def _(load: PointLoad, bench: Bench) -> Words:
    return _at_point(load, bench, hollow=False)


@load_symbol.register
def _(load: FollowerLoad, bench: Bench) -> Words:
    return _at_point(load, bench, hollow=True)


def _at_point(load: PointLoad | FollowerLoad, bench: Bench, *, hollow: bool) -> Words:
    """Arrows of force and moment; heads of loads that follow are hollow."""
    strokes, labels = [], []
    size = math.hypot(*load.force)
    at, more = np.array(load.place.point), ", follows" if hollow else ""
    if size > 0.0:
        way = np.array(load.force) / size
        tail, tip = _stand(load.place, way, size / bench.largest[0], bench)
        strokes += arrow(tail, tip, RED, bench.unit, hollow=hollow)
        text = in_time(with_unit(size, "N"), load.time) + more
        labels.append(Label(text, RED, LOADS, beside(tail, tip)))
    if load.moment:
        radius = 1.7 * bench.unit + bench.stacked((load.place.point, "moment"), 0.8 * bench.unit)
        strokes += turning_arrow(
            at, radius, math.copysign(1.0, load.moment), RED, bench.unit, hollow=hollow
        )
        text = in_time(with_unit(abs(load.moment), "N m"), load.time) + more
        labels.append(Label(text, RED, LOADS, around(at, radius * bench.points)))
    if not strokes:
        labels.append(Label("0 N", RED, LOADS, around(at, 0.0)))
    return strokes, labels


def _stand(place: Anchor, way: Array, part: float, bench: Bench) -> tuple[Array, Array]:
    """Tail and tip of the arrow of a force at a place.

    It ends at the place, or begins there where it would lie on a beam otherwise; where it would lie
    on beams in both cases, it is beside them.
    """
    at, length = np.array(place.point), (2.6 + 1.4 * part) * bench.unit
    if isinstance(place, Place):  # it stands out from a line load on the beam
        length += bench.stacks.get((place.beam, *np.round(way, 6)), 0.0)
    along = bench.ways(place) @ way  # cosines of the angles between the force and the beams
    behind, ahead = along.min(initial=0.0) < -0.9, along.max(initial=0.0) > 0.9
    pulls, apart = behind and not ahead, 0.3 * bench.unit
    start = apart + bench.stacked((place.point, *np.round(way, 6), pulls), length + apart)
    if behind and ahead:  # along a beam that goes on: beside it
        at = at + 0.8 * bench.unit * np.array([-way[1], way[0]])
    near, far = (
        at + (1.0 if pulls else -1.0) * distance * way for distance in (start, start + length)
    )
    return (near, far) if pulls else (far, near)


@load_symbol.register
def _(load: LineLoad, bench: Bench) -> Words:
    strokes, labels, axis = [], [], bench.axes[load.beam]
    size = math.hypot(*load.force)
    if size > 0.0:
        way = np.array(load.force) / size
        chord = axis[-1] - axis[0]
        across = abs(chord[0] * way[1] - chord[1] * way[0])
        comb = _comb if across > 0.25 * np.linalg.norm(chord) else _flow
        drawn, spots = comb(load.beam, way, size / bench.largest[1], bench)
        strokes += drawn
        labels.append(Label(in_time(with_unit(size, "N/m"), load.time), RED, LOADS, spots))
    if load.moment:
        for at in _spaced(axis, 3.2 * bench.unit, ends=False):
            sign = math.copysign(1.0, load.moment)
            strokes += turning_arrow(at, 0.75 * bench.unit, sign, RED, 0.7 * bench.unit)
        text = in_time(with_unit(abs(load.moment), "N m/m"), load.time)
        labels.append(Label(text, RED, LOADS, along_axis(axis, 0.9 * bench.unit * bench.points)))
    if not strokes:
        labels.append(Label("0 N/m", RED, LOADS, along_axis(axis, 0.0)))
    return strokes, labels


def _comb(
    beam: Member, way: Array, part: float, bench: Bench
) -> tuple[list[Stroke], tuple[Spot, ...]]:
    """Arrows that end on a beam, and the line that they begin at."""
    axis, unit = bench.axes[beam], bench.unit
    height = (1.3 + 1.1 * part) * unit
    start = bench.stacked((beam, *np.round(way, 6)), height + 0.35 * unit) + 0.3 * unit
    line = axis - (start + height) * way
    strokes = [Stroke(line, RED, 1.2, layer=FRONT)]
    for foot in _spaced(axis, 2.0 * unit):
        strokes += arrow(foot - (start + height) * way, foot - start * way, RED, unit, size=0.62)
    spots = [
        Spot(at, sign * left)
        for at, left in _normals(line)
        for sign in ((1.0, -1.0) if left @ way < 0 else (-1.0, 1.0))
    ]
    return strokes, tuple(spots)


def _flow(
    beam: Member, way: Array, part: float, bench: Bench
) -> tuple[list[Stroke], tuple[Spot, ...]]:
    """Arrows along a beam, beside it."""
    axis, unit = bench.axes[beam], bench.unit
    left = np.array([-way[1], way[0]])
    aside = 0.8 * unit + bench.stacked((beam, "along"), 0.7 * unit)
    strokes = []
    for at in _spaced(axis, 2.4 * unit, ends=False):
        foot = at + aside * left
        strokes += arrow(foot - 0.9 * unit * way, foot + 0.9 * unit * way, RED, unit, size=0.62)
    gap = (aside / unit + 0.3) * unit * bench.points
    return strokes, tuple(Spot(at, left, gap) for at, _ in _normals(axis))


@singledispatch
def badge(load: Load) -> tuple[str, tuple[float, float] | float] | None:
    """Words and symbol of a load on the whole scene: a direction, or a sense of rotation."""
    return None


@badge.register
def _(load: Gravity) -> tuple[str, tuple[float, float] | float]:
    size = math.hypot(*load.acceleration)
    return in_time(f"g = {size:.4g} m/s²", load.time), load.acceleration


@badge.register
def _(load: RotatingFrame) -> tuple[str, tuple[float, float] | float]:
    x, y = load.about
    return f"frame: {load.rate:.4g} rad/s about ({x:g}, {y:g})".replace("-", "−"), load.rate


# -- motions -----------------------------------------------------------------------------------


def prescribed_symbol(support: Support, inward: Array, bench: Bench) -> Words:
    """Strokes and labels of the motions that a support prescribes; hollow heads.

    Args:
        support: The support.
        inward: Direction in which its beam leaves the place; (2,).
        bench: Sizes of the picture.
    """
    strokes, labels = [], []
    at, unit = np.array(support.place.point), bench.unit
    cos, sin = math.cos(support.angle), math.sin(support.angle)
    for component, motion in support.moving.items():
        text = _motion_in_words(component, motion)
        if component == 2:
            radius = 1.9 * unit
            strokes += turning_arrow(at, radius, 1.0, MOVED, unit, hollow=True)
            labels.append(Label(text, MOVED, MOTIONS, around(at, radius * bench.points)))
            continue
        way = np.array([(cos, sin), (-sin, cos)][component])
        left = np.array([-way[1], way[0]])
        # Beside the place, on the side from which no beam comes.
        side = left if left @ inward <= 1e-9 else -left
        tail = at + 1.5 * unit * side
        strokes += arrow(tail, tail + 2.6 * unit * way, MOVED, unit, hollow=True)
        spots = [Spot(tail + k * unit * way, side) for k in (1.3, 2.6, 0.0)]
        spots += [Spot(tail + 2.6 * unit * way, way), Spot(tail, -way)]
        labels.append(Label(text, MOVED, MOTIONS, tuple(spots)))
    return strokes, labels


def _motion_in_words(component: int, motion: TimeFunction) -> str:
    name, unit = COMPONENTS[component].replace("psi", "ψ"), ("m", "m", "rad")[component]
    values = {float(motion(t)) for t in (0.0, 0.3, 1.0, 7.1)}
    return f"{name} = {with_unit(values.pop(), unit)}" if len(values) == 1 else f"{name}(t)"


def velocity_symbol(velocity: Velocity, bench: Bench) -> Words:
    """Strokes and labels of an initial motion."""
    strokes, labels, unit = [], [], bench.unit
    found: list[tuple[float, Array, Array]] = []
    for one in velocity.beams:
        for at in _points_of(one, bench):
            u, v, _ = velocity.at(*at)
            if (speed := math.hypot(u, v)) > 0.05 * bench.largest[2]:
                way = np.array([u, v]) / speed
                tip = at + (1.6 + 2.0 * speed / bench.largest[2]) * unit * way
                strokes += arrow(at, tip, GREEN, unit, size=0.8)
                found.append((speed, at, tip))
        if velocity.angular and isinstance(one, Body):
            at, sign = np.array(one.center), math.copysign(1.0, velocity.angular)
            strokes += turning_arrow(at, 1.5 * unit, sign, GREEN, 0.8 * unit)
    spin = f"{velocity.angular:.3g} rad/s".replace("-", "−") if velocity.angular else ""
    if found:
        speed, at, tip = max(found, key=lambda entry: entry[0])
        text = with_unit(speed, "m/s") + (f" ({spin})" if spin else "")
        labels.append(Label(text, GREEN, MOTIONS, beside(tip, at)))
    elif velocity.beams:
        at = _points_of(velocity.beams[0], bench)[0]
        gap = 1.8 * unit * bench.points if spin else 0.0
        labels.append(Label(spin or "0 m/s", GREEN, MOTIONS, around(at, gap)))
    return strokes, labels


def _points_of(one: Member | Body, bench: Bench) -> Array:
    """Points at which the velocity is shown; (n, 2); m."""
    if isinstance(one, Body):
        return np.array([one.center])
    return _spaced(bench.axes[one], 0.5 * _length(bench.axes[one]))


# -- along beams -------------------------------------------------------------------------------


def along_axis(axis: Array, gap: float) -> tuple[Spot, ...]:
    """Spots of a label on both sides along a beam.

    Args:
        axis: Points of the beam; (n, 2); m.
        gap: Least distance; points.
    """
    return tuple(Spot(at, s * left, gap) for at, left in _normals(axis) for s in (1.0, -1.0))


def _length(axis: Array) -> float:
    return float(np.linalg.norm(np.diff(axis, axis=0), axis=1).sum())


def _spaced(axis: Array, distance: float, *, ends: bool = True) -> Array:
    """Equally spaced points along a line, about as far apart as said; (n, 2); m."""
    number = max(1, round(_length(axis) / distance))
    parts = np.linspace(0.0, 1.0, number + 1) if ends else (np.arange(number) + 0.5) / number
    return _at_parts(axis, np.asarray(parts))


def _at_parts(axis: Array, parts: Array) -> Array:
    way = np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(axis, axis=0), axis=1))])
    return np.column_stack([np.interp(parts * way[-1], way, x) for x in axis.T])


def _normals(axis: Array) -> list[tuple[Array, Array]]:
    """Points along a line and the unit vector to its left there, from the middle outwards."""
    parts = np.array([0.5, 0.4, 0.6, 0.3, 0.7, 0.2, 0.8, 0.1, 0.9])
    at = _at_parts(axis, parts)
    left = (_at_parts(axis, parts + 0.01) - _at_parts(axis, parts - 0.01))[:, ::-1] * (-1.0, 1.0)
    return list(zip(at, left / np.linalg.norm(left, axis=1)[:, None], strict=True))
