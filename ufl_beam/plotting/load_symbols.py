# SPDX-License-Identifier: MIT
"""Symbols of loads, prescribed motions and initial velocities, with their labels."""

from __future__ import annotations

import math

import numpy as np

from ufl_beam.arrays import Array
from ufl_beam.model.bodies import Anchor, Body, Member, Place
from ufl_beam.model.loads import FollowerLoad, Gravity, LineLoad, Load, PointLoad, RotatingFrame
from ufl_beam.model.masses import Velocity
from ufl_beam.model.supports import COMPONENTS, Support
from ufl_beam.model.time_functions import TimeFunction, steady
from ufl_beam.plotting.geometry import directions, in_frame, left_of, lengths_along, unit_vectors
from ufl_beam.plotting.labels import Spot
from ufl_beam.plotting.model_sheet import LOADS, MOTIONS, Sheet, Spots, at_parts, normals
from ufl_beam.plotting.style import FRONT, GREEN, RED, WHITE, Stroke, with_unit

MOVED = "#A86E00"  # of prescribed motions: the orange of what drives, dark enough for text
HEAD, SHAFT = 0.85, 1.9  # length of the head of an arrow in units, and width of its line in points


# -- arrows ------------------------------------------------------------------------------------


def _arrow(
    tail: Array, tip: Array, color: str, unit: float, *, hollow: bool = False, size: float = 1.0
) -> list[Stroke]:
    """A straight arrow; ``size`` is a factor on its head and the width of its line."""
    ahead = size * HEAD * unit * unit_vectors(tip - tail)
    shaft = np.array([tail, tip - ahead])
    return [
        Stroke(shaft, color, size * SHAFT, layer=FRONT),
        _head(tip, ahead, 0.3 / HEAD, color, hollow),
    ]


def _turning_arrow(
    center: Array, radius: float, sense: float, color: str, unit: float, *, hollow: bool = False
) -> list[Stroke]:
    """An arrow around a point, counter-clockwise if ``sense`` is positive."""
    sign, length = math.copysign(1.0, sense), min(HEAD * unit, radius)
    angles = np.radians(90.0 + sign * np.linspace(-150.0, 120.0, 40))
    shaft = angles[: int(len(angles) * (1 - length / radius / (1.5 * math.pi)))]
    middle = directions(angles[-1] - sign * 0.5 * length / radius)  # so that it is on the circle
    ahead = sign * length * left_of(middle)
    return [
        Stroke(center + radius * directions(shaft), color, SHAFT, layer=FRONT),
        _head(center + radius * middle + 0.5 * ahead, ahead, 0.38, color, hollow),
    ]


def _head(tip: Array, ahead: Array, half: float, color: str, hollow: bool) -> Stroke:
    outline = in_frame([(0, 0), (-1, half), (-1, -half), (0, 0)], tip, ahead)
    return Stroke(outline, color, 1.0, WHITE if hollow else color, FRONT)


def _beside(tail: Array, tip: Array) -> Spots:
    """Spots of the label of an arrow: beyond its tail, and on both sides."""
    way, middle = unit_vectors(tip - tail), (tail + tip) / 2
    sides = left_of(way), -left_of(way)
    aside = [Spot(at, side) for at in (tail, middle) for side in sides]
    return Spot(tail, -way), *aside, *(Spot(tail, unit_vectors(side - way)) for side in sides)


def _in_time(text: str, time: TimeFunction) -> str:
    """Mark the text of a quantity that varies in time."""
    return text if time is steady else f"{text} × f(t)"


# -- loads -------------------------------------------------------------------------------------


def draw_load(sheet: Sheet, load: Load) -> None:
    """Draw a load with its labels; nothing of a load on the whole scene."""
    if isinstance(load, PointLoad | FollowerLoad):
        _draw_point_load(sheet, load)
    elif isinstance(load, LineLoad):
        _draw_line_load(sheet, load)


