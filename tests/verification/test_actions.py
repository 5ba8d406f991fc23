# SPDX-License-Identifier: MIT
"""Actions of structural engineering: pressure on a ring; loads and masses that cross a bridge."""

import math
from itertools import pairwise

import numpy as np
import pytest
from scenes import clamped

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


@pytest.mark.filterwarnings("ignore:the equilibrium at t = 1 s is unstable:ufl_beam.ModelWarning")
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


L, EI, MU, P = 10.0, 1e6, 100.0, 1e3
BRIDGE = ub.Section(EA=1e10, GA=1e10, EI=EI, rhoA=MU, rhoI=1e-6)
"""Shear and rotary inertia change results by EI/(GA L²) = 1e-6."""


def crossing(
    section, length, cells, speed, steps, degree, *, force, mass=0.0, scheme=None, until=1.0
):
    """Deflection of the middle of a bridge that a force and a mass cross; m."""
    beam = ub.Beam((0, 0), (length, 0), section, cells=cells)
    load = ub.MovingLoad(beam, lambda t: speed * t, (0, -force), mass=mass)
    supports = [ub.Pinned(beam.start), ub.Roller(beam.end)]
    scene, end = ub.Scene([beam], supports=supports, loads=[load]), until * length / speed
    scheme, mesh = scheme or ub.EnergyMomentum(), ub.Mesh(degree=degree)
    run = ub.simulate(scene, scheme, t=(0, end), dt=end / steps, mesh=mesh)
    assert not isinstance(scheme, ub.EnergyMomentum) or run.energy.worst < 1e-9
    return run.times, run.displacement(beam.at(0.5))[:, 1]


def test_moving_load():
    """[closed] Frýba (1999), chapter 1: the series of modes, and free vibration after the crossing.

    In the finer run the phase errors (ω dt)²/12 ω t of the first and third mode are 4e-4 and 0.3 at
    the end; free vibrations of these modes have amplitudes of 1 and 1.5e-3 of the deflection.
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

    (t, w1), (_, w2) = (
        crossing(BRIDGE, L, 8, c, steps, 3, force=P, until=1.5) for steps in (200, 400)
    )
    expected = -(modal(t) * np.sin(j * math.pi / 2)).sum(axis=1)
    size, w2 = np.abs(expected).max(), w2[::2]
    assert size / (P * L**3 / (48 * EI)) == pytest.approx(1.7, abs=0.01)  # Frýba's figure 1.3
    assert np.abs(w2 - expected).max() < 1e-3 * size
    assert np.abs(w2 + (w2 - w1) / 3 - expected).max() < 5e-4 * size


DECK = ub.Section(EA=2e10, GA=8e9, EI=6e9, rhoA=4e3, rhoI=1e3)
SPAN, MASS, SPEED = 20.0, 2e4, 80.0


def timoshenko_modes(number, steps):
    """Deflections of the middle of a bridge that a mass crosses, w = Σ a sin(kx), ψ = Σ b cos(kx).

    The mass has the acceleration w_tt + 2 c w_xt + c² w_xx.  Steps are by the midpoint rule.
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
    ("scheme", "degree", "meshes"),
    [
        (ub.EnergyMomentum(), 2, [(40, 400), (160, 400), (160, 160)]),
        (ub.EnergyMomentum(), 1, [(40, 400)]),
        (ub.EnergyMomentumDecaying(), 1, [(40, 400)]),
        (ub.GeneralizedAlpha(0.8), 1, [(40, 400)]),
        (ub.Newmark(), 1, [(40, 400)]),
        (ub.EnergyMomentum(0.05, 0.0), 1, [(40, 400)]),
    ],
    ids=str,
)
def test_moving_mass(scheme, degree, meshes):
    """[calc] Twenty modes of the Timoshenko beam with the mass; 10 and 40 modes differ by 1e-4.

    Steps err by (ω dt)²/12 ω t = 1e-3 in the first mode, 40 cells of degree 1 by F/(GA h) l²/8,
    3e-3 of the deflection.  Shorter cells, of a step or ten steps, change no more.
    """
    expected = timoshenko_modes(20, 1600)
    assert expected.min() == pytest.approx(-9.740e-3, rel=1e-4)
    for cells, steps in meshes:
        mesh = DECK, SPAN, cells // degree, SPEED, steps, degree
        _, w = crossing(*mesh, force=9.81 * MASS, mass=MASS, scheme=scheme)
        assert np.abs(w - expected[:: 1600 // steps]).max() < 5e-3 * np.abs(expected).max()


def test_a_mass_crosses_fine_cells_of_a_soft_beam():
    """[estimate] m s'²/(GA h) is 0.02 and 1.6; sways differ by the shear deflection F h/(4 GA)."""
    section = ub.Section(EA=1e3, GA=4e2, EI=1.0, rhoA=1.0, rhoI=1e-3, depth=0.1)
    beam = ub.Beam((0, 0), (1, 0), section, cells=4)
    load = ub.MovingLoad(beam, lambda t: 1.1 * t, force=(0, -1.0), mass=0.5)
    scene, found = clamped(beam, loads=[load]), []
    for refine in (16, 128):
        mesh = ub.Mesh(refine=refine, degree=2)
        run = ub.simulate(scene, ub.EnergyMomentum(), t=(0, 0.1), dt=6.25e-4, mesh=mesh)
        found.append(run.q[-1].max() - run.q[-1].min())
        assert run.energy["loads"][-1] < 4e-4
    assert found[1] == pytest.approx(found[0], abs=1e-5 + 0.02 * found[0])
