# SPDX-License-Identifier: MIT
"""Random limits: their distribution, and that a seed decides them and nothing else."""

import math
from itertools import pairwise

from mpi4py import MPI

import numpy as np
import pytest
from scipy import stats

import ufl_beam as ub
from ufl_beam.discretization.dof_numbering import DofNumbering
from ufl_beam.discretization.partition import Subdomain

MEAN, DEVIATION, SEED = 250e6, 50e6, 7
MANY = 20_000
STEEL = {"E": 210e9, "nu": 0.3}
NORMALS = [ub.distributions.Normal, ub.distributions.TruncatedNormal, ub.distributions.Lognormal]
NORMAL = stats.norm(MEAN, DEVIATION)
LAWS = {
    # Cut at five deviations: what lies beyond is 3e-7 of all
    ub.distributions.Normal: NORMAL,
    ub.distributions.TruncatedNormal: NORMAL,
    ub.distributions.Weibull: stats.weibull_min(5.0, scale=MEAN),
    ub.distributions.Lognormal: stats.lognorm(
        math.sqrt(math.log(1.04)), scale=MEAN / math.sqrt(1.04)
    ),
}
each_law = pytest.mark.parametrize("kind", LAWS)


def made(kind, seed=SEED):
    return kind(MEAN, 5.0 if kind is ub.distributions.Weibull else DEVIATION, seed=seed)


@each_law
def test_samples_have_the_distribution(kind):
    """[closed] Four standard errors of mean and deviation, kurtosis up to 4 of the lognormal."""
    # The distribution by Kolmogorov and Smirnov's test: a chance of 1e-3 of a false alarm.
    values, law = made(kind).draw(MANY, (0, 0)), LAWS[kind]
    assert values.shape == (MANY,)
    assert abs(values.mean() - law.mean()) < 4 * law.std() / math.sqrt(MANY)
    assert abs(values.std() / law.std() - 1) < 4 * math.sqrt(3.0 / (4 * MANY))
    assert stats.kstest(values, law.cdf).pvalue > 1e-3


def test_scale_of_weibull():
    """[closed] A part exp(-1) exceeds it; three standard errors of a part."""
    part = (ub.distributions.Weibull(MEAN, 3.0, seed=1).draw(MANY, (0, 0)) > MEAN).mean()
    assert abs(part - math.exp(-1)) < 3 * math.sqrt(math.exp(-1) * (1 - math.exp(-1)) / MANY)


@pytest.mark.parametrize("kind", NORMALS)
def test_none_is_negative(kind):
    """With a scatter of twice the mean; the Normal gets zeros, the others none."""
    values = kind(1.0, 2.0, seed=1).draw(MANY, (0, 0))
    assert (values >= 0).all()
    # [closed] What lies below zero: Φ(-1/2) = 0.3085
    zeros = (values == 0).mean()
    assert zeros == (pytest.approx(0.3085, abs=0.01) if kind is ub.distributions.Normal else 0)


@each_law
def test_each_place_has_its_own_sample(kind):
    values = made(kind).draw(50, (1, 2))
    assert (values == made(kind).draw(50, (1, 2))).all()
    for other in ((2, 1), (1, 3), (0, 2)):
        assert not np.isclose(values, made(kind).draw(50, other)).any()
    assert not np.isclose(values, made(kind, SEED + 1).draw(50, (1, 2))).any()


def test_streams_are_independent():
    """Correlation of 500 pairs of streams of neighbouring cells: four standard errors."""
    normal = ub.distributions.Normal(10.0, 1.0, seed=0)
    values = np.array([normal.draw(1, (0, k))[0] for k in range(501)])
    correlation = np.corrcoef(values[1:], values[:-1])[0, 1]
    assert abs(correlation) < 4 / math.sqrt(500)


# -- in scenes ---------------------------------------------------------------------------------


def limits(beams, comm=MPI.COMM_SELF):
    """Limits of all fibres that a process has, by number of the cell."""
    subdomain = Subdomain(DofNumbering(ub.Scene(beams)), comm)
    section_points = beams[0].section.section_points(None)[0]
    drawn = section_points.parameters(subdomain.numbering.keys(subdomain.cells))["yield_limit"]
    return dict(zip(subdomain.cells.tolist(), drawn, strict=True))


def frame():
    law = ub.ElastoPlastic(ub.distributions.Lognormal(MEAN, DEVIATION, seed=SEED))
    section = ub.Section.rectangle(0.1, 0.2, **STEEL, fibres=ub.Fibres(law, number=6))
    return [
        ub.Beam((0, 0), (0, 1), section, cells=3, name="a"),
        ub.Beam((0, 1), (1, 1), section, cells=4, name="b"),
    ]


def test_fibres_draw_by_their_places():
    """All differ, also of two columns on one axis; other beams and processes change nothing."""
    a, b = frame()
    found = limits([a, b])
    assert len(np.unique(np.concatenate([*found.values()]))) == 7 * 6
    beside = limits([a, frame()[0]])
    assert len(np.unique(np.concatenate([*beside.values()]))) == 6 * 6
    for other in (limits([a]), beside, limits(frame())):
        assert all((other[cell] == found[cell]).all() for cell in range(3))
    everywhere = MPI.COMM_WORLD.allgather(limits(frame(), MPI.COMM_WORLD))
    assert sorted(cell for part in everywhere for cell in part) == list(range(7))
    assert all((row == found[cell]).all() for part in everywhere for cell, row in part.items())


def springs(order):
    """Three columns, whose feet are springs that yield at random limits."""
    section = ub.Section.rectangle(0.1, 0.2, **STEEL)
    law = ub.ElastoPlastic(ub.distributions.Normal(10e3, 2e3, seed=SEED), kinematic=1e5)
    columns = [ub.Beam((k, 0), (k, 1), section, cells=2) for k in range(3)]
    feet = [ub.Turn(ub.ground(*x.start.point), x.start, ub.Spring(1e6, law=law)) for x in columns]
    push = {"force": (12e3, 0.0), "amplitude": lambda t: t}
    return ub.Scene(
        [columns[k] for k in order],
        connectors=[feet[k] for k in order],
        loads=[ub.PointLoad(x.end, **push) for x in columns],
        supports=[ub.PrescribedDisplacement(x.start, u=0.0, v=0.0) for x in columns],
    ), feet


def test_springs_draw_by_their_places():
    """Neither the order nor the processes change the draws; each spring has its own."""
    found = []
    for order, comm in (((0, 1, 2), None), ((2, 0, 1), None), ((0, 1, 2), MPI.COMM_SELF)):
        scene, feet = springs(order)
        run = ub.simulate(scene, ub.Static(), t=(0, 1), dt=0.1, comm=comm)
        found.append([run.connector(foot).motion[-1] for foot in feet])
    for one, other in pairwise(found):
        np.testing.assert_allclose(one, other, rtol=0, atol=1e-9 * np.abs(found).max())
    assert np.diff(np.sort(found[0])).min() > 1e-3 * np.abs(found).max()


def test_resultants_may_be_random_too():
    law = ub.ElastoPlastic(ub.distributions.Weibull(10.0, 5.0, seed=2))
    section = ub.Section(EA=1.0, GA=1.0, EI=1.0, bending=law)
    limit = section.section_points(None)[0].parameters([(0, k) for k in range(50)])["yield_limit"]
    assert limit.shape == (50, 1)
    assert len(np.unique(limit)) == 50
