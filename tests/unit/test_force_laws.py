# SPDX-License-Identifier: MIT
"""Force laws of a user: time, steps, history, energy, and slopes that are infinite at zero."""

import math
from dataclasses import replace

import numpy as np
import pytest
from helpers import raises
from scipy.integrate import quad

import ufl_beam as ub

STIFF = ub.Section(EA=1e7, GA=1e7, EI=1e6, rhoA=1.0, rhoI=1e-2)


def floating(law, load=None):
    """A stiff beam of 1 kg that two connectors of a law hold upwards, with a force midway."""
    beam = ub.Beam((0, 0), (1, 0), STIFF, cells=2)
    springs = [
        ub.Slide(ub.ground(*at.point), at, law, axis=(0, 1)) for at in (beam.start, beam.end)
    ]
    loads = [ub.PointLoad(beam.at(0.5), force=(0, 1.0), amplitude=load)] if load else []
    held = [ub.Roller(beam.start, along=(0, 1))]
    return beam, ub.Scene([beam], supports=held, loads=loads, connectors=springs), springs


def run(scene, scheme=None, **more):
    more = {"t": (0, 1), "dt": 0.05, **more}
    return ub.simulate(scene, scheme or ub.Static(), **more)


# -- infinite slopes ---------------------------------------------------------------------------


def power_law(n, size=1e-3):
    """Ramberg-Osgood without its elastic part: the force |x|^(1/n), with an infinite slope at 0."""
    return ub.ForceLaw(lambda x, rate: math.copysign(abs(x / size) ** (1 / n), x))


@pytest.mark.parametrize(
    ("n", "size", "dt"), [(2, 1.0, 0.25), (3, 3.0, 0.05), (5, 0.1, 0.25), (9, 1.0, 0.05)]
)
def test_an_infinite_slope_at_zero(n, size, dt):
    """A force that changes its sign, and is zero but for a last digit at t = 1/2 and 1 [closed]."""
    # Newton's method, whose steps go to (1 - n) times the motion beside zero, would fail there.
    beam, scene, _ = floating(power_law(n), lambda t: 2 * size * math.sin(2 * math.pi * t))
    solution = run(scene, dt=dt)
    force = size * np.sin(2 * np.pi * solution.times)
    exact = 1e-3 * np.sign(force) * np.abs(force) ** n
    # 1e-9 of the forces is what Newton's method may miss, n times that of the motions.
    found = solution.displacement(beam.end)[:, 1]
    np.testing.assert_allclose(found, exact, rtol=0, atol=n * 1e-9 * np.abs(exact).max())
    # No step is cut, but perhaps to where the force is a last digit (1e-49 m for n = 3).
    before = run(scene, dt=dt, t=(0, 0.5 - dt))
    assert before.substeps == len(before.times) - 1
    assert solution.substeps - (len(solution.times) - 1) in (0, 1, 2)
    assert solution.iterations < 15 * solution.substeps


def test_vibration_of_a_steep_law():
    """Half a period takes √(m/2) ∫ dx / √(U(A) - U(x)) from A to -A [closed]."""
    n, amplitude = 5, 1e-3
    beam, scene, _ = floating(power_law(n))
    bent = run(replace(scene, loads=(ub.PointLoad(beam.at(0.5), force=(0, 2.0)),)), dt=1.0)

    def energy(x):
        return 2 * amplitude * abs(x / amplitude) ** (1 + 1 / n) / (1 + 1 / n)

    top = energy(amplitude)

    def quarter(r):  # x = A (1 - r²): no singularity at A.
        return 2 * r * amplitude / math.sqrt(top - energy(amplitude * (1 - r * r)))

    half = 2 * quad(quarter, 0, 1)[0] * math.sqrt(0.5)
    errors = []
    for steps in (50, 100, 200):
        swung = run(scene, ub.EnergyMomentum(), t=(1, 1 + half), dt=half / steps, start=bent)
        errors.append(abs(swung.displacement(beam.end)[-1, 1] / -amplitude - 1))
        assert swung.energy.worst < 1e-9
        assert swung.substeps == steps
    # It turns around there: errors of its time, of second order in the step, do not show.
    assert errors[0] < 1e-3
    assert max(errors[1:]) < 1e-5


# -- time and steps ----------------------------------------------------------------------------


