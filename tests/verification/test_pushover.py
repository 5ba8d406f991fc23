# SPDX-License-Identifier: MIT
"""Pushover of a portal with a rigid girder: plastic theory and hand calculations of targets.

[closed] Elastic slope 24 EI/h³; limit load 4 M_p/h; with the weights P on both columns the
mechanism has (4 M_p - 2 P h sin θ) / (h cos θ), sin θ = sway/h.  The columns have no shear and
axial strain; cells of degree 3 are exact for them.
"""

import math
from dataclasses import replace
from itertools import pairwise

import numpy as np
import pytest
from helpers import raises
from scenes import clamped
from scipy.integrate import trapezoid

import ufl_beam as ub
import ufl_beam.structures as st
from ufl_beam.structures.pushover import bilinear

EI, H, L, M_P, MASS, P = 2e7, 4.0, 6.0, 148e3, 10e3, 200e3  # N m², m, m, N m, kg, N
RIGID = 1e5  # stiffness of the girder over the stiffness of columns: an error of EI/RIGID
CUBIC = ub.Mesh(degree=3)
PLASTIC = ub.ElastoPlastic(M_P)


def portal(weight=0.0, law=PLASTIC, loads=(), rhoA=0.0):
    column = ub.Section(EA=1e12, GA=1e12, EI=EI, rhoA=rhoA)
    girder = ub.Section(EA=1e13, GA=1e13, EI=RIGID * EI, rhoA=0.0)
    hinges = {} if law is None else {0.0: law, 1.0: law}
    left = ub.Beam((0, 0), (0, H), column, cells=1, hinges=hinges, name="left")
    right = ub.Beam((L, 0), (L, H), column, cells=1, hinges=hinges, name="right")
    top = ub.Beam((0, H), (L, H), girder, cells=1, name="top")
    corners = left.end, right.end
    weights = [ub.PointLoad(corner, (0, -weight)) for corner in corners if weight]
    return ub.Scene(
        [left, right, top],
        joints=[ub.Rigid(left.end, top.start), ub.Rigid(right.end, top.end)],
        supports=[ub.Clamped(left.start), ub.Clamped(right.start)],
        masses=[ub.PointMass(corner, MASS) for corner in corners],
        loads=[*weights, *loads],
    )


def pushed(scene, target=0.1, steps=25, **options):
    place = scene["left"].end
    return st.pushover(scene, place, target, steps=steps, mesh=CUBIC, **options)


@pytest.fixture(scope="module")
def plain():
    return pushed(portal())


def of_mechanism(sway, weight):
    θ = np.arcsin(sway / H)
    return (4 * M_P - 2 * weight * H * np.sin(θ)) / (H * np.cos(θ))


@pytest.mark.parametrize(
    ("weight", "pattern", "sign"),
    [(0.0, "mode", 1), (P, "mode", -1), (P, "uniform", 1), (0.0, "triangular", 1)],
)
def test_slope_and_limit_load_are_those_of_plastic_theory(weight, pattern, sign):
    """Stiffness within EI/RIGID of the girder; the geometric stiffness is 6/5 P/h a column.

    The next order is 1/700 (P h²/EI)² EI/h³, 1e-5 of the slope.  The columns of the mechanism
    rotate by M_p h/(6 EI) = 5e-3 more than their chords and so shorten by 1e-5.
    """
    curve = pushed(portal(weight), sign * 0.1, pattern=pattern)
    slope = 24 * EI / H**3 - 2 * 1.2 * weight / H
    assert curve.stiffness == pytest.approx(slope, rel=3e-5 + 1e-4)
    assert np.allclose(curve.base_shear[1] / curve.displacement[1], slope, rtol=2e-4)
    beyond = np.abs(curve.displacement) > 1.2 * M_P * H**2 / (6 * EI)
    limit = of_mechanism(np.abs(curve.displacement), weight)
    assert np.allclose(sign * curve.base_shear[beyond], limit[beyond], rtol=1e-3)
    assert {hinge.what for hinge in curve.hinges} == {"yields"}
    assert len(curve.hinges) == 4
    assert not curve.failure


