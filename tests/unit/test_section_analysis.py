# SPDX-License-Identifier: MIT
"""Moment-curvature and interaction of N and M: closed forms, and beams in runs."""

import math
from dataclasses import dataclass

import numpy as np
import pytest
from helpers import raises
from scenes import clamped
from user_laws import Dashpot

import ufl_beam as ub
import ufl_beam.structures as st

f = ub.extend.law_functions


@dataclass(frozen=True)
class NoTension(ub.extend.MaterialLaw):
    """Linear in compression; bears no tension."""

    def stress(self, strain, state):
        return self.C * f.smaller(strain, 0.0)

    def elastic_energy(self, strain, state):
        return self.C * f.smaller(strain, 0.0) ** 2 / 2


E, b, h, LIMIT = 200e9, 0.1, 0.2, 250e6
K_YIELD, M_PLASTIC, N_PLASTIC = 2 * LIMIT / (E * h), LIMIT * b * h**2 / 4, LIMIT * b * h


def rectangle(number=40, law=None, **more):
    fibres = ub.Fibres(law or ub.ElastoPlastic(LIMIT), number=number, **more)
    return ub.Section.rectangle(b, h, E=E, nu=0.3, fibres=fibres)


def concrete(number, *bars, steel=None):
    """30 cm by 50 cm without tension, with bars (y, A)."""
    steel = ub.Fibres(steel or ub.ElastoPlastic(500e6))
    plain = ub.Section.rectangle(
        0.3, 0.5, E=30e9, nu=0.2, fibres=ub.Fibres(NoTension(), number=number)
    )
    return plain.reinforced(*zip(*bars, strict=True), E=200e9, fibres=steel)


# -- moment and curvature --------------------------------------------------------------------------


def test_plastic_rectangle():
    """[closed] M = Mp (1 - (κy/κ)²/3) beyond first yield; layers err by their thickness squared."""
    κ = K_YIELD * np.array([0.0, 0.5, 1.0, 1.5, 2.0, 5.0, 20.0])
    exact = np.where(
        κ > K_YIELD, 1 - (K_YIELD / np.maximum(κ, K_YIELD)) ** 2 / 3, κ / K_YIELD / 1.5
    )
    for n in (10, 40):
        result = st.moment_curvature(rectangle(n), κ)
        # A layer has one stress: the yielded depth errs by half a layer at most
        assert np.abs(result.moment / M_PLASTIC - exact).max() < 1.5 / n**2
        assert np.abs(result.strain).max() < 1e-15
        assert result.N.tolist() == [0.0] * len(κ)


@pytest.mark.parametrize("N", [-0.5, 0.8])
def test_plastic_moment_under_axial_force(N):
    """[closed] M = Mp (1 - (N/Np)²); the dissipated energy is the work that is not stored."""
    κ = K_YIELD * np.linspace(0, 40, 81)
    result = st.moment_curvature(rectangle(160), κ, N=N * N_PLASTIC)
    # At 40 κy the elastic core, 1/40 of the depth, and half a layer lower the moment
    error = (1 / 40) ** 2 / 3 + 1.5 / 160
    assert result.moment[-1] / M_PLASTIC == pytest.approx(1 - N**2, abs=error / 4)
    # Backward Euler, first order in the step; at constant N its work is N times the strain
    M, ε = result.moment, result.strain
    work = np.sum((M[1:] + M[:-1]) / 2 * np.diff(κ)) + N * N_PLASTIC * (ε[-1] - ε[0])
    before = (N * N_PLASTIC) ** 2 / (2 * E * b * h)
    stored = E * b * h * (LIMIT / E) ** 2 / 2  # all fibres are at their limit, up to the core
    assert result.dissipated[-1] == pytest.approx(work + before - stored, rel=0.01)


