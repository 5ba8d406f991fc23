# SPDX-License-Identifier: MIT
"""Strokes and labels of the picture of a model, at a given scale."""

from __future__ import annotations

import math
from collections import Counter, defaultdict
from collections.abc import Iterable, Sequence
from typing import Any

import numpy as np

from ufl_beam.arrays import Array
from ufl_beam.model.bodies import AttachmentPoint, Body, Member, Place, Velocity
from ufl_beam.model.connectors import Connector, law_of, place_of
from ufl_beam.model.functions import TimeFunction, steady
from ufl_beam.model.imposed_strains import ImposedStrain
from ufl_beam.model.loads import (
    FollowerLoad,
    LineLoad,
    LoadAlongBeam,
    LoadAtPlace,
    MovingLoad,
    Pressure,
)
from ufl_beam.model.scene import Scene
from ufl_beam.model.supports import COMPONENTS, Support
from ufl_beam.plotting import positions, symbols
from ufl_beam.plotting.positions import Candidate, directions, normal, points_along, unit_vectors
from ufl_beam.plotting.style import BLUE, GREEN, INK, RED, TEXT, WHITE, number, with_unit
from ufl_beam.plotting.symbols import FRONT, Stroke, disc

LOAD_LABELS, MOTIONS, CAPTIONS, NAMES = range(
    4
)  # ranks of labels: labels of loads are placed first
MOST_LABELS = 80  # number of labels beyond which names, and then captions, are left out
MOST_CELLS = 300  # number of cells beyond which neither cells nor possible hinges are marked
FEW_HINGES = 4  # number of equal hinges or connectors beyond which they have a note, not labels

HINGE = "#B0508A"  # colour of hinges
HINGES = HINGE, "#4B2E83", "#1B7F79", "#777777"  # colours of groups of equal hinges; last: others
MOVED = "#A86E00"  # colour of prescribed motions: the orange of drives, dark enough for text
HEAD, SHAFT = 0.85, 1.9  # length of the head of an arrow in units of symbols; line width in points


def _kilograms(mass: float) -> str:
    """Write a mass with at least four digits, without an exponent up to a million kilograms."""
    digits = max(3 - math.floor(math.log10(mass)), 0) if mass > 0 else 0
    return f"{round(mass, digits):.10g} kg" if 1e-4 < mass < 1e6 else f"{mass:.4g} kg"


