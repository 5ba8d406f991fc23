# SPDX-License-Identifier: MIT
"""Laws of connectors of a user that hold the motion below a limit, and slide beyond it."""

import math
from dataclasses import dataclass
from functools import partial
from typing import ClassVar

import numpy as np
import pytest
from helpers import law_of, raises

import ufl_beam as ub
from ufl_beam.model.material_law import initial_state

f = ub.extend.law_functions


@dataclass(frozen=True)
class Dry(ub.extend.ConnectorLaw):
    """Coulomb's law."""

    force: float
    entry: ClassVar = "friction"

    def limit(self, state):
        return self.force


@dataclass(frozen=True)
class Breakaway(ub.extend.ConnectorLaw):
    """More to break loose than to slide, with Stribeck's curve and a viscous part."""

    rest: float
    slow: float
    speed: float
    viscosity: float

    def limit(self, state):
        return self.rest

    def sliding(self, motion, rate, state, dt):
        v = f.absolute(rate)
        falling = (self.rest - self.slow) * f.exp(-((v / self.speed) ** 2))
        return self.slow + falling + self.viscosity * v


@dataclass(frozen=True)
class Wearing(ub.extend.ConnectorLaw):
    """A limit that falls with the way of sliding; solvers use the names of variables as well."""

    new: float
    worn: float
    way: float
    variables: ClassVar = {"slip": 0.0, "held": 1.0, "dissipated": 2.0}

    def limit(self, state):
        return self.worn + (self.new - self.worn) * f.exp(-state.slip / (self.way * state.held))

    def increments(self, motion, rate, state, dt):
        return {"slip": f.absolute(rate) * dt, "held": 0.0, "dissipated": 0.0}


LAWS = {
    "dry": Dry(2.0), "breakaway": Breakaway(2.0, 1.2, 0.05, 0.5), "wearing": Wearing(2.0, 0.5, 0.1),
}  # fmt: skip
SCHEMES = [
    ub.EnergyMomentum(), ub.EnergyMomentum(0.1, 0.1), ub.EnergyMomentumDecaying(), ub.Static(),
]  # fmt: skip
CASES = pytest.mark.parametrize(
    ("name", "scheme"),
    # In statics a force that falls when it slides is a limit load.
    [(name, one) for name in LAWS for one in SCHEMES if (name, one) != ("breakaway", ub.Static())],
)


def oscillator(law):
    """A mass between a spring and what rubs on its rail, struck and pushed to and fro."""
    mass = ub.Body((1, 0), mass=2.0, inertia=1.0)
    rail = ub.ground(0, 0), mass.middle
    push = ub.PointLoad(mass.middle, force=(3.0, 0), amplitude=lambda t: math.sin(4 * t))
    rubbing = ub.Slide(*rail, law)
    scene = ub.Scene(
        bodies=[mass], joints=[ub.Prismatic(*rail)], loads=[push],
        connectors=[ub.Slide(*rail, ub.Spring(50.0)), rubbing],
        initial=[ub.Velocity((mass,), linear=(1.5, 0.0))],
    )  # fmt: skip
    return rubbing, scene


run = partial(ub.simulate, t=(0, 3.0), dt=0.01)


@pytest.mark.parametrize("scheme", SCHEMES, ids=str)
def test_a_constant_limit_is_dry_friction(scheme):
    solutions = []
    for law in (Dry(2.0), ub.Coulomb(2.0)):
        connector, scene = oscillator(law)
        solution = run(scene, scheme, newton=ub.Newton(rtol=1e-13))
        solutions.append(solution.connector(connector)[:4])
        lost = solution.energy.lost["friction"]
        assert lost[-1] > 0
        if isinstance(law, Dry):
            np.testing.assert_allclose(solution.connector(connector).dissipated, lost, atol=1e-15)
    for one, other in zip(*solutions, strict=True):
        np.testing.assert_allclose(one, other, rtol=0, atol=1e-11 * np.abs(other).max())


