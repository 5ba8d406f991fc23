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
from ufl_beam.plotting.labels import Label, Spot
from ufl_beam.plotting.style import FRONT, GREEN, RED, WHITE, Stroke, with_unit

MOVED = "#A86E00"  # of prescribed motions: the orange of what drives, dark enough for text
LOADS, MOTIONS, CAPTIONS, NAMES = range(4)  # ranks of labels: those of loads are placed first
HEAD, SHAFT = 0.85, 1.9  # length of the head of an arrow in units, and width of its line in points

Spots = tuple[Spot, ...]
Drawn = tuple[list[Stroke], list[Label]]  # strokes and labels of one object


class Sizes(NamedTuple):
    """Sizes that the symbols of one picture share."""

    unit: float  # half the size of a symbol of a support; m
    points: float  # points of length in a metre of the scene
    axes: dict[Member, Array]  # axis of each beam through its vertices; (n, 2); m
    ways: Callable[[Anchor], Array]  # directions in which beams leave a point; (k, 2)
    largest: tuple[float, float, float]  # force, force per length and velocity; N, N/m, m/s
    stacks: dict[object, float]  # height of the arrows that stand at a place in a direction; m

    def stacked(self, key: object, height: float) -> float:
        """Height at which the next symbol at a place begins, after those that are there; m."""
        before = self.stacks.get(key, 0.0)
        self.stacks[key] = before + height
        return before


# -- arrows ------------------------------------------------------------------------------------


def left_of(way: Array) -> Array:
    """Turn a vector to its left; (2,)."""
    return np.array([-way[1], way[0]])


def arrow(
    tail: Array, tip: Array, color: str, unit: float, *, hollow: bool = False, size: float = 1.0
) -> list[Stroke]:
    """Draw a straight arrow; ``size`` is a factor on its head and the width of its line."""
    way = (tip - tail) / np.linalg.norm(tip - tail)
    head = size * unit * np.array([(0.0, 0.0), (-HEAD, 0.3), (-HEAD, -0.3), (0.0, 0.0)])
    outline = tip + head @ np.array([way, left_of(way)])
    return [
        Stroke(np.array([tail, tip - size * HEAD * unit * way]), color, size * SHAFT, layer=FRONT),
        Stroke(outline, color, 1.0, WHITE if hollow else color, FRONT),
    ]


def turning_arrow(
    center: Array, radius: float, sense: float, color: str, unit: float, *, hollow: bool = False
) -> list[Stroke]:
    """Draw an arrow around a point, counter-clockwise if ``sense`` is positive; m."""
    sign = math.copysign(1.0, sense)
    angles = np.radians(90.0 + sign * np.linspace(-150.0, 120.0, 40))
    arc = center + radius * np.column_stack([np.cos(angles), np.sin(angles)])
    length = min(HEAD * unit, radius)
    last = angles[-1] - sign * 0.5 * length / radius  # so that the head lies on the circle
    way = sign * np.array([-math.sin(last), math.cos(last)])
    head = length * np.array([(0.5, 0.0), (-0.5, 0.38), (-0.5, -0.38), (0.5, 0.0)])
    middle = center + radius * np.array([math.cos(last), math.sin(last)])
    outline = middle + head @ np.array([way, left_of(way)])
    shaft = arc[: int(len(arc) * (1 - length / radius / (1.5 * math.pi)))]
    return [
        Stroke(shaft, color, SHAFT, layer=FRONT),
        Stroke(outline, color, 1.0, WHITE if hollow else color, FRONT),
    ]


def around(at: Array, gap: float) -> Spots:
    """List spots of a label on all sides of a symbol, whose radius is ``gap`` (points)."""
    angles = np.radians([0, 180, 90, 270, 45, 135, 315, 225])
    return tuple(Spot(at, np.array([math.cos(a), math.sin(a)]), gap) for a in angles)


def beside(tail: Array, tip: Array) -> Spots:
    """List spots of the label of an arrow: beyond its tail, and on both sides."""
    way: Array = (tip - tail) / np.linalg.norm(tip - tail)
    left, middle = left_of(way), np.asarray((tail + tip) / 2)
    ahead = (Spot(tail, -way), *(Spot(at, s * left) for at in (tail, middle) for s in (1.0, -1.0)))
    aside = (Spot(tail, np.asarray((s * left - way) / math.sqrt(2))) for s in (1.0, -1.0))
    return *ahead, *aside


