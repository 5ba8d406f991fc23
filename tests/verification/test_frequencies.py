# SPDX-License-Identifier: MIT
"""Natural frequencies, damping ratios and buckling loads against closed forms and a Ritz solution.

Sources: S. P. Timoshenko, D. H. Young, W. Weaver, "Vibration Problems in Engineering", 4th ed.
1974, chapter 5, for beams; S. P. Timoshenko, J. M. Gere, "Theory of Elastic Stability", 2nd ed.
1961, chapter 2, for columns; V. V. Bolotin, "Nonconservative Problems of the Theory of Elastic
Stability", 1963, for Beck's column; A. D. Wright et al., "Vibration modes of centrifugally
stiffened beams", J. Appl. Mech. 49 (1982), for the rotating beam.
"""

import math
from dataclasses import replace

import numpy as np
import pytest
import ufl
from convergence.study import extrapolated, romberg
from numpy.polynomial import Legendre
from scenes import clamped
from scipy.linalg import eigh
from scipy.optimize import brentq

import ufl_beam as ub

SLENDER = ub.Section(EA=1e8, GA=1e8, EI=1.0, rhoA=1.0, rhoI=1e-8)
"""On a length of 1: shear, axial strain and rotary inertia change (βL)⁴ by (βL)²/1e8."""

STIFF = ub.Section(EA=1e9, GA=1e9, EI=1.0, rhoA=1.0)
CUBIC = ub.Mesh(degree=3)

ENDS = {
    "clamped-free": (lambda b: [ub.Clamped(b.start)], (1.875104, 4.694091, 7.854757), 0.25),
    "clamped-clamped": (
        lambda b: [ub.Clamped(b.start), ub.PrescribedDisplacement(b.end, v=0, psi=0)],
        (4.730041, 7.853205, 10.995608),
        4.0,
    ),
    "free-free": (lambda b: [], (0, 0, 0, 4.730041, 7.853205, 10.995608), None),
    "pinned-pinned": (
        lambda b: [ub.Pinned(b.start), ub.Roller(b.end)],
        (math.pi, 2 * math.pi, 3 * math.pi),
        1.0,
    ),
    "clamped-pinned": (
        lambda b: [ub.Clamped(b.start), ub.Roller(b.end)],
        (3.926602, 7.068583, 10.210176),
        (brentq(lambda x: math.tan(x) - x, 4.4, 4.6) / math.pi) ** 2,
    ),
}
"""Supports; βL of the first modes, [closed] to the digits given; buckling load over π² EI/L²."""


def supported(cells, ends, section=SLENDER, **parts):
    beam = ub.Beam((0, 0), (1, 0), section, cells=cells)
    return ub.Scene([beam], supports=ENDS[ends][0](beam), **parts)


@pytest.mark.parametrize("cells", [32, 128])
@pytest.mark.parametrize("ends", ENDS)
def test_slender_beams(ends, cells):
    """[closed] βL to half a unit of its last digit, with EA L²/EI = 1e9.

    Entries of the stiffness are some 1e14 times EI/L³ with 128 cells; products with the matrix
    would leave 1e-3.
    """
    β = np.array(ENDS[ends][1])
    found = ub.modes(supported(cells, ends, STIFF), len(β), mesh=CUBIC).omega
    np.testing.assert_allclose(np.sqrt(found), β, rtol=5e-7)
    assert (found[β == 0] == 0.0).all()


def test_a_stocky_beam_is_timoshenkos():
    """[closed] Pinned at both ends v = sin kx, ψ = cos kx: two frequencies for each k = nπ/L.

    Tolerance: (3π/40)⁴/100 after one extrapolation.
    """
    EI, GA, ρA, ρI = 1.0, 60.0, 1.0, 0.03
    section = ub.Section(EA=1e7, GA=GA, EI=EI, rhoA=ρA, rhoI=ρI)
    wanted = []
    for n in (1, 2, 3):
        k = n * math.pi
        K = [[GA * k**2, -GA * k], [-GA * k, EI * k**2 + GA]]
        wanted.append(math.sqrt(eigh(K, np.diag([ρA, ρI]), eigvals_only=True)[0]))
    runs = (ub.modes(supported(n, "pinned-pinned", section), 3).omega for n in (20, 40))
    np.testing.assert_allclose(extrapolated(*runs), wanted, rtol=3e-5)


