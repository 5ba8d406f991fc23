# SPDX-License-Identifier: MIT
"""Script of test_replicas.py, for two processes: scenes that are not the same on both."""

import itertools
import sys

from mpi4py import MPI

import numpy as np

import ufl_beam as ub

COMM = MPI.COMM_WORLD
RANK = COMM.rank


def fails(t):
    if RANK == 1 and t > 0.5:
        raise RuntimeError("user")
    return 1.0


FUNCTIONS = {
    "seeded": lambda: (lambda rng: lambda t: rng.normal())(np.random.default_rng(1)),
    "random": lambda: (lambda rng: lambda t: rng.normal())(np.random.default_rng()),
    "late": lambda: lambda t: 1.0 if t < 0.85 else 1.0 + 0.001 * RANK,
    "round-off": lambda: lambda t: 1.0 + 1e-13 * RANK,
    "fails": lambda: fails,
}
"""Of the time; made anew for each run."""


def scene_of(time):
    section = ub.Section(EA=1e6, GA=1e6, EI=100.0, rhoA=1.0, rhoI=1e-3)
    beam = ub.Beam((0, 0), (1, 0), section, cells=2)
    push = ub.PointLoad(beam.end, force=(0, 10.0), amplitude=time)
    return beam.end, ub.Scene([beam], supports=[ub.Clamped(beam.start)], loads=[push])


def simulated(time, scheme, **more):
    end, scene = scene_of(time)
    solution = ub.simulate(scene, scheme, t=(0, 1), **more)
    return solution.displacement(end)[-1].tolist()


def stepped(time):
    end, scene = scene_of(time)
    simulation = ub.Simulation(scene, ub.EnergyMomentum())
    try:
        for i in range(10):
            simulation.step_to((i + 1) / 10)
        simulation.end()
        return simulation.solution.displacement(end)[-1].tolist()
    except BaseException:
        simulation.comparison.finish()
        raise
    finally:
        simulation.close()


def followed(time):
    size = 3 + time(0.9 if time is not fails else 0.1)
    end, scene = scene_of(lambda t: t * size)
    return ub.follow(scene, ub.LoadControl(0.25), steps=4).displacement(end)[-1].tolist()


RUNS = {
    "equal steps": lambda f: simulated(f, ub.EnergyMomentum(), dt=0.1),
    "static": lambda f: simulated(f, ub.Static(), dt=0.1),
    "adaptive": lambda f: simulated(f, ub.EnergyMomentum(), dt=ub.Adaptive(1e-2)),
    "recorded": lambda f: simulated(f, ub.EnergyMomentum(), dt=0.1, record=ub.History(sys.argv[1])),
    "stepped": stepped,
    "followed": followed,
}

for (function, make), (name, run) in itertools.product(FUNCTIONS.items(), RUNS.items()):
    try:
        outcome = repr(run(make()))
    except Exception as error:
        outcome = f"{type(error).__name__}: {error}"
    outcomes = COMM.gather(outcome)
    if RANK == 0:
        print(function, name, repr(outcomes), sep="|", flush=True)
if RANK == 0:
    # On its own a process may do what it likes
    end, scene = scene_of(lambda t: 1.0)
    ub.simulate(scene, ub.EnergyMomentum(), t=(0, 1), dt=0.1, comm=MPI.COMM_SELF)
    print("end", flush=True)
