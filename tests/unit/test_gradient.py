# SPDX-License-Identifier: MIT
"""The adjoint of runs, against direct differentiation of the same runs."""

import inspect
import math
from dataclasses import replace
from functools import partial
from itertools import pairwise
from operator import itemgetter

import numpy as np
import pytest
from run_differences import differences
from scenes import clamped
from user_classes import Brake, Cubic, Maxwell

import ufl_beam as ub

STEEL = {"EA": 2.1e9, "GA": 6.7e8, "rhoA": 78.5, "rhoI": 0.065}
SOFT = {"EA": 1e4, "GA": 4e3, "rhoA": 1.0, "rhoI": 0.01}
EXACT, LAST = ub.EnergyMomentum(), itemgetter(-1)


def tip(solution):
    """Horizontal displacement of the end of the last beam; (n+1,); m."""
    return solution.displacement(solution.scene.beams[-1].end)[:, 0]


def pulse(t):
    return math.sin(math.pi * t / 0.2) if t < 0.2 else 0.0


def column(section, load=35e3, mass=400.0, height=3.0):
    beam = ub.Beam((0, 0), (0, height), section, cells=6)
    push = ub.PointLoad(beam.end, force=(load, 0.0), amplitude=pulse)
    damping = [ub.Rayleigh(mass=0.05, stiffness=1e-6)]
    return clamped(beam, masses=[ub.PointMass(beam.end, mass)], loads=[push], damping=damping)


def flying(EI=100.0, rhoA=1.0, load=8.0, speed=0.5, length=10.0):
    section = ub.Section(EA=1e4, GA=1e4, EI=EI, rhoA=rhoA, rhoI=10.0)
    beam = ub.Beam((0.6 * length, 0), (0, 0.8 * length), section, cells=6)
    push = ub.PointLoad(beam.start, force=(load, 0), moment=-10 * load)
    return ub.Scene([beam], loads=[push], initial=[ub.Velocity([beam], linear=(speed, 0.0))])


def yielding(limit=60e3, isotropic=4e5, kinematic=2e5, EI=9.0e6, load=35e3, mass=400.0):
    law = ub.ElastoPlastic(limit, isotropic, kinematic)
    return column(ub.Section(EI=EI, bending=law, **STEEL), load, mass)


def fibres(limit=235e6, E=210e9, height=0.2, load=120e3, length=3.0, area=4e-3):
    some = ub.Fibres(ub.ElastoPlastic(limit, 2e9))
    y = height * np.linspace(-0.5, 0.5, 5)
    section = ub.Section.of_fibres(y, 5 * [area], E=E, nu=0.3, rho=7850.0, fibres=some)
    return column(section, load, height=length)


def softening(limit=60e3, energy=6e3, EI=9.0e6, load=40e3):
    return column(ub.Section(EI=EI, hinge=ub.Softening(limit, energy), **STEEL), load)


def heated(strain=2e-3, curvature=0.05, EI=100.0, rate=40.0, length=3.0, limit=math.inf):
    """Imposed strains on an elastic or yielding beam."""
    law = ub.ElastoPlastic(limit, 30.0) if limit < math.inf else None
    beam = ub.Beam((0, 0), (0.2, length), ub.Section(EI=EI, bending=law, **SOFT), cells=3)
    loads = [
        ub.ImposedStrain(beam, strain, (curvature, 0.1 * curvature), lambda t: math.sin(rate * t)),
        ub.PointLoad(beam.end, force=(2.0, 0.0), amplitude=pulse),
    ]
    return clamped(beam, loads=loads, damping=[ub.KelvinVoigt(1e-4)])


