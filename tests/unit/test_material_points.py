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
        ub.ElastoPlastic(2.0, 5.0, 5.0, ub.Perzyna(0.5)),
        ub.LinearSoftening(4.0, 0.3),
    ),
    "joint": (NONE, ub.Softening(0.0, 1.0)),
}
"""Bulk and discontinuity of a point of stiffness C: yields at a strain of 0.015, or 0.01."""

STATIC, EXACT = (
    ub.Static(),
    [ub.EnergyMomentumStatic(0.5), ub.EnergyMomentumStatic(0.8), ub.EnergyMomentumStatic(1.0)],
)

each_law = pytest.mark.parametrize("law", LAWS)
each_scheme = pytest.mark.parametrize("scheme", [STATIC, *EXACT], ids=str)


def bars(law, scheme, cells=200):
    bulk, softening = LAWS[law]
    return Bars(cells, bulk, softening, scheme)


# -- after a step the laws hold ------------------------------------------------------------------


@each_law
@each_scheme
def test_laws_hold_after_each_step(law, scheme):
    """At t_n+θ: below the limit or on it, flow with the stress, resistance or less."""
    some, dt, θ = bars(law, scheme), 0.1, scheme.theta
    bulk, softening = LAWS[law]
    H, B = bulk.isotropic, bulk.kinematic
    eta = float(np.ravel(some.parameters["viscosity"])[0])
    seen = set()
    for strain in histories(200):
        p, ξ, opening, jump = (some[n] for n in ("plastic", "accumulated", "opening", "jump"))
        σ = some.step(strain, dt)
        dp, growth = some["plastic"] - p, some["opening"] - opening
        relative = np.abs(σ - B * (p + θ * dp))
        limit = bulk.limit + H * (ξ + θ * np.abs(dp))
        flows, opens = dp != 0, growth > 0
        scale = C * np.abs(strain).max() * 1e-13  # round-off of stresses as large as C strain
        assert np.isfinite(σ).all()
        assert (relative <= limit + scale)[~flows].all()
        if flows.any():
            expected = limit + eta * np.abs(dp) / dt
            assert np.abs(relative - expected)[flows].max() < scale
            assert (np.sign(dp) == np.sign(σ - B * (p + θ * dp)))[flows].all()
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


@each_law
@each_scheme
def test_stress_in_the_accepted_state(law, scheme):
    """That of the strain less plastic strain and jump; with θ = 1 that of the step itself."""
    some = bars(law, scheme)
    for strain in histories(200, steps=8):
        σ = some.step(strain)
        elastic = strain - some["jump"] / LENGTH - some["plastic"]
        assert np.abs(some.stress() - C * elastic).max() < 1e-12 * C
        if scheme.theta == 1:
            assert np.abs(some.stress() - σ).max() < 1e-12 * C


# -- tangents ------------------------------------------------------------------------------------


@each_scheme
@pytest.mark.parametrize("side", [-1, 1])
@pytest.mark.parametrize("near", [1e-2, 1e-4, 1e-6])
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


def one_cell_at_a_time(law, scheme, cells=8):
    """Bars of one cell each, for energies are known as sums over cells."""
    bulk, softening = LAWS[law]
    return [Bars(1, bulk, softening, scheme) for _ in range(cells)]


@each_law
@pytest.mark.parametrize("scheme", EXACT, ids=str)
def test_work_is_stored_or_dissipated_or_lost(law, scheme):
    """σ_θ Δε = Δ(elastic) + Δ(hardening) + dissipated + (2θ - 1) lost, in each step; each >= 0."""
    walks = histories(8)
    for k, one in enumerate(one_cell_at_a_time(law, scheme)):
        elastic = hardening = worked = broken = 0.0
        through = C * np.abs(walks[:, k]).max() ** 2 * LENGTH  # what the bulk would store alone
        for strain in walks[:, k]:
            before = one.strain[0]
            (σ,) = one.step([strain])
            plastic, breaks, lost, elastic_now, hardening_now, released, _ = one.points.sums
            work = σ * (strain - before) * LENGTH
            sinks = plastic + breaks + (2 * scheme.theta - 1) * lost + released
            change = elastic_now - elastic + hardening_now - hardening
            through = max(through, abs(work), elastic_now + hardening_now, sinks)
            # Round-off of the largest energies so far; the opening squares an error of 1e-9
            assert abs(work - change - sinks) < 1e-14 * through
            for sink in (plastic, breaks, lost, released):
                assert sink >= 0
            worked, broken = worked + plastic, broken + breaks
            elastic, hardening = elastic_now, hardening_now
        assert one.dissipated()[0][0] == pytest.approx(worked, rel=1e-12)
        assert one.dissipated()[1][0] == pytest.approx(broken, rel=1e-12)


