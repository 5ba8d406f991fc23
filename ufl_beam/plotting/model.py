# SPDX-License-Identifier: MIT
"""Picture of a model before a run.

:data:`OBJECTS` has a function for each class of objects.  Symbols of bodies, joints, connectors and
supports are in `symbols.py`.
"""

from __future__ import annotations

import math
from collections import Counter, defaultdict
from collections.abc import Callable, Sequence
from functools import partial
from itertools import chain
from typing import Any

import numpy as np

from ufl_beam.arrays import Array
from ufl_beam.display import counted, html_page
from ufl_beam.model.bodies import AttachmentPoint, Body, Member, Place, PointMass, Velocity
from ufl_beam.model.connectors import Connector, law_of, place_of
from ufl_beam.model.constraint_checks import require_independent
from ufl_beam.model.functions import TimeFunction, steady
from ufl_beam.model.imposed_strains import ImposedStrain
from ufl_beam.model.loads import (
    FollowerLoad,
    Gravity,
    LineLoad,
    Load,
    LoadAlongBeam,
    LoadAtPlace,
    MovingLoad,
    Pressure,
    Rayleigh,
    RotatingFrame,
)
from ufl_beam.model.scene import Scene
from ufl_beam.model.supports import Support
from ufl_beam.model.works import Effect
from ufl_beam.plotting import notebook, positions, style, symbols
from ufl_beam.plotting.labels import Label, Spot, around, arrange, fitted_canvas, scene_axes
from ufl_beam.plotting.positions import PICTURE, directions, normal, points_along, unit_vectors
from ufl_beam.plotting.style import (
    BLUE,
    GREEN,
    INK,
    RED,
    TEXT,
    WHITE,
    Axes,
    Figure,
    font_size,
    number,
    shade,
    with_unit,
)
from ufl_beam.plotting.symbols import FRONT, Stroke, disc, draw_strokes

KINDS = (
    "forces", "moments", "line loads", "imposed strains", "motions", "velocities", "masses",
    "connectors", "hinges", "names",
)  # fmt: skip
"""Kinds of labels, of which the first have the best places."""

MOST_LABELS = 80  # largest number of labels
MOST_CELLS = 300  # number of cells beyond which neither cells nor possible hinges are marked
FEW = 4  # number of equal labels or hinges beyond which they have a note instead

HINGE = "#B0508A"  # colour of hinges
HINGES = HINGE, "#4B2E83", "#1B7F79", "#777777"  # colours of groups of equal hinges; last: others
MOVED = "#A86E00"  # colour of prescribed motions: the orange of drives, dark enough for text
HEAD, SHAFT = 0.85, 1.9  # length of the head of an arrow in units of symbols; line width in points
LINE = 1.45  # distance of notes above the axes, relative to their font size
LABEL_SIZE, ARROW_SIZE = 11.0, 20.0  # font sizes; points


