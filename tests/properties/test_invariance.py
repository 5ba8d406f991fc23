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


def in_units(seed):
    """A statement in random units."""
    metre, kilogram, second = 10 ** np.random.default_rng(seed).uniform(-4, 4, 3)
    return Statement(units=(float(kilogram), float(metre), float(second)))


def static(seed, *, cut=(), **more):
    """A static run of a scene that cannot move without strain."""
    built = Built(draw(seed, fixed=True), cut=cut)
    return built.run(ub.Static(), steps=5, step=0.1, **more)


@each_draw
@pytest.mark.parametrize("scheme", SCHEMES, ids=str)
def test_results_do_not_depend_on_units(seed, scheme):
    """No number in the package has a dimension."""
    one, other = (Built(draw(seed), x).run(scheme) for x in (AS_GIVEN, in_units(1000 + seed)))
    assert difference(one, other) < SAME
    assert one.solution.iterations == other.solution.iterations
    assert one.solution.substeps == other.solution.substeps


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


@each_draw
def test_adaptive_steps_do_not_depend_on_the_statement(seed):
    """The steps themselves, by differences of accelerations, which have a few digits less."""

    def run(statement=AS_GIVEN, **more):
        return Built(draw(seed), statement).run(SCHEME, adaptive=ub.Adaptive(1e-4), **more)

    one, axes = run(), Statement(angle=1.0)
    for other in (run(in_units(6000 + seed)), run(axes), run(comm=MPI.COMM_SELF)):
        times = other.solution.times / other.statement.unit("s")
        np.testing.assert_allclose(times, one.solution.times, rtol=1e-6)
        assert difference(one, other) < 1e-6


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
