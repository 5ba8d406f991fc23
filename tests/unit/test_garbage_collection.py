# SPDX-License-Identifier: MIT
"""Garbage collection is suspended while scenes are built, and as it was afterwards."""

import gc

import pytest

import ufl_beam as ub
from ufl_beam.memory import no_garbage_collection


@pytest.mark.parametrize("enabled", [True, False])
def test_it_is_as_it_was(enabled):
    try:
        if not enabled:
            gc.disable()
        with pytest.raises(KeyError), no_garbage_collection(), no_garbage_collection():
            raise KeyError if not gc.isenabled() else ValueError
        assert gc.isenabled() == enabled
    finally:
        gc.enable()


def test_after_scenes_that_are_refused():
    with pytest.raises(ub.ArgumentError, match="no beams"):
        ub.Scene()
    assert gc.isenabled()