def draw_model(scene: Scene, *, ax: Axes | None = None) -> Figure:
    """Draw the undeformed model, before any run.

    It shows beams, their cells and names, bodies, joints, supports, connectors with parameters,
    hinges, loads (red), masses, prescribed motions (orange) and initial velocities (green).  Loads
    that turn with their place have hollow arrow heads.  In space, moments and angular velocities
    are arrows with two heads along their vectors.  Drives that prescribe a motion are filled with
    orange; drives that prescribe a force are hollow.  Notes above the axes replace many equal
    labels.  Labels for which there is no space are omitted.
    """
    require_independent(scene)
    with scene_axes(ax, scene, "") as axes:
        drawing = Drawing(fitted_canvas(scene, ax=ax, filled=0.7))  # with space for loads
        labels, repeated = drawing.grouped()
        cells = sum(len(axis) - 1 for axis in drawing.axes.values()), "cell", "cells"
        beams, bodies = (len(scene.beams), "beam", "beams"), (len(scene.bodies), "body", "bodies")
        axes.set_title(f"model: {counted(beams, cells, bodies)}", loc="left", wrap=True)
        notes = [(words, color, "", 0.0) for words, color in hinge_groups(scene)[0].items()]
        notes += [(words, color, "", 0.0) for words, color in repeated.items()]
        notes += [(words, TEXT, "", 0.0) for words in model_notes(scene)]
        captions = map(scene_load_caption, scene.loads)
        notes += [(text, RED, arrow, angle) for text, arrow, angle in captions if text]
        size = font_size(LABEL_SIZE)
        axes.set_title(axes.get_title("left"), loc="left", pad=8.0 + LINE * size * len(notes))
        for k, (words, color, arrow, angle) in enumerate(reversed(notes)):
            note = axes.annotate(
                words, (0.0, 1.0), (0.0, 6.0 + LINE * size * k), xycoords="axes fraction",
                textcoords="offset points", fontsize=size, color=shade(color), gid="notes",
            )  # fmt: skip
            axes.annotate(
                arrow, (1.0, 0.5), (15.0, 0.0), xycoords=note, textcoords="offset points",
                fontsize=font_size(ARROW_SIZE), color=shade(color), rotation=angle, ha="center",
                va="center",
            )  # fmt: skip
        draw_strokes(axes, drawing.strokes)
        arrange(axes, ax, labels, 0.7 * drawing.scale)
    return style.parent_figure(axes)


@html_page.register
def scene_page(scene: Scene) -> str:
    """Write a scene as HTML: its summary, and its picture."""
    return notebook.lines(str(scene)) + notebook.image("model", partial(draw_model, scene))


def model_notes(scene: Scene) -> list[str]:
    """Return lines of text on damping, users' virtual works, and hinges that may form in cells."""
    notes = []
    for damping in scene.damping:
        if isinstance(damping, Rayleigh):
            kind = "tangent stiffness" if damping.tangent else "stiffness"
            coefficients = (("mass", damping.mass, "1/s"), (kind, damping.stiffness, "s"))
            sizes = ", ".join(f"{name} {x:.3g} {unit}" for name, x, unit in coefficients if x)
            notes.append(f"Rayleigh damping, {sizes}")
        else:
            beams = damping.beams or ()
            where = " of " + ", ".join(b.name for b in beams[:4]) if beams else ""
            more = " ..." if len(beams) > 4 else ""
            notes.append(
                f"Kelvin–Voigt damping, {with_unit(damping.retardation_time, 's')}{where}{more}"
            )
    for work in scene.works:
        where = "" if work.beams is None else " on " + ", ".join(b.name for b in work.beams[:4])
        where += " at " * bool(work.places) + ", ".join(map(str, work.places[:4]))
        said = "statement" if isinstance(work, Effect) else "function"
        notes.append(f"{work.name}: acts as its {said} says{where}")
    laws = {b.section.hinge for b in scene.beams if b.section.hinge and b.section.hinge.opens}
    if laws:
        limits = sorted({with_unit(law.limit, "N m") for law in laws})
        notes.append(f"dots: hinges may form, from {', '.join(limits[:4])}")
    return notes


def scene_load_caption(load: Load) -> tuple[str, str, float]:
    """Return text, arrow and its angle (degrees) of a load on the whole scene; else empty texts."""
    if isinstance(load, Gravity):
        x, y = PICTURE[len(load.acceleration)] @ load.acceleration
        size, angle = math.hypot(*load.acceleration), math.degrees(math.atan2(y, x))
        return in_time(f"g = {size:.4g} m/s²", load.amplitude), "→" if size else "", angle
    if isinstance(load, RotatingFrame):
        rate, about = (", ".join(f"{x:.4g}" for x in np.ravel(y)) for y in (load.rate, load.about))
        if np.size(load.rate) == 3:
            return f"frame: ({rate}) rad/s about ({about})".replace("-", "−"), "", 0.0
        text = f"frame: {rate} rad/s about ({about})".replace("-", "−")
        return text, "↺" if load.rate >= 0 else "↻", 0.0
    return "", "", 0.0


