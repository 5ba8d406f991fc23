# SPDX-License-Identifier: MIT
"""Pictures of a solution at one of its times, with diagrams of section forces on the frame."""

from __future__ import annotations

import math
from collections import defaultdict
from collections.abc import Iterator, Sequence
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from ufl_beam.arrays import Array, Index
from ufl_beam.model.bodies import Member
from ufl_beam.model.sections import Section
from ufl_beam.plotting import drawing, style
from ufl_beam.plotting.damage_marks import draw_damage
from ufl_beam.plotting.diagram_labels import MOST, Peak, arrange, fit_figure, keep_figure
from ufl_beam.plotting.geometry import left_of, unit_vectors
from ufl_beam.plotting.scene_layout import Pose
from ufl_beam.plotting.style import BLUE, INK, RED, RESULTANTS, number, shade
from ufl_beam.simulation.solution import Solution

if TYPE_CHECKING:
    from matplotlib.artist import Artist
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

LEAST_STRAIN = 1e-10  # strain that rounding and the tolerance of iterations leave behind
DRAWN_AS_ZERO = 1e-4  # part of the largest value below which a value is drawn as zero
ALIKE = 0.999  # part of the peak of an area from which on values are as large
LABELLED = 0.15  # part of the largest value from which on the peak of an area is labelled
MANY = 60  # beams beyond which both extreme values alone are labelled, and no directions drawn

SIGNS = {
    "N": ("N > 0: tension", "N < 0: compression"),
    "V": ("V > 0: left of the arrow", "V < 0: right of the arrow"),
    "M": ("M > 0: tension right of the arrow", "M < 0: tension left of the arrow"),
}
"""Meaning of both signs; the arrow on a beam points from its start to its end."""

Values = tuple[Member, Array]  # a beam, and the values in points of its cells, (num_cells, points)


def plot_state(solution: Solution, what: str, *, n: int, magnify: float, ax: Axes | None) -> Figure:
    """Draw the frame at a time, with a diagram of a section force; see :func:`plot`."""
    style.require_choice(what, ("shape", *RESULTANTS), "plot: what")
    pose = drawing.plane_stage(solution, [n], magnify).pose(n)
    when = f"at {solution.parameter.at(solution.times[n])}{style.magnified(magnify)}"
    if what == "shape":
        return draw_frame(ax, solution, n, pose, ("shape", when))
    found = [(beam, getattr(solution.diagram(beam, n), what)) for beam in solution.scene.beams]
    diagrams = [(b, values.reshape(len(solution.grid.cells_of(b)), -1)) for b, values in found]
    name = f"{RESULTANTS[what][0]} {what}"
    return draw_frame(ax, solution, n, pose, (name, when), what, diagrams)


def draw_frame(
    ax: Axes | None,
    solution: Solution,
    n: int,
    pose: Pose,
    title: tuple[str, str],
    what: str = "",
    diagrams: Sequence[Values] = (),
) -> Figure:
    """Draw the frame in a pose, with diagrams of a section force, their peaks, and damage.

    The damage is that of the n-th kept time.  The unit stands between both parts of the title.
    """
    largest = max((float(np.abs(values).max()) for _, values in diagrams), default=0.0)
    factor, prefix = style.decimal_prefix(largest)
    name, when = title
    unit = f"({prefix}{RESULTANTS[what][1]}) " if diagrams else ""
    with style.panel(ax, MOST) as axes:
        style.plane_axes(axes, f"{name} {unit}{when}")
        drawing.draw_undeformed(axes, solution, pose.stage)
        peaks: list[Peak] = []
        if _is_loaded(what, diagrams):
            rows = _draw_diagrams(axes, solution, pose.nodes, what, diagrams)
            peaks = _peaks(rows, factor, LABELLED if len(diagrams) <= MANY else 1.0)
        drawing.draw_axes(axes, solution, pose.nodes, color=shade(INK), linewidth=2.6, zorder=4)
        drawing.draw_symbols(axes, pose)
        named = {**_signs(axes, what), **draw_damage(axes, solution, n, pose.nodes)}
        for meaning, artist in named.items():
            artist.set_label(meaning)
        if named:
            columns = 1 if len(named) <= 2 else 2
            small = style.font_size(11.0)
            style.draw_legend(
                axes, ax, [*named.values()], loc="outside lower left", ncols=columns, fontsize=small
            )
        arrange(axes, peaks, fit_figure if ax is None else keep_figure)
    return style.figure_of(axes)


