# SPDX-License-Identifier: MIT
"""Laws of connectors that a user states, and stops, which are such laws."""

import math
import re
import warnings
from dataclasses import dataclass
from functools import partial
from typing import ClassVar

import numpy as np
import pytest
from compiled_law import require_tangent
from helpers import in_turn, law_of, raises
from scenes import clamped
from scipy.integrate import solve_ivp
from user_classes import Stiffening as Cubic

import ufl_beam as ub

f = ub.extend.law_functions
SECTION = ub.Section(EA=1e5, GA=1e5, EI=3.0, rhoA=1.0, rhoI=1e-2)


@dataclass(frozen=True)
class Bump(ub.extend.ConnectorLaw):
    """Energy that is no polynomial, and not convex; a constant of it does not matter."""

    k: float
    size: float

    def energy(self, motion, state):
        return self.k * self.size**2 * (1 - f.exp(-((motion / self.size) ** 2)))


@dataclass(frozen=True)
class Drag(ub.extend.ConnectorLaw):
    """Quadratic damper beside a spring."""

    k: float
    c: float

    def energy(self, motion, state):
        return self.k * motion**2 / 2

    def resistance(self, motion, rate, state, dt):
        return self.c * f.absolute(rate) * rate


@dataclass(frozen=True)
class Maxwell(ub.extend.ConnectorLaw):
    """Spring and damper in series."""

    k: float
    eta: float
    variables: ClassVar = {"creep": 0.0}

    def energy(self, motion, state):
        return self.k * (motion - state.creep) ** 2 / 2

    def increments(self, motion, rate, state, dt):
        return {"creep": self.k * (motion - state.creep) / (self.eta / dt + self.k)}


@dataclass(frozen=True)
class Bad(ub.extend.ConnectorLaw):
    """It pushes in the direction of the motion."""

    c: float

    def resistance(self, motion, rate, state, dt):
        return -self.c * rate


@dataclass(frozen=True)
class Drive(Bad):
    """The same, and says so."""

    active: ClassVar = True
    entry: ClassVar = "drives"


LAWS = {
    "cubic": Cubic(100.0, 1e5),
    "bump": Bump(200.0, 0.02),
    "drag": Drag(100.0, 50.0),
    "maxwell": Maxwell(200.0, 20.0),
    "stop": ub.Stop(300.0, low=-0.004, high=0.006),
    "damped stop": ub.Stop(300.0, low=-0.004, high=0.006, damping=4.0),
}
SCHEMES = [
    ub.Static(), ub.EnergyMomentumStatic(), ub.EnergyMomentumStatic(0.5), ub.EnergyMomentum(),
    ub.EnergyMomentum(0.1, 0.1),
    ub.EnergyMomentumDecaying(), ub.GeneralizedAlpha(0.8),
]  # fmt: skip


def cantilever(*laws, load=lambda t: math.sin(9 * t)):
    """A flexible cantilever with a connector of each law across its end."""
    beam = ub.Beam((0, 0), (1, 0), SECTION, cells=4)
    connectors = [ub.Slide(ub.ground(1, 0), beam.end, law, axis=(0, 1)) for law in laws]
    push = ub.PointLoad(beam.end, force=(0, 1.0), amplitude=load)
    return beam.end, connectors, clamped(beam, loads=[push], connectors=connectors)


def carriage(*laws, v=0.0, force=0.0, amplitude=lambda t: 1.0):
    """A body of 2 kg on a rail, with a velocity or under a force."""
    body = ub.Body((1, 0), mass=2.0, inertia=1.0)
    rail = ub.ground(0, 0), body.middle
    connectors = [ub.Slide(*rail, law) for law in laws]
    push = ub.PointLoad(body.middle, force=(force, 0), amplitude=amplitude)
    scene = ub.Scene(
        bodies=[body], joints=[ub.Prismatic(*rail)], connectors=connectors,
        loads=[push] if force else [], initial=[ub.Velocity((body,), linear=(v, 0))] if v else [],
    )  # fmt: skip
    return body.middle, connectors[0], scene


run = partial(ub.simulate, t=(0, 0.6), dt=0.02)


