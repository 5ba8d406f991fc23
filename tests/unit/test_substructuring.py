# SPDX-License-Identifier: MIT
"""Factors of reduced systems against dense solutions, also without KLU; the parts of processes."""

from contextlib import nullcontext
from functools import cache
from itertools import pairwise
from pathlib import Path

from mpi4py import MPI

import numpy as np
import pytest
from scipy.sparse import csr_array, eye_array, kron, random_array

import ufl_beam as ub
from ufl_beam.arrays import Array
from ufl_beam.compiled import c_library
from ufl_beam.compiled.c_library import ffi
from ufl_beam.compiled.csr import Csr
from ufl_beam.compiled.jit import compiled
from ufl_beam.discretization.partition import bisect
from ufl_beam.solvers import lu_factors
from ufl_beam.solvers.lu_factors import FactorsOfPetsc, Klu
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


def solve(factors, b, again=False) -> Array:
    x = np.empty(len(b))
    assert factors.reduce(b) if again else factors.factor(b)
    factors.expand(x)
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
    # Large pairs off the diagonal: rows must be exchanged.
    pivots = kron(eye_array(pattern.shape[0]), [[1e-6, 9.0 + n], [-9.0 - n, 1e-6]])
    return csr_array(blocks + pivots)


def without_forces(whole):
    return Klu(whole, np.zeros(len(whole.dofs), dtype=bool))


@pytest.fixture(params=["KLU", "PETSc with KLU", "PETSc with MUMPS"])
def kind(request, monkeypatch):
    """Factors by KLU, and by PETSc without a header or without KLU."""
    if request.param == "KLU":
        return without_forces
    monkeypatch.setattr(c_library, "HAS_KLU", request.param == "PETSc with KLU")
    return FactorsOfPetsc


@pytest.mark.parametrize("n", [1, 4, 49, 225])
@pytest.mark.parametrize(
    "name", ["nothing coupled", "a chain", "a square", "at random", "all coupled"]
)
def test_solutions_are_those_of_the_whole(kind, name, n):
    """Also of a second matrix with the same pattern, and a second right-hand side."""
    if name == "all coupled" and n > 49:
        n = 49
    matrix = matrix_of(name, n)
    size = matrix.shape[0]
    random = np.random.default_rng(1)
    whole = Whole(matrix, np.arange(size))
    factors = kind(whole)
    for factor in (1.0, -3.0):
        whole.left.data[:] = factor * csr_array(matrix).data
        for again, b in enumerate(random.uniform(-1, 1, (2, size))):
            expected = np.linalg.solve(whole.left.sparse().toarray(), b)
            # Pivots of some 10 and less than n entries of 1: few digits of sixteen are lost.
            assert np.allclose(solve(factors, b, again), expected, rtol=0, atol=1e-13)


@pytest.mark.parametrize("small", [0.0, 1e-9])
def test_rows_are_exchanged_if_a_matrix_needs_it(small):
    """The second matrix has small or zero diagonal entries; it is as regular as the first."""
    n = 25
    coupled = np.random.default_rng(2).uniform(-0.1, 0.1, (2 * n, 2 * n))
    here = np.kron(np.eye(n), np.ones((2, 2))) == 1
    one, other = (
        np.where(here, np.kron(np.eye(n), block), coupled)
        for block in ([[4.0, 1.0], [1.0, small]], [[small, 1.0], [1.0, 4.0]])
    )
    whole, b = Whole(np.ones((2 * n, 2 * n)), np.arange(2 * n)), np.ones(2 * n)
    factors, found = without_forces(whole), []
    for matrix in (one, other, one, other):
        whole.left.data[:] = matrix.ravel()
        found.append(solve(factors, b))
        # Solutions of some tens: 1e-13.  Pivots of 1e-9 lose half of the digits.
        assert np.abs(matrix @ found[-1] - b).max() < 1e-12
    assert np.array_equal(found[:2], found[2:])  # matrices before have no effect, as for restarts


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
        whole = Whole(np.ones_like(matrix), np.arange(len(b)))
        whole.left.data[:] = matrix.ravel()
        x = solve(Klu(whole, np.arange(len(b)) >= 2 * nodes), b)
        # Motions of some tens, with 22 unknowns: 1e-14.  Rows compared by numbers of different
        # dimensions take last digits of the stiffness for pivots, and lose two digits more.
        residual = (matrix @ x - b) / np.array([units] * (2 * nodes) + [1.0] * 2)
        assert np.abs(residual).max() < 1e-13


