# SPDX-License-Identifier: MIT
"""Softening laws of one's own: in cells, hinges, connectors, springs and fibres; refusals."""

import inspect
import warnings
from dataclasses import dataclass, replace
from itertools import pairwise

import numpy as np
import pytest
from scenes import clamped, rigid_chain
from scipy.integrate import quad
from uniaxial_points import LENGTH, Bars
from user_laws import Exponential, Fading, Kinked, Petersson, Rising

import ufl_beam as ub
from ufl_beam.model.softening_laws import SMALL_GROWTH

f = ub.extend.law_functions

T, G, EI = 100.0, 30.0, 1e3
"""Limit, energy and bending stiffness of hinges; no law of LAWS snaps back in a metre of it."""

LAWS = {
    "exponential": Exponential(T, G),
    "Petersson": Petersson(T, G),
    "kinked": Kinked(T, G),
    "fading": Fading(T, 0.6, 3.0),
    "rising": Rising(T, 0.2),
}
KINKS = [0.8 * G / T, 3.6 * G / T]

pytestmark = pytest.mark.serial  # hinges on several processes are in other files

each_law = pytest.mark.parametrize("law", LAWS.values(), ids=LAWS)


# -- laws ------------------------------------------------------------------------------------------


@each_law
def test_numbers_that_follow_from_the_traction(law):
    """[closed] Limit and energy; whether the traction exceeds its limit."""
    assert law.limit == pytest.approx(T, rel=1e-15)
    assert law.fracture_energy == pytest.approx(G, rel=1e-14)
    assert law.opens
    assert law.bounded == (not isinstance(law, Rising))


GROWTHS = [0.0, 1e-14, 1e-9, 0.99 * SMALL_GROWTH, 1.01 * SMALL_GROWTH, 1e-3, 0.1, 0.5, 1.0, 2.0]


@each_law
@pytest.mark.parametrize("a", GROWTHS)
def test_mean_traction_is_the_mean(law, a):
    """To 1e-11 of the limit, but by quadrature for steps that are long or have kinks.

    With a kink 1/100 of the change of the slope times the step.
    """
    long, a = a > 0.5 and isinstance(law, Fading | Rising), a * G / T
    for ξ in np.array([0.0, 0.3, 0.79, 3.5, 4.0]) * G / T:
        ends = [min(max((x - ξ) / (a or 1.0), 0.0), 1.0) for x in KINKS]
        parts = pairwise([0.0, *ends, 1.0])
        exact = sum(
            quad(lambda x, ξ=ξ: law.traction(ξ + x * a), *part, epsabs=1e-12 * T, epsrel=1e-12)[0]
            for part in parts
        )
        kinked = a and isinstance(law, Kinked) and any(0.0 < end < 1.0 for end in ends)
        tolerance = 0.01 * T / (G / T) * a if kinked else (1e-5 if long else 1e-11) * T
        [found] = law.mean_traction(np.array([ξ]), np.array([a]))
        assert found == pytest.approx(exact, abs=tolerance)


@each_law
@pytest.mark.parametrize("scheme", [ub.Static(), ub.EnergyMomentum(0.2)], ids=str)
def test_tangents_of_points(law, scheme):
    """Against central differences, from closed over the peak to open."""
    some = Bars(1, ub.ElastoPlastic(np.inf), law, scheme, C=2e3)
    for strain in np.linspace(0.013, 3.0, 31):
        ε = 1e-6
        (_, D), *sides = (some.return_map([strain + x]) for x in (0.0, -ε, ε))
        central = (sides[1][0] - sides[0][0]) / (2 * ε)
        assert D[0] == pytest.approx(central[0], abs=1e-5 * 2e3)
        some.step([strain])
    assert some["opening"][0] > 2.5 * LENGTH


# -- scenes ----------------------------------------------------------------------------------------


def turned(law, motion, place="cell", rho=0.0):
    """A beam of a metre whose end is turned, or whose bar is pulled: one hinge, spring or crack."""
    whole = {"EA": 1e6, "GA": 1e6, "EI": EI, "rhoA": rho, "rhoI": 1e-3 * rho}
    hinge = law if place == "cell" else None
    hinges = {0.0: law} if place == "hinge" else {0.0: None, 1.0: None}
    beam = ub.Beam((0, 0), (1, 0), ub.Section(**whole, hinge=hinge), cells=1, hinges=hinges)
    supports = [ub.PrescribedDisplacement(beam.end, psi=motion)]
    if place in ("cell", "hinge"):
        return clamped(beam, *supports)
    of_connector = ub.RigidPlastic(law) if place == "connector" else ub.Spring(1e3, softening=law)
    connector = ub.Turn(ub.ground(0, 0), beam.start, of_connector)
    return ub.Scene([beam], supports=[ub.Pinned(beam.start), *supports], connectors=[connector])


