# SPDX-License-Identifier: MIT
"""Laws with curved branches against closed forms and independent integration."""

import math

import numpy as np
import pytest
from scenes import clamped
from scipy.integrate import solve_ivp
from uniaxial_points import LENGTH, Bars, C

import ufl_beam as ub
import ufl_beam.structures as st

MIDDLE, END = ub.EnergyMomentumStatic(0.5), ub.EnergyMomentumStatic(1.0)
LAWS = {
    "Ramberg-Osgood": st.RambergOsgood(yield_limit=2.0, offset=0.01, exponent=6),
    "Armstrong-Frederick": st.ArmstrongFrederick(yield_limit=1.0, kinematic=150.0, recovery=60.0),
    "Bouc-Wen": st.BoucWen(yield_limit=2.0, hardening=0.05, exponent=2),
    "degrading": st.BoucWen(2.0, 0.05, 1.5, shape=0.7, strength=0.05),
}


def follow(law, strains, scheme=MIDDLE):
    """The last stress and the bar after small steps of strain; second order."""
    one = Bars(1, law, None, scheme)
    for strain in strains:
        one.step([strain])
    return one.stress()[0], one


@pytest.mark.parametrize("σ", [0.5, 2.0, 3.7])
@pytest.mark.parametrize("steps", [1, 7])
def test_a_ramberg_osgood_law_follows_its_power(σ, steps):
    """[closed] strain = stress/C + offset (stress/limit)^n, then elastic; in one step or many."""
    strain = σ / C + 0.01 * (σ / 2) ** 6
    found, one = follow(LAWS["Ramberg-Osgood"], np.linspace(0, strain, steps + 1)[1:], END)
    assert found == pytest.approx(σ, rel=1e-12)
    one.step([strain - 0.5 * σ / C])
    assert one.stress()[0] == pytest.approx(0.5 * σ, rel=1e-11)


def test_armstrong_frederick_hardens_exponentially():
    """[closed] back stress = kinematic/recovery (1 - exp(-recovery p)); 4000 steps, 1e-7."""
    law = LAWS["Armstrong-Frederick"]
    _, one = follow(law, np.linspace(0, 0.06, 4001)[1:])
    back = 150 / 60 * (1 - math.exp(-60 * one["plastic"][0]))
    assert one["back"][0] == pytest.approx(back, rel=1e-6)
    found, one = follow(law, np.linspace(0, 0.06, 31)[1:], END)
    assert found == pytest.approx(1 + one["back"][0], rel=1e-12)


def test_armstrong_frederick_ratchets():
    """[closed] A cycle of stress from low to high leaves ln((B² - r²X1²)/(B² - r²X0²))/r, less.

    X0 = low + limit and X1 = high - limit are the back stresses at its ends.
    """
    limit, B, r, high, low = 1.0, 150.0, 60.0, 2.2, -1.6
    X1, X0 = high - limit, low + limit
    exact = math.log((B - r * X0) / (B - r * X1)) / r - math.log((B + r * X1) / (B + r * X0)) / r
    law = st.ArmstrongFrederick(limit, B, r)
    beam = ub.Beam((0, 0), (1, 0), ub.Section(EA=200.0, GA=1.0, EI=1.0, axial=law), cells=1)

    # Yielding begins, and the load turns, at the ends of steps, so that errors are powers of these.
    stresses = [0, limit, high, *(2 * [high - 2 * limit, low, low + 2 * limit, high])]
    cycles = ub.Table([0, 0.5, *np.linspace(1, 3, 9)], stresses)
    scene = clamped(beam, loads=[ub.PointLoad(beam.end, force=(1.0, 0.0), amplitude=cycles)])
    found = []
    for n in (200, 400):
        run = ub.simulate(scene, MIDDLE, t=(0, 3), dt=1 / n)
        u = run.displacement(beam.end)[:, 0]
        found.append(u[3 * n] - u[2 * n])
    coarse, fine = np.array(found) / exact - 1
    assert 3.9 < coarse / fine < 4.1
    assert abs(4 * fine - coarse) / 3 < 1e-7


@pytest.mark.parametrize("law", ["Bouc-Wen", "degrading"])
def test_bouc_wen_against_integration(law):
    """Independent integration of the equations of Wen, and of Baber and Wen; second order."""
    law = LAWS[law]
    z0, a = law.yield_limit / C, law.hardening

    def x(t):
        return 0.04 * t * np.sin(2 * np.pi * t)

    def rates(t, y):
        z, e = y
        dx = 0.04 * (np.sin(2 * np.pi * t) + 2 * np.pi * t * np.cos(2 * np.pi * t))
        bends = 1 - law.shape + law.shape * np.sign(z * dx)
        dz = dx * (1 - (1 + law.strength * e) * abs(z / z0) ** law.exponent * bends)
        return [dz, z * (dx - dz) / z0**2]

    of_equations = {"method": "DOP853", "rtol": 1e-12, "atol": 1e-15, "max_step": 1e-3}
    z, e = solve_ivp(rates, (0, 2), [0, 0], **of_equations).y[:, -1]
    expected, errors = C * (a * x(2.0) + (1 - a) * z), []
    for n in (3000, 6000):
        found, one = follow(law, x(np.linspace(0, 2, n + 1)[1:]))
        errors.append(abs(found - expected) / law.yield_limit)
        assert one["energy"][0] == pytest.approx(e, rel=2e-6)
    assert errors[1] < 1e-7
    assert errors[0] / errors[1] > 3.5  # second order, and more where errors change their sign


@pytest.mark.parametrize("law", LAWS)
@pytest.mark.parametrize("scheme", [MIDDLE, ub.EnergyMomentumStatic(0.8), END], ids=str)
def test_work_is_stored_or_dissipated(law, scheme):
    """Work is stored, dissipated or lost; over small steps nothing comes back from dissipation."""
    one, stored = Bars(1, LAWS[law], None, scheme), 0.0
    for strain in 0.05 * np.sin(np.linspace(0, 9, 400)[1:]):
        before = one.strain[0]
        (σ,) = one.step([strain])
        plastic, _, lost, elastic, hardening, _, _ = one.points.sums
        work, now = σ * (strain - before) * LENGTH, elastic + hardening
        sinks = plastic + (2 * scheme.theta - 1) * lost
        assert abs(work - (now - stored) - sinks) < 1e-13 * C
        assert plastic > -1e-6  # of second order in the step where a branch turns
        stored = now
    assert one.dissipated()[0][0] > 0.1