# -- about loaded states -------------------------------------------------------------------------


def about_statics(scene, n):
    return ub.modes(scene, n, at=ub.simulate(scene, ub.Static(), t=(0, 1), dt=1))


def pulled(cells, N, n=3):
    """Modes of a pinned beam that bears the axial force N."""
    scene = supported(cells, "pinned-pinned")
    load = ub.PointLoad(scene.beams[0].end, force=(N, 0))
    return about_statics(replace(scene, loads=[load]), n)


@pytest.mark.parametrize("part", [-0.999, -0.5, 3.0, 100.0])
def test_axial_force(part):
    """[closed] ωₙ² = (nπ)⁴ + N (nπ)², N = part of π²: the first one vanishes as -N comes to π².

    Tolerance: a part of the sum of both terms, 3e-6 by the mesh, and the stretch N/EA.
    """
    n = np.array([1, 2, 3])
    stiffness, force = (n * math.pi) ** 4, part * math.pi**2 * (n * math.pi) ** 2
    found = romberg(*(pulled(cells, part * math.pi**2).omega ** 2 for cells in (20, 40, 80)))
    tolerance = 3e-6 + 2 * abs(part) * math.pi**2 / 1e8
    assert np.all(np.abs(found - stiffness - force) < tolerance * (stiffness + np.abs(force)))


@pytest.mark.filterwarnings("ignore:the equilibrium at t = 1 s is unstable:ufl_beam.ModelWarning")
def test_beyond_buckling_it_grows():
    """[closed] s² = (P - π²) π² > 0: damping ratio -1, not an oscillation."""
    grown = pulled(80, -1.01 * math.pi**2, n=1)
    assert grown.damping[0] == -1.0
    # P π² and π⁴ each to the mesh's (π/80)²/12 = 1.3e-4, their difference is a hundredth of them.
    np.testing.assert_allclose(grown.omega[0] ** 2, 0.01 * math.pi**4, rtol=0.05)


def test_becks_column():
    """[closed] A follower load flutters from 20.0509 EI/L² on; Bolotin, section 2.2.

    The mesh raises the load by (βh)²/12 of β = 4.7: 3e-4 at 40 cells.
    """
    growth = []
    for part in (0.995, 1.005):
        beam = ub.Beam((0, 0), (1, 0), SLENDER, cells=80)
        scene = clamped(beam, loads=[ub.FollowerLoad(beam.end, force=(-20.0509 * part, 0))])
        growth.append(-about_statics(scene, 2).damping.min())
    assert abs(growth[0]) < 1e-5  # both are near: to the root of round-off
    assert growth[1] > 1e-2


# -- buckling ------------------------------------------------------------------------------------


def column(cells, ends, section=STIFF):
    """A column under an axial load that is the time."""
    scene = supported(cells, ends, section)
    load = ub.PointLoad(scene.beams[0].end, force=(-1, 0), amplitude=lambda t: t)
    return replace(scene, loads=[load])


@pytest.mark.parametrize("cells", [32, 64])
@pytest.mark.parametrize("ends", [name for name in ENDS if ENDS[name][2]])
def test_slender_columns(ends, cells):
    """[closed] EA L²/EI = 1e9: strains are 40/1e9; round-off of a matrix would leave 1e-4."""
    found = ub.buckling(column(cells, ends), 1, mesh=CUBIC).factors[0]
    np.testing.assert_allclose(found, ENDS[ends][2] * math.pi**2, rtol=2 * 40 / 1e9)


def shared(a, b):
    return {"joints": [ub.Rigid(a, b)]}


def measured(a, b):
    return {"joints": [ub.Rigid(a, b, multipliers=True)]}


def sprung(a, b):
    """As good as rigid: 1e9 times as stiff as the beams."""
    spring = ub.Turn(a, b, ub.Spring(1e9))
    return {"joints": [ub.Revolute(a, b)], "connectors": [spring]}


