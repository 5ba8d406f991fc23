# SPDX-License-Identifier: MIT
"""Material points of a cross-section: resultants or fibres; distributions of yield stresses."""

from __future__ import annotations

import math
import struct
from collections import Counter
from collections.abc import Iterable, Sequence
from dataclasses import KW_ONLY, dataclass, replace
from functools import cached_property
from typing import Annotated, NamedTuple
from zlib import crc32

import numpy as np

from ufl_beam.arrays import Array, Index
from ufl_beam.errors import ModelError
from ufl_beam.model import plausibility
from ufl_beam.model.checks import require_count, require_kind, require_number
from ufl_beam.model.functions import Point
from ufl_beam.model.law_functions import Values
from ufl_beam.model.material_law import MaterialLaw, require_law, uniform
from ufl_beam.model.records import Record
from ufl_beam.model.shapes import Shape
from ufl_beam.model.softening_laws import SofteningLaw, require_softening


class Kind(NamedTuple):
    """A law with all parameters equal to 1, and the names of the parameters."""

    law: MaterialLaw
    parameters: tuple[str, ...]


@dataclass(frozen=True, eq=False)
class SectionPoints:
    """Material points of a cross-section with laws of one class: strains, weights and laws.

    A section with laws of several classes has one object for each class.  The resultants of the
    section are sums over all points of weight times stress times ``strains``, plus ``rest`` times
    the strains of the section.
    """

    strains: Values  # derivatives by (Σ, Γ, K), (n, 3), or in space by six strains, (n, 6)
    weights: Values  # areas of fibres, or 1 for resultants; (n,), (1,) with interaction
    stiffness: Values  # elastic stiffness, also of each interacting resultant; (n,)
    laws: tuple[tuple[MaterialLaw, int], ...]  # (law, number of successive points)
    rest: Values  # stiffnesses of resultants that have no points, otherwise 0; (3,), (6,)
    softening: SofteningLaw | None = None  # law of hinge or cracks, if points can break
    breaking: slice = slice(None)  # points that can break
    hinges: bool = False  # True if the breaking point is a hinge, with a jump of rotation
    number: int = 0  # number of this object in its section
    at: Sequence[int] | Index = (0,)  # indices of the points in the section; (n,)

    def __post_init__(self) -> None:
        if fault := self.fault(0.0):
            raise ModelError(fault)

    @property
    def elastic(self) -> bool:
        """True if the points neither yield nor break."""
        return self.softening is None and not self.yields

    @property
    def yields(self) -> bool:
        """True if the law of any point can yield."""
        return any(not law.elastic for law, _ in self.laws)

    def fault(self, length: float) -> str:
        """Return the first error of the laws in a cell of a length, or empty; m, 0 if unknown."""
        stiffness, first = np.reshape(self.stiffness, (len(self.weights), -1)), 0
        for law, n in self.laws:
            for C in np.unique(stiffness[first : first + n], axis=0):
                if fault := law.fault(law.as_argument(tuple(C.tolist())), length):
                    return f"{type(law).__name__}: {fault}"
            first += n
        return ""

    @cached_property
    def kind(self) -> Kind:
        """Law of all points, without the parameters, which differ between points."""
        law = next((law for law, _ in self.laws if not law.elastic), self.laws[0][0])
        names = tuple(law.parameters(uniform(law, np.ones(()))))
        return Kind(law.with_parameters(1.0, dict.fromkeys(names, 1.0)), names)

    def parameters(self, keys: Sequence[tuple[int, ...]]) -> dict[str, Values]:
        """Return the parameters of the laws at the points of cells by name, each (cells, n).

        Random values depend on the ``keys`` of the cells and the seed of a distribution.
        """
        shape, first = (len(keys), len(self.weights)), 0
        columns = {name: np.zeros(shape) for name in self.kind.parameters}
        stiffness = np.reshape(self.stiffness, (len(self.weights), -1))
        for law, n in self.laws:
            at = slice(first, first + n)
            C = law.as_argument(tuple(stiffness[at].T))
            for name, value in law.parameters(C).items():
                drawn = hasattr(value, "draw")
                columns[name][:, at] = [value.draw(n, k) for k in keys] if drawn else value
            first += n
        return columns


def by_class(points: Sequence[SectionPoints], rest: Array) -> tuple[SectionPoints, ...]:
    """Join points, each with one law, that C can compute together; the first get ``rest``.

    Their laws are of one class, and at most one softening law is among them.  Points without a
    softening law come first.
    """
    yielding = {type(p.laws[0][0]): p.kind for p in points if p.yields}
    groups = list[tuple[Kind, list[SectionPoints]]]()
    for p in sorted(points, key=lambda p: p.softening is not None):
        # Elastic points join others of their class, whose equations hold for them, too.
        kind = p.kind if p.yields else yielding.get(type(p.laws[0][0]), p.kind)
        alike = (g for k, g in groups if k == kind and g[-1].softening in (None, p.softening))
        if (group := next(alike, None)) is None:
            groups.append((kind, group := []))
        group.append(p)
    return tuple(
        SectionPoints(
            **{
                name: np.concatenate([getattr(p, name) for p in group])
                for name in ("strains", "weights", "stiffness", "at")
            },
            laws=tuple(law for p in group for law in p.laws),
            rest=rest if number == 0 else 0 * rest,
            softening=group[-1].softening,
            breaking=slice(sum(len(p.weights) for p in group if p.softening is None), None),
            hinges=group[-1].hinges,
            number=number,
        )
        for number, (_, group) in enumerate(groups)
    )


