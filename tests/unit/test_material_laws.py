# SPDX-License-Identifier: MIT
"""Laws of one point: flow in closed form, its limits, and tractions with their exact means."""

import math
from itertools import pairwise

import numpy as np
import pytest
from scipy.integrate import quad

import ufl_beam as ub
from ufl_beam.model.material_law import State

C, LIMIT, H, B, ETA = 200.0, 3.0, 20.0, 10.0, 0.5
"""Numbers of a test material: yields at a strain of 0.015."""

STEP = 1e-30


def bulk(limit=LIMIT, H=H, B=B, eta=ETA):
    numbers = {"yield_limit": limit, "isotropic": H, "kinematic": B, "viscosity": eta}
    arrays = {name: np.array([float(x)]) for name, x in numbers.items()}
    return ub.ElastoPlastic(1.0).with_parameters(np.array([C]), arrays)


def state(p=0.0, ξ=0.0):
    return State({"plastic": np.array([p]), "accumulated": np.array([ξ])})


def flow(law, strain, p=0.0, ξ=0.0, θ=1.0, dt=0.1):
    """Plastic strain of a step, of which the law states the part up to t_n+θ."""
    changes = law.increments(np.array([strain]), state(p, ξ), θ * dt)
    assert abs(changes["plastic"]) == changes["accumulated"]
    return (changes["plastic"] / θ)[0]


# -- bulk --------------------------------------------------------------------------------------


@pytest.mark.parametrize("field", ["limit", "eta"])
def test_infinity_is_elastic(field):
    """Without a warning, with complex strains, and without energies that are no numbers."""
    law = bulk(**{field: math.inf})
    changes = law.increments(np.array([5.0 + 1j * STEP]), state(), 0.1)
    assert changes["plastic"][0] == 0
    assert law.stress(np.array([5.0]), State(changes)).real[0] == 5 * C
    real = State({name: z.real for name, z in changes.items()})
    assert law.dissipation(5.0, state(), real, 0.1)[0] == 0


def test_no_limit_flows_at_once():
    """[closed] limit = 0, no hardening: nothing is borne."""
    law = bulk(limit=0, H=0, B=0, eta=0)
    for strain in (0.01, -0.01, 0.0):
        assert flow(law, strain) == pytest.approx(strain, rel=1e-15)


def test_overstress_relaxes_exponentially():
    """[closed] At constant strain the overstress decays as exp(-t/τ), second order at θ = 1/2."""
    τ, strain = 0.3, 0.1
    law = bulk(eta=ub.DuvautLions(τ).coefficient(np.array([C + H + B]))[0])
    γ, errors = flow(bulk(eta=0), strain), []
    for n in (10, 20):
        p = 0.0
        for _ in range(n):
            p += flow(law, strain, p, p, θ=0.5, dt=1 / n)
        errors.append(abs(p / (γ * (1 - math.exp(-1 / τ))) - 1))
    # Two step sizes of a method of second order: a factor 4, up to the next order
    assert errors[0] / errors[1] == pytest.approx(4, rel=0.02)
    assert errors[1] < 1e-3


@pytest.mark.parametrize("x", [0.0, 0.25, math.inf])
def test_duvaut_lions_is_perzyna(x):
    """[closed] With η = τ (C + H + B)."""
    stiffness = np.array([C + H + B, 7.0])
    assert (ub.DuvautLions(x).coefficient(stiffness) == x * stiffness).all()
    assert (ub.Perzyna(x).coefficient(stiffness) == x).all()


def test_energies_of_a_step_are_those_of_the_law():
    """[closed] C e²/2, (B p² + H ξ²)/2, (limit + η γ/Δt) γ."""
    law = bulk()
    assert law.elastic_energy(0.5, state(0.2))[0] == pytest.approx(C * 0.09 / 2)
    assert law.hardening_energy(state(0.3, 0.6))[0] == pytest.approx((B * 0.09 + H * 0.36) / 2)
    change = state(-0.3, 0.3)
    assert law.dissipation(0.5, state(), change, 0.1)[0] == pytest.approx((LIMIT + ETA * 3) * 0.3)


# -- softening ---------------------------------------------------------------------------------

each_kind = pytest.mark.parametrize("kind", [ub.Softening, ub.LinearSoftening])


def traction(law, ξ):
    return law.traction(np.array([ξ]))[0]


def mean(law, ξ, a):
    return law.mean_traction(np.array([ξ]), np.array([a]))[0]


@pytest.mark.parametrize("a", [1e-14, 1e-5, 9.9e-4, 1.1e-3, 0.1, 1.0, 2.0, 3.0, 1e6, 1e12])
@pytest.mark.parametrize("ξ", [0.0, 0.3, 1.9, 2.5])
@each_kind
def test_mean_traction_is_the_mean(kind, ξ, a):
    """Against quadrature, across the end of linear softening too, at 2 energy/limit.

    Growths are in parts of energy/limit; the series of the mean ends at 1e-3.
    """
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
    assert mean(law, ξ * unit, 0.0) == traction(law, ξ * unit)


@pytest.mark.parametrize("ratio", [1e-12, 1.0, 1e12])
@each_kind
def test_complete_opening_takes_the_energy(kind, ratio):
    """[closed] For limits over energies of any size, however an opening is cut into steps."""
    law, a = kind(2.0 * ratio, 2.0), 1e3 / ratio
    assert mean(law, 0.0, a) * a == pytest.approx(2.0, rel=1e-14)
    assert traction(law, 0.0) == 2 * ratio
    assert traction(law, a) == 0
    ξ = np.concatenate([[0.0], np.cumsum(np.random.default_rng(0).uniform(0, 0.2, 20)) / ratio])
    a = np.diff(ξ)
    assert law.mean_traction(ξ[:-1], a) @ a == pytest.approx(mean(law, 0.0, ξ[-1]) * ξ[-1])


def test_shapes_of_softening():
    """[closed] S17: limit exp(-limit ξ/energy); a line from limit to zero at 2 energy/limit."""
    ξ = np.array([0.0, 0.1, 0.5])
    assert ub.Softening(10.0, 5.0).traction(ξ) == pytest.approx([10, 8.1873075308, 3.6787944117])
    lines = ub.LinearSoftening(10.0, 5.0).traction(np.array([0, 0.5, 1, 2]))
    assert lines == pytest.approx([10, 5, 0, 0])


@pytest.mark.parametrize("a", [1e-4, 0.3, 1.5, 40.0])
@pytest.mark.parametrize("ξ", [0.0, 0.7, 1.8, 2.2])
@each_kind
def test_derivatives_of_tractions(kind, ξ, a):
    """By complex steps against central differences, in units of limit and energy."""
    law, ε = kind(1.0, 1.0), 1e-5
    # ε² of third derivatives of order one, 1e-16/ε of values of order one
    central = (mean(law, ξ, a + ε) - mean(law, ξ, a - ε)) / (2 * ε)
    assert mean(law, ξ, a + 1j * STEP).imag / STEP == pytest.approx(central, abs=1e-9)
    central = (traction(law, ξ + ε) - traction(law, ξ - ε)) / (2 * ε)
    assert traction(law, ξ + 1j * STEP).imag / STEP == pytest.approx(central, abs=1e-9)


# -- layouts -----------------------------------------------------------------------------------
