# SPDX-License-Identifier: MIT
"""Every kind of load, support and axis against statics by hand, all [closed].

Small loads, 1e-5 in units of EI/L², have nonlinear terms of 1e-10 of the result.
"""

import math

import numpy as np
import pytest
from convergence.study import extrapolated, orders, romberg
from scenes import beam_on_roller, cantilever, clamped, quarter_circle, rigid_chain
from scipy.special import ellipeinc, ellipj, ellipk

import ufl_beam as ub

STOCKY = ub.Section(EA=100.0, GA=50.0, EI=1.0, rhoA=2.0)
EA, GA, EI = STOCKY.EA, STOCKY.GA, STOCKY.EI
SMALL, TINY = 1e-5, 1e-7
ARC = 1.7
"""Radius; m."""


def at_tip(scene, **options):
    """(u, v, ψ) of the end of the first beam under the full load."""
    solution = ub.simulate(scene, ub.Static(), t=(0, 1), dt=0.25, **options)
    return solution.displacement(scene.beams[0].end)[-1]


# -- loads along a beam --------------------------------------------------------------------------

LENGTH = 1.5
ALONG = {
    "fx": ((SMALL, 0), 0, (SMALL * LENGTH**2 / (2 * EA), 0, 0)),
    "fy": (
        (0, SMALL),
        0,
        (0, SMALL * (LENGTH**4 / (8 * EI) + LENGTH**2 / (2 * GA)), SMALL * LENGTH**3 / (6 * EI)),
    ),
    "moment": ((0, 0), SMALL, (0, SMALL * LENGTH**3 / (3 * EI), SMALL * LENGTH**2 / (2 * EI))),
}


@pytest.mark.parametrize("kind", ALONG)
def test_line_load_on_a_cantilever(kind):
    """The errors of a mesh are multiples of h² and h⁴, so Romberg's limit of three is exact."""
    force, moment, exact = ALONG[kind]
    exact = np.array(exact)

    def line_load(beam):
        return ub.LineLoad(beam, force=force, moment=moment, amplitude=ub.ramp(1.0))

    scenes = (cantilever(STOCKY, length=LENGTH, cells=n, loads=[line_load]) for n in (2, 4, 8))
    limit = romberg(*(at_tip(scene) for scene in scenes))
    np.testing.assert_allclose(limit[exact != 0], exact[exact != 0], rtol=1e-9)
    assert np.abs(limit[exact == 0]).max() <= 10 * SMALL**2


def test_gravity_on_a_cantilever():
    """Weight of the beam, ρA g per length, and of a mass at its end."""
    g, mass = 1e-5, 0.7

    def scene(cells):
        beam = ub.Beam((0, 0), (LENGTH, 0), STOCKY, cells=cells)
        weight, block = ub.Gravity((0, -g), amplitude=ub.ramp(1.0)), ub.PointMass(beam.end, mass)
        return clamped(beam, loads=[weight], masses=[block])

    q, P = STOCKY.rhoA * g, mass * g
    bending = q * LENGTH**4 / (8 * EI) + P * LENGTH**3 / (3 * EI)
    shear = q * LENGTH**2 / (2 * GA) + P * LENGTH / GA
    limit = romberg(*(at_tip(scene(n)) for n in (2, 4, 8)))
    assert limit[1] == pytest.approx(-bending - shear, rel=2e-9)
    assert limit[2] == pytest.approx(-q * LENGTH**3 / (6 * EI) - P * LENGTH**2 / (2 * EI), rel=2e-9)


# -- follower load -------------------------------------------------------------------------------


def follower_elastica(a):
    """(x, y, ψ) of the end under a force a = PL²/EI that stays normal to the end section.

    With χ = ψ_end - ψ and σ from the end, χ'' = a cos χ, χ(0) = χ'(0) = 0: a pendulum,
    sin χ = cn²(√a σ - K | 1/2).  ∫cos χ = χ'(1)/a, and ∫sin χ = ∫cn² from 2 E(am) - σ√a.
    """
    root, K = math.sqrt(a), ellipk(0.5)
    sn, cn, _, am = ellipj(root - K, 0.5)
    _, _, _, am_start = ellipj(-K, 0.5)
    ψ = math.pi / 2 + 2 * math.asin(sn / math.sqrt(2))
    cosines = math.sqrt(2 / a) * abs(cn) * math.copysign(1, math.sin(ψ)) if ψ else 0.0
    sines = (2 * (ellipeinc(am, 0.5) - ellipeinc(am_start, 0.5)) - root) / root
    return (
        math.cos(ψ) * cosines + math.sin(ψ) * sines,
        math.sin(ψ) * cosines - math.cos(ψ) * sines,
        ψ,
    )


