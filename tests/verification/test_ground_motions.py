# SPDX-License-Identifier: MIT
"""Ground motions: spectra, and motions of supports, against other integrations and runs."""

import math

import numpy as np
import pytest
from scenes import on_rail
from scipy.integrate import solve_ivp
from scipy.linalg import eigh

import ufl_beam as ub
import ufl_beam.structures as st
from ufl_beam.structures import response_spectra

# Motions of supports on several processes are in properties/test_combinations.py.
pytestmark = pytest.mark.serial


def made_motion(seed=7, duration=6.0, dt=0.02):
    """A record of filtered noise that begins and ends with zero; m/s²."""
    t = np.arange(0.0, duration, dt)
    noise = np.convolve(np.random.default_rng(seed).standard_normal(t.size), np.hanning(9), "same")
    return st.GroundMotion(dt, noise * np.sin(np.pi * t / t[-1])).scaled(peak=3.0)


MOTION = made_motion()


def nigam_jennings(a, h, w, z):
    """[pub] Displacement and velocity at steps h of a linear acceleration a, from rest.

    Matrices A and B of Nigam and Jennings, Bulletin of the Seismological Society of America 59
    (1969), equations 2.8, as in Chopra, Dynamics of Structures, table 5.2.1.
    """
    r = math.sqrt(1 - z**2)
    wd, e = w * r, math.exp(-z * w * h)
    s, c = math.sin(wd * h), math.cos(wd * h)
    A = e * np.array([[z / r * s + c, s / wd], [-w / r * s, c - z / r * s]])
    p, q = (2 * z**2 - 1) / (w**2 * h), 2 * z / (w**3 * h)
    B = np.array([
        [
            e * ((p + z / w) * s / wd + (q + 1 / w**2) * c) - q,
            -e * (p * s / wd + q * c) - 1 / w**2 + q,
        ],
        [
            e * ((p + z / w) * (c - z / r * s) - (q + 1 / w**2) * (wd * s + z * w * c))
            + 1 / (w**2 * h),
            -e * (p * (c - z / r * s) - q * (wd * s + z * w * c)) - 1 / (w**2 * h),
        ],
    ])  # fmt: skip
    x = np.zeros((len(a), 2))
    for k in range(len(a) - 1):
        x[k + 1] = A @ x[k] + B @ a[k : k + 2]
    return x.T


@pytest.mark.parametrize(("period", "damping"), [(0.2, 0.0), (0.6, 0.05), (5.0, 0.3)])
def test_elastic_spectra_are_those_of_nigam_and_jennings(period, damping):
    """Peaks between steps of 1/500 of the period are larger by (2 π/500)²/8, or 2e-5, at most."""
    w, n = 2 * math.pi / period, max(30, math.ceil(500 * MOTION.dt / period))
    a = np.append(MOTION.values, np.zeros(math.ceil(period / MOTION.dt) + 1))
    h, t = MOTION.dt / n, np.arange((len(a) - 1) * n + 1) / n
    u, v = nigam_jennings(np.interp(t, np.arange(len(a)), a), h, w, damping)
    peaks = [abs(x).max() for x in (u, v, 2 * damping * w * v + w**2 * u)]
    spectrum = st.response_spectrum(MOTION, [period], damping)
    found = spectrum.displacement, spectrum.velocity, spectrum.acceleration
    np.testing.assert_allclose(np.ravel(found), peaks, rtol=4e-5)
    assert spectrum.pseudo_acceleration == pytest.approx(w**2 * spectrum.displacement, rel=1e-14)
    assert spectrum.ductility == 1.0


def test_a_sudden_load_overshoots():
    """[closed] a from t = 0 on: u = a/ω² (1 + exp(-π ζ/sqrt(1 - ζ²))), to (2 π/100)⁴/384."""
    push, ζ = st.GroundMotion(0.1, np.full(30, 2.0)), 0.1
    spectrum = st.response_spectrum(push, [0.7, 1.3], ζ)
    overshoot = 1 + math.exp(-math.pi * ζ / math.sqrt(1 - ζ**2))
    np.testing.assert_allclose(spectrum.pseudo_acceleration, 2.0 * overshoot, rtol=4e-8)


