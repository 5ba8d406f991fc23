# SPDX-License-Identifier: MIT
"""The page of the study, made of its results: what to choose when, figures, tables."""

from __future__ import annotations

from pathlib import Path
from textwrap import fill
from typing import Any

import numpy as np
from advice import TARGETS, advice, cheapest, overall
from figures import draw_case, draw_dials

Case = dict[str, Any]

INTRODUCTION = """\
# Speed and accuracy: the study

Written by `make study`; do not edit. The study measures time and error of each setting in scenes
that are smooth, stiff, impulsive, plastic, softening and static. The time is the wall time of
`ub.simulate` with its setup, without compilation. The error is the largest difference of a
coordinate of one place from a reference run, at ten instants, relative to the size of the scene.
The reference run is finer than all others. Errors below twice its own estimated error cannot be
measured; the tables have "—" there. Iterations are counted per step. The imbalance of the ledger is
a fraction of the transferred energy. The scenes are small, and times depend on the machine, so use
the ratios of times. All times and ratios are those of the commit below; later commits are faster.
[`ub.tradeoff`](tradeoff.md) finds the settings for a scene of your own.
"""


def save(study: dict[str, Any], docs: Path) -> None:
    """Write ``study.md`` and its figures."""
    pictures = docs / "pictures"
    pictures.mkdir(exist_ok=True)
    cases = study["cases"]
    lines = [INTRODUCTION]
    if study["quick"]:
        lines += ["*A quick study: few and coarse settings, most of them timed once.*", ""]
    lines += [
        f"Commit {study['commit']}, Python {study['python']}, DOLFINx {study['dolfinx']}, "
        f"{study['processor']}, one thread; {study['seconds'] / 60:.0f} minutes.",
        "",
        *(f"Without {name}: {_cut(why)}\n" for name, why in study["failed"].items()),
        "## Recommended settings",
        "",
        "Each line has the fastest setting that reaches an error, and the times of other schemes "
        'for the same error as multiples of its time; "as long" is at most 1.15 times.',
        "",
        *(fill(line, 155, subsequent_indent="  ") for line in advice(cases)),
        "",
        "Time of each scheme for an error, relative to the fastest scheme: the geometric mean over "
        "the scenes in which it reaches the error, and the number of these scenes, of those in "
        "which any scheme reaches it:",
        "",
        *overall(cases),
        "",
        "## Each setting by itself",
        "",
        "Each setting is changed alone, from a base that is stated for each scene below. Time and "
        "error are relative to the base. The change is the largest difference of a coordinate from "
        "the result of the base, relative to the size of the scene.",
        "",
        "![Time and error as each setting is varied](pictures/study_dials.png)",
        "",
    ]
    draw_dials(cases, pictures / "study_dials.png")
    for case in cases:
        picture = pictures / f"study_{case['name'].replace(' ', '_')}.png"
        draw_case(case, picture)
        lines += _section(case, picture)
    (docs / "study.md").write_text("\n".join(lines).rstrip() + "\n")


def _section(case: Case, picture: Path) -> list[str]:
    """Figure and tables of a scene."""
    here = case["base"]
    lines = [
        f"## {case['name'].capitalize()}: {case['kind']}",
        "",
        f"{case['says']} Estimated error of the reference: {case['reference']:.0e}.",
        "",
        f"![Error over wall time](pictures/{picture.name})",
        "",
        "| error below | scheme | cells | degree | steps | iterations | seconds | error |",
        "|---|---|---|---|---|---|---|---|",
    ]
    for target in TARGETS:
        run = cheapest(case, target)
        missing = "—" if target < 2 * case["reference"] else "not reached"
        lines.append(f"| {target:g} | " + (_row(run) if run else f"{missing} | | | | | |") + " |")
    if "failed" in here:
        return [*lines, "", f"The base of single settings failed: {here['failed']}", ""]
    lines += [
        "",
        f"Base: {here['scheme']}, {here['cells']} cells, {here['taken']} steps, "
        f"{here['seconds']:.3g} s, error {here['error']:.1e}.",
        "",
        "| setting | time | error | change | iterations | imbalance of the ledger |",
        "|---|---|---|---|---|---|",
    ]
    for run in case["dials"]:
        if "failed" in run:
            lines.append(f"| {run['dial']} | {_cut(run['failed'])} | | | | |")
            continue
        lines.append(
            f"| {run['dial']} | × {run['seconds'] / here['seconds']:.2f} "
            f"| × {run['error'] / here['error']:.2g} | {run['changes']:.1e} "
            f"| {run['iterations']:.2f} | {run['imbalance']:.1e} |"
        )
    failed = {run["scheme"]: run["failed"] for run in case["runs"] if "failed" in run}
    runs = {
        scheme: np.sum([("failed" in r, 1) for r in case["runs"] if r["scheme"] == scheme], axis=0)
        for scheme in failed
    }
    lines += [""] + [
        f"{scheme} fails in {runs[scheme][0]} of {runs[scheme][1]} settings: {why}  "
        for scheme, why in failed.items()
    ]
    return [*lines, ""]


def _row(run: dict[str, Any]) -> str:
    return (
        f"{run['scheme']} | {run['cells']} | {run['degree']} | {run['taken']} "
        f"| {run['iterations']:.2f} | {run['seconds']:.3g} | {run['error']:.1e}"
    )


def _cut(message: str) -> str:
    message = message.replace("|", "\\|")
    return message if len(message) <= 100 else message[:99].rsplit(" ", 1)[0] + " …"
