# SPDX-License-Identifier: MIT
"""Words for what fails: what nothing holds, what gives way, why Newton's method stopped."""

import math
import re

import numpy as np
import pytest
from scenes import clamped, rigid_chain
from scipy.sparse import csc_array, diags_array

import ufl_beam as ub
import ufl_beam.structures as st
from ufl_beam.solvers import null_vectors

CODES = ("DIVERGED", "SNES", "dt = 0 s")


def failure(scene, scheme=None, **more):
    """The error of a static run, whose message has no codes."""
    arguments = {"t": (0, 7), "dt": 0.5} | more
    with pytest.raises(ub.ConvergenceError) as caught:
        ub.simulate(scene, scheme or ub.Static(), **arguments)
    assert [code for code in CODES if code in str(caught.value)] == []
    return caught.value


def spring():
    return ub.Spring(1e8, law=ub.ElastoPlastic(1.0))


def node_between_hinges(*more):
    """Two clamped members, and between them a node on springs that yield at the same moment."""
    section = ub.Section(EA=1e7, GA=1e7, EI=1e4)
    left = ub.Beam((0, 0), (1, 0), section, cells=2, name="left")
    right = ub.Beam((1, 0), (2, 0), section, cells=2, name="right")
    node = ub.Body((1, 0), name="node")
    turns = [ub.Turn(left.end, node.middle, spring()), ub.Turn(node.middle, right.start, spring())]
    growing = {"amplitude": lambda t: t}
    loads = [ub.PointLoad(left.end, force=(0, -1), **growing)]
    loads += [ub.PointLoad(node.middle, moment=moment, **growing) for moment in more]
    return turns, ub.Scene(
        [left, right],
        bodies=[node],
        supports=[ub.Clamped(left.start), ub.Clamped(right.end)],
        joints=[ub.Revolute(node.middle, left.end, right.start)],
        connectors=turns,
        loads=loads,
    )


def test_a_massless_body_between_two_hinges():
    """Both have yielded, and a moment turns the body between them."""
    turns, scene = node_between_hinges(0.3)
    error = failure(scene)
    assert "singular: the rotation of node is held by nothing" in str(error)
    assert all(str(turn) in str(error) for turn in turns)
    assert "give way together" in str(error)
    assert error.reason == "DIVERGED_LINEAR_SOLVE"


def test_a_massless_body_between_two_hinges_that_nothing_turns():
    """It stays where it is while both hinges yield, and the members bear the load.

    Once the hinges yield, the members are cantilevers with the moment 1 N m at their ends, each
    under half of the load; n linear cells err by 1/(4 n²) of the bending that the load makes.
    Rotations of 1e-4 make a nonlinearity far below the tolerance.
    """
    _, scene = node_between_hinges()
    solution = ub.simulate(scene, ub.Static(), t=(0, 7), dt=0.5)
    (left, _), node = scene.beams, scene.bodies[0]
    load, moment = 3.5, 1.0  # N, N m
    expected = -load * ((1 - 1 / 16) / (3 * 1e4) + 1 / 1e7) + moment / (2 * 1e4)
    assert solution.displacement(left.end)[-1, 1] == pytest.approx(expected, rel=1e-5)
    assert solution.displacement(node.middle)[-1, 2] == pytest.approx(0.0, abs=1e-9)


def test_a_beam_on_a_spring_that_breaks():
    """A cantilever that one spring holds falls when that has lost its strength."""
    section = ub.Section(EA=1e7, GA=1e7, EI=1e4)
    beam = ub.Beam((0, 0), (1, 0), section, cells=2, name="arm")
    turn = ub.Turn(ub.ground(0, 0), beam.start, spring())
    scene = ub.Scene(
        [beam],
        joints=[ub.Revolute(ub.ground(0, 0), beam.start)],
        connectors=[turn],
        loads=[ub.PointLoad(beam.end, force=(0, -1), amplitude=lambda t: t)],
    )
    message = str(failure(scene))
    # A limit of 1 N m at 1 m: the load 1 N is reached at t = 1
    assert "no equilibrium after t = 1" in message
    assert "of arm" in message
    assert str(turn) in message
    assert "gives way" in message


