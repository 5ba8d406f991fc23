# SPDX-License-Identifier: MIT
"""What a scene pays for effects that it does not have: nothing.

Run on an idle machine, one thread::

    ./env python3 benchmarks/bench_nothing.py

The same beam of 50 cells with more and more effects.  Of each: unknowns, entries of the matrix,
which virtual works are in the equation, and the time of an iteration, of the runs that alternate.
What a scene lacks must not appear in its row.  Prints a table and writes one JSON line per scene
to ``benchmarks/results/bench_nothing.jsonl``.
"""

import argparse
import statistics
import time

from records import keep

import ufl_beam as ub

SECTION = {"EA": 1e4, "GA": 1e4, "EI": 100.0, "rhoA": 1.0, "rhoI": 1.0}


def beam(hinge=None, damping=(), joint=False, **law):
    """A cantilever of 10 m, in two halves that are rigidly joined, or by a spring."""
    section = ub.Section(**SECTION, **law)
    left = ub.Beam((0, 0), (5, 0), section, cells=25, hinges={} if hinge is None else {0.0: hinge})
    right = ub.Beam((5, 0), (10, 0), section, cells=25)
    joints = [(ub.Revolute if joint else ub.Rigid)(left.end, right.start)]
    return ub.Scene(
        [left, right],
        joints=joints,
        connectors=[ub.Turn(left.end, right.start, ub.Spring(1e3))] if joint else [],
        supports=[ub.Clamped(left.start)],
        loads=[ub.PointLoad(right.end, force=(0.0, -1.0), amplitude=ub.ramp(10.0))],
        damping=damping,
    )


CLOSED = ub.Softening(limit=1e6, fracture_energy=1.0)
SCENES = {
    "static, elastic": (beam(), ub.Static()),
    "static, one hinge": (beam(hinge=CLOSED), ub.Static()),
    "elastic": (beam(), ub.EnergyMomentum()),
    "one hinge, closed": (beam(hinge=CLOSED), ub.EnergyMomentum()),
    "all cells can yield": (
        beam(bending=ub.ElastoPlastic(yield_limit=1e6, isotropic=1.0)),
        ub.EnergyMomentum(),
    ),
    "a joint with a spring": (beam(joint=True), ub.EnergyMomentum()),
    "viscous": (beam(damping=[ub.KelvinVoigt(retardation_time=1e-3)]), ub.EnergyMomentum()),
    "losing energy": (beam(), ub.EnergyMomentum(alpha=0.01, beta=0.01)),
}


def run(name, steps):
    """A run's simulation, and seconds and iterations of its time loop."""
    scene, scheme = SCENES[name]
    simulation = ub.Simulation(scene, scheme)
    simulation.step_to(0.01)  # what is done once
    before, begin = simulation.iterations, time.perf_counter()
    for n in range(2, steps + 2):
        simulation.step_to(0.01 * n)
    return simulation, time.perf_counter() - begin, simulation.iterations - before


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--repeat", type=int, default=9, help="alternations")
    parser.add_argument("--steps", type=int, default=200)
    options = parser.parse_args()
    runs = [{name: run(name, options.steps) for name in SCENES} for _ in range(options.repeat + 1)][
        1:
    ]  # the first ones compile
    plain = {True: "elastic", False: "static, elastic"}
    print(
        f"{'':22s} {'unknowns':>8} {'entries':>8} {'its/step':>8} {'µs/it':>7} {'ratio':>6}  works"
    )
    for name, (_, scheme) in SCENES.items():
        simulation, _, iterations = runs[0][name]
        times = [1e6 * one[name][1] / one[name][2] for one in runs]
        beside = [
            (one[name][1] / one[name][2]) / (one[other][1] / one[other][2])
            for one in runs
            for other in [plain[scheme.dynamic]]
        ]
        case = {
            "case": name,
            "unknowns": simulation.numbering.size,
            "entries": len(simulation.equation.A.data),
            "works": [type(term).__name__ for term in simulation.terms],
            "iterations_per_step": iterations / options.steps,
            "us_per_iteration": statistics.median(times),
            "ratio": statistics.median(beside),
        }
        keep("bench_nothing", case)
        print(
            f"{name:22s} {case['unknowns']:8d} {case['entries']:8d} "
            f"{case['iterations_per_step']:8.2f} {case['us_per_iteration']:7.1f} "
            f"{case['ratio']:6.2f}  {', '.join(case['works'])}",
            flush=True,
        )


if __name__ == "__main__":
    main()
