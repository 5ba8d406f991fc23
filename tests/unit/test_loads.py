# SPDX-License-Identifier: MIT
"""Time functions, and that loads do what they say: by the reactions that balance them."""

import math
from itertools import pairwise

from mpi4py import MPI

import numpy as np
import pytest
from scenes import clamped

import ufl_beam as ub

SECTION = ub.Section(EA=1e4, GA=1e4, EI=100.0, rhoA=3.0, rhoI=0.1)
STIFF = ub.Section(EA=1e9, GA=1e9, EI=1e9, rhoA=3.0, rhoI=0.1)
"""Deflections of 1e-9 m: reactions are those of the undeformed beam to that part."""


def test_table_is_linear_between_and_constant_outside():
    table = ub.Table([1, 2, 4], [0, 10, -10])
    times = [-1, 1, 1.5, 2, 3, 3.5, 4, 99]
    assert [table(t) for t in times] == [0, 0, 5, 10, 0, -5, -10, -10]  # exact in binary


def test_table_of_one_point_is_constant():
    assert ub.Table([1], [7])(-5) == ub.Table([1], [7])(5) == 7


def test_table_keeps_what_it_was_given():
    times, values = np.array([0.0, 1.0]), np.array([0.0, 1.0])
    table = ub.Table(times, values)
    values[1] = 5.0
    assert table(1.0) == 1.0


def test_equal_tables_are_equal():
    assert ub.Table([0, 1], [0, 1]) == ub.Table((0, 1), (0, 1))


def test_a_ramp_grows_and_stays():
    ramp = ub.ramp(4.0)
    assert [ramp(t) for t in (-1, 0, 1, 4, 5)] == [0, 0, 0.25, 1, 1]


def reaction_of(*loads, masses=(), section=STIFF, at=1.0):
    """(F_x, F_y, M) of a clamp at the origin that holds a beam of 2 m along x."""
    beam = ub.Beam((0, 0), (2, 0), section, cells=4)
    scene = clamped(
        beam, loads=[load(beam) for load in loads], masses=[mass(beam) for mass in masses]
    )
    solution = ub.simulate(scene, ub.Static(), t=(0, at), dt=at)
    return solution.reaction(scene.supports[0])[-1]


def check(reaction, expected):
    # 1e-7: deflections of this part of the length; see STIFF
    assert reaction == pytest.approx(expected, abs=1e-7 * np.abs(expected).max())


def test_a_reaction_balances_a_point_load():
    def load(b):
        return ub.PointLoad(b.at(0.75), force=(5, -7), moment=11)

    # The reaction balances: -F, and the moment -(1.5 * F_y + M)
    check(reaction_of(load), [-5, 7, 1.5 * 7 - 11])


def test_a_reaction_balances_a_line_load():
    def load(b):
        return ub.LineLoad(b, force=(3, -2), moment=5)

    # Resultants 6, -4 at mid-span and 10
    check(reaction_of(load), [-6, 4, 4 * 1 - 10])


def test_gravity_weighs_beams_and_point_masses():
    def gravity(b):
        return ub.Gravity((0.5, -10))

    def mass(b):
        return ub.PointMass(b.end, 7.0, 99.0)

    # 6 kg at 1 m and 7 kg at 2 m; rotary inertia weighs nothing
    check(reaction_of(gravity, masses=[mass]), [-6.5, 130, 60 + 140])


def test_follower_load_turns():
    # At the tip of a beam bent by an end moment M into the angle M L / EI = 1; the follower is
    # 1e-6 of it and bends by 1e-6 L: its reaction is minus the force, turned by 1 rad.
    def bend(b):
        return ub.PointLoad(b.end, moment=50.0)

    def follow(b):
        return ub.FollowerLoad(b.end, force=(1e-5, 0.0))

    reaction = reaction_of(bend, follow, section=SECTION)
    expected = [-1e-5 * math.cos(1), -1e-5 * math.sin(1)]
    assert reaction[:2] == pytest.approx(expected, abs=1e-5 * 1e-5)


