# SPDX-License-Identifier: MIT
"""Pictures of modes and buckling shapes, by Matplotlib."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np

from ufl_beam.analysis.modes import AMPLITUDE, Shapes
from ufl_beam.errors import SceneError
from ufl_beam.plotting.connector_glyphs import BLUE, SKY
from ufl_beam.plotting.plots import (
    draw_axes,
    draw_symbols,
    draw_undeformed,
    moved_points,
    picture,
    plane_stage,
)

if TYPE_CHECKING:
    from matplotlib.figure import Figure


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
            draw_undeformed(axes, stage)
            draw_axes(axes, swing, back, color=SKY, linewidth=1.6, zorder=2)
            draw_axes(axes, swing, there, color=BLUE, linewidth=2.6, zorder=4)
            draw_symbols(axes, stage.pose(0))
            axes.set_title(f"{k}: {shapes.titles[k]}", loc="left")
            axes.set(aspect="equal", xlim=(low[0] - room, high[0] + room))
            axes.set_ylim(low[1] - room, high[1] + room)
    return figure
