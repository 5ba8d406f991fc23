# SPDX-License-Identifier: MIT
"""Laws by residuals whose equations have several solutions: no step takes one that gives energy."""

import numpy as np
import pytest
from helpers import in_turn
from scenes import clamped
from uniaxial_points import Bars
from user_laws import Dashpot, GivesEnergy, PowerLaw, SameHardening, Swelling, TwoRoots

import ufl_beam as ub
import ufl_beam.structures as st
from ufl_beam.blocks.material_points import Points
from ufl_beam.compiled.c_library import lib
from ufl_beam.model.fibres import SectionPoints

EA, EI, NP, MP = 2e3, 1.0, 4.0, 0.4


def section(**more):
    return ub.Section(EA=EA, GA=8e2, EI=EI, rhoA=1.0, rhoI=5e-4, **more)


def shaken(law):
    """A cantilever, thrown up to many times its elastic range."""
    beam = ub.Beam((0, 0), (1, 0), section(interaction=law), cells=2)
    load = ub.PointLoad(beam.end, (3.0, 3.0), amplitude=lambda t: np.sin(9 * t))
    return clamped(beam, loads=[load])


@pytest.mark.parametrize(
    ("law", "scheme", "dt"),
    [
        (st.AxialBending(NP, MP), ub.EnergyMomentum(), 0.02),
        (TwoRoots(NP, MP), ub.EnergyMomentumDecaying(), 0.02),
        (TwoRoots(NP, MP), ub.GeneralizedAlpha(), 0.0125),
    ],
    ids=repr,
)
def test_dissipation_never_falls(law, scheme, dt, as_by_reference):
    """And is that of a solver whose return map begins with the state before the step."""
    run = ub.simulate(shaken(law), scheme, t=(0, 0.6), dt=dt)
    as_by_reference(run, 1e-6)  # tolerances of two solvers
    plastic = run.energy["plastic"]
    assert np.diff(plastic).min() >= -1e-12 * plastic[-1]  # round-off of the sums
    assert plastic[-1] > 0.5


LAWS = {
    "RambergOsgood": st.RambergOsgood(3.0, 0.01, 5.0),
    "sharp": st.RambergOsgood(3.0, 0.002, 15.0),
    "ArmstrongFrederick": st.ArmstrongFrederick(3.0, 100.0, 300.0),
    "BoucWen": st.BoucWen(3.0, 0.05, 2.0, 0.5, 0.01),
    "ElastoPlastic": ub.ElastoPlastic(3.0, 20.0, 10.0),
    "Perzyna": ub.ElastoPlastic(3.0, 20.0, viscosity=ub.Perzyna(0.5)),
    "power law": PowerLaw(3.0, 0.01, 5.0),
    "by residuals": SameHardening(2.0, 20.0, 10.0, 0.5),
    "dashpot": Dashpot(20.0),
    "axial force and moment": st.AxialBending(NP, MP),
    "two roots": TwoRoots(NP, MP),
}


def points_of(law, n, scheme):
    """Points of a law in n cells, and the strain at which they yield."""
    if not law.resultants:
        return Bars(n, law, None, scheme).points, np.array([0.015, 0.0, 0.0])
    section_points = section(interaction=law).section_points(None)[0]
    assert isinstance(section_points, SectionPoints)
    points = Points(section_points, [(0, k) for k in range(n)], np.full(n, 0.5), scheme)
    return points, np.array([NP / EA, 0.01, MP / EI])


STATICS = ub.EnergyMomentumStatic(0.5), ub.Static()


