# SPDX-License-Identifier: MIT
"""Slider-crank with a flexible rod, driven by a torque for one second, no gravity.

[calc] values of the reference problem S16 (revolute and prismatic joints; data of Stander and
Stein, as in moofeKIT): crank 0.1524 m, E = 2.068427e13 Pa; rod 0.3048 m, E = 2.068427e11 Pa; round,
d = 6.35 mm, 7834.64 kg/m³, ν = 0; 0.01 N m on the crank for 1 s; the slider has no mass.

The printed digits are those of a finite time step: they agree with Δt = 2.5e-3 s here.  The limit
Δt -> 0 of rigid bodies is compared with an ordinary differential equation.
"""

import math
from functools import lru_cache

import numpy as np
import pytest
from convergence.study import extrapolated
from scipy.integrate import solve_ivp

import ufl_beam as ub

CRANK, ROD = 0.1524, 0.3048  # m
DIAMETER, DENSITY, TORQUE = 6.35e-3, 7834.64, 0.01  # m, kg/m³, N m
E_CRANK, E_ROD = 2.068427e13, 2.068427e11  # Pa
AREA, SECOND = math.pi * DIAMETER**2 / 4, math.pi * DIAMETER**4 / 64

TIMES = (0.5, 1.0, 1.5, 2.0, 3.0)
ANGLE = np.array([1.04635, 3.85767, 7.3789, 11.1104, 18.257])  # rad; 3.85764 to 3.8577 at 1 s
SLIDER = np.array([0.35109, 0.17295, 0.34273, 0.2820, 0.4191])  # m
HALF_ANGLE = np.array([0.5e-5, 0.5e-4, 0.5e-4, 0.5e-4, 0.5e-3])
HALF_SLIDER = np.array([0.5e-5, 0.5e-5, 0.5e-5, 0.5e-4, 0.5e-4])
ENERGY = 0.038576  # J


def pulse(t):
    return 1.0 * (t < 1.0)


def section(E):
    return ub.Section(
        EA=E * AREA, GA=0.9 * E / 2 * AREA, EI=E * SECOND, rhoA=DENSITY * AREA,
        rhoI=DENSITY * SECOND,
    )  # fmt: skip


def flexible():
    """Crank and rod as beams."""
    crank = ub.Beam((0, 0), (CRANK, 0), section(E_CRANK), cells=4, name="crank")
    rod = ub.Beam((CRANK, 0), (CRANK + ROD, 0), section(E_ROD), cells=8, name="rod")
    slider = ub.Prismatic(ub.ground(0, 0), rod.end, axis=(1, 0), turning=True)
    return ub.Scene(
        [crank, rod],
        joints=[ub.Revolute(crank.end, rod.start), slider],
        supports=[ub.Pinned(crank.start)],
        loads=[ub.PointLoad(crank.start, moment=TORQUE, amplitude=pulse)],
    )


def inertia(length):
    """Of a bar about its middle; kg m²."""
    return DENSITY * (AREA * length**3 / 12 + SECOND * length)


def rigid():
    """Crank and rod as bodies."""
    mass, ground = DENSITY * AREA, ub.ground(0, 0)
    crank = ub.Body((CRANK / 2, 0), mass=mass * CRANK, inertia=inertia(CRANK), name="crank")
    rod = ub.Body((CRANK + ROD / 2, 0), mass=mass * ROD, inertia=inertia(ROD), name="rod")
    pins = (ground, crank.at(0, 0)), (crank.at(CRANK, 0), rod.at(CRANK, 0))
    slider = ub.Prismatic(ground, rod.at(CRANK + ROD, 0), axis=(1, 0), turning=True)
    return ub.Scene(
        bodies=[crank, rod],
        joints=[*(ub.Revolute(*pair) for pair in pins), slider],
        loads=[ub.PointLoad(crank.middle, moment=TORQUE, amplitude=pulse)],
    )


@lru_cache
def run(make=flexible, dt=5e-3):
    """A run, and the places of the crank and of the slider."""
    solution = ub.simulate(make(), ub.EnergyMomentum(), t=(0, 3), dt=dt)
    if make is rigid:
        crank, rod = solution.scene.bodies
        return solution, crank.middle, rod.at(CRANK + ROD, 0)
    crank, rod = solution.scene.beams
    return solution, crank.start, rod.end


def answer(make, dt):
    """Crank angles and slider positions at TIMES; (2, 5)."""
    solution, crank, slider = run(make, dt)
    n = [int(np.argmin(np.abs(solution.times - t))) for t in TIMES]
    return np.array([solution.displacement(crank)[n, 2], solution.position(slider)[n, 0]])