class Subject:
    """Scene, with data for its pictures at any scale; lengths in m."""

    def __init__(self, scene: Scene) -> None:
        self.scene, attached = scene, scene.attached
        self.axes: dict[Member, Array] = {  # vertices; (n, 2)
            beam: np.array([beam.curve(s) for s in beam.vertices(attached[beam])], float)
            for beam in scene.beams
        }
        self.cells = sum(len(axis) - 1 for axis in self.axes.values())
        self.names: dict[Member | Body, str] = {}  # equal names are followed by a number
        kinds: tuple[Sequence[Member | Body], ...] = (scene.beams, scene.bodies)
        for objects in kinds:
            known = Counter(member.name for member in objects)
            for k, member in enumerate(objects):
                self.names[member] = f"{member.name} {k}" if known[member.name] > 1 else member.name
        forces = [x.force for x in scene.loads if isinstance(x, LoadAtPlace | MovingLoad)]
        lines = [
            np.abs(self.line(x)[1]).max() * _components(x)
            for x in scene.loads
            if isinstance(x, LoadAlongBeam)
        ]
        speeds = [
            velocity.at(*at)[:2]
            for velocity in scene.initial
            for member in velocity.beams
            for at in self.velocity_points(member)
        ]
        self.force, self.line_load, self.speed = (  # largest magnitudes; N, N/m, m/s
            max((math.hypot(*x) for x in vectors), default=0.0) or 1.0
            for vectors in (forces, lines, speeds)
        )
        self.hinge_notes, self.hinge_colors = self._groups()
        words = Counter(map(connector_words, scene.connectors))
        self.alike = {text: number for text, number in words.items() if number > FEW_HINGES}
        ends = [(x[0], x[1], x[-1], x[-2]) for x in self.axes.values()]
        self._ends: Array = np.reshape(ends, (-1, 2, 2))

    def _groups(self) -> tuple[dict[str, str], dict[Connector, str]]:
        """Return colours of notes on many equal hinges, and of these hinges."""
        alike: defaultdict[float, list[Connector]] = defaultdict(list)
        for hinge in self.scene.hinges:
            if place_of(hinge).s in place_of(hinge).beam.hinges:
                alike[float(law_of(hinge).limit)].append(hinge)
        groups = [([limit], same) for limit, same in alike.items() if len(same) > FEW_HINGES]
        if len(others := groups[len(HINGES) - 1 :]) > 1:
            limits = sorted(limit for some, _ in others for limit in some)
            groups[len(HINGES) - 1 :] = [(limits, [hinge for _, same in others for hinge in same])]
        notes, colors = dict[str, str](), dict[Connector, str]()
        for (limits, same), color in zip(groups, HINGES, strict=False):
            words = " to ".join(dict.fromkeys(with_unit(x, "N m") for x in (limits[0], limits[-1])))
            notes[f"dots: {len(same)} hinges, {words}"] = color
            colors |= dict.fromkeys(same, color)
        return notes, colors

    def line(self, load: LoadAlongBeam | ImposedStrain) -> tuple[Array, Array]:
        """Return points of the axis in the span of a load, and its factors or strains at them.

        The points (n, 2), in m, are the vertices and 99 points between the ends.  A load with
        constant factors has the vertices only.
        """
        s = np.array(load.beam.vertices(self.scene.attached[load.beam]))
        low, high = (np.abs(s - end).argmin() for end in load.span)
        s = s[low : high + 1]
        profile = load.profile if isinstance(load, LoadAlongBeam) else load.strains
        if callable(profile) or profile[0] != profile[1]:
            s = np.union1d(s, np.linspace(s[0], s[-1], 101))
        axis = np.array([load.beam.curve(x) for x in s], float)
        return axis, load.strains(s) if isinstance(load, ImposedStrain) else load.factors(s)

    def directions_at(self, place: AttachmentPoint) -> Array:
        """Return the directions in which beams leave a place; (n, 2)."""
        close = np.abs(self._ends[:, 0] - place.point).max(axis=1) < 1e-7 * self.scene.size
        pairs = [*self._ends[close]]
        if isinstance(place, Place) and 0.0 < place.s < 1.0:
            axis = self.axes[place.beam]
            k = int(np.argmin(np.linalg.norm(axis - place.point, axis=1)))
            pairs += [axis[[k, j]] for j in (k - 1, k + 1) if 0 <= j < len(axis)]
        start, end = np.reshape(pairs, (-1, 2, 2)).swapaxes(0, 1)
        return unit_vectors(end - start)

    def velocity_points(self, member: Member | Body) -> Array:
        """Return points for velocities: ends and middle of a beam, or centre of a body; (n, 2)."""
        if isinstance(member, Body):
            return np.array([member.center])
        return points_along(self.axes[member], [0.0, 0.5, 1.0])


class Drawing:
    """Strokes of a picture by groups, in m, and its labels, in points."""

    def __init__(self, subject: Subject, scale: float) -> None:
        self.subject, self.scale = subject, scale  # length of a typographic point; m
        self.shape = positions.Canvas.at_scale(subject.scene, 1.0, scale).undeformed
        self.unit, self.outside = self.shape.canvas.unit, self.shape.canvas.outside
        self.strokes: defaultdict[str, list[Stroke]] = defaultdict(list)
        self.labels: list[positions.Label] = []
        self.stacks: defaultdict[object, float] = defaultdict(float)
        """Total height of the symbols that are stacked at a place in a direction; m."""

    def write(self, text: str, color: str, rank: int, spots: Iterable[Candidate]) -> None:
        """Add a label with its candidate positions, which are given in m."""
        in_points = tuple(
            Candidate(np.divide(at, self.scale), direction, gap / self.scale)
            for at, direction, gap in spots
        )
        self.labels.append(positions.Label(text, color, rank, in_points))

    def stack(self, key: object, height: float) -> float:
        """Stack a symbol onto the others at a place; return the height at which it begins; m."""
        self.stacks[key] += height
        return self.stacks[key] - height


