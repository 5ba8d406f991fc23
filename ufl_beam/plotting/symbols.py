# SPDX-License-Identifier: MIT
"""Symbols of bodies, joints, connector laws and supports for all kinds of pictures.

Symbols of supports are in :data:`SUPPORTS`, of joints in :data:`JOINTS`, of connector laws in
:data:`LAWS`.  Joints and laws that are not in these tables have a plain symbol.  The unit of
lengths is half the size of a symbol.  Symbols of loads are in `model.py`.
"""

from __future__ import annotations

import math
import re
from collections import defaultdict
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from typing import Any, NamedTuple

import numpy as np

from ufl_beam.arrays import Array
from ufl_beam.model import connector_laws as laws
from ufl_beam.model.bodies import GROUND, AttachmentPoint, BodyPoint, Place, node
from ufl_beam.model.connector_law import ConnectorLaw
from ufl_beam.model.connectors import Connector
from ufl_beam.model.joints import Guided, Joint, Link, Prismatic, Release, RigidLink
from ufl_beam.plotting import positions
from ufl_beam.plotting.positions import (
    PICTURE,
    DeformedShape,
    directions,
    in_frame,
    normal,
    unit_vectors,
)
from ufl_beam.plotting.style import GREY, INK, ORANGE, WHITE, Axes, number, shade, with_unit

# Layers: below the beams, above the beams, on areas in the layer MIDDLE, pins, above pins.
BEHIND, MIDDLE, UPON, PINS, FRONT = 2.5, 4.2, 4.3, 5.0, 5.5

FILLED, EDGE = "#D6E2ED", "#5F7A94"  # colours of bodies
STEEL, DARK, GROUND_GREY = "#6E6E6E", "#4A4A4A", "#808080"  # of rails, rods and fixed supports

LEAST_SLIDE = 4.0  # least length of a sliding connector; units
MOST_BODIES = 300  # number of bodies beyond which bodies are drawn as dots


class Stroke(NamedTuple):
    """Line, or an area if it is filled."""

    points: Array  # (n, 2 or 3); m, or units in the tables of symbols
    color: str = INK
    weight: float = 1.6  # width of the line; points
    fill: str | None = None  # colour of the area
    layer: float = MIDDLE


def draw_strokes(axes: Axes, groups: Mapping[str, Iterable[Stroke]], color: Any = None) -> None:
    """Draw lines and areas by groups, in their own colours or all in one colour.

    Strokes that look alike share a collection, so that large scenes are drawn fast.
    """
    from matplotlib.collections import LineCollection, PolyCollection
    from mpl_toolkits.mplot3d.art3d import Poly3DCollection

    alike: defaultdict[tuple[str, str, float, str | None, float], list[Array]] = defaultdict(list)
    for group, strokes in groups.items():
        for points, own, weight, fill, layer in strokes:
            alike[group, own, weight, fill, layer].append(points)
    for (group, own, weight, fill, layer), lines in alike.items():
        edge = shade(own) if color is None else color
        inside = "none" if fill is None else shade(fill) if color is None else (color, 0.15)
        if lines[0].shape[1] == 3:
            look: dict[str, Any] = {"linewidth": weight, "zorder": layer, "gid": group}
            axes.plot(*positions.joined(lines).T, color=edge, **look)  # also updates the limits
            if fill is not None:
                area: Any = Poly3DCollection(lines, edgecolors=edge, facecolors=inside, **look)
                axes.add_collection(area)
            continue
        kind = LineCollection if fill is None else PolyCollection
        collection = kind(
            lines, edgecolors=edge, facecolors=inside, linewidths=weight, zorder=layer,
            joinstyle="round", capstyle="round", gid=group,
        )  # fmt: skip
        axes.add_collection(collection)
    axes.autoscale_view()


def _line(*points: tuple[float, float], weight: float = 1.6, layer: float = MIDDLE) -> Stroke:
    return Stroke(np.array(points), INK, weight, layer=layer)


def _box(low: float, high: float, half: float, fill: str) -> Stroke:
    corners = [(low, half), (high, half), (high, -half), (low, -half), (low, half)]
    return Stroke(np.array(corners), fill=fill)


