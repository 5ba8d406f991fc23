# SPDX-License-Identifier: MIT
"""Laws of connectors that a user states, and stops, which are such laws."""

import math
import os
import re
import warnings
from dataclasses import dataclass
from functools import partial
from typing import ClassVar

import numpy as np
import pytest
from compiled_law import compiled_law
from helpers import (
    in_turn,
    law_of,
    needs_mpirun,
    on_two_processes,
    require_restart,
)
from scenes import clamped
from scipy.integrate import solve_ivp

import ufl_beam as ub
from ufl_beam.compiled.c_library import lib

f = ub.extend.law_functions
SECTION = ub.Section(EA=1e5, GA=1e5, EI=3.0, rhoA=1.0, rhoI=1e-2)


@dataclass(frozen=True)
class Cubic(ub.extend.ConnectorLaw):
    """Nonlinear spring."""

    k: float
    cubic: float

    def energy(self, motion, state):
        return self.k * motion**2 / 2 + self.cubic * motion**4 / 4


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
class Drive(ub.extend.ConnectorLaw):
    """It pushes in the direction of the motion."""

    c: float
    active: ClassVar = True
    entry: ClassVar = "drives"

    def resistance(self, motion, rate, state, dt):
        return -self.c * rate


@dataclass(frozen=True)
class Bad(ub.extend.ConnectorLaw):
    """The same, without saying so."""

    c: float

    def resistance(self, motion, rate, state, dt):
        return -self.c * rate


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


def cantilever(*laws, load=None, **more):
    """A flexible cantilever with a connector of each law across its end."""
    beam = ub.Beam((0, 0), (1, 0), SECTION, cells=4)
    connectors = [ub.Slide(ub.ground(1, 0), beam.end, law, axis=(0, 1)) for law in laws]
    push = ub.PointLoad(beam.end, force=(0, 1.0), amplitude=load or (lambda t: math.sin(9 * t)))
    held = {"supports": [ub.Clamped(beam.start)], "loads": [push]}
    return beam.end, connectors, ub.Scene([beam], connectors=connectors, **held, **more)


def carriage(law, v, mass=2.0, more=()):
    """A body on a rail that arrives with a velocity."""
    body = ub.Body((1, 0), mass=mass, inertia=1.0)
    rail = ub.ground(0, 0), body.middle
    connector = ub.Slide(*rail, law)
    scene = ub.Scene(
        bodies=[body], joints=[ub.Prismatic(*rail)],
        connectors=[connector, *(ub.Slide(*rail, one) for one in more)],
        initial=[ub.Velocity((body,), linear=(v, 0))],
    )  # fmt: skip
    return body.middle, connector, scene


run = partial(ub.simulate, t=(0, 0.6), dt=0.02)


# -- the compiled law ----------------------------------------------------------------------------


@pytest.mark.parametrize("scheme", SCHEMES, ids=str)
@pytest.mark.parametrize("name", LAWS)
def test_tangent_is_the_derivative(name, scheme):
    """Against central differences, in small steps, in large ones and in none."""
    law = LAWS[name]
    answers = compiled_law(law, scheme)
    known = {f"number {n}": x for n, x in law.parameters().items()} | {
        "dt": 0.01,
        "theta": scheme.theta,
    }
    known |= {f"state {n}": 1e-3 for n in law.variables}

    def ask(e0, e1):
        return answers({**known, "before 0": e0, "motion 0": e1})

    for e0, e1 in [(0.01, 0.013), (-0.02, 0.03), (0.01, 0.01 + 1e-9), (0.02, 0.02), (0.0, 0.0)]:
        ε = 1e-6
        found = (ask(e0, e1 + ε)[0] - ask(e0, e1 - ε)[0]) / (2 * ε)
        assert ask(e0, e1)[1] == pytest.approx(found, rel=1e-5, abs=0.6 if name == "drag" else 1e-4)


@pytest.mark.parametrize("law", [Cubic(100.0, 1e5), Bump(200.0, 0.02), LAWS["stop"]], ids=repr)
@pytest.mark.parametrize("dt", [2e-2, 1e-3])
@pytest.mark.filterwarnings("ignore:the energy ledger is open")  # a claim of 10 rtol = 1e-13
def test_energy_is_conserved(law, dt):
    _, connector, scene = carriage(law, v=0.1)
    solution = run(
        scene, ub.EnergyMomentum(), t=(0, 1000 * dt), dt=dt, newton=ub.Newton(rtol=1e-13)
    )
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


