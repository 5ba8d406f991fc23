# SPDX-License-Identifier: MIT
"""Cost of effects that are present but idle: a scene with each effect, and without it.

Run on an idle machine, one thread::

    ./env python3 benchmarks/bench_idle.py [--update] [--rounds 25]

The scene is a clamped beam with a body at its end, which swings.  Both scenes of a line run in
turn; their motions must be equal.  Times are CPU times of the time loop, and the ratio is the
median of those within a round.  With ``--update`` the table goes into docs/steps.md.  One JSON
line per case goes to ``benchmarks/results/bench_idle.jsonl``.
"""

import argparse
import statistics
import tempfile
import time
import warnings
from pathlib import Path
from unittest.mock import patch

import numpy as np
from records import keep, machine

import ufl_beam as ub
import ufl_beam.structures as st
from ufl_beam.simulation import run as runs

PAGE = Path(__file__).parents[1] / "docs" / "steps.md"
DT, ROUNDS = 1e-3, 25  # s
STEPS = {8: 1000, 64: 300}
"""Steps of a run, by the number of cells of the beam."""

NUMBERS = {"EA": 1e6, "GA": 1e6, "EI": 500.0, "rhoA": 2.0, "rhoI": 0.01}
STRONG = 1e9  # limit that no force reaches; N, N m
FOLDER = Path(tempfile.mkdtemp())


def scene(
    cells, hinges=(), damping=(), record=None, dt=DT, law=None, run=(), foot=ub.Clamped, **add
):
    """The scene, with what functions of beam and body return, and arguments of `simulate`."""
    beam = ub.Beam((0, 0), (2, 0), ub.Section(**NUMBERS, **(law or {})), cells=cells,
                   hinges=dict(hinges))  # fmt: skip
    body = ub.Body((2.2, 0), mass=1.0, inertia=0.01)
    some = {"joints": [], "loads": [], "connectors": [], "supports": [], "works": []}
    some |= {name: make(beam, body) for name, make in add.items()}
    some["joints"].append(ub.Rigid(beam.end, body.at(2, 0)))
    some["loads"].append(ub.Gravity())
    some["supports"].append(foot(beam.start))
    made = ub.Scene([beam], bodies=[body], damping=damping, **some)
    return made, {"dt": dt, "record": record(beam) if record else (), **dict(run)}


def slide(law):
    """Connector between the ground and the end of the beam, across the beam."""
    return {"connectors": lambda beam, body: [
        ub.Slide(ub.ground(2, 0), beam.end, law, axis=(0.0, 1.0))
    ]}  # fmt: skip


def bushing(law):
    """Connector of all components between the ground and the end of the beam."""
    return {"connectors": lambda beam, body: [ub.Bushing(ub.ground(2, 0), beam.end, law)]}


def load(make):
    """A load on the beam."""
    return {"loads": lambda beam, body: [make(beam)]}


def no_work(v, w, c):
    """Virtual work of a force c v."""
    return -c * (v[0] * w[0] + v[1] * w[1])


AT_REST = ub.Table([0, 1], [0, 0])
CONTACT = {"stiffness": 1e5, "gap": 0.5, "damping": 0.1}  # N/m, m, s/m
SOFTENING = ub.Softening(STRONG, 1e9)
HELD = {"joints": lambda beam, body: [
    ub.Prismatic(ub.ground(2, 0), beam.end, axis=(1.0, 0.0), turning=True)
]}  # fmt: skip
"""Scene without friction: a joint holds the motion across the beam."""

FIXED = {"foot": ub.Pinned, "connectors": lambda beam, body: [
    ub.Turn(ub.ground(0, 0), beam.start, ub.PrescribedMotion(AT_REST))
]}  # fmt: skip
"""Scene whose beam is pinned, and a motor at rest holds its rotation."""

SPRING, STOP = slide(ub.Spring(1e4)), slide(ub.Stop(1e5, low=-0.5))
CURVE = st.SNCurve.eurocode(71e6)
AS_LONG = ub.Adaptive(1.0, first=DT, longest=DT)
"""Adaptive steps with a tolerance that allows the longest step."""