def disc(at: Array, radius: float, color: str, fill: str, layer: float = PINS) -> Stroke:
    """Draw a filled circle; its centre and radius are in m."""
    circle = directions(np.linspace(0.0, 2 * math.pi, 25))
    return Stroke(at + radius * circle @ PICTURE[len(at)], color, 1.4, fill, layer)


# -- supports ----------------------------------------------------------------------------------

_TRIANGLE = ((0.0, 0.0), (-0.6, -0.8), (0.6, -0.8), (0.0, 0.0))
_CLAMP = ((-1.0, 0.0), (1.0, 0.0), (1.0, -0.5), (-1.0, -0.5), (-1.0, 0.0))
_PLATE = ((-1.0, -0.8), (1.0, -0.8), (1.0, -0.9), (-1.0, -0.9), (-1.0, -0.8))
_TRACK = ((-1.0, -1.0), (1.0, -1.0), (1.0, -1.1), (-1.0, -1.1), (-1.0, -1.0))
_DIAMOND = ((-0.6, 0.0), (0.0, 0.6), (0.6, 0.0), (0.0, -0.6), (-0.6, 0.0))

SUPPORTS = ((_DIAMOND,), (_TRIANGLE, _TRACK), (_TRIANGLE, _PLATE), (_CLAMP,))
"""Outlines of supports with 0, 1 and 2 constrained displacements, and of clamped supports.
The supported place is the origin, and the beam is above."""


def supports(shape: DeformedShape) -> Iterator[Stroke]:
    """Draw supports, and points of the ground with joints or connectors.

    Supports that do not move are on hatched ground.
    """
    scene, unit = shape.canvas.scene, shape.canvas.outside
    # Place, colour, index of SUPPORTS, direction away from the support, angle unless clamped
    symbols: list[tuple[AttachmentPoint, str, int, float, float]] = []
    for support in scene.supports:
        place, held = support.place, support.held
        color = ORANGE if support.moving else GROUND_GREY
        if support.bears_moment if scene.in_space else len(held) == 3:
            symbols.append((place, color, 3, _inward(place) + shape.rotation(place), 0.0))
        else:
            angle = support.angle - (0.0 if 1 in held else math.pi / 2)
            symbols.append((place, color, len({0, 1} & set(held)), _inward(place), angle))
    # Places, and whether the joint can rotate; None for connectors, which leave this to the joints
    grounded: list[tuple[Sequence[AttachmentPoint], bool | None]] = [
        (j.places, _rotates(j)) for j in scene.joints if joint_symbol(j).grounded
    ]
    grounded += [((c.a, c.b), None) for c in scene.connectors if not c.is_rotation]
    # Direction away from the ground; True if there are joints, and all rotate
    grounds: dict[BodyPoint, tuple[float, bool]] = {}
    for places, rotates in grounded:
        for point in places:
            if isinstance(point, BodyPoint) and point.body is GROUND:
                far = next(place for place in places if place != point)
                end = far.point
                if end == point.point and isinstance(far, BodyPoint):
                    end = far.body.center
                inward = _angle(point.point, end) if end != point.point else _inward(far)
                known, before = grounds.get(point, (inward, rotates is not None))
                grounds[point] = known, before and rotates is not False
    for point, (inward, rotates) in grounds.items():
        symbols.append((point, GROUND_GREY, 2 if rotates else 3, inward, 0.0))
    for place, color, fixed, inward, angle in symbols:
        if fixed == 3:
            angle = inward - math.pi / 2
        elif math.sin(inward - angle) < -0.5:  # the symbol would lie on the beam
            angle += math.pi
        at, low = shape.at(place), min(y for outline in SUPPORTS[fixed] for _, y in outline)
        ahead = unit * directions(angle) @ PICTURE[len(at)]
        for outline in SUPPORTS[fixed]:
            yield Stroke(in_frame(outline, at, ahead), color, 0.5, color, 3.5)
        if color != ORANGE:
            yield from _hatches(in_frame([(-1.0, low), (1.0, low)], at, ahead), unit)


