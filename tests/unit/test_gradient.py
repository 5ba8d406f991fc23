# SPDX-License-Identifier: MIT
"""The adjoint of runs, against direct differentiation of the same runs."""

import dataclasses
import inspect
import math
from dataclasses import dataclass
from itertools import pairwise
from typing import ClassVar

import numpy as np
import pytest
import ufl

import ufl_beam as ub

STEEL = {"EA": 2.1e9, "GA": 6.7e8, "rhoA": 78.5, "rhoI": 0.065}


def tip(solution):
    """Horizontal displacement of the end of the last beam; (n+1,); m."""
    return solution.displacement(solution.scene.beams[-1].end)[:, 0]


def pulse(t):
    return math.sin(math.pi * t / 0.2) if t < 0.2 else 0.0


def column(section, load=35e3, mass=400.0, hinges=None, height=3.0, **more):
    beam = ub.Beam((0, 0), (0, height), section, cells=6, name="column", hinges=hinges or {})
    return ub.Scene(
        [beam],
        supports=[ub.Clamped(beam.start)],
        masses=[ub.PointMass(beam.end, mass)],
        loads=[ub.PointLoad(beam.end, force=(load, 0.0), amplitude=pulse)],
        **more,
    )


def flying(EI=100.0, rhoA=1.0, load=8.0, speed=0.5, length=10.0):
    section = ub.Section(EA=1e4, GA=1e4, EI=EI, rhoA=rhoA, rhoI=10.0)
    beam = ub.Beam((0.6 * length, 0), (0, 0.8 * length), section, cells=6)
    push = ub.PointLoad(beam.start, force=(load, 0), moment=-10 * load)
    return ub.Scene([beam], loads=[push], initial=[ub.Velocity([beam], linear=(speed, 0.0))])


def yielding(limit=60e3, isotropic=4e5, kinematic=2e5, EI=9.0e6, load=35e3, mass=400.0):
    law = ub.ElastoPlastic(limit, isotropic, kinematic)
    return column(ub.Section(EI=EI, bending=law, **STEEL), load, mass)


def fibres(limit=235e6, isotropic=2e9, E=210e9, height=0.2, load=60e3, length=3.0):
    some = ub.Fibres(ub.ElastoPlastic(limit, isotropic), number=4)
    section = ub.Section.rectangle(0.1, height, E=E, nu=0.3, rho=7850.0, fibres=some)
    return column(section, load, height=length)


def softening(limit=60e3, energy=6e3, EI=9.0e6, load=40e3):
    weak = ub.Softening(limit, energy)
    return column(ub.Section(EI=EI, hinge=weak, **STEEL), load)


def sprung(stiffness=300.0, moment=30.0, length=1.0, EI=100.0, tau=0.0):
    section = ub.Section(EA=1e4, GA=4e3, EI=EI, rhoA=1.0, rhoI=0.01)
    beam = ub.Beam((0, 0), (length, 0.2), section, cells=4)
    spring = ub.Spring(stiffness, law=ub.ElastoPlastic(20.0, 30.0))
    return ub.Scene(
        [beam],
        supports=[ub.Pinned(beam.start)],
        connectors=[ub.Turn(ub.ground(0, 0), beam.start, spring)],
        loads=[ub.PointLoad(beam.end, moment=moment)],
        damping=[ub.Rayleigh(mass=1.0, stiffness=1e-3)],
    )


def machine(viscosity=3.0, force=20.0, stroke=0.2, stiffness=500.0, EI=100.0, length=1.0):
    """A crank with a motor, a damper, an actuator, a backbone and a nonlinear law; joints."""
    section = ub.Section(EA=1e4, GA=4e3, EI=EI, rhoA=1.0, rhoI=0.01)
    a = ub.Beam((0, 0), (length, 0), section, cells=3)
    b = ub.Beam((length, 0), (length, 1.0), section, cells=3)
    motor = ub.PrescribedMotion(lambda t: stroke * math.sin(8 * t))
    return ub.Scene(
        [a, b],
        joints=[ub.Revolute(a.end, b.start, multipliers=True)],
        supports=[ub.Pinned(a.start)],
        connectors=[
            ub.Turn(ub.ground(0, 0), a.start, motor),
            ub.Turn(a.end, b.start, ub.Damper(viscosity)),
            ub.Stretch(ub.ground(0, 1.0), b.end, ub.PrescribedForce(lambda t: force * t)),
            ub.Turn(a.end, b.start, ub.Stop(stiffness, low=-0.05, high=0.05)),
        ],
    )


