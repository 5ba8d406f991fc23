# SPDX-License-Identifier: MIT
"""Exceptions in functions of users under `mpirun`: raised by all processes, or the end of all."""

import pickle
import re
import time
from pathlib import Path

from mpi4py import MPI

import pytest
from helpers import needs_mpirun, on_two_processes

from ufl_beam.errors import StepFailed
from ufl_beam.parallel import Agreement, portable

COMM = MPI.COMM_WORLD
SCRIPT = Path(__file__).with_name("script_of_errors.py")


@pytest.mark.serial
@needs_mpirun
def test_all_processes_raise_together(tmp_path):
    """Each function of a user, on all processes and on each alone; then the same script goes on."""
    run = on_two_processes(SCRIPT, tmp_path / "run.h5", timeout=300)
    assert run.returncode == 0, run.stderr
    *lines, end = run.stdout.splitlines()
    assert end == "end"
    found = [line.split("|") for line in lines]
    assert len(found) == 3 * 8 + 8 + 3 + 3
    for name, rank, outcomes in found:
        first, second = eval(outcomes)
        if name == "nan":
            assert first == second
            assert first.startswith("ConvergenceError: no equilibrium after t = ")
            assert "the time function is nan" in first
        elif name == "kind":
            message = first.partition(": ")[2]
            assert message in ("", "Unportable: number 7", "exit")
            assert first == second or second == "Unportable: number 7"
        else:
            assert [first, second] == 2 * ["RuntimeError: user"], (name, rank)


@pytest.mark.serial
@needs_mpirun
@pytest.mark.parametrize(("case", "rank"), [("alone", 1), ("asked", 0)])
def test_a_process_that_fails_alone_ends_all(case, rank):
    run = on_two_processes(SCRIPT, case, rank, timeout=100)
    end = time.time()
    # Imports are not counted, which take long beside other tests. A hang would be for ever.
    assert end - max(map(float, re.findall(r"begun at ([\d.]+)", run.stderr))) < 10
    assert run.returncode != 0
    assert f"RuntimeError: user, {case}" in run.stderr
    assert f"process {rank} of 2 failed" in run.stderr


@pytest.mark.serial
@needs_mpirun
def test_processes_that_fail_alike_end_without_an_abort():
    run = on_two_processes(SCRIPT, "alone", -1, timeout=100)
    assert run.returncode != 0
    assert run.stderr.count("RuntimeError: user, alone") == 2
    assert "are ended" not in run.stderr
    assert "ABORT" not in run.stderr


def test_other_exceptions_go_before_failed_steps():
    """A step that fails on one process may not be cut when the run ends on another."""
    agreement = Agreement(COMM)
    last = COMM.rank == COMM.size - 1
    with pytest.raises(ValueError, match="of a user"):
        agreement.synchronize(ValueError("of a user") if last else StepFailed("no equilibrium"))


class Unreadable(Exception):
    def __init__(self, one, two):
        super().__init__(one)


def test_what_cannot_be_sent_is_sent_as_text():
    plain = ValueError("plain")
    assert portable(plain) is plain
    assert portable(None) is None
    for odd in (Unreadable("a", "b"), ValueError(lambda: None)):
        sent = pickle.loads(pickle.dumps(portable(odd)))
        assert type(odd).__name__ in str(sent)
