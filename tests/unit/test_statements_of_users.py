# SPDX-License-Identifier: MIT
"""Effects by statements of a user: forces, ledger, restart, derivatives, processes, refusals."""

import math
from dataclasses import dataclass, replace
from functools import partial
from unittest import mock

from mpi4py import MPI

import numpy as np
import pytest
import ufl
from helpers import raises, require_restart, run
from scenes import clamped
from user_classes import Stiffening
from user_laws import AirDrag, HardeningSpring, MaxwellElement

import ufl_beam as ub
from ufl_beam import extend
from ufl_beam.blocks.beams import BeamCell
from ufl_beam.blocks.statement import Kernels
from ufl_beam.plotting.model import model_notes

SECTION = ub.Section(EA=1e4, GA=1e4, EI=100.0, rhoA=1.0, rhoI=0.1)
EXACT, LOSSY, AT_END = ub.EnergyMomentum(), ub.EnergyMomentum(0.1, 0.1), ub.GeneralizedAlpha()

run = partial(run, t=(0, 0.5), dt=0.025, newton=ub.Newton(rtol=1e-12))


SPRING = {"k": 300.0, "h": 500.0}


def derived(kind, name="Mine", **members):
    """A class of a user that has further members."""
    return dataclass(frozen=True)(type(name, (kind,), members))


def pulled(*effects, connectors=(), **parts):
    """A beam, a body beside its end, and effects or connectors, which are functions of both."""
    beam = ub.Beam((0, 0), (2, 0), SECTION, cells=4)
    body = ub.Body((2, 1), mass=1.0, inertia=0.3)
    kick = [ub.Velocity((body,), linear=(0.5, 2.0), angular=3.0)]
    by = {
        "works": [make(beam, body) for make in effects],
        "connectors": [make(beam, body) for make in connectors],
    }
    return clamped(beam, bodies=[body], initial=kick, **by, **parts)


def spring(beam, body, numbers=SPRING):
    return ub.Effect(HardeningSpring(), places=[ub.ground(2, 1), body.middle], numbers=numbers)


def eccentric(beam, body):
    """Between the beam and a point beside the centre of the body."""
    return ub.Effect(HardeningSpring(), places=[beam.at(0.75), body.at(2.3, 1.1)], numbers=SPRING)


def creeping(beam, body):
    places = [beam.end, body.at(2.3, 1.1)]
    return ub.Effect(MaxwellElement(), places=places, numbers={"k": 40.0, "time": 0.2})


def air(beam, body):
    return ub.Effect(AirDrag(), beams=[beam], numbers={"c": 0.8})


def sail(beam, body):
    return ub.Effect(AirDrag(), places=[body.at(2.0, 1.4)], numbers={"c": 0.5})


def alike(one, two, tolerance=1e-11):
    """Motions of two runs are equal, without the forces of connectors that one of them has."""
    n = min(one.q.shape[1], two.q.shape[1])
    assert np.abs(one.q).max() > 0.1
    np.testing.assert_allclose(one.q[:, :n], two.q[:, :n], rtol=0, atol=tolerance)


# -- beside the effects of the package ---------------------------------------------------------


@pytest.mark.parametrize("scheme", [EXACT, LOSSY, AT_END], ids=repr)
def test_a_spring_is_that_of_a_connector_law(scheme):
    """An axis of the ground does not turn; forces over a step are exact for polynomials.

    1e-11 is Newton's tolerance of 1e-12 in 20 steps; stored energies are to 1e-10 of 100 J.  With
    ``alpha`` the scheme damps springs, but no laws of users.
    """
    numbers = SPRING | {"h": 0.0} if scheme.alpha else SPRING
    law_of_connector = ub.Spring(numbers["k"]) if scheme.alpha else Stiffening(*numbers.values())

    def connector(beam, body):
        return ub.Slide(ub.ground(2, 1), body.middle, law_of_connector, axis=(0, 1))

    own = run(pulled(lambda *parts: spring(*parts, numbers)), scheme)
    law = run(pulled(connectors=[connector]), scheme)
    alike(own, law)
    both = own.energy["spring"] + own.energy["stored"]
    np.testing.assert_allclose(both, law.energy["stored"], rtol=0, atol=1e-9)


