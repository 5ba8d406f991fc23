# SPDX-License-Identifier: MIT
"""Style of all pictures: colours, lines and areas, values with units, figures.

Figures belong to no window, need no screen, and are freed when they are no longer used.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator, Sequence
from contextlib import contextmanager
from functools import partial
from io import BytesIO
from typing import TYPE_CHECKING, Any

import numpy as np

from ufl_beam.arrays import Array
from ufl_beam.errors import ArgumentError
from ufl_beam.parallel import active_comm

if TYPE_CHECKING:
    from matplotlib.artist import Artist as Artist
    from matplotlib.axes import Axes as Axes
    from matplotlib.axis import Axis
    from matplotlib.figure import Figure as Figure
    from matplotlib.text import Annotation as Annotation
else:
    Artist = Axes = Axis = Figure = Annotation = Any

# Okabe and Ito's palette, which colour-blind readers can distinguish.
BLUE, RED, GREEN, PINK, ORANGE, SKY = (
    "#0072B2", "#D55E00", "#009E73", "#CC79A7", "#E69F00", "#56B4E9",
)  # fmt: skip
COLORS = (BLUE, RED, GREEN, PINK, ORANGE, SKY)  # of lines in one picture
INK, TEXT, GREY, WHITE = "#222222", "#444444", "#B5B5B5", "#FFFFFF"

RESULTANTS = {"N": ("axial force", "N"), "V": ("shear force", "N"), "M": ("bending moment", "N m")}
COLUMNS = {"N": [0], "V": [1, 2], "T": [3], "M": [4, 5]}
COLUMNS |= {"V2": [1], "V3": [2], "M2": [4], "M3": [5]}
"""Columns of section forces in space; V and M are vectors across the beam."""

COMPONENTS = "M3", "M2", "T", "N", "V2", "V3"
"""Section forces in space whose envelopes are drawn."""

POINTS = 72.0  # points per inch
CSS_DPI = 80.0  # pixels on an HTML page per inch of a figure
FONT = 13.0  # default size of texts; points
FRAME = "#888888"  # colour of axes and their ticks

SIZES = {
    "axes.titlesize": 14.0, "axes.labelsize": 13.0, "legend.fontsize": 12.0,
    "xtick.labelsize": 12.0, "ytick.labelsize": 12.0,
}  # fmt: skip
"""Sizes of other texts if the default size is :data:`FONT`; points."""

STYLE: dict[str, Any] = {
    "text.color": INK, "figure.dpi": 150.0, "lines.linewidth": 2.0,
    "axes.edgecolor": FRAME, "axes.spines.top": False, "axes.spines.right": False,
    "xtick.color": FRAME, "ytick.color": FRAME, "grid.color": "#E8E8E8",
    "legend.frameon": False, "lines.solid_capstyle": "round",
}  # fmt: skip
"""Settings of Matplotlib."""


def decimal_prefix(value: float) -> tuple[float, str]:
    """Return the power of 1000 by which a written value is divided, and its prefix: (1e3, "k")."""
    rounded = abs(float(f"{value:.3g}"))
    power = min(max(math.floor(math.log10(rounded) / 3), -3), 3) if rounded > 0.0 else 0
    return 1000.0**power, ("n", "µ", "m", "", "k", "M", "G")[power + 3]


def with_unit(value: float, unit: str) -> str:
    """Write a value with three digits and a decimal prefix: "−12.3 kN m"."""
    factor, prefix = decimal_prefix(value)
    return f"{number(value / factor)} {prefix}{unit}"


def number(value: float) -> str:
    """Write a number with three digits and a true minus sign: "−12.3"."""
    return f"{value:.3g}".replace("-", "−")


def magnified(factor: float, before: str = ", ") -> str:
    """Return words on the factor on displacements, or an empty text if it is 1."""
    return f"{before}displacements × {factor:g}" if factor != 1 else ""


def resultant(name: str) -> tuple[str, str]:
    """Return words with the name of a section force, such as "bending moment M2", and its unit."""
    words, unit = (RESULTANTS | {"T": ("torsional moment", "N m")})[name[0]]
    return f"{words} {name}", unit


def components(forces: Array, name: str) -> Array:
    """Return components of a section force from (..., 3), or in space (..., 6); (..., 1 or 2)."""
    in_plane = forces.shape[-1] == len(RESULTANTS)
    return forces[..., [[*RESULTANTS].index(name)] if in_plane else COLUMNS[name]]


def require_option(option: str, options: Iterable[str], what: str) -> None:
    """Raise :class:`ArgumentError` naming ``what`` unless ``option`` is one of ``options``."""
    if option not in options:
        names = ", ".join(f'"{name}"' for name in options)
        raise ArgumentError(f"{what} = {option!r} is not one of {names}")


@contextmanager
def picture(size: tuple[float, float]) -> Iterator[Figure]:
    """Open a new figure in the style of the package, also for pictures of a user.

    Only the first process saves the figure, as all run the same script.  The user's settings and
    styles of Matplotlib, such as ``plt.style.use("dark_background")``, have priority.  A notebook
    cell that ends with the figure shows it.  Logarithmic axes get labels such as 1, 2, 5, 10, or
    powers of ten, unless ticks are set.

    Args:
        size: Width and height; inch.

    Example:
        >>> with ub.picture((6, 4)) as figure:
        ...     lines = figure.subplots().plot(solution.times, solution.position(beam.end)[:, 1])
        >>> figure.savefig("drop.png")
    """
    import matplotlib as mpl
    from matplotlib.figure import Figure

    now, default = mpl.rcParams["font.size"], mpl.rcParamsDefault["font.size"]
    font = FONT if now == default else now  # other sizes are proportional to it
    sizes = {"font.size": font, **{name: size / FONT * font for name, size in SIZES.items()}}
    with mpl.rc_context(_unless_chosen({**STYLE, **sizes})):
        figure = Figure(figsize=size, layout="constrained")
        # Notebooks call _repr_png_.
        vars(figure).update(savefig=partial(_save, figure), _repr_png_=partial(png, figure))
        yield figure


def _save(figure: Figure, *args: Any, **options: Any) -> None:
    """Label logarithmic axes, and save a figure on the first process only.

    Labels are at powers of ten if at least three are in view.  Otherwise they are at 1, 2 and 5
    times powers of ten if at least two are in view, or else at equal steps.
    """
    from matplotlib.ticker import LogFormatterSciNotation, LogLocator, MaxNLocator, NullFormatter

    if active_comm().rank > 0:
        return
    powers = LogFormatterSciNotation(minor_thresholds=(np.inf, np.inf))  # labels all ticks
    fine, equal = LogLocator(subs=(1.0, 2.0, 5.0)), MaxNLocator(5, steps=[1, 2, 5, 10])
    for axis in (axis for axes in figure.axes for axis in (axes.xaxis, axes.yaxis)):
        if axis.get_scale() == "log" and axis.isDefault_majloc:
            low, high = sorted(axis.get_view_interval())
            for locator, least in ((LogLocator(), 3), (fine, 2), (equal, 0)):
                if sum(low <= tick <= high for tick in locator.tick_values(low, high)) >= least:
                    break
            axis.set_major_locator(locator)
            axis.set_major_formatter("{x:g}" if low > 5e-5 and high < 2e5 else powers)
            axis.set_minor_formatter(NullFormatter())
    type(figure).savefig(figure, *args, **options)


def png(figure: Figure) -> tuple[bytes, dict[str, int]]:
    """Return a figure as PNG, and its width on an HTML page; pixels."""
    file = BytesIO()
    figure.savefig(file, format="png")
    return file.getvalue(), {"width": round(CSS_DPI * figure.get_figwidth())}


@contextmanager
def panel(
    ax: Axes | None, size: tuple[float, float], projection: str | None = None
) -> Iterator[Axes]:
    """Open axes of a new :func:`picture`, or the user's axes ``ax``, which keep their size."""
    import matplotlib as mpl

    if ax is None:
        with picture(size) as figure:
            yield figure.add_subplot(projection=projection)
        return
    with mpl.rc_context(_unless_chosen(STYLE)):
        yield ax


