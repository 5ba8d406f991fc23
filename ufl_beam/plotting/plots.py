# SPDX-License-Identifier: MIT
"""Pictures of a solution in its plane, by Matplotlib: what is drawn, and how it looks.

Every function returns a Matplotlib figure, so that ``plot(solution, "M").savefig("portal.png")``
works; it belongs to no window, needs no screen, and is gone when it is no longer used.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator, Sequence
from contextlib import contextmanager
from itertools import cycle, islice
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from ufl_beam.arrays import Array
from ufl_beam.errors import SceneError, require_number
from ufl_beam.model.bodies import Anchor, Member
from ufl_beam.model.material_laws import HingeLaw
from ufl_beam.model.plastic_hinges import law_of, place_of
from ufl_beam.parallel import ours
from ufl_beam.plotting import symbols
from ufl_beam.plotting.connector_glyphs import BLUE, GREEN, GREY, INK, ORANGE, PINK, RED, SKY
from ufl_beam.plotting.scene_layout import Pose, Stage
from ufl_beam.plotting.symbols import Stroke
from ufl_beam.simulation.solution import Solution

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

RESULTANTS = {"N": ("axial force", "N"), "V": ("shear force", "N"), "M": ("bending moment", "N m")}
COMPONENTS = {
    "u": ("displacement", "m"),
    "v": ("displacement", "m"),
    "psi": ("rotation", "rad"),
    "du/dt": ("velocity", "m/s"),
    "dv/dt": ("velocity", "m/s"),
    "dpsi/dt": ("angular velocity", "rad/s"),
}

STYLE = {
    "font.size": 13.0,
    "axes.titlesize": 14.0,
    "axes.labelsize": 13.0,
    "axes.edgecolor": "#888888",
    "axes.spines.top": False,
    "axes.spines.right": False,
    "legend.frameon": False,
    "legend.fontsize": 12.0,
    "lines.linewidth": 2.0,
    "lines.solid_capstyle": "round",
}


# -- what users call ---------------------------------------------------------------------------


def plot_shapes(
    solution: Solution,
    times: Sequence[float] = (),
    *,
    count: int = 8,
    magnify: float = 1.0,
) -> Figure:
    """Draw successive shapes in one picture, coloured by time or load factor.

    Args:
        solution: What to show.
        times: The times, or the load factors of a path, each replaced by the nearest that was
            kept; s.  Without, ``count`` of them from the first to the last, evenly spaced in time,
            or along the path.
        count: How many, if no times are given.
        magnify: Factor on the displacements.

    Raises:
        SceneError: ``times`` is one number, ``count`` is less than 1, or ``magnify`` is not
            positive.

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
    chosen = nearest(kept, times) if len(times) else evenly(solution, int(count))
    shapes = [moved_points(solution, n, magnify) for n in chosen]
    factor = f"displacements × {magnify:g}" if magnify != 1 else ""
    stage = plane_stage(solution, chosen, magnify)
    poses = [stage.pose(n) for n in chosen]
    everything = (solution.grid.points, *shapes, *(pose.points() for pose in poses))
    with picture(plane_size(*everything)) as figure:
        of_time = scale("viridis", 0.0, 0.88, kept[chosen].min(), kept[chosen].max())
        axes = plane_axes(figure, factor)
        draw_undeformed(axes, stage)
        for n, points, pose in zip(chosen, shapes, poses, strict=True):
            color = of_time.to_rgba(kept[n])
            draw_strokes(axes, (*symbols.bodies(pose), *symbols.rods(pose)), color)
            draw_axes(axes, solution, points, color=color, linewidth=2.2, zorder=3)
            _draw_masses(axes, pose, color)
        _draw_fixings(axes, poses[-1])
        draw_bar(figure, axes, of_time, solution.parameter.name)
    return figure


