# SPDX-License-Identifier: MIT
"""Works that a user states: wind drag, an elastic foundation, a magnetised beam; see works.md."""

import math

import numpy as np
import pytest
import ufl
from convergence.study import orders
from scenes import clamped
from scipy.integrate import quad, solve_ivp
from scipy.optimize import brentq

import ufl_beam as ub

TIGHT = ub.Newton(rtol=1e-13)


# -- wind drag on a falling, free beam ---------------------------------------------------------

LENGTH, MASS, DRAG = 2.0, 0.5, 0.05  # m, kg/m, N s²/m³: of a plank 10 cm wide in air
WIND = (4.0, 0.5)  # m/s
TIME = 1.5  # s


def drag(v, w, c, wx, wy):
    """½ ρ c d |v| v against the air, per length."""
    v_x, v_y = v[0] - wx, v[1] - wy
    return -c * ufl.sqrt(v_x**2 + v_y**2 + 1e-12) * (v_x * w[0] + v_y * w[1])


def falling(dt):
    """A stiff plank, thrown up into the wind with a spin of 3 rad/s."""
    section = ub.Section(EA=1e7, GA=1e7, EI=1e6, rhoA=MASS, rhoI=1e-3)
    beam = ub.Beam((-1, 0), (1, 0), section, cells=16)
    numbers = {"c": DRAG, "wx": WIND[0], "wy": WIND[1]}
    thrown = ub.Velocity((beam,), linear=(1.0, 5.0), angular=3.0)
    wind = ub.VirtualWork("wind", drag, numbers=numbers)
    scene = ub.Scene([beam], loads=[ub.Gravity()], initial=[thrown], works=[wind])
    solution = ub.simulate(scene, ub.EnergyMomentum(), t=(0, TIME), dt=dt, newton=TIGHT)
    return solution.displacement(beam.at(0.5))[-1], solution


def rigid_plank():
    """(x, y, ψ) of a rigid plank at the end, by an integrator of order 8 and 40 points of drag."""
    points, weights = np.polynomial.legendre.leggauss(40)
    s, weights = LENGTH / 2 * points, LENGTH / 2 * weights
    inertia = MASS * LENGTH**3 / 12 + 1e-3 * LENGTH

    def rates(_, state):
        _, _, ψ, vx, vy, ω = state
        arm = np.array([np.cos(ψ) * s, np.sin(ψ) * s])
        air = np.array([vx - ω * arm[1] - WIND[0], vy + ω * arm[0] - WIND[1]])
        force = -DRAG * np.hypot(*air) * air
        total, moment = force @ weights, (arm[0] * force[1] - arm[1] * force[0]) @ weights
        m = MASS * LENGTH
        return [vx, vy, ω, total[0] / m, total[1] / m - 9.81, moment / inertia]

    start = [0, 0, 0, 1.0, 5.0, 3.0]
    return solve_ivp(rates, (0, TIME), start, "DOP853", rtol=1e-12, atol=1e-12).y[:3, -1]


def test_wind_drag_on_a_falling_beam():
    """[calc] The midpoint rule is of second order; the plank bends by F L³/(100 EI) = 1e-7 m."""
    exact, steps = rigid_plank(), (0.02, 0.01, 0.005)
    runs = [falling(dt) for dt in steps]
    motions = [motion for motion, _ in runs]
    errors = [np.abs(motion - exact).max() for motion in motions]
    np.testing.assert_allclose(orders(errors), 2, atol=0.1)
    extrapolated = (4 * motions[2] - motions[1]) / 3
    assert np.abs(extrapolated - exact).max() < 0.03 * errors[2]
    for _, solution in runs:
        assert solution.energy.worst < 1e-9
        assert solution.energy["wind"][-1] < -5  # J


# -- a beam on an elastic foundation -----------------------------------------------------------


def hetenyi(λl, force, λ, k, EI):
    """Deflection and moment under a force in the middle of a free beam on a foundation.

    M. Hetényi, Beams on Elastic Foundation (1946), finite beams with free ends, (46a) and (46b).
    """
    down = math.sinh(λl) + math.sin(λl)
    y = force * λ / (2 * k) * (math.cosh(λl) + math.cos(λl) + 2) / down
    return y, force / (4 * λ) * (math.cosh(λl) - math.cos(λl)) / down


def on_soil(mesh):
    """A rail of stiffness 1 N m² and 4 m on soil of 4 N/m², so that λ = 1/m, under 1e-4 N."""
    section = ub.Section(EA=1e10, GA=1e10, EI=1.0)
    beam = ub.Beam((0, 0), (4, 0), section, cells=2)
    load = ub.PointLoad(beam.at(0.5), force=(0, -1e-4), amplitude=lambda t: t)
    soil = ub.Potential("soil", lambda q, k: k * q[1] ** 2 / 2, numbers={"k": 4.0})
    held = [ub.PrescribedDisplacement(beam.at(0.5), u=0.0)]
    scene = ub.Scene([beam], supports=held, loads=[load], works=[soil])
    return beam, ub.simulate(scene, ub.Static(), t=(0, 1), dt=0.5, mesh=mesh, newton=TIGHT)