def _unless_chosen(ours: dict[str, Any]) -> dict[str, Any]:
    """Return our settings and line colours without those that the user has changed."""
    import matplotlib as mpl
    from cycler import cycler

    now, default = mpl.rcParams, mpl.rcParamsDefault
    labels = {f"{x}tick.labelcolor": now["axes.labelcolor"] for x in "xy"}
    ours = {**ours, **labels, "axes.prop_cycle": cycler(color=COLORS)}
    return {name: value for name, value in ours.items() if now[name] == default[name]}


def font_size(size: float) -> float:
    """Scale a font size by the ratio of the user's default size to :data:`FONT`; points."""
    import matplotlib as mpl

    return float(size / FONT * mpl.rcParams["font.size"])


def shade(color: str) -> str:
    """Replace dark colours by the user's text colour, and white by the user's background."""
    import matplotlib as mpl

    now = mpl.rcParams
    chosen = {WHITE: now["axes.facecolor"]}
    if now["text.color"] != INK:
        chosen |= dict.fromkeys((INK, TEXT), now["text.color"])
    return str(chosen.get(color, color))


def time_axes(axes: Axes) -> Axes:
    """Set up axes for histories over time."""
    axes.margins(x=0.0)
    axes.grid(axis="y", linewidth=0.8)
    axes.set_axisbelow(True)
    return axes


