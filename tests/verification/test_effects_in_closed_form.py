# SPDX-License-Identifier: MIT
"""Effects whose closed forms take a few lines: schemes on an oscillator, a beam yielding in shear.

[closed] Each step of a scheme turns, or multiplies, the state of a linear oscillator.
"""

import math
import sys
from pathlib import Path

import numpy as np
import pytest
from helpers import run

import ufl_beam as ub

sys.path.append(str(Path(__file__).parents[1] / "properties"))
from user_classes import Weighted

MASS, STIFFNESS, SPEED, DT = 2.0, 50.0, 0.3, 0.04
OMEGA = math.sqrt(STIFFNESS / MASS)


def oscillator(scheme):
    """Motion of a mass at the end of a bar without mass; m.

    The bar is straight and on a line, so that its motion is linear.
    """
    section = ub.Section(EA=STIFFNESS, GA=1e3, EI=1e3, rhoA=0.0, depth=0.1)
    bar = ub.Beam((0, 0), (1, 0), section, cells=1)
    mass = ub.Body((1, 0), mass=MASS, inertia=1.0)
    scene = ub.Scene(
        [bar],
        joints=[ub.Rigid(bar.end, mass.middle)],
        supports=[ub.Clamped(bar.start)],
        bodies=[mass],
        initial=[ub.Velocity([mass], linear=(SPEED, 0.0))],
    )
    solution = run(scene, scheme, t=(0, 40 * DT), dt=DT, newton=ub.Newton(rtol=1e-13))
    return solution.displacement(bar.end)[:, 0]


def weighted(force, velocity):
    """Motion by a NumPy matrix of a step, with weights of the end of the step; m.

    m (v1 - v0)/dt + k (force u1 + (1 - force) u0) = 0 and
    (u1 - u0)/dt = velocity v1 + (1 - velocity) v0.
    """
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
        (ub.EnergyMomentum(), 0.5, 0.5),
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
    np.testing.assert_allclose(
        oscillator(ub.EnergyMomentum(order=4)),
        amplitude * np.sin(phase),
        rtol=0,
        atol=SOLVED * amplitude,
    )


def test_a_beam_that_yields_in_shear():
    """v = V L³/3EI + V L/GA + (V - limit) L/H; strains of 1e-6 make errors of their squares.

    V is constant along the beam, and EI so large that the error of two cells in bending, a part of
    1e-3 of v, is less than 1e-4 of it; the closed form has the bending of two cells.
    """
    L, GA, EI, H, limit, V = 2.0, 1e6, 1e9, 2e5, 0.5, 1.5
    law = ub.ElastoPlastic(limit, isotropic=H)
    section = ub.Section(EA=1e9, GA=GA, EI=EI, depth=0.1, shear=law)
    beam = ub.Beam((0, 0), (L, 0), section, cells=2)
    load = ub.PointLoad(beam.end, force=(0, V), amplitude=lambda t: t)
    scene = ub.Scene([beam], supports=[ub.Clamped(beam.start)], loads=[load])
    solution = run(scene, ub.Static(), t=(0, 1), dt=0.1)
    bending = V * L**3 / (3 * EI) * (1 - 1 / (4 * 2**2))  # curvatures of the middles of cells
    expected = bending + V * L / GA + (V - limit) * L / H
    assert solution.displacement(beam.end)[-1, 1] == pytest.approx(expected, rel=1e-9)
    lost = limit * (V - limit) * L / H
    assert solution.energy.lost["plastic"][-1] == pytest.approx(lost, rel=1e-6)
