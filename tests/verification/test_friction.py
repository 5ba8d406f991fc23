# SPDX-License-Identifier: MIT
"""Dry friction against closed forms: oscillator, incline, bearing; all [closed].

Friction sticks exactly, without a stiffness, and what it takes is never negative.
"""

import math
from itertools import pairwise

import numpy as np
import pytest
from helpers import assert_balanced
from scenes import on_rail

import ufl_beam as ub

MASS, STIFFNESS, LIMIT = 2.0, 50.0, 3.0  # kg, N/m, N
OMEGA = math.sqrt(STIFFNESS / MASS)  # rad/s
PERIOD = 2 * math.pi / OMEGA  # s
DEAD = LIMIT / STIFFNESS  # m: half the zone in which the mass may stay
G = 9.81  # m/s²


def run(scene, end, dt, **more):
    return ub.simulate(scene, ub.EnergyMomentum(), t=(0, end), dt=dt, **more)


# -- a mass on a spring ------------------------------------------------------------------------


def struck(v0, friction=LIMIT):
    """A mass on a rail with a spring to the ground and friction on the rail, struck at rest."""
    return on_rail(ub.Spring(STIFFNESS), ub.Coulomb(friction), mass=MASS, speed=v0)


def oscillator(v0, steps, *, periods=4.25, friction=LIMIT):
    """Solution of the struck mass, its motion, and the history of the friction."""
    scene = struck(v0, friction)
    solution = run(scene, periods * PERIOD, PERIOD / steps)
    x = solution.displacement(scene.bodies[0].middle)[:, 0]
    return solution, x, solution.connector(scene.connectors[1])


def first_peak(v0):
    """m v0²/2 = k x²/2 + R x."""
    return -DEAD + math.sqrt(DEAD**2 + (v0 / OMEGA) ** 2)


V0 = OMEGA * math.sqrt((0.63 + DEAD) ** 2 - DEAD**2)
"""m/s, so that the first peak is 10.5 DEAD: then 8.5, 6.5, 4.5, 2.5 and 0.5, where it stays."""


