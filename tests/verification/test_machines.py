# SPDX-License-Identifier: MIT
"""Bodies, joints and connectors against closed forms; all [closed].

Steps of the midpoint rule of a mass on a linear spring, a damper or under a constant force have a
closed form.  Else the error is of second order in the step, and Richardson's limit is compared.
"""

import math

import numpy as np
import pytest
from convergence.study import extrapolated
from helpers import assert_balanced
from scenes import on_rail
from scipy.special import ellipk

import ufl_beam as ub

G = 9.81  # m/s²
SOLVED = 1e-9
"""Each step is solved to 1e-10 of the forces; a few hundred of them add up to less than this."""


def run(scene, end, dt, scheme=None, **more):
    scheme = scheme or ub.EnergyMomentum()
    return ub.simulate(scene, scheme, t=(0, end), dt=dt, **more)


def crossing(times, values):
    """Time at which values first change their sign, by a parabola through three samples."""
    n = int(np.flatnonzero(np.diff(np.sign(values)))[0])
    n = max(n, 1)
    a, b, c = np.polyfit(times[n - 1 : n + 2], values[n - 1 : n + 2], 2)
    roots = np.roots([a, b, c]).real
    return float(roots[np.argmin(np.abs(roots - times[n]))])


# -- pendulums ---------------------------------------------------------------------------------


@pytest.mark.parametrize(("angle", "inertia"), [(0.1, 0.5), (3.0, 1e-6)])
def test_period_of_a_pendulum(angle, inertia):
    """T = 4 √(I/(m g l)) K(sin²(θ/2)), at any amplitude: Richardson's limit of two steps.

    The error of 200 steps a period is about (2π/200)²/12 of it, and of the limit its square; at
    3 rad rates are larger than 2π/T by a factor of three.
    """
    mass, length = 0.7, 1.2
    about_pivot = inertia + mass * length**2
    period = 4 * math.sqrt(about_pivot / (mass * G * length)) * ellipk(math.sin(angle / 2) ** 2)
    centre = length * math.sin(angle), -length * math.cos(angle)
    bob = ub.Body(centre, mass=mass, inertia=inertia, name="bob")
    pivot = ub.Revolute(ub.ground(0, 0), bob.at(0, 0))
    scene = ub.Scene(bodies=[bob], joints=[pivot], loads=[ub.Gravity((0, -G))])
    found = []
    for steps in (200, 400):
        solution = run(scene, 0.3 * period, period / steps)
        assert solution.energy.worst < SOLVED
        turned = solution.displacement(bob.middle)[:, 2] + angle
        found.append(4 * crossing(solution.times, turned))
    assert found[1] == pytest.approx(period, rel=5e-4)
    assert extrapolated(*found) == pytest.approx(period, rel=2e-5)


def test_the_pivot_stays_and_its_force():
    """A body that turns at a constant rate: the pivot bears m ω² l towards itself."""
    length, mass, rate = 1.2, 0.7, 3.0
    bob = ub.Body((length, 0), mass=mass, inertia=0.1)
    pivot = ub.Revolute(ub.ground(0, 0), bob.at(0, 0))
    scene = ub.Scene(bodies=[bob], joints=[pivot], initial=[ub.Velocity((bob,), angular=rate)])
    solution = run(scene, 2.0, 0.02)
    assert np.abs(solution.position(bob.at(0, 0))).max() < 1e-12
    history = solution.joint(pivot)
    size = np.linalg.norm(history.force[1:], axis=1)
    # The step turns by 0.06: forces are those in its middle, to (Δψ/2)² = 1e-3
    np.testing.assert_allclose(size, mass * rate**2 * length, rtol=1e-3)
    turned = solution.displacement(bob.middle)[1:, 2] - 0.5 * rate * 0.02
    towards = -np.column_stack([np.cos(turned), np.sin(turned)]) * size[:, None]
    np.testing.assert_allclose(history.force[1:], towards, atol=1e-3 * size[0])
    # In axes of the body it is constant
    along = np.column_stack([-size, np.zeros(100)])
    np.testing.assert_allclose(history.in_b[1:], along, atol=1e-8)
    np.testing.assert_allclose(history.in_a, history.force, atol=1e-12)
    np.testing.assert_array_equal(history.moment, 0.0)
    np.testing.assert_allclose(history.motion[:, :2], 0.0, atol=1e-12)


