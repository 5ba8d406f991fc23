# SPDX-License-Identifier: MIT
"""Pictures of modes and buckling shapes, and the work-precision diagram of a trade-off."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import cycle, product
from typing import TYPE_CHECKING

import numpy as np

from ufl_beam.analysis.modes import AMPLITUDE, Shapes
from ufl_beam.analysis.tradeoff_result import Tradeoff
from ufl_beam.errors import SceneError
from ufl_beam.plotting.drawing import (
    draw_axes,
    draw_symbols,
    draw_undeformed,
    moved_points,
    plane_stage,
)
from ufl_beam.plotting.style import BLUE, GREEN, GREY, INK, ORANGE, PINK, RED, SKY, picture

if TYPE_CHECKING:
    from matplotlib.figure import Figure

LEAST_ERROR = 1e-12
"""Errors below are drawn there, in the unit of the quantity."""


def plot_modes(
    shapes: Shapes, which: Sequence[int] = (), *, amplitude: float = AMPLITUDE
) -> Figure:
    """Draw modes side by side, in both directions from the grey undeformed scene.

    Args:
        shapes: Of :func:`modes` or :func:`buckling`.
        which: Their numbers; all by default.
        amplitude: Largest displacement, as a part of the size of the scene.

    Raises:
        SceneError: There is no such shape, or ``amplitude`` is not positive.

    Example:
        >>> ub.plot_modes(ub.modes(scene, 3)).savefig("modes.png")
    """
    chosen = list(which) if len(which) else list(range(len(shapes)))
    if not chosen:
        raise SceneError("plot_modes: there is no shape")
    swings = [shapes.motion(k, amplitude=amplitude, count=2) for k in chosen]
    stages = [plane_stage(swing, [0, 1], 1.0) for swing in swings]
    ends = [(moved_points(s, 0, 1.0), moved_points(s, 1, 1.0)) for s in swings]
    bodies = [stage.pose(n).points() for stage in stages for n in (0, 1)]
    box = np.concatenate(
        [shapes.grid.points, *bodies, *(points for pair in ends for points in pair)]
    )
    low, high = box.min(axis=0), box.max(axis=0)
    # Room for the symbols of supports.
    room = 0.08 * np.hypot(*(high - low))
    width, height = high - low + 2 * room
    columns = min(len(chosen), 3 if height < 0.8 * width else 4)
    rows = -(-len(chosen) // columns)
    with picture((4.0 * columns, rows * (4.0 * height / width + 0.5))) as figure:
        grid = np.ravel(figure.subplots(rows, columns, squeeze=False))
        for axes in grid:
            axes.set_axis_off()
        for k, swing, stage, (there, back), axes in zip(
            chosen, swings, stages, ends, grid, strict=False
        ):
            draw_undeformed(axes, swing, stage)
            draw_axes(axes, swing, back, color=SKY, linewidth=1.6, zorder=2)
            draw_axes(axes, swing, there, color=BLUE, linewidth=2.6, zorder=4)
            draw_symbols(axes, stage.pose(0))
            axes.set_title(f"{k}: {shapes.titles[k]}", loc="left")
            axes.set(aspect="equal", xlim=(low[0] - room, high[0] + room))
            axes.set_ylim(low[1] - room, high[1] + room)
    return figure


def plot_tradeoff(tradeoff: Tradeoff) -> Figure:
    """Draw errors over wall times of all runs, and the recommended run in a ring.

    Each kind of scheme, steps and cells has a colour; the line is that of runs that no other one
    beats in both.  The error is a part of the tolerance, or, with a budget, of the quantity.

    Args:
        tradeoff: What :func:`tradeoff` returned.

    Example:
        >>> tip = {"tip": lambda run: run.position(beam.end)[-1]}
        >>> found = ub.tradeoff(scene, tip, scheme=ub.Static(), t=(0, 1), dt=0.5, tolerance=0.01)
        >>> ub.plot_tradeoff(found).savefig("tradeoff.png")
    """
    with picture((9.0, 6.0)) as figure:
        axes = figure.subplots()
        styles = cycle(product("os^", (BLUE, RED, GREEN, ORANGE, PINK, SKY)))
        for family, (name, style) in enumerate(zip(tradeoff.families, styles, strict=False)):
            marker, color = style
            runs = [run for run in tradeoff.runs if run.refinement.family == family]
            axes.scatter(
                [run.seconds for run in runs],
                [max(tradeoff.ratio(run), LEAST_ERROR) for run in runs],
                s=[30 + 12 * np.log2(run.cells) for run in runs],
                marker=marker, color=color, alpha=0.75, lw=0, label=f"from {name}", zorder=3,
            )  # fmt: skip
        front = tradeoff.front
        seconds, errors = [r.seconds for r in front], [tradeoff.ratio(r) for r in front]
        axes.plot(seconds, np.maximum(errors, LEAST_ERROR), color=INK, lw=1.2, zorder=2)
        best = (tradeoff.best.seconds, max(tradeoff.ratio(tradeoff.best), LEAST_ERROR))
        axes.plot(*best, "o", ms=18, mfc="none", mec=INK, mew=1.8, zorder=4)
        axes.set(xscale="log", yscale="log", xlabel="wall time of a run (s)")
        axes.set_ylabel(f"error ({tradeoff.target.measure})")
        axes.set_title(f"recommended: {tradeoff.best.dials}", loc="left", fontsize=11)
        time, ratio = tradeoff.target.bounds
        for draw, bound in ((axes.axvline, time), (axes.axhline, ratio)):
            if np.isfinite(bound):
                draw(bound, color=GREY, ls="--", lw=1.2, zorder=1)
        figure.legend(
            loc="outside lower center", ncols=2, fontsize=9, title="size: cells", title_fontsize=9
        )
    return figure
