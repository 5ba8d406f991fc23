# SPDX-License-Identifier: MIT
"""Pictures of scenes in space: model, deformed shapes and section forces, with z up."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from typing import TYPE_CHECKING, Any

import numpy as np
from scipy.spatial.transform import Rotation

from ufl_beam.arrays import Array
from ufl_beam.discretization.cells_in_space import cell_axes
from ufl_beam.display import counted
from ufl_beam.errors import ArgumentError
from ufl_beam.model.bodies import Body
from ufl_beam.model.loads import Gravity
from ufl_beam.model.scene import Scene
from ufl_beam.output.extremes import Extremes
from ufl_beam.output.scene_lines import BODY, scene_rods
from ufl_beam.output.states import States
from ufl_beam.plotting import style
from ufl_beam.plotting.labels import Label, around, write_labels
from ufl_beam.plotting.positions import Canvas, DeformedShape, joined, points_along
from ufl_beam.plotting.solids_in_space import FROM_A_SIDE, points_in_space
from ufl_beam.plotting.style import BLUE, GREEN, GREY, INK, ORANGE, RED, TEXT, WHITE, with_unit
from ufl_beam.plotting.symbols import DARK, EDGE, GROUND_GREY, STEEL
from ufl_beam.simulation.solution import Solution

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

SIZE = 8.6, 6.2  # of new figures; inch
LEAST_WIDTH = 0.25  # least extent along an axis, as a fraction of the largest one
ARROW = 0.16  # length of the largest arrow, as a fraction of the largest extent
DIAGRAM = 0.15  # largest ordinate of a diagram, as a fraction of the largest extent
SYMBOL = 0.03  # half the length of axes of joints, as a fraction of the largest extent
ROUND_OFF = 1e-9  # fraction of the largest load or stiffness up to which forces are drawn as zero
MOST_NAMES = 12  # number of beams or bodies beyond which names are left out
PEAK = 0.35  # ordinates of ends and peaks above this fraction of the largest are labelled

DIAGRAMS = {
    "N": ("axial force N", (0,), "N"), "V": ("shear force V", (1, 2), "N"),
    "V2": ("shear force V2", (1,), "N"), "V3": ("shear force V3", (2,), "N"),
    "T": ("torsional moment T", (3,), "N m"), "M": ("bending moment M", (4, 5), "N m"),
    "M2": ("bending moment M2", (4,), "N m"), "M3": ("bending moment M3", (5,), "N m"),
}  # fmt: skip
"""Words, columns of :class:`DiagramInSpace` after the first, and units of section forces."""

COMPONENTS = "M3", "M2", "T", "N", "V2", "V3"
"""Section forces whose envelopes are drawn."""

ORDINATES = np.array(
    [[0, 1, 0], [0, 1, 0], [0, 0, 1], [0, 1, 0], [0, 0, 1], [0, -1, 0]], dtype=np.float64
)
"""Directions of ordinates in axes of the section: moments are on the side of tension."""

SIDES = {"V": "V: in its direction", "M": "M: on the side of tension"}
"""Meaning of the side of diagrams of vectors, which have no sign."""


@contextmanager
def _view(ax: Axes | None, points: Array, size: float, title: str) -> Iterator[Any]:
    """Open axes with z up and equal scales, for points (n, 3) of a scene of a size; m."""
    from matplotlib.ticker import MaxNLocator
    from mpl_toolkits.mplot3d.axes3d import Axes3D

    if ax is not None and not isinstance(ax, Axes3D):
        raise ArgumentError(
            "plot: a scene in space needs axes in space, such as "
            'figure.add_subplot(projection="3d")'
        )
    low, high = points.min(axis=0), points.max(axis=0)
    middle = (low + high) / 2
    half = 0.54 * np.maximum(high - low, LEAST_WIDTH * size)
    x, y, z = FROM_A_SIDE
    with style.panel(ax, SIZE, projection="3d") as panel:
        axes: Any = panel
        axes.set_proj_type("ortho")
        axes.view_init(
            elev=math.degrees(math.atan2(-z, math.hypot(x, y))),
            azim=math.degrees(math.atan2(-y, -x)),
        )
        axes.computed_zorder = False
        for name, at, width in zip("xyz", middle, half, strict=True):
            getattr(axes, f"set_{name}lim")(at - width, at + width)
            axis = getattr(axes, f"{name}axis")
            axis.set_major_locator(
                MaxNLocator(max(1, round(5 * width / half.max())), min_n_ticks=1)
            )
            axis.set_pane_color((1.0, 1.0, 1.0, 0.0))
            axis.set_label_text(f"{name} (m)")
            axis.labelpad = 7.0
            axis.set_tick_params(labelsize=style.font_size(10.5))
        axes.set_box_aspect(half, zoom=0.98)
        axes.set_title(title, loc="left")
        yield axes


def _line(
    axes: Any, lines: Sequence[Array], color: str, width: float, layer: float, **more: Any
) -> None:
    """Draw lines, (n, 3) each; m."""
    if len(lines):
        x, y, z = joined([np.asarray(line) for line in lines]).T
        axes.plot(x, y, z, color=style.shade(color), linewidth=width, zorder=layer, **more)


def _markers(
    axes: Any, at: Sequence[Array], marker: str, color: str, fill: str, size: float, layer: float
) -> None:
    """Draw equal markers at points, (3,) each; m."""
    if len(at):
        axes.plot(
            *np.transpose(at), marker, markersize=size, markeredgecolor=style.shade(color),
            markerfacecolor=style.shade(fill), markeredgewidth=1.4, zorder=layer,
        )  # fmt: skip


def _beams(shape: DeformedShape, nodes: Array) -> list[Array]:
    """Return the lines of beams through nodes of a shape; (n, 3) each."""
    solution = shape.canvas.solution
    if solution is not None:
        return [nodes[solution.numbering.nodes_along(x)] for x in solution.scene.beams]
    ends = np.cumsum([len(beam.vertices(())) for beam in shape.canvas.scene.beams])
    return np.split(nodes, ends)[:-1]


def _draw_scene(axes: Any, shape: DeformedShape, unit: float, color: str = INK) -> None:
    """Draw beams, bodies, joints, connectors, masses and supports."""
    scene = shape.canvas.scene
    _line(axes, _beams(shape, shape.nodes), color, 2.6, 4)
    _draw_rods(axes, shape, EDGE if color == INK else color)
    pins, blocks, axles = list[Array](), list[Array](), list[Array]()
    for joint in scene.joints:
        place = joint.places[-1]
        axis = getattr(joint, "axis", None)
        own_axes = getattr(joint, "axes", [axis] * (axis is not None))
        for base, x in zip(joint.places, own_axes, strict=False):
            turned = 2 * unit * Rotation.from_rotvec(shape.motion(base)[3:]).apply(x)
            axles.append(shape.at(place) + np.array([-turned, turned]))
        if joint.meets and 2 not in joint.shared:
            pins.append(shape.at(place))
        elif not joint.meets and axis is not None:  # a slider on a rail
            blocks.append(shape.at(place))
    _line(axes, axles, DARK, 4.0, 5)
    _markers(axes, pins, "o", INK, WHITE, 6.5, 6)
    _markers(axes, blocks, "s", INK, WHITE, 7.0, 6)
    _markers(axes, [shape.at(body.middle) for body in scene.bodies], "o", EDGE, "#D6E2ED", 12.0, 5)
    _markers(axes, [shape.at(mass.place) for mass in scene.masses], "o", INK, INK, 7.0, 5)
    turns = [c for c in scene.connectors if c.is_rotation]
    _markers(axes, [shape.at(c.b) for c in turns], "o", GREEN, "none", 12.0, 6)
    for moves, own in ((False, GROUND_GREY), (True, ORANGE)):
        held = [s for s in scene.supports if bool(s.moving) == moves]
        for rotates, marker in ((False, "s"), (True, "^")):
            places = [shape.at(s.place) for s in held if s.bears_moment != rotates]
            _markers(axes, places, marker, own, own, 9.0, 3)
    ground = [x for x in shape.canvas.spots if x not in scene.bodies]
    _markers(
        axes, [shape.at(x) for body in ground for x in shape.canvas.spots[body]],
        "s", GROUND_GREY, GROUND_GREY, 5.0, 3,
    )  # fmt: skip


def _draw_rods(axes: Any, shape: DeformedShape, color: str, *, connectors: bool = True) -> None:
    """Draw lines from bodies to their attachments, and along links and connectors."""
    scene = shape.canvas.scene
    attached = {spot for spots in shape.canvas.spots.values() for spot in spots}
    links = {joint.places for joint in scene.joints if joint.is_rod}
    rods, springs, arms = list[Array](), list[Array](), list[Array]()
    for rod in scene_rods(scene):
        line = np.array([shape.at(rod.a), shape.at(rod.b)])
        if rod.group == BODY:
            arms += [line] * (rod.b in attached)
        else:
            (rods if (rod.a, rod.b) in links else springs).append(line)
    _line(axes, arms, color, 3.0, 3.5)
    _line(axes, rods, STEEL, 2.2, 3.5)
    _line(axes, springs * connectors, GREEN, 1.8, 3.5, linestyle=(0, (3, 1.5)))


def _draw_undeformed(axes: Any, canvas: Canvas) -> None:
    """Draw the undeformed beams in grey."""
    _line(axes, _beams(canvas.undeformed, canvas.undeformed.nodes), GREY, 1.2, 1)


def _label(axes: Any, labels: Sequence[tuple[str, str, Array, Array, bool]]) -> None:
    """Write labels, each with its colour, point and direction (3,), where they cover least."""
    from mpl_toolkits.mplot3d.proj3d import proj_transform

    figure = style.parent_figure(axes)
    style.lay_out(axes)
    figure.draw_without_rendering()  # projects lines and areas
    found = list[Label]()
    for text, color, at, way, bold in labels:
        ends = [np.array(proj_transform(*x, axes.get_proj())[:2]) for x in (at, at + way)]
        ahead = ends[1] - ends[0]
        if not np.any(np.abs(ahead) > 1e-9):
            ahead = np.array([0.0, 1.0])
        found.append(Label(text, color, around(ends[0], ahead), bold))
    write_labels(axes, found)


def _size(scene: Scene, points: Array) -> float:
    """Return the largest extent of points along an axis, or a part of the scene's size; m."""
    return max(float(np.ptp(points, axis=0).max()), 0.3 * scene.size)


