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
from user_laws import AirDrag, HardeningSpring, MaxwellElement

import ufl_beam as ub
from ufl_beam import extend
from ufl_beam.blocks.beams import BeamCell
from ufl_beam.blocks.statement import Kernels
from ufl_beam.plotting.model import model_notes

SECTION = ub.Section(EA=1e4, GA=1e4, EI=100.0, rhoA=1.0, rhoI=0.1)
EXACT = [ub.EnergyMomentum(), ub.EnergyMomentum(0.1, 0.1), ub.EnergyMomentumDecaying(0.6)]
SCHEMES = [*EXACT, ub.Newmark(), ub.GeneralizedAlpha()]
STATIC = [ub.Static(), ub.EnergyMomentumStatic(0.7)]

run = partial(run, t=(0, 0.5), dt=0.025, newton=ub.Newton(rtol=1e-12))


@dataclass(frozen=True)
class Quartic(extend.ConnectorLaw):
    """The same energy as a law of a connector."""

    k: float
    h: float

    def energy(self, motion, state):
        return self.k / 2 * motion**2 + self.h / 4 * motion**4


SPRING = {"k": 300.0, "h": 500.0}


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


@pytest.mark.parametrize("scheme", SCHEMES, ids=repr)
def test_a_spring_is_that_of_a_connector_law(scheme):
    """An axis of the ground does not turn; forces over a step are exact for polynomials.

    1e-11 is Newton's tolerance of 1e-12 in 20 steps; stored energies are to 1e-10 of 100 J.  With
    ``alpha`` the scheme damps springs, but no laws of users.
    """
    numbers = SPRING | {"h": 0.0} if scheme.alpha else SPRING
    law_of_connector = ub.Spring(numbers["k"]) if scheme.alpha else Quartic(**numbers)

    def connector(beam, body):
        return ub.Slide(ub.ground(2, 1), body.middle, law_of_connector, axis=(0, 1))

    own = run(pulled(lambda *parts: spring(*parts, numbers)), scheme)
    law = run(pulled(connectors=[connector]), scheme)
    alike(own, law)
    both = own.energy["spring"] + own.energy["stored"]
    np.testing.assert_allclose(both, law.energy["stored"], rtol=0, atol=1e-9)


@pytest.mark.parametrize("scheme", [*SCHEMES, *STATIC], ids=repr)
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


@pytest.mark.parametrize("scheme", SCHEMES, ids=repr)
def test_a_maxwell_element_is_a_force_law_with_state(scheme):
    """The same function in Python; its slope is a difference, and Newton's tolerance remains."""
    θ, k, time = scheme.load_weight, 40.0, 0.2

    def force(motion, rate, dt, state):
        change = dt / time / (1 + θ * dt / time) * (motion - state[0])
        return k * (motion - state[0] - θ * change), [state[0] + change]

    def connector(beam, body):
        law = ub.ForceLaw(force, state=[0.0])
        return ub.Slide(ub.ground(2, 1), body.middle, law, axis=(0, 1))

    def own(beam, body):
        places = [ub.ground(2, 1), body.middle]
        return ub.Effect(MaxwellElement(), places=places, numbers={"k": k, "time": time})

    alike(run(pulled(own), scheme), run(pulled(connectors=[connector]), scheme), 1e-9)


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


@pytest.mark.parametrize("scheme", EXACT, ids=repr)
def test_the_ledger_closes(scheme):
    energy = run(pulled(*ALL), scheme).energy
    assert energy.worst < 1e-9
    assert min(np.ptp(energy[name]) for name in ("spring", "drag", "damping")) > 1e-2


@pytest.mark.parametrize("degree", [2, 3])
def test_the_ledger_closes_on_cells_of_higher_degree(degree):
    assert run(pulled(*ALL), mesh=ub.Mesh(degree=degree), t=(0, 0.2)).energy.worst < 1e-9


@pytest.mark.parametrize("scheme", EXACT[:2], ids=repr)
def test_numbers_that_vary_in_time_supply_energy(scheme):
    def stiffening(beam, body):
        return spring(beam, body, {"k": lambda t: 300.0 * (1 + t), "h": 500.0})

    energy = run(pulled(stiffening), scheme).energy
    assert energy.worst < 1e-9
    assert energy["spring in time"][-1] > 1.0


@pytest.mark.parametrize("scheme", SCHEMES, ids=repr)
def test_a_run_goes_on_from_a_checkpoint(scheme, shared_path):
    require_restart(run, pulled(*ALL), (), scheme, shared_path, until=0.5)