# -- strokes and labels ------------------------------------------------------------------------


def _kilograms(mass: float) -> str:
    """Write a mass with at least four digits, without an exponent up to a million kilograms."""
    digits = max(3 - math.floor(math.log10(mass)), 0) if mass > 0 else 0
    return f"{round(mass, digits):.10g} kg" if 1e-4 < mass < 1e6 else f"{mass:.4g} kg"


class Drawing:
    """Strokes of a scene by groups, and its labels; lengths in m."""

    def __init__(self, canvas: positions.Canvas) -> None:
        self.scene, self.shape, attached = canvas.scene, canvas.undeformed, canvas.scene.attached
        self.unit, self.outside, self.scale = canvas.unit, canvas.outside, canvas.scale
        scene = self.scene
        self.strokes: defaultdict[str, list[Stroke]] = defaultdict(list)
        self.labels: defaultdict[tuple[str, str, str], list[Sequence[Spot]]] = defaultdict(list)
        """Candidate positions of labels by kind, text and colour."""
        self._stacks: defaultdict[object, float] = defaultdict(float)  # heights; m
        self.axes: dict[Member, Array] = {  # vertices; (n, 2 or 3)
            beam: np.array([beam.curve(s) for s in beam.vertices(attached[beam])], float)
            for beam in scene.beams
        }
        ends = [(x[0], x[1], x[-1], x[-2]) for x in self.axes.values()]
        self._ends: Array = np.reshape(ends, (-1, 2, 3 if scene.in_space else 2))
        forces = [x.force for x in scene.loads if isinstance(x, LoadAtPlace | MovingLoad)]
        along = [x for x in scene.loads if isinstance(x, LoadAlongBeam)]
        lines = [np.abs(self.line(x)[1]).max() * _components(x) for x in along]
        self.force, self.line_load = (  # largest magnitudes; N, N/m
            max((math.hypot(*x) for x in vectors), default=0.0) or 1.0
            for vectors in (forces, lines)
        )
        _draw_beams(self)
        for group, strokes in symbols.all_symbols(self.shape).items():
            self.strokes[group] += strokes
        _draw_hinges(self)
        parts = scene.loads, scene.supports, scene.initial, scene.masses, scene.connectors
        for kind, draw in OBJECTS.items():
            for part in chain(*parts):
                if isinstance(part, kind):
                    draw(self, part)
        if len(scene.bodies) <= symbols.MOST_BODIES:
            _name_bodies(self)

    def write(self, text: str, color: str, kind: str, spots: Sequence[Spot]) -> None:
        """Add a label with its candidate positions."""
        self.labels[kind, text, color].append(spots)

    def grouped(self) -> tuple[list[Label], dict[str, str]]:
        """Return labels by priority, and colours of notes that replace many equal labels."""
        labels, notes = list[Label](), dict[str, str]()
        for kind, text, color in sorted(self.labels, key=lambda key: KINDS.index(key[0])):
            equal = self.labels[kind, text, color]
            if len(equal) > FEW:
                notes[f"{len(equal)} {kind}: {text}"] = color
            else:
                labels += (Label(text, color, spots) for spots in equal)
        return labels[:MOST_LABELS], notes

    def stack(self, key: object, height: float) -> float:
        """Stack a symbol onto the others at a place; return the height at which it begins; m."""
        self._stacks[key] += height
        return self._stacks[key] - height

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
        """Return the directions in which beams leave a place; (n, 2 or 3)."""
        close = np.abs(self._ends[:, 0] - place.point).max(axis=1) < 1e-7 * self.scene.size
        pairs = [*self._ends[close]]
        if isinstance(place, Place) and 0.0 < place.s < 1.0:
            axis = self.axes[place.beam]
            k = int(np.argmin(np.linalg.norm(axis - place.point, axis=1)))
            pairs += [axis[[k, j]] for j in (k - 1, k + 1) if 0 <= j < len(axis)]
        start, end = np.reshape(pairs, (-1, 2, len(place.point))).swapaxes(0, 1)
        return unit_vectors(end - start)

    def velocity_points(self, member: Member | Body) -> Array:
        """Return points for velocities: ends and middle of a beam, or centre of a body."""
        if isinstance(member, Body):
            return np.array([member.center])
        return points_along(self.axes[member], [0.0, 0.5, 1.0])


