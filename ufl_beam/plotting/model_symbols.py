# SPDX-License-Identifier: MIT
"""Strokes and labels of all objects of a model before any run."""

from __future__ import annotations

import math
from collections.abc import Iterator

import numpy as np

from ufl_beam.arrays import Array
from ufl_beam.model.loads import LineLoad
from ufl_beam.model.plastic_hinges import law_of, place_of
from ufl_beam.plotting import symbols
from ufl_beam.plotting.connector_glyphs import law_in_words
from ufl_beam.plotting.geometry import directions, in_frame, left_of, unit_vectors
from ufl_beam.plotting.labels import Spot
from ufl_beam.plotting.load_symbols import draw_load, draw_prescribed, draw_velocity
from ufl_beam.plotting.model_sheet import CAPTIONS, MOST_LABELS, NAMES, SYMBOL, Sheet, Subject
from ufl_beam.plotting.scene_layout import Pose, Stage
from ufl_beam.plotting.style import GREY, INK, ORANGE, TEXT, WHITE, Stroke, with_unit
from ufl_beam.plotting.symbols import Footing

HINGE = "#B0508A"  # colour of hinges
MOST_CELLS = 300  # number of cells, and of bodies, beyond which they are drawn without details


def draw(subject: Subject, scale: float) -> Sheet:
    """Draw all objects of a scene; the length of a point is ``scale`` (m)."""
    scene, sheet = subject.scene, Sheet(subject, scale)
    pose = Stage(scene, 1.0, sheet.unit).undeformed
    _draw_beams(sheet)
    _draw_hinges(sheet)
    _draw_bodies(sheet, pose)
    _draw_joints(sheet, pose)
    _draw_connectors(sheet, pose)
    for footing in symbols.footings(pose):
        sheet.add("supports", _support(footing, sheet.outside))
    for support in scene.supports:
        draw_prescribed(sheet, support)
    for mass in scene.masses:
        at, r = np.array(mass.place.point), 0.45 * sheet.unit
        sheet.add("masses", [_disc(at, r, INK, INK)])
        sheet.write(f"{mass.mass:.4g} kg", INK, CAPTIONS, sheet.around(at, r))
    # Line loads come first, so that forces stand out from them.
    for load in sorted(scene.loads, key=lambda load: not isinstance(load, LineLoad)):
        draw_load(sheet, load)
    for velocity in scene.initial:
        draw_velocity(sheet, velocity)
    return sheet


def _disc(at: Array, radius: float, color: str, fill: str, layer: float = 5.0) -> Stroke:
    circle = directions(np.linspace(0.0, 2 * math.pi, 25))
    return Stroke(at + radius * circle, color, 1.4, fill, layer)


def _support(footing: Footing, unit: float) -> Iterator[Stroke]:
    """The symbol of a support; of one that does not move on hatched ground."""
    ahead, color = unit * directions(footing.angle), footing.color
    for outline in footing.outlines:
        yield Stroke(in_frame(outline, footing.at, ahead), color, 0.5, color, 3.5)
    low = min(y for outline in footing.outlines for _, y in outline)
    if color != ORANGE:
        for x in np.linspace(-0.7, 1.0, 6):
            hatch = in_frame([(x, low), (x - 0.35, low - 0.4)], footing.at, ahead)
            yield Stroke(hatch, color, 1.0, layer=3.5)


def _draw_beams(sheet: Sheet) -> None:
    """Axes, marks between cells and where hinges may form if these are few, names."""
    subject, scale, unit = sheet.subject, sheet.scale, sheet.unit
    weight = 2.8 * unit / scale / SYMBOL
    sheet.add("beams", (Stroke(x, INK, weight, layer=4.0) for x in subject.axes.values()))
    for beam, axis in subject.axes.items():
        if subject.cells <= MOST_CELLS:
            sheet.add("cells", _between_cells(axis, scale))
            if beam.section.hinge is not None and beam.section.hinge.opens:
                middles = (axis[1:] + axis[:-1]) / 2
                sheet.add("hinges", (_disc(x, 0.14 * unit, HINGE, HINGE, 4.1) for x in middles))
        if len(subject.axes) <= MOST_LABELS:
            sheet.write(subject.names[beam], TEXT, NAMES, sheet.along(axis, 2.5 * scale))


def _draw_hinges(sheet: Sheet) -> None:
    """Plastic hinges, beside what is at the end of the beam; sizes of chosen ones."""
    r = 0.25 * sheet.unit
    for hinge in sheet.subject.scene.hinges:
        place = place_of(hinge)
        axis, at = sheet.subject.axes[place.beam], np.array(place.point)
        if place.s in (0.0, 1.0):
            end, inner = axis[:2] if place.s == 0.0 else axis[:-3:-1]
            at = at + 0.7 * sheet.unit * unit_vectors(inner - end)
        sheet.add("hinges", [_disc(at, r, HINGE, HINGE, 5.2)])
        if place.s in place.beam.hinges:
            words = f"hinge {with_unit(float(law_of(hinge).limit), 'N m')}"
            sheet.write(words, HINGE, CAPTIONS, sheet.around(at, r))


def _between_cells(axis: Array, scale: float) -> Iterator[Stroke]:
    """Marks across a beam between its cells, where these are long enough."""
    steps = np.diff(axis, axis=0)
    if len(steps) > 1 and np.linalg.norm(steps, axis=1).min() > 7.0 * scale:
        left = 3.2 * scale * left_of(unit_vectors(steps[1:] + steps[:-1]))
        for ends in np.stack([axis[1:-1] - left, axis[1:-1] + left], axis=1):
            yield Stroke(ends, INK, 1.0, layer=4.0)


def _draw_bodies(sheet: Sheet, pose: Pose) -> None:
    """Outlines, centres, names; many bodies as dots."""
    bodies = sheet.subject.scene.bodies
    if len(bodies) > MOST_CELLS:
        dots = (_disc(np.array(b.center), 0.4 * sheet.unit, INK, GREY) for b in bodies)
        sheet.add("bodies", dots)
        return
    sheet.add("bodies", [*symbols.bodies(pose), *symbols.centres(pose)])
    for body, outline in pose.stage.outlines.items():
        arms, name = (outline - body.center) / sheet.scale, sheet.subject.names[body]
        spots = sheet.around(np.array(body.center), 0.0)
        words = f"{name}, {body.mass:.4g} kg" if body.mass else name
        outside = (spot._replace(gap=float((arms @ spot.way).max())) for spot in spots)
        sheet.write(words, TEXT, NAMES, tuple(outside))


def _draw_joints(sheet: Sheet, pose: Pose) -> None:
    radius = min(sheet.unit / 3, 0.1 * sheet.subject.typical)
    sheet.add("joints", [*symbols.rods(pose), *symbols.rails(pose)])
    square = 0.8 * radius * np.array([(-1, -1), (1, -1), (1, 1), (-1, 1), (-1, -1)])
    for pin in symbols.pins(pose):
        disc = _disc(pin.at, radius, INK, WHITE)
        sheet.add("joints", [disc if pin.turns else Stroke(pin.at + square, INK, 1.0, INK, 5.0)])


def _draw_connectors(sheet: Sheet, pose: Pose) -> None:
    sheet.add("connectors", symbols.connectors(pose))
    unit, scale = sheet.unit, sheet.scale
    for connector in sheet.subject.scene.connectors:
        offset = pose.stage.offsets[connector]
        a, b = symbols.ends_of(pose, connector)
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
        sheet.write(law_in_words(connector.law, connector.turns), TEXT, CAPTIONS, spots)
