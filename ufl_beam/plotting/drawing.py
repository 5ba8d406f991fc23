# SPDX-License-Identifier: MIT
"""Drawing of strokes, and of a solution in its plane, shared by its pictures."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Iterable, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from ufl_beam.arrays import Array
from ufl_beam.plotting import symbols
from ufl_beam.plotting.layout import Pose, Stage, joined
from ufl_beam.plotting.style import GREY, POINTS, require_axes, shade, size_of
from ufl_beam.plotting.symbols import Stroke
from ufl_beam.simulation.solution import Solution

if TYPE_CHECKING:
    from matplotlib.axes import Axes


def draw_strokes(axes: Axes, strokes: Iterable[Stroke], group: str = "", color: Any = None) -> None:
    """Draw lines and areas of a group, in their own colours or all in one.

    Those that look alike are one collection, so that large scenes are drawn fast.
    """
    from matplotlib.collections import LineCollection, PolyCollection

    alike: defaultdict[tuple[str, float, str | None, float], list[Array]] = defaultdict(list)
    for points, own, weight, fill, layer in strokes:
        alike[own, weight, fill, layer].append(points)
    for (own, weight, fill, layer), chains in alike.items():
        edge = shade(own) if color is None else color
        inside = "none" if fill is None else shade(fill) if color is None else (color, 0.15)
        kind = LineCollection if fill is None else PolyCollection
        collection = kind(
            chains, edgecolors=edge, facecolors=inside, linewidths=weight, zorder=layer,
            joinstyle="round", capstyle="round", gid=group,
        )  # fmt: skip
        axes.add_collection(collection)
    axes.autoscale_view()


# -- solutions ---------------------------------------------------------------------------------


def evenly(solution: Solution, count: int) -> list[int]:
    """Choose numbers of so many kept states, evenly spaced in time or along a path."""
    progress = solution.progress
    return nearest(progress, np.linspace(progress[0], progress[-1], count))


def nearest(kept: Array, times: Sequence[float] | Array) -> list[int]:
    """Find the numbers of the kept times nearest to ``times``, ascending."""
    return [int(np.argmin(np.abs(kept - t))) for t in sorted(times)]


def plane_stage(
    solution: Solution,
    shown: Sequence[int],
    magnify: float,
    ax: Axes | None = None,
    size: tuple[float, float] | None = None,
) -> tuple[Stage, tuple[float, float]]:
    """Make a stage whose symbols have their size in points.

    Args:
        solution: Solution to draw.
        shown: Numbers of the kept times.
        magnify: Factor on the displacements.
        ax: Axes of the user, if there are any.
        size: Largest width and height of the figure; by default 9 inches, and what points need that
            do not stand upright; inch.

    Returns:
        The stage, and the size of the figure.
    """
    points = Stage(solution, magnify, 0.02 * solution.scene.size, shown).points()
    extent = np.ptp(points, axis=0)
    high = float(np.clip(8.0 * extent[1] / max(extent[0], 1e-12), 3.2, 6.8))
    size = (9.0, high) if size is None else size
    if ax is None:
        room = np.subtract(size, (0.9, 0.9))  # but for numbers and words
    else:
        require_axes(ax)
        room = size_of(ax) / POINTS
    scale = float(np.max((1.12, 1.20) * extent / room)) / POINTS
    return Stage.at_scale(solution, magnify, scale, shown), size


def draw_beams(axes: Axes, solution: Solution, points: Array, **line: Any) -> None:
    """Draw the axes of all beams through these points."""
    grid = solution.grid
    chains = [points[grid.nodes_along(beam)] for beam in solution.scene.beams]
    axes.plot(*joined(chains).T, **line)


def draw_undeformed(axes: Axes, solution: Solution, stage: Stage) -> None:
    """Draw undeformed beams, bodies and rods in grey."""
    pose = stage.undeformed
    draw_beams(axes, solution, pose.nodes, color=GREY, linewidth=1.2, zorder=1)
    outlines = joined(s.points for s in (*symbols.bodies(pose), *symbols.rods(pose)))
    axes.plot(*outlines.T, color=GREY, linewidth=1.2, zorder=1)


def draw_symbols(axes: Axes, pose: Pose) -> None:
    """Draw bodies, joints, connectors, supports and masses."""
    for group, strokes in symbols.in_plane(pose).items():
        draw_strokes(axes, strokes, group)