@pytest.mark.parametrize("scheme", [LOSSY, AT_END, ub.Static()], ids=repr)
@pytest.mark.filterwarnings("ignore:VirtualWork 'air' takes v")  # a damper in statics
def test_drag_along_beams_is_that_of_a_virtual_work(scheme):
    def of_function(v, w, c):
        size = ufl.sqrt(v[0] ** 2 + v[1] ** 2 + 1e-12)
        return -c * size * (v[0] * w[0] + v[1] * w[1])

    beam = ub.Beam((0, 0), (2, 0), SECTION, cells=4)
    push = ub.PointLoad(beam.end, force=(0, 60.0), amplitude=lambda t: 4 * t * t)
    works = (
        ub.Effect(AirDrag(), beams=[beam], numbers={"c": 0.8}),
        ub.VirtualWork("air", of_function, numbers={"c": 0.8}),
    )
    own, other = (run(clamped(beam, loads=[push], works=[work]), scheme) for work in works)
    alike(own, other)
    # The trapezoidal rule of both ledgers: the motion begins at rest, without drag
    np.testing.assert_allclose(own.energy["drag"], -other.energy["air"], rtol=1e-9, atol=1e-10)
    assert own.energy["drag"][-1] > 1e-3


def test_a_maxwell_element_relaxes():
    """Held at e, each step divides the force by 1 + dt/time at the end of the step [closed]."""
    beam = ub.Beam((0, 0), (1, 0), SECTION, cells=1)
    jump = ub.Table([0.0, 1e-9], [0.0, 0.1])
    moved = ub.PrescribedDisplacement(beam.end, u=0.0, v=jump, psi=0.0)
    effect = ub.Effect(
        MaxwellElement(), places=[ub.ground(1, 0), beam.end], numbers={"k": 40.0, "time": 0.2}
    )
    scene = ub.Scene([beam], supports=[moved], works=[effect])
    first = run(scene, ub.EnergyMomentumStatic(), t=(0, 1e-9), dt=1e-9)
    held = run(scene, ub.EnergyMomentumStatic(), t=(1e-9, 0.5), dt=0.0499999999, start=first)
    ratio = 1 / (1 + 0.05 / 0.2)
    stored = 40.0 / 2 * 0.1**2 * ratio ** (2 * np.arange(len(held.times)))
    # The step of 1 ns is 5e-9 of the relaxation time
    np.testing.assert_allclose(held.energy["stored"], stored, rtol=1e-7)
    assert held.energy.worst < 1e-9


# -- ledger, restart, processes, derivatives ---------------------------------------------------

ALL = eccentric, creeping, air, sail


def test_the_ledger_closes():
    energy = run(pulled(*ALL), LOSSY).energy
    assert energy.worst < 1e-9
    assert min(np.ptp(energy[name]) for name in ("spring", "drag", "damping")) > 1e-2


def test_numbers_that_vary_in_time_supply_energy():
    def stiffening(beam, body):
        return spring(beam, body, {"k": lambda t: 300.0 * (1 + t), "h": 500.0})

    energy = run(pulled(stiffening), LOSSY).energy
    assert energy.worst < 1e-9
    assert energy["spring in time"][-1] > 1.0


def pushed():
    """A beam between a spring and a Maxwell element, under a growing force."""
    beam, place = ub.Beam((0, 0), (2, 0), SECTION, cells=4), ub.ground(2, 1)
    push = ub.PointLoad(beam.end, force=(0, 60.0), amplitude=lambda t: t)
    works = [
        ub.Effect(HardeningSpring(), places=[place, beam.end], numbers={"k": 10.0, "h": 50.0}),
        ub.Effect(MaxwellElement(), places=[place, beam.end], numbers={"k": 40.0, "time": 0.2}),
    ]
    return clamped(beam, loads=[push], works=works)


