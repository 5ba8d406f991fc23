# SPDX-License-Identifier: MIT
"""Pictures of structural analyses; `ub.plot` draws them."""

from __future__ import annotations

from collections.abc import Sequence
from functools import partial
from itertools import groupby
from typing import TYPE_CHECKING, Any

import numpy as np

from ufl_beam.arrays import Array
from ufl_beam.display import TIME, html_page
from ufl_beam.errors import ArgumentError, require_all
from ufl_beam.plotting import notebook, style
from ufl_beam.plotting.frame_pictures import draw_envelope
from ufl_beam.plotting.history_pictures import bounds
from ufl_beam.plotting.labels import Label, around, write_labels
from ufl_beam.plotting.plot import IN_SPACE, PICTURES
from ufl_beam.plotting.style import BLUE, COLORS, GREY, INK, ORANGE, RED, picture, shade, with_unit
from ufl_beam.structures.calibration_result import Calibration
from ufl_beam.structures.fatigue import Fatigue, HotSpot
from ufl_beam.structures.ground_motion import GroundMotion
from ufl_beam.structures.incremental_dynamics import PERCENT, DemandCurves
from ufl_beam.structures.load_combinations import LoadCombinations
from ufl_beam.structures.pushover import Pushover, TargetDisplacement
from ufl_beam.structures.response_spectra import ResponseSpectrum
from ufl_beam.structures.section_analysis import InteractionDiagram, MomentCurvature
from ufl_beam.structures.spectral_analysis import SpectralResponse
from ufl_beam.structures.storeys_and_hinges import Storeys

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

MOST_NAMED = 12  # largest number of events that a legend names
CLASSES = 40  # number of bins of stress ranges, and of mean stresses, in pictures of cycles
SPECTRA = {
    "pseudo_acceleration": " (m/s²)", "acceleration": " (m/s²)", "velocity": " (m/s)",
    "displacement": " (m)", "ductility": "",
}  # fmt: skip
"""Units of the quantities of a response spectrum."""


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
                color=color, linewidth=1.4, zorder=2, label=f"{target.method}: idealised",
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
            numbers.append(Label(str(number), INK, around(np.array(at), outward)))
        style.zero_lines(axes, x=False)
        place = f"{pushover.component} of {pushover.place} (m)"
        axes.set(xlabel=place, ylabel=f"base shear ({prefix}N)")
        if several or 0 < len(steps) <= MOST_NAMED:
            style.draw_legend(
                axes, ax, loc="outside upper left", ncols=2, fontsize=style.font_size(10.0)
            )
        write_labels(axes, numbers)
    return style.parent_figure(axes)


def draw_response(
    response: SpectralResponse, *, quantity: str = "M", ax: Axes | None = None
) -> Figure:
    """Draw a section force of a :class:`SpectralResponse` on the frame, with both signs."""
    forces = [(x, getattr(response.diagram(x), quantity)[:, None]) for x in response.scene.beams]
    diagrams = [(beam, sign * values) for beam, values in forces for sign in (1.0, -1.0)]
    title = style.resultant(quantity)[0], "by response spectrum"
    return draw_envelope(response.modes.motion(0), title, quantity, diagrams, ax)


def draw_combinations(
    combined: LoadCombinations, *, quantity: str = "M", ax: Axes | None = None
) -> Figure:
    """Draw the envelope of a section force over load combinations on the undeformed frame."""
    solution, number = next(iter(combined.solutions.values())), len(combined.solutions)
    words = f"extremes of the {style.resultant(quantity)[0]}"
    title = words, f"of {number} load combinations"
    return draw_envelope(solution, title, quantity, bounds(solution, combined, quantity), ax)


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