def _normals(axis: Array) -> list[tuple[Array, Array]]:
    """Return points along a line and unit vectors to its left, from the middle outwards."""
    fractions = np.array([0.5, 0.4, 0.6, 0.3, 0.7, 0.2, 0.8, 0.1, 0.9])
    steps = points_along(axis, fractions + 0.01) - points_along(axis, fractions - 0.01)
    return list(zip(points_along(axis, fractions), normal(unit_vectors(steps)), strict=True))


def _along(axis: Array, gap: float) -> list[Spot]:
    """List candidate positions of a label on both sides of a beam."""
    return [(at + s * gap * left, s * left) for at, left in _normals(axis) for s in (1.0, -1.0)]


def _names(objects: Sequence[Member | Body]) -> list[str]:
    """Return names of objects; equal names are followed by a number."""
    known = Counter(x.name for x in objects)
    return [f"{x.name} {k}" if known[x.name] > 1 else x.name for k, x in enumerate(objects)]


def _draw_beams(drawing: Drawing) -> None:
    """Draw axes and names of beams; mark cells and their hinges unless there are many."""
    scale, unit, axes = drawing.scale, drawing.unit, drawing.axes
    weight = 2.8 * unit / scale / positions.SYMBOL
    drawing.strokes["beams"] += (Stroke(x, INK, weight, layer=4.0) for x in axes.values())
    cells = sum(len(axis) - 1 for axis in axes.values())
    names = _names(drawing.scene.beams)
    for name, (beam, axis) in zip(names, axes.items(), strict=True):
        if cells <= MOST_CELLS:
            steps = np.diff(axis, axis=0)
            if len(steps) > 1 and np.linalg.norm(steps, axis=1).min() > 7.0 * scale:
                left = 3.2 * scale * normal(unit_vectors(steps[1:] + steps[:-1]))
                marks = np.stack([axis[1:-1] - left, axis[1:-1] + left], axis=1)
                drawing.strokes["cells"] += (Stroke(ends, INK, 1.0, layer=4.0) for ends in marks)
            if beam.section.hinge is not None and beam.section.hinge.opens:
                drawing.strokes["hinges"] += (
                    disc(x, 0.14 * unit, HINGE, HINGE, 4.1) for x in (axis[1:] + axis[:-1]) / 2
                )
        if len(axes) <= MOST_LABELS:
            drawing.write(name, TEXT, "names", _along(axis, 2.5 * scale))


def _draw_hinges(drawing: Drawing) -> None:
    """Draw plastic hinges of zero length, and write their limits unless they have a note."""
    colors = hinge_groups(drawing.scene)[1]
    for hinge in drawing.scene.hinges:
        place, r = place_of(hinge), 0.25 * drawing.unit
        axis, at = drawing.axes[place.beam], np.array(place.point)
        if place.s in (0.0, 1.0):  # beside the symbol at the end of the beam
            end, inner = axis[:2] if place.s == 0.0 else axis[:-3:-1]
            at = at + 0.7 * drawing.unit * unit_vectors(inner - end)
        color = colors.get(hinge, HINGE)
        drawing.strokes["hinges"] += [disc(at, r, color, color, 5.2)]
        if place.s in place.beam.hinges and hinge not in colors:
            words = f"hinge {with_unit(float(law_of(hinge).limit), 'N m')}"
            drawing.write(words, HINGE, "hinges", around(at, radius=r))


