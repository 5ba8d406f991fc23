"""What all tests share: the catalogue of scenes, and no PETSc objects left over."""

import gc
import sys
from pathlib import Path

import pytest

sys.path.insert(0, str(Path(__file__).parent))


@pytest.fixture(autouse=True)
def _no_garbage():
    """Collect garbage after each test, so that all processes free PETSc objects together."""
    yield
    gc.collect()