def test_loads_of_one_time_function_and_of_several_add_up():
    def once(t):
        return 1.0

    loads = [
        lambda b: ub.PointLoad(b.end, force=(1, 0), amplitude=once),
        lambda b: ub.PointLoad(b.end, force=(2, 0), amplitude=once),
        lambda b: ub.PointLoad(b.at(0.5), force=(4, 0)),
        lambda b: ub.FollowerLoad(b.end, force=(8, 0), amplitude=ub.ramp(2.0)),
    ]
    check(reaction_of(*loads), [-(1 + 2 + 4 + 8 / 2), 0, 0])  # the ramp is at a half


def test_a_load_where_nothing_else_is_makes_a_vertex():
    # Not at a vertex of 4 regular cells; the moment is exact all the same.
    check(reaction_of(lambda b: ub.PointLoad(b.at(0.3), force=(0, -10))), [0, 10, 6])


def test_loads_in_dynamics_act_at_the_middle_of_the_step():
    # A free mass on a ramp: the momentum is the mid-point sum of the force, exact for linear ones.
    beam = ub.Beam((0, 0), (2, 0), SECTION, cells=2)
    push = [ub.LineLoad(beam, force=(3, 0), amplitude=lambda t: t)]
    solution = ub.simulate(ub.Scene([beam], loads=push), ub.EnergyMomentum(), t=(0, 2), dt=0.5)
    assert solution.momentum()[:, 0] == pytest.approx(3 * solution.times**2, rel=1e-9)


@pytest.mark.parametrize("joint", [ub.Rigid, ub.Revolute])
@pytest.mark.parametrize("load", [ub.PointLoad, ub.FollowerLoad])
def test_loads_at_joints_between_processes(joint, load):
    """Six beams of one cell: some joint lies between the cells of 2, 3, ... processes.

    There displacements and rotation of a place may belong to different ones.
    """
    beams = [ub.Beam((i, 0), (i + 1, 0), SECTION, cells=1) for i in range(6)]
    scene = ub.Scene(
        beams,
        joints=[joint(a.end, b.start) for a, b in pairwise(beams)],
        loads=[load(b.start, force=(1, i + 2), moment=-i) for i, b in enumerate(beams)],
        masses=[ub.PointMass(b.start, i, i) for i, b in enumerate(beams)],
    )
    all_of_us, alone = (
        ub.simulate(scene, ub.EnergyMomentum(), t=(0, 1), dt=0.1, comm=comm)
        for comm in (MPI.COMM_WORLD, MPI.COMM_SELF)
    )
    assert np.abs(alone.q[-1]).max() > 0.1
    assert np.abs(all_of_us.q - alone.q).max() < 1e-9  # Newton's tolerance, on motions of 1 m
    # Whatever the joints do, the momentum is the impulse: (6, 2 + ... + 7) N for 1 s
    if load is ub.PointLoad:
        assert all_of_us.momentum()[-1, :2] == pytest.approx([6, 27], rel=1e-9)


def test_work_of_follower_loads_among_many_entries():
    """The ledger needs more room after the loads have been made."""
    beam = ub.Beam((0, 0), (4, 0), SECTION, cells=4)
    load = ub.FollowerLoad(beam.end, force=(0.0, -2.0), amplitude=ub.ramp(0.3))

    def lift(w):
        return 0.01 * w[1]

    works = [ub.VirtualWork(f"wind {k}", lift) for k in range(20)]
    scene = clamped(beam, loads=[load], works=works)
    run = ub.simulate(scene, ub.EnergyMomentum(), t=(0.0, 0.5), dt=0.02)
    assert run.energy.supplied["loads"][-1] > 0.001
    assert run.energy.worst < 1e-9


# -- line loads on a part of a beam, and with a profile -------------------------------------------


