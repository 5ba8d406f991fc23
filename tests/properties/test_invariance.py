# SPDX-License-Identifier: MIT
"""One elastic scene stated in two ways gives one result: units, axes, cuts, processes."""

from mpi4py import MPI

import numpy as np
import pytest
from elastic_scenes import DRAWS, Built, Units, difference, draw

import ufl_beam as ub

SAME = 1e-9
"""Part of the result.  Each step is solved to 1e-10 of the forces, by a method that squares its
error and so mostly ends at round-off; 15 steps let that grow a little."""

SCHEMES = [ub.EnergyMomentum(), ub.EnergyMomentum(0.05, 0.05)]
SCHEME = SCHEMES[1]
"""The one with all terms."""

pytestmark = pytest.mark.parametrize("seed", DRAWS)


@pytest.mark.parametrize("scheme", SCHEMES, ids=str)
def test_results_do_not_depend_on_units(seed, scheme):
    """No number in the package has a dimension."""
    numbers = draw(seed)
    random = np.random.default_rng(1000 + seed)
    units = Units(*(float(x) for x in 10 ** random.uniform(-4, 4, 3)))
    one, other = Built(numbers).run(scheme), Built(numbers, units=units).run(scheme)
    assert difference(one, other) < SAME
    assert one.solution.iterations == other.solution.iterations
    assert one.solution.substeps == other.solution.substeps


def test_static_results_do_not_depend_on_units(seed):
    numbers = draw(seed, fixed=True)
    random = np.random.default_rng(2000 + seed)
    units = Units(*(float(x) for x in 10 ** random.uniform(-4, 4, 3)))
    one, other = (
        Built(numbers, units=u).run(ub.Static(), steps=5, step=0.1) for u in (Units(), units)
    )
    assert difference(one, other) < SAME
    assert one.solution.substeps == other.solution.substeps
    if one.solution.substeps <= 6:  # else iterations wandered before a step was cut
        # Before the least number of iterations a residual must be below 1e-14 of the forces: of a
        # step in which next to nothing changes, its last digits decide.
        assert abs(one.solution.iterations - other.solution.iterations) <= 1


def test_results_turn_with_the_axes(seed):
    """Objectivity: the whole scene turned by any angle."""
    numbers = draw(seed)
    angle = float(np.random.default_rng(3000 + seed).uniform(-np.pi, np.pi))
    one, other = Built(numbers).run(SCHEME), Built(numbers, angle=angle).run(SCHEME)
    assert difference(one, other) < SAME


def test_static_results_turn_with_the_axes(seed):
    numbers = draw(seed, fixed=True)
    angle = float(np.random.default_rng(4000 + seed).uniform(-np.pi, np.pi))
    one, other = (Built(numbers, angle=a).run(ub.Static(), steps=5, step=0.1) for a in (0.0, angle))
    assert difference(one, other) < SAME


def test_a_beam_cut_in_two_is_the_same_beam(seed):
    """A beam cut in two by a rigid joint is the same beam."""
    numbers = draw(seed)
    one = Built(numbers).run(SCHEME)
    other = Built(numbers, cut=range(len(numbers.beams))).run(SCHEME)
    assert len(other.scene.beams) == 2 * len(one.scene.beams)
    assert other.solution.numbering.size == one.solution.numbering.size
    assert difference(one, other) < SAME


def test_in_statics_a_beam_cut_in_two_is_the_same_beam(seed):
    numbers = draw(seed, fixed=True)
    one = Built(numbers).run(ub.Static(), steps=5, step=0.1)
    other = Built(numbers, cut=[0]).run(ub.Static(), steps=5, step=0.1)
    assert difference(one, other) < SAME


def test_processes_find_the_result_of_one(seed):
    """The number of processes: against each process alone.  On one rank: a run can be repeated."""
    numbers = draw(seed)
    for scheme in SCHEMES:
        one = Built(numbers).run(scheme)
        other = Built(numbers).run(scheme, comm=MPI.COMM_SELF)
        assert difference(one, other) < SAME
        # On all ranks alike
        everywhere = MPI.COMM_WORLD.allgather(one.motion().tobytes())
        assert len(set(everywhere)) == 1
        if MPI.COMM_WORLD.size == 1:
            assert (one.motion() == other.motion()).all()


def test_in_statics_processes_find_the_result_of_one(seed):
    numbers = draw(seed, fixed=True)
    one, other = (
        Built(numbers).run(ub.Static(), steps=5, step=0.1, comm=comm)
        for comm in (MPI.COMM_WORLD, MPI.COMM_SELF)
    )
    assert difference(one, other) < SAME


def test_scenes_move_by_a_part_of_their_size(seed):
    """The scenes are no trivial ones: they move by a good part of their size, and turn."""
    motion = Built(draw(seed)).run(ub.EnergyMomentum()).motion()
    assert np.abs(motion).max() > 1e-3


def run_adaptive(built, **more):
    built.solution = ub.simulate(
        built.scene, SCHEME, t=(0.0, 0.3 * built.units.second), dt=ub.Adaptive(1e-4), **more
    )
    return built


def test_adaptive_steps_do_not_depend_on_the_statement(seed):
    """The steps themselves, in other units, turned, on other numbers of processes.

    Their lengths come from differences of accelerations, which have a few digits less.
    """
    numbers = draw(seed)
    random = np.random.default_rng(6000 + seed)
    units = Units(*(float(x) for x in 10 ** random.uniform(-4, 4, 3)))
    one = run_adaptive(Built(numbers))
    for other in (
        run_adaptive(Built(numbers, units=units)),
        run_adaptive(Built(numbers, angle=1.0)),
        run_adaptive(Built(numbers), comm=MPI.COMM_SELF),
    ):
        times = other.solution.times / other.units.second
        np.testing.assert_allclose(times, one.solution.times, rtol=1e-6)
        assert difference(one, other) < 1e-6
