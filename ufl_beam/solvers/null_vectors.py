# SPDX-License-Identifier: MIT
"""Null vectors of singular tangents, and idle motions: those that no force resists or drives.

The node where several members meet has no mass of its own.  When all plastic hinges around it have
lost their strength, any rotation of the node is an equilibrium, and the tangent stiffness is
singular.  Newton's method then keeps the node where it is: an entry on the diagonal of the tangent
makes its equation solvable.  Residuals, hence forces, energies and solutions, know nothing of it.
"""

from __future__ import annotations

import numpy as np
from scipy.linalg import qr
from scipy.sparse import coo_array, csc_array, diags_array, eye_array
from scipy.sparse.linalg import splu

from ufl_beam.arrays import Array, Index
from ufl_beam.compiled.csr import Csr
from ufl_beam.discretization.partition import Share
from ufl_beam.discretization.state_io import Memory

DENSE = 300
"""Up to this number of unknowns the null vector comes from a singular value decomposition."""

SINGULAR = 1e-12
"""Singular values of an equilibrated matrix up to this part of its entries count as zero."""

ROUNDS = 40
"""Largest number of times that rows and columns are scaled."""


def free_matrix(share: Share, A: Csr, held: Index) -> tuple[csc_array, Index]:
    """Assemble the tangent at what supports leave free, and its dofs in numbers of the grid.

    All processes call it together, each with its part ``A``, and local numbers of what is ``held``.
    """
    here = (share.dofs[A.rows()], share.dofs[A.indices], A.data, share.dofs[held])
    parts = share.comm.allgather(here) if not share.alone else [here]
    rows, columns, data, of_all = (np.concatenate(x) for x in zip(*parts, strict=True))
    n = share.grid.size
    free = np.setdiff1d(np.arange(n), of_all)
    K = coo_array((data, (rows, columns)), shape=(n, n)).tocsc()
    return csc_array(K[:, free][free]), free


def null_vector(K: csc_array) -> tuple[float, Array]:
    """Compute the vector that an equilibrated matrix makes least of, and how much; see below."""
    sizes, vectors = null_vectors(K)
    return float(sizes[-1]), vectors[:, -1]


def null_vectors(K: csc_array) -> tuple[Array, Array]:
    """Compute vectors that a matrix, its rows and columns scaled to size one, makes nothing of.

    The result is how much it makes of them, without dimension, the least last; and the vectors in
    columns, in the units of the unknowns.  One at least; of large matrices one only.
    """
    scaled, factors = _equilibrated(K)
    n = scaled.shape[0]
    if n <= DENSE:
        _, sizes, vectors = np.linalg.svd(scaled.toarray())
        number = max(1, int(np.count_nonzero(sizes <= SINGULAR)))
        return sizes[-number:], factors[:, None] * vectors[-number:].T
    # A shift far below the entries makes the factors those of a regular matrix.
    shifted = splu(csc_array(scaled + SINGULAR * eye_array(n)))
    y: Array = np.random.default_rng(0).normal(size=n)
    for _ in range(20):
        y = shifted.solve(shifted.solve(y / np.linalg.norm(y), trans="T"))
    y /= np.linalg.norm(y)
    return np.array([np.linalg.norm(scaled @ y)]), (factors * y)[:, None]


def _equilibrated(K: csc_array) -> tuple[csc_array, Array]:
    """Scale rows and columns so that their largest entries are about one; factors of columns."""
    n = K.shape[0]
    columns = np.ones(n)
    for _ in range(ROUNDS):
        sizes = abs(K)
        by_row, by_column = (np.asarray(sizes.max(axis=k).todense()).ravel() for k in (1, 0))
        both = np.concatenate([by_row, by_column])
        if np.all((both == 0) | ((both > 0.5) & (both < 2))):
            break
        r, c = (1 / np.sqrt(np.where(x > 0, x, 1.0)) for x in (by_row, by_column))
        K = csc_array(diags_array(r) @ K @ diags_array(c))
        columns *= c
    return K, columns


# -- idle motions ----------------------------------------------------------------------------------

STIFFNESS = 0.01
"""Stiffness against an idle motion in the tangent, as a part of the largest one in the scene.

A motion that is resisted after all converges the faster, the smaller this is; round-off moves what
is idle the less, the larger it is.
"""

DRIVEN = 1e-6
"""Force, as a part of the forces in the scene, above which a motion is driven, and not idle."""


class IdleMotions:
    """Stiffnesses that the tangent has against idle motions, if any were found; N/m, N m/rad."""

    def __init__(self, share: Share, A: Csr, diagonal: Index, held: Index) -> None:
        self._share, self._A, self._diagonal, self._held = share, A, diagonal, held
        self._turns = np.zeros(share.size, dtype=bool)
        self._turns[share.rotations()] = True
        self._owned = np.arange(share.size) < share.num_owned
        self._owned[share.multipliers()] = False
        grid = share.grid
        self._radians = np.full(grid.size, 1 / grid.scene.size)
        self._radians[grid.rotations] = 1.0
        self._radians[grid.multipliers] = 0.0
        self.stiffness: Array = np.zeros(share.size)

    @property
    def entries(self) -> tuple[Index, Array]:
        """Positions in the data of the tangent, and what is added there."""
        here = np.flatnonzero(self.stiffness)
        return self._diagonal[here], self.stiffness[here]

    def find(self, forces: Array, scale: float) -> bool:
        """Look for idle motions of the latest tangent; false if one that meets no force is driven.

        All processes call it together.  ``forces`` are the sizes of the latest residual, moments
        over the size of the scene, ``scale`` that of the forces in the scene; N.
        """
        share = self._share
        K, free = free_matrix(share, self._A, self._held)
        if not len(free) or not np.isfinite(K.data).all():
            return False
        try:
            _, vectors = null_vectors(K)
        except (np.linalg.LinAlgError, RuntimeError):
            return False
        motions = self._radians[free, None] * vectors
        # One degree of freedom of each motion, such that these motions are independent there.
        pivots = qr(motions.T, mode="r", pivoting=True)[1][: vectors.shape[1]]
        found = free[pivots[np.abs(motions[pivots]).max(axis=1) > 0.0]]
        here = np.isin(share.dofs, found)
        new = here & (self.stiffness == 0.0)
        driven = here & (forces > DRIVEN * scale)
        if not share.total(float(new.any())) or share.total(float(driven.any())):
            return False
        diagonal = np.abs(self._A.data[self._diagonal])
        for alike in (self._turns, ~self._turns):
            stiffest = share.largest(float(diagonal[alike & self._owned].max(initial=0.0)))
            self.stiffness[new & alike & self._owned] = STIFFNESS * stiffest
        return True

    def forget(self) -> bool:
        """Take all stiffnesses away; return whether there were any, on any process."""
        some = self._share.largest(float(self.stiffness.max(initial=0.0))) > 0.0
        self.stiffness[:] = 0.0
        return some

    def remember(self, memory: Memory) -> None:
        """Pass on the stiffnesses."""
        self.stiffness[:] = memory.at_dofs("idle motions", self.stiffness)
