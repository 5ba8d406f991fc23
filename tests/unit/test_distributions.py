# SPDX-License-Identifier: MIT
"""Random limits: their moments, and that a seed decides them and nothing else."""

import math

from mpi4py import MPI

import numpy as np
import pytest
from scipy import stats

import ufl_beam as ub
from ufl_beam.discretization.dof_numbering import DofNumbering
from ufl_beam.discretization.partition import Subdomain

MEAN, DEVIATION, SEED = 250e6, 50e6, 7
NORMALS = [ub.distributions.Normal, ub.distributions.TruncatedNormal, ub.distributions.Lognormal]
ALL = [
    *(kind(MEAN, DEVIATION, seed=SEED) for kind in NORMALS),
    ub.distributions.Weibull(MEAN, 5.0, seed=SEED),
]
MANY = 20_000


def sample(distribution, n=MANY, key=(0, 0)):
    return distribution.draw(n, key)


# -- moments -----------------------------------------------------------------------------------


def expected(distribution):
    """[closed] Mean and deviation."""
    if isinstance(distribution, ub.distributions.Weibull):
        one, two = (math.gamma(1 + k / distribution.shape) for k in (1, 2))
        return MEAN * one, MEAN * math.sqrt(two - one**2)
    if type(distribution) is ub.distributions.TruncatedNormal:
        # Cut at five deviations: what lies beyond is 3e-7 of all
        β = MEAN / DEVIATION
        λ = stats.norm.pdf(β) / stats.norm.cdf(β)
        return MEAN + DEVIATION * λ, DEVIATION * math.sqrt(1 - λ * (β + λ))
    return MEAN, DEVIATION


@pytest.mark.parametrize("distribution", ALL, ids=lambda d: type(d).__name__)
def test_samples_have_the_mean_and_deviation(distribution):
    """Four standard errors of the mean, and as many of the deviation of a normal distribution."""
    values, (mean, deviation) = sample(distribution), expected(distribution)
    assert values.shape == (MANY,)
    assert abs(values.mean() - mean) < 4 * deviation / math.sqrt(MANY)
    # The error of a deviation, kurtosis up to 4 (that of the lognormal here) instead of 3
    assert abs(values.std() / deviation - 1) < 4 * math.sqrt(3.0 / (4 * MANY))


@pytest.mark.parametrize("distribution", ALL, ids=lambda d: type(d).__name__)
def test_samples_have_the_distribution(distribution):
    """The distribution of Kolmogorov and Smirnov's test: a chance of 1e-3 of a false alarm."""
    law = {
        ub.distributions.Normal: stats.norm(MEAN, DEVIATION),
        ub.distributions.TruncatedNormal: stats.norm(MEAN, DEVIATION),
        ub.distributions.Weibull: stats.weibull_min(5.0, scale=MEAN),
        ub.distributions.Lognormal: stats.lognorm(
            math.sqrt(math.log(1.04)), scale=MEAN / math.sqrt(1.04)
        ),
    }[type(distribution)]  # fmt: skip
    assert stats.kstest(sample(distribution), law.cdf).pvalue > 1e-3


def test_scale_of_weibull():
    """[closed] A part exp(-1) exceeds it; three standard errors of a part."""
    part = (sample(ub.distributions.Weibull(MEAN, 3.0, seed=1)) > MEAN).mean()
    assert abs(part - math.exp(-1)) < 3 * math.sqrt(math.exp(-1) * (1 - math.exp(-1)) / MANY)


@pytest.mark.parametrize("kind", NORMALS)
def test_none_is_negative(kind):
    """With a scatter of twice the mean; the Normal gets zeros, the others none."""
    values = sample(kind(1.0, 2.0, seed=1))
    assert (values >= 0).all()
    # [closed] What lies below zero: Φ(-1/2) = 0.3085
    zeros = (values == 0).mean()
    assert zeros == (pytest.approx(0.3085, abs=0.01) if kind is ub.distributions.Normal else 0)


# -- seeds and streams -------------------------------------------------------------------------


@pytest.mark.parametrize("distribution", ALL, ids=lambda d: type(d).__name__)
def test_each_place_has_its_own_sample(distribution):
    values = sample(distribution, 50, (1, 2))
    assert (values == sample(distribution, 50, (1, 2))).all()
    for other in ((2, 1), (1, 3), (0, 2)):
        assert not np.isclose(values, sample(distribution, 50, other)).any()
    reseeded = type(distribution)(
        *(getattr(distribution, n) for n in distribution.__match_args__), seed=SEED + 1
    )
    assert not np.isclose(values, sample(reseeded, 50, (1, 2))).any()


