"""Critical points of static paths: the stiffness of the whole scene, its signs and its modes."""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from scipy.sparse import coo_array
from scipy.sparse.linalg import splu

from ufl_beam.compat import Array
from ufl_beam.errors import SceneError, StepFailed
from ufl_beam.grid import Index, Share
from ufl_beam.solution import Solution
from ufl_beam.sparse import Csr

ITERATIONS = 50
"""Inverse iterations in which a mode is sought."""


class Direction(NamedTuple):
    """A direction of a path.

    Attributes:
        q: Of the configuration; m, m, rad.
        t: Of the load factor.
    """

    q: Array
    t: float


@dataclass(frozen=True, eq=False)
class Branch:
    """Where a path begins, and in which direction; made by :meth:`CriticalPoint.branch`.

    Attributes:
        state: Solution whose last state is the beginning.
        mode: Direction at all degrees of freedom, in the order of the grid.
    """

    state: Solution
    mode: Array


@dataclass(frozen=True, eq=False)
class CriticalPoint:
    """A state of a path in which its tangent stiffness is singular.

    Attributes:
        kind: "limit" where the load factor turns, "bifurcation" where another branch begins.
        factor: The load factor.
        n: Number of the state in the path.
        state: The state alone, as a solution.
        mode: What moves without a change of load; root mean square 1 of displacements over the
            size of the scene, and of rotations; all degrees of freedom in the order of the grid.
    """

    kind: str
    factor: float
    n: int
    state: Solution
    mode: Array

    def branch(self, sign: int = 1) -> Branch:
        """The path that leaves along the mode, or against it with ``sign = -1``.

        Raises:
            SceneError: ``sign`` is neither 1 nor -1, or nothing branches at a limit point.
        """
        if sign not in (1, -1):
            raise SceneError(f"branch: sign = {sign!r} must be 1 or -1")
        if self.kind != "bifurcation":
            raise SceneError(f"branch: no other branch begins at a {self.kind} point")
        return Branch(self.state, sign * self.mode)

    def __str__(self) -> str:
        return f"{self.kind} point at factor {self.factor:.6g}"


def metric(share: Share) -> Array:
    """Weights of squares, such that a step's sum is its mean square; (share.size,).

    Displacements count as parts of the size of the scene, forces of connectors do not count.  Only
    what a process owns does, so that sums over the processes are right.
    """
    grid = share.grid
    weights = np.full(share.size, 1 / grid.scene.size**2)
    weights[share.rotations()] = 1.0
    weights[share.multipliers()] = 0.0
    weights[share.num_owned :] = 0.0
    return weights / (grid.size - len(grid.multipliers))


class Stiffness:
    """The tangent stiffness of the whole scene, factored by every process.

    Args:
        share: The degrees of freedom of this process.
        A: Its part of the tangent.
        held: Local degrees of freedom that supports hold.
        rate: Its part of the residual's derivative by the load factor.

    Attributes:
        negative: Number of negative pivots, those of the forces of connectors left out.  Where the
            stiffness is symmetric, of negative eigenvalues; else its parity is the sign of the
            determinant.
        flow: What a unit of the load factor moves; (grid.size,), without what is held.

    Raises:
        StepFailed: It is exactly singular.
    """

    def __init__(self, share: Share, A: Csr, held: Index, rate: Array) -> None:
        grid = share.grid
        here = (share.dofs[A.rows()], share.dofs[A.indices], A.data, share.dofs, rate)
        parts = share.comm.allgather(here) if share.comm.size > 1 else [here]
        rows, columns, data, dofs, rates = (np.concatenate(x) for x in zip(*parts, strict=True))
        of_all = share.dofs[held]
        if share.comm.size > 1:
            of_all = np.concatenate(share.comm.allgather(of_all))
        free = np.setdiff1d(np.arange(grid.size), of_all)
        shape = (grid.size, grid.size)
        self._K = coo_array((data, (rows, columns)), shape=shape).tocsc()[:, free][free]
        forces = np.bincount(dofs, weights=rates, minlength=grid.size)[free]
        try:
            # Pivots on the diagonal are those of L D L'.  The order of the grid has the forces of
            # connectors last, where they find no zero there.
            self._factors = splu(
                self._K,
                permc_spec="NATURAL" if len(grid.multipliers) else "MMD_AT_PLUS_A",
                diag_pivot_thresh=0.0,
                options={"SymmetricMode": True, "Equil": False},
            )
        except RuntimeError as error:
            raise StepFailed("the tangent stiffness is singular") from error
        pivots = self._factors.U.diagonal()
        self.negative = int(np.sum(pivots < 0)) - len(grid.multipliers)
        self._free, self._size = free, grid.size
        self.flow = self._spread(-self._factors.solve(forces))

    def _spread(self, of_free: Array) -> Array:
        values = np.zeros(self._size)
        values[self._free] = of_free
        return values

    def softest(self, weights: Array) -> tuple[float, Array]:
        """The eigenvalue nearest to zero, N m, and its mode of unit size; (grid.size,).

        Args:
            weights: :func:`metric` of all degrees of freedom, in the order of the grid.
        """
        w = weights[self._free]
        mode = np.random.default_rng(0).normal(size=len(w)) / np.sqrt(np.maximum(w, w.max()))
        λ = np.inf
        for _ in range(ITERATIONS):
            mode = self._factors.solve(w * mode)
            mode /= np.sqrt(w @ mode**2)
            before, λ = λ, float(mode @ (self._K @ mode))
            if abs(λ - before) <= 1e-10 * abs(λ):
                break
        return λ, self._spread(mode * np.sign(mode[np.abs(w * mode).argmax()]))