@pytest.mark.parametrize(("name", "scheme"), in_turn(LAWS, SCHEMES), ids=str)
def test_the_reference_finds_the_same(name, scheme, as_by_reference):
    _, (connector,), scene = cantilever(LAWS[name])
    found = run(scene, scheme, dt=0.04, newton=ub.Newton(rtol=1e-12))
    as_by_reference(found)
    mine = found.connector(connector)
    lost = found.energy.lost.get(LAWS[name].entry, 0.0)
    np.testing.assert_allclose(lost, mine.dissipated, rtol=0, atol=1e-15)
    if isinstance(scheme, ub.extend.EnergyMomentumBase):
        assert found.energy.worst < 1e-12
    if name in ("drag", "maxwell", "damped stop") and isinstance(
        scheme, ub.extend.EnergyMomentumBase
    ):
        loss = np.diff(mine.dissipated)
        assert mine.dissipated[-1] > 0
        assert loss.min() > -1e-16 or (name, scheme.theta) == ("maxwell", 0.6)
    if scheme == ub.EnergyMomentumStatic():
        assert np.diff(found.energy["numerical"]).min() > -1e-16 or name == "bump"


@dataclass(frozen=True)
class Named(Maxwell):
    """The same, with variables whose names are words that solvers use as well."""

    variables: ClassVar = {"held": 0.0, "dissipated": 1.0, "slip": 1.0, "start": 1.0}

    def energy(self, motion, state):
        return state.slip * self.k * (motion - state.held) ** 2 / 2

    def increments(self, motion, rate, state, dt):
        creep = self.k * (motion - state.held) / (self.eta / dt + self.k)
        return {"held": creep, "dissipated": 0.0, "slip": 0.0, "start": 0.0}


@pytest.mark.parametrize("scheme", [ub.Static(), ub.EnergyMomentum(0.1, 0.1)], ids=str)
def test_names_of_variables_are_free(scheme, as_by_reference):
    _, (connector,), scene = cantilever(Named(200.0, 20.0))
    solution = run(scene, scheme, newton=ub.Newton(rtol=1e-12))
    as_by_reference(solution)
    named = solution.connector(connector)
    _, (connector,), scene = cantilever(LAWS["maxwell"])
    for one, other in zip(named, run(scene, scheme).connector(connector), strict=True):
        np.testing.assert_allclose(one, other, rtol=0, atol=1e-9 * np.abs(other).max())


def test_an_end_of_equilibrium_is_at_rest():
    """With theta = 1 forces are those at the ends of steps: nothing alternates [closed]."""
    push, soft = ub.ramp(0.3), ub.Spring(1.0)
    for law, scheme in [
        (ub.Stop(100.0, high=0.0), ub.EnergyMomentumStatic()),
        (Cubic(99.0, 0.0), ub.Static()),
    ]:
        at, _, scene = carriage(law, v=0.0, more=[soft])
        load = ub.PointLoad(at, force=(1.0, 0), amplitude=push)
        scene = ub.Scene(
            (), joints=scene.joints, loads=[load], bodies=scene.bodies, connectors=scene.connectors
        )
        solution = run(scene, scheme, t=(0, 1), dt=0.1)
        stiffness = 101.0 if isinstance(law, ub.Stop) else 100.0
        expected = np.array([push(t) for t in solution.times]) / stiffness
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


# -- runs ----------------------------------------------------------------------------------------


def all_laws():
    return cantilever(*LAWS.values(), Drive(0.05))


@pytest.mark.parametrize("scheme", [ub.EnergyMomentum(0.05), ub.Newmark(), ub.Static()], ids=str)
def test_restart_and_start(scheme, shared_path):
    _, connectors, scene = all_laws()
    whole = require_restart(run, scene, connectors, scheme, shared_path, until=0.6)
    if scheme == ub.EnergyMomentum(0.05):
        assert whole.energy.worst < 1e-9