def hinge_groups(scene: Scene) -> tuple[dict[str, str], dict[Connector, str]]:
    """Return colours of notes on many equal hinges, and of these hinges."""
    alike: defaultdict[float, list[Connector]] = defaultdict(list)
    for hinge in scene.hinges:
        if place_of(hinge).s in place_of(hinge).beam.hinges:
            alike[float(law_of(hinge).limit)].append(hinge)
    groups = [([limit], same) for limit, same in alike.items() if len(same) > FEW]
    if len(others := groups[len(HINGES) - 1 :]) > 1:
        limits = sorted(limit for some, _ in others for limit in some)
        groups[len(HINGES) - 1 :] = [(limits, [hinge for _, same in others for hinge in same])]
    notes, colors = dict[str, str](), dict[Connector, str]()
    for (limits, same), color in zip(groups, HINGES, strict=False):
        words = " to ".join(dict.fromkeys(with_unit(x, "N m") for x in (limits[0], limits[-1])))
        notes[f"dots: {len(same)} hinges, {words}"] = color
        colors |= dict.fromkeys(same, color)
    return notes, colors


def _name_bodies(drawing: Drawing) -> None:
    """Write names and masses of bodies."""
    bodies = drawing.scene.bodies
    for body, name in zip(bodies, _names(bodies), strict=True):
        outline = drawing.shape.canvas.outlines[body]
        spots = [
            (at + float(((outline - at) @ way).max()) * way, way) for at, way in around(body.center)
        ]
        words = f"{name}, {_kilograms(body.mass)}" if body.mass else name
        drawing.write(words, TEXT, "names", spots)


def _write_connector(drawing: Drawing, connector: Connector) -> None:
    """Write the name and the parameters of a connector."""
    offsets, unit = drawing.shape.canvas.offsets, drawing.unit
    offset, (a, b, across) = offsets[connector], symbols.connector_frame(drawing.shape, connector)
    if connector.is_rotation:
        spots = around(b, radius=(1.6 + offset + 0.8) * unit)
    else:
        side, lane = math.copysign(1.0 / unit, offset) * across, a + offset * across
        ends = {connector.a, connector.b}
        same = [offsets[c] for c in drawing.scene.connectors if {c.a, c.b} == ends]
        if offset in (min(same), max(same)):
            spots = [
                (lane + fraction * (b - a) + 0.8 * unit * way, way)
                for fraction in (0.5, 0.3, 0.7)
                for way in (side, -side)
            ]
        else:  # on the line, between the lines of others
            spots = [(lane + fraction * (b - a), 0.0 * side) for fraction in (0.25, 0.75)]
    units = ("N m", "rad") if connector.is_rotation else ("N", "m")
    words = symbols.law_symbol(connector.law).words(connector.law, *units)
    drawing.write(f"{connector.name}, " * bool(connector.name) + words, TEXT, "connectors", spots)


def _write_mass(drawing: Drawing, mass: PointMass) -> None:
    """Write a point mass."""
    spots = around(mass.place.point, radius=0.45 * drawing.unit)
    drawing.write(_kilograms(mass.mass), INK, "masses", spots)


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


def _arc(center: Any, radius: float, sense: float) -> Array:
    """Return the arc of an arrow around a point, counter-clockwise if ``sense`` > 0; (n, 2)."""
    angles = math.copysign(1.0, sense) * np.linspace(-150.0, 120.0, 40)
    return np.asarray(center + radius * directions(np.radians(90.0 + angles)))


def _turning(
    at: Any, vector: Any, radius: float, color: str, unit: float, *, hollow: bool = False
) -> tuple[list[Stroke], list[Spot]]:
    """Draw the arrow of a moment or spin, with positions of its label.

    In the plane it is an arc, in space an arrow with two heads along the vector.
    """
    if np.size(vector) == 1:
        strokes = _arrow(_arc(at, radius, vector), color, unit, hollow=hollow)
        return strokes, around(at, radius=radius)
    ahead = 2.0 * radius * unit_vectors(np.array(vector, dtype=np.float64))
    lines = (at + np.outer((0.0, length), ahead) for length in (1.0, 0.8))
    strokes = [x for line in lines for x in _arrow(line, color, unit, hollow=hollow)]
    return strokes, around(at + ahead, ahead)