@CASES
def test_held_exactly_and_never_gives_energy(name, scheme):
    connector, scene = oscillator(LAWS[name])
    solution = run(scene, scheme)
    history, lost = solution.connector(connector), solution.energy.lost[LAWS[name].entry]
    assert np.diff(lost).min() > -1e-13 * lost[-1]
    if scheme != ub.Static():
        assert solution.energy.worst < 1e-9
    held = np.abs(np.diff(history.motion)) < 1e-13
    assert 0 < held.sum() < len(held)
    if name != "breakaway":  # whose viscous part comes on top
        largest = LAWS[name].limit(initial_state(LAWS[name]))
        assert np.abs(history.force).max() <= largest * (1 + 1e-9)


@dataclass(frozen=True)
class Drop(Breakaway):
    """More to break loose than to slide."""

    def sliding(self, motion, rate, state, dt):
        return self.slow


def test_a_slow_pull_slips_by_twice_the_drop():
    """A mass on a slow spring breaks loose at Fs, and rests after 2 (Fs - Fk)/k [closed].

    The spring moves by v T in the half period T of a slip, a part 2.5e-3 of it.
    """
    k, mass, v = 50.0, 2.0, 4e-5
    body, hand = (ub.Body((x, 0), mass=m, inertia=1.0) for x, m in ((1, mass), (2, 1.0)))
    rails = [(ub.ground(0, 0), one.middle) for one in (body, hand)]
    brake = ub.Slide(*rails[0], Drop(3.0, 2.0, 1.0, 0.0))
    pulled = ub.Slide(*rails[1], ub.PrescribedMotion(lambda t: 0.059 + v * t))
    spring = ub.Slide(body.middle, hand.middle, ub.Spring(k))
    joints = [ub.Prismatic(*rail) for rail in rails]
    scene = ub.Scene(bodies=[body, hand], joints=joints, connectors=[brake, pulled, spring])
    start = run(scene, ub.Static(), t=(-1, 0), dt=1.0)
    solution = run(scene, ub.EnergyMomentum(), t=(0, 30), start=start)
    pull = solution.connector(spring).force
    assert pull.max() == pytest.approx(3.0, rel=1e-4)
    slipped = solution.connector(brake).motion[-1]
    assert slipped == pytest.approx(2 * (3.0 - 2.0) / k, rel=5e-3)
    after = pull[np.argmax(pull) + 200]  # at rest again
    assert after == pytest.approx(2 * 2.0 - 3.0, rel=5e-3)


def test_a_run_that_goes_on_takes_the_limit_of_its_scene():
    """A sliding body whose rail becomes rougher."""
    body = ub.Body((1, 0), mass=2.0, inertia=1.0)

    def slider(limit, **more):
        rail = ub.Slide(ub.ground(0, 0), body.middle, ub.Coulomb(limit))
        joint = ub.Prismatic(ub.ground(0, 0), body.middle)
        return rail, ub.Scene(bodies=[body], joints=[joint], connectors=[rail], **more)

    _, scene = slider(5.0, initial=[ub.Velocity([body], (3.0, 0.0))])
    start = run(scene, ub.EnergyMomentum(), t=(0, 0.1))
    rail, scene = slider(10.0)
    solution = run(scene, ub.EnergyMomentum(), t=(0.1, 0.2), start=start)
    assert solution.connector(rail).force[1:] == pytest.approx(np.full(10, 10.0), rel=1e-12)


