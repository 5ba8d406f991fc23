# SPDX-License-Identifier: MIT
"""Pictures of a solution at one time: deformed frame, section force diagrams and damage."""

from __future__ import annotations

import math
from collections import defaultdict
from collections.abc import Iterator, Mapping, Sequence
from types import MappingProxyType
from typing import Any

import numpy as np

from ufl_beam.arrays import Array
from ufl_beam.model.bodies import Member
from ufl_beam.model.connectors import can_yield
from ufl_beam.plotting import style, symbols
from ufl_beam.plotting.inelastic_pictures import (
    OpenHinge,
    circle,
    dissipated_per_length,
    draw_damage,
    mark_hinges,
    open_hinges,
)
from ufl_beam.plotting.labels import Label, around, arrange, fitted_canvas, scene_axes
from ufl_beam.plotting.positions import Canvas, DeformedShape, joined
from ufl_beam.plotting.style import BLUE, GREY, INK, RED, Artist, Axes, Figure, font_size, shade
from ufl_beam.plotting.symbols import Stroke, draw_strokes
from ufl_beam.simulation.solution import Solution

LEAST_STRAIN = 1e-10  # strain up to which section forces count as round-off and are not drawn
DRAWN_AS_ZERO = 1e-4  # fraction of the largest value below which a value is drawn as zero
ALIKE = 0.999  # values above this fraction of the peak of an area count as equal to the peak
LABELLED = 0.15  # peaks above this fraction of the largest value are labelled
ALPHA = "48"  # opacity of areas, of 256; hexadecimal
MOST_BEAMS = 60  # number of beams beyond which only extremes are labelled, without directions
SIGNS = {
    "N": ("N > 0: tension", "N < 0: compression"),
    "V": ("V > 0: left of the arrow", "V < 0: right of the arrow"),
    "M": ("M > 0: tension right of the arrow", "M < 0: tension left of the arrow"),
}
"""Meaning of both signs; the arrow on a beam points from its start to its end."""

SIDES = {"V": ["V: in its direction"], "M": ["M: on the side of tension"]}
"""Meaning of the side of diagrams of vectors in space, which have no sign."""

ORDINATES = np.array(
    [[0, 1, 0], [0, 1, 0], [0, 0, 1], [0, 1, 0], [0, 0, 1], [0, -1, 0]], dtype=np.float64
)
"""Directions of ordinates of (N, V2, V3, T, M2, M3) in axes of the section."""

Values = tuple[Member, Array]
"""A beam, and values at points of its cells; (num_cells points, 1), of vectors (..., 2)."""


def draw_beams(axes: Axes, solution: Solution, points: Array, **line: Any) -> None:
    """Draw the axes of all beams; ``points`` are the drawn nodes, (num_nodes, 2 or 3), m."""
    numbering = solution.numbering
    lines = [points[numbering.nodes_along(beam)] for beam in solution.scene.beams]
    axes.plot(*joined(lines).T, **line)


def draw_outlines(axes: Axes, solution: Solution, shape: DeformedShape, **line: Any) -> None:
    """Draw beams, outlines of bodies, and rods as lines."""
    draw_beams(axes, solution, shape.nodes, **line)
    outlines = joined(s.points for s in (*symbols.bodies(shape), *symbols.rods(shape)))
    axes.plot(*outlines.T, **line)


def draw_undeformed(axes: Axes, solution: Solution, canvas: Canvas) -> None:
    """Draw undeformed beams, bodies and rods in grey."""
    draw_outlines(axes, solution, canvas.undeformed, color=GREY, linewidth=1.2, zorder=1)


def draw_shape(
    solution: Solution, *, quantity: str = "shape", n: int = -1, magnify: float = 1.0,
    ax: Axes | None = None,
) -> Figure:  # fmt: skip
    """Draw the frame at the n-th recorded time, optionally with the diagram of a section force.

    M is drawn on the tension side of a beam.  Positive N and V are drawn on its left, looking from
    start to end.  In space, V and M are drawn as vectors across the beam, and components along axes
    of the section.  Positive values are red, negative values blue.  Values between vertices follow
    from equilibrium, see :meth:`Solution.diagram`.  Large peaks are labelled in the unit of the
    title; the largest and the least value are bold.  Yielded or cracked cells are orange.  Open
    hinges are circles as in :func:`draw_damage_state`.
    """
    shape = fitted_canvas(solution, [n], magnify, ax).shape(n)
    when = f"at {solution.parameter.at(solution.times[n])}{style.magnified(magnify)}"
    if quantity == "shape":
        return draw_frame(ax, solution, n, shape, ("shape", when))
    forces = [(b, np.column_stack(solution.diagram(b, n)[1:])) for b in solution.scene.beams]
    diagrams = [(beam, style.components(x, quantity)) for beam, x in forces]
    name, _ = style.resultant(quantity)
    return draw_frame(ax, solution, n, shape, (name, when), quantity, diagrams)


