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
from ufl_beam.plotting.positions import FROM_A_SIDE, PICTURE, Canvas, directions
from ufl_beam.plotting.style import POINTS, WHITE, Annotation, Axes, font_size, shade

AROUND, LEAST, MOST = (1.0, 1.2), (3.6, 2.6), (9.0, 6.8)
"""Space for words and numbers around the axes, least size and largest size of a figure; inch."""

SIZE = 8.6, 6.2
"""Size of new figures of scenes in space; inch."""

LEAST_WIDTH = 0.25  # least extent along an axis in space, as a fraction of the largest one
MARGIN = 0.03  # margin around the drawing, as a fraction of the axes
GAPS = (4.0, 14.0)  # candidate distances of a label from its point; points
SPACE = np.array([4.0, 0.0])  # further clearance between labels; points
CLEARANCE = 2.0  # clearance around a label; points

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
    points = Canvas(subject, magnify, shown, unit=0.02 * scene.size).points()
    space = POINTS * np.array(size) if ax is None else style.lay_out(ax)
    if scene.in_space:  # beside the scales of three axes
        points, filled = points @ PICTURE[3].T, 0.6 * filled
    # A scene may be a single point.
    scale = max(*np.ptp(points, axis=0) / (filled * space), 1e-3 * scene.size)
    return Canvas(subject, magnify, shown, scale=scale)


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
    for _ in range(2):
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
    """Fit the limits to the data, and the size of a new figure to the limits."""
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


def write_labels(axes: Axes, labels: Sequence[Label]) -> list[Annotation]:
    """Write labels at the candidate positions that cover the least of the drawing.

    A label that would cover a label before it is omitted.
    """
    from matplotlib.backends.backend_agg import RendererAgg

    if not labels:
        return []
    style.lay_out(axes)
    figure = style.parent_figure(axes)
    point = figure.dpi / POINTS  # pixels
    renderer = RendererAgg(*figure.bbox.size, figure.dpi)
    for drawn in sorted([*axes.lines, *axes.collections], key=lambda artist: artist.get_zorder()):
        drawn.draw(renderer)
    # Squares of opacities, so that lines count more than areas
    ink = np.square(np.asarray(renderer.buffer_rgba())[::-1, :, 3] / 255)
    sums = np.pad(ink, ((1, 0), (1, 0))).cumsum(axis=0).cumsum(axis=1)
    written, boxes = list[Any](), np.empty((0, 2, 2))  # corners of the written labels
    for text, color, spots, bold in labels:
        points, ways = (np.array(x) for x in zip(*spots, strict=True))
        mark = axes.annotate(
            text, points[0], (0, 0), textcoords="offset points", color=shade(color), zorder=7,
            ha="center", va="center", size=font_size(13.0 if bold else 10.5), gid="labels",
            weight="bold" if bold else "normal",
            bbox={"facecolor": shade(WHITE), "edgecolor": "none", "alpha": 0.85, "pad": 0.8},
        )  # fmt: skip
        half = np.divide(mark.get_window_extent().size, 2)
        # The box is beyond the line that is perpendicular to the direction at the point.
        offsets = np.concatenate(
            [ways * (gap * point + np.abs(ways) @ half)[:, None] for gap in GAPS]
        )
        centers = np.tile(axes.transData.transform(points), (len(GAPS), 1)) + offsets
        low, high = (centers + k * (half + CLEARANCE * point) for k in (-1, 1))
        covers = ((low[:, None] < boxes[:, 1]) & (high[:, None] > boxes[:, 0])).all(axis=2)
        (x, y), (right, top) = (
            np.clip(np.rint(ends), 0, ink.shape[::-1]).astype(int).T for ends in (low, high)
        )
        inside = sums[top, right] - sums[y, right] - sums[top, x] + sums[y, x]
        cost = inside / point**2 + 0.1 * np.arange(len(centers))
        best = int(np.argmin(np.where(covers.any(axis=1), np.inf, cost)))
        if covers[best].any():
            mark.remove()
            continue
        mark.xy, mark.xyann = points[best % len(points)], offsets[best] / point
        reach = half + SPACE * point
        corners = np.array([centers[best] - reach, centers[best] + reach])
        boxes, written = np.concatenate([boxes, corners[None]]), [*written, mark]
    return written
