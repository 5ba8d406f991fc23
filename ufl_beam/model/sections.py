# SPDX-License-Identifier: MIT
"""Cross-sections of beams, described by resultants or by fibres.

Units are SI: N, N m², kg/m, kg m.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import KW_ONLY, dataclass, field, replace
from functools import partial
from typing import Annotated, Any

import numpy as np

from ufl_beam.arrays import Array
from ufl_beam.errors import ModelError
from ufl_beam.model.checks import require_all, require_array, require_kind, require_number
from ufl_beam.model.fibres import Fibres, PlacedFibres, SectionPoints, by_class
from ufl_beam.model.material_law import MaterialLaw, require_law
from ufl_beam.model.material_laws import ElastoPlastic
from ufl_beam.model.records import Instance, NotNegative, Positive, Record
from ufl_beam.model.softening_laws import SofteningLaw, require_softening

ResultantLaw = Annotated[MaterialLaw | None, require_law]


@dataclass(frozen=True, eq=False, repr=False)
class Section(Record):
    """Stiffness and inertia of a cross-section, P(7) and P(18).

    Args:
        EA: Axial stiffness; N.
        GA: Shear stiffness, shear factor included; N.
        EI: Bending stiffness; N m².
        rhoA: Mass per length; kg/m.  Zero, the default, means a beam without mass.  Dynamics may
            warn of the default, but never warns of an explicit zero.
        rhoI: Rotary inertia per length; kg m.
        depth: Depth in the plane of motion, for pictures; m.  The default is the depth of the
            rectangle with the same EI/EA.  A beam shorter than depth/√12 causes a warning.
        axial: Inelastic law of the axial force N; N.
        shear: Inelastic law of the shear force V; N.
        bending: Inelastic law of the bending moment M; N m.
        hinge: Law of the hinge that opens in each cell where the moment reaches the limit of the
            law; N m, J.  For hinges at chosen places see :class:`Beam`.
        fibres: Fibres with their positions, instead of laws of resultants and of the hinge.  They
            come from :meth:`of_fibres`, or from shapes such as :meth:`rectangle`.
        interaction: Law of N and M together, such as :class:`AxialBending`, instead of laws of
            single resultants, the hinge and fibres.

    Raises:
        ModelError: A stiffness is not positive, a number is not finite, a law has the wrong type,
            or laws, fibres and ``interaction`` cannot be combined.

    Example:
        >>> plate = ub.Section.rectangle(b=0.1, h=0.2, E=210e9, nu=0.3, rho=7850.0)
        >>> pipe = ub.Section.tube(d=0.2, t=0.01, E=210e9, nu=0.3, rho=7850.0)
        >>> own = ub.Section(EA=4.2e9, GA=1.3e9, EI=1.4e7, rhoA=157.0, rhoI=0.5)
        >>> print(f"{plate.EI:.3g} {pipe.EI:.3g} {own.EI:.3g}")  # N m²
        1.4e+07 5.67e+06 1.4e+07
    """

    EA: Positive
    GA: Positive
    EI: Positive
    rhoA: NotNegative = field(default=None)  # type: ignore[assignment]
    rhoI: NotNegative = 0.0
    depth: NotNegative = 0.0
    _: KW_ONLY
    axial: ResultantLaw = None
    shear: ResultantLaw = None
    bending: ResultantLaw = None
    hinge: Annotated[SofteningLaw | None, require_softening] = None
    fibres: Instance[PlacedFibres | None] = None
    interaction: Annotated[MaterialLaw | None, partial(require_law, interaction=True)] = None
    massless_by_default: bool = field(init=False, repr=False)

    def __post_init__(self) -> None:
        super().__post_init__()
        object.__setattr__(self, "massless_by_default", self.rhoA is None)
        if self.rhoA is None:
            object.__setattr__(self, "rhoA", 0.0)
        if self.depth == 0.0:
            object.__setattr__(self, "depth", math.sqrt(12 * self.EI / self.EA))
        laws = [n for n in ("axial", "shear", "bending", "hinge") if getattr(self, n) is not None]
        if laws and self.fibres is not None:
            raise ModelError(
                f"Section: a law {laws[0]} beside fibres, which bear N and M, while shear is "
                "elastic; leave one out"
            )
        if self.interaction is not None and (laws or self.fibres is not None):
            law = laws[0] if laws else "fibres"
            raise ModelError(
                f"Section: {law} beside interaction, the law of N and M; leave one out"
            )
        self.section_points(self.hinge)  # raises an error if the laws cannot be combined

    def section_points(self, hinge: SofteningLaw | None) -> tuple[SectionPoints, ...]:
        """Return the material points of a cell with a hinge law, by class of their laws.

        The result is empty if no resultant has a law.
        """
        if self.fibres is not None:
            return self.fibres.section_points(self.GA)
        if hinge is not None and not hinge.opens:
            hinge = None
        stiffness, bending = np.array([self.EA, self.GA, self.EI]), self.bending
        if self.interaction is not None:
            if hinge is not None:
                raise ModelError("Section: a hinge beside interaction of N and M; leave one out")
            inelastic = np.array([name in self.interaction.resultants for name in "NVM"])
            chosen, laws = [inelastic], [self.interaction]
        else:
            if hinge is not None and bending is None:
                bending = ElastoPlastic(yield_limit=math.inf)
            resultants = self.axial, self.shear, bending
            inelastic = np.array([law is not None for law in resultants])
            chosen = [row == 1.0 for row in np.eye(3)[inelastic]]
            laws = [law for law in resultants if law is not None]
        points = [
            SectionPoints(np.eye(3)[at], np.ones(1), stiffness[at], ((law, 1),), np.zeros(3))
            for at, law in zip(chosen, laws, strict=True)
        ]
        if hinge is not None:
            points[-1] = replace(points[-1], softening=hinge, hinges=True)
        return by_class(points, np.where(inelastic, 0.0, stiffness))

    @classmethod
    def of_shape(
        cls, *, A: float, I: float, E: float, nu: float, rho: float | None, shear_factor: float,
        depth: float, fibres: PlacedFibres | None = None, **laws: Any,
    ) -> Section:  # fmt: skip
        """Create a homogeneous isotropic section of a given shape.

        Args:
            A: Area; m².
            I: Second moment of area about the axis of bending; m⁴.
            E: Young's modulus; Pa.
            nu: Poisson's ratio.
            rho: Density; kg/m³.
            shear_factor: Shear area divided by A.
            depth: Depth in the plane of motion; m.
            fibres: Fibres with positions; EA and EI are then sums over the fibres.
            laws: ``axial``, ``shear``, ``bending``, ``hinge``, ``interaction`` of :class:`Section`.
        """
        _require_positive("Section", A=A, I=I, E=E, shear_factor=shear_factor)
        require_number(depth, "Section: depth", at_least=0.0)
        if rho is not None:
            require_number(rho, "Section: rho", at_least=0.0)
        if not -1.0 < require_number(nu, "Section: nu") <= 0.5:
            raise ModelError(f"Section: nu = {nu} must lie in (-1, 0.5]")
        if fibres is not None:
            require_kind(fibres, PlacedFibres, "Section: fibres")
        GA = shear_factor * A * E / (2 * (1 + nu))
        EA, EI = (E * A, E * I) if fibres is None else (fibres.EA, fibres.EI)
        if rho is not None:
            laws |= {"rhoA": rho * A, "rhoI": rho * I}
        return cls(EA=EA, GA=GA, EI=EI, depth=depth, fibres=fibres, **laws)

    @classmethod
    def of_fibres(
        cls, y: Sequence[float], A: Sequence[float], *, E: float | Sequence[float], nu: float,
        fibres: Fibres | Sequence[Fibres], rho: float | Sequence[float] | None = None,
        shear_factor: float = 5 / 6,
    ) -> Section:  # fmt: skip
        """Create a section of fibres with areas ``A`` (m²) at coordinates ``y`` (m).

        ``E`` (Pa), ``fibres`` and ``rho`` (kg/m³) are equal for all fibres, or sequences with a
        value for each fibre.  The laws of fibres may be of different classes.  The coordinate y
        points to the left of the direction of the beam; its origin is arbitrary.  The axis of the
        beam runs through the centroid of the stiffness EA, at y = ``section.fibres.axis``, so that
        N and M are uncoupled in elastic fibres.  The mass acts at the axis.  GA is
        ``shear_factor EA / (2 (1 + nu))``.

        Raises:
            ModelError: The sequences differ in length, an area or modulus is not positive, or all
                fibres lie at one y.

        Example:
            >>> timber, steel = (ub.Fibres(ub.ElastoPlastic(limit)) for limit in (30e6, 355e6))
            >>> plated = ub.Section.of_fibres(
            ...     [-0.105, -0.075, -0.025, 0.025, 0.075], [1e-3, 5e-3, 5e-3, 5e-3, 5e-3], nu=0.3,
            ...     E=[210e9, 11e9, 11e9, 11e9, 11e9], fibres=[steel] + 4 * [timber],
            ... )  # fmt: skip
            >>> print(f"axis at y = {plated.fibres.axis:.4f} m, EA = {plated.EA:.3g} N")
            axis at y = -0.0513 m, EA = 4.3e+08 N
        """
        what = "Section.of_fibres"
        at, areas = (require_array(x, f"{what}: {name}") for name, x in (("y", y), ("A", A)))
        if at.ndim != 1 or at.shape != areas.shape or not len(at):
            raise ModelError(
                f"{what}: y and A must be lists of equal length, not {at.shape} and {areas.shape}"
            )
        if not (areas > 0).all():
            raise ModelError(f"{what}: all areas A must be positive")
        if np.ptp(at) == 0.0:
            raise ModelError(f"{what}: all fibres at one y have no bending stiffness; spread them")
        if isinstance(fibres, list | tuple):
            each = require_all(fibres, f"{what}: fibres", Fibres)
        else:
            require_kind(fibres, Fibres, f"{what}: fibres")
            each = (fibres,) * len(at)
        laws = tuple({id(law): law for law in each}.values())
        if len(each) != len(at):
            raise ModelError(f"{what}: {len(each)} fibres for {len(at)} areas; give one for each")
        material = np.array([next(i for i, x in enumerate(laws) if x is law) for law in each])
        moduli = _each(E, len(at), f"{what}: E")
        density = _each(0.0 if rho is None else rho, len(at), f"{what}: rho")
        if not (moduli > 0).all() or not (density >= 0).all():
            raise ModelError(f"{what}: E must be positive, and rho must not be negative")
        placed = PlacedFibres.about_centroid(laws, material, moduli, at, areas)
        mass = density * areas
        mean, total = placed.EA / float(areas.sum()), float(areas.sum())
        return cls.of_shape(
            A=total, I=placed.EI / mean, E=mean, nu=nu, rho=None, shear_factor=shear_factor,
            depth=float(np.ptp(at)), fibres=placed,
            **({} if rho is None else {"rhoA": mass.sum(), "rhoI": mass @ placed.y**2}),
        )  # fmt: skip

    def reinforced(
        self, y: Sequence[float], A: Sequence[float], *, E: float, fibres: Fibres
    ) -> Section:
        """Return the section with bars of areas ``A`` (m²) at coordinates ``y`` (m).

        The section has fibres, of which the bars displace their areas.  The coordinate y is
        measured from mid-depth of a shape, or as in :meth:`of_fibres`.  The axis moves to the
        centroid of the stiffness EA, at y = ``fibres.axis`` of the new section.  GA and mass do not
        change: the density of reinforced concrete includes the bars.

        Args:
            y: Coordinates of the bars, or of rows of bars; m.
            A: Area of each bar or row; m².
            E: Young's modulus of the bars; Pa.
            fibres: Law of the bars; its ``number`` has no meaning.

        Raises:
            ModelError: The section has no fibres, the lengths of ``y`` and ``A`` differ, an area is
                not positive, a bar lies outside the section, or bars displace more than there is.

        Example:
            >>> cover, core, steel = (ub.Fibres(ub.ElastoPlastic(x)) for x in (30e6, 40e6, 5e8))
            >>> column = ub.Section.rectangle(
            ...     b=0.3, h=0.4, E=30e9, nu=0.2, rho=2500.0, fibres=cover, core=core, cover=0.03
            ... ).reinforced(y=[-0.15, 0.15], A=[1e-3, 1e-3], E=200e9, fibres=steel)
            >>> print(f"{column.EA:.3g} {column.EI:.3g}")  # N, N m²
            3.94e+09 5.55e+07
        """
        what = "Section.reinforced"
        if self.fibres is None:
            raise ModelError(
                f"{what}: the section has no fibres; create it with fibres=Fibres(law)"
            )
        require_kind(fibres, Fibres, f"{what}: fibres")
        require_number(E, f"{what}: E", positive=True)
        at, areas = (require_array(x, f"{what}: {name}") for name, x in (("y", y), ("A", A)))
        if at.ndim != 1 or at.shape != areas.shape or not (areas > 0).all():
            raise ModelError(f"{what}: y and A must be lists of equal length, with positive areas")
        placed = self.fibres.with_bars(fibres, E, at, areas)
        rhoA: Any = None if self.massless_by_default else self.rhoA
        return replace(self, EA=placed.EA, EI=placed.EI, rhoA=rhoA, fibres=placed)

    @classmethod
    def rectangle(
        cls, b: float, h: float, *, E: float, nu: float, rho: float | None = None,
        shear_factor: float = 5 / 6, fibres: Fibres | None = None, core: Fibres | None = None,
        cover: float = 0.0, **laws: Any,
    ) -> Section:  # fmt: skip
        """Create a rectangle of width ``b`` and depth ``h``, the size in the plane of motion; m.

        With ``core``, the fibres farther than ``cover`` (m) from the surface have this law.
        """
        _require_positive("Section.rectangle", b=b, h=h)
        _require_cover("Section.rectangle", core, cover, min(b, h))
        placed = PlacedFibres.layers(
            fibres, E, h, lambda y: _below_in_rectangle(y, b, h), core=core,
            below_in_core=lambda y: _below_in_rectangle(y, b - 2 * cover, h - 2 * cover),
            edges=(cover - h / 2, h / 2 - cover),
        )  # fmt: skip
        return cls.of_shape(
            A=b * h, I=b * h**3 / 12, E=E, nu=nu, rho=rho,
            shear_factor=shear_factor, depth=h, fibres=placed, **laws,
        )  # fmt: skip

    @classmethod
    def circle(
        cls, d: float, *, E: float, nu: float, rho: float | None = None,
        shear_factor: float = 9 / 10, fibres: Fibres | None = None, core: Fibres | None = None,
        cover: float = 0.0, **laws: Any,
    ) -> Section:  # fmt: skip
        """Create a solid circle of diameter ``d``; m.

        With ``core``, the fibres farther than ``cover`` (m) from the surface have this law.
        """
        _require_positive("Section.circle", d=d)
        _require_cover("Section.circle", core, cover, d)
        placed = PlacedFibres.layers(
            fibres, E, d, lambda y: _below_in_circle(y, d), core=core,
            below_in_core=lambda y: _below_in_circle(y, d - 2 * cover),
            edges=(cover - d / 2, d / 2 - cover),
        )  # fmt: skip
        return cls.of_shape(
            A=math.pi * d**2 / 4, I=math.pi * d**4 / 64, E=E, nu=nu, rho=rho,
            shear_factor=shear_factor, depth=d, fibres=placed, **laws,
        )  # fmt: skip

    @classmethod
    def tube(
        cls, d: float, t: float, *, E: float, nu: float, rho: float | None = None,
        shear_factor: float = 1 / 2, fibres: Fibres | None = None, **laws: Any,
    ) -> Section:  # fmt: skip
        """Create a circular tube of outer diameter ``d`` and wall thickness ``t``; m."""
        _require_positive("Section.tube", d=d, t=t)
        if 2 * t > d:
            raise ModelError(
                f"Section.tube: wall t = {t} m is thicker than the radius of d = {d} m"
            )
        inner = d - 2 * t
        edges = (-inner / 2, inner / 2)
        placed = PlacedFibres.layers(
            fibres, E, d, lambda y: _below_in_circle(y, d) - _below_in_circle(y, inner), edges
        )
        return cls.of_shape(
            A=math.pi * (d**2 - inner**2) / 4, I=math.pi * (d**4 - inner**4) / 64,
            E=E, nu=nu, rho=rho, shear_factor=shear_factor, depth=d, fibres=placed, **laws,
        )  # fmt: skip

    @classmethod
    def i_shape(
        cls, h: float, b: float, tw: float, tf: float, *, E: float, nu: float,
        rho: float | None = None, fibres: Fibres | None = None, **laws: Any,
    ) -> Section:  # fmt: skip
        """Create a symmetric I: depth h, width b, thickness tw of the web and tf of the flanges; m.

        The section bends about the strong axis.  The shear area is ``tw (h - tf)``.
        """
        _require_positive("Section.i_shape", h=h, b=b, tw=tw, tf=tf)
        if 2 * tf >= h or tw > b:
            raise ModelError(
                f"Section.i_shape: web and flanges do not fit: h = {h}, b = {b}, tw = {tw}, "
                f"tf = {tf} m"
            )
        web = h - 2 * tf
        A = 2 * b * tf + tw * web
        placed = PlacedFibres.layers(
            fibres, E, h,
            lambda y: _below_in_rectangle(y, b, h) - _below_in_rectangle(y, b - tw, web),
            edges=(-web / 2, web / 2),
        )  # fmt: skip
        return cls.of_shape(
            A=A, I=(b * h**3 - (b - tw) * web**3) / 12, E=E, nu=nu, rho=rho,
            shear_factor=tw * (h - tf) / A, depth=h, fibres=placed, **laws,
        )  # fmt: skip


def _below_in_rectangle(y: Array, b: float, h: float) -> Array:
    """Return the area up to y and its first moment, each up to a constant; (2, n); m², m³."""
    y = np.clip(y, -h / 2, h / 2)
    return np.array([b * y, b * y**2 / 2])


def _below_in_circle(y: Array, d: float) -> Array:
    """Return the area up to y and its first moment, each up to a constant; (2, n); m², m³."""
    r = d / 2
    y = np.clip(y, -r, r)
    half_chord = np.sqrt((r - y) * (r + y))  # this product is never negative
    area = y * half_chord + (r**2 * np.arcsin(y / r) if r else 0.0)
    return np.array([area, -2 / 3 * half_chord**3])


def _require_positive(owner: str, **sizes: float) -> None:
    for name, value in sizes.items():
        require_number(value, f"{owner}: {name}", positive=True)


def _require_cover(owner: str, core: object, cover: float, size: float) -> None:
    """Raise :class:`ModelError` unless ``core`` and ``cover`` fit a section of this size (m)."""
    require_kind(core, (Fibres, type(None)), f"{owner}: core")
    require_number(cover, f"{owner}: cover", at_least=0.0)
    if core is None and cover > 0.0:
        raise ModelError(f"{owner}: cover without core; give the law of the core, too")
    if core is not None and not 0.0 < 2 * cover < size:
        raise ModelError(
            f"{owner}: cover = {cover} m leaves no core, or no cover, in a section of {size} m"
        )


def _each(values: float | Sequence[float], n: int, what: str) -> Array:
    """Return a value for each of n fibres, from one number or from n numbers."""
    numbers = require_array(values, what)
    if numbers.ndim and numbers.shape != (n,):
        raise ModelError(f"{what} has shape {numbers.shape}; give a number, or {n} numbers")
    return np.array(np.broadcast_to(numbers, n))
