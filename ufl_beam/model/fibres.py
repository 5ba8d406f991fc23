# SPDX-License-Identifier: MIT
"""Material points of a cross-section: resultants or fibres; distributions of yield stresses."""

from __future__ import annotations

import struct
from abc import ABC, abstractmethod
from collections import Counter
from collections.abc import Iterable, Sequence
from dataclasses import KW_ONLY, dataclass
from functools import cached_property, partial
from typing import Annotated, Any, NamedTuple
from zlib import crc32

import numpy as np
import numpy.typing as npt
import scipy  # its parts are loaded when they are used

from ufl_beam.arrays import Array
from ufl_beam.display import compact_repr
from ufl_beam.errors import ModelError
from ufl_beam.model.checks import require_count, require_kind
from ufl_beam.model.functions import Point
from ufl_beam.model.law_functions import Values
from ufl_beam.model.material_law import MaterialLaw, require_law, uniform
from ufl_beam.model.records import Positive, Record
from ufl_beam.model.shapes import Shape
from ufl_beam.model.softening_laws import SofteningLaw, require_softening


class Kind(NamedTuple):
    """A law with all parameters equal to 1, and the names of the parameters."""

    law: MaterialLaw
    parameters: tuple[str, ...]


@dataclass(frozen=True, eq=False)
class SectionPoints:
    """Material points of a cross-section, with their strains, weights and laws.

    The resultants of the section are sums over all points of weight times stress times ``strains``,
    plus ``rest`` times the strains of the section.
    """

    strains: Values  # derivatives of strains of points with respect to (Σ, Γ, K); (n, 3)
    weights: Values  # areas of fibres, or 1 for resultants; (n,), (1,) with interaction
    stiffness: Values  # elastic stiffness, also of each interacting resultant; (n,)
    laws: tuple[tuple[MaterialLaw, int], ...]  # (law, number of successive points)
    rest: Values  # EA, GA, EI of resultants that have no points, otherwise 0; (3,)
    softening: SofteningLaw | None  # law of hinge or cracks, if points can break
    breaking: slice  # points that can break
    hinges: bool = False  # True if the breaking point is a hinge, with a jump of rotation

    def __post_init__(self) -> None:
        _ = self.kind  # raises if the laws are of several classes

    @property
    def elastic(self) -> bool:
        """True if the points neither yield nor break."""
        return self.softening is None and not self.yields

    @property
    def yields(self) -> bool:
        """True if the law of any point can yield."""
        return any(not law.elastic for law, _ in self.laws)

    @cached_property
    def kind(self) -> Kind:
        """Law of all points, without the parameters, which differ between points."""
        laws = [law for law, _ in self.laws if not law.elastic] or [self.laws[0][0]]
        kinds: dict[Kind, MaterialLaw] = {}
        for law in laws:
            C = uniform(law, np.ones(()))
            names = tuple(law.parameters(C))
            kinds[Kind(law.with_parameters(1.0, dict.fromkeys(names, 1.0)), names)] = law
        if len(kinds) > 1:
            different = " and ".join(map(repr, kinds.values()))
            raise ModelError(f"Section: its laws must be of one class, not {different}")
        kind = next(iter(kinds))
        for law, _ in self.laws:
            if type(law) is not type(kind.law):
                raise ModelError(
                    f"Section: beside {type(kind.law).__name__}, a resultant with a law or a hinge "
                    "needs a law of the same class, with parameters at which it stays elastic"
                )
        return kind

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
        ModelError: A law has the wrong type, or ``number`` is not a whole number from 1.

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
    """Fibres with their positions and areas in a section."""

    fibres: Fibres
    E: float  # Young's modulus; Pa
    y: Array  # distances from the axis, positive to the left of its direction; (n,); m
    A: Array  # areas; (n,); m²

    __repr__ = compact_repr

    @classmethod
    def layers(cls, fibres: Fibres | None, E: float, shape: Shape) -> PlacedFibres | None:
        """Create layers of equal thickness over the depth of a shape, with cuts at its corners."""
        if fibres is None:
            return None
        require_kind(fibres, Fibres, "Section: fibres")
        if fibres.number < 2:
            raise ModelError("Fibres: number = 1 has no bending stiffness; use 2 or more")
        low, high = shape.bottom, shape.top
        corners = [y - shape.y for loop in (shape.corners, *shape.holes) for _, y, *_ in loop]
        cuts = np.union1d(np.linspace(low, high, fibres.number + 1), np.clip(corners, low, high))
        cuts = cuts[np.insert(np.diff(cuts) > 1e-9 * (high - low), 0, True)]
        A, S, _ = np.diff(shape.below(np.asarray(cuts, float)))
        return cls(fibres, E, S / A, A)

    @property
    def EA(self) -> float:
        """Axial stiffness EA; N."""
        return float(self.E * self.A.sum())

    @property
    def EI(self) -> float:
        """Bending stiffness; N m²."""
        return float(self.E * self.A @ self.y**2)

    def section_points(self, GA: float) -> SectionPoints:
        """Return one material point for each fibre, with the elastic shear stiffness ``GA`` (N)."""
        n, softening = len(self.y), self.fibres.softening
        return SectionPoints(
            strains=np.column_stack([np.ones(n), np.zeros(n), -self.y]),
            weights=self.A,
            stiffness=np.full(n, self.E),
            laws=((self.fibres.law, n),),
            rest=np.array([0.0, GA, 0.0]),
            softening=softening if softening is not None and softening.opens else None,
            breaking=slice(None),
        )


