# SPDX-License-Identifier: MIT
"""Material points of a cross-section: its resultants, or fibres across its depth."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import KW_ONLY, dataclass
from functools import cached_property
from typing import Annotated, NamedTuple

import numpy as np

from ufl_beam.arrays import Array
from ufl_beam.display import one_line
from ufl_beam.errors import SceneError, require_array, require_count, require_kind
from ufl_beam.model.law_functions import Values
from ufl_beam.model.material_law import MaterialLaw, require_bulk_law
from ufl_beam.model.records import Record
from ufl_beam.model.softening_laws import SofteningLaw, require_softening

Below = Callable[[Array], Array]
"""Area of a shape below y, from any line, and its first moment about y = 0; (2, n); m², m³."""


class Kind(NamedTuple):
    """A law whose numbers do not matter, and their names."""

    law: MaterialLaw
    numbers: tuple[str, ...]

    @classmethod
    def of_law(cls, law: MaterialLaw) -> Kind:
        """The kind of a law."""
        C = tuple(np.ones(()) for _ in law.resultants or "x")
        names = tuple(law.numbers(law.as_argument(C)))
        return cls(law.of(1.0, dict.fromkeys(names, 1.0)), names)


@dataclass(frozen=True, eq=False)
class Layout:
    """Material points of a cross-section, with their strains, weights and laws.

    The resultants of the section are the sums of weight times stress times ``strains``.
    """

    strains: Values  # of each point per strain (Σ, Γ, K) of the section; (n, 3)
    weights: Values  # area of fibres, 1 for resultants; (n,)
    stiffness: Values  # elastic; (n,); of interacting resultants, strains and stiffness have rows
    laws: tuple[tuple[MaterialLaw, int], ...]  # with the number of points in a row that follow them
    rest: Values  # stiffness (axial, shear, bending) of what has no points; (3,)
    softening: SofteningLaw | None  # law of the discontinuities, if points can break
    breaking: slice  # the points that can
    hinges: bool = False  # True if the discontinuity is one hinge, a jump of rotation

    def __post_init__(self) -> None:
        _ = self.kind  # refuses laws of several kinds

    @property
    def elastic(self) -> bool:
        """True if nothing can happen at the points."""
        return self.softening is None and not self.yields

    @property
    def yields(self) -> bool:
        """True if the bulk can yield."""
        return any(not law.elastic for law, _ in self.laws)

    @cached_property
    def kind(self) -> Kind:
        """The law of one kind that points of the bulk follow, with numbers of their own."""
        laws = [law for law, _ in self.laws if not law.elastic] or [self.laws[0][0]]
        kinds = {Kind.of_law(law): law for law in laws}
        if len(kinds) > 1:
            different = " and ".join(map(repr, kinds.values()))
            raise SceneError(f"Section: its laws must be of one class, not {different}")
        kind = next(iter(kinds))
        for law, _ in self.laws:
            if type(law) is not type(kind.law):
                raise SceneError(
                    f"Section: beside {type(kind.law).__name__}, a resultant that yields or hinges "
                    "needs a law of the same kind, with numbers at which it stays elastic"
                )
        return kind

    def numbers(self, keys: list[tuple[int, int]]) -> dict[str, Values]:
        """Numbers of the laws at the points of many cells, each (cells, n).

        Random numbers depend on the keys of the cells and a seed.
        """
        shape, first = (len(keys), len(self.weights)), 0
        columns = {name: np.zeros(shape) for name in self.kind.numbers}
        stiffness = np.reshape(self.stiffness, (len(self.weights), -1))
        for law, n in self.laws:
            at = slice(first, first + n)
            C = law.as_argument(tuple(stiffness[at].T))
            for name, value in law.numbers(C).items():
                drawn = hasattr(value, "draw")
                columns[name][:, at] = [value.draw(n, k) for k in keys] if drawn else value
            first += n
        return columns


@dataclass(frozen=True)
class Fibres(Record):
    """Number and material law of the fibres of a section, P(93).

    Args:
        law: Of each fibre; stresses in Pa.  A random limit is drawn for each fibre of each cell.
        number: Of layers of equal thickness, where the shape of the section tells their areas.
        softening: Law of the crack that opens in a fibre where the stress reaches its limit; Pa,
            J/m².

    Raises:
        SceneError: A law is none, or ``number`` is no whole number from 1.

    Example:
        >>> steel = ub.Fibres(ub.Hardening(355e6, modulus=2e9), number=16)
        >>> layered = ub.Section.rectangle(b=0.1, h=0.2, E=210e9, nu=0.3, fibres=steel)
        >>> print(f"{layered.EI:.3g}")  # of 16 layers; N m²
        1.39e+07
    """

    law: Annotated[MaterialLaw, require_bulk_law]
    _: KW_ONLY
    number: Annotated[int, require_count] = 20
    softening: Annotated[SofteningLaw | None, require_softening] = None

    __repr__ = one_line


@dataclass(frozen=True, eq=False)
class PlacedFibres:
    """Fibres at their places in a section."""

    fibres: Fibres
    E: float  # Young's modulus; Pa
    y: Array  # distances from the axis, positive to the left of its direction; (n,); m
    A: Array  # areas; (n,); m²

    __repr__ = one_line

    @classmethod
    def at(cls, fibres: Fibres, E: float, y: Sequence[float], A: Sequence[float]) -> PlacedFibres:
        """Fibres of a user; ``y`` from any line, the axis will run through their centroid."""
        y_, A_ = (
            require_array(x, f"Section.of_fibres: {name}") for name, x in (("y", y), ("A", A))
        )
        if y_.ndim != 1 or y_.shape != A_.shape or not len(y_):
            raise SceneError(
                f"Section.of_fibres: y and A must be lists of one length, not {y_.shape} and "
                f"{A_.shape}"
            )
        if not (A_ > 0).all():
            raise SceneError("Section.of_fibres: y must be finite, and all A positive")
        if np.ptp(y_) == 0.0:
            raise SceneError(
                "Section.of_fibres: all fibres at one y have no bending stiffness; spread them"
            )
        return cls(fibres, E, y_ - (A_ @ y_) / A_.sum(), A_)

    @classmethod
    def layers(
        cls, fibres: Fibres | None, E: float, h: float, below: Below, edges: Sequence[float] = ()
    ) -> PlacedFibres | None:
        """Layers of equal thickness, if any, over the depth ``h``, cut at ``edges`` too; m."""
        if fibres is None:
            return None
        require_kind(fibres, Fibres, "Section: fibres")
        if fibres.number < 2:
            raise SceneError("Fibres: number = 1 has no bending stiffness; use 2 or more")
        cuts = np.union1d(np.linspace(-h / 2, h / 2, fibres.number + 1), np.array(edges))
        cuts = cuts[np.insert(np.diff(cuts) > 1e-9 * h, 0, True)]
        A, S = np.diff(below(cuts))
        return cls(fibres, E, S / A, A)

    @property
    def EA(self) -> float:
        """Axial stiffness, the sum over all fibres; N."""
        return float(self.E * self.A.sum())

    @property
    def EI(self) -> float:
        """Bending stiffness; N m²."""
        return float(self.E * self.A @ self.y**2)

    def layout(self, GA: float) -> Layout:
        """Layout with one material point for each fibre; shear stays elastic."""
        n, softening = len(self.y), self.fibres.softening
        return Layout(
            strains=np.column_stack([np.ones(n), np.zeros(n), -self.y]),
            weights=self.A,
            stiffness=np.full(n, self.E),
            laws=((self.fibres.law, n),),
            rest=np.array([0.0, GA, 0.0]),
            softening=softening if softening is not None and softening.opens else None,
            breaking=slice(None),
        )
