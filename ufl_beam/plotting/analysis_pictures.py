# SPDX-License-Identifier: MIT
"""Pictures of many runs: studies, trade-offs of speed and accuracy."""

from __future__ import annotations

from functools import partial
from itertools import cycle, product

import numpy as np

from ufl_beam.analysis.parameter_study import Study
from ufl_beam.analysis.tradeoff_result import Tradeoff
from ufl_beam.display import html_page
from ufl_beam.errors import ArgumentError
from ufl_beam.plotting import notebook, style
from ufl_beam.plotting.style import BLUE, GREEN, GREY, INK, ORANGE, RED, Axes, Figure, shade

LEAST_ERROR = 1e-12  # ratio of error to tolerance at which all smaller ratios are drawn


def draw_study(study: Study) -> Figure:
    """Draw each result of a study over each number that its cases vary.

    The largest magnitude of an array result is drawn; failed cases are omitted.
    """
    varied = {
        name: np.array([case[name] for case in study.cases], dtype=float)
        for name, value in (study.cases[0] if len(study) else {}).items()
        if isinstance(value, int | float)
    }
    varied = {n: x for n, x in varied.items() if np.ptp(x) > 0 or len(varied) == 1}
    if not varied or not study.results:
        raise ArgumentError("plot: the study has no results over numbers of its cases")
    rows, columns = len(study.results), len(varied)
    with style.picture((max(6.0, 4.0 * columns), max(4.0, 2.6 * rows))) as figure:
        panels_of = figure.subplots(rows, columns, squeeze=False, sharex="col", sharey="row")
        for panels, (result, values) in zip(panels_of, study.results.items(), strict=True):
            sizes = np.abs(values.reshape(len(study), -1)).max(axis=1)
            panels[0].set_ylabel(result)
            for axes, x in zip(panels, varied.values(), strict=True):
                axes.plot(x, sizes if values.ndim > 1 else values, "o", color=BLUE, ms=5.0)
        for axes, name in zip(panels_of[-1], varied, strict=True):
            axes.set_xlabel(name)
    return figure


def draw_tradeoff(tradeoff: Tradeoff, *, ax: Axes | None = None) -> Figure:
    """Draw errors of all runs over their wall times, with a ring around the recommended run.

    Each family of settings has a colour and a marker.  The line joins the runs that no other run
    beats in both time and error.  Errors are divided by the tolerance, or by the largest magnitude
    of the quantity if there is a budget.
    """
    errors = {run: max(tradeoff.ratio(run), LEAST_ERROR) for run in tradeoff.runs}
    with style.panel(ax, (9.0, 6.0)) as axes:
        looks = cycle(product("os^", (BLUE, RED, GREEN, ORANGE, style.PINK, style.SKY)))
        for family, (name, look) in enumerate(zip(tradeoff.families, looks, strict=False)):
            marker, color = look
            runs = [run for run in tradeoff.runs if run.refinement.family == family]
            axes.scatter(
                [run.seconds for run in runs], [errors[run] for run in runs],
                s=[30 + 12 * np.log2(run.cells) for run in runs],
                marker=marker, color=color, alpha=0.75, lw=0, label=f"from {name}", zorder=3,
            )  # fmt: skip
        front, best = tradeoff.front, tradeoff.best
        line = [run.seconds for run in front], [errors[run] for run in front]
        axes.plot(*line, color=shade(INK), lw=1.2, zorder=2)
        axes.plot(
            best.seconds, errors[best], "o", ms=18, mfc="none", mec=shade(INK), mew=1.8, zorder=4
        )
        axes.set(xscale="log", yscale="log", xlabel="wall time of a run (s)")
        axes.set_ylabel(f"error ({tradeoff.target.measure})")
        axes.set_title(f"recommended: {best.setting}", loc="left", fontsize=style.font_size(11.0))
        budget = tradeoff.target.budget
        draw, bound = (axes.axvline, budget) if np.isfinite(budget) else (axes.axhline, 1.0)
        draw(bound, color=GREY, ls="--", lw=1.2, zorder=1)
        small = style.font_size(9.0)
        style.draw_legend(
            axes, ax, loc="outside lower center", ncols=2, fontsize=small, title="size: cells",
            title_fontsize=small,
        )  # fmt: skip
    return style.parent_figure(axes)


@html_page.register
def tradeoff_page(result: Tradeoff) -> str:
    """Write a trade-off as HTML: the runs that no other run beats, remarks, and a picture."""
    head, *rows = result.table()
    text = notebook.lines(result.title()) + notebook.table(head, rows)
    text += notebook.lines(*result.remarks())
    return text + notebook.image("errors over wall times", partial(draw_tradeoff, result))
