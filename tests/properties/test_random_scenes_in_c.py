# SPDX-License-Identifier: MIT
"""Random scenes that C can step: the same as in Python, iterations and ledger included.

`any_scene.py` draws the scenes.  `python3 tests/properties/test_random_scenes_in_c.py SEED` runs
the scene of a seed, whether C can step it or not.
"""

import sys
import warnings

import numpy as np
import pytest
from any_scene import STEPS, script

import ufl_beam as ub

SAME = 1e-9
"""Part of the largest number beside which sums in another order do not show."""

pytestmark = pytest.mark.serial


class InPython(ub.Simulation):
    """A simulation that takes all steps in Python."""

    def _steps_in_c(self, parts):
        return None


def run(kind, names):
    """What is known of a scene after equal steps, and the message if one failed."""
    t0, t1 = names["times"]
    simulation = kind(names["scene"], names["scheme"], t0=t0, mesh=names["mesh"])
    failure = None
    try:
        for t in np.linspace(t0, t1, STEPS + 1)[1:]:
            simulation.step_to(t)
    except ub.ConvergenceError as failed:
        failure = str(failed)
    state = simulation.gather()
    ledger = np.array([x for part in state.entries for x in part.values()])
    numbers = {"t": simulation.t, "parts": simulation.parts, "failure": failure}
    return numbers | {"iterations": simulation.iterations}, (state.q, ledger)


def differences(seed):
    """Names of what differs after the steps of a scene; None where C takes none."""
    names = {}
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", ub.ModelWarning)
        exec(script(seed), names)
        made = ub.Simulation(names["scene"], names["scheme"], mesh=names["mesh"])
        if made._in_c is None:
            return None
        (in_c, arrays), (in_python, others) = (run(k, names) for k in (ub.Simulation, InPython))
    found = [name for name, value in in_c.items() if value != in_python[name]]
    for name, one, other in zip(("q", "ledger"), arrays, others, strict=True):
        if np.abs(one - other).max() > SAME * np.abs(other).max():
            found.append(name)
    return found


@pytest.mark.parametrize("first", range(0, 320, 40))
def test_the_same_as_in_python(first):
    """Of 40 scenes C steps some: laws, connectors and loads with a function have no loops."""
    found = {seed: differences(seed) for seed in range(first, first + 40)}
    in_c = {seed: wrong for seed, wrong in found.items() if wrong is not None}
    assert in_c
    assert not {seed: wrong for seed, wrong in in_c.items() if wrong}


if __name__ == "__main__":
    for seed in map(int, sys.argv[1:]):
        print(seed, differences(seed))