def _inward(place: AttachmentPoint) -> float:
    """Return the angle of the inward direction at a beam's end; at other places π/2; rad."""
    if not isinstance(place, Place) or 0.0 < place.s < 1.0:
        return math.pi / 2
    return _angle(place.point, place.beam.curve(1e-3 if place.s == 0.0 else 1.0 - 1e-3))


def _angle(start: Any, end: Any) -> float:
    """Return the angle of a line in the picture; rad."""
    x, y = PICTURE[len(start)] @ np.subtract(end, start)
    return math.atan2(y, x)


def _hatches(line: Array, unit: float) -> Iterator[Stroke]:
    """Draw the hatching of the ground along a line, to its right."""
    lengths = positions.lengths_along(line)
    at = np.arange(0.3 * unit, lengths[-1], 0.55 * unit)
    step = np.minimum(np.searchsorted(lengths, at), len(line) - 1) - 1
    ahead = unit_vectors(np.diff(line, axis=0)[step])
    tops = positions.points_along(line, at / lengths[-1])
    for ends in np.stack([tops, tops - 0.4 * unit * (ahead + normal(ahead))], axis=1):
        yield Stroke(ends, STEEL, 1.0, layer=BEHIND)


# -- bodies and joints -------------------------------------------------------------------------


def bodies(shape: DeformedShape) -> list[Stroke]:
    """Draw outlines of the rigid bodies, in space circles with lines to attachment points."""
    found = [
        Stroke(shape.body_points(body, outline), EDGE, 1.6, FILLED, BEHIND)
        for body, outline in shape.canvas.outlines.items()
    ]
    if shape.canvas.scene.in_space:
        pairs = ((body, x) for body in shape.canvas.outlines for x in shape.canvas.spots[body])
        ends = (np.array([shape.at(body.middle), shape.at(x)]) for body, x in pairs)
        found += [Stroke(line, EDGE, 3.0, layer=BEHIND) for line in ends]
    return found


def centres(shape: DeformedShape) -> Iterator[Stroke]:
    """Draw centres of mass as circles with two dark quarters."""
    arc = 0.45 * shape.canvas.unit * directions(np.linspace(0.0, math.pi / 2, 13))
    quarter = np.vstack([(0.0, 0.0), arc, (0.0, 0.0)])
    for body in shape.canvas.scene.bodies:
        at, ψ = shape.at(body.middle), shape.rotation(body.middle)
        for k, fill in enumerate((EDGE, WHITE, EDGE, WHITE)):
            ahead = directions(ψ + k * math.pi / 2)
            yield Stroke(in_frame(quarter, at, ahead), EDGE, 1.0, fill)


class JointSymbol(NamedTuple):
    """Symbol of a joint."""

    rod: float = 0.0  # width of a line from place to place; points
    pins: tuple[int, ...] = ()  # indices of places with a pin, on a rail only if it rotates
    rail: Callable[[DeformedShape, Joint], Iterator[Stroke]] | None = None
    grounded: bool = True  # True if a point of the ground gets the symbol of a support


def _rail(shape: DeformedShape, joint: Joint) -> Iterator[Stroke]:
    """Draw the rail, somewhat longer than the range of motion, and the block on it."""
    (across,), (base, slider) = joint.holders, joint.places
    unit, start, block = shape.canvas.unit, shape.at(base), shape.at(slider)
    ahead = -normal(shape.turned(across.axis, base))
    s = float((block - start) @ ahead)
    low, high = shape.canvas.travels[across]
    # Displacements may be magnified, rotations are not, so the block may leave its range.
    low, high = min(low, s) - 1.8 * unit, max(high, s) + 1.8 * unit
    rail = block + np.outer((low - s, high - s), ahead)
    yield Stroke(rail, STEEL, 2.2)
    if node(base) is GROUND:
        yield from _hatches(rail, unit)
    else:
        foot = min(max(0.0, low), high)
        yield Stroke(np.array([start, block + (foot - s) * ahead]), STEEL, 2.2)
    corners = _box(-0.95, 0.95, 0.55, WHITE).points
    yield Stroke(in_frame(corners, block, unit * ahead), INK, 1.8, WHITE)