@pytest.mark.parametrize(
    ("make", "scheme"),
    [
        (lambda: pulled(*ALL), AT_END),
        (pushed, ub.Static()),
        (pushed, ub.EnergyMomentumStatic(0.7)),
        (lambda: braked(BrakeInPython, NetInPython), AT_END),
    ],
    ids=["at the end", "static", "statics over the step", "in Python"],
)
def test_a_run_goes_on_from_a_checkpoint(make, scheme, shared_path):
    require_restart(run, make(), (), scheme, shared_path, until=0.5)


def test_a_continued_run_finds_the_states_of_effects():
    """Wherever they are among the works; sums in another order have other round-off."""
    scene = pulled(creeping, eccentric, air)
    first = run(scene)
    same, other = (
        run(replace(scene, works=works), t=(0.5, 0.6), start=first)
        for works in (scene.works, scene.works[::-1])
    )
    alike(same, other, 1e-12)
    assert same.energy["damping"][-1] == pytest.approx(other.energy["damping"][-1], rel=1e-9)


def test_any_number_of_processes():
    """Places on different processes, and bodies that no beam holds."""

    def across(beam, body):
        places = [beam.at(0.25), beam.end]
        return ub.Effect(MaxwellElement(), places=places, numbers={"k": 40.0, "time": 0.2})

    scene, mesh = pulled(*ALL, across), ub.Mesh(refine=2)
    together, alone = (run(scene, comm=c, mesh=mesh) for c in (MPI.COMM_WORLD, MPI.COMM_SELF))
    assert np.abs(together.q - alone.q).max() < 1e-9
    for name in ("spring", "drag", "damping"):
        np.testing.assert_allclose(together.energy[name], alone.energy[name], atol=1e-8)


def test_frequency_of_a_mass_on_a_spring():
    """ω² = k/m [closed]."""
    body = ub.Body((0, 0), mass=2.0, inertia=1.0)
    effect = ub.Effect(HardeningSpring(), places=[ub.ground(0, 0), body.middle], numbers=SPRING)
    held = [ub.PrescribedDisplacement(body.middle, u=0.0, psi=0.0)]
    found = ub.modes(ub.Scene(bodies=[body], supports=held, works=[effect]), 1)
    np.testing.assert_allclose(found.omega**2, SPRING["k"] / 2.0, rtol=1e-12)


@dataclass(frozen=True)
class Power(extend.Statement):
    """Force by a power of the motion, which is a number in the compiled function."""

    power: float
    numbers = ("k",)

    def equations(self, at):
        return at.potential("own", lambda q, n: n["k"] * (1 + q[0][1] ** 2) ** self.power)


def powers(k=3.0, power=1.5, kind=Power):
    beam = ub.Beam((0, 0), (2, 0), SECTION, cells=2)
    push = ub.PointLoad(beam.end, force=(0, 60.0), amplitude=lambda t: t)
    effect = ub.Effect(kind(power), places=[beam.end], numbers={"k": k})
    return clamped(beam, loads=[push], works=[effect])


@pytest.mark.serial
def test_derivatives_by_numbers_in_a_statement():
    """Central differences: an error of 1e-8 by a relative step of 1e-4, and of Newton's method."""
    options = {"t": (0, 0.5), "dt": 0.05, "newton": ub.Newton(rtol=1e-12)}
    at, scheme, step = {"k": 3.0, "power": 1.5}, ub.EnergyMomentum(), 1e-4
    found = ub.differentiate(powers, at, scheme, **options).of(lambda run: run.q[-1])
    for p, (name, value) in enumerate(at.items()):
        less, more = (
            ub.simulate(powers(**at | {name: value * x}), scheme, **options).q[-1]
            for x in (1 - step, 1 + step)
        )
        difference = (more - less) / (2 * step * value)
        largest = np.abs(difference).max()
        np.testing.assert_allclose(found[:, p], difference, rtol=0, atol=1e-6 * largest)


SHORT = {"t": (0, 0.1), "dt": 0.05}


