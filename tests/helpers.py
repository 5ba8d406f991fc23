# SPDX-License-Identifier: MIT
"""Shared calls and checks: runs, messages of errors, ledgers, recorders, `mpirun`."""

import os
import re
import shutil
import subprocess
import sys
from dataclasses import dataclass

from mpi4py import MPI

import numpy as np
import pytest

import ufl_beam as ub
import ufl_beam.structures as st

NAMESPACES = {"ub": ub, "ub.extend": ub.extend, "ub.distributions": ub.distributions, "st": st}
"""Modules with public names, by the name that scripts give to them."""

PUBLIC = {name: getattr(x, name) for x in NAMESPACES.values() for name in x.__all__}
"""Public names and their objects, without results."""

RESULTS = {name: getattr(x, name) for x in (ub, st) for name in x.RESULTS}
"""Classes of results and of places."""

ALL = PUBLIC | RESULTS


def run(scene, scheme=None, t=(0, 1), dt=0.1, **options):
    """Simulate by the energy-momentum scheme, if there is no other."""
    return ub.simulate(scene, scheme or ub.EnergyMomentum(), t=t, dt=dt, **options)


def in_turn(names, others, number=2):
    """Pairs of each name with a number of the others, which take turns."""
    others, step = list(others), len(list(others)) // number
    return [
        (n, others[(i + k * step) % len(others)])
        for i, n in enumerate(names)
        for k in range(number)
    ]


def raises(*parts, kind=ub.ArgumentError):
    """`pytest.raises` for an error whose message has all `parts`, in this order."""
    return pytest.raises(kind, match="(?s)" + ".*".join(map(re.escape, parts)))


def law_of(fields=None, **members):
    """A connector law of a user, with numbers as `fields`, and other members."""
    names = dict.fromkeys(fields or {}, float)
    kind = type("Mine", (ub.extend.ConnectorLaw,), {"__annotations__": names, **members})
    return dataclass(frozen=True)(kind)(**(fields or {}))


def require_no_gain(energy):
    """Dissipated energies never decrease, but for round-off."""
    for lost in energy.lost.values():
        assert np.diff(lost).min() >= -1e-12 * energy.energy_transferred


def assert_balanced(energy):
    """An exact ledger closes, and nothing that was dissipated comes back."""
    assert energy.worst <= 1e-9
    require_no_gain(energy)


def require_restart(run, scene, connectors, scheme, folder, until):
    """A run resumed at half time ends bit for bit as the whole one, one from `start=` nearly so."""
    half, whole = until / 2, run(scene, scheme, t=(0, until))
    file = ub.Checkpoint(folder / "run.checkpoint", every=7)
    run(scene, scheme, t=(0, half), checkpoint=file)
    resumed = run(scene, scheme, t=(0, until), checkpoint=file)
    assert np.array_equal(resumed.q, whole.q)
    for connector in connectors:
        assert all(map(np.array_equal, resumed.connector(connector), whole.connector(connector)))
    for entry in whole.energy:
        # Several processes add up what was lost before and after in another order.
        digits = 0.0 if MPI.COMM_WORLD.size == 1 else 1e-14
        scale = digits * whole.energy.energy_transferred
        np.testing.assert_allclose(resumed.energy[entry], whole.energy[entry], rtol=0, atol=scale)
    second = run(scene, scheme, t=(half, until), start=run(scene, scheme, t=(0, half)))
    np.testing.assert_allclose(second.q[-1], whole.q[-1], rtol=0, atol=1e-8 * np.abs(whole.q).max())
    return whole


class AfterEachStep(ub.extend.Recorder):
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


MPIRUN = {
    "OMPI_ALLOW_RUN_AS_ROOT": "1",
    "OMPI_ALLOW_RUN_AS_ROOT_CONFIRM": "1",
    "OMPI_MCA_mpi_yield_when_idle": "1",
    "PRTE_MCA_rmaps_default_mapping_policy": ":oversubscribe",
}
"""Root may run it, on any number of cores."""

needs_mpirun = pytest.mark.skipif(shutil.which("mpirun") is None, reason="there is no mpirun")


def on_two_processes(*arguments, timeout=300):
    """Output and status of Python with these arguments on two processes; a hang is a failure."""
    return subprocess.run(
        ["mpirun", "-n", "2", sys.executable, *map(str, arguments)],
        env={**os.environ, **MPIRUN},
        stdin=subprocess.DEVNULL,
        capture_output=True,
        text=True,
        timeout=timeout,
        check=False,
    )