@pytest.mark.parametrize(("degree", "cells"), [(1, (8, 16, 32)), (2, (4, 8, 16)), (3, (2, 4, 8))])
def test_beam_on_an_elastic_foundation(degree, cells):
    """[closed] Orders 2, 4, 6.  Deflections are 5e-5 m: their squares do not count.

    Moments of degree 1 are those of the middles of cells, λ² h² of them at most off.
    """
    y, moment = hetenyi(4.0, 1e-4, 1.0, 4.0, 1.0)
    errors = []
    for n in cells:
        beam, solution = on_soil(ub.Mesh(refine=n, degree=degree))
        errors.append(abs(-solution.displacement(beam.at(0.5))[-1, 1] - y) / y)
        assert solution.energy.worst < 1e-9
        assert solution.energy["soil"][-1] > 1e-10  # J
    np.testing.assert_allclose(orders(errors), 2 * degree, atol=0.15)
    assert errors[-1] < 2e-3
    if degree == 1:
        near, h = solution.section_forces(beam)[n - 1 : n + 1, 2], 2 / n
        np.testing.assert_allclose(near, moment - 1e-4 / 2 * h / 2, rtol=h**2)


# -- a magnetised beam -------------------------------------------------------------------------


def magnetic_elastica(a):
    """Rotation of the tip of a magnetised cantilever across a field, a = m B L²/EI.

    EI ψ'' + m B cos ψ = 0 has the integral ψ'² = 2 a (sin ψ_L - sin ψ)/L²; sin ψ = sin ψ_L - r².
    """

    def length(tip):
        top = math.sin(tip)

        def slow(r):
            return 2 / math.sqrt(1 - (top - r**2) ** 2)

        return quad(slow, 0, math.sqrt(top), epsabs=1e-13)[0] / math.sqrt(2 * a)

    return brentq(lambda tip: length(tip) - 1, 1e-6, math.pi / 2 - 1e-4, xtol=1e-14)


@pytest.mark.parametrize(("degree", "cells"), [(1, (8, 16)), (2, (4, 8))])
def test_a_magnet_across_a_field(degree, cells):
    """[closed] Dipoles along the axis, bent by 1.1 rad, with the potential -m B sin ψ."""
    beam = ub.Beam((0, 0), (1, 0), ub.Section(EA=1e7, GA=1e7, EI=1.0), cells=1)
    numbers, errors = {"b": lambda t: 4.0 * t}, []
    field = ub.Potential("field", lambda q, b: -b * ufl.sin(q[2]), beams=[beam], numbers=numbers)
    for n in cells:
        more = {"mesh": ub.Mesh(refine=n, degree=degree), "newton": TIGHT}
        scene = clamped(beam, works=[field])
        solution = ub.simulate(scene, ub.Static(), t=(0, 1), dt=0.25, **more)
        errors.append(abs(solution.displacement(beam.end)[-1, 2] - magnetic_elastica(4.0)))
    np.testing.assert_allclose(orders(errors), 2 * degree, atol=0.2)
    exact = ub.simulate(scene, ub.EnergyMomentumStatic(), t=(0, 1), dt=0.25, **more)
    assert exact.energy.worst < 1e-9
    assert exact.energy["field"][-1] < -1


def test_a_current_in_a_field():
    """[closed] A wire under I B n per length becomes an arc of the radius r; T = I B r."""
    section = ub.Section(EA=1e5, GA=1e5, EI=1e-4)
    beam = ub.Beam((0, 0), (1, 0), section, cells=32)

    def lorentz(q1, w, axis, t, IB):
        tangent = axis.t0 + axis.d(ufl.as_vector([q1[0], q1[1]]))
        return t * IB * (-tangent[1] * w[0] + tangent[0] * w[1])

    closer = ub.PrescribedDisplacement(beam.end, u=lambda t: -0.1 * t, v=0.0)
    wire = ub.VirtualWork("current", lorentz, numbers={"IB": 50.0})
    scene = ub.Scene([beam], supports=[ub.Pinned(beam.start), closer], works=[wire])
    solution = ub.simulate(scene, ub.Static(), t=(0, 1), dt=0.02, newton=TIGHT)
    # An arc of length 1 over a chord of 0.9: sin x/x = 0.9 with x half its angle.
    half = brentq(lambda x: math.sin(x) / x - 0.9, 0.1, 2.0)
    radius = 1 / (2 * half)
    tension = solution.section_forces(beam)[:, 0]
    np.testing.assert_allclose(tension[8:-8], 50.0 * radius, rtol=2e-3)