def rubbing(limit=12e3, EI=9.0e6, load=35e3, mass=400.0, slow=9e3, strength=60e3, tau=1e-3):
    """A column that yields, with brakes at its head and at half its height; they stick and slip."""
    scene = yielding(strength, EI=EI, load=load, mass=mass)
    beam = scene.beams[0]
    brakes = [
        ub.Slide(ub.ground(0, 3), beam.end, ub.Coulomb(limit), axis=(1, 0)),
        ub.Slide(ub.ground(0, 1.5), beam.at(0.5), Brake(limit, slow, 0.1), axis=(1, 0)),
    ]
    return replace(scene, connectors=brakes, damping=[ub.KelvinVoigt(tau)])


def asked(stiffness=2e5, time=0.05, cubic=1e6, limit=2e3, load=60e3, start=10.0):
    """A yielding column with a Maxwell element, a cubic spring and a spring that yields."""

    def yields(motion, rate, t, state):
        force, bound = 5e5 * (motion - state[0]), limit + 1e3 * t
        slip = math.copysign(max(0.0, abs(force) - bound) / 6e5, force)
        return force - 5e5 * slip, [state[0] + slip]

    scene = yielding(load=load)
    end, half = scene.beams[0].end, scene.beams[0].at(0.5)
    laws = [
        (end, ub.ForceLaw(Maxwell(stiffness, time), [start])),
        (half, ub.ForceLaw(Cubic(stiffness, cubic))),
        (half, ub.ForceLaw(yields, [0.0])),
    ]
    connectors = [ub.Slide(ub.ground(*place.point), place, law, axis=(1, 0)) for place, law in laws]
    return replace(scene, connectors=connectors)


def crossed(speed=1.3, bend=0.3, mass=0.5, load=3.0, EI=100.0, length=2.0, limit=math.inf):
    """A mass and a force that cross the nodes of a beam, whose foot yields if it has a limit."""
    law = None if limit == math.inf else ub.ElastoPlastic(limit, 20.0, 10.0)
    section = ub.Section(EA=1e4, GA=8e3, EI=EI, rhoA=1.0, rhoI=0.05, bending=law)
    beam = ub.Beam((0, 0), (length, 0.3), section, cells=4)
    loads = [
        ub.MovingLoad(beam, lambda t: 0.1 + speed * t + bend * t**2, (0, -load), mass=mass),
        ub.MovingLoad(beam, lambda t: speed * t / 2, (load, 0), amplitude=lambda t: 1 - t),
    ]
    return clamped(beam, loads=loads, damping=[] if law else [ub.KelvinVoigt(0.01)])


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
    return replace(scene, damping=[ub.Rayleigh(mass=mass, stiffness=stiffness, tangent=True)])


def damped_fibres(limit=235e6, E=210e9, height=0.2, load=120e3, mass=0.5, stiffness=2e-3):
    return damped(fibres(limit, E, height, load), mass, stiffness)


def damped_softening(limit=60e3, energy=6e3, EI=9.0e6, load=40e3, stiffness=2e-3):
    return damped(softening(limit, energy, EI, load), 0.5, stiffness)


CASES = {
    "flying": (flying, ub.EnergyMomentum(0.01, 0.01), 2.0, 0.05),
    "decaying": (flying, ub.EnergyMomentumDecaying(), 2.0, 0.05),
    "Newmark": (flying, ub.Newmark(0.6, 0.31), 2.0, 0.05),
    "generalized alpha": (flying, ub.GeneralizedAlpha(0.8), 2.0, 0.05),
    "order 4": (flying, ub.EnergyMomentum(order=4), 2.0, 0.1),
    "yielding": (yielding, ub.EnergyMomentum(0.02), 0.2, 0.004),
    "fibres": (fibres, ub.EnergyMomentum(0.02), 0.2, 0.004),
    "softening": (softening, ub.EnergyMomentum(0.02), 0.2, 0.002),
    "friction": (rubbing, ub.EnergyMomentum(0.02), 0.2, 0.004),
    "laws of users": (asked, EXACT, 0.2, 0.004),
    "imposed strains, statics": (heated, ub.Static(), 0.2, 0.02),
    "imposed strains, yielding": (partial(heated, limit=1.0), EXACT, 0.2, 0.004),
    "moving loads": (crossed, ub.EnergyMomentum(0.02, 0.01), 1.2, 0.05),
    "moving loads, yielding": (partial(crossed, limit=4.0), ub.GeneralizedAlpha(0.8), 1.2, 0.05),
    "damping by tangents": (turning, EXACT, 1.0, 0.05),
    "damping by tangents, fibres": (damped_fibres, ub.EnergyMomentum(0.02), 0.2, 0.004),
    "damping by tangents, hinge": (damped_softening, ub.EnergyMomentum(0.02), 0.2, 0.002),
}


