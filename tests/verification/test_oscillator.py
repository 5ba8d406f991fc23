# SPDX-License-Identifier: MIT
"""A mass on a bar that yields: elastic-perfectly plastic, and hardening; all [closed].

The bar is one massless cell, so that the motion is that of one degree of freedom with stiffness
k = EA/L.  After a blow that gives the mass the velocity v0, energy alone says how far it comes:
m v0²/2 = k u_y²/2 + N_y (u - u_y) + k_t (u - u_y)²/2, with k_t what hardening leaves of k.
"""

import math
from itertools import pairwise

import numpy as np
import pytest
from helpers import assert_balanced
from scenes import clamped

import ufl_beam as ub

# A clamped bar of one cell whose free end alone gets the velocity is an oscillator.
pytestmark = pytest.mark.filterwarnings("ignore:Velocity of beam. Clamped:ufl_beam.ModelWarning")

EA, LENGTH, MASS, N_Y = 200.0, 2.0, 1.0, 1.0  # N, m, kg, N
STIFFNESS = EA / LENGTH  # N/m
U_Y = N_Y / STIFFNESS  # m
OMEGA = math.sqrt(STIFFNESS / MASS)  # rad/s
PERIOD = 2 * math.pi / OMEGA  # s


def bar(law):
    section = ub.Section(EA=EA, GA=EA, EI=EA, axial=law)
    return ub.Beam((0, 0), (LENGTH, 0), section, cells=1)


def struck(v0, steps, law=None, *, periods=4, scheme=None):
    """Times over the period, displacements over u_y, and the solution."""
    beam = bar(law or ub.ElastoPlastic(N_Y))
    scene = clamped(
        beam,
        ub.PrescribedDisplacement(beam.end, v=0, psi=0),
        masses=[ub.PointMass(beam.end, MASS)],
        initial=[ub.Velocity((beam,), linear=(v0, 0))],
    )
    solution = ub.simulate(
        scene, scheme or ub.EnergyMomentum(), t=(0, periods * PERIOD), dt=PERIOD / steps
    )
    return solution.times / PERIOD, solution.displacement(beam.end)[:, 0] / U_Y, solution


def ductility(v0, kt=0.0):
    """[closed] Largest displacement over u_y; ``kt`` is the tangent over the stiffness."""
    energy = (v0 / (OMEGA * U_Y)) ** 2  # over k u_y²/2
    if kt == 0:
        return (1 + energy) / 2
    return 1 + (-1 + math.sqrt(1 + kt * (energy - 1))) / kt