@pytest.mark.parametrize(
    ("join", "cells"), [(shared, 8), (shared, 32), (measured, 32), (sprung, 32)]
)
def test_a_slender_portal_that_sways(join, cells):
    """[closed] x tan x = 6 (EI_g/b) h/EI = 3.2, P = x² EI/h²; strains are 1.5e-9.

    Springs of the corners are softer than rigid by 3/1e9.
    """
    column, girder = (ub.Section(EA=1e9, GA=1e9, EI=EI) for EI in (1.0, 0.8))
    left = ub.Beam((0, 0), (0, 1), column, cells=cells)
    right = ub.Beam((1.5, 0), (1.5, 1), column, cells=cells)
    top = ub.Beam((0, 1), (1.5, 1), girder, cells=cells)
    corners = [join(left.end, top.start), join(top.end, right.end)]
    scene = ub.Scene(
        [left, right, top],
        joints=[joint for corner in corners for joint in corner["joints"]],
        connectors=[c for corner in corners for c in corner.get("connectors", ())],
        supports=[ub.Pinned(left.start), ub.Pinned(right.start)],
        loads=[ub.PointLoad(place, force=(0, -1.0)) for place in (left.end, right.end)],
    )
    wanted = brentq(lambda x: x * math.tan(x) - 3.2, 1e-3, 1.57) ** 2
    found = ub.buckling(scene, 1, mesh=CUBIC).factors[0]
    np.testing.assert_allclose(found, wanted, rtol=2e-8)


@pytest.mark.parametrize("through_points", [False, True])
def test_a_bead_in_a_bowl(through_points):
    """[closed] ω = √(g/R + k/m) of a bead on a curve; the curvature of the spline errs by 2e-8."""
    radius, g, mass = 2.0, 9.81, 3.0
    bead = ub.Body((0, -radius), mass=mass, inertia=1.0)
    angles = [5e-4 * k for k in range(-20, 21)]
    points = [(radius * math.sin(s), -radius * math.cos(s)) for s in angles]
    bowl = ub.Guided(
        bead.middle,
        ub.Spline(points, angles)
        if through_points
        else lambda s: (radius * ufl.sin(s), -radius * ufl.cos(s)),
    )
    here, k = ub.ground(0, -radius), 1.0
    soft = ub.Slide(here, bead.middle, ub.Spring(k), axis=(1, 0))
    turn = ub.Turn(here, bead.middle, ub.Spring(1.0))
    scene = ub.Scene(
        bodies=[bead], joints=[bowl], connectors=[soft, turn], loads=[ub.Gravity((0, -g))]
    )
    found = about_statics(scene, 2).omega
    np.testing.assert_allclose(found, [1.0, math.sqrt(g / radius + k / mass)], rtol=2e-8)


def test_loads_of_another_time():
    """The factor is one on the loads at the time: the load itself is the same."""
    scene = column(10, "pinned-pinned", SLENDER)
    once, thrice = (ub.buckling(scene, 1, t=t).factors[0] for t in (1.0, 3.0))
    np.testing.assert_allclose(once, 3 * thrice, rtol=1e-8)


# -- damping -------------------------------------------------------------------------------------


def test_rayleigh_and_kelvin_voigt():
    """[closed] ζ = a0/(2ω) + a1 ω/2 of the same mesh.

    Tolerance: round-off 1e-16 of the highest squared frequency, 5e11, over the lowest, 12.
    """
    ω = ub.modes(supported(20, "clamped-free"), 4).omega
    a0, a1, time = 0.2, 1e-3, 5e-4
    damping = [ub.Rayleigh(mass=a0, stiffness=a1), ub.KelvinVoigt(time)]
    damped = ub.modes(supported(20, "clamped-free", damping=damping), 4)
    np.testing.assert_allclose(damped.damping, a0 / (2 * ω) + (a1 + time) * ω / 2, rtol=4e-6)
    np.testing.assert_allclose(damped.omega, ω, rtol=4e-6)


# -- rotation ------------------------------------------------------------------------------------