def test_follower_force_at_the_end():
    """Large deflections: Richardson's limit to the order that it leaves, as for the elastica."""
    loads = np.array([1.0, 5.0, 10.0, 13.0])
    exact = np.array([follower_elastica(a) for a in loads])

    def computed(cells):
        scene = cantilever(cells=cells, force=(0, 1), time=lambda t: t, load=ub.FollowerLoad)
        solution = ub.simulate(scene, ub.Static(), t=(0, 13), dt=0.25)
        rows = np.rint(loads / 0.25).astype(int)
        return solution.displacement(scene.beams[0].end)[rows] + (1, 0, 0)

    coarse, medium, fine = (computed(n) for n in (32, 64, 128))
    before, limit = extrapolated(coarse, medium), extrapolated(medium, fine)
    tolerance = 2 / 15 * np.abs(limit - before).max(axis=1) + 1e-8 * loads
    assert (np.abs(limit - exact).max(axis=1) <= tolerance).all()


# -- roller --------------------------------------------------------------------------------------


@pytest.mark.parametrize("angle", [-0.7, 2.5])
def test_roller_at_an_angle(angle):
    """Large deflections: the end stays on the line, and all forces on the deformed beam balance."""
    along = np.array([math.cos(angle), math.sin(angle)])
    across = np.array([-along[1], along[0]])
    force, s = np.array([1.0, -3.0]), 0.4
    scene = beam_on_roller(STOCKY, along=tuple(along), force=tuple(force), s=s)
    beam, (pin, roller) = scene.beams[0], scene.supports
    solution = ub.simulate(scene, ub.Static(), t=(0, 1), dt=0.1)

    assert abs(solution.displacement(beam.end)[-1, :2] @ across) <= 1e-15
    assert np.abs(solution.displacement(beam.end)[-1]).max() > 0.1
    at_pin, at_roller = solution.reaction(pin)[-1], solution.reaction(roller)[-1]
    assert abs(at_roller[:2] @ along) <= 1e-9
    np.testing.assert_allclose(at_pin[:2] + at_roller[:2] + force, 0, atol=1e-9)
    moment = 0.0
    for place, (fx, fy) in ((beam.at(s), force), (beam.end, at_roller[:2])):
        x, y = solution.position(place)[-1]
        moment += x * fy - y * fx
    assert abs(moment) <= 1e-9
    assert at_pin[2] == at_roller[2] == 0


# -- curved and cornered axes --------------------------------------------------------------------


def test_quarter_circle():
    """Straight cells on an arc: second order, and Romberg's limit of the even powers.

    By Castigliano with M = P R cos θ, N = -P cos θ, V = P sin θ at the angle θ from the clamp.
    """
    P, R = TINY, ARC
    exact = (
        P * R / 2 * (-(R**2) / EI + 1 / EA - 1 / GA),
        -P * R * math.pi / 4 * (R**2 / EI + 1 / EA + 1 / GA),
        P * R**2 / EI,
    )
    runs = [
        at_tip(quarter_circle(STOCKY, radius=ARC, cells=n, force=(0, -TINY)))
        for n in (4, 8, 16, 32)
    ]
    errors = np.abs(np.array(runs) - exact)
    for component in range(3):
        # The fourth-order part is a tenth of the squared angle of a cell: 0.015 in the coarsest.
        np.testing.assert_allclose(orders(errors[:, component]), 2, rtol=0, atol=0.02)
    # Nonlinear terms are of first order in the load: the arc opens.
    np.testing.assert_allclose(romberg(*runs), exact, rtol=TINY * ARC**2)


def test_polyline_is_two_beams_rigidly_joined():
    """A corner of 1 m by 1 m, bent far: the same to the solver's tolerance, here round-off."""
    stick = ub.Beam.polyline([(0, 0), (0, 1), (1, 1)], STOCKY, cells=8)
    post = ub.Beam((0, 0), (0, 1), STOCKY, cells=4, name="post")
    arm = ub.Beam((0, 1), (1, 1), STOCKY, cells=4, name="arm")

    def load(beam):
        return [ub.PointLoad(beam.end, force=(-1, -3), amplitude=ub.ramp(1.0))]

    one = clamped(stick, loads=load(stick))
    two = rigid_chain([post, arm], supports=[ub.Clamped(post.start)], loads=load(arm))
    tight = ub.Newton(rtol=1e-13)
    of_one, of_two = (
        ub.simulate(scene, ub.Static(), t=(0, 1), dt=0.1, newton=tight) for scene in (one, two)
    )
    assert np.abs(of_one.displacement(stick.end)[-1, :2]).max() > 0.5
    for here, there in ((stick.at(0.5), post.end), (stick.end, arm.end)):
        np.testing.assert_allclose(
            of_one.displacement(here), of_two.displacement(there), rtol=0, atol=1e-11
        )
    parts = np.vstack([of_two.section_forces(post), of_two.section_forces(arm)])
    np.testing.assert_allclose(of_one.section_forces(stick), parts, rtol=0, atol=1e-9)
