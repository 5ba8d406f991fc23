# SPDX-License-Identifier: MIT
"""Scenes of the same structure and other numbers: each to the last bit as if it were the first."""

from mpi4py import MPI

import numpy as np
import pytest
from random_scenes import SAMPLE, script
from scene_statements import AS_GIVEN, Statement
from scenes import rigid_chain

import ufl_beam as ub
from ufl_beam import caches
from ufl_beam.caches import cached_by_structure

OTHERS = (
    Statement("elsewhere", angle=0.7, center=(0.3, -0.2), shift=(5.0, 2.0)),
    Statement("in mm, t and ms", units=(1e-3, 1e3, 1e3)),
    Statement("other last digits", digits=1),
)
"""The same scenes with other coordinates, stiffnesses, masses, loads, laws, times and steps."""

pytestmark = pytest.mark.filterwarnings("ignore::ufl_beam.ModelWarning")


@pytest.fixture
def forgetful(monkeypatch):
    """`forgetful()`: from now on nothing is kept, as in a process that has built nothing yet."""
    return lambda: monkeypatch.setattr(caches, "LARGE", -1)


def run(seed, statement=AS_GIVEN):
    """All bits of the solution of a random scene, as far as it goes."""
    names = {}
    exec(script(seed, statement), names)
    arguments = {"t": names["times"], "dt": names["dt"], "mesh": names["mesh"]}
    try:
        solution = ub.simulate(names["scene"], names["scheme"], **arguments)
    except ub.ConvergenceError as error:
        solution = error.solution
    content = {**solution.history(), **solution.internal}
    return {name: (np.shape(x), np.asarray(x).tobytes()) for name, x in content.items()}


@pytest.mark.parametrize("seed", SAMPLE if MPI.COMM_WORLD.size == 1 else SAMPLE[::3])
def test_a_scene_after_others_of_its_structure(seed, forgetful):
    for statement in OTHERS:
        run(seed, statement)
    run(seed + 1)  # of another structure
    after_others = run(seed)
    forgetful()
    alone = run(seed)
    assert after_others == alone


# -- what is shared --------------------------------------------------------------------------------


def portal(stiffness=1e4, height=2.0, cells=4, hinge=None):
    """A portal whose beams are joined; alone on each process."""
    section = ub.Section(EA=stiffness, GA=stiffness, EI=100.0, rhoA=1.0, rhoI=1.0)
    left = ub.Beam((0, 0), (0, height), section, cells=cells, hinges=hinge or {})
    roof = ub.Beam((0, height), (3, height), section, cells=cells)
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
    # Places of the entries of cells, and of the mass matrix
    cells = [x.beams[0].loops[1][1] for x in (one, other)]
    assert cells[0].pattern == cells[1].pattern
    assert cells[0].has == cells[1].has
    first = [x.inertia.times(x.inertia._times).product.A.first for x in (one, other)]
    assert first[0] == first[1]
    with pytest.raises(ValueError, match="read-only"):
        one.equation.A.indices[0] = 1


@pytest.mark.parametrize(
    "change",
    [{"cells": 5}, {"hinge": {0.0: ub.Softening(limit=50.0, fracture_energy=10.0)}}],
    ids=repr,
)
def test_another_structure_has_another_pattern(change):
    one, other = portal(), portal(**change)
    assert one.equation.A.indices is not other.equation.A.indices
    assert one.equation.A.size != other.equation.A.size


def test_simulations_of_one_structure_do_not_disturb_each_other():
    law = ub.Softening(limit=50.0, fracture_energy=10.0)
    numbers = [{"stiffness": 1e4}, {"stiffness": 3e4, "height": 1.5}]
    alone = []
    for number in numbers:
        simulation = portal(hinge={0.0: law}, **number)
        for n in range(1, 31):
            simulation.step_to(0.02 * n)
        alone.append(simulation.q)
        simulation.close()
    together = [portal(hinge={0.0: law}, **number) for number in numbers]
    for n in range(1, 31):
        for simulation in together:
            simulation.step_to(0.02 * n)
    for simulation, q in zip(together, alone, strict=True):
        assert np.array_equal(simulation.q, q)


# -- the cache -------------------------------------------------------------------------------------


@pytest.fixture
def doubled():
    """A function of an array that counts its calls."""
    calls = []

    @cached_by_structure
    def double(number, array):
        calls.append(number)
        return (2 * array + number,)

    double.calls = calls
    return double


def test_the_same_arguments_give_the_same_arrays(doubled):
    (one,), (other,) = doubled(1, np.arange(3)), doubled(1, np.arange(3))
    assert one is other
    assert one.tolist() == [1, 3, 5]
    assert doubled.calls == [1]


@pytest.mark.parametrize(
    "other", [np.arange(1, 4), np.arange(3)[:, None], np.arange(3, dtype=np.int32)], ids=repr
)
def test_other_arguments_give_others(doubled, other):
    """Other numbers, another shape, another type."""
    (one,), (changed,) = doubled(0, np.arange(3)), doubled(0, other)
    assert np.array_equal(changed, 2 * other)
    assert changed.shape == other.shape
    assert changed.dtype == other.dtype
    assert one.tolist() == [0, 2, 4]


def test_a_changed_argument_changes_nothing_that_was_computed(doubled):
    array = np.arange(3)
    (one,) = doubled(0, array)
    array[0] = 7
    assert one.tolist() == [0, 2, 4]
    assert doubled(0, array)[0].tolist() == [14, 2, 4]


def test_large_structures_are_not_kept(doubled):
    large = np.zeros(caches.LARGE // 8 + 1, dtype=np.int64)
    (one,), (other,) = doubled(0, large), doubled(0, large)
    assert one is not other
    assert not one.flags.writeable
    (one,), (other,) = (doubled(caches.LARGE, np.arange(3)) for _ in range(2))
    assert one is not other  # what has so many numbers may be stated by a few