def _draw_point_load(sheet: Sheet, load: PointLoad | FollowerLoad) -> None:
    """Arrows of force and moment; heads of loads that follow are hollow."""
    at, unit, size = np.array(load.place.point), sheet.outside, math.hypot(*load.force)
    hollow = isinstance(load, FollowerLoad)
    more = ", follows" if hollow else ""
    if size > 0.0:
        way = np.array(load.force) / size
        tail, tip = _stand(sheet, load.place, way, size / sheet.subject.force)
        sheet.add("loads", _arrow(tail, tip, RED, unit, hollow=hollow))
        text = _in_time(with_unit(size, "N"), load.time) + more
        sheet.write(text, RED, LOADS, _beside(tail, tip))
    if load.moment:
        radius = 1.7 * unit + sheet.stack((load.place.point, "moment"), 0.8 * unit)
        sheet.add("loads", _turning_arrow(at, radius, load.moment, RED, unit, hollow=hollow))
        text = _in_time(with_unit(abs(load.moment), "N m"), load.time) + more
        sheet.write(text, RED, LOADS, sheet.around(at, radius))
    if not size and not load.moment:
        sheet.write("0 N", RED, LOADS, sheet.around(at, 0.0))


def _stand(sheet: Sheet, place: Anchor, way: Array, part: float) -> tuple[Array, Array]:
    """Tail and tip of the arrow of a force: it ends at its place, or begins there.

    It begins where it would lie on a beam else; where it would in both cases, it is beside it.
    """
    unit = sheet.outside
    at, length = np.array(place.point), (2.6 + 1.4 * part) * unit
    if isinstance(place, Place):  # it stands out from a line load on the beam
        length += sheet.height((place.beam, *np.round(way, 6)))
    along = sheet.subject.ways(place) @ way  # cosines of angles between the force and the beams
    behind, ahead = along.min(initial=0.0) < -0.9, along.max(initial=0.0) > 0.9
    pulls, apart = behind and not ahead, 0.3 * unit
    start = apart + sheet.stack((place.point, *np.round(way, 6), pulls), length + apart)
    if behind and ahead:  # along a beam that goes on: beside it
        at = at + 0.8 * unit * left_of(way)
    near, far = start * way, (start + length) * way
    return (at + near, at + far) if pulls else (at - far, at - near)


def _draw_line_load(sheet: Sheet, load: LineLoad) -> None:
    axis, unit, size = sheet.subject.axes[load.beam], sheet.outside, math.hypot(*load.force)
    if size > 0.0:
        way = np.array(load.force) / size
        chord = axis[-1] - axis[0]
        across = abs(left_of(chord) @ way) > 0.25 * np.linalg.norm(chord)
        draw = _draw_comb if across else _draw_flow
        spots = draw(sheet, load.beam, way, size / sheet.subject.line_load)
        sheet.write(_in_time(with_unit(size, "N/m"), load.time), RED, LOADS, spots)
    if load.moment:
        for at in _spaced(axis, 3.2 * unit, ends=False):
            arrow = _turning_arrow(at, 0.75 * unit, load.moment, RED, 0.7 * unit)
            sheet.add("loads", arrow)
        text = _in_time(with_unit(abs(load.moment), "N m/m"), load.time)
        sheet.write(text, RED, LOADS, sheet.along(axis, 0.9 * unit))
    if not size and not load.moment:
        sheet.write("0 N/m", RED, LOADS, sheet.along(axis, 0.0))


def _draw_comb(sheet: Sheet, beam: Member, way: Array, part: float) -> Spots:
    """Arrows that end on a beam, and the line that they begin at; spots of the label."""
    axis, unit = sheet.subject.axes[beam], sheet.outside
    height = (1.3 + 1.1 * part) * unit
    near = sheet.stack((beam, *np.round(way, 6)), height + 0.35 * unit) + 0.3 * unit
    far = near + height
    line = axis - far * way
    sheet.add("loads", [Stroke(line, RED, 1.2, layer=FRONT)])
    for foot in _spaced(axis, 2.0 * unit):
        sheet.add("loads", _arrow(foot - far * way, foot - near * way, RED, unit, size=0.62))
    outwards = [(at, left if left @ way < 0 else -left) for at, left in normals(line)]
    return tuple(Spot(at, side) for at, out in outwards for side in (out, -out))


def _draw_flow(sheet: Sheet, beam: Member, way: Array, part: float) -> Spots:
    """Arrows along a beam, beside it; spots of the label."""
    axis, unit, left = sheet.subject.axes[beam], sheet.outside, left_of(way)
    aside = 0.8 * unit + sheet.stack((beam, "along"), 0.7 * unit)
    for at in _spaced(axis, 2.4 * unit, ends=False) + aside * left:
        half = 0.9 * unit * way
        sheet.add("loads", _arrow(at - half, at + half, RED, unit, size=0.62))
    return tuple(Spot(at, left, (aside + 0.3 * unit) / sheet.scale) for at, _ in normals(axis))


