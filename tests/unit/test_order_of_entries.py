# SPDX-License-Identifier: MIT
"""Entries of the ledger and columns of tables have the order of the scene on any processes."""

import math
from itertools import pairwise

from mpi4py import MPI

import pytest

import ufl_beam as ub

SCHEMES = [
    ub.EnergyMomentum(0.1, 0.1),
    ub.EnergyMomentumDecaying(),
    ub.Static(),
    ub.EnergyMomentumStatic(),
]


def chain():
    """Elastic beams, then yielding ones; each law of connectors is at one place only."""
    elastic = ub.Section(EA=1e4, GA=4e3, EI=1.0, rhoA=1.0, rhoI=1e-3)
    yielding = ub.Section(
        EA=1e4, GA=4e3, EI=1.0, rhoA=1.0, rhoI=1e-3, bending=ub.ElastoPlastic(0.05)
    )
    beams = [
        ub.Beam((i, 0), (i + 1, 0), elastic if i < 2 else yielding, cells=4, name=f"b{i}")
        for i in range(4)
    ]
    joints = [ub.Rigid(a.end, b.start) for a, b in pairwise(beams)]
    laws = [
        ub.Spring(2.0), ub.ForceLaw(lambda x, rate: x), ub.Damper(1.0),
        ub.RigidPlastic(ub.ElastoPlastic(0.1, isotropic=1.0)),
    ]  # fmt: skip
    connectors = [
        ub.Turn(ub.ground(*beam.end.point), beam.end, law)
        for beam, law in zip(beams, laws, strict=True)
    ]
    works = [
        ub.Potential("soil", lambda q, k: k * q[1] ** 2 / 2, numbers={"k": ub.ramp(1.0)},
                     beams=[beams[3]]),
        ub.VirtualWork("push", lambda w: 0.1 * w[1], beams=[beams[0]]),
    ]  # fmt: skip
    load = ub.PointLoad(beams[3].end, (0, 0.1), amplitude=lambda t: math.sin(9 * t))
    held = [ub.Clamped(beams[0].start)]
    return ub.Scene(
        beams, joints=joints, supports=held, loads=[load], connectors=connectors, works=works
    )


@pytest.mark.parametrize("scheme", SCHEMES, ids=lambda scheme: type(scheme).__name__)
def test_entries_have_the_order_of_one_process(scheme):
    def names(comm):
        simulation = ub.Simulation(chain(), scheme, comm=comm)
        before = [list(group) for group in simulation.entries()]
        simulation.step_to(0.02)
        after = [list(group) for group in simulation.entries()]
        simulation.close()
        assert after == before
        return after

    state, supplied, lost = names(MPI.COMM_SELF)
    assert len(state) >= 3
    assert len(supplied) >= 3
    assert len(lost) >= 4
    assert names(MPI.COMM_WORLD) == [state, supplied, lost]


def test_a_table_goes_on_on_other_processes(shared_path, on_first_rank):
    """A checkpoint with a table, written by the first process alone, then by all."""
    scene = chain()

    def run(end, name, comm=None):
        table = ub.History(shared_path / f"{name}.csv", [scene.beams[3].end])
        file = ub.Checkpoint(shared_path / f"{name}.checkpoint", every=2)
        more = {"record": table, "checkpoint": file, "comm": comm, "dt": 0.02}
        return ub.simulate(scene, ub.EnergyMomentum(), t=(0, end), **more)

    on_first_rank(lambda: run(0.04, "split", MPI.COMM_SELF) and None)
    run(0.08, "split")
    run(0.08, "whole")

    def rows(name):
        header, *lines = (shared_path / f"{name}.csv").read_text().splitlines()
        return header, [[float(x) for x in line.split(",")] for line in lines]

    (header, split), (same, whole) = on_first_rank(lambda: (rows("split"), rows("whole")))
    assert header == same
    assert len(split) == len(whole) == 5
    for one, other in zip(split, whole, strict=True):
        # [estimate] Sums in another order, and what Newton's tolerance makes of that.
        assert one == pytest.approx(other, rel=1e-6, abs=1e-9)