def sliding(arm, bob):
    return [ub.Prismatic(arm.at(0.5, 0), bob.middle, axis=(1, 0), turning=True)]


def linked(arm, bob):
    return [ub.Link(arm.at(0.5, 0), bob.middle)]


def guided(arm, bob):
    return [ub.Guided(bob.middle, lambda s: (0.9 + s, 0.1 + s * s))]


@pytest.mark.parametrize("kind", [sliding, linked, guided])
@pytest.mark.parametrize("scheme", [ub.EnergyMomentum(), ub.EnergyMomentumDecaying()], ids=str)
def test_force_of_a_joint_with_an_axis_that_turns_accelerates_the_body(kind, scheme):
    """Force and weight on a body are its mass times its mean acceleration in a step."""
    arm = ub.Body((0, 0), mass=2.0, inertia=0.3, name="arm")
    bob = ub.Body((0.5, 0) if kind is sliding else (0.9, 0.1), mass=0.7, inertia=0.1, name="bob")
    joint, *_ = joints = kind(arm, bob)
    scene = ub.Scene(
        bodies=[arm, bob], joints=[ub.Revolute(ub.ground(0, 0), arm.at(0, 0)), *joints],
        loads=[ub.Gravity((0, -G))], initial=[ub.Velocity((arm, bob), angular=3.0)],
    )  # fmt: skip
    solution = run(scene, 0.5, 0.01, scheme)
    force = solution.joint(joint).force - 0.7 * np.array([0.0, G])
    error = force - 0.7 * solution.acceleration(bob.middle)[:, :2]
    assert np.abs(error[1:]).max() < 1e-8 * np.abs(force[1:]).max()


@pytest.mark.parametrize("kind", [ub.Revolute, ub.Rigid])
def test_measured_joint_is_the_shared_one(kind):
    """The same motion with and without unknowns of its own, and the force by equilibrium."""
    section = ub.Section(EA=1e5, GA=1e5, EI=20.0, rhoA=1.0, rhoI=1e-3)
    upper = ub.Beam((0, 0), (1, 0), section, cells=4)
    lower = ub.Beam((1, 0), (1.5, 0.5), section, cells=4)
    loads, tips = [ub.Gravity((0, -G)), ub.PointLoad(lower.end, force=(3, 5))], []
    for multipliers in (False, True):
        joint = kind(upper.end, lower.start, multipliers=multipliers)
        parts = {"joints": [joint], "supports": [ub.Clamped(upper.start)], "loads": loads}
        solution = run(ub.Scene([upper, lower], **parts), 0.5, 0.005)
        assert solution.energy.worst < SOLVED
        tips.append(solution.displacement(lower.end))
    # Solved to 1e-10 of forces that the stiffness EA makes large
    np.testing.assert_allclose(*tips, rtol=0, atol=1e-7)
    # b is the lower beam: forces on it make its momentum grow
    mass, history = math.sqrt(0.5), solution.joint(joint)
    nodes = [solution.velocity(lower.at(s))[:, :2] for s in np.linspace(0, 1, 5)]
    grows = mass * np.diff(np.trapezoid(nodes, dx=0.25, axis=0), axis=0) / 0.005
    by_hand = grows - np.array([3.0, 5.0 - mass * G])
    np.testing.assert_allclose(history.force[1:], by_hand, atol=1e-7 * np.abs(grows).max())
    most = np.abs(history.moment).max()
    assert most == 0.0 if kind is ub.Revolute else most > 0.1


