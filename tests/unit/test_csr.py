# SPDX-License-Identifier: MIT
"""Structures of matrices."""

import numpy as np
import pytest

from ufl_beam.compiled.c_library import doubles, fill
from ufl_beam.compiled.csr import Product, zero_matrix
from ufl_beam.compiled.simd_kernels import in_batches
from ufl_beam.terms.inertia_and_damping import StepProduct


@pytest.mark.parametrize("number", [1, 255, 256, 257])
def test_a_joint_of_many(number):
    """What many share has its entries, however often they are counted."""
    pairs = np.array([[0, i + 1] for i in range(number)])
    structure = zero_matrix(number + 1, pairs)
    rows = np.repeat(np.arange(number + 1), np.diff(structure.indptr))
    expected = np.eye(number + 1, dtype=bool)
    expected[0], expected[:, 0] = True, True
    assert np.array_equal(np.argwhere(expected), np.column_stack([rows, structure.indices]))


@pytest.mark.parametrize("size", [1, 30, 200])
def test_pattern_of_groups(size):
    """The diagonal and all pairs of a group, in order; a row of 200 is sorted in another way."""
    random = np.random.default_rng(size)
    groups = [random.integers(0, size, (n, width)) for n, width in ((20, 3), (0, 4), (5, 7))]
    hub = np.column_stack([np.zeros(size, dtype=np.int32), random.permutation(size)])
    structure = zero_matrix(size, *groups, hub.astype(np.int32))
    expected = np.eye(size, dtype=bool)
    for group in (row for rows in (*groups, hub) for row in rows):
        expected[np.ix_(group, group)] = True
    found = np.column_stack([structure.rows(), structure.indices])
    assert np.array_equal(np.argwhere(expected), found)
    assert np.array_equal(
        structure.positions(*2 * [np.arange(size)]), np.flatnonzero(np.equal(*found.T))
    )
    some = random.integers(0, size, 4)
    entries = [np.flatnonzero(found[:, 0] == row) for row in some]
    assert np.array_equal(structure.entries_of(some), np.concatenate(entries))


def test_released_indices_are_found_again():
    structure = zero_matrix(5, np.array([[0, 2], [3, 1]], dtype=np.int32))
    other, before = structure.zeros_like(), structure.indices.copy()
    structure.free()
    assert "indices" not in vars(structure)
    assert np.array_equal(structure.indices, before)
    assert np.array_equal(other.indices, before)
    structure.petsc()
    structure.free()
    assert "indices" in vars(structure)  # PETSc has them


@pytest.mark.parametrize("lanes", [1, 4])
@pytest.mark.parametrize("number", [1, 4, 6])
def test_blocks_of_cells(number, lanes):
    """Places of all pairs of a cell, as asked for one by one; the last batch is filled up."""
    dofs = np.random.default_rng(3).permutation(3 * number).reshape(number, 3).astype(np.int32)
    structure = zero_matrix(3 * number + 1, dofs)
    one_by_one = structure.positions(np.repeat(dofs, 3, axis=1).ravel(), np.tile(dofs, 3).ravel())
    in_rows = one_by_one - structure.indptr[np.repeat(dofs, 3, axis=1).ravel()]
    found = structure.blocks(dofs, lanes)
    assert found.dtype == np.uint8
    assert np.array_equal(found, in_batches(in_rows.reshape(number, 9), lanes))
    with pytest.raises(ValueError, match="no such entry"):
        structure.blocks(dofs + 1, lanes)


@pytest.mark.parametrize(("number", "kind"), [(255, np.uint8), (256, np.int32)])
def test_blocks_of_a_hub_of_many(number, kind):
    """Rows of more than 256 entries need wider places."""
    pairs = np.array([[0, i + 1] for i in range(number)], dtype=np.int32)
    structure = zero_matrix(number + 1, pairs)
    expected = structure.positions(np.repeat(pairs, 2, axis=1).ravel(), np.tile(pairs, 2).ravel())
    if kind == np.uint8:
        expected = expected - structure.indptr[np.repeat(pairs, 2, axis=1).ravel()]
    found = structure.blocks(pairs, 1)
    assert found.dtype == kind
    assert np.array_equal(found[:, :, 0], expected.reshape(number, 4))


