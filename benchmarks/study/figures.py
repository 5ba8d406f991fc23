# SPDX-License-Identifier: MIT
"""The figures of the study: error over wall time, and what each dial does."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
from advice import good, schemes

import ufl_beam as ub
from ufl_beam.analysis.richardson import pareto
from ufl_beam.plotting.style import BLUE, GREEN, GREY, INK, ORANGE, PINK, RED, SKY

Case = dict[str, Any]
COLORS = (BLUE, SKY, GREEN, PINK, ORANGE, RED, INK)
MARKERS = {1: "o", 2: "s", 3: "^"}


def draw_case(case: Case, path: Path) -> None:
    """All runs of a scene, and the front of each scheme."""
    with ub.picture((9.0, 6.5)) as figure:
        axes = figure.subplots()
        for scheme, color in zip(schemes([case]), COLORS, strict=False):
            runs = [run for run in good(case) if run["scheme"] == scheme]
            if not runs:
                continue
            seconds = np.array([run["seconds"] for run in runs])
            errors = np.array([max(run["error"], 1e-16) for run in runs])
            for degree, marker in MARKERS.items():
                shown = [k for k, run in enumerate(runs) if run["degree"] == degree]
                axes.scatter(
                    seconds[shown], errors[shown], marker=marker, s=26, color=color, alpha=0.35,
                    lw=0,
                )  # fmt: skip
            front = pareto(seconds, errors)
            axes.plot(seconds[front], errors[front], color=color, lw=1.8, label=scheme)
        axes.axhspan(axes.get_ylim()[0], 2 * case["reference"], color=GREY, alpha=0.3, lw=0)
        axes.set(xscale="log", yscale="log", xlabel="wall time of a run (s)")
        axes.set_ylabel("error / size of the scene")
        axes.set_title(f"{case['name']}: {case['kind']}", loc="left")
        figure.legend(loc="outside lower center", ncols=3, title="circles: degree 1, squares: 2")
    figure.savefig(path)


def draw_dials(cases: list[Case], path: Path) -> None:
    """Time over time, and error over error, of the base: each dial a row, each scene a dot."""
    names = list(dict.fromkeys(run["dial"] for case in cases for run in case["dials"]))
    with ub.picture((11.0, 1.5 + 0.33 * len(names))) as figure:
        left, right = figure.subplots(1, 2, sharey=True)
        for case, color in zip(cases, COLORS, strict=False):
            here = case["base"]
            runs = [run for run in case["dials"] if "failed" not in run and "failed" not in here]
            rows = [names.index(run["dial"]) for run in runs]
            style = {"color": color, "marker": "o", "ls": "none", "ms": 6, "alpha": 0.8}
            left.plot(
                [run["seconds"] / here["seconds"] for run in runs], rows, label=case["name"],
                **style,
            )  # fmt: skip
            least = max(2 * case["reference"], 1e-16)
            base = max(here["error"], least)
            right.plot([max(run["error"], least) / base for run in runs], rows, **style)
        for axes, title in ((left, "time"), (right, "error")):
            axes.axvline(1.0, color=GREY, lw=1.2, zorder=0)
            axes.set(xscale="log", title=f"{title} / {title} of the base")
            axes.grid(axis="y", color="0.92")
        left.set_yticks(range(len(names)), names)
        left.invert_yaxis()
        figure.legend(*left.get_legend_handles_labels(), loc="outside lower center", ncols=4)
    figure.savefig(path)