@pytest.mark.parametrize(
    ("law", "weight", "target", "steps"),
    [(PLASTIC, 0.0, 0.1, 25), (ub.LinearSoftening(M_P, 3e4), P, -0.1, 7)],
)
def test_the_curve_ends_at_the_target(law, weight, target, steps):
    """Limit points and openings within the path shift the steps; round-off is left."""
    curve = pushed(portal(weight, law), target, steps)
    assert curve.displacement[-1] == pytest.approx(target, rel=1e-12)
    moved = np.diff(curve.path.displacement(curve.place)[[0, -1], 0])
    assert moved == pytest.approx(target, rel=1e-12)
    assert np.abs(np.diff(curve.displacement)).max() <= (1 + 1e-9) * abs(target) / steps
    assert not curve.failure


def test_participation_of_a_cantilever_with_distributed_mass():
    """[closed] Triangular shape on a uniform column: m* = m h/2, Γ = (1/2)/(1/3) = 3/2."""
    section = ub.Section(EA=1e10, GA=1e10, EI=EI, rhoA=100.0)
    column = ub.Beam((0, 0), (0, H), section, cells=2, name="column")
    scene = clamped(column)
    curve = st.pushover(scene, column.end, 0.01, pattern="triangular", steps=2)
    assert curve.mass == pytest.approx(100 * H, rel=1e-12)
    assert curve.equivalent_mass == pytest.approx(50 * H, rel=1e-12)
    assert curve.gamma == pytest.approx(1.5, rel=1e-12)
    modal = st.pushover(scene, column.end, 0.01, steps=2, mesh=CUBIC)
    assert modal.gamma == pytest.approx(1.5660, rel=1e-3)  # of a cantilever; EA, GA are finite
    assert modal.period == pytest.approx(2 * math.pi / 3.5160 * math.sqrt(100 * H**4 / EI), 1e-2)


def test_loads_of_a_user_may_begin_between_vertices():
    """The base shear is the sum of reactions; the stiffness is the slope of the first step.

    Up to the drift 1e-4 of this step.
    """
    scene = portal(weight=P, rhoA=50.0)
    left = scene["left"]
    push = [
        ub.LineLoad(left, (1.0, 0), span=(0.1, 0.83)),
        ub.PointLoad(left.at(0.37), (2.0, 0), amplitude=lambda t: 3 * t),
    ]
    curve = pushed(scene, target=0.002, steps=5, pattern=push)
    reactions = sum(curve.path.reaction(support)[1:] for support in scene.supports)
    np.testing.assert_allclose(curve.base_shear[1:], -reactions[:, 0], rtol=1e-8)
    np.testing.assert_allclose(reactions[:, 1], 2 * P, rtol=1e-7)
    slope = curve.base_shear[1] / curve.displacement[1]
    assert curve.stiffness == pytest.approx(slope, rel=1e-4)


def design(T):
    """Spectrum with a plateau of 10 m/s² up to 0.5 s."""
    return 10 * min(1.0, 0.5 / T)


def test_n2_by_hand(plain):
    """EN 1998-1 annex B with Γ = 1, m* = 2 m, T* of the bilinear curve, below and above T_C."""
    d, V = plain.displacement, plain.base_shear
    end = np.argmax(V)
    strength = V[end]
    dy = 2 * (d[end] - trapezoid(V[: end + 1], d[: end + 1]) / strength)
    T = 2 * math.pi * math.sqrt(2 * MASS * dy / strength)
    q = 2 * MASS * 10 / strength
    det = 10 * (T / (2 * math.pi)) ** 2
    found = plain.n2(design, 0.5)
    assert found.period == pytest.approx(T, rel=1e-5)  # Γ and m* are 1e-6 off
    assert found.strength_ratio == pytest.approx(q, rel=1e-5)
    assert found.displacement == pytest.approx(det / q * (1 + (q - 1) * 0.5 / T), rel=1e-5)
    assert plain.displacement[found.n] >= found.displacement > plain.displacement[found.n - 1]
    # the idealised curve of an elastic and perfectly plastic one is itself, up to the step
    assert dy == pytest.approx(M_P * H**2 / (6 * EI), rel=0.02)
    long = plain.n2(design, 0.2)  # T* above T_C: equal displacements
    assert long.displacement == pytest.approx(det, rel=1e-5)
    weak = plain.n2((np.array([0.0, 4.0]), np.array([1.0, 1.0])), 0.5)  # stays elastic
    assert weak.displacement == pytest.approx(det / 10, rel=1e-5)
    assert weak.strength_ratio < 1


