# SPDX-License-Identifier: MIT
"""Adaptive steps: what they estimate is what they err, and what they choose is worth it.

An oscillator x'' = -x with the midpoint rule: a step errs by the trapezoidal rule's dt³/12 x'''.
"""

import math
from functools import lru_cache

import numpy as np
import pytest
from scenes import swing

import ufl_beam as ub


def oscillator(*, load=None, damper=0.0):
    """A mass of 1 kg on a spring of 1 N/m, let go 1 m beside its rest, in a scene of 1 m."""
    mass = ub.Body((1, 0), mass=1.0, inertia=1.0)
    at = ub.ground(0, 0), mass.middle
    loads = [ub.PointLoad(mass.middle, force=(1.0, 0.0), amplitude=load)] if load else []
    connectors = [ub.Slide(*at, ub.Spring(1.0))]
    connectors += [ub.Slide(*at, ub.Damper(damper))] if damper else []
    return ub.Scene(
        bodies=[mass],
        supports=[ub.PrescribedDisplacement(mass.middle, v=0.0, psi=0.0)],
        connectors=connectors,
        initial=[] if load else [ub.Velocity([mass], linear=(1.0, 0.0))],
        loads=loads,
    )


def run(scene, dt, *, end, scheme=None, **more):
    return ub.simulate(scene, scheme or ub.EnergyMomentum(), t=(0, end), dt=dt, **more)


def at_end(solution, place):
    return solution.displacement(place)[-1, 0]


# -- the estimate ------------------------------------------------------------------------------


def test_the_estimate_is_the_error_of_a_step():
    """Of each step of x = sin t, by the exact solution from where the step began; 10 % of dt."""
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
    assert abs(at_end(decaying, scene.bodies[0].middle) - math.sin(6.0)) < 0.1


def test_dissipation_by_second_differences_is_refused():
    """Steps that grow make it first order: 0.24 m in 4 s of free fall, at any tolerance."""
    body = ub.Body((0, 0), mass=10.0, inertia=1.0)
    scene = ub.Scene(
        bodies=[body],
        loads=[ub.Gravity()],
        initial=[ub.Velocity([body], linear=(2.0, 3.0))],
    )
    with pytest.raises(ub.ArgumentError, match=r"first order.*EnergyMomentum\(alpha, beta\)"):
        run(scene, ub.Adaptive(1e-3), end=4.0, scheme=ub.EnergyMomentumDecaying(0.5))
    with pytest.raises(ub.ArgumentError, match="must be a scheme"):
        run(scene, ub.Adaptive(1e-3), end=4.0, scheme=3.0)
    for scheme in (ub.EnergyMomentumDecaying(1.0), ub.EnergyMomentum(), ub.GeneralizedAlpha(0.5)):
        solution = run(scene, ub.Adaptive(1e-3), end=4.0, scheme=scheme)  # nothing is dissipated
        y = solution.displacement(body.middle)[-1, 1]
        assert y == pytest.approx(3 * 4.0 - 9.81 * 4.0**2 / 2, rel=1e-12)


def test_the_number_of_steps_goes_with_the_cube_root_of_the_tolerance():
    """Errors of steps go with dt³, their sum with dt²: an 8th of the tolerance, half the steps."""
    scene = oscillator()
    runs = [run(scene, ub.Adaptive(tolerance), end=6.0) for tolerance in (8e-6, 1e-6)]
    errors = [abs(at_end(s, scene.bodies[0].middle) - math.sin(6.0)) for s in runs]
    assert errors[0] / errors[1] == pytest.approx(4.0, rel=0.15)
    assert runs[1].substeps / runs[0].substeps == pytest.approx(2.0, rel=0.1)


@pytest.mark.parametrize("tolerance", [1e-3, 1e-4, 1e-5, 1e-6])
def test_the_sum_of_the_estimates_is_about_the_error(tolerance):
    """The phase lags dt³/12 a step, whether it is position or velocity that errs just then."""
    scene = oscillator()
    solution = run(scene, ub.Adaptive(tolerance), end=6.0)
    lag = abs(at_end(solution, scene.bodies[0].middle) - math.sin(6.0)) / math.cos(6.0)
    assert 1.0 < lag / solution.time_error < 3.0


# -- where steps end ---------------------------------------------------------------------------


def test_steps_end_at_kinks_and_stops():
    """A load that grows, stays and ends: no step goes across; between, steps are as they like."""
    time = ub.Table((0.5, 1.0, 2.0, 2.1), (0.0, 1.0, 1.0, 0.0))
    solution = run(oscillator(load=time), ub.Adaptive(1e-5, stops=[1.7, 9.0]), end=3.0)
    for t in (0.5, 1.0, 1.7, 2.0, 2.1, 3.0):
        assert t in solution.times
    assert solution.times[-1] == 3.0
    assert (np.diff(solution.times) > 0).all()