CASES = {
    "the same scene": ({}, {}),
    "embedded hinges in all cells, closed": ({"law": {"hinge": SOFTENING}}, {}),
    "motor at rest and pin in place of the clamp": (FIXED, {}),
    "hinge of zero length at the clamp, closed": ({"hinges": {0.0: SOFTENING}}, FIXED),
    "bending law that does not yield": (
        {"law": {"bending": ub.ElastoPlastic(STRONG, isotropic=1.0)}}, {},
    ),
    "`Stop` that does not touch": (STOP, {}),
    "`Clearance` that does not touch": (bushing(ub.Clearance(**CONTACT)), {}),
    "`Clearance` with friction, does not touch": (
        bushing(ub.Clearance(**CONTACT, friction=0.2, radius=0.02)), {},
    ),
    "`Coulomb` that sticks": (slide(ub.Coulomb(STRONG)), HELD),
    "`RigidPlastic` that holds": (
        slide(ub.RigidPlastic(ub.ElastoPlastic(STRONG, isotropic=1.0))), HELD,
    ),
    "motor at rest, `PrescribedMotion` of zero": (slide(ub.PrescribedMotion(AT_REST)), HELD),
    "motor at rest, function of time": (
        slide(ub.PrescribedMotion(lambda t: 0.0)), HELD,
    ),
    "spring that does not yield": (
        slide(ub.Spring(1e4, ub.ElastoPlastic(STRONG, isotropic=1.0))), SPRING,
    ),
    "spring that does not break": (slide(ub.Spring(1e4, softening=SOFTENING)), SPRING),
    "`PrescribedForce` of zero": (slide(ub.PrescribedForce(AT_REST)), {}),
    "`Controller` that returns zero": (slide(ub.Controller(lambda now: 0.0)), {}),
    "`Controller` of zero, sampled every 20 steps": (
        slide(ub.Controller(lambda now: 0.0, sample=20 * DT)), {},
    ),
    "`ForceLaw` of zero": (slide(ub.ForceLaw(lambda e, rate: 0.0 * e)), {}),
    "`Damper` of 1e-12": (slide(ub.Damper(1e-12)), {}),
    "`KelvinVoigt` of 1e-15": ({"damping": [ub.KelvinVoigt(1e-15)]}, {}),
    "`Rayleigh` of 1e-15": ({"damping": [ub.Rayleigh(mass=1e-15, stiffness=1e-15)]}, {}),
    "`PointLoad` of zero": (load(lambda beam: ub.PointLoad(beam.at(0.5))), {}),
    "`PointLoad` of zero, function of time": (
        load(lambda beam: ub.PointLoad(beam.at(0.5), (0.0, 1.0), amplitude=lambda t: 0.0)), {},
    ),
    "`FollowerLoad` of zero": (load(lambda beam: ub.FollowerLoad(beam.at(0.5))), {}),
    "`Pressure` of zero": (load(lambda beam: ub.Pressure(beam, normal=0.0)), {}),
    "`ImposedStrain` of zero": (load(ub.ImposedStrain), {}),
    "`MovingLoad` off the beam": (
        load(lambda beam: ub.MovingLoad(beam, lambda t: -1.0, force=(0.0, -1.0))), {},
    ),
    "`MovingLoad` with a mass, off the beam": (
        load(lambda beam: ub.MovingLoad(beam, lambda t: -1.0, force=(0.0, -1.0), mass=1.0)), {},
    ),
    "`RotatingFrame` at rest": (load(lambda beam: ub.RotatingFrame(rate=0.0)), {}),
    "`VirtualWork` of zero along the beam": (
        {"works": lambda beam, body: [ub.VirtualWork("air", no_work, numbers={"c": 0.0})]}, {},
    ),
    "`Events` without events": (STOP | {"record": lambda beam: [ub.Events()]}, STOP),
    "`Extremes`": ({"record": lambda beam: [ub.Extremes()]}, {}),
    "`Fatigue` at one spot": (
        {"record": lambda beam: [
            st.Fatigue(st.HotSpot.fibre(beam.start, y=0.01, E=210e9), CURVE)
        ]}, {},
    ),
    "`History` of one place, a row every 1000 steps": (
        {"record": lambda beam: [ub.History(FOLDER / "h.csv", [beam.end], every=1000)]}, {},
    ),
    "`until` that is never satisfied": ({"run": {"until": lambda now: False}}, {}),
    "`Adaptive` at the longest step": ({"dt": AS_LONG}, {}),
    "`Adaptive` with its pilot, `Stop` that does not touch": (STOP | {"dt": AS_LONG}, STOP),
}  # fmt: skip
"""Arguments of :func:`scene` with the effect, and without it."""


