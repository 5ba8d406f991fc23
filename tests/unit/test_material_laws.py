# SPDX-License-Identifier: MIT
"""Laws of one point: flow in closed form, its limits, and tractions with their exact means."""

import math
from itertools import pairwise

import numpy as np
import pytest
from scipy.integrate import quad

import ufl_beam as ub
from ufl_beam.model.fibres import SectionPoints
from ufl_beam.model.material_law import State

C, LIMIT, H, B, ETA = 200.0, 3.0, 20.0, 10.0, 0.5
"""Numbers of a test material: yields at a strain of 0.015."""

STEP = 1e-30


def bulk(C=C, limit=LIMIT, H=H, B=B, eta=ETA):
    numbers = {"yield_limit": limit, "isotropic": H, "kinematic": B, "viscosity": eta}
    return ub.ElastoPlastic(1.0).with_parameters(*arrays(C, numbers))


def arrays(C, numbers):
    return np.array([float(C)]), {name: np.array([float(x)]) for name, x in numbers.items()}


def state(p=0.0, ξ=0.0):
    return State({"plastic": np.array([p]), "accumulated": np.array([ξ])})


def flow(law, strain, p=0.0, ξ=0.0, θ=1.0, dt=0.1):
    """Plastic strain of a step, of which the law states the part up to t_n+θ."""
    changes = law.increments(np.array([strain]), state(p, ξ), θ * dt)
    assert abs(changes["plastic"]) == changes["accumulated"] or np.iscomplexobj(strain)
    return (changes["plastic"] / θ)[0]


# -- bulk --------------------------------------------------------------------------------------


@pytest.mark.parametrize("θ", [0.5, 0.75, 1.0])
@pytest.mark.parametrize(("p", "ξ"), [(0.0, 0.0), (0.004, 0.02), (-0.01, 0.03)])
@pytest.mark.parametrize("strain", [-0.3, -0.01, 0.0, 0.01, 0.2])
def test_flow_fulfils_the_law_at_theta(strain, p, ξ, θ):
    """|σ - B p| = limit + H ξ + η γ/Δt where it flows, at t_n+θ; else below the limit."""
    law, dt = bulk(), 0.1
    dp = flow(law, strain, p, ξ, θ, dt)
    p_θ, ξ_θ = p + θ * dp, ξ + θ * abs(dp)
    relative = C * (strain - p_θ) - B * p_θ
    if dp == 0:
        assert abs(relative) <= LIMIT + H * ξ
    else:
        assert np.sign(dp) == np.sign(relative)
        # Round-off of stresses that are sums of some 60
        assert abs(relative) == pytest.approx(LIMIT + H * ξ_θ + ETA * abs(dp) / dt, rel=1e-13)


def test_monotonic_loading_follows_the_bilinear_law():
    """[closed] Bilinear law: slope C (H + B)/(C + H + B) beyond the limit, in any steps."""
    law, tangent = bulk(eta=0), C * (H + B) / (C + H + B)
    p = ξ = 0.0
    for strain in np.linspace(0, 0.1, 8):
        dp = flow(law, strain, p, ξ)
        p, ξ = p + dp, ξ + abs(dp)
        σ = float(law.stress(np.array([strain]), state(p))[0])
        yielding = strain - LIMIT / C
        expected = LIMIT + tangent * yielding if yielding > 0 else C * strain
        assert σ == pytest.approx(expected, rel=1e-14)


def test_kinematic_hardening_moves_the_limits():
    """[closed] After a plastic strain p the other limit lies 2 limit away, at B p - limit."""
    law, p = bulk(H=0, eta=0), 0.05
    for σ, flows in ((B * p - LIMIT * (1 - 1e-9), False), (B * p - LIMIT * (1 + 1e-9), True)):
        assert (flow(law, p + σ / C, p, p) != 0) == flows