def test_what_nobody_knows_of_a_joint():
    """The moment of places that share a rotation, which is one unknown; so with forces."""
    box = ub.Body((1, 0), mass=1.0, inertia=0.1, name="box")
    rail = ub.Prismatic(ub.ground(0, 0), box.middle)
    spring = ub.Slide(ub.ground(0, 0), box.middle, ub.Spring(10.0))
    load = ub.PointLoad(box.middle, force=(0, -1), moment=3.0)
    scene = ub.Scene(bodies=[box], joints=[rail], connectors=[spring], loads=[load])
    history = run(scene, 1.0, 1.0, ub.Static()).joint(rail)
    assert history.force[-1] == pytest.approx([0.0, 1.0], abs=1e-10)
    assert np.isnan(history.moment).all()
    section = ub.Section(EA=1e4, GA=1e4, EI=10.0, rhoA=1.0, rhoI=0.01)
    left, right = (ub.Beam((x, 0), (x + 1, 0), section) for x in (0, 1))
    plate = ub.Body((1, 1), mass=1.0, inertia=0.1)
    corner = ub.Rigid(left.end, right.start, plate.at(1, 0))
    solution = run(ub.Scene([left, right], joints=[corner], bodies=[plate]), 0.02, 0.01)
    with pytest.raises(ub.ArgumentError, match="share unknowns, so that the force between them"):
        solution.joint(corner)


# -- motors and given forces -------------------------------------------------------------------


def wheel_on(law, spin=0.0, inertia=0.3):
    """A wheel on a pivot, with a connector of a law to the ground."""
    wheel = ub.Body((0, 0), mass=1.0, inertia=inertia)
    turn = ub.Turn(ub.ground(0, 0), wheel.middle, law)
    pivot, moves = ub.Revolute(ub.ground(0, 0), wheel.middle), ub.Velocity([wheel], angular=spin)
    initial = [moves] if spin else []
    return ub.Scene(bodies=[wheel], joints=[pivot], connectors=[turn], initial=initial), turn


def test_motor_bears_the_inertia():
    """A wheel with φ = α t²/2: the moment is J α, and the work J ω²/2; both exact."""
    inertia, growth = 0.3, 2.0
    scene, turn = wheel_on(ub.PrescribedMotion(lambda t: growth * t**2 / 2))
    solution = run(scene, 1.0, 0.01)
    driven = solution.connector(turn)
    np.testing.assert_allclose(driven.motion, growth * solution.times**2 / 2, atol=1e-12)
    # Turns of up to 0.02 rad in a step: (Δψ/2)² of the force
    np.testing.assert_allclose(driven.force[1:], -inertia * growth, rtol=2e-2)
    ω = solution.velocity(scene.bodies[0].middle)[:, 2]
    np.testing.assert_allclose(-driven.work, inertia * ω**2 / 2, atol=1e-12)
    np.testing.assert_allclose(solution.energy["motors"], -driven.work, atol=1e-14)
    assert ω[-1] == pytest.approx(growth, rel=1e-3)
    assert solution.energy.worst < SOLVED


def test_given_moment():
    """ω = M t/J, but for (Δψ/2)/tan(Δψ/2); the work M φ, exactly."""
    inertia, moment = 0.3, 0.6
    scene, turn = wheel_on(ub.PrescribedForce(lambda t: moment))
    solution = run(scene, 1.0, 0.01)
    wheel = scene.bodies[0].middle
    turned, ω = solution.displacement(wheel)[:, 2], solution.velocity(wheel)[-1, 2]
    assert ω == pytest.approx(moment / inertia, rel=(0.02 / 2) ** 2 / 3)
    assert inertia * ω**2 / 2 == pytest.approx(moment * turned[-1], rel=SOLVED)
    np.testing.assert_allclose(solution.energy["loads"], moment * turned, atol=1e-12)
    np.testing.assert_allclose(-solution.connector(turn).force[1:], moment, rtol=1e-12)


# -- springs and dampers -----------------------------------------------------------------------

MASS, STIFFNESS = 2.0, 50.0  # kg, N/m
OMEGA = math.sqrt(STIFFNESS / MASS)


def carriage(*laws, v0=0.3, **more):
    """A mass on a rail, the first of its connectors, and its place."""
    scene = on_rail(*laws, mass=MASS, speed=v0, **more)
    return scene, scene.connectors[0], scene.bodies[0].middle


