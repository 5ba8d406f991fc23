# SPDX-License-Identifier: MIT
"""Structures of matrices."""

import numpy as np
import pytest

from ufl_beam.compiled.csr import coupling


@pytest.mark.parametrize("number", [1, 255, 256, 257])
def test_a_joint_of_many(number):
    """What many share has its entries, however often they are counted."""
    pairs = np.array([[0, i + 1] for i in range(number)])
    structure = coupling(number + 1, pairs)
    rows = np.repeat(np.arange(number + 1), np.diff(structure.indptr))
    expected = np.eye(number + 1, dtype=bool)
    expected[0], expected[:, 0] = True, True
    assert np.array_equal(np.argwhere(expected), np.column_stack([rows, structure.indices]))
