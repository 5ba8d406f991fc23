# SPDX-License-Identifier: MIT
"""Pictures of yielding and fracture: marks on the frame, moment curves, and lost energies."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from itertools import pairwise
from types import MappingProxyType
from typing import Any, NamedTuple

import numpy as np

from ufl_beam.arrays import Array
from ufl_beam.errors import ArgumentError
from ufl_beam.model.bodies import AttachmentPoint, Place
from ufl_beam.model.connector_laws import HingeLaw
from ufl_beam.model.connectors import Connector, can_yield, law_of
from ufl_beam.output.hinge_histories import hinge_histories, require_limits, rotation_of
from ufl_beam.output.history import breaking_law
from ufl_beam.output.state_rows import HINGE, JUMP, PLASTIC
from ufl_beam.plotting import style
from ufl_beam.plotting.positions import DeformedShape, unit_vectors
from ufl_beam.plotting.style import BLUE, INK, ORANGE, WHITE, Artist, Axes, Figure, shade
from ufl_beam.simulation.solution import Solution

FULLY_OPEN = 0.99  # hinges that dissipated this fraction of their fracture energy look like joints


class OpenHinge(NamedTuple):
    """Hinge that has opened, in a cell or at a vertex, or connector whose rotation has yielded."""

    place: AttachmentPoint
    at: Array  # drawn position; (2,); m
    fraction: float  # dissipated fraction of its fracture energy; 1 if limit = 0, NaN if it hardens
    rotation: float  # largest magnitude of its plastic rotation up to the n-th time; rad
    state: str  # acceptance limit that it satisfied up to then


def open_hinges(
    solution: Solution, n: int, at: Callable[[AttachmentPoint], Array],
    limits: Mapping[str, float] = MappingProxyType({}),
) -> list[OpenHinge]:  # fmt: skip
    """Find hinges in cells, at vertices and in connectors that opened up to the n-th time.

    ``at`` returns the drawn position of a place (m).  ``limits`` are acceptance limits of the
    plastic rotation by name (rad).
    """
    require_limits(limits, "plot: limits")
    states, found = solution.subset(0, solution.index(n) + 1), []
    for hinge in hinge_histories(states):
        rotation = hinge.largest_rotation
        joint = isinstance(hinge.where, Place) and rotation != 0.0  # may have no strength
        if math.isnan(rotation) or not (hinge.first_yield >= 0 or joint):
            continue
        law, fraction = _law(solution, hinge.where), math.nan
        if law is not None and (law.limit == 0.0 or math.isfinite(law.fracture_energy)):
            # A hinge without strength is a joint.
            lost = float(hinge.dissipated[-1])
            fraction = min(lost / law.fracture_energy, 1.0) if law.limit else 1.0
        place = hinge.where.b if isinstance(hinge.where, Connector) else hinge.where
        plastic = hinge.largest_plastic
        rotation = abs(rotation if math.isnan(plastic) else plastic)
        found.append(OpenHinge(place, np.array(at(place)), fraction, rotation, hinge.state(limits)))
    return found


def _law(solution: Solution, where: Place | Connector) -> HingeLaw | None:
    """Return the law of a hinge at a vertex, in a cell or in a connector, if it may break."""
    if isinstance(where, Connector):
        return breaking_law(where.law)
    numbering = solution.numbering
    if (hinge := numbering.hinge_at(where)) is not None:
        return law_of(hinge)
    hinge_of_cell: HingeLaw | None = where.beam.section.hinge
    return hinge_of_cell


def dissipated_per_length(solution: Solution, n: int) -> Array:
    """Compute energies per length dissipated by plastic strains and cracks; (num_cells,); J/m."""
    numbering, states = solution.numbering, solution.cells_of(n)
    cracks = [beam.section.fibres is not None for beam in solution.scene.beams]
    cracking = np.array(cracks, dtype=bool)[numbering.beam_of_cell]
    energy = states[:, PLASTIC] + np.where(cracking, states[:, HINGE], 0.0)
    return np.asarray(energy / numbering.lengths(np.arange(len(states))))


def circle(fraction: float, color: Any = BLUE) -> dict[str, Any]:
    """Return the marker style of a hinge from the dissipated fraction of its fracture energy.

    Hinges that harden, whose fraction is NaN, have the size of half-broken hinges.
    """
    paper = shade(WHITE)
    inside, edge = (paper, color) if fraction >= FULLY_OPEN else (color, paper)
    size = 4.0 + 6.0 * math.sqrt(0.5 if math.isnan(fraction) else fraction)
    look: dict[str, Any] = {"marker": "o", "ms": size, "mfc": inside, "mec": edge, "mew": 1.8}
    return {**look, "ls": "none", "zorder": 6}


def draw_damage(axes: Axes, solution: Solution, n: int, shape: DeformedShape) -> dict[str, Artist]:
    """Mark yielded cells and open hinges on the beams; return marks by their names in a legend."""
    named: dict[str, Artist] = {}
    yielded = np.flatnonzero(dissipated_per_length(solution, n))
    for line in shape.nodes[solution.numbering.nodes_along_cells[yielded]]:
        (zone,) = axes.plot(*line.T, color=ORANGE, linewidth=9.0, solid_capstyle="butt", zorder=3.8)
        named["yielded or cracked"] = zone
    hinges = open_hinges(solution, n, shape.at)
    for hinge, mark in zip(hinges, mark_hinges(axes, solution, shape, hinges), strict=True):
        named["fully open hinge" if hinge.fraction >= FULLY_OPEN else "hinge, open"] = mark
    return named


def mark_hinges(
    axes: Axes, solution: Solution, shape: DeformedShape, hinges: Sequence[OpenHinge],
    colors: Sequence[Any] = (),
) -> list[Artist]:  # fmt: skip
    """Draw open hinges as circles; at joints of several beams they are beside the joint."""
    ends = [shape.at(end) for beam in solution.scene.beams for end in (beam.start, beam.end)]
    marks: list[Artist] = []
    for hinge, color in zip(hinges, colors or [BLUE] * len(hinges), strict=True):
        at, place = hinge.at, hinge.place
        several = sum(math.dist(at, end) < 1e-6 * solution.scene.size for end in ends) > 1
        if several and isinstance(place, Place) and place.s in (0.0, 1.0):
            inner = solution.numbering.nodes_along(place.beam)[1 if place.s == 0.0 else -2]
            at = at + 0.7 * shape.canvas.unit * unit_vectors(shape.nodes[inner] - at)
        marks += axes.plot(*at, **circle(hinge.fraction, color))
    return marks


# -- pictures ----------------------------------------------------------------------------------


def draw_moment_curvature(solution: Solution, place: Place, *, ax: Axes | None = None) -> Figure:
    """Draw the moment M (N m) of a cell against its curvature K (1/m), coloured by time.

    In space they are about axis 3 of the section.  The curvature includes the jump of a hinge
    divided by the length of the cell.  So the area of a loop is the dissipated energy per length.
    At a vertex, the cell before the vertex is drawn.
    """
    M, K = solution.material_at(place).forces[:, -1], solution.strains_at(place)[:, -1]
    with style.panel(ax, (8.0, 5.4)) as axes:
        _draw_path(axes, ax, solution, K, M)
        axes.set_xlabel("curvature K (1/m)")
        axes.set_title(f"cell at {place}", loc="left")
    return style.parent_figure(axes)


def draw_hinge(solution: Solution, place: Place | Connector, *, ax: Axes | None = None) -> Figure:
    """Draw the moment M (N m) of a hinge against its jump (rad), coloured by time.

    The area between the curve and the axis is the energy that the hinge dissipated.  The title
    states this energy (J), and its percentage of a finite fracture energy.  At a vertex without a
    plastic hinge, the hinge of the cell before the vertex is drawn.  A connector is drawn with its
    rotation, if the law of the rotation may yield or break.
    """
    law: HingeLaw | None
    if isinstance(place, Connector):
        history, law = solution.connector(place), breaking_law(place.law)
        if not can_yield(place):
            raise ArgumentError(f"plot: {place} has no rotation whose law may yield or break")
        (jump, M), lost = rotation_of(history), float(history.dissipated[-1])
    else:
        points, law = solution.material_at(place), _law(solution, place)
        if law is None or np.isinf(law.limit):
            raise ArgumentError(f"plot: neither {place} nor the cell there has a hinge")
        M, jump, losses = points.forces[:, -1], points.jump, points.hinge
        if solution.numbering.hinge_at(place) is None:  # of the Gauss point that opened most
            cell = solution.numbering.cell(place)
            states = np.array([solution.points_of(n)[cell] for n in range(len(solution))])
            M, jump, losses = states[
                :, np.abs(states[-1, :, JUMP]).argmax(), [JUMP - 1, JUMP, HINGE]
            ].T
        lost = float(losses[-1])
    with style.panel(ax, (8.0, 5.4)) as axes:
        # Intervals in which the jump only grows or only falls; adjacent intervals share a point.
        moves = np.flatnonzero(np.diff(jump))
        reversals = moves[1:][np.diff(np.sign(np.diff(jump)[moves])) != 0]
        for first, last in pairwise([0, *reversals, len(jump) - 1]):
            window = slice(first, last + 1)
            axes.fill_between(
                jump[window], M[window], facecolor=(ORANGE, 0.3), linewidth=0.0, zorder=2
            )
        _draw_path(axes, ax, solution, jump, M)
        rotation = "rotation" if isinstance(place, Connector) else "jump of rotation"
        style.label_axis(axes.xaxis, jump, rotation, "rad")
        spent = f"{style.with_unit(lost, 'J')} dissipated"
        if law is not None and math.isfinite(law.fracture_energy):
            whole = law.fracture_energy
            spent += f", {100 * lost / whole:.3g} % of {style.with_unit(whole, 'J')}"
        axes.set_title(f"hinge at {place}: {spent}", loc="left")
    return style.parent_figure(axes)


def draw_dissipation(solution: Solution, *, ax: Axes | None = None) -> Figure:
    """Draw lost energies (J) over time or along a path, as stacked areas.

    The line above the areas is the supplied work plus the initial energy of the scene.  The gap
    between this line and the areas is the energy in the scene, which also has its own line.  The
    title states the largest imbalance of the ledger.
    """
    if not solution.scene.connectors:
        if not solution.scene.beams:
            raise ArgumentError("plot: the scene has neither beams nor connectors")
        solution.material(solution.scene.beams[0])  # raises if the scene is elastic
    energy, t = solution.energy, solution.progress
    inside = energy.total
    work, lost = (sum(x.values(), np.zeros_like(t)) for x in (energy.supplied, energy.lost))
    supplied = inside[0] + lost[0] + work - work[0]
    start = inside[0] > 1e-12 * energy.energy_transferred
    with style.panel(ax, (8.0, 5.0)) as axes:
        style.time_axes(axes)
        # These colours repeat; blue is reserved for the energy in the scene.
        colors = [
            (color, 0.75) for color in (ORANGE, style.RED, style.GREEN, style.PINK, style.SKY)
        ]
        labels = [f"lost: {name}" for name in energy.lost]
        axes.stackplot(t, *energy.lost.values(), labels=labels, colors=colors)
        label = "at the start, and supplied" if start else "supplied"
        axes.plot(t, supplied, color=shade(INK), label=label)
        axes.plot(t, inside, color=BLUE, label="in the scene")
        style.label_axis(axes.yaxis, np.concatenate([supplied, inside]), "energy", "J")
        axes.set_xlabel(solution.parameter.progress)
        digits, power = f"{energy.worst:.1e}".split("e")
        worst = rf"${digits}\times10^{{{int(power)}}}$"
        through = style.with_unit(energy.energy_transferred, "J")
        axes.set_title(f"worst imbalance {worst} of {through} transferred", loc="left")
        style.draw_legend(axes, ax, loc="outside upper left", ncols=3)
    return style.parent_figure(axes)


def _draw_path(axes: Axes, ax: Axes | None, solution: Solution, x: Array, M: Array) -> None:
    """Draw M against x, from light to dark in time; a ring marks the start, a dot the end."""
    from matplotlib.collections import LineCollection

    times, named = solution.progress, solution.parameter
    colors = style.scale("viridis_r", 0.12, 1.0, float(times[0]), float(times[-1]))
    path = np.column_stack([x, M])
    middle = (times[1:] + times[:-1]) / 2
    pieces = LineCollection(
        list(np.stack([path[:-1], path[1:]], axis=1)), colors=colors.to_rgba(middle),
        linewidths=2.2, capstyle="round", zorder=3,
    )  # fmt: skip
    style.zero_lines(axes)
    axes.add_collection(pieces)
    ring: dict[str, Any] = {"ms": 8.0, "mec": shade(INK), "mew": 1.6, "zorder": 5, "ls": "none"}
    for i, inside in ((0, WHITE), (-1, INK)):
        axes.plot(*path[i], "o", mfc=shade(inside), label=named.at(solution.times[i]), **ring)
    axes.autoscale_view()
    style.label_axis(axes.yaxis, M, "bending moment M", "N m")
    style.draw_bar(axes, colors, named.progress)
    style.draw_legend(axes, ax, loc="outside upper left", ncols=2)
