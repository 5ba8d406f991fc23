# SPDX-License-Identifier: MIT
"""One elastic scene stated in two ways gives one result: units, axes, cuts, processes."""

from dataclasses import replace

from mpi4py import MPI

import numpy as np
import pytest
from elastic_scenes import DRAWS, Built, difference, draw, require_same_on_processes
from scene_statements import AS_GIVEN, Statement

import ufl_beam as ub

SAME = 1e-9
"""Part of the result.  Each step is solved to 1e-10 of the forces, by a method that squares its
error and so mostly ends at round-off; 15 steps let that grow a little."""

SCHEMES = [ub.EnergyMomentum(), ub.EnergyMomentum(0.05, 0.05)]
SCHEME = SCHEMES[1]
"""The one with all terms."""

each_draw = pytest.mark.parametrize("seed", DRAWS)


def static(seed, *, cut=(), **more):
    """A static run of a scene that cannot move without strain."""
    built = Built(draw(seed, fixed=True), cut=cut)
    return built.run(ub.Static(), steps=5, step=0.1, **more)


@each_draw
def test_a_beam_cut_in_two_is_the_same_beam(seed):
    """A beam cut in two by a rigid joint is the same beam."""
    one, other = (Built(draw(seed), cut=cut).run(SCHEME) for cut in ((), range(4)))
    assert len(other.scene.beams) == 2 * len(one.scene.beams)
    assert other.solution.numbering.size == one.solution.numbering.size
    assert difference(one, other) < SAME
    assert difference(static(seed), static(seed, cut=[0])) < SAME


@each_draw
@pytest.mark.parametrize("scheme", SCHEMES, ids=str)
def test_processes_find_the_result_of_one(seed, scheme):
    """The number of processes: against each process alone.  On one rank: a run can be repeated."""
    require_same_on_processes(lambda comm: Built(draw(seed)).run(scheme, comm=comm), SAME)
    assert difference(static(seed), static(seed, comm=MPI.COMM_SELF)) < SAME


@pytest.mark.filterwarnings("ignore:modes. loads have no effect")  # of parts that fall
@pytest.mark.parametrize("damping", [(), (ub.Rayleigh(mass=0.3, stiffness=1e-3),)])
@pytest.mark.parametrize("seed", range(0, 36, 3))
def test_modes_do_not_depend_on_units_and_axes(seed, damping):
    """Tolerance: round-off 1e-16 times the ratio of the highest squared frequency to the lowest."""

    def exponents(statement):
        scene = Built(draw(seed, free=seed % 2 == 0), statement).scene
        return ub.modes(replace(scene, damping=damping), 8).exponents

    plain = exponents(AS_GIVEN)
    assert len(plain) == 8
    for way in (Statement(angle=0.7), Statement(units=(10.0, 1e3, 1.0))):
        np.testing.assert_allclose(exponents(way), plain, rtol=1e-8, atol=1e-12)
