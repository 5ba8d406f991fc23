# SPDX-License-Identifier: MIT
"""Pictures of recorders: envelopes on the frame, cycles of stress and their damage."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from ufl_beam.arrays import Array
from ufl_beam.errors import SceneError
from ufl_beam.output.extremes import Extremes
from ufl_beam.output.fatigue import Fatigue, HotSpot
from ufl_beam.plotting.diagrams import draw_diagrams, finish
from ufl_beam.plotting.drawing import draw_axes, draw_symbols, plane_size, plane_stage
from ufl_beam.plotting.style import (
    BLUE,
    INK,
    RED,
    RESULTANTS,
    draw_bar,
    picture,
    plane_axes,
    require_choice,
)
from ufl_beam.simulation.solution import Solution

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

CLASSES = 40
"""Classes of ranges and of means in pictures."""


def plot_extremes(solution: Solution, extremes: Extremes, what: str = "M") -> Figure:
    """Draw the envelope of a section force on the frame: maxima red, minima blue.

    As in :func:`plot`, on the undeformed axis; the values of each cell may be of different times.

    Args:
        solution: Of the run that the extremes were recorded in.
        extremes: The recorder.
        what: "N", "V" or "M".

    Raises:
        SceneError: Unknown ``what``, or the extremes are of another scene or of no run.

    Example:
        >>> extremes = ub.Extremes()
        >>> run = ub.simulate(scene, ub.Midpoint(), t=(0, 1), dt=0.05, record=extremes)
        >>> ub.plot_extremes(run, extremes, "M").savefig("extremes.png")
    """
    require_choice(what, RESULTANTS, "plot_extremes: what")
    index, points = list(RESULTANTS).index(what), solution.grid.points
    reached = [extremes.section_forces(beam) for beam in solution.scene.beams]
    # Constant in each cell
    diagrams = [
        [np.repeat(values[:, index, None], 2, axis=1) for values in one]
        for one in ([e.high for e in reached], [e.low for e in reached])
    ]
    stage = plane_stage(solution, [0], 1.0)
    pose = stage.pose(0)
    with picture(plane_size(points, pose.points())) as figure:
        until = solution.parameter.at(solution.times[-1])
        axes = plane_axes(figure, f"extremes of the {RESULTANTS[what][0]} {what} until {until}")
        found = draw_diagrams(axes, solution, what, diagrams, points)
        draw_axes(axes, solution, points, color=INK, linewidth=2.6, zorder=4)
        draw_symbols(axes, pose)
        finish(figure, axes, found)
    return figure


def plot_cycles(fatigue: Fatigue, spot: HotSpot) -> Figure:
    """Draw rainflow matrix, spectrum and damage of the stress cycles at a place.

    On the left the rainflow matrix; in the middle how many cycles have at least a range, and the
    curve that they can be borne for; on the right which part of the damage each class does.

    Args:
        fatigue: Recorder of a run.
        spot: One of its places.

    Raises:
        SceneError: The spot is none of them, nothing was run, or the stress never turned.

    Example:
        >>> spot = ub.HotSpot.fibre(beam.start, y=0.1, E=210e9)
        >>> fatigue = ub.Fatigue(spot, ub.SNCurve.eurocode(71e6))
        >>> shake = ub.PointLoad(beam.end, force=(0, 5e4), time=np.sin)
        >>> shaken = ub.Scene([beam], supports=scene.supports, loads=[shake])
        >>> run = ub.simulate(shaken, ub.Static(), t=(0, 20), dt=0.2, record=fatigue)
        >>> ub.plot_cycles(fatigue, spot).savefig("cycles.png")
    """
    cycles, curve = fatigue.cycles(spot), fatigue.curve
    if not len(cycles.range):
        raise SceneError(f"plot_cycles: the stress at {spot} never turned")
    ranges, means = 1e-6 * cycles.range, 1e-6 * cycles.mean
    done = cycles.count / curve.endurance(cycles.range, cycles.mean)
    edges = np.linspace(0.0, ranges[-1] * (1 + 1e-9), CLASSES + 1)
    with picture((13.0, 5.0)) as figure:
        matrix, spectrum, damage = figure.subplots(1, 3, sharey=True, width_ratios=(1.25, 1, 0.8))
        _draw_matrix(figure, matrix, edges, ranges, means, cycles.count)
        matrix.set(xlabel="mean stress (MPa)", ylabel="stress range (MPa)", title="cycles")
        more = np.cumsum(cycles.count[::-1])[::-1]
        spectrum.plot(more, ranges, color=BLUE, drawstyle="steps-post", label="reached")
        some = np.linspace(edges[1] / 10, 1.1 * edges[-1], 1000)
        spectrum.plot(curve.endurance(1e6 * some), some, color=INK, lw=1.4, ls="--", label="borne")
        spectrum.set(xscale="log", xlabel="number of cycles", title="spectrum and S-N curve")
        spectrum.legend(loc="lower left")
        total = done.sum()
        parts, _ = np.histogram(ranges, edges, weights=done / (total or 1.0))
        damage.barh(edges[:-1], 100 * parts, np.diff(edges), align="edge", color=RED, alpha=0.6)
        damage.set(xlabel="part of the damage (%)", title=f"damage {total:.3g}")
        for axes in (matrix, spectrum, damage):
            axes.set_title(axes.get_title(), loc="left")
            axes.set_title("")
            axes.tick_params(labelsize=12, color="#888888")
            axes.set_ylim(0.0, 1.1 * edges[-1])
    return figure


def _draw_matrix(
    figure: Figure, axes: Axes, edges: Array, ranges: Array, means: Array, count: Array
) -> None:
    """Number of cycles by range and mean; none is white."""
    from matplotlib.colors import LogNorm

    middle, half = (means.max() + means.min()) / 2, 0.6 * max(np.ptp(means), edges[-1] / 4)
    columns = np.linspace(middle - half, middle + half, CLASSES + 1)
    found, _, _ = np.histogram2d(means, ranges, (columns, edges), weights=count)
    shown = np.where(found > 0, found, np.nan).T
    colors = axes.pcolormesh(
        columns, edges, shown, norm=LogNorm(0.5, max(10.0, found.max())),
        cmap="viridis_r", rasterized=True,
    )  # fmt: skip
    draw_bar(figure, axes, colors, "number")