@pytest.mark.parametrize("dt", [5e-3, 1.875e-3, pytest.param(4.7e-4, marks=pytest.mark.slow)])
def test_iterations_do_not_decide_what_breaks_loose(dt, as_by_reference):
    """To stick and to slide can both solve a step.

    A run that goes on, which has other guesses, and the reference solver find the same solution.
    """
    beam = ub.Beam((0, 0), (1, 0.2), ub.Section(1e4, 4e3, 100, rhoA=1, rhoI=0.01), cells=4)
    load = ub.PointLoad(beam.end, force=(13.0, 1.5), amplitude=ub.ramp(0.06))
    brake = ub.Turn(ub.ground(0, 0), beam.end, Drop(0.5, 0.285, 1.0, 0.0))
    swing = ub.Velocity([beam], linear=(0.3, 1.0), angular=0.22, about=(0, 0))
    scene = ub.Scene(beams=[beam], loads=[load], connectors=[brake], initial=[swing])
    more = {"dt": dt, "newton": ub.Newton(rtol=1e-12), "mesh": ub.Mesh(degree=3, lumped=True)}
    whole = run(scene, ub.EnergyMomentum(), t=(0.0, 0.15), **more)
    as_by_reference(whole)
    held = np.abs(np.diff(whole.connector(brake).motion)) < 1e-8
    assert np.count_nonzero(np.diff(held)) > 2
    for n in range(1, 8, 2):
        until = whole.times[n * len(whole.times) // 8]
        first = run(scene, ub.EnergyMomentum(), t=(0.0, until), **more)
        rest = run(scene, ub.EnergyMomentum(), t=(until, 0.15), start=first, **more)
        np.testing.assert_allclose(rest.q[-1], whole.q[-1], rtol=0, atol=1e-9)


def test_what_wears_is_lost():
    """The way of sliding is the variable, and the loss its integral of the limit [closed]."""

    def error(dt):
        connector, scene = oscillator(LAWS["wearing"])
        solution = run(scene, ub.EnergyMomentum(), dt=dt)
        way = np.abs(np.diff(solution.connector(connector).motion)).sum()
        lost = 0.5 * way + 1.5 * 0.1 * (1 - math.exp(-way / 0.1))
        return abs(solution.energy.lost["connectors"][-1] - lost)

    fine = error(0.01)
    assert fine < error(0.02) < 0.02
    assert fine < 2e-3


def unit(*_):
    return 1.0


@pytest.mark.parametrize(
    ("members", "message"),
    [
        ({"limit": unit, "energy": lambda s, e, z: e**2}, "has a limit, which is for"),
        ({"limit": unit, "components": 2}, "has a limit, which is for"),
        ({"energy": lambda s, e, z: e, "sliding": unit}, "and no limit"),
        ({"limit": lambda s, z: None}, "Mine.limit returns None"),
        ({"limit": lambda s, z: -1.0}, "Mine.limit returns -1.0 at no motion; it must return the"),
        (
            {"limit": unit, "sliding": lambda s, e, r, z, dt: e - 1.0},
            "Mine.sliding returns array([-1.]) at no motion; it must return the size",
        ),
        ({"limit": unit, "sliding": lambda s, e, r, z, dt: e / 0}, "Mine.sliding"),
    ],
)
def test_wrong_limits_are_refused(members, message):
    beam = ub.Beam((0, 0), (1, 0), ub.Section(EA=1e5, GA=1e5, EI=3.0))
    with raises(message):
        ub.Turn(ub.ground(1, 0), beam.end, law_of(**members))


def test_where_friction_is_refused():
    _, scene = oscillator(Dry(2.0))
    with raises("needs the mean velocity of a step"):
        run(scene, ub.Newmark())
    with raises("a path has none"):
        ub.follow(scene, ub.LoadControl(0.2), steps=5)


HOLDING = [
    ub.Coulomb(10.0),
    ub.RigidPlastic(ub.Softening(10.0, 3.0)),
    ub.PrescribedMotion(lambda t: 0.0),
]


def held_body(law, axis, *, turns=False):
    """A body on a joint with this axis, which a law holds against a load that grows."""
    ground, axis = ub.ground(*np.zeros(len(axis))), np.array(axis) / np.linalg.norm(axis)
    inertia = 1.3 if len(axis) == 2 else 1.3 * np.eye(3)
    body = ub.Body(ground.point, mass=1.0, inertia=inertia)
    joint, connector = (ub.Revolute, ub.Turn) if turns else (ub.Prismatic, ub.Slide)
    push = np.arange(1.0, len(axis) + 1)
    load = {"moment": 5 * axis} if turns else {"force": push}
    drive = connector(ground, body.middle, law, axis=axis)
    scene = ub.Scene(
        bodies=[body],
        joints=[joint(ground, body.middle, axis=axis)],
        connectors=[drive],
        loads=[ub.PointLoad(body.middle, amplitude=lambda t: t, **load)],
    )
    return scene, drive, 5.0 if turns else push @ axis


@pytest.mark.parametrize("turns", [True, False], ids=["turn", "slide"])
@pytest.mark.parametrize("law", HOLDING, ids=lambda law: type(law).__name__)
def test_a_body_at_rest_in_space_is_held_without_warning(law, turns):
    """Its motion is round-off of the forces; no tolerance is relative to that."""
    for axis in ((-0.443, -0.046, 0.895), (0.3, -0.7, 0.2), (1.0, 2.0, 2.0), (-0.6, 0.1, 0.9)):
        scene, drive, force = held_body(law, axis, turns=turns)
        run = ub.simulate(scene, ub.EnergyMomentum(), t=(0, 0.5), dt=2e-3)
        history = run.connector(drive)
        assert np.allclose(history.force[1:], force * (run.times[1:] - 1e-3), rtol=0, atol=1e-9)
        assert np.abs(history.motion).max() < 1e-25  # m, rad


def test_friction_holds_a_slider_on_a_skew_guide_in_statics():
    """Friction resists no large force, so the stiffness in the first equilibrium decides."""
    for axis in ((-0.5179661, -0.85540115), (0.9, 0.4), (0.6, 0.8), (-0.1, 1.0)):
        scene, drive, force = held_body(HOLDING[0], axis)
        run = ub.simulate(scene, ub.Static(), t=(0, 0.5), dt=0.1)
        assert np.allclose(run.connector(drive).force[1:], force * run.times[1:])


@pytest.mark.parametrize("scheme", [ub.Static(), ub.EnergyMomentumStatic(theta=0.5)])
@pytest.mark.parametrize("seed", range(6))
def test_forces_that_hold_an_arm_of_bodies_in_space(seed, scheme):
    """Three slides and turns in a row bear the force at the tip; nothing moves or is elastic."""
    rng = np.random.default_rng(seed)
    points, before = rng.normal(size=(4, 3)), ub.ground(0, 0, 0)
    points[0], tip, force = 0.0, points[3], 10 * rng.normal(size=3)
    bodies, joints, drives, borne = [], [], [], []
    for k, axis in enumerate(rng.normal(size=(3, 3))):
        axis /= np.linalg.norm(axis)
        body = ub.Body((points[k] + points[k + 1]) / 2, mass=1.0, inertia=np.eye(3))
        ends, turns = (before, body.at(*points[k])), (seed + k) % 3 == 0
        law = (ub.Coulomb(1e3), HOLDING[2], ub.RigidPlastic(ub.Softening(1e3, 1.0)))[k]
        joints.append((ub.Revolute if turns else ub.Prismatic)(*ends, axis=axis))
        drives.append((ub.Turn if turns else ub.Slide)(*ends, law, axis=axis))
        borne.append(axis @ (np.cross(tip - points[k], force) if turns else force))
        bodies.append(body)
        before = body.at(*points[k + 1])
    load = ub.PointLoad(before, force=force, amplitude=lambda t: t)
    scene = ub.Scene(bodies=bodies, joints=joints, connectors=drives, loads=[load])
    run = ub.simulate(scene, scheme, t=(0, 0.5), dt=0.02)
    middle = 0.01 if scheme != ub.Static() else 0.0  # s, from there to the end of a step
    for drive, of_load in zip(drives, borne, strict=True):
        history = run.connector(drive)
        assert np.allclose(history.force[1:], of_load * (run.times[1:] - middle), atol=1e-9)
        assert np.abs(history.motion).max() < 1e-20  # m, rad
