# SPDX-License-Identifier: MIT
"""Time functions, and that loads do what they say: by the reactions that balance them."""

import math

import numpy as np
import pytest
from helpers import raises
from scenes import clamped

import ufl_beam as ub

SECTION = ub.Section(EA=1e4, GA=1e4, EI=100.0, rhoA=3.0, rhoI=0.1)
STIFF = ub.Section(EA=1e9, GA=1e9, EI=1e9, rhoA=3.0, rhoI=0.1)
"""Deflections of 1e-9 m: reactions are those of the undeformed beam to that part."""


def test_table_is_linear_between_and_constant_outside():
    times, values = np.array([1.0, 2, 4]), np.array([0.0, 10, -10])
    table = ub.Table(times, values)
    values[:] = 5.0  # which the table does not see
    at = [-1, 1, 1.5, 2, 3, 3.5, 4, 99]
    assert [table(t) for t in at] == [0, 0, 5, 10, 0, -5, -10, -10]  # exact in binary
    assert table == ub.Table((1, 2, 4), (0, 10, -10))
    assert ub.Table([1], [7])(-5) == ub.Table([1], [7])(5) == 7
    assert [ub.ramp(4.0)(t) for t in (-1, 0, 1, 4, 5)] == [0, 0, 0.25, 1, 1]


# -- reactions -------------------------------------------------------------------------------------

BEAM = ub.Beam((0, 0), (2, 0), STIFF, cells=4)
POINT = ub.PointLoad(BEAM.at(0.75), force=(5, -7), moment=11)
MASS = ub.PointMass(BEAM.end, 7.0, 99.0)


def reaction_of(beam, *loads, masses=()):
    """(F_x, F_y, M) of a clamp at the origin that holds a beam of 2 m along x."""
    scene = clamped(beam, loads=loads, masses=masses)
    return ub.simulate(scene, ub.Static(), t=(0, 1), dt=1.0).reaction(scene.supports[0])[-1]


def once(t):
    return 1.0


@pytest.mark.parametrize(
    ("loads", "expected"),
    [
        # The moment of a point load is 1.5 F_y + M.
        ([POINT], [-5, 7, 1.5 * 7 - 11]),
        # Not at a vertex of 4 regular cells; the moment is exact all the same.
        ([ub.PointLoad(BEAM.at(0.3), force=(0, -10))], [0, 10, 6]),
        # Resultants 6, -4 at mid-span and 10
        ([ub.LineLoad(BEAM, force=(3, -2), moment=5)], [-6, 4, 4 * 1 - 10]),
        # 6 kg at 1 m and 7 kg at 2 m; rotary inertia weighs nothing
        ([ub.Gravity((0.5, -10))], [-6.5, 130, 60 + 140]),
        # Loads of one time function and of several add up; the ramp is at a half.
        (
            [
                ub.PointLoad(BEAM.end, force=(1, 0), amplitude=once),
                ub.PointLoad(BEAM.end, force=(2, 0), amplitude=once),
                ub.PointLoad(BEAM.at(0.5), force=(4, 0)),
                ub.FollowerLoad(BEAM.end, force=(8, 0), amplitude=ub.ramp(2.0)),
            ],
            [-(1 + 2 + 4 + 8 / 2), 0, 0],
        ),
        # A profile also scales the moment.
        ([ub.LineLoad(BEAM, moment=5, span=(0.5, 1), profile=(1, 3))], [0, 0, -5 * 2 * 1.0]),
        # Gauss's rule with 4 points in 4 cells: (π/4)⁸ / 8! · 4!⁴ / (9 · 8!²) is below 1e-8
        (
            [ub.LineLoad(BEAM, (0, -3), profile=lambda s: math.sin(math.pi * s))],
            [0, 3 * 2 * 2 / math.pi, 3 * 2 * 2 / math.pi],
        ),
    ],
)
def test_a_reaction_balances_a_point_load(loads, expected):
    """And other loads."""
    reaction = reaction_of(BEAM, *loads, masses=[MASS])
    # 1e-7: deflections of this part of the length; see STIFF
    assert reaction == pytest.approx(expected, abs=1e-7 * np.abs(expected).max())


