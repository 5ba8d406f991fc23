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


def run(script, *, stdout=subprocess.PIPE, **environment):
    """What a script prints, the text of its errors, and its status."""
    environment = {**os.environ, **environment}
    command, pipe = [sys.executable, "-c", script], subprocess.PIPE
    done = subprocess.run(command, stdout=stdout, stderr=pipe, text=True, env=environment)
    return done.stdout, done.stderr, done.returncode


@pytest.mark.parametrize(
    "script", ["for _ in range(20_000): print('a line')", "ub.print_once('hello')"]
)
def test_a_script_that_nobody_reads_ends_quietly(script):
    """As in ``script | head``: PETSc's handler of the signal has printed a page and aborted."""
    reader, output = os.pipe()
    os.close(reader)
    _, errors, code = run(f"import ufl_beam as ub\n{script}", stdout=output)
    os.close(output)
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