def test_cracked_concrete():
    """[closed] Depth x of compression: b x²/2 = n As (d - x), with n = Es/Ec."""
    As, d, n = 1.5e-3, 0.45, 200 / 30
    x = (-n * As + math.sqrt((n * As) ** 2 + 2 * 0.3 * n * As * d)) / 0.3
    EI = 30e9 * (0.3 * x**3 / 3 + n * As * (d - x) ** 2)
    κ = np.linspace(0, 3e-3, 4)
    section = concrete(50, (-0.2, As))
    result = st.moment_curvature(section, κ)
    # One layer contains the neutral axis; the bar displaces concrete that bears nothing
    assert result.moment == pytest.approx(EI * κ, rel=1 / 50**2 / (x / 0.5) ** 2)
    neutral = (section.fibres.axis + result.strain / np.maximum(κ, 1e-9))[1:]
    assert 0.25 - neutral == pytest.approx(np.full(3, x), abs=0.5 / 50)
    assert not result.dissipated.any()


def test_a_beam_in_pure_bending():
    """A cell of a run, given its curvatures, has the same M, axial strain and losses."""
    steel = st.ArmstrongFrederick(400e6, 20e9, 100.0)
    section = concrete(20, (-0.2, 1.5e-3), (0.2, 1.5e-3), steel=steel)
    member = ub.Beam((0, 0), (1, 0), section, cells=1)
    turns = 0.02 * np.sin(np.linspace(0, 2 * np.pi, 41))
    end = ub.PrescribedDisplacement(member.end, psi=ub.Table(range(41), turns))
    solution = ub.simulate(clamped(member, end), ub.Static(), t=(0, 40), dt=1.0)
    assert "in 40 steps" in repr(solution)  # none is divided
    ε, κ = solution.strains_at(member.at(0.5))[:, [0, 2]].T
    cell = solution.material_at(member.at(0.5))
    result = st.moment_curvature(section, κ, N=cell.forces[:, 0])
    M = cell.forces[:, 2]
    assert np.abs(M).max() > 1e5
    assert np.abs(result.moment - M).max() < 1e-10 * np.abs(M).max()
    assert np.abs(result.strain - ε).max() < 1e-10 * np.abs(ε).max()
    assert result.dissipated == pytest.approx(cell.plastic, rel=1e-9, abs=1e-9)


def test_other_sections():
    """[closed] Elastic: M = EI κ.  A hinge takes the curvature of its cell; Maxwell creeps."""
    plain = {"EA": 4e9, "GA": 1e9, "EI": 1.4e7}
    κ = np.array([0.0, 1e-3, 2e-3])
    result = st.moment_curvature(ub.Section(**plain), κ, N=[0.0, 1e6, -1e6])
    assert result.moment.tolist() == (1.4e7 * κ).tolist()
    assert result.strain == pytest.approx([0.0, 2.5e-4, -2.5e-4])
    hinge = ub.Section(**plain, hinge=ub.LinearSoftening(2e4, 400.0))
    opened = st.moment_curvature(hinge, [0.0, 1.0], length=0.1)
    # All of the fracture energy; in a cell of 0.1 m
    assert (opened.moment[-1], opened.dissipated[-1]) == pytest.approx((0.0, 400.0 / 0.1))
    creeps = ub.Section(**plain, bending=Dashpot(1.4e9))
    slow = st.moment_curvature(creeps, [1e-3, 1e-3], dt=10.0)
    # Backward Euler: M1 = EI κ / (1 + dt EI/η), M2 = M1 / (1 + dt EI/η)
    assert slow.moment == pytest.approx([1.4e4 / 1.1, 1.4e4 / 1.1**2])