def shaken(amplitude=0.02, EI=9.0e6, angle=0.3):
    beam = ub.Beam((0, 0), (0.5, 3), ub.Section(EI=EI, **STEEL), cells=4)
    motion = ub.PrescribedDisplacement(
        beam.start, u=lambda t: amplitude * math.sin(20 * t), v=0, psi=0
    )
    roller = ub.Roller(beam.end, along=(math.cos(angle), math.sin(angle)))
    return ub.Scene([beam], supports=[motion, roller])


def heated(strain=2e-3, curvature=0.05, EI=100.0, rate=40.0, length=3.0, limit=math.inf):
    """Imposed strains on an elastic or yielding beam, and on an elastic one beside it."""
    soft = {"EA": 1e4, "GA": 4e3, "rhoA": 1.0, "rhoI": 0.01}
    law = ub.ElastoPlastic(limit, 30.0) if limit < math.inf else None
    a = ub.Beam((0, 0), (0.2, length), ub.Section(EI=EI, bending=law, **soft), cells=3)
    b = ub.Beam((0.2, length), (0, 6), ub.Section(EI=EI, **soft), cells=3)
    return ub.Scene(
        [a, b],
        joints=[ub.Rigid(a.end, b.start)],
        supports=[ub.Clamped(a.start)],
        loads=[
            ub.ImposedStrain(a, strain, (curvature, 0.1 * curvature), lambda t: math.sin(rate * t)),
            ub.ImposedStrain(b, strain, curvature, lambda t: 5.0 * t),
            ub.PointLoad(b.end, force=(2.0, 0.0), amplitude=pulse),
        ],
        damping=[ub.KelvinVoigt(1e-4)],
    )


def heated_and_yielding(strain=2e-3, EI=100.0, rate=40.0, length=3.0, limit=1.0):
    return heated(strain, 0.05, EI, rate, length, limit)


@dataclass(frozen=True)
class Wearing(ub.extend.ConnectorLaw):
    """Holds below a limit that falls with the way of sliding."""

    new: float
    worn: float
    way: float
    variables: ClassVar = {"slipped": 0.0}

    def limit(self, state):
        return self.worn + (self.new - self.worn) * ub.extend.law_functions.exp(
            -state.slipped / self.way
        )

    def sliding(self, motion, rate, state, dt):
        return self.limit(state) + 0.3 * ub.extend.law_functions.absolute(rate)

    def increments(self, motion, rate, state, dt):
        return {"slipped": ub.extend.law_functions.absolute(rate) * dt}


def rubbing(limit=12e3, EI=9.0e6, load=35e3, mass=400.0, worn=9e3, strength=60e3, tau=1e-3):
    """A column that yields, with brakes at its head and at half its height; they stick and slip."""
    law = ub.ElastoPlastic(strength, 4e5, 2e5)
    scene = column(ub.Section(EI=EI, bending=law, **STEEL), load, mass)
    column_ = scene.beams[0]
    brakes = [
        ub.Slide(ub.ground(0, 3), column_.end, ub.Coulomb(limit), axis=(1, 0)),
        ub.Slide(ub.ground(0, 1.5), column_.at(0.5), Wearing(limit, worn, 0.01), axis=(1, 0)),
    ]
    return ub.Scene(
        scene.beams,
        supports=scene.supports,
        masses=scene.masses,
        loads=scene.loads,
        connectors=brakes,
        damping=[ub.KelvinVoigt(tau)],
    )


def crossed(speed=1.3, bend=0.3, mass=0.5, load=3.0, EI=100.0, length=2.0, limit=math.inf):
    """A mass and a force that cross the nodes of a beam, whose foot yields if it has a limit."""

    def place(t):
        return 0.1 + speed * t + bend * t**2

    law = None if limit == math.inf else ub.ElastoPlastic(limit, 20.0, 10.0)
    section = ub.Section(EA=1e4, GA=8e3, EI=EI, rhoA=1.0, rhoI=0.05, bending=law)
    beam = ub.Beam((0, 0), (length, 0.3), section, cells=4)
    loads = [
        ub.MovingLoad(beam, place, (0, -load), mass=mass),
        ub.MovingLoad(beam, lambda t: speed * t / 2, (load, 0), amplitude=lambda t: 1 - t),
    ]
    supports, damping = [ub.Clamped(beam.start)], [ub.KelvinVoigt(0.01)]
    return ub.Scene([beam], supports=supports, loads=loads, damping=[] if law else damping)