# -- solutions ---------------------------------------------------------------------------------


def draw_shape_in_space(
    solution: Solution, *, quantity: str = "shape", n: int = -1, magnify: float = 1.0,
    ax: Axes | None = None,
) -> Figure:  # fmt: skip
    """Draw the scene at the n-th recorded time, optionally with the diagram of a section force.

    Diagrams of V and M are vectors across the beam: V in its own direction, M on the side of
    tension.  Diagrams of components are along axes 2 and 3 of the section; positive values are
    red, negative values blue.  Large values are labelled in the unit of the title.
    """
    canvas = Canvas(solution, magnify, 1.0, [n])
    shape = canvas.shape(n)
    when = f"at {solution.parameter.at(solution.times[n])}{style.magnified(magnify)}"
    if quantity == "shape":
        return _draw_frame(shape, f"shape {when}", ax)
    columns = DIAGRAMS[quantity][1]
    diagrams = [
        (beam, np.column_stack(solution.diagram(beam, n)[1:])[:, columns])
        for beam in solution.scene.beams
    ]
    return _draw_frame(shape, when, ax, quantity, diagrams, n)


def draw_extremes_in_space(
    extremes: Extremes, *, quantity: str = "M3", ax: Axes | None = None
) -> Figure:
    """Draw maxima and minima of a section force on the undeformed scene, as two diagrams."""
    solution = extremes.solution
    title = f"extremes until {solution.parameter.at(solution.times[-1])}"
    return draw_envelope_in_space(solution, extremes, title, quantity, ax)


