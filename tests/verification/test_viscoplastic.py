# SPDX-License-Identifier: MIT
"""Viscoplastic vibration of a cantilever: two names of one law, its limits, and the ledger."""

import math

import numpy as np
import pytest
from helpers import assert_balanced
from scenes import clamped

import ufl_beam as ub

EI, M_Y, H = 100.0, 5.0, 20.0  # N m², N m, N m²
SCHEMES = [ub.EnergyMomentum(), ub.EnergyMomentum(0.05, 0.05), ub.EnergyMomentum(0.5)]


def struck(viscosity=None, scheme=None, *, dt=2e-3, law=ub.ElastoPlastic, cells=4):
    """A metre of cantilever whose end is pushed for 0.1 s; kept to 0.3 s."""
    bending = law(M_Y, H, H / 2, viscosity=viscosity) if viscosity else None
    section = ub.Section(EA=1e4, GA=1e4, EI=EI, rhoA=1.0, rhoI=1e-3, bending=bending)
    beam = ub.Beam((0, 0), (1, 0), section, cells=cells)
    push = ub.Table([0, 0.05, 0.1], [0, 1, 0])
    scene = clamped(beam, loads=[ub.PointLoad(beam.end, force=(0, 40.0), amplitude=push)])
    solution = ub.simulate(scene, scheme or ub.EnergyMomentum(), t=(0, 0.3), dt=dt)
    energy = solution.energy
    assert_balanced(energy)
    return solution, solution.displacement(beam.end)


@pytest.mark.parametrize("scheme", SCHEMES)
@pytest.mark.parametrize("tau", [1e-4, 1e-2, 1.0])
def test_two_names_of_one_law(tau, scheme):
    """Perzyna with η = τ (C + H + B): the same motion but for the solver's 1e-10 in 150 steps."""
    one, moved = struck(ub.DuvautLions(tau), scheme)
    _, again = struck(ub.Perzyna(tau * (EI + H + H / 2)), scheme)
    assert one.energy.lost["plastic"][-1] > 0
    np.testing.assert_allclose(again, moved, rtol=0, atol=1e-8 * np.abs(moved).max())


@pytest.mark.parametrize("scheme", SCHEMES)
@pytest.mark.parametrize("law", [ub.Perzyna, ub.DuvautLions])
def test_limits_of_viscosity_are_the_plastic_and_the_elastic_law(law, scheme):
    """Infinite viscosity is elastic, none rate-independent; both reached in proportion.

    A tenth of the distance with a tenth of the viscosity, or of its inverse: to 5 %, which the
    second order leaves where the distance is about a thousandth of the motion.
    """
    _, elastic = struck(None, scheme)
    _, frozen = struck(law(math.inf), scheme)
    np.testing.assert_allclose(frozen, elastic, rtol=0, atol=1e-8 * np.abs(elastic).max())
    _, plastic = struck(law(0.0), scheme)
    unit = EI if law is ub.Perzyna else 1.0
    for limit, values in ((plastic, (1e-6, 1e-7)), (elastic, (1e3, 1e4))):
        far, near = (np.abs(struck(law(unit * v), scheme)[1] - limit).max() for v in values)
        assert near > 0
        assert far / near == pytest.approx(10, rel=0.05)
        assert near <= 1e-3 * np.abs(limit).max()


@pytest.mark.parametrize("dt", [1e-3, 1e-2, 5e-2])
def test_ledger_at_any_step(dt):
    """It closes, and nothing is gained, also with steps far beyond the accuracy of the motion."""
    solution, _ = struck(ub.Perzyna(0.5), dt=dt)
    assert solution.energy.lost["plastic"][-1] > 0