def parameters(model):
    """Default values of the arguments of a model that are numbers."""
    values = {name: x.default for name, x in inspect.signature(model).parameters.items()}
    return {name: x for name, x in values.items() if math.isfinite(x)}


def compare(model, scheme, of, reduce=LAST, rtol=1e-8, atol=0.0, max_bytes=1e9, **run):
    """Require the direct derivatives of the adjoint, by relative changes; return them."""
    at = parameters(model)
    direct = ub.differentiate(model, at, scheme, **run)
    more = {"of": of, "reduce": reduce, "max_bytes": max_bytes}
    _, found = ub.gradient(model, at, scheme, **more, **run)
    sizes = np.array([*at.values()])
    expected = sizes * direct.of(lambda s: reduce(of(s)))
    atol *= np.abs(expected).max()
    np.testing.assert_allclose(sizes * found, expected, rtol=rtol, atol=atol)
    return found


@pytest.mark.parametrize("name", CASES)
def test_adjoint_equals_direct_differentiation(name):
    """They are the same sums in another order; the factor 1e-10 is the round-off of differences."""
    model, scheme, end, dt = CASES[name]
    run = {"t": (0, end), "dt": dt}
    found = compare(model, scheme, tip, atol=1e-10, **run)
    _, parts = ub.gradient(model, parameters(model), scheme, of=tip, max_bytes=1e5, **run)
    np.testing.assert_allclose(parts, found, rtol=1e-10, atol=1e-13 * np.abs(found).max())


@pytest.mark.parametrize(
    ("name", "atol"),
    [
        ("yielding", 1e-10),
        ("moving loads, yielding", 1e-10),
        ("damping by tangents", 1e-10),
        ("friction", 1e-8),
        ("laws of users", 1e-8),
    ],
)
def test_number_may_depend_on_the_whole_history(name, atol):
    """The tolerances are those of differences of squares."""

    def both(solution):
        place = solution.scene.beams[0].at(0.75)
        return np.column_stack([solution.displacement(place), solution.velocity(place)])

    def number(x):
        return float(np.max(x[:, 0]) + 0.01 * np.mean(x[:, 3] ** 2))

    model, scheme, end, dt = CASES[name]
    compare(model, scheme, both, number, 1e-7, atol, max_bytes=1e5, t=(0, end), dt=dt)


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


@pytest.mark.parametrize("scheme", [EXACT, ub.EnergyMomentum(order=4)], ids=repr)
def test_histories_of_positions_and_of_points_of_bodies(scheme):
    """They depend on the geometry, also if the motion does not change."""

    def far(s):
        (body,), (beam,) = s.scene.bodies, s.scene.beams
        point = body.at(2 * body.center[0] - 1, 0)
        return np.column_stack([s.displacement(point), s.position(point), s.velocity(beam.end)])

    def number(history):
        return float((history[-1] * np.arange(1, 1 + history.shape[1])).sum())

    compare(balance, scheme, far, number, t=(0, 0.5), dt=0.02)