def in_time(text: str, time: TimeFunction) -> str:
    """Mark the text of a quantity that varies in time."""
    return text if time is steady else f"{text} × f(t)"


# -- loads -------------------------------------------------------------------------------------


@singledispatch
def load_symbol(load: Load, sizes: Sizes) -> Drawn:
    """Draw a load with its labels; nothing of a load on the whole scene."""
    return [], []


@load_symbol.register(PointLoad)
@load_symbol.register(FollowerLoad)
def _(load: PointLoad | FollowerLoad, sizes: Sizes) -> Drawn:
    """Arrows of force and moment; heads of loads that follow are hollow."""
    strokes, labels, hollow = [], [], isinstance(load, FollowerLoad)
    size = math.hypot(*load.force)
    at, more = np.array(load.place.point), ", follows" if hollow else ""
    if size > 0.0:
        way = np.array(load.force) / size
        tail, tip = _stand(load.place, way, size / sizes.largest[0], sizes)
        strokes += arrow(tail, tip, RED, sizes.unit, hollow=hollow)
        text = in_time(with_unit(size, "N"), load.time) + more
        labels.append(Label(text, RED, LOADS, beside(tail, tip)))
    if load.moment:
        radius = 1.7 * sizes.unit + sizes.stacked((load.place.point, "moment"), 0.8 * sizes.unit)
        strokes += turning_arrow(at, radius, load.moment, RED, sizes.unit, hollow=hollow)
        text = in_time(with_unit(abs(load.moment), "N m"), load.time) + more
        labels.append(Label(text, RED, LOADS, around(at, radius * sizes.points)))
    if not strokes:
        labels.append(Label("0 N", RED, LOADS, around(at, 0.0)))
    return strokes, labels


def _stand(place: Anchor, way: Array, part: float, sizes: Sizes) -> tuple[Array, Array]:
    """Tail and tip of the arrow of a force: it ends at its place, or begins there.

    It begins where it would lie on a beam else; where it would in both cases, it is beside it.
    """
    at, length = np.array(place.point), (2.6 + 1.4 * part) * sizes.unit
    if isinstance(place, Place):  # it stands out from a line load on the beam
        length += sizes.stacks.get((place.beam, *np.round(way, 6)), 0.0)
    along = sizes.ways(place) @ way  # cosines of the angles between the force and the beams
    behind, ahead = along.min(initial=0.0) < -0.9, along.max(initial=0.0) > 0.9
    pulls, apart = behind and not ahead, 0.3 * sizes.unit
    start = apart + sizes.stacked((place.point, *np.round(way, 6), pulls), length + apart)
    if behind and ahead:  # along a beam that goes on: beside it
        at = at + 0.8 * sizes.unit * left_of(way)
    if pulls:
        return at + start * way, at + (start + length) * way
    return at - (start + length) * way, at - start * way


@load_symbol.register
def _(load: LineLoad, sizes: Sizes) -> Drawn:
    strokes, labels, axis = [], [], sizes.axes[load.beam]
    size = math.hypot(*load.force)
    if size > 0.0:
        way = np.array(load.force) / size
        chord = axis[-1] - axis[0]
        across = abs(chord[0] * way[1] - chord[1] * way[0])
        comb = _comb if across > 0.25 * np.linalg.norm(chord) else _flow
        drawn, spots = comb(load.beam, way, size / sizes.largest[1], sizes)
        strokes += drawn
        labels.append(Label(in_time(with_unit(size, "N/m"), load.time), RED, LOADS, spots))
    if load.moment:
        for at in _spaced(axis, 3.2 * sizes.unit, ends=False):
            strokes += turning_arrow(at, 0.75 * sizes.unit, load.moment, RED, 0.7 * sizes.unit)
        text = in_time(with_unit(abs(load.moment), "N m/m"), load.time)
        labels.append(Label(text, RED, LOADS, along_axis(axis, 0.9 * sizes.unit * sizes.points)))
    if not strokes:
        labels.append(Label("0 N/m", RED, LOADS, along_axis(axis, 0.0)))
    return strokes, labels