@pytest.mark.parametrize("speed", [1.5, 3.0, 6.0])
@pytest.mark.parametrize("steps", [50, 200, 800])
def test_perfectly_plastic(steps, speed):
    """Ductility (1 + (v0/v_y)²)/2; what remains is u_max - u_y, with u_y to both sides of it.

    Of second order in φ = ω dt: that yielding begins within a step makes an overstress of at most
    speed φ/2 during φ; the peak falls between two steps, φ²/8 u_y below at most; and flow ends
    within a step in which the mass moves by φ² u_y or less, so that N_y is missed by so much.
    """
    φ = 2 * math.pi / steps
    _, u, solution = struck(speed * OMEGA * U_Y, steps, periods=2)
    μ, slack = ductility(speed * OMEGA * U_Y), φ**2 * (1 + speed / 2)
    assert u.max() == pytest.approx(μ, rel=0, abs=slack)
    turn = np.argmax(u[: 5 * steps // 4])
    after = u[turn:]
    assert (after.max() + after.min()) / 2 == pytest.approx(μ - 1, rel=0, abs=slack)
    assert (after.max() - after.min()) / 2 == pytest.approx(1, rel=0, abs=(1 + 1 / 8) * φ**2)
    plastic = solution.energy.lost["plastic"] / (N_Y * U_Y)
    assert plastic[-1] == pytest.approx(μ - 1, rel=0, abs=slack)
    assert np.ptp(plastic[turn + 1 :]) == 0
    assert_balanced(solution.energy)


def test_elastic_below_yield():
    """A blow of 0.99 v_y dissipates nothing."""
    _, u, solution = struck(0.99 * OMEGA * U_Y, 400)
    assert np.abs(u).max() <= 0.99 * (1 + 1e-9)
    assert solution.energy.lost["plastic"][-1] == 0


def test_vibration_about_the_residual():
    """After the mass turned, a cosine of period T about u_max - u_y.

    The midpoint rule has the period T (1 + φ²/12); in three periods its phase is late by
    6π φ²/12, and the peak is placed to half a step's square, φ²/8.
    """
    steps = 400
    φ = 2 * math.pi / steps
    t, u, _ = struck(3 * OMEGA * U_Y, steps)
    turn = (math.asin(1 / 3) + math.sqrt(9 - 1)) / (2 * math.pi)  # elastic, then plastic until v=0
    after = t > turn + 1 / steps
    closed = ductility(3 * OMEGA * U_Y) - 1 + np.cos(2 * math.pi * (t[after] - turn))
    assert np.abs(u[after] - closed).max() <= 6 * math.pi * φ**2 / 12 + 5 * φ**2


@pytest.mark.parametrize("kind", ["isotropic", "kinematic"])
def test_hardening(kind):
    """Bilinear: the first excursion is the same for both kinds; the ledger closes."""
    H = EA / 9  # the tangent is a tenth of the stiffness
    v0, steps = 3 * OMEGA * U_Y, 400
    _, u, solution = struck(v0, steps, ub.ElastoPlastic(N_Y, **{kind: H}))
    φ = 2 * math.pi / steps
    assert u[: steps // 2].max() == pytest.approx(ductility(v0, 0.1), rel=0, abs=3 * φ**2)
    assert_balanced(solution.energy)


# -- loops ---------------------------------------------------------------------------------------

TURNS = ub.Table([0, 1, 2, 3, 4, 5], [0, 4, -4, 4, -4, 4])
"""Imposed elongation over u_y."""


def loop(law, scheme, steps=80):
    """Elongations over u_y and forces over N_y."""
    beam = bar(law)
    pull = ub.PrescribedDisplacement(beam.end, u=lambda t: U_Y * TURNS(t), v=0, psi=0)
    scene = clamped(beam, pull)
    solution = ub.simulate(scene, scheme, t=(0, 5), dt=1 / steps)
    return (
        solution.displacement(beam.end)[:, 0] / U_Y,
        solution.section_forces_at(beam.end)[:, 0] / N_Y,
        solution,
    )


def by_return_map(u, *, H=0.0, B=0.0):
    """[closed] Forces over N_y of a bilinear bar under the elongations over u_y; moduli over EA."""
    p = back = ξ = 0.0
    forces = []
    for x in u:
        over = abs(x - p - back) - 1 - H * ξ
        if over > 0:
            γ = over / (1 + H + B) * np.sign(x - p - back)
            p, back, ξ = p + γ, back + B * γ, ξ + abs(γ)
        forces.append(x - p)
    return np.array(forces)


def yields_at(u, N):
    """(forces at which each branch turns, forces at which it leaves the elastic line)."""
    ends = [0, 80, 240, 400, 560, 720][: 1 + len(u) // 160]
    starts, kinks = [], []
    for a, b in pairwise(ends[1:]):
        slope = np.diff(N[a : b + 1]) / np.diff(u[a : b + 1])
        elastic = slope > 0.999
        starts.append(N[a])
        kinks.append(N[a + int(np.argmin(elastic))])
    return np.array(starts), np.array(kinks)


@pytest.mark.parametrize("scheme", [ub.Static(), ub.EnergyMomentumStatic()])
@pytest.mark.parametrize("kind", ["isotropic", "kinematic"])
def test_kinematic_loops_close(kind, scheme):
    """Kinematic hardening keeps the elastic range at 2 N_y, and the loop closes (Bauschinger).

    Isotropic hardening lets it grow by twice the hardening.  Increments are so chosen that all
    laws are met at the ends of steps: forces to round-off, elastic ranges to a step.
    """
    h = 1 / 9
    u, N, solution = loop(ub.ElastoPlastic(N_Y, **{kind: h * EA}), scheme)
    closed = by_return_map(u, **{"H" if kind == "isotropic" else "B": h})
    np.testing.assert_allclose(N, closed, rtol=0, atol=1e-10)
    turns, kinks = yields_at(u, N)
    step = 8 / 80
    ranges = np.abs(kinks - turns)
    if kind == "kinematic":
        np.testing.assert_allclose(ranges, 2, rtol=0, atol=step)
        np.testing.assert_allclose(N[-1], N[80], rtol=1e-10)
    else:
        np.testing.assert_allclose(ranges, 2 * np.abs(turns), rtol=0, atol=step)
        assert (np.diff(ranges) > 0.1).all()
    if scheme != ub.Static():
        assert_balanced(solution.energy)