def test_save_and_load(shared_path):
    _, (connector, *_), scene = all_laws()
    solution, path = run(scene, ub.EnergyMomentum()), shared_path / "run.h5"
    solution.save(path)
    with pytest.raises(ub.ArgumentError, match="the class Cubic of your own"):
        ub.Solution.load(path)
    loaded = ub.Solution.load(path, scene=scene)
    assert np.array_equal(loaded.connector(connector).force, solution.connector(connector).force)
    more = [run(scene, ub.EnergyMomentum(), t=(0.6, 0.8), start=one) for one in (solution, loaded)]
    assert np.array_equal(more[0].q, more[1].q)
    _, (stop,), scene = cantilever(LAWS["damped stop"])
    solution = run(scene, ub.EnergyMomentum())
    solution.save(path)
    assert ub.Solution.load(path).scene.connectors[0].law == stop.law


def test_steps_need_no_python():
    """All steps of a run are taken in C."""
    _, _, scene = all_laws()
    simulation = ub.Simulation(scene, ub.EnergyMomentum())
    python = {lib.phase_in_python, lib.run_in_python, lib.begin_in_python}
    phases = [loop for one in simulation.equation.phases for loop in (*one.begin, *one.accept)]
    assert not python & {function for function, _ in phases}
    simulation.close()


def test_steps_that_are_cut_or_adaptive():
    """[self] A stiff law whose steps are cut, and adaptive steps, lose as much as small ones."""
    laws = Maxwell(500.0, 20.0), Cubic(100.0, 1e7), ub.Stop(1e4, high=0.004, damping=3.0)
    _, _, scene = cantilever(*laws)
    fine = run(scene, ub.EnergyMomentum(), dt=5e-4)
    adaptive = run(scene, ub.EnergyMomentum(), dt=ub.Adaptive(1e-5))
    assert adaptive.energy.worst < 1e-9
    for entry, lost in fine.energy.lost.items():
        assert adaptive.energy.lost[entry][-1] == pytest.approx(lost[-1], rel=2e-2)


def test_motions_of_all_kinds(as_by_reference):
    """Turn and Stretch: units of the law are N m and rad, or N and m."""
    beam = ub.Beam((0, 0), (1, 0), SECTION, cells=4)
    turn = ub.Turn(ub.ground(1, 0), beam.end, Cubic(2.0, 30.0))
    stretch = ub.Stretch(ub.ground(1, 1), beam.end, Drag(50.0, 9.0))
    push = ub.PointLoad(beam.end, force=(0, 1.0), amplitude=lambda t: math.sin(9 * t))
    scene = clamped(beam, loads=[push], connectors=[turn, stretch])
    found = run(scene, ub.EnergyMomentum(), newton=ub.Newton(rtol=1e-12))
    as_by_reference(found)
    assert found.energy.worst < 1e-12


SHARED = """
import sys
sys.path[:0] = [{here!r}, {tests!r}]
from ufl_beam import parallel
parallel.SMALLEST_SUBDOMAIN = 1
import test_connector_laws as t
at, links, scene = t.all_laws()
solution = t.run(scene, t.ub.EnergyMomentum())
t.ub.print_once(repr([float(solution.connector(x).force[-1]) for x in links]))
t.ub.print_once(repr([float(x[-1]) for x in solution.energy.values()]))
"""


@pytest.mark.serial
@needs_mpirun
def test_two_processes_share_a_scene():
    here = os.path.dirname(os.path.abspath(__file__))
    code = SHARED.format(here=here, tests=os.path.dirname(here))
    found = on_two_processes("-c", code)
    assert found.returncode == 0, found.stderr
    forces, energies = map(eval, found.stdout.splitlines()[-2:])
    _, connectors, scene = all_laws()
    solution = run(scene, ub.EnergyMomentum())
    alone = [solution.connector(x).force[-1] for x in connectors]
    np.testing.assert_allclose(forces, alone, rtol=0, atol=1e-9 * np.abs(alone).max())
    ends = [x[-1] for x in solution.energy.values()]
    np.testing.assert_allclose(energies, ends, rtol=0, atol=1e-9 * np.abs(ends).max())


# -- analyses ------------------------------------------------------------------------------------


