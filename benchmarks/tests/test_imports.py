# SPDX-License-Identifier: MIT
"""All benchmarks import: no name that they use was removed from the package."""

import importlib
from pathlib import Path

import pytest

SCRIPTS = sorted(path.stem for path in Path(__file__).parents[1].glob("*.py"))


@pytest.mark.parametrize("script", SCRIPTS)
def test_a_benchmark_can_be_imported(script):
    assert importlib.import_module(script).__doc__
