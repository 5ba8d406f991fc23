# SPDX-License-Identifier: MIT
"""Pictures of analyses: modes, trade-offs, envelopes of a run, cycles of stress and damage."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import cycle, product
from typing import TYPE_CHECKING

import numpy as np

from ufl_beam.analysis.modes import Shapes
from ufl_beam.analysis.tradeoff_result import Run, Tradeoff
from ufl_beam.arrays import Array
from ufl_beam.display import picture_of
from ufl_beam.errors import SceneError
from ufl_beam.output.extremes import Extremes
from ufl_beam.output.fatigue import Fatigue, HotSpot
from ufl_beam.plotting import drawing, style
from ufl_beam.plotting.diagrams import draw_frame
from ufl_beam.plotting.style import BLUE, GREEN, GREY, INK, ORANGE, PINK, RED, SKY, picture, shade
from ufl_beam.simulation.solution import Solution

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

LEAST_ERROR = 1e-12  # errors below are drawn there, in the unit of the quantity
MODES = 6  # modes in a notebook
CLASSES = 40  # classes of ranges and of means of cycles in pictures


def plot_modes(shapes: Shapes, which: Sequence[int] = (), *, amplitude: float = 0.1) -> Figure:
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
    stages = [drawing.plane_stage(swing, [0, 1], 1.0) for swing in swings]
    box = np.concatenate([stage.points() for stage in stages])
    # Room for the symbols of supports
    room = 0.08 * np.hypot(*np.ptp(box, axis=0))
    corners = np.array([box.min(axis=0) - room, box.max(axis=0) + room])
    width, height = np.ptp(corners, axis=0)
    columns = min(len(chosen), 3 if height < 0.8 * width else 4)
    rows = -(-len(chosen) // columns)
    with picture((4.0 * columns, rows * (4.0 * height / width + 0.5))) as figure:
        grid = np.ravel(figure.subplots(rows, columns, squeeze=False))
        for axes in grid:
            axes.set_axis_off()
        for k, swing, stage, axes in zip(chosen, swings, stages, grid, strict=False):
            there, back = stage.pose(0), stage.pose(1)
            drawing.draw_undeformed(axes, swing, stage)
            drawing.draw_axes(axes, swing, back.nodes, color=SKY, linewidth=1.6, zorder=2)
            drawing.draw_axes(axes, swing, there.nodes, color=BLUE, linewidth=2.6, zorder=4)
            drawing.draw_symbols(axes, there)
            axes.set_title(f"{k}: {shapes.titles[k]}", loc="left")
            axes.set(aspect="equal", xlim=corners[:, 0], ylim=corners[:, 1])
    return figure


@picture_of.register(Shapes)
def picture_of_shapes(shapes: Shapes) -> Figure:
    """Draw the first modes in a notebook."""
    return plot_modes(shapes, range(min(MODES, len(shapes))))


@picture_of.register(Tradeoff)
def plot_tradeoff(tradeoff: Tradeoff, *, ax: Axes | None = None) -> Figure:
    """Draw errors over wall times of all runs, and the recommended run in a ring.

    Each kind of scheme, steps and cells has a colour; the line is that of runs that no other one
    beats in both.  The error is a part of the tolerance, or, with a budget, of the quantity.

    Args:
        tradeoff: Result of :func:`tradeoff`.
        ax: Axes to draw in; by default those of a new figure.

    Raises:
        SceneError: ``ax`` is no axes.

    Example:
        >>> tip = {"tip": lambda run: run.position(beam.end)[-1]}
        >>> found = ub.tradeoff(scene, tip, scheme=ub.Static(), t=(0, 1), dt=0.5, tolerance=0.01)
        >>> ub.plot_tradeoff(found).savefig("tradeoff.png")
    """

    def error(run: Run) -> float:
        return max(tradeoff.ratio(run), LEAST_ERROR)

    with style.panel(ax, (9.0, 6.0)) as axes:
        looks = cycle(product("os^", (BLUE, RED, GREEN, ORANGE, PINK, SKY)))
        for family, (name, look) in enumerate(zip(tradeoff.families, looks, strict=False)):
            marker, color = look
            runs = [run for run in tradeoff.runs if run.refinement.family == family]
            axes.scatter(
                [run.seconds for run in runs], [error(run) for run in runs],
                s=[30 + 12 * np.log2(run.cells) for run in runs],
                marker=marker, color=color, alpha=0.75, lw=0, label=f"from {name}", zorder=3,
            )  # fmt: skip
        front, best = tradeoff.front, tradeoff.best
        axes.plot(
            [r.seconds for r in front], [*map(error, front)], color=shade(INK), lw=1.2, zorder=2
        )
        axes.plot(
            best.seconds, error(best), "o", ms=18, mfc="none", mec=shade(INK), mew=1.8, zorder=4
        )
        axes.set(xscale="log", yscale="log", xlabel="wall time of a run (s)")
        axes.set_ylabel(f"error ({tradeoff.target.measure})")
        axes.set_title(f"recommended: {best.dials}", loc="left", fontsize=style.font_size(11.0))
        time, ratio = tradeoff.target.bounds
        for draw, bound in ((axes.axvline, time), (axes.axhline, ratio)):
            if np.isfinite(bound):
                draw(bound, color=GREY, ls="--", lw=1.2, zorder=1)
        small = style.font_size(9.0)
        style.draw_legend(
            axes, ax, loc="outside lower center", ncols=2, fontsize=small, title="size: cells",
            title_fontsize=small,
        )  # fmt: skip
    return style.figure_of(axes)


def plot_extremes(
    solution: Solution, extremes: Extremes, what: str = "M", *, ax: Axes | None = None
) -> Figure:
    """Draw the envelope of a section force on the frame: maxima red, minima blue.

    As in :func:`plot`, on the undeformed axis; the values of each point may be of different times.

    Args:
        solution: Of the run that the extremes were recorded in.
        extremes: The recorder.
        what: "N", "V" or "M".
        ax: Axes to draw in; by default those of a new figure.

    Raises:
        SceneError: Unknown ``what``, the extremes are of another scene or of no run, or ``ax`` is
            no axes.

    Example:
        >>> extremes = ub.Extremes()
        >>> run = ub.simulate(scene, ub.Midpoint(), t=(0, 1), dt=0.05, record=extremes)
        >>> ub.plot_extremes(run, extremes, "M").savefig("extremes.png")
    """
    style.require_choice(what, style.RESULTANTS, "plot_extremes: what")
    index = list(style.RESULTANTS).index(what)
    reached = [(beam, extremes.section_forces(beam)) for beam in solution.scene.beams]
    diagrams = [
        (beam, values[:, index].reshape(len(solution.grid.cells_of(beam)), -1))
        for beam, found in reached
        for values in (found.high, found.low)
    ]
    until = f"until {solution.parameter.at(solution.times[-1])}"
    title = f"extremes of the {style.RESULTANTS[what][0]} {what}", until
    pose = drawing.plane_stage(solution, [], 1.0).undeformed
    return draw_frame(ax, solution, -1, pose, title, what, diagrams)


def plot_cycles(fatigue: Fatigue, spot: HotSpot) -> Figure:
    """Draw rainflow matrix, spectrum and damage of the stress cycles at a place.

    On the left the rainflow matrix; in the middle the number of cycles above each range, with the
    S-N curve; on the right the part of the damage by each class of ranges.

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
        _draw_matrix(matrix, edges, ranges, means, cycles.count)
        matrix.set(xlabel="mean stress (MPa)", ylabel="stress range (MPa)")
        more = np.cumsum(cycles.count[::-1])[::-1]
        spectrum.plot(more, ranges, color=BLUE, drawstyle="steps-post", label="reached")
        some = np.linspace(edges[1] / 10, 1.1 * edges[-1], 1000)
        spectrum.plot(
            curve.endurance(1e6 * some), some, color=shade(INK), lw=1.4, ls="--", label="borne"
        )
        spectrum.set(xscale="log", xlabel="number of cycles")
        spectrum.legend(loc="lower left")
        total = done.sum()
        parts, _ = np.histogram(ranges, edges, weights=done / (total or 1.0))
        damage.barh(edges[:-1], 100 * parts, np.diff(edges), align="edge", color=RED, alpha=0.6)
        damage.set(xlabel="part of the damage (%)")
        matrix.set_ylim(0.0, 1.1 * edges[-1])
        titles = "cycles", "spectrum and S-N curve", f"damage {total:.3g}"
        for axes, title in zip((matrix, spectrum, damage), titles, strict=True):
            axes.set_title(title, loc="left")
    return figure


def _draw_matrix(axes: Axes, edges: Array, ranges: Array, means: Array, count: Array) -> None:
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
    style.draw_bar(axes, colors, "number")