def crossed_and_yielding(speed=1.3, mass=0.5, load=3.0, limit=4.0):
    return crossed(speed, 0.3, mass, load, limit=limit)


def guided(radius=2.0, dent=0.5, load=8.0, EI=100.0, tau=0.01):
    """A curve whose points are not at equal distances for equal steps of its parameter."""

    def curve(s):
        return 2 * ufl.cos(s) + dent * ufl.sin(s) ** 2, 0.3 + radius * ufl.sin(s) * (1 + s / 5)

    section = ub.Section(EA=1e4, GA=8e3, EI=EI, rhoA=1.0, rhoI=0.05)
    beam = ub.Beam((0, 0), (2, 0.3), section, cells=4)
    return ub.Scene(
        [beam],
        supports=[ub.Clamped(beam.start)],
        joints=[ub.Guided(beam.end, curve)],
        loads=[ub.PointLoad(beam.end, (0, load), amplitude=lambda t: t)],
        damping=[ub.KelvinVoigt(tau)],
    )


def held(limit=5.0, stiffness=2e5, EI=100.0, load=20.0):
    """A cantilever with two brakes at its end, which share what they hold."""
    section = ub.Section(EA=1e4, GA=4e3, EI=EI, rhoA=1.0, rhoI=0.01)
    beam = ub.Beam((0, 0), (1, 0.2), section, cells=4)
    laws = ub.Coulomb(limit), ub.Coulomb(1.5 * limit), ub.ForceLaw(lambda e, _: stiffness * e**3)
    brakes = [ub.Slide(ub.ground(1, 0.2), beam.end, law, axis=(0, 1)) for law in laws]
    push = ub.PointLoad(beam.end, force=(0.3 * load, load), amplitude=lambda t: t)
    return ub.Scene([beam], supports=[ub.Clamped(beam.start)], connectors=brakes, loads=[push])


def asked(stiffness=2e5, viscosity=4e3, tau=0.05, strength=60e3, EI=9.0e6, load=60e3, start=10.0):
    """A yielding column with a nonlinear damper, a Maxwell element and a spring that yields."""

    def damper(motion, rate):
        return stiffness * motion * (1 + 5 * motion) + viscosity * rate * (1 + 0.1 * rate**2)

    def maxwell(motion, rate, dt, state):
        after = (state[0] + stiffness * rate * dt) / (1 + dt / tau)
        return (state[0] + after) / 2, [after]

    def yields(motion, rate, t, state):
        force, limit = 5e5 * (motion - state[0]), 2e3 + 1e3 * t
        over = max(0.0, abs(force) - limit) / 6e5
        slip = math.copysign(over, force)
        return force - 5e5 * slip, [state[0] + slip]

    law = ub.ElastoPlastic(strength, 4e5, 2e5)
    scene = column(ub.Section(EI=EI, bending=law, **STEEL), load)
    end, half = scene.beams[0].end, scene.beams[0].at(0.5)
    laws = [
        (half, ub.ForceLaw(damper)),
        (end, ub.ForceLaw(maxwell, [start])),
        (half, ub.ForceLaw(yields, [0.0])),
    ]
    connectors = [ub.Slide(ub.ground(*place.point), place, law, axis=(1, 0)) for place, law in laws]
    return ub.Scene(
        scene.beams,
        supports=scene.supports,
        masses=scene.masses,
        loads=scene.loads,
        connectors=connectors,
    )


def turning(mass=0.2, stiffness=0.01, EI=100.0, rhoA=1.0, length=2.0, speed=1.0):
    """Rayleigh damping by the tangents of a beam that turns far, and moves at the beginning."""
    section = ub.Section(EA=1e4, GA=8e3, EI=EI, rhoA=rhoA, rhoI=0.05)
    beam = ub.Beam((0, 0), (length, 0.3), section, cells=4)
    return ub.Scene(
        [beam],
        supports=[ub.Pinned(beam.start)],
        loads=[ub.PointLoad(beam.end, (0, 8))],
        initial=[ub.Velocity([beam], angular=speed, about=(0, 0))],
        damping=[ub.Rayleigh(mass=mass, stiffness=stiffness, tangent=True)],
    )


def damped(scene, mass, stiffness):
    matrix = ub.Rayleigh(mass=mass, stiffness=stiffness, tangent=True)
    return dataclasses.replace(scene, damping=(matrix,))


def damped_fibres(limit=235e6, E=210e9, height=0.2, load=60e3, mass=0.5, stiffness=2e-3):
    return damped(fibres(limit, 2e9, E, height, load), mass, stiffness)


