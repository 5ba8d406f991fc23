# SPDX-License-Identifier: MIT
"""Hinges that have opened and cells that have yielded, and their marks in pictures."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from ufl_beam.arrays import Array
from ufl_beam.model.bodies import Member
from ufl_beam.model.connector_laws import HingeLaw
from ufl_beam.model.plastic_hinges import law_of, place_of
from ufl_beam.plotting.style import BLUE, ORANGE, WHITE, shade
from ufl_beam.simulation.solution import Solution

if TYPE_CHECKING:
    from matplotlib.artist import Artist
    from matplotlib.axes import Axes

FULLY_OPEN = 0.99  # part of the fracture energy from which on a hinge is drawn as a joint


class OpenHinge(NamedTuple):
    """Hinge that has opened."""

    beam: Member
    at: Array  # where it is now; (2,); m
    part: float  # of its fracture energy, from 0 (closed) to 1 (a joint); 0 if it hardens


def open_hinges(solution: Solution, n: int, points: Array) -> list[OpenHinge]:
    """Find hinges, in cells and of zero length, that are open; ``points`` are nodes as drawn."""
    grid, found = solution.grid, []
    for beam in solution.scene.beams:
        laws = grid.hinges(beam)
        if all(law is None or math.isinf(law.limit) for law in laws):
            continue
        state = solution.material(beam, n)
        rows = zip(grid.cells_of(beam), laws, state.jump, state.hinge, strict=True)
        for cell, law, jump, lost in rows:
            if law is not None and (jump != 0.0 or lost > 0.0):
                at = points[grid.cells[cell]].mean(axis=0)
                found.append(OpenHinge(beam, at, _spent(law, lost)))
    for hinge, vertex in zip(solution.scene.hinges, grid.vertices_at_hinges, strict=True):
        kept = solution.connector(hinge)
        if kept.motion[n] != 0.0 or kept.dissipated[n] > 0.0:
            part = _spent(law_of(hinge), float(kept.dissipated[n]))
            found.append(OpenHinge(place_of(hinge).beam, points[vertex], part))
    return found


def _spent(law: HingeLaw, dissipated: float) -> float:
    """Part of the fracture energy that is spent; a hinge that never resisted is a joint."""
    return min(dissipated / law.energy, 1.0) if law.limit > 0.0 else 1.0


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