def test_amplitudes_fall_by_4R_k_each_period():
    """Half the period apart they differ by 2 R/k; from the sixth peak on the mass stays.

    A peak between two samples is missed by up to (π/n)²/2 of the distance to the centre of its
    half swing, 1.2e-4 with n = 200 steps a period, and by as much the turn comes late; the
    losses add up over five half swings.
    """
    steps = 200
    solution, x, rub = oscillator(V0, steps)
    assert first_peak(V0) == pytest.approx(0.63)
    quarter = steps // 4
    swings = [x[quarter + i * steps // 2 - 20 : quarter + i * steps // 2 + 21] for i in range(6)]
    peaks = np.array([np.abs(swing).max() for swing in swings])
    missed = 12 * 1.2e-4 * 0.63
    np.testing.assert_allclose(peaks, 0.63 - 2 * DEAD * np.arange(6), rtol=0, atol=missed)
    at_rest = solution.times > 3.0 * PERIOD
    assert np.ptp(x[at_rest]) < 1e-14
    assert x[-1] == pytest.approx(-0.03, abs=missed)
    # Friction bears the force of the spring.  The velocity that is left alternates between steps,
    # so that the mean of two steps is compared.
    bears = (rub.force[at_rest][1:] + rub.force[at_rest][:-1]) / 2
    np.testing.assert_allclose(bears, -STIFFNESS * x[-1], rtol=1e-10)
    assert np.abs(rub.force).max() <= LIMIT * (1 + 1e-10)
    # The work is the limit times the way, but for six steps in which the mass stops.
    lost, ways = solution.energy["friction"], np.abs(np.diff(x))
    assert np.diff(lost).min() >= 0.0
    np.testing.assert_allclose(lost, rub.work, rtol=1e-13)
    stops = 6 * LIMIT * ways.max() * math.pi / 200
    assert lost[-1] == pytest.approx(LIMIT * ways.sum(), abs=stops)
    assert solution.energy.worst < 1e-9


@pytest.mark.parametrize("steps", [5, 9])
def test_a_run_goes_on_in_the_same_way_from_each_of_its_states(steps):
    """Also where a long step could end at rest as well as at a reversed velocity."""
    scene = struck(V0)
    dt, last = PERIOD / steps, 4 * steps
    whole = run(scene, last * dt, dt)
    for k in range(1, last):
        first = run(scene, whole.times[k], dt)
        t = (whole.times[k], last * dt)
        second = ub.simulate(scene, ub.EnergyMomentum(), t=t, dt=dt, start=first)
        # 2e-10 of the forces by Newton's rtol in each step, against a stiffness of 50 N/m
        assert np.abs(second.q - whole.q[k:]).max() < 1e-9 * V0 / OMEGA


def test_limit_beyond_all_forces():
    """A blow that cannot move it: it sticks in the first step and takes the energy of the blow."""
    _, x, _ = oscillator(1e-3, 50, periods=0.2, friction=1e3)
    assert np.abs(x).max() < 1e-3 * PERIOD / 50
    assert np.ptp(x[3:]) < 1e-15  # last digits of a scene of 1 m, in eight steps


# -- a block on an incline ---------------------------------------------------------------------


def block(angle, coefficient):
    """A block on an incline, put down at rest; the first step has no friction."""
    along = math.cos(angle), math.sin(angle)
    mass = ub.Body(along, mass=MASS, inertia=0.3)
    rail = ub.ground(0, 0), mass.middle
    incline = ub.Prismatic(*rail)
    rub = ub.Slide(*rail, ub.Coulomb(coefficient=coefficient, joint=incline))
    weight = ub.Gravity((0.0, -G))
    scene = ub.Scene(bodies=[mass], joints=[incline], connectors=[rub], loads=[weight])
    return run(scene, 1.0, 0.01), incline, rub


@pytest.mark.parametrize("coefficient", [0.1, 1.0])
def test_friction_angle(coefficient):
    """3 % below the friction angle it sticks, 0.5 % above it slides with the difference.

    The acceleration is constant then, so that differences of velocity are exact.
    """
    angle = math.atan(coefficient)
    below, _, rub = block(0.97 * angle, coefficient)
    slid = below.connector(rub).motion
    assert np.ptp(slid[below.times > 0.8]) < 1e-13  # last digits add up
    above, _, rub = block(1.005 * angle, coefficient)
    rate = above.connector(rub).rate
    expected = -G * (math.sin(1.005 * angle) - coefficient * math.cos(1.005 * angle))
    computed = (rate[-1] - rate[5]) / (above.times[-1] - above.times[5])
    assert computed == pytest.approx(expected, rel=1e-8)  # two digits of ten are the difference
    assert_balanced(above.energy)


def test_force_of_the_incline():
    """It presses with m g cos; friction bears m g sin, in the mean of two steps."""
    angle, weight = 0.3, MASS * G
    solution, incline, rub = block(angle, 0.5)
    pressure = weight * math.cos(angle) * np.array([-math.sin(angle), math.cos(angle)])
    np.testing.assert_allclose(solution.joint(incline).force[-1], pressure, rtol=1e-9)
    bears = solution.connector(rub).force[-2:].mean()
    assert bears == pytest.approx(-weight * math.sin(angle), rel=1e-9)


# -- a bearing ---------------------------------------------------------------------------------


def test_bearing():
    """A wheel on a pin: dω/dt = -μ r m g/J, from the second step on, until it stops exactly."""
    inertia, radius, coefficient, ω0, dt = 0.4, 0.02, 0.3, 5.0, 0.02
    wheel = ub.Body((0, 0), mass=MASS, inertia=inertia)
    bearing = ub.Revolute(ub.ground(0, 0), wheel.middle, multipliers=True)
    pin = ub.Coulomb(coefficient=coefficient * radius, joint=bearing)
    rub = ub.Turn(ub.ground(0, 0), wheel.middle, pin)
    scene = ub.Scene(
        bodies=[wheel],
        joints=[bearing],
        connectors=[rub],
        loads=[ub.Gravity((0.0, -G))],
        initial=[ub.Velocity((wheel,), angular=ω0)],
    )
    deceleration = coefficient * radius * MASS * G / inertia
    stop = ω0 / deceleration + dt
    solution = run(scene, dt * round(1.1 * stop / dt), dt)
    ω = solution.velocity(wheel.middle)[:, 2]
    slows = (solution.times > 1.5 * dt) & (solution.times < stop - dt)
    # Moments act through (Δψ/2)/tan(Δψ/2), so that their work is exact
    np.testing.assert_allclose(np.diff(ω[slows]), -deceleration * dt, rtol=(ω0 * dt / 2) ** 2 / 2)
    turned = solution.displacement(wheel.middle)[:, 2]
    assert np.ptp(turned[solution.times > stop + 3 * dt]) < 1e-12
    np.testing.assert_allclose(solution.joint(bearing).force[-1], (0, MASS * G), atol=1e-8)
    energy = solution.energy
    # ω falls to zero, but for what the step that sticks leaves to its ends
    assert energy["friction"][-1] == pytest.approx(inertia * ω0**2 / 2, rel=1e-3)
    assert_balanced(energy)


def test_a_support_presses_as_a_measured_joint_does():
    """The same pin, once a support and once a joint to the ground; also if the run goes on."""
    section = ub.Section(EA=1e6, GA=1e6, EI=1e2, rhoA=1.0, rhoI=1e-3)
    rod = ub.Beam((0, 0), (1, 0), section, cells=2)
    joint, support = ub.Revolute(ub.ground(0, 0), rod.start, multipliers=True), ub.Pinned(rod.start)
    motions, works = [], []
    for pin, held, ends in (
        (support, {"supports": [support]}, [0.0, 0.1]),
        (joint, {"joints": [joint]}, [0.0, 0.1]),
        (support, {"supports": [support]}, [0.0, 0.05, 0.1]),
    ):
        rub = ub.Turn(ub.ground(0, 0), rod.start, ub.Coulomb(coefficient=0.1, joint=pin))
        scene, last = ub.Scene([rod], connectors=[rub], loads=[ub.Gravity()], **held), None
        for t in pairwise(ends):
            last = ub.simulate(scene, ub.EnergyMomentum(0.1, 0.1), t=t, dt=0.01, start=last)
        motions.append(last.displacement(rod.end)[-1])
        works.append(last.energy.lost["friction"][-1])
    np.testing.assert_allclose(motions[1:], [motions[0]] * 2, rtol=1e-8)
    # μ F over a turn of 0.07 rad, with F between zero and the weight of 9.81 N
    assert 0.1 * 0.07 * 9.81 / 5 < works[0] < 0.1 * 0.07 * 9.81
    assert works[1] == pytest.approx(works[0], rel=1e-8)


# -- friction that holds what is held already ----------------------------------------------------


def test_friction_at_all_pins_of_a_closed_loop():
    """Four places stick where one would do; virtual work says when all slide at once.

    A push F on the coupler of a four-bar linkage, cranks of 1 m and 1.2 m upright, which turn with
    1 and 1/1.2, the coupler not at all: F · 1 m = (M_A + M_B) + (M_C + M_D) / 1.2.
    """
    A, B, C, D = (0, 0), (0, 1), (1.5, 1.2), (1.5, 0)
    crank, coupler, rocker = (
        ub.Body(((p[0] + q[0]) / 2, (p[1] + q[1]) / 2), mass=1.0, inertia=0.1, name=name)
        for name, p, q in (("crank", A, B), ("coupler", B, C), ("rocker", C, D))
    )
    pins = [
        (ub.ground(*A), crank.at(*A)),
        (crank.at(*B), coupler.at(*B)),
        (coupler.at(*C), rocker.at(*C)),
        (rocker.at(*D), ub.ground(*D)),
    ]
    moments = 3.0, 0.5, 0.7, 2.0
    frictions = [
        ub.Turn(*pin, ub.Coulomb(force=moment)) for pin, moment in zip(pins, moments, strict=True)
    ]
    push = ub.PointLoad(coupler.middle, force=(1, 0), amplitude=lambda t: 60 * t)
    parts = {"joints": [ub.Revolute(*pin) for pin in pins], "connectors": frictions}
    scene = ub.Scene(bodies=[crank, coupler, rocker], loads=[push], **parts)
    events = ub.Events()
    solution = ub.simulate(scene, ub.EnergyMomentum(), t=(0, 0.2), dt=1e-3, record=events)
    slides = {}
    for event in events.found:
        if event.what == "slides":
            slides.setdefault(event.where, event.time)
    assert set(slides) == set(frictions)
    limit = (3.0 + 0.5 + (0.7 + 2.0) / 1.2) / 60
    assert max(slides.values()) == pytest.approx(limit, abs=2e-3)
    before = solution.times < limit - 1e-3
    assert np.abs(solution.displacement(coupler.middle)[before]).max() < 1e-9
    assert np.abs(solution.displacement(coupler.middle)[-1]).max() > 1e-3
    assert_balanced(solution.energy)
