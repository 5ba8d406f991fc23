# SPDX-License-Identifier: MIT
"""Critical points of static paths: tangent stiffness of the whole scene, its eigenvalues and modes.

A point of a path is an array: the configuration at the local degrees of freedom (m, rad, forces of
connectors), followed by the load factor.  A direction has the changes of both in the same order.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import cached_property
from typing import NamedTuple

import numpy as np
from scipy.sparse import block_array, coo_array, csr_array, diags_array

from ufl_beam.arrays import Array, Index
from ufl_beam.compiled.csr import Csr
from ufl_beam.discretization.partition import Subdomain
from ufl_beam.display import bracketed, compact_repr
from ufl_beam.errors import ArgumentError, StepFailed
from ufl_beam.simulation.solution import Solution
from ufl_beam.simulation.stepper import Trial
from ufl_beam.solvers.factorization import Factorization

INVERSE_ITERATIONS = 50  # most inverse iterations for a mode
# Change of the mode at which the iterations end.  The relative error of the eigenvalue is about the
# square of this change.
MODE_TOLERANCE = 1e-8


@dataclass(frozen=True, eq=False)
class Branch:
    """Start and direction of a secondary path; made by :meth:`CriticalPoint.branch`.

    Attributes:
        state: Solution whose last state is the start of the path.
        mode: Direction of the path at its start, at all degrees of freedom in the order of the
            numbering; (numbering.size,).

    Example:
        >>> push = ub.PointLoad(beam.end, force=(-2e7, 0), amplitude=lambda t: t)
        >>> column = ub.Scene([beam], supports=[ub.Clamped(beam.start)], loads=[push])
        >>> straight = ub.follow(column, ub.LoadControl(0.05), steps=10)
        >>> buckled = straight.critical[0].branch()
        >>> bent = ub.follow(column, ub.ArcLength(0.05), start=buckled, steps=5)
        >>> bool(abs(bent.displacement(beam.end)[-1, 1]) > 0.5)  # m
        True
    """

    state: Solution
    mode: Array

    __repr__ = compact_repr


@dataclass(frozen=True, eq=False)
class CriticalPoint:
    """Limit or bifurcation point: a state of a path with singular tangent stiffness.

    Attributes:
        kind: "limit" if the load factor has an extremum, "bifurcation" if another branch begins.
        factor: The load factor.
        n: Index of the state in the path.
        state: Solution with this state only.
        mode: Critical mode at all degrees of freedom, in the order of the numbering.  The root mean
            square of all rotations (rad) and all displacements is 1, where displacements are
            divided by the size of the scene.

    Example:
        >>> push = ub.PointLoad(beam.end, force=(-2e7, 0), amplitude=lambda t: t)
        >>> column = ub.Scene([beam], supports=[ub.Clamped(beam.start)], loads=[push])
        >>> point = ub.follow(column, ub.LoadControl(0.05), steps=10).critical[0]
        >>> print(point.kind, round(point.factor, 2))
        bifurcation 0.44
    """

    kind: str
    factor: float
    n: int
    state: Solution
    mode: Array

    __repr__ = bracketed

    def branch(self, sign: int = 1) -> Branch:
        """Return the start of the secondary path along ``sign`` times the mode.

        Raises:
            ArgumentError: ``sign`` is neither 1 nor -1, or the point is a limit point, at which no
                path branches.
        """
        if sign not in (1, -1):
            raise ArgumentError(f"branch: sign = {sign!r} must be 1 or -1")
        if self.kind != "bifurcation":
            raise ArgumentError(f"branch: no other branch begins at a {self.kind} point")
        return Branch(self.state, sign * self.mode)

    def __str__(self) -> str:
        return f"{self.kind} point at factor {self.factor:.6g}"


class Stiffness:
    """Tangent stiffness of the whole scene, factored by every process; StepFailed if singular.

    Each process contributes its subdomain's tangent A, the local degrees of freedom ``constrained``
    by supports, and its addend ``rate`` to the derivative of the residual with respect to the load
    factor.  ``weights`` are the weights of the norm of a direction, at all degrees of freedom of
    the scene.

    A force of a connector has a column and a row of the tangent.  The column has the gradient g of
    the connector's motion; the row has α g, and β on the diagonal.  Division of the row by α makes
    the tangent symmetric.  If β is not zero, the unit of the force makes the diagonal entry ±1.  A
    force that does not depend on the motion has α = 0.  Each force that constrains the motion or
    grows with it adds one negative eigenvalue.

    Attributes:
        negative: Number of negative eigenvalues after elimination of the connectors' forces.  For
            an unsymmetric tangent, as with follower loads: 1 if the determinant is negative, else
            0.
        symmetric: True if the tangent is symmetric.
        flow: Derivative of the configuration with respect to the load factor, zero at degrees of
            freedom that supports constrain; (numbering.size,).
    """

    def __init__(
        self, subdomain: Subdomain, A: Csr, constrained: Index, rate: Array, weights: Array
    ) -> None:
        numbering = subdomain.numbering
        triplets = subdomain.dofs[A.rows()], subdomain.dofs[A.indices], A.data
        gathered = subdomain.comm.allgather(
            (*triplets, subdomain.dofs, rate, subdomain.dofs[constrained])
        )
        rows, columns, data, dofs, rates, fixed = map(np.concatenate, zip(*gathered, strict=True))
        free = np.setdiff1d(np.arange(numbering.size), fixed)
        shape = (numbering.size, numbering.size)
        self._K = csr_array(coo_array((data, (rows, columns)), shape=shape))[free][:, free]
        self._forces = np.bincount(dofs, weights=rates, minlength=numbering.size)[free]
        self._free, self._size, self._weights = free, numbering.size, weights[free]
        self._num_motions = n = len(free) - len(numbering.multipliers)

        K, G, B = self._K[:n, :n], self._K[:n, n:], self._K[n:, :n]
        β = self._K.diagonal()[n:]
        squares = np.asarray(G.multiply(G).sum(axis=0)).ravel()
        products = np.asarray(G.multiply(B.T).sum(axis=0)).ravel()
        α = products / np.where(squares > 0, squares, 1.0)
        holds = β == 0.0
        slope = α / np.where(holds, 1.0, β)
        self._unit = np.where(holds, 1.0, np.sqrt(np.abs(slope)))
        self._row_scale = self._unit / np.where(α == 0.0, 1.0, α)
        self._β, self._G = np.where(holds, np.inf, β), G
        negative = holds | (slope < 0.0)
        diagonal = np.where(holds, 0.0, np.where(negative, -1.0, 1.0))
        lower = [diags_array(self._row_scale) @ B, diags_array(diagonal)]
        blocks = [[K, G @ diags_array(self._unit)], lower]
        try:
            self._factors = Factorization(csr_array(block_array(blocks)))
        except np.linalg.LinAlgError:
            raise StepFailed("the tangent stiffness is singular") from None
        self.symmetric = self._factors.symmetric
        self.negative = self._factors.negative - int(negative.sum())
        if not self.symmetric:
            self.negative %= 2
        self.flow = self._spread(-self._solve(self._forces))

    def _solve(self, b: Array) -> Array:
        n = self._num_motions
        forces = b[n:] / self._β
        scaled = np.where(np.isinf(self._β), self._row_scale * b[n:], 0.0)
        x = self._factors.solve(np.concatenate([b[:n] - self._G @ forces, scaled]))
        x[n:] = forces + self._unit * x[n:]
        return x

    @property
    def most_work(self) -> float:
        """Work of the load if each dof had the largest component of the softest mode; N m."""
        units = np.sqrt(self._weights)
        moving = units > 0.0
        forces = np.abs(self._forces[moving]) / units[moving]
        return float(forces.sum() * np.abs(self.softest[1][self._free] * units).max())

    def _spread(self, free_values: Array) -> Array:
        values = np.zeros(self._size)
        values[self._free] = free_values
        return values

    @cached_property
    def softest(self) -> tuple[float, Array]:
        """Eigenvalue nearest to zero (N m), and its mode with the norm 1; (numbering.size,)."""
        w = self._weights
        mode = np.random.default_rng(0).normal(size=len(w)) / np.sqrt(np.maximum(w, w.max()))
        for _ in range(INVERSE_ITERATIONS):
            before, mode = mode, self._solve(w * mode)
            mode /= np.sqrt(w @ mode**2) * np.sign(w @ (mode * before) or 1.0)
            if w @ (mode - before) ** 2 <= MODE_TOLERANCE**2:
                break
        # The sum needs extended precision, because the works of stiff cells nearly cancel.
        K, x = self._K.tocoo(), mode.astype(np.longdouble)
        λ = float(np.sum(K.data * x[K.row] * x[K.col]))
        return λ, self._spread(mode * np.sign(mode[np.abs(w * mode).argmax()]))


class Candidate(NamedTuple):
    """Solved step that may be accepted, with stiffness and direction of the path at its end.

    ``mode`` is the critical mode if the end is a bifurcation point, else None.
    """

    trial: Trial
    stiffness: Stiffness
    direction: Array
    #: Slope |t'|/|q'| of the path, with the load factor t and the configuration q.  As K q' = f t',
    #: a slope of zero means that q' is a critical mode.  The load f does work on this mode; it does
    #: none on the mode of a bifurcation point.
    slope: float
    mode: Array | None = None

    @property
    def softness(self) -> float:
        """Magnitude of the eigenvalue nearest to zero; N m."""
        return abs(self.stiffness.softest[0])

    @property
    def work(self) -> float:
        """Work of the load on the critical mode, near a critical point; N m.

        The work f·x is softness divided by slope, because t'/|q'| = λ/(f·x) for a motion along a
        mode x of norm 1 with the eigenvalue λ.  If the load does no work on x, this quotient tends
        to zero at the critical point, despite round-off in q'.
        """
        return self.softness / self.slope if self.slope else math.inf

    @property
    def end(self) -> Array:
        """Configuration and load factor at the end of the step."""
        return np.append(self.trial.q1, self.trial.step.t1)

    def passed(self, before: Candidate) -> bool:
        """Return whether an eigenvalue or the load factor's rate changed sign since ``before``."""
        turned = (self.direction[-1] < 0) != (before.direction[-1] < 0)
        now, then = self.stiffness, before.stiffness
        change = now.negative - then.negative
        even = not (now.symmetric and then.symmetric) and change % 2 == 0
        return bool(turned or (change and not even))
