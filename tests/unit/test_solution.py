# SPDX-License-Identifier: MIT
"""What a solution answers: motions, forces, balances."""

import math

import numpy as np
import pytest
from helpers import raises
from scenes import SECTION, clamped

import ufl_beam as ub

EQUILIBRIUM = 1e-9
"""Forces to the tolerance of Newton's method, 1e-10 of those in the scene, which are below 10 kN
in the tests that say so."""


def cantilever(*loads, cells=4, **more):
    beam = ub.Beam((1, 1), (3, 1), SECTION, cells=cells, **more)
    scene = clamped(beam, loads=[load(beam) for load in loads])
    return scene, beam


def static(scene, steps=4, **more):
    return ub.simulate(scene, ub.Static(), t=(0, 1), dt=1 / steps, **more)


# -- motion --------------------------------------------------------------------------------------


def test_shapes_and_first_rows():
    scene, beam = cantilever(lambda b: ub.PointLoad(b.end, force=(0, -5), amplitude=ub.ramp(1)))
    solution = ub.simulate(scene, ub.EnergyMomentum(), t=(2, 3), dt=0.2)
    assert solution.times == pytest.approx([2, 2.2, 2.4, 2.6, 2.8, 3], abs=1e-15)
    assert solution.q.shape == solution.v.shape == (6, 15)
    assert solution.displacement(beam.end).shape == (6, 3)
    assert solution.velocity(beam.end).shape == (6, 3)
    assert solution.position(beam.end).shape == (6, 2)
    assert solution.reaction(scene.supports[0]).shape == (6, 3)
    assert solution.shape(beam).shape == (5, 2)
    assert solution.section_forces(beam).shape == (4, 3)
    assert solution.section_forces_at(beam.end).shape == (6, 3)
    assert solution.momentum().shape == (6, 3)
    assert (solution.displacement(beam.end)[0] == 0).all()
    assert (solution.velocity(beam.end)[0] == 0).all()
    assert (solution.position(beam.end)[0] == (3, 1)).all()
    assert (solution.section_forces(beam, 0) == 0).all()
    # No step came before, so no force is known
    assert np.isnan(solution.reaction(scene.supports[0])[0]).all()
    assert np.isfinite(solution.reaction(scene.supports[0])[1:]).all()


@pytest.mark.parametrize("n", [5, -6])
def test_a_state_that_does_not_exist_is_named(n):
    scene, beam = cantilever()
    solution = static(scene)
    for ask in (solution.section_forces, solution.diagram, solution.strains):
        with raises(f"n = {n}: the solution kept 5 times; give -5 to 4"):
            ask(beam, n=n)


def test_the_last_step_arrives():
    # 1 / 0.3 is no whole number: steps are a little shorter
    scene, _ = cantilever()
    assert ub.simulate(scene, ub.EnergyMomentum(), t=(0, 1), dt=0.3).times == pytest.approx(
        [0, 0.25, 0.5, 0.75, 1]
    )
    # 0.3 / 0.1 is 2.9999999999999996: three steps, not four
    assert len(ub.simulate(scene, ub.EnergyMomentum(), t=(0, 0.3), dt=0.1).times) == 4
    assert len(ub.simulate(scene, ub.EnergyMomentum(), t=(0, 1), dt=10.0).times) == 2


def test_displacement_is_linear_between_vertices():
    scene, beam = cantilever(lambda b: ub.PointLoad(b.end, force=(3, -20)))
    solution = static(scene)
    left, right = solution.displacement(beam.at(0.25)), solution.displacement(beam.at(0.5))
    between = solution.displacement(beam.at(0.3))
    assert np.abs(between - (0.8 * left + 0.2 * right)).max() < 1e-15
    assert np.abs(solution.displacement(beam.start)).max() == 0
    assert (solution.shape(beam)[2] == solution.position(beam.at(0.5))[-1]).all()
    assert (solution.shape(beam, 0)[:, 1] == 1).all()