@pytest.mark.parametrize("degree", [1, 2, 3])
@pytest.mark.parametrize(
    ("load", "moment"),
    [
        ({"profile": lambda s: s}, lambda x: 20 * x - 5 * x**3),
        ({"profile": (1.0, -1.0)}, lambda x: 20 * x - 30 * x**2 + 10 * x**3),
        (
            {"span": (0.25, 0.75)},
            lambda x: 30 * x - 30 * np.maximum(x - 0.5, 0) ** 2 + 30 * np.maximum(x - 1.5, 0) ** 2,
        ),
        (
            {"span": (0.0, 0.5), "profile": (2.0, 0.0)},
            lambda x: 50 * x - 60 * x**2 + 20 * x**3 - 20 * np.maximum(x - 1.0, 0) ** 3,
        ),
    ],
)
def test_moments_under_a_load_with_a_profile_or_a_span(load, moment, degree):
    """[closed] A stiff beam of 2 m on two supports under a line load of 60 N/m downwards."""
    beam = ub.Beam((0, 0), (2, 0), STIFF, cells=5)
    supports = [ub.Pinned(beam.start), ub.Roller(beam.end)]
    scene = ub.Scene([beam], supports=supports, loads=[ub.LineLoad(beam, (0, -60), **load)])
    run = ub.simulate(scene, ub.Static(), t=(0, 1), dt=1, mesh=ub.Mesh(degree=degree))
    diagram = run.diagram(beam)
    expected = moment(2 * diagram.s)
    # 1e-7: rotations of the stiff beam, see STIFF
    assert pytest.approx(expected, abs=1e-7 * np.abs(expected).max()) == diagram.M


@pytest.mark.parametrize(
    ("wrong", "parts"),
    [
        ({"span": (0.2, 1.3)}, ["span = (0.2, 1.3) must be two parameters of the beam"]),
        ({"profile": 2.0}, ["profile = 2.0 must be a pair"]),
        ({"profile": lambda s: 1 / s if s else math.inf}, ["profile returned inf at s = 0"]),
    ],
)
def test_wrong_spans_and_profiles_are_refused(wrong, parts):
    with raises("LineLoad on beam", *parts, kind=ub.ModelError):
        ub.LineLoad(BEAM, force=(0, -1), **wrong)


def wave(s):
    return math.sin(5 * s)


@pytest.mark.parametrize("profile", [ub.Table([0.2, 0.4, 0.6], [0, 1, 0]), (1.0, 3.0), wave])
def test_a_load_with_a_profile_is_saved(profile, shared_path):
    load = ub.LineLoad(BEAM, (0, -60), span=(0.2, 0.6), profile=profile)
    ub.simulate(clamped(BEAM, loads=[load]), ub.Static(), t=(0, 1), dt=1).save(shared_path / "run")
    saved = ub.Solution.load(shared_path / "run").scene.loads[0]
    assert saved.span == load.span
    assert profile is wave or saved.profile == profile
    at = np.array([0.0, 0.25, 0.3, 0.6, 0.61])
    # 1001 values of a function of curvature 25, linear between them
    assert saved.factors(at) == pytest.approx(load.factors(at), abs=1e-6)


# -- dynamics --------------------------------------------------------------------------------------


def test_loads_in_dynamics_act_at_the_middle_of_the_step():
    # A free mass on a ramp: the momentum is the mid-point sum of the force, exact for linear ones.
    beam = ub.Beam((0, 0), (2, 0), SECTION, cells=2)
    push = [ub.LineLoad(beam, force=(3, 0), amplitude=lambda t: t)]
    solution = ub.simulate(ub.Scene([beam], loads=push), ub.EnergyMomentum(), t=(0, 2), dt=0.5)
    assert solution.momentum()[:, 0] == pytest.approx(3 * solution.times**2, rel=1e-9)


def test_weight_of_a_body_without_beams():
    """No cell bears a load."""
    body = ub.Body((0, 0), mass=2.0, inertia=1.0)
    scene = ub.Scene(bodies=[body], loads=[ub.Gravity()])
    run = ub.simulate(scene, ub.EnergyMomentum(), t=(0, 1), dt=0.1)
    assert run.position(body.middle)[-1] == pytest.approx([0, -9.81 / 2], abs=1e-9)


def test_work_of_follower_loads_among_many_entries():
    """The ledger needs more room after the loads have been made."""
    beam = ub.Beam((0, 0), (4, 0), SECTION, cells=4)
    load = ub.FollowerLoad(beam.end, force=(0.0, -2.0), amplitude=ub.ramp(0.3))
    works = [ub.VirtualWork(f"wind {k}", lambda w: 0.01 * w[1]) for k in range(20)]
    scene = clamped(beam, loads=[load], works=works)
    run = ub.simulate(scene, ub.EnergyMomentum(), t=(0.0, 0.5), dt=0.02)
    assert run.energy.supplied["loads"][-1] > 0.001
    assert run.energy.worst < 1e-9
