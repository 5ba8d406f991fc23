# SPDX-License-Identifier: MIT
"""Laws of steel and concrete fibres against state machines in plain Python, point by point."""

import numpy as np
import pytest
from helpers import require_no_gain
from scenes import clamped
from uniaxial_points import LENGTH, Bars, C, histories

import ufl_beam as ub

SCHEMES = [ub.Static(), ub.EnergyMomentumStatic(0.5), ub.EnergyMomentumStatic(0.8)]
each_scheme = pytest.mark.parametrize("scheme", SCHEMES, ids=str)


def followed(law, strains, scheme=SCHEMES[0], **bars):
    """Stresses after each step of bars with the strains (steps, bars), and the bars."""
    points, stresses = Bars(strains.shape[1], law, None, scheme, **bars), []
    for strain in strains:
        points.step(strain)
        stresses.append(points.stress())
    return np.array(stresses), points


def work_by_means(strains, stresses):
    """Works per volume of paths from zero, by the mean of the stresses at the ends of steps."""
    (e, s) = (np.vstack([np.zeros(x.shape[1]), x]) for x in (strains, stresses))
    return np.sum((s[1:] + s[:-1]) / 2 * np.diff(e, axis=0), axis=0)


# -- steel ---------------------------------------------------------------------------------------


def steel02(strains, E, Fy, b, R0=20.0, cR1=0.925, cR2=0.15, a1=0.0, a2=1.0, a3=0.0, a4=1.0):
    """Stresses by the equations of Filippou, Popov and Bertero (1983), as Steel02 of OpenSees."""
    ey, e_last, s_last, sign = Fy / E, 0.0, 0.0, 0
    highest, lowest, er, sr = ey, -ey, 0.0, 0.0
    stresses = []
    for e in strains:
        if sign == 0:
            sign = 1 if e > 0 else -1
            e0, s0, limit = sign * ey, sign * Fy, sign * ey
        elif (e - e_last) * sign < 0:
            er, sr, sign = e_last, s_last, -sign
            highest, lowest = max(highest, e_last), min(lowest, e_last)
            a, per = (a3, a4) if sign > 0 else (a1, a2)
            shift = 1 + a * ((highest - lowest) / (2 * per * ey)) ** 0.8
            e0 = sign * Fy * shift - sign * b * E * ey * shift - sr + E * er
            e0 /= E - b * E
            s0 = sign * Fy * shift + b * E * (e0 - sign * ey * shift)
            limit = highest if sign > 0 else lowest
        xi = abs((limit - e0) / ey)
        R = R0 * (1 - cR1 * xi / (cR2 + xi))
        x = (e - er) / (e0 - er)
        e_last, s_last = e, sr + (s0 - sr) * (b * x + (1 - b) * x / (1 + abs(x) ** R) ** (1 / R))
        stresses.append(s_last)
    return stresses


STEELS = {
    "kinematic": (3.0, 0.02),
    "isotropic": (2.0, 0.05, 15.0, 0.9, 0.2, 0.3, 2.0, 0.2, 3.0),
}


@each_scheme
@pytest.mark.parametrize("steel", STEELS)
def test_menegotto_pinto_over_random_paths(steel, scheme):
    """[calc] Stresses and dissipated energies of 100 random walks, with partial loops; round-off.

    They depend on the strains at the ends of steps, not on the scheme.
    """
    parameters, strains = STEELS[steel], histories(100, steps=60)
    found, bars = followed(ub.MenegottoPinto(*parameters), strains, scheme)
    expected = np.column_stack([steel02(path, C, *parameters) for path in strains.T])
    assert found == pytest.approx(expected, abs=1e-12 * C)
    lost = work_by_means(strains, expected) - expected[-1] ** 2 / (2 * C)
    assert bars.dissipated()[0] / LENGTH == pytest.approx(lost, abs=1e-12 * C)
    assert lost.max() > 1.0


def test_menegotto_pinto_in_small_steps_dissipates_the_area_of_its_loops():
    """[calc] Second order: a quarter of the error for half the step, to 1e-6 by extrapolation."""
    def turned(n):
        return 0.05 * np.interp(np.arange(1, 4 * n + 1) / n, range(5), [0, 1, -0.4, 0.7, 0.6])

    def lost(n):
        return followed(ub.MenegottoPinto(3.0, 0.02), turned(n)[:, None])[1].dissipated()[0][0]

    coarse, middle, fine = (lost(n) for n in (400, 800, 1600))
    strains = turned(6400)
    stresses = np.array(steel02(strains, C, 3.0, 0.02))
    exact = work_by_means(strains[:, None], stresses[:, None])[0] - stresses[-1] ** 2 / (2 * C)
    assert 3.8 < (coarse - middle) / (middle - fine) < 4.2
    assert (4 * fine - middle) / 3 == pytest.approx(exact * LENGTH, rel=1e-6)


def test_errors_of_equilibrium_are_no_reversals():
    """Steps of 1e-9 yield strains to and fro leave the branch of yielding steel."""
    law, far = ub.MenegottoPinto(3.0, 0.02), 0.05
    noise = 1e-9 * 3.0 / C * (-1.0) ** np.arange(20)
    strains = np.concatenate([[far], far + noise, [0.055]])[:, None]
    found, _ = followed(law, strains)
    assert found[-1, 0] == pytest.approx(steel02([0.055], C, 3.0, 0.02)[0], rel=1e-8)
