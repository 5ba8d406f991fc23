# SPDX-License-Identifier: MIT
"""Labels of pictures of scenes, and axes and sizes of figures that the pictures fill."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from typing import Any, NamedTuple

import numpy as np

from ufl_beam.arrays import Array
from ufl_beam.errors import ArgumentError
from ufl_beam.model.scene import Scene
from ufl_beam.output.states import States
from ufl_beam.plotting import style
from ufl_beam.plotting.positions import FROM_A_SIDE, PICTURE, Canvas, directions, joined, segments
from ufl_beam.plotting.style import BLUE, POINTS, RED, WHITE, Annotation, Axes, font_size, shade

AROUND, LEAST, MOST = (1.0, 1.2), (3.6, 2.6), (9.0, 6.8)
"""Space for words and numbers around the axes, least size and largest size of a figure; inch."""

SIZE = 8.6, 6.2
"""Size of new figures of scenes in space; inch."""

LEAST_WIDTH = 0.25  # least extent along an axis in space, as a fraction of the largest one
MARGIN = 0.03  # margin around the drawing, as a fraction of the axes
GAPS = (4.0, 14.0)  # candidate distances of a label from its point; points
TICKS = 55.0, 26.0  # least distances of ticks along x and y; points
MOST_TICKS = 8  # largest number of intervals between ticks along an axis
SPACE = np.array([4.0, 0.0])  # further clearance between labels; points
CLEARANCE = 2.0  # clearance around a label; points
AREAS = RED, BLUE  # groups of filled areas that labels should not cover

Spot = tuple[Array, Array]  # point, and the direction from there to a label; (2,) or (3,) each


@contextmanager
def scene_axes(ax: Axes | None, scene: Scene, title: str) -> Iterator[Any]:
    """Open axes of a scene, in space with z up; :func:`arrange` sets their limits."""
    if scene.in_space and ax is not None and not hasattr(ax, "get_zlim"):
        raise ArgumentError(
            "plot: a scene in space needs axes in space, such as "
            'figure.add_subplot(projection="3d")'
        )
    size, projection = (SIZE, "3d") if scene.in_space else (MOST, None)
    with style.panel(ax, size, projection) as axes:
        if scene.in_space:
            set_up_in_space(axes, title)
        else:
            axes.set(xlabel="x (m)", ylabel="y (m)")
            axes.set_aspect("equal", adjustable="datalim")
            axes.margins(0.06, 0.10)
            axes.set_title(title, loc="left", wrap=True)
        yield axes


def set_up_in_space(axes: Any, title: str) -> None:
    """Set up axes of a scene in space, seen from a side without perspective."""
    axes.set_proj_type("ortho")
    x, y, z = -FROM_A_SIDE
    elevation = math.degrees(math.atan2(z, math.hypot(x, y)))
    axes.view_init(elev=elevation, azim=math.degrees(math.atan2(y, x)))
    axes.computed_zorder = False
    for name in "xyz":
        axis = getattr(axes, f"{name}axis")
        axis.set_pane_color((1.0, 1.0, 1.0, 0.0))
        axis.set_label_text(f"{name} (m)")
        axis.labelpad = 7.0
        axis.set_tick_params(labelsize=font_size(10.5))
    axes.set_title(title, loc="left")


def fitted_canvas(
    subject: Scene | States,
    shown: Sequence[int] = (),
    magnify: float = 1.0,
    ax: Axes | None = None,
    size: tuple[float, float] = (MOST[0] - AROUND[0], MOST[1] - AROUND[1]),
    filled: float = 0.9,
) -> Canvas:
    """Make a canvas for the user's axes, or new ones, whose symbols have a size in points.

    ``size`` is the largest width and height of new axes, inch; the frame fills a fraction of them.
    """
    scene = subject.scene if isinstance(subject, States) else subject
    points = Canvas(subject, magnify, 0.02 * scene.size, shown).points()
    space = POINTS * np.array(size) if ax is None else style.lay_out(ax)
    if scene.in_space:  # beside the scales of three axes
        points, filled = points @ PICTURE[3].T, 0.6 * filled
    # A scene may be a single point.
    scale = max(*np.ptp(points, axis=0) / (filled * space), 1e-3 * scene.size)
    return Canvas.at_scale(subject, magnify, scale, shown)


class Label(NamedTuple):
    """Text of a label with its candidate positions, the best first."""

    text: str
    color: str
    spots: Sequence[Spot]
    bold: bool = False  # bold labels are larger


def around(point: Any, outward: Any = None, radius: float = 0.0) -> list[Spot]:
    """List positions of a label around a point, from a direction more and more to both sides.

    The first direction is to the right by default.
    """
    axes, tilts = PICTURE[len(point)], np.radians((0, 45, -45, 90, -90, 135, -135, 180))
    x, y = axes @ (axes[0] if outward is None else outward)
    ways = directions(np.arctan2(y, x) + tilts) @ axes
    return [(point + radius * way, way) for way in ways]


def arrange(axes: Axes, ax: Axes | None, labels: Sequence[Label] = (), scale: float = 0.0) -> None:
    """Write labels of a picture of a scene; fit limits and figure to the drawing and its labels.

    The first labels have the best places.  The drawing is as large as possible, or a point is at
    least ``scale`` (m) long.  The user's axes ``ax`` and figures in space keep their size.
    """
    if hasattr(axes, "get_zlim"):
        fit_in_space(axes)
        write_labels(axes, [x._replace(spots=_in_picture(axes, x.spots)) for x in labels])
        return
    axes.margins(MARGIN)
    drawn, written = axes.dataLim.frozen(), list[Any]()
    # Space for labels changes the scale, which moves the lines that labels should not cover.
    for _ in range(3):
        _fit(axes, ax, scale)
        for text in written:
            text.remove()
        written = write_labels(axes, labels)
        axes.dataLim.set(drawn)
        to_data = axes.transData.inverted()
        for text in written:
            axes.update_datalim(to_data.transform(text.get_window_extent().get_points()))
        if legend := axes.get_legend():
            x, y = axes.transData.transform(axes.dataLim.min)
            axes.update_datalim([to_data.transform((x, y - legend.get_window_extent().height))])
    _fit(axes, ax, scale)


def fit_in_space(axes: Any, filled: float = 0.0) -> None:
    """Fit limits and numbers of ticks of axes in space to the data, with equal scales.

    The data fill a fraction of the axes; by default there is space for numbers at the axes.
    """
    from matplotlib.ticker import MaxNLocator

    xy, zz = axes.xy_dataLim, axes.zz_dataLim
    low, high = np.array([xy.intervalx, xy.intervaly, zz.intervalx]).T
    half = 0.54 * np.maximum(high - low, LEAST_WIDTH * np.max(high - low))
    for name, at, width in zip("xyz", (low + high) / 2, half, strict=True):
        getattr(axes, f"set_{name}lim")(at - width, at + width)
        locator = MaxNLocator(max(1, round(5 * width / half.max())), min_n_ticks=1)
        getattr(axes, f"{name}axis").set_major_locator(locator)
    zoom = filled * np.linalg.norm(half) / np.max(np.abs(PICTURE[3]) @ half)
    axes.set_box_aspect(half, zoom=zoom or 0.9)
    style.lay_out(axes)
    style.parent_figure(axes).draw_without_rendering()  # projects lines and areas


def _in_picture(axes: Any, spots: Sequence[Spot]) -> list[Spot]:
    """Project positions of a label in space."""
    from mpl_toolkits.mplot3d.proj3d import proj_transform

    M = axes.get_proj()
    return [(np.array(proj_transform(*at, M)[:2]), PICTURE[3] @ way) for at, way in spots]


def _fit(axes: Axes, ax: Axes | None, scale: float) -> None:
    """Fit the limits to the data, the size of a new figure to the limits, and numbers of ticks."""
    from matplotlib.ticker import AutoLocator

    axes.autoscale_view()
    if ax is None:
        figure = style.parent_figure(axes)
        bars, legends = len(figure.axes) - 1, [x.get_window_extent() for x in figure.legends]
        high = sum(legend.height for legend in legends) / figure.dpi
        wide = max((legend.width for legend in legends), default=0.0) / figure.dpi + 0.2
        around = np.add(AROUND, (bars, high))
        span = np.array([np.ptp(axes.get_xlim()), np.ptp(axes.get_ylim())])
        inches = np.min((MOST - around) / span)
        if scale:
            inches = min(inches, 1.0 / (POINTS * scale))
        least = np.minimum((max(LEAST[0] + bars, wide), LEAST[1] + high), MOST)
        figure.set_size_inches(np.clip(inches * span + around, least, MOST))
    axes.apply_aspect()
    size = axes.get_window_extent().size
    for axis, length, width in zip((axes.xaxis, axes.yaxis), size, TICKS, strict=True):
        if isinstance(locator := axis.get_major_locator(), AutoLocator):
            number = length * POINTS / style.parent_figure(axes).dpi / font_size(width)
            locator.set_params(
                nbins=min(max(1, int(number)), MOST_TICKS), steps=[1, 2, 5, 10], min_n_ticks=1
            )


def write_labels(axes: Axes, labels: Sequence[Label]) -> list[Annotation]:
    """Write labels at the candidate positions that cover the least of the drawing.

    A label that would cover a label before it is omitted.
    """
    from matplotlib.transforms import Affine2D

    if not labels:
        return []
    style.lay_out(axes)
    per_pixel = POINTS / style.parent_figure(axes).dpi
    to_points = axes.transData + Affine2D().scale(per_pixel)
    lines, written = np.concatenate([*_obstacles(axes, to_points)]), list[Any]()
    boxes = np.empty((0, 2, 2))  # lower and upper corners of the written labels
    for text, color, spots, bold in labels:
        points, ways = (np.array(x) for x in zip(*spots, strict=True))
        mark = axes.annotate(
            text, points[0], (0, 0), textcoords="offset points", color=shade(color), zorder=7,
            ha="center", va="center", size=font_size(13.0 if bold else 10.5), gid="labels",
            weight="bold" if bold else "normal",
            bbox={"facecolor": shade(WHITE), "edgecolor": "none", "alpha": 0.85, "pad": 0.8},
        )  # fmt: skip
        half = np.multiply(mark.get_window_extent().size, per_pixel / 2)
        # The box is beyond the line that is perpendicular to the direction at the point.
        offsets = np.concatenate([ways * (gap + np.abs(ways) @ half)[:, None] for gap in GAPS])
        centers = np.tile(to_points.transform(points), (len(GAPS), 1)) + offsets
        low, high = centers - half - CLEARANCE, centers + half + CLEARANCE
        covers = ((low[:, None] < boxes[:, 1]) & (high[:, None] > boxes[:, 0])).all(axis=2)
        cost = lengths_inside(low, high, lines) + 0.1 * np.arange(len(centers))
        best = int(np.argmin(np.where(covers.any(axis=1), np.inf, cost)))
        if covers[best].any():
            mark.remove()
            continue
        mark.xy, mark.xyann = points[best % len(points)], offsets[best]
        corners = centers[best] + [-half - SPACE, half + SPACE]
        boxes, written = np.concatenate([boxes, corners[None]]), [*written, mark]
    return written


def _obstacles(axes: Axes, to_points: Any) -> Iterator[Array]:
    """Yield segments that labels should not cover; (n, 4); points."""
    lines = [np.asarray(line.get_xydata()) for line in axes.lines if line.get_linestyle() != "None"]
    yield np.empty((0, 4))
    for collection in axes.collections:
        outlines = [np.asarray(path.vertices) for path in collection.get_paths()]
        lines += outlines
        if collection.get_gid() in AREAS:
            for outline in map(to_points.transform, outlines):
                # Ordinates at and between the points of a diagram; the axis is the second half,
                # before the point that closes the outline.
                half = len(outline) // 2
                feet = np.vstack([outline[:1], outline[-2:half:-1]])
                ordinates = np.hstack([feet, outline[1 : half + 1]])
                yield from (ordinates, (ordinates[1:] + ordinates[:-1]) / 2)
    pieces = segments(to_points.transform(joined(lines)))
    yield pieces[np.isfinite(pieces).all(axis=1)]
    for line in axes.lines:
        if line.get_linestyle() == "None":  # markers
            diagonal = line.get_markersize() / 2 * np.array([-1, -1, 1, 1])
            for ends in (diagonal, diagonal * (1, -1, 1, -1)):
                yield np.tile(to_points.transform(line.get_xydata()), 2) + ends


def lengths_inside(low: Array, high: Array, lines: Array) -> Array:
    """Sum the lengths of segments, (n, 4), inside boxes with corners ``low`` and ``high``."""
    ends = np.sort(lines.reshape(-1, 2, 2), axis=1)
    near = ((ends[:, 0] <= high.max(axis=0)) & (ends[:, 1] >= low.min(axis=0))).all(axis=1)
    first, step = lines[None, near, :2], (lines[:, 2:] - lines[:, :2])[None, near]
    lengths = np.linalg.norm(step[0], axis=1)
    # In a direction perpendicular to it, a segment is either entirely inside or outside.
    step = np.where(step == 0.0, 1e-99, step)
    sides = (low[:, None] - first) / step, (high[:, None] - first) / step
    enter, leave = np.minimum(*sides).max(axis=2), np.maximum(*sides).min(axis=2)
    return np.asarray(np.maximum(np.minimum(leave, 1.0) - np.maximum(enter, 0.0), 0.0) @ lengths)