@pytest.mark.parametrize("kind", [ub.Slide, ub.Stretch])
@pytest.mark.parametrize("more", [{}, {"joints": []}], ids=["on a rail", "free"])
def test_frequency_of_a_spring(kind, more):
    """The midpoint rule turns the phase by 2 atan(ω Δt/2) in each step: exactly."""
    scene, spring, at = carriage(ub.Spring(STIFFNESS), kind=kind, **more)
    dt = 0.02
    solution = run(scene, 4.0, dt)
    phase = 2 * math.atan(OMEGA * dt / 2) * np.arange(len(solution.times))
    amplitude = 0.3 / OMEGA
    np.testing.assert_allclose(
        solution.displacement(at)[:, 0], amplitude * np.sin(phase), atol=SOLVED * amplitude
    )
    history = solution.connector(spring)
    np.testing.assert_allclose(
        history.work, STIFFNESS * history.motion**2 / 2, atol=1e-12 * STIFFNESS * amplitude**2
    )
    np.testing.assert_allclose(solution.energy["stored"], history.work, atol=1e-14)
    # Resisting force in a step: that of its middle
    middle = (history.motion[1:] + history.motion[:-1]) / 2
    np.testing.assert_allclose(history.force[1:], STIFFNESS * middle, atol=1e-9)


def test_spring_at_large_turns():
    """Two turns of a torsional spring: its energy is k φ²/2 at any angle and step."""
    scene, spring = wheel_on(ub.Spring(5.0), spin=60.0, inertia=0.2)
    solution = run(scene, 1.0, 0.01)
    history = solution.connector(spring)
    np.testing.assert_allclose(history.work, 5.0 * history.motion**2 / 2, rtol=1e-10, atol=1e-10)
    assert history.motion.max() == pytest.approx(12.0, rel=0.01)  # ω √(J/k)
    assert solution.energy.worst < SOLVED


def test_damper():
    """v falls by (1 - c Δt/2m)/(1 + c Δt/2m) in each step; what it loses is in the ledger."""
    viscosity, dt = 4.0, 0.02
    scene, damper, at = carriage(ub.Damper(viscosity))
    solution = run(scene, 2.0, dt)
    x = viscosity * dt / (2 * MASS)
    v = 0.3 * ((1 - x) / (1 + x)) ** np.arange(len(solution.times))
    np.testing.assert_allclose(solution.velocity(at)[:, 0], v, rtol=1e-7, atol=SOLVED)
    lost = solution.energy["damping"]
    np.testing.assert_allclose(lost, MASS * (0.3**2 - v**2) / 2, atol=SOLVED)
    np.testing.assert_allclose(lost, solution.connector(damper).work, atol=1e-14)
    assert v[-1] == pytest.approx(0.3 * math.exp(-viscosity / MASS * 2.0), rel=1e-3)


def test_bouncing_mass():
    """Contact lasts π √(m/k), and the mass comes back as fast as it went."""
    stiffness, way, v0, dt = 2e4, 0.05, 0.3, 1e-3
    scene, stop, at = carriage(ub.Stop(stiffness, high=way))
    solution = run(scene, 0.5, dt)
    history = solution.connector(stop)
    touches = np.flatnonzero(history.force != 0.0)
    lasts = math.pi * math.sqrt(MASS / stiffness)
    assert len(touches) * dt == pytest.approx(lasts, abs=2 * dt)
    assert (np.diff(touches) == 1).all()
    deepest = history.motion.max() - way
    assert deepest == pytest.approx(v0 * math.sqrt(MASS / stiffness), rel=5e-3)  # between samples
    assert solution.velocity(at)[-1, 0] == pytest.approx(-v0, rel=1e-9)
    assert solution.energy.worst < SOLVED
    assert np.abs(history.work[touches[-1] + 1 :]).max() < 1e-12


# -- springs that yield and break --------------------------------------------------------------


def driven(law, motion, scheme, end=1.0, dt=0.01):
    """A connector whose motion is given."""
    scene, spring, _ = carriage(law, ub.PrescribedMotion(motion), v0=0.0)
    solution = run(scene, end, dt, scheme)
    return solution, solution.connector(spring)


STATICS = [ub.Static(), ub.EnergyMomentumStatic()]


