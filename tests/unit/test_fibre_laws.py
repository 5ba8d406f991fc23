# SPDX-License-Identifier: MIT
"""Laws of steel and concrete fibres against state machines in plain Python, point by point."""

from functools import cache
from itertools import pairwise

import numpy as np
import pytest
from helpers import raises
from scenes import clamped
from uniaxial_points import LENGTH, Bars, C, histories

import ufl_beam as ub
import ufl_beam.structures as st

SCHEMES = [ub.Static(), ub.EnergyMomentumStatic(0.8)]
each_scheme = pytest.mark.parametrize("scheme", SCHEMES, ids=str)


def followed(law, strains, scheme=SCHEMES[0]):
    """Stresses after each step of bars with the strains (steps, bars), and the bars."""
    points, stresses = Bars(strains.shape[1], law, None, scheme), []
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


STEELS = {"kinematic": (3.0, 0.02), "isotropic": (2.0, 0.05, 15.0, 0.9, 0.2, 0.3, 2.0, 0.2, 3.0)}


@each_scheme
@pytest.mark.parametrize("steel", STEELS)
def test_menegotto_pinto_over_random_paths(steel, scheme):
    """[calc] Stresses and dissipated energies of 100 random walks, with partial loops."""
    # They depend on the strains at the ends of steps, not on the scheme.
    parameters, strains = STEELS[steel], histories(100, steps=60)
    found, bars = followed(st.MenegottoPinto(*parameters), strains, scheme)
    expected = np.column_stack([steel02(path, C, *parameters) for path in strains.T])
    assert found == pytest.approx(expected, abs=1e-12 * C)
    lost = work_by_means(strains, expected) - expected[-1] ** 2 / (2 * C)
    assert bars.dissipated()[0] / LENGTH == pytest.approx(lost, abs=1e-12 * C)
    assert lost.max() > 1.0


def test_the_dissipation_of_small_steps_is_the_area_of_the_loops():
    """[calc] Second order: half the step, a quarter of the error; 1e-6 by extrapolation."""

    def paths(n):
        return 0.05 * np.interp(np.arange(1, 4 * n + 1) / n, range(5), [0, 1, -0.4, 0.7, 0.6])

    def lost(n):
        law = st.MenegottoPinto(3.0, 0.02)
        return followed(law, paths(n)[:, None])[1].dissipated()[0][0] / LENGTH

    coarse, middle, fine = (lost(n) for n in (200, 400, 800))
    strains = paths(6400)[:, None]
    stresses = np.array(steel02(strains[:, 0], C, 3.0, 0.02))[:, None]
    exact = work_by_means(strains, stresses)[0] - stresses[-1, 0] ** 2 / (2 * C)
    assert 3.8 < (coarse - middle) / (middle - fine) < 4.2
    assert (4 * fine - middle) / 3 == pytest.approx(exact, rel=1e-6)


def test_errors_of_equilibrium_are_no_reversals():
    """Steps of 1e-9 yield strains to and fro leave the branch of yielding steel."""
    law, far = st.MenegottoPinto(3.0, 0.02), 0.05
    noise = 1e-9 * 3.0 / C * (-1.0) ** np.arange(20)
    strains = np.concatenate([[far], far + noise, [0.055]])[:, None]
    found, _ = followed(law, strains)
    assert found[-1, 0] == pytest.approx(steel02([0.055], C, 3.0, 0.02)[0], rel=1e-8)


# -- concrete ------------------------------------------------------------------------------------


def kent_park(x, f, residual, ultimate):
    """Compressive stress by Scott, Park and Priestley (1982); the parabola begins with C."""
    peak = 2 * f / C
    if x <= peak:
        return f * (2 * x / peak - (x / peak) ** 2)
    return max(residual, f - (f - residual) * (x - peak) / (ultimate - peak))


def mander(x, f, strain, spalling=np.inf):
    """Compressive stress by equations (3) to (6) of Mander, Priestley and Park (1988)."""
    r, ratio = C / (C - f / strain), min(x, 2 * strain if spalling < np.inf else x) / strain
    stress = f * ratio * r / (r - 1 + ratio**r)
    if spalling < np.inf and x > 2 * strain:
        stress *= max(0.0, (spalling - x) / (spalling - 2 * strain))
    return stress


