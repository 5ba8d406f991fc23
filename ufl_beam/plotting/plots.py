# SPDX-License-Identifier: MIT
"""Pictures of a solution over time, by Matplotlib: its shapes, motions and energies."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np

from ufl_beam.display import picture_of
from ufl_beam.errors import SceneError, require_number
from ufl_beam.model.bodies import Anchor
from ufl_beam.plotting import drawing, style, symbols
from ufl_beam.plotting.style import INK, shade
from ufl_beam.simulation.solution import Solution

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

COMPONENTS = {
    "u": ("displacement", "m"), "v": ("displacement", "m"), "psi": ("rotation", "rad"),
    "du/dt": ("velocity", "m/s"), "dv/dt": ("velocity", "m/s"),
    "dpsi/dt": ("angular velocity", "rad/s"),
}  # fmt: skip

SHAPES = 5  # shapes of a solution in a notebook
VISIBLE = 0.1  # displacements, as a part of the size of the scene, up to which it magnifies them
FACTORS = (1, 2, 5, 10, 20, 50, 100, 200, 500, 1000)  # larger ones would show round-off


def plot_shapes(
    solution: Solution,
    times: Sequence[float] = (),
    *,
    count: int = 8,
    magnify: float = 1.0,
    ax: Axes | None = None,
) -> Figure:
    """Draw successive shapes in one picture, coloured by time or load factor.

    Args:
        solution: Solution to draw.
        times: The times, or the load factors of a path, each replaced by the nearest that was
            kept; s.  Without, ``count`` of them from the first to the last, evenly spaced in time,
            or along the path.
        count: How many, if no times are given.
        magnify: Factor on the displacements.
        ax: Axes to draw in; by default those of a new figure.

    Raises:
        SceneError: ``times`` is one number, ``count`` is less than 1, ``magnify`` is not positive,
            or ``ax`` is no axes.

    Example:
        >>> ub.plot_shapes(solution, count=5, magnify=10).savefig("shapes.png")
    """
    require_number(count, "plot_shapes: count", at_least=1)
    if np.ndim(times) != 1:
        raise SceneError(
            f"plot_shapes: times = {times!r} must be a sequence of times (s); for so many shapes "
            f"say count={times!r}"
        )
    kept = solution.times
    chosen = drawing.nearest(kept, times) if len(times) else drawing.evenly(solution, int(count))
    stage = drawing.plane_stage(solution, chosen, magnify)
    poses = [stage.pose(n) for n in chosen]
    with style.panel(ax, drawing.plane_size(stage.points())) as axes:
        of_time = style.scale("viridis", 0.0, 0.88, kept[chosen].min(), kept[chosen].max())
        style.plane_axes(axes, style.magnified(magnify, ""))
        drawing.draw_undeformed(axes, solution, stage)
        for pose, color in zip(poses, of_time.to_rgba(kept[chosen]), strict=True):
            drawing.draw_strokes(axes, (*symbols.bodies(pose), *symbols.rods(pose)), color)
            drawing.draw_axes(axes, solution, pose.nodes, color=color, linewidth=2.2, zorder=3)
            drawing.draw_masses(axes, pose, color)
        drawing.draw_fixings(axes, poses[-1])
        style.draw_bar(axes, of_time, solution.parameter.name)
    return style.figure_of(axes)


@picture_of.register(Solution)
def picture_of_solution(solution: Solution) -> Figure:
    """Draw shapes on the way in a notebook; displacements that can hardly be seen are magnified."""
    moved = solution.q[:, solution.grid.dofs[:, :2]]
    part = float(np.abs(moved).max(initial=0.0)) / solution.scene.size
    magnify = max(factor for factor in FACTORS if factor == 1 or factor * part <= VISIBLE)
    return plot_shapes(solution, count=SHAPES, magnify=magnify if part > 0 else 1)


def plot_history(
    solution: Solution,
    places: Anchor | Sequence[Anchor],
    *,
    component: str = "v",
    ax: Axes | None = None,
) -> Figure:
    """Draw a component of the motion of one or more places over time.

    Args:
        solution: Solution to draw.
        places: The places.
        component: "u", "v", "psi", "du/dt", "dv/dt" or "dpsi/dt".
        ax: Axes to draw in; by default those of a new figure.

    Raises:
        SceneError: Unknown ``component``, a place that is not in the scene, the velocity of a
            static run, or ``ax`` is no axes.

    Example:
        >>> ub.plot_history(solution, beam.end, component="v").savefig("history.png")
    """
    style.require_choice(component, COMPONENTS, "plot_history: component")
    followed = (places,) if isinstance(places, Anchor) else tuple(places)
    number = list(COMPONENTS).index(component)
    motion = solution.displacement if number < 3 else solution.velocity
    quantity, unit = COMPONENTS[component]
    with style.panel(ax, (8.0, 4.2)) as axes:
        style.time_axes(axes)
        axes.axhline(0.0, color=style.GREY, linewidth=1.0, zorder=1)
        for place in followed:
            axes.plot(solution.times, motion(place)[:, number % 3], label=str(place))
        axes.set_ylabel(f"{quantity} {component.replace('psi', 'ψ')} ({unit})")
        axes.set_xlabel(solution.parameter.name)
        style.draw_legend(axes, ax, loc="outside upper left", ncols=2)
    return style.figure_of(axes)


def plot_energy(solution: Solution) -> Figure:
    """Draw the energy ledger over time or along a path, and below it its imbalance.

    Above: energy in the scene, solid; supplied, dashed; lost, dotted.  Below: the imbalance as a
    part of the energy that went through, with the machine precision for comparison.

    Example:
        >>> ub.plot_energy(solution).savefig("energy.png")
    """
    energy, precision = solution.energy, float(np.finfo(np.float64).eps)
    along = solution.progress
    groups = (energy.state, "-"), (energy.supplied, "--"), (energy.lost, ":")
    entries = [(name, values, line) for group, line in groups for name, values in group.items()]
    with style.picture((8.0, 6.0)) as figure:
        ledger, check = map(
            style.time_axes, figure.subplots(2, 1, sharex=True, height_ratios=(2.4, 1))
        )
        for name, values, line in entries:
            ledger.plot(along, values, line, label=name)
        ledger.set_ylabel("energy (J)")
        ledger.plot(along, energy.total, color=shade(INK), linewidth=1.2, label="in the scene")
        figure.legend(loc="outside upper left", ncols=5)
        part = np.abs(energy.imbalance) / (energy.throughput or 1.0)
        # Where the balance is exact, the logarithm is not: such points stand at the lower edge.
        check.semilogy(along, np.maximum(part, 1e-2 * precision), color=style.RED, linewidth=1.2)
        check.axhline(precision, color=style.GREY, linewidth=1.0, zorder=1)
        check.annotate(
            "machine precision", (1.0, precision), (0, -3), va="top", ha="right",
            fontsize=style.font_size(11.0),
            xycoords=check.get_yaxis_transform(), textcoords="offset points", color=style.FRAME,
        )  # fmt: skip
        check.set_ylim(1e-2 * precision, 10 * max(float(part.max()), 10 * precision))
        check.set_ylabel("imbalance\nper throughput")
        check.set_xlabel(solution.parameter.progress)
    return figure