@lru_cache
def limit(make=flexible):
    """Richardson's limit in time."""
    return extrapolated(answer(make, 5e-3), answer(make, 2.5e-3))


def test_digits_of_the_source():
    """Half a unit of the last digit, and one more for the time step that they were found with."""
    angle, slider = answer(flexible, 2.5e-3)
    assert (np.abs(angle - ANGLE) <= 2 * HALF_ANGLE).all()
    assert (np.abs(slider - SLIDER) <= 2 * HALF_SLIDER).all()


def test_the_limit_of_small_steps():
    """Half a unit of the last digit, and the error of Δt = 2.5e-3 s; parts are nearly rigid.

    The rod bends by some 1e-5 of its length.
    """
    angle, slider = limit()
    errors = np.abs(limit() - answer(flexible, 2.5e-3))
    assert (np.abs(angle - ANGLE) <= HALF_ANGLE + 1.5 * errors[0]).all()
    assert (np.abs(slider - SLIDER) <= HALF_SLIDER + 1.5 * errors[1]).all()
    assert errors[0].max() < 6e-4
    assert errors[1].max() < 1e-4
    exact = by_energy()
    assert (np.abs(angle - exact[0]) < 4e-5 * exact[0]).all()
    assert (np.abs(slider - exact[1]) < 1e-4).all()


@lru_cache
def by_energy():
    """Angle and slider of rigid parts: one differential equation, by SciPy to 1e-10."""
    at_crank = inertia(CRANK) + DENSITY * AREA * CRANK**3 / 4
    mass, J = DENSITY * AREA * ROD, inertia(ROD)

    def lean(θ):
        return np.arcsin(-CRANK * np.sin(θ) / ROD)

    def twice_kinetic(θ):
        φ = lean(θ)
        rate = -CRANK * np.cos(θ) / (ROD * np.cos(φ))
        vx = -CRANK * np.sin(θ) - ROD / 2 * np.sin(φ) * rate
        vy = CRANK * np.cos(θ) + ROD / 2 * np.cos(φ) * rate
        return at_crank + mass * (vx**2 + vy**2) + J * rate**2

    def rates(torque):
        def of(t, y):
            θ, ω = y
            slope = (twice_kinetic(θ + 1e-6) - twice_kinetic(θ - 1e-6)) / 2e-6
            return ω, (torque - slope * ω**2 / 2) / twice_kinetic(θ)

        return of

    how = {"rtol": 1e-11, "atol": 1e-11, "method": "DOP853"}
    first = solve_ivp(rates(TORQUE), (0, 1), (0, 0), t_eval=TIMES[:2], **how)
    then = solve_ivp(rates(0.0), (1, 3), first.y[:, -1], t_eval=TIMES[2:], **how)
    θ = np.r_[first.y[0], then.y[0]]
    return np.array([θ, CRANK * np.cos(θ) + ROD * np.cos(lean(θ))])


def test_bodies_solve_the_differential_equation():
    """The limit of rigid bodies, to the error of a second extrapolation."""
    exact = by_energy()
    error, coarser = (np.abs(answer(rigid, dt) - exact) for dt in (2.5e-3, 5e-3))
    assert (error < coarser / 3.5).all()  # second order
    assert (np.abs(limit(rigid) - exact) < 0.02 * error + 1e-8).all()


@pytest.mark.parametrize("make", [flexible, rigid])
def test_energy_and_joints(make):
    """After the pulse the energy stays, [calc] 0.038576 J; ends stay together to 1e-10 m.

    0.038576 J was found with a time step, too: the work M θ(1 s) has the digits of θ.
    """
    solution, crank, slider = run(make)
    energy, late = solution.energy, solution.times > 1.001
    assert energy.worst < 1e-9
    after = energy.total[late]
    assert np.ptp(after) < 1e-9 * ENERGY
    turned = solution.displacement(crank)[np.argmin(np.abs(solution.times - 1.0)), 2]
    # The work of a dead moment is M 2 tan(Δψ/2), which is more by (Δψ/2)²/3, Δψ up to 0.037
    assert after[-1] == pytest.approx(TORQUE * turned, rel=1.2e-4)
    assert after[-1] == pytest.approx(ENERGY, abs=3e-6)
    np.testing.assert_allclose(energy["kinetic"][late], ENERGY, rtol=0, atol=3e-6)
    assert np.abs(solution.position(slider)[:, 1]).max() < 1e-10
    crank, rod = solution.scene.beams or solution.scene.bodies
    ends = (crank.end, rod.start) if make is flexible else (crank.at(CRANK, 0), rod.at(CRANK, 0))
    gap = solution.position(ends[0]) - solution.position(ends[1])
    assert np.abs(gap).max() < 1e-10
