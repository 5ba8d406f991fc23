# SPDX-License-Identifier: MIT
"""Strokes and labels of all objects of a model before any run."""

from __future__ import annotations

import math
from collections import Counter, defaultdict
from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass, field
from typing import NamedTuple

import numpy as np

from ufl_beam.arrays import Array
from ufl_beam.model.bodies import Anchor, Body, Member, Place
from ufl_beam.model.loads import FollowerLoad, LineLoad, PointLoad
from ufl_beam.model.plastic_hinges import law_of, place_of
from ufl_beam.model.scene import Scene
from ufl_beam.plotting import load_symbols, symbols
from ufl_beam.plotting.connector_glyphs import law_in_words
from ufl_beam.plotting.labels import Label, Spot
from ufl_beam.plotting.load_symbols import CAPTIONS, NAMES, Sizes, along_axis, around, left_of
from ufl_beam.plotting.scene_layout import Pose, Stage
from ufl_beam.plotting.style import GREY, INK, ORANGE, WHITE, Stroke, with_unit
from ufl_beam.plotting.symbols import Footing

HINGE, TEXT = "#B0508A", "#444444"  # colours of hinges, and of words that are no loads
MOST_LABELS, MOST_CELLS = 80, 300  # numbers beyond which names, and marks of cells, are left out

SYMBOL, SHORT_BEAM, SMALLEST = 12.0, 45.0, 0.3
"""Half the size of a symbol of a support where beams are not short; length of a beam below which it
shrinks, in proportion; points.  It shrinks at most to this part."""


@dataclass
class Drawing:
    """Strokes of a picture by groups, and its labels; lengths in m."""

    strokes: defaultdict[str, list[Stroke]] = field(default_factory=lambda: defaultdict(list))
    labels: list[Label] = field(default_factory=list)

    def add(self, group: str, strokes: Iterable[Stroke], labels: Iterable[Label] = ()) -> None:
        """Add the strokes and labels of an object to a group."""
        self.strokes[group] += strokes
        self.labels += labels

    def everything(self) -> Iterator[Stroke]:
        """Iterate over all strokes of the drawing."""
        for group in self.strokes.values():
            yield from group


class Subject(NamedTuple):
    """Scene, and the properties that drawings of any scale have in common."""

    scene: Scene
    axes: dict[Member, Array]  # vertices of each beam; (n, 2); m
    names: dict[Member | Body, str]
    ways: Callable[[Anchor], Array]  # directions in which beams leave a place; (n, 2)
    typical: float  # median of the lengths of beams; m
    largest: tuple[float, float, float]  # point force, line load and velocity; N, N/m, m/s

    @classmethod
    def of(cls, scene: Scene) -> Subject:
        """Make the subject of a scene."""
        attached = scene.attached
        axes: dict[Member, Array] = {
            beam: np.array([beam.curve(s) for s in beam.vertices(attached[beam])], dtype=float)
            for beam in scene.beams
        }
        lengths = [math.dist(axis[0], axis[-1]) for axis in axes.values()]
        typical = float(np.median(lengths)) if lengths else math.inf
        largest = _largest(scene, axes)
        return cls(scene, axes, _names_of(scene), _Ways(scene, axes), typical, largest)

    @property
    def cells(self) -> int:
        """Number of cells that are drawn."""
        return sum(len(axis) - 1 for axis in self.axes.values())


def draw(subject: Subject, scale: float) -> Drawing:
    """Draw all objects of a scene; the length of a point is ``scale`` (m)."""
    scene, typical = subject.scene, subject.typical / scale
    unit = SYMBOL * scale * min(max(typical / SHORT_BEAM, SMALLEST), 1.0)
    few = len(scene.supports) + len(scene.loads) <= MOST_LABELS / 2
    outside = max(unit, 0.7 * SYMBOL * scale) if few else unit
    pose = Stage(scene, 1.0, unit).undeformed
    sizes = Sizes(outside, 1 / scale, subject.axes, subject.ways, subject.largest, {})
    drawing = Drawing()
    _draw_beams(drawing, subject, unit, scale)
    _draw_hinges(drawing, subject, unit, scale)
    _draw_bodies(drawing, pose, subject.names, scale)
    _draw_joints(drawing, pose, min(unit / 3, 0.1 * typical * scale))
    _draw_connectors(drawing, pose, scale)
    for footing in symbols.footings(pose):
        drawing.add("supports", _support(footing, outside))
    for support in scene.supports:
        if support.moving:
            ways = sizes.ways(support.place)
            inward = ways[0] if len(ways) else np.array([0.0, 1.0])
            drawing.add("motions", *load_symbols.prescribed_symbol(support, inward, sizes))
    for mass in scene.masses:
        at, r = np.array(mass.place.point), 0.45 * unit
        label = Label(f"{mass.mass:.4g} kg", INK, CAPTIONS, around(at, r / scale))
        drawing.add("masses", [_disc(at, r, INK, INK)], [label])
    # Line loads come first, so that forces stand out from them.
    for load in sorted(scene.loads, key=lambda load: not isinstance(load, LineLoad)):
        drawing.add("loads", *load_symbols.load_symbol(load, sizes))
    for velocity in scene.initial:
        drawing.add("velocities", *load_symbols.velocity_symbol(velocity, sizes))
    return drawing