def on_two_supports(degree=1, **load):
    """A stiff beam of 2 m on two supports under a line load of 60 N/m downwards, in statics."""
    beam = ub.Beam((0, 0), (2, 0), STIFF, cells=5)
    supports = [ub.Pinned(beam.start), ub.Roller(beam.end)]
    scene = ub.Scene([beam], supports=supports, loads=[ub.LineLoad(beam, force=(0, -60), **load)])
    return ub.simulate(scene, ub.Static(), t=(0, 1), dt=1, mesh=ub.Mesh(degree=degree)), beam


@pytest.mark.parametrize("degree", [1, 2, 3])
@pytest.mark.parametrize(
    ("load", "moment"),
    [
        ({"profile": (0.0, 1.0)}, lambda x: 20 * x - 5 * x**3),
        ({"profile": lambda s: s}, lambda x: 20 * x - 5 * x**3),
        ({"profile": (1.0, -1.0)}, lambda x: 20 * x - 30 * x**2 + 10 * x**3),
        (
            {"span": (0.25, 0.75)},
            lambda x: 30 * x - 30 * np.maximum(x - 0.5, 0) ** 2 + 30 * np.maximum(x - 1.5, 0) ** 2,
        ),
        (
            {"span": (0.0, 0.5), "profile": (2.0, 0.0)},
            lambda x: 50 * x - 60 * x**2 + 20 * x**3,
        ),
    ],
)
def test_moments_under_a_load_with_a_profile_or_a_span(load, moment, degree):
    run, beam = on_two_supports(degree, **load)
    diagram = run.diagram(beam)
    x = 2 * diagram.s
    inside = x <= 1.0 if load.get("span") == (0.0, 0.5) else x <= 2.0
    expected = moment(x)
    # 1e-7: rotations of the stiff beam, see STIFF
    assert diagram.M[inside] == pytest.approx(expected[inside], abs=1e-7 * np.abs(expected).max())


def test_a_smooth_profile_has_the_reactions_of_its_integral():
    wave = reaction_of(lambda b: ub.LineLoad(b, (0, -3), profile=lambda s: math.sin(math.pi * s)))
    total = 3 * 2 * 2 / math.pi
    # Gauss's rule with 4 points in 4 cells: (π/4)⁸ / 8! · 4!⁴ / (9 · 8!²) is below 1e-8
    assert wave == pytest.approx([0, total, total], abs=1e-7 * total)


def test_a_profile_also_scales_the_moment():
    couple = reaction_of(lambda b: ub.LineLoad(b, moment=5, span=(0.5, 1), profile=(1, 3)))
    check(couple, [0, 0, -5 * 2 * 1.0])


def test_two_halves_are_a_whole():
    """In large motion, on any number of processes."""
    beam = ub.Beam((0, 0), (2, 0), SECTION, cells=6)
    push = ub.Table([0, 0.2, 0.4], [0, 1, 0])
    runs = []
    for spans in ([(0, 1)], [(0, 0.5), (0.5, 1)]):
        loads = [ub.LineLoad(beam, (5, -90), 3.0, push, span=span) for span in spans]
        scene = ub.Scene([beam], supports=[ub.Pinned(beam.start)], loads=loads)
        runs.append(ub.simulate(scene, ub.EnergyMomentum(), t=(0, 1), dt=0.02))
    whole, halves = runs
    assert np.abs(whole.q[-1]).max() > 0.5
    assert np.abs(whole.q - halves.q).max() < 1e-9  # Newton's tolerance
    assert whole.energy.worst < 1e-9


def wave(s):
    return math.sin(5 * s)