def _comb(beam: Member, way: Array, part: float, sizes: Sizes) -> tuple[list[Stroke], Spots]:
    """Arrows that end on a beam, and the line that they begin at."""
    axis, unit = sizes.axes[beam], sizes.unit
    height = (1.3 + 1.1 * part) * unit
    start = sizes.stacked((beam, *np.round(way, 6)), height + 0.35 * unit) + 0.3 * unit
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


def _flow(beam: Member, way: Array, part: float, sizes: Sizes) -> tuple[list[Stroke], Spots]:
    """Arrows along a beam, beside it."""
    axis, unit = sizes.axes[beam], sizes.unit
    left = left_of(way)
    aside = 0.8 * unit + sizes.stacked((beam, "along"), 0.7 * unit)
    strokes = []
    for at in _spaced(axis, 2.4 * unit, ends=False):
        foot = at + aside * left
        strokes += arrow(foot - 0.9 * unit * way, foot + 0.9 * unit * way, RED, unit, size=0.62)
    gap = (aside / unit + 0.3) * unit * sizes.points
    return strokes, tuple(Spot(at, left, gap) for at, _ in _normals(axis))


@singledispatch
def badge(load: Load) -> tuple[str, tuple[float, float] | float] | None:
    """Describe a load on the whole scene, with its direction or sense of rotation."""
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


def prescribed_symbol(support: Support, inward: Array, sizes: Sizes) -> Drawn:
    """Draw motions that a support prescribes, hollow; its beam goes ``inward``, a vector."""
    strokes, labels = [], []
    at, unit = np.array(support.place.point), sizes.unit
    cos, sin = math.cos(support.angle), math.sin(support.angle)
    for component, motion in support.moving.items():
        text = _motion_in_words(component, motion)
        if component == 2:
            radius = 1.9 * unit
            strokes += turning_arrow(at, radius, 1.0, MOVED, unit, hollow=True)
            labels.append(Label(text, MOVED, MOTIONS, around(at, radius * sizes.points)))
            continue
        way = np.array([(cos, sin), (-sin, cos)][component])
        left = left_of(way)
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


def velocity_symbol(velocity: Velocity, sizes: Sizes) -> Drawn:
    """Draw an initial motion with its label."""
    strokes, labels, unit = [], [], sizes.unit
    found: list[tuple[float, Array, Array]] = []
    for one in velocity.beams:
        for at in _points_of(one, sizes):
            u, v, _ = velocity.at(*at)
            if (speed := math.hypot(u, v)) > 0.05 * sizes.largest[2]:
                way = np.array([u, v]) / speed
                tip = at + (1.6 + 2.0 * speed / sizes.largest[2]) * unit * way
                strokes += arrow(at, tip, GREEN, unit, size=0.8)
                found.append((speed, at, tip))
        if velocity.angular and isinstance(one, Body):
            at = np.array(one.center)
            strokes += turning_arrow(at, 1.5 * unit, velocity.angular, GREEN, 0.8 * unit)
    spin = f"{velocity.angular:.3g} rad/s".replace("-", "−") if velocity.angular else ""
    if found:
        speed, at, tip = max(found, key=lambda entry: entry[0])
        text = with_unit(speed, "m/s") + (f" ({spin})" if spin else "")
        labels.append(Label(text, GREEN, MOTIONS, beside(tip, at)))
    elif velocity.beams:
        at = _points_of(velocity.beams[0], sizes)[0]
        gap = 1.8 * unit * sizes.points if spin else 0.0
        labels.append(Label(spin or "0 m/s", GREEN, MOTIONS, around(at, gap)))
    return strokes, labels


def _points_of(one: Member | Body, sizes: Sizes) -> Array:
    """Points at which the velocity is shown: both ends and the middle of a beam; (n, 2); m."""
    if isinstance(one, Body):
        return np.array([one.center])
    return _at_parts(sizes.axes[one], np.array([0.0, 0.5, 1.0]))


# -- along beams -------------------------------------------------------------------------------


def along_axis(axis: Array, gap: float) -> Spots:
    """List spots of a label on both sides of a beam, at least a ``gap`` away (points)."""
    return tuple(Spot(at, s * left, gap) for at, left in _normals(axis) for s in (1.0, -1.0))


def _spaced(axis: Array, distance: float, *, ends: bool = True) -> Array:
    """Equally spaced points along a line, about as far apart as said; (n, 2); m."""
    length = float(np.linalg.norm(np.diff(axis, axis=0), axis=1).sum())
    number = max(1, round(length / distance))
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
