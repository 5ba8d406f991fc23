# SPDX-License-Identifier: MIT
"""Patterns of sparse matrices, also with rows of more than 256 entries."""

import numpy as np
import pytest
from scenes import SECTION

import ufl_beam as ub
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
    with pytest.raises(ValueError, match="no such entry"):
        structure.blocks(dofs + 1, lanes)


@pytest.mark.parametrize("scheme", [ub.Static(), ub.EnergyMomentum()], ids=str)
def test_many_beams_around_a_node(scheme):
    """Rows of 309 entries: 102 spokes move as two of them do under a part of the moment."""

    def turned(spokes):
        angles = 2 * np.pi * np.arange(spokes) / spokes
        beams = [ub.Beam((0, 0), (np.cos(a), np.sin(a)), SECTION, cells=2) for a in angles]
        moment = ub.PointLoad(beams[0].start, moment=spokes * 50.0, amplitude=lambda t: t)
        scene = ub.Scene(
            beams,
            joints=[ub.Rigid(*(beam.start for beam in beams))],
            supports=[ub.Clamped(beam.end) for beam in beams],
            loads=[moment],
        )
        run = ub.simulate(scene, scheme, t=(0, 1), dt=0.25)
        return run.displacement(beams[0].start)[:, 2]

    few = turned(2)
    assert few[-1] > 0.1
    np.testing.assert_allclose(turned(102), few, rtol=1e-9)
