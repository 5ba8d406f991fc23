# SPDX-License-Identifier: MIT
"""Energy, momentum and angular momentum of random scenes, exact at any step size."""

import numpy as np
import pytest
from elastic_scenes import DRAWS, Built, draw, relative

import ufl_beam as ub

pytestmark = pytest.mark.parametrize("seed", DRAWS)

SIZES = [0.005, 0.1]
"""Time steps; s.  The larger is as long as many periods of the axial vibrations."""

CLOSED = 1e-9
"""Largest imbalance of a ledger, as a part of the energy that went through."""


def energy_of(seed, scheme, **steps):
    return Built(draw(seed)).run(scheme, **steps).solution.energy


@pytest.mark.parametrize("step", SIZES)
def test_work_is_the_increment_of_energy(seed, step):
    """Work is the increment of kinetic and stored energy."""
    energy = energy_of(seed, ub.EnergyMomentum(), step=step)
    assert energy.lost == {}
    change = energy.total - energy.total[0]
    assert np.abs(energy["loads"] - change).max() < CLOSED * energy.energy_transferred
    assert energy.energy_transferred > 1e-3


@pytest.mark.parametrize("step", SIZES)
@pytest.mark.parametrize("weights", [(0.1, 0.0), (0.0, 0.1), (0.2, 0.5)])
def test_numerical_loss_closes_the_ledger(seed, step, weights):
    """It closes the ledger, and never gives anything back."""
    energy = energy_of(seed, ub.EnergyMomentum(*weights), step=step)
    assert energy.worst < CLOSED
    assert (np.diff(energy["numerical"]) >= 0).all()
    assert energy["numerical"][-1] > 0


def test_losses_converge_to_nothing(seed):
    """A loss of the scheme, not of the scene: it goes with the step."""
    scheme = ub.EnergyMomentum(0.1, 0.1)
    losses = [energy_of(seed, scheme, step=0.1 / n, steps=n)["numerical"][-1] for n in (10, 80)]
    assert losses[1] < losses[0] / 4


@pytest.mark.parametrize("step", SIZES)
@pytest.mark.parametrize("scheme", [ub.EnergyMomentum(), ub.EnergyMomentum(alpha=0.2)], ids=str)
def test_momenta_of_free_flight(seed, step, scheme):
    """Without loads linear and angular momentum are constant, also with `alpha`."""
    numbers = draw(seed, free=True, dead=True)
    numbers.forces, numbers.lines = [], []
    solution = Built(numbers).run(scheme, step=step).solution
    momentum = solution.momentum()
    assert np.abs(solution.displacement(solution.scene.beams[0].end)).max() > 1e-3
    # Of some 5 kg m/s: 1e-10 of forces of some 100 N in 15 steps of 0.1 s
    assert np.ptp(momentum[:, :2], axis=0).max() < 1e-9 * np.abs(momentum).max()
    assert np.ptp(momentum[:, 2]) < 1e-9 * np.abs(momentum).max()


@pytest.mark.parametrize("step", [0.005, 0.05])
@pytest.mark.parametrize("weights", [(0.0, 0.0), (0.2, 0.0), (0.0, 0.2)])
def test_momentum_grows_by_the_impulses(seed, step, weights):
    """Momentum grows by the impulse, angular momentum by its moment unless `beta` > 0."""
    numbers = draw(seed, free=True, dead=True)
    numbers.lines = []
    solution = Built(numbers).run(ub.EnergyMomentum(*weights), step=step).solution
    assert solution.substeps == len(solution.times) - 1  # no step was cut, whose middles are others
    t = solution.times
    middle = (t[1:] + t[:-1]) / 2
    expected = np.zeros((len(middle), 3))
    for load in solution.scene.loads:
        impulse = np.array([load.amplitude(x) for x in middle]) * np.diff(t)
        position = solution.position(load.place)
        x, y = ((position[1:] + position[:-1]) / 2).T
        f_x, f_y = load.force
        arm = x * f_y - y * f_x + load.moment
        expected += np.column_stack([f_x * impulse, f_y * impulse, arm * impulse])
    momentum = solution.momentum()
    error = np.abs(np.diff(momentum, axis=0) - expected).max(axis=0)
    scale = np.abs(momentum).max()
    assert error[:2].max() < 1e-9 * scale  # as in free flight
    if weights[1] == 0:
        assert error[2] < 1e-9 * scale
    elif step == 0.05:
        assert error[2] > 1e-6 * scale  # beta gives it up, as its docstring says


def test_statics_is_the_slow_limit(seed):
    """Loads that grow in 100 steps of 10 s, and statics; the highest loss is backward Euler."""
    numbers = draw(seed, fixed=True, dead=True)
    numbers.forces = [(*f[:4], 1000.0) for f in numbers.forces]
    static = Built(numbers).run(ub.Static(), steps=20, step=50.0)
    slow = Built(numbers).run(ub.EnergyMomentum(0.5, 0.5), steps=120, step=10.0)
    # Both to 1e-10 of the forces, which soft scenes multiply
    assert relative(static.motion()[:, -1], slow.motion()[:, -1]) < 1e-7
