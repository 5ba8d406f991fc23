# SPDX-License-Identifier: MIT
"""Pictures of analyses of structures: capacity curves, responses to spectra."""

from __future__ import annotations

from collections.abc import Sequence
from functools import partial
from itertools import groupby
from typing import TYPE_CHECKING, Any

import numpy as np

from ufl_beam.analysis.calibration_result import Calibration
from ufl_beam.analysis.incremental_dynamics_result import PERCENT, DemandCurves
from ufl_beam.analysis.load_combinations_result import LoadCombinations
from ufl_beam.analysis.pushover_result import Pushover, TargetDisplacement
from ufl_beam.arrays import Array
from ufl_beam.display import html_page
from ufl_beam.errors import ArgumentError, require_all
from ufl_beam.plotting import notebook, style
from ufl_beam.plotting.frame_pictures import (
    MOST,
    PointLabel,
    draw_frame,
    plane_canvas,
    write_labels,
)
from ufl_beam.plotting.style import BLUE, COLORS, GREY, INK, ORANGE, RED, shade
from ufl_beam.simulation.solution import Solution

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

MOST_NAMED = 12  # largest number of events that a legend names


def draw_pushover(
    pushover: Pushover,
    *,
    targets: TargetDisplacement | Sequence[TargetDisplacement] = (),
    ax: Axes | None = None,
) -> Figure:
    """Draw the capacity curve with numbered hinges, and the idealised curves of targets.

    Events of the same step share a number.  Numbers for which there is no space are omitted.
    """
    several = (targets,) if isinstance(targets, TargetDisplacement) else tuple(targets)
    sign = float(np.sign(pushover.target))
    unit, prefix = style.decimal_prefix(float(np.abs(pushover.base_shear).max()))
    with style.panel(ax, (8.0, 5.0)) as axes:
        style.time_axes(axes)
        axes.margins(0.05, 0.1)
        axes.plot(pushover.displacement, pushover.base_shear / unit, color=BLUE, zorder=3)
        for target, color in zip(several, (RED, *COLORS[2:]), strict=False):
            d, V = target.yield_displacement, target.yield_shear
            far, end = max(target.displacement, d), V
            if target.method != "N2" and target.displacement > d:
                end = float(
                    np.interp(far, *(sign * pushover.displacement, sign * pushover.base_shear))
                )
            axes.plot(
                [0.0, sign * d, sign * far], [0.0, sign * V / unit, sign * end / unit], "--",
                color=color, linewidth=1.4, zorder=2,
            )  # fmt: skip
            axes.axvline(
                sign * target.displacement, color=color, linewidth=1.4, linestyle=":", zorder=2,
                label=f"{target.method}: {target.displacement:.3g} m",
            )  # fmt: skip
        steps = [list(same) for _, same in groupby(pushover.hinges, key=lambda hinge: hinge.n)]
        numbers = []
        for number, same in enumerate(steps, start=1):
            at = same[0].displacement, same[0].base_shear / unit
            names = [f"{hinge.where} {hinge.what}" for hinge in same]
            words = names[0] + (f" and {len(names) - 1} more" if len(names) > 1 else "")
            label = f"{number}: {words}" if len(steps) <= MOST_NAMED else None
            axes.plot(*at, "o", color=shade(ORANGE), ms=6.0, zorder=4, label=label)
            outward = sign * np.array([-0.6, 0.8])
            numbers.append(PointLabel(str(number), shade(INK), np.array(at), outward))
        axes.axhline(0.0, color=GREY, linewidth=1.0, zorder=1)
        axes.set_xlabel(f"{pushover.component} of {pushover.place} (m)")
        axes.set_ylabel(f"base shear ({prefix}N)")
        if several or 0 < len(steps) <= MOST_NAMED:
            style.draw_legend(
                axes, ax, loc="outside upper left", ncols=2, fontsize=style.font_size(10.0)
            )
        write_labels(axes, numbers)
    return style.parent_figure(axes)


def draw_response(response: Any, *, quantity: str = "M", ax: Axes | None = None) -> Figure:
    """Draw a section force of a :class:`SpectralResponse` on the frame, with both signs."""
    diagrams = [
        (beam, sign * getattr(response.diagram(beam), quantity))
        for beam in response.scene.beams
        for sign in (1.0, -1.0)
    ]
    title = f"{style.RESULTANTS[quantity][0]} {quantity}", "by response spectrum"
    return _on_frame(response.modes.motion(0), title, quantity, diagrams, ax)


def draw_combinations(
    combined: LoadCombinations, *, quantity: str = "M", ax: Axes | None = None
) -> Figure:
    """Draw the envelope of a section force over load combinations on the undeformed frame."""
    index, solutions = list(style.RESULTANTS).index(quantity), [*combined.solutions.values()]
    reached = [(beam, combined.section_forces(beam)) for beam in solutions[0].scene.beams]
    diagrams = [
        (beam, values[:, index])
        for beam, extremes in reached
        for values in (extremes.high, extremes.low)
    ]
    title = f"extremes of the {style.RESULTANTS[quantity][0]} {quantity}"
    return _on_frame(
        solutions[0], (title, f"of {len(solutions)} load combinations"), quantity, diagrams, ax
    )