def _is_loaded(what: str, diagrams: Sequence[Values]) -> bool:
    """Return whether a section force is more than what rounding and iterations leave behind."""

    def stiffness(section: Section) -> float:
        return {"N": section.EA, "V": section.GA, "M": section.EI / section.depth}[what]

    return any(
        bool(np.abs(values).max() > LEAST_STRAIN * stiffness(beam.section))
        for beam, values in diagrams
    )


def _draw_diagrams(
    axes: Axes, solution: Solution, nodes: Array, what: str, diagrams: Sequence[Values]
) -> Array:
    """Draw diagrams of a section force, all to one scale.

    Returns:
        The peak of each area, its point of the axis, and the vector from there to the diagram;
        (num_areas, 5).
    """
    from matplotlib.collections import PolyCollection

    side = -1.0 if what == "M" else 1.0
    cells = np.concatenate([solution.grid.cells_of(beam) for beam, _ in diagrams])
    found = np.concatenate([values for _, values in diagrams])
    largest = float(np.abs(found).max())
    scale = 0.13 * side * math.hypot(*np.ptp(nodes, axis=0)) / largest
    values = np.where(np.abs(found) > DRAWN_AS_ZERO * largest, found, 0.0).ravel()
    # A beam may have several diagrams, which do not meet.
    diagram = np.repeat(np.arange(len(diagrams)), [len(of_cells) for _, of_cells in diagrams])
    axis, left = _along(solution, cells, diagram, nodes, found.shape[1])
    up = scale * values[:, None] * left
    rows: list[Array] = []
    outlines: defaultdict[str, list[Array]] = defaultdict(list)
    diagram = np.repeat(diagram, found.shape[1])
    for area in _areas(axis, axis + up, values, diagram):
        outlines[RED if area.peak > 0 else BLUE].append(area.outline)
        rows.append(np.array([area.peak, *axis[area.place], *up[area.place]]))
    if what != "N" and len(diagrams) <= MANY:
        firsts = {beam: k for k, (beam, _) in reversed([*enumerate(diagrams)])}
        for k in firsts.values():
            first, *_, last = np.flatnonzero(diagram == k)
            low, high = (first + last) // 2, (first + last + 1) // 2
            _draw_direction(axes, (axis[low] + axis[high]) / 2, left[high])
    for color, group in outlines.items():
        look: dict[str, Any] = {"facecolors": [(color, 0.28)], "edgecolors": color, "gid": color}
        axes.add_collection(PolyCollection(group, **look, linewidths=1.0, zorder=2))
    return np.array(rows)


def _peaks(rows: Array, unit: float, least: float) -> list[Peak]:
    """Peaks to be labelled, both extreme values first; corners have one label for both beams.

    Others have at least a part of the largest size, ``least``.
    """
    values, axis, up = rows[:, 0], rows[:, 1:3], rows[:, 3:]
    ends = (1, int(values.argmax())), (-1, int(values.argmin()))
    extremes = [k for sign, k in ends if sign * values[k] > 0.0]
    large: list[int] = [*map(int, np.flatnonzero(np.abs(values) > least * np.abs(values).max()))]
    numbers = {k: number(values[k] / unit) for k in {*extremes, *large}}
    places = np.round(axis / (1e-3 * math.hypot(*np.ptp(axis, axis=0)) or 1.0))
    chosen: dict[tuple[object, ...], int] = {}
    for k in [*extremes, *large]:
        chosen.setdefault((numbers[k].lstrip("−"), *places[k]), k)
    return [
        Peak(
            numbers[k], RED if values[k] > 0 else BLUE, axis[k] + up[k], unit_vectors(up[k]),
            k in extremes,
        )
        for k in chosen.values()
    ]  # fmt: skip


