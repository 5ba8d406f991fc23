# SPDX-License-Identifier: MIT
"""Cross-sections of beams, described by resultants or by fibres.

Units are SI: N, N m², kg/m, kg m.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import KW_ONLY, dataclass, field
from functools import partial
from typing import Annotated, Any

import numpy as np

from ufl_beam.arrays import Array
from ufl_beam.errors import ModelError
from ufl_beam.model.checks import require_array, require_kind, require_number
from ufl_beam.model.fibres import Fibres, PlacedFibres, SectionPoints
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

    def section_points(self, hinge: SofteningLaw | None) -> SectionPoints | None:
        """Return the material points of a cell with a hinge law; None if the cell is elastic."""
        if self.fibres is not None:
            return self.fibres.section_points(self.GA)
        if hinge is not None and not hinge.opens:
            hinge = None
        stiffness, bending = np.array([self.EA, self.GA, self.EI]), self.bending
        if self.interaction is not None:
            if hinge is not None:
                raise ModelError("Section: a hinge beside interaction of N and M; leave one out")
            inelastic = np.array([name in self.interaction.resultants for name in "NVM"])
            laws = [(self.interaction, 1)]
        else:
            if hinge is not None and bending is None:
                bending = ElastoPlastic(yield_limit=math.inf)
            inelastic = np.array([law is not None for law in (self.axial, self.shear, bending)])
            laws = [(law, 1) for law in (self.axial, self.shear, bending) if law is not None]
        if not laws:
            return None
        return SectionPoints(
            strains=np.eye(3)[inelastic],
            weights=np.ones(len(laws)),
            stiffness=stiffness[inelastic],
            laws=tuple(laws),
            rest=np.where(inelastic, 0.0, stiffness),
            softening=hinge,
            breaking=slice(len(laws) - 1, None),
            hinges=hinge is not None,
        )

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
        cls, y: Sequence[float], A: Sequence[float], *, E: float, nu: float, fibres: Fibres,
        rho: float | None = None, shear_factor: float = 5 / 6,
    ) -> Section:  # fmt: skip
        """Create a section of fibres with areas ``A`` (m²) at coordinates ``y`` (m).

        The coordinate y points to the left of the direction of the beam; its origin is arbitrary.
        The axis of the beam runs through the centroid of the fibres.

        Raises:
            ModelError: The lengths of ``y`` and ``A`` differ, an area is not positive, or all
                fibres lie at one y.
        """
        require_kind(fibres, Fibres, "Section.of_fibres: fibres")
        require_number(E, "Section: E", positive=True)
        at, areas = (
            require_array(x, f"Section.of_fibres: {name}") for name, x in (("y", y), ("A", A))
        )
        if at.ndim != 1 or at.shape != areas.shape or not len(at):
            raise ModelError(
                f"Section.of_fibres: y and A must be lists of equal length, not {at.shape} and "
                f"{areas.shape}"
            )
        if not (areas > 0).all():
            raise ModelError("Section.of_fibres: all areas A must be positive")
        total, depth = float(areas.sum()), float(np.ptp(at))
        if depth == 0.0:
            raise ModelError(
                "Section.of_fibres: all fibres at one y have no bending stiffness; spread them"
            )
        placed = PlacedFibres(fibres, E, at - (areas @ at) / total, areas)
        return cls.of_shape(
            A=total, I=placed.EI / E, E=E, nu=nu, rho=rho,
            shear_factor=shear_factor, depth=depth, fibres=placed,
        )  # fmt: skip

    @classmethod
    def rectangle(
        cls, b: float, h: float, *, E: float, nu: float, rho: float | None = None,
        shear_factor: float = 5 / 6, fibres: Fibres | None = None, **laws: Any,
    ) -> Section:  # fmt: skip
        """Create a rectangle of width ``b`` and depth ``h``, the size in the plane of motion; m."""
        _require_positive("Section.rectangle", b=b, h=h)
        placed = PlacedFibres.layers(fibres, E, h, lambda y: _below_in_rectangle(y, b, h))
        return cls.of_shape(
            A=b * h, I=b * h**3 / 12, E=E, nu=nu, rho=rho,
            shear_factor=shear_factor, depth=h, fibres=placed, **laws,
        )  # fmt: skip

    @classmethod
    def circle(
        cls, d: float, *, E: float, nu: float, rho: float | None = None,
        shear_factor: float = 9 / 10, fibres: Fibres | None = None, **laws: Any,
    ) -> Section:  # fmt: skip
        """Create a solid circle of diameter ``d``; m."""
        _require_positive("Section.circle", d=d)
        placed = PlacedFibres.layers(fibres, E, d, lambda y: _below_in_circle(y, d))
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