def _disc(at: Array, radius: float, color: str, fill: str, layer: float = 5.0) -> Stroke:
    return Stroke(at + radius * _CIRCLE, color, 1.4, fill, layer)


_CIRCLE = np.column_stack([f(np.linspace(0.0, 2 * math.pi, 25)) for f in (np.cos, np.sin)])


def _support(footing: Footing, unit: float) -> Iterator[Stroke]:
    """The symbol of a support; of one that does not move on hatched ground."""
    cos, sin = math.cos(footing.angle), math.sin(footing.angle)
    turn = unit * np.array([(cos, sin), (-sin, cos)])
    for outline in footing.outlines:
        points = footing.at + np.array(outline) @ turn
        yield Stroke(points, footing.color, 0.5, footing.color, 3.5)
    low = min(y for outline in footing.outlines for _, y in outline)
    if footing.color != ORANGE:
        for x in np.linspace(-0.7, 1.0, 6):
            hatch = np.array([(x, low), (x - 0.35, low - 0.4)])
            yield Stroke(footing.at + hatch @ turn, footing.color, 1.0, layer=3.5)


def _draw_beams(drawing: Drawing, subject: Subject, unit: float, scale: float) -> None:
    """Axes, marks between cells and where hinges may form if these are few, names."""
    weight = 2.8 * unit / scale / SYMBOL
    drawing.add("beams", (Stroke(x, INK, weight, layer=4.0) for x in subject.axes.values()))
    if subject.cells <= MOST_CELLS:
        for beam, axis in subject.axes.items():
            drawing.add("cells", _between_cells(axis, scale))
            law = beam.section.hinge
            if law is not None and law.opens:
                middles = (axis[1:] + axis[:-1]) / 2
                r = 0.14 * unit
                drawing.add("hinges", (_disc(at, r, HINGE, HINGE, 4.1) for at in middles))
    if len(subject.axes) <= MOST_LABELS:
        drawing.labels += [
            Label(subject.names[beam], TEXT, NAMES, along_axis(axis, 2.5))
            for beam, axis in subject.axes.items()
        ]


def _draw_hinges(drawing: Drawing, subject: Subject, unit: float, scale: float) -> None:
    """Plastic hinges, beside what is at the end of the beam; sizes of chosen ones."""
    r = 0.25 * unit
    for hinge in subject.scene.hinges:
        place = place_of(hinge)
        axis, s = subject.axes[place.beam], place.s
        at = np.array(place.point)
        if s in (0.0, 1.0):
            at = at + 0.7 * unit * _direction(*(axis[:2] if s == 0.0 else axis[:-3:-1]))
        words = f"hinge {with_unit(float(law_of(hinge).limit), 'N m')}"
        label = Label(words, HINGE, CAPTIONS, around(at, r / scale))
        chosen = [label] if s in place.beam.hinges else []
        drawing.add("hinges", [_disc(at, r, HINGE, HINGE, 5.2)], chosen)


def _between_cells(axis: Array, scale: float) -> Iterator[Stroke]:
    """Marks across a beam between its cells, where these are long enough."""
    steps = np.diff(axis, axis=0)
    if np.linalg.norm(steps, axis=1).min() > 7.0 * scale:
        left = (steps[1:] + steps[:-1])[:, ::-1] * (-1.0, 1.0)
        left *= 3.2 * scale / np.linalg.norm(left, axis=1)[:, None]
        for ends in np.stack([axis[1:-1] - left, axis[1:-1] + left], axis=1):
            yield Stroke(ends, INK, 1.0, layer=4.0)