@pytest.mark.parametrize("scheme", STATICS, ids=str)
def test_loop_of_a_bilinear_spring(scheme):
    """Kinematic hardening: a loop of amplitude U loses 4 (1 - k_t/k) f_y (U - u_y)."""
    k, limit, kinematic, amplitude = 100.0, 2.0, 25.0, 0.1
    law = ub.Spring(k, ub.ElastoPlastic(limit, kinematic=kinematic))
    way = ub.Table([0, 1, 3, 5], [0, amplitude, -amplitude, amplitude])
    solution, history = driven(law, way, scheme, end=5.0, dt=0.01)
    kt = k * kinematic / (k + kinematic)
    lost = np.interp([1.0, 5.0], solution.times, solution.energy["plastic"])
    expected = 4 * (1 - kt / k) * limit * (amplitude - limit / k)
    # Steps of 1e-3 m meet the corners at ±f_y; Static counts works to second order
    exact = scheme == ub.EnergyMomentumStatic()
    assert lost[1] - lost[0] == pytest.approx(expected, rel=1e-6 if exact else 2e-3)
    top = limit + kt * (amplitude - limit / k)
    n = np.argmin(np.abs(solution.times - 5.0))
    assert history.force[n] == pytest.approx(top, rel=1e-9)


@pytest.mark.parametrize("scheme", STATICS, ids=str)
def test_breaking_spring(scheme):
    """G_f (1 - exp(-f_u ξ/G_f)) is dissipated with the opening ξ."""
    k, limit, energy = 1e4, 20.0, 1.0
    law = ub.Spring(k, softening=ub.Softening(limit, energy))
    solution, history = driven(law, lambda t: t, scheme, end=1.0, dt=0.01)
    # Opened by 1 m: exp(-20) of the energy and of the force are left
    assert solution.energy["hinges"][-1] == pytest.approx(energy, rel=1e-6)
    assert np.diff(solution.energy["hinges"]).min() >= 0.0
    assert abs(history.force[-1]) < 1e-6 * limit
    # Steps of 0.01 m lose numerically, or count works by the trapezoidal rule
    assert history.work[-1] == pytest.approx(energy, rel=0.03)


# -- loads -------------------------------------------------------------------------------------


def test_free_fall():
    """Bodies have weight: y = -g t²/2, exactly."""
    stone = ub.Body((1, 2), mass=3.0, inertia=0.1)
    solution = run(ub.Scene(bodies=[stone], loads=[ub.Gravity((0, -G))]), 1.0, 0.1)
    moved = solution.displacement(stone.middle)
    np.testing.assert_allclose(moved[:, 1], -G * solution.times**2 / 2, atol=1e-10)
    np.testing.assert_allclose(moved[:, [0, 2]], 0.0, atol=1e-14)
    np.testing.assert_allclose(solution.energy["loads"], -3.0 * G * moved[:, 1], rtol=1e-12)


def test_off_centre_load():
    """A push at a corner: momentum F t; the work is that of the point; it starts to turn."""
    mass, inertia, force = 2.0, 0.3, (3.0, 1.0)
    box = ub.Body((0, 0), mass=mass, inertia=inertia)
    corner = box.at(0.2, 0.5)
    scene = ub.Scene(bodies=[box], loads=[ub.PointLoad(corner, force=force, moment=0.4)])
    solution = run(scene, 1.0, 0.01)
    momentum = solution.momentum()
    np.testing.assert_allclose(momentum[:, :2], np.outer(solution.times, force), atol=1e-9)
    moved = solution.displacement(corner)
    work = moved[:, :2] @ force + 0.4 * moved[:, 2]
    np.testing.assert_allclose(solution.energy["loads"], work, atol=1e-10)
    assert solution.energy.worst < SOLVED
    # At the start the moment about the centre is r x F + M, to the turn in the first step
    first = solution.velocity(box.middle)[1, 2] / 0.01
    assert first == pytest.approx((0.2 * 1.0 - 0.5 * 3.0 + 0.4) / inertia, rel=1e-3)


# -- releases ----------------------------------------------------------------------------------

STIFF = ub.Section(EA=1e4, GA=1e9, EI=1e3)
FORCE = 1e-3  # N, so that displacements are 1e-6 of the length


def released(free, load):
    """Two beams of 1 m, clamped outside, released from each other in the middle, loaded there."""
    left = ub.Beam((0, 0), (1, 0), STIFF, cells=8)
    right = ub.Beam((1, 0), (2, 0), STIFF, cells=8)
    scene = ub.Scene(
        [left, right],
        joints=[ub.Release(left.end, right.start, free=free)],
        supports=[ub.Clamped(left.start), ub.Clamped(right.end)],
        loads=[ub.PointLoad(left.end, **load)],
    )
    solution = run(scene, 1.0, 1.0, ub.Static())
    reactions = np.array([solution.reaction(s)[-1] for s in scene.supports])
    return solution.displacement(left.end)[-1], solution.displacement(right.start)[-1], reactions