# -- distributions of yield stresses ------------------------------------------------------------


@dataclass(frozen=True)
class Distribution(Record, ABC):
    """Base of the distributions of a random quantity that is not negative.

    Each cell and each spring draws from a random stream of its own.  The key of the stream is a
    checksum of the ends of the beam and the number of the cell in the beam, or a checksum of the
    places of the spring.  So values depend on neither the number of processes nor the order of
    beams and springs, except of those between the same two points.
    """

    _: KW_ONLY
    # The same seed gives the same values again.
    seed: Annotated[int, partial(require_count, at_least=0)]

    @abstractmethod
    def _law(self) -> Any:
        """Return the distribution of SciPy."""

    def draw(self, n: int, key: tuple[int, ...]) -> npt.NDArray[np.float64]:
        """Draw ``n`` independent values from the stream ``key``; negative values become 0; (n,)."""
        stream = np.random.default_rng(np.random.SeedSequence(self.seed, spawn_key=key))
        return np.asarray(np.maximum(self._law().rvs(n, random_state=stream), 0.0))


def stream_keys(segments: Iterable[tuple[Point, Point]]) -> list[tuple[int, int]]:
    """Return a key for each pair of points: a checksum, and the number of earlier equal pairs."""
    seen: Counter[int] = Counter()
    keys = []
    for a, b in segments:
        checksum = crc32(struct.pack("4d", *a, *b))
        keys.append((checksum, seen[checksum]))
        seen[checksum] += 1
    return keys


@dataclass(frozen=True)
class _ByMoments(Distribution):
    """Base of the distributions with a mean and a standard deviation."""

    mean: Positive
    deviation: Positive


class Normal(_ByMoments):
    """Normal distribution; negative values become zero: such points yield at once.

    Args:
        mean: Mean; Pa for fibres, N or N m for resultants.
        deviation: Standard deviation; same unit.
        seed: Seed of the random streams; the same seed gives the same values again.

    Raises:
        ModelError: Mean or deviation is not positive, or the seed is not a whole number from 0.

    Example:
        >>> limit = ub.Normal(mean=355e6, deviation=25e6, seed=1)
        >>> scattered = ub.Fibres(ub.ElastoPlastic(limit), number=16)
    """

    def _law(self) -> Any:
        return scipy.stats.norm(self.mean, self.deviation)


class TruncatedNormal(_ByMoments):
    """Normal distribution with the arguments of :class:`Normal`, truncated to positive values.

    By truncation the mean exceeds ``mean``, and the deviation is less than ``deviation``.

    Example:
        >>> limit = ub.TruncatedNormal(mean=30e6, deviation=20e6, seed=1)
        >>> bool((limit.draw(100, (0, 0)) > 0).all())
        True
    """

    def _law(self) -> Any:
        return scipy.stats.truncnorm(-self.mean / self.deviation, np.inf, self.mean, self.deviation)


class Lognormal(_ByMoments):
    """Lognormal distribution with the arguments of :class:`Normal`.

    Example:
        >>> limit = ub.Lognormal(mean=355e6, deviation=25e6, seed=1)
        >>> scattered = ub.Fibres(ub.ElastoPlastic(limit), number=16)
    """

    def _law(self) -> Any:
        spread = np.sqrt(np.log1p((self.deviation / self.mean) ** 2))
        return scipy.stats.lognorm(spread, scale=self.mean * np.exp(-(spread**2) / 2))


@dataclass(frozen=True)
class Weibull(Distribution):
    """Weibull distribution of positive values, for strengths.

    Args:
        scale: Value that is exceeded with the probability exp(-1); Pa for fibres, N or N m for
            resultants.
        shape: Weibull modulus; a larger modulus means less scatter.
        seed: Seed of the random streams; the same seed gives the same values again.

    Raises:
        ModelError: Scale or shape is not positive, or the seed is not a whole number from 0.

    Example:
        >>> limit = ub.Weibull(scale=355e6, shape=20.0, seed=1)
        >>> scattered = ub.Fibres(ub.ElastoPlastic(limit), number=16)
    """

    scale: Positive
    shape: Positive

    def _law(self) -> Any:
        return scipy.stats.weibull_min(self.shape, scale=self.scale)