def _draw_bodies(
    drawing: Drawing, pose: Pose, names: dict[Member | Body, str], scale: float
) -> None:
    """Outlines, centres, names; many bodies as dots."""
    stage, bodies = pose.stage, pose.stage.scene.bodies
    if len(bodies) > MOST_CELLS:
        r = 0.4 * stage.unit
        drawing.add("bodies", (_disc(np.array(b.center), r, INK, GREY) for b in bodies))
        return
    drawing.add("bodies", [*symbols.bodies(pose), *symbols.centres(pose)])
    for body, outline in stage.outlines.items():
        arms, text = (outline - body.center) / scale, names[body]
        spots = tuple(
            Spot(spot.at, spot.way, float((arms @ spot.way).max()))
            for spot in around(np.array(body.center), 0.0)
        )
        words = f"{text}, {body.mass:.4g} kg" if body.mass else text
        drawing.labels.append(Label(words, TEXT, NAMES, spots))


def _draw_joints(drawing: Drawing, pose: Pose, radius: float) -> None:
    drawing.add("joints", [*symbols.rods(pose), *symbols.rails(pose)])
    square = 0.8 * radius * np.array([(-1, -1), (1, -1), (1, 1), (-1, 1), (-1, -1)])
    for pin in symbols.pins(pose):
        disc = _disc(pin.at, radius, INK, WHITE)
        drawing.add("joints", [disc if pin.turns else Stroke(pin.at + square, INK, 1.0, INK, 5.0)])


def _draw_connectors(drawing: Drawing, pose: Pose, scale: float) -> None:
    drawing.add("connectors", symbols.connectors(pose))
    unit = pose.stage.unit
    for connector in pose.stage.scene.connectors:
        offset = pose.stage.offsets[connector]
        b = np.array(connector.b.point)
        if connector.turns:
            spots = around(b, (1.6 + offset + 0.8) * unit / scale)
        else:
            a = np.array(connector.a.point)
            apart = math.dist(a, b) > 0.1 * unit
            across = left_of(_direction(a, b) if apart else np.array(connector.axis))
            spots = tuple(
                Spot(a + part * (b - a) + offset * unit * across, sign * across, 0.8 * unit / scale)
                for part in (0.5, 0.3, 0.7)
                for sign in ((1.0, -1.0) if offset >= 0.0 else (-1.0, 1.0))
            )
        text = law_in_words(connector.law, connector.turns)
        drawing.labels.append(Label(text, TEXT, CAPTIONS, spots))


class _Ways:
    """Directions in which beams leave a place, of all beams that meet there."""

    def __init__(self, scene: Scene, axes_of: dict[Member, Array]) -> None:
        self._near, self._axes = 1e-7 * scene.size, axes_of
        ends: Array = np.reshape([(x[0], x[1], x[-1], x[-2]) for x in axes_of.values()], (-1, 2, 2))
        ways = ends[:, 1] - ends[:, 0]
        self._ends, self._ways = ends[:, 0], ways / np.linalg.norm(ways, axis=1)[:, None]

    def __call__(self, anchor: Anchor) -> Array:
        """Unit vectors; (n, 2)."""
        found = self._ways[np.abs(self._ends - anchor.point).max(axis=1) < self._near]
        if isinstance(anchor, Place) and 0.0 < anchor.s < 1.0:
            axis = self._axes[anchor.beam]
            k = int(np.argmin(np.linalg.norm(axis - anchor.point, axis=1)))
            more = [_direction(axis[k], axis[j]) for j in (k - 1, k + 1) if 0 <= j < len(axis)]
            found = np.vstack([found, *more])
        return np.asarray(found)


def _names_of(scene: Scene) -> dict[Member | Body, str]:
    """Return names of beams and bodies; equal ones with their number in the scene."""
    groups: tuple[Sequence[Member | Body], ...] = (scene.beams, scene.bodies)
    known = [Counter(part.name for part in parts) for parts in groups]
    return {
        part: f"{part.name} {k}" if known[g][part.name] > 1 else part.name
        for g, parts in enumerate(groups)
        for k, part in enumerate(parts)
    }


def _direction(start: Array, end: Array) -> Array:
    return np.asarray((end - start) / np.linalg.norm(end - start))


def _largest(scene: Scene, axes_of: dict[Member, Array]) -> tuple[float, float, float]:
    """Largest point force, line load and initial velocity; N, N/m, m/s."""
    forces = [math.hypot(*x.force) for x in scene.loads if isinstance(x, PointLoad | FollowerLoad)]
    lines = [math.hypot(*x.force) for x in scene.loads if isinstance(x, LineLoad)]
    speeds = [
        math.hypot(*velocity.at(*at)[:2])
        for velocity in scene.initial
        for one in velocity.beams
        for at in ([one.center] if isinstance(one, Body) else axes_of[one])
    ]
    force, line, speed = (max(values, default=0.0) or 1.0 for values in (forces, lines, speeds))
    return force, line, speed