def _guide(shape: DeformedShape, joint: Joint) -> Iterator[Stroke]:
    """Draw the used part of a guide curve."""
    (holder,) = joint.holders
    assert isinstance(holder.law, laws.Guide)
    low, high = shape.canvas.travels[holder]
    curve = np.array([holder.law.curve.at(s)[0] for s in map(float, np.linspace(low, high, 200))])
    yield Stroke(curve, STEEL, 2.2, layer=BEHIND)
    yield from _hatches(curve, shape.canvas.unit)


def _sleeve(shape: DeformedShape, joint: Joint) -> Iterator[Stroke]:
    """Draw two bars along the free direction of a release, or a box if both directions are free."""
    if isinstance(joint, Release) and 0 in joint.joined:
        return
    place = joint.places[0]
    holders = [holder for holder in joint.holders if not holder.is_rotation]
    axis = shape.turned(holders[0].axis if holders else (0.0, 1.0), place)
    bars = [[(-0.9, t), (0.9, t)] for t in (0.6, -0.6)]
    if not holders:
        bars += [[(s, -0.6), (s, 0.6)] for s in (0.9, -0.9)]
    for bar in bars:
        points = in_frame(bar, shape.at(place), -shape.canvas.unit * normal(axis))
        yield Stroke(points, INK, 2.4, layer=FRONT)


JOINTS: dict[type[Joint], JointSymbol] = {
    Link: JointSymbol(rod=2.6, pins=(0, 1)),
    RigidLink: JointSymbol(rod=6.0),
    Prismatic: JointSymbol(pins=(1,), rail=_rail, grounded=False),
    Guided: JointSymbol(pins=(1,), rail=_guide, grounded=False),
    Release: JointSymbol(pins=(0,), rail=_sleeve),
}
"""Symbols of joints by class or base class; other joints have a pin or a thin rod."""


def joint_symbol(joint: Joint) -> JointSymbol:
    """Return the symbol of a joint."""
    plain = JointSymbol(pins=(0,)) if joint.meets else JointSymbol(rod=1.6)
    return next((JOINTS[kind] for kind in type(joint).__mro__ if kind in JOINTS), plain)


def _rotates(joint: Joint) -> bool:
    return 2 not in joint.shared and not any(holder.is_rotation for holder in joint.holders)


def rods(shape: DeformedShape) -> Iterator[Stroke]:
    """Draw rods of joints, from place to place."""
    for joint in shape.canvas.scene.joints:
        if weight := joint_symbol(joint).rod:
            yield Stroke(np.array([shape.at(place) for place in joint.places]), DARK, weight)


def rails(shape: DeformedShape) -> Iterator[Stroke]:
    """Draw rails with their blocks, guide curves, and the bars of releases; in space axes."""
    for joint in shape.canvas.scene.joints:
        if shape.canvas.scene.in_space:
            yield from _axes_of_joint(shape, joint)
        elif draw := joint_symbol(joint).rail:
            yield from draw(shape, joint)


def _axes_of_joint(shape: DeformedShape, joint: Joint) -> Iterator[Stroke]:
    """Draw the axes of a joint in space, and the block of a slider."""
    axis, at = getattr(joint, "axis", None), shape.at(joint.places[-1])
    own = getattr(joint, "axes", [axis] * (axis is not None))
    for place, x in zip(joint.places, own, strict=False):
        line = 1.5 * shape.canvas.unit * np.outer((-1.0, 1.0), shape.turned(x, place))
        yield Stroke(at + line, DARK, 4.0, layer=UPON)
    if not joint.meets and axis is not None:
        ahead = shape.canvas.unit * PICTURE[3][0]
        yield Stroke(in_frame(_box(-0.5, 0.5, 0.5, WHITE).points, at, ahead), INK, 1.8, WHITE)


def pins(shape: DeformedShape) -> Iterator[tuple[Array, bool]]:
    """Yield the pins of joints, and whether they turn freely; joints that only slide have none."""
    for joint in shape.canvas.scene.joints:
        look, rotates = joint_symbol(joint), _rotates(joint)
        for k in look.pins if rotates or look.rail is None else ():
            yield shape.at(joint.places[k]), rotates


