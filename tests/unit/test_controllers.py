# SPDX-License-Identifier: MIT
"""Controllers: sample times, independent of steps; what goes on after a restart; stability."""

import warnings
from functools import partial

from mpi4py import MPI

import numpy as np
import pytest
from failing_steps import let_fail
from helpers import run, stop_after
from scenes import clamped

import ufl_beam as ub

M, GAIN, RATE = 0.5, 30.0, 4.0  # kg, N/m, N s/m
DAMPED = ub.EnergyMomentum(alpha=0.02, beta=0.02)
run = partial(run, t=(0.0, 0.5), dt=1e-3)


def slider(sample=None, log=None, gain=GAIN, rate=RATE):
    """A rigid body that a controller moves by 0.2 m, and its connector."""
    body = ub.Body((0, 0), mass=M, inertia=1.0, name="slider")

    def control(now):
        if log is not None:
            log.append(now.t)
        return gain * (0.2 - now.displacement(body.middle)[0]) - rate * now.velocity(body.middle)[0]

    law = ub.Controller(control, sample=sample)
    drive = ub.Slide(ub.ground(0, 0), body.middle, law, axis=(1, 0))
    way = ub.Prismatic(ub.ground(0, 0), body.middle, axis=(1, 0))
    return ub.Scene([], joints=[way], connectors=[drive], bodies=[body]), body, drive


def by_hand(sample, samples):
    """Way after so many samples: under a constant force in each it is a parabola of time."""
    way = speed = 0.0
    for _ in range(samples):
        acceleration = (GAIN * (0.2 - way) - RATE * speed) / M
        way += speed * sample + acceleration * sample**2 / 2
        speed += acceleration * sample
    return way


@pytest.mark.parametrize("dt", [0.05, 0.01, 0.003, ub.Adaptive(1e-4)], ids=str)
def test_a_sample_time_is_independent_of_the_step(dt):
    """The parabolas are exact at any step; 1e-9 is the tolerance of the solver over 50 samples."""
    log = []
    scene, body, _ = slider(0.01, log)
    solution = run(scene, dt=dt)
    np.testing.assert_allclose(log, 0.01 * np.arange(50), rtol=0, atol=1e-12)
    assert MPI.COMM_WORLD.allgather(log) == [log] * MPI.COMM_WORLD.size
    way = solution.displacement(body.middle)[-1, 0]
    assert way == pytest.approx(by_hand(0.01, 50), rel=1e-9)
    assert solution.energy.worst < 1e-9


@pytest.mark.parametrize(
    ("sample", "t", "times"),
    [(0.03, (0.1, 0.2), [0.1, 0.13, 0.16, 0.19]), (None, (0.0, 0.05), 0.01 * np.arange(5))],
)
def test_samples_are_counted_from_the_beginning_and_without_them_each_step_asks(sample, t, times):
    log = []
    run(slider(sample, log)[0], t=t, dt=0.01)
    np.testing.assert_allclose(log, times, rtol=0, atol=1e-12)


def test_parts_of_a_step_that_is_cut_hold_the_sample():
    """Half of the steps fail at first; the controller is not asked more often."""
    log, tried = [], set()
    scene, body, _ = slider(0.01, log)

    def fails_once(t1):
        number = len(tried)
        tried.add(t1)
        return len(tried) > number and round(100 * t1, 9) % 1 == 0

    simulation = ub.Simulation(scene, ub.EnergyMomentum())
    let_fail(simulation, fails_once)
    for n in range(5):
        simulation.step_to(0.02 * (n + 1))
    assert simulation.substeps > 10
    np.testing.assert_allclose(log, 0.01 * np.arange(10), rtol=0, atol=1e-12)
    way = simulation.displacement(body.middle)[0]
    assert way == pytest.approx(by_hand(0.01, 10), rel=1e-9)
    simulation.close()


def test_a_run_goes_on_from_a_checkpoint_within_a_sample(shared_path):
    """Bit for bit, and the held force is that of the sample before."""
    backup = ub.Checkpoint(shared_path / "run.checkpoint", every=1)
    scene, _, drive = slider(0.017)
    whole = run(scene, dt=0.005)
    with pytest.raises(KeyboardInterrupt):
        run(scene, dt=0.005, record=stop_after(46), checkpoint=backup)
    resumed = run(scene, dt=0.005, record=stop_after(10**9), checkpoint=backup)
    for one, other in ((whole.q, resumed.q), (whole.v, resumed.v)):
        np.testing.assert_array_equal(one, other)
    of_drive = [one.connector(drive).force for one in (whole, resumed)]
    np.testing.assert_array_equal(*of_drive)


def test_a_run_goes_on_within_a_sample_by_start():
    """The first sample of the second run is the next one of the first run."""
    log = []
    scene, body, _ = slider(0.04, log)
    whole = run(scene, t=(0.0, 0.2), dt=0.01)
    del log[:]
    first = run(scene, t=(0.0, 0.1), dt=0.01)
    second = run(scene, t=(0.1, 0.2), dt=0.01, start=first)
    np.testing.assert_allclose(log, [0.0, 0.04, 0.08, 0.12, 0.16], rtol=0, atol=1e-12)
    ways = [one.displacement(body.middle)[-1, 0] for one in (whole, second)]
    assert ways[0] == pytest.approx(ways[1], rel=1e-9)  # tolerance of the solver
    del log[:]
    run(scene, t=(0.0, 0.1), dt=0.01, start=first)  # another clock: anew
    np.testing.assert_allclose(log, [0.0, 0.04, 0.08], rtol=0, atol=1e-12)


# -- stability -------------------------------------------------------------------------------------


