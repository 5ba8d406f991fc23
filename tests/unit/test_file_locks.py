# SPDX-License-Identifier: MIT
"""Two runs on one checkpoint: the second one is refused and touches nothing."""

import fcntl
import re
import subprocess
import sys
import threading
import time
from pathlib import Path

from mpi4py import MPI

import pytest
from helpers import at_step
from scenes import SECTION, clamped

import ufl_beam as ub
from ufl_beam.file_system import Lock, locked

BEAM = ub.Beam((0, 0), (1, 0), SECTION, cells=2)
LOAD = ub.PointLoad(BEAM.end, force=(0.0, -1.0))
SCENE = clamped(BEAM, loads=[LOAD])


def run(folder, *more, t1=0.05):
    return ub.simulate(
        *(SCENE, ub.EnergyMomentum()),
        t=(0, t1),
        dt=0.01,
        record=[ub.History(folder / "run.csv", [BEAM.end]), *more],
        checkpoint=ub.Checkpoint(folder / "run.h5", every=1),
    )


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
        with pytest.raises(
            ub.ArgumentError, match=r"run\.h5 is in use: process \d+ on .* writes it"
        ):
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
    with pytest.raises(ub.ArgumentError, match="beyond the end"):
        run(shared_path, t1=0.03)
    with pytest.raises(ub.ArgumentError, match="of another run"):
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


SECOND = """
import sys
import threading
import time
from pathlib import Path
sys.path[:0] = sys.argv[2:]
import test_file_locks
test_file_locks.run(Path(sys.argv[1]), test_file_locks.at_step(3, lambda: None))
"""


@pytest.mark.serial
def test_a_script_that_is_started_again_while_it_runs(tmp_path):
    """The second process is refused in the middle of the first; the table of the first is whole."""
    found = []

    def start_again():
        before = (tmp_path / "run.csv").read_bytes()
        folders = map(str, Path(__file__).parents[:2])
        command = [sys.executable, "-c", SECOND, str(tmp_path), *folders]
        found.append(subprocess.run(command, capture_output=True, text=True, timeout=60))
        assert (tmp_path / "run.csv").read_bytes() == before

    run(tmp_path, at_step(3, start_again))
    (second,) = found
    assert second.returncode != 0
    assert re.search(r"run\.h5 is in use: process \d+ on .* writes it", second.stderr)
    # A line for the names, one for the initial state and each of the five steps
    assert len((tmp_path / "run.csv").read_text().splitlines()) == 1 + 6


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


def test_an_owner_that_is_no_text(tmp_path):
    """The file of a lock that is held may have anything."""
    lock = tmp_path / "run.lock"
    lock.write_bytes(b"\xff\xfe process 1")
    with lock.open() as held:
        fcntl.flock(held, fcntl.LOCK_EX)
        assert Lock(tmp_path / "run").acquire() == "\ufffd\ufffd process 1"
