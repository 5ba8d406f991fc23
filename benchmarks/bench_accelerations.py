# SPDX-License-Identifier: MIT
"""Time of a step with each acceleration switched off in turn, into ``docs/accelerations.md``.

Run on an idle machine, one core::

    make accelerations

All variants of a scene are built first, compared after some steps, and then run side by side: each
in turn does a block of steps.  Times are processor times of a step with what a run keeps of it;
ratios are taken within a round, so that they hardly depend on what else the machine does.  One
line for each variant goes to ``benchmarks/results/bench_accelerations.jsonl``.
"""

import argparse
import os
import statistics
import sys
import time
from collections.abc import Callable
from itertools import cycle, pairwise
from pathlib import Path
from textwrap import fill
from typing import NamedTuple

import numpy as np
from accelerations import (
    ACCELERATIONS,
    ELASTIC,
    HINGED,
    JOINTED,
    LARGE,
    SWING,
    count,
    files,
    variants,
)
from bench_step import flying_beam
from records import keep, machine
from switches import SHIPPED, VARIANTS

import ufl_beam as ub

PAGE = Path(__file__).parents[1] / "docs" / "accelerations.md"
WIDTH = 155  # of lines of the page

WARM = 3  # steps before the states are compared
EQUAL = 1e-9
"""Difference of states after these steps, relative to the motion and the energies so far."""

WORTH = 1.1
"""An acceleration that gains less than a tenth everywhere is to be deleted."""

NUMBERS = {"EA": 1e4, "GA": 1e4, "EI": 100.0, "rhoA": 1.0, "rhoI": 10.0}
"""Section of the flying beam of bench_step.py."""


def pushed(beams, **parts):
    """Beams that a force and a small moment push at the start of the first one."""
    load = ub.PointLoad(beams[0].start, force=(8, 0), moment=-4, amplitude=lambda t: float(t < 2.5))
    return ub.Scene(beams, loads=[load], **parts)