def test_forces_of_joints_need_no_exchanges_of_rows():
    """Springs from node to node and to the ground, and forces that hold some motions."""
    n, random = 40, np.random.default_rng(3)
    lengthen = np.diff(np.eye(n + 1), axis=0)[:, :n]
    K = lengthen.T @ np.diag(random.uniform(0.1, 1.0, n)) @ lengthen
    held = np.eye(n)[::4] - np.eye(n)[1::4]
    matrix = np.block([[K, held.T], [held, np.zeros((10, 10))]])
    matrix[np.diag_indices(n + 10)] += 1e-300  # PETSc and KLU need the diagonal in the pattern
    for forces, same in ((np.arange(n + 10) >= n, True), (np.zeros(n + 10, dtype=bool), False)):
        factors, b = Klu(Whole(matrix, np.arange(n + 10)), forces), random.uniform(-1, 1, n + 10)
        # Stiffnesses of some 0.1 / 40: solutions of some 1e2
        assert np.abs(matrix @ solve(factors, b) - b).max() < 1e-12
        assert (factors.c.latest == factors.c.in_order) == same


@pytest.mark.parametrize("row", [slice(2), slice(-2, None)])
def test_a_singular_part_is_said(kind, row):
    """Also after a regular matrix, and before one."""
    matrix, b = matrix_of("nothing coupled", 9), np.ones(18)
    whole = Whole(matrix, np.arange(18))
    factors, data = kind(whole), whole.left.data.reshape(18, 2)
    x, kept = solve(factors, b), data[row].copy()
    data[row] = 0.0
    assert not factors.factor(b)
    assert not factors.factor(b)
    data[row] = kept
    assert np.array_equal(solve(factors, b), x)


def test_factors_with_more_entries_than_indices_of_32_bits_are_refused(monkeypatch):
    monkeypatch.setattr(lu_factors, "LARGEST_INDEX", 9999)
    whole = Whole(matrix_of("all coupled", 50), np.arange(100))
    says = "the 100 unknowns of joints have more entries than .* indices of 32 bits can number"
    with pytest.raises(ub.ArgumentError, match=says):
        without_forces(whole)


def test_sums_over_processes():
    """Each process has a chain of three unknowns, whose ends it shares with its neighbours."""
    comm = MPI.COMM_WORLD
    size, here = 2 * comm.size + 1, 2 * comm.rank + np.arange(3)
    part = np.array([[2.0, -1.0, 0.0], [-1.0, 3.0, -1.0], [0.0, -1.0, 2.0]])
    whole = Whole(part, here)
    factors = without_forces(summed := Summed(whole, comm))
    K, b = np.zeros((size, size)), np.arange(1.0, size + 1)
    for rank in range(comm.size):
        K[2 * rank :, 2 * rank :][:3, :3] += part
    owned = b[here] * np.array([comm.rank == 0, 1, 1])  # the end before is another's
    for again in (False, True):
        assert np.allclose(solve(factors, owned, again), np.linalg.solve(K, b)[here], rtol=1e-13)
    assert summed.dofs.tolist() == list(range(size))
    whole.good = comm.rank < comm.size - 1
    assert not factors.factor(owned)


# -- a missing KLU -------------------------------------------------------------------------------