def test_small_displacement_is_that_of_the_table_book():
    # F L^3 / 3 EI + F L / GA with F = 1e-4 N, nonlinear by the square of 1e-6; linear cells with
    # one point are exact at the nodes up to F L h^2 / 12 EI
    F, L, h = 1e-4, 2.0, 0.5
    scene, beam = cantilever(lambda b: ub.PointLoad(b.end, force=(0, F)))
    u, v, ψ = static(scene, 1).displacement(beam.end)[-1]
    assert ψ == pytest.approx(F * L**2 / 200, rel=1e-7)
    assert v == pytest.approx(F * L**3 / 300 - F * L * h**2 / 1200 + F * L / 1e4, rel=1e-7)
    assert abs(u) < 1e-11


def test_a_stiff_beam_rotates_rigidly():
    """A stiff beam driven at its start: position, rotation and velocity on the circle."""
    stiff = ub.Section(EA=1e9, GA=1e9, EI=1e9, rhoA=1.0, rhoI=1.0)
    beam = ub.Beam((1, 1), (3, 1), stiff, cells=2)

    def turn(t):
        return t**2

    scene = ub.Scene([beam], supports=[ub.PrescribedDisplacement(beam.start, u=0, v=0, psi=turn)])
    solution = ub.simulate(scene, ub.EnergyMomentum(0.1, 0.1), t=(0, 1), dt=0.01)
    t = solution.times
    circle = np.column_stack([1 + 2 * np.cos(turn(t)), 1 + 2 * np.sin(turn(t))])
    # Strains are forces over stiffness, 10 / 1e9
    assert np.abs(solution.position(beam.end) - circle).max() < 1e-7
    assert np.abs(solution.displacement(beam.end)[:, 2] - turn(t)).max() < 1e-7
    # Velocities are of first order with the numerical loss
    ω = 2 * t
    along = np.column_stack([-2 * np.sin(turn(t)), 2 * np.cos(turn(t))]) * ω[:, None]
    assert np.abs(solution.velocity(beam.end)[:, :2] - along).max() < 0.05
    assert np.abs(solution.velocity(beam.end)[-1, 2] - 2) < 0.02


# -- forces --------------------------------------------------------------------------------------


def frame():
    a = ub.Beam((0, 0), (0, 4), SECTION, cells=3)
    b = ub.Beam((0, 4), (3, 4), SECTION, cells=4)
    c = ub.Beam((3, 4), (3, 0), SECTION, cells=3)
    return ub.Scene(
        [a, b, c],
        joints=[ub.Rigid(a.end, b.start), ub.Revolute(b.end, c.start)],
        supports=[
            ub.Clamped(a.start),
            ub.Roller(c.end, along=(2, 1)),
            ub.PrescribedDisplacement(b.at(0.5), psi=0),
        ],
        loads=[
            ub.PointLoad(b.start, force=(5, -2), moment=3.0),
            ub.LineLoad(b, force=(0, -1), moment=0.5),
            ub.Gravity((1.0, -2.0)),
        ],
        masses=[ub.PointMass(c.start, 4.0)],
    )


def test_reactions_balance_the_loads():
    """Forces, and moments about the origin in the deformed state."""
    scene = frame()
    a, b, c = scene.beams
    solution = static(scene)
    assert np.abs(solution.displacement(b.start)[-1]).max() > 0.05  # not the undeformed state

    def moment(place, force):
        x, y = solution.position(place)[-1]
        return np.array([*force[:2], x * force[1] - y * force[0] + force[2]])

    total = np.zeros(3)
    for support in scene.supports:
        total += moment(support.place, solution.reaction(support)[-1])
    total += moment(b.start, [5, -2, 3.0])
    total += moment(c.start, [4 * 1.0, 4 * -2.0, 0])
    for beam, line, cells in ((a, (0, 0, 0), 3), (b, (0, -1, 0.5), 4), (c, (0, 0, 0), 3)):
        length = 3.0 if beam is b else 4.0
        f = np.add(line, (1.0 * 1.0, 1.0 * -2.0, 0))  # the line load and 1 kg/m of weight
        for i in range(cells):  # half of a cell's load at each of its ends
            for s in (i / cells, (i + 1) / cells):
                total += moment(beam.at(s), f * length / cells / 2)
    assert np.abs(total).max() < 1e-7  # 1e-10 of forces of some 100 N, on 4 m