def integrated(motion, w, z, hardening, strength):
    """[calc] Largest displacement of a bilinear oscillator: its rate form, by an integrator.

    The spring force per mass is q + hardening w² u; q stays at its limit while it yields.
    """
    limit = (1 - hardening) * strength
    a = np.append(motion.values, np.zeros(math.ceil(4 * math.pi / w / motion.dt)))

    def rates(t, x):
        u, v, q = x
        k, s = divmod(t / motion.dt, 1.0)
        ground = (1 - s) * a[int(k)] + s * a[min(int(k) + 1, len(a) - 1)]
        restoring = min(max(q, -limit), limit) + hardening * w**2 * u
        yields = abs(q) >= limit and q * v > 0
        rate = 0.0 if yields else (1 - hardening) * w**2 * v
        return v, -ground - 2 * z * w * v - restoring, rate

    end = (len(a) - 1) * motion.dt
    run = solve_ivp(rates, (0, end), [0, 0, 0], rtol=1e-7, atol=1e-9, max_step=motion.dt / 4)
    return abs(run.y[0]).max()


@pytest.mark.parametrize(("period", "hardening"), [(0.3, 0.0), (1.0, 0.1)])
def test_yielding_oscillators_are_those_of_another_integration(period, hardening):
    """Errors are of second order: less than (ω h)²/4 with 100 steps in a period."""
    found = st.response_spectrum(MOTION, [period], ductility=3.0, hardening=hardening)
    strength = found.pseudo_acceleration[0]
    expected = integrated(MOTION, 2 * math.pi / period, 0.05, hardening, strength)
    assert found.displacement[0] == pytest.approx(expected, rel=(2 * math.pi / 100) ** 2 / 4)


def test_a_run_with_the_strength_of_a_spectrum_has_its_ductility():
    """A body on a yielding spring and a damper, in the moving frame.

    The midpoint rule shifts the phase by 2 π (ω h)²/12 in each of the 7.5 periods of the motion.
    """
    period, target, h, mass, hardening = 0.8, 4.0, 0.0025, 2.0, 0.1
    spectrum = st.response_spectrum(MOTION, [period], 0.05, ductility=target, hardening=hardening)
    assert spectrum.ductility[0] == pytest.approx(target, rel=1e-6)
    w, strength = 2 * math.pi / period, spectrum.pseudo_acceleration[0]
    k = mass * w**2
    # In series, the kinematic modulus H leaves k H/(k + H) of the stiffness k.
    law = ub.ElastoPlastic(mass * strength, kinematic=k * hardening / (1 - hardening))
    laws = ub.Spring(k, law=law), ub.Damper(2 * 0.05 * w * mass)
    ground = ub.Gravity((-1, 0), amplitude=MOTION.acceleration)
    scene = on_rail(*laws, mass=mass, loads=[ground])
    run = ub.simulate(scene, ub.EnergyMomentum(), t=(0, MOTION.duration + period), dt=h)
    body = scene.bodies[0].middle
    u, v = run.displacement(body)[:, 0], run.velocity(body)[:, 0]
    error = 7.5 * 2 * math.pi * (w * h) ** 2 / 12
    assert abs(u).max() * w**2 / strength == pytest.approx(target, rel=error)
    assert abs(v).max() == pytest.approx(spectrum.velocity[0], rel=error)


def test_the_strength_is_the_largest_with_the_ductility():
    """The ductility is not monotone: at some periods it is smaller again at smaller strengths."""
    target, again = 3.0, 0
    for period in np.linspace(0.2, 2.0, 16):
        w = 2 * math.pi / period
        elastic = st.response_spectrum(MOTION, [period]).pseudo_acceleration[0]
        found = st.response_spectrum(MOTION, [period], ductility=target).pseudo_acceleration[0]
        peaks = response_spectra._oscillator(MOTION, w, 0.05, 0.0, target)

        def ductility(strength, peaks=peaks, w=w):
            return peaks(strength)[0] * w**2 / strength

        above = np.linspace(found * (1 + 1e-6), elastic, 100)
        assert max(map(ductility, above)) <= target
        assert ductility(found * (1 - 1e-6)) > target
        again += min(map(ductility, np.linspace(0.7, 0.98, 40) * found)) < target
    assert again > 0


# -- motions of supports --------------------------------------------------------------------------


