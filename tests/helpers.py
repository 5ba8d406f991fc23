# SPDX-License-Identifier: MIT
"""Shared calls and checks: runs, messages of errors, ledgers, recorders, `mpirun`."""

import re
import shutil

from mpi4py import MPI

import numpy as np
import pytest

import ufl_beam as ub


def run(scene, scheme=None, t=(0, 1), dt=0.1, **options):
    """Simulate by the energy-momentum scheme, if there is no other."""
    return ub.simulate(scene, scheme or ub.EnergyMomentum(), t=t, dt=dt, **options)


def raises(*parts, kind=ub.ArgumentError):
    """`pytest.raises` for an error whose message has all `parts`, in this order."""
    return pytest.raises(kind, match="(?s)" + ".*".join(map(re.escape, parts)))


def require_no_gain(energy):
    """Dissipated energies never decrease, but for round-off."""
    for lost in energy.lost.values():
        assert np.diff(lost).min() >= -1e-12 * energy.throughput


def assert_balanced(energy):
    """An exact ledger closes, and nothing that was dissipated comes back."""
    assert energy.worst <= 1e-9
    require_no_gain(energy)


class AfterEachStep(ub.Recorder):
    """Calls a function with the state after each step, also in a run that goes on."""

    def __init__(self, function):
        self.function = function

    def open(self, simulation):
        pass

    def write(self, simulation):
        self.function(simulation)

    def state(self):
        return {}

    def resume(self, simulation, state):
        pass


def at_step(number, action):
    """A recorder that calls a function without arguments after a step of this number."""
    steps = iter(range(1, number + 1))
    return AfterEachStep(lambda _: next(steps, None) == number and action())


def stop_after(steps):
    """A recorder that interrupts the run after so many steps."""

    def interrupt():
        raise KeyboardInterrupt

    return at_step(steps, interrupt)


needs_mpirun = pytest.mark.skipif(
    shutil.which("mpirun") is None or MPI.COMM_WORLD.size > 1, reason="starts two processes itself"
)
