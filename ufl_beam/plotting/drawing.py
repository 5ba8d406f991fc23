# SPDX-License-Identifier: MIT
"""Geometry and drawing of a solution in its plane, shared by all its pictures."""

from __future__ import annotations

import math
from collections import defaultdict
from collections.abc import Iterable, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from ufl_beam.arrays import Array
from ufl_beam.plotting import symbols
from ufl_beam.plotting.geometry import joined
from ufl_beam.plotting.model_sheet import SHORT_BEAM, SMALLEST, SYMBOL
from ufl_beam.plotting.scene_layout import Pose, Stage
from ufl_beam.plotting.style import GREY, INK, POINTS, WHITE, Stroke, shade
from ufl_beam.plotting.symbols import Outlines
from ufl_beam.simulation.solution import Solution

if TYPE_CHECKING:
    from matplotlib.axes import Axes


def evenly(solution: Solution, count: int) -> list[int]:
    """Choose numbers of so many kept states, evenly spaced in time or along a path."""
    progress = solution.progress
    return nearest(progress, np.linspace(progress[0], progress[-1], count))


def nearest(kept: Array, times: Sequence[float] | Array) -> list[int]:
    """Find the numbers of the kept times nearest to ``times``, ascending."""
    return [int(np.argmin(np.abs(kept - t))) for t in sorted(times)]


def plane_size(points: Array) -> tuple[float, float]:
    """Choose the size of a figure: 9 inches wide unless its points stand upright."""
    width, height = np.ptp(points, axis=0)
    return 9.0, float(np.clip(8.0 * height / max(width, 1e-12), 3.2, 6.8))


def plane_stage(solution: Solution, shown: Sequence[int], magnify: float) -> Stage:
    """Make a stage whose symbols (m) are as large as those of supports, which are in points."""
    points = Stage(solution, magnify, 0.02 * solution.scene.size, shown).points()
    width, height = np.ptp(points, axis=0)
    inches = plane_size(points)
    scale = max(1.12 * width / (inches[0] - 0.9), 1.20 * height / (inches[1] - 1.1))
    return Stage(solution, magnify, scale * SYMBOL / POINTS, shown)


def draw_axes(axes: Axes, solution: Solution, points: Array, **line: Any) -> None:
    """Draw the axes of all beams through these points."""
    grid = solution.grid
    chains = [points[grid.nodes_along(beam)] for beam in solution.scene.beams]
    axes.plot(*joined(chains).T, **line)


def draw_undeformed(axes: Axes, solution: Solution, stage: Stage) -> None:
    """Draw undeformed beams, bodies and rods in grey."""
    pose = stage.undeformed
    draw_axes(axes, solution, pose.nodes, color=GREY, linewidth=1.2, zorder=1)
    strokes = (*symbols.bodies(pose), *symbols.rods(pose))
    axes.plot(*joined(s.points for s in strokes).T, color=GREY, linewidth=1.2, zorder=1)


def draw_symbols(axes: Axes, pose: Pose) -> None:
    """Draw bodies, joints, connectors, supports and masses."""
    draw_strokes(axes, (*symbols.bodies(pose), *symbols.rods(pose)))
    draw_fixings(axes, pose)
    draw_strokes(axes, symbols.centres(pose))
    # Pins shrink where beams are short, as in pictures of the model.
    lengths = [math.dist(beam.start.point, beam.end.point) for beam in pose.stage.scene.beams]
    typical = SYMBOL * np.median(lengths or [math.inf]) / pose.stage.unit
    shrunk = float(np.clip(typical / SHORT_BEAM, SMALLEST, 1.0))
    pins = [*symbols.pins(pose)]
    edge = shade(INK)
    for turns, marker, size, inside in ((False, "s", 6.0, INK), (True, "o", 8.0, WHITE)):
        at = np.reshape([pin.at for pin in pins if pin.turns == turns], (-1, 2))
        axes.plot(
            *at.T, marker, ms=shrunk * size, mfc=shade(inside), mec=edge, mew=shrunk * 1.6, zorder=5
        )
    draw_masses(axes, pose, edge)


def draw_strokes(axes: Axes, strokes: Iterable[Stroke], color: Any = None) -> None:
    """Draw lines and areas, in their own colours or all in one."""
    lines: defaultdict[tuple[str, float, float], list[Array]] = defaultdict(list)
    for points, own, weight, fill, layer in strokes:
        if fill is None:
            lines[own, weight, layer].append(points)
        else:
            edge = shade(own) if color is None else color
            inside = shade(fill) if color is None else (color, 0.15)
            axes.fill(
                *points.T, facecolor=inside, edgecolor=edge, joinstyle="round", linewidth=weight,
                zorder=layer,
            )  # fmt: skip
    for (own, weight, layer), alike in lines.items():
        axes.plot(
            *joined(alike).T, color=shade(own) if color is None else color, linewidth=weight,
            solid_joinstyle="round", zorder=layer,
        )  # fmt: skip


def draw_masses(axes: Axes, pose: Pose, color: Any) -> None:
    """Draw dots at the point masses."""
    at = np.reshape([pose.at(mass.place) for mass in pose.stage.scene.masses], (-1, 2))
    axes.plot(*at.T, "o", ms=10.0, color=color, zorder=5)


def draw_fixings(axes: Axes, pose: Pose) -> None:
    """Draw rails, connectors, and symbols at the supports; orange ones move."""
    from matplotlib.markers import MarkerStyle
    from matplotlib.path import Path

    draw_strokes(axes, (*symbols.rails(pose), *symbols.connectors(pose)))
    places: defaultdict[tuple[Outlines, float, str], list[Array]] = defaultdict(list)
    for at, angle, outlines, color, _ in symbols.footings(pose):
        places[outlines, angle, color].append(at)
    for (outlines, angle, color), alike in places.items():
        symbol = MarkerStyle(Path.make_compound_path(*map(Path, outlines))).rotated(rad=angle)
        axes.plot(
            *np.transpose(alike), marker=symbol, ms=24.0, mfc=color, mec=color, mew=0.5,
            linestyle="none", zorder=3.5,
        )  # fmt: skip
