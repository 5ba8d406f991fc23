# SPDX-License-Identifier: MIT
"""One mechanism stated in two ways gives one result: units, axes, order of its parts."""

import math

import numpy as np
import pytest

import ufl_beam as ub

SAME = 1e-9
"""Part of the result; see test_invariance.py."""

STEPS, STEP = 40, 0.01


class Mechanism:
    """A crank, a flexible rod and a slider with spring, damper, stop and friction.

    Args:
        units: What a metre, a second and a kilogram are in the units of the numbers.
        angle: By which the scene is turned; rad.
        reverse: Whether its parts are given in the opposite order.
    """

    def __init__(self, units=(1.0, 1.0, 1.0), angle=0.0, reverse=False):
        m, s, kg = units
        N = kg * m / s**2
        cos, sin = math.cos(angle), math.sin(angle)

        def at(x, y):
            return (m * (cos * x - sin * y), m * (sin * x + cos * y))

        section = ub.Section(
            EA=1e4 * N, GA=4e3 * N, EI=20 * N * m**2, rhoA=0.5 * kg / m, rhoI=1e-3 * kg * m,
            bending=ub.ElastoPlastic(yield_limit=1.5 * N * m, kinematic=5 * N * m**2),
        )  # fmt: skip
        crank = ub.Body(at(0.15, 0.1), mass=1.0 * kg, inertia=0.02 * kg * m**2, name="crank")
        slider = ub.Body(at(1.3, 0.0), mass=2.0 * kg, inertia=0.1 * kg * m**2, name="slider")
        rod = ub.Beam(at(0.3, 0.2), at(1.3, 0.0), section, cells=4)
        base, far = ub.ground(*at(0, 0)), ub.ground(*at(2.0, 0.0))
        rail = ub.Prismatic(far, slider.middle, axis=(cos, sin))
        joints = [
            ub.Revolute(base, crank.at(*at(0, 0))),
            ub.Revolute(crank.at(*at(0.3, 0.2)), rod.start),
            ub.Revolute(rod.end, slider.middle),
            rail,
        ]
        spring = ub.Spring(30 * N / m, ub.ElastoPlastic(yield_limit=3 * N, isotropic=2 * N / m))
        self.connectors = [
            ub.Turn(
                base, crank.middle, ub.PrescribedForce(lambda t: -4 * N * m * math.cos(5 * t / s))
            ),
            ub.Slide(far, slider.middle, spring, axis=(cos, sin)),
            ub.Slide(far, slider.middle, ub.Damper(0.5 * N * s / m), axis=(cos, sin)),
            ub.Slide(far, slider.middle, ub.Coulomb(0.3 * N, coefficient=0.1, joint=rail)),
            ub.Stretch(base, slider.middle, ub.Stop(500 * N / m, high=0.05 * m)),
            ub.Turn(crank.middle, slider.middle, ub.Spring(2 * N * m)),
        ]
        g = np.array([sin, -cos]) * 9.81 * m / s**2
        bodies, connectors = [crank, slider], list(self.connectors)
        if reverse:
            bodies, joints, connectors = bodies[::-1], joints[::-1], connectors[::-1]
        self.scene = ub.Scene(
            [rod], joints=joints, bodies=bodies, connectors=connectors, loads=[ub.Gravity(tuple(g))]
        )
        run = self.run = ub.simulate(
            self.scene, ub.EnergyMomentum(0.05), t=(0, STEPS * STEP * s), dt=STEP * s
        )
        back = np.array([[cos, sin], [-sin, cos]]) / m
        self.motion = np.array([run.position(p) @ back.T for p in (rod.at(0.5), slider.middle)])
        self.turn = run.displacement(crank.middle)[:, 2]
        self.links = np.array([run.connector(c).work for c in self.connectors]) / (N * m)
        self.force = run.joint(rail).in_a @ back.T * m / N
        self.energy = np.array([run.energy[n] for n in ("plastic", "friction", "damping")]) / (
            N * m
        )


@pytest.fixture(scope="module")
def plain():
    return Mechanism()


def difference(one, other):
    """Largest difference of all that was observed, as a part of its size."""
    return max(
        np.abs(getattr(one, name) - getattr(other, name)).max() / np.abs(getattr(one, name)).max()
        for name in ("motion", "turn", "links", "force", "energy")
    )


def test_everything_happens(plain):
    """Or the tests below show less than they say."""
    assert (plain.energy[:, -1] > 1e-2).all()
    assert (np.diff(plain.energy, axis=1) >= 0).all()
    assert (plain.links[:, -1] != 0).all()
    stopped = plain.run.connector(plain.connectors[4])
    assert (stopped.motion > 0.05).any()
    assert (stopped.motion < 0.05).any()
    assert plain.run.energy.worst < 1e-9


@pytest.mark.parametrize("seed", range(4))
def test_units(plain, seed):
    units = 10 ** np.random.default_rng(seed).uniform(-4, 4, 3)
    other = Mechanism(units=tuple(float(u) for u in units))
    assert difference(plain, other) < SAME
    assert other.run.iterations == plain.run.iterations
    assert other.run.parts == plain.run.parts


@pytest.mark.parametrize("angle", [0.3, 2.0, -math.pi / 2])
def test_axes(plain, angle):
    assert difference(plain, Mechanism(angle=angle)) < SAME


def test_order(plain):
    assert difference(plain, Mechanism(reverse=True)) < SAME
