# SPDX-License-Identifier: MIT
"""What all tests share: scenes, what runs under MPI, no PETSc objects left over."""

import gc
import json
import sys
from pathlib import Path

from mpi4py import MPI

import pytest

from ufl_beam import parallel
from ufl_beam.errors import ArgumentError

HERE = Path(__file__).parent
sys.path[:0] = [str(HERE), str(HERE / "properties")]

# Under mpirun the tests' small scenes, too, are shared among all processes.
parallel.SMALLEST_SUBDOMAIN = 1

COMM = MPI.COMM_WORLD


@pytest.fixture(autouse=True)
def _no_garbage():
    """Collect garbage after each test, so that all processes free PETSc objects together."""
    yield
    pytest_collection_finish()


def pytest_collection_finish():
    """Freeze the objects that exist: a collection takes 0.1 s if it looks at those of all tests."""
    gc.collect()
    gc.freeze()


@pytest.hookimpl(wrapper=True)
def pytest_pyfunc_call():
    """Skip tests of the reference solver on several ranks, which it refuses by name."""
    try:
        return (yield)
    except ArgumentError as error:
        if COMM.size > 1 and str(error).startswith("Newton: reference=True cannot be combined"):
            pytest.skip("the reference solver computes on one process")
        raise


def pytest_addoption(parser):
    """Add `--every=N`, for runs that are slow because something watches them."""
    parser.addoption("--every", type=int, default=1, help="run the first of N tests each")
    parser.addoption("--first", type=int, default=0, help="begin after this number of tests")


@pytest.hookimpl(trylast=True)  # after the selection by markers
def pytest_collection_modifyitems(config, items):
    """Deselect what is marked `serial` on several ranks, and all but every N-th test."""
    serial = {i for i in items if COMM.size > 1 and i.get_closest_marker("serial")}
    first, every = map(config.getoption, ("first", "every"))
    kept = [item for item in items if item not in serial][first::every]
    chosen = set(kept)
    if deselected := [item for item in items if item not in chosen]:
        config.hook.pytest_deselected(items=deselected)
        items[:] = kept


REFERENCE = HERE / "data" / "reference.json"
"""Numbers in the middle and at the end of runs of the reference solver of version 0.1.0, by tests.

It had all effects in NumPy, and is gone: a test whose scene changes needs other numbers, of a
closed form or of a calculation that does not use the package.
"""


@pytest.fixture
def as_by_reference(request):
    """`as_by_reference(run)`: a run has the numbers of the reference solver of version 0.1.0."""
    from stored_scenes import differences, numbers

    if COMM.size > 1:
        pytest.skip("the numbers are of one process")
    name = f"{request.node.path.stem}: {request.node.name}"
    stored = iter(json.loads(REFERENCE.read_text("utf-8"))[name])

    def require(run, tolerance=1e-9):
        """Raise if a number differs by more than a part of the largest motion, force or energy."""
        found, expected = numbers(run.scene, run, [len(run) // 2, -1]), next(stored)
        assert found.keys() == expected.keys()
        found = differences(found, {name: expected[name] for name in found})
        wrong = {name: part for name, part in found.items() if not part < tolerance}
        assert not wrong

    yield require
    assert next(stored, None) is None  # the test has compared all runs


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
                outcome = "", function()
            except Exception as error:
                outcome = repr(error), None
        failure, value = COMM.bcast(outcome)
        assert not failure
        return value

    return call
