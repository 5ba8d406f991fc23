# SPDX-License-Identifier: MIT
"""Options of the discretization: cells, degrees of elements, mass matrix."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from fractions import Fraction
from functools import cache, cached_property
from itertools import pairwise
from numbers import Rational, Real

import numpy as np
import numpy.typing as npt

from ufl_beam.display import one_line
from ufl_beam.errors import SceneError, require_kind, require_memory, require_number, shorten
from ufl_beam.model.bodies import Member


@dataclass(frozen=True)
class Mesh:
    """Discretization of a scene: number of cells, polynomial degree, lumped mass.

    Args:
        refine: Factor on the number of cells between any two places of a beam; a whole number
            divides each cell, ``Fraction(1, 2)`` joins two and two.
        degree: Polynomial degree of displacements and rotations in a cell, 1, 2 or 3, integrated
            with as many points; more than 1 for elastic beams only.
        lumped: Take the lumped mass matrix of the beams: diagonal, with the row sums of the
            consistent one.

    Raises:
        SceneError: A number that makes no mesh.

    Example:
        >>> fine = ub.simulate(scene, ub.Static(), t=(0, 1), dt=0.5, mesh=ub.Mesh(refine=4))
        >>> cubic = ub.simulate(scene, ub.Static(), t=(0, 1), dt=0.5, mesh=ub.Mesh(degree=3))
        >>> print(len(fine.shape(beam)), len(cubic.shape(beam)))
        17 5
    """

    refine: int | Fraction = 1
    degree: int = 1
    lumped: bool = False

    __repr__ = one_line

    def __post_init__(self) -> None:
        require_kind(self.lumped, bool, "Mesh: lumped")
        if not isinstance(self.refine, Rational) or self.refine <= 0:
            raise SceneError(
                f"Mesh: refine = {shorten(self.refine)} must be a positive whole number or "
                "Fraction(p, q)"
            )
        require_number(self.refine, "Mesh: refine")
        object.__setattr__(self, "refine", Fraction(self.refine))
        if not isinstance(self.degree, Real) or self.degree not in (1, 2, 3):
            raise SceneError(f"Mesh: degree = {shorten(self.degree)} must be 1, 2 or 3")
        object.__setattr__(self, "degree", int(self.degree))

    @property
    def nodes(self) -> npt.NDArray[np.float64]:
        """Places of the nodes in a cell, from 0 to 1, ascending: Gauss-Lobatto points."""
        return _nodes(self.degree)

    @property
    def point_weights(self) -> npt.NDArray[np.float64]:
        """Parts of a cell that its Gauss points stand for."""
        return _point_weights(self.degree)

    @cached_property
    def parts(self) -> npt.NDArray[np.float64]:
        """Part of a uniform load on a cell, or of its mass, that each node bears."""
        p = self.degree
        at = np.polynomial.legendre.Legendre.basis(p)(2 * self.nodes - 1)
        return np.asarray(1 / (p * (p + 1) * at**2))

    def weights(self, part: npt.ArrayLike) -> npt.NDArray[np.float64]:
        """Lagrange weights of the nodes of a cell in the values at parts of it; (..., nodes)."""
        powers = np.power.outer(part, np.arange(self.degree + 1))
        return np.asarray(powers @ self._polynomials)

    def slopes(self, part: npt.ArrayLike) -> npt.NDArray[np.float64]:
        """Derivatives of :meth:`weights` by the part; (..., nodes)."""
        powers = np.arange(1, self.degree + 1) * np.power.outer(part, np.arange(self.degree))
        return np.asarray(powers @ self._polynomials[1:])

    @cached_property
    def _polynomials(self) -> npt.NDArray[np.float64]:
        """Coefficients of the polynomials that are one in one node, in columns."""
        return np.asarray(np.linalg.inv(np.vander(self.nodes, increasing=True)))

    def vertices(self, beam: Member, attached: Sequence[float]) -> list[float]:
        """Parameters of the vertices of a beam: ends, corners and what is ``attached`` among them.

        Raises:
            SceneError: Between two of those there are too few cells to be joined.
        """
        given = beam.vertices(attached)
        if self.refine == 1:
            return given
        places = sorted({0.0, 1.0, *beam.corners, *attached})
        kept = sorted({int(np.abs(np.subtract(given, s)).argmin()) for s in places})
        for first, last in pairwise(kept):
            if (last - first) * self.refine % 1:
                common = math.gcd(*(b - a for a, b in pairwise(kept)))
                least = f"Fraction(1, {common})" if common > 1 else "1"
                raise SceneError(
                    f"Mesh: refine = {self.refine} makes no whole number of the {last - first} "
                    f"cells between {beam.at(given[first])} and {beam.at(given[last])}, which "
                    f"must be vertices; {beam.name} can take multiples of {least}"
                )
        number = int((len(given) - 1) * self.refine)
        require_memory(number, f"Mesh: refine = {self.refine} of {beam.name}, {number} cells,")
        return [_between(given, i / Fraction(self.refine)) for i in range(number + 1)]


@cache
def _nodes(degree: int) -> npt.NDArray[np.float64]:
    inner = np.polynomial.legendre.Legendre.basis(degree).deriv().roots()
    return np.array([0.0, *((1 + x) / 2 for x in inner.tolist()), 1.0])


@cache
def _point_weights(degree: int) -> npt.NDArray[np.float64]:
    return np.asarray(np.polynomial.legendre.leggauss(degree)[1] / 2)


def _between(values: Sequence[float], position: Fraction) -> float:
    """Value at a position that need not be whole; linear in between."""
    i = int(position)
    part = float(position - i)
    return values[i] * (1 - part) + values[i + 1] * part if part else values[i]
