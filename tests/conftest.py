"""What all tests share: the catalogue of scenes, and no PETSc objects left over."""

import gc
import sys
from pathlib import Path

import pytest

from ufl_beam import simulation

sys.path.insert(0, str(Path(__file__).parent))

# Under mpirun the tests' small scenes, too, are shared among all processes.
simulation.SMALLEST_SHARE = 1


@pytest.fixture(autouse=True)
def _no_garbage():
    """Collect garbage after each test, so that all processes free PETSc objects together."""
    yield
    gc.collect()
