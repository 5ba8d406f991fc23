# SPDX-License-Identifier: MIT
"""Force laws of a user: time, steps, history, energy, and slopes that are infinite at zero."""

import math
import re
from functools import partial

from mpi4py import MPI

import numpy as np
import pytest
from helpers import require_restart
from scenes import clamped
from scipy.integrate import quad
from scipy.optimize import brentq

import ufl_beam as ub

STIFF = ub.Section(EA=1e7, GA=1e7, EI=1e6, rhoA=1.0, rhoI=1e-2)
SOFT = ub.Section(EA=1e6, GA=1e6, EI=1.0, rhoA=1.0, rhoI=1e-2)


def floating(law, load=None, **more):
    """A stiff beam of 1 kg that two connectors of a law hold upwards, with a force midway."""
    beam = ub.Beam((0, 0), (1, 0), STIFF, cells=2)
    springs = [
        ub.Slide(ub.ground(*at.point), at, law, axis=(0, 1)) for at in (beam.start, beam.end)
    ]
    loads = [ub.PointLoad(beam.at(0.5), force=(0, 1.0), amplitude=load)] if load else []
    held = [ub.Roller(beam.start, along=(0, 1))]
    return beam, ub.Scene([beam], supports=held, loads=loads, connectors=springs, **more), springs


def run(scene, scheme=None, **more):
    more = {"t": (0, 1), "dt": 0.05, **more}
    return ub.simulate(scene, scheme or ub.Static(), **more)


# -- infinite slopes ---------------------------------------------------------------------------


def power_law(n, size=1e-3):
    """Ramberg-Osgood without its elastic part: the force |x|^(1/n), with an infinite slope at 0."""
    return ub.ForceLaw(lambda x, rate: math.copysign(abs(x / size) ** (1 / n), x))


@pytest.mark.parametrize("n", [2, 3, 5, 9])
@pytest.mark.parametrize("size", [0.1, 1.0, 3.0])
@pytest.mark.parametrize("dt", [0.25, 0.05])
def test_an_infinite_slope_at_zero(n, size, dt):
    """A force that changes its sign, and is zero but for a last digit at t = 1/2 and 1 [closed].

    Newton's method, whose steps go to (1 - n) times the motion beside zero, would fail there.
    """
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


@pytest.mark.parametrize("stiffness", [1e-3, 1.0, 1e3, 1e6])
def test_an_infinite_slope_beside_any_stiffness(stiffness):
    """A spring in parallel: F = |x|^(1/5) + k x, solved for x by bisection [independent]."""
    beam, scene, springs = floating(power_law(5), lambda t: 2.0 * math.sin(2 * math.pi * t))
    elastic = [ub.Slide(s.a, s.b, ub.Spring(stiffness), axis=(0, 1)) for s in springs]
    scene = ub.Scene(
        [beam], supports=scene.supports, loads=scene.loads, connectors=[*springs, *elastic]
    )
    solution = run(scene)
    found = solution.displacement(beam.end)[:, 1]
    for force, x in zip(np.sin(2 * np.pi * solution.times), found, strict=True):

        def excess(x, force=force):
            return math.copysign(abs(x / 1e-3) ** 0.2, x) + stiffness * x - force

        exact = brentq(excess, -1e-2, 1e-2, xtol=1e-300, rtol=1e-15, maxiter=9999)
        assert x == pytest.approx(exact, rel=1e-7, abs=1e-12)
    assert solution.substeps == len(solution.times) - 1


def test_several_steep_laws_on_a_beam():
    """Three of them under a soft beam, which makes them work against each other; and a load."""
    beam = ub.Beam((0, 0), (3, 0), SOFT, cells=6)
    places = [beam.at(s) for s in (1 / 3, 2 / 3, 1.0)]
    props = [ub.Slide(ub.ground(*p.point), p, power_law(5), axis=(0, 1)) for p in places]
    push = ub.PointLoad(beam.at(0.5), force=(0, 1.0), amplitude=lambda t: math.sin(2 * math.pi * t))
    scene = clamped(beam, loads=[push], connectors=props)
    solution = run(scene)
    # Last digits decide whether a step is cut: all laws have infinite slopes at t = 1/2.
    assert solution.substeps - (len(solution.times) - 1) in (0, 1, 2)
    for prop in props:
        history = solution.connector(prop)
        law = np.sign(history.motion) * np.abs(history.motion / 1e-3) ** 0.2
        # Beside zero the last digit of a motion of 1e-3 m makes a force of (1e-16)^(1/5) = 6e-4.
        np.testing.assert_allclose(history.force, law, atol=1e-3)