def test_stops_that_differ_by_rounding_are_one():
    """And a run that begins late, where times have few digits, is the same run."""
    early = run(oscillator(), ub.Adaptive(1e-4, stops=[0.3, 0.1 + 0.2, 1 - 1e-15]), end=1.0)
    assert 0.3 in early.times
    assert np.diff(early.times).min() > 1e-3
    late = ub.simulate(
        oscillator(),
        ub.EnergyMomentum(),
        t=(2.0**20, 2.0**20 + 1),
        dt=ub.Adaptive(1e-4, stops=[0.3]),
    )
    assert late.substeps > 1
    x = [at_end(s, s.scene.bodies[0].middle) for s in (early, late)]
    assert x[0] == pytest.approx(x[1], abs=1e-3)


def test_functions_of_time_are_those_of_the_scene():
    beam = ub.Beam((0, 0), (1, 0), ub.Section(EA=1, GA=1, EI=1, rhoA=1, rhoI=1))
    body = ub.Body((0, 1), mass=1.0, inertia=1.0)

    def pulse(t):
        return float(1 < t < 2)

    pulse.kinks = (1, 2)
    scene = ub.Scene(
        [beam],
        bodies=[body],
        supports=[ub.PrescribedDisplacement(beam.start, v=ub.Table((0, 3), (0, 1)), u=0.0)],
        loads=[
            ub.PointLoad(beam.end, force=(1, 0), amplitude=pulse),
            ub.LineLoad(beam, force=(0, 1), amplitude=ub.ramp(4.0)),
        ],
        connectors=[ub.Turn(ub.ground(0, 1), body.middle, ub.PrescribedForce(ub.ramp(5.0)))],
    )
    kinks = {t for _, f in scene.time_functions() for t in getattr(f, "kinks", ())}
    assert kinks == {0.0, 1.0, 2.0, 3.0, 4.0, 5.0}


def test_a_jump_that_nobody_announced():
    """Costs short steps, no accuracy."""
    scene = oscillator(load=lambda t: float(t >= 1.0))
    solution = run(scene, ub.Adaptive(1e-5), end=3.0)
    assert at_end(solution, scene.bodies[0].middle) == pytest.approx(1 - math.cos(2.0), abs=1e-3)
    assert np.diff(solution.times).min() < 0.1 * np.diff(solution.times).max()


def test_longest_and_first():
    solution = run(oscillator(), ub.Adaptive(1.0, first=1e-3, longest=0.01), end=0.5)
    dt = np.diff(solution.times)
    assert dt[0] == pytest.approx(0.5e-3)  # half of the first is compared with the whole
    assert dt.max() == pytest.approx(0.01)


def test_where_no_step_is_short_enough():
    """The end of a beam jumps, and the cell behind it with it: it says so; nothing is lost."""
    section = ub.Section(EA=1.0, GA=1.0, EI=1.0, rhoA=1.0, rhoI=1.0)
    beam = ub.Beam((0, 0), (1, 0), section, cells=2)
    scene = ub.Scene(
        [beam], supports=[ub.PrescribedDisplacement(beam.start, u=lambda t: 0.1 * (t > 1.0))]
    )
    with pytest.raises(ub.ConvergenceError, match="name the time in `stops`") as failure:
        run(scene, ub.Adaptive(1e-6), end=2.0)
    assert failure.value.time == pytest.approx(1.0, abs=1e-6)
    assert failure.value.solution.times[-1] == failure.value.time


# -- what it is worth --------------------------------------------------------------------------


@lru_cache
def swung(dt):
    """Mid-span, A, B of the swing at 0.64 s, when its links snap taut; and the number of steps."""
    scene = swing(cells=4, rigidity=1e4)
    solution = run(scene, ub.Adaptive(dt[0]) if isinstance(dt, tuple) else dt, end=0.64)
    beam = scene.beams[0]
    places = beam.at(0.5), beam.start, beam.end
    return np.array([solution.displacement(p)[-1, :2] for p in places]), solution.substeps


def test_swing_with_fewer_steps():
    """The snap needs steps of 4e-5 s, the swinging before of 4e-3 s.

    Against the run with steps of 6.25e-5 s, whose own error is a 16th of that of 2.5e-4 s.
    """
    exact, _ = swung(6.25e-5)
    adaptive, steps = swung((1e-6,))
    error = np.abs(adaptive - exact).max()
    assert error < 3e-5  # what the converged table is known to
    fixed, more_steps = swung(2.5e-4)
    assert np.abs(fixed - exact).max() > error
    assert more_steps > 5 * steps
