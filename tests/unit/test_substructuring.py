# SPDX-License-Identifier: MIT
"""Dense fronts and their Schur complements against dense solutions; the parts of processes."""

from mpi4py import MPI

import numpy as np
import pytest
from scipy.sparse import csr_array, eye_array, kron, random_array

import ufl_beam as ub
from ufl_beam.arrays import Array
from ufl_beam.compiled.csr import Csr
from ufl_beam.discretization.partition import bisect
from ufl_beam.solvers.multifrontal import Multifrontal
from ufl_beam.solvers.substructuring import Summed


class Whole:
    """A system of which nothing is eliminated."""

    def __init__(self, matrix, numbers):
        matrix = csr_array(matrix)
        matrix.sort_indices()
        self.left = Csr(matrix.data.copy(), matrix.indices, matrix.indptr)
        self.dofs, self.f = numbers, np.zeros(matrix.shape[0])
        self.good = True

    def factor(self, b):
        self.reduce(b)
        return self.good

    def reduce(self, b):
        self.f[:] = b

    def expand(self, small, x):
        x[:] = small


def dense(A):
    return csr_array((A.data, A.indices, A.indptr), shape=[A.size] * 2).toarray()


def solve(condensed, b, again=False) -> Array:
    """Solution by a dense one of what is left."""
    x = np.empty(len(b))
    if again:
        condensed.reduce(b)
    else:
        assert condensed.factor(b)
    condensed.expand(np.linalg.solve(dense(condensed.left), condensed.f), x)
    return x


def matrix_of(name, n, seed=0):
    """An unsymmetric matrix with a symmetric pattern, whose entries are at random."""
    random = np.random.default_rng(seed)
    chain = eye_array(n, k=1) + eye_array(n, k=-1)
    side = round(n**0.5)
    line = eye_array(side, k=1) + eye_array(side, k=-1)
    scattered = random_array((n, n), density=min(1.0, 3 / n), rng=random)
    pattern = {
        "nothing coupled": csr_array((n, n)),
        "a chain": chain,
        "a square": kron(line, eye_array(side)) + kron(eye_array(side), line),
        "at random": scattered + scattered.T,
        "all coupled": csr_array(np.ones((n, n))),
    }[name]
    pattern = csr_array(pattern + eye_array(n))
    blocks = csr_array(kron(pattern, np.ones((2, 2))))
    blocks.data[:] = random.uniform(-1, 1, blocks.nnz)
    # Large pairs off the diagonal: rows must be exchanged in the fronts.
    pivots = kron(eye_array(pattern.shape[0]), [[1e-6, 9.0 + n], [-9.0 - n, 1e-6]])
    return csr_array(blocks + pivots)