def damped_softening(limit=60e3, energy=6e3, EI=9.0e6, load=40e3, stiffness=2e-3):
    return damped(softening(limit, energy, EI, load), 0.5, stiffness)


CASES = {
    "flying": (flying, {}, ub.EnergyMomentum(0.01, 0.01), 2.0, 0.05),
    "decaying": (flying, {}, ub.EnergyMomentumDecaying(), 2.0, 0.05),
    "Newmark": (flying, {}, ub.Newmark(0.6, 0.31), 2.0, 0.05),
    "generalized alpha": (machine, {}, ub.GeneralizedAlpha(0.8), 0.6, 0.01),
    "order 4": (flying, {}, ub.EnergyMomentum(order=4), 2.0, 0.1),
    "yielding": (yielding, {}, ub.EnergyMomentum(0.02), 0.4, 0.004),
    "fibres": (fibres, {}, ub.EnergyMomentum(0.02), 0.4, 0.004),
    "softening": (softening, {}, ub.EnergyMomentum(0.02), 0.2, 0.002),
    "springs": (sprung, {"tau": None}, ub.EnergyMomentum(), 1.0, 0.02),
    "machine": (machine, {}, ub.EnergyMomentum(), 0.6, 0.01),
    "friction": (rubbing, {}, ub.EnergyMomentum(0.02), 0.4, 0.004),
    "friction in statics": (held, {}, ub.Static(), 1.0, 0.05),
    "friction, decaying": (rubbing, {}, ub.EnergyMomentumDecaying(), 0.4, 0.004),
    "laws of users": (asked, {}, ub.EnergyMomentum(), 0.4, 0.004),
    "laws of users, alpha": (asked, {}, ub.GeneralizedAlpha(0.8), 0.4, 0.004),
    "moving support": (shaken, {"angle": None}, ub.EnergyMomentum(), 0.5, 0.01),
    "imposed strains": (heated, {"limit": None}, ub.EnergyMomentum(0.02, 0.01), 0.2, 0.004),
    "imposed strains, statics": (heated, {"limit": None}, ub.Static(), 0.2, 0.02),
    "imposed strains, yielding": (heated_and_yielding, {}, ub.EnergyMomentum(), 0.2, 0.004),
    "moving loads": (crossed, {"limit": None}, ub.EnergyMomentum(0.02, 0.01), 1.2, 0.05),
    "moving loads, Newmark": (crossed, {"limit": None}, ub.Newmark(0.6, 0.31), 1.2, 0.05),
    "moving loads, yielding": (crossed_and_yielding, {}, ub.GeneralizedAlpha(0.8), 1.2, 0.05),
    "guide": (guided, {}, ub.EnergyMomentum(0.02), 1.0, 0.05),
    "guide, generalized alpha": (guided, {}, ub.GeneralizedAlpha(0.8), 1.0, 0.05),
    "damping by tangents": (turning, {}, ub.EnergyMomentum(), 1.0, 0.05),
    "damping by tangents, Newmark": (turning, {}, ub.Newmark(0.6, 0.31), 1.0, 0.05),
    "damping by tangents, fibres": (damped_fibres, {}, ub.EnergyMomentum(0.02), 0.4, 0.004),
    "damping by tangents, hinge": (damped_softening, {}, ub.EnergyMomentum(0.02), 0.2, 0.002),
    "statics": (flying, {}, ub.Static(), 1.0, 0.1),
}


def parameters(model, without):
    names = model.__code__.co_varnames[: model.__code__.co_argcount]
    values = dict(zip(names, model.__defaults__, strict=True))
    return {name: x for name, x in values.items() if name not in without}


@pytest.mark.parametrize("name", CASES)
def test_adjoint_equals_direct_differentiation(name):
    """They are the same sums in another order; the factor 1e-10 is the round-off of differences."""
    model, without, scheme, end, dt = CASES[name]
    if name == "statics":

        def clamped(EI=100.0, load=8.0, length=10.0):
            free = flying(EI, 1.0, load, 0.0, length)
            beam = free.beams[0]
            push = ub.PointLoad(beam.start, force=(load, 0), amplitude=lambda t: 0.1 * t)
            return ub.Scene([beam], supports=[ub.Clamped(beam.end)], loads=[push])

        def top(solution):
            return solution.displacement(solution.scene.beams[0].start)[:, 0]

        model, without, of = clamped, {}, top
    else:
        of = tip if name != "moving support" else middle
    at = parameters(model, without)
    arguments = (model, at, scheme)
    times = {"t": (0, end), "dt": dt}
    direct = ub.differentiate(*arguments, **times, progress=False).of(lambda s: of(s)[-1])
    _, found = ub.gradient(*arguments, **times, of=of)
    np.testing.assert_allclose(found, direct, rtol=1e-8, atol=1e-10 * np.abs(direct).max())
    _, parts = ub.gradient(*arguments, **times, of=of, max_bytes=1e5)
    np.testing.assert_allclose(parts, found, rtol=1e-10, atol=1e-13 * np.abs(found).max())