def _along(
    solution: Solution, cells: Index, diagram: Index, nodes: Array, points: int
) -> tuple[Array, Array]:
    """Points of the axes as drawn and unit vectors to their left; both (num_cells points, 2).

    ``diagram`` is the number of that of each cell.
    """
    mesh, parts = solution.grid.mesh, np.linspace(0.0, 1.0, points)
    start, end, *between = solution.grid.nodes_of_cells[cells].T
    chains = nodes[np.column_stack([start, *between, end])]
    ahead = unit_vectors(mesh.slopes(parts) @ chains)
    # Ordinates at corners between cells of a beam halve the angle, and lean towards it in both.
    lean = np.zeros((len(chains), 2, 2))
    k = np.flatnonzero(diagram[:-1] == diagram[1:])
    half = unit_vectors(ahead[k, -1] + ahead[k + 1, 0])
    lean[k, 1], lean[k + 1, 0] = half - ahead[k, -1], half - ahead[k + 1, 0]
    ahead = ahead + np.column_stack([1.0 - parts, parts]) @ lean
    left = left_of(unit_vectors(ahead))
    return (mesh.weights(parts) @ chains).reshape(-1, 2), left.reshape(-1, 2)


class Area(NamedTuple):
    """Part of a diagram along a beam with values of one sign."""

    outline: Array  # (n, 2); m
    peak: float  # its largest value in size
    place: int  # number of the point of the peak; of equal ones that in the middle


def _areas(axis: Array, tips: Array, values: Array, diagram: Index) -> Iterator[Area]:
    """Divide diagrams, whose numbers are ``diagram``, where the sign changes."""
    # There both areas end in a point of the axis.
    first = np.flatnonzero((values[:-1] * values[1:] < 0.0) & (diagram[:-1] == diagram[1:]))
    part = values[first] / (values[first] - values[first + 1])
    zeros = axis[first] + part[:, None] * (axis[first + 1] - axis[first])
    places = np.insert(np.arange(len(values)), first + 1, first)
    axis, tips = (np.insert(points, first + 1, zeros, axis=0) for points in (axis, tips))
    values, diagram = (
        np.insert(values, first + 1, 0.0),
        np.insert(diagram, first + 1, diagram[first]),
    )
    signs = np.where(diagram[:-1] == diagram[1:], np.sign(values[:-1] + values[1:]), 0.0)
    ends = np.flatnonzero(np.diff(signs, append=np.nan))
    for begin, end in zip([0, *(ends[:-1] + 1)], ends, strict=True):
        if (sign := signs[begin]) != 0.0:
            chain = slice(begin, end + 2)
            outline = np.concatenate(
                [axis[begin : begin + 1], tips[chain], axis[end + 1 : begin : -1]]
            )
            sizes = np.abs(values[chain])
            largest = float(sizes.max())
            equal = np.flatnonzero(sizes >= ALIKE * largest)
            yield Area(outline, sign * largest, int(places[begin + equal[len(equal) // 2]]))


def _draw_direction(axes: Axes, at: Array, left: Array) -> None:
    """Draw an arrow on a beam from its start to its end, whose left is known."""
    turn = math.degrees(math.atan2(left[1], left[0])) - 180.0  # of an arrow that points up
    axes.plot(*at, marker=(3, 0, turn), ms=9.0, color=shade(INK), mew=0.0, zorder=4.1)


def _signs(axes: Axes, what: str) -> dict[str, Artist]:
    """Meanings of the signs that are in the picture, with an area of each."""
    meanings = dict(zip((RED, BLUE), SIGNS.get(what, ()), strict=False))
    areas = {area.get_gid(): area for area in axes.collections}
    return {meaning: areas[color] for color, meaning in meanings.items() if color in areas}
