# SPDX-License-Identifier: MIT
"""A run that goes on after it was killed; prints the checksum of all that it computes and writes.

python3 script_of_kills.py DIRECTORY STEPS EVERY: steps of the run, and between its checkpoints.
"""

import hashlib
import sys
from dataclasses import replace
from pathlib import Path

import numpy as np

import ufl_beam as ub

directory, steps, every = Path(sys.argv[1]), *map(int, sys.argv[2:])
elastic = ub.Section(EA=1e6, GA=1e6, EI=1e2, rhoA=1.0, rhoI=1e-3)
yielding = replace(elastic, bending=ub.ElastoPlastic(yield_limit=25.0, isotropic=10.0))
a = ub.Beam((0, 0), (1, 0), yielding, cells=4)
b = ub.Beam((1, 0), (2, 0), elastic, cells=4)
body = ub.Body((2, 0), mass=1.0, inertia=0.01)


class Integral:
    """A controller that remembers."""

    def __init__(self):
        self.sum = 0.0

    def __call__(self, simulation):
        self.sum += simulation.displacement(b.end)[2]
        return -0.01 * self.sum

    def state(self):
        return self.sum

    def restore(self, state):
        self.sum = state


scene = ub.Scene(
    [a, b],
    bodies=[body],
    joints=[ub.Revolute(a.end, b.start), ub.Rigid(b.end, body.middle)],
    supports=[ub.Clamped(a.start)],
    loads=[ub.PointLoad(b.end, force=(0, -60.0), amplitude=ub.Table([0, 0.1, 0.2], [0, 1, 0]))],
    connectors=[
        ub.Turn(a.end, b.start, ub.Coulomb(0.5)),
        ub.Turn(ub.ground(3, 3), body.middle, ub.Controller(Integral())),
    ],
)
solution = ub.simulate(
    *(scene, ub.EnergyMomentum(0.01, 0.01)),
    t=(0, steps * 1e-3),
    dt=1e-3,
    every=50,
    record=ub.History(directory / "run.csv", [b.end]),
    checkpoint=ub.Checkpoint(directory / "run.h5", every=every),
)
total = hashlib.sha256((directory / "run.csv").read_bytes())
energy = solution.energy
for values in (solution.q, solution.v, solution.times, energy.total, energy.imbalance):
    total.update(np.ascontiguousarray(values).tobytes())
print(f"stepped for {solution.seconds:.3f} s, checksum {total.hexdigest()}", flush=True)
