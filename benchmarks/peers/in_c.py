# SPDX-License-Identifier: MIT
"""The floor: ``floor.c``, compiled here with what this processor has."""

import json
import os
import subprocess
import tempfile
from pathlib import Path

VERSION = "C"


def run(elimination, *words):
    compiler = os.environ.get("CC", "cc")
    with tempfile.TemporaryDirectory() as directory:
        program = os.path.join(directory, "floor")
        source = str(Path(__file__).with_name("floor.c"))
        subprocess.run([compiler, "-O3", "-march=native", "-o", program, source, "-lm"], check=True)
        command = [program, elimination, *map(str, words)]
        return json.loads(subprocess.run(command, capture_output=True, check=True).stdout)


def roll_up(cells, turns, elimination):
    return run(elimination, "P1", cells, 8, turns)


def flying_beam(cells, dt, elimination):
    return run(elimination, "P2", cells, round(10 / dt), dt)


def cantilever(cells, dt, elimination):
    return run(elimination, "P5", cells, round(0.02 / dt), dt)


RUNS = {"P1": roll_up, "P2": flying_beam, "P5": cantilever}
