# SPDX-License-Identifier: MIT
"""Patterns of sparse matrices, also with rows of more than 256 entries."""

import numpy as np
import pytest

from ufl_beam.compiled.csr import zero_matrix
from ufl_beam.compiled.simd_kernels import in_batches


def hub(number):
    """Pairs of the first unknown with each of so many others."""
    return np.array([[0, i + 1] for i in range(number)], dtype=np.int32)


@pytest.mark.parametrize("lanes", [1, 4])
@pytest.mark.parametrize(
    "dofs",
    [np.random.default_rng(3).permutation(18).reshape(6, 3).astype(np.int32), hub(255), hub(256)],
    ids=["cells", "hub", "rows of more than 256 entries"],
)
def test_entries_of_all_pairs_of_cells(dofs, lanes):
    """Positions in the row, or in the matrix if rows are long; the last batch is filled up."""
    number, width = dofs.shape
    structure = zero_matrix(dofs.max() + 2, dofs)
    rows, columns = np.repeat(dofs, width, axis=1).ravel(), np.tile(dofs, width).ravel()
    expected = structure.positions(rows, columns)
    assert np.array_equal(structure.rows()[expected], rows)
    assert np.array_equal(structure.indices[expected], columns)
    if number < 256:
        expected = expected - structure.indptr[rows]
    found = structure.blocks(dofs, lanes)
    assert np.array_equal(found, in_batches(expected.reshape(number, -1), lanes))
    for ask in (lambda: structure.blocks(dofs + 1, lanes), lambda: structure.positions([-1], [0])):
        with pytest.raises(ValueError, match="no such entry"):
            ask()