def test_modes_about_a_state():
    """A body on a cubic spring with a damper: K and C from the derivatives [closed]."""

    @dataclass(frozen=True)
    class Damped(Cubic):
        c: float

        def resistance(self, motion, rate, state, dt):
            return self.c * rate * (1 + motion)

    at, connector, scene = carriage(Damped(100.0, 4e4, 3.0), v=0.0)
    load = ub.PointLoad(at, force=(5.0, 0), amplitude=lambda t: 1.0)
    scene = ub.Scene(
        (), joints=scene.joints, loads=[load], bodies=scene.bodies, connectors=[connector]
    )
    state = run(scene, ub.Static(), t=(0, 2e9), dt=1e9)  # nothing creeps any more
    x = state.displacement(at)[-1, 0]
    assert 100 * x + 4e4 * x**3 == pytest.approx(5.0, rel=1e-9)
    mode = ub.modes(scene, 1, at=state)
    k, c, m = 100 + 3 * 4e4 * x**2, 3.0 * (1 + x), 2.0
    assert mode.omega[0] == pytest.approx(math.sqrt(k / m), rel=1e-9)
    assert mode.damping[0] == pytest.approx(c / (2 * math.sqrt(k * m)), rel=1e-6)


def test_modes_keep_the_variables():
    """A vibration about a state is faster than the creep: K is that of the spring [closed]."""
    _, _, scene = carriage(Maxwell(50.0, 10.0), v=0.0)
    assert ub.modes(scene, 1).omega[0] == pytest.approx(math.sqrt(50.0 / 2.0), rel=1e-9)


@pytest.mark.filterwarnings("ignore:buckling. the factors:ufl_beam.ModelWarning")
def test_buckling_on_a_spring_of_ones_own():
    """A column on a turning spring with a load: the bend of the law belongs to its derivative."""
    column = ub.Beam((0, 0), (0, 1), ub.Section(EA=1e7, GA=1e7, EI=1e5), cells=4)
    factors = []
    for law in (Cubic(5.0, 30.0), ub.ForceLaw(lambda e, rate: 5.0 * e + 30.0 * e**3)):
        foot = ub.Turn(ub.ground(0, 0), column.start, law)
        push = ub.PointLoad(column.end, force=(0.3, -1.0), amplitude=lambda t: t)
        scene = ub.Scene(
            [column], supports=[ub.Pinned(column.start)], loads=[push], connectors=[foot]
        )
        state = run(scene, ub.Static(), t=(0, 1), dt=0.25)
        factors.append(ub.buckling(scene, 1, at=state, t=2.0).factors[0])
    assert factors[0] == pytest.approx(factors[1], rel=1e-6)


def test_on_a_path_rates_vanish():
    """Rates vanish on a path, and Maxwell elements are relaxed [closed]."""
    at, _, scene = cantilever(Cubic(100.0, 1e5), Drag(50.0, 9.0), Maxwell(200.0, 9.0),
                                       load=lambda t: t)  # fmt: skip
    path = ub.follow(scene, ub.LoadControl(0.2), steps=5)
    elastic = cantilever(Cubic(100.0, 1e5), ub.Spring(50.0), load=lambda t: t)
    other = run(elastic[2], ub.Static(), t=(0, 1), dt=0.2)
    np.testing.assert_allclose(
        path.displacement(at)[-1], other.displacement(elastic[0])[-1], rtol=1e-7
    )

    class Endless(Maxwell):
        def increments(self, motion, rate, state, dt):
            return {"creep": self.k * (motion - state.creep) * dt / (self.eta + self.k * dt)}

    scene = cantilever(Endless(200.0, 9.0), load=lambda t: t)[2]
    with pytest.raises(
        ub.ArgumentError, match=r"Endless.increments returns creep = .* for dt = inf"
    ):
        ub.follow(scene, ub.LoadControl(0.2), steps=5)


# -- stops with damping --------------------------------------------------------------------------


@pytest.mark.parametrize(("damping", "v"), [(0.5, 0.3), (2.0, 0.3), (2.0, 3.0), (100.0, 1.0)])
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
    found = []
    for dt in (2e-4, 1e-4):
        at, connector, scene = carriage(ub.Stop(k, high=0.01, damping=damping), v=v)
        solution = run(scene, ub.EnergyMomentum(), t=(0, 0.2), dt=dt)
        history = solution.connector(connector)
        assert history.force.min() > -1e-9 * history.force.max()  # it never pulls
        assert solution.energy.worst < 1e-9
        lost = solution.energy.lost["contact"]
        assert np.diff(lost).min() > -1e-12 * lost[-1]
        np.testing.assert_allclose(lost, history.dissipated, atol=1e-15)
        found.append(-solution.velocity(at)[-1, 0] / v)
        assert lost[-1] == pytest.approx(m * v**2 / 2 * (1 - found[-1] ** 2), rel=1e-7)
    assert found[1] == pytest.approx(expected, abs=2e-3)


