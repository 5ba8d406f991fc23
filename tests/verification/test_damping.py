# SPDX-License-Identifier: MIT
"""Rayleigh and Kelvin-Voigt damping against closed forms of a damped mode, and the ledger."""

import math

import numpy as np
import pytest
from helpers import assert_balanced, raises
from scenes import clamped

import ufl_beam as ub
import ufl_beam.structures as st

BETA = 1.875104068711961  # first root of 1 + cos x cosh x = 0, S18 [closed]
SECTION = ub.Section.rectangle(b=0.02, h=0.02, E=200e9, nu=0.3, rho=7850.0)
OMEGA = BETA**2 * math.sqrt(SECTION.EI / SECTION.rhoA)  # rad/s, of a cantilever of 1 m
PERIOD = 2 * math.pi / OMEGA  # s
RATIO = 0.02

KINDS = {
    "mass": [ub.Rayleigh(mass=2 * RATIO * OMEGA)],
    "stiffness": [ub.Rayleigh(stiffness=2 * RATIO / OMEGA)],
    "both": [ub.Rayleigh(mass=RATIO * OMEGA, stiffness=RATIO / OMEGA)],
    "Kelvin-Voigt": [ub.KelvinVoigt(2 * RATIO / OMEGA)],
    "two": [ub.KelvinVoigt(RATIO / OMEGA), ub.Rayleigh(stiffness=RATIO / OMEGA)],
}


@pytest.mark.parametrize("kind", KINDS)
def test_damping_ratio_of_the_first_mode(kind):
    """[closed] ζ = a0/(2ω) + a1 ω/2, P(92); a cantilever let go from the shape of a tip force.

    Higher modes are 3 % of the tip at most.  a0 alone leaves them in the peaks: the fit over 5 of
    them is off by about 3 %/(5 · 2π ζ).
    """
    beam = ub.Beam((0, 0), (1, 0), SECTION, cells=8)
    pull = ub.PointLoad(beam.end, force=(0, 1.0), amplitude=ub.ramp(1.0))
    pulled = ub.simulate(clamped(beam, loads=[pull]), ub.Static(), t=(0, 1), dt=1.0)
    steps = {"t": (0, 6 * PERIOD), "dt": PERIOD / 100}
    scene = clamped(beam, damping=KINDS[kind])
    solution = ub.simulate(scene, ub.EnergyMomentum(), start=pulled, **steps)
    found = st.damping(solution.times, solution.displacement(beam.end)[:, 1])
    assert found.better == "exponential"
    tolerance = 0.05 if kind == "mass" else 0.01
    assert found.fitted_ratio == pytest.approx(RATIO, rel=tolerance)
    assert_balanced(solution.energy)
    assert solution.energy["damping"][-1] > 0.2 * solution.energy.total[0]


def spinning(damping):
    """A free beam spinning at one turn per second, its first turn."""
    beam = ub.Beam((0, 0), (1, 0), SECTION, cells=4)
    spin = ub.Velocity((beam,), angular=2 * math.pi, about=(0.5, 0.0))
    scene = ub.Scene([beam], initial=[spin], damping=[damping])
    return ub.simulate(scene, ub.EnergyMomentum(), t=(0, 1), dt=0.01)


def test_kelvin_voigt_is_objective():
    """[closed] The strain ρω²(L²/4 - x²)/(2E) creeps and dissipates the energy that it stores.

    Cells of L/4 have a 16th of it less.
    """
    solution = spinning(ub.KelvinVoigt(1e-3))
    stretch = SECTION.EA / 2 * (SECTION.rhoA * (2 * math.pi) ** 2 / (2 * SECTION.EA)) ** 2 / 30
    assert solution.energy["damping"][-1] == pytest.approx(stretch, rel=1 / 16)
    momentum = solution.momentum()[:, 2]
    np.testing.assert_allclose(momentum, momentum[0], rtol=1e-10)


def test_rayleigh_is_not():
    """Its stiffness is that of the undeformed scene: turns cost work."""
    with pytest.warns(ub.ModelWarning, match="resists rigid turning"):
        solution = spinning(ub.Rayleigh(stiffness=1e-6))
    assert solution.energy["damping"][-1] > 0.01 * solution.energy["kinetic"][0]
    assert solution.energy.worst < 1e-9


def test_kelvin_voigt_in_statics_is_retarded():
    """A bar under constant force creeps to N L/EA as 1 - exp(-t/time) [closed]; backward Euler."""
    section = ub.Section(EA=100.0, GA=100.0, EI=1.0)
    beam = ub.Beam((0, 0), (1, 0), section, cells=1)
    creep = 0.5  # s

    def stretched(dt):
        scene = clamped(
            beam, loads=[ub.PointLoad(beam.end, force=(0.01, 0))], damping=[ub.KelvinVoigt(creep)]
        )
        solution = ub.simulate(scene, ub.EnergyMomentumStatic(), t=(0, 1), dt=dt)
        assert solution.energy.worst < 1e-9
        return solution.displacement(beam.end)[-1, 0]

    exact = 1e-4 * (1 - math.exp(-1 / creep))
    errors = [abs(stretched(dt) - exact) for dt in (0.1, 0.05, 0.025)]
    assert errors[0] < 0.1 * exact
    rates = np.log2(np.array(errors[:-1]) / errors[1:])
    assert np.all(np.abs(rates - 1) < 0.1)


def test_a_cell_with_a_hinge_is_left_out():
    """A hinge that bears nothing turns freely beside damped cells."""
    section = ub.Section(EA=1e6, GA=1e6, EI=100.0, rhoA=1.0, rhoI=1e-3)
    joint = ub.Softening(limit=0.0, fracture_energy=1.0)
    beam = ub.Beam((0, 0), (1, 0), section, cells=4, hinges={0.0: joint})
    scene = clamped(
        beam,
        initial=[ub.Velocity((beam,), angular=0.0)],
        loads=[ub.PointLoad(beam.end, force=(0, 1.0), amplitude=lambda t: float(t < 0.1))],
        damping=[ub.KelvinVoigt(0.01)],
    )
    solution = ub.simulate(scene, ub.EnergyMomentum(), t=(0, 1), dt=0.005)
    assert abs(solution.displacement(beam.end)[-1, 2]) > 0.1
    # The arm is rigid beside the hinge: its damping takes a small part of the work.
    assert solution.energy["damping"][-1] < 0.05 * solution.energy["loads"][-1]
    assert solution.energy.worst < 1e-9


BEAM, STRAY = (ub.Beam((0, 0), (1, 0), SECTION, name=name) for name in ("beam", "stray"))
BAD = [
    (lambda: ub.Rayleigh(mass=-1.0), "Rayleigh: mass = -1 must be at least 0"),
    (lambda: ub.Rayleigh(), "mass and stiffness are both zero"),
    (lambda: ub.KelvinVoigt(0.0), "KelvinVoigt: retardation_time = 0 must be positive"),
    (lambda: ub.KelvinVoigt(1.0, beams=[1]), "KelvinVoigt: beams[0] = 1 is not a Beam"),
    (
        lambda: ub.Scene([BEAM], damping=[ub.KelvinVoigt(1.0, beams=[STRAY])]),
        "KelvinVoigt: stray is not in the scene",
    ),
    (
        lambda: ub.Simulation(clamped(BEAM, damping=KINDS["both"]), ub.Static()),
        "statics has no inertia. Leave it out",
    ),
]


@pytest.mark.parametrize(("make", "words"), BAD, ids=[words for _, words in BAD])
def test_bad_damping_is_refused(make, words):
    with raises(words):
        make()