@pytest.mark.parametrize(("name", "scheme"), in_turn(LAWS, SCHEMES), ids=str)
def test_tangent_is_the_derivative(name, scheme):
    """In small steps, in large ones and in none."""
    steps = (0.01, 0.013), (-0.02, 0.03), (0.01, 0.01 + 1e-9), (0.02, 0.02), (0.0, 0.0)
    least = 0.6 if name == "drag" else 1e-4
    require_tangent(LAWS[name], scheme, steps, 1e-6, lambda force, k: np.maximum(1e-5 * k, least))


@pytest.mark.parametrize("name", ["bump", "stop"])
@pytest.mark.filterwarnings("ignore:the energy ledger is open")  # a claim of 10 rtol = 1e-13
def test_energy_is_conserved(name):
    _, connector, scene = carriage(LAWS[name], v=0.1)
    newton = ub.Newton(rtol=1e-13)
    solution = run(scene, ub.EnergyMomentum(), t=(0, 10), dt=2e-2, newton=newton)
    total = solution.energy.total
    assert np.ptp(total) < 1e-11 * total[0]
    assert solution.energy["stored"].max() > 0.01 * total[0]
    assert not solution.energy.lost
    assert not solution.connector(connector).dissipated.any()


def test_small_steps_keep_the_digits_of_the_force():
    """A quotient of energies would have none left: the steps are 1e-9 of the motion."""
    _, (connector,), scene = cantilever(Cubic(1e3, 1e6), load=lambda t: 1.0 + 1e-8 * t)
    start = run(scene, ub.Static(), dt=0.3)
    solution = run(scene, ub.EnergyMomentumStatic(0.5), t=(0.6, 1.6), dt=0.1, start=start)
    history = solution.connector(connector)
    force = 1e3 * history.motion + 1e6 * history.motion**3
    np.testing.assert_allclose(history.force[1:], force[1:], rtol=1e-8)


def test_an_end_of_equilibrium_is_at_rest():
    """With theta = 1 forces are those at the ends of steps: nothing alternates [closed]."""
    for law, scheme, stiffness in [
        (ub.Stop(100.0, high=0.0), ub.EnergyMomentumStatic(), 101.0),
        (Cubic(99.0, 0.0), ub.Static(), 100.0),
    ]:
        at, _, scene = carriage(law, ub.Spring(1.0), force=1.0, amplitude=ub.ramp(0.3))
        solution = run(scene, scheme, t=(0, 1), dt=0.1)
        expected = np.minimum(solution.times / 0.3, 1.0) / stiffness
        np.testing.assert_allclose(solution.displacement(at)[:, 0], expected, atol=1e-12)


@pytest.mark.parametrize(
    ("scheme", "order"),
    [(ub.Static(), 1), (ub.EnergyMomentumStatic(), 1), (ub.EnergyMomentumStatic(0.5), 2)],
    ids=str,
)
def test_a_maxwell_element_relaxes(scheme, order):
    """A Maxwell element moved at a rate v: F = η v (1 - exp(-k t/η)), then held [closed]."""
    k, eta = 200.0, 100.0
    beam = ub.Beam((0, 0), (1, 0), SECTION, cells=1)
    way = ub.Table([0.0, 0.5, 9.0], [0.0, 0.1, 0.1])
    held = ub.PrescribedDisplacement(beam.start, u=0.0, v=way, psi=0.0)
    connector = ub.Slide(ub.ground(0, 0), beam.start, Maxwell(k, eta), axis=(0, 1))
    scene = ub.Scene([beam], supports=[held], connectors=[connector])
    force = eta * 0.2 * (1 - math.exp(-k * 0.5 / eta)) * math.exp(-k * 0.5 / eta)
    errors = []
    for dt in (0.05, 0.025, 0.0125):
        solution = run(scene, scheme, t=(0, 1), dt=dt)
        errors.append(math.sqrt(2 * k * solution.energy["stored"][-1]) - force)
        assert solution.connector(connector).dissipated[-1] > 0
    np.testing.assert_allclose(np.log2(np.divide(errors[:-1], errors[1:])), order, atol=0.1)