def _normals(axis: Array) -> list[tuple[Array, Array]]:
    """Return points along a line and unit vectors to its left, from the middle outwards."""
    fractions = np.array([0.5, 0.4, 0.6, 0.3, 0.7, 0.2, 0.8, 0.1, 0.9])
    steps = points_along(axis, fractions + 0.01) - points_along(axis, fractions - 0.01)
    return list(zip(points_along(axis, fractions), normal(unit_vectors(steps)), strict=True))


def _around(at: Array, radius: float) -> list[Candidate]:
    """List candidate positions of a label on all sides of a symbol."""
    ways = directions(np.radians([0, 180, 90, 270, 45, 135, 315, 225]))
    return [Candidate(at, x, radius) for x in ways]


def _along(axis: Array, gap: float) -> list[Candidate]:
    """List candidate positions of a label on both sides of a beam."""
    return [Candidate(at, s * left, gap) for at, left in _normals(axis) for s in (1.0, -1.0)]


def _beside(tail: Array, tip: Array) -> list[Candidate]:
    """List candidate positions of the label of an arrow: beyond its tail, and on both sides."""
    ahead, middle = unit_vectors(tip - tail), (tail + tip) / 2
    sides = normal(ahead), -normal(ahead)
    aside = [Candidate(at, side) for at in (tail, middle) for side in sides]
    oblique = (Candidate(tail, unit_vectors(side - ahead)) for side in sides)
    return [Candidate(tail, -ahead), *aside, *oblique]


def draw(subject: Subject, scale: float) -> Drawing:
    """Draw all objects of a scene; the length of a point is ``scale`` (m)."""
    scene, drawing = subject.scene, Drawing(subject, scale)
    _draw_beams(drawing)
    for group, strokes in symbols.in_plane(drawing.shape).items():
        drawing.strokes[group] += strokes
    _name_bodies_and_connectors(drawing)
    for support in scene.supports:
        _draw_prescribed(drawing, support)
    for mass in scene.masses:
        spots = _around(np.array(mass.place.point), 0.45 * drawing.unit)
        drawing.write(_kilograms(mass.mass), INK, CAPTIONS, spots)
    # Line loads come first, so that forces are stacked above them.
    for load in sorted(scene.loads, key=lambda load: not isinstance(load, LoadAlongBeam)):
        if isinstance(load, LoadAlongBeam):
            _draw_line_load(drawing, load)
        elif isinstance(load, ImposedStrain):
            _draw_imposed_strain(drawing, load)
        elif isinstance(load, LoadAtPlace):
            _draw_point_load(drawing, load)
        elif isinstance(load, MovingLoad):
            _draw_moving_load(drawing, load)
    for velocity in scene.initial:
        _draw_velocity(drawing, velocity)
    return drawing


def _draw_beams(drawing: Drawing) -> None:
    """Draw axes, names and hinges of beams; mark cells and their hinges unless there are many."""
    subject, scale, unit = drawing.subject, drawing.scale, drawing.unit
    weight = 2.8 * unit / scale / positions.SYMBOL
    drawing.strokes["beams"] += (Stroke(x, INK, weight, layer=4.0) for x in subject.axes.values())
    for beam, axis in subject.axes.items():
        if subject.cells <= MOST_CELLS:
            steps = np.diff(axis, axis=0)
            if len(steps) > 1 and np.linalg.norm(steps, axis=1).min() > 7.0 * scale:
                left = 3.2 * scale * normal(unit_vectors(steps[1:] + steps[:-1]))
                marks = np.stack([axis[1:-1] - left, axis[1:-1] + left], axis=1)
                drawing.strokes["cells"] += (Stroke(ends, INK, 1.0, layer=4.0) for ends in marks)
            if beam.section.hinge is not None and beam.section.hinge.opens:
                middles = (axis[1:] + axis[:-1]) / 2
                drawing.strokes["hinges"] += (
                    disc(x, 0.14 * unit, HINGE, HINGE, 4.1) for x in middles
                )
        if len(subject.axes) <= MOST_LABELS:
            drawing.write(subject.names[beam], TEXT, NAMES, _along(axis, 2.5 * scale))
    for hinge in subject.scene.hinges:
        place, r = place_of(hinge), 0.25 * unit
        axis, at = subject.axes[place.beam], np.array(place.point)
        if place.s in (0.0, 1.0):  # beside the symbol at the end of the beam
            end, inner = axis[:2] if place.s == 0.0 else axis[:-3:-1]
            at = at + 0.7 * unit * unit_vectors(inner - end)
        color = subject.hinge_colors.get(hinge, HINGE)
        drawing.strokes["hinges"] += [disc(at, r, color, color, 5.2)]
        if place.s in place.beam.hinges and hinge not in subject.hinge_colors:
            words = f"hinge {with_unit(float(law_of(hinge).limit), 'N m')}"
            drawing.write(words, HINGE, CAPTIONS, _around(at, r))


