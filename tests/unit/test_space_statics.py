# SPDX-License-Identifier: MIT
"""Statics in space with large rotations in a step: roll-up, a bent arc, works, restart."""

import numpy as np
import pytest
from into_space import same_in_space
from scipy.spatial.transform import Rotation
from test_space import OTHER, PLANAR, STIFF, bend

import ufl_beam as ub

SKEW = np.array([0.0, 0.6, 0.8])


def statics(scene, dt=1.0, **more):
    return ub.simulate(scene, ub.Static(), **({"t": (0, 1)} | more), dt=dt)


def rolled(turns, load=ub.PointLoad, cells=8, amplitude=lambda t: t):
    """A cantilever that a moment about a skew axis rolls up."""
    section = ub.Section(EA=1e6, GA=5e5, GA3=5e5, EI=1.0, EI2=1.0, GJ=1.0)
    beam = ub.Beam((0, 0, 0), (1, 0, 0), section, cells=cells)
    moment = load(beam.end, moment=tuple(2 * np.pi * turns * SKEW), amplitude=amplitude)
    return ub.Scene([beam], supports=[ub.Clamped(beam.start)], loads=[moment])


@pytest.mark.parametrize("load", [ub.PointLoad, ub.FollowerLoad])
@pytest.mark.parametrize("steps", [1, 2, 3])
@pytest.mark.parametrize("turns", [0.25, 0.5, 0.75, 1.0, 1.5, 2.0])
def test_roll_up_of_any_number_of_turns(turns, steps, load):
    """[closed] A polygon of equal angles, one step for each load step, and works M Ψ / 2.

    The strains are linear in the load, so that two iterations find the step but for round-off.
    """
    n, scene = 8, rolled(turns, load)
    run = statics(scene, 1 / steps)
    assert run.substeps == steps
    assert run.iterations <= 5 * steps
    angles = 2 * np.pi * turns * (np.arange(n) + 0.5) / n
    ahead = np.array([np.cos(angles).sum(), np.sin(angles).sum()]) / n
    tip = run.position(scene.beams[0].end)[-1]
    assert np.abs(tip - [ahead[0], *(ahead[1] * np.cross(SKEW, [1, 0, 0])[1:])]).max() < 1e-9
    energy = (2 * np.pi * turns) ** 2 / 2
    supplied = run.energy["loads"][-1]
    assert np.allclose(supplied, energy, rtol=1e-9)
    assert np.abs(run.energy.imbalance).max() < 1e-9 * energy


def test_an_arc_bends_in_few_iterations():
    """Load steps of 150 and 100 take at most 5 iterations, as many as a separate program takes."""
    for steps in (4, 6):
        run = statics(bend(8), 1 / steps)
        assert run.substeps == steps
        assert run.iterations <= 5 * steps
    whole = statics(bend(8))  # the check of works divides this step
    tips = [x.position(x.scene.beams[0].end)[-1] for x in (run, whole)]
    assert np.abs(tips[0] - tips[1]).max() < 1e-7


def test_large_planar_steps_are_the_same_in_space():
    """To round-off in a turned plane, with a driven root, moments, a follower and a spring."""
    one = ub.Beam((0, 0), (4, 1), PLANAR, cells=6)
    two = ub.Beam((4, 1), (7, -1), PLANAR, cells=4)
    loads = [
        ub.FollowerLoad(two.end, force=(0, 5), moment=60.0, amplitude=lambda t: t),
        ub.PointLoad(one.at(0.5), force=(1, -2), moment=60.0, amplitude=lambda t: t),
    ]  # fmt: skip
    frame = ub.Scene(
        [one, two], joints=[ub.Rigid(one.end, two.start)], loads=loads,
        supports=[ub.PrescribedDisplacement(one.start, u=0, v=0, psi=lambda t: 2.2 * t)],
        connectors=[ub.Turn(one.start, two.end, ub.Spring(30.0))],
    )  # fmt: skip
    same_in_space(frame, ub.Static(), dt=0.25, forces=True, tolerance=1e-9)


def test_works_are_of_second_order_and_ledgers_close():
    """[order] The works of moments and forces of a skew motion; trapezoids."""
    section = ub.Section(**STIFF, **OTHER)
    beam = ub.Beam((0, 0, 0), (3, 1, 2), section, cells=6)
    ball = ub.Body((3.5, 1, 2), mass=2.0, inertia=(0.3, 0.5, 0.4))
    axis = (0.48, 0.6, 0.64)
    scene = ub.Scene(
        [beam], bodies=[ball], joints=[ub.Rigid(beam.end, ball.at(3, 1, 2))],
        supports=[ub.PrescribedDisplacement(
            beam.start, u=0, v=0, w=0, axis=axis, psi=lambda t: 3.0 * t)],
        loads=[
            ub.FollowerLoad(ball.middle, force=(9, -4, 7), moment=(90, 40, -30),
                            amplitude=lambda t: t),
        ],
    )  # fmt: skip
    errors, ends = [], []
    for steps in (10, 20, 40):
        run = statics(scene, 1 / steps)
        errors.append(abs(run.energy.imbalance[-1] - run.energy.imbalance[0]))
        ends.append(run.position(ball.middle)[-1])
    assert errors[0] / errors[1] > 3.5
    assert errors[1] / errors[2] > 3.5
    assert np.abs(ends[0] - ends[2]).max() < 1e-7  # equilibria do not depend on steps