# -- connectors --------------------------------------------------------------------------------
#
# A symbol, along a line or around a pin, has coordinates (s, t).  s runs along the connector from
# -2 at its place a to 2 at its place b; its middle part is from -1 to 1.  t is perpendicular.


def _class_words(law: Any) -> str:
    """Return the name of a class in words, such as "prescribed motion"."""
    return re.sub(r"(?<=[a-z])(?=[A-Z])", " ", type(law).__name__).lower()


class LawSymbol(NamedTuple):
    """Symbol of a connector law, and the text of its parameters."""

    straight: list[Stroke]
    words: Callable[[Any, str, str], str] = lambda law, force, unit: _class_words(law)
    """Function of law, unit of force and unit of motion that returns the parameters as text."""
    turning: list[Stroke] | None = None  # around a pin; by default the straight one with spokes
    sweep: float = math.pi + 1.0  # angle of the undeformed symbol around the pin; rad
    spins: bool = False  # True if it rotates rigidly with b; else it joins a and b


def _drive(straight: list[Stroke], fill: str, tail: float = -2.0, *more: Stroke) -> LawSymbol:
    """Make the symbol of a drive; around a pin, a curved arrow."""
    head = np.array([(1.45, 0.95), (2.05, 0.0), (1.45, -0.95), (1.45, 0.95)])
    turning = [_line((tail, 0), (1.6, 0), weight=2.6), Stroke(head, INK, 1.4, fill), *more]
    return LawSymbol(straight, turning=turning, sweep=1.4 * math.pi, spins=True)


CENTRE = -9.0  # coordinate t of the inner ends of spokes, which the pin hides
_SPOKES = [_line((s, CENTRE), (s, 0)) for s in (-2, 2)]
_TEETH = [(float(s), 0.55 * (-1.0) ** k) for k, s in enumerate(np.linspace(-1.0, 1.0, 13)[1::2])]
_BOXED = [_line((-2, 0), (-0.8, 0)), _line((0.8, 0), (2, 0)), _box(-0.8, 0.8, 0.6, WHITE)]
_ACTUATOR = [_line((-2, 0), (-0.8, 0)), _line((0.35, 0), (2, 0), weight=3.2)]
_CYLINDER = [
    *(*_ACTUATOR, _box(-0.8, 0.35, 0.6, WHITE)),
    _line((-0.6, 0), (0, 0), weight=2.2, layer=UPON),
    Stroke(
        np.array([(-0.12, 0.34), (0.2, 0.0), (-0.12, -0.34), (-0.12, 0.34)]), INK, 1.0, ORANGE, UPON
    ),
]
_CURVE = [*_BOXED, _line((-0.55, -0.35), (-0.25, -0.27), (0.25, 0.27), (0.55, 0.35), layer=UPON)]


def _stop_in_words(law: laws.Stop, force: str, unit: str) -> str:
    ends = [end for end in (law.low, law.high) if math.isfinite(end)]
    words = [with_unit(x, unit) if unit == "m" else f"{number(x)} {unit}" for x in ends]
    sign = "≤ " if math.isinf(law.low) else "≥ " if math.isinf(law.high) else ""
    return f"stop {sign}{' … '.join(words)}"


def _friction_in_words(law: laws.Coulomb, force: str, unit: str) -> str:
    words = [with_unit(law.force, force)] if law.force else []
    words += [f"{law.coefficient:g}{' m' * (unit == 'rad')} × press"] if law.coefficient else []
    return f"friction {' + '.join(words)}"