def _name_bodies_and_connectors(drawing: Drawing) -> None:
    """Write names and masses of bodies, and parameters of connectors."""
    scene, canvas = drawing.subject.scene, drawing.shape.canvas
    unit = drawing.unit
    for body in scene.bodies if len(scene.bodies) <= symbols.MOST_BODIES else ():
        arms, name = canvas.outlines[body] - body.center, drawing.subject.names[body]
        spots = _around(np.array(body.center), 0.0)
        words = f"{name}, {_kilograms(body.mass)}" if body.mass else name
        outside = (x._replace(gap=float((arms @ x.direction).max())) for x in spots)
        drawing.write(words, TEXT, NAMES, outside)
    for connector in scene.connectors:
        offset = canvas.offsets[connector]
        a, b = symbols.connector_ends(drawing.shape, connector)
        if connector.is_rotation:
            spots = _around(b, (1.6 + offset + 0.8) * unit)
        else:
            apart = math.dist(a, b) > 0.1 * unit
            across = normal(unit_vectors(b - a) if apart else np.array(connector.axis))
            outwards = math.copysign(1.0, offset) * across
            spots = [
                Candidate(a + fraction * (b - a) + offset * unit * across, side, 0.8 * unit)
                for fraction in (0.5, 0.3, 0.7)
                for side in (outwards, -outwards)
            ]
        if (words := connector_words(connector)) not in drawing.subject.alike:
            drawing.write(words, TEXT, CAPTIONS, spots)


def connector_words(connector: Connector) -> str:
    """Return the name and the parameters of a connector."""
    units = ("N m", "rad") if connector.is_rotation else ("N", "m")
    words = symbols.law_symbol(connector.law).words(connector.law, *units)
    return f"{connector.name}, " * bool(connector.name) + words


# -- arrows ------------------------------------------------------------------------------------


def _arrow(
    line: Array, color: str, unit: float, *, hollow: bool = False, size: float = 1.0
) -> list[Stroke]:
    """Draw an arrow along a line; ``size`` scales its head and the width of its line."""
    lengths = positions.lengths_along(line)
    head = min(size * HEAD * unit / lengths[-1], 1.0 / 3.0)
    shaft = points_along(line, lengths / lengths[-1] * (1.0 - head))
    tip = positions.in_frame(
        [(0, 0), (-1, 0.36), (-1, -0.36), (0, 0)], line[-1], line[-1] - shaft[-1]
    )
    return [
        Stroke(shaft, color, size * SHAFT, layer=FRONT),
        Stroke(tip, color, 1.0, WHITE if hollow else color, FRONT),
    ]


def _arc(center: Array, radius: float, sense: float) -> Array:
    """Return the arc of an arrow around a point, counter-clockwise if ``sense`` > 0; (n, 2)."""
    angles = math.copysign(1.0, sense) * np.linspace(-150.0, 120.0, 40)
    return np.asarray(center + radius * directions(np.radians(90.0 + angles)))


def in_time(text: str, time: TimeFunction) -> str:
    """Mark the text of a quantity that varies in time."""
    return text if time == steady else f"{text} × f(t)"