def test_logarithm_of_the_last_of_many_decaying_swings():
    """The last swing has 1e-7 of the first."""

    def decaying(k=400.0, c=6.0):
        body = ub.Body((0, 0), mass=1.0, inertia=1.0)
        laws = ub.Spring(k), ub.Damper(c)
        slides = [ub.Slide(ub.ground(0, 0), body.middle, law, axis=(1, 0)) for law in laws]
        start = ub.Velocity([body], linear=(1.0, 0.0))
        return ub.Scene(bodies=[body], connectors=slides, initial=[start])

    def motion(s):
        return s.displacement(s.scene.bodies[0].middle)[:, 0]

    def decay(history):
        return math.log(abs(history[-1] / history[20]))

    compare(decaying, EXACT, motion, decay, 1e-6, t=(0, 5.0), dt=0.01)


def braked(EI):
    """Friction by the force of a joint."""
    (beam,) = flying(EI).beams
    pin = ub.Pinned(beam.start)
    law = ub.Coulomb(1.0, coefficient=0.1, joint=pin)
    brake = ub.Turn(ub.ground(*beam.start.point), beam.start, law)
    return ub.Scene([beam], supports=[pin], connectors=[brake])


@pytest.mark.parametrize(
    ("wrong", "message"),
    [
        ({"of": lambda s: tip(s)[-1]}, "must return a history"),
        (
            {"of": lambda s: np.where(s.times > 0, 0.0, np.nan)},
            "the history is not finite at t = 0 s",
        ),
        ({"of": lambda s: s.energy.state["stored"]}, "forces or energies; use differentiate"),
        ({"of": lambda s: np.cumsum(tip(s))}, "depend on motions at other times; put the part"),
        ({"model": braked}, "Coulomb has no derivatives"),
    ],
)
def test_wrong_arguments_are_refused(wrong, message):
    run = {"model": flying, "at": {"EI": 100.0}, "scheme": EXACT, "t": (0, 1), "dt": 0.1, "of": tip}
    with pytest.raises(ub.ArgumentError, match=message):
        ub.gradient(**run | wrong)


@pytest.mark.parametrize("name", ["damping by tangents, fibres", "damping by tangents, hinge"])
def test_a_derivative_does_not_depend_on_other_parameters(name):
    """Directly, where tangents are differenced along the motion of each parameter."""
    model, scheme, end, dt = CASES[name]

    def derivatives(at):
        return ub.differentiate(model, at, scheme, t=(0.0, end / 4), dt=dt).of(tip)

    together = derivatives(parameters(model))
    for k, (key, value) in enumerate(parameters(model).items()):
        alone = derivatives({key: value})[:, 0]
        assert np.abs(together[:, k] - alone).max() <= 1e-9 * np.abs(alone).max(), key


# -- numbers of a scene as functions of parameters -------------------------------------------------


def strip(weak, strong, force):
    """Two beams in a row under a force at the end."""
    shape = {"EA": 2e9, "GA": 7e8, "rhoA": 60.0, "rhoI": 0.1}
    a, b = (
        ub.Beam((k, 0), (k + 1, 0), ub.Section(EI=EI, **shape), cells=2)
        for k, EI in enumerate((weak, strong))
    )
    push = ub.PointLoad(b.end, force=(0, force), amplitude=lambda t: math.sin(t))
    return ub.Scene(
        [a, b], joints=[ub.Rigid(a.end, b.start)], supports=[ub.Clamped(a.start)], loads=[push]
    )


STRIP = {"weak": 4e6, "strong": 8e6, "force": 1e4}
SHORT = {"t": (0, 0.2), "dt": 0.02}


def sway(run):
    return run.displacement(run.scene.beams[-1].end)[:, 1]


def counted_gradient(model, at):
    """Value and derivatives of the sway, and the number of scenes that were made."""
    calls = []

    def counted(**values):
        calls.append(values)
        return model(**values)

    return *ub.gradient(counted, at, EXACT, of=sway, **SHORT), len(calls)


