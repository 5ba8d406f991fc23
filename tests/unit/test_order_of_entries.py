# SPDX-License-Identifier: MIT
"""Entries of the ledger and columns of tables have the order of the scene on any processes."""

import math
from itertools import pairwise

from mpi4py import MPI

import pytest

import ufl_beam as ub

SCHEMES = [ub.EnergyMomentum(0.1, 0.1), ub.EnergyMomentumDecaying(), ub.EnergyMomentumStatic()]


def chain():
    """Elastic beams, then yielding ones; each law of connectors is at one place only."""
    stiffness = {"EA": 1e4, "GA": 4e3, "EI": 1.0, "rhoA": 1.0, "rhoI": 1e-3}
    elastic = ub.Section(**stiffness)
    yielding = ub.Section(**stiffness, bending=ub.ElastoPlastic(0.05))
    beams = [
        ub.Beam((i, 0), (i + 1, 0), section, cells=4, name=f"b{i}")
        for i, section in enumerate((elastic, elastic, yielding, yielding))
    ]
    laws = [
        ub.Spring(2.0), ub.ForceLaw(lambda x, rate: x), ub.Damper(1.0),
        ub.RigidPlastic(ub.ElastoPlastic(0.1, isotropic=1.0)),
    ]  # fmt: skip
    works = [
        ub.Potential("soil", lambda q, k: k * q[1] ** 2 / 2, numbers={"k": ub.ramp(1.0)},
                     beams=[beams[3]]),
        ub.VirtualWork("push", lambda w: 0.1 * w[1], beams=[beams[0]]),
    ]  # fmt: skip
    return ub.Scene(
        beams,
        joints=[ub.Rigid(a.end, b.start) for a, b in pairwise(beams)],
        supports=[ub.Clamped(beams[0].start)],
        loads=[ub.PointLoad(beams[3].end, (0, 0.1), amplitude=lambda t: math.sin(9 * t))],
        connectors=[
            ub.Turn(ub.ground(*beam.end.point), beam.end, law)
            for beam, law in zip(beams, laws, strict=True)
        ],
        works=works,
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

    alone = names(MPI.COMM_SELF)
    assert all(len(group) >= least for group, least in zip(alone, (3, 3, 4), strict=True))
    assert names(MPI.COMM_WORLD) == alone