def test_release_of_the_axial_force():
    """The left half alone bears it: u = F L/EA; without N and M the joint passes V on."""
    left, right, reactions = released("N", {"force": (FORCE, 0)})
    assert left[0] == pytest.approx(FORCE / 1e4, rel=1e-6)
    np.testing.assert_allclose(right, 0.0, atol=1e-12)
    np.testing.assert_allclose(reactions[1], 0.0, atol=1e-9 * FORCE)
    _, right, reactions = released("NM", {"force": (FORCE, FORCE)})
    assert reactions[0] == pytest.approx([-FORCE, -FORCE / 2, -FORCE / 2], abs=2e-6 * FORCE)
    assert reactions[1] == pytest.approx([0, -FORCE / 2, FORCE / 2], abs=2e-6 * FORCE)
    assert abs(right[0]) < 1e-10


def test_release_of_the_shear_force():
    """Rotation and its moment are shared: F L²/2EI + m L/EI = -m L/EI, so m = -F L/4."""
    left, right, reactions = released("V", {"force": (0, FORCE)})
    assert left[2] == pytest.approx(right[2], abs=1e-15)
    # Cells of 1/8 m with one point are exact for moments that are linear, but for h²/12 of v
    assert reactions[0] == pytest.approx([0, -FORCE, -0.75 * FORCE], abs=1e-6 * FORCE)
    assert reactions[1] == pytest.approx([0, 0, -0.25 * FORCE], abs=1e-6 * FORCE)
    assert left[2] == pytest.approx(FORCE / 4 / 1e3, rel=1e-6)
    assert abs(left[1] - right[1]) > 1e-8


def test_release_of_the_moment():
    """Two cantilevers: each bears half of the force, and F L/2 at its foot."""
    left, right, reactions = released("M", {"force": (0, FORCE)})
    np.testing.assert_allclose(left[:2], right[:2], atol=1e-15)
    assert left[2] == pytest.approx(-right[2], rel=1e-6)
    assert reactions[0] == pytest.approx([0, -FORCE / 2, -FORCE / 2], abs=1e-6 * FORCE)
    assert reactions[1] == pytest.approx([0, -FORCE / 2, FORCE / 2], abs=1e-6 * FORCE)


# -- many together -----------------------------------------------------------------------------


@pytest.mark.parametrize("steps", [500, pytest.param(10_000, marks=pytest.mark.slow)])
def test_momenta_and_energy_of_a_free_assembly(steps):
    """A flexible beam and bodies with all joints, spinning freely by 0.05 rad in each step."""
    section = ub.Section(EA=1e4, GA=1e4, EI=50.0, rhoA=1.0, rhoI=1e-2)
    beam = ub.Beam((0, 0), (1, 0), section, cells=4)
    arm = ub.Body((1.3, 0.1), mass=0.5, inertia=0.02, name="arm")
    sled = ub.Body((-0.4, 0.0), mass=0.3, inertia=0.05, name="sled")
    bob = ub.Body((1.8, 0.4), mass=0.4, inertia=0.01, name="bob")
    places = np.array([(0.5, 0.0), arm.center, sled.center, bob.center])
    center = tuple(np.average(places, axis=0, weights=[1.0, 0.5, 0.3, 0.4]))
    scene = ub.Scene(
        [beam],
        bodies=[arm, sled, bob],
        joints=[
            ub.Revolute(beam.end, arm.at(1, 0)),
            ub.Prismatic(beam.start, sled.middle),
            ub.Link(arm.at(1.5, 0.2), bob.at(1.7, 0.3)),
        ],
        connectors=[ub.Slide(beam.start, sled.middle, ub.Spring(20.0))],
        initial=[ub.Velocity((beam, arm, sled, bob), angular=5.0, about=center)],
    )
    solution = run(scene, 0.01 * steps, 0.01, every=50)
    assert solution.substeps == steps
    momentum = solution.momentum()
    drift = np.abs(momentum - momentum[0]).max(axis=0)
    assert (drift[:2] < 1e-10 * 2.2 * 5.0).all()  # of the total mass at 1 m from the centre
    assert drift[2] < 1e-10 * momentum[0, 2]
    energy = solution.energy.total
    assert np.abs(energy - energy[0]).max() < 1e-10 * energy[0]
    # It is no rigid motion
    assert np.ptp(solution.connector(scene.connectors[0]).motion) > 0.1