def in_time(text: str, time: TimeFunction) -> str:
    """Mark the text of a quantity that varies in time."""
    return text if time == steady else f"{text} × f(t)"


# -- loads -------------------------------------------------------------------------------------


def _draw_point_load(drawing: Drawing, load: LoadAtPlace) -> None:
    """Draw arrows of force and moment; follower loads have hollow heads."""
    hollow = isinstance(load, FollowerLoad)
    more = ", follows" if hollow else ""
    if any(load.force) or not np.any(load.moment):
        _draw_force(drawing, load.place, load, more, hollow=hollow)
    if np.any(load.moment):
        at, unit = load.place.point, drawing.outside
        radius = 1.7 * unit + drawing.stack((at, "moment"), 0.8 * unit)
        strokes, spots = _turning(at, load.moment, radius, RED, unit, hollow=hollow)
        drawing.strokes["loads"] += strokes
        size = float(np.linalg.norm(load.moment))
        text = in_time(with_unit(size, "N m"), load.amplitude) + more
        drawing.write(text, RED, "moments", spots)


def _draw_moving_load(drawing: Drawing, load: MovingLoad) -> None:
    """Draw the force at its place at t = 0, or at the nearer end of its route."""
    lengths = [positions.lengths_along(drawing.axes[beam])[-1] for beam in load.route]
    ends = np.cumsum(lengths)
    distance = min(max(float(load.position(0.0)), 0.0), ends[-1])
    k = int(np.searchsorted(ends, distance))
    place = load.route[k].at(float(1.0 - (ends[k] - distance) / lengths[k]))
    _draw_force(drawing, place, load, ", moves" * any(load.force))


def _draw_force(
    drawing: Drawing,
    place: AttachmentPoint,
    load: LoadAtPlace | MovingLoad,
    more: str,
    *,
    hollow: bool = False,
) -> None:
    """Draw the arrow of a force.

    By default the arrow ends at the loaded place.  If it would then lie on a beam, it begins at the
    place.  If beams are on both sides, it is drawn beside the beam.
    """
    at, unit, size = np.array(place.point), drawing.outside, math.hypot(*load.force)
    spots = around(at)
    if size > 0.0:
        direction = np.array(load.force) / size
        length = (2.6 + 1.4 * size / drawing.force) * unit
        if isinstance(place, Place):  # long enough to be seen beside a line load
            length += drawing.stack((place.beam, *np.round(direction, 6)), 0.0)
        # Cosines of the angles between the force and the beams
        along = drawing.directions_at(place) @ direction
        behind, ahead = along.min(initial=0.0) < -0.9, along.max(initial=0.0) > 0.9
        pulls, apart = behind and not ahead, 0.3 * unit
        start = apart + drawing.stack((place.point, *np.round(direction, 6), pulls), length + apart)
        if behind and ahead:  # along a continuous beam: beside it
            at = at + 0.8 * unit * normal(direction)
        ends = np.outer((start, start + length), direction)
        line = at + ends if pulls else at - ends[::-1]
        drawing.strokes["loads"] += _arrow(line, RED, unit, hollow=hollow)
        spots = around(line[0], -direction)
    text = in_time(with_unit(size, "N"), load.amplitude) if size else "0 N"
    drawing.write(text + more, RED, "forces", spots)


def _components(load: LoadAlongBeam) -> Array:
    """Return the force per length along x and y, or along the axis and its normal; (2,); N/m.

    In space, it is along x, y and z, or along the axes 1, 2 and 3 of the section; (3,).
    """
    if isinstance(load, Pressure):
        across = len(load.beam.start.point) - 1  # number of normals
        return np.array([load.tangential, *np.broadcast_to(load.normal, across)])
    assert isinstance(load, LineLoad)
    return np.array(load.force)