def swing(cells):
    """A beam with a heavy middle, half of the cells, on two stiff links, pushed for 0.256 s."""
    numbers = {"b": 5e-3, "nu": 0.3}  # m, -
    thin = ub.Section.rectangle(h=1e-3, E=73e9, rho=2700, **numbers)
    stiff = ub.Section.rectangle(h=1e-2, E=73e9, rho=270, **numbers)  # of the same mass
    beam = ub.Beam((0, 0), (0.72, 0), thin, cells=cells // 2)
    ends = beam.start, beam.end
    connectors = [ub.Beam((x, 0), (x, 0.36), stiff, cells=cells // 4) for x in (0, 0.72)]
    push = ub.Table([0, 0.128, 0.256], [0, 1, 0])
    return ub.Scene(
        [beam, *connectors],
        joints=[
            ub.Revolute(connector.start, end)
            for connector, end in zip(connectors, ends, strict=True)
        ],
        supports=[ub.Pinned(connector.end) for connector in connectors],
        masses=[ub.PointMass(beam.at(0.5), 0.5)],
        loads=[ub.PointLoad(beam.at(0.5), force=(2, 0), amplitude=push)],
    )


def hinged_beam(cells):
    """A flying beam that yields, with a hinge in every cell, of which some open."""
    laws = {
        "bending": ub.ElastoPlastic(yield_limit=0.5, kinematic=50.0),
        "hinge": ub.Softening(limit=1.0, fracture_energy=500.0),
    }
    return pushed([ub.Beam((6, 0), (0, 8), ub.Section(**NUMBERS, **laws), cells=cells)])


def jointed_beams(cells):
    """Beams of four cells with revolute joints; springs that yield and plastic hinges in turn."""
    section, ends = ub.Section(**NUMBERS, depth=1e-3), np.linspace((6, 0), (0, 8), cells // 4 + 1)
    beams = [ub.Beam(a, b, section, cells=4) for a, b in pairwise(ends)]
    law = ub.ElastoPlastic(0.5, isotropic=100.0)
    laws = cycle([ub.Spring(1e3, law=law), ub.RigidPlastic(law)])
    return pushed(
        beams,
        joints=[ub.Revolute(a.end, b.start) for a, b in pairwise(beams)],
        connectors=[ub.Turn(a.end, b.start, next(laws)) for a, b in pairwise(beams)],
    )


class Case(NamedTuple):
    """A scene by its number of cells, and rounds and steps in a round by cells.

    The ``lead`` is the number of steps between the comparison and the first that is timed.
    """

    make: Callable[[int], ub.Scene]
    dt: float  # s
    lead: int
    sizes: dict[int, tuple[int, int]]


SMALL = {8: (40, 50), 64: (40, 15), 512: (30, 4), 4096: (12, 2)}
SCENES = {
    ELASTIC: Case(flying_beam, 0.01, 2, SMALL | {100_000: (7, 1)}),
    LARGE: Case(flying_beam, 0.1, 23, SMALL | {100_000: (7, 1)}),
    SWING: Case(swing, 2e-3, 2, {8: (24, 25), 64: (24, 10), 512: (30, 4)}),
    HINGED: Case(hinged_beam, 0.01, 2, SMALL | {20_000: (3, 1)}),
    JOINTED: Case(jointed_beams, 0.01, 2, SMALL),
}


class Run:
    """A simulation of a variant, and the times of its blocks of steps."""

    def __init__(self, name, scene, dt):
        self.simulation, self.dt = VARIANTS[name].simulation(scene), dt
        self.start, self.steps, self.times = self.simulation.q.copy(), 0, []

    def advance(self, steps):
        """Do some steps; return the seconds they take."""
        ends = self.dt * np.arange(self.steps + 1, self.steps + steps + 1)
        self.steps += steps
        begin = time.process_time()
        while len(ends):
            ends = ends[self.simulation.steps_to(ends, keep=True) :]
        return time.process_time() - begin

    def difference(self, other):
        """Difference of the state from that of another run, and of the energies, relative."""
        a, b = self.simulation, other.simulation
        moved = np.abs(b.q - other.start).max()
        energies = [np.array([*x.ledger.state.values(), *x.ledger.lost.values()]) for x in (a, b)]
        size = np.abs(energies[1]).max()
        return max(np.abs(a.q - b.q).max() / moved, np.abs(energies[0] - energies[1]).max() / size)


def compared(scene, cells):
    """Runs of all variants of a scene, by name, after some steps; all in the same state."""
    case = SCENES[scene]
    runs = {name: Run(name, case.make(cells), case.dt) for name in variants(scene)}
    for run in runs.values():
        run.advance(WARM)
    for name, run in runs.items():
        if not (difference := run.difference(runs[SHIPPED])) <= EQUAL:
            raise RuntimeError(f"{scene}, {cells} cells: {name} is off by {difference:.1e}")
    return runs


def measure(scene, cells, rounds, steps):
    """Times of a step of all variants in each round; seconds."""
    runs = compared(scene, cells)
    for run in runs.values():
        run.advance(SCENES[scene].lead)
    before = {name: run.simulation.iterations for name, run in runs.items()}
    for number in range(rounds):
        for run in [*runs.values()][:: 1 if number % 2 else -1]:
            run.advance(steps // 5)  # until caches hold this variant, not the one before
            run.times.append(run.advance(steps) / steps)
    for name, run in runs.items():
        taken = rounds * (steps + steps // 5)
        iterations = (run.simulation.iterations - before[name]) / taken
        median, least = (1e6 * f(run.times) for f in (statistics.median, min))
        case = {
            "scene": scene, "cells": cells, "variant": name, "rounds": rounds, "steps": steps,
            "iterations": iterations, "us_median": median, "us_min": least,
            "load": os.getloadavg()[0],
        }  # fmt: skip
        yield case | {"times": run.times}
        run.simulation.close()


# -- tables ----------------------------------------------------------------------------------------


def ratio(times, fast, slow):
    """Median over the rounds of how many times as long the slow variant takes."""
    return statistics.median(b / a for a, b in zip(times[fast], times[slow], strict=True))


def gains(cases):
    """Gains of each acceleration by scene and cells: {name: {(scene, cells): gain}}."""
    times = {}
    for case in cases:
        at = times.setdefault((case["scene"], case["cells"]), {})
        at[case["variant"]] = case["times"]
    return {
        name: {
            (scene, cells): ratio(of, one.with_, one.without)
            for (scene, cells), of in times.items() if scene in one.scenes
        }
        for name, one in ACCELERATIONS.items()
    }  # fmt: skip


def table(head, rows):
    """Text of a table."""
    lines = [head, ["---"] * len(head), *rows]
    return "\n".join(f"| {' | '.join(line)} |" for line in lines)


def number(x):
    """A gain as text."""
    return f"{x:.2f}" if x < 9.5 else f"{x:.0f}"


def summary(found):
    """Least and largest gain of each acceleration, and whether it is worth its lines."""
    rows = []
    for name, of in found.items():
        code, most = ACCELERATIONS[name].code, max(of.values())
        lines = str(count(code)) if code else ""
        say = "" if most >= WORTH else "less than a tenth everywhere: to be deleted"
        rows.append([name, lines, number(min(of.values())), number(most), say])
    return table(["acceleration", "lines", "least gain", "largest gain", ""], rows)


def table_of_gains(found, scene):
    """Gains in a scene."""
    sizes = sorted({cells for of in found.values() for at, cells in of if at == scene})
    rows = [
        [name, *(number(of[scene, cells]) for cells in sizes)]
        for name, of in found.items() if scene in ACCELERATIONS[name].scenes
    ]  # fmt: skip
    return table(["acceleration", *(f"{cells} cells" for cells in sizes)], rows)


def table_of_times(cases, scene):
    """Median and least time of a step of each variant, and its iterations."""
    sizes = sorted({case["cells"] for case in cases if case["scene"] == scene})
    rows = []
    for name in variants(scene):
        mine = [c for c in cases if (c["scene"], c["variant"]) == (scene, name)]
        mine.sort(key=lambda case: case["cells"])
        times = [f"{c['us_median']:.4g} ({c['us_min']:.4g}), {c['iterations']:.1f}" for c in mine]
        rows.append([name, *times])
    return table(["variant", *(f"{cells} cells" for cells in sizes)], rows)


def conditions(cases, seconds):
    """How it was measured."""
    here, loads = machine(), sorted(case["load"] for case in cases)
    steps = {(c["cells"], c["rounds"] * c["steps"]) for c in cases}
    return fill(
        f"Commit {here['commit']}, Python {here['python']}, DOLFINx {here['dolfinx']}, "
        f"{here['processor']}, {os.cpu_count()} cores, one thread; load average {loads[0]:.1f} to "
        f"{loads[-1]:.1f}; {seconds / 60:.0f} minutes. Steps of each variant: "
        + ", ".join(f"{number} with {cells} cells" for cells, number in sorted(steps))
        + ".",
        WIDTH,
    )


def paragraphs(found):
    """A paragraph for each acceleration."""
    for name, one in ACCELERATIONS.items():
        least, most = (number(f(found[name].values())) for f in (min, max))
        where = ", ".join(f"`{file}`" for file in files(one.code))
        said = f" {count(one.code)} lines in {where}." if where else ""
        yield fill(
            f"**{name[0].upper()}{name[1:]}**. {one.text} Gain {least} to {most}: "
            f'"{one.with_}" compared with "{one.without}".{said}',
            WIDTH,
        )


def write(page, cases, seconds):
    """Write all tables between their markers."""
    found = gains(cases)
    parts = {
        "conditions": conditions(cases, seconds),
        "summary": summary(found),
        "accelerations": "\n\n".join(paragraphs(found)),
        **{f"gains, {scene}": table_of_gains(found, scene) for scene in SCENES},
        **{f"times, {scene}": table_of_times(cases, scene) for scene in SCENES},
    }
    text = page.read_text(encoding="utf-8")
    for key, part in parts.items():
        begin, end = f"<!-- {key} -->\n", f"<!-- end of {key} -->"
        before, rest = text.split(begin)
        _, after = rest.split(end)
        text = before + begin + part + "\n" + end + after
    page.write_text(text, encoding="utf-8")


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--most", type=int, default=100_000, help="largest number of cells")
    parser.add_argument("--page", type=Path, default=PAGE, help="page that gets the tables")
    options = parser.parse_args()
    begin, cases = time.perf_counter(), []
    for scene, case in SCENES.items():
        for cells, (rounds, steps) in case.sizes.items():
            if cells > options.most:
                continue
            for found in measure(scene, cells, rounds, steps):
                cases.append(found)
                print(
                    f"{scene:8} {cells:6d} cells  {found['us_median']:12.1f} µs "
                    f"(least {found['us_min']:.1f}), {found['iterations']:.2f} iterations  "
                    f"{found['variant']}",
                    flush=True,
                )
    write(options.page, cases, time.perf_counter() - begin)
    for case in cases:
        keep("bench_accelerations", {k: v for k, v in case.items() if k != "times"})


if __name__ == "__main__":
    sys.exit(main())