@pytest.mark.parametrize("sample", [None, 0.01])
@pytest.mark.parametrize(("ratio", "stable"), [(1.9, True), (2.1, False)])
def test_the_criterion_of_the_pages(sample, ratio, stable):
    """kd sample < 2 M: each sample multiplies the speed by 1 - kd sample / M."""
    scene, body, _ = slider(sample, gain=0.5, rate=ratio * M / 0.01)
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always")
        solution = run(scene, dt=0.01 if sample is None else 0.002, comm=MPI.COMM_SELF)
    assert (abs(solution.velocity(body.middle)[-1, 0]) < 0.1) == stable
    said = [str(one.message) for one in caught]
    assert len(said) == (not stable)
    for one in said:
        what = "steps" if sample is None else "samples"
        assert "Slide(ground (0, 0), slider (0, 0)): the force rose and fell in turn" in one
        assert f"in the last 20 {what}" in one
        assert all(remedy in one for remedy in ("kd dt < 2 J", "ForceLaw", "PointMass"))
        assert one in str(solution)


def arm():
    """An elastic arm that a controller turns at its first node, which has no inertia."""
    section = ub.Section.rectangle(b=0.04, h=0.02, E=70e9, nu=0.33, rho=2700.0)
    beam = ub.Beam((0, 0), (1, 0), section, cells=4, name="arm")

    def control(now):
        angle, rate = now.displacement(beam.start)[2], now.velocity(beam.start)[2]
        return float(np.clip(600 * (0.2 - angle) - 40 * rate, -60, 60))

    drive = ub.Turn(ub.ground(0, 0), beam.start, ub.Controller(control))
    return ub.Scene([beam], supports=[ub.Pinned(beam.start)], connectors=[drive])


@pytest.mark.parametrize("dt", [1e-3, 1e-4])
def test_bang_bang_at_the_end_of_a_beam_warns(dt):
    """One process warns, once of the force and once of the work that the scheme takes."""
    # All solutions say it; shorter steps do not help.
    scene = arm()
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always")
        solution = ub.simulate(scene, DAMPED, t=(0, 150 * dt), dt=dt, comm=MPI.COMM_WORLD)
    of_all = MPI.COMM_WORLD.allgather([str(one.message) for one in caught])
    said = [message for messages in of_all for message in messages]
    assert len(said) == 2
    assert "Turn(ground (0, 0), arm.start (0, 0)): the force rose and fell in turn" in said[0]
    assert "the entry 'numerical'" in said[1]
    assert all(one in str(solution) for one in said)


def test_the_error_of_a_run_names_an_unstable_controller():
    """Each sample of 2 ms multiplies the velocity by 1 - kd dt/J = -3: the run fails early."""
    beam = ub.Beam((0, 0), (1.5, 0), ub.Section(EA=1e8, GA=4e7, EI=1e5, rhoA=6.0, rhoI=1e-3))

    def control(now):
        angle, rate = now.displacement(beam.start)[2], now.velocity(beam.start)[2]
        return 4e4 * (0.5 - angle) - 4e3 * rate

    scene = ub.Scene(
        [beam],
        supports=[ub.Pinned(beam.start)],
        connectors=[ub.Turn(ub.ground(0, 0), beam.start, ub.Controller(control, sample=0.002))],
        masses=[ub.PointMass(beam.start, 0.0, inertia=2.0)],
    )
    failed = r"Turn\(.*\): the force rose and fell in turn in the last \d+ samples.*kd dt < 2 J"
    with pytest.raises(ub.ConvergenceError, match=failed):
        ub.simulate(scene, DAMPED, t=(0, 1), dt=2e-3)


def test_a_relay_that_holds_for_some_steps_does_not_warn():
    """Of all changes of direction none follows another at once."""
    body = ub.Body((0, 0), mass=1.0, inertia=1.0, name="rotor")
    relay = ub.Controller(lambda now: 5.0 * (-1) ** int(now.t / 0.0201))
    drive = ub.Turn(ub.ground(0, 0), body.middle, relay)
    pin = ub.Revolute(ub.ground(0, 0), body.middle)
    scene = ub.Scene([], joints=[pin], connectors=[drive], bodies=[body])
    run(scene, t=(0.0, 2.0), dt=0.01)  # no warning is issued


# -- section forces --------------------------------------------------------------------------------


def pushed(told, gain):
    """A cantilever; the force at its end depends on a moment, and all section forces are told."""
    section = ub.Section(EA=1e4, GA=4e3, EI=10.0, rhoA=1.0, rhoI=0.01)
    beam = ub.Beam((0, 0), (1, 0), section, cells=4)

    def control(now):
        told[now.t] = now.section_forces()
        return 1.0 - gain * told[now.t][0, 2]

    push = ub.Slide(ub.ground(1, 0), beam.end, ub.Controller(control), axis=(0, 1))
    return clamped(beam, connectors=[push])


def test_section_forces_that_a_controller_asks_for_after_a_start():
    """They are those of the solution, of each step as it ends, also where C takes several steps."""
    scene = pushed(told := {}, 0.0)
    first = run(scene, t=(0.0, 0.05), dt=0.01)
    told.clear()
    solution = run(scene, t=(0.05, 0.1), dt=0.01, start=first)
    for n in range(1, 5):
        assert np.array_equal(told[solution.times[n]], solution.cell_forces(n)[:, 0])


def test_the_reference_solver_tells_a_controller_the_same_section_forces(as_by_reference):
    """The last motion depends on all forces that the controller was told."""
    as_by_reference(run(pushed({}, 0.5), t=(0.0, 0.1), dt=0.01), 1e-6)  # tolerances of two solvers