def zero_lines(axes: Axes, *, x: bool = True, y: bool = True) -> None:
    """Draw thin lines at x = 0 and y = 0, below the curves."""
    for draw in (axes.axvline,) * x + (axes.axhline,) * y:
        draw(0.0, color=GREY, linewidth=1.0, zorder=1)


def parent_figure(axes: Axes) -> Figure:
    """Return the figure that axes are in."""
    return axes.figure.figure


def draw_legend(
    axes: Axes,
    ax: Axes | None,
    handles: Sequence[Artist] | None = None,
    *,
    fontsize: float | None = None,
    **outside: Any,
) -> None:
    """Draw a legend outside the axes of a new figure, or inside the user's axes ``ax``."""
    if ax is None:
        parent_figure(axes).legend(handles=handles, fontsize=fontsize, **outside)
    else:
        where = "best" if handles is None else "lower left"
        axes.legend(handles=handles, fontsize=fontsize, loc=where)


def scale(name: str, first: float, last: float, low: float, high: float) -> Any:
    """Make a colour scale for values from ``low`` to ``high``.

    The colours are from ``first`` to ``last``, fractions from 0 to 1, in the colour map ``name``.
    """
    import matplotlib as mpl
    from matplotlib.cm import ScalarMappable
    from matplotlib.colors import ListedColormap, Normalize

    colors = ListedColormap(mpl.colormaps[name](np.linspace(first, last, 256)))
    return ScalarMappable(Normalize(low, high), colors)


def draw_bar(axes: Axes, colors: Any, label: str) -> Any:
    """Draw the colour bar of a :func:`scale`, beside the numbers of axes in space; return it."""
    pad = 0.1 if hasattr(axes, "get_zlim") else 0.02
    bar = axes.figure.colorbar(colors, ax=axes, shrink=0.85, aspect=25, pad=pad)
    bar.set_label(label)
    bar.ax.spines["outline"].set_visible(False)
    return bar


def lay_out(axes: Axes) -> Array:
    """Compute the place of axes in their figure; return their width and height; (2,); points.

    This takes half the time of drawing the figure.
    """
    figure = parent_figure(axes)
    if engine := figure.get_layout_engine():
        engine.execute(figure)
    locator: Any = axes.get_axes_locator()
    axes.apply_aspect(locator and locator(axes, None))
    return np.multiply(axes.get_window_extent().size, POINTS / figure.dpi)


def label_axis(axis: Axis, values: Array, quantity: str, unit: str) -> None:
    """Label an axis in a unit with a prefix that suits the values; data stay in SI units."""
    factor, prefix = decimal_prefix(float(np.max(np.abs(values))))
    axis.set_major_formatter(lambda x, _: f"{x / factor:.6g}".replace("-", "−"))
    axis.set_label_text(f"{quantity} ({prefix}{unit})")
