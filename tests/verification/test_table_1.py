# SPDX-License-Identifier: MIT
"""Table 1 of the paper: a straight cantilever whose end is turned by π, at three rates.

Source: the paper, section 4.1; L = 1 m, T = 1, 0.1 and 0.01 s follow from its numbers.  The moment
is the same all along the beam, so no number depends on the mesh.

Printed for η = 2e7 Pa s is another update, which depends on the step.  The numbers here are those
of Perzyna's law, which Duvaut and Lions's with τ = η/(E + K) is too: [calc] 5.8961, 5.9854, 6.8784.
"""

import math

import numpy as np
import pytest
from helpers import assert_balanced
from scenes import clamped

import ufl_beam as ub

E, K = 73e9, 2e9  # Pa
A, I, L = 2e-4, 0.1667e-8, 1.0  # m², m⁴, m
M_Y = 50.0  # N m
RATES = {1.0: 0, 0.1: 1, 0.01: 2}
"""Time in which the end turns, s, and its column in the table."""

M_ELASTIC = math.pi * E * I / L
TURN_Y = M_Y * L / (E * I)
M_PLASTIC = M_Y + E * K / (E + K) * I * (math.pi - TURN_Y) / L


def turned(bending, T=1.0, *, cells=2, scheme=None, steps=20):
    section = ub.Section(EA=E * A, GA=E * A / 3, EI=E * I, bending=bending)
    beam = ub.Beam((0, 0), (L, 0), section, cells=cells)
    turn = ub.PrescribedDisplacement(beam.end, psi=lambda t: math.pi * t / T)
    scene = clamped(beam, turn)
    scheme = scheme or ub.Static()
    return ub.simulate(scene, scheme, t=(0, T), dt=T / steps)


def moments(*args, **kwargs):
    """Moments in the cells at the end; N m."""
    solution = turned(*args, **kwargs)
    return solution.section_forces(solution.scene.beams[0])[:, 2]


def perzyna(eta, **further):
    return ub.ElastoPlastic(M_Y, K * I, viscosity=ub.Perzyna(eta * I), **further)


def duvaut_lions(tau, **further):
    return ub.ElastoPlastic(M_Y, K * I, viscosity=ub.DuvautLions(tau), **further)


def steady(eta, T):
    """[closed] Moment in steady flow; the plastic curvature grows by E/(E + K) of the curvature."""
    return M_PLASTIC + (E / (E + K)) ** 2 * eta * math.pi / (L * T) * I


@pytest.mark.parametrize("cells", [2, 8])
def test_rate_independent(cells):
    """Printed: 38.230 and 5.88614 kN cm, half a unit of the last digit; and the closed forms."""
    elastic, plastic = moments(None, cells=cells), moments(perzyna(0.0), cells=cells)
    np.testing.assert_allclose(elastic / 10, 38.230, rtol=0, atol=0.5e-3)
    np.testing.assert_allclose(plastic / 10, 5.88614, rtol=0, atol=0.5e-5)
    np.testing.assert_allclose(elastic, M_ELASTIC, rtol=1e-12)
    np.testing.assert_allclose(plastic, M_PLASTIC, rtol=1e-12)


@pytest.mark.parametrize(
    ("eta", "table"), [(1e6, (5.8866, 5.8911, 5.9358)), (2e7, (5.8961, 5.9854, 6.8784))]
)
def test_viscous(eta, table):
    """Half a unit of the last digit, and the moment of steady flow."""
    for T, column in RATES.items():
        M = moments(perzyna(eta), T)
        np.testing.assert_allclose(M / 10, table[column], rtol=0, atol=0.5e-4)
        np.testing.assert_allclose(M, steady(eta, T), rtol=2e-9)


@pytest.mark.parametrize(
    "scheme", [ub.Static(), ub.EnergyMomentumStatic(), ub.EnergyMomentumStatic(0.5)]
)
@pytest.mark.parametrize("eta", [1e6, 2e7, 1e9])
def test_two_names_of_one_law(eta, scheme):
    """Duvaut and Lions with τ = η/(E + K + B) and Perzyna: to round-off, with both hardenings."""
    B = 3e9 * I
    one = moments(perzyna(eta, kinematic=B), 0.01, scheme=scheme)
    other = moments(duvaut_lions(eta / (E + K + B / I), kinematic=B), 0.01, scheme=scheme)
    np.testing.assert_allclose(other, one, rtol=1e-11)


@pytest.mark.parametrize(("eta", "T"), [(0.0, 1.0), (2e7, 0.1), (2e7, 0.01)])
def test_exact_statics(eta, T):
    """The moment converges to the same numbers, of second order in the step; the ledger closes.

    Moments work on 2 tan(Δψ/2) of the nodes, so they differ by (Δψ/2)² along the beam; the fourth
    order leaves (Δψ/2)⁴ = 4e-9.
    """
    exact = ub.EnergyMomentumStatic()
    runs = [turned(perzyna(eta), T, scheme=exact, steps=n) for n in (200, 400)]
    coarse, fine = (run.section_forces(run.scene.beams[0])[:, 2] for run in runs)
    assert np.abs(coarse / steady(eta, T) - 1).max() <= (math.pi / 400) ** 2
    np.testing.assert_allclose((4 * fine - coarse) / 3, steady(eta, T), rtol=1e-8)
    for run in runs:
        assert_balanced(run.energy)


@pytest.mark.parametrize("scheme", [ub.Static(), ub.EnergyMomentumStatic()])
@pytest.mark.parametrize("law", [perzyna, duvaut_lions])
def test_limits_of_viscosity_are_the_plastic_and_the_elastic_law(law, scheme):
    """No viscosity is the plastic law, and infinite viscosity the elastic one, to round-off."""
    plastic, elastic = (moments(b, scheme=scheme) for b in (ub.ElastoPlastic(M_Y, K * I), None))
    np.testing.assert_allclose(moments(law(0.0), scheme=scheme), plastic, rtol=1e-12)
    np.testing.assert_allclose(moments(law(math.inf), scheme=scheme), elastic, rtol=1e-12)