def draw_frame(
    ax: Axes | None,
    solution: Solution,
    n: int,
    shape: DeformedShape,
    title: tuple[str, str],
    what: str = "",
    diagrams: Sequence[Values] = (),
) -> Figure:
    """Draw the deformed frame, with diagrams of a section force, their peaks, and damage.

    The damage belongs to the n-th recorded time.  The unit is put between both parts of ``title``.
    """
    sizes = np.array([np.linalg.norm(values, axis=1).max() for _, values in diagrams])
    factor, prefix = style.decimal_prefix(float(sizes.max(initial=0.0)))
    sections, beams = [beam.section for beam, _ in diagrams], {beam for beam, _ in diagrams}
    stiffness = [
        s.EI / s.depth if what[0] in "MT" else s.GA if what[0] == "V" else s.EA for s in sections
    ]
    name, when = title
    unit = (
        f"({prefix}{style.resultant(what)[1]})".replace(" ", "\N{NO-BREAK SPACE}")
        if diagrams
        else ""
    )
    heading = " ".join(filter(None, (name, unit, when)))
    with scene_axes(ax, solution.scene, heading) as axes:
        draw_undeformed(axes, solution, shape.canvas)
        peaks: list[Label] = []
        if (sizes > LEAST_STRAIN * np.array(stiffness)).any():  # more than rounding
            rows = _draw_diagrams(axes, solution, shape, what, diagrams)
            peaks = _peaks(rows, factor, LABELLED if len(beams) <= MOST_BEAMS else 1.0)
        draw_beams(axes, solution, shape.nodes, color=shade(INK), linewidth=2.6, zorder=4)
        draw_strokes(axes, symbols.all_symbols(shape))
        areas = {area.get_gid(): area for area in axes.collections}
        named: dict[str, Artist] = {}
        signs: Sequence[str] = SIGNS.get(what, ())
        if solution.scene.in_space and what != "N":
            signs = SIDES.get(what, [f"{what} > 0", f"{what} < 0"])
        for color, words in zip((RED, BLUE), signs, strict=False):
            if len(beams) > MOST_BEAMS:  # without arrows
                words = words.replace(" of the arrow", ", from start to end")
            if color in areas:
                named[words] = areas[color]
        named |= draw_damage(axes, solution, n, shape)
        for words, artist in named.items():
            artist.set_label(words)
        if named:
            style.draw_legend(
                axes, ax, [*named.values()], loc="outside lower left",
                ncols=1 if len(named) <= 2 else 2, fontsize=font_size(11.0),
            )  # fmt: skip
        arrange(axes, ax, peaks)
    return style.parent_figure(axes)