def test_isotropic_hardening_widens_the_limits():
    """[closed] The other limit lies at -(limit + H ξ)."""
    law, p, ξ = bulk(B=0, eta=0), 0.05, 0.08
    other = -(LIMIT + H * ξ)
    for σ, flows in ((other * (1 - 1e-9), False), (other * (1 + 1e-9), True)):
        assert (flow(law, p + σ / C, p, ξ) != 0) == flows


@pytest.mark.parametrize("θ", [0.5, 1.0])
def test_no_viscosity_is_rate_independent(θ):
    law = bulk(eta=0)
    assert flow(law, 0.1, θ=θ, dt=1e-9) == flow(law, 0.1, θ=θ, dt=1e9) > 0


def test_without_viscosity_a_law_is_rate_independent():
    """η → 0 in proportion to η/Δt: 1e-12 of 230 here."""
    assert flow(bulk(eta=1e-13), 0.1) == pytest.approx(flow(bulk(eta=0), 0.1), rel=1e-14)


@pytest.mark.parametrize("field", ["limit", "eta"])
def test_infinity_is_elastic(field):
    """Without a warning, with complex strains, and without energies that are no numbers."""
    law = bulk(**{field: math.inf})
    changes = law.increments(np.array([5.0 + 1j * STEP]), state(), 0.1)
    dp = changes["plastic"]
    assert dp[0] == 0
    assert law.stress(np.array([5.0]), State(changes)).real[0] == 5 * C
    real = State({name: z.real for name, z in changes.items()})
    assert law.dissipation(5.0, state(), real, 0.1)[0] == 0


def test_no_limit_flows_at_once():
    """[closed] limit = 0, no hardening: nothing is borne."""
    law = bulk(limit=0, H=0, B=0, eta=0)
    assert flow(law, 0.01) == pytest.approx(0.01, rel=1e-15)
    assert flow(law, -0.01) == pytest.approx(-0.01, rel=1e-15)
    assert flow(law, 0.0) == 0


def test_overstress_relaxes_exponentially():
    """[closed] At constant strain the overstress decays as exp(-t/τ), second order at θ = 1/2."""
    τ, strain = 0.3, 0.1
    eta = ub.DuvautLions(τ).coefficient(np.array([C + H + B]))[0]
    law, errors = bulk(eta=eta), []
    γ = flow(bulk(eta=0), strain)
    for n in (10, 20):
        p = 0.0
        for _ in range(n):
            p += flow(law, strain, p, p, θ=0.5, dt=1 / n)
        errors.append(abs(p / (γ * (1 - math.exp(-1 / τ))) - 1))
    # Two step sizes of a method of second order: a factor 4, up to the next order
    assert errors[0] / errors[1] == pytest.approx(4, rel=0.02)
    assert errors[1] < 1e-3


def test_duvaut_lions_is_perzyna():
    """[closed] With η = τ (C + H + B)."""
    stiffness = np.array([C + H + B, 7.0])
    assert (ub.DuvautLions(0.25).coefficient(stiffness) == 0.25 * stiffness).all()
    assert (ub.Perzyna(0.25).coefficient(stiffness) == 0.25).all()


@pytest.mark.parametrize("viscosity", [ub.Perzyna(0.0), ub.DuvautLions(0.0)], ids=str)
def test_zero_time_or_viscosity_is_none(viscosity):
    assert (viscosity.coefficient(np.array([C])) == 0).all()


@pytest.mark.parametrize("viscosity", [ub.Perzyna(math.inf), ub.DuvautLions(math.inf)], ids=str)
def test_infinite_time_or_viscosity_is_elastic(viscosity):
    eta = viscosity.coefficient(np.array([C]))[0]
    assert flow(bulk(eta=eta), 5.0) == 0


