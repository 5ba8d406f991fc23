# SPDX-License-Identifier: MIT
"""Pictures of a solution at one of its times, with diagrams of section forces on the frame."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from itertools import groupby
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from ufl_beam.arrays import Array
from ufl_beam.model.bodies import Member
from ufl_beam.plotting import drawing, style
from ufl_beam.plotting.labels import Label, Spot, leader_of, place
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


def plot_state(solution: Solution, what: str, *, n: int, magnify: float) -> Figure:
    """Draw the frame at a time, with a diagram of a section force; see :func:`plot`."""
    style.require_choice(what, ("shape", *RESULTANTS), "plot: what")
    points = drawing.moved_points(solution, n, magnify)
    stage = drawing.plane_stage(solution, [n], magnify)
    pose = stage.pose(n)
    name = f"{RESULTANTS[what][0]} {what}" if what in RESULTANTS else "shape"
    time = solution.parameter.at(solution.times[n])
    with style.picture(drawing.plane_size(solution.grid.points, points, pose.points())) as figure:
        axes = style.plane_axes(figure, f"{name} at {time}{style.magnified(magnify)}")
        drawing.draw_undeformed(axes, solution, stage)
        extremes: list[Extreme] = []
        if what in RESULTANTS:
            values = [_values(solution, beam, what, n) for beam in solution.scene.beams]
            extremes = draw_diagrams(axes, solution, what, [values], points)
        drawing.draw_axes(axes, solution, points, color=INK, linewidth=2.6, zorder=4)
        drawing.draw_symbols(axes, pose)
        finish(figure, axes, extremes)
    return figure


def moments_at_ends(solution: Solution, beam: Member, n: int = -1) -> Array:
    """Compute the moments at both ends of each cell; (num_cells, 2); N m.

    The moment of a cell is that in its middle.  From there it changes by ``N Γ - V (1 + Σ)`` over a
    unit of length, which is what equilibrium of the cell asks for: moments at the ends of cells are
    in equilibrium with loads, joints and supports at the nodes.  With ``Mesh(degree=1)`` loads on
    beams act at the nodes, too.
    """
    N, V, M = solution.section_forces(beam, n).T
    axial, shear, _ = solution.strains(beam, n).T
    chain = solution.grid.points[solution.grid.vertices_of(beam)]
    half = np.linalg.norm(np.diff(chain, axis=0), axis=1) / 2
    change = half * (N * shear - V * (1.0 + axial))
    return np.column_stack([M - change, M + change])


def _values(solution: Solution, beam: Member, what: str, n: int) -> Array:
    """Values of a section force at both ends of each cell; (num_cells, 2); N, N m."""
    if what == "M":
        return moments_at_ends(solution, beam, n)
    values = solution.section_forces(beam, n)[:, list(RESULTANTS).index(what)]
    return np.column_stack([values, values])


class Extreme(NamedTuple):
    """Largest or least value of a diagram."""

    text: str
    color: str
    tip: Array  # point of the diagram; (2,); m
    outward: Array  # unit vector away from the axis; (2,)


def draw_diagrams(
    axes: Axes, solution: Solution, what: str, diagrams: Sequence[Sequence[Array]], points: Array
) -> list[Extreme]:
    """Draw diagrams of a section force on the frame, to one scale; return both extreme values.

    Each has the values at both ends of the cells of all beams, (num_cells, 2) each; N, N m; the
    nodes are at ``points``, (num_nodes, 2); m.
    """
    index, side = list(RESULTANTS).index(what), -1.0 if what == "M" else 1.0
    beams = solution.scene.beams
    # A strain of 1e-10 is what rounding and the tolerance of the iteration leave behind.
    limits = [(b.section.EA, b.section.GA, b.section.EI / b.section.depth)[index] for b in beams]
    if all(
        np.all(np.abs(f) <= 1e-10 * limit)
        for forces in diagrams
        for f, limit in zip(forces, limits, strict=True)
    ):
        return []
    largest = max(float(np.max(np.abs(f))) for forces in diagrams for f in forces)
    scale = 0.13 * side * math.hypot(*np.ptp(points, axis=0)) / largest
    every, tips, outward = [], [], []
    for forces in diagrams:
        for beam, found in zip(beams, forces, strict=True):
            values = np.where(np.abs(found) > DRAWN_AS_ZERO * largest, found, 0.0)
            chain = points[solution.grid.vertices_of(beam)]
            along = np.diff(chain, axis=0)
            left = along[:, ::-1] * (-1.0, 1.0) / np.linalg.norm(along, axis=1)[:, None]
            ends = np.stack([chain[:-1], chain[1:]], axis=1)
            _draw_areas(axes, ends, values, scale * left)
            every.append(values.ravel())
            tips.append((ends + scale * values[..., None] * left[:, None]).reshape(-1, 2))
            away = side * np.sign(values)[..., None] * left[:, None]
            outward.append(away.reshape(-1, 2))
    found, tip, away = (np.concatenate(parts) for parts in (every, tips, outward))
    return [
        Extreme(with_unit(found[k], RESULTANTS[what][1]), color, tip[k], away[k])
        for k, sign, color in ((np.argmax(found), 1, RED), (np.argmin(found), -1, BLUE))
        if sign * found[k] > 0
    ]


def _draw_areas(axes: Axes, ends: Array, values: Array, left: Array) -> None:
    """Draw the diagram of a beam: an area for each part of it with one sign.

    ``left`` is the ordinate of the value one, (num_cells, 2); the axis has ``ends`` of each cell.
    """
    # Parts of cells: points of the axis, values there, ordinate of the value one
    parts: list[tuple[Array, Array, Array]] = []
    for k in range(len(values)):
        axis, pair, ordinate = ends[k], values[k], left[k]
        if pair[0] * pair[1] < 0.0:
            middle = axis[0] + pair[0] / (pair[0] - pair[1]) * (axis[1] - axis[0])
            parts.append((np.array([axis[0], middle]), pair * (1.0, 0.0), ordinate))
            parts.append((np.array([middle, axis[1]]), pair * (0.0, 1.0), ordinate))
        else:
            parts.append((axis, pair, ordinate))
    for sign, run in groupby(parts, lambda part: np.sign(part[1].sum())):
        if sign != 0.0:
            cells = list(run)
            axis = np.concatenate([points for points, _, _ in cells])
            tips = axis + np.concatenate([np.outer(pair, x) for _, pair, x in cells])
            outline = np.concatenate([axis[:1], tips, axis[:0:-1]])
            color = RED if sign > 0 else BLUE
            axes.fill(*outline.T, facecolor=(color, 0.28), edgecolor=color, linewidth=1.0, zorder=2)


def finish(figure: Figure, axes: Axes, extremes: Sequence[Extreme] = ()) -> None:
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

    def in_points(xy: Array) -> Array:
        return np.asarray(axes.transData.transform(xy) * POINTS / figure.dpi)

    lines = _segments(axes, in_points)
    labels, halves = [], []
    for text, color, tip, outward in extremes:
        # Straight away from the axis first, then more and more aside
        turns = np.radians((0, 40, -40, 75, -75, 105, -105))
        ways = math.atan2(outward[1], outward[0]) + turns
        at = in_points(tip)
        spots = [Spot(at, np.array([math.cos(a), math.sin(a)])) for a in ways]
        labels.append(Label(text, color, 0, tuple(spots)))
        halves.append(half_size(figure, axes, text, LABEL_SIZE, weight="bold"))
    written = []
    for one in place(labels, halves, lines):
        tip = next(e.tip for e in extremes if e.text == one.label.text)
        offset = one.center - one.spot
        arrow = {"arrowstyle": "-", "color": one.label.color, "linewidth": 0.8}
        written.append(
            axes.annotate(
                one.label.text, (tip[0], tip[1]), (offset[0], offset[1]),
                textcoords="offset points", ha="center", va="center", fontsize=LABEL_SIZE,
                color=one.label.color, weight="bold", zorder=6,
                arrowprops=arrow if len(leader_of(one)) else None,
            )
        )  # fmt: skip
    return written


def _segments(axes: Axes, in_points: Callable[[Array], Array]) -> Array:
    """Lines that texts should not cover, those within areas too; (n, 4); points."""
    found = []
    for line in axes.lines:
        chain = in_points(np.asarray(line.get_xydata(), dtype=np.float64))
        if len(chain) == 1:  # a symbol
            half = line.get_markersize() / 2
            chain = chain + np.array([[-half, -half], [half, half], [-half, half], [half, -half]])
        found.append(np.hstack([chain[:-1], chain[1:]]))
    for patch in axes.patches:
        outline = in_points(np.asarray(patch.get_path().vertices, dtype=np.float64))
        found.append(np.hstack([outline[:-1], outline[1:]]))
        count = len(outline) // 2
        # Ordinates, from a point of the outline to the one across the axis
        for part in np.linspace(0.0, 1.0, 5):
            between = outline[:-1] + part * np.diff(outline, axis=0)
            feet = (outline[1:] + part * (outline[:-1] - outline[1:]))[::-1]
            found.append(np.hstack([between[1:count], feet[1:count]]))
    return np.concatenate(found) if found else np.empty((0, 4))