def plot_history(
    solution: Solution, places: Anchor | Sequence[Anchor], *, component: str = "v"
) -> Figure:
    """Draw a component of the motion of one or more places over time.

    Args:
        solution: What to show.
        places: The places.
        component: "u", "v", "psi", "du/dt", "dv/dt" or "dpsi/dt".

    Raises:
        SceneError: Unknown ``component``, a place that is not in the scene, or the velocity of a
            static run.

    Example:
        >>> ub.plot_history(solution, beam.end, component="v").savefig("history.png")
    """
    require_choice(component, COMPONENTS, "plot_history: component")
    followed = (places,) if isinstance(places, Anchor) else tuple(places)
    number = list(COMPONENTS).index(component)
    motion = solution.displacement if number < 3 else solution.velocity
    quantity, unit = COMPONENTS[component]
    with picture((8.0, 4.2)) as figure:
        axes = time_axes(figure.add_subplot(), solution)
        axes.axhline(0.0, color=GREY, linewidth=1.0, zorder=1)
        for place, color in zip(followed, _cycle(len(followed)), strict=True):
            values = motion(place)[:, number % 3]
            axes.plot(solution.times, values, color=color, label=str(place))
        axes.set_ylabel(f"{quantity} {component.replace('psi', 'ψ')} ({unit})")
        axes.set_xlabel(solution.parameter.name)
        figure.legend(loc="outside upper left", ncols=2)
    return figure


def plot_energy(solution: Solution) -> Figure:
    """Draw the energy ledger over time or along a path, and below it its imbalance.

    Above: energy in the scene, solid; supplied, dashed; lost, dotted.  Below: the imbalance as a
    part of the energy that went through, with the machine precision for comparison.

    Example:
        >>> ub.plot_energy(solution).savefig("energy.png")
    """
    energy, precision = solution.energy, float(np.finfo(np.float64).eps)
    along = solution.progress
    entries = [
        (name, values, line)
        for group, line in ((energy.state, "-"), (energy.supplied, "--"), (energy.lost, ":"))
        for name, values in group.items()
    ]
    with picture((8.0, 6.0)) as figure:
        ledger, check = figure.subplots(2, 1, sharex=True, height_ratios=(2.4, 1))
        for (name, values, line), color in zip(entries, _cycle(len(entries)), strict=True):
            ledger.plot(along, values, line, color=color, label=name)
        time_axes(ledger, solution).set_ylabel("energy (J)")
        ledger.plot(along, energy.total, color=INK, linewidth=1.2, label="in the scene")
        figure.legend(loc="outside upper left", ncols=5)
        part = np.abs(energy.imbalance) / (energy.throughput or 1.0)
        # Where the balance is exact, the logarithm is not: such points stand at the lower edge.
        check.semilogy(along, np.maximum(part, 1e-2 * precision), color=RED, linewidth=1.2)
        check.axhline(precision, color=GREY, linewidth=1.0, zorder=1)
        check.annotate(
            "machine precision", (1.0, precision), (0, -3), va="top", ha="right", fontsize=11,
            xycoords=check.get_yaxis_transform(), textcoords="offset points", color="#777777",
        )  # fmt: skip
        check.set_ylim(1e-2 * precision, 10 * max(float(part.max()), 10 * precision))
        time_axes(check, solution).set_ylabel("imbalance\nper throughput")
        check.set_xlabel(solution.parameter.progress)
    return figure


# -- geometry and words that pictures of all kinds share ---------------------------------------


def moved_points(solution: Solution, n: int, magnify: float) -> Array:
    """Vertices of all beams at the n-th kept time; (num_vertices, 2); m.

    Raises:
        SceneError: No such time, or ``magnify`` is not positive.
    """
    kept = len(solution.times)
    if not -kept <= n < kept:
        raise SceneError(f"n = {n}: the solution kept {kept} times; give {-kept} to {kept - 1}")
    require_number(magnify, "magnify", positive=True)
    grid = solution.grid
    return np.asarray(grid.points + magnify * solution.q[n][grid.dofs[:, :2]])


class OpenHinge(NamedTuple):
    """A hinge that has opened.

    Attributes:
        beam: Its beam.
        at: Where it is now; (2,); m.
        part: Part of its fracture energy that is spent, from 0 (closed) to 1 (a joint); 0 if it
            hardens.
    """

    beam: Member
    at: Array
    part: float


def open_hinges(solution: Solution, n: int, points: Array) -> list[OpenHinge]:
    """Hinges that have opened at the n-th kept time: in cells, and of zero length.

    Args:
        solution: What to show.
        n: Number of the kept time.
        points: Where the nodes of the grid are; (num_nodes, 2); m.
    """
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