def test_asce_41_by_hand(plain):
    """Equation 7-28 with T = 0.324 s; the step at the kink of the curve has 1 % of the energy."""
    T = 2 * math.pi * math.sqrt(2 * MASS / (24 * EI / H**3))
    μ = 2 * MASS * 10 / (4 * M_P / H)  # C_m = 1 for one degree of freedom
    c1, c2 = 1 + (μ - 1) / (60 * T**2), 1 + ((μ - 1) / T) ** 2 / 800
    found = plain.asce41(design)
    assert found.displacement == pytest.approx(c1 * c2 * 10 * T**2 / (4 * math.pi**2), rel=0.01)
    assert found.factors["C0"] == pytest.approx(1.0, rel=1e-5)
    assert found.factors["C1"] == pytest.approx(c1, rel=0.01)
    stiff = plain.asce41(design, site="A")
    assert stiff.factors["C1"] == pytest.approx(1 + (μ - 1) / (130 * T**2), rel=0.01)
    weak = plain.asce41(lambda T: 1.0)
    assert weak.factors["C1"] == pytest.approx(1.0, abs=1e-6)  # to the last iteration
    assert weak.displacement == pytest.approx(T**2 / (4 * math.pi**2), rel=3e-4)


def test_two_lines_have_the_energy_of_the_curve():
    d = np.linspace(0, 0.1, 400)
    V = 1e5 * np.tanh(d / 0.02)
    strength, stiffness = bilinear(d, V, 0.1)
    yields, last = strength / stiffness, V[-1]
    energy = strength * yields / 2 + (strength + last) / 2 * (0.1 - yields)
    assert energy == pytest.approx(trapezoid(V, d), rel=1e-9)  # tolerance of the root finder
    assert np.interp(0.6 * yields, d, V) == pytest.approx(0.6 * strength, rel=1e-9)
    # The first line of a curve that dips crosses it where it rises first.
    d = np.linspace(0.0, 4.0, 401)
    V = np.interp(d, [0.0, 1.0, 1.9, 2.1, 2.2, 4.0], [0.0, 1.0, 0.1, 0.1, 0.9, 1.05])
    strength, stiffness = bilinear(d, V, 4.0)
    assert 0.6 * strength < 1.0
    assert stiffness == pytest.approx(1.0)


# -- what cannot be done is said ---------------------------------------------------------------


def test_a_target_beyond_the_reach_is_reported_with_the_hinge():
    """A brittle hinge: fracture energy below the elastic energy, so the sway snaps back."""
    section = ub.Section(EA=1e10, GA=1e10, EI=EI)
    brittle = ub.LinearSoftening(limit=M_P, fracture_energy=1e2)
    column = ub.Beam((0, 0), (0, H), section, cells=4, hinges={0.0: brittle}, name="column")
    scene = clamped(column, masses=[ub.PointMass(column.end, MASS)])
    with pytest.warns(ub.ModelWarning, match=r"ends at u = .* of 0.3 m.*column.start \(0, 0\)"):
        curve = st.pushover(scene, column.end, 0.3)
    # M_p h²/(3 EI) is the sway at the limit of the hinge; cells of h/4: (1/4)²/4 of it stiffer
    assert curve.displacement[-1] == pytest.approx(M_P * H**2 / (3 * EI), rel=0.02)
    assert "snap" not in str(curve.hinges)
    with pytest.warns(ub.ModelWarning, match="beyond the end of the capacity curve"):
        curve.n2(lambda T: 100.0, 0.5)


@pytest.mark.parametrize(
    ("options", "words"),
    [
        ({"place": "start"}, "does not move u of left.start"),
        ({"pattern": [ub.Gravity()]}, "no sum along u"),
        ({"pattern": "triangular", "place": "start"}, "does not move u of left.start"),
    ],
)
def test_a_pattern_that_does_not_push_the_place_is_refused(options, words):
    scene = portal()
    place = getattr(scene["left"], options.pop("place", "end"))
    with pytest.raises(ub.ArgumentError, match=words):
        st.pushover(scene, place, 0.1, **options)


