# SPDX-License-Identifier: MIT
"""Strokes and labels of the picture of a model, at a scale to be determined."""

from __future__ import annotations

import math
from collections import Counter, defaultdict
from collections.abc import Iterable, Sequence

import numpy as np

from ufl_beam.arrays import Array
from ufl_beam.model.bodies import Anchor, Body, Member, Place, Velocity
from ufl_beam.model.connectors import law_of, place_of
from ufl_beam.model.functions import TimeFunction, steady
from ufl_beam.model.loads import FollowerLoad, LineLoad, PointLoad
from ufl_beam.model.scene import Scene
from ufl_beam.model.supports import COMPONENTS, Support
from ufl_beam.plotting import layout, symbols
from ufl_beam.plotting.layout import Spot, directions, left_of, points_along, unit_vectors
from ufl_beam.plotting.style import GREEN, INK, RED, TEXT, WHITE, number, with_unit
from ufl_beam.plotting.symbols import FRONT, Stroke, disc

LOADS, MOTIONS, CAPTIONS, NAMES = range(4)  # ranks of labels: labels of loads are placed first
MOST_LABELS = 80  # number beyond which names and captions are left out
MOST_CELLS = 300  # number of cells beyond which they are not marked

HINGE = "#B0508A"  # colour of hinges
MOVED = "#A86E00"  # colour of prescribed motions: the orange of drives, dark enough for text
HEAD, SHAFT = 0.85, 1.9  # length of the head of an arrow in units, and width of its line in points

Spots = tuple[Spot, ...]


class Subject:
    """Scene with data common to its pictures at all scales; lengths in m."""

    def __init__(self, scene: Scene) -> None:
        self.scene, attached = scene, scene.attached
        self.axes: dict[Member, Array] = {  # vertices; (n, 2)
            beam: np.array([beam.curve(s) for s in beam.vertices(attached[beam])], float)
            for beam in scene.beams
        }
        self.cells = sum(len(axis) - 1 for axis in self.axes.values())
        self.names: dict[Member | Body, str] = {}  # equal names get their number in the scene
        kinds: tuple[Sequence[Member | Body], ...] = (scene.beams, scene.bodies)
        for parts in kinds:
            known = Counter(part.name for part in parts)
            for k, part in enumerate(parts):
                self.names[part] = f"{part.name} {k}" if known[part.name] > 1 else part.name
        forces = [x.force for x in scene.loads if isinstance(x, PointLoad | FollowerLoad)]
        lines = [x.force for x in scene.loads if isinstance(x, LineLoad)]
        speeds = [
            velocity.at(*at)[:2]
            for velocity in scene.initial
            for part in velocity.beams
            for at in self.points_of(part)
        ]
        self.force, self.line_load, self.speed = (  # the largest ones; N, N/m, m/s
            max((math.hypot(*x) for x in found), default=0.0) or 1.0
            for found in (forces, lines, speeds)
        )
        ends = [(x[0], x[1], x[-1], x[-2]) for x in self.axes.values()]
        self._ends: Array = np.reshape(ends, (-1, 2, 2))

    def ways(self, anchor: Anchor) -> Array:
        """Return the directions in which beams leave a place; (n, 2)."""
        near = np.abs(self._ends[:, 0] - anchor.point).max(axis=1) < 1e-7 * self.scene.size
        pairs = [*self._ends[near]]
        if isinstance(anchor, Place) and 0.0 < anchor.s < 1.0:
            axis = self.axes[anchor.beam]
            k = int(np.argmin(np.linalg.norm(axis - anchor.point, axis=1)))
            pairs += [axis[[k, j]] for j in (k - 1, k + 1) if 0 <= j < len(axis)]
        start, end = np.reshape(pairs, (-1, 2, 2)).swapaxes(0, 1)
        return unit_vectors(end - start)

    def points_of(self, part: Member | Body) -> Array:
        """Return the points at which velocities are shown: ends and middle of a beam; (n, 2)."""
        if isinstance(part, Body):
            return np.array([part.center])
        return points_along(self.axes[part], [0.0, 0.5, 1.0])