def draw_storeys(storeys: Storeys, *, quantity: str = "drift", ax: Axes | None = None) -> Figure:
    """Draw the largest and least drift ratio or shear of each storey over the height."""
    factor, prefix = style.decimal_prefix(float(np.nanmax(np.abs(storeys.shear))))
    drift = quantity == "drift"
    values = np.asarray(100 * storeys.ratio if drift else storeys.shear / factor)
    label = "drift ratio (%)" if drift else f"storey shear ({prefix}N)"
    axis = "xyz"[len(storeys.levels[0].point) - 1]
    edges = [place.point[-1] for place in storeys.levels]
    with style.panel(ax, (5.0, 6.0)) as axes:
        style.zero_lines(axes, y=False)
        for name, extreme, color in (("largest", np.nanmax, RED), ("least", np.nanmin, BLUE)):
            profile = np.repeat(extreme(values, axis=0), 2)
            axes.plot(profile, np.repeat(edges, 2)[1:-1], color=color, label=name)
        axes.set_yticks(edges)
        axes.grid(axis="y", linewidth=0.8)
        axes.set(xlabel=label, ylabel=f"{axis} (m)")
        style.draw_legend(axes, ax, loc="outside upper left", ncols=2)
    return style.parent_figure(axes)


def draw_motion(motion: GroundMotion) -> Figure:
    """Draw acceleration, velocity and displacement of a ground motion over time."""
    times, *histories = motion.histories
    with picture((8.0, 6.0)) as figure:
        panels = figure.subplots(3, 1, sharex=True)
        names = "acceleration\n(m/s²)", "velocity\n(m/s)", "displacement\n(m)"
        for axes, values, name in zip(panels, histories, names, strict=True):
            style.time_axes(axes).plot(times, values, linewidth=1.2)
            axes.set_ylabel(name)
        panels[0].set_title(motion.name, loc="left")
        panels[-1].set_xlabel(TIME.name)
        figure.align_ylabels()
    return figure


def draw_spectrum(spectrum: ResponseSpectrum, quantity: str, ax: Axes | None = None) -> Figure:
    """Draw one quantity of a response spectrum over the period."""
    with style.panel(ax, (7.0, 4.2)) as axes:
        axes.plot(spectrum.periods, getattr(spectrum, quantity))
        label = f"{quantity.replace('_', '-')}{SPECTRA[quantity]}"
        axes.set(xlabel="period (s)", ylabel=label, ylim=(0.0, None), axisbelow=True)
        axes.grid(visible=True, linewidth=0.8)
    return style.parent_figure(axes)


def draw_cycles(fatigue: Fatigue, spot: HotSpot | None = None) -> Figure:
    """Draw rainflow matrix, spectrum and damage of the stress cycles at a hot spot.

    On the left is the rainflow matrix.  In the middle is the number of cycles above each range,
    with the S-N curve.  On the right is the percentage of the damage by each bin of ranges.
    """
    from matplotlib.colors import LogNorm

    if spot is None:
        if len(fatigue.spots) > 1:
            raise ArgumentError(f"plot: give one of the {len(fatigue.spots)} hot spots")
        (spot,) = fatigue.spots
    cycles, curve = fatigue.cycles(spot), fatigue.curve
    if not len(cycles.range):
        raise ArgumentError(f"plot: the stress at {spot} never turned")
    ranges, means = 1e-6 * cycles.range, 1e-6 * cycles.mean
    done = cycles.count / curve.endurance(cycles.range, cycles.mean)
    edges = np.linspace(0.0, ranges[-1] * (1 + 1e-9), CLASSES + 1)
    with picture((13.0, 5.0)) as figure:
        matrix, spectrum, damage = figure.subplots(1, 3, sharey=True, width_ratios=(1.25, 1, 0.8))
        middle, half = (means.max() + means.min()) / 2, 0.6 * max(np.ptp(means), edges[-1] / 4)
        columns = np.linspace(middle - half, middle + half, CLASSES + 1)
        counts, _, _ = np.histogram2d(means, ranges, (columns, edges), weights=cycles.count)
        colors = matrix.pcolormesh(
            columns, edges, np.where(counts > 0, counts, np.nan).T,  # empty bins are white
            norm=LogNorm(0.5, max(10.0, counts.max())), cmap="viridis_r", rasterized=True,
        )  # fmt: skip
        style.draw_bar(matrix, colors, "")
        matrix.set(xlabel="mean stress (MPa)", ylabel="stress range (MPa)")
        more = np.cumsum(cycles.count[::-1])[::-1]
        reached = np.append(more[0], more), np.append(0.0, ranges)
        spectrum.plot(*reached, color=BLUE, drawstyle="steps-post", label="reached")
        some = np.linspace(edges[1] / 10, 1.1 * edges[-1], 1000)
        spectrum.plot(
            curve.endurance(1e6 * some), some, color=shade(INK), lw=1.4, ls="--", label="borne"
        )
        spectrum.set(xscale="log", xlabel="number of cycles")
        spectrum.legend(loc="best")
        total = done.sum()
        fractions, _ = np.histogram(ranges, edges, weights=done / (total or 1.0))
        damage.barh(edges[:-1], 100 * fractions, np.diff(edges), align="edge", color=RED, alpha=0.6)
        damage.set(xlabel="part of the damage (%)")
        matrix.set_ylim(0.0, 1.1 * edges[-1])
        titles = "number of cycles in bins", "spectrum and S-N curve", f"damage {total:.3g}"
        for axes, title in zip((matrix, spectrum, damage), titles, strict=True):
            axes.set_title(title, loc="left")
    return figure