@pytest.mark.parametrize(("law", "scheme"), in_turn(LAWS, STATICS, 1), ids=str)
@pytest.mark.parametrize("size", [0.5, 50.0])
def test_iterates_far_apart(law, scheme, size):
    """Random iterates up to many elastic ranges apart: the last one answers as in the first."""
    n, random = 300, np.random.default_rng(0)
    both = [points_of(LAWS[law], n, scheme) for _ in range(2)]
    (points, scale), (asked_once, _) = both
    strain, stiffness = np.zeros((n, 3)), 200.0 if not LAWS[law].resultants else EA
    for _ in range(6):
        for one, _ in both:
            one.start(strain)
            one.begin(0.1)
        far = size * 10 ** random.uniform(-2, 0, (3, n, 1))
        for new in strain + random.uniform(-1, 1, (3, n, 3)) * scale * far:
            r, _ = points.return_map(new)
        asked_once.return_map(new)
        assert np.isfinite(r).all()
        largest = stiffness * np.abs(new).max()
        assert np.abs(r - asked_once.r).max() < 1e-11 * largest  # of strains that cancel
        for one, _ in both:
            before = one.recorded[:, 4].copy()
            assert lib.gives_energy(one.c) == -1
            one.accept()
            # J, of round-off in the energies of the strains
            assert (one.recorded[:, 4] - before).min() >= -1e-14 * largest * np.abs(new).max()
        strain = new


def held(law):
    """A bar that is pulled by its end, of a law for its axial force."""
    beam = ub.Beam((0, 0), (1, 0), section(axial=law), cells=2, name="bar")
    pull = ub.PrescribedDisplacement(beam.end, u=lambda t: 0.01 * t)
    return clamped(beam, pull)


def sprung(law):
    """A stiff beam on a spring of the law."""
    beam = ub.Beam((0, 0), (1, 0), section(), cells=2)
    spring = ub.Stretch(ub.ground(-1, 0), beam.start, ub.Spring(EA, law=law))
    pull = ub.PrescribedDisplacement(beam.end, u=lambda t: 0.01 * t, v=0.0, psi=0.0)
    return ub.Scene([beam], supports=[pull], connectors=[spring])


def controlled(law):
    """The bar with a controller, so that its steps are in Python."""
    scene = held(law)
    (beam,) = scene.beams
    push = ub.Slide(ub.ground(0.5, 0), beam.at(0.5), ub.Controller(lambda now: 0.0), axis=(0, 1))
    return ub.Scene([beam], supports=scene.supports, connectors=[push])


BAR = r"bar at \(0\.\d+, 0\)"


@pytest.mark.parametrize("scheme", [ub.Static(), ub.GeneralizedAlpha()], ids=repr)
@pytest.mark.parametrize(
    ("make", "place"), [(held, BAR), (controlled, BAR), (sprung, r"Stretch\(.*\)")]
)
def test_no_step_is_accepted_that_gives_energy(make, place, scheme):
    """The run ends with the names of law and place; what was accepted has dissipated nothing."""
    scene = make(GivesEnergy(2.0))  # N, at a stretch of 1e-3
    with pytest.raises(ub.ConvergenceError, match=f"GivesEnergy of {place} has a neg") as found:
        ub.simulate(scene, scheme, t=(0, 1), dt=0.04)
    run = found.value.solution
    assert 0.04 < run.times[-1] < 0.5
    assert run.energy["plastic"].min() >= -1e-12 * run.energy.energy_transferred  # round-off


def test_an_active_law_may_give_energy():
    """[closed] A held bar that shrinks by e has the force EA e, and has given EA e²/2."""
    beam = ub.Beam((0, 0), (1, 0), section(axial=Swelling(1e-3)), cells=2)
    scene = clamped(beam, ub.Clamped(beam.end))
    run = ub.simulate(scene, ub.EnergyMomentumStatic(0.5), t=(0, 1), dt=0.25)
    middle = 1 - 0.25 / 2  # of the last step, in which section forces act
    assert run.section_forces_at(beam.start)[-1, 0] == pytest.approx(EA * 1e-3 * middle, rel=1e-9)
    assert run.energy["plastic"][-1] == pytest.approx(-EA * 1e-6 / 2, rel=1e-9)
