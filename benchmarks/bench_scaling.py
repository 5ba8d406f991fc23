# SPDX-License-Identifier: MIT
"""Time per Newton iteration of a lattice of 200 000 cells on one and on two processes.

Run on an idle machine of at least two cores, one thread per process::

    ./env python3 benchmarks/bench_scaling.py

Starts ``mpirun`` once for each number of processes, alternating.  Prints a table and writes one
JSON line per case to ``benchmarks/results/bench_scaling.jsonl``.  Each figure is a median over the
runs of the time loop, kept history included; building the scene is timed by itself.  The parts are
those of the first process, timed in the loop; what a process waits for another is in
"communication" and "convergence test".
"""

import argparse
import json
import os
import resource
import statistics
import subprocess
import sys
import time
from collections import defaultdict

from mpi4py import MPI

from records import keep

import ufl_beam as ub
from ufl_beam.simulation import replicas as one_process_below

STEEL = {"E": 210e9, "nu": 0.3, "rho": 7850.0}  # Pa, -, kg/m^3
BAY, MEMBER_CELLS = 3.0, 10  # m


def lattice(cells, bays):
    """A tower of square bays, about as high as ``cells`` allow; every seventh joint is revolute."""
    section = ub.Section.rectangle(b=0.1, h=0.1, **STEEL)  # m
    height = max(1, round(cells / MEMBER_CELLS / (2 * bays + 1)))
    beams, ends = [], defaultdict(list)

    def member(a, b):
        x, y = ((BAY * i, BAY * j) for i, j in (a, b))
        beam = ub.Beam(x, y, section, cells=MEMBER_CELLS, name=f"{a}-{b}")
        beams.append(beam)
        ends[a].append(beam.start)
        ends[b].append(beam.end)

    for j in range(height):
        for i in range(bays + 1):
            member((i, j), (i, j + 1))
        for i in range(bays):
            member((i, j + 1), (i + 1, j + 1))
    joints = [
        (ub.Rigid if (i + j) % 7 else ub.Revolute)(*places)
        for (i, j), places in ends.items()
        if len(places) > 1
    ]
    blow = ub.Table([0, 5e-3, 10e-3], [0, 1, 0])  # s
    return ub.Scene(
        beams,
        joints=joints,
        supports=[ub.Clamped(ends[i, 0][0]) for i in range(bays + 1)],
        loads=[ub.PointLoad(ends[0, height][0], force=(20e3, 0.0), time=blow)],  # N
    )


class Stopwatch:
    """Seconds spent in functions, each without what it spends in others."""

    def __init__(self):
        self.seconds = defaultdict(float)
        self._inner = [0.0]

    def watch(self, owner, name, part):
        """Let a method of an object be timed as a part."""
        function = getattr(owner, name)

        def timed(*arguments):
            begin = time.perf_counter()
            self._inner.append(0.0)
            try:
                return function(*arguments)
            finally:
                spent = time.perf_counter() - begin
                self.seconds[part] += spent - self._inner.pop()
                self._inner[-1] += spent

        setattr(owner, name, timed)


def watched(simulation):
    """A stopwatch of the parts of an iteration."""
    watch, solver = Stopwatch(), simulation.solver
    chains_first = solver._ksp.getPC().getPythonContext()
    for owner, names, part in (
        (simulation.equation, ("residual", "tangent"), "assembly"),
        (simulation.equation, ("complete",), "supports and ghosts"),
        (solver._vectors, ("update_ghosts",), "supports and ghosts"),
        (solver.convergence, ("_size", "_round_off"), "convergence test"),
        (chains_first._elimination, ("factor", "reduce", "expand"), "elimination"),
        (chains_first._elimination, ("_sum",), "communication"),
        (chains_first, ("_succeeds",), "what is left"),
    ):
        for name in names:
            watch.watch(owner, name, part)
    return watch


def measure(cells, bays, steps):
    """One time loop on the processes of this ``mpirun``; a record, on the first of them."""
    comm = MPI.COMM_WORLD
    one_process_below.SMALLEST_SHARE = 1
    begin = time.perf_counter()
    scene = lattice(cells, bays)
    simulation = ub.Simulation(scene, ub.Midpoint())
    built = time.perf_counter() - begin
    dt = 1e-3  # s
    simulation.step_to(dt)  # what PETSc does in the first factorisation only
    watch, before = watched(simulation), simulation.iterations
    comm.Barrier()
    begin = time.perf_counter()
    for n in range(2, steps + 2):
        simulation.step_to(n * dt)
        simulation.keep()
    comm.Barrier()
    seconds = time.perf_counter() - begin
    memory = comm.gather(resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024)
    iterations = simulation.iterations - before
    parts = {name: 1e3 * t / iterations for name, t in watch.seconds.items()}
    parts["step and SNES"] = 1e3 * seconds / iterations - sum(parts.values())
    return {
        "case": "lattice", "cells": len(simulation.grid.cells), "beams": len(scene.beams),
        "bays": bays, "processes": comm.size, "steps": steps, "iterations": iterations,
        "build_s": built, "ms_per_iteration": 1e3 * seconds / iterations, "memory_mb": memory,
        "parts_ms": parts,
    }  # fmt: skip


def run(processes, options):
    """The record of a measurement in an ``mpirun`` of its own."""
    command = [
        "mpirun", "-n", str(processes), sys.executable, __file__, "--here",
        "--cells", str(options.cells), "--bays", str(options.bays), "--steps", str(options.steps),
    ]  # fmt: skip
    threads = dict.fromkeys(("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS"), "1")
    done = subprocess.run(
        command, capture_output=True, text=True, env={**os.environ, **threads}, check=False
    )
    if done.returncode:
        sys.exit(done.stderr)
    return json.loads(done.stdout.splitlines()[-1])


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--cells", type=int, default=200_000)
    parser.add_argument("--bays", type=int, default=10, help="width of the lattice")
    parser.add_argument("--steps", type=int, default=5)
    parser.add_argument("--repeat", type=int, default=3, help="runs of each case")
    parser.add_argument("--processes", type=int, nargs="+", default=[1, 2])
    parser.add_argument("--here", action="store_true", help=argparse.SUPPRESS)
    options = parser.parse_args()
    if options.here:
        record = measure(options.cells, options.bays, options.steps)
        if MPI.COMM_WORLD.rank == 0:
            print(json.dumps(record))
        return
    runs = [[run(n, options) for n in options.processes] for _ in range(options.repeat)]
    for same in zip(*runs, strict=True):
        times = sorted(one["ms_per_iteration"] for one in same)
        case = {
            **sorted(same, key=lambda one: one["ms_per_iteration"])[len(same) // 2],
            "ms_per_iteration": statistics.median(times),
            "ms_min": times[0], "ms_max": times[-1],
        }  # fmt: skip
        keep("bench_scaling", case)
        print(
            f"{case['cells']} cells, {case['processes']} processes: "
            f"{case['ms_per_iteration']:.1f} ms/iteration ({times[0]:.1f} to {times[-1]:.1f}), "
            f"built in {case['build_s']:.1f} s, "
            f"{max(case['memory_mb']):.0f} MB on a process; "
            + ", ".join(f"{name} {t:.1f}" for name, t in case["parts_ms"].items()),
            flush=True,
        )


if __name__ == "__main__":
    sys.exit(main())