@pytest.mark.parametrize("joint", ["Revolute", "Link"])
def test_far_from_where_it_began(joint):
    """10⁴ of its sizes away in a second."""
    a, b = ub.Body((0, 0), mass=1.0, inertia=0.1), ub.Body((1, 0), mass=1.0, inertia=0.1)
    held = {
        "Revolute": ub.Revolute(a.at(0.5, 0), b.at(0.5, 0)),
        "Link": ub.Link(a.at(0.2, 0.1), b.at(0.8, 0)),
    }[joint]
    moves = ub.Velocity((a, b), linear=(1e4, 0), angular=3.0)
    solution = run(ub.Scene(bodies=[a, b], joints=[held], initial=[moves]), 1.0, 0.01)
    assert solution.substeps == 100
    one, other = held.places
    apart = np.linalg.norm(solution.position(one) - solution.position(other), axis=1)
    assert np.ptp(apart) < 100 * np.spacing(1e4)
    assert solution.energy.worst < SOLVED


def test_works_of_connectors_add_up_to_the_ledger():
    """Springs, dampers, friction, motors, functions and stops in one machine."""
    box = ub.Body((1, 0), mass=MASS, inertia=0.4, name="box")
    flap = ub.Body((1.4, 0.2), mass=0.5, inertia=0.1, name="flap")
    rail, hinge = (ub.ground(0, 0), box.middle), (box.at(1.2, 0.1), flap.at(1.2, 0.1))
    scene = ub.Scene(
        bodies=[box, flap],
        joints=[ub.Prismatic(*rail, axis=(1, 0.5)), ub.Revolute(*hinge)],
        connectors=[
            ub.Stretch(ub.ground(-1, 1), box.at(1, 0.3), ub.Spring(STIFFNESS)),
            ub.Slide(*rail, ub.Coulomb(1.0), axis=(1, 0.5)),
            ub.Slide(*rail, ub.Stop(1e3, low=-0.1, high=0.1), axis=(1, 0.5)),
            ub.Turn(*hinge, ub.Spring(3.0, ub.ElastoPlastic(0.5, 1.0))),
            ub.Turn(*hinge, ub.Damper(0.05)),
            ub.Turn(*hinge, ub.PrescribedForce(lambda t: math.sin(9 * t))),
            ub.Stretch(ub.ground(3, 0), flap.at(1.6, 0.2), ub.ForceLaw(lambda e, r: e**3 + r)),
        ],
        loads=[ub.Gravity((0, -G)), ub.PointLoad(flap.at(1.6, 0.3), force=(2, 1))],
        initial=[ub.Velocity((box, flap), linear=(1.0, 0.5))],
    )
    solution = run(scene, 2.0, 0.01)
    energy = solution.energy
    works = [solution.connector(c).work for c in scene.connectors]
    np.testing.assert_allclose(works[1], energy["friction"], atol=1e-12)
    np.testing.assert_allclose(works[4], energy["damping"], atol=1e-12)
    np.testing.assert_allclose(works[6], energy["functions"], atol=1e-12)
    kept = energy["stored"] + energy["hardening"] + energy["plastic"]
    digits = {"rtol": 1e-7, "atol": 1e-9 * energy.energy_transferred}
    np.testing.assert_allclose(works[0] + works[2] + works[3], kept, **digits)
    moved = solution.displacement(flap.at(1.6, 0.3))[:, :2] @ (2, 1)
    box_down, flap_down = (-solution.displacement(body.middle)[:, 1] for body in (box, flap))
    fallen = G * (MASS * box_down + 0.5 * flap_down)
    np.testing.assert_allclose(energy["loads"], moved + fallen - works[5], **digits)
    assert_balanced(energy)
    for name in ("friction", "damping", "plastic"):
        assert energy[name][-1] > 1e-3  # each of them does something
