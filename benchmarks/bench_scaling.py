# SPDX-License-Identifier: MIT
"""Time per Newton iteration of lattices of 200 000 cells on one and on two processes.

Run on an idle machine of at least two cores, one thread per process::

    ./env python3 benchmarks/bench_scaling.py

Starts ``mpirun`` once for each number of processes, alternating.  Prints a table and writes one
JSON line per case to ``benchmarks/results/bench_scaling.jsonl``, and the tables of docs/ranks.md.
Each figure is a median over the runs of the time loop; building the scene and keeping a state,
which each process does whole, are timed by themselves.  Work and messages are counted on the first
process, see scaling_model.py.
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
from scaling_model import count_traffic, work
from scaling_page import write_page

import ufl_beam as ub
from ufl_beam import parallel as one_process_below

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
        # Weight moves all parts from the start: where a wave fades out, numbers are below the least
        # normal one, and arithmetic with them takes several times as long.
        loads=[
            ub.PointLoad(ends[0, height][0], force=(20e3, 0.0), amplitude=blow),
            ub.Gravity(),
        ],  # N
    )


def measure(cells, bays, steps):
    """One time loop on the processes of this ``mpirun``; a record, on the first of them."""
    comm = MPI.COMM_WORLD
    one_process_below.SMALLEST_SUBDOMAIN = 1
    begin = time.perf_counter()
    scene = lattice(cells, bays)
    simulation = ub.Simulation(scene, ub.EnergyMomentum())
    built = time.perf_counter() - begin
    dt = 1e-3  # s
    simulation.step_to(dt)  # what PETSc does in the first factorisation only
    count, before = count_traffic(simulation), simulation.iterations
    comm.Barrier()
    begin = time.perf_counter()
    for n in range(2, steps + 2):
        simulation.step_to(n * dt)
    comm.Barrier()
    seconds = time.perf_counter() - begin
    iterations = simulation.iterations - before
    traffic = {f"{kind}_per_iteration": count[kind] / iterations for kind in ("messages", "bytes")}
    kept = 0.0
    for n in range(steps + 2, 2 * steps + 2):
        simulation.step_to(n * dt)
        comm.Barrier()
        begin = time.perf_counter()
        simulation.keep()
        kept += time.perf_counter() - begin
    memory = comm.gather(1.024e-3 * resource.getrusage(resource.RUSAGE_SELF).ru_maxrss)
    return {
        "case": "lattice", "cells": len(simulation.numbering.cells), "beams": len(scene.beams),
        "bays": bays, "processes": comm.size, "steps": steps, "iterations": iterations,
        "build_s": built, "ms_per_iteration": 1e3 * seconds / iterations,
        "ms_per_kept_state": 1e3 * kept / steps, "memory_mb": memory,
        **traffic, **work(simulation),
    }  # fmt: skip


def run(processes, cells, bays, steps):
    """The record of a measurement in an ``mpirun`` of its own."""
    command = [
        "mpirun", "-n", str(processes), sys.executable, __file__, "--here",
        "--cells", str(cells), "--bays", str(bays), "--steps", str(steps),
    ]  # fmt: skip
    threads = dict.fromkeys(("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS"), "1")
    done = subprocess.run(
        command, capture_output=True, text=True, env={**os.environ, **threads}, check=False
    )
    if done.returncode:
        sys.exit(done.stderr)
    return json.loads(done.stdout.splitlines()[-1])


def median(same):
    """The record of the median time, with the least and the largest."""
    times = sorted(one["ms_per_iteration"] for one in same)
    middle = sorted(same, key=lambda one: one["ms_per_iteration"])[len(same) // 2]
    times_ms = {"ms_per_iteration": statistics.median(times), "ms_min": times[0]}
    return {**middle, **times_ms, "ms_max": times[-1]}


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--cells", type=int, default=200_000)
    parser.add_argument("--bays", type=int, nargs="+", default=[10, 100], help="widths of lattices")
    parser.add_argument("--steps", type=int, default=5)
    parser.add_argument("--repeat", type=int, default=3, help="runs of each case")
    parser.add_argument("--here", action="store_true", help=argparse.SUPPRESS)
    options = parser.parse_args()
    if options.here:
        record = measure(options.cells, *options.bays, options.steps)
        if MPI.COMM_WORLD.rank == 0:
            print(json.dumps(record))
        return
    rows = []
    for bays in options.bays:
        of = (bays, options.steps)
        runs = [[run(n, options.cells, *of) for n in (1, 2)] for _ in range(options.repeat)]
        half = run(1, options.cells // 2, *of)
        cases = [median(same) for same in zip(*runs, strict=True)]
        for case in (*cases, half):
            keep("bench_scaling", case)
        print(*map(line, cases), sep="\n", flush=True)
        rows.append((cases, half))
    write_page(rows, lattice)


def line(case):
    """A measurement in words."""
    return (
        f"{case['cells']} cells, {case['bays']} bays, {case['processes']} processes: "
        f"{case['ms_per_iteration']:.1f} ms/iteration ({case['ms_min']:.1f} to "
        f"{case['ms_max']:.1f}), {case['ms_per_kept_state']:.1f} ms/kept state, built in "
        f"{case['build_s']:.1f} s, {max(case['memory_mb']):.0f} MB on a process"
    )


if __name__ == "__main__":
    sys.exit(main())