def middle(solution):
    """Motion of the middle of a beam, (n+1, 2), and its velocity at an angle."""
    return solution.displacement(solution.scene.beams[0].at(0.5))[:, 0]


OF_HISTORIES = "yielding", "moving loads", "moving loads, yielding", "guide", "damping by tangents"


@pytest.mark.parametrize("name", OF_HISTORIES)
def test_number_may_depend_on_the_whole_history(name):
    model, without, scheme, end, dt = CASES[name]
    run = (model, parameters(model, without), scheme)
    times = {"t": (0, end), "dt": dt}

    def both(solution):
        place = solution.scene.beams[0].at(0.75)
        return np.column_stack([solution.displacement(place), solution.velocity(place)])

    def number(x):
        return float(np.max(x[:, 0]) + 0.01 * np.mean(x[:, 3] ** 2))

    direct = ub.differentiate(*run, **times, progress=False).of(lambda s: number(both(s)))
    _, found = ub.gradient(*run, **times, of=both, reduce=number, max_bytes=1e5)
    atol = 1e-10 * np.abs(direct).max()
    np.testing.assert_allclose(found, direct, rtol=1e-7, atol=atol)  # of differences of squares


def test_stiffness_of_each_cell():
    """A map of 24 parameters, of which some are compared with direct differentiation."""

    def pieces(**EI):
        sections = [ub.Section(EI=x, **STEEL) for x in EI.values()]
        beams = [
            ub.Beam((0, 0.125 * k), (0, 0.125 * (k + 1)), section, cells=1)
            for k, section in enumerate(sections)
        ]
        joints = [ub.Rigid(a.end, b.start) for a, b in pairwise(beams)]
        push = ub.PointLoad(beams[-1].end, force=(1e4, 0.0), amplitude=pulse)
        return ub.Scene(beams, joints=joints, supports=[ub.Clamped(beams[0].start)], loads=[push])

    at = {f"EI{k}": 9e6 for k in range(24)}
    times = {"t": (0, 0.1), "dt": 0.002}
    _, found = ub.gradient(pieces, at, ub.EnergyMomentum(), **times, of=tip)
    some = ("EI0", "EI11", "EI23")
    direct = ub.differentiate(
        lambda **values: pieces(**(at | values)),
        {name: at[name] for name in some},
        ub.EnergyMomentum(),
        **times,
        progress=False,
    ).of(lambda s: tip(s)[-1])
    # The derivative by the stiffness of the tip is small; errors are round-off of differences.
    np.testing.assert_allclose(
        found[[0, 11, 23]], direct, rtol=1e-9, atol=1e-9 * np.abs(direct).max()
    )


def refused(message, model=flying, scheme=None, of=tip, **more):
    with pytest.raises(ub.ArgumentError, match=message):
        ub.gradient(
            model, {"EI": 100.0}, scheme or ub.EnergyMomentum(), t=(0, 1), dt=0.1, of=of, **more
        )


def pinned(EI=2e6, mass=4e3, load=1e6, length=1.0):
    """Two beams with a pin between them, whose force exceeds the motion by a factor of 1e8."""
    section = ub.Section(EI=EI, EA=2e10, GA=8e9, rhoA=800.0, rhoI=1.0)
    left = ub.Beam((0, 0), (length, 0), section, cells=3)
    right = ub.Beam((length, 0), (2 * length, 0), section, cells=3)
    return ub.Scene(
        [left, right],
        joints=[ub.Revolute(left.end, right.start, multipliers=True)],
        supports=[ub.Clamped(left.start), ub.Clamped(right.end)],
        masses=[ub.PointMass(left.end, mass)],
        loads=[ub.PointLoad(left.end, force=(0, load))],
    )


