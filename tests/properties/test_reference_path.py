# SPDX-License-Identifier: MIT
"""Random scenes: results of the reference solver, and tangents against differences.

The reference solver shares records, numbering, time schemes and mechanics with a run.  In scenes
beyond its scope, results are those of version 0.1.0, which are stored.
"""

from functools import partial

from mpi4py import MPI

import numpy as np
import pytest
import random_scenes
from elastic_scenes import DRAWS, STEP, STEPS, Built, draw
from helpers import raises
from scene_statements import made
from scenes import clamped
from stored_scenes import differences, numbers

import ufl_beam as ub

SCENES = [20, 199, 240, 367]
"""Random scenes in the scope of the reference solver."""

MANY = [
    *(6, 11, 12, 13, 16, 18, 27, 29, 31, 33, 34, 44, 46, 51, 53, 56, 61, 67, 68, 81, 82, 91, 93),
    *(110, 113, 165),
]
"""Random scenes that have, between them, every object, law and scheme of `random_scenes`."""

SAME = 1e-9
"""Difference as a part of the largest motion, force or energy: Newton's method stops at 1e-12 of
the forces, which conditions of the scenes magnify up to a thousand times in 15 steps."""

pytestmark = [
    pytest.mark.filterwarnings("ignore::ufl_beam.ModelWarning"),
    pytest.mark.skipif(MPI.COMM_WORLD.size > 1, reason="the reference solver has one process"),
]


def case(seed):
    """Scene, scheme, times, length of equal steps and mesh of a random scene."""
    names = made(random_scenes.script(seed))
    dt = (names["times"][1] - names["times"][0]) / random_scenes.STEPS
    return names["scene"], names["scheme"], names["times"], dt, names["mesh"]


def run(one, *, reference):
    """The solution of a scene, as far as it goes."""
    scene, scheme, times, dt, mesh = one
    newton = ub.Newton(rtol=1e-12, reference=reference)
    try:
        return ub.simulate(scene, scheme, t=times, dt=dt, mesh=mesh, newton=newton)
    except ub.ConvergenceError as error:
        return error.solution


def require_same(one):
    """All states have the motions, forces and energies of the reference solver."""
    solutions = [run(one, reference=reference) for reference in (False, True)]
    assert len(solutions[0]) == len(solutions[1])
    rows = range(1, len(solutions[0]))
    mine, others = (dict(sorted(numbers(one[0], x, rows).items())) for x in solutions)
    found = differences(mine, others)
    assert max(found.values()) < SAME, {k: v for k, v in found.items() if not v < SAME}


@pytest.mark.parametrize("seed", SCENES)
def test_random_scenes_have_the_results_of_the_reference(seed):
    require_same(case(seed))


@pytest.mark.parametrize("seed", DRAWS)
def test_random_trees_of_beams_have_the_results_of_the_reference(seed):
    scheme, one = ub.EnergyMomentum(0.05 * (seed % 2)), Built(draw(seed, dead=True)).scene
    require_same((one, scheme, (0.0, STEPS * STEP), STEP, None))


@pytest.mark.parametrize("seed", MANY)
def test_random_scenes_have_stored_results(seed, as_by_reference):
    as_by_reference(run(case(seed), reference=False), SAME)


def test_the_scenes_have_everything():
    """The seeds above leave out no name of the package that hundreds of scenes have."""
    many, all_of_them = (
        {word.split("(")[0] for n in seeds for word in random_scenes.script(n).split("ub.")[1:]}
        for seeds in (MANY, range(200))
    )
    assert many == all_of_them


@pytest.mark.parametrize("seed", MANY)
def test_tangents(seed):
    """Off equilibrium, after a step, the tangent is the derivative of the forces by all unknowns.

    Changes are too long at corners of laws or too short in stiff parts: the best of four counts.
    """
    scene, scheme, (t0, _), dt, mesh = case(seed)
    newton = ub.Newton(rtol=1e-12)
    simulation = ub.Simulation(scene, scheme, mesh=mesh, newton=newton, comm=MPI.COMM_SELF)
    equation, supports, numbering = simulation.equation, simulation.supports, simulation.numbering
    simulation.step_to(t0 + dt)
    random = np.random.default_rng(5)
    to = simulation.q + 1e-3 * scene.size * random.uniform(-1, 1, numbering.size)
    simulation.controllers.evaluate(simulation)
    equation.begin(ub.extend.Step.create(scheme, t0 + dt, t0 + 2 * dt, t0 + 2 * dt, simulation.q))
    x = supports.in_axes(to)
    free = np.setdiff1d(np.arange(len(x)), supports.dofs)

    def residual(x):
        r = equation.forces(supports.in_plane(x))
        supports.into_axes(r)
        return r[free]

    residual(x)  # rows of connectors are those of the latest residual
    for _ in range(2):  # the first tangent of a static step takes the forces before the step
        equation.tangent(supports.in_plane(x))
    K = equation.A.sparse().toarray()[np.ix_(free, free)]
    scales = numbering.scales[free]
    sizes = np.where(scales > 0, 1 / np.where(scales > 0, scales, 1.0), 1.0)
    worst = np.full(K.shape, np.inf)
    for part in (1e-5, 1e-6, 1e-7, 1e-8):
        for column, (i, size) in enumerate(zip(free, sizes, strict=True)):
            change = np.zeros(len(x))
            change[i] = part * size
            difference = (residual(x + change) - residual(x - change)) / (2 * part * size)
            apart = np.abs(K[:, column] - difference)
            worst[:, column] = np.minimum(worst[:, column], apart)
    simulation.close()
    # Differences have errors of part² and of 1e-16 / part, times 1e3 where scenes are stiff.
    assert (worst / np.abs(K).max(axis=1, keepdims=True)).max() < 1e-6


def softening():
    """A column whose cells may open, under a growing force at its top."""
    section = ub.Section(EA=1e6, GA=4e5, EI=800.0, hinge=ub.Softening(40.0, fracture_energy=15.0))
    beam = ub.Beam((0, 0), (0, 1), section, cells=3)
    push = ub.PointLoad(beam.end, force=(100.0, 0.0), amplitude=lambda t: t)
    return clamped(beam, loads=[push])


REFERENCE, CHECKPOINT = {"newton": ub.Newton(reference=True)}, ub.Checkpoint("run.h5", every=5)


@pytest.mark.parametrize(
    ("words", "call"),
    [
        ("adaptive steps", partial(ub.simulate, t=(0, 0.1), dt=ub.Adaptive(1e-3))),
        ("checkpoint", partial(ub.simulate, t=(0, 0.1), dt=0.01, checkpoint=CHECKPOINT)),
        ("Simulation", ub.Simulation),
        ("follow", lambda scene, _, **more: ub.follow(scene, ub.LoadControl(0.1), steps=1, **more)),
    ],
)
def test_what_it_does_not_compute(words, call):
    with raises("reference=True cannot be combined with", words):
        call(softening(), ub.EnergyMomentum(), **REFERENCE)


def test_a_step_without_equilibrium():
    """The solution so far comes with the error, as that of a run does."""
    with raises("no equilibrium after t = 0", kind=ub.ConvergenceError) as failure:
        ub.simulate(softening(), ub.Static(), t=(0, 1), dt=0.1, **REFERENCE)
    assert 0.39 < failure.value.solution.times[-1] <= 0.48 + 1e-9  # 40 N m over 1 m to 5/6 m
