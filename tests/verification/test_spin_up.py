# SPDX-License-Identifier: MIT
"""Spin-up of a flexible beam: the clamped end is turned, ever faster for 15 s, then steadily.

Source: J. C. Simo, L. Vu-Quoc, "On the dynamics of flexible beams under large overall motions - the
plane case: Part II", J. Appl. Mech. 53 (1986) 855-863.
"""

import numpy as np
import pytest
from convergence.study import extrapolated
from scenes import spin_up, spin_up_angle

import ufl_beam as ub

# [calc] tip relative to the rigid position, in its turning axes: t, u, v.
TABLE = np.array(
    [
        (2.5, -1.3227e-3, -0.15128),
        (5.0, -1.26547e-2, -0.468477),
        (7.5, -1.77420e-2, -0.559086),
        (10.0, -7.0725e-3, -0.362819),
        (12.5, -2.218e-4, -0.112698),
        (15.0, 5.13994e-4, 0.001305),
    ]
)
LENGTH, OMEGA = 10.0, 6.0


def deflection(cells, dt):
    """Times, and (u, v) of the tip in the axes that turn with the hub."""
    scene = spin_up(cells=cells)
    solution = ub.simulate(scene, ub.EnergyMomentum(), t=(0, 20), dt=dt)
    x, y = solution.position(scene.beams[0].end).T
    angle = np.array([spin_up_angle(t) for t in solution.times])
    u, v = np.cos(angle) * x + np.sin(angle) * y - LENGTH, np.cos(angle) * y - np.sin(angle) * x
    return solution.times, np.column_stack([u, v])


def answers(times, uv):
    """The table, the least v with its time and u, and the steady motion."""
    rows = np.searchsorted(times, TABLE[:, 0] - 1e-9)
    least = int(np.argmin(uv[:, 1]))
    near = slice(least - 1, least + 2)
    parabola = np.polyfit(times[near], uv[near, 1], 2)
    t_least = -parabola[1] / (2 * parabola[0])
    v_least = np.polyval(parabola, t_least)
    u_least = np.polyval(np.polyfit(times[near], uv[near, 0], 2), t_least)
    steady = uv[times > 15.5]
    mean_u, amplitude_v = steady[:, 0].mean(), np.ptp(steady[:, 1]) / 2
    return np.concatenate([uv[rows].ravel(), [t_least, u_least, v_least, mean_u, amplitude_v]])


@pytest.fixture(scope="module")
def limit():
    """Richardson's limit in space and in time, and its change from the coarser pairs of runs."""
    space = [answers(*deflection(n, 0.01)) for n in (20, 40, 80)]
    time = [space[0], *(answers(*deflection(20, dt)) for dt in (0.005, 0.0025))]
    before, after = (
        extrapolated(space[i], space[i + 1]) + extrapolated(time[i], time[i + 1]) - space[0]
        for i in (0, 1)
    )
    return after, np.abs(after - before)


def test_the_tip_follows_the_table(limit):
    """[calc] Table of (u, v), to 1e-5 of the largest deflection; its last digit is 5e-6 off."""
    values, left = limit
    computed = values[:12].reshape(6, 2)
    assert left[:12].max() < 4e-7
    np.testing.assert_allclose(computed[:, 1], TABLE[:, 2], rtol=0, atol=1e-5 * 0.574)
    # u goes with the square of v: twice the relative accuracy.
    np.testing.assert_allclose(computed[:, 0], TABLE[:, 1], rtol=0, atol=2e-5 * 0.0188)


def test_largest_deflection(limit):
    """[calc] v = -0.57384 at t = 6.762, u = -0.018822: a unit of the last digit."""
    t, u, v = limit[0][12:15]
    assert t == pytest.approx(6.762, rel=0, abs=1e-3)
    assert u == pytest.approx(-0.018822, rel=0, abs=1e-6)
    assert v == pytest.approx(-0.57384, rel=0, abs=1e-5)


def test_steady_rotation(limit):
    """[closed] Extension tan(kL)/k - L, k = ω √(ρA/EA); [calc] amplitude 3.65e-3 that v keeps.

    The oscillation shortens the beam by (1.1624 / 2L) times the mean square of v at the tip.
    """
    mean_u, amplitude = limit[0][15:]
    k = OMEGA * np.sqrt(1.2 / 2.8e7)
    extension = np.tan(k * LENGTH) / k - LENGTH
    assert extension == pytest.approx(5.14317e-4, rel=0, abs=0.5e-9)  # as in the source of [calc]
    assert amplitude == pytest.approx(3.65e-3, rel=0, abs=1e-5)
    shortening = 1.1624 / (2 * LENGTH) * amplitude**2 / 2
    assert 0 <= extension - mean_u <= shortening
