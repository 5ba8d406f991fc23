# SPDX-License-Identifier: MIT
"""Actions of structural engineering: pressure on a ring; loads and masses that cross a bridge."""

import math
from itertools import pairwise

import numpy as np
import pytest
from scipy.integrate import solve_ivp

import ufl_beam as ub

RING = ub.Section(EA=1e8, GA=1e8, EI=100.0, rhoA=1.0, rhoI=1e-6)
"""Of radius 1 m: extension and shear change results by EI/EA = 1e-6."""


def ring(pressure, cells):
    """A ring of radius 1 m, counter-clockwise, in equilibrium under a pressure from outside."""
    angles = [k * math.pi / 2 for k in range(5)]
    parts = [ub.Beam.arc((0, 0), 1.0, ends, RING, cells=cells // 4) for ends in pairwise(angles)]
    scene = ub.Scene(
        parts,
        joints=[ub.Rigid(a.end, b.start) for a, b in pairwise([*parts, parts[0]])],
        supports=[
            ub.Roller(parts[0].start),
            ub.Roller(parts[1].start, along=(0, 1)),
            ub.Roller(parts[2].start),
        ],
        loads=[ub.Pressure(part, pressure) for part in parts],
    )
    return scene, ub.simulate(scene, ub.Static(), t=(0, 1), dt=1.0)


def test_ring_under_pressure():
    """[closed] N = -p R, u = -p R²/EA; the polygon of 4n cells has R cos² of half an angle."""
    p, cells = 1e4, 40
    scene, run = ring(p, cells)
    first, half = scene.beams[0], math.pi / cells
    # In the middle of a cell, the distance from the centre is R cos(half)
    middle = run.diagram(first, points=3).N[1::3]
    short = 1 + run.displacement(first.start)[-1, 0]
    # EI/EA R² = 1e-6 is the part of N that bends the polygon's cells
    assert middle == pytest.approx(-p * short * math.cos(half), rel=1e-6)
    assert run.diagram(first, points=3).M.max() < 1.01 * p * math.sin(half) ** 2 / 2
    assert short - 1 == pytest.approx(-p / RING.EA, rel=2 * half**2)


def test_buckling_of_a_ring_under_hydrostatic_pressure():
    """[closed] p = 3 EI/R³ (Lévy 1884; Timoshenko and Gere, Theory of Elastic Stability, 7.3).

    The square of the frequency with two waves is linear in p.  The two modes of two waves have the
    same factor.  The error of a polygon is quadratic in the length of its cells.
    """
    found = []
    for cells in (24, 48):
        free, pressed = (
            ub.modes(scene, 2, at=run).omega ** 2
            for scene, run in (ring(p, cells) for p in (0.0, 150.0))
        )
        found.append(150.0 / (1 - pressed / free))
    extrapolated = found[1] + (found[1] - found[0]) / 3
    # errors of the fourth order: (π/24)⁴ n⁴ of two waves are 5e-3, in the finer ring 3e-4
    assert extrapolated == pytest.approx(3 * RING.EI, rel=2e-3)


L, EI, MU, P = 10.0, 1e6, 100.0, 1e3
BRIDGE = ub.Section(EA=1e10, GA=1e10, EI=EI, rhoA=MU, rhoI=1e-6)
"""Shear and rotary inertia change results by EI/(GA L²) = 1e-6."""


def crossing(speed, steps, *, mass=0.0, until=1.5, degree=3):
    """A bridge of 10 m, which a force of 1 kN and a mass cross."""
    beam = ub.Beam((0, 0), (L, 0), BRIDGE, cells=8)
    load = ub.MovingLoad(beam, lambda t: speed * t, (0, -P), mass=mass)
    supports = [ub.Pinned(beam.start), ub.Roller(beam.end)]
    scene, end = ub.Scene([beam], supports=supports, loads=[load]), until * L / speed
    mesh = ub.Mesh(degree=degree)
    return beam, ub.simulate(scene, ub.EnergyMomentum(), t=(0, end), dt=end / steps, mesh=mesh)


def test_moving_load():
    """[closed] Frýba (1999), chapter 1: the series of modes, and free vibration after the crossing.

    At half the critical speed.  In the finer run the phase errors (ω dt)²/12 ω t of the first and
    third mode are 4e-4 and 0.3 at the end; free vibrations of these modes have amplitudes of 1 and
    1.5e-3 of the largest deflection.  Extrapolation removes the error of the first mode.
    """
    c = 0.5 * math.pi / L * math.sqrt(EI / MU)
    j = np.arange(1, 40)
    ω, Ω = (j * math.pi / L) ** 2 * math.sqrt(EI / MU), j * math.pi * c / L
    size = 2 * P / (MU * L) / (ω**2 - Ω**2)

    def modal(t):
        on = np.minimum(t, L / c)[:, None]
        q = size * (np.sin(Ω * on) - Ω / ω * np.sin(ω * on))
        v = size * Ω * (np.cos(Ω * on) - np.cos(ω * on))
        free = t[:, None] - on
        return q * np.cos(ω * free) + v / ω * np.sin(ω * free)

    (beam, coarse), (other, fine) = (crossing(c, steps) for steps in (200, 400))
    expected = -(modal(coarse.times) * np.sin(j * math.pi / 2)).sum(axis=1)
    w1 = coarse.displacement(beam.at(0.5))[:, 1]
    w2 = fine.displacement(other.at(0.5))[::2, 1]
    size = np.abs(expected).max()
    assert size / (P * L**3 / (48 * EI)) == pytest.approx(1.7, abs=0.01)  # Frýba's figure 1.3
    assert np.abs(w2 - expected).max() < 1e-3 * size
    assert np.abs(w2 + (w2 - w1) / 3 - expected).max() < 5e-4 * size
    assert fine.energy.worst < 1e-9


def test_moving_mass():
    """[calc] Nine sine modes with the mass and its convective acceleration, integrated by SciPy.

    w_tt + 2 c w_xt + c² w_xx at the place c t, with a mass of 30 % of the bridge.  The error is
    1.5e-3, 5.6e-4 and 2.7e-4 with 200, 400 and 800 steps; it tends to that of nine modes.
    """
    c, m, number = 0.3 * math.pi / L * math.sqrt(EI / MU), 0.3 * MU * L, 9
    k = np.arange(1, number + 1) * math.pi / L

    def rates(t, y, convective):
        f = np.sin(k * c * t)
        of_velocity, of_place = 2 * c * k * np.cos(k * c * t), -((c * k) ** 2) * f
        q, v = np.split(y, 2)
        force = -P - convective * m * (of_velocity @ v + of_place @ q)
        rest = 2 / (MU * L) * f * force - k**4 * EI / MU * q
        # Inverse of 1 + a f fᵀ
        a = 2 * m / (MU * L)
        return np.concatenate([v, rest - a * f * (f @ rest) / (1 + a * (f @ f))])

    beam, run = crossing(c, 400, mass=m, until=1.0)
    expected, without = (
        np.sin(k * L / 2)
        @ solve_ivp(
            rates, (0, L / c), np.zeros(2 * number), t_eval=run.times, args=(convective,),
            rtol=1e-6, atol=1e-9, method="DOP853",
        ).y[:number]
        for convective in (1.0, 0.0)
    )  # fmt: skip
    size = np.abs(expected).max()
    assert np.abs(run.displacement(beam.at(0.5))[:, 1] - expected).max() < 1e-3 * size
    assert np.abs(without - expected).max() > 0.05 * size
    assert run.energy.worst < 1e-9


DECK = ub.Section(EA=2e10, GA=8e9, EI=6e9, rhoA=4e3, rhoI=1e3)
SPAN, MASS, SPEED = 20.0, 2e4, 80.0


def timoshenko_modes(number, steps):
    """Deflections of the middle of a bridge that a mass crosses, by modes of a Timoshenko beam.

    w = Σ a sin(kx), ψ = Σ b cos(kx) are exact for the supports.  The mass has the second derivative
    of w(ct, t): w_tt + 2 c w_xt + c² w_xx.  Steps are by the midpoint rule.
    """
    k, i, dt = np.arange(1, number + 1) * math.pi / SPAN, np.arange(number), SPAN / SPEED / steps
    M, K = np.zeros((2, 2 * number, 2 * number))
    M[i, i], M[number + i, number + i] = DECK.rhoA * SPAN / 2, DECK.rhoI * SPAN / 2
    K[i, i] = DECK.GA * k**2 * SPAN / 2
    K[i, number + i] = K[number + i, i] = -DECK.GA * k * SPAN / 2
    K[number + i, number + i] = (DECK.GA + DECK.EI * k**2) * SPAN / 2
    x, v, middle = np.zeros(2 * number), np.zeros(2 * number), [0.0]
    for n in range(steps):
        along = k * SPEED * (n + 0.5) * dt
        f, g, h = (
            np.append(values, 0 * k)
            for values in (np.sin(along), k * np.cos(along), -(k**2) * np.sin(along))
        )
        inertia = M + MASS * np.outer(f, f)
        coriolis = 2 * MASS * SPEED * np.outer(f, g)
        stiffness = K + MASS * SPEED**2 * np.outer(f, h)
        force = -9.81 * MASS * f + 2 * inertia @ v / dt - stiffness @ x
        step = np.linalg.solve(2 * inertia / dt**2 + coriolis / dt + stiffness / 2, force)
        x, v = x + step, 2 * step / dt - v
        middle.append(np.sin(k * SPAN / 2) @ x[:number])
    return np.array(middle)


@pytest.mark.parametrize(
    ("scheme", "degree"),
    [
        (ub.EnergyMomentum(), 1), (ub.EnergyMomentum(), 2), (ub.EnergyMomentum(), 3),
        (ub.EnergyMomentumDecaying(), 2), (ub.GeneralizedAlpha(0.8), 1), (ub.Newmark(), 2),
        (ub.EnergyMomentum(0.05, 0.0), 1),
    ],
    ids=str,
)  # fmt: skip
def test_moving_mass_on_a_beam_with_shear_strains(scheme, degree):
    """[calc] Twenty modes of the Timoshenko beam with the mass; -9.740 mm at most.

    10 and 40 modes differ by 1e-4.  The steps are resolved to (ω dt)²/12 ω t = 1e-3 in the first
    mode, cells of degree 1 to F/(GA h) l²/8 of the deflection, 3e-3 of it with 40 cells.
    Refinement by 4, with steps that are as short as a cell or a tenth of it, changes no more.
    """
    expected = timoshenko_modes(20, 1600)
    assert expected.min() == pytest.approx(-9.740e-3, rel=1e-4)
    for cells, steps in ((40, 400), (160, 400), (160, 160)):
        beam = ub.Beam((0, 0), (SPAN, 0), DECK, cells=cells // degree)
        load = ub.MovingLoad(beam, lambda t: SPEED * t, (0, -9.81 * MASS), mass=MASS)
        supports = [ub.Pinned(beam.start), ub.Roller(beam.end)]
        scene = ub.Scene([beam], supports=supports, loads=[load])
        end, mesh = SPAN / SPEED, ub.Mesh(degree=degree)
        run = ub.simulate(scene, scheme, t=(0, end), dt=end / steps, mesh=mesh)
        w = run.displacement(beam.at(0.5))[:, 1]
        error = np.abs(w - expected[:: 1600 // steps]).max() / np.abs(expected).max()
        assert error < 5e-3
        if isinstance(scheme, ub.EnergyMomentum):
            assert run.energy.worst < 1e-9


def test_a_mass_crosses_fine_cells_of_a_soft_beam():
    """[estimate] The shear wave speed is 20 m/s, m s'²/(GA h) is 0.02 and 1.6.

    Sways differ by a local shear deflection of F h/(4 GA), 1e-5 m with the coarser cells.
    """
    section = ub.Section(EA=1e3, GA=4e2, EI=1.0, rhoA=1.0, rhoI=1e-3, depth=0.1)
    beam = ub.Beam((0, 0), (1, 0), section, cells=4)
    load = ub.MovingLoad(beam, lambda t: 1.1 * t, force=(0, -1.0), mass=0.5)
    scene, found = ub.Scene([beam], supports=[ub.Clamped(beam.start)], loads=[load]), []
    for refine in (16, 128):
        mesh = ub.Mesh(refine=refine, degree=2)
        run = ub.simulate(scene, ub.EnergyMomentum(), t=(0, 0.1), dt=6.25e-4, mesh=mesh)
        found.append(run.q[-1].max() - run.q[-1].min())
        assert run.energy["loads"][-1] < 4e-4
    assert found[1] == pytest.approx(found[0], abs=1e-5 + 0.02 * found[0])
