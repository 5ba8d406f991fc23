# SPDX-License-Identifier: MIT
"""What follows from the numbers: the cheapest setting for an error, and what others take."""

from __future__ import annotations

from statistics import geometric_mean
from typing import Any

Case = dict[str, Any]
Run = dict[str, Any]

TARGETS = (1e-2, 1e-3, 1e-4, 1e-5)
"""Errors that are asked for, as parts of the size of the scene."""

EQUAL = 1.15
"""Times that differ by less are the same."""


def good(case: Case) -> list[Run]:
    """The runs of the grid that did not fail."""
    return [run for run in case["runs"] if "failed" not in run]


def cheapest(case: Case, target: float, **dials: Any) -> Run | None:
    """The fastest run below an error that the reference can tell, perhaps with some dials given."""
    if target < 2 * case["reference"]:
        return None
    runs = [
        run
        for run in good(case)
        if run["error"] <= target and all(run[name] == value for name, value in dials.items())
    ]
    return min(runs, key=lambda run: run["seconds"], default=None)


def schemes(cases: list[Case]) -> list[str]:
    """Names of all schemes, in the order of the dials."""
    return list(dict.fromkeys(run["scheme"] for case in cases for run in case["runs"]))


def advice(cases: list[Case]) -> list[str]:
    """One line for each scene: the dials for three digits, or the finest error that is reached."""
    lines = []
    for case in cases:
        reached = [target for target in TARGETS if cheapest(case, target)]
        if not reached:
            lines.append(f"* **{case['kind']}** ({case['name']}): no run comes near the reference.")
            continue
        target = 1e-3 if 1e-3 in reached else reached[-1]
        best = cheapest(case, target)
        assert best is not None
        shape = f", of degree {best['degree']}" if best["degree"] > 1 else ""
        lines.append(
            f"* **{case['kind']}** ({case['name']}): an error of {target:g} takes "
            f"{best['seconds']:.3g} s with {best['scheme']}, {best['taken']} steps, "
            f"{best['cells']} cells{shape}; {_others(case, target, best)}."
        )
    return lines


def _others(case: Case, target: float, best: Run) -> str:
    """What the other schemes take for the same error."""
    ratios, never, refused = {}, [], []
    for scheme in schemes([case]):
        run = cheapest(case, target, scheme=scheme)
        if not any(one["scheme"] == scheme for one in good(case)):
            refused.append(scheme)
        elif run is None:
            never.append(scheme)
        elif scheme != best["scheme"]:
            ratios[scheme] = run["seconds"] / best["seconds"]
    parts = []
    same = [scheme for scheme, ratio in ratios.items() if ratio <= EQUAL]
    if same:
        parts.append(f"{', '.join(same)} as long")
    parts += [f"{scheme} {ratio:.1f} times" for scheme, ratio in ratios.items() if ratio > EQUAL]
    if never:
        parts.append(f"{', '.join(never)} {'does' if len(never) == 1 else 'do'} not reach it here")
    if refused:
        parts.append(f"all runs with {', '.join(refused)} fail")
    return "; ".join(parts) or "there is no other"


def overall(cases: list[Case]) -> list[str]:
    """A table: geometric mean of the times of each scheme over the fastest, by error."""
    lines = [
        "| scheme | " + " | ".join(f"{target:g}" for target in TARGETS) + " |",
        "|---|" + "---|" * len(TARGETS),
    ]
    for scheme in schemes(cases):
        mine = [case for case in cases if scheme in schemes([case])]
        cells = []
        for target in TARGETS:
            ratios, asked = [], 0
            for case in mine:
                best, run = cheapest(case, target), cheapest(case, target, scheme=scheme)
                asked += best is not None
                if best and run:
                    ratios.append(run["seconds"] / best["seconds"])
            mean = f"{geometric_mean(ratios):.2f}" if ratios else "—"
            cells.append(f"{mean} ({len(ratios)} of {asked})")
        lines.append(f"| {scheme} | " + " | ".join(cells) + " |")
    return lines