def test_sections_that_cannot_bear_n():
    with raises("cannot bear N = 5e+06 N at the curvature 0 1/m"):
        st.moment_curvature(rectangle(), [0.0, 1e-3], N=1.001 * N_PLASTIC)
    with raises("the section has cracks or a hinge", "length= (m)"):
        st.moment_curvature(rectangle(softening=ub.Softening(1e8, 1e3)), [0.0, 1e-3])
    # Layers crack one after the other, until too few are left for the tension
    cracks = rectangle(10, ub.ElastoPlastic(math.inf), softening=ub.Softening(1e8, 1e3))
    with pytest.warns(ub.ModelWarning, match="cannot bear N = 1e.06 N at the curvature"):
        result = st.moment_curvature(cracks, np.linspace(0, 0.05, 51), N=1e6, length=0.01)
    assert 0 < len(result.moment) < 51
    assert np.isfinite(result.moment).all()


def test_pictures_show_the_results():
    result = st.moment_curvature(rectangle(10), K_YIELD * np.linspace(0, 3, 7), N=-1e6)
    diagram = st.interaction_diagram(rectangle(10), (0.01, 0.01), points=16)
    for shown, x, y in ((result, "curvature", "moment"), (diagram, "M", "N")):
        (axes,) = ub.plot(shown).axes
        (line,) = (line for line in axes.lines if len(line.get_xdata()) > 2)
        drawn = np.column_stack([getattr(shown, x), getattr(shown, y)])
        assert np.array_equal(line.get_xydata(), drawn)
    assert axes.yaxis_inverted()  # compression is at the top


# -- interaction -----------------------------------------------------------------------------------


def test_interaction_of_a_rectangle():
    """[closed] |M|/Mp = 1 - (N/Np)², as limit strains grow; layers err by 1/n²."""
    for n in (10, 40):
        diagram = st.interaction_diagram(rectangle(n), (1.0, 1.0))
        exact = 1 - (diagram.N / N_PLASTIC) ** 2
        assert np.abs(np.abs(diagram.M) / M_PLASTIC - exact).max() < 1.5 / n**2
        assert (diagram.M[0], diagram.N[0]) == pytest.approx((0.0, N_PLASTIC), abs=1e-9 * N_PLASTIC)
        assert (diagram.M[-1], diagram.N[-1]) == (diagram.M[0], diagram.N[0])
    for end in (diagram.N.min(), diagram.N.max()):
        assert np.allclose(diagram.moments(end), 0.0, atol=1e-6 * diagram.M.max())
    for N in (-0.7, 0.4):
        low, high = diagram.moments(N * N_PLASTIC)
        assert high / M_PLASTIC == pytest.approx(1 - N**2, abs=1.5 / 40**2)
        assert low == pytest.approx(-high, rel=1e-9)
    with raises("moments: N = 5.05e+06 N is beyond the diagram"):
        diagram.moments(1.01 * N_PLASTIC)


def test_interaction_of_reinforced_concrete():
    """[closed] Pure compression and tension, and the balanced point, by hand."""
    As, d = 1.5e-3, 0.45
    section = concrete(100, (-0.2, As), (0.2, As))
    steel, plain = section.fibres.fibres
    limits = {plain: (0.001, math.inf), steel: (0.02, 0.0025)}
    diagram = st.interaction_diagram(section, limits)
    # Concrete at 0.001 has 30 MPa, steel 200 MPa; in tension steel has 500 MPa
    assert diagram.N.min() == pytest.approx(-30e6 * (0.15 - 2 * As) - 200e6 * 2 * As, rel=1e-9)
    assert diagram.N.max() == pytest.approx(500e6 * 2 * As, rel=1e-9)
    # Balanced: 0.001 at the upper edge, 0.0025 in the lower bar: x = 2/7 d
    x = d / 3.5
    stress = 200e9 * 0.001 * (x - 0.05) / x
    displaced = 30e9 * 0.001 * (x - 0.05) / x
    N = -30e6 * 0.3 * x / 2 - (stress - displaced) * As + 500e6 * As
    M = 30e6 * 0.3 * x / 2 * (0.25 - x / 3) + (stress - displaced) * As * 0.2 + 500e6 * As * 0.2
    # Limits hold at the centroids of layers of 5 mm, and angles have steps of a degree
    error = np.hypot((diagram.N - N) / diagram.N.min(), (diagram.M - M) / M)
    assert error.min() < 0.03


