"""Tangents against central differences of the residuals, at random states, for all terms."""

from mpi4py import MPI

import numpy as np
import pytest
from scipy.sparse import csr_array

import ufl_beam as ub

# Numbers of one magnitude, so that an error in any term shows in the largest entry.
SECTION = ub.Section(EA=60.0, GA=40.0, EI=30.0, rhoA=2.0, rhoI=1.0)
OTHER = ub.Section(EA=30.0, GA=50.0, EI=20.0)
"""Without inertia."""


def scene(kind):
    a = ub.Beam((0, 0), (1, 2), SECTION, cells=2, name="a")
    b = ub.Beam.arc((0, 2), 1.0, (0, 2), OTHER, cells=3, name="b")
    c = ub.Beam((1, 2), (2, 2), SECTION, cells=2, name="c")
    joints = [ub.Rigid(a.end, b.start), ub.Revolute(a.end, c.start)]
    supports = [ub.Clamped(a.start), ub.Roller(c.end)]
    loads = [ub.PointLoad(b.end, force=(3, 4)), ub.Gravity(), ub.LineLoad(c, force=(1, 2))]
    masses = []
    if "follower" in kind:
        loads += [
            ub.FollowerLoad(b.at(1 / 3), force=(20, -30), moment=7),
            ub.FollowerLoad(c.start, force=(-10, 20)),
        ]
    if "roller" in kind:
        supports[1] = ub.Roller(c.end, along=(2, 1))
    if "masses" in kind:
        masses += [ub.PointMass(c.start, 3.0, 2.0), ub.PointMass(b.end, 1.0)]
    if "moved" in kind:
        supports[0] = ub.Prescribed(a.start, u=0.1, v=0, psi=lambda t: 0.3 * t)
    return ub.Scene([a, b, c], joints=joints, supports=supports, loads=loads, masses=masses)


KINDS = ["plain", "follower", "roller", "masses", "moved", "follower roller masses"]
SCHEMES = [
    ub.Static(),
    ub.Midpoint(),
    ub.Midpoint(0.1, 0.1),
    ub.Midpoint(alpha=0.5),
    ub.Midpoint(beta=0.5),
]


class Probe:
    """Residual and tangent of a step between random states, without what supports hold."""

    def __init__(self, scene, scheme, turn, seed=0):
        random = np.random.default_rng(seed)
        # Every process computes the whole scene.
        self.simulation = simulation = ub.Simulation(scene, scheme, comm=MPI.COMM_SELF)
        size = simulation.share.size
        simulation.q = random.uniform(-0.5, 0.5, size)
        if scheme.dynamic:
            simulation.inertia.v = random.uniform(-1, 1, size)
        step = scheme.step(0.0, 0.3, 0.3, simulation.q)
        for term in simulation.terms:
            term.begin(step)
        self.x = simulation.supports.in_axes(simulation.q + random.uniform(-turn, turn, size))
        self.free = np.setdiff1d(np.arange(size), simulation.supports.dofs)

    def residual(self, x):
        r = np.empty(len(x))
        self.simulation._residual(x, r)
        return r[self.free]

    def tangent(self):
        A = self.simulation._A
        self.simulation._tangent(self.x)
        matrix = csr_array((A.data, A.indices, A.indptr)).toarray()
        return matrix[np.ix_(self.free, self.free)]

    def differences(self, ε):
        columns = []
        for i in self.free:
            e = np.zeros(len(self.x))
            e[i] = ε
            columns.append((self.residual(self.x + e) - self.residual(self.x - e)) / (2 * ε))
        return np.column_stack(columns)


@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize("scheme", SCHEMES, ids=str)
def test_tangent(kind, scheme):
    probe = Probe(scene(kind), scheme, turn=1.5)
    tangent = probe.tangent()
    # Central differences with ε = 1e-5: ε² of third derivatives and 1e-16/ε of values, 1e-9
    # and less of the largest entry at these states
    scale = np.abs(tangent).max()
    assert np.abs(tangent - probe.differences(1e-5)).max() < 1e-7 * scale


@pytest.mark.parametrize("turn", [1e-2, 2.5])
def test_tangent_of_short_and_long_steps(turn):
    """Where x / tan x is a series, and near the limit of the step."""
    probe = Probe(scene("follower roller masses"), ub.Midpoint(0.1, 0.1), turn=turn)
    tangent = probe.tangent()
    # Third derivatives grow with tan² of half the turn: a hundred times as above at 2.5 rad
    assert np.abs(tangent - probe.differences(1e-5)).max() < 1e-6 * np.abs(tangent).max()


@pytest.mark.parametrize("kind", ["follower", "masses", "roller"])
def test_each_term_shows_in_the_tangent(kind):
    """That the comparison above can fail: without the term the tangent is another one."""
    with_term = Probe(scene(kind), ub.Midpoint(), turn=1.5).tangent()
    without = Probe(scene("plain"), ub.Midpoint(), turn=1.5).tangent()
    assert np.abs(with_term - without).max() > 1e-2 * np.abs(without).max()


def test_static_tangent_of_dead_loads_is_symmetric():
    """Elastic beams under dead loads have a potential."""
    tangent = Probe(scene("roller"), ub.Static(), turn=1.0).tangent()
    assert np.abs(tangent - tangent.T).max() < 1e-14 * np.abs(tangent).max()


def test_held_rows_and_columns_are_diagonal():
    """With the stiffness that stood there, so that no unit of measure gets in."""
    probe = Probe(scene("roller"), ub.Static(), turn=1.0)
    simulation = probe.simulation
    probe.tangent()
    A = simulation._A
    matrix = csr_array((A.data, A.indices, A.indptr)).toarray()
    held = simulation.supports.dofs
    diagonal = np.diag(matrix)
    others = matrix - np.diag(diagonal)
    assert len(held) == 4
    assert (others[held] == 0).all()
    assert (others[:, held] == 0).all()
    assert (diagonal[held] > 1e-3 * diagonal.max()).all()