def test_restart_between_large_rotations_changes_no_bit(tmp_path):
    """A run by steps of more than half a turn: from a state, and from a checkpoint."""
    scene = rolled(2.0, amplitude=lambda t: min(t, 1.0) + 0.1 * t)
    whole = statics(scene, 1 / 3)
    first = statics(scene, 1 / 3, t=(0, 2 / 3))
    second = statics(first.scene, 1 / 3, t=(2 / 3, 1), start=first)
    tip = scene.beams[0].end
    assert (second.position(tip)[-1] == whole.position(tip)[-1]).all()
    for end in (2 / 3, 1):  # the second run goes on from the file
        again = statics(scene, 1 / 3, t=(0, end), checkpoint=ub.Checkpoint(tmp_path / "x", every=1))
    assert (again.position(tip) == whole.position(tip)).all()
    assert (again.energy["loads"] == whole.energy["loads"]).all()


@pytest.mark.parametrize("steps", [1, 4])
def test_a_free_hinge_turns_by_more_than_half_a_turn(steps):
    """[closed] The angle is the moment about the axis over the stiffness, with all whole turns."""
    section = ub.Section(EA=1e6, GA=5e5, GA3=5e5, EI=10.0, EI2=10.0, GJ=10.0)
    beam = ub.Beam((0, 0, 0), (1, 0, 0), section, cells=4)
    hinge = ub.PrescribedDisplacement(beam.start, u=0, v=0, w=0, axis=tuple(SKEW))
    spring = ub.Turn(ub.ground(0, 0, 0), beam.start, ub.Spring(2.0), axis=tuple(SKEW))
    push = ub.PointLoad(beam.end, moment=tuple(9.0 * SKEW), amplitude=lambda t: t)
    run = statics(ub.Scene([beam], supports=[hinge], connectors=[spring], loads=[push]), 1 / steps)
    assert np.allclose(run.connector(spring).motion[-1], 4.5, rtol=1e-9)
    wrapped = Rotation.from_rotvec(4.5 * SKEW).as_rotvec()
    assert np.abs(run.displacement(beam.start)[-1] - [0, 0, 0, *wrapped]).max() < 1e-9
    assert np.allclose(run.energy["loads"][-1], 9.0**2 / 2 * (1 / 2.0 + 1 / 10.0), rtol=1e-9)


@pytest.mark.serial  # it reads the forces of local degrees of freedom
def test_forces_on_a_rope_that_stiffens_and_turns_its_end():
    """[closed] A force on the middle of a straight rope, a moment on its end, and a weak spring.

    Works do not tell that the steps follow the path; the forces at their ends remain those in axes
    of the nodes: the moment on the end, which turns by 0.97 rad.  The force is that of an elastic
    rope, but for the bending stiffness.
    """
    EA, EI, across = 1e3, 1e-2, (0, 0.6, 0.8)
    section = ub.Section(EA=EA, GA=EA, GA3=EA, EI=EI, EI2=EI, GJ=EI)
    rope = ub.Beam((0, 0, 0), (2, 0, 0), section, cells=2)
    middle, moment, k = rope.at(0.5), np.array([2e-3, 3e-3, -4e-3]), 0.01

    def force(t):
        sag = 0.2 * t
        return 2 * EA * (1 - 1 / np.hypot(1, sag)) * sag + k * sag

    scene = ub.Scene(
        [rope], supports=[ub.Clamped(rope.start), ub.Pinned(rope.end)],
        connectors=[ub.Slide(ub.ground(1, 0, 0), middle, ub.Spring(k), axis=across)],
        loads=[ub.PointLoad(middle, force=across, amplitude=force),
               ub.PointLoad(rope.end, moment=tuple(moment), amplitude=lambda t: t)],
    )  # fmt: skip
    simulation = ub.Simulation(scene, ub.Static(), newton=ub.Newton(rtol=1e-13))
    for t in (0.1, 0.2, 0.5, 0.9, 1.0):
        simulation.step_to(t)
        end = simulation.displacement(rope.end)[3:]
        rotations = simulation.numbering.node(rope.end)[3:]
        found = simulation._path.force[rotations]
        assert np.allclose(found, Rotation.from_rotvec(end).inv().apply(t * moment), atol=1e-12)
    assert simulation.substeps <= 6
    assert np.linalg.norm(end) > 0.9
    assert np.allclose(simulation.displacement(middle)[:3], 0.2 * np.array(across), atol=1e-3)


def test_a_pendulum_away_from_its_equilibrium_is_refused():
    """As in the plane, with finite forces in the message."""
    section = ub.Section(**{name: 1e3 * x for name, x in (STIFF | OTHER).items()})
    beam = ub.Beam((0, 0, 0), (np.sin(0.1), 0, -np.cos(0.1)), section)
    hinge = ub.PrescribedDisplacement(beam.start, u=0, v=0, w=0, axis=(0, 1, 0))
    weight = ub.Gravity((0, 0, -9.81), amplitude=lambda t: t)
    with pytest.raises(ub.ModelError, match="Begin near an equilibrium") as raised:
        statics(ub.Scene([beam], supports=[hinge], loads=[weight]), 0.1)
    assert "nan" not in str(raised.value)


@pytest.mark.serial
def test_options_of_petsc_and_the_reference_solver_find_the_same_arc():
    options = None, ub.Newton(petsc={"snes_max_fail": 3}), ub.Newton(reference=True)
    runs = [statics(bend(4), 0.125, newton=x) for x in options]
    tips = [run.position(run.scene.beams[0].end)[-1] for run in runs]
    assert np.abs(tips - tips[0]).max() < 1e-6