@pytest.mark.parametrize("profile", [ub.Table([0.2, 0.4, 0.6], [0, 1, 0]), (1.0, 3.0), wave])
def test_a_load_with_a_profile_is_saved(profile, tmp_path):
    load = {"span": (0.2, 0.6), "profile": profile}
    run, beam = on_two_supports(**load)
    path = MPI.COMM_WORLD.bcast(tmp_path) / "run.npz"
    run.save(path)
    loaded = ub.Solution.load(path)
    saved = loaded.scene.loads[0]
    assert saved.span == load["span"]
    if profile is not wave:
        assert saved.profile == profile
    with_functions = ub.Solution.load(path, scene=run.scene)
    np.testing.assert_array_equal(with_functions.diagram(beam).M, run.diagram(beam).M)
    at = np.array([0.0, 0.25, 0.3, 0.6, 0.61])
    # 1001 values of a function of curvature 25, linear between them
    assert saved.factors(at) == pytest.approx(run.scene.loads[0].factors(at), abs=1e-6)
    np.testing.assert_array_equal(loaded.diagram(loaded.scene.beams[0]).M, run.diagram(beam).M)


@pytest.mark.parametrize(
    ("wrong", "message"),
    [
        ({"span": (0.2, 1.3)}, r"span = \(0.2, 1.3\) must be two parameters of the beam"),
        ({"span": (0.6, 0.2)}, "0 <= first < last <= 1"),
        ({"span": (0.5, 0.5)}, "0 <= first < last <= 1"),
        ({"span": 0.5}, "span = 0.5 must be a pair"),
        ({"profile": 2.0}, "profile = 2.0 must be a pair"),
        ({"profile": (1.0, math.nan)}, r"profile\[1\]"),
        ({"profile": lambda s: 1 / s if s else math.inf}, "profile returned inf at s = 0"),
        ({"profile": lambda s: "much"}, "profile returned 'much' at s = 0"),
    ],
)
def test_wrong_spans_and_profiles_are_refused(wrong, message):
    beam = ub.Beam((0, 0), (2, 0), STIFF)
    with pytest.raises(ub.ModelError, match="LineLoad on beam.*" + message):
        ub.LineLoad(beam, force=(0, -1), **wrong)


def test_weight_of_a_body_without_beams():
    """No cell bears a load."""
    body = ub.Body((0, 0), mass=2.0, inertia=1.0)
    scene = ub.Scene(bodies=[body], loads=[ub.Gravity()])
    run = ub.simulate(scene, ub.EnergyMomentum(), t=(0, 1), dt=0.1)
    assert run.position(body.middle)[-1] == pytest.approx([0, -9.81 / 2], abs=1e-9)


@pytest.mark.parametrize("degree", [1, 2])
def test_a_path_its_envelope_and_its_reactions_agree(degree):
    """Under a load with a profile on a part of a beam, which bends far."""
    beam = ub.Beam((0, 0), (2, 0), SECTION, cells=6)
    load = ub.LineLoad(
        beam, (0, -50), span=(0.3, 0.8), profile=lambda s: (s - 0.3) * (0.8 - s),
        amplitude=lambda t: t,
    )  # fmt: skip
    scene, extremes = clamped(beam, loads=[load]), ub.Extremes(points=3)
    control, mesh = ub.DisplacementControl(beam.end, "v", -0.2), ub.Mesh(degree=degree)
    path = ub.follow(scene, control, steps=5, record=extremes, mesh=mesh)
    total = 50 * 2 * 0.5**3 / 6 * path.times
    assert path.displacement(beam.end)[-1, 1] == pytest.approx(-1.0, rel=1e-9)
    assert path.reaction(scene.supports[0])[:, 1] == pytest.approx(total, abs=1e-9 * total[-1])
    M = np.array([path.diagram(beam, n, points=3).M for n in range(len(path.times))])
    recorded = extremes.section_forces(beam)
    np.testing.assert_allclose(recorded.low[..., 2].ravel(), M.min(axis=0), atol=1e-12)
    np.testing.assert_allclose(recorded.high[..., 2].ravel(), M.max(axis=0), atol=1e-12)