def concrete(strains, backbone, peak, last, t=0.0, crack=None):
    """Stresses and dissipated energies of paths: Concrete01 of OpenSees, and secant tension.

    ``crack`` is the tensile stress at a strain beyond t/C.  Dissipated is the work in many parts of
    each step, minus what unloading returns.
    """
    parts = 500
    largest = widest = work = before = 0.0
    e_last, stresses = 0.0, []
    for target in strains:
        for e in np.linspace(e_last, target, parts + 1)[1:]:
            largest = max(largest, -e)
            η, f = min(largest, last) / peak, backbone(largest)
            ratio = 0.145 * η**2 + 0.13 * η if η < 2 else 0.707 * (η - 2) + 0.84
            if largest - ratio * peak > f / C:
                rest = ratio * peak
                slope = f / (largest - rest)
            else:
                rest, slope = largest - f / C, C
            if e + rest <= 0:
                s = slope * (e + rest)
            else:
                widest = max(widest, e + rest)
                s = C * (e + rest) if widest <= t / C else crack(widest) * (e + rest) / widest
            work += (s + before) / 2 * (target - e_last) / parts
            before = s
        e_last = target
        stresses.append(s)
    return stresses, work - s * (e_last + rest) / 2


t, G = 0.4, 0.02  # Pa, J/m²: cells shorter than 50 m
FURTHER = (G / LENGTH - t**2 / (2 * C)) / t  # strain of the exponential decay


def linear(e):
    """Stress on the line from the limit, with the area G/length below the whole path."""
    return max(0.0, t * (1 - (e - t / C) / (2 * G / (LENGTH * t) - t / C)))


def exponential(e):
    return t * np.exp(-(e - t / C) / FURTHER)


CONCRETES = {
    "Kent-Park": (st.KentPark(3.0, 0.6, 0.08), kent_park, (3.0, 0.6, 0.08), 0.08, None),
    "Kent-Park, linear": (
        st.KentPark(3.0, 0.6, 0.08, tension=ub.LinearSoftening(t, G)),
        kent_park, (3.0, 0.6, 0.08), 0.08, linear,
    ),
    "Kent-Park, exponential": (
        st.KentPark(3.0, 0.0, 0.05, tension=ub.Softening(t, G)),
        kent_park, (3.0, 0.0, 0.05), 0.05, exponential,
    ),
    "Mander": (st.Mander(3.0, 0.04), mander, (3.0, 0.04), np.inf, None),
    "Mander, spalling, linear": (
        st.Mander(3.0, 0.025, 0.08, tension=ub.LinearSoftening(t, G)),
        mander, (3.0, 0.025, 0.08), np.inf, linear,
    ),
}  # fmt: skip


STRAINS = np.concatenate([  # random walks, each step in four
    np.linspace(a, b, 5)[1:] for a, b in pairwise([np.zeros(4), *(histories(4, 10, 3) - 0.01)])
])  # fmt: skip


@cache
def expected_of(name):
    """Stresses (steps, bars) and dissipated energies per volume."""
    law, curve, parameters, last, crack = CONCRETES[name]
    peak = 2 * 3.0 / C if curve is kent_park else law.strain
    paths = [
        concrete(path, lambda x: curve(x, *parameters), peak, last, 0.0 if crack is None else t,
                 crack or (lambda e: 0.0))
        for path in STRAINS.T
    ]  # fmt: skip
    return np.column_stack([s for s, _ in paths]), np.array([lost for _, lost in paths])


@each_scheme
@pytest.mark.parametrize("name", CONCRETES)
def test_concrete_over_random_paths(name, scheme):
    """[calc] Stresses to round-off; energies to the error of the trapezoidal rule, 1e-6.

    They do not depend on the scheme.  Those of Kent and Park are in closed form, and those of
    Mander by Gauss's rule in each step.
    """
    found, bars = followed(CONCRETES[name][0], STRAINS, scheme)
    stresses, lost = expected_of(name)
    assert found == pytest.approx(stresses, abs=1e-12 * C)
    assert bars.dissipated()[0] / LENGTH == pytest.approx(lost, abs=1e-6 * lost.max())
    assert stresses.min() < -2.0


