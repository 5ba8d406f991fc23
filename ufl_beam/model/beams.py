# SPDX-License-Identifier: MIT
"""Beams: undeformed axis, cross-section, cells."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, fields
from fractions import Fraction
from functools import cached_property, partial
from itertools import accumulate, pairwise
from numbers import Rational, Real
from typing import Annotated, Any

import numpy as np
import numpy.typing as npt

from ufl_beam.arrays import Array
from ufl_beam.display import at_point, compact_repr
from ufl_beam.errors import ModelError, shorten, warn
from ufl_beam.model.bodies import TOGETHER, Member, Place
from ufl_beam.model.checks import (
    require_capacity,
    require_count,
    require_kind,
    require_number,
    require_point,
    require_sequence,
    require_vector,
)
from ufl_beam.model.connector_laws import HingeLaw, require_hinge_law
from ufl_beam.model.functions import Arc, Curve, Point, Polyline, Straight, curve_point
from ufl_beam.model.records import Instance, Record, Text
from ufl_beam.model.sections import Section
from ufl_beam.quadrature import gauss_rule


@dataclass(frozen=True, eq=False, init=False, repr=False)
class Beam(Record, Member):
    """Beam with straight cells along a curve, by default along the line from ``start`` to ``end``.

    Args:
        start: First end; m.
        end: Last end; m.
        section: Cross-section of the beam.
        cells: Number of cells, which are equal intervals of the parameter ``s``.  Attachment
            points, corners and hinges are further vertices, which divide cells.
        name: Name in messages and pictures.
        curve: Axis ``s -> (x, y)`` from ``s = 0`` at the start to ``s = 1`` at the end; m.
        corners: Parameters ``s`` of the corners of the curve.
        hinges: Laws of plastic hinges of zero length, by the parameter ``s`` of each hinge, such as
            ``{0.0: Softening(limit, fracture_energy)}``.  A law is a :class:`SofteningLaw` or
            :class:`ElastoPlastic` (limit in N m, moduli in N m/rad, ``eta`` in N m s).  A hinge is
            rigid until its moment reaches the limit of the law.  At an end of the beam, the law
            replaces ``Section(hinge=)``, and ``None`` removes the hinge of the section.  In space
            hinges are about axis 3 of the section.
        up: In space, a vector in the plane of the axes 1 and 2 of the section: axis 1 is along the
            beam, axis 2 is the part of ``up`` across it, and axis 3 is normal to both.  By default
            ``(0, 0, 1)``.

    Raises:
        ModelError: Zero length, ``up`` along the beam, ``cells < 1``, coordinates that are not
            finite, corners or hinges outside the beam, hinges with a section of fibres, or a curve
            that misses an end.

    Example:
        >>> column = ub.Beam((0, 0), (0, 3), section, cells=6, name="column")
        >>> arch = ub.Beam.arc((0, 0), 5.0, (0, np.pi), section, cells=20, name="arch")
        >>> print(column.end, "and", arch.start)
        column.end (0, 3) and arch.start (5, 0)
    """

    ends: tuple[Point, Point]
    section: Instance[Section]
    cells: Annotated[int, require_count]
    name: Text
    curve: Curve
    corners: Annotated[tuple[float, ...], require_sequence]
    hinges: Annotated[Mapping[float, HingeLaw | None], partial(require_kind, kind=Mapping)]
    up: tuple[float, ...] | None = None

    def __init__(
        self, start: Point, end: Point, section: Section, *, cells: int = 8, name: str = "beam",
        curve: Curve | None = None, corners: Sequence[float] = (),
        hinges: Mapping[float, HingeLaw | None] = {}, up: Sequence[float] | None = None,
    ) -> None:  # fmt: skip
        ends = require_point(start, f"{name}: start"), require_point(end, f"{name}: end")
        if len(ends[0]) != len(ends[1]):
            raise ModelError(
                f"{name}: the start {ends[0]} and the end {ends[1]} must both have two coordinates "
                "in the plane, or three in space"
            )
        if up is None and len(ends[0]) == 3:
            up = 0.0, 0.0, 1.0
        values = (ends, section, cells, name, curve, corners, hinges, up)
        for field, value in zip(fields(self), values, strict=True):
            object.__setattr__(self, field.name, value)
        self.__post_init__()

    def __post_init__(self) -> None:
        super().__post_init__()
        require_capacity(self.cells, f"{self.name}: cells = {self.cells}")
        for s in self.corners:
            require_number(s, f"{self.name}: corner")
            if not 0.0 < s < 1.0:
                raise ModelError(f"{self.name}: corner s = {s:g} must lie between 0 and 1")
        self._require_hinges()
        if self.curve is None:
            first, last = self.ends
            if first == last:
                raise ModelError(f"{self.name}: zero length, both ends are at {first}")
            object.__setattr__(self, "curve", Straight(first, last))
            length = math.dist(first, last)
        else:
            at = sorted({*self.corners, *(i / self.cells for i in range(self.cells + 1))})
            points = [curve_point(self.curve, s, f"{self.name}: curve") for s in at]
            for s, point, end in zip((0, 1), (points[0], points[-1]), self.ends, strict=True):
                size = max(math.hypot(*point), math.hypot(*end))
                if len(point) != len(end) or math.dist(point, end) > 1e-9 * size:
                    raise ModelError(f"{self.name}: curve({s}) = {point} is not the end {end}")
            length = sum(math.dist(p, q) for p, q in pairwise(points))
        self._require_up()
        depth = self.section.depth
        if depth > math.sqrt(12) * length > 0.0:  # the radius of gyration is depth / sqrt(12)
            warn(
                f"{self.name}: its section is {depth:.3g} m deep (sqrt(12 EI/EA) where no depth is "
                f"given), but the beam is only {length:.3g} m long. Are sizes of the section in "
                "mm? Units are SI: m, N, N m². If EI is large on purpose, give the section its "
                "depth"
            )

    def _require_up(self) -> None:
        """Raise :class:`ModelError` unless ``up`` gives each cell its axes."""
        if self.up is None:
            return
        up = require_point(self.up, f"{self.name}: up")
        object.__setattr__(self, "up", up)
        if len(self.ends[0]) == 2 or len(up) == 2:
            raise ModelError(
                f"{self.name}: up = {up} gives axes to sections in space, so that ends of the beam "
                "and up have three coordinates"
            )
        at = self.vertices(())
        ends = [*pairwise(at), *(self._around(place.s) for place in self.hinge_laws)]
        first = np.array([np.subtract(self.curve(b), self.curve(a)) for a, b in ends])
        third, size = np.cross(first, up), np.linalg.norm(first, axis=1)
        sines = np.linalg.norm(third, axis=1)
        if (sines <= 1e-9 * size * math.hypot(*up)).any():
            raise ModelError(
                f"{self.name}: up = {up} is along the beam; give a vector across it, which "
                "becomes axis 2 of the section"
            )
        third /= sines[:, None]
        second = np.cross(third, first / size[:, None])
        cells = slice(len(at) - 1)
        cosines = [np.sum(x[cells][1:] * x[cells][:-1], axis=1) for x in (second, third)]
        for s, twist in zip(at[1:-1], np.add(*cosines), strict=True):
            if twist < 0 and s not in self.corners:
                raise ModelError(
                    f"{self.name}: axis 2 of the section is reversed at s = {s:.3g}, where the "
                    f"beam passes the direction of up = {up}; give an up across the beam "
                    "everywhere, such as the normal of its plane"
                )

    def _around(self, s: float) -> tuple[float, float]:
        """Return the ends of a chord as long as a cell about a place."""
        return max(s - 0.5 / self.cells, 0.0), min(s + 0.5 / self.cells, 1.0)

    def _require_hinges(self) -> None:
        """Raise :class:`ModelError` unless places and laws of the hinges suit the beam."""
        for s, law in self.hinges.items():
            require_number(s, f"{self.name}: hinge at")
            if not 0.0 <= s <= 1.0:
                raise ModelError(f"{self.name}: hinge at s = {s:g} must lie between 0 and 1")
            if law is not None or s not in (0.0, 1.0):
                require_hinge_law(law, f"{self.name}: hinges[{s:g}]")
        for first, second in pairwise(sorted(self.hinges)):
            if (second - first) * self.cells <= TOGETHER:
                raise ModelError(
                    f"{self.name}: two hinges at s = {first:g}; give one, with a law for both"
                )
        if self.hinges and self.section.fibres is not None:
            raise ModelError(
                f"{self.name}: hinges are for resultants; fibres break by Fibres(softening=)"
            )

    def third_axis(self, s: float) -> Point:
        """Return axis 3 of the section at a place in space, for the chord of a cell about it."""
        a, b = (np.array(self.curve(x)) for x in self._around(s))
        normal = np.cross(b - a, np.array(self.up))
        return tuple((normal / np.linalg.norm(normal)).tolist())

    def _label(self) -> str:
        return self.name

    def __repr__(self) -> str:
        a, b = map(at_point, self.ends)
        return f"<Beam {self.name!r}: {a} to {b}, {self.cells} cells>"

    @property
    def hinge_laws(self) -> dict[Place, HingeLaw]:
        """Laws of possible plastic hinges of zero length by place, see :func:`plastic_hinges`."""
        laws: dict[float, HingeLaw | None] = dict.fromkeys((0.0, 1.0), self.section.hinge)
        laws |= {float(s): law for s, law in self.hinges.items()}
        return {self.at(s): law for s, law in laws.items() if law is not None}

    @classmethod
    def arc(
        cls, center: Point, radius: float, angles: tuple[float, float], section: Section, *,
        cells: int = 8, name: str = "beam", hinges: Mapping[float, HingeLaw | None] = {},
    ) -> Beam:  # fmt: skip
        """Create a circular arc (m) between two ``angles`` (rad, counter-clockwise from x)."""
        middle = require_vector(center, f"{name}: center")
        require_number(radius, f"{name}: radius", positive=True)
        first, last = require_vector(angles, f"{name}: angles")
        if first == last:
            raise ModelError(f"{name}: zero length, both angles of the arc are {first:g}")
        curve = Arc(middle, float(radius), first, last)
        ends = curve(0), curve(1)
        return cls(*ends, section, cells=cells, name=name, curve=curve, hinges=hinges)

    @classmethod
    def polyline(
        cls, points: Sequence[Point], section: Section, *,
        cells: int = 8, name: str = "beam", hinges: Mapping[float, HingeLaw | None] = {},
        up: Sequence[float] | None = None,
    ) -> Beam:  # fmt: skip
        """Create a beam of straight pieces through points (m); ``s`` is the fraction of length."""
        points = require_sequence(points, f"{name}: points")
        xy: list[Any] = [require_point(p, f"{name}: point {i}") for i, p in enumerate(points)]
        if len(xy) < 2:
            raise ModelError(f"{name}: a polyline needs at least two points, not {len(xy)}")
        lengths = [math.dist(p, q) for p, q in pairwise(xy)]
        if 0.0 in lengths:
            where = xy[lengths.index(0.0)]
            raise ModelError(f"{name}: zero length between two points at {where}")
        ends = [0.0, *accumulate(lengths)]
        at = tuple(end / ends[-1] for end in ends)
        return cls(
            xy[0], xy[-1], section, cells=cells, name=name, curve=Polyline(tuple(xy), at),
            corners=at[1:-1], hinges=hinges, up=up,
        )  # fmt: skip

    @classmethod
    def along(
        cls, curve: Curve, section: Section, *,
        cells: int = 8, name: str = "beam", hinges: Mapping[float, HingeLaw | None] = {},
        up: Sequence[float] | None = None,
    ) -> Beam:  # fmt: skip
        """Create a beam along any curve ``s -> (x, y)`` (m), with ``s`` from 0 to 1."""
        a, b = (curve_point(curve, s, f"{name}: curve") for s in (0.0, 1.0))
        return cls(a, b, section, cells=cells, name=name, curve=curve, hinges=hinges, up=up)


# -- discretization -----------------------------------------------------------------------------


@dataclass(frozen=True)
class Mesh:
    """Discretization of a scene: number of cells, polynomial degree, lumped mass.

    Args:
        refine: Factor on the number of cells: 3 divides each cell into three, ``Fraction(1, 2)``
            merges two cells into one.  Corners, attachment points and hinges stay vertices.
        degree: Polynomial degree p of displacements and rotations in a cell: 1, 2 or 3.  A cell
            has p Gauss points, at which its laws hold; docs/mesh.md has measured errors.
        lumped: True for a lumped mass matrix of the beams: a diagonal matrix with the row sums of
            the consistent matrix.

    Raises:
        ModelError: An argument has a wrong type or is out of range.

    Example:
        >>> fine = ub.simulate(scene, ub.Static(), t=(0, 1), dt=0.5, mesh=ub.Mesh(refine=4))
        >>> cubic = ub.simulate(scene, ub.Static(), t=(0, 1), dt=0.5, mesh=ub.Mesh(degree=3))
        >>> print(len(fine.shape(beam)), len(cubic.shape(beam)))
        17 5
    """

    refine: int | Fraction = 1
    degree: int = 1
    lumped: bool = False

    __repr__ = compact_repr

    def __post_init__(self) -> None:
        require_kind(self.lumped, bool, "Mesh: lumped")
        if not isinstance(self.refine, Rational) or self.refine <= 0:
            raise ModelError(
                f"Mesh: refine = {shorten(self.refine)} must be a positive whole number or "
                "Fraction(p, q)"
            )
        require_number(self.refine, "Mesh: refine")
        object.__setattr__(self, "refine", Fraction(self.refine))
        if not isinstance(self.degree, Real) or self.degree not in (1, 2, 3):
            raise ModelError(f"Mesh: degree = {shorten(self.degree)} must be 1, 2 or 3")
        object.__setattr__(self, "degree", int(self.degree))

    @cached_property
    def nodes(self) -> Array:
        """Gauss-Lobatto points, the nodes of a cell, ascending from 0 to 1; (p+1,)."""
        inner = np.polynomial.legendre.Legendre.basis(self.degree).deriv().roots()
        return np.array([0.0, *((1 + x) / 2 for x in inner.tolist()), 1.0])

    @property
    def order(self) -> list[int]:
        """Positions along a cell of its nodes: both vertices, then the nodes between."""
        return [0, self.degree, *range(1, self.degree)]

    @property
    def points(self) -> Array:
        """Gauss points of a cell, ascending from 0 to 1; (p,)."""
        return gauss_rule(self.degree)[0]

    @property
    def point_weights(self) -> Array:
        """Weights of the Gauss points of a cell, with the sum 1; (p,)."""
        return gauss_rule(self.degree)[1]

    @cached_property
    def fractions(self) -> Array:
        """Fractions of a cell's mass or uniform load at the nodes of the cell; (p+1,)."""
        p = self.degree
        at = np.polynomial.legendre.Legendre.basis(p)(2 * self.nodes - 1)
        return np.asarray(1 / (p * (p + 1) * at**2))

    @cached_property
    def gauss(self) -> tuple[Array, Array]:
        """Gauss points from 0 to 1 in a cell, (4,), and weights for consistent forces, (4, p+1).

        A row of values at the points times the weights is the mean of the function times each
        Lagrange polynomial.  It is exact for polynomials up to degree 7 - p.
        """
        points, weights = gauss_rule(4)
        return points, weights[:, None] * self.weights(points)

    def weights(self, s: npt.ArrayLike) -> Array:
        """Evaluate the Lagrange polynomials of a cell at ``s``, from 0 to 1; (..., nodes)."""
        powers = np.power.outer(s, np.arange(self.degree + 1))
        return np.asarray(powers @ self.polynomials)

    def slopes(self, s: npt.ArrayLike) -> Array:
        """Evaluate the derivatives of :meth:`weights` with respect to ``s``; (..., nodes)."""
        powers = np.arange(1, self.degree + 1) * np.power.outer(s, np.arange(self.degree))
        return np.asarray(powers @ self.polynomials[1:])

    @cached_property
    def polynomials(self) -> Array:
        """Coefficients of the Lagrange polynomials of a cell, in columns; (p+1, p+1)."""
        return np.asarray(np.linalg.inv(np.vander(self.nodes, increasing=True)))

    def vertices(self, beam: Member, attached: Sequence[float]) -> list[float]:
        """Return the parameters of the vertices of a beam with ``attached`` places, ascending.

        Raises:
            ModelError: The number of cells between two places is not whole, or is too large.
        """
        vertices = beam.vertices(attached)
        if self.refine == 1:
            return vertices
        places = sorted({0.0, 1.0, *beam.corners, *attached})
        places_in_mesh = sorted({int(np.abs(np.subtract(vertices, s)).argmin()) for s in places})
        for first, last in pairwise(places_in_mesh):
            if (last - first) * self.refine % 1:
                common = math.gcd(*(b - a for a, b in pairwise(places_in_mesh)))
                least = f"Fraction(1, {common})" if common > 1 else "1"
                raise ModelError(
                    f"Mesh: refine = {self.refine} makes no whole number of the {last - first} "
                    f"cells between {beam.at(vertices[first])} and {beam.at(vertices[last])}, "
                    f"which must be vertices; {beam.name} can take multiples of {least}"
                )
        number = int((len(vertices) - 1) * self.refine)
        require_capacity(number, f"Mesh: refine = {self.refine} of {beam.name}, {number} cells,")
        at = np.arange(number + 1) * self.refine.denominator / self.refine.numerator
        return [float(s) for s in np.interp(at, np.arange(len(vertices)), vertices)]


DEFAULT_MESH = Mesh()
"""The cells of the beams, of degree 1; one object, because its properties are computed once."""