# -- loads -------------------------------------------------------------------------------------


def _draw_point_load(drawing: Drawing, load: LoadAtPlace) -> None:
    """Draw arrows of force and moment; follower loads have hollow heads."""
    at, unit, size = np.array(load.place.point), drawing.outside, math.hypot(*load.force)
    hollow = isinstance(load, FollowerLoad)
    more = ", follows" if hollow else ""
    if size > 0.0:
        direction = np.array(load.force) / size
        line = _force_arrow(drawing, load.place, direction, size / drawing.subject.force)
        drawing.strokes["loads"] += _arrow(line, RED, unit, hollow=hollow)
        text = in_time(with_unit(size, "N"), load.amplitude) + more
        drawing.write(text, RED, LOAD_LABELS, _beside(*line))
    if load.moment:
        radius = 1.7 * unit + drawing.stack((load.place.point, "moment"), 0.8 * unit)
        drawing.strokes["loads"] += _arrow(_arc(at, radius, load.moment), RED, unit, hollow=hollow)
        text = in_time(with_unit(abs(load.moment), "N m"), load.amplitude) + more
        drawing.write(text, RED, LOAD_LABELS, _around(at, radius))
    if not size and not load.moment:
        drawing.write("0 N", RED, LOAD_LABELS, _around(at, 0.0))


def _draw_moving_load(drawing: Drawing, load: MovingLoad) -> None:
    """Draw the force at its place at t = 0, or at the nearer end of its route."""
    size, subject = math.hypot(*load.force), drawing.subject
    lengths = [positions.lengths_along(subject.axes[beam])[-1] for beam in load.route]
    ends = np.cumsum(lengths)
    distance = min(max(float(load.position(0.0)), 0.0), ends[-1])
    k = int(np.searchsorted(ends, distance))
    place = load.route[k].at(float(1.0 - (ends[k] - distance) / lengths[k]))
    if not size:
        drawing.write("0 N", RED, LOAD_LABELS, _around(np.array(place.point), 0.0))
        return
    line = _force_arrow(drawing, place, np.array(load.force) / size, size / subject.force)
    drawing.strokes["loads"] += _arrow(line, RED, drawing.outside)
    text = in_time(with_unit(size, "N"), load.amplitude) + ", moves"
    drawing.write(text, RED, LOAD_LABELS, _beside(*line))


def _force_arrow(
    drawing: Drawing, place: AttachmentPoint, direction: Array, fraction: float
) -> Array:
    """Return the line of the arrow of a force; (2, 2); m.

    By default the arrow ends at the loaded place.  If it would then lie on a beam, it begins at the
    place.  If beams are on both sides, it is drawn beside the beam.
    """
    unit = drawing.outside
    at, length = np.array(place.point), (2.6 + 1.4 * fraction) * unit
    if isinstance(place, Place):  # long enough to be seen beside a line load
        length += drawing.stacks[(place.beam, *np.round(direction, 6))]
    # Cosines of the angles between the force and the beams
    along = drawing.subject.directions_at(place) @ direction
    behind, ahead = along.min(initial=0.0) < -0.9, along.max(initial=0.0) > 0.9
    pulls, apart = behind and not ahead, 0.3 * unit
    start = apart + drawing.stack((place.point, *np.round(direction, 6), pulls), length + apart)
    if behind and ahead:  # along a continuous beam: beside it
        at = at + 0.8 * unit * normal(direction)
    ends = np.outer((start, start + length), direction)
    return np.asarray(at + ends if pulls else at - ends[::-1])


def _components(load: LoadAlongBeam) -> Array:
    """Return the force per length along x and y, or along the axis and its normal; (2,); N/m."""
    if isinstance(load, Pressure):
        return np.array([load.tangential, load.normal])
    assert isinstance(load, LineLoad)
    return np.array(load.force)