def evenly(solution: Solution, count: int) -> list[int]:
    """Numbers of so many kept states, evenly spaced in time or along a path."""
    progress = solution.progress
    return nearest(progress, np.linspace(progress[0], progress[-1], count))


def nearest(kept: Array, times: Sequence[float] | Array) -> list[int]:
    """Numbers of the kept times nearest to ``times``, ascending."""
    return [int(np.argmin(np.abs(kept - t))) for t in sorted(times)]


def decimal_prefix(value: float) -> tuple[float, str]:
    """Power of 1000 that leaves a value between 1 and 1000, and its prefix: (1000.0, "k")."""
    rounded = abs(float(f"{value:.3g}"))
    power = min(max(math.floor(math.log10(rounded) / 3), -3), 3) if rounded > 0.0 else 0
    return 1000.0**power, ("n", "µ", "m", "", "k", "M", "G")[power + 3]


def with_unit(value: float, unit: str) -> str:
    """A value with three digits and a decimal prefix: "−12.3 kN m"."""
    factor, prefix = decimal_prefix(value)
    return f"{value / factor:.3g} {prefix}{unit}".replace("-", "−")


def require_choice(choice: str, choices: Sequence[str] | dict[str, Any], what: str) -> None:
    """Raise :class:`SceneError` naming ``what`` unless ``choice`` is one of ``choices``."""
    if choice not in choices:
        names = ", ".join(f'"{name}"' for name in choices)
        raise SceneError(f"{what} = {choice!r} is not one of {names}")


# -- drawing -----------------------------------------------------------------------------------


@contextmanager
def picture(size: tuple[float, float]) -> Iterator[Figure]:
    """Open a new figure in the style of this module, for pictures of your own.

    Only the first process saves it, as all of them run the same script.

    Args:
        size: Width and height; inch.

    Example:
        >>> with ub.picture((6, 4)) as figure:
        ...     lines = figure.subplots().plot(solution.times, solution.position(beam.end)[:, 1])
        >>> figure.savefig("drop.png")
    """
    import matplotlib as mpl
    from matplotlib.figure import Figure

    with mpl.rc_context(STYLE):
        figure = Figure(figsize=size, dpi=150, layout="constrained")
        if ours().rank > 0:
            figure.savefig = lambda *args, **options: None  # type: ignore[method-assign]
        yield figure


def plane_size(*shapes: Array) -> tuple[float, float]:
    """Size of a figure for these points: 9 inches wide unless they stand upright."""
    width, height = np.ptp(np.concatenate(shapes), axis=0)
    return 9.0, float(np.clip(8.0 * height / max(width, 1e-12), 3.2, 6.8))


def plane_stage(solution: Solution, shown: Sequence[int], magnify: float) -> Stage:
    """A solution with symbols that are as large as those of supports in pictures of these states.

    Supports are drawn in points, which do not depend on the scale; what moves and stretches in m.
    """
    scene = solution.scene
    rough = Stage(solution, magnify, 0.02 * scene.size)
    shapes = [moved_points(solution, n, magnify) for n in shown]
    points = np.concatenate(
        [solution.grid.points, *shapes, *(rough.pose(n).points() for n in shown)]
    )
    width, height = np.ptp(points, axis=0)
    inches = plane_size(points)
    scale = max(1.12 * width / (inches[0] - 0.9), 1.20 * height / (inches[1] - 1.1))
    return Stage(solution, magnify, scale / 6.0, shown)  # 12 points


def plane_axes(figure: Figure, title: str) -> Axes:
    """Axes of the plane of motion, both to one scale."""
    axes = figure.add_subplot(aspect="equal")
    axes.margins(0.06, 0.10)
    axes.set_xlabel("x (m)")
    axes.set_ylabel("y (m)")
    axes.set_title(title, loc="left", color=INK)
    axes.tick_params(labelsize=12, color="#888888")
    return axes


def time_axes(axes: Axes, solution: Solution) -> Axes:
    """Let axes show something over time."""
    axes.margins(x=0.0)
    axes.grid(axis="y", color="#E8E8E8", linewidth=0.8)
    axes.set_axisbelow(True)
    axes.tick_params(labelsize=12, color="#888888")
    return axes


