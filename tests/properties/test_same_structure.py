# SPDX-License-Identifier: MIT
"""Scenes of the same structure and other numbers: each to the last bit as if it were the first."""

from mpi4py import MPI

import numpy as np
import pytest
from random_scenes import SAMPLE, script
from scene_statements import AS_GIVEN, Statement, made
from scenes import rigid_chain

import ufl_beam as ub
from ufl_beam import caches

OTHERS = (
    Statement("elsewhere", angle=0.7, center=(0.3, -0.2), shift=(5.0, 2.0)),
    Statement("in mm, t and ms", units=(1e-3, 1e3, 1e3)),
    Statement("other last digits", digits=1),
)
"""The same scenes with other coordinates, stiffnesses, masses, loads, laws, times and steps."""

pytestmark = pytest.mark.filterwarnings("ignore::ufl_beam.ModelWarning")


def run(seed, statement=AS_GIVEN):
    """All bits of the solution of a random scene, as far as it goes."""
    names = made(script(seed, statement))
    arguments = {"t": names["times"], "dt": names["dt"], "mesh": names["mesh"]}
    try:
        solution = ub.simulate(names["scene"], names["scheme"], **arguments)
    except ub.ConvergenceError as error:
        solution = error.solution
    content = {**solution.history(), **solution.internal}
    return {name: (np.shape(x), np.asarray(x).tobytes()) for name, x in content.items()}


@pytest.mark.parametrize("seed", SAMPLE if MPI.COMM_WORLD.size == 1 else SAMPLE[::3])
def test_a_scene_after_others_of_its_structure(seed, monkeypatch):
    for statement in OTHERS:
        run(seed, statement)
    run(seed + 1)  # of another structure
    after_others = run(seed)
    monkeypatch.setattr(caches, "LARGE", -1)  # nothing is kept, as in a new process
    assert after_others == run(seed)


def portal(stiffness=1e4, height=2.0, hinge=None):
    """A portal whose beams are joined; alone on each process."""
    section = ub.Section(EA=stiffness, GA=stiffness, EI=100.0, rhoA=1.0, rhoI=1.0)
    left = ub.Beam((0, 0), (0, height), section, cells=4, hinges=hinge or {})
    roof = ub.Beam((0, height), (3, height), section, cells=4)
    scene = rigid_chain(
        [left, roof],
        supports=[ub.Clamped(left.start), ub.Pinned(roof.end)],
        loads=[ub.PointLoad(roof.at(0.5), force=(3.0, -20.0))],
    )
    return ub.Simulation(scene, ub.EnergyMomentum(), comm=MPI.COMM_SELF)


def test_the_pattern_is_shared_by_scenes_of_one_structure():
    one, other = portal(), portal(stiffness=2e4, height=1.5)
    assert one.equation.A.indices is other.equation.A.indices
    assert one.equation.A.data is not other.equation.A.data
    with pytest.raises(ValueError, match="read-only"):
        one.equation.A.indices[0] = 1


def test_simulations_of_one_structure_do_not_disturb_each_other():
    hinge = {0.0: ub.Softening(limit=50.0, fracture_energy=10.0)}
    numbers = [{"stiffness": 1e4}, {"stiffness": 3e4, "height": 1.5}]

    def ends(simulations):
        for n in range(1, 31):
            for simulation in simulations:
                simulation.step_to(0.02 * n)
        return [simulation.q for simulation in simulations]

    alone = [ends([portal(hinge=hinge, **one)])[0] for one in numbers]
    together = ends([portal(hinge=hinge, **one) for one in numbers])
    assert np.array_equal(together, alone)
