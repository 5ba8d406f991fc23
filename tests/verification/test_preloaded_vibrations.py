# SPDX-License-Identifier: MIT
"""Small free vibrations about preloaded states, computed step by step, against modes about them."""

from itertools import pairwise

import numpy as np
import pytest
from scenes import clamped

import ufl_beam as ub

SECTION = ub.Section(EA=1e5, GA=1e5, EI=1.0, rhoA=1.0)
PERIODS, STEPS = 8, 100  # steps a period
TIGHT = ub.Newton(rtol=1e-13)  # of forces that are large beside those of so small a motion


def cantilever(**more):
    beam = ub.Beam((0, 0), (1, 0), SECTION, cells=8)
    loads = more.pop("loads", lambda beam: [])(beam)
    return beam.end, clamped(beam, loads=loads, **more)


def field(q, axis, p):
    return p * (0.2 * q[1] + 2 * q[1] ** 2 - 4 * q[0])


def pendulum():
    """A flexible rod that hangs from a pin."""
    beam = ub.Beam((0, 0), (0, -1), SECTION, cells=8)
    return beam.end, ub.Scene([beam], supports=[ub.Pinned(beam.start)], loads=[ub.Gravity()])


def string_of_rods():
    """A body that hangs from two rods."""
    points = [(0, 0), (0, -0.5), (0, -1)]
    rods = [ub.Beam(a, b, SECTION, cells=4) for a, b in pairwise(points)]
    bob = ub.Body((0, -1), mass=2.0, inertia=0.01)
    joints = [ub.Revolute(rods[0].end, rods[1].start), ub.Rigid(rods[1].end, bob.middle)]
    parts = {"supports": [ub.Pinned(rods[0].start)], "loads": [ub.Gravity()], "bodies": [bob]}
    return rods[0].end, ub.Scene(rods, joints=joints, **parts)


PRELOADED = {
    "tension": lambda: cantilever(loads=lambda b: [ub.PointLoad(b.end, force=(5, 0))]),
    "compression": lambda: cantilever(loads=lambda b: [ub.PointLoad(b.end, force=(-2, 0))]),
    "large bending": lambda: cantilever(loads=lambda b: [ub.PointLoad(b.end, force=(0, -3))]),
    "follower": lambda: cantilever(loads=lambda b: [ub.FollowerLoad(b.end, force=(0, -3))]),
    "rotating frame": lambda: cantilever(loads=lambda b: [ub.RotatingFrame(5.0, about=(-1, 0))]),
    "potential": lambda: cantilever(
        works=[ub.Potential("field", field, numbers={"p": ub.ramp(1.0)})]
    ),
    "pendulum": pendulum,
    "string of rods": string_of_rods,
}


@pytest.mark.parametrize("preload", PRELOADED)
def test_modes_against_free_vibration(preload):
    """Started in the first mode with an amplitude of 1e-3, it has the period of that mode.

    EnergyMomentum lengthens it by Ω²/12, Ω = 2π/100.  Zeros are found by straight lines between
    the steps, to 8e-6 of the time in all.
    """
    place, scene = PRELOADED[preload]()
    rest = ub.simulate(scene, ub.Static(), t=(0, 1), dt=0.1)
    found = ub.modes(scene, 1, at=rest)
    ω, φ = found.omega[0], found.shape(0, place).real
    across = int(np.abs(found.shape(0, place)[:2]).argmax())
    swing = found.motion(0, amplitude=1e-3, count=4)  # from the largest displacement
    dt = 2 * np.pi / ω / STEPS
    # A solution of the same beams is a state to start in, and it begins with no velocity.
    steps = {"t": (1, 1 + PERIODS * STEPS * dt), "dt": dt, "newton": TIGHT}
    run = ub.simulate(scene, ub.EnergyMomentum(), start=swing, **steps)
    x = run.displacement(place)[:, across] - rest.displacement(place)[-1, across]
    zeros = np.flatnonzero(x[:-1] * x[1:] < 0)
    at = run.times[zeros] + dt * x[zeros] / (x[zeros] - x[zeros + 1])
    period = 2 * (at[-1] - at[0]) / (len(at) - 1)
    Ω = 2 * np.pi / STEPS
    assert len(at) >= 2 * PERIODS - 1
    assert period * ω / (2 * np.pi) == pytest.approx(1 + Ω**2 / 12, abs=5e-5), φ
