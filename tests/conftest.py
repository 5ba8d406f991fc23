"""What all tests share: scenes, what runs under MPI, no PETSc objects left over."""

import gc
import sys
from pathlib import Path

from mpi4py import MPI

import pytest

from ufl_beam import simulation

sys.path.insert(0, str(Path(__file__).parent))

# Under mpirun the tests' small scenes, too, are shared among all processes.
simulation.SMALLEST_SHARE = 1

COMM = MPI.COMM_WORLD


@pytest.fixture(autouse=True)
def _no_garbage():
    """Collect garbage after each test, so that all processes free PETSc objects together."""
    yield
    gc.collect()


def pytest_collection_modifyitems(config, items):
    """Deselect what is marked `serial` on several ranks, the same on all of them."""
    if COMM.size == 1:
        return
    serial = [item for item in items if item.get_closest_marker("serial")]
    if serial:
        config.hook.pytest_deselected(items=serial)
        items[:] = [item for item in items if item not in serial]


@pytest.fixture
def shared_path(tmp_path):
    """One empty directory for all ranks; `tmp_path` is another on each."""
    return Path(COMM.bcast(str(tmp_path)))


@pytest.fixture
def on_first_rank():
    """`on_first_rank(f)`: the value of f(), called on the first rank, on all; its failure, too."""

    def call(function):
        outcome = None
        if COMM.rank == 0:
            try:
                outcome = True, function()
            except Exception as error:
                outcome = False, repr(error)
        good, value = COMM.bcast(outcome)
        assert good, value
        return value

    return call
