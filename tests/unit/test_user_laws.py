# SPDX-License-Identifier: MIT
"""Laws of one's own in scenes: closed forms, the ledger, saved states, refusals."""

from dataclasses import dataclass
from typing import ClassVar

import numpy as np
import pytest
from helpers import raises, run
from scenes import clamped
from uniaxial_points import Bars, C
from user_laws import Dashpot, PowerLaw, SameHardening, Stiffening

import ufl_beam as ub

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
    N = run.section_forces_at(beam.at(0.5))[:, 0]
    assert pytest.approx(1e6 * Σ + 1e8 * Σ**3, rel=1e-9) == N


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


def thrown(beam, **more):
    load = ub.PointLoad(beam.end, force=(0, 300.0), amplitude=lambda t: float(t < 0.05))
    return clamped(beam, loads=[load], **more)


def of_section(section, cells=4):
    return thrown(ub.Beam((0, 0), (2, 0), section, cells=cells))


def layered():
    fibres = ub.Fibres(PowerLaw(2e6, 1e-3, 3.0), number=6, softening=ub.Softening(4e6, 3e3))
    whole = ub.Section.rectangle(0.1, 0.1, E=1e9, nu=0.2, rho=1e3, fibres=fibres)
    return of_section(whole, cells=3)


def sprung():
    beam = ub.Beam((0, 0), (2, 0), section(), cells=2)
    spring = ub.Spring(1e4, law=PowerLaw(100.0, 0.01, 3.0))
    return thrown(beam, connectors=[ub.Stretch(ub.ground(2, 1), beam.end, spring)])


SCENES = {
    "bending, hinge": lambda: of_section(section(bending=LAW, hinge=ub.Softening(120.0, 20.0))),
    "fibres": layered,
    "spring": sprung,
    "dashpot": lambda: of_section(section(bending=Dashpot(50.0))),
    "stiffening": lambda: of_section(section(bending=Stiffening(1e4))),
    "by residuals": lambda: of_section(section(bending=SameHardening(50.0, 100.0, 100.0, 1.0))),
}


@pytest.mark.parametrize(
    ("name", "alpha"),
    [
        ("bending, hinge", 0.5),
        ("fibres", 0.0),
        ("spring", 0.1),
        ("dashpot", 0.1),
        ("stiffening", 0.1),
        ("by residuals", 0.1),
    ],
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


def law_of(variables=("p",), **members):
    """An elastic law about the variable ``p``, with other members; numbers are fields."""
    fields = {name: float for name, x in members.items() if isinstance(x, float)}
    elastic = {
        "variables": dict.fromkeys(variables, 0.0),
        "stress": lambda self, strain, state: self.C * (strain - state.p),
        "elastic_energy": lambda self, strain, state: self.C * (strain - state.p) ** 2 / 2,
    }
    kind = type("Half", (ub.extend.MaterialLaw,), {"__annotations__": fields, **elastic, **members})
    return dataclass(frozen=True)(kind)()


def evolving(increments, **members):
    return law_of(increments=lambda self, strain, state, dt: increments(strain, state), **members)


REFUSED = {
    "two names": (
        evolving(lambda e, s: {"p": 0.0 * e}, C=0.0, parameters=1.0),
        "Half: a field cannot have the name C or parameters",
    ),
    "C as a parameter": (
        evolving(lambda e, s: {"p": 0.0 * e}, parameters=lambda self, C: {"C": 1.0}),
        "Half.parameters has the name C",
    ),
    "no evolution": (law_of(), "Half has neither increments nor residuals"),
    "misspelt": (
        evolving(lambda e, s: {"q": e}),
        "Half.increments: the returned dict lacks p and has q",
    ),
    "unknown": (
        evolving(lambda e, s: {"p": s.plastic}),
        "Half.increments fails .* no internal variable 'plastic'; .*: p",
    ),
    "no dict": (
        law_of(residuals=lambda self, strain, old, new, dt: new.p),
        r"Half.residuals returns .* must return a dict with the names p",
    ),
    "both": (
        evolving(lambda e, s: {"p": e}, residuals=lambda self, *_: {"p": 0.0}),
        "Half has both increments and residuals",
    ),
    "infinite": (
        evolving(lambda e, s: {"p": 0.0 * e}, stress=lambda self, e, s: np.full_like(e, np.nan)),
        "Half.stress is .* must be a number",
    ),
    "text": (PowerLaw("strong", 1.0, 2.0), "PowerLaw: M0 = 'strong' is no number"),
    "nan": (PowerLaw(100.0, np.nan, 5.0), "PowerLaw: k0 = nan is not a number"),
    "class": (PowerLaw, "is not an ElastoPlastic or another MaterialLaw"),
    "number": (3.0, "3.0 is not an ElastoPlastic or another MaterialLaw"),
    "thawed": (
        dataclass(frozen=True, eq=False)(type("Soft", (type(law_of()),), {}))(),
        "Soft must be a dataclass",
    ),
}


@pytest.mark.parametrize("name", REFUSED)
def test_incomplete_laws_are_refused(name):
    """When the section, the fibres or the spring is made."""
    law, says = REFUSED[name]
    for make in (
        lambda: section(bending=law),
        lambda: ub.Fibres(law),
        lambda: ub.Spring(1.0, law=law),
    ):
        with pytest.raises(ub.ArgumentError, match=says):
            make()


def test_missing_methods_are_named():
    """By Python, as a class without them is abstract."""
    with pytest.raises(TypeError, match=r"elastic_energy.*stress"):
        type("Empty", (ub.extend.MaterialLaw,), {})()


def test_what_ufl_cannot_trace_is_refused():
    of_numpy = evolving(lambda strain, state: {"p": np.tanh(strain)})
    with raises("Half: ", " symbols of UFL", ".law_functions"):
        ub.Simulation(bent(of_numpy), ub.Static())


def test_hinges_of_zero_length_have_no_elastic_stiffness():
    says = "PowerLaw is the law of an elastic stiffness"
    with raises(says, "Spring"):
        ub.Beam((0, 0), (1, 0), section(), hinges={0.5: LAW})
    with raises(says):
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


def test_whole_numbers_are_numbers():
    """In C, 2/4 would be zero, and a root of a whole number a whole number."""
    ends = []
    for law in (Quarter(), type("QuarterInFloats", (Quarter,), {"whole": float})()):
        layers = ub.Section.rectangle(b=0.1, h=0.1, E=1e9, nu=0.3, fibres=ub.Fibres(law, number=4))
        beam = ub.Beam((0, 0), (1, 0), layers, cells=2)
        pull = ub.PrescribedDisplacement(beam.end, u=lambda t: 1e-3 * t)
        found = run(clamped(beam, pull), ub.Static(), dt=0.5)
        ends.append(found.section_forces(beam)[0, 0] / (layers.EA * 1e-3))
    assert np.allclose(ends, 3**0.5 / 2, rtol=1e-12)
