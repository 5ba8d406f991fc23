# SPDX-License-Identifier: MIT
"""Drawing of strokes, and of a solution in its plane, shared by its pictures."""

from __future__ import annotations

import math
from collections import defaultdict
from collections.abc import Iterable, Sequence
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from ufl_beam.arrays import Array
from ufl_beam.model.bodies import Member
from ufl_beam.model.connector_laws import HingeLaw
from ufl_beam.model.connectors import law_of, place_of
from ufl_beam.plotting import symbols
from ufl_beam.plotting.layout import Pose, Stage, joined
from ufl_beam.plotting.style import BLUE, GREY, ORANGE, POINTS, WHITE, require_axes, shade, size_of
from ufl_beam.plotting.symbols import Stroke
from ufl_beam.simulation.solution import Solution

if TYPE_CHECKING:
    from matplotlib.artist import Artist
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


# -- hinges that have opened, and cells that have yielded --------------------------------------


FULLY_OPEN = 0.99  # part of the fracture energy from which on a hinge is drawn as a joint


class OpenHinge(NamedTuple):
    """Hinge that has opened."""

    beam: Member
    at: Array  # where it is now; (2,); m
    part: float  # of its fracture energy, from 0 (closed) to 1 (a joint); 0 if it hardens


def open_hinges(solution: Solution, n: int, points: Array) -> list[OpenHinge]:
    """Find hinges, in cells and of zero length, that are open; ``points`` are nodes as drawn."""
    grid = solution.grid
    found: list[tuple[Member, Array, HingeLaw, float]] = []  # with the dissipated energy (J)
    for beam in solution.scene.beams:
        laws = grid.hinges(beam)
        if all(law is None or math.isinf(law.limit) for law in laws):
            continue
        state = solution.material(beam, n)
        rows = zip(grid.cells_of(beam), laws, state.jump, state.hinge, strict=True)
        for cell, law, jump, lost in rows:
            if law is not None and (jump != 0.0 or lost > 0.0):
                found.append((beam, points[grid.cells[cell]].mean(axis=0), law, float(lost)))
    for hinge, vertex in zip(solution.scene.hinges, grid.vertices_at_hinges, strict=True):
        kept = solution.connector(hinge)
        if kept.motion[n] != 0.0 or kept.dissipated[n] > 0.0:
            dissipated = float(kept.dissipated[n])
            found.append((place_of(hinge).beam, points[vertex], law_of(hinge), dissipated))
    return [
        # One that never resisted is a joint.
        OpenHinge(beam, at, min(lost / law.energy, 1.0) if law.limit > 0.0 else 1.0)
        for beam, at, law, lost in found
    ]


def dissipated_per_length(solution: Solution, n: int) -> Array:
    """Compute the energy that plastic strains and cracks dissipated; (num_cells,); J/m."""
    grid = solution.grid
    energy = np.zeros(len(grid.cells))
    for beam in solution.scene.beams:
        layout = beam.section.layout(None)
        if layout is not None and not layout.elastic:
            state = solution.material(beam, n)
            cracks = state.hinge if beam.section.fibres is not None else 0.0
            energy[grid.cells_of(beam)] = state.plastic + cracks
    return energy / grid.lengths(np.arange(len(grid.cells)))


def circle(part: float) -> dict[str, Any]:
    """Return the look of a hinge of which a part of the fracture energy is spent."""
    paper = shade(WHITE)
    inside, edge = (paper, BLUE) if part >= FULLY_OPEN else (BLUE, paper)
    size = 4.0 + 6.0 * math.sqrt(part)
    look: dict[str, Any] = {"marker": "o", "ms": size, "mfc": inside, "mec": edge, "mew": 1.8}
    return {**look, "ls": "none", "zorder": 6}


def draw_damage(axes: Axes, solution: Solution, n: int, nodes: Array) -> dict[str, Artist]:
    """Mark yielded cells and open hinges on the axes of beams; return their names for a legend."""
    named: dict[str, Artist] = {}
    yielded = np.flatnonzero(dissipated_per_length(solution, n))
    for ends in nodes[solution.grid.cells[yielded]]:
        (zone,) = axes.plot(*ends.T, color=ORANGE, linewidth=9.0, solid_capstyle="butt", zorder=3.8)
        named["yielded or cracked"] = zone
    for hinge in open_hinges(solution, n, nodes):
        (mark,) = axes.plot(*hinge.at, **circle(hinge.part))
        named["fully open hinge" if hinge.part >= FULLY_OPEN else "hinge, open"] = mark
    return named