@dataclass(frozen=True)
class Damped(Cubic):
    c: float

    def resistance(self, motion, rate, state, dt):
        return self.c * rate * (1 + motion)


def test_modes_about_a_state():
    """A body on a cubic spring with a damper: K and C from the derivatives [closed]."""
    at, _, scene = carriage(Damped(100.0, 4e4, 3.0), force=5.0)
    state = run(scene, ub.Static(), t=(0, 2e9), dt=1e9)  # nothing creeps any more
    x = state.displacement(at)[-1, 0]
    assert 100 * x + 4e4 * x**3 == pytest.approx(5.0, rel=1e-9)
    mode = ub.modes(scene, 1, at=state)
    k, c, m = 100 + 3 * 4e4 * x**2, 3.0 * (1 + x), 2.0
    assert mode.omega[0] == pytest.approx(math.sqrt(k / m), rel=1e-9)
    assert mode.damping[0] == pytest.approx(c / (2 * math.sqrt(k * m)), rel=1e-6)


def test_modes_keep_the_variables():
    """A vibration about a state is faster than the creep: K is that of the spring [closed]."""
    _, _, scene = carriage(Maxwell(50.0, 10.0))
    assert ub.modes(scene, 1).omega[0] == pytest.approx(math.sqrt(50.0 / 2.0), rel=1e-9)


def test_on_a_path_rates_vanish():
    """Rates vanish on a path, and Maxwell elements are relaxed [closed]."""
    laws = Cubic(100.0, 1e5), Drag(50.0, 9.0), Maxwell(200.0, 9.0)
    at, _, scene = cantilever(*laws, load=lambda t: t)
    path = ub.follow(scene, ub.LoadControl(0.2), steps=5)
    end, _, elastic = cantilever(Cubic(100.0, 1e5), ub.Spring(50.0), load=lambda t: t)
    other = run(elastic, ub.Static(), t=(0, 1), dt=0.2)
    np.testing.assert_allclose(path.displacement(at)[-1], other.displacement(end)[-1], rtol=1e-7)

    class Endless(Maxwell):
        def increments(self, motion, rate, state, dt):
            return {"creep": self.k * (motion - state.creep) * dt / (self.eta + self.k * dt)}

    scene = cantilever(Endless(200.0, 9.0), load=lambda t: t)[2]
    with raises("Endless.increments returns creep = ", " for dt = inf"):
        ub.follow(scene, ub.LoadControl(0.2), steps=5)


@pytest.mark.parametrize(("damping", "v"), [(0.5, 0.3), (2.0, 3.0), (100.0, 1.0)])
def test_a_damped_stop_takes_a_part_of_the_velocity(damping, v):
    """The velocity after a contact against the ordinary differential equation [independent]."""
    k, m = 2e4, 2.0

    def motion(t, y):
        return [y[1], -k * y[0] * max(1 + damping * y[1], 0.0) / m]

    leaves = lambda t, y: y[0] if t > 0 else 1.0  # noqa: E731
    leaves.terminal, leaves.direction = True, -1
    end = solve_ivp(motion, (0, 0.2), [0.0, v], events=leaves, rtol=1e-11, atol=1e-14)
    expected = -end.y[1, -1] / v
    if damping * v < 1:
        assert expected == pytest.approx(1 - 2 / 3 * damping * v, abs=0.5 * (damping * v) ** 2)
    at, connector, scene = carriage(ub.Stop(k, high=0.01, damping=damping), v=v)
    solution = run(scene, ub.EnergyMomentum(), t=(0, 0.2), dt=1e-4)
    history, lost = solution.connector(connector), solution.energy.lost["contact"]
    assert history.force.min() > -1e-9 * history.force.max()  # it never pulls
    assert solution.energy.worst < 1e-9
    assert np.diff(lost).min() > -1e-12 * lost[-1]
    np.testing.assert_allclose(lost, history.dissipated, atol=1e-15)
    found = -solution.velocity(at)[-1, 0] / v
    assert lost[-1] == pytest.approx(m * v**2 / 2 * (1 - found**2), rel=1e-7)
    assert found == pytest.approx(expected, abs=2e-3)


def quadratic(self, motion, state):
    return motion**2


