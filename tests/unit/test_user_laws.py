# SPDX-License-Identifier: MIT
"""Laws of one's own in scenes: closed forms, the ledger, saved states, refusals."""

from dataclasses import dataclass
from typing import ClassVar

import numpy as np
import pytest
from scenes import clamped
from uniaxial_points import Bars, C
from user_laws import Dashpot, PowerLaw, SameHardening, Stiffening

import ufl_beam as ub
from ufl_beam.model.fibres import Fibres

f = ub.extend.law_functions

LAW = PowerLaw(M0=100.0, k0=0.05, n=5.0)


def section(**more):
    return ub.Section(EA=1e6, GA=1e6, EI=1e3, rhoA=1.0, rhoI=1e-3, **more)


def bent(law, cells=4, moment=200.0, time=lambda t: t):
    """A cantilever under a moment at its end."""
    beam = ub.Beam((0, 0), (2, 0), section(bending=law), cells=cells)
    load = ub.PointLoad(beam.end, moment=moment, amplitude=time)
    return clamped(beam, loads=[load])


def rotation(run):
    return run.displacement(run.scene.beams[0].end)[:, 2]


def test_curvature_of_ramberg_and_osgood():
    """[closed] κ = M/EI + k0 (M/M0)^n under a growing moment; 2e-9 is 1e-9 of 7 rad."""
    run = ub.simulate(bent(LAW), ub.Static(), t=(0, 1), dt=0.1)
    M = 200.0 * run.times
    assert rotation(run) == pytest.approx(2 * (M / 1e3 + 0.05 * (M / 100) ** 5), abs=2e-9)


def test_unloading_is_elastic():
    """[closed] From 150 N m back to zero: the plastic curvature stays."""
    scene = bent(LAW, moment=150.0, time=lambda t: t if t < 1 else 2 - t)
    run = ub.simulate(scene, ub.Static(), t=(0, 2), dt=0.1)
    assert rotation(run)[-1] == pytest.approx(2 * 0.05 * 1.5**5, abs=1e-9)


def test_a_law_without_variables():
    """[closed] N = EA Σ + c Σ³ of a bar that is pulled."""
    beam = ub.Beam((0, 0), (1, 0), section(axial=Stiffening(1e8)), cells=2)
    pull = ub.PrescribedDisplacement(beam.end, u=lambda t: 0.1 * t, v=0.0)
    scene = clamped(beam, pull)
    run = ub.simulate(scene, ub.Static(), t=(0, 1), dt=0.25)
    Σ = 0.1 * run.times
    assert run.section_forces_at(beam.at(0.5))[:, 0] == pytest.approx(
        1e6 * Σ + 1e8 * Σ**3, rel=1e-9
    )


def test_a_dashpot_relaxes_exponentially():
    """[closed] At constant strain stress decays as exp(-t C/eta); of second order at θ = 1/2."""
    errors = []
    for n in (10, 20):
        one = Bars(1, Dashpot(eta=40.0), None, ub.EnergyMomentumStatic(0.5))  # C/eta = 5/s
        for dt in (1e-12, *[0.5 / n] * n):
            one.step([0.1], dt=dt)
        errors.append(abs(one.stress()[0] / (C * 0.1) - np.exp(-2.5)))
    # Two step sizes of a method of second order: a factor 4, up to the next order
    assert errors[0] / errors[1] == pytest.approx(4, rel=0.1)
    assert errors[1] < 1e-3


SCENES = {
    "bending": lambda: thrown_one(LAW),
    "bending, hinge": lambda: hinged(),
    "fibres": lambda: layered(),
    "spring": lambda: sprung(PowerLaw(100.0, 0.01, 3.0)),
    "dashpot": lambda: thrown_one(Dashpot(50.0)),
    "stiffening": lambda: thrown_one(Stiffening(1e4)),
    "by residuals": lambda: thrown_one(SameHardening(50.0, 100.0, 100.0, 1.0)),
}


def thrown(beam, **more):
    load = ub.PointLoad(beam.end, force=(0, 300.0), amplitude=lambda t: float(t < 0.05))
    return clamped(beam, loads=[load], **more)


def thrown_one(law):
    return thrown(ub.Beam((0, 0), (2, 0), section(bending=law), cells=4))


def hinged():
    return thrown(
        ub.Beam((0, 0), (2, 0), section(bending=LAW, hinge=ub.Softening(120.0, 20.0)), cells=4)
    )


def layered():
    fibres = ub.Fibres(PowerLaw(2e6, 1e-3, 3.0), number=6, softening=ub.Softening(4e6, 3e3))
    whole = ub.Section.rectangle(0.1, 0.1, E=1e9, nu=0.2, rho=1e3, fibres=fibres)
    return thrown(ub.Beam((0, 0), (2, 0), whole, cells=3))