def draw_dynamics(dynamics: DemandCurves, *, labels: Sequence[str] | None = None) -> Figure:
    """Draw intensities over demands, with fractiles, beside the probability of collapse.

    The curve of a motion ends at its first collapse.  The probability is left out if it has no fit.
    ``labels`` are texts for demand and intensity, which may have units.
    """
    words = require_all(dynamics.labels if labels is None else labels, "plot: labels", str)
    if len(words) != 2:
        raise ArgumentError(f"plot: labels = {words} must be two texts, for demand and intensity")
    try:
        fragility = dynamics.fragility()
    except ArgumentError:
        fragility = None
    im, limit = dynamics.intensities, dynamics.limit
    with style.picture((11.0 if fragility else 7.0, 5.0)) as figure:
        axes, *others = figure.subplots(1, 2 if fragility else 1, sharey=True, squeeze=False)[0]
        rows = np.where(dynamics.collapsed, np.inf, dynamics.demand)
        for k, demand in enumerate(rows):
            label = f"{len(rows)} motions" if not k else None
            _draw_curve(axes, demand, im, limit, color=GREY, lw=0.8, label=label)
        fractiles = zip(PERCENT, dynamics.fractiles(), ("--", "-", ":"), strict=True)
        for percent, demand, line in fractiles:
            label = f"{percent:g} % of the motions"
            _draw_curve(axes, demand, im, limit, color=BLUE, lw=2.2, ls=line, label=label)
        axes.set(xlim=(0.0, limit), ylim=(0.0, 1.05 * im[-1]), xlabel=words[0], ylabel=words[1])
        axes.legend(loc="lower right", fontsize=style.font_size(9.0))
        if fragility:
            (right,) = others
            x = np.linspace(0.0, 1.05 * im[-1], 200)[1:]
            label = f"median {fragility.median:.3g}, dispersion {fragility.dispersion:.2g}"
            right.plot(fragility(x), x, color=RED, label=label)
            right.plot(fragility.exceeded / fragility.number, im, "o", color=shade(RED))
            right.set(xlim=(-0.03, 1.03), xlabel="probability of collapse")
            right.legend(loc="lower right", fontsize=style.font_size(9.0))
    return figure


def _draw_curve(axes: Axes, demand: Array, im: Array, limit: float, **options: Any) -> None:
    """Draw intensities over demands from zero on, up to the first infinite demand."""
    known = np.isfinite(demand)
    end = len(demand) if known.all() else int(np.argmin(known))
    x, y = np.append(0.0, demand[:end]), np.append(0.0, im[:end])
    if end < len(demand) and np.isinf(demand[end]):
        x, y = np.append(x, limit), np.append(y, im[end])
    axes.plot(x, y, **options)


def draw_calibration(fit: Calibration) -> Figure:
    """Draw measured and computed values of each measurement, and below the residuals.

    Residuals are divided by the standard deviations; a band of two of them is grey.
    """
    number = len(fit.measured)
    with style.picture((max(6.0, 5.0 * number), 5.5)) as figure:
        rows = figure.subplots(2, number, sharex="col", squeeze=False, height_ratios=(3, 1))
        data = zip(fit.measured, fit.solutions, fit.residuals, fit.sigma, strict=True)
        for (above, below), (m, run, residuals, sigma) in zip(rows.T, data, strict=True):
            at = np.arange(1, len(m) + 1) if m.times is None else np.asarray(m.times)
            if m.times is None:
                above.plot(at, m.values - residuals, "_", color=BLUE, ms=14.0, label="computed")
            else:
                above.plot(run.times, np.asarray(m.quantity(run)), color=BLUE, label="computed")
            above.plot(at, m.values, ".", color=shade(RED), ms=5.0, zorder=3, label="measured")
            above.set_title(m.name, loc="left")
            above.set_ylabel(m.labels[1])
            above.legend(fontsize=style.font_size(9.0))
            below.axhspan(-2.0, 2.0, color=GREY, alpha=0.3, lw=0)
            below.axhline(0.0, color=BLUE, lw=1.0)
            below.plot(at, residuals / sigma, ".", color=shade(RED), ms=4.0)
            below.set(xlabel=m.labels[0], ylabel="residual / σ")
            if m.times is None:
                below.set(xlabel="number of the value", xlim=(0.5, len(m) + 0.5))
                below.xaxis.get_major_locator().set_params(integer=True, min_n_ticks=1)
    return figure


@html_page.register
def calibration_page(fit: Calibration) -> str:
    """Write a calibration as HTML: its parameters, remarks, and a picture."""
    head, *rows = fit.table()
    text = notebook.lines(repr(fit)[1:-1]) + notebook.table(head, rows)
    text += notebook.lines(*fit.remarks())
    return text + notebook.image("measured and computed values", partial(draw_calibration, fit))


def _on_frame(
    solution: Solution,
    title: tuple[str, str],
    quantity: str,
    diagrams: Sequence[tuple[Any, Array]],
    ax: Axes | None,
) -> Figure:
    """Draw diagrams of a section force on the undeformed frame of a solution."""
    shape = plane_canvas(solution, [], 1.0, ax, MOST)[0].undeformed
    return draw_frame(ax, solution, 0, shape, title, quantity, diagrams)
