# SPDX-License-Identifier: MIT
"""A scene of all that remembers something, and a run of it that can be killed and run again.

``python3 restart_scenes.py FOLDER`` runs or goes on, and writes the solution at the end.
"""

import sys
from pathlib import Path

import numpy as np
import ufl

import ufl_beam as ub


class Steering:
    """A controller that remembers the sum of what it saw."""

    def __init__(self, place):
        self.place, self.sum = place, 0.0

    def state(self):
        return {"sum": self.sum}

    def restore(self, state):
        self.sum = state["sum"]

    def __call__(self, now):
        turn = now.displacement(self.place)[2]
        self.sum += turn
        return -0.3 * turn - 0.01 * self.sum


def machine(dynamic=True):
    """Beams that yield, creep and break, fibres, bodies, joints, every law, loads, supports."""
    steel = {"EA": 1e5, "GA": 1e5, "EI": 40.0, "rhoA": 0.5, "rhoI": 0.01}
    creep = ub.ElastoPlastic(yield_limit=0.5, kinematic=3.0, viscosity=ub.Perzyna(0.05))
    hinged = ub.Section(**steel, bending=creep)
    law = ub.ElastoPlastic(ub.distributions.TruncatedNormal(1e5, 2e4, seed=7))
    fibres = ub.Section.rectangle(
        b=0.02, h=0.05, E=1e8, nu=0.3, rho=500.0, fibres=ub.Fibres(law, number=6)
    )
    a = ub.Body((0, 0), mass=2.0, inertia=0.3, name="a")
    b = ub.Body((1, 0), mass=1.0, inertia=0.1, name="b")
    c = ub.Body((2, 0.2), mass=1.0, inertia=0.2, name="c")
    soft = ub.Softening(0.6, 0.02)
    right = ub.Beam((2.5, 0.2), (3.5, 0.2), hinged, cells=4, hinges={0.1: soft}, name="right")
    left = ub.Beam((-2, 0), (-0.5, 0), fibres, cells=5, name="left")
    pin = ub.Revolute(left.end, a.at(-0.5, 0), multipliers=True)
    joints = [
        ub.Prismatic(a.at(0.3, 0), b.middle, axis=(1, 0.3)),
        ub.Revolute(b.at(1.5, 0.1), c.at(1.5, 0.1)),
        ub.Rigid(c.at(2.5, 0.2), right.start),
        pin,
        ub.Guided(right.end, lambda s: (3.5 + s, 0.2 + 0.3 * ufl.sin(s))),
    ]
    random = np.random.default_rng(3)
    yields = ub.Spring(20.0, ub.ElastoPlastic(yield_limit=0.2, kinematic=2.0))
    connectors = [
        ub.Slide(a.middle, b.middle, yields),
        ub.Turn(b.middle, c.middle, ub.Spring(5.0)),
        ub.Turn(a.middle, left.end, ub.Damper(0.2)),
        ub.Stretch(left.at(0.4), right.at(0.5), ub.Stop(50.0, high=0.2)),
        ub.Turn(left.end, a.middle, ub.Coulomb(0.02, coefficient=0.005, joint=pin)),
        ub.Slide(ub.ground(0, 0), a.middle, ub.ForceLaw(lambda e, rate: 10 * e), axis=(0, 1)),
        ub.Turn(ub.ground(0, 0), c.middle, ub.Controller(Steering(left.end))),
        ub.Turn(ub.ground(0, 0), b.middle, ub.Controller(lambda now: 0.01 * random.normal())),
    ]
    loads = [
        ub.Gravity(amplitude=ub.ramp(0.1)),
        ub.PointLoad(c.at(2.5, 0.5), force=(3, 2), moment=1.0, amplitude=ub.ramp(0.1)),
        ub.FollowerLoad(left.at(0.5), force=(1.0, 0.3), amplitude=ub.ramp(0.2)),
    ]
    shaken = ub.PrescribedDisplacement(left.start, u=lambda t: 0.1 * t, v=0.0)
    damping = [ub.KelvinVoigt(1e-4), *([ub.Rayleigh(mass=0.1)] if dynamic else [])]
    return ub.Scene(
        [right, left], joints=joints, connectors=connectors, bodies=[a, b, c], loads=loads,
        supports=[shaken], damping=damping,
    )  # fmt: skip


def bend(kind="hinge"):
    """A cantilever whose end goes up and down: statics of what yields and breaks."""
    yields = ub.ElastoPlastic(yield_limit=5.0, isotropic=10.0, kinematic=5.0)
    section = ub.Section(EA=1e4, GA=1e4, EI=50.0, rhoA=1.0, rhoI=0.1, bending=yields)
    hinges = {0.05: ub.Softening(6.0, 1.5) if kind == "hinge" else None}
    beam = ub.Beam((0, 0), (1, 0), section, cells=6, hinges=hinges)
    wave = ub.Table([0, 1, 3, 5], [0, 0.15, -0.15, 0.2])
    spring = ub.Spring(3.0, ub.ElastoPlastic(0.2, 1.0))
    return ub.Scene(
        [beam],
        supports=[ub.Clamped(beam.start), ub.PrescribedDisplacement(beam.end, v=wave)],
        loads=[ub.FollowerLoad(beam.at(0.5), force=(-1.0, 0.5), amplitude=wave)],
        connectors=[ub.Stretch(ub.ground(1, 1), beam.end, spring)],
    )


def arrays_of(solution):
    """All that a solution kept, and what it counted, by name."""
    counts = {"substeps": np.array(solution.substeps), "iterations": np.array(solution.iterations)}
    return {**solution.history(), **counts, **{f"end {n}": x for n, x in solution.internal.items()}}


def run(folder):
    """Go on, or begin; with files."""
    scene = machine()
    beam = scene.beams[0]
    files = [
        ub.History(folder / "run.csv", [beam.end], scene.connectors),
        ub.History(folder / "few.csv", [beam.end], max_rows=10),
        ub.XDMF(folder / "run.xdmf", every=7),
        ub.VTKHDF(folder / "run.vtkhdf", every=5),
    ]
    more = {"record": files, "checkpoint": ub.Checkpoint(folder / "run.checkpoint", every=2)}
    return ub.simulate(scene, ub.EnergyMomentum(0.05, 0.02), t=(0, 0.3), dt=0.005, every=3, **more)


if __name__ == "__main__":
    np.savez(Path(sys.argv[1]) / "end.npz", **arrays_of(run(Path(sys.argv[1]))))
