# SPDX-License-Identifier: MIT
"""Small scenes under `mpirun` are computed by each process: all must find the same motion."""

from pathlib import Path

from mpi4py import MPI

import numpy as np
import pytest
from helpers import needs_mpirun, on_two_processes

import ufl_beam as ub

SCRIPT = Path(__file__).with_name("script_of_copies.py")


@pytest.fixture(scope="module")
def outcomes(tmp_path_factory):
    """What a script on two processes finds: (function, run) -> outcomes of both."""
    table = tmp_path_factory.mktemp("copies") / "run.csv"
    run = on_two_processes(SCRIPT, table, timeout=120)
    assert run.returncode == 0, run.stderr
    *lines, end = run.stdout.splitlines()
    assert end == "end"
    found = (line.split("|", 2) for line in lines)
    return {(function, name): eval(both) for function, name, both in found}


@pytest.mark.serial
@needs_mpirun
def test_scenes_that_differ_between_processes_end_with_words(outcomes):
    """Unseeded random loads, and one that is another on one process for two steps at the end."""
    seen = 0
    for (function, name), both in outcomes.items():
        if function not in ("random", "late"):
            continue
        seen += 1
        for outcome in both:
            assert outcome.startswith("ProcessesDiffer: the 2 processes"), (function, name, outcome)
            assert "find different motions" in outcome
            assert "random numbers without a seed" in outcome
    assert seen == 2 * 6


@pytest.mark.serial
@needs_mpirun
def test_scenes_that_agree_go_on(outcomes):
    """Seeded generators give both processes the same; round-off is no difference."""
    seen = 0
    for (function, _), (first, second) in outcomes.items():
        if function in ("seeded", "round-off"):
            seen += 1
            np.testing.assert_allclose(eval(first), eval(second), rtol=1e-9)
    assert seen == 2 * 6


@pytest.mark.serial
@needs_mpirun
def test_a_process_that_fails_alone_ends_the_others(outcomes):
    """The one keeps its own exception; the other does not wait for it."""
    for name in ("equal steps", "static", "adaptive", "recorded", "stepped"):
        first, second = outcomes["fails", name]
        assert first.startswith("ProcessesDiffer: the 2 processes")
        assert "one of them has failed" in first
        assert second == "RuntimeError: user"


def test_one_process_compares_nothing():
    section = ub.Section(EA=1.0, GA=1.0, EI=1e-3, rhoA=1.0)
    scene = ub.Scene([ub.Beam((0, 0), (1, 0), section, cells=2)])
    simulation = ub.Simulation(scene, ub.EnergyMomentum(), comm=MPI.COMM_SELF)
    assert not simulation.comparison.several
    simulation.close()
