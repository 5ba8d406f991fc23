# SPDX-License-Identifier: MIT
"""Pictures of a solution at one of its times, with diagrams of section forces on the frame."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from ufl_beam.arrays import Array
from ufl_beam.model.bodies import Member
from ufl_beam.plotting import drawing, style
from ufl_beam.plotting.geometry import directions, left_of, segments, unit_vectors
from ufl_beam.plotting.labels import Label, Spot, leader_of, place
from ufl_beam.plotting.scene_layout import Pose
from ufl_beam.plotting.style import BLUE, INK, POINTS, RED, RESULTANTS, half_size, with_unit
from ufl_beam.simulation.solution import Solution

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure
    from matplotlib.text import Annotation

DRAWN_AS_ZERO = 1e-6  # part of the largest value below which a value is drawn as zero
LABEL_SIZE, TITLE_SIZE = 13.0, 14.0  # sizes of the texts and of the title; points

AROUND, LEAST, MOST = (1.0, 1.2), (3.6, 2.6), (9.0, 6.8)
"""Room for words and numbers around the axes; least and largest size of a figure; inch."""


Values = tuple[Member, Array]  # a beam, and the values in points of its cells, (num_cells, points)


def plot_state(solution: Solution, what: str, *, n: int, magnify: float) -> Figure:
    """Draw the frame at a time, with a diagram of a section force; see :func:`plot`."""
    style.require_choice(what, ("shape", *RESULTANTS), "plot: what")
    pose = drawing.plane_stage(solution, [n], magnify).pose(n)
    name = f"{RESULTANTS[what][0]} {what}" if what in RESULTANTS else "shape"
    title = f"{name} at {solution.parameter.at(solution.times[n])}{style.magnified(magnify)}"
    beams = solution.scene.beams if what in RESULTANTS else ()
    found = [(beam, getattr(solution.diagram(beam, n), what)) for beam in beams]
    diagrams = [
        (beam, values.reshape(len(solution.grid.cells_of(beam)), -1)) for beam, values in found
    ]
    return draw_frame(solution, pose, title, what, diagrams)


def draw_frame(
    solution: Solution, pose: Pose, title: str, what: str, diagrams: Sequence[Values]
) -> Figure:
    """Draw the frame in a pose, with diagrams of a section force and their extreme values."""
    with style.picture(drawing.plane_size(pose.stage.points())) as figure:
        axes = style.plane_axes(figure, title)
        drawing.draw_undeformed(axes, solution, pose.stage)
        extremes = _draw_diagrams(axes, solution, pose.nodes, what, diagrams) if diagrams else []
        drawing.draw_axes(axes, solution, pose.nodes, color=INK, linewidth=2.6, zorder=4)
        drawing.draw_symbols(axes, pose)
        _finish(figure, axes, extremes)
    return figure


class Extreme(NamedTuple):
    """Largest or least value of a diagram."""

    text: str
    color: str
    tip: Array  # point of the diagram; (2,); m
    outward: Array  # unit vector away from the axis; (2,)


def _draw_diagrams(
    axes: Axes, solution: Solution, nodes: Array, what: str, diagrams: Sequence[Values]
) -> list[Extreme]:
    """Draw diagrams of a section force, all to one scale; return both extreme values."""
    index, side = list(RESULTANTS).index(what), -1.0 if what == "M" else 1.0
    # A strain of 1e-10 is what rounding and the tolerance of the iteration leave behind.
    limits = [(s.EA, s.GA, s.EI / s.depth)[index] for s in (b.section for b, _ in diagrams)]
    sizes = [float(np.abs(values).max()) for _, values in diagrams]
    if all(size <= 1e-10 * limit for size, limit in zip(sizes, limits, strict=True)):
        return []
    largest = max(sizes)
    scale = 0.13 * side * math.hypot(*np.ptp(nodes, axis=0)) / largest
    rows = []  # value, point of the diagram, and vector away from the axis
    for beam, found in diagrams:
        values = np.where(np.abs(found) > DRAWN_AS_ZERO * largest, found, 0.0).ravel()
        axis, left = _along(solution, beam, nodes, found.shape[1])
        tips = axis + scale * values[:, None] * left
        _draw_areas(axes, axis, tips, values)
        rows.append(np.column_stack([values, tips, side * np.sign(values)[:, None] * left]))
    value, tip, outward = np.split(np.concatenate(rows), [1, 3], axis=1)
    return [
        Extreme(with_unit(value[k, 0], RESULTANTS[what][1]), color, tip[k], outward[k])
        for k, sign, color in ((np.argmax(value), 1, RED), (np.argmin(value), -1, BLUE))
        if sign * value[k, 0] > 0
    ]


def _along(solution: Solution, beam: Member, nodes: Array, points: int) -> tuple[Array, Array]:
    """Points of the axis as drawn and unit vectors to its left; both (num_cells points, 2)."""
    mesh, parts = solution.grid.mesh, np.linspace(0.0, 1.0, points)
    start, end, *between = solution.grid.nodes_of_cells[solution.grid.cells_of(beam)].T
    chains = nodes[np.column_stack([start, *between, end])]
    left = left_of(unit_vectors(mesh.slopes(parts) @ chains))
    return (mesh.weights(parts) @ chains).reshape(-1, 2), left.reshape(-1, 2)


def _draw_areas(axes: Axes, axis: Array, tips: Array, values: Array) -> None:
    """Draw an area for each part of a beam with values of one sign."""
    # Where the sign changes, both areas end in a point of the axis.
    first = np.flatnonzero(values[:-1] * values[1:] < 0.0)
    part = values[first] / (values[first] - values[first + 1])
    zeros = axis[first] + part[:, None] * (axis[first + 1] - axis[first])
    axis, tips = (np.insert(points, first + 1, zeros, axis=0) for points in (axis, tips))
    values = np.insert(values, first + 1, 0.0)
    signs = np.sign(values[:-1] + values[1:])
    for run in np.split(np.arange(len(signs)), np.flatnonzero(np.diff(signs)) + 1):
        if (sign := signs[run[0]]) != 0.0:
            chain = np.append(run, run[-1] + 1)
            outline = np.concatenate([axis[run[:1]], tips[chain], axis[chain[:0:-1]]])
            color = RED if sign > 0 else BLUE
            axes.fill(*outline.T, facecolor=(color, 0.28), edgecolor=color, linewidth=1.0, zorder=2)


def _finish(figure: Figure, axes: Axes, extremes: Sequence[Extreme]) -> None:
    """Fit the figure to what is drawn, and write the extreme values where they cover nothing."""
    without_texts = axes.dataLim.frozen()
    written: list[Annotation] = []
    _fit(figure, axes)
    # Room for the texts changes the scale, and with it what is beside them.
    for _ in range(3):
        for text in written:
            text.remove()
        written = _write(figure, axes, extremes)
        axes.dataLim.set(without_texts)
        drawing.make_room(figure, axes)
        _fit(figure, axes)


def _fit(figure: Figure, axes: Axes) -> None:
    """Make the figure as wide and high as what is drawn, at the largest scale that fits."""
    axes.autoscale_view()
    figure.draw_without_rendering()
    title = 2 * half_size(figure, axes, axes.get_title(loc="left"), TITLE_SIZE)[0]
    width, height = np.ptp(axes.get_xlim()), np.ptp(axes.get_ylim())
    least = np.array([max(LEAST[0], title / POINTS + AROUND[0]), LEAST[1]])
    room = np.array(MOST) - AROUND
    inches = np.array([width, height]) * np.min(room / (width, height))
    figure.set_size_inches(np.clip(inches + AROUND, np.minimum(least, MOST), MOST))


def _write(figure: Figure, axes: Axes, extremes: Sequence[Extreme]) -> list[Annotation]:
    """Write extreme values beside the areas and lines of a style.picture."""
    if not extremes:
        return []
    figure.draw_without_rendering()

    def in_points(xy: Any) -> Array:
        return np.asarray(axes.transData.transform(xy) * POINTS / figure.dpi)

    lines = _lines(axes, in_points)
    labels, halves = [], []
    for number, (text, color, tip, outward) in enumerate(extremes):
        # Straight away from the axis first, then more and more aside
        turns = np.radians((0, 40, -40, 75, -75, 105, -105))
        ways = directions(math.atan2(outward[1], outward[0]) + turns)
        at = in_points(tip)
        labels.append(Label(text, color, number, tuple(Spot(at, way) for way in ways)))
        halves.append(half_size(figure, axes, text, LABEL_SIZE, weight="bold"))
    written = []
    for one in place(labels, halves, lines):
        text, color, number, _ = one.label
        (x, y), (right, up) = extremes[number].tip, one.center - one.spot
        arrow = {"arrowstyle": "-", "color": color, "linewidth": 0.8}
        written.append(
            axes.annotate(
                text, (x, y), (right, up), textcoords="offset points", ha="center", va="center",
                fontsize=LABEL_SIZE, color=color, weight="bold", zorder=6,
                arrowprops=arrow if len(leader_of(one)) else None,
            )
        )  # fmt: skip
    return written


def _lines(axes: Axes, in_points: Callable[[Any], Array]) -> Array:
    """Lines that texts should not cover, those within areas too; (n, 4); points."""
    found: list[Array] = [np.empty((0, 4))]
    for line in axes.lines:
        chain = in_points(line.get_xydata())
        if len(chain) == 1:  # a symbol
            half = line.get_markersize() / 2
            chain = chain + np.array([[-half, -half], [half, half], [-half, half], [half, -half]])
        found.append(segments(chain))
    for patch in axes.patches:
        outline = in_points(patch.get_path().vertices)
        found.append(segments(outline))
        # Ordinates, from a point of the outline to the one across the axis
        for part in np.linspace(0.0, 1.0, 5):
            between = outline[:-1] + part * np.diff(outline, axis=0)
            feet = (outline[1:] - part * np.diff(outline, axis=0))[::-1]
            found.append(np.hstack([between, feet])[1 : len(outline) // 2])
    return np.concatenate(found)