def _draw_line_load(drawing: Drawing, load: LoadAlongBeam) -> None:
    """Draw a line load: its moments, and arrows across the beam or parallel to it.

    Arrows of a pressure have hollow heads.
    """
    (axis, factors), unit = drawing.subject.line(load), drawing.outside
    largest = factors[np.abs(factors).argmax()]  # the sizes in labels are the largest ones
    force, follows = _components(load) * largest, isinstance(load, Pressure)
    size, moment = math.hypot(*force), load.moment * largest if isinstance(load, LineLoad) else 0.0
    shares = factors / largest if largest else factors
    lengths = positions.lengths_along(axis)
    ways: Array = np.tile(force / (size or 1.0), (len(axis), 1))  # direction at each point
    if follows:
        tangents = unit_vectors(np.gradient(axis, lengths, axis=0))
        ways = ways[:, :1] * tangents + ways[:, 1:] * normal(tangents)

    def spaced(distance: float, *, ends: bool = False) -> list[Any]:
        """List equally spaced points, about ``distance`` (m) apart, with shares and directions."""
        number = max(1, round(lengths[-1] / distance))
        steps = (np.arange(number + 1) if ends else np.arange(number) + 0.5) / number
        at = steps * lengths[-1]
        intensity, *heading = (np.interp(at, lengths, x) for x in (shares, *ways.T))
        return list(
            zip(points_along(axis, steps), intensity, np.column_stack(heading), strict=True)
        )

    if size > 0.0:
        direction, chord = force / size, axis[-1] - axis[0]
        across = direction[1] if follows else normal(chord) @ direction / np.linalg.norm(chord)
        if abs(across) > 0.25:
            height = (1.3 + 1.1 * size / drawing.subject.line_load) * unit
            begin = drawing.stack((load.beam, *np.round(direction, 6)), height + 0.35 * unit)
            low = begin + 0.3 * unit
            line = axis - (low + height * np.abs(shares))[:, None] * ways
            drawing.strokes["loads"] += [Stroke(line, RED, 1.2, layer=FRONT)]
            for foot, intensity, heading in spaced(2.0 * unit, ends=True):
                if height * abs(intensity) > 0.5 * unit:
                    ends = foot - np.outer((low + height * abs(intensity), low), heading)
                    ends = ends if intensity > 0 else ends[::-1]
                    drawing.strokes["loads"] += _arrow(ends, RED, unit, hollow=follows, size=0.62)
            outwards = [
                (at, left if (across if follows else left @ direction) < 0 else -left)
                for at, left in _normals(line)
            ]
            spots = [Candidate(at, side) for at, out in outwards for side in (out, -out)]
        else:
            aside = 0.8 * unit + drawing.stack((load.beam, "along"), 0.7 * unit)
            for at, intensity, heading in spaced(2.4 * unit):
                if abs(intensity) > 0.05:
                    half = 0.9 * unit * math.copysign(1.0, intensity)
                    ends = at + aside * normal(heading) + np.outer((-half, half), heading)
                    drawing.strokes["loads"] += _arrow(ends, RED, unit, hollow=follows, size=0.62)
            spots = [
                Candidate(
                    at, direction[0] * left if follows else normal(direction), aside + 0.3 * unit
                )
                for at, left in _normals(axis)
            ]
        text = in_time(with_unit(size, "N/m"), load.amplitude) + ", follows" * follows
        drawing.write(text, RED, LOAD_LABELS, spots)
    if moment:
        for at, intensity, _ in spaced(3.2 * unit):
            if abs(intensity) > 0.05:
                line = _arc(np.asarray(at), 0.75 * unit, math.copysign(moment, moment * intensity))
                drawing.strokes["loads"] += _arrow(line, RED, 0.7 * unit)
        text = in_time(with_unit(abs(moment), "N m/m"), load.amplitude)
        drawing.write(text, RED, LOAD_LABELS, _along(axis, 0.9 * unit))
    if not size and not moment:
        drawing.write("0 N/m", RED, LOAD_LABELS, _along(axis, 0.0))


