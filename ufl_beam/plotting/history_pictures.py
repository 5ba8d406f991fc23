# SPDX-License-Identifier: MIT
"""Pictures of a solution over time, of modes, trade-offs, envelopes, studies, and stress cycles."""

from __future__ import annotations

from collections.abc import Sequence
from functools import partial
from numbers import Real
from typing import Any

import numpy as np

from ufl_beam.analysis.modes import Shapes
from ufl_beam.display import html_page
from ufl_beam.errors import ArgumentError, require_all, require_number, require_row
from ufl_beam.model.bodies import AttachmentPoint, BodyPoint, Place
from ufl_beam.output.extremes import Extremes
from ufl_beam.output.history import MOTION
from ufl_beam.plotting import notebook, style, symbols
from ufl_beam.plotting.frame_pictures import (
    Values,
    draw_beams,
    draw_envelope,
    draw_outlines,
    draw_undeformed,
)
from ufl_beam.plotting.labels import (
    arrange,
    fit_in_space,
    fitted_canvas,
    scene_axes,
    set_up_in_space,
)
from ufl_beam.plotting.positions import PICTURE, evenly
from ufl_beam.plotting.style import BLUE, GREY, INK, RED, SKY, Axes, Figure, picture, shade
from ufl_beam.plotting.symbols import draw_strokes
from ufl_beam.simulation.solution import Solution


def _components(names: Sequence[str], rotations: Sequence[str]) -> dict[str, tuple[str, str]]:
    """Return words and units of displacements and rotations, their rates and second rates."""
    orders = (
        ("", "", "", "displacement", "rotation"),
        ("d", "/dt", "/s", "velocity", "angular velocity"),
        ("d2", "/dt2", "/s²", "acceleration", "angular acceleration"),
    )
    return {
        f"{before}{name}{after}": (words[name in rotations], ("m", "rad")[name in rotations] + per)
        for before, after, per, *words in orders for name in (*names, *rotations)
    }  # fmt: skip


COMPONENTS = {d: _components(names[:d], names[d:]) for d, names in MOTION.items()}
"""Components of motions by the number of displacements; rx, ry, rz: of the rotation vector."""

MOST_MODES, NUM_SHAPES = 6, 5  # numbers of modes, and of shapes of a solution, in a notebook
VISIBLE = 0.1  # largest magnified displacement in a notebook, as a fraction of the scene's size
FACTORS = (1, 2, 5, 10, 20, 50, 100, 200, 500, 1000)  # magnifications; more would show round-off


def draw_shapes(
    solution: Solution,
    times: Sequence[float] | None = None,
    *,
    count: int = 8,
    magnify: float = 1.0,
    ax: Axes | None = None,
) -> Figure:
    """Draw successive shapes in one picture, coloured by time or along the path.

    By default, ``count`` recorded states are drawn, evenly spaced in time or along the path.
    The colour bar of a path has the load factors, which may repeat.
    """
    from matplotlib.colors import to_hex

    require_number(count, "plot: count", at_least=1)
    instants = solution.times
    if times is None:
        chosen = evenly(solution.progress, int(count))
    else:
        if isinstance(times, Real):
            raise ArgumentError(
                f"plot: times = {times!r} must be a sequence of times (s); for a number of shapes "
                f"give count={times!r}"
            )
        requested = require_row(times, "plot: times")
        if not len(requested):
            raise ArgumentError("plot: times is empty; give times (s), or count=")
        chosen = [int(np.argmin(np.abs(instants - t))) for t in np.sort(requested)]
    canvas, along = fitted_canvas(solution, chosen, magnify, ax), solution.progress
    shapes = [canvas.shape(n) for n in chosen]
    with scene_axes(ax, solution.scene, style.magnified(magnify, "")) as axes:
        colors = style.scale("viridis", 0.0, 0.88, *np.sort(along[chosen])[[0, -1]])
        draw_undeformed(axes, solution, canvas)
        for shape, color in zip(shapes, map(to_hex, colors.to_rgba(along[chosen])), strict=True):
            moving = *symbols.bodies(shape), *symbols.rods(shape)
            draw_strokes(axes, {"moving": moving}, color)
            draw_beams(axes, solution, shape.nodes, color=color, linewidth=2.2, zorder=3)
            draw_strokes(axes, {"masses": symbols.masses(shape, color)})
        last = shapes[-1]
        still = *symbols.rails(last), *symbols.connectors(last), *symbols.supports(last)
        draw_strokes(axes, {"still": still})
        bar = style.draw_bar(axes, colors, solution.parameter.name)
        if solution.parameter.progress != solution.parameter.name:
            bar.formatter = lambda x, _: style.number(np.interp(x, along, instants))
        arrange(axes, ax)
    return style.parent_figure(axes)