@pytest.mark.serial
def test_a_parameter_in_a_statement_with_a_state_has_no_derivative():
    def equations(self, at):
        return Power.equations(self, at)._replace(state={"last": at.q1[0][1]})

    kind = derived(Power, "PowerWithState", state=("last",), equations=equations)
    with raises("PowerWithState: a parameter changes the statement"):
        ub.differentiate(partial(powers, kind=kind), {"power": 1.5}, EXACT, **SHORT)


@pytest.mark.serial
def test_a_derivative_that_cannot_be_compiled_has_the_name_of_the_statement():
    """UFL has derivatives of all its functions, so that one is missing here on purpose."""
    real = vars(Kernels)["derivative"].func

    def missing(self):
        if isinstance(self._statement, BeamCell):
            return real(self)
        raise NotImplementedError("this function has no derivative")

    with (
        mock.patch.object(Kernels, "derivative", property(missing)),
        raises("Power has no derivative: this function has no derivative"),
    ):
        ub.differentiate(powers, {"k": 3.0}, EXACT, **SHORT)


# -- files and pictures ------------------------------------------------------------------------


def test_a_picture_shows_effects():
    scene = pulled(spring, air)
    notes = model_notes(scene)
    assert any(note.startswith("HardeningSpring: acts as its statement says") for note in notes)
    assert "AirDrag: acts as its statement says on beam" in notes
    ub.plot(scene)


@pytest.mark.serial
def test_a_saved_solution_has_its_effects(tmp_path):
    solution = run(pulled(eccentric), t=(0, 0.1))
    solution.save(tmp_path / "run.solution")
    with raises("class HardeningSpring of your own"):
        ub.Solution.load(tmp_path / "run.solution")
    loaded = ub.Solution.load(tmp_path / "run.solution", scene=pulled(eccentric))
    assert np.array_equal(loaded.energy["spring"], solution.energy["spring"])


# -- refusals ----------------------------------------------------------------------------------


def statement(equations, **members):
    """A statement of a user with a function of ``at`` as equations."""
    return derived(extend.Statement, equations=lambda self, at: equations(at), **members)()


def force(x=0.0, y=0.0, m=0.0):
    return [[x, y, m]]


def E(*of, **more):
    return extend.Equations(*of, **more)


PYTHON = {"in_python": True}
STIFF = "Mine: the forces do work that is neither stored, lost nor supplied"
WRONG = [
    (lambda at: E(force(at["stiff"])), {}, "Mine.equations fails", "'stiff' is no input"),
    (lambda at: E([[0.0, 0.0]]), {}, "Mine: forces = ", "each of 1 places"),
    (lambda at: E(force() * 2), {}, "Mine: forces = ", "each of 1 places"),
    (lambda at: 3.0, {}, "Mine: equations returned 3.0; it must return ub.extend.Equations"),
    (lambda at: math.sin(at.q1[0][1]), {}, "Mine.equations fails"),
    (
        lambda at: E(force()), {"state": ("a", "b")},
        "Mine: equations returned the state nothing, and must return each of a, b once",
    ),
    (
        lambda at: E(force(), {"c": at["a"]}), {"state": ("a",)},
        "Mine: equations returned the state c, and must return each of a",
    ),
    (
        lambda at: E(force(), stored={"own": at.q1[0]}), {},
        "Mine: the energy 'own' in stored is", "must be a scalar",
    ),
    (
        lambda at: E(force(), lost={"kinetic": at.q1[0][0]}), {},
        "Mine: 'kinetic' in lost is an entry of the package",
    ),
    (lambda at: E(force(at.v[0][0])), {}, STIFF, " J of "),
    (lambda at: E(force(3 * at.q1[0][0]), stored={"own": 1.5 * at.q1[0][0] ** 2}), {}, STIFF),
    (lambda at: E(force(ufl.sqrt(-1.0 - at.q1[0][0] ** 2))), {}, "Mine: the forces are [nan"),
    (
        lambda at: E(force(1.0), {"z": 2 * at["z"]}, {"own": at["z"]}), {"state": {"z": 1.0}},
        "Mine: a step without motion changes the stored energy",
    ),
    (
        lambda at: at.potential("own", lambda q, n: 2.0), {},
        "Mine.equations fails", "must depend on the configuration",
    ),
    *(
        (lambda at, ask=ask: E(force(1), lost={"a": ask(at)}), of, "Mine.equations fails", says)
        for of in ({}, PYTHON)
        for ask, says in (
            (lambda at: at.work(force(1)) + at.work(force()), "call work() once"),
            (lambda at: at.work([]), "a force for each of 1 places"),
        )
    ),
    (lambda at: None, {"modes": ("slip",)}, "Effect Mine: modes is for statements of the"),
    (lambda at: None, {"laws": 1}, "Effect Mine: laws is for statements of the package"),
    (lambda at: None, {"state": ("dt",)}, "Effect Mine: the name 'dt' occurs twice"),
    (lambda at: E([[0.0, 1.0]]), PYTHON, "must be a vector (x, y, moment)"),
    (lambda at: None, PYTHON, "equations returned None"),
    (lambda at: E([[math.nan, 0.0, 0.0]]), PYTHON, "numbers that are not finite"),
    (lambda at: E([[1 / 0.0, 0.0, 0.0]]), PYTHON, "Mine.equations fails", "division"),
    (lambda at: E([[at.v[0][0], 0.0, 0.0]]), PYTHON, "neither stored, lost nor"),
    (lambda at: at.potential("own", None), PYTHON, "Mine.equations fails", "potential"),
]  # fmt: skip
"""Equations, other members of a statement, and words of the message."""