PLACES = ["cell", "hinge", "connector", "spring"]
each_place = pytest.mark.parametrize("place", PLACES)


def response(run, place):
    """Moment, opening and dissipated energy at the kept times."""
    scene = run.scene
    beam = scene.beams[0]
    if place == "cell":
        at = run.material_at(beam.at(0.5))
        return at.forces[:, 2], at.jump, at.hinge
    connector = scene.hinges[0] if place == "hinge" else scene.connectors[0]
    found = run.connector(connector)
    M = found.force
    return M, found.motion - (M / 1e3 if place == "spring" else 0.0), found.dissipated


@each_law
@each_place
def test_moment_is_the_traction(law, place):
    """[closed] Under a growing rotation; opened, it has dissipated the integral of the traction."""
    scene = turned(law, lambda t: 2.0 * t, place)
    run = ub.simulate(scene, ub.Static(), t=(0, 1), dt=0.025)
    M, opening, dissipated = response(run, place)
    open_ = opening > 1e-9
    assert np.count_nonzero(open_) > 30
    assert M[open_] == pytest.approx(law.traction(opening[open_]), abs=1e-9 * T)
    parts = pairwise([0.0, *np.clip(KINKS, 0.0, opening[-1]), opening[-1]])
    energy = sum(quad(law.traction, *part, limit=200, epsabs=1e-9)[0] for part in parts)
    # A kink in a step of 0.05 rad: 1/100 of the change of the slope times the square of the step
    tolerance = 1e-2 if isinstance(law, Kinked) else 1e-7
    assert dissipated[-1] == pytest.approx(energy, abs=tolerance)


@pytest.mark.parametrize(
    ("place", "scheme"),
    [
        ("cell", ub.EnergyMomentumStatic()),
        ("hinge", ub.EnergyMomentum()),
        ("connector", ub.EnergyMomentumStatic()),
        ("spring", ub.EnergyMomentum(0.3)),
        ("cell", ub.EnergyMomentum(0.3)),
    ],
    ids=str,
)
def test_complete_opening_takes_the_energy(place, scheme):
    """With the energy stated to round-off; by quadrature up to the kinks; the ledger closes."""
    rho = 0.01 if scheme.dynamic else 0.0
    for law, tolerance in ((LAWS["Petersson"], 1e-10), (LAWS["kinked"], 1e-3)):
        scene = turned(law, lambda t: 2.0 * t, place, rho=rho)
        run = ub.simulate(scene, scheme, t=(0, 1), dt=0.01)
        assert run.energy.worst < 1e-9
        assert run.energy.lost["hinges"][-1] == pytest.approx(G, rel=tolerance)
        assert response(run, place)[0][-1] == pytest.approx(0.0, abs=1e-9 * T)


SWING = ub.Table([0.0, 0.4, 0.7, 1.0], [0.0, 0.5, -0.3, 0.8])


def pulled(law):
    """A bar of fibres to and fro, with a moment."""
    fibres = ub.Fibres(ub.ElastoPlastic(np.inf), number=4, softening=law)
    section = ub.Section.rectangle(0.1, 0.1, E=1e6, nu=0.2, rho=1.0, fibres=fibres)
    beam = ub.Beam((0, 0), (1, 0), section, cells=2)
    motion = {"u": lambda t: 5e-3 * SWING(t), "psi": lambda t: 0.02 * SWING(t)}
    return clamped(beam, ub.PrescribedDisplacement(beam.end, **motion))


def to_and_fro(law, place):
    """The scene of a place, with crack laws in proportion to those of hinges."""
    if place == "fibres":
        return pulled(replace(law, **CRACK[type(law)]))
    return turned(law, SWING, place, rho=0.01)


CRACK = {
    Exponential: {"limit": 1e3, "energy": 2.0},
    Rising: {"t": 1e3, "width": 2e-3},
    ub.Softening: {"limit": 1e3, "fracture_energy": 2.0},
}


@pytest.mark.parametrize(
    ("place", "scheme"),
    [
        ("cell", ub.EnergyMomentum(0.1)),
        ("hinge", ub.Static()),
        ("connector", ub.GeneralizedAlpha(0.5)),
        ("spring", ub.EnergyMomentum()),
        ("fibres", ub.EnergyMomentumStatic()),
    ],
    ids=str,
)
def test_an_exponential_law_of_ones_own_is_softening(place, scheme):
    """To 1e-12 of motions and energies."""
    runs = []
    for law in (LAWS["exponential"], ub.Softening(T, G)):
        scene, newton = to_and_fro(law, place), ub.Newton(rtol=1e-13)
        runs.append(ub.simulate(scene, scheme, t=(0, 1), dt=0.02, newton=newton))
    one, other = runs
    assert np.abs(one.q - other.q).max() < 1e-12 * max(1.0, np.abs(one.q).max())
    lost, same = (run.energy.lost["hinges"] for run in runs)
    assert np.abs(lost - same).max() < 1e-12 * one.energy.energy_transferred