def test_masses_and_periods_are_required(plain):
    massless = replace(portal(), masses=[])
    with raises("nothing that moves has mass"):
        pushed(massless)
    push = [ub.PointLoad(massless["left"].end, (1.0, 0))]
    curve = pushed(massless, pattern=push, steps=5)
    with raises("the scene has no mass"):
        curve.asce41(design)
    with raises("covers periods from 1 to 2 s, but not 0.32"):
        plain.n2(([1.0, 2.0], [3.0, 2.0]), 0.5)
    with raises("beyond the end of the curve"):
        plain.n2(design, 0.5, upto=1.0)
    with raises("site"):
        plain.asce41(design, site="X")


@pytest.mark.filterwarnings("ignore:.*just touches")
def test_a_tie_is_closed_before_the_push():
    """[closed] A pinned post with a tie at 45°, which bears √2 times the shear."""
    post = ub.Beam((0, 0), (0, 3), ub.Section(EA=1e12, GA=1e12, EI=EI), cells=1)
    tie = ub.Stretch(ub.ground(-3, 0), post.end, ub.Stop(1e7, high=0.0))
    scene = ub.Scene(
        [post],
        connectors=[tie],
        supports=[ub.Pinned(post.start)],
        masses=[ub.PointMass(post.end, MASS)],
    )
    with raises("nothing resists the mode with the largest effective mass; give supports, or a"):
        st.pushover(scene, post.end, 1e-3)
    closed = replace(scene, loads=[ub.PointLoad(post.end, (1.0, 0.0))])
    curve = st.pushover(closed, post.end, 1e-5, steps=2)
    assert curve.stiffness == pytest.approx(1e7 / 2, rel=1e-4)
    assert curve.period == pytest.approx(2 * math.pi * math.sqrt(MASS / (1e7 / 2)), rel=1e-4)


def test_a_structure_that_its_loads_break_is_refused():
    """A push of 200 kN is beyond the limit load of 4 M_p/h, and the weights P make it unstable."""
    scene = portal(P)
    push = ub.PointLoad(scene["left"].end, (200e3, 0))
    scene = replace(scene, loads=[*scene.loads, push])
    with pytest.raises(ub.ConvergenceError, match=r"pushover: no equilibrium beyond 0\.\d+ times"):
        pushed(scene)


def test_viscosity_has_no_effect():
    """On the state under a horizontal load, the elastic mode, its period, and the curve."""
    scene = portal()
    load = ub.PointLoad(scene["left"].end, (20e3, -P))
    plain = replace(scene, loads=[load])
    brace = ub.Stretch(scene["left"].start, scene["right"].end, ub.Damper(1e7))
    damping = [ub.KelvinVoigt(retardation_time=5.0), ub.Rayleigh(mass=0.5)]
    expected, found = pushed(plain), pushed(replace(plain, connectors=[brace], damping=damping))
    assert found.period == pytest.approx(expected.period, rel=1e-9)
    assert np.allclose(found.base_shear, expected.base_shear, rtol=1e-7, atol=1e-3)
    places = found.path.displacement(scene["left"].end), expected.path.displacement(load.place)
    assert np.allclose(*places, rtol=1e-8, atol=1e-12)


def test_a_moving_load_stays_where_it_is_at_one_second():
    """In front of the right column, during the whole curve."""
    scene, places = portal(), (lambda t: 4.5 * t, lambda t: 4.5)
    loads = [ub.MovingLoad(scene["top"], place, force=(0, -P)) for place in places]
    moves, stays = (pushed(replace(scene, loads=[load])) for load in loads)
    assert np.array_equal(moves.base_shear, stays.base_shear)
    right = moves.path.reaction(scene.supports[1])[0, 1]
    assert right == pytest.approx(0.75 * P, rel=0.05)


@pytest.mark.parametrize("start", [0.7, 50.0])
def test_a_force_that_begins_later_is_refused(start):
    scene = portal()
    law = ub.PrescribedForce(lambda t: 20e3 * (t > start))
    late = ub.Slide(ub.ground(0, H), scene["left"].end, law, axis=(1, 0))
    with pytest.raises(ub.ArgumentError, match="depends on time"):
        pushed(replace(scene, connectors=[late]))


