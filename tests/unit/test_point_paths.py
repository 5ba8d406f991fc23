# SPDX-License-Identifier: MIT
"""The return map at hundreds of points: tangents and energies, also for laws of one's own."""

import math
from dataclasses import dataclass

import numpy as np
import pytest
from helpers import in_turn
from uniaxial_points import LENGTH, Bars, C, histories
from user_laws import Dashpot, PowerLaw, SameHardening, Stiffening

import ufl_beam as ub
import ufl_beam.structures as st

SOFTENS, LINEAR = ub.Softening(3.0, 0.3), ub.LinearSoftening(4.0, 0.3)
LAWS = {
    "plastic": (ub.ElastoPlastic(3.0), None),
    "viscous": (ub.ElastoPlastic(3.0, 20.0, 10.0, ub.Perzyna(0.5)), None),
    "relaxing": (ub.ElastoPlastic(3.0, 20.0, viscosity=ub.DuvautLions(0.1)), None),
    "softening": (ub.ElastoPlastic(math.inf), SOFTENS),
    "linear": (ub.ElastoPlastic(math.inf), LINEAR),
    "both": (ub.ElastoPlastic(2.0, 30.0), SOFTENS),
    "viscous both": (ub.ElastoPlastic(2.0, 5.0, 5.0, ub.Perzyna(0.5)), LINEAR),
    "joint": (ub.ElastoPlastic(math.inf), ub.Softening(0.0, 1.0)),
    "power": (PowerLaw(3.0, 0.01, 5.0), None),
    "power, softening": (PowerLaw(2.5, 0.01, 5.0), SOFTENS),
    "dashpot": (Dashpot(20.0), None),
    "dashpot, softening": (Dashpot(20.0), SOFTENS),
    "by residuals": (SameHardening(2.0, 20.0, 10.0, 0.5), None),
    "by residuals, softening": (SameHardening(2.0, 20.0, 10.0, 0.5), SOFTENS),
    "stiffening": (Stiffening(1e4), None),
    "Menegotto-Pinto": (st.MenegottoPinto(3.0, 0.05, 5.0, a1=0.1, a3=0.2), None),
    "Kent-Park": (st.KentPark(3.0, 0.6, 0.08, tension=ub.Softening(0.4, 0.02)), None),
    "Mander": (st.Mander(3.0, 0.02, 0.06, tension=ub.LinearSoftening(0.4, 0.02)), None),
    "Menegotto-Pinto, softening": (st.MenegottoPinto(3.0, 0.05), SOFTENS),
}
"""Bulk and discontinuity of a point of stiffness C, at strains up to 0.06."""

EXACT = [ub.EnergyMomentumStatic(theta) for theta in (0.5, 0.8, 1.0)]
SCHEMES = [ub.Static(), *EXACT]


@pytest.mark.parametrize(("law", "scheme"), in_turn(LAWS, SCHEMES), ids=str)
def test_tangents_are_derivatives(law, scheme):
    """Against central differences; cells at a corner of a law are left out."""
    some = Bars(300, *LAWS[law], scheme)
    *before, last = histories(300, steps=5)
    for strain in before:
        some.step(strain)
    ε = 1e-8
    exact = some.return_map(last)[1]
    central = (some.return_map(last + ε)[0] - some.return_map(last - ε)[0]) / (2 * ε)
    # 1e-16/ε of strains of 0.3, and curvature of the power law times ε
    assert np.abs(exact - central).max() < 1e-5 * C


@pytest.mark.parametrize(("law", "scheme"), in_turn(LAWS, EXACT), ids=str)
def test_work_is_stored_or_dissipated_or_lost(law, scheme):
    """Of each bar in each step, whether a law states its dissipation or leaves it to be found."""
    for k in range(4):
        one, stored, through = Bars(1, *LAWS[law], scheme), 0.0, 0.0
        for strain in histories(8)[:, 2 * k + 1]:
            before = one.strain[0]
            (σ,) = one.step([strain])
            plastic, breaks, lost, elastic, hardening, released, _ = one.points.sums
            work, now = σ * (strain - before) * LENGTH, elastic + hardening
            sinks = plastic + breaks + (2 * scheme.theta - 1) * lost + released
            through = max(through, abs(work), now, abs(sinks), C * strain**2 * LENGTH)
            assert abs(work - (now - stored) - sinks) < 1e-13 * through
            stored = now


def test_hardening_by_residuals_is_hardening():
    """The same law by Newton's method at the point: states, energies, tangents to round-off."""
    laws = ub.ElastoPlastic(2.0, 20.0, 10.0, ub.Perzyna(0.5)), SameHardening(2.0, 20.0, 10.0, 0.5)
    for scheme in EXACT[:2]:
        one, other = (Bars(500, law, SOFTENS, scheme) for law in laws)
        for strain in histories(500, steps=10):
            for x, y in zip(one.return_map(strain), other.return_map(strain), strict=True):
                assert np.abs(x - y).max() < 1e-10 * C
            one.step(strain)
            other.step(strain)
            assert other["p"] == pytest.approx(one["plastic"], abs=1e-13)
            assert other["xi"] == pytest.approx(one["accumulated"], abs=1e-13)
            assert other.points.sums == pytest.approx(one.points.sums, rel=1e-10, abs=1e-12)


def test_residuals_that_have_no_solution_are_no_number():
    """An impossible law: the stress is NaN, and so the step will be cut."""

    @dataclass(frozen=True)
    class Impossible(PowerLaw):
        def residuals(self, strain, old, new, dt):
            return {"largest": new.largest**2 + 1, "plastic": new.plastic}

    σ, _ = Bars(3, Impossible(1.0, 1.0, 2.0), None, SCHEMES[0]).return_map(np.ones(3))
    assert np.isnan(σ).all()
