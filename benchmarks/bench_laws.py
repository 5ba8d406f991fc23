# SPDX-License-Identifier: MIT
"""Cost of laws of connectors, joints, supports, loads and works: a scene with each and without.

Run on an idle machine, one core::

    ./env python3 benchmarks/bench_laws.py [--update]

The scene is a beam of 8 cells with a body at its end.  Both scenes of a line are stepped in turn;
times are CPU times of the time loop, and the ratio is the median of those within a round.  One JSON
line per case goes to ``benchmarks/results/bench_laws.jsonl``, and with ``--update`` the table into
docs/steps.md.
"""

import argparse
import statistics
import time
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import ufl
from records import keep, machine

import ufl_beam as ub

PAGE = Path(__file__).parents[1] / "docs" / "steps.md"
DT, STEPS, ROUNDS = 1e-3, 1000, 7  # s

SECTION = ub.Section(EA=1e6, GA=1e6, EI=500.0, rhoA=2.0, rhoI=0.01)
ON_LINE, ACROSS = (1.0, 0.0), (0.0, 1.0)


def scene(add):
    """A clamped beam with a body at its end, and what ``add(beam, body)`` returns."""
    beam = ub.Beam((0, 0), (2, 0), SECTION, cells=8)
    body = ub.Body((2.2, 0), mass=1.0, inertia=0.01)
    more = {"joints": [], "supports": [], "loads": [], "connectors": [], "works": []}
    more.update(add(beam, body))
    foot = more.pop("foot", ub.Clamped(beam.start))
    return ub.Scene(
        [beam],
        bodies=[body],
        joints=[ub.Rigid(beam.end, body.at(2, 0)), *more["joints"]],
        supports=[foot, *more["supports"]],
        loads=[ub.Gravity(), *more["loads"]],
        connectors=more["connectors"],
        works=more["works"],
    )


@dataclass(frozen=True)
class Cubic(ub.extend.ConnectorLaw):
    """A spring that stiffens."""

    stiffness: float

    def energy(self, motion, state):
        return self.stiffness * (motion**2 / 2 + 25 * motion**4)


@dataclass(frozen=True)
class Mount(ub.extend.ConnectorLaw):
    """A mount that stiffens in all directions together."""

    stiffness: float
    components = 2

    def energy(self, motion, state):
        x, y = motion
        return self.stiffness * (x**2 + 2 * y**2) / 2 * (1 + 50 * (x**2 + y**2))


@dataclass(frozen=True)
class Brake(ub.extend.ConnectorLaw):
    """More to break loose than to slide."""

    rest: float
    moving: float

    def limit(self, state):
        return self.rest

    def sliding(self, motion, rate, state, dt):
        return self.moving


def slide(law):
    """A connector between the ground and the end of the beam, across it."""
    return lambda beam, body: {
        "connectors": [ub.Slide(ub.ground(2, 0), beam.end, law, axis=ACROSS)]
    }


def bushing(law):
    """The same with all components of the displacement."""
    return lambda beam, body: {
        "connectors": [ub.Bushing(ub.ground(2, 0), beam.end, law, axis=ACROSS)]
    }


def turn(law):
    """A connector between the ground and the start of the beam, which is pinned."""
    return lambda beam, body: {
        "foot": ub.Pinned(beam.start),
        "connectors": [ub.Turn(ub.ground(0, 0), beam.start, law)],
    }


def pinned(beam, body):
    """Nothing but a pin in the place of the clamp."""
    return {"foot": ub.Pinned(beam.start)}


def drag(v, w, c):
    """Work of the resistance of air."""
    v_x, v_y, _ = v
    w_x, w_y, _ = w
    return -c * ufl.sqrt(v_x**2 + v_y**2 + 1e-9) * (v_x * w_x + v_y * w_y)