def test_two_supports_with_their_own_motions():
    """Quasi-static influence vectors and modes of a linear frame of two degrees of freedom.

    Columns with fixed rotations have the stiffness GA/H, a girder EA/L.  Damping in proportion to
    the stiffness resists no motion that follows the supports.  Richardson's extrapolation of the
    midpoint rule, with errors c2 h² + c4 h⁴, leaves the square of the larger error.
    """
    height, span, masses, a1 = 3.0, 6.0, (300.0, 500.0), 0.01  # m, m, kg, s
    GA, EA = (3e4, 6e4), 1e5  # N
    motions = [made_motion(seed).scaled(peak=1e-3).corrected() for seed in (1, 2)]
    columns = [
        ub.Beam((x, 0), (x, height), ub.Section(EA=1e8, GA=G, EI=1e5), cells=1)
        for x, G in zip((0, span), GA, strict=True)
    ]
    girder = ub.Beam((0, height), (span, height), ub.Section(EA=EA, GA=1e5, EI=1e5), cells=1)
    scene = ub.Scene(
        [*columns, girder],
        joints=[ub.Rigid(columns[0].end, girder.start), ub.Rigid(columns[1].end, girder.end)],
        supports=[
            *(ub.PrescribedDisplacement(c.end, psi=0.0) for c in columns),
            *(
                ub.PrescribedDisplacement(c.start, u=motion.displacement, v=0.0, psi=0.0)
                for c, motion in zip(columns, motions, strict=True)
            ),
        ],
        masses=[ub.PointMass(c.end, m) for c, m in zip(columns, masses, strict=True)],
        damping=[ub.Rayleigh(stiffness=a1)],
    )

    k, n, dt = np.divide(GA, height), 201, MOTION.dt
    K = np.diag(k) + EA / span * np.array([[1, -1], [-1, 1]])
    M, influence = np.diag(masses), np.linalg.solve(K, np.diag(k))
    ground = np.array([[m.acceleration(dt * i) for i in range(n)] for m in motions])
    moved = np.array([[m.displacement(dt * i) for i in range(n)] for m in motions])
    expected = influence @ moved
    for ω, mode in zip(np.sqrt(eigh(K, M)[0]), eigh(K, M)[1].T, strict=True):
        q, _ = nigam_jennings(mode @ M @ influence @ ground, dt, ω, a1 * ω / 2)
        expected += np.outer(mode, q)

    def found(h):
        run = ub.simulate(scene, ub.EnergyMomentum(), t=(0, dt * (n - 1)), dt=h)
        return np.array([run.displacement(c.end)[:: round(dt / h), 0] for c in columns])

    coarse, fine = found(dt / 2), found(dt / 4)
    size = abs(expected).max()
    errors = [abs(u - expected).max() / size for u in (coarse, fine)]
    assert errors[0] / errors[1] == pytest.approx(4, rel=2 * errors[0])
    assert abs((4 * fine - coarse) / 3 - expected).max() / size < 2 * errors[0] ** 2


@pytest.mark.parametrize("ductility", [2.0, 9.0])
def test_a_yielding_oscillator_turns_after_an_impulse(ductility):
    """[closed] Without damping and hardening: (v0/u_y)²/ω² = 2 μ - 1."""
    speed, dt, period = 0.1, 1e-4, 1.0
    motion = st.GroundMotion(dt, [0.0, speed / dt, 0.0])
    found = st.response_spectrum(motion, [period], 0.0, ductility=ductility)
    strength = speed * 2 * math.pi / period / math.sqrt(2 * ductility - 1)
    assert found.pseudo_acceleration == pytest.approx([strength], rel=2e-3)


def test_the_largest_acceleration_without_damping_is_that_of_the_spring():
    """[closed] At the largest displacement the spring yields: a = h ω² u + (1 - h) ω² u_y."""
    n = np.arange(400)
    motion = st.GroundMotion(0.02, 3 * np.sin(0.1 * n) + 2 * np.sin(0.22 * n + 1))
    T, h = np.array([0.3, 0.5, 0.8, 1.0, 1.7]), 0.1
    found = st.response_spectrum(motion, T, 0.0, ductility=2.0, hardening=h)
    spring = h * (2 * np.pi / T) ** 2 * found.displacement + (1 - h) * found.pseudo_acceleration
    assert found.acceleration == pytest.approx(spring, rel=1e-9)
