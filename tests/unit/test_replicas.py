# SPDX-License-Identifier: MIT
"""Small scenes under `mpirun` are computed by each process: all must find the same motion."""

from pathlib import Path

import numpy as np
import pytest
from helpers import needs_mpirun, on_two_processes

SCRIPT = Path(__file__).with_name("script_of_copies.py")


@pytest.mark.serial
@needs_mpirun
def test_all_processes_must_find_the_same(tmp_path):
    """Outcomes of both processes, by function and kind of run.

    Unseeded random loads, and one that is another on one process for two steps at the end, end with
    words.  Seeded generators give both processes the same; round-off is no difference.  A process
    that fails alone keeps its own exception; the other does not wait for it.
    """
    run = on_two_processes(SCRIPT, tmp_path / "run.csv", timeout=120)
    assert run.returncode == 0, run.stderr
    *lines, end = run.stdout.splitlines()
    assert end == "end"
    seen = []
    for function, name, both in (line.split("|", 2) for line in lines):
        first, second = eval(both)
        seen.append(function)
        if function in ("random", "late"):
            for said in (first, second):
                assert said.startswith("ProcessesDiffer: the 2 processes"), (function, name, said)
                assert "find different motions" in said
                assert "random numbers without a seed" in said
        elif function in ("seeded", "round-off"):
            np.testing.assert_allclose(eval(first), eval(second), rtol=1e-9)
        elif name != "followed":  # whose load does not fail
            assert first.startswith("ProcessesDiffer: the 2 processes")
            assert "one of them has failed" in first
            assert second == "RuntimeError: user"
    functions = "seeded", "random", "late", "round-off", "fails"
    assert {name: seen.count(name) for name in seen} == dict.fromkeys(functions, 6)