@pytest.mark.parametrize("scheme", STATIC, ids=repr)
def test_restart_in_statics(scheme, shared_path):
    beam = ub.Beam((0, 0), (2, 0), SECTION, cells=4)
    push = ub.PointLoad(beam.end, force=(0, 60.0), amplitude=lambda t: t)
    place = ub.ground(2, 1)
    works = [
        ub.Effect(HardeningSpring(), places=[place, beam.end], numbers={"k": 10.0, "h": 50.0}),
        ub.Effect(MaxwellElement(), places=[place, beam.end], numbers={"k": 40.0, "time": 0.2}),
    ]
    scene = clamped(beam, loads=[push], works=works)
    require_restart(run, scene, (), scheme, shared_path, until=0.5)


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


def test_a_state_that_is_not_the_last_is_no_start():
    half = run(pulled(creeping))
    with raises("Effect MaxwellElement has internal variables"):
        run(pulled(creeping), start=(half, 3))


@pytest.mark.parametrize("scheme", [ub.EnergyMomentum(), ub.Newmark()], ids=repr)
def test_any_number_of_processes(scheme):
    """Places on different processes, and bodies that no beam holds."""
    parts = {"mesh": ub.Mesh(refine=2)}

    def across(beam, body):
        places = [beam.at(0.25), beam.end]
        return ub.Effect(MaxwellElement(), places=places, numbers={"k": 40.0, "time": 0.2})

    scene = pulled(*ALL, across)
    together, alone = (run(scene, scheme, comm=c, **parts) for c in (MPI.COMM_WORLD, MPI.COMM_SELF))
    assert np.abs(together.q - alone.q).max() < 1e-9
    for name in ("spring", "drag", "damping"):
        np.testing.assert_allclose(together.energy[name], alone.energy[name], atol=1e-8)


@pytest.mark.parametrize("law", [ub.ElastoPlastic(6.0, 20.0, 10.0), ub.LinearSoftening(6.0, 5.0)])
def test_with_hinges(law):
    """A beam that yields, and a hinge that opens."""
    hinge = isinstance(law, ub.LinearSoftening)
    section = ub.Section(
        EA=1e4, GA=1e4, EI=100.0, rhoA=1.0, rhoI=0.1, depth=0.3, bending=None if hinge else law
    )
    hinges = {"hinges": {0.0: law}} if hinge else {}
    beam = ub.Beam((0, 0), (2, 0), section, cells=4, **hinges)
    push = ub.PointLoad(beam.end, force=(0, 8.0), amplitude=lambda t: 4 * t)
    place = ub.ground(2, 1)
    works = [
        ub.Effect(HardeningSpring(), places=[place, beam.end], numbers={"k": 1.0, "h": 5.0}),
        ub.Effect(MaxwellElement(), places=[place, beam.end], numbers={"k": 1.0, "time": 0.2}),
        ub.Effect(AirDrag(), beams=[beam], numbers={"c": 0.2}),
    ]
    energy = run(clamped(beam, loads=[push], works=works), t=(0, 1)).energy
    assert energy.worst < 1e-8
    assert energy["hinges" if hinge else "plastic"][-1] > 0.1


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


@dataclass(frozen=True)
class PowerWithState(Power):
    """The same, with a number that it remembers."""

    state = ("last",)

    def equations(self, at):
        return super().equations(at)._replace(state={"last": at.q1[0][1]})


def powers(k=3.0, power=1.5, kind=Power):
    beam = ub.Beam((0, 0), (2, 0), SECTION, cells=2)
    push = ub.PointLoad(beam.end, force=(0, 60.0), amplitude=lambda t: t)
    effect = ub.Effect(kind(power), places=[beam.end], numbers={"k": k})
    return clamped(beam, loads=[push], works=[effect])


@pytest.mark.serial
def test_derivatives_by_numbers_in_a_statement():
    """Central differences: an error of 1e-8 by a relative step of 1e-4, and of Newton's method."""
    options = {"t": (0, 0.5), "dt": 0.05, "newton": ub.Newton(rtol=1e-12), "progress": False}
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
    with raises("PowerWithState: a parameter changes the statement"):
        ub.differentiate(partial(powers, kind=PowerWithState), at, scheme, **options)


@pytest.mark.serial
def test_a_derivative_that_cannot_be_compiled_has_the_name_of_the_statement():
    """UFL has derivatives of all its functions, so that one is missing here on purpose."""

    real = vars(Kernels)["derivative"].func

    def missing(self):
        if isinstance(self._statement, BeamCell):
            return real(self)
        raise NotImplementedError("this function has no derivative")

    options = {"t": (0, 0.1), "dt": 0.05, "progress": False}
    with (
        mock.patch.object(Kernels, "derivative", property(missing)),
        raises("Power has no derivative: this function has no derivative"),
    ):
        ub.differentiate(powers, {"k": 3.0}, ub.EnergyMomentum(), **options)


