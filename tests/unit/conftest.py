"""Unit and property tests under MPI: which of them run, and a directory for all ranks."""

import gc
from pathlib import Path

from mpi4py import MPI

import pytest

COMM = MPI.COMM_WORLD


def pytest_collection_modifyitems(config, items):
    """Deselect what is marked `serial` on several ranks, the same on all of them."""
    if COMM.size == 1:
        return
    serial = [item for item in items if item.get_closest_marker("serial")]
    if serial:
        config.hook.pytest_deselected(items=serial)
        items[:] = [item for item in items if item not in serial]


def pytest_collection_finish(session):
    """What exists before the first test stays; collections then look at what tests made only."""
    gc.collect()
    gc.freeze()


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