@pytest.mark.parametrize("θ", [0.5, 1.0])
@pytest.mark.parametrize("strain", [-0.3, 0.01, 0.02, 0.3])
def test_derivative_of_flow(strain, θ):
    law, ε = bulk(), 1e-6
    exact = flow(law, strain + 1j * STEP, θ=θ).imag / STEP
    central = (flow(law, strain + ε, θ=θ) - flow(law, strain - ε, θ=θ)) / (2 * ε)
    # Piecewise linear: round-off of 1e-16 of 0.3 over ε
    assert exact == pytest.approx(central, abs=1e-9)
    assert (exact > 0) == (abs(strain) > LIMIT / C)


def test_energies_of_a_step_are_those_of_the_law():
    """[closed] C e²/2, (B p² + H ξ²)/2, (limit + η γ/Δt) γ."""
    law = bulk()
    assert law.elastic_energy(0.5, state(0.2))[0] == pytest.approx(C * 0.09 / 2)
    assert law.hardening_energy(state(0.3, 0.6))[0] == pytest.approx((B * 0.09 + H * 0.36) / 2)
    change = state(-0.3, 0.3)
    assert law.dissipation(0.5, state(), change, 0.1)[0] == pytest.approx((LIMIT + ETA * 3) * 0.3)


# -- softening ---------------------------------------------------------------------------------

SOFTENINGS = [ub.Softening, ub.LinearSoftening]
GROWTHS = [1e-14, 1e-9, 1e-5, 9.9e-4, 1.1e-3, 0.1, 1.0, 2.0, 3.0, 100.0, 1e6, 1e12]
"""In parts of energy/limit; the series of the mean ends at 1e-3, linear softening at 2."""


def traction(law, ξ):
    return float(law.traction(np.array([ξ]))[0])


def mean(law, ξ, a):
    (value,) = law.mean_traction(np.array([ξ]), np.array([a]))
    return value


@pytest.mark.parametrize("a", GROWTHS)
@pytest.mark.parametrize("ξ", [0.0, 0.3, 1.9, 2.5])
@pytest.mark.parametrize("kind", SOFTENINGS)
def test_mean_traction_is_the_mean(kind, ξ, a):
    """Against quadrature, across the end of linear softening too."""
    limit, energy = 5.0, 20.0
    law, unit = kind(limit, energy), energy / limit
    # Growth in parts of its whole; pieces are smooth, and beyond 60 the exponential is 1e-26
    ends = [min(max((x - ξ) / a, 0.0), 1.0) for x in (2.0, 10.0, 60.0)]
    integral = sum(
        quad(lambda part: traction(law, (ξ + part * a) * unit), *edges, epsabs=1e-20)[0]
        for edges in pairwise([0.0, *ends, 1.0])
    )
    # Of quadrature
    assert mean(law, ξ * unit, a * unit) == pytest.approx(integral, rel=1e-8)


@pytest.mark.parametrize("ratio", [1e-12, 1e-3, 1.0, 1e3, 1e12])
@pytest.mark.parametrize("kind", SOFTENINGS)
def test_complete_opening_takes_the_energy(kind, ratio):
    """[closed] For limits over energies of any size."""
    law = kind(2.0 * ratio, 2.0)
    a = 1e3 / ratio
    assert mean(law, 0.0, a) * a == pytest.approx(2.0, rel=1e-14)
    assert traction(law, 0.0) == 2 * ratio
    assert traction(law, a) == 0


@pytest.mark.parametrize("kind", SOFTENINGS)
def test_parts_of_an_opening_take_what_the_whole_takes(kind):
    """However an opening is cut into steps: what the dissipation of a run rests on."""
    law = kind(5.0, 20.0)
    ξ = np.concatenate([[0.0], np.cumsum(np.random.default_rng(0).uniform(0, 1, 20))])
    a = np.diff(ξ)
    assert law.mean_traction(ξ[:-1], a) @ a == pytest.approx(mean(law, 0.0, ξ[-1]) * ξ[-1])


@pytest.mark.parametrize("kind", SOFTENINGS)
def test_no_growth_has_the_traction_as_its_mean(kind):
    law = kind(5.0, 20.0)
    for ξ in (0.0, 1.0, 7.9, 8.0, 100.0):
        assert mean(law, ξ, 0.0) == traction(law, ξ)


