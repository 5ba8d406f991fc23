# SPDX-License-Identifier: MIT
"""Two runs on one checkpoint: the second one is refused and touches nothing."""

import fcntl
import subprocess
import sys
import threading
import time

from mpi4py import MPI

import pytest
from helpers import at_step, raises
from scenes import SECTION, clamped

import ufl_beam as ub
from ufl_beam.file_system import Lock, locked

BEAM = ub.Beam((0, 0), (1, 0), SECTION, cells=2)
SCENE = clamped(BEAM, loads=[ub.PointLoad(BEAM.end, force=(0.0, -1.0))])


def run(folder, *more, t1=0.05):
    record = [ub.History(folder / "run.csv", [BEAM.end]), *more]
    file = ub.Checkpoint(folder / "run.h5", every=1)
    ub.simulate(SCENE, ub.EnergyMomentum(), t=(0, t1), dt=0.01, record=record, checkpoint=file)


def is_free(folder):
    """Whether no lock is left, once all processes are here."""
    MPI.COMM_WORLD.barrier()
    free = not (folder / "run.h5.lock").exists()
    MPI.COMM_WORLD.barrier()  # before one of them runs again
    return free


def test_a_second_run_is_refused_before_it_touches_a_file(shared_path):
    """Of another process, which its lock stands for."""

    def contents():
        return {path.name: path.read_bytes() for path in shared_path.iterdir()}

    run(shared_path)
    first = Lock(shared_path / "run.h5")
    if MPI.COMM_WORLD.rank == 0:
        assert first.acquire() == ""
    MPI.COMM_WORLD.barrier()
    before = contents()
    for t1 in (0.05, 0.1):
        with raises("run.h5 is in use: process ", " on ", " writes it"):
            run(shared_path, t1=t1)
        assert contents() == before
    MPI.COMM_WORLD.barrier()
    first.unlock()
    assert is_free(shared_path)
    run(shared_path, t1=0.1)


@pytest.mark.parametrize("error", [RuntimeError, KeyboardInterrupt])
def test_a_run_that_fails_lets_go(shared_path, error):
    def fail():
        raise error

    with pytest.raises(error):
        run(shared_path, at_step(3, fail))
    assert is_free(shared_path)
    run(shared_path, at_step(3, lambda: None))
    assert is_free(shared_path)


def test_a_run_that_is_refused_lets_go(shared_path):
    run(shared_path)
    with raises("beyond the end"):
        run(shared_path, t1=0.03)
    with raises("of another run"):
        run(shared_path, at_step(3, lambda: None))
    assert is_free(shared_path)
    run(shared_path)


@pytest.mark.serial
def test_the_lock_ends_with_its_process(tmp_path):
    """Its file may stay behind."""
    script = (
        "import sys; from pathlib import Path; from ufl_beam.file_system import Lock; "
        "lock = Lock(Path(sys.argv[1])); print(repr(lock.acquire()), flush=True); sys.stdin.read()"
    )
    command = [sys.executable, "-c", script, str(tmp_path / "run.h5")]
    pipes = {"stdin": subprocess.PIPE, "stdout": subprocess.PIPE, "text": True}
    with subprocess.Popen(command, **pipes) as process:
        assert process.stdout.readline() == "''\n"
        lock = Lock(tmp_path / "run.h5")
        assert lock.acquire().startswith(f"process {process.pid} on ")
        process.kill()
    assert lock.path.exists()
    assert lock.acquire() == ""
    lock.unlock()
    assert not lock.path.exists()


def test_who_waits_for_a_lock_that_is_removed_takes_a_new_one(tmp_path):
    """Else two processes would hold two files of one name."""
    path, found = tmp_path / "a.lock", []

    def wait():
        with locked(path), path.open("ab") as other:
            try:
                fcntl.flock(other, fcntl.LOCK_EX | fcntl.LOCK_NB)
            except BlockingIOError:
                found.append("locked")
            else:
                found.append("free")

    with locked(path):
        thread = threading.Thread(target=wait)
        thread.start()
        time.sleep(0.1)
        assert not found
        path.unlink()
    thread.join(10)
    assert found == ["locked"]