@pytest.mark.parametrize("n", [1, 4, 49])
@pytest.mark.parametrize(
    "name", ["nothing coupled", "a chain", "a square", "at random", "all coupled"]
)
@pytest.mark.parametrize("part", [0.0, 0.1, 1.0])
def test_solutions_are_those_of_the_whole(name, n, part):
    """Also of a second matrix with the same pattern, and a second right-hand side."""
    matrix = matrix_of(name, 225 if n == 49 and name != "all coupled" else n)
    size, random = matrix.shape[0], np.random.default_rng(1)
    stays = np.repeat(random.uniform(size=size // 2) < part, 2)
    whole = Whole(matrix, np.arange(size))
    condensed = Multifrontal(whole, stays)
    assert condensed.left.size == np.count_nonzero(stays)
    for factor in (1.0, -3.0):
        whole.left.data[:] = factor * csr_array(matrix).data
        for again, b in enumerate(random.uniform(-1, 1, (2, size))):
            expected = np.linalg.solve(dense(whole.left), b)
            # Pivots of some 10 and less than n entries of 1: few digits of sixteen are lost.
            assert np.allclose(solve(condensed, b, again), expected, rtol=0, atol=1e-13)


@pytest.mark.parametrize("units", [1.0, 1e-20, 1e20])
def test_a_small_system_with_forces_of_joints(units):
    """Two chains of springs whose mean motions are held by forces, and nothing else: the stiffness
    is singular but for last digits, and of any size beside the zeros on the diagonal."""
    nodes = 10
    lengthen, held = np.diff(np.eye(nodes), axis=0), np.kron(np.eye(2), np.ones(nodes))
    for seed in range(10):
        springs = np.random.default_rng(seed).uniform(0.1, 1.0, nodes - 1)
        K = units * np.kron(np.eye(2), lengthen.T @ np.diag(springs) @ lengthen)
        matrix = np.block([[K, held.T], [held, np.zeros((2, 2))]])
        b = np.append(units * np.linspace(-1.0, 2.0, 2 * nodes), np.zeros(2))
        nothing_stays = np.zeros(len(b), dtype=bool)
        x = solve(Multifrontal(Whole(matrix, np.arange(len(b))), nothing_stays), b)
        # Motions of some tens, with 22 unknowns: 1e-14.  Rows compared by numbers of different
        # dimensions take last digits of the stiffness for pivots, and lose two digits more.
        residual = (matrix @ x - b) / np.array([units] * (2 * nodes) + [1.0] * 2)
        assert np.abs(residual).max() < 1e-13


@pytest.mark.parametrize("value", [0.0, np.nan])
def test_a_singular_part_is_said(value):
    """Even where nothing that stays couples to it."""
    matrix = matrix_of("nothing coupled", 9)
    whole, stays = Whole(matrix, np.arange(18)), np.arange(18) < 4
    condensed = Multifrontal(whole, stays)
    assert condensed.factor(np.zeros(18))
    whole.left.data[-4:] = value
    assert not condensed.factor(np.zeros(18))


def test_sums_over_processes():
    """Each process has a chain of three unknowns, whose ends it shares with its neighbours."""
    comm = MPI.COMM_WORLD
    size, here = 2 * comm.size + 1, 2 * comm.rank + np.arange(3)
    part = np.array([[2.0, -1.0, 0.0], [-1.0, 3.0, -1.0], [0.0, -1.0, 2.0]])
    whole = Whole(part, here)
    stays = np.array([comm.rank > 0, False, comm.rank < comm.size - 1])
    summed = Summed(Multifrontal(whole, stays), comm)
    K, b = np.zeros((size, size)), np.arange(1.0, size + 1)
    for rank in range(comm.size):
        K[2 * rank :, 2 * rank :][:3, :3] += part
    owned = b[here] * np.array([comm.rank == 0, 1, 1])  # the end before is another's
    for again in (False, True):
        assert np.allclose(solve(summed, owned, again), np.linalg.solve(K, b)[here], rtol=1e-13)
    assert summed.dofs.tolist() == list(range(2, size - 1, 2))
    whole.good = comm.rank < comm.size - 1
    assert not summed.factor(owned)


@pytest.mark.parametrize("number", [1, 2, 3, 8, 64])
def test_parts_have_equal_sizes_and_short_borders(number):
    """In a square of 64 points a side, numbered at random."""
    points = np.random.default_rng(0).permutation(np.indices((64, 64)).reshape(2, -1).T)
    part = bisect(points.astype(float), number)
    counts = np.bincount(part, minlength=number)
    assert counts.min() >= counts.max() - number
    at = np.empty((64, 64), dtype=int)
    at[tuple(points.T)] = part
    cut = np.count_nonzero(np.diff(at, axis=0)) + np.count_nonzero(np.diff(at, axis=1))
    # Squares cut 2 (sqrt(number) - 1) lines; thirds, and rectangles, half as much again at most
    assert cut <= 1.5 * 2 * 64 * (number**0.5 - 1) + 8
    few = bisect(np.zeros((3, 2)), 3 + number)  # more parts than points
    assert len({*few}) == 3


@pytest.mark.parametrize("scheme", [ub.Static(), ub.EnergyMomentum()], ids=["statics", "dynamics"])
@pytest.mark.parametrize("number", [1, 5])
def test_beams_that_share_nothing(number, scheme):
    """Under mpirun: parts without a border, processes with one cell, a force that holds a joint."""
    section = ub.Section(EA=1e4, GA=4e3, EI=10.0, rhoA=1.0, rhoI=0.01)
    beams = [ub.Beam((10 * i, 0), (10 * i + 1, 0.5), section, cells=3) for i in range(number)]
    tip = ub.Beam(beams[0].ends[1], (2, 0), section, cells=2)
    scene = ub.Scene(
        [*beams, tip],
        joints=[ub.Revolute(beams[0].end, tip.start, multipliers=True)],
        supports=[*(ub.Clamped(beam.start) for beam in beams), ub.Pinned(tip.end)],
        loads=[ub.PointLoad(beam.end, force=(0, -1.0)) for beam in beams],
    )
    alone, together = (
        ub.simulate(scene, scheme, t=(0, 1), dt=0.25, comm=comm).q
        for comm in (MPI.COMM_SELF, MPI.COMM_WORLD)
    )
    # Residuals of 1e-10 of the forces, 1 N, on stiffnesses of some 10 N/m
    assert np.abs(alone - together).max() < 1e-9


def test_processes_may_have_no_elastic_cells_that_are_damped_numerically():
    """Of two processes, one has the elastic cells and one the cells that yield."""
    elastic = ub.Section.rectangle(b=0.1, h=0.2, E=210e9, nu=0.3, rho=7800.0)
    fibres = ub.Fibres(ub.ElastoPlastic(355e6, isotropic=2e9), number=4)
    yields = ub.Section.rectangle(b=0.1, h=0.2, E=210e9, nu=0.3, rho=7800.0, fibres=fibres)
    a, b = ub.Beam((0, 0), (2, 0), elastic, cells=4), ub.Beam((2, 0), (4, 0), yields, cells=4)
    scene = ub.Scene(
        [a, b], joints=[ub.Rigid(a.end, b.start)], supports=[ub.Clamped(a.start)],
        loads=[ub.PointLoad(b.end, force=(0, -1e3))],
    )  # fmt: skip
    one, all_of_us = (
        ub.simulate(scene, ub.EnergyMomentumDecaying(0.5), t=(0, 0.01), dt=2e-3, comm=comm)
        for comm in (MPI.COMM_SELF, MPI.COMM_WORLD)
    )
    np.testing.assert_allclose(all_of_us.q, one.q, atol=1e-10 * np.abs(one.q).max(), rtol=0.0)
