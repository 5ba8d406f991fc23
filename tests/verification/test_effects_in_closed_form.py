# SPDX-License-Identifier: MIT
"""Effects whose closed forms take a few lines: schemes on an oscillator, beams and bars that yield.

[closed] Each step of a scheme turns, or multiplies, the state of a linear oscillator.
"""

import math

import numpy as np
import pytest
from helpers import assert_balanced, run
from scenes import cantilever, clamped
from user_classes import Weighted

import ufl_beam as ub

MASS, STIFFNESS, SPEED, DT = 2.0, 50.0, 0.3, 0.04
OMEGA = math.sqrt(STIFFNESS / MASS)


def oscillator(scheme):
    """Motion of a mass at the end of a straight bar without mass, which is linear; m."""
    section = ub.Section(EA=STIFFNESS, GA=1e3, EI=1e3, rhoA=0.0, depth=0.1)
    bar = ub.Beam((0, 0), (1, 0), section, cells=1)
    mass = ub.Body((1, 0), mass=MASS, inertia=1.0)
    scene = clamped(
        bar,
        joints=[ub.Rigid(bar.end, mass.middle)],
        bodies=[mass],
        initial=[ub.Velocity([mass], linear=(SPEED, 0.0))],
    )
    solution = run(scene, scheme, t=(0, 40 * DT), dt=DT, newton=ub.Newton(rtol=1e-13))
    return solution.displacement(bar.end)[:, 0]


def weighted(force, velocity):
    """Motion by a NumPy matrix of a step, with weights of the end of the step; m."""
    new = np.array([[STIFFNESS * force, MASS / DT], [1 / DT, -velocity]])
    old = np.array([[-STIFFNESS * (1 - force), MASS / DT], [1 / DT, 1 - velocity]])
    states = [np.array([0.0, SPEED])]
    for _ in range(40):
        states.append(np.linalg.solve(new, old @ states[-1]))
    return np.array(states)[:, 0]


SOLVED = 1e-11
"""Part of the amplitude: 40 steps of a residual of 1e-13 of the forces."""


@pytest.mark.parametrize(
    ("scheme", "force", "velocity"),
    [
        (ub.EnergyMomentum(alpha=0, beta=0), 0.5, 0.5),
        (ub.EnergyMomentum(alpha=0.1, beta=0.04), 0.6, 0.54),
        (Weighted(0.57), 0.57, 0.57),
    ],
    ids=str,
)
def test_midpoint_rules_with_weights(scheme, force, velocity):
    np.testing.assert_allclose(
        oscillator(scheme), weighted(force, velocity), rtol=0, atol=SOLVED * SPEED / OMEGA
    )


def test_phase_of_the_scheme_of_fourth_order():
    """A stage of the length x turns the phase by 2 atan(ω x/2); lengths by Suzuki (1990)."""
    first = 1 / (4 - 4 ** (1 / 3))
    lengths = DT * np.array([first, first, 1 - 4 * first, first, first])
    phase = 2 * np.arctan(OMEGA * lengths / 2).sum() * np.arange(41)
    amplitude = SPEED / OMEGA
    found = oscillator(ub.EnergyMomentum(order=4))
    np.testing.assert_allclose(found, amplitude * np.sin(phase), rtol=0, atol=SOLVED * amplitude)


def test_a_beam_that_yields_in_shear():
    """v = V L³/3EI + V L/GA + (V - limit) L/H, with the bending of two cells."""
    L, GA, EI, H, limit, V = 2.0, 1e6, 1e9, 2e5, 0.5, 1.5
    law = ub.ElastoPlastic(limit, isotropic=H)
    section = ub.Section(EA=1e9, GA=GA, EI=EI, depth=0.1, shear=law)
    scene = cantilever(section, length=L, cells=2, force=(0, V))
    solution = run(scene, ub.Static())
    bending = V * L**3 / (3 * EI) * (1 - 1 / (4 * 2**2))  # curvatures of the middles of cells
    expected = bending + V * L / GA + (V - limit) * L / H
    assert solution.displacement(scene.beams[0].end)[-1, 1] == pytest.approx(expected, rel=1e-9)
    lost = limit * (V - limit) * L / H
    assert solution.energy.lost["plastic"][-1] == pytest.approx(lost, rel=1e-6)


def by_return_map(u, *, isotropic=0.0, kinematic=0.0):
    """Forces over the yield force at elongations over that of first yield; moduli over EA."""
    p = back = ξ = 0.0
    forces = []
    for x in u:
        over = abs(x - p - back) - 1 - isotropic * ξ
        if over > 0:
            γ = over / (1 + isotropic + kinematic) * np.sign(x - p - back)
            p, back, ξ = p + γ, back + kinematic * γ, ξ + abs(γ)
        forces.append(x - p)
    return np.array(forces)


@pytest.mark.parametrize("scheme", [ub.Static(), ub.EnergyMomentumStatic()], ids=str)
@pytest.mark.parametrize("kind", ["isotropic", "kinematic"])
def test_loops_of_a_bilinear_bar(kind, scheme):
    """To round-off: laws are met at the ends of steps; the loop of kinematic hardening closes."""
    EA, limit, h = 200.0, 1.0, 1 / 9
    section = ub.Section(EA=EA, GA=EA, EI=EA, axial=ub.ElastoPlastic(limit, **{kind: h * EA}))
    bar, turns = ub.Beam((0, 0), (2, 0), section, cells=1), ub.Table(range(6), [0, 4, -4, 4, -4, 4])
    yields = 2 * limit / EA  # m
    pull = ub.PrescribedDisplacement(bar.end, u=lambda t: yields * turns(t), v=0, psi=0)
    solution = run(clamped(bar, pull), scheme, t=(0, 5), dt=1 / 80)
    N = solution.section_forces_at(bar.end)[:, 0] / limit
    exact = by_return_map(solution.displacement(bar.end)[:, 0] / yields, **{kind: h})
    np.testing.assert_allclose(N, exact, rtol=0, atol=1e-10)
    if kind == "kinematic":
        np.testing.assert_allclose(N[-1], N[80], rtol=1e-10)
    if scheme != ub.Static():
        assert_balanced(solution.energy)