@pytest.mark.parametrize("place", [*PLACES, "fibres"])
def test_a_law_that_rises_to_and_fro(place):
    """The ledger closes, and a run that goes on is the whole one."""
    scheme, scene = ub.EnergyMomentum(), to_and_fro(LAWS["rising"], place)
    whole = ub.simulate(scene, scheme, t=(0, 1), dt=0.02)
    half = ub.simulate(scene, scheme, t=(0, 0.5), dt=0.02)
    rest = ub.simulate(scene, scheme, t=(0.5, 1), dt=0.02, start=half)
    assert whole.energy.lost["hinges"][-1] > 1e-2 * whole.energy.energy_transferred
    assert whole.energy.worst < 1e-9
    # The tolerance of Newton's method, 1e-9 of the forces
    assert np.abs(rest.q[-1] - whole.q[-1]).max() < 1e-7 * np.abs(whole.q).max()


@pytest.mark.parametrize("place", ["cell", "hinge"])
def test_modes_of_what_is_left(place):
    """A hinge that is open is a joint, with a law that ends and with one that fades."""
    found = []
    for law in (Petersson(T, G), Exponential(T, G), ub.LinearSoftening(T, G)):
        scene = turned(law, lambda t: 5.0 * t, place, rho=1.0)
        run = ub.simulate(scene, ub.Static(), t=(0, 1), dt=0.02)
        found.append(ub.modes(scene, 2, at=run).frequencies)
    assert found[0] == pytest.approx(found[2], rel=1e-6)
    assert found[1] == pytest.approx(found[2], rel=1e-6)


def test_a_spring_that_never_breaks():
    """[closed] A spring and a beam of the same stiffness bear half of what one would."""
    scene = turned(ub.Softening(np.inf, 1.0), lambda t: 0.1 * t, "spring")
    run = ub.simulate(scene, ub.Static(), t=(0, 1), dt=0.5)
    assert run.connector(scene.connectors[0]).force == pytest.approx([0.0, 25.0, 50.0], rel=1e-9)


def test_events_and_pictures():
    """Opening, and 99.9 % of an energy that quadrature has found."""
    law = LAWS["rising"]
    scene = turned(law, lambda t: 2.0 * t)
    events = ub.Events()
    run = ub.simulate(scene, ub.Static(), t=(0, 1), dt=0.01, record=events)
    assert [event.what for event in events.found] == ["opens", "is free"]
    _, _, dissipated = response(run, "cell")
    before = run.times < events.found[-1].time
    assert dissipated[before].max() < 0.999 * law.fracture_energy <= dissipated[~before].min()
    ub.plot(run, "hinge", scene.beams[0].start)
    ub.plot(scene)


def test_of_two_members_the_one_that_may_bear_more_keeps_its_hinge():
    """A law that rises beyond its limit may leave the weaker hinge to the other member."""

    def hinges(*laws):
        section = ub.Section(EA=1e6, GA=1e6, EI=EI)
        one = ub.Beam((0, 0), (1, 0), section, hinges={1.0: laws[0]})
        two = ub.Beam((1, 0), (1, 1), section, hinges={0.0: laws[1]})
        return len(rigid_chain([one, two], supports=[ub.Clamped(one.start)]).hinges)

    strong = ub.Softening(1.2 * T, G)
    assert hinges(Petersson(T, G), strong) == 1
    assert hinges(Rising(T, 0.2), strong) == 2


def test_jumps_where_the_traction_falls_most():
    """[closed] The steepest fall of the traction is twice EI over the length of the cell."""
    law = Rising(T, 2 * np.exp(-1.5) * T / EI)
    said = []
    for end in (0.11, 1.0):
        scene = turned(law, lambda t, end=end: end * t, rho=0.01)
        with warnings.catch_warnings(record=True) as found:
            warnings.simplefilter("always")
            run = ub.simulate(scene, ub.EnergyMomentum(), t=(0, 1), dt=0.01)
        assert run.energy.lost["hinges"][-1] > 0
        said.append([str(one.message) for one in found])
    assert not any("opened suddenly" in one for one in said[0])
    assert any("its resistance falls 2 times as fast" in one for one in said[1])


# -- refusals ------------------------------------------------------------------------------------


