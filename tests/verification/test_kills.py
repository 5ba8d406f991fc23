# SPDX-License-Identifier: MIT
"""Runs that are killed at random moments, while code is compiled, in steps and in writes.

The script is simply run again; its results must be those of a run that nothing stopped, to the bit.
"""

import os
import random
import re
import shutil
import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest

SCRIPT = Path(__file__).with_name("script_of_kills.py")

SIGNALS = [signal.SIGKILL, signal.SIGINT, signal.SIGKILL, signal.SIGTERM]


class Killed:
    """A run of so many steps, with its files in a new directory, maybe with its own cache."""

    def __init__(self, directory, steps, every, cache=None):
        directory.mkdir()
        self.directory = directory
        self._command = [sys.executable, str(SCRIPT), str(directory), str(steps), str(every)]
        own = {"XDG_CACHE_HOME": str(cache)} if cache else {}
        self._options = {"env": {**os.environ, **own}, "text": True}

    def stopped(self, by, wait):
        """Begin the run and stop it when ``wait()`` returns; False if it has ended before."""
        silent = {"stdout": subprocess.DEVNULL, "stderr": subprocess.DEVNULL}
        process = subprocess.Popen(self._command, **silent, **self._options)
        wait(process)
        process.send_signal(by)
        return process.wait(60) != 0

    def end(self):
        """Let the run come to its end; return how long that took, in seconds, and its checksum."""
        more = {"capture_output": True, "timeout": 300, "check": False}
        run = subprocess.run(self._command, **more, **self._options)
        assert run.returncode == 0, run.stderr
        seconds, checksum = re.search(r"stepped for (.*) s, checksum (.*)", run.stdout).groups()
        return float(seconds), checksum

    def steps(self, seconds):
        """A function that waits until the run takes steps, and so many seconds longer."""
        table = self.directory / "run.csv"

        def changed():
            try:
                return table.stat().st_mtime_ns
            except FileNotFoundError:  # not yet, or being replaced
                return 0

        before = changed()

        def wait(process):
            while changed() == before and process.poll() is None:
                time.sleep(0.001)
            time.sleep(seconds)

        return wait


def kills_in_steps(tmp_path, number, steps, every):
    chance = random.Random(number)
    seconds, whole = Killed(tmp_path / "whole", steps, every).end()
    longest = seconds / (2 * number)  # so that the run is not at its end before
    for attempt in range(5):
        run = Killed(tmp_path / f"killed {attempt}", steps, every)
        if all(
            run.stopped(SIGNALS[n % len(SIGNALS)], run.steps(chance.uniform(0.0, longest)))
            for n in range(number)
        ):
            break
        longest /= 2  # the machine is faster now than in the whole run
    else:
        pytest.fail("the run ended before it was stopped")
    assert run.end()[1] == whole


@pytest.mark.serial
def test_a_run_survives_two_kills(tmp_path):
    kills_in_steps(tmp_path, 2, steps=1000, every=10)


@pytest.mark.slow
@pytest.mark.serial
def test_kills_in_steps(tmp_path):
    kills_in_steps(tmp_path, 20, steps=20_000, every=100)


@pytest.mark.slow
@pytest.mark.serial
def test_kills_in_writes(tmp_path):
    """A checkpoint after each step: the run does little else than to write."""
    kills_in_steps(tmp_path, 10, steps=4000, every=1)


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

    stopped = sum(run.stopped(SIGNALS[n % len(SIGNALS)], wait) for n in range(20))
    while stopped < 20:  # now and then the last entry is finished before
        shutil.rmtree(cache / "fenics")
        stopped += run.stopped(SIGNALS[stopped % len(SIGNALS)], wait)
    _, whole = Killed(tmp_path / "whole", 100, 20).end()
    assert run.end()[1] == whole
    assert compiled() > 5
    begin = time.perf_counter()
    assert run.end()[1] == whole
    assert time.perf_counter() - begin < 10  # nothing waits for what was killed