@each_law
def test_static_steps_dissipate(law):
    """Nothing is negative, and no discontinuity dissipates more than its energy."""
    some = bars(law, STATIC)
    before = some.dissipated()
    for strain in histories(200):
        some.step(strain)
        now = some.dissipated()
        for one, two in zip(before, now, strict=True):
            assert (two >= one).all()
        before = now
    softening = LAWS[law][1]
    if softening is not None:
        assert (before[1] <= softening.fracture_energy * (1 + 1e-12)).all()


@each_law
@pytest.mark.parametrize(
    "scheme", [ub.EnergyMomentumStatic(0.5), ub.EnergyMomentumStatic(1.0)], ids=str
)
def test_dissipation_of_openings_does_not_depend_on_steps(law, scheme):
    """[closed] That of the accumulated opening, the integral of the traction."""
    softening = LAWS[law][1]
    some = bars(law, scheme)
    for strain in histories(200):
        some.step(strain)
    _, broken = some.dissipated()
    if softening is None:
        assert (broken == 0).all()
        return
    opening = some["opening"]
    whole = opening * softening.mean_traction(np.zeros(200), opening)
    assert np.abs(broken - whole).max() <= 1e-12 * softening.fracture_energy


# -- steps that are not taken ----------------------------------------------------------------------


@each_law
def test_responses_leave_no_trace(law):
    """Only an accepted step changes the state: what cutting of steps rests on."""
    one, other = bars(law, EXACT[0]), bars(law, EXACT[0])
    random = np.random.default_rng(1)
    for strain in histories(200, steps=10):
        for far in random.uniform(-1, 1, (3, 200)):
            one.return_map(far, dt=random.uniform(1e-3, 1))
        assert (one.step(strain) == other.step(strain)).all()
    assert (one.points.state() == other.points.state()).all()


@each_law
def test_state_and_restore(law):
    """A state that was restored goes on as the one it was taken from."""
    one, other = bars(law, EXACT[2]), bars(law, EXACT[2])
    walks = histories(200, steps=20)
    for strain in walks[:10]:
        one.step(strain)
    other.points.restore(one.points.state())
    other.strain = one.strain.copy()
    other.points.refresh(other._strains(other.strain))
    # Sums in another order
    assert other.stress() == pytest.approx(one.stress(), rel=1e-13, abs=1e-13)
    assert other.points.sums[3:5] == pytest.approx(one.points.sums[3:5], rel=1e-12)
    for strain in walks[10:]:
        one.step(strain)
        other.step(strain)
    assert other["jump"] == pytest.approx(one["jump"], rel=1e-12, abs=1e-15)
    assert other["plastic"] == pytest.approx(one["plastic"], rel=1e-12, abs=1e-15)


# -- openings of any size ------------------------------------------------------------------------

BEYOND = np.concatenate([10.0 ** np.arange(-15.0, 4.0), 2.0 ** np.arange(-52.0, -10.0)])
"""How far the trial stress is beyond the limit, as a part of it."""

RATIOS = 10.0 ** np.arange(-12, 13, 4)
KINDS = [ub.Softening, ub.LinearSoftening]


@each_scheme
@pytest.mark.parametrize("ratio", RATIOS)
@pytest.mark.parametrize("kind", KINDS)
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
    resists = scheme.resistance(law, np.zeros_like(growth), growth)
    opens = growth > 0
    assert opens[BEYOND > 1e-14].all()
    # Round-off of C times the strain
    assert (np.abs(σ - resists)[opens] <= 1e-14 * (C * strain + limit)[opens]).all()


@each_scheme
@pytest.mark.parametrize("kind", KINDS)
def test_openings_of_a_broken_point(kind, scheme):
    """Nothing left to resist: the stress is round-off, in both directions and again."""
    law = kind(2.0, 1e-6)
    some = Bars(5, NONE, law, scheme)
    strain = np.array([1e-4, 1e-2, 1.0, 30.0, 1e-9])
    for factor in (1e3, -1e3, 1.0, 1e-3, -1e-6, 0.0, 5.0):
        σ = some.step(factor * strain)
        assert np.isfinite(σ).all()
    assert (np.abs(σ[:4]) < 1e-12 * C * 1e3 * strain[:4]).all()
    _, broken = some.dissipated()
    if scheme != STATIC:
        assert broken[:4] == pytest.approx(1e-6, rel=1e-9)


@each_scheme
@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize("seed", range(3))
def test_openings_beside_a_bulk_that_yields(kind, scheme, seed):
    """Kinematic hardening far beyond its limit flows back under stresses that pull."""
    random = np.random.default_rng(seed)
    bulk = ub.ElastoPlastic(0.5, 1.0, 150.0, ub.Perzyna(0.01))
    law = kind(6.0, 0.2)
    some = Bars(200, bulk, law, scheme)
    for strain in histories(200, seed=seed, size=0.5):
        σ = some.step(strain + random.uniform(-0.1, 0.1, 200))
        assert np.isfinite(σ).all()
    assert (some["opening"] > 0).any()
    assert (some["accumulated"] > 0).any()
