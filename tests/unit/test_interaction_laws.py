# SPDX-License-Identifier: MIT
"""Axial force and moment that yield together."""

import numpy as np
import pytest
from helpers import raises
from scenes import clamped

import ufl_beam as ub
import ufl_beam.structures as st
from ufl_beam.blocks.material_points import Points

EA, EI, NP, MP = 1000.0, 50.0, 10.0, 2.0
LAW = st.AxialBending(NP, MP)
each_scheme = pytest.mark.parametrize(
    "scheme", [ub.Static(), ub.EnergyMomentumStatic(0.5), ub.EnergyMomentumStatic(1.0)], ids=str
)


def section(**more):
    return ub.Section(EA=EA, GA=400.0, EI=EI, rhoA=1.0, rhoI=0.01, **more)


class Cells:
    """Cells of the section whose strains are given."""

    def __init__(self, n, scheme):
        section_points = section(interaction=LAW).section_points(None)[0]
        self.points = Points(section_points, [(0, k) for k in range(n)], np.full(n, 0.5), scheme)
        self.strain = np.zeros((n, 3))

    def return_map(self, strain):
        self.points.start(self.strain)
        self.points.begin(0.1)
        r, D = self.points.return_map(strain)
        return r.copy(), D.reshape(-1, 3, 3).copy()

    def step(self, strain):
        r, _ = self.return_map(strain)
        self.points.accept()
        self.strain = strain.copy()
        return r

    def plastic(self):
        return np.array([self.points[f"state {x}"][:, 0] for x in ("stretch", "curvature")])


def histories(n, steps):
    """Random walks of (Σ, Γ, K), up to ten times the elastic range."""
    random = np.random.default_rng(0)
    walk = np.cumsum(random.uniform(-1, 1, (steps, n, 3)), axis=0)
    return walk * [NP / EA, 0.01, MP / EI] * np.linspace(0.01, 4, n)[:, None]


@each_scheme
def test_resultants_lie_within_the_surface(scheme):
    """On it where it flows, with work on plastic strains that is not negative."""
    cells, flows = Cells(500, scheme), 0
    for strain in histories(500, 6):
        before = cells.plastic()
        r = cells.step(strain)
        excess, dp = LAW.excess(r[:, 0], r[:, 2]), cells.plastic() - before
        on = np.abs(dp).max(axis=0) > 0
        flows += on.sum()
        assert excess.max() < 1e-12
        assert np.abs(excess[on]).max() < 1e-12
        # The surface is convex and contains the origin.
        assert (r[on, 0] * dp[0][on] + r[on, 2] * dp[1][on] > 0).all()
    assert flows > 500


@each_scheme
def test_tangents_are_derivatives(scheme):
    """Against central differences, coupled in N and M."""
    cells = Cells(300, scheme)
    *before, last = histories(300, 4)
    for strain in before:
        cells.step(strain)
    _, D = cells.return_map(last)
    for k, ε in ((0, 1e-8), (2, 1e-7)):
        step = ε * np.eye(3)[k]
        central = (cells.return_map(last + step)[0] - cells.return_map(last - step)[0]) / (2 * ε)
        # Curvature of the rounded ridge times ε, away from corners; medians beside them
        assert np.median(np.abs(D[:, :, k] - central)) < 1e-6 * EA
        assert np.mean(np.abs(D[:, :, k] - central).max(axis=1) > 1e-3 * EA) < 0.02


def test_pure_resultants_reach_their_limits():
    """[closed] N = Np without curvature, M = Mp without strain, far beyond the elastic range."""
    strain = np.array([[0.1, 0.0, 0.0], [0.0, 0.0, 1.0], [-0.1, 0.0, 0.0], [0.0, 0.0, -1.0]])
    r = Cells(4, ub.Static()).step(strain)
    assert r[:, [0, 2]] == pytest.approx(np.array([[NP, 0], [0, MP], [-NP, 0], [0, -MP]]), abs=1e-9)


def test_a_column_under_axial_force():
    """[closed] Beyond yielding M = Mp (1 - n²) under a constant force n Np; rounded by 0.01."""
    beam = ub.Beam((0, 0), (1, 0), section(interaction=LAW), cells=1)
    press = ub.PointLoad(beam.end, force=(-0.6 * NP, 0.0), amplitude=lambda t: min(t, 1.0))
    turn = ub.PrescribedDisplacement(beam.end, psi=lambda t: 0.4 * max(t - 1.0, 0.0))
    scene = clamped(beam, turn, loads=[press])
    run = ub.simulate(scene, ub.Static(), t=(0, 2), dt=0.05)
    N, _, M = run.material_at(beam.end).forces[-1]
    assert LAW.excess(N, M) == pytest.approx(0.0, abs=1e-9)
    # The force turns with the axis, by 0.2 rad in the middle.
    assert pytest.approx(MP * (1 - (N / NP) ** 2), rel=0.02) == M


COUPLES = "couples the resultants NM"


@pytest.mark.parametrize(
    ("make", "says"),
    [
        (lambda: section(bending=LAW), [COUPLES + "; use it as Section("]),
        (lambda: section(interaction=ub.ElastoPlastic(1.0)), ["is no law of N and M together"]),
        (
            lambda: section(interaction=LAW, bending=ub.ElastoPlastic(1.0)),
            ["bending beside interaction"],
        ),
        (lambda: section(interaction=LAW, hinge=ub.Softening(1.0, 1.0)), ["hinge beside interact"]),
        (lambda: ub.Spring(1.0, law=LAW), ["Spring: law = ", COUPLES]),
        (lambda: ub.Fibres(LAW), ["Fibres: law = ", COUPLES]),
    ],
)
def test_bad_interaction_laws_are_refused(make, says):
    with raises(*says):
        make()
