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
SECTION = ub.Section(EA=1e7, GA=1e7, EI=1e4)
NEAR_A_LIMIT = "a limit load or a bifurcation is near.*follow the path through it with ub.follow"


def growing(t):
    return t


def failure(scene, t=7, dt=0.5):
    """The error of a static run, whose message has no codes."""
    with pytest.raises(ub.ConvergenceError) as caught:
        ub.simulate(scene, ub.Static(), t=(0, t), dt=dt)
    assert [code for code in CODES if code in str(caught.value)] == []
    return caught.value


def spring():
    return ub.Spring(1e8, law=ub.ElastoPlastic(1.0))


def column_on(law, *loads, EI=1e3):
    """A column of 1 m on a rotational spring, with loads, functions of the column; the spring."""
    column = ub.Beam((0, 0), (0, 1), ub.Section(EA=1e7, GA=1e7, EI=EI), cells=4, name="column")
    turn = ub.Turn(ub.ground(0, 0), column.start, law)
    return ub.Scene(
        [column],
        joints=[ub.Revolute(turn.a, turn.b)],
        loads=[load(column) for load in loads],
        connectors=[turn],
    ), turn


def push(force):
    return lambda column: ub.PointLoad(column.end, force=(force, 0), amplitude=growing)


# -- nodes and beams that nothing holds ------------------------------------------------------------


def test_a_massless_body_between_two_hinges():
    """Both springs yield at the same moment, and a moment turns the node between them."""
    left = ub.Beam((0, 0), (1, 0), SECTION, cells=2, name="left")
    right = ub.Beam((1, 0), (2, 0), SECTION, cells=2, name="right")
    node = ub.Body((1, 0), name="node")
    turns = [ub.Turn(left.end, node.middle, spring()), ub.Turn(node.middle, right.start, spring())]
    scene = ub.Scene(
        [left, right],
        bodies=[node],
        supports=[ub.Clamped(left.start), ub.Clamped(right.end)],
        joints=[ub.Revolute(node.middle, left.end, right.start)],
        connectors=turns,
        loads=[
            ub.PointLoad(left.end, force=(0, -1), amplitude=growing),
            ub.PointLoad(node.middle, moment=0.3, amplitude=growing),
        ],
    )
    error = failure(scene)
    assert "singular: the rotation of node is held by nothing" in str(error)
    assert all(str(turn) in str(error) for turn in turns)
    assert "give way together" in str(error)
    assert error.reason == "DIVERGED_LINEAR_SOLVE"


@pytest.mark.parametrize("size", [40, 400])
def test_null_vectors_in_any_units(monkeypatch, size):
    """A chain of springs that nothing holds moves as a whole, whatever units its unknowns have."""
    monkeypatch.setattr(null_vectors, "DENSE", 100)  # so that one is found by each method
    ones = np.ones(size - 1)
    chain = diags_array([-ones, np.r_[1, 2 * ones[1:], 1], -ones], offsets=[-1, 0, 1])
    units = 10.0 ** np.random.default_rng(0).uniform(-6, 6, size)
    scale = diags_array(1 / units)
    sizes, vectors = null_vectors.null_vectors(csc_array(scale @ chain @ scale))
    assert sizes[-1] < null_vectors.SINGULAR
    whole = vectors[:, -1] / units
    assert whole / whole[0] == pytest.approx(np.ones(size), rel=1e-6)
    held = csc_array(scale @ (chain + diags_array(np.eye(1, size)[0])) @ scale)
    # The smallest singular value of a chain that is held at one end is some (π / (2 size))².
    assert null_vectors.null_vectors(held)[0][-1] > 1e-7


# -- mechanisms ------------------------------------------------------------------------------------


def test_a_column_on_a_spring_that_gives_way():
    """A limit of 1 N m at 1 m: the load of 1 N is reached at t = 1."""
    scene, turn = column_on(spring(), push(1.0), EI=1e4)
    message = str(failure(scene))
    assert "no equilibrium after t = 1" in message
    assert "of column" in message
    assert f"{turn} gives way" in message


def test_a_plastic_mechanism_names_the_cell():
    """A short part of a cantilever yields; no rotation of the rest resists more of the moment."""
    numbers = {"EA": 1e7, "GA": 1e7, "EI": 1e4}
    weak = ub.Section(**numbers, bending=ub.ElastoPlastic(yield_limit=1.0))
    fuse = ub.Beam((0, 0), (0.1, 0), weak, cells=1, name="fuse")
    arm = ub.Beam((0.1, 0), (1, 0), SECTION, cells=3, name="arm")
    load = ub.PointLoad(arm.end, moment=1.0, amplitude=growing)
    scene = rigid_chain([fuse, arm], supports=[ub.Clamped(fuse.start)], loads=[load])
    message = str(failure(scene, dt=0.3))
    # All rotations of the arm are alike; the first of them is named first.
    assert "the rotation of fuse at (0.1, 0)" in message
    assert "fuse at (0.05, 0) gives way" in message


def test_collapse_of_a_column_on_a_plastic_hinge_is_a_mechanism():
    """P-Delta: the hinge at the foot carries 100 kN m, the shaft bends; kL = 0.79."""
    section = ub.Section(EA=4e9, GA=1.5e9, EI=4e7)
    column = ub.Beam((0, 0), (0, 5), section, cells=4, hinges={0.0: ub.ElastoPlastic(1e5)})
    loads = [ub.PointLoad(column.end, force=(0, -1e6)), push(5e4)(column)]
    error = failure(clamped(column, loads=loads), t=1, dt=0.025)
    assert "a mechanism has formed" in str(error)
    assert "Hinge(beam.start (0, 0)) gives way" in str(error)