class Sheet:
    """Strokes of a picture by groups, and its labels; lengths in m."""

    def __init__(self, subject: Subject, scale: float) -> None:
        self.subject, self.scale = subject, scale  # the scale is the length of a point
        self.pose = layout.Stage.at_scale(subject.scene, 1.0, scale).undeformed
        self.unit, self.outside = self.pose.stage.unit, self.pose.stage.outside
        self.strokes: defaultdict[str, list[Stroke]] = defaultdict(list)
        self.labels: list[layout.Label] = []
        self.stacks: defaultdict[object, float] = defaultdict(float)
        """Heights of the symbols at a place in a direction."""

    def write(self, text: str, color: str, rank: int, spots: Iterable[Spot]) -> None:
        """Add a label with its candidate positions."""
        self.labels.append(layout.Label(text, color, rank, tuple(spots)))

    def stack(self, key: object, height: float) -> float:
        """Stack a symbol onto the others at a place; return the height at which it begins."""
        self.stacks[key] += height
        return self.stacks[key] - height

    def around(self, at: Array, radius: float) -> Spots:
        """List spots of a label on all sides of a symbol."""
        ways = directions(np.radians([0, 180, 90, 270, 45, 135, 315, 225]))
        return tuple(Spot(at, way, radius / self.scale) for way in ways)

    def along(self, axis: Array, distance: float) -> Spots:
        """List spots of a label on both sides of a beam, at least a distance away."""
        gap = distance / self.scale
        return tuple(Spot(at, s * left, gap) for at, left in _normals(axis) for s in (1.0, -1.0))


def _normals(axis: Array) -> list[tuple[Array, Array]]:
    """Return points along a line and unit vectors to its left, from the middle outwards."""
    parts = np.array([0.5, 0.4, 0.6, 0.3, 0.7, 0.2, 0.8, 0.1, 0.9])
    way = points_along(axis, parts + 0.01) - points_along(axis, parts - 0.01)
    return list(zip(points_along(axis, parts), left_of(unit_vectors(way)), strict=True))


def draw(subject: Subject, scale: float) -> Sheet:
    """Draw all objects of a scene; the length of a point is ``scale`` (m)."""
    scene, sheet = subject.scene, Sheet(subject, scale)
    _draw_beams(sheet)
    for group, strokes in symbols.in_plane(sheet.pose).items():
        sheet.strokes[group] += strokes
    _name_bodies_and_connectors(sheet)
    for support in scene.supports:
        _draw_prescribed(sheet, support)
    for mass in scene.masses:
        spots = sheet.around(np.array(mass.place.point), 0.45 * sheet.unit)
        sheet.write(f"{mass.mass:.4g} kg", INK, CAPTIONS, spots)
    # Line loads come first, so that forces are stacked above them.
    for load in sorted(scene.loads, key=lambda load: not isinstance(load, LineLoad)):
        if isinstance(load, LineLoad):
            _draw_line_load(sheet, load)
        elif isinstance(load, PointLoad | FollowerLoad):
            _draw_point_load(sheet, load)
    for velocity in scene.initial:
        _draw_velocity(sheet, velocity)
    return sheet


def _draw_beams(sheet: Sheet) -> None:
    """Draw axes, names and hinges; if few, also marks between cells and of possible hinges."""
    subject, scale, unit = sheet.subject, sheet.scale, sheet.unit
    weight = 2.8 * unit / scale / layout.SYMBOL
    sheet.strokes["beams"] += (Stroke(x, INK, weight, layer=4.0) for x in subject.axes.values())
    for beam, axis in subject.axes.items():
        if subject.cells <= MOST_CELLS:
            steps = np.diff(axis, axis=0)
            if len(steps) > 1 and np.linalg.norm(steps, axis=1).min() > 7.0 * scale:
                left = 3.2 * scale * left_of(unit_vectors(steps[1:] + steps[:-1]))
                marks = np.stack([axis[1:-1] - left, axis[1:-1] + left], axis=1)
                sheet.strokes["cells"] += (Stroke(ends, INK, 1.0, layer=4.0) for ends in marks)
            if beam.section.hinge is not None and beam.section.hinge.opens:
                middles = (axis[1:] + axis[:-1]) / 2
                sheet.strokes["hinges"] += (
                    disc(x, 0.14 * unit, HINGE, HINGE, 4.1) for x in middles
                )
        if len(subject.axes) <= MOST_LABELS:
            sheet.write(subject.names[beam], TEXT, NAMES, sheet.along(axis, 2.5 * scale))
    for hinge in subject.scene.hinges:
        place, r = place_of(hinge), 0.25 * unit
        axis, at = subject.axes[place.beam], np.array(place.point)
        if place.s in (0.0, 1.0):  # beside the symbol at the end of the beam
            end, inner = axis[:2] if place.s == 0.0 else axis[:-3:-1]
            at = at + 0.7 * unit * unit_vectors(inner - end)
        sheet.strokes["hinges"] += [disc(at, r, HINGE, HINGE, 5.2)]
        if place.s in place.beam.hinges:
            words = f"hinge {with_unit(float(law_of(hinge).limit), 'N m')}"
            sheet.write(words, HINGE, CAPTIONS, sheet.around(at, r))


