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
    clamp, rows = scene.supports[0], len(solution.times)
    assert solution.times == pytest.approx([2, 2.2, 2.4, 2.6, 2.8, 3], abs=1e-15)
    assert solution.q.shape == solution.v.shape == (rows, 15)
    assert solution.shape(beam).shape == (5, 2)
    assert solution.section_forces(beam).shape == (4, 3)
    assert solution.position(beam.end).shape == (rows, 2)
    end = solution.displacement(beam.end), solution.velocity(beam.end)
    others = solution.reaction(clamp), solution.section_forces_at(beam.end), solution.momentum()
    assert {values.shape for values in (*end, *others)} == {(rows, 3)}
    assert (np.array(end)[:, 0] == 0).all()
    assert (solution.position(beam.end)[0] == (3, 1)).all()
    assert (solution.section_forces(beam, 0) == 0).all()
    # No step came before, so no force is known
    assert np.isnan(solution.reaction(clamp)[0]).all()
    assert np.isfinite(solution.reaction(clamp)[1:]).all()


@pytest.mark.parametrize("n", [5, -6])
def test_a_state_that_does_not_exist_is_named(n):
    scene, beam = cantilever()
    solution = static(scene)
    for ask in (solution.section_forces, solution.diagram, solution.strains):
        with raises(f"n = {n}: the solution kept 5 times; give -5 to 4"):
            ask(beam, n=n)


@pytest.mark.parametrize(
    ("end", "dt", "steps"),
    [(1, 0.3, 4), (0.3, 0.1, 3), (1, 10.0, 1)],  # 0.3 / 0.1 is 2.9999999999999996
)
def test_the_last_step_arrives(end, dt, steps):
    """Steps are a little shorter if their number would not be whole."""
    scene, _ = cantilever()
    times = ub.simulate(scene, ub.EnergyMomentum(), t=(0, end), dt=dt).times
    assert times == pytest.approx(np.linspace(0, end, steps + 1))


def test_displacement_is_linear_between_vertices():
    scene, beam = cantilever(lambda b: ub.PointLoad(b.end, force=(3, -20)))
    solution = static(scene)
    left, right = solution.displacement(beam.at(0.25)), solution.displacement(beam.at(0.5))
    between = solution.displacement(beam.at(0.3))
    assert np.abs(between - (0.8 * left + 0.2 * right)).max() < 1e-15
    assert np.abs(solution.displacement(beam.start)).max() == 0
    assert (solution.shape(beam)[2] == solution.position(beam.at(0.5))[-1]).all()
    assert (solution.shape(beam, 0)[:, 1] == 1).all()


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
    )


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


def test_joined_places_move_alike():
    scene = frame()
    a, b, c = scene.beams
    solution = static(scene)
    assert (solution.displacement(a.end) == solution.displacement(b.start)).all()
    one, other = solution.displacement(b.end), solution.displacement(c.start)
    assert (one[:, :2] == other[:, :2]).all()
    assert abs(one[-1, 2] - other[-1, 2]) > 1e-3
    assert [len(solution.section_forces(beam)) for beam in (a, b, c)] == [3, 4, 3]


# -- balances ------------------------------------------------------------------------------------


def test_a_solution_can_be_read():
    scene, _ = cantilever()
    text = str(ub.simulate(scene, ub.EnergyMomentum(), t=(0, 1), dt=0.5))
    said = "1 beam", "4 cells, 15 degrees of freedom", "t = 0 to 1 s in 2 steps", "imbalance"
    assert all(part in text for part in said)


def test_solutions_are_copies():
    """Nothing that a user does to the arrays changes the solution."""
    scene, beam = cantilever(lambda b: ub.PointLoad(b.end, force=(0, -1)))
    solution = static(scene)
    before = solution.displacement(beam.end)
    solution.q[:] = 7.0
    solution.displacement(beam.end)[:] = 7.0
    assert (solution.displacement(beam.end) == before).all()
    assert (before[1:-1] != before[2:]).any()  # and each time has its own