# -- files and pictures ------------------------------------------------------------------------


def test_a_picture_shows_effects():
    scene = pulled(spring, air)
    notes = model_notes(scene)
    assert any(
        note.startswith("HardeningSpring: acts as its statement says at ground") for note in notes
    )
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
    kind = type(
        "Mine", (extend.Statement,), {"equations": lambda self, at: equations(at), **members}
    )
    return dataclass(frozen=True)(kind)()


def force(x=0.0, y=0.0, m=0.0):
    return [[x, y, m]]


@pytest.mark.parametrize(
    ("equations", "members", "says"),
    [
        (
            lambda at: extend.Equations(force(at["stiff"])), {},
            ("Mine.equations fails", "'stiff' is no input; the inputs are dt"),
        ),
        (lambda at: extend.Equations([[0.0, 0.0]]), {}, ("Mine: forces = ", "each of 1 places")),
        (lambda at: extend.Equations(force() * 2), {}, ("Mine: forces = ", "each of 1 places")),
        (lambda at: 3.0, {}, ("Mine: equations returned 3.0; it must return ub.extend.Equations",)),
        (lambda at: math.sin(at.q1[0][1]), {}, ("Mine.equations fails",)),
        (
            lambda at: extend.Equations(force()), {"state": ("a", "b")},
            ("Mine: equations returned the state nothing, and must return each of a, b once",),
        ),
        (
            lambda at: extend.Equations(force(), {"c": at["a"]}), {"state": ("a",)},
            ("Mine: equations returned the state c, and must return each of a",),
        ),
        (
            lambda at: extend.Equations(force(), stored={"own": at.q1[0]}), {},
            ("Mine: the energy 'own' in stored is", "must be a scalar"),
        ),
        (
            lambda at: extend.Equations(force(), lost={"kinetic": at.q1[0][0]}), {},
            ("Mine: 'kinetic' in lost is an entry of the package",),
        ),
        (
            lambda at: extend.Equations(force(at.v[0][0])), {},
            ("Mine: the forces do work that is neither stored, lost nor supplied", " J of "),
        ),
        (
            lambda at: extend.Equations(
                force(3 * at.q1[0][0]), stored={"own": 3 * at.q1[0][0] ** 2 / 2}
            ),
            {}, ("Mine: the forces do work that is neither stored, lost nor supplied",),
        ),
        (
            lambda at: extend.Equations(force(ufl.sqrt(-1.0 - at.q1[0][0] ** 2))), {},
            ("Mine: the forces are [nan",),
        ),
        (
            lambda at: extend.Equations(force(1.0), {"z": 2 * at["z"]}, {"own": at["z"]}),
            {"state": {"z": 1.0}}, ("Mine: a step without motion changes the stored energy",),
        ),
        (
            lambda at: at.potential("own", lambda q, n: 2.0), {},
            ("Mine.equations fails", "must depend on the configuration"),
        ),
        (
            lambda at: extend.Equations(force(1), lost={"a": at.work(force(1)) + at.work(force())}),
            {},
            ("Mine.equations fails", "call work() once"),
        ),
        (
            lambda at: extend.Equations(force(), lost={"own": at.work([])}), {},
            ("Mine.equations fails", "a force for each of 1 places"),
        ),
        (lambda at: None, {"modes": ("slip",)}, ("Effect Mine: modes is for statements of the",)),
        (lambda at: None, {"laws": 1}, ("Effect Mine: laws is for statements of the package",)),
        (lambda at: None, {"state": ("dt",)}, ("Effect Mine: the name 'dt' occurs twice",)),
    ],
)  # fmt: skip
def test_wrong_statements_are_refused_before_the_run(equations, members, says):
    scene = clamped(BEAM, works=[ub.Effect(statement(equations, **members), places=[BEAM.end])])
    with raises(*says, kind=ub.ModelError):
        ub.Simulation(scene, ub.EnergyMomentum())


def test_the_largest_unexplained_work_is_found_in_all_schemes():
    """Also where the ledger has the trapezoidal rule, whose error is of second order."""
    scene = clamped(BEAM, works=[ub.Effect(statement(lambda at: extend.Equations(
        force(3 * at.q[0][0]), stored={"own": at.q1[0][0] ** 2}
    )), places=[BEAM.end])])  # fmt: skip
    for scheme in (*SCHEMES, *STATIC):
        with raises("neither stored, lost nor supplied", kind=ub.ModelError):
            ub.Simulation(scene, scheme)