def test_n2_refuses_a_curve_that_has_fallen_too_far():
    """The idealised curve would be stiffer than the structure, then have no period at all."""
    soft = ub.LinearSoftening(limit=M_P, fracture_energy=M_P / 10)
    curve = pushed(portal(law=soft), 0.6, steps=60)
    peak = abs(curve.displacement[np.argmax(curve.base_shear)])
    assert curve.n2(lambda T: 6.0, 0.5, upto=peak).displacement > 0
    for upto in (0.5, 0.59):
        with pytest.raises(ub.ArgumentError, match=f"give upto at most {peak:.4g} m"):
            curve.n2(lambda T: 6.0, 0.5, upto=upto)


def test_springs_that_yield_or_break_are_in_the_sequence_of_hinges():
    """The sequence and the table of hinges have the same connectors and states."""
    laws = [
        ub.Spring(5e7, law=ub.ElastoPlastic(M_P, isotropic=1e6)),
        st.IbarraKrawinkler(5e7, st.Backbone(1.2 * M_P, capping=0.03)),
        ub.Spring(5e7, softening=ub.Softening(1.4 * M_P, 1e5)),
    ]
    column = ub.Section(EA=1e12, GA=1e12, EI=EI, rhoA=0.0)
    beams = [ub.Beam((x, 0), (x, H), column, cells=1) for x in (0.0, L, 2 * L)]
    starts = [beam.start for beam in beams]
    feet = [ub.Turn(ub.ground(*x.point), x, law) for x, law in zip(starts, laws, strict=True)]
    tops = [ub.Link(one.end, other.end) for one, other in pairwise(beams)]
    scene = ub.Scene(
        beams, joints=tops, supports=[ub.Pinned(x) for x in starts], connectors=feet,
        masses=[ub.PointMass(beam.end, MASS) for beam in beams],
    )  # fmt: skip
    result = st.pushover(scene, beams[0].end, 0.1, pattern="uniform", mesh=CUBIC)
    assert [hinge.what for hinge in result.hinges] == ["yields", "yields", "opens"]
    first = {hinge.where: hinge.n for hinge in reversed(result.hinges)}
    assert first == {row.where: row.n for row in st.hinge_table(result.path).rows}
    assert list(first) == feet[::-1]


def curve_of_oscillator(period, strength=2e3, mass=1e4, gamma=1.0, moving=1e4):
    """Capacity curve of an elastic and perfectly plastic oscillator; N, kg."""
    stiffness = mass * (2 * math.pi / period) ** 2
    d = np.array([0.0, strength / stiffness, 0.1])
    V = np.array([0.0, strength, strength])
    return st.Pushover(None, None, "u", 0.1, d, V, (), stiffness, moving, mass, gamma, period)


def test_bounds_of_the_codes():
    """[pub] EN 1998-1:2004, B.5; ASCE/SEI 41-17, 7.4.3.3.2 and table 7-4.

    By N2 the oscillator moves by three elastic displacements at most.  C1 of a period below 0.2 s
    is that of 0.2 s, and all mass counts above a period of 1 s.
    """
    found = curve_of_oscillator(0.1, gamma=1.3, moving=2e4).n2(lambda T: 5.0, corner=2.0)
    elastic = 5.0 * (0.1 / (2 * math.pi)) ** 2
    assert found.displacement == pytest.approx(3 * 1.3 * elastic, rel=1e-3)
    found = curve_of_oscillator(0.1).asce41(lambda T: 0.5, site="D")
    assert found.period < 0.2
    assert found.strength_ratio > 1
    assert found.factors["C1"] == pytest.approx(1 + (found.strength_ratio - 1) / (60 * 0.2**2))
    curve = curve_of_oscillator(1.2, gamma=1.3, moving=2e4)
    assert curve.asce41(lambda T: 0.3).factors["Cm"] == 1.0


def test_a_mass_at_a_support_does_not_count():
    section = ub.Section(EA=4e8, GA=1e8, EI=1.4e6)
    column = ub.Beam((0, 0), (0, 3), section)
    masses = [ub.PointMass(column.end, 5e3), ub.PointMass(column.start, 2e3)]
    scene = clamped(column, masses=masses)
    curve = st.pushover(scene, column.end, 0.01, steps=2)
    assert curve.mass == pytest.approx(5e3)
    assert curve.gamma == pytest.approx(1.0)