def test_curved_histories_beside_large_forces_of_joints():
    def distance(s):
        u, v, psi = s.displacement(s.scene.beams[0].end).T
        return np.column_stack([np.hypot(1 + u, 0.2 + v), np.cos(psi)])

    def number(history):
        return float(history[-1].sum())

    at, options = parameters(pinned, {"length"}), {"t": (0, 0.3), "dt": 0.01}
    run = ub.differentiate(pinned, at, ub.EnergyMomentum(), progress=False, **options)
    assert np.abs(run.solution.q).max() > 1e7
    _, found = ub.gradient(pinned, at, ub.EnergyMomentum(), of=distance, reduce=number, **options)
    np.testing.assert_allclose(found, run.of(lambda s: number(distance(s))), rtol=1e-6)


def balance(arm=0.7, k=50.0, speed=2.0):
    """A body with a point at a distance that is a parameter, and a beam that carries it."""
    section = ub.Section(EI=50.0, EA=1e5, GA=1e5, rhoA=1.0, rhoI=0.01)
    beam = ub.Beam((0, 0), (1, 0), section, cells=2)
    body = ub.Body((1 + arm / 2, 0), mass=2.0, inertia=0.1)
    spring = ub.Slide(ub.ground(1, 0), beam.end, ub.Spring(k), axis=(0, 1))
    return ub.Scene(
        [beam],
        bodies=[body],
        joints=[ub.Rigid(beam.end, body.at(1, 0))],
        connectors=[spring],
        supports=[ub.Pinned(beam.start)],
        initial=[ub.Velocity([beam, body], angular=speed, about=(0, 0))],
    )


@pytest.mark.parametrize("scheme", [ub.EnergyMomentum(), ub.EnergyMomentum(order=4)], ids=repr)
def test_histories_of_positions_and_of_points_of_bodies(scheme):
    """They depend on the geometry, also if the motion does not change."""

    def far(s):
        (body,), (beam,) = s.scene.bodies, s.scene.beams
        arm = 2 * (body.center[0] - 1)
        point = body.at(1 + arm, 0)
        return np.column_stack([s.displacement(point), s.position(point), s.velocity(beam.end)])

    def number(history):
        return float((history[-1] * np.arange(1, 1 + history.shape[1])).sum())

    at, options = parameters(balance, {}), {"t": (0, 0.5), "dt": 0.02}
    run = ub.differentiate(balance, at, scheme, progress=False, **options)
    _, found = ub.gradient(balance, at, scheme, of=far, reduce=number, **options)
    np.testing.assert_allclose(found, run.of(lambda s: number(far(s))), rtol=1e-8)


def test_logarithm_of_the_last_of_many_decaying_swings():
    """The last swing has 1e-7 of the first."""

    def decaying(k=400.0, c=6.0):
        body = ub.Body((0, 0), mass=1.0, inertia=1.0)
        ends = ub.ground(0, 0), body.at(0, 0)
        laws = ub.Spring(k), ub.Damper(c)
        connectors = [ub.Slide(*ends, law, axis=(1, 0)) for law in laws]
        start = ub.Velocity([body], linear=(1.0, 0.0))
        return ub.Scene([], bodies=[body], connectors=connectors, initial=[start])

    def motion(s):
        return s.displacement(s.scene.bodies[0].at(0, 0))[:, 0]

    def decay(history):
        return math.log(abs(history[-1] / history[20]))

    run = decaying, parameters(decaying, {}), ub.EnergyMomentum()
    times = {"t": (0, 5.0), "dt": 0.01}
    direct = ub.differentiate(*run, **times, progress=False).of(lambda s: decay(motion(s)))
    _, found = ub.gradient(*run, **times, of=motion, reduce=decay)
    np.testing.assert_allclose(found, direct, rtol=1e-6)


def test_wrong_arguments_are_refused():
    refused("must return a history", of=lambda s: tip(s)[-1])
    refused("the history is not finite at t = 0 s", of=lambda s: np.where(s.times > 0, 0.0, np.nan))
    refused("forces or energies; use differentiate", of=lambda s: s.energy.state["stored"])
    refused("max_bytes", max_bytes=-1.0)


def test_history_of_velocities_with_friction_and_laws_of_users():
    times = {"t": (0, 0.4), "dt": 0.004}

    def speed(solution):
        return solution.velocity(solution.scene.beams[0].at(0.75))[:, 0]

    def number(history):
        return float(np.mean(history**2))

    for model in (rubbing, asked):
        run = model, parameters(model, {}), ub.EnergyMomentum(0.01)
        direct = ub.differentiate(*run, **times, progress=False).of(lambda s: number(speed(s)))
        _, found = ub.gradient(*run, **times, of=speed, reduce=number, max_bytes=1e5)
        values = np.array(list(run[1].values()))  # for relative changes; differences of squares
        most = np.abs(values * direct).max()
        np.testing.assert_allclose(values * found, values * direct, rtol=1e-7, atol=1e-8 * most)