BEAM = ub.Beam((0, 0), (1, 0), SECTION, cells=2, name="girder")


class Loose(extend.Statement):
    """A class that is no dataclass."""

    def equations(self, at):
        return extend.Equations(force())


@pytest.mark.parametrize(
    ("make", "says"),
    [
        (lambda: ub.Effect(AirDrag, places=[BEAM.end]), ("must be an object of a class derived",)),
        (lambda: ub.Effect(3, places=[BEAM.end]), ("statement = 3 must be an object",)),
        (lambda: ub.Effect(Loose(), places=[BEAM.end]), ("Loose must be a frozen dataclass",)),
        (lambda: ub.Effect(AirDrag()), ("Effect AirDrag: give either places or beams",)),
        (
            lambda: ub.Effect(AirDrag(), places=[BEAM.end], beams=[BEAM]),
            ("Effect AirDrag: give either places or beams",),
        ),
        (lambda: ub.Effect(AirDrag(), places=[3]), ("places[0] = 3 is not a Place",)),
        (
            lambda: ub.Effect(HardeningSpring(), places=[BEAM.end], numbers=SPRING),
            ("Effect HardeningSpring: the statement has 2 places, and the effect has 1",),
        ),
        (
            lambda: ub.Effect(HardeningSpring(), beams=[BEAM], numbers=SPRING),
            ("Effect HardeningSpring: the statement has 2 places, and along beams it has one",),
        ),
        (
            lambda: ub.Effect(AirDrag(), places=[BEAM.end], numbers={"d": 1.0}),
            ("Effect AirDrag: numbers has d, and the statement c",),
        ),
        (
            lambda: ub.Effect(AirDrag(), places=[BEAM.end], numbers={"c": np.nan}),
            ("Effect AirDrag: numbers['c'] = nan",),
        ),
        (
            lambda: ub.Scene([BEAM], works=[air(ub.Beam((0, 0), (1, 0), SECTION), None)]),
            ("is not in the scene; add it to beams",),
        ),
    ],
)
def test_wrong_effects_are_refused(make, says):
    with raises(*says):
        make()


def test_entries_of_the_ledger_are_in_one_account():
    own = ub.Potential("drag", lambda q: q[0] ** 2)
    scene = clamped(BEAM, works=[own, air(BEAM, None)])
    with raises("Effect AirDrag: the scene has another entry 'drag'", kind=ub.ModelError):
        ub.Simulation(scene, ub.EnergyMomentum())


def test_combinations_that_are_refused():
    scene = clamped(BEAM, works=[air(BEAM, None)])
    with raises("Effect AirDrag may dissipate"):
        run(scene, ub.EnergyMomentum(order=4))
    with raises("the Effect has a stiffness of its own"):
        ub.buckling(scene, 1)


# -- equations in Python -----------------------------------------------------------------------


@dataclass(frozen=True)
class Brake(extend.Statement):
    """Forces by motions, rates, a state and numbers, in operations that Python and UFL share."""

    nodes = 2
    numbers = "k", "c"
    state = ("way",)

    def equations(self, at):
        apart = at.q[1][0] - at.q[0][0] + 0.1 * (at.places[1][0] - at.places[0][0])
        force = at["k"] * (1 + apart**2 + at["way"] ** 2) * (at.v[1][1] - at.v[0][1])
        forces = [[0.0, -force, at["c"] * at.v[0][2]], [0.0, force, 0.0]]
        way = at["way"] + (at.q1[1][1] - at.q0[1][1])
        return extend.Equations(forces, {"way": way}, lost={"brake": at.work(forces)})


@dataclass(frozen=True)
class BrakeInPython(Brake):
    in_python = True


@dataclass(frozen=True)
class Net(extend.Statement):
    """Drag along beams."""

    numbers = ("c",)

    def equations(self, at):
        force = [[at["c"] * at.v[0][0], at["c"] * at.v[0][1] * (1 + at.q[0][1] ** 2), 0.0]]
        return extend.Equations(force, lost={"net": at.work(force)})


@dataclass(frozen=True)
class NetInPython(Net):
    in_python = True


def braked(brake, net, k=10.0):
    def between(beam, body):
        places, numbers = [beam.at(0.75), body.at(2.3, 1.1)], {"k": k, "c": 0.5}
        return ub.Effect(brake(), places=places, numbers=numbers)

    return pulled(between, lambda beam, body: ub.Effect(net(), beams=[beam], numbers={"c": 0.8}))