@pytest.mark.parametrize("law", [ub.Softening, ub.LinearSoftening])
@pytest.mark.parametrize("cells", [1, 16])
def test_a_broken_bar_dissipates_the_fracture_energy(law, cells):
    """[closed] G times the area, for any number of cells, of which the first is 10 % weaker."""
    t, G, L = 2.5e6, 100.0, 0.4  # Pa, J/m², m; a bar of G E/t² = 0.48 m would snap back

    def part(a, b, strength, number):
        concrete = st.KentPark(30e6, 6e6, 0.006, law(strength * t, G))
        fibres = ub.Fibres(concrete, number=2)
        section = ub.Section.rectangle(0.02, 0.02, E=30e9, nu=0.2, fibres=fibres)
        return ub.Beam((a, 0), (b, 0), section, cells=number)

    beams = [part(0, L / cells, 0.9, 1)]
    beams += [part(L / cells, L, 1.0, cells - 1)] if cells > 1 else []
    joints = [ub.Rigid(beams[0].end, beams[1].start)] if cells > 1 else []
    pull = ub.PrescribedDisplacement(
        beams[-1].end, u=lambda x: 2.5e-3 * x**2, v=lambda x: 0.0, psi=lambda x: 0.0
    )
    scene = ub.Scene(beams, joints=joints, supports=[ub.Clamped(beams[0].start), pull])
    run = ub.simulate(scene, ub.Static(), t=(0, 1), dt=0.01)
    assert run.energy.lost["plastic"][-1] == pytest.approx(G * 4e-4, rel=1e-6)


# -- refusals ------------------------------------------------------------------------------------


def section_of(law, E=30e9):
    return ub.Section.rectangle(0.3, 0.3, E=E, nu=0.2, fibres=ub.Fibres(law, number=6))


@pytest.mark.parametrize(
    ("make", "parts"),
    [
        (
            lambda: section_of(st.KentPark(3e7, 6e6, 0.0015)),
            ["KentPark: ultimate = 0.0015", "2 strength/E = 0.002", "turn back"],
        ),
        (
            lambda: section_of(st.Mander(3e7, 0.002), E=15e9),
            ["Mander: E = 1.5e+10", "1.02 strength/strain = 1.53e+10", "turns back"],
        ),
    ],
)
def test_laws_that_turn_back_are_refused(make, parts):
    with raises(*parts):
        make()


def test_a_cell_that_is_too_long_for_the_fracture_energy_is_refused():
    """[closed] Longest cell: 2 G E/t² = 0.96 m; the message names the place."""
    law = st.KentPark(30e6, 6e6, 0.01, ub.Softening(2.5e6, 100.0))
    scene = clamped(ub.Beam((0, 0), (0, 2), section_of(law), cells=2, name="column"))
    with raises("column at (0, 0.5): KentPark: tension", "1 m", "0.96 m", "above 104"):
        ub.simulate(scene, ub.Static(), t=(0, 1), dt=0.5)
    ub.simulate(scene, ub.Static(), t=(0, 1), dt=0.5, mesh=ub.Mesh(refine=2))


def test_confined_strengths():
    """[calc] Equations of both papers by hand, for f = 30 MPa."""
    law = st.Mander.confined(30e6, 3e6)
    K = -1.254 + 2.254 * 1.794**0.5 - 0.2
    assert law.strength == pytest.approx(30e6 * K, rel=1e-12)
    assert law.strain == pytest.approx(0.002 * (1 + 5 * (K - 1)), rel=1e-12)
    law = st.KentPark.confined(30e6, ratio=0.02, yield_limit=300e6, width=0.4, spacing=0.1)
    Z = 0.5 / (11.7 / 3350 + 0.75 * 0.02 * 2 - 0.002 * 1.2)
    assert law.strength == pytest.approx(36e6, rel=1e-12)
    assert law.residual == pytest.approx(7.2e6, rel=1e-12)
    assert law.ultimate == pytest.approx(0.0024 + 0.8 / Z, rel=1e-12)