def test_reactions_are_of_the_kind_of_the_support():
    scene = frame()
    solution = static(scene)
    clamp, roller, turn = (solution.reaction(support)[1:] for support in scene.supports)
    assert np.abs(clamp).min() > 1e-2
    # Across (2, 1), without moment; and a moment alone
    assert np.abs(roller[:, :2] @ [2, 1]).max() < 1e-12 * np.abs(roller).max()
    assert np.abs(roller[:, :2] @ [-1, 2]).min() > 1e-2
    assert (roller[:, 2] == 0).all()
    assert (turn[:, :2] == 0).all()
    assert np.abs(turn[:, 2]).min() > 1e-2


def test_no_supports_no_reactions():
    beam = ub.Beam((0, 0), (1, 0), SECTION, cells=2)
    solution = ub.simulate(ub.Scene([beam]), ub.EnergyMomentum(), t=(0, 1), dt=0.5)
    with pytest.raises(
        ub.ArgumentError, match=r"reaction: Clamped at beam.end .* is not in the scene"
    ):
        solution.reaction(ub.Clamped(beam.end))


def test_reaction_drives_the_momentum():
    """In dynamics a reaction acts during the step that ends at its time."""
    scene, _ = cantilever(
        lambda b: ub.PointLoad(b.end, force=(2, -8), amplitude=lambda t: math.cos(t))
    )
    solution = ub.simulate(scene, ub.EnergyMomentum(), t=(0, 1), dt=0.05)
    t = solution.times
    forces = solution.reaction(scene.supports[0])[1:, :2] + np.outer(
        np.cos((t[1:] + t[:-1]) / 2), [2, -8]
    )
    change = np.diff(solution.momentum()[:, :2], axis=0)
    assert np.abs(change - 0.05 * forces).max() < EQUILIBRIUM


def test_section_forces_balance_an_end_load():
    """A straight cut through the deformed beam: N, V in its turned frame, M by the arm."""
    force = np.array([3.0, -40.0])
    scene, beam = cantilever(lambda b: ub.PointLoad(b.end, force=tuple(force)), cells=8)
    solution = static(scene)
    N, V, M = solution.section_forces(beam).T
    ψ = solution.displacement(beam.start)[-1, 2]
    turns = np.array([solution.displacement(beam.at(i / 8))[-1, 2] for i in range(9)])
    shape = solution.shape(beam)
    assert abs(turns[-1]) > 0.3  # a large rotation
    for i in range(8):
        ψ = (turns[i] + turns[i + 1]) / 2
        t, n = np.array([math.cos(ψ), math.sin(ψ)]), np.array([-math.sin(ψ), math.cos(ψ)])
        assert N[i] == pytest.approx(force @ t, abs=1e-7)  # 1e-10 of internal forces of 100 N
        assert V[i] == pytest.approx(force @ n, abs=1e-7)
        arm = shape[-1] - (shape[i] + shape[i + 1]) / 2
        assert M[i] == pytest.approx(arm[0] * force[1] - arm[1] * force[0], abs=1e-7)