@pytest.mark.parametrize("row", range(len(WRONG)))
def test_wrong_statements_are_refused_before_the_run(row):
    equations, members, *says = WRONG[row]
    own = statement(equations, **members)
    with raises(*says, kind=ub.ModelError):
        ub.Simulation(clamped(BEAM, works=[ub.Effect(own, places=[BEAM.end])]), ub.EnergyMomentum())


@pytest.mark.parametrize("scheme", [AT_END, ub.EnergyMomentumStatic(0.7)], ids=repr)
def test_unexplained_work_is_found_in_all_schemes(scheme):
    """Also where the ledger has the trapezoidal rule, whose error is of second order."""
    own = statement(lambda at: E(force(3 * at.q[0][0]), stored={"own": at.q1[0][0] ** 2}))
    with raises("neither stored, lost nor supplied", kind=ub.ModelError):
        ub.Simulation(clamped(BEAM, works=[ub.Effect(own, places=[BEAM.end])]), scheme)


BEAM = ub.Beam((0, 0), (1, 0), SECTION, cells=2, name="girder")


class Loose(extend.Statement):
    """A class that is no dataclass."""

    def equations(self, at):
        return E(force())


END, OUTSIDE = [BEAM.end], ub.Beam((0, 0), (1, 0), SECTION)


@pytest.mark.parametrize(
    ("make", "says"),
    [
        (lambda: ub.Effect(AirDrag, places=END), "must be an object of a class derived"),
        (lambda: ub.Effect(Loose(), places=END), "Loose must be a frozen dataclass"),
        (lambda: ub.Effect(AirDrag()), "Effect AirDrag: give either places or beams"),
        (
            lambda: ub.Effect(AirDrag(), places=END, beams=[BEAM]),
            "Effect AirDrag: give either places or beams",
        ),
        (
            lambda: ub.Effect(HardeningSpring(), places=END, numbers=SPRING),
            "Effect HardeningSpring: the statement has 2 places, and the effect has 1",
        ),
        (
            lambda: ub.Effect(HardeningSpring(), beams=[BEAM], numbers=SPRING),
            "Effect HardeningSpring: the statement has 2 places, and along beams it has one",
        ),
        (
            lambda: ub.Effect(AirDrag(), places=END, numbers={"d": 1.0}),
            "Effect AirDrag: numbers has d, and the statement c",
        ),
        (lambda: ub.Scene([BEAM], works=[air(OUTSIDE, None)]), "is not in the scene; add it to"),
    ],
)
def test_wrong_effects_are_refused(make, says):
    with raises(says):
        make()