def begin(product, q0, factor, back, v):
    """Begin a step at ``q0``, with velocities ``v``."""
    fill(product.c, q0=q0, factor=factor, back=back, v=v)


def add(loop, q, out):
    """Add what a loop makes of ``q``."""
    function, data = loop
    function(data, doubles(q), doubles(out))


@pytest.mark.parametrize("number", [255, 256])
def test_a_constant_matrix_with_a_hub(number):
    """Its zeros are not kept, and its entries are found in the tangent, also in long rows."""
    A = zero_matrix(number + 1, np.array([[0, i + 1] for i in range(number)], dtype=np.int32))
    A.data[:] = np.random.default_rng(1).choice([0.0, 1.0, 3.0], len(A.data))
    tangent, nothing = A.zeros_like(), np.zeros(A.size)
    product = StepProduct(A, np.array([2], dtype=np.int32), tangent, np.empty(A.size))
    begin(product, nothing, 2.0, 0.0, nothing)
    add(product.loops[1], nothing, tangent.data)  # the derivative of a rotation from rest is one
    assert np.array_equal(tangent.data, 2 * A.data)
    assert np.array_equal(product.matrix().data, A.data)
    assert len(product.A.data) == np.count_nonzero(A.data)


def masses(*, lumped, size=60):
    """Masses along a chain of vertices, with a hub and rows of nothing; the matrix also dense."""
    cells = np.arange(size).reshape(-1, 3)
    pairs = np.hstack([cells[:-1], cells[1:]])
    A = zero_matrix(size, pairs.astype(np.int32), np.array([[0, 31, 7, 50]], dtype=np.int32))
    rows, columns = A.rows(), A.indices
    random, away = np.random.default_rng(4), np.abs(columns - rows)
    A.data[:] = random.uniform(1, 2, len(rows)) * (away == 0 if lumped else away % 3 == 0)
    A.data[(rows >= 21) & (rows < 24)] = 0.0
    dense = np.zeros((size, size))
    dense[rows, columns] = A.data
    return A, dense


@pytest.mark.parametrize("lumped", [False, True])
def test_products_with_runs_of_rows(lumped):
    A, dense = masses(lumped=lumped)
    product, x = Product(A), np.random.default_rng(5).normal(size=A.size)
    assert product.c.runs <= (3 if lumped else 12)
    assert np.allclose(product(x), dense @ x, rtol=1e-14, atol=1e-14)
    places, _ = product.places(A)
    row, column = A.rows()[places], A.indices[places]
    assert np.array_equal(np.sort(row * A.size + column), np.flatnonzero(dense))
    assert np.array_equal(product.data, dense[row, column])


def test_an_empty_constant_matrix():
    product = Product(zero_matrix(0))
    assert len(product(np.empty(0))) == 0


@pytest.mark.parametrize("lumped", [False, True])
def test_the_tangent_of_a_constant_matrix(lumped):
    """Of forces A (factor s - back v) at some rotations, by differences."""
    A, dense = masses(lumped=lumped)
    rotations, random = np.arange(2, A.size, 3, dtype=np.int32), np.random.default_rng(6)
    tangent = A.zeros_like()
    product = StepProduct(A, rotations, tangent, np.empty(A.size))
    q0, q1, v = random.normal(size=(3, A.size))
    begin(product, q0, 3.0, 2.0, v)

    def force(q):
        r = np.zeros(A.size)
        add(product.loops[0], q, r)
        return r

    step = q1 - q0
    step[rotations] = 2 * np.tan(step[rotations] / 2)
    assert np.allclose(force(q1), dense @ (3 * step - 2 * v), rtol=1e-13, atol=1e-12)
    add(product.loops[1], q1, tangent.data)
    found = np.zeros_like(dense)
    found[A.rows(), A.indices] = tangent.data
    differences = [(force(q1 + h) - force(q1 - h)) / 2e-6 for h in 1e-6 * np.eye(A.size)]
    # Second differences of tan, which are large where a node turns far: a digit fewer than 1e-12.
    assert np.allclose(found.T, differences, rtol=1e-6, atol=1e-6)