@html_page.register
def solution_page(solution: Solution) -> str:
    """Write a solution as HTML: its summary, the energy ledger, and successive shapes.

    Small displacements are magnified.
    """
    text = notebook.lines(*solution.summary()) + notebook.energy_page(solution.energy)
    text += notebook.lines(solution.imbalance_message)
    numbering = solution.numbering
    moved = solution.q[:, numbering.dofs[:, : numbering.displacements]]
    fraction = float(np.abs(moved).max(initial=0.0)) / solution.scene.size
    magnify = max(x for x in FACTORS if x == 1 or (fraction > 0.0 and x * fraction <= VISIBLE))
    shapes = partial(draw_shapes, solution, count=NUM_SHAPES, magnify=magnify)
    return text + notebook.image("shapes", shapes)


def draw_history(
    solution: Solution,
    places: AttachmentPoint | Sequence[AttachmentPoint],
    *,
    component: str = "v",
    ax: Axes | None = None,
) -> Figure:
    """Draw a component of the motion of one or more places over time."""
    components = COMPONENTS[solution.numbering.displacements]
    style.require_option(component, components, "plot: component")
    followed = (places,) if isinstance(places, AttachmentPoint) else places
    followed = require_all(followed, "plot: places", (Place, BodyPoint))
    if not followed:
        raise ArgumentError("plot: places is empty; give places whose motion is drawn")
    order, number = divmod(list(components).index(component), len(components) // 3)
    motion = (solution.displacement, solution.velocity, solution.acceleration)[order]
    quantity, unit = components[component]
    with style.panel(ax, (8.0, 4.2)) as axes:
        style.time_axes(axes)
        style.zero_lines(axes, x=False)
        for place in followed:
            axes.plot(solution.times, motion(place)[:, number], label=str(place))
        axes.set_ylabel(f"{quantity} {component.replace('psi', 'ψ')} ({unit})")
        axes.set_xlabel(solution.parameter.name)
        style.draw_legend(axes, ax, loc="outside upper left", ncols=2)
    return style.parent_figure(axes)


def draw_energy(solution: Solution) -> Figure:
    """Draw the energy ledger over time or along a path, and its imbalance below.

    Above, energies in the scene are solid, supplied energies dashed, and lost energies dotted.
    Below is the imbalance divided by the transferred energy, with the machine precision for
    comparison.
    """
    energy, precision = solution.energy, float(np.finfo(np.float64).eps)
    along = solution.progress
    groups = (energy.state, "-"), (energy.supplied, "--"), (energy.lost, ":")
    curves = [(name, values, line) for group, line in groups for name, values in group.items()]
    with style.picture((8.0, 6.0)) as figure:
        ledger, check = map(
            style.time_axes, figure.subplots(2, 1, sharex=True, height_ratios=(2.4, 1))
        )
        for name, values, line in curves:
            ledger.plot(along, values, line, label=name)
        ledger.set_ylabel("energy (J)")
        ledger.plot(along, energy.total, color=shade(INK), linewidth=1.2, label="in the scene")
        figure.legend(loc="outside upper left", ncols=5)
        fraction = np.abs(energy.imbalance) / (energy.energy_transferred or 1.0)
        # An imbalance of exactly zero has no logarithm; it is drawn at the lower edge.
        drawn = np.maximum(fraction, 1e-2 * precision)
        check.semilogy(along, drawn, color=RED, linewidth=1.2)
        check.axhline(precision, color=GREY, linewidth=1.0, zorder=1)
        check.annotate(
            "machine precision", (1.0, precision), (0, -3), va="top", ha="right",
            fontsize=style.font_size(11.0),
            xycoords=check.get_yaxis_transform(), textcoords="offset points", color=style.FRAME,
        )  # fmt: skip
        check.set_ylim(1e-2 * precision, 10 * max(float(fraction.max()), 10 * precision))
        check.set_ylabel("imbalance per\ntransferred energy")
        check.set_xlabel(solution.parameter.progress)
    return figure


# -- analyses ----------------------------------------------------------------------------------


def draw_modes(
    shapes: Shapes, *, numbers: Sequence[int] | None = None, amplitude: float = 0.1
) -> Figure:
    """Draw modes side by side, in both directions from the undeformed scene, which is grey."""
    chosen = range(len(shapes)) if numbers is None else numbers
    chosen = require_all(chosen, "plot: numbers", (int, np.integer))
    if not chosen:
        raise ArgumentError(f"plot: {'numbers is empty' if len(shapes) else 'there is no shape'}")
    swings = [shapes.motion(k, amplitude=amplitude, count=2) for k in chosen]
    in_space = shapes.scene.in_space
    size = 4.0, 4.0 if in_space else np.inf
    stages = [fitted_canvas(swing, [0, 1], size=size) for swing in swings]
    points = np.concatenate([canvas.points() for canvas in stages])
    box = points @ PICTURE[points.shape[1]].T
    # space for the symbols of supports
    margin = 0.08 * np.hypot(*np.ptp(box, axis=0))
    corners = np.array([box.min(axis=0) - margin, box.max(axis=0) + margin])
    width, height = (1.0, 1.0) if in_space else np.ptp(corners, axis=0)
    columns = min(len(chosen), 3 if height < 0.8 * width else 4)
    rows = -(-len(chosen) // columns)
    with picture((4.0 * columns, rows * (4.0 * height / width + 0.5))) as figure:
        projection = {"projection": "3d" if in_space else None}
        panels = figure.subplots(rows, columns, squeeze=False, subplot_kw=projection).ravel()
        for axes in panels:
            axes.set_axis_off()
        for k, swing, canvas, axes in zip(chosen, swings, stages, panels, strict=False):
            forward, backward = canvas.shape(0), canvas.shape(1)
            draw_undeformed(axes, swing, canvas)
            draw_outlines(axes, swing, backward, color=SKY, linewidth=1.6, zorder=2)
            draw_beams(axes, swing, forward.nodes, color=BLUE, linewidth=2.6, zorder=4)
            draw_strokes(axes, symbols.all_symbols(forward))
            title = f"{k}: {shapes.titles[k]}"
            if in_space:
                set_up_in_space(axes, title)
                axes.auto_scale_xyz(*points.T, had_data=True)
                fit_in_space(axes, 1.0)
            else:
                axes.set_title(title, loc="left")
                axes.set(aspect="equal", xlim=corners[:, 0], ylim=corners[:, 1])
    return figure


@html_page.register
def shapes_page(shapes: Shapes) -> str:
    """Write modes as HTML: their frequencies or load factors, and pictures of the first modes."""
    rows = [(str(k), title) for k, title in enumerate(shapes.titles)]
    first = range(min(MOST_MODES, len(shapes)))
    return notebook.table((shapes.word, ""), rows) + notebook.image(
        "modes", partial(draw_modes, shapes, numbers=first)
    )


def draw_extremes(extremes: Extremes, *, quantity: str = "M", ax: Axes | None = None) -> Figure:
    """Draw maxima and minima of a section force on the undeformed frame, as two diagrams.

    Positive values are red, negative values blue.  The values may occur at different times.
    """
    solution = extremes.solution
    until = f"until {solution.parameter.at(solution.times[-1])}"
    title = f"extremes of the {style.resultant(quantity)[0]}", until
    diagrams = bounds(solution, extremes, quantity)
    return draw_envelope(solution, title, quantity, diagrams, ax, n=-1)


def bounds(solution: Solution, found: Any, quantity: str) -> list[Values]:
    """Return the largest and the least values of a section force along each beam."""
    extents = [(beam, found.section_forces(beam)) for beam in solution.scene.beams]
    pairs = [(beam, values) for beam, x in extents for values in (x.high, x.low)]
    return [(beam, style.components(values, quantity)) for beam, values in pairs]