def _draw_diagrams(
    axes: Any, solution: Solution, shape: DeformedShape, what: str, diagrams: Sequence[Values]
) -> Array:
    """Draw diagrams of a section force, all to one scale.

    Returns:
        The peak of each area, its point on the axis, and the vector from this point to the diagram;
        (num_areas, 5 or 7).
    """
    in_space, numbering = solution.scene.in_space, solution.numbering
    unmarked = {beam for beam, _ in diagrams}
    if what == "N" or len(unmarked) > MOST_BEAMS or in_space:
        unmarked.clear()
    largest = max(float(np.linalg.norm(vectors, axis=1).max()) for _, vectors in diagrams)
    scale = 0.13 * math.hypot(*np.ptp(shape.nodes, axis=0)) / largest
    points = len(diagrams[0][1]) // len(numbering.cells_of(diagrams[0][0]))  # in a cell
    fractions = np.linspace(0.0, 1.0, points).astype(np.float64)
    lines, frames = shape.axis_points(fractions), shape.section_axes(fractions)
    columns = style.COLUMNS[what if in_space else {"V": "V2", "M": "M3"}.get(what, what)]
    rows: list[Array] = []
    outlines: defaultdict[str, list[Stroke]] = defaultdict(list)
    for beam, vectors in diagrams:
        cells = numbering.cells_of(beam)
        axis = lines[cells].reshape(-1, lines.shape[-1])
        sections = frames[cells].reshape(-1, 3, 3)[:, : axis.shape[1]]
        values = vectors[:, 0] if vectors.shape[1] == 1 else np.linalg.norm(vectors, axis=1)
        drawn = np.abs(values) > DRAWN_AS_ZERO * largest
        ways = np.einsum("pik,ck->pci", sections, ORDINATES[columns])
        ordinates = scale * np.einsum("pc,pci->pi", np.where(drawn[:, None], vectors, 0.0), ways)
        for outline, peak, k in _areas(axis, axis + ordinates, np.where(drawn, values, 0.0)):
            color = RED if peak > 0 else BLUE
            outlines[color].append(Stroke(outline, color, 1.0, f"{color}{ALPHA}", 2.0))
            rows.append(np.array([peak, *axis[k], *ordinates[k]]))
        if beam in unmarked:
            unmarked.remove(beam)
            low, high = (len(axis) - 1) // 2, len(axis) // 2
            (x, y), (right, up) = (axis[low] + axis[high]) / 2, sections[high, :, 1]
            angle = math.degrees(math.atan2(up, right)) - 180.0  # at 0 the marker points up
            axes.plot(x, y, marker=(3, 0, angle), ms=9.0, color=shade(INK), mew=0.0, zorder=4.1)
    draw_strokes(axes, outlines)
    return np.array(rows)


def _peaks(rows: Array, unit: float, least: float) -> list[Label]:
    """Choose peaks to label: first the largest and the least value, then the other large peaks.

    Large peaks exceed ``least`` times the largest magnitude.  Equal peaks at a point are one peak.
    """
    values, (axis, up) = rows[:, 0], np.split(rows[:, 1:], 2, axis=1)
    ends = (1, int(values.argmax())), (-1, int(values.argmin()))
    extremes = [k for sign, k in ends if sign * values[k] > 0.0]
    order, largest = np.argsort(-np.abs(values), kind="stable"), np.abs(values).max()
    large = [int(k) for k in order if abs(values[k]) > least * largest]
    labels = {k: style.number(values[k] / unit) for k in {*extremes, *large}}
    places = np.round(axis / (1e-3 * math.hypot(*np.ptp(axis, axis=0)) or 1.0))
    chosen: dict[tuple[object, ...], int] = {}
    for k in [*extremes, *large]:
        chosen.setdefault((labels[k].lstrip("−"), *places[k]), k)
    return [
        Label(
            labels[k],
            RED if values[k] > 0 else BLUE,
            around(axis[k] + up[k], up[k]),
            k in extremes,
        )
        for k in chosen.values()
    ]


