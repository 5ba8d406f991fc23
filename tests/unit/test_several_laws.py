# SPDX-License-Identifier: MIT
"""Sections whose laws are of several classes; cores, and bars that displace concrete."""

import math

import numpy as np
import pytest
from dolfinx import fem
from helpers import raises
from scenes import clamped
from user_laws import SameHardening

import ufl_beam as ub
import ufl_beam.structures as st

YIELD, H, B, CRACK = 6e4, 2e6, 1e6, ub.Softening(9e4, 300.0)


class Again(ub.ElastoPlastic):
    """The same law in another class."""


def in_turn(law, softening=None):
    """ElastoPlastic, alone and in turn with the same law in another class."""
    one = ub.Fibres(ub.ElastoPlastic(YIELD, H, B), softening=softening)
    return [one] * 10, [one, ub.Fibres(law, softening=softening)] * 5


PAIRS = {
    "plastic": in_turn(Again(YIELD, H, B)),
    "cracks": in_turn(Again(YIELD, H, B), CRACK),
    "residuals": in_turn(SameHardening(YIELD, H, B, eta=0.0)),
}


def beam(each):
    section = ub.Section.of_fibres(
        np.linspace(-0.045, 0.045, 10), np.full(10, 1e-4), E=1.2e8, nu=0.3, rho=1e3, fibres=each
    )
    return ub.Beam((0, 0), (1, 0.2), section, cells=3)


def bent(each):
    """Moved at the tip to and fro."""
    member = beam(each)
    move = ub.Table([0, 0.5, 1], [0.0, 0.08, -0.04])
    return clamped(member, ub.PrescribedDisplacement(member.end, v=move))


def kicked(each):
    member = beam(each)
    blow = ub.Table([0, 0.05, 0.1], [0.0, 1.0, 0.0])
    return clamped(member, loads=[ub.PointLoad(member.end, force=(0, 60.0), amplitude=blow)])


def run(scene, scheme=None, t=(0, 1), dt=0.05, **more):
    return ub.simulate(scene, scheme or ub.Static(), t=t, dt=dt, **more)


def assert_same(found, expected, digits=1e-8):
    """Equal motions, states of cells and energies, to the tolerance 1e-10 of residuals."""
    a, b = ([s.q, *s.material_at(s.scene.beams[0].at(0.1))] for s in (expected, found))
    for value, other in zip(a, b, strict=True):
        assert np.abs(other - value).max() <= digits * max(np.abs(value).max(), 1e-6)
    assert sorted(found.energy) == sorted(expected.energy)
    for name in expected.energy:
        error = np.abs(found.energy[name] - expected.energy[name]).max()
        assert error <= digits * expected.energy.energy_transferred


# -- one law, stated in two classes --------------------------------------------------------------


@pytest.mark.parametrize(
    ("pair", "scheme"),
    [
        ("plastic", ub.Static()),
        ("residuals", ub.Static()),
        ("cracks", ub.EnergyMomentumStatic()),
        ("residuals", ub.EnergyMomentumStatic()),
        ("cracks", ub.EnergyMomentum(0.1)),
    ],
    ids=str,
)
def test_one_law_in_two_classes_is_one_law(pair, scheme):
    make, t, dt = (kicked, (0, 0.3), 0.01) if scheme.dynamic else (bent, (0, 1), 0.05)
    one, two = (run(make(each), scheme, t=t, dt=dt) for each in PAIRS[pair])
    assert two.energy["plastic"][-1] > 0
    assert_same(two, one)


def test_forms_in_dolfinx():
    """Internal forces and tangent of DOLFINx are those of one class."""
    found = []
    for each in PAIRS["plastic"]:
        simulation = ub.Simulation(bent(each), ub.Static())
        for t in (0.2, 0.4, 0.5, 0.55):  # fibres unload at the end
            simulation.step_to(t)
        forms = simulation.dolfinx.forms
        r = fem.assemble_vector(fem.form(forms.work)).array
        found.append((r, fem.assemble_matrix(fem.form(forms.tangent)).to_dense()))
    for one, two in zip(*found, strict=True):
        assert np.abs(two - one).max() <= 1e-7 * np.abs(one).max()


def test_cells_that_give_way_are_named():
    """They are found from the stiffness of the fibres of all classes."""
    member = beam([ub.Fibres(ub.ElastoPlastic(YIELD)), ub.Fibres(Again(YIELD))] * 5)
    pull = ub.PointLoad(member.end, force=(1e3, 200.0), amplitude=lambda t: t)
    with raises("at no further force", kind=ub.ConvergenceError):
        run(clamped(member, loads=[pull]))


# -- cores and bars --------------------------------------------------------------------------------

COVER, CORE, STEEL = (ub.Fibres(ub.ElastoPlastic(x), number=8) for x in (3e7, 4e7, 5e8))
CONCRETE = {"E": 30e9, "nu": 0.2, "rho": 2500.0}


def rectangle(**more):
    return ub.Section.rectangle(b=0.3, h=0.4, **CONCRETE, fibres=COVER, **more)