def test_paths_of_laws_with_curved_branches():
    """Strains grow in steps: fewer of them give other stresses, by the first order of the step."""
    section = rectangle(10, st.ArmstrongFrederick(LIMIT, 40e9, 300.0))
    M = [st.interaction_diagram(section, (0.01, 0.01), steps=n).M.max() for n in (20, 40, 80)]
    assert (M[1] - M[0]) / (M[2] - M[1]) == pytest.approx(2.0, rel=0.15)


@pytest.mark.parametrize("limit", [0.004, 0.01])
def test_interaction_of_concrete_that_softens(limit):
    """[calc] The largest moment at each N, by trial of all planes of strains within the limit.

    Concrete reaches its strength at the strain 0.002, before the limit, in a step of both diagrams.
    Peaks of the moment are between steps: their error, in the second order, is less than 1 %.
    """
    steel = ub.Fibres(ub.ElastoPlastic(500e6))
    law = st.KentPark(30e6, residual=6e6, ultimate=0.006)
    plain = ub.Section.rectangle(0.4, 0.5, E=30e9, nu=0.2, fibres=ub.Fibres(law, number=40))
    section = plain.reinforced([-0.2, 0.2], [1.5e-3] * 2, E=200e9, fibres=steel)
    diagram = st.interaction_diagram(section, (limit, 0.05))
    # [closed] All concrete is at its strength, and steel at 400 MPa
    assert diagram.N.min() == pytest.approx(-30e6 * (0.2 - 3e-3) - 400e6 * 3e-3, rel=1e-9)
    y = np.append((np.arange(40) - 19.5) / 80, [-0.2, 0.2])  # layers and bars
    κ, ε = np.meshgrid(np.linspace(0, 0.05, 301), np.linspace(-limit, 0.01, 401), indexing="ij")
    strain = ε[..., None] - κ[..., None] * y
    plain = np.interp(-strain, [0.002, 0.006], [30e6, 6e6])
    c = np.clip(-strain / 0.002, 0.0, 1.0)
    plain = np.where(c < 1, 30e6 * c * (2 - c), plain)
    bars = np.clip(200e9 * strain[..., 40:], -500e6, 500e6) + plain[..., 40:]
    forces = np.concatenate([-plain[..., :40] * 0.4 * 0.5 / 40, bars * 1.5e-3], axis=2)
    N, M = forces.sum(axis=2), -forces @ y
    N[(strain[..., :40] < -limit).any(axis=2)] = np.nan
    for force in (-6e6, -4e6, -2e6, -1e6, 0.0):
        at = (N[:, :-1] - force) * (N[:, 1:] - force) < 0
        part = (force - N[:, :-1][at]) / np.diff(N)[at]
        largest = (M[:, :-1][at] + part * np.diff(M)[at]).max()
        assert diagram.moments(force) == pytest.approx((-largest, largest), rel=0.01)
    k = diagram.N.argmin()
    assert (np.diff(diagram.N[: k + 1]) <= 0).all()  # no loops
    assert (np.diff(diagram.N[k:]) >= 0).all()


def test_limits_that_are_missing():
    section = concrete(10, (0.2, 1e-3))
    steel, plain = section.fibres.fibres
    for limited, limits, words in (
        (section, {plain: (0.0035, math.inf)}, "no fibre limits the strain in tension"),
        (section, (math.inf, 0.01), "no fibre limits the strain in compression"),
        (rectangle(), {steel: (0.01, 0.01)}, "which is not in the section"),
        (ub.Section(EA=1.0, GA=1.0, EI=1.0), (0.01, 0.01), "the section has no fibres"),
    ):
        with raises(words):
            st.interaction_diagram(limited, limits)
