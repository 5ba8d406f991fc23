# SPDX-License-Identifier: MIT
"""The work-precision diagram: what each run of a trade-off took, and how accurate it was."""

from __future__ import annotations

from itertools import cycle, product
from typing import TYPE_CHECKING

import numpy as np

from ufl_beam.analysis.tradeoff_result import Tradeoff
from ufl_beam.plotting.connector_glyphs import BLUE, GREEN, GREY, INK, ORANGE, PINK, RED, SKY
from ufl_beam.plotting.plots import picture

if TYPE_CHECKING:
    from matplotlib.figure import Figure

FAINTEST = 1e-12
"""Errors below are drawn there, in the unit of the quantity."""


def plot_tradeoff(tradeoff: Tradeoff) -> Figure:
    """Error over wall time of all runs, of the worst quantity; a ring marks the recommended one.

    Each kind of scheme, steps and cells has a colour; the line is that of runs that no other one
    beats in both.  The error is a part of the tolerance, or, with a budget, of the quantity.

    Args:
        tradeoff: What :func:`tradeoff` returned.
    """
    with picture((9.0, 6.0)) as figure:
        axes = figure.subplots()
        styles = cycle(product("os^", (BLUE, RED, GREEN, ORANGE, PINK, SKY)))
        for family, (name, style) in enumerate(zip(tradeoff.families, styles, strict=False)):
            marker, color = style
            runs = [run for run in tradeoff.runs if run.refinement.family == family]
            axes.scatter(
                [run.seconds for run in runs],
                [max(tradeoff.ratio(run), FAINTEST) for run in runs],
                s=[30 + 12 * np.log2(run.cells) for run in runs],
                marker=marker, color=color, alpha=0.75, lw=0, label=f"from {name}", zorder=3,
            )  # fmt: skip
        front = tradeoff.front
        seconds, errors = [r.seconds for r in front], [tradeoff.ratio(r) for r in front]
        axes.plot(seconds, np.maximum(errors, FAINTEST), color=INK, lw=1.2, zorder=2)
        best = (tradeoff.best.seconds, max(tradeoff.ratio(tradeoff.best), FAINTEST))
        axes.plot(*best, "o", ms=18, mfc="none", mec=INK, mew=1.8, zorder=4)
        axes.set(xscale="log", yscale="log", xlabel="wall time of a run (s)")
        axes.set_ylabel(f"error ({tradeoff.target.measure})")
        axes.set_title(f"recommended: {tradeoff.best.dials}", loc="left", fontsize=11)
        time, ratio = tradeoff.target.bounds
        for draw, bound in ((axes.axvline, time), (axes.axhline, ratio)):
            if np.isfinite(bound):
                draw(bound, color=GREY, ls="--", lw=1.2, zorder=1)
        figure.legend(
            loc="outside lower center", ncols=2, fontsize=9, title="size: cells", title_fontsize=9
        )
    return figure