def test_vibration_of_a_steep_law():
    """Half a period takes √(m/2) ∫ dx / √(U(A) - U(x)) from A to -A [closed]."""
    n, amplitude = 5, 1e-3
    beam, scene, _ = floating(power_law(n))
    start = scene.supports[0]
    moved = ub.Scene(
        [beam], supports=[start], loads=[ub.PointLoad(beam.at(0.5), force=(0, 2.0))],
        connectors=scene.connectors,
    )  # fmt: skip
    bent = run(moved, dt=1.0)

    def energy(x):
        return 2 * amplitude * abs(x / amplitude) ** (1 + 1 / n) / (1 + 1 / n)

    top = energy(amplitude)
    # x = A (1 - r²): no singularity at A.
    quarter = quad(
        lambda r: 2 * r * amplitude / math.sqrt(top - energy(amplitude * (1 - r * r))), 0, 1
    )[0]
    half = 2 * quarter * math.sqrt(0.5)
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
    law = ub.ForceLaw(maxwell, [0.0], stored=energy)

    def final(steps):
        beam, scene, springs = floating(law, initial=[])
        kick = ub.Velocity((beam,), linear=(0.0, 1.0))
        scene = ub.Scene([beam], supports=scene.supports, initial=[kick], connectors=springs)
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


def counting(x, rate, state):
    """Two internal variables: steps so far, and a sum of motions."""
    return 1e3 * x, state + np.array([1.0, x])


def test_internal_variables_change_with_accepted_steps_only():
    """Neither iterations nor steps that are tried and cut count."""
    law = ub.ForceLaw(counting, state=[0.0, 0.0])
    _, scene, _ = floating(law, lambda t: 2.0 * t)
    simulation = ub.Simulation(scene, ub.Static())
    state = simulation.connector_terms[0].state
    simulation.attempt(0.5)
    assert state["state 0"][0, 0] == 0.0
    for n, t in enumerate((0.25, 0.5, 1.0)):
        simulation.step_to(t)
        assert state["state 0"][0, 0] == n + 1
    assert state["state 1"][0, 0] == pytest.approx(1e-3 * (0.25 + 0.5 + 1.0))
    simulation.close()


def test_a_law_cannot_change_the_state_that_it_is_given():
    def force(x, rate, state):
        state += 1.0
        return x, state

    _, scene, _ = floating(ub.ForceLaw(force, [0.0]), lambda t: t)
    with pytest.raises(ValueError, match="read-only"):
        run(scene)


def hysteretic(x, rate, dt, state):
    """Bouc and Wen's law with β = γ = 1/2, which is soft from 1 mm on."""
    z, way = state[0], rate * dt / 1e-3
    after = (z + way) / (1 + abs(way) * (way * z > 0))
    return (z + after) / 2, [after]


def machine():
    law = ub.ForceLaw(hysteretic, [0.0])
    beam, scene, springs = floating(law)
    more = ub.Slide(ub.ground(0.5, 0), beam.at(0.5), ub.ForceLaw(counting, [0, 0]), axis=(0, 1))
    push = ub.PointLoad(beam.at(0.5), force=(0, 4.0), amplitude=lambda t: math.sin(20 * t))
    return ub.Scene([beam], supports=scene.supports, loads=[push], connectors=[*springs, more])


@pytest.mark.parametrize("scheme", [ub.EnergyMomentum(), ub.Newmark()])
def test_a_run_goes_on_from_a_checkpoint(scheme, shared_path):
    scene = machine()
    short = partial(run, dt=0.01)
    whole = require_restart(short, scene, scene.connectors, scheme, shared_path, until=2)
    assert np.ptp(whole.displacement(scene.beams[0].end)[:, 1]) > 1e-3


def test_any_number_of_processes():
    scene = machine()
    all_of_us, alone = (
        run(scene, ub.EnergyMomentum(), dt=0.01, comm=comm)
        for comm in (MPI.COMM_WORLD, MPI.COMM_SELF)
    )
    np.testing.assert_allclose(all_of_us.q, alone.q, atol=1e-9)


def test_the_reference_path(as_by_reference):
    newton = ub.Newton(rtol=1e-12)
    as_by_reference(run(machine(), ub.EnergyMomentum(), dt=0.01, newton=newton))


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
        (lambda: ub.ForceLaw(lambda x, v: x, 3.0), "ForceLaw: state has shape ()"),
        (lambda: ub.ForceLaw(lambda x, v: x, ["a"]), "ForceLaw: state = ['a'] must be numbers"),
        (lambda: ub.ForceLaw(lambda x, v: x, stored=3), "ForceLaw: stored = 3 must be a function"),
        (
            lambda: ub.ForceLaw(lambda x, v: x, stored=lambda x, state: 0.0),
            "stored has a parameter 'state'",
        ),
    ],
)
def test_bad_laws_are_refused(make, says):
    with pytest.raises(ub.ArgumentError, match=re.escape(says)):
        make()


@pytest.mark.parametrize("returned", [1.0, None, (1.0,), (1.0, [1.0, 2.0]), (1.0, ["a"])])
def test_what_a_law_with_a_history_must_return(returned):
    law = ub.ForceLaw(lambda x, v, state: returned, [0.0])
    _, scene, _ = floating(law, lambda t: t)
    says = r"Slide\(.*\): the function returned .*; it must return the force and the state, a list"
    with pytest.raises(ub.ArgumentError, match=says):
        run(scene)


def test_an_energy_that_is_no_number_is_named():
    law = ub.ForceLaw(lambda x, v: 1e3 * x, stored=lambda x: None)
    _, scene, _ = floating(law, lambda t: t)
    with pytest.raises(ub.ArgumentError, match=r"Slide\(.*\): the energy returned None"):
        run(scene)