@dataclass(frozen=True, repr=False)
class Fibres(Record):
    """Material law and number of the fibres of a section, P(93).

    Args:
        law: Law of each fibre; stresses in Pa.  A random limit is drawn for each fibre of each
            cell.
        number: Number of layers of equal thickness, at least 2; not for :meth:`Section.of_fibres`.
        softening: Law of the crack that opens in a fibre if the stress reaches the limit of this
            law; limit in Pa, energy in J/m².

    Raises:
        ModelError: A law has the wrong type, or ``number`` is not a positive whole number; when a
            section is created: ``number`` is 1.

    Example:
        >>> steel = ub.Fibres(ub.ElastoPlastic(355e6, isotropic=2e9), number=16)
        >>> layered = ub.Section.rectangle(b=0.1, h=0.2, E=210e9, nu=0.3, fibres=steel)
        >>> print(f"{layered.EI:.3g}")  # of 16 layers; N m²
        1.39e+07
    """

    law: Annotated[MaterialLaw, require_law]
    _: KW_ONLY
    number: Annotated[int, require_count] = 20
    softening: Annotated[SofteningLaw | None, require_softening] = None


@dataclass(frozen=True, eq=False)
class PlacedFibres:
    """Fibres of one or several materials, with their positions and areas in a section."""

    fibres: tuple[Fibres, ...]  # laws of the materials
    material: Index  # index in ``fibres`` of the material of each fibre; (n,)
    E: Array  # Young's moduli; (n,); Pa
    y: Array  # distances from the axis, positive to the left of its direction; (n,); m
    A: Array  # areas; (n,); m²
    axis: float  # coordinate y of the axis as the user measures it; m
    ends: tuple[float, float]  # least and largest y of the section as the user measures it; m
    bars: int = 0  # number of bars, which are the first fibres
    core: Shape | None = None  # shape of the core
    z: Array | None = None  # in space, distances from the axis along axis 3; (n,); m

    def __repr__(self) -> str:
        return f"<{len(self.y)} fibres of {', '.join(type(f.law).__name__ for f in self.fibres)}>"

    @classmethod
    def about_centroid(
        cls, fibres: tuple[Fibres, ...], material: Index, E: Array, y: Array, A: Array,
        ends: tuple[float, float] | None = None, z: Array | None = None,
    ) -> PlacedFibres:  # fmt: skip
        """Create fibres at ``y`` (m), with the axis through the centroid of their stiffness EA."""
        axis = float((E * A) @ y / (E @ A))
        ends = ends or (float(y.min()), float(y.max()))
        if z is not None:
            z = z - (E * A) @ z / (E @ A)
        return cls(fibres, material, E, y - axis, A, axis, ends, z=z)

    @classmethod
    def layers(
        cls, fibres: Fibres | None, E: float, shape: Shape, core: Fibres | None, cover: float
    ) -> PlacedFibres | None:
        """Create layers of equal thickness over the depth of a shape, with cuts at its corners.

        With ``core``, the part of a layer farther than ``cover`` (m) from the surface is a fibre of
        its own.
        """
        require_kind(fibres, (Fibres, type(None)), "Section: fibres")
        require_kind(core, (Fibres, type(None)), "Section: core")
        require_number(cover, "Section: cover", at_least=0.0)
        if (core is None) != (cover == 0.0):
            raise ModelError(
                "Section: cover without core; give the law of the core, too" if core is None else
                "Section: core without cover; give the distance of the core from the surface, too"
            )  # fmt: skip
        if fibres is None:
            if core is not None:
                raise ModelError("Section: core without fibres; give the law of the cover, too")
            return None
        for law in (each.law for each in (fibres, core) if each is not None):
            limit = getattr(law, "yield_limit", math.inf)
            if isinstance(limit, float) and 0.0 < limit < math.inf:
                plausibility.check("Section: fibres", "yield strain", limit / E)
            strain, strength = (getattr(law, x, None) for x in ("strain", "strength"))
            if isinstance(strain, float) and isinstance(strength, float):  # of Mander
                ratio = strain * E / strength
                plausibility.check("Section: fibres", "strain over strength / E", ratio)
        if fibres.number < 2:
            raise ModelError("Fibres: number = 1 has no bending stiffness; use 2 or more")
        low, high, shapes = shape.bottom, shape.top, [shape]
        if core is not None:
            try:
                shapes.append(shape.inset(cover))
            except ModelError as error:
                raise ModelError(f"Section: cover = {cover} m leaves no core: {error}") from None
        corners = [
            y - shape.y for x in shapes for loop in (x.corners, *x.holes) for _, y, *_ in loop
        ]
        cuts = np.union1d(np.linspace(low, high, fibres.number + 1), np.clip(corners, low, high))
        cuts = cuts[np.insert(np.diff(cuts) > 1e-9 * (high - low), 0, True)]
        layers, laws = np.diff(shape.below(cuts))[:2], [fibres]
        material: Index = np.zeros(layers.shape[1], dtype=np.int64)
        if core is not None:
            shift = shapes[1].y - shape.y
            within = np.diff(shapes[1].below(cuts - shift))[:2]
            within[1] += shift * within[0]
            inside = within[0] > 1e-9 * layers[0]
            layers, laws = np.hstack([layers - within, within[:, inside]]), [fibres, core]
            material = np.repeat([0, 1], [len(inside), inside.sum()])
        A, S = layers
        ends = low + shape.y, high + shape.y
        within_cover = shapes[1] if core is not None else None
        return cls(
            tuple(laws), material, np.full(len(A), E), S / A, A, shape.y, ends, core=within_cover
        )

    def with_bars(self, bars: Fibres, E: float, y: Array, A: Array) -> PlacedFibres:
        """Add bars of areas ``A`` (m²) at ``y`` (m) instead of other fibres, those of a core first.

        Each bar displaces the nearest fibres of the last material that reaches to it.
        """
        at, areas, (low, high) = self.y + self.axis, self.A.copy(), self.ends
        for bar, area in zip(y, A, strict=True):
            if not low <= bar <= high:
                raise ModelError(
                    f"Section.reinforced: a bar at y = {bar:g} m lies outside the section, from "
                    f"{low:g} to {high:g} m"
                )
            # Materials of earlier bars come first, the core last.
            for number in reversed(range(len(self.fibres))):
                rows = np.flatnonzero(self.material == number)
                gap = float(np.diff(np.unique(at[rows])).max(initial=0.0))
                if at[rows].min() - gap / 2 <= bar <= at[rows].max() + gap / 2:
                    break
            width, away = gap or 1.0, at[rows] - bar
            removed = np.full(len(rows), math.inf)
            while not ((removed >= 0) & (removed < areas[rows])).all():
                if width > 2 * (high - low + gap):
                    raise ModelError(
                        f"Section.reinforced: bars of A = {area:g} m² at y = {bar:g} m displace "
                        "more than the fibres of the section there"
                    )
                # Near fibres lose the area, if possible with its centroid at the bar.
                nearby = areas[rows] * np.maximum(1 - np.abs(away) / width, 0.0)
                removed, width = nearby * (area / nearby.sum()), 2 * width
                if away[nearby > 0].min() < 0 < away[nearby > 0].max():
                    m0, m1, m2 = nearby.sum(), nearby @ away, nearby @ away**2
                    removed = nearby * area * (m2 - m1 * away) / (m0 * m2 - m1**2)
            areas[rows] -= removed
        material = np.concatenate([np.zeros(len(y), dtype=np.int64), self.material + 1])
        moduli = np.concatenate([np.full(len(y), E), self.E])
        number = self.bars + len(y)
        y, A = np.concatenate([y, at]), np.concatenate([A, areas])
        placed = self.about_centroid((bars, *self.fibres), material, moduli, y, A, self.ends)
        return replace(placed, bars=number, core=self.core)

    @property
    def EA(self) -> float:
        """Axial stiffness EA; N."""
        return float(self.E @ self.A)

    @property
    def EI(self) -> float:
        """Bending stiffness; N m²."""
        return float(self.E * self.A @ self.y**2)

    def section_points(self, *elastic: float) -> tuple[SectionPoints, ...]:
        """Return one material point for each fibre, with elastic stiffnesses besides.

        They are GA (N), or in space GA, GA3 (N) and GJ (N m²).  The latest result is kept.
        """
        if (known := vars(self).get("_latest")) is not None and known[0] == elastic:
            return known[1]  # type: ignore[no-any-return]
        points, others = [], np.zeros((len(self.y), len(elastic)))
        across = [] if len(elastic) == 1 else [np.asarray(self.z)]
        strains = np.column_stack([np.ones(len(self.y)), others, *across, -self.y])
        for number, (law, softening) in enumerate((f.law, f.softening) for f in self.fibres):
            at = np.flatnonzero(self.material == number)
            points.append(
                SectionPoints(
                    strains=strains[at],
                    weights=self.A[at],
                    stiffness=self.E[at],
                    laws=((law, len(at)),),
                    rest=np.zeros(strains.shape[1]),
                    softening=softening if softening is not None and softening.opens else None,
                    at=at,
                )
            )
        made = by_class(points, np.array([0.0, *elastic, *[0.0] * len(across), 0.0]))
        object.__setattr__(self, "_latest", (elastic, made))
        return made


# -- distributions of yield stresses ------------------------------------------------------------


def stream_keys(segments: Iterable[tuple[Point, Point]]) -> list[tuple[int, int]]:
    """Return a key for each pair of points: a checksum, and the number of earlier equal pairs."""
    seen: Counter[int] = Counter()
    keys = []
    for a, b in segments:
        checksum = crc32(struct.pack(f"{2 * len(a)}d", *a, *b))
        keys.append((checksum, seen[checksum]))
        seen[checksum] += 1
    return keys
