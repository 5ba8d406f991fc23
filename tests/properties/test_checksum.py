# SPDX-License-Identifier: MIT
"""One scene of everything gives one result on any number of processes."""

import numpy as np
from restart_scenes import machine

import ufl_beam as ub

CHECKSUMS = {"q": "17.8171995", "energy": "0.55483344", "links": "0.495422002"}
"""Of a run on one process, to nine digits; the same on two and three.  The run begins with an
impact, because a support begins to move at 0.1 m/s."""


def test_results_have_their_digits_on_any_number_of_processes():
    run = ub.simulate(machine(), ub.EnergyMomentum(0.05), t=(0, 0.3), dt=0.005)
    assert run.energy.worst < 1e-9
    for name, numbers in (
        ("q", run.q[-1]),
        ("energy", [entry[-1] for entry in run.energy.lost.values()]),
        ("links", [run.connector(connector).work[-1] for connector in run.scene.connectors]),
    ):
        size = np.linalg.norm(np.sort(np.abs(numbers)))
        assert f"{size:.9g}" == CHECKSUMS[name], name