def _name_bodies_and_connectors(sheet: Sheet) -> None:
    """Write names and masses of bodies, kinds and sizes of connectors."""
    scene, stage, unit, scale = sheet.subject.scene, sheet.pose.stage, sheet.unit, sheet.scale
    for body in scene.bodies if len(scene.bodies) <= symbols.MOST_BODIES else ():
        arms, name = (stage.outlines[body] - body.center) / scale, sheet.subject.names[body]
        spots = sheet.around(np.array(body.center), 0.0)
        words = f"{name}, {body.mass:.4g} kg" if body.mass else name
        outside = (spot._replace(gap=float((arms @ spot.way).max())) for spot in spots)
        sheet.write(words, TEXT, NAMES, outside)
    for connector in scene.connectors:
        offset = stage.offsets[connector]
        a, b = symbols.ends_of(sheet.pose, connector)
        if connector.turns:
            spots = sheet.around(b, (1.6 + offset + 0.8) * unit)
        else:
            apart = math.dist(a, b) > 0.1 * unit
            across = left_of(unit_vectors(b - a) if apart else np.array(connector.axis))
            outwards = math.copysign(1.0, offset) * across
            spots = tuple(
                Spot(a + part * (b - a) + offset * unit * across, side, 0.8 * unit / scale)
                for part in (0.5, 0.3, 0.7)
                for side in (outwards, -outwards)
            )
        units = ("N m", "rad") if connector.turns else ("N", "m")
        words = symbols.glyph_of(connector.law).words(connector.law, *units)
        sheet.write(words, TEXT, CAPTIONS, spots)


# -- arrows ------------------------------------------------------------------------------------


def _arrow(
    line: Array, color: str, unit: float, *, hollow: bool = False, size: float = 1.0
) -> list[Stroke]:
    """Draw an arrow along a line; ``size`` is a factor on its head and the width of the line."""
    lengths = layout.lengths_along(line)
    head = min(size * HEAD * unit / lengths[-1], 1.0 / 3.0)
    shaft = points_along(line, lengths / lengths[-1] * (1.0 - head))
    tip = layout.in_frame([(0, 0), (-1, 0.36), (-1, -0.36), (0, 0)], line[-1], line[-1] - shaft[-1])
    return [
        Stroke(shaft, color, size * SHAFT, layer=FRONT),
        Stroke(tip, color, 1.0, WHITE if hollow else color, FRONT),
    ]


def _around(center: Array, radius: float, sense: float) -> Array:
    """Return the arc of an arrow around a point, counter-clockwise if ``sense`` > 0; (n, 2)."""
    turns = math.copysign(1.0, sense) * np.linspace(-150.0, 120.0, 40)
    return np.asarray(center + radius * directions(np.radians(90.0 + turns)))


def _beside(tail: Array, tip: Array) -> Spots:
    """List spots of the label of an arrow: beyond its tail, and on both sides."""
    way, middle = unit_vectors(tip - tail), (tail + tip) / 2
    sides = left_of(way), -left_of(way)
    aside = [Spot(at, side) for at in (tail, middle) for side in sides]
    return Spot(tail, -way), *aside, *(Spot(tail, unit_vectors(side - way)) for side in sides)