LAWS: dict[type, LawSymbol] = {  # drives are filled with orange if they prescribe the motion
    laws.Spring: LawSymbol(
        [_line((-2, 0), (-1, 0), *_TEETH, (1, 0), (2, 0))],
        lambda law, force, unit: with_unit(law.stiffness, f"{force}/{unit}")
        + ", yields" * bool(law.law) + ", breaks" * bool(law.softening),
        [_line((2, CENTRE), (2, -2.1), (-2, 0))], sweep=4.3 * math.pi,
    ),
    laws.Damper: LawSymbol(
        [
            _line((-2, 0), (-0.5, 0)),
            _line((0.6, 0.6), (-0.5, 0.6), (-0.5, -0.6), (0.6, -0.6)),
            _line((0.15, 0.42), (0.15, -0.42), weight=2.6),
            _line((0.15, 0), (2, 0)),
        ],
        lambda law, force, unit: with_unit(law.viscosity, f"{force} s/{unit}"),
    ),
    laws.Stop: LawSymbol(
        [
            _line((-2, 0), (-0.25, 0)),
            _line((-0.25, 0.7), (-0.25, -0.7), weight=3.6),
            _line((0.25, 0.7), (0.25, -0.7), weight=3.6),
            _line((0.25, 0), (2, 0)),
        ],
        _stop_in_words,
    ),
    laws.Coulomb: LawSymbol(
        [
            _line((-2, 0), (-0.8, 0), (-0.8, 0.3), (0.6, 0.3), weight=2.2),
            _line((2, 0), (0.8, 0), (0.8, -0.3), (-0.6, -0.3), weight=2.2),
            *(_line((s - 0.1, -0.3), (s + 0.1, 0.3), weight=1.0) for s in (-0.4, -0.13, 0.13, 0.4)),
        ],
        _friction_in_words,
    ),
    laws.PrescribedMotion: _drive([*_ACTUATOR, _box(-0.8, 0.35, 0.6, ORANGE)], ORANGE),
    laws.PrescribedForce: _drive(_CYLINDER, WHITE),
    laws.Controller: _drive(
        [*_CYLINDER, _line((0.9, 0), (0.9, 1.15), (-0.25, 1.15), (-0.25, 0.6), weight=1.0)],
        WHITE, -1.4, _box(-2.0, -1.4, 0.5, WHITE),
    ),
    laws.ForceLaw: LawSymbol(_CURVE),
    laws.RigidPlastic: LawSymbol(  # no motion below the limit, flow at it
        [*_BOXED, _line((-0.55, -0.35), (0, -0.35), (0, 0.35), (0.55, 0.35), layer=UPON)],
        lambda law, force, unit: f"rigid up to {with_unit(float(law.law.limit), force)}",
    ),
    ConnectorLaw: LawSymbol(_CURVE, lambda law, force, unit: type(law).__name__),  # law of a user
}  # fmt: skip


def law_symbol(law: laws.Law) -> LawSymbol:
    """Return the symbol of a connector law; laws that are not in LAWS share one symbol."""
    return LAWS.get(type(law), LAWS[ConnectorLaw])


def connectors(shape: DeformedShape) -> Iterator[Stroke]:
    """Draw springs, dampers, motors and other connectors, and effects at places."""
    scene = shape.canvas.scene
    for connector in scene.connectors:
        yield from (_around if connector.is_rotation else _straight)(shape, connector)
    for effect in scene.works:
        points = [shape.at(place) for place in effect.places]
        yield from (Stroke(np.array(points), GREY, 1.0) for _ in points[1:2])
        yield from (disc(at, 0.3 * shape.canvas.unit, INK, GREY) for at in points)


def connector_frame(shape: DeformedShape, connector: Connector) -> tuple[Array, Array, Array]:
    """Return start and end of the drawing of a straight connector, and a unit across it; m.

    A sliding connector is drawn along its axis and ends at the projection of its place b onto the
    axis.  It begins before a if it would otherwise be too short in the undeformed scene.
    """
    a, b, unit = shape.at(connector.a), shape.at(connector.b), shape.canvas.unit
    if connector.follows_a:
        ahead = shape.turned(connector.axis, connector.a)
        start = float(np.dot(connector.apart, connector.axis))
        least = math.copysign(max(LEAST_SLIDE * unit, abs(start)), start)
        a, b = a - (least - start) * ahead, a + ((b - a) @ ahead) * ahead
    apart = np.linalg.norm(b - a) > 0.1 * unit
    axis = unit_vectors(b - a) if apart else shape.turned(connector.axis, connector.a)
    return a, b, unit * normal(axis)


