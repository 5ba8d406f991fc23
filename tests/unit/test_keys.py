# SPDX-License-Identifier: MIT
"""Functions that are found in the cache by their arguments, before they are made in UFL."""

import shutil
from dataclasses import dataclass, replace

import numpy as np
import pytest

import ufl_beam as ub
from ufl_beam.blocks.beams import ElasticCell
from ufl_beam.compiled import code_cache, jit
from ufl_beam.compiled.c_library import doubles
from ufl_beam.compiled.keys import key_of
from ufl_beam.compiled.simd_kernels import BATCH
from ufl_beam.discretization.compiled_forms import Pointwise, Stated, compiled_functions
from ufl_beam.model.fibres import Kind

CELL = ElasticCell(1, ub.EnergyMomentum(), functions=0)


@dataclass(frozen=True)
class OfUser(ub.EnergyMomentum):
    """A scheme whose name does not determine its code."""


def test_keys_differ_as_arguments_do():
    others = [
        replace(CELL, degree=2), replace(CELL, functions=1), replace(CELL, scheme=ub.Static()),
        replace(CELL, scheme=ub.EnergyMomentum(alpha=0.1)), (CELL,), CELL.degree, [CELL, None],
    ]  # fmt: skip
    keys = {key_of("cells", CELL), key_of("else", CELL), *(key_of("cells", x) for x in others)}
    assert None not in keys
    assert len(keys) == 2 + len(others)
    assert key_of("cells", CELL) == key_of("cells", replace(CELL))
    assert len({key_of(x) for x in (0.0, -0.0, 0, False, "0.0", None, ())}) == 7


def test_objects_of_users_have_no_key():
    def law(x):
        return x

    class Law(ub.ElastoPlastic):
        """A law of a user."""

    for one in (OfUser(), OfUser, law, np.ones(2), Kind(Law(1.0), ()), {"law": law}):
        assert key_of(one) is None
        assert key_of("cells", (1.0, one)) is None


@pytest.fixture
def fresh(monkeypatch, tmp_path):
    monkeypatch.setattr(code_cache, "_place", lambda: tmp_path)
    jit.cached_form.cache_clear()
    yield tmp_path
    jit.cached_form.cache_clear()


@pytest.mark.serial
def test_a_function_is_stated_once(fresh):
    """And once more if the cache has lost its code."""
    stated = []

    def state():
        pointwise = Pointwise(["a", "b"])
        a, b = pointwise.at.values()
        stated.append(pointwise)
        return Stated(pointwise, [[], [a * b, a + b]], {"names": ["of", "facts"]})

    def check():
        (none, function), facts = compiled_functions("product", state)
        assert none is None
        assert facts == {"names": ["of", "facts"]}
        inputs, out = np.full((2, BATCH), [[3.0], [5.0]]), np.empty((2, BATCH))
        function.several(1, doubles(inputs), doubles(out))
        assert (out.T == [15.0, 8.0]).all()

    check()
    check()
    assert len(stated) == 1
    (form,) = fresh.glob("form_*[!k]")
    shutil.rmtree(form)
    jit.cached_form.cache_clear()
    check()
    assert len(stated) == 2
    compiled_functions(None, state)
    assert len(stated) == 3