ONE = {"variables": {"z": 0.0}, "energy": quadratic}


@pytest.mark.parametrize(
    ("members", "message"),
    [
        ({}, "Mine has neither energy nor resistance, nor a limit; define one"),
        ({"energy": quadratic, "fields": {"k": math.nan}}, "Mine: k = nan is not finite"),
        ({"energy": quadratic, "fields": {"k": "x"}}, "Mine: k = 'x' is not a number"),
        ({"energy": quadratic, "fields": {"parameters": 1.0}}, "have the name parameters"),
        ({"energy": quadratic, "entry": "kinetic"}, "is no entry for a loss; use"),
        ({"energy": quadratic, "entry": 3}, "Mine.entry = 3 must be text"),
        (ONE, "has variables and no increments"),
        ({**ONE, "increments": lambda s, e, r, z, dt: {}}, "lacks z"),
        (
            {**ONE, "increments": lambda s, e, r, z, dt: {"z": e, "y": e}},
            "has y, which `variables` does not name",
        ),
        ({**ONE, "increments": lambda s, e, r, z, dt: 0.0}, "must return a dict"),
        (
            {**ONE, "increments": lambda s, e, r, z, dt: {"z": "a"}},
            "increments returns z = 'a' at no motion",
        ),
        ({"energy": lambda s, e, z: None}, "Mine.energy returns None at no motion"),
        ({"resistance": lambda s, e, r, z, dt: z.y}, "Mine.resistance fails at no"),
    ],
)
def test_incomplete_laws_are_refused(members, message):
    """When the connector is made, with its name and that of the class."""
    beam = ub.Beam((0, 0), (1, 0), SECTION)
    with raises(message) as error:
        ub.Turn(ub.ground(1, 0), beam.end, law_of(**members))
    assert "Turn(ground (1, 0), beam.end (1, 0))" in str(error.value)
    plain = type("Plain", (ub.extend.ConnectorLaw,), {"energy": quadratic})
    with raises("must be a dataclass"):
        ub.Turn(ub.ground(1, 0), beam.end, plain())


@dataclass(frozen=True)
class Untraceable(ub.extend.ConnectorLaw):
    """A law that looks at numbers."""

    k: float

    def energy(self, motion, state):
        return np.maximum(self.k * motion, 0.0) * motion if motion > 1 else motion


def test_laws_that_cannot_be_compiled_are_refused():
    """Before the first step, with file and line of the method."""
    _, _, scene = cantilever(Untraceable(1.0))
    with raises("Untraceable: it cannot be called with ") as error:
        run(scene, ub.EnergyMomentum())
    assert re.search(r"\(.*test_connector_laws\.py, line \d+\)\. Laws", str(error.value))


class Preload(Cubic):
    def energy(self, motion, state):
        return super().energy(motion - 0.01, state)


def test_preloaded_laws_need_a_state():
    """A force at no motion is no equilibrium; in statics the first step comes to it [closed]."""
    at, _, scene = carriage(Preload(100.0, 0.0))
    with raises("modes: Preload of Slide", " bears a force at no motion"):
        ub.modes(scene, 1)
    assert run(scene, ub.Static()).displacement(at)[-1, 0] == pytest.approx(0.01)
    swings = run(scene, ub.EnergyMomentum(), t=(0, 5))
    assert swings.energy.total[0] == pytest.approx(100 * 0.01**2 / 2, rel=1e-9)
    assert swings.energy.worst < 1e-9


@pytest.mark.serial  # the first process warns
@pytest.mark.parametrize(("law", "warned"), [(Bad(0.5), True), (Drive(0.5), False)])
def test_a_law_that_gives_energy_is_told(law, warned):
    _, connector, scene = carriage(law, v=0.1)
    with warnings.catch_warnings(record=True) as told:
        warnings.simplefilter("always")
        solution = run(scene, ub.EnergyMomentum())
    found = [str(one.message) for one in told if "the dissipated energy" in str(one.message)]
    assert bool(found) == warned
    assert solution.energy.lost[law.entry][-1] < 0
    if warned:
        assert found[0].startswith(f"{connector}: ")
        assert "active = True" in found[0]