def draw_envelope_in_space(
    solution: Solution, found: Any, title: str, quantity: str, ax: Axes | None
) -> Figure:
    """Draw the largest and the least values that ``found.section_forces(beam)`` has."""
    columns, beams = DIAGRAMS[quantity][1], solution.scene.beams
    extents = [(beam, found.section_forces(beam)) for beam in beams]
    diagrams = [(beam, x[:, columns]) for beam, some in extents for x in (some.high, some.low)]
    return _draw_frame(Canvas(solution, 1.0, 1.0).undeformed, title, ax, quantity, diagrams)


def _draw_frame(
    shape: DeformedShape, title: str, ax: Axes | None, quantity: str = "",
    diagrams: Sequence[tuple[Any, Array]] = (), n: int | None = None,
) -> Figure:  # fmt: skip
    """Draw a shape with diagrams of a section force, ``(num_cells · points, columns)`` each."""
    solution = shape.canvas.solution
    assert solution is not None
    points = np.concatenate([points_in_space(shape), points_in_space(shape.canvas.undeformed)])
    size, ordinates, labels = _size(solution.scene, points), list[Any](), list[Any]()
    if diagrams:
        words, columns, unit = DIAGRAMS[quantity]
        largest = max(float(np.linalg.norm(x, axis=1).max(initial=0.0)) for _, x in diagrams)
        stiffness = max(max(b.section.EA, b.section.EI / b.section.depth) for b, _ in diagrams)
        factor, prefix = style.decimal_prefix(largest)
        title = f"{words} ({prefix}{unit}), {title}"
        if largest > ROUND_OFF * stiffness:
            for beam, values in diagrams:
                axis, across = _along(solution, beam, shape, len(values), n)
                way = np.einsum("pik,ck,pc->pi", across, ORDINATES[list(columns)], values)
                ordinates.append((axis, axis + DIAGRAM * size / largest * way, values))
            points = np.concatenate([points, *(tips for _, tips, _ in ordinates)])
            labels = _peaks(ordinates, factor, PEAK * largest)
    with _view(ax, points, size, title) as axes:
        if n is not None or not diagrams:
            _draw_undeformed(axes, shape.canvas)
        _draw_scene(axes, shape, SYMBOL * size)
        for color, words in _draw_areas(axes, ordinates, quantity):
            axes.plot([], [], color=color, linewidth=6, alpha=0.5, label=words)
        if ordinates:
            style.draw_legend(axes, ax, loc="outside lower left", ncols=2)
        _label(axes, labels)
    return style.parent_figure(axes)


