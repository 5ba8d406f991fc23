# SPDX-License-Identifier: MIT
"""What a run says where it goes wrong on the way, and that nothing is lost then."""

import math
from functools import partial

import numpy as np
import pytest
from helpers import run

import ufl_beam as ub

SECTION = ub.Section(EA=1e4, GA=1e4, EI=1.0, rhoA=1.0, rhoI=1e-3)


GROWING = ub.ramp(0.1)


def cantilever(*, time=GROWING, connect=lambda beam: (), hold=ub.Clamped):
    beam = ub.Beam((0, 0), (1, 0), SECTION, cells=2)
    load = ub.PointLoad(beam.end, force=(0.0, 0.1), amplitude=time)
    return ub.Scene([beam], supports=[hold(beam.start)], connectors=connect(beam), loads=[load])


run = partial(run, t=(0.0, 0.1), dt=0.01)


def late(value):
    """A time function that goes wrong at 0.05 s."""
    return lambda t: 1.0 if t < 0.0499 else value


def test_load_that_is_no_number_is_named():
    with pytest.raises(
        ub.ConvergenceError, match=r"PointLoad at beam.end.*nan at t = 0\.0(5|49)"
    ) as error:
        run(cantilever(time=late(math.nan)))
    solution = error.value.solution
    assert solution.times[-1] == pytest.approx(0.05, rel=3e-3)  # 1/4096 of a step before it
    assert np.isfinite(solution.q).all()


@pytest.mark.filterwarnings(
    "ignore:PrescribedDisplacement at beam.start .* psi jumps:ufl_beam.ModelWarning"
)
def test_motion_that_is_no_number_is_named():
    def hold(place):
        return ub.PrescribedDisplacement(place, u=0, v=0, psi=late(math.inf))

    with pytest.raises(
        ub.ConvergenceError, match=r"PrescribedDisplacement at beam.start.*inf at t = 0\.0(5|49)"
    ):
        run(cantilever(hold=hold))


def test_drive_that_is_no_number_is_named():
    def drive(beam):
        law = ub.PrescribedForce(late(math.nan))
        return [ub.Slide(ub.ground(2, 0), beam.end, law, axis=(0, 1))]

    with pytest.raises(ub.ConvergenceError, match=r"Slide\(ground .*nan at t = 0\.0(5|49)"):
        run(cantilever(connect=drive))


def test_error_of_a_users_function_comes_through():
    """Within an iteration PETSc calls it; what it raises is what the user sees."""

    def connect(beam):
        law = ub.ForceLaw(lambda e, rate: 1 / 0 if abs(e) > 1e-9 else 0.0)
        return [ub.Slide(ub.ground(2, 0), beam.end, law, axis=(0, 1))]

    with pytest.raises(ZeroDivisionError) as error:
        run(cantilever(connect=connect))
    assert len(error.value.solution.times) >= 1


def test_guide_that_ends_is_a_failed_step():
    """A failed search of the nearest point cuts the step, and the error names the place."""
    beam = ub.Beam((0, 0), (1, 0), SECTION, cells=2)

    def curve(s):
        return 1.0 + s, 0.0 if s < 0.01 else math.nan

    scene = ub.Scene(
        [beam],
        joints=[ub.Guided(beam.end, curve)],
        loads=[ub.PointLoad(beam.end, force=(10.0, 0.0))],
    )
    with pytest.raises(ub.ConvergenceError, match=r"beam.end .* guide curve") as error:
        run(scene)
    assert error.value.solution.times[-1] > 0.0


def test_singular_tangent_is_a_failed_step():
    """KLU stops PETSc where it finds no pivot; a shorter step has one.

    A force that grows by 4 m/dt² takes from a step of dt what inertia gives it.
    """
    body, dt = ub.Body((1, 0), mass=1.0, inertia=1.0), 2.0**-6
    law = ub.ForceLaw(lambda e, rate: -4.0 / dt**2 * e)
    scene = ub.Scene(
        bodies=[body],
        connectors=[ub.Slide(ub.ground(0, 0), body.middle, law)],
        loads=[ub.PointLoad(body.middle, force=(1.0, 0.0))],
    )
    solution = run(scene, t=(0.0, dt), dt=dt)
    assert solution.parts > 1
    assert np.isfinite(solution.q).all()


@pytest.mark.parametrize("dt", [1e-15, 1e-18])
def test_steps_that_do_not_change_the_time(dt):
    with pytest.raises(ub.ArgumentError, match="too small: steps from t = 1 to 2 s"):
        run(cantilever(), t=(1.0, 2.0), dt=dt)


def test_small_steps_from_zero():
    """The time itself is what limits a step, not its size in seconds."""
    beam = ub.Beam((0, 0), (1, 0), SECTION, cells=2)
    start = ub.Velocity([beam], linear=(1.0, 0.0))
    solution = run(ub.Scene([beam], initial=[start]), t=(0.0, 3e-30), dt=1e-30)
    assert solution.momentum()[-1, 0] == pytest.approx(1.0, rel=1e-14)