def _draw_line_load(drawing: Drawing, load: LoadAlongBeam) -> None:
    """Draw a line load: its moments, and arrows across the beam or parallel to it.

    Arrows of a pressure have hollow heads.
    """
    (axis, factors), unit = drawing.line(load), drawing.outside
    largest = factors[np.abs(factors).argmax()]  # the sizes in labels are the largest ones
    force, follows = _components(load) * largest, isinstance(load, Pressure)
    size, moment = math.hypot(*force), load.moment * largest if isinstance(load, LineLoad) else 0.0
    shares = factors / largest if largest else factors
    lengths = positions.lengths_along(axis)
    tangents = unit_vectors(np.gradient(axis, lengths, axis=0))
    ways: Array = np.tile(force / (size or 1.0), (len(axis), 1))  # direction at each point
    if follows:
        frame = [tangents, normal(tangents)]
        if axis.shape[1] == 3:
            beam: Any = load.beam
            third = unit_vectors(np.cross(tangents, beam.up))
            frame = [tangents, np.asarray(np.cross(third, tangents)), third]
        ways = np.einsum("nk,kni->ni", ways, frame)

    def spaced(distance: float, least: float, *, ends: bool = False) -> list[Any]:
        """List points about ``distance`` (m) apart with shares above ``least``, and directions."""
        number = max(1, round(lengths[-1] / distance))
        steps = (np.arange(number + 1) if ends else np.arange(number) + 0.5) / number
        intensity, *heading = (
            np.interp(steps * lengths[-1], lengths, x) for x in (shares, *ways.T)
        )
        rows = zip(points_along(axis, steps), intensity, np.column_stack(heading), strict=True)
        return [row for row in rows if abs(row[1]) > least]

    def nearest(line: Array, at: Array) -> Array:
        """Return the direction at the point of a line that is the nearest to ``at``."""
        return np.asarray(ways[np.linalg.norm(line - at, axis=1).argmin()])

    def draw(ends: Array, share: float) -> None:
        ends = ends if share > 0 else ends[::-1]
        drawing.strokes["loads"] += _arrow(ends, RED, unit, hollow=follows, size=0.62)

    if size > 0.0:
        along = np.sum(ways * tangents, axis=1, keepdims=True) * tangents
        if np.linalg.norm(ways - along, axis=1).mean() > 0.25:
            height = (1.3 + 1.1 * size / drawing.line_load) * unit
            key = load.beam, *np.round(force / size, 6)
            low = drawing.stack(key, height + 0.35 * unit) + 0.3 * unit
            line = axis - (low + height * np.abs(shares))[:, None] * ways
            drawing.strokes["loads"] += [Stroke(line, RED, 1.2, layer=FRONT)]
            for foot, share, heading in spaced(2.0 * unit, 0.5 * unit / height, ends=True):
                draw(foot - np.outer((low + height * abs(share), low), heading), share)
            spots = [
                (at, -side * math.copysign(1.0, left @ nearest(line, at)) * left)
                for at, left in _normals(line)
                for side in (1.0, -1.0)
            ]
        else:
            aside = 0.8 * unit + drawing.stack((load.beam, "along"), 0.7 * unit)
            for at, share, heading in spaced(2.4 * unit, 0.05):
                ends = np.outer((-0.9 * unit, 0.9 * unit), heading)
                draw(at + aside * normal(heading) + ends, share)
            sides = [(at, normal(nearest(axis, at))) for at, _ in _normals(axis)]
            spots = [(at + (aside + 0.3 * unit) * side, side) for at, side in sides]
        text = in_time(with_unit(size, "N/m"), load.amplitude) + ", follows" * follows
        drawing.write(text, RED, "line loads", spots)
    if moment:
        for at, share, _ in spaced(3.2 * unit, 0.05):
            drawing.strokes["loads"] += _arrow(
                _arc(at, 0.75 * unit, moment * share), RED, 0.7 * unit
            )
        text = in_time(with_unit(abs(moment), "N m/m"), load.amplitude)
        drawing.write(text, RED, "line loads", _along(axis, 0.9 * unit))
    if not size and not moment:
        drawing.write("0 N/m", RED, "line loads", _along(axis, 0.0))