@pytest.mark.parametrize(
    "scheme", [ub.Static(), ub.EnergyMomentumStatic(0.5), ub.EnergyMomentumStatic()]
)
def test_a_law_that_knows_the_time(scheme):
    """A spring that becomes stiffer: x = F/(2 k) at each time."""
    beam, scene, _ = floating(ub.ForceLaw(lambda x, rate, t: 1e3 * (1 + t) * x), lambda t: 2 * t)
    solution = run(scene, scheme, t=(0, 1), dt=0.25)
    t, found = solution.times, solution.displacement(beam.end)[:, 1]
    if scheme != ub.EnergyMomentumStatic(0.5):
        np.testing.assert_allclose(found, 1e-3 * t / (1 + t), rtol=1e-6)
        return
    middle, mean = (t[1:] + t[:-1]) / 2, (found[1:] + found[:-1]) / 2
    np.testing.assert_allclose(mean, 1e-3 * middle / (1 + middle), rtol=1e-6)


def test_dynamics_tells_the_middle_of_a_step():
    asked = set()

    def force(x, rate, dt, t):
        asked.add((round(t, 9), round(dt, 9)))
        return 0.0

    _, scene, _ = floating(ub.ForceLaw(force), lambda t: 1.0)
    run(scene, ub.EnergyMomentum(), t=(0, 0.2), dt=0.1)
    assert asked == {(0.05, 0.1), (0.15, 0.1)}


# -- history -----------------------------------------------------------------------------------

STIFFNESS, RELAXATION = 1e3, 0.2  # N/m, s


def maxwell(x, rate, dt, state):
    """A spring in series with a damper, by the midpoint rule: its mean force, and that after."""
    before = state[0]
    part = dt / (2 * RELAXATION)
    after = (before * (1 - part) + STIFFNESS * rate * dt) / (1 + part)
    return (before + after) / 2, [after]


def energy(x, state):
    return state[0] ** 2 / (2 * STIFFNESS)


def test_a_history_against_its_closed_form():
    """A mass on a Maxwell element: the force decays as that of the linear system [independent]."""
    beam, scene, _ = floating(ub.ForceLaw(maxwell, [0.0], stored=energy))
    scene = replace(scene, initial=(ub.Velocity((beam,), linear=(0.0, 1.0)),))

    def final(steps):
        solution = run(scene, ub.EnergyMomentum(), dt=1 / steps)
        assert solution.energy.worst < 1e-9
        stored, lost = solution.energy["stored"], solution.energy["functions"]
        assert stored.max() > 0.1
        assert np.all(np.diff(lost) >= -1e-12)  # it dissipates
        return solution.displacement(beam.end)[-1, 1]

    # x'' = -2 f, f' = k x' - f/τ, mass 1
    A = np.array([[0, 1, 0], [0, 0, -2], [0, STIFFNESS, -1 / RELAXATION]])
    values, vectors = np.linalg.eig(A)
    state = vectors @ (np.exp(values) * np.linalg.solve(vectors, np.array([0, 1.0, 0])))
    errors = [abs(final(steps) - state[0].real) for steps in (200, 400, 800)]
    np.testing.assert_allclose(np.log2(np.array(errors[:-1]) / errors[1:]), 2, atol=0.1)


def test_a_law_cannot_change_the_state_that_it_is_given():
    def force(x, rate, state):
        state += 1.0
        return x, state

    _, scene, _ = floating(ub.ForceLaw(force, [0.0]), lambda t: t)
    with pytest.raises(ValueError, match="read-only"):
        run(scene)


# -- what is refused ---------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("make", "says"),
    [
        (lambda: ub.ForceLaw(lambda x, v, z: x), "force has a parameter 'z', which is unknown"),
        (
            lambda: ub.ForceLaw(lambda x, v, state: x),
            "'state', which is unknown; the known ones are t, dt, with ForceLaw(..., state=",
        ),
        (lambda: ub.ForceLaw(lambda x, v: x, [0.0]), "the function has no parameter for the state"),
        (
            lambda: ub.ForceLaw(lambda x, v: x, stored=lambda x, state: 0.0),
            "stored has a parameter 'state'",
        ),
    ],
)
def test_bad_laws_are_refused(make, says):
    with raises(says):
        make()


@pytest.mark.parametrize("returned", [None, (1.0,), (1.0, [1.0, 2.0]), (1.0, ["a"])])
def test_what_a_law_with_a_history_must_return(returned):
    _, scene, _ = floating(ub.ForceLaw(lambda x, v, state: returned, [0.0]), lambda t: t)
    says = "it must return the force and the state, a list"
    with raises("Slide(", "): the function returned ", says):
        run(scene)


def test_an_energy_that_is_no_number_is_named():
    law = ub.ForceLaw(lambda x, v: 1e3 * x, stored=lambda x: None)
    with raises("Slide(", "): the energy returned None"):
        run(floating(law, lambda t: t)[1])