def test_friction_with_the_force_of_a_joint_is_refused_by_name():
    def brake(EI):
        beam = flying(EI).beams[0]
        pin = ub.Pinned(beam.start)
        law = ub.Coulomb(1.0, coefficient=0.1, joint=pin)
        brake = ub.Turn(ub.ground(*beam.start.point), beam.start, law)
        return ub.Scene([beam], supports=[pin], connectors=[brake])

    refused("Coulomb has no derivatives", brake)


@pytest.mark.parametrize("name", ["damping by tangents, fibres", "damping by tangents, hinge"])
def test_a_derivative_does_not_depend_on_other_parameters(name):
    """Directly, where tangents are differenced along the motion of each parameter."""
    model, _, scheme, end, dt = CASES[name]
    values = {key: x.default for key, x in inspect.signature(model).parameters.items()}

    def sway(solution):
        return solution.displacement(solution.scene.beams[0].end)[:, 0]

    def derivatives(at):
        return ub.differentiate(model, at, scheme, t=(0.0, end / 4), dt=dt, progress=False).of(sway)

    together = derivatives(values)
    for k, (key, value) in enumerate(values.items()):
        alone = derivatives({key: value})[:, 0]
        assert np.abs(together[:, k] - alone).max() <= 1e-9 * np.abs(alone).max(), key


def counted(model):
    """A model that counts its calls."""

    def call(**values):
        call.number += 1
        return model(**values)

    call.number = 0
    return call


def strip(weak, strong, force):
    """Two beams in a row, of which one has a compliance as parameter in `softened`."""
    shape = {"EA": 2e9, "GA": 7e8, "rhoA": 60.0, "rhoI": 0.1}
    a, b = (
        ub.Beam((k, 0), (k + 1, 0), ub.Section(EI=EI, **shape), cells=2)
        for k, EI in enumerate((weak, strong))
    )
    push = ub.PointLoad(b.end, force=(0, force), amplitude=lambda t: math.sin(t))
    return ub.Scene(
        [a, b], joints=[ub.Rigid(a.end, b.start)], supports=[ub.Clamped(a.start)], loads=[push]
    )


def softened(weak, strong, force):
    return strip(1 / weak, strong, force)


def sway(run):
    return run.displacement(run.scene.beams[-1].end)[:, 1]


@pytest.mark.parametrize("reciprocal", [False, True])
def test_linear_numbers_need_one_scene(reciprocal):
    """Derivatives by a stiffness and by its reciprocal agree; the model is called less often."""
    at = {"weak": 4e6, "strong": 8e6, "force": 1e4}
    times = {"t": (0, 0.2), "dt": 0.02, "of": sway}
    plain = counted(strip)
    value, by = ub.gradient(plain, at, ub.EnergyMomentum(), **times)
    assert plain.number == 1 + 2 + len(at)  # two scenes in which all parameters change
    run = ub.simulate(strip(**at), ub.EnergyMomentum(), t=(0, 0.2), dt=0.02)
    assert value == pytest.approx(sway(run)[-1], rel=1e-12)
    direct = ub.differentiate(strip, at, ub.EnergyMomentum(), t=(0, 0.2), dt=0.02).of(sway)[-1]
    assert by == pytest.approx(direct, rel=1e-9)
    if reciprocal:
        bent = counted(softened)
        _, found = ub.gradient(bent, at | {"weak": 1 / 4e6}, ub.EnergyMomentum(), **times)
        assert bent.number == 1 + 2 + 4 * len(at)  # the numbers are not linear
        assert found[0] == pytest.approx(-by[0] * 4e6**2, rel=1e-9)
        assert found[1:] == pytest.approx(by[1:], rel=1e-9)


def test_products_of_parameters_are_not_linear():
    """Numbers that are linear in each parameter alone have five-point differences."""

    def scene(modulus, inertia):
        return strip(modulus * inertia, 8e6, 1e4)

    at, times = {"modulus": 2e8, "inertia": 0.02}, {"t": (0, 0.2), "dt": 0.02, "of": sway}
    _, by = ub.gradient(product := counted(scene), at, ub.EnergyMomentum(), **times)
    _, (by_EI,) = ub.gradient(
        lambda EI: strip(EI, 8e6, 1e4), {"EI": 4e6}, ub.EnergyMomentum(), **times
    )
    assert product.number == 1 + 2 + 4 * len(at)
    assert by * [*at.values()] == pytest.approx(2 * [by_EI * 4e6], rel=1e-9)