def in_time(text: str, time: TimeFunction) -> str:
    """Mark the text of a quantity that varies in time."""
    return text if time is steady else f"{text} × f(t)"


# -- loads -------------------------------------------------------------------------------------


def _draw_point_load(sheet: Sheet, load: PointLoad | FollowerLoad) -> None:
    """Draw arrows of force and moment; follower loads have hollow heads."""
    at, unit, size = np.array(load.place.point), sheet.outside, math.hypot(*load.force)
    hollow = isinstance(load, FollowerLoad)
    more = ", follows" if hollow else ""
    if size > 0.0:
        way = np.array(load.force) / size
        line = _stand(sheet, load.place, way, size / sheet.subject.force)
        sheet.strokes["loads"] += _arrow(line, RED, unit, hollow=hollow)
        text = in_time(with_unit(size, "N"), load.amplitude) + more
        sheet.write(text, RED, LOADS, _beside(*line))
    if load.moment:
        radius = 1.7 * unit + sheet.stack((load.place.point, "moment"), 0.8 * unit)
        sheet.strokes["loads"] += _arrow(_around(at, radius, load.moment), RED, unit, hollow=hollow)
        text = in_time(with_unit(abs(load.moment), "N m"), load.amplitude) + more
        sheet.write(text, RED, LOADS, sheet.around(at, radius))
    if not size and not load.moment:
        sheet.write("0 N", RED, LOADS, sheet.around(at, 0.0))


def _stand(sheet: Sheet, place: Anchor, way: Array, part: float) -> Array:
    """Return the line of the arrow of a force, which ends at its place; (2, 2); m.

    If it would lie on a beam, it begins at its place; if it still would, it is beside the beam.
    """
    unit = sheet.outside
    at, length = np.array(place.point), (2.6 + 1.4 * part) * unit
    if isinstance(place, Place):  # beyond a line load on the beam
        length += sheet.stacks[(place.beam, *np.round(way, 6))]
    along = sheet.subject.ways(place) @ way  # cosines of angles between the force and the beams
    behind, ahead = along.min(initial=0.0) < -0.9, along.max(initial=0.0) > 0.9
    pulls, apart = behind and not ahead, 0.3 * unit
    start = apart + sheet.stack((place.point, *np.round(way, 6), pulls), length + apart)
    if behind and ahead:  # along a continuous beam: beside it
        at = at + 0.8 * unit * left_of(way)
    ends = np.outer((start, start + length), way)
    return np.asarray(at + ends if pulls else at - ends[::-1])


def _draw_line_load(sheet: Sheet, load: LineLoad) -> None:
    """Draw arrows that end on the beam, or are beside it if parallel to it; draw moments."""
    axis, unit, size = sheet.subject.axes[load.beam], sheet.outside, math.hypot(*load.force)

    def spaced(distance: float, *, ends: bool = False) -> Array:
        """Return equally spaced points, about ``distance`` apart; (n, 2); m."""
        number = max(1, round(layout.lengths_along(axis)[-1] / distance))
        steps = np.arange(number + 1) if ends else np.arange(number) + 0.5
        return points_along(axis, steps / number)

    if size > 0.0:
        way, chord = np.array(load.force) / size, axis[-1] - axis[0]
        if abs(left_of(chord) @ way) > 0.25 * np.linalg.norm(chord):
            height = (1.3 + 1.1 * size / sheet.subject.line_load) * unit
            begin = sheet.stack((load.beam, *np.round(way, 6)), height + 0.35 * unit)
            near, far = begin + 0.3 * unit, begin + 0.3 * unit + height
            line = axis - far * way
            sheet.strokes["loads"] += [Stroke(line, RED, 1.2, layer=FRONT)]
            for foot in spaced(2.0 * unit, ends=True):
                ends = foot - np.outer((far, near), way)
                sheet.strokes["loads"] += _arrow(ends, RED, unit, size=0.62)
            outwards = [(at, left if left @ way < 0 else -left) for at, left in _normals(line)]
            spots = [Spot(at, side) for at, out in outwards for side in (out, -out)]
        else:
            aside, left = 0.8 * unit + sheet.stack((load.beam, "along"), 0.7 * unit), left_of(way)
            for at in spaced(2.4 * unit) + aside * left:
                ends = at + np.outer((-0.9 * unit, 0.9 * unit), way)
                sheet.strokes["loads"] += _arrow(ends, RED, unit, size=0.62)
            gap = (aside + 0.3 * unit) / sheet.scale
            spots = [Spot(at, left, gap) for at, _ in _normals(axis)]
        sheet.write(in_time(with_unit(size, "N/m"), load.amplitude), RED, LOADS, spots)
    if load.moment:
        for at in spaced(3.2 * unit):
            line = _around(at, 0.75 * unit, load.moment)
            sheet.strokes["loads"] += _arrow(line, RED, 0.7 * unit)
        text = in_time(with_unit(abs(load.moment), "N m/m"), load.amplitude)
        sheet.write(text, RED, LOADS, sheet.along(axis, 0.9 * unit))
    if not size and not load.moment:
        sheet.write("0 N/m", RED, LOADS, sheet.along(axis, 0.0))


