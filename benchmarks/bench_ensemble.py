# SPDX-License-Identifier: MIT
"""What a member of a study costs beside its own stepping, and a study of many members.

Run on an idle machine, one thread per process::

    ./env python3 benchmarks/bench_ensemble.py

Members have the same mesh and other numbers.  For each scene: making the scene, building a
simulation of it, the loop over its steps, and a member of a study, scene and results included; they
alternate, and medians count.  Then one study of 1000 members under ``mpirun`` with one process and
with two, each with its memory after a tenth of the members and at the end.  Prints a table and
writes one JSON line per case to ``benchmarks/results/bench_ensemble.jsonl``.
"""

import argparse
import json
import os
import statistics
import subprocess
import sys
import time
from pathlib import Path

from mpi4py import MPI

from records import keep

import ufl_beam as ub

STEEL = {"b": 0.1, "h": 0.2, "nu": 0.3, "rho": 7850.0}  # m, -, kg/m^3
DT = 1e-3  # s


def cantilever(cells, force, modulus, **hinges):
    """A cantilever of 2 m with a load at its end."""
    section = ub.Section.rectangle(E=modulus, **STEEL)
    beam = ub.Beam((0, 0), (2, 0), section, cells=cells, **hinges)
    load = ub.PointLoad(beam.end, force=(0, -force))
    return ub.Scene([beam], supports=[ub.Clamped(beam.start)], loads=[load])


def elastic(number, cells=8):
    """The member of a number; N, Pa."""
    return cantilever(cells, 100.0 + number, 2e11 + 1e8 * number)


def hinged(number):
    """The same with a hinge of zero length that opens."""
    law = ub.Softening(limit=190.0 + 0.01 * number, fracture_energy=1e3)  # N m, J
    return cantilever(12, 100.0, 2e11 + 1e8 * number, hinges={0.0: law})


CASES = {"elastic, 8 cells": (elastic, 1000), "plastic hinge, 12 cells": (hinged, 300)}


def member(make, steps):
    """The member of a study whose scenes ``make`` makes."""

    def run(number):
        scene = make(number)
        times = {"t": (0.0, DT * steps), "dt": DT, "progress": False}
        solution = ub.simulate(scene, ub.EnergyMomentum(), **times)
        return {"end": solution.displacement(scene.beams[0].end)[-1]}

    return run


def timed(action):
    """Result of an action, and its seconds."""
    begin = time.perf_counter()
    result = action()
    return result, time.perf_counter() - begin


def parts(make, steps, number):
    """Seconds of the parts of a member."""
    scene, making = timed(lambda: make(number))
    simulation, building = timed(lambda: ub.Simulation(scene, ub.EnergyMomentum()))

    def go():
        for n in range(1, steps + 1):
            simulation.step_to(DT * n)

    _, stepping = timed(go)
    simulation.close()
    cases = [{"number": number + i / 10} for i in range(5)]
    _, five = timed(lambda: ub.study(member(make, steps), cases, progress=False))
    return {"scene": making, "building": building, "stepping": stepping, "member": five / 5}


def beside_stepping(name, repeat):
    """Medians of the parts of a member, and the ratio of a member to its stepping."""
    make, steps = CASES[name]
    runs = [parts(make, steps, number) for number in range(repeat + 1)][1:]  # the first compiles
    medians = {f"{part}_ms": 1e3 * statistics.median(r[part] for r in runs) for part in runs[0]}
    ratio = statistics.median(run["member"] / run["stepping"] for run in runs)
    return {"case": name, "steps": steps, **medians, "ratio": ratio}


def resident():
    """Memory of this process; MB."""
    (line,) = [x for x in Path("/proc/self/status").read_text().splitlines() if "VmRSS" in x]
    return int(line.split()[1]) / 1024


def many(members):
    """A study of so many members on the processes of this ``mpirun``."""
    memory, run = [], member(*CASES["elastic, 8 cells"])

    def watched(number):
        result = run(number)
        memory.append(resident())
        return result

    cases = [{"number": number} for number in range(members)]
    study, seconds = timed(lambda: ub.study(watched, cases, progress=False))
    found = [x for x in MPI.COMM_WORLD.allgather(memory) if x]
    return {
        "case": "study", "members": members, "processes": MPI.COMM_WORLD.size, "seconds": seconds,
        "ms_per_member": 1e3 * seconds / members, "checksum": study["end"].sum(axis=0).tolist(),
        "memory_mb": [(x[len(x) // 10], x[-1]) for x in found],
    }  # fmt: skip


def under_mpirun(processes, members):
    """The record of a study in an ``mpirun`` of its own."""
    command = ["mpirun", "-n", str(processes), sys.executable, __file__, "--here"]
    threads = dict.fromkeys(("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS"), "1")
    done = subprocess.run(
        [*command, "--members", str(members)],
        capture_output=True, text=True, env={**os.environ, **threads}, check=False,
    )  # fmt: skip
    if done.returncode:
        sys.exit(done.stderr)
    return json.loads(done.stdout.splitlines()[-1])


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--repeat", type=int, default=15, help="alternations")
    parser.add_argument("--members", type=int, default=1000)
    parser.add_argument("--processes", type=int, nargs="+", default=[1, 2])
    parser.add_argument("--here", action="store_true", help=argparse.SUPPRESS)
    options = parser.parse_args()
    if options.here:
        record = many(options.members)
        if MPI.COMM_WORLD.rank == 0:
            print(json.dumps(record))
        return
    for name in CASES:
        case = beside_stepping(name, options.repeat)
        keep("bench_ensemble", case)
        print(
            f"{name:24s} scene {case['scene_ms']:.2f} ms, building {case['building_ms']:.2f} ms, "
            f"{case['steps']} steps {case['stepping_ms']:.1f} ms, member {case['member_ms']:.1f} "
            f"ms: {case['ratio']:.2f} times its stepping",
            flush=True,
        )
    for processes in options.processes:
        case = under_mpirun(processes, options.members)
        keep("bench_ensemble", case)
        memory = ", ".join(f"{a:.0f} to {b:.0f}" for a, b in case["memory_mb"])
        print(
            f"study of {case['members']} members, {processes} processes: {case['seconds']:.1f} s, "
            f"{case['ms_per_member']:.1f} ms each, {memory} MB",
            flush=True,
        )


if __name__ == "__main__":
    main()