@pytest.mark.parametrize("in_space", [False, True])
def test_a_support_holds_a_beam_with_a_plastic_hinge(in_space):
    """The step fails by a load with noise: neither a mechanism nor a limit load is near."""

    def vector(x, y):
        return (x, y, 0.0) if in_space else (x, y)

    tube = ub.Section.tube(d=0.1, t=0.005, E=210e9, nu=0.3, rho=7850.0)
    hinges = {0.0: ub.ElastoPlastic(5e3)}
    left = ub.Beam(vector(0, 0), vector(2, 0), tube, cells=4, hinges=hinges)
    right = ub.Beam(vector(2, 0), vector(4, 0), tube, cells=4)
    held = {"w": 0.0} if in_space else {}
    supports = [ub.Clamped(left.start), ub.PrescribedDisplacement(right.end, u=0.0, v=0.0, **held)]
    joint = ub.Rigid(left.end, right.start, multipliers=True)  # its forces count as pivots

    def noisy(t):
        return t + 0.1 * math.sin(1e7 * t) * (t > 1.0)

    load = ub.PointLoad(left.end, force=vector(0, -8e3), amplitude=noisy)
    scene = ub.Scene([left, right], joints=[joint], supports=supports, loads=[load])
    before = ub.simulate(scene, ub.Static(), t=(0, 1), dt=0.05)
    few = ub.Newton(max_iterations=1)
    with pytest.raises(ub.ConvergenceError, match="did not converge") as caught:
        ub.simulate(scene, ub.Static(), t=(1, 2), dt=0.05, start=before, newton=few)
    assert "mechanism" not in str(caught.value)
    assert not re.search(NEAR_A_LIMIT, str(caught.value))


def test_perfectly_plastic_cells_in_a_row():
    """The seed is one of 1600 in which two of them flow in the same step."""
    strength = ub.distributions.Normal(300e6, 60e6, seed=1558)
    fibres = ub.Fibres(ub.ElastoPlastic(strength), number=4)
    section = ub.Section.rectangle(b=0.02, h=0.02, E=200e9, nu=0.3, fibres=fibres)
    beam = ub.Beam((0, 0), (1, 0), section, cells=4)
    held = [ub.PrescribedDisplacement(beam.at(k / 4), v=0.0, psi=0.0) for k in range(1, 4)]
    pulled = ub.PrescribedDisplacement(beam.end, u=lambda t: 0.008 * t, v=0.0, psi=0.0)
    words = "if they carry the same force, it does not determine which of them yields"
    assert words in str(failure(clamped(beam, pulled, *held), t=1, dt=0.25))


# -- limit loads -----------------------------------------------------------------------------------


@pytest.mark.parametrize("in_space", [False, True])
def test_no_limit_load_is_near_a_cantilever_that_is_rolled_up(in_space):
    """Its moment has turned the tip by 2 rad, when Newton's method may no longer iterate."""

    def vector(x, y):
        return (x, y, 0.0) if in_space else (x, y)

    rod = ub.Section.circle(d=0.02, E=210e9, nu=0.3, rho=7850.0)
    beam = ub.Beam(vector(0, 0), vector(1, 0), rod, cells=10)
    moment = (0.0, 0.0, 2 * rod.EI) if in_space else 2 * rod.EI
    load = ub.PointLoad(beam.end, force=vector(1.0, 0.0), moment=moment, amplitude=growing)
    simulation = ub.Simulation(clamped(beam, loads=[load]), ub.Static())
    simulation.keep()
    for k in range(20):
        simulation.step_to((k + 1) / 20)
    simulation.solver.c.most = 1
    with pytest.raises(ub.ConvergenceError, match="did not converge") as caught:
        simulation.step_to(1.5)
    assert not re.search(NEAR_A_LIMIT, str(caught.value))
    simulation.close()


def test_collapse_by_its_weight_is_a_limit_load():
    """P-Delta: the spring at the foot of a column hardens by 20 N m, the weight takes 50 N m."""
    # It yields at 5 N m = H l + P v: before, v = 5/100 (and 1.7 % of bending), so H = 2.5 N of 8.
    law = ub.Spring(100.0, ub.ElastoPlastic(5.0, isotropic=20.0))
    scene, turn = column_on(law, lambda c: ub.PointLoad(c.end, force=(0, -50)), push(8.0))
    error = failure(scene, t=1, dt=0.1)
    assert error.time == pytest.approx(2.5 / 8, rel=0.05)
    assert re.search(NEAR_A_LIMIT, str(error))
    assert f"singular; {turn} yields or softens; follow" in str(error)
    path = ub.follow(scene, ub.ArcLength(0.02), steps=40)
    assert path.factor.max() == pytest.approx(error.time, rel=1e-3)


def test_the_largest_moment_of_a_hinge_is_a_limit_load():
    """105 % of 4 N m at 0.04 + 0.1 rad; there the lever arm is 1 m times the cosine of 0.14 rad."""
    backbone = st.Backbone(4.0, capping=0.1, post_capping=0.2, overstrength=1.05)
    scene, turn = column_on(st.IbarraKrawinkler(100.0, backbone), push(8.0))
    error = failure(scene, t=1, dt=0.1)
    # the shaft bends by M/(2 EI) = 0.002 rad more; a substep is 1/4096 of 0.1 s
    assert error.time == pytest.approx(1.05 * 4.0 / math.cos(0.14) / 8, rel=1e-3)
    assert f"{turn} gives way" in str(error)
