# SPDX-License-Identifier: MIT
"""Material points: laws fulfilled after a step, tangents, energies, and openings of any size."""

import math

import numpy as np
import pytest
from uniaxial_points import LENGTH, Bars, C, histories

import ufl_beam as ub

NONE = ub.ElastoPlastic(math.inf)
LAWS = {
    "elastic": (NONE, None),
    "plastic": (ub.ElastoPlastic(3.0), None),
    "isotropic": (ub.ElastoPlastic(3.0, 20.0), None),
    "kinematic": (ub.ElastoPlastic(3.0, kinematic=20.0), None),
    "viscous": (ub.ElastoPlastic(3.0, 20.0, 10.0, ub.Perzyna(0.5)), None),
    "relaxing": (ub.ElastoPlastic(3.0, 20.0, viscosity=ub.DuvautLions(0.1)), None),
    "softening": (NONE, ub.Softening(4.0, 0.3)),
    "linear": (NONE, ub.LinearSoftening(4.0, 0.3)),
    "both": (ub.ElastoPlastic(2.0, 30.0), ub.Softening(3.0, 0.3)),
    "viscous both": (
        ub.ElastoPlastic(2.0, 5.0, 5.0, ub.Perzyna(0.5)), ub.LinearSoftening(4.0, 0.3)
    ),
    "joint": (NONE, ub.Softening(0.0, 1.0)),
}  # fmt: skip
"""Bulk and discontinuity of a point of stiffness C: yields at a strain of 0.015, or 0.01."""

STATIC = ub.Static()
EXACT = [ub.EnergyMomentumStatic(θ) for θ in (0.5, 0.8, 1.0)]

each_law = pytest.mark.parametrize("law", LAWS)
each_scheme = pytest.mark.parametrize("scheme", [STATIC, *EXACT], ids=str)


# -- after a step the laws hold ------------------------------------------------------------------


@each_law
@each_scheme
def test_laws_hold_after_each_step(law, scheme):
    """At t_n+θ: below the limit or on it, flow with the stress, resistance or less.

    The stress in the accepted state is that of the strain less plastic strain and jump.
    """
    (bulk, softening), dt, θ = LAWS[law], 0.1, scheme.theta
    some = Bars(200, bulk, softening, scheme)
    H, B = bulk.isotropic, bulk.kinematic
    eta = float(np.ravel(some.parameters["viscosity"])[0])
    seen = set()
    for strain in histories(200):
        p, ξ, opening, jump = (some[n] for n in ("plastic", "accumulated", "opening", "jump"))
        σ = some.step(strain, dt)
        dp, growth = some["plastic"] - p, some["opening"] - opening
        relative, flows, opens = σ - B * (p + θ * dp), dp != 0, growth > 0
        limit = bulk.limit + H * (ξ + θ * np.abs(dp))
        scale = C * np.abs(strain).max() * 1e-13  # round-off of stresses as large as C strain
        assert np.isfinite(σ).all()
        assert (np.abs(relative) <= limit + scale)[~flows].all()
        elastic = strain - some["jump"] / LENGTH - some["plastic"]
        assert np.abs(some.stress() - C * elastic).max() < 10 * scale
        if flows.any():
            expected = limit + eta * np.abs(dp) / dt
            assert np.abs(np.abs(relative) - expected)[flows].max() < scale
            assert (np.sign(dp) == np.sign(relative))[flows].all()
            assert some["accumulated"] - ξ == pytest.approx(np.abs(dp), abs=1e-15)
            seen.add("flows")
        if softening is not None:
            assert (growth >= 0).all()
            bears = np.abs(σ)
            assert (bears[~opens] <= softening.traction(opening)[~opens] + scale).all()
            if opens.any():
                resists = scheme.resistance(softening, opening, growth)
                # An opening is found to 1e-9 of it, and then to the square of that
                assert np.abs(bears - resists)[opens].max() < 10 * scale
                turned = np.sign(some["jump"] - jump) == np.sign(σ)
                # What breaks lets go of its elastic strain besides
                broken = softening.traction(some["opening"]) == 0
                assert turned[opens & ~broken & (bears > scale)].all()
                seen.add("opens")
    assert ("flows" in seen) == (bulk is not NONE)
    assert ("opens" in seen) == (softening is not None)


@each_scheme
@pytest.mark.parametrize("side", [-1, 1])
@pytest.mark.parametrize("near", [1e-2, 1e-6])
@pytest.mark.parametrize("law", [x for x in LAWS if x not in ("elastic", "joint")])
def test_tangents_just_before_and_after_onset(law, near, side, scheme):
    """Elastic before, with the slope of flow or opening after."""
    bulk, softening = LAWS[law]
    limit = min(bulk.limit, softening.limit if softening else math.inf)
    onset = limit / (C * scheme.theta)
    one = Bars(1, bulk, softening, scheme)
    strain, ε = np.array([onset * (1 + side * near)]), onset * near / 10
    exact = one.return_map(strain)[1][0]
    central = (one.return_map(strain + ε)[0][0] - one.return_map(strain - ε)[0][0]) / (2 * ε)
    # Round-off of stresses over ε, ε² and curvature of the law
    assert exact == pytest.approx(central, abs=max(1e-15 / near, 1e-6) * 10 * C * scheme.theta)
    if side < 0:
        assert exact == pytest.approx(C * scheme.theta, rel=1e-13)
    else:
        assert exact < 0.9999 * C * scheme.theta


# -- energies ------------------------------------------------------------------------------------