CASES = {
    "`Spring`": (slide(ub.Spring(1e4)), None),
    "`Spring` that yields": (slide(ub.Spring(1e4, ub.ElastoPlastic(5.0, isotropic=1e3))), None),
    "`Damper`": (slide(ub.Damper(10.0)), None),
    "`PrescribedForce`": (slide(ub.PrescribedForce(lambda t: 5.0 * np.sin(30 * t))), None),
    "`Stop`": (slide(ub.Stop(1e5, low=-0.005)), None),
    "`Coulomb`": (slide(ub.Coulomb(2.0)), None),
    "`ConnectorLaw`": (slide(Cubic(1e4)), None),
    "`ConnectorLaw` that holds": (slide(Brake(2.5, 2.0)), None),
    "`Bushing` of two components": (bushing(Mount(1e4)), None),
    "`Clearance`": (bushing(ub.Clearance(1e5, gap=0.005, damping=0.1)), None),
    "`Clearance` with friction": (
        bushing(ub.Clearance(1e5, gap=0.005, damping=0.1, friction=0.2, radius=0.02)), None,
    ),
    "`RigidPlastic`": (turn(ub.RigidPlastic(ub.ElastoPlastic(15.0, isotropic=10.0))), pinned),
    "`PrescribedMotion`": (turn(ub.PrescribedMotion(lambda t: 0.2 * np.sin(5 * t))), pinned),
    "`ForceLaw`": (slide(ub.ForceLaw(lambda e, de: 1e4 * e + 1e6 * e**3)), None),
    "`Controller`": (slide(ub.Controller(lambda now: 1e3 * float(now.t))), None),
    "`Guided`": (
        lambda beam, body: {"joints": [ub.Guided(body.at(2.2, 0), lambda s: (2.2 + s, s**2))],
                            "foot": ub.Roller(beam.start, along=ON_LINE)}, None,
    ),
    "`VirtualWork`": (
        lambda beam, body: {"works": [ub.VirtualWork("air", drag, numbers={"c": 0.5})]}, None,
    ),
    "`Roller` at an angle": (
        lambda beam, body: {"supports": [ub.Roller(beam.end, along=(1.0, 0.2))]},
        lambda beam, body: {"supports": [ub.Roller(beam.end, along=ON_LINE)]},
    ),
    "`RotatingFrame`": (lambda beam, body: {"loads": [ub.RotatingFrame(rate=3.0)]}, None),
}  # fmt: skip
"""What each line adds, and what stands in its place in the scene without it, if anything."""


def stepped(make):
    """Microseconds of CPU time a step, and iterations a step."""
    simulation = ub.Simulation(make, ub.EnergyMomentum())
    simulation.step_to(DT)
    ends, begin = DT * np.arange(2, STEPS + 2), time.process_time()
    before = simulation.iterations
    while len(ends):
        ends = ends[simulation.steps_to(ends) :]
    seconds, iterations = time.process_time() - begin, simulation.iterations - before
    simulation.close()
    return 1e6 * seconds / STEPS, iterations / STEPS


def measure(name, rounds):
    """One line of the table, as a record."""
    add, without = CASES[name]
    scenes = scene(add), scene(without or (lambda beam, body: {}))
    pairs = [[stepped(one) for one in scenes] for _ in range(rounds)]
    (us, its), (us_without, its_without) = (
        (statistics.median(pair[k][0] for pair in pairs), pairs[0][k][1]) for k in range(2)
    )
    ratio = statistics.median((a / i) / (b / j) for (a, i), (b, j) in pairs)
    more = statistics.median(a / i - b / j for (a, i), (b, j) in pairs)
    return {
        "case": name, "us_per_step": us, "iterations": its, "us_per_step_without": us_without,
        "iterations_without": its_without, "ratio_per_iteration": ratio, "more_per_iteration": more,
    }  # fmt: skip


def table(records, rounds):
    """Markdown of all lines."""
    of = machine()
    lines = [
        f"Commit {of['commit']}, {of['processor']}; medians of {rounds} rounds.", "",
        "| object | µs a step | iterations | µs a step without it | iterations | ratio | µs more |",
        "|---|--:|--:|--:|--:|--:|--:|",
    ]  # fmt: skip
    for r in records:
        lines.append(
            f"| {r['case']} | {r['us_per_step']:.1f} | {r['iterations']:.2f} | "
            f"{r['us_per_step_without']:.1f} | {r['iterations_without']:.2f} | "
            f"{r['ratio_per_iteration']:.2f} | {r['more_per_iteration']:.1f} |"
        )
    return "\n".join(lines)


def main():
    """Measure, print, and write."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--update", action="store_true", help="write the table into docs/steps.md")
    parser.add_argument("--rounds", type=int, default=ROUNDS)
    chosen = parser.parse_args()
    records = [measure(name, chosen.rounds) for name in CASES]
    for record in records:
        keep("bench_laws", record)
    print(table(records, chosen.rounds))
    if chosen.update:
        begin, end = "<!-- laws -->\n", "<!-- end of laws -->"
        before, rest = PAGE.read_text(encoding="utf-8").split(begin)
        _, after = rest.split(end)
        PAGE.write_text(
            before + begin + table(records, chosen.rounds) + "\n" + end + after, encoding="utf-8"
        )


if __name__ == "__main__":
    main()