def _cycle(count: int) -> list[str]:
    return list(islice(cycle((BLUE, RED, GREEN, PINK, ORANGE, SKY)), count))


def scale(name: str, first: float, last: float, low: float, high: float) -> Any:
    """Colours of values from ``low`` to ``high``: a part of a colour map of Matplotlib.

    The bright end of a colour map would not be seen on white.
    """
    import matplotlib as mpl
    from matplotlib.cm import ScalarMappable
    from matplotlib.colors import ListedColormap, Normalize

    colors = ListedColormap(mpl.colormaps[name](np.linspace(first, last, 256)))
    return ScalarMappable(Normalize(low, high), colors)


def draw_bar(figure: Figure, axes: Axes, colors: Any, label: str) -> None:
    """The colour bar of a :func:`scale`."""
    bar = figure.colorbar(colors, ax=axes, shrink=0.85, aspect=25, pad=0.02)
    bar.set_label(label)
    bar.ax.spines["outline"].set_visible(False)


def draw_axes(axes: Axes, solution: Solution, points: Array, **line: Any) -> None:
    """The axes of all beams through these points."""
    for beam in solution.scene.beams:
        axes.plot(*points[solution.grid.nodes_along(beam)].T, **line)


def draw_undeformed(axes: Axes, stage: Stage) -> None:
    """Beams, bodies and rods in grey, where they were made."""
    solution, pose = stage.solution, stage.undeformed
    draw_axes(axes, solution, solution.grid.points, color=GREY, linewidth=1.2, zorder=1)
    for stroke in (*symbols.bodies(pose), *symbols.rods(pose)):
        axes.plot(*stroke.points.T, color=GREY, linewidth=1.2, zorder=1)


def make_room(figure: Figure, axes: Axes) -> None:
    """Extend the limits such that texts stay off the edge."""
    figure.draw_without_rendering()
    for text in axes.texts:
        axes.update_datalim(axes.transData.inverted().transform(text.get_window_extent()))
    axes.autoscale_view()


def draw_symbols(axes: Axes, pose: Pose) -> None:
    """Bodies, joints, connectors, supports and masses."""
    draw_strokes(axes, (*symbols.bodies(pose), *symbols.rods(pose)))
    _draw_fixings(axes, pose)
    draw_strokes(axes, symbols.centres(pose))
    for pin in symbols.pins(pose):
        marker, size, inside = ("o", 8.0, "white") if pin.turns else ("s", 6.0, INK)
        axes.plot(*pin.at, marker, ms=size, mfc=inside, mec=INK, mew=1.6, zorder=5)
    _draw_masses(axes, pose, INK)


def draw_strokes(axes: Axes, strokes: Iterable[Stroke], color: Any = None) -> None:
    """Lines and areas, in their own colours or all in one."""
    for points, own, weight, fill, layer in strokes:
        if fill is not None:
            inside = (color, 0.15) if color is not None else fill
            axes.fill(
                *points.T, facecolor=inside, edgecolor=own if color is None else color,
                linewidth=weight, zorder=layer, joinstyle="round",
            )  # fmt: skip
        else:
            axes.plot(
                *points.T, color=own if color is None else color, linewidth=weight, zorder=layer,
                solid_joinstyle="round",
            )  # fmt: skip


def _draw_masses(axes: Axes, pose: Pose, color: Any) -> None:
    for mass in pose.stage.scene.masses:
        axes.plot(*pose.at(mass.place), "o", ms=10.0, color=color, zorder=5)


def _draw_fixings(axes: Axes, pose: Pose) -> None:
    """Rails, connectors, and symbols at the supports; orange ones move."""
    from matplotlib.markers import MarkerStyle
    from matplotlib.path import Path

    draw_strokes(axes, (*symbols.rails(pose), *symbols.connectors(pose)))
    for footing in symbols.footings(pose):
        symbol = MarkerStyle(Path.make_compound_path(*map(Path, footing.outlines)))
        axes.plot(
            *footing.at, marker=symbol.rotated(rad=footing.angle), ms=24.0, mfc=footing.color,
            mec=footing.color, mew=0.5, zorder=3.5,
        )  # fmt: skip