def _draw_imposed_strain(drawing: Drawing, load: ImposedStrain) -> None:
    """Draw lines on both sides of a beam, red where it becomes longer, blue where shorter."""
    (axis, strains), unit = drawing.subject.line(load), drawing.outside
    middle = (strains[1:] + strains[:-1]) / 2
    left, depth = normal(unit_vectors(np.diff(axis, axis=0))), load.beam.section.depth
    apart = 0.5 * unit + drawing.stack((load.beam, "strain"), 0.3 * unit)
    for side in (1.0, -1.0):
        fibre = middle[:, 0] - side * middle[:, 2] * depth / 2
        for k in np.flatnonzero(fibre):
            line = axis[k : k + 2] + side * apart * left[k]
            drawing.strokes["loads"] += [Stroke(line, RED if fibre[k] > 0 else BLUE, 1.6)]
    largest = strains[np.abs(strains).argmax(axis=0), range(3)]
    sizes = zip(("ε", "γ", "κ"), largest, ("", "", " 1/m"), strict=True)
    text = ", ".join(f"{x} = {number(size)}{unit_of}" for x, size, unit_of in sizes if size)
    spots = _along(axis, apart + 0.3 * unit)
    drawing.write(in_time(text or "ε = 0", load.amplitude), RED, LOAD_LABELS, spots)


# -- motions -----------------------------------------------------------------------------------


def _draw_prescribed(drawing: Drawing, support: Support) -> None:
    """Draw motions that a support prescribes, as arrows with hollow heads."""
    at, unit = np.array(support.place.point), drawing.outside
    ways = drawing.subject.directions_at(support.place)
    inward = ways[0] if len(ways) else np.array([0.0, 1.0])
    for component, motion in support.moving.items():
        name, symbol = COMPONENTS[component].replace("psi", "ψ"), ("m", "m", "rad")[component]
        values = {float(motion(t)) for t in (0.0, 0.3, 1.0, 7.1)}
        text = f"{name} = {with_unit(values.pop(), symbol)}" if len(values) == 1 else f"{name}(t)"
        if component == 2:
            radius = 1.9 * unit
            drawing.strokes["motions"] += _arrow(_arc(at, radius, 1.0), MOVED, unit, hollow=True)
            drawing.write(text, MOVED, MOTIONS, _around(at, radius))
            continue
        direction = directions(support.angle + component * math.pi / 2)
        # Beside the place, on the side from which no beam comes.
        left = normal(direction)
        side = left if left @ inward <= 1e-9 else -left
        line = at + 1.5 * unit * side + np.outer((0.0, 2.6 * unit), direction)
        drawing.strokes["motions"] += _arrow(line, MOVED, unit, hollow=True)
        tail, tip = line
        spots = [Candidate(x, side) for x in (line.mean(axis=0), tip, tail)]
        spots += [Candidate(tip, direction), Candidate(tail, -direction)]
        drawing.write(text, MOVED, MOTIONS, spots)


def _draw_velocity(drawing: Drawing, velocity: Velocity) -> None:
    """Draw an initial velocity with its label."""
    unit, subject = drawing.outside, drawing.subject
    arrows: list[tuple[float, Array, Array]] = []
    for member in velocity.beams:
        for at in subject.velocity_points(member):
            u, v, _ = velocity.at(*at)
            if (speed := math.hypot(u, v)) > 0.05 * subject.speed:
                direction = np.array([u, v]) / speed
                tip = at + (1.6 + 2.0 * speed / subject.speed) * unit * direction
                drawing.strokes["velocities"] += _arrow(np.array([at, tip]), GREEN, unit, size=0.8)
                arrows.append((speed, at, tip))
        if velocity.angular and isinstance(member, Body):
            line = _arc(np.array(member.center), 1.5 * unit, velocity.angular)
            drawing.strokes["velocities"] += _arrow(line, GREEN, 0.8 * unit)
    spin = f"{number(velocity.angular)} rad/s" if velocity.angular else ""
    if arrows:
        speed, at, tip = max(arrows, key=lambda entry: entry[0])
        text = with_unit(speed, "m/s") + (f" ({spin})" if spin else "")
        drawing.write(text, GREEN, MOTIONS, _beside(tip, at))
    elif velocity.beams:
        at = subject.velocity_points(velocity.beams[0])[0]
        spots = _around(at, 1.8 * unit if spin else 0.0)
        drawing.write(spin or "0 m/s", GREEN, MOTIONS, spots)