@dataclass(frozen=True)
class Mine(ub.extend.SofteningLaw):
    t: float = 1.0

    def traction(self, opening):
        return self.t * f.exp(-opening)


@dataclass(frozen=True)
class Misspelt(Mine):
    def traction(self, opening):
        return self.tt * opening


@dataclass(frozen=True)
class OfNumPy(Mine):
    def traction(self, opening):
        return self.t * np.exp(-opening)


Thawed = dataclass(type("Thawed", (ub.extend.SofteningLaw,), {"traction": Mine.traction}))
"""A dataclass that is not frozen."""


def of_traction(traction):
    """A law with this function of the opening."""
    return law_like(traction=lambda self, opening: traction(opening))


def law_like(**members):
    """The law above with other members; numbers are fields."""
    fields = {name: float for name, x in members.items() if isinstance(x, float)}
    kind = type("Other", (Mine,), {"__annotations__": fields, **members})
    return dataclass(frozen=True)(kind)()


def line_of(kind, words):
    """Line of this file in which a class says something."""
    lines, first = inspect.getsourcelines(kind)
    return first + next(i for i, line in enumerate(lines) if words in line)


REFUSED = {
    "zero": (
        of_traction(lambda x: x * f.exp(-x)),
        "traction at zero opening, which is the limit, is 0; it must be positive",
    ),
    "below zero": (
        of_traction(lambda x: (1 - 2 * x) * f.exp(-x)),
        r"traction is -\S+ at the opening \S+, where it would drive",
    ),
    "lasting": (
        of_traction(lambda x: 1 / (1 + x)),
        "energy is not finite; let it fall to zero, or faster than 1/opening",
    ),
    "jumping": (
        of_traction(lambda x: f.where(f.below(x, 1.0), 1.0, 0.0) + 0.0 * x),
        "traction jumps from 1 to 0 at the opening 1",
    ),
    "vertical": (of_traction(lambda x: f.exp(-f.sqrt(x))), "infinite slope at zero opening"),
    "no number": (of_traction(f.log), "traction is -inf at the opening 0"),
    "one number": (of_traction(lambda x: np.ones(3)), "one number for each|broadcast"),
    "wrong energy": (
        law_like(energy_to=lambda self, opening: f.exp(-opening)),
        "energy_to is 1 at the opening 0, but the integral of the traction is 0",
    ),
    "wrong limit": (law_like(limit=2.0), "limit = 2, but the traction at zero opening is 1"),
    "wrong total": (
        law_like(fracture_energy=2.0),
        "fracture_energy = 2, but the integral of the traction is 1",
    ),
    "taken": (law_like(bounded=1.0), "field cannot have the name bounded"),
    "misspelt": (
        Misspelt(),
        rf"Misspelt.*no attribute 'tt' \({__file__}, line {line_of(Misspelt, 'self.tt')}\)",
    ),
    "thawed": (Thawed(), "Thawed.* must be a dataclass: @dataclass"),
    "distribution": (
        Mine(ub.distributions.Normal(1.0, 0.1, seed=1)),
        r"Mine.*t = Normal\(.*\) is a distribution",
    ),
    "text": (Mine("1"), "t = '1' is no number"),
    "number": (5.0, "= 5.0 is not a Softening or .*LinearSoftening or SofteningLaw"),
}


@pytest.mark.parametrize("name", REFUSED)
def test_laws_that_cannot_soften_are_refused(name):
    """Where they are given, with the name of the law and what to do."""
    law, words = REFUSED[name]
    whole = {"EA": 1.0, "GA": 1.0, "EI": 1.0}
    for make in (
        lambda: ub.Section(**whole, hinge=law),
        lambda: ub.Beam((0, 0), (1, 0), ub.Section(**whole), hinges={0.5: law}),
        lambda: ub.RigidPlastic(law),
        lambda: ub.Spring(1.0, softening=law),
        lambda: ub.Fibres(ub.ElastoPlastic(np.inf), number=2, softening=law),
    ):
        with pytest.raises(ub.ArgumentError, match=words) as error:
            make()
        assert isinstance(law, float) or type(law).__name__ in str(error.value)


@pytest.mark.parametrize("place", ["cell", "hinge"])
def test_a_law_that_ufl_cannot_trace_is_refused(place):
    """Before the first step, with the line of the law."""
    scene = turned(OfNumPy(100.0), lambda t: t, place)
    at = rf"OfNumPy: .* UFL: .*\({__file__}, line {line_of(OfNumPy, 'np.exp')}\)"
    with pytest.raises(ub.ArgumentError, match=at):
        ub.simulate(scene, ub.Static(), t=(0, 1), dt=0.5)