def _along(
    solution: States, beam: Any, shape: DeformedShape, number: int, n: int | None
) -> tuple[Array, Array]:
    """Return drawn points along a beam, (number, 3), and the axes of sections, (number, 3, 3)."""
    numbering = solution.numbering
    cells = numbering.cells_of(beam)
    fractions = np.linspace(0.0, 1.0, number // len(cells))
    a, b = shape.nodes[numbering.cells[cells]].transpose(1, 0, 2)
    axis = a[:, None] + fractions[:, None] * (b - a)[:, None]
    _, axes = cell_axes(solution.cells.fields)
    turned = np.repeat(axes[cells][:, None], len(fractions), axis=1)
    if n is not None:
        motion = solution.motion_of_nodes(n)[numbering.cells[cells], 3:]
        first, second = (Rotation.from_rotvec(motion[:, k]) for k in (0, 1))
        between = (first.inv() * second).as_rotvec()
        for k, s in enumerate(fractions):
            turned[:, k] = (first * Rotation.from_rotvec(s * between)).as_matrix() @ axes[cells]
    return axis.reshape(-1, 3), turned.reshape(-1, 3, 3)


def _draw_areas(axes: Any, ordinates: Sequence[Any], quantity: str) -> Iterator[tuple[str, str]]:
    """Draw the areas of diagrams; yield the colours of areas with their meaning."""
    from mpl_toolkits.mplot3d.art3d import Poly3DCollection

    quads: dict[str, list[Array]] = {RED: [], BLUE: []}
    lines: dict[str, list[Array]] = {RED: [], BLUE: []}
    for axis, tips, values in ordinates:
        signs = np.sign(values[:-1, 0] + values[1:, 0]) if values.shape[1] == 1 else None
        for k in range(len(axis) - 1):
            color = RED if signs is None or signs[k] >= 0 else BLUE
            quads[color].append(np.array([axis[k], tips[k], tips[k + 1], axis[k + 1]]))
            lines[color].append(tips[k : k + 2])
    for color, some in quads.items():
        if some:
            area = Poly3DCollection(some, facecolors=color, alpha=0.25, edgecolors="none", zorder=2)
            axes.add_collection3d(area, autolim=False)
            _line(axes, lines[color], color, 1.4, 3)
            signed = f"{quantity} > 0" if color == RED else f"{quantity} < 0"
            yield color, SIDES.get(quantity, signed)


def _peaks(ordinates: Sequence[Any], factor: float, least: float) -> list[Any]:
    """Return labels of large values at the ends of diagrams and at the largest ordinates."""
    found = list[tuple[float, Any]]()
    for axis, tips, values in ordinates:
        sizes = np.linalg.norm(values, axis=1)
        for k in dict.fromkeys((int(sizes.argmax()), 0, len(sizes) - 1)):
            if sizes[k] >= least:
                shown = sizes[k] if values.shape[1] > 1 else values[k, 0]
                color = BLUE if shown < 0 else RED
                label = style.number(shown / factor), color, tips[k], tips[k] - axis[k]
                found.append((sizes[k], label))
    found.sort(key=lambda x: -x[0])
    several = {(x[0], *np.round(x[2], 6)): x for _, x in reversed(found)}
    return [(*x, k == 0) for k, x in enumerate(reversed([*several.values()]))]


def draw_shapes_in_space(
    solution: Solution, chosen: Sequence[int], magnify: float, ax: Axes | None
) -> Figure:
    """Draw states in one picture, coloured by time; symbols belong to the last one."""
    from matplotlib.colors import to_hex

    along, canvas = solution.progress, Canvas(solution, magnify, 1.0, chosen)
    shapes = [canvas.shape(n) for n in chosen]
    points = np.concatenate([points_in_space(x) for x in (canvas.undeformed, *shapes)])
    colors = style.scale("viridis", 0.0, 0.88, *np.sort(along[chosen])[[0, -1]])
    size = _size(solution.scene, points)
    with _view(ax, points, size, style.magnified(magnify, "")) as axes:
        _draw_undeformed(axes, canvas)
        for shape, color in zip(shapes, map(to_hex, colors.to_rgba(along[chosen])), strict=True):
            _line(axes, _beams(shape, shape.nodes), color, 2.2, 4)
            _draw_rods(axes, shape, color, connectors=False)
        _draw_scene(axes, shapes[-1], SYMBOL * size, to_hex(colors.to_rgba(along[chosen[-1]])))
        bar = axes.figure.colorbar(colors, ax=axes, shrink=0.6, aspect=25, pad=0.08)
        bar.set_label(solution.parameter.name)
    return style.parent_figure(axes)


# -- models ------------------------------------------------------------------------------------


def draw_model_in_space(scene: Scene, *, ax: Axes | None = None) -> Figure:
    """Draw the undeformed model with its loads (red) and initial velocities (green).

    An arrow with two heads is a moment or an angular velocity about its direction.
    """
    canvas = Canvas(scene, 1.0, 1.0)
    shape = canvas.undeformed
    points = points_in_space(shape)
    size, labels = _size(scene, points), list[Any]()
    arrows = [*_loads(scene, size), *_velocities(scene, size)]
    points = np.concatenate([points, *(line for line, *_ in arrows)])
    lines = _beams(shape, shape.nodes)
    cells = sum(len(line) - 1 for line in lines), "cell", "cells"
    title = counted(
        (len(scene.beams), "beam", "beams"), cells, (len(scene.bodies), "body", "bodies")
    )
    with _view(ax, points, size, f"model: {title}") as axes:
        _draw_scene(axes, shape, SYMBOL * size)
        _markers(axes, [x for line in lines for x in line[1:-1]], ".", INK, INK, 4.0, 4.5)
        for line, color, double, text in arrows:
            for end in (1.0, 0.82)[: 1 + double]:
                look = {"color": color, "linewidth": 1.8, "arrow_length_ratio": 0.25 / end}
                axes.quiver(*line[0], *(end * (line[1] - line[0])), zorder=6, **look)
            if text:
                labels.append((text, color, line[0], line[0] - line[1], False))
        up = np.array([0.0, 0.0, 0.1 * size])
        for body in scene.bodies[:MOST_NAMES]:
            labels.append((body.name, TEXT, np.array(body.center), up, False))
        if len(scene.beams) <= MOST_NAMES:
            named = zip(scene.beams, lines, strict=True)
            labels += [(x.name, TEXT, points_along(at, [0.5])[0], up, False) for x, at in named]
        captions = [
            f"gravity ({', '.join(map(style.number, x.acceleration))}) m/s²"
            for x in scene.loads if isinstance(x, Gravity)
        ]  # fmt: skip
        axes.text2D(
            0.01, 0.97, "\n".join(captions), transform=axes.transAxes, color=RED, va="top",
            fontsize=style.font_size(11.0),
        )  # fmt: skip
        _label(axes, labels)
    return style.parent_figure(axes)


Arrow = tuple[Array, str, bool, str]  # tail and tip (2, 3), m; colour; whether a moment; label


def _loads(scene: Scene, size: float) -> Iterator[Arrow]:
    """Yield arrows of loads: forces end at their places, moments begin there."""
    loads: Sequence[Any] = [x for x in scene.loads if hasattr(x, "place") or hasattr(x, "beam")]
    vectors = [
        (load, (name, hasattr(load, "beam")), np.array(vector, dtype=np.float64))
        for load in loads for name in ("force", "moment")
        if np.any(vector := getattr(load, name, 0.0))
    ]  # fmt: skip
    for load, kind, vector in vectors:
        length = float(np.linalg.norm(vector))
        largest = max(float(np.linalg.norm(x)) for _, other, x in vectors if other == kind)
        step = ARROW * size * (0.4 + 0.6 * length / largest) * vector / length
        turns, along = kind[0] == "moment", kind[1]
        text = with_unit(length, "N m" if turns else "N")
        if along:
            axis = np.array([load.beam.curve(s) for s in load.beam.vertices(())])
            at, text, step = points_along(axis, np.linspace(0, 1, 7)), f"{text}/m", 0.6 * step
        else:
            at = np.array([load.place.point])
        for k, point in enumerate(at):
            ends = np.array([point, point + step] if turns else [point - step, point])
            yield ends, RED, turns, text * (k == len(at) // 2)


def _velocities(scene: Scene, size: float) -> Iterator[Arrow]:
    """Yield arrows of initial velocities, with labels at the first part of each."""
    found = [
        (k, velocity, x.center if isinstance(x, Body) else x.at(0.5).point)
        for velocity in scene.initial for k, x in enumerate(velocity.beams)
    ]  # fmt: skip
    speeds = [float(np.linalg.norm(velocity.at(*point)[:3])) for _, velocity, point in found]
    for k, velocity, point in found:
        spin = np.array(velocity.angular, dtype=np.float64)
        for turns, vector in enumerate((np.array(velocity.at(*point)[:3]), spin)):
            if (length := float(np.linalg.norm(vector))) > 0.0:
                step = ARROW * size * vector / (length if turns else max(speeds))
                text = with_unit(length, ("m/s", "rad/s")[turns])
                yield np.add(point, [0.0 * step, step]), GREEN, bool(turns), text * (k == 0)