def draw_section_moments(result: MomentCurvature, *, ax: Axes | None = None) -> Figure:
    """Draw moments (N m) of a section against curvatures (1/m); a dot marks the last state."""
    with style.panel(ax, (8.0, 5.4)) as axes:
        style.zero_lines(axes)
        axes.plot(result.curvature, result.moment, color=BLUE)
        axes.plot(result.curvature[-1], result.moment[-1], "o", color=BLUE)
        axes.set_xlabel("curvature K (1/m)")
        style.label_axis(axes.yaxis, result.moment, "bending moment M", "N m")
        forces = [with_unit(N, "N") for N in (result.N.min(), result.N.max())]
        axes.set_title(f"axial force {' to '.join(dict.fromkeys(forces))}", loc="left")
    return style.parent_figure(axes)


def draw_interaction(diagram: InteractionDiagram, *, ax: Axes | None = None) -> Figure:
    """Draw axial forces (N) against moments (N m) at limit strains; compression is at the top."""
    with style.panel(ax, (7.0, 6.0)) as axes:
        style.zero_lines(axes)
        axes.plot(diagram.M, diagram.N, color=BLUE)
        axes.fill(diagram.M, diagram.N, facecolor=(BLUE, 0.08), linewidth=0.0, zorder=0)
        axes.yaxis.set_inverted(True)
        style.label_axis(axes.xaxis, diagram.M, "bending moment M", "N m")
        style.label_axis(axes.yaxis, diagram.N, "axial force N", "N")
        ends = (with_unit(N, "N") for N in (diagram.N.min(), diagram.N.max()))
        axes.set_title(f"axial force from {' to '.join(ends)}", loc="left")
    return style.parent_figure(axes)


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


def _of_forces(draw: Any, names: Sequence[str] = ("M", "N", "V")) -> dict[str, Any]:
    return {name: partial(draw, quantity=name) for name in names}


IN_SPACE[LoadCombinations] = _of_forces(draw_combinations, style.COMPONENTS)
IN_SPACE[SpectralResponse] = _of_forces(draw_response, style.COMPONENTS)
PICTURES.update({
    Calibration: {"fit": draw_calibration},
    Storeys: _of_forces(draw_storeys, ("drift", "shear")),
    Fatigue: {"cycles": draw_cycles},
    MomentCurvature: {"moment-curvature": draw_section_moments},
    InteractionDiagram: {"interaction": draw_interaction},
    Pushover: {"curve": draw_pushover},
    SpectralResponse: _of_forces(draw_response),
    LoadCombinations: _of_forces(draw_combinations),
    DemandCurves: {"curves": draw_dynamics},
    GroundMotion: {"motion": draw_motion},
    ResponseSpectrum: _of_forces(draw_spectrum, [*SPECTRA]),
})  # fmt: skip