@pytest.mark.parametrize("kind", SOFTENINGS)
def test_limit_zero_bears_nothing(kind):
    law = kind(0.0, 1.0)
    assert traction(law, 0.0) == traction(law, 5.0) == 0
    assert mean(law, 0.0, 0.0) == mean(law, 0.0, 3.0) == 0


def test_shapes_of_softening():
    """[closed] S17: limit exp(-limit ξ/energy); a line from limit to zero at 2 energy/limit."""
    ξ = np.array([0.0, 0.1, 0.5])
    assert ub.Softening(10.0, 5.0).traction(ξ) == pytest.approx([10, 8.1873075308, 3.6787944117])
    assert ub.LinearSoftening(10.0, 5.0).traction(np.array([0, 0.5, 1, 2])) == pytest.approx(
        [10, 5, 0, 0]
    )


@pytest.mark.parametrize("a", [1e-4, 5e-4, 0.3, 1.5, 3.0, 40.0])
@pytest.mark.parametrize("ξ", [0.0, 0.7, 1.8, 2.2])
@pytest.mark.parametrize("kind", SOFTENINGS)
def test_derivatives_of_tractions(kind, ξ, a):
    """By complex steps against central differences, in units of limit and energy."""
    law, ε = kind(1.0, 1.0), 1e-5
    exact = mean(law, ξ, a + 1j * STEP).imag / STEP
    central = (mean(law, ξ, a + ε) - mean(law, ξ, a - ε)) / (2 * ε)
    # ε² of third derivatives of order one, 1e-16/ε of values of order one
    assert exact == pytest.approx(central, abs=1e-9)
    (value,) = law.traction(np.array([ξ + 1j * STEP]))
    central = (traction(law, ξ + ε) - traction(law, ξ - ε)) / (2 * ε)
    assert value.imag / STEP == pytest.approx(central, abs=1e-9)


# -- layouts -----------------------------------------------------------------------------------


def test_laws_of_resultants_stand_at_their_points():
    """Axial force and moment yield; shear has no point."""
    section = ub.Section(
        EA=7.0, GA=5.0, EI=3.0,
        axial=ub.ElastoPlastic(2.0, 1.0, viscosity=ub.DuvautLions(0.5)),
        bending=ub.ElastoPlastic(4.0, kinematic=6.0, viscosity=ub.Perzyna(9.0)),
    )  # fmt: skip
    section_points = section.section_points(None)[0]
    numbers = section_points.parameters([(0, 0), (0, 1)])
    assert section_points.strains.tolist() == [[1, 0, 0], [0, 0, 1]]
    assert section_points.rest.tolist() == [0, 5, 0]
    assert section_points.stiffness.tolist() == [7, 3]
    assert numbers["yield_limit"].tolist() == [[2, 4], [2, 4]]
    assert numbers["isotropic"].tolist() == [[1, 0], [1, 0]]
    assert numbers["kinematic"].tolist() == [[0, 6], [0, 6]]
    assert numbers["viscosity"].tolist() == [[0.5 * (7 + 1), 9], [0.5 * (7 + 1), 9]]
    assert section_points.softening is None
    assert section_points.yields


def test_a_hinge_in_an_elastic_section_has_one_point():
    section = ub.Section(EA=7.0, GA=5.0, EI=3.0)
    law = ub.Softening(1.0, 1.0)
    section_points = section.section_points(law)[0]
    assert isinstance(section_points, SectionPoints)
    assert section_points.strains.tolist() == [[0, 0, 1]]
    assert section_points.rest.tolist() == [7, 5, 0]
    assert section_points.softening is law
    assert not section_points.yields
    assert section.section_points(None) == ()


def test_a_hinge_that_never_opens_is_none():
    section = ub.Section(EA=7.0, GA=5.0, EI=3.0)
    assert section.section_points(ub.Softening(math.inf, 1.0)) == ()