def test_section_forces_in_any_direction():
    """N positive in tension; V along the left normal of the way from start to end."""
    for angle in (0.0, 1.0, 2.5, -2.0):
        t = np.array([math.cos(angle), math.sin(angle)])
        n = np.array([-t[1], t[0]])
        beam = ub.Beam((0, 0), tuple(2 * t), SECTION, cells=4)
        force = 1e-3 * t + 2e-3 * n  # deflections of 1e-5 m
        load = ub.PointLoad(beam.end, force=tuple(force))
        solution = static(clamped(beam, loads=[load]), 1)
        N, V, M = solution.section_forces(beam).T
        assert pytest.approx(4 * [1e-3], rel=1e-3) == N
        assert pytest.approx(4 * [2e-3], rel=1e-3) == V
        assert pytest.approx(2e-3 * np.array([1.75, 1.25, 0.75, 0.25]), rel=1e-3) == M


def test_section_forces_of_the_right_beam():
    scene = frame()
    solution = static(scene)
    a, b, c = scene.beams
    # The roller alone holds the right post from below, and its axis is along y
    reaction = solution.reaction(scene.supports[1])[-1]
    ψ = np.mean([solution.displacement(c.at(s))[-1, 2] for s in (2 / 3, 1)])
    # On the last cell act the reaction, half of its weight, and what the cell before holds
    axis = np.array([math.sin(ψ), -math.cos(ψ)])
    lower_half = reaction[:2] + np.array([1.0, -2.0]) * 4 / 3 / 2
    assert solution.section_forces(c)[-1, 0] == pytest.approx(lower_half @ axis, abs=1e-7)
    assert [len(solution.section_forces(beam)) for beam in (a, b, c)] == [3, 4, 3]


# -- balances ------------------------------------------------------------------------------------


def test_momentum_of_known_motions():
    # 6 kg in free flight: p = m v, L = J ω + x × p with the consistent mass of linear cells
    beam = ub.Beam((0, 0), (2, 0), ub.Section(EA=1e9, GA=1e9, EI=1e9, rhoA=3.0, rhoI=0.5), cells=3)
    throw = ub.Velocity([beam], linear=(2, 3), angular=0.5, about=(1, 0))
    scene = ub.Scene([beam], masses=[ub.PointMass(beam.end, 4.0, 0.25)], initial=[throw])
    solution = ub.simulate(scene, ub.EnergyMomentum(), t=(0, 0.1), dt=0.1)
    p_x, p_y, L = solution.momentum()[0]
    v_end = (2.0, 3.0 + 0.5)
    assert p_x == pytest.approx(6 * 2 + 4 * v_end[0], rel=1e-14)
    assert p_y == pytest.approx(6 * 3 + 4 * v_end[1], rel=1e-14)
    # Beam: rhoI L ω + rhoA L^3 / 12 ω about its middle (the mass matrix is exact), + m x v
    spin = 0.5 * (0.5 * 2 + 3 * 8 / 12) + 6 * 1 * 3
    assert pytest.approx(spin + 4 * 2 * v_end[1] + 0.25 * 0.5, rel=1e-14) == L


def test_a_solution_can_be_read():
    scene, _ = cantilever()
    text = str(ub.simulate(scene, ub.EnergyMomentum(), t=(0, 1), dt=0.5))
    for part in (
        "1 beam",
        "4 cells, 15 degrees of freedom",
        "t = 0 to 1 s in 2 steps",
        "imbalance",
    ):
        assert part in text


def test_joined_places_move_alike():
    scene = frame()
    a, b, c = scene.beams
    solution = static(scene)
    assert (solution.displacement(a.end) == solution.displacement(b.start)).all()
    one, other = solution.displacement(b.end), solution.displacement(c.start)
    assert (one[:, :2] == other[:, :2]).all()
    assert abs(one[-1, 2] - other[-1, 2]) > 1e-3


def test_solutions_are_copies():
    """Nothing that a user does to the arrays changes the solution."""
    scene, beam = cantilever(lambda b: ub.PointLoad(b.end, force=(0, -1)))
    solution = static(scene)
    before = solution.displacement(beam.end)
    solution.q[:] = 7.0
    solution.displacement(beam.end)[:] = 7.0
    assert (solution.displacement(beam.end) == before).all()
    assert (before[1:-1] != before[2:]).any()  # and each time has its own
