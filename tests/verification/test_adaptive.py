# SPDX-License-Identifier: MIT
"""Adaptive steps: their estimate of the error, and the times at which they end.

An oscillator x'' = -x with the midpoint rule: a step errs by the trapezoidal rule's dt³/12 x'''.
"""

import math

import numpy as np
import pytest
from scenes import on_rail

import ufl_beam as ub


def oscillator(load=None):
    """A mass of 1 kg on a spring of 1 N/m, with a velocity of 1 m/s or under a load."""
    return on_rail(ub.Spring(1.0), speed=0.0 if load else 1.0, force=load)


def run(scene, dt, *, end, scheme=None, start=0.0):
    t = (start, start + end)
    return ub.simulate(scene, scheme or ub.EnergyMomentum(), t=t, dt=dt)


def at_end(solution):
    return solution.displacement(solution.scene.bodies[0].middle)[-1, 0]


# -- the estimate ------------------------------------------------------------------------------


def test_the_estimate_is_the_error_of_a_step():
    """Of each step of x = sin t, by the exact solution from its beginning; 10 % of dt."""
    scene = oscillator()
    solution = run(scene, ub.Adaptive(1e-4), end=6.0)
    x, v = (f(scene.bodies[0].middle)[:, 0] for f in (solution.displacement, solution.velocity))
    dt = np.diff(solution.times)
    exact = x[:-1] * np.cos(dt) + v[:-1] * np.sin(dt)
    errors = np.abs(x[1:] - exact)
    # The jerk is taken between the middles of two steps, so one step late.
    assert solution.time_error == pytest.approx(errors.sum(), rel=0.1)
    assert 0.7e-4 < errors.max() < 1.5e-4


def test_the_estimate_of_a_turn():
    """A body that turns freely: the velocity is exact, the angle 2 arctan(ω dt / 2) a step."""
    body = ub.Body((0, 0), mass=1.0, inertia=1.0)
    scene = ub.Scene(bodies=[body], initial=[ub.Velocity([body], angular=2.0)])
    solution = run(scene, ub.Adaptive(1e-4), end=3.0)
    errors = np.abs(np.diff(solution.displacement(body.middle)[:, 2]) - 2 * np.diff(solution.times))
    assert solution.time_error == pytest.approx(errors.sum(), rel=1e-6)
    assert errors.max() <= 1e-4


@pytest.mark.parametrize(
    "scheme", [ub.EnergyMomentum(0.1, 0.0), ub.EnergyMomentum(0.0, 0.1)], ids=str
)
def test_the_estimate_counts_dissipation(scheme):
    """Decaying schemes err more with the same steps, so they take more of them."""
    scene = oscillator()
    plain, decaying = (run(scene, ub.Adaptive(1e-5), end=6.0, scheme=s) for s in (None, scheme))
    assert decaying.substeps > 1.1 * plain.substeps
    assert abs(at_end(decaying) - math.sin(6.0)) < 0.1


@pytest.mark.parametrize(
    "scheme", [ub.EnergyMomentum(), ub.Newmark(), ub.GeneralizedAlpha(0.8)], ids=str
)
def test_errors_and_steps_by_tolerance(scheme):
    """Errors of steps go with dt³, their sum with dt²; the sum is about the lag of the phase."""
    scene = on_rail(ub.Spring(1.0), speed=1.0, joints=[])
    runs = [run(scene, ub.Adaptive(part), end=6.0, scheme=scheme) for part in (8e-6, 1e-6)]
    errors = [abs(at_end(s) - math.sin(6.0)) for s in runs]
    assert errors[0] / errors[1] == pytest.approx(4.0, rel=0.15)
    assert runs[1].substeps / runs[0].substeps == pytest.approx(2.0, rel=0.1)
    for error, solution in zip(errors, runs, strict=True):
        assert 1.0 < error / math.cos(6.0) / solution.time_error < 3.0


