# SPDX-License-Identifier: MIT
"""What this package wants to be true beside the others, asked of the records of one run."""

import math
import statistics
from typing import NamedTuple

import numpy as np
from problems import known

PEERS = ("exudyn", "opensees")


class Claim(NamedTuple):
    """A line of the table; ``met`` is None where runs are missing."""

    line: str
    ours: str
    peer: str
    ratio: str
    met: bool | None


def not_run(line):
    return Claim(line, "", "not run", "", None)


def pick(records, problem, program=None, **settings):
    """Timed records of the tables that fit."""
    return [
        r
        for r in records
        if r["part"] == "tables" and r["problem"] == problem and "wall" in r
        and (program is None or r["program"] in program)
        and all(r["settings"].get(name) == value for name, value in settings.items())
    ]  # fmt: skip


def unit(record, per):
    """Medians of microseconds a step or an iteration."""
    return 1e6 * statistics.median(record["wall"]) / record[per]


def beside(ours, other, per="steps"):
    """How many times as fast ours is: the median of the ratios of runs side by side."""
    mine, its = ours["wall"], other["wall"]
    ratios = [(b / other[per]) / (a / ours[per]) for a, b in zip(mine, its, strict=False)]
    return statistics.median(ratios)


def name(record):
    return " ".join(filter(None, (record["program"], record["label"])))


def faster(records, line, problem, against, factor=1.0, per="steps", **settings):
    """Ours against the fastest of some records."""
    ours = pick(records, problem, ("ufl_beam",), **settings)
    others = [r for r in pick(records, problem, PEERS, **settings) if per in r and against(r)]
    if not ours or not others:
        return not_run(line)
    mine = min(ours, key=lambda r: unit(r, per))
    best = min(others, key=lambda r: unit(r, per))
    ratio = beside(mine, best, per)
    return Claim(
        line,
        f"{unit(mine, per):.3g} µs",
        f"{name(best)}: {unit(best, per):.3g} µs",
        f"{ratio:.2f} (asked {factor:g})",
        ratio >= factor,
    )


def leaner(records, line, problem, **settings):
    """Peak memory, against the least of the others."""
    ours = pick(records, problem, ("ufl_beam",), **settings)
    others = pick(records, problem, PEERS, **settings)
    if not ours or not others:
        return not_run(line)
    best = min(others, key=lambda r: r["memory"])
    mine, its = ours[0]["memory"], best["memory"]
    scene, another = (r["memory"] - r["memory_before"] for r in (ours[0], best))
    return Claim(
        line,
        f"{mine:.0f} MB (of it the scene {scene:.0f})",
        f"{name(best)}: {its:.0f} MB ({another:.0f})",
        f"{its / mine:.2f} (asked 1)",
        mine <= its,
    )


def near_floor(records, line, problem, factor=3.0, **settings):
    """Time per iteration, in multiples of the C loop."""
    ours = pick(records, problem, ("ufl_beam",), **settings)
    floors = {r["label"]: r for r in pick(records, problem, ("c",), **settings)}
    if not ours or not floors:
        return not_run(line)
    ratios = {label: beside(ours[0], r, "newton") for label, r in floors.items()}
    said = ", ".join(f"{label} {unit(r, 'newton'):.3g} µs" for label, r in floors.items())
    times = ", ".join(f"1/{1 / ratio:.1f}" for ratio in ratios.values())
    return Claim(
        line,
        f"{unit(ours[0], 'newton'):.3g} µs",
        f"C: {said}",
        f"{times} (asked 1/{factor:g})",
        ratios["banded"] * factor >= 1,
    )


def front(records):
    """Time and error of the runs that no other beats in both; seconds, error, rising time."""
    points = sorted(
        (statistics.median(r["wall"]), r["measures"]["error"])
        for r in records
        if "wall" in r and "error" in r.get("measures", {})
    )
    best, kept = math.inf, []
    for seconds, error in points:
        if error < best:
            kept.append((seconds, error))
            best = error
    return kept


def more_exact(records, line, problem, program):
    """Our error in no more time, at each point of the front of a program."""
    drawn = [r for r in records if r["part"] == "figure" and r["problem"] == problem]
    ours = front([r for r in drawn if r["program"] == "ufl_beam"])
    theirs = front([r for r in drawn if r["program"] == program])
    if not ours or not theirs:
        return not_run(line)
    ratios = [
        error / min((e for s, e in ours if s <= seconds), default=math.inf)
        for seconds, error in theirs
    ]
    won = sum(ratio > 1 for ratio in ratios)
    return Claim(
        line,
        f"ahead at {won} of {len(ratios)} points",
        f"{program}: {min(e for _, e in theirs):.2g} m in {theirs[-1][0]:.2g} s at best",
        f"{min(ratios):.2f} to {max(ratios):.2f} (asked 1)",
        won == len(ratios),
    )


def same_residual(records, line, cells):
    """Residual displacement of the portal, of its largest displacement."""
    ours = pick(records, "P4", ("ufl_beam",), cells=cells)
    others = [r for r in pick(records, "P4", PEERS, cells=cells) if r["label"] != "without shear"]
    if not ours or not others:
        return not_run(line)
    mine = ours[0]["measures"]["residual"]
    other = max(others, key=lambda r: abs(r["measures"]["residual"] - mine))
    its = other["measures"]["residual"]
    away = abs(mine - its) / np.abs(known("P4")["u"]).max()
    return Claim(
        line,
        f"{1e3 * mine:.2f} mm",
        f"{name(other)}: {1e3 * its:.2f} mm",
        f"apart {100 * away:.2f} % of the largest displacement (asked 1)",
        away <= 0.01,
    )


def anyone(record):
    return True


def of(program, word=""):
    return lambda record: record["program"] == program and word in record["label"]


def claims(records):
    """All lines, in the order of what matters."""
    fly = {"dt": 0.01}
    lines = [
        faster(records, "flying beam, 8 cells, step", "P2", of("exudyn", "full"), cells=8, **fly),
        faster(records, "the same, any setting", "P2", of("exudyn"), cells=8, **fly),
        faster(records, "flying beam, 64 cells", "P2", of("exudyn"), cells=64, **fly),
    ]
    for n in (512, 4096):
        lines.append(faster(records, f"flying beam, {n} cells", "P2", anyone, 1.4, cells=n, **fly))
    lines.append(faster(records, "cantilever, 100 000 cells", "P5", anyone, 4.0, cells=100_000))
    for n in (48, 12):
        for program in PEERS:
            line = f"portal, {n} cells, {program}"
            lines.append(faster(records, line, "P4", of(program), cells=n))
    for n in (12, 48):
        lines.append(same_residual(records, f"portal, {n} cells, residual displacement", n))
    for n in (8, 64, 512):
        lines.append(faster(records, f"tumbling beam, {n} cells", "P6", anyone, cells=n, **fly))
    for problem, line in (
        ("P2", "flying beam"), ("P3", "swing"), ("P4", "portal"), ("P6", "tumbling beam"),
    ):  # fmt: skip
        for program in PEERS:
            line_ = f"{line}, error at equal time, {program}"
            lines.append(more_exact(records, line_, problem, program))
    for line, problem, settings in (
        ("roll-up, 100 000 cells", "P1", {"cells": 100_000, "turns": 0.5}),
        ("cantilever, 100 000 cells", "P5", {"cells": 100_000}),
    ):
        iteration = f"{line}, iteration"
        lines.append(faster(records, iteration, problem, anyone, per="newton", **settings))
        lines.append(leaner(records, f"{line}, memory", problem, **settings))
        lines.append(near_floor(records, f"{line}, iteration over C", problem, **settings))
    return lines