# -- motions -----------------------------------------------------------------------------------


def _draw_prescribed(sheet: Sheet, support: Support) -> None:
    """Draw motions that a support prescribes, as hollow arrows."""
    at, unit = np.array(support.place.point), sheet.outside
    ways = sheet.subject.ways(support.place)
    inward = ways[0] if len(ways) else np.array([0.0, 1.0])
    for component, motion in support.moving.items():
        name, of = COMPONENTS[component].replace("psi", "ψ"), ("m", "m", "rad")[component]
        values = {float(motion(t)) for t in (0.0, 0.3, 1.0, 7.1)}
        text = f"{name} = {with_unit(values.pop(), of)}" if len(values) == 1 else f"{name}(t)"
        if component == 2:
            radius = 1.9 * unit
            sheet.strokes["motions"] += _arrow(_around(at, radius, 1.0), MOVED, unit, hollow=True)
            sheet.write(text, MOVED, MOTIONS, sheet.around(at, radius))
            continue
        way = directions(support.angle + component * math.pi / 2)
        # Beside the place, on the side from which no beam comes.
        side = left_of(way) if left_of(way) @ inward <= 1e-9 else -left_of(way)
        line = at + 1.5 * unit * side + np.outer((0.0, 2.6 * unit), way)
        sheet.strokes["motions"] += _arrow(line, MOVED, unit, hollow=True)
        tail, tip = line
        spots = (*(Spot(x, side) for x in (line.mean(axis=0), tip, tail)), Spot(tip, way))
        sheet.write(text, MOVED, MOTIONS, (*spots, Spot(tail, -way)))


def _draw_velocity(sheet: Sheet, velocity: Velocity) -> None:
    """Draw an initial velocity with its label."""
    unit, subject = sheet.outside, sheet.subject
    found: list[tuple[float, Array, Array]] = []
    for part in velocity.beams:
        for at in subject.points_of(part):
            u, v, _ = velocity.at(*at)
            if (speed := math.hypot(u, v)) > 0.05 * subject.speed:
                way = np.array([u, v]) / speed
                tip = at + (1.6 + 2.0 * speed / subject.speed) * unit * way
                sheet.strokes["velocities"] += _arrow(np.array([at, tip]), GREEN, unit, size=0.8)
                found.append((speed, at, tip))
        if velocity.angular and isinstance(part, Body):
            line = _around(np.array(part.center), 1.5 * unit, velocity.angular)
            sheet.strokes["velocities"] += _arrow(line, GREEN, 0.8 * unit)
    spin = f"{number(velocity.angular)} rad/s" if velocity.angular else ""
    if found:
        speed, at, tip = max(found, key=lambda entry: entry[0])
        text = with_unit(speed, "m/s") + (f" ({spin})" if spin else "")
        sheet.write(text, GREEN, MOTIONS, _beside(tip, at))
    elif velocity.beams:
        at = subject.points_of(velocity.beams[0])[0]
        spots = sheet.around(at, 1.8 * unit if spin else 0.0)
        sheet.write(spin or "0 m/s", GREEN, MOTIONS, spots)