def sprung(law):
    beam = ub.Beam((0, 0), (2, 0), section(), cells=2)
    connector = ub.Stretch(ub.ground(2, 1), beam.end, ub.Spring(1e4, law=law))
    return thrown(beam, connectors=[connector])


@pytest.mark.parametrize(
    ("name", "alpha"), [*((name, 0.1) for name in SCENES), ("bending, hinge", 0.5), ("fibres", 0.0)]
)
def test_the_ledger_closes_in_both_paths(name, alpha, as_by_reference):
    """Energies of laws that do not state their dissipation, too."""
    scheme = ub.EnergyMomentum(alpha)
    newton = ub.Newton(rtol=1e-12)
    run = ub.simulate(SCENES[name](), scheme, t=(0, 0.1), dt=5e-3, newton=newton)
    as_by_reference(run)
    assert run.energy.worst < 1e-9
    if name != "stiffening":
        assert run.energy.lost["plastic"][-1] > 1e-3 * run.energy.energy_transferred


@pytest.mark.parametrize("name", SCENES)
def test_a_run_that_goes_on_is_the_whole_one(name):
    """By ``start``: internal variables of any name are taken over."""
    scene, scheme = SCENES[name](), ub.EnergyMomentum()
    whole = ub.simulate(scene, scheme, t=(0, 0.1), dt=5e-3)
    half = ub.simulate(scene, scheme, t=(0, 0.05), dt=5e-3)
    rest = ub.simulate(scene, scheme, t=(0.05, 0.1), dt=5e-3, start=half)
    # The tolerance of Newton's method, 1e-9 of the forces
    assert np.abs(rest.q[-1] - whole.q[-1]).max() < 1e-7 * np.abs(whole.q).max()


def test_checkpoints_carry_the_variables(tmp_path, monkeypatch):
    """A run that was interrupted and goes on from its file is the whole one, bit by bit."""
    steps_to = ub.Simulation.steps_to

    def interrupted(simulation, ends, **options):
        if ends[0] > 0.65:
            raise InterruptedError
        return steps_to(simulation, ends, **options)

    whole = ub.simulate(bent(LAW), ub.Static(), t=(0, 1), dt=0.1)
    checkpoint = ub.Checkpoint(tmp_path / "run.h5", every=2)
    of = {"t": (0, 1), "dt": 0.1, "checkpoint": checkpoint}
    monkeypatch.setattr(ub.Simulation, "steps_to", interrupted)
    with pytest.raises(InterruptedError):
        ub.simulate(bent(LAW), ub.Static(), **of)
    monkeypatch.undo()
    again = ub.simulate(bent(LAW), ub.Static(), **of)
    assert np.array_equal(rotation(again), rotation(whole))


def test_modes_are_those_of_elastic_unloading():
    """After plastic bending, with a law by residuals as with the elastic section."""
    bare = ub.modes(bent(None), 3)
    scene = bent(LAW, moment=150.0)
    run = ub.simulate(scene, ub.Static(), t=(0, 1), dt=0.1)
    straight = ub.modes(bent(PowerLaw(1e9, 1.0, 2.0)), 3)
    assert straight.frequencies == pytest.approx(bare.frequencies, rel=1e-9)
    # About the bent state the tangent of growing plastic strain would be less than half as stiff.
    curved = ub.modes(scene, 3, at=run).frequencies
    assert (curved > 0.8 * bare.frequencies).all()


# -- refusals ------------------------------------------------------------------------------------


@dataclass(frozen=True)
class Half(ub.extend.MaterialLaw):
    """Neither increments nor residuals."""

    k: float = 1.0
    variables: ClassVar = {"p": 0.0}

    def stress(self, strain, state):
        return self.C * (strain - state.p)

    def elastic_energy(self, strain, state):
        return self.C * (strain - state.p) ** 2 / 2


@dataclass(frozen=True)
class Misspelt(Half):
    def increments(self, strain, state, dt):
        return {"q": strain}


@dataclass(frozen=True)
class Unknown(Half):
    def increments(self, strain, state, dt):
        return {"p": state.plastic}


@dataclass(frozen=True)
class Short(Half):
    def residuals(self, strain, old, new, dt):
        return new.p


@dataclass(frozen=True)
class Both(Misspelt):
    def residuals(self, strain, old, new, dt):
        return {"p": new.p}


@dataclass(frozen=True, eq=False)
class Soft(Half):
    def increments(self, strain, state, dt):
        return {"p": 0.0 * strain}


@dataclass(frozen=True)
class Infinite(Half):
    def increments(self, strain, state, dt):
        return {"p": 0.0 * strain}

    def stress(self, strain, state):
        return strain / 0.0 if np.isscalar(strain) else np.full_like(strain, np.nan)


