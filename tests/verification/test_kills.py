"""Runs that are killed at random moments, while code is compiled, in steps and in writes.

The script is simply run again; its results must be those of a run that nothing stopped, to the bit.
"""

import os
import random
import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest

SCRIPT = Path(__file__).with_name("killed.py")

SIGNALS = [signal.SIGKILL, signal.SIGINT, signal.SIGKILL, signal.SIGTERM]


class Killed:
    """A run in a directory that begins empty.

    Args:
        directory: For its files.
        steps: Number of steps.
        every: Steps from checkpoint to checkpoint.
        cache: Directory of compiled code; that of the tests if there is none.
    """

    def __init__(self, directory, steps, every, cache=None):
        directory.mkdir()
        self.directory = directory
        self._command = [sys.executable, str(SCRIPT), str(directory), str(steps), str(every)]
        self._environment = {**os.environ, **({"XDG_CACHE_HOME": str(cache)} if cache else {})}

    def stopped(self, by, wait):
        """Begin the run and stop it when ``wait()`` returns; False if it has ended before."""
        process = subprocess.Popen(
            self._command,
            env=self._environment,
            stdout=subprocess.DEVNULL,
            stderr=subprocess.DEVNULL,
        )
        wait(process)
        process.send_signal(by)
        return process.wait(60) != 0

    def checksum(self):
        """Let the run come to its end."""
        run = subprocess.run(
            self._command,
            env=self._environment,
            capture_output=True,
            text=True,
            timeout=300,
            check=False,
        )
        assert run.returncode == 0, run.stderr
        return run.stdout.split("checksum ")[1]

    def steps(self, seconds):
        """A function that waits until the run takes steps, and so many seconds longer."""
        table = self.directory / "run.csv"

        def changed():
            return table.stat().st_mtime_ns if table.exists() else 0

        before = changed()

        def wait(process):
            while changed() == before and process.poll() is None:
                time.sleep(0.001)
            time.sleep(seconds)

        return wait


def kills_in_steps(tmp_path, number, steps, every, longest):
    chance = random.Random(number)
    whole = Killed(tmp_path / "whole", steps, every).checksum()
    run = Killed(tmp_path / "killed", steps, every)
    stopped = sum(
        run.stopped(SIGNALS[n % len(SIGNALS)], run.steps(chance.uniform(0.0, longest)))
        for n in range(number)
    )
    assert stopped == number  # else there are too few steps
    assert run.checksum() == whole


@pytest.mark.serial
def test_two_kills(tmp_path):
    kills_in_steps(tmp_path, 2, steps=800, every=20, longest=0.05)


@pytest.mark.slow
@pytest.mark.serial
def test_kills_in_steps(tmp_path):
    kills_in_steps(tmp_path, 20, steps=12_000, every=100, longest=0.2)


@pytest.mark.slow
@pytest.mark.serial
def test_kills_in_writes(tmp_path):
    """A checkpoint after each step: the run does little else than to write."""
    kills_in_steps(tmp_path, 10, steps=1500, every=1, longest=0.2)


@pytest.mark.slow
@pytest.mark.serial
def test_kills_while_code_is_compiled(tmp_path):
    """From an empty cache, which takes some ten seconds."""
    cache = tmp_path / "cache"
    cache.mkdir(mode=0o700)
    chance = random.Random(1)
    run = Killed(tmp_path / "killed", 100, 20, cache)

    def compiled():
        return len(list(cache.glob("fenics/ufl_beam/*/checksums")))

    def parts():
        return {path.name for path in cache.glob("fenics/ufl_beam/*.part")}

    def wait(process):
        """Until something is compiled, but for the last entries, and a moment."""
        before = parts()
        while not parts() - before and process.poll() is None:
            time.sleep(0.001)
        time.sleep(chance.uniform(0.0, 0.2))

    stopped = [run.stopped(SIGNALS[n % len(SIGNALS)], wait) for n in range(20)]
    assert sum(stopped) >= 15  # now and then an entry is finished before
    whole = Killed(tmp_path / "whole", 100, 20).checksum()
    assert run.checksum() == whole
    assert compiled() > 5
    begin = time.perf_counter()
    assert run.checksum() == whole
    assert time.perf_counter() - begin < 10  # nothing waits for what was killed