def _areas(axis: Array, tips: Array, values: Array) -> Iterator[tuple[Array, float, int]]:
    """Divide a diagram into areas of one sign.

    Yields:
        Outline (n, 2 or 3), m, of an area; its value of the largest magnitude; index of the point
        with this value, the middle one of several.
    """
    # Where the sign changes, both areas end at a point on the axis.
    first = np.flatnonzero(values[:-1] * values[1:] < 0.0)
    fraction = values[first] / (values[first] - values[first + 1])
    zeros = axis[first] + fraction[:, None] * (axis[first + 1] - axis[first])
    axis, tips = (np.insert(x, first + 1, zeros, axis=0) for x in (axis, tips))
    places = np.insert(np.arange(len(values)), first + 1, first)
    values = np.insert(values, first + 1, 0.0)
    signs = np.sign(values[:-1] + values[1:])
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
            yield outline, sign * largest, int(places[begin + equal[len(equal) // 2]])


def draw_envelope(
    solution: Solution,
    title: tuple[str, str],
    quantity: str,
    diagrams: Sequence[Values],
    ax: Axes | None,
    n: int = 0,
) -> Figure:
    """Draw diagrams of a section force, and damage at a time, on the undeformed frame."""
    shape = fitted_canvas(solution, [], ax=ax).undeformed
    return draw_frame(ax, solution, n, shape, title, quantity, diagrams)


def draw_damage_state(
    solution: Solution, *, n: int = -1, magnify: float = 1.0,
    limits: Mapping[str, float] = MappingProxyType({}), ax: Axes | None = None,
) -> Figure:  # fmt: skip
    """Draw yielded cells and opened hinges on the frame at the n-th recorded time.

    Yielded cells are coloured by the energy that plastic strains dissipated per length (J/m).  In
    cells with fibres, the energy of cracks is added.  Opened hinges are circles, which grow with
    the dissipated fraction of the fracture energy; from 99 % on they are hollow, as joints are.
    Hinges that harden are coloured by their largest plastic rotation so far.  With acceptance
    ``limits``, see ``structures.hinge_table``, all hinges are coloured by the limit that they meet.
    """
    from matplotlib.collections import LineCollection
    from mpl_toolkits.mplot3d.art3d import Line3DCollection

    numbering, in_space = solution.numbering, solution.scene.in_space
    if not any(map(can_yield, solution.scene.connectors)):
        for beam in solution.scene.beams[:1]:
            solution.material(beam)  # raises if the scene is elastic
    canvas = fitted_canvas(solution, [n], magnify, ax)
    shape, density = canvas.shape(n), dissipated_per_length(solution, n)
    title = f"damage at {solution.parameter.at(solution.times[n])}{style.magnified(magnify)}"
    with scene_axes(ax, solution.scene, title) as axes:
        draw_undeformed(axes, solution, canvas)
        draw_beams(axes, solution, shape.nodes, color=shade(INK), linewidth=2.0, zorder=2)
        draw_strokes(axes, symbols.all_symbols(shape))
        yielded = density > 0.0
        if yielded.any():
            unit, prefix = style.decimal_prefix(float(density.max()))
            colors = style.scale("YlOrRd", 0.2, 1.0, 0.0, float(density.max()) / unit)
            kind: Any = Line3DCollection if in_space else LineCollection
            zones = kind(
                list(shape.nodes[numbering.nodes_along_cells[yielded]]),
                colors=colors.to_rgba(density[yielded] / unit),
                linewidths=11.0, capstyle="butt", zorder=3, gid="yielded",
            )  # fmt: skip
            axes.add_collection(zones)
            placed = [beam.section.fibres for beam in solution.scene.beams]
            cracks = any(f.softening is not None for p in placed if p is not None for f in p.fibres)
            title = "dissipated by plastic strains" + (" and cracks" if cracks else "")
            style.draw_bar(axes, colors, f"{title} ({prefix}J/m)")
        if hinges := open_hinges(solution, n, shape.at, limits):
            _draw_hinges(axes, ax, solution, shape, hinges, limits)
        arrange(axes, ax)
    return style.parent_figure(axes)


def _draw_hinges(
    axes: Axes, ax: Axes | None, solution: Solution, shape: DeformedShape,
    hinges: Sequence[OpenHinge], limits: Mapping[str, float],
) -> None:  # fmt: skip
    """Draw open hinges with a legend or a colour bar."""
    colors: list[Any] = [BLUE] * len(hinges)
    entries: list[tuple[float, str, Any]] = []  # of the legend: fraction, words, colour
    if not all(math.isnan(hinge.fraction) for hinge in hinges):
        entries += [(0.1, "hinge, 10 % broken", BLUE), (0.5, "50 %", BLUE), (1, "fully open", BLUE)]
    if limits:
        words, names = [f"{x}, up to {y:g} rad" for x, y in limits.items()], [*limits]
        names.append(f"beyond {names[-1]}")
        shades = style.scale("YlOrRd", 0.3, 1.0, 0.0, len(limits)).to_rgba(np.arange(len(names)))
        of_state = dict(zip(names, shades, strict=True))
        colors = [of_state.get(hinge.state, BLUE) for hinge in hinges]
        entries += zip([math.nan] * len(names), [*words, names[-1]], shades, strict=True)
    elif hardened := [k for k, hinge in enumerate(hinges) if math.isnan(hinge.fraction)]:
        rotations = np.array([hinges[k].rotation for k in hardened])
        unit, prefix = style.decimal_prefix(float(rotations.max()))
        rule = style.scale("YlOrRd", 0.2, 1.0, 0.0, float(rotations.max()) / unit)
        for k, color in zip(hardened, rule.to_rgba(rotations / unit), strict=True):
            colors[k] = color
        style.draw_bar(axes, rule, f"plastic rotation of hinges ({prefix}rad)")
    mark_hinges(axes, solution, shape, hinges, colors)
    handles = [axes.plot([], [], **circle(x, color), label=words)[0] for x, words, color in entries]
    if handles:
        style.draw_legend(axes, ax, handles, loc="outside upper left", ncols=3)