def test_a_stop_without_damping_has_no_entry():
    _, (connector,), scene = cantilever(LAWS["stop"])
    assert "contact" not in run(scene, ub.EnergyMomentum()).energy
    assert repr(connector.law) == "Stop(stiffness=300.0, low=-0.004, high=0.006, damping=0.0)"


# -- what is refused -----------------------------------------------------------------------------


def quadratic(self, motion, state):
    return motion**2


ONE = {"variables": {"z": 0.0}, "energy": quadratic}


@pytest.mark.parametrize(
    ("make", "message"),
    [
        (lambda: law_of(), "Mine has neither energy nor resistance, nor a limit; define one"),
        (
            lambda: type("Plain", (ub.extend.ConnectorLaw,), {"energy": quadratic})(),
            "must be a dataclass",
        ),
        (lambda: law_of(energy=quadratic, fields={"k": math.nan}), "Mine: k = nan is not finite"),
        (lambda: law_of(energy=quadratic, fields={"k": "x"}), "Mine: k = 'x' is not a number"),
        (lambda: law_of(energy=quadratic, fields={"parameters": 1.0}), "have the name parameters"),
        (lambda: law_of(energy=quadratic, entry="kinetic"), "is no entry for a loss; use"),
        (lambda: law_of(energy=quadratic, entry=3), "Mine.entry = 3 must be text"),
        (lambda: law_of(**ONE), "has variables and no increments"),
        (lambda: law_of(**ONE, increments=lambda s, e, r, z, dt: {}), "lacks z"),
        (
            lambda: law_of(**ONE, increments=lambda s, e, r, z, dt: {"z": e, "y": e}),
            "has y, which `variables` does not name",
        ),
        (lambda: law_of(**ONE, increments=lambda s, e, r, z, dt: 0.0), "must return a dict"),
        (
            lambda: law_of(**ONE, increments=lambda s, e, r, z, dt: {"z": "a"}),
            "increments returns z = 'a' at no motion",
        ),
        (lambda: law_of(energy=lambda s, e, z: None), "Mine.energy returns None at no motion"),
        (lambda: law_of(energy=lambda s, e, z: 1 / e), "Mine.energy returns"),
        (lambda: law_of(resistance=lambda s, e, r, z, dt: z.y), "Mine.resistance fails at no"),
        (lambda: law_of(energy=quadratic, variables={"z": math.inf}), "no increments"),
    ],
)  # fmt: skip
def test_incomplete_laws_are_refused(make, message):
    """When the connector is made, with its name and that of the class."""
    beam = ub.Beam((0, 0), (1, 0), SECTION)
    with pytest.raises(ub.ArgumentError, match=re.escape(message)) as error:
        ub.Turn(ub.ground(1, 0), beam.end, make())
    assert "Turn(ground (1, 0), beam.end (1, 0))" in str(error.value)


@dataclass(frozen=True)
class Untraceable(ub.extend.ConnectorLaw):
    """A law that looks at numbers."""

    k: float

    def energy(self, motion, state):
        return np.maximum(self.k * motion, 0.0) * motion if motion > 1 else motion


def test_laws_that_cannot_be_compiled_are_refused():
    """Before the first step, with file and line of the method."""
    _, _, scene = cantilever(Untraceable(1.0))
    with pytest.raises(
        ub.ArgumentError, match=r"Untraceable: it cannot be called with .*"
    ) as error:
        run(scene, ub.EnergyMomentum())
    assert re.search(r"\(.*test_connector_laws\.py, line \d+\)\. Laws", str(error.value))


def test_preloaded_laws_need_a_state():
    """A force at no motion is no equilibrium; in statics the first step comes to it [closed]."""

    class Preload(Cubic):
        def energy(self, motion, state):
            return super().energy(motion - 0.01, state)

    at, _, scene = carriage(Preload(100.0, 0.0), v=0.0)
    with pytest.raises(
        ub.ArgumentError, match=r"modes: Preload of Slide.* bears a force at no motion"
    ):
        ub.modes(scene, 1)
    assert run(scene, ub.Static()).displacement(at)[-1, 0] == pytest.approx(0.01)
    swings = run(scene, ub.EnergyMomentum(), t=(0, 5))
    assert swings.energy.total[0] == pytest.approx(100 * 0.01**2 / 2, rel=1e-9)
    assert swings.energy.worst < 1e-9


# -- watches -------------------------------------------------------------------------------------


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
