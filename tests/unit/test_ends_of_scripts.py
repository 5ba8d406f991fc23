# SPDX-License-Identifier: MIT
"""Output of scripts at their end: nobody reads it any more, and options of PETSc."""

import os
import subprocess
import sys

import pytest

pytestmark = pytest.mark.serial  # scripts of their own

SIMULATION = """
import ufl_beam as ub
beam = ub.Beam((0, 0), (1, 0), ub.Section(EA=1e3, GA=1e3, EI=1.0, rhoA=1.0), cells=2)
scene = ub.Scene([beam], supports=[ub.Clamped(beam.start)], loads=[ub.Gravity()])
ub.simulate(scene, ub.EnergyMomentum(), t=(0, 0.1), dt=0.1)
"""

LINES = """
import ufl_beam as ub
for _ in range(20_000):
    print("a line that somebody may read")
"""


def run(script, *, unread=False, **environment):
    """What a script prints, and the text of its errors; ``unread``: its output has no reader."""
    output = subprocess.PIPE
    if unread:
        reader, output = os.pipe()
        os.close(reader)
    done = subprocess.run(
        [sys.executable, "-c", script], stdout=output, stderr=subprocess.PIPE, text=True,
        env={**os.environ, **environment}, check=False,
    )  # fmt: skip
    if unread:
        os.close(output)
    return done.stdout, done.stderr, done.returncode


@pytest.mark.parametrize(
    "script",
    [
        LINES,
        "import ufl_beam as ub; ub.print_once('hello')",
        "import ufl_beam; print('at the end')",
    ],
)
def test_a_script_that_nobody_reads_ends_quietly(script):
    """As in ``script | head``: PETSc's handler of the signal has printed a page and aborted."""
    _, errors, code = run(script, unread=True)
    assert errors == ""
    assert code != 0


def test_other_broken_pipes_are_errors():
    _, errors, code = run("import ufl_beam; raise BrokenPipeError('of a socket')")
    assert "BrokenPipeError: of a socket" in errors
    assert code == 1


def test_an_option_that_worked_is_not_called_unused():
    printed, errors, code = run(SIMULATION, PETSC_OPTIONS="-ub_snes_monitor -ub_snes_max_it 20")
    assert code == 0
    assert "SNES Function norm" in printed
    assert "not used" not in printed + errors
    assert "unused" not in printed + errors
