# SPDX-License-Identifier: MIT
"""Elimination along chains of cells against direct solutions of the whole system."""

from itertools import pairwise
from types import SimpleNamespace

from mpi4py import MPI

import numpy as np
import pytest
from scipy.sparse import csr_array

import ufl_beam as ub
from ufl_beam.compiled.csr import Csr
from ufl_beam.solvers.beam_elimination import Elimination

SECTION = ub.Section(EA=60.0, GA=40.0, EI=30.0, rhoA=2.0, rhoI=1.0)
N = pytest.mark.parametrize("n", [3, 6])  # unknowns of a vertex: in the plane, in space


def cells_of(*beams, n=3):
    """Degrees of freedom of cells, beam after beam: both u, both v, ..., of n; from vertices."""
    ends = np.array([pair for beam in beams for pair in pairwise(beam)])
    return (n * ends[:, None, :] + np.arange(n)[:, None]).reshape(-1, 2 * n)


def system(cell_dofs, seed=0, more=(), held=()):
    """A random unsymmetric matrix that couples the cells, ``more`` pairs of dofs; a share of it."""
    random = np.random.default_rng(seed)
    size = 1 + max(cell_dofs.max(), max((max(pair) for pair in more), default=0))
    dense = np.zeros((size, size))
    for dofs in [*cell_dofs, *map(list, more)]:
        dense[np.ix_(dofs, dofs)] += random.uniform(-1, 1, (len(dofs), len(dofs)))
    dense[np.diag_indices(size)] += random.uniform(2, 3, size) * random.choice([-1, 1], size)
    pattern = csr_array(dense)
    for dof in held:
        dense[dof], dense[:, dof] = 0, 0
        dense[dof, dof] = 5.0
    rows = np.repeat(np.arange(size), np.diff(pattern.indptr))
    A = Csr(dense[rows, pattern.indices], pattern.indices, pattern.indptr)
    subdomain = SimpleNamespace(
        comm=MPI.COMM_SELF, cell_dofs=cell_dofs, size=size, dofs=np.arange(size), num_owned=size
    )
    return subdomain, A, dense


def solve(elimination, b, again=False):
    """The solution, by elimination and a dense solution of the unknowns that are left."""
    if again:
        elimination.reduce(b)
    else:
        assert elimination.factor(b)
    A = elimination.left
    left = csr_array((A.data, A.indices, A.indptr), shape=[A.size] * 2).toarray()
    x = np.empty(len(b))
    elimination.expand(np.linalg.solve(left, elimination.f), x)
    return x


