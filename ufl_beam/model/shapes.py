# SPDX-License-Identifier: MIT
"""Shapes of cross-sections: polygons with rounded corners, their integrals and outlines.

Units are SI: m, m², m³, m⁴.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property, lru_cache
from itertools import chain, pairwise
from typing import Annotated

import numpy as np
import scipy  # its parts are loaded when they are used

from ufl_beam.arrays import Array, Complex
from ufl_beam.errors import ModelError
from ufl_beam.model.checks import require_array, require_sequence
from ufl_beam.model.records import Record

Loop = tuple[tuple[float, float, float], ...]
"""Corners (x, y, radius) of a closed polygon before they are rounded; m."""

Piece = tuple[complex, complex, complex, float, float, float]
"""Start and end of a straight line, and zeros; or zeros, centre, radius and angles of an arc; m."""

NODES, WEIGHTS = np.polynomial.legendre.leggauss(24)
"""Gauss points between two corners: round-off for circles, the least smooth shapes."""


def _require_loop(corners: object, what: str) -> Loop:
    loop = []
    for i, corner in enumerate(require_sequence(corners, what)):
        row = require_array(corner, f"{what}[{i}]")
        if row.shape not in ((2,), (3,)) or (row[2:] < 0).any():
            raise ModelError(f"{what}[{i}] = {corner} must be (x, y) or (x, y, radius), in m")
        loop.append((float(row[0]), float(row[1]), float(row[2]) if len(row) > 2 else 0.0))
    if len(loop) < 3:
        raise ModelError(f"{what} has {len(loop)} corners; a polygon has 3 or more")
    return tuple(loop)


def _require_loops(loops: object, what: str) -> tuple[Loop, ...]:
    return tuple(
        _require_loop(loop, f"{what}[{i}]") for i, loop in enumerate(require_sequence(loops, what))
    )


@dataclass(frozen=True, repr=False)
class Shape(Record):
    """Shape of a homogeneous cross-section: a polygon with rounded corners and holes.

    The section bends in the plane of y; in a beam, y points to the left of its direction.

    Args:
        corners: Corners (x, y) or (x, y, radius), one after the other in either direction; m.  The
            radius cuts a convex corner, and fills a reentrant corner by a fillet.
        holes: Polygons of holes, each a list of corners; m.

    Attributes:
        A: Area; m².
        y: Coordinate y of the centroid; m.
        I: Second moment of area about the centroid; m⁴.
        I2: Second moment of area about the axis of y, for bending out of the plane; m⁴.
        Wel: Elastic section modulus, I over the largest distance from the centroid; m³.
        Wpl: Plastic section modulus, the plastic moment without axial force over the yield stress;
            m³.

    Raises:
        ModelError: A polygon has less than 3 corners, a radius does not fit between two corners,
            lines cross each other, or a hole is outside of the shape.

    Example:
        >>> girder = st.Shape(  # welded, with a wide flange below
        ...     [(-0.2, 0), (0.2, 0), (0.2, 0.03), (0.006, 0.03), (0.006, 0.6), (0.15, 0.6),
        ...      (0.15, 0.62), (-0.15, 0.62), (-0.15, 0.6), (-0.006, 0.6), (-0.006, 0.03),
        ...      (-0.2, 0.03)]
        ... )
        >>> print(f"{girder.A:.5f} m², centroid at {girder.y:.4f} m, {girder.Wpl:.3e} m³")
        0.02484 m², centroid at 0.2413 m, 5.595e-03 m³
        >>> steel = dict(E=210e9, nu=0.3, rho=7850.0)
        >>> section = ub.Section.of_shape(girder, shear_factor=0.012 * 0.6 / girder.A, **steel)
    """

    corners: Annotated[Sequence[Sequence[float]], _require_loop]
    holes: Annotated[Sequence[Sequence[Sequence[float]]], _require_loops] = ()

    def __post_init__(self) -> None:
        super().__post_init__()
        y, _, _, signs = self._strips
        lines = np.arange(len(signs))[:, None]
        # Lines from left to right enter and leave the area in turn.
        crossed = ((signs != 0) & (signs != 2 * (lines % 2) - 1)).any(axis=0)
        if crossed.any():
            raise ModelError(
                f"Shape: lines cross near y = {y[crossed.argmax()] + self.y:.4g} m; a polygon must "
                "not cross itself, and holes must lie inside, apart from each other"
            )

    def __repr__(self) -> str:
        x = np.array(self.corners)[:, 0]
        return f"<shape of {np.ptp(x):.6g} m x {self.top - self.bottom:.6g} m>"

    def turned(self) -> Shape:
        """Return the shape turned by 90° counterclockwise; its y was x before."""
        corners, *holes = [[(-y, x, r) for x, y, r in loop] for loop in (self.corners, *self.holes)]
        return Shape(corners, holes)

    def inset(self, distance: float) -> Shape:
        """Return the shape of the points farther than a distance (m) from the outline and holes.

        Raises:
            ModelError: The distance is so large that sides of a polygon vanish.
        """
        loops = []
        for loop in self._loops:
            x, y, radii = np.transpose(loop)
            z = x + 1j * y
            ahead = np.roll(z, -1) - z
            ahead /= np.abs(ahead)
            rotation = ahead / np.roll(ahead, 1)
            z += distance * 1j * (np.roll(ahead, 1) + ahead) / (1 + rotation.real)
            radii = np.maximum(radii - distance * np.sign(rotation.imag), 0.0)
            if not (((np.roll(z, -1) - z) / ahead).real > 0).all():
                raise ModelError(f"Shape.inset: sides vanish at {distance:g} m from {self!r}")
            loops.append([(w.real, w.imag, r) for w, r in zip(z, radii, strict=True)])
        return Shape(loops[0], loops[1:])

    def outlines(self) -> list[Complex]:
        """Return the outline and holes as closed polygons x + iy, m, with arcs as chords."""
        loops = []
        for loop in self._pieces:
            points = [
                centre + r * np.exp(1j * np.linspace(first, last, 24, endpoint=False))
                if r
                else np.array([start])
                for start, _, centre, r, first, last in loop
            ]
            loops.append(np.concatenate([*points, points[0][:1]]))
        return loops

    # -- integrals -----------------------------------------------------------------------------

    @cached_property
    def _loops(self) -> list[Sequence[Sequence[float]]]:
        """Corners of the outline, counterclockwise, and of holes, clockwise."""
        loops: list[Sequence[Sequence[float]]] = []
        for loop in (self.corners, *self.holes):
            x, y, _ = np.transpose(loop)
            clockwise = float(np.roll(x, 1) @ y - np.roll(y, 1) @ x) < 0
            loops.append(loop if clockwise == bool(loops) else loop[::-1])
        return loops

    @cached_property
    def _pieces(self) -> list[list[Piece]]:
        """Lines and arcs of the outline, counterclockwise, and of holes, clockwise."""
        return [_pieces(loop) for loop in self._loops]

    @cached_property
    def _lines(self) -> tuple[Array, float]:
        """Lines x = p + q u + s √(r² - u²), u = y - c, from y0 to y1, and y of the centroid.

        The rows are p, q, s, r, c, y0, y1, with c, y0 and y1 measured from the centroid.
        """
        rows = []
        for start, end, middle, r, first, last in chain.from_iterable(self._pieces):
            if r:
                side, c = math.copysign(1, math.cos((first + last) / 2)), middle.imag
                y0, y1 = c + r * math.sin(first), c + r * math.sin(last)
                rows.append((middle.real, 0.0, side, r, c, y0, y1))
            elif start.imag != end.imag:
                slope = (end.real - start.real) / (end.imag - start.imag)
                rows.append((start.real, slope, 0.0, 0.0, start.imag, start.imag, end.imag))
        lines, centre = np.reshape(rows, (-1, 7)).T.copy(), 0.0
        for _ in range(2):  # the second time against round-off of a distant origin
            self.__dict__["_lines"] = lines, centre
            A, S, _ = self.below(np.array([np.inf]))[:, 0]
            if not A > 0:
                raise ModelError("Shape: it has no area, or its holes are larger than it")
            lines[4:] -= S / A
            centre += float(S / A)
        return lines, centre

    def below(self, y: Array) -> Array:
        """Return the area below y, m, from the centroid, and its moments; (3, n); m², m³, m⁴.

        By Green's theorem the moments are integrals of y^k x dy along the boundary.
        """
        p, q, s, r, c, y0, y1 = self._lines[0][..., None]
        total = np.zeros((3, len(y)))
        for sign, end in ((1, np.maximum(y0, y1)), (-1, np.minimum(y0, y1))):
            u = (np.clip(y, np.minimum(y0, y1), np.maximum(y0, y1)) if sign > 0 else end) - c
            w = np.sqrt(np.maximum((r - u) * (r + u), 0.0))
            angle = r**2 * np.arctan2(u, w)
            J0 = p * u + q * u**2 / 2 + s * (u * w + angle) / 2
            J1 = p * u**2 / 2 + q * u**3 / 3 - s * w**3 / 3
            J2 = p * u**3 / 3 + q * u**4 / 4 + s * (u * w * (2 * u**2 - r**2) + r**2 * angle) / 8
            up = sign * np.sign(y1 - y0)
            moments = J0, c * J0 + J1, c**2 * J0 + 2 * c * J1 + J2
            total += [(up * J).sum(axis=0) for J in moments]
        return total

    @cached_property
    def edges(self) -> Array:
        """Ascending y of corners and ends of arcs, from the centroid; m."""
        y = np.unique(self._lines[0][5:])
        return y[np.insert(np.diff(y) > 1e-9 * np.ptp(y), 0, True)]

    @property
    def bottom(self) -> float:
        """Lowest y, from the centroid; m."""
        return float(self.edges[0])

    @property
    def top(self) -> float:
        """Highest y, from the centroid; m."""
        return float(self.edges[-1])

    @cached_property
    def _strips(self) -> tuple[Array, Array, Array, Array]:
        """Gauss points y and weights; from left to right x and direction of the lines at y.

        The directions are 1 for upward and -1 for downward lines, or 0 beyond the last line.
        Between two edges y is a cosine, which makes widths of circles smooth.
        """
        angle = np.pi / 2 * (NODES + 1)
        half = np.diff(self.edges)[:, None] / 2
        y = (self.edges[:-1, None] + half * (1 - np.cos(angle))).ravel()
        weight = (half * np.pi / 2 * WEIGHTS * np.sin(angle)).ravel()
        p, q, s, r, c, y0, y1 = self._lines[0][..., None]
        u = y - c
        inside = (np.minimum(y0, y1) < y) & (y < np.maximum(y0, y1))
        x = p + q * u + s * np.sqrt(np.maximum((r - u) * (r + u), 0.0))
        x, signs = np.where(inside, x, np.inf), np.where(inside, np.sign(y1 - y0), 0)
        order = np.argsort(x, axis=0, kind="stable")
        x, signs = (np.take_along_axis(a, order, axis=0) for a in (x, signs))
        return y, weight, np.where(signs == 0, 0.0, x), signs

    @property
    def y(self) -> float:
        """Coordinate y of the centroid; m."""
        return self._lines[1]

    @cached_property
    def _moments(self) -> tuple[float, float]:
        A, _, I = self.below(np.array([np.inf]))[:, 0]
        return float(A), float(I)

    @property
    def A(self) -> float:
        """Area within the outline, without holes; m²."""
        return self._moments[0]

    @property
    def I(self) -> float:  # noqa: E743 - the letter of mechanics
        """Second moment of area; m⁴."""
        return self._moments[1]

    @cached_property
    def I2(self) -> float:
        """Second moment of area about the axis of y through the centroid; m⁴."""
        _, weights, x, signs = self._strips
        S, I2 = (float(weights @ (signs * x**k).sum(axis=0)) / k for k in (2, 3))
        return I2 - S**2 / self.A

    @property
    def Wel(self) -> float:
        """Elastic section modulus; m³."""
        return self.I / max(self.top, -self.bottom)

    @cached_property
    def Wpl(self) -> float:
        """Plastic section modulus; m³."""
        halving = scipy.optimize.brentq(
            lambda y: self.below(np.array([y]))[0, 0] - self.A / 2, self.bottom, self.top,
            xtol=1e-15 * (self.top - self.bottom),
        )  # fmt: skip
        return float(-2 * self.below(np.array([halving]))[1, 0])

    @cached_property
    def obliquity(self) -> float:
        """Product of inertia ∫ x y dA, divided by the second moment ∫ y² dA."""
        y, weights, x, signs = self._strips
        return float(weights @ (y * (signs * x**2).sum(axis=0)) / 2 / self.I)

    # -- torsion -------------------------------------------------------------------------------

    @property
    def is_open(self) -> bool:
        """True for a shape without holes that is not convex, such as an I, a C or a T."""
        x, y, _ = np.transpose(self._loops[0])
        sides = np.roll(x + 1j * y, -1) - (x + 1j * y)
        turns = (np.roll(sides, 1).conj() * sides).imag
        return not self.holes and bool(turns.min() < -1e-9 * turns.max())

    @property
    def is_point_symmetric(self) -> bool:
        """True if half a turn maps the shape onto itself; its shear centre is then its centroid."""
        corners = np.array([corner for loop in self._loops for corner in loop])
        centre = np.append(corners[:, :2].mean(axis=0), 0.0)
        turned = corners * (-1.0, -1.0, 1.0) + 2 * centre
        apart = np.abs(corners[:, None] - turned).max(axis=2).min(axis=1)
        return bool((apart < 1e-9 * np.ptp(corners[:, :2])).all())


def _pieces(loop: Sequence[Sequence[float]]) -> list[Piece]:
    """Return the arcs and straight lines of a loop; no arc passes the top or bottom of a circle."""
    x, y, radii = np.transpose(loop)
    z = x + 1j * y
    lengths = np.abs(np.roll(z, -1) - z)
    with np.errstate(divide="ignore", invalid="ignore"):
        ahead = (np.roll(z, -1) - z) / lengths
        deflections = np.angle(ahead / np.roll(ahead, 1))  # to the left if positive
        cut = np.where(radii > 0, radii * np.tan(np.abs(deflections) / 2), 0.0)
    fits = cut + np.roll(cut, -1) <= lengths * (1 + 1e-9)
    if not fits.all():
        i = int(np.argmin(fits))
        j = (i + 1) % len(loop)
        raise ModelError(
            f"Shape: the radii {radii[i]:g} and {radii[j]:g} m do not fit between the corners "
            f"{loop[i][:2]} and {loop[j][:2]}"
        )
    pieces = []
    for i, r in enumerate(radii):
        if cut[i] > 0:
            left = 1j * np.sign(deflections[i])
            centre = z[i] - cut[i] * ahead[i - 1] + r * left * ahead[i - 1]
            first = float(np.angle(-left * ahead[i - 1]))
            last = first + float(deflections[i])
            low, high = sorted((first, last))
            tops = np.pi * (np.arange(math.ceil(low / np.pi - 0.5), high / np.pi - 0.5 + 1) + 0.5)
            tops = tops[(tops > low + 1e-9) & (tops < high - 1e-9)]
            angles = sorted([first, *tops, last], reverse=last < first)
            pieces += [(0j, 0j, centre, r, a, b) for a, b in pairwise(angles)]
        j = (i + 1) % len(loop)
        if lengths[i] > (cut[i] + cut[j]) * (1 + 1e-9):
            start, end = z[i] + cut[i] * ahead[i], z[j] - cut[j] * ahead[i]
            pieces.append((start, end, 0j, 0.0, 0.0, 0.0))
    return pieces


# -- shapes of rolled and welded steel ----------------------------------------------------------


@lru_cache(maxsize=256)
def rounded_rectangle(b: float, h: float, r: float, t: float = 0.0) -> Shape:
    """Create a rectangle with corners of radius ``r``, and with a hole if ``t`` is a wall; m."""

    def corners(b: float, h: float, r: float) -> list[tuple[float, float, float]]:
        return [(x * b / 2, y * h / 2, r) for x, y in ((-1, -1), (1, -1), (1, 1), (-1, 1))]

    hollow = 0.0 < 2 * t < min(b, h)
    return Shape(corners(b, h, r), [corners(b - 2 * t, h - 2 * t, max(r - t, 0))] if hollow else ())