@each_law
@pytest.mark.parametrize("scheme", EXACT, ids=str)
def test_work_is_stored_or_dissipated_or_lost(law, scheme):
    """σ_θ Δε = Δ(elastic) + Δ(hardening) + dissipated + (2θ - 1) lost, in each step; each >= 0.

    [closed] A discontinuity dissipates the integral of its traction, whatever the steps are.
    """
    bulk, softening = LAWS[law]
    for walk in histories(8).T:
        one, stored, worked, broken = Bars(1, bulk, softening, scheme), 0.0, 0.0, 0.0
        through = C * np.abs(walk).max() ** 2 * LENGTH  # what the bulk would store alone
        for strain in walk:
            before = one.strain[0]
            (σ,) = one.step([strain])
            plastic, breaks, lost, elastic, hardening, released, _ = one.points.sums
            work, now = σ * (strain - before) * LENGTH, elastic + hardening
            sinks = plastic + breaks + (2 * scheme.theta - 1) * lost + released
            through = max(through, abs(work), now, sinks)
            # Round-off of the largest energies so far; the opening squares an error of 1e-9
            assert abs(work - (now - stored) - sinks) < 1e-14 * through
            assert min(plastic, breaks, lost, released) >= 0
            stored, worked, broken = now, worked + plastic, broken + breaks
        assert np.ravel(one.dissipated()) == pytest.approx([worked, broken], rel=1e-12)
        if softening is not None:
            opening = one["opening"]
            whole = opening * softening.mean_traction(np.zeros(1), opening)
            assert abs(broken - whole[0]) <= 1e-12 * softening.fracture_energy


@each_law
def test_static_steps_dissipate(law):
    """Nothing is negative, and no discontinuity dissipates more than its energy."""
    bulk, softening = LAWS[law]
    some, before = Bars(200, bulk, softening, STATIC), np.zeros((2, 200))
    for strain in histories(200):
        some.step(strain)
        now = np.array(some.dissipated())
        assert (now >= before).all()
        before = now
    assert softening is None or (before[1] <= softening.fracture_energy * (1 + 1e-12)).all()


@each_law
def test_responses_leave_no_trace(law):
    """Only an accepted step changes the state, which can be restored."""
    one, other = (Bars(200, *LAWS[law], EXACT[0]) for _ in range(2))
    random = np.random.default_rng(1)
    for strain in histories(200, steps=10):
        for far in random.uniform(-1, 1, (3, 200)):
            one.return_map(far, dt=random.uniform(1e-3, 1))
        assert (one.step(strain) == other.step(strain)).all()
    assert (one.points.state() == other.points.state()).all()
    again = Bars(200, *LAWS[law], EXACT[0])
    again.points.restore(one.points.state())
    again.points.refresh(again._strains(strain))
    # Sums in another order
    assert again.stress() == pytest.approx(one.stress(), rel=1e-13, abs=1e-13)
    assert again.points.sums[3:5] == pytest.approx(one.points.sums[3:5], rel=1e-12)


# -- openings of any size ------------------------------------------------------------------------

BEYOND = np.concatenate([10.0 ** np.arange(-15.0, 4.0), 2.0 ** np.arange(-52.0, -10.0)])
"""How far the trial stress is beyond the limit, as a part of it."""

each_kind = pytest.mark.parametrize("kind", [ub.Softening, ub.LinearSoftening])


@each_scheme
@pytest.mark.parametrize("ratio", 10.0 ** np.arange(-12, 13, 4))
@each_kind
def test_openings_are_found(kind, ratio, scheme):
    """For limit/energy of 24 magnitudes, cells that snap back (limit²/energy > C/length) too."""
    limit = 2.0
    law = kind(limit, limit / ratio)
    strain = limit / (C * scheme.theta) * (1 + BEYOND)
    some = Bars(len(BEYOND), NONE, law, scheme)
    σ = some.step(strain)
    assert np.isfinite(σ).all()
    growth = some["opening"]
    assert (growth >= 0).all()
    assert (growth <= strain * LENGTH / scheme.theta * (1 + 1e-12)).all()
    opens = growth > 0
    assert opens[BEYOND > 1e-14].all()
    resists = scheme.resistance(law, np.zeros_like(growth), growth)
    # Round-off of C times the strain
    assert (np.abs(σ - resists)[opens] <= 1e-14 * (C * strain + limit)[opens]).all()


@each_scheme
@each_kind
def test_openings_of_a_broken_point(kind, scheme):
    """Nothing left to resist: the stress is round-off, in both directions and again."""
    some = Bars(5, NONE, kind(2.0, 1e-6), scheme)
    strain = np.array([1e-4, 1e-2, 1.0, 30.0, 1e-9])
    for factor in (1e3, -1e3, 1.0, 1e-3, -1e-6, 0.0, 5.0):
        σ = some.step(factor * strain)
        assert np.isfinite(σ).all()
    assert (np.abs(σ[:4]) < 1e-12 * C * 1e3 * strain[:4]).all()
    if scheme != STATIC:
        assert some.dissipated()[1][:4] == pytest.approx(1e-6, rel=1e-9)


@each_scheme
@each_kind
def test_openings_beside_a_bulk_that_yields(kind, scheme):
    """Kinematic hardening far beyond its limit flows back under stresses that pull."""
    bulk = ub.ElastoPlastic(0.5, 1.0, 150.0, ub.Perzyna(0.01))
    some = Bars(600, bulk, kind(6.0, 0.2), scheme)
    for strain in histories(600, size=0.5):
        assert np.isfinite(some.step(strain)).all()
    assert (some["opening"] > 0).any()
    assert (some["accumulated"] > 0).any()
