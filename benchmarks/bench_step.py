# SPDX-License-Identifier: MIT
"""Time per step and per Newton iteration of the elastic flying beam, and where it goes.

Run on an idle machine, one core::

    make bench

Prints a table and writes one JSON line per case to ``benchmarks/results/bench_step.jsonl``.  Each
figure is the median over repeated runs of the whole time loop (load, predictor, Newton iterations,
ledger, kept history), without building the scene; minimum and maximum are in the JSON.  The parts
are timed by themselves, in a loop, at a state of the motion.
"""

import argparse
import statistics
import sys
import time

import numpy as np
from records import keep, machine

import ufl_beam as ub
from ufl_beam.compiled.c_library import doubles, ffi, lib

CASES = ((8, 1000), (64, 500), (512, 200), (4096, 50), (100_000, 10))  # cells, steps


def flying_beam(cells):
    section = ub.Section(EA=1e4, GA=1e4, EI=100.0, rhoA=1.0, rhoI=10.0)
    beam = ub.Beam((6, 0), (0, 8), section, cells=cells)
    load = ub.PointLoad(beam.start, force=(8, 0), moment=-80, amplitude=lambda t: float(t < 2.5))
    return ub.Scene([beam], loads=[load])


def time_loop(scene, steps, dt):
    """Seconds of the time loop, its iterations, and the simulation at its end."""
    simulation = ub.Simulation(scene, ub.EnergyMomentum())
    begin = time.perf_counter()
    for n in range(1, steps + 1):
        simulation.step_to(n * dt)
        simulation.keep()
    return time.perf_counter() - begin, simulation.iterations, simulation


def microseconds(function, seconds=0.2):
    """Median time of one call, over about ``seconds``."""
    function()
    begin = time.perf_counter()
    function()
    count = max(1, int(0.02 / max(time.perf_counter() - begin, 1e-7)))
    times = []
    end = time.perf_counter() + seconds
    while not times or time.perf_counter() < end:
        begin = time.perf_counter()
        for _ in range(count):
            function()
        times.append((time.perf_counter() - begin) / count)
    return 1e6 * statistics.median(times)


def parts(simulation):
    """Microseconds of the parts of an iteration; the call itself takes half of one."""
    solver = simulation.solver
    x, equation = solver.unknowns.copy(), simulation.equation.c
    r = np.zeros_like(x)
    at_x, at_r = doubles(x), doubles(r)
    failed = ffi.new("int *")

    def assemble():
        lib.fill_tangent(equation, at_x)
        lib.hold_tangent(equation)

    assemble()
    return {
        "residual": microseconds(lambda: lib.residual(equation, at_x, at_r, ffi.NULL)),
        "of it beams": microseconds(lambda: simulation.beams[0].add_residual(x, r)),
        "tangent": microseconds(assemble),
        "of it beams ": microseconds(lambda: simulation.beams[0].add_tangent(x)),
        "factor": microseconds(lambda: lib.factor_tangent(equation, failed)),
        "solve": microseconds(lambda: lib.solve_tangent(equation, 0)),
        "sizes of forces": microseconds(lambda: lib.norm(len(r), ffi.NULL, equation.weight, at_r)),
    }


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--repeat", type=int, default=7, help="runs of each case")
    parser.add_argument("--dt", type=float, default=0.01, help="step (s)")
    options = parser.parse_args()
    print(f"flying beam, dt = {options.dt} s, median of {options.repeat} runs; {machine()}")
    print(
        f"{'cells':>6} {'µs/step':>10} {'iterations':>10} {'µs/iter':>9} {'µs/cell/iter':>12}"
        "  parts, µs"
    )
    for cells, steps in CASES:
        time_loop(flying_beam(cells), 2, options.dt)  # compiles
        loops = [time_loop(flying_beam(cells), steps, options.dt) for _ in range(options.repeat)]
        iterations, simulation = loops[0][1:]
        seconds = sorted(loop[0] for loop in loops)
        median = 1e6 * statistics.median(seconds)
        split = {name: round(t, 2) for name, t in parts(simulation).items()}
        print(
            f"{cells:6d} {median / steps:10.1f} {iterations / steps:10.2f} "
            f"{median / iterations:9.1f} {median / iterations / cells:12.3f}  "
            + ", ".join(f"{name.strip()} {t:.1f}" for name, t in split.items()),
            flush=True,
        )
        case = {
            "case": "flying beam", "cells": cells, "steps": steps, "dt": options.dt,
            "iterations": iterations, "us_per_iteration": median / iterations,
            "us_min": 1e6 * seconds[0] / iterations, "us_max": 1e6 * seconds[-1] / iterations,
            "parts_us": split,
        }  # fmt: skip
        keep("bench_step", case)


if __name__ == "__main__":
    sys.exit(main())
