# SPDX-License-Identifier: MIT
"""Symbols of bodies, joints, connectors and supports as lines and areas.

Pictures of all kinds draw these, in the plane and solid.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from typing import NamedTuple

import numpy as np

from ufl_beam.arrays import Array
from ufl_beam.model.bodies import GROUND, Anchor, Place, Spot, node
from ufl_beam.model.connector_laws import Guide
from ufl_beam.model.connectors import Connector
from ufl_beam.model.joints import Joint
from ufl_beam.model.scene import Scene
from ufl_beam.model.supports import Support
from ufl_beam.output.joint_histories import turned
from ufl_beam.plotting.connector_glyphs import AROUND, STRAIGHT, along, around, kind_of
from ufl_beam.plotting.geometry import (
    directions,
    in_frame,
    left_of,
    lengths_along,
    points_along,
    unit_vectors,
)
from ufl_beam.plotting.scene_layout import Pose
from ufl_beam.plotting.style import BACK, FRONT, GREY, INK, ORANGE, WHITE, Stroke

FILLED, EDGE = "#D6E2ED", "#5F7A94"  # colours of bodies
STEEL, DARK, GROUND_GREY = "#6E6E6E", "#4A4A4A", "#808080"  # of rails, rods and still supports

LEAST_SLIDE = 4.0  # least length of a connector that slides; half a symbol is 1

# Outlines of the symbols of supports; half a symbol is 1, the place is the origin, the beam comes
# from above.
Outline = tuple[tuple[float, float], ...]
Outlines = tuple[Outline, ...]
_TRIANGLE = ((0.0, 0.0), (-0.6, -0.8), (0.6, -0.8), (0.0, 0.0))
_CLAMP = ((-1.0, 0.0), (1.0, 0.0), (1.0, -0.5), (-1.0, -0.5), (-1.0, 0.0))
_PLATE = ((-1.0, -0.8), (1.0, -0.8), (1.0, -0.9), (-1.0, -0.9), (-1.0, -0.8))
_TRACK = ((-1.0, -1.0), (1.0, -1.0), (1.0, -1.1), (-1.0, -1.1), (-1.0, -1.0))
_DIAMOND = ((-0.6, 0.0), (0.0, 0.6), (0.6, 0.0), (0.0, -0.6), (-0.6, 0.0))


class Pin(NamedTuple):
    """Symbol of a joint of places at one point."""

    at: Array  # (2,); m
    turns: bool  # freely
    places: tuple[Anchor, ...]


class Footing(NamedTuple):
    """Symbol of a support, or of a point of the ground."""

    at: Array  # (2,); m
    angle: float  # by which it is turned; rad
    outlines: Outlines  # half a symbol is 1, the place is the origin
    color: str  # orange ones move
    place: Anchor


def bodies(pose: Pose) -> list[Stroke]:
    """Draw outlines of the rigid bodies."""
    outlines = pose.stage.outlines.items()
    return [Stroke(pose.of_body(body, line), EDGE, 1.6, FILLED, BACK) for body, line in outlines]


def centres(pose: Pose) -> Iterator[Stroke]:
    """Draw centres of mass as circles, two quarters dark."""
    arc = 0.45 * pose.stage.unit * directions(np.linspace(0.0, math.pi / 2, 13))
    quarter = np.vstack([(0.0, 0.0), arc, (0.0, 0.0)])
    for body in pose.stage.scene.bodies:
        at, ψ = pose.at(body.middle), pose.turn(body.middle)
        for k, fill in enumerate((EDGE, WHITE, EDGE, WHITE)):
            angles = np.full(len(quarter), ψ + k * math.pi / 2)
            yield Stroke(at + turned(quarter, angles), EDGE, 1.0, fill)


def rods(pose: Pose) -> Iterator[Stroke]:
    """Draw rigid links, thick, and links, thin."""
    for joint in pose.stage.scene.joints:
        if joint.look in ("RigidLink", "Link"):
            weight = 6.0 if joint.look == "RigidLink" else 2.6
            ends = np.array([pose.at(place) for place in joint.places])
            yield Stroke(ends, DARK, weight)


def pins(pose: Pose) -> Iterator[Pin]:
    """Draw circles where joints turn, squares where they do not."""
    for joint in pose.stage.scene.joints:
        places, apart = joint.places, 2 not in joint.shared
        match joint.look:
            case "Link":
                yield from (Pin(pose.at(place), True, (place,)) for place in places)
            case "Prismatic" | "Guided" if apart:
                yield Pin(pose.at(places[1]), True, places[1:])
            case "Rigid" | "Revolute":
                yield Pin(pose.at(places[0]), _turns(joint), places)
            case "Release" if apart or 0 in joint.shared:  # else it only slides: rails show it
                yield Pin(pose.at(places[0]), _turns(joint), places)


def rails(pose: Pose) -> Iterator[Stroke]:
    """Draw rails, guide curves, and the blocks on them."""
    draw = {"Prismatic": _rail, "Guided": _guide, "Release": _sleeve}
    for joint in pose.stage.scene.joints:
        if joint.look in draw:
            yield from draw[joint.look](pose, joint)


def connectors(pose: Pose) -> Iterator[Stroke]:
    """Draw springs, dampers, motors and their like."""
    for connector in pose.stage.scene.connectors:
        draw = _around if connector.turns else _straight
        yield from draw(pose, connector)


def ends_of(pose: Pose, connector: Connector) -> tuple[Array, Array]:
    """Return the points from which and to which a straight connector is drawn; (2,) each; m.

    One that slides is drawn along its axis and ends where its place b is seen across the axis.  It
    begins before a if it would be too short in the undeformed scene.
    """
    a, b = pose.at(connector.a), pose.at(connector.b)
    if not connector.follows_a:
        return a, b
    ahead = pose.turned(connector.axis, connector.a)
    start = float(np.dot(connector.apart, connector.axis))
    least = math.copysign(max(LEAST_SLIDE * pose.stage.unit, abs(start)), start)
    return a - (least - start) * ahead, a + ((b - a) @ ahead) * ahead


def _straight(pose: Pose, connector: Connector) -> Iterator[Stroke]:
    a, b = ends_of(pose, connector)
    unit, offset = pose.stage.unit, pose.stage.offsets[connector]
    length = math.hypot(*connector.apart)
    if connector.follows_a:
        yield Stroke(np.array([b, pose.at(connector.b)]), STEEL, 1.0)
        along_axis = abs(float(np.dot(connector.apart, connector.axis)))
        length = max(along_axis, LEAST_SLIDE * unit)
    apart = np.linalg.norm(b - a) > 0.1 * unit
    axis = unit_vectors(b - a) if apart else pose.turned(connector.axis, connector.a)
    across = unit * left_of(axis)
    if offset:
        for end, far in ((a, b), (b, a)):
            lane = end + 0.06 * (far - end)
            yield Stroke(np.array([end, lane, lane + offset * across]))
        inwards = 0.06 * (b - a)
        a, b = a + inwards + offset * across, b - inwards + offset * across
    # It takes the same part of the way at all times, so it stretches with the motion.
    body = min(0.66, 6.0 * unit / max(length, unit))
    for stroke in STRAIGHT[kind_of(connector.law)]:
        yield along(stroke, a, b, across, body)


def _around(pose: Pose, connector: Connector) -> Iterator[Stroke]:
    glyph, pin = AROUND[kind_of(connector.law)], pose.at(connector.b)
    radius = (1.6 + pose.stage.offsets[connector]) * pose.stage.unit
    a, b = pose.turn(connector.a), pose.turn(connector.b)
    first, sweep = (b, 0.0) if glyph.spins else (a, b - a)
    first -= 0.5
    # Where it turns for many times, the symbol stops winding.
    sweep = glyph.sweep + min(max(sweep, -0.75 * glyph.sweep), 2.0)
    for stroke in glyph.strokes:
        yield around(stroke, pin, radius, (first, first + sweep))
    start = pose.at(connector.a)
    if np.linalg.norm(pin - start) > radius and node(connector.a) is not GROUND:
        yield Stroke(np.array([start, pin]), GREY, 1.0)


def footings(pose: Pose) -> Iterator[Footing]:
    """Draw supports, and points of the ground that hold something."""
    for support in pose.stage.scene.supports:
        angle = support_direction(support, pose.turn(support.place))
        color = ORANGE if support.moving else GROUND_GREY
        held = 3 if len(support.held) == 3 else len({0, 1} & set(support.held))
        symbol = ((_DIAMOND,), (_TRIANGLE, _TRACK), (_TRIANGLE, _PLATE), (_CLAMP,))[held]
        yield Footing(pose.at(support.place), angle, symbol, color, support.place)
    for spot, (inward, turns) in _grounds(pose.stage.scene).items():
        symbol = (_TRIANGLE, _PLATE) if turns else (_CLAMP,)
        angle = _upright(inward) if turns else inward - math.pi / 2
        yield Footing(np.array(spot.point), angle, symbol, GROUND_GREY, spot)


def _turns(joint: Joint) -> bool:
    return 2 not in joint.shared and not any(holder.turns for holder in joint.holders)


def _grounds(scene: Scene) -> dict[Spot, tuple[float, bool]]:
    """Direction in which a point of the ground holds something; True if that turns freely."""
    held: list[tuple[Sequence[Anchor], bool]] = [
        (j.places, _turns(j)) for j in scene.joints if j.look not in ("Prismatic", "Guided")
    ]
    held += [((c.a, c.b), False) for c in scene.connectors if not c.turns]
    found: dict[Spot, tuple[float, bool]] = {}
    for places, turns in held:
        for spot in places:
            if isinstance(spot, Spot) and spot.body is GROUND:
                inward = _towards(spot, next(p for p in places if p != spot))
                known, before = found.get(spot, (inward, True))
                found[spot] = known, before and turns
    return found


def _rail(pose: Pose, joint: Joint) -> Iterator[Stroke]:
    """The rail as long as the way, and the block on it."""
    (across,), (base, slider) = joint.holders, joint.places
    unit, start, block = pose.stage.unit, pose.at(base), pose.at(slider)
    ahead = -left_of(pose.turned(across.axis, base))
    s = float((block - start) @ ahead)
    low, high = pose.stage.travels[across]
    # Magnified rotations lead elsewhere.
    low, high = min(low, s) - 1.8 * unit, max(high, s) + 1.8 * unit
    rail = block + np.outer((low - s, high - s), ahead)
    yield Stroke(rail, STEEL, 2.2)
    if node(base) is GROUND:
        yield from _hatches(rail, unit)
    else:
        foot = min(max(0.0, low), high)
        yield Stroke(np.array([start, block + (foot - s) * ahead]), STEEL, 2.2)
    corners = [(-0.95, 0.55), (0.95, 0.55), (0.95, -0.55), (-0.95, -0.55), (-0.95, 0.55)]
    yield Stroke(in_frame(corners, block, unit * ahead), INK, 1.8, WHITE)


def _guide(pose: Pose, joint: Joint) -> Iterator[Stroke]:
    """The guide curve, as far as it was used."""
    (holder,) = joint.holders
    assert isinstance(holder.law, Guide)
    low, high = pose.stage.travels[holder]
    curve = np.array([holder.law.curve(s) for s in np.linspace(low, high, 200)], dtype=float)
    yield Stroke(curve, STEEL, 2.2, layer=BACK)
    yield from (h._replace(layer=BACK) for h in _hatches(curve, pose.stage.unit))


def _sleeve(pose: Pose, joint: Joint) -> Iterator[Stroke]:
    """Two bars along what a release leaves free; a box if it leaves both free."""
    if 0 in joint.shared:
        return
    place = joint.places[0]
    held = pose.turned(joint.holders[0].axis if joint.holders else (0.0, 1.0), place)
    bars = [[(-0.9, t), (0.9, t)] for t in (0.6, -0.6)]
    if not joint.holders:
        bars += [[(s, -0.6), (s, 0.6)] for s in (0.9, -0.9)]
    for bar in bars:
        points = in_frame(bar, pose.at(place), -pose.stage.unit * left_of(held))
        yield Stroke(points, INK, 2.4, layer=FRONT)


def support_direction(support: Support, turned: float) -> float:
    """Angle of the symbol of a support, away from its beam; a clamp is ``turned`` with it; rad."""
    inward = _inward(support.place)
    if len(support.held) == 3:
        return inward + turned - math.pi / 2
    return _upright(inward, support.angle - (0.0 if 1 in support.held else math.pi / 2))


def _upright(inward: float, angle: float = 0.0) -> float:
    """An angle, or the opposite one where the symbol would else lie on the beam; rad."""
    return angle + (math.pi if math.sin(inward - angle) < -0.5 else 0.0)


def _inward(anchor: Anchor) -> float:
    """Direction in which the beam leaves its end; upwards from a place in between; rad."""
    if not isinstance(anchor, Place) or 0.0 < anchor.s < 1.0:
        return math.pi / 2
    (x, y), (X, Y) = anchor.point, anchor.beam.curve(1e-3 if anchor.s == 0.0 else 1.0 - 1e-3)
    return math.atan2(Y - y, X - x)


def _towards(spot: Spot, other: Anchor) -> float:
    """Direction in which what is attached to the ground lies; rad."""
    (x, y), (X, Y) = spot.point, other.point
    if (x, y) == (X, Y) and isinstance(other, Spot):
        X, Y = other.body.center
    return _inward(other) if (x, y) == (X, Y) else math.atan2(Y - y, X - x)


def _hatches(line: Array, unit: float) -> Iterator[Stroke]:
    """The mark of the ground along a line, to its right."""
    lengths = lengths_along(line)
    at = np.arange(0.3 * unit, lengths[-1], 0.55 * unit)
    step = np.minimum(np.searchsorted(lengths, at), len(line) - 1) - 1
    ahead = unit_vectors(np.diff(line, axis=0)[step])
    tops = points_along(line, at)
    for ends in np.stack([tops, tops - 0.4 * unit * (ahead + left_of(ahead))], axis=1):
        yield Stroke(ends, STEEL, 1.0)