def test_history_may_depend_on_parameters_in_another_way():
    """The numbers of the scene are linear in the force, the history is not."""

    def weighted(run):
        return run.scene.loads[0].force[1] ** 2 * sway(run)

    at, times = {"weak": 4e6, "strong": 8e6, "force": 1e4}, {"t": (0, 0.2), "dt": 0.02}
    value, by = ub.gradient(strip, at, ub.EnergyMomentum(), **times, of=weighted)
    sag, by_sway = ub.gradient(strip, at, ub.EnergyMomentum(), **times, of=sway)
    assert value == pytest.approx(1e8 * sag, rel=1e-12)
    expected = 1e8 * by_sway + [0.0, 0.0, 2e4 * sag]
    assert by == pytest.approx(expected, rel=1e-9)


def test_functions_of_time_may_depend_on_parameters():
    """An amplitude that is linear in its parameter, and one that is not."""

    def pushed(slope, rate):
        def amplitude(t):
            return slope * t * math.exp(-rate * t)

        scene = strip(4e6, 8e6, 1e4)
        push = ub.PointLoad(scene.beams[1].end, force=(0, 1e4), amplitude=amplitude)
        return dataclasses.replace(scene, loads=[push])

    at, options = {"slope": 2.0, "rate": 3.0}, {"t": (0, 0.2), "dt": 0.02}
    _, by = ub.gradient(pushed, at, ub.EnergyMomentum(), **options, of=sway)
    h = 2.0**-10
    for k, name in enumerate(at):
        ends = [
            sway(
                ub.simulate(
                    pushed(**at | {name: at[name] * (1 + x * h)}),
                    ub.EnergyMomentum(),
                    **options,
                    newton=ub.Newton(rtol=1e-13),
                )
            )[-1]
            for x in (-2, -1, 1, 2)
        ]
        slope = np.dot(ends, (1 / 12, -8 / 12, 8 / 12, -1 / 12)) / (h * at[name])
        assert by[k] == pytest.approx(slope, rel=1e-8)


def test_scipy_minimizes_with_value_and_gradient():
    """The stiffness at which a cantilever has a given sway, from twice the stiffness."""
    minimize = pytest.importorskip("scipy.optimize").minimize
    at, options = {"weak": 4e6, "strong": 8e6, "force": 1e4}, {"t": (0, 1), "dt": 0.25}
    wanted = sway(ub.simulate(strip(**at), ub.Static(), **options))[-1]

    def error(x):
        return ub.gradient(
            strip, at | {"weak": 1e6 * float(x[0])}, ub.Static(), **options, of=sway,
            reduce=lambda history: 1e6 * (history[-1] - wanted) ** 2,
        )  # fmt: skip

    def scaled(x):
        value, by = error(x)
        return value, 1e6 * by[:1]

    found = minimize(scaled, [8.0], jac=True, tol=1e-12)
    assert found.x[0] == pytest.approx(4.0, rel=1e-5)


def test_areas_of_fibres_are_linear_numbers():
    """They are weights of points, whose derivatives have tables of their own."""

    def layered(area, limit):
        some = ub.Fibres(ub.ElastoPlastic(limit, 2e9))
        y = [-0.1, -0.05, 0.0, 0.05, 0.1]
        section = ub.Section.of_fibres(y, 5 * [area], E=210e9, nu=0.3, rho=7850.0, fibres=some)
        return column(section, load=6e4 * area / 4e-3)

    at = {"area": 4e-3, "limit": 235e6}
    options = {"t": (0, 0.3), "dt": 2e-3}
    _, found = ub.gradient(layered, at, ub.EnergyMomentum(), **options, of=tip)
    direct = ub.differentiate(layered, at, ub.EnergyMomentum(), **options).of(tip)[-1]
    assert found == pytest.approx(direct, rel=1e-8)
    h = 1e-3 * at["area"]
    ends = [
        tip(
            ub.simulate(
                layered(**at | {"area": at["area"] + x * h}), ub.EnergyMomentum(), **options
            )
        )[-1]
        for x in (-1, 1)
    ]
    assert found[0] == pytest.approx((ends[1] - ends[0]) / (2 * h), rel=1e-4)
