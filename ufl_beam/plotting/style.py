# SPDX-License-Identifier: MIT
"""Style of all pictures: colours, lines and areas, values with units, figures.

Figures belong to no window, need no screen, and are gone when they are no longer used.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator
from contextlib import contextmanager
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from ufl_beam.arrays import Array
from ufl_beam.errors import SceneError
from ufl_beam.parallel import active_comm

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

# Okabe and Ito's palette, which the colour-blind can tell apart.
BLUE, RED, GREEN, PINK, ORANGE, SKY = (
    "#0072B2", "#D55E00", "#009E73", "#CC79A7", "#E69F00", "#56B4E9",
)  # fmt: skip
COLORS = (BLUE, RED, GREEN, PINK, ORANGE, SKY)  # of lines in one picture
INK, GREY, WHITE = "#222222", "#B5B5B5", "#FFFFFF"

# Layers: beneath the beams, over them, upon the areas there, and over the pins of joints
BACK, MIDDLE, UPON, FRONT = 2.5, 4.2, 4.3, 5.5
RESULTANTS = {"N": ("axial force", "N"), "V": ("shear force", "N"), "M": ("bending moment", "N m")}

POINTS = 72.0  # points of an inch

STYLE = {
    "font.size": 13.0, "axes.titlesize": 14.0, "axes.labelsize": 13.0, "axes.edgecolor": "#888888",
    "axes.spines.top": False, "axes.spines.right": False, "legend.frameon": False,
    "legend.fontsize": 12.0, "lines.linewidth": 2.0, "lines.solid_capstyle": "round",
}  # fmt: skip


class Stroke(NamedTuple):
    """Line, or an area if it is filled."""

    points: Array  # (n, 2); m
    color: str = INK
    weight: float = 1.6  # width of the line; points
    fill: str | None = None  # colour of the area
    layer: float = MIDDLE


def decimal_prefix(value: float) -> tuple[float, str]:
    """Find the power of 1000 that leaves 1 to 1000 of a value, and its prefix: (1000.0, "k")."""
    rounded = abs(float(f"{value:.3g}"))
    power = min(max(math.floor(math.log10(rounded) / 3), -3), 3) if rounded > 0.0 else 0
    return 1000.0**power, ("n", "µ", "m", "", "k", "M", "G")[power + 3]


def with_unit(value: float, unit: str) -> str:
    """Write a value with three digits and a decimal prefix: "−12.3 kN m"."""
    factor, prefix = decimal_prefix(value)
    return f"{number(value / factor)} {prefix}{unit}"


def number(value: float) -> str:
    """Write a number with three digits and a minus sign that is one: "−12.3"."""
    return f"{value:.3g}".replace("-", "−")


def magnified(factor: float, before: str = ", ") -> str:
    """Write the factor on displacements in words; nothing if it is 1."""
    return f"{before}displacements × {factor:g}" if factor != 1 else ""


def require_choice(choice: str, choices: Iterable[str], what: str) -> None:
    """Raise :class:`SceneError` naming ``what`` unless ``choice`` is one of ``choices``."""
    if choice not in choices:
        names = ", ".join(f'"{name}"' for name in choices)
        raise SceneError(f"{what} = {choice!r} is not one of {names}")


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
        if active_comm().rank > 0:
            figure.savefig = lambda *args, **options: None  # type: ignore[method-assign]
        yield figure


def plane_axes(figure: Figure, title: str) -> Axes:
    """Add axes of the plane of motion, both to one scale."""
    axes = figure.add_subplot(aspect="equal")
    axes.margins(0.06, 0.10)
    axes.set(xlabel="x (m)", ylabel="y (m)")
    axes.set_title(title, loc="left", color=INK, wrap=True)
    axes.tick_params(labelsize=12, color="#888888")
    return axes


def time_axes(axes: Axes) -> Axes:
    """Set axes up for histories over time."""
    axes.margins(x=0.0)
    axes.grid(axis="y", color="#E8E8E8", linewidth=0.8)
    axes.set_axisbelow(True)
    axes.tick_params(labelsize=12, color="#888888")
    return axes


def scale(name: str, first: float, last: float, low: float, high: float) -> Any:
    """Make a colour map for values from low to high, without the end that is not seen on white."""
    import matplotlib as mpl
    from matplotlib.cm import ScalarMappable
    from matplotlib.colors import ListedColormap, Normalize

    colors = ListedColormap(mpl.colormaps[name](np.linspace(first, last, 256)))
    return ScalarMappable(Normalize(low, high), colors)


def draw_bar(figure: Figure, axes: Axes, colors: Any, label: str) -> None:
    """Draw the colour bar of a :func:`scale`."""
    bar = figure.colorbar(colors, ax=axes, shrink=0.85, aspect=25, pad=0.02)
    bar.set_label(label)
    bar.ax.spines["outline"].set_visible(False)


def make_room(figure: Figure, axes: Axes) -> None:
    """Extend the limits such that texts and symbols stay off the edge."""
    figure.draw_without_rendering()
    boxes = [text.get_window_extent().get_points() for text in axes.texts]
    for line in axes.lines:
        at = axes.transData.transform(line.get_xydata())
        if line.get_linestyle() == "None" and len(at):  # symbols
            half = line.get_markersize() / 2 * figure.dpi / POINTS
            boxes.append(np.array([at.min(axis=0) - half, at.max(axis=0) + half]))
    for box in boxes:
        axes.update_datalim(axes.transData.inverted().transform(box))
    axes.autoscale_view()


def half_size(figure: Figure, axes: Axes, text: str, size: float, **style: Any) -> Array:
    """Measure half of the width and height of a text; (2,); points."""
    probe = axes.text(0.0, 0.0, text, fontsize=size, **style)
    box = probe.get_window_extent()
    probe.remove()
    return np.asarray(np.array([box.width, box.height]) / 2 * POINTS / figure.dpi)