def frame():
    """Frame of two storeys, with a joint that is held by forces."""
    section = ub.Section(EA=1e4, GA=4e3, EI=10.0, rhoA=1.0, rhoI=0.01)
    line = [(0, 0), (0, 1), (0, 2), (1, 2), (1, 1), (1, 0)]
    *legs, bar = (
        ub.Beam(*ends, section, cells=2) for ends in [*pairwise(line), (line[1], line[4])]
    )
    joints = [ub.Rigid(a.end, b.start) for a, b in pairwise(legs)]
    joints += [
        ub.Revolute(legs[k].end, end, multipliers=k == 3)
        for k, end in ((0, bar.start), (3, bar.end))
    ]
    feet = [ub.Clamped(legs[0].start), ub.Clamped(legs[-1].end)]
    push = ub.PointLoad(legs[1].end, force=(3.0, 1.0))
    return ub.Scene([*legs, bar], joints=joints, supports=feet, loads=[push])


@pytest.mark.parametrize(
    ("name", "value", "says"),
    [("KLU_HEADER", None, r"klu\.h is missing"), ("HAS_KLU", False, "PETSc was built without KLU")],
)
def test_runs_without_klu(monkeypatch, name, value, says):
    """PETSc factors the tangents; one warning names the package to install."""
    expected = ub.simulate(frame(), ub.EnergyMomentum(), t=(0, 1), dt=0.1).q
    monkeypatch.setattr(c_library, name, value)
    monkeypatch.setattr(
        lu_factors, "_warn_of_missing_klu", cache(lu_factors._warn_of_missing_klu.__wrapped__)
    )
    context = pytest.warns(RuntimeWarning, match=f"{says}: .* Install libsuitesparse-dev")
    with context if MPI.COMM_WORLD.rank == 0 else nullcontext():
        simulation = ub.Simulation(frame(), ub.EnergyMomentum())
    assert simulation.equation.c.lu == ffi.NULL
    found = ub.simulate(frame(), ub.EnergyMomentum(), t=(0, 1), dt=0.1).q  # no second warning
    # Residuals of 1e-10 of the forces, some 10 N, on stiffnesses of some 10 N/m
    assert np.abs(found - expected).max() < 1e-9


def test_c_is_compiled_without_the_header_of_klu():
    declarations = c_library.DECLARATIONS + c_library._CALLBACKS
    code = c_library.source(None)
    options = {"depends_on": [code], "flags": ["-O0"]}
    without = compiled("ufl_beam_without_klu", declarations, lambda: code, **options)
    assert without.lib.klu.klu_factor == without.ffi.NULL


def test_the_header_of_klu_is_looked_for_in_the_flags_of_petsc_first(tmp_path, monkeypatch):
    variables, prefix = tmp_path / "lib/petsc/conf/petscvariables", tmp_path / "prefix"
    flag, general = tmp_path / "flag/klu.h", prefix / "include/suitesparse/klu.h"
    for path in (variables, flag, general):
        path.parent.mkdir(parents=True)
        path.touch()
    monkeypatch.setattr("sys.prefix", str(prefix))
    assert c_library.klu_header(tmp_path) == general
    variables.write_text(f"CC = gcc\nPETSC_CC_INCLUDES = -I/none -I{flag.parent} -I/other\n")
    assert c_library.klu_header(tmp_path) == flag
    monkeypatch.setattr(Path, "is_file", lambda path: path == variables)
    assert c_library.klu_header(tmp_path) is None


# -- parts of processes --------------------------------------------------------------------------


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


def test_more_parts_than_points():
    assert sorted(bisect(np.zeros((3, 2)), 5)) == sorted(set(bisect(np.zeros((3, 2)), 5)))


@pytest.mark.parametrize("scheme", [ub.Static(), ub.EnergyMomentum()], ids=["statics", "dynamics"])
@pytest.mark.parametrize("number", [1, 2, 5])
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
