# SPDX-License-Identifier: MIT
"""Labels of the peaks of diagrams, and figures that are as large as what is in them."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from ufl_beam.arrays import Array
from ufl_beam.plotting.geometry import directions, joined, segments
from ufl_beam.plotting.labels import Label, Spot, leader_of, place
from ufl_beam.plotting.style import POINTS, figure_of, font_size, half_size, make_room

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.text import Annotation

AROUND, LEAST, MOST = (1.0, 1.2), (3.6, 2.6), (9.0, 6.8)
"""Room for words and numbers around the axes; least and largest size of a figure; inch."""


CROWDED = 0.08  # part of the axes that labels cover, beyond which extreme values alone have some
FEW = 500  # areas whose ordinates texts should not cover
MARGIN = 0.03  # part of the axes beyond what is drawn


class Peak(NamedTuple):
    """Largest value of an area of a diagram."""

    text: str
    color: str
    tip: Array  # point of the diagram; (2,); m
    outward: Array  # unit vector away from the axis; (2,)
    extreme: bool  # largest or least of all


def arrange(axes: Axes, peaks: Sequence[Peak], fit: Callable[[Axes], None]) -> None:
    """Fit limits, and perhaps the figure, to what is drawn; write peaks where they cover least."""
    axes.margins(MARGIN)
    without_texts = axes.dataLim.frozen()
    written: list[Annotation] = []
    fit(axes)
    # Room for the texts changes the scale, and with it what is beside them.
    for _ in range(3):
        for text in written:
            text.remove()
        written = _write(axes, peaks)
        axes.dataLim.set(without_texts)
        make_room(axes)
        fit(axes)


def keep_figure(axes: Axes) -> None:
    """Fit the limits of axes in a figure of the user."""
    axes.autoscale_view()


def fit_figure(axes: Axes) -> None:
    """Make the figure as wide and high as what is drawn, at the largest scale that fits."""
    figure = figure_of(axes)
    axes.autoscale_view()
    figure.draw_without_rendering()
    wide, high = 0.0, 0.0
    for legend in figure.legends:
        box = legend.get_window_extent()
        wide, high = box.width / figure.dpi, box.height / figure.dpi
    around = np.array([AROUND[0], AROUND[1] + high])
    least = np.array([max(LEAST[0], wide + 0.2), LEAST[1] + high])
    span = np.array([np.ptp(axes.get_xlim()), np.ptp(axes.get_ylim())])
    inches = span * np.min((MOST - around) / span)
    figure.set_size_inches(np.clip(inches + around, np.minimum(least, MOST), MOST))


def _write(axes: Axes, peaks: Sequence[Peak]) -> list[Annotation]:
    """Write peaks beside areas and lines; those without room are left out but for extremes."""
    if not peaks:
        return []
    figure = figure_of(axes)
    figure.draw_without_rendering()

    def in_points(xy: Any) -> Array:
        return np.asarray(axes.transData.transform(xy) * POINTS / figure.dpi)

    def half(peak: Peak) -> Array:
        return half_size(axes, peak.text, **_look(peak.extreme))

    box = axes.get_window_extent()
    room = box.width * box.height * (POINTS / figure.dpi) ** 2
    if sum(4 * float(np.prod(half(peak))) for peak in peaks) > CROWDED * room:
        peaks = [peak for peak in peaks if peak.extreme]
    lines = _lines(axes, in_points)
    labels, halves = [], []
    for number, (text, color, tip, outward, _) in enumerate(peaks):
        # Straight away from the axis first, then more and more aside
        turns = np.radians((0, 40, -40, 75, -75, 105, -105, 140, -140))
        ways = directions(math.atan2(outward[1], outward[0]) + turns)
        at = in_points(tip)
        labels.append(Label(text, color, number, tuple(Spot(at, way) for way in ways)))
        halves.append(half(peaks[number]))
    written = []
    for one in place(labels, halves, lines):
        text, color, number, _ = one.label
        look, (x, y), away = _look(peaks[number].extreme), peaks[number].tip, one.center - one.spot
        arrow = None
        if len(leader := leader_of(one)):
            end = (leader[1] - one.center + one.half) / (2 * one.half)
            line = {"arrowstyle": "-", "color": color, "linewidth": 0.8, "shrinkA": 0, "shrinkB": 0}
            arrow = {**line, "relpos": end, "patchA": None}  # by itself it would search that end
        if one.overlap == 0.0 or peaks[number].extreme:
            mark = axes.annotate(
                text, (x, y), (away[0], away[1]), textcoords="offset points", color=color,
                ha="center", va="center", zorder=6, arrowprops=arrow, **look,
            )  # fmt: skip
            written.append(mark)
    return written


def _look(extreme: bool) -> dict[str, Any]:
    """Font of a label; extreme values are bold."""
    weight = "bold" if extreme else "normal"
    return {"size": font_size(13.0 if extreme else 10.0), "weight": weight}


def _lines(axes: Axes, in_points: Callable[[Any], Array]) -> Array:
    """Lines that texts should not cover, those within areas too; (n, 4); points."""
    found: list[Array] = [np.empty((0, 4))]
    for line in axes.lines:
        chain = in_points(line.get_xydata())
        if line.get_linestyle() == "None":  # symbols
            half = line.get_markersize() / 2
            cross = np.array([[-half, -half], [half, half], [-half, half], [half, -half]])
            found += [segments(point + cross) for point in chain]
        else:
            pieces = segments(chain)
            found.append(pieces[np.isfinite(pieces).all(axis=1)])
    paths = [patch.get_path() for patch in axes.patches]
    paths += [path for areas in axes.collections for path in areas.get_paths()]
    outlines = [np.asarray(path.vertices) for path in paths]
    pieces = segments(in_points(joined(outlines)))
    found.append(pieces[np.isfinite(pieces).all(axis=1)])
    for outline in map(in_points, outlines[:FEW]):
        # Ordinates, from a point of the outline to the one across the axis
        for part in (0.0, 0.5):
            between = outline[:-1] + part * np.diff(outline, axis=0)
            feet = (outline[1:] - part * np.diff(outline, axis=0))[::-1]
            found.append(np.hstack([between, feet])[1 : len(outline) // 2])
    return np.concatenate(found)