def _spaced(axis: Array, distance: float, *, ends: bool = True) -> Array:
    """Equally spaced points along a line, about as far apart as said; (n, 2); m."""
    number = max(1, round(lengths_along(axis)[-1] / distance))
    steps = np.arange(number + 1) if ends else np.arange(number) + 0.5
    return at_parts(axis, steps / number)


def badge(load: Load) -> tuple[str, str, float] | None:
    """Describe a load on the whole scene: words, an arrow, and the angle of that (degrees)."""
    if isinstance(load, Gravity):
        x, y = load.acceleration
        size = math.hypot(x, y)
        angle = math.degrees(math.atan2(y, x))
        return _in_time(f"g = {size:.4g} m/s²", load.time), "→" if size else "", angle
    if isinstance(load, RotatingFrame):
        x, y = load.about
        text = f"frame: {load.rate:.4g} rad/s about ({x:g}, {y:g})".replace("-", "−")
        return text, "↺" if load.rate >= 0 else "↻", 0.0
    return None


# -- motions -----------------------------------------------------------------------------------


def draw_prescribed(sheet: Sheet, support: Support) -> None:
    """Draw the motions that a support prescribes, hollow."""
    at, unit = np.array(support.place.point), sheet.outside
    ways = sheet.subject.ways(support.place)
    inward = ways[0] if len(ways) else np.array([0.0, 1.0])
    for component, motion in support.moving.items():
        text = _motion_in_words(component, motion)
        if component == 2:
            radius = 1.9 * unit
            sheet.add("motions", _turning_arrow(at, radius, 1.0, MOVED, unit, hollow=True))
            sheet.write(text, MOVED, MOTIONS, sheet.around(at, radius))
            continue
        way = directions(support.angle + component * math.pi / 2)
        # Beside the place, on the side from which no beam comes.
        side = left_of(way) if left_of(way) @ inward <= 1e-9 else -left_of(way)
        tail = at + 1.5 * unit * side
        tip = tail + 2.6 * unit * way
        sheet.add("motions", _arrow(tail, tip, MOVED, unit, hollow=True))
        spots = (*(Spot(x, side) for x in ((tail + tip) / 2, tip, tail)), Spot(tip, way))
        sheet.write(text, MOVED, MOTIONS, (*spots, Spot(tail, -way)))


def _motion_in_words(component: int, motion: TimeFunction) -> str:
    name, unit = COMPONENTS[component].replace("psi", "ψ"), ("m", "m", "rad")[component]
    values = {float(motion(t)) for t in (0.0, 0.3, 1.0, 7.1)}
    return f"{name} = {with_unit(values.pop(), unit)}" if len(values) == 1 else f"{name}(t)"


def draw_velocity(sheet: Sheet, velocity: Velocity) -> None:
    """Draw an initial motion with its label."""
    unit, subject = sheet.outside, sheet.subject
    found: list[tuple[float, Array, Array]] = []
    for part in velocity.beams:
        for at in subject.points_of(part):
            u, v, _ = velocity.at(*at)
            if (speed := math.hypot(u, v)) > 0.05 * subject.speed:
                way = np.array([u, v]) / speed
                tip = at + (1.6 + 2.0 * speed / subject.speed) * unit * way
                sheet.add("velocities", _arrow(at, tip, GREEN, unit, size=0.8))
                found.append((speed, at, tip))
        if velocity.angular and isinstance(part, Body):
            center = np.array(part.center)
            arrow = _turning_arrow(center, 1.5 * unit, velocity.angular, GREEN, 0.8 * unit)
            sheet.add("velocities", arrow)
    spin = f"{velocity.angular:.3g} rad/s".replace("-", "−") if velocity.angular else ""
    if found:
        speed, at, tip = max(found, key=lambda entry: entry[0])
        text = with_unit(speed, "m/s") + (f" ({spin})" if spin else "")
        sheet.write(text, GREEN, MOTIONS, _beside(tip, at))
    elif velocity.beams:
        at = subject.points_of(velocity.beams[0])[0]
        spots = sheet.around(at, 1.8 * unit if spin else 0.0)
        sheet.write(spin or "0 m/s", GREEN, MOTIONS, spots)