def test_streams_are_independent():
    """Correlation of 2000 pairs of streams of neighbouring cells: four standard errors."""
    normal = ub.distributions.Normal(10.0, 1.0, seed=0)
    values = np.array([normal.draw(1, (0, k))[0] for k in range(2001)])
    correlation = np.corrcoef(values[1:], values[:-1])[0, 1]
    assert abs(correlation) < 4 / math.sqrt(2000)


# -- in scenes ---------------------------------------------------------------------------------

LAW = ub.ElastoPlastic(ub.distributions.Lognormal(MEAN, DEVIATION, seed=SEED))


def limits(beams, comm=MPI.COMM_SELF, joints=()):
    """Limits of all fibres that a process has, by number of the cell."""
    scene = ub.Scene(beams, joints=joints)
    subdomain = Subdomain(DofNumbering(scene), comm)
    section_points = beams[0].section.section_points(None)[0]
    drawn = section_points.parameters(subdomain.numbering.keys(subdomain.cells))["yield_limit"]
    return dict(zip(subdomain.cells.tolist(), drawn, strict=True))


def frame():
    section = ub.Section.rectangle(
        0.1, 0.2, E=210e9, nu=0.3, fibres=ub.Fibres(LAW, number=6)
    )  # fmt: skip
    return [
        ub.Beam((0, 0), (0, 1), section, cells=3, name="a"),
        ub.Beam((0, 1), (1, 1), section, cells=4, name="b"),
    ]


def test_cells_and_beams_differ():
    values = np.concatenate(list(limits(frame()).values()))
    assert len(values) == 7 * 6
    assert len(np.unique(values)) == 7 * 6
    assert (values > 0).all()


def test_a_scene_has_the_same_limits_again():
    one, other = limits(frame()), limits(frame())
    assert all((one[cell] == other[cell]).all() for cell in range(7))


def test_beams_between_the_same_points_differ():
    """Two columns side by side, drawn on one axis, do not break at the same load."""
    a, same = frame()[0], frame()[0]
    values = limits([a, same])
    assert len(np.unique(np.concatenate(list(values.values())))) == 6 * 6
    alone = limits([a])
    assert all((alone[cell] == values[cell]).all() for cell in range(3))


def springs(order):
    """Moments at the feet of three columns, whose springs yield at random limits."""
    section = ub.Section.rectangle(0.1, 0.2, E=210e9, nu=0.3)
    feet, tops, scenes = [], [], []
    for k in range(3):
        column = ub.Beam((k, 0), (k, 1), section, cells=2)
        law = ub.ElastoPlastic(ub.distributions.Normal(10e3, 2e3, seed=SEED), kinematic=1e5)
        feet.append(ub.Turn(ub.ground(k, 0), column.start, ub.Spring(1e6, law=law)))
        tops.append(ub.PointLoad(column.end, force=(12e3, 0.0), amplitude=lambda t: t))
        scenes.append(column)
    return ub.Scene(
        [scenes[k] for k in order], connectors=[feet[k] for k in order], loads=tops,
        supports=[ub.PrescribedDisplacement(x.start, u=0.0, v=0.0) for x in scenes],
    ), feet  # fmt: skip


def test_springs_draw_by_their_places():
    """Neither the order nor the processes change the draws; each spring has its own."""
    found = []
    for order, options in (
        ((0, 1, 2), {}), ((2, 0, 1), {}), ((0, 1, 2), {"comm": MPI.COMM_SELF}),
    ):  # fmt: skip
        scene, feet = springs(order)
        run = ub.simulate(scene, ub.Static(), t=(0, 1), dt=0.1, **options)
        found.append([run.connector(foot).motion[-1] for foot in feet])
    assert np.ptp(found, axis=0).max() < 1e-9 * np.abs(found).max()
    assert np.diff(np.sort(found[0])).min() > 1e-3 * np.abs(found).max()


def test_other_beams_change_nothing():
    """A beam draws for itself: what comes after it, and how it is meshed, does not matter."""
    a, b = frame()
    alone, together = limits([a]), limits([a, b])
    assert all((alone[cell] == together[cell]).all() for cell in range(3))


def test_number_of_processes_does_not_matter():
    here, all_cells = limits(frame(), MPI.COMM_WORLD), limits(frame())
    everywhere = MPI.COMM_WORLD.allgather(here)
    assert sorted(cell for part in everywhere for cell in part) == list(range(7))
    assert all((row == all_cells[cell]).all() for part in everywhere for cell, row in part.items())


def test_resultants_may_be_random_too():
    section = ub.Section(
        EA=1.0,
        GA=1.0,
        EI=1.0,
        bending=ub.ElastoPlastic(ub.distributions.Weibull(10.0, 5.0, seed=2)),
    )
    limit = section.section_points(None)[0].parameters([(0, k) for k in range(50)])["yield_limit"]
    assert limit.shape == (50, 1)
    assert len(np.unique(limit)) == 50