def ritz(γ, n, degree=16):
    """ω √(ρA L⁴/EI) of a beam clamped to an axis that turns with γ, in the plane of rotation.

    Euler-Bernoulli: bending, the centrifugal force ρA Ω² (L² - x²)/2, and the centrifugal softening
    of motion in the plane; x² times Legendre polynomials, integrals exact.
    """
    t, weights = np.polynomial.legendre.leggauss(2 * degree)
    x, weights = (t + 1) / 2, weights / 2
    square = Legendre.fit(x, x**2, 2, domain=[0, 1])
    shapes = [square * Legendre.basis(k, domain=[0, 1]) for k in range(degree)]
    W, dW, ddW = (np.array([s.deriv(d)(x) if d else s(x) for s in shapes]) for d in range(3))
    K = (ddW * weights) @ ddW.T + γ**2 * (dW * weights * (1 - x**2) / 2) @ dW.T
    M = (W * weights) @ W.T
    return np.sqrt(eigh(K - γ**2 * M, M, eigvals_only=True)[:n])


def test_the_ritz_solution_is_the_published_one():
    """[pub] Wright et al., table 1: out of plane 3.6816 and 22.1810 at γ = 1, 11.2023 at γ = 10."""
    np.testing.assert_allclose(np.hypot(ritz(1.0, 2), 1.0), [3.6817, 22.1810], atol=1e-4)
    np.testing.assert_allclose(np.hypot(ritz(10.0, 1), 10.0), [11.2023], atol=1e-4)


@pytest.mark.parametrize("rate", [1.0, 10.0, 30.0])
def test_rotating_beam(rate):
    """In the frame that turns: stiffer by the centrifugal force, softer by its growth outward.

    Tolerance: the stretch and Coriolis' force, of the order γ²/EA < 1e-5 and not in the reference,
    and (βh)⁴ of 40 cells by 1/300, β = 7.9.
    """
    frame = [ub.RotatingFrame(rate)]
    scenes = (supported(cells, "clamped-free", loads=frame) for cells in (10, 20, 40))
    found = romberg(*(about_statics(scene, 3).omega for scene in scenes))
    np.testing.assert_allclose(found, ritz(rate, 3), rtol=1e-4)


def test_foucaults_pendulum():
    """[closed] A body on springs: in a frame that turns with Ω, ω0 is ω0 - Ω and ω0 + Ω."""
    ω, rate = 3.0, 0.5
    body, here = ub.Body((1, 0), mass=2.0, inertia=1.0), ub.ground(1, 0)
    spring = ub.Spring(2 * ω**2)
    springs = [ub.Slide(here, body.middle, spring, axis=axis) for axis in ((1, 0), (0, 1))]
    springs.append(ub.Turn(here, body.middle, ub.Spring(1e4)))
    frame = ub.RotatingFrame(rate, (1, 0))
    found = about_statics(ub.Scene(bodies=[body], connectors=springs, loads=[frame]), 2)
    np.testing.assert_allclose(found.omega, [ω - rate, ω + rate], rtol=1e-12)
    np.testing.assert_allclose(found.damping, 0.0, atol=1e-12)


def test_mass_on_a_turning_rail():
    """[closed] Free along a rail only: ω² = k/m - Ω²."""
    k, mass, rate = 8.0, 2.0, 1.5
    body = ub.Body((1, 0), mass=mass, inertia=1.0)
    here = ub.ground(1, 0)
    scene = ub.Scene(
        bodies=[body],
        joints=[ub.Prismatic(here, body.middle, axis=(1, 0))],
        connectors=[ub.Slide(here, body.middle, ub.Spring(k), axis=(1, 0))],
        loads=[ub.RotatingFrame(rate)],
    )
    steady = ub.simulate(scene, ub.Static(), t=(0, 1), dt=1)
    found = ub.modes(scene, 1, at=steady)
    np.testing.assert_allclose(found.omega, [math.sqrt(k / mass - rate**2)], rtol=1e-12)
    # k x = m Ω² (1 + x)
    x = mass * rate**2 / (k - mass * rate**2)
    np.testing.assert_allclose(steady.displacement(body.middle)[-1], [x, 0, 0], atol=1e-9)