def test_a_plastic_mechanism_names_the_cell():
    """A short part of a cantilever yields; no rotation of the rest resists more of the moment."""
    numbers = {"EA": 1e7, "GA": 1e7, "EI": 1e4}
    weak = ub.Section(**numbers, bending=ub.ElastoPlastic(yield_limit=1.0))
    fuse = ub.Beam((0, 0), (0.1, 0), weak, cells=1, name="fuse")
    arm = ub.Beam((0.1, 0), (1, 0), ub.Section(**numbers), cells=3, name="arm")
    scene = rigid_chain(
        [fuse, arm],
        supports=[ub.Clamped(fuse.start)],
        loads=[ub.PointLoad(arm.end, moment=1.0, amplitude=lambda t: t)],
    )
    message = str(failure(scene, dt=0.3))
    # All rotations of the arm are alike; the first of them is named first.
    assert "the rotation of fuse at (0.1, 0)" in message
    assert "fuse at (0.05, 0) gives way" in message


def test_too_few_iterations_in_words():
    beam = ub.Beam((0, 0), (1, 0), ub.Section(EA=1e7, GA=1e7, EI=1e4), cells=2)
    load = ub.PointLoad(beam.end, force=(0, -1e4), amplitude=lambda t: t)
    scene = clamped(beam, loads=[load])
    error = failure(scene, newton=ub.Newton(max_iterations=1, rtol=1e-14))
    assert "Newton's method did not converge after 1 iterations; residual" in str(error)
    assert "singular" not in str(error)
    assert error.reason == "DIVERGED_MAX_IT"


@pytest.mark.parametrize("size", [40, 400])
def test_null_vectors_in_any_units(monkeypatch, size):
    """A chain of springs that nothing holds moves as a whole, whatever units its unknowns have."""
    monkeypatch.setattr(null_vectors, "DENSE", 100)  # so that one is found by each method
    ones = np.ones(size - 1)
    chain = diags_array([-ones, np.r_[1, 2 * ones[1:], 1], -ones], offsets=[-1, 0, 1])
    units = 10.0 ** np.random.default_rng(0).uniform(-6, 6, size)
    scale = diags_array(1 / units)
    sizes, vectors = null_vectors.null_vectors(csc_array(scale @ chain @ scale))
    smallest, vector = sizes[-1], vectors[:, -1]
    assert smallest < null_vectors.SINGULAR
    whole = vector / units
    assert whole / whole[0] == pytest.approx(np.ones(size), rel=1e-6)
    held = csc_array(scale @ (chain + diags_array(np.eye(1, size)[0])) @ scale)
    # The smallest singular value of a chain that is held at one end is some (π / (2 size))².
    assert null_vectors.null_vectors(held)[0][-1] > 1e-7


def test_perfectly_plastic_cells_in_a_row():
    """The seed is one of 1600 in which two of them flow in the same step; hardening mends it."""

    def rod(**more):
        strength = ub.distributions.Normal(300e6, 60e6, seed=1558)
        fibres = ub.Fibres(ub.ElastoPlastic(strength, **more), number=4)
        section = ub.Section.rectangle(b=0.02, h=0.02, E=200e9, nu=0.3, fibres=fibres)
        beam = ub.Beam((0, 0), (1, 0), section, cells=4)
        held = [ub.PrescribedDisplacement(beam.at(k / 4), v=0.0, psi=0.0) for k in range(1, 4)]
        pulled = ub.PrescribedDisplacement(beam.end, u=lambda t: 0.008 * t, v=0.0, psi=0.0)
        return pulled, clamped(beam, pulled, *held)

    assert "if they carry the same force, it does not determine which of them yields" in str(
        failure(rod()[1], t=(0, 1), dt=0.25)
    )
    pulled, hardens = rod(isotropic=200e9 * 1e-6)
    run = ub.simulate(hardens, ub.Static(), t=(0, 1), dt=0.25)
    # N; the weakest cell bears about 300 MPa on 4 cm²
    assert 0.8 < run.reaction(pulled)[-1, 0] / 120e3 < 1.2


NEAR_A_LIMIT = "a limit load or a bifurcation is near.*follow the path through it with ub.follow"


