# SPDX-License-Identifier: MIT
"""Post-buckling of Euler's column, clamped at its foot, under a dead axial load.

Source: S. P. Timoshenko, J. M. Gere, "Theory of Elastic Stability", 2nd ed. 1961, section 2.7.

[closed] With k = sin(α/2), α the end angle, and complete elliptic integrals K(k), E(k):
P/P_cr = (2K/π)², height x/L = 2E/K - 1, deflection y/L = 2k/K.

How the buckled branch is reached: a perfect column has no reason to leave its axis, and with an
imperfection another problem is solved.  So first the end is turned to α while the load grows: its
rotation held, the column has no other branch near this path.  Then the end is let go, and
the column finds the equilibrium beside it, which is the buckled one.
"""

import numpy as np
import pytest
from convergence.study import extrapolated
from scenes import SLENDER
from scipy.special import ellipe, ellipk

import ufl_beam as ub

# α in degrees, P/P_cr, x/L, y/L: [closed] to four decimals.
TABLE = [
    (20, 1.0154, 0.9697, 0.2194),
    (40, 1.0637, 0.8812, 0.4222),
    (60, 1.1517, 0.7410, 0.5932),
    (80, 1.2939, 0.5594, 0.7195),
    (100, 1.5184, 0.3490, 0.7915),
    (120, 1.8848, 0.1232, 0.8032),
    (140, 2.5423, -0.1069, 0.7504),
    (160, 4.0301, -0.3403, 0.6246),
    (176, 9.1162, -0.5772, 0.4214),
]


def closed_form(α):
    """(P/P_cr, x/L, y/L)."""
    m = np.sin(α / 2) ** 2
    K, E = ellipk(m), ellipe(m)
    return (2 * K / np.pi) ** 2, 2 * E / K - 1, 2 * np.sqrt(m) / K


def buckled(cells, P, α):
    """(x, y, ψ) of the end of a column of unit length and stiffness, after letting go."""
    beam = ub.Beam((0, 0), (1, 0), SLENDER, cells=cells)
    foot, load = (
        ub.Clamped(beam.start),
        ub.PointLoad(beam.end, force=(-P, 0), amplitude=ub.ramp(1.0)),
    )
    turned = ub.PrescribedDisplacement(beam.end, psi=lambda t: α * t)
    held = ub.Scene([beam], supports=[foot, turned], loads=[load])
    free = ub.Scene([beam], supports=[foot], loads=[load])
    bent = ub.simulate(held, ub.Static(), t=(0, 1), dt=0.05)
    after = ub.simulate(free, ub.Static(), t=(1, 2), dt=1, start=bent)
    return after.displacement(beam.end)[-1] + (1, 0, 0)


@pytest.mark.parametrize(("degrees", "load", "x", "y"), TABLE)
def test_table_is_the_closed_form(degrees, load, x, y):
    """[closed] Half a unit of the last digit."""
    np.testing.assert_allclose(closed_form(np.radians(degrees)), [load, x, y], rtol=0, atol=0.51e-4)


@pytest.mark.parametrize("degrees", [row[0] for row in TABLE])
def test_end_position_and_angle(degrees):
    """Richardson's limit of 32, 64 and 128 cells against the closed form.

    Tolerance: the fourth-order error that is left, a fifteenth of the change of the limit from the
    mesh before, doubled for the orders above; and strains of axis and shear, up to 1e-8 P.  They
    shorten the column and shift the critical load, and the angle goes with the root of P/P_cr - 1.
    """
    α = np.radians(degrees)
    load, x, y = closed_form(α)
    P = load * np.pi**2 / 4
    coarse, medium, fine = (buckled(n, P, α) for n in (32, 64, 128))
    before, limit = extrapolated(coarse, medium), extrapolated(medium, fine)
    tolerance = 2 / 15 * np.abs(limit - before).max() + 1e-8 * P * (1 + 1 / np.sqrt(load - 1))
    assert np.abs(limit - (x, y, α)).max() <= tolerance
