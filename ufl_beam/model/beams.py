# SPDX-License-Identifier: MIT
"""Beams: where the undeformed axis runs, and the section along it."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import KW_ONLY, dataclass, field
from itertools import accumulate, pairwise

from ufl_beam.errors import (
    SceneError,
    require_count,
    require_kind,
    require_memory,
    require_number,
    require_sequence,
    require_text,
    require_vector,
    warn,
)
from ufl_beam.model.bodies import TOGETHER, Member, Place
from ufl_beam.model.connector_laws import HingeLaw, require_hinge_law
from ufl_beam.model.curves import Arc, Curve, Point, Polyline, Straight, point_of
from ufl_beam.model.sections import Section


@dataclass(frozen=True, eq=False)
class Beam(Member):
    """Beam with straight cells along a curve, by default along the line from ``a`` to ``b``.

    Args:
        a: First end; m.
        b: Last end; m.
        section: Its cross-section.
        cells: Number of cells, of equal length in the parameter of the curve.  Places that
            something is attached to, and corners, become vertices too.
        name: Name in messages and pictures.
        curve: Axis from ``s = 0`` at ``a`` to ``s = 1`` at ``b``.
        corners: Parameters ``s`` that must be vertices.
        hinges: Plastic hinges of zero length, by their parameter ``s``, which becomes a vertex:
            ``{0.0: Softening(limit, energy)}``.  A hinge is rigid until the moment at ``s`` reaches
            its limit; then it follows its law, :class:`Softening` or :class:`Hardening` (limit in
            N m, moduli in N m/rad, ``eta`` in N m s).  At an end it comes before the law of the
            section; ``None`` there is an end without a hinge.

    Raises:
        SceneError: Zero length, ``cells < 1``, coordinates that are no finite numbers, or hinges in
            a section of fibres.

    Example:
        >>> column = ub.Beam((0, 0), (0, 3), section, cells=6, name="column")
        >>> arch = ub.Beam.arc((0, 0), 5.0, (0, np.pi), section, cells=20, name="arch")
        >>> print(column.end, "and", arch.start)
        column.end (0, 3) and arch.start (5, 0)
    """

    a: Point
    b: Point
    section: Section
    _: KW_ONLY
    cells: int = 8
    name: str = "beam"
    curve: Curve = field(default=None, repr=False)  # type: ignore[assignment]
    corners: tuple[float, ...] = ()
    hinges: Mapping[float, HingeLaw | None] = field(default_factory=dict)

    def __post_init__(self) -> None:
        require_text(self.name, "Beam: name")
        a, b = (require_vector(x, f"{self.name}: end") for x in (self.a, self.b))
        object.__setattr__(self, "a", a)
        object.__setattr__(self, "b", b)
        require_kind(self.section, Section, f"{self.name}: section")
        object.__setattr__(self, "cells", require_count(self.cells, f"{self.name}: cells"))
        require_memory(self.cells, f"{self.name}: cells = {self.cells}")
        straight = self.curve is None
        if straight:
            if a == b:
                raise SceneError(f"{self.name}: zero length, both ends are at {a}")
            object.__setattr__(self, "curve", Straight(a, b))
        else:
            self._require_ends()
        corners = require_sequence(self.corners, f"{self.name}: corners")
        object.__setattr__(self, "corners", corners)
        for s in corners:
            require_number(s, f"{self.name}: corner")
            if not 0.0 < s < 1.0:
                raise SceneError(f"{self.name}: corner s = {s:g} must lie between 0 and 1")
        require_kind(self.hinges, Mapping, f"{self.name}: hinges")
        for s, law in self.hinges.items():
            require_number(s, f"{self.name}: hinge at")
            if not 0.0 <= s <= 1.0:
                raise SceneError(f"{self.name}: hinge at s = {s:g} must lie between 0 and 1")
            if law is not None or s not in (0.0, 1.0):
                require_hinge_law(law, f"{self.name}: hinge at s = {s:g}")
        for first, second in pairwise(sorted(self.hinges)):
            if (second - first) * self.cells <= TOGETHER:
                raise SceneError(
                    f"{self.name}: two hinges at s = {first:g}; give one, with the law of both"
                )
        if self.hinges and self.section.fibres is not None:
            raise SceneError(
                f"{self.name}: hinges are for resultants; here the fibres of the section soften"
            )
        self._warn_of_thickness(math.dist(a, b) if straight else self._length())

    def _require_ends(self) -> None:
        """Raise :class:`SceneError` unless the curve leads from one end to the other."""
        for s, end in ((0.0, self.a), (1.0, self.b)):
            there = point_of(self.curve, s, f"{self.name}: curve")
            if math.dist(there, end) > 1e-9 * max(math.hypot(*there), math.hypot(*end)):
                raise SceneError(f"{self.name}: curve({s:g}) = {there} is not the end {end}")

    def _length(self) -> float:
        """Length of the polygon through the ends of the cells, all of which must be points; m."""
        at = sorted({*self.corners, *(i / self.cells for i in range(self.cells + 1))})
        points = [point_of(self.curve, s, f"{self.name}: curve") for s in at]
        return sum(math.dist(p, q) for p, q in pairwise(points))

    def _warn_of_thickness(self, length: float) -> None:
        """Warn if the radius of gyration of a section is larger than the beam is long."""
        depth = self.section.depth
        if depth > math.sqrt(12) * length > 0.0:
            warn(
                f"{self.name}: its section is {depth:.3g} m deep (sqrt(12 EI/EA) where no depth is "
                f"given), but it is only {length:.3g} m long. Are sizes of the section in mm? "
                "Units are SI: m, N, N m². If EI is large on purpose, give the section its depth"
            )

    def __repr__(self) -> str:
        a, b = (f"({x:g}, {y:g})" for x, y in (self.a, self.b))
        return f"<Beam {self.name!r}: {a} to {b}, {self.cells} cells>"

    @property
    def hinge_laws(self) -> dict[Place, HingeLaw]:
        """Laws of the plastic hinges of zero length that the beam may have, by place."""
        laws: dict[float, HingeLaw | None] = dict.fromkeys((0.0, 1.0), self.section.hinge)
        laws |= {float(s): law for s, law in self.hinges.items()}
        return {self.at(s): law for s, law in laws.items() if law is not None}

    @classmethod
    def arc(
        cls, center: Point, radius: float, angles: tuple[float, float], section: Section, *,
        cells: int = 8, name: str = "beam", hinges: Mapping[float, HingeLaw | None] = {},
    ) -> Beam:  # fmt: skip
        """Circular arc from ``angles[0]`` to ``angles[1]`` (rad, counter-clockwise from x)."""
        middle = require_vector(center, f"{name}: center")
        require_number(radius, f"{name}: radius", positive=True)
        first, last = require_vector(angles, f"{name}: angles")
        if first == last:
            raise SceneError(f"{name}: zero length, both angles of the arc are {first:g}")
        curve = Arc(middle, float(radius), first, last)
        ends = curve(0), curve(1)
        return cls(*ends, section, cells=cells, name=name, curve=curve, hinges=hinges)

    @classmethod
    def polyline(
        cls, points: Sequence[Point], section: Section, *,
        cells: int = 8, name: str = "beam", hinges: Mapping[float, HingeLaw | None] = {},
    ) -> Beam:  # fmt: skip
        """Straight pieces through ``points``, rigidly joined; ``s`` is the part of the length."""
        points = require_sequence(points, f"{name}: points")
        xy = [require_vector(p, f"{name}: point {i}") for i, p in enumerate(points)]
        if len(xy) < 2:
            raise SceneError(f"{name}: a polyline needs at least two points, not {len(xy)}")
        lengths = [math.dist(p, q) for p, q in pairwise(xy)]
        if 0.0 in lengths:
            where = xy[lengths.index(0.0)]
            raise SceneError(f"{name}: zero length between two points at {where}")
        ends = [0.0, *accumulate(lengths)]
        at = tuple(end / ends[-1] for end in ends)
        return cls(
            xy[0], xy[-1], section, cells=cells, name=name, curve=Polyline(tuple(xy), at),
            corners=at[1:-1], hinges=hinges,
        )  # fmt: skip

    @classmethod
    def along(
        cls, curve: Curve, section: Section, *,
        cells: int = 8, name: str = "beam", hinges: Mapping[float, HingeLaw | None] = {},
    ) -> Beam:  # fmt: skip
        """Any curve ``s -> (x, y)``, ``s`` from 0 to 1; m."""
        a, b = (point_of(curve, s, f"{name}: curve") for s in (0.0, 1.0))
        return cls(a, b, section, cells=cells, name=name, curve=curve, hinges=hinges)