def test_dissipation_by_second_differences_is_refused():
    """Steps that grow make it first order: 0.24 m in 4 s of free fall, at any tolerance."""
    body = ub.Body((0, 0), mass=10.0, inertia=1.0)
    moves = ub.Velocity([body], linear=(2.0, 3.0))
    scene = ub.Scene(bodies=[body], loads=[ub.Gravity()], initial=[moves])
    with pytest.raises(ub.ArgumentError, match=r"first order.*EnergyMomentum\(alpha, beta\)"):
        run(scene, ub.Adaptive(1e-3), end=4.0, scheme=ub.EnergyMomentumDecaying(0.5))
    with pytest.raises(ub.ArgumentError, match="must be a scheme"):
        run(scene, ub.Adaptive(1e-3), end=4.0, scheme=3.0)
    for scheme in (ub.EnergyMomentumDecaying(1.0), ub.EnergyMomentum(), ub.GeneralizedAlpha(0.5)):
        solution = run(scene, ub.Adaptive(1e-3), end=4.0, scheme=scheme)  # nothing is dissipated
        y = solution.displacement(body.middle)[-1, 1]
        assert y == pytest.approx(3 * 4.0 - 9.81 * 4.0**2 / 2, rel=1e-12)


# -- where steps end ---------------------------------------------------------------------------


def test_steps_end_at_kinks_and_stops():
    """No step goes across a kink of a load, a support or a connector."""

    def pulse(t):
        return float(1 < t < 2)

    pulse.kinks = (1, 2)
    beam = ub.Beam((0, 0), (1, 0), ub.Section(EA=1, GA=1, EI=1, rhoA=1, rhoI=1))
    body = ub.Body((0, 1), mass=1.0, inertia=1.0)
    push = ub.PointLoad(beam.end, force=(0.1, 0), amplitude=pulse)
    wind = ub.LineLoad(beam, force=(0, 0.1), amplitude=ub.ramp(4.0))
    foot = ub.PrescribedDisplacement(beam.start, v=ub.Table((0.5, 3), (0, 0.1)), u=0.0)
    motor = ub.Turn(ub.ground(0, 1), body.middle, ub.PrescribedForce(ub.ramp(5.0)))
    parts = {"bodies": [body], "loads": [push, wind], "connectors": [motor]}
    scene = ub.Scene([beam], supports=[foot], **parts)
    solution = run(scene, ub.Adaptive(1e-3, stops=[1.7, 9.0]), end=6.0)
    assert {0.5, 1.0, 1.7, 2.0, 3.0, 4.0, 5.0} <= set(solution.times)
    assert solution.times[-1] == 6.0
    assert (np.diff(solution.times) > 0).all()


def test_stops_that_differ_by_rounding_are_one():
    """And a run that begins late, where times have few digits, is the same run."""
    early = run(oscillator(), ub.Adaptive(1e-4, stops=[0.3, 0.1 + 0.2, 1 - 1e-15]), end=1.0)
    assert 0.3 in early.times
    assert np.diff(early.times).min() > 1e-3
    late = run(oscillator(), ub.Adaptive(1e-4, stops=[0.3]), start=2.0**20, end=1.0)
    assert late.substeps > 1
    assert at_end(early) == pytest.approx(at_end(late), abs=1e-3)


def test_a_jump_that_nobody_announced():
    """Costs short steps, no accuracy."""
    solution = run(oscillator(load=lambda t: float(t >= 1.0)), ub.Adaptive(1e-5), end=3.0)
    assert at_end(solution) == pytest.approx(1 - math.cos(2.0), abs=1e-3)
    assert np.diff(solution.times).min() < 0.1 * np.diff(solution.times).max()


def test_longest_and_first():
    solution = run(oscillator(), ub.Adaptive(1.0, first=1e-3, longest=0.01), end=0.5)
    dt = np.diff(solution.times)
    assert dt[0] == pytest.approx(0.5e-3)  # half of the first is compared with the whole
    assert dt.max() == pytest.approx(0.01)


def test_where_no_step_is_short_enough():
    """The end of a beam jumps: the message names a remedy, and the solution is kept."""
    section = ub.Section(EA=1.0, GA=1.0, EI=1.0, rhoA=1.0, rhoI=1.0)
    beam = ub.Beam((0, 0), (1, 0), section, cells=2)
    jump = ub.PrescribedDisplacement(beam.start, u=lambda t: 0.1 * (t > 1.0))
    scene = ub.Scene([beam], supports=[jump])
    with pytest.raises(ub.ConvergenceError, match="name the time in `stops`") as failure:
        run(scene, ub.Adaptive(1e-6), end=2.0)
    assert failure.value.time == pytest.approx(1.0, abs=1e-6)
    assert failure.value.solution.times[-1] == failure.value.time