def test_linear_numbers_need_one_scene():
    """Two scenes have changes of all parameters; then one to four by parameter are enough."""
    value, by, scenes = counted_gradient(strip, STRIP)
    assert scenes == 1 + 2 + 3
    assert value == pytest.approx(sway(ub.simulate(strip(**STRIP), EXACT, **SHORT))[-1], rel=1e-12)

    def softened(weak, **more):
        return strip(1 / weak, **more)

    _, found, scenes = counted_gradient(softened, STRIP | {"weak": 1 / 4e6})
    assert scenes == 1 + 2 + 4 + 2 * 2
    assert found == pytest.approx(by * [-(4e6**2), 1.0, 1.0], rel=1e-9)

    def product(modulus, inertia):  # linear in each parameter alone
        return strip(modulus * inertia, 8e6, 1e4)

    _, found, scenes = counted_gradient(product, {"modulus": 2e8, "inertia": 0.02})
    assert scenes == 1 + 2 + 2 * 2
    assert found * [2e8, 0.02] == pytest.approx(2 * [by[0] * 4e6], rel=1e-9)


def row(kind, *numbers, modulus=1.0, force=0.0):
    """Beams in a row, with a number of the section of each, under a force at the end."""
    sections = [
        ub.Section(**{"EA": 2e9, "GA": 7e8, "EI": 4e6, "rhoA": 60.0, "rhoI": 0.1} | {kind: x})
        for x in (numbers if kind != "EI" else [modulus / x for x in numbers])
    ]
    beams = [ub.Beam((k, 0), (k + 1, 0), s, cells=1) for k, s in enumerate(sections)]
    joints = [ub.Rigid(a.end, b.start) for a, b in pairwise(beams)]
    loads = [ub.Gravity(), ub.PointLoad(beams[-1].end, force=(force, 0), amplitude=math.cos)]
    return ub.Scene(beams, joints=joints, supports=[ub.Clamped(beams[0].start)], loads=loads)


@pytest.mark.parametrize(
    ("kind", "value", "more", "scenes"),
    [
        ("EA", 2e9, {"force": 0.0}, 1 + 2 + 4),  # each number depends on one, linearly
        ("EI", 1 / 4e6, {}, 1 + 2 + 4 + 2),  # not linearly
        ("rhoI", 0.1, {}, 1 + 2 + 1 + 2 * (1 + 3)),  # masses of nodes depend on two neighbours
        ("EI", 1 / 4e6, {"modulus": 1.0}, 1 + 2 + 1 + 2 + 4 * 12 + 2),  # and on modulus
    ],
)
def test_many_parameters_change_in_few_scenes(kind, value, more, scenes):
    """Derivatives by each parameter are those by this parameter alone."""
    numbers = {f"x{k}": value * (1 + k / 20) for k in range(12)}

    def model(modulus=1.0, force=0.0, **values):
        return row(kind, *(numbers | values).values(), modulus=modulus, force=force)

    at = numbers | more
    _, found, number = counted_gradient(model, at)
    assert number == scenes
    for k, name in [*enumerate(at)][::3]:
        _, (alone,), _ = counted_gradient(model, {name: at[name]})
        assert found[k] == pytest.approx(alone, rel=1e-8)


def test_functions_of_time_may_depend_on_parameters():
    """An amplitude that is linear in its parameter, and one that is not; against differences."""

    def pushed(slope=2.0, rate=3.0, size=1e4):
        def amplitude(t):
            return slope * t * math.exp(-rate * t)

        scene = strip(**STRIP)
        push = ub.PointLoad(scene.beams[1].end, force=(0, size), amplitude=amplitude)
        return replace(scene, loads=[push])

    at = parameters(pushed)
    for names in (["slope"], at):  # linear numbers, and others
        some = {name: at[name] for name in names}
        _, found = ub.gradient(pushed, some, EXACT, of=sway, **SHORT)
        for by, name in zip(found, names, strict=True):
            (slope,) = differences(pushed, some, name, sway, EXACT, [2.0**-10], **SHORT)
            assert by == pytest.approx(slope[-1], rel=1e-8)