def test_areas_of_cores():
    """[closed] Areas of core and cover, sums of tens of areas; layers balance about mid-depth."""
    circle = ub.Section.circle(d=0.5, **CONCRETE, fibres=COVER, core=CORE, cover=0.04)
    for section, whole, inner in (
        (rectangle(core=CORE, cover=0.03), 0.3 * 0.4, 0.24 * 0.34),
        (circle, math.pi * 0.25**2, math.pi * 0.21**2),
    ):
        placed = section.fibres
        assert placed.fibres == (COVER, CORE)
        inside = placed.A[placed.material == 1].sum()
        assert (placed.A.sum(), inside) == pytest.approx((whole, inner), rel=1e-13)
        assert abs(placed.A @ placed.y) < 1e-15
        assert (placed.A > 0).all()


def test_bars_by_hand():
    """[closed] Transformed section: bars count with their E minus the E of displaced concrete."""
    y, A = np.array([-0.15, 0.15]), np.array([2e-3, 1e-3])
    section = rectangle(core=CORE, cover=0.03).reinforced(y, A, E=200e9, fibres=STEEL)
    placed, more = section.fibres, 170e9 * A
    EA = 30e9 * 0.12 + more.sum()
    axis = more @ y / EA
    assert (section.EA, placed.axis) == pytest.approx((EA, axis), rel=1e-13)
    assert placed.y[:2] == pytest.approx(y - axis, abs=1e-15)
    assert placed.A.sum() == pytest.approx(0.12, rel=1e-14)
    assert (placed.E * placed.A) @ placed.y == pytest.approx(0.0, abs=1e-7 * 1e-9 * EA)
    # Displaced concrete is spread over two layers of 5 cm: up to 2.5 cm from the bar
    EI = rectangle(core=CORE, cover=0.03).EI + more @ y**2 - EA * axis**2
    assert pytest.approx(EI, abs=30e9 * A.sum() * 0.025**2) == section.EI
    # The cover of both sides keeps its area
    assert placed.A[placed.material == 1].sum() == pytest.approx(0.12 - 0.24 * 0.34)
    same = rectangle()
    assert (section.GA, section.rhoA, section.rhoI) == (same.GA, same.rhoA, same.rhoI)
    # A bar with the area of three layers leaves no layer empty
    large = rectangle().reinforced([0.0], [0.045], E=200e9, fibres=STEEL).fibres
    assert (large.A > 0).all()
    assert (large.A.sum(), large.axis) == pytest.approx((0.12, 0.0), rel=1e-14, abs=1e-16)


def test_bars_are_added_again():
    """Bars of a second law displace concrete, never the first bars; y is measured as before."""
    once = rectangle().reinforced([-0.15], [2e-3], E=200e9, fibres=STEEL)
    strand = ub.Fibres(st.RambergOsgood(1.5e9, 0.002, 5.0))
    twice = once.reinforced([-0.15], [1e-3], E=195e9, fibres=strand)
    placed = twice.fibres
    assert placed.fibres == (strand, STEEL, COVER)
    areas = [placed.A[placed.material == k].sum() for k in range(3)]
    assert areas == pytest.approx([1e-3, 2e-3, 0.12 - 3e-3], rel=1e-13)
    assert placed.y[:2] + placed.axis == pytest.approx([-0.15, -0.15], rel=1e-13)


def test_what_cannot_be_reinforced_is_refused():
    bar = {"E": 200e9, "fibres": STEEL}
    with raises("a bar at y = -0.21 m lies outside the section, from -0.2 to 0.2 m"):
        rectangle().reinforced([-0.21], [1e-3], **bar)
    with raises("bars of A = 0.2 m² at y = 0 m displace more than the fibres"):
        rectangle().reinforced([0.0], [0.2], **bar)
    with raises("the section has no fibres; create it with fibres=Fibres(law)"):
        ub.Section.rectangle(0.3, 0.4, **CONCRETE).reinforced([0.0], [1e-3], **bar)
    with raises("cover = 0.15 m leaves no core"):
        rectangle(core=CORE, cover=0.15)
    with raises("cover without core"):
        rectangle(cover=0.03)
    with raises("core without fibres"):
        ub.Section.circle(0.4, **CONCRETE, core=CORE, cover=0.03)
    with raises("1 fibres for 2 areas; give one for each"):
        ub.Section.of_fibres([0, 1], [1, 1], E=1.0, nu=0.0, fibres=[STEEL])
    with raises("E must be positive"):
        ub.Section.of_fibres([0, 1], [1, 1], E=[1.0, 0.0], nu=0.0, fibres=STEEL)


def test_materials_of_fibres():
    """[closed] Sums, axis and mass of fibres with their own E, laws and densities."""
    y, A = np.array([0.0, 0.1, 0.4]), np.array([2e-3, 1e-3, 1e-3])
    E, rho = np.array([200e9, 30e9, 30e9]), np.array([7850.0, 2500.0, 2500.0])
    section = ub.Section.of_fibres(y, A, E=E, nu=0.25, rho=rho, fibres=[STEEL, COVER, COVER])
    axis = 30e9 * 5e-4 / (E @ A)
    placed = section.fibres
    assert (placed.axis, section.EA, section.rhoA) == pytest.approx((axis, E @ A, rho @ A))
    assert pytest.approx((E * A) @ (y - axis) ** 2) == section.EI
    assert section.rhoI == pytest.approx((rho * A) @ (y - axis) ** 2)
    assert pytest.approx(5 / 6 * (E @ A) / 2.5) == section.GA
    assert placed.fibres == (STEEL, COVER)
    assert placed.material.tolist() == [0, 1, 1]