def test_combinations_that_are_refused():
    scene = clamped(BEAM, works=[air(BEAM, None)])
    with raises("Effect AirDrag may dissipate"):
        run(scene, ub.EnergyMomentum(order=4))
    with raises("the Effect has a stiffness of its own"):
        ub.buckling(scene, 1)
    own = ub.Potential("drag", lambda q: q[0] ** 2)
    with raises("Effect AirDrag: the scene has another entry 'drag'", kind=ub.ModelError):
        run(replace(scene, works=[own, *scene.works]))


# -- equations in Python -----------------------------------------------------------------------


@dataclass(frozen=True)
class Brake(extend.Statement):
    """Forces by motions, rates, a state and numbers, in operations that Python and UFL share."""

    nodes = 2
    numbers = "k", "c"
    state = ("way",)

    def equations(self, at):
        apart = at.q[1][0] - at.q[0][0] + 0.1 * (at.places[1][0] - at.places[0][0])
        brake = at["k"] * (1 + apart**2 + at["way"] ** 2) * (at.v[1][1] - at.v[0][1])
        pull = at["c"] * (at.q[1][0] - at.q[0][0])
        forces = [[-pull, -brake, at["c"] * at.v[0][2]], [pull, brake, 0.0]]
        before, after = (at["c"] * (q[1][0] - q[0][0]) ** 2 / 2 for q in (at.q0, at.q1))
        way = at["way"] + (at.q1[1][1] - at.q0[1][1])
        lost = at.work(forces) - (after - before)
        stored = {"pull": after}
        return extend.Equations(
            forces, {"way": way}, stored, {"brake": lost}, before={"pull": before}
        )


@dataclass(frozen=True)
class Net(extend.Statement):
    """Drag along beams."""

    numbers = ("c",)

    def equations(self, at):
        force = [[at["c"] * at.v[0][0], at["c"] * at.v[0][1] * (1 + at.q[0][1] ** 2), 0.0]]
        return extend.Equations(force, lost={"net": at.work(force)})


BrakeInPython = derived(Brake, "BrakeInPython", in_python=True)
NetInPython = derived(Net, "NetInPython", in_python=True)


def braked(brake, net, k=10.0):
    def between(beam, body):
        places, numbers = [beam.at(0.75), body.at(2.3, 1.1)], {"k": k, "c": 0.5}
        return ub.Effect(brake(), places=places, numbers=numbers)

    return pulled(between, lambda beam, body: ub.Effect(net(), beams=[beam], numbers={"c": 0.8}))


@pytest.mark.parametrize(
    ("scheme", "k"),
    [(EXACT, 10.0), (LOSSY, lambda t: 10.0 + 20.0 * t), (AT_END, lambda t: 10.0 + 20.0 * t)],
    ids=["exact", "lossy", "at the end"],
)
def test_equations_in_python_are_those_in_ufl(scheme, k):
    """Slopes are differences, so that iterates differ, but solutions by their tolerance only."""
    own, compiled = (
        run(braked(*x, k), scheme) for x in ((BrakeInPython, NetInPython), (Brake, Net))
    )
    alike(own, compiled)
    for entry in ("brake", "net", "pull"):
        energy = compiled.energy[entry]
        assert np.ptp(energy) > 0.01
        np.testing.assert_allclose(own.energy[entry], energy, rtol=0, atol=1e-10)
    assert own.energy.worst < 1e-10 or scheme == AT_END


def test_equations_in_python_have_no_derivatives():
    def model(c):
        works = [ub.Effect(NetInPython(), beams=[BEAM], numbers={"c": c})]
        return clamped(BEAM, works=works, loads=[ub.PointLoad(BEAM.end, force=(0.0, 1.0))])

    with raises("NetInPython has no derivative, because its equations are in Python"):
        ub.differentiate(model, {"c": 1.0}, EXACT, **SHORT)