def _draw_imposed_strain(drawing: Drawing, load: ImposedStrain) -> None:
    """Draw lines on both sides of a beam, red where it becomes longer, blue where shorter."""
    (axis, strains), unit = drawing.line(load), drawing.outside
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
    drawing.write(in_time(text or "ε = 0", load.amplitude), RED, "imposed strains", spots)


# -- motions -----------------------------------------------------------------------------------


def _draw_prescribed(drawing: Drawing, support: Support) -> None:
    """Draw motions that a support prescribes, as arrows with hollow heads."""
    at, unit = np.array(support.place.point), drawing.outside
    ways = drawing.directions_at(support.place)
    inward = ways[0] if len(ways) else PICTURE[len(at)][1]
    d = support.displacements
    for component, motion in support.moving.items():
        name, symbol = support.names[component].replace("psi", "ψ"), "m" if component < d else "rad"
        values = {float(motion(t)) for t in (0.0, 0.3, 1.0, 7.1)}
        text = f"{name} = {with_unit(values.pop(), symbol)}" if len(values) == 1 else f"{name}(t)"
        if component >= d:
            vector = 1.0 if d == 2 else support.axis
            strokes, spots = _turning(at, vector, 1.9 * unit, MOVED, unit, hollow=True)
        else:
            direction = support.axes[component, :d]
            # Beside the place, on the side from which no beam comes.
            left = normal(direction)
            side = left if left @ inward <= 1e-9 else -left
            line = at + 1.5 * unit * side + np.outer((0.0, 2.6 * unit), direction)
            spots = around(line.mean(axis=0), side)
            strokes = _arrow(line, MOVED, unit, hollow=True)
        drawing.strokes["motions"] += strokes
        drawing.write(text, MOVED, "motions", spots)


def _draw_velocity(drawing: Drawing, velocity: Velocity) -> None:
    """Draw an initial velocity with its label."""
    unit, bodies = drawing.outside, [x for x in velocity.beams if isinstance(x, Body)]
    points = [at for member in velocity.beams for at in drawing.velocity_points(member)]
    if not points:
        return
    vectors = [np.array(velocity.at(*at)[: len(at)]) for at in points]
    speeds, spin = np.linalg.norm(vectors, axis=1), float(np.linalg.norm(velocity.angular))
    largest = float(speeds.max(initial=0.0))
    spots = around(points[0], radius=1.8 * unit * bool(spin))
    for at, vector, speed in zip(points, vectors, speeds, strict=True):
        if speed > 0.05 * largest:
            way = vector / speed
            tip = at + (1.6 + 2.0 * speed / largest) * unit * way
            drawing.strokes["velocities"] += _arrow(np.array([at, tip]), GREEN, unit, size=0.8)
            spots = around(tip, way) if speed == largest else spots
    for body in bodies if spin else ():
        strokes, _ = _turning(body.center, velocity.angular, 1.5 * unit, GREEN, 0.8 * unit)
        drawing.strokes["velocities"] += strokes
    size = velocity.angular if np.size(velocity.angular) == 1 else spin
    turns = f"{number(size)} rad/s" if spin else ""
    text = with_unit(largest, "m/s") + f" ({turns})" * bool(spin) if largest else turns or "0 m/s"
    drawing.write(text, GREEN, "velocities", spots)


OBJECTS: dict[type, Callable[[Drawing, Any], None]] = {
    LoadAlongBeam: _draw_line_load,  # first, so that forces are stacked above line loads
    ImposedStrain: _draw_imposed_strain,
    LoadAtPlace: _draw_point_load,
    MovingLoad: _draw_moving_load,
    Support: _draw_prescribed,
    Velocity: _draw_velocity,
    PointMass: _write_mass,
    Connector: _write_connector,
}
"""Functions that draw objects and write their labels, by class."""