@pytest.mark.parametrize("k", [10.0, lambda t: 10.0 + 20.0 * t], ids=["constant", "varies"])
@pytest.mark.parametrize("scheme", SCHEMES, ids=repr)
def test_equations_in_python_are_those_in_ufl(scheme, k):
    """Slopes are differences, so that iterates differ, but solutions by their tolerance only."""
    own, compiled = (
        run(braked(*x, k), scheme) for x in ((BrakeInPython, NetInPython), (Brake, Net))
    )
    alike(own, compiled)
    for entry in ("brake", "net"):
        lost = compiled.energy[entry]
        assert lost[-1] > 0.05
        np.testing.assert_allclose(own.energy[entry], lost, rtol=0, atol=1e-10)
    assert own.energy.worst < 1e-10 or scheme not in EXACT


@pytest.mark.parametrize("scheme", [ub.EnergyMomentum(), ub.Newmark()], ids=repr)
def test_equations_in_python_continue(scheme, tmp_path):
    require_restart(run, braked(BrakeInPython, NetInPython), (), scheme, tmp_path, 0.5)


@dataclass(frozen=True)
class Table(extend.Statement):
    """Force by a table, as an energy that is stored."""

    in_python = True

    def equations(self, at):
        at_points, forces = np.array([-2.0, 0.0, 0.5, 3.0]), np.array([-8.0, 0.0, 4.0, 9.0])
        x = at.q1[0][1]
        grid = np.r_[at_points[(at_points > 0) & (at_points < x)], x]
        energy = np.trapezoid(np.r_[0.0, np.interp(grid, at_points, forces)], np.r_[0.0, grid])
        return extend.Equations(
            [[0.0, np.interp(x, at_points, forces), 0.0]], stored={"own": energy}
        )


def test_a_force_by_a_table_bears_a_load_in_statics():
    """On the second branch, 4 N + 2 N/m (x - 0.5 m) = 6 N at x = 1.5 m; the energy is its area."""
    body = ub.Body((0, 0), mass=1.0, inertia=1.0)
    works = [ub.Effect(Table(), places=[body.middle])]
    scene = ub.Scene(
        [], bodies=[body], works=works, loads=[ub.PointLoad(body.middle, force=(0.0, 6.0))],
        supports=[ub.PrescribedDisplacement(body.middle, u=0.0, psi=0.0)],
    )  # fmt: skip
    found = run(scene, ub.Static(), t=(0, 1), dt=1.0)
    assert found.displacement(body.middle)[-1, 1] == pytest.approx(1.5, rel=1e-12)
    assert found.energy["own"][-1] == pytest.approx(1.0 + 5.0, rel=1e-12)


@pytest.mark.parametrize(
    ("equations", "says"),
    [
        (lambda at: extend.Equations([[0.0, 1.0]]), ("must be a vector (x, y, moment)",)),
        (lambda at: None, ("equations returned None",)),
        (lambda at: extend.Equations([[math.nan, 0.0, 0.0]]), ("numbers that are not finite",)),
        (
            lambda at: extend.Equations([[1 / 0.0, 0.0, 0.0]]),
            ("Mine.equations fails", "division"),
        ),
        (lambda at: extend.Equations([[at.v[0][0], 0.0, 0.0]]), ("neither stored, lost nor",)),
        (lambda at: at.potential("own", None), ("Mine.equations fails", "potential")),
    ],
)
def test_wrong_equations_in_python_are_refused(equations, says):
    own = statement(equations, in_python=True)
    with raises(*says, kind=ub.ModelError):
        ub.Simulation(clamped(BEAM, works=[ub.Effect(own, places=[BEAM.end])]), ub.EnergyMomentum())


def test_equations_in_python_have_no_derivatives():
    def model(c):
        works = [ub.Effect(NetInPython(), beams=[BEAM], numbers={"c": c})]
        return clamped(BEAM, works=works, loads=[ub.PointLoad(BEAM.end, force=(0.0, 1.0))])

    with raises("NetInPython has no derivative, because its equations are in Python"):
        ub.differentiate(model, {"c": 1.0}, ub.EnergyMomentum(), t=(0, 0.1), dt=0.05)


@pytest.mark.parametrize("in_python", [False, True])
def test_work_is_asked_once_with_all_forces(in_python):
    works = (
        (lambda at: at.work(force(1)) + at.work(force()), "call work() once"),
        (lambda at: at.work([]), "a force for each of 1 places"),
    )
    for work, says in works:

        def equations(at, work=work):
            return extend.Equations(force(1), lost={"a": work(at)})

        own = statement(equations, in_python=in_python)
        with raises("Mine.equations fails", says, kind=ub.ModelError):
            ub.Simulation(clamped(BEAM, works=[ub.Effect(own, places=[BEAM.end])]), ub.Newmark())
