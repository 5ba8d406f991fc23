# SPDX-License-Identifier: MIT
"""Random scenes: states that C keeps are, to the last bit, those that Python gathers."""

import numpy as np
import pytest
from random_scenes import SAMPLE, STEPS, script

import ufl_beam as ub

pytestmark = [pytest.mark.filterwarnings("ignore::ufl_beam.ModelWarning"), pytest.mark.serial]


def run(seed, *, many):
    """A run as far as it goes; the states are kept while it steps, or each gathered after its step.

    The first is kept by Python.
    """
    names = {}
    exec(script(seed), names)
    simulation = ub.Simulation(names["scene"], names["scheme"], mesh=names["mesh"])
    ends = np.linspace(*names["times"], STEPS + 1)[1:]
    simulation.keep()
    try:
        while len(ends):
            taken = simulation.steps_to(ends if many else ends[:1], keep=many)
            if not many:
                simulation.keep()
            ends = ends[taken:]
    except ub.ConvergenceError:
        pass
    return simulation.solution


@pytest.mark.parametrize("seed", SAMPLE)
def test_rows_of_c_are_states(seed):
    one, other = run(seed, many=True), run(seed, many=False)
    states, others = one.history(), other.history()
    assert [*states] == [*others]
    assert len(one) > STEPS / 4
    for name, values in states.items():
        assert np.array_equal(values, others[name], equal_nan=True), name
    assert (one.substeps, one.iterations) == (other.substeps, other.iterations)