def _straight(shape: DeformedShape, connector: Connector) -> Iterator[Stroke]:
    a, b, across = connector_frame(shape, connector)
    unit, offset = shape.canvas.unit, shape.canvas.offsets[connector]
    length = math.hypot(*connector.apart)
    if connector.follows_a:
        yield Stroke(np.array([b, shape.at(connector.b)]), STEEL, 1.0)
        along_axis = abs(float(np.dot(connector.apart, connector.axis)))
        length = max(along_axis, LEAST_SLIDE * unit)
    if offset:
        for end, far in ((a, b), (b, a)):
            lane = end + 0.06 * (far - end)
            yield Stroke(np.array([end, lane, lane + offset * across]))
        inwards = 0.06 * (b - a)
        a, b = a + inwards + offset * across, b - inwards + offset * across
    # The middle part is a constant fraction of the length, so it stretches with the motion.
    body = min(0.66, 6.0 * unit / max(length, unit))
    places = 0.0, (1 - body) / 2, (1 + body) / 2, 1.0
    for stroke in law_symbol(connector.law).straight:
        s, t = stroke.points.T
        fraction = np.interp(s, (-2.0, -1.0, 1.0, 2.0), places)
        yield stroke._replace(points=a + np.outer(fraction, b - a) + np.outer(t, across))


def _around(shape: DeformedShape, connector: Connector) -> Iterator[Stroke]:
    symbol, pin = law_symbol(connector.law), shape.at(connector.b)
    radius = (1.6 + shape.canvas.offsets[connector]) * shape.canvas.unit
    a, b = shape.rotation(connector.a), shape.rotation(connector.b)
    first, sweep = (b, 0.0) if symbol.spins else (a, b - a)
    # Limit the winding of the symbol for many revolutions.
    sweep = symbol.sweep + min(max(sweep, -0.75 * symbol.sweep), 2.0)
    for stroke in symbol.turning or [*symbol.straight, *_SPOKES]:
        # Steps of 5 degrees turn straight lines into arcs.
        steps = np.abs(np.diff(stroke.points[:, 0])) / 4.0 * sweep / math.radians(5.0)
        counts = np.maximum(1, np.ceil(steps)).astype(int)
        at = np.concatenate([[0.0], *(k + np.arange(1, n + 1) / n for k, n in enumerate(counts))])
        s, t = (np.interp(at, np.arange(len(stroke.points)), x) for x in stroke.points.T)
        r = np.maximum(radius * (1.0 + t / 3.0), 0.18 * radius)
        direction = directions(first - 0.5 + sweep * (s + 2.0) / 4.0) @ PICTURE[len(pin)]
        layer = FRONT + stroke.layer - MIDDLE
        yield stroke._replace(points=pin + r[:, None] * direction, layer=layer)
    start = shape.at(connector.a)
    if np.linalg.norm(pin - start) > radius and node(connector.a) is not GROUND:
        yield Stroke(np.array([start, pin]), GREY, 1.0)


# -- all symbols -------------------------------------------------------------------------------


def all_symbols(shape: DeformedShape) -> dict[str, list[Stroke]]:
    """Draw all symbols, by groups; bodies are dots if there are many."""
    scene, unit = shape.canvas.scene, shape.canvas.unit
    few = len(scene.bodies) <= MOST_BODIES
    square = 0.27 * unit * np.array([(-1, -1), (1, -1), (1, 1), (-1, 1), (-1, -1)])
    square = square @ PICTURE[3 if scene.in_space else 2]
    return {
        "bodies": bodies(shape)
        if few
        else [disc(shape.at(body.middle), 0.4 * unit, INK, GREY) for body in scene.bodies],
        "joints": [*rods(shape), *rails(shape)],
        "connectors": [*connectors(shape)],
        "supports": [*supports(shape)],
        "centres": [*centres(shape)] if few and not scene.in_space else [],
        "pins": [
            disc(at, unit / 3, INK, WHITE) if rotates else Stroke(at + square, INK, 1.0, INK, PINS)
            for at, rotates in pins(shape)
        ],
        "masses": masses(shape),
    }


def masses(shape: DeformedShape, color: str = INK) -> list[Stroke]:
    """Draw point masses as dots."""
    at = [shape.at(mass.place) for mass in shape.canvas.scene.masses]
    return [disc(point, 0.45 * shape.canvas.unit, color, color) for point in at]