@dataclass(frozen=True)
class OfNumPy(Half):
    def increments(self, strain, state, dt):
        return {"p": np.tanh(strain)}


@dataclass(frozen=True)
class Shadowing(Dashpot):
    C: float = 0.0
    parameters: float = 1.0


@dataclass(frozen=True)
class Renamed(Dashpot):
    def parameters(self, C):
        return {"C": 1.0, "eta": self.eta}


@pytest.mark.parametrize(
    ("law", "says"),
    [
        (Shadowing(1.0), "Shadowing: a field cannot have the name C or parameters"),
        (Renamed(1.0), "Renamed.parameters has the name C"),
        (Half(), "Half has neither increments nor residuals"),
        (Misspelt(), "Misspelt.increments: the returned dict lacks p and has q"),
        (Unknown(), "Unknown.increments fails .* no internal variable 'plastic'; .*: p"),
        (Short(), r"Short.residuals returns .* must return a dict with the names p"),
        (Both(), "Both has both increments and residuals"),
        (Infinite(), "Infinite.stress is .* must be a number"),
        (PowerLaw("strong", 1.0, 2.0), "PowerLaw: M0 = 'strong' is no number"),
        (PowerLaw, "is not an ElastoPlastic or another MaterialLaw"),
        (3.0, "3.0 is not an ElastoPlastic or another MaterialLaw"),
    ],
    ids=str,
)
@pytest.mark.parametrize("place", ["section", "fibres", "spring"])
def test_incomplete_laws_are_refused(law, says, place):
    """When the section, the fibres or the spring is made."""
    make = {
        "section": lambda: section(bending=law),
        "fibres": lambda: Fibres(law),
        "spring": lambda: ub.Spring(1.0, law=law),
    }[place]
    with pytest.raises(ub.ArgumentError, match=says):
        make()


def test_a_law_must_be_frozen():
    with pytest.raises(ub.ArgumentError, match="Soft must be a dataclass"):
        section(bending=Soft())


def test_missing_methods_are_named():
    """By Python, as a class without them is abstract."""

    @dataclass(frozen=True)
    class Empty(ub.extend.MaterialLaw):
        k: float

    with pytest.raises(TypeError, match=r"elastic_energy.*stress"):
        Empty(1.0)


def test_what_ufl_cannot_trace_is_refused():
    scene = bent(OfNumPy())
    with pytest.raises(ub.ArgumentError, match=r"OfNumPy: .* symbols of UFL.*\.law_functions"):
        ub.Simulation(scene, ub.Static())


def test_hinges_of_zero_length_have_no_elastic_stiffness():
    with pytest.raises(
        ub.ArgumentError, match=r"PowerLaw is the law of an elastic stiffness.*Spring"
    ):
        ub.Beam((0, 0), (1, 0), section(), hinges={0.5: LAW})
    with pytest.raises(ub.ArgumentError, match="PowerLaw is the law of an elastic stiffness"):
        ub.RigidPlastic(LAW)


@dataclass(frozen=True)
class Quarter(ub.extend.MaterialLaw):
    """A quarter of the stiffness, half in tension, by whole numbers or by others."""

    whole: ClassVar[type] = int

    def stress(self, strain, state):
        factor = f.where(f.below(strain, 0.0), self.whole(1), self.whole(2)) / 4
        root = f.sqrt(f.where(f.below(strain, 0.0), self.whole(2), self.whole(3)))
        return self.C * strain * factor * root

    def elastic_energy(self, strain, state):
        return self.stress(strain, state) * strain / 2


class QuarterInFloats(Quarter):
    whole = float


def test_whole_numbers_are_numbers():
    """In C, 2/4 would be zero, and a root of a whole number a whole number."""
    ends = []
    for law in (Quarter(), QuarterInFloats()):
        layers = ub.Section.rectangle(b=0.1, h=0.1, E=1e9, nu=0.3, fibres=ub.Fibres(law, number=4))
        beam = ub.Beam((0, 0), (1, 0), layers, cells=2)
        pull = ub.PrescribedDisplacement(beam.end, u=lambda t: 1e-3 * t)
        scene = ub.Scene([beam], supports=[ub.Clamped(beam.start), pull])
        run = ub.simulate(scene, ub.Static(), t=(0, 1), dt=0.5)
        ends.append(run.section_forces(beam)[0, 0] / (layers.EA * 1e-3))
    assert np.allclose(ends, 3**0.5 / 2, rtol=1e-12)


def test_a_field_that_is_not_a_number_is_refused():
    with pytest.raises(ub.ModelError, match="PowerLaw: k0 = nan is not a number"):
        section(bending=PowerLaw(M0=100.0, k0=float("nan"), n=5.0))