def test_collapse_by_its_weight_is_a_limit_load():
    """P-Delta: the spring at the foot of a column hardens by 20 N m, the weight takes 50 N m.

    It yields at 5 N m = H l + P v: before, v = 5/100 (and 1.7 % of bending), so H = 2.5 N of 8.
    """
    column = ub.Beam((0, 0), (0, 1), ub.Section(EA=1e7, GA=1e7, EI=1e3), cells=4)
    loads = [
        ub.PointLoad(column.end, force=(0, -50)),
        ub.PointLoad(column.end, force=(8, 0), amplitude=lambda t: t),
    ]
    foot = ub.ground(0, 0)
    turn = ub.Turn(foot, column.start, ub.Spring(100.0, ub.ElastoPlastic(5.0, isotropic=20.0)))
    scene = ub.Scene(
        [column], joints=[ub.Revolute(foot, column.start)], loads=loads, connectors=[turn]
    )
    error = failure(scene, t=(0, 1), dt=0.1)
    assert error.time == pytest.approx(2.5 / 8, rel=0.05)
    assert re.search(NEAR_A_LIMIT, str(error))
    assert f"singular; {turn} yields or softens; follow" in str(error)
    path = ub.follow(scene, ub.ArcLength(0.02), steps=40)
    assert path.factor.max() == pytest.approx(error.time, rel=1e-3)


def test_the_largest_moment_of_a_hinge_is_a_limit_load():
    """105 % of 4 N m at 0.04 + 0.1 rad; there the lever arm is 1 m times the cosine of 0.14 rad."""
    backbone = st.Backbone(4.0, capping=0.1, post_capping=0.2, overstrength=1.05)
    column = ub.Beam((0, 0), (0, 1), ub.Section(EA=1e7, GA=1e7, EI=1e3), cells=4)
    foot = ub.ground(0, 0)
    turn = ub.Turn(foot, column.start, st.IbarraKrawinkler(100.0, backbone))
    push = ub.PointLoad(column.end, force=(8, 0), amplitude=lambda t: t)
    scene = ub.Scene(
        [column], joints=[ub.Revolute(foot, column.start)], loads=[push], connectors=[turn]
    )
    error = failure(scene, t=(0, 1), dt=0.1)
    # the shaft bends by M/(2 EI) = 0.002 rad more; a substep is 1/4096 of 0.1 s
    assert error.time == pytest.approx(1.05 * 4.0 / math.cos(0.14) / 8, rel=1e-3)
    assert f"{turn} gives way" in str(error)


def test_collapse_of_a_column_on_a_plastic_hinge_is_a_mechanism():
    """P-Delta: the hinge at the foot carries 100 kN m, the shaft bends; kL = 0.79."""
    section = ub.Section(EA=4e9, GA=1.5e9, EI=4e7)
    column = ub.Beam((0, 0), (0, 5), section, cells=4, hinges={0.0: ub.ElastoPlastic(1e5)})
    loads = [
        ub.PointLoad(column.end, force=(0, -1e6)),
        ub.PointLoad(column.end, force=(5e4, 0), amplitude=lambda t: t),
    ]
    error = failure(clamped(column, loads=loads), t=(0, 1), dt=0.025)
    assert "a mechanism has formed" in str(error)
    assert "Hinge(beam.start (0, 0)) gives way" in str(error)


def test_snap_through_is_a_limit_load():
    section = ub.Section(EA=1e6, GA=1e6, EI=1e9, depth=0.1)
    left = ub.Beam((-4, 0), (0, 1), section, cells=1)
    right = ub.Beam((0, 1), (4, 0), section, cells=1)
    load = ub.PointLoad(left.end, force=(0, -4e4), amplitude=lambda t: t)
    supports = [ub.Pinned(left.start), ub.Pinned(right.end)]
    scene = ub.Scene(
        [left, right], joints=[ub.Revolute(left.end, right.start)], supports=supports, loads=[load]
    )
    assert re.search(NEAR_A_LIMIT, str(failure(scene, t=(0, 1), dt=0.1)))


def test_what_is_far_from_a_limit_load_is_not_called_one():
    """A single iteration is too little for a large deflection."""
    beam = ub.Beam((0, 0), (1, 0), ub.Section(EA=1e6, GA=1e6, EI=1.0), cells=4)
    load = ub.PointLoad(beam.end, force=(0, 1e5), amplitude=lambda t: 1.0)
    scene = clamped(beam, loads=[load])
    error = failure(scene, t=(0, 1), dt=0.5, newton=ub.Newton(max_iterations=1))
    assert "limit load or a bifurcation is near" not in str(error)