def timed(cells, steps, arguments):
    """CPU time of the time loop (µs a step), and the final motion of the end of the beam."""
    (made, options), loop, spent = scene(cells, **arguments), runs.take_steps, []

    def clocked(*some, **more):
        begin = time.process_time()
        loop(*some, **more)
        spent.append(time.process_time() - begin)

    with (
        patch.object(runs, "take_steps", clocked),
        warnings.catch_warnings(action="ignore", category=ub.ModelWarning),  # loads off the beam
    ):
        run = ub.simulate(made, ub.EnergyMomentum(), t=(0, steps * DT), **options)
    return 1e6 * sum(spent) / steps, run.displacement(made.beams[0].end)[-1]


def measure(name, rounds, steps=STEPS):
    """Records of a line, one for each number of cells; raises if the effect is not idle.

    Motions differ by the round-off of Newton's method.  Adaptive steps have other lengths.
    """
    near = 1e-2 if "dt" in CASES[name][0] else 1e-9  # m, rad
    for cells, number in steps.items():
        pairs = []
        for _ in range(rounds):
            (first, q), (second, q0) = (timed(cells, number, x) for x in CASES[name])
            if not np.allclose(q, q0, rtol=0, atol=near):
                raise RuntimeError(f"{name}, {cells} cells: the effect changes the motion")
            pairs.append((first, second))
        yield {
            "case": name, "cells": cells, "us_per_step_without": min(pair[1] for pair in pairs),
            "ratio": statistics.median(first / second for first, second in pairs),
        }  # fmt: skip


def table(records, rounds):
    """Markdown of all lines."""
    of, sizes = machine(), list(dict.fromkeys(record["cells"] for record in records))
    heads = [x for n in sizes for x in (f"ratio, {n} cells", f"µs more, {n} cells")]
    lines = [
        f"Commit {of['commit']}, {of['processor']}; {rounds} rounds.", "",
        f"| idle effect | {' | '.join(heads)} |", "|---" + "|--:" * len(heads) + "|",
    ]  # fmt: skip
    for name in dict.fromkeys(record["case"] for record in records):
        numbers = [
            f"{r['ratio']:.2f} | {(r['ratio'] - 1) * r['us_per_step_without']:.1f}"
            for r in records
            if r["case"] == name
        ]
        lines.append(f"| {name} | {' | '.join(numbers)} |")
    return "\n".join(lines)


def main():
    """Measure, print, and write."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--update", action="store_true", help="write the table into docs/steps.md")
    parser.add_argument("--rounds", type=int, default=ROUNDS)
    chosen = parser.parse_args()
    records = []
    for name in CASES:
        for record in measure(name, chosen.rounds):
            keep("bench_idle", record)
            records.append(record)
            print(record, flush=True)
    print(made := table(records, chosen.rounds))
    if chosen.update:
        begin, end = "<!-- idle -->\n", "<!-- end of idle -->"
        before, rest = PAGE.read_text(encoding="utf-8").split(begin)
        _, after = rest.split(end)
        PAGE.write_text(before + begin + made + "\n" + end + after, encoding="utf-8")


if __name__ == "__main__":
    main()