def compare(subdomain, A, dense, left, seed=0):
    """Solutions for two right-hand sides with those of the whole; ``left`` unknowns are left.

    Random blocks need pivots between them, too, which elimination does not look for: some digits of
    sixteen are lost, here four at most.
    """
    elimination = Elimination(subdomain, A, subdomain.cell_dofs.shape[1] // 2)
    assert elimination.left.size == left
    for again, b in enumerate(np.random.default_rng(seed).uniform(-1, 1, (2, subdomain.size))):
        x = solve(elimination, b, again)
        assert np.allclose(x, np.linalg.solve(dense, b), rtol=1e-9, atol=1e-10)
    return elimination


CHAINS = {  # beams as their vertices; how many vertices are left
    "one cell": ([[0, 1]], 2),
    "one vertex between ends": ([[0, 1, 2]], 1),
    "one beam": ([range(30)], 1),
    "numbered backwards": ([range(30)[::-1]], 1),
    "in any order": ([[3, 7, 1, 9, 0, 4, 2, 8, 6, 5]], 1),
    "three beams at a joint": ([[0, 1, 2, 3], [3, 4, 5], [6, 7, 8, 3]], 1),
    "one beam after the other": ([[0, 1, 2], [2, 3, 4]], 1),
    "end to end": ([[0, 1, 2], [4, 3, 2]], 1),
    "a ring": ([[0, 1, 2, 3, 0]], 1),
    "a ring with a tail": ([[0, 1, 2, 3, 4, 2]], 1),
    "a beam between two joints": ([[0, 1], [0, 2], [0, *range(4, 30), 3], [3, 30], [3, 31]], 6),
    "no chain": ([[0, 1], [0, 2], [0, 3]], 4),
    "side by side": ([[0, 1, 2], [0, 1, 2]], 1),
    "side by side in part": ([[0, 1, 2], [1, 2, 3]], 2),
    "ends that are middles of others": ([[1, 2, 3], [2, 1, 0]], 4),
}


@pytest.mark.parametrize("name", CHAINS)
@pytest.mark.parametrize("seed", [0, 1])
@N
def test_solutions_are_those_of_the_whole(name, seed, n):
    beams, left = CHAINS[name]
    compare(*system(cells_of(*beams, n=n), seed), n * left, seed)


@N
def test_held_degrees_of_freedom(n):
    """Of an end, of a joint, and some or all of a vertex within a chain."""
    held = [*range(n), 3 * n, 5 * n + 1, *range(7 * n, 8 * n)]
    cell_dofs = cells_of([0, 1, 2, 3], [3, 4, 5, 6, 7, 8, 9], n=n)
    compare(*system(cell_dofs, held=held), n)  # both ends have one neighbour


@pytest.mark.parametrize("scattered", [(0,), (11,), (0, 11), (5,), (5, 6), (0, 5, 11)])
@N
def test_vertices_whose_degrees_of_freedom_do_not_follow_each_other(scattered, n):
    """They are left, and may be ends of chains."""
    number, firsts = np.arange(12 * n), [n * v for v in scattered]
    if len(firsts) > 1:
        number[firsts] = np.roll(firsts, 1)
    else:
        number[firsts[0] + np.arange(n)] = firsts[0] + np.roll(np.arange(n), -1)
    compare(*system(number[cells_of(range(12), n=n)]), n * len(scattered), seed=1)


@pytest.mark.parametrize(("pair", "left"), [((4, 20), 1), ((4, 10), 2), ((4, 6), 2)])
@N
def test_unknowns_that_couple_to_others_are_left(pair, left, n):
    """To a further unknown, to a vertex far away, to the next but one (one end is left as ever)."""
    further = 20 in pair
    compare(*system(cells_of(range(20), n=n), more=[[n * k for k in pair]]), n * left + further)


@N
def test_the_effect_of_the_ends_fades_along_a_chain(n):
    """By six digits a vertex: products of such numbers would soon be none."""
    subdomain, A, dense = system(cells_of([*range(80), 0], n=n))
    between = A.rows() // n != A.indices // n
    A.data[between] *= 1e-6
    dense[A.rows()[between], A.indices[between]] *= 1e-6
    compare(subdomain, A, dense, n)


@N
def test_zero_pivots_and_another_matrix(n):
    """A block that is regular although its first pivots are zero; other entries afterwards."""
    subdomain, A, dense = system(cells_of(range(6), n=n))
    k = 2 * n + np.arange(3)
    rows, columns, values = [*k, k[1], k[2]], [*k, k[0], k[0]], [0, 0, 0, 3, 0]
    A.data[A.positions(np.array(rows), np.array(columns))] = values
    dense[rows, columns] = values
    elimination, b = compare(subdomain, A, dense, n), np.ones(subdomain.size)
    A.data *= 2.0
    assert np.allclose(solve(elimination, b), np.linalg.solve(2 * dense, b), rtol=1e-9, atol=1e-10)


@pytest.mark.parametrize(("vertex", "held"), [(0, False), (1, True)])
@N
def test_a_singular_block_is_said(vertex, held, n):
    """Even where nothing couples to it."""
    block = n * vertex + np.arange(n)
    subdomain, A, _ = system(cells_of(range(6), n=n), held=block if held else ())
    rows = A.rows()
    A.data[np.isin(rows, block) & np.isin(A.indices, block)] = 0.0
    assert not Elimination(subdomain, A, n).factor(np.zeros(A.size))
