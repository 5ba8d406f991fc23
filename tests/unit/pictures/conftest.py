# SPDX-License-Identifier: MIT
"""Runs whose pictures several files test."""

import pytest
import scenes
from drawn import crank, damaged_arm, static

import ufl_beam as ub


@pytest.fixture(scope="session")
def portal():
    """Static run of a portal frame."""
    return static(scenes.portal(), dt=0.5)


@pytest.fixture(scope="session")
def swing():
    """Dynamic run of beams with a mass."""
    scheme = ub.EnergyMomentum(0.01, 0.01)
    return ub.simulate(scenes.swing(), scheme, t=(0, 0.1), dt=5e-3)


@pytest.fixture(scope="session")
def engine():
    """Dynamic run of bodies, joints and connectors without beams."""
    return ub.simulate(crank(), ub.EnergyMomentum(), t=(0, 0.5), dt=0.05)


@pytest.fixture(scope="session")
def extremes():
    """Extremes of the run `damaged`."""
    return ub.Extremes()


@pytest.fixture(scope="session")
def damaged(extremes):
    """Run of a cantilever whose cells yield and whose hinge opens, 150 steps of 0.02 s."""
    scheme = ub.EnergyMomentumStatic()
    return ub.simulate(damaged_arm(), scheme, t=(0, 3), dt=0.02, record=extremes)


@pytest.fixture
def arm(damaged):
    """The beam of the run `damaged`."""
    return damaged.scene.beams[0]
